// Fig. 11 of the paper: four increasingly wrong starts, made by turning f(A) against g(B), and what
// the optimisation makes of them. A texture of A, carried to B.

#include "figure.hpp"

#include <Eigen/Geometry>

int fig11_starts(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"hand"});
  const figure::Pair pair = figure::read_pair(args.pairs[0]);
  const double degrees[] = {0, 15, 30, 60};
  const ism::Embedding start = figure::embed(pair, args.options);
  const ism::Points2 centered = start.f.rowwise() - start.f.colwise().mean();
  render::Canvas canvas(1310, 810);
  picture::Axes axes;
  std::vector<ism::SurfaceMap> maps;
  const auto panel = [](int column, int row) -> render::Rect {
    return {10.0 + 260 * column, 50.0 + 400 * row, 240, 340};
  };
  for (int i = 0; i < 4; ++i) {
    ism::Options options = args.options;
    const double angle = degrees[i] * 3.14159265358979323846 / 180;
    options.initial_f = centered * Eigen::Rotation2Dd(-angle).toRotationMatrix();
    options.initial_f.rowwise() += start.f.colwise().mean();
    options.initial_g = start.g;
    const ism::Result r = figure::optimize(pair, options);
    const ism::SurfaceMap map = figure::map_of(r);
    maps.push_back(map);
    if (i == 0) {
      axes = picture::scene_of(map).axes;
      picture::draw_texture(picture::scene_of(map, axes), ism::Side::kA, panel(0, 0), canvas);
      canvas.text({20, 34}, 14, "A");
    }
    picture::draw_texture(picture::scene_of(figure::start_of(r), axes), ism::Side::kB,
                          panel(i + 1, 0), canvas);
    picture::draw_texture(picture::scene_of(map, axes), ism::Side::kB, panel(i + 1, 1), canvas);
    canvas.text({panel(i + 1, 0).x + 10, 34}, 11,
                figure::format("turned by %.0f: %.2f", degrees[i], r.initial.mean_distortion));
    canvas.text({panel(i + 1, 1).x + 10, 420 + 10}, 11,
                figure::format("after %zu: %.3f", r.log.size(), r.final_state().mean_distortion));
  }
  canvas.text({20, 600}, 11, "top: starts");
  canvas.text({20, 630}, 11, "bottom: ends");
  canvas.text({20, 660}, 11, "with distortion");
  return figure::finish(
      args, canvas,
      {{"turned by 15, the same map is found", figure::apart(maps[1], maps[0]) < figure::kSame},
       {"turned by 60, another one is", figure::apart(maps[3], maps[0]) > figure::kSame}});
}

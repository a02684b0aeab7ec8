// Fig. 13 of the paper: the same pair with more and more landmarks, in blue. A texture of A, and
// what the maps make of it on B. Landmarks guide the start only.

#include "figure.hpp"

#include <algorithm>

int fig13_landmarks(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"hand"});
  const figure::Pair all = figure::read_pair(args.pairs[0]);
  const std::size_t n = all.landmarks.size();
  const std::size_t counts[] = {n, n / 2, std::min(n, std::max<std::size_t>(n / 4, 2)), 0};
  render::Canvas canvas(1310, 500);
  std::vector<ism::SurfaceMap> maps;
  std::vector<double> ends;  // distortion
  picture::Axes axes;        // those of the map with all landmarks
  const auto panel = [](std::size_t column) -> render::Rect {
    return {10 + 260 * static_cast<double>(column), 60, 240, 420};
  };
  for (std::size_t i = 0; i < 4; ++i) {
    figure::Pair pair = all;
    pair.landmarks.resize(counts[i]);
    const ism::Result r = figure::optimize(pair, args.options);
    const ism::SurfaceMap map = figure::map_of(r);
    maps.push_back(map);
    ends.push_back(r.final_state().mean_distortion);
    if (i == 0) {
      axes = picture::scene_of(map).axes;
      picture::draw_texture(picture::scene_of(map, axes), ism::Side::kA, panel(0), canvas);
    }
    const render::Rect place = panel(4 - i);
    const picture::Scene scene = picture::scene_of(map, axes);
    picture::draw_texture(scene, ism::Side::kB, place, canvas);
    picture::draw_landmarks(scene, ism::Side::kB, place, pair.landmarks, canvas);
    canvas.text({place.x + 10, 28}, 12,
                figure::format("(%c) %zu landmarks", static_cast<char>('e' - i), counts[i]));
    canvas.text({place.x + 10, 50}, 9,
                figure::format("distortion %.3f", r.final_state().mean_distortion));
  }
  canvas.text({20, 28}, 12, "(a) A");
  return figure::finish(
      args, canvas,
      {{"half of the landmarks are enough", figure::apart(maps[1], maps[0]) < figure::kSame},
       {"without landmarks a map as good as that with all is found", ends[3] < 1.01 * ends[0]}});
}

// Fig. 9 of the paper: projected Newton (PN), with memory (SPN), and with the preconditioner as
// well (full), from a challenging start: the boundaries are held along one square, and no landmark
// in the interior tells what belongs together. A texture of A, carried to B by each map.

#include "figure.hpp"

namespace {

/// Only the landmarks that lie on both boundaries.
std::vector<ism::Landmark> on_boundaries(const figure::Pair& pair) {
  const auto a = picture::boundary_vertices(pair.a), b = picture::boundary_vertices(pair.b);
  std::vector<ism::Landmark> result;
  for (const ism::Landmark& l : pair.landmarks)
    if (a.count(l.a) > 0 && b.count(l.b) > 0) result.push_back(l);
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"hand", "starfish"});
  const char* const names[] = {"PN", "SPN", "full"};
  const double height = 340;
  render::Canvas canvas(1280, static_cast<int>(60 + height * 2));
  const char* const captions[] = {"A", "start", "PN", "SPN", "full"};
  for (int i = 0; i < 5; ++i) canvas.text({20.0 + 255 * i, 34}, 14, captions[i]);
  for (std::size_t row = 0; row < 2; ++row) {
    figure::Pair pair = figure::read_pair(args.pairs[row]);
    pair.landmarks = on_boundaries(pair);
    const double top = 50 + height * static_cast<double>(row);
    const auto panel = [&](int column) -> render::Rect {
      return {10.0 + 255 * column, top + 10, 240, height - 60};
    };
    picture::Axes axes;
    for (int i = 2; i >= 0; --i) {  // the directions are those of the full method
      ism::Options options = args.options;
      options.boundary = ism::Boundary::kFixed;
      options.variant = static_cast<ism::Variant>(i);
      const ism::Result r = figure::optimize(pair, options);
      if (i == 2) {
        axes = picture::scene_of(figure::map_of(r)).axes;
        const picture::Scene start = picture::scene_of(figure::start_of(r), axes);
        picture::draw_texture(start, ism::Side::kA, panel(0), canvas);
        picture::draw_texture(start, ism::Side::kB, panel(1), canvas);
        canvas.text({panel(1).x + 10, top + height - 20}, 9,
                    figure::format("distortion %.3f", r.initial.mean_distortion));
      }
      picture::draw_texture(picture::scene_of(figure::map_of(r), axes), ism::Side::kB, panel(i + 2),
                            canvas);
      canvas.text(
          {panel(i + 2).x + 10, top + height - 20}, 9,
          figure::format("%.3f, %zu iterations", r.final_state().mean_distortion, r.log.size()));
      std::printf("  %s\n", names[i]);
    }
  }
  figure::save(args.picture, canvas);
  return 0;
}

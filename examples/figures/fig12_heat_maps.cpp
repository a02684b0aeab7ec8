// Fig. 12 of the paper: heat maps of the distortion of maps between animals, with landmarks that
// are kept, in blue. The columns are the pairs that are named.

#include "figure.hpp"

namespace {

/// True if the two images of every landmark, which are vertices, are one point of the plane.
bool are_kept(const std::vector<ism::Landmark>& landmarks, const ism::Result& r) {
  for (const ism::Landmark& l : landmarks)
    if (r.f.row(l.a.vertex) != r.g.row(l.b.vertex)) return false;
  return true;
}

}  // namespace

int fig12_heat_maps(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"starfish"});
  constexpr int kWidth = 420, kHeight = 340;
  const int n = static_cast<int>(args.pairs.size());
  render::Canvas canvas(kWidth * n + 20, 2 * kHeight + 150);
  std::vector<figure::Claim> claims;
  for (int i = 0; i < n; ++i) {
    const figure::Pair pair = figure::read_pair(args.pairs[static_cast<std::size_t>(i)]);
    ism::Options options = args.options;
    options.exact_landmarks = true;
    const ism::Result r = figure::optimize(pair, options);
    const picture::Scene scene = picture::scene_of(figure::map_of(r));
    const double left = 10 + kWidth * i;
    for (int row = 0; row < 2; ++row) {
      const ism::Side side = row == 0 ? ism::Side::kA : ism::Side::kB;
      const render::Rect panel = {left, 60.0 + kHeight * row, kWidth - 20.0, kHeight - 20.0};
      picture::draw_heat(scene, side, panel, canvas);
      picture::draw_landmarks(scene, side, panel, pair.landmarks, canvas);
    }
    canvas.text({left + 10, 30}, 12, pair.name);
    canvas.text({left + 10, 50}, 9,
                figure::format("%zu landmarks, distortion %.3f", pair.landmarks.size(),
                               r.final_state().mean_distortion));
    claims.push_back({pair.name + ": landmarks are kept", are_kept(pair.landmarks, r)});
    claims.push_back({pair.name + ": the map is injective", figure::is_proved(scene.map)});
  }
  picture::draw_heat_legend({0.5 * (kWidth * n + 20) - 160, 2 * kHeight + 100.0, 320, 16}, canvas);
  return figure::finish(args, canvas, claims);
}

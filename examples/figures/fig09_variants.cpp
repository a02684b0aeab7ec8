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
    if (a.count(l.a.vertex) > 0 && b.count(l.b.vertex) > 0) result.push_back(l);
  return result;
}

/// What all variants start from.
struct Start {
  figure::Pair pair;
  ism::Options options;
};

Start common_start(const std::string& folder, const ism::Options& given) {
  Start start = {figure::read_pair(folder), given};
  start.pair.landmarks = on_boundaries(start.pair);
  start.options.boundary = ism::Boundary::kFixed;
  const ism::Embedding embedding = figure::embed(start.pair, start.options);
  start.pair.a = *embedding.a;
  start.pair.b = *embedding.b;
  start.options.initial_f = embedding.f;
  start.options.initial_g = embedding.g;
  return start;
}

/// Options of PN, SPN and the full method.
ism::Options options_of(int variant, ism::Options options) {
  options.coarsest = 0;  // all begin at the embedding
  if (variant < 2) options.omega_start = 0;
  if (variant < 1) options.history_length = 1;
  return options;
}

}  // namespace

int fig09_variants(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"hand", "starfish"});
  constexpr double kHeight = 340;  // of a row
  constexpr double kAsLow = 1.05;  // beyond that of an isometry
  const char* const captions[] = {"A", "start", "PN", "SPN", "full"};
  render::Canvas canvas(1280, static_cast<int>(kHeight) * static_cast<int>(args.pairs.size()) + 60);
  for (int i = 0; i < 5; ++i) canvas.text({20.0 + 255 * i, 34}, 14, captions[i]);
  std::vector<figure::Claim> claims;
  for (std::size_t row = 0; row < args.pairs.size(); ++row) {
    const Start start = common_start(args.pairs[row], args.options);
    const double top = 50 + kHeight * static_cast<double>(row);
    const auto panel = [&](int column) -> render::Rect {
      return {10.0 + 255 * column, top + 10, 240, kHeight - 60};
    };
    const auto caption = [&](int column, const std::string& words) {
      canvas.text({20.0 + 255 * column, top + kHeight - 20}, 9, words);
    };
    picture::Axes axes;
    double ends[3];
    for (int i = 2; i >= 0; --i) {  // the directions to look along are those of the full method
      const ism::Result r = figure::optimize(start.pair, options_of(i, start.options));
      const ism::SurfaceMap map = figure::map_of(r);
      if (i == 2) {
        axes = picture::scene_of(map).axes;
        const picture::Scene scene = picture::scene_of(figure::start_of(r), axes);
        picture::draw_texture(scene, ism::Side::kA, panel(0), canvas);
        picture::draw_texture(scene, ism::Side::kB, panel(1), canvas);
        caption(1, figure::format("distortion %.3f", r.initial.mean_distortion));
      }
      picture::draw_texture(picture::scene_of(map, axes), ism::Side::kB, panel(i + 2), canvas);
      caption(i + 2, figure::format("%.3f, %zu iterations", r.final_state().mean_distortion,
                                    r.log.size()));
      ends[i] = figure::excess(figure::map_of(r));
    }
    claims.push_back(
        {start.pair.name + ": SPN ends lower than PN, or as low", ends[1] < kAsLow * ends[0]});
    claims.push_back({start.pair.name + ": the full method ends lower than SPN, or as low",
                      ends[2] < kAsLow * ends[1]});
  }
  return figure::finish(args, canvas, claims);
}

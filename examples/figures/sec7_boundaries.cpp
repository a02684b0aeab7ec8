// §7 of the paper, inset: a free boundary, with which a starfish assumes its natural shape in the
// plane, and a fixed one; and one that slides. Top: the plane, A in blue over B in red; below: heat
// maps of the distortion on B.

#include "figure.hpp"

#include <algorithm>

namespace {

bool is_covered(const ism::IterationLog& state) {
  return std::min(state.coverage_a, state.coverage_b) > 1 - 1e-9;
}

/// What the planar shapes of both surfaces have of distortion, beyond none.
double bend(const ism::IterationLog& state) { return state.energy_f + state.energy_g - 8; }

}  // namespace

int sec7_boundaries(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"starfish"});
  const figure::Pair pair = figure::read_pair(args.pairs[0]);
  const char* const names[] = {"free", "fixed", "sliding"};
  std::vector<ism::IterationLog> ends;
  render::Canvas canvas(1250, 960);
  for (int i = 0; i < 3; ++i) {
    ism::Options options = args.options;
    options.boundary = static_cast<ism::Boundary>(i);
    const ism::Result r = figure::optimize(pair, options);
    const picture::Scene scene = picture::scene_of(figure::map_of(r));
    const double left = 10 + 415.0 * i;
    ism::Points2 both(r.f.rows() + r.g.rows(), 2);
    both << r.f, r.g;
    const Eigen::Vector2d lo = both.colwise().minCoeff(), hi = both.colwise().maxCoeff();
    const render::Rect plane = {left, 60, 390, 390};
    figure::draw_plane(r.g, figure::edges_of(*r.start.b), lo, hi, plane, 0.5, figure::kRed, canvas);
    figure::draw_plane(r.f, figure::edges_of(*r.start.a), lo, hi, plane, 0.5, figure::kBlue,
                       canvas);
    picture::draw_heat(scene, ism::Side::kB, {left, 480, 390, 400}, canvas);
    canvas.text({left + 10, 30}, 13, names[i]);
    canvas.text({left + 10, 50}, 9,
                figure::format("distortion %.3f, %zu iterations", r.final_state().mean_distortion,
                               r.log.size()));
    ends.push_back(r.final_state());
  }
  picture::draw_heat_legend({465, 910, 320, 16}, canvas);
  return figure::finish(
      args, canvas,
      {{"free boundaries have the least distortion, fixed ones the most",
        ends[0].mean_distortion < ends[2].mean_distortion &&
            ends[2].mean_distortion < ends[1].mean_distortion},
       {"free boundaries let both surfaces keep more of their shapes in the plane",
        bend(ends[0]) < 0.5 * bend(ends[1])},
       {"fixed and sliding ones cover both surfaces", is_covered(ends[1]) && is_covered(ends[2])}});
}

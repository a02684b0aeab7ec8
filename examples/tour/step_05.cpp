// Step 5 of tour.md: the objective, and why the map is optimised end to end.

#include "tour.hpp"

#include <cmath>

namespace {

/// E of an iterate, from its parts; surfaces are scaled to area 1, so coverage is area.
double objective(const ism::IterationLog& x, const ism::Options& options) {
  const double kappa = options.coverage_weight + options.measure.isometry();
  return x.map_energy - kappa * (x.coverage_a + x.coverage_b) + 3e-4 * (x.energy_f + x.energy_g);
}

/// Both surfaces, coloured by the distortion of a map.
void draw_half(const picture::Scene& scene, double left, const std::string& title,
               const ism::IterationLog& state, const std::vector<ism::Landmark>& landmarks,
               render::Canvas& canvas) {
  for (ism::Side side : {ism::Side::kA, ism::Side::kB}) {
    const bool is_a = side == ism::Side::kA;
    const render::Rect panel = {left + (is_a ? 0 : 235), 85, 225, 330};
    picture::draw_heat(scene, side, panel, canvas);
    picture::draw_landmarks(scene, side, panel, landmarks, canvas);
    canvas.text({panel.x + 5, 100}, 11, is_a ? "A" : "B", is_a ? tour::kBlue : tour::kOrange);
  }
  canvas.text({left + 5, 30}, 12, title);
  canvas.text({left + 5, 56}, 9,
              tour::format("E_f %.2f, E_g %.2f, E_Phi per area %.2f", state.energy_f,
                           state.energy_g, state.mean_distortion));
}

}  // namespace

void step_05(tour::Report& report) {
  const tour::Pair pair = tour::read_pair("hand");
  const ism::Landmark little_finger = pair.landmarks[3], thumb = pair.landmarks[4];

  const std::vector<ism::Landmark> landmarks = {{thumb.a, thumb.b, 0},  // 0: for the start only
                                                {little_finger.a, little_finger.b, 0}};
  ism::Options options;
  options.candidates = false;  // the landmarks decide
  const ism::Embedding alone = ism::initial_embedding(pair.a, pair.b, landmarks, options);
  const ism::Result result = ism::compute_map(pair.a, pair.b, landmarks);

  options.initial_f = alone.f, options.initial_g = alone.g;
  options.max_iterations = 0;
  const ism::IterationLog start = ism::compute_map(pair.a, pair.b, {}, options).initial;
  const ism::IterationLog& end = result.final_state();

  report.check(ism::is_usable(result.status), "there is a map");
  for (const ism::IterationLog* x : {&start, &end})
    report.check(
        std::abs(objective(*x, options) - x->energy) < 1e-9,
        tour::format("E %.3f: E_Phi %.3f, covered %.3f and %.3f, E_f %.3f, E_g %.3f", x->energy,
                     x->map_energy, x->coverage_a, x->coverage_b, x->energy_f, x->energy_g));
  report.check(start.mean_distortion > 6 && start.mean_distortion < 16 && end.mean_distortion < 2.6,
               tour::format("E_Phi per area falls from %.2f to %.2f", start.mean_distortion,
                            end.mean_distortion));
  report.check_number("E_f at the start", start.energy_f, 16, 0.2);
  report.check_number("E_g at the start", start.energy_g, 16, 0.2);
  report.check_number("E_f at the end", end.energy_f, 100, 0.2);
  report.check_number("E_g at the end", end.energy_g, 100, 0.2);
  report.check_number("E_Phi per area at the start", start.mean_distortion, 9.7, 0.2);
  report.check_number("E_Phi per area at the end", end.mean_distortion, 2.17, 0.1);
  report.check(end.energy_f > 1.5 * start.energy_f && end.energy_g > 1.5 * start.energy_g,
               tour::format("E_f grows from %.2f to %.2f, E_g from %.2f to %.2f", start.energy_f,
                            end.energy_f, start.energy_g, end.energy_g));
  render::Canvas canvas(960, 480);
  const picture::Scene after = picture::scene_of(ism::SurfaceMap(result));
  const picture::Scene before = picture::scene_of(
      ism::SurfaceMap(pair.a, pair.b, alone.f, alone.g), after.axes);
  draw_half(before, 10, "f and g, each good on its own", start, landmarks, canvas);
  draw_half(after, 490, "optimised end to end", end, landmarks, canvas);
  picture::draw_heat_legend({320, 440, 320, 14}, canvas);
  report.save(canvas);
}

// Step 7 of tour.md: the memory and the preconditioner.

#include "tour.hpp"

#include <algorithm>
#include <cmath>

namespace {

ism::Options variant(double omega, int memory) {
  ism::Options options;
  options.omega_start = omega;      // the first ω; 0: no preconditioner
  options.history_length = memory;  // 1: the newest derivatives alone
  options.coarsest = 0;             // begins on the meshes given
  return options;
}

struct Variant {
  std::string name;
  render::Color color;
  ism::Result result;
};

std::vector<double> energies(const ism::Result& result) {
  std::vector<double> E = {result.initial.energy};
  for (const ism::IterationLog& x : result.log) E.push_back(x.energy);
  return E;
}

/// B at the end of a run, coloured by the distortion.
void draw_end(const ism::Result& result, const render::Rect& panel, const std::string& title,
              render::Canvas& canvas) {
  const picture::Scene scene =
      picture::scene_of(ism::SurfaceMap(result), {tour::from_the_front(), tour::from_the_front()});
  picture::draw_heat(scene, ism::Side::kB, panel, canvas);
  canvas.text({panel.x, 48}, 9, title);
}

}  // namespace

void step_07(tour::Report& report) {
  const tour::Pair pair = tour::sheets(12);
  const ism::Points2 f = tour::seen_from_above(pair.a), g = tour::seen_from_above(pair.b);
  std::vector<Variant> variants = {
      {"neither", tour::kGrey, {}}, {"memory", tour::kGreen, {}}, {"both", tour::kRed, {}}};
  for (std::size_t i = 0; i < 3; ++i) {
    ism::Options options = variant(i == 2 ? 1e4 : 0, i == 0 ? 1 : 6);
    options.initial_f = f;
    options.initial_g = g;
    variants[i].result = ism::compute_map(pair.a, pair.b, {}, options);
    const ism::Result& r = variants[i].result;
    report.check(ism::is_usable(r.status),
                 tour::format("%s: E from %.3f to %.3f in %zu iterations, E_Phi per area %.3f, "
                              "covered %.3f and %.3f",
                              variants[i].name.c_str(), r.initial.energy, r.final_state().energy,
                              r.log.size(), r.final_state().mean_distortion,
                              r.final_state().coverage_a, r.final_state().coverage_b));
  }
  report.check(
      variants[2].result.final_state().energy < variants[1].result.final_state().energy - 0.15,
      "with both, E ends far below");

  const double omega = variants[2].result.final_state().omega;
  report.check(omega < 1e-2, tour::format("omega falls from 10000 to %.1e", omega));
  const double said[] = {2.19, 2.19, 2.015};
  for (std::size_t i = 0; i < 3; ++i)
    report.check_number("E_Phi per area", variants[i].result.final_state().mean_distortion, said[i],
                        0.03);
  report.check(std::abs(variants[1].result.final_state().energy + 0.02) < 0.05 &&
                   std::abs(variants[2].result.final_state().energy + 0.26) < 0.05,
               "E ends near -0.02 and -0.26");
  render::Canvas canvas(960, 340);
  draw_end(variants[1].result, {15, 70, 285, 190}, "memory alone: the end", canvas);
  draw_end(variants[2].result, {315, 70, 285, 190}, "both: the end", canvas);
  picture::draw_heat_legend({150, 300, 300, 12}, canvas);
  canvas.text({15, 278}, 8, "grey: not covered");
  double lo = 1e9, hi = -1e9;
  for (const Variant& v : variants)
    for (double E : energies(v.result)) {
      lo = std::min(lo, E);
      hi = std::max(hi, E);
    }
  tour::Plot plot({670, 70, 270, 230}, {0, lo - 0.05}, {40, hi + 0.05}, canvas);
  double top = 88;
  for (const Variant& v : variants) {
    std::vector<Eigen::Vector2d> points;
    for (double E : energies(v.result)) points.emplace_back(static_cast<double>(points.size()), E);
    plot.curve(points, v.color, 2.5);
    canvas.text({790, top}, 10, v.name, v.color);
    top += 20;
  }
  canvas.text({670, 48}, 9, "E over the iterations");
  report.save(canvas);
}

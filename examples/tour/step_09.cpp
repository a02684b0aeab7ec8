// Step 9 of tour.md: how much is covered, boundaries and landmarks.

#include "tour.hpp"

#include <algorithm>
#include <cmath>

namespace {

struct Variant {
  std::string name;
  ism::Options options;
};

std::vector<Variant> variants() {
  std::vector<Variant> v(4);
  v[0].name = "free";
  v[1].name = "free, more kappa";
  v[1].options.coverage_weight = 2;
  v[2].name = "sliding";
  v[2].options.boundary = ism::Boundary::kSlide;
  v[3].name = "exact landmarks";
  v[3].options.exact_landmarks = true;
  return v;
}

/// The vertex of a sheet that is nearest to a point, seen from above.
int nearest(const ism::TriangleMesh& sheet, double x, double y) {
  Eigen::Index v = 0;
  (tour::seen_from_above(sheet).rowwise() - Eigen::RowVector2d(x, y)).rowwise().norm().minCoeff(&v);
  return static_cast<int>(v);
}

int top(const ism::TriangleMesh& sheet) {
  Eigen::Index v = 0;
  sheet.vertices.col(2).maxCoeff(&v);
  return static_cast<int>(v);
}

void draw(const ism::Result& result, const std::string& name, double left, render::Canvas& canvas) {
  const ism::TriangleMesh &a = *result.start.a, &b = *result.start.b;
  const ism::SurfaceMap map(result);
  const picture::Scene scene =
      picture::scene_of(map, {tour::from_the_front(), tour::from_the_front()});
  const ism::Points3 f = tour::in_space(result.f), g = tour::in_space(result.g);
  const render::View plane = render::look_at(tour::stacked(f, g), 0, 0, {left, 60, 225, 225});
  tour::draw_edges(plane, g, b.triangles, 0.7, tour::kOrange, canvas);
  tour::draw_edges(plane, f, a.triangles, 0.7, tour::kBlue, canvas);
  picture::draw_heat(scene, ism::Side::kB, {left, 300, 225, 150}, canvas);
  const ism::IterationLog& end = result.final_state();
  canvas.text({left, 28}, 10, name);
  canvas.text({left, 48}, 8,
              tour::format("%.3f, covers %.2f", end.mean_distortion,
                           0.5 * (end.coverage_a + end.coverage_b)));
}

}  // namespace

void step_09(tour::Report& report) {
  const tour::Pair pair = tour::sheets(12);
  const int top_a = top(pair.a), top_b = top(pair.b);
  std::vector<ism::Landmark> landmarks = {{top_a, top_b}};  // and a point on either side
  for (double x : {-0.36, 0.36})
    landmarks.push_back({nearest(pair.a, x, 0), nearest(pair.b, x, 0)});

  render::Canvas canvas(960, 500);
  std::vector<ism::IterationLog> ends;
  double left = 10;
  for (const Variant& v : variants()) {
    const ism::Result r = ism::compute_map(pair.a, pair.b, landmarks, v.options);
    const ism::IterationLog& end = r.final_state();
    const double apart = (r.f.row(top_a) - r.g.row(top_b)).norm();
    report.check(
        ism::is_usable(r.status),
        tour::format("%s: E_Phi per area %.3f, covered %.3f and %.3f, tops %.4f apart",
                     v.name.c_str(), end.mean_distortion, end.coverage_a, end.coverage_b, apart));
    if (v.options.exact_landmarks) report.check(apart == 0, "exact landmarks are exact");
    ends.push_back(end);
    draw(r, v.name, left, canvas);
    left += 240;
  }
  const double said[][3] = {
      {2.02, 0.72, 0.72}, {2.23, 0.96, 0.99}, {2.36, 1, 1}, {2.31, 0.87, 0.85}};
  for (std::size_t i = 0; i < 4; ++i) {
    report.check_number("E_Phi per area", ends[i].mean_distortion, said[i][0], 0.05);
    report.check_number("coverage of A", ends[i].coverage_a, said[i][1], 0.1);
    report.check_number("coverage of B", ends[i].coverage_b, said[i][2], 0.1);
  }
  report.check(
      ends[1].coverage_a > ends[0].coverage_a && ends[1].mean_distortion > ends[0].mean_distortion,
      "a higher price of area buys coverage with distortion");
  report.check(std::min(ends[2].coverage_a, ends[2].coverage_b) > 1 - 1e-9,
               "sliding boundaries cover all");
  picture::draw_heat_legend({320, 465, 320, 12}, canvas);
  report.save(canvas);
}

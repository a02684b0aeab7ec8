// Step 8 of tour.md: the step bound, the line search, and why every iterate is injective.

#include "ism_verify.hpp"
#include "tour.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// The least s > 0 at which a triangle with sides u and v has no area, when they change by s du and
/// s dv: a root of cross(u + s du, v + s dv) = a s² + b s + c.
double largest_step(const Eigen::Vector2d& u, const Eigen::Vector2d& v, const Eigen::Vector2d& du,
                    const Eigen::Vector2d& dv) {
  const double a = cross(du, dv), b = cross(u, dv) + cross(du, v), c = cross(u, v);
  const double discriminant = b * b - 4 * a * c;
  double least = std::numeric_limits<double>::infinity();
  if (discriminant < 0) return least;
  const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
  for (double root : {q / a, c / q})
    if (root > 0) least = std::min(least, root);
  return least;
}

/// The largest step for which no triangle of an embedding x flips, when x moves along d.
double largest_step(const ism::Triangles& triangles, const ism::Points2& x, const ism::Points2& d) {
  double least = std::numeric_limits<double>::infinity();
  for (int t = 0; t < triangles.rows(); ++t) {
    const int i = triangles(t, 0), j = triangles(t, 1), k = triangles(t, 2);
    least = std::min(least, largest_step(x.row(j) - x.row(i), x.row(k) - x.row(i),
                                         d.row(j) - d.row(i), d.row(k) - d.row(i)));
  }
  return least;
}

/// Runs to the end and has every iterate proved to be injective; returns how many there were.
int prove_all(ism::Solver& solver) {
  int proved = 0;
  double energy = std::numeric_limits<double>::infinity();
  while (solver.step()) {
    const ism::Result& now = solver.result();
    if (!ism::is_usable(now.status)) continue;  // there is no map yet
    const bool falls = now.final_state().energy <= energy;
    if (!falls || ism::verify_map(ism::SurfaceMap(now)).status != ism::Status::kDone) return -1;
    energy = now.final_state().energy;
    ++proved;
  }
  return proved;
}

/// E_f: ‖J‖² + ‖J⁻¹‖² of an embedding, over the surface; as a map to its picture in the plane.
double embedding_energy(const ism::TriangleMesh& mesh, const ism::Points2& x) {
  const ism::SurfaceMap map(mesh, ism::TriangleMesh{tour::in_space(x), mesh.triangles}, x, x);
  double sum = 0;
  for (const ism::PolygonDistortion& d : map.distortion(true)) {
    const double largest = d.sigma_max * d.sigma_max, least = d.sigma_min * d.sigma_min;
    sum += d.area_a * (largest + least + 1 / largest + 1 / least);
  }
  return sum;
}

double objective(const tour::Pair& pair, const ism::Points2& f, const ism::Points2& g,
                 const ism::Options& options) {
  const double kappa = options.coverage_weight + options.measure.isometry();
  double sum = 3e-4 * (embedding_energy(pair.a, f) + embedding_energy(pair.b, g));
  for (const ism::PolygonDistortion& d : ism::SurfaceMap(pair.a, pair.b, f, g).distortion(true))
    sum += (d.density - kappa) * (d.area_a + d.area_b);
  return sum;
}

ism::Options start_from(const ism::Points2& f, const ism::Points2& g) {
  ism::Options options;
  options.coarsest = 0;
  options.initial_f = f;
  options.initial_g = g;
  return options;
}

/// An embedding, with triangles that are turned over in red.
void draw_embedding(const ism::Triangles& triangles, const ism::Points2& x,
                    const render::View& view, render::Canvas& canvas) {
  ism::TriangleMesh flipped = {tour::in_space(x), triangles};
  for (Eigen::Index t = 0; t < triangles.rows(); ++t) {
    const int i = triangles(t, 0), j = triangles(t, 1), k = triangles(t, 2);
    if (cross(x.row(j) - x.row(i), x.row(k) - x.row(i)) >= 0) flipped.triangles.row(t) << i, i, i;
  }
  render::Shape shape = render::shape_of(flipped);
  shape.color = tour::kRed;
  shape.is_shaded = false;
  canvas.draw(view, shape);
  tour::draw_edges(view, flipped.vertices, triangles, 0.7, tour::kBlue, canvas);
}

/// Where an iteration starts, its direction, the step it takes, and s_max.
struct Ray {
  ism::Points2 f, g, df, dg;
  double step, longest;
};

void draw(const tour::Pair& pair, const Ray& ray, const ism::Options& options,
          render::Canvas& canvas) {
  const double factors[] = {0.99, 2.5};
  for (int i = 0; i < 2; ++i) {
    const double left = 15 + 275.0 * i;
    const render::View view = render::look_at(tour::in_space(ray.f), 0, 0, {left, 60, 255, 255});
    draw_embedding(pair.a.triangles, ray.f + factors[i] * ray.longest * ray.df, view, canvas);
    canvas.text({left, 40}, 9, tour::format("f(A) at %.2f s_max", factors[i]));
  }
  std::vector<Eigen::Vector2d> curve, tried;
  double lo = 1e9;
  const auto E = [&](double s) {
    return objective(pair, ray.f + s * ray.df, ray.g + s * ray.dg, options);
  };
  constexpr int kPoints = 80;
  for (int i = 0; i <= kPoints; ++i)
    curve.emplace_back(0.999 * ray.longest * i / kPoints, E(0.999 * ray.longest * i / kPoints));
  for (int k = 0; k < 8; ++k) {
    const double s = 0.99 * ray.longest * std::pow(0.8, k);
    tried.emplace_back(s, E(s));
  }
  for (const Eigen::Vector2d& p : curve) lo = std::min(lo, p.y());
  const double hi = curve[0].y() + 0.6 * (curve[0].y() - lo);
  tour::Plot plot({670, 60, 270, 230}, {0, lo - 0.1 * (hi - lo)}, {1.04 * ray.longest, hi}, canvas);
  canvas.line({plot.at(ray.longest, hi), plot.at(ray.longest, lo)}, 1.5, tour::kRed);
  plot.curve(curve, tour::kInk);
  for (const Eigen::Vector2d& p : tried)
    if (p.y() < hi) plot.dot(p.x(), p.y(), tour::kGrey, 4);
  plot.dot(ray.step, E(ray.step), tour::kGreen, 6);
  canvas.text({600, 40}, 9, "E(x + s d) over s, up to s_max", tour::kInk);
  canvas.text({600, 336}, 8, "grey: tried, green: taken, red: s_max", tour::kInk);
  canvas.text({15, 332}, 8, "red: triangles that are turned over", tour::kRed);
}

}  // namespace

void step_08(tour::Report& report) {
  constexpr int kIteration = 2;
  const tour::Pair pair = tour::sheets(12);
  const ism::Points2 f = tour::seen_from_above(pair.a), g = tour::seen_from_above(pair.b);
  ism::Options options = start_from(f, g);
  options.omega_start = 0;  // rough directions: triangles are soon in the way
  options.max_iterations = kIteration - 1;
  const ism::Result before = ism::compute_map(pair.a, pair.b, {}, options);
  options.max_iterations = kIteration;
  const ism::Result after = ism::compute_map(pair.a, pair.b, {}, options);
  const ism::IterationLog& log = after.final_state();
  const Ray ray = {before.f,
                   before.g,
                   (after.f - before.f) / log.step,
                   (after.g - before.g) / log.step,
                   log.step,
                   std::min(largest_step(pair.a.triangles, before.f, after.f - before.f),
                            largest_step(pair.b.triangles, before.g, after.g - before.g)) *
                       log.step};
  report.check(std::abs(ray.longest / log.max_step - 1) < 1e-6,
               tour::format("s_max is %.3f, by the library %.3f; s is %.3f", ray.longest,
                            log.max_step, log.step));
  report.check(std::abs(objective(pair, after.f, after.g, options) - log.energy) < 1e-8,
               tour::format("E falls from %.4f to %.4f; by the public functions, to within %.0e",
                            before.final_state().energy, log.energy,
                            std::abs(objective(pair, after.f, after.g, options) - log.energy)));

  ism::Solver solver(pair.a, pair.b, {}, start_from(f, g));
  const int proved = prove_all(solver);
  report.check(proved > 10, tour::format("%d iterates are proved to be injective", proved));
  report.check(solver.result().status == ism::Status::kConverged, "the run converges");
  report.check_number("s_max", log.max_step, 2.24, 0.1);
  report.check_number("s", log.step, 1, 0.1);
  report.check_number("the number of iterates", proved, 62, 0.4);
  render::Canvas canvas(960, 340);
  draw(pair, ray, options, canvas);
  report.save(canvas);
}

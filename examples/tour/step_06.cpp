// Step 6 of tour.md: derivatives while the overlay moves, and Newton's method.

#include "tour.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace {

/// Two surfaces and where they lie in the plane. Two unknowns are left: all of f(A) moves by t.
struct Scene {
  ism::TriangleMesh a, b;
  ism::Points2 f, g;
};

/// E_ρ of every polygon ρ of the overlay, which is computed anew.
Eigen::VectorXd energies(const Scene& scene, const Eigen::Vector2d& t) {
  const ism::Points2 f = scene.f.rowwise() + t.transpose();
  const std::vector<ism::PolygonDistortion> polygons =
      ism::SurfaceMap(scene.a, scene.b, f, scene.g).distortion(true);
  Eigen::VectorXd E(static_cast<Eigen::Index>(polygons.size()));
  for (Eigen::Index p = 0; p < E.size(); ++p) {
    const ism::PolygonDistortion& d = polygons[static_cast<std::size_t>(p)];
    E[p] = d.density * (d.area_a + d.area_b);
  }
  return E;
}

/// The matrix with the same eigenvectors, and no eigenvalue below ε. A symmetric 2×2 matrix has
/// the eigenvalues m ± r, and H - m has ± r.
Eigen::Matrix2d projected(const Eigen::Matrix2d& H, double epsilon) {
  const double m = 0.5 * H.trace(), r = std::hypot(0.5 * (H(0, 0) - H(1, 1)), H(0, 1));
  const double low = std::max(m - r, epsilon), high = std::max(m + r, epsilon);
  const Eigen::Matrix2d I = Eigen::Matrix2d::Identity();
  return 0.5 * (high + low) * I + (r > 0 ? 0.5 * (high - low) / r : 0) * (H - m * I);
}

struct Model {
  Eigen::Vector2d g = {0, 0};                        // gradient of E
  Eigen::Matrix2d H = Eigen::Matrix2d::Zero();       // Hessian of E
  Eigen::Matrix2d H_plus = Eigen::Matrix2d::Zero();  // sum of the projected ones of all polygons
  int negative = 0;                                  // polygons with a negative eigenvalue
};

/// Uses central differences. The library has closed forms, in the 12 variables of a polygon.
Model model_at(const Scene& scene, const Eigen::Vector2d& t) {
  constexpr double h = 1e-5;
  const auto E = [&](double i, double j) { return energies(scene, t + h * Eigen::Vector2d(i, j)); };
  const Eigen::VectorXd here = E(0, 0), right = E(1, 0), left = E(-1, 0), up = E(0, 1),
                        down = E(0, -1);
  const Eigen::VectorXd xx = (right - 2 * here + left) / (h * h);
  const Eigen::VectorXd yy = (up - 2 * here + down) / (h * h);
  const Eigen::VectorXd xy = (E(1, 1) - E(1, -1) - E(-1, 1) + E(-1, -1)) / (4 * h * h);
  Model model;
  model.g << (right - left).sum() / (2 * h), (up - down).sum() / (2 * h);
  for (Eigen::Index p = 0; p < here.size(); ++p) {
    Eigen::Matrix2d H;
    H << xx[p], xy[p], xy[p], yy[p];
    model.H += H;
    model.H_plus += projected(H, 1e-3);
    model.negative += projected(H, 0).isApprox(H, 1e-6) ? 0 : 1;
  }
  return model;
}

/// The best of some steps along a direction: its length is a matter of step 8.
Eigen::Vector2d best_step(const Scene& scene, const Eigen::Vector2d& t, const Eigen::Vector2d& d) {
  Eigen::Vector2d best(0, 0);
  for (double length = 0.15; length > 0.01; length *= 0.8) {
    const Eigen::Vector2d step = length / d.norm() * d;
    if (energies(scene, t + step).sum() < energies(scene, t + best).sum()) best = step;
  }
  return best;
}

/// A flat hexagon of triangles over the sheet B of the other steps.
Scene patch_over_a_hill() {
  constexpr double kRadius = 0.16, kPi = 3.14159265358979323846;
  Scene scene;
  scene.b = tour::sheets(6).b;
  scene.g = tour::seen_from_above(scene.b);
  scene.a.vertices = ism::Points3::Zero(7, 3);
  scene.a.triangles.resize(6, 3);
  for (int k = 0; k < 6; ++k) {
    scene.a.vertices.row(k + 1) << kRadius * std::cos(k * kPi / 3 + 0.1),
        kRadius * std::sin(k * kPi / 3 + 0.1), 0;
    scene.a.triangles.row(k) << 0, k + 1, k == 5 ? 1 : k + 2;
  }
  scene.f = tour::seen_from_above(scene.a);
  return scene;
}

const Eigen::Vector2d kLo(-0.3, -0.25), kHi(0.3, 0.25);  // the moves that are drawn
constexpr double kRow = 0.06;                            // y of the line that is plotted

/// The energy of all moves, and the two steps from one of them.
void draw_moves(const Scene& scene, const Eigen::Vector2d& from, const Eigen::Vector2d& newton,
                const Eigen::Vector2d& projected_step, render::Canvas& canvas) {
  constexpr int kColumns = 66, kRows = 55;
  const render::Rect rect = {20, 50, 420, 350};
  const auto at = [&](const Eigen::Vector2d& t) {
    return Eigen::Vector2d(rect.x + rect.width * (t.x() - kLo.x()) / (kHi.x() - kLo.x()),
                           rect.y + rect.height * (kHi.y() - t.y()) / (kHi.y() - kLo.y()));
  };
  std::vector<double> E;
  for (int j = 0; j < kRows; ++j)
    for (int i = 0; i < kColumns; ++i)
      E.push_back(energies(scene, {kLo.x() + (i + 0.5) / kColumns * (kHi.x() - kLo.x()),
                                   kHi.y() - (j + 0.5) / kRows * (kHi.y() - kLo.y())})
                      .sum());
  const double lo = *std::min_element(E.begin(), E.end());
  const double hi = *std::max_element(E.begin(), E.end());
  for (int j = 0; j < kRows; ++j)
    for (int i = 0; i < kColumns; ++i) {
      const double level = (E[static_cast<std::size_t>(j * kColumns + i)] - lo) / (hi - lo);
      canvas.fill({rect.x + rect.width * i / kColumns, rect.y + rect.height * j / kRows,
                   rect.width / kColumns + 0.6, rect.height / kRows + 0.6},
                  render::heat(0.75 * level));
    }
  canvas.line({at({kLo.x(), kRow}), at({kHi.x(), kRow})}, 1, tour::kGrey);
  tour::draw_arrow(at(from), at(from + newton), 3, tour::kInk, canvas);
  tour::draw_arrow(at(from), at(from + projected_step), 3, tour::kBlue, canvas);
  tour::draw_dot(at(from), 5, tour::kInk, canvas);
  canvas.text({20, 30}, 11, "E(t), dark: high");
  canvas.text({20, 425}, 9, "black: Newton's step, it goes up");
  canvas.text({20, 445}, 9, "blue: with projected Hessians, down", tour::kBlue);
}

/// Energy and slope along a line; the slope jumps where edges come to lie along edges.
void draw_line(const Scene& scene, render::Canvas& canvas) {
  constexpr int kPoints = 400;
  std::vector<Eigen::Vector2d> value, slope;
  const double h = (kHi.x() - kLo.x()) / kPoints;
  double before = 0;
  Eigen::Vector2d range(1e9, -1e9), slopes(1e9, -1e9);
  for (int i = 0; i <= kPoints; ++i) {
    const double x = kLo.x() + h * i, E = energies(scene, {x, kRow}).sum();
    value.emplace_back(x, E);
    range = {std::min(range[0], E), std::max(range[1], E)};
    if (i > 0) slope.emplace_back(x - 0.5 * h, (E - before) / h);
    if (i > 0)
      slopes = {std::min(slopes[0], slope.back().y()), std::max(slopes[1], slope.back().y())};
    before = E;
  }
  const auto with_margin = [](const Eigen::Vector2d& r) {
    const double margin = 0.08 * (r[1] - r[0]);
    return Eigen::Vector2d(r[0] - margin, r[1] + margin);
  };
  range = with_margin(range);
  slopes = with_margin(slopes);
  tour::Plot above({545, 50, 395, 160}, {kLo.x(), range[0]}, {kHi.x(), range[1]}, canvas);
  above.curve(value, tour::kInk);
  tour::Plot below({545, 270, 395, 150}, {kLo.x(), slopes[0]}, {kHi.x(), slopes[1]}, canvas);
  below.curve(slope, tour::kRed, 1.5);
  canvas.text({545, 30}, 11, "E along the grey line");
  canvas.text({545, 255}, 11, "its slope: it jumps", tour::kRed);
}

}  // namespace

void step_06(tour::Report& report) {
  const Scene scene = patch_over_a_hill();
  // Of some moves on the way down from the hill, the one from where Newton's step climbs most.
  Eigen::Vector2d t(0, 0), newton(0, 0), step(0, 0);
  Model model;
  double climb = 0;
  for (double distance = 0.031; distance < 0.2; distance += 0.0123) {
    const Eigen::Vector2d move(0.137 - distance, 0.049 + 0.61 * distance);
    const Model m = model_at(scene, move);
    const Eigen::Vector2d d = -m.H.inverse() * m.g;
    if (d.norm() > 0.15 || m.g.dot(d) < climb) continue;
    climb = m.g.dot(d);
    model = m;
    t = move;
    newton = d;
    step = -m.H_plus.inverse() * m.g;
  }
  step = best_step(scene, t, step);
  const double here = energies(scene, t).sum();
  const double by_newton = energies(scene, t + newton).sum();
  const double by_projected = energies(scene, t + step).sum();
  report.check(model.negative > 0,
               tour::format("%d of %d polygons have a negative eigenvalue", model.negative,
                            static_cast<int>(energies(scene, t).size())));
  report.check(climb > 0 && by_newton > here,
               tour::format("Newton's step takes E from %.4f to %.4f", here, by_newton));
  report.check(model.g.dot(step) < 0 && by_projected < here,
               tour::format("the projected one takes E to %.4f", by_projected));
  report.check_number("the share of such polygons", model.negative / 34.0, 14 / 34.0, 0.2);
  report.check_number("E", here, 0.415);
  report.check_number("E by Newton's step", by_newton, 0.487);
  report.check_number("E by the projected one", by_projected, 0.287);
  render::Canvas canvas(960, 460);
  draw_moves(scene, t, newton, step, canvas);
  draw_line(scene, canvas);
  report.save(canvas);
}

// Closed-form energies against singular values and finite differences.

#include "elements.hpp"
#include "ism.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

namespace {

using namespace ism::detail;
using Eigen::Matrix2d;
using elements::jacobian;
using elements::Mat12;
using elements::polygon_derivatives;
using elements::PolygonDerivatives;
using elements::project_spd;
using elements::Vec12;
using ism::Density;
using ism::DistortionMeasure;
using ism::Vec2;
using shapes::Rng;

/// A polygon with all that its energy depends on.
struct Sample {
  OverlayPolygon polygon;
  SixPoints x;
  Matrix2d rest_inverse_a, rest_inverse_b;
};

OverlayPolygon polygon_of(const SixPoints& x) {
  LabelledTriangle a, b;
  for (std::size_t k = 0; k < 3; ++k) {
    const int i = static_cast<int>(k);
    a[k] = {x.col(i), i};
    b[k] = {x.col(3 + i), 3 + i};
  }
  return intersect(a, b);
}

/// The inverse rest frame of a random triangle that is neither thin nor very large or small.
Matrix2d random_rest_inverse(Rng& rng) {
  const double height = rng.uniform(0.5, 1.5);
  Matrix2d R;
  R << rng.uniform(0.5, 1.5), rng.uniform(-0.5, 1), 0, height;
  return R.inverse();
}

double planar_determinant(const SixPoints& x, int first) {
  return cross(x.col(first + 1) - x.col(first), x.col(first + 2) - x.col(first));
}

/// The smallest sine of the angles between edges of the two triangles that cross at a corner.
double smallest_crossing_sine(const OverlayPolygon& p, const SixPoints& x) {
  double smallest = 1;
  for (int i = 0, before = p.count - 1; i < p.count; before = i++) {
    const int e = p.piece(before), g = p.piece(i);
    if (same_triangle(e, g)) continue;
    const Vec2 d = x.col(edge_end(e)) - x.col(edge_start(e));
    const Vec2 w = x.col(edge_end(g)) - x.col(edge_start(g));
    smallest = std::min(smallest, std::abs(cross(d, w)) / (d.norm() * w.norm()));
  }
  return smallest;
}

/// True if the combinatorics stay the same under every displacement of one coordinate by step.
bool is_stable(const Sample& s, double step) {
  for (int k = 0; k < 12; ++k)
    for (double h : {-step, step}) {
      SixPoints x = s.x;
      x(k % 2, k / 2) += h;
      const OverlayPolygon p = polygon_of(x);
      if (p.count != s.polygon.count || p.code != s.polygon.code) return false;
    }
  return true;
}

/// A random pair of overlapping triangles, away from degenerate positions.
Sample random_sample(Rng& rng) {
  for (;;) {
    Sample s;
    for (int k = 0; k < 6; ++k) s.x.col(k) = rng.point(1);
    if (rng.below(2)) {  // two triangles across each other often meet in a hexagon
      const double angle = rng.uniform(0, 2 * shapes::kPi);
      for (int k = 0; k < 6; ++k) {
        const double phi = angle + shapes::kPi / 3 * (k < 3 ? 2 * k : 2 * k + 1);
        s.x.col(k) = Vec2(std::cos(phi), std::sin(phi)) + rng.point(0.3);
      }
    }
    if (planar_determinant(s.x, 0) < 0.2 || planar_determinant(s.x, 3) < 0.2) continue;
    s.polygon = polygon_of(s.x);
    if (s.polygon.count == 0 || smallest_crossing_sine(s.polygon, s.x) < 0.1) continue;
    if (!is_stable(s, 1e-4)) continue;
    s.rest_inverse_a = random_rest_inverse(rng);
    s.rest_inverse_b = random_rest_inverse(rng);
    return s;
  }
}

double area_of(const OverlayPolygon& p, const SixPoints& x) {
  return polygon_area(polygon_shape(p, x), x);
}

const DistortionMeasure kDirichlet = ism::symmetric_dirichlet();

/// A measure of §3.2 and what is to be expected of it.
struct Known {
  const char* name;
  DistortionMeasure measure;
  double (*of_sigma)(double small, double large);  // per area
  double on_a, on_b;                               // share of the areas it is integrated over
  bool is_symmetric;
};

double square(double x) { return x * x; }

const Known kKnown[] = {
    {"arap", ism::arap(), [](double s, double t) { return square(1 - s) + square(1 - t); }, 1, 0,
     false},
    {"sarap", ism::sarap(), [](double s, double t) { return square(1 - 1 / s) + square(1 - t); },
     0.5, 0.5, true},
    {"asap", ism::asap(), [](double s, double t) { return square(t - s); }, 1, 0, false}};

double density(const Matrix2d& F, const Matrix2d& G, double kappa) {
  return kDirichlet.value(F, G) - kappa * (1 / F.determinant() + 1 / G.determinant());
}

Density density_derivatives(const Matrix2d& F, const Matrix2d& G, double kappa) {
  LaneVector<8> J;
  for (int k = 0; k < 4; ++k) {
    J[k].setConstant(F(k));
    J[4 + k].setConstant(G(k));
  }
  LaneDensity w;
  differentiate_measure(kDirichlet, J, w);
  add_coverage(J, kappa, w);
  Density result;
  result.value = w.value[0];
  for (int i = 0; i < 8; ++i) result.gradient[i] = w.gradient[i][0];
  result.hessian = elements::get<8>(w.hessian, 0);
  return result;
}

PolygonDerivatives derivatives(const Sample& s, double kappa,
                               const DistortionMeasure& measure = kDirichlet) {
  return polygon_derivatives(s.polygon, s.x, s.rest_inverse_a, s.rest_inverse_b, measure, kappa);
}

/// Eq. 3 as it is written: J_Φ = G⁻¹ F and its singular values, integrated over either surface.
double energy_by_singular_values(const Sample& s, double kappa) {
  const Matrix2d F = jacobian(s.x, 0, s.rest_inverse_a), G = jacobian(s.x, 3, s.rest_inverse_b);
  const double planar = area_of(s.polygon, s.x);
  const double area_a = planar / F.determinant(), area_b = planar / G.determinant();
  const Eigen::JacobiSVD<Matrix2d> svd(G.inverse() * F);
  const Vec2 sigma = svd.singularValues();
  return area_b * (sigma.squaredNorm() - kappa) +
         area_a * (sigma.cwiseInverse().squaredNorm() - kappa);
}

/// Central differences of a vector-valued function of the six points; column k is ∂/∂x_k.
template <class Function>
Eigen::MatrixXd differences(const SixPoints& x, double h, Function function) {
  Eigen::MatrixXd result(function(x).size(), 12);
  for (int k = 0; k < 12; ++k) {
    SixPoints up = x, down = x;
    up(k % 2, k / 2) += h;
    down(k % 2, k / 2) -= h;
    result.col(k) = (function(up) - function(down)) / (2 * h);
  }
  return result;
}

using Scalar = Eigen::Matrix<double, 1, 1>;

/// The largest errors of gradients and Hessians relative to their norms, and what was sampled.
struct Worst {
  double gradient = 0, hessian = 0, asymmetry = 0;
  int corners[7] = {};
};

/// Compares derivatives of `evaluate` (which returns value, gradient, hessian) with differences.
template <class Evaluate>
void compare(const Sample& s, Evaluate evaluate, Worst& worst) {
  const auto exact = evaluate(s.x);
  const Eigen::MatrixXd g =
      differences(s.x, 1e-6, [&](const SixPoints& x) { return Scalar(evaluate(x).value); });
  const Eigen::MatrixXd H =
      differences(s.x, 1e-6, [&](const SixPoints& x) { return Vec12(evaluate(x).gradient); });
  const auto raise = [](double& most, double x) { most = std::isnan(x) ? x : std::max(most, x); };
  raise(worst.gradient, (g.transpose() - exact.gradient).norm() / exact.gradient.norm());
  raise(worst.hessian, (H - exact.hessian).norm() / exact.hessian.norm());
  raise(worst.asymmetry, (exact.hessian - exact.hessian.transpose()).norm() / exact.hessian.norm());
  ++worst.corners[s.polygon.count];
}

/// Samples until each corner count has occurred at least `least` times.
template <class Evaluate>
Worst compare_samples(std::uint64_t seed, int least, Evaluate evaluate) {
  Rng rng(seed);
  Worst worst;
  const auto enough = [&] {
    return *std::min_element(worst.corners + 3, worst.corners + 7) >= least;
  };
  for (int i = 0; i < 50000 && !enough(); ++i) {
    const Sample s = random_sample(rng);
    if (worst.corners[s.polygon.count] >= 2 * least) continue;
    compare(
        s, [&](const SixPoints& x) { return evaluate(s, x); }, worst);
  }
  return worst;
}

Matrix2d random_jacobian(Rng& rng) {
  for (;;) {
    Matrix2d J;
    J << rng.point(2), rng.point(2);
    if (J.determinant() > 0.1) return J;
  }
}

template <int N>
Eigen::Matrix<double, N, N> random_symmetric(Rng& rng) {
  Eigen::Matrix<double, N, N> M;
  for (int i = 0; i < N * N; ++i) M(i) = rng.uniform(-1, 1);
  return M + M.transpose();
}

}  // namespace

// ---- polygons ----

TEST_CASE("polygon energies are the singular value formula integrated over both surfaces") {
  Rng rng(1);
  double worst = 0;
  for (int i = 0; i < 3000; ++i) {
    const Sample s = random_sample(rng);
    for (double kappa : {0.0, 2.0, 5.0}) {
      const double expected = energy_by_singular_values(s, kappa);
      const double scale = energy_by_singular_values(s, 0);
      worst = std::max(worst, std::abs(derivatives(s, kappa).value - expected) / scale);
      const Matrix2d F = jacobian(s.x, 0, s.rest_inverse_a), G = jacobian(s.x, 3, s.rest_inverse_b);
      const double by_density = area_of(s.polygon, s.x) * density(F, G, kappa);
      worst = std::max(worst, std::abs(by_density - expected) / scale);
    }
  }
  CHECK(worst < 1e-12);
}

TEST_CASE("derivatives of polygon energies agree with differences for every corner count") {
  for (double kappa : {0.0, 2.0}) {
    CAPTURE(kappa);
    const Worst worst = compare_samples(2, 400, [&](const Sample& s, const SixPoints& x) {
      return polygon_derivatives(s.polygon, x, s.rest_inverse_a, s.rest_inverse_b, kDirichlet,
                                 kappa);
    });
    for (int count : {3, 4, 5, 6}) CHECK(worst.corners[count] >= 400);
    CHECK(worst.gradient < 1e-6);
    CHECK(worst.hessian < 1e-5);
    CHECK(worst.asymmetry < 1e-14);
  }
}

TEST_CASE("derivatives of polygon areas agree with differences for every corner count") {
  const DistortionMeasure one = {[](const Matrix2d&, const Matrix2d&) { return 1.0; },
                                 [](const Matrix2d&, const Matrix2d&) {
                                   Density w;
                                   w.value = 1;
                                   return w;
                                 }};
  const Worst worst = compare_samples(3, 400, [&](const Sample& s, const SixPoints& x) {
    const PolygonDerivatives a =
        polygon_derivatives(s.polygon, x, s.rest_inverse_a, s.rest_inverse_b, one, 0);
    CHECK(a.value == area_of(s.polygon, x));
    return a;
  });
  for (int count : {3, 4, 5, 6}) CHECK(worst.corners[count] >= 400);
  CHECK(worst.gradient < 1e-7);
  CHECK(worst.hessian < 1e-6);
  CHECK(worst.asymmetry < 1e-14);
}

TEST_CASE("derivatives of the density agree with differences") {
  Rng rng(4);
  double worst_gradient = 0, worst_hessian = 0;
  const double h = 1e-6;
  for (int i = 0; i < 500; ++i) {
    const Matrix2d J[2] = {random_jacobian(rng), random_jacobian(rng)};
    const double kappa = i % 2 ? 0 : 2;
    const Density exact = density_derivatives(J[0], J[1], kappa);
    CHECK(exact.value == doctest::Approx(density(J[0], J[1], kappa)).epsilon(1e-12));
    Eigen::Matrix<double, 8, 1> gradient;
    Eigen::Matrix<double, 8, 8> hessian;
    for (int k = 0; k < 8; ++k) {
      Matrix2d up[2] = {J[0], J[1]}, down[2] = {J[0], J[1]};
      up[k / 4](k % 4) += h;
      down[k / 4](k % 4) -= h;
      gradient(k) = (density(up[0], up[1], kappa) - density(down[0], down[1], kappa)) / (2 * h);
      hessian.col(k) = (density_derivatives(up[0], up[1], kappa).gradient -
                        density_derivatives(down[0], down[1], kappa).gradient) /
                       (2 * h);
    }
    worst_gradient =
        std::max(worst_gradient, (gradient - exact.gradient).norm() / exact.gradient.norm());
    worst_hessian =
        std::max(worst_hessian, (hessian - exact.hessian).norm() / exact.hessian.norm());
  }
  CHECK(worst_gradient < 1e-6);
  CHECK(worst_hessian < 1e-6);
}

TEST_CASE("a polygon's energy does not change when both triangles move by one affine map") {
  Rng rng(5);
  double worst = 0, worst_density = 0;
  for (int i = 0; i < 500; ++i) {
    const Sample s = random_sample(rng);
    const Matrix2d M = random_jacobian(rng);
    Sample moved = s;
    moved.x = (M * s.x).colwise() + rng.point(5);
    const double energy = derivatives(s, 2).value, scale = derivatives(s, 0).value;
    worst = std::max(worst, std::abs(derivatives(moved, 2).value - energy) / scale);
    const Matrix2d F = jacobian(s.x, 0, s.rest_inverse_a), G = jacobian(s.x, 3, s.rest_inverse_b);
    const double ratio = density(M * F, M * G, 2) * M.determinant() - density(F, G, 2);
    worst_density = std::max(worst_density, std::abs(ratio) / density(F, G, 0));
  }
  CHECK(worst < 1e-11);
  CHECK(worst_density < 1e-12);
}

TEST_CASE("a common translation is a null vector of every polygon Hessian") {
  Rng rng(6);
  double worst = 0;
  for (int i = 0; i < 300; ++i) {
    const PolygonDerivatives E = derivatives(random_sample(rng), 2);
    for (int c = 0; c < 2; ++c) {
      Vec12 shift = Vec12::Zero();
      for (int k = 0; k < 6; ++k) shift(2 * k + c) = 1;
      worst = std::max(worst, std::abs(E.gradient.dot(shift)) / E.gradient.norm());
      worst = std::max(worst, (E.hessian * shift).norm() / E.hessian.norm());
    }
  }
  CHECK(worst < 1e-12);
}

TEST_CASE("an isometry has no energy and no forces if coverage is rewarded by two") {
  Rng rng(7);
  for (int i = 0; i < 200; ++i) {
    Sample s = random_sample(rng);
    // The rest frame of B is chosen so that G⁻¹ F is a rotation.
    const Matrix2d F = jacobian(s.x, 0, s.rest_inverse_a);
    const Matrix2d rotation = shapes::rotation(rng.uniform(0, 6));
    Matrix2d edges;
    edges << s.x.col(4) - s.x.col(3), s.x.col(5) - s.x.col(3);
    s.rest_inverse_b = edges.inverse() * F * rotation;
    const PolygonDerivatives E = derivatives(s, 2), unrewarded = derivatives(s, 0);
    CHECK(std::abs(E.value) < 1e-12 * unrewarded.value);
    CHECK(E.gradient.norm() < 1e-11 * unrewarded.gradient.norm());
    const Eigen::SelfAdjointEigenSolver<Mat12> eigen(E.hessian);
    CHECK(eigen.eigenvalues().minCoeff() > -1e-9 * E.hessian.norm());  // a minimum
    const double surface = area_of(s.polygon, s.x) / F.determinant();
    CHECK(unrewarded.value == doctest::Approx(4 * surface).epsilon(1e-11));  // 2 on either side
  }
}

TEST_CASE("the density is infinite unless both triangles are positive") {
  Matrix2d flipped = Matrix2d::Identity(), flat = Matrix2d::Identity();
  flipped(0, 0) = -1;
  flat(0, 0) = 0;
  const Matrix2d good = Matrix2d::Identity();
  for (const DistortionMeasure& measure : {kDirichlet, ism::arap(), ism::sarap(), ism::asap()})
    for (const Matrix2d& bad : {flipped, flat}) {
      CHECK(measure.value(bad, good) == kInfinity);
      CHECK(measure.value(good, bad) == kInfinity);
      CHECK(measure.value(bad, bad) == kInfinity);
    }
  CHECK(density(good, good, 0) == 4);
  CHECK(density(good, good, 2) == 0);
}

/// The inverse map: A and B exchanged.
Sample inverse_of(const Sample& s) {
  Sample swapped = s;
  swapped.x << s.x.rightCols<3>(), s.x.leftCols<3>();
  swapped.polygon = polygon_of(swapped.x);
  std::swap(swapped.rest_inverse_a, swapped.rest_inverse_b);
  return swapped;
}

TEST_CASE("swapping the meshes does not change the energy") {
  Rng rng(8);
  for (int i = 0; i < 200; ++i) {
    const Sample s = random_sample(rng), swapped = inverse_of(s);
    const PolygonDerivatives E = derivatives(s, 1.5), S = derivatives(swapped, 1.5);
    CHECK(S.value == doctest::Approx(E.value).epsilon(1e-11));
    Vec12 expected;
    expected << E.gradient.tail<6>(), E.gradient.head<6>();
    CHECK((S.gradient - expected).norm() < 1e-11 * E.gradient.norm());
  }
}

// ---- other measures (§3.2) ----

TEST_CASE("every measure is its formula of singular values, integrated over its surfaces") {
  for (const Known& known : kKnown) {
    CAPTURE(known.name);
    Rng rng(14);
    double worst = 0;
    for (int i = 0; i < 1000; ++i) {
      const Sample s = random_sample(rng);
      const Matrix2d F = jacobian(s.x, 0, s.rest_inverse_a);
      const Matrix2d G = jacobian(s.x, 3, s.rest_inverse_b);
      const Eigen::JacobiSVD<Matrix2d> svd(G.inverse() * F);
      const double planar = area_of(s.polygon, s.x);
      const double area = planar * (known.on_a / F.determinant() + known.on_b / G.determinant());
      const double expected =
          area * known.of_sigma(svd.singularValues()[1], svd.singularValues()[0]);
      const double scale = derivatives(s, 0).value;
      worst = std::max(worst, std::abs(derivatives(s, 0, known.measure).value - expected) / scale);
      worst = std::max(worst, std::abs(planar * known.measure.value(F, G) - expected) / scale);
    }
    CHECK(worst < 1e-10);  // sarap rounds a kink off
  }
}

TEST_CASE("derivatives of every measure agree with differences for every corner count") {
  for (const Known& known : kKnown) {
    CAPTURE(known.name);
    const Worst worst = compare_samples(15, 100, [&](const Sample& s, const SixPoints& x) {
      return polygon_derivatives(s.polygon, x, s.rest_inverse_a, s.rest_inverse_b, known.measure,
                                 0.2);
    });
    for (int count : {3, 4, 5, 6}) CHECK(worst.corners[count] >= 100);
    CHECK(worst.gradient < 1e-5);
    CHECK(worst.hessian < 1e-4);
    CHECK(worst.asymmetry < 1e-13);
  }
}

TEST_CASE("the measures that are to be symmetric are, the others are not") {
  for (const Known& known : kKnown) {
    CAPTURE(known.name);
    Rng rng(16);
    double most = 0;
    for (int i = 0; i < 200; ++i) {
      const Sample s = random_sample(rng);
      const double there = derivatives(s, 0, known.measure).value;
      const double back = derivatives(inverse_of(s), 0, known.measure).value;
      most = std::max(most, std::abs(there - back) / there);
    }
    CHECK((known.is_symmetric ? most < 1e-10 : most > 0.1));
  }
}

TEST_CASE("every measure is affine invariant and least for an isometry") {
  for (const Known& known : kKnown) {
    CAPTURE(known.name);
    Rng rng(17);
    for (int i = 0; i < 200; ++i) {
      Sample s = random_sample(rng);
      const Matrix2d M = random_jacobian(rng);
      Sample moved = s;
      moved.x = (M * s.x).colwise() + rng.point(5);
      const double energy = derivatives(s, 0, known.measure).value;
      CHECK(energy >= 0);
      CHECK(std::abs(derivatives(moved, 0, known.measure).value - energy) <
            1e-10 * derivatives(s, 0).value);
      const Matrix2d F = jacobian(s.x, 0, s.rest_inverse_a);
      Matrix2d edges;
      edges << s.x.col(4) - s.x.col(3), s.x.col(5) - s.x.col(3);
      s.rest_inverse_b = edges.inverse() * F * shapes::rotation(rng.uniform(0, 6));
      const PolygonDerivatives E = derivatives(s, 0, known.measure);
      CHECK(std::abs(E.value) < 1e-10 * area_of(s.polygon, s.x) / F.determinant());
      CHECK(E.gradient.norm() < 1e-4 * derivatives(s, 0).gradient.norm());
    }
  }
}

TEST_CASE("derivatives are finite for identical, touching and nearly parallel triangles") {
  SixPoints same;
  same << 0, 1, 0.25, 0, 1, 0.25, 0, 0, 1, 0, 0, 1;
  Rng rng(9);
  int polygons = 0, infinite = 0;
  const auto check = [&](const SixPoints& x) {
    const OverlayPolygon p = polygon_of(x);
    if (p.count == 0) return;
    ++polygons;
    const PolygonDerivatives E =
        polygon_derivatives(p, x, Matrix2d::Identity(), Matrix2d::Identity(), kDirichlet, 2);
    infinite += !std::isfinite(E.value) || !E.gradient.allFinite() || !E.hessian.allFinite();
  };
  check(same);
  for (int k = 0; k < 3000; ++k) {
    SixPoints x = same;
    const double noise = std::pow(10.0, -rng.between(5, 17));
    if (rng.below(2)) x.rightCols<3>().colwise() += Vec2(rng.between(-1, 1), 0) / 2;
    if (rng.below(2)) x.rightCols<3>() *= 0.5;
    for (int c = 3; c < 6; ++c) x.col(c) += rng.point(noise);
    check(x);
  }
  CHECK(polygons > 1500);
  CHECK(infinite == 0);
}

TEST_CASE("identical triangles have their full area and the gradient of an isometry") {
  SixPoints x;
  x << 0.5, 2, 0.75, 0.5, 2, 0.75, 0, 0.25, 1, 0, 0.25, 1;
  Matrix2d edges;
  edges << x.col(1) - x.col(0), x.col(2) - x.col(0);
  const OverlayPolygon p = polygon_of(x);
  REQUIRE(p.count >= 3);
  const PolygonDerivatives E =
      polygon_derivatives(p, x, edges.inverse(), edges.inverse(), kDirichlet, 2);
  CHECK(area_of(p, x) == doctest::Approx(edges.determinant() / 2).epsilon(1e-15));
  CHECK(std::abs(E.value) < 1e-14);
  CHECK(E.gradient.norm() < 1e-13);
}

// ---- triangles ----

TEST_CASE("triangle energies are the symmetric Dirichlet energy of the singular values") {
  Rng rng(10);
  for (int i = 0; i < 500; ++i) {
    const Matrix2d J = random_jacobian(rng);
    const double area = rng.uniform(0.1, 3);
    const Vec2 sigma = Eigen::JacobiSVD<Matrix2d>(J).singularValues();
    const double expected = area * (sigma.squaredNorm() + sigma.cwiseInverse().squaredNorm());
    CHECK(triangle_energy(J, area) == doctest::Approx(expected).epsilon(1e-12));
    const Matrix2d rest_inverse = random_rest_inverse(rng);
    CHECK(triangle_derivatives(J, rest_inverse, area).value ==
          doctest::Approx(expected).epsilon(1e-12));
  }
  CHECK(triangle_energy(Matrix2d::Identity(), 1) == 4);
  CHECK(triangle_energy(-Matrix2d::Identity(), 1) == 4);  // a rotation
  CHECK(triangle_energy(Matrix2d::Zero(), 1) == kInfinity);
  Matrix2d flipped = Matrix2d::Identity();
  flipped(1, 1) = -1;
  CHECK(triangle_energy(flipped, 1) == kInfinity);
}

TEST_CASE("derivatives of triangle energies agree with differences") {
  Rng rng(11);
  double worst_gradient = 0, worst_hessian = 0;
  for (int i = 0; i < 500; ++i) {
    SixPoints x = random_sample(rng).x;
    const Matrix2d rest_inverse = random_rest_inverse(rng);
    const double area = rng.uniform(0.1, 3);
    const auto evaluate = [&](const SixPoints& y) {
      return triangle_derivatives(jacobian(y, 0, rest_inverse), rest_inverse, area);
    };
    const auto energy = [&](const SixPoints& y) {
      return Scalar(triangle_energy(jacobian(y, 0, rest_inverse), area));
    };
    const TriangleDerivatives exact = evaluate(x);
    const auto gradient = [&](const SixPoints& y) { return Vec6(evaluate(y).gradient); };
    const Vec6 g = differences(x, 1e-6, energy).leftCols<6>().transpose();
    const Mat6 H = differences(x, 1e-6, gradient).leftCols<6>();
    worst_gradient = std::max(worst_gradient, (g - exact.gradient).norm() / exact.gradient.norm());
    worst_hessian = std::max(worst_hessian, (H - exact.hessian).norm() / exact.hessian.norm());
  }
  CHECK(worst_gradient < 1e-6);
  CHECK(worst_hessian < 1e-6);
}

TEST_CASE("an isometric triangle is at rest") {
  Rng rng(12);
  for (int i = 0; i < 100; ++i) {
    const Matrix2d J = shapes::rotation(rng.uniform(0, 6)), rest = random_rest_inverse(rng);
    const TriangleDerivatives E = triangle_derivatives(J, rest, 0.7);
    CHECK(E.value == doctest::Approx(2.8).epsilon(1e-13));
    CHECK(E.gradient.norm() < 1e-13);
    CHECK(Eigen::SelfAdjointEigenSolver<Mat6>(E.hessian).eigenvalues().minCoeff() > -1e-12);
  }
}

// ---- projection ----

/// A random matrix that, like a Hessian of a function of differences, takes translations to 0.
template <int P>
Eigen::Matrix<double, 2 * P, 2 * P> random_hessian(Rng& rng) {
  using Mat = Eigen::Matrix<double, 2 * P, 2 * P>;
  Mat T = Mat::Identity();
  for (int i = 0; i < 2 * P; ++i)
    for (int j = i % 2; j < 2 * P; j += 2) T(i, j) -= 1.0 / P;
  return T * random_symmetric<2 * P>(rng) * T;
}

TEST_CASE("project_spd lifts eigenvalues to epsilon and keeps the others") {
  Rng rng(13);
  for (int i = 0; i < 200; ++i) {
    const Mat12 H = random_hessian<6>(rng);
    for (double epsilon : {1e-3, 0.5}) {
      Mat12 P = H;
      project_spd<6>(P, epsilon);
      const Eigen::SelfAdjointEigenSolver<Mat12> before(H), after(P);
      const Vec12 expected = before.eigenvalues().cwiseMax(epsilon);
      CHECK((after.eigenvalues() - expected).norm() < 1e-12);
      CHECK((P * H - H * P).norm() < 1e-11);  // the same eigenvectors
      const Mat12 reference =
          before.eigenvectors() * expected.asDiagonal() * before.eigenvectors().transpose();
      CHECK((P - reference).norm() < 1e-12);
    }
  }
}

TEST_CASE("project_spd keeps what is positive, but for translations") {
  Rng rng(14);
  for (int i = 0; i < 200; ++i) {
    const Mat6 M = random_hessian<3>(rng);
    const Mat6 positive = M * M;  // with two eigenvalues of 0
    Mat6 P = positive;
    project_spd<3>(P, 1e-9);
    CHECK((P - positive).norm() < 1e-8);
  }
}

TEST_CASE("eigenvalues of matrices that are diagonal, split, graded or multiples of one") {
  Rng rng(16);
  constexpr int N = 10;
  using Mat = Eigen::Matrix<double, N, N>;
  for (int i = 0; i < 100; ++i) {
    LaneMatrix<N> lanes;
    std::array<Mat, kLanes> matrix;
    for (int lane = 0; lane < kLanes; ++lane) {
      Mat M = random_symmetric<N>(rng);
      if (lane % 8 == 1) M = Mat(M.diagonal().asDiagonal());
      if (lane % 8 == 2) M.setIdentity();
      if (lane % 8 == 3) M.setZero();
      if (lane % 8 == 4) M.topRightCorner<4, 6>().setZero(), M.bottomLeftCorner<6, 4>().setZero();
      for (int k = 0; lane % 8 == 5 && k < N; ++k) {
        M.row(k) *= std::pow(10.0, -2 * k);
        M.col(k) *= std::pow(10.0, -2 * k);
      }
      if (lane % 8 == 6) M *= std::pow(10.0, rng.between(-40, 40));
      if (lane % 8 == 7) M = Mat(M.col(0) * M.col(0).transpose());
      if (lane == 14) {  // next to a tail whose square is below the smallest normal numbers
        M.bottomLeftCorner<N - 2, 1>().setConstant(7e-151);
        M.topRightCorner<1, N - 2>().setConstant(7e-151);
      }
      elements::put<N>(M, lane, lanes);
      matrix[static_cast<std::size_t>(lane)] = M;
    }
    const LaneEigen<N> eigen(lanes);
    for (int lane = 0; lane < kLanes; ++lane) {
      const Mat& M = matrix[static_cast<std::size_t>(lane)];
      Mat V;
      Eigen::Matrix<double, N, 1> d;
      for (int k = 0; k < N; ++k) {
        d[k] = eigen.value[k][lane];
        for (int j = 0; j < N; ++j) V(j, k) = eigen.vector[k][j][lane];
      }
      CAPTURE(lane);
      CHECK((V * d.asDiagonal() * V.transpose() - M).norm() <= 1e-13 * M.norm());
      CHECK((V.transpose() * V - Mat::Identity()).norm() < 1e-13);
    }
  }
}

TEST_CASE("a lane does not depend on the others, nor on their being numbers") {
  Rng rng(17);
  const Mat12 H = random_hessian<6>(rng);
  LaneMatrix<12> alone, mixed;
  for (int lane = 0; lane < kLanes; ++lane) {
    elements::put<12>(H, lane, alone);
    elements::put<12>(random_hessian<6>(rng), lane, mixed);
  }
  elements::put<12>(Mat12::Constant(std::numeric_limits<double>::quiet_NaN()), 2, mixed);
  elements::put<12>(Mat12::Constant(std::numeric_limits<double>::infinity()), 4, mixed);
  elements::put<12>(H, 5, mixed);
  ism::detail::project_spd<6>(alone, 1e-3);
  ism::detail::project_spd<6>(mixed, 1e-3);
  CHECK(elements::get<12>(mixed, 5) == elements::get<12>(alone, 0));
  CHECK(elements::get<12>(mixed, 0).allFinite());
}

TEST_CASE("project_spd makes polygon Hessians definite and keeps their scale") {
  Rng rng(15);
  int indefinite = 0;
  for (int i = 0; i < 300; ++i) {
    const Mat12 H = derivatives(random_sample(rng), 2).hessian;
    Mat12 P = H;
    project_spd<6>(P, 1e-3);
    const Vec12 d = Eigen::SelfAdjointEigenSolver<Mat12>(H).eigenvalues();
    indefinite += d.minCoeff() < -1e-6;
    const Vec12 e = Eigen::SelfAdjointEigenSolver<Mat12>(P).eigenvalues();
    CHECK(e.minCoeff() > 1e-3 - 1e-11 * H.norm());
    CHECK(e.maxCoeff() == doctest::Approx(d.maxCoeff()).epsilon(1e-11));
  }
  CHECK(indefinite > 250);
}

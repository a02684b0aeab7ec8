// Closed-form energies against singular values and finite differences.

#ifndef ISM_TESTS_PART_ENERGIES_HPP
#define ISM_TESTS_PART_ENERGIES_HPP

#include "elements.hpp"
#include "ism.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace energy_tests {
namespace {

using namespace ism::detail;
using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;
using EigenSolver = Eigen::SelfAdjointEigenSolver<MatrixXd>;
using elements::jacobian;
using elements::polygon_derivatives;
using elements::PolygonDerivatives;
using elements::project_spd;
using elements::triangle_derivatives;
using elements::TriangleDerivatives;
using ism::DistortionMeasure;
using ism::StretchDensity;
using shapes::Rng;
using shapes::to_mat2;
using shapes::to_vec2;

/// A polygon with all that its energy depends on.
struct Sample {
  OverlayPolygon polygon;
  SixPoints x;
  Mat2 rest_inverse_a, rest_inverse_b;
};

/// Coordinate k of all twelve.
double& coordinate(SixPoints& x, int k) { return k % 2 == 0 ? x[k / 2].x : x[k / 2].y; }

/// Moves all points by one affine map.
void transform(const Matrix2d& M, const Vector2d& t, SixPoints& x) {
  for (Vec2& p : x.p) p = to_mat2(M) * p + to_vec2(t);
}

/// The columns b - a and c - a of the triangle of points first .. first + 2.
Matrix2d edges_of(const SixPoints& x, int first) {
  return shapes::eigen(columns(x[first + 1] - x[first], x[first + 2] - x[first]));
}

OverlayPolygon polygon_of(const SixPoints& x) {
  return intersect({{{x[0], 0}, {x[1], 1}, {x[2], 2}}}, {{{x[3], 3}, {x[4], 4}, {x[5], 5}}});
}

/// The inverse rest frame of a random triangle that is neither thin nor very large or small.
Mat2 random_rest_inverse(Rng& rng) {
  Matrix2d R = Matrix2d::Zero();
  R(1, 1) = rng.uniform(0.5, 1.5);
  R(0, 0) = rng.uniform(0.5, 1.5);
  R(0, 1) = rng.uniform(-0.5, 1);
  return to_mat2(R.inverse());
}

/// The smallest sine of the angles between edges of the two triangles that cross at a corner.
double smallest_crossing_sine(const OverlayPolygon& p, const SixPoints& x) {
  double smallest = 1;
  for (int i = 0, before = p.count - 1; i < p.count; before = i++) {
    const int e = p.piece(before), g = p.piece(i);
    if (same_triangle(e, g)) continue;
    const Vec2 d = x[edge_end(e)] - x[edge_start(e)];
    const Vec2 w = x[edge_end(g)] - x[edge_start(g)];
    smallest = std::min(smallest, std::abs(cross(d, w)) / (norm(d) * norm(w)));
  }
  return smallest;
}

/// True if the combinatorics stay the same under every displacement of one coordinate by step.
bool is_stable(const Sample& s, double step) {
  for (int k = 0; k < 12; ++k)
    for (double h : {-step, step}) {
      SixPoints x = s.x;
      coordinate(x, k) += h;
      const OverlayPolygon p = polygon_of(x);
      if (p.count != s.polygon.count || p.code != s.polygon.code) return false;
    }
  return true;
}

/// A random pair of overlapping triangles, away from degenerate positions.
Sample random_sample(Rng& rng) {
  for (;;) {
    Sample s;
    for (Vec2& p : s.x.p) p = to_vec2(rng.point(1));
    if (rng.below(2)) {  // two triangles across each other often meet in a hexagon
      const double angle = rng.uniform(0, 2 * shapes::kPi);
      for (int k = 0; k < 6; ++k) {
        const double phi = angle + shapes::kPi / 3 * (k < 3 ? 2 * k : 2 * k + 1);
        s.x[k] = to_vec2(Vector2d(std::cos(phi), std::sin(phi)) + rng.point(0.3));
      }
    }
    if (edges_of(s.x, 0).determinant() < 0.2 || edges_of(s.x, 3).determinant() < 0.2) continue;
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

double density(const DistortionMeasure& measure, const Matrix2d& F, const Matrix2d& G) {
  return density_value(measure, to_mat2(F), to_mat2(G));
}

/// Of the symmetric Dirichlet energy, with coverage.
double density(const Matrix2d& F, const Matrix2d& G, double kappa) {
  return density(kDirichlet, F, G) - kappa * (1 / F.determinant() + 1 / G.determinant());
}

struct DensityDerivatives {
  double value = 0;
  VectorXd gradient = VectorXd::Zero(8);
  MatrixXd hessian = MatrixXd::Zero(8, 8);
};

DensityDerivatives density_derivatives(const Matrix2d& F, const Matrix2d& G, double kappa) {
  Lanes J[8];
  for (int k = 0; k < 4; ++k) {
    J[k] = F(k);
    J[4 + k] = G(k);
  }
  const DensityParts<Lanes> w = density_parts(kDirichlet, kappa, J);
  LaneMatrix<8> hessian;
  density_hessian(J, w, hessian);
  DensityDerivatives result;
  result.value = w.w.value[0];
  for (int i = 0; i < 8; ++i) result.gradient[i] = w.gradient(i)[0];
  result.hessian = elements::get(hessian, 0);
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
  const Vector2d sigma = svd.singularValues();
  return area_b * (sigma.squaredNorm() - kappa) +
         area_a * (sigma.cwiseInverse().squaredNorm() - kappa);
}

constexpr double kStep = 1e-6;  // of differences

/// x, then x with one coordinate after the other raised and lowered.
std::vector<SixPoints> displaced(const SixPoints& x) {
  std::vector<SixPoints> positions = {x};
  for (int k = 0; k < 12; ++k)
    for (double h : {kStep, -kStep}) {
      positions.push_back(x);
      coordinate(positions.back(), k) += h;
    }
  return positions;
}

/// Central differences of a vector-valued function of displaced positions, or of what was found
/// there; column k is ∂/∂x_k.
template <class There, class Function>
MatrixXd differences(const std::vector<There>& there, Function function) {
  MatrixXd result(function(there[0]).size(), 12);
  for (std::size_t k = 0; k < 12; ++k)
    result.col(static_cast<int>(k)) =
        (function(there[1 + 2 * k]) - function(there[2 + 2 * k])) / (2 * kStep);
  return result;
}

using Scalar = Eigen::Matrix<double, 1, 1>;

/// The largest errors of gradients and Hessians relative to their norms, and what was sampled.
struct Worst {
  double gradient = 0, hessian = 0, asymmetry = 0;
  int corners[7] = {};
};

/// Compares derivatives that were found at displaced positions with their differences.
void compare(const std::vector<PolygonDerivatives>& found, Worst& worst) {
  const PolygonDerivatives& exact = found[0];
  const MatrixXd g =
      differences(found, [](const PolygonDerivatives& d) { return Scalar(d.value); });
  const MatrixXd H = differences(found, [](const PolygonDerivatives& d) { return d.gradient; });
  const auto raise = [](double& most, double x) { most = std::isnan(x) ? x : std::max(most, x); };
  raise(worst.gradient, (g.transpose() - exact.gradient).norm() / exact.gradient.norm());
  raise(worst.hessian, (H - exact.hessian).norm() / exact.hessian.norm());
  raise(worst.asymmetry, (exact.hessian - exact.hessian.transpose()).norm() / exact.hessian.norm());
}

/// Samples until each corner count has occurred at least `least` times. `evaluate` finds the
/// derivatives of a sample at displaced positions.
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
    compare(evaluate(s, displaced(s.x)), worst);
    ++worst.corners[s.polygon.count];
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

MatrixXd random_symmetric(int n, Rng& rng) {
  MatrixXd M(n, n);
  for (int i = 0; i < n * n; ++i) M(i) = rng.uniform(-1, 1);
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
    const Worst worst =
        compare_samples(2, 400, [&](const Sample& s, const std::vector<SixPoints>& x) {
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
  const Worst worst =
      compare_samples(3, 400, [&](const Sample& s, const std::vector<SixPoints>& x) {
        const std::vector<PolygonDerivatives> a = elements::area_derivatives(s.polygon, x);
        for (std::size_t i = 0; i < x.size(); ++i) CHECK(a[i].value == area_of(s.polygon, x[i]));
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
    const DensityDerivatives exact = density_derivatives(J[0], J[1], kappa);
    CHECK(exact.value == doctest::Approx(density(J[0], J[1], kappa)).epsilon(1e-12));
    VectorXd gradient(8);
    MatrixXd hessian(8, 8);
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
    transform(M, rng.point(5), moved.x);
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
      VectorXd shift = VectorXd::Zero(12);
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
    s.rest_inverse_b = to_mat2(edges_of(s.x, 3).inverse() * F * rotation);
    const PolygonDerivatives E = derivatives(s, 2), unrewarded = derivatives(s, 0);
    CHECK(std::abs(E.value) < 1e-12 * unrewarded.value);
    CHECK(E.gradient.norm() < 1e-11 * unrewarded.gradient.norm());
    const EigenSolver eigen(E.hessian);
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
      CHECK(density(measure, bad, good) == kInfinity);
      CHECK(density(measure, good, bad) == kInfinity);
      CHECK(density(measure, bad, bad) == kInfinity);
    }
  CHECK(density(good, good, 0) == 4);
  CHECK(density(good, good, 2) == 0);
}

/// The inverse map: A and B exchanged.
Sample inverse_of(const Sample& s) {
  Sample swapped = s;
  std::rotate(swapped.x.p, swapped.x.p + 3, swapped.x.p + 6);
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
    VectorXd expected(12);
    expected << E.gradient.tail(6), E.gradient.head(6);
    CHECK((S.gradient - expected).norm() < 1e-11 * E.gradient.norm());
  }
}

// ---- other measures (§3.2) ----

/// Against the formula of singular values, integrated over the surfaces.
void check_values(const Known& known) {
  Rng rng(14);
  double worst = 0;
  for (int i = 0; i < 1000; ++i) {
    const Sample s = random_sample(rng);
    const Matrix2d F = jacobian(s.x, 0, s.rest_inverse_a);
    const Matrix2d G = jacobian(s.x, 3, s.rest_inverse_b);
    const Eigen::JacobiSVD<Matrix2d> svd(G.inverse() * F);
    const double planar = area_of(s.polygon, s.x);
    const double area = planar * (known.on_a / F.determinant() + known.on_b / G.determinant());
    const double expected = area * known.of_sigma(svd.singularValues()[1], svd.singularValues()[0]);
    const double scale = derivatives(s, 0).value;
    worst = std::max(worst, std::abs(derivatives(s, 0, known.measure).value - expected) / scale);
    worst = std::max(worst, std::abs(planar * density(known.measure, F, G) - expected) / scale);
  }
  CHECK(worst < 1e-10);  // sarap rounds a kink off
}

void check_derivatives(const Known& known) {
  const Worst worst =
      compare_samples(15, 100, [&](const Sample& s, const std::vector<SixPoints>& x) {
        return polygon_derivatives(s.polygon, x, s.rest_inverse_a, s.rest_inverse_b, known.measure,
                                   0.2);
      });
  for (int count : {3, 4, 5, 6}) CHECK(worst.corners[count] >= 100);
  CHECK(worst.gradient < 1e-5);
  CHECK(worst.hessian < 1e-4);
  CHECK(worst.asymmetry < 1e-13);
}

TEST_CASE("every measure is its formula of singular values, integrated over its surfaces") {
  for (const Known& known : kKnown) {
    CAPTURE(known.name);
    check_values(known);
  }
}

TEST_CASE("derivatives of every measure agree with differences for every corner count") {
  for (const Known& known : kKnown) {
    CAPTURE(known.name);
    check_derivatives(known);
  }
}

TEST_CASE("derivatives of every measure agree with differences next to conformal maps") {
  // There both singular values are nearly the same, and their difference has a kink.
  const DistortionMeasure measures[] = {kDirichlet, ism::arap(), ism::sarap(), ism::asap()};
  for (std::size_t i = 0; i < 4; ++i) {
    CAPTURE(i);
    Rng rng(20);
    Worst worst;
    for (int k = 0; k < 200; ++k) {
      Sample s = random_sample(rng);
      const Matrix2d F = jacobian(s.x, 0, s.rest_inverse_a);
      Matrix2d away;
      away << rng.point(0.01), rng.point(0.01);
      const double scale = k % 2 ? 1 : rng.uniform(0.5, 2);
      const Matrix2d J = scale * shapes::rotation(rng.uniform(0, 6)) + away;
      s.rest_inverse_b = to_mat2(edges_of(s.x, 3).inverse() * F * J);
      compare(polygon_derivatives(s.polygon, displaced(s.x), s.rest_inverse_a, s.rest_inverse_b,
                                  measures[i], 0.2),
              worst);
    }
    CHECK(worst.gradient < 1e-5);
    CHECK(worst.hessian < 1e-4);
  }
}

TEST_CASE("a measure of one's own is integrated and differentiated like those of the library") {
  const DistortionMeasure area(
      [](double, double d) { return StretchDensity{square(d - 1), 0, 2 * (d - 1), 0, 0, 2}; }, 1,
      0);
  const DistortionMeasure cubic(  // S² + S d² + d³
      [](double S, double d) {
        return StretchDensity{S * S + S * d * d + d * d * d,
                              2 * S + d * d,
                              2 * S * d + 3 * d * d,
                              2,
                              2 * d,
                              2 * S + 6 * d};
      },
      0.3, 0.9);
  const Known own[] = {
      {"area", area, [](double s, double t) { return square(s * t - 1); }, 1, 0, false},
      {"cubic", cubic,
       [](double s, double t) {
         const double S = s * s + t * t, d = s * t;
         return S * S + S * d * d + d * d * d;
       },
       0.3, 0.9, false}};
  for (const Known& known : own) {
    CAPTURE(known.name);
    CHECK(known.measure.is_complete());
    CHECK(known.measure.on_a() == known.on_a);
    CHECK(known.measure.on_b() == known.on_b);
    check_values(known);
    check_derivatives(known);
  }
}

TEST_CASE("the symmetric Dirichlet energy is the integral of its density, spelled out") {
  const DistortionMeasure spelled_out([](double S, double d) { return kDirichlet.density(S, d); },
                                      kDirichlet.on_a(), kDirichlet.on_b());
  CHECK(kDirichlet.is_symmetric_dirichlet());
  CHECK(!spelled_out.is_symmetric_dirichlet());
  Rng rng(18);
  for (int i = 0; i < 300; ++i) {
    const Sample s = random_sample(rng);
    const PolygonDerivatives E = derivatives(s, 1.5), other = derivatives(s, 1.5, spelled_out);
    CHECK(std::abs(other.value - E.value) < 1e-12 * derivatives(s, 0).value);
    CHECK((other.gradient - E.gradient).norm() < 1e-11 * E.gradient.norm());
    CHECK((other.hessian - E.hessian).norm() < 1e-11 * E.hessian.norm());
    const Matrix2d F = jacobian(s.x, 0, s.rest_inverse_a), G = jacobian(s.x, 3, s.rest_inverse_b);
    CHECK(density(spelled_out, F, G) == doctest::Approx(density(kDirichlet, F, G)).epsilon(1e-12));
  }
}

TEST_CASE("a density is asked for squares of real singular values only, up to rounding") {
  bool all = true;
  const DistortionMeasure asked(
      [&](double S, double d) {
        all = all && S >= 2 * d * (1 - 1e-12) && d > 0;
        return StretchDensity{0, 0, 0, 0, 0, 0};
      },
      1, 0);
  Rng rng(19);
  for (int i = 0; i < 300; ++i) {
    Sample s = random_sample(rng);
    derivatives(s, 0, asked);
    const Matrix2d F = jacobian(s.x, 0, s.rest_inverse_a);  // a conformal map has S = 2 d
    const Matrix2d rotation = rng.uniform(0.1, 3) * shapes::rotation(rng.uniform(0, 6));
    s.rest_inverse_b = to_mat2(edges_of(s.x, 3).inverse() * F * rotation);
    derivatives(s, 0, asked);
    density(asked, F, jacobian(s.x, 3, s.rest_inverse_b));
  }
  CHECK(all);
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
      transform(M, rng.point(5), moved.x);
      const double energy = derivatives(s, 0, known.measure).value;
      CHECK(energy >= 0);
      CHECK(std::abs(derivatives(moved, 0, known.measure).value - energy) <
            1e-10 * derivatives(s, 0).value);
      const Matrix2d F = jacobian(s.x, 0, s.rest_inverse_a);
      const Matrix2d rotation = shapes::rotation(rng.uniform(0, 6));
      s.rest_inverse_b = to_mat2(edges_of(s.x, 3).inverse() * F * rotation);
      const PolygonDerivatives E = derivatives(s, 0, known.measure);
      CHECK(std::abs(E.value) < 1e-10 * area_of(s.polygon, s.x) / F.determinant());
      CHECK(E.gradient.norm() < 1e-4 * derivatives(s, 0).gradient.norm());
    }
  }
}

TEST_CASE("derivatives are finite for identical, touching and nearly parallel triangles") {
  const SixPoints same = {{{0, 0}, {1, 0}, {0.25, 1}, {0, 0}, {1, 0}, {0.25, 1}}};
  Rng rng(9);
  int polygons = 0, infinite = 0;
  const auto check = [&](const SixPoints& x) {
    const OverlayPolygon p = polygon_of(x);
    if (p.count == 0) return;
    ++polygons;
    const PolygonDerivatives E = polygon_derivatives(p, x, diagonal(1), diagonal(1), kDirichlet, 2);
    infinite += !std::isfinite(E.value) || !E.gradient.allFinite() || !E.hessian.allFinite();
  };
  check(same);
  for (int k = 0; k < 3000; ++k) {
    SixPoints x = same;
    const double noise = std::pow(10.0, -rng.between(5, 17));
    const Vec2 shift = {rng.below(2) ? 0.5 * rng.between(-1, 1) : 0, 0};
    const double scale = rng.below(2) ? 0.5 : 1;
    for (int c = 3; c < 6; ++c) x[c] = scale * (x[c] + shift) + to_vec2(rng.point(noise));
    check(x);
  }
  CHECK(polygons > 1500);
  CHECK(infinite == 0);
}

TEST_CASE("identical triangles have their full area and the gradient of an isometry") {
  const SixPoints x = {{{0.5, 0}, {2, 0.25}, {0.75, 1}, {0.5, 0}, {2, 0.25}, {0.75, 1}}};
  const Mat2 edges = to_mat2(edges_of(x, 0));
  const OverlayPolygon p = polygon_of(x);
  REQUIRE(p.count >= 3);
  const PolygonDerivatives E =
      polygon_derivatives(p, x, inverse(edges), inverse(edges), kDirichlet, 2);
  CHECK(area_of(p, x) == doctest::Approx(determinant(edges) / 2).epsilon(1e-15));
  CHECK(std::abs(E.value) < 1e-14);
  CHECK(E.gradient.norm() < 1e-13);
}

// ---- triangles ----

/// What a batch finds for the triangle of the first three points.
TriangleDerivatives triangle_in_batch(const SixPoints& x, const Mat2& rest_inverse, double area) {
  TriangleBatch batch;
  for (int k = 0; k < 6; ++k) batch.x[k] = k % 2 == 0 ? x[k / 2].x : x[k / 2].y;
  for (int k = 0; k < 4; ++k) batch.rest_inverse[k] = rest_inverse.entry[k];
  batch.area = area;
  differentiate(batch);
  TriangleDerivatives d;
  d.value = triangle_energy(to_mat2(jacobian(x, 0, rest_inverse)), area);
  for (int k = 0; k < 6; ++k) d.gradient[k] = batch.gradient[k][kLanes - 1];
  d.hessian = elements::get(batch.hessian, kLanes - 1);
  return d;
}

TEST_CASE("triangle energies are the symmetric Dirichlet energy of the singular values") {
  Rng rng(10);
  for (int i = 0; i < 500; ++i) {
    const Matrix2d J = random_jacobian(rng);
    const double area = rng.uniform(0.1, 3);
    const Vector2d sigma = Eigen::JacobiSVD<Matrix2d>(J).singularValues();
    const double expected = area * (sigma.squaredNorm() + sigma.cwiseInverse().squaredNorm());
    CHECK(triangle_energy(to_mat2(J), area) == doctest::Approx(expected).epsilon(1e-12));
    const Mat2 rest_inverse = random_rest_inverse(rng);
    CHECK(triangle_derivatives(to_mat2(J), rest_inverse, area).value ==
          doctest::Approx(expected).epsilon(1e-12));
  }
  CHECK(triangle_energy(diagonal(1), 1) == 4);
  CHECK(triangle_energy(diagonal(-1), 1) == 4);  // a rotation
  CHECK(triangle_energy(diagonal(0), 1) == kInfinity);
  CHECK(triangle_energy(columns({1, 0}, {0, -1}), 1) == kInfinity);
}

TEST_CASE("derivatives of triangle energies agree with differences, alone and in a batch") {
  for (bool in_batch : {false, true}) {
    CAPTURE(in_batch);
    Rng rng(11);
    double worst_gradient = 0, worst_hessian = 0;
    for (int i = 0; i < 500; ++i) {
      const SixPoints x = random_sample(rng).x;
      const Mat2 rest_inverse = random_rest_inverse(rng);
      const double area = rng.uniform(0.1, 3);
      const auto evaluate = [&](const SixPoints& y) {
        return in_batch ? triangle_in_batch(y, rest_inverse, area)
                        : triangle_derivatives(to_mat2(jacobian(y, 0, rest_inverse)), rest_inverse,
                                               area);
      };
      const auto energy = [&](const SixPoints& y) {
        return Scalar(triangle_energy(to_mat2(jacobian(y, 0, rest_inverse)), area));
      };
      const TriangleDerivatives exact = evaluate(x);
      const auto gradient = [&](const SixPoints& y) { return evaluate(y).gradient; };
      const VectorXd g = differences(displaced(x), energy).leftCols(6).transpose();
      const MatrixXd H = differences(displaced(x), gradient).leftCols(6);
      worst_gradient =
          std::max(worst_gradient, (g - exact.gradient).norm() / exact.gradient.norm());
      worst_hessian = std::max(worst_hessian, (H - exact.hessian).norm() / exact.hessian.norm());
    }
    CHECK(worst_gradient < 1e-6);
    CHECK(worst_hessian < 1e-6);
  }
}

TEST_CASE("an isometric triangle is at rest") {
  Rng rng(12);
  for (int i = 0; i < 100; ++i) {
    const Mat2 J = to_mat2(shapes::rotation(rng.uniform(0, 6))), rest = random_rest_inverse(rng);
    SixPoints x;
    x[0] = to_vec2(rng.point(1));
    x[1] = x[0] + J * inverse(rest) * Vec2{1, 0};
    x[2] = x[0] + J * inverse(rest) * Vec2{0, 1};
    for (const TriangleDerivatives& E :
         {triangle_derivatives(J, rest, 0.7), triangle_in_batch(x, rest, 0.7)}) {
      CHECK(E.value == doctest::Approx(2.8).epsilon(1e-13));
      CHECK(E.gradient.norm() < 1e-13);
      CHECK(EigenSolver(E.hessian).eigenvalues().minCoeff() > -1e-12);
    }
  }
}

// ---- projection ----

/// A random matrix that, like a Hessian of a function of differences, takes translations to 0.
MatrixXd random_hessian(int points, Rng& rng) {
  const int n = 2 * points;
  MatrixXd T = MatrixXd::Identity(n, n);
  for (int i = 0; i < n; ++i)
    for (int j = i % 2; j < n; j += 2) T(i, j) -= 1.0 / points;
  return T * random_symmetric(n, rng) * T;
}

TEST_CASE("a polygon in a lane is differentiated like one in doubles") {
  Rng rng(18);
  for (int i = 0; i < 200; ++i) {
    const Sample sample = random_sample(rng);
    const int lane = i % kLanes;
    PolygonBatch batch;
    for (int k = 0; k < kLanes; ++k) {
      const Sample other = k == lane ? sample : random_sample(rng);
      load(other.polygon, other.x, other.rest_inverse_a, other.rest_inverse_b, k, batch);
    }
    PolygonElement<double> one;
    for (int k = 0; k < 12; ++k) one.x[k] = batch.x[k][lane];
    for (int k = 0; k < 8; ++k) one.rest_inverse[k] = batch.rest_inverse[k][lane];
    for (int e = 0; e < 6; ++e) one.s[e] = batch.s[e][lane], one.t[e] = batch.t[e][lane];
    for (int k = 0; k < 9; ++k) {
      const PolygonBatch::Corner& c = batch.corner[k / 3][k % 3];
      one.corner[k / 3][k % 3] = {c.is_there[lane], c.on_a[lane], c.on_b[lane]};
    }
    one.area = batch.area[lane];
    ism::detail::differentiate(kDirichlet, 2, batch);
    ism::detail::differentiate(kDirichlet, 2, one);
#ifdef __FMA__
    const auto same = [](double x, double y) {
      return std::abs(x - y) <= 1e-6 * (1 + std::abs(x));
    };
#else
    const auto same = [](double x, double y) { return x == y; };
#endif
    CHECK(same(one.value, batch.value[lane]));
    for (int k = 0; k < 12; ++k) CHECK(same(one.gradient[k], batch.gradient[k][lane]));
    for (int k = 0; k < 12; ++k)
      for (int l = 0; l <= k; ++l) CHECK(same(one.hessian(k, l), batch.hessian(k, l)[lane]));
  }
}

TEST_CASE("project_spd lifts eigenvalues to epsilon and keeps the others") {
  Rng rng(13);
  for (int i = 0; i < 200; ++i) {
    const MatrixXd H = random_hessian(6, rng);
    for (double epsilon : {1e-3, 0.5}) {
      MatrixXd P = H;
      project_spd<6>(P, epsilon);
      const EigenSolver before(H), after(P);
      const VectorXd expected = before.eigenvalues().cwiseMax(epsilon);
      CHECK((after.eigenvalues() - expected).norm() < 1e-12);
      CHECK((P * H - H * P).norm() < 1e-11);  // the same eigenvectors
      const MatrixXd reference =
          before.eigenvectors() * expected.asDiagonal() * before.eigenvectors().transpose();
      CHECK((P - reference).norm() < 1e-12);
    }
  }
}

TEST_CASE("project_spd lifts eigenvalues of matrices however small") {
  Rng rng(15);
  const double epsilon = 1e-3;
  for (int exponent = -320; exponent < 140; exponent += 2) {
    const MatrixXd H = std::pow(10.0, exponent) * random_hessian(6, rng);
    MatrixXd P = H;
    project_spd<6>(P, epsilon);
    CAPTURE(exponent);
    const double size = std::max(1.0, H.norm());
    CHECK(EigenSolver(P).eigenvalues().minCoeff() > epsilon - 1e-12 * size);
  }
}

TEST_CASE("project_spd keeps what is positive, but for translations") {
  Rng rng(14);
  for (int i = 0; i < 200; ++i) {
    const MatrixXd M = random_hessian(3, rng);
    const MatrixXd positive = M * M;  // with two eigenvalues of 0
    MatrixXd P = positive;
    project_spd<3>(P, 1e-9);
    CHECK((P - positive).norm() < 1e-8);
  }
}

TEST_CASE("eigenvalues of matrices that are diagonal, split, graded or multiples of one") {
  Rng rng(16);
  constexpr int N = 10;
  for (int i = 0; i < 1600; i += kLanes) {
    LaneMatrix<N> lanes;
    std::vector<MatrixXd> matrices;
    for (int lane = 0; lane < kLanes; ++lane) {
      const int kind = rng.below(16);
      MatrixXd M = random_symmetric(N, rng);
      if (kind % 8 == 1) M = MatrixXd(M.diagonal().asDiagonal());
      if (kind % 8 == 2) M.setIdentity();
      if (kind % 8 == 3) M.setZero();
      if (kind % 8 == 4) M.topRightCorner(4, 6).setZero(), M.bottomLeftCorner(6, 4).setZero();
      for (int k = 0; kind % 8 == 5 && k < N; ++k) {
        M.row(k) *= std::pow(10.0, -2 * k);
        M.col(k) *= std::pow(10.0, -2 * k);
      }
      if (kind % 8 == 6) M *= std::pow(10.0, rng.between(-40, 40));
      if (kind % 8 == 7) M = MatrixXd(M.col(0) * M.col(0).transpose());
      if (kind == 14) {  // next to a tail whose square is below the smallest normal numbers
        M.bottomLeftCorner(N - 2, 1).setConstant(7e-151);
        M.topRightCorner(1, N - 2).setConstant(7e-151);
      }
      elements::put(M, lane, lanes);
      matrices.push_back(M);
    }
    LaneEigen<N> eigen;
    eigen.decompose(lanes);
    for (int lane = 0; lane < kLanes; ++lane) {
      const MatrixXd& M = matrices[static_cast<std::size_t>(lane)];
      CAPTURE(lane);
      MatrixXd V(N, N);
      VectorXd d(N);
      for (int k = 0; k < N; ++k) {
        d[k] = eigen.value[k][lane];
        for (int j = 0; j < N; ++j) V(j, k) = eigen.vector[k][j][lane];
      }
      CHECK((V * d.asDiagonal() * V.transpose() - M).norm() <= 1e-13 * M.norm());
      CHECK((V.transpose() * V - MatrixXd::Identity(N, N)).norm() < 1e-13);
    }
  }
}

TEST_CASE("a lane does not depend on the others, nor on their being numbers") {
  Rng rng(17);
  const MatrixXd H = random_hessian(6, rng);
  LaneMatrix<12> alone;
  for (int lane = 0; lane < kLanes; ++lane) elements::put(H, lane, alone);
  ism::detail::project_spd<6>(alone, 1e-3);
  const double bad[2] = {std::numeric_limits<double>::quiet_NaN(), kInfinity};
  for (int at = 0; at < kLanes; ++at)
    for (bool nan_before : {false, true}) {
      CAPTURE(at);
      CAPTURE(nan_before);
      LaneMatrix<12> mixed;
      for (int lane = 0; lane < kLanes; ++lane) elements::put(random_hessian(6, rng), lane, mixed);
      const int next = (at + 1) % kLanes, last = (at + kLanes - 1) % kLanes;
      elements::put(MatrixXd::Constant(12, 12, bad[nan_before]), next, mixed);
      elements::put(MatrixXd::Constant(12, 12, bad[!nan_before]), last, mixed);
      elements::put(H, at, mixed);
      ism::detail::project_spd<6>(mixed, 1e-3);
      CHECK(elements::get(mixed, at) == elements::get(alone, 0));
      for (int lane = 0; lane < kLanes; ++lane)
        if (lane != next && lane != last) CHECK(elements::get(mixed, lane).allFinite());
    }
}

TEST_CASE("project_spd makes polygon Hessians definite and keeps their scale") {
  Rng rng(15);
  int indefinite = 0;
  for (int i = 0; i < 300; ++i) {
    const MatrixXd H = derivatives(random_sample(rng), 2).hessian;
    MatrixXd P = H;
    project_spd<6>(P, 1e-3);
    const VectorXd d = EigenSolver(H).eigenvalues();
    indefinite += d.minCoeff() < -1e-6;
    const VectorXd e = EigenSolver(P).eigenvalues();
    CHECK(e.minCoeff() > 1e-3 - 1e-11 * H.norm());
    CHECK(e.maxCoeff() == doctest::Approx(d.maxCoeff()).epsilon(1e-11));
  }
  CHECK(indefinite > 250);
}

}  // namespace energy_tests

#endif  // ISM_TESTS_PART_ENERGIES_HPP

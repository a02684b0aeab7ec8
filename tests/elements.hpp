// Single polygons, triangles and matrices put through the batches of the header, for the tests.

#ifndef ISM_TESTS_ELEMENTS_HPP
#define ISM_TESTS_ELEMENTS_HPP

#include "ism.hpp"
#include "shapes.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace elements {

// Matrices are of dynamic size: Eigen unrolls what it does with fixed ones, which takes compilers
// long.
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct PolygonDerivatives {
  bool is_negligible = false;  // then all the rest is zero
  double value = 0;
  VectorXd gradient = VectorXd::Zero(12);
  MatrixXd hessian = MatrixXd::Zero(12, 12);
};

struct TriangleDerivatives {
  double value = 0;
  VectorXd gradient = VectorXd::Zero(6);
  MatrixXd hessian = MatrixXd::Zero(6, 6);
};

/// Jacobian of the triangle of points first .. first + 2 of x.
inline Eigen::Matrix2d jacobian(const ism::detail::SixPoints& x, int first,
                                const ism::detail::Mat2& rest_inverse) {
  return shapes::eigen(ism::detail::jacobian(x[first], x[first + 1], x[first + 2], rest_inverse));
}

template <int N>
void put(const MatrixXd& M, int lane, ism::detail::LaneMatrix<N>& lanes) {
  for (int i = 0; i < N; ++i)
    for (int j = 0; j <= i; ++j) lanes(i, j)[lane] = M(i, j);
}

template <int N>
MatrixXd get(const ism::detail::LaneMatrix<N>& lanes, int lane) {
  MatrixXd M(N, N);
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) M(i, j) = lanes.symmetric(i, j)[lane];
  return M;
}

/// What differentiate() finds in one lane.
inline PolygonDerivatives result_in(const ism::detail::PolygonBatch& batch, int lane) {
  PolygonDerivatives d;
  d.is_negligible = batch.is_negligible[lane] > 0;
  if (d.is_negligible) return d;
  d.value = batch.value[lane];
  for (int i = 0; i < 12; ++i) d.gradient[i] = batch.gradient[i][lane];
  d.hessian = get(batch.hessian, lane);
  return d;
}

/// One polygon at several positions of its points, each in a lane; `fill` differentiates a batch.
template <class Fill>
std::vector<PolygonDerivatives> in_lanes(const ism::detail::OverlayPolygon& p,
                                         const std::vector<ism::detail::SixPoints>& positions,
                                         const ism::detail::Mat2& rest_inverse_a,
                                         const ism::detail::Mat2& rest_inverse_b, Fill fill) {
  std::vector<PolygonDerivatives> all;
  while (all.size() < positions.size()) {
    ism::detail::PolygonBatch batch;
    for (int lane = 0; lane < ism::detail::kLanes; ++lane) {
      const std::size_t i =
          std::min(all.size() + static_cast<std::size_t>(lane), positions.size() - 1);
      ism::detail::load(p, positions[i], rest_inverse_a, rest_inverse_b, lane, batch);
    }
    fill(batch);
    for (int lane = 0; lane < ism::detail::kLanes && all.size() < positions.size(); ++lane)
      all.push_back(result_in(batch, lane));
  }
  return all;
}

/// E_ρ of one polygon at several positions of its points.
inline std::vector<PolygonDerivatives> polygon_derivatives(
    const ism::detail::OverlayPolygon& p, const std::vector<ism::detail::SixPoints>& positions,
    const ism::detail::Mat2& rest_inverse_a, const ism::detail::Mat2& rest_inverse_b,
    const ism::DistortionMeasure& measure, double kappa) {
  return in_lanes(
      p, positions, rest_inverse_a, rest_inverse_b,
      [&](ism::detail::PolygonBatch& batch) { ism::detail::differentiate(measure, kappa, batch); });
}

/// E_ρ of one polygon.
inline PolygonDerivatives polygon_derivatives(const ism::detail::OverlayPolygon& p,
                                              const ism::detail::SixPoints& x,
                                              const ism::detail::Mat2& rest_inverse_a,
                                              const ism::detail::Mat2& rest_inverse_b,
                                              const ism::DistortionMeasure& measure, double kappa) {
  const std::vector<ism::detail::SixPoints> positions = {x};
  return polygon_derivatives(p, positions, rest_inverse_a, rest_inverse_b, measure, kappa)[0];
}

/// The area of one polygon by itself, at several positions of its points.
inline std::vector<PolygonDerivatives> area_derivatives(
    const ism::detail::OverlayPolygon& p, const std::vector<ism::detail::SixPoints>& positions) {
  const ism::detail::Mat2 any = ism::detail::diagonal(1);
  return in_lanes(p, positions, any, any, [](ism::detail::PolygonBatch& batch) {
    batch.value = batch.area;
    ism::detail::area_gradient(batch, batch.gradient);
    ism::detail::set_area_hessian(batch, ism::detail::Lanes(1.0), batch.hessian);
  });
}

/// E_f of one triangle with Jacobian J.
inline TriangleDerivatives triangle_derivatives(const ism::detail::Mat2& J,
                                                const ism::detail::Mat2& rest_inverse,
                                                double area) {
  ism::detail::TriangleElement<double> t = {};
  const ism::detail::Mat2 sides = J * ism::detail::inverse(rest_inverse);
  std::copy(sides.entry, sides.entry + 4, t.x + 2);
  std::copy(rest_inverse.entry, rest_inverse.entry + 4, t.rest_inverse);
  t.area = area;
  ism::detail::differentiate(t);
  TriangleDerivatives d;
  d.value = ism::detail::triangle_energy(J, area);
  for (int i = 0; i < 6; ++i) {
    d.gradient[i] = t.gradient[i];
    for (int j = 0; j < 6; ++j) d.hessian(i, j) = t.hessian.symmetric(i, j);
  }
  return d;
}

/// project_spd() of one matrix.
template <int P>
void project_spd(MatrixXd& H, double epsilon) {
  ism::detail::LaneMatrix<2 * P> lanes;
  for (int lane = 0; lane < ism::detail::kLanes; ++lane) put(H, lane, lanes);
  ism::detail::project_spd<P>(lanes, epsilon);
  H = get(lanes, 0);
}

}  // namespace elements

#endif  // ISM_TESTS_ELEMENTS_HPP

// Single polygons and matrices put through the batches of the header, for the tests.

#ifndef ISM_TESTS_ELEMENTS_HPP
#define ISM_TESTS_ELEMENTS_HPP

#include "ism.hpp"

namespace elements {

using Vec12 = Eigen::Matrix<double, 12, 1>;
using Mat12 = Eigen::Matrix<double, 12, 12>;

struct PolygonDerivatives {
  bool is_negligible = false;  // then all the rest is zero
  double value = 0;
  Vec12 gradient = Vec12::Zero();
  Mat12 hessian = Mat12::Zero();
};

/// Jacobian of the triangle in columns first .. first + 2 of x.
inline Eigen::Matrix2d jacobian(const ism::detail::SixPoints& x, int first,
                                const Eigen::Matrix2d& rest_inverse) {
  return ism::detail::jacobian(x.col(first), x.col(first + 1), x.col(first + 2), rest_inverse);
}

template <int N>
void put(const Eigen::Matrix<double, N, N>& M, int lane, ism::detail::LaneMatrix<N>& lanes) {
  for (int i = 0; i < N; ++i)
    for (int j = 0; j <= i; ++j) lanes(i, j)[lane] = M(i, j);
}

template <int N>
Eigen::Matrix<double, N, N> get(const ism::detail::LaneMatrix<N>& lanes, int lane) {
  Eigen::Matrix<double, N, N> M;
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) M(i, j) = lanes.symmetric(i, j)[lane];
  return M;
}

/// What differentiate() finds in one lane.
inline PolygonDerivatives result_in(const ism::detail::PolygonBatch& batch, int lane) {
  PolygonDerivatives d;
  d.is_negligible = batch.is_negligible[static_cast<std::size_t>(lane)];
  if (d.is_negligible) return d;
  d.value = batch.value[lane];
  for (int i = 0; i < 12; ++i) d.gradient[i] = batch.gradient[i][lane];
  d.hessian = get(batch.hessian, lane);
  return d;
}

/// E_ρ of one polygon.
inline PolygonDerivatives polygon_derivatives(const ism::detail::OverlayPolygon& p,
                                              const ism::detail::SixPoints& x,
                                              const Eigen::Matrix2d& rest_inverse_a,
                                              const Eigen::Matrix2d& rest_inverse_b,
                                              const ism::DistortionMeasure& measure, double kappa) {
  ism::detail::PolygonBatch batch;
  for (int lane = 0; lane < ism::detail::kLanes; ++lane)
    ism::detail::load(p, x, rest_inverse_a, rest_inverse_b, lane, batch);
  ism::detail::differentiate(measure, kappa, batch);
  return result_in(batch, 0);
}

/// project_spd() of one matrix.
template <int P>
void project_spd(Eigen::Matrix<double, 2 * P, 2 * P>& H, double epsilon) {
  ism::detail::LaneMatrix<2 * P> lanes;
  for (int lane = 0; lane < ism::detail::kLanes; ++lane) put<2 * P>(H, lane, lanes);
  ism::detail::project_spd<P>(lanes, epsilon);
  H = get<2 * P>(lanes, 0);
}

}  // namespace elements

#endif  // ISM_TESTS_ELEMENTS_HPP

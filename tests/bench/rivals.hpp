// Other libraries on the problems of the benchmark, each behind what CMake found.

#ifndef ISM_BENCH_RIVALS_HPP
#define ISM_BENCH_RIVALS_HPP

#include "ism.hpp"  // with its implementation

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#ifdef ISM_BENCH_CHOLMOD
#include <cholmod.h>
#endif
#ifdef ISM_BENCH_OPENBLAS
extern "C" void openblas_set_num_threads(int n);
#endif
#ifdef ISM_BENCH_ADOLC
#include <adolc/adolc.h>
#endif

namespace rivals {

using Sparse = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;

/// The lower triangle of H + ω Q, without zeros.
inline Sparse lower_triangle(const ism::detail::ShiftedMatrix& matrix) {
  const ism::detail::BlockMatrix& pattern = *matrix.H;
  std::vector<Eigen::Triplet<double>> entries;
  for (int r = 0; r < pattern.rows(); ++r)
    for (int b = pattern.start[r]; b < pattern.start[r + 1]; ++b) {
      const ism::detail::Mat2 block = matrix.block(b);
      const int c = pattern.column[b];
      for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j)
          if (block(i, j) != 0 && 2 * r + i <= 2 * c + j)
            entries.emplace_back(2 * c + j, 2 * r + i, block(i, j));
    }
  Sparse A(2 * pattern.rows(), 2 * pattern.rows());
  A.setFromTriplets(entries.begin(), entries.end());
  return A;
}

inline Eigen::VectorXd flattened(const ism::detail::Array<ism::detail::Vec2>& points) {
  Eigen::VectorXd result(2 * points.size());
  for (int i = 0; i < points.size(); ++i) result.segment<2>(2 * i) << points[i].x, points[i].y;
  return result;
}

inline void set_blas_threads(int n) {
#ifdef ISM_BENCH_OPENBLAS
  openblas_set_num_threads(n);
#else
  (void)n;
#endif
}

#ifdef ISM_BENCH_CHOLMOD
/// CHOLMOD's supernodal factorisation, analysis included, and a solve.
class Cholmod {
 public:
  explicit Cholmod(int ordering) {
    cholmod_start(&common_);
    common_.supernodal = CHOLMOD_SUPERNODAL;
    common_.nmethods = 1;
    common_.method[0].ordering = ordering;
    common_.postorder = 1;
  }
  ~Cholmod() {
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;

  void factorize(Sparse& A) {
    cholmod_free_factor(&factor_, &common_);
    cholmod_sparse view = {};
    view.nrow = view.ncol = static_cast<std::size_t>(A.rows());
    view.nzmax = static_cast<std::size_t>(A.nonZeros());
    view.p = A.outerIndexPtr();
    view.i = A.innerIndexPtr();
    view.x = A.valuePtr();
    view.stype = -1;  // the lower triangle
    view.itype = CHOLMOD_INT;
    view.xtype = CHOLMOD_REAL;
    view.sorted = view.packed = 1;
    factor_ = cholmod_analyze(&view, &common_);
    cholmod_factorize(&view, factor_, &common_);
  }

  Eigen::VectorXd solve(Eigen::VectorXd b) {
    cholmod_dense view = {};
    view.nrow = view.nzmax = view.d = static_cast<std::size_t>(b.size());
    view.ncol = 1;
    view.x = b.data();
    view.xtype = CHOLMOD_REAL;
    cholmod_dense* x = cholmod_solve(CHOLMOD_A, factor_, &view, &common_);
    const Eigen::VectorXd result =
        Eigen::Map<Eigen::VectorXd>(static_cast<double*>(x->x), b.size());
    cholmod_free_dense(&x, &common_);
    return result;
  }

  double gigaflop() const { return common_.fl * 1e-9; }

 private:
  cholmod_common common_;
  cholmod_factor* factor_ = nullptr;
};
#endif

// ---- E_ρ as a formula, for automatic differentiation ----

/// E_ρ of a polygon with known combinatorics; x holds six points, R the entries of both R⁻¹.
template <class T, class P>
T polygon_energy(const ism::detail::OverlayPolygon& p, const T* x, const P* R, double kappa) {
  std::vector<T> corner;  // two coordinates each
  for (int i = 0; i < p.count; ++i) {
    const int e = p.piece((i + p.count - 1) % p.count), g = p.piece(i);
    const int u = ism::detail::edge_start(e), v = ism::detail::edge_end(e);
    const int c = ism::detail::edge_start(g), w = ism::detail::edge_end(g);
    if (ism::detail::same_triangle(e, g)) {
      corner.push_back(x[2 * c]), corner.push_back(x[2 * c + 1]);
      continue;
    }
    const T dx = x[2 * v] - x[2 * u], dy = x[2 * v + 1] - x[2 * u + 1];
    const T wx = x[2 * w] - x[2 * c], wy = x[2 * w + 1] - x[2 * c + 1];
    const T qx = x[2 * c] - x[2 * u], qy = x[2 * c + 1] - x[2 * u + 1];
    const T t = (qx * wy - qy * wx) / (dx * wy - dy * wx);
    corner.push_back(x[2 * u] + t * dx), corner.push_back(x[2 * u + 1] + t * dy);
  }
  T area = 0;
  for (std::size_t i = 2; i + 2 < corner.size(); i += 2)
    area += 0.5 * ((corner[i] - corner[0]) * (corner[i + 3] - corner[1]) -
                   (corner[i + 1] - corner[1]) * (corner[i + 2] - corner[0]));
  T J[8];
  for (int k = 0; k < 8; ++k) {
    const int m = k / 4, column = k % 4 / 2, row = k % 2;
    const T* q = x + 6 * m + row;
    J[k] = (q[2] - q[0]) * R[4 * m + 2 * column] + (q[4] - q[0]) * R[4 * m + 2 * column + 1];
  }
  const T f = J[0] * J[3] - J[1] * J[2], g = J[4] * J[7] - J[5] * J[6];
  T N = 0;
  for (int c = 0; c < 4; c += 2)
    for (int d = 4; d < 8; d += 2) {
      const T X = J[c] * J[d + 1] - J[c + 1] * J[d];
      N += X * X;
    }
  const T i = 1 / f, j = 1 / g;
  return area * (N * (i * i * i + j * j * j) - kappa * (i + j));
}

#ifdef ISM_BENCH_ADOLC
/// How ADOL-C is asked for value, gradient and Hessian.
enum class Driver {
  kHessian,       // a tape per polygon, hessian()
  kHessian2,      // a tape per polygon, hessian2()
  kTapePerShape,  // a tape per combinatorial type, R as parameters, hessian()
  kTapePerShape2  // the same with hessian2()
};

inline const char* name(Driver driver) {
  switch (driver) {
    case Driver::kHessian:
      return "a tape each, hessian";
    case Driver::kHessian2:
      return "a tape each, hessian2";
    case Driver::kTapePerShape:
      return "a tape per shape, hessian";
    default:
      return "a tape per shape, hessian2";
  }
}

class AdolC {
 public:
  AdolC(Driver driver, double kappa) : driver_(driver), kappa_(kappa) {
    for (int i = 0; i < 12; ++i) rows_[i] = hessian_[i];
  }

  /// Records a tape for all polygons of one combinatorial type, where the driver shares tapes.
  void prepare(const ism::detail::OverlayPolygon& p, const double* x, const double* R) {
    if (!shares_tapes() || p.code == recorded_) return;
    recorded_ = p.code;
    record_shared(p, x, R);
  }

  void differentiate(const ism::detail::OverlayPolygon& p, const double* x, const double* R) {
    if (shares_tapes()) {
      double parameters[8];
      std::copy(R, R + 8, parameters);
      set_param_vec(kTag, 8, parameters);
    } else {
      record(p, x, R);
    }
    double point[12];
    std::copy(x, x + 12, point);
    ::function(kTag, 1, 12, point, &value_);
    ::gradient(kTag, 12, point, gradient_);
    if (driver_ == Driver::kHessian || driver_ == Driver::kTapePerShape)
      ::hessian(kTag, 12, point, rows_);
    else
      ::hessian2(kTag, 12, point, rows_);
  }

  double value() const { return value_; }
  double gradient(int i) const { return gradient_[i]; }
  double hessian(int i, int j) const { return i >= j ? hessian_[i][j] : hessian_[j][i]; }

 private:
  static constexpr short kTag = 1;

  bool shares_tapes() const {
    return driver_ == Driver::kTapePerShape || driver_ == Driver::kTapePerShape2;
  }

  void record(const ism::detail::OverlayPolygon& p, const double* x, const double* R) {
    trace_on(kTag);
    adouble y[12];
    for (int i = 0; i < 12; ++i) y[i] <<= x[i];
    adouble E = polygon_energy<adouble, double>(p, y, R, kappa_);
    E >>= value_;
    trace_off();
  }

  void record_shared(const ism::detail::OverlayPolygon& p, const double* x, const double* R) {
    trace_on(kTag);
    adouble y[12];
    for (int i = 0; i < 12; ++i) y[i] <<= x[i];
    adouble parameters[8];
    for (int i = 0; i < 8; ++i) parameters[i] = mkparam(R[i]);
    adouble E = polygon_energy<adouble, adouble>(p, y, parameters, kappa_);
    E >>= value_;
    trace_off();
  }

  Driver driver_;
  double kappa_;
  std::uint32_t recorded_ = ~std::uint32_t{0};
  double value_ = 0, gradient_[12] = {}, hessian_[12][12] = {};
  double* rows_[12];
};
#endif

}  // namespace rivals

#endif  // ISM_BENCH_RIVALS_HPP

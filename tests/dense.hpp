// Sparse systems as dense matrices and vectors, for the tests.

#ifndef ISM_TESTS_DENSE_HPP
#define ISM_TESTS_DENSE_HPP

#include "ism.hpp"
#include "shapes.hpp"

/// The full symmetric matrix of an upper triangle of blocks.
inline Eigen::MatrixXd dense(const ism::detail::BlockMatrix& A) {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(2 * A.rows(), 2 * A.rows());
  for (int r = 0; r < A.rows(); ++r)
    for (int b = A.start[r]; b < A.start[r + 1]; ++b) {
      const int c = A.column[b];
      const Eigen::Matrix2d block = shapes::eigen(A.value[b]);
      H.block<2, 2>(2 * r, 2 * c) = block;
      H.block<2, 2>(2 * c, 2 * r) = block.transpose();
    }
  return H;
}

/// Gradients and directions as one vector, and one vector as these.
inline Eigen::VectorXd dense(const ism::detail::Array<ism::detail::Vec2>& x) {
  Eigen::VectorXd all(2 * x.size());
  for (int i = 0; i < x.size(); ++i) all.segment<2>(2 * i) = shapes::eigen(x[i]);
  return all;
}
inline ism::detail::Array<ism::detail::Vec2> per_vertex(const Eigen::VectorXd& all) {
  ism::detail::Array<ism::detail::Vec2> x(static_cast<int>(all.size()) / 2);
  for (int i = 0; i < x.size(); ++i) x[i] = shapes::to_vec2(all.segment<2>(2 * i));
  return x;
}

#endif  // ISM_TESTS_DENSE_HPP

// A sparse system as a dense matrix, for the tests.

#ifndef ISM_TESTS_DENSE_HPP
#define ISM_TESTS_DENSE_HPP

#include "ism.hpp"

/// The full symmetric matrix of an upper triangle of blocks.
inline Eigen::MatrixXd dense(const ism::detail::BlockPattern& pattern,
                             const ism::detail::BlockValues& values) {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(2 * pattern.rows(), 2 * pattern.rows());
  for (int r = 0; r < pattern.rows(); ++r)
    for (int b = pattern.start[r]; b < pattern.start[r + 1]; ++b) {
      const int c = pattern.column[b];
      H.block<2, 2>(2 * r, 2 * c) = values[b];
      H.block<2, 2>(2 * c, 2 * r) = values[b].transpose();
    }
  return H;
}

#endif  // ISM_TESTS_DENSE_HPP

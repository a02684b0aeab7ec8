// The sparse factorisation against Eigen's, and its promises on order, inertia and threads.

#ifndef ISM_TESTS_PART_LDLT_HPP
#define ISM_TESTS_PART_LDLT_HPP

#include "allocations.hpp"
#include "dense.hpp"
#include "ism.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <functional>
#include <limits>
#include <set>
#include <utility>
#include <vector>

namespace ldlt_tests {
namespace {

using namespace ism::detail;
using Eigen::Matrix2d;
using Eigen::VectorXd;
using ism::Points2;
using shapes::Rng;
using Sparse = Eigen::SparseMatrix<double>;
using Edges = std::set<std::pair<int, int>>;  // of vertices, smaller first

/// A matrix of zeros.
BlockMatrix pattern_of(int n, const Edges& edges) {
  BlockMatrix pattern;
  auto edge = edges.begin();  // ordered by first vertex, then second
  for (int r = 0; r < n; ++r) {
    pattern.start.push_back(pattern.column.size());
    pattern.column.push_back(r);
    for (; edge != edges.end() && edge->first == r; ++edge) pattern.column.push_back(edge->second);
  }
  pattern.start.push_back(pattern.column.size());
  pattern.value.resize(pattern.blocks());
  return pattern;
}

/// Couplings of a mesh's vertices: along edges, and also over two edges if `wide`.
Edges mesh_edges(const shapes::Disk& disk, bool wide) {
  std::vector<std::set<int>> near(static_cast<std::size_t>(disk.plane.rows()));
  for (int f = 0; f < disk.mesh.triangles.rows(); ++f)
    for (int k = 0; k < 9; ++k)
      near[static_cast<std::size_t>(disk.mesh.triangles(f, k / 3))].insert(
          disk.mesh.triangles(f, k % 3));
  Edges edges;
  for (std::size_t u = 0; u < near.size(); ++u)
    for (int v : near[u]) {
      const int i = static_cast<int>(u);
      if (v > i) edges.insert({i, v});
      if (!wide) continue;
      for (int w : near[static_cast<std::size_t>(v)])
        if (w > i) edges.insert({i, w});
    }
  return edges;
}

/// Every vertex of an n×n lattice coupled to all others at most `reach` away in x and y.
Edges lattice_edges(int n, int reach) {
  Edges edges;
  const auto near = [&](int i, int j) { return std::abs(i - j) <= reach; };
  for (int i = 0; i < n * n; ++i)
    for (int j = i + 1; j < n * n; ++j)
      if (near(i % n, j % n) && near(i / n, j / n)) edges.insert({i, j});
  return edges;
}

Points2 lattice_points(int n) {
  Points2 x(n * n, 2);
  for (int i = 0; i < n * n; ++i) x.row(i) << i % n, i / n;
  return x;
}

Points2 random_points(int n, Rng& rng) {
  Points2 x(n, 2);
  for (int i = 0; i < n; ++i) x.row(i) = rng.point(1).transpose();
  return x;
}

Edges random_edges(int n, int count, Rng& rng) {
  Edges edges;
  for (int k = 0; k < count; ++k) {
    const int i = rng.below(n), j = rng.below(n);
    if (i != j) edges.insert({std::min(i, j), std::max(i, j)});
  }
  return edges;
}

/// Random blocks; each diagonal entry exceeds the others of its row, with the sign of `sign(v)`.
template <class Sign>
BlockMatrix dominant_matrix(const BlockMatrix& pattern, Rng& rng, Sign sign) {
  BlockMatrix A = pattern;
  VectorXd row_sum = VectorXd::Zero(2 * A.rows());
  for (int r = 0; r < A.rows(); ++r)
    for (int b = A.start[r] + 1; b < A.start[r + 1]; ++b) {
      for (double& entry : A.value[b].entry) entry = rng.uniform(-1, 1);
      const Matrix2d magnitude = shapes::eigen(A.value[b]).cwiseAbs();
      row_sum.segment<2>(2 * r) += magnitude.rowwise().sum();
      row_sum.segment<2>(2 * A.column[b]) += magnitude.colwise().sum().transpose();
    }
  for (int r = 0; r < A.rows(); ++r) {
    Mat2& D = A.value[A.start[r]];
    D(0, 1) = D(1, 0) = rng.uniform(-0.5, 0.5);
    for (int c = 0; c < 2; ++c) D(c, c) = sign(r) * (row_sum(2 * r + c) + rng.uniform(0.6, 1.6));
  }
  return A;
}

BlockMatrix positive_matrix(const BlockMatrix& pattern, Rng& rng) {
  return dominant_matrix(pattern, rng, [](int) { return 1; });
}

BlockMatrix indefinite_matrix(const BlockMatrix& pattern, Rng& rng) {
  return dominant_matrix(pattern, rng, [&](int) { return rng.below(2) ? 1 : -1; });
}

/// Both triangles of H + ωQ as one of Eigen's sparse matrices.
Sparse assembled(const ShiftedMatrix& matrix) {
  const BlockMatrix& H = *matrix.H;
  std::vector<Eigen::Triplet<double>> entries;
  for (int r = 0; r < H.rows(); ++r)
    for (int b = H.start[r]; b < H.start[r + 1]; ++b) {
      const int c = H.column[b];
      const Mat2 block = matrix.block(b);
      for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j) {
          entries.emplace_back(2 * r + i, 2 * c + j, block(i, j));
          if (c != r) entries.emplace_back(2 * c + j, 2 * r + i, block(i, j));
        }
    }
  Sparse A(2 * H.rows(), 2 * H.rows());
  A.setFromTriplets(entries.begin(), entries.end());
  return A;
}

Executor executor(int threads) {
  ism::Options options;
  options.threads = threads;
  return Executor(options);
}

LdltSymbolic dissected(const BlockMatrix& pattern, const Points2& positions) {
  return NestedDissection(pattern, positions, executor(1)).build();
}

/// The factor of a matrix in an order that is known.
void factorize(const LdltSymbolic& symbolic, const ShiftedMatrix& matrix, const Executor& executor,
               LdltFactor& factor) {
  factor.data = std::make_shared<LdltData>();
  factor.data->symbolic = symbolic;
  ldlt_refactorize(matrix, executor, factor);
}

VectorXd solved(const LdltFactor& factor, const VectorXd& b) {
  return dense(ldlt_solve(factor, per_vertex(b)));
}

VectorXd random_vector(int n, Rng& rng) {
  VectorXd b(n);
  for (int i = 0; i < n; ++i) b(i) = rng.uniform(-1, 1);
  return b;
}

int eigen_negative_pivots(const Sparse& A) {
  const Eigen::SimplicialLDLT<Sparse> reference(A);
  REQUIRE(reference.info() == Eigen::Success);
  return static_cast<int>((reference.vectorD().array() < 0).count());
}

/// Factorises, solves, and compares residual and inertia with Eigen's LDLT.
void check_solve(const BlockMatrix& pattern, const Points2& positions,
                 const std::vector<ShiftedMatrix>& family) {
  Rng rng(99);
  const LdltSymbolic symbolic = dissected(pattern, positions);
  LdltFactor factor;
  for (const ShiftedMatrix& matrix : family) {
    factorize(symbolic, matrix, executor(1), factor);
    REQUIRE(factor.ok);
    const Sparse A = assembled(matrix);
    CHECK(factor.negative == eigen_negative_pivots(A));
    const VectorXd b = random_vector(2 * pattern.rows(), rng);
    const VectorXd x = solved(factor, b);
    CHECK((A * x - b).norm() <= 1e-12 * b.norm());
  }
}

/// Positive definite and indefinite values on one pattern.
void check_pattern(const BlockMatrix& pattern, const Points2& positions, std::uint64_t seed) {
  Rng rng(seed);
  const BlockMatrix positive = positive_matrix(pattern, rng);
  const BlockMatrix indefinite = indefinite_matrix(pattern, rng);
  check_solve(pattern, positions, {{&positive, nullptr, 0}});
  check_solve(pattern, positions, {{&indefinite, nullptr, 0}});
}

/// Counts violations of what the elimination needs: an order of all vertices, fronts that cut it
/// into consecutive ranges, children before parents, rows below the own vertices, and every
/// block of the pattern in exactly one front.
int symbolic_faults(const BlockMatrix& pattern, const LdltSymbolic& s) {
  const int n = pattern.rows();
  int faults = s.order.size() != n || s.place.size() != n;
  std::vector<int> sorted(s.order.begin(), s.order.end());
  std::sort(sorted.begin(), sorted.end());
  for (int i = 0; i < n; ++i) {
    faults += sorted[static_cast<std::size_t>(i)] != i;
    faults += s.place[s.order[i]] != i;
  }
  std::vector<int> uses(static_cast<std::size_t>(pattern.blocks()), 0);
  std::vector<int> parents(static_cast<std::size_t>(s.fronts.size()), -1);
  for (int k = 0; k < s.fronts.size(); ++k)
    for (int child : s.fronts[k].children) {
      faults += child >= k || parents[static_cast<std::size_t>(child)] >= 0;
      parents[static_cast<std::size_t>(child)] = k;
    }
  int covered = 0;
  for (int k = 0; k < s.fronts.size(); ++k) {
    const int parent = parents[static_cast<std::size_t>(k)];
    const Front& f = s.fronts[k];
    faults += f.begin != covered;
    covered = f.end;
    faults += parent < 0 && !f.rows.empty();
    for (int r = 0; r < f.rows.size(); ++r) {
      faults += f.rows[r] < f.end || (r > 0 && f.rows[r] <= f.rows[r - 1]);
      if (parent < 0) continue;
      const Front& up = s.fronts[parent];
      const int local = f.parent_row[r];
      const int row = local < up.own() ? up.begin + local : up.rows[local - up.own()];
      faults += row != f.rows[r];
    }
    for (const Front::OwnBlock& e : f.blocks) ++uses[static_cast<std::size_t>(e.block)];
  }
  faults += covered != n;
  for (int count : uses) faults += count != 1;
  return faults;
}

bool same_bits(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  const std::size_t bytes = sizeof(double) * static_cast<std::size_t>(a.size());
  return a.rows() == b.rows() && a.cols() == b.cols() &&
         (bytes == 0 || std::memcmp(a.data(), b.data(), bytes) == 0);
}

bool same_factor(const LdltFactor& a, const LdltFactor& b) {
  return std::equal(a.data->panel.begin(), a.data->panel.end(), b.data->panel.begin(), same_bits);
}

/// Runs tasks backwards: any order must give the same result.
void run_backwards(int n, const std::function<void(int)>& task) {
  for (int i = n - 1; i >= 0; --i) task(i);
}

}  // namespace

TEST_CASE("nested dissection orders all vertices and puts every block into one front") {
  Rng rng(1);
  for (const shapes::Disk& disk : shapes::all_disks())
    for (bool wide : {false, true}) {
      CAPTURE(disk.name);
      CAPTURE(wide);
      const int n = static_cast<int>(disk.plane.rows());
      const BlockMatrix pattern = pattern_of(n, mesh_edges(disk, wide));
      CHECK(symbolic_faults(pattern, dissected(pattern, disk.plane)) == 0);
      const Points2 elsewhere = random_points(n, rng);  // positions that say nothing
      CHECK(symbolic_faults(pattern, dissected(pattern, elsewhere)) == 0);
    }
}

TEST_CASE("nested dissection fills a lattice about as little as Eigen's minimum degree") {
  for (int n : {20, 50}) {
    const BlockMatrix pattern = pattern_of(n * n, lattice_edges(n, 1));
    const LdltSymbolic s = dissected(pattern, lattice_points(n));
    double filled = 0;
    for (const Front& f : s.fronts) filled += 2.0 * f.own() * (2 * f.rows.size() + f.own());
    Rng rng(2);
    const BlockMatrix A = positive_matrix(pattern, rng);
    const Eigen::SimplicialLDLT<Sparse> reference(assembled({&A, nullptr, 0}));
    const double expected = static_cast<double>(reference.matrixL().nestedExpression().nonZeros());
    CAPTURE(n);
    CHECK(filled < 1.25 * expected);
  }
}

TEST_CASE("the first separator of a lattice is about as short as one of its rows") {
  const int n = 50;
  const BlockMatrix pattern = pattern_of(n * n, lattice_edges(n, 1));
  for (double angle : {0.0, 0.3, 0.8}) {
    const Points2 x = lattice_points(n) * shapes::rotation(angle).transpose();
    CHECK(dissected(pattern, x).fronts.back().own() <= n + 2);
  }
}

TEST_CASE("a limb crowded into a spot is cut off by a circle") {
  // A strip is wound around a point where it shrinks to a part in 1e7; a square hangs at its wide
  // end. No line has a few vertices of the strip on either side and the square on one.
  const int across = 6, along = 300;
  Edges edges;
  Points2 x(across * along, 2);
  for (int i = 0; i < along; ++i)
    for (int k = 0; k < across; ++k) {
      const double radius = std::pow(0.95, i), angle = 2 * ism::detail::kPi * k / (across + 2);
      x.row(i * across + k) << radius * std::cos(angle), radius * std::sin(angle);
      if (k + 1 < across) edges.insert({i * across + k, i * across + k + 1});
      if (i + 1 < along) edges.insert({i * across + k, (i + 1) * across + k});
    }
  const LdltSymbolic s = dissected(pattern_of(across * along, edges), x);
  CHECK(s.fronts.back().own() == across);
}

TEST_CASE("the unit of the positions does not matter") {
  const int n = 50;
  const BlockMatrix pattern = pattern_of(n * n, lattice_edges(n, 1));
  const LdltSymbolic expected = dissected(pattern, lattice_points(n));
  for (double unit : {0x1p-160, 0x1p160}) {
    const LdltSymbolic s = dissected(pattern, unit * lattice_points(n));
    CHECK(std::equal(s.order.begin(), s.order.end(), expected.order.begin()));
  }
}

TEST_CASE("the order and the fronts are the same for any number of threads") {
  const int n = 50;
  const BlockMatrix pattern = pattern_of(n * n, lattice_edges(n, 2));
  const LdltSymbolic one = dissected(pattern, lattice_points(n));
  ism::Options backwards;
  backwards.parallel_for = run_backwards;
  for (const Executor& other : {executor(2), executor(4), Executor(backwards)}) {
    const LdltSymbolic s = NestedDissection(pattern, lattice_points(n), other).build();
    CHECK(std::equal(s.order.begin(), s.order.end(), one.order.begin()));
    REQUIRE(s.fronts.size() == one.fronts.size());
    for (int k = 0; k < s.fronts.size(); ++k) {
      CHECK(s.fronts[k].end == one.fronts[k].end);
      CHECK(s.fronts[k].blocks.size() == one.fronts[k].blocks.size());
    }
  }
}

TEST_CASE("systems on meshes are solved as well as by Eigen") {
  std::uint64_t seed = 3;
  for (const shapes::Disk& disk : shapes::all_disks())
    for (bool wide : {false, true}) {
      CAPTURE(disk.name);
      CAPTURE(wide);
      const int n = static_cast<int>(disk.plane.rows());
      check_pattern(pattern_of(n, mesh_edges(disk, wide)), disk.plane, ++seed);
    }
}

TEST_CASE("systems on lattices with wide stencils are solved") {
  for (int reach : {1, 2, 3}) {
    CAPTURE(reach);
    check_pattern(pattern_of(20 * 20, lattice_edges(20, reach)), lattice_points(20), 20);
  }
}

TEST_CASE("random patterns with meaningless positions are solved") {
  Rng rng(4);
  for (int i = 0; i < 30; ++i) {
    const int n = rng.between(2, 120);
    const BlockMatrix pattern = pattern_of(n, random_edges(n, rng.between(0, 3 * n), rng));
    const Points2 positions = random_points(n, rng);
    CHECK(symbolic_faults(pattern, dissected(pattern, positions)) == 0);
    check_pattern(pattern, positions, 5);
  }
}

TEST_CASE("patterns of several components are solved") {
  Edges edges = lattice_edges(12, 1);
  for (const auto& edge : lattice_edges(12, 1)) edges.insert({edge.first + 144, edge.second + 144});
  Points2 positions(288, 2);
  positions << lattice_points(12), lattice_points(12);
  SUBCASE("on top of each other") {}
  SUBCASE("side by side") { positions.bottomRows<144>().array() += 100; }
  SUBCASE("with loose vertices") { edges.erase(edges.begin(), edges.lower_bound({60, 0})); }
  SUBCASE("diagonal") { edges.clear(); }
  const BlockMatrix pattern = pattern_of(288, edges);
  CHECK(symbolic_faults(pattern, dissected(pattern, positions)) == 0);
  check_pattern(pattern, positions, 6);
}

TEST_CASE("one vertex and a few vertices are solved") {
  Rng rng(7);
  for (int n = 1; n <= 30; ++n) {
    CAPTURE(n);
    Edges complete;
    for (int i = 0; i < n; ++i)
      for (int j = i + 1; j < n; ++j) complete.insert({i, j});
    const Points2 positions = random_points(n, rng);
    check_pattern(pattern_of(n, complete), positions, 8);
    check_pattern(pattern_of(n, {}), positions, 9);
  }
}

TEST_CASE("equal positions do no harm") {
  const Edges edges = lattice_edges(15, 1);
  const BlockMatrix pattern = pattern_of(225, edges);
  Points2 positions = Points2::Constant(225, 2, 0.25);
  SUBCASE("all in one place") {}
  SUBCASE("on a line") { positions.col(0) = lattice_points(15).col(0); }
  SUBCASE("in a few places") { positions = (lattice_points(15) / 5).array().floor(); }
  CHECK(symbolic_faults(pattern, dissected(pattern, positions)) == 0);
  check_pattern(pattern, positions, 10);
}

TEST_CASE("several shifted matrices are factorised side by side") {
  Rng rng(11);
  const BlockMatrix pattern = pattern_of(225, lattice_edges(15, 2));
  const BlockMatrix H = indefinite_matrix(pattern, rng), Q = positive_matrix(pattern, rng);
  const BlockMatrix other = positive_matrix(pattern, rng);
  check_solve(pattern, lattice_points(15),
              {{&H, &Q, 0}, {&H, &Q, 100}, {&H, nullptr, 7}, {&other, &Q, 1e6}, {&H, &Q, -100}});
}

TEST_CASE("the inertia is that of the eigenvalues") {
  Rng rng(12);
  const BlockMatrix pattern = pattern_of(49, lattice_edges(7, 1));
  for (int i = 0; i < 10; ++i) {
    const BlockMatrix A = indefinite_matrix(pattern, rng);
    const ShiftedMatrix matrix = {&A, nullptr, 0};
    const LdltSymbolic symbolic = dissected(pattern, lattice_points(7));
    LdltFactor factor;
    factorize(symbolic, matrix, executor(1), factor);
    const Eigen::MatrixXd dense = assembled(matrix);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(dense);
    CHECK(factor.ok);
    CHECK(factor.negative == (eigen.eigenvalues().array() < 0).count());
    CHECK(factor.negative > 0);
  }
}

TEST_CASE("a zero or non-finite pivot is reported, and leaves no trace in the memory") {
  Rng rng(13);
  const BlockMatrix pattern = pattern_of(144, lattice_edges(12, 1));
  const LdltSymbolic symbolic = dissected(pattern, lattice_points(12));
  const BlockMatrix good = positive_matrix(pattern, rng);
  for (int v : {0, 5, 77, 143})
    for (double bad :
         {0.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      CAPTURE(v);
      CAPTURE(bad);
      BlockMatrix broken = good;
      if (bad == 0) {  // a vertex without any stiffness
        for (int r = 0; r < 144; ++r)
          for (int b = pattern.start[r]; b < pattern.start[r + 1]; ++b)
            if (r == v || pattern.column[b] == v) broken.value[b] = {};
      } else {
        broken.value[pattern.start[v]](1, 1) = bad;
      }
      LdltFactor factor;
      for (const bool is_good : {true, false, true}) {
        factorize(symbolic, {is_good ? &good : &broken, nullptr, 0}, executor(1), factor);
        CHECK(factor.ok == is_good);
      }
    }
}

TEST_CASE("a singular matrix whose last pivot cancels exactly is reported") {
  // The graph Laplacian of a path has rows that add up to 0; all pivots are exact in binary.
  BlockMatrix A = pattern_of(2, {{0, 1}});
  for (int b : {0, 1, 2}) A.value[b] = diagonal(b == 1 ? -1 : 1);
  const LdltSymbolic symbolic = dissected(A, lattice_points(2).topRows(2));
  LdltFactor factor;
  factorize(symbolic, {&A, nullptr, 0}, executor(1), factor);
  CHECK(!factor.ok);
  A.value[2] = diagonal(2);
  factorize(symbolic, {&A, nullptr, 0}, executor(1), factor);
  CHECK(factor.ok);  // the same memory, and nothing left of the failure
  CHECK(factor.negative == 0);
}

TEST_CASE("products by tiles are those of Eigen, for any sizes and strides") {
  Rng rng(16);
  for (int rows : {1, 5, 24, 61, 200, 390})
    for (int columns : {1, 3, 8, 64, 200})
      for (int depth : {1, 2, 17, 96, 200}) {
        if (columns > rows) continue;
        CAPTURE(rows);
        CAPTURE(columns);
        CAPTURE(depth);
        const int gap = 3;
        const auto random = [&](int n, int m) {
          return Eigen::MatrixXd(
              Eigen::MatrixXd::NullaryExpr(n, m, [&] { return rng.uniform(-1, 1); }));
        };
        Eigen::MatrixXd L = random(rows + gap, depth), D = random(depth, depth);
        const Eigen::MatrixXd before = random(rows + gap, columns);
        Eigen::MatrixXd C = before;
        subtract_product({L.data(), rows, depth, rows + gap}, {D.data(), depth, depth, depth},
                         {C.data(), rows, columns, rows + gap});
        Eigen::MatrixXd error =
            before.topRows(rows) - C.topRows(rows) -
            L.topRows(rows) * D.diagonal().asDiagonal() * L.topRows(columns).transpose();
        for (int j = 0; j < columns; ++j) error.col(j).head(j).setZero();  // above the diagonal
        CHECK(error.cwiseAbs().maxCoeff() < 1e-14 * (depth + 1));
        CHECK(C.bottomRows(gap) == before.bottomRows(gap));
      }
}

TEST_CASE("a factor that is used again holds nothing of the last one, and no update matrices") {
  Rng rng(15);
  const BlockMatrix pattern = pattern_of(225, lattice_edges(15, 1));
  const LdltSymbolic symbolic = dissected(pattern, lattice_points(15));
  const BlockMatrix first = indefinite_matrix(pattern, rng), second = positive_matrix(pattern, rng);
  LdltFactor factor, fresh;
  factorize(symbolic, {&first, nullptr, 0}, executor(1), factor);
  CHECK(factor.negative > 0);
  factorize(symbolic, {&second, nullptr, 0}, executor(1), factor);
  factorize(symbolic, {&second, nullptr, 0}, executor(1), fresh);
  CHECK(factor.negative == 0);
  CHECK(same_factor(factor, fresh));
  for (const Eigen::MatrixXd& update : factor.data->update) CHECK(update.size() == 0);
}

TEST_CASE("factors and solutions are the same bits for any number of threads") {
  Rng rng(14);
  const int n = 40;
  const BlockMatrix pattern = pattern_of(n * n, lattice_edges(n, 2));
  const LdltSymbolic symbolic = dissected(pattern, lattice_points(n));
  const BlockMatrix H = indefinite_matrix(pattern, rng), Q = positive_matrix(pattern, rng);
  const VectorXd b = random_vector(2 * n * n, rng);
  LdltFactor one;
  factorize(symbolic, {&H, &Q, 0.5}, executor(1), one);
  ism::Options backwards;
  backwards.parallel_for = run_backwards;
  for (const Executor& other : {executor(2), executor(4), Executor(backwards)}) {
    LdltFactor factor;
    factorize(symbolic, {&H, &Q, 0.5}, other, factor);
    CHECK(same_factor(one, factor));
    CHECK(factor.negative == one.negative);
    CHECK(same_bits(solved(one, b), solved(factor, b)));
  }
}

}  // namespace ldlt_tests

#endif  // ISM_TESTS_PART_LDLT_HPP

// The objective, its quadratic model, the line search's bounds and the loop of Algorithm 1.

#ifndef ISM_TESTS_PART_OPTIMIZER_HPP
#define ISM_TESTS_PART_OPTIMIZER_HPP

#include "dense.hpp"
#include "elements.hpp"
#include "ism.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#ifdef __linux__
#include <sched.h>
#endif

namespace optimizer_tests {
namespace {

using namespace ism::detail;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using ism::IterationLog;
using ism::Landmark;
using ism::Options;
using ism::Points2;
using ism::Progress;
using ism::Result;
using ism::Status;
using ism::TriangleMesh;
using runs::given_planes;
using runs::on_one_thread;
using shapes::Disk;
using shapes::eigen;
using shapes::half_edges;
using shapes::Ids;
using shapes::joined;
using shapes::of_a;
using shapes::of_b;
using shapes::Rng;
using shapes::to_mat2;
using shapes::to_vec2;

// ---- pairs and the objective ----

Iterate evaluated(const JointSurface& s, const Weights& weights, const Points2& x) {
  Iterate at;
  at.x = x;
  evaluate(s, weights, at);
  return at;
}

const ism::DistortionMeasure kDirichlet = ism::symmetric_dirichlet();

double map_energy(const Disk& a, const Disk& b) {
  return evaluated(joined(a.mesh, b.mesh), Weights{2, 1e-8, 1e-3, &kDirichlet},
                   stacked(a.plane, b.plane))
      .map_energy;
}

/// Two bent random disks that overlap in general position.
std::pair<Disk, Disk> random_pair(std::uint64_t seed, int nx = 4, int ny = 4) {
  Rng rng(seed);
  Disk a = shapes::random_disk(nx, ny, rng), b = shapes::random_disk(nx + 1, ny, rng);
  shapes::bend(a, 0.5);
  shapes::bend(b, -0.3);
  b.plane = shapes::moved(b.plane, shapes::rotation(0.4), Vector2d(0.53, -0.71));
  return {a, b};
}

/// An iterate of a pair and its quadratic model, with what either refers to.
struct Modelled {
  JointSurface s;
  Weights weights;
  Executor executor{Options()};
  BlockMatrix laplacian;  // empty without a preconditioner
  Iterate x;
  QuadraticModel model;

  Modelled(const Disk& a, const Disk& b, const Weights& w, bool precondition = false)
      : s(joined(a.mesh, b.mesh)),
        weights(w),
        x(evaluated(s, weights, stacked(a.plane, b.plane))),
        model(model_at(x)) {
    if (precondition) laplacian = squared_laplacian(s, executor);
  }

  QuadraticModel model_at(const Iterate& at) const {
    ModelBuilder builder(s, weights, executor);
    builder.differentiate_elements(at);
    return builder.assemble();
  }

  LinearSystem system(const std::vector<QuadraticModel>& history, double decay = 1,
                      const BlockMatrix& others = {}) const {
    Array<QuadraticModel> models;
    for (const QuadraticModel& m : history) models.push_back(m);
    return blend(models, decay, others, laplacian, executor);
  }
};

void add_element(const std::vector<int>& rows, const MatrixXd& element, MatrixXd& H) {
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t j = 0; j < rows.size(); ++j)
      H.block<2, 2>(2 * rows[i], 2 * rows[j]) +=
          element.block<2, 2>(2 * static_cast<int>(i), 2 * static_cast<int>(j));
}

/// The projected Hessian, summed into a dense matrix element by element.
MatrixXd dense_reference(const Modelled& m) {
  const HalfEdgeMesh& mesh = m.s.mesh;
  MatrixXd H = MatrixXd::Zero(2 * mesh.n_vertices, 2 * mesh.n_vertices);
  for (int f = 0; f < mesh.n_faces; ++f) {
    elements::TriangleDerivatives d =
        elements::triangle_derivatives(m.x.jacobian[f], m.s.rest_inverse[f], m.s.area[f]);
    elements::project_spd<3>(d.hessian, m.weights.epsilon);
    std::vector<int> rows;
    for (int k = 0; k < 3; ++k) rows.push_back(mesh.corner(f, k));
    add_element(rows, m.weights.barrier * d.hessian, H);
  }
  for (const OverlayPolygon& p : m.x.overlay.polygons) {
    const SixPoints points = six_points(mesh, m.x.x, p);
    if (is_negligible(polygon_area(polygon_shape(p, points), points), points)) continue;
    elements::PolygonDerivatives d = elements::polygon_derivatives(
        p, points, m.s.rest_inverse[p.ta], m.s.rest_inverse[p.tb], kDirichlet, m.weights.kappa);
    elements::project_spd<6>(d.hessian, m.weights.epsilon);
    std::vector<int> rows;
    for (int f : {p.ta, p.tb})
      for (int k = 0; k < 3; ++k) rows.push_back(mesh.corner(f, k));
    add_element(rows, d.hessian, H);
  }
  return H;
}

/// Central differences of E by every unknown.
VectorXd difference_gradient(const Modelled& m, double h) {
  VectorXd gradient(m.x.x.size());
  for (int i = 0; i < gradient.size(); ++i) {
    double e[2];
    for (int side = 0; side < 2; ++side) {
      Points2 x = m.x.x;
      x(i / 2, i % 2) += side == 0 ? -h : h;
      e[side] = evaluated(m.s, m.weights, x).energy;
    }
    gradient[i] = (e[1] - e[0]) / (2 * h);
  }
  return gradient;
}

// ---- outcomes ----

void check_injective(const Disk& a, const Disk& b, const Result& result) {
  CHECK(is_injective(half_edges(a.mesh), result.f));
  CHECK(is_injective(half_edges(b.mesh), result.g));
}

void check_energy_never_grows(const Result& result) {
  double before = result.initial.energy;
  for (const IterationLog& log : result.log) {
    CAPTURE(log.iteration);
    CHECK(log.energy <= before);
    before = log.energy;
  }
}

void check_same_bits(const Result& r, const Result& s) {
  CHECK(r.status == s.status);
  CHECK(r.f == s.f);
  CHECK(r.g == s.g);
  CHECK(r.start.f == s.start.f);
  CHECK(r.start.g == s.start.g);
  REQUIRE(r.log.size() == s.log.size());
  for (std::size_t i = 0; i < r.log.size(); ++i) {
    CHECK(r.log[i].energy == s.log[i].energy);
    CHECK(r.log[i].step == s.log[i].step);
    CHECK(r.log[i].omega == s.log[i].omega);
    CHECK(r.log[i].polygons == s.log[i].polygons);
  }
}

void check_refused(const Result& result, Status status, const std::string& what) {
  CAPTURE(what);
  CAPTURE(result.message);
  CHECK(result.status == status);
  CHECK_FALSE(ism::is_usable(result.status));
  CHECK(result.message.find(what) != std::string::npos);
  CHECK(result.log.empty());
}

/// The same surface and embedding with other numbers for vertices and faces, and with other first
/// corners.
Disk renumbered(const Disk& disk, Rng& rng) {
  const auto shuffled = [&](int n) {
    std::vector<int> order(static_cast<std::size_t>(n));
    std::iota(order.begin(), order.end(), 0);
    for (int i = n - 1; i > 0; --i)
      std::swap(order[static_cast<std::size_t>(i)], order[static_cast<std::size_t>(rng.below(i))]);
    return order;
  };
  Disk result = disk;
  const std::vector<int> vertex = shuffled(static_cast<int>(disk.plane.rows()));
  const std::vector<int> face = shuffled(static_cast<int>(disk.mesh.triangles.rows()));
  for (int v = 0; v < disk.plane.rows(); ++v) {
    result.plane.row(vertex[static_cast<std::size_t>(v)]) = disk.plane.row(v);
    result.mesh.vertices.row(vertex[static_cast<std::size_t>(v)]) = disk.mesh.vertices.row(v);
  }
  for (int f = 0; f < disk.mesh.triangles.rows(); ++f) {
    const int turn = rng.below(3);
    for (int k = 0; k < 3; ++k)
      result.mesh.triangles(face[static_cast<std::size_t>(f)], (k + turn) % 3) =
          vertex[static_cast<std::size_t>(disk.mesh.triangles(f, k))];
  }
  return result;
}

TriangleMesh moved_in_space(const TriangleMesh& mesh, double scale, double angle,
                            const Vector3d& axis, const Vector3d& shift) {
  TriangleMesh result = mesh;
  const Eigen::Matrix3d R = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
  result.vertices = (scale * mesh.vertices * R.transpose()).rowwise() + shift.transpose();
  return result;
}

}  // namespace

// ---- the identity ----

TEST_CASE("the identity has no energy but the barrier, and no forces, in any embedding") {
  for (const Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    const Modelled m(disk, disk, {2, 1e-20, 1e-3, &kDirichlet});
    CHECK(std::abs(m.x.map_energy - 2 * (m.x.area_a + m.x.area_b)) < 1e-10);
    const double barrier = m.weights.barrier * (m.x.energy_f + m.x.energy_g);
    CHECK(std::abs(m.x.energy - barrier) < 1e-10);
    CHECK(m.x.area_a == doctest::Approx(m.s.area_a).epsilon(1e-11));
    CHECK(dense(m.model.gradient).cwiseAbs().maxCoeff() < 1e-9);
    CHECK(dense(m.model.H).allFinite());
  }
}

TEST_CASE("two triangles on themselves have converged, though slopes of E jump there") {
  const Disk square = shapes::grid(1, 1);
  for (const Options& options : {runs::on_one_thread(), given_planes(square, square)}) {
    const Result result = ism::compute_map(square.mesh, square.mesh, {}, options);
    CHECK(result.status == Status::kConverged);
    CHECK(result.final_state().mean_distortion == doctest::Approx(2).epsilon(1e-9));
    CHECK(result.final_state().coverage_a == doctest::Approx(1).epsilon(1e-9));
  }
}

TEST_CASE("so have two triangles of any shape, however their numbers are rounded") {
  for (double width : {0.01, 0.1, 0.5, 1.0, 2.0, 3.0, 7.0})
    for (int k = 0; k < 12; ++k) {
      CAPTURE(width);
      CAPTURE(k);
      TriangleMesh mesh = shapes::grid(1, 1).mesh;
      mesh.vertices.col(0) *= width;
      mesh = moved_in_space(mesh, 1, 0.1 * k, Vector3d::UnitZ(), Vector3d::Zero());
      const Result result = ism::compute_map(mesh, mesh, {}, runs::on_one_thread());
      CHECK(result.status == Status::kConverged);
      CHECK(result.final_state().mean_distortion == doctest::Approx(2).epsilon(1e-9));
    }
}

TEST_CASE("a run from the identity ends at once with nothing changed") {
  for (Disk disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    disk.mesh.vertices.setZero();
    disk.mesh.vertices.leftCols<2>() = disk.plane;
    Options options = given_planes(disk, disk);
    const Result result = ism::compute_map(disk.mesh, disk.mesh, {}, options);
    CHECK(result.status == Status::kConverged);
    CHECK(static_cast<int>(result.log.size()) <= Tuning().window);
    const IterationLog& end = result.final_state();
    CHECK(result.initial.mean_distortion == doctest::Approx(2).epsilon(1e-10));
    CHECK(end.mean_distortion == doctest::Approx(2).epsilon(1e-10));
    CHECK(end.coverage_a == doctest::Approx(1).epsilon(1e-9));
    CHECK(end.coverage_b == doctest::Approx(1).epsilon(1e-9));
    check_energy_never_grows(result);
    check_injective(disk, disk, result);
  }
}

TEST_CASE("a run does not end as long as the preconditioner holds it back") {
  shapes::Rng rng(3);
  Disk a = shapes::grid(20, 20), b = shapes::grid(21, 21);
  for (Disk* disk : {&a, &b}) {
    const double n = disk == &a ? 20 : 21;
    disk->mesh.vertices /= n;
    disk->plane /= n;
    for (int v = 0; v < disk->plane.rows(); ++v)
      for (int k = 0; k < 2 && (disk->plane.row(v).array() - 0.5).abs().maxCoeff() < 0.499; ++k)
        disk->plane(v, k) += rng.uniform(-0.01, 0.01) / n;
  }
  Options options = runs::on_one_thread(Options::paper());
  options.boundary = ism::Boundary::kFixed;
  options.initial_f = a.plane;
  options.initial_g = b.plane;
  const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
  CHECK(result.initial.energy > 4.001);
  CHECK(result.status == Status::kConverged);
  CHECK(result.final_state().energy < 4.00001);
}

TEST_CASE("options of a run hold on coarse levels and after a change") {
  const Disk disk = shapes::grid(4, 4);
  Options options = given_planes(disk, disk);
  RunOptions run(options);
  run.tuning.omega_least = 1;
  const Executor executor(options);
  const SurfacePair pair = {build_surface(disk.mesh, false), build_surface(disk.mesh, false)};
  const JointSurface s = join(pair);
  const Array<Follower> none;
  Optimizer optimizer(s, run, none, executor);
  Result result;
  optimizer.start(stacked(disk.plane, disk.plane), result);
  optimizer.lower_omega(1e-3);
  CHECK(optimizer.omega() == 1);
}

// ---- gradient, Hessian, systems ----

TEST_CASE("the gradient of the whole objective agrees with differences") {
  for (const Weights& weights : {Weights{2, 1e-8, 1e-3, &kDirichlet},
                                 Weights{0, 0.1, 1e-3, &kDirichlet}, Weights{3, 1, 1, &kDirichlet}})
    for (std::uint64_t seed : {1u, 2u}) {
      CAPTURE(seed);
      CAPTURE(weights.kappa);
      const auto [a, b] = random_pair(seed, 3, 3);
      const Modelled m(a, b, weights);
      const VectorXd expected = difference_gradient(m, 1e-6);
      CHECK(expected.norm() > 0.1);
      CHECK((dense(m.model.gradient) - expected).norm() < 1e-6 * expected.norm());
    }
}

TEST_CASE("an evaluation gives up only where the energy exceeds the limit") {
  const auto [a, b] = random_pair(6);
  const JointSurface s = joined(a.mesh, b.mesh);
  const Weights weights = {2.2, 1e-2, 1e-3, &kDirichlet};
  Iterate x = evaluated(s, weights, stacked(a.plane, b.plane));
  const double energy = x.energy;
  const auto energy_within = [&](double limit) {
    evaluate(s, weights, x, limit);
    return x.energy;
  };
  CHECK(energy_within(energy + 1e-12) == energy);
  CHECK(energy_within(energy + 1) == energy);
  // The limit at which to give up leaves room for the energy of all area that is not covered.
  const double room = weights.kappa * (s.total_area - x.area_a - x.area_b);
  REQUIRE(room > 0);
  CHECK(energy_within(energy - room + 1e-9) == energy);
  CHECK(energy_within(energy - room - 1e-9) == std::numeric_limits<double>::infinity());
  CHECK(energy_within(-1e9) == std::numeric_limits<double>::infinity());
  CHECK(energy_within(energy) == energy);  // what was given up leaves no trace
}

TEST_CASE("the assembled Hessian is the sum of its elements, symmetric and definite") {
  for (std::uint64_t seed : {3u, 4u}) {
    const auto [a, b] = random_pair(seed);
    const Modelled m(a, b, {2, 1e-2, 1e-3, &kDirichlet});
    const LinearSystem system = m.system({m.model});
    const MatrixXd H = dense(system.H), expected = dense_reference(m);
    CHECK((H - expected).cwiseAbs().maxCoeff() < 1e-12 * expected.cwiseAbs().maxCoeff());
    CHECK((H - H.transpose()).cwiseAbs().maxCoeff() < 1e-12 * expected.cwiseAbs().maxCoeff());
    CHECK(Eigen::SelfAdjointEigenSolver<MatrixXd>(H).eigenvalues().minCoeff() > 0);
    const VectorXd gradient = dense(system.gradient);
    CHECK(gradient == dense(m.model.gradient));
    LdltFactor factor;
    ldlt_factorize(system.shifted(0), m.x.x, m.executor, factor);
    CHECK(factor.ok);
    CHECK(factor.negative == 0);
    const VectorXd d = dense(ldlt_solve(factor, negated(system.gradient)));
    CHECK((H * d + gradient).norm() < 1e-8 * gradient.norm());
    CHECK(gradient.dot(d) < 0);
  }
}

TEST_CASE("sums of blocks and weighted sums of matrices are those of dense matrices") {
  Rng rng(32);
  const Executor executor{Options()};
  for (int n : {1, 10, 200}) {
    CAPTURE(n);
    std::vector<std::pair<int, int>> places;
    const auto random_sum = [&](MatrixXd& expected) {
      Array<Block> blocks;
      expected.setZero(2 * n, 2 * n);
      for (int i = 0; i < 4 * n; ++i) {
        const int c = rng.below(n), r = rng.below(c + 1);
        MatrixXd M = MatrixXd::NullaryExpr(2, 2, [&](Eigen::Index) { return rng.uniform(-1, 1); });
        if (r == c) M += MatrixXd(M.transpose());
        expected.block<2, 2>(2 * r, 2 * c) += M;
        if (r != c) expected.block<2, 2>(2 * c, 2 * r) += M.transpose();
        blocks.push_back({r, c, to_mat2(M)});
        places.push_back({r, c});
      }
      return sum_of_blocks(n, blocks, executor);
    };
    MatrixXd dense_A, dense_B;
    const BlockMatrix A = random_sum(dense_A), B = random_sum(dense_B);
    CHECK((dense(A) - dense_A).norm() < 1e-14 * dense_A.norm());
    Array<Term> terms(1, Term{&A, 0.7});
    terms.push_back({&B, -1.3});
    const BlockMatrix sum = weighted_sum(terms, executor);
    const MatrixXd expected = 0.7 * dense_A - 1.3 * dense_B;
    CHECK((dense(sum) - expected).norm() < 1e-14 * expected.norm());
    std::sort(places.begin(), places.end());
    places.erase(std::unique(places.begin(), places.end()), places.end());
    std::vector<std::pair<int, int>> found;
    for (int r = 0; r < sum.rows(); ++r)
      for (int b = sum.start[r]; b < sum.start[r + 1]; ++b) found.push_back({r, sum.column[b]});
    CHECK(found == places);  // every block once, columns in order
  }
}

TEST_CASE("a blended system is the weighted mean of models with different couplings") {
  const auto [a, b] = random_pair(5);
  for (bool precondition : {false, true}) {
    const Modelled m(a, b, {2, 1e-2, 1e-3, &kDirichlet}, precondition);
    const Points2 g = shapes::moved(b.plane, shapes::rotation(0.3), Vector2d(-0.6, 0.4));
    const QuadraticModel old = m.model_at(evaluated(m.s, m.weights, stacked(a.plane, g)));
    const LinearSystem system = m.system({m.model, old}, 0.5);
    const MatrixXd H0 = dense(m.model.H), H1 = dense(old.H);
    const MatrixXd expected = (H0 + 0.5 * H1) / 1.5;
    CHECK((H0 - H1).norm() > 0.1 * H0.norm());
    CHECK((dense(system.H) - expected).norm() < 1e-13 * expected.norm());
    const VectorXd gradient = (dense(m.model.gradient) + 0.5 * dense(old.gradient)) / 1.5;
    CHECK((dense(system.gradient) - gradient).norm() < 1e-13 * gradient.norm());
    CHECK(system.has_Q() == precondition);
    if (precondition) CHECK(dense(system.Q) == dense(m.laplacian));
    const BlockMatrix others = squared_laplacian(m.s, m.executor);
    const MatrixXd sum = expected + dense(others);
    CHECK((dense(m.system({m.model, old}, 0.5, others).H) - sum).norm() < 1e-13 * sum.norm());
  }
}

TEST_CASE("the squared Laplacian is semidefinite and does not see translations") {
  const auto [a, b] = random_pair(6);
  const Modelled m(a, b, {2, 1e-8, 1e-3, &kDirichlet}, true);
  const MatrixXd Q = dense(m.system({m.model}).Q);
  VectorXd along_x = VectorXd::Zero(Q.rows());
  for (int v = 0; v < m.s.n_a; ++v) along_x[2 * v] = 1;
  CHECK((Q * along_x).norm() < 1e-12 * Q.norm());
  const VectorXd eigenvalues = Eigen::SelfAdjointEigenSolver<MatrixXd>(Q).eigenvalues();
  CHECK(eigenvalues.minCoeff() > -1e-12 * eigenvalues.maxCoeff());
  const MatrixXd coupling = Q.topRightCorner(2 * m.s.n_a, Q.cols() - 2 * m.s.n_a);
  CHECK(coupling.cwiseAbs().maxCoeff() == 0);
}

TEST_CASE("eliminated unknowns get unit rows and columns and no force") {
  const auto [a, b] = random_pair(7);
  const Modelled m(a, b, {2, 1e-2, 1e-3, &kDirichlet}, true);
  LinearSystem system = m.system({m.model});
  const MatrixXd H = dense(system.H), Q = dense(system.Q);
  const int v = m.s.n_a + 3, w = 2;
  const int removed[] = {2 * v, 2 * v + 1, 2 * w + 1};
  FixedCoordinates is_fixed(m.s.mesh.n_vertices);
  for (int i : removed) is_fixed(i / 2, i % 2) = 1;
  reduce({}, is_fixed, Executor(Options()), system);
  MatrixXd expected_H = H, expected_Q = Q;
  for (int i : removed) {
    expected_H.row(i).setZero(), expected_H.col(i).setZero();
    expected_Q.row(i).setZero(), expected_Q.col(i).setZero();
    expected_H(i, i) = 1;
    CHECK(dense(system.gradient)[i] == 0);
  }
  CHECK(dense(system.H) == expected_H);
  CHECK(dense(system.Q) == expected_Q);
  CHECK(system.gradient[w].x == m.model.gradient[w].x);
}

TEST_CASE("the step bound is where the first triangle degenerates") {
  Rng rng(8);
  int bounded = 0;
  for (int i = 0; i < 300; ++i) {
    const Vec2 u = to_vec2(rng.point(1)), v = to_vec2(rng.point(1));
    const Vec2 du = to_vec2(rng.point(2)), dv = to_vec2(rng.point(2));
    if (cross(u, v) <= 0.01) continue;
    const double s = triangle_max_step(u, v, du, dv);
    const auto area = [&](double t) { return cross(u + t * du, v + t * dv); };
    const double end = std::isinf(s) ? 100 : s;
    for (int k = 0; k < 100; ++k) CHECK(area(end * k / 100) > 0);
    if (std::isinf(s)) continue;
    ++bounded;
    CHECK(std::abs(area(s)) < 1e-10 * (1 + norm(u + s * du) * norm(v + s * dv)));
  }
  CHECK(bounded > 20);
}

TEST_CASE("the step bound of a positive sliver is positive, whatever rounding makes of its area") {
  Rng rng(9);
  int rounded_away = 0;
  for (int i = 0; i < 200000; ++i) {
    const double t = rng.uniform(0.3, 3);
    const Vec2 p = to_vec2(rng.point(1)), u = to_vec2(rng.point(1)), near = p + t * u;
    const Vec2 corner[3] = {p, p + u, {near.x + 1e-16 * rng.between(-2, 2), near.y}};
    if (!(ism::detail::orient2d(corner[0], corner[1], corner[2]) > 0)) continue;
    const Vec2 a = corner[1] - corner[0], b = corner[2] - corner[0];
    rounded_away += !(cross(a, b) > 0);
    if (!(triangle_max_step(a, b, to_vec2(rng.point(1)), to_vec2(rng.point(1))) > 0))
      FAIL("no step from a positive triangle");
  }
  CHECK(rounded_away > 20);
}

// ---- invariance ----

TEST_CASE("moving both planes by one affine map leaves the map energy unchanged") {
  for (std::uint64_t seed : {10u, 11u, 12u}) {
    const auto [a, b] = random_pair(seed);
    const double expected = map_energy(a, b);
    Rng rng(seed);
    for (int i = 0; i < 5; ++i) {
      Eigen::Matrix2d M;
      M << rng.uniform(0.5, 3), rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(0.6, 2);
      Disk a2 = a, b2 = b;
      const Vector2d shift = rng.point(5);
      a2.plane = shapes::moved(a.plane, M, shift);
      b2.plane = shapes::moved(b.plane, M, shift);
      CHECK(map_energy(a2, b2) == doctest::Approx(expected).epsilon(1e-9));
    }
  }
}

TEST_CASE("new numbers for vertices and faces leave the map energy unchanged") {
  Rng rng(13);
  for (std::uint64_t seed : {13u, 14u, 15u}) {
    const auto [a, b] = random_pair(seed);
    const double expected = map_energy(a, b);
    const double again = map_energy(renumbered(a, rng), renumbered(b, rng));
    CHECK(again == doctest::Approx(expected).epsilon(1e-11));
  }
  const Disk grid = shapes::grid(5, 4);
  const double expected = 4 * 20;  // an isometry of both
  CHECK(map_energy(grid, renumbered(grid, rng)) == doctest::Approx(expected).epsilon(1e-11));
}

TEST_CASE("exchanging the meshes leaves the map energy and, nearly, the outcome unchanged") {
  for (std::uint64_t seed : {16u, 17u}) {
    const auto [a, b] = random_pair(seed);
    CHECK(map_energy(b, a) == doctest::Approx(map_energy(a, b)).epsilon(1e-10));
    Options forth = given_planes(a, b), back = given_planes(b, a);
    forth.coverage_weight = back.coverage_weight = 2;
    const Result ab = ism::compute_map(a.mesh, b.mesh, {}, forth);
    const Result ba = ism::compute_map(b.mesh, a.mesh, {}, back);
    REQUIRE(ism::is_usable(ab.status));
    REQUIRE(ism::is_usable(ba.status));
    CHECK(ba.final_state().mean_distortion ==
          doctest::Approx(ab.final_state().mean_distortion).epsilon(0.01));
    CHECK(ba.final_state().coverage_b ==
          doctest::Approx(ab.final_state().coverage_a).epsilon(0.01));
  }
}

TEST_CASE("where the meshes lie in space and their unit do not matter") {
  const auto [a, b] = random_pair(18);
  const std::vector<Landmark> landmarks = {{0, 0}, {4, 5}, {24, 29}};
  Options options = on_one_thread();
  options.candidates = false;  // rounding may decide between starts that are equally good
  const Result expected = ism::compute_map(a.mesh, b.mesh, landmarks, options);
  REQUIRE(ism::is_usable(expected.status));
  const TriangleMesh a2 = moved_in_space(a.mesh, 1, 0.7, Vector3d(1, 2, 3), Vector3d(4, -3, 2));
  const TriangleMesh b2 = moved_in_space(b.mesh, 1, 2.1, Vector3d(-1, 1, 0.4), Vector3d(0, 7, -1));
  const TriangleMesh a3 = moved_in_space(a.mesh, 25.4, 0, Vector3d(1, 0, 0), Vector3d::Zero());
  for (const Result& result : {ism::compute_map(a2, b2, landmarks, options),
                               ism::compute_map(a3, b.mesh, landmarks, options)}) {
    CHECK(result.status == expected.status);
    CHECK(result.initial.mean_distortion ==
          doctest::Approx(expected.initial.mean_distortion).epsilon(1e-6));
    CHECK(result.final_state().mean_distortion ==
          doctest::Approx(expected.final_state().mean_distortion).epsilon(1e-6));
  }
}

// ---- the loop ----

TEST_CASE("results are the same bits for any number of threads and order of tasks") {
  const auto [a, b] = random_pair(20, 10, 8);
  const std::vector<Landmark> landmarks = {{0, 0}, {60, 70}};
  Options options;
  options.max_iterations = 5;
  options.threads = 1;
  const Result expected = ism::compute_map(a.mesh, b.mesh, landmarks, options);
  REQUIRE(expected.log.size() == 5);
  for (int threads : {0, 2, 4}) {
    CAPTURE(threads);
    options.threads = threads;
    check_same_bits(ism::compute_map(a.mesh, b.mesh, landmarks, options), expected);
  }
  int calls = 0, empty_calls = 0;
  options.parallel_for = [&](int n, const std::function<void(int)>& task) {
    ++calls;
    if (n <= 0) ++empty_calls;
    for (int i = n - 1; i >= 0; --i) task(i);
  };
  check_same_bits(ism::compute_map(a.mesh, b.mesh, landmarks, options), expected);
  CHECK(calls > 0);
  CHECK(empty_calls == 0);
}

#if defined(__linux__) && !defined(ISM_NO_THREADS)
TEST_CASE("there are as many threads as processors that may be used") {
  cpu_set_t before, one;
  REQUIRE(sched_getaffinity(0, sizeof before, &before) == 0);
  Options options;
  CHECK(thread_count(options) <= CPU_COUNT(&before));
  std::size_t first = 0;
  while (!CPU_ISSET(first, &before)) ++first;
  CPU_ZERO(&one);
  CPU_SET(first, &one);
  REQUIRE(sched_setaffinity(0, sizeof one, &one) == 0);
  CHECK(thread_count(options) == 1);
  options.threads = 3;
  CHECK(thread_count(options) == 3);
  options.threads = 100;
  CHECK(thread_count(options) == 4);
  REQUIRE(sched_setaffinity(0, sizeof before, &before) == 0);
}
#endif

TEST_CASE("every iterate is injective, whatever the limit of iterations") {
  const auto [a, b] = random_pair(21);
  Options options = given_planes(a, b);
  double before = std::numeric_limits<double>::infinity();
  for (int n = 0; n <= 6; ++n) {
    CAPTURE(n);
    options.max_iterations = n;
    const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
    CHECK(result.status == Status::kIterationLimit);
    CHECK(static_cast<int>(result.log.size()) == n);
    check_injective(a, b, result);
    check_energy_never_grows(result);
    CHECK(result.final_state().energy < before);
    before = result.final_state().energy;
    const RunOptions run(options);
    const Weights weights = weights_of(run);
    const Iterate end = evaluated(joined(a.mesh, b.mesh), weights, stacked(result.f, result.g));
    // The positions belong to the log; where products are fused, code inlined twice rounds twice.
    CHECK(end.energy == doctest::Approx(result.final_state().energy).epsilon(1e-14));
  }
}

TEST_CASE("the gradient alone is that of the quadratic model") {
  for (const ism::DistortionMeasure& measure : {ism::symmetric_dirichlet(), ism::arap()}) {
    const auto [a, b] = random_pair(29);
    const Modelled m(a, b, Weights{1.7, 0.1, 1e-3, &measure});
    ModelBuilder builder(m.s, m.weights, m.executor);
    builder.differentiate_elements(m.x, false);
    const QuadraticModel model = builder.assemble();
    CHECK(!model.has_hessian());
    const Array<Vec2>& alone = model.gradient;
    REQUIRE(alone.size() == m.model.gradient.size());
    double largest = 0, error = 0;
    for (int v = 0; v < alone.size(); ++v) {
      largest = std::max(largest, norm(alone[v]));
      error = std::max(error, norm(alone[v] - m.model.gradient[v]));
    }
    CHECK(largest > 1e-2);
    CHECK(error < 1e-12 * largest);
  }
}

TEST_CASE("a quasi-Newton direction does with the newest secant what the true Hessian does") {
  const auto [a, b] = random_pair(30);
  const Modelled m(a, b, Weights{2, 0.1, 1e-3, &kDirichlet});
  const LinearSystem system = m.system({m.model});
  LdltFactor factor;
  ldlt_factorize(system.shifted(0), m.x.x, m.executor, factor);
  REQUIRE(factor.ok);
  const int n = m.s.mesh.n_vertices;
  Rng rng(31);
  const auto random_vectors = [&] {
    Array<Vec2> v(n);
    for (Vec2& p : v) p = {rng.uniform(-1, 1), rng.uniform(-1, 1)};
    return v;
  };
  Array<Secant> secants;
  while (secants.size() < 3) {  // of a matrix that is three times the one that is factorised
    Secant secant = {random_vectors(), Array<Vec2>(n)};
    system.H.for_each_block([&](int r, int c, int k) {
      secant.change[r] += 3 * (system.H.value[k] * secant.step[c]);
      if (r != c) secant.change[c] += 3 * (transposed(system.H.value[k]) * secant.step[r]);
    });
    secants.push_back(std::move(secant));
  }
  const Array<Vec2> d = quasi_newton_direction(factor, secants, secants[0].change);
  double error = 0;
  for (int v = 0; v < n; ++v) error = std::max(error, norm(d[v] + secants[0].step[v]));
  CHECK(error < 1e-9);
  // Without secants it is the Newton direction.
  const Array<Vec2> right = random_vectors();
  const Array<Vec2> newton = ldlt_solve(factor, negated(right));
  const Array<Vec2> plain = quasi_newton_direction(factor, {}, right);
  for (int v = 0; v < n; ++v) CHECK(norm(plain[v] - newton[v]) == 0);
}

TEST_CASE("quasi-Newton steps follow iterations once the preconditioner hardly acts") {
  const auto [a, b] = random_pair(32, 6, 6);
  Options options = given_planes(a, b);
  const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
  check_energy_never_grows(result);
  check_injective(a, b, result);
  int in_a_row = 0, taken = 0;
  for (const IterationLog& log : result.log) {
    in_a_row = log.quasi_newton ? in_a_row + 1 : 0;
    CHECK(in_a_row <= Tuning().quasi_newton_steps);
    if (log.quasi_newton) CHECK(log.omega <= 0.01);
    taken += log.quasi_newton;
  }
  CHECK(taken > 5);
  options.omega_start = 0;
  for (const IterationLog& log : ism::compute_map(a.mesh, b.mesh, {}, options).log)
    CHECK_FALSE(log.quasi_newton);
}

TEST_CASE("every variant lowers the energy") {
  for (std::uint64_t seed : {22u, 23u}) {
    const auto [a, b] = random_pair(seed);
    const Options full = given_planes(a, b);
    Options smoothed = full;
    smoothed.omega_start = 0;
    Options newton = smoothed;
    newton.history_length = 1;
    for (const Options* variant : {&std::as_const(newton), &std::as_const(smoothed), &full}) {
      CAPTURE(variant->history_length);
      CAPTURE(variant->omega_start);
      Options options = *variant;
      options.max_iterations = 15;
      const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
      REQUIRE_FALSE(result.log.empty());
      CHECK(result.final_state().energy < result.initial.energy - 1e-3);
      check_energy_never_grows(result);
      check_injective(a, b, result);
      for (const IterationLog& log : result.log) {
        CHECK((log.omega > 0) == (variant == &full));
        if (variant == &newton) CHECK_FALSE(log.history_reset);  // there is nothing to forget
      }
    }
  }
}

TEST_CASE("logs are consistent with the objective and the step rules") {
  const auto [a, b] = random_pair(24);
  Options options = given_planes(a, b);
  options.max_iterations = 10;
  const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
  const double area_a = build_surface(a.mesh, true).total_area;
  const double area_b = build_surface(b.mesh, true).total_area;
  const IterationLog* before = &result.initial;
  for (const IterationLog& log : result.log) {
    const double covered = log.coverage_a * area_a + log.coverage_b * area_b;
    const double barrier = Tuning().barrier_weight * (log.energy_f + log.energy_g);
    const double energy = log.map_energy - coverage_reward(options) * covered + barrier;
    CHECK(log.energy == doctest::Approx(energy).epsilon(1e-10));
    CHECK(log.mean_distortion == doctest::Approx(log.map_energy / covered).epsilon(1e-10));
    CHECK(log.mean_distortion >= 2);
    CHECK(log.step > 0);
    CHECK(log.step < log.max_step);
    CHECK(log.iteration == before->iteration + 1);
    CHECK(before->coverage_a - log.coverage_a <= Tuning().max_coverage_loss * (1 + 1e-12));
    CHECK(before->coverage_b - log.coverage_b <= Tuning().max_coverage_loss * (1 + 1e-12));
    before = &log;
  }
}

TEST_CASE("a usable result has an overlap, however little the objective rewards it") {
  // κ = 0 and distant surfaces drive the overlap towards nothing; it must not become empty.
  for (std::uint64_t seed : {16u, 17u})
    for (double weight : {-2.0, -1.0, 0.0}) {
      CAPTURE(seed);
      CAPTURE(weight);
      const auto [a, b] = random_pair(seed);
      Options options = given_planes(a, b);
      options.coverage_weight = weight;
      const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
      REQUIRE(ism::is_usable(result.status));
      CHECK(result.final_state().polygons > 0);
      CHECK(result.final_state().coverage_a > 0);
      CHECK(result.final_state().coverage_b > 0);
      CHECK(std::isfinite(result.final_state().mean_distortion));
      check_energy_never_grows(result);
      check_injective(a, b, result);
    }
}

TEST_CASE("the covered area never falls below the least share") {
  const double least = Tuning().least_coverage;
  const auto [a, b] = random_pair(17);
  Options options = given_planes(a, b);
  options.coverage_weight = -2;
  const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
  REQUIRE(ism::is_usable(result.status));
  for (const IterationLog& log : result.log) {
    CHECK(log.coverage_a > least * result.initial.coverage_a);
    CHECK(log.coverage_b > least * result.initial.coverage_b);
  }
  CHECK(result.final_state().coverage_a < 1.2 * least * result.initial.coverage_a);
}

// A start on a coarse level's map may cover less: no step was then taken that did not make up for
// all of it at once.
TEST_CASE("where less is covered than the share, it may grow, but not shrink") {
  Iterate from;
  from.energy = 1;
  from.area_a = from.area_b = 0.4;
  const auto may_go = [&from](double least, double area_a, double area_b) {
    Trial t;
    t.x.energy = 0.9;
    t.x.area_a = area_a;
    t.x.area_b = area_b;
    Direction d;
    d.slope = -1;
    return is_acceptable({1, 1, least, least}, from, d, t);
  };
  CHECK(may_go(0.5, 0.41, 0.4));
  CHECK(may_go(0.5, 0.6, 0.6));
  CHECK(!may_go(0.5, 0.39, 0.41));
  CHECK(!may_go(0.5, 0.41, 0.39));
  CHECK(may_go(0.3, 0.39, 0.31));
  CHECK(!may_go(0.3, 0.39, 0.29));
  CHECK(!may_go(0, 0, 0.5));
}

TEST_CASE("a map between isometric surfaces is found") {
  Rng rng(25);
  Disk a = shapes::random_disk(5, 4, rng);
  shapes::bend(a, 0.5);
  Disk b = a;
  b.mesh = moved_in_space(a.mesh, 1, 1.1, Vector3d(1, 1, 0), Vector3d(3, 2, 1));
  b.plane = shapes::moved(a.plane, shapes::rotation(0.2), Vector2d(0.3, -0.2));
  const Result result = ism::compute_map(a.mesh, b.mesh, {}, given_planes(a, b));
  CHECK(result.status == Status::kConverged);
  CHECK(result.initial.mean_distortion > 2.01);
  CHECK(result.final_state().mean_distortion < 2.001);
  CHECK(result.final_state().coverage_a > 0.99);
}

// ---- measures ----

TEST_CASE("a run does not stall where both planes are the same") {
  // As of two shapes with one connectivity and one set of texture coordinates.
  constexpr int n = 8;
  const Disk a = shapes::grid(n, n);
  Disk b = a;
  for (int v = 0; v < b.plane.rows(); ++v) {
    const Vec2 p = row2(b.plane, v) - n * Vec2{0.25, 0.4};
    b.mesh.vertices(v, 2) = 0.3 * n * std::exp(-16 * squared_norm(p) / (n * n));
  }
  const Result result = ism::compute_map(a.mesh, b.mesh, {}, given_planes(a, b));
  CHECK(result.status == Status::kConverged);
  CHECK(result.initial.mean_distortion > 2.05);
  CHECK(result.final_state().mean_distortion < 2.02);
}

TEST_CASE("the reward for covered area counts from what an isometry costs") {
  Options options;
  CHECK(options.measure.isometry() == 2);
  CHECK(coverage_reward(options) == doctest::Approx(2.2));
  for (const ism::DistortionMeasure& measure : {ism::arap(), ism::sarap(), ism::asap()}) {
    options.measure = measure;
    CHECK(measure.isometry() == doctest::Approx(0).epsilon(1e-9));
    CHECK(coverage_reward(options) == doctest::Approx(0.2));
  }
  options = Options::paper();
  CHECK(coverage_reward(options) == 0);
  options.measure = ism::arap();
  CHECK(coverage_reward(options) == 0);
}

TEST_CASE("every measure is minimised, injectively") {
  const auto [a, b] = random_pair(29);
  Options options = given_planes(a, b);
  for (const ism::DistortionMeasure& measure : {ism::arap(), ism::sarap(), ism::asap()}) {
    options.measure = measure;
    const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
    CHECK(result.status == Status::kConverged);
    CHECK(result.final_state().energy < result.initial.energy);
    check_energy_never_grows(result);
    check_injective(a, b, result);
    const Weights weights = {0.2, Tuning().barrier_weight, 1e-3, &measure};
    const Iterate end = evaluated(joined(a.mesh, b.mesh), weights, stacked(result.f, result.g));
    CHECK(end.map_energy == doctest::Approx(result.final_state().map_energy).epsilon(1e-9));
  }
}

TEST_CASE("a measure of one's own") {
  const auto [a, b] = random_pair(30);
  Options options = given_planes(a, b);  // on one thread, so that calls can be counted
  for (const ism::DistortionMeasure& known : {ism::arap(), ism::sarap(), ism::asap()}) {
    options.measure = known;
    const Result expected = ism::compute_map(a.mesh, b.mesh, {}, options);
    int calls = 0, outside = 0;
    const auto density = [&](double S, double d) {
      ++calls;
      outside += !(d > 0 && S >= 2 * d * (1 - 1e-12));
      return known.density(S, d);
    };
    options.measure = {density, known.on_a(), known.on_b()};
    const Result own = ism::compute_map(a.mesh, b.mesh, {}, options);
    CHECK(calls > own.initial.polygons * static_cast<int>(own.log.size()));
    CHECK(outside == 0);
    CHECK(own.f == expected.f);
    CHECK(own.g == expected.g);
  }
  options.measure = {nullptr, 0, 1};
  check_refused(ism::compute_map(a.mesh, b.mesh, {}, options), Status::kInvalidOptions, "measure");
}

TEST_CASE("the symmetric Dirichlet energy as a measure of one's own gives the same map") {
  const auto [a, b] = random_pair(30);
  Options options = given_planes(a, b);
  const Result known = ism::compute_map(a.mesh, b.mesh, {}, options);
  options.measure = {[](double S, double d) { return kDirichlet.density(S, d); }, kDirichlet.on_a(),
                     kDirichlet.on_b()};
  CHECK(kDirichlet.is_symmetric_dirichlet());
  CHECK_FALSE(options.measure.is_symmetric_dirichlet());
  const Result own = ism::compute_map(a.mesh, b.mesh, {}, options);
  CHECK(own.status == known.status);
  CHECK(own.initial.energy == doctest::Approx(known.initial.energy).epsilon(1e-12));
  REQUIRE(std::min(own.log.size(), known.log.size()) > 5);
  for (std::size_t i = 0; i < 5; ++i)  // before differences of rounding have grown
    CHECK(std::abs(own.log[i].energy - known.log[i].energy) < 1e-7);
  CHECK(own.final_state().mean_distortion ==
        doctest::Approx(known.final_state().mean_distortion).epsilon(0.01));
  CHECK(own.final_state().coverage_a ==
        doctest::Approx(known.final_state().coverage_a).epsilon(0.01));
}

TEST_CASE("a factorisation that fails late ends a run with the map there is") {
  const auto [a, b] = random_pair(30);
  Options options = given_planes(a, b);
  int calls = 0, sound = std::numeric_limits<int>::max();
  const auto fading = [&](double S, double d) {
    ism::StretchDensity density = kDirichlet.density(S, d);
    if (++calls > sound) density.SS = density.Sd = density.dd = std::nan("");
    return density;
  };
  options.measure = {fading, 0, 1};
  options.max_iterations = 1;
  const Result one = ism::compute_map(a.mesh, b.mesh, {}, options);
  REQUIRE(one.log.size() == 1);
  sound = calls;
  calls = 0;
  options.max_iterations = 10;
  const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
  CHECK(result.status == Status::kStalled);
  REQUIRE(result.log.size() == 1);
  CHECK(result.f == one.f);
  CHECK(ism::SurfaceMap(result).status() == Status::kDone);
}

TEST_CASE("a measure that is no number is reported, not accepted") {
  const auto [a, b] = random_pair(30);
  Options options = given_planes(a, b);
  const auto broken = [](double S, double d) {
    ism::StretchDensity density = kDirichlet.density(S, d);
    density.SS = density.Sd = density.dd = std::numeric_limits<double>::quiet_NaN();
    return density;
  };
  options.measure = {broken, 0, 1};
  const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
  CHECK(result.status == Status::kNumericalFailure);
  CHECK(result.log.empty());
  CHECK(result.message.find("not finite") != std::string::npos);
  // One whose values are -∞ behind the start and its derivatives, so in all trials.
  int calls = 0, sound = std::numeric_limits<int>::max();
  const auto bottomless = [&](double S, double d) {
    ism::StretchDensity density = kDirichlet.density(S, d);
    if (++calls > sound) density.value = -std::numeric_limits<double>::infinity();
    return density;
  };
  options.fixed_a = {0};  // so that the planes are not moved first
  options.measure = {bottomless, 0, 1};
  const JointSurface s = joined(a.mesh, b.mesh);
  const RunOptions run(options);
  const Weights weights = weights_of(run);
  ModelBuilder(s, weights, Executor(options))
      .differentiate_elements(evaluated(s, weights, stacked(a.plane, b.plane)));
  sound = calls;
  calls = 0;
  const Result stalled = ism::compute_map(a.mesh, b.mesh, {}, options);
  CHECK(calls > sound);
  CHECK(stalled.status == Status::kStalled);
  CHECK(stalled.log.empty());
}

// ---- gaps ----

TEST_CASE("the energy of gaps is least where they were found, with the Hessian that is added") {
  Rng rng(28);
  for (double width : {0.1, 1e-3}) {
    CAPTURE(width);
    const Disk a = shapes::slit_ring(18, width, 6), b = shapes::slit_ring(15, width, 6.3);
    const HalfEdgeMesh m = joined(a.mesh, b.mesh).mesh;  // which overlap
    const Points2 x = stacked(a.plane, b.plane);
    const int n = m.n_vertices;
    const Array<Gap> gaps = find_gaps(m, x, 0.3);
    REQUIRE_FALSE(gaps.empty());
    double weight = 0;
    for (const Gap& gap : gaps) {
      CHECK((gap.v < a.plane.rows()) == (gap.u < a.plane.rows()));
      weight += gap.weight;
    }
    CHECK(weight < 0.6);
    Array<Block> blocks;
    add_gaps(gaps, blocks);
    MatrixXd H = MatrixXd::Zero(2 * n, 2 * n);
    for (const Block& block : blocks) {
      const int r = 2 * block.row, c = 2 * block.column;
      CHECK(r <= c);
      H.block<2, 2>(r, c) += eigen(block.value);
      if (r != c) H.block<2, 2>(c, r) += eigen(transposed(block.value));
    }
    CHECK(std::abs(gap_energy(gaps, x)) < 1e-12);
    for (int trial = 0; trial < 10; ++trial) {
      Points2 d(n, 2);
      for (int v = 0; v < n; ++v) d.row(v) = rng.point(1).transpose();
      const VectorXd flat = Eigen::Map<const VectorXd>(d.data(), d.size());
      const double h = 1e-4 * width, expected = flat.dot(H * flat);
      const double second = gap_energy(gaps, x + h * d) + gap_energy(gaps, x - h * d);
      CHECK(second / (h * h) == doctest::Approx(expected).epsilon(1e-4));
      const double slope = gap_energy(gaps, x + h * d) - gap_energy(gaps, x - h * d);
      CHECK(std::abs(slope) < 1e-2 * second);
      const double most = max_step(gaps, per_vertex(flat));
      CHECK(gap_energy(gaps, x + 0.999 * most * d) < kInfinity);
      if (most < kInfinity) CHECK(gap_energy(gaps, x + 1.001 * most * d) == kInfinity);
    }
  }
}

TEST_CASE("a boundary that keeps away from itself has no gaps") {
  for (const Disk& disk : {shapes::fan(12), shapes::grid(6, 6)}) {
    CAPTURE(disk.name);
    CHECK(find_gaps(half_edges(disk.mesh), disk.plane, 1).empty());
  }
}

TEST_CASE("a run goes on where its boundary meets itself") {
  // The objective rewards coverage, so it pulls the slit of either ring shut over the other ring.
  for (double gap : {0.1, 1e-3, 1e-9, 1e-14})
    for (double angle : {5.5, 7.5}) {
      CAPTURE(gap);
      CAPTURE(angle);
      const Disk a = shapes::slit_ring(18, gap, angle);
      Disk b = shapes::slit_ring(15, gap, 6.3);
      b.plane = shapes::moved(b.plane, shapes::rotation(2.5), Vector2d(0, 0));
      Options options = given_planes(a, b);
      const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
      CHECK(result.status == Status::kConverged);
      check_energy_never_grows(result);
      check_injective(a, b, result);
    }
}

// ---- cancelling ----

TEST_CASE("cancelling after two iterations returns the second iterate") {
  const auto [a, b] = random_pair(26);
  Options options = given_planes(a, b);
  options.progress = [](const Progress& p) {
    REQUIRE_FALSE(p.is_embedding);
    REQUIRE(p.iteration != nullptr);
    CHECK_FALSE(p.what.empty());
    return p.iteration->iteration < 2;
  };
  const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
  CHECK(result.status == Status::kCancelled);
  CHECK(ism::is_usable(result.status));
  CHECK_FALSE(result.message.empty());
  CHECK(result.log.size() == 2);
  check_injective(a, b, result);
  options.progress = nullptr;
  options.max_iterations = 2;
  const Result limited = ism::compute_map(a.mesh, b.mesh, {}, options);
  CHECK(result.f == limited.f);
  CHECK(result.g == limited.g);
}

TEST_CASE("cancelling during the embedding aborts without positions, at every report") {
  const auto [a, b] = random_pair(27, 3, 3);
  Options options = on_one_thread();
  options.max_iterations = 0;
  // A report that is repeated because a tenth of a second has passed counts once.
  const auto run = [&, &a = a, &b = b](int last, int& reports) {
    reports = 0;
    double fraction = -1;
    std::string what;
    options.progress = [&](const Progress& p) {
      CHECK(p.is_embedding);
      CHECK(p.iteration == nullptr);
      if (p.fraction != fraction || p.what != what) ++reports;
      fraction = p.fraction;
      what = p.what;
      return reports < last;
    };
    return ism::compute_map(a.mesh, b.mesh, {}, options);
  };
  int all = 0, reports = 0;
  CHECK(ism::is_usable(run(std::numeric_limits<int>::max(), all).status));
  CHECK(all >= 3);
  for (int last = 1; last <= all; last += 1 + last / 20) {
    CAPTURE(last);
    const Result result = run(last, reports);
    check_refused(result, Status::kNoMapYet, "cancel");
    CHECK(reports == last);
    CHECK(result.f.size() == 0);
    CHECK(result.g.size() == 0);
  }
}

// ---- refused input ----

TEST_CASE("options out of range are refused by name") {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  const Disk disk = shapes::grid(2, 2);
  const auto refuse_with = [&](const std::string& name, auto set, auto values) {
    for (auto value : values) {
      CAPTURE(value);
      Options options = given_planes(disk, disk);
      set(options, value);
      check_refused(ism::compute_map(disk.mesh, disk.mesh, {}, options), Status::kInvalidOptions,
                    name);
      const ism::Embedding e = ism::initial_embedding(disk.mesh, disk.mesh, {}, options);
      CHECK(e.status == Status::kInvalidOptions);
      CHECK(e.f.size() == 0);
    }
  };
  const auto refuse = [&](const std::string& name, auto member, auto values) {
    refuse_with(
        name, [&](Options& o, auto value) { o.*member = value; }, values);
  };
  using Doubles = std::vector<double>;
  using Ints = std::vector<int>;
  refuse("coverage_weight", &Options::coverage_weight, Doubles{-kInf, kNan, kInf});
  refuse("history_length", &Options::history_length, Ints{0, -1});
  refuse("omega_start", &Options::omega_start, Doubles{-1, kNan, kInf});
  refuse("max_seconds", &Options::max_seconds, Doubles{0, -1, kNan});
  refuse("coarsest", &Options::coarsest, Ints{-1});
  refuse("refine", &Options::refine, Doubles{-1, kNan, kInf});
  refuse("max_iterations", &Options::max_iterations, Ints{-1});
  refuse("tolerance", &Options::tolerance, Doubles{-1, kNan});
  refuse("threads", &Options::threads, Ints{-1});
  refuse_with(
      "weights of curves",
      [](Options& o, double weight) {
        o.curves = {{{0, 1}, {0, 1}, weight}};
      },
      Doubles{-1, kNan, kInf});
}

TEST_CASE("meshes that are no surfaces are refused by name") {
  const TriangleMesh good = shapes::grid(2, 2).mesh;
  TriangleMesh bad = good;
  bad.triangles(1, 1) = 99;
  const Result result = ism::compute_map(good, bad);
  check_refused(result, Status::kInvalidMesh, "mesh B");
  CHECK(result.ids == Ids{{ism::Side::kB, ism::Element::kFace, 1}});
  check_refused(ism::compute_map(TriangleMesh(), good), Status::kInvalidMesh, "mesh A");
  const ism::Embedding e = ism::initial_embedding(good, bad);
  CHECK(e.status == Status::kInvalidMesh);
  CHECK(e.message == result.message);
}

TEST_CASE("landmarks out of range, or exact and used twice, are refused with the vertex") {
  const TriangleMesh a = shapes::grid(2, 2).mesh, b = shapes::grid(3, 2).mesh;  // 9, 12 vertices
  const auto refuse = [&](const std::vector<Landmark>& landmarks, int id, const char* mesh) {
    CAPTURE(id);
    Options options;
    options.exact_landmarks = true;
    const Result result = ism::compute_map(a, b, landmarks, options);
    check_refused(result, Status::kInvalidLandmarks, mesh);
    CHECK(result.message.find(std::to_string(id)) != std::string::npos);
    CHECK(result.ids == Ids{mesh[0] == 'A' ? of_a(id) : of_b(id)});
    const ism::Embedding e = ism::initial_embedding(a, b, landmarks, options);
    CHECK(e.status == Status::kInvalidLandmarks);
    CHECK(e.message == result.message);
    CHECK(e.ids == result.ids);
  };
  refuse({{0, 0}, {9, 1}}, 9, "A");
  refuse({{-1, 0}}, -1, "A");
  refuse({{8, 12}}, 12, "B");
  refuse({{8, -5}}, -5, "B");
  refuse({{3, 0}, {4, 1}, {3, 2}}, 3, "A");
  refuse({{3, 7}, {4, 1}, {5, 7}}, 7, "B");
}

TEST_CASE("given positions that are no injective embedding are refused by name") {
  const Disk a = shapes::grid(2, 2), b = shapes::grid(3, 2);
  const auto refuse = [&](const std::string& name, const auto& spoil) {
    Options options = given_planes(a, b);
    spoil(options);
    check_refused(ism::compute_map(a.mesh, b.mesh, {}, options), Status::kInvalidPositions, name);
  };
  const auto mirrored = [](Points2& x) { x.col(0) *= -1; };
  refuse("initial_f", [&](Options& o) { o.initial_f.conservativeResize(8, Eigen::NoChange); });
  refuse("initial_g", [&](Options& o) { o.initial_g = Points2::Zero(13, 2); });
  refuse("initial_f", [&](Options& o) { o.initial_f.resize(0, 2); });
  refuse("initial_g", [&](Options& o) { o.initial_g.resize(0, 2); });
  refuse("initial_f", [&](Options& o) { mirrored(o.initial_f); });
  refuse("initial_g", [&](Options& o) { mirrored(o.initial_g); });
  refuse("initial_f", [&](Options& o) { o.initial_f.row(2) << 2.5, 1; });  // the centre
  refuse("initial_g", [&](Options& o) { o.initial_g.row(3) = o.initial_g.row(2); });
  refuse("initial_g", [&](Options& o) { o.initial_g(1, 1) = std::nan(""); });
}

TEST_CASE("embeddings apart have no map") {
  const Disk a = shapes::grid(2, 2);
  Options options = given_planes(a, a);
  for (const Vector2d& shift :
       {Vector2d(10, 0), Vector2d(2, 0), Vector2d(-2, 0), Vector2d(0, 2), Vector2d(0, -2)}) {
    CAPTURE(shift.transpose());  // all but the first: they touch
    options.initial_g = a.plane.rowwise() + shift.transpose();
    const Result result = ism::compute_map(a.mesh, a.mesh, {}, options);
    check_refused(result, Status::kNoOverlap, "overlap");
    CHECK(result.initial.mean_distortion == 0);
  }
}

TEST_CASE("the unit of given positions does not matter") {
  const auto [a, b] = random_pair(29);
  const Result expected = ism::compute_map(a.mesh, b.mesh, {}, given_planes(a, b));
  REQUIRE(ism::is_usable(expected.status));
  for (double unit : {0x1p-20, 1024.0, 0x1p30}) {
    CAPTURE(unit);
    Options options = given_planes(a, b);
    options.initial_f *= unit;
    options.initial_g *= unit;
    const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
    CHECK(result.status == expected.status);
    CHECK(result.f == unit * expected.f);
    CHECK(result.g == unit * expected.g);
    CHECK(result.final_state().energy == expected.final_state().energy);
  }
}

// ---- presets and names ----

TEST_CASE("the paper preset has the paper's constants and can be run") {
  const RunOptions paper(Options::paper());
  CHECK(paper.coverage_weight == -2);
  CHECK(paper.tuning.barrier_weight == 1e-8);
  CHECK(paper.tuning.spd_epsilon == 1e-3);
  CHECK(paper.omega_start == 1e9);
  CHECK(paper.tuning.omega_factor == 1.25);
  CHECK(paper.tuning.omega_least == 0);
  CHECK(paper.history_length == 6);
  CHECK(paper.tuning.history_decay == 0.5);
  CHECK(paper.tuning.least_coverage == 0);
  CHECK(paper.tuning.search_stride == 1);
  CHECK(paper.tuning.quasi_newton_steps == 0);
  CHECK(paper.max_iterations == 550);
  CHECK(paper.tuning.window == 10);
  const auto [a, b] = random_pair(28);
  Options options = paper;
  options.initial_f = a.plane;
  options.initial_g = b.plane;
  options.max_iterations = 10;
  const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
  CHECK(result.final_state().energy < result.initial.energy);
  check_energy_never_grows(result);
  check_injective(a, b, result);
}

TEST_CASE("every status has a name of its own") {
  std::vector<std::string> names;
  for (int i = 0; i <= static_cast<int>(Status::kNumericalFailure); ++i)
    names.push_back(ism::to_string(static_cast<Status>(i)));
  std::sort(names.begin(), names.end());
  CHECK(std::unique(names.begin(), names.end()) == names.end());
  CHECK(std::count(names.begin(), names.end(), "unknown") == 0);
}

}  // namespace optimizer_tests

#endif  // ISM_TESTS_PART_OPTIMIZER_HPP

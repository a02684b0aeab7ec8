// Pins: substituted systems, residuals, and what is refused.

#ifndef ISM_TESTS_PART_CONSTRAINTS_HPP
#define ISM_TESTS_PART_CONSTRAINTS_HPP

#include "dense.hpp"
#include "ism.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace constraints_tests {
namespace {

using namespace ism::detail;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using ism::IterationLog;
using ism::Options;
using ism::Points2;
using ism::Result;
using ism::Status;
using ism::SurfaceMap;
using ism::TriangleMesh;
using runs::given_planes;
using runs::on_one_thread;
using shapes::Disk;
using shapes::half_edges;
using shapes::Ids;
using shapes::of_a;
using shapes::of_b;
using shapes::Rng;

/// P as a matrix.
MatrixXd substitution_matrix(const Array<Follower>& followers, int rows) {
  MatrixXd P = MatrixXd::Identity(2 * rows, 2 * rows);
  for (const Follower& follower : followers) {
    P.block<2, 2>(2 * follower.row, 2 * follower.row).setZero();
    for (int k = 0; k < 3; ++k)
      P.block<2, 2>(2 * follower.row, 2 * follower.master[k]) +=
          follower.weight[k] * Eigen::Matrix2d::Identity();
  }
  return P;
}

/// A random vector of n rows.
VectorXd random_vector(int n, Rng& rng) {
  return VectorXd::NullaryExpr(2 * n, [&](Eigen::Index) { return rng.uniform(-1, 1); });
}

/// A random symmetric system of n rows.
LinearSystem random_system(int n, const Executor& executor, Rng& rng) {
  Array<Block> H, Q;
  for (int r = 0; r < n; ++r)
    for (int c = r; c < n; ++c) {
      if (c > r && rng.below(3) > 0) continue;
      Mat2 value;
      for (int i = 0; i < 4; ++i) value(i / 2, i % 2) = rng.uniform(-1, 1);
      if (c == r) value += transposed(value);
      H.push_back({r, c, value});
      Q.push_back({r, c, diagonal(rng.uniform(-1, 1))});
    }
  return {sum_of_blocks(n, H, executor), sum_of_blocks(n, Q, executor),
          per_vertex(random_vector(n, rng))};
}

/// Two bent random disks; every vertex of the smaller one, A, lies over B.
std::pair<Disk, Disk> nested_pair(std::uint64_t seed) {
  Rng rng(seed);
  Disk a = shapes::random_disk(4, 4, rng), b = shapes::random_disk(6, 6, rng);
  shapes::bend(a, 0.5);
  shapes::bend(b, -0.3);
  a.plane = shapes::moved(a.plane, shapes::rotation(0.2), Vector2d(1.3, 0.9));
  return {a, b};
}

/// Options that pin vertices of both meshes, none in a triangle of another.
Options with_pins(const Disk& a, const Disk& b) {
  Options options = given_planes(a, b);
  options.pins_a = {0, 6, 18};
  options.max_iterations = 0;
  for (int v = 0; v < b.plane.rows(); ++v) {
    options.pins_b = {v};
    if (ism::is_usable(ism::compute_map(a.mesh, b.mesh, {}, options).status)) break;
  }
  options.max_iterations = Options().max_iterations;
  return options;
}

void check_refused(const Result& result, const std::string& what, const Ids& ids) {
  CAPTURE(what);
  CAPTURE(result.message);
  CHECK(result.status == Status::kInvalidPins);
  CHECK_FALSE(ism::is_usable(result.status));
  CHECK(result.message.find(what) != std::string::npos);
  CHECK(result.ids == ids);
  CHECK(result.log.empty());
}

}  // namespace

TEST_CASE("a substituted system is the product of matrices") {
  Rng rng(1);
  const Executor executor(on_one_thread());
  for (int round = 0; round < 20; ++round) {
    const int n = 12;
    LinearSystem system = random_system(n, executor, rng);
    const Array<Follower> followers = [&] {
      Array<Follower> all;
      all.push_back({2, {7, 9, 11}, {0.2, 0.3, 0.5}});
      all.push_back({3, {7, 8, 9}, {0.6, 0, 0.4}});
      all.push_back({10, {0, 1, 4}, {0, 1, 0}});
      return all;
    }();
    const MatrixXd P = substitution_matrix(followers, n);
    MatrixXd H = P.transpose() * dense(system.H) * P;
    const MatrixXd Q = P.transpose() * dense(system.Q) * P;
    const VectorXd gradient = P.transpose() * dense(system.gradient);
    for (const Follower& follower : followers)
      for (int i : {2 * follower.row, 2 * follower.row + 1}) H(i, i) = 1;
    reduce(followers, FixedCoordinates(system.H.rows()), executor, system);
    for (int r = 0; r < n; ++r)
      for (int b = system.H.start[r]; b + 1 < system.H.start[r + 1]; ++b)
        CHECK(system.H.column[b] < system.H.column[b + 1]);
    CHECK(std::equal(system.H.start.begin(), system.H.start.end(), system.Q.start.begin()));
    CHECK(std::equal(system.H.column.begin(), system.H.column.end(), system.Q.column.begin(),
                     system.Q.column.end()));  // both of one pattern
    CHECK((dense(system.H) - H).norm() < 1e-14 * H.norm());
    CHECK((dense(system.Q) - Q).norm() < 1e-14 * Q.norm());
    CHECK((dense(system.gradient) - gradient).norm() < 1e-14 * gradient.norm());
    const VectorXd y = random_vector(n, rng);
    Array<Vec2> direction = per_vertex(y);
    expand_direction(followers, direction);
    CHECK((dense(direction) - P * y).norm() < 1e-14 * y.norm());
  }
}

TEST_CASE("the gradient of a pinned problem agrees with differences") {
  const auto [a, b] = nested_pair(3);
  const JointSurface s = shapes::joined(a.mesh, b.mesh);
  const Points2 start = stacked(a.plane, b.plane);
  const RunOptions options(with_pins(a, b));
  Result result;
  Array<Follower> followers;
  REQUIRE(find_followers(s, start, {}, options, followers, result));
  REQUIRE(followers.size() == 4);
  const Weights weights = {2.2, 1e-2, 1e-3, &options.measure};
  const Executor executor(options);
  const auto at = [&](const Points2& x) {
    Iterate iterate;
    iterate.x = x;
    place_followers(s.mesh, followers, iterate.x);
    evaluate(s, weights, iterate);
    return iterate;
  };
  const Iterate x = at(start);
  CHECK((x.x - start).norm() < 1e-14);
  ModelBuilder builder(s, weights, executor);
  builder.differentiate_elements(x);
  LinearSystem system = blend(Array<QuadraticModel>(1, builder.assemble()), 1, {}, {}, executor);
  reduce(followers, FixedCoordinates(system.H.rows()), executor, system);
  VectorXd expected(x.x.size());
  for (int i = 0; i < expected.size(); ++i) {
    const double h = 1e-6;
    double e[2];
    for (int side = 0; side < 2; ++side) {
      Points2 y = x.x;
      y(i / 2, i % 2) += side == 0 ? -h : h;
      e[side] = at(y).energy;
    }
    expected[i] = (e[1] - e[0]) / (2 * h);
  }
  CHECK(expected.norm() > 1);
  CHECK((dense(system.gradient) - expected).norm() < 1e-6 * expected.norm());
}

TEST_CASE("pinned vertices stay where they are on the other surface") {
  for (std::uint64_t seed : {4u, 5u, 6u}) {
    CAPTURE(seed);
    const auto [a, b] = nested_pair(seed);
    Options options = with_pins(a, b);
    const int pin_b = options.pins_b[0];
    const SurfaceMap before(a.mesh, b.mesh, a.plane, b.plane);
    const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
    REQUIRE(ism::is_usable(result.status));
    CHECK(result.log.size() > 5);
    for (const IterationLog& log : result.log) CHECK(log.pin_residual < 1e-12);
    CHECK(is_injective(half_edges(a.mesh), result.f));
    CHECK(is_injective(half_edges(b.mesh), result.g));
    const SurfaceMap after(a.mesh, b.mesh, result.f, result.g);
    for (int v : options.pins_a) {
      const Vector3d p = before.position_on_b(before.forward_vertex(v));
      const Vector3d q = after.position_on_b(after.forward_vertex(v));
      CHECK((p - q).norm() < 1e-12);
    }
    const Vector3d p = before.position_on_a(before.backward_vertex(pin_b));
    const Vector3d q = after.position_on_a(after.backward_vertex(pin_b));
    CHECK((p - q).norm() < 1e-12);
    options.pins_a.clear();
    const Result free = ism::compute_map(a.mesh, b.mesh, {}, options);
    CHECK(free.final_state().energy < result.final_state().energy);
    const SurfaceMap moved(a.mesh, b.mesh, free.f, free.g);
    const Vector3d r = moved.position_on_b(moved.forward_vertex(6));
    CHECK((before.position_on_b(before.forward_vertex(6)) - r).norm() > 1e-3);
  }
}

TEST_CASE("several pins in one triangle") {
  Rng rng(7);
  Disk a = shapes::random_disk(5, 5, rng);
  shapes::bend(a, 0.5);
  Disk b = shapes::triangle({-9, -9}, {16, -8}, {3, 17});
  Options options = given_planes(a, b);
  for (int v = 0; v < 12; ++v) options.pins_a.push_back(v);
  const Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
  REQUIRE(ism::is_usable(result.status));
  CHECK(result.final_state().energy < result.initial.energy);
  CHECK(result.final_state().pin_residual < 1e-12);
}

TEST_CASE("bad pins are refused with the vertices") {
  const auto [a, b] = nested_pair(8);
  const auto refuse = [&, &a = a, &b = b](const std::vector<int>& pins_a,
                                          const std::vector<int>& pins_b, const std::string& what,
                                          const Ids& ids) {
    Options options = given_planes(a, b);
    options.pins_a = pins_a;
    options.pins_b = pins_b;
    check_refused(ism::compute_map(a.mesh, b.mesh, {}, options), what, ids);
  };
  const int n_a = static_cast<int>(a.plane.rows()), n_b = static_cast<int>(b.plane.rows());
  refuse({0, n_a}, {}, "vertex " + std::to_string(n_a) + " of A is to be pinned", {of_a(n_a)});
  refuse({-1}, {}, "vertex -1 of A is to be pinned", {of_a(-1)});
  refuse({}, {n_b}, "vertex " + std::to_string(n_b) + " of B is to be pinned", {of_b(n_b)});
  refuse({3, 4, 3}, {}, "vertex 3 of A is to be pinned, but it is pinned already", {of_a(3)});
  refuse({}, {0}, "vertex 0 of B is not mapped to A by the start", {of_b(0)});
  const SurfaceMap map(a.mesh, b.mesh, a.plane, b.plane);
  const ism::SurfacePoint image = map.backward_vertex(24);
  REQUIRE(image.exists());
  const int v = a.mesh.triangles(image.face, 0);
  refuse({v}, {24}, "vertex " + std::to_string(v) + " of A lies in a triangle of vertex 24 of B",
         {of_a(v), of_b(24)});
}

// ---- exact landmarks ----

TEST_CASE("exact landmarks coincide to the last bit, from the start to the end") {
  for (std::uint64_t seed : {9u, 10u, 11u}) {
    CAPTURE(seed);
    Rng rng(seed);
    Disk a = shapes::random_disk(7, 6, rng), b = shapes::random_disk(6, 8, rng);
    shapes::bend(a, 0.5);
    shapes::bend(b, -0.4);
    const std::vector<ism::Landmark> landmarks = {{8, 7}, {20, 22}, {30, 31}};
    Options options = on_one_thread();
    options.exact_landmarks = true;
    const Result result = ism::compute_map(a.mesh, b.mesh, landmarks, options);
    CAPTURE(result.message);
    REQUIRE(ism::is_usable(result.status));
    CHECK(result.start.landmark_distance == 0);
    for (const ism::Landmark& l : landmarks) {
      CHECK(result.start.f.row(l.a.vertex) == result.start.g.row(l.b.vertex));
      CHECK(result.f.row(l.a.vertex) == result.g.row(l.b.vertex));
    }
    CHECK(result.log.size() > 5);
    for (const IterationLog& log : result.log) CHECK(log.pin_residual < 1e-12);
    CHECK(is_injective(half_edges(a.mesh), result.f));
    CHECK(is_injective(half_edges(b.mesh), result.g));
  }
}

TEST_CASE("pins that do not exist are refused before the embedding") {
  const TriangleMesh a = shapes::grid(8, 8).mesh;
  Options options;
  int reports = 0;
  options.progress = [&](const ism::Progress&) { return ++reports > 0; };
  options.pins_a = {81};
  check_refused(ism::compute_map(a, a, {}, options),
                "vertex 81 of A is to be pinned, but ids are 0 to 80", {of_a(81)});
  options.pins_a = {40};
  options.exact_landmarks = true;
  check_refused(ism::compute_map(a, a, {{40, 40}}, options),
                "40 of A is to be pinned, but it is in an exact landmark already", {of_a(40)});
  CHECK(reports == 0);
}

TEST_CASE("landmarks that given positions do not bring together are pulled together from there") {
  shapes::Rng rng(7);
  Disk a = shapes::perturbed_grid(9, 9, 0.2, rng), b = shapes::perturbed_grid(9, 9, 0.2, rng);
  shapes::bend(a, 0.4);
  const std::vector<ism::Landmark> landmarks = {{44, 45},
                                                {ism::SurfacePoint{40, {0.2, 0.3, 0.5}}, 25}};
  for (bool is_exact : {false, true}) {
    Options options = given_planes(a, b);
    options.max_iterations = 10;
    options.exact_landmarks = is_exact;
    const Result r = ism::compute_map(a.mesh, b.mesh, landmarks, options);
    CAPTURE(r.message);
    REQUIRE(ism::is_usable(r.status));
    const ism::SurfaceMap map(r);
    for (const ism::Landmark& l : landmarks) {
      const ism::SurfacePoint image =
          l.a.vertex >= 0 ? map.forward_vertex(l.a.vertex) : map.forward(l.a.point);
      REQUIRE(image.exists());
      const double distance =
          (map.position_on_b(image) - b.mesh.vertices.row(l.b.vertex).transpose()).norm();
      CHECK((distance < 1e-9 || !is_exact));  // those that guide are let go at last
    }
    const bool was_apart = (options.initial_f.row(44) - options.initial_g.row(45)).norm() > 0.5;
    CHECK(was_apart);
  }
}

TEST_CASE("exact landmarks that cannot be joined from given positions are refused by name") {
  const Disk a = shapes::grid(6, 6);
  Options options = given_planes(a, a);
  options.exact_landmarks = true;
  options.boundary = ism::Boundary::kFixed;
  const Result r = ism::compute_map(a.mesh, a.mesh, {{2, 3}}, options);
  CHECK(r.status == Status::kInvalidLandmarks);
  CHECK(r.message.find("2-3") != std::string::npos);
  CHECK(r.ids == Ids{of_a(2), of_b(3)});
  CHECK(r.f.size() == 0);
}

}  // namespace constraints_tests

#endif  // ISM_TESTS_PART_CONSTRAINTS_HPP

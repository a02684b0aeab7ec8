// ism_verify.hpp: what it proves, and that it finds what is wrong.

#ifndef ISM_TESTS_PART_VERIFY_HPP
#define ISM_TESTS_PART_VERIFY_HPP

#include "ism.hpp"
#include "ism_verify.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace verify_tests {
namespace {

using ism::MetaMesh;
using ism::Outcome;
using ism::Points2;
using ism::Side;
using ism::Status;
using ism::SurfaceMap;
using ism::detail::Vec2;
using ism::verification::DirectedEdge;
using shapes::Disk;
using shapes::Rng;

using Sides = std::vector<DirectedEdge>;

Eigen::Vector2d point(Vec2 p) { return {p.x, p.y}; }

bool is_embedding(const ism::TriangleMesh& mesh, const Points2& x, Outcome& outcome) {
  Sides boundary;
  return ism::verification::verify_embedding(mesh, x, Side::kA, boundary, outcome);
}

bool says(const Outcome& outcome, const std::string& words) {
  CAPTURE(outcome.message);
  return outcome.status == Status::kNumericalFailure &&
         outcome.message.find(words) != std::string::npos;
}

/// A map and its meta mesh, to be spoilt.
struct Spoilt {
  SurfaceMap map;
  Points2 f, g;
  MetaMesh meta;
  Sides boundary_a, boundary_b;

  explicit Spoilt(const SurfaceMap& m)
      : map(m),
        f(m.planar_positions(Side::kA)),
        g(m.planar_positions(Side::kB)),
        meta(m.meta_mesh(ism::Ids::kWhole)) {
    Outcome outcome;
    const ism::TriangleMesh& a = map.mesh(Side::kA, ism::Ids::kEmbedded);
    const ism::TriangleMesh& b = map.mesh(Side::kB, ism::Ids::kEmbedded);
    REQUIRE(ism::verification::verify_embedding(a, f, Side::kA, boundary_a, outcome));
    REQUIRE(ism::verification::verify_embedding(b, g, Side::kB, boundary_b, outcome));
  }

  Outcome outcome() const {
    Outcome outcome;
    ism::verification::MetaMeshVerifier(meta, f, g, map.period(), outcome)
        .run(boundary_a, boundary_b);
    return outcome;
  }

  void remove(int polygon) {
    const auto p = static_cast<std::ptrdiff_t>(polygon);
    const auto at = [](auto& v, std::ptrdiff_t i) { return v.begin() + i; };
    const int begin = meta.offsets[static_cast<std::size_t>(p)];
    const int end = meta.offsets[static_cast<std::size_t>(p) + 1];
    meta.face_a.erase(at(meta.face_a, p));
    meta.face_b.erase(at(meta.face_b, p));
    meta.corners.erase(at(meta.corners, begin), at(meta.corners, end));
    for (ism::Points3* x : {&meta.corner_a, &meta.corner_b}) {
      const ism::Points3 rest = x->bottomRows(x->rows() - end);
      x->middleRows(begin, rest.rows()) = rest;
      x->conservativeResize(x->rows() - (end - begin), Eigen::NoChange);
    }
    meta.offsets.erase(at(meta.offsets, p + 1));
    for (std::size_t i = static_cast<std::size_t>(p) + 1; i < meta.offsets.size(); ++i)
      meta.offsets[i] -= end - begin;
  }
};

/// Steps of a run, each of which is verified where it has a map.
int verified_steps(ism::Solver& solver) {
  int verified = 0;
  bool has_more = true;
  while (has_more) {
    has_more = solver.step();
    const SurfaceMap map(solver.result());
    if (!ism::is_usable(solver.result().status)) continue;
    const Outcome outcome = ism::verify_map(map);
    CAPTURE(outcome.message);
    CHECK(outcome.status == Status::kDone);
    ++verified;
  }
  return verified;
}

}  // namespace

TEST_CASE("areas of triangles in integers have the sign of the predicate") {
  Rng rng(3);
  int zeros = 0, different = 0;
  for (int i = 0; i < 300000; ++i) {
    const double scale = std::ldexp(1.0, rng.between(-390, 390));
    Vec2 p[3];
    for (Vec2& q : p) q = {scale * rng.between(-4, 4), scale * rng.between(-4, 4)};
    if (i % 2 == 1) p[2] = p[0] + rng.uniform(0.1, 3) * (p[1] - p[0]);
    const double expected = ism::detail::orient2d(p[0], p[1], p[2]);
    zeros += expected == 0;
    const int found = ism::verification::orientation(point(p[0]), point(p[1]), point(p[2]));
    different += found != (expected > 0) - (expected < 0);
  }
  CHECK(different == 0);
  CHECK(zeros > 10000);
}

TEST_CASE("the integers hold products of any doubles") {
  const double tiny = 0x1p-1074, huge = 0x1.fffffffffffffp1023;
  for (double x : {tiny, 3 * tiny, 0x1p-1022, 1.0, 1.5, huge})
    for (double y : {tiny, 7 * tiny, 0x1p-1000, 2.5, huge}) {
      ism::verification::ExactSum sum;
      for (int i = 0; i < 3; ++i) sum.add_product(x, y);
      CHECK(sum.sign() == 1);
      for (int i = 0; i < 3; ++i) sum.add_product(-x, y);
      CHECK(sum.sign() == 0);
      sum.add_product(tiny, -tiny);
      CHECK(sum.sign() == -1);
    }
}

TEST_CASE("every disk and every surface with openings is verified") {
  for (const Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    Outcome outcome;
    const bool is_verified = is_embedding(disk.mesh, disk.plane, outcome);
    CAPTURE(outcome.message);
    CHECK(is_verified);
    CHECK(ism::verify_map(shapes::map_of(disk, disk)).status == Status::kDone);
  }
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Rng rng(seed);
    const Disk a = shapes::with_openings(9, 7, rng);
    Disk b = shapes::with_openings(8, 9, rng);
    b.plane = shapes::moved(b.plane, shapes::rotation(0.3), {0.4, -0.2});
    const Outcome outcome = ism::verify_map(runs::good_map(a, b));
    CAPTURE(outcome.message);
    CHECK(outcome.status == Status::kDone);
  }
}

TEST_CASE("every iterate is verified, however the run goes on") {
  const auto [a, b] = runs::square_pair(5);
  ism::Options options = runs::on_one_thread();
  options.max_iterations = 8;
  for (const ism::Boundary boundary :
       {ism::Boundary::kFree, ism::Boundary::kFixed, ism::Boundary::kSlide}) {
    options.boundary = boundary;
    ism::Solver solver(a.mesh, b.mesh, {}, options);
    CHECK(verified_steps(solver) >= 8);
  }
  options.boundary = ism::Boundary::kFree;
  options.exact_landmarks = true;
  ism::Solver exact(a.mesh, b.mesh, {{20, 30}, {60, 90}}, options);
  CHECK(verified_steps(exact) >= 8);
  options.exact_landmarks = false;
  options.coarsest = 20;
  ism::Solver coarse(a.mesh, b.mesh, {}, options);
  CHECK(verified_steps(coarse) >= 8);
}

TEST_CASE("closed maps are verified, those of which one side is open as well") {
  const ism::TriangleMesh a = shapes::blob(2, 0.2, 4), b = shapes::blob(2, 0.15, 9);
  ism::Options options = runs::on_one_thread();
  options.max_iterations = 15;
  ism::Solver solver(a, b, {}, options);
  CHECK(verified_steps(solver) >= 10);
  CHECK(SurfaceMap(solver.result()).is_closed());
  const Disk disk = shapes::spherical_cap(4, 9, 1.5);
  ism::Solver half(a, disk.mesh, {}, options);
  CHECK(verified_steps(half) >= 10);
}

// Where they cross is then known to a hundred millionth along them, but the same in all polygons.
TEST_CASE("edges that are nearly parallel cross at one place") {
  ism::TriangleMesh mesh;
  mesh.triangles.resize(2, 3);
  mesh.triangles << 0, 1, 3, 1, 0, 2;
  Rng rng(5);
  const auto rhombus = [&](double slope) {
    Points2 x(4, 2);
    x << -1, -slope, 1, slope, 0.1, -1, -0.1, 1;
    for (int v = 0; v < 4; ++v) x(v, 0) += rng.uniform(-0.2, 0.2);
    x(0, 1) += rng.uniform(-slope, slope) / 2;
    return x;
  };
  for (double slope : {1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13})
    for (int i = 0; i < 20; ++i) {
      CAPTURE(slope);
      const Points2 f = rhombus(slope), g = rhombus(-slope);
      mesh.vertices = ism::Points3::Zero(4, 3);
      mesh.vertices.leftCols<2>() = f;
      ism::TriangleMesh b = mesh;
      b.vertices.leftCols<2>() = g;
      const Outcome outcome = ism::verify_map(SurfaceMap(mesh, b, f, g));
      CAPTURE(outcome.message);
      CHECK(outcome.status == Status::kDone);
    }
}

TEST_CASE("a map that is none is not verified") {
  CHECK(ism::verify_map(SurfaceMap()).status == Status::kNoMapYet);
  Disk a = shapes::grid(3, 3);
  std::swap(a.plane(5, 0), a.plane(6, 0));
  CHECK(ism::verify_map(shapes::map_of(a, a)).status == Status::kInvalidPositions);
}

TEST_CASE("embeddings that are not injective are found") {
  Outcome outcome;
  SUBCASE("a triangle that is flipped") {
    Disk disk = shapes::grid(4, 4);
    disk.plane.row(6) = disk.plane.row(8);
    CHECK_FALSE(is_embedding(disk.mesh, disk.plane, outcome));
    CHECK(says(outcome, "is not positive"));
    REQUIRE(outcome.ids.size() == 1);
    CHECK(outcome.ids[0].element == ism::Element::kFace);
  }
  SUBCASE("a triangle without area") {
    Disk disk = shapes::single_triangle();
    disk.plane << 0.1, 0.1, 0.2, 0.2, 0.3, 0.3;  // not in doubles
    const int sign = ism::verification::orientation({0.1, 0.1}, {0.2, 0.2}, {0.3, 0.3});
    CHECK(sign == 0);
    CHECK_FALSE(is_embedding(disk.mesh, disk.plane, outcome));
  }
  SUBCASE("a number that is none") {
    Disk disk = shapes::grid(2, 2);
    disk.plane(3, 1) = std::nan("");
    CHECK_FALSE(is_embedding(disk.mesh, disk.plane, outcome));
    CHECK(says(outcome, "vertex 3 of A has no planar position"));
  }
  SUBCASE("a triangle with the corners of another one") {
    Disk disk = shapes::grid(3, 3);
    disk.mesh.triangles.row(4) = disk.mesh.triangles.row(5);
    CHECK_FALSE(is_embedding(disk.mesh, disk.plane, outcome));
    CHECK(says(outcome, "has a side that another one has"));
  }
  SUBCASE("a strip that winds around and meets itself") {
    const Disk apart = shapes::slit_ring(40, 0.01, 3), over = shapes::slit_ring(40, -0.5, 3);
    CHECK(is_embedding(apart.mesh, apart.plane, outcome));
    CHECK_FALSE(is_embedding(over.mesh, over.plane, outcome));
    CHECK(says(outcome, "the boundary meets itself"));
  }
  SUBCASE("a strip whose ends touch") {
    Disk touching = shapes::slit_ring(8, 0, 3);
    for (int v = 0; v < touching.plane.rows(); ++v)
      if (std::abs(touching.plane(v, 1)) < 1e-9) touching.plane(v, 1) = 0;
    CHECK_FALSE(is_embedding(touching.mesh, touching.plane, outcome));
    CHECK(says(outcome, "the boundary meets itself"));
  }
  SUBCASE("a fan that goes around its centre twice") {
    Disk fan = shapes::fan(9);
    for (int i = 0; i < 9; ++i)
      fan.plane.row(1 + i) << std::cos(4 * shapes::kPi * i / 9), std::sin(4 * shapes::kPi * i / 9);
    CHECK_FALSE(is_embedding(fan.mesh, fan.plane, outcome));
    CHECK(says(outcome, "the boundary meets itself"));
  }
  SUBCASE("an opening turned inside out") {
    // A square ring whose inner loop lies outside of the outer one: triangles cannot all be
    // positive then, so it is the boundary that is looked at alone.
    Points2 x(8, 2);
    x << 0, 0, 4, 0, 4, 4, 0, 4, 6, 1, 6, 2, 7, 2, 7, 1;
    Sides boundary;
    for (int i = 0; i < 4; ++i) {
      boundary.push_back({i, (i + 1) % 4, 0});
      boundary.push_back({4 + i, 4 + (i + 1) % 4, 0});
    }
    CHECK_FALSE(ism::verification::BoundarySweep(x, boundary).run());  // clockwise, around nothing
    x.bottomRows<4>().col(0).array() -= 5;
    CHECK(ism::verification::BoundarySweep(x, boundary).run());  // clockwise, inside: an opening
    for (DirectedEdge& side : boundary) std::swap(side.u, side.v);
    CHECK_FALSE(ism::verification::BoundarySweep(x, boundary).run());
  }
}

TEST_CASE("the sweep finds what all pairs of segments say") {
  int simple = 0, tangled = 0;
  for (std::uint64_t seed = 0; seed < 4000; ++seed) {
    Rng rng(seed);
    const int n = rng.between(3, 7);
    Points2 x(n, 2);  // a closed polygon on a small lattice, star-shaped every other time
    for (int i = 0; i < n; ++i) {
      const double angle = 2 * shapes::kPi * i / n, r = rng.between(1, 4);
      if (seed % 2 == 0)
        x.row(i) << std::round(2 * r * std::cos(angle)), std::round(2 * r * std::sin(angle));
      else
        x.row(i) << rng.between(0, 4), rng.between(0, 4);
    }
    Sides boundary;
    for (int i = 0; i < n; ++i) boundary.push_back({i, (i + 1) % n, 0});
    bool expected = true;
    double area = 0;
    const auto at = [&](int i) { return ism::detail::row2(x, i % n); };
    for (int i = 0; i < n; ++i) {
      area += ism::detail::cross(at(i), at(i + 1));
      expected =
          expected && at(i) != at(i + 1) && !ism::detail::turns_back(at(i), at(i + 1), at(i + 2));
      for (int j = i + 2; j < n && !(i == 0 && j == n - 1); ++j)
        expected = expected && !ism::detail::segments_touch(at(i), at(i + 1), at(j), at(j + 1));
    }
    expected = expected && area > 0;
    ++(expected ? simple : tangled);
    CAPTURE(seed);
    CHECK(ism::verification::BoundarySweep(x, boundary).run() == expected);
  }
  CHECK(simple > 200);
  CHECK(tangled > 200);
}

TEST_CASE("meta meshes that are wrong are found") {
  const auto [a, b] = shapes::overlapping_pair(21);
  Spoilt map(runs::good_map(a, b));
  REQUIRE(map.outcome().status == Status::kDone);
  const int n = map.meta.n_polygons();
  SUBCASE("a polygon is left out") {
    for (int p = 0; p < n; p += 7) {
      Spoilt less = map;
      less.remove(p);
      CHECK(says(less.outcome(), "has no neighbour at one side"));
    }
  }
  SUBCASE("a polygon of another pair of triangles") {
    map.meta.face_a[3] = (map.meta.face_a[3] + 1) % static_cast<int>(a.mesh.triangles.rows());
    CHECK(says(map.outcome(), "has a corner at two places"));
  }
  SUBCASE("two corners in the wrong order") {
    std::swap(map.meta.corners[0], map.meta.corners[1]);
    CHECK(says(map.outcome(), "has a corner at two places"));
  }
  SUBCASE("a vertex of the meta mesh that lies elsewhere") {
    map.meta.on_b.row(2) *= 1.0001;
    CHECK(says(map.outcome(), "has a corner at two places"));
  }
  SUBCASE("a polygon that is there twice") {
    map.meta.face_a[1] = map.meta.face_a[0];
    map.meta.face_b[1] = map.meta.face_b[0];
    CHECK(map.outcome().status == Status::kNumericalFailure);
  }
}

TEST_CASE("a closed map that has a hole is found") {
  ism::Options options = runs::on_one_thread();
  options.max_iterations = 5;
  const ism::Result result =
      ism::compute_map(shapes::blob(1, 0.2, 4), shapes::blob(1, 0.15, 9), {}, options);
  REQUIRE(SurfaceMap(result).is_closed());
  Spoilt map{SurfaceMap(result)};
  CHECK(map.outcome().status == Status::kDone);
  for (int p = 0; p < map.meta.n_polygons(); p += 11) {
    Spoilt less = map;
    less.remove(p);
    CHECK(says(less.outcome(), "has no neighbour at one side"));
  }
}

TEST_CASE("the two sides of a cut have to fit, without rounding") {
  ism::Options options = runs::on_one_thread();
  options.max_iterations = 3;
  const ism::Result result =
      ism::compute_map(shapes::blob(1, 0.2, 4), shapes::blob(1, 0.15, 9), {}, options);
  const SurfaceMap map(result);
  REQUIRE(map.is_closed());
  const ism::TriangleMesh& mesh = map.mesh(Side::kA, ism::Ids::kEmbedded);
  const auto verdict = [&](const Points2& x) {
    ism::Outcome outcome;
    Sides boundary;
    if (ism::verification::verify_embedding(mesh, x, Side::kA, boundary, outcome))
      ism::verification::verify_pillow(mesh, x, Side::kA, map.period(), boundary, outcome);
    return outcome;
  };
  const Points2 f = map.planar_positions(Side::kA);
  CHECK(verdict(f).status == Status::kDone);
  Points2 x = f;
  x(x.rows() - 1, 0) += 0x1p-40;  // a copy
  CHECK(says(verdict(x), "the two sides of the cut do not fit"));
  x = f;
  x.col(1).array() += 0x1p-20;  // half-turns about other points
  CHECK(says(verdict(x), "the two sides of the cut do not fit"));
  x = f;
  x(0, 0) += 0x1p-52;
  CHECK(says(verdict(x), "may be moved with rounding"));
}

}  // namespace verify_tests

#endif  // ISM_TESTS_PART_VERIFY_HPP

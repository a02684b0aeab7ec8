// Surfaces with openings: closed to be embedded, mapped as they are.

#ifndef ISM_TESTS_PART_OPENINGS_HPP
#define ISM_TESTS_PART_OPENINGS_HPP

#include "ism.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace openings_tests {
namespace {

using namespace ism::detail;
using Eigen::Vector2d;
using ism::Landmark;
using ism::Options;
using ism::Points2;
using ism::Result;
using ism::Side;
using ism::Status;
using ism::SurfaceMap;
using ism::SurfacePoint;
using runs::on_one_thread;
using shapes::Disk;
using shapes::half_edges;
using shapes::Rng;

/// A square plate around a grid of openings, bent; the vertices of its outer corners.
Disk plate(int n, double bend, Rng& rng) {
  Disk disk = shapes::with_openings(n, n, rng);
  shapes::bend(disk, bend);
  return disk;
}

void check_usable(const Result& r) {
  CAPTURE(r.message);
  REQUIRE(ism::is_usable(r.status));
  CHECK(is_injective(half_edges(*r.start.a), r.start.f));
  CHECK(is_injective(half_edges(*r.start.b), r.start.g));
  CHECK(is_injective(half_edges(*r.start.a), r.f));
  CHECK(is_injective(half_edges(*r.start.b), r.g));
}

}  // namespace

TEST_CASE("the outer loop is the longest or the one asked for") {
  const Disk disk = shapes::frame(9, 3);
  const Surface s = build_surface(disk.mesh, true);
  const auto length = [&](int loop) { return s.mesh.loop[loop + 1] - s.mesh.loop[loop]; };
  CHECK(length(outer_loop(s, -1)) == 36);
  for (int loop : {0, 1})
    CHECK(outer_loop(s, s.mesh.tail[s.mesh.boundary[s.mesh.loop[loop]]]) == loop);
}

TEST_CASE("a surface with openings is mapped to another meshing of itself") {
  Rng rng(3);
  Disk a = shapes::frame(12, 4);
  Disk b = a;
  for (int k = 0; k < 600; ++k) shapes::flip_random_edge(b, rng);
  b.mesh.vertices = a.mesh.vertices;
  shapes::bend(a, 0.3);
  b.mesh.vertices = a.mesh.vertices;
  std::vector<Landmark> landmarks;
  for (int v : {0, 12, 77, 140}) landmarks.push_back({v, v});
  const Result r = ism::compute_map(a.mesh, b.mesh, landmarks, on_one_thread());
  check_usable(r);
  CHECK(r.status == Status::kConverged);
  CHECK(r.final_state().coverage_a > 0.97);
  CHECK(r.final_state().mean_distortion < 2.02);
  const SurfaceMap map(r);
  double largest = 0;
  for (int v = 0; v < a.mesh.vertices.rows(); ++v) {
    const SurfacePoint image = map.forward_vertex(v);
    if (!image.exists()) continue;
    largest =
        std::max(largest, (map.position_on_b(image).transpose() - a.mesh.vertices.row(v)).norm());
  }
  CHECK(largest < 0.5);  // of a cell
}

TEST_CASE("what lies over an opening is not covered") {
  const Disk a = shapes::grid(12, 12);
  Disk b = shapes::cells(12, 12, [](int i, int j) {
    return !(i >= 3 && i < 6 && j >= 3 && j < 6) && !(i == 8 && j == 8);
  });
  bool coincide = false;
  SUBCASE("as it is") { coincide = true; }
  SUBCASE("turned") { b.plane = shapes::moved(b.plane, shapes::rotation(0.2), {2, -1}); }
  Options options = shapes::from_planes(a, b);
  options.max_iterations = 0;
  const Result r = ism::compute_map(a.mesh, b.mesh, {}, options);
  check_usable(r);
  const SurfaceMap map(r);
  if (coincide) {
    CHECK(r.initial.coverage_a == doctest::Approx(1 - 10.0 / 144));
    CHECK(r.initial.coverage_b == doctest::Approx(1));
  }
  int uncovered = 0;
  for (const SurfacePoint& image : map.forward_vertices()) uncovered += !image.exists();
  CHECK(uncovered >= 4);  // inside the large opening
}

TEST_CASE("plates with different openings are mapped, with all constraints that exist there") {
  for (std::uint64_t seed : {5u, 6u, 7u}) {
    CAPTURE(seed);
    Rng rng(seed);
    const Disk a = plate(11, 0.5, rng), b = plate(10, -0.4, rng);
    Options options = on_one_thread();
    options.max_iterations = 25;
    const std::vector<Landmark> landmarks = {{0, 0},
                                             {11, 10},
                                             {static_cast<int>(a.mesh.vertices.rows()) - 1,
                                              static_cast<int>(b.mesh.vertices.rows()) - 1}};
    SUBCASE("free") {}
    SUBCASE("exact landmarks") { options.exact_landmarks = true; }
    SUBCASE("pins") {  // one that does not lie in an opening of B at the start
      options.max_iterations = 1;
      const SurfaceMap start(ism::compute_map(a.mesh, b.mesh, landmarks, options).start);
      options.max_iterations = 25;
      int v = 12;
      while (!start.forward_vertex(v).exists()) ++v;
      options.pins_a = {v};
    }
    const Result r = ism::compute_map(a.mesh, b.mesh, landmarks, options);
    check_usable(r);
    CHECK(r.final_state().energy < r.initial.energy);
    const SurfaceMap map(r);
    CHECK(map.status() == Status::kDone);
    if (options.exact_landmarks) CHECK(r.start.landmark_distance == 0);
  }
}

TEST_CASE("without landmarks, rotations are tried on surfaces with openings, too") {
  Rng rng(9);
  const Disk a = plate(9, 0.5, rng), b = plate(9, 0.5, rng);
  Options options = on_one_thread();
  options.max_iterations = 10;
  check_usable(ism::compute_map(a.mesh, b.mesh, {}, options));
}

TEST_CASE("exact landmarks on several loops are in order whatever the order of triangles") {
  const Disk full = shapes::grid(6, 6);
  ism::TriangleMesh a = full.mesh;
  std::vector<int> kept;
  for (int f = 0; f < a.triangles.rows(); ++f) {
    Eigen::RowVector2d middle = Eigen::RowVector2d::Zero();
    for (int k = 0; k < 3; ++k) middle += full.plane.row(a.triangles(f, k)) / 3;
    if ((middle - Eigen::RowVector2d(3, 3)).lpNorm<Eigen::Infinity>() > 1) kept.push_back(f);
  }
  ism::Triangles triangles(static_cast<int>(kept.size()), 3);
  for (std::size_t i = 0; i < kept.size(); ++i)
    triangles.row(static_cast<Eigen::Index>(i)) = full.mesh.triangles.row(kept[i]);
  a.triangles = triangles;
  a = *ism::prepare(a).mesh;
  const auto at = [&](double x, double y) {
    for (int v = 0; v < a.vertices.rows(); ++v)
      if (a.vertices(v, 0) == x && a.vertices(v, 1) == y) return v;
    return -1;
  };
  std::vector<Landmark> landmarks;
  for (int v : {at(0, 0), at(6, 6), at(2, 2), at(4, 4)}) landmarks.push_back({v, v});
  Options options = on_one_thread();
  options.exact_landmarks = true;
  const int n = static_cast<int>(a.triangles.rows());
  for (int shift = 0; shift < n; shift += 7) {
    ism::TriangleMesh b = a;
    for (int f = 0; f < n; ++f) b.triangles.row(f) = a.triangles.row((f + shift) % n);
    const ism::Embedding start = ism::initial_embedding(a, b, landmarks, options);
    CAPTURE(start.message);
    CHECK(start.status == Status::kDone);
  }
}

TEST_CASE("options that openings leave no room for are refused") {
  const Disk a = shapes::frame(8, 2), b = shapes::grid(8, 8);
  Options options = on_one_thread();
  options.boundary = ism::Boundary::kSlide;
  Result r = ism::compute_map(b.mesh, a.mesh, {}, options);
  CHECK(r.status == Status::kInvalidOptions);
  CHECK(r.message ==
        "boundaries cannot be held on closed surfaces or those with openings, and B has openings");
  options = on_one_thread();
  options.outer_a = 1000;
  r = ism::compute_map(a.mesh, b.mesh, {}, options);
  CHECK(r.status == Status::kInvalidOptions);
  CHECK(r.message == "outer_a: vertex 1000 is on no boundary of A");
  CHECK(r.ids == shapes::Ids{shapes::of_a(1000)});
  options.outer_a = -1;
  options.outer_b = 40;  // inside
  CHECK(ism::compute_map(a.mesh, b.mesh, {}, options).ids == shapes::Ids{shapes::of_b(40)});
  options.outer_b = -1;
  options.max_iterations = 5;
  for (const int h : half_edges(a.mesh).boundary) {  // inside out
    const Surface s = build_surface(a.mesh, true);
    const int v = s.mesh.tail[h];
    if (outer_loop(s, v) == outer_loop(s, -1)) continue;
    options.outer_a = v;
    check_usable(ism::compute_map(a.mesh, b.mesh, {{0, 0}, {70, 70}}, options));
    break;
  }
}

}  // namespace openings_tests

#endif  // ISM_TESTS_PART_OPENINGS_HPP

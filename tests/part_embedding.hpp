// The initial embedding: decimation, its reversal, and injectivity on hostile shapes.

#ifndef ISM_TESTS_PART_EMBEDDING_HPP
#define ISM_TESTS_PART_EMBEDDING_HPP

#include "ism.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace embedding_tests {
namespace {

using namespace ism::detail;
using Eigen::Vector2d;
using Eigen::Vector3d;
using ism::Embedding;
using ism::Landmark;
using ism::Points2;
using ism::Status;
using ism::TriangleMesh;
using runs::on_one_thread;
using shapes::Disk;
using shapes::eigen;
using shapes::half_edges;
using shapes::Rng;

int n_vertices(const TriangleMesh& mesh) { return static_cast<int>(mesh.vertices.rows()); }

// ---- hostile shapes ----

/// Rings of `sectors` vertices around an axis, and an apex that closes the last one.
TriangleMesh surface_of_revolution(const std::vector<Vector2d>& radius_and_height, double apex,
                                   int sectors) {
  const int rings = static_cast<int>(radius_and_height.size()), top = rings * sectors;
  TriangleMesh mesh;
  mesh.vertices.resize(top + 1, 3);
  std::vector<std::array<int, 3>> triangles;
  const auto id = [&](int r, int s) { return r * sectors + s % sectors; };
  for (int r = 0; r < rings; ++r)
    for (int s = 0; s < sectors; ++s) {
      const Vector2d& p = radius_and_height[static_cast<std::size_t>(r)];
      const double angle = 2 * shapes::kPi * s / sectors;
      mesh.vertices.row(id(r, s)) << p.x() * std::cos(angle), p.x() * std::sin(angle), p.y();
      if (r + 1 == rings) {
        triangles.push_back({id(r, s), id(r, s + 1), top});
      } else {
        triangles.push_back({id(r, s), id(r, s + 1), id(r + 1, s + 1)});
        triangles.push_back({id(r, s), id(r + 1, s + 1), id(r + 1, s)});
      }
    }
  mesh.vertices.row(top) << 0, 0, apex;
  mesh.triangles.resize(static_cast<int>(triangles.size()), 3);
  int row = 0;
  for (const auto& t : triangles) mesh.triangles.row(row++) << t[0], t[1], t[2];
  return mesh;
}

/// A tube `length` times as long as its radius, closed at one end; its boundary is the other end.
TriangleMesh limb(int length, int sectors) {
  std::vector<Vector2d> profile;
  for (int r = 0; r < length; ++r) profile.push_back(Vector2d(1, r));
  return surface_of_revolution(profile, length, sectors);
}

/// A sphere without one triangle, of which nearly all area lies behind three edges.
TriangleMesh punctured_sphere(int rings, int sectors) {
  std::vector<Vector2d> profile;
  for (int r = 1; r <= rings; ++r) {
    const double angle = shapes::kPi * (1 - static_cast<double>(r) / (rings + 1));
    profile.push_back(Vector2d(std::sin(angle), std::cos(angle)));
  }
  const TriangleMesh open = surface_of_revolution(profile, 1, sectors);
  TriangleMesh mesh = open;  // close the first ring but for one triangle
  const int bottom = n_vertices(open), faces = static_cast<int>(open.triangles.rows());
  mesh.vertices.conservativeResize(bottom + 1, Eigen::NoChange);
  mesh.vertices.row(bottom) << 0, 0, -1;
  mesh.triangles.conservativeResize(faces + sectors - 1, Eigen::NoChange);
  for (int s = 1; s < sectors; ++s)
    mesh.triangles.row(faces + s - 1) << (s + 1) % sectors, s, bottom;
  return mesh;
}

/// Isosceles triangles around a point with apex angles of one degree, and of 30 behind `end`
/// degrees.
Disk slivers(int end) {
  shapes::DiskBuilder builder;
  builder.vertex(0, 0);
  std::vector<int> ring;
  for (int degrees = 0; degrees < 360; degrees += degrees < end ? 1 : 30) {
    const double phi = shapes::kPi / 180 * degrees;
    ring.push_back(builder.vertex(std::cos(phi), std::sin(phi)));
  }
  for (std::size_t i = 0; i < ring.size(); ++i)
    builder.triangle(0, ring[i], ring[(i + 1) % ring.size()]);
  return builder.build();
}

/// A grid squeezed until its triangles are needles.
Disk needles(int nx, int ny, double squeeze) {
  Disk disk = shapes::grid(nx, ny);
  disk.plane.col(1) *= squeeze;
  disk.mesh.vertices.col(1) *= squeeze;
  return disk;
}

/// A grid folded up to four squares on top of each other, so that many vertices are in one place.
Disk folded_grid(int nx, int ny) {
  Disk disk = shapes::grid(nx, ny);
  for (int v = 0; v < disk.plane.rows(); ++v)
    for (int c = 0; c < 2; ++c) disk.mesh.vertices(v, c) = std::fmod(disk.plane(v, c), 2);
  return disk;
}

/// A disk of rings of 4 vertices, each `ratio` times as large as the next.
Disk graded_disk(int rings, double ratio) {
  Disk disk = shapes::spherical_cap(rings, 4, 1);
  for (int v = 0; v < disk.plane.rows(); ++v) {
    const int ring = (v + 3) / 4;  // 0: the centre
    disk.plane.row(v) *= ring > 0 ? std::pow(ratio, rings - ring) * rings / ring : 0;
  }
  disk.mesh.vertices.leftCols<2>() = disk.plane;
  disk.mesh.vertices.col(2).setZero();
  return disk;
}

/// A fan of n spikes around a centre.
Disk spikes(int n, double inner) {
  Disk disk = shapes::fan(2 * n);
  for (int v = 2; v < disk.plane.rows(); v += 2) disk.plane.row(v) *= inner;
  disk.mesh.vertices.leftCols<2>() = disk.plane;
  return disk;
}

struct Named {
  std::string name;
  TriangleMesh mesh;
};

Named bent_disk(int nx, int ny) {
  Rng rng(31);
  Disk bent = shapes::random_disk(nx, ny, rng);
  shapes::bend(bent, 1.5);
  return {"bent", bent.mesh};
}

std::vector<Named> hostile_meshes() {
  return {{"triangle", shapes::single_triangle().mesh},
          {"two triangles", shapes::strip(1).mesh},
          {"strip", shapes::strip(100).mesh},
          {"fan", shapes::fan(200).mesh},
          {"comb", shapes::comb(4, 3).mesh},
          {"limbs", shapes::limbs(5, 12, 0.05).mesh},
          {"limb", limb(60, 5)},
          {"thin limb", limb(60, 3)},
          {"punctured sphere", punctured_sphere(12, 14)},
          {"slivers", slivers(360).mesh},
          {"needles", needles(12, 8, 1e-3).mesh},
          {"spikes", spikes(100, 0.003).mesh},
          {"folded", folded_grid(28, 28).mesh},
          {"folded strip", folded_grid(6, 80).mesh},
          {"graded", graded_disk(9, 1e-3).mesh},
          bent_disk(9, 8)};
}

/// The same with fewer triangles, for what takes longer.
std::vector<Named> smaller_hostile_meshes() {
  return {{"triangle", shapes::single_triangle().mesh},
          {"two triangles", shapes::strip(1).mesh},
          {"strip", shapes::strip(60).mesh},
          {"fan", shapes::fan(60).mesh},
          {"comb", shapes::comb(4, 3).mesh},
          {"limbs", shapes::limbs(5, 8, 0.05).mesh},
          {"limb", limb(24, 5)},
          {"thin limb", limb(60, 3)},
          {"punctured sphere", punctured_sphere(9, 10)},
          {"slivers", slivers(90).mesh},
          {"needles", needles(9, 6, 1e-3).mesh},
          {"spikes", spikes(60, 0.003).mesh},
          {"folded", folded_grid(28, 28).mesh},
          {"folded strip", folded_grid(6, 80).mesh},
          {"graded", graded_disk(9, 1e-3).mesh},
          bent_disk(7, 6)};
}

// ---- checks ----

void check_embeds(const TriangleMesh& a, const TriangleMesh& b,
                  const std::vector<Landmark>& landmarks = {},
                  ism::Boundary boundary = ism::Boundary::kFree) {
  REQUIRE(ism::validate(a).empty());
  REQUIRE(ism::validate(b).empty());
  ism::Options options = on_one_thread();
  options.candidates = false;  // the embedding itself, not what guides it
  options.boundary = boundary;
  const HalfEdgeMesh m = half_edges(a);
  if (m.loops() == 1) options.outer_a = m.tail[m.boundary[0]];  // so limbs are not closed
  const Embedding e = ism::initial_embedding(a, b, landmarks, options);
  CAPTURE(e.message);
  CHECK(e.status == Status::kDone);
  if (e.status != Status::kDone) return;
  REQUIRE(e.f.rows() == a.vertices.rows() + static_cast<int>(e.added_a.size()));
  REQUIRE(e.g.rows() == b.vertices.rows() + static_cast<int>(e.added_b.size()));
  CHECK(is_injective(half_edges(*e.a), e.f));
  CHECK(is_injective(half_edges(*e.b), e.g));
  CHECK(std::isfinite(e.landmark_distance));
}

/// Every vertex i of one mesh with vertex i of the other, as far as both have it.
std::vector<Landmark> first_landmarks(const TriangleMesh& a, const TriangleMesh& b, int most) {
  std::vector<Landmark> landmarks;
  for (int v = 0; v < std::min({n_vertices(a), n_vertices(b), most}); ++v)
    landmarks.push_back({v, v});
  return landmarks;
}

std::vector<std::array<int, 3>> canonical_faces(const DynamicMesh& m) {
  std::vector<std::array<int, 3>> faces;
  for (int f = 0; f < m.face.size(); ++f)
    if (m.alive[f]) faces.push_back(m.face[f]);
  return faces;
}

struct Snapshot {
  std::vector<std::array<int, 3>> all_corners, living;
  std::vector<std::vector<int>> faces_of;
  std::vector<int> loop;
};

Snapshot snapshot(const DynamicMesh& m) {
  Snapshot s;
  s.all_corners.assign(m.face.begin(), m.face.end());
  s.living = canonical_faces(m);
  for (int v = 0; v < m.faces_of.size(); ++v) {
    s.faces_of.emplace_back();
    for (int f : m.faces_of[v]) s.faces_of.back().push_back(f);
    std::sort(s.faces_of.back().begin(), s.faces_of.back().end());
  }
  int start = 0;  // the first vertex on the boundary that is still there
  while (!m.on_boundary(start) || m.faces_of[start].empty()) ++start;
  int v = start;
  do {
    s.loop.push_back(v);
    v = m.boundary_next[v];
  } while (v != start && static_cast<int>(s.loop.size()) <= m.boundary.size());
  return s;
}

void check_same(const Snapshot& s, const Snapshot& t) {
  CHECK(s.all_corners == t.all_corners);
  CHECK(s.living == t.living);
  CHECK(s.faces_of == t.faces_of);
  CHECK(s.loop == t.loop);
}

/// The living faces as a mesh of their own, on the points given.
TriangleMesh compact(const DynamicMesh& m, const ism::Points3& points) {
  std::vector<int> place(static_cast<std::size_t>(m.faces_of.size()), -1);
  TriangleMesh mesh;
  int n = 0;
  mesh.vertices.resize(points.rows(), 3);
  for (int v = 0; v < m.faces_of.size(); ++v) {
    if (m.faces_of[v].empty()) continue;
    mesh.vertices.row(n) = points.row(v);
    place[static_cast<std::size_t>(v)] = n++;
  }
  mesh.vertices.conservativeResize(n, Eigen::NoChange);
  const std::vector<std::array<int, 3>> faces = canonical_faces(m);
  mesh.triangles.resize(static_cast<int>(faces.size()), 3);
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k)
      mesh.triangles(static_cast<int>(f), static_cast<int>(k)) =
          place[static_cast<std::size_t>(faces[f][k])];
  return mesh;
}

/// Points no three of which are collinear, so that only the connectivity can be invalid.
ism::Points3 points_on_curve(int n) {
  ism::Points3 points(n, 3);
  for (int i = 0; i < n; ++i) {
    const double t = static_cast<double>(i) / n;
    points.row(i) << t, t * t, t * t * t;
  }
  return points;
}

}  // namespace

// ---- decimation ----

TEST_CASE("undoing collapses restores faces and boundary exactly, one by one") {
  for (const Named& shape : hostile_meshes()) {
    CAPTURE(shape.name);
    const Surface s = build_surface(shape.mesh, true);
    DynamicMesh mesh(s.mesh);
    Rng rng(32);
    std::vector<Snapshot> before;
    std::vector<Collapse> collapses;
    for (int i = 0; i < 200; ++i) {
      const int u = rng.below(n_vertices(shape.mesh));
      const Array<int> ring = mesh.neighbours(u);
      if (ring.empty()) continue;
      const int v = ring[rng.below(ring.size())];
      if (!mesh.may_collapse(u, v, ring)) continue;
      before.push_back(snapshot(mesh));
      collapses.push_back(mesh.collapse(u, v));
      CHECK(mesh.faces_of[u].empty());
    }
    CHECK((n_vertices(shape.mesh) == 3 || !collapses.empty()));
    while (!collapses.empty()) {
      mesh.undo(collapses.back());
      check_same(snapshot(mesh), before.back());
      collapses.pop_back();
      before.pop_back();
    }
  }
}

TEST_CASE("every permitted collapse leaves a disk") {
  Rng rng(33);
  for (int round = 0; round < 6; ++round) {
    const Disk disk = shapes::random_disk(4, 3, rng);
    const ism::Points3 points = points_on_curve(static_cast<int>(disk.plane.rows()));
    DynamicMesh mesh(half_edges(disk.mesh));
    int done = 0;
    for (int i = 0; i < 2000; ++i) {
      const int u = rng.below(static_cast<int>(disk.plane.rows()));
      const Array<int> ring = mesh.neighbours(u);
      if (ring.empty()) continue;
      const int v = ring[rng.below(ring.size())];
      if (!mesh.may_collapse(u, v, ring)) continue;
      mesh.collapse(u, v);
      ++done;
      const TriangleMesh left = compact(mesh, points);
      const std::vector<ism::Problem> problems = ism::validate(left);
      CHECK_MESSAGE(problems.empty(), problems[0].message);
      int on_boundary = 0;
      for (int w : mesh.boundary) on_boundary += mesh.is_present(w);
      CHECK(half_edges(left).boundary.size() == on_boundary);
    }
    CHECK(done == disk.plane.rows() - 3);  // until a single triangle is left
  }
}

TEST_CASE("decimation leaves a valid disk of the size asked for") {
  for (const Named& shape : hostile_meshes()) {
    CAPTURE(shape.name);
    const Surface s = build_surface(shape.mesh, true);
    const Array<char> free(s.mesh.n_vertices, 0);
    const Executor executor{on_one_thread()};
    const Hierarchy h(s, ism::Side::kA, free, Hierarchy::kBase, nullptr, -1, executor);
    CHECK(h.active() <= std::max(Hierarchy::kBase, 3));
    CHECK(h.is_full() == (s.mesh.n_vertices <= Hierarchy::kBase));
    const Level level = h.current();
    CHECK(level.surface.mesh.n_vertices == h.active());
    TriangleMesh left;
    left.vertices = level.surface.vertices;
    left.triangles.resize(level.surface.mesh.n_faces, 3);
    for (int f = 0; f < left.triangles.rows(); ++f)
      for (int k = 0; k < 3; ++k) left.triangles(f, k) = level.surface.mesh.corner(f, k);
    const std::vector<ism::Problem> problems = ism::validate(left);
    CHECK_MESSAGE(problems.empty(), problems[0].message);
    for (int i = 0; i < level.vertex.size(); ++i) {
      CHECK(level.place[level.vertex[i]] == i);
      CHECK(left.vertices.row(i) == s.vertices.row(level.vertex[i]));
    }
  }
}

TEST_CASE("decimation keeps protected vertices while there are others") {
  Rng rng(34);
  const Disk disk = shapes::random_disk(9, 9, rng);
  const Surface s = build_surface(disk.mesh, true);
  Array<char> is_protected(s.mesh.n_vertices, 0);
  for (int v = 0; v < 30; ++v) is_protected[4 * v] = 1;
  const Executor executor{on_one_thread()};
  const Level level =
      Hierarchy(s, ism::Side::kA, is_protected, Hierarchy::kBase, nullptr, -1, executor).current();
  for (int v = 0; v < 30; ++v) CHECK(level.place[4 * v] >= 0);
}

TEST_CASE("a fan around two vertices is embedded from a smaller base") {
  constexpr int n = 100;  // vertices between the two
  TriangleMesh mesh = {ism::Points3(n + 2, 3), ism::Triangles(2 * n - 1, 3)};
  mesh.vertices.row(n) << -1, 0, 0;
  mesh.vertices.row(n + 1) << 1, 0, 0;
  for (int i = 0; i < n; ++i) {
    mesh.vertices.row(i) << 0, 1 - i / double{n}, 0;
    mesh.triangles.row(2 * i) << i, n, (i + 1 < n ? i + 1 : n + 1);
    if (i + 1 < n) mesh.triangles.row(2 * i + 1) << i, i + 1, n + 1;
  }
  const Surface s = build_surface(mesh, true);
  const Array<char> free(s.mesh.n_vertices, 0);
  const Executor executor{on_one_thread()};
  const auto embeds = [&](int base) {
    return Hierarchy(s, ism::Side::kA, free, base, nullptr, -1, executor).embed_base();
  };
  CHECK(!embeds(Hierarchy::kBase));
  CHECK(embeds(Hierarchy::kSmallBase));
  const ism::Embedding start = ism::initial_embedding(mesh, mesh, {}, on_one_thread());
  CHECK(start.status == Status::kDone);
}

TEST_CASE("a mesh refined from its base has every vertex and is embedded at every level") {
  // With a free boundary a vertex may find no room where a surface is folded sharply.
  for (const Named& shape : hostile_meshes())
    for (const bool on_circle : {false, true}) {
      CAPTURE(shape.name);
      CAPTURE(on_circle);
      const Surface s = build_surface(shape.mesh, false);
      const Array<char> free(s.mesh.n_vertices, 0);
      const Executor executor{on_one_thread()};
      const Outline circle = circle_for(s, outer_loop(s, -1));
      Hierarchy h(s, ism::Side::kA, free, Hierarchy::kBase, on_circle ? &circle : nullptr, -1,
                  executor);
      CHECK(h.embed_base());
      int stuck = -1;
      while (!h.is_full() && stuck < 0) {
        const int target = 2 * h.active();
        h.set_goal(target);
        stuck = h.grow();
        CHECK(h.active() <= std::min(target, s.mesh.n_vertices));
        const Level level = h.current();
        Points2 x = h.positions(level);
        CHECK(is_injective(level.surface.mesh, x));
        const ism::Boundary boundary = on_circle ? ism::Boundary::kFixed : ism::Boundary::kFree;
        FlatNewton newton({level.surface, boundary}, x, executor);
        while (newton.minimize(10, 1e-3)) {
        }
        x = newton.positions();
        CHECK(is_injective(level.surface.mesh, x));
        h.set(level, x);
      }
      CHECK(((!on_circle && shape.name.find("folded") == 0) || stuck < 0));
      if (stuck < 0) CHECK(is_injective(s.mesh, h.positions()));
    }
}

TEST_CASE("lengths are softened from all alike to those of the surface") {
  Rng rng(35);
  Disk disk = shapes::random_disk(5, 4, rng);
  shapes::bend(disk, 0.5);
  const Surface s = build_surface(disk.mesh, true);
  const int n = s.mesh.n_faces;
  const Surface own = softened(s, 1, s.total_area), alike = softened(s, 0, n);
  for (int f = 0; f < n; ++f) {
    const Eigen::Matrix2d expected = eigen(s.rest_inverse[f]);
    CHECK((eigen(own.rest_inverse[f]) - expected).norm() < 1e-12 * expected.norm());
    CHECK(own.area[f] == doctest::Approx(s.area[f]).epsilon(1e-12));
    CHECK(alike.area[f] == doctest::Approx(1).epsilon(1e-12));
    const Eigen::Matrix2d R = eigen(inverse(alike.rest_inverse[f]));
    CHECK(R.col(0).norm() == doctest::Approx(R.col(1).norm()).epsilon(1e-12));
    CHECK(R.col(0).norm() == doctest::Approx((R.col(1) - R.col(0)).norm()).epsilon(1e-12));
  }
  for (double t : {0.1, 0.5, 0.9}) {
    const Surface soft = softened(build_surface(slivers(360).mesh, false), t, 1);
    CHECK(soft.total_area == 1);
    for (double area : soft.area) CHECK(area > 0);
  }
}

// ---- the embedding of pairs ----

TEST_CASE("every hostile mesh is embedded injectively, paired with itself and with a grid") {
  const TriangleMesh grid = shapes::grid(5, 5).mesh, small_grid = shapes::grid(3, 3).mesh;
  for (const Named& shape : hostile_meshes()) {
    CAPTURE(shape.name);
    check_embeds(shape.mesh, shape.mesh, {{0, 0}, {1, 1}});
    check_embeds(shape.mesh, grid, {{0, 0}, {2, 12}});
  }
  for (const Named& shape : smaller_hostile_meshes()) {
    CAPTURE(shape.name);
    check_embeds(small_grid, shape.mesh, {{15, 2}});  // one landmark: rotations are tried
  }
}

TEST_CASE("hostile meshes are embedded with their boundaries along a square") {
  std::vector<Named> meshes = smaller_hostile_meshes();
  meshes.push_back({"long folded strip", folded_grid(5, 150).mesh});
  meshes.push_back({"thinner needles", needles(20, 12, 1e-4).mesh});
  for (const Named& shape : meshes) {
    CAPTURE(shape.name);
    check_embeds(shape.mesh, shapes::grid(6, 5).mesh, {}, ism::Boundary::kFixed);
    check_embeds(shape.mesh, shape.mesh, {}, ism::Boundary::kSlide);
  }
}

// Their free boundary meets itself while it unfolds; a circle holds it then.
TEST_CASE("long outlines are embedded injectively") {
  check_embeds(shapes::comb(9, 12).mesh, shapes::comb(9, 12).mesh, {{0, 0}, {1, 1}});
  check_embeds(shapes::limbs(5, 40, 0.02).mesh, shapes::grid(5, 5).mesh, {{0, 0}, {2, 12}});
}

TEST_CASE("small pairs are embedded without landmarks") {
  const TriangleMesh triangle = shapes::single_triangle().mesh, two = shapes::strip(1).mesh;
  check_embeds(triangle, triangle);
  check_embeds(two, two);
  check_embeds(triangle, two);
  check_embeds(two, shapes::strip(20).mesh);
  check_embeds(shapes::limbs(4, 6, 0.05).mesh, punctured_sphere(4, 6));
}

TEST_CASE("meshes of very different resolution are embedded together") {
  const TriangleMesh two = shapes::strip(1).mesh, many = shapes::grid(12, 10).mesh;
  for (const std::vector<Landmark>& landmarks :
       {std::vector<Landmark>{}, {{0, 50}}, {{0, 0}, {1, 12}, {2, 130}, {3, 70}}}) {
    CAPTURE(landmarks.size());
    check_embeds(two, many, landmarks);
  }
  check_embeds(many, two, {{7, 3}});
}

TEST_CASE("any number of landmarks leaves the embedding injective") {
  Rng rng(35);
  Disk a = shapes::random_disk(5, 6, rng);
  shapes::bend(a, 0.6);
  const TriangleMesh b = shapes::spherical_cap(5, 11, 1.3).mesh;
  for (int n : {0, 1, 2, 3, 10, 1000}) {
    CAPTURE(n);
    check_embeds(a.mesh, b, first_landmarks(a.mesh, b, n));
    check_embeds(a.mesh, a.mesh, first_landmarks(a.mesh, a.mesh, n));
  }
}

TEST_CASE("more landmarks than the coarse level has vertices leave the embedding injective") {
  const TriangleMesh a = shapes::grid(58, 56).mesh, b = shapes::grid(56, 58).mesh;
  std::vector<Landmark> landmarks;
  for (int v = 0; v < a.vertices.rows(); ++v) landmarks.push_back({v, v});
  check_embeds(a, b, landmarks);
}

TEST_CASE("landmarks that no map without folds can join leave the embedding injective") {
  const TriangleMesh grid = shapes::grid(8, 8).mesh;
  std::vector<Landmark> reversed;
  for (int v = 0; v < n_vertices(grid); ++v) reversed.push_back({v, n_vertices(grid) - 1 - v});
  check_embeds(grid, grid, reversed);
  const TriangleMesh square = shapes::grid(1, 1).mesh;
  check_embeds(square, square, {{0, 1}, {1, 0}, {2, 3}, {3, 2}});  // a reflection
}

TEST_CASE("landmarks of an easy pair end near each other") {
  Rng rng(36);
  Disk a = shapes::random_disk(7, 6, rng);
  shapes::bend(a, 0.4);
  TriangleMesh b = a.mesh;  // another place in space, stretched a little
  const Eigen::Matrix3d R = Eigen::AngleAxisd(1.3, Vector3d(1, -1, 2).normalized()).matrix();
  b.vertices.col(0) *= 1.2;
  b.vertices = (b.vertices * R.transpose()).eval();
  for (const std::vector<Landmark>& landmarks :
       {std::vector<Landmark>{{5, 5}},
        {{5, 5}, {40, 40}},
        first_landmarks(a.mesh, b, 12),
        first_landmarks(a.mesh, b, 50)}) {  // more only lead
    const Embedding e = ism::initial_embedding(a.mesh, b, landmarks, on_one_thread());
    REQUIRE(e.status == Status::kDone);
    double largest = 0;
    for (const Landmark& l : landmarks)
      largest = std::max(largest, (e.f.row(l.a.vertex) - e.g.row(l.b.vertex)).norm());
    CHECK(e.landmark_distance ==
          doctest::Approx(largest / domain_radius(stacked(e.f, e.g))).epsilon(1e-12));
    CHECK(e.landmark_distance < 0.1);
  }
}

TEST_CASE("a flat mesh is embedded without distortion") {
  Rng rng(37);
  for (const Disk& disk : {shapes::grid(8, 7), shapes::perturbed_grid(9, 5, 0.2, rng)}) {
    ism::Options options = on_one_thread();
    options.keep_scale = true;
    const Embedding e = ism::initial_embedding(disk.mesh, disk.mesh, {{0, 0}, {30, 30}}, options);
    REQUIRE(e.status == Status::kDone);
    const Surface s = build_surface(disk.mesh, true);
    const double isometry = 4 * s.total_area;  // of the symmetric Dirichlet energy
    const auto energy = [&](const Points2& x) { return embedding_energy(s, x, 0, s.mesh.n_faces); };
    CHECK(energy(e.f) >= isometry * (1 - 1e-12));
    CHECK(energy(e.f) < isometry * 1.001);
    CHECK(energy(e.g) < isometry * 1.001);
  }
}

TEST_CASE("the planes are in scaled units unless asked otherwise") {
  const Disk disk = shapes::grid(6, 6);  // area 36
  const auto planar_area = [&](const Points2& x) {
    double area = 0;
    for (int f = 0; f < disk.mesh.triangles.rows(); ++f)
      area += 0.5 * shapes::turn(x, disk.mesh.triangles(f, 0), disk.mesh.triangles(f, 1),
                                 disk.mesh.triangles(f, 2));
    return area;
  };
  ism::Options options = on_one_thread();
  const std::vector<Landmark> landmarks = {{0, 0}, {40, 40}};
  const Embedding scaled = ism::initial_embedding(disk.mesh, disk.mesh, landmarks, options);
  CHECK(planar_area(scaled.f) == doctest::Approx(1).epsilon(0.01));
  options.keep_scale = true;
  const Embedding kept = ism::initial_embedding(disk.mesh, disk.mesh, landmarks, options);
  CHECK(planar_area(kept.g) == doctest::Approx(36).epsilon(0.01));
}

TEST_CASE("with one landmark, on a boundary or not, the planes overlap") {
  const Disk fan = shapes::fan(7), grid = shapes::grid(3, 3), strip = shapes::strip(9);
  const std::pair<Disk, Disk> pairs[] = {{fan, grid}, {grid, strip}, {strip, fan}, {grid, grid}};
  for (const auto& [a, b] : pairs)
    for (int v = 0; v < 4; ++v) {  // v = 0 is the centre of the fan, v = 2 inside of the grid
      CAPTURE(v);
      ism::Options options = on_one_thread();
      options.max_iterations = 0;
      const ism::Result result = ism::compute_map(a.mesh, b.mesh, {{v, v}}, options);
      CAPTURE(result.message);
      REQUIRE(ism::is_usable(result.status));
      CHECK(result.initial.coverage_a > 0.1);
      CHECK(result.initial.coverage_b > 0.1);
    }
}

TEST_CASE("planes overlap, whatever lies at their centres") {
  Disk thin_ring = shapes::slit_ring(16, 0.3, 6);  // nothing at its centre
  for (int v = 0; v < thin_ring.plane.rows(); ++v) {
    const double r = thin_ring.plane.row(v).norm();
    thin_ring.mesh.vertices.row(v) << (1 + 0.1 * r) / r * thin_ring.plane.row(v), 0;
  }
  const Disk folded = folded_grid(12, 24);
  const Disk grid = shapes::grid(6, 6), comb = shapes::comb(3, 30);
  const std::pair<Disk, Disk> pairs[] = {
      {thin_ring, grid}, {grid, thin_ring}, {thin_ring, thin_ring}, {folded, grid}, {comb, grid}};
  for (const auto& [a, b] : pairs)
    for (const std::vector<Landmark>& landmarks :
         {std::vector<Landmark>(), {{3, 5}}, {{3, 5}, {20, 7}}}) {
      CAPTURE(landmarks.size());
      ism::Options options = on_one_thread();
      options.candidates = false;
      options.max_iterations = 0;
      const ism::Result result = ism::compute_map(a.mesh, b.mesh, landmarks, options);
      CAPTURE(result.message);
      REQUIRE(ism::is_usable(result.status));
      CHECK(result.initial.coverage_a > 0);
      CHECK(result.initial.coverage_b > 0);
    }
}

TEST_CASE("strained outlines start isometric to themselves") {
  for (const Disk& disk : {shapes::comb(5, 5), spikes(34, 0.003), folded_grid(8, 30)}) {
    ism::Options options = on_one_thread();
    options.max_iterations = 0;
    const ism::Result result = ism::compute_map(disk.mesh, disk.mesh, {}, options);
    REQUIRE(ism::is_usable(result.status));
    CHECK(result.initial.mean_distortion < 2.001);
  }
}

}  // namespace embedding_tests

#endif  // ISM_TESTS_PART_EMBEDDING_HPP

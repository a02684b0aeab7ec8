// Half-edges, rest frames and validation.

#ifndef ISM_TESTS_PART_MESH_HPP
#define ISM_TESTS_PART_MESH_HPP

#include "ism.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace mesh_tests {
namespace {

using Eigen::Vector3d;
using ism::Problem;
using ism::TriangleMesh;
using ism::detail::build_half_edges;
using ism::detail::build_surface;
using ism::detail::HalfEdgeMesh;
using ism::detail::row2;
using ism::detail::Surface;
using shapes::half_edges;
using Kind = ism::Problem::Kind;

/// b - a and c - a of triangle f = (a, b, c).
Eigen::Matrix<double, 3, 2> edges_of(const TriangleMesh& mesh, int f) {
  const auto corner = [&](int k) -> Vector3d { return mesh.vertices.row(mesh.triangles(f, k)); };
  Eigen::Matrix<double, 3, 2> edges;
  edges << corner(1) - corner(0), corner(2) - corner(0);
  return edges;
}

double area_of(const TriangleMesh& mesh, int f) {
  const Eigen::Matrix<double, 3, 2> edges = edges_of(mesh, f);
  return edges.col(0).cross(edges.col(1)).norm() / 2;
}

double surface_area(const TriangleMesh& mesh) {
  double area = 0;
  for (int f = 0; f < mesh.triangles.rows(); ++f) area += area_of(mesh, f);
  return area;
}

int count_boundary(const HalfEdgeMesh& m) {
  return static_cast<int>(std::count(m.twin.begin(), m.twin.end(), -1));
}

TriangleMesh mesh(std::initializer_list<Vector3d> points,
                  std::initializer_list<std::array<int, 3>> triangles) {
  TriangleMesh result;
  result.vertices.resize(static_cast<int>(points.size()), 3);
  result.triangles.resize(static_cast<int>(triangles.size()), 3);
  int row = 0;
  for (const Vector3d& p : points) result.vertices.row(row++) = p.transpose();
  row = 0;
  for (const auto& t : triangles) result.triangles.row(row++) << t[0], t[1], t[2];
  return result;
}

/// n points no three of which are collinear, on a curve in space.
ism::Points3 points_on_curve(int n) {
  ism::Points3 points(n, 3);
  for (int i = 0; i < n; ++i) points.row(i) << i, i * i, 0.1 * i * i * i;
  return points;
}

TriangleMesh on_curve(std::initializer_list<std::array<int, 3>> triangles) {
  TriangleMesh result = mesh({}, triangles);
  result.vertices = points_on_curve(triangles.size() == 0 ? 0 : result.triangles.maxCoeff() + 1);
  return result;
}

std::vector<Problem> of_kind(const std::vector<Problem>& problems, Kind kind) {
  std::vector<Problem> found;
  for (const Problem& p : problems)
    if (p.kind == kind) found.push_back(p);
  return found;
}

/// True if every problem is of this kind, and the ids of all of them are these.
bool only(const std::vector<Problem>& problems, Kind kind, std::vector<std::vector<int>> ids) {
  std::vector<std::vector<int>> found;
  for (const Problem& p : problems) {
    if (p.kind != kind || p.message.empty()) return false;
    const bool is_of_vertices = kind == Kind::kNonFiniteCoordinate ||
                                kind == Kind::kNonManifoldVertex ||
                                kind == Kind::kUnreferencedVertex;
    if (!p.ids.empty() && is_of_vertices != (p.element == ism::Element::kVertex)) return false;
    found.push_back(p.ids);
    std::sort(found.back().begin(), found.back().end());
  }
  std::sort(found.begin(), found.end());
  std::sort(ids.begin(), ids.end());
  return found == ids;
}

bool mentions(const Problem& problem, const std::string& text) {
  return problem.message.find(text) != std::string::npos;
}

/// Triangles of a torus of nx×ny quads, without the last `holes` triangles.
TriangleMesh torus(int nx, int ny, int holes) {
  TriangleMesh result;
  result.vertices.resize(nx * ny, 3);
  result.triangles.resize(2 * nx * ny - holes, 3);
  int row = 0;
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j) {
      const double u = 2 * shapes::kPi * i / nx, v = 2 * shapes::kPi * j / ny;
      result.vertices.row(i * ny + j) << (2 + std::cos(v)) * std::cos(u),
          (2 + std::cos(v)) * std::sin(u), std::sin(v);
      const int a = i * ny + j, b = (i + 1) % nx * ny + j;
      const int c = (i + 1) % nx * ny + (j + 1) % ny, d = i * ny + (j + 1) % ny;
      result.triangles.row(row++) << a, b, c;
      if (row < result.triangles.rows()) result.triangles.row(row++) << a, c, d;
    }
  return result;
}

/// A ring of n quads between two circles, both of them boundary.
TriangleMesh annulus(int n) {
  TriangleMesh result;
  result.vertices.resize(2 * n, 3);
  result.triangles.resize(2 * n, 3);
  for (int i = 0; i < n; ++i) {
    const double angle = 2 * shapes::kPi * i / n;
    const Vector3d p(std::cos(angle), std::sin(angle), 0);
    result.vertices.row(i) = p.transpose();
    result.vertices.row(n + i) = 2 * p.transpose();
    const int j = (i + 1) % n;
    result.triangles.row(2 * i) << i, n + i, n + j;
    result.triangles.row(2 * i + 1) << i, n + j, j;
  }
  return result;
}

}  // namespace

// ---- half-edges ----

TEST_CASE("next and prev run around the half-edges of one face") {
  using ism::detail::next;
  using ism::detail::prev;
  for (int h = 0; h < 12; ++h) {
    CHECK(next(h) / 3 == h / 3);
    CHECK(next(h) != h);
    CHECK(next(next(next(h))) == h);
    CHECK(prev(next(h)) == h);
    CHECK(next(prev(h)) == h);
  }
}

TEST_CASE("twins are mutual and run the other way") {
  for (const shapes::Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    const HalfEdgeMesh m = half_edges(disk.mesh);
    int wrong = 0, edges = 0;
    for (int h = 0; h < 3 * m.n_faces; ++h) {
      wrong += m.tail[h] != disk.mesh.triangles(h / 3, h % 3);
      wrong += m.tip(h) != disk.mesh.triangles(h / 3, (h + 1) % 3);
      edges += m.twin[h] < h;
      if (m.twin[h] < 0) continue;
      wrong += m.twin[h] == h || m.twin[m.twin[h]] != h;
      wrong += m.tail[m.twin[h]] != m.tip(h) || m.tip(m.twin[h]) != m.tail[h];
    }
    CHECK(wrong == 0);
    CHECK(m.n_vertices - edges + m.n_faces == 1);
  }
}

TEST_CASE("the boundary loop is closed, complete and counter-clockwise") {
  for (const shapes::Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    const HalfEdgeMesh m = half_edges(disk.mesh);
    const int n = m.boundary.size();
    CHECK(n == count_boundary(m));
    CHECK(m.loops() == 1);
    double loop_area = 0, mesh_area = 0;
    int wrong = 0;
    for (int i = 0; i < n; ++i) {
      const int h = m.boundary[i];
      wrong += m.twin[h] >= 0 || m.tip(h) != m.tail[m.boundary[(i + 1) % n]];
      loop_area += cross(row2(disk.plane, m.tail[h]), row2(disk.plane, m.tip(h))) / 2;
    }
    for (int f = 0; f < m.n_faces; ++f)
      mesh_area += shapes::turn(disk.plane, m.corner(f, 0), m.corner(f, 1), m.corner(f, 2)) / 2;
    CHECK(wrong == 0);
    CHECK(loop_area > 0);
    CHECK(loop_area == doctest::Approx(mesh_area).epsilon(1e-12));
  }
}

TEST_CASE("turning from the outgoing half-edge visits every face of a vertex once") {
  for (const shapes::Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    const HalfEdgeMesh m = half_edges(disk.mesh);
    std::vector<std::set<int>> faces(static_cast<std::size_t>(m.n_vertices));
    for (int h = 0; h < 3 * m.n_faces; ++h)
      faces[static_cast<std::size_t>(m.tail[h])].insert(h / 3);
    std::set<int> rim;
    for (int h : m.boundary) rim.insert(m.tail[h]);
    int wrong = 0;
    for (int v = 0; v < m.n_vertices; ++v) {
      const auto& expected = faces[static_cast<std::size_t>(v)];
      std::set<int> visited;
      int h = m.out[v], steps = 0;
      for (; h >= 0 && steps < 1000; ++steps) {
        wrong += m.tail[h] != v;
        visited.insert(h / 3);
        h = m.turn(h);
        if (h == m.out[v]) break;
      }
      wrong += visited != expected;
      wrong += m.on_boundary(v) != (rim.count(v) == 1);
      wrong += m.on_boundary(v) != (h < 0);
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("half-edges of a closed mesh have no boundary") {
  const TriangleMesh closed = shapes::tetrahedron();
  const HalfEdgeMesh m = build_half_edges(4, closed.triangles);
  CHECK(m.boundary.empty());
  CHECK(m.loops() == 0);
  CHECK(count_boundary(m) == 0);
}

// ---- rest frames and scale ----

TEST_CASE("the rest frame is isometric to the triangle") {
  shapes::Rng rng(1);
  for (int i = 0; i < 200; ++i) {
    const double size = std::ldexp(1.0, rng.between(-30, 30));
    Vector3d p[3];
    for (Vector3d& q : p)
      for (int c = 0; c < 3; ++c) q[c] = size * rng.uniform();
    const Vector3d u = p[1] - p[0], v = p[2] - p[0];
    const Eigen::Matrix2d R = shapes::eigen(ism::detail::rest_frame(
        shapes::to_vec3(p[0]), shapes::to_vec3(p[1]), shapes::to_vec3(p[2])));
    const double tolerance = 1e-13 * size * size;
    CHECK(R(1, 0) == 0);
    CHECK(std::abs(R.col(0).squaredNorm() - u.squaredNorm()) < tolerance);
    CHECK(std::abs(R.col(1).squaredNorm() - v.squaredNorm()) < tolerance);
    CHECK(std::abs(R.col(0).dot(R.col(1)) - u.dot(v)) < tolerance);
    CHECK(R.determinant() > 0);
    CHECK(std::abs(R.determinant() - u.cross(v).norm()) < tolerance);
  }
}

TEST_CASE("a surface keeps inverse rest frames and areas of its faces") {
  for (const shapes::Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    const Surface s = build_surface(disk.mesh, true);
    double total = 0, worst = 0;
    for (int f = 0; f < s.mesh.n_faces; ++f) {
      const Eigen::Matrix<double, 3, 2> edges = edges_of(disk.mesh, f);
      const double area = area_of(disk.mesh, f);
      // edges R⁻¹ is an isometry of the plane into space.
      const Eigen::Matrix<double, 3, 2> J = edges * shapes::eigen(s.rest_inverse[f]);
      const Eigen::Matrix2d metric = J.transpose() * J;
      worst = std::max(worst, (metric - Eigen::Matrix2d::Identity()).norm());
      worst = std::max(worst, std::abs(s.area[f] - area) / area);
      total += area;
    }
    CHECK(worst < 1e-9);
    CHECK(s.total_area == doctest::Approx(total).epsilon(1e-13));
    CHECK(s.vertices == disk.mesh.vertices);
  }
}

/// The vertices as seen from the first one.
ism::Points3 from_first(const Surface& s) {
  return s.vertices.rowwise() - Eigen::RowVector3d(s.vertices.row(0));
}

TEST_CASE("a surface is scaled to unit area whatever its unit") {
  for (shapes::Disk& disk : shapes::all_disks())
    for (double unit : {1e-300, 1e-160, 1e-6, 1.0, 1e6, 1e160, 1e300}) {
      CAPTURE(disk.name);
      CAPTURE(unit);
      const double area = surface_area(disk.mesh);
      TriangleMesh given = disk.mesh;
      given.vertices *= unit;
      const Surface s = build_surface(given, false);
      CHECK(s.total_area == doctest::Approx(1).epsilon(1e-12));
      const Eigen::RowVector3d origin = disk.mesh.vertices.row(0);
      const ism::Points3 expected = (disk.mesh.vertices.rowwise() - origin) / std::sqrt(area);
      CHECK((from_first(s) - expected).norm() < 1e-13);
    }
}

TEST_CASE("a surface far from the origin keeps all that its coordinates have left of its shape") {
  TriangleMesh far = shapes::spherical_cap(3, 7, 1).mesh;
  far.vertices.array() += 1e8;
  TriangleMesh near = far;
  near.vertices.array() -= 1e8;  // exact
  CHECK((from_first(build_surface(far, false)) - from_first(build_surface(near, false))).norm() <
        1e-14);
}

// ---- two surfaces as one ----

TEST_CASE("a surface whose triangles are ever smaller towards the origin keeps them") {
  constexpr int kRings = 4, kSectors = 5;  // of radii 1, 1e-6, ..., the outer one first
  TriangleMesh mesh;
  mesh.vertices.resize(kRings * kSectors + 1, 3);
  mesh.triangles.resize((2 * kRings - 1) * kSectors, 3);
  int f = 0;
  for (int i = 0; i < kRings; ++i)
    for (int k = 0; k < kSectors; ++k) {
      const double r = std::pow(1e-6, i), angle = 2 * ism::detail::kPi * k / kSectors;
      const int u = i * kSectors + k, v = i * kSectors + (k + 1) % kSectors;
      const bool is_last = i + 1 == kRings;
      mesh.vertices.row(u) << r * std::cos(angle), r * std::sin(angle), 0.3 * r;
      mesh.triangles.row(f++) << u, v, is_last ? kRings * kSectors : v + kSectors;
      if (!is_last) mesh.triangles.row(f++) << u, v + kSectors, u + kSectors;
    }
  mesh.vertices.bottomRows(1).setZero();
  REQUIRE(ism::validate(mesh).empty());
  const ism::detail::Surface s = ism::detail::build_surface(mesh, false);
  CHECK(s.total_area == doctest::Approx(1));
  CHECK(ism::validate(TriangleMesh{s.vertices, mesh.triangles}).empty());
}

TEST_CASE("in a joint surface, what is of B comes behind what is of A") {
  const TriangleMesh a = shapes::comb(3, 2).mesh, b = shapes::spherical_cap(3, 7, 1).mesh;
  const int n_a = static_cast<int>(a.vertices.rows()), n_b = static_cast<int>(b.vertices.rows());
  const ism::Triangles triangles_of_b = b.triangles.array() + n_a;
  const HalfEdgeMesh expected =
      build_half_edges(n_a + n_b, ism::detail::stacked(a.triangles, triangles_of_b));
  const auto same = [](const auto& x, const auto& y) {
    return std::equal(std::begin(x), std::end(x), std::begin(y), std::end(y));
  };
  for (bool keep_scale : {false, true}) {
    CAPTURE(keep_scale);
    const ism::detail::JointSurface s = shapes::joined(a, b, keep_scale);
    const Surface of_a = build_surface(a, keep_scale), of_b = build_surface(b, keep_scale);
    CHECK(s.n_a == n_a);
    CHECK(s.faces_a == a.triangles.rows());
    CHECK(s.boundary_a == of_a.mesh.boundary.size());
    CHECK(s.mesh.n_vertices == expected.n_vertices);
    CHECK(s.mesh.n_faces == expected.n_faces);
    CHECK(s.mesh.loops() == 2);
    CHECK(same(s.mesh.tail, expected.tail));
    CHECK(same(s.mesh.twin, expected.twin));
    CHECK(same(s.mesh.out, expected.out));
    CHECK(same(s.mesh.boundary, expected.boundary));
    CHECK(same(s.mesh.loop, expected.loop));
    CHECK(s.vertices.topRows(n_a) == of_a.vertices);
    CHECK(s.vertices.bottomRows(n_b) == of_b.vertices);
    int wrong = 0;
    for (int f = 0; f < s.mesh.n_faces; ++f) {
      const Surface& of = f < s.faces_a ? of_a : of_b;
      const int i = f < s.faces_a ? f : f - s.faces_a;
      wrong += s.area[f] != of.area[i] || !same(s.rest_inverse[f].entry, of.rest_inverse[i].entry);
    }
    CHECK(wrong == 0);
    CHECK(s.area_a == of_a.total_area);
    CHECK(s.area_b == of_b.total_area);
    CHECK(s.total_area == of_a.total_area + of_b.total_area);
    CHECK(s.scale_a == of_a.scale);
    CHECK(s.scale_b == of_b.scale);
  }
}

// ---- validation ----

TEST_CASE("valid disks have no problems, in any unit and place") {
  for (shapes::Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    CHECK(ism::validate(disk.mesh).empty());
    TriangleMesh other = disk.mesh;
    for (double unit : {1e-300, 1e-9, 1e9, 1e300}) {
      other.vertices = unit * disk.mesh.vertices;
      CHECK(ism::validate(other).empty());
    }
    other.vertices = disk.mesh.vertices.rowwise() + Eigen::RowVector3d(100, -50, 7);
    CHECK(ism::validate(other).empty());
  }
}

TEST_CASE("an empty mesh is reported") {
  CHECK(only(ism::validate(TriangleMesh{}), Kind::kEmpty, {{}}));
  TriangleMesh points_only;
  points_only.vertices = points_on_curve(3);
  CHECK(only(ism::validate(points_only), Kind::kEmpty, {{}}));
  TriangleMesh triangles_only = on_curve({{0, 1, 2}});
  triangles_only.vertices.resize(0, 3);
  CHECK(only(ism::validate(triangles_only), Kind::kEmpty, {{}}));
}

TEST_CASE("a mesh with more elements than an int counts what is made of them is refused unread") {
  TriangleMesh mesh;  // memory that nobody touches is not taken
  mesh.vertices.resize(3, 3);
  mesh.triangles.resize((1 << 24) + 1, 3);
  CHECK(only(ism::validate(mesh), Kind::kEmpty, {{}}));
  mesh.triangles.resize(1, 3);
  mesh.vertices.resize((1 << 24) + 1, 3);
  CHECK(only(ism::validate(mesh), Kind::kEmpty, {{}}));
}

TEST_CASE("triangles with ids outside the vertices are reported by their ids") {
  TriangleMesh m = on_curve({{0, 1, 2}, {2, 1, 3}, {2, 3, 4}});
  m.triangles(1, 2) = 5;
  m.triangles(2, 0) = -1;
  const auto problems = ism::validate(m);
  CHECK(only(problems, Kind::kIndexOutOfRange, {{1}, {2}}));
  REQUIRE(problems.size() == 2);
  CHECK(mentions(problems[0], "triangle 1"));
  CHECK(mentions(problems[0], "vertex 5"));
  CHECK(mentions(problems[1], "vertex -1"));
  m.triangles(2, 0) = std::numeric_limits<int>::max();
  m.triangles(1, 2) = std::numeric_limits<int>::min();
  CHECK(only(ism::validate(m), Kind::kIndexOutOfRange, {{1}, {2}}));
}

TEST_CASE("coordinates that are not finite are reported by vertex") {
  TriangleMesh m = shapes::grid(3, 3).mesh;
  m.vertices(2, 0) = std::numeric_limits<double>::quiet_NaN();
  m.vertices(5, 1) = std::numeric_limits<double>::infinity();
  m.vertices(7, 2) = -std::numeric_limits<double>::infinity();
  const auto problems = ism::validate(m);
  CHECK(only(problems, Kind::kNonFiniteCoordinate, {{2}, {5}, {7}}));
  REQUIRE(problems.size() == 3);
  CHECK(mentions(problems[0], "vertex 2"));
}

TEST_CASE("triangles without area are reported") {
  TriangleMesh m = shapes::grid(2, 2).mesh;
  SUBCASE("because a vertex repeats") {
    m.triangles(3, 1) = m.triangles(3, 0);
    const auto found = of_kind(ism::validate(m), Kind::kDegenerateTriangle);
    CHECK(only(found, Kind::kDegenerateTriangle, {{3}}));
  }
  SUBCASE("because two vertices coincide") {
    m = mesh({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {1, 1, 0}}, {{0, 1, 2}, {0, 2, 3}});
    CHECK(only(ism::validate(m), Kind::kDegenerateTriangle, {{1}}));
  }
  SUBCASE("because its corners are collinear") {
    m = mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 3, 0}}, {{0, 1, 2}, {0, 2, 3}});
    CHECK(only(ism::validate(m), Kind::kDegenerateTriangle, {{1}}));
  }
  SUBCASE("because it is of another scale altogether") {
    shapes::DiskBuilder spiral;  // triangle k is about 1e-4k across
    for (int k = 0; k < 11; ++k)
      spiral.vertex(std::pow(1e-4, k) * std::cos(k), std::pow(1e-4, k) * std::sin(k));
    for (int k = 0; k < 9; ++k)
      k % 2 == 0 ? spiral.triangle(k, k + 1, k + 2) : spiral.triangle(k + 1, k, k + 2);
    CHECK(only(ism::validate(spiral.build().mesh), Kind::kDegenerateTriangle, {{8}}));
  }
  SUBCASE("because everything is in one point") {
    m.vertices.setZero();
    CHECK(ism::validate(m).size() == 8);
    CHECK(of_kind(ism::validate(m), Kind::kDegenerateTriangle).size() == 8);
  }
}

TEST_CASE("a triangle given twice is reported as a pair") {
  const TriangleMesh m = on_curve({{0, 1, 2}, {2, 1, 3}, {3, 2, 1}});
  const auto problems = of_kind(ism::validate(m), Kind::kRepeatedTriangle);
  CHECK(only(problems, Kind::kRepeatedTriangle, {{1, 2}}));
  const TriangleMesh reversed = on_curve({{0, 1, 2}, {0, 2, 1}});
  CHECK(only(of_kind(ism::validate(reversed), Kind::kRepeatedTriangle), Kind::kRepeatedTriangle,
             {{0, 1}}));
}

TEST_CASE("an edge of three triangles is reported with its triangles") {
  const TriangleMesh m = on_curve({{0, 1, 2}, {1, 0, 3}, {0, 1, 4}});
  const auto problems = of_kind(ism::validate(m), Kind::kNonManifoldEdge);
  CHECK(only(problems, Kind::kNonManifoldEdge, {{0, 1, 2}}));
  REQUIRE(problems.size() == 1);
  CHECK(mentions(problems[0], "0-1"));
}

TEST_CASE("neighbours of opposite orientation are reported as a pair") {
  const TriangleMesh m = on_curve({{0, 1, 2}, {1, 2, 3}});
  const auto problems = of_kind(ism::validate(m), Kind::kInconsistentOrientation);
  CHECK(only(problems, Kind::kInconsistentOrientation, {{0, 1}}));
  REQUIRE(problems.size() == 1);
  CHECK(mentions(problems[0], "1-2"));
}

TEST_CASE("one reversed triangle inside a grid is reported against all of its neighbours") {
  TriangleMesh m = shapes::grid(4, 4).mesh;
  const int f = 13;
  std::swap(m.triangles(f, 0), m.triangles(f, 1));
  const auto problems = of_kind(ism::validate(m), Kind::kInconsistentOrientation);
  CHECK(problems.size() == 3);
  for (const Problem& p : problems) CHECK(std::count(p.ids.begin(), p.ids.end(), f) == 1);
}

TEST_CASE("a Möbius strip is reported") {
  TriangleMesh m;
  const int n = 8;
  m.vertices.resize(2 * n, 3);
  m.triangles.resize(2 * n, 3);
  for (int i = 0; i < n; ++i) {
    const double u = 2 * shapes::kPi * i / n;
    for (int side = 0; side < 2; ++side) {
      const double r = 2 + (side - 0.5) * std::cos(u / 2);
      m.vertices.row(2 * i + side) << r * std::cos(u), r * std::sin(u),
          (side - 0.5) * std::sin(u / 2);
    }
    const bool last = i == n - 1;  // the strip closes with a twist
    const int c = last ? 1 : 2 * i + 2, d = last ? 0 : 2 * i + 3;
    m.triangles.row(2 * i) << 2 * i, c, d;
    m.triangles.row(2 * i + 1) << 2 * i, d, 2 * i + 1;
  }
  const auto problems = of_kind(ism::validate(m), Kind::kInconsistentOrientation);
  CHECK(only(problems, Kind::kInconsistentOrientation, {{1, 2 * n - 2}}));
}

TEST_CASE("vertices with one fan are not blamed for the orientation of its triangles") {
  const TriangleMesh one_fan = on_curve({{0, 1, 2}, {0, 3, 2}});
  CHECK(only(ism::validate(one_fan), Kind::kInconsistentOrientation, {{0, 1}}));
}

TEST_CASE("a vertex where two fans meet is reported") {
  const TriangleMesh bow_tie = on_curve({{0, 1, 2}, {2, 3, 4}});
  CHECK(only(ism::validate(bow_tie), Kind::kNonManifoldVertex, {{2}}));
  TriangleMesh tetrahedra = shapes::tetrahedron();  // two closed surfaces with a common vertex
  tetrahedra.vertices.conservativeResize(7, Eigen::NoChange);
  tetrahedra.vertices.bottomRows<3>() = -tetrahedra.vertices.middleRows<3>(1);
  tetrahedra.triangles.conservativeResize(8, Eigen::NoChange);
  tetrahedra.triangles.bottomRows<4>() << 0, 4, 5, 0, 6, 4, 4, 6, 5, 5, 6, 0;
  CHECK(only(ism::validate(tetrahedra), Kind::kNonManifoldVertex, {{0}}));
}

TEST_CASE("vertices without triangles are reported") {
  TriangleMesh m = on_curve({{0, 1, 2}, {2, 1, 4}});
  CHECK(only(ism::validate(m), Kind::kUnreferencedVertex, {{3}}));
  m.vertices = points_on_curve(7);
  const auto problems = ism::validate(m);
  CHECK(only(problems, Kind::kUnreferencedVertex, {{3}, {5}, {6}}));
  REQUIRE(problems.size() == 3);
  CHECK(mentions(problems[0], "vertex 3"));
}

TEST_CASE("several components are counted") {
  const auto problems =
      of_kind(ism::validate(on_curve({{0, 1, 2}, {3, 4, 5}, {6, 7, 8}})), Kind::kSeveralComponents);
  REQUIRE(problems.size() == 1);
  CHECK(mentions(problems[0], "3 components"));
}

TEST_CASE("closed surfaces and those with openings are valid, those with handles are not") {
  CHECK(ism::validate(shapes::tetrahedron()).empty());
  CHECK(ism::validate(annulus(9)).empty());
  for (int left_out : {0, 1}) {
    const auto problems = of_kind(ism::validate(torus(5, 4, left_out)), Kind::kHandles);
    REQUIRE(problems.size() == 1);
    CHECK(mentions(problems[0], "genus 1"));
  }
}

TEST_CASE("at most twenty problems of a kind are reported, and other kinds still are") {
  TriangleMesh m = shapes::grid(10, 10).mesh;
  SUBCASE("coordinates and indices") {
    m.vertices.topRows(30).setConstant(std::numeric_limits<double>::quiet_NaN());
    m.triangles.col(0).tail(25).setConstant(1000);
    const auto problems = ism::validate(m);
    CHECK(of_kind(problems, Kind::kNonFiniteCoordinate).size() == 20);
    CHECK(of_kind(problems, Kind::kIndexOutOfRange).size() == 20);
    CHECK(problems.size() == 40);
  }
  SUBCASE("triangles and vertices") {
    const int n = static_cast<int>(m.vertices.rows()), f = static_cast<int>(m.triangles.rows());
    m.vertices.conservativeResize(n + 50, Eigen::NoChange);
    m.vertices.bottomRows(50).setOnes();
    m.triangles.conservativeResize(f + 50, Eigen::NoChange);
    m.triangles.bottomRows(50) = m.triangles.topRows(50);
    const auto problems = ism::validate(m);
    CHECK(of_kind(problems, Kind::kUnreferencedVertex).size() == 20);
    CHECK(of_kind(problems, Kind::kRepeatedTriangle).size() == 20);
    CHECK(of_kind(problems, Kind::kNonManifoldEdge).size() == 20);
  }
}

TEST_CASE("random triangle soups are never taken for disks they are not") {
  shapes::Rng rng(3);
  int valid = 0;
  for (int i = 0; i < 3000; ++i) {
    TriangleMesh m;
    const int n = rng.between(3, 6), faces = rng.between(1, 5);
    m.vertices = points_on_curve(n);
    m.triangles.resize(faces, 3);
    for (int f = 0; f < faces; ++f)
      for (int k = 0; k < 3; ++k) m.triangles(f, k) = rng.below(n);
    if (!ism::validate(m).empty()) continue;
    ++valid;
    const HalfEdgeMesh h = build_half_edges(n, m.triangles);
    const int edges = (3 * faces + h.boundary.size()) / 2;
    CHECK(n - edges + faces == 1);
    CHECK(h.boundary.size() == count_boundary(h));
    std::set<int> rim;
    for (int e : h.boundary) rim.insert(h.tail[e]);
    CHECK(static_cast<int>(rim.size()) == h.boundary.size());
  }
  CHECK(valid > 20);
}

// ---- views ----

TEST_CASE("a view of any buffer is the mesh that lies in it") {
  const TriangleMesh mesh = shapes::grid(3, 2).mesh;
  const auto check = [&](const ism::MeshView& view) {
    const TriangleMesh copy = *ism::detail::shared(view);
    CHECK(copy.vertices == mesh.vertices);  // small integers
    CHECK(copy.triangles == mesh.triangles);
    CHECK(ism::validate(view).empty());
  };
  check(mesh);
  const Eigen::MatrixXd by_columns = mesh.vertices;
  const Eigen::MatrixXi ids = mesh.triangles;
  const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> floats =
      mesh.vertices.cast<float>();
  check({by_columns, ids});
  check({floats, mesh.triangles});
  Eigen::MatrixXd wide = Eigen::MatrixXd::Random(mesh.vertices.rows() + 2, 5);
  wide.block(1, 1, mesh.vertices.rows(), 3) = mesh.vertices;
  check({wide.block(1, 1, mesh.vertices.rows(), 3), ids});
  const Eigen::MatrixXd transposed = mesh.vertices.transpose();
  check({transposed.transpose(), ids});
  check({floats, Eigen::Matrix<std::uint16_t, Eigen::Dynamic, 3>(ids.cast<std::uint16_t>())});
}

/// Calls what(T()) for every type of integers.
template <class What>
void for_each_integer(const What& what) {
  what(char()), what(std::int8_t()), what(std::uint8_t());
  what(short()), what(static_cast<unsigned short>(0));
  what(0), what(0u), what(0l), what(0ul), what(0ll), what(0ull);
}

TEST_CASE("interleaved buffers with ids of any integer type, at any address") {
#pragma pack(push, 1)
  struct Vertex {
    char tag;
    float position[3];
    short color;
  };
#pragma pack(pop)
  static_assert(sizeof(Vertex) == 15, "packed, so that most positions are not aligned");
  const TriangleMesh mesh = shapes::grid(2, 3).mesh;
  std::vector<Vertex> vertices;
  for (int v = 0; v < mesh.vertices.rows(); ++v) {
    vertices.push_back({'v', {0, 0, 0}, 7});
    for (int k = 0; k < 3; ++k)
      vertices.back().position[k] = static_cast<float>(mesh.vertices(v, k));
  }
  const ism::detail::ArrayView<false> positions(
      reinterpret_cast<const float*>(reinterpret_cast<const char*>(vertices.data()) + 1),
      mesh.vertices.rows(), sizeof(Vertex));
  const auto check = [&](auto id) {
    const Eigen::Index n = mesh.triangles.rows();
    std::vector<decltype(id)> ids(static_cast<std::size_t>(4 * n));  // and a material
    for (Eigen::Index i = 0; i < 3 * n; ++i)
      ids[static_cast<std::size_t>(i / 3 * 4 + i % 3)] =
          static_cast<decltype(id)>(mesh.triangles.data()[i]);
    const TriangleMesh copy =
        *ism::detail::shared(ism::MeshView(positions, {ids.data(), n, 4 * sizeof(id)}));
    CHECK(copy.vertices == mesh.vertices);
    CHECK(copy.triangles == mesh.triangles);
  };
  for_each_integer(check);
}

TEST_CASE("matrices of ids of any integer type, by rows and by columns") {
  const TriangleMesh mesh = shapes::grid(2, 3).mesh;
  for_each_integer([&](auto id) {
    using Id = decltype(id);
    const ism::Rows<Id, 3> by_rows = mesh.triangles.cast<Id>();
    const Eigen::Matrix<Id, Eigen::Dynamic, Eigen::Dynamic> by_columns = by_rows;
    CHECK(ism::detail::shared(ism::MeshView(mesh.vertices, by_rows))->triangles == mesh.triangles);
    CHECK(ism::detail::shared(ism::MeshView(mesh.vertices, by_columns))->triangles ==
          mesh.triangles);
  });
}

TEST_CASE("ids that are no int are out of range, whatever an int would make of them") {
  const TriangleMesh mesh = shapes::grid(1, 1).mesh;
  for_each_integer([&](auto id) {
    using Limits = std::numeric_limits<decltype(id)>;
    for (const auto bad : {Limits::lowest(), Limits::max()}) {
      if (bad == 0) continue;
      decltype(id) ids[] = {0, 1, bad, 0, 1, 3};
      CAPTURE(sizeof id);
      const std::vector<Problem> problems = ism::validate({mesh.vertices, {ids, 2}});
      REQUIRE(problems.size() == 1);
      CHECK(problems[0].kind == Kind::kIndexOutOfRange);
      CHECK(ism::prepare({mesh.vertices, {ids, 2}}).problems.size() == 1);
    }
  });
  const std::int64_t wraps[] = {0, 1, (std::int64_t{1} << 32) + 2};  // 2, in the lower 32 bits
  CHECK(ism::validate({mesh.vertices, {wraps, 1}}).size() == 1);
  CHECK(ism::detail::shared(ism::MeshView(mesh.vertices, {wraps, 1}))->triangles(0, 2) ==
        std::numeric_limits<int>::max());
}

TEST_CASE("views without a mesh are refused") {
  const TriangleMesh mesh = shapes::grid(1, 1).mesh;
  const double x = 0;
  const float* const none = nullptr;
  const std::ptrdiff_t most = std::numeric_limits<int>::max();
  const Eigen::MatrixXd planar = mesh.vertices.leftCols<2>();
  const Eigen::MatrixXi quads = Eigen::MatrixXi::Zero(3, 4);
  for (const ism::MeshView& view :
       {ism::MeshView(), ism::MeshView({none, 4}, mesh.triangles),
        ism::MeshView({&x, -1}, mesh.triangles), ism::MeshView({&x, most}, mesh.triangles),
        ism::MeshView(planar, mesh.triangles), ism::MeshView(mesh.vertices, quads)}) {
    const std::vector<Problem> problems = ism::validate(view);
    REQUIRE(problems.size() == 1);
    CHECK(problems[0].kind == Kind::kEmpty);
    CHECK(ism::compute_map(view, mesh).status == ism::Status::kInvalidMesh);
  }
  const std::uint32_t restart[] = {0, 1, 0xFFFFFFFFu};
  const std::vector<Problem> problems = ism::validate({mesh.vertices, {restart, 1}});
  REQUIRE(problems.size() == 1);
  CHECK(problems[0].message == "triangle 0 refers to vertex 2147483647, but there are 4 vertices");
}

}  // namespace mesh_tests

#endif  // ISM_TESTS_PART_MESH_HPP

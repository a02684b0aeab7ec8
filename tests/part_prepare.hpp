// Meshes with problems, made clean.

#ifndef ISM_TESTS_PART_PREPARE_HPP
#define ISM_TESTS_PART_PREPARE_HPP

#include "ism.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace prepare_tests {
namespace {

using ism::Prepared;
using ism::Problem;
using ism::TriangleMesh;
using shapes::Disk;
using shapes::Rng;
using Ids = std::vector<int>;

int n_vertices(const TriangleMesh& mesh) { return static_cast<int>(mesh.vertices.rows()); }
int n_triangles(const TriangleMesh& mesh) { return static_cast<int>(mesh.triangles.rows()); }

void add_vertex(TriangleMesh& mesh, double x, double y, double z) {
  mesh.vertices.conservativeResize(mesh.vertices.rows() + 1, Eigen::NoChange);
  mesh.vertices.bottomRows(1) << x, y, z;
}

void add_triangle(TriangleMesh& mesh, int u, int v, int w) {
  mesh.triangles.conservativeResize(mesh.triangles.rows() + 1, Eigen::NoChange);
  mesh.triangles.bottomRows(1) << u, v, w;
}

void turn(TriangleMesh& mesh, int f) { std::swap(mesh.triangles(f, 1), mesh.triangles(f, 2)); }

/// Every triangle with vertices of its own.
TriangleMesh soup(const TriangleMesh& mesh) {
  TriangleMesh result;
  result.vertices.resize(mesh.triangles.size(), 3);
  result.triangles.resize(mesh.triangles.rows(), 3);
  for (int i = 0; i < mesh.triangles.size(); ++i) {
    result.vertices.row(i) = mesh.vertices.row(mesh.triangles.data()[i]);
    result.triangles.data()[i] = i;
  }
  return result;
}

double area(const TriangleMesh& mesh) {
  double sum = 0;
  for (int f = 0; f < mesh.triangles.rows(); ++f) {
    const Eigen::Vector3d p = mesh.vertices.row(mesh.triangles(f, 0));
    const Eigen::Vector3d q = mesh.vertices.row(mesh.triangles(f, 1)).transpose() - p;
    const Eigen::Vector3d r = mesh.vertices.row(mesh.triangles(f, 2)).transpose() - p;
    sum += 0.5 * q.cross(r).norm();
  }
  return sum;
}

/// What must hold of everything that was prepared.
void check_maps(const TriangleMesh& given, const Prepared& p) {
  const TriangleMesh& mesh = *p.mesh;
  REQUIRE(p.given_vertex.size() == static_cast<std::size_t>(n_vertices(mesh)));
  REQUIRE(p.given_corner.size() == static_cast<std::size_t>(mesh.triangles.size()));
  REQUIRE(p.new_vertex.size() == static_cast<std::size_t>(n_vertices(given)));
  REQUIRE(p.new_triangle.size() == static_cast<std::size_t>(n_triangles(given)));
  bool same = true;
  for (int v = 0; v < n_vertices(mesh); ++v)
    same = same &&
           mesh.vertices.row(v) == given.vertices.row(p.given_vertex[static_cast<std::size_t>(v)]);
  for (int i = 0; i < mesh.triangles.size(); ++i) {
    const int corner = p.given_corner[static_cast<std::size_t>(i)];
    same = same && mesh.vertices.row(mesh.triangles.data()[i]) ==
                       given.vertices.row(given.triangles.data()[corner]);
  }
  for (int v = 0; v < n_vertices(given); ++v) {
    const int w = p.new_vertex[static_cast<std::size_t>(v)];
    same = same && (w < 0 || mesh.vertices.row(w) == given.vertices.row(v));
  }
  CHECK(same);
}

Prepared checked(const TriangleMesh& given, const std::vector<ism::LandmarkPoint>& landmarks = {}) {
  const Prepared p = ism::prepare(given, landmarks);
  check_maps(given, p);
  const std::string problem = p.problems.empty() ? "" : p.problems[0].message;
  CAPTURE(problem);
  REQUIRE(p.problems.empty());
  CHECK(ism::validate(*p.mesh).empty());
  return p;
}

/// The only thing that was done.
void check_only(const Prepared& p, Problem::Kind kind, const std::string& message, const Ids& ids) {
  REQUIRE(p.repairs.size() == 1);
  CHECK(p.repairs[0].kind == kind);
  CHECK(p.repairs[0].message == message);
  CHECK(p.repairs[0].ids == ids);
}

std::vector<Disk> disks_and_openings() {
  Rng rng(1);
  std::vector<Disk> all = shapes::all_disks();
  all.push_back(shapes::with_openings(9, 7, rng));
  return all;
}

/// Is the first edge of a triangle on the boundary?
bool is_on_rim(const Disk& disk, int f) { return shapes::half_edges(disk.mesh).twin[3 * f] < 0; }

}  // namespace

TEST_CASE("what is valid stays as it is") {
  for (const Disk& disk : disks_and_openings()) {
    CAPTURE(disk.name);
    const Prepared p = checked(disk.mesh);
    CHECK(p.repairs.empty());
    CHECK(p.mesh->vertices == disk.mesh.vertices);
    CHECK(p.mesh->triangles == disk.mesh.triangles);
    for (std::size_t i = 0; i < p.new_vertex.size(); ++i)
      CHECK(p.new_vertex[i] == static_cast<int>(i));
  }
}

TEST_CASE("triangles with vertices of their own are welded") {
  for (const Disk& disk : disks_and_openings()) {
    CAPTURE(disk.name);
    if (n_triangles(disk.mesh) < 2) continue;
    const TriangleMesh given = soup(disk.mesh);
    const Prepared p = checked(given);
    REQUIRE(n_vertices(*p.mesh) == n_vertices(disk.mesh));
    REQUIRE(n_triangles(*p.mesh) == n_triangles(disk.mesh));
    REQUIRE(p.repairs.size() == 1);
    CHECK(p.repairs[0].kind == Problem::Kind::kUnwelded);
    CHECK(p.repairs[0].message == "welded " + std::to_string(n_vertices(given)) + " vertices to " +
                                      std::to_string(n_vertices(disk.mesh)));
    CHECK(p.repairs[0].ids.size() ==
          static_cast<std::size_t>(n_vertices(given) - n_vertices(disk.mesh)));
  }
}

TEST_CASE("a seam is welded, a slit of a valid mesh is not") {
  const Disk disk = shapes::grid(6, 4);
  TriangleMesh mesh = disk.mesh;  // the right half with vertices of its own
  std::vector<int> copy(static_cast<std::size_t>(n_vertices(mesh)), -1);
  for (int f = 0; f < n_triangles(disk.mesh); ++f) {
    double x = 0;
    for (int k = 0; k < 3; ++k) x += disk.plane(disk.mesh.triangles(f, k), 0) / 3;
    for (int k = 0; k < 3 && x > 3; ++k) {
      const int v = disk.mesh.triangles(f, k);
      if (disk.plane(v, 0) != 3) continue;
      int& w = copy[static_cast<std::size_t>(v)];
      if (w < 0) w = n_vertices(mesh), add_vertex(mesh, 3, disk.plane(v, 1), 0);
      mesh.triangles(f, k) = w;
    }
  }
  REQUIRE(n_vertices(mesh) == n_vertices(disk.mesh) + 5);
  const Prepared p = checked(mesh);
  CHECK(p.mesh->triangles == disk.mesh.triangles);
  REQUIRE(p.repairs.size() == 1);
  CHECK(p.repairs[0].ids == Ids{35, 36, 37, 38, 39});

  TriangleMesh slit = shapes::frame(5, 2).mesh;  // closed to a slit without area
  for (int v = 0; v < n_vertices(slit); ++v)
    if (slit.vertices(v, 0) > 1.5 && slit.vertices(v, 0) < 3.5 && slit.vertices(v, 1) > 2.5)
      slit.vertices(v, 2) = 0.5;
  CHECK(checked(slit).repairs.empty());
}

TEST_CASE("what only seems small beside a degenerate triangle stays") {
  TriangleMesh mesh = shapes::single_triangle().mesh;
  mesh.vertices.conservativeResize(6, 3);
  mesh.vertices.bottomRows(3) << 5, 0, 0, 5, 1, 0, -1e149, 0, 1;
  add_triangle(mesh, 3, 4, 5);
  const Prepared p = checked(mesh);
  REQUIRE(!p.repairs.empty());
  CHECK(p.repairs[0].message == "dropped 1 degenerate triangle");
  CHECK(p.repairs[0].ids == Ids{1});
  CHECK(p.mesh->triangles == shapes::single_triangle().mesh.triangles);
}

TEST_CASE("repeated, degenerate and turned triangles, and vertices without") {
  const TriangleMesh clean = shapes::grid(6, 5).mesh;
  TriangleMesh mesh = clean;
  const int n = n_triangles(clean);
  SUBCASE("repeated") {
    add_triangle(mesh, mesh.triangles(7, 1), mesh.triangles(7, 2), mesh.triangles(7, 0));
    add_triangle(mesh, mesh.triangles(9, 1), mesh.triangles(9, 0), mesh.triangles(9, 2));
    check_only(checked(mesh), Problem::Kind::kRepeatedTriangle, "dropped 2 repeated triangles",
               {n, n + 1});
  }
  SUBCASE("with equal corners") {
    add_triangle(mesh, 3, 3, 4);
    add_triangle(mesh, 5, 5, 5);
    check_only(checked(mesh), Problem::Kind::kDegenerateTriangle, "dropped 2 degenerate triangles",
               {n, n + 1});
  }
  SUBCASE("turned") {
    for (int f : {3, 17, 18, 40}) turn(mesh, f);
    check_only(checked(mesh), Problem::Kind::kInconsistentOrientation, "turned 4 triangles over",
               {3, 17, 18, 40});
  }
  SUBCASE("unused vertices") {
    add_vertex(mesh, 1, 2, 3);
    add_vertex(mesh, 0, 0, 0);
    check_only(checked(mesh), Problem::Kind::kUnreferencedVertex,
               "dropped 2 vertices that no triangle uses", {42, 43});
  }
  const Prepared p = checked(mesh);
  CHECK(p.mesh->vertices == clean.vertices);
  for (int f = 0; f < n; ++f)
    for (int k = 0; k < 3; ++k) {
      const auto row = p.mesh->triangles.row(f), want = clean.triangles.row(f);
      CHECK((row[0] == want[k] || row[1] == want[k] || row[2] == want[k]));
    }
  CHECK(n_triangles(*p.mesh) == n);
}

TEST_CASE("a triangle without area leaves no gap") {
  // Vertex 12 of a grid lies on the edge between 11 and 13 of a triangle across.
  TriangleMesh mesh;
  mesh.vertices.resize(6, 3);
  mesh.vertices << 0, 0, 0, 2, 0, 0, 1, 0, 0, 1, 2, 0, 0.5, -1, 0, 1.5, -1, 0;
  mesh.triangles.resize(5, 3);
  mesh.triangles << 0, 1, 3, 0, 2, 1, 0, 4, 2, 4, 5, 2, 2, 5, 1;
  const Prepared p = checked(mesh);
  CHECK(n_triangles(*p.mesh) == 5);
  CHECK(n_vertices(*p.mesh) == 6);
  CHECK(area(*p.mesh) == doctest::Approx(area(mesh)));
  CHECK(shapes::half_edges(*p.mesh).loops() == 1);
  CHECK(p.repairs[0].kind == Problem::Kind::kDegenerateTriangle);
}

TEST_CASE("a short edge becomes one vertex: a closed surface stays closed") {
  for (double length : {1e-16, 1e-14, 1e-13, 5e-13, 1e-12}) {
    CAPTURE(length);
    TriangleMesh mesh = shapes::sphere(2);
    const int u = mesh.triangles(40, 0), v = mesh.triangles(40, 1);
    mesh.vertices.row(v) =
        (1 - length) * mesh.vertices.row(u) + length * Eigen::RowVector3d(mesh.vertices.row(v));
    const Prepared p = ism::prepare(mesh);
    CHECK(p.problems.empty());
    CHECK(n_triangles(*p.mesh) == 126);
    CHECK(shapes::half_edges(*p.mesh).loops() == 0);
    CHECK(p.new_vertex[static_cast<std::size_t>(u)] == p.new_vertex[static_cast<std::size_t>(v)]);
    CHECK(p.repairs[0].kind == Problem::Kind::kDegenerateTriangle);
  }
}

/// A tetrahedron with points on edges of triangle 0, on one side only: its vertices 4 and 5.
TriangleMesh cut_tetrahedron(bool on_one_edge) {
  TriangleMesh mesh = {ism::Points3(6, 3), ism::Triangles(8, 3)};
  mesh.vertices << 0, 0, 0, 3, 0, 0, 0, 3, 0, 0, 0, 3, 1, 0, 0, 2, 0, 0;
  if (on_one_edge) {
    mesh.triangles << 0, 2, 1, 0, 4, 3, 4, 5, 3, 5, 1, 3, 1, 2, 3, 0, 3, 2, 0, 1, 4, 4, 1, 5;
  } else {
    mesh.vertices.row(5) << 0, 1, 0;
    mesh.triangles << 0, 2, 1, 0, 4, 3, 4, 1, 3, 1, 2, 3, 0, 3, 5, 5, 3, 2, 0, 1, 4, 0, 5, 2;
  }
  return mesh;
}

TEST_CASE("several corners on the edges of one triangle leave no gap") {
  for (bool on_one_edge : {true, false})
    for (bool turned_around : {false, true}) {
      TriangleMesh mesh = cut_tetrahedron(on_one_edge);
      if (turned_around) mesh.triangles.row(6).swap(mesh.triangles.row(7));
      const Prepared p = checked(mesh);
      CHECK(shapes::half_edges(*p.mesh).loops() == 0);
      CHECK(n_triangles(*p.mesh) == 8);
      CHECK(area(*p.mesh) == doctest::Approx(area(mesh)));
      CHECK(p.new_triangle == Ids({0, 1, 2, 3, 4, 5, -1, -1}));
      CHECK(std::count(p.given_triangle.begin(), p.given_triangle.end(), 0) == 3);
    }
}

TEST_CASE("a landmark in a triangle that was cut stays where it is") {
  const TriangleMesh clean = cut_tetrahedron(true);
  ism::Options options;
  options.exact_landmarks = true;
  for (int turns = 0; turns < 9; ++turns) {
    TriangleMesh mesh = clean;
    for (int k = 0; k < 3; ++k) {
      mesh.triangles(0, k) = clean.triangles(0, (k + turns) % 3);
      mesh.triangles(6, k) = clean.triangles(6, (k + turns / 3) % 3);
    }
    for (int k = 0; k < 3; ++k) {
      ism::SurfacePoint at = {0, {0.1, 0.15, 0.15}};
      at.barycentric[k] = 0.85 - (at.barycentric.sum() - at.barycentric[k]);
      at.barycentric /= at.barycentric.sum();
      Eigen::RowVector3d wanted = Eigen::RowVector3d::Zero();
      for (int c = 0; c < 3; ++c)
        wanted += at.barycentric[c] * mesh.vertices.row(mesh.triangles(0, c));
      const ism::Embedding start = ism::initial_embedding(mesh, mesh, {{at, at}, {3, 3}}, options);
      CAPTURE(start.message);
      REQUIRE(start.status == ism::Status::kDone);
      double nearest = 1;
      for (int v = 0; v < n_vertices(*start.a); ++v)
        nearest = std::min(nearest, (start.a->vertices.row(v) - wanted).norm());
      CHECK(nearest < 1e-12);
    }
  }
}

TEST_CASE("a vertex that no triangle uses does not matter, wherever it is") {
  TriangleMesh mesh = shapes::grid(6, 6).mesh;
  turn(mesh, 0);
  add_vertex(mesh, 0, 0, 0);
  const Prepared expected = checked(mesh);
  CHECK(expected.repairs.size() == 2);
  for (double at : {1e100, 1.7e308, std::numeric_limits<double>::quiet_NaN()}) {
    mesh.vertices(n_vertices(mesh) - 1, 1) = at;
    const Prepared p = ism::prepare(mesh);
    CHECK(p.problems.empty());
    CHECK(p.mesh->triangles == expected.mesh->triangles);
    CHECK(p.repairs.size() == 2);
  }
  mesh.vertices(0, 0) = std::numeric_limits<double>::quiet_NaN();
  CHECK(ism::prepare(mesh).problems[0].message == "vertex 0 has a coordinate that is not finite");
}

TEST_CASE("a torus is refused in the ids given, and one that was cut stays cut") {
  const int n = 6, m = 4;
  TriangleMesh closed = {ism::Points3(1 + n * m, 3), ism::Triangles(2 * n * m, 3)};
  TriangleMesh open = {ism::Points3(1 + (n + 1) * (m + 1), 3), closed.triangles};
  for (TriangleMesh* mesh : {&closed, &open}) {
    const int rows = mesh == &open ? m + 1 : m;  // vertex 0 is not used
    const auto id = [&](int i, int j) {
      return 1 + (mesh == &open ? i : i % n) * rows + (mesh == &open ? j : j % m);
    };
    mesh->vertices.row(0) << 9, 9, 9;
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j <= m; ++j) {
        const double phi = 2 * shapes::kPi * (i % n) / n, psi = 2 * shapes::kPi * (j % m) / m;
        const double r = 3 + std::cos(psi);
        mesh->vertices.row(id(i, j)) << r * std::cos(phi), r * std::sin(phi), std::sin(psi);
      }
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < m; ++j) {
        mesh->triangles.row(2 * (i * m + j)) << id(i, j), id(i + 1, j), id(i + 1, j + 1);
        mesh->triangles.row(2 * (i * m + j) + 1) << id(i, j), id(i + 1, j + 1), id(i, j + 1);
      }
  }
  const Prepared p = ism::prepare(closed);
  REQUIRE(p.problems.size() == 1);
  CHECK(p.problems[0].message.find("genus 1") != std::string::npos);
  CHECK(p.given_vertex[0] == 1);  // so that ids differ
  check_only(checked(open), Problem::Kind::kUnreferencedVertex,
             "dropped 1 vertex that no triangle uses", {0});
}

TEST_CASE("flaps are cut off, surfaces that meet in an edge or a vertex apart") {
  const TriangleMesh clean = shapes::grid(6, 5).mesh;
  TriangleMesh mesh = clean;
  SUBCASE("a flap on an inner edge") {
    add_vertex(mesh, 2, 2, 1);
    const int f = 24;  // an inner triangle
    add_triangle(mesh, mesh.triangles(f, 0), mesh.triangles(f, 1), n_vertices(mesh) - 1);
  }
  SUBCASE("a wall along a row of edges") {
    const int first = n_vertices(mesh);
    for (int i = 1; i <= 4; ++i) add_vertex(mesh, i, 2, 1);
    for (int v = 0; v < first; ++v)
      for (int w = 0; w < first; ++w)
        if (mesh.vertices(v, 1) == 2 && mesh.vertices(w, 1) == 2 && mesh.vertices(v, 0) >= 1 &&
            mesh.vertices(v, 0) < 4 && mesh.vertices(w, 0) == mesh.vertices(v, 0) + 1) {
          const int up = first + static_cast<int>(mesh.vertices(v, 0)) - 1;
          add_triangle(mesh, v, w, up);
          add_triangle(mesh, w, up + 1, up);
        }
  }
  SUBCASE("a triangle at a vertex") {
    add_vertex(mesh, 2, 2, 1);
    add_vertex(mesh, 2, 2.5, 1);
    add_triangle(mesh, 24, n_vertices(mesh) - 2, n_vertices(mesh) - 1);
  }
  REQUIRE(!ism::validate(mesh).empty());
  const Prepared p = checked(mesh);
  CHECK(p.mesh->vertices == clean.vertices);
  CHECK(p.mesh->triangles == clean.triangles);
  CHECK(p.repairs.back().kind == Problem::Kind::kSeveralComponents);
}

TEST_CASE("of several components the one with most landmarks is kept, else the largest") {
  TriangleMesh mesh = shapes::grid(4, 4).mesh;
  const TriangleMesh other = shapes::grid(3, 3).mesh;
  const int first = n_vertices(mesh), first_triangle = n_triangles(mesh);
  for (int v = 0; v < n_vertices(other); ++v)
    add_vertex(mesh, other.vertices(v, 0), other.vertices(v, 1), 5);
  for (int f = 0; f < n_triangles(other); ++f)
    add_triangle(mesh, first + other.triangles(f, 0), first + other.triangles(f, 1),
                 first + other.triangles(f, 2));
  CHECK(n_triangles(*checked(mesh).mesh) == 32);
  CHECK(n_triangles(*checked(mesh, {3}).mesh) == 32);
  const Prepared p = checked(mesh, {first + 2, 3, ism::SurfacePoint{first_triangle, {1, 0, 0}}});
  CHECK(n_triangles(*p.mesh) == 18);
  CHECK(p.mesh->triangles == other.triangles);
  CHECK(p.new_vertex[2] == -1);
  CHECK(p.new_vertex[static_cast<std::size_t>(first) + 2] == 2);
  REQUIRE(p.repairs.size() == 1);
  CHECK(p.repairs[0].message == "dropped 1 component, 32 triangles");
}

TEST_CASE("meshes are mended in any unit") {
  TriangleMesh mesh = soup(shapes::grid(3, 3).mesh);
  turn(mesh, 5);
  const TriangleMesh small = soup(shapes::grid(1, 1).mesh);  // a component, and the first one
  TriangleMesh both;
  both.vertices.resize(small.vertices.rows() + mesh.vertices.rows(), 3);
  both.vertices << (small.vertices.array() + 10).matrix(), mesh.vertices;
  both.triangles.resize(small.triangles.rows() + mesh.triangles.rows(), 3);
  both.triangles << small.triangles,
      (mesh.triangles.array() + static_cast<int>(small.vertices.rows())).matrix();
  const Prepared expected = checked(both);
  for (double unit : {1e-250, 1e-100, 1e100, 1e250}) {
    TriangleMesh scaled = both;
    scaled.vertices *= unit;
    const Prepared p = checked(scaled);
    CHECK(p.mesh->triangles == expected.mesh->triangles);
    CHECK(p.given_corner == expected.given_corner);
  }
}

TEST_CASE("20,000 triangles at one edge are taken apart in time") {
  TriangleMesh book;
  add_vertex(book, 0, 0, 0);
  add_vertex(book, 0, 0, 1);
  constexpr int n = 20000;
  book.vertices.conservativeResize(n + 2, Eigen::NoChange);
  book.triangles.resize(n, 3);
  for (int i = 0; i < n; ++i) {
    const double angle = 6.28 * i / n;
    book.vertices.row(i + 2) << std::cos(angle), std::sin(angle), 0.5;
    book.triangles.row(i) << 0, 1, i + 2;
  }
  CHECK(n_triangles(*checked(book).mesh) == 1);
}

TEST_CASE("a surface with one side, and one with a handle, are refused with the reason") {
  TriangleMesh strip = shapes::grid(12, 2).mesh;
  for (int v = 0; v < n_vertices(strip); ++v) {
    const double t = 2 * shapes::kPi * strip.vertices(v, 0) / 12;
    const double s = 0.3 * (strip.vertices(v, 1) - 1);
    strip.vertices.row(v) << (2 + s * std::cos(t / 2)) * std::cos(t),
        (2 + s * std::cos(t / 2)) * std::sin(t), s * std::sin(t / 2);
  }
  for (int i = 0; i < strip.triangles.size(); ++i)  // the ends are one
    for (int w = 0; w < strip.triangles.data()[i]; ++w)
      if ((strip.vertices.row(strip.triangles.data()[i]) - strip.vertices.row(w)).norm() < 1e-9)
        strip.triangles.data()[i] = w;
  add_vertex(strip, 9, 9, 9);  // so that something is wrong
  Prepared p = ism::prepare(strip);
  REQUIRE(p.problems.size() == 1);
  CHECK(p.problems[0].kind == Problem::Kind::kNotOrientable);
}

TEST_CASE("meshes that were damaged in many ways are mended") {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    CAPTURE(seed);
    Rng rng(seed + 100);
    Disk disk = seed % 2 ? shapes::with_openings(7, 8, rng) : shapes::random_disk(6, 6, rng);
    shapes::bend(disk, 0.5);
    TriangleMesh mesh = disk.mesh;
    if (rng.below(2)) mesh = soup(mesh);
    const int n = n_triangles(mesh);
    for (int i = 0; i < 5; ++i) {
      const int f = rng.below(n);
      switch (rng.below(5)) {
        case 0:
          turn(mesh, f);
          break;
        case 1:
          add_triangle(mesh, mesh.triangles(f, 1), mesh.triangles(f, 2), mesh.triangles(f, 0));
          break;
        case 2:
          add_triangle(mesh, mesh.triangles(f, 1), mesh.triangles(f, 1), mesh.triangles(f, 0));
          break;
        case 3:
          add_vertex(mesh, rng.uniform(0, 1), 0, 0);
          break;
        default: {
          if (is_on_rim(disk, f)) break;  // it would be a part of the surface
          const auto row = mesh.triangles.row(f);
          const Eigen::RowVector3d p = mesh.vertices.row(row[0]);
          add_vertex(mesh, p.x(), p.y(), p.z() + 3);
          add_triangle(mesh, row[0], row[1], n_vertices(mesh) - 1);
        }
      }
    }
    const Prepared p = checked(mesh);
    CHECK(n_triangles(*p.mesh) == n_triangles(disk.mesh));
    CHECK(n_vertices(*p.mesh) == n_vertices(disk.mesh));
    CHECK(area(*p.mesh) == doctest::Approx(area(disk.mesh)));
  }
}

// ---- orientation, closed lips, doubled surfaces ----

TEST_CASE("a closed surface gets the orientation of positive volume, whatever most of it has") {
  const TriangleMesh ball = shapes::blob(3, 0.3, 1);
  const int n = n_triangles(ball);
  for (int turned : {n, 6 * n / 10, n / 10}) {
    TriangleMesh mesh = ball;
    for (int f = 0; f < turned; ++f) turn(mesh, f);
    const Prepared p = checked(mesh);
    REQUIRE(p.repairs.size() == 1);
    CHECK(p.repairs[0].kind == Problem::Kind::kInconsistentOrientation);
    CHECK(p.repairs[0].ids.size() == static_cast<std::size_t>(turned));
    const bool tells = p.repairs[0].message.find("inside out") != std::string::npos;
    CHECK(tells == (2 * turned > n));
    for (int f = 0; f < n; ++f) {  // with the first corner it had
      CHECK(p.mesh->triangles(f, 0) == ball.triangles(f, 0));
      CHECK(p.mesh->triangles(f, 1) == ball.triangles(f, 1));
    }
  }
  const Prepared p = checked(soup(ball));
  CHECK(p.mesh->triangles.rows() == n);
}

namespace {

/// A square with a mouth that is closed: a slit of pairs of vertices at equal places.
TriangleMesh with_lips() {
  TriangleMesh mesh = shapes::grid(10, 10).mesh;
  const auto is_on_slit = [&](int v) {
    const Eigen::RowVector3d p = mesh.vertices.row(v);
    return p.y() == 5 && p.x() > 2.5 && p.x() < 7.5;
  };
  const int n = n_vertices(mesh);
  Ids lower(static_cast<std::size_t>(n), -1);
  for (int f = 0; f < n_triangles(mesh); ++f) {
    double y = 0;
    for (int k = 0; k < 3; ++k) y += mesh.vertices(mesh.triangles(f, k), 1) / 3;
    for (int k = 0; k < 3 && y < 5; ++k) {
      const int v = mesh.triangles(f, k);
      if (!is_on_slit(v)) continue;
      int& copy = lower[static_cast<std::size_t>(v)];
      if (copy < 0) {
        copy = n_vertices(mesh);
        add_vertex(mesh, mesh.vertices(v, 0), mesh.vertices(v, 1), mesh.vertices(v, 2));
      }
      mesh.triangles(f, k) = copy;
    }
  }
  return mesh;
}

}  // namespace

TEST_CASE("closed lips stay apart, whatever is wrong elsewhere") {
  const TriangleMesh lips = with_lips();
  REQUIRE(ism::validate(lips).empty());
  REQUIRE(shapes::half_edges(lips).loops() == 2);
  const int last = n_triangles(lips) - 1, n = n_vertices(lips);
  const std::vector<std::function<void(TriangleMesh&)>> defects = {
      [&](TriangleMesh& m) { add_vertex(m, 1, 1, 1); },
      [&](TriangleMesh& m) { turn(m, last); },
      [&](TriangleMesh& m) {  // a triangle once more,
        add_triangle(m, m.triangles(0, 1), m.triangles(0, 2), m.triangles(0, 0));
      },
      [&](TriangleMesh& m) {  // with vertices of its own,
        for (int k = 0; k < 3; ++k) {
          const Eigen::RowVector3d p = m.vertices.row(m.triangles(0, k));
          add_vertex(m, p.x(), p.y(), p.z());
        }
        add_triangle(m, n, n + 1, n + 2);
      },
      [&](TriangleMesh& m) {  // and one at the lips
        int f = 0;
        while (m.triangles.row(f).maxCoeff() < n - 2) ++f;
        for (int k = 0; k < 3; ++k) {
          const Eigen::RowVector3d p = m.vertices.row(m.triangles(f, k));
          add_vertex(m, p.x(), p.y(), p.z());
        }
        add_triangle(m, n, n + 1, n + 2);
      },
      [&](TriangleMesh& m) {  // a loose part
        for (int k = 0; k < 3; ++k) add_vertex(m, 20 + k % 2, k, 3);
        add_triangle(m, n, n + 1, n + 2);
      },
      [&](TriangleMesh& m) {  // a flap on an inner edge
        add_vertex(m, 0.5, 0.5, 3);
        add_triangle(m, m.triangles(0, 0), m.triangles(0, 2), n);
      },
      [&](TriangleMesh& m) { add_triangle(m, 0, 0, 1); },
      [&](TriangleMesh& m) {  // a needle with vertices of its own along the lips
        for (double x : {3.0, 4.0, 4.0}) add_vertex(m, x, 5, 0);
        add_triangle(m, n, n + 1, n + 2);
      },
      [&](TriangleMesh& m) {  // a flat triangle along an edge of two others
        const Eigen::RowVector3d p = m.vertices.row(m.triangles(0, 0)),
                                 q = m.vertices.row(m.triangles(0, 2));
        add_vertex(m, (p.x() + q.x()) / 2, (p.y() + q.y()) / 2, 0);
        add_triangle(m, m.triangles(0, 0), m.triangles(0, 2), n);
      }};
  for (std::size_t i = 0; i < defects.size(); ++i) {
    CAPTURE(i);
    TriangleMesh mesh = lips;
    defects[i](mesh);
    REQUIRE_FALSE(ism::validate(mesh).empty());
    const Prepared p = checked(mesh);
    CHECK(n_vertices(*p.mesh) == n);
    CHECK(n_triangles(*p.mesh) == n_triangles(lips));
    CHECK(shapes::half_edges(*p.mesh).loops() == 2);
    CHECK(p.mesh->vertices == lips.vertices);
  }
}

TEST_CASE("parts are welded along their seams, also where one meets itself there; lips are not") {
  // The square in two halves, x < 5 and x > 5 with vertices of their own; and the right one is cut
  // along y = 5 from the seam to the rim, which is a part of that seam.
  const TriangleMesh whole = with_lips();
  TriangleMesh mesh = shapes::grid(10, 10).mesh;
  const auto split = [](const TriangleMesh& given, const auto& side_of) {
    TriangleMesh result;
    std::map<std::pair<int, int>, int> id;
    for (int f = 0; f < n_triangles(given); ++f) {
      Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
      for (int k = 0; k < 3; ++k) middle += given.vertices.row(given.triangles(f, k)) / 3;
      int v[3];
      for (int k = 0; k < 3; ++k) {
        const auto [place, is_new] =
            id.insert({{given.triangles(f, k), side_of(middle)}, n_vertices(result)});
        const Eigen::RowVector3d p = given.vertices.row(given.triangles(f, k));
        if (is_new) add_vertex(result, p.x(), p.y(), p.z());
        v[k] = place->second;
      }
      add_triangle(result, v[0], v[1], v[2]);
    }
    return result;
  };
  const auto halves = [](const Eigen::RowVector3d& p) { return p.x() < 5 ? 0 : 1; };
  const Prepared two = checked(split(mesh, halves));
  CHECK(n_vertices(*two.mesh) == n_vertices(mesh));
  const Prepared with_mouth = checked(split(whole, [](const Eigen::RowVector3d& p) {
    return p.y() < 2 ? 0 : 1;  // the lips are in one part
  }));
  CHECK(n_vertices(*with_mouth.mesh) == n_vertices(whole));
  CHECK(shapes::half_edges(*with_mouth.mesh).loops() == 2);
  const TriangleMesh slit =
      split(mesh, [](const Eigen::RowVector3d& p) { return p.x() < 5 ? 0 : 1; });
  const Prepared apart = ism::prepare(slit, {}, false);
  CHECK(apart.problems.empty());
  CHECK(n_triangles(*apart.mesh) == n_triangles(mesh) / 2);  // a half, of which none was welded
}

TEST_CASE("a copy of a triangle at closed lips is at the lip that it is a copy of") {
  const TriangleMesh lips = with_lips();
  const int n = n_vertices(lips);
  for (int f = 0; f < n_triangles(lips); ++f) {
    TriangleMesh mesh = lips;
    for (int k = 0; k < 3; ++k) {
      const Eigen::RowVector3d p = mesh.vertices.row(mesh.triangles(f, k));
      add_vertex(mesh, p.x(), p.y(), p.z());
    }
    add_triangle(mesh, n, n + 1, n + 2);
    const Prepared p = checked(mesh);
    for (int k = 0; k < 3; ++k)
      CHECK(p.new_vertex[static_cast<std::size_t>(n + k)] == mesh.triangles(f, k));
  }
}

TEST_CASE("of the two sides of a doubled surface the one with the landmarks stays") {
  const TriangleMesh front = shapes::grid(5, 5).mesh;
  const int n = n_vertices(front), faces = n_triangles(front);
  TriangleMesh both = front;  // the back, with vertices of its own, comes first
  for (int f = 0; f < faces; ++f) turn(both, f);
  both.vertices.conservativeResize(2 * n, Eigen::NoChange);
  both.vertices.bottomRows(n) = front.vertices;
  for (int f = 0; f < faces; ++f)
    add_triangle(both, n + front.triangles(f, 0), n + front.triangles(f, 1),
                 n + front.triangles(f, 2));
  const Prepared at_front = checked(both, {n + 3, n + 20});
  CHECK(at_front.mesh->triangles == front.triangles);
  CHECK(at_front.new_vertex[3] == 3);  // copies are where those that stay are
  CHECK(at_front.new_vertex[static_cast<std::size_t>(n + 3)] == 3);
  CHECK(at_front.new_triangle[0] == -1);
  const Prepared at_back = checked(both, {3, 20});
  CHECK(at_back.given_triangle[0] == 0);
  const Prepared in_a_triangle =
      checked(both, {ism::SurfacePoint{faces + 2, Eigen::Vector3d(0.2, 0.3, 0.5)}});
  CHECK(in_a_triangle.mesh->triangles == front.triangles);
}

TEST_CASE("a landmark on what was dropped goes to the surface that is kept, if that is near") {
  const Disk a = shapes::grid(6, 6), b = shapes::grid(6, 6);
  TriangleMesh mesh = a.mesh;  // with a part that has one vertex near the surface, and others far
  const int n = n_vertices(mesh);
  add_vertex(mesh, 2.3, 2.2, 0.01);
  add_vertex(mesh, 2.3, 2.2, 9);
  add_vertex(mesh, 3.3, 2.2, 9);
  add_triangle(mesh, n, n + 1, n + 2);
  ism::Options options;
  options.threads = 1;
  options.max_iterations = 0;
  const ism::Embedding near =
      ism::initial_embedding(mesh, b.mesh, {{n, 16}, {40, 40}, {8, 8}}, options);
  CHECK(near.status == ism::Status::kDone);
  CHECK(near.warnings.empty());
  const ism::Embedding far =
      ism::initial_embedding(mesh, b.mesh, {{n + 1, 16}, {40, 40}, {8, 8}}, options);
  CHECK(far.status == ism::Status::kDone);
  REQUIRE(far.warnings.size() == 1);
  CHECK(far.warnings[0].ids == shapes::Ids{shapes::of_a(n + 1)});
  options.exact_landmarks = true;
  const ism::Embedding exact =
      ism::initial_embedding(mesh, b.mesh, {{n + 1, 16}, {40, 40}}, options);
  CHECK(exact.status == ism::Status::kInvalidLandmarks);
  CHECK(exact.ids == shapes::Ids{shapes::of_a(n + 1)});
}

// ---- maps of what was prepared ----

namespace {

/// A mesh with a vertex that is not used in front, and with defects behind; ids are one more.
TriangleMesh damaged(const TriangleMesh& clean) {
  TriangleMesh mesh;
  mesh.vertices.resize(clean.vertices.rows() + 1, 3);
  mesh.vertices.row(0) << 7, 7, 7;
  mesh.vertices.bottomRows(clean.vertices.rows()) = clean.vertices;
  mesh.triangles = clean.triangles.array() + 1;
  for (int f : {4, 9, 20}) turn(mesh, f);
  add_triangle(mesh, mesh.triangles(5, 1), mesh.triangles(5, 2), mesh.triangles(5, 0));
  add_triangle(mesh, 3, 3, 8);
  return mesh;
}

ism::Options some_iterations() {
  ism::Options options;
  options.threads = 1;
  options.max_iterations = 6;
  return options;
}

}  // namespace

TEST_CASE("a damaged mesh is mapped as the clean one, with landmarks and constraints in its ids") {
  Rng rng(31);
  Disk a = shapes::random_disk(7, 7, rng), b = shapes::random_disk(6, 8, rng);
  shapes::bend(a, 0.5);
  shapes::bend(b, -0.4);
  const TriangleMesh given = damaged(a.mesh);
  const std::vector<ism::LandmarkPoint> on_a = {10, 50, ism::SurfacePoint{9, {0.2, 0.3, 0.5}}};
  std::vector<ism::Landmark> landmarks, of_given;
  for (int i = 0; i < 3; ++i) {
    const ism::LandmarkPoint& l = on_a[static_cast<std::size_t>(i)];
    landmarks.push_back({l, 12 + 20 * i});
    of_given.push_back({l.vertex < 0 ? l : ism::LandmarkPoint(l.vertex + 1), 12 + 20 * i});
  }
  ism::Options options = some_iterations(), options_of_given = options;
  SUBCASE("landmarks") {}
  SUBCASE("exact landmarks") { options.exact_landmarks = options_of_given.exact_landmarks = true; }
  SUBCASE("pins") {
    options.pins_a = {50};
    options_of_given.pins_a = {51};
  }
  SUBCASE("held boundaries") {
    options.boundary = options_of_given.boundary = ism::Boundary::kSlide;
  }
  // The damage turns triangle 9, whose corners then have another order.
  TriangleMesh clean = a.mesh;
  for (int f : {4, 9, 20}) CHECK(clean.triangles.row(f) != given.triangles.row(f));
  std::swap(of_given[2].a.point.barycentric[1], of_given[2].a.point.barycentric[2]);
  const ism::Result expected = ism::compute_map(clean, b.mesh, landmarks, options);
  const ism::Result r = ism::compute_map(given, b.mesh, of_given, options_of_given);
  CAPTURE(r.message);
  REQUIRE(ism::is_usable(r.status));
  CHECK(r.status == expected.status);
  CHECK(r.start.a->vertices == expected.start.a->vertices);
  CHECK(r.f == expected.f);
  CHECK(r.g == expected.g);
  CHECK(r.start.prepared_a->repairs.size() == 4);
  CHECK(r.start.prepared_b->repairs.empty());
  CHECK(ism::SurfaceMap(r).status() == ism::Status::kDone);

  ism::Solver solver(given, b.mesh, of_given, options_of_given);
  while (solver.result().log.empty() && solver.step()) {
  }
  of_given[0].b = 13;
  CHECK(solver.change(of_given, options_of_given).status == ism::Status::kDone);
  CHECK(ism::is_usable(solver.result().status));
}

TEST_CASE("what is wrong with constraints on a prepared mesh is said in the ids given") {
  const Disk a = shapes::grid(6, 6), b = shapes::grid(6, 6);
  const TriangleMesh given = damaged(a.mesh);
  ism::Options options = some_iterations();
  options.exact_landmarks = true;
  ism::Result r = ism::compute_map(given, b.mesh, {{0, 3}}, options);
  CHECK(r.status == ism::Status::kInvalidLandmarks);
  CHECK(r.message == "landmark 0 3: vertex 0 of A was dropped when the mesh was prepared");
  CHECK(r.ids == shapes::Ids{shapes::of_a(0)});
  options.exact_landmarks = false;
  r = ism::compute_map(given, b.mesh, {{0, 3}}, options);
  CHECK(ism::is_usable(r.status));
  REQUIRE(r.warnings.size() == 1);
  CHECK(r.warnings[0].message ==
        "landmark 0 3: vertex 0 of A was dropped when the mesh was prepared: it is left out");
  CHECK(r.warnings[0].ids == shapes::Ids{shapes::of_a(0)});
  r = ism::compute_map(given, b.mesh, {{50, 3}}, options);
  CHECK(r.message == "landmark 50 3: mesh A has no vertex 50, it has 50 vertices, counted from 0");
  options.fixed_a = {0};
  r = ism::compute_map(given, b.mesh, {}, options);
  CHECK(r.message == "vertex 0 of A is to be fixed, but it was dropped when the mesh was prepared");
  options.fixed_a = {8};
  options.pins_a = {8};
  r = ism::compute_map(given, b.mesh, {}, options);
  CHECK(r.message == "vertex 8 of A is to be pinned, but it is fixed already");
  CHECK(r.ids == shapes::Ids{shapes::of_a(8)});
  options = some_iterations();
  options.pins_a = {24};  // which the start puts close to each other
  options.pins_b = {25};
  r = ism::compute_map(b.mesh, given, {{0, 1}, {6, 7}, {48, 49}}, options);
  CHECK(r.status == ism::Status::kInvalidPins);
  for (const ism::ElementId& id : r.ids)
    if (id.side == ism::Side::kB)
      CHECK(r.message.find("vertex " + std::to_string(id.id) + " of B") != std::string::npos);
}

TEST_CASE("given positions belong to the vertices given") {
  const Disk a = shapes::grid(6, 6), b = shapes::grid(5, 6);
  const TriangleMesh given = damaged(a.mesh);
  ism::Options options = some_iterations();
  options.initial_f.resize(50, 2);
  options.initial_f.row(0) << 100, 100;
  options.initial_f.bottomRows(49) = a.plane;
  options.initial_g = b.plane;
  const ism::Result r = ism::compute_map(given, b.mesh, {}, options);
  CAPTURE(r.message);
  REQUIRE(ism::is_usable(r.status));
  CHECK(r.start.f == a.plane);
  options.initial_f = a.plane;  // of the prepared mesh, which is not what was given
  const ism::Result refused = ism::compute_map(given, b.mesh, {}, options);
  CHECK(refused.status == ism::Status::kInvalidPositions);
  CHECK(refused.message == "initial_f has 49 rows, the mesh has 50 vertices");
}

}  // namespace prepare_tests

#endif  // ISM_TESTS_PART_PREPARE_HPP

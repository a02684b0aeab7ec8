// The map as a function in both directions, and the meta mesh.

#ifndef ISM_TESTS_PART_MAP_HPP
#define ISM_TESTS_PART_MAP_HPP

#include "ism.hpp"
#include "mesh_io.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <Eigen/Geometry>
#include <Eigen/QR>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace map_tests {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using ism::MetaMesh;
using ism::Points2;
using ism::Points3;
using ism::Status;
using ism::SurfaceMap;
using ism::SurfacePoint;
using ism::TriangleMesh;
using shapes::Disk;
using shapes::map_of;
using shapes::overlapping_pair;
using shapes::planar;
using shapes::Rng;

int n_faces(const Disk& disk) { return static_cast<int>(disk.mesh.triangles.rows()); }
int n_vertices(const Disk& disk) { return static_cast<int>(disk.plane.rows()); }

SurfacePoint random_point(const Disk& disk, Rng& rng) {
  Vector3d weights(rng.uniform(0.01, 1), rng.uniform(0.01, 1), rng.uniform(0.01, 1));
  weights /= weights.sum();
  return {rng.below(n_faces(disk)), weights};
}

double cross(const Vector2d& u, const Vector2d& v) { return u.x() * v.y() - u.y() * v.x(); }

/// The least barycentric coordinate of x in any face of a disk: how deep inside the best one.
double deepest(const Disk& disk, const Vector2d& x) {
  double best = -1e300;
  for (int f = 0; f < n_faces(disk); ++f) {
    Vector2d p[3];
    for (int k = 0; k < 3; ++k) p[k] = disk.plane.row(disk.mesh.triangles(f, k)).transpose();
    const double area = cross(p[1] - p[0], p[2] - p[0]);
    double least = 1;
    for (int k = 0; k < 3; ++k)
      least = std::min(least, cross(p[(k + 1) % 3] - p[k], x - p[k]) / area);
    best = std::max(best, least);
  }
  return best;
}

void check_surface_point(const Disk& disk, const SurfacePoint& p) {
  REQUIRE(p.face >= 0);
  REQUIRE(p.face < n_faces(disk));
  CHECK(p.barycentric.minCoeff() >= 0);
  CHECK(p.barycentric.sum() == doctest::Approx(1).epsilon(1e-14));
}

// ---- meta mesh ----

Vector3d vector_area(const Points3& x, const std::vector<int>& polygon) {
  Vector3d sum = Vector3d::Zero();
  const Vector3d p = x.row(polygon[0]);
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
    const Vector3d u = x.row(polygon[i]), v = x.row(polygon[i + 1]);
    sum += 0.5 * (u - p).cross(v - p);
  }
  return sum;
}

double area_on(const Points3& x, const MetaMesh& mesh) {
  double sum = 0;
  for (const std::vector<int>& polygon : mesh_io::polygons_of(mesh))
    sum += vector_area(x, polygon).norm();
  return sum;
}

double area_of(const TriangleMesh& mesh) {
  double sum = 0;
  for (int f = 0; f < mesh.triangles.rows(); ++f)
    sum += vector_area(mesh.vertices,
                       {mesh.triangles(f, 0), mesh.triangles(f, 1), mesh.triangles(f, 2)})
               .norm();
  return sum;
}

/// The covered areas as the objective counts them.
ism::detail::Iterate covered(const Disk& a, const Disk& b) {
  const ism::detail::JointSurface s = shapes::joined(a.mesh, b.mesh);
  ism::detail::Iterate x;
  x.x = ism::detail::stacked(a.plane, b.plane);
  const ism::DistortionMeasure measure = ism::symmetric_dirichlet();
  ism::detail::evaluate(s, ism::detail::Weights{2, 1e-8, 1e-3, &measure}, x);
  return x;
}

std::set<std::pair<int, int>> check_directed_edges(const MetaMesh& mesh) {
  std::set<std::pair<int, int>> edges;
  for (const std::vector<int>& polygon : mesh_io::polygons_of(mesh)) {
    CHECK(polygon.size() >= 3);
    CHECK(polygon.size() <= 6);
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const int u = polygon[i], v = polygon[(i + 1) % polygon.size()];
      CHECK(u != v);
      CHECK(u >= 0);
      CHECK(u < mesh.on_a.rows());
      CHECK(edges.insert({u, v}).second);  // else two polygons disagree about the orientation
    }
  }
  return edges;
}

int euler_characteristic(const MetaMesh& mesh) {
  std::set<int> used;
  std::set<std::pair<int, int>> edges;
  for (const auto& e : check_directed_edges(mesh)) {
    used.insert(e.first);
    edges.insert(std::minmax(e.first, e.second));
  }
  CHECK(static_cast<int>(used.size()) == mesh.on_a.rows());
  return static_cast<int>(used.size()) - static_cast<int>(edges.size()) + mesh.n_polygons();
}

void check_meta_mesh(const Disk& a, const Disk& b, int expected_characteristic) {
  const MetaMesh mesh = map_of(a, b).meta_mesh();
  REQUIRE(mesh.n_polygons() > 0);
  REQUIRE(mesh.on_b.rows() == mesh.on_a.rows());
  REQUIRE(mesh.face_a.size() == mesh.face_a.size());
  REQUIRE(mesh.face_b.size() == mesh.face_a.size());
  CHECK(euler_characteristic(mesh) == expected_characteristic);
  CHECK(mesh.on_a.allFinite());
  CHECK(mesh.on_b.allFinite());
  const ism::detail::Iterate x = covered(a, b);
  CHECK(area_on(mesh.on_a, mesh) == doctest::Approx(x.area_a).epsilon(1e-10));
  CHECK(area_on(mesh.on_b, mesh) == doctest::Approx(x.area_b).epsilon(1e-10));
}

/// Distance of p from the plane and the inside of a triangle of a mesh, as a barycentric excess.
double outside(const TriangleMesh& mesh, int face, const Vector3d& p) {
  Vector3d q[3];
  for (int k = 0; k < 3; ++k) q[k] = mesh.vertices.row(mesh.triangles(face, k));
  const Vector3d n = (q[1] - q[0]).cross(q[2] - q[0]);
  double excess = std::abs(n.dot(p - q[0])) / n.squaredNorm();
  for (int k = 0; k < 3; ++k)
    excess = std::max(excess, -n.dot((q[(k + 1) % 3] - q[k]).cross(p - q[k])) / n.squaredNorm());
  return excess;
}

void check_unusable(const SurfaceMap& map, Status status, const std::string& what) {
  CAPTURE(what);
  CAPTURE(map.message());
  CHECK(map.status() == status);
  CHECK(map.message().find(what) != std::string::npos);
  CHECK_FALSE(map.forward({0, Vector3d::Constant(1.0 / 3)}).exists());
  CHECK_FALSE(map.backward({0, Vector3d::Constant(1.0 / 3)}).exists());
  CHECK_FALSE(map.forward_vertex(0).exists());
  CHECK_FALSE(map.backward_vertex(0).exists());
  for (const SurfacePoint& p : map.forward_vertices()) CHECK_FALSE(p.exists());
  for (const SurfacePoint& p : map.backward_vertices()) CHECK_FALSE(p.exists());
  CHECK(map.meta_mesh().corners.empty());
  CHECK(map.meta_mesh().on_a.rows() == 0);
}

}  // namespace

// ---- points ----

TEST_CASE("mapping forward and backward returns the point, and outside there is no image") {
  for (std::uint64_t seed : {41u, 42u, 43u}) {
    const auto [a, b] = overlapping_pair(seed);
    const SurfaceMap map = map_of(a, b);
    REQUIRE(map.status() == Status::kDone);
    Rng rng(seed);
    int inside = 0, apart = 0;
    for (int i = 0; i < 400; ++i) {
      const SurfacePoint p = random_point(a, rng);
      const double depth = deepest(b, planar(a, p));
      if (std::abs(depth) < 1e-9) continue;  // on the rim of B up to rounding
      const SurfacePoint image = map.forward(p);
      CHECK(image.exists() == (depth > 0));
      if (!image.exists()) {
        ++apart;
        continue;
      }
      ++inside;
      check_surface_point(b, image);
      CHECK((planar(b, image) - planar(a, p)).norm() < 1e-12);
      const SurfacePoint back = map.backward(image);
      REQUIRE(back.exists());
      check_surface_point(a, back);
      CHECK((map.position_on_a(back) - map.position_on_a(p)).norm() < 1e-9);
    }
    CHECK(inside > 50);
    CHECK(apart > 20);
  }
}

TEST_CASE("mapping backward and forward returns the point") {
  const auto [a, b] = overlapping_pair(44);
  const SurfaceMap map = map_of(a, b);
  Rng rng(44);
  int inside = 0;
  for (int i = 0; i < 400; ++i) {
    const SurfacePoint p = random_point(b, rng);
    const double depth = deepest(a, planar(b, p));
    if (std::abs(depth) < 1e-9) continue;
    const SurfacePoint image = map.backward(p);
    CHECK(image.exists() == (depth > 0));
    if (!image.exists()) continue;
    ++inside;
    const SurfacePoint back = map.forward(image);
    REQUIRE(back.exists());
    CHECK((map.position_on_b(back) - map.position_on_b(p)).norm() < 1e-9);
  }
  CHECK(inside > 50);
}

TEST_CASE("vertices are mapped where they lie in the plane") {
  const auto [a, b] = overlapping_pair(45);
  const SurfaceMap map = map_of(a, b);
  const std::vector<SurfacePoint> forward = map.forward_vertices();
  const std::vector<SurfacePoint> backward = map.backward_vertices();
  REQUIRE(static_cast<int>(forward.size()) == n_vertices(a));
  REQUIRE(static_cast<int>(backward.size()) == n_vertices(b));
  const auto check = [](const Disk& from, const Disk& to, int v, const SurfacePoint& p,
                        const SurfacePoint& again) {
    CAPTURE(v);
    const Vector2d x = from.plane.row(v).transpose();
    CHECK(p.exists() == (deepest(to, x) > 0));  // no vertex of these pairs lies on a rim
    CHECK(again.exists() == p.exists());
    CHECK(again.face == p.face);
    CHECK(again.barycentric == p.barycentric);
    if (p.exists()) CHECK((planar(to, p) - x).norm() < 1e-12);
  };
  for (int v = 0; v < n_vertices(a); ++v)
    check(a, b, v, forward[static_cast<std::size_t>(v)], map.forward_vertex(v));
  for (int v = 0; v < n_vertices(b); ++v)
    check(b, a, v, backward[static_cast<std::size_t>(v)], map.backward_vertex(v));
}

TEST_CASE("equal positions map every vertex and every point to itself") {
  for (const Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    const SurfaceMap map = map_of(disk, disk);
    REQUIRE(map.status() == Status::kDone);
    for (int v = 0; v < n_vertices(disk); ++v) {
      CAPTURE(v);
      const Vector3d expected = disk.mesh.vertices.row(v);
      const SurfacePoint forward = map.forward_vertex(v), backward = map.backward_vertex(v);
      REQUIRE(forward.exists());
      REQUIRE(backward.exists());
      CHECK((map.position_on_b(forward) - expected).norm() < 1e-9);
      CHECK((map.position_on_a(backward) - expected).norm() < 1e-9);
    }
    Rng rng(46);
    for (int i = 0; i < 50; ++i) {
      const SurfacePoint p = random_point(disk, rng);
      const SurfacePoint image = map.forward(p);
      REQUIRE(image.exists());
      CHECK((map.position_on_b(image) - map.position_on_a(p)).norm() < 1e-9);
    }
  }
}

TEST_CASE("positions are interpolated in the units of the mesh given") {
  Disk disk = shapes::grid(2, 2);
  disk.mesh.vertices *= 25.4;
  const SurfaceMap map = map_of(disk, shapes::grid(2, 2));
  const SurfacePoint p = {3, Vector3d(0.2, 0.3, 0.5)};
  Vector3d on_a = Vector3d::Zero(), on_b = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vector3d corner = disk.mesh.vertices.row(disk.mesh.triangles(3, k));
    on_a += p.barycentric[k] * corner;
    on_b += p.barycentric[k] * corner / 25.4;
  }
  CHECK((map.position_on_a(p) - on_a).norm() < 1e-12);
  CHECK((map.position_on_b(p) - on_b).norm() < 1e-13);
}

TEST_CASE("copies of a map outlive it") {
  const auto [a, b] = overlapping_pair(47);
  std::vector<SurfaceMap> copies;
  SurfacePoint expected;
  {
    const SurfaceMap map = map_of(a, b);
    expected = map.forward_vertex(20);
    copies.push_back(map);
  }
  const SurfacePoint again = copies[0].forward_vertex(20);
  CHECK(again.exists() == expected.exists());
  CHECK(again.barycentric == expected.barycentric);
}

// ---- meta mesh ----

TEST_CASE("the meta mesh of a pair is a disk with the covered areas on both surfaces") {
  for (std::uint64_t seed : {48u, 49u, 50u, 51u}) {
    CAPTURE(seed);
    const auto [a, b] = overlapping_pair(seed);
    check_meta_mesh(a, b, 1);
    check_meta_mesh(b, a, 1);
  }
}

TEST_CASE("the meta mesh of equal positions is a disk that covers both surfaces") {
  for (const Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    const MetaMesh mesh = map_of(disk, disk).meta_mesh();
    CHECK(euler_characteristic(mesh) == 1);
    CHECK(area_on(mesh.on_a, mesh) == doctest::Approx(area_of(disk.mesh)).epsilon(1e-10));
    CHECK(area_on(mesh.on_b, mesh) == doctest::Approx(area_of(disk.mesh)).epsilon(1e-10));
  }
}

TEST_CASE("an overlap of several parts has as many disks in its meta mesh") {
  const Disk comb = shapes::comb(4, 3);
  Disk bar = shapes::grid(9, 1);
  bar.plane = shapes::moved(bar.plane, Eigen::Matrix2d::Identity(), Vector2d(-1.013, 2.517));
  check_meta_mesh(comb, bar, 4);
  check_meta_mesh(bar, comb, 4);
}

TEST_CASE("corners of meta mesh polygons lie in their triangles of both surfaces") {
  const auto [a, b] = overlapping_pair(52);
  const MetaMesh mesh = map_of(a, b).meta_mesh();
  const std::vector<std::vector<int>> polygons = mesh_io::polygons_of(mesh);
  for (std::size_t i = 0; i < mesh.face_a.size(); ++i)
    for (int v : polygons[i]) {
      CHECK(outside(a.mesh, mesh.face_a[i], mesh.on_a.row(v)) < 1e-9);
      CHECK(outside(b.mesh, mesh.face_b[i], mesh.on_b.row(v)) < 1e-9);
    }
}

TEST_CASE("covered vertices of both meshes are vertices of the meta mesh") {
  const auto [a, b] = overlapping_pair(53);
  const SurfaceMap map = map_of(a, b);
  const MetaMesh mesh = map.meta_mesh();
  const auto find = [&](const Vector3d& on_a, const Vector3d& on_b) {
    for (int i = 0; i < mesh.on_a.rows(); ++i) {
      const double apart = (mesh.on_a.row(i).transpose() - on_a).norm() +
                           (mesh.on_b.row(i).transpose() - on_b).norm();
      if (apart < 1e-9) return true;
    }
    return false;
  };
  int count = 0;
  for (int v = 0; v < n_vertices(a); ++v) {
    const SurfacePoint p = map.forward_vertex(v);
    if (!p.exists()) continue;
    ++count;
    CHECK(find(a.mesh.vertices.row(v), map.position_on_b(p)));
  }
  for (int v = 0; v < n_vertices(b); ++v) {
    const SurfacePoint p = map.backward_vertex(v);
    if (!p.exists()) continue;
    ++count;
    CHECK(find(map.position_on_a(p), b.mesh.vertices.row(v)));
  }
  CHECK(count > 30);
  CHECK(count < mesh.on_a.rows());  // the rest are crossings
}

// ---- refused input and queries ----

TEST_CASE("input that is no map gives a status and no images") {
  const Disk a = shapes::grid(2, 2), b = shapes::grid(3, 2);
  TriangleMesh broken = a.mesh;
  broken.triangles(0, 0) = 77;
  check_unusable(SurfaceMap(broken, b.mesh, a.plane, b.plane), Status::kInvalidMesh, "mesh A");
  check_unusable(SurfaceMap(b.mesh, broken, b.plane, a.plane), Status::kInvalidMesh, "mesh B");
  CHECK(SurfaceMap(b.mesh, broken, b.plane, a.plane).forward_vertices().size() ==
        static_cast<std::size_t>(b.mesh.vertices.rows()));
  check_unusable(SurfaceMap({}, {}, {}, {}), Status::kInvalidMesh, "mesh A");
  const Points2 mirrored = -a.plane.rowwise().reverse();  // a reflection
  const auto positions = Status::kInvalidPositions;
  check_unusable(SurfaceMap(a.mesh, b.mesh, b.plane, b.plane), positions, "f ");
  check_unusable(SurfaceMap(a.mesh, b.mesh, a.plane, a.plane), positions, "g ");
  check_unusable(SurfaceMap(a.mesh, b.mesh, mirrored, b.plane), positions, "f ");
  check_unusable(SurfaceMap(b.mesh, a.mesh, b.plane, mirrored), positions, "g ");
  Points2 far = b.plane;
  far.col(1).array() += 50;
  check_unusable(SurfaceMap(a.mesh, b.mesh, a.plane, far), Status::kNoOverlap, "overlap");
}

TEST_CASE("queries outside the meshes are not covered") {
  const Disk a = shapes::grid(2, 2), b = shapes::grid(3, 2);
  const SurfaceMap map = map_of(a, b);
  REQUIRE(map.status() == Status::kDone);
  const Vector3d middle = Vector3d::Constant(1.0 / 3);
  for (int id : {-1, -1000, 1 << 30}) {
    CHECK_FALSE(map.forward_vertex(id).exists());
    CHECK_FALSE(map.backward_vertex(id).exists());
    CHECK_FALSE(map.forward({id, middle}).exists());
    CHECK_FALSE(map.backward({id, middle}).exists());
  }
  CHECK_FALSE(map.forward_vertex(9).exists());
  CHECK_FALSE(map.backward_vertex(12).exists());
  CHECK_FALSE(map.forward({8, middle}).exists());
  CHECK_FALSE(map.backward({12, middle}).exists());
  CHECK_FALSE(map.forward(SurfacePoint()).exists());
  CHECK(map.forward({7, middle}).exists());
  CHECK(map.forward_vertex(8).exists());
}

TEST_CASE("edges are mapped to polylines that join the images of their ends") {
  Rng rng(31);
  Disk a = shapes::random_disk(5, 5, rng), b = shapes::random_disk(7, 6, rng);
  shapes::bend(a, 0.4);
  shapes::bend(b, -0.3);
  a.plane = shapes::moved(a.plane, shapes::rotation(0.1), Vector2d(0.8, 0.4));
  const SurfaceMap map(a.mesh, b.mesh, a.plane, b.plane);
  REQUIRE(map.status() == Status::kDone);
  const ism::detail::HalfEdgeMesh m = shapes::half_edges(a.mesh);
  int whole = 0, crossings = 0;
  for (int h = 0; h < m.tail.size(); ++h) {
    const int u = m.tail[h], v = m.tip(h);
    const auto polylines = map.forward_path({u, v}), reversed = map.forward_path({v, u});
    REQUIRE(polylines.size() == reversed.size());
    for (std::size_t i = 0; i < polylines.size(); ++i) {
      const auto& line = polylines[i];
      REQUIRE(line.size() >= 2);
      REQUIRE(reversed[reversed.size() - 1 - i].size() == line.size());
      for (std::size_t k = 0; k + 1 < line.size(); ++k) {
        // The middle of every segment comes from the edge.
        ism::SurfacePoint end = line[k + 1], middle = line[k];
        const Vector3d p = map.position_on_b(line[k]), q = map.position_on_b(end);
        if (end.face != line[k].face) {  // its coordinates in the triangle of the segment
          Eigen::Matrix<double, 4, 3> corners;
          corners.row(3).setOnes();
          for (int c = 0; c < 3; ++c)
            corners.col(c).head<3>() =
                b.mesh.vertices.row(b.mesh.triangles(line[k].face, c)).transpose();
          end = {line[k].face, corners.colPivHouseholderQr().solve(q.homogeneous())};
        }
        middle.barycentric = 0.5 * (line[k].barycentric + end.barycentric);
        CHECK((map.position_on_b(middle) - 0.5 * (p + q)).norm() < 1e-9);
        const ism::SurfacePoint back = map.backward(middle);
        REQUIRE(back.exists());
        const Vector3d on_a = map.position_on_a(back);
        const Vector3d from = a.mesh.vertices.row(u), to = a.mesh.vertices.row(v);
        CHECK((on_a - from).cross(to - from).norm() < 1e-9 * (to - from).squaredNorm());
        crossings += k > 0;
      }
    }
    if (polylines.size() != 1) continue;
    const ism::SurfacePoint start = map.forward_vertex(u), end = map.forward_vertex(v);
    if (!start.exists() || !end.exists()) continue;
    ++whole;
    const auto distance = [&](const ism::SurfacePoint& p, const ism::SurfacePoint& q) {
      return (map.position_on_b(p) - map.position_on_b(q)).norm();
    };
    CHECK(distance(polylines[0].front(), start) < 1e-9);
    CHECK(distance(polylines[0].back(), end) < 1e-9);
  }
  CHECK(whole > 100);
  CHECK(crossings > 100);
  CHECK(map.forward_path({0, 0}).empty());
  CHECK(map.forward_path({-1, 0}).empty());
  CHECK(map.forward_path({0, 100000}).empty());
  const int boundary = m.boundary[0];
  CHECK(map.forward_path({m.tip(boundary), m.tail[boundary]}).size() ==
        map.forward_path({m.tail[boundary], m.tip(boundary)}).size());
}

TEST_CASE("a covered edge has one polyline, however close the map is to the identity") {
  Rng rng(32);
  const Disk b = shapes::perturbed_grid(12, 12, 0.2, rng);
  const ism::detail::HalfEdgeMesh m = shapes::half_edges(b.mesh);
  for (double amount : {1e-3, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15, 0.0}) {
    Disk a = b;
    for (int v = 0; v < a.plane.rows(); ++v) a.plane.row(v) += rng.point(amount).transpose();
    const SurfaceMap map(a.mesh, b.mesh, a.plane, b.plane);
    REQUIRE(map.status() == Status::kDone);
    int split = 0, tested = 0;
    for (int h = 0; h < m.tail.size(); ++h) {
      bool is_inside = true;
      for (int v : {m.tail[h], m.tip(h)})
        is_inside = is_inside && (b.plane.row(v).array() > 0.9).all() &&
                    (b.plane.row(v).array() < 11.1).all();
      if (!is_inside) continue;
      ++tested;
      split += map.forward_path({m.tail[h], m.tip(h)}).size() != 1;
    }
    CAPTURE(amount);
    CHECK(tested > 100);
    CHECK(split == 0);
  }
}

TEST_CASE("an edge that leaves the overlap and comes back has two polylines") {
  const Disk a = shapes::triangle({0.2, -1}, {2.8, 0.5}, {0.2, 0.5});
  Disk b = shapes::comb(2, 1);  // a bar with two teeth, from (0, 0) to (3, 2)
  Disk a_up = a;
  a_up.plane = shapes::moved(a.plane, Eigen::Matrix2d::Identity(), Vector2d(0, 1));
  const SurfaceMap map(a_up.mesh, b.mesh, a_up.plane, b.plane);
  REQUIRE(map.status() == Status::kDone);
  const auto polylines = map.forward_path({1, 2});  // y = 1.5: across both teeth
  REQUIRE(polylines.size() == 2);
  CHECK((map.position_on_b(polylines[0].front()) - Vector3d(2.8, 1.5, 0)).norm() < 1e-12);
  CHECK((map.position_on_b(polylines[0].back()) - Vector3d(2, 1.5, 0)).norm() < 1e-12);
  CHECK((map.position_on_b(polylines[1].front()) - Vector3d(1, 1.5, 0)).norm() < 1e-12);
  CHECK((map.position_on_b(polylines[1].back()) - Vector3d(0.2, 1.5, 0)).norm() < 1e-12);
}

TEST_CASE("a map of a result is the map of its meshes and positions, or has its status") {
  const auto [a, b] = runs::square_pair(61);
  ism::Options options = runs::on_one_thread();
  options.max_iterations = 2;
  options.exact_landmarks = true;
  options.boundary = ism::Boundary::kSlide;
  const ism::Result result = ism::compute_map(a.mesh, b.mesh, {}, options);
  CAPTURE(result.message);
  REQUIRE(ism::is_usable(result.status));
  const SurfaceMap map(result);
  REQUIRE(map.status() == Status::kDone);
  for (int v = 0; v < a.mesh.vertices.rows(); ++v) CHECK(map.forward_vertex(v).exists());
  for (const SurfaceMap& none : {SurfaceMap(), SurfaceMap(ism::Result())}) {
    CHECK(none.status() == Status::kNoMapYet);
    CHECK_FALSE(none.forward_vertex(0).exists());
    CHECK(none.meta_mesh().corners.empty());
  }
  const SurfaceMap refused(ism::compute_map(a.mesh, b.mesh, {{-1, 0}}, options));
  CHECK(refused.status() == Status::kInvalidLandmarks);
  CHECK(refused.message().find("-1") != std::string::npos);
}

TEST_CASE("points on edges between slivers have images") {
  // A fan of thin triangles from a far corner, onto itself, laid at an angle so that it rounds.
  for (double height : {1e-6, 1e-9, 1e-11, 5e-12}) {
    CAPTURE(height);
    shapes::DiskBuilder builder;
    constexpr int kSlivers = 8;
    const auto at = [](double x, double y) {
      return Vector2d(0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y);
    };
    builder.vertex(0, 0);
    for (int i = 0; i <= kSlivers; ++i)
      builder.vertex(at(1, i * height).x(), at(1, i * height).y());
    for (int i = 1; i <= kSlivers; ++i) builder.triangle(0, i, i + 1);
    const Disk fan = builder.build();
    const SurfaceMap map = map_of(fan, fan);
    REQUIRE(map.status() == Status::kDone);
    Rng rng(77);
    int uncovered = 0;
    for (int i = 0; i < 20000; ++i) {
      const double t = rng.uniform();
      const int f = rng.below(kSlivers);
      const bool is_first = rng.below(2) == 0;
      const SurfacePoint image =
          map.forward({f, Vector3d(1 - t, is_first ? t : 0, is_first ? 0 : t)});
      uncovered += !image.exists();
      if (image.exists()) CHECK(std::abs(image.barycentric[0] - (1 - t)) < 1e-14);
    }
    CHECK(uncovered == 0);
  }
}

TEST_CASE("a point without an image lies nowhere") {
  const auto [a, b] = runs::square_pair(62);
  const SurfaceMap map = runs::good_map(a, b);
  for (int face : {-1, 1 << 30}) {
    CHECK(map.position_on_a({face, Vector3d(1, 0, 0)}).hasNaN());
    CHECK(map.position_on_b({face, Vector3d(1, 0, 0)}).hasNaN());
  }
  CHECK(map.position_on_b(ism::SurfacePoint()).hasNaN());
  CHECK(SurfaceMap().position_on_a({0, Vector3d(1, 0, 0)}).hasNaN());
}

TEST_CASE("distortions of slivers are numbers, and areas at least 0") {
  Rng rng(91);
  int maps = 0;
  for (int i = 0; i < 3000; ++i) {
    Points2 x[2] = {Points2(3, 2), Points2(3, 2)};
    for (Points2& p : x)
      for (int k = 0; k < 3; ++k)
        p.row(k) << std::ldexp(rng.between(-9, 9), -130), std::ldexp(rng.between(-9, 9), -57);
    Disk disk = shapes::single_triangle();
    const SurfaceMap map(disk.mesh, disk.mesh, x[0], x[1]);
    if (map.status() != Status::kDone) continue;
    ++maps;
    for (const ism::PolygonDistortion& d : map.distortion()) {
      CHECK(d.area_a >= 0);
      CHECK(d.area_b >= 0);
      CHECK(d.sigma_min > 0);
      CHECK(d.sigma_max >= d.sigma_min * (1 - 1e-12));
      CHECK(d.density >= 2 * (1 - 1e-12));
    }
  }
  CHECK(maps > 100);
}

TEST_CASE("corners that lie in slivers are places on them") {
  Disk disk = shapes::single_triangle();
  Points2 sliver(3, 2), small(3, 2);
  for (double t : {1e-3, 1e-12, 1e-16, 8e-40}) {  // the last areas are 0 where they are rounded
    CAPTURE(t);
    sliver << -64, -64, t, 0, 0, t;
    small << -t, -t, 0, -t, -t, 0;
    const MetaMesh mesh = SurfaceMap(disk.mesh, disk.mesh, sliver, small).meta_mesh();
    REQUIRE(mesh.on_a.rows() > 3);
    for (int v = 0; v < mesh.on_a.rows(); ++v) {
      CHECK(outside(disk.mesh, 0, mesh.on_a.row(v)) < 1e-9);
      CHECK(outside(disk.mesh, 0, mesh.on_b.row(v)) < 1e-9);
    }
  }
}

}  // namespace map_tests

#endif  // ISM_TESTS_PART_MAP_HPP

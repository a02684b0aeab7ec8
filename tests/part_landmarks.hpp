// Landmarks as points in triangles: where they lie as vertices are added, how they pull, and what
// exact ones add to the meshes.

#ifndef ISM_TESTS_PART_LANDMARKS_HPP
#define ISM_TESTS_PART_LANDMARKS_HPP

#include "ism.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace landmarks_tests {
namespace {

using namespace ism::detail;
using Eigen::Vector3d;
using ism::AddedVertex;
using ism::Boundary;
using ism::Element;
using ism::Embedding;
using ism::Landmark;
using ism::LandmarkPoint;
using ism::Options;
using ism::Points2;
using ism::Result;
using ism::Status;
using ism::SurfacePoint;
using ism::TriangleMesh;
using runs::given_planes;
using runs::on_one_thread;
using shapes::Disk;
using shapes::half_edges;
using shapes::Rng;

int n_vertices(const TriangleMesh& mesh) { return static_cast<int>(mesh.vertices.rows()); }
int n_triangles(const TriangleMesh& mesh) { return static_cast<int>(mesh.triangles.rows()); }

/// A random point of a triangle, inside of it or, one time in three, on an edge.
SurfacePoint point_in(int face, Rng& rng) {
  SurfacePoint p = {face, {rng.uniform(0.05, 1), rng.uniform(0.05, 1), rng.uniform(0.05, 1)}};
  const int k = rng.below(9);
  if (k < 3) p.barycentric[k] = 0;
  p.barycentric /= p.barycentric.sum();
  return p;
}

Vector3d position(const TriangleMesh& mesh, const SurfacePoint& p) {
  Vector3d x = Vector3d::Zero();
  for (int k = 0; k < 3; ++k)
    x += p.barycentric[k] * mesh.vertices.row(mesh.triangles(p.face, k)).transpose();
  return x;
}

Vector3d position(const TriangleMesh& mesh, const Place& p) {
  Vector3d x = Vector3d::Zero();
  for (int k = 0; k < 3 && p.corners[k] >= 0; ++k)
    x += p.weights[k] * mesh.vertices.row(p.corners[k]).transpose();
  return x;
}

Place place_of(const TriangleMesh& mesh, const SurfacePoint& p) {
  Place place;
  place.corners = mesh.triangles.row(p.face).transpose();
  place.weights = p.barycentric;
  tidy(place);
  return place;
}

/// The point of a mesh that is closest to the centre of a triangle of another one in a plane.
SurfacePoint nearest_point(const Disk& disk, const Eigen::Vector2d& at) {
  SurfacePoint best;
  double most = -kInfinity;
  for (int f = 0; f < n_triangles(disk.mesh); ++f) {
    const auto corner = [&](int k) { return row2(disk.plane, disk.mesh.triangles(f, k)); };
    const Vec3 w = barycentric({at.x(), at.y()}, corner(0), corner(1), corner(2));
    const double least = std::min({w.x, w.y, w.z});
    if (least <= most) continue;
    most = least;
    best = {f, Vector3d(w.x, w.y, w.z).cwiseMax(0)};
  }
  best.barycentric /= best.barycentric.sum();
  return best;
}

/// Two random triangulations of one square, bent alike, and landmarks at the same places on both.
struct Twins {
  Disk a, b;
  std::vector<Landmark> landmarks;
};

Twins twins(std::uint64_t seed, int n_landmarks) {
  Rng rng(seed);
  Twins t = {shapes::random_disk(7, 7, rng), shapes::random_disk(7, 7, rng), {}};
  shapes::bend(t.a, 0.4);
  shapes::bend(t.b, 0.4);
  for (int i = 0; i < n_landmarks; ++i) {
    const Eigen::Vector2d at(rng.uniform(0.5, 6.5), rng.uniform(0.5, 6.5));
    t.landmarks.push_back({nearest_point(t.a, at), nearest_point(t.b, at)});
  }
  return t;
}

Options exact_run(int iterations) {
  Options options = on_one_thread();
  options.exact_landmarks = true;
  options.max_iterations = iterations;
  return options;
}

void check_usable(const Result& r) {
  CAPTURE(r.message);
  REQUIRE(ism::is_usable(r.status));
  CHECK(ism::validate(*r.start.a).empty());
  CHECK(ism::validate(*r.start.b).empty());
  CHECK(is_injective(half_edges(*r.start.a), r.start.f));
  CHECK(is_injective(half_edges(*r.start.b), r.start.g));
  CHECK(is_injective(half_edges(*r.start.a), r.f));
  CHECK(is_injective(half_edges(*r.start.b), r.g));
}

/// The vertices at the ends of landmarks once vertices have been added.
int vertex_of(const TriangleMesh& given, const LandmarkPoint& p,
              const std::vector<AddedVertex>& added) {
  if (p.point.face < 0) return p.vertex;
  return vertex_at(located(place_of(given, p.point), n_vertices(given), added));
}

void check_coincide(const TriangleMesh& a, const TriangleMesh& b,
                    const std::vector<Landmark>& landmarks, const Result& r) {
  for (const Landmark& l : landmarks) {
    const int u = vertex_of(a, l.a, r.start.added_a), v = vertex_of(b, l.b, r.start.added_b);
    REQUIRE(u >= 0);
    REQUIRE(v >= 0);
    CHECK(r.start.f.row(u) == r.start.g.row(v));
    CHECK(r.f.row(u) == r.g.row(v));
    if (l.a.point.face >= 0)
      CHECK((r.start.a->vertices.row(u).transpose() - position(a, l.a.point)).norm() < 1e-13);
  }
}

void check_refused(const Result& r, const std::string& what, const std::vector<int>& ids) {
  CAPTURE(what);
  CAPTURE(r.message);
  CHECK(r.status == Status::kInvalidLandmarks);
  CHECK(r.message.find(what) != std::string::npos);
  REQUIRE(r.ids.size() == ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    CHECK(r.ids[i].id == ids[i]);
    const bool is_face = r.ids[i].element == Element::kFace;
    CHECK((is_face || r.ids[i].element == Element::kVertex));
    const std::string name = is_face ? "triangle " : "";
    CHECK(r.message.find(name + std::to_string(ids[i])) != std::string::npos);
  }
  CHECK(r.log.empty());
}

}  // namespace

// ---- places on meshes to which vertices are added ----

TEST_CASE("vertices added on edges and in triangles leave the mesh of the same surface") {
  Rng rng(1);
  for (const Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    Surface s = build_surface(disk.mesh, true);
    const double area = s.total_area;
    for (int i = 0; i < 40; ++i) {
      const TriangleMesh now = *with_added_vertices(shared(disk.mesh), s);
      const SurfacePoint p = point_in(rng.below(n_triangles(now)), rng);
      REQUIRE(add_vertices({place_of(now, p)}, s));
      const Vector3d at =
          with_added_vertices(shared(disk.mesh), s)->vertices.bottomRows(1).transpose();
      CHECK((at - position(now, p)).norm() < 1e-14 * (1 + at.norm()));
    }
    const TriangleMesh mesh = *with_added_vertices(shared(disk.mesh), s);
    const HalfEdgeMesh built = half_edges(mesh);
    CHECK(ism::validate(mesh).empty());
    CHECK(std::equal(s.mesh.twin.begin(), s.mesh.twin.end(), built.twin.begin()));
    CHECK(std::equal(s.mesh.boundary.begin(), s.mesh.boundary.end(), built.boundary.begin()));
    for (int v = 0; v < s.mesh.n_vertices; ++v) {
      CHECK(s.mesh.tail[s.mesh.out[v]] == v);
      CHECK(s.mesh.on_boundary(v) == built.on_boundary(v));
    }
    CHECK(s.total_area == doctest::Approx(area).epsilon(1e-12));
  }
}

TEST_CASE("what is no place on a mesh gets no vertex") {
  const TriangleMesh mesh = shapes::grid(3, 3).mesh;
  Surface s = build_surface(mesh, true);
  AddedVertex p = place_of(mesh, {4, {0.2, 0.3, 0.5}});
  REQUIRE(find_place(s.mesh, p) >= 0);
  const auto refused = [&](const Eigen::Vector3i& corners, const Vector3d& weights) {
    AddedVertex q;
    q.corners = corners;
    q.weights = weights;
    return find_place(s.mesh, q) < 0;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(refused(p.corners, {0.2, 0.3, 0.6}));
  CHECK(refused(p.corners, {-0.2, 0.7, 0.5}));
  CHECK(refused(p.corners, {0, 0.5, 0.5}));
  CHECK(refused(p.corners, {nan, 0.5, 0.5}));
  CHECK(refused({p.corners[0], p.corners[1], 99}, p.weights));
  CHECK(refused({p.corners[0], 99, p.corners[2]}, p.weights));
  CHECK(refused({-1, p.corners[1], p.corners[2]}, p.weights));
  CHECK(refused({p.corners[0], p.corners[1], -1}, p.weights));
  CHECK(refused({p.corners[0], -1, -1}, {1, 0, 0}));
}

TEST_CASE("a place stays the same point, whatever vertices are added") {
  Rng rng(2);
  for (const Disk& disk : {shapes::fan(5), shapes::random_disk(3, 3, rng)}) {
    std::vector<SurfacePoint> points;
    for (int i = 0; i < 60; ++i) points.push_back(point_in(i % n_triangles(disk.mesh), rng));
    Surface s = build_surface(disk.mesh, true);
    for (int i = 0; i < 60; ++i) {
      const TriangleMesh now = *with_added_vertices(shared(disk.mesh), s);
      const SurfacePoint p = point_in(rng.below(n_triangles(now)), rng);
      REQUIRE(add_vertices(
          {i % 2 == 0 ? place_of(now, p)
                      : AddedVertex(now.triangles(p.face, 0), now.triangles(p.face, 1))},
          s));
    }
    const TriangleMesh fine = *with_added_vertices(shared(disk.mesh), s);
    for (const SurfacePoint& p : points) {
      const Place at = located(place_of(disk.mesh, p), n_vertices(disk.mesh), s.added);
      CHECK((position(fine, at) - position(disk.mesh, p)).norm() < 1e-12);
      CHECK((vertex_at(at) >= 0 || find_place(s.mesh, at) >= 0));
    }
  }
}

TEST_CASE("springs between corners pull two places as one spring would") {
  Rng rng(3);
  const Points2 x = Points2::NullaryExpr(9, 2, [&] { return rng.uniform(-1, 1); });
  const TriangleMesh mesh = shapes::strip(2).mesh;
  for (int i = 0; i < 20; ++i) {
    const Place p = place_of(mesh, point_in(0, rng));
    Place q = place_of(mesh, i < 10 ? point_in(1, rng) : SurfacePoint{1, {0, 1, 0}});
    for (int k = 0; k < 3; ++k)
      if (q.corners[k] >= 0) q.corners[k] += 3;
    Array<Spring> springs;
    const Mat2 stiffness = {{2, 0.3, 0.3, 1}};
    const Vec2 force = {0.7, -0.4}, u = mean(p, x) - mean(q, x);
    add_springs(p, q, stiffness, force, {}, springs);
    CHECK(with_springs(0, springs, x) ==
          doctest::Approx(dot(stiffness * u - 2 * force, u)).epsilon(1e-12));
  }
}

// ---- landmarks that guide the start ----

TEST_CASE("landmarks at corners of triangles give the same bits as vertices") {
  const Twins t = twins(4, 0);
  const auto corner = [](const Disk& d, int f, int k, double off) {
    SurfacePoint p = {f, Vector3d::Constant(off)};
    p.barycentric[k] = 1 - 2 * off;
    return std::pair<int, SurfacePoint>(d.mesh.triangles(f, k), p);
  };
  for (const bool exact : {false, true})
    for (const int count : {1, 2, 4}) {
      std::vector<Landmark> vertices, points;
      for (int i = 0; i < count; ++i) {
        const auto [u, p] = corner(t.a, 17 * i, i % 3, i % 2 == 0 ? 0 : 1e-10);
        const auto [v, q] = corner(t.b, 17 * i + 2, (i + 1) % 3, 0);
        vertices.push_back({u, v});
        points.push_back({p, q});
      }
      Options options = on_one_thread();
      options.exact_landmarks = exact;
      options.max_iterations = 3;
      const Result r = ism::compute_map(t.a.mesh, t.b.mesh, vertices, options);
      const Result s = ism::compute_map(t.a.mesh, t.b.mesh, points, options);
      check_usable(r);
      CHECK(s.start.landmark_distance == r.start.landmark_distance);
      CHECK(s.start.f == r.start.f);
      CHECK(s.f == r.f);
      CHECK(s.g == r.g);
    }
}

TEST_CASE("points in triangles end near each other, and add nothing to the meshes") {
  for (const int count : {1, 2, 6, 40}) {
    CAPTURE(count);
    const Twins t = twins(5, count);
    const Embedding e = ism::initial_embedding(t.a.mesh, t.b.mesh, t.landmarks, on_one_thread());
    REQUIRE(e.status == Status::kDone);
    CHECK(e.added_a.empty());
    CHECK(e.added_b.empty());
    CHECK(is_injective(half_edges(t.a.mesh), e.f));
    CHECK(is_injective(half_edges(t.b.mesh), e.g));
    double largest = 0;
    for (const Landmark& l : t.landmarks)
      largest = std::max(largest, (shapes::planar({t.a.mesh, e.f}, l.a.point) -
                                   shapes::planar({t.b.mesh, e.g}, l.b.point))
                                      .norm());
    CHECK(e.landmark_distance ==
          doctest::Approx(largest / domain_radius(stacked(e.f, e.g))).epsilon(1e-12));
    CHECK(e.landmark_distance < 0.02);
  }
}

TEST_CASE("more points than the coarse levels have vertices leave the embedding injective") {
  Twins t = twins(6, 0);
  Rng rng(7);
  for (int f = 0; f < std::min(n_triangles(t.a.mesh), n_triangles(t.b.mesh)); ++f)
    t.landmarks.push_back({SurfacePoint{f, Vector3d::Constant(1.0 / 3)}, point_in(f, rng)});
  const Embedding e = ism::initial_embedding(t.a.mesh, t.b.mesh, t.landmarks, on_one_thread());
  REQUIRE(e.status == Status::kDone);
  CHECK(is_injective(half_edges(t.a.mesh), e.f));
  CHECK(is_injective(half_edges(t.b.mesh), e.g));
}

// ---- landmarks that are met exactly ----

TEST_CASE("exact landmarks in triangles and on edges coincide to the last bit") {
  for (const int count : {1, 3, 12}) {
    CAPTURE(count);
    Twins t = twins(8, count);
    t.landmarks.push_back({20, nearest_point(t.b, t.a.plane.row(20).transpose())});
    const Options options = exact_run(30);
    const Result r = ism::compute_map(t.a.mesh, t.b.mesh, t.landmarks, options);
    check_usable(r);
    CHECK(r.start.landmark_distance == 0);
    CHECK(r.start.added_a.size() >= static_cast<std::size_t>(count));
    CHECK(r.start.a->vertices.topRows(n_vertices(t.a.mesh)) == t.a.mesh.vertices);
    CHECK(r.final_state().pin_residual < 1e-12);
    CHECK(r.final_state().energy < r.initial.energy);
    check_coincide(t.a.mesh, t.b.mesh, t.landmarks, r);
    // The vertices of landmarks come first, in their order.
    for (int i = 0; i < count; ++i) {
      const int v = n_vertices(t.a.mesh) + i;
      CHECK(vertex_of(t.a.mesh, t.landmarks[static_cast<std::size_t>(i)].a, r.start.added_a) == v);
    }
  }
}

TEST_CASE("several exact landmarks in one triangle, on one edge and at its corners") {
  const TriangleMesh a = shapes::grid(6, 6).mesh;
  const TriangleMesh b = shapes::grid(5, 6).mesh;
  std::vector<Landmark> landmarks;
  const auto add = [&](const Vector3d& w) {
    landmarks.push_back({SurfacePoint{30, w}, SurfacePoint{24, w}});
  };
  add({0.6, 0.2, 0.2});
  add({0.2, 0.6, 0.2});
  add({0.3, 0.3, 0.4});
  add({0.5, 0.5, 0});
  add({0.25, 0.75, 0});
  add({0.9, 0.1, 0});
  add({1, 0, 0});
  add({0.1, 0.1, 0.8});
  const Options options = exact_run(20);
  const Result r = ism::compute_map(a, b, landmarks, options);
  check_usable(r);
  check_coincide(a, b, landmarks, r);
}

TEST_CASE("exact landmarks close to corners and edges") {
  const TriangleMesh a = shapes::grid(6, 6).mesh;
  for (const double off : {1e-2, 1e-4, 1e-6, 1e-8, 2e-9}) {
    CAPTURE(off);
    const std::vector<Landmark> landmarks = {
        {SurfacePoint{30, {1 - 3 * off, off, 2 * off}}, a.triangles(30, 0)},
        {SurfacePoint{50, {0.5, 0.5 - off, off}}, SurfacePoint{50, {0.5, 0.5, 0}}}};
    const Options options = exact_run(10);
    const Result r = ism::compute_map(a, a, landmarks, options);
    check_usable(r);
    check_coincide(a, a, landmarks, r);
  }
}

TEST_CASE("exact landmarks that would make triangles too thin are refused") {
  TriangleMesh a = shapes::grid(6, 6).mesh;
  a.vertices.col(1) *= 1e-6;
  REQUIRE(ism::validate(a).empty());
  Options options = on_one_thread();
  options.exact_landmarks = true;
  const std::vector<Landmark> landmarks = {{SurfacePoint{30, {0.5, 0.5 - 2e-9, 2e-9}}, 20}};
  const Result r = ism::compute_map(a, a, landmarks, options);
  CHECK(r.status == Status::kInvalidLandmarks);
  CHECK(r.message.find("are too close to edges") != std::string::npos);
  CHECK(r.ids.size() == 1);
}

TEST_CASE("attributes and paths follow the vertices of landmarks") {
  Twins t = twins(9, 8);
  const TriangleMesh& a = t.a.mesh;
  const int u = a.triangles(10, 0), v = a.triangles(10, 1);
  t.landmarks.push_back({SurfacePoint{10, {0.3, 0.7, 0}}, nearest_point(t.b, {0.9, 0.8})});
  t.landmarks.back().b =
      nearest_point(t.b, (0.3 * t.a.plane.row(u) + 0.7 * t.a.plane.row(v)).transpose());
  t.landmarks.push_back({SurfacePoint{10, {0.2, 0.3, 0.5}}, LandmarkPoint()});
  t.landmarks.back().b = nearest_point(t.b, shapes::planar(t.a, t.landmarks.back().a.point));
  const Options options = exact_run(2);
  const Result r = ism::compute_map(a, t.b.mesh, t.landmarks, options);
  check_usable(r);
  REQUIRE(n_vertices(*r.start.a) > n_vertices(a));
  const ism::SurfaceMap map(r);
  const ism::MetaMesh meta = map.meta_mesh();
  Eigen::MatrixXd corners(3 * n_triangles(a), 3);
  for (int f = 0; f < n_triangles(a); ++f)
    for (int k = 0; k < 3; ++k)  // a seam at every edge
      corners.row(3 * f + k) = a.vertices.row(a.triangles(f, k)).array() + 10 * f;
  const ism::Values on_meta = ism::to_meta(meta, ism::Side::kA, Element::kCorner).apply(corners);
  REQUIRE(on_meta.rows() > 0);
  for (std::size_t p = 0; p < meta.face_a.size(); ++p)
    for (int i = meta.offsets[p]; i < meta.offsets[p + 1]; ++i) {
      const Vector3d offset = Vector3d::Constant(10 * meta.face_a[p]);
      const Vector3d at = meta.on_a.row(meta.corners[static_cast<std::size_t>(i)]);
      CHECK((on_meta.row(i).transpose() - offset - at).norm() < 1e-11);
    }
  const std::vector<ism::Polyline> path = map.forward_path({u, v});
  REQUIRE(!path.empty());
  if (!map.forward_vertex(u).exists() || !map.forward_vertex(v).exists()) return;
  CHECK(
      (map.position_on_b(path.front().front()) - map.position_on_b(map.forward_vertex(u))).norm() <
      1e-9);
  CHECK((map.position_on_b(path.back().back()) - map.position_on_b(map.forward_vertex(v))).norm() <
        1e-9);
}

TEST_CASE("points on boundaries that are held correspond as vertices do") {
  const Disk a = shapes::grid(6, 6), b = shapes::spherical_cap(4, 16, 1.3);
  const HalfEdgeMesh m = half_edges(a.mesh), n = half_edges(b.mesh);
  const auto on_boundary_edge = [](const HalfEdgeMesh& mesh, int i, double t) {
    const int h = mesh.boundary[i % mesh.boundary.size()];
    SurfacePoint p = {h / 3, Vector3d::Zero()};
    p.barycentric[h % 3] = 1 - t;
    p.barycentric[(h + 1) % 3] = t;
    return p;
  };
  for (const Boundary boundary : {Boundary::kFixed, Boundary::kSlide})
    for (const bool exact : {false, true}) {
      std::vector<Landmark> landmarks;
      for (int k = 0; k < 5; ++k)
        landmarks.push_back(
            {on_boundary_edge(m, 4 * k + 1, 0.3), on_boundary_edge(n, 3 * k + 5, 0.2 * k)});
      landmarks.push_back({on_boundary_edge(m, 1, 0.6), on_boundary_edge(n, 5, 0.7)});
      landmarks.push_back({SurfacePoint{30, {0.2, 0.3, 0.5}}, SurfacePoint{4, {0.3, 0.3, 0.4}}});
      Options options = on_one_thread();
      options.boundary = boundary;
      options.exact_landmarks = exact;
      options.max_iterations = 5;
      const Result r = ism::compute_map(a.mesh, b.mesh, landmarks, options);
      check_usable(r);
      if (!exact) {
        CHECK(r.start.added_a.size() >= 6);
        CHECK(r.start.landmark_distance < 0.05);
        landmarks.pop_back();
      }
      if (exact || boundary == Boundary::kFixed) check_coincide(a.mesh, b.mesh, landmarks, r);
      CHECK(r.final_state().coverage_a == doctest::Approx(1).epsilon(1e-12));
    }
}

// ---- what is refused ----

TEST_CASE("points that are none of a mesh, and places used twice, are refused") {
  const Disk disk = shapes::grid(4, 4);
  const TriangleMesh& a = disk.mesh;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refuse_exact = [&](const std::vector<Landmark>& landmarks, const std::string& what,
                                int id) {
    Options options = on_one_thread();
    options.exact_landmarks = true;
    check_refused(ism::compute_map(a, a, landmarks, options), what, {id});
  };
  const auto refuse = [&](const std::vector<Landmark>& landmarks, const std::string& what, int id) {
    check_refused(ism::compute_map(a, a, landmarks, on_one_thread()), what, {id});
    refuse_exact(landmarks, what, id);
  };
  const SurfacePoint p = {3, {0.2, 0.3, 0.5}}, q = {9, {0.2, 0.3, 0.5}};
  refuse({{SurfacePoint{32, {0.2, 0.3, 0.5}}, 4}},
         "landmark (triangle 32) 4: mesh A has no triangle 32, it has 32 triangles", 32);
  refuse({{7, SurfacePoint{-5, {0.2, 0.3, 0.5}}}}, "mesh B has no triangle -5", -5);
  refuse({{SurfacePoint(), 4}}, "mesh A has no vertex -1", -1);
  for (const Vector3d& w :
       {Vector3d(0.2, 0.3, 0.6), Vector3d(-0.1, 0.6, 0.5), Vector3d(0, 0, 0),
        Vector3d(nan, 0.5, 0.5), Vector3d(0.5, nan, nan), Vector3d(kInfinity, -kInfinity, 1)})
    refuse({{4, SurfacePoint{3, w}}},
           "landmark 4 (triangle 3): barycentric coordinates on B must be at least 0 with sum 1",
           3);
  for (double weight : {-1.0, nan, kInfinity})
    refuse({{4, 7, weight}}, "landmark 4 7: its weight must be at least 0", 4);
  refuse_exact({{p, 4}, {p, 7}}, "the point in triangle 3 of A is in another landmark", 3);
  refuse_exact({{3, q}, {4, q}}, "the point in triangle 9 of B is in another landmark", 9);
  refuse_exact({{a.triangles(3, 1), 4}, {SurfacePoint{3, {0, 1, 0}}, 7}},
               "the point in triangle 3 of A is in another landmark", 3);
  refuse_exact({{p, 4}, {SurfacePoint{3, {0.2 + 1e-11, 0.3, 0.5 - 1e-11}}, 7}},
               "the point in triangle 3 of A is in another landmark", 3);
  // Rounding is forgiven.
  const Embedding e = ism::initial_embedding(
      a, a, {{SurfacePoint{3, {-1e-9, 0.3, 0.7}}, SurfacePoint{3, {0, 0.3 + 1e-8, 0.7}}}},
      on_one_thread());
  CHECK(e.status == Status::kDone);
}

TEST_CASE("exact points need both or no end on held boundaries") {
  const Disk a = shapes::grid(4, 4);
  Options options = on_one_thread();
  options.exact_landmarks = true;
  options.boundary = Boundary::kSlide;
  const HalfEdgeMesh m = half_edges(a.mesh);
  SurfacePoint edge = {m.boundary[1] / 3, Vector3d::Zero()};
  edge.barycentric[m.boundary[1] % 3] = edge.barycentric[(m.boundary[1] + 1) % 3] = 0.5;
  check_refused(
      ism::compute_map(a.mesh, a.mesh, {{edge, SurfacePoint{12, {0.2, 0.3, 0.5}}}}, options),
      "one end is on a boundary, which is held, and the other one is not", {edge.face, 12});
}

}  // namespace landmarks_tests

#endif  // ISM_TESTS_PART_LANDMARKS_HPP

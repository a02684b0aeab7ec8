// What a user gets speaks in the ids of what he gave: meshes on which the ids given, prepared, cut
// open and refined are all different.

#ifndef ISM_TESTS_PART_IDS_HPP
#define ISM_TESTS_PART_IDS_HPP

#include "ism.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <Eigen/Geometry>

#include <cmath>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

namespace ids_tests {
namespace {

using Eigen::Vector3d;
using ism::Element;
using ism::Ids;
using ism::Side;
using ism::SurfaceMap;
using ism::TriangleMesh;
using shapes::Rng;

int n_vertices(const TriangleMesh& mesh) { return static_cast<int>(mesh.vertices.rows()); }
int n_triangles(const TriangleMesh& mesh) { return static_cast<int>(mesh.triangles.rows()); }
std::size_t at(int i) { return static_cast<std::size_t>(i); }

/// A mesh as an engine has it: unused vertices in front and in between, vertices split along a
/// seam, a loose part, a triangle that is there twice and one that is turned.
struct EngineMesh {
  TriangleMesh mesh;
  std::vector<int> clean;  // per vertex, that of the clean mesh, or -1
  std::vector<int> first;  // per vertex of the clean mesh, one of its own
};

EngineMesh engine_mesh(const TriangleMesh& clean) {
  EngineMesh e;
  std::vector<Vector3d> points;
  const auto add = [&](const Vector3d& p, int of) {
    points.push_back(p);
    e.clean.push_back(of);
    return static_cast<int>(points.size()) - 1;
  };
  e.first.assign(at(n_vertices(clean)), -1);
  std::map<std::pair<int, bool>, int> id;
  std::vector<int> corners;
  add({9, 9, 9}, -1);
  for (int f = 0; f < n_triangles(clean); ++f) {
    double x = 0;
    for (int k = 0; k < 3; ++k) x += clean.vertices(clean.triangles(f, k), 0);
    for (int k = 0; k < 3; ++k) {
      const int v = clean.triangles(f, k);
      const auto [place, is_new] = id.insert({{v, x > 0}, 0});
      if (is_new) place->second = add(clean.vertices.row(v).transpose(), v);
      if (e.first[at(v)] < 0) e.first[at(v)] = place->second;
      corners.push_back(place->second);
    }
    if (f == 10) add({8, 8, 8}, -1);
  }
  std::swap(corners[31], corners[32]);
  for (int k : {15, 16, 17}) corners.push_back(corners[at(k)]);
  for (int k : {0, 1, 2}) corners.push_back(add({5.0 + k % 2, 5.0 + k, 5}, -1));
  e.mesh.vertices.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i)
    e.mesh.vertices.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
  e.mesh.triangles.resize(static_cast<Eigen::Index>(corners.size() / 3), 3);
  std::copy(corners.begin(), corners.end(), e.mesh.triangles.data());
  return e;
}

/// Smooth functions of the place.
ism::Values values_at(const ism::Points3& x) {
  ism::Values values(x.rows(), 2);
  for (Eigen::Index i = 0; i < x.rows(); ++i)
    values.row(i) << 0.5 + 0.4 * std::sin(x(i, 0)), 0.5 + 0.4 * std::cos(x(i, 1) + x(i, 2));
  return values;
}

struct Example {
  TriangleMesh clean_a, clean_b;
  EngineMesh a, b;
  ism::Result result;
};

Example example(bool is_exact) {
  Example e;
  e.clean_a = shapes::blob(3, 0.1, 1);
  e.clean_b = shapes::blob(3, 0.1, 2);
  e.a = engine_mesh(e.clean_a);
  e.b = engine_mesh(e.clean_b);
  ism::Options options = runs::on_one_thread();
  options.max_iterations = 20;
  options.exact_landmarks = is_exact;
  std::vector<ism::Landmark> landmarks;
  for (int v : {0, 1, 2, 3, 4, 5}) landmarks.push_back({e.a.first[at(v)], e.b.first[at(v)]});
  if (is_exact)
    landmarks.push_back(
        {ism::SurfacePoint{40, {0.2, 0.3, 0.5}}, ism::SurfacePoint{40, {0.3, 0.3, 0.4}}});
  e.result = ism::compute_map(e.a.mesh, e.b.mesh, landmarks, options);
  CAPTURE(e.result.message);
  REQUIRE(ism::is_usable(e.result.status));
  return e;
}

}  // namespace

TEST_CASE("attributes are carried from the vertices given to the vertices given") {
  for (bool is_exact : {false, true}) {
    const Example e = example(is_exact);
    const SurfaceMap map(e.result);
    REQUIRE(map.status() == ism::Status::kDone);
    CHECK(map.is_closed());
    CHECK(n_vertices(map.mesh(Side::kA)) == n_vertices(e.a.mesh));
    CHECK(n_vertices(map.mesh(Side::kA, Ids::kEmbedded)) != n_vertices(e.a.mesh));
    const ism::Transfer t =
        ism::transfer(map.meta_mesh(), Side::kA, Element::kVertex, Element::kVertex);
    CHECK(t.n_sources == n_vertices(e.a.mesh));
    CHECK(t.rows() == n_vertices(e.b.mesh));
    for (int source : t.sources) CHECK(e.a.clean[at(source)] >= 0);
    const ism::Values on_b = t.apply(values_at(e.a.mesh.vertices));
    std::map<int, int> first;
    for (int v = 0; v < t.rows(); ++v) {
      const int clean = e.b.clean[at(v)];
      CHECK(t.covers(v) == (clean >= 0));
      if (clean < 0) continue;
      const int same = first.insert({clean, v}).first->second;  // no cracks
      CHECK(on_b.row(v) == on_b.row(same));
      const ism::SurfacePoint image = map.backward_vertex(v);
      REQUIRE(image.exists());
      const ism::Values there = values_at(map.position_on_a(image).transpose());
      CHECK((on_b.row(v) - there.row(0)).norm() < 0.02);  // linear in between
    }
  }
}

TEST_CASE("images are asked for, and answered, in the ids given") {
  const Example e = example(true);
  const SurfaceMap map(e.result);
  const TriangleMesh& a = e.a.mesh;
  for (int v = 0; v < n_vertices(a); ++v) {
    const ism::SurfacePoint image = map.forward_vertex(v);
    CHECK(image.exists() == (e.a.clean[at(v)] >= 0));
    if (!image.exists()) continue;
    const ism::SurfacePoint back = map.backward(image);
    REQUIRE(back.exists());
    CHECK((map.position_on_a(back) - a.vertices.row(v).transpose()).norm() < 1e-9);
    const ism::SurfacePoint same = map.forward_vertex(e.a.first[at(e.a.clean[at(v)])]);
    CHECK((map.position_on_b(same) - map.position_on_b(image)).norm() < 1e-12);
  }
  int dropped = 0;
  for (int f = 0; f < n_triangles(a); ++f) {
    int covered = 0;
    for (int k = 0; k < 3; ++k) {
      const ism::SurfacePoint corner = map.forward({f, Vector3d::Unit(k)});
      covered += corner.exists();
      if (!corner.exists()) continue;
      const ism::SurfacePoint vertex = map.forward_vertex(a.triangles(f, k));
      CHECK((map.position_on_b(corner) - map.position_on_b(vertex)).norm() < 1e-9);
      const std::vector<ism::Polyline> edge =
          map.forward_path({a.triangles(f, k), a.triangles(f, (k + 1) % 3)});
      REQUIRE(edge.size() == 1);
      CHECK((map.position_on_b(edge[0].front()) - map.position_on_b(vertex)).norm() < 1e-9);
    }
    CHECK((covered == 0 || covered == 3));
    dropped += covered == 0;
  }
  CHECK(dropped == 2);  // the loose part and the triangle that is there twice
  CHECK_FALSE(map.forward_vertex(n_vertices(a)).exists());
  CHECK_FALSE(map.forward({n_triangles(a), Vector3d::Unit(0)}).exists());
  CHECK(map.forward_path({0, 1}).empty());
}

TEST_CASE("a vertex at which a closed surface is cut has an image if one of its corners has") {
  const TriangleMesh a = shapes::blob(2, 0.3, 1);
  const shapes::Disk b = shapes::spherical_cap(5, 16, 1.3);
  ism::Options options = runs::on_one_thread();
  options.max_iterations = 3;
  const ism::Result r = ism::compute_map(a, b.mesh, {}, options);
  REQUIRE(ism::is_usable(r.status));
  const SurfaceMap map(r);
  int at_cut = 0;
  for (int f = 0; f < n_triangles(a); ++f)
    for (int k = 0; k < 3; ++k) {
      if (!map.forward({f, Vector3d::Unit(k)}).exists()) continue;
      CHECK(map.forward_vertex(a.triangles(f, k)).exists());
      ++at_cut;
    }
  CHECK(at_cut > 0);
}

TEST_CASE("the meta mesh and remeshing speak of the meshes given") {
  const Example e = example(false);
  const SurfaceMap map(e.result);
  const ism::MetaMesh meta = map.meta_mesh();
  for (std::size_t p = 0; p < meta.face_a.size(); ++p)
    for (int i = meta.offsets[p]; i < meta.offsets[p + 1]; ++i) {
      const int v = meta.corners[at(i)];
      const Vector3d on_a = map.position_on_a({meta.face_a[p], meta.corner_a.row(i).transpose()});
      const Vector3d on_b = map.position_on_b({meta.face_b[p], meta.corner_b.row(i).transpose()});
      CHECK((on_a - meta.on_a.row(v).transpose()).norm() < 1e-9);
      CHECK((on_b - meta.on_b.row(v).transpose()).norm() < 1e-9);
    }
  for (int v = 0; v < n_vertices(e.a.mesh); ++v) {
    const int clean = e.a.clean[at(v)];
    CHECK(meta.same_a[at(v)] == (clean < 0 ? -1 : e.a.first[at(clean)]));
  }
  const ism::TriangleMesh mesh = ism::remesh(map, Side::kA);
  CHECK(n_vertices(mesh) == n_vertices(e.a.mesh));
  CHECK(n_triangles(mesh) == n_triangles(e.clean_a));
  const ism::Prepared welded = ism::prepare(mesh);
  CHECK(welded.problems.empty());
  for (const ism::Problem& r : welded.repairs)
    CHECK(r.kind != ism::Problem::Kind::kInconsistentOrientation);
  CHECK(n_vertices(*welded.mesh) == n_vertices(e.clean_a));
}

// ---- warnings ----

namespace {

/// A bent grid and landmarks on a copy of it that is scaled and, if asked, mirrored.
ism::Embedding start_of_copy(bool is_mirrored, double size) {
  Rng rng(3);
  shapes::Disk a = shapes::perturbed_grid(12, 9, 0.2, rng);
  shapes::bend(a, 0.4);
  TriangleMesh b = a.mesh;
  b.vertices *= size;
  if (is_mirrored) {
    b.vertices.col(0) *= -1;
    b.triangles.col(1).swap(b.triangles.col(2));
  }
  std::vector<ism::Landmark> landmarks;
  for (int v : {0, 14, 40, 77, 90, 110, 125}) landmarks.push_back({v, v});
  return ism::initial_embedding(a.mesh, b, landmarks, runs::on_one_thread());
}

}  // namespace

TEST_CASE("landmarks that fit the mirror image only are told") {
  CHECK(start_of_copy(false, 1).warnings.empty());
  CHECK(start_of_copy(false, 30).warnings.empty());
  const ism::Embedding mirrored = start_of_copy(true, 1);
  REQUIRE(mirrored.warnings.size() == 1);
  CHECK(mirrored.warnings[0].message.find("mirror image") != std::string::npos);
}

TEST_CASE("landmarks tell the size of a part in another unit, and what keep_scale misses") {
  const shapes::Disk whole = shapes::grid(20, 20);
  TriangleMesh part = shapes::grid(6, 6).mesh;  // the corner of the whole, in another unit
  part.vertices *= 0.001;
  std::vector<ism::Landmark> landmarks;
  for (int j : {0, 3, 6})
    for (int i : {0, 3, 6}) landmarks.push_back({i + 7 * j, i + 21 * j});
  ism::Options options = runs::on_one_thread();
  options.max_iterations = 30;
  const ism::Result r = ism::compute_map(part, whole.mesh, landmarks, options);
  REQUIRE(ism::is_usable(r.status));
  REQUIRE(r.warnings.size() == 1);
  CHECK(r.warnings[0].message.find("1 unit of A is 1000.00 units of B") != std::string::npos);
  CHECK(r.start.scale_a / r.start.scale_b == doctest::Approx(1000));
  CHECK(r.final_state().mean_distortion < 2.01);
  CHECK(r.final_state().coverage_a > 0.99);
  const SurfaceMap map(r);
  double sum = 0, area = 0;
  for (const ism::PolygonDistortion& p : map.distortion()) {
    sum += p.density * (p.area_a + p.area_b);
    area += p.area_a + p.area_b;
  }
  CHECK(sum / area == doctest::Approx(r.final_state().mean_distortion).epsilon(1e-9));
  options.keep_scale = true;
  options.max_iterations = 1;
  const ism::Result kept = ism::compute_map(part, whole.mesh, landmarks, options);
  REQUIRE(!kept.warnings.empty());
  CHECK(kept.warnings[0].message.find("1000.00 units") != std::string::npos);
  const ism::Result unmarked = ism::compute_map(part, whole.mesh, {}, options);
  REQUIRE(!unmarked.warnings.empty());
  CHECK(unmarked.warnings[0].message.find("not scaled") != std::string::npos);
}

TEST_CASE("a map that ends too bent to be of use is told, others are not; all have worst places") {
  const shapes::Disk a = shapes::grid(6, 6), b = shapes::grid(6, 6);
  ism::Options options = runs::on_one_thread();
  options.initial_f = a.plane;
  options.initial_g = b.plane;
  options.initial_g.col(0) *= 4;
  options.max_iterations = 0;
  options.keep_scale = true;
  const ism::Result bent = ism::compute_map(a.mesh, b.mesh, {}, options);
  REQUIRE(bent.warnings.size() == 1);
  CHECK(bent.warnings[0].message.find("its mean distortion is 13.81") != std::string::npos);
  CHECK(bent.worst.empty());  // it is the same everywhere
  options.initial_g = b.plane;
  const int vertex = 24, other = 8;
  options.initial_f(vertex, 0) += 0.6 * (a.plane(1, 0) - a.plane(0, 0));
  options.initial_f(other, 1) += 0.1 * (a.plane(1, 0) - a.plane(0, 0));
  const ism::Result moved = ism::compute_map(a.mesh, b.mesh, {}, options);
  CHECK(moved.warnings.empty());
  REQUIRE(moved.worst.size() == 1);
  const ism::WorstPlace& worst = moved.worst[0];
  CHECK(worst.vertex_a == vertex);
  CHECK(worst.area > 0.01);
  CHECK(worst.area < 6.0 / 72 + 1e-9);  // its triangles
  CHECK(worst.distortion > 2 + 2 * (moved.final_state().mean_distortion - 2));
  CHECK(worst.on_b.exists());
  CHECK(ism::worst_places(ism::SurfaceMap(moved), 0).empty());
}

}  // namespace ids_tests

#endif  // ISM_TESTS_PART_IDS_HPP

// Coarse to fine: decimation of embedded surfaces, what returns, and the map of each level.

#ifndef ISM_TESTS_PART_COARSE_HPP
#define ISM_TESTS_PART_COARSE_HPP

#include "ism.hpp"
#include "ism_verify.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <string>
#include <vector>

namespace coarse_tests {
namespace {

using namespace ism::detail;
using ism::Landmark;
using ism::Options;
using ism::Points2;
using ism::Result;
using ism::Side;
using ism::Solver;
using runs::on_one_thread;
using shapes::Disk;
using shapes::half_edges;
using shapes::Rng;

/// A disk whose boundary is straight in part, and one with openings.
std::vector<Disk> disks(Rng& rng) {
  std::vector<Disk> all = {shapes::perturbed_grid(12, 12, 0.2, rng),
                           shapes::random_disk(10, 9, rng), shapes::with_openings(14, 14, rng)};
  for (Disk& disk : all) shapes::bend(disk, 0.5);
  return all;
}

Disk bent_grid(int nx, int ny, double bend, Rng& rng) {
  Disk d = shapes::perturbed_grid(nx, ny, 0.2, rng);
  shapes::bend(d, bend);
  return d;
}

bool is_injective_here(const Hierarchy& h) {
  const Level level = h.current();
  return is_injective(level.surface.mesh, h.positions(level));
}

Result map_of(const Disk& a, const Disk& b, const std::vector<Landmark>& landmarks,
              const Options& options) {
  Result r = ism::compute_map(a.mesh, b.mesh, landmarks, options);
  CAPTURE(r.message);
  REQUIRE(ism::is_usable(r.status));
  CHECK(is_injective(half_edges(*r.start.a), r.f));
  CHECK(is_injective(half_edges(*r.start.b), r.g));
  return r;
}

}  // namespace

TEST_CASE("a surface is injective on every level, its openings open") {
  Rng rng(51);
  const Executor executor{on_one_thread()};
  for (const Disk& disk : disks(rng)) {
    const Surface s = build_surface(disk.mesh, true);
    const Array<char> none(s.mesh.n_vertices, 0);
    Hierarchy h(s, Side::kA, none, 30, nullptr, -1, executor);
    CHECK(h.active() < s.mesh.n_vertices / 2);
    REQUIRE(h.embed_base());
    CHECK(is_injective_here(h));
    CHECK(h.current().surface.mesh.loops() == s.mesh.loops());
    while (!h.is_full()) {
      REQUIRE(h.grow_by_one());
      if (h.active() % 10 == 0) CHECK(is_injective_here(h));
    }
    CHECK(is_injective(s.mesh, h.positions()));
  }
}

TEST_CASE("the loop that a vertex names becomes the outline") {
  Rng rng(52);
  const Surface s = build_surface(shapes::with_openings(14, 14, rng).mesh, true);
  const Executor executor{on_one_thread()};
  const Array<char> none(s.mesh.n_vertices, 0);
  REQUIRE(s.mesh.loops() > 1);
  for (int loop = 0; loop < s.mesh.loops(); ++loop) {
    const int v = s.mesh.tail[s.mesh.boundary[s.mesh.loop[loop]]];
    Hierarchy h(s, Side::kA, none, 30, nullptr, v, executor);
    REQUIRE(h.embed_base());
    const Level level = h.current();
    const HalfEdgeMesh& m = level.surface.mesh;
    const Points2 x = h.positions(level);
    for (int i = 0; i < m.loops(); ++i) {
      double area = 0;
      for (int k = m.loop[i]; k < m.loop[i + 1]; ++k)
        area += cross(row2(x, m.tail[m.boundary[k]]), row2(x, m.tip(m.boundary[k])));
      CHECK((area > 0) == (i == h.outer_loop_of(level)));
    }
  }
}

TEST_CASE("a strained map that is even is smooth already") {
  Rng rng(52);
  const Executor executor{on_one_thread()};
  for (const Disk& disk : disks(rng)) {
    ism::TriangleMesh flat = disk.mesh;
    for (int v = 0; v < flat.vertices.rows(); ++v)
      flat.vertices.row(v) << disk.plane(v, 0), disk.plane(v, 1), 0;
    const Surface s = build_surface(flat, true);
    Eigen::Matrix2d M;
    M << 1.3, 0.4, -0.2, 0.7;
    const Points2 image = disk.plane * M.transpose();
    FlatNewton newton({smoothed_rest(s, image)}, image, executor);
    CHECK(newton.value(image) == doctest::Approx(4 * s.total_area).epsilon(1e-10));
    while (newton.minimize(5, 0)) {
    }
    CHECK((newton.positions() - image).cwiseAbs().maxCoeff() < 1e-7 * image.cwiseAbs().maxCoeff());
  }
}

TEST_CASE("a map by coarse levels is as good as one without, in fewer iterations") {
  Rng rng(53);
  const Disk a = bent_grid(26, 26, 0.9, rng), b = bent_grid(22, 30, -0.7, rng);
  const std::vector<Landmark> landmarks = {{60, 70, 0}, {500, 480, 0}, {620, 600, 0}};
  Options options = on_one_thread();
  options.candidates = false;  // their map would be a level
  options.coarsest = 0;
  const Result plain = map_of(a, b, landmarks, options);
  CHECK(plain.coarse.empty());
  options.coarsest = 45;
  const Result coarse = map_of(a, b, landmarks, options);
  REQUIRE(coarse.coarse.size() == 2);
  CHECK(coarse.coarse[0].polygons < coarse.coarse[1].polygons / 2);
  CHECK(coarse.coarse[1].polygons < coarse.initial.polygons / 2);
  for (const ism::IterationLog& level : coarse.coarse) {
    CHECK(level.iteration > 0);
    CHECK(level.mean_distortion > 2);
  }
  CHECK(coarse.initial.energy < plain.initial.energy);
  CHECK(coarse.log_begin.energy == coarse.initial.energy);
  CHECK(coarse.log[0].energy <= coarse.log_begin.energy);
  const auto full = [](const Result& r) {
    int n = 0;
    for (const ism::IterationLog& log : r.log) n += !log.quasi_newton;
    return n;
  };
  CHECK(full(coarse) < full(plain));
  CHECK(coarse.final_state().energy < plain.final_state().energy + 2e-3);
  for (std::size_t i = 1; i < coarse.log.size(); ++i)
    CHECK(coarse.log[i].energy <= coarse.log[i - 1].energy);
}

TEST_CASE("a map is there on all levels, and constraints hold once it is on the given meshes") {
  Rng rng(54);
  const Disk a = bent_grid(13, 13, 0.6, rng), b = bent_grid(12, 14, -0.5, rng);
  const std::vector<Landmark> landmarks = {{30, 31}, {150, 140}, {100, 100}};
  Options free = on_one_thread(), pinned = free, exact = free, fixed = free, slide = free;
  pinned.pins_a = {88, 60};
  pinned.fixed_b = {70, 110};
  exact.exact_landmarks = true;
  fixed.boundary = ism::Boundary::kFixed;
  slide.boundary = ism::Boundary::kSlide;
  slide.pins_b = {80};
  for (Options options : {free, pinned, exact, fixed, slide}) {
    options.coarsest = 12;
    Solver solver(a.mesh, b.mesh, landmarks, options);
    int coarse_steps = 0;
    Points2 before;
    while (solver.step()) {
      const Result& r = solver.result();
      if (solver.result().status == ism::Status::kNoMapYet || !r.log.empty()) continue;
      CHECK(is_injective(half_edges(*r.start.a), r.f));
      CHECK(is_injective(half_edges(*r.start.b), r.g));
      coarse_steps += before.size() > 0 && before != r.f;
      before = r.f;
    }
    const Result& r = solver.result();
    CAPTURE(r.message);
    CHECK(r.status == ism::Status::kConverged);
    const bool is_free = options.boundary == ism::Boundary::kFree && !options.exact_landmarks;
    CHECK(r.coarse.empty() == !is_free);
    CHECK(r.coarse.empty() == (coarse_steps == 0));
    CHECK(coarse_steps <= static_cast<int>(r.coarse.size()) + 1);  // once a level, see below
    CHECK(r.final_state().pin_residual < 1e-9);
    CHECK(r.final_state().energy < r.initial.energy);
    if (options.exact_landmarks)
      for (const Landmark& l : landmarks) CHECK(r.f.row(l.a.vertex) == r.g.row(l.b.vertex));
    for (int v : options.fixed_b) CHECK(r.g.row(v) == r.start.g.row(v));
    const HalfEdgeMesh m = half_edges(*r.start.a);
    for (int h : m.boundary)
      if (options.boundary == ism::Boundary::kFixed)
        CHECK(r.f.row(m.tail[h]) == r.start.f.row(m.tail[h]));
  }
}

TEST_CASE("surfaces with openings pass through coarse levels, too") {
  Rng rng(55);
  Disk a = shapes::with_openings(16, 16, rng), b = shapes::with_openings(14, 14, rng);
  shapes::bend(a, 0.4);
  shapes::bend(b, -0.3);
  Options options = on_one_thread();
  options.coarsest = 40;
  const Result r = map_of(a, b, {{20, 18}, {200, 150}}, options);
  CHECK_FALSE(r.coarse.empty());
  CHECK(r.final_state().energy < r.initial.energy);
}

TEST_CASE("nothing is lost where the start is the end already") {
  Rng rng(56);
  const Disk a = bent_grid(20, 20, 0.8, rng), b = bent_grid(19, 21, -0.8, rng);
  Options options = on_one_thread();
  options.coarsest = 60;
  const Result first = map_of(a, b, {{50, 50, 0}, {350, 350, 0}}, options);
  options.initial_f = first.f;
  options.initial_g = first.g;
  const Result again = map_of(a, b, {}, options);
  CHECK(again.coarse.empty());
  const auto value = [&](const ism::IterationLog& x) {  // E_f and E_g depend on the planes' size
    return x.map_energy - (options.coverage_weight + 2) * (x.coverage_a + x.coverage_b);
  };
  const double before = first.final_state().mean_distortion;
  CHECK(again.initial.mean_distortion == doctest::Approx(before).epsilon(1e-9));
  CHECK(value(again.final_state()) < value(first.final_state()) + 1e-4);
}

TEST_CASE("halved edges are none longer than asked, and leave the shape and the ids") {
  Rng rng(57);
  for (const Disk& disk : disks(rng)) {
    const Surface before = build_surface(disk.mesh, false);
    Surface s = before;
    constexpr double kLongest = 0.05;
    halve_edges(kLongest, 0, 100000, s);
    REQUIRE(!s.added.empty());
    CHECK(s.vertices.topRows(before.mesh.n_vertices) == before.vertices);
    CHECK(s.total_area == doctest::Approx(before.total_area));
    CHECK(s.mesh.loops() == before.mesh.loops());
    CHECK(s.mesh.n_faces == triangles_from(s.mesh.tail).rows());
    CHECK(count_components(s.mesh) == 1);
    double longest = 0;
    for (int h = 0; h < s.mesh.tail.size(); ++h) longest = std::max(longest, s.edge_length(h));
    CHECK(longest <= kLongest);
    CHECK(longest > 0.5 * kLongest);
    Surface same = before;
    halve_edges(2, 0, 100000, same);
    CHECK(same.added.empty());
    halve_edges(kLongest, 1e-4, 7, same);
    CHECK(same.added.size() == 7);
  }
}

/// Two needles that share a long edge, bent along it.
ism::TriangleMesh needles() {
  ism::TriangleMesh mesh;
  mesh.vertices.resize(4, 3);
  mesh.vertices << 0, 0, 0, 8, 0, 0, 8, 0.1, 0, 8, 0, 0.1;
  mesh.triangles.resize(2, 3);
  mesh.triangles << 0, 1, 2, 1, 0, 3;
  return mesh;
}

TEST_CASE("what halved edges leave of a needle is Delaunay, and lies in it") {
  const Surface before = build_surface(needles(), true);
  Surface s = before;
  halve_edges(0.25, 0, 100000, s);
  Pieces pieces;
  REQUIRE(find_pieces(before.mesh, s.added, triangles_from(s.mesh.tail), pieces));
  const HalfEdgeMesh& m = s.mesh;
  const auto corner = [&](int h) { return row3(s.vertices, m.tail[h]); };
  int flippable = 0, longest_fan = 0;
  for (int h = 0; h < m.tail.size(); ++h) {
    const int t = m.twin[h];
    if (t < 0) CHECK(m.out[m.tail[h]] == h);
    if (t < h || pieces.face[h / 3] != pieces.face[t / 3]) continue;
    ++flippable;
    double cotangents = 0;
    for (int side : {h, t}) {
      const Vec3 c = corner(prev(side)), u = corner(h) - c, v = corner(next(h)) - c;
      cotangents += dot(u, v) / norm(cross(u, v));
    }
    CHECK(cotangents > -1e-6);
  }
  for (int v = 0; v < m.n_vertices; ++v) {
    int edges = 0;
    m.for_each_outgoing(v, [&](int) { ++edges; });
    longest_fan = std::max(longest_fan, edges);
  }
  CHECK(flippable > 100);
  CHECK(longest_fan <= 8);
  for (int h = 0; h < m.tail.size(); ++h) {
    const ism::SurfacePoint p = pieces.to_mesh({h / 3, Eigen::Vector3d::Unit(h % 3)});
    Vec3 at;
    for (int k = 0; k < 3; ++k)
      at += p.barycentric[k] * row3(before.vertices, before.mesh.corner(p.face, k));
    CHECK(norm(at - corner(h)) < 1e-14);
  }
  Rng rng(58);
  for (int i = 0; i < 200; ++i) {  // there and back
    Eigen::Vector3d weights(rng.uniform(), rng.uniform(), rng.uniform());
    weights /= weights.sum();
    const ism::SurfacePoint here = {rng.below(2), weights};
    const ism::SurfacePoint back = pieces.to_mesh(pieces.from_mesh(here));
    CHECK(back.face == here.face);
    CHECK((back.barycentric - weights).norm() < 1e-9);
  }
}

TEST_CASE("a list of vertices that does not lead to a mesh places nothing") {
  const Surface before = build_surface(needles(), true);
  Surface s = before;
  halve_edges(1, 0, 100000, s);
  const ism::Triangles fine = triangles_from(s.mesh.tail);
  Pieces pieces;
  CHECK(find_pieces(before.mesh, s.added, fine, pieces));
  for (const int spoilt : {-7, -1, 100000, 2}) {
    std::vector<ism::AddedVertex> added = s.added;
    added[1].corners[0] = spoilt;
    CHECK_FALSE(find_pieces(before.mesh, added, fine, pieces));
  }
  CHECK_FALSE(find_pieces(before.mesh, {}, fine, pieces));
  CHECK_FALSE(find_pieces(before.mesh, s.added, fine.topRows(fine.rows() - 1), pieces));
  ism::Triangles turned = fine;
  std::swap(turned(0, 0), turned(0, 1));
  CHECK_FALSE(find_pieces(before.mesh, s.added, turned, pieces));
}

TEST_CASE("landmarks in triangles stay where they are when edges are halved") {
  const Surface before = build_surface(needles(), true);
  SurfacePair pair = {before, before};
  Array<PlacedLandmark> landmarks;
  Rng rng(59);
  for (int i = 0; i < 100; ++i) {
    PlacedLandmark l;
    for (int k = 0; k < 3; ++k) {
      l.a.corners[k] = before.mesh.corner(i % 2, k);
      l.a.weights[k] = k == i % 4 ? 0 : rng.uniform() + 0.01;  // some lie on edges
    }
    tidy(l.a);
    l.b = l.a;
    landmarks.push_back(l);
  }
  const Array<PlacedLandmark> given = landmarks;
  refine(0.25, 0, 100000, Side::kA, pair, landmarks);
  for (int i = 0; i < landmarks.size(); ++i) {
    const Place& p = landmarks[i].a;
    REQUIRE((vertex_at(p) >= 0 || find_place(pair.a.mesh, p) >= 0));
    CHECK(norm(mean(p, pair.a.vertices) - mean(given[i].a, before.vertices)) < 1e-9);
    CHECK(landmarks[i].b.corners == given[i].b.corners);
  }
  CHECK(located(landmarks, pair)[7].a.corners == landmarks[7].a.corners);
}

TEST_CASE("a coarse surface gets the vertices that the map needs") {
  const ism::TriangleMesh octahedron = shapes::sphere(0), ball = shapes::sphere(4);
  for (const bool is_refined : {true, false}) {
    Options options = on_one_thread();
    options.refine = is_refined ? 8 : 0;
    const Result r = ism::compute_map(octahedron, ball, {}, options);
    REQUIRE(ism::is_usable(r.status));
    CHECK(r.final_state().mean_distortion < 2.25);  // closed ones have 64 vertices at least
    const ism::SurfaceMap map(r);
    CHECK(ism::verify_map(map).status == ism::Status::kDone);
    CHECK(map.mesh(Side::kA).vertices == octahedron.vertices);
    for (int v = 0; v < octahedron.vertices.rows(); ++v) CHECK(map.forward_vertex(v).exists());
    const ism::SurfacePoint p = {5, {0.1, 0.3, 0.6}};  // of the triangles given
    const ism::SurfacePoint back = map.backward(map.forward(p));
    CHECK((map.position_on_a(back) - map.position_on_a(p)).norm() < 1e-9);
    CHECK(map.meta_mesh().face_a.size() > 2000);
    for (int f : map.meta_mesh().face_a) CHECK(f < octahedron.triangles.rows());
  }
}

}  // namespace coarse_tests

#endif  // ISM_TESTS_PART_COARSE_HPP

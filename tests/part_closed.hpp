// Closed surfaces: mapped on pillows, planes without a boundary.

#ifndef ISM_TESTS_PART_CLOSED_HPP
#define ISM_TESTS_PART_CLOSED_HPP

#include "closed.hpp"
#include "ism.hpp"
#include "ism_verify.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace closed_tests {
namespace {

using namespace ism::detail;
using ism::Landmark;
using ism::Options;
using ism::Points2;
using ism::Result;
using ism::Side;
using ism::Status;
using ism::SurfaceMap;
using ism::TriangleMesh;
using runs::on_one_thread;

/// The vertices of two subdivided octahedra that are closest in direction to some random ones.
std::vector<Landmark> landmarks_of(const TriangleMesh& a, const TriangleMesh& b, int n) {
  shapes::Rng rng(7);
  const auto closest = [](const TriangleMesh& mesh, const Eigen::Vector3d& p) {
    int best = 0;
    for (int v = 0; v < mesh.vertices.rows(); ++v)
      if (mesh.vertices.row(v).normalized().dot(p) > mesh.vertices.row(best).normalized().dot(p))
        best = v;
    return best;
  };
  std::vector<Landmark> landmarks;
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d p =
        Eigen::Vector3d(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)).normalized();
    const Landmark l = {closest(a, p), closest(b, p)};
    bool is_new = true;
    for (const Landmark& other : landmarks)
      is_new = is_new && other.a.vertex != l.a.vertex && other.b.vertex != l.b.vertex;
    if (is_new) landmarks.push_back(l);
  }
  return landmarks;
}

struct Blobs {
  TriangleMesh a, b;
  std::vector<Landmark> landmarks;
};

Blobs blobs(int level, int n_landmarks) {
  Blobs pair = {shapes::blob(level, 0.3, 1), shapes::blob(level, 0.2, 2), {}};
  pair.landmarks = landmarks_of(pair.a, pair.b, n_landmarks);
  return pair;
}

Options iterations(int n) {
  Options options = on_one_thread();
  options.max_iterations = n;
  return options;
}

/// The map is a homeomorphism of both surfaces.
void check_closed(const TriangleMesh& a, const TriangleMesh& b, const Result& r) {
  CAPTURE(r.message);
  REQUIRE(ism::is_usable(r.status));
  const HalfEdgeMesh m = shapes::half_edges(*r.start.a), n = shapes::half_edges(*r.start.b);
  CHECK(m.loops() == 1);
  CHECK(n.loops() == 1);
  CHECK(is_injective(m, r.f));
  CHECK(is_injective(n, r.g));
  CHECK(r.final_state().coverage_a == doctest::Approx(1).epsilon(1e-12));
  CHECK(r.final_state().coverage_b == doctest::Approx(1).epsilon(1e-12));
  for (int v = 0; v < a.vertices.rows(); ++v)
    CHECK(r.start.a->vertices.row(v) == a.vertices.row(v));
  const SurfaceMap map(r);
  REQUIRE(map.status() == Status::kDone);
  CHECK(closed::round_trip(map) < 1e-9);
  const ism::MetaMesh meta = map.meta_mesh();
  const closed::Topology topology = closed::topology(meta);
  CHECK(topology.is_manifold);
  CHECK(topology.euler == 2);
  CHECK(closed::area(meta, meta.on_a) == doctest::Approx(closed::area(a)).epsilon(1e-12));
  CHECK(closed::area(meta, meta.on_b) == doctest::Approx(closed::area(b)).epsilon(1e-12));
  CHECK(static_cast<int>(map.distortion().size()) == meta.n_polygons());
}

/// A blob on a pillow, with cones near the corners of a tetrahedron.
struct OnPillow {
  Surface surface;
  Points2 x;
};

OnPillow on_pillow(int level, std::uint64_t seed, int first = 0) {
  const Options options = on_one_thread();
  const Executor executor(options);
  OnPillow result = {build_surface(shapes::blob(level, 0.3, seed), false), {}};
  const Eigen::Vector3d corner[4] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  std::array<int, 4> cones = {0, 0, 0, 0};
  for (std::size_t i = 0; i < 4; ++i)
    for (int v = 0; v < result.surface.mesh.n_vertices; ++v) {
      const auto along = [&](int w) {
        const Eigen::Vector3d p = result.surface.vertices.row(w);
        return p.dot(corner[(i + static_cast<std::size_t>(first)) % 4]);
      };
      if (along(v) > along(cones[i])) cones[i] = v;
    }
  REQUIRE(make_pillow(cones, kPillowSide, result.surface));
  REQUIRE(orbifold_tutte(result.surface.mesh, executor, result.x));
  return result;
}

JointSurface both_on_pillows(const OnPillow& a, const OnPillow& b, Points2& x) {
  x = stacked(a.x, b.x);
  return join({a.surface, b.surface});
}

}  // namespace

TEST_CASE("the smallest closed surfaces are mapped") {
  const TriangleMesh shapes[] = {shapes::tetrahedron(), shapes::sphere(0), shapes::sphere(1)};
  const Options options = iterations(2);
  for (const TriangleMesh& a : shapes)
    for (const TriangleMesh& b : shapes) {
      CAPTURE(a.triangles.rows());
      CAPTURE(b.triangles.rows());
      check_closed(a, b, ism::compute_map(a, b, {}, options));
    }
}

TEST_CASE("maps of closed surfaces are homeomorphisms, with landmarks and without") {
  for (int n : {0, 1, 2, 6}) {
    CAPTURE(n);
    const TriangleMesh a = shapes::blob(n < 6 ? 2 : 3, 0.3, 1), b = shapes::blob(2, 0.2, 2);
    const Result r = ism::compute_map(a, b, landmarks_of(a, b, n), on_one_thread());
    check_closed(a, b, r);
    CHECK(r.status == Status::kConverged);
    CHECK(r.final_state().mean_distortion < 2.3);
    CHECK(r.log.size() >= 10);  // after coarse levels
    for (std::size_t i = 0; i < r.log.size(); ++i)
      CHECK(r.log[i].iteration == static_cast<int>(i) + 1);
  }
}

TEST_CASE("a sphere onto itself ends as an isometry") {
  const TriangleMesh a = shapes::blob(3, 0.3, 5);
  const Result r = ism::compute_map(a, a, landmarks_of(a, a, 8), on_one_thread());
  check_closed(a, a, r);
  CHECK(r.final_state().mean_distortion < 2.001);
}

TEST_CASE("a closed surface is opened where the other one has its boundary") {
  const TriangleMesh ball = shapes::blob(3, 0.2, 3);
  const shapes::Disk cap = shapes::spherical_cap(6, 16, 2.4);
  const std::vector<Landmark> landmarks = landmarks_of(ball, cap.mesh, 6);
  Options options = iterations(30);
  const Result r = ism::compute_map(ball, cap.mesh, landmarks, options);
  CAPTURE(r.message);
  REQUIRE(ism::is_usable(r.status));
  CHECK(is_injective(shapes::half_edges(*r.start.a), r.f));
  CHECK(is_injective(shapes::half_edges(*r.start.b), r.g));
  CHECK(r.final_state().coverage_b > 0.9);
  CHECK(r.final_state().coverage_a < 1);
  REQUIRE(!r.start.added_a.empty());
  const Eigen::Vector3d at = ball.vertices.row(r.start.added_a[0].corners[0]);
  CHECK(at.normalized().z() < -0.5);  // the cap is open below
  const SurfaceMap map(r);
  CHECK(map.status() == Status::kDone);
  const Result other = ism::compute_map(cap.mesh, ball, {}, options);
  CHECK(ism::is_usable(other.status));
}

TEST_CASE("exact landmarks of closed surfaces are kept, at cones and elsewhere") {
  for (int level : {1, 2, 3}) {
    CAPTURE(level);
    const auto [a, b, landmarks] = blobs(level, 5);
    Options options = iterations(10);
    options.exact_landmarks = true;
    const Result r = ism::compute_map(a, b, landmarks, options);
    check_closed(a, b, r);
    CHECK(r.final_state().pin_residual < 1e-9);
    const SurfaceMap map(r);
    for (const Landmark& l : landmarks) {
      const ism::SurfacePoint image = map.forward_vertex(l.a.vertex);
      REQUIRE(image.exists());
      CHECK((map.position_on_b(image).transpose() - b.vertices.row(l.b.vertex)).norm() < 1e-9);
    }
  }
}

TEST_CASE("a Solver maps closed surfaces in steps, and can be changed then") {
  const auto [a, b, landmarks] = blobs(3, 5);
  Options options = iterations(12);
  const Result whole = ism::compute_map(a, b, landmarks, options);
  check_closed(a, b, whole);
  ism::Solver solver(a, b, landmarks, options);
  while (solver.step()) {
  }
  CHECK(solver.result().f == whole.f);
  CHECK(solver.result().g == whole.g);
  CHECK(solver.result().log.size() == whole.log.size());
  CHECK(solver.fraction() == 1);
  options.max_iterations = 15;
  CHECK(solver.change(landmarks, options).status == Status::kDone);
  while (solver.step()) {
  }
  check_closed(a, b, solver.result());
  int calls = 0;
  options.progress = [&](const ism::Progress& p) { return p.is_embedding || ++calls < 4; };
  const Result open = ism::compute_map(a, b, landmarks, options);
  CHECK(open.status == Status::kCancelled);
  CHECK(is_injective(shapes::half_edges(*open.start.a), open.f));
  CHECK(SurfaceMap(open).status() == Status::kDone);
}

TEST_CASE("on a pillow, what is seen from both sides of an edge is the same to the last bit") {
  const OnPillow p = on_pillow(3, 1);
  const HalfEdgeMesh& m = p.surface.mesh;
  REQUIRE(m.pillow.cones.size() == 4);
  int cut = 0;
  for (int h = 0; h < m.tail.size(); ++h) {
    const int t = m.twin[h];
    const Motion motion = motion_across(m, h);
    cut += !(motion == Motion());
    CHECK(place_of(m, p.x, h) == motion * place_of(m, p.x, next(t)));
    CHECK(place_of(m, p.x, next(h)) == motion * place_of(m, p.x, t));
  }
  CHECK(cut > 6);
  for (int v = 0; v < m.n_vertices; ++v) {  // once around
    Motion around;
    m.for_each_outgoing(v, [&](int h) { around = around * motion_across(m, prev(h)); });
    const bool is_cone = m.pillow.is_cone(v);
    CHECK(around.sign == (is_cone ? -1 : 1));
    if (!is_cone) CHECK(around == Motion());
    CHECK((cone_number(row2(p.x, v), kPillowSide) >= 0) == is_cone);
  }
  double area = 0;
  for (int f = 0; f < m.n_faces; ++f) {
    const Vec2 q = corner_place(m, p.x, f, 0);
    area += 0.5 * cross(corner_place(m, p.x, f, 1) - q, corner_place(m, p.x, f, 2) - q);
  }
  CHECK(area == doctest::Approx(2 * kPillowSide * kPillowSide).epsilon(1e-12));
}

TEST_CASE("the overlay of two pillows covers both, wherever their cuts are") {
  for (int first : {0, 1, 2, 3}) {
    CAPTURE(first);
    Points2 x;
    const JointSurface s = both_on_pillows(on_pillow(3, 1, first), on_pillow(2, 2, first), x);
    Overlay overlay;
    compute_overlay(s, x, overlay);
    double area = 0;
    std::set<std::array<double, 5>> pairs;
    for (const OverlayPolygon& p : overlay.polygons) {
      const SixPoints points = six_points(s.mesh, x, p);
      area += polygon_area(polygon_shape(p, points), points);
      pairs.insert({double(p.ta), double(p.tb), p.motion.sign, p.motion.shift.x, p.motion.shift.y});
    }
    CHECK(area == doctest::Approx(2 * kPillowSide * kPillowSide).epsilon(1e-12));
    CHECK(static_cast<int>(pairs.size()) == overlay.polygons.size());
  }
}

TEST_CASE("on a pillow, the gradient agrees with differences, springs included") {
  Points2 start;
  const JointSurface s = both_on_pillows(on_pillow(2, 1), on_pillow(1, 2), start);
  const Options options = on_one_thread();
  const Executor executor(options);
  const Weights weights = {2.2, 1e-2, 1e-3, &options.measure};
  Array<Spring> springs;
  for (int v = 0; v < 12; ++v) {
    const Vec2 p = row2(start, v), q = row2(start, s.n_a + v);
    springs.push_back({v, s.n_a + v, diagonal(0.3), {0.1, 0.2}, nearest_motion(s.mesh, p, q)});
  }
  const auto energy = [&](const Points2& x) {
    Iterate iterate;
    iterate.x = x;
    evaluate(s, weights, iterate);
    return with_springs(iterate.energy, springs, x);
  };
  Iterate x;
  x.x = start;
  evaluate(s, weights, x);
  ModelBuilder builder(s, weights, executor);
  builder.differentiate_elements(x);
  QuadraticModel model = builder.assemble();
  add_spring_gradient(springs, start, model.gradient);
  shapes::Rng rng(5);
  for (int round = 0; round < 10; ++round) {
    Array<Vec2> d(s.mesh.n_vertices);
    for (int v = 0; v < d.size(); ++v)
      if (!s.mesh.pillow.is_cone(v)) d[v] = {rng.uniform(-1, 1), rng.uniform(-1, 1)};
    const double step = 1e-7 * max_step(s.mesh, start, d) / 1e-3;
    Points2 ahead = start, behind = start;
    for (int v = 0; v < d.size(); ++v) {
      set_row(ahead, v, row2(start, v) + step * d[v]);
      set_row(behind, v, row2(start, v) - step * d[v]);
    }
    const double difference = (energy(ahead) - energy(behind)) / (2 * step);
    CHECK(difference == doctest::Approx(dot(model.gradient, d)).epsilon(1e-3));
  }
}

TEST_CASE("paths, remeshing and attributes cross the cut") {
  const auto [a, b, landmarks] = blobs(3, 5);
  Options options = iterations(20);
  const Result r = ism::compute_map(a, b, landmarks, options);
  check_closed(a, b, r);
  const SurfaceMap map(r);
  std::vector<std::array<int, 2>> edges;
  for (int f = 0; f < a.triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      if (a.triangles(f, k) < a.triangles(f, (k + 1) % 3))
        edges.push_back({a.triangles(f, k), a.triangles(f, (k + 1) % 3)});
  for (const std::array<int, 2>& edge : edges) {
    const std::vector<ism::Polyline> image = map.forward_path({edge[0], edge[1]});
    REQUIRE(image.size() == 1);
    const auto at = [&](const ism::SurfacePoint& p) { return map.position_on_b(p); };
    const auto end = [&](int v) { return at(map.forward_vertex(v)); };
    CHECK((at(image[0].front()) - end(edge[0])).norm() < 1e-9);
    CHECK((at(image[0].back()) - end(edge[1])).norm() < 1e-9);
  }
  const TriangleMesh mesh = ism::remesh(map, Side::kA);
  CHECK(mesh.triangles == a.triangles);
  CHECK(build_half_edges(static_cast<int>(mesh.vertices.rows()), mesh.triangles).boundary.empty());
  const ism::Transfer to_b =
      ism::transfer(map.meta_mesh(), Side::kA, ism::Element::kVertex, ism::Element::kVertex);
  CHECK(to_b.n_sources == a.vertices.rows());
  CHECK(to_b.rows() == b.vertices.rows());
  for (int v = 0; v < to_b.rows(); ++v) CHECK(to_b.covers(v));
}

TEST_CASE("paths along all edges of a closed surface are there") {
  const auto [a, b, landmarks] = blobs(3, 5);
  const ism::Embedding start = ism::initial_embedding(a, b, landmarks, iterations(3));
  REQUIRE(ism::is_usable(start.status));
  const SurfaceMap map(start);
  CHECK(map.mesh(Side::kA).triangles == a.triangles);
  for (int f = 0; f < a.triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      CHECK(map.forward_path({a.triangles(f, k), a.triangles(f, (k + 1) % 3)}).size() == 1);
}

TEST_CASE("nearly all vertices of closed surfaces can be exact landmarks") {
  const ism::TriangleMesh a = shapes::blob(2, 0.2, 1), b = shapes::blob(2, 0.2, 2);
  Options options = iterations(1);
  options.exact_landmarks = true;
  for (int left_out : {0, 1, 30}) {
    std::vector<Landmark> landmarks;
    for (int v = left_out; v < a.vertices.rows(); ++v) landmarks.push_back({v, v});
    const ism::Embedding start = ism::initial_embedding(a, b, landmarks, options);
    CAPTURE(left_out);
    CAPTURE(start.message);
    REQUIRE(start.status == Status::kDone);
    CHECK(start.landmark_distance < 1e-12);
    CHECK(ism::verify_map(SurfaceMap(start)).status == Status::kDone);
  }
}

TEST_CASE("maps of closed surfaces are closed from the first one on") {
  const TriangleMesh a = shapes::blob(2, 0.3, 1), b = shapes::blob(2, 0.2, 2);
  for (const TriangleMesh& to : {a, b}) {
    ism::Solver solver(a, to, landmarks_of(a, to, 5), on_one_thread());
    while (solver.result().status == Status::kNoMapYet) solver.step();
    for (int i = 0; i < 3; ++i, solver.step()) {
      const SurfaceMap map(solver.result());
      REQUIRE(map.status() == Status::kDone);
      CHECK(map.is_closed());
      CHECK(ism::verify_map(map).message == "");
    }
  }
  const SurfaceMap start(ism::initial_embedding(a, b, landmarks_of(a, b, 5), on_one_thread()));
  REQUIRE(start.status() == Status::kDone);
  CHECK(start.is_closed());
  CHECK(ism::verify_map(start).status == Status::kDone);
}

TEST_CASE("pins of closed surfaces stay where the start puts them, on coarse surfaces, too") {
  for (int level : {2, 3}) {
    CAPTURE(level);
    const auto [a, b, landmarks] = blobs(level, 5);
    Options options = iterations(10);
    for (int i = 0; i < 3; ++i)
      options.pins_a.push_back(landmarks[static_cast<std::size_t>(i)].a.vertex);
    const int in_between = static_cast<int>(b.vertices.rows()) / 2;
    options.pins_b = {in_between};
    const Result r = ism::compute_map(a, b, landmarks, options);
    check_closed(a, b, r);
    const SurfaceMap map(r), start(r.start);
    for (int v : options.pins_a) {
      const ism::SurfacePoint p = map.forward_vertex(v), q = start.forward_vertex(v);
      CHECK((map.position_on_b(p) - start.position_on_b(q)).norm() < 1e-9);
    }
    const ism::SurfacePoint p = map.backward_vertex(in_between);
    const ism::SurfacePoint q = start.backward_vertex(in_between);
    CHECK((map.position_on_a(p) - start.position_on_a(q)).norm() < 1e-9);
  }
}

TEST_CASE("closed surfaces pass through coarse levels, too") {
  const auto [a, b, landmarks] = blobs(3, 5);
  Options options = iterations(10);
  options.coarsest = 60;
  const Result r = ism::compute_map(a, b, landmarks, options);
  CHECK_FALSE(r.coarse.empty());
  check_closed(a, b, r);
}

TEST_CASE("any vertices can be pinned; none can be fixed in the plane") {
  const auto [a, b, landmarks] = blobs(1, 6);
  for (int v = 0; v < a.vertices.rows(); ++v) {
    CAPTURE(v);
    Options options = iterations(2);
    options.candidates = false;
    options.pins_a = {v};
    check_closed(a, b, ism::compute_map(a, b, landmarks, options));
  }
  Options options = iterations(2);
  options.fixed_b = {3};
  const Result r = ism::compute_map(a, b, landmarks, options);
  CHECK(r.status == Status::kInvalidPins);
  CHECK(r.message == "of two closed surfaces, no vertex can be fixed in the plane: pin it");
}

TEST_CASE("a surface with defects has the map that it has without") {
  const auto [a, b, landmarks] = blobs(2, 5);
  TriangleMesh worse = a;
  const Eigen::Index n = a.triangles.rows();
  worse.triangles.conservativeResize(n + 2, 3);
  worse.triangles.row(n) = a.triangles.row(5);
  worse.triangles.row(n + 1) << 1, 1, 7;
  worse.triangles.row(9) << a.triangles(9, 0), a.triangles(9, 2), a.triangles(9, 1);
  Options options = iterations(5);
  const Result r = ism::compute_map(a, b, landmarks, options);
  const Result again = ism::compute_map(worse, b, landmarks, options);
  check_closed(a, b, again);
  CHECK(again.start.prepared_a->repairs.size() == 3);
  CHECK(r.f == again.f);
  CHECK(r.g == again.g);
}

TEST_CASE("closed maps are verified in any unit, and a result without its positions is refused") {
  TriangleMesh a = shapes::sphere(1), b = shapes::blob(1, 0.1, 3);
  Options options = on_one_thread();
  options.max_iterations = 5;
  for (double unit : {1e-120, 1e120}) {
    TriangleMesh scaled = a;
    scaled.vertices *= unit;
    const Result r = ism::compute_map(scaled, b, {}, options);
    CHECK(ism::verify_map(SurfaceMap(r)).status == Status::kDone);
  }
  Result r = ism::compute_map(a, b, {}, options);
  REQUIRE(ism::is_usable(r.status));
  Result spoilt = r;
  spoilt.f.resize(0, 2);
  CHECK(SurfaceMap(spoilt).status() == Status::kInvalidPositions);
  spoilt = r;
  for (ism::AddedVertex& p : spoilt.start.added_a) p.corners[0] = 1 << 30;
  CHECK(SurfaceMap(spoilt).status() != Status::kNoMapYet);
}

TEST_CASE("closed surfaces keep their scale, and pillows are as large") {
  const auto [a, b, landmarks] = blobs(2, 5);
  Options options = iterations(5);
  options.keep_scale = true;
  const auto mapped = [&](double unit) {
    TriangleMesh large_a = a, large_b = b;
    large_a.vertices *= unit;
    large_b.vertices *= unit;
    const Result r = ism::compute_map(large_a, large_b, landmarks, options);
    check_closed(large_a, large_b, r);
    return r;
  };
  const Result one = mapped(1), large = mapped(0x1p9), small = mapped(0x1p-11);
  CHECK(large.start.scale_a == 1);
  CHECK(large.final_state().mean_distortion ==
        doctest::Approx(one.final_state().mean_distortion).epsilon(0.05));
  CHECK(small.final_state().mean_distortion ==
        doctest::Approx(one.final_state().mean_distortion).epsilon(0.05));
  CHECK(SurfaceMap(large).period() == 0x1p9 * SurfaceMap(one).period());
}

TEST_CASE("a surface that is closed is valid; one side held needs a boundary") {
  CHECK(ism::validate(shapes::sphere(1)).empty());
  Options options;
  options.boundary = ism::Boundary::kSlide;
  const Result r = ism::compute_map(shapes::sphere(1), shapes::sphere(1), {}, options);
  CHECK(r.status == Status::kInvalidOptions);
  CHECK(r.message ==
        "boundaries cannot be held on closed surfaces or those with openings, and A is closed");
}

TEST_CASE(
    "landmarks in any triangle of a closed surface are where they belong, also beyond the cut") {
  const TriangleMesh octahedron = shapes::sphere(0), other = shapes::blob(1, 0.1, 3);
  const auto in = [](int f) { return ism::SurfacePoint{f, {0.3, 0.3, 0.4}}; };
  Options options = on_one_thread();
  options.exact_landmarks = true;
  options.max_iterations = 3;
  int together = 0;
  for (int first = 0; first < 8; ++first) {
    CAPTURE(first);
    const int f = first, g = (first + 3) % 8, h = (first + 6) % 8;
    const shapes::Disk disk = shapes::grid(4, 4);
    const Result onto_disk = ism::compute_map(
        octahedron, disk.mesh, {{in(f), in(3)}, {in(g), in(12)}, {in(h), in(25)}}, options);
    CAPTURE(onto_disk.message);
    CHECK((ism::is_usable(onto_disk.status) || !onto_disk.message.empty()));
    const Result result = ism::compute_map(
        octahedron, other, {{in(f), in(4 * f)}, {in(g), in(4 * g)}, {in(h), in(4 * h)}}, options);
    CAPTURE(result.message);
    REQUIRE(ism::is_usable(result.status));
    CHECK(ism::verify_map(SurfaceMap(result)).status == Status::kDone);
    together += result.start.landmark_distance < 1e-12;
  }
  CHECK(together == 8);
}

}  // namespace closed_tests

#endif  // ISM_TESTS_PART_CLOSED_HPP

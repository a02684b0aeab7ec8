// Held boundaries, fixed vertices, exact landmarks that need more vertices, and the splitting of
// edges that these are built on.

#ifndef ISM_TESTS_PART_BOUNDARY_HPP
#define ISM_TESTS_PART_BOUNDARY_HPP

#include "dense.hpp"
#include "ism.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace boundary_tests {
namespace {

using namespace ism::detail;
using Eigen::Vector2d;
using Eigen::Vector3d;
using ism::AddedVertex;
using ism::Boundary;
using ism::Landmark;
using ism::Options;
using ism::Points2;
using ism::Result;
using ism::Status;
using ism::SurfaceMap;
using ism::TriangleMesh;
using runs::given_planes;
using runs::on_one_thread;
using shapes::Disk;
using shapes::half_edges;
using shapes::Ids;
using shapes::of_a;
using shapes::of_b;
using shapes::Rng;

bool same(const HalfEdgeMesh& m, const HalfEdgeMesh& n) {
  const auto equal = [](const Array<int>& a, const Array<int>& b) {
    return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin());
  };
  return m.n_vertices == n.n_vertices && m.n_faces == n.n_faces && equal(m.tail, n.tail) &&
         equal(m.twin, n.twin) && equal(m.boundary, n.boundary) && equal(m.loop, n.loop);
}

/// Every edge once, by its ends.
std::vector<AddedVertex> edges(const HalfEdgeMesh& m) {
  std::vector<AddedVertex> all;
  for (int h = 0; h < m.tail.size(); ++h)
    if (m.twin[h] < h) all.push_back({m.tail[h], m.tip(h)});
  return all;
}

Options held(Boundary boundary, int iterations = 400) {
  Options options = on_one_thread();
  options.boundary = boundary;
  options.max_iterations = iterations;
  return options;
}

/// The vertex of a grid at a place.
int at(const Disk& grid, int i, int j) {
  for (int v = 0; v < grid.plane.rows(); ++v)
    if (grid.plane(v, 0) == i && grid.plane(v, 1) == j) return v;
  return -1;
}

bool is_valid(const Result& r) {
  return ism::is_usable(r.status) && is_injective(half_edges(*r.start.a), r.f) &&
         is_injective(half_edges(*r.start.b), r.g);
}

/// The largest and smallest coordinate of x that boundary vertices have, over the four sides.
bool boundary_is_a_square(const TriangleMesh& mesh, const Points2& x) {
  const HalfEdgeMesh m = half_edges(mesh);
  const double half = x.cwiseAbs().maxCoeff();
  std::array<int, 4> corners{};
  for (int h : m.boundary) {
    const Vec2 p = row2(x, m.tail[h]);
    if (std::abs(p.x) != half && std::abs(p.y) != half) return false;
    if (std::abs(p.x) == half && std::abs(p.y) == half)
      ++corners[(p.x > 0 ? 1u : 0u) + (p.y > 0 ? 2u : 0u)];
  }
  return corners == std::array<int, 4>{1, 1, 1, 1};
}

/// One of each kind, as shapes::all_disks(), with fewer triangles.
std::vector<Disk> small_disks() {
  Rng rng(7);
  std::vector<Disk> all;
  const auto add = [&](const char* name, const Disk& disk) {
    all.push_back(disk);
    all.back().name = name;
  };
  add("triangle", shapes::single_triangle());
  add("strip", shapes::strip(6));
  add("grid", shapes::grid(4, 3));
  add("comb", shapes::comb(3, 2));
  add("fan", shapes::fan(7));
  add("limbs", shapes::limbs(4, 3, 0.05));
  add("cap", shapes::spherical_cap(3, 8, 1.2));
  add("perturbed grid", shapes::perturbed_grid(4, 3, 0.2, rng));
  add("random disk", shapes::random_disk(4, 3, rng));
  add("bent random disk", shapes::random_disk(3, 4, rng));
  shapes::bend(all.back(), 0.4);
  return all;
}

/// A grid with a bump on one side, which makes one half of that side longer.
Disk grid_with_bump(int n) {
  Disk d = shapes::grid(n, n);
  for (int v = 0; v < d.mesh.vertices.rows(); ++v) {
    const double x = d.plane(v, 0) - 0.25 * n, y = d.plane(v, 1);
    d.mesh.vertices(v, 2) = 0.3 * n * std::exp(-16 / (1.0 * n * n) * (x * x + y * y));
  }
  return d;
}

}  // namespace

TEST_CASE("a mesh with edges halved is the mesh built from its triangles") {
  Rng rng(1);
  for (const Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    Surface s = build_surface(disk.mesh, true);
    const double area = s.total_area;
    for (int round = 0; round < 3; ++round) {
      std::vector<AddedVertex> halved;
      for (const AddedVertex& edge : edges(s.mesh))
        if (rng.below(2) == 0) halved.push_back(edge);
      const int n = s.mesh.n_vertices;
      add_vertices(halved, s);
      CHECK(s.mesh.n_vertices == n + static_cast<int>(halved.size()));
      const TriangleMesh mesh = *with_added_vertices(shared(disk.mesh), s);
      const HalfEdgeMesh built = half_edges(mesh);
      CHECK(same(s.mesh, built));
      CHECK(ism::validate(mesh).empty());
      for (int v = 0; v < s.mesh.n_vertices; ++v) {
        CHECK(s.mesh.tail[s.mesh.out[v]] == v);
        CHECK(s.mesh.on_boundary(v) == built.on_boundary(v));
      }
    }
    CHECK(s.total_area == doctest::Approx(area).epsilon(1e-13));
    const TriangleMesh mesh = *with_added_vertices(shared(disk.mesh), s);
    CHECK(mesh.vertices.topRows(disk.mesh.vertices.rows()) == disk.mesh.vertices);
    for (std::size_t i = 0; i < s.added.size(); ++i) {
      const int v = static_cast<int>(disk.mesh.vertices.rows()) + static_cast<int>(i);
      CHECK(s.added[i].corners[0] < v);
      CHECK(s.added[i].corners[1] < v);
      const Vector3d middle = 0.5 * (mesh.vertices.row(s.added[i].corners[0]) +
                                     mesh.vertices.row(s.added[i].corners[1]))
                                        .transpose();
      CHECK((middle - mesh.vertices.row(v).transpose()).norm() < 1e-15 * (1 + middle.norm()));
    }
  }
}

TEST_CASE("held boundaries leave squares, and what slides stays on its side") {
  const Disk a = shapes::grid(3, 2), b = shapes::grid(2, 4);
  const JointSurface s = shapes::joined(a.mesh, b.mesh);
  const HalfEdgeMesh& m = s.mesh;
  const Points2 x = stacked(a.plane, b.plane);
  FixedCoordinates is_fixed(m.n_vertices);
  fix_boundaries(m, x, Boundary::kFree, is_fixed);
  CHECK_FALSE(is_fixed.any());
  fix_boundaries(m, x, Boundary::kSlide, is_fixed);
  CHECK(is_fixed.any());
  const FixedCoordinates& flags = is_fixed;
  for (int v = 0; v < m.n_vertices; ++v) {
    const Vec2 p = row2(x, v), size = v < s.n_a ? Vec2{3, 2} : Vec2{2, 4};
    CHECK(flags(v, 0) == (p.x == 0 || p.x == size.x));
    CHECK(flags(v, 1) == (p.y == 0 || p.y == size.y));
  }
  fix_boundaries(m, x, Boundary::kFixed, is_fixed);
  for (int v = 0; v < m.n_vertices; ++v)
    for (int c = 0; c < 2; ++c) CHECK(flags(v, c) == m.on_boundary(v));
}

TEST_CASE("places on an outline: corners are exact, sides straight, all counter-clockwise") {
  Outline outline;
  outline.half_side = 0.7;
  for (int i = 0; i < 400; ++i) outline.u.push_back(i / 100.0);
  double turned = 0;
  for (int i = 0; i < 400; ++i) {
    const Vec2 p = outline.point(i), q = outline.point((i + 1) % 400);
    CHECK((std::max)(std::abs(p.x), std::abs(p.y)) == 0.7);
    CHECK(cross(p, q) > 0);
    turned += std::atan2(cross(p, q), dot(p, q));
  }
  CHECK(turned == doctest::Approx(2 * kPi));
  CHECK(outline.point(0) == Vec2{-0.7, -0.7});
  CHECK(outline.point(100) == Vec2{0.7, -0.7});
  CHECK(outline.point(200) == Vec2{0.7, 0.7});
  CHECK(outline.point(300) == Vec2{-0.7, 0.7});
}

TEST_CASE("arcs between matches correspond in proportion") {
  const Array<Match> one(1, {0.2, 0.9});
  CHECK(matching_arc(one, 0.2) == 0.9);
  CHECK(matching_arc(one, 0.5) == doctest::Approx(0.2));
  CHECK(matching_arc(one, 0.1) == doctest::Approx(0.8));
  Array<Match> three;
  for (const Match& m : std::vector<Match>{{0.1, 0.6}, {0.3, 0.7}, {0.9, 0.1}}) three.push_back(m);
  CHECK(matching_arc(three, 0.1) == 0.6);
  CHECK(matching_arc(three, 0.3) == 0.7);
  CHECK(matching_arc(three, 0.9) == 0.1);
  CHECK(matching_arc(three, 0.2) == doctest::Approx(0.65));
  CHECK(matching_arc(three, 0.6) == doctest::Approx(0.9));
  CHECK(matching_arc(three, 0.0) == doctest::Approx(0.35));
}

TEST_CASE("every disk is mapped to itself and to a grid with its boundary along the square") {
  const TriangleMesh grid = shapes::grid(3, 3).mesh;
  for (const Disk& disk : small_disks())
    for (const Boundary boundary : {Boundary::kFixed, Boundary::kSlide})
      for (const TriangleMesh* other : {&disk.mesh, &grid}) {
        CAPTURE(disk.name);
        CAPTURE(static_cast<int>(boundary));
        const Result r = ism::compute_map(disk.mesh, *other, {}, held(boundary, 4));
        CAPTURE(r.message);
        REQUIRE(is_valid(r));
        CHECK(boundary_is_a_square(*r.start.a, r.f));
        CHECK(boundary_is_a_square(*r.start.b, r.g));
        CHECK(r.final_state().coverage_a == doctest::Approx(1).epsilon(1e-12));
        CHECK(r.final_state().coverage_b == doctest::Approx(1).epsilon(1e-12));
        CHECK(r.final_state().energy <= r.initial.energy);
        if (other == &disk.mesh)
          CHECK(r.final_state().mean_distortion == doctest::Approx(2).epsilon(1e-9));
        const SurfaceMap map(r);
        REQUIRE(map.status() == Status::kDone);
        const HalfEdgeMesh m = half_edges(*r.start.a);
        for (int v = 0; v < disk.mesh.vertices.rows(); ++v)
          if (!m.on_boundary(v)) CHECK(map.forward_vertex(v).exists());
      }
}

TEST_CASE("long outlines are laid along a square") {
  for (const Disk& disk : {shapes::comb(9, 6), shapes::limbs(5, 16, 0.05), shapes::strip(50),
                           shapes::slit_ring(14, 1e-3, 0.2)}) {
    ism::Options options = held(Boundary::kFixed, 0);
    options.candidates = false;  // starts end within a tolerance of the identity
    const Result r = ism::compute_map(disk.mesh, disk.mesh, {}, options);
    CAPTURE(disk.name);
    CAPTURE(r.message);
    REQUIRE(is_valid(r));
    CHECK(boundary_is_a_square(*r.start.a, r.f));
    CHECK(r.final_state().mean_distortion == doctest::Approx(2).epsilon(1e-9));
  }
}

TEST_CASE("along held boundaries everything is covered, the edges of boundaries, too") {
  const Disk a = shapes::grid(6, 6), b = shapes::spherical_cap(4, 17, 1.3);
  const Result r = ism::compute_map(a.mesh, b.mesh, {}, held(Boundary::kSlide, 10));
  REQUIRE(is_valid(r));
  const SurfaceMap map(r);
  for (int v = 0; v < a.mesh.vertices.rows(); ++v) CHECK(map.forward_vertex(v).exists());
  for (int v = 0; v < b.mesh.vertices.rows(); ++v) CHECK(map.backward_vertex(v).exists());
  const HalfEdgeMesh m = half_edges(a.mesh);
  for (int h = 0; h < m.tail.size(); ++h) {
    const auto image = map.forward_path({m.tail[h], m.tip(h)});
    REQUIRE(image.size() == 1);
    const Vector3d from = map.position_on_b(map.forward_vertex(m.tail[h]));
    const Vector3d to = map.position_on_b(map.forward_vertex(m.tip(h)));
    CHECK((map.position_on_b(image[0].front()) - from).norm() < 1e-9);
    CHECK((map.position_on_b(image[0].back()) - to).norm() < 1e-9);
  }
}

TEST_CASE("fixed boundaries do not move, sliding ones only along their sides") {
  constexpr int n = 8;
  const Disk a = shapes::grid(n, n), b = grid_with_bump(n);
  const HalfEdgeMesh m = half_edges(a.mesh);
  std::vector<Landmark> corners;
  for (int i : {0, n})
    for (int j : {0, n}) corners.push_back({at(a, i, j), at(b, i, j)});
  double end[2];
  for (const Boundary boundary : {Boundary::kFixed, Boundary::kSlide}) {
    const Result r = ism::compute_map(a.mesh, b.mesh, corners, held(boundary));
    REQUIRE(is_valid(r));
    int moved = 0;
    for (int h : m.boundary) {
      const Vec2 before = row2(r.start.f, m.tail[h]), after = row2(r.f, m.tail[h]);
      if (before == after) continue;
      ++moved;
      CHECK((before.x == after.x || before.y == after.y));
      CHECK(std::abs(before.x) != std::abs(before.y));  // no corner
    }
    CHECK((moved > 0) == (boundary == Boundary::kSlide));
    end[boundary == Boundary::kSlide] = r.final_state().mean_distortion;
  }
  CHECK(end[1] - 2 < 0.9 * (end[0] - 2));
}

TEST_CASE("the gradient and Hessian of what may slide agree with differences") {
  Rng rng(5);
  Disk a = shapes::perturbed_grid(4, 3, 0.2, rng), b = shapes::perturbed_grid(5, 4, 0.2, rng);
  a.plane.col(0) /= 4, a.plane.col(1) /= 3;
  b.plane.col(0) /= 5, b.plane.col(1) /= 4;
  for (Disk* d : {&a, &b}) {  // vertices of the boundary back onto the unit square
    const HalfEdgeMesh m = half_edges(d->mesh);
    const Points2 even = d == &a ? shapes::grid(4, 3).plane : shapes::grid(5, 4).plane;
    const Vector2d size = d == &a ? Vector2d(4, 3) : Vector2d(5, 4);
    for (int h : m.boundary)
      for (int c = 0; c < 2; ++c) {
        const int v = m.tail[h];
        if (even(v, c) == 0 || even(v, c) == size[c]) d->plane(v, c) = even(v, c) / size[c];
      }
    shapes::bend(*d, 0.3);
    REQUIRE(is_injective(m, d->plane));
  }
  const JointSurface s = shapes::joined(a.mesh, b.mesh, false);
  const ism::DistortionMeasure measure = ism::symmetric_dirichlet();
  const Weights weights = {2.2, 1e-2, -1e300, &measure};  // Hessians are not projected
  const Points2 start = stacked(a.plane, b.plane);
  FixedCoordinates is_fixed(s.mesh.n_vertices);
  fix_boundaries(s.mesh, start, Boundary::kSlide, is_fixed);
  const auto fixed = [&](int i) { return is_fixed.flag[i] != 0; };
  const Executor executor{Options()};
  ModelBuilder models(s, weights, executor);
  const auto system_at = [&](const Eigen::VectorXd& x, Iterate& at) {
    at.x = Eigen::Map<const Points2>(x.data(), s.mesh.n_vertices, 2);
    evaluate(s, weights, at);
    models.differentiate_elements(at);
    LinearSystem system = blend(Array<QuadraticModel>(1, models.assemble()), 1, {}, {}, executor);
    reduce({}, is_fixed, executor, system);
    return system;
  };
  const Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXd>(start.data(), start.size());
  Iterate at, plus, minus;
  const LinearSystem system = system_at(x, at);
  CHECK(at.area_a == doctest::Approx(1).epsilon(1e-12));
  CHECK(at.area_b == doctest::Approx(1).epsilon(1e-12));
  const Eigen::MatrixXd H = dense(system.H);
  const Eigen::VectorXd gradient = dense(system.gradient);
  constexpr double kStep = 1e-7;
  int slides = 0;
  for (int i = 0; i < x.size(); ++i) {
    if (fixed(i)) {
      CHECK(gradient[i] == 0);
      CHECK(H.col(i) == Eigen::VectorXd::Unit(x.size(), i));
      continue;
    }
    slides += fixed(i ^ 1);
    const Eigen::VectorXd dx = kStep * Eigen::VectorXd::Unit(x.size(), i);
    const LinearSystem after = system_at(x + dx, plus), before = system_at(x - dx, minus);
    CHECK((plus.energy - minus.energy) / (2 * kStep) ==
          doctest::Approx(gradient[i]).epsilon(1e-5).scale(1));
    Eigen::VectorXd column = (dense(after.gradient) - dense(before.gradient)) / (2 * kStep);
    for (int j = 0; j < x.size(); ++j)
      if (fixed(j)) column[j] = 0;
    CHECK((column - H.col(i)).norm() < 1e-4 * H.norm());
  }
  CHECK(slides == 2 * (3 + 2 + 4 + 3));
}

TEST_CASE("landmarks on the boundaries correspond exactly where both are fixed") {
  const Disk a = shapes::grid(9, 9), b = shapes::spherical_cap(6, 24, 1.3);
  const HalfEdgeMesh m = half_edges(a.mesh), n = half_edges(b.mesh);
  std::vector<Landmark> landmarks;
  for (int k = 0; k < 7; ++k)
    landmarks.push_back({m.tail[m.boundary[5 * k]], n.tail[n.boundary[(3 * k + 8) % 24]]});
  const Result r = ism::compute_map(a.mesh, b.mesh, landmarks, held(Boundary::kFixed, 3));
  REQUIRE(is_valid(r));
  for (const Landmark& l : landmarks) CHECK(r.f.row(l.a.vertex) == r.g.row(l.b.vertex));
}

TEST_CASE("landmarks on boundaries that need more vertices for their corners") {
  const Disk triangle = shapes::single_triangle();
  for (const Disk& other : {shapes::fan(7), shapes::grid(4, 3), shapes::limbs(3, 3, 0.1)})
    for (int count = 1; count <= 3; ++count)
      for (int shift = 0; shift < 3; ++shift)
        for (const Boundary boundary : {Boundary::kFixed, Boundary::kSlide}) {
          const HalfEdgeMesh m = half_edges(triangle.mesh), n = half_edges(other.mesh);
          std::vector<Landmark> landmarks;
          for (int k = 0; k < count; ++k)
            landmarks.push_back(
                {m.tail[m.boundary[k]], n.tail[n.boundary[(2 * k + shift) % n.boundary.size()]]});
          const Result r =
              ism::compute_map(triangle.mesh, other.mesh, landmarks, held(boundary, 2));
          CAPTURE(r.message);
          REQUIRE(is_valid(r));
          CHECK(boundary_is_a_square(*r.start.a, r.f));
          CHECK(boundary_is_a_square(*r.start.b, r.g));
          if (boundary == Boundary::kFixed)
            for (const Landmark& l : landmarks) CHECK(r.f.row(l.a.vertex) == r.g.row(l.b.vertex));
        }
}

TEST_CASE("a landmark of A that is held holds that of B") {
  const Disk a = shapes::grid(10, 10);
  Disk wide = shapes::grid(12, 10), moved = shapes::grid(10, 10);
  for (Disk* b : {&wide, &moved})
    b->mesh.vertices.col(2) = 0.05 * b->plane.col(0).array().square().matrix();
  moved.plane.rowwise() += Eigen::RowVector2d(4, -3);
  // A corner of A on the lower side of B; the lower side of A on the left side of B.
  const std::vector<Landmark> on_side = {{at(a, 10, 0), at(wide, 10, 0)}};
  const std::vector<Landmark> on_both = {{at(a, 4, 0), at(shapes::grid(10, 10), 0, 3)}};
  for (const auto& [b, landmarks] : {std::pair(wide, on_side), std::pair(moved, on_both)}) {
    Options options = given_planes(a, b);
    options.boundary = Boundary::kSlide;
    options.exact_landmarks = true;
    options.max_iterations = 30;
    const Result r = ism::compute_map(a.mesh, b.mesh, landmarks, options);
    CAPTURE(r.message);
    REQUIRE(is_valid(r));
    CHECK(r.log.size() > 3);
    CHECK(r.f.row(landmarks[0].a.vertex) == a.plane.row(landmarks[0].a.vertex));
    CHECK(r.g.row(landmarks[0].b.vertex) == a.plane.row(landmarks[0].a.vertex));
  }
}

TEST_CASE("where nothing can move a run converges at once") {
  const TriangleMesh triangle = shapes::single_triangle().mesh;
  for (const Boundary boundary : {Boundary::kFixed, Boundary::kSlide}) {
    const Result r = ism::compute_map(triangle, triangle, {}, held(boundary));
    CHECK(r.status == Status::kConverged);
    CHECK(r.log.empty());
  }
}

TEST_CASE("an embedding that is cancelled or fails has no positions") {
  const Disk a = shapes::grid(6, 6), b = shapes::grid(6, 5);
  Options options = held(Boundary::kSlide);
  options.exact_landmarks = true;
  int reports = 0, last = 1 << 30;
  options.progress = [&](const ism::Progress&) { return ++reports < last; };
  REQUIRE(ism::initial_embedding(a.mesh, b.mesh, {{20, 20}}, options).status == Status::kDone);
  const int all = reports;
  REQUIRE(all > 10);
  for (last = 1; last <= all; last += 1 + last / 20) {
    reports = 0;
    const ism::Embedding e = ism::initial_embedding(a.mesh, b.mesh, {{20, 20}}, options);
    CHECK(e.status == Status::kNoMapYet);
    CHECK(e.f.rows() == 0);
    CHECK(e.g.rows() == 0);
  }
}

TEST_CASE("exact landmarks, inside and on the boundary, with boundaries that slide") {
  const Disk a = shapes::grid(9, 9), b = shapes::spherical_cap(6, 24, 1.3);
  const HalfEdgeMesh m = half_edges(a.mesh), n = half_edges(b.mesh);
  std::vector<Landmark> landmarks = {{44, 0}};
  for (int k = 0; k < 6; ++k)
    landmarks.push_back({m.tail[m.boundary[6 * k + 1]], n.tail[n.boundary[(4 * k + 9) % 24]]});
  Options options = held(Boundary::kSlide, 40);
  options.exact_landmarks = true;
  const Result r = ism::compute_map(a.mesh, b.mesh, landmarks, options);
  CAPTURE(r.message);
  REQUIRE(is_valid(r));
  CHECK(r.start.landmark_distance == 0);
  for (const Landmark& l : landmarks) CHECK(r.f.row(l.a.vertex) == r.g.row(l.b.vertex));
  CHECK(boundary_is_a_square(*r.start.a, r.f));
  CHECK(r.final_state().coverage_a == doctest::Approx(1).epsilon(1e-12));
  CHECK(r.final_state().energy < r.initial.energy);
}

TEST_CASE("landmarks that turn triangles over are joined with more vertices") {
  for (const Boundary boundary : {Boundary::kFree, Boundary::kSlide}) {
    const TriangleMesh a = shapes::grid(5, 5).mesh;
    Options options = held(boundary, 20);
    options.exact_landmarks = true;
    const int t = 17;  // two of its corners are exchanged
    const int u = a.triangles(t, 0), v = a.triangles(t, 1), w = a.triangles(t, 2);
    const std::vector<Landmark> landmarks = {{u, u}, {v, w}, {w, v}};
    const Result r = ism::compute_map(a, a, landmarks, options);
    CAPTURE(r.message);
    REQUIRE(is_valid(r));
    for (const Landmark& l : landmarks) CHECK(r.f.row(l.a.vertex) == r.g.row(l.b.vertex));
    CHECK_FALSE(r.start.added_a.empty());
    CHECK(r.start.added_a.size() < 40);
    CHECK(ism::validate(*r.start.a).empty());
    CHECK(ism::validate(*r.start.b).empty());
    CHECK(r.start.a->vertices.topRows(a.vertices.rows()) == a.vertices);
    CHECK(build_surface(*r.start.a, true).total_area == doctest::Approx(25).epsilon(1e-13));
  }
}

TEST_CASE("every second vertex exchanged with its neighbour, exactly") {
  constexpr int n = 8;
  const Disk grid = shapes::grid(n, n);
  const TriangleMesh& a = grid.mesh;
  std::vector<Landmark> landmarks;
  for (int j = 1; j < n; ++j)
    for (int i = 1; i + 1 < n; i += 2) {
      const int u = at(grid, i, j), v = at(grid, i + 1, j);
      landmarks.push_back({u, v});
      landmarks.push_back({v, u});
    }
  Options options = held(Boundary::kSlide, 3);
  options.exact_landmarks = true;
  const Result r = ism::compute_map(a, a, landmarks, options);
  CAPTURE(r.message);
  REQUIRE(is_valid(r));
  for (const Landmark& l : landmarks) CHECK(r.f.row(l.a.vertex) == r.g.row(l.b.vertex));
}

TEST_CASE("landmarks that cannot be joined end with their ids") {
  const TriangleMesh a = shapes::grid(5, 5).mesh;
  SurfacePair pair = {build_surface(a, false), build_surface(a, false)};
  ism::Embedding embedding;
  const RunOptions fixed(held(Boundary::kFixed));
  const Array<PlacedLandmark> none;
  const Executor executor(fixed);
  const auto embed = [&] {
    Embedder embedder(pair, none, none, nullptr, fixed, executor);
    while (embedder.step()) {
    }
    embedding = embedder.result();
  };
  embed();
  REQUIRE(embedding.status == Status::kDone);
  const HalfEdgeMesh& m = pair.a.mesh;
  const int u = m.tail[m.boundary[1]], v = m.tail[m.boundary[2]];  // two places that are fixed
  Array<VertexPair> landmarks;
  landmarks.push_back({u, v, {u, v}});
  RunOptions options = fixed;
  options.exact_landmarks = true;
  LandmarkJoiner joiner(pair, landmarks, options, executor);
  while (joiner.step(embedding)) {
  }
  CHECK(embedding.status == Status::kInvalidLandmarks);
  CHECK(embedding.message ==
        "these landmarks could not be joined: " + std::to_string(u) + "-" + std::to_string(v));
  CHECK(embedding.ids == Ids{of_a(u), of_b(v)});
}

TEST_CASE("boundary landmarks in contradictory order or with one inner vertex are refused") {
  const Disk grid = shapes::grid(4, 4);
  const TriangleMesh& a = grid.mesh;
  const int o = at(grid, 0, 0), p = at(grid, 4, 0), q = at(grid, 0, 4), inner = at(grid, 2, 2);
  const std::vector<Landmark> mirrored = {{o, o}, {p, q}, {q, p}};
  const auto check = [&](const std::vector<Landmark>& landmarks, const Options& options,
                         const std::string& what, const Ids& ids) {
    const Result r = ism::compute_map(a, a, landmarks, options);
    CAPTURE(r.message);
    CHECK(r.status == Status::kInvalidLandmarks);
    CHECK(r.message.find(what) != std::string::npos);
    CHECK(r.ids == ids);
  };
  Options exact = on_one_thread();
  exact.exact_landmarks = true;
  const Ids crossed = {of_a(o), of_b(o), of_a(p), of_b(q), of_a(q), of_b(p)};
  check(mirrored, exact, "in different order on A and B: ", crossed);
  check(mirrored, held(Boundary::kSlide), "different order", crossed);
  exact.boundary = Boundary::kFixed;
  check({{o, inner}}, exact, "one end is on a boundary, which is held", {of_a(o), of_b(inner)});
  exact.boundary = Boundary::kFree;
  CHECK(ism::is_usable(ism::compute_map(a, a, {{o, inner}}, exact).status));
}

TEST_CASE("landmarks on the boundary with no room between them are refused") {
  constexpr int kSteps = 7;  // along two sides of a corner, which is cut off closely
  ism::TriangleMesh a;
  a.vertices.resize(2 * kSteps, 3);
  a.triangles.resize(2 * (kSteps - 1), 3);
  for (int k = 0; k < kSteps; ++k) {
    const double r = 1e-17 * std::pow(1000, k);
    a.vertices.row(2 * k) << 0, r, 0;
    a.vertices.row(2 * k + 1) << r, 0, 0;
    if (k == 0) continue;
    a.triangles.row(2 * k - 2) << 2 * k - 2, 2 * k - 1, 2 * k + 1;
    a.triangles.row(2 * k - 1) << 2 * k - 2, 2 * k + 1, 2 * k;
  }
  REQUIRE(ism::validate(a).empty());
  const Disk b = shapes::grid(4, 4);
  const Result r = ism::compute_map(a, b.mesh, {{0, 0}, {1, 24}}, held(Boundary::kFixed, 3));
  CHECK(r.status == ism::Status::kInvalidLandmarks);
  CHECK(r.message.find("are too close to each other: ") != std::string::npos);
  CHECK(r.ids.size() == 4);
}

TEST_CASE("fixed vertices keep their positions to the last bit") {
  Rng rng(4);
  Disk a = shapes::random_disk(5, 5, rng), b = shapes::random_disk(6, 6, rng);
  shapes::bend(a, 0.5);
  Options options = given_planes(a, b);
  options.fixed_a = {0, 7, 12};
  options.fixed_b = {3, 20};
  const Result r = ism::compute_map(a.mesh, b.mesh, {}, options);
  REQUIRE(is_valid(r));
  REQUIRE(r.log.size() > 5);
  for (int v : options.fixed_a) CHECK(r.f.row(v) == a.plane.row(v));
  for (int v : options.fixed_b) CHECK(r.g.row(v) == b.plane.row(v));
  CHECK(r.f.row(1) != a.plane.row(1));
}

TEST_CASE("given boundaries of any shape can be fixed") {
  Disk a = shapes::spherical_cap(5, 15, 1.2), b = shapes::spherical_cap(6, 15, 0.9);
  for (Disk* d : {&a, &b}) {  // the same star
    const HalfEdgeMesh m = half_edges(d->mesh);
    for (int v = 0; v < d->plane.rows(); ++v) {
      const Vec2 p = row2(d->plane, v);
      d->plane.row(v) *= 1 + 0.2 * std::cos(5 * std::atan2(p.y, p.x));
    }
    const double radius = d->plane.row(m.tail[m.boundary[0]]).norm();
    d->plane /= radius;
    for (int v = 0; v < d->plane.rows() && d == &b; ++v)  // the interior is far from the best
      if (!m.on_boundary(v)) d->plane.row(v) *= std::sqrt(d->plane.row(v).norm());
    REQUIRE(is_injective(m, d->plane));
  }
  Options options = given_planes(a, b);
  options.boundary = Boundary::kFixed;
  const Result r = ism::compute_map(a.mesh, b.mesh, {}, options);
  REQUIRE(is_valid(r));
  CHECK(r.final_state().mean_distortion < r.initial.mean_distortion - 0.1);
  for (int h : half_edges(a.mesh).boundary)
    CHECK(r.f.row(half_edges(a.mesh).tail[h]) == a.plane.row(half_edges(a.mesh).tail[h]));
  for (int h : half_edges(b.mesh).boundary)
    CHECK(r.g.row(half_edges(b.mesh).tail[h]) == b.plane.row(half_edges(b.mesh).tail[h]));
}

TEST_CASE("contradictory constraints are refused with the vertex") {
  const TriangleMesh a = shapes::grid(4, 4).mesh;
  const auto check = [&](const Options& options, const std::string& message,
                         const ism::ElementId& id) {
    const Result r = ism::compute_map(a, a, {{6, 6}}, options);
    CHECK(r.status == Status::kInvalidPins);
    CHECK(r.message == message);
    CHECK(r.ids == Ids{id});
  };
  Options options;
  options.fixed_a = {25};
  check(options, "vertex 25 of A is to be fixed, but ids are 0 to 24", of_a(25));
  options.fixed_a = {};
  options.fixed_b = {3, 3};
  check(options, "vertex 3 of B is to be fixed, but it is fixed already", of_b(3));
  options.fixed_b = {12};
  options.pins_b = {12};
  check(options, "vertex 12 of B is to be pinned, but it is fixed already", of_b(12));
  options.fixed_b = options.pins_b = {};
  options.fixed_a = {6};
  options.exact_landmarks = true;
  check(options, "vertex 6 of A is to be fixed, but it is in an exact landmark already", of_a(6));
  options.fixed_a = {};
  options.pins_a = {6};
  check(options, "vertex 6 of A is to be pinned, but it is in an exact landmark already", of_a(6));
  options.exact_landmarks = false;
  options.pins_a = {0};
  options.boundary = Boundary::kSlide;
  check(options, "vertex 0 of A is to be pinned, but it is on a boundary that is held already",
        of_a(0));
}

TEST_CASE("held boundaries give the same bits for any number of threads") {
  const Disk a = shapes::grid(9, 9), b = shapes::spherical_cap(6, 24, 1.3);
  Options options = held(Boundary::kSlide, 6);
  options.exact_landmarks = true;
  const std::vector<Landmark> landmarks = {{44, 0}, {34, 70}};
  options.threads = 1;
  const Result one = ism::compute_map(a.mesh, b.mesh, landmarks, options);
  options.threads = 3;
  const Result three = ism::compute_map(a.mesh, b.mesh, landmarks, options);
  REQUIRE(is_valid(one));
  CHECK(one.f == three.f);
  CHECK(one.g == three.g);
}

}  // namespace boundary_tests

#endif  // ISM_TESTS_PART_BOUNDARY_HPP

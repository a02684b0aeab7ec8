// Vertices of thousands of edges, boundaries of a hundred thousand, as many openings and queries:
// what is near-linear in them ends in seconds here, and would not in minutes if it were quadratic.
// tests/bench/sizes.cpp prints seconds and memory.

#ifndef ISM_TESTS_PART_SIZES_HPP
#define ISM_TESTS_PART_SIZES_HPP

#include "ism.hpp"
#include "ism_verify.hpp"
#include "large.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

namespace sizes_tests {
namespace {

using namespace ism::detail;
using ism::Points2;
using runs::on_one_thread;
using shapes::Disk;

ism::Options few_iterations() {
  ism::Options options = on_one_thread();
  options.max_iterations = 2;
  return options;
}

/// A slit ring with one more dimension, and where it lies flat.
Disk ring(int n, double angle) {
  Disk disk = shapes::strip(n);
  disk.mesh = large::slit_ring(n, angle);
  disk.plane = disk.mesh.vertices.leftCols<2>();
  return disk;
}

/// Teeth with n edges in all.
Disk comb(int n) { return shapes::comb(n / 20, 9); }

/// Turned about the origin.
Disk turned(Disk disk, double angle) {
  disk.plane = shapes::moved(disk.plane, shapes::rotation(angle), {0, 0});
  return disk;
}

/// Seconds of the processor since the program began: others may be at work beside.
double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

constexpr double kNearLinear = 6;  // growth; quadratic is 16

/// How many times as long a problem of size 4 n takes as one of size n, at best: of three runs of
/// each, and of more where others disturb them.
template <class Seconds>
double growth(int n, const Seconds& seconds) {
  double least[] = {kInfinity, kInfinity};
  for (int i = 0; i < 6 || (i < 20 && least[1] > kNearLinear * least[0]); ++i)
    least[i % 2] = std::min(least[i % 2], seconds(i % 2 ? 4 * n : n));
  return least[1] / least[0];
}

/// Triangles in another order, in which neighbours lie anywhere.
Disk shuffled(Disk disk) {
  shapes::Rng rng(1);
  for (int f = static_cast<int>(disk.mesh.triangles.rows()) - 1; f > 0; --f)
    disk.mesh.triangles.row(f).swap(disk.mesh.triangles.row(rng.below(f)));
  return disk;
}

void check_run(const ism::Result& result, int least_iterations) {
  CAPTURE(result.message);
  CHECK(ism::is_usable(result.status));
  CHECK(static_cast<int>(result.log.size()) >= least_iterations);
  CHECK(std::isfinite(result.final_state().energy));
  const double least = ism::detail::Tuning().least_coverage;
  CHECK(result.final_state().coverage_a >= least * result.initial.coverage_a);
  CHECK(result.final_state().coverage_b >= least * result.initial.coverage_b);
}

}  // namespace

TEST_CASE("a squared Laplacian has a bounded number of blocks per vertex") {
  const Executor executor{on_one_thread()};
  for (int n : {100, 20000}) {
    const ism::TriangleMesh fan = large::bent_fan(n, 3, 0.2);
    const JointSurface s = shapes::joined(fan, shapes::grid(2, 2).mesh);
    const BlockMatrix Q = squared_laplacian(s, executor);
    CHECK(Q.rows() == s.mesh.n_vertices);
    CHECK(Q.blocks() >= 3 * n);
    CHECK(Q.blocks() <= (n <= kHub ? n * n : 5 * n));
    for (int r = 0; r < Q.rows(); ++r) CHECK_MESSAGE(Q.column[Q.start[r]] == r, "no diagonal");
  }
}

TEST_CASE("a fan of 20,000 triangles is mapped to a grid") {
  Disk grid = shapes::grid(4, 4);
  shapes::bend(grid, 0.3);
  const ism::TriangleMesh fan = large::bent_fan(20000, 3, 0.2);
  CHECK(ism::validate(fan).empty());
  check_run(ism::compute_map(fan, grid.mesh, {{0, 12}, {1, 4}}, few_iterations()), 2);
}

TEST_CASE("where all edges of two hubs of 10,000 triangles cross, the run ends and says why") {
  constexpr int n = 10000;
  const Disk a = shapes::fan(n), b = turned(a, 0.3 * kPi / n);
  ism::Options options = few_iterations();
  options.initial_f = a.plane;
  options.initial_g = b.plane;
  const ism::TriangleMesh mesh_a = large::bent_fan(n, 2, 0.2), mesh_b = large::bent_fan(n, 3, 0.2);
  const auto says_why = [](ism::Status status, const std::string& message) {
    CHECK(status == ism::Status::kMemoryLimit);
    CHECK(message.find("16 million polygons") != std::string::npos);
  };
  const ism::Result result = ism::compute_map(mesh_a, mesh_b, {}, options);
  says_why(result.status, result.message);
  CHECK(result.f.size() + result.g.size() == 0);
  const ism::SurfaceMap map(mesh_a, mesh_b, a.plane, b.plane);
  says_why(map.status(), map.message());
}

TEST_CASE("a closed surface with two hubs of 1,000 triangles is mapped") {
  check_run(ism::compute_map(large::bipyramid(1000, 2, 1.2), shapes::sphere(1),
                             {{1000, 2}, {1001, 5}}, few_iterations()),
            0);
}

TEST_CASE("the overlay of a plate with 40,000 openings and a square is the plate") {
  const Disk plate = large::grate(200, 200);
  Disk square = shapes::grid(300, 300);
  square.plane = (square.plane * 1.6).rowwise() - Eigen::RowVector2d(30, 20);
  const JointSurface s =
      join({build_surface(plate.mesh, false), build_surface(square.mesh, false)});
  const Points2 x = stacked(plate.plane, square.plane);
  Overlay overlay;
  compute_overlay(s, x, overlay);
  double area = 0;
  for (const OverlayPolygon& p : overlay.polygons) {
    const SixPoints corners = six_points(s.mesh, x, p);
    area += polygon_area(polygon_shape(p, corners), corners);
  }
  CHECK(area == doctest::Approx(401 * 401 - 200 * 200));
}

TEST_CASE("openings outside of the overlap are located in near-linear time") {
  bool is_shuffled = false;
  const auto seconds = [&](int n) {  // with n openings and about 16 n triangles
    const int side = static_cast<int>(std::sqrt(n));
    Disk plate = large::grate(side, side);
    Disk patch = shapes::grid(2 * side, 2 * side);  // in one of the openings
    if (is_shuffled) plate = shuffled(plate);
    patch.plane = (0.4 / side * patch.plane).rowwise() + Eigen::RowVector2d(1.1, 1.1);
    const JointSurface s =
        join({build_surface(plate.mesh, false), build_surface(patch.mesh, false)});
    const Points2 x = stacked(plate.plane, patch.plane);
    Overlay overlay;
    const double start = processor_seconds();
    compute_overlay(s, x, overlay);
    CHECK(overlay.polygons.empty());
    return processor_seconds() - start;
  };
  CHECK(growth(2500, seconds) < kNearLinear);
  is_shuffled = true;
  CHECK(growth(2500, seconds) < 2 * kNearLinear);  // what is read lies all over the memory
}

TEST_CASE("arrays grow by a few items in near-linear time") {
  Array<int> appended, resized;
  const int three[] = {1, 2, 3};
  const double start = processor_seconds();
  for (int i = 1; i <= 1000000; ++i) {
    appended.append(three, 3);
    resized.resize(i);
  }
  CHECK(processor_seconds() - start < 1);
  CHECK(appended.size() == 3000000);
  CHECK(resized.size() == 1000000);
}

namespace {

using Defect = void (*)(ism::TriangleMesh&);

void append_vertex(ism::TriangleMesh& m, const Eigen::RowVector3d& p) {
  m.vertices.conservativeResize(m.vertices.rows() + 1, Eigen::NoChange);
  m.vertices.bottomRows(1) = p;
}

/// Every tenth triangle once more, changed.
template <class Change>
void add_changed(ism::TriangleMesh& m, const Change& change) {
  const Eigen::Index n = m.triangles.rows();
  ism::Triangles more(n / 10, 3);
  for (Eigen::Index i = 0; i < more.rows(); ++i) {
    more.row(i) = m.triangles.row(10 * i);
    change(more, i);
  }
  m.triangles.conservativeResize(n + more.rows(), Eigen::NoChange);
  m.triangles.bottomRows(more.rows()) = more;
}

void make_soup(ism::TriangleMesh& m) {
  ism::Points3 x(m.triangles.size(), 3);
  for (int i = 0; i < m.triangles.size(); ++i) {
    x.row(i) = m.vertices.row(m.triangles.data()[i]);
    m.triangles.data()[i] = i;
  }
  m.vertices = x;
}

void repeat(ism::TriangleMesh& m) {
  add_changed(m, [](ism::Triangles&, Eigen::Index) {});
}

void collapse(ism::TriangleMesh& m) {
  add_changed(m, [](ism::Triangles& t, Eigen::Index i) { t(i, 1) = t(i, 0); });
}

/// Flaps, all on other edges.
void add_flaps(ism::TriangleMesh& m) {
  append_vertex(m, {0.1, 0.2, 9});
  const int tip = static_cast<int>(m.vertices.rows()) - 1;
  add_changed(m, [&](ism::Triangles& t, Eigen::Index i) { t(i, 2) = tip; });
}

void turn_half(ism::TriangleMesh& m) {
  for (Eigen::Index f = 0; f < m.triangles.rows(); f += 2)
    std::swap(m.triangles(f, 0), m.triangles(f, 1));
}

/// A second layer with vertices of its own.
void double_up(ism::TriangleMesh& m) {
  const Eigen::Index n = m.vertices.rows(), f = m.triangles.rows();
  ism::TriangleMesh both = {ism::Points3(2 * n, 3), ism::Triangles(2 * f, 3)};
  both.vertices << m.vertices, m.vertices;
  both.triangles << m.triangles, m.triangles.array() + static_cast<int>(n);
  m = both;
}

/// Corners that lie on the long side of a neighbour: each third triangle has no area.
void flatten(ism::TriangleMesh& m) {
  const int n = static_cast<int>(m.vertices.rows());
  const Eigen::Index f = m.triangles.rows() / 20;
  ism::Points3 x(n + f, 3);
  x.topRows(n) = m.vertices;
  ism::Triangles more(2 * f, 3);
  for (Eigen::Index i = 0; i < f; ++i) {
    const Eigen::RowVector3i t = m.triangles.row(20 * i);
    const int middle = n + static_cast<int>(i);
    x.row(middle) = 0.5 * (x.row(t[0]) + x.row(t[1]));
    m.triangles.row(20 * i) << middle, t[1], t[2];
    more.row(2 * i) << t[0], middle, t[2];
    more.row(2 * i + 1) << t[1], middle, t[0];
  }
  m.vertices = x;
  m.triangles.conservativeResize(m.triangles.rows() + more.rows(), Eigen::NoChange);
  m.triangles.bottomRows(more.rows()) = more;
}

}  // namespace

TEST_CASE("meshes with every kind of defect are prepared in near-linear time") {
  const Defect defects[] = {make_soup, repeat, collapse, add_flaps, turn_half, double_up, flatten};
  int kind = 0;
  for (Defect defect : defects) {
    CAPTURE(kind++);
    const double ratio = growth(60, [&](int n) {  // 7,200 triangles, and four times as many
      const int side = n == 60 ? 60 : 120;
      ism::TriangleMesh mesh = shapes::grid(side, side).mesh;
      defect(mesh);
      const double before = processor_seconds();
      const ism::Prepared p = ism::prepare(mesh);
      const double seconds = processor_seconds() - before;
      CHECK(p.problems.empty());
      CHECK(!p.repairs.empty());
      return seconds;
    });
    CHECK(ratio < kNearLinear);
  }
}

TEST_CASE("all entry points take near-linear time") {
  struct Inputs {
    Disk a, b;
    ism::Result result;
  };
  std::vector<Inputs> inputs;
  for (int side : {40, 80}) {
    shapes::Rng rng(7);
    Inputs in = {shapes::perturbed_grid(side, side, 0.2, rng),
                 shapes::perturbed_grid(side, side, 0.2, rng),
                 {}};
    shapes::bend(in.a, 0.3);
    shapes::bend(in.b, -0.3);
    ism::Options options = few_iterations();
    options.initial_f = in.a.plane;
    options.initial_g = in.b.plane;
    options.max_iterations = 0;
    in.result = ism::compute_map(in.a.mesh, in.b.mesh, {}, options);
    inputs.push_back(std::move(in));
  }
  using ism::Element;
  using ism::Side;
  const std::vector<std::function<void(const Inputs&)>> calls = {
      [](const Inputs& in) { ism::validate(in.a.mesh); },
      [](const Inputs& in) { ism::prepare(in.a.mesh); },
      [](const Inputs& in) {
        ism::initial_embedding(in.a.mesh, in.b.mesh, {{0, 0}, {40, 40}});
      },
      [](const Inputs& in) {
        ism::compute_map(in.a.mesh, in.b.mesh, {{0, 0}, {40, 40}}, few_iterations());
      },
      [](const Inputs& in) { ism::verify_map(ism::SurfaceMap(in.result)); },
      [](const Inputs& in) {
        const ism::SurfaceMap map(in.result);
        map.forward_vertices();
        map.backward_vertices();
        ism::summarize(map.distortion());
        ism::remesh(map, Side::kA);
      },
      [](const Inputs& in) {
        const ism::MetaMesh meta = ism::SurfaceMap(in.result).meta_mesh();
        for (Element e : {Element::kVertex, Element::kFace, Element::kCorner})
          ism::transfer(meta, Side::kA, e, e);
      },
      [](const Inputs& in) {
        const ism::SurfaceMap map(in.result);
        for (int f = 0; f < in.a.mesh.triangles.rows(); ++f)
          map.forward_path({in.a.mesh.triangles(f, 0), in.a.mesh.triangles(f, 1)});
      }};
  const std::size_t transfers = 6;  // the smaller problem fits into the cache, the larger does not
  for (std::size_t i = 0; i < calls.size(); ++i) {
    CAPTURE(i);
    const double ratio = growth(1, [&](int n) {
      const double before = processor_seconds();
      calls[i](inputs[n == 1 ? 0 : 1]);
      return processor_seconds() - before;
    });
    CHECK(ratio < (i == transfers ? 2 : 1) * kNearLinear);
  }
}

TEST_CASE("every edge of a mesh of 80,000 triangles is drawn on another one") {
  const Disk a = shapes::grid(200, 200);
  const Disk b = turned(shapes::grid(200, 200), 0.1);
  const ism::SurfaceMap map(a.mesh, b.mesh, a.plane, b.plane);
  const HalfEdgeMesh m = shapes::half_edges(a.mesh);
  int drawn = 0, edges = 0;
  for (int h = 0; h < m.tail.size(); ++h) {
    if (m.twin[h] > h) continue;
    ++edges;
    drawn += !map.forward_path({m.tail[h], m.tip(h)}).empty();
  }
  CHECK(drawn > edges / 2);
}

TEST_CASE("10,000 exact landmarks are joined") {
  const Disk a = shapes::grid(110, 110);
  Disk b = a;
  shapes::bend(b, 0.1);
  std::vector<ism::Landmark> landmarks;
  for (int v = 0; v < 10000; ++v) landmarks.push_back({v, v});
  ism::Options options = on_one_thread();
  options.exact_landmarks = true;
  options.max_iterations = 0;
  const ism::Result result = ism::compute_map(a.mesh, b.mesh, landmarks, options);
  check_run(result, 0);
  CHECK(result.start.landmark_distance < 1e-14);
}

TEST_CASE("decimation of 100,000 boundary edges, and of hubs, is undone vertex by vertex") {
  const Executor executor{on_one_thread()};
  for (const ism::TriangleMesh& mesh :
       {ring(50000, 5.5).mesh, comb(100000).mesh, large::bent_fan(20000, 3, 0.2)}) {
    const Surface s = build_surface(mesh, false);
    const Array<char> free(s.mesh.n_vertices, 0);
    DynamicMesh m(s.mesh);
    Array<Collapse> collapses = Decimation(s, free, nullptr, executor, m).run(Hierarchy::kBase);
    CHECK(s.mesh.n_vertices - collapses.size() <= Hierarchy::kBase);
    for (; !collapses.empty(); collapses.pop_back()) m.undo(collapses.back());
    for (int h = 0; h < s.mesh.tail.size(); ++h)
      REQUIRE(m.face[h / 3].data()[h % 3] == s.mesh.tail[h]);
    const Outline circle = circle_for(s, 0);
    Hierarchy on_circle(s, ism::Side::kA, free, Hierarchy::kBase, &circle, -1, executor);
    REQUIRE(on_circle.embed_base());
    on_circle.set_goal(s.mesh.n_vertices);
    CHECK(on_circle.grow() == -1);
    CHECK(is_injective(s.mesh, on_circle.positions()));
  }
}

TEST_CASE("gaps of 100,000 boundary edges") {
  for (const Disk& disk : {ring(50000, 5.5), comb(100000), shapes::fan(100000)}) {
    const HalfEdgeMesh m = shapes::half_edges(disk.mesh);
    REQUIRE(is_injective(m, disk.plane));
    CHECK(find_gaps(m, disk.plane, 1).size() < 4 * m.boundary.size());
  }
}

TEST_CASE("an inner point lies in a triangle, far from the boundary") {
  const Disk fan = shapes::fan(100000), grid = shapes::grid(21, 21), ring = shapes::frame(9, 3);
  CHECK(norm(inner_point(shapes::half_edges(fan.mesh), fan.plane)) < 0.7);
  const Vec2 low = row2(grid.plane, 0), high = row2(grid.plane, rows_of(grid.plane) - 1);
  const Vec2 inner = inner_point(shapes::half_edges(grid.mesh), grid.plane);
  CHECK(norm(inner - 0.5 * (low + high)) < 0.1 * norm(high - low));
  const HalfEdgeMesh m = shapes::half_edges(ring.mesh);
  const Vec2 p = inner_point(m, ring.plane);
  bool is_inside = false;
  for (int f = 0; f < m.n_faces; ++f) {
    const Vec3 w = barycentric(m, ring.plane, f, p);
    is_inside = is_inside || (w.x > 0 && w.y > 0 && w.z > 0);
  }
  CHECK(is_inside);
}

TEST_CASE("a pair with boundaries of 100,000 edges takes an iteration") {
  const Disk a = ring(50000, 5.5), b = turned(ring(49000, 5), 0.2);
  ism::Options options = few_iterations();
  options.max_iterations = 1;
  options.initial_f = a.plane;
  options.initial_g = b.plane;
  check_run(ism::compute_map(a.mesh, b.mesh, {}, options), 1);
}

}  // namespace sizes_tests

#endif  // ISM_TESTS_PART_SIZES_HPP

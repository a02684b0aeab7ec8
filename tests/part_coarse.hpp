// Coarse to fine: decimation of embedded surfaces, what returns, and the map of each level.

#ifndef ISM_TESTS_PART_COARSE_HPP
#define ISM_TESTS_PART_COARSE_HPP

#include "ism.hpp"
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

Hierarchy embedded(const Surface& s, const Disk& disk, const Array<char>& is_protected, int base,
                   const Executor& executor) {
  return Hierarchy(s, Side::kA, is_protected, base, disk.plane, executor);
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

TEST_CASE("an embedded surface stays injective in the plane on every level") {
  Rng rng(51);
  const Executor executor{on_one_thread()};
  for (const Disk& disk : disks(rng)) {
    const Surface s = build_surface(disk.mesh, true);
    const int n = s.mesh.n_vertices;
    Array<char> is_protected(n, 0);
    for (int v = 0; v < n; v += 17) is_protected[v] = 1;
    for (int base : {n / 2, n / 4, n / 8}) {
      Hierarchy h = embedded(s, disk, is_protected, base, executor);
      CHECK(h.active() < n);
      CHECK(is_injective_here(h));
      CHECK(h.current().surface.mesh.loops() == s.mesh.loops());
      for (int v = 0; v < n; v += 17) CHECK(h.has(v));
      Level level = h.current();  // elsewhere: bent as a whole
      Points2 x = h.positions(level);
      for (int v = 0; v < x.rows(); ++v) x(v, 1) += 0.04 * x(v, 0) * x(v, 0);
      if (!is_injective(level.surface.mesh, x)) continue;
      h.set(level, x);
      while (!h.is_full()) {
        REQUIRE(h.grow_by_one() == -1);
        if (h.active() % 10 == 0) CHECK(is_injective_here(h));
      }
      CHECK(is_injective(s.mesh, h.positions()));
    }
  }
}

TEST_CASE("what returns goes where an affine map takes it, and stays there") {
  Rng rng(52);
  const Executor executor{on_one_thread()};
  for (const Disk& disk : disks(rng)) {
    const Surface s = build_surface(disk.mesh, true);
    const Array<char> none(s.mesh.n_vertices, 0);
    Hierarchy h = embedded(s, disk, none, s.mesh.n_vertices / 4, executor);
    Eigen::Matrix2d M;
    M << 1.3, 0.4, -0.2, 0.7;
    const Points2 image = disk.plane * M.transpose();
    Level level = h.current();
    Points2 x(level.vertex.size(), 2);
    for (int i = 0; i < level.vertex.size(); ++i) x.row(i) = image.row(level.vertex[i]);
    h.set(level, x);
    while (!h.is_full()) REQUIRE(h.grow_by_one() == -1);
    const double size = image.cwiseAbs().maxCoeff();
    CHECK((h.positions() - image).cwiseAbs().maxCoeff() < 1e-7 * size);

    FlatNewton newton({smoothed_rest(s, disk.plane, image)}, image, executor);
    CHECK(newton.value(image) == doctest::Approx(4 * s.total_area).epsilon(1e-10));
    while (newton.minimize(5, 0)) {
    }
    CHECK((newton.positions() - image).cwiseAbs().maxCoeff() < 1e-7 * size);
  }
}

TEST_CASE("a map by coarse levels is as good as one without, in fewer iterations") {
  Rng rng(53);
  const Disk a = bent_grid(26, 26, 0.9, rng), b = bent_grid(22, 30, -0.7, rng);
  const std::vector<Landmark> landmarks = {{60, 70}, {500, 480}, {620, 600}};
  Options options = on_one_thread();
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
    CHECK(level.mean_distortion < coarse.initial.mean_distortion);
  }
  CHECK(coarse.initial.energy == plain.initial.energy);
  CHECK(coarse.log_begin.energy < coarse.initial.energy);
  CHECK(coarse.log[0].energy <= coarse.log_begin.energy);
  CHECK(coarse.start.f == plain.start.f);
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

TEST_CASE("constraints hold on all levels, and a map is there after every step") {
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
      const HalfEdgeMesh m = half_edges(*r.start.a), n = half_edges(*r.start.b);
      CHECK(is_injective(m, r.f));
      CHECK(is_injective(n, r.g));
      coarse_steps += before.size() > 0 && before != r.f;
      before = r.f;
      if (options.exact_landmarks)
        for (const Landmark& l : landmarks) CHECK(r.f.row(l.a.vertex) == r.g.row(l.b.vertex));
      for (int v : options.fixed_b) CHECK(r.g.row(v) == r.start.g.row(v));
      if (options.boundary == ism::Boundary::kFixed)
        for (int h : m.boundary) CHECK(r.f.row(m.tail[h]) == r.start.f.row(m.tail[h]));
    }
    const Result& r = solver.result();
    CAPTURE(r.message);
    CHECK(r.status == ism::Status::kConverged);
    REQUIRE_FALSE(r.coarse.empty());
    CHECK(coarse_steps > 0);
    CHECK(coarse_steps <= static_cast<int>(r.coarse.size()) + 1);  // once a level, see below
    CHECK(r.final_state().pin_residual < 1e-9);
    CHECK(r.final_state().energy < r.initial.energy);
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
  const Result first = map_of(a, b, {{50, 50}, {350, 350}}, options);
  options.initial_f = first.f;
  options.initial_g = first.g;
  const Result again = map_of(a, b, {}, options);
  CHECK_FALSE(again.coarse.empty());
  CHECK(again.initial.energy == doctest::Approx(first.final_state().energy).epsilon(1e-9));
  CHECK(again.final_state().energy < first.final_state().energy + 1e-4);
}

TEST_CASE("where nothing can be removed, or little, there are no levels") {
  Options options = on_one_thread();
  options.boundary = ism::Boundary::kFixed;
  options.coarsest = 1;
  Disk strip = shapes::grid(40, 1);  // all on the boundary
  Disk other = shapes::grid(38, 1);
  shapes::bend(other, 0.2);
  const Result r = map_of(strip, other, {{0, 0}, {40, 38}, {81, 77}}, options);
  CHECK(r.coarse.empty());
}

}  // namespace coarse_tests

#endif  // ISM_TESTS_PART_COARSE_HPP

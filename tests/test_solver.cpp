// A Solver against compute_map(): the same bits, whatever interrupts it.

#include "ism.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace {

using ism::Result;
using ism::Solver;
using ism::Status;
using shapes::Disk;

/// Runs that pass through all parts of the embedding.
struct Case {
  std::string name;
  Disk a, b;
  std::vector<ism::Landmark> landmarks;
  ism::Options options;
};

std::vector<Case> cases() {
  shapes::Rng rng(11);
  Disk a = shapes::perturbed_grid(9, 9, 0.2, rng), b = shapes::perturbed_grid(8, 10, 0.2, rng);
  shapes::bend(a, 0.6);
  shapes::bend(b, -0.5);
  ism::Options options;
  options.threads = 1;
  options.max_iterations = 12;
  options.coarsest = 12;
  const std::vector<ism::Landmark> landmarks = {{22, 25}, {75, 69}};
  std::vector<Case> all;
  all.push_back({"no landmarks", a, b, {}, options});
  all.push_back({"landmarks", a, b, landmarks, options});
  ism::Options exact = options;
  exact.exact_landmarks = true;
  all.push_back({"exact landmarks", a, b, landmarks, exact});
  exact.boundary = ism::Boundary::kSlide;
  all.push_back({"exact landmarks, sliding boundaries", a, b, landmarks, exact});
  const std::vector<ism::Landmark> points = {{ism::SurfacePoint{40, {0.2, 0.3, 0.5}}, 25},
                                             {75, ism::SurfacePoint{110, {0, 0.4, 0.6}}},
                                             {ism::SurfacePoint{40, {0.6, 0.3, 0.1}}, 34}};
  all.push_back({"points in triangles", a, b, points, options});
  exact.boundary = ism::Boundary::kFree;
  all.push_back({"exact points", a, b, points, exact});
  ism::Options fixed = options;
  fixed.boundary = ism::Boundary::kFixed;
  fixed.pins_a = {44};
  all.push_back({"fixed boundaries, a pin", a, b, {}, fixed});
  return all;
}

Solver solver_of(const Case& c) { return {c.a.mesh, c.b.mesh, c.landmarks, c.options}; }

/// Stops a solver within a task: a job system is asked for often.
struct Interrupter {
  std::atomic<bool> stop{false};
  int tasks_left = 1;

  void set(ism::Options& options) {
    options.stop = &stop;
    options.parallel_for = [this](int n, const std::function<void(int)>& task) {
      for (int i = 0; i < n; ++i) {
        if (--tasks_left == 0) stop = true;
        task(i);
      }
    };
  }

  /// Runs to the end, stopped after 1 to `most` tasks again and again; check(n) after the n-th
  /// time.
  template <class Check>
  void run(Solver& solver, int most, shapes::Rng& rng, const Check& check) {
    int stopped = 0;
    for (int i = 0; i < 100000; ++i) {
      const bool has_more = solver.step();
      if (!stop && !has_more) break;
      if (!stop) continue;
      stop = false;
      tasks_left = rng.between(1, most);
      check(++stopped);
    }
    CHECK(stopped > 5);
  }
};

Result expected_of(const Case& c) {
  const Result r = ism::compute_map(c.a.mesh, c.b.mesh, c.landmarks, c.options);
  INFO(r.message);
  REQUIRE(ism::is_usable(r.status));
  REQUIRE(r.log.size() > 5);
  return r;
}

void check_same(const Result& r, const Result& expected) {
  CHECK(r.status == expected.status);
  CHECK(r.message == expected.message);
  CHECK(r.log.size() == expected.log.size());
  CHECK(r.f == expected.f);
  CHECK(r.g == expected.g);
  CHECK(r.start.f == expected.start.f);
  CHECK(r.start.a->triangles == expected.start.a->triangles);
  CHECK(r.final_state().energy == expected.final_state().energy);
}

}  // namespace

TEST_CASE("a solver does what compute_map() does, in steps") {
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    const Result expected = expected_of(c);
    Solver solver = solver_of(c);
    int steps = 0;
    double fraction = 0;
    bool has_map = false;
    while (solver.step()) {
      ++steps;
      CHECK(solver.fraction() >= fraction);
      fraction = solver.fraction();
      CHECK(fraction <= 1);
      has_map = has_map || ism::is_usable(solver.result().status);
      CHECK(ism::is_usable(solver.result().status) == has_map);
      CHECK((solver.result().f.rows() > 0) == has_map);
      CHECK(solver.result().status == (has_map ? Status::kUnfinished : Status::kNoMapYet));
      CHECK_FALSE(solver.result().message.empty());
    }
    CHECK(steps > 20);
    CHECK(solver.fraction() == 1);
    check_same(solver.result(), expected);
    CHECK_FALSE(solver.step());
    check_same(solver.result(), expected);
  }
}

TEST_CASE("a solver goes on after it was cancelled anywhere, to the same bits") {
  for (const Case& c : cases()) {
    CAPTURE(c.name);
    const Result expected = expected_of(c);
    shapes::Rng rng(17);
    Interrupter interrupter;
    Case d = c;
    interrupter.set(d.options);
    Solver solver = solver_of(d);
    interrupter.run(solver, 300, rng, [&](int) {
      const Status status = solver.result().status;
      CHECK((status == Status::kCancelled || status == Status::kNoMapYet ||
             status == expected.status));
    });
    check_same(solver.result(), expected);
  }
}

TEST_CASE("a job system is not asked for runs inside of runs") {
  Case c = cases()[2];
  const Result expected = expected_of(c);
  std::atomic<int> running{0};
  int runs = 0, nested = 0;
  c.options.parallel_for = [&](int n, const std::function<void(int)>& task) {
    ++runs;
    nested += running++ != 0;
    for (int i = n - 1; i >= 0; --i) task(i);
    --running;
  };
  const Result r = ism::compute_map(c.a.mesh, c.b.mesh, c.landmarks, c.options);
  CHECK(runs > 100);
  CHECK(nested == 0);
  check_same(r, expected);
}

TEST_CASE("advance() keeps to its budget but for a step") {
  const Case c = cases()[1];
  const Result expected = expected_of(c);
  Solver solver = solver_of(c);
  int calls = 1;
  while (solver.advance(1e-3)) ++calls;
  CHECK(calls > 5);
  check_same(solver.result(), expected);
  solver = solver_of(c);
  CHECK_FALSE(solver.advance(std::numeric_limits<double>::infinity()));
  check_same(solver.result(), expected);
}

// ---- other landmarks and options ----

/// Cases with a map, and the landmarks and options they go on with.
struct Change {
  Case from, to;
};

std::vector<Change> changes() {
  std::vector<Change> all;
  for (std::size_t i = 1; i < 4; ++i) {  // soft, exact, exact on sliding boundaries
    Change c = {cases()[i], cases()[i]};
    c.to.landmarks[1].b.vertex += 1;
    all.push_back(c);
  }
  Change late = {cases()[1], cases()[2]};
  late.to.name = "landmarks become exact, one is new";
  late.from.landmarks = {{22, 20}, {75, 76}};  // pins stay where no new start is needed
  late.to.landmarks = {{22, 20}, {75, 76}, {48, 43}};
  late.to.options.pins_b = {31};
  late.to.options.coverage_weight = 0.1;
  all.push_back(late);
  Change points = {cases()[4], cases()[5]};
  points.to.name = "points in triangles become exact, one elsewhere";
  points.to.landmarks[0].b = ism::SurfacePoint{30, {0.3, 0.3, 0.4}};
  all.push_back(points);
  for (Change& c : all)  // other starts lead elsewhere
    c.from.options.candidates = c.to.options.candidates = false;
  return all;
}

Solver changed(const Change& c) {
  Solver solver = solver_of(c.from);
  while (solver.step()) {
  }
  const ism::Outcome outcome = solver.change(c.to.landmarks, c.to.options);
  INFO(outcome.message);
  REQUIRE(outcome.status == Status::kDone);
  return solver;
}

TEST_CASE("a solver goes on with other landmarks and options from the map it has") {
  for (Change c : changes()) {
    CAPTURE(c.to.name);
    c.to.options.max_iterations = 200;  // to the end: where a run is earlier, chance decides
    Solver solver = changed(c);
    const ism::SurfaceMap before(solver.result());
    int steps = 0;
    do {
      ++steps;
      REQUIRE(ism::is_usable(solver.result().status));
      CHECK(ism::SurfaceMap(solver.result()).status() == Status::kDone);
    } while (solver.step());
    CHECK(steps > 10);
    const Result& r = solver.result();
    if (c.to.options.pins_b.empty()) {  // else pins are somewhere else from the start
      Case same = c.to;
      same.options.coarsest = 0;  // nor does a change pass through coarse levels
      const Result anew = expected_of(same);
      CAPTURE(anew.final_state().mean_distortion);
      CHECK(r.final_state().mean_distortion < 1.05 * anew.final_state().mean_distortion);
    }
    if (!c.to.options.exact_landmarks) continue;
    CHECK(r.start.landmark_distance < 1e-14);
    for (const ism::Landmark& l : c.to.landmarks)
      if (l.a.vertex >= 0 && l.b.vertex >= 0) CHECK(r.f.row(l.a.vertex) == r.g.row(l.b.vertex));
    const ism::SurfaceMap after(r);
    for (int v : c.to.options.pins_b) {
      const ism::SurfacePoint image = after.backward_vertex(v), was = before.backward_vertex(v);
      REQUIRE(was.exists());
      CHECK((after.position_on_a(image) - before.position_on_a(was)).norm() < 1e-9);
    }
  }
}

TEST_CASE("a change to or from a run without a preconditioner takes its weight from the options") {
  Case c = cases()[1];
  c.options.coarsest = 0;
  ism::Options projected_newton = c.options;
  projected_newton.omega_start = 0;
  Solver solver = solver_of(c);
  const auto advance = [&] {
    while (!ism::is_usable(solver.result().status)) REQUIRE(solver.step());
    for (int i = 0; i < 3; ++i) REQUIRE(solver.step());
    return solver.result().final_state().omega;
  };
  CHECK(advance() > 0);
  REQUIRE(solver.change(c.landmarks, projected_newton).status == Status::kDone);
  CHECK(advance() == 0);
  REQUIRE(solver.change(c.landmarks, c.options).status == Status::kDone);
  CHECK(advance() > 0);
}

TEST_CASE("a memory of any length is one of all iterations") {
  Case c = cases()[1];
  c.options.history_length = 100;
  const Result expected = expected_of(c);
  c.options.history_length = std::numeric_limits<int>::max();
  check_same(ism::compute_map(c.a.mesh, c.b.mesh, c.landmarks, c.options), expected);
}

TEST_CASE("a change that is interrupted ends in the same bits") {
  for (const Change& c : changes()) {
    CAPTURE(c.to.name);
    Solver solver = changed(c);
    while (solver.step()) {
    }
    const Result expected = solver.result();
    shapes::Rng rng(19);
    Interrupter interrupter;
    Change d = c;
    interrupter.set(d.to.options);
    solver = changed(d);
    interrupter.run(solver, 300, rng, [&](int) { CHECK(ism::is_usable(solver.result().status)); });
    check_same(solver.result(), expected);
  }
}

TEST_CASE("a change that is stopped before its first iteration pulls first, as one that is not") {
  Change c = changes().front();
  c.to.options.exact_landmarks = true;
  std::atomic<bool> stop{false};
  const auto run = [&](bool is_stopped) {
    Change d = c;
    d.to.options.stop = &stop;
    Solver solver = changed(d);
    for (int i = 0; i < 3; ++i) {
      stop = is_stopped;
      if (is_stopped) CHECK_FALSE(solver.step());
      stop = false;
      solver.step();
    }
    while (solver.step()) {
    }
    return solver.result();
  };
  check_same(run(true), run(false));
}

TEST_CASE("a change of landmarks that are being changed is the last one's") {
  Change c = changes()[1];
  Solver solver = changed(c);
  solver.step();
  c.to.landmarks[0].b.vertex += 1;
  REQUIRE(solver.change(c.to.landmarks, c.to.options).status == Status::kDone);
  while (solver.step()) {
  }
  CHECK(solver.result().start.landmark_distance == 0);
  for (const ism::Landmark& l : c.to.landmarks)
    CHECK(solver.result().f.row(l.a.vertex) == solver.result().g.row(l.b.vertex));
}

TEST_CASE("a change that is refused changes nothing; before there is a map it begins anew") {
  const Case c = cases()[2];
  const Result expected = expected_of(c);
  Solver solver = solver_of(c);
  while (solver.result().log.size() < 5) solver.step();
  ism::Options bad = c.options;
  bad.pins_a = {1000};
  ism::Outcome outcome = solver.change(c.landmarks, bad);
  CHECK(outcome.status == Status::kInvalidPins);
  CHECK(outcome.ids == shapes::Ids{shapes::of_a(1000)});
  outcome = solver.change({{5, 6}, {5, 7}}, c.options);
  CHECK(outcome.status == Status::kInvalidLandmarks);
  bad = c.options;
  bad.history_length = 0;
  CHECK(solver.change(c.landmarks, bad).status == Status::kInvalidOptions);
  while (solver.step()) {
  }
  check_same(solver.result(), expected);
  solver = solver_of(cases()[0]);
  solver.step();
  REQUIRE(solver.change(c.landmarks, c.options).status == Status::kDone);
  while (solver.step()) {
  }
  check_same(solver.result(), expected);
  CHECK(Solver().change({}, {}).status == Status::kInvalidMesh);
}

TEST_CASE("a change that cannot be met leaves a map, and says why; the next one goes on") {
  shapes::Rng rng(5);
  ism::Options exact;
  exact.exact_landmarks = true;
  exact.max_iterations = 1;
  exact.coarsest = 0;
  int n_failed = 0;
  for (int i = 0; i < 20; ++i) {
    const Disk a = shapes::perturbed_grid(8, 8, 0.2, rng),
               b = shapes::perturbed_grid(8, 8, 0.2, rng);
    ism::Options options = shapes::from_planes(a, b);
    options.max_iterations = 1;
    Solver solver(a.mesh, b.mesh, {}, options);
    while (solver.step()) {
    }
    exact.pins_a = {rng.between(0, 9), rng.between(10, 19)};
    exact.pins_b = {rng.between(0, 9), rng.between(10, 19)};
    const std::vector<ism::Landmark> landmarks = {{rng.between(20, 49), rng.between(20, 49)},
                                                  {rng.between(50, 80), rng.between(50, 80)}};
    if (solver.change(landmarks, exact).status != Status::kDone) continue;
    while (solver.step()) {
    }
    const Result& r = solver.result();
    CHECK(ism::is_usable(r.status));
    CHECK(ism::SurfaceMap(r).status() == Status::kDone);
    if (r.status != Status::kStalled || r.ids.empty()) continue;
    ++n_failed;
    CHECK(!r.message.empty());
    REQUIRE(solver.change({}, ism::Options()).status == Status::kDone);
    while (solver.step()) {
    }
    CHECK(ism::is_usable(solver.result().status));
  }
  CHECK(n_failed > 0);
}

TEST_CASE("a run that is stopped before its map is closed says so, and ends in the same bits") {
  const ism::TriangleMesh a = shapes::sphere(2), b = shapes::blob(2, 0.2, 3);
  const std::vector<ism::Landmark> landmarks = {{0, 0}, {5, 7}, {20, 30}};
  ism::Options options;
  options.threads = 1;
  options.coarsest = 0;
  options.tolerance = 3e-3;
  const Result expected = ism::compute_map(a, b, landmarks, options);
  REQUIRE(expected.status == Status::kConverged);
  options.progress = [&](const ism::Progress& p) { return p.iteration == nullptr; };
  Solver solver(a, b, landmarks, options);  // stopped after each iteration, the last one, too
  std::size_t entries = 0;
  int n_stopped = 0;
  for (bool has_more = true; has_more || solver.result().log.size() != entries;) {
    entries = solver.result().log.size();
    has_more = solver.step();
    if (has_more || solver.result().log.size() == entries) continue;
    ++n_stopped;
    const bool is_last = solver.result().log.size() == expected.log.size();
    CHECK(solver.result().status == (is_last ? expected.status : Status::kCancelled));
  }
  CHECK(n_stopped == static_cast<int>(expected.log.size()));
  check_same(solver.result(), expected);
}

TEST_CASE("given positions in which exact landmarks leave no room are refused, the start, too") {
  ism::TriangleMesh mesh;
  mesh.vertices.resize(3, 3);
  mesh.vertices << 0, 0, 0, 1, 0, 0, 0.4, 0.8, 0;
  mesh.triangles.resize(1, 3);
  mesh.triangles << 0, 1, 2;
  const ism::SurfacePoint inside = {0, {0.2, 0.3, 0.5}};
  shapes::Rng rng(1);
  int n_refused = 0;
  for (int i = 0; i < 200; ++i) {
    const double x = rng.uniform(0.3, 0.7), y = rng.uniform(-0.3, 0.3);
    ism::Options options;
    options.threads = 1;
    options.max_iterations = 1;
    options.exact_landmarks = true;
    options.initial_f.resize(3, 2);
    options.initial_f << 0, 0, 1, y, x, std::nextafter(x * y, 1.0);
    options.initial_g = options.initial_f;
    const Result r = ism::compute_map(mesh, mesh, {{inside, inside}}, options);
    if (r.status != Status::kInvalidLandmarks) continue;
    ++n_refused;
    CHECK(r.start.status == r.status);
    CHECK(r.start.message == r.message);
  }
  CHECK(n_refused > 0);
}

TEST_CASE("a solver without valid meshes says so") {
  Solver solver;
  CHECK(solver.result().status == Status::kInvalidMesh);
  CHECK_FALSE(solver.step());
  CHECK(solver.result().f.size() == 0);
  Solver other = std::move(solver);
  CHECK(other.result().status == Status::kInvalidMesh);
}

TEST_CASE("the time limit ends a call, and its status says whether there is a map") {
  const Case c = cases()[0];
  using Clock = std::chrono::steady_clock;
  int without = 0, with = 0;
  for (double seconds : {1e-9, 1e-3, 1e-2, 0.1, 0.3}) {
    Case d = c;
    d.options.max_iterations = 1 << 30;
    d.options.tolerance = 0;
    d.options.max_seconds = seconds;
    const Clock::time_point start = Clock::now();
    const Result r = ism::compute_map(d.a.mesh, d.b.mesh, d.landmarks, d.options);
    CHECK(std::chrono::duration<double>(Clock::now() - start).count() < seconds + 0.25);
    if (ism::is_usable(r.status)) {
      ++with;
      CHECK(r.f.rows() == d.a.mesh.vertices.rows());
    } else {
      ++without;
      CHECK(r.status == Status::kNoMapYet);
      CHECK(r.message == "stopped at the time limit, before there was a map");
      CHECK(r.f.size() == 0);
    }
  }
  CHECK(without >= 1);
  CHECK(without + with == 5);
}

// A machine without memory: whichever piece of it is refused, to whatever function of the library,
// the caller gets bad_alloc or a result, and nothing is leaked. Unlike test_failures.cpp, this sees
// also what Eigen takes from malloc, and refuses one piece after the other. And callbacks that
// throw while a Solver is at work.

#include "allocations.hpp"
#include "ism.hpp"
#include "sanitized.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <functional>
#include <new>
#include <stdexcept>
#include <utility>
#include <vector>

namespace {

using shapes::Disk;

struct Refusal : std::runtime_error {
  Refusal() : std::runtime_error("refused") {}
};

const std::vector<ism::Landmark> kLandmarks = {{0, 0}, {8, 8}};

ism::Options options_of(int threads, int iterations) {
  ism::Options options;
  options.threads = threads;
  options.max_iterations = iterations;
  return options;
}

[[maybe_unused]] std::pair<Disk, Disk> small_pair() {  // by what sanitizers leave out
  std::pair<Disk, Disk> disks = {shapes::grid(2, 2), shapes::fan(8)};
  shapes::bend(disks.first, 0.5);
  shapes::bend(disks.second, -0.4);
  return disks;
}

/// Large enough for helpers to have tasks.
std::pair<Disk, Disk> helped_pair() {
  shapes::Rng rng(5);
  std::pair<Disk, Disk> disks = {shapes::perturbed_grid(12, 12, 0.2, rng),
                                 shapes::perturbed_grid(11, 11, 0.2, rng)};
  shapes::bend(disks.first, 0.5);
  shapes::bend(disks.second, -0.4);
  return disks;
}

}  // namespace

#if defined(__GLIBC__) && !defined(ISM_TEST_SANITIZED)
namespace {

constexpr long kGiveAll = 1L << 60;
std::atomic<long> until_failure{kGiveAll};  // pieces that are still given
std::atomic<bool> fails_for_good{false};    // or once only
std::atomic<long> live{0};                  // pieces

bool is_refused() {
  if (until_failure.load(std::memory_order_relaxed) >= kGiveAll / 2) return false;
  const long left = until_failure--;
  return fails_for_good ? left <= 0 : left == 0;
}

}  // namespace

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);

void* malloc(std::size_t size) {
  if (is_refused()) return nullptr;
  ++live;
  return __libc_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) {
  if (is_refused()) return nullptr;
  ++live;
  return __libc_calloc(n, size);
}
void* realloc(void* memory, std::size_t size) {
  if (is_refused()) return nullptr;
  if (memory == nullptr) ++live;
  return __libc_realloc(memory, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
  if (is_refused()) return 12;  // ENOMEM
  ++live;
  *memory = __libc_memalign(alignment, size);
  return 0;
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  if (is_refused()) return nullptr;
  ++live;
  return __libc_memalign(alignment, size);
}
void free(void* memory) {
  if (memory != nullptr) --live;
  __libc_free(memory);
}
}

namespace {

/// What is refused: memory of operator new, or also what Eigen takes from malloc.
enum class Memory { kOfNew, kAll };

void refuse_from(Memory memory, long n, bool for_good) {
  if (memory == Memory::kOfNew)
    return for_good ? fail_allocations_from(static_cast<std::size_t>(n))
                    : fail_allocation(static_cast<std::size_t>(n));
  fails_for_good = for_good;
  until_failure = n;
}

/// Gives memory again; true if a piece was refused.
bool refuse_no_more(Memory memory) {
  const bool was_refused = memory == Memory::kOfNew ? has_failed_allocation() : until_failure < 0;
  fail_allocation(kNever);
  until_failure = kGiveAll;
  return was_refused;
}

struct Refused {
  int tried = 0, thrown = 0;
};

/// Runs with the n-th piece refused, for n = 0, stride, 2 stride and so on until none is.
/// A few pieces are kept by the system: of threads, of the pool of exceptions.
Refused refuse_each(Memory memory, bool for_good, long stride, const std::function<void()>& run) {
  run();
  Refused count;
  for (long n = 0;; n += stride) {
    const long before = live;
    bool has_thrown = false;
    refuse_from(memory, n, for_good);
    try {
      run();
    } catch (const std::bad_alloc&) {
      has_thrown = true;
    }
    const bool is_over = !refuse_no_more(memory);
    CAPTURE(n);
    REQUIRE(live == before);
    if (is_over) return count;
    ++count.tried;
    count.thrown += has_thrown ? 1 : 0;
  }
}

/// The distance of the pieces that are refused: all are, or about so many.
long stride_for(const std::function<void()>& run, long tries) {
  const std::size_t before = allocations();
  run();
  return 1 + static_cast<long>(allocations() - before) / tries;
}

/// Once, and from then on.
void check_refusals(Memory memory, long tries, const std::function<void()>& run) {
  const long stride = stride_for(run, tries);
  for (bool for_good : {false, true}) {
    CAPTURE(for_good);
    const Refused count = refuse_each(memory, for_good, stride, run);
    CHECK(count.tried > 20);
    if (for_good)
      CHECK(count.thrown == count.tried);
    else  // std::stable_sort does with less
      CHECK(count.thrown >= count.tried * 9 / 10);
  }
}

}  // namespace

TEST_CASE("validate and prepare without memory") {
  const Disk disk = shapes::grid(3, 3);
  ism::TriangleMesh broken = disk.mesh;
  std::swap(broken.triangles(4, 0), broken.triangles(4, 1));
  broken.vertices.conservativeResize(17, Eigen::NoChange);
  broken.vertices.row(16).setZero();
  check_refusals(Memory::kAll, 2000, [&] {
    ism::validate(disk.mesh);
    ism::validate(broken);
    ism::prepare(disk.mesh, {3});
    ism::prepare(broken, {3, 4});
  });
}

TEST_CASE("compute_map without memory") {
  const std::pair<Disk, Disk> disks = small_pair();
  const Disk &a = disks.first, &b = disks.second;
  ism::Options options = options_of(1, 1);
  std::vector<ism::Landmark> landmarks = kLandmarks;
  long stops = 300;
  SUBCASE("free") { options.candidates = false; }
  SUBCASE("with candidates") { stops = 50; }
  SUBCASE("boundaries held, exact landmarks") {
    options.candidates = false;
    options.boundary = ism::Boundary::kFixed;
    options.exact_landmarks = true;
    landmarks = {{ism::SurfacePoint{3, {0.3, 0.3, 0.4}}, 0}};
  }
  SUBCASE("refused") { landmarks.push_back({-1, 0}); }
  check_refusals(Memory::kOfNew, stops,
                 [&] { ism::compute_map(a.mesh, b.mesh, landmarks, options); });
}

TEST_CASE("compute_map of closed surfaces without memory") {
  const ism::TriangleMesh a = shapes::sphere(0), b = shapes::blob(0, 0.3, 1);
  const ism::Options options = options_of(1, 1);
  const std::vector<ism::Landmark> landmarks = {{0, 0}, {1, 1}, {2, 2}};
  check_refusals(Memory::kOfNew, 50, [&] { ism::compute_map(a, b, landmarks, options); });
}

TEST_CASE("two threads without memory") {
  const std::pair<Disk, Disk> disks = helped_pair();
  const Disk &a = disks.first, &b = disks.second;
  const ism::Options options = options_of(2, 1);
  const std::vector<ism::Landmark> landmarks = {{20, 20}, {110, 90}};
  // Which thread takes what differs by a few pieces from run to run, and so does the end.
  check_refusals(Memory::kOfNew, 30,
                 [&] { ism::compute_map(a.mesh, b.mesh, landmarks, options); });
}

TEST_CASE("a Solver without memory") {
  const std::pair<Disk, Disk> disks = small_pair();
  const Disk &a = disks.first, &b = disks.second;
  const ism::Options options = options_of(1, 2);
  ism::Options more = options;
  more.max_iterations = 1;
  more.pins_a = {4};
  check_refusals(Memory::kOfNew, 2000, [&] {
    ism::Solver solver(a.mesh, b.mesh, kLandmarks, options);
    solver.step();
    solver.change({{0, 1}}, more);
    solver.step();
    ism::Solver other = std::move(solver);
    other.advance(1e-9);
    solver = std::move(other);
    solver.result();
  });
}

TEST_CASE("a Solver that ran out of memory can be assigned to, and then works") {
  const std::pair<Disk, Disk> disks = small_pair();
  const Disk &a = disks.first, &b = disks.second;
  const ism::Options options = options_of(1, 2);
  const ism::Result expected = ism::compute_map(a.mesh, b.mesh, kLandmarks, options);
  int failed = 0;
  for (long n = 0; n < 4000; n += 97) {
    ism::Solver solver(a.mesh, b.mesh, kLandmarks, options);
    fail_allocation(static_cast<std::size_t>(n));
    try {
      while (solver.step()) {
      }
    } catch (const std::bad_alloc&) {
      ++failed;
    }
    fail_allocation(kNever);
    solver = ism::Solver(a.mesh, b.mesh, kLandmarks, options);
    while (solver.step()) {
    }
    CHECK(solver.result().f == expected.f);
  }
  CHECK(failed > 10);
}

TEST_CASE("queries without memory") {
  const std::pair<Disk, Disk> disks = small_pair();
  const Disk &a = disks.first, &b = disks.second;
  const ism::Result result = ism::compute_map(a.mesh, b.mesh, kLandmarks, options_of(1, 1));
  REQUIRE(ism::is_usable(result.status));
  const ism::Values values = a.mesh.vertices;
  check_refusals(Memory::kAll, 2000, [&] {
    const ism::SurfaceMap map(result);
    map.forward_vertices();
    map.backward_vertices();
    map.forward_path({0, 1, 2});
    ism::summarize(map.distortion());
    ism::remesh(map, ism::Side::kA);
    const ism::MetaMesh meta = map.meta_mesh();
    ism::linear_morph(meta, 0.5);
    for (ism::Element e : {ism::Element::kVertex, ism::Element::kFace, ism::Element::kCorner}) {
      ism::from_meta(meta, ism::Side::kB, e);
      ism::transfer(meta, ism::Side::kA, ism::Element::kVertex, e).apply(values);
    }
  });
}
#endif

TEST_CASE("what callbacks throw comes through a Solver, which can be assigned to") {
  const std::pair<Disk, Disk> disks = helped_pair();
  const Disk &a = disks.first, &b = disks.second;
  const std::vector<ism::Landmark> landmarks = {{20, 20}, {110, 90}};
  const ism::Result expected = ism::compute_map(a.mesh, b.mesh, landmarks, options_of(1, 2));
  for (int last = 0; last < 60; last += 5)
    for (int what = 0; what < 3; ++what) {
      CAPTURE(last);
      CAPTURE(what);
      int calls = 0;
      const auto call = [&] {
        if (calls++ >= last) throw Refusal();
      };
      ism::Options options = options_of(2, 2);
      if (what == 0) options.progress = [&](const ism::Progress&) { return call(), true; };
      if (what == 1)
        options.parallel_for = [&](int n, const std::function<void(int)>& task) {
          for (int i = 0; i < n; ++i) task(i);
          call();
        };
      if (what == 2)
        options.parallel_for = [&](int n, const std::function<void(int)>& task) {
          for (int i = 0; i < n / 2; ++i) task(i);
          call();  // half of the work is not done
          for (int i = n / 2; i < n; ++i) task(i);
        };
      bool has_thrown = false;
      ism::Solver solver;
      try {
        solver = ism::Solver(a.mesh, b.mesh, landmarks, options);
        while (solver.step()) {
        }
      } catch (const Refusal&) {
        has_thrown = true;
      }
      CHECK(has_thrown == (calls > last));
      solver = ism::Solver(a.mesh, b.mesh, landmarks, options_of(1, 2));
      while (solver.step()) {
      }
      CHECK(solver.result().f == expected.f);
    }
}

// Memory, threads and callbacks that fail: whatever a call meets, its caller hears of it, nothing
// is leaked and no thread is left.

#include "allocations.hpp"
#include "ism.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#ifdef __linux__
#include <dlfcn.h>
#include <pthread.h>
#include <cerrno>
#endif

namespace {

std::atomic<int> threads_left{1 << 30};  // that pthread_create still starts
std::atomic<int> threads_started{0};

ism::Options options_of(int threads, int iterations) {
  ism::Options options;
  options.threads = threads;
  options.max_iterations = iterations;
  return options;
}

/// Landmarks of the pair below, so that no rotations are tried.
const std::vector<ism::Landmark> kLandmarks = {{40, 36}, {230, 180}};

/// Large enough for helpers to have tasks.
std::pair<shapes::Disk, shapes::Disk> pair() {
  shapes::Rng rng(5);
  std::pair<shapes::Disk, shapes::Disk> disks = {shapes::perturbed_grid(16, 16, 0.2, rng),
                                                 shapes::perturbed_grid(14, 14, 0.2, rng)};
  shapes::bend(disks.first, 0.5);
  shapes::bend(disks.second, -0.4);
  return disks;
}

/// An own job system: two threads that take turns.
void two_threads(int n, const std::function<void(int)>& task) {
  std::thread other([&] {
    for (int i = 1; i < n; i += 2) task(i);
  });
  for (int i = 0; i < n; i += 2) task(i);
  other.join();
}

struct Refusal : std::runtime_error {
  Refusal() : std::runtime_error("refused") {}
};

}  // namespace

#ifdef __linux__
/// The system's, until there are no more threads.
extern "C" int pthread_create(pthread_t* thread, const pthread_attr_t* attributes,
                              void* (*work)(void*), void* argument) {
  using Create = int (*)(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*);
  static const Create create = reinterpret_cast<Create>(dlsym(RTLD_NEXT, "pthread_create"));
  if (threads_left-- <= 0) return EAGAIN;
  ++threads_started;
  return create(thread, attributes, work, argument);
}

TEST_CASE("helpers are started once per call, and fewer do where the system gives fewer") {
  const auto [a, b] = pair();
  const ism::Result expected = ism::compute_map(a.mesh, b.mesh, kLandmarks, options_of(1, 5));
  REQUIRE(ism::is_usable(expected.status));
  for (int given : {100, 2, 1, 0}) {
    CAPTURE(given);
    threads_started = 0;
    threads_left = given;
    const ism::Result result = ism::compute_map(a.mesh, b.mesh, kLandmarks, options_of(4, 5));
    threads_left = 1 << 30;
    CHECK(threads_started == (std::min)(given, 3));
    CHECK(result.f == expected.f);
    CHECK(result.g == expected.g);
  }
}
#endif

TEST_CASE("what a measure throws, in whatever thread, reaches the caller") {
  const auto [a, b] = pair();
  for (int threads : {1, 2, 4, 0}) {  // 0: a job system
    CAPTURE(threads);
    std::atomic<int> calls{0};
    int last = 1 << 30;
    ism::Options options = options_of((std::max)(threads, 1), 3);
    if (threads == 0) options.parallel_for = two_threads;
    options.measure = {[&](double S, double d) {
                         if (++calls > last) throw Refusal();
                         return ism::arap().density(S, d);
                       },
                       1, 0};
    const std::size_t before = memory_in_use();
    CHECK(ism::is_usable(ism::compute_map(a.mesh, b.mesh, kLandmarks, options).status));
    const int all = calls;
    for (int part = 1; part < 8; ++part) {
      calls = 0;
      last = all / 8 * part;
      CHECK_THROWS_AS(ism::compute_map(a.mesh, b.mesh, kLandmarks, options), Refusal);
    }
    CHECK(memory_in_use() == before);
  }
}

TEST_CASE("what a progress callback throws reaches the caller") {
  const auto [a, b] = pair();
  for (int last = 0; last < 12; ++last) {
    int calls = 0;
    ism::Options options = options_of(2, 12);
    options.progress = [&](const ism::Progress&) {
      if (calls++ == last) throw Refusal();
      return true;
    };
    const std::size_t before = memory_in_use();
    CHECK_THROWS_AS(ism::compute_map(a.mesh, b.mesh, kLandmarks, options), Refusal);
    CHECK(memory_in_use() == before);
  }
}

TEST_CASE("where memory ends, bad_alloc reaches the caller and nothing is leaked") {
  const auto [a, b] = pair();
  for (int threads : {1, 3}) {
    CAPTURE(threads);
    const ism::Options options = options_of(threads, 2);
    const auto run = [&] { ism::compute_map(a.mesh, b.mesh, kLandmarks, options); };
    run();
    const std::size_t before = memory_in_use();
    std::size_t all = allocations();
    run();
    all = allocations() - all;
    REQUIRE(memory_in_use() == before);
    int failed = 0;
    for (std::size_t i = 0; i < all; i += 1 + all / 200) {
      fail_allocation(i);
      try {
        run();
      } catch (const std::bad_alloc&) {
        ++failed;
      }
      fail_allocation(kNever);
      REQUIRE(memory_in_use() == before);
    }
    CHECK(failed > 150);
  }
}

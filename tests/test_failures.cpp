// Memory, threads and callbacks that fail: whatever a call meets, its caller hears of it, nothing
// is leaked and no thread is left. And how much memory and stack there must be.

#include "allocations.hpp"
#include "ism.hpp"
#include "sanitized.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
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
#include <sys/mman.h>
#include <cerrno>
#include <cstring>
#ifdef __GLIBC__
#endif
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
    options.candidates = threads == 2;
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
  const auto disks = pair();
  const shapes::Disk &a = disks.first, &b = disks.second;
  for (int threads : {1, 2, 3}) {
    CAPTURE(threads);
    ism::Options options = options_of(threads, 2);
    options.candidates = threads == 2;  // which take much of the time
    const std::size_t stops = options.candidates ? 50 : 200;
    const auto run = [&] { ism::compute_map(a.mesh, b.mesh, kLandmarks, options); };
    run();
    const std::size_t before = memory_in_use();
    std::size_t all = allocations();
    run();
    all = allocations() - all;
    REQUIRE(memory_in_use() == before);
    int failed = 0;
    for (std::size_t i = 0; i < all; i += 1 + all / stops) {
      fail_allocation(i);
      try {
        run();
      } catch (const std::bad_alloc&) {
        ++failed;
      }
      fail_allocation(kNever);
      REQUIRE(memory_in_use() == before);
    }
    CHECK(4 * failed > 3 * static_cast<int>(stops));
  }
}

// Sanitizers take memory and stack of their own.
#if defined(__GLIBC__) && !defined(ISM_TEST_SANITIZED)
namespace {

/// A thread's stack that shows how much of it was used.
class PaintedStack {
 public:
  PaintedStack()
      : bytes_(static_cast<unsigned char*>(
            mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0))) {
    paint();
    run([] {});
    of_thread_ = touched();
    paint();
  }
  PaintedStack(const PaintedStack&) = delete;
  PaintedStack& operator=(const PaintedStack&) = delete;
  ~PaintedStack() { munmap(bytes_, kSize); }

  void run(const std::function<void()>& work) {
    pthread_attr_t attributes;
    pthread_attr_init(&attributes);
    pthread_attr_setstack(&attributes, bytes_, kSize);
    pthread_t thread;
    const auto call = [](void* f) -> void* {
      (*static_cast<const std::function<void()>*>(f))();
      return nullptr;
    };
    REQUIRE(pthread_create(&thread, &attributes, call,
                           const_cast<void*>(static_cast<const void*>(&work))) == 0);
    pthread_join(thread, nullptr);
    pthread_attr_destroy(&attributes);
  }

  /// By all runs so far, beyond what a thread takes that does nothing.
  std::size_t used() const { return touched() - of_thread_; }

 private:
  static constexpr std::size_t kSize = 1 << 20;
  static constexpr unsigned char kPaint = 0x5a;

  void paint() { std::memset(bytes_, kPaint, kSize); }
  std::size_t touched() const {  // stacks grow downwards
    return kSize - static_cast<std::size_t>(
                       std::find_if(bytes_, bytes_ + kSize,
                                    [](unsigned char byte) { return byte != kPaint; }) -
                       bytes_);
  }

  unsigned char* bytes_;
  std::size_t of_thread_ = 0;
};

struct Kind {
  std::string name;
  ism::Options options;
};

/// Runs that differ in the code they pass through.
std::vector<Kind> kinds_of_runs() {
  const ism::Options options = options_of(1, 3);
  std::vector<Kind> all(6, Kind{"free", options});
  all[1].name = "exact landmarks";
  all[1].options.exact_landmarks = true;
  all[2].name = "fixed boundaries";
  all[2].options.boundary = ism::Boundary::kFixed;
  all[3].name = "sliding boundaries, exact landmarks";
  all[3].options.boundary = ism::Boundary::kSlide;
  all[3].options.exact_landmarks = true;
  all[4].name = "pins";
  all[4].options.pins_a = {100};
  all[5].name = "another measure";
  all[5].options.measure = ism::sarap();
  return all;
}

/// Smooth enough for fronts whose products Eigen packs into blocks.
std::pair<shapes::Disk, shapes::Disk> large_pair(int n) {
  shapes::Rng rng(5);
  std::pair<shapes::Disk, shapes::Disk> disks = {shapes::perturbed_grid(n, n, 0.2, rng),
                                                 shapes::perturbed_grid(n - 3, n - 2, 0.2, rng)};
  disks.first.mesh.vertices *= 8.0 / n;  // bent by as much, whatever n
  disks.second.mesh.vertices *= 8.0 / n;
  for (shapes::Disk* disk : {&disks.first, &disks.second})
    for (int v = 0; v < disk->mesh.vertices.rows(); ++v)
      disk->mesh.vertices(v, 2) = 0.5 * std::sin(disk->mesh.vertices(v, 0));
  return disks;
}

}  // namespace

TEST_CASE("a task takes at most 64 KB of stack, and so does the calling thread") {
  const auto disks = large_pair(30);
  const shapes::Disk &a = disks.first, &b = disks.second;
  const int n = static_cast<int>(a.mesh.vertices.rows()),
            m = static_cast<int>(b.mesh.vertices.rows());
  const std::vector<ism::Landmark> landmarks = {{n / 3, m / 3}, {2 * n / 3 + 5, 2 * m / 3 + 5}};
  for (const Kind& kind : kinds_of_runs()) {
    CAPTURE(kind.name);
    PaintedStack task_stack, call_stack;
    ism::Options options = kind.options;
    options.parallel_for = [&](int count, const std::function<void(int)>& task) {
      task_stack.run([&] {
        for (int i = 0; i < count; ++i) task(i);
      });
    };
    ism::Result result;
    call_stack.run([&] { result = ism::compute_map(a.mesh, b.mesh, landmarks, options); });
    INFO(result.message);
    CHECK(ism::is_usable(result.status));
    CHECK(task_stack.used() > 1000);
    CHECK(task_stack.used() <= 64 * 1024);
    CHECK(call_stack.used() <= 64 * 1024);
  }
}
#endif

// The same bits, run to run and for any number of threads, of whole runs that are large enough for
// several tasks in every part. tests/bits/ compares compilers and systems.

#include "ism.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <utility>
#include <vector>

namespace {

/// FNV-1a of the bits of numbers.
class Hash {
 public:
  void add(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) value_ = (value_ ^ bytes[i]) * 0x100000001b3;
  }
  template <class Matrix>
  void add(const Matrix& m) {
    add(m.data(), static_cast<std::size_t>(m.size()) * sizeof(*m.data()));
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325;
};

struct Problem {
  const char* name;
  ism::TriangleMesh a, b;
  std::vector<ism::Landmark> landmarks;
  ism::Options options;
};

/// Of the positions, the log and the meta mesh.
std::uint64_t bits_of_run(const Problem& p, int threads) {
  ism::Options options = p.options;
  options.threads = threads;
  const ism::Result result = ism::compute_map(p.a, p.b, p.landmarks, options);
  CAPTURE(result.message);
  REQUIRE(ism::is_usable(result.status));
  Hash hash;
  hash.add(result.f);
  hash.add(result.g);
  for (const ism::IterationLog& log : result.log) hash.add(&log.energy, sizeof log.energy);
  const ism::MetaMesh meta = ism::SurfaceMap(result).meta_mesh();
  hash.add(meta.corner_a);
  hash.add(meta.corner_b);
  hash.add(meta.face_a.data(), meta.face_a.size() * sizeof(int));
  return hash.value();
}

std::pair<shapes::Disk, shapes::Disk> squares(int n) {
  shapes::Rng rng(11);
  shapes::Disk a = shapes::perturbed_grid(n, n, 0.2, rng);
  shapes::Disk b = shapes::perturbed_grid(n - 4, n + 4, 0.2, rng);
  shapes::bend(a, 0.5);
  shapes::bend(b, -0.4);
  return {a, b};
}

std::vector<Problem> problems() {
  const auto [a, b] = squares(18);
  ism::Options few;
  few.max_iterations = 4;
  std::vector<Problem> all = {
      {"coarse to fine", a.mesh, b.mesh, {{100, 150}}, few},
      {"sliding", a.mesh, b.mesh, {{100, 150}}, few},
      {"exact landmarks", a.mesh, b.mesh, {{100, 150}, {300, 200}}, few},
      {"closed", shapes::sphere(1), shapes::sphere(2), {{3, 5}, {7, 9}, {10, 1}}, few}};
  all[0].options.coarsest = 200;
  all[1].options.boundary = ism::Boundary::kSlide;
  all[2].options.exact_landmarks = true;
  return all;
}

}  // namespace

TEST_CASE("whole runs are the same bits for any number of threads, run to run") {
  for (const Problem& p : problems()) {
    CAPTURE(p.name);
    const std::uint64_t bits = bits_of_run(p, 1);
    std::printf("%s: %016llx\n", p.name, static_cast<unsigned long long>(bits));
    for (int threads : {1, 2, 3, 7}) {
      CAPTURE(threads);
      CHECK(bits_of_run(p, threads) == bits);
    }
  }
}

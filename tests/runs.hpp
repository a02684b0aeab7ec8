// Runs of the optimisation and maps, for the tests.

#ifndef ISM_TESTS_RUNS_HPP
#define ISM_TESTS_RUNS_HPP

#include "ism.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <utility>

namespace runs {

/// Small meshes gain nothing from threads, and results do not depend on them.
inline ism::Options on_one_thread(ism::Options options = {}) {
  options.threads = 1;
  return options;
}

inline ism::Options given_planes(const shapes::Disk& a, const shapes::Disk& b) {
  return on_one_thread(shapes::from_planes(a, b));
}

inline ism::SurfaceMap good_map(const shapes::Disk& a, const shapes::Disk& b) {
  const ism::SurfaceMap map = shapes::map_of(a, b);
  REQUIRE(map.status() == ism::Status::kDone);
  return map;
}

/// Two meshes of one square, which cover each other; bent.
inline std::pair<shapes::Disk, shapes::Disk> square_pair(std::uint64_t seed) {
  shapes::Rng rng(seed);
  shapes::Disk a = shapes::perturbed_grid(8, 8, 0.2, rng);
  shapes::Disk b = shapes::perturbed_grid(10, 10, 0.2, rng);
  b.plane *= 0.8;
  b.mesh.vertices *= 0.8;
  shapes::bend(a, 0.5);
  shapes::bend(b, -0.4);
  return {a, b};
}

}  // namespace runs

#endif  // ISM_TESTS_RUNS_HPP

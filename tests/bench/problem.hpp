// What the programs that measure are run on.

#ifndef ISM_TESTS_BENCH_PROBLEM_HPP
#define ISM_TESTS_BENCH_PROBLEM_HPP

#include "ism.hpp"
#include "mesh_io.hpp"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace bench {

using Clock = std::chrono::steady_clock;

inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

[[noreturn]] inline void fail(const std::string& message) {
  std::fprintf(stderr, "error: %s\n", message.c_str());
  std::exit(2);
}

struct Problem {
  std::string name;
  ism::TriangleMesh a, b;
  std::vector<ism::Landmark> landmarks;
};

inline ism::TriangleMesh read_mesh(const std::string& path) {
  mesh_io::ReadResult result = mesh_io::read_mesh(path);
  if (!result.ok) fail(result.error);
  return result.mesh;
}

/// Two meshes, and landmarks if there is a third file.
inline Problem read_problem(const std::vector<std::string>& files) {
  if (files.size() < 2 || files.size() > 3) fail("give two meshes, and landmarks if any");
  Problem problem = {files[0] + " " + files[1], read_mesh(files[0]), read_mesh(files[1]), {}};
  if (files.size() == 2) return problem;
  const mesh_io::PairsResult pairs = mesh_io::read_pairs(files[2]);
  if (!pairs.ok) fail(pairs.error);
  problem.landmarks = mesh_io::landmarks_of(pairs);
  return problem;
}

}  // namespace bench

#endif  // ISM_TESTS_BENCH_PROBLEM_HPP

// Maps pairs of meshes and prints a hash of the positions for each; builds by all compilers, for
// all systems, print the same (compare.sh).
//   hashes ITERATIONS PAIR...   folders of A.obj, B.obj and landmarks.txt; `bent` and `closed` are
//                               small pairs made here

#define ISM_IMPLEMENTATION
#include "ism.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace {

/// FNV-1a of the bits of numbers.
class Hash {
 public:
  void add(double x) {
    std::uint64_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    for (int i = 0; i < 64; i += 8) value_ = (value_ ^ (bits >> i & 255)) * 0x100000001b3;
  }
  template <class Matrix>
  void add_all(const Matrix& m) {
    for (Eigen::Index i = 0; i < m.rows(); ++i)
      for (Eigen::Index j = 0; j < m.cols(); ++j) add(static_cast<double>(m(i, j)));
  }
  unsigned long long value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325;
};

struct Pair {
  ism::TriangleMesh a, b;
  std::vector<ism::Landmark> landmarks;
};

ism::TriangleMesh mesh_of(const std::vector<std::array<double, 3>>& points,
                          const std::vector<std::array<int, 3>>& triangles) {
  ism::TriangleMesh mesh;
  mesh.vertices.resize(static_cast<Eigen::Index>(points.size()), 3);
  mesh.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  Eigen::Index row = 0;
  for (const auto& p : points) mesh.vertices.row(row++) << p[0], p[1], p[2];
  row = 0;
  for (const auto& t : triangles) mesh.triangles.row(row++) << t[0], t[1], t[2];
  return mesh;
}

/// Calls line(text) for each line of a file.
template <class Line>
void read_lines(const std::string& path, const Line& line) {
  std::FILE* file = std::fopen(path.c_str(), "r");
  if (file == nullptr) {
    std::fprintf(stderr, "cannot read %s\n", path.c_str());
    std::exit(1);
  }
  char text[1000];
  while (std::fgets(text, sizeof text, file) != nullptr) line(text);
  std::fclose(file);
}

ism::TriangleMesh read_obj(const std::string& path) {
  std::vector<std::array<double, 3>> points;
  std::vector<std::array<int, 3>> triangles;
  read_lines(path, [&](const char* text) {
    std::array<double, 3> p;
    std::array<int, 3> t;
    if (std::sscanf(text, "v %lf %lf %lf", &p[0], &p[1], &p[2]) == 3) points.push_back(p);
    if (std::sscanf(text, "f %d %d %d", &t[0], &t[1], &t[2]) == 3)
      triangles.push_back({t[0] - 1, t[1] - 1, t[2] - 1});
  });
  return mesh_of(points, triangles);
}

Pair read_pair(const std::string& folder) {
  Pair pair = {read_obj(folder + "/A.obj"), read_obj(folder + "/B.obj"), {}};
  read_lines(folder + "/landmarks.txt", [&](const char* text) {
    int a, b;
    if (std::sscanf(text, "%d %d", &a, &b) == 2) pair.landmarks.push_back({a, b});
  });
  return pair;
}

/// A sphere of 8 · 4^levels triangles, scaled along its axes and bent; vertices 0 to 5 are poles.
ism::TriangleMesh potato(int levels, double x, double y, double z, double bend) {
  std::vector<std::array<double, 3>> points = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1},
                                               {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  std::vector<std::array<int, 3>> triangles = {{0, 1, 2}, {1, 3, 2}, {3, 4, 2}, {4, 0, 2},
                                               {1, 0, 5}, {3, 1, 5}, {4, 3, 5}, {0, 4, 5}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<int, int>, int> middle;
    const auto between = [&](int i, int j) {
      const auto [at, is_new] =
          middle.insert({std::minmax({i, j}), static_cast<int>(points.size())});
      if (!is_new) return at->second;
      std::array<double, 3> p;
      double squares = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        p[c] = points[static_cast<std::size_t>(i)][c] + points[static_cast<std::size_t>(j)][c];
        squares += p[c] * p[c];
      }
      // Of so few digits, so that no flags change the products below.
      for (double& x : p) x = std::round(x / std::sqrt(squares) * 0x1p20) * 0x1p-20;
      points.push_back(p);
      return at->second;
    };
    std::vector<std::array<int, 3>> finer;
    for (const auto& [i, j, k] : triangles) {
      const int a = between(j, k), b = between(k, i), c = between(i, j);
      for (const std::array<int, 3>& t :
           {std::array<int, 3>{i, c, b}, {c, j, a}, {b, a, k}, {a, b, c}})
        finer.push_back(t);
    }
    triangles = finer;
  }
  for (auto& p : points) p = {x * p[0] + bend * (p[1] * p[1]), y * p[1], z * p[2]};
  return mesh_of(points, triangles);
}

Pair closed_pair() {
  return {
      potato(2, 1, 0.75, 1.25, 0.25), potato(2, 1.25, 1, 0.875, -0.25), {{0, 0}, {1, 1}, {2, 2}}};
}

/// A grid of n × n vertices in a unit square, bent.
ism::TriangleMesh bent_square(int n, double bend) {
  std::vector<std::array<double, 3>> points;
  std::vector<std::array<int, 3>> triangles;
  for (int i = 0; i < n * n; ++i) {
    const double x = i % n * 0x1p-4, y = i / n * 0x1p-4;
    points.push_back({x, y, bend * (x * y * y)});
    if (i % n + 1 == n || i / n + 1 == n) continue;
    triangles.push_back({i, i + 1, i + n});
    triangles.push_back({i + 1, i + n + 1, i + n});
  }
  return mesh_of(points, triangles);
}

Pair bent_pair() { return {bent_square(12, 0.75), bent_square(14, -0.5), {{13, 15}, {80, 106}}}; }

}  // namespace

int main(int n, char** arguments) {
  for (int i = 2; i < n; ++i) {
    const std::string name = arguments[i];
    const bool is_small = name == "closed" || name == "bent";
    const Pair pair = !is_small ? read_pair(name) : name == "bent" ? bent_pair() : closed_pair();
    Hash input, output;
    input.add_all(pair.a.vertices);
    input.add_all(pair.b.vertices);
    ism::Options options;
    options.max_iterations = std::atoi(arguments[1]);
    options.threads = 2;
    if (is_small) options.coarsest = 50;
    const ism::Result result = ism::compute_map(pair.a, pair.b, pair.landmarks, options);
    output.add_all(result.f);
    output.add_all(result.g);
    for (const ism::IterationLog& log : result.log) output.add(log.energy);
    std::printf("%s: of %016llx in %d iterations %016llx, distortion %.6f\n", name.c_str(),
                input.value(), static_cast<int>(result.log.size()), output.value(),
                result.log.empty() ? 0.0 : result.final_state().mean_distortion);
    if (!ism::is_usable(result.status)) {
      std::fprintf(stderr, "%s\n", result.message.c_str());
      return 1;
    }
    std::fflush(stdout);
  }
}

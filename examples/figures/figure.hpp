// figure.hpp: what the programs that redraw the paper's figures have in common.
//
//   FIGURE [PAIR [PICTURE]] [--iterations N]
//
// PAIR is a folder with A.obj, B.obj and landmarks.txt, by default one of data/; PICTURE a PNG
// file, by default named after the program, in the folder it is started from.

#ifndef ISM_EXAMPLES_FIGURE_HPP
#define ISM_EXAMPLES_FIGURE_HPP

#include "ism.hpp"
#include "mesh_io.hpp"
#include "render.hpp"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <unistd.h>  // isatty

namespace figure {

[[noreturn]] inline void fail(const std::string& message) {
  std::fprintf(stderr, "%s\n", message.c_str());
  std::exit(1);
}

struct Arguments {
  std::string pair, picture;
  ism::Options options;
};

inline Arguments read_arguments(int argc, char** argv, const std::string& pair,
                                const std::string& picture) {
  Arguments args = {std::string(ISM_SOURCE_DIR) + "/data/" + pair, picture, {}};
  int names = 0;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    long long n = 0;
    if (word == "--iterations") {
      if (++i == argc || !mesh_io::parse_integer(argv[i], n) || n < 0 || n > 100000)
        fail("--iterations needs a number");
      args.options.max_iterations = static_cast<int>(n);
    } else if (word[0] == '-' || ++names > 2) {
      fail("usage: " + std::string(argv[0]) + " [PAIR [PICTURE]] [--iterations N]");
    } else {
      (names == 1 ? args.pair : args.picture) = word;
    }
  }
  return args;
}

struct Pair {
  ism::TriangleMesh a, b;
  std::vector<std::array<int, 2>> edges_a;  // of the polygons of A
  std::vector<ism::Landmark> landmarks;
};

inline Pair read_pair(const std::string& folder) {
  const mesh_io::ReadResult a = mesh_io::read_mesh(folder + "/A.obj");
  const mesh_io::ReadResult b = mesh_io::read_mesh(folder + "/B.obj");
  const mesh_io::PairsResult pairs = mesh_io::read_pairs(folder + "/landmarks.txt");
  if (!a.ok || !b.ok || !pairs.ok) fail(!a.ok ? a.error : !b.ok ? b.error : pairs.error);
  Pair pair = {a.mesh, b.mesh, a.edges, {}};
  for (const mesh_io::IdPair& p : pairs.pairs)
    pair.landmarks.push_back({static_cast<int>(p.a), static_cast<int>(p.b)});
  return pair;
}

/// Runs the optimisation with a line of progress.
inline ism::Result optimize(const Pair& pair, ism::Options options) {
  const bool is_watched = isatty(STDERR_FILENO) != 0;
  options.progress = [is_watched](const ism::Progress& progress) {
    if (is_watched && progress.iteration != nullptr)
      std::fprintf(stderr, "iteration %3d, distortion %.4f\r", progress.iteration->iteration,
                   progress.iteration->mean_distortion);
    return true;
  };
  const ism::Result result = ism::compute_map(pair.a, pair.b, pair.landmarks, options);
  if (!ism::is_usable(result.status)) fail(result.message);
  std::printf("%s after %zu iterations, distortion %.4f\n", ism::to_string(result.status),
              result.log.size(), result.final_state().mean_distortion);
  return result;
}

inline void save(const std::string& path, const render::Canvas& canvas) {
  const std::string error = mesh_io::write_files({{path, render::png_text(canvas.image())}});
  if (!error.empty()) fail(error);
  std::printf("%s\n", path.c_str());
}

/// The vertices on the boundary of a mesh: tails of half-edges without a twin.
inline std::vector<int> boundary_vertices(const ism::TriangleMesh& mesh) {
  std::set<std::pair<int, int>> edges;
  for (Eigen::Index f = 0; f < mesh.triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      edges.insert({mesh.triangles(f, k), mesh.triangles(f, (k + 1) % 3)});
  std::vector<int> vertices;
  for (const auto& [u, v] : edges)
    if (edges.count({v, u}) == 0) vertices.push_back(u);
  return vertices;
}

/// A view across the direction in which a surface extends least, from outside. What is opposite to
/// the boundary goes up: fingers from a wrist, backs from a hole in a belly; where that does not
/// tell, y does.
inline render::View front_view(const ism::TriangleMesh& mesh, const render::Rect& panel) {
  constexpr double kClear = 0.15;  // of the extent
  const ism::Points3 normals = render::smooth_normals(mesh.vertices, mesh.triangles);
  const ism::Vec3 center = mesh.vertices.colwise().mean().transpose();
  const ism::Points3 from_center = mesh.vertices.rowwise() - center.transpose();
  const Eigen::Matrix3d spread = from_center.transpose() * from_center;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(spread);
  ism::Vec3 front = principal.eigenvectors().col(0);
  if (front.dot(normals.colwise().sum().transpose()) < 0) front = -front;
  ism::Vec3 rim = ism::Vec3::Zero();
  const std::vector<int> boundary = boundary_vertices(mesh);
  for (int v : boundary)
    rim += from_center.row(v).transpose() / static_cast<double>(boundary.size());
  ism::Vec3 up = -rim + rim.dot(front) * front;
  if (up.norm() < kClear * from_center.rowwise().norm().maxCoeff()) {
    up = ism::Vec3::UnitY() - front.y() * front;
    if (up.norm() < kClear) up = principal.eigenvectors().col(2);
  }
  up.normalize();
  Eigen::Matrix3d axes;
  axes.row(0) = up.cross(front).transpose();
  axes.row(1) = up.transpose();
  axes.row(2) = front.transpose();
  return render::look_along(mesh.vertices, axes, panel);
}

}  // namespace figure

#endif  // ISM_EXAMPLES_FIGURE_HPP

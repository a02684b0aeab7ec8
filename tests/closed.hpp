// What a map of two closed surfaces has to be, measured: for the tests and for tests/bench.

#ifndef ISM_TESTS_CLOSED_HPP
#define ISM_TESTS_CLOSED_HPP

#include "ism.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <limits>
#include <map>
#include <utility>
#include <vector>

namespace closed {

/// The meta mesh as a surface without geometry.
struct Topology {
  bool is_manifold =
      false;      // every edge has two polygons, in opposite directions; one fan a vertex
  int euler = 0;  // vertices - edges + polygons
};

inline Topology topology(const ism::MetaMesh& meta) {
  std::map<std::pair<int, int>, int> polygon_of;  // per directed edge
  bool is_manifold = true;
  std::vector<int> degree(static_cast<std::size_t>(meta.on_a.rows()), 0);
  std::map<std::pair<int, int>, int> next_around;  // (vertex, tip) to the tip of the next edge
  for (int p = 0; p < meta.n_polygons(); ++p) {
    const int begin = meta.offsets[static_cast<std::size_t>(p)];
    const int n = meta.offsets[static_cast<std::size_t>(p) + 1] - begin;
    is_manifold = is_manifold && n >= 3;
    for (int i = 0; i < n; ++i) {
      const auto corner = [&](int k) {
        return meta.corners[static_cast<std::size_t>(begin + (i + k) % n)];
      };
      const int before = corner(n - 1), at = corner(0), after = corner(1);
      is_manifold = is_manifold && polygon_of.insert({{at, after}, p}).second && at != after;
      next_around[{at, after}] = before;
      ++degree[static_cast<std::size_t>(at)];
    }
  }
  for (const auto& edge : polygon_of)
    is_manifold = is_manifold && polygon_of.count({edge.first.second, edge.first.first}) == 1;
  for (std::size_t v = 0; v < degree.size() && is_manifold; ++v) {
    const auto first = next_around.lower_bound({static_cast<int>(v), -1});
    if (first == next_around.end() || first->first.first != static_cast<int>(v)) {
      is_manifold = false;
      break;
    }
    int turns = 0, tip = first->first.second;
    do {
      const auto next = next_around.find({static_cast<int>(v), tip});
      if (next == next_around.end()) break;
      tip = next->second;
    } while (++turns <= degree[v] && tip != first->first.second);
    is_manifold = is_manifold && turns == degree[v];
  }
  return {is_manifold, static_cast<int>(meta.on_a.rows()) -
                           static_cast<int>(polygon_of.size()) / 2 + meta.n_polygons()};
}

inline double area(const ism::TriangleMesh& mesh) {
  double sum = 0;
  for (int f = 0; f < mesh.triangles.rows(); ++f) {
    const Eigen::Vector3d a = mesh.vertices.row(mesh.triangles(f, 0));
    const Eigen::Vector3d b = mesh.vertices.row(mesh.triangles(f, 1));
    const Eigen::Vector3d c = mesh.vertices.row(mesh.triangles(f, 2));
    sum += 0.5 * (b - a).cross(c - a).norm();
  }
  return sum;
}

/// Of the polygons, as fans.
inline double area(const ism::MetaMesh& meta, const ism::Points3& x) {
  double sum = 0;
  for (int p = 0; p < meta.n_polygons(); ++p) {
    const int begin = meta.offsets[static_cast<std::size_t>(p)];
    const int end = meta.offsets[static_cast<std::size_t>(p) + 1];
    const auto at = [&](int i) -> Eigen::Vector3d {
      return x.row(meta.corners[static_cast<std::size_t>(i)]);
    };
    for (int i = begin + 1; i + 1 < end; ++i)
      sum += 0.5 * (at(i) - at(begin)).cross(at(i + 1) - at(begin)).norm();
  }
  return sum;
}

inline double diagonal(const ism::TriangleMesh& mesh) {
  const Eigen::Vector3d lo = mesh.vertices.colwise().minCoeff();
  const Eigen::Vector3d hi = mesh.vertices.colwise().maxCoeff();
  return (hi - lo).norm();
}

/// The largest distance of a vertex of A from where it comes to on the way to B and back, in
/// diagonals; infinite if one has no image.
inline double round_trip(const ism::SurfaceMap& map) {
  const ism::TriangleMesh& a = map.mesh(ism::Side::kA);
  double largest = 0;
  for (int v = 0; v < a.vertices.rows(); ++v) {
    const ism::SurfacePoint image = map.forward_vertex(v);
    const ism::SurfacePoint back = image.exists() ? map.backward(image) : image;
    if (!back.exists()) return std::numeric_limits<double>::infinity();
    const Eigen::Vector3d x = a.vertices.row(v);
    largest = std::max(largest, (map.position_on_a(back) - x).norm());
  }
  return largest / diagonal(a);
}

/// Vertices within some edges of the cut, which has copies.
inline std::vector<char> near_cut(const ism::TriangleMesh& mesh,
                                   const std::vector<ism::AddedVertex>& added, int rings) {
  std::vector<char> is_near(static_cast<std::size_t>(mesh.vertices.rows()), 0);
  const int first = static_cast<int>(mesh.vertices.rows()) - static_cast<int>(added.size());
  for (std::size_t i = 0; i < added.size(); ++i) {
    if (added[i].corners[1] >= 0) continue;
    is_near[static_cast<std::size_t>(first) + i] = 1;
    is_near[static_cast<std::size_t>(added[i].corners[0])] = 1;
  }
  for (int ring = 0; ring < rings; ++ring) {
    const std::vector<char> before = is_near;
    for (int f = 0; f < mesh.triangles.rows(); ++f)
      for (int k = 0; k < 9; ++k)
        if (before[static_cast<std::size_t>(mesh.triangles(f, k / 3))])
          is_near[static_cast<std::size_t>(mesh.triangles(f, k % 3))] = 1;
  }
  return is_near;
}

/// Density that 95% of the area stay below, within two rings of edges of the cut on A or B, and in
/// the rest.
struct CutDistortion {
  double near = 0, rest = 0;
};

inline CutDistortion cut_distortion(const ism::Result& result, const ism::SurfaceMap& map) {
  const ism::MetaMesh meta = map.meta_mesh(ism::Ids::kEmbedded);
  const std::vector<ism::PolygonDistortion> polygons = map.distortion();
  const std::vector<char> at_a = near_cut(*result.start.a, result.start.added_a, 1);
  const std::vector<char> at_b = near_cut(*result.start.b, result.start.added_b, 1);
  const auto touches = [](const ism::TriangleMesh& mesh, int f, const std::vector<char>& at) {
    return at[static_cast<std::size_t>(mesh.triangles(f, 0))] ||
           at[static_cast<std::size_t>(mesh.triangles(f, 1))] ||
           at[static_cast<std::size_t>(mesh.triangles(f, 2))];
  };
  std::vector<ism::PolygonDistortion> near, rest;
  for (std::size_t p = 0; p < polygons.size(); ++p)
    (touches(*meta.a, meta.face_a[p], at_a) || touches(*meta.b, meta.face_b[p], at_b) ? near : rest)
        .push_back(polygons[p]);
  return {ism::summarize(near).p95, ism::summarize(rest).p95};
}

}  // namespace closed

#endif  // ISM_TESTS_CLOSED_HPP

// landmarks.hpp: landmarks of ism.hpp as people have them, ids of vertices or points in space. Part
// of the examples of ism.hpp.
//
//   std::vector<ism::Landmark> list;
//   const std::string error = landmarks::read("landmarks.txt", a, b, list);

#ifndef ISM_EXAMPLES_LANDMARKS_HPP
#define ISM_EXAMPLES_LANDMARKS_HPP

#include "ism.hpp"
#include "mesh_io.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

namespace landmarks {

/// The point of a surface that is nearest to a point in space, and how far that is: a vertex, if it
/// is within a hundredth of the triangle's edges of one (in files, coordinates have been rounded),
/// else a point in a triangle. No triangle with an area: vertex -1, infinitely far. Cost O(#F).
struct Nearest {
  ism::LandmarkPoint point;
  double distance = std::numeric_limits<double>::infinity();
};
inline Nearest nearest(const ism::TriangleMesh& mesh, const Eigen::Vector3d& p);

/// Where an end of a landmark lies in space.
inline Eigen::Vector3d position(const ism::TriangleMesh& mesh, const ism::LandmarkPoint& p);

/// An end of a landmark in words: "17", "a point in triangle 8".
inline std::string name(const ism::LandmarkPoint& p);

/// A vertex to stand for an end of a landmark: itself, or the nearest corner of its triangle.
inline int nearest_vertex(const ism::TriangleMesh& mesh, const ism::LandmarkPoint& p);

/// Adds the landmarks (and curves) of a file in the form of mesh_io::read_pairs() to those there.
/// Vertices have to exist; a point has to be within a hundredth of the size of its mesh, the
/// diagonal of the bounding box. Returns an empty string, or one sentence that says what is wrong.
inline std::string read(const std::string& path, const ism::TriangleMesh& a,
                        const ism::TriangleMesh& b, std::vector<ism::Landmark>& list,
                        std::vector<ism::Curve>* curves = nullptr);

namespace detail {

/// Barycentric coordinates of the point of a triangle, whose corners are columns, nearest to p.
inline Eigen::Vector3d nearest_in(const Eigen::Matrix3d& corners, const Eigen::Vector3d& normal,
                                  const Eigen::Vector3d& p) {
  const Eigen::Vector3d u = corners.col(1) - corners.col(0), v = corners.col(2) - corners.col(0);
  const Eigen::Vector3d w = p - corners.col(0);
  Eigen::Vector3d best(0, w.cross(v).dot(normal), u.cross(w).dot(normal));
  best /= normal.squaredNorm();
  best[0] = 1 - best[1] - best[2];
  if (best.minCoeff() >= 0) return best;
  double distance = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d from = corners.col(k), along = corners.col((k + 1) % 3) - from;
    const double t = (std::min)((std::max)((p - from).dot(along) / along.squaredNorm(), 0.0), 1.0);
    const double d = (from + t * along - p).squaredNorm();
    if (d >= distance) continue;
    distance = d;
    best = (1 - t) * Eigen::Vector3d::Unit(k) + t * Eigen::Vector3d::Unit((k + 1) % 3);
  }
  return best;
}

/// Finds an end of a landmark on its mesh, A or B. Returns what is wrong.
inline std::string find(const char* mesh_name, const ism::TriangleMesh& mesh,
                        const mesh_io::PairEnd& end, ism::LandmarkPoint& point) {
  constexpr double kFarthest = 0.01;
  const long long n = mesh.vertices.rows();
  if (!end.is_point && (end.id < 0 || end.id >= n))
    return std::string(mesh_name) + " has no vertex " + std::to_string(end.id) +
           ", its ids are 0 to " + std::to_string(n - 1);
  point = static_cast<int>(end.id);
  if (!end.is_point) return {};
  const Nearest found = nearest(mesh, end.point);
  const Eigen::RowVector3d size =
      mesh.vertices.colwise().maxCoeff() - mesh.vertices.colwise().minCoeff();
  point = found.point;
  if (found.distance <= kFarthest * size.norm()) return {};
  char percent[40];
  std::snprintf(percent, sizeof percent, "%.3g%%", 100 * found.distance / size.norm());
  return std::string("the point is ") + percent + " of the size of " + mesh_name + " away from " +
         mesh_name + ", 1% is the most: give it in the coordinates of the file of " + mesh_name +
         ", or as the id of a vertex";
}

/// Finds the vertices of a curve.
inline std::string find(const char* mesh_name, const ism::TriangleMesh& mesh,
                        const std::vector<long long>& ids, std::vector<int>& vertices) {
  std::string error;
  for (long long id : ids) {
    mesh_io::PairEnd end;
    ism::LandmarkPoint point;
    end.id = id;
    if (error.empty()) error = find(mesh_name, mesh, end, point);
    vertices.push_back(point.vertex);
  }
  return error;
}

}  // namespace detail

inline Nearest nearest(const ism::TriangleMesh& mesh, const Eigen::Vector3d& p) {
  constexpr double kAtVertex = 0.99;
  Nearest result;
  for (int f = 0; f < mesh.triangles.rows(); ++f) {
    Eigen::Matrix3d corners;
    for (int k = 0; k < 3; ++k) corners.col(k) = mesh.vertices.row(mesh.triangles(f, k));
    const Eigen::Vector3d in_box =
        p.cwiseMax(corners.rowwise().minCoeff()).cwiseMin(corners.rowwise().maxCoeff());
    if ((in_box - p).norm() >= result.distance) continue;
    const Eigen::Vector3d normal =
        (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0));
    if (!(normal.squaredNorm() > 0)) continue;
    const Eigen::Vector3d weights = detail::nearest_in(corners, normal, p);
    const double distance = (corners * weights - p).norm();
    if (!(distance < result.distance)) continue;
    result.distance = distance;
    int k = 0;
    if (weights.maxCoeff(&k) > kAtVertex)
      result.point = mesh.triangles(f, k);
    else
      result.point = ism::SurfacePoint{f, weights};
  }
  return result;
}

inline Eigen::Vector3d position(const ism::TriangleMesh& mesh, const ism::LandmarkPoint& p) {
  if (p.vertex >= 0) return mesh.vertices.row(p.vertex);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k)
    sum += p.point.barycentric[k] * mesh.vertices.row(mesh.triangles(p.point.face, k)).transpose();
  return sum;
}

inline std::string name(const ism::LandmarkPoint& p) {
  return p.vertex >= 0 ? std::to_string(p.vertex)
                       : "a point in triangle " + std::to_string(p.point.face);
}

inline int nearest_vertex(const ism::TriangleMesh& mesh, const ism::LandmarkPoint& p) {
  if (p.vertex >= 0) return p.vertex;
  const Eigen::RowVector3d at = position(mesh, p).transpose();
  const auto distance = [&](int v) { return (mesh.vertices.row(v) - at).norm(); };
  int best = mesh.triangles(p.point.face, 0);
  for (int k = 1; k < 3; ++k)
    if (distance(mesh.triangles(p.point.face, k)) < distance(best))
      best = mesh.triangles(p.point.face, k);
  return best;
}

inline std::string read(const std::string& path, const ism::TriangleMesh& a,
                        const ism::TriangleMesh& b, std::vector<ism::Landmark>& list,
                        std::vector<ism::Curve>* curves) {
  const mesh_io::PairsResult file = mesh_io::read_pairs(path);
  if (!file.ok) return file.error;
  for (const mesh_io::IdPair& pair : file.pairs) {
    ism::Landmark l;
    std::string error = detail::find("A", a, pair.a, l.a);
    if (error.empty()) error = detail::find("B", b, pair.b, l.b);
    if (!error.empty()) return path + ", line " + std::to_string(pair.line) + ": " + error;
    list.push_back(l);
  }
  for (const mesh_io::IdCurve& curve : file.curves) {
    ism::Curve c;
    std::string error = curves ? "" : "a curve is not expected here";
    if (error.empty()) error = detail::find("A", a, curve.a, c.a);
    if (error.empty()) error = detail::find("B", b, curve.b, c.b);
    if (!error.empty()) return path + ", line " + std::to_string(curve.line) + ": " + error;
    curves->push_back(std::move(c));
  }
  return {};
}

}  // namespace landmarks

#endif  // ISM_EXAMPLES_LANDMARKS_HPP

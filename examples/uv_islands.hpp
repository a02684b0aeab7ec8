// uv_islands.hpp: carries texture coordinates over a map of ism.hpp, along seams too. Part of the
// examples of ism.hpp.
//
//   Eigen::MatrixXd uv_b = uv_islands::carry(map.meta_mesh(), ism::Side::kA, uv_a);
//
// A texture lies on a surface in islands, between which its coordinates jump. A triangle of the
// other mesh that crosses a seam would reach from one island to the next, over all that is between
// them in the image. So each gets one island, continued linearly beyond its border.

#ifndef ISM_EXAMPLES_UV_ISLANDS_HPP
#define ISM_EXAMPLES_UV_ISLANDS_HPP

#include "ism.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

namespace uv_islands {

/// Texture coordinates of the corners of the other mesh, from those of the mesh on side `from`:
/// 3#F×2, corner k of triangle f in row 3 f + k; NaN where there are none.
///
/// What lies on a triangle falls apart where the coordinates jump: between islands, or where one
/// island meets itself, as around a cylinder. The largest part is taken. Corners in it have its
/// values there, so that triangles beside each other fit; the others have those that bring the
/// triangle closest to the part (least squares). There are none (NaN), if more of the triangle lies
/// where `uv` has none, or where the map covers nothing. Cost O(n log n).
inline Eigen::MatrixXd carry(const ism::MetaMesh& meta, ism::Side from, const Eigen::MatrixXd& uv);

namespace detail {

/// A meta mesh as seen from the mesh whose texture coordinates go to the triangles of the other.
struct View {
  const ism::MetaMesh& meta;
  const Eigen::MatrixXd& uv;
  const std::vector<int>& from_face;  // per polygon
  const std::vector<int>& to_face;
  const ism::Points3& from_corner;  // per corner of a polygon
  const ism::Points3& to_corner;

  int begin(int p) const { return meta.offsets[static_cast<std::size_t>(p)]; }
  int end(int p) const { return meta.offsets[static_cast<std::size_t>(p) + 1]; }
  int next(int p, int corner) const { return corner + 1 < end(p) ? corner + 1 : begin(p); }
  int triangle(int p) const { return to_face[static_cast<std::size_t>(p)]; }

  /// How much of its triangle a polygon is.
  double share(int p) const {
    double sum = 0;
    for (int c = begin(p); c < end(p); ++c) {
      const int d = next(p, c);
      sum += to_corner(c, 0) * to_corner(d, 1) - to_corner(d, 0) * to_corner(c, 1);
    }
    return std::abs(sum);
  }
  /// The texture coordinates at a corner of a polygon; NaN if there are none.
  Eigen::RowVector2d at(int p, int corner) const {
    return from_corner.row(corner) * uv.middleRows<3>(3 * from_face[static_cast<std::size_t>(p)]);
  }
};

/// A side of a polygon in a triangle: its vertices, the lower one first, and the corners there.
struct Edge {
  int triangle, polygon;
  std::array<int, 2> vertex, corner;

  std::tuple<int, int, int> place() const { return {triangle, vertex[0], vertex[1]}; }
};

/// The sides of the polygons that have texture coordinates; those in one place are together.
inline std::vector<Edge> edges_of(const View& view) {
  std::vector<Edge> edges;
  for (int p = 0; p < view.meta.n_polygons(); ++p)
    for (int c = view.begin(p); c < view.end(p) && view.at(p, c).allFinite(); ++c) {
      std::array<int, 2> corner = {c, view.next(p, c)};
      const auto vertex = [&](int i) { return view.meta.corners[static_cast<std::size_t>(i)]; };
      if (vertex(corner[0]) > vertex(corner[1])) std::swap(corner[0], corner[1]);
      edges.push_back({view.triangle(p), p, {vertex(corner[0]), vertex(corner[1])}, corner});
    }
  std::sort(edges.begin(), edges.end(), [](const Edge& d, const Edge& e) {
    return std::make_tuple(d.place(), d.polygon) < std::make_tuple(e.place(), e.polygon);
  });
  return edges;
}

/// The end of a chain of representatives, which becomes shorter on the way.
inline int root(std::vector<int>& parent, int p) {
  const auto up = [&](int i) -> int& { return parent[static_cast<std::size_t>(i)]; };
  while (up(p) != p) p = up(p) = up(up(p));
  return p;
}

/// Per polygon, one that stands for all of its triangle to which the coordinates go on without a
/// jump; -1: it has none.
inline std::vector<int> parts_of(const View& view) {
  constexpr double kSame = 1e-6;  // of the largest coordinate: these may have been rounded
  const double size =
      view.uv.unaryExpr([](double x) { return std::isfinite(x) ? std::abs(x) : 0; }).maxCoeff();
  std::vector<int> part(static_cast<std::size_t>(view.meta.n_polygons()));
  std::iota(part.begin(), part.end(), 0);
  const std::vector<Edge> edges = edges_of(view);
  for (std::size_t i = 1; i < edges.size(); ++i) {
    const Edge &d = edges[i - 1], &e = edges[i];
    const auto jump = [&](std::size_t k) {
      return (view.at(d.polygon, d.corner[k]) - view.at(e.polygon, e.corner[k])).norm();
    };
    if (d.place() == e.place() && (std::max)(jump(0), jump(1)) <= kSame * size)
      part[static_cast<std::size_t>(root(part, e.polygon))] = root(part, d.polygon);
  }
  for (int p = 0; p < view.meta.n_polygons(); ++p)
    part[static_cast<std::size_t>(p)] = view.at(p, view.begin(p)).allFinite() ? root(part, p) : -1;
  return part;
}

/// Polygons of one part of a triangle.
struct Part {
  const int *begin, *end;
  double share;
};

/// The values at the corners of a triangle of the affine function that is closest to a part of it,
/// and has the same values at corners that are in the part.
inline Eigen::Matrix<double, 3, 2> fit(const View& view, const Part& part) {
  constexpr double kAtCorner = 1 - 1e-9;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero(), exact = right;
  Eigen::Vector3i is_exact = {0, 0, 0};
  for (const int* p = part.begin; p != part.end; ++p)
    for (int c = view.begin(*p); c < view.end(*p); ++c) {
      const double weight = view.share(*p) / (view.end(*p) - view.begin(*p));
      const Eigen::RowVector3d b = view.to_corner.row(c);
      normal += weight * b.transpose() * b;
      right += weight * b.transpose() * view.at(*p, c);
      Eigen::Index k = 0;
      if (b.maxCoeff(&k) < kAtCorner) continue;
      is_exact[k] = 1;
      exact.row(k) = view.at(*p, c);
    }
  for (int k = 0; k < 3; ++k)
    if (is_exact[k]) {
      normal.row(k) = Eigen::RowVector3d::Unit(k);
      right.row(k) = exact.row(k);
    }
  return normal.fullPivLu().solve(right);
}

}  // namespace detail

inline Eigen::MatrixXd carry(const ism::MetaMesh& meta, ism::Side from, const Eigen::MatrixXd& uv) {
  const bool is_a = from == ism::Side::kA;
  const detail::View view = {meta,
                             uv,
                             is_a ? meta.face_a : meta.face_b,
                             is_a ? meta.face_b : meta.face_a,
                             is_a ? meta.corner_a : meta.corner_b,
                             is_a ? meta.corner_b : meta.corner_a};
  const std::vector<int> parts = detail::parts_of(view);
  const auto part_of = [&](int p) { return parts[static_cast<std::size_t>(p)]; };
  std::vector<int> order(parts.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int p, int q) {
    return std::make_tuple(view.triangle(p), part_of(p), p) <
           std::make_tuple(view.triangle(q), part_of(q), q);
  });

  Eigen::MatrixXd result = Eigen::MatrixXd::Constant(
      3 * (is_a ? *meta.b : *meta.a).triangles.rows(), 2, std::numeric_limits<double>::quiet_NaN());
  const int *p = order.data(), *const end = p + order.size();
  while (p != end) {
    const int triangle = view.triangle(*p);
    detail::Part best = {p, p, 0};
    double without = 1;  // how much of the triangle has no texture coordinates
    while (p != end && view.triangle(*p) == triangle) {
      detail::Part part = {p, p, 0};
      for (; part.end != end && view.triangle(*part.end) == triangle &&
             part_of(*part.end) == part_of(*p);
           ++part.end)
        part.share += view.share(*part.end);
      p = part.end;
      if (part_of(*part.begin) < 0) continue;
      without -= part.share;
      if (part.share > best.share) best = part;
    }
    if (best.share > without) result.middleRows<3>(3 * triangle) = detail::fit(view, best);
  }
  return result;
}

}  // namespace uv_islands

#endif  // ISM_EXAMPLES_UV_ISLANDS_HPP

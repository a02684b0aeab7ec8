// Texture coordinates with seams, carried to another mesh (examples/uv_islands.hpp).

#include "ism.hpp"
#include "uv_islands.hpp"

#include <doctest/doctest.h>

#include <Eigen/LU>
#include <Eigen/SVD>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using ism::Points2;
using ism::Side;
using ism::SurfaceMap;
using ism::TriangleMesh;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// nx × ny rectangles over the unit square, moved by some way, each of two triangles.
TriangleMesh grid(int nx, int ny, bool is_falling, double moved = 0) {
  TriangleMesh mesh;
  mesh.vertices.resize((nx + 1) * (ny + 1), 3);
  mesh.triangles.resize(2 * nx * ny, 3);
  for (int j = 0; j <= ny; ++j)
    for (int i = 0; i <= nx; ++i)
      mesh.vertices.row(i + j * (nx + 1)) << moved + i / double(nx), j / double(ny), 0;
  for (int j = 0, f = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i, f += 2) {
      const int v = i + j * (nx + 1), up = v + nx + 1;
      if (is_falling)
        mesh.triangles.middleRows(f, 2) << v, v + 1, up, v + 1, up + 1, up;
      else
        mesh.triangles.middleRows(f, 2) << v, v + 1, up + 1, v, up + 1, up;
    }
  return mesh;
}

Points2 flat(const TriangleMesh& mesh) { return mesh.vertices.leftCols(2); }

Vector2d corner(const TriangleMesh& mesh, Eigen::Index c) {
  return mesh.vertices.row(mesh.triangles(c / 3, c % 3)).head(2).transpose();
}

Vector2d middle(const TriangleMesh& mesh, Eigen::Index f) {
  return (corner(mesh, 3 * f) + corner(mesh, 3 * f + 1) + corner(mesh, 3 * f + 2)) / 3;
}

using Layout = std::function<Vector2d(const Vector2d& place, const Vector2d& middle)>;

/// Texture coordinates that depend on where a corner is, and the middle of its triangle.
MatrixXd lay_out(const TriangleMesh& mesh, const Layout& layout) {
  MatrixXd uv(3 * mesh.triangles.rows(), 2);
  for (Eigen::Index c = 0; c < uv.rows(); ++c)
    uv.row(c) = layout(corner(mesh, c), middle(mesh, c / 3)).transpose();
  return uv;
}

Vector2d left(const Vector2d& x) { return x; }
Vector2d right(const Vector2d& x) { return {5 - 2 * x.y(), 3 + 2 * x.x()}; }

/// The part of a triangle that has x < limit.
double share_below(const TriangleMesh& mesh, Eigen::Index f, double limit) {
  std::vector<Vector2d> polygon;
  for (int k = 0; k < 3; ++k) {
    const Vector2d p = corner(mesh, 3 * f + k), q = corner(mesh, 3 * f + (k + 1) % 3);
    if (p.x() < limit) polygon.push_back(p);
    if ((p.x() < limit) != (q.x() < limit))
      polygon.push_back(p + (limit - p.x()) / (q.x() - p.x()) * (q - p));
  }
  const auto area = [](const Vector2d& a, const Vector2d& b, const Vector2d& c) {
    return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
  };
  double sum = 0;
  for (std::size_t i = 2; i < polygon.size(); ++i)
    sum += area(polygon[0], polygon[i - 1], polygon[i]);
  return sum / area(corner(mesh, 3 * f), corner(mesh, 3 * f + 1), corner(mesh, 3 * f + 2));
}

/// How far the coordinates of a triangle are from a function of the place.
double distance(const TriangleMesh& mesh, const MatrixXd& uv, Eigen::Index f,
                const std::function<Vector2d(const Vector2d&)>& wanted) {
  double largest = 0;
  for (Eigen::Index c = 3 * f; c < 3 * f + 3; ++c)
    largest = (std::max)(largest, (uv.row(c).transpose() - wanted(corner(mesh, c))).norm());
  return largest;
}

/// The singular values of the affine map from a triangle to the texture.
Vector2d stretch(const TriangleMesh& mesh, const MatrixXd& uv, Eigen::Index f) {
  Eigen::Matrix2d place, texture;
  for (int k = 0; k < 2; ++k) {
    place.col(k) = corner(mesh, 3 * f + k + 1) - corner(mesh, 3 * f);
    texture.col(k) = (uv.row(3 * f + k + 1) - uv.row(3 * f)).transpose();
  }
  const Eigen::Matrix2d jacobian = texture * place.inverse();
  return Eigen::JacobiSVD<Eigen::Matrix2d>(jacobian).singularValues();
}

}  // namespace

TEST_CASE("across a seam, each triangle has the one island on which most of it lies") {
  const TriangleMesh a = grid(8, 8, false), b = grid(7, 5, true);
  const SurfaceMap map(a, b, flat(a), flat(b));
  REQUIRE(map.status() == ism::Status::kDone);
  const MatrixXd uv = lay_out(
      a, [](const Vector2d& x, const Vector2d& m) { return m.x() < 0.5 ? left(x) : right(x); });
  const MatrixXd carried = uv_islands::carry(map.meta_mesh(), Side::kA, uv);
  REQUIRE(carried.rows() == 3 * b.triangles.rows());
  int crossing = 0;
  for (Eigen::Index f = 0; f < b.triangles.rows(); ++f) {
    const double share = share_below(b, f, 0.5);
    const double to_left = distance(b, carried, f, left), to_right = distance(b, carried, f, right);
    CHECK((std::min)(to_left, to_right) < 1e-12);
    CHECK((std::max)(to_left, to_right) > 1);
    if (std::abs(share - 0.5) > 1e-9) CHECK((to_left < to_right) == (share > 0.5));
    crossing += share > 0 && share < 1;
  }
  CHECK(crossing == 10);
  // The other way: from B, whose two islands are beside each other in triangles of A.
  const MatrixXd back = uv_islands::carry(map.meta_mesh(), Side::kB,
                                          lay_out(b, [](const Vector2d& x, const Vector2d& m) {
                                            return m.x() < 3 / 7.0 ? left(x) : right(x);
                                          }));
  for (Eigen::Index f = 0; f < a.triangles.rows(); ++f)
    CHECK((std::min)(distance(a, back, f, left), distance(a, back, f, right)) < 1e-12);
}

TEST_CASE("where an island meets itself, each triangle has one side of the seam") {
  const TriangleMesh a = grid(8, 8, false), b = grid(7, 9, true);
  const SurfaceMap map(a, b, flat(a), flat(b));
  // A slit from below to the middle, opened as a wedge: around its end, the island is one.
  const auto side_of = [](double sign) {
    return [sign](const Vector2d& x) { return Vector2d(x.x() + sign * (0.5 - x.y()), x.y()); };
  };
  const MatrixXd uv = lay_out(a, [&](const Vector2d& x, const Vector2d& m) {
    return m.y() > 0.5 ? x : side_of(m.x() < 0.5 ? -1 : 1)(x);
  });
  const MatrixXd carried = uv_islands::carry(map.meta_mesh(), Side::kA, uv);
  for (Eigen::Index f = 0; f < b.triangles.rows(); ++f) {
    const double share = share_below(b, f, 0.5);
    const double y = middle(b, f).y();
    if (y > 0.5 && y < 5.0 / 9) continue;  // bent
    if (y < 0.5 && y > 4.0 / 9) continue;
    if (y > 0.5)
      CHECK(distance(b, carried, f, left) < 1e-12);
    else if (std::abs(share - 0.5) > 1e-9)
      CHECK(distance(b, carried, f, side_of(share > 0.5 ? -1 : 1)) < 1e-12);
  }
}

TEST_CASE("triangles on others without texture coordinates, or on nothing, have none") {
  const TriangleMesh a = grid(8, 8, false), b = grid(7, 5, true, 0.3);
  const SurfaceMap map(a, b, flat(a), flat(b));
  const MatrixXd uv = lay_out(a, [](const Vector2d& x, const Vector2d& m) {
    return m.x() > 0.5 ? right(x) : Vector2d(kNone, kNone);
  });
  const MatrixXd carried = uv_islands::carry(map.meta_mesh(), Side::kA, uv);
  int without = 0;
  for (Eigen::Index f = 0; f < b.triangles.rows(); ++f) {
    const double share = share_below(b, f, 1) - share_below(b, f, 0.5);
    if (share > 0.5 + 1e-9) CHECK(distance(b, carried, f, right) < 1e-12);
    if (share < 0.5 - 1e-9) CHECK(carried.middleRows(3 * f, 3).array().isNaN().all());
    without += share < 0.5 - 1e-9;
  }
  CHECK(without > 20);
  const MatrixXd none = MatrixXd::Constant(uv.rows(), 2, kNone);
  CHECK(uv_islands::carry(map.meta_mesh(), Side::kA, none).array().isNaN().all());
}

TEST_CASE("on many islands of a bent map, no triangle is stretched much more than they are") {
  const TriangleMesh a = grid(24, 24, false), b = grid(17, 19, true);
  Points2 f = flat(a);  // bent, with the boundary where it was
  for (Eigen::Index v = 0; v < f.rows(); ++v)
    f.row(v) += 0.05 * Eigen::RowVector2d(std::sin(3.14159 * f(v, 0)) * std::sin(7 * f(v, 1)),
                                          std::sin(3.14159 * f(v, 1)) * std::cos(5 * f(v, 0)));
  const SurfaceMap map(a, b, f, flat(b));
  REQUIRE(map.status() == ism::Status::kDone);
  // Islands of 6 × 6 squares, turned by angles of their own and far from each other.
  const MatrixXd uv = lay_out(a, [](const Vector2d& x, const Vector2d& m) {
    const double i = std::floor(4 * m.x()), j = std::floor(4 * m.y()), angle = 2 * i + 3 * j;
    const Eigen::Matrix2d turn{{std::cos(angle), -std::sin(angle)},
                               {std::sin(angle), std::cos(angle)}};
    return Vector2d(turn * x + Vector2d(10 * i, 10 * j));
  });
  const ism::MetaMesh meta = map.meta_mesh();
  const MatrixXd carried = uv_islands::carry(meta, Side::kA, uv);
  REQUIRE(carried.allFinite());
  const MatrixXd sampled =
      ism::transfer(meta, Side::kA, ism::Element::kCorner, ism::Element::kCorner).apply(uv);
  double least = 1, most = 1, most_sampled = 1;
  int same = 0;
  for (Eigen::Index t = 0; t < b.triangles.rows(); ++t) {
    const Vector2d s = stretch(b, carried, t), as_sampled = stretch(b, sampled, t);
    least = (std::min)(least, s[1]);
    most = (std::max)(most, s[0]);
    most_sampled = (std::max)(most_sampled, as_sampled[0]);
    same += (carried - sampled).middleRows(3 * t, 3).norm() < 1e-12;
  }
  CHECK(least > 0.75);  // 0.78 and 1.40, as the map is bent
  CHECK(most < 1.45);
  CHECK(most_sampled > 50);
  CHECK(same > b.triangles.rows() / 2);  // those inside an island
}

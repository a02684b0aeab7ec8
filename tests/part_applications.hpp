// What the map is used for: curves, remeshing, attributes, distortion.

#ifndef ISM_TESTS_PART_APPLICATIONS_HPP
#define ISM_TESTS_PART_APPLICATIONS_HPP

#include "ism.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

namespace applications_tests {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using ism::Element;
using ism::MetaMesh;
using ism::Points2;
using ism::PolygonDistortion;
using ism::Polyline;
using ism::Side;
using ism::Status;
using ism::SurfaceMap;
using ism::SurfacePoint;
using ism::TriangleMesh;
using runs::good_map;
using runs::square_pair;
using shapes::Disk;
using shapes::overlapping_pair;
using shapes::planar;
using shapes::Rng;

/// How far x is from triangle f in the plane: minus its least barycentric coordinate there.
double outside(const Disk& disk, int f, const Vector2d& x) {
  Eigen::Matrix3d corners;
  for (int k = 0; k < 3; ++k)
    corners.col(k) << disk.plane.row(disk.mesh.triangles(f, k)).transpose(), 1;
  return -(corners.inverse() * Vector3d(x.x(), x.y(), 1)).minCoeff();
}

double length(const Disk& disk, const Polyline& line) {
  double sum = 0;
  for (std::size_t i = 0; i + 1 < line.size(); ++i)
    sum += (planar(disk, line[i + 1]) - planar(disk, line[i])).norm();
  return sum;
}

/// Every segment of a polyline lies in the triangle of its first point.
void check_continuous(const Disk& disk, const Polyline& line) {
  REQUIRE(line.size() >= 2);
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    CHECK(line[i].barycentric.minCoeff() >= 0);
    CHECK(outside(disk, line[i].face, planar(disk, line[i + 1])) < 1e-9);
  }
}

/// The length of the part of pq that lies in a box.
double length_inside(const Vector2d& p, const Vector2d& q, const Vector2d& lo, const Vector2d& hi) {
  double s = 0, t = 1;
  for (int c = 0; c < 2; ++c) {
    const double d = q[c] - p[c];
    if (d == 0 && (p[c] < lo[c] || p[c] > hi[c])) return 0;
    if (d == 0) continue;
    s = std::max(s, ((d > 0 ? lo : hi)[c] - p[c]) / d);
    t = std::min(t, ((d > 0 ? hi : lo)[c] - p[c]) / d);
  }
  return std::max(0.0, t - s) * (q - p).norm();
}

Eigen::MatrixXd random_values(Eigen::Index rows, Rng& rng) {
  Eigen::MatrixXd values(rows, 2);
  for (Eigen::Index i = 0; i < rows; ++i) values.row(i) << rng.uniform(-1, 1), rng.uniform(-1, 1);
  return values;
}

}  // namespace

// ---- paths ----

TEST_CASE("the border of a square that covers another one is one polyline") {
  const auto [a, b] = square_pair(6);
  const SurfaceMap map = good_map(a, b);
  const ism::detail::HalfEdgeMesh m = shapes::half_edges(a.mesh);
  std::vector<int> border;
  for (int h : m.boundary) border.push_back(m.tail[h]);
  border.push_back(border[0]);
  const std::vector<Polyline> images = map.forward_path(border);
  REQUIRE(images.size() == 1);
  check_continuous(b, images[0]);
  CHECK(length(b, images[0]) == doctest::Approx(32));
}

TEST_CASE("an edge between identical meshes is one polyline") {
  Rng rng(7);
  const Disk disk = shapes::perturbed_grid(6, 6, 0.2, rng);
  const SurfaceMap map = good_map(disk, disk);
  const ism::detail::HalfEdgeMesh m = shapes::half_edges(disk.mesh);
  for (int h = 0; h < m.tail.size(); ++h) {
    const int u = m.tail[h], v = m.tip(h);
    const std::vector<Polyline> images = map.forward_path({u, v});
    CAPTURE(u);
    CAPTURE(v);
    REQUIRE(images.size() == 1);
    CHECK(length(disk, images[0]) ==
          doctest::Approx((disk.plane.row(u) - disk.plane.row(v)).norm()).epsilon(1e-9));
  }
}

TEST_CASE("edges along edges and over vertices of aligned grids go as far as both grids") {
  const Disk a = shapes::grid(6, 5);
  const ism::detail::HalfEdgeMesh m = shapes::half_edges(a.mesh);
  int inside = 0, outside_of_b = 0;
  for (double scale : {1.0, 0.5, 0.8, 1.0 / 3})
    for (double shift : {0.0, 0.5, 1.0, 1e-3, 1e-8, 1e-12}) {
      CAPTURE(scale);
      CAPTURE(shift);
      Disk b = shapes::grid(7, 7);
      b.plane *= scale;
      b.plane.col(0).array() += shift;
      const SurfaceMap map = good_map(a, b);
      const Vector2d lo(shift, 0), hi = lo + Vector2d::Constant(7 * scale);
      for (int h = 0; h < m.tail.size(); ++h) {
        const int u = m.tail[h], v = m.tip(h);
        const Vector2d p = a.plane.row(u).transpose(), q = a.plane.row(v).transpose();
        const double wanted = length_inside(p, q, lo, hi);
        double found = 0;
        const std::vector<Polyline> images = map.forward_path({u, v});
        for (const Polyline& line : images) {
          check_continuous(b, line);
          found += length(b, line);
        }
        // A line that is beside B by no more than rounding may be on its boundary.
        const double along =
            length_inside(p, q, lo - Vector2d::Constant(1e-11), hi + Vector2d::Constant(1e-11));
        CHECK(found > wanted - 1e-9);
        CHECK(found < along + 1e-9);
        if (wanted > 1e-6) CHECK(images.size() == 1);
        ++(wanted > 1e-6 ? inside : outside_of_b);
      }
    }
  CHECK(inside > 500);
  CHECK(outside_of_b > 500);
}

/// The mesh with vertices added in the middle of edges.
TriangleMesh with_midpoints(const TriangleMesh& mesh, const std::vector<ism::AddedVertex>& added) {
  ism::detail::Surface halved = ism::detail::build_surface(mesh, true);
  ism::detail::add_vertices(added, halved);
  return *ism::detail::with_added_vertices(ism::detail::shared(mesh), halved);
}

/// A map whose mesh A was given coarser, with these vertices added since.
SurfaceMap refined_map(const TriangleMesh& a, const std::vector<ism::AddedVertex>& added,
                       const TriangleMesh& fine, const Points2& f, const Disk& b) {
  ism::Embedding e;
  const auto given = [&](const TriangleMesh& mesh) {
    return std::make_shared<ism::Prepared>(ism::detail::as_given(ism::detail::shared(mesh)));
  };
  e.prepared_a = given(a);
  e.prepared_b = given(b.mesh);
  e.a = ism::detail::shared(fine);
  e.b = e.prepared_b->mesh;
  e.added_a = added;
  e.f = f;
  e.g = b.plane;
  return SurfaceMap(e);
}

TEST_CASE("paths follow edges that were halved") {
  const auto [a, b] = square_pair(9);
  const int u = 30, v = 31, n = static_cast<int>(a.mesh.vertices.rows());
  const std::vector<ism::AddedVertex> added = {{u, v}, {u, n}};
  const TriangleMesh mesh = with_midpoints(a.mesh, added);
  ism::Points2 plane(n + 2, 2);
  plane.topRows(n) = a.plane;
  plane.row(n) = 0.5 * (a.plane.row(u) + a.plane.row(v));
  plane.row(n + 1) = 0.5 * (plane.row(u) + plane.row(n));
  const SurfaceMap map = refined_map(a.mesh, added, mesh, plane, b);
  REQUIRE(map.status() == Status::kDone);
  for (const std::vector<int>& path : {std::vector<int>{u, v}, {v, u}, {u, v, v + 1}}) {
    const std::vector<Polyline> image = map.forward_path(path);
    REQUIRE(image.size() == 1);
    check_continuous(b, image[0]);
    double expected = 0;
    for (std::size_t i = 1; i < path.size(); ++i)
      expected += (a.plane.row(path[i]) - a.plane.row(path[i - 1])).norm();
    CHECK(length(b, image[0]) == doctest::Approx(expected));
    const Eigen::Vector2d begin = shapes::planar(b, image[0].front());
    CHECK((begin - a.plane.row(path[0]).transpose()).norm() < 1e-12);
  }
  CHECK(map.forward_path({u, n, v}).empty());  // n is no vertex of the mesh given
}

// ---- remeshing ----

TEST_CASE("a remesh has the connectivity of one mesh and the geometry of the other") {
  const auto [a, b] = overlapping_pair(10);
  const SurfaceMap map = good_map(a, b);
  const TriangleMesh mesh = ism::remesh(map, Side::kA);
  const std::vector<SurfacePoint> images = map.forward_vertices();
  REQUIRE(mesh.vertices.rows() == a.mesh.vertices.rows());
  int covered = 0;
  for (int v = 0; v < a.mesh.vertices.rows(); ++v) {
    const SurfacePoint& image = images[static_cast<std::size_t>(v)];
    if (!image.exists()) continue;
    ++covered;
    CHECK(mesh.vertices.row(v) == map.position_on_b(image).transpose());
  }
  CHECK(covered > 10);
  CHECK(covered < a.mesh.vertices.rows());
  CHECK(mesh.triangles.rows() > 10);
  for (int f = 0; f < mesh.triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      CHECK(images[static_cast<std::size_t>(mesh.triangles(f, k))].exists());
  const auto [c, d] = square_pair(11);
  const TriangleMesh all = ism::remesh(good_map(c, d), Side::kB);
  CHECK(all.triangles == d.mesh.triangles);
}

// ---- attributes ----

TEST_CASE("attributes of either mesh come back from the meta mesh as they were") {
  for (std::uint64_t seed : {12u, 13u}) {
    const auto [a, b] = overlapping_pair(seed);
    const MetaMesh meta = good_map(a, b).meta_mesh();
    Rng rng(seed);
    for (Side side : {Side::kA, Side::kB})
      for (Element element : {Element::kVertex, Element::kFace, Element::kCorner}) {
        const TriangleMesh& mesh = side == Side::kA ? a.mesh : b.mesh;
        const Eigen::Index rows = element == Element::kVertex ? mesh.vertices.rows()
                                  : element == Element::kFace ? mesh.triangles.rows()
                                                              : 3 * mesh.triangles.rows();
        const Eigen::MatrixXd values = random_values(rows, rng);
        const ism::Values there = ism::to_meta(meta, side, element).apply(values);
        REQUIRE(there.rows() > 0);
        const ism::Transfer to_side = ism::from_meta(meta, side, element);
        const ism::Values back = to_side.apply(there);
        REQUIRE(back.rows() == rows);
        int covered = 0;
        for (Eigen::Index i = 0; i < rows; ++i) {
          if (!to_side.covers(static_cast<int>(i))) {
            CHECK(back.row(i).isZero());
            continue;
          }
          ++covered;
          CHECK((back.row(i) - values.row(i)).norm() < 1e-9);
        }
        CHECK(covered > rows / 4);
        CHECK(covered < rows);
      }
  }
}

TEST_CASE("positions as attributes arrive where the map says") {
  const auto [a, b] = overlapping_pair(14);
  const SurfaceMap map = good_map(a, b);
  const MetaMesh meta = map.meta_mesh();
  const ism::Transfer to_b = ism::transfer(meta, Side::kA, Element::kVertex, Element::kVertex);
  const ism::Values at_b = to_b.apply(a.mesh.vertices);
  const std::vector<SurfacePoint> images = map.backward_vertices();
  for (int v = 0; v < b.mesh.vertices.rows(); ++v) {
    const SurfacePoint& image = images[static_cast<std::size_t>(v)];
    REQUIRE(to_b.covers(v) == image.exists());
    if (!image.exists()) continue;
    CHECK((at_b.row(v) - map.position_on_a(image).transpose()).norm() < 1e-9);
  }
}

TEST_CASE("transfer to faces keeps integrals, transfer to corners keeps linear functions") {
  auto [a, b] = square_pair(15);
  a.mesh.vertices.col(2).setZero();
  b.mesh.vertices.col(2).setZero();
  const MetaMesh meta = good_map(a, b).meta_mesh();
  const auto integral = [](const Disk& disk, const Eigen::MatrixXd& values) {
    double sum = 0;
    for (int f = 0; f < disk.mesh.triangles.rows(); ++f) {
      const int i = disk.mesh.triangles(f, 0), j = disk.mesh.triangles(f, 1);
      sum += 0.5 * shapes::turn(disk.plane, i, j, disk.mesh.triangles(f, 2)) * values(f, 0);
    }
    return sum;
  };
  Rng rng(16);
  const Eigen::MatrixXd values = random_values(a.mesh.triangles.rows(), rng);
  const ism::Values faces =
      ism::transfer(meta, Side::kA, Element::kFace, Element::kFace).apply(values);
  CHECK(integral(b, faces) == doctest::Approx(integral(a, values)).epsilon(1e-9));
  const ism::Values corners =
      ism::transfer(meta, Side::kB, Element::kVertex, Element::kCorner).apply(b.mesh.vertices);
  for (int f = 0; f < a.mesh.triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      CHECK((corners.row(3 * f + k) - a.mesh.vertices.row(a.mesh.triangles(f, k))).norm() < 1e-9);
}

TEST_CASE("what a map says of a mesh with vertices added is in the ids of the mesh given") {
  const auto [a, b] = square_pair(18);
  const TriangleMesh& mesh = a.mesh;
  const int n = static_cast<int>(mesh.vertices.rows());
  const std::vector<ism::AddedVertex> added = {{30, 31}, {30, n}, {n, n + 1}, {0, 1}};
  const TriangleMesh fine = with_midpoints(mesh, added);
  REQUIRE(fine.triangles.rows() > mesh.triangles.rows());
  Points2 f = a.plane;
  f.conservativeResize(n + 4, Eigen::NoChange);
  for (int i = 0; i < 4; ++i) {
    const ism::AddedVertex& p = added[static_cast<std::size_t>(i)];
    f.row(n + i) = 0.5 * (f.row(p.corners[0]) + f.row(p.corners[1]));
  }
  const SurfaceMap map = refined_map(mesh, added, fine, f, b);
  REQUIRE(map.status() == Status::kDone);
  CHECK(map.mesh(Side::kA).vertices == mesh.vertices);
  CHECK(map.mesh(Side::kA, ism::Ids::kEmbedded).vertices == fine.vertices);
  CHECK(map.forward_vertices().size() == static_cast<std::size_t>(n));
  const MetaMesh meta = map.meta_mesh(), embedded = map.meta_mesh(ism::Ids::kEmbedded);
  CHECK(meta.corners == embedded.corners);
  CHECK(meta.on_a == embedded.on_a);
  for (std::size_t p = 0; p < meta.face_a.size(); ++p)
    for (int i = meta.offsets[p]; i < meta.offsets[p + 1]; ++i) {
      const Vector3d at = map.position_on_a({meta.face_a[p], meta.corner_a.row(i).transpose()});
      const int v = meta.corners[static_cast<std::size_t>(i)];
      CHECK((at - meta.on_a.row(v).transpose()).norm() < 1e-12);
    }
  Rng rng(19);
  for (int i = 0; i < 200; ++i) {  // there and back
    Vector3d weights(rng.uniform(), rng.uniform(), rng.uniform());
    weights /= weights.sum();
    const SurfacePoint p = {rng.below(static_cast<int>(mesh.triangles.rows())), weights};
    const ism::SurfacePoint image = map.forward(p);
    REQUIRE(image.exists());
    const ism::SurfacePoint back = map.backward(image);
    REQUIRE(back.exists());
    CHECK((map.position_on_a(back) - map.position_on_a(p)).norm() < 1e-10);
  }
  for (Element element : {Element::kVertex, Element::kFace, Element::kCorner}) {
    const ism::Transfer t = ism::to_meta(meta, Side::kA, element);
    CHECK(t.n_sources == ism::detail::element_count(mesh, element));
    const Eigen::MatrixXd values = random_values(t.n_sources, rng);
    const ism::Values back = ism::from_meta(meta, Side::kA, element).apply(t.apply(values));
    CHECK((back - values).cwiseAbs().maxCoeff() < 1e-9);
  }
}

TEST_CASE("where vertices were added, a mesh that does not fit counts as given") {
  const auto [a, b] = square_pair(18);
  const int n = static_cast<int>(a.mesh.vertices.rows());
  const std::vector<ism::AddedVertex> added = {{30, 31}, {30, n}};
  const TriangleMesh fine = with_midpoints(a.mesh, added);
  Points2 f = a.plane;
  f.conservativeResize(n + 2, Eigen::NoChange);
  f.row(n) = 0.5 * (f.row(30) + f.row(31));
  f.row(n + 1) = 0.5 * (f.row(30) + f.row(n));
  for (const std::vector<ism::AddedVertex>& wrong :
       {std::vector<ism::AddedVertex>{}, {{30, 31}, {30, 900}}, {{-1, 2}, {0, 1}}}) {
    const SurfaceMap map = refined_map(a.mesh, wrong, fine, f, b);
    CHECK(map.status() == Status::kDone);
    CHECK(map.mesh(Side::kA).vertices == fine.vertices);
  }
}

TEST_CASE("a transfer applies to arrays of floats as to matrices, and its weights add up to 1") {
  const auto [a, b] = overlapping_pair(20);
  const MetaMesh meta = good_map(a, b).meta_mesh();
  Rng rng(21);
  for (Element element : {Element::kVertex, Element::kFace, Element::kCorner})
    for (Element target : {Element::kVertex, Element::kFace, Element::kCorner}) {
      const ism::Transfer transfer = ism::transfer(meta, Side::kA, element, target);
      const Eigen::MatrixXd values = random_values(transfer.n_sources, rng);
      const ism::Values wanted = transfer.apply(values);
      REQUIRE(wanted.rows() == transfer.rows());
      struct Item {
        int before;
        float value[2];
      };
      std::vector<Item> in(static_cast<std::size_t>(transfer.n_sources)),
          out(static_cast<std::size_t>(transfer.rows()), {1, {5, 5}});
      for (std::size_t i = 0; i < in.size(); ++i)
        for (int c = 0; c < 2; ++c)
          in[i].value[c] = static_cast<float>(values(static_cast<Eigen::Index>(i), c));
      CHECK(transfer.apply(in[0].value, transfer.n_sources, sizeof(Item), 2, out[0].value,
                           transfer.rows(), sizeof(Item)));
      int covered = 0;
      for (int i = 0; i < transfer.rows(); ++i) {
        const std::size_t row = static_cast<std::size_t>(i);
        const auto first = transfer.weights.begin() + transfer.offsets[row];
        const auto last = transfer.weights.begin() + transfer.offsets[row + 1];
        CHECK(out[row].before == 1);
        if (!transfer.covers(i)) {
          CHECK(out[row].value[0] == 5);
          continue;
        }
        ++covered;
        CHECK(std::accumulate(first, last, 0.0) == doctest::Approx(1).epsilon(1e-12));
        CHECK(*std::min_element(first, last) > -1e-12);
        const auto ids = transfer.sources.begin() + transfer.offsets[row];
        CHECK(std::adjacent_find(ids, ids + (last - first), std::greater_equal<int>()) ==
              ids + (last - first));
        for (int c = 0; c < 2; ++c)
          CHECK(out[row].value[c] == doctest::Approx(wanted(i, c)).epsilon(1e-6));
      }
      CHECK(covered > 10);
      CHECK(covered < transfer.rows());
    }
}

/// Values of three sources become their mean, and the second one.
ism::Transfer mean_of_three() {
  ism::Transfer transfer;
  transfer.n_sources = 3;
  transfer.offsets = {0, 3, 4};
  transfer.sources = {0, 1, 2, 1};
  transfer.weights = {0.25, 0.25, 0.5, 1.5};  // the latter as no transfer has, to leave the range
  return transfer;
}

TEST_CASE_TEMPLATE("integers of a transfer are rounded, and kept within their range", T,
                   std::int8_t, std::uint8_t, std::int16_t, std::uint16_t, std::int32_t,
                   std::uint32_t, std::int64_t, std::uint64_t) {
  const ism::Transfer transfer = mean_of_three();
  const auto applied = [&](T x, T y, T z) {
    const T values[] = {x, y, z};
    std::array<T, 2> result = {7, 7};
    CHECK(transfer.apply(values, 3, sizeof(T), 1, result.data(), 2, sizeof(T)));
    return result;
  };
  using Limits = std::numeric_limits<T>;
  const T most = Limits::max(), least = Limits::lowest();
  CHECK(applied(1, 2, 2) == std::array<T, 2>{2, 3});  // 1.75
  CHECK(applied(2, 1, 1) == std::array<T, 2>{1, 2});  // 1.25, 1.5
  CHECK(applied(most, most, most) == std::array<T, 2>{most, most});
  CHECK(applied(least, least, least) == std::array<T, 2>{least, least});
}

TEST_CASE("a transfer reads and writes nothing if numbers of elements do not fit") {
  const ism::Transfer transfer = mean_of_three();
  float result[] = {5, 5};
  const auto is_applied = [&](std::ptrdiff_t n_values, std::ptrdiff_t n_results) {
    const float* const nothing = nullptr;
    return transfer.apply(nothing, n_values, 4, 1, result, n_results, 4);
  };
  for (std::ptrdiff_t n : {std::ptrdiff_t{-1}, std::ptrdiff_t{2}, std::ptrdiff_t{1} << 40}) {
    CHECK_FALSE(is_applied(n, 2));
    CHECK_FALSE(is_applied(3, n - 1));
  }
  CHECK(result[0] == 5);
  CHECK(result[1] == 5);
}

TEST_CASE("of an empty meta mesh nothing is transferred") {
  const ism::MetaMesh none;
  for (ism::Side side : {ism::Side::kA, ism::Side::kB})
    for (ism::Element element :
         {ism::Element::kVertex, ism::Element::kFace, ism::Element::kCorner}) {
      CHECK(ism::to_meta(none, side, element).rows() == 0);
      CHECK(ism::from_meta(none, side, element).rows() == 0);
      CHECK(ism::transfer(none, side, element, element).rows() == 0);
    }
}

TEST_CASE("attributes that do not fit a mesh are refused") {
  const auto [a, b] = square_pair(17);
  const MetaMesh meta = good_map(a, b).meta_mesh();
  const Eigen::MatrixXd wrong = Eigen::MatrixXd::Zero(7, 1);
  CHECK(ism::to_meta(meta, Side::kA, Element::kVertex).apply(wrong).rows() == 0);
  CHECK(ism::from_meta(meta, Side::kB, Element::kFace).apply(wrong).rows() == 0);
  const ism::Transfer transfer = ism::transfer(meta, Side::kB, Element::kCorner, Element::kVertex);
  CHECK(transfer.apply(wrong).rows() == 0);
}

// ---- distortion ----

TEST_CASE("an isometry has singular values 1, a stretch its own") {
  Rng rng(18);
  Disk a = shapes::random_disk(5, 5, rng), b = a;
  const Eigen::Matrix2d stretch = shapes::rotation(0.3) * Vector2d(2, 0.5).asDiagonal();
  for (const PolygonDistortion& p : good_map(a, b).distortion(true)) {
    CHECK(p.sigma_min == doctest::Approx(1));
    CHECK(p.sigma_max == doctest::Approx(1));
    CHECK(p.density == doctest::Approx(2));
  }
  b.mesh.vertices.leftCols<2>() = shapes::moved(b.plane, stretch, Vector2d(7, 8));
  for (const PolygonDistortion& p : good_map(a, b).distortion(true)) {
    CHECK(p.sigma_min == doctest::Approx(0.5));
    CHECK(p.sigma_max == doctest::Approx(2));
    CHECK(p.density == doctest::Approx(4.25));
    CHECK(p.area_a == doctest::Approx(p.area_b));
  }
  b.mesh.vertices = 1000 * a.mesh.vertices;  // another unit
  const ism::DistortionSummary sum = ism::summarize(good_map(a, b).distortion());
  CHECK(sum.mean == doctest::Approx(2));
  CHECK(sum.largest == doctest::Approx(2));
  CHECK(sum.area_a == doctest::Approx(1));
}

TEST_CASE("distortions add up to what the optimisation says") {
  const auto [a, b] = overlapping_pair(19);
  ism::Options options = shapes::from_planes(a, b);
  options.keep_scale = false;
  options.max_iterations = 5;
  const ism::Result r = ism::compute_map(a.mesh, b.mesh, {}, options);
  REQUIRE(ism::is_usable(r.status));
  const SurfaceMap map(a.mesh, b.mesh, r.f, r.g);
  const std::vector<PolygonDistortion> polygons = map.distortion();
  CHECK(polygons.size() == map.meta_mesh().face_a.size());
  const ism::DistortionSummary sum = ism::summarize(polygons);
  CHECK(sum.mean == doctest::Approx(r.final_state().mean_distortion).epsilon(1e-9));
  CHECK(sum.area_a == doctest::Approx(r.final_state().coverage_a).epsilon(1e-9));
  CHECK(sum.area_b == doctest::Approx(r.final_state().coverage_b).epsilon(1e-9));
  CHECK(sum.sigma_min <= 1);
  CHECK(sum.sigma_max >= 1);
  CHECK(2 <= sum.median);
  CHECK(sum.median <= sum.p95);
  CHECK(sum.p95 <= sum.largest);
  CHECK(ism::summarize({}).mean == 0);
}

}  // namespace applications_tests

#endif  // ISM_TESTS_PART_APPLICATIONS_HPP

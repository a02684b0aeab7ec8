// The overlay of two embeddings against brute force, and the injectivity decision.

#ifndef ISM_TESTS_PART_OVERLAY_HPP
#define ISM_TESTS_PART_OVERLAY_HPP

#include "allocations.hpp"
#include "elements.hpp"
#include "ism.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <set>
#include <utility>
#include <vector>

namespace overlay_tests {
namespace {

using namespace ism::detail;
using Eigen::Vector2d;
using ism::Points2;
using shapes::Disk;
using shapes::half_edges;
using shapes::Rng;
using FacePairs = std::set<std::pair<int, int>>;

bool injective(const Disk& disk) { return is_injective(half_edges(disk.mesh), disk.plane); }

/// Two embedded disks and their overlay.
struct Pair {
  JointSurface s;
  Points2 x;
  Overlay overlay;

  Pair(const Disk& a, const Disk& b, bool keep_scale = true)
      : s(shapes::joined(a.mesh, b.mesh, keep_scale)), x(stacked(a.plane, b.plane)) {
    compute_overlay(s, x, overlay);
  }

  OverlayPolygon intersect_faces(int ta, int tb) const {
    return intersect(labelled(s.mesh, x, ta), labelled(s.mesh, x, tb));
  }

  SixPoints points(const OverlayPolygon& p) const { return six_points(s.mesh, x, p); }

  double area(const OverlayPolygon& p) const {
    const SixPoints corners = points(p);
    return polygon_area(polygon_shape(p, corners), corners);
  }

  double total_area() const {
    double sum = 0;
    for (const OverlayPolygon& p : overlay.polygons) sum += area(p);
    return sum;
  }
};

double planar_area(const Disk& disk) {
  double sum = 0;
  for (int f = 0; f < disk.mesh.triangles.rows(); ++f) {
    const auto t = disk.mesh.triangles.row(f);
    sum += shapes::turn(disk.plane, t[0], t[1], t[2]) / 2;
  }
  return sum;
}

/// The face pairs of the overlay; duplicates are counted.
FacePairs found_pairs(const Pair& pair, int& duplicates) {
  FacePairs found;
  for (const OverlayPolygon& p : pair.overlay.polygons)
    duplicates += !found.insert({p.ta, p.tb}).second;
  return found;
}

FacePairs brute_force_pairs(const Pair& pair) {
  FacePairs all;
  for (int ta = 0; ta < pair.s.faces_a; ++ta)
    for (int tb = pair.s.faces_a; tb < pair.s.mesh.n_faces; ++tb)
      if (pair.intersect_faces(ta, tb).count > 0) all.insert({ta, tb});
  return all;
}

/// The area common to two triangles by clipping one with the edges of the other, in doubles.
double clipped_area(const SixPoints& x) {
  std::vector<Vec2> polygon = {x[0], x[1], x[2]};
  for (int k = 0; k < 3; ++k) {
    const Vec2 p = x[3 + k], d = x[3 + (k + 1) % 3] - p;
    std::vector<Vec2> kept;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Vec2 u = polygon[i], v = polygon[(i + 1) % polygon.size()];
      const double su = cross(d, u - p), sv = cross(d, v - p);
      if (su >= 0) kept.push_back(u);
      if ((su > 0 && sv < 0) || (su < 0 && sv > 0)) kept.push_back(u + su / (su - sv) * (v - u));
    }
    polygon = kept;
  }
  double area = 0;
  for (std::size_t i = 0; i + 1 < polygon.size(); ++i)
    area += 0.5 * cross(polygon[i] - polygon[0], polygon[i + 1] - polygon[0]);
  return area;
}

/// The half-edge on which piece e of a polygon lies.
int half_edge(const OverlayPolygon& p, int e) { return e < 3 ? 3 * p.ta + e : 3 * p.tb + e - 3; }

/// A corner by what it is: a vertex, or an undirected edge of A and one of B.
using CornerKey = std::array<int, 3>;

CornerKey corner_key(const Pair& pair, const OverlayPolygon& p, int i) {
  const HalfEdgeMesh& m = pair.s.mesh;
  const auto edge = [&](int e) { return std::max(half_edge(p, e), m.twin[half_edge(p, e)]); };
  const int before = p.piece((i + p.count - 1) % p.count), after = p.piece(i);
  if (same_triangle(before, after)) return {0, m.tail[half_edge(p, after)], 0};
  return {1, edge(std::min(before, after)), edge(std::max(before, after))};
}

/// Counts what is wrong with the meta mesh as a mesh of polygons with corners identified by key:
/// pieces whose neighbour lacks the reversed piece, and a χ other than 2 per component less one per
/// rim.
int meta_mesh_faults(const Pair& pair) {
  std::map<std::array<CornerKey, 2>, int> piece_of;  // directed piece -> polygon
  std::set<CornerKey> corners;
  int faults = 0;
  const int n = pair.overlay.polygons.size();
  for (int i = 0; i < n; ++i) {
    const OverlayPolygon& p = pair.overlay.polygons[i];
    for (int k = 0; k < p.count; ++k) {
      corners.insert(corner_key(pair, p, k));
      faults +=
          !piece_of.insert({{corner_key(pair, p, k), corner_key(pair, p, (k + 1) % p.count)}, i})
               .second;
    }
  }
  std::vector<int> component(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) component[static_cast<std::size_t>(i)] = i;
  const auto root = [&](int i) {
    while (component[static_cast<std::size_t>(i)] != i) i = component[static_cast<std::size_t>(i)];
    return i;
  };
  std::map<CornerKey, CornerKey> rim;
  int paired = 0, components = n;
  for (const auto& [ends, i] : piece_of) {
    const OverlayPolygon& p = pair.overlay.polygons[i];
    const auto reversed = piece_of.find({ends[1], ends[0]});
    int k = 0;
    while (corner_key(pair, p, k) != ends[0]) ++k;
    const bool on_rim = pair.s.mesh.twin[half_edge(p, p.piece(k))] < 0;
    faults += on_rim != (reversed == piece_of.end());
    if (reversed == piece_of.end()) {
      faults += !rim.insert({ends[0], ends[1]}).second;
      continue;
    }
    ++paired;
    if (root(i) != root(reversed->second)) {
      component[static_cast<std::size_t>(root(i))] = root(reversed->second);
      --components;
    }
  }
  const int edges = static_cast<int>(piece_of.size()) - paired / 2;
  int rims = 0;
  for (; !rim.empty(); ++rims)
    for (auto at = rim.begin(); at != rim.end();) {
      const CornerKey next = at->second;
      rim.erase(at);
      at = rim.find(next);
    }
  return faults + std::abs(static_cast<int>(corners.size()) - edges + n - (2 * components - rims));
}

int bad_corner_counts(const Pair& pair) {
  int bad = 0;
  for (const OverlayPolygon& p : pair.overlay.polygons) bad += p.count < 3 || p.count > 6;
  return bad;
}

/// Everything that must hold for the overlay of any two injective embeddings.
void check_overlay(const Pair& pair) {
  REQUIRE(is_injective(pair.s.mesh, pair.x));
  int duplicates = 0;
  CHECK(found_pairs(pair, duplicates) == brute_force_pairs(pair));
  CHECK(duplicates == 0);
  CHECK(bad_corner_counts(pair) == 0);
  CHECK(meta_mesh_faults(pair) == 0);
  double lowest = 0, clipped = 0, worst = 0;
  for (const OverlayPolygon& p : pair.overlay.polygons) {
    const double area = pair.area(p);
    lowest = std::min(lowest, area);
    worst = std::max(worst, std::abs(area - clipped_area(pair.points(p))));
  }
  for (int ta = 0; ta < pair.s.faces_a; ++ta)
    for (int tb = pair.s.faces_a; tb < pair.s.mesh.n_faces; ++tb) {
      OverlayPolygon p;
      p.ta = ta, p.tb = tb;
      clipped += clipped_area(pair.points(p));
    }
  CHECK(lowest > -1e-12);
  CHECK(worst < 1e-12);
  CHECK(pair.total_area() == doctest::Approx(clipped).epsilon(1e-11));
}

Disk moved(Disk disk, double angle, const Vector2d& shift, double scale = 1) {
  disk.plane = shapes::moved(disk.plane, scale * shapes::rotation(angle), shift);
  return disk;
}

/// The surface area of A (or B) under the polygons: planar areas divided by det J_f.
double covered_area(const Pair& pair, bool on_a) {
  double sum = 0;
  for (const OverlayPolygon& p : pair.overlay.polygons) {
    const Mat2& rest_inverse = pair.s.rest_inverse[on_a ? p.ta : p.tb];
    const auto J = elements::jacobian(pair.points(p), on_a ? 0 : 3, rest_inverse);
    sum += pair.area(p) / J.determinant();
  }
  return sum;
}

/// A fan around vertex 0 of n triangles that together turn by 2π·turns.
Disk winding_fan(int n, int turns) {
  Disk disk = shapes::fan(n);
  for (int i = 0; i < n; ++i) {
    const double angle = 2 * shapes::kPi * turns * i / n + 0.1;
    disk.plane.row(1 + i) << std::cos(angle), std::sin(angle);
  }
  return disk;
}

/// A strip of n quads along a path: given left and right rims.
Disk strip_along(const std::vector<Vector2d>& right, const std::vector<Vector2d>& left) {
  shapes::DiskBuilder builder;
  for (std::size_t i = 0; i < right.size(); ++i) {
    const int r = builder.vertex(right[i].x(), right[i].y());
    builder.vertex(left[i].x(), left[i].y());
    if (i > 0) builder.quad(r - 2, r, r + 1, r - 1);
  }
  return builder.build();
}

/// A strip bent by `angle` around the origin, between radii inner and outer + `widening` at the
/// end.
Disk bent_strip(int n, double angle, double inner, double outer, double drift = 0) {
  std::vector<Vector2d> right, left;
  for (int i = 0; i <= n; ++i) {
    const double phi = angle * i / n, out = drift * i / n;
    const Vector2d d(std::cos(phi), std::sin(phi));
    right.push_back((outer + out) * d);
    left.push_back((inner + out) * d);
  }
  return strip_along(right, left);
}

}  // namespace

// ---- the overlay ----

TEST_CASE("random pairs have the overlay that brute force finds") {
  Rng rng(1);
  for (int i = 0; i < 40; ++i) {
    const Disk a = shapes::random_disk(rng.between(1, 5), rng.between(1, 5), rng);
    const Disk b = shapes::random_disk(rng.between(1, 5), rng.between(1, 5), rng);
    check_overlay(Pair(a, moved(b, rng.uniform(0, 6), rng.point(3), rng.uniform(0.3, 2))));
  }
}

TEST_CASE("grids in degenerate positions have the overlay that brute force finds") {
  Rng rng(2);
  for (int i = 0; i < 60; ++i) {
    const Disk a = shapes::grid(rng.between(1, 5), rng.between(1, 5));
    const Disk b = shapes::grid(rng.between(1, 5), rng.between(1, 5));
    const double quarter = rng.below(4);  // turned by right angles: every position an integer
    Eigen::Matrix2d R;
    R << std::round(std::cos(quarter * shapes::kPi / 2)), 0, 0, 0;
    R(1, 0) = std::round(std::sin(quarter * shapes::kPi / 2));
    R(0, 1) = -R(1, 0), R(1, 1) = R(0, 0);
    Disk turned = b;
    const Vector2d shift(rng.between(-3, 5), rng.between(-3, 5));
    turned.plane = shapes::moved(b.plane, R * rng.between(1, 2), shift);
    check_overlay(Pair(a, turned));
  }
}

TEST_CASE("random meshes on few integer positions have the overlay that brute force finds") {
  Rng rng(3);
  for (int i = 0; i < 60; ++i) {
    Disk a = shapes::grid(4, 3), b = shapes::grid(3, 4);
    for (int k = 0; k < 40; ++k) shapes::flip_random_edge(a, rng), shapes::flip_random_edge(b, rng);
    b.plane.rowwise() += Eigen::RowVector2d(rng.between(-2, 2), rng.between(-2, 2));
    if (rng.below(2)) b.plane *= 0.5;
    check_overlay(Pair(a, b));
  }
}

TEST_CASE("overlaps of several components are found completely") {
  const Disk comb = shapes::comb(5, 7);
  const Disk across = moved(shapes::comb(4, 8), shapes::kPi / 2, Vector2d(9.3, 0.4), 0.9);
  Pair pair(comb, across);
  check_overlay(pair);
  CHECK(pair.overlay.polygons.size() > 50);
  check_overlay(Pair(comb, moved(comb, 0, Vector2d(1, 3))));  // teeth between teeth, sharing edges
  check_overlay(Pair(shapes::limbs(7, 9, 0.1), moved(shapes::limbs(5, 9, 0.1), 0.2, {0.3, 0.1})));
}

TEST_CASE("surfaces with openings have the overlay that brute force finds") {
  Rng rng(4);
  int openings = 0;
  for (int i = 0; i < 40; ++i) {
    const Disk a = shapes::with_openings(rng.between(3, 8), rng.between(3, 8), rng);
    const Disk b = shapes::with_openings(rng.between(3, 8), rng.between(3, 8), rng);
    openings += half_edges(a.mesh).loops() - 1 + half_edges(b.mesh).loops() - 1;
    check_overlay(Pair(a, moved(b, rng.uniform(0, 6), rng.point(3), rng.uniform(0.1, 3))));
    check_overlay(Pair(a, moved(b, 0, Vector2d(rng.between(-2, 2), rng.between(-2, 2)))));
  }
  CHECK(openings > 60);
}

TEST_CASE("an overlap that is bounded by whole loops is found, whoever they belong to") {
  const Disk frame = shapes::frame(7, 2);  // 7 × 7 cells, 3 × 3 of them open
  const auto area = [](const Disk& a, const Disk& b) {
    const Pair pair(a, b);
    check_overlay(pair);
    return pair.total_area();
  };
  const Vector2d middle(3.5, 3.5);
  const auto around_middle = [&](const Disk& disk, double angle, double scale) {
    return moved(disk, angle, middle - scale * (shapes::rotation(angle) * middle), scale);
  };
  for (double angle : {0.0, 0.3}) {
    CAPTURE(angle);
    // The opening of one within the other, or within its opening; the whole of one in an opening.
    const Disk small = around_middle(frame, angle, 0.8), tiny = around_middle(frame, angle, 0.2);
    const Disk plate = around_middle(shapes::grid(7, 7), angle, 0.65);
    CHECK(area(frame, small) == doctest::Approx(0.64 * 49 - 9));
    CHECK(area(small, frame) == doctest::Approx(0.64 * 49 - 9));
    CHECK(area(frame, tiny) == 0);
    CHECK(area(tiny, frame) == 0);
    CHECK(area(frame, plate) == doctest::Approx(0.4225 * 49 - 9));
    CHECK(area(plate, frame) == doctest::Approx(0.4225 * 49 - 9));
  }
  CHECK(area(frame, frame) == doctest::Approx(40));
  CHECK(area(shapes::single_triangle(), frame) == doctest::Approx(0.5));
}

TEST_CASE("an embedding on itself is covered completely, in rest and planar area") {
  for (const Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    const Pair pair(disk, disk, false);
    check_overlay(pair);
    CHECK(pair.total_area() == doctest::Approx(planar_area(disk)).epsilon(1e-12));
    CHECK(covered_area(pair, true) == doctest::Approx(1).epsilon(1e-12));
    CHECK(covered_area(pair, false) == doctest::Approx(1).epsilon(1e-12));
  }
}

TEST_CASE("areas add up for embeddings that differ in the last places only") {
  Rng rng(4);
  for (double noise : {1e-15, 1e-13, 1e-11, 1e-9, 1e-7, 1e-5}) {
    CAPTURE(noise);
    const Disk a = shapes::random_disk(6, 6, rng);
    Disk b = a;
    for (int v = 0; v < b.plane.rows(); ++v) b.plane.row(v) += rng.point(noise).transpose();
    const Pair pair(a, b);
    check_overlay(pair);
    CHECK(pair.total_area() <= planar_area(a) * (1 + 1e-13));
    CHECK(pair.total_area() >= planar_area(a) - 100 * noise - 1e-12);
  }
}

TEST_CASE("areas add up where long edges are parallel up to rounding") {
  // A crossing of such edges is badly conditioned along them; its two parameters must still mean
  // the same point.
  Rng rng(11);
  const Eigen::Matrix2d turn = shapes::rotation(0.37);
  for (double noise : {0.0, 1e-15, 1e-14, 1e-13, 1e-11, 1e-9, 1e-7, 1e-5, 1e-3})
    for (int round = 0; round < 5; ++round) {
      CAPTURE(noise);
      Disk coarse = shapes::grid(4, 4), fine = shapes::grid(8, 8);
      coarse.plane = shapes::moved(coarse.plane, turn, {0.1, 0.2});
      fine.plane = shapes::moved(fine.plane, 0.5 * turn, {0.1, 0.2});
      for (int v = 0; v < fine.plane.rows(); ++v) fine.plane.row(v) += rng.point(noise).transpose();
      check_overlay(round % 2 ? Pair(coarse, fine) : Pair(fine, coarse));
    }
}

TEST_CASE("a nested embedding is covered on its own surface, whichever mesh it is") {
  Rng rng(5);
  Disk large = shapes::random_disk(6, 6, rng), small = shapes::random_disk(5, 4, rng);
  shapes::bend(large, 0.5);
  shapes::bend(small, 0.5);
  small = moved(small, 0.4, Vector2d(2.5, 1.5), 0.5);
  const double area = build_surface(small.mesh, true).total_area;
  for (bool inner_is_a : {true, false}) {
    CAPTURE(inner_is_a);
    const Pair pair = inner_is_a ? Pair(small, large) : Pair(large, small);
    check_overlay(pair);
    CHECK(pair.total_area() == doctest::Approx(planar_area(small)).epsilon(1e-12));
    CHECK(covered_area(pair, inner_is_a) == doctest::Approx(area).epsilon(1e-12));
  }
}

TEST_CASE("an embedding inside one triangle of the other is covered") {
  const Disk large = shapes::triangle({-50, -50}, {50, -50}, {0, 80});
  const Disk small = shapes::limbs(5, 8, 0.1);
  for (bool swap : {false, true}) {
    const Pair pair = swap ? Pair(small, large) : Pair(large, small);
    check_overlay(pair);
    CHECK(pair.overlay.polygons.size() == small.mesh.triangles.rows());
    for (const OverlayPolygon& p : pair.overlay.polygons) CHECK(p.count == 3);
  }
}

TEST_CASE("embeddings apart have an empty overlay") {
  Rng rng(6);
  const Disk a = shapes::random_disk(4, 4, rng), b = shapes::comb(4, 3);
  CHECK(Pair(a, moved(b, 0, {100, 0})).overlay.polygons.empty());
  CHECK(Pair(moved(b, 0, {-100, 0}), a).overlay.polygons.empty());
  // In a gap of the comb: the boxes overlap, the meshes do not.
  const Disk tiny = moved(shapes::single_triangle(), 0, {1.3, 1.5}, 0.4);
  CHECK(Pair(b, tiny).overlay.polygons.empty());
  CHECK(Pair(tiny, b).overlay.polygons.empty());
}

TEST_CASE("embeddings that touch have an overlay without area") {
  const Disk a = shapes::grid(3, 3);
  for (const Vector2d& shift :
       {Vector2d(3, 0), Vector2d(0, -3), Vector2d(3, 3), Vector2d(-3, 1), Vector2d(3, 0.5)}) {
    CAPTURE(shift.transpose());
    const Pair pair(a, moved(a, 0, shift));
    check_overlay(pair);
    CHECK(std::abs(pair.total_area()) < 1e-14);
  }
}

TEST_CASE("polygons of embeddings in general position have positive area") {
  Rng rng(7);
  int polygons = 0, bad = 0, corners[7] = {};
  for (int i = 0; i < 20; ++i) {
    const Disk a = shapes::random_disk(5, 5, rng);
    const Pair pair(a, moved(shapes::random_disk(5, 5, rng), rng.uniform(0, 6), {2.5, 2.5}));
    for (const OverlayPolygon& p : pair.overlay.polygons) {
      ++polygons;
      ++corners[p.count];
      bad += !(pair.area(p) > 0);
    }
  }
  CHECK(bad == 0);
  CHECK(polygons > 2000);
  for (int count : {3, 4, 5, 6}) CHECK(corners[count] > 20);
}

TEST_CASE("intersect finds hexagons, containment and nothing") {
  const Disk up = shapes::triangle({-1, -0.6}, {1, -0.6}, {0, 1.2});
  const Disk down = shapes::triangle({1, 0.6}, {-1, 0.6}, {0, -1.2});
  const Pair star(up, down);
  REQUIRE(star.overlay.polygons.size() == 1);
  CHECK(star.overlay.polygons[0].count == 6);
  CHECK(star.total_area() == doctest::Approx(clipped_area(star.points(star.overlay.polygons[0]))));
  const Disk inner = moved(up, 0.3, {0, 0}, 0.1);
  const Pair nested(up, inner);
  REQUIRE(nested.overlay.polygons.size() == 1);
  CHECK(nested.overlay.polygons[0].count == 3);
  for (int i = 0; i < 3; ++i) CHECK(nested.overlay.polygons[0].piece(i) >= 3);
  CHECK(Pair(up, moved(up, 0, {2, 1})).overlay.polygons.empty());
}

TEST_CASE("identical triangles intersect in all of their area for every order of corners") {
  const Vector2d p[3] = {{0.1, 0.2}, {1.3, 0.4}, {0.6, 0.9}};
  for (int k = 0; k < 3; ++k) {
    const Disk a = shapes::triangle(p[0], p[1], p[2]);
    const Disk b = shapes::triangle(p[k], p[(k + 1) % 3], p[(k + 2) % 3]);
    const Pair pair(a, b);
    REQUIRE(pair.overlay.polygons.size() == 1);
    CHECK(pair.total_area() == doctest::Approx(planar_area(a)).epsilon(1e-14));
  }
}

TEST_CASE("an overlay is the same when its memory is used again") {
  Rng rng(8);
  const Pair first(shapes::grid(5, 5), shapes::random_disk(4, 6, rng));
  const Pair second(shapes::strip(3), shapes::comb(2, 2));
  Overlay overlay;
  for (const Pair* pair : {&first, &second, &first}) {
    compute_overlay(pair->s, pair->x, overlay);
    REQUIRE(overlay.polygons.size() == pair->overlay.polygons.size());
    int different = 0;
    for (int i = 0; i < overlay.polygons.size(); ++i) {
      const OverlayPolygon &p = overlay.polygons[i], &q = pair->overlay.polygons[i];
      different += p.ta != q.ta || p.tb != q.tb || p.count != q.count || p.code != q.code;
    }
    CHECK(different == 0);
  }
}

TEST_CASE("an overlay whose memory is large enough takes no more") {
  if (!kCountsAllocations) {
    MESSAGE("skipped: this build does not count allocations");
    return;
  }
  Rng rng(9);
  const Pair pair(shapes::random_disk(12, 9, rng), shapes::random_disk(10, 11, rng));
  const Pair smaller(shapes::grid(5, 5), shapes::random_disk(4, 6, rng));
  Overlay overlay;
  const auto allocations_of = [&](const Pair& p) {
    const std::size_t before = allocations();
    compute_overlay(p.s, p.x, overlay);
    return allocations() - before;
  };
  CHECK(allocations_of(pair) > 0);
  CHECK(overlay.polygons.size() > 500);
  CHECK(allocations_of(pair) == 0);
  CHECK(allocations_of(smaller) == 0);
  CHECK(allocations_of(pair) == 0);
}

// ---- injectivity ----

TEST_CASE("injective embeddings are recognised") {
  for (const Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    CHECK(injective(disk));
    CHECK(injective(moved(disk, 1.1, {5, -3}, 1e-3)));
  }
  CHECK(injective(winding_fan(9, 1)));
  CHECK(injective(bent_strip(20, 6.0, 1, 2)));
}

TEST_CASE("a mirrored embedding is not injective") {
  for (Disk& disk : shapes::all_disks()) {
    CAPTURE(disk.name);
    disk.plane.col(0) *= -1;
    CHECK(!injective(disk));
  }
}

TEST_CASE("a flipped triangle is found wherever it is") {
  Rng rng(10);
  const Disk disk = shapes::random_disk(4, 4, rng);
  const HalfEdgeMesh m = half_edges(disk.mesh);
  REQUIRE(is_injective(m, disk.plane));
  for (int f = 0; f < m.n_faces; ++f)
    for (int k = 0; k < 3; ++k) {  // corner k goes slightly beyond the opposite edge
      Points2 x = disk.plane;
      const int v = m.corner(f, k), p = m.corner(f, (k + 1) % 3), q = m.corner(f, (k + 2) % 3);
      const Eigen::RowVector2d middle = 0.5 * (x.row(p) + x.row(q)), from = x.row(v);
      x.row(v) = middle + 1e-6 * (middle - from);
      CHECK(!all_triangles_positive(m, x));
      CHECK(!is_injective(m, x));
    }
}

TEST_CASE("a triangle without area is not injective") {
  Disk disk = shapes::grid(2, 2);
  SUBCASE("corner on the opposite edge") {
    disk.plane.row(disk.mesh.triangles(0, 0)) = 0.5 * (disk.plane.row(disk.mesh.triangles(0, 1)) +
                                                       disk.plane.row(disk.mesh.triangles(0, 2)));
  }
  SUBCASE("two corners in one place") {
    disk.plane.row(disk.mesh.triangles(3, 0)) = disk.plane.row(disk.mesh.triangles(3, 1));
  }
  SUBCASE("everything on a line") { disk.plane.col(1) = 0.1 * disk.plane.col(0); }
  SUBCASE("everything in one place") { disk.plane.setConstant(0.3); }
  CHECK(!injective(disk));
}

TEST_CASE("a vertex around which the triangles turn twice is not injective") {
  for (int n : {7, 8, 9, 12, 20}) {
    CAPTURE(n);
    const Disk once = winding_fan(n, 1), twice = winding_fan(n, 2);
    const HalfEdgeMesh m = half_edges(twice.mesh);
    CHECK(angle_sums_are_full(m, once.plane));
    CHECK(all_triangles_positive(m, twice.plane));
    CHECK(!angle_sums_are_full(m, twice.plane));
    CHECK(!is_injective(m, twice.plane));
  }
  // On an integer grid, with edges exactly along the axes.
  Disk axes = shapes::fan(8);
  const int x[4] = {1, 0, -1, 0}, y[4] = {0, 1, 0, -1};
  for (int i = 0; i < 8; ++i) axes.plane.row(1 + i) << (1 + i) * x[i % 4], (1 + i) * y[i % 4];
  CHECK(all_triangles_positive(half_edges(axes.mesh), axes.plane));
  CHECK(!angle_sums_are_full(half_edges(axes.mesh), axes.plane));
  Disk four = shapes::fan(4);
  for (int i = 0; i < 4; ++i) four.plane.row(1 + i) << x[i], y[i];
  CHECK(injective(four));
}

TEST_CASE("a boundary that crosses itself is not injective though all triangles are positive") {
  const Disk overlapping = bent_strip(30, 7.0, 1, 2), spiral = bent_strip(30, 7.0, 1, 2, 3);
  const HalfEdgeMesh m = half_edges(overlapping.mesh);
  CHECK(all_triangles_positive(m, overlapping.plane));
  CHECK(angle_sums_are_full(m, overlapping.plane));
  CHECK(!boundaries_are_simple(m, overlapping.plane));
  CHECK(!is_injective(m, overlapping.plane));
  CHECK(injective(spiral));
}

TEST_CASE("openings are to stay apart and inside of the outer loop") {
  const Disk frame = shapes::cells(7, 3, [](int i, int j) { return j != 1 || (i != 2 && i != 4); });
  const HalfEdgeMesh m = half_edges(frame.mesh);
  REQUIRE(m.loops() == 3);
  REQUIRE(is_injective(m, frame.plane));
  const auto moved_column = [&](double x, double to) {  // of the vertices between the openings
    Points2 y = frame.plane;
    for (int v = 0; v < y.rows(); ++v)
      if (y(v, 0) == x && y(v, 1) > 0 && y(v, 1) < 3) y(v, 0) = to;
    return y;
  };
  CHECK(is_injective(m, moved_column(3, 3.9)));
  CHECK(!is_injective(m, moved_column(3, 4)));    // the openings touch
  CHECK(!is_injective(m, moved_column(3, 4.1)));  // and overlap
  CHECK(!is_injective(m, moved_column(5, 7)));    // one touches the outer loop
  CHECK(runs_counter_clockwise(m, frame.plane, 0));
  CHECK(!runs_counter_clockwise(m, frame.plane, 1));
  CHECK(!runs_counter_clockwise(m, frame.plane, 2));
  // A ring that winds twice around its opening: triangles and loops are fine, but not their sense.
  const int n = 12;
  shapes::DiskBuilder builder;
  for (int i = 0; i < n; ++i)
    for (double r : {1.0, 2.0})
      builder.vertex(r * std::cos(4 * shapes::kPi * i / n), r * std::sin(4 * shapes::kPi * i / n));
  for (int i = 0; i < n; ++i) {
    const int j = (i + 1) % n;
    builder.quad(2 * i, 2 * i + 1, 2 * j + 1, 2 * j);
  }
  CHECK(!injective(builder.build()));
}

TEST_CASE("of two surfaces each is to be injective, and either may lie over the other") {
  const Disk crossing = bent_strip(30, 7.0, 1, 2), simple = bent_strip(20, 6.0, 1, 2);
  const auto both = [](const Disk& a, const Disk& b) {
    return is_injective(shapes::joined(a.mesh, b.mesh).mesh, stacked(a.plane, b.plane));
  };
  CHECK(both(simple, simple));
  CHECK(both(simple, moved(simple, 0.5, {0.3, 0.1})));
  CHECK(!both(simple, crossing));
  CHECK(!both(crossing, simple));
}

TEST_CASE("a boundary that touches itself is not injective") {
  // A strip around a square whose ends meet, with integer coordinates.
  const auto ring = [](double end) {  // the last quad ends at x = end; it starts from x = 0
    const std::vector<Vector2d> right = {{0, -2}, {2, -2}, {2, 2}, {-2, 2}, {-2, -2}, {end, -2}};
    const std::vector<Vector2d> left = {{0, -1}, {1, -1}, {1, 1}, {-1, 1}, {-1, -1}, {end, -1}};
    return strip_along(right, left);
  };
  CHECK(injective(ring(-0.5)));
  CHECK(injective(ring(-0x1p-52)));
  CHECK(!injective(ring(0)));  // a common edge
  CHECK(!injective(ring(0x1p-52)));
  SUBCASE("vertex on a vertex") {
    Disk disk = ring(-0.5);
    disk.plane.row(disk.plane.rows() - 2) << 0, -2;
    CHECK(!injective(disk));
    disk.plane.row(disk.plane.rows() - 2) << -0x1p-52, -2;
    CHECK(injective(disk));
  }
  SUBCASE("vertex on an edge") {
    Disk disk = ring(-0.5);
    disk.plane.row(disk.plane.rows() - 2) << 0, -1.5;
    CHECK(!injective(disk));
    disk.plane.row(disk.plane.rows() - 2) << -0x1p-52, -1.5;
    CHECK(injective(disk));
  }
}

TEST_CASE("a boundary corner folded onto itself is not injective") {
  // Consecutive boundary edges on one line: straight on is fine, back is not.
  CHECK(!turns_back({0, 0}, {1, 0}, {2, 0}));
  CHECK(turns_back({0, 0}, {1, 0}, {0.5, 0}));
  CHECK(turns_back({0, 0}, {1, 0}, {-3, 0}));
  CHECK(turns_back({0, 0}, {1, 0}, {0, 0}));
  CHECK(!turns_back({0, 0}, {1, 0}, {0, 1e-300}));
  CHECK(injective(shapes::grid(5, 5)));  // straight rims
  // A fan around boundary vertex 0 that turns by exactly 2π: its rims lie on one another.
  shapes::DiskBuilder builder;
  for (const Vector2d& p : {Vector2d(0, 0), Vector2d(2, 0), Vector2d(0, 1), Vector2d(-1, -1),
                            Vector2d(1, -1), Vector2d(1, 0)})
    builder.vertex(p.x(), p.y());
  for (int i = 1; i < 5; ++i) builder.triangle(0, i, i + 1);
  Disk fold = builder.build();
  const HalfEdgeMesh m = half_edges(fold.mesh);
  CHECK(all_triangles_positive(m, fold.plane));
  CHECK(!is_injective(m, fold.plane));
  fold.plane.row(5) << 1, -0x1p-52;
  CHECK(is_injective(m, fold.plane));
}

TEST_CASE("coordinates outside the range of the predicates are not injective") {
  for (double bad : {std::numeric_limits<double>::quiet_NaN(),
                     std::numeric_limits<double>::infinity(), 1e130, 1e-130}) {
    CAPTURE(bad);
    Disk disk = shapes::triangle({0, 0}, {1, 0}, {0, 1});
    CHECK(injective(disk));
    disk.plane(0, 0) = -bad;
    CHECK(!injective(disk));
  }
}

// ---- segments ----

TEST_CASE("segments_touch knows crossings, contacts and near misses") {
  struct Case {
    Vec2 p, q, r, s;
    bool touch;
  };
  const double ulp = 0x1p-52;
  const Case cases[] = {
      {{0, 0}, {2, 2}, {0, 2}, {2, 0}, true},             // crossing
      {{0, 0}, {2, 0}, {1, 0}, {1, 1}, true},             // end on the inside
      {{0, 0}, {2, 0}, {1, ulp}, {1, 1}, false},          // just above
      {{0, 0}, {2, 0}, {2, 0}, {3, 1}, true},             // common end
      {{0, 0}, {2, 0}, {2 + 2 * ulp, 0}, {3, 1}, false},  // just beside the end
      {{0, 0}, {2, 0}, {1, 0}, {3, 0}, true},             // collinear, overlapping
      {{0, 0}, {2, 0}, {2, 0}, {3, 0}, true},             // collinear, common end
      {{0, 0}, {2, 0}, {2 + 2 * ulp, 0}, {3, 0}, false},  // collinear, apart
      {{0, 0}, {3, 3}, {1, 1}, {2, 2}, true},             // collinear, nested
      {{0, 0}, {1, 1}, {2, 2}, {3, 3}, false},            // collinear, apart
      {{0, 0}, {2, 2}, {0, 1}, {2, 3}, false},            // parallel
      {{0, 0}, {4, 0}, {5, -1}, {5, 1}, false},           // lines cross outside
      {{0, 0}, {1, 0}, {0.5, 2}, {0.5, 1}, false},        // lines cross outside
      {{0, 0}, {0, 3}, {0, 1}, {0, 2}, true},             // vertical, nested
      {{0, 0}, {2, 0}, {0, 0}, {2, 0}, true},             // equal
      {{1, 1}, {1, 1}, {0, 0}, {2, 2}, true},             // a point on a segment
      {{1, 1}, {1, 1}, {0, 0}, {2, 2 + 4 * ulp}, false},  // a point beside a segment
      {{1, 1}, {1, 1}, {1, 1}, {1, 1}, true}};            // a point on itself
  for (const Case& c : cases) {
    CAPTURE(&c - cases);
    for (int swap = 0; swap < 8; ++swap) {
      Vec2 p = c.p, q = c.q, r = c.r, s = c.s;
      if (swap & 1) std::swap(p, q);
      if (swap & 2) std::swap(r, s);
      if (swap & 4) std::swap(p, r), std::swap(q, s);
      CHECK(segments_touch(p, q, r, s) == c.touch);
    }
  }
}

TEST_CASE("segments_touch agrees with enumeration on an integer grid") {
  // Segments with ends on a 3×3 grid; touching if some point t, u of a fine lattice coincides.
  const auto brute_force = [](const int* c) {
    const int px = c[0], py = c[1], dx = c[2] - c[0], dy = c[3] - c[1];
    const int rx = c[4], ry = c[5], ex = c[6] - c[4], ey = c[7] - c[5];
    for (int m = 1; m <= 8; ++m)  // crossing parameters have denominators up to 8
      for (int t = 0; t <= m; ++t)
        for (int n = 1; n <= 8; ++n)
          for (int u = 0; u <= n; ++u)
            if ((px * m + t * dx) * n == (rx * n + u * ex) * m &&
                (py * m + t * dy) * n == (ry * n + u * ey) * m)
              return true;
    return false;
  };
  int wrong = 0, touching = 0;
  for (int code = 0; code < 6561; ++code) {
    int c[8], rest = code;
    for (int& digit : c) digit = rest % 3, rest /= 3;
    const auto end = [&](int k) { return shapes::to_vec2(Vector2d(c[k], c[k + 1])); };
    const bool touch = segments_touch(end(0), end(2), end(4), end(6));
    wrong += touch != brute_force(c);
    touching += touch;
  }
  CHECK(wrong == 0);
  CHECK(touching > 1000);
  CHECK(touching < 5500);
}

}  // namespace overlay_tests

#endif  // ISM_TESTS_PART_OVERLAY_HPP

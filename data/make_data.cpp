// make_data: writes the sample mesh pairs of ism.hpp.
//
//   g++ -std=c++17 -O2 -I/usr/include/eigen3 make_data.cpp -o make_data && ./make_data OUTDIR
//
// OUTDIR/{starfish,hand,face}/{A.obj,B.obj,landmarks.txt}: each pair shows one kind of shape twice,
// in two poses or as two persons. Every mesh is a disk (one boundary loop, Euler characteristic 1),
// counter-clockwise seen from outside, and the two meshes of a pair are tessellated independently.
// landmarks.txt pairs 0-based vertex ids, `<id in A> <id in B>`, of points that correspond exactly.
//
// A shape is the part of an implicit surface on one side of a cut, optionally bent by a map of
// space. It is polygonised by marching tetrahedra and then remeshed isotropically (split, collapse,
// flip, smooth), every vertex being kept on the analytic surface. Nothing here is random, so that
// each run writes the same files.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Tri = std::array<int, 3>;
using Field = std::function<double(const Vec3&)>;

constexpr double kPi = 3.14159265358979323846;
constexpr double kDegree = kPi / 180.0;

// ==== [1] SHAPES AS IMPLICIT SURFACES ==========================================================

struct Landmark {
  std::string name;
  Vec3 rest;  // on the surface, before the bend
};

// Zero set of `surface` (negative inside) where `cut` is negative, mapped by `bend` if there is one.
struct Shape {
  Field surface;
  Field cut;
  std::function<Vec3(const Vec3&)> bend;
  Field edge_length;  // wanted length of the edges, by place before the bend
  Vec3 low, high;     // box around the kept part, before the bend
  double cell = 0;    // of the grid that finds the topology: finer than every gap
  std::vector<Landmark> landmarks;
};

// Cubic smooth minimum: C2, and equal to the plain minimum where a and b differ by more than k.
double smooth_min(double a, double b, double k) {
  const double h = (std::max)(k - std::abs(a - b), 0.0) / k;
  return (std::min)(a, b) - h * h * h * k / 6.0;
}

double smooth_max(double a, double b, double k) { return -smooth_min(-a, -b, k); }

double smooth_step(double t) {
  const double u = (std::min)((std::max)(t, 0.0), 1.0);
  return u * u * (3.0 - 2.0 * u);
}

// Two balls of different radii and all the balls between them.
double tapered_capsule(const Vec3& p, const Vec3& a, const Vec3& b, double ra, double rb) {
  const Vec3 ab = b - a;
  const double t = (std::min)((std::max)((p - a).dot(ab) / ab.squaredNorm(), 0.0), 1.0);
  return (p - a - t * ab).norm() - (ra + t * (rb - ra));
}

// First-order distance: exact zero set, gradient of about unit length near it.
double ellipsoid(const Vec3& p, const Vec3& centre, const Vec3& radii) {
  const Vec3 q = (p - centre).cwiseQuotient(radii);
  const double slope = q.cwiseQuotient(radii).norm();
  const double n = q.norm();
  return slope < 1e-9 ? -radii.minCoeff() : n * (n - 1.0) / slope;
}

struct Bead {
  Vec3 at;
  double radius;
};

// Chain of tapered capsules through the beads.
double string_of_beads(const Vec3& p, const std::vector<Bead>& beads, double k) {
  double d = 1e9;
  for (std::size_t i = 0; i + 1 < beads.size(); ++i) {
    const Bead& a = beads[i];
    const Bead& b = beads[i + 1];
    d = smooth_min(d, tapered_capsule(p, a.at, b.at, a.radius, b.radius), k);
  }
  return d;
}

// First point of the surface met by a ray looking down the z axis from z = top.
Vec3 seen_from_above(const Field& surface, double x, double y, double top) {
  double z = top;
  while (z > -top && surface(Vec3(x, y, z)) > 0.0) z -= 0.01;
  double inside = z;
  double outside = z + 0.01;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (inside + outside);
    (surface(Vec3(x, y, middle)) > 0.0 ? outside : inside) = middle;
  }
  return Vec3(x, y, 0.5 * (inside + outside));
}

Vec3 gradient(const Field& f, const Vec3& p) {
  constexpr double kStep = 1e-5;
  Vec3 g;
  for (int i = 0; i < 3; ++i) {
    const Vec3 e = kStep * Vec3::Unit(i);
    g[i] = (f(p + e) - f(p - e)) / (2.0 * kStep);
  }
  return g;
}

// Newton steps of least length on to the surface, and on to the cut as well for the rim.
Vec3 project(const Shape& shape, Vec3 p, bool rim) {
  for (int i = 0; i < 12; ++i) {
    const double f = shape.surface(p);
    const double c = rim ? shape.cut(p) : 0.0;
    if (std::abs(f) + std::abs(c) < 1e-9) break;
    const Vec3 gf = gradient(shape.surface, p);
    if (!rim) {
      p -= f / gf.squaredNorm() * gf;
      continue;
    }
    const Vec3 gc = gradient(shape.cut, p);
    Eigen::Matrix<double, 2, 3> j;
    j << gf.transpose(), gc.transpose();
    const Eigen::Matrix2d gram = j * j.transpose();
    p -= j.transpose() * (gram.inverse() * Eigen::Vector2d(f, c));
  }
  return p;
}

Vec3 posed(const Shape& shape, const Vec3& p) { return shape.bend ? shape.bend(p) : p; }

Mat3 bend_jacobian(const Shape& shape, const Vec3& p) {
  Mat3 j = Mat3::Identity();
  if (!shape.bend) return j;
  constexpr double kStep = 1e-5;
  for (int i = 0; i < 3; ++i) {
    const Vec3 e = kStep * Vec3::Unit(i);
    j.col(i) = (shape.bend(p + e) - shape.bend(p - e)) / (2.0 * kStep);
  }
  return j;
}

// ==== [2] POLYGONISATION =======================================================================

struct Soup {
  std::vector<Vec3> points;
  std::vector<Tri> triangles;
};

// A cut at least this far from both ends of its edge leaves no slivers; vertices are moved on to
// the surface afterwards, so that nothing is lost by being inexact here.
double safe_fraction(double from, double to) {
  return (std::min)((std::max)(from / (from - to), 0.15), 0.85);
}

class MarchingTetrahedra {
 public:
  explicit MarchingTetrahedra(const Shape& shape) : shape_(shape) {
    for (int i = 0; i < 3; ++i)
      count_[i] = 2 + static_cast<int>((shape.high[i] - shape.low[i]) / shape.cell);
    value_.resize(static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]) *
                  static_cast<std::size_t>(count_[2]));
    for (int n = 0; n < static_cast<int>(value_.size()); ++n)
      value_[static_cast<std::size_t>(n)] = shape.surface(node_point(n));
  }

  Soup run() {
    for (int z = 0; z + 1 < count_[2]; ++z)
      for (int y = 0; y + 1 < count_[1]; ++y)
        for (int x = 0; x + 1 < count_[0]; ++x) cube(x, y, z);
    return soup_;
  }

 private:
  int node(int x, int y, int z) const { return x + count_[0] * (y + count_[1] * z); }
  double value(int n) const { return value_[static_cast<std::size_t>(n)]; }

  Vec3 node_point(int n) const {
    const int x = n % count_[0];
    const int y = n / count_[0] % count_[1];
    const int z = n / (count_[0] * count_[1]);
    return shape_.low + shape_.cell * Vec3(x, y, z);
  }

  // The six tetrahedra are the monotone paths from corner 000 to corner 111.
  void cube(int x, int y, int z) {
    constexpr int kOrder[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
    for (const auto& order : kOrder) {
      std::array<int, 3> at{x, y, z};
      std::array<int, 4> corner{};
      corner[0] = node(at[0], at[1], at[2]);
      for (std::size_t i = 0; i < 3; ++i) {
        ++at[static_cast<std::size_t>(order[i])];
        corner[i + 1] = node(at[0], at[1], at[2]);
      }
      tetrahedron(corner);
    }
  }

  void tetrahedron(const std::array<int, 4>& corner) {
    std::vector<int> in, out;
    for (int n : corner) (value(n) < 0.0 ? in : out).push_back(n);
    if (in.empty() || out.empty()) return;
    Vec3 outward = Vec3::Zero();
    for (int n : in) outward -= node_point(n) / static_cast<double>(in.size());
    for (int n : out) outward += node_point(n) / static_cast<double>(out.size());
    if (in.size() == 2) {
      const int a = crossing(in[0], out[0]), b = crossing(in[0], out[1]);
      const int c = crossing(in[1], out[1]), d = crossing(in[1], out[0]);
      emit(a, b, c, outward);
      emit(a, c, d, outward);
    } else if (in.size() == 1) {
      emit(crossing(in[0], out[0]), crossing(in[0], out[1]), crossing(in[0], out[2]), outward);
    } else {
      emit(crossing(in[0], out[0]), crossing(in[1], out[0]), crossing(in[2], out[0]), outward);
    }
  }

  int crossing(int in, int out) {
    const auto key = std::make_pair((std::min)(in, out), (std::max)(in, out));
    const auto [it, is_new] = on_edge_.emplace(key, static_cast<int>(soup_.points.size()));
    if (is_new) {
      const double t = safe_fraction(value(in), value(out));
      soup_.points.push_back((1.0 - t) * node_point(in) + t * node_point(out));
    }
    return it->second;
  }

  void emit(int a, int b, int c, const Vec3& outward) {
    const auto p = [this](int v) -> const Vec3& { return soup_.points[static_cast<std::size_t>(v)]; };
    if ((p(b) - p(a)).cross(p(c) - p(a)).dot(outward) < 0.0) std::swap(b, c);
    soup_.triangles.push_back({a, b, c});
  }

  const Shape& shape_;
  std::array<int, 3> count_{};
  std::vector<double> value_;
  std::map<std::pair<int, int>, int> on_edge_;
  Soup soup_;
};

// Keeps the part of a soup where `cut` is negative.
class Clipper {
 public:
  Clipper(const Soup& from, const Field& cut) : from_(from) {
    for (const Vec3& p : from.points) value_.push_back(cut(p));
  }

  Soup run() {
    for (const Tri& t : from_.triangles) triangle(t);
    return soup_;
  }

 private:
  double value(int v) const { return value_[static_cast<std::size_t>(v)]; }
  const Vec3& point(int v) const { return from_.points[static_cast<std::size_t>(v)]; }

  void triangle(const Tri& t) {
    std::vector<int> polygon;
    for (std::size_t i = 0; i < 3; ++i) {
      const int a = t[i], b = t[(i + 1) % 3];
      if (value(a) < 0.0) polygon.push_back(vertex(a, a));
      if ((value(a) < 0.0) != (value(b) < 0.0)) polygon.push_back(vertex(a, b));
    }
    for (std::size_t i = 2; i < polygon.size(); ++i)
      soup_.triangles.push_back({polygon[0], polygon[i - 1], polygon[i]});
  }

  // New id of the cut of edge ab, or of the kept vertex a if a == b.
  int vertex(int a, int b) {
    if (b < a) std::swap(a, b);
    const auto [it, is_new] =
        id_.emplace(std::make_pair(a, b), static_cast<int>(soup_.points.size()));
    if (is_new) {
      const double t = a == b ? 0.0 : safe_fraction(value(a), value(b));
      soup_.points.push_back((1.0 - t) * point(a) + t * point(b));
    }
    return it->second;
  }

  const Soup& from_;
  std::vector<double> value_;
  std::map<std::pair<int, int>, int> id_;
  Soup soup_;
};

// ==== [3] ISOTROPIC REMESHING ==================================================================

// Cosine-free angle at a of triangle abc, in radians.
double angle_at(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 u = b - a, v = c - a;
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

double min_angle(const Vec3& a, const Vec3& b, const Vec3& c) {
  return (std::min)({angle_at(a, b, c), angle_at(b, c, a), angle_at(c, a, b)});
}

struct Edge {
  int a, b;
  double length;  // relative to the wanted length
};

class Remesher {
 public:
  Remesher(const Shape& shape, const Soup& soup) : shape_(shape), triangles_(soup.triangles) {
    star_.resize(soup.points.size());
    for (int t = 0; t < static_cast<int>(triangles_.size()); ++t)
      for (int v : tri(t)) star(v).push_back(t);
    for (const Vec3& p : soup.points) vertices_.push_back({p, p, p, 0.0, false, false});
    for (const Edge& e : edges())
      if (triangles_at(e.a, e.b).size() == 1) vertex(e.a).rim = vertex(e.b).rim = true;
    for (Vertex& v : vertices_) place(v, v.rest);
  }

  void run() {
    for (int round = 0; round < 14; ++round) {
      split_long_edges();
      collapse_short_edges();
      for (int i = 0; i < 3; ++i) flip_and_smooth();
    }
    pin_landmarks();
    for (int i = 0; i < 12; ++i) flip_and_smooth();
    for (int i = 0; i < 4; ++i) improve_worst_angles();
    compact();
  }

  const std::vector<int>& landmark_ids() const { return landmark_ids_; }

  Soup result() const {
    Soup soup;
    for (const Vertex& v : vertices_) soup.points.push_back(v.at);
    soup.triangles = triangles_;
    return soup;
  }

 private:
  struct Vertex {
    Vec3 rest;         // on the implicit surface
    Vec3 at;           // where the bend takes it
    Vec3 normal;       // of the bent surface
    double wanted;     // edge length
    bool rim, pinned;  // on the boundary; a landmark
  };

  Vertex& vertex(int v) { return vertices_[static_cast<std::size_t>(v)]; }
  const Vertex& vertex(int v) const { return vertices_[static_cast<std::size_t>(v)]; }
  const Vec3& at(int v) const { return vertex(v).at; }
  Tri& tri(int t) { return triangles_[static_cast<std::size_t>(t)]; }
  const Tri& tri(int t) const { return triangles_[static_cast<std::size_t>(t)]; }
  std::vector<int>& star(int v) { return star_[static_cast<std::size_t>(v)]; }
  const std::vector<int>& star(int v) const { return star_[static_cast<std::size_t>(v)]; }

  static bool has(const Tri& t, int v) { return t[0] == v || t[1] == v || t[2] == v; }

  static int other(const Tri& t, int a, int b) {
    return t[0] + t[1] + t[2] - a - b;
  }

  void place(Vertex& v, const Vec3& rest) const {
    v.rest = project(shape_, rest, v.rim);
    v.at = posed(shape_, v.rest);
    const Vec3 n = gradient(shape_.surface, v.rest);
    v.normal = bend_jacobian(shape_, v.rest).inverse().transpose() * n;
    v.normal.normalize();
    v.wanted = shape_.edge_length(v.rest);
  }

  std::vector<int> neighbours(int v) const {
    std::vector<int> out;
    for (int t : star(v))
      for (int w : tri(t))
        if (w != v) out.push_back(w);
    std::sort(out.begin(), out.end());
    out.erase(std::unique(out.begin(), out.end()), out.end());
    return out;
  }

  std::vector<int> triangles_at(int a, int b) const {
    std::vector<int> out;
    for (int t : star(a))
      if (has(tri(t), b)) out.push_back(t);
    return out;
  }

  double relative_length(int a, int b) const {
    return (at(a) - at(b)).norm() * 2.0 / (vertex(a).wanted + vertex(b).wanted);
  }

  // All edges, shortest first.
  std::vector<Edge> edges() const {
    std::vector<Edge> out;
    for (int a = 0; a < static_cast<int>(vertices_.size()); ++a)
      for (int b : neighbours(a))
        if (a < b) out.push_back({a, b, relative_length(a, b)});
    std::stable_sort(out.begin(), out.end(),
                     [](const Edge& e, const Edge& f) { return e.length < f.length; });
    return out;
  }

  // Whether abc would be a triangle with the surface's own orientation and not a sliver.
  bool is_sound(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& normal) const {
    const Vec3 n = (b - a).cross(c - a);
    return n.dot(normal) > 0.3 * n.norm() * normal.norm() && min_angle(a, b, c) > 2.0 * kDegree;
  }

  bool is_sound(int a, int b, int c) const {
    return is_sound(at(a), at(b), at(c), vertex(a).normal + vertex(b).normal + vertex(c).normal);
  }

  void detach(int v, int t) {
    auto& s = star(v);
    s.erase(std::find(s.begin(), s.end(), t));
  }

  void replace(int t, int from, int to) {
    for (int& v : tri(t))
      if (v == from) v = to;
    detach(from, t);
    star(to).push_back(t);
  }

  void split_long_edges() {
    auto list = edges();
    std::reverse(list.begin(), list.end());
    for (const Edge& e : list) {
      if (e.length < 4.0 / 3.0) break;
      split(e.a, e.b);
    }
  }

  void split(int a, int b) {
    const std::vector<int> sides = triangles_at(a, b);
    const int m = static_cast<int>(vertices_.size());
    Vertex middle = vertex(a);
    middle.rim = sides.size() == 1;
    middle.pinned = false;
    place(middle, 0.5 * (vertex(a).rest + vertex(b).rest));
    vertices_.push_back(middle);
    star_.emplace_back();
    for (int t : sides) {
      const int fresh = static_cast<int>(triangles_.size());
      triangles_.push_back(tri(t));
      for (int v : tri(fresh)) star(v).push_back(fresh);
      replace(t, b, m);
      replace(fresh, a, m);
    }
  }

  void collapse_short_edges() {
    for (const Edge& e : edges()) {
      if (e.length > 4.0 / 5.0) break;
      if (star(e.a).empty() || star(e.b).empty()) continue;
      if (relative_length(e.a, e.b) > 4.0 / 5.0) continue;
      if (vertex(e.b).rim && !vertex(e.a).rim)
        collapse(e.b, e.a);
      else
        collapse(e.a, e.b);
    }
  }

  // Merges b into a if the mesh stays a disk and no triangle turns over.
  void collapse(int a, int b) {
    const std::vector<int> sides = triangles_at(a, b);
    if (sides.empty()) return;
    if (vertex(a).rim && vertex(b).rim && sides.size() != 1) return;
    const auto na = neighbours(a), nb = neighbours(b);
    std::vector<int> common;
    std::set_intersection(na.begin(), na.end(), nb.begin(), nb.end(), std::back_inserter(common));
    if (common.size() != sides.size()) return;
    Vertex merged = vertex(a);
    if (vertex(a).rim == vertex(b).rim)
      place(merged, 0.5 * (vertex(a).rest + vertex(b).rest));
    if (!may_move(a, b, merged) || !may_move(b, a, merged)) return;
    vertex(a) = merged;
    for (int t : sides) remove(t);
    const std::vector<int> rest = star(b);
    for (int t : rest) replace(t, b, a);
  }

  // Whether the triangles at v without `except` stay sound, and its edges short, at the new place.
  bool may_move(int v, int except, const Vertex& to) const {
    for (int t : star(v)) {
      if (has(tri(t), except)) continue;
      std::array<Vec3, 3> p;
      Vec3 normal = to.normal;
      for (std::size_t i = 0; i < 3; ++i) {
        const int w = tri(t)[i];
        p[i] = w == v ? to.at : at(w);
        if (w != v) normal += vertex(w).normal;
        if (w != v && (at(w) - to.at).norm() > 4.0 / 3.0 * to.wanted) return false;
      }
      if (!is_sound(p[0], p[1], p[2], normal)) return false;
    }
    return true;
  }

  void remove(int t) {
    for (int v : tri(t)) detach(v, t);
    tri(t) = {-1, -1, -1};
  }

  void flip_and_smooth() {
    for (int i = 0; i < 4 && flip_to_delaunay() > 0; ++i) {
    }
    for (int v = 0; v < static_cast<int>(vertices_.size()); ++v)
      if (!star(v).empty() && !vertex(v).pinned) smooth(v);
  }

  int flip_to_delaunay() {
    int flips = 0;
    for (const Edge& e : edges()) flips += flip(e.a, e.b) ? 1 : 0;
    return flips;
  }

  bool flip(int a, int b) {
    const std::vector<int> sides = triangles_at(a, b);
    if (sides.size() != 2) return false;
    const int c = other(tri(sides[0]), a, b), d = other(tri(sides[1]), a, b);
    if (angle_at(at(c), at(a), at(b)) + angle_at(at(d), at(a), at(b)) < kPi + 1e-6) return false;
    if (!triangles_at(c, d).empty()) return false;
    // With t0 running a, b, c the flipped pair is (a, d, c) and (d, b, c).
    const bool forward = follows(tri(sides[0]), a, b);
    const int u = forward ? a : b, w = forward ? b : a;
    if (!is_sound(u, d, c) || !is_sound(d, w, c)) return false;
    replace(sides[0], w, d);
    replace(sides[1], u, c);
    return true;
  }

  static bool follows(const Tri& t, int a, int b) {
    return (t[0] == a && t[1] == b) || (t[1] == a && t[2] == b) || (t[2] == a && t[0] == b);
  }

  // Moves v towards the centre of its neighbours, along the surface; a rim vertex along the rim.
  void smooth(int v) {
    Vec3 centre = Vec3::Zero();
    double weight = 0.0;
    for (int w : neighbours(v)) {
      if (vertex(v).rim && triangles_at(v, w).size() != 1) continue;
      const double inverse_length = 1.0 / vertex(w).wanted;
      centre += inverse_length * at(w);
      weight += inverse_length;
    }
    try_step(v, 0.6 * (centre / weight - at(v)));
  }

  // Moves v by a step in bent space, without its normal part, if all stays sound.
  bool try_step(int v, Vec3 step) {
    Vertex moved = vertex(v);
    step -= step.dot(moved.normal) * moved.normal;
    const Mat3 j = bend_jacobian(shape_, moved.rest);
    place(moved, moved.rest + j.inverse() * step);
    const double before = worst_angle(v, vertex(v)), after = worst_angle(v, moved);
    if (after < 12.0 * kDegree && after < before) return false;
    vertex(v) = moved;
    return true;
  }

  // Least angle in the star of v were v elsewhere; negative if a triangle would turn over.
  double worst_angle(int v, const Vertex& to) const {
    double worst = kPi;
    for (int t : star(v)) {
      std::array<Vec3, 3> p;
      Vec3 normal = Vec3::Zero();
      for (std::size_t i = 0; i < 3; ++i) {
        const Vertex& w = tri(t)[i] == v ? to : vertex(tri(t)[i]);
        p[i] = w.at;
        normal += w.normal;
      }
      if (!is_sound(p[0], p[1], p[2], normal)) return -1.0;
      worst = (std::min)(worst, min_angle(p[0], p[1], p[2]));
    }
    return worst;
  }

  // A compass search around each vertex whose worst angle is small.
  void improve_worst_angles() {
    for (int v = 0; v < static_cast<int>(vertices_.size()); ++v) {
      if (star(v).empty() || vertex(v).pinned) continue;
      double step = 0.15 * vertex(v).wanted;
      for (int i = 0; i < 4 && worst_angle(v, vertex(v)) < 34.0 * kDegree; ++i, step *= 0.6)
        compass_step(v, step);
    }
  }

  void compass_step(int v, double step) {
    const Vec3 n = vertex(v).normal;
    const Vec3 x = n.unitOrthogonal(), y = n.cross(x);
    for (int i = 0; i < 8; ++i) {
      const double angle = 2.0 * kPi * i / 8.0;
      const Vertex before = vertex(v);
      const double worst = worst_angle(v, before);
      if (!try_step(v, step * (std::cos(angle) * x + std::sin(angle) * y))) continue;
      if (worst_angle(v, vertex(v)) <= worst) vertex(v) = before;
    }
  }

  // The nearest free interior vertex is moved to each landmark, so that pairs correspond exactly.
  void pin_landmarks() {
    for (const Landmark& mark : shape_.landmarks) {
      const Vec3 goal = posed(shape_, mark.rest);
      int best = -1;
      for (int v = 0; v < static_cast<int>(vertices_.size()); ++v) {
        if (star(v).empty() || vertex(v).rim || vertex(v).pinned) continue;
        if (best < 0 || (at(v) - goal).norm() < (at(best) - goal).norm()) best = v;
      }
      place(vertex(best), mark.rest);
      vertex(best).pinned = true;
      landmark_ids_.push_back(best);
    }
  }

  void compact() {
    std::vector<int> id(vertices_.size(), -1);
    std::vector<Vertex> kept;
    for (std::size_t v = 0; v < vertices_.size(); ++v) {
      if (star_[v].empty()) continue;
      id[v] = static_cast<int>(kept.size());
      kept.push_back(vertices_[v]);
    }
    triangles_.erase(std::remove_if(triangles_.begin(), triangles_.end(),
                                    [](const Tri& t) { return t[0] < 0; }),
                     triangles_.end());
    for (Tri& t : triangles_)
      for (int& v : t) v = id[static_cast<std::size_t>(v)];
    for (int& v : landmark_ids_) v = id[static_cast<std::size_t>(v)];
    vertices_ = kept;
  }

  const Shape& shape_;
  std::vector<Vertex> vertices_;
  std::vector<Tri> triangles_;
  std::vector<std::vector<int>> star_;
  std::vector<int> landmark_ids_;
};

// ==== [4] STARFISH =============================================================================

constexpr int kArms = 5;
constexpr double kArmReach = 0.90;     // centre to the centre of the rounded tip
constexpr double kDiscRadius = 0.36;   // arms bend only beyond it, so that neighbours agree
constexpr double kFlatness = 0.80;     // height of a cross-section over half its width

struct ArmPose {
  double yaw;       // turn of the tip in the plane, degrees
  double wave;      // S-shaped part of the turn, degrees
  double pitch;     // lift of the tip, degrees
};

Mat3 arm_frame(int arm) {
  return Eigen::AngleAxisd(kPi / 2.0 + 2.0 * kPi * arm / kArms, Vec3::UnitZ()).toRotationMatrix();
}

double starfish_surface(const Vec3& p) {
  double d = 1e9;
  for (int arm = 0; arm < kArms; ++arm) {
    Vec3 q = arm_frame(arm).transpose() * p;
    q.z() /= kFlatness;
    const std::vector<Bead> arm_beads{{Vec3::Zero(), 0.235},
                                      {Vec3(0.30, 0, 0), 0.165},
                                      {Vec3(0.60, 0, 0), 0.118},
                                      {Vec3(kArmReach, 0, 0), 0.068}};
    d = smooth_min(d, string_of_beads(q, arm_beads, 0.08), 0.14);
  }
  return d;
}

// Tangent angles of an arm's centre line, from the rim of the disc (u = 0) to the tip (u = 1).
Eigen::Vector2d arm_angles(const ArmPose& pose, double u) {
  const double rise = u * u * (1.5 - 0.5 * u);
  const double wave = std::sin(2.0 * kPi * (std::min)(u, 1.1)) * u;
  return kDegree * Eigen::Vector2d(pose.yaw * rise + pose.wave * wave, pose.pitch * rise);
}

Vec3 arm_tangent(const Eigen::Vector2d& a) {
  return Vec3(std::cos(a[0]) * std::cos(a[1]), std::sin(a[0]) * std::cos(a[1]), std::sin(a[1]));
}

// Carries q = (along, across, up), in an arm's own frame, along its bent centre line.
Vec3 bend_arm(const ArmPose& pose, const Vec3& q) {
  if (q.x() <= kDiscRadius) return q;
  constexpr int kSteps = 24;
  const double length = q.x() - kDiscRadius;
  const double scale = 1.0 / (1.0 - kDiscRadius);
  Vec3 centre(kDiscRadius, 0, 0);
  for (int i = 0; i < kSteps; ++i)
    centre += length / kSteps * arm_tangent(arm_angles(pose, scale * length * (i + 0.5) / kSteps));
  const Eigen::Vector2d angles = arm_angles(pose, scale * length);
  const Vec3 across(-std::sin(angles[0]), std::cos(angles[0]), 0);
  return centre + q.y() * across + q.z() * arm_tangent(angles).cross(across);
}

Vec3 bend_starfish(const std::array<ArmPose, kArms>& poses, const Vec3& p) {
  int best = 0;
  for (int arm = 1; arm < kArms; ++arm)
    if (arm_frame(arm).col(0).dot(p) > arm_frame(best).col(0).dot(p)) best = arm;
  const Mat3 frame = arm_frame(best);
  return frame * bend_arm(poses[static_cast<std::size_t>(best)], frame.transpose() * p);
}

Shape starfish(bool alive) {
  constexpr std::array<ArmPose, kArms> kAlive{{{-62.0, 12.0, 18.0},
                                               {58.0, -20.0, 50.0},
                                               {-15.0, 34.0, -8.0},
                                               {75.0, 5.0, 8.0},
                                               {-48.0, -22.0, 62.0}}};
  Shape shape;
  shape.surface = starfish_surface;
  shape.cut = [](const Vec3& p) { return -p.z(); };
  if (alive) shape.bend = [kAlive](const Vec3& p) { return bend_starfish(kAlive, p); };
  const double length = alive ? 0.0415 : 0.0445;
  shape.edge_length = [length](const Vec3&) { return length; };
  shape.cell = alive ? 0.0293 : 0.0317;
  shape.low = Vec3(-1.1031, -1.1017, -0.1013);
  shape.high = Vec3(1.1, 1.1, 0.4);
  shape.landmarks.push_back({"centre", seen_from_above(starfish_surface, 0, 0, 1.0)});
  for (int arm = 0; arm < kArms; ++arm) {
    const Vec3 near_tip = (kArmReach + 0.02) * arm_frame(arm).col(0);
    shape.landmarks.push_back({"tip of arm " + std::to_string(arm + 1),
                               seen_from_above(starfish_surface, near_tip.x(), near_tip.y(), 1.0)});
  }
  return shape;
}

// ==== [5] HAND =================================================================================

// A right hand, fingers up (+y), palm towards the viewer (+z), thumb on the +x side.
struct Finger {
  std::string name;
  Vec3 base;                     // knuckle
  Vec3 straight;                 // direction when stretched
  Vec3 toward;                   // direction it curls to
  std::array<double, 3> bones;   // lengths
  std::array<double, 4> radii;   // at the knuckle, the two joints and the tip
  std::array<double, 3> flex;    // at the knuckle and the two joints, degrees
};

std::vector<Bead> finger_beads(const Finger& f) {
  const Vec3 ahead = f.straight.normalized();
  const Vec3 toward = (f.toward - f.toward.dot(ahead) * ahead).normalized();
  std::vector<Bead> beads{{f.base, f.radii[0]}};
  double angle = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    angle += f.flex[i] * kDegree;
    const Vec3 bone = f.bones[i] * (std::cos(angle) * ahead + std::sin(angle) * toward);
    beads.push_back({beads.back().at + bone, f.radii[i + 1]});
  }
  return beads;
}

Vec3 finger_tip(const Finger& f) {
  const auto beads = finger_beads(f);
  const Vec3 along = (beads[3].at - beads[2].at).normalized();
  return beads[3].at + beads[3].radius * along;
}

struct HandPose {
  std::array<double, 4> spread;               // index to little finger, degrees towards the thumb
  std::array<std::array<double, 3>, 4> flex;  // degrees
  Vec3 thumb_straight, thumb_toward;
  std::array<double, 3> thumb_flex;
};

std::vector<Finger> hand_fingers(const HandPose& pose) {
  using Bones = std::array<double, 3>;
  using Radii = std::array<double, 4>;
  const std::array<const char*, 4> names{"index", "middle", "ring", "little"};
  const std::array<Vec3, 4> bases{Vec3(0.285, 0.97, 0), Vec3(0.095, 1.01, 0),
                                  Vec3(-0.095, 0.97, 0), Vec3(-0.275, 0.87, 0)};
  const std::array<Bones, 4> bones{Bones{0.43, 0.26, 0.17}, Bones{0.48, 0.30, 0.18},
                                   Bones{0.44, 0.28, 0.18}, Bones{0.35, 0.20, 0.15}};
  const std::array<Radii, 4> radii{Radii{0.108, 0.098, 0.089, 0.075},
                                   Radii{0.110, 0.100, 0.091, 0.077},
                                   Radii{0.106, 0.095, 0.086, 0.073},
                                   Radii{0.095, 0.083, 0.075, 0.064}};
  std::vector<Finger> fingers;
  for (std::size_t i = 0; i < 4; ++i) {
    const double spread = pose.spread[i] * kDegree;
    const Vec3 straight(std::sin(spread), std::cos(spread), 0);
    fingers.push_back({std::string(names[i]) + " finger tip", bases[i], straight, Vec3::UnitZ(),
                       bones[i], radii[i], pose.flex[i]});
  }
  fingers.push_back({"thumb tip", Vec3(0.19, 0.20, 0.04), pose.thumb_straight, pose.thumb_toward,
                     {0.40, 0.30, 0.19}, {0.150, 0.120, 0.108, 0.082}, pose.thumb_flex});
  return fingers;
}

double palm(const Vec3& p, const std::vector<Finger>& fingers) {
  double d = 1e9;
  for (std::size_t i = 0; i < 4; ++i) {
    const Vec3 root(0.13 - 0.085 * static_cast<double>(i), 0.06, -0.01);
    d = smooth_min(d, tapered_capsule(p, root, fingers[i].base, 0.125, 0.105), 0.10);
  }
  const double heel = ellipsoid(p, Vec3(-0.21, 0.38, 0.05), Vec3(0.15, 0.34, 0.13));
  d = smooth_min(d, heel, 0.12);
  for (double side : {-0.085, 0.085}) {
    const Vec3 low(side, -0.6, -0.02), high(0.95 * side, 0.05, -0.01);
    d = smooth_min(d, tapered_capsule(p, low, high, 0.165, 0.130), 0.12);
  }
  return d;
}

double hand_surface(const Vec3& p, const std::vector<Finger>& fingers) {
  const double body = palm(p, fingers);
  double d = body;
  for (std::size_t i = 0; i < fingers.size(); ++i) {
    const bool thumb = i == 4;
    const double finger = string_of_beads(p, finger_beads(fingers[i]), 0.03);
    // Each finger is blended with the palm alone: blending it with its neighbours would web them.
    d = smooth_min(d, smooth_min(body, finger, thumb ? 0.20 : 0.10), 0.02);
  }
  const double hollow = ellipsoid(p, Vec3(0.0, 0.62, 0.27), Vec3(0.17, 0.30, 0.17));
  return smooth_max(d, -hollow, 0.12);
}

HandPose flat_hand() {
  return {{15.0, 3.0, -9.0, -24.0},
          {{{4, 4, 3}, {3, 5, 3}, {4, 6, 4}, {5, 7, 5}}},
          Vec3(0.74, 0.66, 0.16),
          Vec3(-0.3, 0.8, 0.3),
          {0, 14, 10}};
}

HandPose posed_hand() {
  return {{17.0, -5.0, -6.0, -16.0},
          {{{-4, 6, 4}, {0, 8, 5}, {62, 58, 30}, {54, 52, 28}}},
          Vec3(0.40, 0.62, 0.60),
          Vec3(-0.8, 0.3, 0.1),
          {0, 35, 25}};
}

// Finer edges at the finger tips, where the surface is most curved.
double hand_edge_length(const Vec3& p, const std::vector<Vec3>& tips, double length) {
  double nearest = 1e9;
  for (const Vec3& tip : tips) nearest = (std::min)(nearest, (p - tip).norm());
  return length * (0.7 + 0.3 * smooth_step((nearest - 0.07) / 0.25));
}

Shape hand(bool second) {
  const std::vector<Finger> fingers = hand_fingers(second ? posed_hand() : flat_hand());
  Shape shape;
  shape.surface = [fingers](const Vec3& p) { return hand_surface(p, fingers); };
  shape.cut = [](const Vec3& p) { return -0.20 - p.y(); };
  const double length = second ? 0.0545 : 0.0560;
  std::vector<Vec3> tips;
  for (const Finger& f : fingers) tips.push_back(finger_beads(f).back().at);
  shape.edge_length = [length, tips](const Vec3& p) { return hand_edge_length(p, tips, length); };
  shape.cell = second ? 0.0283 : 0.0271;
  shape.low = Vec3(-0.9013, -0.2817, -0.4019);
  shape.high = Vec3(1.1, 2.15, 0.95);
  for (const Finger& f : fingers)
    shape.landmarks.push_back({f.name, project(shape, finger_tip(f), false)});
  return shape;
}

// ==== [6] FACE =================================================================================

// A bare head whose front is raised along z by a sum of bumps and grooves, one per feature.
// Frontal coordinates: x to the viewer's right, y up, z towards the viewer.
struct Face {
  double width, jaw_width, chin_y;
  double eye_x, eye_y, eye_half_width, eye_half_height;
  double brow_y, brow_arch;
  double nose_y, nose_depth, nose_half_width;
  double mouth_y, mouth_half_width, smile, lip;
  double cheek_y, cheek_size;
};

Face neutral_face() {
  Face f{};
  f.width = 0.74, f.jaw_width = 0.58, f.chin_y = -0.88;
  f.eye_x = 0.275, f.eye_y = 0.20, f.eye_half_width = 0.135, f.eye_half_height = 0.058;
  f.brow_y = 0.345, f.brow_arch = 0.035;
  f.nose_y = -0.15, f.nose_depth = 0.21, f.nose_half_width = 0.105;
  f.mouth_y = -0.44, f.mouth_half_width = 0.215, f.smile = 0.005, f.lip = 0.046;
  f.cheek_y = -0.02, f.cheek_size = 0.045;
  return f;
}

Face smiling_face() {
  Face f{};
  f.width = 0.83, f.jaw_width = 0.68, f.chin_y = -0.87;
  f.eye_x = 0.305, f.eye_y = 0.20, f.eye_half_width = 0.145, f.eye_half_height = 0.050;
  f.brow_y = 0.400, f.brow_arch = 0.075;
  f.nose_y = -0.21, f.nose_depth = 0.27, f.nose_half_width = 0.135;
  f.mouth_y = -0.525, f.mouth_half_width = 0.320, f.smile = 0.120, f.lip = 0.042;
  f.cheek_y = -0.07, f.cheek_size = 0.085;
  return f;
}

double head(const Vec3& p, const Face& f) {
  const double skull = ellipsoid(p, Vec3(0, 0.28, -0.12), Vec3(f.width, 0.80, 0.76));
  const double jaw =
      ellipsoid(p, Vec3(0, -0.34, -0.10), Vec3(f.jaw_width, -0.34 - f.chin_y, 0.70));
  return smooth_min(skull, jaw, 0.40);
}

double bell(double t) { return std::exp(-t * t); }

double bell(double x, double y) { return std::exp(-x * x - y * y); }

// About 1 for |t| < 1 and about 0 beyond.
double window(double t) { return std::exp(-t * t * t * t); }

// Eye on the side where x, measured away from the nose, is positive.
double eye_relief(const Face& f, double x, double y) {
  const double dx = x - f.eye_x, u = dx / f.eye_half_width;
  const double dy = y - f.eye_y - 0.08 * dx;
  const double arch = 1.0 - u * u;
  const double upper = f.eye_half_height * arch, lower = -0.7 * f.eye_half_height * arch;
  const double gap = (std::min)(upper - dy, dy - lower);
  double z = -0.080 * bell(dx / 0.20, (dy - 0.02) / 0.11);
  z -= 0.035 * bell((u + 1.05) / 0.6, (dy - 0.03) / 0.07);
  z += 0.085 * bell(0.85 * u, dy / (f.eye_half_height + 0.045));
  z -= 0.026 * smooth_step(gap / 0.028 + 0.4);
  z += 0.012 * bell((dy - upper - 0.010) / 0.022) * window(0.95 * u);
  z -= 0.022 * bell((dy - upper - 0.055) / 0.025) * window(u);
  return z - 0.016 * bell(dx / 0.032, (dy - 0.004) / 0.032);
}

double brow_relief(const Face& f, double x, double y) {
  const double u = (x - f.eye_x) / (f.eye_half_width + 0.07);
  const double line = f.brow_y + f.brow_arch * (1.0 - u * u) - 0.02 * u;
  return 0.055 * bell((y - line) / 0.050) * window(u);
}

double cheek_relief(const Face& f, double x, double y) {
  const double s = x - 0.54 * f.width, t = y - f.cheek_y;
  double z = f.cheek_size * bell(s / 0.17, t / 0.15);
  z -= 0.035 * bell((x - 0.55 * f.width) / 0.16, (y + 0.42) / 0.20);
  // The fold from the nose to the mouth corner deepens as one smiles.
  const double along = (f.nose_y - y) / (f.nose_y - f.mouth_y);
  const double fold = f.nose_half_width + 0.05 + (f.mouth_half_width - 0.05) * 0.55 * along;
  return z - (0.008 + 0.25 * f.smile) * bell((x - fold) / 0.045) * window((along - 0.5) / 0.75);
}

double nose_relief(const Face& f, double x, double y) {
  const double root = f.eye_y + 0.10;
  const double t = (root - y) / (root - f.nose_y);  // 0 at the root, 1 at the tip
  const double height = f.nose_depth * smooth_step(0.85 * t + 0.08);
  const double under = smooth_step((y - f.nose_y + 0.105) / 0.085);
  const double half = 0.048 + 0.040 * smooth_step(1.4 * t - 0.4);
  const double u = std::abs(x) / half;
  double z = 0.82 * height * under / (1.0 + std::pow(u, 3.0));
  z += 0.18 * f.nose_depth * bell(x / 0.075, (y - f.nose_y) / 0.065);
  const double s = std::abs(x) - f.nose_half_width;
  const double wing = 0.42 * f.nose_depth * bell(s / 0.042, (y - f.nose_y + 0.030) / 0.052);
  return z + wing;
}

double mouth_relief(const Face& f, double x, double y) {
  const double u = x / f.mouth_half_width;
  const double arch = (std::max)(1.0 - u * u, 0.0);
  const double line = f.mouth_y + f.smile * u * u;
  const double bow = 0.25 * f.lip * (bell((std::abs(x) - 0.05) / 0.045) - bell(x / 0.03));
  const double v = y - line;
  const double full = std::sqrt(arch + 0.02) * window(0.95 * u);
  double z = 0.050 * bell(x / 0.26, (y - f.mouth_y) / 0.19);
  z += 0.062 * full * bell((v - 0.75 * f.lip * arch - bow) / (0.80 * f.lip));
  z += 0.068 * full * bell((v + 0.95 * f.lip * arch) / (0.95 * f.lip));
  z -= 0.055 * bell(v / 0.019) * window(u);
  z -= 0.020 * bell((std::abs(u) - 1.04) / 0.14, v / 0.04);
  z -= 0.018 * bell(x / 0.025) * window((y - 0.5 * (f.nose_y - 0.06 + f.mouth_y + 0.07)) / 0.06);
  return z - 0.045 * bell(x / 0.17, (v + 2.9 * f.lip) / 0.05);
}

double face_relief(const Face& f, double x, double y) {
  double z = nose_relief(f, x, y) + mouth_relief(f, x, y);
  for (double side : {-x, x})
    z += eye_relief(f, side, y) + brow_relief(f, side, y) + cheek_relief(f, side, y);
  z += 0.075 * bell(x / 0.16, (y - f.chin_y - 0.13) / 0.10);
  return z - 0.030 * bell((std::abs(x) - 0.60) / 0.13, (y - 0.34) / 0.20);
}

double face_surface(const Vec3& p, const Face& f) {
  return head(p - Vec3(0, 0, face_relief(f, p.x(), p.y())), f);
}

// Keeps the front of the head below the hairline.
double face_cut(const Vec3& p, const Face& f) {
  const double back = 0.04 - p.z() - 0.10 * p.y();
  const double oval = std::hypot(p.x() / (f.width + 0.02), (p.y() + 0.10) / 0.92) - 1.0;
  return smooth_max(0.7 * oval, back, 0.15);
}

void add_face_landmarks(Shape& shape, const Face& f) {
  const auto add = [&shape](const std::string& name, double x, double y) {
    shape.landmarks.push_back({name, seen_from_above(shape.surface, x, y, 1.5)});
  };
  add("nose tip", 0, f.nose_y);
  add("chin", 0, f.chin_y + 0.13);
  for (double s : {-1.0, 1.0}) {
    const std::string side = s < 0 ? "right " : "left ";
    const double in = f.eye_x - f.eye_half_width, out = f.eye_x + f.eye_half_width;
    add(side + "inner eye corner", s * in, f.eye_y - 0.08 * f.eye_half_width);
    add(side + "outer eye corner", s * out, f.eye_y + 0.08 * f.eye_half_width);
    add(side + "brow", s * f.eye_x, f.brow_y + f.brow_arch);
    add(side + "mouth corner", s * f.mouth_half_width, f.mouth_y + f.smile);
  }
}

// Finer edges where the eyes, nose and mouth are.
double face_edge_length(const Vec3& p, const Face& f) {
  const double eyes = std::hypot((std::abs(p.x()) - f.eye_x) / 0.20, (p.y() - f.eye_y) / 0.13);
  const double nose = std::hypot(p.x() / 0.16, (p.y() - f.nose_y) / 0.16);
  const double mouth =
      std::hypot(p.x() / (f.mouth_half_width + 0.05), (p.y() - f.mouth_y - 0.4 * f.smile) / 0.12);
  const double near = (std::min)({eyes, nose, mouth});
  return 0.031 + 0.035 * smooth_step((near - 0.8) / 1.8);
}

Shape face(bool second) {
  const Face f = second ? smiling_face() : neutral_face();
  Shape shape;
  shape.surface = [f](const Vec3& p) { return face_surface(p, f); };
  shape.cut = [f](const Vec3& p) { return face_cut(p, f); };
  const double scale = second ? 1.05 : 1.0;
  shape.edge_length = [f, scale](const Vec3& p) { return scale * face_edge_length(p, f); };
  shape.cell = second ? 0.0253 : 0.0247;
  shape.low = Vec3(-1.0013, -1.1017, -0.2019);
  shape.high = Vec3(1.0, 1.2, 1.1);
  add_face_landmarks(shape, f);
  return shape;
}

// ==== [7] FILES ================================================================================

struct Mesh {
  Soup soup;
  std::vector<int> landmarks;
};

struct Summary {
  int boundary_loops = 0;
  int euler = 0;
  bool manifold = true;
  double least_angle = 180.0;  // degrees
};

int count_loops(std::map<int, int> next) {
  int loops = 0;
  for (; !next.empty(); ++loops)
    for (auto it = next.begin(); it != next.end();) {
      const int to = it->second;
      next.erase(it);
      it = next.find(to);
    }
  return loops;
}

Summary summarise(const Soup& soup) {
  std::map<std::pair<int, int>, int> half_edges;
  Summary s;
  for (const Tri& t : soup.triangles) {
    const auto p = [&](std::size_t i) { return soup.points[static_cast<std::size_t>(t[i])]; };
    s.least_angle = (std::min)(s.least_angle, min_angle(p(0), p(1), p(2)) / kDegree);
    for (std::size_t i = 0; i < 3; ++i)
      if (++half_edges[{t[i], t[(i + 1) % 3]}] > 1) s.manifold = false;
  }
  std::map<int, int> rim;
  for (const auto& [edge, count] : half_edges)
    if (half_edges.count({edge.second, edge.first}) == 0)
      s.manifold = rim.emplace(edge.second, edge.first).second && s.manifold;
  s.boundary_loops = count_loops(rim);
  const auto edges = (half_edges.size() + rim.size()) / 2;
  s.euler = static_cast<int>(soup.points.size() + soup.triangles.size()) - static_cast<int>(edges);
  return s;
}

Mesh build(const Shape& shape) {
  const Soup grid = MarchingTetrahedra(shape).run();
  Remesher remesher(shape, Clipper(grid, shape.cut).run());
  remesher.run();
  return {remesher.result(), remesher.landmark_ids()};
}

bool write_obj(const Mesh& mesh, const std::filesystem::path& path) {
  std::FILE* file = std::fopen(path.string().c_str(), "wb");
  if (file == nullptr) return false;
  for (const Vec3& p : mesh.soup.points)
    std::fprintf(file, "v %.6f %.6f %.6f\n", p.x(), p.y(), p.z());
  for (const Tri& t : mesh.soup.triangles)
    std::fprintf(file, "f %d %d %d\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return std::fclose(file) == 0;
}

bool write_landmarks(const Mesh& a, const Mesh& b, const std::vector<Landmark>& marks,
                     const std::filesystem::path& path) {
  std::FILE* file = std::fopen(path.string().c_str(), "wb");
  if (file == nullptr) return false;
  std::fprintf(file, "# vertex of A.obj, vertex of B.obj, counted from 0\n");
  for (std::size_t i = 0; i < marks.size(); ++i)
    std::fprintf(file, "%d %d  # %s\n", a.landmarks[i], b.landmarks[i], marks[i].name.c_str());
  return std::fclose(file) == 0;
}

// Prints one line about the mesh; false if it is not a disk.
bool report(const char* pair, const char* side, const Mesh& mesh) {
  const Summary s = summarise(mesh.soup);
  std::printf("%-9s %s  %5zu vertices  %5zu triangles  least angle %4.1f\n", pair, side,
              mesh.soup.points.size(), mesh.soup.triangles.size(), s.least_angle);
  return s.manifold && s.boundary_loops == 1 && s.euler == 1;
}

bool write_pair(const std::filesystem::path& out, const char* name, Shape (*make)(bool)) {
  const Shape first = make(false), second = make(true);
  const Mesh a = build(first), b = build(second);
  const bool disks = report(name, "A", a) && report(name, "B", b);
  if (!disks) std::fprintf(stderr, "%s: not a disk\n", name);
  const std::filesystem::path folder = out / name;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  return disks && write_obj(a, folder / "A.obj") && write_obj(b, folder / "B.obj") &&
         write_landmarks(a, b, first.landmarks, folder / "landmarks.txt");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s OUTDIR\n", argv[0]);
    return 2;
  }
  const bool ok = write_pair(argv[1], "starfish", starfish) && write_pair(argv[1], "hand", hand) &&
                  write_pair(argv[1], "face", face);
  return ok ? 0 : 1;
}

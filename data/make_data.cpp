// make_data: writes the sample mesh pairs of ism.hpp.
//
//   g++ -std=c++17 -O2 -I/usr/include/eigen3 make_data.cpp -o make_data && ./make_data OUTDIR
//
// OUTDIR/{starfish,hand,face}/{A.obj,B.obj,landmarks.txt}: each pair shows one kind of shape twice,
// in two poses or as two persons. Every mesh is a disk (one boundary loop, Euler characteristic 1),
// counter-clockwise seen from outside, and the two meshes of a pair are tessellated independently.
// landmarks.txt pairs 0-based vertex ids, `<id in A> <id in B>`, of points that correspond.
//
// A shape is the part of an implicit surface on one side of a cut. It is polygonised by marching
// tetrahedra and then remeshed isotropically (split, collapse, flip, smooth), every vertex being
// kept on the analytic surface. Nothing here is random, so that each run writes the same files.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace {

using Vec3 = Eigen::Vector3d;
using Tri = std::array<int, 3>;
using Field = std::function<double(const Vec3&)>;

constexpr double kPi = 3.14159265358979323846;
constexpr double kDegree = kPi / 180.0;

template <class List>
auto& item(List& list, int i) {
  return list[static_cast<std::size_t>(i)];
}

template <class List>
int size_of(const List& list) {
  return static_cast<int>(list.size());
}

// ==== [1] SHAPES AS IMPLICIT SURFACES ==========================================================

struct Landmark {
  std::string name;
  Vec3 at;
};

// Zero set of `surface` (negative inside) where `cut` is negative.
struct Shape {
  Field surface;
  Field cut;
  Field edge_length;  // wanted, by place
  Vec3 low, high;     // box around the kept part
  double cell = 0;    // of the grid that finds the topology: finer than every gap
  std::vector<Landmark> landmarks;
};

// Cubic smooth minimum: C2, and equal to the plain minimum where a and b differ by more than k.
double smooth_min(double a, double b, double k) {
  const double h = (std::max)(k - std::abs(a - b), 0.0) / k;
  return (std::min)(a, b) - h * h * h * k / 6.0;
}

double smooth_step(double t) {
  const double u = (std::min)((std::max)(t, 0.0), 1.0);
  return u * u * (3.0 - 2.0 * u);
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

// Two balls and all the balls between them.
double capsule(const Vec3& p, const Bead& a, const Bead& b) {
  const Vec3 ab = b.at - a.at;
  const double along = (p - a.at).dot(ab) / ab.squaredNorm();
  const double t = (std::min)((std::max)(along, 0.0), 1.0);
  return (p - a.at - t * ab).norm() - (a.radius + t * (b.radius - a.radius));
}

double string_of_beads(const Vec3& p, const std::vector<Bead>& beads, double k) {
  double d = 1e9;
  for (int i = 0; i + 1 < size_of(beads); ++i)
    d = smooth_min(d, capsule(p, item(beads, i), item(beads, i + 1)), k);
  return d;
}

// Edges are finer where a surface is most curved.
double finer_near(const std::vector<Vec3>& places, const Vec3& p, double length) {
  double nearest = 1e9;
  for (const Vec3& place : places) nearest = (std::min)(nearest, (p - place).norm());
  return length * (0.6 + 0.4 * smooth_step((nearest - 0.07) / 0.28));
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
    Eigen::Matrix<double, 2, 3> j;
    j << gf.transpose(), gradient(shape.cut, p).transpose();
    const Eigen::Matrix2d gram = j * j.transpose();
    p -= j.transpose() * (gram.inverse() * Eigen::Vector2d(f, c));
  }
  return p;
}

void add_landmark(Shape& shape, const std::string& name, const Vec3& near) {
  shape.landmarks.push_back({name, project(shape, near, false)});
}

// ==== [2] POLYGONISATION =======================================================================

struct Mesh {
  std::vector<Vec3> points;
  std::vector<Tri> triangles;
  std::vector<int> landmarks;
};

// A mesh whose vertices are nodes of another complex, or cuts of its edges.
struct CutMesh {
  Mesh mesh;
  std::map<std::pair<int, int>, int> ids;

  // The cut of edge ab, or the node a if a == b. A cut at least this far from both ends leaves no
  // slivers; vertices are moved on to the surface later, so nothing is lost by being inexact.
  int vertex(int a, int b, const Vec3& p, const Vec3& q, double value_p, double value_q) {
    const auto [it, is_new] = ids.emplace(std::minmax({a, b}), size_of(mesh.points));
    const double t = (std::min)((std::max)(value_p / (value_p - value_q), 0.15), 0.85);
    if (is_new) mesh.points.push_back(a == b ? p : Vec3((1.0 - t) * p + t * q));
    return it->second;
  }

  void add(const std::vector<int>& polygon) {
    for (std::size_t i = 2; i < polygon.size(); ++i)
      mesh.triangles.push_back({polygon[0], polygon[i - 1], polygon[i]});
  }
};

class MarchingTetrahedra {
 public:
  explicit MarchingTetrahedra(const Shape& shape) : low_(shape.low), cell_(shape.cell) {
    const Vec3 cells = (shape.high - shape.low) / shape.cell;
    for (int i = 0; i < 3; ++i) count_[i] = 2 + static_cast<int>(cells[i]);
    for (int n = 0; n < count_[0] * count_[1] * count_[2]; ++n)
      value_.push_back(shape.surface(point(n)));
  }

  Mesh run() {
    for (int z = 0; z + 1 < count_[2]; ++z)
      for (int y = 0; y + 1 < count_[1]; ++y)
        for (int x = 0; x + 1 < count_[0]; ++x) cube(x + count_[0] * (y + count_[1] * z));
    return cut_.mesh;
  }

 private:
  Vec3 point(int n) const {
    const int row = n / count_[0];
    return low_ + cell_ * Vec3(n % count_[0], row % count_[1], row / count_[1]);
  }

  // The six tetrahedra are the monotone paths from the first corner of the cube to the last.
  void cube(int first) {
    std::array<int, 3> steps{1, count_[0], count_[0] * count_[1]};
    do {
      const int second = first + steps[0], third = second + steps[1];
      tetrahedron({first, second, third, third + steps[2]});
    } while (std::next_permutation(steps.begin(), steps.end()));
  }

  void tetrahedron(const std::array<int, 4>& corners) {
    std::vector<int> in, out, polygon;
    for (int n : corners) (item(value_, n) < 0.0 ? in : out).push_back(n);
    if (in.empty() || out.empty()) return;
    for (int a : in)
      for (int b : out)
        polygon.push_back(cut_.vertex(a, b, point(a), point(b), item(value_, a), item(value_, b)));
    if (polygon.size() == 4) std::swap(polygon[2], polygon[3]);
    const auto corner = [&](std::size_t i) { return item(cut_.mesh.points, polygon[i]); };
    const Vec3 normal = (corner(1) - corner(0)).cross(corner(2) - corner(0));
    if (normal.dot(corner(0) - point(in[0])) < 0.0) std::reverse(polygon.begin(), polygon.end());
    cut_.add(polygon);
  }

  Vec3 low_;
  double cell_;
  int count_[3] = {};
  std::vector<double> value_;
  CutMesh cut_;
};

// The part of a mesh where `cut` is negative.
Mesh clipped(const Mesh& from, const Field& cut) {
  CutMesh out;
  std::vector<double> value;
  for (const Vec3& p : from.points) value.push_back(cut(p));
  for (const Tri& t : from.triangles) {
    std::vector<int> polygon;
    for (std::size_t i = 0; i < 3; ++i) {
      const int a = t[i], b = t[(i + 1) % 3];
      const Vec3 &p = item(from.points, a), &q = item(from.points, b);
      const double f = item(value, a), g = item(value, b);
      if (f < 0.0) polygon.push_back(out.vertex(a, a, p, p, f, f));
      if ((f < 0.0) != (g < 0.0)) polygon.push_back(out.vertex(a, b, p, q, f, g));
    }
    out.add(polygon);
  }
  return out.mesh;
}

// ==== [3] ISOTROPIC REMESHING ==================================================================

// In radians.
double angle_at(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 u = b - a, v = c - a;
  return std::atan2(u.cross(v).norm(), u.dot(v));
}

double least_angle(const Vec3& a, const Vec3& b, const Vec3& c) {
  return (std::min)({angle_at(a, b, c), angle_at(b, c, a), angle_at(c, a, b)});
}

bool has(const Tri& t, int v) { return t[0] == v || t[1] == v || t[2] == v; }

bool follows(const Tri& t, int a, int b) {
  return (t[0] == a && t[1] == b) || (t[1] == a && t[2] == b) || (t[2] == a && t[0] == b);
}

// The corner of t beside a and b.
int third(const Tri& t, int a, int b) { return t[0] + t[1] + t[2] - a - b; }

struct Edge {
  int a, b;
  double length;  // relative to the wanted length
};

class Remesher {
 public:
  Remesher(const Shape& shape, const Mesh& mesh) : shape_(shape), triangles_(mesh.triangles) {
    stars_.resize(mesh.points.size());
    for (int t = 0; t < size_of(triangles_); ++t)
      for (int v : tri(t)) star(v).push_back(t);
    for (const Vec3& p : mesh.points) vertices_.push_back({p, p, 0.0, false, false});
    for (const Edge& e : edges())
      if (triangles_at(e.a, e.b).size() == 1) vertex(e.a).rim = vertex(e.b).rim = true;
    for (Vertex& v : vertices_) place(v, v.at);
  }

  Mesh run() {
    for (int round = 0; round < 14; ++round) {
      split_long_edges();
      collapse_short_edges();
      for (int i = 0; i < 3; ++i) flip_and_smooth();
    }
    const std::vector<int> landmarks = pin_landmarks();
    for (int i = 0; i < 12; ++i) flip_and_smooth();
    return compact(landmarks);
  }

 private:
  struct Vertex {
    Vec3 at, normal;
    double wanted;     // edge length
    bool rim, pinned;  // on the boundary; a landmark
  };

  Vertex& vertex(int v) { return item(vertices_, v); }
  const Vertex& vertex(int v) const { return item(vertices_, v); }
  const Vec3& at(int v) const { return vertex(v).at; }
  Tri& tri(int t) { return item(triangles_, t); }
  const Tri& tri(int t) const { return item(triangles_, t); }
  std::vector<int>& star(int v) { return item(stars_, v); }
  const std::vector<int>& star(int v) const { return item(stars_, v); }

  void place(Vertex& v, const Vec3& near) const {
    v.at = project(shape_, near, v.rim);
    v.normal = gradient(shape_.surface, v.at).normalized();
    v.wanted = shape_.edge_length(v.at);
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
    for (int a = 0; a < size_of(vertices_); ++a)
      for (int b : neighbours(a))
        if (a < b) out.push_back({a, b, relative_length(a, b)});
    std::stable_sort(out.begin(), out.end(),
                     [](const Edge& e, const Edge& f) { return e.length < f.length; });
    return out;
  }

  // Least angle of abc; the more negative, the more it turns away from the surface.
  static double quality(const Vertex& a, const Vertex& b, const Vertex& c) {
    const Vec3 n = (b.at - a.at).cross(c.at - a.at);
    const Vec3 normal = a.normal + b.normal + c.normal;
    const double turn = n.dot(normal) - 0.3 * n.norm() * normal.norm();
    if (turn <= 0.0) return turn / (n.norm() * normal.norm() + 1e-30);
    return least_angle(a.at, b.at, c.at);
  }

  // Least quality in the star of v, without the triangles at `except`, were v like `to`.
  double star_quality(int v, const Vertex& to, int except) const {
    double worst = kPi;
    for (int t : star(v)) {
      if (has(tri(t), except)) continue;
      const auto corner = [&](std::size_t i) -> const Vertex& {
        return tri(t)[i] == v ? to : vertex(tri(t)[i]);
      };
      worst = (std::min)(worst, quality(corner(0), corner(1), corner(2)));
    }
    return worst;
  }

  void detach(int v, int t) { star(v).erase(std::find(star(v).begin(), star(v).end(), t)); }

  void replace(int t, int from, int to) {
    std::replace(tri(t).begin(), tri(t).end(), from, to);
    detach(from, t);
    star(to).push_back(t);
  }

  void split_long_edges() {
    const std::vector<Edge> list = edges();
    for (auto e = list.rbegin(); e != list.rend() && e->length > 4.0 / 3.0; ++e) split(e->a, e->b);
  }

  void split(int a, int b) {
    const std::vector<int> sides = triangles_at(a, b);
    const int m = size_of(vertices_);
    Vertex middle = vertex(a);
    middle.rim = sides.size() == 1;
    place(middle, 0.5 * (at(a) + at(b)));
    vertices_.push_back(middle);
    stars_.emplace_back();
    for (int t : sides) {
      const int fresh = size_of(triangles_);
      triangles_.push_back(Tri(tri(t)));
      for (int v : tri(fresh)) star(v).push_back(fresh);
      replace(t, b, m);
      replace(fresh, a, m);
    }
  }

  void collapse_short_edges() {
    for (const Edge& e : edges()) {
      if (e.length > 4.0 / 5.0) break;
      const bool gone = star(e.a).empty() || star(e.b).empty();
      if (gone || relative_length(e.a, e.b) > 4.0 / 5.0) continue;
      const bool keep_b = vertex(e.b).rim && !vertex(e.a).rim;
      collapse(keep_b ? e.b : e.a, keep_b ? e.a : e.b);
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
    if (vertex(a).rim == vertex(b).rim) place(merged, 0.5 * (at(a) + at(b)));
    if (!may_merge(a, b, merged) || !may_merge(b, a, merged)) return;
    vertex(a) = merged;
    for (int t : sides) {
      for (int v : tri(t)) detach(v, t);
      tri(t) = {-1, -1, -1};
    }
    for (int t : std::vector<int>(star(b))) replace(t, b, a);
  }

  bool may_merge(int v, int with, const Vertex& to) const {
    for (int w : neighbours(v))
      if (w != with && (at(w) - to.at).norm() > 4.0 / 3.0 * to.wanted) return false;
    return star_quality(v, to, with) > 2.0 * kDegree;
  }

  void flip_and_smooth() {
    for (int i = 0; i < 4; ++i)
      for (const Edge& e : edges()) flip_to_delaunay(e.a, e.b);
    for (int v = 0; v < size_of(vertices_); ++v)
      if (!star(v).empty() && !vertex(v).pinned) smooth(v);
  }

  void flip_to_delaunay(int a, int b) {
    const std::vector<int> sides = triangles_at(a, b);
    if (sides.size() != 2) return;
    if (!follows(tri(sides[0]), a, b)) std::swap(a, b);
    // The pair (a, b, c) and (b, a, d) becomes (a, d, c) and (d, b, c).
    const int c = third(tri(sides[0]), a, b), d = third(tri(sides[1]), a, b);
    if (angle_at(at(c), at(a), at(b)) + angle_at(at(d), at(a), at(b)) < kPi + 1e-6) return;
    if (!triangles_at(c, d).empty()) return;
    if (quality(vertex(a), vertex(d), vertex(c)) < 2.0 * kDegree) return;
    if (quality(vertex(d), vertex(b), vertex(c)) < 2.0 * kDegree) return;
    replace(sides[0], b, d);
    replace(sides[1], a, c);
  }

  // Moves v towards the centre of its neighbours, along the surface; a rim vertex along the rim.
  void smooth(int v) {
    Vec3 centre = Vec3::Zero();
    double weight = 0.0;
    for (int w : neighbours(v)) {
      if (vertex(v).rim && triangles_at(v, w).size() != 1) continue;
      centre += at(w) / vertex(w).wanted;
      weight += 1.0 / vertex(w).wanted;
    }
    Vertex moved = vertex(v);
    Vec3 step = 0.6 * (centre / weight - moved.at);
    step -= step.dot(moved.normal) * moved.normal;
    place(moved, moved.at + step);
    const double before = star_quality(v, vertex(v), -1), after = star_quality(v, moved, -1);
    if (after > 25.0 * kDegree || after > before) vertex(v) = moved;
  }

  // The nearest free interior vertex is moved to each landmark, so that pairs correspond.
  std::vector<int> pin_landmarks() {
    std::vector<int> ids;
    for (const Landmark& mark : shape_.landmarks) {
      int best = -1;
      for (int v = 0; v < size_of(vertices_); ++v) {
        if (star(v).empty() || vertex(v).rim || vertex(v).pinned) continue;
        if (best < 0 || (at(v) - mark.at).norm() < (at(best) - mark.at).norm()) best = v;
      }
      place(vertex(best), mark.at);
      vertex(best).pinned = true;
      ids.push_back(best);
    }
    return ids;
  }

  // The mesh without what was collapsed.
  Mesh compact(const std::vector<int>& landmarks) const {
    Mesh mesh;
    std::vector<int> id(vertices_.size(), -1);
    for (int v = 0; v < size_of(vertices_); ++v) {
      if (star(v).empty()) continue;
      item(id, v) = size_of(mesh.points);
      mesh.points.push_back(at(v));
    }
    for (const Tri& t : triangles_)
      if (t[0] >= 0) mesh.triangles.push_back({item(id, t[0]), item(id, t[1]), item(id, t[2])});
    for (int v : landmarks) mesh.landmarks.push_back(item(id, v));
    return mesh;
  }

  const Shape& shape_;
  std::vector<Vertex> vertices_;
  std::vector<Tri> triangles_;
  std::vector<std::vector<int>> stars_;
};

// ==== [4] STARFISH =============================================================================

constexpr int kArms = 5;
constexpr int kArmBeads = 16;
constexpr double kArmLength = 0.93;
constexpr double kDiscRadius = 0.36;  // arms rise only beyond it, so that neighbours agree
constexpr double kFlatness = 0.75;    // height of a cross-section over half its width

struct ArmPose {
  double yaw = 0;   // turn of the tip in the plane, degrees
  double wave = 0;  // S-shaped part of the turn, degrees
  double lift = 0;  // of the tip
};

using StarfishPose = std::array<ArmPose, kArms>;

Vec3 arm_direction(int arm, double turn) {
  const double angle = kPi / 2.0 + 2.0 * kPi * arm / kArms + turn;
  return Vec3(std::cos(angle), std::sin(angle), 0);
}

std::vector<Bead> arm_beads(int arm, const ArmPose& pose) {
  std::vector<Bead> beads;
  Vec3 at = Vec3::Zero();
  for (int i = 0; i < kArmBeads; ++i) {
    const double u = static_cast<double>(i) / (kArmBeads - 1);
    beads.push_back({at, 0.215 - 0.148 * std::pow(u, 0.85)});
    const double turn = pose.yaw * u * u + pose.wave * u * std::sin(2.0 * kPi * u);
    at += kArmLength / (kArmBeads - 1) * arm_direction(arm, kDegree * turn);
  }
  return beads;
}

// Raised arms are sheared upwards.
double starfish_lift(const StarfishPose& pose, const Vec3& p) {
  double z = 0.0;
  for (int arm = 0; arm < kArms; ++arm) {
    const double t = (p.dot(arm_direction(arm, 0)) - kDiscRadius) / (kArmLength - kDiscRadius);
    if (t > 0.0) z += item(pose, arm).lift * t * t;
  }
  return z;
}

Shape starfish(const StarfishPose& pose, double length) {
  std::vector<std::vector<Bead>> arms;
  for (int arm = 0; arm < kArms; ++arm) arms.push_back(arm_beads(arm, item(pose, arm)));
  Shape shape;
  shape.surface = [arms, pose](const Vec3& p) {
    const Vec3 flat(p.x(), p.y(), (p.z() - starfish_lift(pose, p)) / kFlatness);
    double d = 1e9;
    for (const auto& arm : arms) d = smooth_min(d, string_of_beads(flat, arm, 0.02), 0.18);
    return d;
  };
  shape.cut = [pose](const Vec3& p) { return starfish_lift(pose, p) - p.z(); };
  std::vector<Vec3> tips;
  add_landmark(shape, "centre", Vec3(0, 0, 0.2));
  for (int arm = 0; arm < kArms; ++arm) {
    const Bead &before = item(arms, arm)[kArmBeads - 2], &tip = item(arms, arm)[kArmBeads - 1];
    const Vec3 lift(0, 0, starfish_lift(pose, tip.at));
    tips.push_back(tip.at + lift);
    const Vec3 up_and_ahead = (tip.at - before.at).normalized() + Vec3::UnitZ();
    add_landmark(shape, "tip of arm " + std::to_string(arm + 1),
                 tip.at + lift + 0.7 * tip.radius * up_and_ahead);
  }
  shape.edge_length = [tips, length](const Vec3& p) { return finer_near(tips, p, length); };
  shape.cell = 0.62 * length;
  shape.low = Vec3(-1.1031, -1.1017, -0.2013);
  shape.high = Vec3(1.1, 1.1, 0.8);
  return shape;
}

Shape resting_starfish() { return starfish({}, 0.0445); }

Shape walking_starfish() {
  return starfish({{{-75, 10, 0.1}, {70, -20, 0.25}, {-25, 40}, {85, 5, 0.05}, {-60, -25, 0.3}}},
                  0.0425);
}

// ==== [5] HAND =================================================================================

// A right hand, fingers up (+y), palm towards the viewer (+z), thumb on the +x side.
struct FingerPose {
  Vec3 straight;               // direction when stretched
  Vec3 toward;                 // direction it curls to
  std::array<double, 3> flex;  // at the knuckle and the two joints, degrees
};

using HandPose = std::array<FingerPose, 5>;

struct Finger {
  std::string name;
  Vec3 base;                    // knuckle
  std::array<double, 3> bones;  // lengths
  std::array<double, 4> radii;  // at the knuckle, the two joints and the tip
  FingerPose pose;
};

std::vector<Finger> hand_fingers(const HandPose& p) {
  return {{"index", {0.285, 0.97, 0}, {0.43, 0.26, 0.17}, {0.108, 0.098, 0.089, 0.075}, p[0]},
          {"middle", {0.095, 1.01, 0}, {0.48, 0.30, 0.18}, {0.110, 0.100, 0.091, 0.077}, p[1]},
          {"ring", {-0.095, 0.97, 0}, {0.44, 0.28, 0.18}, {0.106, 0.095, 0.086, 0.073}, p[2]},
          {"little", {-0.275, 0.87, 0}, {0.35, 0.20, 0.15}, {0.095, 0.083, 0.075, 0.064}, p[3]},
          {"thumb", {0.19, 0.20, 0.04}, {0.40, 0.30, 0.19}, {0.150, 0.120, 0.108, 0.082}, p[4]}};
}

std::vector<Bead> finger_beads(const Finger& f) {
  const Vec3 ahead = f.pose.straight.normalized();
  const Vec3 toward = (f.pose.toward - f.pose.toward.dot(ahead) * ahead).normalized();
  std::vector<Bead> beads{{f.base, f.radii[0]}};
  double angle = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    angle += f.pose.flex[i] * kDegree;
    const Vec3 bone = f.bones[i] * (std::cos(angle) * ahead + std::sin(angle) * toward);
    beads.push_back({beads.back().at + bone, f.radii[i + 1]});
  }
  return beads;
}

double palm(const Vec3& p, const std::vector<Finger>& fingers) {
  double d = 1e9;
  for (int i = 0; i < 4; ++i) {
    const Bead root{Vec3(0.13 - 0.085 * i, 0.06, -0.01), 0.125};
    d = smooth_min(d, capsule(p, root, {item(fingers, i).base, 0.105}), 0.10);
  }
  d = smooth_min(d, ellipsoid(p, Vec3(-0.21, 0.38, 0.05), Vec3(0.15, 0.34, 0.13)), 0.12);
  for (double side : {-0.085, 0.085}) {
    const Bead low{Vec3(side, -0.6, -0.02), 0.165}, high{Vec3(0.95 * side, 0.05, -0.01), 0.130};
    d = smooth_min(d, capsule(p, low, high), 0.12);
  }
  return d;
}

double hand_surface(const Vec3& p, const std::vector<Finger>& fingers) {
  double d = palm(p, fingers);
  for (const Finger& f : fingers) {
    const bool thumb = f.name == "thumb";
    d = smooth_min(d, string_of_beads(p, finger_beads(f), thumb ? 0.06 : 0.03), thumb ? 0.2 : 0.12);
  }
  const double hollow = ellipsoid(p, Vec3(0.0, 0.62, 0.27), Vec3(0.17, 0.30, 0.17));
  return -smooth_min(-d, hollow, 0.12);
}

Shape hand(const HandPose& pose, double length) {
  const std::vector<Finger> fingers = hand_fingers(pose);
  Shape shape;
  shape.surface = [fingers](const Vec3& p) { return hand_surface(p, fingers); };
  shape.cut = [](const Vec3& p) { return -0.20 - p.y(); };
  std::vector<Vec3> fine{Vec3(0.21, 1.18, 0), Vec3(-0.01, 1.19, 0), Vec3(-0.23, 1.07, 0)};  // webs
  for (const Finger& f : fingers) {
    const std::vector<Bead> beads = finger_beads(f);
    fine.push_back(beads[3].at);
    const Vec3 along = (beads[3].at - beads[2].at).normalized();
    add_landmark(shape, f.name + " tip", beads[3].at + beads[3].radius * along);
  }
  add_landmark(shape, "wrist, palm side", Vec3(0, -0.08, 0.15));
  add_landmark(shape, "wrist, back side", Vec3(0, -0.08, -0.15));
  shape.edge_length = [fine, length](const Vec3& p) { return finer_near(fine, p, length); };
  shape.cell = 0.47 * length;
  shape.low = Vec3(-0.9013, -0.2817, -0.4019);
  shape.high = Vec3(1.1, 2.15, 0.95);
  return shape;
}

Shape flat_hand() {
  return hand({{{Vec3(0.27, 1, 0), Vec3::UnitZ(), {4, 4, 3}},
                {Vec3(0.05, 1, 0), Vec3::UnitZ(), {3, 5, 3}},
                {Vec3(-0.16, 1, 0), Vec3::UnitZ(), {4, 6, 4}},
                {Vec3(-0.44, 1, 0), Vec3::UnitZ(), {5, 7, 5}},
                {Vec3(0.74, 0.66, 0.16), Vec3(-0.3, 0.8, 0.3), {0, 14, 10}}}},
              0.0615);
}

// Index and middle finger stretched, the others bent over the palm.
Shape victory_hand() {
  return hand({{{Vec3(0.30, 1, 0), Vec3::UnitZ(), {-4, 6, 4}},
                {Vec3(-0.09, 1, 0), Vec3::UnitZ(), {0, 8, 5}},
                {Vec3(-0.11, 1, 0), Vec3::UnitZ(), {62, 58, 30}},
                {Vec3(-0.40, 1, 0), Vec3::UnitZ(), {54, 52, 28}},
                {Vec3(0.44, 0.66, 0.55), Vec3(-0.8, 0.3, 0.1), {0, 28, 24}}}},
              0.0600);
}

// ==== [6] FACE =================================================================================

// The front of a head, x to the viewer's right, y up, z towards the viewer: two ellipsoids raised
// along z by a sum of bumps and grooves, one per feature.
struct Face {
  double width, jaw_width, chin_y;
  double eye_x, eye_half_width, eye_half_height;
  double brow_y, brow_arch;
  double nose_y, nose_depth, nose_half_width;
  double mouth_y, mouth_half_width, smile, lip;
  double cheek;
};

constexpr double kEyeY = 0.19;

double bell(double x, double y = 0.0) { return std::exp(-x * x - y * y); }

// About 1 for |t| < 1 and about 0 beyond.
double window(double t) { return std::exp(-t * t * t * t); }

// Eye on the side where x, measured away from the nose, is positive.
double eye_relief(const Face& f, double x, double y) {
  const double u = (x - f.eye_x) / f.eye_half_width;
  const double v = y - kEyeY - 0.02 * u;
  const double arch = f.eye_half_height * (1.0 - u * u);
  const double inside = smooth_min(arch - v, v + 0.75 * arch, 0.02);
  double z = -0.085 * bell(u / 1.5, (v - 0.02) / 0.12);
  z -= 0.030 * bell((u + 1.15) / 0.6, (v - 0.02) / 0.08);
  z += 0.075 * bell(u / 1.05, v / 0.095);
  z -= 0.024 * smooth_step(inside / 0.036 + 0.5);
  z += 0.016 * bell((v - arch - 0.012) / 0.028) * window(0.95 * u);
  z -= 0.022 * bell((v - arch - 0.066) / 0.030) * window(u);
  return z + 0.008 * bell(u / 0.42, v / 0.06);
}

double brow_relief(const Face& f, double x, double y) {
  const double u = (x - f.eye_x) / (f.eye_half_width + 0.07);
  const double line = f.brow_y + f.brow_arch * (1.0 - u * u) - 0.02 * u;
  return 0.050 * bell((y - line) / 0.055) * window(u);
}

double cheek_relief(const Face& f, double x, double y) {
  double z = f.cheek * bell((x - 0.52 * f.width) / 0.18, (y + 0.06) / 0.16);
  z -= 0.030 * bell((x - 0.52 * f.width) / 0.16, (y + 0.42) / 0.20);
  // The fold from the nose to the mouth corner deepens as one smiles.
  const double t = (f.nose_y - y) / (f.nose_y - f.mouth_y);
  const double fold = f.nose_half_width + 0.055 + (f.mouth_half_width - 0.08) * 0.55 * t;
  return z - (0.006 + 0.16 * f.smile) * bell((x - fold) / 0.06) * bell((t - 0.45) / 0.6);
}

double nose_relief(const Face& f, double x, double y) {
  const double root = kEyeY + 0.12;
  const double t = (root - y) / (root - f.nose_y);  // 0 at the root, 1 at the tip
  const double under = smooth_step((y - f.nose_y + 0.125) / 0.13);
  const double height = f.nose_depth * smooth_step(1.00 * t + 0.06) * under;
  double z = 0.85 * height * bell(x / (0.078 + 0.018 * smooth_step(1.4 * t - 0.4)));
  z += 0.20 * f.nose_depth * bell(x / 0.085, (y - f.nose_y + 0.01) / 0.075);
  const double wing = (std::abs(x) - f.nose_half_width) / 0.050;
  return z + 0.42 * f.nose_depth * bell(wing, (y - f.nose_y + 0.035) / 0.058);
}

double mouth_relief(const Face& f, double x, double y) {
  const double u = x / f.mouth_half_width;
  const double v = y - f.mouth_y - f.smile * u * u;
  const double full = (std::max)(1.0 - u * u, 0.0);
  const double lips = smooth_step((1.15 - std::abs(u)) / 0.40);
  double z = 0.055 * bell(x / 0.27, (y - f.mouth_y) / 0.20);
  z += 0.058 * lips * bell((v - 0.9 * f.lip * full) / (0.85 * f.lip));
  z += 0.066 * lips * bell((v + 1.0 * f.lip * full) / (0.95 * f.lip));
  z -= 0.030 * bell(v / 0.032) * window(u);
  z -= 0.014 * bell((std::abs(u) - 1.05) / 0.16, v / 0.05);
  return z - 0.032 * bell(x / 0.17, (v + 2.9 * f.lip) / 0.065);
}

double face_surface(const Face& f, const Vec3& p) {
  const double x = p.x(), y = p.y();
  double z = nose_relief(f, x, y) + mouth_relief(f, x, y);
  for (double side : {-x, x})
    z += eye_relief(f, side, y) + brow_relief(f, side, y) + cheek_relief(f, side, y);
  z += 0.085 * bell(x / 0.17, (y - f.chin_y - 0.16) / 0.12);
  z -= 0.030 * bell((std::abs(x) - 0.60) / 0.14, (y - 0.36) / 0.20);
  const Vec3 q = p - Vec3(0, 0, z);
  const double skull = ellipsoid(q, Vec3(0, 0.28, -0.12), Vec3(f.width, 0.80, 0.76));
  const Vec3 jaw_radii(f.jaw_width, -0.34 - f.chin_y, 0.70);
  const double jaw = ellipsoid(q, Vec3(0, -0.34, -0.10), jaw_radii);
  return smooth_min(skull, jaw, 0.40);
}

// A place of the face by its frontal coordinates.
void add_face_landmark(Shape& shape, const std::string& name, double x, double y) {
  double inside = 0.0, outside = 1.5;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (inside + outside);
    (shape.surface(Vec3(x, y, middle)) > 0.0 ? outside : inside) = middle;
  }
  add_landmark(shape, name, Vec3(x, y, inside));
}

// Finer edges where the eyes, nose and mouth are.
double face_edge_length(const Face& f, const Vec3& p) {
  const double eyes = std::hypot((std::abs(p.x()) - f.eye_x) / 0.20, (p.y() - kEyeY - 0.05) / 0.16);
  const double nose = std::hypot(p.x() / 0.15, (p.y() - f.nose_y - 0.08) / 0.22);
  const double mouth =
      std::hypot(p.x() / (f.mouth_half_width + 0.05), (p.y() - f.mouth_y - 0.4 * f.smile) / 0.13);
  const double near = (std::min)({eyes, nose, mouth});
  return 0.0275 + 0.0625 * smooth_step((near - 0.85) / 1.8);
}

Shape face(const Face& f, double scale) {
  Shape shape;
  shape.surface = [f](const Vec3& p) { return face_surface(f, p); };
  shape.cut = [](const Vec3& p) { return 0.08 - p.z() - 0.10 * p.y(); };
  shape.edge_length = [f, scale](const Vec3& p) { return scale * face_edge_length(f, p); };
  shape.cell = 0.026 * scale;
  shape.low = Vec3(-1.0013, -1.1017, -0.2019);
  shape.high = Vec3(1.0, 1.2, 1.1);
  add_face_landmark(shape, "nose tip", 0, f.nose_y);
  add_face_landmark(shape, "chin", 0, f.chin_y + 0.14);
  for (double s : {-1.0, 1.0}) {
    const std::string side = s < 0 ? "right " : "left ";
    const double inner = f.eye_x - f.eye_half_width, outer = f.eye_x + f.eye_half_width;
    add_face_landmark(shape, side + "inner eye corner", s * inner, kEyeY - 0.02);
    add_face_landmark(shape, side + "outer eye corner", s * outer, kEyeY + 0.02);
    add_face_landmark(shape, side + "brow", s * f.eye_x, f.brow_y + f.brow_arch);
    add_face_landmark(shape, side + "mouth corner", s * f.mouth_half_width, f.mouth_y + f.smile);
  }
  return shape;
}

Shape calm_face() {
  Face f{};
  f.width = 0.74, f.jaw_width = 0.58, f.chin_y = -0.88;
  f.eye_x = 0.285, f.eye_half_width = 0.150, f.eye_half_height = 0.066;
  f.brow_y = 0.345, f.brow_arch = 0.030;
  f.nose_y = -0.15, f.nose_depth = 0.22, f.nose_half_width = 0.095;
  f.mouth_y = -0.45, f.mouth_half_width = 0.240, f.smile = 0.010, f.lip = 0.046, f.cheek = 0.045;
  return face(f, 1.0);
}

Shape smiling_face() {
  Face f{};
  f.width = 0.83, f.jaw_width = 0.68, f.chin_y = -0.87;
  f.eye_x = 0.310, f.eye_half_width = 0.155, f.eye_half_height = 0.058;
  f.brow_y = 0.380, f.brow_arch = 0.060;
  f.nose_y = -0.19, f.nose_depth = 0.26, f.nose_half_width = 0.120;
  f.mouth_y = -0.52, f.mouth_half_width = 0.310, f.smile = 0.100, f.lip = 0.046, f.cheek = 0.080;
  return face(f, 1.05);
}

// ==== [7] FILES ================================================================================

Mesh build(const Shape& shape, const std::string& name) {
  const Mesh grid = MarchingTetrahedra(shape).run();
  const Mesh mesh = Remesher(shape, clipped(grid, shape.cut)).run();
  double least = kPi;
  for (const Tri& t : mesh.triangles) {
    const auto p = [&](std::size_t i) -> const Vec3& { return item(mesh.points, t[i]); };
    least = (std::min)(least, least_angle(p(0), p(1), p(2)));
  }
  std::printf("%-11s %5d vertices  %5d triangles  least angle %4.1f\n", name.c_str(),
              size_of(mesh.points), size_of(mesh.triangles), least / kDegree);
  return mesh;
}

bool write_obj(const Mesh& mesh, const std::string& path) {
  std::ofstream file(path, std::ios::binary);
  for (const Vec3& p : mesh.points) file << "v " << p.x() << ' ' << p.y() << ' ' << p.z() << '\n';
  for (const Tri& t : mesh.triangles)
    file << "f " << t[0] + 1 << ' ' << t[1] + 1 << ' ' << t[2] + 1 << '\n';
  return file.flush().good();
}

bool write_landmarks(const Mesh& a, const Mesh& b, const std::vector<Landmark>& marks,
                     const std::string& path) {
  std::ofstream file(path, std::ios::binary);
  file << "# vertex of A.obj, vertex of B.obj, counted from 0\n";
  for (std::size_t i = 0; i < marks.size(); ++i)
    file << "# " << marks[i].name << '\n' << a.landmarks[i] << ' ' << b.landmarks[i] << '\n';
  return file.flush().good();
}

bool write_pair(const std::string& out, const std::string& name, const Shape& first,
                const Shape& second) {
  const Mesh a = build(first, name + " A"), b = build(second, name + " B");
  const std::string folder = out + "/" + name;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  return write_obj(a, folder + "/A.obj") && write_obj(b, folder + "/B.obj") &&
         write_landmarks(a, b, first.landmarks, folder + "/landmarks.txt");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s OUTDIR\n", argv[0]);
    return 2;
  }
  const std::string out = argv[1];
  const bool ok = write_pair(out, "starfish", resting_starfish(), walking_starfish()) &&
                  write_pair(out, "hand", flat_hand(), victory_hand()) &&
                  write_pair(out, "face", calm_face(), smiling_face());
  if (!ok) std::fprintf(stderr, "cannot write to %s\n", argv[1]);
  return ok ? 0 : 1;
}

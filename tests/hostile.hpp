// Surfaces at the edge of what a mesh can be, from seeds, and what must hold of every map of them.

#ifndef ISM_TESTS_HOSTILE_HPP
#define ISM_TESTS_HOSTILE_HPP

#include "ism.hpp"
#include "sanitized.hpp"
#include "shapes.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <initializer_list>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace hostile {

using Eigen::Vector2d;
using Eigen::Vector3d;
using ism::Points2;
using ism::Problem;
using ism::Side;
using ism::TriangleMesh;
using shapes::Disk;
using shapes::Rng;

using Edge = std::array<int, 2>;

inline int n_vertices(const TriangleMesh& m) { return static_cast<int>(m.vertices.rows()); }
inline int n_triangles(const TriangleMesh& m) { return static_cast<int>(m.triangles.rows()); }

// ---- changes of meshes ----

inline int add_vertex(TriangleMesh& m, const Vector3d& p) {
  m.vertices.conservativeResize(m.vertices.rows() + 1, Eigen::NoChange);
  m.vertices.bottomRows(1) = p.transpose();
  return n_vertices(m) - 1;
}

inline int add_triangle(TriangleMesh& m, int u, int v, int w) {
  m.triangles.conservativeResize(m.triangles.rows() + 1, Eigen::NoChange);
  m.triangles.bottomRows(1) << u, v, w;
  return n_triangles(m) - 1;
}

inline void turn(TriangleMesh& m, int f) { std::swap(m.triangles(f, 1), m.triangles(f, 2)); }

inline double log_uniform(Rng& rng, double lo, double hi) {
  return std::pow(10.0, rng.uniform(lo, hi));
}

/// Moves every vertex by at most `amount` along each axis.
inline void shake(TriangleMesh& m, double amount, Rng& rng) {
  for (int v = 0; v < n_vertices(m); ++v)
    for (int c = 0; c < 3; ++c) m.vertices(v, c) += rng.uniform(-amount, amount);
}

/// The same surface with another one beside it.
inline TriangleMesh beside(const TriangleMesh& a, const TriangleMesh& b) {
  TriangleMesh both;
  both.vertices.resize(a.vertices.rows() + b.vertices.rows(), 3);
  both.vertices << a.vertices, b.vertices;
  both.triangles.resize(a.triangles.rows() + b.triangles.rows(), 3);
  both.triangles << a.triangles, (b.triangles.array() + n_vertices(a)).matrix();
  return both;
}

/// Every triangle with vertices of its own.
inline TriangleMesh soup(const TriangleMesh& mesh) {
  TriangleMesh result;
  result.vertices.resize(mesh.triangles.size(), 3);
  result.triangles.resize(mesh.triangles.rows(), 3);
  for (int i = 0; i < mesh.triangles.size(); ++i) {
    result.vertices.row(i) = mesh.vertices.row(mesh.triangles.data()[i]);
    result.triangles.data()[i] = i;
  }
  return result;
}

/// Vertices and triangles in another order, triangles from another corner on.
inline TriangleMesh shuffled(const TriangleMesh& mesh, Rng& rng) {
  const auto permutation = [&](int n) {
    std::vector<int> order(static_cast<std::size_t>(n));
    for (int i = 0; i < n; ++i) order[static_cast<std::size_t>(i)] = i;
    for (int i = n - 1; i > 0; --i)
      std::swap(order[static_cast<std::size_t>(i)],
                order[static_cast<std::size_t>(rng.below(i + 1))]);
    return order;
  };
  const std::vector<int> vertex = permutation(n_vertices(mesh));
  const std::vector<int> face = permutation(n_triangles(mesh));
  TriangleMesh result = mesh;
  for (int v = 0; v < n_vertices(mesh); ++v)
    result.vertices.row(vertex[static_cast<std::size_t>(v)]) = mesh.vertices.row(v);
  for (int f = 0; f < n_triangles(mesh); ++f) {
    const int first = rng.below(3);
    for (int k = 0; k < 3; ++k)
      result.triangles(face[static_cast<std::size_t>(f)], k) =
          vertex[static_cast<std::size_t>(mesh.triangles(f, (first + k) % 3))];
  }
  return result;
}

/// New vertices in some triangles, so close to an edge or to a corner that slivers come about.
inline void split_thinly(TriangleMesh& m, Rng& rng, int times) {
  const int n = n_triangles(m);
  std::set<int> split;
  for (int i = 0; i < times; ++i) {
    const int f = rng.below(n), first = rng.below(3);
    if (!split.insert(f).second) continue;
    const double e = log_uniform(rng, -8, -1), other = rng.below(2) ? e : 0.4;
    const int u = m.triangles(f, first), v = m.triangles(f, (first + 1) % 3);
    const int w = m.triangles(f, (first + 2) % 3);
    const int x = add_vertex(
        m, (1 - e - other) * m.vertices.row(u) + other * m.vertices.row(v) + e * m.vertices.row(w));
    m.triangles.row(f) << u, v, x;
    add_triangle(m, v, w, x);
    add_triangle(m, w, u, x);
  }
}

// ---- surfaces with a boundary ----

inline TriangleMesh with_height(Disk disk, Rng& rng) {
  if (rng.below(2)) shapes::bend(disk, rng.uniform(0, 1));
  return disk.mesh;
}

inline TriangleMesh random_disk(Rng& rng) {
  const int nx = rng.between(1, 6), ny = rng.between(2, 6);
  return with_height(shapes::random_disk(nx, ny, rng), rng);
}

inline TriangleMesh one_triangle(Rng& rng) {
  return shapes::triangle(rng.point(1), rng.point(1) + Vector2d(3, 0), rng.point(1) * 3).mesh;
}

inline TriangleMesh two_triangles(Rng& rng) {
  TriangleMesh mesh = shapes::strip(1).mesh;
  shake(mesh, 0.3, rng);
  return mesh;
}

inline TriangleMesh strip(Rng& rng) { return with_height(shapes::strip(rng.between(2, 90)), rng); }

inline TriangleMesh fan(Rng& rng) { return with_height(shapes::fan(rng.between(3, 60)), rng); }

inline TriangleMesh large_fan(Rng& rng) { return shapes::fan(rng.between(300, 1000)).mesh; }

/// A fan around a vertex of the boundary: no vertex is inside.
inline TriangleMesh half_fan(Rng& rng) {
  shapes::DiskBuilder builder;
  const int n = rng.between(2, 80);
  const double angle = rng.uniform(0.1, 6.2);
  builder.vertex(0, 0);
  for (int i = 0; i <= n; ++i) builder.vertex(std::cos(angle * i / n), std::sin(angle * i / n));
  for (int i = 0; i < n; ++i) builder.triangle(0, i + 1, i + 2);
  return builder.build().mesh;
}

/// Triangles glued to free edges one by one, each with an own vertex somewhere in space.
inline TriangleMesh tree_of_triangles(Rng& rng) {
  TriangleMesh m = shapes::single_triangle().mesh;
  std::vector<std::array<int, 2>> free = {{{0, 1}}, {{1, 2}}, {{2, 0}}};
  for (int i = rng.between(5, 80); i > 0; --i) {
    std::array<int, 2>& e =
        free[static_cast<std::size_t>(rng.below(static_cast<int>(free.size())))];
    const Vector3d middle = 0.5 * (m.vertices.row(e[0]) + m.vertices.row(e[1]));
    const double size = (m.vertices.row(e[0]) - m.vertices.row(e[1])).norm();
    const Vector3d away(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
    const int v = add_vertex(m, middle + size * away), u = e[0], w = e[1];
    add_triangle(m, w, u, v);
    e = {u, v};
    free.push_back({v, w});
  }
  return m;
}

inline TriangleMesh comb(Rng& rng) {
  return with_height(shapes::comb(rng.between(2, 6), rng.between(1, 8)), rng);
}

inline TriangleMesh limbs(Rng& rng) {
  return with_height(shapes::limbs(rng.between(3, 6), rng.between(2, 14), log_uniform(rng, -4, -1)),
                     rng);
}

/// A ribbon that winds around itself in the plane.
inline TriangleMesh spiral(Rng& rng) {
  const int n = rng.between(10, 90);
  TriangleMesh m = shapes::strip(n).mesh;
  const double turns = rng.uniform(1, 6), width = rng.uniform(0.01, 0.9);
  for (int v = 0; v < n_vertices(m); ++v) {
    const double t = turns * m.vertices(v, 0) / n, phi = 2 * shapes::kPi * t;
    const double r = 1 + t + width * (1 - m.vertices(v, 1));
    m.vertices.row(v) << r * std::cos(phi), r * std::sin(phi), 0;
  }
  return m;
}

inline TriangleMesh cap(Rng& rng) {
  return shapes::spherical_cap(rng.between(1, 5), rng.between(3, 16), rng.uniform(0.3, 3.1)).mesh;
}

/// A grid of which one direction is as short as angles of 1e-6 degrees make it.
inline TriangleMesh needles(Rng& rng) {
  TriangleMesh m = shapes::grid(rng.between(1, 9), rng.between(1, 9)).mesh;
  m.vertices.col(1) *= log_uniform(rng, -7.7, -1);
  return m;
}

/// Triangles around a point, some with tiny angles there.
inline TriangleMesh thin_fan(Rng& rng) {
  shapes::DiskBuilder builder;
  builder.vertex(0, 0);
  int n = 0;
  for (double phi = 0; phi < 6.2 && n < 60; ++n) {
    builder.vertex(std::cos(phi), std::sin(phi));
    phi += rng.below(2) ? log_uniform(rng, -7.7, -1) : 0.5;
  }
  for (int i = 0; i < n; ++i) builder.triangle(0, 1 + i, 1 + (i + 1) % n);
  return builder.build().mesh;
}

/// Rings that become smaller and smaller.
inline TriangleMesh graded(Rng& rng) {
  const int rings = rng.between(2, 9), sectors = rng.between(3, 7);
  TriangleMesh m = shapes::spherical_cap(rings, sectors, 1).mesh;
  const double ratio = rng.uniform(0.05, 0.7);
  for (int v = 1; v < n_vertices(m); ++v) {
    const int ring = 1 + (v - 1) / sectors;
    m.vertices.row(v) *= std::pow(ratio, rings - ring) / m.vertices.row(v).norm();
  }
  m.vertices.row(0).setZero();
  m.vertices.col(2).setZero();
  return m;
}

inline TriangleMesh spikes(Rng& rng) {
  TriangleMesh m = shapes::fan(2 * rng.between(3, 40)).mesh;
  const double inner = log_uniform(rng, -4, 0);
  for (int v = 2; v < n_vertices(m); v += 2) m.vertices.row(v) *= inner;
  return m;
}

/// A grid folded until many squares lie on each other.
inline TriangleMesh folded(Rng& rng) {
  TriangleMesh m = shapes::grid(rng.between(3, 9), rng.between(3, 9)).mesh;
  for (int v = 0; v < n_vertices(m); ++v)
    for (int c = 0; c < 2; ++c) m.vertices(v, c) = std::fmod(m.vertices(v, c), 2);
  return m;
}

/// Vertices anywhere in space.
inline TriangleMesh crumpled(Rng& rng) {
  TriangleMesh m = shapes::grid(rng.between(2, 9), rng.between(2, 9)).mesh;
  m.vertices.setZero();
  shake(m, 1, rng);
  return m;
}

inline TriangleMesh with_slivers(Rng& rng) {
  TriangleMesh m = shapes::grid(rng.between(2, 6), rng.between(2, 6)).mesh;
  split_thinly(m, rng, rng.between(1, 20));
  return m;
}

inline TriangleMesh with_openings(Rng& rng) {
  const int n = rng.between(3, 8);
  return rng.below(3) ? with_height(shapes::with_openings(n, rng.between(3, 8), rng), rng)
                      : shapes::frame(n, 1).mesh;
}

// ---- closed surfaces ----

inline TriangleMesh tetrahedron(Rng& rng) {
  TriangleMesh m = shapes::tetrahedron();
  shake(m, 0.1, rng);
  return m;
}

inline TriangleMesh sphere(Rng& rng) { return shapes::sphere(rng.below(2)); }

inline TriangleMesh blob(Rng& rng) {
  return shapes::blob(rng.between(1, 2), rng.uniform(0, 0.9), rng.next());
}

inline TriangleMesh crumpled_sphere(Rng& rng) {
  TriangleMesh m = shapes::sphere(rng.between(0, 2));
  shake(m, rng.uniform(), rng);
  return m;
}

/// Two pyramids on one polygon, of any height, also none: flat, with front and back.
inline TriangleMesh double_pyramid(Rng& rng, int n) {
  TriangleMesh m = shapes::fan(n).mesh;
  const double height = rng.below(2) ? 0 : log_uniform(rng, -6, 1);
  const int below = add_vertex(m, Vector3d(0, 0, -height));
  m.vertices(0, 2) = height;
  for (int i = 0; i < n; ++i) add_triangle(m, below, 1 + (i + 1) % n, 1 + i);
  return m;
}
inline TriangleMesh small_double_pyramid(Rng& rng) {
  return double_pyramid(rng, rng.between(3, 30));
}
inline TriangleMesh large_double_pyramid(Rng& rng) {
  return double_pyramid(rng, rng.between(300, 500));
}

/// A flat disk and its other side, sewn along the boundary; vertices inside are there twice.
inline TriangleMesh doubled_disk(Rng& rng) {
  const int rings = rng.between(1, 4), sectors = rng.between(3, 9);
  TriangleMesh m = shapes::spherical_cap(rings, sectors, 1).mesh;
  m.vertices.col(2).setZero();
  const ism::Triangles F = m.triangles;
  const int inside = 1 + (rings - 1) * sectors, n = n_vertices(m);
  for (int v = 0; v < inside; ++v) add_vertex(m, m.vertices.row(v));
  const auto back = [&](int v) { return v < inside ? n + v : v; };
  for (int f = 0; f < F.rows(); ++f) add_triangle(m, back(F(f, 0)), back(F(f, 2)), back(F(f, 1)));
  return m;
}

// ---- all of them ----

struct Shape {
  const char* name = "";
  TriangleMesh (*make)(Rng&) = nullptr;
  bool is_closed = false;
  bool has_openings = false;
  bool is_large = false;
};

inline const std::vector<Shape>& all_shapes() {
  static const std::vector<Shape> all = {
      {"disk", random_disk},
      {"triangle", one_triangle},
      {"two triangles", two_triangles},
      {"strip", strip},
      {"fan", fan},
      {"large fan", large_fan, false, false, true},
      {"half fan", half_fan},
      {"tree", tree_of_triangles},
      {"comb", comb},
      {"limbs", limbs},
      {"spiral", spiral},
      {"cap", cap},
      {"needles", needles},
      {"thin fan", thin_fan},
      {"graded", graded},
      {"spikes", spikes},
      {"folded", folded},
      {"crumpled", crumpled},
      {"slivers", with_slivers},
      {"openings", with_openings, false, true},
      {"tetrahedron", tetrahedron, true},
      {"sphere", sphere, true},
      {"blob", blob, true},
      {"crumpled sphere", crumpled_sphere, true},
      {"double pyramid", small_double_pyramid, true},
      {"large double pyramid", large_double_pyramid, true, false, true},
      {"doubled disk", doubled_disk, true}};
  return all;
}

/// A surface, and what was done to it.
struct Surface {
  std::string name;
  TriangleMesh mesh;
  Shape shape = {};
};

/// Its place in space: unit, stretch and rotation; far from the origin, where numbers have few
/// digits left, if that leaves a valid mesh.
inline void place(Surface& s, Rng& rng) {
  TriangleMesh placed = s.mesh;
  std::string name = s.name;
  if (rng.below(3) == 0) {
    for (int c = 0; c < 3; ++c) placed.vertices.col(c) *= log_uniform(rng, -2, 2);
    name += ", stretched";
  }
  if (rng.below(3) == 0) {
    const Vector3d axis = Vector3d(rng.uniform(-1, 1), rng.uniform(-1, 1), 0.3).normalized();
    const Eigen::Matrix3d R = Eigen::AngleAxisd(rng.uniform(0, 6), axis).matrix();
    placed.vertices = (placed.vertices * R.transpose()).eval();
    name += ", turned";
  }
  if (rng.below(5) == 0) {
    placed.vertices.array() += rng.below(2) ? 1e8 : 1e4;
    name += ", far away";
  }
  if (rng.below(3) == 0) {
    placed.vertices *= log_uniform(rng, -12, 12);
    name += ", scaled";
  }
  if (ism::validate(placed).empty()) s = {name, placed, s.shape};
}

/// Are all vertices in different places? What is not cannot be welded again.
inline bool is_weldable(const TriangleMesh& m) {
  std::set<std::array<double, 3>> places;
  for (int v = 0; v < n_vertices(m); ++v)
    places.insert({m.vertices(v, 0), m.vertices(v, 1), m.vertices(v, 2)});
  return static_cast<int>(places.size()) == n_vertices(m);
}

/// As files have them: in any order, and with defects that prepare() mends.
inline void disarrange(Surface& s, Rng& rng) {
  if (rng.below(3) == 0) s.mesh = shuffled(s.mesh, rng), s.name += ", shuffled";
  if (rng.below(4) != 0 || !is_weldable(s.mesh)) return;
  if (rng.below(3) == 0 && n_triangles(s.mesh) > 1) {
    s.mesh = beside(s.mesh, shapes::single_triangle().mesh);  // in its own unit
    s.name += ", two parts";
  }
  if (rng.below(3) == 0 && is_weldable(s.mesh)) s.mesh = soup(s.mesh), s.name += ", soup";
  if (rng.below(3) == 0 && n_triangles(s.mesh) > 4) {
    for (int i = n_triangles(s.mesh) / 5; i >= 0; --i) turn(s.mesh, rng.below(n_triangles(s.mesh)));
    s.name += ", turned over in part";
  }
}

/// One of them; large ones are rare, as they take long.
inline Surface surface(Rng& rng, bool may_be_large) {
  const std::vector<Shape>& all = all_shapes();
  const auto pick = [&] {
    return all[static_cast<std::size_t>(rng.below(static_cast<int>(all.size())))];
  };
  Shape shape = pick();
  for (const bool keep = may_be_large && rng.below(4) == 0; shape.is_large && !keep;)
    shape = pick();
  Surface s = {shape.name, shape.make(rng), shape};
  place(s, rng);
  return s;
}

/// A pair, and what is asked of it. The same seed makes the same case everywhere.
struct Case {
  std::uint64_t seed = 0;
  Surface a, b;
  std::vector<ism::Landmark> landmarks;
  ism::Options options;
  std::string name;
};

/// Vertices and points inside of triangles, none of them twice.
inline ism::LandmarkPoint landmark_point(const TriangleMesh& m, bool may_be_vertex,
                                         std::set<int>& used, Rng& rng) {
  const int f = rng.below(n_triangles(m)), v = m.triangles(f, rng.below(3));
  if (may_be_vertex && rng.below(2) && used.insert(v).second) return v;
  if (!used.insert(n_vertices(m) + f).second) return -1;
  const double s = rng.uniform(0.05, 0.45), t = rng.uniform(0.05, 0.45);
  return ism::SurfacePoint{f, {s, t, 1 - s - t}};
}

inline bool is_point(const ism::LandmarkPoint& p) { return p.vertex >= 0 || p.point.face >= 0; }

/// Exact ones and those between held boundaries are inside of triangles: in what order they come
/// along the boundaries is then no matter.
inline void add_landmarks(Case& c, int n, bool may_be_vertices, Rng& rng) {
  std::set<int> used_a, used_b;
  for (int i = 0; i < n; ++i) {
    const ism::LandmarkPoint a = landmark_point(c.a.mesh, may_be_vertices, used_a, rng);
    const ism::LandmarkPoint b = landmark_point(c.b.mesh, may_be_vertices, used_b, rng);
    if (is_point(a) && is_point(b)) c.landmarks.push_back({a, b});
  }
}

inline std::string name_of(const Case& c) {
  std::string name = c.a.name + " | " + c.b.name;
  if (!c.landmarks.empty()) name += " | " + std::to_string(c.landmarks.size());
  if (!c.landmarks.empty()) name += c.options.exact_landmarks ? " exact landmarks" : " landmarks";
  if (c.options.boundary == ism::Boundary::kFixed) name += " | fixed";
  if (c.options.boundary == ism::Boundary::kSlide) name += " | slide";
  return name;
}

/// Surfaces that are valid, at least once they are prepared.
inline Case valid_case(std::uint64_t seed) {
  Rng rng(1000003 * seed + 17);
  Case c;
  c.seed = seed;
  c.a = surface(rng, true);
  c.b = rng.below(8) || c.a.shape.is_large ? surface(rng, !c.a.shape.is_large) : c.a;
  c.options.threads = 1;
  c.options.max_iterations = 3;
  const int kind = rng.below(10);
  const bool are_open = !c.a.shape.is_closed && !c.b.shape.is_closed;
  const bool can_be_held = are_open && !c.a.shape.has_openings && !c.b.shape.has_openings;
  const bool is_exact = are_open && kind < 2;
  if (can_be_held && (kind == 1 || kind == 2)) c.options.boundary = ism::Boundary::kFixed;
  if (can_be_held && kind == 3) c.options.boundary = ism::Boundary::kSlide;
  c.options.exact_landmarks = is_exact;
  const bool may_be_vertices = !is_exact && c.options.boundary == ism::Boundary::kFree;
  if (is_exact || rng.below(2)) add_landmarks(c, rng.between(1, 5), may_be_vertices, rng);
  if (c.landmarks.empty()) disarrange(c.a, rng), disarrange(c.b, rng);
  c.name = name_of(c);
  return c;
}

/// Exact landmarks in triangles, and a surface that has to be cut open.
inline Case closed_exact_case(std::uint64_t seed) {
  Rng rng(1000003 * seed + 19);
  Case c;
  c.seed = seed;
  do c.a = surface(rng, false);
  while (!c.a.shape.is_closed);
  c.b = surface(rng, false);
  c.options.threads = 1;
  c.options.max_iterations = 3;
  c.options.exact_landmarks = true;
  add_landmarks(c, rng.between(1, 4), false, rng);
  if (rng.below(2)) {
    std::swap(c.a, c.b);
    for (ism::Landmark& l : c.landmarks) std::swap(l.a, l.b);
  }
  c.name = name_of(c);
  return c;
}

// ---- meshes with one defect ----

/// A mesh, and what validate() has to say of it.
struct Broken {
  std::string name;
  TriangleMesh mesh;
  Problem::Kind kind = Problem::Kind::kEmpty;
  std::set<int> ids = {};      // among those of a problem of this kind
  bool can_be_mended = false;  // by prepare()
};

inline Broken empty_mesh(TriangleMesh m, Rng& rng) {
  const int which = rng.below(3);
  if (which != 0) m.vertices.resize(0, 3);
  if (which != 1) m.triangles.resize(0, 3);
  return {"empty", m, Problem::Kind::kEmpty};
}

inline Broken bad_index(TriangleMesh m, Rng& rng) {
  const int f = rng.below(n_triangles(m)), n = n_vertices(m);
  const int bad[] = {-1, n, n + 7, std::numeric_limits<int>::max(),
                     std::numeric_limits<int>::min()};
  m.triangles(f, rng.below(3)) = bad[rng.below(5)];
  return {"index out of range", m, Problem::Kind::kIndexOutOfRange, {f}};
}

inline Broken not_finite(TriangleMesh m, Rng& rng) {
  using Limits = std::numeric_limits<double>;
  const int v = rng.below(n_vertices(m));
  const double bad[] = {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()};
  m.vertices(v, rng.below(3)) = bad[rng.below(3)];
  return {"not finite", m, Problem::Kind::kNonFiniteCoordinate, {v}};
}

inline Broken vertex_used_twice(TriangleMesh m, Rng& rng) {
  const int f = rng.below(n_triangles(m));
  const int g = add_triangle(m, m.triangles(f, 0), m.triangles(f, 0), m.triangles(f, 1));
  return {"vertex used twice", m, Problem::Kind::kDegenerateTriangle, {g}, true};
}

/// Both ends of an edge at one place.
inline Broken short_edge(TriangleMesh m, Rng& rng) {
  const int f = rng.below(n_triangles(m)), k = rng.below(3);
  m.vertices.row(m.triangles(f, k)) = m.vertices.row(m.triangles(f, (k + 1) % 3)).eval();
  return {"edge without length", m, Problem::Kind::kDegenerateTriangle, {f}, true};
}

/// A triangle cut in three, of which one has hardly a height.
inline Broken flat_triangle(TriangleMesh m, Rng& rng) {
  const int f = rng.below(n_triangles(m));
  const int u = m.triangles(f, 0), v = m.triangles(f, 1), w = m.triangles(f, 2);
  const double e = rng.below(2) ? 0 : 1e-14;
  const int x = add_vertex(
      m, (0.5 - e) * m.vertices.row(u) + 0.5 * m.vertices.row(v) + e * m.vertices.row(w));
  m.triangles.row(f) << u, v, x;
  add_triangle(m, v, w, x);
  add_triangle(m, w, u, x);
  return {"triangle without height", m, Problem::Kind::kDegenerateTriangle, {f}, true};
}

inline Broken repeated_triangle(TriangleMesh m, Rng& rng) {
  const int f = rng.below(n_triangles(m));
  const int g = add_triangle(m, m.triangles(f, 1), m.triangles(f, 2), m.triangles(f, 0));
  if (rng.below(2)) turn(m, g);
  return {"repeated", m, Problem::Kind::kRepeatedTriangle, {f, g}, true};
}

/// A half-edge 3 f + k with a triangle on its other side, and that triangle.
inline std::array<int, 2> inner_edge(const TriangleMesh& m, Rng& rng) {
  std::map<Edge, int> face_of;
  for (int h = 0; h < 3 * n_triangles(m); ++h)
    face_of[{m.triangles(h / 3, h % 3), m.triangles(h / 3, (h + 1) % 3)}] = h / 3;
  for (;;) {
    const int h = rng.below(3 * n_triangles(m));
    const auto other = face_of.find({m.triangles(h / 3, (h + 1) % 3), m.triangles(h / 3, h % 3)});
    if (other != face_of.end()) return {h, other->second};
  }
}

inline Broken flap(TriangleMesh m, Rng& rng) {
  const auto [h, g] = inner_edge(m, rng);
  const int v = add_vertex(m, m.vertices.row(m.triangles(h / 3, 0)) + Eigen::RowVector3d(0, 0, 9));
  const int u = m.triangles(h / 3, h % 3), w = m.triangles(h / 3, (h + 1) % 3);
  const int added = add_triangle(m, u, w, v);
  return {"flap", m, Problem::Kind::kNonManifoldEdge, {h / 3, g, added}, true};
}

inline Broken turned_over(TriangleMesh m, Rng& rng) {
  const auto [h, g] = inner_edge(m, rng);
  turn(m, h / 3);
  return {"turned over", m, Problem::Kind::kInconsistentOrientation, {h / 3, g}, true};
}

inline Broken two_fans(TriangleMesh m, Rng& rng) {
  const int v = rng.below(n_vertices(m));
  const Eigen::RowVector3d p = m.vertices.row(v);
  const int x = add_vertex(m, p + Eigen::RowVector3d(0, 0, 5));
  const int y = add_vertex(m, p + Eigen::RowVector3d(0, 1, 5));
  add_triangle(m, v, x, y);
  return {"two fans", m, Problem::Kind::kNonManifoldVertex, {v}, true};
}

inline Broken unused_vertex(TriangleMesh m, Rng& rng) {
  const int v = add_vertex(m, Vector3d(rng.uniform(), rng.uniform(), 0));
  return {"unused vertex", m, Problem::Kind::kUnreferencedVertex, {v}, true};
}

inline Broken two_parts(TriangleMesh m, Rng& rng) {
  return {"two parts",
          beside(m, shapes::fan(rng.between(3, 6)).mesh),
          Problem::Kind::kSeveralComponents,
          {},
          true};
}

/// A grid of n × 2 cells as a band, twisted once; only prepare() can tell that it has one side.
inline Broken one_sided(TriangleMesh, Rng& rng) {
  const int n = rng.between(5, 20);
  TriangleMesh m;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < 3; ++j) {
      const double t = 2 * shapes::kPi * i / n, s = 0.3 * (j - 1), r = 2 + s * std::cos(t / 2);
      add_vertex(m, Vector3d(r * std::cos(t), r * std::sin(t), s * std::sin(t / 2)));
    }
  const auto id = [&](int i, int j) { return i < n ? 3 * i + j : 2 - j; };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < 2; ++j) {
      add_triangle(m, id(i, j), id(i + 1, j), id(i + 1, j + 1));
      add_triangle(m, id(i, j), id(i + 1, j + 1), id(i, j + 1));
    }
  return {"one side", m, Problem::Kind::kInconsistentOrientation};
}

/// A torus, also one with an opening.
inline Broken with_handle(TriangleMesh, Rng& rng) {
  const int n = rng.between(3, 9), k = rng.between(3, 7);
  TriangleMesh m;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < k; ++j) {
      const double s = 2 * shapes::kPi * i / n, t = 2 * shapes::kPi * j / k;
      const double r = 2 + std::cos(t);
      add_vertex(m, Vector3d(r * std::cos(s), r * std::sin(s), std::sin(t)));
    }
  const auto id = [&](int i, int j) { return i % n * k + j % k; };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < k; ++j) {
      add_triangle(m, id(i, j), id(i + 1, j), id(i + 1, j + 1));
      add_triangle(m, id(i, j), id(i + 1, j + 1), id(i, j + 1));
    }
  if (rng.below(2)) m.triangles.conservativeResize(n_triangles(m) - 1, Eigen::NoChange);
  return {"handle", m, Problem::Kind::kHandles};
}

using Breaker = Broken (*)(TriangleMesh, Rng&);
inline constexpr Breaker kBreakers[] = {
    empty_mesh, bad_index,   not_finite, vertex_used_twice, short_edge, flat_triangle, flap,
    two_fans,   turned_over, two_parts,  repeated_triangle, one_sided,  unused_vertex, with_handle};
inline constexpr int kDefects = static_cast<int>(sizeof kBreakers / sizeof kBreakers[0]);

inline Broken broken(std::uint64_t seed) {
  Rng rng(1000003 * seed + 23);
  Disk disk = shapes::random_disk(rng.between(2, 5), rng.between(2, 5), rng);
  shapes::bend(disk, 0.4);
  const TriangleMesh clean = shuffled(disk.mesh, rng);
  return kBreakers[seed % kDefects](clean, rng);
}

// ---- exact orientation, in this file's own way ----

/// The sign of a sum of doubles: non-overlapping parts, the last one is the largest.
class ExactSum {
 public:
  void add(double x) {
    std::size_t kept = 0;
    for (double part : parts_) {
      const double sum = x + part, of_part = sum - x;
      const double rest = (x - (sum - of_part)) + (part - of_part);
      if (rest != 0) parts_[kept++] = rest;
      x = sum;
    }
    parts_.resize(kept);
    if (x != 0) parts_.push_back(x);
  }
  /// In halves, whose products are exact; std::fma is not, in every library.
  void add_product(double x, double y) {
    for (double a : {high_half(x), x - high_half(x)})
      for (double b : {high_half(y), y - high_half(y)}) add(a * b);
  }
  int sign() const { return parts_.empty() ? 0 : parts_.back() > 0 ? 1 : -1; }

 private:
  static double high_half(double x) {
    int exponent = 0;
    const double mantissa = std::frexp(x, &exponent);
    return std::ldexp(std::round(std::ldexp(mantissa, 26)), exponent - 26);
  }

  std::vector<double> parts_;
};

inline int orientation(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  const long double u = static_cast<long double>(b.x() - a.x()) * (c.y() - a.y());
  const long double v = static_cast<long double>(b.y() - a.y()) * (c.x() - a.x());
  if (std::abs(u - v) > 1e-14L * (std::abs(u) + std::abs(v))) return u > v ? 1 : -1;
  ExactSum sum;
  sum.add_product(a.x(), b.y()), sum.add_product(-a.y(), b.x());
  sum.add_product(b.x(), c.y()), sum.add_product(-b.y(), c.x());
  sum.add_product(c.x(), a.y()), sum.add_product(-c.y(), a.x());
  return sum.sign();
}

inline std::vector<Edge> boundary_edges(const ism::Triangles& F) {
  std::set<Edge> edges;
  for (int f = 0; f < F.rows(); ++f)
    for (int k = 0; k < 3; ++k) edges.insert({F(f, k), F(f, (k + 1) % 3)});
  std::vector<Edge> boundary;
  for (const Edge& e : edges)
    if (edges.count({e[1], e[0]}) == 0) boundary.push_back(e);
  return boundary;
}

/// Do two edges without a common vertex touch, or those with one lie on each other?
inline bool edges_meet(const Points2& x, const Edge& e, const Edge& f) {
  const Vector2d a = x.row(e[0]), b = x.row(e[1]), c = x.row(f[0]), d = x.row(f[1]);
  if (a.cwiseMax(b).x() < c.cwiseMin(d).x() || c.cwiseMax(d).x() < a.cwiseMin(b).x() ||
      a.cwiseMax(b).y() < c.cwiseMin(d).y() || c.cwiseMax(d).y() < a.cwiseMin(b).y())
    return false;
  if (e[1] == f[0]) return orientation(a, b, d) == 0 && (a - b).dot(d - b) > 0;
  if (e[0] == f[1]) return orientation(c, d, b) == 0 && (c - d).dot(b - d) > 0;
  const int of_c = orientation(a, b, c), of_d = orientation(a, b, d);
  const int of_a = orientation(c, d, a), of_b = orientation(c, d, b);
  return of_c * of_d <= 0 && of_a * of_b <= 0;  // collinear ones have overlapping boxes
}

/// All triangles are positive, and boundary edges meet in common vertices only. The sum of the
/// winding numbers of the loops is then how often a point is covered, which is at most once if of
/// each component one loop is positive, and loops of components do not lie in each other; the
/// latter is left to SurfaceMap.
inline std::string injectivity_defect(const ism::Triangles& F, const Points2& x) {
  for (int f = 0; f < F.rows(); ++f)
    if (orientation(x.row(F(f, 0)), x.row(F(f, 1)), x.row(F(f, 2))) <= 0)
      return "triangle " + std::to_string(f) + " is not positive";
  const std::vector<Edge> edges = boundary_edges(F);
  for (std::size_t i = 0; i < edges.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (edges_meet(x, edges[i], edges[j]))
        return "boundary edges at vertices " + std::to_string(edges[i][0]) + " and " +
               std::to_string(edges[j][0]) + " meet";
  return "";
}

// ---- what must hold of a result ----

/// What was found, in words, and how bad it was.
struct Verdict {
  ism::Status status = ism::Status::kNoMapYet;
  std::string message;
  double seconds = 0;
  double round_trip = 0;  // the largest, in units of the bound below
  std::vector<std::string> complaints;
  void expect(bool holds, const std::string& otherwise) {
    if (!holds) complaints.push_back(otherwise);
  }
};

inline std::string not_finite(const ism::IterationLog& s) {
  std::string names;
  for (const auto& [name, x] :
       std::initializer_list<std::pair<const char*, double>>{{"energy", s.energy},
                                                             {"map_energy", s.map_energy},
                                                             {"energy_f", s.energy_f},
                                                             {"energy_g", s.energy_g},
                                                             {"mean_distortion", s.mean_distortion},
                                                             {"coverage_a", s.coverage_a},
                                                             {"coverage_b", s.coverage_b},
                                                             {"omega", s.omega},
                                                             {"step", s.step},
                                                             {"pin_residual", s.pin_residual}})
    if (!std::isfinite(x)) names += std::string(" ") + name + " " + std::to_string(x);
  return names;
}

inline void check_log(const ism::Result& r, Verdict& verdict) {
  std::vector<ism::IterationLog> all = r.log;
  all.push_back(r.initial);
  for (const ism::IterationLog& s : all) {
    const std::string names = not_finite(s);
    verdict.expect(s.max_step >= 0, "max_step is negative or no number");  // may be infinite
    verdict.expect(names.empty(), "iteration " + std::to_string(s.iteration) + " has" + names);
    verdict.expect(s.coverage_a >= 0 && s.coverage_a <= 1 + 1e-9 && s.coverage_b >= 0 &&
                       s.coverage_b <= 1 + 1e-9,
                   "coverage is not in [0, 1]");
  }
  verdict.expect(r.f.allFinite() && r.g.allFinite(), "a position is not finite");
  verdict.expect(std::isfinite(r.start.landmark_distance), "landmark_distance is not finite");
}

inline void check_meta(const ism::SurfaceMap& map, Verdict& verdict) {
  const ism::MetaMesh meta = map.meta_mesh();
  for (ism::Element e : {ism::Element::kVertex, ism::Element::kCorner}) {
    const ism::Transfer t = ism::transfer(meta, Side::kA, e, ism::Element::kVertex);
    verdict.expect(t.n_sources == ism::to_meta(meta, Side::kA, e).n_sources &&
                       t.rows() == map.mesh(Side::kB).vertices.rows(),
                   "a transfer is not of the meshes given");
  }
  verdict.expect(meta.on_a.allFinite() && meta.on_b.allFinite() && meta.plane.allFinite() &&
                     meta.corner_a.allFinite() && meta.corner_b.allFinite(),
                 "the meta mesh is not finite");
  const std::vector<ism::PolygonDistortion> polygons = map.distortion();
  bool is_finite = true;
  for (const ism::PolygonDistortion& p : polygons)
    is_finite = is_finite && std::isfinite(p.area_a) && std::isfinite(p.area_b) &&
                std::isfinite(p.sigma_min) && std::isfinite(p.sigma_max) &&
                std::isfinite(p.density);
  verdict.expect(is_finite, "distortion() is not finite");
  const ism::DistortionSummary s = ism::summarize(polygons);
  verdict.expect(std::isfinite(s.mean) && std::isfinite(s.largest) && s.area_a > 0 && s.area_b > 0,
                 "the summary of the distortion is not finite, or without area");
  for (Side side : {Side::kA, Side::kB})
    verdict.expect(ism::remesh(map, side).vertices.allFinite(), "remesh() is not finite");
}

/// The longest edge and the least height of a triangle.
struct Measures {
  double longest = 0, height = 0;
};
template <class Points>
Measures measures(const Points& x, const ism::Triangles& F, int f) {
  const auto point = [&](int k) {
    Vector3d p = Vector3d::Zero();
    p.head(x.cols()) = x.row(F(f, k)).transpose();
    return p;
  };
  Measures m;
  for (int k = 0; k < 3; ++k)
    m.longest = (std::max)(m.longest, (point((k + 1) % 3) - point(k)).norm());
  m.height = (point(1) - point(0)).cross(point(2) - point(0)).norm() / m.longest;
  return m;
}

/// How far a vertex of A may be from itself on the way to B and back. Positions in the plane are
/// known to eps R, R the radius. Barycentric coordinates in the triangle of B err by that over its
/// height h_b, so the point in the plane is known to eps R L_b / h_b; those in the triangle of A by
/// as much over its height there, and the point of the surface by this times its longest edge.
inline double round_trip_bound(const ism::Result& r, int face_a, int face_b) {
  const Measures in_a = measures(r.f, r.start.a->triangles, face_a);
  const Measures in_b = measures(r.g, r.start.b->triangles, face_b);
  const Measures on_a = measures(r.start.a->vertices, r.start.a->triangles, face_a);
  const double radius = (std::max)(r.f.cwiseAbs().maxCoeff(), r.g.cwiseAbs().maxCoeff());
  const double eps = std::numeric_limits<double>::epsilon();
  return eps * (radius * in_b.longest / in_b.height / in_a.height * on_a.longest +
                r.start.a->vertices.cwiseAbs().maxCoeff());
}

inline void check_round_trips(const ism::Result& r, const ism::SurfaceMap& map, Verdict& verdict) {
  const TriangleMesh& a = *r.start.a;
  int lost = 0;
  for (int v = 0; v < n_vertices(a); ++v) {
    const ism::SurfacePoint image = map.forward_vertex(v);
    if (!image.exists()) continue;
    verdict.expect(image.barycentric.allFinite() && map.position_on_b(image).allFinite(),
                   "the image of vertex " + std::to_string(v) + " is not finite");
    const ism::SurfacePoint back = map.backward(image);
    if (!back.exists()) {
      ++lost;
      continue;
    }
    const Vector3d x = a.vertices.row(v), y = map.position_on_a(back);
    const double bound = round_trip_bound(r, back.face, image.face);
    const double ratio = (y - x).norm() / bound;
    verdict.expect(!std::isnan(ratio), "a round trip is not finite");
    verdict.round_trip = (std::max)(verdict.round_trip, ratio);
  }
  // On the boundary of the overlap, rounding may put an image beside the other surface.
  verdict.expect(lost <= n_vertices(a) / 10 + 3, std::to_string(lost) + " images have none");
}

inline void check_map(const ism::Result& r, Verdict& verdict) {
  check_log(r, verdict);
  for (const auto& defect : {injectivity_defect(r.start.a->triangles, r.f),
                             injectivity_defect(r.start.b->triangles, r.g)})
    verdict.expect(defect.empty(), "not injective: " + defect);
  const ism::SurfaceMap map(r);
  verdict.expect(map.status() == ism::Status::kDone, "SurfaceMap: " + map.message());
  if (map.status() != ism::Status::kDone) return;
  check_meta(map, verdict);
  ism::Result embedded = r;  // whose ids are those of positions
  embedded.start.prepared_a = embedded.start.prepared_b = std::make_shared<ism::Prepared>();
  check_round_trips(r, ism::SurfaceMap(embedded), verdict);
}

/// How long a pair may take. Large fans on each other have polygons by the hundred thousand.
inline double time_limit(const Case& c) {
#ifdef ISM_TEST_SANITIZED
  constexpr double kSlower = 20;
#else
  constexpr double kSlower = 1;
#endif
  return kSlower * (c.a.shape.is_large || c.b.shape.is_large ? 100 : 5);  // seconds
}

/// What may be refused although the surfaces are valid: exact landmarks that were not joined, if
/// they are named.
inline bool is_refusal(const Case& c, const ism::Result& r) {
  return r.status == ism::Status::kInvalidLandmarks && c.options.exact_landmarks &&
         !r.ids.empty() && r.message.find("could not be joined") != std::string::npos;
}

/// Bounds. Of thousands of pairs, most stay below 2; of a surface on itself, where all edges of A
/// lie along those of B and cross them at angles of some eps, the largest was 249.
constexpr double kRoundTrip = 1000;

inline Verdict judge(const Case& c) {
  const std::clock_t start = std::clock();  // of the one thread: other tests run beside it
  const auto seconds = [&] { return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC; };
  ism::Options options = c.options;
  options.progress = [&](const ism::Progress&) { return seconds() < 2 * time_limit(c); };
  const ism::Result r = ism::compute_map(c.a.mesh, c.b.mesh, c.landmarks, options);
  Verdict verdict;
  verdict.seconds = seconds();
  verdict.status = r.status;
  verdict.message = r.message;
  verdict.expect(verdict.seconds < time_limit(c), "took long");
  if (ism::is_usable(r.status))
    check_map(r, verdict);
  else
    verdict.expect(r.f.size() == 0 && r.g.size() == 0, "positions without a map");
  verdict.expect(ism::is_usable(r.status) || is_refusal(c, r), "no map");
  verdict.expect(verdict.round_trip < kRoundTrip, "a round trip does not end near its start");
  return verdict;
}

inline void check_problems(const Broken& b, Verdict& verdict) {
  bool is_found = false;
  for (const Problem& p : ism::validate(b.mesh)) {
    const std::set<int> ids(p.ids.begin(), p.ids.end());
    is_found = is_found || (p.kind == b.kind &&
                            std::includes(ids.begin(), ids.end(), b.ids.begin(), b.ids.end()));
  }
  verdict.expect(is_found, "validate() does not name the defect");
  const ism::Prepared p = ism::prepare(b.mesh);
  verdict.expect(p.problems.empty() == b.can_be_mended, "prepare() mends it, or does not");
  if (p.problems.empty())
    verdict.expect(!p.repairs.empty() && ism::validate(*p.mesh).empty(), "prepare() is wrong");
}

/// What compute_map() says of a mesh that it refuses is the first problem of validate().
inline void check_refused(const Broken& b, Side side, const ism::Result& r, Verdict& verdict) {
  const std::vector<Problem> problems = ism::validate(b.mesh);
  verdict.expect(r.status == ism::Status::kInvalidMesh, "not refused");
  verdict.expect(r.f.size() == 0 && r.g.size() == 0, "positions without a map");
  verdict.expect(r.message.find(side == Side::kA ? "mesh A" : "mesh B") != std::string::npos,
                 "the message does not name the mesh: " + r.message);
  if (problems.empty()) return;
  std::vector<ism::ElementId> ids;
  for (int id : problems[0].ids) ids.push_back({side, problems[0].element, id});
  verdict.expect(r.ids == ids, "the ids are not those of the first problem");
}

/// On either side.
inline Verdict judge(const Broken& b) {
  Verdict verdict;
  check_problems(b, verdict);
  const TriangleMesh other = shapes::grid(4, 3).mesh;
  for (int way = 0; way < 2; ++way) {
    const Side side = way % 2 ? Side::kA : Side::kB;
    ism::Options options;
    options.threads = 1;
    options.max_iterations = 2;
    const ism::Result r = side == Side::kA ? ism::compute_map(b.mesh, other, {}, options)
                                           : ism::compute_map(other, b.mesh, {}, options);
    verdict.status = r.status;
    verdict.message = r.message;
    if (b.can_be_mended) {
      verdict.expect(ism::is_usable(r.status), "no map of the prepared mesh: " + r.message);
      if (ism::is_usable(r.status)) check_map(r, verdict);
    } else if (b.kind != Problem::Kind::kInconsistentOrientation) {
      check_refused(b, side, r, verdict);
    } else {
      verdict.expect(r.status == ism::Status::kInvalidMesh, "not refused");
    }
  }
  return verdict;
}

}  // namespace hostile

#endif  // ISM_TESTS_HOSTILE_HPP

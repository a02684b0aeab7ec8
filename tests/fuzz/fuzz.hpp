// What the fuzz targets share: bytes become numbers and meshes, and what must hold of results.

#ifndef ISM_TESTS_FUZZ_HPP
#define ISM_TESTS_FUZZ_HPP

#include "ism.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

/// Every target defines it; called by libFuzzer, and by replay.cpp with files of the corpus.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace fuzz {

/// An assertion that stays in Release.
inline void require(bool holds, const std::string& text) {
  if (holds) return;
  std::fprintf(stderr, "violated: %s\n", text.c_str());
  std::fflush(stderr);
  std::abort();
}

inline void require_range(int id, std::ptrdiff_t n, const char* what) {
  require(id >= 0 && id < n, std::string(what) + " is in range");
}

// ==== [1] BYTES ==================================================================================

/// Takes an input apart. Behind its end there are zeros.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : p_(data), end_(data + size) {}

  bool empty() const { return p_ == end_; }
  int byte() { return empty() ? 0 : *p_++; }
  int below(int n) { return n > 256 ? (byte() * 256 + byte()) % n : byte() % n; }
  int between(int lo, int hi) { return lo + below(hi - lo + 1); }  // both included
  bool flag() { return (byte() & 1) != 0; }

  /// Any bits as a number of this type.
  template <class Number>
  Number raw() {
    unsigned char bits[sizeof(Number)];
    for (unsigned char& b : bits) b = static_cast<unsigned char>(byte());
    Number x;
    std::memcpy(&x, bits, sizeof x);
    return x;
  }

  /// Mostly small integers and their quarters, sometimes what breaks programs.
  double number() {
    static const double kOdd[] = {0.0,    -0.0,    0.1,      1e-3,      1e-9,
                                  1e-17,  1e-150,  1e-300,   5e-324,    1 + 1e-9,
                                  1e6,    1e17,    1e150,    1e300,     1.7976931348623157e308,
                                  -1e150, -1e-300, HUGE_VAL, -HUGE_VAL, std::nan("")};
    const int kind = byte();
    if (kind < 128) return kind - 64;
    if (kind < 192) return 0.25 * (kind - 160);
    if (kind == 192) return raw<double>();
    return kOdd[static_cast<std::size_t>(kind) % (sizeof kOdd / sizeof kOdd[0])];
  }
  /// An id of 0 to n - 1, or rarely another integer.
  int id(int n) {
    const int kind = byte();
    if (kind == 255) return raw<std::int32_t>();
    if (kind == 254) return n;
    if (kind == 253) return -1;
    return n > 0 ? kind % n : kind;
  }

 private:
  const std::uint8_t* p_;
  const std::uint8_t* end_;
};

// ==== [2] EXACT ORIENTATION ======================================================================

/// Adds x to a sum of numbers that do not overlap, smallest first [Shewchuk 1997].
inline void grow(std::vector<double>& sum, double x) {
  for (double& part : sum) {
    const double s = part + x, b = s - part;
    part = (part - (s - b)) + (x - b);
    x = s;
  }
  sum.push_back(x);
}

inline void grow_by_product(std::vector<double>& sum, double x, double y) {
  const double product = x * y;
  grow(sum, std::fma(x, y, -product));
  grow(sum, product);
}

/// 1 if a, b, c turn left, -1 if right, 0 if collinear: exact, but for products below 1e-290 or
/// above 1e300. On purpose not that of the library, which it checks.
template <class Point>
int orientation(const Point& a, const Point& b, const Point& c) {
  std::vector<double> sum;
  sum.reserve(12);
  grow_by_product(sum, a[0], b[1]);
  grow_by_product(sum, -a[1], b[0]);
  grow_by_product(sum, b[0], c[1]);
  grow_by_product(sum, -b[1], c[0]);
  grow_by_product(sum, c[0], a[1]);
  grow_by_product(sum, -c[1], a[0]);
  for (std::size_t i = sum.size(); i-- > 0;)
    if (sum[i] != 0) return sum[i] > 0 ? 1 : -1;
  return 0;
}

using Corners = std::array<Eigen::Vector2d, 3>;

inline Corners corners_of(const ism::Triangles& triangles, const ism::Points2& plane, int f) {
  return {plane.row(triangles(f, 0)), plane.row(triangles(f, 1)), plane.row(triangles(f, 2))};
}

/// True if a side of the first has the second on its other side or on it.
inline bool separates(const Corners& s, const Corners& t) {
  for (std::size_t k = 0; k < 3; ++k) {
    bool apart = true;
    for (const Eigen::Vector2d& p : t) apart = apart && orientation(s[k], s[(k + 1) % 3], p) <= 0;
    if (apart) return true;
  }
  return false;
}

/// All triangles are positive and no two of them overlap: the embedding is injective.
inline void require_injective(const ism::Triangles& triangles, const ism::Points2& plane) {
  require(plane.allFinite(), "positions are finite");
  std::vector<Corners> corners;
  for (int f = 0; f < triangles.rows(); ++f) {
    corners.push_back(corners_of(triangles, plane, f));
    const Corners& t = corners.back();
    require(orientation(t[0], t[1], t[2]) > 0, "triangles are positive");
  }
  if (corners.size() > 200) return;  // quadratic
  for (std::size_t i = 0; i < corners.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      require(separates(corners[i], corners[j]) || separates(corners[j], corners[i]),
              "triangles do not overlap");
}

// ==== [3] MESHES =================================================================================

using IntPoint = std::array<int, 2>;
using IntTriangle = std::array<int, 3>;

inline int turn(const IntPoint& a, const IntPoint& b, const IntPoint& c) {
  const int det = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  return det > 0 ? 1 : det < 0 ? -1 : 0;
}

/// An embedded planar mesh with a boundary on integers, grown step by step. A step that would leave
/// it with triangles that touch where they are not joined is not made.
class Lattice {
 public:
  std::vector<IntPoint> points = {{0, 0}, {8, 0}, {0, 8}};
  std::vector<IntTriangle> triangles = {{0, 1, 2}};

  void grow(Bytes& bytes, int steps) {
    for (int i = 0; i < steps && !bytes.empty(); ++i) {
      const int kind = bytes.below(8);
      const int t = bytes.below(static_cast<int>(triangles.size())), k = bytes.below(3);
      if (kind < 3) attach(t, k, {bytes.between(-8, 8), bytes.between(-8, 8)});
      if (kind == 3 || kind == 4) fill(t, k);
      if (kind == 5) split_edge(t, k);
      if (kind == 6) split_triangle(t, {bytes.between(-4, 4), bytes.between(-4, 4)});
      if (kind == 7) bytes.below(4) == 0 ? open(t) : flip(t, k);
    }
  }
  void move(int dx, int dy) {
    for (IntPoint& p : points) p = {p[0] + dx, p[1] + dy};
  }

 private:
  static constexpr int kLargest = 64;  // coordinates

  IntPoint point(int t, int k) const { return points[at(triangles[at(t)][at(k % 3)])]; }
  int vertex(int t, int k) const { return triangles[at(t)][at(k % 3)]; }
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }

  /// The triangle with side u-v in this direction and the place of that side, else -1.
  std::array<int, 2> find(int u, int v) const {
    for (int t = 0; t < static_cast<int>(triangles.size()); ++t)
      for (int k = 0; k < 3; ++k)
        if (vertex(t, k) == u && vertex(t, k + 1) == v) return {t, k};
    return {-1, -1};
  }
  bool on_boundary(int u, int v) const { return find(u, v)[0] >= 0 && find(v, u)[0] < 0; }
  bool on_boundary(int v) const {
    for (int t = 0; t < static_cast<int>(triangles.size()); ++t)
      for (int k = 0; k < 3; ++k)
        if ((vertex(t, k) == v || vertex(t, k + 1) == v) &&
            find(vertex(t, k + 1), vertex(t, k))[0] < 0)
          return true;
    return false;
  }

  int turn(int u, int v, int w) const {
    return fuzz::turn(points[at(u)], points[at(v)], points[at(w)]);
  }
  /// A side of s has t strictly behind it, but for vertices they share.
  bool separates(const IntTriangle& s, const IntTriangle& t, int shared) const {
    for (std::size_t k = 0; k < 3; ++k) {
      const int u = s[k], v = s[(k + 1) % 3];
      int behind = 0;
      for (const int w : t) behind += turn(u, v, w) < 0;
      bool at_corner = false;  // the side passes through all that is shared
      int on_side = 0;
      for (const int w : t) on_side += w == u || w == v;
      at_corner = on_side == shared;
      if (at_corner && behind + shared == 3) return true;
    }
    return false;
  }
  static int count_shared(const IntTriangle& s, const IntTriangle& t) {
    int n = 0;
    for (const int v : s) n += std::count(t.begin(), t.end(), v) > 0;
    return n;
  }
  /// They have in common what they share: nothing, a vertex or a side.
  bool meet_well(const IntTriangle& s, const IntTriangle& t) const {
    const int shared = count_shared(s, t);
    return shared < 3 && (separates(s, t, shared) || separates(t, s, shared));
  }
  bool fits(const IntTriangle& t) const {
    if (turn(t[0], t[1], t[2]) <= 0) return false;
    for (const int v : t)
      if ((std::max)(std::abs(points[at(v)][0]), std::abs(points[at(v)][1])) > kLargest)
        return false;
    return std::all_of(triangles.begin(), triangles.end(),
                       [&](const IntTriangle& s) { return meet_well(s, t); });
  }

  void attach(int t, int k, const IntPoint& offset) {
    const int u = vertex(t, k), v = vertex(t, k + 1), w = static_cast<int>(points.size());
    if (!on_boundary(u, v)) return;
    const IntPoint p = point(t, k);
    points.push_back({p[0] + offset[0], p[1] + offset[1]});
    const IntTriangle added = {v, u, w};
    if (fits(added))
      triangles.push_back(added);
    else
      points.pop_back();
  }
  /// Fills the notch behind side k, where the next side of the boundary turns towards it.
  void fill(int t, int k) {
    const int u = vertex(t, k), v = vertex(t, k + 1);
    if (!on_boundary(u, v)) return;
    for (int s = 0; s < static_cast<int>(triangles.size()); ++s)
      for (int j = 0; j < 3; ++j) {
        const IntTriangle added = {vertex(s, j + 1), v, u};
        if (vertex(s, j) != v || !on_boundary(v, added[0]) || added[0] == u) continue;
        if (find(u, added[0])[0] >= 0 || find(added[0], u)[0] >= 0 || !fits(added)) continue;
        triangles.push_back(added);
        return;
      }
  }
  void split_edge(int t, int k) {
    const int u = vertex(t, k), v = vertex(t, k + 1), w = static_cast<int>(points.size());
    const IntPoint p = points[at(u)], q = points[at(v)];
    if ((p[0] + q[0]) % 2 != 0 || (p[1] + q[1]) % 2 != 0) return;
    points.push_back({(p[0] + q[0]) / 2, (p[1] + q[1]) / 2});
    for (const std::array<int, 2>& e : {find(u, v), find(v, u)})
      if (e[0] >= 0) {
        const IntTriangle s = triangles[at(e[0])];
        const int from = s[at(e[1])], to = s[at((e[1] + 1) % 3)], tip = s[at((e[1] + 2) % 3)];
        triangles[at(e[0])] = {from, w, tip};
        triangles.push_back({w, to, tip});
      }
  }
  void split_triangle(int t, const IntPoint& offset) {
    const IntTriangle s = triangles[at(t)];
    const int w = static_cast<int>(points.size());
    const IntPoint a = point(t, 0), b = point(t, 1), c = point(t, 2);
    points.push_back({(a[0] + b[0] + c[0]) / 3 + offset[0], (a[1] + b[1] + c[1]) / 3 + offset[1]});
    if (turn(s[0], s[1], w) <= 0 || turn(s[1], s[2], w) <= 0 || turn(s[2], s[0], w) <= 0) {
      points.pop_back();
      return;
    }
    triangles[at(t)] = {s[0], s[1], w};
    triangles.push_back({s[1], s[2], w});
    triangles.push_back({s[2], s[0], w});
  }
  void flip(int t, int k) {
    const std::array<int, 2> e = find(vertex(t, k + 1), vertex(t, k));
    if (e[0] < 0) return;
    const int u = vertex(t, k), v = vertex(t, k + 1), w = vertex(t, k + 2),
              x = vertex(e[0], e[1] + 2);
    if (turn(u, x, w) <= 0 || turn(x, v, w) <= 0 || find(w, x)[0] >= 0 || find(x, w)[0] >= 0)
      return;
    triangles[at(t)] = {u, x, w};
    triangles[at(e[0])] = {x, v, w};
  }
  /// Takes a triangle out that does not touch the boundary.
  void open(int t) {
    for (const int v : triangles[at(t)])
      if (on_boundary(v)) return;
    triangles.erase(triangles.begin() + t);
  }
};

inline ism::Points2 plane_of(const Lattice& lattice) {
  ism::Points2 plane(static_cast<int>(lattice.points.size()), 2);
  for (int i = 0; i < plane.rows(); ++i) {
    const IntPoint& p = lattice.points[static_cast<std::size_t>(i)];
    plane.row(i) << p[0], p[1];
  }
  return plane;
}

inline ism::Triangles to_triangles(const std::vector<IntTriangle>& list) {
  ism::Triangles triangles(static_cast<int>(list.size()), 3);
  for (int i = 0; i < triangles.rows(); ++i) {
    const IntTriangle& t = list[static_cast<std::size_t>(i)];
    triangles.row(i) << t[0], t[1], t[2];
  }
  return triangles;
}

/// A surface above a lattice. Its triangles are no lines, as those of the lattice are none.
inline ism::TriangleMesh lifted(const Lattice& lattice, Bytes& bytes) {
  ism::TriangleMesh mesh;
  mesh.triangles = to_triangles(lattice.triangles);
  mesh.vertices = ism::Points3::Zero(static_cast<int>(lattice.points.size()), 3);
  mesh.vertices.leftCols<2>() = plane_of(lattice);
  const double height = 0.5 * bytes.below(4);
  for (int i = 0; height > 0 && i < mesh.vertices.rows(); ++i)
    mesh.vertices(i, 2) = height * bytes.below(5);
  return mesh;
}

/// Any vertices and triangles.
inline ism::TriangleMesh raw_mesh(Bytes& bytes, int most) {
  ism::TriangleMesh mesh;
  mesh.vertices.resize(bytes.below(most), 3);
  mesh.triangles.resize(bytes.below(most), 3);
  const bool small = bytes.flag();  // few different coordinates, so that vertices coincide
  for (int i = 0; i < mesh.vertices.size(); ++i)
    mesh.vertices.data()[i] = small ? bytes.below(3) : bytes.number();
  for (int i = 0; i < mesh.triangles.size(); ++i)
    mesh.triangles.data()[i] = bytes.id(static_cast<int>(mesh.vertices.rows()));
  return mesh;
}

inline void split(ism::TriangleMesh& mesh, int f, const Eigen::Vector3d& tip) {
  const int v = static_cast<int>(mesh.vertices.rows()), n = static_cast<int>(mesh.triangles.rows());
  const Eigen::Vector3i t = mesh.triangles.row(f);
  mesh.vertices.conservativeResize(v + 1, 3);
  mesh.vertices.row(v) = tip;
  mesh.triangles.conservativeResize(n + 2, 3);
  mesh.triangles.row(f) << t[0], t[1], v;
  mesh.triangles.row(n) << t[1], t[2], v;
  mesh.triangles.row(n + 1) << t[2], t[0], v;
}

inline void drop_triangle(ism::TriangleMesh& mesh, int f) {
  const int last = static_cast<int>(mesh.triangles.rows()) - 1;
  mesh.triangles.row(f) = mesh.triangles.row(last).eval();
  mesh.triangles.conservativeResize(last, 3);
}

/// An octahedron or a tetrahedron with tips on its triangles, some of them flat or turned inwards.
inline ism::TriangleMesh closed_mesh(Bytes& bytes, int steps) {
  ism::TriangleMesh mesh;
  mesh.vertices.resize(6, 3);
  mesh.vertices << 3, 0, 0, -3, 0, 0, 0, 3, 0, 0, -3, 0, 0, 0, 3, 0, 0, -3;
  mesh.triangles.resize(8, 3);
  mesh.triangles << 0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5;
  if (bytes.flag()) {
    mesh.vertices.conservativeResize(4, 3);
    mesh.vertices << 0, 0, 0, 4, 0, 0, 0, 4, 0, 0, 0, 4;
    mesh.triangles.resize(4, 3);
    mesh.triangles << 0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3;
  }
  for (int i = 0; i < steps && !bytes.empty(); ++i) {
    const int f = bytes.below(static_cast<int>(mesh.triangles.rows()));
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) middle += mesh.vertices.row(mesh.triangles(f, k)) / 3.0;
    split(mesh, f, middle * (0.25 * bytes.between(2, 7)));
  }
  return mesh;
}

// ==== [4] WHAT MUST HOLD OF MAPS =================================================================

inline void require_point(const ism::TriangleMesh& mesh, const ism::SurfacePoint& p) {
  require_range(p.face, mesh.triangles.rows(), "the face of an image");
  require(p.barycentric.allFinite(), "barycentric coordinates of an image are finite");
  require(p.barycentric.minCoeff() > -1e-6 && std::abs(p.barycentric.sum() - 1) < 1e-6,
          "an image lies in its triangle");
}

inline void require_meta_mesh(const ism::MetaMesh& meta) {
  const std::size_t n = meta.face_a.size();
  require(meta.face_b.size() == n && meta.offsets.size() == n + 1, "a row for each polygon");
  require(meta.offsets.back() == static_cast<int>(meta.corners.size()), "all corners are used");
  for (std::size_t p = 0; p < n; ++p) {
    const int corners = meta.offsets[p + 1] - meta.offsets[p];
    require(corners >= 3 && corners <= 6, "polygons have 3 to 6 corners");
    require_range(meta.face_a[p], meta.a->triangles.rows(), "face_a");
    require_range(meta.face_b[p], meta.b->triangles.rows(), "face_b");
  }
  for (const int v : meta.corners) require_range(v, meta.plane.rows(), "a corner");
  require(meta.on_a.rows() == meta.plane.rows() && meta.on_b.rows() == meta.plane.rows(),
          "a row for each vertex");
  require(meta.on_a.allFinite() && meta.on_b.allFinite() && meta.plane.allFinite(),
          "vertices of the meta mesh are finite");
  require(meta.corner_a.allFinite() && meta.corner_b.allFinite(), "corners are finite");
}

inline void require_transfer(const ism::Transfer& t) {
  require(t.sources.size() == t.weights.size(), "a weight for each source");
  for (const int s : t.sources) require_range(s, t.n_sources, "a source");
  for (int i = 0; i < t.rows(); ++i) {
    const std::size_t row = static_cast<std::size_t>(i);
    double sum = 0;
    for (int k = t.offsets[row]; k < t.offsets[row + 1]; ++k)
      sum += t.weights[static_cast<std::size_t>(k)];
    require(!t.covers(i) || std::abs(sum - 1) < 1e-6, "weights add up to 1");
  }
}

inline void require_images(const ism::SurfaceMap& map) {
  for (const ism::SurfacePoint& m : map.forward_vertices())
    if (m.exists()) require_point(map.mesh(ism::Side::kB), m);
  for (const ism::SurfacePoint& m : map.backward_vertices())
    if (m.exists()) require_point(map.mesh(ism::Side::kA), m);
}

/// No triangle is a sliver of which rounding leaves nothing.
template <class Points>
bool well_shaped(const Points& points, const ism::Triangles& triangles) {
  for (int f = 0; f < triangles.rows(); ++f) {
    const auto p = points.row(triangles(f, 0)).eval();
    const auto u = (points.row(triangles(f, 1)) - p).eval();
    const auto v = (points.row(triangles(f, 2)) - p).eval();
    const double size = (std::max)(u.stableNorm(), v.stableNorm());
    const auto x = (u / size).eval(), y = (v / size).eval();
    const double gram = x.squaredNorm() * y.squaredNorm() - x.dot(y) * x.dot(y);
    if (!(gram > 1e-8)) return false;
  }
  return true;
}

/// Sizes for which Options::keep_scale promises to work.
inline bool of_fair_size(const ism::TriangleMesh& mesh) {
  const double size = (mesh.vertices.rowwise() - mesh.vertices.row(0)).cwiseAbs().maxCoeff();
  return size > 1e-50 && size < 1e50;
}

inline void require_distortion(const ism::SurfaceMap& map, bool keep_scale) {
  const std::vector<ism::PolygonDistortion> polygons = map.distortion(keep_scale);
  for (const ism::PolygonDistortion& d : polygons) {
    require(!std::isnan(d.density) && !std::isnan(d.sigma_max) && !std::isnan(d.sigma_min),
            "distortions are numbers");
    require(d.area_a >= 0 && d.area_b >= 0, "areas are not negative");
  }
  require(!std::isnan(ism::summarize(polygons).mean), "the mean distortion is a number");
}

inline ism::SurfacePoint odd_point(Bytes& bytes, int faces) {
  ism::SurfacePoint p;
  p.face = bytes.id(faces);
  if (bytes.flag())
    p.barycentric = {bytes.number(), bytes.number(), bytes.number()};
  else
    p.barycentric = {0.5, 0.25, 0.25};
  return p;
}

/// Questions that have no answer, or that only just have one.
inline void ask(const ism::SurfaceMap& map, Bytes& bytes) {
  const ism::TriangleMesh &a = map.mesh(ism::Side::kA), &b = map.mesh(ism::Side::kB);
  const int faces_a = static_cast<int>(a.triangles.rows()),
            vertices_a = static_cast<int>(a.vertices.rows());
  const int faces_b = static_cast<int>(b.triangles.rows()),
            vertices_b = static_cast<int>(b.vertices.rows());
  std::vector<int> path_a, path_b;
  for (int i = bytes.below(12); i > 0; --i) {
    path_a.push_back(bytes.id(vertices_a));
    path_b.push_back(bytes.id(vertices_b));
    map.forward_vertex(path_a.back()), map.backward_vertex(path_b.back());
    map.position_on_b(map.forward(odd_point(bytes, faces_a)));
    map.position_on_a(map.backward(odd_point(bytes, faces_b)));
  }
  for (const ism::Polyline& line : map.forward_path(path_a))
    for (const ism::SurfacePoint& p : line) require_range(p.face, faces_b, "the face of a path");
  for (const ism::Polyline& line : map.backward_path(path_b))
    for (const ism::SurfacePoint& p : line) require_range(p.face, faces_a, "the face of a path");
}

inline void require_distortion(const ism::SurfaceMap& map, const ism::Points2& f,
                               const ism::Points2& g) {
  const ism::TriangleMesh& a = map.mesh(ism::Side::kA, ism::Ids::kEmbedded);
  const ism::TriangleMesh& b = map.mesh(ism::Side::kB, ism::Ids::kEmbedded);
  if (!well_shaped(f, a.triangles) || !well_shaped(g, b.triangles)) return;
  if (!well_shaped(a.vertices, a.triangles) || !well_shaped(b.vertices, b.triangles)) return;
  require_distortion(map, false);
  if (of_fair_size(a) && of_fair_size(b)) require_distortion(map, true);
}

/// Of a map that can be used, by the embeddings f and g.
inline void require_map(const ism::SurfaceMap& map, const ism::Points2& f, const ism::Points2& g,
                        Bytes& bytes) {
  require_images(map);
  require_distortion(map, f, g);
  const ism::MetaMesh meta = map.meta_mesh();
  require_meta_mesh(meta);
  require_meta_mesh(map.meta_mesh(ism::Ids::kEmbedded));
  using ism::Element;
  for (const ism::Side side : {ism::Side::kA, ism::Side::kB}) {
    ism::remesh(map, side);
    require_transfer(ism::to_meta(meta, side, Element::kCorner));
    require_transfer(ism::transfer(meta, side, Element::kVertex, Element::kVertex));
    require_transfer(ism::transfer(meta, side, Element::kFace, Element::kCorner));
  }
  require(ism::linear_morph(meta, 0.5).allFinite(), "a morph is finite");
  ask(map, bytes);
}

}  // namespace fuzz

#endif  // ISM_TESTS_FUZZ_HPP

// Small triangulated disks for the tests: each as a surface and as an injective planar embedding.

#ifndef ISM_TESTS_SHAPES_HPP
#define ISM_TESTS_SHAPES_HPP

#include "ism.hpp"

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace shapes {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using ism::Points2;
using ism::Points3;
using ism::Triangles;

constexpr double kPi = 3.14159265358979323846;

/// splitmix64: the same numbers on every platform.
class Rng {
 public:
  explicit Rng(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ull);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
  }
  int below(int n) { return static_cast<int>(next() % static_cast<std::uint64_t>(n)); }
  int between(int lo, int hi) { return lo + below(hi - lo + 1); }           // both included
  double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }  // [0, 1)
  double uniform(double lo, double hi) { return lo + (hi - lo) * uniform(); }
  Vector2d point(double size) {
    const double x = uniform(-size, size);
    return Vector2d(x, uniform(-size, size));
  }

 private:
  std::uint64_t state_;
};

#ifdef ISM_IMPLEMENTATION
inline ism::detail::HalfEdgeMesh half_edges(const ism::TriangleMesh& mesh) {
  return ism::detail::build_half_edges(static_cast<int>(mesh.vertices.rows()), mesh.triangles);
}

/// Two surfaces as one.
inline ism::detail::JointSurface joined(const ism::TriangleMesh& a, const ism::TriangleMesh& b,
                                        bool keep_scale = true) {
  return ism::detail::join(
      {ism::detail::build_surface(a, keep_scale), ism::detail::build_surface(b, keep_scale)});
}

// The header's small types as Eigen's, and the other way round.
inline Vector2d eigen(ism::detail::Vec2 p) { return {p.x, p.y}; }
inline Eigen::Vector3d eigen(const ism::detail::Vec3& p) { return {p.x, p.y, p.z}; }
inline Matrix2d eigen(const ism::detail::Mat2& M) { return Eigen::Map<const Matrix2d>(M.entry); }
inline ism::detail::Vec2 to_vec2(const Vector2d& p) { return {p.x(), p.y()}; }
inline ism::detail::Vec3 to_vec3(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }
inline ism::detail::Mat2 to_mat2(const Matrix2d& M) {
  return {{M(0, 0), M(1, 0), M(0, 1), M(1, 1)}};
}
#endif

// What a result speaks of.
using Ids = std::vector<ism::ElementId>;
inline ism::ElementId of_a(int v) { return {ism::Side::kA, ism::Element::kVertex, v}; }
inline ism::ElementId of_b(int v) { return {ism::Side::kB, ism::Element::kVertex, v}; }

/// A disk and one injective embedding of it; row i of plane belongs to row i of mesh.vertices.
struct Disk {
  ism::TriangleMesh mesh;
  Points2 plane;
  std::string name = {};
};

/// Options that start from the planes of two disks as they are.
inline ism::Options from_planes(const Disk& a, const Disk& b) {
  ism::Options options;
  options.initial_f = a.plane;
  options.initial_g = b.plane;
  options.keep_scale = true;
  return options;
}

/// Collects vertices and triangles of a planar disk.
class DiskBuilder {
 public:
  int vertex(double x, double y) {
    points_.push_back(Vector2d(x, y));
    return static_cast<int>(points_.size()) - 1;
  }
  void triangle(int i, int j, int k) { triangles_.push_back({i, j, k}); }
  void quad(int i, int j, int k, int l) { triangle(i, j, k), triangle(i, k, l); }

  Disk build() const {
    Disk disk;
    disk.plane.resize(static_cast<int>(points_.size()), 2);
    disk.mesh.triangles.resize(static_cast<int>(triangles_.size()), 3);
    int row = 0;
    for (const Vector2d& p : points_) disk.plane.row(row++) = p.transpose();
    row = 0;
    for (const auto& t : triangles_) disk.mesh.triangles.row(row++) << t[0], t[1], t[2];
    disk.mesh.vertices = Points3::Zero(disk.plane.rows(), 3);
    disk.mesh.vertices.leftCols<2>() = disk.plane;
    return disk;
  }

 private:
  std::vector<Vector2d> points_;
  std::vector<std::array<int, 3>> triangles_;
};

inline Disk triangle(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  DiskBuilder builder;
  for (const Vector2d& p : {a, b, c}) builder.vertex(p.x(), p.y());
  builder.triangle(0, 1, 2);
  return builder.build();
}

inline Disk single_triangle() { return triangle({0, 0}, {1, 0}, {0, 1}); }

/// The unit cells (i, j) of an nx×ny grid with keep(i, j), on integer positions; the cells kept
/// must form a disk.
template <class Keep>
Disk cells(int nx, int ny, Keep keep) {
  DiskBuilder builder;
  std::vector<int> id(static_cast<std::size_t>((nx + 1) * (ny + 1)), -1);
  const auto corner = [&](int i, int j) {
    int& v = id[static_cast<std::size_t>(j * (nx + 1) + i)];
    if (v < 0) v = builder.vertex(i, j);
    return v;
  };
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i)
      if (keep(i, j)) {  // named first: vertices are numbered as they are asked for
        const int d = corner(i, j + 1), c = corner(i + 1, j + 1);
        const int b = corner(i + 1, j), a = corner(i, j);
        builder.quad(a, b, c, d);
      }
  return builder.build();
}

inline Disk grid(int nx, int ny) {
  return cells(nx, ny, [](int, int) { return true; });
}

inline Disk strip(int n) { return grid(n, 1); }

/// A grid of n × n cells of which only those within `width` of the boundary are there: a surface
/// with an opening.
inline Disk frame(int n, int width) {
  return cells(n, n, [=](int i, int j) {
    return (std::min)({i, j, n - 1 - i, n - 1 - j}) < width;
  });
}

/// A bottom row of cells with teeth of the given length on every other cell.
inline Disk comb(int teeth, int length) {
  return cells(2 * teeth - 1, length + 1, [](int i, int j) { return j == 0 || i % 2 == 0; });
}

/// A grid with its interior vertices moved at random by at most `amount` < 0.25 of a cell.
inline Disk perturbed_grid(int nx, int ny, double amount, Rng& rng) {
  Disk disk = grid(nx, ny);
  for (int v = 0; v < disk.plane.rows(); ++v) {
    const double x = disk.plane(v, 0), y = disk.plane(v, 1);
    if (x > 0 && x < nx && y > 0 && y < ny) disk.plane.row(v) += rng.point(amount).transpose();
  }
  disk.mesh.vertices.leftCols<2>() = disk.plane;
  return disk;
}

/// A regular n-gon around an interior vertex 0.
inline Disk fan(int n) {
  DiskBuilder builder;
  builder.vertex(0, 0);
  for (int i = 0; i < n; ++i) builder.vertex(std::cos(2 * kPi * i / n), std::sin(2 * kPi * i / n));
  for (int i = 0; i < n; ++i) builder.triangle(0, 1 + i, 1 + (i + 1) % n);
  return builder.build();
}

/// Several arms of `length` thin quads around a centre.
inline Disk limbs(int arms, int length, double width) {
  DiskBuilder builder;
  const int centre = builder.vertex(0, 0);
  std::vector<int> ring;
  for (int i = 0; i < arms; ++i) {
    const Vector2d along(std::cos(2 * kPi * i / arms), std::sin(2 * kPi * i / arms));
    const Vector2d across(-along.y(), along.x());
    int right = -1, left = -1;
    for (int k = 0; k <= length; ++k) {
      const Vector2d p = (1 + 0.5 * k) * along - width * across, q = p + 2 * width * across;
      const int r = builder.vertex(p.x(), p.y()), l = builder.vertex(q.x(), q.y());
      if (k == 0)
        ring.push_back(r), ring.push_back(l);
      else
        builder.quad(right, r, l, left);
      right = r, left = l;
    }
  }
  for (std::size_t i = 0; i < ring.size(); ++i)
    builder.triangle(centre, ring[i], ring[(i + 1) % ring.size()]);
  return builder.build();
}

/// The part of the unit sphere within `angle` of the pole, embedded by distance and direction.
inline Disk spherical_cap(int rings, int sectors, double angle) {
  DiskBuilder builder;
  builder.vertex(0, 0);
  const auto id = [&](int r, int s) { return 1 + (r - 1) * sectors + s % sectors; };
  for (int r = 1; r <= rings; ++r)
    for (int s = 0; s < sectors; ++s) {
      const double phi = 2 * kPi * s / sectors, rho = angle * r / rings;
      builder.vertex(rho * std::cos(phi), rho * std::sin(phi));
    }
  for (int s = 0; s < sectors; ++s) builder.triangle(0, id(1, s), id(1, s + 1));
  for (int r = 1; r < rings; ++r)
    for (int s = 0; s < sectors; ++s)
      builder.quad(id(r, s), id(r + 1, s), id(r + 1, s + 1), id(r, s + 1));
  Disk disk = builder.build();
  for (int v = 0; v < disk.plane.rows(); ++v) {
    const double rho = disk.plane.row(v).norm();
    const double stretch = rho > 0 ? std::sin(rho) / rho : 1;
    disk.mesh.vertices.row(v) << stretch * disk.plane.row(v), std::cos(rho);
  }
  return disk;
}

inline ism::TriangleMesh tetrahedron() {
  ism::TriangleMesh mesh = {ism::Points3(4, 3), ism::Triangles(4, 3)};
  mesh.vertices << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1;
  mesh.triangles << 0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3;
  return mesh;
}

/// An octahedron, of which every triangle is cut in four some times, on the unit sphere.
inline ism::TriangleMesh sphere(int times) {
  ism::TriangleMesh mesh = {ism::Points3(6, 3), ism::Triangles(8, 3)};
  mesh.vertices << 1, 0, 0, 0, 1, 0, 0, 0, 1, -1, 0, 0, 0, -1, 0, 0, 0, -1;
  mesh.triangles << 0, 1, 2, 1, 3, 2, 3, 4, 2, 4, 0, 2, 1, 0, 5, 3, 1, 5, 4, 3, 5, 0, 4, 5;
  for (; times > 0; --times) {
    const Eigen::Index n = mesh.vertices.rows(), m = mesh.triangles.rows();
    ism::Points3 vertices(n + 3 * m / 2, 3);
    ism::Triangles triangles(4 * m, 3);
    vertices.topRows(n) = mesh.vertices;
    std::map<std::pair<int, int>, int> middle;
    for (int f = 0; f < m; ++f) {
      int corner[3], half[3];
      for (int k = 0; k < 3; ++k) {
        const int u = corner[k] = mesh.triangles(f, k), v = mesh.triangles(f, (k + 1) % 3);
        const int next = static_cast<int>(n) + static_cast<int>(middle.size());
        half[k] = middle.insert({{std::min(u, v), std::max(u, v)}, next}).first->second;
        vertices.row(half[k]) = (vertices.row(u) + vertices.row(v)).normalized();
      }
      triangles.row(4 * f) << corner[0], half[0], half[2];
      triangles.row(4 * f + 1) << half[0], corner[1], half[1];
      triangles.row(4 * f + 2) << half[2], half[1], corner[2];
      triangles.row(4 * f + 3) << half[0], half[1], half[2];
    }
    mesh = {vertices, triangles};
  }
  return mesh;
}

/// A sphere with bumps, turned: all points of the unit sphere go to others, without folds.
inline ism::TriangleMesh blob(int times, double bumps, std::uint64_t seed) {
  Rng rng(seed);
  ism::TriangleMesh mesh = sphere(times);
  const double a = rng.uniform(1, 3), b = rng.uniform(1, 3), c = rng.uniform(0, 6);
  for (int v = 0; v < mesh.vertices.rows(); ++v) {
    const Eigen::Vector3d p = mesh.vertices.row(v);
    const double bump = std::sin(a * p.x() + c) * std::cos(b * p.y() + c) + 0.5 * p.z();
    mesh.vertices.row(v) = ((1 + bumps * bump) * p).transpose();
  }
  return mesh;
}

/// A ring 1 ≤ r ≤ 2 of n × 3 quads, slit along the x axis. Its ends are `gap` apart (radians) in
/// the plane; the surface is a ramp that turns by `angle`.
inline Disk slit_ring(int n, double gap, double angle) {
  Disk disk = grid(n, 3);
  for (int v = 0; v < disk.plane.rows(); ++v) {
    const double s = disk.plane(v, 0) / n, r = 2 - disk.plane(v, 1) / 3;
    const double phi = s * (2 * kPi - gap);
    disk.mesh.vertices.row(v) << r * std::cos(s * angle), r * std::sin(s * angle), 0.15 * s;
    disk.plane.row(v) << r * std::cos(phi), r * std::sin(phi);
  }
  return disk;
}

inline double turn(const Points2& x, int i, int j, int k) {
  const Vector2d u = (x.row(j) - x.row(i)).transpose(), v = (x.row(k) - x.row(i)).transpose();
  return u.x() * v.y() - u.y() * v.x();
}

/// Puts a new vertex into a random triangle, at random barycentric coordinates of at least 0.15.
inline void split_random_triangle(Disk& disk, Rng& rng) {
  Triangles& F = disk.mesh.triangles;
  const int f = rng.below(static_cast<int>(F.rows())), v = static_cast<int>(disk.plane.rows());
  const double s = rng.uniform(0.15, 0.5), t = rng.uniform(0.15, 0.35);
  const int i = F(f, 0), j = F(f, 1), k = F(f, 2), n = static_cast<int>(F.rows());
  disk.plane.conservativeResize(v + 1, Eigen::NoChange);
  disk.plane.row(v) =
      (1 - s - t) * disk.plane.row(i) + s * disk.plane.row(j) + t * disk.plane.row(k);
  F.conservativeResize(n + 2, Eigen::NoChange);
  F.row(f) << i, j, v;
  F.row(n) << j, k, v;
  F.row(n + 1) << k, i, v;
}

/// Swaps a random edge for the other diagonal of its quad if that leaves positive triangles.
inline void flip_random_edge(Disk& disk, Rng& rng) {
  Triangles& F = disk.mesh.triangles;
  const int f = rng.below(static_cast<int>(F.rows())), k = rng.below(3);
  const int u = F(f, k), v = F(f, (k + 1) % 3), w = F(f, (k + 2) % 3);
  for (int g = 0; g < F.rows(); ++g)
    for (int l = 0; l < 3; ++l) {
      if (F(g, l) != v || F(g, (l + 1) % 3) != u) continue;
      const int o = F(g, (l + 2) % 3);
      if (turn(disk.plane, w, u, o) < 1e-3 || turn(disk.plane, w, o, v) < 1e-3) return;
      F.row(f) << w, u, o;
      F.row(g) << w, o, v;
      return;
    }
}

/// A perturbed grid with further vertices in random triangles and randomly flipped edges: its
/// triangles are neither regular nor Delaunay.
inline Disk random_disk(int nx, int ny, Rng& rng) {
  Disk disk = perturbed_grid(nx, ny, 0.2, rng);
  for (int i = 0; i < nx * ny / 2; ++i) split_random_triangle(disk, rng);
  for (int i = 0; i < 4 * nx * ny; ++i) flip_random_edge(disk, rng);
  disk.mesh.vertices = Points3::Zero(disk.plane.rows(), 3);
  disk.mesh.vertices.leftCols<2>() = disk.plane;
  return disk;
}

/// A grid with some cells left out, apart from each other and from the boundary, and its vertices
/// moved a little: a surface with openings.
inline Disk with_openings(int nx, int ny, Rng& rng) {
  std::vector<char> is_open(static_cast<std::size_t>(nx * ny), 0);
  for (int j = 1; j + 1 < ny; j += 2)
    for (int i = 1; i + 1 < nx; i += 2)
      is_open[static_cast<std::size_t>(j * nx + i)] = rng.below(3) > 0;
  Disk disk = cells(
      nx, ny, [&](int i, int j) { return is_open[static_cast<std::size_t>(j * nx + i)] == 0; });
  for (int v = 0; v < disk.plane.rows(); ++v) disk.plane.row(v) += rng.point(0.2).transpose();
  disk.mesh.vertices.leftCols<2>() = disk.plane;
  return disk;
}

/// Bends the surface out of the plane, so that it is no longer isometric to its embedding.
inline void bend(Disk& disk, double height) {
  for (int v = 0; v < disk.plane.rows(); ++v)
    disk.mesh.vertices(v, 2) = height * std::sin(disk.plane(v, 0) + 0.7 * disk.plane(v, 1));
}

/// M x + t for every row x.
inline Points2 moved(const Points2& x, const Matrix2d& M, const Vector2d& t) {
  return (x * M.transpose()).rowwise() + t.transpose();
}

inline Matrix2d rotation(double angle) {
  Matrix2d R;
  R << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  return R;
}

/// Two bent random disks, the second one turned and shifted; they overlap partially, in a disk.
inline std::pair<Disk, Disk> overlapping_pair(std::uint64_t seed) {
  Rng rng(seed);
  Disk a = random_disk(5, 5, rng), b = random_disk(6, 4, rng);
  bend(a, 0.5);
  bend(b, -0.3);
  b.plane = moved(b.plane, rotation(0.35), Vector2d(0.83, -0.37));
  return {a, b};
}

inline ism::SurfaceMap map_of(const Disk& a, const Disk& b) {
  return ism::SurfaceMap(a.mesh, b.mesh, a.plane, b.plane);
}

/// Where a point of a disk lies in its plane.
inline Vector2d planar(const Disk& disk, const ism::SurfacePoint& p) {
  Vector2d x = Vector2d::Zero();
  for (int k = 0; k < 3; ++k)
    x += p.barycentric[k] * disk.plane.row(disk.mesh.triangles(p.face, k)).transpose();
  return x;
}

/// One of each, all valid and all embedded injectively.
inline std::vector<Disk> all_disks() {
  Rng rng(7);
  std::vector<Disk> all;
  const auto add = [&](const char* name, const Disk& disk) {
    all.push_back(disk);
    all.back().name = name;
  };
  add("triangle", single_triangle());
  add("strip", strip(9));
  add("grid", grid(6, 4));
  add("comb", comb(4, 3));
  add("fan", fan(7));
  add("limbs", limbs(5, 12, 0.05));
  add("cap", spherical_cap(5, 11, 1.2));
  add("perturbed grid", perturbed_grid(6, 5, 0.2, rng));
  add("random disk", random_disk(6, 5, rng));
  add("bent random disk", random_disk(5, 6, rng));
  bend(all.back(), 0.4);
  return all;
}

}  // namespace shapes

#endif  // ISM_TESTS_SHAPES_HPP

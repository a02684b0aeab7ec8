// Pairs of surfaces of any size with hubs, vertices of thousands of edges, or long boundaries: for
// the tests and for tests/bench.

#ifndef ISM_TESTS_LARGE_HPP
#define ISM_TESTS_LARGE_HPP

#include "ism.hpp"
#include "shapes.hpp"

#include <cmath>
#include <vector>

namespace large {

using shapes::Disk;
using shapes::kPi;

/// n triangles around one vertex, the rim bent up and down some times.
inline ism::TriangleMesh bent_fan(int n, int waves, double height) {
  Disk disk = shapes::fan(n);
  for (int v = 1; v <= n; ++v)
    disk.mesh.vertices(v, 2) = height * std::cos(2 * kPi * waves * (v - 1) / n);
  return disk.mesh;
}

/// A closed surface of 2 n triangles, half of them around either of two vertices.
inline ism::TriangleMesh bipyramid(int n, int waves, double height) {
  ism::TriangleMesh mesh = {ism::Points3(n + 2, 3), ism::Triangles(2 * n, 3)};
  for (int i = 0; i < n; ++i) {
    const double angle = 2 * kPi * i / n, radius = 1 + 0.2 * std::cos(waves * angle);
    mesh.vertices.row(i) << radius * std::cos(angle), radius * std::sin(angle), 0;
    mesh.triangles.row(2 * i) << i, (i + 1) % n, n;
    mesh.triangles.row(2 * i + 1) << (i + 1) % n, i, n + 1;
  }
  mesh.vertices.row(n) << 0, 0, height;
  mesh.vertices.row(n + 1) << 0, 0, -1;
  return mesh;
}

/// A strip of n squares along a part of a circle.
inline ism::TriangleMesh slit_ring(int n, double angle) {
  Disk disk = shapes::strip(n);
  const double width = angle / n;
  for (int v = 0; v < disk.plane.rows(); ++v) {
    const double phi = angle * disk.plane(v, 0) / n, r = 1 - width * disk.plane(v, 1);
    disk.mesh.vertices.row(v) << r * std::cos(phi), r * std::sin(phi), 0.1 * phi;
  }
  return disk.mesh;
}

/// A square with m teeth of length × 1 squares on one side, bent a little.
inline ism::TriangleMesh bent_comb(int teeth, int length, double height) {
  Disk disk = shapes::comb(teeth, length);
  shapes::bend(disk, height);
  return disk.mesh;
}

/// A plate with nx × ny openings.
inline Disk grate(int nx, int ny) {
  return shapes::cells(2 * nx + 1, 2 * ny + 1,
                       [](int i, int j) { return i % 2 == 0 || j % 2 == 0; });
}

/// The part of a sphere, a pole of which has n edges.
inline ism::TriangleMesh cap(int n, double angle) {
  return shapes::spherical_cap(6, n, angle).mesh;
}

/// No pair has a hub over another one, where all their edges cross.
struct Pair {
  ism::TriangleMesh a, b;
};

inline Pair fan_and_grid(int n) {
  Disk grid = shapes::grid(12, 12);
  shapes::bend(grid, 0.5);
  return {bent_fan(n, 2, 0.2), grid.mesh};
}
inline Pair bipyramid_and_sphere(int n) { return {bipyramid(n, 2, 1.2), shapes::sphere(3)}; }
inline Pair cap_and_grid(int n) {
  Disk grid = shapes::grid(12, 12);
  shapes::bend(grid, 0.5);
  return {cap(n, 1.2), grid.mesh};
}
inline Pair rings(int n) { return {slit_ring(n, 5.5), slit_ring(n, 5)}; }
inline Pair combs(int n) { return {bent_comb(n, 4, 0.2), bent_comb(n, 5, 0.2)}; }

}  // namespace large

#endif

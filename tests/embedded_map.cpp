// The header as an engine would build it: without exceptions, RTTI and threads, and in more than
// one file of a program. This file has the implementation, embedded_main.cpp the API only. They are
// the program of test_consumers.sh, too.

#define ISM_IMPLEMENTATION
#include "ism.hpp"

ism::TriangleMesh bent_square(double height) {
  ism::TriangleMesh mesh;
  mesh.vertices.resize(5, 3);
  mesh.vertices << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0.5, 0.5, height;
  mesh.triangles.resize(4, 3);
  mesh.triangles << 0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4;
  return mesh;
}

ism::Result map_squares() {
  return ism::compute_map(bent_square(0), bent_square(0.3), {{0, 0}, {2, 2}});
}

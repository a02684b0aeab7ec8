// A program that uses the library: all consumers in the folders here, and test_embedded. ism.cpp
// has the implementation, where ism::ism does not bring it.

#include "ism.hpp"

static ism::TriangleMesh bent_square(double height) {
  ism::TriangleMesh mesh;
  mesh.vertices.resize(5, 3);
  mesh.vertices << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0.5, 0.5, height;
  mesh.triangles.resize(4, 3);
  mesh.triangles << 0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4;
  return mesh;
}

int main() {
  const ism::TriangleMesh a = bent_square(0), b = bent_square(0.3);
  const ism::Result result = ism::compute_map(a, b, {{0, 0}, {2, 2}});
  if (!ism::is_usable(result.status)) return 1;
  const ism::SurfaceMap map(a, b, result.f, result.g);
  if (!map.forward_vertex(4).covered) return 2;
  return ism::verify(map).status == ism::Status::kDone ? 0 : 3;
}

// See embedded_map.cpp.

#include "ism.hpp"

ism::TriangleMesh bent_square(double height);
ism::Result map_squares();

int main() {
  const ism::Result result = map_squares();
  if (!ism::is_usable(result.status)) return 1;
  const ism::SurfaceMap map(bent_square(0), bent_square(0.3), result.f, result.g);
  return map.forward_vertex(4).covered ? 0 : 2;
}

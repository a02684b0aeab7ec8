// A program that uses the library: all consumers in the folders here, and test_embedded. ism.cpp
// has the implementation, where ism::ism does not bring it.

#include "ism.hpp"

#include <cmath>
#include <cstddef>
#include <cstdint>

static ism::TriangleMesh bent_square(double height) {
  ism::TriangleMesh mesh;
  mesh.vertices.resize(5, 3);
  mesh.vertices << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0.5, 0.5, height;
  mesh.triangles.resize(4, 3);
  mesh.triangles << 0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4;
  return mesh;
}

/// True if what all vertices of A have is carried to those of B, whatever type it has.
template <class T>
static bool is_carried(const ism::Transfer& transfer) {
  const T given[5] = {T(7), T(7), T(7), T(7), T(7)};
  T carried[5] = {};
  return transfer.apply(given, 5, sizeof(T), 1, carried, 5, sizeof(T)) &&
         std::abs(static_cast<double>(carried[4]) - 7) < 1e-6;
}

template <class... T>
static bool all_are_carried(const ism::Transfer& transfer) {
  return (is_carried<T>(transfer) && ...);
}

int main() {
  const ism::TriangleMesh a = bent_square(0), b = bent_square(0.3);
  const ism::Result result = ism::compute_map(a, b, {{0, 0}, {2, 2}});
  if (!ism::is_usable(result.status)) return 1;
  const ism::SurfaceMap map(a, b, result.f, result.g);
  if (!map.forward_vertex(4).exists()) return 2;
  const ism::Transfer transfer =
      ism::transfer(map.meta_mesh(), ism::Side::kA, ism::Element::kVertex, ism::Element::kVertex);
  if (!all_are_carried<double, float, std::int8_t, std::uint8_t, std::int16_t, std::uint16_t,
                       std::int32_t, std::uint32_t, std::int64_t, std::uint64_t>(transfer))
    return 3;
  const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::size_t ids[] = {0, 1, 2};
  if (!ism::validate({{corners, 3}, {ids, 1}}).empty()) return 4;
  return 0;
}

// Fuzz target: two embedded planar meshes become a map. On integers, where all is known exactly,
// the overlap must have the right area and cover the right vertices; with positions spoilt,
// whatever is accepted must be a map.

#include "fuzz.hpp"

namespace {

using fuzz::Bytes;
using fuzz::Lattice;
using ism::Points2;
using ism::SurfaceMap;

struct Input {
  Lattice lattice_a, lattice_b;
  ism::TriangleMesh a, b;
  Points2 f, g;
  bool exact = true;  // f and g are the lattices
};

/// The positions of another vertex, one next to what it was, or any.
void spoil(Bytes& bytes, Points2& f, const Points2& g) {
  const Eigen::Index v = bytes.below(static_cast<int>(f.rows())), k = bytes.below(2);
  const Eigen::Index w = bytes.below(static_cast<int>(g.rows()));
  switch (bytes.below(4)) {
    case 0:
      f.row(v) = g.row(w);
      break;
    case 1:
      f(v, k) = std::nextafter(f(v, k), bytes.flag() ? 1e300 : -1e300);
      break;
    case 2:
      f(v, k) += 1e-9 * (bytes.byte() - 128);
      break;
    default:
      f(v, k) = bytes.number();
  }
}

double odd_scale(Bytes& bytes) {
  static const double kScales[] = {1, 1, 1.0 / 3, 1e-3, 1e6, 1e-40, 1e40, 1e-160, 1e160, 1e300};
  return kScales[bytes.below(10)];
}

Input read(Bytes& bytes) {
  Input in;
  const int kind = bytes.below(4);
  const int steps = bytes.below(40);
  in.lattice_a.grow(bytes, steps);
  in.lattice_b.grow(bytes, steps);
  in.lattice_b.move(bytes.between(-8, 8), bytes.between(-8, 8));
  in.a = fuzz::lifted(in.lattice_a, bytes);
  in.b = fuzz::lifted(in.lattice_b, bytes);
  in.f = fuzz::plane_of(in.lattice_a), in.g = fuzz::plane_of(in.lattice_b);
  in.exact = kind < 2;
  if (kind == 2) {
    const double scale = odd_scale(bytes);
    in.f *= scale, in.g *= scale;
    in.a.vertices *= odd_scale(bytes), in.b.vertices *= odd_scale(bytes);
  }
  for (int i = in.exact ? 0 : bytes.below(6); i > 0; --i)
    bytes.flag() ? spoil(bytes, in.f, in.g) : spoil(bytes, in.g, in.f);
  return in;
}

// ---- The overlap by other means
// ------------------------------------------------------------------

using Polygon = std::vector<Eigen::Vector2d>;

double signed_area(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return 0.5 * ((b - a).x() * (c - a).y() - (b - a).y() * (c - a).x());
}

/// What is left of a convex polygon on the left of the line from u to v.
Polygon clipped(const Polygon& polygon, const Eigen::Vector2d& u, const Eigen::Vector2d& v) {
  Polygon left;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d &p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
    const double s = signed_area(u, v, p), t = signed_area(u, v, q);
    if (s >= 0) left.push_back(p);
    if ((s > 0 && t < 0) || (s < 0 && t > 0)) left.push_back(p + (q - p) * (s / (s - t)));
  }
  return left;
}

double area(const Polygon& p) {
  double sum = 0;
  for (std::size_t i = 2; i < p.size(); ++i) sum += signed_area(p[0], p[i - 1], p[i]);
  return sum;
}

double common_area(const fuzz::Corners& s, const fuzz::Corners& t) {
  Polygon p(s.begin(), s.end());
  for (std::size_t k = 0; k < 3; ++k) p = clipped(p, t[k], t[(k + 1) % 3]);
  return area(p);
}

double common_area(const Input& in) {
  double sum = 0;
  for (int i = 0; i < in.a.triangles.rows(); ++i)
    for (int j = 0; j < in.b.triangles.rows(); ++j)
      sum += common_area(fuzz::corners_of(in.a.triangles, in.f, i),
                         fuzz::corners_of(in.b.triangles, in.g, j));
  return sum;
}

double area(const ism::MetaMesh& meta) {
  double sum = 0;
  for (std::size_t i = 0; i < meta.face_a.size(); ++i) {
    Polygon p;
    for (int c = meta.offsets[i]; c < meta.offsets[i + 1]; ++c)
      p.push_back(meta.plane.row(meta.corners[static_cast<std::size_t>(c)]));
    sum += area(p);
  }
  return sum;
}

/// 1: inside a triangle, -1: outside all of them, 0: on a side.
int place(const fuzz::IntPoint& p, const Lattice& lattice) {
  int result = -1;
  for (const fuzz::IntTriangle& t : lattice.triangles) {
    int least = 1;
    for (std::size_t k = 0; k < 3; ++k)
      least = (std::min)(least,
                         fuzz::turn(lattice.points[static_cast<std::size_t>(t[k])],
                                    lattice.points[static_cast<std::size_t>(t[(k + 1) % 3])], p));
    result = (std::max)(result, least);
  }
  return result;
}

void require_covered(const Lattice& from, const Lattice& to,
                     const std::vector<ism::SurfacePoint>& images) {
  fuzz::require(images.size() == from.points.size(), "an image of each vertex");
  for (std::size_t v = 0; v < images.size(); ++v) {
    const int where = place(from.points[v], to);
    fuzz::require(where != 1 || images[v].exists(), "a vertex inside a triangle has an image");
    fuzz::require(where != -1 || !images[v].exists(), "a vertex outside has no image");
  }
}

void require_round_trip(const SurfaceMap& map) {
  const ism::Points3 &a = map.mesh(ism::Side::kA).vertices, &b = map.mesh(ism::Side::kB).vertices;
  for (int v = 0; v < a.rows(); ++v) {
    const ism::SurfacePoint there = map.forward_vertex(v), back = map.backward(there);
    if (!there.exists() || !back.exists()) continue;
    const Eigen::Vector3d p = a.row(v);
    fuzz::require((map.position_on_a(back) - p).norm() < 1e-6, "vertices of A come back");
  }
  for (int v = 0; v < b.rows(); ++v) {
    const ism::SurfacePoint there = map.backward_vertex(v), back = map.forward(there);
    if (!there.exists() || !back.exists()) continue;
    const Eigen::Vector3d p = b.row(v);
    fuzz::require((map.position_on_b(back) - p).norm() < 1e-6, "vertices of B come back");
  }
}

void require_exact(const Input& in, const SurfaceMap& map) {
  using ism::Status;
  const double expected = common_area(in);
  fuzz::require(map.status() == Status::kDone || map.status() == Status::kNoOverlap,
                "embeddings on integers are accepted: " + map.message());
  fuzz::require(map.status() == Status::kDone || expected < 1e-9, "an overlap is found");
  if (map.status() != Status::kDone) return;
  fuzz::require(std::abs(area(map.meta_mesh()) - expected) < 1e-6, "the overlap has its area");
  require_covered(in.lattice_a, in.lattice_b, map.forward_vertices());
  require_covered(in.lattice_b, in.lattice_a, map.backward_vertices());
  require_round_trip(map);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  const Input in = read(bytes);
  const SurfaceMap map(in.a, in.b, in.f, in.g);
  if (in.exact) require_exact(in, map);
  if (map.status() == ism::Status::kDone) {
    fuzz::require_injective(in.a.triangles, in.f);
    fuzz::require_injective(in.b.triangles, in.g);
    fuzz::require_map(map, in.f, in.g, bytes);
  } else {
    fuzz::require(!map.message().empty(), "a failure says why");
    fuzz::ask(map, bytes);
  }
  return 0;
}

// A short function for each of many features beyond the plain run, to copy from:
//
//   features A.obj B.obj landmarks.txt

#include "ism.hpp"
#include "mesh_io.hpp"
#include "morph.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace {

struct Pair {
  ism::TriangleMesh a, b;
  std::vector<ism::Landmark> landmarks;
  std::vector<std::array<int, 2>> edges_a;  // of the polygons of A
};

ism::Options some_iterations() {
  ism::Options options;
  options.max_iterations = 20;
  return options;
}

int fail(const std::string& message) {
  std::fprintf(stderr, "features: %s\n", message.c_str());
  return 1;
}

/// Prints how a run ended, on one line that the caller continues.
void print(const char* name, const ism::Result& r) {
  if (!ism::is_usable(r.status)) std::exit(fail(name + (": " + r.message)));
  const ism::IterationLog& last = r.final_state();
  std::printf("%-16s %s, distortion %.4f, coverage %.4f / %.4f", name, ism::to_string(r.status),
              last.mean_distortion, last.coverage_a, last.coverage_b);
}

/// Position constraints (§4.5): vertices of A stay on B where the start puts them.
void pin_vertices(const Pair& p) {
  ism::Options options = some_iterations();
  for (std::size_t i = 0; i < 3 && i < p.landmarks.size(); ++i)
    options.pins_a.push_back(p.landmarks[i].a.vertex);
  const ism::Result r = ism::compute_map(p.a, p.b, p.landmarks, options);
  print("pins", r);
  double residual = 0;
  for (const ism::IterationLog& it : r.log) residual = std::max(residual, it.pin_residual);
  std::printf(", residual %.1e\n", residual);
}

/// Landmarks that coincide in the plane to the last bit. Where the meshes are too coarse for it,
/// vertices are added: the positions are those of *r.start.a and *r.start.b.
void join_landmarks(const Pair& p) {
  ism::Options options = some_iterations();
  options.exact_landmarks = true;
  const ism::Result r = ism::compute_map(p.a, p.b, p.landmarks, options);
  print("exact landmarks", r);
  std::printf(", %zu and %zu vertices added\n", r.start.added_a.size(), r.start.added_b.size());
}

/// Landmarks as points in triangles: where a map takes some vertices.
void use_points(const Pair& p, const ism::SurfaceMap& map) {
  std::vector<ism::Landmark> landmarks;
  for (int v = 0; v < p.a.vertices.rows(); v += 1 + static_cast<int>(p.a.vertices.rows()) / 10) {
    const ism::SurfacePoint image = map.forward_vertex(v);
    if (image.exists()) landmarks.push_back({v, image});
  }
  const ism::Result r = ism::compute_map(p.a, p.b, landmarks, some_iterations());
  print("points", r);
  std::printf(", %.1e apart at the start\n", r.start.landmark_distance);
}

/// The whole of A on the whole of B (§7): boundaries along one square, on which they may slide.
void hold_boundaries(const Pair& p) {
  ism::Options options = some_iterations();
  for (const ism::Boundary boundary : {ism::Boundary::kFixed, ism::Boundary::kSlide}) {
    options.boundary = boundary;
    const ism::Result r = ism::compute_map(p.a, p.b, p.landmarks, options);
    print(boundary == ism::Boundary::kFixed ? "fixed boundary" : "sliding boundary", r);
    std::printf(", %zu and %zu vertices added\n", r.start.added_a.size(), r.start.added_b.size());
  }
}

/// Vertices at planar positions of one's own; all other positions come from an embedding.
void fix_vertices(const Pair& p) {
  ism::Options options = some_iterations();
  const ism::Embedding start = ism::initial_embedding(p.a, p.b, p.landmarks);
  options.initial_f = start.f;
  options.initial_g = start.g;
  options.fixed_a = {p.landmarks[0].a.vertex};
  options.fixed_b = {p.landmarks[0].b.vertex};
  print("fixed vertices", ism::compute_map(p.a, p.b, p.landmarks, options));
  std::printf("\n");
}

/// Other distortion measures (§3.2), and one of one's own: symmetric Dirichlet, S (1 + 1 / d³) over
/// B', with a half of ASAP, S - 2 d over A'. An area of 1 on A is d on B; so this is all over A'.
void choose_measure(const Pair& p) {
  const auto mixed = [](double S, double d) {
    const double i = 1 / d, i2 = i * i, i3 = i2 * i;
    ism::StretchDensity D = {};
    D.value = S * (d + i2) + 0.5 * S - d;
    D.S = d + i2 + 0.5;
    D.d = S * (1 - 2 * i3) - 1;
    D.Sd = 1 - 2 * i3;
    D.dd = 6 * S * i2 * i2;
    return D;
  };
  ism::Options options = some_iterations();
  options.measure = {mixed, 1, 0};
  print("a mixed measure", ism::compute_map(p.a, p.b, p.landmarks, options));
  std::printf("\n");
  options.measure = ism::arap();
  print("ARAP", ism::compute_map(p.a, p.b, p.landmarks, options));
  std::printf("\n");
}

/// Templates (§6.3): the edges of A's polygons as polylines on B.
void map_polygons(const Pair& p, const ism::SurfaceMap& map) {
  double length = 0;
  for (const std::array<int, 2>& edge : p.edges_a)
    for (const ism::Polyline& polyline : map.forward_path({edge[0], edge[1]}))
      for (std::size_t i = 1; i < polyline.size(); ++i)
        length += (map.position_on_b(polyline[i]) - map.position_on_b(polyline[i - 1])).norm();
  std::printf("%-16s edges of %.4g in all\n", "a template", length);
}

/// Attributes of A, here the positions of its vertices, at the vertices of B; and through the meta
/// mesh, where nothing is lost, back to A.
void carry_attributes(const Pair& p, const ism::SurfaceMap& map) {
  const ism::MetaMesh meta = map.meta_mesh();
  const ism::Transfer to_b =
      ism::transfer(meta, ism::Side::kA, ism::Element::kVertex, ism::Element::kVertex);
  const ism::Values on_b = to_b.apply(p.a.vertices);
  const ism::Values corners =
      ism::to_meta(meta, ism::Side::kA, ism::Element::kVertex).apply(p.a.vertices);
  const ism::Transfer to_a = ism::from_meta(meta, ism::Side::kA, ism::Element::kVertex);
  const ism::Values back = to_a.apply(corners);
  double error = 0;
  for (int v = 0; v < to_a.rows(); ++v)
    if (to_a.covers(v)) error = std::max(error, (back.row(v) - p.a.vertices.row(v)).norm());
  int covered = 0;
  for (int v = 0; v < on_b.rows(); ++v) covered += to_b.covers(v);
  std::printf("%-16s %d of %d vertices of B have some, back on A they differ by %.0e\n",
              "attributes", covered, to_b.rows(), error);
}

/// A shape between A and B, and how much the map stretches.
void morph(const ism::SurfaceMap& map, const ism::Result& r) {
  const ism::Points3 halfway = morphing::Morph(map, r.f, r.g).at(0.5);
  const ism::DistortionSummary d = ism::summarize(map.distortion());
  std::printf("%-16s %ld vertices, lengths change by factors of %.2f to %.2f\n", "morph",
              static_cast<long>(halfway.rows()), d.sigma_min, d.sigma_max);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return fail("usage: features A.obj B.obj landmarks.txt");
  const mesh_io::ReadResult a = mesh_io::read_mesh(argv[1]), b = mesh_io::read_mesh(argv[2]);
  const mesh_io::PairsResult pairs = mesh_io::read_pairs(argv[3]);
  if (!a.ok || !b.ok || !pairs.ok) return fail(!a.ok ? a.error : !b.ok ? b.error : pairs.error);
  const Pair p = {a.mesh, b.mesh, mesh_io::landmarks_of(pairs), a.edges};
  if (p.landmarks.empty()) return fail("some landmarks are needed");
  pin_vertices(p);
  join_landmarks(p);
  hold_boundaries(p);
  fix_vertices(p);
  choose_measure(p);
  const ism::Result r = ism::compute_map(p.a, p.b, p.landmarks, some_iterations());
  print("a map", r);
  std::printf("\n");
  const ism::SurfaceMap map(r);
  use_points(p, map);
  map_polygons(p, map);
  carry_attributes(p, map);
  morph(map, r);
  return 0;
}

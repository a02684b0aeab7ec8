// Maps two closed surfaces and measures what such a map has to be.
//
//   ism_closed A B LANDMARKS
//
// prints one line of a table: iterations, distortion, how far coverage is from 1, the largest
// error of vertices of A taken to B and back (of the diagonal), relative errors of the areas of the
// meta mesh, its Euler characteristic, the distortion that 95% of the area stay below at the cut
// and elsewhere, and seconds.

#include "../closed.hpp"
#include "mesh_io.hpp"

#include <cmath>
#include <cstdio>

namespace {

int fail(const std::string& sentence) {
  std::fprintf(stderr, "%s\n", sentence.c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return fail("usage: ism_closed A B LANDMARKS");
  const mesh_io::ReadResult a = mesh_io::read_mesh(argv[1]), b = mesh_io::read_mesh(argv[2]);
  if (!a.ok) return fail(a.error);
  if (!b.ok) return fail(b.error);
  const mesh_io::PairsResult pairs = mesh_io::read_pairs(argv[3]);
  if (!pairs.ok) return fail(pairs.error);
  const ism::Result result = ism::compute_map(a.mesh, b.mesh, mesh_io::landmarks_of(pairs));
  const ism::SurfaceMap map(result);
  if (map.status() != ism::Status::kDone) return fail(map.message());
  const ism::MetaMesh meta = map.meta_mesh();
  const closed::Topology topology = closed::topology(meta);
  const closed::CutDistortion cut = closed::cut_distortion(result, map);
  const auto area_error = [&](const ism::Points3& x, ism::Side side) {
    return std::abs(closed::area(meta, x) / closed::area(map.mesh(side)) - 1);
  };
  const ism::IterationLog& end = result.final_state();
  std::printf(
      "%s, %d iterations, distortion %.4f, coverage 1 %+.1e and 1 %+.1e, round trip %.1e, areas "
      "%.1e and %.1e, %s of Euler characteristic %d, p95 %.2f at the cut and %.2f elsewhere, "
      "%.1f s\n",
      ism::to_string(result.status), static_cast<int>(result.log.size()), end.mean_distortion,
      end.coverage_a - 1, end.coverage_b - 1, closed::round_trip(map),
      area_error(meta.on_a, ism::Side::kA), area_error(meta.on_b, ism::Side::kB),
      topology.is_manifold ? "manifold" : "NOT a manifold", topology.euler, cut.near, cut.rest,
      result.seconds + result.start.seconds);
}

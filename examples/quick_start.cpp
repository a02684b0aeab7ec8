// Maps one mesh onto another:  quick_start A.obj B.obj [landmarks.txt]

#include "ism.hpp"
#include "landmarks.hpp"  // these two read files; any other way to fill the arrays will do
#include "mesh_io.hpp"

#include <iostream>
#include <string>

static int fail(const std::string& message) {
  std::cerr << message << '\n';
  return 1;
}

int main(int argc, char** argv) {
  if (argc < 3) return fail("usage: quick_start A.obj B.obj [landmarks.txt]");
  const mesh_io::ReadResult a = mesh_io::read_mesh(argv[1]);
  const mesh_io::ReadResult b = mesh_io::read_mesh(argv[2]);
  if (!a.ok || !b.ok) return fail(a.ok ? b.error : a.error);

  std::vector<ism::Landmark> list;  // pairs {vertex of A, vertex of B}, if known
  if (argc > 3) {
    const std::string error = landmarks::read(argv[3], a.mesh, b.mesh, list);
    if (!error.empty()) return fail(error);
  }
  const ism::Result result = ism::compute_map(a.mesh, b.mesh, list);
  if (!ism::is_usable(result.status)) return fail(result.message);
  for (const ism::Warning& w : result.warnings) std::cout << "warning: " << w.message << '\n';

  const ism::IterationLog& last = result.final_state();
  std::cout << "distortion: " << last.mean_distortion << " (2 is an isometry)\n"
            << "coverage:   " << last.coverage_a << " of A, " << last.coverage_b << " of B\n";

  const ism::SurfaceMap map(result);
  for (int v = 0; v < a.mesh.vertices.rows(); ++v) {
    const ism::SurfacePoint image = map.forward_vertex(v);
    if (!image.exists()) continue;  // outside the common part
    std::cout << "vertex " << v << " of A goes to " << map.position_on_b(image).transpose()
              << " in triangle " << image.face << " of B\n";
    break;
  }
  return 0;
}

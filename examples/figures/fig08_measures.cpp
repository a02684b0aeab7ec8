// Fig. 8 of the paper: a single quad is mapped to a finely tessellated surface, two of its corners
// are pinched, and four distortion measures compensate for it in their own ways.
//
//   fig08_measures [FOLDER]
//
// prints, for the map that each measure finds, the value of all four, and how much of the quad is
// covered. In every column the least value has to stand on the diagonal, else the exit code is 1.
// Into FOLDER it writes the surface and, for each measure, a grid of lines on the quad as polylines
// on the surface (OBJ).

#include "ism.hpp"
#include "mesh_io.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

namespace {

constexpr int kFine = 30;   // the surface has kFine x kFine squares of two triangles
constexpr int kLines = 16;  // of the grid on the quad

struct Measure {
  const char* name;
  ism::DistortionMeasure measure;
};

/// A grid of n x n squares over [-1, 1]², with its positions in the plane.
std::pair<ism::TriangleMesh, ism::Points2> square_grid(int n) {
  ism::TriangleMesh mesh;
  mesh.vertices.resize((n + 1) * (n + 1), 3);
  mesh.triangles.resize(2 * n * n, 3);
  for (int j = 0, v = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i, ++v) mesh.vertices.row(v) << 2.0 * i / n - 1, 2.0 * j / n - 1, 0;
  for (int j = 0, f = 0; j < n; ++j)
    for (int i = 0; i < n; ++i, f += 2) {
      const int v = j * (n + 1) + i;
      mesh.triangles.row(f) << v, v + 1, v + n + 2;
      mesh.triangles.row(f + 1) << v, v + n + 2, v + n + 1;
    }
  return {mesh, mesh.vertices.leftCols<2>()};
}

/// The fine surface: a shallow hill.
std::pair<ism::TriangleMesh, ism::Points2> surface() {
  auto result = square_grid(kFine);
  for (int v = 0; v < result.first.vertices.rows(); ++v)
    result.first.vertices(v, 2) =
        0.3 * std::exp(-2 * result.first.vertices.row(v).head<2>().squaredNorm());
  return result;
}

/// The quad, its corners pinned; the two at the top are pinched.
ism::Options pinched(const ism::Points2& plane) {
  ism::Options options;
  options.coverage_weight = 0;
  options.keep_scale = true;
  options.max_iterations = 200;
  options.tolerance = 1e-5;
  options.pins_a = {0, 1, 2, 3};
  options.initial_f.resize(4, 2);
  options.initial_f << -0.613, -0.604, 0.607, -0.611, -0.217, 0.603, 0.221, 0.609;
  options.initial_g = plane;
  return options;
}

/// The energy of a map under another measure.
double energy(const ism::DistortionMeasure& measure, const ism::TriangleMesh& a,
              const ism::TriangleMesh& b, ism::Options options, const ism::Result& r) {
  options.measure = measure;
  options.initial_f = r.f;
  options.initial_g = r.g;
  options.max_iterations = 0;
  return ism::compute_map(a, b, {}, options).initial.map_energy;
}

int fail(const std::string& message) {
  std::fprintf(stderr, "fig08_measures: %s\n", message.c_str());
  return 1;
}

/// The lines u = const and v = const of a square mesh on B, as polylines.
mesh_io::TextFile lines_on_surface(const std::string& path, const ism::SurfaceMap& map) {
  constexpr int kSteps = 400;  // along a line
  std::vector<ism::Vec3> points;
  std::vector<std::vector<int>> lines;
  for (int direction = 0; direction < 2; ++direction)
    for (int i = 0; i <= kLines; ++i) {
      lines.emplace_back();
      for (int k = 0; k <= kSteps; ++k) {
        double u = i / double{kLines}, v = k / double{kSteps};
        if (direction == 1) std::swap(u, v);
        // Triangle 0 has the corners (0, 0), (1, 0), (1, 1), triangle 1 (0, 0), (1, 1), (0, 1).
        const ism::SurfacePoint p = u >= v ? ism::SurfacePoint{0, {1 - u, u - v, v}}
                                           : ism::SurfacePoint{1, {1 - v, u, v - u}};
        const ism::MappedPoint image = map.forward(p);
        if (!image.covered) continue;
        lines.back().push_back(static_cast<int>(points.size()));
        points.push_back(map.position_on_b(image.point));
      }
    }
  ism::Points3 vertices(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i)
    vertices.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
  return {path, mesh_io::obj_text("lines of the quad on the surface", vertices, lines, 'l')};
}

}  // namespace

int main(int argc, char** argv) {
  const Measure measures[] = {{"SD", ism::symmetric_dirichlet()},
                              {"ARAP", ism::arap()},
                              {"SARAP", ism::sarap()},
                              {"ASAP", ism::asap()}};
  ism::TriangleMesh quad = square_grid(1).first;
  quad.vertices *= 0.6;
  const auto [fine, plane] = surface();
  std::vector<mesh_io::TextFile> files;
  Eigen::Matrix4d values;  // row: the measure that is optimised, column: the one that is evaluated
  std::printf("optimised     iterations        SD      ARAP     SARAP      ASAP  coverage\n");
  for (int i = 0; i < 4; ++i) {
    ism::Options options = pinched(plane);
    options.measure = measures[i].measure;
    const ism::Result r = ism::compute_map(quad, fine, {}, options);
    if (!ism::is_usable(r.status)) return fail(r.message);
    for (int k = 0; k < 4; ++k) values(i, k) = energy(measures[k].measure, quad, fine, options, r);
    std::printf("%-12s  %10zu  %8.4f  %8.4f  %8.4f  %8.4f  %8.4f\n", measures[i].name, r.log.size(),
                values(i, 0), values(i, 1), values(i, 2), values(i, 3), r.final_state().coverage_a);
    files.push_back(lines_on_surface(std::string("quad_") + measures[i].name + ".obj",
                                     ism::SurfaceMap(quad, fine, r.f, r.g)));
  }
  if (argc > 1) {
    files.push_back({"surface.obj", mesh_io::obj_text("a surface", fine.vertices, fine.triangles)});
    for (mesh_io::TextFile& file : files) file.path.insert(0, std::string(argv[1]) + '/');
    const std::string error = mesh_io::write_files(files);
    if (!error.empty()) return fail(error);
  }
  for (int k = 0; k < 4; ++k)
    if (values(k, k) > values.col(k).minCoeff()) return fail("a measure is not at its least");
  return 0;
}

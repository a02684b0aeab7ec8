// Meshes, landmarks and options for the targets that run the whole method.

#ifndef ISM_TESTS_FUZZ_RANDOM_INPUT_HPP
#define ISM_TESTS_FUZZ_RANDOM_INPUT_HPP

#include "fuzz.hpp"

namespace fuzz {

struct Input {
  ism::TriangleMesh a, b;
  ism::Points2 f, g;  // embeddings on integers; no rows if none is known
  std::vector<ism::Landmark> landmarks;
  ism::Options options;
};

inline int n_vertices(const ism::TriangleMesh& mesh) {
  return static_cast<int>(mesh.vertices.rows());
}
inline int n_triangles(const ism::TriangleMesh& mesh) {
  return static_cast<int>(mesh.triangles.rows());
}

inline ism::TriangleMesh read_mesh(Bytes& bytes, ism::Points2& plane) {
  const int kind = bytes.below(8);
  if (kind == 0) return raw_mesh(bytes, 24);
  const int steps = bytes.below(24);
  if (kind < 5) {
    Lattice lattice;
    lattice.grow(bytes, steps);
    plane = plane_of(lattice);
    return lifted(lattice, bytes);
  }
  ism::TriangleMesh mesh = closed_mesh(bytes, steps / 2);
  for (int i = kind == 5 ? bytes.between(1, 2) : 0; i > 0; --i)
    drop_triangle(mesh, bytes.below(n_triangles(mesh)));
  return mesh;
}

inline ism::LandmarkPoint read_landmark_point(Bytes& bytes, const ism::TriangleMesh& mesh) {
  if (bytes.below(3) > 0) return bytes.id(n_vertices(mesh));
  ism::SurfacePoint p = odd_point(bytes, n_triangles(mesh));
  if (bytes.flag()) p.barycentric = {0.5, 0.5, 0};
  return p;
}

inline std::vector<ism::Landmark> read_landmarks(Bytes& bytes, const Input& in) {
  std::vector<ism::Landmark> landmarks;
  for (int i = bytes.below(7); i > 0; --i) {
    const ism::LandmarkPoint a = read_landmark_point(bytes, in.a);
    landmarks.push_back({a, read_landmark_point(bytes, in.b)});
  }
  return landmarks;
}

inline std::vector<int> read_ids(Bytes& bytes, const ism::TriangleMesh& mesh) {
  std::vector<int> ids;
  for (int i = bytes.below(4); i > 0; --i) ids.push_back(bytes.id(n_vertices(mesh)));
  return ids;
}

inline ism::StretchDensity odd_density(double S, double d) {
  return {S / d, 1 / d, -S / (d * d), 0, -1 / (d * d), 2 * S / (d * d * d)};
}
inline ism::StretchDensity density_without_numbers(double, double) {
  const double x = std::nan("");
  return {x, x, x, x, x, x};
}

inline ism::DistortionMeasure read_measure(Bytes& bytes) {
  switch (bytes.below(8)) {
    case 0:
      return ism::arap();
    case 1:
      return ism::sarap();
    case 2:
      return ism::asap();
    case 3:
      return {odd_density, 1, 0};
    case 4:
      return {odd_density, bytes.number(), bytes.number()};
    case 5:
      return {density_without_numbers, 1, 1};
    case 6:
      return {nullptr, 1, 1};
    default:
      return ism::symmetric_dirichlet();
  }
}

/// The positions of a lattice, spoilt or not.
inline void read_positions(Bytes& bytes, const Input& in, ism::Options& options) {
  options.initial_f = in.f, options.initial_g = in.g;
  for (int i = bytes.below(4); i > 0; --i) {
    ism::Points2& p = bytes.flag() ? options.initial_f : options.initial_g;
    if (p.size() == 0) continue;
    if (bytes.below(8) == 0)
      p.conservativeResize(p.rows() - 1, 2);
    else
      p.data()[bytes.below(static_cast<int>(p.size()))] += bytes.number();
  }
}

/// All tasks, the last one first.
inline void run_backwards(int n, const std::function<void(int)>& task) {
  for (int i = n; i-- > 0;) task(i);
}

inline void change_option(Bytes& bytes, const Input& in, ism::Options& o) {
  switch (bytes.below(20)) {
    case 0:
      o.measure = read_measure(bytes);
      break;
    case 1:
      o.coverage_weight = bytes.number();
      break;
    case 2:
      o.tolerance = bytes.number();
      break;
    case 3:
      o.keep_scale = bytes.flag();
      break;
    case 4:
      o.parallel_for = run_backwards;
      break;
    case 5:
      o.max_seconds = bytes.number();
      break;
    case 6:
      o.history_length = bytes.between(0, 9);
      break;
    case 7:
      o.pins_a = read_ids(bytes, in.a);
      break;
    case 8:
      o.pins_b = read_ids(bytes, in.b);
      break;
    case 9:
      o.fixed_a = read_ids(bytes, in.a);
      break;
    case 10:
      o.fixed_b = read_ids(bytes, in.b);
      break;
    case 11:
      o.exact_landmarks = true;
      break;
    case 12:
      o.boundary = static_cast<ism::Boundary>(bytes.below(3));
      break;
    case 13:
      o.outer_a = bytes.id(n_vertices(in.a));
      break;
    case 14:
      o.outer_b = bytes.id(n_vertices(in.b));
      break;
    case 15:
      read_positions(bytes, in, o);
      break;
    case 16:
      o.weld = bytes.flag();
      break;
    case 17:
      o.as_published = bytes.flag();
      break;
    case 18:
      o.coarsest = bytes.between(3, 6);
      break;
    case 19:
      o.max_iterations = bytes.between(-1, 3);
      break;
    default:
      o.omega_start = bytes.number();
  }
}

inline ism::Options read_options(Bytes& bytes, const Input& in) {
  ism::Options options;
  if (bytes.below(8) == 0) options = ism::Options::paper();
  options.max_iterations = 2;
  options.threads = 1;
  for (int i = bytes.below(7); i > 0; --i) change_option(bytes, in, options);
  return options;
}

inline Input read_input(Bytes& bytes) {
  Input in;
  in.a = read_mesh(bytes, in.f);
  if (bytes.below(3) == 0)
    in.b = in.a, in.g = in.f;
  else
    in.b = read_mesh(bytes, in.g);
  in.landmarks = read_landmarks(bytes, in);
  in.options = read_options(bytes, in);
  return in;
}

/// Of every result.
inline void require_result(const ism::Result& result) {
  if (!ism::is_usable(result.status)) {
    const bool may_go_on = result.status == ism::Status::kNoMapYet;
    require(may_go_on || !result.message.empty(), "a failure says why");
    require(result.f.rows() == 0 && result.g.rows() == 0, "a failure has no positions");
    return;
  }
  require(result.f.rows() == result.start.a->vertices.rows(), "a position of each vertex of A");
  require(result.g.rows() == result.start.b->vertices.rows(), "a position of each vertex of B");
  require_injective(result.start.a->triangles, result.f);
  require_injective(result.start.b->triangles, result.g);
  const ism::IterationLog& log = result.final_state();
  require(std::isfinite(log.energy), "E is finite");
  require(log.coverage_a >= 0 && log.coverage_a < 1 + 1e-6, "coverage is a fraction of A");
  require(log.coverage_b >= 0 && log.coverage_b < 1 + 1e-6, "coverage is a fraction of B");
}

inline bool same(const ism::Result& a, const ism::Result& b) {
  return a.status == b.status && a.f.rows() == b.f.rows() && a.g.rows() == b.g.rows() &&
         a.f == b.f && a.g == b.g;
}

}  // namespace fuzz

#endif  // ISM_TESTS_FUZZ_RANDOM_INPUT_HPP

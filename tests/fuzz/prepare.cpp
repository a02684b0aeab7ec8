// Fuzz target: any vertices and triangles are validated and prepared.

#include "fuzz.hpp"

namespace {

using fuzz::Bytes;
using fuzz::require;
using fuzz::require_range;
using ism::Prepared;
using ism::TriangleMesh;

std::ptrdiff_t count(const TriangleMesh& mesh, ism::Element element) {
  return element == ism::Element::kVertex ? mesh.vertices.rows() : mesh.triangles.rows();
}

void require_problems(const TriangleMesh& mesh, const std::vector<ism::Problem>& problems) {
  for (const ism::Problem& p : problems) {
    require(!p.message.empty(), "a problem has a message");
    for (const int id : p.ids) require_range(id, count(mesh, p.element), "an id of a problem");
  }
}

void require_repairs(const TriangleMesh& mesh, const std::vector<ism::Problem>& repairs) {
  for (const ism::Problem& r : repairs) {
    require(!r.message.empty(), "a repair has a message");
    for (const int id : r.ids) require_range(id, count(mesh, r.element), "an id of a repair");
  }
}

/// True if two vertices are the same, or as near to each other as the ends of a short edge.
bool is_near(const TriangleMesh& mesh, int u, int v, double size) {
  return (mesh.vertices.row(u) / size - mesh.vertices.row(v) / size).norm() <= 1e-10;
}

/// Ids of what there is now, and of what was given, are those of the same places.
void require_maps(const TriangleMesh& given, const Prepared& p) {
  const TriangleMesh& mesh = *p.mesh;
  require(p.given_vertex.size() == static_cast<std::size_t>(mesh.vertices.rows()), "given_vertex");
  require(p.given_corner.size() == static_cast<std::size_t>(mesh.triangles.size()), "given_corner");
  require(p.new_vertex.size() == static_cast<std::size_t>(given.vertices.rows()), "new_vertex");
  require(p.new_triangle.size() == static_cast<std::size_t>(given.triangles.rows()),
          "new_triangle");
  for (int v = 0; v < mesh.vertices.rows(); ++v) {
    const int old = p.given_vertex[static_cast<std::size_t>(v)];
    require_range(old, given.vertices.rows(), "a given vertex");
    require(mesh.vertices.row(v) == given.vertices.row(old), "vertices stay where they are");
  }
  double size = 0;
  for (int i = 0; i < given.triangles.size(); ++i)
    size = std::max(size, given.vertices.row(given.triangles.data()[i]).cwiseAbs().maxCoeff());
  for (int i = 0; i < mesh.triangles.size(); ++i) {
    const int corner = p.given_corner[static_cast<std::size_t>(i)];
    require_range(corner, given.triangles.size(), "a given corner");
    const int old = p.given_vertex[static_cast<std::size_t>(mesh.triangles.data()[i])];
    require(is_near(given, old, given.triangles.data()[corner], size),
            "corners stay where they are");
  }
  for (const int v : p.new_vertex) require(v >= -1 && v < mesh.vertices.rows(), "a new vertex");
  for (const int f : p.new_triangle)
    require(f >= -1 && f < mesh.triangles.rows(), "a new triangle");
  for (const ism::Problem& r : p.repairs)
    if (r.kind == ism::Problem::Kind::kDegenerateTriangle)
      for (const int f : r.ids)
        require(p.new_triangle[static_cast<std::size_t>(f)] == -1, "what was dropped is gone");
}

bool same(const TriangleMesh& a, const TriangleMesh& b) {
  return a.vertices.rows() == b.vertices.rows() && a.triangles.rows() == b.triangles.rows() &&
         a.vertices == b.vertices && a.triangles == b.triangles;
}

void require_clean(const Prepared& p) {
  const std::vector<ism::Problem> problems = ism::validate(*p.mesh);
  require(problems.empty(),
          "what was prepared is valid: " + (problems.empty() ? "" : problems[0].message));
  const Prepared again = ism::prepare(*p.mesh);
  require(again.problems.empty() && again.repairs.empty(), "what was prepared needs no repair");
  require(same(*again.mesh, *p.mesh), "what was prepared stays as it is");
}

std::vector<ism::LandmarkPoint> read_landmarks(Bytes& bytes, const TriangleMesh& mesh) {
  std::vector<ism::LandmarkPoint> landmarks;
  for (int i = bytes.below(4); i > 0; --i)
    if (bytes.flag())
      landmarks.emplace_back(bytes.id(static_cast<int>(mesh.vertices.rows())));
    else
      landmarks.emplace_back(fuzz::odd_point(bytes, static_cast<int>(mesh.triangles.rows())));
  return landmarks;
}

/// Spoils a surface: its triangles get vertices of their own, are turned, repeated or joined.
void spoil(Bytes& bytes, TriangleMesh& mesh) {
  const int n = static_cast<int>(mesh.triangles.rows());
  const int f = bytes.below(n), g = bytes.below(n), k = bytes.below(3), j = bytes.below(3);
  const int v = static_cast<int>(mesh.vertices.rows());
  switch (bytes.below(7)) {
    case 0:
      std::swap(mesh.triangles(f, 0), mesh.triangles(f, 1));
      break;
    case 1:
      mesh.triangles(f, k) = mesh.triangles(g, j);
      break;
    case 2:
      mesh.triangles.row(f) = mesh.triangles.row(g).eval();
      break;
    case 3:
      mesh.triangles(f, k) = bytes.id(v);
      break;
    case 4:
      mesh.vertices(mesh.triangles(f, k), j) = bytes.number();
      break;
    case 5:
      mesh.vertices.row(mesh.triangles(f, k)) = mesh.vertices.row(mesh.triangles(g, j)).eval();
      break;
    default:
      mesh.vertices.conservativeResize(v + 1, 3);
      mesh.vertices.row(v) = mesh.vertices.row(mesh.triangles(f, k)).eval();
      mesh.triangles(f, k) = v;
  }
}

bool in_range(const TriangleMesh& mesh) {
  return mesh.triangles.size() == 0 ||
         (mesh.triangles.minCoeff() >= 0 && mesh.triangles.maxCoeff() < mesh.vertices.rows());
}

TriangleMesh read_mesh(Bytes& bytes) {
  const int kind = bytes.below(3);
  if (kind == 0) return fuzz::raw_mesh(bytes, 40);
  TriangleMesh mesh;
  const int steps = bytes.below(24);
  if (kind == 1) {
    fuzz::Lattice lattice;
    lattice.grow(bytes, steps);
    mesh = fuzz::lifted(lattice, bytes);
  } else {
    mesh = fuzz::closed_mesh(bytes, steps);
    for (int i = bytes.below(4); i > 0; --i)
      fuzz::drop_triangle(mesh, bytes.below(static_cast<int>(mesh.triangles.rows())));
  }
  for (int i = bytes.below(16); i > 0 && in_range(mesh); --i) spoil(bytes, mesh);
  return mesh;
}

/// The same mesh from other memory: of floats, of 16 bits, with strides, behind each other or not.
void require_views_agree(Bytes& bytes, const TriangleMesh& mesh) {
  const Eigen::Index n = mesh.vertices.rows(), m = mesh.triangles.rows();
  Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic> x = mesh.vertices.cast<float>();
  Eigen::Matrix<std::uint16_t, Eigen::Dynamic, 5, Eigen::RowMajor> ids(m, 5);
  for (Eigen::Index i = 0; i < m; ++i)
    for (int k = 0; k < 3; ++k) ids(i, k) = static_cast<std::uint16_t>(mesh.triangles(i, k));
  TriangleMesh copy;
  copy.vertices = x.cast<double>();
  copy.triangles = ids.leftCols<3>().cast<int>();
  const ism::MeshView view(x, {ids.data(), m, 5 * sizeof(std::uint16_t)});
  const Prepared p = ism::prepare(view), q = ism::prepare(copy);
  require(p.problems.size() == q.problems.size() && p.repairs.size() == q.repairs.size(),
          "views of the same mesh are prepared alike");
  require(!p.problems.empty() || same(*p.mesh, *q.mesh), "views of the same mesh become the same");
  ism::validate(
      ism::MeshView({mesh.vertices.data(), n}, {mesh.triangles.data(), bytes.below(3) * m / 2}));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  const TriangleMesh mesh = read_mesh(bytes);
  const std::vector<ism::LandmarkPoint> landmarks = read_landmarks(bytes, mesh);
  const std::vector<ism::Problem> problems = ism::validate(mesh);
  require_problems(mesh, problems);
  const Prepared p = ism::prepare(mesh, landmarks);
  require_problems(mesh, p.problems);
  require_repairs(mesh, p.repairs);
  if (problems.empty()) {
    require(p.problems.empty() && p.repairs.empty(), "a valid mesh needs no repair");
    require(same(*p.mesh, mesh), "a valid mesh stays as it is");
  }
  if (p.problems.empty()) {
    require_maps(mesh, p);
    require_clean(p);
  }
  require_views_agree(bytes, mesh);
  return 0;
}

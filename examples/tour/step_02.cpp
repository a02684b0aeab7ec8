// Step 2 of tour.md: two embeddings in one plane.

#include "tour.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace {

ism::Points2 tutte(const ism::TriangleMesh& mesh) {
  std::map<int, std::set<int>> neighbours;  // in the order of edges of triangles
  for (int t = 0; t < mesh.triangles.rows(); ++t)
    for (int k = 0; k < 3; ++k)
      neighbours[mesh.triangles(t, k)].insert(mesh.triangles(t, (k + 1) % 3));
  std::map<int, int> next;  // along the boundary: where an edge has a triangle on one side only
  for (const auto& [u, around] : neighbours)
    for (int v : around)
      if (neighbours[v].count(u) == 0) next[u] = v;

  ism::Points2 x = ism::Points2::Zero(mesh.vertices.rows(), 2);
  const double step = 2 * 3.14159265358979323846 / static_cast<double>(next.size());
  int v = next.begin()->first;
  for (std::size_t k = 0; k < next.size(); ++k, v = next[v])
    x.row(v) << std::cos(step * static_cast<double>(k)), std::sin(step * static_cast<double>(k));

  for (int round = 0; round < 1500; ++round)
    for (const auto& [u, around] : neighbours) {
      if (next.count(u) > 0) continue;
      Eigen::RowVector2d mean(0, 0);
      for (int w : around) mean += x.row(w) / static_cast<double>(around.size());
      x.row(u) += 1.9 * (mean - x.row(u));  // overshoots, which gets there sooner
    }
  return x;
}

/// Where g takes a point of B, given by a triangle and barycentric coordinates.
Eigen::Vector2d in_plane(const ism::TriangleMesh& b, const ism::Points2& g,
                         const ism::SurfacePoint& p) {
  Eigen::Vector2d x(0, 0);
  for (int k = 0; k < 3; ++k) x += p.barycentric[k] * g.row(b.triangles(p.face, k)).transpose();
  return x;
}

/// The largest distance in the plane between f(v) and g(Φ(v)), over the vertices v of A.
double gap(const ism::Embedding& e) {
  const ism::SurfaceMap map(*e.a, *e.b, e.f, e.g);  // the map of any two embeddings
  double most = 0;
  for (int v = 0; v < e.f.rows(); ++v) {
    const ism::SurfacePoint image = map.forward_vertex(v);
    if (!image.exists()) continue;
    most = std::max(most, (in_plane(*e.b, e.g, image) - e.f.row(v).transpose()).norm());
  }
  return most;
}

/// The least area of a triangle, as a share of all.
double least_share(const ism::TriangleMesh& mesh, const ism::Points2& x) {
  double least = 1e300, total = 0;
  for (int t = 0; t < mesh.triangles.rows(); ++t) {
    Eigen::Matrix2d sides;
    for (int k = 0; k < 2; ++k)
      sides.col(k) = (x.row(mesh.triangles(t, k + 1)) - x.row(mesh.triangles(t, 0))).transpose();
    least = std::min(least, sides.determinant());
    total += sides.determinant();
  }
  return least / total;
}

void draw(const tour::Pair& pair, const ism::Embedding& e, const ism::Points2& tutte_of_a,
          render::Canvas& canvas) {
  const picture::Scene scene = picture::scene_of(ism::SurfaceMap(*e.a, *e.b, e.f, e.g));
  const render::View on_a = scene.view(ism::Side::kA, {10, 70, 190, 230});
  const render::View on_b = scene.view(ism::Side::kB, {760, 70, 190, 230});
  const ism::Points3 f = tour::in_space(e.f), g = tour::in_space(e.g);
  const render::View plane = render::look_at(tour::stacked(f, g), 0, 0, {285, 50, 400, 400});
  const render::View disk = render::look_at(tour::in_space(tutte_of_a), 0, 0, {15, 330, 190, 190});
  tour::draw_surface(on_a, pair.a, tour::kPaleBlue, canvas);
  tour::draw_surface(on_b, pair.b, tour::kPaleOrange, canvas);
  tour::draw_edges(plane, f, pair.a.triangles, 0.6, tour::kBlue, canvas);
  tour::draw_edges(plane, g, pair.b.triangles, 0.6, tour::kOrange, canvas);
  tour::draw_edges(disk, tour::in_space(tutte_of_a), pair.a.triangles, 0.6, tour::kBlue, canvas);
  for (const ism::Landmark& l : pair.landmarks) {
    canvas.draw_ball(on_a, pair.a.vertices.row(l.a.vertex).transpose(), 5, tour::kBlue, 8);
    canvas.draw_ball(on_b, pair.b.vertices.row(l.b.vertex).transpose(), 5, tour::kOrange, 8);
    tour::draw_dot(plane.project(f.row(l.a.vertex).transpose()).head<2>(), 5, tour::kBlue, canvas);
    tour::draw_dot(plane.project(g.row(l.b.vertex).transpose()).head<2>(), 3, tour::kOrange,
                   canvas);
  }
  canvas.text({12, 32}, 13, "A", tour::kBlue);
  canvas.text({930, 32}, 13, "B", tour::kOrange);
  canvas.text({370, 32}, 11, "the plane: f(A), g(B)");
  tour::draw_arrow({205, 190}, {270, 190}, 3, tour::kBlue, canvas);
  tour::draw_arrow({755, 190}, {695, 190}, 3, tour::kOrange, canvas);
  canvas.text({232, 178}, 12, "f", tour::kBlue);
  canvas.text({720, 178}, 12, "g", tour::kOrange);
  canvas.text({12, 545}, 9, "A by Tutte: the tips of the fingers are points");
}

}  // namespace

void step_02(tour::Report& report) {
  const tour::Pair pair = tour::read_pair("hand");
  const ism::Points2 x = tutte(pair.a);
  const ism::Embedding e = ism::initial_embedding(pair.a, pair.b, pair.landmarks);
  const double by_tutte = least_share(pair.a, x), by_library = least_share(pair.a, e.f);
  report.check(ism::is_usable(e.status), "there are two embeddings");
  report.check(by_tutte < 1e-10,
               tour::format("the smallest triangle has %.1e of the area by Tutte", by_tutte));
  report.check(by_library > 1e-6,
               tour::format("the smallest triangle has %.1e of the area of f(A)", by_library));
  report.check(e.landmark_distance < 0.1,
               tour::format("landmarks are %.3f domain radii apart", e.landmark_distance));
  report.check(gap(e) < 1e-12, tour::format("f(v) and g(Phi(v)) are %.1e apart", gap(e)));
  report.check_number("the smallest share in f(A)", by_library, 5e-6, 0.5);
  render::Canvas canvas(960, 560);
  draw(pair, e, x, canvas);
  report.save(canvas);
}

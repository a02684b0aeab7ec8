// Fig. 3 of the paper: the meta mesh, the common refinement of A and B, drawn on both surfaces.
// Edges of A are blue, edges of B red.
//
//   fig03_meta_mesh [PAIR [PICTURE]] [--iterations N]

#include "figure.hpp"

namespace {

const render::Color kBlue(0.12f, 0.30f, 0.62f), kRed(0.75f, 0.16f, 0.12f);

/// The edges of a mesh on its own surface.
void draw_edges(const render::View& view, const ism::TriangleMesh& mesh, const render::Color& color,
                render::Canvas& canvas) {
  for (Eigen::Index f = 0; f < mesh.triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      canvas.draw_line(view,
                       {mesh.vertices.row(mesh.triangles(f, k)).transpose(),
                        mesh.vertices.row(mesh.triangles(f, (k + 1) % 3)).transpose()},
                       0.8, color);
}

/// The edges of a mesh on the surface of the other one, as exact polylines.
template <class Path, class Position>
void draw_images(const render::View& view, const ism::TriangleMesh& mesh, const Path& path,
                 const Position& position, const render::Color& color, render::Canvas& canvas) {
  for (Eigen::Index f = 0; f < mesh.triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      for (const ism::Polyline& line : path(mesh.triangles(f, k), mesh.triangles(f, (k + 1) % 3))) {
        std::vector<ism::Vec3> points;
        for (const ism::SurfacePoint& p : line) points.push_back(position(p));
        canvas.draw_line(view, points, 0.8, color, 2.5);
      }
}

}  // namespace

int main(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, "hand", "fig03_meta_mesh.png");
  const figure::Pair pair = figure::read_pair(args.pair);
  const ism::Result r = figure::optimize(pair, args.options);
  const ism::SurfaceMap map(r.start.a, r.start.b, r.f, r.g);
  const ism::MetaMesh meta = map.meta_mesh();
  const std::size_t triangles =
      static_cast<std::size_t>(meta.a.triangles.rows() + meta.b.triangles.rows());

  render::Canvas canvas(1200, 760);
  const render::View on_a = figure::front_view(meta.a, {10, 60, 580, 640});
  const render::View on_b = figure::front_view(meta.b, {610, 60, 580, 640});
  canvas.draw(on_a, render::shape_of(meta.a));
  canvas.draw(on_b, render::shape_of(meta.b));
  draw_edges(on_a, meta.a, kBlue, canvas);
  draw_edges(on_b, meta.b, kRed, canvas);
  draw_images(
      on_a, meta.b,
      [&](int u, int v) {
        return map.backward_path({u, v});
      },
      [&](const ism::SurfacePoint& p) { return map.position_on_a(p); }, kRed, canvas);
  draw_images(
      on_b, meta.a,
      [&](int u, int v) {
        return map.forward_path({u, v});
      },
      [&](const ism::SurfacePoint& p) { return map.position_on_b(p); }, kBlue, canvas);
  canvas.text({20, 36}, 15, "A, with the edges of B in red");
  canvas.text({620, 36}, 15, "B, with the edges of A in blue");
  canvas.text({20, 740}, 12,
              std::to_string(meta.polygons.size()) + " polygons over " + std::to_string(triangles) +
                  " triangles");
  figure::save(args.picture, canvas);
  return 0;
}

// Fig. 3 of the paper: the meta mesh, the common refinement of A and B, drawn on both surfaces.
// Edges of A are blue, edges of B red.

#include "figure.hpp"

namespace {

bool is_refinement(const picture::Scene& scene) {
  for (std::size_t p = 1; p < scene.meta.offsets.size(); ++p) {
    const int corners = scene.meta.offsets[p] - scene.meta.offsets[p - 1];
    if (corners < 3 || corners > 6) return false;
  }
  return figure::is_proved(scene.map);
}

}  // namespace

int fig03_meta_mesh(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"hand"});
  const figure::Pair pair = figure::read_pair(args.pairs[0]);
  const ism::Result r = figure::optimize(pair, args.options);
  const picture::Scene scene = picture::scene_of(figure::map_of(r));
  const auto edges_a = figure::edges_of(*r.start.a), edges_b = figure::edges_of(*r.start.b);

  constexpr double kWidth = 0.8;
  const render::Rect left = {10, 60, 580, 640}, right = {610, 60, 580, 640};
  const render::View on_a = scene.view(ism::Side::kA, left);
  const render::View on_b = scene.view(ism::Side::kB, right);
  render::Canvas canvas(1200, 760);
  picture::draw_plain(scene, ism::Side::kA, left, canvas);
  picture::draw_plain(scene, ism::Side::kB, right, canvas);
  figure::draw_lines(on_a, figure::straight(*r.start.a, edges_a), kWidth, figure::kBlue, canvas);
  figure::draw_lines(on_a, figure::carried(scene, ism::Side::kB, edges_b), kWidth, figure::kRed,
                     canvas);
  figure::draw_lines(on_b, figure::straight(*r.start.b, edges_b), kWidth, figure::kRed, canvas);
  figure::draw_lines(on_b, figure::carried(scene, ism::Side::kA, edges_a), kWidth, figure::kBlue,
                     canvas);
  canvas.text({20, 36}, 15, "A, with the edges of B in red");
  canvas.text({620, 36}, 15, "B, with the edges of A in blue");
  canvas.text({20, 740}, 12,
              figure::format("%zu polygons over %zu triangles", scene.meta.face_a.size(),
                             static_cast<std::size_t>(r.start.a->triangles.rows() +
                                                      r.start.b->triangles.rows())));
  return figure::finish(
      args, canvas,
      {{"the polygons refine both meshes, with 3 to 6 corners", is_refinement(scene)}});
}

// Step 10 of tour.md: uses of a map.

#include "ism_verify.hpp"
#include "tour.hpp"

#include <algorithm>
#include <cmath>

namespace {

/// The results that a program gets from a map.
struct Uses {
  ism::Transfer to_b;        // from vertices of A to those of B, a sparse matrix
  ism::Values uv_of_b;       // texture coordinates of B, from those of A
  ism::Points3 halfway;      // a shape between A and B: vertices of the meta mesh
  ism::TriangleMesh a_on_b;  // the triangles of A with the shape of B
  ism::Outcome proof;        // that f and g are injective and the overlay is complete
};

Uses use(const ism::SurfaceMap& map, const ism::Values& uv_of_a) {
  const ism::MetaMesh meta = map.meta_mesh();
  Uses uses;
  uses.to_b = ism::transfer(meta, ism::Side::kA, ism::Element::kVertex, ism::Element::kVertex);
  uses.uv_of_b = uses.to_b.apply(uv_of_a);
  uses.halfway = ism::linear_morph(meta, 0.5);
  uses.a_on_b = ism::remesh(map, ism::Side::kA);
  uses.proof = ism::verify_map(map);
  return uses;
}

/// A surface in space, seen from the front of a scene, with texture coordinates per corner.
void draw_textured(const Eigen::Matrix3d& axes, render::Shape shape, const render::Image& texture,
                   const render::Rect& panel, render::Canvas& canvas) {
  shape.texture = &texture;
  canvas.draw(render::look_along(shape.vertices, axes, panel), shape, 1);
}

/// Values of vertices, at the corners of triangles.
Eigen::MatrixXd at_corners(const Eigen::MatrixXd& values, const ism::Triangles& triangles) {
  Eigen::MatrixXd result(triangles.size(), values.cols());
  for (Eigen::Index c = 0; c < result.rows(); ++c)
    result.row(c) = values.row(triangles(c / 3, c % 3));
  return result;
}

/// The triangles whose vertices all have values.
ism::Triangles covered_triangles(const ism::TriangleMesh& mesh, const ism::Transfer& transfer) {
  ism::Triangles result(mesh.triangles.rows(), 3);
  Eigen::Index n = 0;
  for (Eigen::Index t = 0; t < mesh.triangles.rows(); ++t) {
    bool all = true;
    for (int k = 0; k < 3; ++k) all = all && transfer.covers(mesh.triangles(t, k));
    if (all) result.row(n++) = mesh.triangles.row(t);
  }
  return result.topRows(n);
}

render::Rect panel(int column) { return {10 + 238.0 * column, 50, 226, 250}; }

void draw(const ism::SurfaceMap& map, const ism::Values& uv_of_a, const Uses& uses,
          render::Canvas& canvas) {
  const picture::Scene scene = picture::scene_of(map);
  const render::Image texture = render::checker_texture(16, 512);
  const ism::TriangleMesh &a = map.mesh(ism::Side::kA), &b = map.mesh(ism::Side::kB);
  render::Shape shape = render::shape_of(a);
  shape.corner_uv = at_corners(uv_of_a, a.triangles);
  draw_textured(scene.axes.a, shape, texture, panel(0), canvas);
  shape = render::Shape();
  shape.vertices = uses.halfway;
  shape.triangles = scene.fans.triangles;
  shape.corner_uv = scene.fans.at_corners(
      ism::to_meta(scene.meta, ism::Side::kA, ism::Element::kVertex).apply(uv_of_a));
  draw_textured(scene.axes.b, shape, texture, panel(1), canvas);
  shape = render::shape_of(b);  // what is not covered stays grey
  shape.color = tour::kGrey;
  canvas.draw(scene.view(ism::Side::kB, panel(2)), shape);
  shape.triangles = covered_triangles(b, uses.to_b);
  shape.corner_uv = at_corners(uses.uv_of_b, shape.triangles);
  draw_textured(scene.axes.b, shape, texture, panel(2), canvas);
  const render::View view = scene.view(ism::Side::kB, panel(3));
  tour::draw_surface(view, uses.a_on_b, tour::kPaleOrange, canvas);
  tour::draw_edges(view, uses.a_on_b.vertices, uses.a_on_b.triangles, 0.7, tour::kBlue, canvas);
  const char* const titles[] = {"A, textured", "halfway", "B, texture of A", "mesh A, shape B"};
  for (int i = 0; i < 4; ++i) canvas.text({panel(i).x, 30}, 10, titles[i]);
}

}  // namespace

void step_10(tour::Report& report) {
  const tour::Pair pair = tour::read_pair("starfish");
  const ism::Result result = ism::compute_map(pair.a, pair.b, pair.landmarks);
  const ism::SurfaceMap map(result);
  const ism::Points3& x = pair.a.vertices;
  const ism::Values from_low = x.rowwise() - x.colwise().minCoeff();
  const ism::Values uv_of_a = from_low.leftCols(2) / from_low.leftCols(2).maxCoeff();
  const Uses uses = use(map, uv_of_a);

  const ism::DistortionSummary d = ism::summarize(map.distortion());
  report.check(ism::is_usable(result.status), "there is a map");
  report.check(uses.proof.status == ism::Status::kDone, "it is proved to be injective");
  report.check(d.mean < 2.05, tour::format("%.3f per area; lengths change by %.2f to %.2f", d.mean,
                                           d.sigma_min, d.sigma_max));
  const int vertices = static_cast<int>(pair.b.vertices.rows());
  int covered = 0;
  for (int v = 0; v < vertices; ++v) covered += uses.to_b.covers(v);
  report.check(covered > 0.8 * vertices,
               tour::format("%d of %d vertices of B have texture coordinates", covered, vertices));
  const int triangles = static_cast<int>(pair.a.triangles.rows());
  const int on_b = static_cast<int>(uses.a_on_b.triangles.rows());
  report.check(on_b > 0.8 * triangles,
               tour::format("%d of %d triangles of A lie on B", on_b, triangles));
  report.check_number("the mean distortion", d.mean, 2.02, 0.02);
  report.check_number("the least factor", d.sigma_min, 0.63, 0.15);
  report.check_number("the largest factor", d.sigma_max, 1.60, 0.15);
  report.check_number("the number of values", covered, 1170);
  report.check_number("the number of triangles", on_b, 1813);
  render::Canvas canvas(960, 320);
  draw(map, uv_of_a, uses, canvas);
  report.save(canvas);
}

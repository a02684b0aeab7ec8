// Fig. 14 of the paper: a quad template is embedded in a target surface. Left the template, in the
// middle its edges on the target at the start, right at the end. Where A has no polygons, a coarse
// grid of quads over it is the template.

#include "figure.hpp"

#include <set>

namespace {

/// The vertex of a mesh that is closest to a point.
int nearest(const ism::TriangleMesh& mesh, const Eigen::RowVector3d& p) {
  Eigen::Index v = 0;
  (mesh.vertices.rowwise() - p).rowwise().squaredNorm().minCoeff(&v);
  return static_cast<int>(v);
}

/// n x n quads over A: the lines of a grid in a square along which the boundary of A is laid.
figure::Pair with_grid(const figure::Pair& pair, int n) {
  ism::Options options;
  options.boundary = ism::Boundary::kFixed;
  const ism::Embedding square = figure::embed(pair, options);
  const Eigen::RowVector2d lo = square.f.colwise().minCoeff(), hi = square.f.colwise().maxCoeff();
  const ism::TriangleMesh grid = picture::square_grid(n);
  const double inside = 0.49;  // of the square
  const ism::Points2 plane =
      (inside * grid.vertices.leftCols<2>() * (hi - lo).asDiagonal()).rowwise() + 0.5 * (lo + hi);
  figure::Pair result = {
      pair.name, figure::remeshed(grid, *square.a, plane, square.f), pair.b, {}, {}};
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) {
      const int v = i + j * (n + 1);
      if (i < n) result.edges_a.push_back({v, v + 1});
      if (j < n) result.edges_a.push_back({v, v + n + 1});
    }
  std::set<int> used;
  for (const ism::Landmark& l : pair.landmarks) {
    const int v = nearest(result.a, pair.a.vertices.row(l.a.vertex));
    if (used.insert(v).second) result.landmarks.push_back({v, l.b});
  }
  return result;
}

}  // namespace

int fig14_quad_template(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"face"});
  figure::Pair pair = figure::read_pair(args.pairs[0]);
  if (pair.edges_a.size() == figure::edges_of(pair.a).size()) pair = with_grid(pair, 18);
  const ism::Result r = figure::optimize(pair, args.options);
  const picture::Scene end = picture::scene_of(figure::map_of(r));
  const picture::Scene start = picture::scene_of(figure::start_of(r), end.axes);
  render::Canvas canvas(1260, 560);
  const auto panel = [](int column) -> render::Rect { return {10.0 + 415 * column, 60, 400, 450}; };
  constexpr double kWidth = 1.2;
  picture::draw_plain(end, ism::Side::kA, panel(0), canvas);
  figure::draw_lines(end.view(ism::Side::kA, panel(0)), figure::straight(pair.a, pair.edges_a),
                     kWidth, figure::kBlue, canvas);
  for (int i = 0; i < 2; ++i) {
    const picture::Scene& scene = i == 0 ? start : end;
    picture::draw_plain(scene, ism::Side::kB, panel(i + 1), canvas);
    figure::draw_lines(scene.view(ism::Side::kB, panel(i + 1)),
                       figure::carried(scene, ism::Side::kA, pair.edges_a), kWidth, figure::kBlue,
                       canvas);
  }
  canvas.text({20, 34}, 13, "the template");
  canvas.text({435, 34}, 13, figure::format("start, %.3f", r.initial.mean_distortion));
  canvas.text(
      {850, 34}, 13,
      figure::format("end, %.3f, %zu iterations", r.final_state().mean_distortion, r.log.size()));
  return figure::finish(args, canvas,
                        {{"the template is embedded injectively, at the start and at the end",
                          figure::is_proved(start.map) && figure::is_proved(end.map)},
                         {"its distortion falls", r.final_state().energy < r.initial.energy}});
}

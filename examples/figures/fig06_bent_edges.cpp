// Fig. 6 of the paper: two maps of a single quad A to a fine surface B. In the plane the edges of A
// are straight; on B they bend as g(B) is deformed. Nothing is optimised here.

#include "figure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace {

/// Turned about the origin, the more the nearer: the edges around it are bent.
ism::Points2 swirled(const ism::Points2& points) {
  constexpr double kTurn = 1.1;
  ism::Points2 result = points;
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const double angle = kTurn * std::exp(-2.5 * points.row(i).squaredNorm());
    result.row(i) = (Eigen::Rotation2Dd(angle) * points.row(i).transpose()).transpose();
  }
  return result;
}

/// How far lines are from straight ones, seen from above.
double bend(const figure::Lines& lines) {
  double most = 0;
  for (const std::vector<Eigen::Vector3d>& line : lines) {
    const Eigen::Vector2d start = line.front().head<2>();
    const Eigen::Vector2d along = (line.back().head<2>() - start).normalized();
    for (const Eigen::Vector3d& p : line) {
      const Eigen::Vector2d d = p.head<2>() - start;
      most = std::max(most, std::abs(along.x() * d.y() - along.y() * d.x()));
    }
  }
  return most;
}

}  // namespace

int fig06_bent_edges(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {});
  const ism::TriangleMesh fine = figure::hill(24);
  ism::TriangleMesh quad = picture::square_grid(1);
  quad.vertices *= 0.55;
  const std::vector<std::array<int, 2>> sides = {{0, 1}, {1, 3}, {3, 2}, {2, 0}};
  const auto edges = figure::edges_of(fine);
  const Eigen::Matrix3d tilted =
      Eigen::AngleAxisd(-0.7, Eigen::Vector3d::UnitX()).toRotationMatrix();
  const ism::Points2 f = quad.vertices.leftCols<2>(), g = fine.vertices.leftCols<2>();
  const render::Color light(0.72f, 0.72f, 0.74f);
  const Eigen::Vector2d lo(-1.02, -1.02), hi(1.02, 1.02);
  render::Canvas canvas(1240, 420);
  std::vector<double> bends;
  double left = 10;
  for (const ism::Points2& plane : {g, swirled(g)}) {
    const ism::SurfaceMap map(quad, fine, f, plane);
    if (!ism::is_usable(map.status())) figure::fail(map.message());
    const picture::Scene scene = picture::scene_of(map, {Eigen::Matrix3d::Identity(), tilted});
    const render::Rect in_plane = {left, 50, 300, 320}, on_surface = {left + 310, 50, 290, 320};
    figure::draw_plane(plane, edges, lo, hi, in_plane, 0.7, light, canvas);
    figure::draw_plane(f, sides, lo, hi, in_plane, 3, figure::kBlue, canvas);
    const render::View view = scene.view(ism::Side::kB, on_surface);
    picture::draw_plain(scene, ism::Side::kB, on_surface, canvas);
    figure::draw_lines(view, figure::straight(fine, edges), 0.7, figure::kGrey, canvas);
    const figure::Lines on_b = figure::carried(scene, ism::Side::kA, sides);
    figure::draw_lines(view, on_b, 3, figure::kBlue, canvas);
    bends.push_back(bend(on_b));
    left += 620;
  }
  const char* const captions[] = {"(a) the plane", "(b) B", "(c) the plane, g deformed", "(d) B"};
  for (int i = 0; i < 4; ++i) canvas.text({20.0 + 310 * i, 30}, 11, captions[i]);
  canvas.text({20, 405}, 10, "grey: edges of B; blue: the sides of the quad A");
  return figure::finish(args, canvas,
                        {{"over the plane of g, edges are straight", bends[0] < 1e-12},
                         {"once g is deformed, they bend", bends[1] > 0.05}});
}

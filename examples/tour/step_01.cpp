// Step 1 of tour.md: two surfaces, and a map between them.

#include "tour.hpp"

#include <algorithm>
#include <cmath>

namespace {

ism::SurfaceMap map_between(const ism::TriangleMesh& a, const ism::TriangleMesh& b,
                            const std::vector<ism::Landmark>& landmarks) {
  const ism::Result result = ism::compute_map(a, b, landmarks);
  return ism::SurfaceMap(result);  // where there is no map, it covers nothing
}

struct RoundTrip {
  int covered = 0;  // vertices of A that have an image on B
  double lost = 0;  // the farthest that any of them is from where it comes back to
};

RoundTrip there_and_back(const ism::SurfaceMap& map) {
  const ism::TriangleMesh& a = map.mesh(ism::Side::kA);
  RoundTrip trip;
  for (int v = 0; v < a.vertices.rows(); ++v) {
    const ism::SurfacePoint image = map.forward_vertex(v);  // a triangle of B, and where in it
    if (!image.exists()) continue;
    const ism::SurfacePoint back = map.backward(image);
    const Eigen::Vector3d p = a.vertices.row(v).transpose();
    trip.lost = std::max(trip.lost, (map.position_on_a(back) - p).norm());
    ++trip.covered;
  }
  return trip;
}

/// Vertices that are spread over a mesh: each is the farthest from those before.
std::vector<int> spread(const ism::Points3& points, int count) {
  std::vector<int> chosen = {0};
  Eigen::VectorXd distance = (points.rowwise() - points.row(0)).rowwise().norm();
  while (static_cast<int>(chosen.size()) < count) {
    Eigen::Index farthest = 0;
    distance.maxCoeff(&farthest);
    chosen.push_back(static_cast<int>(farthest));
    distance = distance.cwiseMin((points.rowwise() - points.row(farthest)).rowwise().norm());
  }
  return chosen;
}

render::Color hue(double t) {
  const auto wave = [&](double shift) {
    return static_cast<float>(0.5 + 0.5 * std::cos(6.2831853 * (t - shift)));
  };
  return {wave(0), 0.85f * wave(1.0 / 3), wave(2.0 / 3)};
}

void draw(const ism::SurfaceMap& map, render::Canvas& canvas) {
  const picture::Scene scene = picture::scene_of(map);
  const render::Rect left = {60, 50, 380, 440}, right = {520, 50, 380, 440};
  const render::View on_a = scene.view(ism::Side::kA, left);
  const render::View on_b = scene.view(ism::Side::kB, right);
  const ism::TriangleMesh &a = map.mesh(ism::Side::kA), &b = map.mesh(ism::Side::kB);
  tour::draw_surface(on_a, a, tour::kPaleBlue, canvas);
  tour::draw_surface(on_b, b, tour::kPaleOrange, canvas);
  for (int v : spread(a.vertices, 160)) {
    const Eigen::Vector3d p = a.vertices.row(v).transpose();
    const ism::SurfacePoint image = map.forward_vertex(v);
    const Eigen::Vector2d seen = on_a.project(p).head<2>();
    const render::Color color = hue(seen.x() / 210 + 0.35 * std::sin(seen.y() / 45));
    canvas.draw_ball(on_a, p, 5, color, 6);
    if (image.exists()) canvas.draw_ball(on_b, map.position_on_b(image), 5, color, 6);
  }
  canvas.text({20, 30}, 13, "A", tour::kBlue);
  canvas.text({480, 30}, 13, "B", tour::kOrange);
  canvas.text({60, 30}, 10, "points p");
  canvas.text({520, 30}, 10, "their images Phi(p), in the same colours");
}

}  // namespace

void step_01(tour::Report& report) {
  const tour::Pair pair = tour::read_pair("starfish");
  const ism::SurfaceMap map = map_between(pair.a, pair.b, pair.landmarks);
  const RoundTrip trip = there_and_back(map);
  const int n = static_cast<int>(pair.a.vertices.rows());
  report.check(map.status() == ism::Status::kDone, "there is a map");
  report.check(trip.covered <= n && trip.covered > 0.85 * n,
               tour::format("%d of the %d vertices of A have an image on B", trip.covered, n));
  report.check(trip.lost < 1e-9, tour::format("there and back loses at most %.1e", trip.lost));
  report.check_number("the number of images", trip.covered, 1020);
  render::Canvas canvas(960, 510);
  draw(map, canvas);
  report.save(canvas);
}

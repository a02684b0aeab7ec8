// Step 4 of tour.md: how the map distorts one polygon.

#include "tour.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace {

/// The sides b - a and c - a of triangle t whose vertices lie at x, as columns.
template <int D>
Eigen::Matrix<double, D, 2> sides(const ism::Rows<double, D>& x, const ism::TriangleMesh& mesh,
                                  int t) {
  Eigen::Matrix<double, D, 2> result;
  for (int k = 0; k < 2; ++k)
    result.col(k) = (x.row(mesh.triangles(t, k + 1)) - x.row(mesh.triangles(t, 0))).transpose();
  return result;
}

/// Two axes at right angles, of length 1, in the plane of a triangle of the surface, as columns.
Eigen::Matrix<double, 3, 2> axes(const ism::TriangleMesh& mesh, int t) {
  const Eigen::Matrix<double, 3, 2> s = sides(mesh.vertices, mesh, t);
  const Eigen::Vector3d x = s.col(0).normalized(), z = s.col(0).cross(s.col(1)).normalized();
  Eigen::Matrix<double, 3, 2> result;
  result << x, z.cross(x);
  return result;
}

/// The Jacobian of an embedding on a triangle: from these axes to those of the plane.
Eigen::Matrix2d jacobian(const ism::TriangleMesh& mesh, const ism::Points2& x, int t) {
  const Eigen::Matrix2d rest = axes(mesh, t).transpose() * sides(mesh.vertices, mesh, t);
  return sides(x, mesh, t) * rest.inverse();
}

struct PolygonEnergy {
  Eigen::Matrix2d J;            // of Φ, from the axes on the triangle of A to those on that of B
  double sigma_max, sigma_min;  // its singular values
  double energy;
};

/// The energy of the polygon in triangle s of A and t of B with a given area in the plane.
PolygonEnergy energy_of(const ism::TriangleMesh& a, const ism::Points2& f, int s,
                        const ism::TriangleMesh& b, const ism::Points2& g, int t, double area) {
  const Eigen::Matrix2d F = jacobian(a, f, s), G = jacobian(b, g, t), J = G.inverse() * F;
  const double area_a = area / F.determinant(), area_b = area / G.determinant();
  const double S = J.squaredNorm(), d = J.determinant();  // σ_max² + σ_min², and σ_max σ_min
  const double sum = std::sqrt(S + 2 * d), difference = std::sqrt(std::max(S - 2 * d, 0.0));
  return {J, 0.5 * (sum + difference), 0.5 * (sum - difference),
          J.squaredNorm() * area_b + J.inverse().squaredNorm() * area_a};
}

/// The area of polygon p in the plane.
double planar_area(const ism::MetaMesh& meta, std::size_t p) {
  const int first = meta.offsets[p], n = meta.offsets[p + 1] - first;
  const auto corner = [&](int i) {
    return meta.plane.row(meta.corners[static_cast<std::size_t>(first + i % n)]);
  };
  double sum = 0;
  for (int i = 0; i < n; ++i)
    sum += corner(i).x() * corner(i + 1).y() - corner(i).y() * corner(i + 1).x();
  return 0.5 * sum;
}

/// The middle of polygon p on a surface.
Eigen::Vector3d middle(const ism::MetaMesh& meta, const ism::Points3& at, std::size_t p) {
  Eigen::Vector3d sum(0, 0, 0);
  for (int c = meta.offsets[p]; c < meta.offsets[p + 1]; ++c)
    sum += at.row(meta.corners[static_cast<std::size_t>(c)]).transpose();
  return sum / (meta.offsets[p + 1] - meta.offsets[p]);
}

/// An ellipse: the image of a circle under M, whose columns are in space, around a center.
std::vector<Eigen::Vector3d> ellipse(const Eigen::Vector3d& center,
                                     const Eigen::Matrix<double, 3, 2>& M, double radius) {
  constexpr int kPoints = 32;
  constexpr double kPi = 3.14159265358979323846;
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i <= kPoints; ++i) {
    const double angle = 2 * kPi * i / kPoints;
    points.push_back(center + radius * M * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  return points;
}

/// Polygons whose middles on A are at least so far apart, large ones first.
std::vector<std::size_t> spread(const ism::MetaMesh& meta,
                                const std::vector<ism::PolygonDistortion>& d, double distance) {
  std::vector<std::size_t> order, chosen;
  for (std::size_t p = 0; p < d.size(); ++p) order.push_back(p);
  std::sort(order.begin(), order.end(),
            [&](std::size_t p, std::size_t q) { return d[p].area_a > d[q].area_a; });
  for (std::size_t p : order) {
    const Eigen::Vector3d x = middle(meta, meta.on_a, p);
    if (std::all_of(chosen.begin(), chosen.end(), [&](std::size_t q) {
          return (middle(meta, meta.on_a, q) - x).norm() > distance;
        }))
      chosen.push_back(p);
  }
  return chosen;
}

void draw(const ism::SurfaceMap& map, const std::vector<PolygonEnergy>& energies,
          render::Canvas& canvas) {
  constexpr double kRadius = 0.026;
  const ism::MetaMesh meta = map.meta_mesh();
  const std::vector<ism::PolygonDistortion> distortion = map.distortion(true);
  const ism::Points3 both = tour::stacked(meta.a->vertices, meta.b->vertices);
  const render::View on_a = render::look_along(both, tour::from_the_front(), {10, 50, 460, 330});
  const render::View on_b = render::look_along(both, tour::from_the_front(), {490, 50, 460, 330});
  tour::draw_surface(on_a, *meta.a, tour::kPaleBlue, canvas);
  tour::draw_surface(on_b, *meta.b, tour::kPaleOrange, canvas);
  tour::draw_edges(on_a, meta.a->vertices, meta.a->triangles, 0.6, tour::kBlue, canvas);
  tour::draw_edges(on_b, meta.b->vertices, meta.b->triangles, 0.6, tour::kOrange, canvas);
  for (std::size_t p : spread(meta, distortion, 3.2 * kRadius)) {
    const Eigen::Matrix<double, 3, 2> from = axes(*meta.a, meta.face_a[p]);
    const Eigen::Matrix<double, 3, 2> to = axes(*meta.b, meta.face_b[p]) * energies[p].J;
    const render::Color color = distortion[p].density > 2.5 ? tour::kRed : tour::kInk;
    canvas.draw_line(on_a, ellipse(middle(meta, meta.on_a, p), from, kRadius), 1.6, color, 6);
    canvas.draw_line(on_b, ellipse(middle(meta, meta.on_b, p), to, kRadius), 1.6, color, 6);
  }
  canvas.text({12, 28}, 11, "A: circles", tour::kBlue);
  canvas.text({490, 28}, 11, "B: their images, ellipses", tour::kOrange);
  canvas.text({12, 410}, 9, "red: an energy above 2.5 per area; 2 is an isometry");
}

}  // namespace

void step_04(tour::Report& report) {
  const tour::Pair pair = tour::sheets(12);
  const ism::Points2 f = tour::seen_from_above(pair.a), g = tour::seen_from_above(pair.b);
  const ism::SurfaceMap map(pair.a, pair.b, f, g);
  const ism::MetaMesh meta = map.meta_mesh();
  const std::vector<ism::PolygonDistortion> library = map.distortion(true);
  std::vector<PolygonEnergy> energies;
  double error = 0, largest = 0, least = 1e9, most = 0;
  for (std::size_t p = 0; p < library.size(); ++p) {
    const PolygonEnergy e =
        energy_of(pair.a, f, meta.face_a[p], pair.b, g, meta.face_b[p], planar_area(meta, p));
    const ism::PolygonDistortion& d = library[p];
    error =
        std::max({error, std::abs(e.sigma_max - d.sigma_max), std::abs(e.sigma_min - d.sigma_min),
                  std::abs(e.energy - d.density * (d.area_a + d.area_b))});
    largest = std::max(largest, d.density);
    least = std::min(least, d.sigma_min);
    most = std::max(most, d.sigma_max);
    energies.push_back(e);
  }
  const double mean = ism::summarize(library).mean;
  report.check(error < 1e-7, tour::format("the library says the same, to %.1e", error));
  report.check(mean > 2.2 && mean < 2.6,
               tour::format("%.3f per area on average, %.2f at most", mean, largest));
  report.check(least > 0, tour::format("lengths change by factors from %.2f to %.2f", least, most));
  report.check_number("the mean energy", mean, 2.41);
  report.check_number("the largest energy", largest, 4.18);
  report.check_number("the least factor", least, 0.46);
  report.check_number("the largest factor", most, 2.04);
  render::Canvas canvas(960, 430);
  draw(map, energies, canvas);
  report.save(canvas);
}

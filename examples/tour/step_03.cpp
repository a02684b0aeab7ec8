// Step 3 of tour.md: the overlay of two embeddings, and the meta mesh.

#include "tour.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace {

/// The vertices of polygon p of a meta mesh, counter-clockwise.
std::vector<int> corners_of(const ism::MetaMesh& meta, std::size_t p) {
  return {meta.corners.begin() + meta.offsets[p], meta.corners.begin() + meta.offsets[p + 1]};
}

/// The area of a polygon whose vertices lie at points of the plane or of a surface.
double area(const std::vector<int>& corners, const ism::Points3& at) {
  Eigen::Vector3d sum(0, 0, 0);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const std::size_t j = (i + 1) % corners.size();
    sum += Eigen::Vector3d(at.row(corners[i])).cross(Eigen::Vector3d(at.row(corners[j])));
  }
  return 0.5 * sum.norm();
}

/// How much of every triangle of A its polygons cover: from 0, outside the overlap, to 1.
std::vector<double> covered_shares(const ism::MetaMesh& meta) {
  std::vector<double> share(static_cast<std::size_t>(meta.a->triangles.rows()));
  for (std::size_t p = 0; p < meta.face_a.size(); ++p) {
    const int t = meta.face_a[p];
    const std::vector<int> triangle = {meta.a->triangles(t, 0), meta.a->triangles(t, 1),
                                       meta.a->triangles(t, 2)};
    share[static_cast<std::size_t>(t)] +=
        area(corners_of(meta, p), meta.on_a) / area(triangle, meta.a->vertices);
  }
  return share;
}

/// Vertices - edges + polygons.
int euler_characteristic(const ism::MetaMesh& meta) {
  std::set<std::array<int, 2>> edges;
  for (std::size_t p = 0; p < meta.face_a.size(); ++p) {
    const std::vector<int> corners = corners_of(meta, p);
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const int u = corners[i], v = corners[(i + 1) % corners.size()];
      edges.insert({std::min(u, v), std::max(u, v)});
    }
  }
  return static_cast<int>(meta.on_a.rows()) - static_cast<int>(edges.size()) + meta.n_polygons();
}

/// The kind of every vertex of the meta mesh.
enum class Kind { kVertexOfA, kVertexOfB, kCrossing };

std::vector<Kind> kinds(const ism::MetaMesh& meta) {
  constexpr double kOne = 1 - 1e-12;
  std::vector<Kind> result(static_cast<std::size_t>(meta.on_a.rows()), Kind::kCrossing);
  for (std::size_t c = 0; c < meta.corners.size(); ++c) {
    const Eigen::Index row = static_cast<Eigen::Index>(c);
    Kind& kind = result[static_cast<std::size_t>(meta.corners[c])];
    if (meta.corner_a.row(row).maxCoeff() > kOne) kind = Kind::kVertexOfA;
    if (meta.corner_b.row(row).maxCoeff() > kOne) kind = Kind::kVertexOfB;
  }
  return result;
}

constexpr int kKinds = 4;  // of polygons: 3 to 6 corners
const std::array<render::Color, kKinds> kTint = {
    render::Color(0.97f, 0.97f, 0.97f), render::Color(0.90f, 0.90f, 0.80f),
    render::Color(0.80f, 0.90f, 0.80f), render::Color(0.93f, 0.80f, 0.90f)};

/// Polygons in the colours of their numbers of corners, with the edges of A and B.
void draw_plane(const ism::SurfaceMap& map, const ism::MetaMesh& meta, const render::View& view,
                render::Canvas& canvas) {
  const render::Fans fans = render::fan_out(meta.offsets, meta.corners);
  render::Shape shape;
  shape.vertices = tour::in_space(meta.plane);
  shape.triangles = fans.triangles;
  shape.is_shaded = false;
  shape.corner_colors.resize(3 * fans.triangles.rows(), 3);
  for (Eigen::Index c = 0; c < shape.corner_colors.rows(); ++c) {
    const std::size_t p = static_cast<std::size_t>(fans.polygon[static_cast<std::size_t>(c / 3)]);
    const render::Color& tint = kTint[corners_of(meta, p).size() - 3];
    shape.corner_colors.row(c) = tint.cast<double>().matrix().transpose();
  }
  canvas.draw(view, shape);
  for (ism::Side side : {ism::Side::kB, ism::Side::kA}) {
    const render::Color& color = side == ism::Side::kA ? tour::kBlue : tour::kOrange;
    tour::draw_edges(view, tour::in_space(map.planar_positions(side)), map.mesh(side).triangles,
                     1.6, color, canvas);
  }
  const std::vector<Kind> kind = kinds(meta);
  for (std::size_t v = 0; v < kind.size(); ++v) {
    const Eigen::Vector3d p = shape.vertices.row(static_cast<Eigen::Index>(v)).transpose();
    const render::Color& color = kind[v] == Kind::kVertexOfA   ? tour::kBlue
                                 : kind[v] == Kind::kVertexOfB ? tour::kOrange
                                                               : tour::kInk;
    tour::draw_dot(view.project(p).head<2>(), kind[v] == Kind::kCrossing ? 1.8 : 3.6, color,
                   canvas);
  }
}

void draw(const ism::SurfaceMap& map, const ism::MetaMesh& meta, render::Canvas& canvas) {
  const ism::TriangleMesh &a = map.mesh(ism::Side::kA), &b = map.mesh(ism::Side::kB);
  const ism::Points3 both = tour::stacked(a.vertices, b.vertices);
  const render::View plane =
      render::look_at(tour::in_space(both.leftCols<2>()), 0, 0, {10, 45, 430, 430});
  const auto panel = [&](double top) {
    return render::look_along(both, tour::from_the_front(), {480, top, 470, 230});
  };
  draw_plane(map, meta, plane, canvas);
  const render::View on_a = panel(10), on_b = panel(255);
  tour::draw_surface(on_a, a, tour::kPaleBlue, canvas);
  tour::draw_edges(on_a, a.vertices, a.triangles, 1.6, tour::kBlue, canvas);
  tour::draw_carried_edges(on_a, map, ism::Side::kB, 1.2, tour::kOrange, canvas);
  tour::draw_surface(on_b, b, tour::kPaleOrange, canvas);
  tour::draw_edges(on_b, b.vertices, b.triangles, 1.6, tour::kOrange, canvas);
  tour::draw_carried_edges(on_b, map, ism::Side::kA, 1.2, tour::kBlue, canvas);
  canvas.text({12, 26}, 11, "the overlay in the plane");
  canvas.text({480, 26}, 11, "on A", tour::kBlue);
  canvas.text({480, 271}, 11, "on B", tour::kOrange);
  for (int i = 0; i < kKinds; ++i) {
    canvas.fill({12.0 + 100 * i, 490, 14, 14}, kTint[static_cast<std::size_t>(i)]);
    canvas.text({32.0 + 100 * i, 502}, 9, tour::format("%d-gon", 3 + i));
  }
}

/// Turned and moved a little, so that no vertex lies on an edge.
ism::Points2 turned(const ism::Points2& x) {
  constexpr double kAngle = 0.13;
  ism::Points2 result(x.rows(), 2);
  result.col(0) = std::cos(kAngle) * x.col(0) - std::sin(kAngle) * x.col(1);
  result.col(1) = std::sin(kAngle) * x.col(0) + std::cos(kAngle) * x.col(1);
  return result.rowwise() + Eigen::RowVector2d(0.011, 0.007);
}

}  // namespace

void step_03(tour::Report& report) {
  const tour::Pair pair = tour::sheets(6);
  const ism::Points2 f = tour::seen_from_above(pair.a), g = turned(tour::seen_from_above(pair.b));
  const ism::SurfaceMap map(pair.a, pair.b, f, g);
  const ism::MetaMesh meta = map.meta_mesh();
  std::array<int, 7> count = {};  // polygons with 0, 1, ... 6 corners
  for (std::size_t p = 0; p < meta.face_a.size(); ++p) ++count[corners_of(meta, p).size()];
  const std::vector<double> share = covered_shares(meta);
  const auto in = [&](double lo, double hi) {
    return std::count_if(share.begin(), share.end(), [&](double x) { return lo < x && x < hi; });
  };
  const std::vector<Kind> kind = kinds(meta);
  const auto of = [&](Kind k) { return static_cast<int>(std::count(kind.begin(), kind.end(), k)); };
  report.check(count[3] + count[4] + count[5] + count[6] == meta.n_polygons(),
               tour::format("of %d polygons, %d, %d, %d and %d have 3, 4, 5 and 6 corners",
                            meta.n_polygons(), count[3], count[4], count[5], count[6]));
  report.check(
      in(1 + 1e-9, 1e9) == 0,
      tour::format("of %zu triangles of A, %d are covered, %d in part", share.size(),
                   static_cast<int>(in(1 - 1e-9, 1 + 1e-9)), static_cast<int>(in(1e-9, 1 - 1e-9))));
  report.check(of(Kind::kCrossing) > 0,
               tour::format("of %zu vertices, %d are of A, %d of B, %d are crossings", kind.size(),
                            of(Kind::kVertexOfA), of(Kind::kVertexOfB), of(Kind::kCrossing)));
  report.check(euler_characteristic(meta) == 1, "the polygons make one disk");
  report.check_number("the number of polygons", meta.n_polygons(), 413);
  const double said[] = {222, 128, 42, 21};
  for (std::size_t i = 0; i < 4; ++i)
    report.check_number("the number of polygons of a kind", count[3 + i], said[i]);
  report.check_number("the number of vertices of A", of(Kind::kVertexOfA), 37);
  report.check_number("the number of vertices of B", of(Kind::kVertexOfB), 45);
  report.check_number("the number of crossings", of(Kind::kCrossing), 298);
  render::Canvas canvas(960, 520);
  draw(map, meta, canvas);
  report.save(canvas);
}

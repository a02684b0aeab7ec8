// map_picture.cpp: see map_picture.hpp.

#define RENDER_IMPLEMENTATION
#include "map_picture.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/SVD>

#include <array>
#include <cmath>
#include <map>

namespace picture {

std::set<int> boundary_vertices(const ism::TriangleMesh& mesh) {
  std::set<std::array<int, 2>> directed;
  for (Eigen::Index f = 0; f < mesh.triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      directed.insert({mesh.triangles(f, k), mesh.triangles(f, (k + 1) % 3)});
  std::set<int> vertices;
  for (const auto& [u, v] : directed)
    if (directed.count({v, u}) == 0) vertices.insert(u);
  return vertices;
}

namespace {

/// The coordinate axis, seen from `front`, that is closest to a direction, as files mostly have one
/// upwards: y rather than another one that is as close, and never minus y. The direction itself if
/// no axis is close.
Eigen::Vector3d along_axis(const Eigen::Vector3d& up, const Eigen::Vector3d& front) {
  constexpr double kClose = 0.64, kBonus = 0.1;  // cosines
  Eigen::Vector3d best = up;
  double best_score = kClose;
  for (int k = 0; k < 3; ++k)
    for (const double sign : {1.0, -1.0}) {
      const Eigen::Vector3d axis = sign * Eigen::Vector3d::Unit(k);
      const Eigen::Vector3d seen = (axis - axis.dot(front) * front).normalized();
      const double score = seen.dot(up) + (k == 1 && sign > 0 ? kBonus : 0);
      if (axis.dot(seen) < kClose || score < best_score) continue;
      best_score = score;
      best = k == 1 ? Eigen::Vector3d(sign * seen) : seen;
    }
  return best;
}

}  // namespace

namespace {

/// Per vertex, the first one at the same place.
std::vector<int> first_at_place(const ism::Points3& vertices) {
  std::map<std::array<double, 3>, int> at;
  std::vector<int> first;
  for (int v = 0; v < vertices.rows(); ++v)
    first.push_back(at.insert({{vertices(v, 0), vertices(v, 1), vertices(v, 2)}, v}).first->second);
  return first;
}

/// A mesh of which copies of vertices, where it was cut, are one again.
ism::TriangleMesh sewn(const ism::TriangleMesh& mesh) {
  const std::vector<int> first = first_at_place(mesh.vertices);
  ism::TriangleMesh result = mesh;
  for (Eigen::Index i = 0; i < result.triangles.size(); ++i)
    result.triangles.data()[i] = first[static_cast<std::size_t>(mesh.triangles.data()[i])];
  return result;
}

}  // namespace

Eigen::Matrix3d front_axes(const ism::TriangleMesh& mesh) {
  constexpr double kClear = 0.15;  // of the extent
  const ism::Points3 normals = render::smooth_normals(mesh.vertices, mesh.triangles);
  const Eigen::Vector3d center = mesh.vertices.colwise().mean().transpose();
  const ism::Points3 from_center = mesh.vertices.rowwise() - center.transpose();
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (Eigen::Index v = 0; v < from_center.rows(); ++v)
    spread += from_center.row(v).transpose() * from_center.row(v);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(spread);
  Eigen::Vector3d front = principal.eigenvectors().col(0);
  if (front.dot(normals.colwise().sum().transpose()) < 0) front = -front;
  Eigen::Vector3d rim = Eigen::Vector3d::Zero();
  const std::set<int> boundary = boundary_vertices(mesh);
  for (int v : boundary)
    rim += from_center.row(v).transpose() / static_cast<double>(boundary.size());
  Eigen::Vector3d up = -rim + rim.dot(front) * front;
  if (up.norm() < kClear * from_center.rowwise().norm().maxCoeff()) {
    up = Eigen::Vector3d::UnitY() - front.y() * front;
    if (up.norm() < kClear) up = principal.eigenvectors().col(2);
  }
  up = along_axis(up.normalized(), front);
  Eigen::Matrix3d axes;
  axes << up.cross(front).transpose(), up.transpose(), front.transpose();
  return axes;
}

Eigen::Matrix3d rotation_between(const ism::Points3& from, const ism::Points3& to) {
  const Eigen::RowVector3d from_center = from.colwise().mean(), to_center = to.colwise().mean();
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (Eigen::Index i = 0; i < from.rows(); ++i)
    moments += (to.row(i) - to_center).transpose() * (from.row(i) - from_center);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moments, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  if ((U * svd.matrixV().transpose()).determinant() < 0) U.col(2) *= -1;
  return U * svd.matrixV().transpose();
}

Scene scene_of(const ism::SurfaceMap& map, const Axes& axes, bool keep_scale) {
  Scene scene = {map, map.meta_mesh(ism::Ids::kEmbedded), map.meta_mesh(),
                 {},  map.distortion(keep_scale),         axes};
  scene.fans = render::fan_out(scene.meta.offsets, scene.meta.corners);
  return scene;
}

Scene scene_of(const ism::SurfaceMap& map, bool keep_scale) {
  Scene scene = scene_of(map, Axes{}, keep_scale);
  scene.axes.a = front_axes(map.is_closed() ? sewn(*scene.meta.a) : *scene.meta.a);
  scene.axes.b = scene.axes.a * rotation_between(scene.meta.on_b, scene.meta.on_a);
  return scene;
}

namespace {

/// The normals of the vertices on one side, smooth across a seam.
Eigen::MatrixXd normals_of(const Scene& scene, ism::Side side) {
  const ism::TriangleMesh& mesh = scene.mesh(side);
  if (!scene.map.is_closed())
    return render::smooth_normals(mesh.vertices, mesh.triangles).rowwise().normalized();
  const std::vector<int> first = first_at_place(mesh.vertices);
  const Eigen::MatrixXd normals =
      render::smooth_normals(mesh.vertices, sewn(mesh).triangles).rowwise().normalized();
  Eigen::MatrixXd result(normals.rows(), 3);
  for (Eigen::Index v = 0; v < result.rows(); ++v)
    result.row(v) = normals.row(first[static_cast<std::size_t>(v)]);
  return result;
}

/// The covered part of the surface on one side, shaded as the mesh.
render::Shape covered_part(const Scene& scene, ism::Side side) {
  render::Shape shape;
  shape.vertices = side == ism::Side::kA ? scene.meta.on_a : scene.meta.on_b;
  shape.triangles = scene.fans.triangles;
  const Eigen::MatrixXd normals = normals_of(scene, side);
  shape.corner_normals =
      scene.fans.at_corners(ism::to_meta(scene.meta, side, ism::Element::kVertex).apply(normals));
  return shape;
}

const render::Color kUncovered = {0.6f, 0.6f, 0.62f};

/// The surface on one side in grey, and over that its covered part.
void draw_covered(const Scene& scene, ism::Side side, const render::Rect& panel,
                  const render::Shape& covered, render::Canvas& canvas) {
  render::Shape whole = render::shape_of(scene.mesh(side));
  whole.color = kUncovered;
  const render::View view = scene.view(side, panel);
  canvas.draw(view, whole);
  canvas.draw(view, covered, 1);
}

}  // namespace

void draw_plain(const Scene& scene, ism::Side side, const render::Rect& panel,
                render::Canvas& canvas) {
  canvas.draw(scene.view(side, panel), render::shape_of(scene.mesh(side)));
}

Eigen::VectorXd areas_of(const ism::TriangleMesh& mesh) {
  Eigen::VectorXd areas(mesh.triangles.rows());
  for (Eigen::Index f = 0; f < areas.size(); ++f) {
    const Eigen::RowVector3d a = mesh.vertices.row(mesh.triangles(f, 0));
    const Eigen::RowVector3d u = mesh.vertices.row(mesh.triangles(f, 1)) - a;
    const Eigen::RowVector3d v = mesh.vertices.row(mesh.triangles(f, 2)) - a;
    areas[f] = 0.5 * u.cross(v).norm();
  }
  return areas;
}

constexpr double kWorst = 8;  // the distortion at which the colours of heat() end

/// The colour of a distortion: from 2, an isometry, to kWorst and above, on a logarithmic scale.
ism::TriangleMesh square_grid(int n) {
  ism::TriangleMesh mesh;
  mesh.vertices.resize((n + 1) * (n + 1), 3);
  mesh.triangles.resize(2 * n * n, 3);
  for (int j = 0, v = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i, ++v) mesh.vertices.row(v) << 2.0 * i / n - 1, 2.0 * j / n - 1, 0;
  for (int j = 0, f = 0; j < n; ++j)
    for (int i = 0; i < n; ++i, f += 2) {
      const int v = j * (n + 1) + i;
      mesh.triangles.row(f) << v, v + 1, v + n + 2;
      mesh.triangles.row(f + 1) << v, v + n + 2, v + n + 1;
    }
  return mesh;
}

render::Color heat_of(double density) {
  return render::heat(std::log(density / 2) / std::log(kWorst / 2));
}

render::Shape heat_part(const Scene& scene, ism::Side side) {
  render::Shape shape = covered_part(scene, side);
  shape.corner_colors.resize(3 * shape.triangles.rows(), 3);
  for (Eigen::Index c = 0; c < shape.corner_colors.rows(); ++c) {
    const int polygon = scene.fans.polygon[static_cast<std::size_t>(c / 3)];
    const render::Color color =
        heat_of(scene.distortion[static_cast<std::size_t>(polygon)].density);
    shape.corner_colors.row(c) = color.cast<double>().matrix().transpose();
  }
  return shape;
}

void draw_heat(const Scene& scene, ism::Side side, const render::Rect& panel,
               render::Canvas& canvas) {
  draw_covered(scene, side, panel, heat_part(scene, side), canvas);
}

void draw_heat_legend(const render::Rect& rect, render::Canvas& canvas) {
  canvas.legend(rect, render::heat, "2", "8+", "distortion, 2: isometry");
}

Texture front_texture(const Scene& scene) {
  const ism::Points3& vertices = scene.meta.a->vertices;
  const render::View view = scene.view(ism::Side::kA, {0, 0, 1, 1});
  Eigen::MatrixXd uv(vertices.rows(), 2);
  for (Eigen::Index v = 0; v < uv.rows(); ++v) {
    const Eigen::Vector3d p = view.project(vertices.row(v).transpose());
    uv.row(v) << p.x(), 1 - p.y();
  }
  return {render::checker_texture(24, 768),
          ism::to_meta(scene.meta, ism::Side::kA, ism::Element::kVertex).apply(uv)};
}

render::Shape textured_part(const Scene& scene, ism::Side side, const Texture& texture) {
  render::Shape shape = covered_part(scene, side);
  shape.texture = &texture.image;
  shape.corner_uv = scene.fans.at_corners(texture.uv);
  return shape;
}

render::Shape uncovered_part(const Scene& scene, ism::Side side) {
  constexpr double kWhole = 1 - 1e-9, kBelow = 1e-3;
  const ism::TriangleMesh& mesh = scene.mesh(side);
  const Eigen::VectorXd areas = areas_of(mesh);
  Eigen::VectorXd covered = Eigen::VectorXd::Zero(areas.size());
  const std::vector<ism::PolygonDistortion> polygons = scene.map.distortion(true);
  for (std::size_t p = 0; p < polygons.size(); ++p)
    if (side == ism::Side::kA)
      covered[scene.meta.face_a[p]] += polygons[p].area_a;
    else
      covered[scene.meta.face_b[p]] += polygons[p].area_b;
  render::Shape shape;
  shape.color = kUncovered;
  shape.vertices = mesh.vertices - kBelow * std::sqrt(areas.sum()) * normals_of(scene, side);
  shape.triangles = mesh.triangles;
  Eigen::Index n = 0;
  for (Eigen::Index f = 0; f < areas.size(); ++f)
    if (covered[f] < kWhole * areas[f]) shape.triangles.row(n++) = mesh.triangles.row(f);
  shape.triangles.conservativeResize(n, 3);
  return shape;
}

void draw_texture(const Scene& scene, ism::Side side, const Texture& texture,
                  const render::Rect& panel, render::Canvas& canvas) {
  draw_covered(scene, side, panel, textured_part(scene, side, texture), canvas);
}

void draw_texture(const Scene& scene, ism::Side side, const render::Rect& panel,
                  render::Canvas& canvas) {
  draw_texture(scene, side, front_texture(scene), panel, canvas);
}

void draw_landmarks(const Scene& scene, ism::Side side, const render::Rect& panel,
                    const std::vector<ism::Landmark>& landmarks, render::Canvas& canvas) {
  const bool on_a = side == ism::Side::kA;
  const render::View view = scene.view(side, panel);
  for (const ism::Landmark& l : landmarks) {
    const ism::LandmarkPoint& end = on_a ? l.a : l.b;
    Eigen::Vector3d place =
        on_a ? scene.map.position_on_a(end.point) : scene.map.position_on_b(end.point);
    if (end.vertex >= 0) place = scene.map.mesh(side).vertices.row(end.vertex);
    canvas.draw_ball(view, place, 5, {0.10f, 0.45f, 0.85f}, 12);
  }
}

}  // namespace picture

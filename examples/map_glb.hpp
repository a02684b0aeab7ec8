// map_glb.hpp: both surfaces of a map of ism.hpp, and a morph between them, for a glTF file.
//
//   const picture::Scene scene = picture::scene_of(map);
//   const picture::Texture texture = picture::front_texture(scene);
//   const std::string bytes = picture::glb_text(scene, texture, result.f, result.g);
//
// A, the morph and B are side by side, upright, seen from their front.

#ifndef ISM_EXAMPLES_MAP_GLB_HPP
#define ISM_EXAMPLES_MAP_GLB_HPP

#include "glb.hpp"
#include "map_picture.hpp"
#include "morph.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace picture {

/// Brings points upright, around the origin, to the size they are shown in.
struct Frame {
  Eigen::Matrix3d axes;
  Eigen::RowVector3d center;
  double scale;
  ism::Points3 operator()(const ism::Points3& points) const {
    return scale * (points.rowwise() - center) * axes.transpose();
  }
  render::Shape operator()(render::Shape shape) const {
    shape.vertices = (*this)(shape.vertices);
    if (shape.corner_normals.rows() > 0) shape.corner_normals *= axes.transpose();
    return shape;
  }
};

/// The surface on one side with area 1, unless sizes are kept: then, A has it.
inline Frame frame_of(const Scene& scene, ism::Side side, bool keep_scale) {
  const ism::Side measured = keep_scale ? ism::Side::kA : side;
  return {side == ism::Side::kA ? scene.axes.a : scene.axes.b,
          scene.mesh(side).vertices.colwise().mean(),
          1 / std::sqrt(areas_of(scene.mesh(measured)).sum())};
}

/// One of the surfaces that a morph is between: normals of the corners of the polygons, as
/// triangles, and of the triangles of the mesh that they lie in.
struct End {
  Eigen::MatrixXd corners, faces;
  const std::vector<int>& face;  // per polygon
};

inline End end_of(const Scene& scene, ism::Side side, const Frame& frame,
                  const Eigen::MatrixXd& corner_normals) {
  const ism::TriangleMesh& mesh = scene.mesh(side);
  Eigen::MatrixXd faces(mesh.triangles.rows(), 3);
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    const Eigen::RowVector3d a = mesh.vertices.row(mesh.triangles(f, 0));
    const Eigen::RowVector3d u = mesh.vertices.row(mesh.triangles(f, 1)) - a;
    const Eigen::RowVector3d v = mesh.vertices.row(mesh.triangles(f, 2)) - a;
    faces.row(f) = u.cross(v).normalized() * frame.axes.transpose();
  }
  return {corner_normals, faces, side == ism::Side::kA ? scene.meta.face_a : scene.meta.face_b};
}

/// The normals at the corners of a shape between A and B: those of A and of B, turned as their
/// triangles are. Its own would show every polygon, which are thin and not quite in one plane.
inline Eigen::MatrixXd normals_between(const Scene& scene, const End& a, const End& b,
                                       const ism::Points3& points, double t) {
  const ism::Triangles& triangles = scene.fans.triangles;
  ism::Points3 sum = ism::Points3::Zero(points.rows(), 3);
  for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
    const auto p = static_cast<std::size_t>(scene.fans.polygon[static_cast<std::size_t>(f)]);
    const Eigen::Vector3d corner = points.row(triangles(f, 0));
    const Eigen::Vector3d u = points.row(triangles(f, 1)).transpose() - corner;
    const Eigen::Vector3d v = points.row(triangles(f, 2)).transpose() - corner;
    const Eigen::Vector3d normal = u.cross(v);  // twice the area long
    const auto turned = [&](const End& end, Eigen::Index c) -> Eigen::Vector3d {
      const Eigen::Vector3d from = end.faces.row(end.face[p]);
      return Eigen::Quaterniond::FromTwoVectors(from, normal) *
             Eigen::Vector3d(end.corners.row(c).transpose());
    };
    if (!(normal.norm() > 0)) continue;
    for (int k = 0; k < 3; ++k)
      sum.row(triangles(f, k)) +=
          normal.norm() *
          ((1 - t) * turned(a, 3 * f + k) + t * turned(b, 3 * f + k)).normalized().transpose();
  }
  Eigen::MatrixXd corners(triangles.size(), 3);
  for (Eigen::Index c = 0; c < corners.rows(); ++c)
    corners.row(c) = sum.row(triangles(c / 3, c % 3));
  return corners;
}

/// Gives an object, the covered part of A, the shapes up to that of B, turned so that they do not
/// turn as a whole. False if there is no morph.
inline bool add_morph(const Scene& scene, const ism::Points2& f, const ism::Points2& g,
                      const Frame& a, const Frame& b, const Eigen::MatrixXd& normals_b,
                      glb::Object& object) {
  constexpr int kShapes = 8;  // some viewers take no more
  const morphing::Morph morph(scene.map, f, g);
  const End end_a = end_of(scene, ism::Side::kA, a, object.shape.corner_normals);
  const End end_b = end_of(scene, ism::Side::kB, b, normals_b);
  for (int i = 0; i <= kShapes && morph.ok(); ++i) {
    const double t = i / static_cast<double>(kShapes);
    const ism::Points3 points = morph.at(t);
    const Frame frame = {a.axes * rotation_between(points, scene.meta.on_a),
                         points.colwise().mean(), std::pow(a.scale, 1 - t) * std::pow(b.scale, t)};
    glb::Pose pose = {frame(points), {}};
    pose.corner_normals = normals_between(scene, end_a, end_b, pose.vertices, t);
    if (i > 0) object.morph.push_back(std::move(pose));
    if (i == 0) object.shape.vertices = pose.vertices;
    if (i == 0) object.shape.corner_normals = pose.corner_normals;
  }
  return morph.ok();
}

/// Places objects so that the box of the first one, with all its shapes, begins at x and ends below
/// y. Returns how far it reaches.
inline Eigen::Vector2d place(double x, double y, const std::vector<glb::Object*>& objects) {
  Eigen::Array3d lo = Eigen::Array3d::Constant(std::numeric_limits<double>::infinity()), hi = -lo;
  const auto extend = [&](const ism::Points3& points) {
    lo = lo.min(points.colwise().minCoeff().transpose().array());
    hi = hi.max(points.colwise().maxCoeff().transpose().array());
  };
  for (const glb::Object* object : objects) extend(object->shape.vertices);
  for (const glb::Pose& pose : objects[0]->morph) extend(pose.vertices);
  for (glb::Object* object : objects) object->place = {x - lo.x(), y - hi.y(), 0};
  return {x + hi.x() - lo.x(), y - hi.y() + lo.y()};
}

/// The bytes of a glTF file with A, a morph from A to B as an animation, and B, with a texture of
/// A; if `is_heat`, A and B with the distortion below. f and g are those that the map was made of.
/// None if there is no morph, or the file had more than 4 GB.
inline std::string glb_text(const Scene& scene, const Texture& texture, const ism::Points2& f,
                            const ism::Points2& g, bool keep_scale = false, bool is_heat = false) {
  constexpr double kGap = 0.15;
  constexpr ism::Side kA = ism::Side::kA, kB = ism::Side::kB;
  const Frame a = frame_of(scene, kA, keep_scale), b = frame_of(scene, kB, keep_scale);
  std::vector<glb::Object> o = {{"A", a(textured_part(scene, kA, texture)), {}},
                                {"A, not covered", a(uncovered_part(scene, kA)), {}},
                                {"from A to B", a(textured_part(scene, kA, texture)), {}},
                                {"B", b(textured_part(scene, kB, texture)), {}},
                                {"B, not covered", b(uncovered_part(scene, kB)), {}}};
  if (!add_morph(scene, f, g, a, b, o[3].shape.corner_normals, o[2])) return {};
  const Eigen::Vector2d first = place(0, 0, {&o[0], &o[1]});
  const Eigen::Vector2d middle = place(first.x() + kGap, 0, {&o[2]});
  const Eigen::Vector2d last = place(middle.x() + kGap, 0, {&o[3], &o[4]});
  if (is_heat) {
    const double below = std::min({first.y(), middle.y(), last.y()}) - kGap;
    o.push_back({"distortion of A", a(heat_part(scene, kA)), {}});
    o.push_back({"distortion of B", b(heat_part(scene, kB)), {}});
    place(0, below, {&o[5]});
    place(middle.x() + kGap, below, {&o[6]});
  }
  return glb::glb_text(o);
}

}  // namespace picture

#endif  // ISM_EXAMPLES_MAP_GLB_HPP

// map_picture.hpp: draws the surfaces of a map of ism.hpp with its distortion or with a texture.
//
//   const picture::Scene scene = picture::scene_of(map);
//   picture::draw_heat(scene, ism::Side::kB, {0, 0, 600, 600}, canvas);

#ifndef ISM_EXAMPLES_MAP_PICTURE_HPP
#define ISM_EXAMPLES_MAP_PICTURE_HPP

#include "ism.hpp"
#include "render.hpp"

#include <cstdio>
#include <set>
#include <string>
#include <vector>

namespace picture {

/// snprintf as a string of at most 255 characters.
template <class... Values>
std::string format(const char* pattern, Values... values) {
  char buffer[256];
  std::snprintf(buffer, sizeof buffer, pattern, values...);
  return buffer;
}

/// The ids of the vertices on the boundary.
std::set<int> boundary_vertices(const ism::TriangleMesh& mesh);

/// Looks at a mesh across the direction in which it extends least, from outside. What is opposite
/// to the boundary goes up: fingers from a wrist, backs from a hole in a belly; where that does not
/// tell, y does; a coordinate axis close to it is preferred. Rows: right, up, towards the viewer.
Eigen::Matrix3d front_axes(const ism::TriangleMesh& mesh);

/// Directions to look along at A and at B, as rows: right, up, towards the viewer.
struct Axes {
  Eigen::Matrix3d a = Eigen::Matrix3d::Identity(), b = a;
};

/// A map with what it takes to draw it.
struct Scene {
  ism::SurfaceMap map;
  ism::MetaMesh meta, given;  // of the meshes as they were embedded, and as they were given
  render::Fans fans;          // of its polygons
  std::vector<ism::PolygonDistortion> distortion;
  Axes axes;

  const ism::TriangleMesh& mesh(ism::Side side) const {
    return side == ism::Side::kA ? *meta.a : *meta.b;
  }
  /// The mesh on one side, filling a panel.
  render::View view(ism::Side side, const render::Rect& panel) const {
    return render::look_along(mesh(side).vertices, side == ism::Side::kA ? axes.a : axes.b, panel);
  }
};

/// Looks at the front of A, and at B so that the map moves its points least.
/// keep_scale as for SurfaceMap::distortion().
Scene scene_of(const ism::SurfaceMap& map, bool keep_scale = false);
/// The same from given directions: to compare maps between the same surfaces.
Scene scene_of(const ism::SurfaceMap& map, const Axes& axes, bool keep_scale = false);

/// The best rotation from one set of points to another, about their means [Kabsch 1976].
Eigen::Matrix3d rotation_between(const ism::Points3& from, const ism::Points3& to);
/// The areas of the triangles.
Eigen::VectorXd areas_of(const ism::TriangleMesh& mesh);

/// The surface on one side in light grey.
void draw_plain(const Scene& scene, ism::Side side, const render::Rect& panel,
                render::Canvas& canvas);
/// The surface on one side coloured by the distortion of the map; what is not covered is grey.
void draw_heat(const Scene& scene, ism::Side side, const render::Rect& panel,
               render::Canvas& canvas);
/// The colour of a density: white is an isometry, 2; the darkest red stands for 8 and more.
render::Color heat_of(double density);
void draw_heat_legend(const render::Rect& rect, render::Canvas& canvas);
/// A texture of A and where it lies: #C×2, at the corners of the polygons of the meta mesh.
struct Texture {
  render::Image image;
  Eigen::MatrixXd uv;
};
/// Coloured squares, projected onto A from its front.
Texture front_texture(const Scene& scene);
/// The surface on one side with a texture of A: A itself, or B, to which the map carries it.
void draw_texture(const Scene& scene, ism::Side side, const Texture& texture,
                  const render::Rect& panel, render::Canvas& canvas);
/// The surface on one side with front_texture().
void draw_texture(const Scene& scene, ism::Side side, const render::Rect& panel,
                  render::Canvas& canvas);
/// What is drawn, to be shown by other means: the covered part on one side with the colours of the
/// distortion, or with a texture of A, which has to outlive it; and triangles that are not covered
/// as a whole, in grey, a little below the surface.
render::Shape heat_part(const Scene& scene, ism::Side side);
render::Shape textured_part(const Scene& scene, ism::Side side, const Texture& texture);
render::Shape uncovered_part(const Scene& scene, ism::Side side);
/// Landmarks, vertices of the meshes given, as balls on the surface on one side.
void draw_landmarks(const Scene& scene, ism::Side side, const render::Rect& panel,
                    const std::vector<ism::Landmark>& landmarks, render::Canvas& canvas);

/// n × n squares over [-1, 1]², each of two triangles; vertex i + j (n + 1) is at (i, j).
ism::TriangleMesh square_grid(int n);

}  // namespace picture

#endif  // ISM_EXAMPLES_MAP_PICTURE_HPP

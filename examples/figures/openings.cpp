// Beyond the paper: surfaces with openings, faces with holes at eyes and mouth. A with a texture,
// B with that of A, and the distortion; what lies over an opening of the other surface is grey.
// Pairs with openings are named; the face of data/ gets some.

#include "figure.hpp"

#include <algorithm>
#include <utility>

namespace {

/// A mesh without the triangles between some pairs of vertices.
ism::TriangleMesh pierced(const ism::TriangleMesh& mesh,
                          const std::vector<std::array<int, 2>>& corners) {
  std::vector<int> kept;
  for (int f = 0; f < mesh.triangles.rows(); ++f) {
    const Eigen::RowVector3d middle =
        (mesh.vertices.row(mesh.triangles(f, 0)) + mesh.vertices.row(mesh.triangles(f, 1)) +
         mesh.vertices.row(mesh.triangles(f, 2))) /
        3;
    bool is_away = true;
    for (const std::array<int, 2>& pair : corners) {
      const Eigen::RowVector3d u = mesh.vertices.row(pair[0]), v = mesh.vertices.row(pair[1]);
      is_away = is_away && (middle - u).norm() + (middle - v).norm() > 1.1 * (u - v).norm();
    }
    if (is_away) kept.push_back(f);
  }
  ism::TriangleMesh result = {mesh.vertices, ism::Triangles(static_cast<int>(kept.size()), 3)};
  for (std::size_t i = 0; i < kept.size(); ++i)
    result.triangles.row(static_cast<Eigen::Index>(i)) = mesh.triangles.row(kept[i]);
  return result;
}

/// The face of data/ with openings between the corners of its eyes, which are landmarks.
figure::Pair face_with_openings(figure::Pair pair) {
  const std::size_t corners[][2] = {{2, 3}, {6, 7}};
  std::vector<std::array<int, 2>> at_a, at_b;
  for (const auto& [i, j] : corners) {
    at_a.push_back({pair.landmarks[i].a.vertex, pair.landmarks[j].a.vertex});
    at_b.push_back({pair.landmarks[i].b.vertex, pair.landmarks[j].b.vertex});
  }
  pair.a = pierced(pair.a, at_a);
  pair.b = pierced(pair.b, at_b);
  const std::vector<ism::Landmark>& l = pair.landmarks;
  pair.landmarks = {l[0], l[1], l[4], l[5], l[8], l[9]};  // the others may be gone
  return pair;
}

}  // namespace

int openings(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"face"});
  const int n = static_cast<int>(args.pairs.size());
  render::Canvas canvas(1060, static_cast<int>(figure::kRow) * n + 60);
  std::vector<figure::Claim> claims;
  for (int i = 0; i < n; ++i) {
    figure::Pair pair = figure::read_pair(args.pairs[static_cast<std::size_t>(i)]);
    if (pair.name == "face") pair = face_with_openings(std::move(pair));
    const ism::Result r = figure::optimize(pair, args.options);
    const ism::SurfaceMap map = figure::map_of(r);
    const picture::Scene scene = picture::scene_of(map);
    figure::draw_row(scene, 50 + figure::kRow * i, canvas);
    canvas.text(
        {20, 32 + figure::kRow * i}, 12,
        figure::format("%s: distortion %.3f, below %.2f on 95%% of the area", pair.name.c_str(),
                       r.final_state().mean_distortion, ism::summarize(scene.distortion).p95));
    claims.push_back(
        {pair.name + ": the map is injective, and openings stay open", figure::is_proved(map)});
  }
  picture::draw_heat_legend({730, figure::kRow * n + 20, 300, 14}, canvas);
  return figure::finish(args, canvas, claims);
}

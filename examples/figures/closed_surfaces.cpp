// Beyond the paper: closed surfaces. Every pair is drawn twice, seen from its front and from behind:
// the texture of A on both, and the distortion, with the path along which each surface is cut to lie
// in the plane. Closed pairs are named; without, those of data/ are closed by a fan of triangles.

#include "figure.hpp"

#include <Eigen/Geometry>

#include <map>

namespace {

/// A mesh with one boundary, closed by triangles around its middle; a closed one stays.
ism::TriangleMesh closed(ism::TriangleMesh mesh) {
  const std::set<int> rim = picture::boundary_vertices(mesh);
  if (rim.empty()) return mesh;
  const int n = static_cast<int>(mesh.vertices.rows());
  std::vector<std::array<int, 2>> edges;  // of the boundary, with the mesh on their left
  std::set<std::array<int, 2>> all;
  for (int pass = 0; pass < 2; ++pass)
    for (int f = 0; f < mesh.triangles.rows(); ++f)
      for (int k = 0; k < 3; ++k) {
        const int u = mesh.triangles(f, k), v = mesh.triangles(f, (k + 1) % 3);
        if (pass == 0)
          all.insert({u, v});
        else if (all.count({v, u}) == 0)
          edges.push_back({u, v});
      }
  Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
  for (int v : rim) middle += mesh.vertices.row(v) / static_cast<double>(rim.size());
  ism::Triangles triangles(mesh.triangles.rows() + static_cast<Eigen::Index>(edges.size()), 3);
  triangles.topRows(mesh.triangles.rows()) = mesh.triangles;
  for (std::size_t i = 0; i < edges.size(); ++i)
    triangles.row(mesh.triangles.rows() + static_cast<Eigen::Index>(i)) << edges[i][1], edges[i][0],
        n;
  ism::Points3 vertices(n + 1, 3);
  vertices << mesh.vertices, middle;
  return {vertices, triangles};
}

/// The axes to look from behind.
picture::Axes from_behind(const picture::Axes& front) {
  const Eigen::Matrix3d turn = Eigen::Vector3d(-1, 1, -1).asDiagonal();
  picture::Axes axes;
  axes.a = turn * front.a;
  axes.b = turn * front.b;
  return axes;
}

/// The edges along which a mesh is cut.
figure::Lines cut(const ism::TriangleMesh& mesh) {
  std::map<std::array<int, 2>, int> uses;
  const auto edge = [&](int f, int k) {
    const int u = mesh.triangles(f, k), v = mesh.triangles(f, (k + 1) % 3);
    return std::array<int, 2>{std::min(u, v), std::max(u, v)};
  };
  for (int f = 0; f < mesh.triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k) ++uses[edge(f, k)];
  figure::Lines lines;
  for (const auto& [ends, n] : uses)
    if (n == 1) lines.push_back({mesh.vertices.row(ends[0]), mesh.vertices.row(ends[1])});
  return lines;
}

}  // namespace

int closed_surfaces(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"hand"});
  const int n = static_cast<int>(args.pairs.size());
  render::Canvas canvas(1060, static_cast<int>(figure::kRow) * 2 * n + 60);
  std::vector<figure::Claim> claims;
  for (int i = 0; i < 2 * n; i += 2) {
    figure::Pair pair = figure::read_pair(args.pairs[static_cast<std::size_t>(i / 2)]);
    pair.a = closed(std::move(pair.a));
    pair.b = closed(std::move(pair.b));
    const ism::Result r = figure::optimize(pair, args.options);
    const ism::SurfaceMap map = figure::map_of(r);
    const picture::Scene front = picture::scene_of(map);
    const picture::Scene behind = picture::scene_of(map, from_behind(front.axes));
    for (int row = i; row < i + 2; ++row) {
      const picture::Scene& scene = row == i ? front : behind;
      const double top = 50 + figure::kRow * row;
      figure::draw_row(scene, top, canvas);
      const auto draw_cut = [&](ism::Side side, int column, const figure::Lines& lines) {
        const render::View view = scene.view(side, figure::row_panel(column, top));
        figure::draw_lines(view, lines, 1.5, figure::kBlue, canvas);
      };
      draw_cut(ism::Side::kA, 2, cut(*r.start.a));
      draw_cut(ism::Side::kB, 3, cut(*r.start.b));
    }
    canvas.text(
        {20, 32 + figure::kRow * i}, 12,
        figure::format("%s: distortion %.3f, below %.2f on 95%% of the area", pair.name.c_str(),
                       r.final_state().mean_distortion, ism::summarize(front.distortion).p95));
    canvas.text({20, 32 + figure::kRow * (i + 1)}, 12, "the same, from behind");
    claims.push_back({pair.name + ": the map is closed", map.is_closed()});
    claims.push_back(
        {pair.name + ": it is injective, and covers both surfaces", figure::is_proved(map)});
  }
  picture::draw_heat_legend({730, 2 * figure::kRow * n + 20, 300, 14}, canvas);
  return figure::finish(args, canvas, claims);
}

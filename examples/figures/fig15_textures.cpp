// Fig. 15 of the paper: mutual texture transfer between three shapes. Every row is a texture of one
// of them, carried to the others. The shapes are A and B of a pair and B of a second one with the
// same A; without a second pair, A stretched upwards.

#include "figure.hpp"

namespace {

using Landmarks = std::vector<ism::Landmark>;

/// Landmarks between the B of two pairs with the same A.
Landmarks joined(const Landmarks& first, const Landmarks& second) {
  Landmarks result;
  for (const ism::Landmark& p : first)
    for (const ism::Landmark& q : second)
      if (p.a.vertex == q.a.vertex) result.push_back({p.b, q.b});
  return result;
}

/// A with its own vertices as landmarks, stretched in the direction that is up in its front view.
figure::Pair stretched(const figure::Pair& pair) {
  constexpr double kStretch = 1.6;
  figure::Pair result = pair;
  const Eigen::Vector3d up = picture::front_axes(pair.a).row(1);
  result.b = pair.a;
  result.b.vertices += (kStretch - 1) * (pair.a.vertices * up) * up.transpose();
  for (ism::Landmark& l : result.landmarks) l.b = l.a;
  return result;
}

}  // namespace

int fig15_textures(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"hand"});
  const figure::Pair first = figure::read_pair(args.pairs[0]);
  const figure::Pair second =
      args.pairs.size() > 1 ? figure::read_pair(args.pairs[1]) : stretched(first);
  if (first.a.vertices != second.a.vertices) figure::fail("both pairs need the same A");
  const figure::Pair third = {
      "both", first.b, second.b, {}, joined(first.landmarks, second.landmarks)};
  const ism::Result maps[] = {figure::optimize(first, args.options),
                              figure::optimize(second, args.options),
                              figure::optimize(third, args.options)};
  const picture::Axes to_b = picture::scene_of(figure::map_of(maps[0])).axes;
  const picture::Axes to_c = picture::scene_of(figure::map_of(maps[1])).axes;
  const Eigen::Matrix3d axes[] = {to_b.a, to_b.b, to_c.b};

  render::Canvas canvas(960, 1110);
  const auto panel = [](int row, int column) -> render::Rect {
    return {20.0 + 320 * column, 60.0 + 350 * row, 280, 330};
  };
  const int ends[][2] = {{0, 1}, {0, 2}, {1, 2}};
  for (int m = 0; m < 3; ++m) {
    const int i = ends[m][0], j = ends[m][1];
    const picture::Scene there = picture::scene_of(figure::map_of(maps[m]), {axes[i], axes[j]});
    const picture::Scene back = picture::scene_of(figure::inverse_of(maps[m]), {axes[j], axes[i]});
    picture::draw_texture(there, ism::Side::kB, panel(i, j), canvas);
    picture::draw_texture(back, ism::Side::kB, panel(j, i), canvas);
    if (m == 1) continue;
    picture::draw_texture(there, ism::Side::kA, panel(i, i), canvas);
    if (m == 2) picture::draw_texture(back, ism::Side::kA, panel(j, j), canvas);
  }
  canvas.text({20, 34}, 13, "each row: one texture, on its own shape and carried to the others");
  std::vector<figure::Claim> claims;
  for (const ism::Result& r : maps)
    claims.push_back({"a map neither folds nor tears", figure::is_proved(figure::map_of(r))});
  return figure::finish(args, canvas, claims);
}

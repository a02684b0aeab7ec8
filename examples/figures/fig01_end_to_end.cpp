// Fig. 1 of the paper: a map composed of two parametrizations that were made one by one is bent;
// optimised end to end, from the same start, it is not. Heat maps of the distortion on both
// surfaces, and the two landmarks that guide the start: the fourth and the fifth of the pair, of
// the hands those of little finger and thumb.
//
//   fig01_end_to_end [PAIR [PICTURE]] [--iterations N]

#include "figure.hpp"

int main(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, "hand", "fig01_end_to_end.png");
  figure::Pair pair = figure::read_pair(args.pair);
  if (pair.landmarks.size() < 5) figure::fail("the pair needs five landmarks");
  pair.landmarks = {pair.landmarks[3], pair.landmarks[4]};
  const ism::Result r = figure::optimize(pair, args.options);
  const ism::TriangleMesh &a = r.start.a, &b = r.start.b;
  const ism::SurfaceMap start(a, b, r.start.f, r.start.g), end(a, b, r.f, r.g);
  render::Canvas canvas(1280, 760);
  const render::Rect panels[] = {
      {10, 80, 310, 560}, {320, 80, 310, 560}, {650, 80, 310, 560}, {960, 80, 310, 560}};
  figure::draw_distortion(start, panels[0], panels[1], canvas);
  figure::draw_distortion(end, panels[2], panels[3], canvas);
  for (const ism::Landmark& l : pair.landmarks)
    for (int i : {0, 2}) {
      canvas.draw_ball(figure::front_view(a, panels[i]), a.vertices.row(l.a).transpose(), 5,
                       figure::kLandmark, 20);
      canvas.draw_ball(figure::front_view(b, panels[i + 1]), b.vertices.row(l.b).transpose(), 5,
                       figure::kLandmark, 20);
    }
  canvas.text({20, 34}, 14, "two parametrizations, composed");
  canvas.text({660, 34}, 14, "optimised end to end");
  canvas.text({20, 62}, 9, figure::distortion_words(start));
  canvas.text({660, 62}, 9, figure::distortion_words(end));
  figure::draw_heat_legend({480, 700, 320, 16}, canvas);
  figure::save(args.picture, canvas);
  return 0;
}

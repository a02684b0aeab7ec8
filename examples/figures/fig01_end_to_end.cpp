// Fig. 1 of the paper: a map composed of two parametrizations that were made one by one is bent;
// optimised end to end, it is not. Heat maps of the distortion on both
// surfaces, and the two landmarks that guide them: the fourth and the fifth of the pair, of the
// hands those of little finger and thumb.

#include "figure.hpp"

int fig01_end_to_end(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"hand"});
  figure::Pair pair = figure::read_pair(args.pairs[0]);
  if (pair.landmarks.size() < 5) figure::fail("the pair needs five landmarks");
  pair.landmarks = {pair.landmarks[3], pair.landmarks[4]};
  const ism::Result r = figure::optimize(pair, args.options);
  const picture::Scene end = picture::scene_of(figure::map_of(r));
  const picture::Scene start = picture::scene_of(figure::composed(pair), end.axes);
  render::Canvas canvas(1280, 760);
  double left = 10;
  for (const picture::Scene* scene : {&start, &end}) {
    for (ism::Side side : {ism::Side::kA, ism::Side::kB}) {
      const render::Rect panel = {left, 80, 300, 560};
      picture::draw_heat(*scene, side, panel, canvas);
      picture::draw_landmarks(*scene, side, panel, pair.landmarks, canvas);
      left += 310;
    }
    left += 20;
  }
  canvas.text({20, 34}, 14, "two parametrizations, composed");
  canvas.text({660, 34}, 14, "optimised end to end");
  canvas.text({20, 62}, 9, figure::distortion_words(start.map));
  canvas.text({660, 62}, 9, figure::distortion_words(end.map));
  picture::draw_heat_legend({480, 700, 320, 16}, canvas);
  return figure::finish(args, canvas,
                        {{"most of the distortion of the composition was not needed",
                          figure::excess(end.map) < 0.5 * figure::excess(start.map)}});
}

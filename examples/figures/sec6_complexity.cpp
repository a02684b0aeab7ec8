// §6 of the paper, meta mesh complexity: polygons of the meta mesh per triangle of both meshes, for
// every pair that is named: at the start, at most, and at the end. The paper observed at most 10.

#include "figure.hpp"

#include <algorithm>

int sec6_complexity(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"hand", "face", "starfish"});
  constexpr double kBound = 10, kRow = 46, kLeft = 250, kUnit = 56;
  const double bottom = 60 + kRow * static_cast<double>(args.pairs.size());
  render::Canvas canvas(1000, static_cast<int>(bottom) + 60);
  canvas.text({20, 30}, 12, "polygons of the meta mesh per triangle of A and B");
  const auto x = [&](double factor) { return kLeft + kUnit * factor; };
  for (int i = 0; i <= static_cast<int>(kBound); i += 2) {
    canvas.line({{x(i), 50}, {x(i), bottom}}, i == kBound ? 3 : 1,
                i == kBound ? figure::kRed : render::Color(0.85f, 0.85f, 0.85f));
    canvas.text({x(i) - 5, bottom + 20}, 9, std::to_string(i));
  }
  std::vector<figure::Claim> claims;
  double top = 62;
  for (const std::string& folder : args.pairs) {
    const figure::Pair pair = figure::read_pair(folder);
    const ism::Result r = figure::optimize(pair, args.options);
    const double triangles = static_cast<double>(pair.a.triangles.rows() + pair.b.triangles.rows());
    int most = r.initial.polygons;
    for (const ism::IterationLog& it : r.log) most = std::max(most, it.polygons);
    const double start = r.initial.polygons / triangles, end = r.final_state().polygons / triangles;
    canvas.text({20, top + 20}, 10, pair.name);
    canvas.fill({kLeft, top, kUnit * start, 10}, figure::kGrey);
    canvas.fill({kLeft, top + 11, kUnit * most / triangles, 10}, figure::kRed);
    canvas.fill({kLeft, top + 22, kUnit * end, 10}, figure::kBlue);
    std::printf("%s: start %.2f, most %.2f, end %.2f\n", pair.name.c_str(), start, most / triangles,
                end);
    claims.push_back(
        {pair.name + ": never more than 10 polygons per triangle", most / triangles <= kBound});
    top += kRow;
  }
  const std::pair<const char*, render::Color> names[] = {
      {"start", figure::kGrey}, {"most", figure::kRed}, {"end", figure::kBlue}};
  double left = kLeft;
  for (const auto& [name, color] : names) {
    canvas.fill({left, bottom + 36, 20, 10}, color);
    canvas.text({left + 28, bottom + 46}, 10, name);
    left += 120;
  }
  canvas.text({left, bottom + 46}, 10, "red line: the paper's bound");
  return figure::finish(args, canvas, claims);
}

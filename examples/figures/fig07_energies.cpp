// Fig. 7 of the paper: while the energy of the map falls, those of the two parametrizations grow,
// as bent parametrizations compose to a map that is less so.

#include "figure.hpp"

int fig07_energies(int argc, char** argv) {
  figure::Arguments args = figure::read_arguments(argc, argv, {"hand"});
  const figure::Pair pair = figure::read_pair(args.pairs[0]);
  args.options.coarsest = 0;  // all of it happens on these meshes
  const ism::Result r = figure::optimize(pair, args.options);
  std::vector<ism::IterationLog> log = {r.initial};
  log.insert(log.end(), r.log.begin(), r.log.end());
  std::vector<double> map, f, g;
  for (const ism::IterationLog& it : log) {
    map.push_back(it.map_energy);
    f.push_back(it.energy_f);
    g.push_back(it.energy_g);
  }
  render::Canvas canvas(900, 560);
  canvas.text({20, 30}, 13, "Energies over iterations");
  figure::plot({20, 80, 850, 440},
               {{"E_Phi, of the map", figure::kRed, map},
                {"E_f, of A in the plane", figure::kBlue, f},
                {"E_g, of B in the plane", figure::kGreen, g}},
               canvas);
  canvas.text({400, 548}, 9, "iteration");
  return figure::finish(
      args, canvas,
      {{"the energy of the map falls", map.back() < map.front()},
       {"those of both parametrizations grow", f.back() > f.front() && g.back() > g.front()}});
}

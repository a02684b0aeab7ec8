// figures: redraws the figures of the paper, and some of what goes beyond it. Each is a function in
// the file of its name.
//
//   figures NAME [PAIR ...] [-o PICTURE] [--small] [--iterations N]
//
// `figures` alone lists the names; figure.hpp says what the arguments are. Exit code 0: the picture
// was written, and what the figure says holds; 1: it was not written; 2: there is no such figure;
// 3: it was written, but does not show what it is to show.

#include "figure.hpp"

#include <cstdio>
#include <string>

namespace {

struct Figure {
  const char* name;
  int (*draw)(int argc, char** argv);  // argv[0] is the name
  const char* what;
};

const Figure kFigures[] = {
    {"fig01_end_to_end", fig01_end_to_end,
     "a map of two parametrizations, and one optimised end to end"},
    {"fig03_meta_mesh", fig03_meta_mesh, "the meta mesh on both surfaces"},
    {"fig06_bent_edges", fig06_bent_edges, "edges of a quad that bend with the plane"},
    {"fig07_energies", fig07_energies, "energies over iterations"},
    {"fig08_measures", fig08_measures, "four measures on a pinched quad"},
    {"fig09_variants", fig09_variants,
     "projected Newton, with memory, and with the preconditioner"},
    {"fig10_bad_triangles", fig10_bad_triangles, "a tessellation with bad triangles"},
    {"fig11_starts", fig11_starts, "worse and worse starts"},
    {"fig12_heat_maps", fig12_heat_maps, "heat maps of the distortion"},
    {"fig13_landmarks", fig13_landmarks, "more and more landmarks"},
    {"fig14_quad_template", fig14_quad_template, "a quad template on a target surface"},
    {"fig15_textures", fig15_textures, "textures carried between three shapes"},
    {"sec6_complexity", sec6_complexity, "polygons of the meta mesh per triangle"},
    {"sec7_boundaries", sec7_boundaries, "free, fixed and sliding boundaries"},
    {"openings", openings, "surfaces with openings"},
    {"closed_surfaces", closed_surfaces, "closed surfaces, from their front and from behind"},
};

void list_figures(std::FILE* out) {
  std::fputs("usage: figures NAME [PAIR ...] [-o PICTURE] [--small] [--iterations N]\n\n", out);
  for (const Figure& figure : kFigures) std::fprintf(out, "  %-20s %s\n", figure.name, figure.what);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = argc > 1 ? argv[1] : "--help";
  for (const Figure& figure : kFigures)
    if (name == figure.name) return figure.draw(argc - 1, argv + 1);
  const bool is_asked = name == "--help" || name == "-h";
  if (!is_asked) std::fprintf(stderr, "figures: there is no figure '%s'\n", name.c_str());
  list_figures(is_asked ? stdout : stderr);
  return is_asked ? 0 : 2;
}

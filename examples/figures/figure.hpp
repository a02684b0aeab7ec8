// figure.hpp: what the figures have in common. Each takes
//
//   [PAIR ...] [-o PICTURE] [--small] [--iterations N]
//
// A PAIR is a folder with A.obj, B.obj and landmarks.txt, and perhaps A_quads.obj, the polygons
// that A was cut from; without, those of data/ are drawn. PICTURE is a PNG file, by default named
// after the figure, in the folder the program is started from; --small makes it 0.6 times as wide.

#ifndef ISM_EXAMPLES_FIGURE_HPP
#define ISM_EXAMPLES_FIGURE_HPP

#include "ism.hpp"
#include "map_picture.hpp"
#include "render.hpp"

#include <array>
#include <set>
#include <string>
#include <vector>

// The figures; argv[0] is the name. They return an exit code.
int fig01_end_to_end(int argc, char** argv);
int fig03_meta_mesh(int argc, char** argv);
int fig06_bent_edges(int argc, char** argv);
int fig07_energies(int argc, char** argv);
int fig08_measures(int argc, char** argv);
int fig09_variants(int argc, char** argv);
int fig10_bad_triangles(int argc, char** argv);
int fig11_starts(int argc, char** argv);
int fig12_heat_maps(int argc, char** argv);
int fig13_landmarks(int argc, char** argv);
int fig14_quad_template(int argc, char** argv);
int fig15_textures(int argc, char** argv);
int sec6_complexity(int argc, char** argv);
int sec7_boundaries(int argc, char** argv);
int openings(int argc, char** argv);
int closed_surfaces(int argc, char** argv);

namespace figure {

using Lines = std::vector<std::vector<Eigen::Vector3d>>;  // polylines in space

const render::Color kBlue(0.12f, 0.30f, 0.62f), kRed(0.75f, 0.16f, 0.12f);
const render::Color kGreen(0.20f, 0.55f, 0.25f), kGrey(0.6f, 0.6f, 0.62f);

// ---- Input and output ----

[[noreturn]] void fail(const std::string& message);

using picture::format;

struct Arguments {
  std::vector<std::string> pairs;  // folders
  std::string picture;
  bool is_small = false;
  ism::Options options;
};

/// `pairs` are those of data/ that are drawn if none is named.
Arguments read_arguments(int argc, char** argv, const std::vector<std::string>& pairs);

struct Pair {
  std::string name;  // of its folder
  ism::TriangleMesh a, b;
  std::vector<std::array<int, 2>> edges_a;  // of the polygons of A
  std::vector<ism::Landmark> landmarks;
};

Pair read_pair(const std::string& folder);

/// compute_map() with a line of progress; ends the program where there is no map.
ism::Result optimize(const Pair& pair, const ism::Options& options);
/// initial_embedding(); ends the program where there is none.
ism::Embedding embed(const Pair& pair, const ism::Options& options);
/// The map that was found, its inverse, and the one the optimisation started from.
ism::SurfaceMap map_of(const ism::Result& result);
ism::SurfaceMap inverse_of(const ism::Result& result);
ism::SurfaceMap start_of(const ism::Result& result);
/// Both surfaces embedded one by one, brought together by the landmarks.
ism::SurfaceMap composed(const Pair& pair);
/// One mesh on the surface of another one that lies in the same plane and covers it.
ism::TriangleMesh remeshed(const ism::TriangleMesh& a, const ism::TriangleMesh& b,
                           const ism::Points2& f, const ism::Points2& g);

/// "2.180 on average, below 2.070 on half, 2.31 on 95% of the area".
std::string distortion_words(const ism::SurfaceMap& map);
/// "converged after 57 iterations".
std::string status_words(const ism::Result& result);

// ---- What a figure says ----

/// A sentence about the maps that are drawn, and whether it is true.
struct Claim {
  std::string sentence;
  bool holds;
};

constexpr int kClaimFails = 3;  // exit code

/// Writes the picture, and prints its name and the claims. Returns the exit code.
int finish(const Arguments& args, const render::Canvas& canvas, const std::vector<Claim>& claims);

/// The mean distortion beyond that of an isometry.
double excess(const ism::SurfaceMap& map);
/// Proved to be injective, the meta mesh included.
bool is_proved(const ism::SurfaceMap& map);
/// How far apart on B two maps take the vertices of A, on average, in diagonals of B.
double apart(const ism::SurfaceMap& x, const ism::SurfaceMap& y);
constexpr double kSame = 0.02;  // apart: the same map, up to details

// ---- Meshes and their edges ----

/// All edges of a mesh, each once.
std::vector<std::array<int, 2>> edges_of(const ism::TriangleMesh& mesh);
/// Edges of the mesh on one side, on its own surface, and on that of the other one.
Lines straight(const ism::TriangleMesh& mesh, const std::vector<std::array<int, 2>>& edges);
Lines carried(const picture::Scene& scene, ism::Side from,
              const std::vector<std::array<int, 2>>& edges);
void draw_lines(const render::View& view, const Lines& lines, double width,
                const render::Color& color, render::Canvas& canvas);

// ---- Rows of four panels, 1060 wide ----

constexpr double kRow = 360;  // from one to the next

render::Rect row_panel(int column, double top);
/// A with its texture, B with that of A, and the distortion on both.
void draw_row(const picture::Scene& scene, double top, render::Canvas& canvas);

// ---- The plane ----

/// Edges between points of the plane, in a panel that shows the square from lo to hi.
void draw_plane(const ism::Points2& points, const std::vector<std::array<int, 2>>& edges,
                const Eigen::Vector2d& lo, const Eigen::Vector2d& hi, const render::Rect& panel,
                double width, const render::Color& color, render::Canvas& canvas);

// ---- A quad over a hill ----

/// A shallow hill over picture::square_grid(n).
ism::TriangleMesh hill(int n);

// ---- Plots ----

/// One curve of a plot: the values at x = 0, 1, 2, ...
struct Curve {
  std::string name;
  render::Color color;
  std::vector<double> values;
};

/// Draws curves over iterations, with both axes; their names stand above the rectangle.
void plot(const render::Rect& rect, const std::vector<Curve>& curves, render::Canvas& canvas);

}  // namespace figure

#endif  // ISM_EXAMPLES_FIGURE_HPP

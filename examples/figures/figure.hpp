// figure.hpp: what the programs that redraw the paper's figures have in common.
//
//   FIGURE [PAIR [PICTURE]] [--iterations N]
//
// PAIR is a folder with A.obj, B.obj and landmarks.txt, by default one of data/; PICTURE a PNG
// file, by default named after the program, in the folder it is started from.

#ifndef ISM_EXAMPLES_FIGURE_HPP
#define ISM_EXAMPLES_FIGURE_HPP

#include "ism.hpp"
#include "mesh_io.hpp"
#include "render.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <unistd.h>  // isatty

namespace figure {

[[noreturn]] inline void fail(const std::string& message) {
  std::fprintf(stderr, "%s\n", message.c_str());
  std::exit(1);
}

struct Arguments {
  std::string pair, picture;
  ism::Options options;
};

inline Arguments read_arguments(int argc, char** argv, const std::string& pair,
                                const std::string& picture) {
  Arguments args = {std::string(ISM_SOURCE_DIR) + "/data/" + pair, picture, {}};
  int names = 0;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    long long n = 0;
    if (word == "--iterations") {
      if (++i == argc || !mesh_io::parse_integer(argv[i], n) || n < 0 || n > 100000)
        fail("--iterations needs a number");
      args.options.max_iterations = static_cast<int>(n);
    } else if (word[0] == '-' || ++names > 2) {
      fail("usage: " + std::string(argv[0]) + " [PAIR [PICTURE]] [--iterations N]");
    } else {
      (names == 1 ? args.pair : args.picture) = word;
    }
  }
  return args;
}

struct Pair {
  ism::TriangleMesh a, b;
  std::vector<std::array<int, 2>> edges_a;  // of the polygons of A
  std::vector<ism::Landmark> landmarks;
};

inline Pair read_pair(const std::string& folder) {
  const mesh_io::ReadResult a = mesh_io::read_mesh(folder + "/A.obj");
  const mesh_io::ReadResult b = mesh_io::read_mesh(folder + "/B.obj");
  const mesh_io::PairsResult pairs = mesh_io::read_pairs(folder + "/landmarks.txt");
  if (!a.ok || !b.ok || !pairs.ok) fail(!a.ok ? a.error : !b.ok ? b.error : pairs.error);
  Pair pair = {a.mesh, b.mesh, a.edges, {}};
  for (const mesh_io::IdPair& p : pairs.pairs)
    pair.landmarks.push_back({static_cast<int>(p.a), static_cast<int>(p.b)});
  return pair;
}

/// Runs the optimisation with a line of progress.
inline ism::Result optimize(const Pair& pair, ism::Options options) {
  const bool is_watched = isatty(STDERR_FILENO) != 0;
  options.progress = [is_watched](const ism::Progress& progress) {
    if (is_watched && progress.iteration != nullptr)
      std::fprintf(stderr, "iteration %3d, distortion %.4f\r", progress.iteration->iteration,
                   progress.iteration->mean_distortion);
    return true;
  };
  const ism::Result result = ism::compute_map(pair.a, pair.b, pair.landmarks, options);
  if (!ism::is_usable(result.status)) fail(result.message);
  std::printf("%s after %zu iterations, distortion %.4f\n", ism::to_string(result.status),
              result.log.size(), result.final_state().mean_distortion);
  return result;
}

inline void save(const std::string& path, const render::Canvas& canvas) {
  const std::string error = mesh_io::write_files({{path, render::png_text(canvas.image())}});
  if (!error.empty()) fail(error);
  std::printf("%s\n", path.c_str());
}

/// The vertices on the boundary of a mesh: tails of half-edges without a twin.
inline std::vector<int> boundary_vertices(const ism::TriangleMesh& mesh) {
  std::set<std::pair<int, int>> edges;
  for (Eigen::Index f = 0; f < mesh.triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      edges.insert({mesh.triangles(f, k), mesh.triangles(f, (k + 1) % 3)});
  std::vector<int> vertices;
  for (const auto& [u, v] : edges)
    if (edges.count({v, u}) == 0) vertices.push_back(u);
  return vertices;
}

/// A view across the direction in which a surface extends least, from outside. What is opposite to
/// the boundary goes up: fingers from a wrist, backs from a hole in a belly; where that does not
/// tell, y does.
inline render::View front_view(const ism::TriangleMesh& mesh, const render::Rect& panel) {
  constexpr double kClear = 0.15;  // of the extent
  const ism::Points3 normals = render::smooth_normals(mesh.vertices, mesh.triangles);
  const ism::Vec3 center = mesh.vertices.colwise().mean().transpose();
  const ism::Points3 from_center = mesh.vertices.rowwise() - center.transpose();
  const Eigen::Matrix3d spread = from_center.transpose() * from_center;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(spread);
  ism::Vec3 front = principal.eigenvectors().col(0);
  if (front.dot(normals.colwise().sum().transpose()) < 0) front = -front;
  ism::Vec3 rim = ism::Vec3::Zero();
  const std::vector<int> boundary = boundary_vertices(mesh);
  for (int v : boundary)
    rim += from_center.row(v).transpose() / static_cast<double>(boundary.size());
  ism::Vec3 up = -rim + rim.dot(front) * front;
  if (up.norm() < kClear * from_center.rowwise().norm().maxCoeff()) {
    up = ism::Vec3::UnitY() - front.y() * front;
    if (up.norm() < kClear) up = principal.eigenvectors().col(2);
  }
  up.normalize();
  Eigen::Matrix3d axes;
  axes.row(0) = up.cross(front).transpose();
  axes.row(1) = up.transpose();
  axes.row(2) = front.transpose();
  return render::look_along(mesh.vertices, axes, panel);
}

/// One surface of the meta mesh with a colour for every polygon, shaded as the mesh it refines.
inline render::Shape colored_polygons(const ism::MetaMesh& meta, ism::Side side,
                                      const std::vector<render::Color>& colors) {
  const render::Fans fans = render::fan_out(meta.polygons);
  render::Shape shape;
  shape.vertices = side == ism::Side::kA ? meta.on_a : meta.on_b;
  shape.triangles = fans.triangles;
  const ism::TriangleMesh& mesh = side == ism::Side::kA ? meta.a : meta.b;
  const ism::Attributes normals =
      ism::to_meta(meta, side, ism::Element::kVertex,
                   render::smooth_normals(mesh.vertices, mesh.triangles).rowwise().normalized());
  shape.corner_colors.resize(3 * fans.triangles.rows(), 3);
  shape.corner_normals.resize(3 * fans.triangles.rows(), 3);
  for (Eigen::Index f = 0; f < fans.triangles.rows(); ++f)
    for (Eigen::Index k = 0; k < 3; ++k) {
      const auto polygon = static_cast<std::size_t>(fans.polygon[static_cast<std::size_t>(f)]);
      shape.corner_colors.row(3 * f + k) = colors[polygon].cast<double>().transpose();
      shape.corner_normals.row(3 * f + k) = normals.values.row(fans.corner(f, k));
    }
  return shape;
}

const render::Color kLandmark(0.10f, 0.45f, 0.85f);

constexpr double kWorst = 8;  // the distortion at which the colours of heat() end

/// The colour of a distortion: from 2, an isometry, to kWorst and above, on a logarithmic scale.
inline render::Color heat_of(double density) {
  return render::heat(std::log(density / 2) / std::log(kWorst / 2));
}

inline void draw_heat_legend(const render::Rect& rect, render::Canvas& canvas) {
  canvas.legend(rect, render::heat, "2", "8+", "distortion, 2: isometry");
}

/// Both surfaces of a map, side by side, coloured by its distortion; what is not covered is grey.
inline void draw_distortion(const ism::SurfaceMap& map, const render::Rect& left,
                            const render::Rect& right, render::Canvas& canvas) {
  const ism::MetaMesh meta = map.meta_mesh();
  std::vector<render::Color> colors;
  for (const ism::PolygonDistortion& p : map.distortion()) colors.push_back(heat_of(p.density));
  for (ism::Side side : {ism::Side::kA, ism::Side::kB}) {
    const bool is_a = side == ism::Side::kA;
    const ism::TriangleMesh& mesh = is_a ? meta.a : meta.b;
    const render::View view = front_view(mesh, is_a ? left : right);
    render::Shape whole = render::shape_of(mesh);
    whole.color = {0.6f, 0.6f, 0.62f};
    canvas.draw(view, whole);
    canvas.draw(view, colored_polygons(meta, side, colors), 1);
  }
}

/// "2.180 on average, half of it below 2.070, 95% below 2.31".
inline std::string distortion_words(const ism::SurfaceMap& map) {
  const ism::DistortionSummary d = ism::summarize(map.distortion());
  char words[160];
  std::snprintf(words, sizeof words, "%.3f on average, half of it below %.3f, 95%% below %.2f",
                d.mean, d.median, d.p95);
  return words;
}

/// One curve of a plot: the values at x = 0, 1, 2, ...
struct Curve {
  std::string name;
  render::Color color;
  std::vector<double> values;
};

/// A label for a tick: as many digits as it takes.
inline std::string tick_label(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", x);
  return text;
}

/// Ticks 1, 2, 5, 10, ... times a power of ten, about `count` of them between lo and hi.
inline std::vector<double> ticks(double lo, double hi, int count) {
  const double rough = (hi - lo) / count, power = std::pow(10, std::floor(std::log10(rough)));
  double step = 10 * power;
  for (double factor : {5.0, 2.0, 1.0})
    if (factor * power >= rough) step = factor * power;
  std::vector<double> result;
  for (double x = step * std::ceil(lo / step); x <= hi + 1e-9 * step; x += step)
    result.push_back(std::abs(x) < 1e-9 * step ? 0 : x);
  return result;
}

/// Draws curves over iterations, with both axes; their names stand above the rectangle.
inline void plot(const render::Rect& rect, const std::vector<Curve>& curves,
                 render::Canvas& canvas) {
  constexpr double kText = 9, kLeft = 60, kBelow = 30;
  const render::Color grey(0.85f, 0.85f, 0.85f), black(0.2f, 0.2f, 0.2f);
  double lo = std::numeric_limits<double>::infinity(), hi = -lo;
  std::size_t n = 2;
  for (const Curve& c : curves) {
    n = std::max(n, c.values.size());
    for (double y : c.values) {
      lo = std::min(lo, y);
      hi = std::max(hi, y);
    }
  }
  const double margin = std::max(0.05 * (hi - lo), 1e-9 * (1 + std::abs(hi)));
  lo -= margin;
  hi += margin;
  const double width = rect.width - kLeft, height = rect.height - kBelow;
  const auto at = [&](double x, double y) {
    return ism::Vec2(rect.x + kLeft + width * x / static_cast<double>(n - 1),
                     rect.y + height * (hi - y) / (hi - lo));
  };
  const double last = static_cast<double>(n - 1);
  for (double y : ticks(lo, hi, 6)) {
    canvas.line({at(0, y), at(last, y)}, 1, grey);
    const std::string label = tick_label(y);
    canvas.text(at(0, y) + ism::Vec2(-6 - render::text_width(kText, label), 0.5 * kText), kText,
                label);
  }
  for (double x : ticks(0, last, 8)) {
    const ism::Vec2 foot = at(x, lo);
    canvas.line({foot, foot + ism::Vec2(0, 5)}, 1, black);
    const std::string label = tick_label(x);
    canvas.text(foot + ism::Vec2(-0.5 * render::text_width(kText, label), 20), kText, label);
  }
  canvas.line({at(0, hi), at(0, lo), at(last, lo)}, 1, black);
  double left = rect.x + kLeft;
  for (const Curve& c : curves) {
    std::vector<ism::Vec2> points;
    for (std::size_t i = 0; i < c.values.size(); ++i)
      points.push_back(at(static_cast<double>(i), c.values[i]));
    canvas.line(points, 2, c.color);
    canvas.line({{left, rect.y - 14}, {left + 24, rect.y - 14}}, 3, c.color);
    canvas.text({left + 34, rect.y - 10}, kText, c.name);
    left += 64 + render::text_width(kText, c.name);
  }
}

}  // namespace figure

#endif  // ISM_EXAMPLES_FIGURE_HPP

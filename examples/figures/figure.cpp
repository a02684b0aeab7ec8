// figure.cpp: see figure.hpp.

#include "figure.hpp"
#include "ism_verify.hpp"
#include "mesh_io.hpp"
#include "system.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <set>

namespace figure {

// ==== [1] INPUT AND OUTPUT =======================================================================

void fail(const std::string& message) {
  std::fprintf(stderr, "%s\n", message.c_str());
  std::exit(1);
}

Arguments read_arguments(int argc, char** argv, const std::vector<std::string>& pairs) {
  const std::string name = argv[0];
  Arguments args;
  args.picture = name + ".png";
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    long long n = 0;
    if (word[0] != '-') {
      args.pairs.push_back(word);
    } else if (word == "--small") {
      args.is_small = true;
    } else if (word == "-o" && i + 1 < argc) {
      args.picture = argv[++i];
    } else if (word == "--iterations" && i + 1 < argc && mesh_io::parse_integer(argv[i + 1], n) &&
               n >= 0 && n <= 100000) {
      args.options.max_iterations = static_cast<int>(n);
      ++i;
    } else {
      fail("usage: figures " + name + " [PAIR ...] [-o PICTURE] [--small] [--iterations N]");
    }
  }
  if (pairs.empty() && !args.pairs.empty()) fail(name + " draws no pairs");
  if (args.pairs.empty())
    for (const std::string& pair : pairs)
      args.pairs.push_back(std::string(ISM_SOURCE_DIR) + "/data/" + pair);
  return args;
}

Pair read_pair(const std::string& given) {
  const std::string folder = given.substr(0, given.find_last_not_of('/') + 1);
  const mesh_io::ReadResult a = mesh_io::read_mesh(folder + "/A.obj");
  const mesh_io::ReadResult b = mesh_io::read_mesh(folder + "/B.obj");
  const mesh_io::PairsResult pairs = mesh_io::read_pairs(folder + "/landmarks.txt");
  if (!a.ok || !b.ok || !pairs.ok) fail(!a.ok ? a.error : !b.ok ? b.error : pairs.error);
  Pair pair = {std::filesystem::path(folder).filename().string(), a.mesh, b.mesh, a.edges,
               mesh_io::landmarks_of(pairs)};
  const std::string polygons = folder + "/A_quads.obj";
  if (!std::filesystem::exists(polygons)) return pair;
  const mesh_io::ReadResult quads = mesh_io::read_mesh(polygons);
  if (!quads.ok) fail(quads.error);
  if (quads.mesh.vertices != a.mesh.vertices) fail(polygons + ": not the vertices of A.obj");
  pair.edges_a = quads.edges;
  return pair;
}

ism::Result optimize(const Pair& pair, const ism::Options& given) {
  ism::Options options = given;
  const bool is_watched = system_calls::is_terminal(stderr);
  options.progress = [is_watched](const ism::Progress& progress) {
    if (is_watched && progress.iteration != nullptr)
      std::fprintf(stderr, "iteration %3d, distortion %.4f\r", progress.iteration->iteration,
                   progress.iteration->mean_distortion);
    return true;
  };
  const ism::Result result = ism::compute_map(pair.a, pair.b, pair.landmarks, options);
  if (!ism::is_usable(result.status)) fail(pair.name + ": " + result.message);
  if (options.max_iterations == 0) return result;
  std::printf("%s: %s, distortion %.4f\n", pair.name.c_str(), status_words(result).c_str(),
              result.final_state().mean_distortion);
  return result;
}

ism::Embedding embed(const Pair& pair, const ism::Options& options) {
  const ism::Embedding embedding = ism::initial_embedding(pair.a, pair.b, pair.landmarks, options);
  if (!ism::is_usable(embedding.status)) fail(pair.name + ": " + embedding.message);
  return embedding;
}

ism::TriangleMesh remeshed(const ism::TriangleMesh& a, const ism::TriangleMesh& b,
                           const ism::Points2& f, const ism::Points2& g) {
  const ism::SurfaceMap map(a, b, f, g);
  if (!ism::is_usable(map.status())) fail(map.message());
  return ism::remesh(map, ism::Side::kA);
}

ism::SurfaceMap map_of(const ism::Result& result) { return ism::SurfaceMap(result); }

ism::SurfaceMap inverse_of(const ism::Result& result) {
  return {*result.start.b, *result.start.a, result.g, result.f};
}

ism::SurfaceMap start_of(const ism::Result& result) { return ism::SurfaceMap(result.start); }

ism::SurfaceMap composed(const Pair& pair) {
  ism::Options options;
  options.candidates = false;
  return ism::SurfaceMap(embed(pair, options));
}

std::string distortion_words(const ism::SurfaceMap& map) {
  const ism::DistortionSummary d = ism::summarize(map.distortion());
  return format("%.3f on average, below %.3f on half, %.2f on 95%% of the area", d.mean, d.median,
                d.p95);
}

std::string status_words(const ism::Result& result) {
  return format("%s after %zu iterations", ism::to_string(result.status), result.log.size());
}

// ==== [2] WHAT A FIGURE SAYS =====================================================================

namespace {

void save(const Arguments& args, const render::Canvas& canvas) {
  constexpr int kSmall = 5;  // samples per pixel
  const render::Image image = canvas.image(args.is_small ? kSmall : render::Canvas::kSamples);
  const std::string error = mesh_io::write_files({{args.picture, render::png_text(image)}});
  if (!error.empty()) fail(error);
  std::printf("%s\n", args.picture.c_str());
}

}  // namespace

int finish(const Arguments& args, const render::Canvas& canvas, const std::vector<Claim>& claims) {
  save(args, canvas);
  int code = 0;
  for (const Claim& claim : claims) {
    std::printf("%s: %s\n", claim.holds ? "holds" : "does not hold", claim.sentence.c_str());
    if (!claim.holds) code = kClaimFails;
  }
  return code;
}

double excess(const ism::SurfaceMap& map) { return ism::summarize(map.distortion()).mean - 2; }

bool is_proved(const ism::SurfaceMap& map) { return ism::verify_map(map).status == ism::Status::kDone; }

double apart(const ism::SurfaceMap& x, const ism::SurfaceMap& y) {
  const std::vector<ism::SurfacePoint> by_x = x.forward_vertices(), by_y = y.forward_vertices();
  double sum = 0;
  int n = 0;
  for (std::size_t v = 0; v < std::min(by_x.size(), by_y.size()); ++v) {
    if (!by_x[v].exists() || !by_y[v].exists()) continue;
    sum += (x.position_on_b(by_x[v]) - y.position_on_b(by_y[v])).norm();
    ++n;
  }
  const ism::Points3& b = x.mesh(ism::Side::kB).vertices;
  return sum / (std::max(n, 1) * (b.colwise().maxCoeff() - b.colwise().minCoeff()).norm());
}

// ==== [3] MESHES AND THEIR EDGES =================================================================

std::vector<std::array<int, 2>> edges_of(const ism::TriangleMesh& mesh) {
  std::set<std::array<int, 2>> edges;
  for (Eigen::Index f = 0; f < mesh.triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k) {
      const int u = mesh.triangles(f, k), v = mesh.triangles(f, (k + 1) % 3);
      edges.insert({std::min(u, v), std::max(u, v)});
    }
  return {edges.begin(), edges.end()};
}

Lines straight(const ism::TriangleMesh& mesh, const std::vector<std::array<int, 2>>& edges) {
  Lines lines;
  for (const std::array<int, 2>& e : edges)
    lines.push_back({mesh.vertices.row(e[0]).transpose(), mesh.vertices.row(e[1]).transpose()});
  return lines;
}

Lines carried(const picture::Scene& scene, ism::Side from,
              const std::vector<std::array<int, 2>>& edges) {
  const bool from_a = from == ism::Side::kA;
  const ism::SurfaceMap& map = scene.map;
  Lines lines;
  for (const std::array<int, 2>& e : edges)
    for (const ism::Polyline& line :
         from_a ? map.forward_path({e[0], e[1]}) : map.backward_path({e[0], e[1]})) {
      lines.emplace_back();
      for (const ism::SurfacePoint& p : line)
        lines.back().push_back(from_a ? map.position_on_b(p) : map.position_on_a(p));
    }
  return lines;
}

void draw_lines(const render::View& view, const Lines& lines, double width,
                const render::Color& color, render::Canvas& canvas) {
  for (const std::vector<Eigen::Vector3d>& line : lines)
    canvas.draw_line(view, line, width, color, 2.5);
}

// ==== [4] ROWS OF FOUR PANELS ====================================================================

render::Rect row_panel(int column, double top) {
  constexpr double kWidth = 250, kHeight = 300;
  return {10 + (kWidth + 10) * column, top, kWidth, kHeight};
}

void draw_row(const picture::Scene& scene, double top, render::Canvas& canvas) {
  const ism::Side sides[] = {ism::Side::kA, ism::Side::kB};
  for (int i = 0; i < 2; ++i) {
    picture::draw_texture(scene, sides[i], row_panel(i, top), canvas);
    picture::draw_heat(scene, sides[i], row_panel(2 + i, top), canvas);
  }
}

// ==== [5] THE PLANE ==============================================================================

void draw_plane(const ism::Points2& points, const std::vector<std::array<int, 2>>& edges,
                const Eigen::Vector2d& lo, const Eigen::Vector2d& hi, const render::Rect& panel,
                double width, const render::Color& color, render::Canvas& canvas) {
  const double scale = std::min(panel.width / (hi.x() - lo.x()), panel.height / (hi.y() - lo.y()));
  const Eigen::Vector2d middle(panel.x + 0.5 * panel.width, panel.y + 0.5 * panel.height);
  const auto at = [&](int v) -> Eigen::Vector2d {
    const Eigen::Vector2d p = scale * (points.row(v).transpose() - 0.5 * (lo + hi));
    return {middle.x() + p.x(), middle.y() - p.y()};
  };
  for (const std::array<int, 2>& e : edges) canvas.line({at(e[0]), at(e[1])}, width, color);
}

// ==== [6] A QUAD OVER A HILL =====================================================================

ism::TriangleMesh hill(int n) {
  ism::TriangleMesh mesh = picture::square_grid(n);
  for (int v = 0; v < mesh.vertices.rows(); ++v)
    mesh.vertices(v, 2) = 0.3 * std::exp(-2 * mesh.vertices.row(v).head<2>().squaredNorm());
  return mesh;
}

// ==== [7] PLOTS ==================================================================================

namespace {

/// Ticks 1, 2, 5, 10, ... times a power of ten, about `count` of them between lo and hi.
std::vector<double> ticks(double lo, double hi, int count) {
  const double rough = (hi - lo) / count, power = std::pow(10, std::floor(std::log10(rough)));
  double step = 10 * power;
  for (double factor : {5.0, 2.0, 1.0})
    if (factor * power >= rough) step = factor * power;
  std::vector<double> result;
  for (double x = step * std::ceil(lo / step); x <= hi + 1e-9 * step; x += step)
    result.push_back(std::abs(x) < 1e-9 * step ? 0 : x);
  return result;
}

}  // namespace

void plot(const render::Rect& rect, const std::vector<Curve>& curves, render::Canvas& canvas) {
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
    return Eigen::Vector2d(rect.x + kLeft + width * x / static_cast<double>(n - 1),
                           rect.y + height * (hi - y) / (hi - lo));
  };
  const double last = static_cast<double>(n - 1);
  for (double y : ticks(lo, hi, 6)) {
    canvas.line({at(0, y), at(last, y)}, 1, grey);
    const std::string label = format("%.4g", y);
    canvas.text(at(0, y) + Eigen::Vector2d(-6 - render::text_width(kText, label), 0.5 * kText),
                kText, label);
  }
  for (double x : ticks(0, last, 8)) {
    const Eigen::Vector2d foot = at(x, lo);
    canvas.line({foot, foot + Eigen::Vector2d(0, 5)}, 1, black);
    const std::string label = format("%.4g", x);
    canvas.text(foot + Eigen::Vector2d(-0.5 * render::text_width(kText, label), 20), kText, label);
  }
  canvas.line({at(0, hi), at(0, lo), at(last, lo)}, 1, black);
  double left = rect.x + kLeft;
  for (const Curve& c : curves) {
    std::vector<Eigen::Vector2d> points;
    for (std::size_t i = 0; i < c.values.size(); ++i)
      points.push_back(at(static_cast<double>(i), c.values[i]));
    canvas.line(points, 2, c.color);
    canvas.line({{left, rect.y - 14}, {left + 24, rect.y - 14}}, 3, c.color);
    canvas.text({left + 34, rect.y - 10}, kText, c.name);
    left += 64 + render::text_width(kText, c.name);
  }
}

}  // namespace figure

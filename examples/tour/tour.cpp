// tour.cpp: the program of tour.md, see tour.hpp.
//
//   tour [-o FOLDER] [STEP ...]    draws step_01.png to step_10.png, and checks what is said of
//   them

#include "tour.hpp"
#include "mesh_io.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <set>

namespace {

[[noreturn]] void fail(const std::string& message) {
  std::fprintf(stderr, "tour: %s\n", message.c_str());
  std::exit(1);
}

}  // namespace

namespace tour {

// ==== [1] WHAT A STEP SAYS =======================================================================

void Report::check(bool holds, const std::string& sentence) {
  std::printf("%s: %s\n", holds ? "holds" : "does not hold", sentence.c_str());
  holds_ = holds_ && holds;
}

void Report::check_number(const char* name, double value, double said, double tolerance) {
  check(std::abs(value - said) <= tolerance * std::abs(said),
        format("%s is %.4g, in the text %.4g", name, value, said));
}

void Report::save(const render::Canvas& canvas) {
  const std::string file = format("%s/step_%02d.png", folder_.c_str(), step_);
  const std::string error = mesh_io::write_files({{file, render::png_text(canvas.image())}});
  if (!error.empty()) fail(error);
}

// ==== [2] SURFACES ===============================================================================

Pair read_pair(const std::string& name) {
  const std::string folder = std::string(ISM_SOURCE_DIR) + "/data/" + name;
  const mesh_io::ReadResult a = mesh_io::read_mesh(folder + "/A.obj");
  const mesh_io::ReadResult b = mesh_io::read_mesh(folder + "/B.obj");
  const mesh_io::PairsResult pairs = mesh_io::read_pairs(folder + "/landmarks.txt");
  if (!a.ok || !b.ok || !pairs.ok) fail(!a.ok ? a.error : !b.ok ? b.error : pairs.error);
  return {a.mesh, b.mesh, mesh_io::landmarks_of(pairs)};
}

namespace {

/// The vertex k of ring r of a disk in rings of 6 r vertices around vertex 0.
int ring_vertex(int r, int k) { return r == 0 ? 0 : 1 + 3 * r * (r - 1) + k % (6 * r); }

ism::TriangleMesh disk(int rings) {
  constexpr double kRadius = 1.128, kPi = 3.14159265358979323846;
  ism::TriangleMesh mesh;
  mesh.vertices = ism::Points3::Zero(ring_vertex(rings + 1, 0), 3);
  mesh.triangles.resize(6 * rings * rings, 3);
  int f = 0;
  for (int r = 1; r <= rings; ++r)
    for (int k = 0; k < 6 * r; ++k) {
      const double angle = 2 * kPi * k / (6 * r), radius = kRadius * r / rings;
      mesh.vertices.row(ring_vertex(r, k)) << radius * std::cos(angle), radius * std::sin(angle), 0;
      const int inner = k - k / r;  // of every r edges of a ring, r - 1 have one on the ring inside
      mesh.triangles.row(f++) << ring_vertex(r, k), ring_vertex(r, k + 1),
          ring_vertex(r - 1, inner);
      if (k % r == r - 1) continue;
      mesh.triangles.row(f++) << ring_vertex(r, k + 1), ring_vertex(r - 1, inner + 1),
          ring_vertex(r - 1, inner);
    }
  return mesh;
}

double area(const ism::TriangleMesh& mesh) {
  double sum = 0;
  for (int t = 0; t < mesh.triangles.rows(); ++t) {
    const Eigen::Vector3d a = mesh.vertices.row(mesh.triangles(t, 0)).transpose();
    const Eigen::Vector3d b = mesh.vertices.row(mesh.triangles(t, 1)).transpose();
    const Eigen::Vector3d c = mesh.vertices.row(mesh.triangles(t, 2)).transpose();
    sum += 0.5 * (b - a).cross(c - a).norm();
  }
  return sum;
}

/// A hill over a sheet, which is scaled to area 1.
void raise_hill(double x, double y, ism::TriangleMesh& mesh) {
  constexpr double kHeight = 0.75, kSteepness = 7;
  for (int v = 0; v < mesh.vertices.rows(); ++v) {
    const Eigen::RowVector2d from_top = mesh.vertices.row(v).head<2>() - Eigen::RowVector2d(x, y);
    mesh.vertices(v, 2) = kHeight * std::exp(-kSteepness * from_top.squaredNorm());
  }
  mesh.vertices /= std::sqrt(area(mesh));
}

}  // namespace

Pair sheets(int n) {
  Pair pair = {picture::square_grid(n), disk((n + 1) / 2 + 1), {}};
  raise_hill(-0.3, -0.1, pair.a);
  raise_hill(0.3, 0.1, pair.b);
  return pair;
}

ism::Points2 seen_from_above(const ism::TriangleMesh& sheet) {
  return sheet.vertices.leftCols<2>();
}

// ==== [3] DRAWING ================================================================================

ism::Points3 in_space(const ism::Points2& points) {
  ism::Points3 result = ism::Points3::Zero(points.rows(), 3);
  result.leftCols<2>() = points;
  return result;
}

ism::Points3 stacked(const ism::Points3& x, const ism::Points3& y) {
  ism::Points3 result(x.rows() + y.rows(), 3);
  result << x, y;
  return result;
}

Eigen::Matrix3d from_the_front() {
  return Eigen::AngleAxisd(-0.85, Eigen::Vector3d::UnitX()).toRotationMatrix();
}

void draw_surface(const render::View& view, const ism::TriangleMesh& mesh,
                  const render::Color& color, render::Canvas& canvas) {
  render::Shape shape = render::shape_of(mesh);
  shape.color = color;
  canvas.draw(view, shape);
}

namespace {

std::set<std::array<int, 2>> edges_of(const ism::Triangles& triangles) {
  std::set<std::array<int, 2>> edges;
  for (Eigen::Index f = 0; f < triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k) {
      const int u = triangles(f, k), v = triangles(f, (k + 1) % 3);
      edges.insert({std::min(u, v), std::max(u, v)});
    }
  return edges;
}

}  // namespace

void draw_edges(const render::View& view, const ism::Points3& points,
                const ism::Triangles& triangles, double width, const render::Color& color,
                render::Canvas& canvas) {
  for (const std::array<int, 2>& e : edges_of(triangles))
    canvas.draw_line(view, {points.row(e[0]).transpose(), points.row(e[1]).transpose()}, width,
                     color);
}

void draw_carried_edges(const render::View& view, const ism::SurfaceMap& map, ism::Side from,
                        double width, const render::Color& color, render::Canvas& canvas) {
  const bool from_a = from == ism::Side::kA;
  for (const std::array<int, 2>& e : edges_of(map.mesh(from).triangles))
    for (const ism::Polyline& line :
         from_a ? map.forward_path({e[0], e[1]}) : map.backward_path({e[0], e[1]})) {
      std::vector<Eigen::Vector3d> points;
      for (const ism::SurfacePoint& p : line)
        points.push_back(from_a ? map.position_on_b(p) : map.position_on_a(p));
      canvas.draw_line(view, points, width, color);
    }
}

void draw_arrow(const Eigen::Vector2d& p, const Eigen::Vector2d& q, double width,
                const render::Color& color, render::Canvas& canvas) {
  const Eigen::Vector2d along = q - p;
  if (along.norm() < 1) return;
  const double head = std::min(2.5 * width + 3, 0.6 * along.norm());
  const Eigen::Vector2d back = head * along.normalized(), side(-back.y(), back.x());
  canvas.line({p, q}, width, color);
  canvas.line({q - back + 0.5 * side, q, q - back - 0.5 * side}, width, color);
}

void draw_dot(const Eigen::Vector2d& p, double radius, const render::Color& color,
              render::Canvas& canvas) {
  canvas.line({p, p + Eigen::Vector2d(0.01, 0)}, 2 * radius, color);
}

namespace {

/// About `count` round numbers between lo and hi.
std::vector<double> ticks(double lo, double hi, int count) {
  if (!std::isfinite(hi - lo) || hi <= lo) return {};
  const double rough = (hi - lo) / count, power = std::pow(10, std::floor(std::log10(rough)));
  double step = 10 * power;
  for (double factor : {5.0, 2.0, 1.0})
    if (factor * power >= rough) step = factor * power;
  std::vector<double> result;
  for (double x = step * std::ceil(lo / step - 1e-9); x <= hi + 1e-9 * step; x += step)
    result.push_back(std::abs(x) < 1e-9 * step ? 0 : x);
  return result;
}

}  // namespace

Plot::Plot(const render::Rect& rect, const Eigen::Vector2d& lo, const Eigen::Vector2d& hi,
           render::Canvas& canvas)
    : rect_(rect), lo_(lo), hi_(hi), canvas_(canvas) {
  constexpr double kText = 9;
  const render::Color pale(0.86f, 0.86f, 0.86f);
  for (double y : ticks(lo.y(), hi.y(), 5)) {
    const std::string label = format("%.4g", y);
    canvas.line({at(lo.x(), y), at(hi.x(), y)}, 1, pale);
    canvas.text(at(lo.x(), y) + Eigen::Vector2d(-8 - render::text_width(kText, label), 4), kText,
                label);
  }
  for (double x : ticks(lo.x(), hi.x(), 6)) {
    const std::string label = format("%.4g", x);
    canvas.line({at(x, lo.y()), at(x, lo.y()) + Eigen::Vector2d(0, 5)}, 1, kInk);
    canvas.text(at(x, lo.y()) + Eigen::Vector2d(-0.5 * render::text_width(kText, label), 20), kText,
                label);
  }
  canvas.line({at(lo.x(), hi.y()), at(lo.x(), lo.y()), at(hi.x(), lo.y())}, 1, kInk);
}

Eigen::Vector2d Plot::at(double x, double y) const {
  return {rect_.x + rect_.width * (x - lo_.x()) / (hi_.x() - lo_.x()),
          rect_.y + rect_.height * (hi_.y() - y) / (hi_.y() - lo_.y())};
}

void Plot::curve(const std::vector<Eigen::Vector2d>& points, const render::Color& color,
                 double width) {
  std::vector<Eigen::Vector2d> line;
  for (const Eigen::Vector2d& p : points) {
    const bool is_inside =
        lo_.x() <= p.x() && p.x() <= hi_.x() && lo_.y() <= p.y() && p.y() <= hi_.y();
    if (is_inside) line.push_back(at(p.x(), p.y()));
    if (is_inside && &p != &points.back()) continue;
    canvas_.line(line, width, color);
    line.clear();
  }
}

void Plot::dot(double x, double y, const render::Color& color, double radius) {
  draw_dot(at(x, y), radius, color, canvas_);
}

}  // namespace tour

// ==== [4] THE PROGRAM ============================================================================

int main(int argc, char** argv) {
  using Step = void (*)(tour::Report&);
  const std::array<Step, 10> steps = {step_01, step_02, step_03, step_04, step_05,
                                      step_06, step_07, step_08, step_09, step_10};
  std::string folder = ".";
  std::set<long long> wanted;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    long long n = 0;
    if (word == "-o" && i + 1 < argc) {
      folder = argv[++i];
    } else if (mesh_io::parse_integer(argv[i], n) && 1 <= n && n <= 10) {
      wanted.insert(n);
    } else {
      fail("usage: tour [-o FOLDER] [STEP ...]");
    }
  }
  bool holds = true;
  for (int n = 1; n <= 10; ++n) {
    if (!wanted.empty() && wanted.count(n) == 0) continue;
    std::printf("---- step %d ----\n", n);
    tour::Report report(n, folder);
    steps[static_cast<std::size_t>(n) - 1](report);
    holds = holds && report.holds();
  }
  return holds ? 0 : 3;
}

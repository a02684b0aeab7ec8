// Fig. 10 of the paper: A is tessellated evenly; of B, 43% of the triangles have an angle below 10
// degrees, made by edge flips. Heat maps of the distortion of two parametrizations, composed, and of the map.

#include "figure.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;
constexpr double kBad = 10 * kDegree, kWorst = 0.5 * kDegree;  // angles
constexpr double kShare = 0.43;
constexpr double kBend = 0.7;  // least cosine between normals before and after a flip

double least_angle(const ism::TriangleMesh& mesh, const std::array<int, 3>& t) {
  double least = 180 * kDegree;
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d p = mesh.vertices.row(t[k]);
    const Eigen::Vector3d u = mesh.vertices.row(t[(k + 1) % 3]).transpose() - p;
    const Eigen::Vector3d v = mesh.vertices.row(t[(k + 2) % 3]).transpose() - p;
    least = std::min(least, std::atan2(u.cross(v).norm(), u.dot(v)));
  }
  return least;
}

Eigen::Vector3d normal(const ism::TriangleMesh& mesh, const std::array<int, 3>& t) {
  const Eigen::Vector3d p = mesh.vertices.row(t[0]);
  const Eigen::Vector3d u = mesh.vertices.row(t[1]).transpose() - p;
  const Eigen::Vector3d v = mesh.vertices.row(t[2]).transpose() - p;
  return u.cross(v).normalized();
}

/// Flips edges of a mesh by lot, where that mends no bad triangle and does not fold the surface.
class Spoiler {
 public:
  explicit Spoiler(ism::TriangleMesh& mesh) : mesh_(mesh) {
    for (int f = 0; f < mesh.triangles.rows(); ++f) enter(f, corners(f));
  }

  /// The share of triangles with a bad angle.
  double share() const {
    int bad = 0;
    for (int f = 0; f < mesh_.triangles.rows(); ++f) bad += is_bad(corners(f));
    return bad / static_cast<double>(mesh_.triangles.rows());
  }

  void run() {
    constexpr int kRounds = 400;
    std::mt19937 random(1);
    for (int round = 0; round < kRounds && share() < kShare; ++round)
      for (int n = static_cast<int>(mesh_.triangles.rows()) / 10; n > 0; --n) {
        const int f = static_cast<int>(random() % static_cast<unsigned>(mesh_.triangles.rows()));
        const int k = static_cast<int>(random() % 3);
        flip(mesh_.triangles(f, k), mesh_.triangles(f, (k + 1) % 3));
        if (n % 50 == 0 && share() >= kShare) return;
      }
  }

 private:
  std::array<int, 3> corners(int f) const {
    return {mesh_.triangles(f, 0), mesh_.triangles(f, 1), mesh_.triangles(f, 2)};
  }
  void enter(int f, const std::array<int, 3>& t) {
    mesh_.triangles.row(f) << t[0], t[1], t[2];
    for (std::size_t k = 0; k < 3; ++k) face_[{t[k], t[(k + 1) % 3]}] = f;
  }
  int is_bad(const std::array<int, 3>& t) const { return least_angle(mesh_, t) < kBad; }
  int opposite(int f, int u, int v) const {
    for (int w : corners(f))
      if (w != u && w != v) return w;
    return -1;
  }

  void flip(int u, int v) {
    if (face_.count({v, u}) == 0) return;  // on the boundary
    const int left = face_[{u, v}], right = face_[{v, u}];
    const int w = opposite(left, u, v), x = opposite(right, u, v);
    if (face_.count({w, x}) > 0 || face_.count({x, w}) > 0) return;
    const std::array<int, 3> first = {u, x, w}, second = {x, v, w};
    if (std::min(least_angle(mesh_, first), least_angle(mesh_, second)) < kWorst) return;
    if (is_bad(first) + is_bad(second) < is_bad(corners(left)) + is_bad(corners(right))) return;
    for (int f : {left, right})
      for (const std::array<int, 3>& t : {first, second})
        if (normal(mesh_, corners(f)).dot(normal(mesh_, t)) < kBend) return;
    face_.erase({u, v});
    face_.erase({v, u});
    enter(left, first);
    enter(right, second);
  }

  ism::TriangleMesh& mesh_;
  std::map<std::array<int, 2>, int> face_;  // left of every directed edge
};

}  // namespace

int fig10_bad_triangles(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {"hand"});
  figure::Pair pair = figure::read_pair(args.pairs[0]);
  Spoiler spoiler(pair.b);
  spoiler.run();
  const double share = spoiler.share();
  std::printf("%.1f%% of the triangles of B have an angle below 10 degrees\n", 100 * share);
  const ism::Result r = figure::optimize(pair, args.options);
  const picture::Scene end = picture::scene_of(figure::map_of(r));
  const picture::Scene start = picture::scene_of(figure::composed(pair), end.axes);
  const auto panel = [](int column) -> render::Rect { return {10.0 + 320 * column, 60, 300, 560}; };
  render::Canvas canvas(1290, 740);
  for (int i = 0; i < 2; ++i) {
    const ism::Side side = i == 0 ? ism::Side::kA : ism::Side::kB;
    picture::draw_plain(end, side, panel(i), canvas);
    const ism::TriangleMesh& mesh = end.mesh(side);
    figure::draw_lines(end.view(side, panel(i)), figure::straight(mesh, figure::edges_of(mesh)),
                       0.6, figure::kBlue, canvas);
  }
  picture::draw_heat(start, ism::Side::kB, panel(2), canvas);
  picture::draw_heat(end, ism::Side::kB, panel(3), canvas);
  canvas.text({20, 34}, 14, "A");
  canvas.text({340, 34}, 14, figure::format("B, %.0f%% bad triangles", 100 * share));
  canvas.text({660, 34}, 14, figure::format("composed, %.3f", 2 + figure::excess(start.map)));
  canvas.text({980, 34}, 14, figure::format("map, %.3f", 2 + figure::excess(end.map)));
  canvas.text({20, 720}, 10, figure::status_words(r));
  picture::draw_heat_legend({800, 680, 320, 16}, canvas);
  return figure::finish(args, canvas,
                        {{"43% of the triangles of B are bad", share >= kShare},
                         {"the run converges within 400 iterations",
                          r.status == ism::Status::kConverged && r.log.size() < 400},
                         {"most of the distortion of the composition was not needed",
                          figure::excess(end.map) < 0.5 * figure::excess(start.map)}});
}

// morph.hpp: shapes between the two surfaces of a map of ism.hpp, as rigid as possible.
//
//   const morphing::Morph morph(map, result.f, result.g);
//   if (morph.ok()) draw(morph.at(0.5));  // where the vertices of map.meta_mesh() are halfway
//
// What:    At 0 and 1 the surfaces A and B, up to rounding; between, limbs swing instead of taking
//          the short way through the body. Exchanging A and B gives the same shapes. For surfaces
//          of about the same size.
// How:     On every polygon of the meta mesh, Φ turns and stretches. At t the polygon is turned by
//          its share of the rotation and stretched linearly, from A and from B; the edges of all
//          polygons then fit together in least squares, with one matrix for all t.
// Source:  Alexa, Cohen-Or and Levin, As-Rigid-As-Possible Shape Interpolation, SIGGRAPH 2000.

#ifndef ISM_EXAMPLES_MORPH_HPP
#define ISM_EXAMPLES_MORPH_HPP

#include "ism.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace morphing {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

// ---- rotations ----

/// The rotation by the length of a vector about its direction.
inline Mat3 rotation(const Vec3& v) {
  const double angle = v.norm();
  if (angle == 0) return Mat3::Identity();
  return Eigen::AngleAxisd(angle, v / angle).toRotationMatrix();
}

/// The rotation closest to a matrix, by Newton's iteration [Higham 1986]; the identity if it has no
/// positive determinant.
inline Mat3 closest_rotation(const Mat3& M) {
  constexpr int kMostIterations = 100;
  Mat3 R = M;
  if (!(R.determinant() > 0)) return Mat3::Identity();
  for (int i = 0; i < kMostIterations; ++i) {
    const Mat3 better = 0.5 * (R + R.inverse().transpose());
    const bool is_done = (better - R).squaredNorm() < 1e-30;
    R = better;
    if (is_done) break;
  }
  return R;
}

/// The vector of a rotation that is closest to another vector: turning by an angle more or less of
/// 2π is the same.
inline Vec3 rotation_vector(const Mat3& R, const Vec3& near) {
  constexpr double kTwoPi = 2 * 3.14159265358979323846;
  const Eigen::Quaterniond q(R);
  const double sine = q.vec().norm(), angle = 2 * std::atan2(sine, std::abs(q.w()));
  Vec3 axis = near.norm() > 0 ? Vec3(near / near.norm()) : Vec3::UnitX();  // where R turns nothing
  if (sine > 1e-9) axis = (q.w() < 0 ? -1 / sine : 1 / sine) * q.vec();
  return (angle + kTwoPi * std::round((near.dot(axis) - angle) / kTwoPi)) * axis;
}

// ---- polygons of the meta mesh ----

/// What a step along x, and along y, in the plane is on a triangle in space, and its normal.
struct Lift {
  Mat3 columns;
  double area;  // of the triangle in space
};

inline Lift lift_of(const ism::TriangleMesh& mesh, const ism::Points2& plane, int face) {
  Eigen::Matrix<double, 3, 2> space;
  Eigen::Matrix2d flat;
  const int first = mesh.triangles(face, 0);
  for (int k = 0; k < 2; ++k) {
    const int v = mesh.triangles(face, k + 1);
    space.col(k) = (mesh.vertices.row(v) - mesh.vertices.row(first)).transpose();
    flat.col(k) = (plane.row(v) - plane.row(first)).transpose();
  }
  const Vec3 normal = space.col(0).cross(space.col(1));
  Lift lift = {Mat3(), 0.5 * normal.norm()};
  lift.columns << space * flat.inverse(), normal.normalized();
  return lift;
}

struct Polygon {
  double area;    // mean of those on A and on B
  Mat3 rotation;  // of Φ, from A to B
  bool is_flat;   // has no area: its two triangles need not lie on each other elsewhere
};

inline std::vector<Polygon> polygons_of(const ism::SurfaceMap& map, const ism::MetaMesh& meta,
                                        const ism::Points2& f, const ism::Points2& g) {
  constexpr double kNoise = 2e-12;  // of the triangle that is smaller in the plane
  std::vector<Polygon> polygons;
  for (const ism::PolygonDistortion& d : map.distortion(true)) {
    const std::size_t p = polygons.size();
    const Lift a = lift_of(*meta.a, f, meta.face_a[p]), b = lift_of(*meta.b, g, meta.face_b[p]);
    // Φ is affine: a polygon is as large a part of a triangle in the plane as it is in space.
    const double share = (std::max)(d.area_a / a.area, d.area_b / b.area);
    polygons.push_back({0.5 * (d.area_a + d.area_b),
                        closest_rotation(b.columns * a.columns.inverse()), !(share > kNoise)});
  }
  return polygons;
}

// ---- shapes ----

/// The shapes between A and B. Thread-safe.
class Morph {
 public:
  /// Factorises a matrix of the size of the meta mesh. f and g are those that the map was made of.
  Morph(const ism::SurfaceMap& map, const ism::Points2& f, const ism::Points2& g) {
    if (map.status() != ism::Status::kDone) return;
    const ism::MetaMesh meta = map.meta_mesh(ism::Ids::kEmbedded);
    const std::vector<Polygon> polygons = polygons_of(map, meta, f, g);
    collect_edges(meta, polygons);
    align(meta, polygons);
    find_turns(meta, polygons);
    factorize();
  }

  /// False if the map cannot be used, or the factorisation fails.
  bool ok() const { return is_ok_; }

  /// A row per vertex of the meta mesh, for any t; no rows unless ok(). A solve with the factor.
  ism::Points3 at(double t) const {
    if (!ok()) return ism::Points3(0, 3);
    ism::Points3 x = factor_.solve(wanted_edges(t));
    move(center_of(x), rotation(t * whole_turn_), (1 - t) * center_a_ + t * center_b_, x);
    return x;
  }

 private:
  /// An edge of a polygon, from vertex i to j of the meta mesh.
  struct Edge {
    int i, j;
    std::size_t polygon;
    double weight;
  };

  /// Edges with weight area / length², as in ∫ ‖∇x‖², kept within bounds where polygons are thin.
  void collect_edges(const ism::MetaMesh& meta, const std::vector<Polygon>& polygons) {
    constexpr double kLeast = 1e-4;
    mass_.setZero(meta.on_a.rows());
    for (std::size_t p = 0; p < polygons.size(); ++p) {
      const double area = polygons[p].area;
      const int first = meta.offsets[p], last = meta.offsets[p + 1];
      for (int c = first; c < last; ++c) {
        const int i = meta.corners[static_cast<std::size_t>(c)];
        const int j = meta.corners[static_cast<std::size_t>(c + 1 < last ? c + 1 : first)];
        const double square = 0.5 * ((meta.on_a.row(i) - meta.on_a.row(j)).squaredNorm() +
                                     (meta.on_b.row(i) - meta.on_b.row(j)).squaredNorm());
        const double weight = square > area ? area / square : 1;
        edges_.push_back({i, j, p, (std::max)(weight, kLeast)});
        mass_[i] += area / (last - first);
      }
    }
    mass_ /= mass_.sum();
  }

  /// Centres A and B, and turns B back by the mean rotation of Φ.
  void align(const ism::MetaMesh& meta, const std::vector<Polygon>& polygons) {
    Mat3 mean = Mat3::Zero();
    double total = 0;
    for (const Polygon& p : polygons) {
      if (!p.is_flat) mean += p.area * p.rotation;
      total += p.area;
    }
    whole_ = closest_rotation(mean / total);
    whole_turn_ = rotation_vector(whole_, Vec3::Zero());
    a_ = meta.on_a;
    b_ = meta.on_b;
    center_a_ = center_of(a_);
    center_b_ = center_of(b_);
    move(center_a_, Mat3::Identity(), Vec3::Zero(), a_);
    move(center_b_, whole_.transpose(), Vec3::Zero(), b_);
  }

  Vec3 center_of(const ism::Points3& x) const {
    Vec3 center = Vec3::Zero();
    for (Eigen::Index i = 0; i < x.rows(); ++i) center += mass_[i] * x.row(i).transpose();
    return center;
  }

  /// Turns points about `from`, which comes to lie at `to`.
  static void move(const Vec3& from, const Mat3& R, const Vec3& to, ism::Points3& x) {
    for (Eigen::Index i = 0; i < x.rows(); ++i) {
      const Vec3 p = x.row(i).transpose() - from;
      x.row(i) = (R * p + to).transpose();
    }
  }

  /// From the polygon that turns least over its neighbours to all, so that turns differ little
  /// where Φ does. Turns by a full one have no direction; beyond them, neighbours may differ.
  void find_turns(const ism::MetaMesh& meta, const std::vector<Polygon>& polygons) {
    const std::vector<std::vector<std::size_t>> neighbours = neighbouring(polygons.size());
    const auto turn = [&](std::size_t p, const Vec3& near) -> Vec3 {
      if (polygons[p].is_flat) return near;
      return rotation_vector(whole_.transpose() * polygons[p].rotation, near);
    };
    std::vector<std::pair<double, std::size_t>> starts;
    for (std::size_t p = 0; p < polygons.size(); ++p)
      starts.emplace_back(polygons[p].is_flat ? std::numeric_limits<double>::infinity()
                                              : turn(p, Vec3::Zero()).norm(),
                          p);
    std::sort(starts.begin(), starts.end());
    turn_.resize(polygons.size());
    std::vector<char> is_known(polygons.size(), 0);
    for (const auto& [angle, start] : starts) {  // more than one if the overlap has more parts
      if (is_known[start]) continue;
      is_known[start] = 1;
      turn_[start] = turn(start, Vec3::Zero());
      anchors_.push_back(meta.corners[static_cast<std::size_t>(meta.offsets[start])]);
      std::vector<std::size_t> queue = {start};
      for (std::size_t i = 0; i < queue.size(); ++i)
        for (const std::size_t p : neighbours[queue[i]]) {
          if (is_known[p]) continue;
          is_known[p] = 1;
          turn_[p] = turn(p, turn_[queue[i]]);
          queue.push_back(p);
        }
    }
  }

  /// Polygons with a common edge.
  std::vector<std::vector<std::size_t>> neighbouring(std::size_t n_polygons) const {
    std::vector<std::pair<std::array<int, 2>, std::size_t>> sides;  // smaller end first, polygon
    for (const Edge& e : edges_)
      sides.push_back({{(std::min)(e.i, e.j), (std::max)(e.i, e.j)}, e.polygon});
    std::sort(sides.begin(), sides.end());
    std::vector<std::vector<std::size_t>> neighbours(n_polygons);
    for (std::size_t i = 1; i < sides.size(); ++i) {
      if (sides[i - 1].first != sides[i].first) continue;
      neighbours[sides[i - 1].second].push_back(sides[i].second);
      neighbours[sides[i].second].push_back(sides[i - 1].second);
    }
    return neighbours;
  }

  /// Σ w (x_i - x_j)² + Σ x_anchor² as a matrix, its lower triangle.
  void factorize() {
    std::vector<Eigen::Triplet<double>> entries;
    for (const int i : anchors_) entries.emplace_back(i, i, 1.0);
    for (const Edge& e : edges_) {
      entries.emplace_back(e.i, e.i, e.weight);
      entries.emplace_back(e.j, e.j, e.weight);
      entries.emplace_back((std::max)(e.i, e.j), (std::min)(e.i, e.j), -e.weight);
    }
    Eigen::SparseMatrix<double> matrix(a_.rows(), a_.rows());
    matrix.setFromTriplets(entries.begin(), entries.end());
    factor_.compute(matrix);
    is_ok_ = factor_.info() == Eigen::Success;
  }

  /// The right-hand side of the least squares problem for the shape at t.
  ism::Points3 wanted_edges(double t) const {
    ism::Points3 sum = ism::Points3::Zero(a_.rows(), 3);
    Mat3 part, back;
    const Edge* last = nullptr;
    for (const Edge& e : edges_) {
      if (last == nullptr || last->polygon != e.polygon) {
        part = (1 - t) * rotation(t * turn_[e.polygon]).transpose();
        back = t * rotation((t - 1) * turn_[e.polygon]).transpose();
      }
      last = &e;
      const Eigen::RowVector3d on_a = a_.row(e.i) - a_.row(e.j), on_b = b_.row(e.i) - b_.row(e.j);
      const Eigen::RowVector3d edge = e.weight * (on_a * part + on_b * back);
      sum.row(e.i) += edge;
      sum.row(e.j) -= edge;
    }
    for (const int i : anchors_) sum.row(i) += (1 - t) * a_.row(i) + t * b_.row(i);
    return sum;
  }

  std::vector<Edge> edges_;         // of all polygons, one after the other
  Eigen::VectorXd mass_;            // of the vertices, sum 1
  Mat3 whole_ = Mat3::Identity();   // how B is turned with respect to A
  Vec3 whole_turn_ = Vec3::Zero();  // the same as a vector
  Vec3 center_a_, center_b_;
  ism::Points3 a_, b_;        // the vertices, centred; those on B turned back by the whole turn
  std::vector<Vec3> turn_;    // of every polygon, on top of it
  std::vector<int> anchors_;  // one vertex of every part of the overlap, interpolated linearly
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;  // of the weighted graph Laplacian
  bool is_ok_ = false;
};

}  // namespace morphing

#endif  // ISM_EXAMPLES_MORPH_HPP

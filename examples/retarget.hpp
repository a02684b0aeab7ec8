// retarget.hpp: what a map of ism.hpp from one character to another says about values at vertices,
// about directions, and about joints inside. Part of the examples of ism.hpp.
//
//   retarget::Carrier carrier(map);
//   ism::Values weights_b = carrier.at_vertices(weights_a);   // every vertex of B has some
//   std::vector<retarget::Similarity> turns = carrier.turns();
//
// Source: S. Umeyama, Least-Squares Estimation of Transformation Parameters Between Two Point
// Patterns, PAMI 13(4), 1991.

#ifndef ISM_EXAMPLES_RETARGET_HPP
#define ISM_EXAMPLES_RETARGET_HPP

#include "ism.hpp"
#include "landmarks.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

namespace retarget {

/// Turns, scales and moves: y = to + scale · rotation · (x - from).
struct Similarity {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  double scale = 1;
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = from;

  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const {
    return to + scale * (rotation * (x - from));
  }
};

/// Sums over points x and their images y, from which a similarity follows.
struct Moments {
  double weight = 0, xx = 0, yy = 0;
  Eigen::Vector3d x = Eigen::Vector3d::Zero(), y = x;
  Eigen::Matrix3d yx = Eigen::Matrix3d::Zero();

  void add(double w, const Eigen::Vector3d& p, const Eigen::Vector3d& image) {
    weight += w;
    x += w * p;
    y += w * image;
    xx += w * p.squaredNorm();
    yy += w * image.squaredNorm();
    yx += w * image * p.transpose();
  }
  Moments& operator+=(const Moments& other) {
    weight += other.weight;
    x += other.x;
    y += other.y;
    xx += other.xx;
    yy += other.yy;
    yx += other.yx;
    return *this;
  }
};

/// The similarity that is closest to what the sums are of; `otherwise` if they do not tell.
inline Similarity fit(const Moments& sums, const Similarity& otherwise = {});

/// A bone of a skeleton: its frame in the bind pose. Parents come before their children.
struct Bone {
  int parent = -1;
  Eigen::Matrix4d bind = Eigen::Matrix4d::Identity();
};

/// The frames of the bones in B. `weights`: #V×#bones, how much every vertex of A follows each
/// bone; `images`: where these vertices go, rows that are not finite are left out.
///
/// A bone turns as the vertices do that follow it. Its origin keeps its place among the vertices
/// around it that follow it or its parent: the nearest ones count most. Bones that no vertex
/// follows go with their parent. Frames keep their scale.
inline std::vector<Eigen::Matrix4d> place_bones(const std::vector<Bone>& bones,
                                                const ism::Values& weights,
                                                const ism::TriangleMesh& a,
                                                const ism::Points3& images);

/// How the whole of A turns and scales.
inline Similarity fit_all(const ism::TriangleMesh& a, const ism::Points3& images);

/// Vertices of B in the map: their own values; others: those of the nearest point that is.
class Carrier {
 public:
  /// copies_of: per vertex of B, itself, or the vertex in the map whose copy it is.
  Carrier(const ism::SurfaceMap& map, std::vector<int> copies_of);

  /// False for vertices that take the values of the nearest mapped surface.
  bool is_mapped(int vertex) const { return nearest_[index(copies_of_[index(vertex)])].face < 0; }
  const ism::MetaMesh& meta() const { return meta_; }

  /// Values of the vertices of A at all vertices of B.
  ism::Values at_vertices(const ism::Values& of_a) const;
  /// How the map turns and scales what is around each vertex of B.
  std::vector<Similarity> turns() const;

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  void complete(ism::Values& values) const;
  std::vector<Moments> vertex_moments() const;
  std::vector<int> representatives() const;

  ism::MetaMesh meta_;
  ism::Transfer transfer_;
  std::vector<int> copies_of_;
  std::vector<ism::SurfacePoint> nearest_;  // per vertex of B; no face: it is mapped
};

namespace detail {

/// The nearest of some triangles, found in a tree of boxes.
class NearestTriangle {
 public:
  NearestTriangle(const ism::TriangleMesh& mesh, std::vector<int> triangles)
      : mesh_(mesh), triangles_(std::move(triangles)) {
    if (!triangles_.empty()) build(0, static_cast<int>(triangles_.size()));
  }

  ism::SurfacePoint find(const Eigen::Vector3d& p) const {
    ism::SurfacePoint best;
    double distance = std::numeric_limits<double>::infinity();
    if (!boxes_.empty()) search(0, p, best, distance);
    return best;
  }

 private:
  static constexpr int kLeaf = 4;  // triangles
  struct Box {
    Eigen::AlignedBox3d box;
    int begin, end, left = -1, right = -1;
  };

  Eigen::Matrix3d corners(int i) const {
    Eigen::Matrix3d points;
    for (int k = 0; k < 3; ++k)
      points.col(k) =
          mesh_.vertices.row(mesh_.triangles(triangles_[static_cast<std::size_t>(i)], k));
    return points;
  }

  int build(int begin, int end) {
    Box box = {{}, begin, end};
    for (int i = begin; i < end; ++i)
      for (int k = 0; k < 3; ++k) box.box.extend(Eigen::Vector3d(corners(i).col(k)));
    const std::size_t id = boxes_.size();
    boxes_.push_back(box);
    if (end - begin > kLeaf) {
      Eigen::Index axis = 0;
      box.box.sizes().maxCoeff(&axis);
      const auto middle = [&](int f) {
        double sum = 0;
        for (int k = 0; k < 3; ++k) sum += mesh_.vertices(mesh_.triangles(f, k), axis);
        return sum;
      };
      const auto first = triangles_.begin();
      const int half = (begin + end) / 2;
      std::nth_element(first + begin, first + half, first + end,
                       [&](int f, int g) { return middle(f) < middle(g); });
      const int left = build(begin, half), right = build(half, end);
      boxes_[id].left = left;
      boxes_[id].right = right;
    }
    return static_cast<int>(id);
  }

  void search(int id, const Eigen::Vector3d& p, ism::SurfacePoint& best, double& distance) const {
    const Box& box = boxes_[static_cast<std::size_t>(id)];
    if (box.box.exteriorDistance(p) >= distance) return;
    if (box.left < 0) {
      for (int i = box.begin; i < box.end; ++i) visit(i, p, best, distance);
      return;
    }
    const auto far = [&](int child) {
      return boxes_[static_cast<std::size_t>(child)].box.exteriorDistance(p);
    };
    const bool swap = far(box.right) < far(box.left);
    search(swap ? box.right : box.left, p, best, distance);
    search(swap ? box.left : box.right, p, best, distance);
  }

  void visit(int i, const Eigen::Vector3d& p, ism::SurfacePoint& best, double& distance) const {
    const Eigen::Matrix3d points = corners(i);
    const Eigen::Vector3d normal =
        (points.col(1) - points.col(0)).cross(points.col(2) - points.col(0));
    if (!(normal.squaredNorm() > 0)) return;
    const Eigen::Vector3d weights = landmarks::detail::nearest_in(points, normal, p);
    const double d = (points * weights - p).norm();
    if (!(d < distance)) return;
    distance = d;
    best = {triangles_[static_cast<std::size_t>(i)], weights};
  }

  const ism::TriangleMesh& mesh_;
  std::vector<int> triangles_;
  std::vector<Box> boxes_;
};

/// A third of the area of the triangles around each vertex.
inline std::vector<double> vertex_areas(const ism::TriangleMesh& mesh) {
  std::vector<double> areas(static_cast<std::size_t>(mesh.vertices.rows()), 0);
  for (Eigen::Index f = 0; f < mesh.triangles.rows(); ++f) {
    const auto p = [&](int k) -> Eigen::Vector3d {
      return mesh.vertices.row(mesh.triangles(f, k));
    };
    const double area = (p(1) - p(0)).cross(p(2) - p(0)).norm() / 6;
    for (int k = 0; k < 3; ++k) areas[static_cast<std::size_t>(mesh.triangles(f, k))] += area;
  }
  return areas;
}

/// The vertices of A that have images, as a bone sees them.
class BoneFitter {
 public:
  BoneFitter(const ism::Values& weights, const ism::TriangleMesh& a, const ism::Points3& images)
      : weights_(weights), a_(a), images_(images), areas_(vertex_areas(a)) {
    for (std::size_t v = 0; v < areas_.size(); ++v)
      if (!images.row(static_cast<Eigen::Index>(v)).allFinite()) areas_[v] = 0;
  }

  /// Of what follows one bone.
  Similarity turn(int bone, const Similarity& otherwise) const {
    return fit(sums([&](int v) { return weights_(v, bone); }), otherwise);
  }
  /// Of what is around a point and follows one bone or its parent.
  Similarity around(const Eigen::Vector3d& p, int bone, int parent,
                    const Similarity& otherwise) const {
    constexpr double kFollows = 0.1;
    const auto weight = [&](int v) {
      return weights_(v, bone) + (parent >= 0 ? weights_(v, parent) : 0);
    };
    double nearest = std::numeric_limits<double>::infinity();  // about how thick the limb is
    for (int v = 0; v < a_.vertices.rows(); ++v)
      if (areas_[static_cast<std::size_t>(v)] > 0 && weight(v) > kFollows)
        nearest = (std::min)(nearest, distance(v, p));
    if (!(nearest > 0) || !std::isfinite(nearest)) return otherwise;
    const Moments local = sums([&](int v) {
      const double d = distance(v, p) / nearest;
      return weight(v) / ((1 + d * d) * (1 + d * d));
    });
    return fit(local, otherwise);
  }
  bool is_followed(int bone) const {
    for (int v = 0; v < a_.vertices.rows(); ++v)
      if (areas_[static_cast<std::size_t>(v)] * weights_(v, bone) > 0) return true;
    return false;
  }

 private:
  double distance(int v, const Eigen::Vector3d& p) const {
    return (a_.vertices.row(v).transpose() - p).norm();
  }
  template <class Weight>
  Moments sums(const Weight& weight) const {
    Moments m;
    for (int v = 0; v < a_.vertices.rows(); ++v) {
      const double area = areas_[static_cast<std::size_t>(v)];
      const double w = area > 0 ? area * weight(v) : 0;
      if (w > 0) m.add(w, a_.vertices.row(v), images_.row(v));
    }
    return m;
  }

  const ism::Values& weights_;
  const ism::TriangleMesh& a_;
  const ism::Points3& images_;
  std::vector<double> areas_;  // 0: not mapped
};

}  // namespace detail

inline Similarity fit(const Moments& sums, const Similarity& otherwise) {
  constexpr double kLine = 1e-6;  // thinner sets of points do not say how they are turned
  if (!(sums.weight > 0)) return otherwise;
  Similarity s;
  s.from = sums.x / sums.weight;
  s.to = sums.y / sums.weight;
  const double xx = sums.xx / sums.weight - s.from.squaredNorm();
  const double yy = sums.yy / sums.weight - s.to.squaredNorm();
  if (!(xx > 0) || !(yy > 0)) return otherwise;
  s.scale = std::sqrt(yy / xx);
  const Eigen::Matrix3d yx = sums.yx / sums.weight - s.to * s.from.transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(yx, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (!(svd.singularValues()[1] > kLine * svd.singularValues()[0])) {
    s.rotation = otherwise.rotation;
    return s;
  }
  Eigen::Vector3d signs(1, 1, 1);
  signs[2] = svd.matrixU().determinant() * svd.matrixV().determinant() < 0 ? -1 : 1;
  s.rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  return s;
}

inline Similarity fit_all(const ism::TriangleMesh& a, const ism::Points3& images) {
  const std::vector<double> areas = detail::vertex_areas(a);
  Moments m;
  for (Eigen::Index v = 0; v < images.rows(); ++v)
    if (images.row(v).allFinite())
      m.add(areas[static_cast<std::size_t>(v)], a.vertices.row(v), images.row(v));
  return fit(m);
}

inline std::vector<Eigen::Matrix4d> place_bones(const std::vector<Bone>& bones,
                                                const ism::Values& weights,
                                                const ism::TriangleMesh& a,
                                                const ism::Points3& images) {
  const detail::BoneFitter fitter(weights, a, images);
  std::vector<Similarity> turns;
  std::vector<Eigen::Matrix4d> frames;
  for (std::size_t i = 0; i < bones.size(); ++i) {
    const Bone& bone = bones[i];
    const int id = static_cast<int>(i);
    Similarity place =
        bone.parent >= 0 ? turns[static_cast<std::size_t>(bone.parent)] : fit_all(a, images);
    Similarity turn = place;
    if (fitter.is_followed(id)) {
      const Eigen::Vector3d origin = bone.bind.topRightCorner<3, 1>();
      turn = fitter.turn(id, place);
      place = fitter.around(origin, id, bone.parent, turn);
    }
    Eigen::Matrix4d frame = bone.bind;
    frame.topLeftCorner<3, 3>() = turn.rotation * bone.bind.topLeftCorner<3, 3>();
    frame.topRightCorner<3, 1>() = place(bone.bind.topRightCorner<3, 1>());
    place.rotation = turn.rotation;  // what hangs on the bone goes with its origin
    turns.push_back(place);
    frames.push_back(frame);
  }
  return frames;
}

inline Carrier::Carrier(const ism::SurfaceMap& map, std::vector<int> copies_of)
    : meta_(map.meta_mesh()),
      transfer_(ism::transfer(meta_, ism::Side::kA, ism::Element::kVertex, ism::Element::kVertex)),
      copies_of_(std::move(copies_of)),
      nearest_(static_cast<std::size_t>(meta_.b->vertices.rows())) {
  const ism::TriangleMesh& b = *meta_.b;
  std::vector<int> mapped;
  for (int f = 0; f < b.triangles.rows(); ++f)
    if (transfer_.covers(b.triangles(f, 0)) && transfer_.covers(b.triangles(f, 1)) &&
        transfer_.covers(b.triangles(f, 2)))
      mapped.push_back(f);
  const detail::NearestTriangle tree(b, std::move(mapped));
  for (int v = 0; v < b.vertices.rows(); ++v)
    if (!transfer_.covers(v)) nearest_[index(v)] = tree.find(b.vertices.row(v).transpose());
}

inline void Carrier::complete(ism::Values& values) const {
  for (std::size_t v = 0; v < nearest_.size(); ++v) {
    if (nearest_[v].face < 0) continue;
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(values.cols());
    for (int k = 0; k < 3; ++k)
      sum += nearest_[v].barycentric[k] * values.row(meta_.b->triangles(nearest_[v].face, k));
    values.row(static_cast<Eigen::Index>(v)) = sum;
  }
  for (std::size_t v = 0; v < copies_of_.size(); ++v)
    values.row(static_cast<Eigen::Index>(v)) = values.row(copies_of_[v]).eval();
}

inline ism::Values Carrier::at_vertices(const ism::Values& of_a) const {
  ism::Values values = transfer_.apply(of_a);
  complete(values);
  return values;
}

/// Per vertex of B, the one that stands for all copies of it; for dropped ones themselves.
inline std::vector<int> Carrier::representatives() const {
  std::vector<int> same(nearest_.size());
  std::iota(same.begin(), same.end(), 0);
  for (std::size_t v = 0; v < meta_.same_b.size(); ++v)
    if (meta_.same_b[v] >= 0) same[v] = meta_.same_b[v];
  return same;
}

/// Of the polygons on the triangles around every vertex.
inline std::vector<Moments> Carrier::vertex_moments() const {
  const std::vector<int> same = representatives();
  std::vector<Moments> moments(nearest_.size());
  for (int p = 0; p < meta_.n_polygons(); ++p) {
    const int begin = meta_.offsets[index(p)], end = meta_.offsets[index(p) + 1];
    const auto on_b = [&](int c) -> Eigen::Vector3d {
      return meta_.on_b.row(meta_.corners[index(c)]);
    };
    double area = 0;
    for (int c = begin + 1; c + 1 < end; ++c)
      area += (on_b(c) - on_b(begin)).cross(on_b(c + 1) - on_b(begin)).norm();
    Moments polygon;
    for (int c = begin; c < end && area > 0; ++c)
      polygon.add(area / (end - begin), meta_.on_a.row(meta_.corners[index(c)]), on_b(c));
    for (int k = 0; k < 3; ++k)
      moments[index(same[index(meta_.b->triangles(meta_.face_b[index(p)], k))])] += polygon;
  }
  return moments;
}

inline std::vector<Similarity> Carrier::turns() const {
  using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const std::vector<int> same = representatives();
  constexpr int kRounds = 4;  // of adding the neighbours: a fold, as of a lip, turns nothing over
  std::vector<Moments> wide = vertex_moments();
  for (int round = 0; round < kRounds; ++round) {
    const std::vector<Moments> near = wide;
    for (int f = 0; f < meta_.b->triangles.rows(); ++f)
      for (int k = 0; k < 3; ++k)
        wide[index(same[index(meta_.b->triangles(f, k))])] +=
            near[index(same[index(meta_.b->triangles(f, (k + 1) % 3))])];
  }
  ism::Values values(static_cast<Eigen::Index>(nearest_.size()), 10);
  for (std::size_t v = 0; v < nearest_.size(); ++v) {
    const Similarity s = fit(wide[index(same[v])]);
    double* const row = values.data() + 10 * v;
    Eigen::Map<Rotation>{row} = s.rotation;
    row[9] = s.scale;
  }
  complete(values);
  std::vector<Similarity> result(nearest_.size());
  for (std::size_t v = 0; v < nearest_.size(); ++v) {
    const double* const row = values.data() + 10 * v;
    result[v].rotation = Eigen::Map<const Rotation>(row);
    result[v].scale = row[9];
  }
  return result;
}

}  // namespace retarget

#endif  // ISM_EXAMPLES_RETARGET_HPP

// ism_verify.hpp: proves of a map of ism.hpp what compute_map() promises, by independent code.
//
//   const ism::Outcome proof = ism::verify_map(ism::SurfaceMap(result));
//   if (proof.status != ism::Status::kDone) report(proof.message, proof.ids);
//
// What:    f and g are injective, so Φ = g⁻¹ ∘ f is continuous and injective where both are
// defined.
//          Each polygon of the meta mesh occurs once, none is missing beside another, and corners
//          agree in the planes and on the surfaces. A closed map covers both surfaces.
// How:     Integer arithmetic, without rounding, on what the public functions of ism.hpp return. An
//          embedding of positive triangles covers a point as often as its boundary winds around
//          it; a sweep over the boundary [Shamos and Hoey 1976] shows that it is simple and winds
//          around each point at most once.
// Limits:  Places of corners are compared up to 1e-9 of the size.

#ifndef ISM_VERIFY_HPP
#define ISM_VERIFY_HPP

#include "ism.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace ism {
namespace verification {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;

// ---- orientation ----

/// An exact sum of products of finite doubles: integers in base 2^24, least digit first.
class ExactSum {
 public:
  void add_product(double a, double b) {
    const Digits x = digits_of(a), y = digits_of(b);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) digit_[x.first + y.first + i + j] += x.digit[i] * y.digit[j];
  }

  int sign() const {
    std::int64_t carry = 0;
    bool is_zero = true;
    for (std::int64_t digit : digit_) {
      const std::int64_t sum = digit + carry, rest = sum & kMask;
      carry = (sum - rest) / (kMask + 1);
      is_zero = is_zero && rest == 0;
    }
    return carry != 0 ? (carry > 0 ? 1 : -1) : (is_zero ? 0 : 1);
  }

 private:
  static constexpr std::int64_t kMask = (1 << 24) - 1;
  static constexpr int kLeastExponent = -24 * 48;  // below that of the last bit of any double

  struct Digits {
    int first;
    std::int64_t digit[4];
  };

  static Digits digits_of(double x) {
    int exponent;
    const double fraction = std::frexp(x, &exponent);  // 53 bits, in three or four digits
    const int place = exponent - kLeastExponent;
    double rest = std::ldexp(fraction, place % 24);
    Digits d = {place / 24 - 3, {}};
    for (int i = 4; i-- > 0; rest = std::ldexp(rest - std::trunc(rest), 24))
      d.digit[i] = static_cast<std::int64_t>(rest);
    return d;
  }

  std::int64_t digit_[192] = {};  // room for the largest products, and for carries
};

/// Returns the sign of the area of a triangle.
inline int orientation(const Vec2& a, const Vec2& b, const Vec2& c) {
  ExactSum sum;
  const Vec2* const p[4] = {&a, &b, &c, &a};
  for (int i = 0; i < 3; ++i) {
    sum.add_product(p[i]->x(), p[i + 1]->y());
    sum.add_product(-p[i]->y(), p[i + 1]->x());
  }
  return sum.sign();
}

inline bool comes_before(const Vec2& p, const Vec2& q) {
  return p.x() < q.x() || (p.x() == q.x() && p.y() < q.y());
}

// ---- sides of triangles and polygons ----

/// An edge of the triangle or polygon `of`, from u to v.
struct DirectedEdge {
  int u, v, of;
  bool operator<(const DirectedEdge& o) const { return std::tie(u, v) < std::tie(o.u, o.v); }
};

/// Sorts sides and collects those without an opposite one. Returns the triangle or polygon of a
/// side that occurs twice in one direction, or -1.
inline int match_edges(std::vector<DirectedEdge>& sides, std::vector<DirectedEdge>& single) {
  std::sort(sides.begin(), sides.end());
  for (std::size_t i = 0; i + 1 < sides.size(); ++i)
    if (!(sides[i] < sides[i + 1])) return sides[i + 1].of;
  for (const DirectedEdge& side : sides)
    if (!std::binary_search(sides.begin(), sides.end(), DirectedEdge{side.v, side.u, -1}))
      single.push_back(side);
  return -1;
}

inline bool refuse(Outcome& outcome, const std::string& message, std::vector<ElementId> ids) {
  outcome.status = Status::kNumericalFailure;
  outcome.message = message;
  outcome.ids = std::move(ids);
  return false;
}

inline std::string of_mesh(int id, Side side) {
  return std::to_string(id) + (side == Side::kA ? " of A" : " of B");
}

// ---- embeddings ----

/// Sweeps over the boundary of an embedding, from left to right.
class BoundarySweep {
 public:
  BoundarySweep(const Points2& x, const std::vector<DirectedEdge>& boundary) : x_(x) {
    for (const DirectedEdge& side : boundary) {
      const bool runs_right = comes_before(at(side.u), at(side.v));
      segments_.push_back(runs_right ? Segment{side.u, side.v, true}
                                     : Segment{side.v, side.u, false});
    }
  }

  /// True if the boundary is simple and winds around each point at most once; else fault() is a
  /// vertex of the violation.
  bool run() {
    std::vector<std::size_t> order(2 * segments_.size());  // ends: 2 i is the left one of segment i
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) {
      const Vec2 p = at(end(i)), q = at(end(j));
      return p == q ? end(i) < end(j) : comes_before(p, q);
    });
    std::set<std::size_t, Below> alive(Below{this});
    std::vector<Alive::iterator> place(segments_.size(), alive.end());
    for (std::size_t i = 0; i < order.size(); i += 2) {
      const int v = fault_ = end(order[i]);
      const bool has_two = end(order[i + 1]) == v;
      if (!has_two || (i + 2 < order.size() && at(end(order[i + 2])) == at(v))) return false;
      auto above = alive.end();
      for (std::size_t e : {order[i], order[i + 1]})
        if (e % 2 == 1) above = alive.erase(place[e / 2]);
      for (std::size_t e : {order[i], order[i + 1]}) {
        if (e % 2 == 1) continue;
        const auto added = alive.insert(e / 2);
        if (!added.second) return false;  // overlaps another segment
        place[e / 2] = added.first;
      }
      for (std::size_t e : {order[i], order[i + 1]}) {
        if (e % 2 == 1) continue;
        const auto after = std::next(place[e / 2]);
        if (!may_be_neighbours(alive, place[e / 2]) || !may_be_neighbours(alive, after))
          return false;
        above = after;
      }
      if (!may_be_neighbours(alive, above)) return false;
    }
    return true;
  }

  int fault() const { return fault_; }

 private:
  struct Segment {
    int left, right;
    bool runs_right;  // then the interior is above
  };
  /// Orders segments that do not cross along the sweep line.
  struct Below {
    const BoundarySweep* sweep;
    bool operator()(std::size_t i, std::size_t j) const {
      const Segment &s = sweep->segments_[i], &t = sweep->segments_[j];
      if (i == j) return false;
      const bool is_later = comes_before(sweep->at(t.left), sweep->at(s.left));
      return is_later ? sweep->side(t, s) < 0 : sweep->side(s, t) > 0;
    }
  };
  using Alive = std::set<std::size_t, Below>;

  Vec2 at(int v) const { return x_.row(v); }
  int end(std::size_t i) const {
    return i % 2 == 0 ? segments_[i / 2].left : segments_[i / 2].right;
  }

  /// Returns whether t, which begins later, lies above s (1), below (-1), or on it (0).
  int side(const Segment& s, const Segment& t) const {
    const int at_left = orientation(at(s.left), at(s.right), at(t.left));
    return at_left != 0 ? at_left : orientation(at(s.left), at(s.right), at(t.right));
  }

  /// True if the segments at `upper` and just below it do not meet and agree on the side of the
  /// interior: it is above a segment that runs right and below the next one.
  bool may_be_neighbours(const Alive& alive, Alive::iterator upper) const {
    const bool has_lower = upper != alive.begin(), has_upper = upper != alive.end();
    const Segment* high = has_upper ? &segments_[*upper] : nullptr;
    const Segment* low = has_lower ? &segments_[*std::prev(upper)] : nullptr;
    const bool is_inside = low && low->runs_right;
    return (high && !high->runs_right) == is_inside && !(low && high && meet(*low, *high));
  }

  /// True if two segments have a common point that is not an end of both.
  bool meet(const Segment& s, const Segment& t) const {
    if (s.left == t.left || s.right == t.right || s.left == t.right || s.right == t.left)
      return false;  // run() has found overlaps
    const Vec2 a = at(s.left), b = at(s.right), c = at(t.left), d = at(t.right);
    const int of_c = orientation(a, b, c), of_d = orientation(a, b, d);
    const int of_a = orientation(c, d, a), of_b = orientation(c, d, b);
    if (of_c == 0 && of_d == 0) return !comes_before(b, c) && !comes_before(d, a);
    return of_c * of_d <= 0 && of_a * of_b <= 0;
  }

  const Points2& x_;
  std::vector<Segment> segments_;
  int fault_ = -1;
};

/// Verifies one embedding; `boundary` receives the sides of triangles without an opposite one.
inline bool verify_embedding(const TriangleMesh& mesh, const Points2& x, Side side,
                             std::vector<DirectedEdge>& boundary, Outcome& outcome) {
  const auto refuse_element = [&](const char* what, int id, const char* how, Element element) {
    return refuse(outcome, what + of_mesh(id, side) + how, {{side, element, id}});
  };
  for (int v = 0; v < static_cast<int>(x.rows()); ++v)
    if (!x.row(v).allFinite())
      return refuse_element("vertex ", v, " has no planar position", Element::kVertex);
  std::vector<DirectedEdge> sides;
  for (int f = 0; f < static_cast<int>(mesh.triangles.rows()); ++f) {
    const Eigen::RowVector3i v = mesh.triangles.row(f);
    if (orientation(x.row(v[0]), x.row(v[1]), x.row(v[2])) <= 0)
      return refuse_element("triangle ", f, " is not positive in the plane", Element::kFace);
    for (int k = 0; k < 3; ++k) sides.push_back({v[k], v[(k + 1) % 3], f});
  }
  if (const int twice = match_edges(sides, boundary); twice >= 0)
    return refuse_element("triangle ", twice, " has a side that another one has, too",
                          Element::kFace);
  BoundarySweep sweep(x, boundary);
  return sweep.run() ||
         refuse_element("at vertex ", sweep.fault(),
                        " the boundary meets itself, or winds the wrong way", Element::kVertex);
}

/// Verifies that an injective embedding of a surface that is cut open covers a pillow once: motions
/// x → ±x + period (i, j) take the two sides of the cut to each other, and its area is that of the
/// pillow.
inline bool verify_pillow(const TriangleMesh& mesh, const Points2& x, Side side, double period,
                          const std::vector<DirectedEdge>& boundary, Outcome& outcome) {
  const auto refuse_vertex = [&](int v, const char* how) {
    return refuse(outcome, "at vertex " + of_mesh(v, side) + " the two sides of the cut " + how,
                  {{side, Element::kVertex, v}});
  };
  const double grid = std::ldexp(1.0, std::ilogb(period) - 50);
  for (int v = 0; v < static_cast<int>(x.rows()); ++v)
    for (int c = 0; c < 2; ++c)
      if (std::fmod(x(v, c), grid) != 0 || !(std::abs(x(v, c)) < 4 * period))
        return refuse_vertex(v, "may be moved with rounding");
  // The least of the places to which motions take a point, exactly: all lie on one grid.
  const auto canonical = [&](int v) -> Vec2 {
    const auto reduced = [&](double c) {
      const double rest = std::fmod(c, period);
      return rest < 0 ? rest + period : rest + 0.0;
    };
    const Vec2 p = {reduced(x(v, 0)), reduced(x(v, 1))}, q = {reduced(-x(v, 0)), reduced(-x(v, 1))};
    return comes_before(p, q) ? p : q;
  };
  std::vector<int> vertices, number(static_cast<std::size_t>(x.rows()), 0);
  for (const DirectedEdge& e : boundary) vertices.push_back(e.u);
  std::sort(vertices.begin(), vertices.end(),
            [&](int u, int v) { return comes_before(canonical(u), canonical(v)); });
  for (std::size_t i = 1; i < vertices.size(); ++i) {
    const int u = vertices[i - 1], v = vertices[i];
    const bool is_same = canonical(u) == canonical(v);
    number.data()[v] = number.data()[u] + !is_same;
    if (is_same && mesh.vertices.row(u) != mesh.vertices.row(v))
      return refuse_vertex(v, "lie at different places of the surface");
  }
  std::vector<DirectedEdge> sides, single;
  for (const DirectedEdge& e : boundary)
    sides.push_back({number.data()[e.u], number.data()[e.v], e.u});
  const int twice = match_edges(sides, single);
  if (twice >= 0) return refuse_vertex(twice, "meet another one");
  if (!single.empty()) return refuse_vertex(single[0].of, "do not fit");
  double twice_area = 0;
  for (int f = 0; f < static_cast<int>(mesh.triangles.rows()); ++f) {
    const Vec2 p = x.row(mesh.triangles(f, 0));
    const Vec2 u = x.row(mesh.triangles(f, 1)).transpose() - p;
    const Vec2 v = x.row(mesh.triangles(f, 2)).transpose() - p;
    twice_area += u.x() * v.y() - u.y() * v.x();
  }
  const double ratio = twice_area / (period * period);  // whole, but for rounding
  return std::abs(ratio - 1) < 0.5 || refuse_vertex(0, "are those of several pillows");
}

// ---- the meta mesh ----

/// Verifies the meta mesh of injective embeddings.
class MetaMeshVerifier {
 public:
  /// `period`: of the motions of a closed map, or 0.
  MetaMeshVerifier(MetaMesh meta, const Points2& f, const Points2& g, double period,
                   Outcome& outcome)
      : meta_(std::move(meta)),
        a_{*meta_.a, f, meta_.face_a, meta_.corner_a, meta_.on_a},
        b_{*meta_.b, g, meta_.face_b, meta_.corner_b, meta_.on_b},
        size_f_(f.cwiseAbs().maxCoeff()),
        period_(period),
        outcome_(outcome) {}

  bool run(const std::vector<DirectedEdge>& boundary_a,
           const std::vector<DirectedEdge>& boundary_b) {
    for (int p = 0; p < meta_.n_polygons(); ++p)
      if (!verify_polygon(p)) return false;
    return verify_pairs() && verify_sides(boundary_a, boundary_b);
  }

 private:
  /// The polygons on one surface.
  struct Half {
    const TriangleMesh& mesh;
    const Points2& plane;
    const std::vector<int>& face;     // per polygon
    const Points3 &weights, &places;  // per corner and per vertex of polygons
    double size = mesh.vertices.cwiseAbs().maxCoeff();

    /// Returns where a corner of a polygon lies, in the plane or in space.
    template <class Positions>
    auto at(const Positions& x, int polygon, int corner) const {
      const Eigen::RowVector3i v = mesh.triangles.row(face.data()[polygon]);
      const Eigen::RowVector3d w = weights.row(corner);
      return (w[0] * x.row(v[0]) + w[1] * x.row(v[1]) + w[2] * x.row(v[2])).eval();
    }
  };

  /// x → sign x + shift.
  struct Motion {
    double sign;
    Eigen::RowVector2d shift;
  };

  bool refuse_polygon(int polygon, const char* how) {
    const int a = a_.face.data()[polygon], b = b_.face.data()[polygon];
    return refuse(outcome_,
                  "the polygon of triangle " + of_mesh(a, Side::kA) + " and triangle " +
                      of_mesh(b, Side::kB) + " " + how,
                  {{Side::kA, Element::kFace, a}, {Side::kB, Element::kFace, b}});
  }

  int begin(int polygon) const { return meta_.offsets.data()[polygon]; }
  int end(int polygon) const { return meta_.offsets.data()[polygon + 1]; }
  int vertex(int corner) const { return meta_.corners.data()[corner]; }
  int after(int corner, int polygon) const {
    return corner + 1 < end(polygon) ? corner + 1 : begin(polygon);
  }

  /// Checks that a polygon lies in its triangles and its corners agree in the planes and in space.
  bool verify_polygon(int p) {
    if (end(p) - begin(p) < 3) return refuse_polygon(p, "has less than three corners");
    if (!find_motion(p)) return refuse_polygon(p, "has a corner at two places");
    for (int i = begin(p); i < end(p); ++i)
      for (const Half* h : {&a_, &b_}) {
        const Vec3 w = h->weights.row(i);
        if (w.minCoeff() < -kTolerance || std::abs(w.sum() - 1) > kTolerance)
          return refuse_polygon(p, "has a corner outside");
        if (!are_close(h->at(h->mesh.vertices, p, i), h->places.row(vertex(i)), h->size))
          return refuse_polygon(p, "has a corner at two places");
      }
    return true;
  }

  /// Finds the motion of a polygon from g's plane to f's: none, or one of the pillow.
  bool find_motion(int p) {
    for (double sign : {1.0, -1.0}) {
      Motion motion = {sign, Eigen::RowVector2d::Zero()};
      if (period_ > 0)
        for (int c = 0; c < 2; ++c) {
          const double way =
              a_.at(a_.plane, p, begin(p))[c] - sign * b_.at(b_.plane, p, begin(p))[c];
          motion.shift[c] = period_ * std::round(way / period_);
        }
      bool fits = sign > 0 || period_ > 0;
      for (int i = begin(p); i < end(p) && fits; ++i)
        fits =
            are_close(a_.at(a_.plane, p, i), sign * b_.at(b_.plane, p, i) + motion.shift, size_f_);
      if (!fits) continue;
      motions_.push_back(motion);
      return true;
    }
    return false;
  }

  template <class Place, class Other>
  static bool are_close(const Place& p, const Other& q, double largest) {
    return (p - q).cwiseAbs().maxCoeff() <= kTolerance * largest;
  }

  /// Checks that two triangles have at most one polygon, or one per motion: overlaps are convex.
  bool verify_pairs() {
    std::vector<DirectedEdge> pairs;
    for (int p = 0; p < meta_.n_polygons(); ++p)
      pairs.push_back({a_.face.data()[p], b_.face.data()[p], p});
    std::sort(pairs.begin(), pairs.end());
    for (std::size_t i = 0; i < pairs.size(); ++i)
      for (std::size_t j = i + 1; j < pairs.size() && !(pairs[i] < pairs[j]); ++j) {
        const Motion &m = motions_.data()[pairs[i].of], &n = motions_.data()[pairs[j].of];
        if (m.sign == n.sign && m.shift == n.shift)
          return refuse_polygon(pairs[j].of, "is there twice");
      }
    return true;
  }

  /// Checks that each side of a polygon has a neighbour or lies on a boundary of A or B. The
  /// polygons of a closed map have no boundary, so they cover both surfaces.
  bool verify_sides(const std::vector<DirectedEdge>& boundary_a,
                    const std::vector<DirectedEdge>& boundary_b) {
    std::vector<DirectedEdge> sides, single;
    for (int p = 0; p < meta_.n_polygons(); ++p)
      for (int i = begin(p); i < end(p); ++i) sides.push_back({vertex(i), vertex(after(i, p)), p});
    const int twice = match_edges(sides, single);
    if (twice >= 0) return refuse_polygon(twice, "has a side of another one");
    for (const DirectedEdge& side : single)
      if (period_ > 0 || !(ends_there(side, a_, boundary_a) || ends_there(side, b_, boundary_b)))
        return refuse_polygon(side.of, "has no neighbour at one side, where both surfaces go on");
    return true;
  }

  /// True if a side of a polygon lies on a boundary edge of its triangle.
  bool ends_there(const DirectedEdge& side, const Half& half,
                  const std::vector<DirectedEdge>& boundary) const {
    int i = begin(side.of);
    while (vertex(i) != side.u) ++i;
    const int j = after(i, side.of), f = half.face.data()[side.of];
    for (int k = 0; k < 3; ++k) {
      const DirectedEdge edge = {half.mesh.triangles(f, (k + 1) % 3),
                                 half.mesh.triangles(f, (k + 2) % 3), f};
      if (half.weights(i, k) == 0 && half.weights(j, k) == 0 &&
          std::binary_search(boundary.begin(), boundary.end(), edge))
        return true;
    }
    return false;
  }

  static constexpr double kTolerance = 1e-9;

  const MetaMesh meta_;
  const Half a_, b_;
  const double size_f_, period_;
  Outcome& outcome_;
  std::vector<Motion> motions_;  // per polygon
};

}  // namespace verification

/// Verifies what compute_map() promises of a map. Returns kDone; the status of the map, if
/// different; or kNumericalFailure, a bug of ism.hpp, with the offending vertex or triangles of the
/// embedded meshes. Cost O(n log n), microseconds per triangle and polygon. Thread-safe.
inline Outcome verify_map(const SurfaceMap& map) {
  using namespace verification;
  Outcome outcome;
  outcome.status = map.status();
  outcome.message = map.message();
  if (outcome.status != Status::kDone) return outcome;
  const Points2 f = map.planar_positions(Side::kA), g = map.planar_positions(Side::kB);
  const TriangleMesh &a = map.mesh(Side::kA, Ids::kEmbedded),
                     &b = map.mesh(Side::kB, Ids::kEmbedded);
  std::vector<DirectedEdge> boundary_a, boundary_b;
  if (verify_embedding(a, f, Side::kA, boundary_a, outcome) &&
      verify_embedding(b, g, Side::kB, boundary_b, outcome) &&
      (!map.is_closed() || (verify_pillow(a, f, Side::kA, map.period(), boundary_a, outcome) &&
                            verify_pillow(b, g, Side::kB, map.period(), boundary_b, outcome))))
    MetaMeshVerifier(map.meta_mesh(Ids::kWhole), f, g, map.period(), outcome)
        .run(boundary_a, boundary_b);
  return outcome;
}

}  // namespace ism

#endif  // ISM_VERIFY_HPP

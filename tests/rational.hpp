// An independent checker of maps. It sees what a user of the library sees (triangles, planar
// positions, the meta mesh) and shares no code with it. Coordinates are integers, multiplied by one
// power of two; what is computed from them are ratios of integers; so nothing is rounded, and where
// two figures are compared, they are equal or a fault.
//
// It proves of f and g, each: triangles are positive, the angles around an inner vertex add up to
// 2π, boundary loops meet neither themselves nor each other, one of them winds counter-clockwise,
// and the others are openings within it. Of the meta mesh: its polygons belong to the pairs of
// triangles that overlap, once each; corners are vertices or crossings of edges, lie in convex
// order, and enclose the area that is common to the two triangles; polygons are neighbours along
// their sides, but for what lies on a boundary; and areas add up to what is common to the two
// domains, which is computed from their boundaries alone.
//
// Of closed maps, all this is proved after g(B) is laid over f(A), in as many copies as there are
// motions of the pillow among the polygons; and of the surfaces sewn up: that every side of a
// polygon has a neighbour, that a vertex is one point of the pillow in all polygons around it, and
// that the areas of f(A), of g(B) and of the polygons are that of the pillow.
//
// Pairs that meet without area may have a polygon or not: the library breaks ties by a symbolic
// perturbation. Such a polygon must have no area. Where corners coincide, or edges lie on each
// other, what a corner is may be told by its coordinates in several ways; one that is consistent
// must exist. A crossing of edges on one line has no place of its own: whatever it is, the polygon
// has the same area. At the cones of a closed map, where a vertex of A and one of B coincide, a
// corner may be either of them in one polygon, and a crossing of edges that end there in the next.

#ifndef ISM_TESTS_RATIONAL_HPP
#define ISM_TESTS_RATIONAL_HPP

#include "ism.hpp"

#include <boost/multiprecision/cpp_int.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace rational {

namespace mp = boost::multiprecision;
using Rational = mp::cpp_rational;
/// As large as needed; the first 512 bits are within the number, so that most take no allocation.
using Integer = mp::number<mp::cpp_int_backend<512>, mp::et_off>;

inline std::size_t at(int i) { return static_cast<std::size_t>(i); }
inline std::size_t at(Eigen::Index i) { return static_cast<std::size_t>(i); }
inline int size_of(std::size_t n) { return static_cast<int>(n); }

// ---- numbers ----

/// A ratio of integers that is not reduced; den > 0.
struct Ratio {
  Integer num = 0, den = 1;
};

inline Ratio operator+(const Ratio& a, const Ratio& b) {
  if (a.den == b.den) return {a.num + b.num, a.den};
  return {a.num * b.den + b.num * a.den, a.den * b.den};
}
inline Ratio operator-(const Ratio& a, const Ratio& b) {
  return {a.num * b.den - b.num * a.den, a.den * b.den};
}
inline bool operator<(const Ratio& a, const Ratio& b) { return a.num * b.den < b.num * a.den; }
inline bool operator==(const Ratio& a, const Ratio& b) { return a.num * b.den == b.num * a.den; }

/// num / den with den of any sign but 0.
inline Ratio ratio(const Integer& num, const Integer& den) {
  return den.sign() < 0 ? Ratio{-num, -den} : Ratio{num, den};
}

inline int bits(const Integer& x) {
  return x.is_zero() ? 0 : static_cast<int>(mp::msb(mp::abs(x))) + 1;
}

/// The nearest double, or a neighbour of it.
inline double to_double(const Integer& num, const Integer& den) {
  if (num.is_zero()) return 0;
  const int shift = 70 - bits(num) + bits(den);
  const Integer quotient = shift > 0 ? (num << shift) / den : num / (den << -shift);
  return std::ldexp(quotient.convert_to<double>(), -shift);
}
inline double to_double(const Ratio& r) { return to_double(r.num, r.den); }

/// Doubles as integers, multiplied by a power of two that makes all of them whole.
class Lattice {
 public:
  void include(double x) {
    if (x != 0) lowest_ = std::min(lowest_, split(x).exponent);
  }
  Integer operator()(double x) const {
    if (x == 0) return 0;
    const Parts parts = split(x);
    return Integer(parts.digits) << (parts.exponent - lowest_);
  }
  /// From twice an area.
  double area(const Ratio& twice) const {
    return std::ldexp(to_double(twice.num, twice.den), 2 * lowest_ - 1);
  }
  /// The double nearest to num / den, as a coordinate again.
  double inverse(const Integer& num, const Integer& den) const {
    return std::ldexp(to_double(num, den), lowest_);
  }

 private:
  /// x = digits · 2^exponent.
  struct Parts {
    std::int64_t digits;
    int exponent;
  };
  static Parts split(double x) {
    Parts p;
    p.digits = static_cast<std::int64_t>(std::ldexp(std::frexp(x, &p.exponent), 53));
    p.exponent -= 53;
    return p;
  }

  int lowest_ = 2000;
};

inline Rational reduced(const Ratio& r) { return Rational(mp::cpp_int(r.num), mp::cpp_int(r.den)); }

/// Adds numbers that are about as long as each other, which their sums are not.
inline Rational sum_of(std::vector<Rational> terms) {
  for (; terms.size() > 1; terms.resize((terms.size() + 1) / 2)) {
    const std::size_t half = (terms.size() + 1) / 2;
    for (std::size_t i = half; i < terms.size(); ++i) terms[i - half] += terms[i];
  }
  return terms.empty() ? Rational(0) : terms[0];
}

// ---- points ----

struct Point {
  Integer x, y;
};
inline bool operator==(const Point& p, const Point& q) { return p.x == q.x && p.y == q.y; }
inline Point operator-(const Point& p, const Point& q) { return {p.x - q.x, p.y - q.y}; }
inline Integer cross(const Point& p, const Point& q) { return p.x * q.y - p.y * q.x; }
inline Integer dot(const Point& p, const Point& q) { return p.x * q.x + p.y * q.y; }

/// Twice the area of a triangle.
inline Integer turn(const Point& a, const Point& b, const Point& c) { return cross(b - a, c - a); }

/// (x, y) / w, where w > 0.
struct Place {
  Integer x, y, w;
};
inline Place place(const Point& p) { return {p.x, p.y, 1}; }
inline bool operator==(const Place& p, const Place& q) {
  return p.x * q.w == q.x * p.w && p.y * q.w == q.y * p.w;
}
inline int side(const Point& a, const Point& b, const Place& p) {
  const Point d = b - a;
  return (d.x * (p.y - a.y * p.w) - d.y * (p.x - a.x * p.w)).sign();
}
/// Where t of the way from a to b is.
inline Place between(const Point& a, const Point& b, const Ratio& t) {
  const Point d = b - a;
  return {a.x * t.den + d.x * t.num, a.y * t.den + d.y * t.num, t.den};
}
/// And back, for a point on the line.
inline Ratio parameter(const Point& a, const Point& b, const Place& p) {
  const Point d = b - a;
  return d.x.is_zero() ? ratio(p.y - a.y * p.w, d.y * p.w) : ratio(p.x - a.x * p.w, d.x * p.w);
}
/// The direction from p to q, of any length.
inline Point direction(const Place& p, const Place& q) {
  return {q.x * p.w - p.x * q.w, q.y * p.w - p.y * q.w};
}

/// The quadrant that a direction points to, counter-clockwise, each with its first axis.
inline int quadrant(const Point& d) {
  const int x = d.x.sign(), y = d.y.sign();
  return x > 0 && y >= 0 ? 0 : x <= 0 && y > 0 ? 1 : x < 0 ? 2 : 3;
}

/// How many right angles directions turn by, one after the other and back to the first, if each
/// turns to the left by less than π: then it goes on by two quadrants at most.
inline int right_angles(const std::vector<Point>& directions) {
  int sum = 0;
  for (std::size_t i = 0; i < directions.size(); ++i)
    sum += (quadrant(directions[(i + 1) % directions.size()]) - quadrant(directions[i]) + 4) % 4;
  return sum;
}

/// True if the closed segments ab and cd have a point in common.
inline bool segments_meet(const Point& a, const Point& b, const Point& c, const Point& d) {
  const int of_c = turn(a, b, c).sign(), of_d = turn(a, b, d).sign();
  const int of_a = turn(c, d, a).sign(), of_b = turn(c, d, b).sign();
  const bool are_on_one_line = of_a == 0 && of_b == 0 && of_c == 0 && of_d == 0;
  if (!are_on_one_line) return of_c * of_d <= 0 && of_a * of_b <= 0;
  const auto reaches = [](const Integer& p, const Integer& q, const Integer& r, const Integer& s) {
    return std::max(p, q) >= std::min(r, s) && std::max(r, s) >= std::min(p, q);
  };
  return reaches(a.x, b.x, c.x, d.x) && reaches(a.y, b.y, c.y, d.y);
}

// ---- what is close to what ----

/// In doubles as they were given, which are compared only.
struct Box {
  std::array<double, 2> lo, hi;

  void include(const Box& b) {
    for (std::size_t k = 0; k < 2; ++k) {
      lo[k] = std::min(lo[k], b.lo[k]);
      hi[k] = std::max(hi[k], b.hi[k]);
    }
  }
  bool meets(const Box& b) const {
    return lo[0] <= b.hi[0] && b.lo[0] <= hi[0] && lo[1] <= b.hi[1] && b.lo[1] <= hi[1];
  }
};

using Vector = Eigen::RowVector2d;

/// The point with these coordinates in a triangle, rounded.
inline Vector position_in(const ism::TriangleMesh& mesh, const ism::Points2& x, int f,
                          const Eigen::RowVector3d& weights) {
  Vector sum(0, 0);
  for (int k = 0; k < 3; ++k) sum += weights[k] * x.row(mesh.triangles(f, k));
  return sum;
}

inline Box box_of(const ism::Points2& x, int v) { return {{x(v, 0), x(v, 1)}, {x(v, 0), x(v, 1)}}; }

template <class Vertices>
Box box_around(const ism::Points2& x, const Vertices& vertices) {
  Box box = box_of(x, vertices[0]);
  for (int v : vertices) box.include(box_of(x, v));
  return box;
}

/// Boxes, halved by their centres again and again.
class BoxTree {
 public:
  BoxTree() = default;
  explicit BoxTree(std::vector<Box> boxes) : boxes_(std::move(boxes)) {
    for (int i = 0; i < size_of(boxes_.size()); ++i) order_.push_back(i);
    around_.resize(4 * boxes_.size() + 1);
    if (!boxes_.empty()) build(0, 0, boxes_.size());
  }

  /// Calls visit(i) for all boxes that meet one.
  template <class Visit>
  void for_each_at(const Box& box, const Visit& visit) const {
    if (!boxes_.empty()) descend(box, visit, 0, 0, boxes_.size());
  }

 private:
  void build(std::size_t node, std::size_t begin, std::size_t end) {
    Box all = boxes_[at(order_[begin])];
    for (std::size_t i = begin; i < end; ++i) all.include(boxes_[at(order_[i])]);
    around_[node] = all;
    if (end - begin == 1) return;
    const std::size_t axis = all.hi[0] - all.lo[0] > all.hi[1] - all.lo[1] ? 0 : 1;
    const auto first = order_.begin();
    const auto to = [&](std::size_t i) { return first + static_cast<std::ptrdiff_t>(i); };
    const std::size_t middle = (begin + end) / 2;
    std::nth_element(to(begin), to(middle), to(end), [&](int i, int j) {
      return boxes_[at(i)].lo[axis] + boxes_[at(i)].hi[axis] <
             boxes_[at(j)].lo[axis] + boxes_[at(j)].hi[axis];
    });
    build(2 * node + 1, begin, middle);
    build(2 * node + 2, middle, end);
  }

  template <class Visit>
  void descend(const Box& box, const Visit& visit, std::size_t node, std::size_t begin,
               std::size_t end) const {
    if (!around_[node].meets(box)) return;
    if (end - begin == 1) return visit(order_[begin]);
    const std::size_t middle = (begin + end) / 2;
    descend(box, visit, 2 * node + 1, begin, middle);
    descend(box, visit, 2 * node + 2, middle, end);
  }

  std::vector<Box> boxes_, around_;
  std::vector<int> order_;
};

// ---- what is checked, and what is found ----

/// Of the two squares that are a pillow, the surface that closed ones are laid on: the plane, where
/// points are the same if half-turns about the cones, kPillowSide (i, j), take them to each other.
constexpr double kPillowSide = 0x1.6ap-1;
/// Positions on a pillow, rounded, which are as close are meant to be one.
constexpr double kSamePlace = 1e-9;

/// All that is looked at. It is plain data, so tests can spoil it.
struct MapData {
  ism::TriangleMesh a, b;
  ism::Points2 f, g;
  ism::MetaMesh meta;
  bool is_closed = false;
};

inline MapData data_of(const ism::SurfaceMap& map) {
  constexpr ism::Ids kEmbedded = ism::Ids::kEmbedded;
  return {map.mesh(ism::Side::kA, kEmbedded),
          map.mesh(ism::Side::kB, kEmbedded),
          map.planar_positions(ism::Side::kA),
          map.planar_positions(ism::Side::kB),
          map.meta_mesh(kEmbedded),
          map.is_closed()};
}

struct Counts {
  long triangles = 0;          // positive ones
  long inner_vertices = 0;     // with angles that add up
  long boundary_edges = 0;     // that do not meet
  long openings = 0;           // loops within others
  long pairs = 0;              // of triangles with boxes that meet
  long overlaps = 0;           // of them, with a common area
  long polygons = 0;           // of the meta mesh, with that area
  long without_area = 0;       // of the meta mesh, of pairs that do not overlap
  long corners = 0;            // of polygons, at exact places
  long crossings = 0;          // of them, of edges of A and B
  long parallel = 0;           // of them, of edges on one line
  long told_in_many_ways = 0;  // corners with more than one candidate
  double largest_error = 0;    // of rounded corners, in the size of the plane
  long maps = 0;               // of which all of this was checked

  Counts& operator+=(const Counts& o) {
    for (long Counts::*count :
         {&Counts::triangles, &Counts::inner_vertices, &Counts::boundary_edges, &Counts::openings,
          &Counts::pairs, &Counts::overlaps, &Counts::polygons, &Counts::without_area,
          &Counts::corners, &Counts::crossings, &Counts::parallel, &Counts::told_in_many_ways,
          &Counts::maps})
      this->*count += o.*count;
    largest_error = std::max(largest_error, o.largest_error);
    return *this;
  }
};

struct Report {
  std::vector<std::string> faults;  // none: proved
  Counts counts;
  double area = 0;                        // in the plane, that is common to the domains
  double coverage_a = 0, coverage_b = 0;  // from exact planar areas
  bool ok() const { return faults.empty(); }
  std::string first() const { return faults.empty() ? "" : faults[0]; }
  bool says(const std::string& words) const {
    return std::any_of(faults.begin(), faults.end(), [&](const std::string& fault) {
      return fault.find(words) != std::string::npos;
    });
  }
};

// ---- one embedding ----

struct Edge {
  int from, to, face;  // the triangle is to the left
};
inline bool operator<(const Edge& a, const Edge& b) {
  return a.from != b.from ? a.from < b.from : a.to < b.to;
}

/// A triangulated domain of the plane, and the checks of it.
class Domain {
 public:
  Domain(const ism::TriangleMesh& mesh, const ism::Points2& x, const Lattice& lattice)
      : x_(x), mesh_(mesh) {
    for (int v = 0; v < x.rows(); ++v) points_.push_back({lattice(x(v, 0)), lattice(x(v, 1))});
    for (int f = 0; f < triangles(); ++f)
      for (int k = 0; k < 3; ++k) edges_.push_back({corner(f, k), corner(f, k + 1), f});
    std::sort(edges_.begin(), edges_.end());
    for (const Edge& e : edges_)
      if (!has_edge(e.to, e.from)) boundary_.push_back(e);
    std::vector<Box> boxes;
    for (const Edge& e : boundary_)
      boxes.push_back(box_around(x, std::array<int, 2>{e.from, e.to}));
    boundary_tree_ = BoxTree(boxes);
  }

  int triangles() const { return static_cast<int>(mesh_.triangles.rows()); }
  int corner(int f, int k) const { return mesh_.triangles(f, k % 3); }
  const Point& point(int v) const { return points_[at(v)]; }
  const Point& point(int f, int k) const { return point(corner(f, k)); }
  const std::vector<Edge>& boundary() const { return boundary_; }
  const BoxTree& boundary_tree() const { return boundary_tree_; }
  const ism::Points2& positions() const { return x_; }
  const ism::TriangleMesh& mesh() const { return mesh_; }
  Box box(int f) const {
    return box_around(x_, std::array<int, 3>{corner(f, 0), corner(f, 1), corner(f, 2)});
  }
  Integer twice_area() const {
    Integer sum = 0;
    for (int f = 0; f < triangles(); ++f) sum += turn(point(f, 0), point(f, 1), point(f, 2));
    return sum;
  }
  bool is_on_boundary(int from, int to) const {
    return std::binary_search(boundary_.begin(), boundary_.end(), Edge{from, to, -1});
  }

  void check(const std::string& name, Report& report) const {
    const std::size_t before = report.faults.size();
    const auto fault = [&](const std::string& what, int id, const std::string& how) {
      report.faults.push_back(name + ": " + what + " " + std::to_string(id) + " " + how);
    };
    check_triangles(fault, report.counts);
    check_edges(fault);
    if (report.faults.size() > before) return;  // there are no fans and loops
    check_fans(fault, report.counts);
    check_boundary(fault, report.counts);
    if (report.faults.size() == before) check_loops(fault, report.counts);
  }

  /// How often boundary loops wind around a point that lies on none of them; all, or those but one.
  /// A ray to the right is crossed from below by what winds counter-clockwise. The point lies from
  /// y = lo to hi; what the tree leaves out is above or below.
  int winding(const Place& p, double lo, double hi, const std::vector<int>& loop_of = {},
              int but = -1) const {
    int sum = 0;
    const double far = std::numeric_limits<double>::infinity();
    boundary_tree_.for_each_at({{-far, lo}, {far, hi}}, [&](int i) {
      if (but >= 0 && loop_of[at(i)] == but) return;
      const Point &a = point(boundary_[at(i)].from), &b = point(boundary_[at(i)].to);
      const bool a_above = a.y * p.w > p.y, b_above = b.y * p.w > p.y;
      if (a_above == b_above) return;
      const int of_p = side(a, b, p);
      if (b_above && of_p > 0) ++sum;
      if (a_above && of_p < 0) --sum;
    });
    return sum;
  }

 private:
  bool has_edge(int from, int to) const {
    return std::binary_search(edges_.begin(), edges_.end(), Edge{from, to, -1});
  }

  template <class Fault>
  void check_triangles(const Fault& fault, Counts& counts) const {
    for (int f = 0; f < triangles(); ++f) {
      if (turn(point(f, 0), point(f, 1), point(f, 2)).sign() > 0)
        ++counts.triangles;
      else
        fault("triangle", f, "is not positive");
    }
  }

  template <class Fault>
  void check_edges(const Fault& fault) const {
    for (std::size_t i = 0; i + 1 < edges_.size(); ++i)
      if (!(edges_[i] < edges_[i + 1]))
        fault("triangle", edges_[i].face, "has an edge of another one");
    for (std::size_t i = 0; i + 1 < boundary_.size(); ++i)
      if (boundary_[i].from == boundary_[i + 1].from)
        fault("vertex", boundary_[i].from, "is on two boundaries");
  }

  /// The triangles at a vertex are one fan. It closes at an inner vertex, around which it turns by
  /// four right angles.
  template <class Fault>
  void check_fans(const Fault& fault, Counts& counts) const {
    std::vector<std::map<int, int>> spokes(points_.size());  // per vertex, the next one to the left
    for (int f = 0; f < triangles(); ++f)
      for (int k = 0; k < 3; ++k) spokes[at(corner(f, k))][corner(f, k + 1)] = corner(f, k + 2);
    std::vector<int> first(points_.size(), -1);
    for (const Edge& e : boundary_) first[at(e.from)] = e.to;
    for (int v = 0; v < size_of(points_.size()); ++v) {
      const std::map<int, int>& next = spokes[at(v)];
      const bool is_inner = first[at(v)] < 0;
      if (next.empty()) {
        fault("vertex", v, "is in no triangle");
        continue;
      }
      const std::vector<Point> fan = fan_of(v, is_inner ? next.begin()->first : first[at(v)], next);
      if (fan.size() != next.size() + (is_inner ? 0 : 1))
        fault("vertex", v, "has more than one fan around it");
      else if (is_inner && right_angles(fan) != 4)
        fault("vertex", v, "has angles around it that are not 2π");
      else
        counts.inner_vertices += is_inner;
    }
  }

  /// The directions to the neighbours of a vertex, from the first one to the left, until there is
  /// none, or the first one again.
  std::vector<Point> fan_of(int v, int first, const std::map<int, int>& next) const {
    std::vector<Point> directions;
    for (int u = first; directions.size() <= next.size();) {
      directions.push_back(point(u) - point(v));
      const auto turned = next.find(u);
      if (turned == next.end() || turned->second == first) break;
      u = turned->second;
    }
    return directions;
  }

  /// No two edges of the boundary have more in common than the vertex between them.
  template <class Fault>
  void check_boundary(const Fault& fault, Counts& counts) const {
    for (int i = 0; i < size_of(boundary_.size()); ++i) {
      const Edge& e = boundary_[at(i)];
      bool is_met = false;
      boundary_tree_.for_each_at(box_around(x_, std::array<int, 2>{e.from, e.to}), [&](int j) {
        is_met = is_met || (i < j && share_too_much(e, boundary_[at(j)]));
      });
      if (is_met)
        fault("the boundary behind vertex", e.from, "meets itself");
      else
        ++counts.boundary_edges;
    }
  }

  bool share_too_much(const Edge& e, const Edge& o) const {
    const auto folds_back = [&](int p, int q, int r) {
      return turn(point(p), point(q), point(r)).is_zero() &&
             dot(point(p) - point(q), point(r) - point(q)).sign() > 0;
    };
    if (e.to == o.from) return folds_back(e.from, e.to, o.to);
    if (o.to == e.from) return folds_back(o.from, o.to, e.to);
    return segments_meet(point(e.from), point(e.to), point(o.from), point(o.to));
  }

  /// Per edge of the boundary, its loop.
  std::vector<int> find_loops() const {
    std::map<int, int> edge_at;
    for (int i = 0; i < size_of(boundary_.size()); ++i) edge_at[boundary_[at(i)].from] = i;
    std::vector<int> loop_of(boundary_.size(), -1);
    int loops = 0;
    for (int i = 0; i < size_of(boundary_.size()); ++i) {
      if (loop_of[at(i)] >= 0) continue;
      for (int j = i; loop_of[at(j)] < 0; j = edge_at.at(boundary_[at(j)].to))
        loop_of[at(j)] = loops;
      ++loops;
    }
    return loop_of;
  }

  /// Loops, which are simple and apart, wind counter-clockwise around the domain and clockwise
  /// around its openings: the other ones wind around the first not at all, around the latter once.
  template <class Fault>
  void check_loops(const Fault& fault, Counts& counts) const {
    const std::vector<int> loop_of = find_loops();
    std::map<int, Integer> area;
    std::map<int, int> vertex;
    for (std::size_t i = 0; i < boundary_.size(); ++i) {
      vertex[loop_of[i]] = boundary_[i].from;
      area[loop_of[i]] += cross(point(boundary_[i].from), point(boundary_[i].to));
    }
    int outer = 0;
    for (const auto& [loop, twice_area] : area) {
      const int v = vertex[loop];
      const bool is_outer = twice_area.sign() > 0;
      if (winding(place(point(v)), x_(v, 1), x_(v, 1), loop_of, loop) != (is_outer ? 0 : 1))
        fault("the loop at vertex", v, "is not where it should be");
      outer += is_outer;
      counts.openings += !is_outer;
    }
    if (outer != 1) fault("there are", outer, "outer loops, and not one");
  }

  const ism::Points2& x_;
  const ism::TriangleMesh& mesh_;
  std::vector<Point> points_;
  std::vector<Edge> edges_, boundary_;  // sorted
  BoxTree boundary_tree_;
};

// ---- two triangles ----

/// Two triangles and on which side of their edges the corners of the other one are.
class TrianglePair {
 public:
  TrianglePair(const Domain& a, int face_a, const Domain& b, int face_b) {
    for (int k = 0; k < 3; ++k) {
      corner_[0][at(k)] = a.point(face_a, k);
      corner_[1][at(k)] = b.point(face_b, k);
    }
  }

  /// True if no edge has the other triangle on its right, or on it: then a common area is there.
  bool overlap() const { return !separates(0) && !separates(1); }

  /// Twice the common area of triangles that overlap. It is bounded by what the edges of either
  /// have within the other; what edges on one line share counts once.
  Ratio twice_area() const {
    Ratio sum;
    for (std::size_t of = 0; of < 2; ++of)
      for (std::size_t k = 0; k < 3; ++k) sum = sum + swept(of, k);
    return sum;
  }

 private:
  Integer turn_of(std::size_t of, std::size_t edge, const Point& p) const {
    return turn(corner_[of][edge], corner_[of][(edge + 1) % 3], p);
  }

  bool separates(std::size_t of) const {
    for (std::size_t k = 0; k < 3; ++k) {
      bool has_left = false;
      for (const Point& p : corner_[1 - of]) has_left = has_left || turn_of(of, k, p).sign() > 0;
      if (!has_left) return true;
    }
    return false;
  }

  /// Twice the area between the origin and what an edge has within the other triangle.
  Ratio swept(std::size_t of, std::size_t edge) const {
    const Point &p = corner_[of][edge], &q = corner_[of][(edge + 1) % 3];
    Ratio begin{0, 1}, end{1, 1};
    for (std::size_t k = 0; k < 3; ++k) {
      const Integer of_p = turn_of(1 - of, k, p), of_q = turn_of(1 - of, k, q);
      if (of_p.is_zero() && of_q.is_zero()) {
        if (of == 1) return {};  // it counts as one of the first triangle
        continue;
      }
      if (of_p.sign() <= 0 && of_q.sign() <= 0) return {};
      const Ratio crossing = of_p.sign() < 0 ? Ratio{-of_p, of_q - of_p} : Ratio{of_p, of_p - of_q};
      if (of_p.sign() < 0 && begin < crossing) begin = crossing;
      if (of_q.sign() < 0 && crossing < end) end = crossing;
    }
    if (!(begin < end)) return {};
    const Ratio part = end - begin;
    return {part.num * cross(p, q), part.den};
  }

  std::array<std::array<Point, 3>, 2> corner_;
};

// ---- corners ----

/// What a corner of the meta mesh is, in vertices: of an edge of A and of one of B, the lower one
/// first, which cross there; of a vertex, itself and -1, and -1 twice for the other mesh.
using Label = std::array<int, 4>;

inline bool is_crossing(const Label& l) { return l[1] >= 0 && l[3] >= 0; }

/// A side of a triangle, as it runs there.
struct TriangleSide {
  bool of_a;
  int from, to;
};
inline bool operator==(const TriangleSide& s, const TriangleSide& t) {
  return s.of_a == t.of_a && s.from == t.from && s.to == t.to;
}
inline bool operator<(const TriangleSide& s, const TriangleSide& t) {
  return std::array<int, 3>{s.of_a, s.from, s.to} < std::array<int, 3>{t.of_a, t.from, t.to};
}

inline bool lies_on(const Label& l, const TriangleSide& s) {
  const int first = s.of_a ? l[0] : l[2], second = s.of_a ? l[1] : l[3];
  if (second >= 0) return first == std::min(s.from, s.to) && second == std::max(s.from, s.to);
  return first >= 0 && (first == s.from || first == s.to);
}

/// Where a label says that a corner is.
struct Corner {
  Label label;
  bool exists = true;     // else the edges do not meet
  bool has_place = true;  // else the edges are on one line
  Place place{0, 0, 1};
};

/// The crossing of two edges; where they are on one line, the last of their lower ends.
inline void cross_edges(const Point& p, const Point& q, const Point& r, const Point& s, Corner& c) {
  c.exists = segments_meet(p, q, r, s);
  const Point d = q - p, e = s - r;
  const Integer den = cross(d, e);
  c.has_place = !den.is_zero();
  if (c.has_place) {
    c.place = between(p, q, ratio(cross(r - p, e), den));
  } else {
    const auto lower = [](const Point& u, const Point& v) {
      return u.x < v.x || (u.x == v.x && u.y < v.y) ? u : v;
    };
    const Point u = lower(p, q), v = lower(r, s);
    c.place = place(lower(u, v) == u ? v : u);
  }
}

// ---- the meta mesh ----

class MetaMeshChecker {
 public:
  MetaMeshChecker(const Domain& a, const Domain& b, const Lattice& lattice,
                  const ism::MetaMesh& meta, Report& report, const Integer& cones = 0)
      : a_(a),
        b_(b),
        lattice_(lattice),
        meta_(meta),
        report_(report),
        cones_(cones),
        vertices_(at(meta.on_a.rows())) {}

  void run() {
    find_overlaps();
    check_pairs();
    find_candidates();
    for (int p = 0; p < meta_.n_polygons(); ++p) check_polygon(p);
    if (!report_.ok()) return;  // the sum is that of polygons
    check_neighbours();
    check_rounded();
    if (report_.ok()) check_total();
    report_.coverage_a = coverage(a_, area_a_);
    report_.coverage_b = coverage(b_, area_b_);
  }

  /// Where a corner is; null if it has no place of its own.
  const Place* place_at(int corner) const {
    const MetaVertex& v = vertices_[at(id(corner))];
    return v.is_placed ? &v.corner.place : nullptr;
  }
  /// Twice the area of all polygons.
  const Rational& twice_area() const { return twice_area_; }

 private:
  struct MetaVertex {
    std::vector<Corner> candidates;
    bool is_seen = false, is_placed = false;
    Corner corner;  // that of them which was chosen, once it is placed
  };
  using Faces = std::array<int, 2>;
  static constexpr int kFew = 200;  // polygons, of which areas are summed in another way, too

  void fault(const std::string& what) { report_.faults.push_back("meta mesh: " + what); }
  void fault(int p, const std::string& what) {
    fault("polygon " + std::to_string(p) + " (triangles " + std::to_string(face_a(p)) + " and " +
          std::to_string(face_b(p)) + ") " + what);
  }

  int face_a(int p) const { return meta_.face_a[at(p)]; }
  int face_b(int p) const { return meta_.face_b[at(p)]; }
  int begin(int p) const { return meta_.offsets[at(p)]; }
  int end(int p) const { return meta_.offsets[at(p) + 1]; }
  int id(int corner) const { return meta_.corners[at(corner)]; }
  MetaVertex& vertex(int corner) { return vertices_[at(id(corner))]; }

  /// All pairs of triangles whose interiors meet.
  void find_overlaps() {
    std::vector<Box> boxes;
    for (int f = 0; f < b_.triangles(); ++f) boxes.push_back(b_.box(f));
    const BoxTree tree(boxes);
    for (int f = 0; f < a_.triangles(); ++f)
      tree.for_each_at(a_.box(f), [&](int g) {
        ++report_.counts.pairs;
        if (TrianglePair(a_, f, b_, g).overlap()) overlaps_.push_back({f, g});
      });
    std::sort(overlaps_.begin(), overlaps_.end());
    report_.counts.overlaps += size_of(overlaps_.size());
  }

  bool do_overlap(const Faces& pair) const {
    return std::binary_search(overlaps_.begin(), overlaps_.end(), pair);
  }

  void check_pairs() {
    std::vector<Faces> listed;
    for (int p = 0; p < meta_.n_polygons(); ++p) listed.push_back({face_a(p), face_b(p)});
    std::sort(listed.begin(), listed.end());
    const auto name = [](const Faces& pair) {
      return " of triangles " + std::to_string(pair[0]) + " and " + std::to_string(pair[1]);
    };
    for (std::size_t i = 0; i + 1 < listed.size(); ++i)
      if (listed[i] == listed[i + 1]) fault("there twice is the polygon" + name(listed[i]));
    for (const Faces& pair : overlaps_)
      if (!std::binary_search(listed.begin(), listed.end(), pair))
        fault("left out is the polygon" + name(pair));
  }

  // -- what corners are

  /// The candidates for one corner of a polygon. At a cone it is what its coordinates in this
  /// polygon say.
  std::vector<Corner> candidates_at(int p, int corner) {
    return is_at_cone(p, corner) ? corners_of(labels_of(p, corner)) : vertex(corner).candidates;
  }

  /// True on closed maps where a vertex of A is at a cone. One of B is, too; the library makes one
  /// of both, and breaks no ties there.
  bool is_at_cone(int p, int corner) const {
    if (cones_.is_zero()) return false;
    for (int k = 0; k < 3; ++k) {
      const Point& x = a_.point(face_a(p), k);
      if (meta_.corner_a(corner, k) == 1)
        return (x.x % cones_).is_zero() && (x.y % cones_).is_zero();
    }
    return false;
  }

  /// What a corner may be, as its coordinates say. They are exactly 0 beside an edge, and exactly 1
  /// at a vertex; other ones are rounded, and not looked at.
  std::vector<Label> labels_of(int p, int corner) const {
    const auto w = [&](bool of_a, int k) {
      return of_a ? meta_.corner_a(corner, k) : meta_.corner_b(corner, k);
    };
    std::vector<Label> labels;
    for (int k = 0; k < 3; ++k) {
      const int u = a_.corner(face_a(p), k), v = b_.corner(face_b(p), k);
      const int l = (k + 1) % 3, m = (k + 2) % 3;
      if (w(true, k) == 1 && w(true, l) == 0 && w(true, m) == 0) labels.push_back({u, -1, -1, -1});
      if (w(false, k) == 1 && w(false, l) == 0 && w(false, m) == 0)
        labels.push_back({-1, -1, v, -1});
    }
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < 3; ++l) {
        if (w(true, (k + 2) % 3) != 0 || w(false, (l + 2) % 3) != 0) continue;
        const int u = a_.corner(face_a(p), k), v = a_.corner(face_a(p), k + 1);
        const int r = b_.corner(face_b(p), l), s = b_.corner(face_b(p), l + 1);
        labels.push_back({std::min(u, v), std::max(u, v), std::min(r, s), std::max(r, s)});
      }
    std::sort(labels.begin(), labels.end());
    return labels;
  }

  Corner corner_of(const Label& label) const {
    Corner c;
    c.label = label;
    if (is_crossing(label))
      cross_edges(a_.point(label[0]), a_.point(label[1]), b_.point(label[2]), b_.point(label[3]),
                  c);
    else
      c.place = place(label[0] >= 0 ? a_.point(label[0]) : b_.point(label[2]));
    return c;
  }

  /// Those that exist, and last those without a place.
  std::vector<Corner> corners_of(const std::vector<Label>& labels) const {
    std::vector<Corner> corners;
    for (const Label& label : labels) {
      const Corner c = corner_of(label);
      if (c.exists) corners.push_back(c);
    }
    std::stable_partition(corners.begin(), corners.end(),
                          [](const Corner& c) { return c.has_place; });
    return corners;
  }

  /// A vertex of the meta mesh is one thing in all polygons it is a corner of.
  void find_candidates() {
    std::vector<std::vector<Label>> labels(vertices_.size());
    for (int p = 0; p < meta_.n_polygons(); ++p)
      for (int i = begin(p); i < end(p); ++i) {
        const std::vector<Label> here = labels_of(p, i);
        std::vector<Label>& all = labels[at(id(i))];
        std::vector<Label> both;
        std::set_intersection(all.begin(), all.end(), here.begin(), here.end(),
                              std::back_inserter(both));
        all = vertex(i).is_seen ? both : here;
        vertex(i).is_seen = true;
        if (all.empty()) fault(p, "has a corner that is neither a vertex nor a crossing");
      }
    for (std::size_t v = 0; v < vertices_.size(); ++v) {
      vertices_[v].candidates = corners_of(labels[v]);
      report_.counts.told_in_many_ways += vertices_[v].candidates.size() > 1;
    }
  }

  // -- polygons

  /// One way to read a polygon: what its corners are, as places among the candidates, and the sides
  /// between corners i and i + 1.
  struct Reading {
    std::vector<std::vector<Corner>> candidates;
    std::vector<int> choice;
    std::vector<TriangleSide> sides;

    int size() const { return size_of(candidates.size()); }
    const Corner& corner(int i) const { return candidates[at(i)][at(choice[at(i)])]; }
  };

  /// The side of one of the triangles on which two corners lie; there is one, or none.
  bool common_side(int p, const Label& from, const Label& to, TriangleSide& side) const {
    int found = 0;
    for (const bool of_a : {true, false})
      for (int k = 0; k < 3; ++k) {
        const Domain& m = of_a ? a_ : b_;
        const int f = of_a ? face_a(p) : face_b(p);
        const TriangleSide s{of_a, m.corner(f, k), m.corner(f, k + 1)};
        if (from == to || !lies_on(from, s) || !lies_on(to, s)) continue;
        side = s;
        ++found;
      }
    return found == 1;
  }

  /// Finds a reading whose corners are connected by sides of the triangles, each once, and with the
  /// area that there must be.
  bool read(int p, const Ratio& twice_area, Reading& reading) {
    const int n = reading.size(), i = size_of(reading.choice.size());
    const auto add_side = [&](int from, int to) {
      TriangleSide s;
      if (!common_side(p, reading.corner(from).label, reading.corner(to).label, s) ||
          std::find(reading.sides.begin(), reading.sides.end(), s) != reading.sides.end())
        return false;
      reading.sides.push_back(s);
      return true;
    };
    if (i == n) {
      if (!add_side(n - 1, 0)) return false;
      if (fits(p, twice_area, reading)) return true;
      reading.sides.pop_back();
      return false;
    }
    for (int c = 0; c < size_of(reading.candidates[at(i)].size()); ++c) {
      reading.choice.push_back(c);
      const bool is_connected = i == 0 || add_side(i - 1, i);
      if (is_connected && read(p, twice_area, reading)) return true;
      if (is_connected && i > 0) reading.sides.pop_back();
      reading.choice.pop_back();
    }
    return false;
  }

  bool fits(int p, const Ratio& twice_area, const Reading& reading) {
    std::vector<Place> places;
    for (int i = 0; i < reading.size(); ++i) {
      const Corner& c = reading.corner(i);
      const MetaVertex& v = vertex(begin(p) + i);
      if (!c.has_place) continue;
      if (v.is_placed && !(v.corner.place == c.place)) return false;
      places.push_back(c.place);
    }
    return area_of(places) == twice_area && are_convex(places, !twice_area.num.is_zero());
  }

  static Ratio area_of(const std::vector<Place>& places) {
    Ratio sum;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const Place &p = places[i], &q = places[(i + 1) % places.size()];
      sum = sum + Ratio{p.x * q.y - p.y * q.x, p.w * q.w};
    }
    return sum;
  }

  /// Corners go around once, to the left or straight on; without area, they go there and back.
  static bool are_convex(const std::vector<Place>& places, bool has_area) {
    std::vector<Point> directions;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const Point d = direction(places[i], places[(i + 1) % places.size()]);
      if (!d.x.is_zero() || !d.y.is_zero()) directions.push_back(d);
    }
    int reversals = 0;
    for (std::size_t i = 0; i < directions.size(); ++i) {
      const Point &d = directions[i], &e = directions[(i + 1) % directions.size()];
      const int sign = cross(d, e).sign();
      if (sign < 0 || (sign > 0 && !has_area)) return false;
      reversals += sign == 0 && dot(d, e).sign() < 0;
    }
    if (!has_area) return reversals <= 2;
    return reversals == 0 && right_angles(directions) == 4;
  }

  void check_polygon(int p) {
    const bool has_area = do_overlap({face_a(p), face_b(p)});
    const Ratio area =
        has_area ? TrianglePair(a_, face_a(p), b_, face_b(p)).twice_area() : Ratio{0, 1};
    Reading reading;
    for (int i = begin(p); i < end(p); ++i) reading.candidates.push_back(candidates_at(p, i));
    if (!read(p, area, reading)) {
      fault(p, "has not the corners, in this order, that enclose what the triangles share");
      return;
    }
    ++(has_area ? report_.counts.polygons : report_.counts.without_area);
    for (int i = 0; i < reading.size(); ++i) {
      const Corner& c = reading.corner(i);
      MetaVertex& v = vertex(begin(p) + i);
      ++report_.counts.corners;
      report_.counts.crossings += is_crossing(c.label);
      report_.counts.parallel += !c.has_place;
      if (c.has_place && !v.is_placed) {
        v.is_placed = true;
        v.corner = c;
      }
      const int next = begin(p) + (i + 1) % reading.size();
      if (!sides_.insert({{id(begin(p) + i), id(next)}, p}).second)
        fault(p, "has a side that another one has");
    }
    area_a_[face_a(p)].push_back(area);
    area_b_[face_b(p)].push_back(area);
  }

  // -- neighbours and areas

  /// What has no neighbour is on a boundary.
  void check_neighbours() {
    for (const auto& [ends, p] : sides_) {
      if (sides_.count({ends[1], ends[0]}) > 0) continue;
      TriangleSide side;
      if (find_boundary(p, place_of(ends[0]), place_of(ends[1]), side))
        rim_.push_back({ends, side});
      else
        fault(p, "has no neighbour at one side, and both surfaces go on");
    }
  }

  /// The side of one of the triangles that is on a boundary and has two places on it.
  bool find_boundary(int p, const Place& from, const Place& to, TriangleSide& found) const {
    for (const bool of_a : {true, false})
      for (int k = 0; k < 3; ++k) {
        const Domain& m = of_a ? a_ : b_;
        const int f = of_a ? face_a(p) : face_b(p);
        found = {of_a, m.corner(f, k), m.corner(f, k + 1)};
        if (!m.is_on_boundary(found.from, found.to)) continue;
        const Point &u = m.point(found.from), &v = m.point(found.to);
        if (side(u, v, from) == 0 && side(u, v, to) == 0) return true;
      }
    return false;
  }

  const Place& place_of(int v) const {
    const MetaVertex& vertex = vertices_[at(v)];
    return vertex.is_placed ? vertex.corner.place : vertex.candidates[0].place;
  }

  /// What the meta mesh tells of corners in doubles is where they are, but for rounding.
  void check_rounded() {
    const ism::Points2 &f = a_.positions(), &g = b_.positions();
    const double size = std::max(f.cwiseAbs().maxCoeff(), g.cwiseAbs().maxCoeff());
    for (int p = 0; p < meta_.n_polygons(); ++p)
      for (int i = begin(p); i < end(p); ++i) {
        if (!vertex(i).is_placed) continue;
        const Corner& exact = vertex(i).corner;
        const Vector x = rounded(exact.place);
        const Vector in_f = position_in(a_.mesh(), f, face_a(p), meta_.corner_a.row(i));
        const Vector in_g = position_in(b_.mesh(), g, face_b(p), meta_.corner_b.row(i));
        const double error = std::max({(in_f - in_g).norm(), error_of(exact.label, in_f - x),
                                       error_of(exact.label, in_g - x)});
        report_.counts.largest_error = std::max(report_.counts.largest_error, error / size);
        if (!(error <= 1e-9 * size)) fault(p, "has a corner that is rounded to another place");
      }
  }

  Vector rounded(const Place& p) const {
    return Vector(lattice_.inverse(p.x, p.w), lattice_.inverse(p.y, p.w));
  }

  /// How far a displacement leads away from a vertex; or from two edges, along which rounding may
  /// move their crossing where they are nearly parallel.
  double error_of(const Label& l, const Vector& d) const {
    if (!is_crossing(l)) return d.norm();
    const auto across = [&](const Domain& m, int u, int v) {
      const Vector e = m.positions().row(v) - m.positions().row(u);
      return std::abs(d.x() * e.y() - d.y() * e.x()) / e.norm();
    };
    return std::max(across(a_, l[0], l[1]), across(b_, l[2], l[3]));
  }

  /// The sum of what the sides of polygons sweep. Sides of neighbours cancel; so do, on one edge of
  /// a boundary, the ends that two sides share.
  Rational twice_area_of_polygons() {
    std::map<TriangleSide, std::map<int, int>> ends_on;
    for (const auto& [ends, side] : rim_) {
      --ends_on[side][ends[0]];
      ++ends_on[side][ends[1]];
    }
    std::vector<Rational> terms;
    for (const auto& [side, ends] : ends_on) {
      const Domain& m = side.of_a ? a_ : b_;
      const Point &p = m.point(side.from), &q = m.point(side.to);
      for (const auto& [v, times] : ends) {
        if (times == 0) continue;
        const Ratio t = parameter(p, q, place_of(v));
        terms.push_back(reduced({times * t.num * cross(p, q), t.den}));
      }
    }
    return sum_of(terms);
  }

  /// Twice what the boundary of one domain sweeps within the other. Where boundaries lie on each
  /// other, it belongs to both domains if they are on one side; it counts as one of the first.
  void sweep_boundary(const Domain& m, const Domain& other, bool is_first,
                      std::vector<Rational>& terms) const {
    for (const Edge& e : m.boundary()) {
      const Point &p = m.point(e.from), &q = m.point(e.to);
      const std::vector<Ratio> cuts = cuts_of(m, e, other);
      Ratio sum;
      for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
        const Ratio middle = {cuts[i].num * cuts[i + 1].den + cuts[i + 1].num * cuts[i].den,
                              2 * cuts[i].den * cuts[i + 1].den};
        if (counts_there(m, e, between(p, q, middle), other, is_first))
          sum = sum + (cuts[i + 1] - cuts[i]);
      }
      if (!sum.num.is_zero()) terms.push_back(reduced({sum.num * cross(p, q), sum.den}));
    }
  }

  /// Where the boundary of the other domain meets an edge, with its ends, in order.
  static std::vector<Ratio> cuts_of(const Domain& m, const Edge& e, const Domain& other) {
    const Point &p = m.point(e.from), &q = m.point(e.to);
    std::vector<Ratio> cuts = {{0, 1}, {1, 1}};
    const auto add = [&](const Ratio& t) {
      if (t.num.sign() > 0 && t.num < t.den) cuts.push_back(t);
    };
    const Box box = box_around(m.positions(), std::array<int, 2>{e.from, e.to});
    other.boundary_tree().for_each_at(box, [&](int i) {
      const Point &r = other.point(other.boundary()[at(i)].from),
                  &s = other.point(other.boundary()[at(i)].to);
      if (!segments_meet(p, q, r, s)) return;
      const Integer of_p = turn(r, s, p), of_q = turn(r, s, q);
      if (of_p != of_q) return add(ratio(of_p, of_p - of_q));
      add(parameter(p, q, place(r)));
      add(parameter(p, q, place(s)));
    });
    std::sort(cuts.begin(), cuts.end());
    cuts.erase(std::unique(cuts.begin(), cuts.end()), cuts.end());
    return cuts;
  }

  static bool counts_there(const Domain& m, const Edge& e, const Place& middle, const Domain& other,
                           bool is_first) {
    const Point &p = m.point(e.from), &q = m.point(e.to);
    bool is_boundary = false, runs_along = false;  // of the other domain, too; and the same way
    const Box box = box_around(m.positions(), std::array<int, 2>{e.from, e.to});
    other.boundary_tree().for_each_at(box, [&](int i) {
      const Point &r = other.point(other.boundary()[at(i)].from),
                  &s = other.point(other.boundary()[at(i)].to);
      if (side(r, s, middle) != 0) return;
      const Ratio t = parameter(r, s, middle);
      if (t.num.sign() <= 0 || !(t.num < t.den)) return;
      is_boundary = true;
      runs_along = runs_along || dot(q - p, s - r).sign() > 0;
    });
    if (is_boundary) return is_first && runs_along;
    return other.winding(middle, box.lo[1], box.hi[1]) == 1;
  }

  void check_total() {
    std::vector<Rational> terms;
    sweep_boundary(a_, b_, true, terms);
    sweep_boundary(b_, a_, false, terms);
    const Rational common = sum_of(terms);
    twice_area_ = twice_area_of_polygons();
    if (twice_area_ != common) fault("the polygons have not the area common to the domains");
    if (meta_.n_polygons() <= kFew && plain_sum() != twice_area_)
      fault("the sum of areas is not that of what sides sweep");
    report_.area =
        lattice_.area({Integer(mp::numerator(common)), Integer(mp::denominator(common))});
    ++report_.counts.maps;
  }

  /// The sum of areas as it stands, of which the denominators get long.
  Rational plain_sum() const {
    std::vector<Rational> terms;
    for (const auto& [face, areas] : area_a_)
      for (const Ratio& area : areas) terms.push_back(reduced(area));
    return sum_of(terms);
  }

  static long double squared(long double x) { return x * x; }

  /// The part of a surface under its polygons. Planar areas are exact, those in space are rounded.
  static double coverage(const Domain& m, const std::map<int, std::vector<Ratio>>& areas) {
    long double covered = 0, all = 0;
    for (int f = 0; f < m.triangles(); ++f) {
      Eigen::Matrix<long double, 3, 3> x;
      for (int k = 0; k < 3; ++k)
        x.row(k) = m.mesh().vertices.row(m.corner(f, k)).cast<long double>();
      const Eigen::Matrix<long double, 1, 3> u = x.row(1) - x.row(0), v = x.row(2) - x.row(0);
      const long double area =
          std::sqrt(squared(u[1] * v[2] - u[2] * v[1]) + squared(u[2] * v[0] - u[0] * v[2]) +
                    squared(u[0] * v[1] - u[1] * v[0]));
      all += area;
      const auto here = areas.find(f);
      if (here == areas.end()) continue;
      const Integer twice_area = turn(m.point(f, 0), m.point(f, 1), m.point(f, 2));
      for (const Ratio& r : here->second)
        covered += area * static_cast<long double>(to_double(r.num, r.den * twice_area));
    }
    return static_cast<double>(covered / all);
  }

  const Domain &a_, &b_;
  const Lattice& lattice_;
  const ism::MetaMesh& meta_;
  Report& report_;
  const Integer cones_;  // lie at its multiples; 0: there are none
  std::vector<MetaVertex> vertices_;
  std::vector<Faces> overlaps_;              // sorted
  std::map<std::array<int, 2>, int> sides_;  // of polygons, by their ends
  std::vector<std::pair<std::array<int, 2>, TriangleSide>> rim_;
  std::map<int, std::vector<Ratio>> area_a_, area_b_;  // per triangle, of its polygons, twice
  Rational twice_area_;
};

// ---- closed maps ----

/// x → sign x + 2 kPillowSide (i, j): takes what lies on a pillow to another place. 0: none.
struct Motion {
  int sign = 0, i = 0, j = 0;
  Vector operator()(const Vector& x) const { return sign * x + 2 * kPillowSide * Vector(i, j); }
};
inline bool operator==(const Motion& m, const Motion& n) {
  return m.sign == n.sign && m.i == n.i && m.j == n.j;
}

/// What takes a polygon from the plane of g to that of f.
inline Motion motion_of(const MapData& map, int p) {
  const ism::MetaMesh& meta = map.meta;
  Motion best;
  double least = kSamePlace;
  for (const int sign : {1, -1}) {
    Motion motion;
    double error = 0;
    for (int i = meta.offsets[at(p)]; i < meta.offsets[at(p) + 1]; ++i) {
      const Vector in_f = position_in(map.a, map.f, meta.face_a[at(p)], meta.corner_a.row(i));
      const Vector in_g = position_in(map.b, map.g, meta.face_b[at(p)], meta.corner_b.row(i));
      const Vector steps = (in_f - sign * in_g) / (2 * kPillowSide);
      if (motion.sign == 0)
        motion = {sign, static_cast<int>(std::lround(steps.x())),
                  static_cast<int>(std::lround(steps.y()))};
      error = std::max(error, (in_f - motion(in_g)).norm());
    }
    if (error < least) least = error, best = motion;
  }
  return best;
}

/// Writes a closed map as one of f(A) and copies of g(B), one per motion among the polygons. A
/// vertex of the meta mesh becomes one for each copy of B, and for each place in the plane of f.
class Unfolding {
 public:
  /// False if there is none: a polygon has no motion, or moved positions are rounded.
  bool unfold(const MapData& closed) {
    map = closed;
    for (int p = 0; p < map.meta.n_polygons(); ++p) {
      const Motion motion = motion_of(closed, p);
      const auto known = std::find(motions_.begin(), motions_.end(), motion);
      const int copy = static_cast<int>(known - motions_.begin());
      if (motion.sign == 0) return false;
      if (known == motions_.end()) motions_.push_back(motion);
      split_vertices(p, copy);
      map.meta.face_b[at(p)] += copy * static_cast<int>(closed.b.triangles.rows());
    }
    map.meta.on_a = map.meta.on_b = ism::Points3::Zero(vertices_, 3);
    map.meta.plane = ism::Points2::Zero(vertices_, 2);
    return copy_b(closed);
  }
  int copies() const { return size_of(motions_.size()); }

  MapData map;

 private:
  void split_vertices(int p, int copy) {
    ism::MetaMesh& meta = map.meta;
    for (int i = meta.offsets[at(p)]; i < meta.offsets[at(p) + 1]; ++i) {
      const Vector x = position_in(map.a, map.f, meta.face_a[at(p)], meta.corner_a.row(i));
      auto& known = known_[{meta.corners[at(i)], copy}];
      auto it = std::find_if(known.begin(), known.end(), [&](const std::pair<Vector, int>& v) {
        return (v.first - x).norm() < kSamePlace;
      });
      if (it == known.end()) it = known.insert(it, {x, vertices_++});
      meta.corners[at(i)] = it->second;
    }
  }

  bool copy_b(const MapData& closed) {
    const Eigen::Index n = closed.g.rows(), faces = closed.b.triangles.rows();
    map.g.resize(n * copies(), 2);
    map.b = {ism::Points3(n * copies(), 3), ism::Triangles(faces * copies(), 3)};
    bool is_exact = true;
    for (int c = 0; c < copies(); ++c) {
      map.b.vertices.middleRows(c * n, n) = closed.b.vertices;
      map.b.triangles.middleRows(c * faces, faces) =
          (closed.b.triangles.array() + c * static_cast<int>(n)).matrix();
      const Motion& motion = motions_[at(c)];
      const Vector shift = motion({0, 0});
      for (Eigen::Index v = 0; v < n; ++v) {
        map.g.row(c * n + v) = motion(closed.g.row(v));
        is_exact = is_exact && map.g.row(c * n + v) - shift == motion.sign * closed.g.row(v);
      }
    }
    return is_exact;
  }

  std::vector<Motion> motions_;
  std::map<std::array<int, 2>, std::vector<std::pair<Vector, int>>> known_;  // by vertex and copy
  int vertices_ = 0;
};

/// True if motions of a pillow take one place to the other.
inline bool are_same_on_pillow(const Place& p, const Place& q, const Integer& period) {
  const Integer whole = period * p.w * q.w, x = p.x * q.w, y = p.y * q.w;
  for (const int sign : {1, -1})
    if (((x - sign * q.x * p.w) % whole).is_zero() && ((y - sign * q.y * p.w) % whole).is_zero())
      return true;
  return false;
}

/// Every side has one neighbour, and every vertex is one point of the pillow.
inline void check_sewn(const ism::MetaMesh& meta, const MetaMeshChecker& unfolded,
                       const Integer& period, Report& report) {
  std::map<std::array<int, 2>, int> sides;  // how many run this way
  std::vector<const Place*> place(at(meta.on_a.rows()));
  for (int p = 0; p < meta.n_polygons(); ++p)
    for (int i = meta.offsets[at(p)], end = meta.offsets[at(p) + 1]; i < end; ++i) {
      const int u = meta.corners[at(i)];
      const int v = meta.corners[at(i + 1 < end ? i + 1 : meta.offsets[at(p)])];
      ++sides[{u, v}];
      const Place *here = unfolded.place_at(i), *&known = place[at(u)];
      if (known != nullptr && here != nullptr && !are_same_on_pillow(*known, *here, period))
        report.faults.push_back("meta mesh: vertex " + std::to_string(u) + " is at two places");
      if (known == nullptr) known = here;
    }
  for (const auto& [ends, times] : sides)
    if (times != 1 || ends[0] == ends[1] || sides.count({ends[1], ends[0]}) == 0)
      report.faults.push_back("meta mesh: the side from vertex " + std::to_string(ends[0]) +
                              " to " + std::to_string(ends[1]) + " has not one neighbour");
}

// ---- checks ----

/// Arrays of the meta mesh fit together, and ids are in range.
inline bool is_formed(const MapData& map) {
  const ism::MetaMesh& meta = map.meta;
  const std::size_t n = meta.face_a.size(), corners = meta.corners.size();
  bool fits = meta.face_b.size() == n && meta.offsets.size() == n + 1 && meta.offsets[0] == 0 &&
              meta.offsets[n] == size_of(corners) && at(meta.corner_a.rows()) == corners &&
              at(meta.corner_b.rows()) == corners && meta.on_b.rows() == meta.on_a.rows() &&
              meta.plane.rows() == meta.on_a.rows();
  for (std::size_t p = 0; fits && p < n; ++p) {
    const int size = meta.offsets[p + 1] - meta.offsets[p];
    fits = 3 <= size && size <= 6 && meta.face_a[p] >= 0 && meta.face_b[p] >= 0 &&
           meta.face_a[p] < map.a.triangles.rows() && meta.face_b[p] < map.b.triangles.rows();
  }
  for (std::size_t i = 0; fits && i < corners; ++i)
    fits = meta.corners[i] >= 0 && meta.corners[i] < meta.on_a.rows();
  return fits;
}

inline bool are_sound(const ism::TriangleMesh& mesh, const ism::Points2& x) {
  return x.rows() == mesh.vertices.rows() && x.rows() > 0 && mesh.triangles.rows() > 0 &&
         x.allFinite() && mesh.triangles.minCoeff() >= 0 && mesh.triangles.maxCoeff() < x.rows();
}

inline Lattice lattice_of(std::initializer_list<const ism::Points2*> positions) {
  Lattice lattice;
  for (const ism::Points2* x : positions)
    for (Eigen::Index i = 0; i < x->size(); ++i) lattice.include(x->data()[i]);
  return lattice;
}

/// Of one embedding.
inline Report check(const ism::TriangleMesh& mesh, const ism::Points2& x) {
  Report report;
  if (are_sound(mesh, x))
    Domain(mesh, x, lattice_of({&x})).check("embedding", report);
  else
    report.faults.push_back("embedding: arrays do not fit together");
  return report;
}

/// Of a closed map with injective embeddings.
inline void check_closed(const MapData& map, Report& report) {
  Unfolding flat;
  if (!flat.unfold(map)) {
    report.faults.push_back("meta mesh: a polygon is at two places of the pillow");
    return;
  }
  const Lattice lattice = lattice_of({&map.f, &map.g, &flat.map.g});
  const Domain a(map.a, map.f, lattice), b(map.b, map.g, lattice);
  const Domain copies(flat.map.b, flat.map.g, lattice);
  const Integer side = lattice(kPillowSide), pillow = 4 * side * side;
  if (a.twice_area() != pillow || b.twice_area() != pillow)
    report.faults.push_back("map: a surface has not the area of the pillow");
  MetaMeshChecker checker(a, copies, lattice, flat.map.meta, report, side);
  checker.run();
  report.coverage_b *= flat.copies();
  if (!report.ok()) return;
  if (checker.twice_area() != Rational(mp::cpp_int(pillow)))
    report.faults.push_back("meta mesh: the polygons have not the area of the pillow");
  check_sewn(map.meta, checker, 2 * side, report);
}

/// Of a map. The meta mesh is looked at only if both embeddings are injective.
inline Report check(const MapData& map) {
  Report report;
  if (!are_sound(map.a, map.f) || !are_sound(map.b, map.g)) {
    report.faults.push_back("map: arrays do not fit together");
    return report;
  }
  const Lattice lattice = lattice_of({&map.f, &map.g});
  const Domain a(map.a, map.f, lattice), b(map.b, map.g, lattice);
  a.check("f", report);
  b.check("g", report);
  if (!report.ok()) return report;
  if (!is_formed(map))
    report.faults.push_back("meta mesh: arrays do not fit together");
  else if (map.is_closed)
    check_closed(map, report);
  else
    MetaMeshChecker(a, b, lattice, map.meta, report).run();
  return report;
}

}  // namespace rational

#endif  // ISM_TESTS_RATIONAL_HPP

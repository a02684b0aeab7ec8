// Exact predicates against integer arithmetic that cannot round, and against actual perturbations.

#ifndef ISM_TESTS_PART_PREDICATES_HPP
#define ISM_TESTS_PART_PREDICATES_HPP

#include "ism.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <cfenv>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

namespace predicate_tests {
namespace {

using ism::detail::LabelledPoint;
using ism::detail::orient2d;
using ism::detail::oriented;
using ism::detail::Vec2;
using shapes::Rng;

__extension__ typedef __int128 Int128;

int sign_of(double x) { return (x > 0) - (x < 0); }
int sign_of(Int128 x) { return (x > 0) - (x < 0); }

/// A sum of integer multiples of powers of a base B, exponents of either sign. Read with B = 2^32
/// it is any double and any sum or product of doubles; read with B = ε it is a number with
/// infinitesimal parts.
class PowerSum {
 public:
  PowerSum() = default;
  explicit PowerSum(long long value) { add(value, 0); }

  void add(Int128 factor, long long exponent) { factors_[exponent] += factor; }

  /// x exactly, with B = 2^32.
  static PowerSum of_double(double x) {
    PowerSum sum;
    int exponent = 0;
    const double mantissa = std::frexp(x, &exponent);
    const auto digits = static_cast<long long>(std::ldexp(mantissa, 53));  // x = digits 2^e
    const int e = exponent - 53, words = e >= 0 ? e / 32 : -((31 - e) / 32);
    const Int128 shifted = Int128(digits) * (Int128(1) << (e - 32 * words));  // below 2^85
    for (int k = 0; k < 3; ++k) {
      const Int128 magnitude = shifted < 0 ? -shifted : shifted;
      const Int128 word = (magnitude >> (32 * k)) & 0xFFFFFFFFll;
      sum.add(shifted < 0 ? -word : word, words + k);
    }
    return sum;
  }

  friend PowerSum operator-(PowerSum a, const PowerSum& b) {
    for (const auto& term : b.factors_) a.add(-term.second, term.first);
    return a;
  }

  friend PowerSum operator*(const PowerSum& a, const PowerSum& b) {
    PowerSum product;
    for (const auto& s : a.factors_)
      for (const auto& t : b.factors_) product.add(s.second * t.second, s.first + t.first);
    return product;
  }

  /// The sign for infinitesimal positive B: that of the lowest power.
  int sign_if_infinitesimal() const {
    for (const auto& term : factors_)
      if (term.second != 0) return sign_of(term.second);
    return 0;
  }

  /// The sign for B = 2^32: carries go up, what remains below is not negative.
  int sign_if_word() const {
    Int128 carry = 0;
    bool rest = false;
    long long at = 0;
    for (const auto& term : factors_) {
      for (int step = 0; carry != 0 && step < 5 && at < term.first; ++step, ++at) {
        const Int128 above = carry >> 32;  // rounds down; 0 or -1 from the fourth step on
        rest = rest || carry != above * (Int128(1) << 32);
        carry = above;
      }
      at = term.first;
      carry += term.second;
    }
    return carry != 0 ? sign_of(carry) : rest ? 1 : 0;
  }

 private:
  std::map<long long, Int128> factors_;
};

struct ExactPoint {
  PowerSum x, y;
};

PowerSum exact_orientation(const ExactPoint& a, const ExactPoint& b, const ExactPoint& c) {
  return (a.x - c.x) * (b.y - c.y) - (a.y - c.y) * (b.x - c.x);
}

ExactPoint exact(Vec2 p) { return {PowerSum::of_double(p.x), PowerSum::of_double(p.y)}; }

int exact_sign(Vec2 a, Vec2 b, Vec2 c) {
  return exact_orientation(exact(a), exact(b), exact(c)).sign_if_word();
}

int integer_sign(Vec2 a, Vec2 b, Vec2 c) {
  const auto whole = [](double x) { return Int128(static_cast<long long>(x)); };
  return sign_of((whole(a.x) - whole(c.x)) * (whole(b.y) - whole(c.y)) -
                 (whole(a.y) - whole(c.y)) * (whole(b.x) - whole(c.x)));
}

int sign(Vec2 a, Vec2 b, Vec2 c) { return sign_of(orient2d(a, b, c)); }

Vec2 lattice_point(int x, int y) { return {static_cast<double>(x), static_cast<double>(y)}; }

/// The points of an n×n integer grid.
std::vector<Vec2> grid_points(int n) {
  std::vector<Vec2> points;
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x) points.push_back(lattice_point(x, y));
  return points;
}

Vec2 random_point(Rng& rng, double size) { return shapes::to_vec2(rng.point(size)); }

/// With integer coordinates from lo to hi.
Vec2 random_lattice_point(Rng& rng, int lo, int hi) {
  const int x = rng.between(lo, hi);
  return lattice_point(x, rng.between(lo, hi));
}

/// With integer coordinates of at most this size.
Vec2 random_whole_point(Rng& rng, double size) {
  return shapes::to_vec2(rng.point(size).array().round());
}

double random_magnitude(Rng& rng, int lowest, int highest) {
  const double mantissa = rng.uniform(1, 2) * (rng.below(2) ? 1 : -1);
  return std::ldexp(mantissa, rng.between(lowest, highest - 1));
}

/// x moved by at most two of its last places.
double nudged(double x, Rng& rng) {
  for (int k = rng.below(3); k > 0; --k) x = std::nextafter(x, rng.below(2) ? 1e300 : -1e300);
  return x;
}

/// Calls visit(a, b, c) for all triples of points, repetitions included.
template <class Visit>
void for_each_triple(const std::vector<Vec2>& points, Visit visit) {
  for (const Vec2& a : points)
    for (const Vec2& b : points)
      for (const Vec2& c : points) visit(a, b, c);
}

}  // namespace

TEST_CASE("orient2d agrees with integer arithmetic on every triple of a small grid") {
  int wrong = 0, ties = 0;
  for_each_triple(grid_points(6), [&](Vec2 a, Vec2 b, Vec2 c) {
    wrong += sign(a, b, c) != integer_sign(a, b, c);
    ties += sign(a, b, c) == 0;
  });
  CHECK(wrong == 0);
  CHECK(ties > 1000);
}

TEST_CASE("orient2d agrees with integer arithmetic for 52-bit coordinates of thin triangles") {
  Rng rng(1);
  int wrong = 0, signs[3] = {0, 0, 0};
  for (int i = 0; i < 20000; ++i) {
    const double bits = std::ldexp(1.0, rng.between(20, 50));
    const Vec2 a = random_whole_point(rng, bits), d = random_whole_point(rng, bits);
    const Vec2 b = a + 2 * d;  // a, a + d, a + 2 d are collinear
    const Vec2 c = a + d + random_lattice_point(rng, -1, 1);
    const int s = sign(a, b, c);
    wrong += s != integer_sign(a, b, c) || s != exact_sign(a, b, c);
    ++signs[s + 1];
  }
  CHECK(wrong == 0);
  for (int count : signs) CHECK(count > 1000);
}

TEST_CASE("orient2d decides points within a few last places of a line") {
  Rng rng(2);
  int wrong = 0, signs[3] = {0, 0, 0}, rounded_wrong = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec2 a = random_point(rng, 1), b = random_point(rng, 1);
    const double t = rng.below(4) == 0 ? 0.5 : rng.uniform(-1, 2);
    Vec2 c = a + t * (b - a);
    c = {nudged(c.x, rng), nudged(c.y, rng)};
    const int s = exact_sign(a, b, c);
    wrong += sign(a, b, c) != s;
    ++signs[s + 1];
    const double naive = (a - c).x * (b - c).y - (a - c).y * (b - c).x;
    rounded_wrong += sign_of(naive) != s;
  }
  CHECK(wrong == 0);
  CHECK(rounded_wrong > 100);  // the cases are hard enough to need exact arithmetic
  CHECK(signs[0] > 1000);
  CHECK(signs[2] > 1000);
}

TEST_CASE("orient2d decides neighbouring doubles beside a diagonal") {
  const Vec2 b = {12, 12}, c = {24, 24};
  int wrong = 0, ties = 0;
  for (int i = 0; i < 128; ++i)
    for (int j = 0; j < 128; ++j) {
      const Vec2 a = {0.5 + i * 0x1p-53, 0.5 + j * 0x1p-53};
      wrong += sign(a, b, c) != exact_sign(a, b, c);
      ties += sign(a, b, c) == 0;
    }
  CHECK(wrong == 0);
  CHECK(ties == 128);
}

TEST_CASE("orient2d is exact over the whole range of magnitudes") {
  Rng rng(3);
  int wrong = 0;
  const auto check = [&](Vec2 a, Vec2 b, Vec2 c) { wrong += sign(a, b, c) != exact_sign(a, b, c); };
  const auto any = [&] { return random_magnitude(rng, -400, 400); };
  for (int i = 0; i < 10000; ++i) {
    const Vec2 a = {any(), any()}, b = {any(), any()}, c = {any(), any()};
    check(a, b, c);
    check(a, {0, b.y}, c);
    check(a, b, {nudged(a.x, rng), nudged(a.y, rng)});
    check(a, 2 * a, {nudged(4 * a.x, rng), nudged(4 * a.y, rng)});
  }
  CHECK(wrong == 0);
}

TEST_CASE("orient2d is exact at both ends of its range") {
  using ism::detail::kLargest;
  using ism::detail::kTiniest;
  CHECK(kTiniest == std::ldexp(1.0, -400));
  CHECK(kLargest == std::ldexp(1.0, 400));
  Rng rng(4);
  int wrong = 0, signs[3] = {0, 0, 0};
  for (int i = 0; i < 5000; ++i)
    for (int exponent : {-400, 398}) {
      const Vec2 a = {random_magnitude(rng, exponent, exponent + 1),
                      random_magnitude(rng, exponent, exponent + 1)};
      const Vec2 b = -a, c = {nudged(1.5 * a.x, rng), nudged(1.5 * a.y, rng)};
      const int s = exact_sign(a, b, c);
      wrong += sign(a, b, c) != s;
      ++signs[s + 1];
    }
  CHECK(wrong == 0);
  for (int count : signs) CHECK(count > 500);
}

TEST_CASE("orient2d changes sign when two points are swapped") {
  Rng rng(5);
  int wrong = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec2 a = random_point(rng, 1), b = random_point(rng, 1);
    const Vec2 c = rng.below(2) ? random_point(rng, 1) : a + rng.uniform() * (b - a);
    const int s = sign(a, b, c);
    wrong += sign(b, c, a) != s || sign(c, a, b) != s;
    wrong += sign(b, a, c) != -s || sign(a, c, b) != -s || sign(c, b, a) != -s;
  }
  CHECK(wrong == 0);
}

TEST_CASE("flush_tiny keeps only what orient2d can multiply") {
  using ism::detail::flush_tiny;
  const double tiniest = std::ldexp(1.0, -400);
  for (double s : {1.0, -1.0}) {
    CHECK(flush_tiny(s * tiniest) == s * tiniest);
    CHECK(flush_tiny(s * std::nextafter(tiniest, 0.0)) == 0);
    CHECK(flush_tiny(s * 5e-324) == 0);
    CHECK(flush_tiny(s * 0.1) == s * 0.1);
  }
}

TEST_CASE("oriented follows orient2d where that is not zero") {
  Rng rng(6);
  int wrong = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vec2 a = random_whole_point(rng, 3), b = random_whole_point(rng, 3);
    const Vec2 c = random_whole_point(rng, 3);
    const int s = sign(a, b, c), first = rng.below(3);
    if (s == 0) continue;
    const int j = (first + 1) % 3, k = (first + 2) % 3;
    wrong += oriented({a, first}, {b, j}, {c, k}) != (s > 0);
    wrong += oriented({a, first}, {b, k}, {c, j}) != (s > 0);
  }
  CHECK(wrong == 0);
}

TEST_CASE("oriented is cyclic and changes when two points are swapped, ties included") {
  int wrong = 0, ties = 0;
  for_each_triple(grid_points(4), [&](Vec2 p, Vec2 q, Vec2 r) {
    ties += sign(p, q, r) == 0;
    const int ids[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
    for (const int* id : ids) {
      const LabelledPoint a{p, id[0]}, b{q, id[1]}, c{r, id[2]};
      const bool left = oriented(a, b, c);
      wrong += oriented(b, c, a) != left || oriented(c, a, b) != left;
      wrong += oriented(b, a, c) == left || oriented(a, c, b) == left || oriented(c, b, a) == left;
    }
  });
  CHECK(wrong == 0);
  CHECK(ties > 500);
}

TEST_CASE("oriented is the sign after the documented infinitesimal displacement") {
  const auto displaced = [](Vec2 p, int id) {  // powers of ε
    ExactPoint e{PowerSum(static_cast<long long>(p.x)), PowerSum(static_cast<long long>(p.y))};
    const long long power = 1ll << (2 * id);
    e.x.add(1, power);
    e.y.add(1, 2 * power);
    return e;
  };
  int wrong = 0;
  for_each_triple(grid_points(3), [&](Vec2 a, Vec2 b, Vec2 c) {
    for (int i = 0; i < 5; ++i)
      for (int j = 0; j < 5; ++j)
        for (int k = 0; k < 5; ++k) {
          if (i == j || j == k || k == i) continue;
          const int s = exact_orientation(displaced(a, i), displaced(b, j), displaced(c, k))
                            .sign_if_infinitesimal();
          wrong += s == 0 || oriented({a, i}, {b, j}, {c, k}) != (s > 0);
        }
  });
  CHECK(wrong == 0);
}

TEST_CASE("oriented is the sign after an actual displacement of collinear doubles") {
  const auto displaced = [](Vec2 p, int id) {  // ε = 2^-3200
    ExactPoint e = exact(p);
    const long long power = 1ll << (2 * id);
    e.x.add(1, -100 * power);
    e.y.add(1, -200 * power);
    return e;
  };
  Rng rng(8);
  int wrong = 0, ties = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vec2 a = random_point(rng, 1), d = 0.37 * random_lattice_point(rng, -1, 1);
    Vec2 p[3];
    for (Vec2& q : p) q = a + rng.between(-2, 2) * d;
    ties += sign(p[0], p[1], p[2]) == 0;
    const int first = rng.below(3), second = (first + 1 + rng.below(2)) % 3;
    const int id[3] = {first, second, 3 - first - second};
    const int s =
        exact_orientation(displaced(p[0], id[0]), displaced(p[1], id[1]), displaced(p[2], id[2]))
            .sign_if_word();
    wrong += s == 0 || oriented({p[0], id[0]}, {p[1], id[1]}, {p[2], id[2]}) != (s > 0);
  }
  CHECK(wrong == 0);
  CHECK(ties > 2000);
}

TEST_CASE("oriented answers fit one configuration of points in general position") {
  // Knuth's axioms for counter-clockwise systems: interiority and transitivity.
  Rng rng(9);
  int wrong = 0, applied[2] = {0, 0};
  for (int i = 0; i < 200000; ++i) {
    LabelledPoint p[5];
    for (int k = 0; k < 5; ++k) p[k] = {random_lattice_point(rng, 0, 2), k};
    for (int k = 4; k > 0; --k) std::swap(p[k], p[rng.below(k + 1)]);
    const auto left = [&](int a, int b, int c) { return oriented(p[a], p[b], p[c]); };
    if (left(3, 1, 2) && left(0, 3, 2) && left(0, 1, 3)) {
      ++applied[0];
      wrong += !left(0, 1, 2);
    }
    // With 2, 3, 4 all left of 0→1: left of 0→2 is a transitive relation.
    if (left(0, 1, 2) && left(0, 1, 3) && left(0, 1, 4) && left(0, 2, 3) && left(0, 3, 4)) {
      ++applied[1];
      wrong += !left(0, 2, 4);
    }
  }
  CHECK(wrong == 0);
  CHECK(applied[0] > 1000);
  CHECK(applied[1] > 1000);
}

/// Rounds another way until the end of its scope.
class Rounding {
 public:
  explicit Rounding(int mode) : before_(std::fegetround()) { std::fesetround(mode); }
  ~Rounding() { std::fesetround(before_); }
  Rounding(const Rounding&) = delete;
  Rounding& operator=(const Rounding&) = delete;

 private:
  int before_;
};

TEST_CASE("arithmetic that is not IEEE's is found before anything relies on it") {
  CHECK(ism::detail::arithmetic_is_sound());
  const shapes::Disk disk = shapes::grid(3, 3);
  for (int mode : {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO}) {
    CAPTURE(mode);
    ism::Status run = ism::Status::kDone, map = run;
    bool is_sound = true;
    {
      const Rounding rounding(mode);
      is_sound = ism::detail::arithmetic_is_sound();
      run = ism::compute_map(disk.mesh, disk.mesh).status;
      map = shapes::map_of(disk, disk).status();
    }
    CHECK_FALSE(is_sound);
    CHECK(run == ism::Status::kNumericalFailure);
    CHECK(map == ism::Status::kNumericalFailure);
  }
}

}  // namespace predicate_tests

#endif  // ISM_TESTS_PART_PREDICATES_HPP

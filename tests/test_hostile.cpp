// Surfaces at the edge of what a mesh can be, by the hundred. In the environment, ISM_HOSTILE=5000
// asks for as many, ISM_HOSTILE_FIRST=1000 for those behind 1000, and ISM_HOSTILE_SEED=17 for that
// one alone; what is found is then printed.

#include "hostile.hpp"
#include "ism.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

namespace {

using hostile::Case;
using hostile::Verdict;
using std::uint64_t;

uint64_t number_of(const char* variable, uint64_t otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

std::string complaints(const Verdict& verdict) {
  std::string all;
  for (const std::string& complaint : verdict.complaints) all += "\n  ! " + complaint;
  return all;
}

void print(uint64_t seed, const std::string& name, const Verdict& v) {
  std::printf("seed %llu: %s\n  %s, %.2f s, round trip %.3g: %s%s\n",
              static_cast<unsigned long long>(seed), name.c_str(), ism::to_string(v.status),
              v.seconds, v.round_trip, v.message.c_str(), complaints(v).c_str());
  std::fflush(stdout);
}

/// What became of many cases.
class Summary {
 public:
  void add(const std::string& category, const Verdict& v) {
    ++statuses_[category + ": " + ism::to_string(v.status)];
    bad_ += v.complaints.empty() ? 0 : 1;
    seconds_ += v.seconds;
    slowest_ = (std::max)(slowest_, v.seconds);
    round_trip_ = (std::max)(round_trip_, v.round_trip);
  }
  void print() const {
    for (const auto& [name, count] : statuses_) std::printf("%6d %s\n", count, name.c_str());
    std::printf("%d bad, %.1f s, the slowest %.2f s, largest round trip %.3g\n", bad_, seconds_,
                slowest_, round_trip_);
  }

 private:
  std::map<std::string, int> statuses_;
  int bad_ = 0;
  double seconds_ = 0, slowest_ = 0, round_trip_ = 0;
};

std::string category(const Case& c) {
  const int closed = (c.a.shape.is_closed ? 1 : 0) + (c.b.shape.is_closed ? 1 : 0);
  const char* const what[] = {"open", "one closed", "closed"};
  return std::string(what[closed]) + (c.options.boundary == ism::Boundary::kFree ? "" : ", held") +
         (c.options.exact_landmarks ? ", exact"
          : c.landmarks.empty()     ? ""
                                    : ", landmarks");
}

void check_valid(uint64_t first, uint64_t n, Case (*make)(uint64_t), bool prints) {
  Summary summary;
  for (uint64_t seed = first; seed < first + n; ++seed) {
    const Case c = make(seed);
    const Verdict verdict = hostile::judge(c);
    summary.add(category(c), verdict);
    if (!verdict.complaints.empty() || n == 1) print(seed, c.name, verdict);
    CHECK(verdict.complaints.empty());
  }
  if (prints) summary.print();
}

void check_broken(uint64_t first, uint64_t n, bool prints) {
  Summary summary;
  for (uint64_t seed = first; seed < first + n; ++seed) {
    const hostile::Broken b = hostile::broken(seed);
    const Verdict verdict = hostile::judge(b);
    summary.add(b.name, verdict);
    if (!verdict.complaints.empty()) print(seed, b.name, verdict);
    CHECK(verdict.complaints.empty());
  }
  if (prints) summary.print();
}

}  // namespace

TEST_CASE("a valid surface has a map, whatever its shape") {
  check_valid(0, 80, hostile::valid_case, false);
}

TEST_CASE("a defect is named, refused, and mended where it can be") {
  check_broken(0, 3 * hostile::kDefects, false);
}

// Corners of triangles beside the cut through a closed surface are copies then, which landmarks in
// these triangles must follow.
TEST_CASE("exact landmarks lie in triangles of closed surfaces") {
  check_valid(0, 20, hostile::closed_exact_case, false);
}

// What lies over the inside of an opening does not count as overlap.
TEST_CASE("a surface may fit into an opening of the other") {
  for (uint64_t seed : {1709u, 3786u}) check_valid(seed, 1, hostile::valid_case, false);
}

// Each ring is a hundredth of the next one: what is said names the mesh, but no vertex.
TEST_CASE("a graded disk is laid along a square" * doctest::may_fail(true)) {
  check_valid(2147, 1, hostile::valid_case, false);
}

TEST_CASE("thousands of surfaces") {
  const uint64_t first = number_of("ISM_HOSTILE_FIRST", 0), n = number_of("ISM_HOSTILE", 0);
  const uint64_t one = number_of("ISM_HOSTILE_SEED", ~uint64_t{0});
  if (one != ~uint64_t{0}) return check_valid(one, 1, hostile::valid_case, true);
  if (n == 0) MESSAGE("skipped: ISM_HOSTILE is not set");
  if (n > 0) check_valid(first, n, hostile::valid_case, true);
}

TEST_CASE("thousands of meshes with a defect") {
  const uint64_t first = number_of("ISM_HOSTILE_FIRST", 0), n = number_of("ISM_HOSTILE", 0);
  if (n > 0) check_broken(first, n, true);
}

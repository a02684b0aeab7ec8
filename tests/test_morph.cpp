// Shapes between the two surfaces of a map.

#include "morph.hpp"

#include "ism.hpp"
#include "mesh_io.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <thread>
#include <vector>

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using ism::MetaMesh;
using ism::Points2;
using ism::Points3;
using ism::SurfaceMap;
using morphing::Morph;
using runs::good_map;
using runs::square_pair;
using shapes::Disk;
using shapes::overlapping_pair;

Morph morph_of(const Disk& a, const Disk& b) { return Morph(good_map(a, b), a.plane, b.plane); }

/// A morph is A at 0 and B at 1.
void check_ends(const Disk& a, const Disk& b) {
  const MetaMesh meta = good_map(a, b).meta_mesh();
  const Morph morph = morph_of(a, b);
  REQUIRE(morph.ok());
  CHECK((morph.at(0) - meta.on_a).cwiseAbs().maxCoeff() < 1e-9);
  CHECK((morph.at(1) - meta.on_b).cwiseAbs().maxCoeff() < 1e-9);
}

}  // namespace

TEST_CASE("a morph begins as A and ends as B") {
  for (std::uint64_t seed : {20u, 21u}) {
    const auto [a, b] = overlapping_pair(seed);
    check_ends(a, b);
    const MetaMesh meta = good_map(a, b).meta_mesh();
    CHECK(ism::linear_morph(meta, 0) == meta.on_a);
    CHECK(ism::linear_morph(meta, 1) == meta.on_b);
    CHECK((ism::linear_morph(meta, 0.25) - 0.75 * meta.on_a - 0.25 * meta.on_b).norm() < 1e-12);
  }
}

TEST_CASE("a morph between positions of one rigid body is rigid") {
  auto [a, b] = square_pair(22);
  b = a;
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(2.5, Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  b.mesh.vertices = (a.mesh.vertices * R.transpose()).rowwise() + Vector3d(5, -3, 2).transpose();
  const Points3 start = good_map(a, b).meta_mesh().on_a, halfway = morph_of(a, b).at(0.5);
  REQUIRE(halfway.rows() == start.rows());
  for (int i = 0; i < start.rows(); ++i)
    for (int j = 0; j < i; j += 7)
      CHECK((halfway.row(i) - halfway.row(j)).norm() ==
            doctest::Approx((start.row(i) - start.row(j)).norm()).epsilon(1e-9));
}

TEST_CASE("a sheet that rolls up more than once keeps its lengths on the way") {
  Disk a = shapes::grid(40, 2), b = a;
  for (int v = 0; v < b.plane.rows(); ++v) {
    const double turns = 1.4, phi = 2 * shapes::kPi * turns * b.plane(v, 0) / 40;
    const double radius = 40 / (2 * shapes::kPi * turns);
    b.mesh.vertices.row(v) << radius * std::sin(phi), b.plane(v, 1), radius * (1 - std::cos(phi));
  }
  const MetaMesh meta = good_map(a, b).meta_mesh();
  const Points3 halfway = morph_of(a, b).at(0.5);
  REQUIRE(halfway.rows() == meta.on_a.rows());
  const auto worst_stretch = [&](const Points3& x) {
    double worst = 0;
    for (const std::vector<int>& p : mesh_io::polygons_of(meta))
      for (std::size_t k = 0; k < p.size(); ++k) {
        const int i = p[k], j = p[(k + 1) % p.size()];
        const double before = (meta.on_a.row(i) - meta.on_a.row(j)).norm();
        if (before < 1e-6) continue;
        worst = std::max(worst, std::abs((x.row(i) - x.row(j)).norm() / before - 1));
      }
    return worst;
  };
  CHECK(worst_stretch(halfway) < 0.02);
  CHECK(worst_stretch(ism::linear_morph(meta, 0.5)) > 0.3);
}

TEST_CASE("a morph from B to A shows the same shapes") {
  const auto [a, b] = overlapping_pair(23);
  const Points3 there = morph_of(a, b).at(0.3), back = morph_of(b, a).at(0.7);
  REQUIRE(there.rows() > 0);
  REQUIRE(there.rows() == back.rows());
  const auto sum = [](const Points3& x) { return Vector3d(x.colwise().sum().transpose()); };
  CHECK((sum(there) - sum(back)).norm() < 1e-7);
  CHECK(there.norm() == doctest::Approx(back.norm()).epsilon(1e-9));
}

TEST_CASE("a morph of an overlap in two parts has both of them") {
  const Disk a = shapes::triangle({0.2, -1}, {2.8, 0.5}, {0.2, 0.5});
  const Disk b = shapes::comb(2, 1);
  Disk up = a;
  up.plane = shapes::moved(a.plane, Eigen::Matrix2d::Identity(), Vector2d(0, 1.4));
  check_ends(up, b);
}

TEST_CASE("a morph of no map has no shapes, and threads do not matter") {
  const SurfaceMap no_map({}, {}, {}, {});
  CHECK(no_map.status() == ism::Status::kInvalidMesh);
  const Morph none(no_map, Points2(0, 2), Points2(0, 2));
  CHECK_FALSE(none.ok());
  CHECK(none.at(0.5).rows() == 0);
  const auto [a, b] = overlapping_pair(24);
  const Morph morph = morph_of(a, b);
  REQUIRE(morph.ok());
  const Points3 expected = morph.at(0.4);
  CHECK(morph_of(a, b).at(0.4) == expected);
  std::vector<Points3> shapes(3);
  std::vector<std::thread> threads;
  for (Points3& shape : shapes)
    threads.emplace_back([&morph, &shape] {
      for (double t : {0.1, 0.9, 0.4}) shape = morph.at(t);
    });
  for (std::thread& thread : threads) thread.join();
  for (const Points3& shape : shapes) CHECK(shape == expected);
}

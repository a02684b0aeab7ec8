// Where a map begins without landmarks, or with few: alignments in space, tips, and the starts that
// are tried.

#ifndef ISM_TESTS_PART_STARTS_HPP
#define ISM_TESTS_PART_STARTS_HPP

#include "ism.hpp"
#include "ism_verify.hpp"
#include "runs.hpp"
#include "sanitized.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace starts_tests {
namespace {

using namespace ism::detail;
using Eigen::Vector3d;
using ism::Options;
using ism::Result;
using ism::TriangleMesh;
using runs::on_one_thread;

Eigen::Matrix3d turn(double angle, const Vector3d& axis) {
  return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
}

/// Four limbs, no two of one length or at one angle to the others, about a body: the image of the
/// unit sphere.
Vector3d body(const Vector3d& direction) {
  const Vector3d axis[] = {Vector3d(1, 0.2, 0.1).normalized(), Vector3d(-0.5, 1, 0).normalized(),
                           Vector3d(-0.4, -0.6, 0.9).normalized(),
                           Vector3d(-0.2, -0.5, -1).normalized()};
  const double length[] = {1.6, 1.1, 0.8, 1.3};
  double r = 1;
  for (int i = 0; i < 4; ++i) r += length[i] * std::exp(-12 * (1 - direction.dot(axis[i])));
  return r * direction;
}

/// The body on a mesh that is turned by R before it is bent, and turned by S in space.
TriangleMesh body_mesh(const Eigen::Matrix3d& R, const Eigen::Matrix3d& S, int level = 4) {
  TriangleMesh mesh = shapes::sphere(level);
  for (int v = 0; v < mesh.vertices.rows(); ++v) {
    const Vector3d direction = R * mesh.vertices.row(v).transpose();
    mesh.vertices.row(v) = (S * body(direction)).transpose();
  }
  return mesh;
}

/// A mesh in another pose: limbs bend about an axis, the more the farther out.
TriangleMesh posed(TriangleMesh mesh, double angle, const Vector3d& axis) {
  for (int v = 0; v < mesh.vertices.rows(); ++v) {
    const Vector3d p = mesh.vertices.row(v);
    mesh.vertices.row(v) = (turn(angle * (p.norm() - 1), axis) * p).transpose();
  }
  return mesh;
}

/// Two bent squares of 441 and 440 vertices.
std::pair<shapes::Disk, shapes::Disk> bent_squares(std::uint64_t seed) {
  shapes::Rng rng(seed);
  shapes::Disk a = shapes::perturbed_grid(20, 20, 0.2, rng),
               b = shapes::perturbed_grid(21, 19, 0.2, rng);
  shapes::bend(a, 0.5);
  shapes::bend(b, -0.5);
  return {a, b};
}

/// Mean distance of the images from where they should be, in roots of the area of B.
double mean_error(const Result& r, const Eigen::Matrix3d& S) {
  const ism::SurfaceMap map(r);
  REQUIRE(map.status() == ism::Status::kDone);
  const TriangleMesh& a = map.mesh(ism::Side::kA);
  double sum = 0;
  for (int v = 0; v < a.vertices.rows(); ++v) {
    const Vector3d to = S * a.vertices.row(v).transpose();
    sum += (map.position_on_b(map.forward_vertex(v)) - to).norm();
  }
  const double area = build_surface(map.mesh(ism::Side::kB), false).total_area;
  return sum / static_cast<double>(a.vertices.rows()) / std::sqrt(area);
}

}  // namespace

TEST_CASE("the rotations of the icosahedron are 60, and leave none farther away than 45 degrees") {
  const Array<AffineMap> rotations = icosahedral_rotations();
  REQUIRE(rotations.size() == 60);
  const auto matrix = [](const AffineMap& m) {
    Eigen::Matrix3d M;
    for (int c = 0; c < 3; ++c) M.col(c) << m.column[c].x, m.column[c].y, m.column[c].z;
    return M;
  };
  for (int i = 0; i < 60; ++i) {
    const Eigen::Matrix3d M = matrix(rotations[i]);
    CHECK((M * M.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-12);
    CHECK(M.determinant() == doctest::Approx(1));
    for (int j = 0; j < i; ++j) CHECK((M - matrix(rotations[j])).norm() > 0.5);
  }
  shapes::Rng rng(3);
  for (int i = 0; i < 1000; ++i) {
    const Vector3d axis(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
    const Eigen::Matrix3d R = turn(rng.uniform(0, kPi), axis);
    double most = -1;
    for (const AffineMap& rotation : rotations)
      most = std::max(most, (matrix(rotation).transpose() * R).trace());
    CHECK(std::acos(std::min(1.0, 0.5 * (most - 1))) < 0.25 * kPi);
  }
}

TEST_CASE("the rotation nearest to a matrix follows from its singular vectors") {
  shapes::Rng rng(4);
  for (int i = 0; i < 100; ++i) {
    AffineMap m;
    Eigen::Matrix3d M;
    for (int c = 0; c < 3; ++c) {
      m.column[c] = {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)};
      M.col(c) << m.column[c].x, m.column[c].y, m.column[c].z;
    }
    const AffineMap nearest = nearest_rotation(m);
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
    if (svd.singularValues()[2] < 1e-3) continue;
    const Vector3d sign(1, 1, M.determinant() > 0 ? 1 : -1);
    const Eigen::Matrix3d R = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 3; ++k)
        CHECK(nearest.column[c][k] == doctest::Approx(R(k, c)).epsilon(1e-9));
  }
}

TEST_CASE("a surface turned in space is aligned with itself") {
  const Eigen::Matrix3d S = turn(2.1, {1, 2, -1});
  const SurfacePair pair = {
      build_surface(body_mesh(Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity()), true),
      build_surface(body_mesh(turn(0.7, {0, 1, 3}), S), true)};
  const Executor executor(on_one_thread());
  const SamplePair many = sampled(pair, {}, 480);
  const Array<Alignment> found = find_alignments(sampled(pair, {}, 120), many, 3, executor);
  REQUIRE(!found.empty());
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < 3; ++k) CHECK(std::abs(found[0].map().column[c][k] - S(k, c)) < 0.05);
  for (int i = 1; i < found.size(); ++i) CHECK(found[i].residual() > 1.2 * found[0].residual());
}

TEST_CASE("the tips of a star are the ends of its arms") {
  for (int arms : {3, 4, 6}) {
    const Surface s = build_surface(shapes::limbs(arms, 8, 0.1).mesh, true);
    const Tips tips = find_tips(s);
    REQUIRE(tips.vertex.size() == arms);
    for (int i = 0; i < arms; ++i) {
      const int v = tips.vertex[i];
      CHECK(norm(row3(s.vertices, v)) > 4.99);
      CHECK(tips.distance[i][v] == 0);
    }
  }
}

TEST_CASE("tips are matched by their distances to each other, whatever the pose") {
  const Eigen::Matrix3d S = turn(2.1, {1, 2, -1});
  const TriangleMesh mesh = body_mesh(Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity(), 3);
  const Surface a = build_surface(mesh, false);
  const Surface b =
      build_surface(posed(body_mesh(turn(0.7, {0, 1, 3}), S, 3), 0.4, {0, 0, 1}), false);
  const Tips of_a = ends_of_limbs(a, find_tips(a)), of_b = ends_of_limbs(b, find_tips(b));
  REQUIRE(of_a.vertex.size() == 4);  // find_tips() finds two on the trunk, too
  REQUIRE(of_b.vertex.size() == 4);
  TriangleMesh there = mesh;
  there.vertices = mesh.vertices * S.transpose();
  there = posed(there, 0.4, {0, 0, 1});
  int right = 0;  // one of several whose distances agree about as well
  const auto matchings = match_by_distances(of_a, of_b, {}, 6);
  for (const auto& pairs : matchings) {
    CHECK(pairs.size() == 4);
    right += std::all_of(pairs.begin(), pairs.end(), [&](const VertexPair& p) {
      const Eigen::RowVector3d at = b.vertices.row(p.b) / b.scale;
      return (at - there.vertices.row(p.a)).norm() < 0.6;  // limbs are 2 apart
    });
  }
  CHECK(matchings.size() == 6);
  CHECK(right == 1);
  const Array<VertexPair> landmarks(1, VertexPair{of_a.vertex[0], of_b.vertex[1], {}});
  for (const auto& pairs : match_by_distances(of_a, of_b, landmarks, 3)) {
    CHECK(pairs.size() == 3);
    for (const VertexPair& p : pairs) CHECK((p.a != of_a.vertex[0] && p.b != of_b.vertex[1]));
  }
}

TEST_CASE("without landmarks, a surface is mapped onto itself turned, on another mesh") {
  const Eigen::Matrix3d S = turn(2.1, {1, 2, -1});
  const TriangleMesh a = body_mesh(Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity());
  const TriangleMesh b = body_mesh(turn(0.7, {0, 1, 3}), S);
  const Result r = ism::compute_map(a, b, {}, on_one_thread());
  REQUIRE(ism::is_usable(r.status));
  CHECK(r.final_state().mean_distortion < 2.1);
  CHECK(mean_error(r, S) < 0.1);  // 0.37 with limbs that are exchanged

  REQUIRE(r.candidates.size() >= 2);
  for (std::size_t i = 0; i < r.candidates.size(); ++i) {
    const ism::StartCandidate& c = r.candidates[i];
    CHECK(c.iterations >= 0);
    CHECK(r.candidates[0].distortion <= c.distortion);
    CHECK((c.name.find("landmarks") == 0 || c.name.find("alignment ") == 0 ||
           c.name.find("tips ") == 0));
  }
  CHECK(r.candidates[0].name.find("alignment 1, ") == 0);
}

TEST_CASE("a map of disks goes on from that of the best start") {
  shapes::Rng rng(8);
  shapes::Disk a = shapes::perturbed_grid(24, 24, 0.2, rng),
               b = shapes::perturbed_grid(25, 23, 0.2, rng);
  shapes::bend(a, 0.6);
  shapes::bend(b, -0.5);
  ism::Options options = on_one_thread();
  const Result with = ism::compute_map(a.mesh, b.mesh, {}, options);
  REQUIRE(ism::is_usable(with.status));
  REQUIRE(!with.candidates.empty());
  REQUIRE(!with.coarse.empty());
  CHECK(with.coarse[0].mean_distortion <= 1.02 * with.candidates[0].distortion);

  options.candidates = false;
  const Result without = ism::compute_map(a.mesh, b.mesh, {}, options);
  CHECK(without.candidates.empty());
  CHECK(with.final_state().mean_distortion <= 1.01 * without.final_state().mean_distortion);

  options.candidates = true;
  options.initial_f = a.plane;
  options.initial_g = b.plane;
  CHECK(ism::compute_map(a.mesh, b.mesh, {}, options).candidates.empty());
}

// ---- landmarks that pull ----

TEST_CASE("springs have the gradient of the pull") {
  const auto [a, b] = runs::square_pair(5);
  const JointSurface s = join({build_surface(a.mesh, false), build_surface(b.mesh, false)});
  const ism::DistortionMeasure measure = ism::symmetric_dirichlet();
  const auto iterate_at = [&](const ism::Points2& x) {
    Iterate iterate;
    iterate.x = x;
    evaluate(s, Weights{0, 1, 1, &measure}, iterate);
    return iterate;
  };
  PlacedLandmark vertex, point;
  vertex.a = copy_of(40), vertex.b = copy_of(70);
  point.a.corners = a.mesh.triangles.row(60);
  point.a.weights = Eigen::Vector3d(0.2, 0.3, 0.5);
  point.b = copy_of(50);
  const ism::Curve curve = {{30, 31, 32}, {37, 38, 39, 40}};
  Array<PlacedLandmark> landmarks(1, vertex);
  landmarks.push_back(point);
  const LandmarkPull pull(s, landmarks, {curve});
  const ism::Points2 x = stacked(a.plane, b.plane);
  Array<Spring> springs, others;
  CHECK(pull(iterate_at(x), springs) > 0);
  Array<Vec2> gradient(s.mesh.n_vertices, Vec2());
  add_spring_gradient(springs, x, gradient);
  shapes::Rng rng(6);
  for (int i = 0; i < 10; ++i) {
    ism::Points2 d = x;
    double slope = 0;
    for (int v = 0; v < d.rows(); ++v) {
      d.row(v) << rng.uniform(-1, 1), rng.uniform(-1, 1);
      slope += dot(gradient[v], row2(d, v));
    }
    constexpr double kStep = 1e-6;
    const double rise =
        pull(iterate_at(x + kStep * d), others) - pull(iterate_at(x - kStep * d), others);
    CHECK(rise / (2 * kStep) == doctest::Approx(slope).epsilon(1e-5));
  }
}

/// Two fans of n triangles with one boundary.
TriangleMesh double_pyramid(int n) {
  TriangleMesh m = shapes::fan(n).mesh;
  m.vertices(0, 2) = 0.5;
  m.vertices.conservativeResize(n + 2, Eigen::NoChange);
  m.vertices.row(n + 1) << 0, 0, -0.5;
  m.triangles.conservativeResize(2 * n, Eigen::NoChange);
  for (int i = 0; i < n; ++i) m.triangles.row(n + i) << n + 1, 1 + (i + 1) % n, 1 + i;
  return m;
}

/// A tube of radius 1, open at both ends.
TriangleMesh tube(int sides, int rings, double length) {
  TriangleMesh m;
  m.vertices.resize(sides * (rings + 1), 3);
  for (int v = 0; v < m.vertices.rows(); ++v) {
    const double angle = 2 * shapes::kPi * (v % sides) / sides;
    m.vertices.row(v) << std::cos(angle), std::sin(angle), length * (v / sides) / rings;
  }
  m.triangles.resize(2 * sides * rings, 3);
  for (int v = 0; v < sides * rings; ++v) {
    const int right = v % sides + 1 < sides ? v + 1 : v + 1 - sides;
    m.triangles.row(2 * v) << v, right, right + sides;
    m.triangles.row(2 * v + 1) << v, right + sides, v + sides;
  }
  return m;
}

// Laid out flat, they ended at 1e23: the rings at one end are exp(-200) of those at the other.
TEST_CASE("long tubes are mapped as if their ends were closed; what closes them is no one's") {
  const TriangleMesh a = tube(8, 100, 200), b = tube(7, 90, 200);
  const Result r = ism::compute_map(a, b, {}, on_one_thread());
  REQUIRE(ism::is_usable(r.status));
  CHECK(r.final_state().mean_distortion < 2.1);
  CHECK(r.warnings.size() == 2);
  const ism::SurfaceMap map(r);
  CHECK(ism::verify_map(map).status == ism::Status::kDone);
  CHECK(map.mesh(ism::Side::kA).vertices == a.vertices);
  CHECK(map.mesh(ism::Side::kB).triangles == b.triangles);
  CHECK(r.start.a->triangles.rows() == a.triangles.rows() + 16);

  const ism::MetaMesh meta = map.meta_mesh(), embedded = map.meta_mesh(ism::Ids::kEmbedded);
  CHECK(meta.n_polygons() == embedded.n_polygons());
  CHECK(meta.n_polygons() == static_cast<int>(map.distortion().size()));
  CHECK(meta.n_polygons() < r.final_state().polygons);
  const auto [least_a, most_a] = std::minmax_element(meta.face_a.begin(), meta.face_a.end());
  const auto [least_b, most_b] = std::minmax_element(meta.face_b.begin(), meta.face_b.end());
  CHECK((*least_a == 0 && *most_a + 1 == a.triangles.rows()));
  CHECK((*least_b == 0 && *most_b + 1 == b.triangles.rows()));

  const std::vector<ism::SurfacePoint> images = map.forward_vertices();
  REQUIRE(images.size() == static_cast<std::size_t>(a.vertices.rows()));
  int images_missing = 0;
  for (std::size_t v = 0; v < images.size(); ++v) {
    const int ring = static_cast<int>(v) / 8;
    images_missing += !images[v].exists();
    CHECK((images[v].exists() || ring == 0 || ring == 100));
    CHECK(images[v].face < b.triangles.rows());
  }
  CHECK(images_missing < 16);
  CHECK(ism::remesh(map, ism::Side::kA).vertices.rows() == a.vertices.rows());
  std::vector<int> along;
  for (int ring = 0; ring <= 100; ++ring) along.push_back(8 * ring);
  const std::vector<ism::Polyline> path = map.forward_path(along);
  REQUIRE(path.size() == 1);
  for (const ism::SurfacePoint& p : path[0]) CHECK(p.exists());
  CHECK(path[0].size() > 180);
  const ism::Transfer to_b =
      ism::transfer(meta, ism::Side::kA, ism::Element::kFace, ism::Element::kFace);
  CHECK((to_b.n_sources == a.triangles.rows() && to_b.rows() == b.triangles.rows()));
}

TEST_CASE("only small openings are closed, in any unit, and exact landmarks on rims have images") {
  const TriangleMesh a = tube(7, 30, 60), b = tube(6, 28, 60);
  const auto warnings = [](const Result& r) {
    return std::count_if(r.warnings.begin(), r.warnings.end(), [](const ism::Warning& w) {
      return w.message.find("are small, and it is mapped as if") != std::string::npos;
    });
  };
  Options options = on_one_thread();
  options.max_iterations = 0;
  for (double unit : {1e-100, 1e100}) {
    CAPTURE(unit);
    TriangleMesh large = a, short_one = tube(7, 5, 4);
    large.vertices *= unit;
    short_one.vertices *= unit;
    CHECK(warnings(ism::compute_map(large, b, {}, options)) == 2);
    CHECK(warnings(ism::compute_map(short_one, short_one, {}, options)) == 0);
  }
  TriangleMesh sock = a;  // 30 diameters long, open at one end
  sock.vertices.conservativeResize(a.vertices.rows() + 1, Eigen::NoChange);
  sock.vertices.row(a.vertices.rows()) << 0, 0, 60;
  sock.triangles.conservativeResize(a.triangles.rows() + 7, Eigen::NoChange);
  for (int i = 0; i < 7; ++i)
    sock.triangles.row(a.triangles.rows() + i) << 210 + i, 210 + (i + 1) % 7, 217;
  CHECK(warnings(ism::compute_map(sock, sock, {}, options)) == 2);
  shapes::Rng rng(1);
  TriangleMesh sheet = shapes::perturbed_grid(60, 60, 0.2, rng).mesh;  // with a pinhole
  sheet.triangles.row(3000) = sheet.triangles.row(sheet.triangles.rows() - 1).eval();
  sheet.triangles.conservativeResize(sheet.triangles.rows() - 1, Eigen::NoChange);
  CHECK(warnings(ism::compute_map(sheet, sheet, {}, options)) == 0);

  options.exact_landmarks = true;
  const ism::SurfaceMap exact(ism::compute_map(a, b, {{0, 0}, {105, 84}, {210, 168}}, options));
  REQUIRE(exact.status() == ism::Status::kDone);
  for (int v : {0, 105, 210}) {
    REQUIRE(exact.forward_vertex(v).exists());
    const Vector3d end = b.vertices.row(v * 168 / 210);
    CHECK((exact.position_on_b(exact.forward_vertex(v)) - end).norm() < 1e-6);
  }

  options.exact_landmarks = false;
  options.outer_a = 0;
  ism::Solver solver(a, b, {}, options);
  while (solver.step()) {
  }
  CHECK(warnings(solver.result()) == 0);
  options.outer_a = -1;
  CHECK(solver.change({}, options).status == ism::Status::kDone);
  while (solver.step()) {
  }
  CHECK(ism::SurfaceMap(solver.result()).status() == ism::Status::kDone);
}

/// A sphere without the triangles around some vertices, turned about its axis the more the higher.
TriangleMesh punctured(const std::vector<int>& at, double twist) {
  TriangleMesh m = shapes::sphere(4);
  for (int v = 0; v < m.vertices.rows(); ++v) {
    const double angle = twist * m.vertices(v, 2);
    const Eigen::Rotation2Dd turn(angle);
    m.vertices.row(v).head<2>() = (turn * m.vertices.row(v).head<2>().transpose()).transpose();
  }
  int n = 0;
  for (int f = 0; f < m.triangles.rows(); ++f) {
    bool is_open = false;
    for (int v : at) is_open = is_open || (m.triangles.row(f).array() == v).any();
    if (!is_open) m.triangles.row(n++) = m.triangles.row(f).eval();
  }
  m.triangles.conservativeResize(n, Eigen::NoChange);
  return m;
}

// As disks, the whole surface went through one of its openings: these ended at 2.4, or not at all.
TEST_CASE("surfaces with small openings are mapped as closed ones, wherever the openings are") {
  const TriangleMesh a = punctured({10, 600, 1200, 1800}, 0), b = punctured({100, 900}, 0.5),
                     closed = shapes::sphere(4);
  for (const TriangleMesh* other : {&b, &closed}) {
    const Result r = ism::compute_map(a, *other, {}, on_one_thread());
    REQUIRE(ism::is_usable(r.status));
    const ism::SurfaceMap map(r);
    CHECK(map.is_closed());
    CHECK(ism::verify_map(map).status == ism::Status::kDone);
    CHECK(ism::summarize(map.distortion()).mean < 2.05);
    const std::vector<ism::SurfacePoint> images = map.forward_vertices();
    CHECK(std::count_if(images.begin(), images.end(), [](const ism::SurfacePoint& p) {
            return p.exists();
          }) > a.vertices.rows() - 12);
  }
}

// Of fans over each other, each triangle meets each. These took 15 to 56 ms per triangle.
TEST_CASE("a start takes 12 ms per triangle at most, whatever their shapes") {
#ifdef ISM_TEST_SANITIZED
  MESSAGE("skipped: slow with a sanitizer");
#else
  constexpr double kMost = 0.012;  // seconds
  const TriangleMesh fan = shapes::fan(1000).mesh, fans = double_pyramid(512),
                     rings = tube(6, 60, 120);
  const std::pair<const TriangleMesh*, TriangleMesh> pairs[] = {
      {&fan, fan}, {&fans, fans}, {&fans, shapes::sphere(3)}, {&rings, rings}};
  for (const auto& [a, b] : pairs) {
    ism::Options options = on_one_thread();
    options.max_iterations = 0;
    const Timer timer;
    const Result r = ism::compute_map(*a, b, {}, options);
    CAPTURE(a->triangles.rows());
    CHECK(ism::is_usable(r.status));
    CHECK(timer.seconds() < kMost * static_cast<double>(a->triangles.rows() + b.triangles.rows()));
  }
#endif
}

TEST_CASE("a landmark of weight 0 only guides the start, one of weight 1 pulls to the end") {
  const std::pair<shapes::Disk, shapes::Disk> squares = bent_squares(12);
  const shapes::Disk &a = squares.first, &b = squares.second;
  const int from = 10 * 21 + 10, to = 10 * 22 + 12;  // about a tenth of the side apart
  const auto distance = [&](double weight) {
    const Result r = ism::compute_map(
        a.mesh, b.mesh, {{0, 0, 0}, {440, 439, 0}, {from, to, weight}}, on_one_thread());
    REQUIRE(ism::is_usable(r.status));
    for (std::size_t i = 1; i < r.log.size(); ++i)  // springs follow the pull to first order
      CHECK(r.log[i].energy <= r.log[i - 1].energy + 1e-3);
    const ism::SurfaceMap map(r);
    const Vector3d end = b.mesh.vertices.row(to).transpose();
    return (map.position_on_b(map.forward_vertex(from)) - end).norm();
  };
  const double hinted = distance(0), pulled = distance(1), held = distance(50);
  CHECK(pulled < hinted);
  CHECK(held < 0.9 * pulled);
}

TEST_CASE("landmarks that the map contradicts are named") {
  const TriangleMesh a = body_mesh(Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity());
  std::vector<ism::Landmark> landmarks;
  for (int v : {3, 100, 200, 300, 400, 500}) landmarks.push_back({v, v});
  const auto warning_of = [&] {
    const Result r = ism::compute_map(a, a, landmarks, on_one_thread());
    REQUIRE(ism::is_usable(r.status));
    for (const ism::Warning& w : r.warnings)
      if (w.message.find("landmarks may be wrong") != std::string::npos) return w;
    return ism::Warning();
  };
  CHECK(warning_of().message.empty());
  std::swap(landmarks[1].b, landmarks[2].b);
  const ism::Warning warning = warning_of();
  CAPTURE(warning.message);
  CHECK(warning.message.find("2 of 6 landmarks") == 0);
  REQUIRE(warning.ids.size() == 4);
  for (const ism::ElementId& id : warning.ids) CHECK((id.id == 100 || id.id == 200));
}

TEST_CASE("held boundaries: landmarks that the best start contradicts do not pull at the start") {
  shapes::Rng rng(8);
  shapes::Disk a = shapes::perturbed_grid(24, 24, 0.2, rng);
  shapes::bend(a, 0.6);
  std::vector<ism::Landmark> landmarks;  // vertex 25 i + j is in row i and column j
  for (int v : {5 * 25 + 5, 5 * 25 + 19, 19 * 25 + 5, 19 * 25 + 19, 12 * 25 + 12, 8 * 25 + 16})
    landmarks.push_back({v, v});
  std::swap(landmarks[1].b, landmarks[2].b);
  std::swap(landmarks[3].b, landmarks[4].b);
  ism::Options options = on_one_thread();
  options.boundary = ism::Boundary::kFixed;
  const Result r = ism::compute_map(a.mesh, a.mesh, landmarks, options);
  REQUIRE(ism::is_usable(r.status));
  CHECK(r.final_state().mean_distortion < 2.05);
  const std::string n_wrong = r.warnings.empty() ? "" : r.warnings.back().message;
  CAPTURE(n_wrong);
  CHECK(n_wrong.find("4 of 6 landmarks may be wrong") == 0);
}

// ---- many landmarks ----

TEST_CASE("of pairs of which a third is wrong, right ones are kept, spread over the surface") {
  const Surface s =
      build_surface(body_mesh(Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity()), true);
  shapes::Rng rng(21);
  Array<VertexPair> pairs;
  const auto any = [&] { return static_cast<int>(rng.uniform(0, s.mesh.n_vertices - 1e-9)); };
  for (int i = 0; i < 150; ++i) {
    const int v = any();
    pairs.push_back({v, i % 3 == 0 ? any() : v});
  }
  const Array<VertexPair> kept = consistent({s, s}, pairs, 40);
  REQUIRE(kept.size() == 40);
  double least = kInfinity;
  for (int i = 0; i < kept.size(); ++i) {
    CHECK(norm(row3(s.vertices, kept[i].a) - row3(s.vertices, kept[i].b)) < 0.1);
    for (int j = 0; j < i; ++j)
      least = std::min(least, norm(row3(s.vertices, kept[i].a) - row3(s.vertices, kept[j].a)));
  }
  CHECK(least > 0.02);
  CHECK(consistent({s, s}, {}, 40).empty());
}

TEST_CASE("a landmark for every vertex, noisy and a third of them wrong, becomes a map") {
  const Eigen::Matrix3d S = turn(2.1, {1, 2, -1});
  const TriangleMesh a = body_mesh(Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Identity());
  const TriangleMesh b = body_mesh(turn(0.7, {0, 1, 3}), S);
  shapes::Rng rng(22);
  const int n = static_cast<int>(b.vertices.rows());
  std::vector<ism::Landmark> landmarks;
  for (int v = 0; v < a.vertices.rows(); ++v) {
    const Vector3d noise(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
    const Vector3d at = S * a.vertices.row(v).transpose() + 0.3 * noise;
    Eigen::Index w = 0;
    (b.vertices.rowwise() - at.transpose()).rowwise().squaredNorm().minCoeff(&w);
    const int other = static_cast<int>(rng.uniform(0, n - 1e-9));
    landmarks.push_back({v, v % 3 == 0 ? other : static_cast<int>(w)});
  }
  const Result r = ism::compute_map(a, b, landmarks, on_one_thread());
  REQUIRE(ism::is_usable(r.status));
  CHECK(r.final_state().mean_distortion < 2.15);
  CHECK(mean_error(r, S) < 0.05);
  const auto is_of_landmarks = [](const ism::Warning& w) {
    return w.message.find("landmarks may be wrong") != std::string::npos;
  };
  CHECK(std::any_of(r.warnings.begin(), r.warnings.end(), is_of_landmarks));
}

TEST_CASE("a curve comes to lie on another one, and points slide along it") {
  const std::pair<shapes::Disk, shapes::Disk> squares = bent_squares(13);
  const shapes::Disk &a = squares.first, &b = squares.second;
  ism::Curve curve;
  for (int i = 4; i <= 16; ++i) curve.a.push_back(10 * 21 + i);
  for (int i = 2; i <= 19; ++i) curve.b.push_back(12 * 22 + i);  // a tenth of the side away
  const auto distance = [&](const std::vector<ism::Curve>& curves) {
    ism::Options options = on_one_thread();
    options.curves = curves;
    const Result r = ism::compute_map(a.mesh, b.mesh, {{0, 0, 0}, {440, 439, 0}}, options);
    REQUIRE(ism::is_usable(r.status));
    for (std::size_t i = 1; i < r.log.size(); ++i)  // springs follow the pull to first order
      CHECK(r.log[i].energy <= r.log[i - 1].energy + 1e-3);
    const ism::SurfaceMap map(r);
    double sum = 0;
    for (int v : curve.a) {
      const Vector3d at = map.position_on_b(map.forward_vertex(v));
      double least = kInfinity;
      for (std::size_t i = 1; i < curve.b.size(); ++i) {
        const Vector3d p = b.mesh.vertices.row(curve.b[i - 1]).transpose();
        const Vector3d along = b.mesh.vertices.row(curve.b[i]).transpose() - p;
        const double t = std::min(1.0, std::max(0.0, (at - p).dot(along) / along.squaredNorm()));
        least = std::min(least, (p + t * along - at).norm());
      }
      sum += least;
    }
    return sum / static_cast<double>(curve.a.size());
  };
  CHECK(distance({curve}) < 0.1 * distance({}));

  ism::Options options = on_one_thread();
  options.curves = {curve, curve};
  options.curves[1].b.push_back(440);
  const Result refused = ism::compute_map(a.mesh, b.mesh, {}, options);
  CHECK(refused.status == ism::Status::kInvalidLandmarks);
  CHECK(refused.message == "curve 1: mesh B has no vertex 440");
}

}  // namespace starts_tests

#endif  // ISM_TESTS_PART_STARTS_HPP

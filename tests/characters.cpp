// characters.cpp: small characters whose truth is known, for test_transfer.sh, and pictures of any.
//
//   characters make FOLDER              writes source.glb, target.glb and landmarks.txt
//   characters check TARGET OUT         compares what ism_transfer made of them with the truth
//   characters same TARGET OUT          how far the rest pose of OUT is from TARGET
//   characters draw FILE SECONDS PNG    draws a character at a time of its first animation; < 0: at
//                                       rest, with its last morph target at 1 if < -1

#include "gltf_io.hpp"
#include "mesh_io.hpp"
#include "render.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

namespace {

using gltf_io::at;

constexpr double kPi = 3.14159265358979323846;

// ==== [1] A LIMB =================================================================================

/// A capped tube along a bent axis. s runs from 0 to 1 along it, u around it; r is longer on the
/// side of u = 0, so that a map knows how to turn.
struct Limb {
  double length = 1, radius = 0.15, bend = 0;  // the angle of the far half, about the joint
  int rings = 24, sides = 24;
  bool is_alternating = false;  // the other diagonals

  /// The frame of the axis at s: across towards u = 0, across, along; and its origin.
  void frame(double s, Eigen::Matrix3d& axes, Eigen::Vector3d& origin) const {
    constexpr double kSoft = 0.3;  // of the length is bent
    const double from = 0.5 - kSoft / 2, to = 0.5 + kSoft / 2;
    const auto angle = [&](double t) {
      return bend * std::min(std::max((t - from) / (to - from), 0.0), 1.0);
    };
    origin.setZero();
    constexpr int kSteps = 400;
    for (int i = 0; i < kSteps; ++i) {
      const double a = angle(s * (i + 0.5) / kSteps);
      origin += length * s / kSteps * Eigen::Vector3d(0, -std::sin(a), std::cos(a));
    }
    const double a = angle(s);
    axes.col(0) = Eigen::Vector3d::UnitX();
    axes.col(1) = Eigen::Vector3d(0, std::cos(a), std::sin(a));
    axes.col(2) = Eigen::Vector3d(0, -std::sin(a), std::cos(a));
  }
  /// How far the surface is from the axis, in radii: round ends, and a ridge.
  static double profile(double s, double u) {
    const double end = 0.12, t = std::min(s, 1 - s);
    const double round = t < end ? std::sqrt(std::max(0.0, 1 - (1 - t / end) * (1 - t / end))) : 1;
    return round * (1 + 0.5 * std::pow(std::max(0.0, std::cos(u)), 4));
  }
  Eigen::Vector3d point(double s, double u, double swelling = 0) const {
    Eigen::Matrix3d axes;
    Eigen::Vector3d origin;
    frame(s, axes, origin);
    const double r = radius * profile(s, u) * (1 + swelling);
    return origin + axes * Eigen::Vector3d(r * std::cos(u), r * std::sin(u), 0);
  }
};

/// The truth at a place of any limb: how much follows the second joint, how much the morph target
/// swells, and a colour.
double follows_second(double s) { return std::min(std::max((s - 0.3) / 0.4, 0.0), 1.0); }
double swelling(double s) { return 0.8 * std::exp(-std::pow((s - 0.75) / 0.12, 2)); }
Eigen::RowVector4d color(double s, double u) { return {s, 0.5 + 0.5 * std::cos(u), 1 - s, 1}; }

/// Vertices of a limb as in a file: those on the seam u = 0 twice, the poles once per side.
struct Mesh {
  std::vector<std::array<double, 2>> place;  // s, u
  std::vector<std::array<int, 3>> triangles;
};

Mesh mesh_of(const Limb& limb) {
  Mesh mesh;
  const int n = limb.sides, m = limb.rings;
  for (int i = 0; i <= m; ++i)
    for (int k = 0; k <= n; ++k)
      mesh.place.push_back({0.5 - 0.5 * std::cos(kPi * i / m), 2 * kPi * k / n});
  for (int i = 0; i < m; ++i)
    for (int k = 0; k < n; ++k) {
      const int a = i * (n + 1) + k, b = a + 1, c = b + n + 1, d = a + n + 1;
      if (i == 0)
        mesh.triangles.push_back({a, c, d});
      else if (i == m - 1)
        mesh.triangles.push_back({a, b, d});
      else if (limb.is_alternating && (i + k) % 2 != 0)
        mesh.triangles.insert(mesh.triangles.end(), {{a, b, d}, {b, c, d}});
      else
        mesh.triangles.insert(mesh.triangles.end(), {{a, b, c}, {a, c, d}});
    }
  return mesh;
}

Limb source_limb() { return {}; }
Limb target_limb() {
  Limb limb;
  limb.length = 2.4;
  limb.radius = 0.3;
  limb.bend = 0.9;
  limb.rings = 31;
  limb.sides = 28;
  limb.is_alternating = true;
  return limb;
}

// ==== [2] FILES ==================================================================================

struct Builder {
  tinygltf::Model model;
  tinygltf::Primitive primitive;

  int vertices(const ism::Values& rows) {
    return gltf_io::add_numbers<float>(model, rows, TINYGLTF_TARGET_ARRAY_BUFFER);
  }
  void triangles(const std::vector<std::array<int, 3>>& list) {
    ism::Values ids(3 * gltf_io::size_of(list), 1);
    for (Eigen::Index i = 0; i < ids.rows(); ++i)
      ids(i, 0) = list[static_cast<std::size_t>(i / 3)][static_cast<std::size_t>(i % 3)];
    primitive.indices =
        gltf_io::add_numbers<std::uint32_t>(model, ids, TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
  }
  void add_mesh(const std::string& name, tinygltf::Node node) {
    tinygltf::Mesh mesh;
    mesh.name = node.name = name;
    mesh.primitives.push_back(primitive);
    model.meshes.push_back(mesh);
    node.mesh = gltf_io::size_of(model.meshes) - 1;
    model.nodes.push_back(node);
    primitive = {};
  }
  void finish(const std::vector<int>& roots) {
    model.asset.version = "2.0";
    model.scenes.resize(1);
    model.scenes[0].nodes = roots;
    model.defaultScene = 0;
  }
};

/// Where around the axis a vertex is; copies have the same bits.
double around(double s, double u) { return u > 2 * kPi - 1e-9 || Limb::profile(s, u) <= 0 ? 0 : u; }

ism::Values positions(const Limb& limb, const Mesh& mesh) {
  ism::Values rows(gltf_io::size_of(mesh.place), 3);
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const auto& [s, u] = mesh.place[static_cast<std::size_t>(i)];
    rows.row(i) = limb.point(s, around(s, u)).transpose();
  }
  return rows;
}

/// The skin, the morph target, texture coordinates and colours of the source.
void add_truth(const Limb& limb, const Mesh& mesh, Builder& b) {
  const Eigen::Index n = gltf_io::size_of(mesh.place);
  ism::Values joints = ism::Values::Zero(n, 4), weights = joints, colors(n, 4), uv(n, 2),
              moves(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& [s, u] = mesh.place[static_cast<std::size_t>(i)];
    const double w = follows_second(s);
    joints(i, 1) = w > 0 && w < 1;
    joints(i, 0) = w >= 1;
    weights(i, 0) = w > 0 && w < 1 ? 1 - w : 1;
    weights(i, 1) = w > 0 && w < 1 ? w : 0;
    colors.row(i) = color(s, u);
    uv.row(i) << u / (2 * kPi), s;
    const double at = around(s, u);
    moves.row(i) = (limb.point(s, at, swelling(s)) - limb.point(s, at)).transpose();
  }
  auto& attributes = b.primitive.attributes;
  attributes["JOINTS_0"] =
      gltf_io::add_numbers<std::uint8_t>(b.model, joints, TINYGLTF_TARGET_ARRAY_BUFFER);
  attributes["WEIGHTS_0"] = b.vertices(weights);
  attributes["COLOR_0"] = b.vertices(colors);
  attributes["TEXCOORD_0"] = b.vertices(uv);
  b.primitive.targets.push_back({{"POSITION", b.vertices(moves)}});
}

/// A skeleton of two joints, the second one in the middle of the axis; the animation bends it.
void add_skeleton(const Limb& limb, Builder& b) {
  ism::Values inverse(2, 16);
  for (int j = 0; j < 2; ++j) {
    Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
    m(2, 3) = j == 0 ? 0 : -limb.length / 2;
    inverse.row(j) = Eigen::Map<Eigen::RowVectorXd>(m.data(), 16);
  }
  tinygltf::Node root, tip;
  root.name = "upper";
  root.children = {2};
  tip.name = "lower";
  tip.translation = {0, 0, limb.length / 2};
  b.model.nodes.push_back(root);
  b.model.nodes.push_back(tip);
  tinygltf::Skin skin;
  skin.joints = {1, 2};
  skin.inverseBindMatrices = gltf_io::add_numbers<float>(b.model, inverse, 0);
  b.model.skins.push_back(skin);
  ism::Values times(2, 1), turns(2, 4), weights(2, 1);
  times << 0, 1;
  turns << 0, 0, 0, 1, std::sin(0.6), 0, 0, std::cos(0.6);
  weights << 0, 1;
  tinygltf::Animation animation;
  animation.name = "bend";
  const int input = gltf_io::add_numbers<float>(b.model, times, 0);
  for (const bool is_weights : {false, true}) {
    tinygltf::AnimationSampler sampler;
    sampler.input = input;
    sampler.output = gltf_io::add_numbers<float>(b.model, is_weights ? weights : turns, 0);
    tinygltf::AnimationChannel channel;
    channel.sampler = is_weights;
    channel.target_node = is_weights ? 0 : 2;
    channel.target_path = is_weights ? "weights" : "rotation";
    animation.samplers.push_back(sampler);
    animation.channels.push_back(channel);
  }
  b.model.animations.push_back(animation);
}

std::string source_file() {
  const Limb limb = source_limb();
  const Mesh mesh = mesh_of(limb);
  Builder b;
  b.primitive.attributes["POSITION"] = b.vertices(positions(limb, mesh));
  b.triangles(mesh.triangles);
  add_truth(limb, mesh, b);
  tinygltf::Node node;
  node.skin = 0;
  b.add_mesh("limb", node);
  tinygltf::Value::Object extras;
  extras["targetNames"] =
      tinygltf::Value(tinygltf::Value::Array{tinygltf::Value(std::string("flex"))});
  b.model.meshes[0].extras = tinygltf::Value(extras);
  b.model.meshes[0].weights = {0};
  add_skeleton(limb, b);
  b.finish({0, 1});
  return gltf_io::glb_text(b.model);
}

/// Another limb below a node that turns and scales it, and a small ring about its far half.
std::string target_file() {
  const Limb limb = target_limb();
  const Mesh mesh = mesh_of(limb);
  Builder b;
  tinygltf::Node place;
  place.name = "place";
  place.children = {1, 2};
  place.rotation = {0, std::sin(0.4), 0, std::cos(0.4)};
  place.translation = {3, 0, 0};
  place.scale = {0.5, 0.5, 0.5};
  b.model.nodes.push_back(place);
  const ism::Values points = positions(limb, mesh);
  b.primitive.attributes["POSITION"] = b.vertices(points);
  b.triangles(mesh.triangles);
  b.add_mesh("body", {});
  ism::Values ring(2 * (limb.sides + 1), 3);
  std::vector<std::array<int, 3>> band;
  for (int k = 0; k <= limb.sides; ++k) {
    const double u = 2 * kPi * (k % limb.sides) / limb.sides;
    ring.row(2 * k) = limb.point(0.8, u, 0.1).transpose();
    ring.row(2 * k + 1) = limb.point(0.85, u, 0.1).transpose();
    if (k < limb.sides)
      band.insert(band.end(), {{2 * k, 2 * k + 2, 2 * k + 1}, {2 * k + 2, 2 * k + 3, 2 * k + 1}});
  }
  b.primitive.attributes["POSITION"] = b.vertices(ring);
  b.triangles(band);
  b.add_mesh("ring", {});
  b.finish({0});
  return gltf_io::glb_text(b.model);
}

/// Points on the ridge and opposite to it, in the space of both scenes.
std::string landmark_text(const gltf_io::File& target) {
  const Eigen::Matrix4d place =
      gltf_io::global_transform(target.model, gltf_io::parents_of(target.model), 1);
  std::string text;
  for (const double s : {0.15, 0.5, 0.85})
    for (const double u : {0.0, kPi}) {
      const Eigen::Vector3d a = source_limb().point(s, u);
      const Eigen::Vector3d b = (place * target_limb().point(s, u).homogeneous()).head<3>();
      char line[200];
      std::snprintf(line, sizeof line, "%.9f %.9f %.9f %.9f %.9f %.9f\n", a[0], a[1], a[2], b[0],
                    b[1], b[2]);
      text += line;
    }
  return text;
}

// ==== [3] POSES ==================================================================================

/// Per vertex of a part, what its joints or its node do to it.
std::vector<Eigen::Matrix4d> vertex_transforms(const tinygltf::Model& m,
                                               const gltf_io::Part& part) {
  const std::vector<int> parents = gltf_io::parents_of(m);
  const std::size_t n = static_cast<std::size_t>(part.vertices);
  const int skin = at(m.nodes, part.node).skin;
  if (skin < 0) return {n, gltf_io::global_transform(m, parents, part.node)};
  std::vector<Eigen::Matrix4d> joints = gltf_io::inverse_binds(m, skin);
  for (int j = 0; j < gltf_io::size_of(joints); ++j)
    at(joints, j) =
        gltf_io::global_transform(m, parents, at(at(m.skins, skin).joints, j)) * at(joints, j);
  std::vector<Eigen::Matrix4d> transforms(n, Eigen::Matrix4d::Zero());
  const auto& attributes = gltf_io::primitive_of(m, part).attributes;
  for (int set = 0; attributes.count("JOINTS_" + std::to_string(set)) > 0; ++set) {
    const ism::Values ids = gltf_io::numbers(m, attributes.at("JOINTS_" + std::to_string(set)));
    const ism::Values weights =
        gltf_io::numbers(m, attributes.at("WEIGHTS_" + std::to_string(set)));
    for (int v = 0; v < part.vertices; ++v)
      for (int k = 0; k < 4; ++k)
        at(transforms, v) += weights(v, k) * at(joints, static_cast<int>(ids(v, k)));
  }
  return transforms;
}

/// The scene with its skins and morph targets applied.
ism::TriangleMesh posed(const tinygltf::Model& m, const gltf_io::Surface& surface) {
  ism::TriangleMesh mesh = surface.mesh;
  for (const gltf_io::Part& part : surface.parts) {
    const tinygltf::Node& node = at(m.nodes, part.node);
    const tinygltf::Mesh& of = at(m.meshes, part.mesh);
    const tinygltf::Primitive& p = at(of.primitives, part.primitive);
    ism::Values x = gltf_io::numbers(m, p.attributes.at("POSITION"));
    const std::vector<double>& shown = node.weights.empty() ? of.weights : node.weights;
    for (int t = 0; t < gltf_io::size_of(p.targets) && t < gltf_io::size_of(shown); ++t)
      x += at(shown, t) * gltf_io::numbers(m, at(p.targets, t).at("POSITION"));
    const std::vector<Eigen::Matrix4d> transforms = vertex_transforms(m, part);
    for (int v = 0; v < part.vertices; ++v)
      mesh.vertices.row(part.first_vertex + v) =
          (at(transforms, v) * x.row(v).transpose().homogeneous()).head<3>().transpose();
  }
  return mesh;
}

/// Puts nodes and weights where an animation has them at a time, linearly between its keys.
void animate(tinygltf::Model& m, const tinygltf::Animation& animation, double time) {
  for (const tinygltf::AnimationChannel& channel : animation.channels) {
    const tinygltf::AnimationSampler& sampler = at(animation.samplers, channel.sampler);
    const ism::Values times = gltf_io::numbers(m, sampler.input);
    const ism::Values keys = gltf_io::numbers(m, sampler.output);
    const Eigen::Index n = times.rows(), width = keys.size() / n;
    Eigen::Index i = 0;
    while (i + 1 < n && times(i + 1, 0) < time) ++i;
    const Eigen::Index j = std::min(i + 1, n - 1);
    const double span = times(j, 0) - times(i, 0);
    const double t = span > 0 ? std::min(std::max((time - times(i, 0)) / span, 0.0), 1.0) : 0;
    Eigen::VectorXd a = Eigen::Map<const Eigen::VectorXd>(keys.data() + i * width, width);
    const Eigen::VectorXd b = Eigen::Map<const Eigen::VectorXd>(keys.data() + j * width, width);
    if (channel.target_path == "rotation" && a.dot(b) < 0) a = -a;
    const Eigen::VectorXd x = (1 - t) * a + t * b;
    const std::vector<double> value(x.data(), x.data() + x.size());
    tinygltf::Node& node = at(m.nodes, channel.target_node);
    if (channel.target_path == "rotation") node.rotation = value;
    if (channel.target_path == "translation") node.translation = value;
    if (channel.target_path == "scale") node.scale = value;
    if (channel.target_path == "weights") node.weights = value;
  }
}

// ==== [4] CHECKS =================================================================================

int failures = 0;

void expect_below(const char* what, double value, double bound) {
  std::printf("%-44s %.6f, bound %g\n", what, value, bound);
  if (value <= bound) return;
  std::printf("FAILED: %s\n", what);
  ++failures;
}

/// A largest and a mean value.
struct Error {
  double largest = 0, sum = 0;
  int count = 0;
  void add(double e) {
    largest = std::max(largest, std::isfinite(e) ? e : 1e300);
    sum += e;
    ++count;
  }
  double mean() const { return count > 0 ? sum / count : 1e300; }
};

/// Errors beside what bounds them.
struct Excess {
  double largest = 0, errors = 0, bounds = 0;  // largest: error divided by its bound
  void add(double error, double bound) {
    largest = std::max(largest, std::isfinite(error) ? error / bound : 1e300);
    errors += error;
    bounds += bound;
  }
  void expect(const std::string& what) const {
    expect_below((what + ": largest error, in bounds").c_str(), largest, 1);
    expect_below((what + ": mean error, in mean bounds").c_str(), errors / bounds, 0.5);
  }
};

/// How much a truth differs between a place of a limb and those up to one edge of each mesh away.
/// The source has values at its vertices only, so between them they are off by what changes along
/// an edge of it. The map is linear in pieces, so it is off by about an edge of the target. This
/// bounds the error of a vertex. On average it is at most half of that: places spread evenly within
/// an edge are half an edge away.
template <class Truth>
double variation(const Truth& truth, double s, double u) {
  const Limb a = source_limb(), b = target_limb();
  const double edge_s = kPi / 2 / a.rings + kPi / 2 / b.rings;  // in the middle, the longest ones
  const double edge_u = 2 * kPi / a.sides + 2 * kPi / b.sides;
  const double near_u = std::min(kPi, edge_u / std::max(Limb::profile(s, kPi), 1e-9));
  constexpr int kSteps = 4;
  double most = 0;
  for (int i = -kSteps; i <= kSteps; ++i)
    for (int k = -kSteps; k <= kSteps; ++k) {
      const double near_s = std::min(std::max(s + edge_s * i / kSteps, 0.0), 1.0);
      most = std::max(most, (truth(near_s, u + near_u * k / kSteps) - truth(s, u)).norm());
    }
  return most;
}

int open_file(const std::string& path, gltf_io::File& file, gltf_io::Surface& surface) {
  file = gltf_io::load(path);
  if (file.error.empty()) surface = gltf_io::surface_of(file);
  const std::string& error = file.error.empty() ? surface.error : file.error;
  if (!error.empty()) std::printf("FAILED: %s\n", error.c_str());
  return error.empty() ? 0 : 1;
}

int node_named(const tinygltf::Model& m, const std::string& name) {
  for (int i = 0; i < gltf_io::size_of(m.nodes); ++i)
    if (at(m.nodes, i).name == name) return i;
  return -1;
}

/// Vertices of the target come first in every part, at the place where they were.
int check_same(const std::string& target_path, const std::string& out_path) {
  gltf_io::File target, out;
  gltf_io::Surface before, after;
  if (open_file(target_path, target, before) + open_file(out_path, out, after) > 0) return 1;
  const ism::TriangleMesh a = posed(target.model, before), b = posed(out.model, after);
  const double size = (a.vertices.colwise().maxCoeff() - a.vertices.colwise().minCoeff()).norm();
  Error error;
  for (const gltf_io::Part& part : before.parts)
    for (const gltf_io::Part& other : after.parts) {
      if (at(target.model.meshes, part.mesh).name != at(out.model.meshes, other.mesh).name ||
          part.primitive != other.primitive)
        continue;
      for (int v = 0; v < part.vertices; ++v)
        error.add((a.vertices.row(part.first_vertex + v) - b.vertices.row(other.first_vertex + v))
                      .norm() /
                  size);
    }
  expect_below("the rest pose is the target's, of its size", error.largest, 1e-6);
  return failures;
}

void check_vertices(const tinygltf::Model& m, const gltf_io::Part& part, bool is_ring) {
  const Limb limb = target_limb();
  const Mesh mesh = mesh_of(limb);
  const tinygltf::Primitive& p = gltf_io::primitive_of(m, part);
  const ism::Values joints = gltf_io::numbers(m, p.attributes.at("JOINTS_0"));
  const ism::Values weights = gltf_io::numbers(m, p.attributes.at("WEIGHTS_0"));
  const ism::Values moves = gltf_io::numbers(m, p.targets.at(0).at("POSITION"));
  const std::vector<int>& skin = at(m.skins, at(m.nodes, part.node).skin).joints;
  const int lower = node_named(m, "lower");
  const auto follow_truth = [](double s, double) {
    return Eigen::Matrix<double, 1, 1>(follows_second(s));
  };
  const auto move_truth = [&](double s, double u) {
    return Eigen::Vector3d(limb.point(s, u, swelling(s)) - limb.point(s, u));
  };
  constexpr double kDropped = 2e-3;  // weights below 0.001 are left out, and the others grow
  Excess follow, move, colored;
  for (int v = 0; v < (is_ring ? part.vertices : gltf_io::size_of(mesh.place)); ++v) {
    const double s = is_ring ? 0.8 + 0.05 * (v % 2) : at(mesh.place, v)[0];
    const double u = is_ring ? 2 * kPi * (v / 2) / limb.sides : around(s, at(mesh.place, v)[1]);
    double w = 0;
    for (int k = 0; k < 4; ++k)
      if (at(skin, static_cast<int>(joints(v, k))) == lower) w += weights(v, k);
    follow.add(std::abs(w - follows_second(s)), variation(follow_truth, s, u) + kDropped);
    move.add((moves.row(v).transpose() - move_truth(s, u)).norm(), variation(move_truth, s, u));
    if (!is_ring) {
      const ism::Values colors = gltf_io::numbers(m, p.attributes.at("COLOR_0"));
      colored.add((colors.row(v) - color(s, u)).norm(), variation(color, s, u));
    }
  }
  const std::string name = is_ring ? "ring: " : "body: ";
  follow.expect(name + "weights");
  move.expect(name + "morph");
  if (!is_ring) colored.expect(name + "colours");
}

/// No triangle reaches across the seam of the texture coordinates.
void check_uv(const tinygltf::Model& m, const gltf_io::Surface& surface,
              const gltf_io::Part& part) {
  const ism::Points2 uv = gltf_io::corner_uv(m, surface, [](const gltf_io::Part&) { return 0; });
  double widest = 0;
  Error height;
  const Limb limb = target_limb();
  const Mesh mesh = mesh_of(limb);
  for (int f = part.first_triangle; f < part.first_triangle + part.triangles; ++f) {
    const auto rows = uv.middleRows<3>(3 * f);
    widest = std::max(widest, rows.col(0).maxCoeff() - rows.col(0).minCoeff());
    for (int k = 0; k < 3; ++k) {
      const int v = surface.mesh.triangles(f, k) - part.first_vertex;
      if (v < gltf_io::size_of(mesh.place))
        height.add(std::abs(1 - rows(k, 1) - at(mesh.place, v)[0]));
    }
  }
  expect_below("body: widest triangle of the texture", widest, 0.6);
  expect_below("body: mean error of the texture's height", height.mean(), 0.03);
}

int check(const std::string& target_path, const std::string& out_path) {
  gltf_io::File out;
  gltf_io::Surface surface;
  if (check_same(target_path, out_path) + open_file(out_path, out, surface) > 0) return 1;
  const tinygltf::Model& m = out.model;
  for (const gltf_io::Part& part : surface.parts) {
    const bool is_ring = at(m.meshes, part.mesh).name == "ring";
    check_vertices(m, part, is_ring);
    if (!is_ring) check_uv(m, surface, part);
  }
  const std::vector<int> parents = gltf_io::parents_of(m);
  const Limb limb = target_limb();
  Eigen::Matrix3d axes;
  Eigen::Vector3d middle;
  limb.frame(0.5, axes, middle);
  const Eigen::Matrix4d place = gltf_io::global_transform(m, parents, node_named(m, "place"));
  const Eigen::Vector3d joint =
      gltf_io::global_transform(m, parents, node_named(m, "lower")).topRightCorner<3, 1>();
  expect_below("the joint's distance from the axis, in radii",
               (joint - (place * middle.homogeneous()).head<3>()).norm() / (0.5 * limb.radius),
               0.5);
  return failures;
}

// ==== [5] PICTURES ===============================================================================

/// The image that a part shows, decoded; no pixels if none.
render::Image texture_of(const tinygltf::Model& m, const gltf_io::Part& part) {
  const int material = gltf_io::primitive_of(m, part).material;
  if (material < 0) return {};
  const int texture = at(m.materials, material).pbrMetallicRoughness.baseColorTexture.index;
  if (texture < 0) return {};
  const std::vector<unsigned char>& bytes = at(m.images, at(m.textures, texture).source).image;
  return render::read_image(std::string(bytes.begin(), bytes.end())).image;
}

int draw(const std::string& path, double time, const std::string& picture) {
  gltf_io::File file;
  gltf_io::Surface surface;
  if (open_file(path, file, surface) > 0) return 1;
  if (time >= 0 && !file.model.animations.empty())
    animate(file.model, file.model.animations[0], time);
  for (tinygltf::Mesh& mesh : file.model.meshes)
    if (time < -1 && !mesh.weights.empty()) mesh.weights.back() = 1;
  const ism::TriangleMesh mesh = posed(file.model, surface);
  const ism::Points2 uv = gltf_io::corner_uv(file.model, surface, [&](const gltf_io::Part& part) {
    const int material = gltf_io::primitive_of(file.model, part).material;
    return material < 0
               ? 0
               : at(file.model.materials, material).pbrMetallicRoughness.baseColorTexture.texCoord;
  });
  render::Canvas canvas(1200, 800);
  for (int side = 0; side < 2; ++side) {
    const render::View view =
        render::look_at(mesh.vertices, side == 0 ? 20 : 110, 10, {600.0 * side + 20, 20, 560, 760});
    for (const gltf_io::Part& part : surface.parts) {
      const render::Image image = texture_of(file.model, part);
      render::Shape shape;
      shape.vertices = mesh.vertices;
      shape.triangles = mesh.triangles.middleRows(part.first_triangle, part.triangles);
      if (!image.pixels.empty()) {
        shape.texture = &image;
        shape.corner_uv = uv.middleRows(3 * part.first_triangle, 3 * part.triangles);
      }
      canvas.draw(view, shape);
    }
  }
  const std::string error = mesh_io::write_files({{picture, render::png_text(canvas.image())}});
  if (!error.empty()) std::printf("FAILED: %s\n", error.c_str());
  return error.empty() ? 0 : 1;
}

int make(const std::string& folder) {
  const std::string target = target_file();
  std::string error = mesh_io::write_files(
      {{folder + "/source.glb", source_file()}, {folder + "/target.glb", target}});
  gltf_io::File file;
  if (error.empty()) file = gltf_io::load(folder + "/target.glb");
  if (error.empty()) error = file.error;
  if (error.empty())
    error = mesh_io::write_files({{folder + "/landmarks.txt", landmark_text(file)}});
  if (!error.empty()) std::printf("FAILED: %s\n", error.c_str());
  return error.empty() ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() == 2 && words[0] == "make") return make(words[1]);
  if (words.size() == 3 && words[0] == "check") return check(words[1], words[2]);
  if (words.size() == 3 && words[0] == "same") return check_same(words[1], words[2]);
  if (words.size() == 4 && words[0] == "draw") return draw(words[1], std::stod(words[2]), words[3]);
  std::printf(
      "usage: characters make FOLDER | check TARGET OUT | same TARGET OUT |\n"
      "       draw FILE SECONDS PNG\n");
  return 2;
}

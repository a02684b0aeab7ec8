// character.hpp: what a glTF character has beside its surface: a skin, morph targets, texture
// coordinates and colours, at the vertices of the surface. Part of the examples of ism.hpp.
//
//   character::Character woman;
//   const std::string error = character::read("woman.glb", woman);

#ifndef ISM_EXAMPLES_CHARACTER_HPP
#define ISM_EXAMPLES_CHARACTER_HPP

#include "gltf_io.hpp"
#include "ism.hpp"
#include "retarget.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace character {

/// A displacement of all vertices, in the scene.
struct Morph {
  std::string name;
  ism::Points3 moves;  // #V×3
};

struct Character {
  gltf_io::File file;
  gltf_io::Surface surface;
  std::vector<retarget::Bone> bones;  // joints of all skins and what is between, parents first
  std::vector<int> bone_nodes;        // of the bones
  std::vector<bool> is_joint;         // per bone: it is a joint of a skin
  ism::Values weights;                // #V×#bones, sums 1 or 0; no rows: there is no skin
  std::vector<Morph> morphs;
  std::vector<std::vector<int>> morph_of;  // per mesh and target of it, which of the morphs it is
  ism::Values colors;                      // #V×4, linear; no rows: there are none
  ism::Points2 uv;                         // #corners×2, v upwards; no rows: there are none
  std::vector<int> part_of;                // per triangle
};

/// Reads a file with all that is in it. Returns what is wrong, or an empty string.
inline std::string read(const std::string& path, Character& c);

/// The number of the texture coordinates that the material of a part shows.
inline int shown_uv(const tinygltf::Model& model, const gltf_io::Part& part);

namespace detail {

using gltf_io::at;
using gltf_io::size_of;

inline int depth(const std::vector<int>& parents, int node) {
  int count = 0;
  for (node = at(parents, node); node >= 0; node = at(parents, node)) ++count;
  return count;
}

/// Finds the joints of all skins that parts of the surface have, and where they are in the bind
/// pose, per node; NaN: it is no joint. Returns what is wrong.
inline std::string find_joints(const Character& c, std::vector<Eigen::Matrix4d>& binds) {
  const tinygltf::Model& m = c.file.model;
  const Eigen::Matrix4d none = Eigen::Matrix4d::Constant(std::numeric_limits<double>::quiet_NaN());
  binds.assign(m.nodes.size(), none);
  for (const gltf_io::Part& part : c.surface.parts) {
    const int skin = at(m.nodes, part.node).skin;
    if (skin < 0) continue;
    const std::vector<Eigen::Matrix4d> inverse = gltf_io::inverse_binds(m, skin);
    const std::vector<int>& joints = at(m.skins, skin).joints;
    for (std::size_t i = 0; i < joints.size(); ++i) {
      if (at(binds, joints[i]).allFinite()) continue;
      const Eigen::Matrix4d bind = part.placed * inverse[i].inverse();
      if (!bind.allFinite())
        return c.file.path + ": an inverse bind matrix of skin " + std::to_string(skin) +
               " has no inverse";
      at(binds, joints[i]) = bind;
    }
  }
  return {};
}

/// Joints, and nodes between them, which keep their place below their parents.
inline std::string read_bones(Character& c) {
  const tinygltf::Model& m = c.file.model;
  const std::vector<int> parents = gltf_io::parents_of(m);
  std::vector<Eigen::Matrix4d> binds;
  const std::string error = find_joints(c, binds);
  if (!error.empty()) return error;
  std::vector<char> is_bone(m.nodes.size(), 0);
  for (int node = 0; node < size_of(m.nodes); ++node) {
    if (!at(binds, node).allFinite()) continue;
    int top = node;  // the highest joint above
    for (int up = node; up >= 0; up = at(parents, up))
      if (at(binds, up).allFinite()) top = up;
    for (int up = node; up != top; up = at(parents, up)) at(is_bone, up) = 1;
    at(is_bone, top) = 1;
  }
  for (int node = 0; node < size_of(m.nodes); ++node)
    if (at(is_bone, node) != 0) c.bone_nodes.push_back(node);
  std::stable_sort(c.bone_nodes.begin(), c.bone_nodes.end(),
                   [&](int i, int j) { return depth(parents, i) < depth(parents, j); });
  std::vector<int> bone_of(m.nodes.size(), -1);
  for (const int node : c.bone_nodes) {
    const int parent = at(parents, node);
    retarget::Bone bone;
    bone.parent = parent >= 0 ? at(bone_of, parent) : -1;
    c.is_joint.push_back(at(binds, node).allFinite());
    bone.bind = c.is_joint.back() ? at(binds, node)
                                  : Eigen::Matrix4d(at(c.bones, bone.parent).bind *
                                                    gltf_io::local_transform(at(m.nodes, node)));
    at(bone_of, node) = size_of(c.bones);
    c.bones.push_back(bone);
  }
  return {};
}

/// The joint that carries a node without a skin: itself or the nearest one above, or -1.
inline int carrying_joint(const Character& c, int node) {
  const std::vector<int> parents = gltf_io::parents_of(c.file.model);
  for (; node >= 0; node = at(parents, node))
    for (int bone = 0; bone < size_of(c.bone_nodes); ++bone)
      if (at(c.bone_nodes, bone) == node && at(c.is_joint, bone)) return bone;
  return -1;
}

/// Adds JOINTS_n and WEIGHTS_n of a part. Returns what is wrong.
inline std::string add_weights(Character& c, const gltf_io::Part& part, int set) {
  const tinygltf::Model& m = c.file.model;
  const std::string number = std::to_string(set);
  const auto& attributes = gltf_io::primitive_of(m, part).attributes;
  const std::vector<int>& joints = at(m.skins, at(m.nodes, part.node).skin).joints;
  const ism::Values ids = gltf_io::numbers(m, attributes.at("JOINTS_" + number));
  const ism::Values values = gltf_io::numbers(m, attributes.at("WEIGHTS_" + number));
  if (ids.cols() != 4 || values.cols() != 4)
    return c.file.path + ": JOINTS_" + number + " and WEIGHTS_" + number +
           " have not four numbers each";
  for (int v = 0; v < part.vertices; ++v)
    for (int k = 0; k < 4; ++k) {
      const double weight = values(v, k), id = ids(v, k);
      if (weight == 0) continue;
      const std::string where =
          c.file.path + ": vertex " + std::to_string(v) + " of mesh " + std::to_string(part.mesh);
      if (!(weight > 0) || !std::isfinite(weight)) return where + " has a weight that is none";
      if (!(id >= 0 && id < static_cast<double>(joints.size())))
        return where + " follows a joint that does not exist";
      const auto bone =
          std::find(c.bone_nodes.begin(), c.bone_nodes.end(), at(joints, static_cast<int>(id)));
      c.weights(part.first_vertex + v, bone - c.bone_nodes.begin()) += weight;
    }
  return {};
}

inline std::string read_weights(Character& c) {
  if (c.bones.empty()) return {};
  c.weights = ism::Values::Zero(c.surface.mesh.vertices.rows(), size_of(c.bones));
  for (const gltf_io::Part& part : c.surface.parts) {
    const auto& attributes = gltf_io::primitive_of(c.file.model, part).attributes;
    const bool has_skin = at(c.file.model.nodes, part.node).skin >= 0;
    for (int set = 0; has_skin && attributes.count("JOINTS_" + std::to_string(set)) > 0 &&
                      attributes.count("WEIGHTS_" + std::to_string(set)) > 0;
         ++set) {
      const std::string error = add_weights(c, part, set);
      if (!error.empty()) return error;
    }
    const int bone = has_skin ? -1 : carrying_joint(c, part.node);
    if (bone >= 0) c.weights.block(part.first_vertex, bone, part.vertices, 1).setOnes();
  }
  for (Eigen::Index v = 0; v < c.weights.rows(); ++v)
    if (c.weights.row(v).sum() > 0) c.weights.row(v) /= c.weights.row(v).sum();
  if (!(c.weights.sum() > 0)) c.weights.resize(0, 0);
  return {};
}

/// The name of a morph target, as programs keep it beside the mesh.
inline std::string target_name(const tinygltf::Mesh& mesh, int target) {
  if (mesh.extras.IsObject() && mesh.extras.Has("targetNames")) {
    const tinygltf::Value& names = mesh.extras.Get("targetNames");
    if (names.IsArray() && target < static_cast<int>(names.ArrayLen()) &&
        names.Get(target).IsString())
      return names.Get(target).Get<std::string>();
  }
  return "morph_" + std::to_string(target);
}

/// Targets with one name are one morph, also of several meshes.
inline int find_morph(Character& c, const std::string& name) {
  for (int i = 0; i < size_of(c.morphs); ++i)
    if (at(c.morphs, i).name == name) return i;
  c.morphs.push_back({name, ism::Points3::Zero(c.surface.mesh.vertices.rows(), 3)});
  return size_of(c.morphs) - 1;
}

inline std::string read_morphs(Character& c) {
  const tinygltf::Model& m = c.file.model;
  c.morph_of.resize(m.meshes.size());
  for (const gltf_io::Part& part : c.surface.parts) {
    const auto& targets = gltf_io::primitive_of(m, part).targets;
    std::vector<int>& morph_of = at(c.morph_of, part.mesh);
    for (int t = 0; t < size_of(targets); ++t) {
      const int morph = find_morph(c, target_name(at(m.meshes, part.mesh), t));
      if (t >= size_of(morph_of)) morph_of.push_back(morph);
      const int id = gltf_io::attribute(at(targets, t), "POSITION");
      if (id < 0) continue;
      const ism::Values moves = gltf_io::numbers(m, id);
      if (moves.cols() != 3 || !moves.allFinite())
        return c.file.path + ": morph target " + std::to_string(t) + " of mesh " +
               std::to_string(part.mesh) + " is not finite";
      at(c.morphs, morph).moves.middleRows(part.first_vertex, part.vertices) =
          moves * part.placed.topLeftCorner<3, 3>().transpose();
    }
  }
  return {};
}

/// White where there are none.
inline void read_colors(Character& c) {
  for (const gltf_io::Part& part : c.surface.parts) {
    const int id =
        gltf_io::attribute(gltf_io::primitive_of(c.file.model, part).attributes, "COLOR_0");
    if (id < 0) continue;
    const ism::Values values = gltf_io::numbers(c.file.model, id);
    if (!values.allFinite() || values.cols() < 3 || values.cols() > 4) continue;
    if (c.colors.rows() == 0) c.colors.setOnes(c.surface.mesh.vertices.rows(), 4);
    c.colors.block(part.first_vertex, 0, part.vertices, values.cols()) = values;
  }
}

}  // namespace detail

inline int shown_uv(const tinygltf::Model& model, const gltf_io::Part& part) {
  const int material = gltf_io::primitive_of(model, part).material;
  if (material < 0) return 0;
  const auto& texture =
      gltf_io::at(model.materials, material).pbrMetallicRoughness.baseColorTexture;
  return texture.index >= 0 ? texture.texCoord : 0;
}

inline std::string read(const std::string& path, Character& c) {
  c.file = gltf_io::load(path);
  if (!c.file.error.empty()) return c.file.error;
  c.surface = gltf_io::surface_of(c.file);
  if (!c.surface.error.empty()) return c.surface.error;
  for (int i = 0; i < gltf_io::size_of(c.surface.parts); ++i)
    c.part_of.insert(c.part_of.end(),
                     static_cast<std::size_t>(gltf_io::at(c.surface.parts, i).triangles), i);
  std::string error = detail::read_bones(c);
  if (error.empty()) error = detail::read_weights(c);
  if (error.empty()) error = detail::read_morphs(c);
  if (!error.empty()) return error;
  detail::read_colors(c);
  c.uv = gltf_io::corner_uv(c.file.model, c.surface, [&](const gltf_io::Part& part) {
    return shown_uv(c.file.model, part);
  });
  return {};
}

}  // namespace character

#endif  // ISM_EXAMPLES_CHARACTER_HPP

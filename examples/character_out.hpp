// character_out.hpp: writes a glTF character with what a map carried to it from another one. Part
// of the examples of ism.hpp.
//
//   character::Written file = character::write(source, target, carried);
//   mesh_io::write_files({{"out.glb", file.bytes}});
//
// All of the target's file stays but for what is replaced. Vertices keep their numbers; copies
// along seams of the carried texture coordinates come behind.

#ifndef ISM_EXAMPLES_CHARACTER_OUT_HPP
#define ISM_EXAMPLES_CHARACTER_OUT_HPP

#include "character.hpp"
#include "gltf_io.hpp"
#include "ism.hpp"
#include "render.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace character {

/// What came from the source to the surface of the target, in the scene of the target.
struct Carried {
  ism::Values weights;                  // #V×#bones of the source; no rows: no skin
  std::vector<Eigen::Matrix4d> frames;  // of the bones, in the target's body
  double scale = 1;                     // of the target's body, relative to the source's
  std::vector<Morph> morphs;
  ism::Values colors;           // #V×4; no rows: none
  ism::Points2 uv;              // #corners×2, v upwards, NaN where there are none; or no rows
  std::vector<int> materials;   // of the source, per triangle, with `uv`; -1: none
  std::vector<char> is_mapped;  // per part: it has texture coordinates and colours
  int influences = 4;           // joints per vertex: 4 or 8
};

struct Written {
  std::string bytes;  // of a .glb file; none if the format cannot hold them
  int copies = 0;     // of vertices, along seams
  /// Names of meshes that show textures of their own, and have the carried ones as a further set.
  std::vector<std::string> textured;
};

inline Written write(const Character& source, const Character& target, const Carried& carried);

// ==== Details ====================================================================================

namespace detail {

/// Attributes of vertices, a row per vertex.
inline int add_vertices(tinygltf::Model& m, const ism::Values& rows) {
  return gltf_io::add_numbers<float>(m, rows, TINYGLTF_TARGET_ARRAY_BUFFER);
}

/// Shows a new node in the scene. Returns its id.
inline int add_root(tinygltf::Model& m, const tinygltf::Node& node) {
  std::vector<int> roots = gltf_io::scene_roots(m);
  roots.push_back(size_of(m.nodes));
  m.nodes.push_back(node);
  m.defaultScene = (std::max)(m.defaultScene, 0);
  if (m.scenes.empty()) m.scenes.emplace_back();
  at(m.scenes, m.defaultScene).nodes = roots;
  return roots.back();
}

/// A node that stands for a transform, as near as translation, rotation and scale come to it.
inline void set_transform(tinygltf::Node& node, const Eigen::Matrix4d& local) {
  const Eigen::Matrix3d linear = local.topLeftCorner<3, 3>();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(linear, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = linear.determinant() < 0 ? -1 : 1;
  const Eigen::Matrix3d rotation = sign * svd.matrixU() * svd.matrixV().transpose();
  const Eigen::Vector3d scale = (rotation.transpose() * linear).diagonal();
  const Eigen::Quaterniond q = Eigen::Quaterniond(rotation).normalized();
  node.matrix.clear();
  node.translation = {local(0, 3), local(1, 3), local(2, 3)};
  node.rotation = {q.x(), q.y(), q.z(), q.w()};
  node.scale = {scale[0], scale[1], scale[2]};
  const bool is_one = (scale.array() - 1).abs().maxCoeff() < 1e-6;
  if (is_one) node.scale.clear();
}

// ---- Skeleton -----------------------------------------------------------------------------------

/// The source's bones in the target's body, below copies of the nodes above them.
class Skeleton {
 public:
  /// Makes nodes in a model, unless no skin was carried.
  Skeleton(const Character& source, const Carried& carried, tinygltf::Model& model)
      : source_(source),
        carried_(carried),
        model_(model),
        parents_(gltf_io::parents_of(source.file.model)),
        node_of_(source.file.model.nodes.size(), -1) {
    if (is_empty()) return;
    for (int bone = 0, joints = 0; bone < size_of(source.bones); ++bone) {
      copy_nodes(at(source.bone_nodes, bone));
      joint_of_.push_back(at(source.is_joint, bone) ? joints++ : -1);
    }
    for (int bone = 0; bone < size_of(source.bones); ++bone)
      set_transform(at(model.nodes, at(node_of_, at(source.bone_nodes, bone))),
                    local_frame(bone, carried.frames));
  }

  bool is_empty() const { return carried_.weights.rows() == 0; }
  /// The copy of a node of the source, or -1.
  int node_of(int node) const { return at(node_of_, node); }
  /// The number of a bone in the skins.
  int joint_of(int bone) const { return at(joint_of_, bone); }

  /// The skin of meshes that are placed alike: its joints leave them where they are.
  int skin_of(const Eigen::Matrix4d& placed) {
    for (const auto& [known, skin] : skins_)
      if (known == placed) return skin;
    const std::vector<int> parents = gltf_io::parents_of(model_);
    tinygltf::Skin skin;
    skin.name = "skin of " + std::to_string(skins_.size());
    ism::Values matrices(std::count(source_.is_joint.begin(), source_.is_joint.end(), true), 16);
    for (int bone = 0; bone < size_of(source_.bones); ++bone) {
      if (joint_of(bone) < 0) continue;
      const int node = node_of(at(source_.bone_nodes, bone));
      Eigen::Matrix4d inverse = gltf_io::global_transform(model_, parents, node).inverse() * placed;
      inverse.row(3) << 0, 0, 0, 1;
      matrices.row(joint_of(bone)) = Eigen::Map<const Eigen::RowVectorXd>(inverse.data(), 16);
      skin.joints.push_back(node);
    }
    skin.inverseBindMatrices = gltf_io::add_numbers<float>(model_, matrices, 0);
    model_.skins.push_back(skin);
    skins_.push_back({placed, size_of(model_.skins) - 1});
    return skins_.back().second;
  }

  /// Translations of a node of the source become those of its copy: what a bone moves from its bind
  /// pose, in the target's size. Values of cubic splines have a tangent before and behind them.
  void move(int node, bool is_cubic, ism::Values& translations) const {
    const auto found = std::find(source_.bone_nodes.begin(), source_.bone_nodes.end(), node);
    if (found == source_.bone_nodes.end()) return;
    std::vector<Eigen::Matrix4d> binds;
    for (const retarget::Bone& bone : source_.bones) binds.push_back(bone.bind);
    const int bone = static_cast<int>(found - source_.bone_nodes.begin());
    const Eigen::Vector3d from = local_frame(bone, binds).topRightCorner<3, 1>();
    const std::vector<double>& to = at(model_.nodes, node_of(node)).translation;
    for (Eigen::Index i = 0; i < translations.rows(); ++i) {
      const bool is_value = !is_cubic || i % 3 == 1;
      if (is_value) translations.row(i) -= from.transpose();
      translations.row(i) *= carried_.scale;
      if (is_value) translations.row(i) += Eigen::RowVector3d(to[0], to[1], to[2]);
    }
  }

 private:
  /// Copies a node, and what of the nodes above it has no copy yet.
  void copy_nodes(int node) {
    std::vector<int> chain;
    for (; node >= 0 && node_of(node) < 0; node = at(parents_, node)) chain.push_back(node);
    for (auto next = chain.rbegin(); next != chain.rend(); ++next) {
      tinygltf::Node copy = at(source_.file.model.nodes, *next);
      copy.mesh = copy.skin = copy.camera = -1;
      copy.children.clear();
      copy.weights.clear();
      copy.extensions.clear();
      const int parent = at(parents_, *next);
      if (parent < 0) {
        at(node_of_, *next) = add_root(model_, copy);
        continue;
      }
      at(node_of_, *next) = size_of(model_.nodes);
      at(model_.nodes, node_of(parent)).children.push_back(size_of(model_.nodes));
      model_.nodes.push_back(copy);
    }
  }

  /// From a bone to its parent, or to the node above it.
  Eigen::Matrix4d local_frame(int bone, const std::vector<Eigen::Matrix4d>& frames) const {
    const int parent = at(source_.bones, bone).parent;
    const Eigen::Matrix4d above =
        parent >= 0 ? at(frames, parent)
                    : gltf_io::global_transform(source_.file.model, parents_,
                                                at(parents_, at(source_.bone_nodes, bone)));
    return above.inverse() * at(frames, bone);
  }

  const Character& source_;
  const Carried& carried_;
  tinygltf::Model& model_;
  std::vector<int> parents_;   // of the source's nodes
  std::vector<int> node_of_;   // per node of the source, its copy, or -1
  std::vector<int> joint_of_;  // per bone, its number in the skins, or -1
  std::vector<std::pair<Eigen::Matrix4d, int>> skins_;
};

/// The strongest weights of a vertex as pairs of bone and weight; they sum to 1 as floats.
inline std::vector<std::pair<int, double>> strongest(const ism::Values& weights, int vertex,
                                                     int most) {
  constexpr double kLeast = 1e-3;  // less cannot be seen
  std::vector<std::pair<int, double>> list;
  for (int bone = 0; bone < weights.cols(); ++bone)
    if (weights(vertex, bone) > kLeast) list.push_back({bone, weights(vertex, bone)});
  std::stable_sort(list.begin(), list.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  list.resize((std::min)(list.size(), static_cast<std::size_t>(most)));
  double sum = 0, rest = 1;
  for (const auto& influence : list) sum += influence.second;
  for (std::size_t k = 1; k < list.size(); ++k) {
    list[k].second = static_cast<double>(static_cast<float>(list[k].second / sum));
    rest -= list[k].second;
  }
  if (!list.empty()) list[0].second = rest;
  return list;
}

// ---- Materials ----------------------------------------------------------------------------------

inline bool shows_texture(const tinygltf::Model& model, int material) {
  if (material < 0) return false;
  tinygltf::Material m = at(model.materials, material);
  const auto ids = gltf_io::detail::texture_ids(m);
  return std::any_of(ids.begin(), ids.end(), [](const int* id) { return *id >= 0; });
}

/// Brings materials of the source to the target's model.
class Materials {
 public:
  Materials(const tinygltf::Model& source, tinygltf::Model& model)
      : source_(source), model_(model) {}

  /// A material of the target with the surface that one of the source has, where that has a
  /// texture; it shows texture coordinates number `set`.
  int textured(int own, int material, int set) {
    const tinygltf::Material& from = at(source_.materials, material);
    if (from.pbrMetallicRoughness.baseColorTexture.index < 0) return own;
    const auto [entry, is_new] =
        materials_.insert({{own, material, set}, size_of(model_.materials)});
    if (!is_new) return entry->second;
    tinygltf::Material to;
    if (own >= 0) to = at(model_.materials, own);
    to.name += (to.name.empty() ? "" : ", ") + from.name;
    to.pbrMetallicRoughness = from.pbrMetallicRoughness;
    to.normalTexture = from.normalTexture;
    to.occlusionTexture = from.occlusionTexture;
    to.emissiveTexture = from.emissiveTexture;
    to.emissiveFactor = from.emissiveFactor;
    to.alphaMode = from.alphaMode;
    to.alphaCutoff = from.alphaCutoff;
    bring(to.pbrMetallicRoughness.baseColorTexture, set);
    bring(to.pbrMetallicRoughness.metallicRoughnessTexture, set);
    bring(to.normalTexture, set);
    bring(to.occlusionTexture, set);
    bring(to.emissiveTexture, set);
    model_.materials.push_back(to);
    return entry->second;
  }

 private:
  /// Of extensions, only transforms of the coordinates are known not to refer to anything.
  template <class Info>
  void bring(Info& info, int set) {
    const std::string transform = "KHR_texture_transform";
    const auto found = info.extensions.find(transform);
    tinygltf::ExtensionMap kept;
    if (info.index >= 0 && found != info.extensions.end() && found->second.IsObject()) {
      auto values = found->second.template Get<tinygltf::Value::Object>();
      values.erase("texCoord");
      kept[transform] = tinygltf::Value(values);
      auto& used = model_.extensionsUsed;
      if (std::count(used.begin(), used.end(), transform) == 0) used.push_back(transform);
    }
    info.extensions = kept;
    info.index = copied_texture(info.index);
    info.texCoord = info.index >= 0 ? set : 0;
  }

  /// A texture of the source; -1 if it has no image of a kind that every viewer knows.
  int copied_texture(int texture) {
    if (texture < 0) return -1;
    const tinygltf::Texture& from = at(source_.textures, texture);
    if (from.source < 0 || at(source_.images, from.source).image.empty()) return -1;
    const auto [entry, is_new] = textures_.insert({texture, size_of(model_.textures)});
    if (!is_new) return entry->second;
    tinygltf::Texture to;
    to.name = from.name;
    to.source = size_of(model_.images);
    model_.images.push_back(at(source_.images, from.source));
    model_.images.back().bufferView = -1;
    if (from.sampler >= 0) {
      to.sampler = size_of(model_.samplers);
      model_.samplers.push_back(at(source_.samplers, from.sampler));
    }
    model_.textures.push_back(to);
    return entry->second;
  }

  const tinygltf::Model& source_;
  tinygltf::Model& model_;
  std::map<int, int> textures_;
  std::map<std::array<int, 3>, int> materials_;
};

// ---- Meshes -------------------------------------------------------------------------------------

inline int count_targets(const tinygltf::Mesh& mesh) {
  int most = 0;
  for (const tinygltf::Primitive& p : mesh.primitives) most = (std::max)(most, size_of(p.targets));
  return most;
}

/// Corners of a part as vertices: its own ones, and copies behind them.
struct Split {
  std::vector<int> copy_of;              // per copy, the vertex of the part
  std::vector<int> vertex;               // per corner
  std::vector<std::array<float, 2>> uv;  // per vertex and copy, v downwards
};

/// uv: of the corners of the whole surface, v upwards, NaN where there are none.
inline Split split_at_seams(const ism::Triangles& triangles, const gltf_io::Part& part,
                            const ism::Points2& uv) {
  Split s;
  s.uv.assign(static_cast<std::size_t>(part.vertices), {0, 0});
  std::vector<char> is_set(s.uv.size(), 0);
  std::map<std::pair<int, std::array<float, 2>>, int> known;
  for (int c = 3 * part.first_triangle; c < 3 * (part.first_triangle + part.triangles); ++c) {
    const int v = triangles(c / 3, c % 3) - part.first_vertex;
    s.vertex.push_back(v);
    if (!uv.row(c).allFinite()) continue;
    const std::array<float, 2> here = {static_cast<float>(uv(c, 0)),
                                       static_cast<float>(1 - uv(c, 1))};
    const auto [entry, is_new] = known.insert({{v, here}, at(is_set, v) != 0 ? size_of(s.uv) : v});
    s.vertex.back() = entry->second;
    if (!is_new) continue;
    if (entry->second != v) {
      s.copy_of.push_back(v);
      s.uv.emplace_back();
    }
    at(s.uv, entry->second) = here;
    at(is_set, v) = 1;
  }
  return s;
}

class Writer {
 public:
  Writer(const Character& source, const Character& target, const Carried& carried)
      : source_(source),
        target_(target),
        carried_(carried),
        model_(target.file.model),
        skeleton_(source, carried, model_),
        materials_(source.file.model, model_) {
    normals_.push_back(normals_of(ism::Points3::Zero(target.surface.mesh.vertices.rows(), 3)));
    for (const Morph& morph : carried.morphs) normals_.push_back(normals_of(morph.moves));
  }

  Written write() {
    place_meshes();
    for (int i = 0; i < size_of(target_.surface.parts); ++i) write_part(i);
    if (!skeleton_.is_empty()) gltf_io::drop_unused_skins(model_);
    copy_animations();
    const std::string &own = target_.file.model.asset.copyright,
                      &other = source_.file.model.asset.copyright;
    const bool is_one = own.empty() || other.empty() || own == other;
    model_.asset.copyright = is_one ? (own.empty() ? other : own) : own + "; " + other;
    model_.asset.generator = "ism_transfer";
    written_.bytes = gltf_io::glb_text(model_);
    return written_;
  }

 private:
  // ---- Places

  /// Every node gets a mesh of its own: what is carried depends on where a mesh is.
  void place_meshes() {
    std::map<int, int> moved;  // per node of the target, the one that has its mesh now
    std::set<int> used;
    for (const gltf_io::Part& part : target_.surface.parts) {
      const auto [entry, is_new] = moved.insert({part.node, part.node});
      if (is_new) {
        const bool is_first = used.insert(part.mesh).second;
        place_mesh(part, is_first ? part.mesh : size_of(model_.meshes));
        if (!skeleton_.is_empty()) entry->second = move_to_root(part.node);
      }
      nodes_.push_back(entry->second);
    }
  }

  void place_mesh(const gltf_io::Part& part, int mesh) {
    if (mesh == size_of(model_.meshes))
      model_.meshes.push_back(at(target_.file.model.meshes, part.mesh));
    at(model_.nodes, part.node).mesh = mesh;
    if (!carried_.morphs.empty()) name_morphs(mesh);
  }

  /// Own morph targets come first.
  void name_morphs(int id) {
    tinygltf::Mesh& mesh = at(model_.meshes, id);
    const int own = count_targets(mesh);
    tinygltf::Value::Array names;
    for (int i = 0; i < own; ++i) names.push_back(tinygltf::Value(target_name(mesh, i)));
    for (const Morph& morph : carried_.morphs) names.push_back(tinygltf::Value(morph.name));
    tinygltf::Value::Object extras;
    if (mesh.extras.IsObject()) extras = mesh.extras.Get<tinygltf::Value::Object>();
    extras["targetNames"] = tinygltf::Value(names);
    mesh.extras = tinygltf::Value(extras);
    mesh.weights.resize(names.size(), 0);
    for (tinygltf::Node& node : model_.nodes)
      if (node.mesh == id && !node.weights.empty()) node.weights.resize(names.size(), 0);
  }

  /// Joints alone place a mesh with a skin, so it is a root without a transform; some programs
  /// would apply both. Returns the node of the mesh.
  int move_to_root(int node) {
    const std::vector<int> parents = gltf_io::parents_of(model_);
    tinygltf::Node& old = at(model_.nodes, node);
    if (at(parents, node) < 0 && gltf_io::local_transform(old) == Eigen::Matrix4d::Identity())
      return node;
    tinygltf::Node moved;
    moved.name = old.name;
    std::swap(moved.mesh, old.mesh);
    std::swap(moved.skin, old.skin);
    std::swap(moved.weights, old.weights);
    if (!old.name.empty()) old.name += " (place)";
    const int id = add_root(model_, moved);
    for (tinygltf::Animation& a : model_.animations)
      for (tinygltf::AnimationChannel& c : a.channels)
        if (c.target_node == node && c.target_path == "weights") c.target_node = id;
    return id;
  }

  // ---- Parts

  void write_part(int id) {
    const gltf_io::Part& part = at(target_.surface.parts, id);
    tinygltf::Node& node = at(model_.nodes, at(nodes_, id));
    tinygltf::Primitive p = at(at(model_.meshes, node.mesh).primitives, part.primitive);
    const bool is_mapped = at(carried_.is_mapped, id) != 0;
    if (!skeleton_.is_empty()) {
      node.skin = skeleton_.skin_of(part.placed);
      add_weights(p, part);
    }
    if (is_mapped && carried_.colors.rows() > 0)
      p.attributes["COLOR_0"] =
          add_vertices(model_, rows_of(carried_.colors, part).cwiseMax(0).cwiseMin(1));
    for (int i = 0; i < size_of(carried_.morphs); ++i) add_morph(p, part, i);
    tinygltf::Mesh& mesh = at(model_.meshes, node.mesh);
    if (is_mapped && carried_.uv.rows() > 0)
      write_textured(p, part, mesh);
    else
      at(mesh.primitives, part.primitive) = p;
  }

  /// The rows of a part among those of all vertices.
  static ism::Values rows_of(const ism::Values& all, const gltf_io::Part& part) {
    return all.middleRows(part.first_vertex, part.vertices);
  }

  void add_weights(tinygltf::Primitive& p, const gltf_io::Part& part) {
    const auto name = [](const char* what, int set) { return what + std::to_string(set); };
    for (int set = 0; p.attributes.erase(name("JOINTS_", set)) > 0; ++set)
      p.attributes.erase(name("WEIGHTS_", set));
    ism::Values joints = ism::Values::Zero(part.vertices, carried_.influences), values = joints;
    for (int v = 0; v < part.vertices; ++v) {
      const auto list = strongest(carried_.weights, part.first_vertex + v, carried_.influences);
      if (list.empty()) values(v, 0) = 1;  // the first joint carries what follows none
      for (int k = 0; k < size_of(list); ++k) {
        joints(v, k) = skeleton_.joint_of(at(list, k).first);
        values(v, k) = at(list, k).second;
      }
    }
    const bool is_small = joints.size() == 0 || joints.maxCoeff() < 256;
    const auto add_joints =
        is_small ? &gltf_io::add_numbers<std::uint8_t> : &gltf_io::add_numbers<std::uint16_t>;
    for (int set = 0; set < carried_.influences / 4; ++set) {
      p.attributes[name("JOINTS_", set)] =
          add_joints(model_, joints.middleCols(4 * set, 4), TINYGLTF_TARGET_ARRAY_BUFFER);
      p.attributes[name("WEIGHTS_", set)] = add_vertices(model_, values.middleCols(4 * set, 4));
    }
  }

  /// Normals of the vertices of the target with all vertices moved.
  ism::Points3 normals_of(const ism::Points3& moves) const {
    const ism::TriangleMesh mesh = gltf_io::joined(target_.surface);
    const ism::Points3 normals = render::smooth_normals(mesh.vertices + moves, mesh.triangles);
    ism::Points3 all = normals;
    for (Eigen::Index v = 0; v < all.rows(); ++v)
      all.row(v) = normals.row(target_.surface.same[static_cast<std::size_t>(v)]);
    return all;
  }

  /// Displacements go back to the buffer of the part; where that is flattened, none has a depth.
  void add_morph(tinygltf::Primitive& p, const gltf_io::Part& part, int id) {
    const Eigen::Matrix3d linear = part.placed.topLeftCorner<3, 3>();
    const Eigen::Matrix3d back = linear.completeOrthogonalDecomposition().pseudoInverse();
    std::map<std::string, int> target;
    target["POSITION"] =
        add_vertices(model_, rows_of(at(carried_.morphs, id).moves, part) * back.transpose());
    const int normal = gltf_io::attribute(p.attributes, "NORMAL");
    if (normal >= 0) {
      const ism::Values before = rows_of(normals_[0], part) * linear;
      const ism::Values after = rows_of(at(normals_, id + 1), part) * linear;
      ism::Values turned = gltf_io::numbers(model_, normal);
      for (Eigen::Index v = 0; v < turned.rows(); ++v) {
        const Eigen::Vector3d n = turned.row(v), from = before.row(v), to = after.row(v);
        turned.row(v).setZero();
        if (from.norm() > 0 && to.norm() > 0)
          turned.row(v) = Eigen::Quaterniond::FromTwoVectors(from, to) * n - n;
      }
      target["NORMAL"] = add_vertices(model_, turned);
    }
    p.targets.push_back(target);
  }

  // ---- Textures

  /// Replaces a primitive by one for each material of the source. One that shows a texture of its
  /// own keeps its material.
  void write_textured(tinygltf::Primitive p, const gltf_io::Part& part, tinygltf::Mesh& mesh) {
    const Split s = split_at_seams(target_.surface.mesh.triangles, part, carried_.uv);
    for (auto& entry : p.attributes) append_copies(s.copy_of, entry.second);
    for (auto& target : p.targets)
      for (auto& entry : target) append_copies(s.copy_of, entry.second);
    written_.copies += size_of(s.copy_of);
    const bool keeps = shows_texture(model_, p.material);
    if (keeps) written_.textured.push_back(mesh.name);
    const int set = add_uv(s, keeps, p);
    std::map<int, std::vector<int>> groups;  // triangles by the material of the source
    for (int f = 0; f < part.triangles; ++f)
      groups[keeps ? -1 : at(carried_.materials, part.first_triangle + f)].push_back(f);
    const bool is_mirrored = part.placed.topLeftCorner<3, 3>().determinant() < 0;
    std::vector<tinygltf::Primitive> list;
    for (const auto& [material, triangles] : groups) {
      list.push_back(p);
      if (groups.size() > 1 || !s.copy_of.empty())
        set_triangles(s, triangles, is_mirrored, list.back());
      if (material >= 0) list.back().material = materials_.textured(p.material, material, set);
    }
    if (list.empty()) list.push_back(p);  // points, or lines
    at(mesh.primitives, part.primitive) = list[0];
    mesh.primitives.insert(mesh.primitives.end(), list.begin() + 1, list.end());
  }

  void append_copies(const std::vector<int>& copy_of, int& accessor) {
    if (copy_of.empty()) return;
    tinygltf::Accessor longer = at(model_.accessors, accessor);
    std::vector<unsigned char> bytes = gltf_io::detail::packed(model_, longer);
    const std::size_t size = gltf_io::detail::element_size(longer);
    for (const int v : copy_of) {
      const std::size_t from = static_cast<std::size_t>(v) * size;
      for (std::size_t k = 0; k < size; ++k) bytes.push_back(bytes[from + k]);
    }
    longer.count += copy_of.size();
    accessor = gltf_io::add_accessor(model_, longer, bytes, TINYGLTF_TARGET_ARRAY_BUFFER);
  }

  /// Texture coordinates that no texture shows are replaced; else the carried ones come behind.
  /// Returns the number of their set.
  int add_uv(const Split& s, bool keeps, tinygltf::Primitive& p) {
    int set = 0;
    while (keeps && p.attributes.count("TEXCOORD_" + std::to_string(set)) > 0) ++set;
    ism::Values uv(size_of(s.uv), 2);
    for (Eigen::Index i = 0; i < uv.rows(); ++i)
      for (Eigen::Index k = 0; k < 2; ++k)
        uv(i, k) =
            static_cast<double>(s.uv[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)]);
    p.attributes["TEXCOORD_" + std::to_string(set)] = add_vertices(model_, uv);
    if (set == 0) p.attributes.erase("TANGENT");  // they lie along texture coordinates
    return set;
  }

  void set_triangles(const Split& s, const std::vector<int>& triangles, bool is_mirrored,
                     tinygltf::Primitive& p) {
    ism::Values ids(3 * size_of(triangles), 1);
    Eigen::Index row = 0;
    for (const int f : triangles)
      for (int k = 0; k < 3; ++k) ids(row++, 0) = at(s.vertex, 3 * f + (is_mirrored ? 2 - k : k));
    p.mode = TINYGLTF_MODE_TRIANGLES;
    p.indices =
        gltf_io::add_numbers<std::uint32_t>(model_, ids, TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
  }

  // ---- Animations

  void copy_animations() {
    for (const tinygltf::Animation& from : source_.file.model.animations) {
      tinygltf::Animation to;
      to.name = from.name;
      for (const tinygltf::AnimationChannel& channel : from.channels)
        if (channel.target_node >= 0) copy_channel(channel, at(from.samplers, channel.sampler), to);
      if (!to.channels.empty()) model_.animations.push_back(to);
    }
  }

  void copy_channel(const tinygltf::AnimationChannel& channel,
                    const tinygltf::AnimationSampler& sampler, tinygltf::Animation& to) {
    const tinygltf::Model& m = source_.file.model;
    if (channel.target_path == "weights")
      return copy_weights(sampler, at(m.nodes, channel.target_node).mesh, to);
    const int node = skeleton_.node_of(channel.target_node);
    ism::Values output = gltf_io::numbers(m, sampler.output);
    if (node < 0 || output.cols() != (channel.target_path == "rotation" ? 4 : 3)) return;
    if (channel.target_path == "translation")
      skeleton_.move(channel.target_node, sampler.interpolation == "CUBICSPLINE", output);
    add_channel(node, channel.target_path, sampler, output, to);
  }

  /// Weights of morph targets, for every mesh that has them now.
  void copy_weights(const tinygltf::AnimationSampler& sampler, int mesh, tinygltf::Animation& to) {
    if (carried_.morphs.empty() || mesh < 0 || at(source_.morph_of, mesh).empty()) return;
    const bool is_told = std::any_of(to.channels.begin(), to.channels.end(), [](const auto& c) {
      return c.target_path == "weights";  // of another mesh: a node has one channel of a kind
    });
    if (is_told) return;
    const std::vector<int>& morph_of = at(source_.morph_of, mesh);
    const ism::Values given = gltf_io::numbers(source_.file.model, sampler.output);
    const Eigen::Index n = size_of(morph_of), keys = given.size() / n;
    for (const int node : std::set<int>(nodes_.begin(), nodes_.end())) {
      const int all = count_targets(at(model_.meshes, at(model_.nodes, node).mesh));
      const int own = all - size_of(carried_.morphs);
      ism::Values output = ism::Values::Zero(keys * all, 1);
      for (Eigen::Index k = 0; k < keys; ++k)
        for (int t = 0; t < n; ++t)
          output(k * all + own + at(morph_of, t), 0) = given.data()[k * n + t];
      add_channel(node, "weights", sampler, output, to);
    }
  }

  /// Values at the times of a sampler of the source.
  void add_channel(int node, const std::string& path, tinygltf::AnimationSampler sampler,
                   const ism::Values& output, tinygltf::Animation& to) {
    if (output.rows() == 0) return;
    const auto [times, is_new] = times_.insert({sampler.input, 0});
    if (is_new)
      times->second = gltf_io::add_numbers<float>(
          model_, gltf_io::numbers(source_.file.model, sampler.input), 0);
    sampler.input = times->second;
    sampler.output = gltf_io::add_numbers<float>(model_, output, 0);
    tinygltf::AnimationChannel channel;
    channel.target_node = node;
    channel.target_path = path;
    channel.sampler = size_of(to.samplers);
    to.samplers.push_back(sampler);
    to.channels.push_back(channel);
  }

  const Character& source_;
  const Character& target_;
  const Carried& carried_;
  tinygltf::Model model_;
  Skeleton skeleton_;
  Materials materials_;
  std::vector<ism::Points3> normals_;  // of the target, and with each morph
  std::vector<int> nodes_;             // per part, the node that it is written to
  std::map<int, int> times_;           // per accessor of the source, its copy
  Written written_;
};

}  // namespace detail

inline Written write(const Character& source, const Character& target, const Carried& carried) {
  return detail::Writer(source, target, carried).write();
}

}  // namespace character

#endif  // ISM_EXAMPLES_CHARACTER_OUT_HPP

// character_out.hpp: writes a glTF character with what a map carried to it from another one. Part
// of the examples of ism.hpp.
//
//   character::Writer writer(source, target, carried);
//   std::string bytes = writer.glb();
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

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
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

/// The strongest weights of a vertex; they sum to 1.
struct Influence {
  int bone;
  double weight;
};
inline std::vector<Influence> strongest(const ism::Values& weights, int vertex, int most);

class Writer {
 public:
  Writer(const Character& source, const Character& target, const Carried& carried)
      : source_(source), target_(target), carried_(carried), model_(target.file.model) {}

  /// The bytes of a .glb file; none if the format cannot hold them.
  std::string glb();
  int copies() const { return copies_; }  // of vertices, along seams
  /// Names of parts that show textures of their own, and have the carried ones as a further set.
  const std::vector<std::string>& textured() const { return textured_; }

 private:
  struct Split;  // of a part's vertices
  void place_meshes();
  int move_to_root(int node);
  void add_skeleton();
  int add_bone_node(int bone);
  void add_scene_root(int node);
  int skin_of(const Eigen::Matrix4d& placed);
  void write_part(const gltf_io::Part& part, int part_id);
  Split split(const gltf_io::Part& part, bool with_uv) const;
  void expand(tinygltf::Primitive& p, const Split& s);
  void add_weights(tinygltf::Primitive& p, const gltf_io::Part& part, const Split& s);
  void add_colors(tinygltf::Primitive& p, const gltf_io::Part& part, const Split& s);
  int add_uv(tinygltf::Primitive& p, const gltf_io::Part& part, const Split& s);
  void add_morphs(tinygltf::Primitive& p, const gltf_io::Part& part, const Split& s);
  void name_morphs(int mesh, const tinygltf::Mesh& own);
  ism::Values rows_of(const ism::Values& all, const gltf_io::Part& part, const Split& s) const;
  bool shows_texture(int material) const;
  int textured_material(int own, int material, int set);
  template <class Info>
  Info texture_info(const Info& info, int set);
  int copied_texture(int texture);
  void copy_animations();
  void copy_channel(const tinygltf::Animation& from, const tinygltf::AnimationChannel& channel,
                    tinygltf::Animation& to);
  void copy_weights(const tinygltf::AnimationSampler& sampler, int mesh, tinygltf::Animation& to);
  void add_channel(tinygltf::Animation& to, int node, const std::string& path,
                   const std::string& interpolation, int input, const ism::Values& output);
  int own_morphs(int mesh) const;

  const Character& source_;
  const Character& target_;
  const Carried& carried_;
  tinygltf::Model model_;
  std::vector<int> node_of_;                // per node of the source, its copy, or -1
  std::vector<int> joint_of_;               // per bone, its number in the skins, or -1
  std::vector<int> mesh_nodes_, mesh_ids_;  // per part, the node and the mesh it is written to
  std::vector<std::pair<Eigen::Matrix4d, int>> skins_;
  std::map<int, int> textures_, inputs_;
  std::map<std::array<int, 3>, int> materials_;
  std::vector<std::string> textured_;
  int copies_ = 0;
};

// ==== Details ====================================================================================

inline std::vector<Influence> strongest(const ism::Values& weights, int vertex, int most) {
  constexpr double kLeast = 1e-3;  // less cannot be seen
  std::vector<Influence> list;
  for (int bone = 0; bone < weights.cols(); ++bone)
    if (weights(vertex, bone) > kLeast) list.push_back({bone, weights(vertex, bone)});
  std::stable_sort(list.begin(), list.end(),
                   [](const Influence& a, const Influence& b) { return a.weight > b.weight; });
  if (gltf_io::size_of(list) > most) list.resize(static_cast<std::size_t>(most));
  double sum = 0, others = 0;
  for (const Influence& i : list) sum += i.weight;
  for (Influence& i : list) i.weight = static_cast<double>(static_cast<float>(i.weight / sum));
  for (std::size_t k = 1; k < list.size(); ++k) others += list[k].weight;
  if (!list.empty()) list[0].weight = 1 - others;  // as floats, they sum to 1
  return list;
}

/// Corners of a part as vertices: its own ones, and copies behind them.
struct Writer::Split {
  std::vector<int> copy_of;              // per copy, the vertex of the part
  std::vector<int> vertex;               // per corner
  std::vector<std::array<float, 2>> uv;  // per vertex and copy, v downwards; or none
};

inline std::string Writer::glb() {
  place_meshes();
  if (carried_.weights.rows() > 0) add_skeleton();
  for (int i = 0; i < gltf_io::size_of(target_.surface.parts); ++i)
    write_part(gltf_io::at(target_.surface.parts, i), i);
  if (carried_.weights.rows() > 0) gltf_io::drop_unused_skins(model_);
  copy_animations();
  const std::string &own = target_.file.model.asset.copyright,
                    &other = source_.file.model.asset.copyright;
  const bool is_one = own.empty() || other.empty() || own == other;
  model_.asset.copyright = is_one ? (own.empty() ? other : own) : own + "; " + other;
  model_.asset.generator = "ism_transfer";
  return gltf_io::glb_text(model_);
}

/// Every node gets a mesh of its own: what is carried depends on where a mesh is.
inline void Writer::place_meshes() {
  using gltf_io::at;
  std::map<int, int> mesh_of_node, node_of_node;
  std::vector<char> is_used(model_.meshes.size(), 0);
  for (const gltf_io::Part& part : target_.surface.parts) {
    if (mesh_of_node.count(part.node) == 0) {
      const bool is_first = at(is_used, part.mesh) == 0;
      at(is_used, part.mesh) = 1;
      mesh_of_node[part.node] = is_first ? part.mesh : gltf_io::size_of(model_.meshes);
      if (!is_first) model_.meshes.push_back(at(target_.file.model.meshes, part.mesh));
      at(model_.nodes, part.node).mesh = mesh_of_node[part.node];
      node_of_node[part.node] = carried_.weights.rows() > 0 ? move_to_root(part.node) : part.node;
      name_morphs(mesh_of_node[part.node], at(target_.file.model.meshes, part.mesh));
    }
    mesh_nodes_.push_back(node_of_node[part.node]);
    mesh_ids_.push_back(mesh_of_node[part.node]);
  }
}

/// Joints alone place a mesh with a skin, so it is a root without a transform; some programs would
/// apply both. Returns the node of the mesh.
inline int Writer::move_to_root(int node) {
  using gltf_io::at;
  const std::vector<int> parents = gltf_io::parents_of(model_);
  const Eigen::Matrix4d local = gltf_io::local_transform(at(model_.nodes, node));
  if (at(parents, node) < 0 && local == Eigen::Matrix4d::Identity()) return node;
  const int id = gltf_io::size_of(model_.nodes);
  tinygltf::Node moved;
  tinygltf::Node& old = at(model_.nodes, node);
  moved.name = old.name;
  std::swap(moved.mesh, old.mesh);
  std::swap(moved.skin, old.skin);
  std::swap(moved.weights, old.weights);
  if (!old.name.empty()) old.name += " (place)";
  model_.nodes.push_back(moved);
  add_scene_root(id);
  for (tinygltf::Animation& a : model_.animations)
    for (tinygltf::AnimationChannel& c : a.channels)
      if (c.target_node == node && c.target_path == "weights") c.target_node = id;
  return id;
}

inline void Writer::add_scene_root(int node) {
  if (model_.scenes.empty()) {  // all roots are shown
    model_.scenes.emplace_back();
    model_.defaultScene = 0;
    const std::vector<int> parents = gltf_io::parents_of(model_);
    for (int i = 0; i < node; ++i)
      if (gltf_io::at(parents, i) < 0) model_.scenes[0].nodes.push_back(i);
  }
  gltf_io::at(model_.scenes, (std::max)(model_.defaultScene, 0)).nodes.push_back(node);
}

// ---- Skeleton
// ------------------------------------------------------------------------------------

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

/// The source's bones in the target's body, below copies of the nodes above them.
inline void Writer::add_skeleton() {
  using gltf_io::at;
  const tinygltf::Model& m = source_.file.model;
  const std::vector<int> parents = gltf_io::parents_of(m);
  node_of_.assign(m.nodes.size(), -1);
  std::vector<int> chain;  // nodes to copy, parents first
  for (int bone = 0; bone < gltf_io::size_of(source_.bones); ++bone) {
    std::vector<int> above;
    for (int node = at(source_.bone_nodes, bone); node >= 0 && at(node_of_, node) < 0;
         node = at(parents, node)) {
      at(node_of_, node) = 0;
      above.push_back(node);
    }
    chain.insert(chain.end(), above.rbegin(), above.rend());
  }
  for (const int node : chain) {
    tinygltf::Node copy = at(m.nodes, node);
    copy.mesh = copy.skin = copy.camera = -1;
    copy.children.clear();
    copy.weights.clear();
    copy.extensions.clear();
    const int id = gltf_io::size_of(model_.nodes);
    at(node_of_, node) = id;
    model_.nodes.push_back(copy);
    const int parent = at(parents, node);
    if (parent >= 0)
      at(model_.nodes, at(node_of_, parent)).children.push_back(id);
    else
      add_scene_root(id);
  }
  for (int bone = 0, joints = 0; bone < gltf_io::size_of(source_.bones); ++bone) {
    const int node = at(source_.bone_nodes, bone), parent = at(source_.bones, bone).parent;
    const Eigen::Matrix4d above = parent >= 0
                                      ? at(carried_.frames, parent)
                                      : gltf_io::global_transform(m, parents, at(parents, node));
    set_transform(at(model_.nodes, at(node_of_, node)),
                  above.inverse() * at(carried_.frames, bone));
    joint_of_.push_back(at(source_.is_joint, bone) ? joints++ : -1);
  }
}

/// The skin of meshes that are placed alike: its joints leave them where they are.
inline int Writer::skin_of(const Eigen::Matrix4d& placed) {
  using gltf_io::at;
  for (const auto& known : skins_)
    if (known.first == placed) return known.second;
  const std::vector<int> parents = gltf_io::parents_of(model_);
  tinygltf::Skin skin;
  skin.name = "skin of " + std::to_string(skins_.size());
  ism::Values matrices(
      std::count_if(joint_of_.begin(), joint_of_.end(), [](int j) { return j >= 0; }), 16);
  for (int bone = 0; bone < gltf_io::size_of(source_.bones); ++bone) {
    if (at(joint_of_, bone) < 0) continue;
    const int node = at(node_of_, at(source_.bone_nodes, bone));
    Eigen::Matrix4d inverse = gltf_io::global_transform(model_, parents, node).inverse() * placed;
    inverse.row(3) << 0, 0, 0, 1;
    matrices.row(at(joint_of_, bone)) = Eigen::Map<const Eigen::RowVectorXd>(inverse.data(), 16);
    skin.joints.push_back(node);
  }
  skin.inverseBindMatrices = gltf_io::add_numbers<float>(model_, matrices, TINYGLTF_TYPE_MAT4, 0);
  model_.skins.push_back(skin);
  skins_.push_back({placed, gltf_io::size_of(model_.skins) - 1});
  return skins_.back().second;
}

// ---- Meshes
// --------------------------------------------------------------------------------------

inline void Writer::write_part(const gltf_io::Part& part, int part_id) {
  using gltf_io::at;
  const int mesh = at(mesh_ids_, part_id);
  tinygltf::Primitive p = at(at(model_.meshes, mesh).primitives, part.primitive);
  const bool is_mapped = at(carried_.is_mapped, part_id) != 0;
  const bool with_uv = is_mapped && carried_.uv.rows() > 0;
  const Split s = split(part, with_uv);
  copies_ += gltf_io::size_of(s.copy_of);
  expand(p, s);
  if (carried_.weights.rows() > 0) {
    add_weights(p, part, s);
    at(model_.nodes, at(mesh_nodes_, part_id)).skin = skin_of(part.placed);
  }
  if (is_mapped && carried_.colors.rows() > 0) add_colors(p, part, s);
  add_morphs(p, part, s);
  const int set = with_uv ? add_uv(p, part, s) : 0;

  std::map<int, std::vector<int>> groups;  // triangles by the material of the source
  const bool keeps = !with_uv || shows_texture(p.material);
  if (with_uv && keeps) textured_.push_back(at(model_.meshes, mesh).name);
  for (int f = 0; f < part.triangles; ++f)
    groups[keeps ? -1 : at(carried_.materials, part.first_triangle + f)].push_back(f);
  const bool is_mirrored = part.placed.topLeftCorner<3, 3>().determinant() < 0;
  const bool keeps_indices = groups.size() < 2 && s.copy_of.empty();
  bool is_first = true;
  const int own = p.material;
  for (const auto& [material, triangles] : groups) {
    if (!keeps_indices) {
      ism::Values ids(3 * gltf_io::size_of(triangles), 1);
      Eigen::Index row = 0;
      for (const int f : triangles)
        for (int k = 0; k < 3; ++k) ids(row++, 0) = at(s.vertex, 3 * f + (is_mirrored ? 2 - k : k));
      p.mode = TINYGLTF_MODE_TRIANGLES;
      p.indices = gltf_io::add_numbers<std::uint32_t>(model_, ids, TINYGLTF_TYPE_SCALAR,
                                                      TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
    }
    p.material = material >= 0 ? textured_material(own, material, set) : own;
    auto& primitives = at(model_.meshes, mesh).primitives;
    if (is_first)
      at(primitives, part.primitive) = p;
    else
      primitives.push_back(p);
    is_first = false;
  }
  if (groups.empty()) at(at(model_.meshes, mesh).primitives, part.primitive) = p;
}

inline Writer::Split Writer::split(const gltf_io::Part& part, bool with_uv) const {
  using gltf_io::at;
  Split s;
  std::vector<char> is_set(static_cast<std::size_t>(part.vertices), 0);
  if (with_uv) s.uv.assign(static_cast<std::size_t>(part.vertices), {0, 0});
  std::map<std::pair<int, std::array<float, 2>>, int> known;
  for (int c = 3 * part.first_triangle; c < 3 * (part.first_triangle + part.triangles); ++c) {
    const int v = target_.surface.mesh.triangles(c / 3, c % 3) - part.first_vertex;
    s.vertex.push_back(v);
    if (!with_uv || !carried_.uv.row(c).allFinite()) continue;
    const std::array<float, 2> uv = {static_cast<float>(carried_.uv(c, 0)),
                                     static_cast<float>(1 - carried_.uv(c, 1))};
    const int next = part.vertices + gltf_io::size_of(s.copy_of);
    const auto [entry, is_new] = known.insert({{v, uv}, at(is_set, v) != 0 ? next : v});
    s.vertex.back() = entry->second;
    if (!is_new) continue;
    if (at(is_set, v) == 0) {
      at(s.uv, v) = uv;
      at(is_set, v) = 1;
    } else {
      s.copy_of.push_back(v);
      s.uv.push_back(uv);
    }
  }
  return s;
}

/// Appends the copies to all attributes.
inline void Writer::expand(tinygltf::Primitive& p, const Split& s) {
  using gltf_io::at;
  if (s.copy_of.empty()) return;
  const auto expand_one = [&](int& id) {
    const tinygltf::Accessor a = at(model_.accessors, id);
    std::vector<unsigned char> bytes = gltf_io::detail::packed(model_, a);
    const std::size_t size = gltf_io::detail::element_size(a);
    for (const int v : s.copy_of) {
      const std::size_t from = static_cast<std::size_t>(v) * size;
      for (std::size_t k = 0; k < size; ++k) bytes.push_back(bytes[from + k]);
    }
    tinygltf::Accessor longer = a;
    longer.count += s.copy_of.size();
    id = gltf_io::add_accessor(model_, longer, bytes, TINYGLTF_TARGET_ARRAY_BUFFER);
  };
  for (auto& entry : p.attributes) expand_one(entry.second);
  for (auto& target : p.targets)
    for (auto& entry : target) expand_one(entry.second);
}

inline ism::Values Writer::rows_of(const ism::Values& all, const gltf_io::Part& part,
                                   const Split& s) const {
  ism::Values rows(part.vertices + gltf_io::size_of(s.copy_of), all.cols());
  rows.topRows(part.vertices) = all.middleRows(part.first_vertex, part.vertices);
  for (int i = 0; i < gltf_io::size_of(s.copy_of); ++i)
    rows.row(part.vertices + i) = all.row(part.first_vertex + gltf_io::at(s.copy_of, i));
  return rows;
}

inline void Writer::add_weights(tinygltf::Primitive& p, const gltf_io::Part& part, const Split& s) {
  using gltf_io::at;
  for (int set = 0; p.attributes.erase("JOINTS_" + std::to_string(set)) +
                        p.attributes.erase("WEIGHTS_" + std::to_string(set)) >
                    0;
       ++set) {
  }
  const ism::Values weights = rows_of(carried_.weights, part, s);
  ism::Values joints = ism::Values::Zero(weights.rows(), carried_.influences);
  ism::Values values = joints;
  for (int v = 0; v < weights.rows(); ++v) {
    const std::vector<Influence> list = strongest(weights, v, carried_.influences);
    if (list.empty()) values(v, 0) = 1;  // the first joint carries what follows none
    for (int k = 0; k < gltf_io::size_of(list); ++k) {
      joints(v, k) = at(joint_of_, at(list, k).bone);
      values(v, k) = at(list, k).weight;
    }
  }
  const bool is_small = joints.size() == 0 || joints.maxCoeff() < 256;
  for (int set = 0; set < carried_.influences / 4; ++set) {
    const ism::Values ids = joints.middleCols(4 * set, 4);
    p.attributes["JOINTS_" + std::to_string(set)] =
        is_small ? gltf_io::add_numbers<std::uint8_t>(model_, ids, TINYGLTF_TYPE_VEC4,
                                                      TINYGLTF_TARGET_ARRAY_BUFFER)
                 : gltf_io::add_numbers<std::uint16_t>(model_, ids, TINYGLTF_TYPE_VEC4,
                                                       TINYGLTF_TARGET_ARRAY_BUFFER);
    p.attributes["WEIGHTS_" + std::to_string(set)] = gltf_io::add_numbers<float>(
        model_, values.middleCols(4 * set, 4), TINYGLTF_TYPE_VEC4, TINYGLTF_TARGET_ARRAY_BUFFER);
  }
}

inline void Writer::add_colors(tinygltf::Primitive& p, const gltf_io::Part& part, const Split& s) {
  const ism::Values colors = rows_of(carried_.colors, part, s).cwiseMax(0).cwiseMin(1);
  p.attributes["COLOR_0"] =
      gltf_io::add_numbers<float>(model_, colors, TINYGLTF_TYPE_VEC4, TINYGLTF_TARGET_ARRAY_BUFFER);
}

/// Texture coordinates that no texture shows are replaced; else the carried ones come behind.
inline int Writer::add_uv(tinygltf::Primitive& p, const gltf_io::Part& part, const Split& s) {
  int set = 0;
  while (shows_texture(p.material) && p.attributes.count("TEXCOORD_" + std::to_string(set)) > 0)
    ++set;
  ism::Values uv(part.vertices + gltf_io::size_of(s.copy_of), 2);
  for (int i = 0; i < gltf_io::size_of(s.uv); ++i)
    uv.row(i) << static_cast<double>(gltf_io::at(s.uv, i)[0]),
        static_cast<double>(gltf_io::at(s.uv, i)[1]);
  p.attributes["TEXCOORD_" + std::to_string(set)] =
      gltf_io::add_numbers<float>(model_, uv, TINYGLTF_TYPE_VEC2, TINYGLTF_TARGET_ARRAY_BUFFER);
  if (set == 0) p.attributes.erase("TANGENT");  // they lie along texture coordinates
  return set;
}

/// Normals of the vertices of the target, those at one place alike, with all vertices moved.
inline ism::Points3 moved_normals(const ism::TriangleMesh& mesh, const ism::Points3& moves) {
  std::map<std::array<double, 3>, int> known;
  ism::Triangles welded = mesh.triangles;
  for (Eigen::Index i = 0; i < welded.size(); ++i) {
    int& v = welded.data()[i];
    const auto p = mesh.vertices.row(v);
    v = known.insert({{p[0], p[1], p[2]}, v}).first->second;
  }
  ism::Points3 normals = render::smooth_normals(mesh.vertices + moves, welded);
  for (Eigen::Index v = 0; v < normals.rows(); ++v) {
    const auto p = mesh.vertices.row(v);
    const auto first = known.find({p[0], p[1], p[2]});
    if (first != known.end()) normals.row(v) = normals.row(first->second).eval();
  }
  return normals;
}

/// Own targets come first. Where the node flattens a part, displacements have no depth.
inline void Writer::add_morphs(tinygltf::Primitive& p, const gltf_io::Part& part, const Split& s) {
  const Eigen::Matrix3d linear = part.placed.topLeftCorner<3, 3>();
  const Eigen::Matrix3d back = linear.completeOrthogonalDecomposition().pseudoInverse();
  const ism::TriangleMesh& mesh = target_.surface.mesh;
  const int normal = gltf_io::attribute(p.attributes, "NORMAL");
  for (const Morph& morph : carried_.morphs) {
    const ism::Values moves = rows_of(morph.moves * back.transpose(), part, s);
    std::map<std::string, int> target;
    target["POSITION"] = gltf_io::add_numbers<float>(model_, moves, TINYGLTF_TYPE_VEC3,
                                                     TINYGLTF_TARGET_ARRAY_BUFFER);
    if (normal >= 0) {
      const ism::Values own = gltf_io::numbers(model_, normal);
      const ism::Points3 none = ism::Points3::Zero(mesh.vertices.rows(), 3);
      const ism::Values before = rows_of(moved_normals(mesh, none) * linear, part, s);
      const ism::Values after = rows_of(moved_normals(mesh, morph.moves) * linear, part, s);
      ism::Values turned(own.rows(), 3);
      for (Eigen::Index v = 0; v < own.rows(); ++v) {
        const Eigen::Vector3d n = own.row(v), from = before.row(v), to = after.row(v);
        const bool is_known = from.norm() > 0 && to.norm() > 0;
        turned.row(v) = is_known
                            ? Eigen::Vector3d(Eigen::Quaterniond::FromTwoVectors(from, to) * n - n)
                            : Eigen::Vector3d(Eigen::Vector3d::Zero());
      }
      target["NORMAL"] = gltf_io::add_numbers<float>(model_, turned, TINYGLTF_TYPE_VEC3,
                                                     TINYGLTF_TARGET_ARRAY_BUFFER);
    }
    p.targets.push_back(target);
  }
}

inline int Writer::own_morphs(int mesh) const {
  const auto& primitives = gltf_io::at(model_.meshes, mesh).primitives;
  std::size_t most = 0;
  for (const tinygltf::Primitive& p : primitives) most = (std::max)(most, p.targets.size());
  return static_cast<int>(most);
}

inline void Writer::name_morphs(int mesh, const tinygltf::Mesh& own) {
  if (carried_.morphs.empty()) return;
  tinygltf::Mesh& to = gltf_io::at(model_.meshes, mesh);
  const int count = own_morphs(mesh);
  tinygltf::Value::Array names;
  for (int i = 0; i < count; ++i) names.push_back(tinygltf::Value(detail::target_name(own, i)));
  for (const Morph& morph : carried_.morphs) names.push_back(tinygltf::Value(morph.name));
  tinygltf::Value::Object extras;
  if (to.extras.IsObject()) extras = to.extras.Get<tinygltf::Value::Object>();
  extras["targetNames"] = tinygltf::Value(names);
  to.extras = tinygltf::Value(extras);
  const std::size_t all = static_cast<std::size_t>(count) + carried_.morphs.size();
  to.weights.resize(all, 0);
  for (tinygltf::Node& node : model_.nodes)
    if (node.mesh == mesh && !node.weights.empty()) node.weights.resize(all, 0);
}

// ---- Materials
// -----------------------------------------------------------------------------------

inline bool Writer::shows_texture(int material) const {
  if (material < 0) return false;
  const tinygltf::Material& m = gltf_io::at(model_.materials, material);
  return m.pbrMetallicRoughness.baseColorTexture.index >= 0 ||
         m.pbrMetallicRoughness.metallicRoughnessTexture.index >= 0 || m.normalTexture.index >= 0 ||
         m.occlusionTexture.index >= 0 || m.emissiveTexture.index >= 0;
}

/// A material of the target with the surface that one of the source has, where that has a texture.
inline int Writer::textured_material(int own, int material, int set) {
  const tinygltf::Material& from = gltf_io::at(source_.file.model.materials, material);
  if (from.pbrMetallicRoughness.baseColorTexture.index < 0) return own;
  const auto [entry, is_new] =
      materials_.insert({{own, material, set}, gltf_io::size_of(model_.materials)});
  if (!is_new) return entry->second;
  tinygltf::Material to;
  if (own >= 0) to = gltf_io::at(model_.materials, own);
  to.name += (to.name.empty() ? "" : ", ") + from.name;
  to.pbrMetallicRoughness = from.pbrMetallicRoughness;
  to.pbrMetallicRoughness.baseColorTexture =
      texture_info(from.pbrMetallicRoughness.baseColorTexture, set);
  to.pbrMetallicRoughness.metallicRoughnessTexture =
      texture_info(from.pbrMetallicRoughness.metallicRoughnessTexture, set);
  to.normalTexture = texture_info(from.normalTexture, set);
  to.occlusionTexture = texture_info(from.occlusionTexture, set);
  to.emissiveTexture = texture_info(from.emissiveTexture, set);
  to.emissiveFactor = from.emissiveFactor;
  to.alphaMode = from.alphaMode;
  to.alphaCutoff = from.alphaCutoff;
  model_.materials.push_back(to);
  return entry->second;
}

template <class Info>
Info Writer::texture_info(const Info& info, int set) {
  Info copy = info;
  copy.extensions.clear();
  const auto moved = info.extensions.find("KHR_texture_transform");
  if (info.index >= 0 && moved != info.extensions.end() && moved->second.IsObject()) {
    auto values = moved->second.template Get<tinygltf::Value::Object>();
    values.erase("texCoord");
    copy.extensions["KHR_texture_transform"] = tinygltf::Value(values);
    auto& used = model_.extensionsUsed;
    if (std::count(used.begin(), used.end(), "KHR_texture_transform") == 0)
      used.push_back("KHR_texture_transform");
  }
  copy.index = copied_texture(info.index);
  copy.texCoord = copy.index >= 0 ? set : 0;
  return copy;
}

/// A texture of the source; -1 if it has no image of a kind that every viewer knows.
inline int Writer::copied_texture(int texture) {
  using gltf_io::at;
  if (texture < 0) return -1;
  const tinygltf::Model& m = source_.file.model;
  const tinygltf::Texture& from = at(m.textures, texture);
  if (from.source < 0 || at(m.images, from.source).image.empty()) return -1;
  const auto [entry, is_new] = textures_.insert({texture, gltf_io::size_of(model_.textures)});
  if (!is_new) return entry->second;
  tinygltf::Texture to;
  to.name = from.name;
  to.source = gltf_io::size_of(model_.images);
  tinygltf::Image image = at(m.images, from.source);
  image.bufferView = -1;
  model_.images.push_back(image);
  if (from.sampler >= 0) {
    to.sampler = gltf_io::size_of(model_.samplers);
    model_.samplers.push_back(at(m.samplers, from.sampler));
  }
  model_.textures.push_back(to);
  return entry->second;
}

// ---- Animations
// ----------------------------------------------------------------------------------

inline void Writer::copy_animations() {
  for (const tinygltf::Animation& from : source_.file.model.animations) {
    tinygltf::Animation to;
    to.name = from.name;
    for (const tinygltf::AnimationChannel& channel : from.channels)
      if (channel.target_node >= 0) copy_channel(from, channel, to);
    if (!to.channels.empty()) model_.animations.push_back(to);
  }
}

inline void Writer::copy_channel(const tinygltf::Animation& from,
                                 const tinygltf::AnimationChannel& channel,
                                 tinygltf::Animation& to) {
  using gltf_io::at;
  const tinygltf::Model& m = source_.file.model;
  const tinygltf::AnimationSampler& sampler = at(from.samplers, channel.sampler);
  if (channel.target_path == "weights")
    return copy_weights(sampler, at(m.nodes, channel.target_node).mesh, to);
  const int node = node_of_.empty() ? -1 : at(node_of_, channel.target_node);
  if (node < 0) return;
  ism::Values output = gltf_io::numbers(m, sampler.output);
  if (output.cols() != (channel.target_path == "rotation" ? 4 : 3)) return;
  const auto bone =
      std::find(source_.bone_nodes.begin(), source_.bone_nodes.end(), channel.target_node);
  if (channel.target_path == "translation" && bone != source_.bone_nodes.end()) {
    // What the source's bone moves from its bind pose, in the target's size.
    const int id = static_cast<int>(bone - source_.bone_nodes.begin());
    const int parent = at(source_.bones, id).parent;
    const std::vector<int> parents = gltf_io::parents_of(m);
    const Eigen::Matrix4d above =
        parent >= 0 ? at(source_.bones, parent).bind
                    : gltf_io::global_transform(m, parents, at(parents, channel.target_node));
    const Eigen::RowVector3d rest =
        (above.inverse() * at(source_.bones, id).bind).topRightCorner<3, 1>().transpose();
    const std::vector<double>& t = at(model_.nodes, node).translation;
    const bool is_cubic = sampler.interpolation == "CUBICSPLINE";
    for (Eigen::Index i = 0; i < output.rows(); ++i) {
      const bool is_value = !is_cubic || i % 3 == 1;
      const Eigen::RowVector3d moved = output.row(i) - (is_value ? rest : rest * 0);
      output.row(i) = carried_.scale * moved;
      if (is_value) output.row(i) += Eigen::RowVector3d(t[0], t[1], t[2]);
    }
  }
  add_channel(to, node, channel.target_path, sampler.interpolation, sampler.input, output);
}

/// Weights of morph targets, for every mesh that has them now.
inline void Writer::copy_weights(const tinygltf::AnimationSampler& sampler, int mesh,
                                 tinygltf::Animation& to) {
  using gltf_io::at;
  if (carried_.morphs.empty() || mesh < 0 || at(source_.morph_of, mesh).empty()) return;
  const bool is_told = std::any_of(to.channels.begin(), to.channels.end(), [](const auto& c) {
    return c.target_path == "weights";  // of another mesh: a node has one channel of a kind
  });
  if (is_told) return;
  const std::vector<int>& morph_of = at(source_.morph_of, mesh);
  const ism::Values given = gltf_io::numbers(source_.file.model, sampler.output);
  const Eigen::Index n = gltf_io::size_of(morph_of), keys = given.size() / n;
  std::vector<int> nodes = mesh_nodes_;
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  for (const int node : nodes) {
    const int all = own_morphs(at(model_.nodes, node).mesh);
    const int own = all - gltf_io::size_of(carried_.morphs);
    ism::Values output = ism::Values::Zero(keys * all, 1);
    for (Eigen::Index k = 0; k < keys; ++k)
      for (int t = 0; t < n; ++t)
        output(k * all + own + at(morph_of, t), 0) = given.data()[k * n + t];
    add_channel(to, node, "weights", sampler.interpolation, sampler.input, output);
  }
}

inline void Writer::add_channel(tinygltf::Animation& to, int node, const std::string& path,
                                const std::string& interpolation, int input,
                                const ism::Values& output) {
  if (output.rows() == 0) return;
  static const int kTypes[] = {0, TINYGLTF_TYPE_SCALAR, 0, TINYGLTF_TYPE_VEC3, TINYGLTF_TYPE_VEC4};
  if (inputs_.count(input) == 0)
    inputs_[input] = gltf_io::add_numbers<float>(
        model_, gltf_io::numbers(source_.file.model, input), TINYGLTF_TYPE_SCALAR, 0);
  tinygltf::AnimationSampler sampler;
  sampler.interpolation = interpolation;
  sampler.input = inputs_[input];
  sampler.output = gltf_io::add_numbers<float>(model_, output, kTypes[output.cols()], 0);
  tinygltf::AnimationChannel channel;
  channel.target_node = node;
  channel.target_path = path;
  channel.sampler = gltf_io::size_of(to.samplers);
  to.samplers.push_back(sampler);
  to.channels.push_back(channel);
}

}  // namespace character

#endif  // ISM_EXAMPLES_CHARACTER_OUT_HPP

// gltf_io.hpp: reads glTF 2.0 files (.glb, .gltf) by tinygltf, as surfaces and as numbers, and
// writes .glb files. Part of the examples of ism.hpp.
//
//   gltf_io::File file = gltf_io::load("woman.glb");
//   if (!file.error.empty()) std::cerr << file.error << '\n';
//   gltf_io::Surface surface = gltf_io::surface_of(file);  // all triangles of the scene
//
// load() checks all references, so the rest needs no checks. Images stay as they are in the file.
// Source: The Khronos Group, glTF 2.0 Specification, 2021.

#ifndef ISM_EXAMPLES_GLTF_IO_HPP
#define ISM_EXAMPLES_GLTF_IO_HPP

#include "ism.hpp"
#include "mesh_io.hpp"

#include <tiny_gltf.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <filesystem>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace gltf_io {

struct File {
  std::string path, error;  // error: one sentence; empty: the file was read
  tinygltf::Model model;
};

/// Reads a file and checks all references in it. Compressed meshes cannot be read.
inline File load(const std::string& path);

/// Vertices of one primitive at one node of the scene.
struct Part {
  int node = -1, mesh = -1, primitive = -1;
  Eigen::Matrix4d placed = Eigen::Matrix4d::Identity();  // from the buffer to the scene
  int first_vertex = 0, vertices = 0, first_triangle = 0, triangles = 0;
};

/// All primitives of the scene as one mesh, one after the other, with their vertices as in the
/// buffers. Primitives that are not triangles have vertices only. A mesh with a skin is in its bind
/// pose, and where its first joint puts it.
struct Surface {
  std::string error;  // one sentence; empty: there are triangles, and all positions are finite
  std::vector<std::string> notes;
  ism::TriangleMesh mesh;
  std::vector<Part> parts;
  /// Per vertex, the first one of the same node at the same place that follows the same joints and
  /// moves alike in all morph targets: copies along seams of normals and texture coordinates. The
  /// two sides of a closed mouth that a joint or a morph target opens differ.
  std::vector<int> same;
};
inline Surface surface_of(const File& file);

/// The mesh with the first one in place of all copies of a vertex. Numbers of vertices stay.
inline ism::TriangleMesh joined(const Surface& surface);

/// The same as other files are read, with the texture coordinates TEXCOORD_0; copies along seams
/// are in no triangle.
inline mesh_io::ReadResult read_mesh(const std::string& path);

/// The numbers of an accessor, a row per element; integers that stand for [0, 1] become that.
inline ism::Values numbers(const tinygltf::Model& model, int accessor);

/// From a node to its parent, and to the scene. parents_of(): per node, -1 for roots.
inline Eigen::Matrix4d local_transform(const tinygltf::Node& node);
inline std::vector<int> parents_of(const tinygltf::Model& model);
inline Eigen::Matrix4d global_transform(const tinygltf::Model& model,
                                        const std::vector<int>& parents, int node);

/// Inverse bind matrices, one per joint, identities if the file has none.
inline std::vector<Eigen::Matrix4d> inverse_binds(const tinygltf::Model& model, int skin);

/// The bytes of a .glb file with all buffers and images in it; elements that nothing refers to are
/// left out. None if they are more than the 4 GB that the format can hold, or if a number that was
/// added is not finite as a float.
inline std::string glb_text(tinygltf::Model model);

/// Element i of a vector, where ids are ints.
template <class Items>
decltype(auto) at(Items& items, int i) {
  return items[static_cast<std::size_t>(i)];
}
template <class Items>
int size_of(const Items& items) {
  return static_cast<int>(items.size());
}

/// Leaves out skins that no node has, and animations of their joints.
inline void drop_unused_skins(tinygltf::Model& model);

/// The id of an attribute of a primitive, or -1.
inline int attribute(const std::map<std::string, int>& attributes, const std::string& name) {
  const auto found = attributes.find(name);
  return found == attributes.end() ? -1 : found->second;
}

namespace detail {

/// More than any file that fits in memory has; keeps products of sizes in range.
constexpr std::size_t kMost = std::size_t{1} << 30;

inline std::size_t element_size(const tinygltf::Accessor& a) {
  const int bytes = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(a.componentType));
  const int count = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(a.type));
  return bytes > 0 && count > 0 ? static_cast<std::size_t>(bytes * count) : 0;
}

inline bool fits(std::size_t offset, std::size_t stride, std::size_t count, std::size_t size,
                 std::size_t total) {
  if (offset > kMost || stride > kMost || count > kMost || total > 4 * kMost) return false;
  return count == 0 || offset + stride * (count - 1) + size <= total;
}

inline bool in(int id, std::size_t size) { return id >= 0 && static_cast<std::size_t>(id) < size; }
inline bool in_or_none(int id, std::size_t size) { return id == -1 || in(id, size); }

/// What is wrong with one element, as the end of a sentence.
inline std::string wrong(const char* what, std::size_t id, const char* message) {
  return std::string(": ") + what + " " + std::to_string(id) + " " + message;
}

inline bool is_unsigned(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

inline bool is_view_part(const tinygltf::Model& m, int view, std::size_t offset, std::size_t stride,
                         std::size_t count, std::size_t size) {
  return in(view, m.bufferViews.size()) &&
         fits(offset, stride, count, size, at(m.bufferViews, view).byteLength);
}

inline std::string check_accessor(const tinygltf::Model& m, std::size_t i) {
  const tinygltf::Accessor& a = m.accessors[i];
  const std::size_t size = element_size(a);
  if (size == 0) return wrong("accessor", i, "has no known type");
  if (a.count > kMost) return wrong("accessor", i, "has too many elements");
  if (a.bufferView != -1) {
    if (!in(a.bufferView, m.bufferViews.size()))
      return wrong("accessor", i, "refers to a buffer view that does not exist");
    const int stride = a.ByteStride(at(m.bufferViews, a.bufferView));
    if (stride <= 0 || !is_view_part(m, a.bufferView, a.byteOffset,
                                     static_cast<std::size_t>(stride), a.count, size))
      return wrong("accessor", i, "reaches beyond its buffer");
  }
  if (!a.sparse.isSparse) return {};
  if (!is_unsigned(a.sparse.indices.componentType))
    return wrong("accessor", i, "has sparse indices that are not whole numbers from 0");
  const std::size_t n = static_cast<std::size_t>((std::max)(a.sparse.count, 0));
  const int bytes =
      tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(a.sparse.indices.componentType));
  const std::size_t index_size = static_cast<std::size_t>((std::max)(bytes, 1));
  if (a.sparse.indices.byteOffset < 0 || a.sparse.values.byteOffset < 0 ||
      !is_view_part(m, a.sparse.indices.bufferView,
                    static_cast<std::size_t>(a.sparse.indices.byteOffset), index_size, n,
                    index_size) ||
      !is_view_part(m, a.sparse.values.bufferView,
                    static_cast<std::size_t>(a.sparse.values.byteOffset), size, n, size))
    return wrong("accessor", i, "has sparse values beyond their buffer");
  return {};
}

inline std::string check_buffers(const tinygltf::Model& m) {
  for (std::size_t i = 0; i < m.bufferViews.size(); ++i) {
    const tinygltf::BufferView& v = m.bufferViews[i];
    if (!in(v.buffer, m.buffers.size()) ||
        !fits(v.byteOffset, 1, 1, v.byteLength, at(m.buffers, v.buffer).data.size()))
      return wrong("buffer view", i, "reaches beyond its buffer");
  }
  for (std::size_t i = 0; i < m.accessors.size(); ++i) {
    const std::string error = check_accessor(m, i);
    if (!error.empty()) return error;
  }
  for (std::size_t i = 0; i < m.images.size(); ++i)
    if (!in_or_none(m.images[i].bufferView, m.bufferViews.size()))
      return wrong("image", i, "refers to a buffer view that does not exist");
  return {};
}

inline bool is_attribute_list(const tinygltf::Model& m, const std::map<std::string, int>& list,
                              int position) {
  return std::all_of(list.begin(), list.end(), [&](const auto& entry) {
    return in(entry.second, m.accessors.size()) &&
           (position == -1 ||
            at(m.accessors, entry.second).count == at(m.accessors, position).count);
  });
}

inline std::string check_primitive(const tinygltf::Model& m, const tinygltf::Primitive& p) {
  const int position = attribute(p.attributes, "POSITION");  // -1: nothing is drawn
  if (!in_or_none(position, m.accessors.size())) return "refers to an accessor that does not exist";
  if (position != -1 && at(m.accessors, position).type != TINYGLTF_TYPE_VEC3)
    return "has positions that are not three numbers each";
  const int normal = attribute(p.attributes, "NORMAL");
  bool fits = is_attribute_list(m, p.attributes, position);
  for (const auto& target : p.targets) fits = fits && is_attribute_list(m, target, position);
  if (!fits) return "has attributes that do not exist or differ in number";
  if (normal != -1 && at(m.accessors, normal).type != TINYGLTF_TYPE_VEC3)
    return "has normals that are not three numbers each";
  if (!in_or_none(p.indices, m.accessors.size())) return "refers to indices that do not exist";
  if (p.indices != -1 && (at(m.accessors, p.indices).type != TINYGLTF_TYPE_SCALAR ||
                          !is_unsigned(at(m.accessors, p.indices).componentType)))
    return "has indices that are not whole numbers from 0";
  if (!in_or_none(p.material, m.materials.size())) return "refers to a material that is not there";
  return {};
}

inline std::string check_meshes(const tinygltf::Model& m) {
  for (std::size_t i = 0; i < m.meshes.size(); ++i)
    for (const tinygltf::Primitive& p : m.meshes[i].primitives) {
      const std::string error = check_primitive(m, p);
      if (!error.empty()) return wrong("mesh", i, error.c_str());
    }
  for (std::size_t i = 0; i < m.textures.size(); ++i)
    if (!in_or_none(m.textures[i].source, m.images.size()) ||
        !in_or_none(m.textures[i].sampler, m.samplers.size()))
      return wrong("texture", i, "refers to an image or sampler that does not exist");
  for (std::size_t i = 0; i < m.materials.size(); ++i) {
    const tinygltf::Material& a = m.materials[i];
    for (const int id : {a.pbrMetallicRoughness.baseColorTexture.index,
                         a.pbrMetallicRoughness.metallicRoughnessTexture.index,
                         a.normalTexture.index, a.occlusionTexture.index, a.emissiveTexture.index})
      if (!in_or_none(id, m.textures.size()))
        return wrong("material", i, "refers to a texture that does not exist");
  }
  return {};
}

inline bool is_finite(const std::vector<double>& x) {
  return std::all_of(x.begin(), x.end(), [](double y) { return std::isfinite(y); });
}

inline std::string check_node(const tinygltf::Model& m, const tinygltf::Node& node) {
  const auto has = [](const std::vector<double>& x, std::size_t n) {
    return x.empty() || (x.size() == n && is_finite(x));
  };
  if (!has(node.matrix, 16) || !has(node.translation, 3) || !has(node.rotation, 4) ||
      !has(node.scale, 3))
    return "has a transform that is no matrix";
  if (!in_or_none(node.mesh, m.meshes.size())) return "refers to a mesh that does not exist";
  if (!in_or_none(node.skin, m.skins.size())) return "refers to a skin that does not exist";
  for (const int child : node.children)
    if (!in(child, m.nodes.size())) return "refers to a child that does not exist";
  return {};
}

/// Nodes have to be trees.
inline std::string check_nodes(const tinygltf::Model& m) {
  std::vector<int> count(m.nodes.size(), 0);
  for (std::size_t i = 0; i < m.nodes.size(); ++i) {
    const std::string error = check_node(m, m.nodes[i]);
    if (!error.empty()) return wrong("node", i, error.c_str());
    for (const int child : m.nodes[i].children)
      if (++at(count, child) > 1)
        return wrong("node", static_cast<std::size_t>(child), "is a child of two nodes");
  }
  const std::vector<int> parents = parents_of(m);
  for (std::size_t i = 0; i < m.nodes.size(); ++i) {
    int node = static_cast<int>(i);
    for (std::size_t steps = 0; node >= 0 && steps <= m.nodes.size(); ++steps)
      node = at(parents, node);
    if (node >= 0) return wrong("node", i, "is a child of itself");
  }
  for (std::size_t i = 0; i < m.scenes.size(); ++i)
    for (const int node : m.scenes[i].nodes)
      if (!in(node, m.nodes.size())) return wrong("scene", i, "refers to a missing node");
  return in_or_none(m.defaultScene, m.scenes.size()) ? "" : ": the scene does not exist";
}

inline std::string check_skin(const tinygltf::Model& m, const tinygltf::Skin& skin) {
  if (skin.joints.empty()) return "has no joints";
  for (const int joint : skin.joints)
    if (!in(joint, m.nodes.size())) return "refers to a joint that does not exist";
  if (skin.inverseBindMatrices == -1) return {};
  if (!in(skin.inverseBindMatrices, m.accessors.size()))
    return "refers to inverse bind matrices that do not exist";
  const tinygltf::Accessor& a = at(m.accessors, skin.inverseBindMatrices);
  if (a.type != TINYGLTF_TYPE_MAT4 || a.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT ||
      a.count < skin.joints.size())
    return "has not one inverse bind matrix per joint";
  const ism::Values matrices = numbers(m, skin.inverseBindMatrices);
  return matrices.allFinite() ? "" : "has inverse bind matrices that are not finite";
}

inline std::string check_animations(const tinygltf::Model& m) {
  for (std::size_t i = 0; i < m.animations.size(); ++i) {
    const tinygltf::Animation& a = m.animations[i];
    for (const tinygltf::AnimationSampler& s : a.samplers)
      if (!in(s.input, m.accessors.size()) || !in(s.output, m.accessors.size()))
        return wrong("animation", i, "refers to values that do not exist");
    for (const tinygltf::AnimationChannel& c : a.channels)
      if (!in(c.sampler, a.samplers.size()) || !in_or_none(c.target_node, m.nodes.size()))
        return wrong("animation", i, "refers to a sampler or a node that does not exist");
  }
  return {};
}

inline std::string check_extensions(const tinygltf::Model& m) {
  for (const std::string& name : m.extensionsRequired)
    if (name == "KHR_draco_mesh_compression" || name == "EXT_meshopt_compression")
      return ": its meshes are compressed (" + name + "), which cannot be read";
  return {};
}

/// Returns what is wrong with a file that was read, or an empty string.
inline std::string check(const tinygltf::Model& m) {
  for (const auto checked : {check_extensions, check_buffers, check_meshes, check_nodes}) {
    const std::string error = checked(m);
    if (!error.empty()) return error;
  }
  for (std::size_t i = 0; i < m.skins.size(); ++i) {
    const std::string error = check_skin(m, m.skins[i]);
    if (!error.empty()) return wrong("skin", i, error.c_str());
  }
  return check_animations(m);
}

inline const unsigned char* bytes_of(const tinygltf::Model& m, int view, std::size_t offset) {
  const tinygltf::BufferView& v = at(m.bufferViews, view);
  return at(m.buffers, v.buffer).data.data() + v.byteOffset + offset;
}

/// Keeps the bytes of an image as they are in the file; those in a view are taken once that is
/// checked.
inline bool keep_image(tinygltf::Image* image, const int, std::string*, std::string*, int, int,
                       const unsigned char* bytes, int size, void*) {
  image->as_is = true;
  if (image->bufferView < 0) image->image.assign(bytes, bytes + size);
  return true;
}

inline void take_images(tinygltf::Model& m) {
  for (tinygltf::Image& image : m.images) {
    std::vector<unsigned char>& bytes = image.image;
    if (image.bufferView >= 0) {
      const tinygltf::BufferView& view = at(m.bufferViews, image.bufferView);
      const unsigned char* const first = bytes_of(m, image.bufferView, 0);
      bytes.assign(first, first + view.byteLength);
    }
    const bool is_png = bytes.size() > 4 && bytes[0] == 0x89 && bytes[1] == 'P';
    if (image.mimeType.empty()) image.mimeType = is_png ? "image/png" : "image/jpeg";
  }
}

inline std::string first_line(const std::string& text) {
  std::string line = text.substr(0, text.find('\n'));
  for (char& c : line)
    if (static_cast<unsigned char>(c) < 32 || c == 127) c = '?';  // quoted from a broken file
  return line;
}

inline double number_at(const unsigned char* p, const tinygltf::Accessor& a) {
  using ism::detail::number_at;
  const double scale = a.normalized ? 1 : 0;
  const auto whole = [&](double x, double most) {
    return scale > 0 ? (std::max)(x / most, -1.0) : x;
  };
  switch (a.componentType) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return whole(number_at<std::int8_t>(p), 127);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return whole(number_at<std::uint8_t>(p), 255);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return whole(number_at<std::int16_t>(p), 32767);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return whole(number_at<std::uint16_t>(p), 65535);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return number_at<std::uint32_t>(p);
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return number_at<float>(p);
    default:
      return 0;
  }
}

/// The bytes of an accessor, one element after the other.
inline std::vector<unsigned char> packed(const tinygltf::Model& m, const tinygltf::Accessor& a) {
  const std::size_t size = element_size(a);
  std::vector<unsigned char> bytes(size * a.count, 0);
  if (a.bufferView != -1) {
    const std::size_t stride =
        static_cast<std::size_t>(a.ByteStride(at(m.bufferViews, a.bufferView)));
    const unsigned char* const from = bytes_of(m, a.bufferView, a.byteOffset);
    for (std::size_t i = 0; i < a.count; ++i)
      std::memcpy(bytes.data() + i * size, from + i * stride, size);
  }
  if (!a.sparse.isSparse) return bytes;
  tinygltf::Accessor ids;
  ids.componentType = a.sparse.indices.componentType;
  const std::size_t id_size = static_cast<std::size_t>(
      tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(ids.componentType)));
  for (int i = 0; i < a.sparse.count; ++i) {
    const std::size_t k = static_cast<std::size_t>(i);
    const double id =
        number_at(bytes_of(m, a.sparse.indices.bufferView,
                           static_cast<std::size_t>(a.sparse.indices.byteOffset) + k * id_size),
                  ids);
    if (id < static_cast<double>(a.count))
      std::memcpy(bytes.data() + static_cast<std::size_t>(id) * size,
                  bytes_of(m, a.sparse.values.bufferView,
                           static_cast<std::size_t>(a.sparse.values.byteOffset) + k * size),
                  size);
  }
  return bytes;
}

/// The corners of a primitive's triangles; strips and fans are cut.
inline std::vector<std::array<int, 3>> triangles_of(int mode, const std::vector<int>& ids) {
  std::vector<std::array<int, 3>> triangles;
  const int n = size_of(ids);
  if (mode == TINYGLTF_MODE_TRIANGLES || mode == -1)
    for (int i = 0; i + 2 < n; i += 3)
      triangles.push_back({at(ids, i), at(ids, i + 1), at(ids, i + 2)});
  if (mode == TINYGLTF_MODE_TRIANGLE_STRIP)
    for (int i = 0; i + 2 < n; ++i)
      triangles.push_back({at(ids, i), at(ids, i + 1 + i % 2), at(ids, i + 2 - i % 2)});
  if (mode == TINYGLTF_MODE_TRIANGLE_FAN)
    for (int i = 1; i + 1 < n; ++i) triangles.push_back({at(ids, i), at(ids, i + 1), at(ids, 0)});
  return triangles;
}

/// The ids of vertices that a primitive lists, or all in order.
inline std::vector<int> listed(const tinygltf::Model& m, const tinygltf::Primitive& p) {
  std::vector<int> ids;
  if (p.indices < 0) {
    const std::size_t n = at(m.accessors, p.attributes.at("POSITION")).count;
    for (std::size_t i = 0; i < n; ++i) ids.push_back(static_cast<int>(i));
    return ids;
  }
  const ism::Values values = numbers(m, p.indices);
  for (Eigen::Index i = 0; i < values.rows(); ++i)
    ids.push_back(static_cast<int>((std::min)(values(i, 0), 2147483647.0)));
  return ids;
}

/// The nodes of the scene, parents first, each once.
inline std::vector<int> scene_nodes(const tinygltf::Model& m) {
  const int scene = m.defaultScene >= 0 ? m.defaultScene : 0;
  std::vector<int> nodes;
  if (!m.scenes.empty()) {
    nodes = at(m.scenes, scene).nodes;
  } else {
    const std::vector<int> parents = parents_of(m);
    for (int i = 0; i < size_of(m.nodes); ++i)
      if (at(parents, i) < 0) nodes.push_back(i);
  }
  std::vector<char> is_listed(m.nodes.size(), 0);
  std::vector<int> each;  // once
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (at(is_listed, nodes[i])++ != 0) continue;
    each.push_back(nodes[i]);
    const std::vector<int>& children = at(m.nodes, nodes[i]).children;
    nodes.insert(nodes.end(), children.begin(), children.end());
  }
  return each;
}

/// From the buffer of a node's mesh to the scene. With a skin, joints place it, the first one as in
/// the bind pose.
inline Eigen::Matrix4d placement(const tinygltf::Model& m, const std::vector<int>& parents,
                                 int node) {
  const int skin = at(m.nodes, node).skin;
  if (skin < 0) return global_transform(m, parents, node);
  const std::vector<int>& joints = at(m.skins, skin).joints;
  std::size_t root = 0;
  while (root + 1 < joints.size() &&
         std::count(joints.begin(), joints.end(), at(parents, joints[root])) > 0)
    ++root;
  return global_transform(m, parents, joints[root]) * inverse_binds(m, skin)[root];
}

/// What copies of a vertex have in common, a row per vertex: its place, joints and moves.
inline ism::Values identities(const tinygltf::Model& m, const tinygltf::Primitive& p) {
  ism::Values all = numbers(m, p.attributes.at("POSITION"));
  const auto append = [&](const std::map<std::string, int>& attributes, const std::string& name) {
    const int id = attribute(attributes, name);
    if (id < 0) return;
    const ism::Values more = numbers(m, id);
    all.conservativeResize(Eigen::NoChange, all.cols() + more.cols());
    all.rightCols(more.cols()) = more;
  };
  for (const char* name : {"JOINTS_0", "WEIGHTS_0", "JOINTS_1", "WEIGHTS_1"})
    append(p.attributes, name);
  for (const auto& target : p.targets) append(target, "POSITION");
  return all;
}

/// Finds copies among the vertices of a part and of earlier parts of the same node.
inline void find_copies(const tinygltf::Model& m, const Part& part,
                        std::map<std::vector<double>, int>& known, Surface& surface) {
  const ism::Values all = identities(m, at(at(m.meshes, part.mesh).primitives, part.primitive));
  for (Eigen::Index v = 0; v < all.rows(); ++v) {
    const double* const row = all.data() + v * all.cols();
    const int id = part.first_vertex + static_cast<int>(v);
    surface.same.push_back(known.insert({{row, row + all.cols()}, id}).first->second);
  }
}

/// Adds a primitive to a surface. Returns what is wrong, or an empty string.
inline std::string add_part(const tinygltf::Model& m, Part part, Surface& surface) {
  const tinygltf::Primitive& p = at(at(m.meshes, part.mesh).primitives, part.primitive);
  const ism::Values positions = numbers(m, p.attributes.at("POSITION"));
  const std::vector<int> ids = listed(m, p);
  const std::vector<std::array<int, 3>> triangles = triangles_of(p.mode, ids);
  part.first_vertex = static_cast<int>(surface.mesh.vertices.rows());
  part.vertices = static_cast<int>(positions.rows());
  part.first_triangle = static_cast<int>(surface.mesh.triangles.rows());
  part.triangles = size_of(triangles);
  const std::string where =
      "primitive " + std::to_string(part.primitive) + " of mesh " + std::to_string(part.mesh);
  const bool is_list = p.mode == TINYGLTF_MODE_TRIANGLES || p.mode == -1;
  if (is_list && ids.size() % 3 != 0)
    surface.notes.push_back(where + ": " + std::to_string(ids.size()) +
                            " indices are not three per triangle, the last ones are left out");
  surface.mesh.vertices.conservativeResize(part.first_vertex + part.vertices, 3);
  for (int i = 0; i < part.vertices; ++i) {
    const Eigen::Vector4d x = part.placed * positions.row(i).transpose().homogeneous();
    if (!x.allFinite())
      return ": " + where + ": the position of vertex " + std::to_string(i) + " is not finite";
    surface.mesh.vertices.row(part.first_vertex + i) = x.head<3>().transpose();
  }
  // What is mirrored is turned, so that its outside stays outside.
  const bool is_mirrored = part.placed.topLeftCorner<3, 3>().determinant() < 0;
  surface.mesh.triangles.conservativeResize(part.first_triangle + part.triangles, 3);
  for (int i = 0; i < part.triangles; ++i)
    for (int k = 0; k < 3; ++k) {
      const int id = at(at(triangles, i), is_mirrored ? 2 - k : k);
      if (id >= part.vertices)
        return ": " + where + ": an index refers to vertex " + std::to_string(id) +
               ", but there are " + std::to_string(part.vertices);
      surface.mesh.triangles(part.first_triangle + i, k) = part.first_vertex + id;
    }
  surface.parts.push_back(part);
  return {};
}

// ---- Writing
// -------------------------------------------------------------------------------------

/// Appends bytes to the one buffer, from a multiple of 4; returns the id of their view.
inline int add_view(tinygltf::Model& m, const std::vector<unsigned char>& bytes) {
  if (m.buffers.empty()) m.buffers.emplace_back();
  std::vector<unsigned char>& all = m.buffers[0].data;
  all.resize((all.size() + 3) / 4 * 4, 0);
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = all.size();
  view.byteLength = bytes.size();
  all.insert(all.end(), bytes.begin(), bytes.end());
  m.bufferViews.push_back(view);
  return size_of(m.bufferViews) - 1;
}

/// All buffers become one, and images views of it.
inline void join_buffers(tinygltf::Model& m) {
  std::vector<std::size_t> begin;
  std::vector<unsigned char> all;
  for (const tinygltf::Buffer& buffer : m.buffers) {
    all.resize((all.size() + 3) / 4 * 4, 0);
    begin.push_back(all.size());
    all.insert(all.end(), buffer.data.begin(), buffer.data.end());
  }
  for (tinygltf::BufferView& view : m.bufferViews) {
    view.byteOffset += at(begin, view.buffer);
    view.buffer = 0;
  }
  m.buffers.assign(1, tinygltf::Buffer());
  m.buffers[0].data.swap(all);
  for (tinygltf::Image& image : m.images) {
    if (image.bufferView < 0) image.bufferView = add_view(m, image.image);
    image.uri.clear();
    image.image.clear();
  }
}

/// Calls visit(id) for every reference to an accessor.
template <class Visit>
void for_each_accessor(tinygltf::Model& m, const Visit& visit) {
  for (tinygltf::Mesh& mesh : m.meshes)
    for (tinygltf::Primitive& p : mesh.primitives) {
      visit(p.indices);
      for (auto& entry : p.attributes) visit(entry.second);
      for (auto& target : p.targets)
        for (auto& entry : target) visit(entry.second);
    }
  for (tinygltf::Skin& skin : m.skins) visit(skin.inverseBindMatrices);
  for (tinygltf::Animation& a : m.animations)
    for (tinygltf::AnimationSampler& s : a.samplers) {
      visit(s.input);
      visit(s.output);
    }
}

/// Calls visit(id) for every reference to a view.
template <class Visit>
void for_each_view(tinygltf::Model& m, const Visit& visit) {
  for (tinygltf::Accessor& a : m.accessors) {
    visit(a.bufferView);
    if (a.sparse.isSparse) {
      visit(a.sparse.indices.bufferView);
      visit(a.sparse.values.bufferView);
    }
  }
  for (tinygltf::Image& image : m.images) visit(image.bufferView);
}

/// tinygltf writes null for a thing without properties, and then cannot read it.
template <class Items>
void name_empty(Items& items, const char* name) {
  for (auto& item : items)
    if (item == typename Items::value_type()) item.name = name;
}

/// Numbers that were added, and are not finite, have such bounds.
inline bool has_finite_bounds(const tinygltf::Model& m) {
  return std::all_of(m.accessors.begin(), m.accessors.end(), [](const tinygltf::Accessor& a) {
    return is_finite(a.minValues) && is_finite(a.maxValues);
  });
}

/// True if all extensions of a file are known to refer to no accessor and to no view.
inline bool is_closed_world(const tinygltf::Model& m) {
  return std::all_of(m.extensionsUsed.begin(), m.extensionsUsed.end(), [](const auto& name) {
    for (const char* known :
         {"KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_", "KHR_mesh_quantization"})
      if (name.compare(0, std::strlen(known), known) == 0) return true;
    return false;
  });
}

/// Leaves out what no reference leads to. for_each(visit) visits all references.
template <class Items, class ForEach>
void drop_unused(Items& items, const ForEach& for_each) {
  std::vector<int> id(items.size(), -1);
  for_each([&](int& used) {
    if (used >= 0) at(id, used) = 0;
  });
  Items kept;
  for (std::size_t i = 0; i < items.size(); ++i)
    if (id[i] == 0) {
      id[i] = size_of(kept);
      kept.push_back(std::move(items[i]));
    }
  items = std::move(kept);
  for_each([&](int& used) {
    if (used >= 0) used = at(id, used);
  });
}

/// Leaves out bytes that are in no view.
inline void pack_buffer(tinygltf::Model& m) {
  std::vector<unsigned char> all;
  for (tinygltf::BufferView& view : m.bufferViews) {
    all.resize((all.size() + 3) / 4 * 4, 0);
    const auto first = m.buffers[0].data.begin() + static_cast<std::ptrdiff_t>(view.byteOffset);
    view.byteOffset = all.size();
    all.insert(all.end(), first, first + static_cast<std::ptrdiff_t>(view.byteLength));
  }
  m.buffers[0].data.swap(all);
  if (m.buffers[0].data.empty()) m.buffers.clear();
}

}  // namespace detail

/// Adds an accessor with the packed bytes of its elements; `target` as for views of vertices or
/// indices, 0 for others. Returns its id.
inline int add_accessor(tinygltf::Model& m, tinygltf::Accessor accessor,
                        const std::vector<unsigned char>& bytes, int target) {
  accessor.bufferView = detail::add_view(m, bytes);
  accessor.byteOffset = 0;
  accessor.sparse.isSparse = false;
  at(m.bufferViews, accessor.bufferView).target = target;
  m.accessors.push_back(std::move(accessor));
  return size_of(m.accessors) - 1;
}

/// Adds numbers, a row per element, as `Number`; type: TINYGLTF_TYPE_VEC3 and the like. Numbers of
/// a type other than float are whole.
template <class Number>
int add_numbers(tinygltf::Model& m, const ism::Values& rows, int type, int target) {
  tinygltf::Accessor a;
  a.type = type;
  a.componentType = std::is_same_v<Number, float>           ? TINYGLTF_COMPONENT_TYPE_FLOAT
                    : std::is_same_v<Number, std::uint8_t>  ? TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE
                    : std::is_same_v<Number, std::uint16_t> ? TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT
                                                            : TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
  a.count = static_cast<std::size_t>(rows.rows());
  const auto written = rows.cast<Number>().eval();
  if (!written.allFinite()) a.minValues = {std::numeric_limits<double>::quiet_NaN()};
  for (Eigen::Index k = 0; k < rows.cols() && written.size() > 0; ++k) {
    a.minValues.push_back(static_cast<double>(written.col(k).minCoeff()));
    a.maxValues.push_back(static_cast<double>(written.col(k).maxCoeff()));
  }
  const auto* const first = reinterpret_cast<const unsigned char*>(written.data());
  const std::size_t size = static_cast<std::size_t>(written.size()) * sizeof(Number);
  return add_accessor(m, std::move(a), {first, first + size}, target);
}

inline File load(const std::string& path) {
  File file;
  file.path = path;
  std::string bytes, error, warning;
  file.error = mesh_io::read_bytes(path, bytes);
  if (!file.error.empty()) return file;
  if (bytes.empty()) file.error = path + ": the file is empty";
  if (bytes.size() > std::size_t{0xffffffff}) file.error = path + ": the file is too large";
  if (!file.error.empty()) return file;
  tinygltf::TinyGLTF reader;
  reader.SetImageLoader(detail::keep_image, nullptr);
  const std::string folder = std::filesystem::path(path).parent_path().string();
  const unsigned size = static_cast<unsigned>(bytes.size());
  bool is_read = false;
  try {
    is_read =
        bytes.compare(0, 4, "glTF") == 0
            ? reader.LoadBinaryFromMemory(&file.model, &error, &warning,
                                          reinterpret_cast<const unsigned char*>(bytes.data()),
                                          size, folder)
            : reader.LoadASCIIFromString(&file.model, &error, &warning, bytes.data(), size, folder);
  } catch (const std::exception& e) {
    error = e.what();
  }
  const auto compressed = bytes.find("KHR_draco_mesh_compression");
  if (!is_read && compressed != std::string::npos && error.find("bufferView") != std::string::npos)
    file.error = path + ": its meshes are compressed (KHR_draco_mesh_compression)";
  else if (!is_read)
    file.error = path + ": no glTF 2.0 file, or a part of one" + (error.empty() ? "" : ": ") +
                 detail::first_line(error);
  else if (const std::string wrong = detail::check(file.model); !wrong.empty())
    file.error = path + wrong;
  else
    detail::take_images(file.model);
  return file;
}

inline ism::Values numbers(const tinygltf::Model& m, int accessor) {
  const tinygltf::Accessor& a = at(m.accessors, accessor);
  const std::vector<unsigned char> bytes = detail::packed(m, a);
  ism::Values rows(static_cast<Eigen::Index>(a.count),
                   tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(a.type)));
  const std::size_t size = static_cast<std::size_t>(
      tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(a.componentType)));
  for (Eigen::Index i = 0; i < rows.size(); ++i)
    rows.data()[i] = detail::number_at(bytes.data() + static_cast<std::size_t>(i) * size, a);
  return rows;
}

inline Eigen::Matrix4d local_transform(const tinygltf::Node& node) {
  if (node.matrix.size() == 16) return Eigen::Map<const Eigen::Matrix4d>(node.matrix.data());
  Eigen::Affine3d t = Eigen::Affine3d::Identity();
  if (node.translation.size() == 3)
    t.translate(Eigen::Vector3d(node.translation[0], node.translation[1], node.translation[2]));
  if (node.rotation.size() == 4)
    t.rotate(
        Eigen::Quaterniond(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2])
            .normalized());
  if (node.scale.size() == 3) t.scale(Eigen::Vector3d(node.scale[0], node.scale[1], node.scale[2]));
  return t.matrix();
}

inline std::vector<int> parents_of(const tinygltf::Model& model) {
  std::vector<int> parents(model.nodes.size(), -1);
  for (int i = 0; i < size_of(model.nodes); ++i)
    for (const int child : at(model.nodes, i).children) at(parents, child) = i;
  return parents;
}

inline Eigen::Matrix4d global_transform(const tinygltf::Model& model,
                                        const std::vector<int>& parents, int node) {
  Eigen::Matrix4d result = Eigen::Matrix4d::Identity();
  for (; node >= 0; node = at(parents, node))
    result = local_transform(at(model.nodes, node)) * result;
  return result;
}

inline std::vector<Eigen::Matrix4d> inverse_binds(const tinygltf::Model& model, int skin) {
  const tinygltf::Skin& s = at(model.skins, skin);
  std::vector<Eigen::Matrix4d> matrices(s.joints.size(), Eigen::Matrix4d::Identity());
  if (s.inverseBindMatrices < 0) return matrices;
  const ism::Values values = numbers(model, s.inverseBindMatrices);
  for (int i = 0; i < size_of(matrices); ++i)
    at(matrices, i) = Eigen::Map<const Eigen::Matrix4d>(values.data() + 16 * i);
  return matrices;
}

inline Surface surface_of(const File& file) {
  const tinygltf::Model& m = file.model;
  const std::vector<int> parents = parents_of(m);
  Surface surface;
  int others = 0;
  for (const int node : detail::scene_nodes(m)) {
    Part part;
    part.node = node;
    part.mesh = at(m.nodes, node).mesh;
    if (part.mesh < 0) continue;
    part.placed = detail::placement(m, parents, node);
    const std::vector<tinygltf::Primitive>& primitives = at(m.meshes, part.mesh).primitives;
    std::map<std::vector<double>, int> known;
    for (part.primitive = 0; part.primitive < size_of(primitives); ++part.primitive) {
      const tinygltf::Primitive& p = at(primitives, part.primitive);
      if (attribute(p.attributes, "POSITION") < 0) continue;
      const std::string error = detail::add_part(m, part, surface);
      if (!error.empty()) surface.error = file.path + error;
      if (!error.empty()) return surface;
      detail::find_copies(m, surface.parts.back(), known, surface);
      others += surface.parts.back().triangles == 0;
    }
  }
  int copies = 0;
  for (int v = 0; v < size_of(surface.same); ++v) copies += at(surface.same, v) != v;
  if (copies > 0)
    surface.notes.push_back("joined " + std::to_string(copies) + " copies of vertices along seams");
  if (others > 0) surface.notes.push_back(std::to_string(others) + " primitives have no triangles");
  if (surface.mesh.triangles.rows() == 0) surface.error = file.path + ": there are no faces";
  return surface;
}

inline ism::TriangleMesh joined(const Surface& surface) {
  ism::TriangleMesh mesh = surface.mesh;
  for (Eigen::Index i = 0; i < mesh.triangles.size(); ++i)
    mesh.triangles.data()[i] = at(surface.same, mesh.triangles.data()[i]);
  return mesh;
}

/// Texture coordinates of the corners of a surface, v upwards; NaN where there are none, no rows
/// if there are none at all. set(part): the number of the coordinates to take, or -1.
template <class SetOf>
ism::Points2 corner_uv(const tinygltf::Model& m, const Surface& surface, const SetOf& set_of) {
  ism::Points2 uv = ism::Points2::Constant(surface.mesh.triangles.size(), 2,
                                           std::numeric_limits<double>::quiet_NaN());
  bool has_some = false;
  for (const Part& part : surface.parts) {
    const tinygltf::Primitive& p = at(at(m.meshes, part.mesh).primitives, part.primitive);
    const int id = attribute(p.attributes, "TEXCOORD_" + std::to_string(set_of(part)));
    if (id < 0 || at(m.accessors, id).type != TINYGLTF_TYPE_VEC2) continue;
    const ism::Values values = numbers(m, id);
    if (!values.allFinite()) continue;
    has_some = has_some || part.triangles > 0;
    for (int c = 3 * part.first_triangle; c < 3 * (part.first_triangle + part.triangles); ++c) {
      const int v = surface.mesh.triangles(c / 3, c % 3) - part.first_vertex;
      uv.row(c) << values(v, 0), 1 - values(v, 1);
    }
  }
  return has_some ? uv : ism::Points2();
}

inline mesh_io::ReadResult read_mesh(const std::string& path) {
  mesh_io::ReadResult result;
  const File file = load(path);
  result.error = file.error;
  if (!result.error.empty()) return result;
  Surface surface = surface_of(file);
  result.error = surface.error;
  result.ok = result.error.empty();
  if (!result.ok) return result;
  result.corner_uv = corner_uv(file.model, surface, [](const Part&) { return 0; });
  result.mesh = joined(surface);
  result.notes = std::move(surface.notes);
  result.edges = mesh_io::edges_of(result.mesh.triangles);
  return result;
}

inline void drop_unused_skins(tinygltf::Model& m) {
  std::vector<char> was_joint(m.nodes.size(), 0);
  for (const tinygltf::Skin& skin : m.skins)
    for (const int joint : skin.joints) at(was_joint, joint) = 1;
  detail::drop_unused(m.skins, [&](const auto& visit) {
    for (tinygltf::Node& node : m.nodes) visit(node.skin);
  });
  for (const tinygltf::Skin& skin : m.skins)
    for (const int joint : skin.joints) at(was_joint, joint) = 0;
  for (tinygltf::Animation& a : m.animations) {
    const auto moves_none = [&](const tinygltf::AnimationChannel& c) {
      return c.target_node >= 0 && at(was_joint, c.target_node) != 0;
    };
    a.channels.erase(std::remove_if(a.channels.begin(), a.channels.end(), moves_none),
                     a.channels.end());
    detail::drop_unused(a.samplers, [&](const auto& visit) {
      for (tinygltf::AnimationChannel& c : a.channels) visit(c.sampler);
    });
  }
  m.animations.erase(std::remove_if(m.animations.begin(), m.animations.end(),
                                    [](const auto& a) { return a.channels.empty(); }),
                     m.animations.end());
}

inline std::string glb_text(tinygltf::Model model) {
  if (!detail::has_finite_bounds(model)) return {};
  detail::name_empty(model.nodes, "node");
  detail::name_empty(model.scenes, "scene");
  detail::name_empty(model.textures, "texture");
  detail::join_buffers(model);
  if (detail::is_closed_world(model)) {
    detail::drop_unused(model.accessors,
                        [&](const auto& visit) { detail::for_each_accessor(model, visit); });
    detail::drop_unused(model.bufferViews,
                        [&](const auto& visit) { detail::for_each_view(model, visit); });
    detail::pack_buffer(model);
  }
  if (!model.buffers.empty() && model.buffers[0].data.size() > std::size_t{0xf0000000}) return {};
  tinygltf::TinyGLTF writer;
  std::ostringstream stream;
  return writer.WriteGltfSceneToStream(&model, stream, false, true) ? stream.str() : "";
}

}  // namespace gltf_io

#endif  // ISM_EXAMPLES_GLTF_IO_HPP

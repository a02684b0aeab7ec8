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
#include <new>
#include <numeric>
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

/// Inverse bind matrices, one per joint, identities if the file has none.
inline std::vector<Eigen::Matrix4d> inverse_binds(const tinygltf::Model& model, int skin);

/// The bytes of a .glb file with all buffers and images in it; elements that nothing refers to are
/// left out. None if they are more than the 4 GB that the format can hold, or if a number that was
/// added is not finite as a float.
inline std::string glb_text(tinygltf::Model model);

/// Leaves out skins that no node has, and animations of their joints.
inline void drop_unused_skins(tinygltf::Model& model);

/// Element i of a vector, where ids are ints.
template <class Items>
decltype(auto) at(Items& items, int i) {
  return items[static_cast<std::size_t>(i)];
}
template <class Items>
int size_of(const Items& items) {
  return static_cast<int>(items.size());
}

/// The id of an attribute of a primitive, or -1.
inline int attribute(const std::map<std::string, int>& attributes, const std::string& name) {
  const auto found = attributes.find(name);
  return found == attributes.end() ? -1 : found->second;
}

inline const tinygltf::Primitive& primitive_of(const tinygltf::Model& m, const Part& part) {
  return at(at(m.meshes, part.mesh).primitives, part.primitive);
}

/// From a node to its parent.
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

/// Per node, -1 for roots.
inline std::vector<int> parents_of(const tinygltf::Model& model) {
  std::vector<int> parents(model.nodes.size(), -1);
  for (int i = 0; i < size_of(model.nodes); ++i)
    for (const int child : at(model.nodes, i).children) at(parents, child) = i;
  return parents;
}

/// From a node to the scene.
inline Eigen::Matrix4d global_transform(const tinygltf::Model& model,
                                        const std::vector<int>& parents, int node) {
  Eigen::Matrix4d result = Eigen::Matrix4d::Identity();
  for (; node >= 0; node = at(parents, node))
    result = local_transform(at(model.nodes, node)) * result;
  return result;
}

inline std::vector<int> all_roots(const tinygltf::Model& m) {
  const std::vector<int> parents = parents_of(m);
  std::vector<int> roots;
  for (int i = 0; i < size_of(m.nodes); ++i)
    if (at(parents, i) < 0) roots.push_back(i);
  return roots;
}

/// The nodes that the scene shows with all that is below them; without a scene, all roots.
inline std::vector<int> scene_roots(const tinygltf::Model& model) {
  if (!model.scenes.empty()) return at(model.scenes, (std::max)(model.defaultScene, 0)).nodes;
  return all_roots(model);
}

namespace detail {

inline std::size_t component_size(int type) {
  const int bytes = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(type));
  return static_cast<std::size_t>((std::max)(bytes, 0));
}

inline int columns_of(const tinygltf::Accessor& a) {
  return (std::max)(tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(a.type)), 0);
}

inline std::size_t element_size(const tinygltf::Accessor& a) {
  return component_size(a.componentType) * static_cast<std::size_t>(columns_of(a));
}

inline std::array<int*, 5> texture_ids(tinygltf::Material& m) {
  return {&m.pbrMetallicRoughness.baseColorTexture.index,
          &m.pbrMetallicRoughness.metallicRoughnessTexture.index, &m.normalTexture.index,
          &m.occlusionTexture.index, &m.emissiveTexture.index};
}

/// Calls visit(id, kind, count) for every id in a file: of one of `count` things of a kind.
template <class Visit>
void for_each_reference(tinygltf::Model& m, const Visit& visit) {
  const auto visit_any = [&](int& id, const char* kind, std::size_t count) {
    if (id != -1) visit(id, kind, count);
  };
  const std::size_t views = m.bufferViews.size(), accessors = m.accessors.size(),
                    nodes = m.nodes.size();
  for (tinygltf::BufferView& v : m.bufferViews) visit(v.buffer, "buffer", m.buffers.size());
  for (tinygltf::Accessor& a : m.accessors) {
    visit_any(a.bufferView, "buffer view", views);
    if (!a.sparse.isSparse) continue;
    visit(a.sparse.indices.bufferView, "buffer view", views);
    visit(a.sparse.values.bufferView, "buffer view", views);
  }
  for (tinygltf::Image& image : m.images) visit_any(image.bufferView, "buffer view", views);
  for (tinygltf::Texture& texture : m.textures) {
    visit_any(texture.source, "image", m.images.size());
    visit_any(texture.sampler, "sampler", m.samplers.size());
  }
  for (tinygltf::Material& material : m.materials)
    for (int* const id : texture_ids(material)) visit_any(*id, "texture", m.textures.size());
  for (tinygltf::Mesh& mesh : m.meshes)
    for (tinygltf::Primitive& p : mesh.primitives) {
      visit_any(p.material, "material", m.materials.size());
      visit_any(p.indices, "accessor", accessors);
      for (auto& entry : p.attributes) visit(entry.second, "accessor", accessors);
      for (auto& target : p.targets)
        for (auto& entry : target) visit(entry.second, "accessor", accessors);
    }
  for (tinygltf::Skin& skin : m.skins) {
    visit_any(skin.inverseBindMatrices, "accessor", accessors);
    visit_any(skin.skeleton, "node", nodes);
    for (int& joint : skin.joints) visit(joint, "node", nodes);
  }
  for (tinygltf::Node& node : m.nodes) {
    visit_any(node.mesh, "mesh", m.meshes.size());
    visit_any(node.skin, "skin", m.skins.size());
    for (int& child : node.children) visit(child, "node", nodes);
  }
  for (tinygltf::Scene& scene : m.scenes)
    for (int& node : scene.nodes) visit(node, "node", nodes);
  visit_any(m.defaultScene, "scene", m.scenes.size());
  for (tinygltf::Animation& a : m.animations) {
    for (tinygltf::AnimationSampler& s : a.samplers) {
      visit(s.input, "accessor", accessors);
      visit(s.output, "accessor", accessors);
    }
    for (tinygltf::AnimationChannel& c : a.channels) {
      visit(c.sampler, "sampler of an animation", a.samplers.size());
      visit_any(c.target_node, "node", nodes);
    }
  }
}

/// Some nodes and all below them, parents first, each once.
inline std::vector<int> nodes_below(const tinygltf::Model& m, const std::vector<int>& roots) {
  std::vector<char> is_listed(m.nodes.size(), 0);
  std::vector<int> nodes;
  const auto add = [&](const std::vector<int>& more) {
    for (const int node : more)
      if (at(is_listed, node)++ == 0) nodes.push_back(node);
  };
  add(roots);
  for (std::size_t i = 0; i < nodes.size(); ++i) add(at(m.nodes, nodes[i]).children);
  return nodes;
}

// ---- Checks -------------------------------------------------------------------------------------

/// What is wrong with one thing, as the end of a sentence.
inline std::string wrong(const char* what, std::size_t id, const std::string& message) {
  return std::string(": ") + what + " " + std::to_string(id) + " " + message;
}

/// Every function of this part returns what is wrong, or an empty string.
inline std::string check_format(tinygltf::Model& m) {
  if (m.asset.version.compare(0, 2, "2.") != 0) return ": its version of glTF is not 2.0";
  for (const std::string& name : m.extensionsRequired)
    if (name == "KHR_draco_mesh_compression" || name == "EXT_meshopt_compression")
      return ": its meshes are compressed (" + name + "), which cannot be read";
  return {};
}

inline std::string check_references(tinygltf::Model& m) {
  std::string error;
  for_each_reference(m, [&](int id, const std::string& kind, std::size_t count) {
    const bool is_there = id >= 0 && static_cast<std::size_t>(id) < count;
    if (is_there || !error.empty()) return;
    error = ": it refers to " + kind + " " + std::to_string(id) + ", which does not exist";
  });
  return error;
}

constexpr std::size_t kMost = std::size_t{1} << 30;  // keeps products of sizes in range

/// Negative numbers of a file have become very large ones.
inline bool fits(std::size_t offset, std::size_t stride, std::size_t count, std::size_t size,
                 std::size_t total) {
  if (offset > kMost || stride > kMost || count > kMost || total > 4 * kMost) return false;
  return count == 0 || offset + stride * (count - 1) + size <= total;
}

inline bool fits_dense(const tinygltf::Accessor& a, const tinygltf::BufferView& view) {
  const int stride = a.ByteStride(view);
  return stride > 0 && fits(a.byteOffset, static_cast<std::size_t>(stride), a.count,
                            element_size(a), view.byteLength);
}

inline bool is_unsigned(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

inline bool fits_sparse(const tinygltf::Model& m, const tinygltf::Accessor& a) {
  const auto is_inside = [&](int view, int offset, std::size_t size) {
    return fits(static_cast<std::size_t>(offset), size, static_cast<std::size_t>(a.sparse.count),
                size, at(m.bufferViews, view).byteLength);
  };
  const auto& ids = a.sparse.indices;
  const auto& values = a.sparse.values;
  return is_unsigned(ids.componentType) &&
         is_inside(ids.bufferView, ids.byteOffset, component_size(ids.componentType)) &&
         is_inside(values.bufferView, values.byteOffset, element_size(a));
}

inline std::string check_sizes(tinygltf::Model& m) {
  for (std::size_t i = 0; i < m.bufferViews.size(); ++i) {
    const tinygltf::BufferView& v = m.bufferViews[i];
    if (!fits(v.byteOffset, 1, 1, v.byteLength, at(m.buffers, v.buffer).data.size()))
      return wrong("buffer view", i, "reaches beyond its buffer");
  }
  for (std::size_t i = 0; i < m.accessors.size(); ++i) {
    const tinygltf::Accessor& a = m.accessors[i];
    if (element_size(a) == 0) return wrong("accessor", i, "has no known type");
    if (a.count > kMost) return wrong("accessor", i, "has too many elements");
    if (a.bufferView != -1 && !fits_dense(a, at(m.bufferViews, a.bufferView)))
      return wrong("accessor", i, "reaches beyond its buffer");
    if (a.sparse.isSparse && !fits_sparse(m, a))
      return wrong("accessor", i, "has sparse values beyond their buffer");
  }
  return {};
}

inline std::string check_primitive(const tinygltf::Model& m, const tinygltf::Primitive& p) {
  if (p.indices != -1 && (at(m.accessors, p.indices).type != TINYGLTF_TYPE_SCALAR ||
                          !is_unsigned(at(m.accessors, p.indices).componentType)))
    return "has indices that are not whole numbers from 0";
  const int normal = attribute(p.attributes, "NORMAL");
  if (normal != -1 && at(m.accessors, normal).type != TINYGLTF_TYPE_VEC3)
    return "has normals that are not three numbers each";
  const int position = attribute(p.attributes, "POSITION");
  if (position == -1) return {};  // nothing is drawn
  if (at(m.accessors, position).type != TINYGLTF_TYPE_VEC3)
    return "has positions that are not three numbers each";
  const auto fits = [&](const std::map<std::string, int>& list) {
    return std::all_of(list.begin(), list.end(), [&](const auto& entry) {
      return at(m.accessors, entry.second).count == at(m.accessors, position).count;
    });
  };
  const bool all_fit = fits(p.attributes) && std::all_of(p.targets.begin(), p.targets.end(), fits);
  return all_fit ? "" : "has attributes that differ in number";
}

inline std::string check_meshes(tinygltf::Model& m) {
  for (std::size_t i = 0; i < m.meshes.size(); ++i)
    for (const tinygltf::Primitive& p : m.meshes[i].primitives) {
      const std::string error = check_primitive(m, p);
      if (!error.empty()) return wrong("mesh", i, error);
    }
  return {};
}

inline bool are_finite(const std::vector<double>& x) {
  return std::all_of(x.begin(), x.end(), [](double y) { return std::isfinite(y); });
}

/// Nodes have to be trees.
inline std::string check_nodes(tinygltf::Model& m) {
  const auto has = [](const std::vector<double>& x, std::size_t n) {
    return x.empty() || (x.size() == n && are_finite(x));
  };
  std::vector<int> parents(m.nodes.size(), 0);
  for (std::size_t i = 0; i < m.nodes.size(); ++i) {
    const tinygltf::Node& node = m.nodes[i];
    if (!has(node.matrix, 16) || !has(node.translation, 3) || !has(node.rotation, 4) ||
        !has(node.scale, 3))
      return wrong("node", i, "has a transform that is no matrix");
    for (const int child : node.children)
      if (++at(parents, child) > 1)
        return wrong("node", static_cast<std::size_t>(child), "is a child of two nodes");
  }
  for (const int node : nodes_below(m, all_roots(m))) at(parents, node) = -1;
  for (std::size_t i = 0; i < m.nodes.size(); ++i)
    if (parents[i] != -1) return wrong("node", i, "is a child of itself");
  return {};
}

inline std::string check_skins(tinygltf::Model& m) {
  for (std::size_t i = 0; i < m.skins.size(); ++i) {
    const tinygltf::Skin& skin = m.skins[i];
    if (skin.joints.empty()) return wrong("skin", i, "has no joints");
    if (skin.inverseBindMatrices == -1) continue;
    const tinygltf::Accessor& a = at(m.accessors, skin.inverseBindMatrices);
    if (a.type != TINYGLTF_TYPE_MAT4 || a.count < skin.joints.size())
      return wrong("skin", i, "has not one inverse bind matrix per joint");
    if (!numbers(m, skin.inverseBindMatrices).allFinite())
      return wrong("skin", i, "has inverse bind matrices that are not finite");
  }
  return {};
}

inline std::string check(tinygltf::Model& m) {
  for (const auto checked :
       {check_format, check_references, check_sizes, check_meshes, check_nodes, check_skins}) {
    const std::string error = checked(m);
    if (!error.empty()) return error;
  }
  return {};
}

// ---- Reading ------------------------------------------------------------------------------------

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

/// The number at some bytes; whole ones that stand for [0, 1] or [-1, 1] become that.
inline double number_at(const unsigned char* p, int type, bool is_normalized) {
  using ism::detail::number_at;
  const auto whole = [&](double x, double most) {
    return is_normalized ? (std::max)(x / most, -1.0) : x;
  };
  switch (type) {
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

/// Replaces some elements among the packed bytes of an accessor.
inline void set_sparse(const tinygltf::Model& m, const tinygltf::Accessor& a,
                       std::vector<unsigned char>& bytes) {
  const auto& ids = a.sparse.indices;
  const auto& values = a.sparse.values;
  const std::size_t size = element_size(a), id_size = component_size(ids.componentType);
  const unsigned char* id = bytes_of(m, ids.bufferView, static_cast<std::size_t>(ids.byteOffset));
  const unsigned char* value =
      bytes_of(m, values.bufferView, static_cast<std::size_t>(values.byteOffset));
  for (int i = 0; i < a.sparse.count; ++i, id += id_size, value += size) {
    const std::size_t row = static_cast<std::size_t>(number_at(id, ids.componentType, false));
    if (row < a.count) std::memcpy(bytes.data() + row * size, value, size);
  }
}

/// The bytes of an accessor, one element after the other.
inline std::vector<unsigned char> packed(const tinygltf::Model& m, const tinygltf::Accessor& a) {
  const std::size_t size = element_size(a);
  std::vector<unsigned char> bytes(size * a.count, 0);
  if (a.bufferView != -1) {
    const int stride = a.ByteStride(at(m.bufferViews, a.bufferView));
    const unsigned char* from = bytes_of(m, a.bufferView, a.byteOffset);
    for (std::size_t i = 0; i < a.count; ++i, from += stride)
      std::memcpy(bytes.data() + i * size, from, size);
  }
  if (a.sparse.isSparse) set_sparse(m, a, bytes);
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
  std::vector<int> ids(at(m.accessors, p.attributes.at("POSITION")).count);
  std::iota(ids.begin(), ids.end(), 0);
  if (p.indices < 0) return ids;
  const ism::Values values = numbers(m, p.indices).cwiseMin(2147483647);
  ids.resize(static_cast<std::size_t>(values.rows()));
  std::transform(values.data(), values.data() + values.rows(), ids.begin(),
                 [](double x) { return static_cast<int>(x); });
  return ids;
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
  const ism::Values all = identities(m, primitive_of(m, part));
  for (Eigen::Index v = 0; v < all.rows(); ++v) {
    const double* const row = all.data() + v * all.cols();
    const int id = part.first_vertex + static_cast<int>(v);
    surface.same.push_back(known.insert({{row, row + all.cols()}, id}).first->second);
  }
}

/// Adds a primitive to a surface. Returns what is wrong, or an empty string.
inline std::string add_part(const tinygltf::Model& m, Part part, Surface& surface) {
  const tinygltf::Primitive& p = primitive_of(m, part);
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

// ---- Writing ------------------------------------------------------------------------------------

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

/// tinygltf writes null for a thing without properties, and then cannot read it.
template <class Items>
void name_empty(Items& items, const char* name) {
  for (auto& item : items)
    if (item == typename Items::value_type()) item.name = name;
}

/// Numbers that were added, and are not finite, have such bounds.
inline bool has_finite_bounds(const tinygltf::Model& m) {
  return std::all_of(m.accessors.begin(), m.accessors.end(), [](const tinygltf::Accessor& a) {
    return are_finite(a.minValues) && are_finite(a.maxValues);
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

/// Leaves out the things of a kind that nothing refers to.
template <class Items>
void drop_unused(tinygltf::Model& m, Items& items, const std::string& kind) {
  std::vector<int> new_id(items.size(), -1);
  for_each_reference(m, [&](int id, const char* of, std::size_t) {
    if (of == kind) at(new_id, id) = 0;
  });
  Items kept;
  for (std::size_t i = 0; i < items.size(); ++i)
    if (new_id[i] == 0) {
      new_id[i] = size_of(kept);
      kept.push_back(std::move(items[i]));
    }
  items = std::move(kept);
  for_each_reference(m, [&](int& id, const char* of, std::size_t) {
    if (of == kind) id = at(new_id, id);
  });
}

/// All buffers become one, of the bytes that are in views.
inline void join_buffers(tinygltf::Model& m) {
  std::vector<unsigned char> all;
  for (tinygltf::BufferView& view : m.bufferViews) {
    all.resize((all.size() + 3) / 4 * 4, 0);
    const unsigned char* const first = at(m.buffers, view.buffer).data.data() + view.byteOffset;
    view.buffer = 0;
    view.byteOffset = all.size();
    all.insert(all.end(), first, first + view.byteLength);
  }
  m.buffers.assign(all.empty() ? 0 : 1, tinygltf::Buffer());
  if (!all.empty()) m.buffers[0].data = std::move(all);
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

/// Adds numbers, a row per element, as `Number`: scalars, vectors or matrices by the number of
/// columns. Numbers of a type other than float are whole.
template <class Number>
int add_numbers(tinygltf::Model& m, const ism::Values& rows, int target) {
  tinygltf::Accessor a;
  a.type = rows.cols() == 1    ? TINYGLTF_TYPE_SCALAR
           : rows.cols() == 16 ? TINYGLTF_TYPE_MAT4
                               : static_cast<int>(rows.cols());  // TINYGLTF_TYPE_VEC2 is 2
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

namespace detail {

/// A file beside the glTF file; tinygltf itself would read a folder, too.
inline bool read_file(std::vector<unsigned char>* to, std::string* error, const std::string& path,
                      void*) {
  std::string bytes;
  *error = mesh_io::read_bytes(path, bytes);
  to->assign(bytes.begin(), bytes.end());
  return error->empty();
}

/// How deep brackets are in each other in the JSON of a file; tinygltf calls itself for each level.
inline int nesting(const std::string& bytes) {
  std::size_t i = 0, end = bytes.size();
  if (bytes.compare(0, 4, "glTF") == 0 && end >= 20) {
    i = 20;
    const double size = ism::detail::number_at<std::uint32_t>(bytes.data() + 12);
    end = (std::min)(end, i + static_cast<std::size_t>(size));
  }
  int depth = 0, most = 0;
  for (bool is_text = false; i < end; ++i) {
    const char c = bytes[i];
    if (c == '"') is_text = !is_text;
    if (is_text && c == '\\') ++i;  // what follows ends no text
    if (!is_text && (c == '[' || c == '{')) most = (std::max)(most, ++depth);
    if (!is_text && (c == ']' || c == '}')) --depth;
  }
  return most;
}

/// Reads the text or the bytes of a file. Returns the end of a sentence, or an empty string.
inline std::string parse(const std::string& bytes, const std::string& folder,
                         tinygltf::Model& model) {
  if (bytes.empty()) return ": the file is empty";
  if (bytes.size() > std::size_t{0xffffffff}) return ": the file is too large";
  if (nesting(bytes) > 1000) return ": no glTF 2.0 file: its brackets are nested too deeply";
  tinygltf::TinyGLTF reader;
  reader.SetImageLoader(keep_image, nullptr);
  reader.SetFsCallbacks({tinygltf::FileExists, tinygltf::ExpandFilePath, read_file,
                         tinygltf::WriteWholeFile, nullptr});
  const auto* const begin = reinterpret_cast<const unsigned char*>(bytes.data());
  const unsigned size = static_cast<unsigned>(bytes.size());
  std::string error, warning;
  try {
    if (bytes.compare(0, 4, "glTF") == 0
            ? reader.LoadBinaryFromMemory(&model, &error, &warning, begin, size, folder)
            : reader.LoadASCIIFromString(&model, &error, &warning, bytes.data(), size, folder))
      return check(model);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    error = e.what();
  }
  const bool is_compressed = bytes.find("KHR_draco_mesh_compression") != std::string::npos;
  if (is_compressed && error.find("bufferView") != std::string::npos)
    return ": its meshes are compressed (KHR_draco_mesh_compression)";
  return ": no glTF 2.0 file, or a part of one" + (error.empty() ? "" : ": " + first_line(error));
}

}  // namespace detail

inline File load(const std::string& path) {
  File file;
  file.path = path;
  std::string bytes;
  file.error = mesh_io::read_bytes(path, bytes);
  if (!file.error.empty()) return file;
  const std::string folder = std::filesystem::path(path).parent_path().string();
  const std::string wrong = detail::parse(bytes, folder, file.model);
  if (wrong.empty())
    detail::take_images(file.model);
  else
    file.error = path + wrong;
  return file;
}

inline ism::Values numbers(const tinygltf::Model& m, int accessor) {
  const tinygltf::Accessor& a = at(m.accessors, accessor);
  const std::vector<unsigned char> bytes = detail::packed(m, a);
  ism::Values rows(static_cast<Eigen::Index>(a.count), detail::columns_of(a));
  const unsigned char* from = bytes.data();
  for (double& x : rows.reshaped<Eigen::RowMajor>()) {
    x = detail::number_at(from, a.componentType, a.normalized);
    from += detail::component_size(a.componentType);
  }
  return rows;
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
  for (const int node : detail::nodes_below(m, scene_roots(m))) {
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
    const tinygltf::Primitive& p = primitive_of(m, part);
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
  std::vector<char> is_dropped(m.nodes.size(), 0);
  for (const tinygltf::Skin& skin : m.skins)
    for (const int joint : skin.joints) at(is_dropped, joint) = 1;
  detail::drop_unused(m, m.skins, "skin");
  for (const tinygltf::Skin& skin : m.skins)
    for (const int joint : skin.joints) at(is_dropped, joint) = 0;
  std::vector<tinygltf::Animation> kept;
  for (tinygltf::Animation& a : m.animations) {
    const std::vector<tinygltf::AnimationSampler> samplers = std::move(a.samplers);
    const std::vector<tinygltf::AnimationChannel> channels = std::move(a.channels);
    a.samplers.clear();
    a.channels.clear();
    for (tinygltf::AnimationChannel channel : channels) {
      if (channel.target_node >= 0 && at(is_dropped, channel.target_node) != 0) continue;
      a.samplers.push_back(at(samplers, channel.sampler));
      channel.sampler = size_of(a.samplers) - 1;
      a.channels.push_back(channel);
    }
    if (!a.channels.empty()) kept.push_back(a);
  }
  m.animations = std::move(kept);
}

inline std::string glb_text(tinygltf::Model model) {
  for (tinygltf::Image& image : model.images) {
    if (image.bufferView < 0) image.bufferView = detail::add_view(model, image.image);
    image.uri.clear();
    image.image.clear();
  }
  if (detail::is_closed_world(model)) {
    detail::drop_unused(model, model.accessors, "accessor");
    detail::drop_unused(model, model.bufferViews, "buffer view");
  }
  if (!detail::has_finite_bounds(model)) return {};
  detail::name_empty(model.nodes, "node");
  detail::name_empty(model.scenes, "scene");
  detail::name_empty(model.textures, "texture");
  detail::join_buffers(model);
  if (!model.buffers.empty() && model.buffers[0].data.size() > std::size_t{0xf0000000}) return {};
  tinygltf::TinyGLTF writer;
  std::ostringstream stream;
  return writer.WriteGltfSceneToStream(&model, stream, false, true) ? stream.str() : "";
}

}  // namespace gltf_io

#endif  // ISM_EXAMPLES_GLTF_IO_HPP

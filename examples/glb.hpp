// glb.hpp: writes surfaces as one binary glTF 2.0 file, which browsers, engines and modellers show.
//
//   glb::Object object = {"a hand", render::shape_of(mesh), {}, {0, 0, 0}};
//   mesh_io::write_files({{"hand.glb", glb::glb_text({object})}});
//
// y is up, and z comes to the viewer. Corners that differ in texture coordinates, colours or
// normals become vertices of their own, so that seams stay. Coordinates are rounded to floats.
// Source: The Khronos Group, glTF 2.0 Specification, 2021.

#ifndef ISM_EXAMPLES_GLB_HPP
#define ISM_EXAMPLES_GLB_HPP

#include "mesh_io.hpp"
#include "render.hpp"

#include <nlohmann/json.hpp>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace glb {

/// Where the vertices of a shape go, and the normals of its corners there; no rows: as for shapes.
struct Pose {
  ism::Points3 vertices;
  Eigen::MatrixXd corner_normals;
};

/// A surface as render.hpp draws it.
struct Object {
  std::string name;
  render::Shape shape;
  std::vector<Pose> morph;  // through these it moves on from `shape`, and back, for ever
  render::Vec3 place = {0, 0, 0};
};

/// The bytes of the file; none if they were more than the 4 GB that the format can hold.
inline std::string glb_text(const std::vector<Object>& objects);

namespace detail {

using Json = nlohmann::ordered_json;
using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The numbers that the format has for names.
constexpr int kFloat = 5126, kUnsigned = 5125, kVertices = 34962, kIndices = 34963;
constexpr int kLinear = 9729, kLinearMipmaps = 9987, kRepeat = 10497;

/// A colour for a screen as light, which is what a file has but for its images [IEC 61966-2-1].
inline double linear(double c) {
  return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
}

/// Rows of length 1; where there is no direction, any.
inline Eigen::MatrixXd unit_rows(Eigen::MatrixXd rows) {
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const double length = rows.row(i).norm();
    if (length > 0 && std::isfinite(length))
      rows.row(i) /= length;
    else
      rows.row(i) = Eigen::RowVector3d::UnitZ();
  }
  return rows;
}

/// Corners that are alike in all, as one vertex.
struct Split {
  std::vector<Eigen::Index> corner;   // per vertex, the first of its corners
  std::vector<std::uint32_t> vertex;  // per corner
};

inline Split split_corners(const render::Shape& shape, const Rows& attributes) {
  Split split;
  std::map<std::pair<int, std::vector<float>>, std::uint32_t> known;
  for (Eigen::Index c = 0; c < shape.triangles.size(); ++c) {
    const float* const row = attributes.data() + c * attributes.cols();
    const auto [entry, is_new] =
        known.insert({{shape.triangles(c / 3, c % 3), {row, row + attributes.cols()}},
                      static_cast<std::uint32_t>(split.corner.size())});
    if (is_new) split.corner.push_back(c);
    split.vertex.push_back(entry->second);
  }
  return split;
}

class Writer {
 public:
  void add(const Object& object) {
    const render::Shape& shape = object.shape;
    const Eigen::MatrixXd normals = normals_of(shape, {shape.vertices, shape.corner_normals});
    Rows attributes(shape.triangles.size(), 8);  // as they will be written
    attributes << normals.cast<float>(), texture_coordinates(shape), colors(shape);
    const Split split = split_corners(shape, attributes);
    Json primitive = {{"attributes", attributes_of(shape, split, attributes)},
                      {"indices", add_indices(split)},
                      {"material", add_material(object)}};
    Json mesh = {{"name", object.name}};
    for (const Pose& target : object.morph)
      primitive["targets"].push_back(morph_target(shape, target, split, normals));
    mesh["primitives"].push_back(primitive);
    if (!object.morph.empty()) {
      mesh["weights"] = std::vector<int>(object.morph.size(), 0);
      add_animation(object);
    }
    json_["meshes"].push_back(mesh);
    const render::Vec3& p = object.place;
    json_["scenes"][0]["nodes"].push_back(json_["nodes"].size());
    json_["nodes"].push_back({{"name", object.name},
                              {"mesh", json_["meshes"].size() - 1},
                              {"translation", {p.x(), p.y(), p.z()}}});
  }

  std::string text() {
    json_["buffers"].push_back({{"byteLength", bytes_.size()}});
    std::string json = json_.dump(-1, ' ', false, Json::error_handler_t::replace);
    json.resize((json.size() + 3) / 4 * 4, ' ');
    const std::size_t size = 12 + 8 + json.size() + 8 + bytes_.size();
    if (size > std::numeric_limits<std::uint32_t>::max()) return {};
    std::string glb = "glTF";
    append(2, glb);
    append(size, glb);
    append(json.size(), glb);
    glb += "JSON" + json;
    append(bytes_.size(), glb);
    return glb + std::string("BIN\0", 4) + bytes_;
  }

 private:
  static void append(std::size_t x, std::string& bytes) {
    mesh_io::detail::append_bytes(bytes, static_cast<std::uint32_t>(x), 4);
  }

  /// Of the corners, with length 1.
  static Eigen::MatrixXd normals_of(const render::Shape& shape, const Pose& pose) {
    if (pose.corner_normals.rows() > 0) return unit_rows(pose.corner_normals);
    const ism::Points3 normals = render::smooth_normals(pose.vertices, shape.triangles);
    Eigen::MatrixXd corners(shape.triangles.size(), 3);
    for (Eigen::Index c = 0; c < corners.rows(); ++c)
      corners.row(c) = normals.row(shape.triangles(c / 3, c % 3));
    return unit_rows(std::move(corners));
  }

  /// Here, v goes down, and all have to be numbers.
  static Rows texture_coordinates(const render::Shape& shape) {
    if (shape.texture == nullptr) return Rows::Zero(shape.triangles.size(), 2);
    Eigen::MatrixXd uv =
        shape.corner_uv.unaryExpr([](double x) { return std::isfinite(x) ? x : 0; });
    uv.col(1) = (1 - uv.col(1).array()).matrix();
    return uv.cast<float>();
  }

  static Rows colors(const render::Shape& shape) {
    if (shape.corner_colors.rows() == 0) return Rows::Zero(shape.triangles.size(), 3);
    return shape.corner_colors.unaryExpr(&linear).cast<float>();
  }

  /// Bytes of the buffer, from a multiple of 4; `target` says what for, 0 for images.
  std::size_t add_view(const std::string& bytes, int target) {
    Json view = {{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", bytes.size()}};
    if (target != 0) view["target"] = target;
    bytes_ += bytes;
    bytes_.resize((bytes_.size() + 3) / 4 * 4, '\0');
    json_["bufferViews"].push_back(view);
    return json_["bufferViews"].size() - 1;
  }

  /// Rows of 1 to 3 floats; `target` as for views, 0 for the values of animations.
  std::size_t add_accessor(const Rows& rows, int target) {
    static const char* const kTypes[] = {"SCALAR", "VEC2", "VEC3"};
    std::string bytes;
    for (Eigen::Index i = 0; i < rows.size(); ++i)
      mesh_io::detail::append_float(bytes, static_cast<double>(rows.data()[i]));
    Json accessor = {{"bufferView", add_view(bytes, target)},
                     {"componentType", kFloat},
                     {"count", rows.rows()},
                     {"type", kTypes[rows.cols() - 1]}};
    for (Eigen::Index k = 0; k < rows.cols(); ++k) {
      accessor["min"].push_back(rows.col(k).minCoeff());
      accessor["max"].push_back(rows.col(k).maxCoeff());
    }
    json_["accessors"].push_back(accessor);
    return json_["accessors"].size() - 1;
  }

  std::size_t add_indices(const Split& split) {
    std::string bytes;
    for (const std::uint32_t v : split.vertex) append(v, bytes);
    json_["accessors"].push_back({{"bufferView", add_view(bytes, kIndices)},
                                  {"componentType", kUnsigned},
                                  {"count", split.vertex.size()},
                                  {"type", "SCALAR"},
                                  {"min", Json::array({0})},
                                  {"max", Json::array({split.corner.size() - 1})}});
    return json_["accessors"].size() - 1;
  }

  static Rows positions_of(const render::Shape& shape, const ism::Points3& vertices,
                           const Split& split) {
    Rows rows(static_cast<Eigen::Index>(split.corner.size()), 3);
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      const Eigen::Index c = split.corner[static_cast<std::size_t>(i)];
      rows.row(i) = vertices.row(shape.triangles(c / 3, c % 3)).cast<float>();
    }
    return rows;
  }

  static Rows values_of(const Split& split, const Rows& corners) {
    Rows rows(static_cast<Eigen::Index>(split.corner.size()), corners.cols());
    for (Eigen::Index i = 0; i < rows.rows(); ++i)
      rows.row(i) = corners.row(split.corner[static_cast<std::size_t>(i)]);
    return rows;
  }

  Json attributes_of(const render::Shape& shape, const Split& split, const Rows& attributes) {
    const Rows values = values_of(split, attributes);
    Json json = {{"POSITION", add_accessor(positions_of(shape, shape.vertices, split), kVertices)},
                 {"NORMAL", add_accessor(values.leftCols(3), kVertices)}};
    if (shape.texture != nullptr)
      json["TEXCOORD_0"] = add_accessor(values.middleCols(3, 2), kVertices);
    if (shape.corner_colors.rows() > 0)
      json["COLOR_0"] = add_accessor(values.rightCols(3), kVertices);
    return json;
  }

  /// Targets are differences to the shape.
  Json morph_target(const render::Shape& shape, const Pose& pose, const Split& split,
                    const Eigen::MatrixXd& normals) {
    const Rows moved = positions_of(shape, pose.vertices - shape.vertices, split);
    const Rows turned = (normals_of(shape, pose) - normals).cast<float>();
    return {{"POSITION", add_accessor(moved, kVertices)},
            {"NORMAL", add_accessor(values_of(split, turned), kVertices)}};
  }

  std::size_t add_material(const Object& object) {
    const render::Shape& shape = object.shape;
    const double shown = shape.texture != nullptr || shape.corner_colors.rows() > 0 ? 1 : 0;
    Json surface = {{"metallicFactor", 0}, {"roughnessFactor", 0.8}};
    for (int i = 0; i < shape.color.size(); ++i)
      surface["baseColorFactor"].push_back(shown > 0 ? 1
                                                     : linear(static_cast<double>(shape.color[i])));
    surface["baseColorFactor"].push_back(1);
    if (shape.texture != nullptr)
      surface["baseColorTexture"] = {{"index", add_texture(shape.texture)}};
    json_["materials"].push_back(
        {{"name", object.name}, {"pbrMetallicRoughness", surface}, {"doubleSided", true}});
    return json_["materials"].size() - 1;
  }

  /// The number of a texture, which is written once for all objects.
  std::size_t add_texture(const render::Image* image) {
    const auto [entry, is_new] = textures_.insert({image, textures_.size()});
    if (!is_new) return entry->second;
    json_["samplers"] = Json::array({{{"magFilter", kLinear},
                                      {"minFilter", kLinearMipmaps},
                                      {"wrapS", kRepeat},
                                      {"wrapT", kRepeat}}});
    json_["images"].push_back({{"name", "texture"},
                               {"mimeType", "image/png"},
                               {"bufferView", add_view(render::png_text(*image), 0)}});
    json_["textures"].push_back({{"sampler", 0}, {"source", entry->second}});
    return entry->second;
  }

  /// From the shape through all targets, and back; a moment of rest at either end.
  void add_animation(const Object& object) {
    constexpr float kStep = 0.3f;  // seconds
    const int n = static_cast<int>(object.morph.size());
    std::vector<int> stops = {0};
    for (int i = 0; i <= n; ++i) stops.push_back(i);
    for (int i = n; i >= 0; --i) stops.push_back(i);
    const Eigen::Index count = static_cast<Eigen::Index>(stops.size());
    Rows times(count, 1), weights = Rows::Zero(count * n, 1);
    for (Eigen::Index k = 0; k < count; ++k) {
      const int stop = stops[static_cast<std::size_t>(k)];
      times(k, 0) = kStep * static_cast<float>(k);
      if (stop > 0) weights(k * n + stop - 1, 0) = 1;
    }
    const Json sampler = {{"input", add_accessor(times, 0)},
                          {"interpolation", "LINEAR"},
                          {"output", add_accessor(weights, 0)}};
    const Json target = {{"node", json_["nodes"].size()}, {"path", "weights"}};
    json_["animations"].push_back(
        {{"name", object.name},
         {"samplers", Json::array({sampler})},
         {"channels", Json::array({{{"sampler", 0}, {"target", target}}})}});
  }

  Json json_ = {{"asset", {{"version", "2.0"}, {"generator", "the examples of ism.hpp"}}},
                {"scene", 0},
                {"scenes", Json::array({{{"nodes", Json::array()}}})},
                {"nodes", Json::array()},
                {"meshes", Json::array()}};
  std::string bytes_;
  std::map<const render::Image*, std::size_t> textures_;
};

}  // namespace detail

inline std::string glb_text(const std::vector<Object>& objects) {
  detail::Writer writer;
  for (const Object& object : objects)
    if (object.shape.triangles.rows() > 0) writer.add(object);
  return writer.text();
}

}  // namespace glb

#endif  // ISM_EXAMPLES_GLB_HPP

// The glTF files of the examples, as a reader that is not ours understands them.

#include "glb.hpp"

#include "map_glb.hpp"

#include <doctest/doctest.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

namespace {

using render::Color;
using render::Image;
using render::Shape;

tinygltf::Model read(const std::string& bytes) {
  tinygltf::TinyGLTF reader;
  tinygltf::Model model;
  std::string error, warning;
  const bool is_read = reader.LoadBinaryFromMemory(
      &model, &error, &warning, reinterpret_cast<const unsigned char*>(bytes.data()),
      static_cast<unsigned int>(bytes.size()));
  CHECK(error == "");
  CHECK(warning == "");
  REQUIRE(is_read);
  return model;
}

tinygltf::Model read(const std::vector<glb::Object>& objects) {
  return read(glb::glb_text(objects));
}

/// The floats of an accessor, whose view and bounds are looked at.
glb::detail::Rows floats(const tinygltf::Model& model, int id) {
  const tinygltf::Accessor& accessor = model.accessors.at(static_cast<std::size_t>(id));
  const tinygltf::BufferView& view =
      model.bufferViews.at(static_cast<std::size_t>(accessor.bufferView));
  REQUIRE(accessor.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT);
  const int columns = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(accessor.type));
  glb::detail::Rows rows(static_cast<Eigen::Index>(accessor.count), columns);
  CHECK(view.byteOffset % 4 == 0);
  REQUIRE(view.byteLength == sizeof(float) * static_cast<std::size_t>(rows.size()));
  std::memcpy(rows.data(), &model.buffers.at(0).data.at(view.byteOffset), view.byteLength);
  for (int k = 0; k < columns; ++k) {
    CHECK(accessor.minValues.at(static_cast<std::size_t>(k)) ==
          static_cast<double>(rows.col(k).minCoeff()));
    CHECK(accessor.maxValues.at(static_cast<std::size_t>(k)) ==
          static_cast<double>(rows.col(k).maxCoeff()));
  }
  return rows;
}

const tinygltf::Primitive& primitive(const tinygltf::Model& model, std::size_t mesh) {
  return model.meshes.at(mesh).primitives.at(0);
}

glb::detail::Rows attribute(const tinygltf::Model& model, std::size_t mesh, const char* name) {
  return floats(model, primitive(model, mesh).attributes.at(name));
}

std::vector<std::uint32_t> indices(const tinygltf::Model& model, std::size_t mesh) {
  const tinygltf::Accessor& accessor =
      model.accessors.at(static_cast<std::size_t>(primitive(model, mesh).indices));
  const tinygltf::BufferView& view =
      model.bufferViews.at(static_cast<std::size_t>(accessor.bufferView));
  REQUIRE(accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT);
  CHECK(view.target == TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
  CHECK(view.byteOffset % 4 == 0);
  std::vector<std::uint32_t> ids(accessor.count);
  std::memcpy(ids.data(), &model.buffers.at(0).data.at(view.byteOffset), 4 * ids.size());
  return ids;
}

/// The unit square as two triangles.
Shape square() {
  Shape shape;
  shape.vertices.resize(4, 3);
  shape.vertices << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0;
  shape.triangles.resize(2, 3);
  shape.triangles << 0, 1, 2, 0, 2, 3;
  return shape;
}

Image small_image() {
  Image image(3, 2, Color(0, 0, 0));
  image.at(0, 0) = Color(1, 0, 0);
  image.at(2, 1) = Color(0, 0.2f, 1);
  return image;
}

/// A square with a texture that lies on it as it is.
Shape textured_square(const Image& image) {
  Shape shape = square();
  shape.texture = &image;
  shape.corner_uv.resize(6, 2);
  shape.corner_uv << 0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 1;
  return shape;
}

/// n×n squares of size `size`, bent upwards.
ism::TriangleMesh bent_grid(int n, double size, double bump) {
  ism::TriangleMesh mesh;
  mesh.vertices.resize((n + 1) * (n + 1), 3);
  mesh.triangles.resize(2 * n * n, 3);
  for (int v = 0, f = 0; v < mesh.vertices.rows(); ++v) {
    const double x = v % (n + 1) / static_cast<double>(n), y = v / (n + 1) / static_cast<double>(n);
    mesh.vertices.row(v) << size * x, size * y, size * bump * x * x * y;
    if (v % (n + 1) == n || v / (n + 1) == n) continue;
    mesh.triangles.row(f++) << v, v + 1, v + n + 2;
    mesh.triangles.row(f++) << v, v + n + 2, v + n + 1;
  }
  return mesh;
}

/// Where a node has the vertices of its mesh.
glb::detail::Rows placed(const tinygltf::Model& model, std::size_t id) {
  const std::vector<double>& t = model.nodes.at(id).translation;
  return attribute(model, static_cast<std::size_t>(model.nodes[id].mesh), "POSITION").rowwise() +
         Eigen::RowVector3d(t.at(0), t.at(1), t.at(2)).cast<float>();
}

}  // namespace

TEST_CASE("a surface has its vertices, normals, indices, name and place") {
  const tinygltf::Model model = read({{"plate", square(), {}, {1, 2, 3}}});
  CHECK(model.asset.version == "2.0");
  CHECK(model.nodes.at(0).name == "plate");
  CHECK(model.meshes.at(0).name == "plate");
  CHECK(model.nodes.at(0).translation == std::vector<double>{1, 2, 3});
  CHECK(model.scenes.at(static_cast<std::size_t>(model.defaultScene)).nodes == std::vector<int>{0});
  CHECK(attribute(model, 0, "POSITION") == square().vertices.cast<float>());
  CHECK(indices(model, 0) == std::vector<std::uint32_t>{0, 1, 2, 0, 2, 3});
  const glb::detail::Rows normals = attribute(model, 0, "NORMAL");
  for (Eigen::Index i = 0; i < 4; ++i) CHECK(normals.row(i).isApprox(Eigen::RowVector3f(0, 0, 1)));
  CHECK(primitive(model, 0).attributes.count("TEXCOORD_0") == 0);
  CHECK(primitive(model, 0).attributes.count("COLOR_0") == 0);
}

TEST_CASE("corners are one vertex unless a seam is between them") {
  const Image image = small_image();
  Shape shape = textured_square(image);
  CHECK(attribute(read({{"", shape, {}}}), 0, "POSITION").rows() == 4);
  shape.corner_uv(3, 0) = 0.25;  // of vertex 0 in the second triangle
  const tinygltf::Model model = read({{"", shape, {}}});
  const glb::detail::Rows uv = attribute(model, 0, "TEXCOORD_0");
  const glb::detail::Rows positions = attribute(model, 0, "POSITION");
  const std::vector<std::uint32_t> ids = indices(model, 0);
  REQUIRE(uv.rows() == 5);
  REQUIRE(ids.size() == 6);
  for (std::size_t c = 0; c < 6; ++c) {
    const auto i = static_cast<Eigen::Index>(c);
    const Eigen::RowVector2d wanted(shape.corner_uv(i, 0), 1 - shape.corner_uv(i, 1));
    CHECK(uv.row(ids[c]) == wanted.cast<float>());
    CHECK(positions.row(ids[c]) == shape.vertices.row(shape.triangles(i / 3, i % 3)).cast<float>());
  }
}

TEST_CASE("surfaces share the image of their texture") {
  const Image image = small_image();
  const Shape shape = textured_square(image);
  const tinygltf::Model model = read({{"one", shape, {}}, {"two", shape, {}, {2, 0, 0}}});
  REQUIRE(model.images.size() == 1);
  REQUIRE(model.textures.size() == 1);
  const tinygltf::Image& read_image = model.images[0];
  REQUIRE(read_image.width == 3);
  REQUIRE(read_image.height == 2);
  const auto channels = static_cast<std::size_t>(read_image.component);
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t k = 0; k < 3; ++k)
      CHECK(read_image.image.at(i * channels + k) ==
            std::lround(255 * image.pixels[i][static_cast<Eigen::Index>(k)]));
  for (const tinygltf::Material& material : model.materials) {
    CHECK(material.pbrMetallicRoughness.baseColorTexture.index == 0);
    CHECK(material.pbrMetallicRoughness.metallicFactor == 0);
    CHECK(material.doubleSided);
  }
}

TEST_CASE("colours of corners are kept, as light") {
  Shape shape = square();
  shape.corner_colors = Eigen::MatrixXd::Constant(6, 3, 0.5);
  shape.corner_colors.topRows(3).setConstant(1);  // another one for each triangle
  const tinygltf::Model model = read({{"", shape, {}}});
  const glb::detail::Rows colors = attribute(model, 0, "COLOR_0");
  REQUIRE(colors.rows() == 6);
  const std::vector<std::uint32_t> ids = indices(model, 0);
  for (std::size_t c = 0; c < 6; ++c)
    CHECK(colors(ids[c], 0) == doctest::Approx(c < 3 ? 1 : 0.21404).epsilon(1e-4));
  shape = square();
  shape.color = {0.5f, 0.5f, 0.5f};
  const tinygltf::Model plain = read({{"", shape, {}}});
  CHECK(plain.materials.at(0).pbrMetallicRoughness.baseColorFactor.at(0) ==
        doctest::Approx(0.21404).epsilon(1e-4));
}

TEST_CASE("a morph passes through its shapes, and its animation ends where it begins") {
  const Image image = small_image();
  const Shape shape = textured_square(image);
  std::vector<glb::Pose> shapes(3, {shape.vertices, {}});
  shapes[0].vertices.col(2).setConstant(0.5);
  shapes[1].vertices.col(0) *= 2;
  shapes[1].corner_normals = Eigen::RowVector3d(0, 3, 4).replicate(6, 1);
  shapes[2].vertices << 0, 0, 0, 0, 0, -1, 0, 1, -1, 0, 1, 0;  // turned: its normal is the x-axis
  const tinygltf::Model model = read({{"still", shape, {}}, {"moves", shape, shapes}});
  CHECK(primitive(model, 0).targets.empty());
  const auto& targets = primitive(model, 1).targets;
  REQUIRE(targets.size() == 3);
  CHECK(model.meshes.at(1).weights == std::vector<double>(3, 0));
  for (std::size_t i = 0; i < 3; ++i)
    CHECK((attribute(model, 1, "POSITION") + floats(model, targets[i].at("POSITION")))
              .isApprox(shapes[i].vertices.cast<float>()));
  const Eigen::RowVector3f wanted[] = {{0, 0, 1}, {0, 0.6f, 0.8f}, {1, 0, 0}};
  for (std::size_t i = 0; i < 3; ++i)
    CHECK((attribute(model, 1, "NORMAL") + floats(model, targets[i].at("NORMAL")))
              .isApprox(wanted[i].replicate(4, 1), 1e-6f));

  REQUIRE(model.animations.size() == 1);
  const tinygltf::AnimationChannel& channel = model.animations[0].channels.at(0);
  CHECK(channel.target_node == 1);
  CHECK(channel.target_path == "weights");
  const tinygltf::AnimationSampler& sampler =
      model.animations[0].samplers.at(static_cast<std::size_t>(channel.sampler));
  const glb::detail::Rows times = floats(model, sampler.input);
  const glb::detail::Rows values = floats(model, sampler.output);
  REQUIRE(values.rows() == 3 * times.rows());
  const Eigen::Map<const glb::detail::Rows> weights(values.data(), times.rows(), 3);
  CHECK(times(0, 0) == 0);
  for (Eigen::Index k = 1; k < times.rows(); ++k) {
    CHECK(times(k, 0) > times(k - 1, 0));
    CHECK((weights.row(k) - weights.row(k - 1)).cwiseAbs().maxCoeff() <= 1);
  }
  CHECK(weights.minCoeff() == 0);
  CHECK(weights.rowwise().sum().maxCoeff() == 1);
  CHECK(weights.colwise().maxCoeff().minCoeff() == 1);  // every shape is reached
  CHECK(weights.row(0).isZero(0));
  CHECK(weights.row(times.rows() - 1).isZero(0));
}

TEST_CASE("normals have length 1, also where there is none") {
  Shape shape = square();
  shape.triangles.row(1) << 0, 3, 3;  // vertex 3 is in no triangle with an area
  const tinygltf::Model model = read({{"", shape, {}}});
  const glb::detail::Rows normals = attribute(model, 0, "NORMAL");
  for (Eigen::Index i = 0; i < normals.rows(); ++i)
    CHECK(normals.row(i).norm() == doctest::Approx(1));
}

TEST_CASE("what has no triangle is left out") {
  Shape nothing = square();
  nothing.triangles.resize(0, 3);
  const tinygltf::Model model = read({{"nothing", nothing, {}}, {"plate", square(), {}}});
  REQUIRE(model.meshes.size() == 1);
  CHECK(model.meshes[0].name == "plate");
}

TEST_CASE("a map is shown as A, a morph that begins as A and ends as B, and B") {
  // B is three times as large, and lies on its side.
  const ism::TriangleMesh a = bent_grid(4, 1, 0);
  ism::TriangleMesh b = bent_grid(5, 3, 0.4);
  Eigen::Matrix3d turn;
  turn << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  b.vertices = ism::Points3(b.vertices * turn);
  ism::Options options;
  options.max_iterations = 2;
  const ism::Result result = ism::compute_map(a, b, {{0, 0}, {24, 35}, {4, 5}}, options);
  REQUIRE(ism::is_usable(result.status));
  const picture::Scene scene = picture::scene_of(ism::SurfaceMap(result));
  const picture::Texture texture = picture::front_texture(scene);
  const tinygltf::Model model =
      read(picture::glb_text(scene, texture, result.f, result.g, false, true));

  std::vector<std::string> names;
  for (const tinygltf::Node& node : model.nodes) names.push_back(node.name);
  const auto id = [&](const char* name) {
    const auto at = std::find(names.begin(), names.end(), name);
    REQUIRE(at != names.end());
    return static_cast<std::size_t>(at - names.begin());
  };
  const std::size_t on_a = id("A"), morph = id("from A to B"), on_b = id("B");
  CHECK(model.images.size() == 1);
  CHECK(placed(model, on_a).col(0).maxCoeff() < placed(model, morph).col(0).minCoeff());
  CHECK(placed(model, morph).col(0).maxCoeff() < placed(model, on_b).col(0).minCoeff());
  for (const auto& [heat, surface] :
       {std::pair(id("distortion of A"), on_a), std::pair(id("distortion of B"), on_b)}) {
    CHECK(placed(model, heat).col(1).maxCoeff() < placed(model, surface).col(1).minCoeff());
    CHECK(attribute(model, heat, "COLOR_0").rows() > 0);
  }

  for (const char* name : {"TEXCOORD_0", "POSITION", "NORMAL"})
    CHECK(attribute(model, on_a, name).rows() == attribute(model, morph, name).rows());
  CHECK(attribute(model, on_a, "TEXCOORD_0") == attribute(model, morph, "TEXCOORD_0"));
  CHECK(attribute(model, on_a, "TEXCOORD_0") == attribute(model, on_b, "TEXCOORD_0"));
  const auto& targets = primitive(model, morph).targets;
  for (const char* name : {"POSITION", "NORMAL"}) {
    // Up to where they are: the morph is around the mean of what is covered.
    const auto centered = [](glb::detail::Rows rows) -> glb::detail::Rows {
      return rows.rowwise() - rows.colwise().mean();
    };
    const glb::detail::Rows start = attribute(model, morph, name);
    const glb::detail::Rows end = start + floats(model, targets.back().at(name));
    CHECK(centered(attribute(model, on_a, name)).isApprox(centered(start), 1e-4f));
    CHECK(centered(attribute(model, on_b, name)).isApprox(centered(end), 1e-4f));
  }
  const glb::detail::Rows extent = attribute(model, on_b, "POSITION");
  CHECK((extent.colwise().maxCoeff() - extent.colwise().minCoeff()).maxCoeff() < 1.3f);  // area 1
}

TEST_CASE("the parts of the file are aligned and as long as they say") {
  const std::string bytes = glb::glb_text({{"a name", square(), {}}});
  const auto word = [&](std::size_t at) {
    std::uint32_t x = 0;
    for (std::size_t i = 4; i-- > 0;) x = x << 8 | static_cast<unsigned char>(bytes.at(at + i));
    return x;
  };
  CHECK(bytes.substr(0, 4) == "glTF");
  CHECK(word(8) == bytes.size());
  const std::size_t json = word(12);
  CHECK(json % 4 == 0);
  CHECK(bytes.substr(16, 4) == "JSON");
  CHECK(word(20 + json) % 4 == 0);
  CHECK(20 + json + 8 + word(20 + json) == bytes.size());
  CHECK(bytes.substr(24 + json, 4) == std::string("BIN\0", 4));
}

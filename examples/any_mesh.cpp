// any_mesh.cpp: see any_mesh.hpp. ANY_MESH_TINYGLTF and ANY_MESH_ASSIMP say what there is.

#include "any_mesh.hpp"

#include "mesh_io.hpp"

#ifdef ANY_MESH_TINYGLTF
#include "gltf_io.hpp"
#endif

#ifdef ANY_MESH_ASSIMP
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/Importer.hpp>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <string>
#include <vector>

namespace any_mesh {
namespace {

mesh_io::ReadResult failed(const std::string& error) {
  mesh_io::ReadResult result;
  result.error = error;
  return result;
}

#ifdef ANY_MESH_ASSIMP

/// Adds the triangles of one mesh; those at one place share a vertex.
class Collector {
 public:
  void add(const aiMesh& mesh) {
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices != 3) continue;
      for (int k = 0; k < 3; ++k) {
        if (face.mIndices[k] < mesh.mNumVertices)
          add_corner(mesh, face.mIndices[k]);
        else
          error_ = ": a face refers to a vertex that does not exist";
      }
    }
  }

  mesh_io::ReadResult result(const std::string& path) const {
    mesh_io::ReadResult r;
    if (!error_.empty()) return failed(path + error_);
    if (corners_.empty()) return failed(path + ": there are no faces");
    r.mesh.vertices.resize(static_cast<Eigen::Index>(points_.size()), 3);
    for (std::size_t v = 0; v < points_.size(); ++v)
      r.mesh.vertices.row(static_cast<Eigen::Index>(v)) << points_[v][0], points_[v][1],
          points_[v][2];
    r.mesh.triangles.resize(static_cast<Eigen::Index>(corners_.size() / 3), 3);
    std::copy(corners_.begin(), corners_.end(), r.mesh.triangles.data());
    if (has_uv_) {
      r.corner_uv.resize(static_cast<Eigen::Index>(uv_.size()), 2);
      for (std::size_t c = 0; c < uv_.size(); ++c)
        r.corner_uv.row(static_cast<Eigen::Index>(c)) << uv_[c][0], uv_[c][1];
    }
    r.edges = mesh_io::edges_of(r.mesh.triangles);
    r.ok = true;
    return r;
  }

 private:
  void add_corner(const aiMesh& mesh, unsigned id) {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    const aiVector3D& p = mesh.mVertices[id];
    const std::array<double, 3> point = {static_cast<double>(p.x), static_cast<double>(p.y),
                                         static_cast<double>(p.z)};
    if (!std::isfinite(point[0] + point[1] + point[2]))
      error_ = ": the position of a vertex is not finite";
    const auto [entry, is_new] = known_.insert({point, static_cast<int>(points_.size())});
    if (is_new) points_.push_back(point);
    corners_.push_back(entry->second);
    uv_.push_back({kNone, kNone});
    if (!mesh.HasTextureCoords(0)) return;
    const aiVector3D& t = mesh.mTextureCoords[0][id];
    uv_.back() = {static_cast<double>(t.x), static_cast<double>(t.y)};
    has_uv_ = true;
  }

  std::map<std::array<double, 3>, int> known_;
  std::vector<std::array<double, 3>> points_;
  std::vector<int> corners_;
  std::vector<std::array<double, 2>> uv_;
  bool has_uv_ = false;
  std::string error_;
};

mesh_io::ReadResult read_by_assimp(const std::string& path) {
  Assimp::Importer importer;
  // Validated first: on some broken files, the other steps end the program.
  const aiScene* const scene =
      importer.ReadFile(path, aiProcess_ValidateDataStructure | aiProcess_Triangulate |
                                  aiProcess_SortByPType | aiProcess_PreTransformVertices);
  if (!scene) return failed(path + ": " + importer.GetErrorString());
  Collector collector;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) collector.add(*scene->mMeshes[i]);
  return collector.result(path);
}

bool is_known_to_assimp(const std::string& extension) {
  return !extension.empty() && Assimp::Importer().IsExtensionSupported(extension);
}

#endif

}  // namespace

mesh_io::ReadResult read(const std::string& path) {
  const std::string extension = mesh_io::detail::lower_extension(path);
  for (const char* own : {".obj", ".off", ".ply", ".stl"})
    if (extension == own) return mesh_io::read_mesh(path);
  std::string bytes;
  const std::string error = mesh_io::read_bytes(path, bytes);
  if (!error.empty()) return failed(error);
  if (extension == ".glb" || extension == ".gltf") {
#ifdef ANY_MESH_TINYGLTF
    return gltf_io::read_mesh(path);
#else
    return failed(path + ": this program was built without tinygltf, which reads glTF files");
#endif
  }
#ifdef ANY_MESH_ASSIMP
  if (is_known_to_assimp(extension)) return read_by_assimp(path);
  return failed(path + ": there is no reader for files with this extension");
#else
  return failed(path +
                ": this program was built without assimp, which reads files other than OBJ, OFF, "
                "PLY, STL and glTF");
#endif
}

}  // namespace any_mesh

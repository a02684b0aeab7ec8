// any_mesh.hpp: reads meshes of all formats that this build knows. Part of the examples of ism.hpp.
//
//   mesh_io::ReadResult a = any_mesh::read("woman.glb");

#ifndef ISM_EXAMPLES_ANY_MESH_HPP
#define ISM_EXAMPLES_ANY_MESH_HPP

#include "mesh_io.hpp"

#include <string>

namespace any_mesh {

/// Reads OBJ, OFF, PLY and STL as mesh_io::read_mesh() does. glTF (.glb, .gltf) needs tinygltf, see
/// gltf_io::read_mesh(); FBX, COLLADA and others need assimp: there, corners at equal coordinates
/// are one vertex, and vertices are numbered as they first appear.
mesh_io::ReadResult read(const std::string& path);

}  // namespace any_mesh

#endif  // ISM_EXAMPLES_ANY_MESH_HPP

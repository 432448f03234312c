// SPDX-License-Identifier: MIT
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <charconv>
#include <stdexcept>

#include "world_server/scene/mesh_file.h"

namespace rikiseki::world {
namespace {

// assimp keeps 32 bits. The shortest decimal that rounds to them is what a text file said, up to its
// seventh digit: 0.03 stays 0.03.
double Exactly(float value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  double exact = 0;
  std::from_chars(text, end, exact);
  return exact;
}

Eigen::Matrix4d Exactly(const aiMatrix4x4& m) {
  Eigen::Matrix4d exact;
  for (unsigned row = 0; row < 4; ++row) {
    for (unsigned column = 0; column < 4; ++column) {
      exact(static_cast<int>(row), static_cast<int>(column)) = Exactly(m[row][column]);
    }
  }
  return exact;
}

void Collect(const aiScene& scene, const aiNode& node, const Eigen::Matrix4d& outer,
             const std::string& submesh, MeshTriangles& found) {
  const Eigen::Matrix4d pose = outer * Exactly(node.mTransformation);
  for (unsigned i = 0; i < node.mNumMeshes; ++i) {
    const aiMesh& mesh = *scene.mMeshes[node.mMeshes[i]];
    const bool wanted =
        submesh.empty() || submesh == mesh.mName.C_Str() || submesh == node.mName.C_Str();
    if (!wanted) continue;
    const auto first = static_cast<std::uint32_t>(found.corners.size());
    for (unsigned j = 0; j < mesh.mNumVertices; ++j) {
      const aiVector3D& v = mesh.mVertices[j];
      const Vec3 corner(Exactly(v.x), Exactly(v.y), Exactly(v.z));
      found.corners.push_back(pose.topLeftCorner<3, 3>() * corner + pose.topRightCorner<3, 1>());
    }
    for (unsigned j = 0; j < mesh.mNumFaces; ++j) {
      const aiFace& face = mesh.mFaces[j];
      if (face.mNumIndices != 3) continue;  // points and lines have no surface
      found.triangles.push_back(
          {first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]});
    }
  }
  for (unsigned i = 0; i < node.mNumChildren; ++i) {
    Collect(scene, *node.mChildren[i], pose, submesh, found);
  }
}

}  // namespace

MeshTriangles ReadMeshFile(const std::string& path, const std::string& submesh) {
  Assimp::Importer importer;
  // Gazebo's models are made for their axes as they are, whatever "up" the file names.
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  const aiScene* scene = importer.ReadFile(path, aiProcess_Triangulate);
  if (scene == nullptr || scene->mRootNode == nullptr) {
    throw std::runtime_error(importer.GetErrorString());
  }
  MeshTriangles found;
  Collect(*scene, *scene->mRootNode, Eigen::Matrix4d::Identity(), submesh, found);
  if (found.triangles.empty()) {
    throw std::runtime_error(submesh.empty() ? "it has no triangles"
                                             : "it has no part called '" + submesh + "'");
  }
  return found;
}

}  // namespace rikiseki::world

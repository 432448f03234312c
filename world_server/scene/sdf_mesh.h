// SPDX-License-Identifier: MIT
// The <mesh> of a collision: found on this machine, scaled, and made a hull where it moves.
#pragma once

#include <map>
#include <sdf/Mesh.hh>
#include <string>
#include <vector>

#include "world_server/scene/scene.h"

namespace rikiseki::world {

class SdfMeshes {
 public:
  /// `folder` is the scene's; what is wrong with a mesh but can be used is appended to `warnings`.
  SdfMeshes(std::string folder, std::vector<std::string>& warnings)
      : folder_(std::move(folder)), warnings_(warnings) {}

  /// A Mesh where the body is fixed, else a Hull. The same file is read once. Throws ConfigError with
  /// file and line.
  Shape Read(const sdf::Mesh& mesh, bool fixed);

 private:
  std::string Find(const sdf::Mesh& mesh) const;
  Shape Make(const sdf::Mesh& mesh, const std::string& path, bool fixed);
  void WarnOfFlaws(const sdf::Mesh& mesh, const TriangleMesh& triangles);

  std::string folder_;
  std::vector<std::string>& warnings_;
  std::map<std::string, Shape> known_;
};

}  // namespace rikiseki::world

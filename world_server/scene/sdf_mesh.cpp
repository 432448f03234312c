// SPDX-License-Identifier: MIT
#include "world_server/scene/sdf_mesh.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "common/sha256.h"
#include "world_server/geometry/convex_hull.h"
#include "world_server/scene/mesh_file.h"
#include "world_server/scene/sdf_element.h"

namespace rikiseki::world {
namespace {

namespace fs = std::filesystem;

constexpr double kSameVolume = 1e-3;  // of a hull and its mesh: what a fine tessellation may lack

std::array<std::uint8_t, 32> DigestOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(file), {}};
  return Sha256(bytes);
}

std::string Text(const Vec3& v) {
  return std::to_string(v.x()) + " " + std::to_string(v.y()) + " " + std::to_string(v.z());
}

}  // namespace

std::string SdfMeshes::Find(const sdf::Mesh& mesh) const {
  const std::string uri = mesh.Uri();
  const fs::path beside = fs::absolute(mesh.FilePath()).parent_path();
  std::vector<fs::path> places;
  if (uri.starts_with("model://")) {
    const std::string rest = uri.substr(8);
    // Beside the scene; beside the model's own folder, where it was included from.
    places = {fs::path(folder_) / rest, beside / rest, beside.parent_path() / rest};
  } else if (uri.starts_with("file://")) {
    places = {uri.substr(7)};
  } else if (uri.find("://") != std::string::npos) {
    Refuse(mesh.Element(), "the mesh " + uri + ": only files of this machine are read");
  } else {
    places = {beside / uri};
  }
  for (const fs::path& place : places) {
    if (fs::is_regular_file(place)) return place.lexically_normal().string();
  }
  Refuse(mesh.Element(), "the mesh " + uri + " is not there; looked for " + places[0].string());
}

Shape SdfMeshes::Read(const sdf::Mesh& mesh, bool fixed) {
  const std::string path = Find(mesh);
  const std::string key = path + "\n" + mesh.Submesh() + (mesh.CenterSubmesh() ? " c " : " ") +
                          Text(FromSdf(mesh.Scale())) + (fixed ? " fixed" : "");
  const auto known = known_.find(key);
  if (known != known_.end()) return known->second;
  try {
    return known_.emplace(key, Make(mesh, path, fixed)).first->second;
  } catch (const std::runtime_error& error) {
    Refuse(mesh.Element(), "the mesh " + path + " cannot be read: " + error.what());
  } catch (const std::invalid_argument& error) {
    Refuse(mesh.Element(), "the mesh " + path + " cannot be used: " + error.what());
  }
}

Shape SdfMeshes::Make(const sdf::Mesh& mesh, const std::string& path, bool fixed) {
  const Vec3 scale = FromSdf(mesh.Scale());
  for (const double factor : scale) Positive(mesh.Element(), "the scale of a mesh", factor);
  MeshTriangles read = ReadMeshFile(path, mesh.Submesh());
  Vec3 middle = Vec3::Zero();
  if (mesh.CenterSubmesh() && !mesh.Submesh().empty()) {
    Bounds bounds;
    for (const Vec3& corner : read.corners) bounds.Add(corner);
    middle = (bounds.low + bounds.high) / 2;
  }
  for (Vec3& corner : read.corners) corner = scale.cwiseProduct(corner - middle);
  auto triangles = std::make_shared<const TriangleMesh>(read.corners, read.triangles);
  const bool inside_out = triangles->flaws().closed() && triangles->Volume() < 0;
  if (inside_out) {
    for (Triangle& triangle : read.triangles) std::swap(triangle[0], triangle[1]);
    triangles = std::make_shared<const TriangleMesh>(read.corners, read.triangles);
  }
  const MeshFile file{.path = path, .sha256 = DigestOf(path), .scale = scale};
  if (fixed) {
    WarnOfFlaws(mesh, *triangles);
    return Mesh{.mesh = triangles, .file = file};
  }
  auto hull = std::make_shared<const TriangleMesh>(ConvexHull(triangles->corners()));
  const bool same = triangles->flaws().closed() &&
                    std::abs(hull->Volume() - triangles->Volume()) <= kSameVolume * hull->Volume();
  if (!same) {
    warnings_.push_back(PlaceOf(mesh.Element()) + ": the mesh " + mesh.Uri() +
                        " moves and is not convex: its convex hull is used");
  }
  return Hull{.mesh = hull, .file = file};
}

void SdfMeshes::WarnOfFlaws(const sdf::Mesh& mesh, const TriangleMesh& triangles) {
  const MeshFlaws& flaws = triangles.flaws();
  const std::string which = PlaceOf(mesh.Element()) + ": the mesh " + mesh.Uri();
  if (flaws.crowded_edges + flaws.twisted_edges > 0) {
    warnings_.push_back(which + " has " +
                        std::to_string(flaws.crowded_edges + flaws.twisted_edges) +
                        " edges that do not join two triangles facing the same way: what is inside "
                        "there is not defined");
  }
  if (flaws.open_edges > 0) {
    warnings_.push_back(
        which + " is open at " + std::to_string(flaws.open_edges) +
        " edges: it is solid behind its triangles, as deep as the finger can reach");
  }
}

}  // namespace rikiseki::world

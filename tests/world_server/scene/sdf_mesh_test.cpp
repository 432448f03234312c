// SPDX-License-Identifier: MIT
// <mesh> collisions, through the loader.
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "common/config.h"
#include "world_server/features/nearest_point.h"
#include "world_server/scene/sdf_loader.h"

namespace rikiseki::world {
namespace {

namespace fs = std::filesystem;

// An L of two legs, 0.03 thick: a floor with its top at z = 0 and a wall with its face at x = 0.
const char* const kCornerObj = R"(o corner
v 0 -0.2 0
v 0 -0.2 0.2
v -0.03 -0.2 0.2
v -0.03 -0.2 -0.03
v 0.3 -0.2 -0.03
v 0.3 -0.2 0
v 0 0.2 0
v 0 0.2 0.2
v -0.03 0.2 0.2
v -0.03 0.2 -0.03
v 0.3 0.2 -0.03
v 0.3 0.2 0
f 1 7 8 2
f 2 8 9 3
f 3 9 10 4
f 4 10 11 5
f 5 11 12 6
f 6 12 7 1
f 1 2 3 4
f 1 4 5 6
f 7 10 9 8
f 7 12 11 10
)";

const char* const kTetrahedronStl = R"(solid t
facet normal 0 0 -1
 outer loop
  vertex 0 0 0
  vertex 0 0.1 0
  vertex 0.1 0 0
 endloop
endfacet
facet normal 0 -1 0
 outer loop
  vertex 0 0 0
  vertex 0.1 0 0
  vertex 0 0 0.1
 endloop
endfacet
facet normal -1 0 0
 outer loop
  vertex 0 0 0
  vertex 0 0 0.1
  vertex 0 0.1 0
 endloop
endfacet
facet normal 1 1 1
 outer loop
  vertex 0.1 0 0
  vertex 0 0.1 0
  vertex 0 0 0.1
 endloop
endfacet
endsolid t
)";

// Two parts in millimetres; `box` has one triangle, turned by its node, z up.
const char* const kTwoPartsDae = R"(<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="millimeter" meter="0.001"/><up_axis>Z_UP</up_axis></asset>
<library_geometries>
<geometry id="a" name="a"><mesh><source id="ap"><float_array id="apa" count="9">0 0 0 1 0 0 0 1 0
</float_array><technique_common><accessor source="#apa" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="av"><input semantic="POSITION" source="#ap"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#av" offset="0"/><p>0 1 2</p></triangles></mesh></geometry>
<geometry id="b" name="b"><mesh><source id="bp"><float_array id="bpa" count="9">0 0 5 30 0 5 0 1 5
</float_array><technique_common><accessor source="#bpa" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="bv"><input semantic="POSITION" source="#bp"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#bv" offset="0"/><p>0 1 2</p></triangles></mesh></geometry>
</library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="na" name="na"><instance_geometry url="#a"/></node>
<node id="nb" name="nb"><instance_geometry url="#b"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
)";

class Folder {
 public:
  Folder() : path_(fs::temp_directory_path() / ("rikiseki_mesh_" + std::to_string(getpid()))) {
    fs::remove_all(path_);
    Write("corner.obj", kCornerObj);
    Write("models/tet/meshes/tet.stl", kTetrahedronStl);
    Write("two.dae", kTwoPartsDae);
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::string Write(const std::string& name, const std::string& text) const {
    fs::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name) << text;
    return path_ / name;
  }

  LoadedScene Load(const std::string& mesh, bool fixed = true) const {
    return LoadSdf(Write("scene.sdf",
                         std::string("<sdf version=\"1.9\"><world name=\"w\">\n"
                                     "<model name=\"m\"><static>") +
                             (fixed ? "true" : "false") +
                             "</static><link name=\"l\"><inertial><mass>1</mass></inertial>\n"
                             "<collision name=\"c\"><geometry><mesh>" +
                             mesh + "</mesh></geometry></collision></link></model></world></sdf>"));
  }

  std::string Refusal(const std::string& mesh) const {
    try {
      Load(mesh);
    } catch (const ConfigError& error) {
      const std::string what = error.what();
      return what.substr(what.find("scene.sdf"));
    }
    return "accepted";
  }

 private:
  fs::path path_;
};

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("a mesh is read to the last digit of its file, scaled, and keeps its corner") {
  const Folder folder;
  const LoadedScene loaded = folder.Load("<uri>corner.obj</uri><scale>1 1 2</scale>");
  CHECK(loaded.warnings.empty());
  const auto& mesh = std::get<Mesh>(loaded.scene.bodies.at(0).colliders.at(0).shape);
  CHECK(mesh.mesh->flaws().closed());
  CHECK(mesh.mesh->bounds().low == Vec3(-0.03, -0.2, -0.06));
  CHECK(mesh.mesh->bounds().high == Vec3(0.3, 0.2, 0.4));
  CHECK(mesh.file.scale == Vec3(1, 1, 2));
  CHECK(mesh.file.path.ends_with("/corner.obj"));
  CHECK(mesh.file.sha256[0] != mesh.file.sha256[1]);
  // Both walls of the corner, and with the very digits of the file.
  std::vector<NearestPoint> found;
  FindFeatures(mesh, Vec3(0.012, 0.01, 0.007), 0.03, found);
  REQUIRE(found.size() == 2);
  CHECK(std::abs(found[0].distance - 0.007) < 1e-15);
  CHECK(std::abs(found[1].distance - 0.012) < 1e-15);
  CHECK((found[1].normal - Vec3::UnitX()).norm() < 1e-15);
}

TEST_CASE("a mesh that moves is its convex hull, which is said where it differs") {
  const Folder folder;
  const LoadedScene corner = folder.Load("<uri>corner.obj</uri>", /*fixed=*/false);
  REQUIRE(corner.warnings.size() == 1);
  CHECK(Contains(
      corner.warnings[0],
      "scene.sdf:3: the mesh corner.obj moves and is not convex: its convex hull is used"));
  const auto& hull = std::get<Hull>(corner.scene.bodies.at(0).colliders.at(0).shape);
  CHECK(hull.mesh->corners().size() == 10);
  const LoadedScene tet =
      folder.Load("<uri>model://models/tet/meshes/tet.stl</uri>", /*fixed=*/false);
  CHECK(tet.warnings.empty());
  const auto& tetrahedron = std::get<Hull>(tet.scene.bodies.at(0).colliders.at(0).shape);
  CHECK(tetrahedron.mesh->Volume() == Approx(0.001 / 6).epsilon(1e-12));
}

TEST_CASE("units, axes and parts of a DAE file") {
  const Folder folder;
  const auto bounds = [&](const std::string& more) {
    const LoadedScene loaded = folder.Load("<uri>two.dae</uri>" + more);
    REQUIRE(loaded.warnings.size() == 1);
    CHECK(Contains(loaded.warnings[0], "is open at"));
    return std::get<Mesh>(loaded.scene.bodies.at(0).colliders.at(0).shape).mesh->bounds();
  };
  // Millimetres; z stays up, as Gazebo has it.
  CHECK((bounds("").high - Vec3(0.03, 0.001, 0.005)).norm() < 1e-12);
  CHECK((bounds("<submesh><name>b</name></submesh>").low - Vec3(0, 0, 0.005)).norm() < 1e-12);
  const Bounds centred = bounds("<submesh><name>b</name><center>true</center></submesh>");
  CHECK((centred.low + centred.high).norm() < 1e-12);
  CHECK(Contains(folder.Refusal("<uri>two.dae</uri><submesh><name>none</name></submesh>"),
                 "it has no part called 'none'"));
}

TEST_CASE("a mesh inside out is turned, and one that cannot be used is refused with its line") {
  const Folder folder;
  std::string inverted = kCornerObj;
  inverted = inverted.substr(0, inverted.find("f 1"));
  for (const char* face : {"2 8 7 1", "3 9 8 2", "4 10 9 3", "5 11 10 4", "6 12 11 5", "1 7 12 6",
                           "4 3 2 1", "6 5 4 1", "8 9 10 7", "10 11 12 7"}) {
    inverted += std::string("f ") + face + "\n";
  }
  folder.Write("inverted.obj", inverted);
  const LoadedScene loaded = folder.Load("<uri>inverted.obj</uri>");
  CHECK(std::get<Mesh>(loaded.scene.bodies.at(0).colliders.at(0).shape).mesh->Volume() > 0);

  CHECK(Contains(folder.Refusal("<uri>none.obj</uri>"),
                 "scene.sdf:3: the mesh none.obj is not there; looked for /"));
  CHECK(Contains(folder.Refusal("<uri>https://example.org/a.obj</uri>"),
                 "scene.sdf:3: the mesh https://example.org/a.obj: only files of this machine"));
  CHECK(Contains(folder.Refusal("<uri>scene.sdf</uri>"), "cannot be read: "));
  CHECK(Contains(folder.Refusal("<uri>corner.obj</uri><scale>1 0 1</scale>"),
                 "scene.sdf:3: the scale of a mesh = 0.000000: a number above 0"));
  folder.Write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
  CHECK(
      Contains(folder.Refusal("<uri>flat.obj</uri>"), "cannot be used: no triangle with an area"));
}

}  // namespace rikiseki::world

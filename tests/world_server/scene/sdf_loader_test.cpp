// SPDX-License-Identifier: MIT
#include "world_server/scene/sdf_loader.h"

#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <thread>
#include <vector>

#include "common/config.h"

namespace rikiseki::world {
namespace {

namespace fs = std::filesystem;

// A folder of its own for each case; gone afterwards.
class Folder {
 public:
  Folder() : path_(fs::temp_directory_path() / ("rikiseki_sdf_" + std::to_string(getpid()))) {
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  std::string Write(const std::string& name, const std::string& text) const {
    fs::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name) << text;
    return path_ / name;
  }
  std::string Path(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

// Lines 1 and 2 are the frame's: what is given starts in line 3.
std::string World(const std::string& content) {
  return "<sdf version=\"1.9\">\n<world name=\"w\">\n" + content + "\n</world></sdf>";
}
const std::string kInertial =
    "<inertial><mass>2</mass><inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.25</izz></inertia></"
    "inertial>";
const std::string kBox = "<geometry><box><size>0.2 0.4 0.6</size></box></geometry>";

std::string MovingLink(const std::string& more) {
  return "<model name=\"m\"><link name=\"l\">" + kInertial + "\n" + more + "</link></model>";
}

LoadedScene LoadText(const std::string& text) {
  const Folder folder;
  return LoadSdf(folder.Write("scene.sdf", text));
}

// The refusal without the folder, and nothing on standard error.
std::string Refusal(const std::string& text) {
  const Folder folder;
  const std::string path = folder.Write("scene.sdf", text);
  std::ostringstream spilled;
  std::streambuf* before = std::cerr.rdbuf(spilled.rdbuf());
  std::string refusal = "accepted";
  try {
    LoadSdf(path);
  } catch (const ConfigError& error) {
    refusal = error.what();
    CHECK(error.exit_code() == kExitConfig);
  }
  std::cerr.rdbuf(before);
  CHECK(spilled.str() == "");
  CHECK(refusal.find('\n') == std::string::npos);
  const auto at = refusal.find(path);
  return at == 0 ? refusal.substr(path.size() - std::string("scene.sdf").size()) : refusal;
}

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("the shipped scene is the task of the paper") {
  const LoadedScene loaded = LoadSdf(std::string(RIKISEKI_SOURCE_DIR) + "/config/scenes/push.sdf");
  CHECK(loaded.warnings.empty());
  const Scene& scene = loaded.scene;
  CHECK(scene.name == "push");
  CHECK(scene.gravity == Vec3(0, 0, -9.81));
  REQUIRE(scene.bodies.size() == 2);
  const SceneBody& floor = scene.bodies[0];
  const SceneBody& cube = scene.bodies[1];
  CHECK(floor.fixed);
  CHECK(std::holds_alternative<HalfSpace>(floor.colliders.at(0).shape));
  CHECK((floor.pose_WB * floor.colliders[0].pose_BS).position.z() == -0.03);
  CHECK(floor.colliders[0].friction == 0.3);
  CHECK(cube.name == "cube::link");
  CHECK_FALSE(cube.fixed);
  CHECK(std::get<Box>(cube.colliders.at(0).shape).half_extents == Vec3(0.03, 0.03, 0.03));
  // Uniform: m a^2 / 6.
  CHECK((cube.inertia - Mat3::Identity() * cube.mass_kg * 0.06 * 0.06 / 6).norm() < 1e-15);
  // It stands on the floor, and a finger of 10 mm at x = -50 mm is 10 mm from its face.
  CHECK(cube.pose_WB.position == Vec3::Zero());
  CHECK(-0.03 - (-0.05 + 0.01) == Approx(0.01));
  CHECK_FALSE(cube.colliders[0].stiffness_n_per_m.has_value());
}

TEST_CASE("every shape is read") {
  std::string links;
  for (const char* geometry :
       {"<box><size>0.2 0.4 0.6</size></box>", "<sphere><radius>0.3</radius></sphere>",
        "<cylinder><radius>0.1</radius><length>0.4</length></cylinder>",
        "<capsule><radius>0.1</radius><length>0.4</length></capsule>",
        "<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>",
        "<plane><normal>0 3 4</normal><size>1 1</size></plane>"}) {
    links += "<collision name=\"c" + std::to_string(links.size()) + "\"><geometry>" + geometry +
             "</geometry></collision>";
  }
  const Scene scene = LoadText(World("<model name=\"m\"><static>1</static><link name=\"l\">" +
                                     links + "</link></model>"))
                          .scene;
  REQUIRE(scene.bodies.size() == 1);
  const auto& colliders = scene.bodies[0].colliders;
  REQUIRE(colliders.size() == 6);
  CHECK(std::get<Box>(colliders[0].shape).half_extents == Vec3(0.1, 0.2, 0.3));
  CHECK(std::get<Sphere>(colliders[1].shape).radius == 0.3);
  CHECK(std::get<Cylinder>(colliders[2].shape).half_length == 0.2);
  CHECK(std::get<Capsule>(colliders[3].shape).half_length == 0.2);
  CHECK(std::get<Ellipsoid>(colliders[4].shape).radii == Vec3(0.1, 0.2, 0.3));
  CHECK((std::get<HalfSpace>(colliders[5].shape).normal - Vec3(0, 0.6, 0.8)).norm() < 1e-15);
  CHECK(colliders[0].friction == 1);  // SDF's default
}

TEST_CASE("poses nest, frames are followed, and a body sits at its centre of mass") {
  const std::string link =
      "<link name=\"l\"><pose relative_to=\"f\">0 0 1 0 0 0</pose>"
      "<inertial><pose>0.5 0 0 0 0 1.5707963267948966</pose><mass>2</mass>"
      "<inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.25</izz></inertia></inertial>"
      "<collision name=\"c\"><pose>0.7 0 0 0 0 0</pose>" +
      kBox + "</collision></link>";
  const Scene scene =
      LoadText(World("<model name=\"outer\"><pose>10 0 0 0 0 1.5707963267948966</pose>"
                     "<model name=\"inner\"><pose>1 0 0 0 0 0</pose><frame name=\"f\"><pose>0 2 0 "
                     "0 0 0</pose></frame>" +
                     link + "</model></model>"))
          .scene;
  REQUIRE(scene.bodies.size() == 1);
  const SceneBody& body = scene.bodies[0];
  CHECK(body.name == "outer::inner::l");
  // Link at (1, 2, 1) in `outer`, its centre of mass 0.5 further along x; `outer` is turned by 90
  // degrees.
  CHECK((body.pose_WB.position - Vec3(10 - 2, 1.5, 1)).norm() < 1e-12);
  CHECK((body.pose_WB.orientation * Vec3::UnitX() - Vec3::UnitY()).norm() < 1e-12);
  CHECK((body.colliders[0].pose_BS.position - Vec3(0.2, 0, 0)).norm() < 1e-12);
  // The inertial frame is turned by 90 degrees in the link: x and y change places.
  CHECK((body.inertia - Mat3(Vec3(0.2, 0.1, 0.25).asDiagonal())).norm() < 1e-12);
}

TEST_CASE("several links of a model are several bodies, static ones fixed") {
  const std::string collision = "<collision name=\"c\">" + kBox + "</collision>";
  const LoadedScene loaded =
      LoadText(World("<model name=\"a\"><self_collide>true</self_collide><link name=\"x\">" +
                     kInertial + collision + "</link><link name=\"y\">" + kInertial + collision +
                     "</link></model>"
                     "<model name=\"b\"><static>true</static><link name=\"z\">" +
                     collision + "</link><link name=\"only_seen\"/></model>"));
  REQUIRE(loaded.scene.bodies.size() == 3);
  CHECK(loaded.warnings.empty());
  CHECK_FALSE(loaded.scene.bodies[1].fixed);
  CHECK(loaded.scene.bodies[1].mass_kg == 2);
  CHECK(loaded.scene.bodies[2].fixed);
}

TEST_CASE("surfaces: friction, and stiffness only where the file gives it") {
  const auto collider = [](const std::string& surface) {
    return LoadText(World(MovingLink("<collision name=\"c\">" + kBox + "<surface>" + surface +
                                     "</surface></collision>")))
        .scene.bodies.at(0)
        .colliders.at(0);
  };
  CHECK(collider("<friction><ode><mu>0.4</mu></ode></friction>").friction == 0.4);
  CHECK(collider("<friction><ode><mu>0.4</mu><mu2>0.4</mu2></ode></friction>").friction == 0.4);
  CHECK(collider("<friction><bullet><friction>0.2</friction></bullet></friction>").friction == 0.2);
  CHECK(collider("<friction><ode/></friction>").friction == 1);
  CHECK_FALSE(collider("<contact><ode/></contact>").stiffness_n_per_m.has_value());
  const Collider soft = collider("<contact><ode><kp>800</kp><kd>3</kd></ode></contact>");
  CHECK(soft.stiffness_n_per_m == 800);
  CHECK(soft.damping_ns_per_m == 3);
  CHECK_FALSE(
      collider("<contact><ode><kp>1e12</kp></ode></contact>").stiffness_n_per_m.has_value());
}

namespace {

// A static box whose <surface> holds `content`, which starts in line 5.
std::string Surface(const std::string& content) {
  return "<sdf version=\"1.9\" xmlns:rikiseki=\"urn:rikiseki\">\n<world name=\"w\">\n"
         "<model name=\"m\"><static>1</static><link name=\"l\"><collision name=\"c\">" +
         kBox + "\n<surface><friction><ode><mu>0.3</mu></ode></friction>\n" + content +
         "\n</surface></collision></link></model></world></sdf>";
}

}  // namespace

TEST_CASE("what SDF has no word for is read from rikiseki elements") {
  const auto collider = [](const std::string& content) {
    const LoadedScene loaded = LoadText(Surface(content));
    CHECK(loaded.warnings.empty());
    return loaded.scene.bodies.at(0).colliders.at(0);
  };
  const Collider plain = collider("");
  CHECK_FALSE(plain.static_friction.has_value());
  CHECK(plain.recovery_s == 0);
  const Collider both = collider(
      "<rikiseki:static_friction>0.45</rikiseki:static_friction>\n"
      "<rikiseki:recovery_s>0.2</rikiseki:recovery_s>");
  CHECK(both.friction == 0.3);
  CHECK(both.static_friction == 0.45);
  CHECK(both.recovery_s == 0.2);
}

TEST_CASE("a wrong rikiseki element is refused with file, line, name and what would be right") {
  const auto refused = [](const std::string& content, const std::string& part) {
    const std::string refusal = Refusal(Surface(content));
    CAPTURE(refusal);
    CHECK(refusal.starts_with("scene.sdf:6: <rikiseki:"));
    CHECK(Contains(refusal, part));
  };
  refused("\n<rikiseki:static_friction>0.2</rikiseki:static_friction>",
          "a number from 0.3, its <mu>, to 100 is expected");
  refused("\n<rikiseki:static_friction>much</rikiseki:static_friction>", "= 'much'");
  refused("\n<rikiseki:static_friction>inf</rikiseki:static_friction>", "is expected");
  refused("\n<rikiseki:recovery_s>0</rikiseki:recovery_s>", "above 0, to 10 is expected");
  refused("\n<rikiseki:recovery_s>200 ms</rikiseki:recovery_s>", "= '200 ms'");
  refused("\n<rikiseki:recovery_s></rikiseki:recovery_s>", "= ''");
  refused(
      "<rikiseki:recovery_s>1</rikiseki:recovery_s>\n<rikiseki:recovery_s>1</rikiseki:recovery_s>",
      "stands twice");
  refused("\n<rikiseki:softness>1</rikiseki:softness>",
          "<rikiseki:static_friction> and <rikiseki:recovery_s> in the <surface> of a collision, "
          "<rikiseki:drag> and <rikiseki:angular_drag> in the <link> of a model, ");
  // Known, but in the wrong place.
  const std::string misplaced = Refusal(
      World("<model name=\"m\"><static>1</static>\n<rikiseki:recovery_s>1</rikiseki:recovery_s>"
            "<link name=\"l\"><collision name=\"c\">" +
            kBox + "</collision></link></model>"));
  CAPTURE(misplaced);
  CHECK(misplaced.starts_with("scene.sdf:4: <rikiseki:recovery_s> in <model> means nothing"));
}

TEST_CASE("air, wind, gravity and bounce of a link are read") {
  const auto load = [](const std::string& link, const std::string& world) {
    return LoadText("<sdf version=\"1.9\" xmlns:rikiseki=\"urn:rikiseki\">\n<world name=\"w\">\n" +
                    world +
                    MovingLink(link + "<collision name=\"c\">" + kBox +
                               "<surface><bounce><restitution_coefficient>0.7"
                               "</restitution_coefficient></bounce></surface></collision>") +
                    "</world></sdf>");
  };
  const std::string wind = "<wind><linear_velocity>1 2 3</linear_velocity></wind>";
  const std::string drag =
      "<rikiseki:drag>0.5</rikiseki:drag><rikiseki:angular_drag>0.01</rikiseki:angular_drag>";
  const LoadedScene plain = load("", wind);
  CHECK(plain.warnings.empty());
  CHECK(plain.scene.bodies[0].falls);
  CHECK(plain.scene.bodies[0].drag_ns_per_m == 0);
  CHECK(plain.scene.bodies[0].wind == Vec3::Zero());  // no <enable_wind>
  CHECK(plain.scene.bodies[0].colliders[0].restitution == 0.7);
  const LoadedScene all =
      load(drag + "<enable_wind>true</enable_wind><gravity>false</gravity>", wind);
  CHECK(all.warnings.empty());
  CHECK_FALSE(all.scene.bodies[0].falls);
  CHECK(all.scene.bodies[0].drag_ns_per_m == 0.5);
  CHECK(all.scene.bodies[0].angular_drag_nms == 0.01);
  CHECK(all.scene.bodies[0].wind == Vec3(1, 2, 3));
  const LoadedScene useless = load("<enable_wind>true</enable_wind>", wind);
  REQUIRE(useless.warnings.size() == 1);
  CHECK(Contains(useless.warnings[0], "the wind does not act on link m::l"));
}

TEST_CASE("an included model is found beside the scene") {
  const Folder folder;
  folder.Write(
      "thing/model.config",
      "<?xml version=\"1.0\"?><model><name>t</name><sdf version=\"1.9\">m.sdf</sdf></model>");
  folder.Write("thing/m.sdf", "<sdf version=\"1.9\"><model name=\"t\"><link name=\"l\">" +
                                  kInertial + "<collision name=\"c\">" + kBox +
                                  "</collision></link></model></sdf>");
  const std::string path = folder.Write(
      "scene.sdf",
      World("<include><name>one</name><uri>model://thing</uri><pose>1 2 3 0 0 0</pose></include>"));
  const Scene scene = LoadSdf(path).scene;
  REQUIRE(scene.bodies.size() == 1);
  CHECK(scene.bodies[0].name == "one::l");
  CHECK(scene.bodies[0].pose_WB.position == Vec3(1, 2, 3));
}

TEST_CASE("what is not used is named with its line") {
  const std::string body = MovingLink(
      "<collision name=\"c\">" + kBox +
      "<surface><contact><ode><max_vel>1</max_vel></ode></contact></surface></collision>\n"
      "<sensor name=\"s\" type=\"imu\"/><visual name=\"v\">" +
      kBox + "</visual>");
  const LoadedScene loaded =
      LoadText(World("<light name=\"sun\" type=\"point\"/>\n<plugin name=\"p\" filename=\"f\"/>\n"
                     "<physics type=\"ode\"><max_step_size>0.1</max_step_size></physics>\n" +
                     body));
  REQUIRE(loaded.warnings.size() == 4);
  CHECK(Contains(loaded.warnings[0], "scene.sdf:4: <plugin> in <world> is not used"));
  CHECK(Contains(loaded.warnings[1], "scene.sdf:5: <physics> in <world> is not used"));
  CHECK(Contains(loaded.warnings[2], "scene.sdf:7: <max_vel> in <ode> is not used"));
  CHECK(Contains(loaded.warnings[3], "scene.sdf:8: <sensor> in <link> is not used"));
}

TEST_CASE("what changes the motion a little is done nearly, and said") {
  const LoadedScene loaded = LoadText(World(MovingLink(
      "<collision name=\"c\">" + kBox +
      "<surface><friction><ode><mu>100</mu>\n<mu2>50</mu2></ode></friction></surface></collision>\n"
      "<velocity_decay><linear>0.1</linear></velocity_decay>")));
  CHECK(loaded.scene.bodies[0].colliders[0].friction == 75);
  CHECK(loaded.scene.bodies[0].drag_ns_per_m == 0);
  REQUIRE(loaded.warnings.size() == 2);
  CHECK(Contains(loaded.warnings[0],
                 "scene.sdf:6: <velocity_decay> means another thing in each engine and is not "
                 "used; <rikiseki:drag>"));
  CHECK(Contains(loaded.warnings[1], "scene.sdf:5: <mu2> differs from <mu>"));
}

TEST_CASE("SDF's defaults are used, and said where they matter") {
  const LoadedScene loaded =
      LoadText(World("<model name=\"m\"><link name=\"l\"><collision name=\"c\">" + kBox +
                     "</collision></link></model>"));
  CHECK(loaded.scene.bodies[0].mass_kg == 1);
  CHECK(loaded.scene.gravity == Vec3(0, 0, -9.8));
  REQUIRE(loaded.warnings.size() == 1);
  CHECK(Contains(loaded.warnings[0], "scene.sdf:3: link m::l has no <inertial>"));
}

TEST_CASE("refusals: one line with file, line, what is wrong and what would be right") {
  const std::string box = "<collision name=\"c\">" + kBox + "</collision>";
  const std::string end = "; an SDFormat world (sdformat.org) is expected";
  CHECK(Refusal("<sdf version=\"1.9\">\n<world name=\"w\">\n</sdf>") ==
        "scene.sdf:2: broken XML, XML_ERROR_MISMATCHED_ELEMENT: XMLElement name=world" + end);
  CHECK(Refusal("hello") == "scene.sdf:1: broken XML, XML_ERROR_PARSING_TEXT" + end);
  CHECK(Refusal("") == "scene.sdf: broken XML, XML_ERROR_EMPTY_DOCUMENT" + end);
  CHECK(Refusal("<robot name=\"r\"/>") == "scene.sdf: this is not an SDFormat file" + end);
  CHECK(Refusal("<sdf version=\"1.9\"/>") ==
        "scene.sdf: 0 worlds; exactly one <world> is expected");
  CHECK(Refusal(World("")) ==
        "scene.sdf:2: world w is empty; at least one model with a collision is expected");
  CHECK(Refusal(World(MovingLink(""))) ==
        "scene.sdf:3: link m::l can move and has no collision; give it one, or make its model "
        "static");
  CHECK(Refusal(World("<model name=\"m\"><link name=\"l\">\n<inertial><mass>0</mass></inertial>" +
                      box + "</link></model>")) ==
        "scene.sdf:4: the mass of link m::l = 0.000000: a number above 0 is expected");
  CHECK(Contains(
      Refusal(World("<model name=\"m\">\n<link name=\"l\"><inertial><mass>1</mass><inertia>"
                    "<ixx>1</ixx><iyy>1</iyy><izz>5</izz></inertia></inertial>" +
                    box + "</link></model>")),
      "scene.sdf:4: A link named l has invalid inertia"));
  CHECK(Refusal(World(MovingLink("<fricton>1</fricton>"))) ==
        "scene.sdf:4: SDFormat has no <fricton> in <link>: correct or remove it" + end);
  CHECK(Contains(Refusal(World(MovingLink("<pose>nan 0 0 0 0 0</pose>"))),
                 "scene.sdf:4: Error reading element <pose>: Pose values must be finite"));
  CHECK(Refusal(World(MovingLink(box + box))) ==
        "scene.sdf:4: collision with name[c] already exists" + end);
  CHECK(Contains(Refusal(World("\n<model name=\"m\"><pose relative_to=\"zz\"/><link name=\"l\">" +
                               kInertial + box + "</link></model>")),
                 "scene.sdf:4: relative_to name[zz] specified by model with name[m]"));
  CHECK(Contains(Refusal(World("\n<model name=\"m\"/>")),
                 "scene.sdf:4: A model must have at least one link"));
  CHECK(Contains(
      Refusal(World(MovingLink("<collision name=\"c\"><geometry><heightmap><uri>a.png</uri>"
                               "</heightmap></geometry></collision>"))),
      "scene.sdf:4: a collision may be a box, sphere, plane, cylinder, capsule, ellipsoid or mesh; "
      "give a heightmap or polyline as a mesh"));
  CHECK(Contains(
      Refusal(World(MovingLink("<collision name=\"c\"><geometry><plane/></geometry></collision>"))),
      "scene.sdf:4: link m::l can move and has a plane"));
  CHECK(Contains(
      Refusal(World(MovingLink("<collision name=\"c\"><geometry><box><size>1 0 1</size></box>"
                               "</geometry></collision>"))),
      "scene.sdf:4: an edge of the box = 0.000000: a number above 0 is expected"));
  CHECK(
      Contains(Refusal(World(MovingLink(
                   "<collision name=\"c\">" + kBox +
                   "<surface><friction><ode><mu>-1</mu></ode></friction></surface></collision>"))),
               "scene.sdf:4: Error reading element <mu>: The value [-1] is less than the minimum"));
  CHECK(Contains(Refusal(World("<include><uri>model://nothing</uri></include>")),
                 "scene.sdf:3: Unable to find uri[model://nothing]"));
  CHECK(Contains(Refusal("<sdf version=\"9.9\">\n<world name=\"w\">\n</world></sdf>"),
                 "scene.sdf: Unable to convert from SDF version 9.9"));

  const Folder folder;
  CHECK_THROWS_WITH(
      LoadSdf(folder.Path("none.sdf")),
      folder.Path("none.sdf") + ": the scene cannot be read: No such file or directory");
  CHECK_THROWS_WITH(LoadSdf(folder.Path("")),
                    folder.Path("") + ": the scene cannot be read: Is a directory");
}

TEST_CASE("threads that load scenes leave standard error as it was, and their refusals apart") {
  const Folder folder;
  std::streambuf* before = std::cerr.rdbuf();
  std::vector<std::jthread> threads;
  std::array<int, 4> refused{};
  for (std::size_t i = 0; i < refused.size(); ++i) {
    const std::string name = "scene" + std::to_string(i) + ".sdf";
    threads.emplace_back(
        [&refused, i, name, path = folder.Write(name, World("<nonsense" + std::to_string(i)))] {
          for (int k = 0; k < 20; ++k) {
            try {
              LoadSdf(path);
            } catch (const ConfigError& error) {
              if (Contains(error.what(), name)) ++refused[i];
            }
          }
        });
  }
  threads.clear();
  CHECK(std::cerr.rdbuf() == before);
  for (const int count : refused) CHECK(count == 20);
}

}  // namespace rikiseki::world

// SPDX-License-Identifier: MIT
// Joints of SDFormat files, as the loader makes scenes of them.
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "common/config.h"
#include "common/rigid_body.h"
#include "world_server/physics/bullet_world.h"
#include "world_server/scene/sdf_loader.h"

namespace rikiseki::world {
namespace {

namespace fs = std::filesystem;

LoadedScene LoadText(const std::string& content) {
  const fs::path path =
      fs::temp_directory_path() / ("rikiseki_joint_" + std::to_string(getpid()) + ".sdf");
  std::ofstream(path) << "<sdf version=\"1.9\">\n<world name=\"w\">\n" + content +
                             "\n</world></sdf>";
  struct Remove {
    fs::path path;
    ~Remove() { fs::remove(path); }
  } remove{path};
  return LoadSdf(path);
}

std::string Refusal(const std::string& content) {
  try {
    LoadText(content);
  } catch (const ConfigError& error) {
    const std::string text = error.what();
    return text.substr(text.find(".sdf"));
  }
  return "accepted";
}

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// A link of a box of 2 kg.
std::string Link(const std::string& name, const std::string& pose,
                 const std::string& inertial_pose = "0 0 0 0 0 0") {
  return "<link name=\"" + name + "\"><pose>" + pose + "</pose><inertial><pose>" + inertial_pose +
         "</pose><mass>2</mass><inertia><ixx>0.01</ixx><iyy>0.02</iyy><izz>0.025</izz></inertia>"
         "</inertial><collision name=\"c\"><geometry><box><size>0.2 0.1 0.1</size></box>"
         "</geometry></collision></link>\n";
}
std::string JointOf(const std::string& type, const std::string& parent, const std::string& child,
                    const std::string& more = "") {
  return "<joint name=\"j_" + child + "\" type=\"" + type + "\"><parent>" + parent +
         "</parent><child>" + child + "</child>" + more + "</joint>\n";
}
std::string Model(const std::string& content, const std::string& name = "m") {
  return "<model name=\"" + name + "\">\n" + content + "</model>\n";
}

// World poses of the joint at the start, by its parent and by its child.
std::pair<Pose, Pose> Ends(const Scene& scene, const Joint& joint) {
  const auto end = [&](std::size_t body, const Pose& frame) {
    return body == Joint::kWorld ? frame : scene.bodies[body].pose_WB * frame;
  };
  return {end(joint.parent, joint.pose_PJ), end(joint.child, joint.pose_CJ)};
}

}  // namespace

TEST_CASE("a revolute joint: axis, place, limits, damping and friction") {
  const LoadedScene loaded = LoadText(
      "<model name=\"m\"><pose>1 2 3 0 0 1.5707963267948966</pose>" +
      Link("a", "0 0 0 0 0 0", "0.1 0 0 0 0 0") + Link("b", "0.5 0 0 0 0 0") +
      JointOf("revolute", "a", "b",
              "<pose>-0.25 0 0 0 0 0</pose><axis><xyz>1 0 0</xyz><limit><lower>-0.5</lower>"
              "<upper>1.5</upper><effort>10</effort></limit><dynamics><damping>0.2</damping>"
              "<friction>0.3</friction></dynamics></axis>") +
      "</model>");
  CHECK(loaded.warnings.empty());
  const Scene& scene = loaded.scene;
  REQUIRE(scene.joints.size() == 1);
  const Joint& joint = scene.joints[0];
  CHECK(joint.name == "m::j_b");
  CHECK(joint.type == Joint::Type::kRevolute);
  CHECK(joint.parent == 0);
  CHECK(joint.child == 1);
  CHECK(joint.lower == -0.5);
  CHECK(joint.upper == 1.5);
  CHECK(joint.damping == 0.2);
  CHECK(joint.friction == 0.3);
  const auto [parent, child] = Ends(scene, joint);
  // In the model at x = 0.25, which is turned by 90 degrees about z.
  CHECK((parent.position - Vec3(1, 2.25, 3)).norm() < 1e-12);
  CHECK((parent.orientation * Vec3::UnitZ() - Vec3(0, 1, 0)).norm() < 1e-12);
  CHECK((child.position - parent.position).norm() < 1e-12);
  CHECK(child.orientation.angularDistance(parent.orientation) < 1e-7);
  CHECK_FALSE(Collide(scene, 0, 1));
}

TEST_CASE("axes are expressed in any frame, and joints sit in any") {
  const Scene scene =
      LoadText(Model("<frame name=\"f\"><pose>0 0 1 1.5707963267948966 0 0</pose></frame>" +
                     Link("a", "0 0 0 0 0 0") + Link("b", "0.5 0 0 0 0 0.7") +
                     JointOf("continuous", "a", "b",
                             "<pose relative_to=\"f\">0 0 0 0 0 0</pose>"
                             "<axis><xyz expressed_in=\"f\">0 1 0</xyz>"
                             "<limit><lower>-1</lower><upper>1</upper></limit></axis>") +
                     Link("d", "0 0.5 0 0 0 0") +
                     JointOf("prismatic", "world", "d",
                             "<axis><xyz expressed_in=\"__model__\">0 0 1</xyz></axis>")))
          .scene;
  REQUIRE(scene.joints.size() == 2);
  CHECK((Ends(scene, scene.joints[0]).first.position - Vec3(0, 0, 1)).norm() < 1e-12);
  CHECK((Ends(scene, scene.joints[0]).first.orientation * Vec3::UnitZ() - Vec3::UnitZ()).norm() <
        1e-12);
  CHECK(std::isinf(scene.joints[0].upper));  // continuous
  CHECK(scene.joints[1].parent == Joint::kWorld);
  CHECK(scene.joints[1].type == Joint::Type::kPrismatic);
  CHECK(std::isinf(scene.joints[1].lower));
}

TEST_CASE("links that are fixed to each other are one body with the mass of both") {
  const LoadedScene loaded =
      LoadText(Model(Link("a", "0 0 0 0 0 0.3") + Link("b", "1 0 0 0.5 0 0", "0.1 0 0 0 0 0.2") +
                     JointOf("fixed", "a", "b") + Link("c", "2 0 0 0 0 0") +
                     JointOf("revolute", "b", "c", "<axis><xyz>0 0 1</xyz></axis>")));
  CHECK(loaded.warnings.empty());
  const Scene& scene = loaded.scene;
  REQUIRE(scene.bodies.size() == 2);
  REQUIRE(scene.joints.size() == 1);
  CHECK(scene.joints[0].parent == 0);
  const SceneBody& whole = scene.bodies[0];
  CHECK(whole.name == "m::a");
  CHECK(whole.mass_kg == 4);
  // b's centre is 0.1 along its own x, which is the model's.
  CHECK((whole.pose_WB.position - Vec3(0.55, 0, 0)).norm() < 1e-12);
  CHECK(whole.colliders.size() == 2);
  CHECK(((whole.pose_WB * whole.colliders[1].pose_BS).position - Vec3(1, 0, 0)).norm() < 1e-12);
  // As two point-like bodies with their own inertia about the common centre, in world axes.
  const auto turned = [](const Mat3& inertia, const Quat& q) -> Mat3 {
    return q.toRotationMatrix() * inertia * q.toRotationMatrix().transpose();
  };
  const Mat3 own = Vec3(0.01, 0.02, 0.025).asDiagonal();
  const Quat of_a(Eigen::AngleAxisd(0.3, Vec3::UnitZ()));
  const Quat of_b =
      Quat(Eigen::AngleAxisd(0.5, Vec3::UnitX())) * Quat(Eigen::AngleAxisd(0.2, Vec3::UnitZ()));
  const Mat3 steiner = 2 * 2 * 0.55 * 0.55 * Vec3(0, 1, 1).asDiagonal().toDenseMatrix();
  const Mat3 expected = turned(own, of_a) + turned(own, of_b) + steiner;
  CHECK((turned(whole.inertia, whole.pose_WB.orientation) - expected).norm() < 1e-12);
}

TEST_CASE("what is fixed to the world, or to what is static, does not move") {
  const LoadedScene loaded = LoadText(
      Model(Link("a", "0 0 0 0 0 0") + JointOf("fixed", "world", "a") + Link("b", "1 0 0 0 0 0") +
            JointOf("fixed", "a", "b") + Link("c", "2 0 0 0 0 0") +
            JointOf("revolute", "b", "c", "<axis><xyz>0 0 1</xyz></axis>")));
  REQUIRE(loaded.scene.bodies.size() == 3);
  CHECK(loaded.scene.bodies[0].fixed);
  CHECK(loaded.scene.bodies[1].fixed);
  CHECK_FALSE(loaded.scene.bodies[2].fixed);
  REQUIRE(loaded.scene.joints.size() == 1);
  CHECK(loaded.scene.joints[0].parent == 1);
  CHECK_FALSE(Collide(loaded.scene, 1, 2));

  const LoadedScene idle =
      LoadText(Model("<static>1</static>" + Link("a", "0 0 0 0 0 0") + Link("b", "1 0 0 0 0 0") +
                     JointOf("revolute", "a", "b", "<axis><xyz>0 0 1</xyz></axis>")));
  CHECK(idle.scene.joints.empty());
  CHECK(idle.scene.bodies[1].fixed);
}

TEST_CASE("joints of nested models name their links, and links without a shape may hang on one") {
  const LoadedScene loaded = LoadText(
      Model(Model(Link("tip", "0 0 1 0 0 0"), "arm") + Link("base", "0 0 0 0 0 0") +
            "<link name=\"dummy\"><inertial><mass>0.1</mass><inertia><ixx>1e-4</ixx><iyy>1e-4</iyy>"
            "<izz>1e-4</izz></inertia></inertial></link>" +
            JointOf("ball", "base", "dummy") +
            "<joint name=\"j\" type=\"revolute\"><parent>dummy</parent><child>arm::tip</child>"
            "<axis><xyz>1 0 0</xyz></axis></joint>"));
  CHECK(loaded.warnings.empty());
  REQUIRE(loaded.scene.bodies.size() == 3);
  CHECK(loaded.scene.bodies[1].name == "m::dummy");
  CHECK(loaded.scene.bodies[2].name == "m::arm::tip");
  REQUIRE(loaded.scene.joints.size() == 2);
  CHECK(loaded.scene.joints[0].type == Joint::Type::kBall);
  CHECK(loaded.scene.joints[1].child == 2);
  BulletWorld world(loaded.scene, 1e-3);
  for (int i = 0; i < 10; ++i) world.ApplyAndStep({}, 0.05);
  // All fall together.
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(world.State(i).velocity.z() == Approx(-0.5 * 9.8).epsilon(1e-9));
  }
}

TEST_CASE("links of one model collide only where the file says so") {
  const auto scene_of = [](const std::string& more) {
    return LoadText(Model(more + Link("a", "0 0 0 0 0 0") + Link("b", "1 0 0 0 0 0"))).scene;
  };
  CHECK_FALSE(Collide(scene_of(""), 0, 1));
  CHECK_FALSE(Collide(scene_of("<self_collide>false</self_collide>"), 0, 1));
  CHECK(Collide(scene_of("<self_collide>true</self_collide>"), 0, 1));
  CHECK(Collide(
      LoadText(Model(Link("a", "0 0 0 0 0 0")) + Model(Link("b", "1 0 0 0 0 0"), "n")).scene, 0,
      1));
}

TEST_CASE("refused joints: file, line, and what would be right") {
  const std::string links = Link("a", "0 0 0 0 0 0") + Link("b", "1 0 0 0 0 0");
  const std::string axis = "<axis><xyz>0 0 1</xyz></axis>";
  const std::string screw = Refusal(Model(links + JointOf("screw", "a", "b", axis)));
  CHECK(screw ==
        ".sdf:6: joint j_b of type screw is not built; fixed, revolute, continuous, prismatic and "
        "ball are. Two revolute joints with a link between them do what universal and revolute2 "
        "do");
  for (const char* type : {"universal", "revolute2", "gearbox"}) {
    CHECK(Contains(Refusal(Model(links + JointOf(type, "a", "b",
                                                 axis + "<axis2><xyz>1 0 0</xyz>"
                                                        "</axis2>"))),
                   "is not built"));
  }
  CHECK(Contains(Refusal(Model(links + JointOf("revolute", "a", "b"))), ".sdf:6: "));
  CHECK(Contains(
      Refusal(Model(links + JointOf("revolute", "a", "b",
                                    "<axis><xyz>0 0 1</xyz>\n<limit><lower>0.1</lower>"
                                    "<upper>0.2</upper></limit></axis>"))),
      ".sdf:7: joint j_b starts at 0, outside its limits 0.100000 .. 0.200000; put the links"));
  CHECK(Contains(Refusal(Model(links + JointOf("revolute", "a", "b",
                                               "<axis><xyz>0 0 1</xyz><dynamics><damping>-1"
                                               "</damping></dynamics></axis>"))),
                 ".sdf:6: the damping of joint j_b = -1.000000: 0 or more is expected"));
  CHECK(Contains(Refusal(Model(links + JointOf("revolute", "a", "b",
                                               "<axis><xyz>0 0 1</xyz><dynamics>\n"
                                               "<spring_stiffness>3</spring_stiffness></dynamics>"
                                               "</axis>"))),
                 ".sdf:7: <spring_stiffness>3 in <dynamics> would change the motion"));
  CHECK(Contains(Refusal(Model(links + JointOf("revolute", "a", "nobody", axis))), "nobody"));
  // Held by both ends.
  const LoadedScene loose = LoadText(Model(links + JointOf("fixed", "a", "b") +
                                           "<joint name=\"k\" type=\"revolute\"><parent>a</parent>"
                                           "<child>b</child>" +
                                           axis + "</joint>"));
  CHECK(loose.scene.joints.empty());
  REQUIRE(loose.warnings.size() == 1);
  CHECK(Contains(loose.warnings[0], ".sdf:7: joint m::k connects what cannot move"));
}

}  // namespace rikiseki::world

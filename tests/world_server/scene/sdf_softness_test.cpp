// SPDX-License-Identifier: MIT
// Soft links in SDF: what is read, and that what cannot be is refused with its place and a way out.
#include <unistd.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "common/config.h"
#include "world_server/scene/sdf_loader.h"
#include "world_server/scene/soft_mesh.h"

namespace rikiseki::world {
namespace {

// A floor, and a link with a collision of this shape and these elements, on lines 11 and 12; `more` is
// other models, `beside` what stands in the same one.
std::string Write(const std::string& elements, const std::string& shape, double z,
                  const std::string& more = "", bool is_static = false,
                  const std::string& beside = "") {
  const std::string path = std::filesystem::temp_directory_path() /
                           ("rikiseki_soft_" + std::to_string(getpid()) + ".sdf");
  std::ofstream(path)
      << "<sdf version='1.9' xmlns:rikiseki='urn:rikiseki'>\n<world name='w'>\n"
         "<model name='floor'><static>true</static><link name='l'>\n"
         "<collision name='c'><geometry>\n"
         "<plane><normal>0 0 1</normal><size>1 1</size></plane></geometry>\n"
         "</collision></link></model>\n<model name='soft'><static>"
      << (is_static ? "true" : "false") << "</static>\n<pose>0 0 " << z
      << " 0 0 0</pose>\n<link name='l'>\n\n"
      << elements << "\n<collision name='c'><geometry>" << shape
      << "</geometry></collision>\n<inertial><mass>0.1</mass><inertia><ixx>1e-4</ixx>"
         "<iyy>1e-4</iyy><izz>1e-4</izz></inertia></inertial>\n</link>"
      << beside << "</model>" << more << "</world></sdf>\n";
  return path;
}

const std::string kBox = "<box><size>0.06 0.06 0.06</size></box>";

std::string Refusal(const std::string& elements, const std::string& shape = kBox, double z = 0.03,
                    bool is_static = false) {
  try {
    LoadSdf(Write(elements, shape, z, "", is_static));
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

std::string E(const std::string& name, const std::string& value) {
  return "<rikiseki:" + name + ">" + value + "</rikiseki:" + name + ">";
}

}  // namespace

TEST_CASE("a soft link is read, with what is absent at its default") {
  const LoadedScene loaded = LoadSdf(Write(E("youngs_modulus", "2e4"), kBox, 0.03));
  CHECK(loaded.warnings.empty());
  REQUIRE(loaded.scene.bodies.at(1).softness);
  const Softness& softness = *loaded.scene.bodies[1].softness;
  CHECK(softness.youngs_modulus_pa == 2e4);
  CHECK(softness.poisson_ratio == 0.3);
  CHECK(softness.relaxation_s == 0.02);
  const double nodes = SoftNodeCount(loaded.scene.bodies[1].colliders[0].shape, softness.element_m);
  CHECK(nodes <= 200);
  CHECK(nodes > 100);
  CHECK_FALSE(loaded.scene.bodies[0].softness);

  const LoadedScene ball = LoadSdf(Write(E("youngs_modulus", "2e5") + E("poisson_ratio", "0.4") +
                                             E("relaxation_s", "0") + E("element_size", "0.01"),
                                         "<sphere><radius>0.03</radius></sphere>", 0.02));
  CHECK(ball.scene.bodies.at(1).softness->poisson_ratio == 0.4);
  CHECK(ball.scene.bodies[1].softness->relaxation_s == 0);
  CHECK(ball.scene.bodies[1].softness->element_m == 0.01);
}

TEST_CASE(
    "a soft link that cannot be is refused: file, line, element, value, and what would be right") {
  const std::string soft = E("youngs_modulus", "2e4");
  const auto refuses = [](const std::string& why, const std::vector<std::string>& parts) {
    for (const std::string& part : parts) {
      CAPTURE(why, part);
      CHECK(why.find(part) != std::string::npos);
    }
  };
  refuses(Refusal(E("youngs_modulus", "99")),
          {".sdf:11: <rikiseki:youngs_modulus> = '99'", "from 100 to 1e+12, in Pa"});
  refuses(Refusal(E("youngs_modulus", "nan")), {"= 'nan'"});
  refuses(Refusal(soft + E("poisson_ratio", "0.5")), {":11:", "= '0.5'", "from 0 to 0.45"});
  refuses(Refusal(soft + E("relaxation_s", "-1")), {"relaxation_s> = '-1'", "from 0 to 10"});
  refuses(Refusal(soft + E("element_size", "0.001")), {"element_size> = 0.001 m", "at most 1500"});
  refuses(Refusal(soft + E("drag", "1")), {"rikiseki:drag>", "rigid links only"});
  refuses(Refusal(E("poisson_ratio", "0.2")), {"poisson_ratio>", "<rikiseki:youngs_modulus>"});
  refuses(Refusal(soft, kBox, 0.04), {":11:", "link soft::l", "nothing holds it", "three points"});
  refuses(Refusal(E("youngs_modulus", "200")), {":11:", "collapse", "at least"});
  refuses(Refusal(soft, kBox, 0.03, true), {":11:", "static"});
  refuses(Refusal(soft, "<cylinder><radius>0.03</radius><length>0.06</length></cylinder>"),
          {":11:", "no <box>, <sphere> or <ellipsoid>"});
}

TEST_CASE("a soft link takes no joint, neither one that moves nor a fixed one") {
  for (const std::string type : {"revolute", "fixed"}) {
    const std::string beside =
        "<link name='arm'><pose>0.2 0 0.5 0 0 0</pose><collision name='c'><geometry>" + kBox +
        "</geometry></collision><inertial><mass>1</mass><inertia><ixx>1e-3</ixx><iyy>1e-3</iyy>"
        "<izz>1e-3</izz></inertia></inertial></link><joint name='j' type='" +
        type + "'><parent>l</parent><child>arm</child>" +
        (type == "fixed" ? "" : "<axis><xyz>0 0 1</xyz></axis>") + "</joint>";
    std::string why;
    try {
      LoadSdf(Write(E("youngs_modulus", "2e4"), kBox, 0.03, "", false, beside));
    } catch (const ConfigError& error) {
      why = error.what();
    }
    CAPTURE(type, why);
    CHECK(why.find("joints hold rigid links only") != std::string::npos);
  }
}

TEST_CASE("a rigid link that moves beside a soft one is warned of") {
  const std::string cube =
      "<model name='cube'><pose>0.2 0 0.03 0 0 0</pose><link name='l'><collision "
      "name='c'><geometry>" +
      kBox +
      "</geometry></collision><inertial><mass>1</mass><inertia><ixx>1e-3</ixx><iyy>1e-3</iyy>"
      "<izz>1e-3</izz></inertia></inertial></link></model>";
  const LoadedScene loaded = LoadSdf(Write(E("youngs_modulus", "2e4"), kBox, 0.03, cube));
  REQUIRE(loaded.warnings.size() == 1);
  CHECK(
      loaded.warnings[0].find(":11: soft link soft::l and rigid links that move, as cube::l, pass "
                              "through each other") != std::string::npos);
}

}  // namespace rikiseki::world

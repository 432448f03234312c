// SPDX-License-Identifier: MIT
#include "world_server/scene/sdf_survey.h"

#include <cstdlib>
#include <map>
#include <string_view>

#include "common/config.h"
#include "world_server/scene/sdf_element.h"
#include "world_server/scene/sdf_extensions.h"

namespace rikiseki::world {
namespace {

enum class Use {
  kUsed,     // read by the loader, and its children are looked at
  kLooks,    // only for eyes and ears: rightly left to a viewer
  kMotion,   // changes the motion: refused
  kDefault,  // changes the motion unless it has this value
};

struct Treatment {
  Use use = Use::kUsed;
  double harmless = 0;  // of kDefault; false is 0, true is 1
};

// "parent/child". What is not here is not used and gets a warning.
const std::map<std::string_view, Treatment>& Treatments() {
  static const std::map<std::string_view, Treatment> kTreatments = {
      {"world/gravity", {}},
      {"world/model", {}},
      {"world/frame", {}},
      {"world/include", {Use::kLooks}},  // its model stands beside it
      {"world/light", {Use::kLooks}},
      {"world/scene", {Use::kLooks}},
      {"world/gui", {Use::kLooks}},
      {"world/audio", {Use::kLooks}},
      {"world/spherical_coordinates", {Use::kLooks}},
      {"world/wind", {}},
      {"wind/linear_velocity", {}},
      {"model/static", {}},
      {"model/pose", {}},
      {"model/frame", {}},
      {"model/link", {}},
      {"model/model", {}},
      {"model/include", {Use::kLooks}},
      {"model/self_collide", {}},
      {"model/allow_auto_disable", {Use::kLooks}},
      {"model/enable_wind", {}},
      {"model/joint", {}},
      {"model/gripper", {Use::kMotion}},
      {"frame/pose", {}},
      {"joint/parent", {}},  // the loader refuses types that are not built
      {"joint/child", {}},
      {"joint/pose", {}},
      {"joint/axis", {}},
      {"axis/xyz", {}},
      {"axis/limit", {}},
      {"axis/dynamics", {}},
      {"limit/lower", {}},
      {"limit/upper", {}},
      {"limit/effort", {Use::kLooks}},  // of a motor
      {"dynamics/damping", {}},
      {"dynamics/friction", {}},
      {"dynamics/spring_stiffness", {Use::kDefault, 0}},
      {"dynamics/spring_reference", {Use::kLooks}},  // without a spring nothing
      {"link/pose", {}},
      {"link/inertial", {}},
      {"link/collision", {}},
      {"link/visual", {Use::kLooks}},
      {"link/light", {Use::kLooks}},
      {"link/projector", {Use::kLooks}},
      {"link/audio_sink", {Use::kLooks}},
      {"link/audio_source", {Use::kLooks}},
      {"link/must_be_base_link", {Use::kLooks}},
      {"link/self_collide", {}},
      {"link/gravity", {}},
      {"link/kinematic", {Use::kDefault, 0}},
      {"link/enable_wind", {}},
      {"link/velocity_decay", {}},
      {"velocity_decay/linear", {}},  // the loader warns of other than 0
      {"velocity_decay/angular", {}},
      {"inertial/mass", {}},
      {"inertial/pose", {}},
      {"inertial/inertia", {}},
      {"inertia/ixx", {}},
      {"inertia/ixy", {}},
      {"inertia/ixz", {}},
      {"inertia/iyy", {}},
      {"inertia/iyz", {}},
      {"inertia/izz", {}},
      {"collision/pose", {}},
      {"collision/geometry", {Use::kLooks}},  // the loader refuses what it cannot take
      {"collision/laser_retro", {Use::kLooks}},
      {"collision/max_contacts", {Use::kLooks}},
      {"collision/surface", {}},
      {"surface/friction", {}},
      {"surface/contact", {}},
      {"surface/bounce", {}},
      {"friction/ode", {}},
      {"friction/bullet", {}},
      {"ode/mu", {}},
      {"ode/mu2", {}},
      {"ode/slip1", {Use::kDefault, 0}},
      {"ode/slip2", {Use::kDefault, 0}},
      {"bullet/friction", {}},
      {"bullet/friction2", {}},
      {"bullet/rolling_friction", {Use::kDefault, 0}},
      {"contact/ode", {}},
      {"contact/bullet", {}},
      {"contact/collide_bitmask", {Use::kDefault, 65535}},
      {"contact/category_bitmask", {Use::kDefault, 65535}},
      {"contact/collide_without_contact", {Use::kDefault, 0}},
      {"ode/kp", {}},
      {"ode/kd", {}},
      {"bullet/kp", {}},
      {"bullet/kd", {}},
      {"bounce/restitution_coefficient", {}},
  };
  return kTreatments;
}

std::string Tag(const sdf::ElementPtr& element) {
  std::string tag = "<";
  tag += element->GetName();
  return tag += '>';
}

double ValueOf(const sdf::ElementPtr& element) {
  const std::string text = element->GetValue() ? element->GetValue()->GetAsString() : "";
  if (text == "true") return 1;
  return std::strtod(text.c_str(), nullptr);
}

void Survey(const sdf::ElementPtr& parent, bool is_static, std::vector<std::string>& warnings) {
  if (parent->GetName() == "model" && parent->HasElement("static")) {
    is_static = is_static || ValueOf(parent->GetElement("static")) == 1;
  }
  for (auto child = parent->GetFirstElement(); child; child = child->GetNextElement()) {
    if (!child->GetExplicitlySetInFile()) continue;
    if (IsExtension(child)) {
      CheckExtension(parent, child);
      continue;
    }
    const std::string path = parent->GetName() + "/" + child->GetName();
    const auto found = Treatments().find(path);
    if (found == Treatments().end()) {
      const std::string hint =
          path == "world/physics"      ? "; the configuration's physics.substep_ms sets the step"
          : path == "bounce/threshold" ? "; what is slower than 2 cm/s does not bounce"
                                       : "";
      warnings.push_back(PlaceOf(child) + ": " + Tag(child) + " in " + Tag(parent) +
                         " is not used" + hint);
      continue;
    }
    const Treatment& treatment = found->second;
    const bool changes_motion =
        treatment.use == Use::kMotion ||
        (treatment.use == Use::kDefault && ValueOf(child) != treatment.harmless);
    if (changes_motion && !is_static) {
      const std::string value = child->GetValue() ? child->GetValue()->GetAsString() : "";
      throw ConfigError(PlaceOf(child) + ": " + Tag(child) + value + " in " + Tag(parent) +
                        " would change the motion and is not built; leave it out, or make the "
                        "model static");
    }
    if (treatment.use == Use::kUsed) Survey(child, is_static, warnings);
  }
}

}  // namespace

void SurveyWorld(const sdf::ElementPtr& world, std::vector<std::string>& warnings) {
  Survey(world, /*is_static=*/false, warnings);
}

}  // namespace rikiseki::world

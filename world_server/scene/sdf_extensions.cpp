// SPDX-License-Identifier: MIT
#include "world_server/scene/sdf_extensions.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <string>

#include "common/config.h"
#include "world_server/scene/sdf_element.h"
#include "world_server/scene/soft_mesh.h"

namespace rikiseki::world {
namespace {

constexpr char kPrefix[] = "rikiseki:";
constexpr char kStaticFriction[] = "rikiseki:static_friction";
constexpr char kRecovery[] = "rikiseki:recovery_s";
constexpr char kDrag[] = "rikiseki:drag";
constexpr char kAngularDrag[] = "rikiseki:angular_drag";
constexpr char kModulus[] = "rikiseki:youngs_modulus";
constexpr char kPoissonRatio[] = "rikiseki:poisson_ratio";
constexpr char kRelaxation[] = "rikiseki:relaxation_s";
constexpr char kElement[] = "rikiseki:element_size";

struct Place {
  const char *parent, *of;  // "<parent> of a ..."
  std::array<const char*, 2> names;
};
constexpr std::array kPlaces = {Place{"surface", "collision", {kStaticFriction, kRecovery}},
                                Place{"link", "model", {kDrag, kAngularDrag}},
                                Place{"link", "model", {kModulus, kPoissonRatio}},
                                Place{"link", "model", {kRelaxation, kElement}}};

constexpr double kLargestFriction = 100;
constexpr double kLongestRecovery = 10;  // s, SPEC.md 6.2
constexpr double kLargestDrag = 1e6;     // N s/m, N m s
constexpr double kLeastModulus = 100;    // Pa: softer is no solid
constexpr double kLargestModulus = 1e12;
constexpr double kLargestPoissonRatio = 0.45;  // linear tetrahedra lock beyond

// "file:line". libsdformat keeps no line of elements that it does not know: it is sought from the
// parent's line on, past the elements of this name that come before.
std::string PlaceOfExtension(const sdf::ElementPtr& element) {
  const sdf::ElementPtr parent = element->GetParent();
  if (element->LineNumber() || !parent || !parent->LineNumber()) return PlaceOf(element);
  int to_pass = 0;
  for (auto child = parent->GetFirstElement(); child != element; child = child->GetNextElement()) {
    if (child->GetName() == element->GetName()) ++to_pass;
  }
  std::ifstream file(parent->FilePath());
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (number < *parent->LineNumber()) continue;
    const std::string tag = "<" + element->GetName();
    for (auto at = line.find(tag); at != std::string::npos; at = line.find(tag, at + 1)) {
      if (to_pass-- == 0) return parent->FilePath() + ":" + std::to_string(number);
    }
  }
  return PlaceOf(parent);
}

[[noreturn]] void RefuseExtension(const sdf::ElementPtr& element, const std::string& why) {
  throw ConfigError(PlaceOfExtension(element) + ": <" + element->GetName() + "> " + why);
}

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

std::string TextOf(const sdf::ElementPtr& element) {
  return element->GetValue() ? element->GetValue()->GetAsString() : "";
}

sdf::ElementPtr FindChild(const sdf::ElementPtr& parent, const char* name) {
  for (auto child = parent->GetFirstElement(); child; child = child->GetNextElement()) {
    if (child->GetName() == name) return child;
  }
  return nullptr;
}

std::string Range(double low, double high) {
  return "a number from " + Number(low) + " to " + Number(high);
}

// The number of a child that may stand once; none if it does not stand.
std::optional<double> ReadNumber(const sdf::ElementPtr& parent, const char* name, double low,
                                 double high, const std::string& expected) {
  std::optional<double> number;
  for (auto child = parent->GetFirstElement(); child; child = child->GetNextElement()) {
    if (child->GetName() != name) continue;
    if (number)
      RefuseExtension(child, "stands twice in this <" + parent->GetName() + ">; once is right");
    const std::string text = TextOf(child);
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    const bool is_number = !text.empty() && end == text.c_str() + text.size();
    if (!is_number || !std::isfinite(value) || value < low || value > high) {
      RefuseExtension(child, "= '" + text + "': " + expected + " is expected");
    }
    number = value;
  }
  return number;
}

}  // namespace

bool IsExtension(const sdf::ElementPtr& element) {
  return element->GetName().rfind(kPrefix, 0) == 0;
}

void CheckExtension(const sdf::ElementPtr& parent, const sdf::ElementPtr& element) {
  std::string known;
  for (const Place& place : kPlaces) {
    for (const char* name : place.names) {
      if (element->GetName() == name && parent->GetName() == place.parent) return;
    }
    known += std::string(known.empty() ? "" : ", ") + "<" + place.names[0] + "> and <" +
             place.names[1] + "> in the <" + place.parent + "> of a " + place.of;
  }
  RefuseExtension(element, "in <" + parent->GetName() + "> means nothing; " + known + " do");
}

void ReadSurfaceExtensions(const sdf::ElementPtr& collision, Collider& collider) {
  if (!collision->HasElement("surface")) return;
  const sdf::ElementPtr surface = collision->GetElement("surface");
  collider.static_friction = ReadNumber(
      surface, kStaticFriction, collider.friction, kLargestFriction,
      "a number from " + Number(collider.friction) + ", its <mu>, to " + Number(kLargestFriction));
  collider.recovery_s = ReadNumber(surface, kRecovery, 1e-6, kLongestRecovery,
                                   "a number of seconds above 0, to " + Number(kLongestRecovery))
                            .value_or(0);
}

void ReadLinkExtensions(const sdf::ElementPtr& link, SceneBody& body) {
  const std::string expected = Range(0, kLargestDrag);
  body.drag_ns_per_m = ReadNumber(link, kDrag, 0, kLargestDrag, expected).value_or(0);
  body.angular_drag_nms = ReadNumber(link, kAngularDrag, 0, kLargestDrag, expected).value_or(0);
}

void ReadSoftness(const sdf::ElementPtr& link, SceneBody& body) {
  const auto modulus = ReadNumber(link, kModulus, kLeastModulus, kLargestModulus,
                                  Range(kLeastModulus, kLargestModulus) + ", in Pa,");
  if (!modulus) {
    for (const char* name : {kPoissonRatio, kRelaxation, kElement}) {
      if (const sdf::ElementPtr at = FindChild(link, name)) {
        RefuseExtension(at, std::string("is about soft links; give this one a <") + kModulus +
                                ">, or remove it");
      }
    }
    return;
  }
  const sdf::ElementPtr at = FindChild(link, kModulus);
  for (const char* name : {kDrag, kAngularDrag}) {
    if (const sdf::ElementPtr drag = FindChild(link, name)) {
      RefuseExtension(drag, "acts on rigid links only; remove it from this soft one");
    }
  }
  if (body.fixed) RefuseExtension(at, "in a static model: what is static does not deform");
  if (body.colliders.size() != 1) {
    RefuseExtension(at, "in a link with " + std::to_string(body.colliders.size()) +
                            " collisions: a soft link has exactly one");
  }
  const Shape& shape = body.colliders[0].shape;
  if (SoftNodeCount(shape, 1) == 0) {
    RefuseExtension(at,
                    "in a link whose collision is no <box>, <sphere> or <ellipsoid>: only these "
                    "are divided into elements");
  }
  Softness softness{.youngs_modulus_pa = *modulus};
  softness.poisson_ratio =
      ReadNumber(link, kPoissonRatio, 0, kLargestPoissonRatio, Range(0, kLargestPoissonRatio))
          .value_or(softness.poisson_ratio);
  softness.relaxation_s =
      ReadNumber(link, kRelaxation, 0, kLongestRecovery, Range(0, kLongestRecovery) + ", in s,")
          .value_or(softness.relaxation_s);
  const double usual = UsualElement(shape);
  softness.element_m =
      ReadNumber(link, kElement, 1e-6, 1e3, "a length above 0, in m,").value_or(usual);
  const double nodes = SoftNodeCount(shape, softness.element_m);
  if (nodes > kMostSoftNodes) {
    RefuseExtension(FindChild(link, kElement), "= " + Number(softness.element_m) + " m makes " +
                                                   Number(nodes) + " nodes; at most " +
                                                   Number(kMostSoftNodes) + " are right, as with " +
                                                   Number(usual) + " m");
  }
  body.softness = softness;
}

void RequireHeld(const sdf::ElementPtr& link, const Scene& scene, const SceneBody& body) {
  const std::string why = WhyNotSoft(scene, body);
  if (!why.empty()) {
    RefuseExtension(FindChild(link, kModulus), "of link " + body.name + ": " + why);
  }
}

std::string PlaceOfSoftness(const sdf::ElementPtr& link) {
  return PlaceOfExtension(FindChild(link, kModulus));
}

}  // namespace rikiseki::world

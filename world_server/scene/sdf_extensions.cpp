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

namespace rikiseki::world {
namespace {

constexpr char kPrefix[] = "rikiseki:";
constexpr char kStaticFriction[] = "rikiseki:static_friction";
constexpr char kRecovery[] = "rikiseki:recovery_s";
constexpr char kDrag[] = "rikiseki:drag";
constexpr char kAngularDrag[] = "rikiseki:angular_drag";

struct Place {
  const char *parent, *of;  // "<parent> of a ..."
  std::array<const char*, 2> names;
};
constexpr std::array kPlaces = {Place{"surface", "collision", {kStaticFriction, kRecovery}},
                                Place{"link", "model", {kDrag, kAngularDrag}}};

constexpr double kLargestFriction = 100;
constexpr double kLongestRecovery = 10;  // s, SPEC.md 6.2
constexpr double kLargestDrag = 1e6;     // N s/m, N m s

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
  const std::string expected = "a number from 0 to " + Number(kLargestDrag);
  body.drag_ns_per_m = ReadNumber(link, kDrag, 0, kLargestDrag, expected).value_or(0);
  body.angular_drag_nms = ReadNumber(link, kAngularDrag, 0, kLargestDrag, expected).value_or(0);
}

}  // namespace rikiseki::world

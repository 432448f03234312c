// SPDX-License-Identifier: MIT
#include "world_server/scene/sdf_element.h"

#include <cmath>

#include "common/config.h"

namespace rikiseki::world {

std::string PlaceOf(const sdf::ElementPtr& element) {
  if (!element->LineNumber()) return element->FilePath();
  return element->FilePath() + ":" + std::to_string(*element->LineNumber());
}

void Refuse(const sdf::ElementPtr& element, const std::string& why) {
  throw ConfigError(PlaceOf(element) + ": " + why);
}

sdf::ElementPtr FindExplicit(sdf::ElementPtr element, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (!element->HasElement(name)) return nullptr;
    element = element->GetElement(name);
    if (!element->GetExplicitlySetInFile()) return nullptr;
  }
  return element;
}

double Positive(const sdf::ElementPtr& element, const std::string& what, double value) {
  if (!std::isfinite(value) || !(value > 0)) {
    Refuse(element, what + " = " + std::to_string(value) + ": a number above 0 is expected");
  }
  return value;
}

}  // namespace rikiseki::world

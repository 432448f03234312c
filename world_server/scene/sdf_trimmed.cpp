// SPDX-License-Identifier: MIT
#include "world_server/scene/sdf_trimmed.h"

#include <fstream>
#include <iterator>
#include <memory>
#include <set>

namespace rikiseki::world {
namespace {

// Of all elements in a file, and perhaps of what only looks like one.
std::set<std::string> ElementNames(const std::string& text) {
  std::set<std::string> names;
  for (auto at = text.find('<'); at != std::string::npos; at = text.find('<', at + 1)) {
    const auto end = text.find_first_of("/> \t\r\n", at + 1);
    if (end == std::string::npos) break;
    names.insert(text.substr(at + 1, end - at - 1));
  }
  return names;
}

// Takes out what consists of others, is in no file of these names, and is not put in unasked (as all that is
// in a light). Single values stay, for their defaults.
void Trim(const sdf::ElementPtr& description, const std::set<std::string>& names) {
  if (description->GetName() == "light") return;
  for (unsigned int i = 0; i < description->GetElementDescriptionCount(); ++i) {
    const sdf::ElementPtr child = description->GetElementDescription(i);
    if (child->GetElementDescriptionCount() == 0) continue;
    const std::string& required = child->GetRequired();
    if (names.contains(child->GetName()) || required == "1" || required == "+") {
      Trim(child, names);
    } else {
      child->Reset();
    }
  }
}

}  // namespace

bool LoadTrimmed(const std::string& path, const sdf::ParserConfig& config, sdf::Root& root) {
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const auto read = std::make_shared<sdf::SDF>();
  if (!sdf::init(read)) return false;
  Trim(read->Root(), ElementNames(text));
  sdf::Errors errors;
  sdf::Root loaded;
  if (!sdf::readFile(path, config, read, errors) || !errors.empty()) return false;
  if (!loaded.Load(read, config).empty()) return false;
  root = std::move(loaded);
  return true;
}

}  // namespace rikiseki::world

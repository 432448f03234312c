// SPDX-License-Identifier: MIT
#include "world_server/scene/sdf_complaints.h"

#include <algorithm>
#include <iostream>
#include <regex>

#include "common/config.h"

namespace rikiseki::world {
namespace {

// The line of the last element that fits, or 0.
template <typename Fits>
int LastLine(const sdf::ElementPtr& element, const Fits& fits) {
  int line = fits(element) ? element->LineNumber().value_or(0) : 0;
  for (auto child = element->GetFirstElement(); child; child = child->GetNextElement()) {
    line = std::max(line, LastLine(child, fits));
  }
  return line;
}

// ":line" of what a message is about, as far as it can be told: libsdformat knows no line for what
// it finds out late. Most messages give a name, in brackets or after "named".
std::string LineOf(const std::string& message, const sdf::ElementPtr& root) {
  if (!root) return "";
  const std::regex quoted("\\[([^\\]]+)\\]|named ([^ ]+)");
  for (std::sregex_iterator match(message.begin(), message.end(), quoted), end; match != end;
       ++match) {
    const std::string name = (*match)[1].matched ? (*match)[1] : (*match)[2];
    const int line = LastLine(root, [&](const sdf::ElementPtr& element) {
      return element->HasAttribute("name") && element->Get<std::string>("name") == name;
    });
    if (line > 0) return ":" + std::to_string(line);
  }
  if (message.starts_with("A model must have at least one link")) {
    const int line = LastLine(root, [](const sdf::ElementPtr& element) {
      return element->GetName() == "model" && !element->HasElement("link") &&
             !element->HasElement("model");
    });
    if (line > 0) return ":" + std::to_string(line);
  }
  return "";
}

}  // namespace

CaptureStandardError::CaptureStandardError() : before_(std::cerr.rdbuf(text_.rdbuf())) {}

CaptureStandardError::~CaptureStandardError() {
  std::cerr.rdbuf(before_);
}

std::vector<std::string> CaptureStandardError::Messages(const std::string& level) const {
  const std::regex colour("\x1b\\[[0-9;]*m");
  const std::regex prefix("^" + level + " \\[[^\\]]*\\]\\s*");
  std::istringstream lines(text_.str());
  std::vector<std::string> messages;
  for (std::string line; std::getline(lines, line);) {
    line = std::regex_replace(line, colour, "");
    std::smatch match;
    if (std::regex_search(line, match, prefix)) messages.push_back(match.suffix());
  }
  return messages;
}

std::string OneLine(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  while (!text.empty() && (text.back() == ' ' || text.back() == '.')) text.pop_back();
  return text;
}

void RefuseErrors(const std::string& path, const sdf::Root& root, const sdf::Errors& errors,
                  const std::vector<std::string>& said) {
  if (errors.empty() && said.empty()) return;
  std::string place = path;
  std::string why = said.empty() ? "" : OneLine(said.front());
  std::smatch match;
  if (!errors.empty() && errors.front().LineNumber()) {
    const sdf::Error& first = errors.front();
    place = first.FilePath().value_or(path) + ":" + std::to_string(*first.LineNumber());
    why = OneLine(first.Message()) + (why.empty() ? "" : ": " + why);
    const std::regex unknown("XML Element\\[(.+)\\], child of element\\[(.+)\\], not defined.*");
    if (std::regex_match(why, match, unknown)) {
      why = "SDFormat has no <" + match[1].str() + "> in <" + match[2].str() +
            ">: correct or remove it";
    }
  } else if (std::regex_search(why, match, std::regex("Error=(\\w+).*Line number=(\\d+)(.*)"))) {
    if (match[2] != "0") place += ":" + match[2].str();
    why = "broken XML, " + match[1].str() + match[3].str();
  } else if (why.empty()) {
    why = OneLine(errors.front().Message());
    place += LineOf(why, root.Element());
    if (errors.front().Code() == sdf::ErrorCode::FILE_READ) why = "this is not an SDFormat file";
  }
  throw ConfigError(place + ": " + why + "; an SDFormat world (sdformat.org) is expected");
}

}  // namespace rikiseki::world

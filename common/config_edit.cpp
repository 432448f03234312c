// SPDX-License-Identifier: MIT
#include "common/config_edit.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>

#include "common/config.h"
#include "common/text.h"

namespace rikiseki {
namespace {

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

// `key = old # comment` -> `key = value # comment`, blanks as they were.
std::string WithValue(const std::string& line, const std::string& value) {
  const auto begin = line.find_first_not_of(" \t", line.find('=') + 1);
  const std::string head = line.substr(0, begin);
  const std::string tail = line.substr(std::min(begin, line.size()));
  const std::string old = Trim(tail.substr(0, tail.find('#')));
  return head + value + tail.substr(old.size());
}

void SetValue(std::vector<std::string>& lines, const std::string& key, const std::string& value) {
  const std::string wanted_section = key.substr(0, key.find('.'));
  std::string section;
  std::size_t end_of_section = 0;  // behind its last line that says anything
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string text = Trim(lines[i].substr(0, lines[i].find('#')));
    if (text.empty()) continue;
    if (text.front() == '[') {
      section = Trim(text.substr(1, text.size() - 2));
    } else {
      const std::string name = Trim(text.substr(0, text.find('=')));
      if ((section.empty() ? "" : section + ".") + name == key) {
        lines[i] = WithValue(lines[i], value);
        return;
      }
    }
    if (section == wanted_section) end_of_section = i + 1;
  }
  if (end_of_section == 0) {
    lines.push_back("[" + wanted_section + "]");
    end_of_section = lines.size();
  }
  lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(end_of_section),
               key.substr(wanted_section.size() + 1) + " = " + value);
}

}  // namespace

std::string WithValues(std::string text,
                       const std::vector<std::pair<std::string, std::string>>& values) {
  std::vector<std::string> lines = Lines(text);
  for (const auto& [key, value] : values) SetValue(lines, key, value);
  text.clear();
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

void SetValuesInFile(const std::string& path,
                     const std::vector<std::pair<std::string, std::string>>& values) {
  namespace fs = std::filesystem;
  try {
    const fs::path file = fs::canonical(path);
    std::ostringstream old;
    if (std::ifstream in(file); !(old << in.rdbuf())) {
      throw ConfigError(path + ": it cannot be read");
    }
    const fs::path fresh = file.string() + ".new";
    {
      std::ofstream out(fresh, std::ios::trunc);
      out << WithValues(old.str(), values);
      out.flush();
      if (!out) throw ConfigError(fresh.string() + ": it cannot be written");
    }
    fs::permissions(fresh, fs::status(file).permissions());
    fs::rename(fresh, file);
  } catch (const fs::filesystem_error& error) {
    throw ConfigError(path + ": the values cannot be saved: " + error.code().message());
  }
}

}  // namespace rikiseki

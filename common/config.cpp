// SPDX-License-Identifier: MIT
#include "common/config.h"

#include <algorithm>
#include <boost/program_options.hpp>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <sstream>

#include "common/text.h"

namespace rikiseki {
namespace po = boost::program_options;
namespace {

std::string Show(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return {text.data(), end};
}

std::string Show(const Vec3& value) {
  return Show(value.x()) + " " + Show(value.y()) + " " + Show(value.z());
}

template <typename T>
T ParseWhole(const std::string& text, double low, double high) {
  T value{};
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  if (result.ec != std::errc() || result.ptr != end) throw std::invalid_argument("not a number");
  const auto number = static_cast<double>(value);
  if (!std::isfinite(number) || number < low || number > high) {
    throw std::invalid_argument("out of range");
  }
  return value;
}

std::vector<double> ParseNumbers(const std::string& text, double low, double high) {
  std::istringstream words(text);
  std::string word;
  std::vector<double> values;
  while (words >> word) values.push_back(ParseWhole<double>(word, low, high));
  return values;
}

Vec3 ParseVector(const std::string& text, double low, double high) {
  const std::vector<double> values = ParseNumbers(text, low, high);
  if (values.size() != 3) throw std::invalid_argument("not three numbers");
  return {values[0], values[1], values[2]};
}

std::string RangeText(double low, double high) {
  return " from " + Show(low) + " to " + Show(high);
}

// Levenshtein distance, to guess which key was meant.
std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

}  // namespace

void ConfigSchema::Add(const std::string& key, Entry entry) {
  if (!entries_.emplace(key, std::move(entry)).second) {
    throw std::logic_error("config key registered twice: " + key);
  }
}

void ConfigSchema::Number(const std::string& key, double* target, double low, double high,
                          const std::string& doc) {
  Add(key, {.assign = [=](const std::string& value,
                          const std::string&) { *target = ParseWhole<double>(value, low, high); },
            .show = [=] { return Show(*target); },
            .expected = "a number" + RangeText(low, high),
            .doc = doc});
}

void ConfigSchema::Integer(const std::string& key, int* target, int low, int high,
                           const std::string& doc) {
  Add(key, {.assign = [=](const std::string& value,
                          const std::string&) { *target = ParseWhole<int>(value, low, high); },
            .show = [=] { return std::to_string(*target); },
            .expected = "a whole number" + RangeText(low, high),
            .doc = doc});
}

void ConfigSchema::Flag(const std::string& key, bool* target, const std::string& doc) {
  AddChoice(
      key, {"false", "true"}, [target](std::size_t index) { *target = index == 1; },
      [target] { return std::string(*target ? "true" : "false"); }, doc);
}

void ConfigSchema::Text(const std::string& key, std::string* target, const std::string& doc) {
  Add(key, {.assign = [target](const std::string& value, const std::string&) { *target = value; },
            .show = [target] { return *target; },
            .expected = "a text",
            .doc = doc});
}

void ConfigSchema::Path(const std::string& key, std::string* target, const std::string& doc) {
  Add(key, {.assign =
                [target](const std::string& value, const std::string& folder) {
                  if (value.empty()) throw std::invalid_argument("empty");
                  *target = (std::filesystem::path(folder) / value).lexically_normal().string();
                },
            .show = [target] { return *target; },
            .expected = "a path",
            .doc = doc});
}

void ConfigSchema::Vector(const std::string& key, Vec3* target, double low, double high,
                          const std::string& doc) {
  Add(key, {.assign = [=](const std::string& value,
                          const std::string&) { *target = ParseVector(value, low, high); },
            .show = [=] { return Show(*target); },
            .expected = "three numbers `x y z`, each" + RangeText(low, high),
            .doc = doc});
}

void ConfigSchema::Numbers(const std::string& key, std::vector<double>* target, double low,
                           double high, const std::string& doc) {
  Add(key, {.assign =
                [=](const std::string& value, const std::string&) {
                  const std::vector<double> numbers = ParseNumbers(value, low, high);
                  if (numbers.empty()) throw std::invalid_argument("no number");
                  *target = numbers;
                },
            .show =
                [=] {
                  std::string text;
                  for (const double number : *target) {
                    if (!text.empty()) text += ' ';
                    text += Show(number);
                  }
                  return text;
                },
            .expected = "numbers separated by blanks, each" + RangeText(low, high),
            .doc = doc});
}

void ConfigSchema::Vectors(const std::string& key, std::vector<Vec3>* target, double low,
                           double high, const std::string& doc) {
  Add(key, {.assign =
                [=](const std::string& value, const std::string&) {
                  std::vector<Vec3> vectors;
                  std::istringstream parts(value);
                  std::string part;
                  while (std::getline(parts, part, ',')) {
                    vectors.push_back(ParseVector(part, low, high));
                  }
                  if (value.ends_with(',')) throw std::invalid_argument("nothing after the comma");
                  *target = vectors;
                },
            .show =
                [=] {
                  std::string text;
                  for (const Vec3& vector : *target)
                    text += (text.empty() ? "" : ", ") + Show(vector);
                  return text;
                },
            .expected = "vectors `x y z, x y z, ...`, each number" + RangeText(low, high),
            .doc = doc});
}

void ConfigSchema::AddChoice(const std::string& key, const std::vector<std::string>& names,
                             const std::function<void(std::size_t)>& assign,
                             std::function<std::string()> show, const std::string& doc) {
  std::string expected = "one of";
  for (const std::string& name : names) expected += (&name == &names[0] ? " " : " | ") + name;
  Add(key, {.assign =
                [names, assign](const std::string& value, const std::string&) {
                  const auto found = std::find(names.begin(), names.end(), value);
                  if (found == names.end()) throw std::invalid_argument("unknown word");
                  assign(static_cast<std::size_t>(found - names.begin()));
                },
            .show = std::move(show),
            .expected = expected,
            .doc = doc});
}

void ConfigSchema::Assign(const std::string& key, const std::string& value,
                          const std::string& origin, const std::string& folder) {
  const auto entry = entries_.find(key);
  if (entry == entries_.end()) {
    const auto nearest =
        std::min_element(entries_.begin(), entries_.end(), [&](const auto& a, const auto& b) {
          return EditDistance(a.first, key) < EditDistance(b.first, key);
        });
    throw ConfigError(origin + ": " + key + " = " + value +
                      ": there is no such key; did you mean " +
                      (nearest == entries_.end() ? "none" : nearest->first) + "?");
  }
  try {
    entry->second.assign(value, folder);
  } catch (const std::invalid_argument&) {
    throw ConfigError(origin + ": " + key + " = " + value + ": " + entry->second.expected +
                      " is expected (the unit is part of the key's name)");
  }
  entry->second.origin = origin;
}

void ConfigSchema::Load(const std::string& path) {
  errno = 0;
  std::ifstream file(path);
  const int open_error = errno;
  if (!file || std::filesystem::is_directory(path)) {
    const int error = file ? EISDIR : open_error;
    throw ConfigError(path + ": the configuration cannot be read: " + std::strerror(error));
  }
  const std::string folder = std::filesystem::path(path).parent_path().string();

  po::options_description known;
  for (const auto& [key, entry] : entries_) {
    known.add_options()(key.c_str(), po::value<std::string>());
  }
  std::map<std::string, int> seen;
  std::string section;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    const std::string origin = path + ":" + std::to_string(number);
    const std::string text = Trim(line.substr(0, line.find('#')));
    if (text.empty()) continue;
    if (text.front() == '[') {
      section = text.back() == ']' ? Trim(text.substr(1, text.size() - 2)) : "";
      if (section.empty()) {
        throw ConfigError(origin + ": " + text + ": a section is written [name]");
      }
      continue;
    }
    // The library parses one line at a time, because it does not tell lines in its errors.
    std::istringstream one_line((section.empty() ? "" : "[" + section + "]\n") + text + "\n");
    po::parsed_options parsed(&known);
    try {
      parsed = po::parse_config_file(one_line, known, /*allow_unregistered=*/true);
    } catch (const po::error& error) {
      throw ConfigError(origin + ": " + text + ": a line is `key = value`");
    }
    if (parsed.options.empty() || parsed.options[0].value.empty()) {
      throw ConfigError(origin + ": " + text + ": a line is `key = value`");
    }
    const std::string& key = parsed.options[0].string_key;
    if (const auto [first, is_new] = seen.emplace(key, number); !is_new) {
      throw ConfigError(origin + ": " + key + ": given before, in line " +
                        std::to_string(first->second) + "; a key stands once");
    }
    Assign(key, parsed.options[0].value[0], origin, folder);
  }
  if (file.bad()) throw ConfigError(path + ": reading failed: " + std::strerror(errno));
}

void ConfigSchema::Set(const std::string& assignment) {
  const auto equals = assignment.find('=');
  if (equals == std::string::npos) {
    throw ConfigError("--set " + assignment + ": `section.key=value` is expected");
  }
  Assign(Trim(assignment.substr(0, equals)), Trim(assignment.substr(equals + 1)),
         "--set " + assignment, std::filesystem::current_path().string());
}

void ConfigSchema::Refuse(const std::string& key, const std::string& why) const {
  const Entry& entry = entries_.at(key);
  throw ConfigError(entry.origin + ": " + key + " = " + entry.show() + ": " + why);
}

std::string ConfigSchema::Describe() const {
  std::string text;
  for (const auto& [key, entry] : entries_) {
    text += key + " = " + entry.show() + "    # " + entry.doc + " (" + entry.expected + "; from " +
            entry.origin + ")\n";
  }
  return text;
}

ConfigValues ConfigSchema::Values() const {
  ConfigValues values;
  for (const auto& [key, entry] : entries_) values.emplace(key, entry.show());
  return values;
}

std::vector<std::string> ConfigSchema::Keys() const {
  std::vector<std::string> keys;
  for (const auto& [key, entry] : entries_) keys.push_back(key);
  return keys;
}

}  // namespace rikiseki

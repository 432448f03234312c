// SPDX-License-Identifier: MIT
// INI files with a schema: every key has a type, a range, a unit and a sentence, and every refusal names
// file, line, key, value and what would be right. Reading is Boost.Program_options', line by line.
//
// Format: `[section]`, `key = value`, `#` starts a comment, a vector is one value `x y z`. A key may stand
// once. Nothing non-finite is a value. What a file leaves out keeps its default.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/exit_code.h"
#include "common/geometry.h"

namespace rikiseki {

/// A refused configuration: exit status 78, what() names the place and the cure in one line.
class ConfigError : public StartError {
 public:
  explicit ConfigError(const std::string& what) : StartError(kExitConfig, what) {}
};

/// Every key with its effective value in canonical form: equal values are equal texts.
using ConfigValues = std::map<std::string, std::string>;

/// The keys a program accepts, bound to the variables they set.
class ConfigSchema {
 public:
  /// `key` is "section.name" with the unit in the name; the target's present value is the default.
  /// The range is inclusive. `doc` is one sentence, printed by Describe().
  void Number(const std::string& key, double* target, double low, double high,
              const std::string& doc);
  void Integer(const std::string& key, int* target, int low, int high, const std::string& doc);
  void Flag(const std::string& key, bool* target, const std::string& doc);
  void Text(const std::string& key, std::string* target, const std::string& doc);
  /// A path; a relative one is resolved against the folder of the file that gives it.
  void Path(const std::string& key, std::string* target, const std::string& doc);
  /// Three numbers, each within the range.
  void Vector(const std::string& key, Vec3* target, double low, double high,
              const std::string& doc);
  /// One number or more on one line, separated by blanks.
  void Numbers(const std::string& key, std::vector<double>* target, double low, double high,
               const std::string& doc);
  /// Any number of vectors on one line, separated by commas.
  void Vectors(const std::string& key, std::vector<Vec3>* target, double low, double high,
               const std::string& doc);

  /// One of a few words.
  template <typename Enum>
  void Choice(const std::string& key, Enum* target,
              const std::vector<std::pair<std::string, Enum>>& words, const std::string& doc) {
    std::vector<std::string> names;
    names.reserve(words.size());
    for (const auto& [name, value] : words) names.push_back(name);
    AddChoice(
        key, names, [target, words](std::size_t index) { *target = words[index].second; },
        [target, words] {
          for (const auto& [name, value] : words) {
            if (value == *target) return name;
          }
          return std::string();
        },
        doc);
  }

  /// Reads a file into the targets. Throws ConfigError; the targets are then partly set, so read into a
  /// fresh settings object and adopt it whole.
  void Load(const std::string& path);

  /// One `--set section.key=value`; wins over files read before.
  void Set(const std::string& assignment);

  /// Throws a ConfigError that names the place where `key` got its value.
  [[noreturn]] void Refuse(const std::string& key, const std::string& why) const;

  /// Every key with its effective value, where it came from and its sentence, for `--check`.
  std::string Describe() const;

  ConfigValues Values() const;

  /// All keys, sorted, for the test that the shipped files document each.
  std::vector<std::string> Keys() const;

 private:
  struct Entry {
    std::function<void(const std::string& value, const std::string& folder)> assign;  // throws
    std::function<std::string()> show;
    std::string expected;  // "a number from 0 to 20"
    std::string doc;
    std::string origin = "default";
  };

  void Add(const std::string& key, Entry entry);
  void AddChoice(const std::string& key, const std::vector<std::string>& names,
                 const std::function<void(std::size_t)>& assign, std::function<std::string()> show,
                 const std::string& doc);
  void Assign(const std::string& key, const std::string& value, const std::string& origin,
              const std::string& folder);

  std::map<std::string, Entry> entries_;
};

}  // namespace rikiseki

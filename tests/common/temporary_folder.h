// SPDX-License-Identifier: MIT
// A folder for one test, removed at its end with all that is in it.
#pragma once

#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <system_error>

namespace rikiseki {

class TemporaryFolder {
 public:
  TemporaryFolder() {
    path_ = (std::filesystem::temp_directory_path() / "rikiseki-test-XXXXXX").string();
    if (mkdtemp(path_.data()) == nullptr) throw std::runtime_error("mkdtemp failed: " + path_);
  }
  ~TemporaryFolder() {
    std::error_code ignored;  // children of children may still write there
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  /// Where a file of this name is, or would be.
  std::string File(const std::string& name) const { return path_ + "/" + name; }

  /// Writes a file in place, with the folders that its name has.
  std::string Write(const std::string& name, const std::string& content) const {
    std::filesystem::create_directories(std::filesystem::path(File(name)).parent_path());
    std::ofstream(File(name), std::ios::binary) << content;
    return File(name);
  }

  /// Writes it as editors do: beside, and renamed.
  void Rename(const std::string& name, const std::string& content) const {
    std::filesystem::rename(Write(name + ".new", content), File(name));
  }

 private:
  std::string path_;
};

}  // namespace rikiseki

// A folder for one test, removed at its end with all that is in it.
#pragma once

#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace rikiseki {

class TemporaryFolder {
 public:
  TemporaryFolder() {
    path_ = (std::filesystem::temp_directory_path() / "rikiseki-test-XXXXXX").string();
    if (mkdtemp(path_.data()) == nullptr) throw std::runtime_error("mkdtemp failed: " + path_);
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
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

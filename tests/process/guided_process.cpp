// SPDX-License-Identifier: MIT
#include "tests/process/guided_process.h"

#include <unistd.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <fstream>
#include <sstream>

namespace rikiseki::test {
namespace {

std::string TextOf(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

std::filesystem::path NewFile() {
  static std::atomic<int> next{0};
  return std::filesystem::temp_directory_path() /
         ("rikiseki-guided-" + std::to_string(getpid()) + "-" + std::to_string(next++) + ".ini");
}

}  // namespace

GuidedProcess::GuidedProcess(const std::string& device_file, const std::string& option,
                             const Command& command, const std::vector<std::string>& more)
    : file_(NewFile()) {
  std::filesystem::copy_file(SourceFile("config/devices/" + device_file), file_,
                             std::filesystem::copy_options::overwrite_existing);
  before_ = TextOf(file_);
  std::vector<std::string> arguments = {"--set", "device.file=" + file_.string(), option};
  arguments.insert(arguments.end(), more.begin(), more.end());
  // Its words go to stderr, where Child keeps them.
  std::vector<std::string> words = {"/bin/sh", "-c", "exec \"$@\" 1>&2", "sh"};
  for (const std::string& word : command(arguments)) words.push_back(word);
  child_.emplace(words);
}

GuidedProcess::~GuidedProcess() {
  child_.reset();
  std::filesystem::remove(file_);
}

std::string GuidedProcess::File() const {
  return TextOf(file_);
}

std::string ValueOf(const std::string& text, const std::string& key) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(key + " = ")) return line.substr(key.size() + 3);
  }
  FAIL("no " << key << " in " << text);
  return "";
}

}  // namespace rikiseki::test

// SPDX-License-Identifier: MIT
// haptic_server in a guided procedure, with a device file of its own: what it says, and what it saves.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tests/process/child.h"

namespace rikiseki::test {

class GuidedProcess {
 public:
  /// haptic_server's command line with these further arguments.
  using Command = std::function<std::vector<std::string>(const std::vector<std::string>& more)>;

  /// Starts the procedure `option` on a copy of `device_file` of config/devices.
  GuidedProcess(const std::string& device_file, const std::string& option, const Command& command,
                const std::vector<std::string>& more = {});
  ~GuidedProcess();
  GuidedProcess(const GuidedProcess&) = delete;
  GuidedProcess& operator=(const GuidedProcess&) = delete;

  Child& child() { return *child_; }

  /// What it said so far, on stdout or stderr.
  std::string Words() const { return child_->Stderr(); }

  /// The device file as it is now, and as it was.
  std::string File() const;
  const std::string& before() const { return before_; }

 private:
  std::filesystem::path file_;
  std::string before_;
  std::optional<Child> child_;
};

/// What `key = ` is followed by in the text of an INI file. Fails the test if the key is not there.
std::string ValueOf(const std::string& text, const std::string& key);

}  // namespace rikiseki::test

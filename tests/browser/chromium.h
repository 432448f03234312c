// SPDX-License-Identifier: MIT
// A page in a headless Chromium, driven over the DevTools protocol.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/common/temporary_folder.h"
#include "tests/process/child.h"

namespace rikiseki::test {

class Chromium {
 public:
  /// Opens `url` in a window of so many pixels. Throws std::runtime_error where Chromium does not start
  /// or answer.
  Chromium(const std::string& url, int width, int height);
  ~Chromium();
  Chromium(const Chromium&) = delete;
  Chromium& operator=(const Chromium&) = delete;

  /// What a JavaScript expression gives (a promise: what it resolves to), by value. Throws
  /// std::runtime_error with what the page threw.
  nlohmann::json Evaluate(const std::string& expression);

  /// One key, as DevTools calls it: "i", " ", "ArrowLeft"; with shift held or not.
  void Press(const std::string& key, bool shift = false);

  void Resize(int width, int height);
  void SetDark(bool dark);

  /// The window as a PNG, also kept as a file of the artefacts folder of the build. Its bytes.
  std::string Screenshot(const std::string& name);

 private:
  class DevTools;  // keeps the network library out of the tests

  nlohmann::json Call(const std::string& method, const nlohmann::json& parameters);

  TemporaryFolder profile_;
  Child process_;
  std::unique_ptr<DevTools> devtools_;
};

}  // namespace rikiseki::test

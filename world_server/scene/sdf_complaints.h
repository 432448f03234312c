// SPDX-License-Identifier: MIT
// What libsdformat dislikes about a file, as one line with its place.
#pragma once

#include <mutex>
#include <sdf/sdf.hh>
#include <sstream>
#include <string>
#include <vector>

namespace rikiseki::world {

/// libsdformat and the URDF parser behind it write to std::cerr what their error objects do not hold.
/// Collects it while it lives, so that a refusal stays one line and still gives the reason. There is one
/// std::cerr, so threads that load scenes do it one after the other.
class CaptureStandardError {
 public:
  CaptureStandardError();
  ~CaptureStandardError();
  CaptureStandardError(const CaptureStandardError&) = delete;
  CaptureStandardError& operator=(const CaptureStandardError&) = delete;

  bool empty() const { return text_.view().empty(); }

  /// What libsdformat said at this level ("Error" or "Warning"), one entry for each message.
  std::vector<std::string> Messages(const std::string& level) const;

 private:
  static inline std::mutex only_one_;
  std::lock_guard<std::mutex> lock_{only_one_};
  std::ostringstream text_;
  std::streambuf* before_;
};

/// A message of libsdformat without line breaks and the full stop.
std::string OneLine(std::string text);

/// Throws ConfigError with the place and the first thing that libsdformat disliked, if there is one, as an
/// error or only `said`.
void RefuseErrors(const std::string& path, const sdf::Root& root, const sdf::Errors& errors,
                  const std::vector<std::string>& said);

}  // namespace rikiseki::world

// SPDX-License-Identifier: MIT
// Tells when files have changed, by looking at them now and then: on every file system, through
// links, and with editors that write beside and rename.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace rikiseki::world {

class FileWatch {
 public:
  /// Watches these files from now on. Of one that it watches already, what it has seen stays.
  void Watch(const std::vector<std::string>& files);

  /// Watches this one too, likewise.
  void Add(const std::string& file);

  /// Looks. True, once, when a file is not as it was when it was accepted or reported, and all are as
  /// at the look before: whoever writes has finished, as far as can be told. One that is not there
  /// is so too.
  bool Look();

  /// What the files are now is what is known of them.
  void Accept();

 private:
  // Device and inode, size, times of change of content and of anything, ns; zeros: not there.
  using Trace = std::array<std::int64_t, 5>;
  using Traces = std::map<std::string, Trace>;

  static Trace TraceOf(const std::string& file);
  Traces TracesNow() const;

  Traces known_;
  Traces seen_;  // by the look before
};

}  // namespace rikiseki::world

// SPDX-License-Identifier: MIT
// A child process of a test: started with an argument list, its stderr kept, killed at the latest when it
// goes out of scope.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace rikiseki::test {

class Child {
 public:
  /// Starts arguments[0] with the arguments. Throws std::system_error.
  explicit Child(const std::vector<std::string>& arguments);
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  void Signal(int signal) const;

  /// SIGSTOP, and waits until it stands still (or has ended).
  void Freeze() const;

  pid_t pid() const { return pid_; }

  /// Waits until it ends, `seconds` at most, then kills it. Returns the exit status, or minus the signal
  /// that ended it.
  int Wait(double seconds = 20);

  bool IsRunning();

  /// What it wrote to stderr so far.
  std::string Stderr() const;

 private:
  pid_t pid_ = 0;
  int status_ = 0;
  bool ended_ = false;
  std::string stderr_path_;
};

/// What a process holds.
struct Usage {
  long descriptors = 0;
  long mappings = 0;
  long segments = 0;  // mappings of segments, deleted ones too
  long threads = 0;
  long resident_kib = 0;
};
Usage UsageOf(pid_t process);

/// A program of this build.
std::string Program(const std::string& name);

/// A file of the source tree.
std::string SourceFile(const std::string& path);

/// An instance name that no other test uses. Removes what killed daemons left under it: declare it before
/// them.
class Instance {
 public:
  Instance();
  ~Instance();
  Instance(const Instance&) = delete;
  Instance& operator=(const Instance&) = delete;
  operator const std::string&() const { return name_; }

 private:
  std::string name_;
};

}  // namespace rikiseki::test

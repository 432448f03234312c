// SPDX-License-Identifier: MIT
// Runs cases, prints one line for each as it ends, and sums up.
#pragma once

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <span>
#include <string>
#include <vector>

#include "protocol/tools/check/case.h"

namespace rikiseki::protocol::check {

class Reporter {
 public:
  Reporter(std::ostream& out, bool strict) : out_(out), strict_(strict) {}

  void Add(const Result& result);
  void Summary();
  /// Throws StartError (64) if the file cannot be written.
  void WriteJunit(const std::string& path, const std::string& suite) const;

  const std::vector<Result>& results() const { return results_; }
  Verdict worst() const;
  /// 0, or 1 if anything failed; with `strict`, a SHOULD that is not met fails too.
  int ExitStatus() const;

 private:
  std::ostream& out_;
  bool strict_;
  std::vector<Result> results_;
};

/// A failure while the host kept the kit or the peer from running says nothing about the peer: the
/// case is tried again, this often at most.
inline constexpr int kTries = 3;
inline constexpr std::int64_t kStallNs = 60'000'000;

template <typename Player>
Result RunCase(const Case<Player>& one, Player& player);

/// Is `id` selected? An empty list selects all; an entry may be a prefix that ends at a '/'.
bool Selected(const std::string& id, std::span<const std::string> wanted);

}  // namespace rikiseki::protocol::check

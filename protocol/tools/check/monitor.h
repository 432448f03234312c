// SPDX-License-Identifier: MIT
// Sentences that are judged on every message of a run: a monitor counts how often each was put to
// the test, and keeps the first breach.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace rikiseki::protocol::check {

class Monitor {
 public:
  /// One look at the sentence `id`; `breach` tells what was seen where it does not hold.
  template <typename Breach>
  void Judge(const char* id, bool holds, Breach&& breach) {
    Record& record = records_[id];
    ++record.looks;
    if (!holds && record.breaches++ == 0) record.first = breach();
  }

  /// Fails, informs that nothing was seen, or returns.
  void Report(const char* id) const;
  std::uint64_t breaches(const char* id) const;
  std::uint64_t looks(const char* id) const;

 private:
  struct Record {
    std::uint64_t looks = 0;
    std::uint64_t breaches = 0;
    std::string first;
  };
  std::map<std::string, Record> records_;
};

}  // namespace rikiseki::protocol::check

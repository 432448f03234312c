// SPDX-License-Identifier: MIT
#include "protocol/tools/check/monitor.h"

#include "protocol/tools/check/case.h"

namespace rikiseki::protocol::check {

void Monitor::Report(const char* id) const {
  const auto record = records_.find(id);
  if (record == records_.end()) Inform("this run had no occasion to look");
  const Record& seen = record->second;
  if (seen.breaches == 0) return;
  Fail(seen.first + (seen.breaches == 1 ? "" : "; " + std::to_string(seen.breaches) + " times") +
       " in " + std::to_string(seen.looks) + " looks");
}

std::uint64_t Monitor::breaches(const char* id) const {
  const auto record = records_.find(id);
  return record == records_.end() ? 0 : record->second.breaches;
}

std::uint64_t Monitor::looks(const char* id) const {
  const auto record = records_.find(id);
  return record == records_.end() ? 0 : record->second.looks;
}

}  // namespace rikiseki::protocol::check

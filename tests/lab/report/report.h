// SPDX-License-Identifier: MIT
// `haptic_lab report`: runs the studies of the report, or this shard of them, and writes its page; and
// `haptic_lab people`, the page of an experiment with people.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <vector>

#include "tests/lab/report/runner.h"

namespace rikiseki::lab {

/// Runs what is not finished in the folder, and writes its index.html from what is: when rows of other
/// shards are missing, it says how many. Returns the number of reference rows that were missed, and of others that broke
/// a bar. Throws ConfigError.
std::size_t MakeReport(const std::vector<Chapter>& chapters, const RunnerOptions& options,
                       std::ostream& out);

/// Writes index.html of a folder with the people.csv of scripts/experiment. Throws ConfigError.
void MakePeoplePage(const std::filesystem::path& folder, std::ostream& out);

}  // namespace rikiseki::lab

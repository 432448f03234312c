// SPDX-License-Identifier: MIT
// What the rows of the study `pushes` say together.
#pragma once

#include <cstddef>
#include <iosfwd>
#include <vector>

#include "tests/lab/study.h"

namespace rikiseki::lab {

/// Prints, for every coupling, a table with the pushes down and the world rates across: error of the
/// mean against the single-rate run, SD, largest jump; the worst of all latencies. Pushes without a
/// single-rate row are left out.
void SummarisePushes(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out);

/// Holds every row of `local` against its single-rate row; names each bar that is missed and returns
/// how many are.
std::size_t JudgePushes(const Table& rows, const std::vector<Outcome>& outcomes, std::ostream& out);

}  // namespace rikiseki::lab

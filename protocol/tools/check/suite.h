// SPDX-License-Identifier: MIT
// All cases of a side, run against one peer.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "protocol/tools/check/case.h"
#include "protocol/tools/check/runner.h"

namespace rikiseki::protocol::check {

/// Of both sides, in the order in which they run.
std::vector<std::string> CaseIds();

/// Plays a world. `wanted` as in Selected(). Throws SegmentError if there is nobody to judge, or the
/// peer ends meanwhile.
void JudgeHaptic(const PlayOptions& options, std::span<const std::string> wanted, double wait_s,
                 Reporter& reporter);
/// Plays a haptic side.
void JudgeWorld(const PlayOptions& options, std::span<const std::string> wanted, double wait_s,
                Reporter& reporter);
/// Looks at both segments of an instance; SegmentError if there is none.
void InspectBoth(const std::string& instance, std::span<const std::string> wanted,
                 Reporter& reporter);

}  // namespace rikiseki::protocol::check

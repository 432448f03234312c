// SPDX-License-Identifier: MIT
#include "protocol/tools/check/suite.h"

#include <memory>

#include "protocol/tools/check/haptic_cases.h"
#include "protocol/tools/check/lint.h"
#include "protocol/tools/check/world_cases.h"

namespace rikiseki::protocol::check {
namespace {

constexpr char kHapticReady[] = "haptic/5.2-9/ready";
constexpr char kWorldReady[] = "world/5.2-9/ready";

/// Somebody to judge; a segment that is there and cannot be attached is a verdict by itself.
template <typename Player>
std::unique_ptr<Player> Meet(const PlayOptions& options, Role role, const char* id,
                             std::span<const std::string> wanted, double wait_s,
                             Reporter& reporter) {
  try {
    auto player = std::make_unique<Player>(options, wait_s);
    if (Selected(id, wanted)) reporter.Add({id, {}, 0});
    return player;
  } catch (const SegmentError& error) {
    if (StatObject(SegmentName(options.instance, role)).id == ObjectId{}) throw;
    if (error.exit_code() != 1) throw;
    reporter.Add({id, {Verdict::kFailed, error.what()}, wait_s});
    return nullptr;
  }
}

std::vector<HapticCase> AllHapticCases() {
  std::vector<HapticCase> all;
  for (const auto& group : {HapticSegmentCases(), HapticContactCases(), HapticLocalCases(),
                            HapticNonsenseCases(), HapticEndCases(), HapticMonitorCases()}) {
    all.insert(all.end(), group.begin(), group.end());
  }
  return all;
}

std::vector<WorldCase> AllWorldCases() {
  std::vector<WorldCase> all;
  for (const auto& group : {WorldSegmentCases(), WorldContactCases(), WorldLocalCases(),
                            WorldNonsenseCases(), WorldEndCases(), WorldMonitorCases()}) {
    all.insert(all.end(), group.begin(), group.end());
  }
  return all;
}

template <typename Player>
void RunAll(const std::vector<Case<Player>>& cases, Player& player,
            std::span<const std::string> wanted, Reporter& reporter) {
  for (const Case<Player>& one : cases) {
    if (!Selected(one.id, wanted)) continue;
    try {
      reporter.Add(RunCase(one, player));
    } catch (const SegmentError& error) {
      reporter.Add({one.id, {Verdict::kFailed, error.what()}, 0});
      throw;
    }
  }
}

}  // namespace

std::vector<std::string> CaseIds() {
  std::vector<std::string> ids = {kHapticReady, kWorldReady};
  for (const HapticCase& one : AllHapticCases()) ids.emplace_back(one.id);
  for (const WorldCase& one : AllWorldCases()) ids.emplace_back(one.id);
  return ids;
}

void JudgeHaptic(const PlayOptions& options, std::span<const std::string> wanted, double wait_s,
                 Reporter& reporter) {
  const auto player =
      Meet<WorldPlayer>(options, Role::kHaptic, kHapticReady, wanted, wait_s, reporter);
  if (player) RunAll(AllHapticCases(), *player, wanted, reporter);
}

void JudgeWorld(const PlayOptions& options, std::span<const std::string> wanted, double wait_s,
                Reporter& reporter) {
  const auto player =
      Meet<HapticPlayer>(options, Role::kWorld, kWorldReady, wanted, wait_s, reporter);
  if (player) RunAll(AllWorldCases(), *player, wanted, reporter);
}

void InspectBoth(const std::string& instance, std::span<const std::string> wanted,
                 Reporter& reporter) {
  bool any = false;
  for (const Role role : {Role::kHaptic, Role::kWorld}) {
    if (StatObject(SegmentName(instance, role)).id == ObjectId{}) continue;
    any = true;
    for (const Result& result : Inspect(instance, role)) {
      if (Selected(result.id, wanted)) reporter.Add(result);
    }
  }
  if (!any) throw SegmentError(1, "instance '" + instance + "' has no segment");
}

}  // namespace rikiseki::protocol::check

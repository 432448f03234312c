#include "protocol/tools/check/suite.h"

#include "protocol/tools/check/haptic_cases.h"
#include "protocol/tools/check/lint.h"
#include "protocol/tools/check/world_cases.h"

namespace rikiseki::protocol::check {
namespace {

std::vector<HapticCase> AllHapticCases() {
  std::vector<HapticCase> all;
  for (const auto& group : {HapticSegmentCases(), HapticContactCases(), HapticNonsenseCases(),
                            HapticEndCases(), HapticMonitorCases()}) {
    all.insert(all.end(), group.begin(), group.end());
  }
  return all;
}

std::vector<WorldCase> AllWorldCases() {
  std::vector<WorldCase> all;
  for (const auto& group : {WorldSegmentCases(), WorldContactCases(), WorldNonsenseCases(),
                            WorldEndCases(), WorldMonitorCases()}) {
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
  std::vector<std::string> ids;
  for (const HapticCase& one : AllHapticCases()) ids.emplace_back(one.id);
  for (const WorldCase& one : AllWorldCases()) ids.emplace_back(one.id);
  return ids;
}

void JudgeHaptic(const PlayOptions& options, std::span<const std::string> wanted, double wait_s,
                 Reporter& reporter) {
  WorldPlayer player(options, wait_s);
  RunAll(AllHapticCases(), player, wanted, reporter);
}

void JudgeWorld(const PlayOptions& options, std::span<const std::string> wanted, double wait_s,
                Reporter& reporter) {
  HapticPlayer player(options, wait_s);
  RunAll(AllWorldCases(), player, wanted, reporter);
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

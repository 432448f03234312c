// SPDX-License-Identifier: MIT
// The conformance kit can fail: a tiny side that keeps SPEC.md passes every case, and for each way to break
// it the kit names the case.
#include "tests/protocol/check_mutants.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <sstream>

#include "protocol/attach.h"
#include "protocol/owner.h"
#include "protocol/tools/check/suite.h"
#include "tests/protocol/support.h"

namespace rikiseki::protocol::test {
namespace {

using check::Reporter;
using check::Result;
using check::Verdict;

check::PlayOptions Options(const std::string& instance, const TemporaryFolder& folder) {
  check::PlayOptions options;
  options.instance = instance;
  options.runtime_directory = folder.path();
  return options;
}

/// The verdict of one case against a haptic side with a fault.
Verdict JudgedHaptic(HapticFault fault, const std::string& id, std::string& text) {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const MiniHaptic peer(instance, fault);
  std::ostringstream out;
  Reporter reporter(out, true);
  check::JudgeHaptic(Options(instance, folder), std::vector<std::string>{id},
                     fault == HapticFault::kNeverReady ? 0.3 : 10, reporter);
  text = out.str();
  REQUIRE(reporter.results().size() == 1);
  CHECK(reporter.results()[0].id == id);
  return reporter.results()[0].outcome.verdict;
}

Verdict JudgedWorld(WorldFault fault, const std::string& id, std::string& text) {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const MiniWorld peer(instance, fault);
  std::ostringstream out;
  Reporter reporter(out, true);
  check::JudgeWorld(Options(instance, folder), std::vector<std::string>{id}, 10, reporter);
  text = out.str();
  REQUIRE(reporter.results().size() == 1);
  CHECK(reporter.results()[0].id == id);
  return reporter.results()[0].outcome.verdict;
}

}  // namespace

TEST_CASE("a haptic side that keeps SPEC.md passes every case, strictly") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const MiniHaptic peer(instance, HapticFault::kNone);
  std::ostringstream out;
  Reporter reporter(out, true);
  check::JudgeHaptic(Options(instance, folder), {}, 10, reporter);
  reporter.Summary();
  INFO(out.str());
  CHECK(reporter.ExitStatus() == 0);
}

TEST_CASE("a world that keeps SPEC.md passes every case, strictly") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  const MiniWorld peer(instance, WorldFault::kNone);
  std::ostringstream out;
  Reporter reporter(out, true);
  check::JudgeWorld(Options(instance, folder), {}, 10, reporter);
  reporter.Summary();
  INFO(out.str());
  CHECK(reporter.ExitStatus() == 0);
}

TEST_CASE("the kit fails every haptic mutant in the case that is about it") {
  const auto [fault, id] = GENERATE(table<HapticFault, const char*>({
      {HapticFault::kPublishBeforeWrite, "haptic/4.1-2/published"},
      {HapticFault::kCounterBackwards, "haptic/4.1-2/counter"},
      {HapticFault::kMomentAboutFinger, "haptic/7.2-3/angular-impulse"},
      {HapticFault::kIncrements, "haptic/7.3-1/impulse"},
      {HapticFault::kWrongSign, "haptic/7.3-1/impulse"},
      {HapticFault::kNominalTime, "haptic/7.3-1/impulse"},
      {HapticFault::kPulls, "haptic/7.2-2/contact"},
      {HapticFault::kNoHeartbeat, "haptic/3.1-4/heartbeat"},
      {HapticFault::kOldEpoch, "haptic/5.2-10/epoch"},
      {HapticFault::kNeverReady, "haptic/5.2-9/ready"},
      {HapticFault::kForceForever, "haptic/5.5-2/silence"},
      {HapticFault::kNoFirstLook, "haptic/4.3-1/first-look"},
      {HapticFault::kNoSecondLook, "haptic/4.3-1/second-look"},
      {HapticFault::kFreesEarly, "haptic/7.6-2/freed-after-ack"},
      {HapticFault::kKeepsChannels, "haptic/7.6-3/restart"},
      {HapticFault::kTakesNonsense, "haptic/9.2-3/not-a-number"},
      {HapticFault::kIgnoresHash, "haptic/8.2-3/hash"},
      {HapticFault::kRefusesMinor, "haptic/8.2-4/minor"},
      {HapticFault::kEverySecondTick, "haptic/6.1-3/tick-numbers"},
      {HapticFault::kBooksAnyAck, "haptic/7.6-4/false-acks"},
      {HapticFault::kNoThreeFrames, "haptic/5.5-3/three-frames"},
      {HapticFault::kOverCap, "haptic/5.5-7/pressed-hard"},
      {HapticFault::kNoClock, "haptic/9.2-8/future-stamp"},
      {HapticFault::kTakesNonsense, "haptic/9.2-3/mobility"},
      {HapticFault::kTakesNonsense, "haptic/9.2-3/contact-radius"},
      {HapticFault::kTakesNonsense, "haptic/9.2-3/local-mass"},
      {HapticFault::kTakesNonsense, "haptic/9.2-2/contact-count"},
      {HapticFault::kChannelForFixed, "haptic/7.2-10/fixed-body"},
      {HapticFault::kLosesLocal, "haptic/7.7-9/local-body"},
  }));
  std::string text;
  const Verdict verdict = JudgedHaptic(fault, id, text);
  INFO(id << ": " << text);
  CHECK(verdict == Verdict::kFailed);
}

TEST_CASE("the kit fails every world mutant in the case that is about it") {
  const auto [fault, id] = GENERATE(table<WorldFault, const char*>({
      {WorldFault::kAppliesTwice, "world/7.4-1/totals"},
      {WorldFault::kAcksAhead, "world/7.5-1/sum"},
      {WorldFault::kNoBaseline, "world/7.4-2/baseline"},
      {WorldFault::kNormalInverted, "world/6.2-5/planes"},
      {WorldFault::kNormalNotUnit, "world/6.2-5/normals"},
      {WorldFault::kNoHeartbeat, "world/3.1-4/heartbeat"},
      {WorldFault::kNoGapRule, "world/7.4-5/gap"},
      {WorldFault::kTakesForeign, "world/7.4-4/foreign-world"},
      {WorldFault::kTakesUnknownBodies, "world/7.4-6/unknown-body"},
      {WorldFault::kForgetsOldSegment, "world/7.4-7/restart"},
      {WorldFault::kFrameNumbers, "world/6.2-3/frame-numbers"},
      {WorldFault::kWrongDirection, "world/7.2-2/direction"},
      {WorldFault::kTakesNonsense, "world/9.2-3/not-a-number"},
      {WorldFault::kNeverDetaches, "world/9.2-6/ten-in-a-row"},
      {WorldFault::kWaitsForHaptic, "world/5.5-5/alone"},
      {WorldFault::kNoSecondLook, "world/4.3-1/second-look"},
      {WorldFault::kIgnoresHash, "world/8.2-3/hash"},
      {WorldFault::kRefusesMinor, "world/8.2-4/minor"},
      {WorldFault::kPublishBeforeWrite, "world/4.1-2/published"},
      {WorldFault::kNoClock, "world/9.2-8/future-stamp"},
      {WorldFault::kSaysFixed, "world/6.2-13/mobility"},
      {WorldFault::kLocalInstead, "world/7.7-6/local-state"},
      {WorldFault::kRestsDeep, "world/6.2-14/resting-gaps"},
      {WorldFault::kContactTwice, "world/6.2-15/contacts-once"},
  }));
  std::string text;
  const Verdict verdict = JudgedWorld(fault, id, text);
  INFO(id << ": " << text);
  CHECK(verdict == Verdict::kFailed);
}

TEST_CASE("what breaks a SHOULD is told, and fails strictly only") {
  std::string text;
  CHECK(JudgedHaptic(HapticFault::kNoClock, "haptic/9.2-9/jump", text) == Verdict::kNonStrict);
  INFO(text);
  CHECK(JudgedWorld(WorldFault::kNoClock, "world/9.2-9/jump", text) == Verdict::kNonStrict);
}

TEST_CASE("inspect tells what can move, and fails what contradicts itself") {
  const auto inspected = [](WorldFault fault, std::string& text) {
    const std::string instance = FreshInstance();
    const MiniWorld world(instance, fault);
    const MiniHaptic haptic(instance, HapticFault::kNone);
    std::ostringstream out;
    Reporter reporter(out, true);
    for (const Role role : {Role::kHaptic, Role::kWorld}) {
      REQUIRE(Eventually([&] {
        return Attach({.instance = instance, .role = role, .required = {}, .owners = {}}).status ==
               AttachStatus::kAttached;
      }));
    }
    check::InspectBoth(instance, {}, reporter);
    text = out.str();
    return reporter.ExitStatus();
  };
  std::string text;
  const int sound = inspected(WorldFault::kNone, text);
  INFO(text);
  CHECK(sound == 0);
  CHECK_THAT(text, Catch::Contains("1 planes, 0 of bodies that cannot move, 0 that do not say, the "
                                   "others yield by 1 to 1 1/kg"));
  CHECK_THAT(text, Catch::Contains("2 local bodies, substep 1.0 ms; body 1 (generation 1) 1 kg, 1 "
                                   "contact planes (body 0 gap 0 m)"));
  CHECK(inspected(WorldFault::kSaysFixed, text) == 1);
  CHECK_THAT(text, Catch::Contains("FAILED        world/6.2-13/mobility: body 1 is local"));
}

TEST_CASE("every case cites a sentence of SPEC.md, under an id of its own") {
  std::vector<std::string> ids = check::CaseIds();
  for (const std::string& id : ids) {
    INFO(id);
    CHECK(check::SentenceOf(check::NumberOf(id)).size() > 20);
  }
  std::sort(ids.begin(), ids.end());
  CHECK(std::adjacent_find(ids.begin(), ids.end()) == ids.end());
}

TEST_CASE("JUnit counts what fails, and strictly what should be") {
  const TemporaryFolder folder;
  const std::string path = folder.path() + "/junit.xml";
  for (const bool strict : {false, true}) {
    std::ostringstream out;
    Reporter reporter(out, strict);
    reporter.Add({"haptic/5.5-2/silence", {Verdict::kOk, ""}, 0.1});
    reporter.Add({"haptic/6.3-1/health", {Verdict::kNonStrict, "a < b & \"c\""}, 0.1});
    reporter.Add({"haptic/5.5-8/slew", {Verdict::kUnimplemented, "none"}, 0.1});
    reporter.WriteJunit(path, "suite");
    std::ifstream file(path);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    CHECK(text.find(strict ? "failures=\"1\" skipped=\"1\"" : "failures=\"0\" skipped=\"1\"") !=
          std::string::npos);
    CHECK(text.find("a &lt; b &amp; &quot;c&quot;") != std::string::npos);
    CHECK(reporter.ExitStatus() == (strict ? 1 : 0));
    reporter.Add({"haptic/5.5-2/silence", {Verdict::kFailed, "stays"}, 0.1});
    CHECK(reporter.ExitStatus() == 1);
  }
}

}  // namespace rikiseki::protocol::test

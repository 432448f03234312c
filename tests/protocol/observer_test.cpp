// SPDX-License-Identifier: MIT
#include "protocol/tools/observer.h"

#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstdio>
#include <limits>
#include <optional>
#include <set>
#include <vector>

#include "common/clock.h"
#include "protocol/words.h"
#include "tests/protocol/support.h"

namespace rikiseki::protocol {
namespace {

using test::FreshInstance;
using test::HapticOptions;
using test::TemporaryFolder;

constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();

/// A pair whose messages are set by the test.
struct Pair {
  TemporaryFolder folder;
  std::string instance = FreshInstance();
  std::optional<SegmentOwner> haptic;
  std::optional<SegmentOwner> world;

  void StartHaptic() { haptic.emplace(HapticOptions(instance, folder.path())); }
  void StartWorld() {
    OwnerOptions options = HapticOptions(instance, folder.path());
    options.role = Role::kWorld;
    options.streams = WorldStreams(50'000'000, 10, 100'000'000);
    world.emplace(options);
  }
};

std::uint64_t Now() {
  return static_cast<std::uint64_t>(MonotonicNow());
}

TEST_CASE("every reason has a sentence and a key of its own") {
  std::set<std::string> sentences;
  std::set<std::string> keys;
  for (std::uint32_t i = 0; i <= 17; ++i) {
    const auto reason = static_cast<ForceReason>(i);
    CHECK(Sentence(reason).back() == '.');
    CHECK(sentences.insert(Sentence(reason)).second);
    CHECK(keys.insert(Key(reason)).second);
    CHECK(Key(reason) != "unknown");
  }
  CHECK(Key(static_cast<ForceReason>(18)) == "unknown");
}

TEST_CASE("either side may be missing, come and go") {
  Pair pair;
  Observer observer(pair.instance);
  auto report = observer.Read();
  CHECK_FALSE(observer.found());
  CHECK(report["haptic"]["attached"] == false);
  CHECK_THAT(observer.absence(), Catch::Contains("haptic") && Catch::Contains("world"));
  CHECK(report["books"].is_null());

  pair.StartWorld();
  report = observer.Read();
  CHECK(observer.found());
  CHECK(report["haptic"]["attached"] == false);
  CHECK(report["world"]["attached"] == true);
  CHECK(report["world"]["epoch"] == pair.world->epoch());

  pair.StartHaptic();
  report = observer.Read();
  CHECK(report["haptic"]["attached"] == true);
  CHECK(report["haptic"]["state"] == "ready");

  const std::uint64_t old_epoch = pair.world->epoch();
  pair.world.reset();
  report = observer.Read();
  CHECK(report["world"]["attached"] == false);
  pair.StartWorld();
  report = observer.Read();
  CHECK(report["world"]["epoch"] > old_epoch);
}

TEST_CASE("the report gives messages as they are, impulses to the unit") {
  Pair pair;
  pair.StartHaptic();
  pair.StartWorld();
  HapticHealth health;
  health.period_ns = 1'000'000;
  health.reason = ForceReason::kWorldLost;
  health.peer_state = PeerState::kLost;
  health.feature_age_ns = 123'000'000;
  health.missed = 7;
  health.minor_faults = 3;
  health.target = {0.1, 0.2, 0.3};
  health.scheduling = {1, 80, 1, 3};
  health.lateness[0] = 99;
  health.lateness[1] = 1;                                         // [1000, 1125) ns
  health.books.displayed = {kMost, 100, -9'007'199'254'740'993};  // the last is no double
  health.books.covered = {kMost, 60, 0};
  health.books.applied = {kMost, 50, 0};
  health.books.discarded = {0, 10, 0};
  health.books.peer_lost = {0, 30, 0};
  const char device[] = "sim\xff\n";
  std::copy(std::begin(device), std::end(device), health.device.begin());
  pair.haptic->Writer<HapticHealth>().Publish(health, Now());
  HapticTick tick = test::Numbered(2);
  tick.pointers[1].reason = ForceReason::kCapped;
  tick.world_frame = 44;
  pair.haptic->Writer<HapticTick>().Publish(tick, Now());

  WorldHealth world;
  world.period_ns = 50'000'000;
  world.coupling = Coupling::kLocal;
  world.discarded[2] = {1, 2, 3};
  world.scheduling.policy = 0;
  pair.world->Writer<WorldHealth>().Publish(world, Now());
  WorldFrame frame = test::Generator(1).Frame();
  pair.world->Writer<WorldFrame>().Publish(frame, Now());
  const std::vector<Body> bodies{test::Generator(2).OneBody()};
  BodiesWriter(pair.world->Stream(StreamType::kWorldBodies)).Publish(bodies, Now());

  Observer observer(pair.instance);
  // As a reader of the text sees it.
  const auto report = nlohmann::json::parse(observer.Read().dump());
  const auto& haptic = report["haptic"];
  CHECK(haptic["reason"] == "world_lost");
  CHECK(haptic["sentence"] == Sentence(ForceReason::kWorldLost));
  CHECK(haptic["peer"]["state"] == "lost");
  CHECK(haptic["peer"]["feature_age_ms"] == 123);
  CHECK(haptic["device"] == "sim??");
  CHECK(haptic["missed"] == 7);
  CHECK(haptic["page_faults"]["minor"] == 3);
  CHECK(haptic["target_m"] == nlohmann::json({0.1, 0.2, 0.3}));
  CHECK(haptic["scheduling"]["policy"] == "SCHED_FIFO 80");
  CHECK(haptic["scheduling"]["cpu"] == 3);
  CHECK(haptic["lateness_us"]["count"] == 100);
  CHECK(haptic["lateness_us"]["p99"] == 1);
  CHECK(haptic["lateness_us"]["max"] == 1.125);
  CHECK(haptic["newest"]["world_frame"] == 44);
  CHECK(haptic["newest"]["pointers"].size() == 2);
  CHECK(haptic["newest"]["pointers"][1]["reason"] == "capped");
  CHECK(haptic["newest"]["pointers"][1]["position_m"] == nlohmann::json({3.0, 3.0, 3.0}));
  CHECK(haptic["newest"]["channels"].size() == 2);
  CHECK(haptic["newest"]["channels"][1]["impulse"] == nlohmann::json({4, 4, 4}));
  const auto& books = report["books"];
  CHECK(books["displayed"][0].get<std::int64_t>() == kMost);
  CHECK(books["displayed"][2].get<std::int64_t>() == -9'007'199'254'740'993);
  CHECK(books["pending"] == nlohmann::json({0, 10, -9'007'199'254'740'993}));
  CHECK(books["balanced"] == true);
  CHECK(report["world"]["coupling"] == "local");
  CHECK(report["world"]["discarded"]["foreign_world"] == nlohmann::json({1, 2, 3}));
  CHECK(report["world"]["scheduling"]["cpu"].is_null());
  CHECK(report["world"]["newest"]["acked_tick"] == frame.acked_tick);
  REQUIRE(report["world"]["bodies"].size() == 1);
  CHECK(report["world"]["bodies"][0]["mass_kg"] == bodies[0].mass);
  CHECK(report["world"]["bodies"][0]["position_m"] == nlohmann::json(bodies[0].position));
}

TEST_CASE("books that are one unit off are not balanced") {
  Pair pair;
  pair.StartHaptic();
  auto writer = pair.haptic->Writer<HapticHealth>();
  HapticHealth health;
  health.period_ns = 1'000'000;
  Observer observer(pair.instance);
  writer.Publish(health, Now());
  CHECK(observer.Read()["books"]["balanced"] == true);
  health.books.covered[2] = 1;
  writer.Publish(health, Now());
  CHECK(observer.Read()["books"]["balanced"] == false);
  health.books.discarded[2] = 1;
  writer.Publish(health, Now());
  CHECK(observer.Read()["books"]["balanced"] == true);
}

TEST_CASE("the measured rate is ticks over time") {
  Pair pair;
  pair.StartHaptic();
  Observer observer(pair.instance);
  pair.haptic->Heartbeat(100, Now());
  auto first = observer.Read();
  CHECK(first["haptic"]["rate"]["nominal_hz"] == 1000);
  CHECK(first["haptic"]["rate"]["measured_hz"].is_null());
  pair.haptic->Heartbeat(150, Now());
  auto second = observer.Read();
  const double seconds = (second["time_ns"].get<double>() - first["time_ns"].get<double>()) * 1e-9;
  CHECK(second["haptic"]["rate"]["measured_hz"].get<double>() ==
        Approx(50 / seconds).epsilon(1e-3));
}

/// Runs haptic_status; its output and exit status.
std::pair<std::string, int> Run(const std::string& arguments) {
  const std::string command = RIKISEKI_BIN_DIR "/haptic_status " + arguments + " 2>&1";
  FILE* const pipe = popen(command.c_str(), "r");
  REQUIRE(pipe != nullptr);
  std::string output;
  std::array<char, 4096> buffer;
  while (const std::size_t bytes = fread(buffer.data(), 1, buffer.size(), pipe)) {
    output.append(buffer.data(), bytes);
  }
  return {output, WEXITSTATUS(pclose(pipe))};
}

TEST_CASE("haptic_status ends with 1 and a sentence when nobody runs") {
  const auto [output, status] = Run("--once --instance " + FreshInstance());
  CHECK(status == 1);
  CHECK_THAT(output, Catch::Contains("neither daemon runs"));
  CHECK(Run("--once --instance a/b").second == 64);
  CHECK(Run("--nonsense").second == 64);
  CHECK(Run("--interval 0").second == 64);
  CHECK(Run("--version").second == 0);
}

TEST_CASE("haptic_status reports one side as text and as JSON") {
  Pair pair;
  pair.StartHaptic();
  HapticHealth health;
  health.period_ns = 1'000'000;
  health.reason = ForceReason::kWorldAbsent;
  pair.haptic->Writer<HapticHealth>().Publish(health, Now());
  pair.haptic->Writer<HapticTick>().Publish(test::Numbered(3), Now());
  const auto [text, text_status] = Run("--once --instance " + pair.instance);
  CHECK(text_status == 0);
  CHECK_THAT(text, Catch::Contains(Sentence(ForceReason::kWorldAbsent)));
  CHECK_THAT(text, Catch::Contains("WORLD   not there"));
  CHECK_THAT(text, Catch::Contains("BOOKS   balanced"));
  const auto [json, json_status] = Run("--once --json --instance " + pair.instance);
  CHECK(json_status == 0);
  const auto report = nlohmann::json::parse(json);
  CHECK(report["haptic"]["reason"] == "world_absent");
  CHECK(report["haptic"]["rate"]["measured_hz"] == 0);
  CHECK(std::count(json.begin(), json.end(), '\n') == 1);
}

}  // namespace
}  // namespace rikiseki::protocol

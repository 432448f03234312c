// SPDX-License-Identifier: MIT
// haptic_log beside a real pair: every tick is in the recording, over a restart of either side, and all but
// the last moment is there when the recorder is killed.
#include <signal.h>

#include <array>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>
#include <sstream>
#include <thread>

#include "tests/common/temporary_folder.h"
#include "tests/process/child.h"
#include "tests/process/observer.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using Catch::Matchers::Contains;
using protocol::Role;

std::vector<std::string> Server(const std::string& name, const std::string& instance) {
  return {Program(name + "_server"), "--config", SourceFile("config/" + name + "_server.ini"),
          "--instance", instance};
}

std::string OutputOf(const std::string& command) {
  std::FILE* const pipe = popen(command.c_str(), "r");
  REQUIRE(pipe != nullptr);
  std::string output;
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) output += buffer.data();
  CHECK(pclose(pipe) == 0);
  return output;
}

struct Row {
  std::uint64_t epoch = 0;
  std::uint64_t tick = 0;
  std::uint64_t world_frame = 0;
  bool frame_known = false;
  double x = 0;
  double force_x = 0;
  double impulse_x = 0;
};

std::vector<Row> Export(const std::string& recording, const std::string& csv) {
  Child log({Program("haptic_log"), "export", recording, "--out", csv});
  REQUIRE(log.Wait(60) == 0);
  std::ifstream file(csv);
  std::string line;
  std::getline(file, line);
  CHECK_THAT(line, Contains("feature_age_ms") && Contains("missed_before") && Contains("fx_n"));
  std::vector<Row> rows;
  while (std::getline(file, line)) {
    std::vector<std::string> cells;
    std::istringstream text(line);
    for (std::string cell; std::getline(text, cell, ',');) cells.push_back(cell);
    REQUIRE(cells.size() == 22);
    rows.push_back({.epoch = std::stoull(cells[1]),
                    .tick = std::stoull(cells[2]),
                    .world_frame = std::stoull(cells[16]),
                    .frame_known = !cells[18].empty(),
                    .x = std::stod(cells[6]),
                    .force_x = std::stod(cells[12]),
                    .impulse_x = std::stod(cells[19])});
  }
  return rows;
}

// Within an epoch every tick follows the one before it.
void CheckComplete(const std::vector<Row>& rows) {
  std::uint64_t gaps = 0;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    if (rows[i].epoch == rows[i - 1].epoch && rows[i].tick != rows[i - 1].tick + 1) ++gaps;
  }
  CHECK(gaps == 0);
}

}  // namespace

TEST_CASE("every tick is in the recording, over a restart, with the frame that it displays") {
  const Instance instance;
  const TemporaryFolder folder;
  const std::string recording = folder.File("run.rk");
  Child world(Server("world", instance));
  std::optional<Child> haptic;
  haptic.emplace(Server("haptic", instance));
  const auto first = Observe(instance, Role::kHaptic);
  Child log({Program("haptic_log"), "record", recording, "--instance", instance});
  REQUIRE(Eventually([&] { return log.Stderr().find("haptic epoch") != std::string::npos; }));
  TickWatch watch(instance, 5000);
  REQUIRE(Eventually([&] { return watch.Latest().force > 1; }, 20));
  haptic->Signal(SIGTERM);
  REQUIRE(haptic->Wait() == 0);
  const std::uint64_t last_tick = first->Tick();
  haptic.emplace(Server("haptic", instance));
  const auto second = Observe(instance, Role::kHaptic);
  REQUIRE(Eventually([&] { return second->Tick() > 500; }, 20));
  log.Signal(SIGINT);
  REQUIRE(log.Wait() == 0);

  const std::vector<Row> rows = Export(recording, folder.File("run.csv"));
  CheckComplete(rows);
  CHECK(rows.back().epoch == second->epoch());
  bool ended = false;
  double impulse = 0;
  double force = 0;
  for (const Row& row : rows) {
    ended = ended || (row.epoch == first->epoch() && row.tick == last_tick);
    impulse = std::max(impulse, row.impulse_x);
    force = std::max(force, -row.force_x);  // on the user; the impulse is on the body
    // Of those before the recorder came, the frames may be overwritten.
    if (row.epoch == second->epoch() && row.world_frame > 0) CHECK(row.frame_known);
  }
  CHECK(ended);
  CHECK(force > 1);
  CHECK(impulse > 0);
  const std::string info = OutputOf(Program("haptic_log") + " info " + recording);
  CHECK_THAT(info, Contains("haptic.tick    epoch " + std::to_string(first->epoch())));
  CHECK_THAT(info, Contains("world.frame") && Contains("contact"));
  CHECK_THAT(info, !Contains("ends within a message"));
}

TEST_CASE("a recording moves the finger of another server as it moved, until it is over") {
  const Instance instance;
  const TemporaryFolder folder;
  const std::string recording = folder.File("run.rk");
  {
    Child haptic(Server("haptic", instance));
    Observe(instance, Role::kHaptic);
    Child log(
        {Program("haptic_log"), "record", recording, "--instance", instance, "--seconds", "3"});
    REQUIRE(log.Wait(60) == 0);
  }
  const std::vector<Row> recorded = Export(recording, folder.File("run.csv"));
  REQUIRE(recorded.size() > 1000);

  std::vector<std::string> command = Server("haptic", instance);
  command.insert(command.end(), {"--device", "replay", "--set", "device.file=" + recording});
  Child replay(command);
  TickWatch watch(instance, 5000);
  REQUIRE(
      Eventually([&] { return watch.Latest().reason == protocol::ForceReason::kDeviceFault; }, 30));
  CHECK_THAT(replay.Stderr(), Contains("on recording"));
  // A free hand: the places are those of the recording, the times those of another run. At up to
  // 0.7 m/s the nearest of the recorded ticks is within 0.7 mm, or as much more as a tick was late.
  double nearest_to_front = 1;
  double front = -1;
  for (const Row& row : recorded) front = std::max(front, row.x);
  for (const WatchedTick& tick : watch.All()) {
    nearest_to_front = std::min(nearest_to_front, std::abs(tick.finger_x - front));
    CHECK(tick.finger_x <= front);
  }
  CHECK(nearest_to_front < 1e-3);
}

TEST_CASE("a recorder that is killed leaves all but its last second") {
  const Instance instance;
  const TemporaryFolder folder;
  const std::string recording = folder.File("run.rk");
  Child haptic(Server("haptic", instance));
  Child log({Program("haptic_log"), "record", recording, "--instance", instance});
  const auto view = Observe(instance, Role::kHaptic);
  REQUIRE(Eventually([&] { return log.Stderr().find("haptic epoch") != std::string::npos; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(2500));
  log.Freeze();  // a machine that is too slow to record is not under test
  const std::uint64_t tick = view->Tick();
  log.Signal(SIGKILL);
  log.Wait();
  const std::vector<Row> rows = Export(recording, folder.File("run.csv"));
  REQUIRE_FALSE(rows.empty());
  CheckComplete(rows);
  // A flush each half second, and what the disk and the scheduler take.
  CHECK(rows.back().tick + 1500 > tick);
  CHECK(haptic.IsRunning());
}

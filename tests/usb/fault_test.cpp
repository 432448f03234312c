// SPDX-License-Identifier: MIT
// What goes wrong on a bus: the daemon does not crash, loses no descriptor, the motors are at zero in
// time, the reason stands in the health stream, and it takes the board again by itself.
#include <signal.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "protocol/words.h"
#include "tests/process/observer.h"
#include "tests/usb/emulated_bus.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)
using Catch::Matchers::Contains;
using protocol::ForceReason;
using protocol::Role;

constexpr int kWatchdogTicks = 20;
constexpr double kPatienceS = 20;
// What an ordinary user of no group is.
constexpr char kNobody[] = "64003";

// A daemon on an emulated bus, without a world: the device is what this is about.
class Daemon {
 public:
  explicit Daemon(EmulatedBus& bus, const std::vector<std::string>& more = {})
      : bus_(bus),
        process_(bus.HapticCommand(instance_, more)),
        view_(Observe(instance_, Role::kHaptic)) {}

  std::string device() const {
    const auto name = health().device;
    return protocol::Printable(name.data(), name.size());
  }
  protocol::HapticHealth health() const { return ReadHapticHealth(*view_); }
  ForceReason reason() const { return health().reason; }

  bool Says(const std::string& trouble) const {
    return Eventually([&] { return device() == trouble && reason() == ForceReason::kDeviceFault; },
                      kPatienceS);
  }

  bool Logs(const std::string& text) const {
    return Eventually([&] { return process_.Stderr().find(text) != std::string::npos; },
                      kPatienceS);
  }

  // It answers, and is asked.
  bool Runs() const {
    const long before = bus_.status().readings;
    const bool runs = Eventually(
        [&] {
          return device().starts_with("SPIDAR on USB") && reason() == ForceReason::kWorldAbsent &&
                 bus_.status().readings > before + 20;
        },
        kPatienceS);
    if (!runs) WARN("device: " << device() << "; log: " << process_.Stderr());
    return runs;
  }

  std::ptrdiff_t Descriptors() const {
    const auto begin =
        std::filesystem::directory_iterator("/proc/" + std::to_string(process_.pid()) + "/fd");
    return std::distance(begin, std::filesystem::directory_iterator());
  }

  Child& process() { return process_; }

 private:
  Instance instance_;
  EmulatedBus& bus_;
  Child process_;
  std::unique_ptr<protocol::PeerView> view_;
};

bool MotorsComeToZero(EmulatedBus& bus) {
  return Eventually([&] { return bus.status().motors_at_zero == 1; }, 5) &&
         bus.status().longest_pull_ticks < kWatchdogTicks;
}

int Cycles() {
  return std::getenv("RIKISEKI_FULL") != nullptr ? 200 : 10;
}

}  // namespace

TEST_CASE("unplugged and plugged in again, over and over, with counters kept or lost") {
  const char* file = GENERATE("spidar4_simple.ini", "spidar4_sh4.ini", "spidar_g6x3r_sh4.ini");
  EmulatedBus bus(file, {"--set", "hand.script=rest"});
  bus.Tell("plug");
  // The hand rests, 50 mm from the middle: a board that forgot its counters under a hand that moves before it is
  // read again cannot be told from one that kept them.
  Daemon daemon(bus);
  REQUIRE(daemon.Runs());
  REQUIRE(Eventually([&] { return bus.status().readings > 600; }, kPatienceS));  // it is there
  const std::ptrdiff_t descriptors = daemon.Descriptors();
  for (int cycle = 0; cycle < Cycles() / 2; ++cycle) {
    CAPTURE(file, cycle);
    bus.Tell("unplug");
    REQUIRE(daemon.Says("SPIDAR: unplugged"));
    REQUIRE(MotorsComeToZero(bus));
    if (cycle % 2 == 0) bus.Tell("forget");
    bus.Tell("plug");
    REQUIRE(daemon.Runs());
    CHECK(daemon.Descriptors() == descriptors);
  }
  daemon.process().Signal(SIGTERM);
  CHECK(daemon.process().Wait() == 0);
  CHECK(bus.status().motors_at_zero == 1);
  CHECK(bus.status().nonsense == 0);
}

TEST_CASE("no transfer fails, and none is misunderstood, for as long as the board is well") {
  const char* file = GENERATE("spidar4_simple.ini", "spidar4_sh4.ini");
  CAPTURE(file);
  EmulatedBus bus(file);
  bus.Tell("plug");
  Daemon daemon(bus);
  REQUIRE(daemon.Runs());
  const auto seconds = std::chrono::seconds(std::getenv("RIKISEKI_FULL") != nullptr ? 60 : 3);
  const protocol::HapticHealth before = daemon.health();
  std::this_thread::sleep_for(seconds);
  const protocol::HapticHealth after = daemon.health();
  REQUIRE(daemon.Runs());
  WARN(file << ": "
            << static_cast<double>(after.ticks - before.ticks) /
                   std::chrono::duration<double>(seconds).count()
            << " ticks/s of " << kUsbRateHz << ", " << after.missed - before.missed
            << " deadlines missed in " << seconds.count() << " s");
  daemon.process().Signal(SIGTERM);
  CHECK(daemon.process().Wait() == 0);
  // Late answers are the machine's, and may be; everything else would be ours.
  for (const char* error : {"transfer failed", "stalled", "wrong length", "echo", "unplugged"}) {
    CHECK_THAT(daemon.process().Stderr(), !Contains(error));
  }
  CHECK(bus.status().nonsense == 0);
}

TEST_CASE("faults of the bus and the firmware: each is named and gets over by itself") {
  const std::string file = GENERATE("spidar4_simple.ini", "spidar4_sh4.ini");
  CAPTURE(file);
  EmulatedBus bus(file);
  bus.Tell("plug");
  Daemon daemon(bus);
  REQUIRE(daemon.Runs());
  const std::ptrdiff_t descriptors = daemon.Descriptors();
  // A stall is over as soon as the board is opened anew.
  bus.Tell("stall_in");
  CHECK(daemon.Logs("an endpoint of the board stalled"));
  CHECK(daemon.Runs());
  bus.Tell("stall_out");
  CHECK(daemon.Runs());

  bus.Tell("reply_bytes 16");
  CHECK(daemon.Says("SPIDAR: wrong firmware"));
  CHECK(daemon.Logs("answers 16 bytes, not "));
  CHECK(MotorsComeToZero(bus));
  bus.Tell("reply_bytes right");
  CHECK(daemon.Runs());

  bus.Tell("late_us 10000");
  CHECK(daemon.Logs("came late or not at all"));
  bus.Tell("late_us 0");
  CHECK(daemon.Runs());

  bus.Tell("mute on");
  CHECK(daemon.Says("SPIDAR: board does not answer"));
  bus.Tell("mute off");
  CHECK(daemon.Runs());

  bus.Tell("nak on");
  CHECK(daemon.Says("SPIDAR: board does not answer"));
  CHECK(MotorsComeToZero(bus));
  bus.Tell("nak off");
  CHECK(daemon.Runs());

  if (file == "spidar4_sh4.ini") {
    bus.Tell("wrong_echo on");
    CHECK(daemon.Says("SPIDAR: wrong firmware"));
    CHECK(daemon.Logs("does not echo its D/A settings"));
    bus.Tell("wrong_echo off");
    CHECK(daemon.Runs());
  }

  bus.Tell("foreign on");
  CHECK(daemon.Says("SPIDAR: wrong firmware"));
  bus.Tell("foreign off");
  CHECK(daemon.Runs());

  bus.Tell("unplug");
  bus.Tell("plug_blank");
  CHECK(daemon.Says("SPIDAR: board without firmware"));
  CHECK(daemon.Logs("04B4:8613"));
  bus.Tell("unplug_blank");
  bus.Tell("plug busy");
  CHECK(daemon.Says("SPIDAR: used by another program"));
  bus.Tell("busy off");
  CHECK(daemon.Runs());

  CHECK(daemon.Descriptors() == descriptors);
  CHECK(MotorsComeToZero(bus) == false);  // they hold the strings
  daemon.process().Signal(SIGKILL);
  daemon.process().Wait();
  CHECK(MotorsComeToZero(bus));  // the firmware's work
}

TEST_CASE("two boards: the daemon takes neither until it is told or one is gone") {
  EmulatedBus bus("spidar4_sh4.ini");
  bus.Tell("plug");
  bus.Tell("plug_second");
  Daemon daemon(bus);
  CHECK(daemon.Says("SPIDAR: more than one board"));
  CHECK(daemon.Logs("usb.switch_id"));
  bus.Tell("unplug_second");
  CHECK(daemon.Runs());
}

TEST_CASE("a board with another switch is not taken, and --check tells") {
  EmulatedBus bus("spidar4_simple.ini");
  bus.Tell("plug");
  {
    Daemon daemon(bus, {"--set", "usb.switch_id=9"});
    CHECK(daemon.Says("SPIDAR: wrong switch or serial"));
    CHECK(daemon.Logs("has its switch at 5"));
  }
  // Its stdout, by the way of a shell that sends it to where the test reads.
  std::string command;
  for (const std::string& word : bus.HapticCommand("check", {"--check"})) command += word + " ";
  Child check({"/bin/sh", "-c", command + "1>&2"});
  CHECK(check.Wait() == 0);
  CHECK_THAT(check.Stderr(),
             Contains("# device: board Simple (0CEC:0203) at bus 1 device 2, switch "
                      "at 5"));
  CHECK(bus.status().motors_at_zero == 1);
  Daemon daemon(bus, {"--set", "usb.switch_id=5"});
  CHECK(daemon.Runs());
}

TEST_CASE(
    "without permission the daemon says which rule and group, and takes the board when it may") {
  if (geteuid() != 0) {
    WARN("not root: skipped");
    return;
  }
  EmulatedBus bus("spidar4_simple.ini");
  bus.Tell("plug forbidden");
  // An observer would not trust a segment of such a user: log and board must do.
  const Instance instance;
  std::vector<std::string> command = bus.HapticCommand(instance);
  command.insert(command.begin(), {"/usr/bin/setpriv", std::string("--reuid=") + kNobody,
                                   std::string("--regid=") + kNobody, "--clear-groups"});
  Child daemon(command);
  const auto logs = [&](const std::string& text) {
    return Eventually([&] { return daemon.Stderr().find(text) != std::string::npos; }, kPatienceS);
  };
  CHECK(logs("permission denied"));
  CHECK_THAT(daemon.Stderr(), Contains("70-rikiseki.rules") && Contains("group haptics"));
  CHECK(bus.status().commands == 0);
  bus.Tell("permit");
  CHECK(Eventually([&] { return bus.status().readings > 100; }, kPatienceS));
  daemon.Signal(SIGTERM);
  CHECK(daemon.Wait() == 0);
  CHECK(bus.status().motors_at_zero == 1);
}

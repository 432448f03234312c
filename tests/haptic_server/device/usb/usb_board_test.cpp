// SPDX-License-Identifier: MIT
// The driver over a byte-level port in virtual time: the same hand, the same trace as the simulated
// device; and what it does when packets are late, short or wrong, and when the board goes and comes.
#include "haptic_server/device/usb/usb_board.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <utility>

#include "haptic_server/device/make_device.h"
#include "haptic_server/device/simulated_board.h"
#include "haptic_server/device/usb/simple_packets.h"
#include "tests/usb/emulated_board.h"
#include "tests/usb/emulated_port.h"

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kTickNs = 1'000'000;

Settings Load(const std::string& device, const std::vector<std::string>& more = {}) {
  std::vector<std::string> set = {
      "device.kind=usb", "device.file=" RIKISEKI_SOURCE_DIR "/config/devices/" + device,
      // From the middle, where the counters begin.
      "hand.home_mm=0 0 0", "hand.stroke_mm=25 10 -8", "hand.rest_ms=50", "hand.reach_ms=150"};
  set.insert(set.end(), more.begin(), more.end());
  return LoadSettings(RIKISEKI_SOURCE_DIR "/config/haptic_server.ini", set);
}

// Board, firmware and driver of a device file, tick by tick.
struct Rig {
  explicit Rig(const Settings& settings) : firmware(settings, 0) {
    auto made = std::make_unique<test::EmulatedPort>(firmware);
    port = made.get();
    if (settings.usb.board == UsbBoardModel::kSimple) {
      port->Send(UsbPurpose::kCommand, simple::EncodePhase(0xFF));
    }
    board =
        std::make_unique<UsbBoard>(settings.usb, settings.spidar.tension_min_n, std::move(made));
  }

  bool Tick(const PerString& tension) {
    port->now_ns += kTickNs;
    const bool read = board->ReadCounts(port->now_ns, counts);
    board->WriteTensions(tension);
    port->NextTick();
    return read;
  }

  test::EmulatedBoard firmware;
  test::EmulatedPort* port = nullptr;
  std::unique_ptr<UsbBoard> board;
  EncoderCounts counts{};
};

// A board that remembers what it said.
class Recorded final : public MotorBoard {
 public:
  Recorded(std::unique_ptr<MotorBoard> board, EncoderCounts* counts)
      : board_(std::move(board)), counts_(counts) {}
  bool ReadCounts(std::int64_t now_ns, EncoderCounts& counts) noexcept override {
    const bool read = board_->ReadCounts(now_ns, counts);
    *counts_ = counts;
    return read;
  }
  bool WriteTensions(const PerString& tension) noexcept override {
    return board_->WriteTensions(tension);
  }
  bool Enabled() const noexcept override { return board_->Enabled(); }
  const Hand* hand() const noexcept override { return nullptr; }
  std::string Name() const override { return board_->Name(); }

 private:
  std::unique_ptr<MotorBoard> board_;
  EncoderCounts* counts_;
};

// What a stiff wall at 12 mm answers.
Vec3 WallForce(const Vec3& position) {
  constexpr double kWall = 0.012;       // m
  constexpr double kStiffness = 1'000;  // N/m
  return position.x() > kWall ? Vec3(-kStiffness * (position.x() - kWall), 0, 0) : Vec3(0, 0, 0);
}

TEST_CASE("the same hand gives the same trace as through the simulated device, within one count") {
  const std::string file =
      GENERATE("spidar4_simple.ini", "spidar4_sh4.ini", "spidar_big4_simple.ini",
               "spidar_big4_sh4.ini", "spidar_g6x3_4_simple.ini", "spidar_g6x3_4_sh4.ini",
               "spidar_g6x3r_simple.ini", "spidar_g6x3r_sh4.ini", "spidar_g6x3l_sh4.ini");
  CAPTURE(file);
  const Settings settings = Load(file);
  EncoderCounts simulated_counts{};
  EncoderCounts usb_counts{};
  const auto simulated = MakeSpidar(
      settings.spidar, std::make_unique<Recorded>(
                           std::make_unique<SimulatedBoard>(settings.spidar, MakeHand(settings)),
                           &simulated_counts));
  Rig rig(settings);
  test::EmulatedPort& port = *rig.port;
  const auto usb =
      MakeSpidar(settings.spidar, std::make_unique<Recorded>(std::move(rig.board), &usb_counts));
  std::int64_t largest_count = 0;
  double largest_force = 0;
  for (int tick = 0; tick < 3000; ++tick) {
    port.now_ns = tick * kTickNs;
    DeviceSample sample;
    REQUIRE(simulated->Read(port.now_ns, sample) == DeviceStatus::kOk);
    largest_force = std::max(largest_force, simulated->Write(WallForce(sample.position)).norm());
    REQUIRE(usb->Read(port.now_ns, sample) == DeviceStatus::kOk);
    usb->Write(WallForce(sample.position));
    port.NextTick();
    for (std::size_t string = 0; string < settings.spidar.motors_m.size(); ++string) {
      REQUIRE(std::abs(usb_counts[string] - simulated_counts[string]) <= 1);
      largest_count = std::max(largest_count, std::abs(usb_counts[string]));
    }
  }
  CHECK(largest_count > 300);
  CHECK(largest_force > 2);
  CHECK(rig.firmware.nonsense() == 0);
}

TEST_CASE("the encoders are read and the tensions computed from them sent in the same tick") {
  for (const char* file : {"spidar4_simple.ini", "spidar4_sh4.ini"}) {
    Rig rig(Load(file, {"usb.channels=6 0 3 1", "usb.digit_per_volt=400 410 420 430",
                        "usb.volt_per_newton=0.3"}));
    for (int tick = 0; tick < 5; ++tick) {
      const auto sent = rig.port->sent;
      const double t = 1 + tick;
      REQUIRE(rig.Tick({t, 2 * t, 0.5, -1}));
      CHECK(rig.port->sent == sent + 2);
      CHECK(rig.firmware.digits()[6] == std::round(t * 120));
      CHECK(rig.firmware.digits()[0] == std::round(2 * t * 123));
      CHECK(rig.firmware.digits()[3] == 63);
      CHECK(rig.firmware.digits()[1] == 0);  // a string cannot push
      for (const int unused : {2, 4, 5, 7}) CHECK(rig.firmware.digits().at(unused) == 0);
    }
    const double nan = std::nan("");
    rig.Tick({nan, 1e9, HUGE_VAL, 0});
    CHECK(rig.firmware.digits()[6] == 0);
    CHECK(rig.firmware.digits()[0] == 4095);
    CHECK(rig.firmware.digits()[3] == 4095);
  }
}

TEST_CASE("a reply or three that miss are bridged by the last counts, more are a fault in words") {
  for (const char* file : {"spidar4_simple.ini", "spidar4_sh4.ini"}) {
    Rig rig(Load(file));
    for (int tick = 0; tick < 400; ++tick) REQUIRE(rig.Tick({1, 1, 1, 1}));
    const EncoderCounts before = rig.counts;
    CHECK(before != EncoderCounts{});
    rig.firmware.faults.reply_bytes = 31;
    for (int missed = 1; missed < kHopelessReadings; ++missed) {
      CHECK(rig.Tick({1, 1, 1, 1}) == (missed <= kHeldReadings));
      CHECK(rig.counts == before);
      CHECK(std::string(rig.board->Trouble()) ==
            (missed <= kHeldReadings ? "" : "SPIDAR: short packets"));
    }
    CHECK(rig.port->times_given_up == 0);
    SECTION("and it is over when they are right again") {
      rig.firmware.faults.reply_bytes.reset();
      CHECK(rig.Tick({1, 1, 1, 1}));
      CHECK(std::string(rig.board->Trouble()).empty());
    }
    SECTION("for long: the board is given up, with the motors at minimum tension") {
      CHECK_FALSE(rig.Tick({9, 9, 9, 9}));
      CHECK(rig.port->given_up == UsbTrouble::kShortReply);
      for (int channel = 0; channel < 4; ++channel) {
        CHECK(rig.firmware.digits().at(static_cast<std::size_t>(channel)) == 76);  // 0.5 N
      }
    }
  }
}

TEST_CASE("Sh4: digits that come back wrong are not trusted") {
  Rig rig(Load("spidar4_sh4.ini"));
  REQUIRE(rig.Tick({1, 1, 1, 1}));
  rig.firmware.faults.wrong_echo = true;
  for (int missed = 1; missed <= kHopelessReadings; ++missed) {
    CHECK(rig.Tick({1, 1, 1, 1}) == (missed <= kHeldReadings));
  }
  CHECK(rig.port->given_up == UsbTrouble::kWrongEcho);
}

TEST_CASE("late replies are never taken for newer ones") {
  for (const char* file : {"spidar4_simple.ini", "spidar4_sh4.ini"}) {
    Rig rig(Load(file));
    Rig punctual(Load(file));
    for (int tick = 0; tick < 600; ++tick) {
      rig.port->late_ticks = (tick + 40) % 50 < 2 ? 1 : 0;
      REQUIRE(rig.Tick({1, 1, 1, 1}));
      REQUIRE(punctual.Tick({1, 1, 1, 1}));
      if ((tick + 40) % 50 > 5) REQUIRE(rig.counts == punctual.counts);
    }
    CHECK(rig.port->times_given_up == 0);
    rig.port->late_ticks = 100'000;
    int ticks = 0;
    while (rig.port->times_given_up == 0 && ticks < 100) {
      rig.Tick({1, 1, 1, 1});
      ++ticks;
    }
    CHECK(ticks == kHopelessReadings);
    CHECK(rig.port->given_up == UsbTrouble::kLateReply);
  }
}

TEST_CASE("a board that vanishes is a fault at once, and goes on counting when it comes back") {
  const bool forgets = GENERATE(false, true);
  for (const char* file : {"spidar4_simple.ini", "spidar4_sh4.ini"}) {
    CAPTURE(file, forgets);
    Rig rig(Load(file));
    Rig undisturbed(Load(file));
    const auto tick_both = [&] {
      undisturbed.Tick({1, 1, 1, 1});
      return rig.Tick({1, 1, 1, 1});
    };
    for (int tick = 0; tick < 220; ++tick) REQUIRE(tick_both());
    for (int cycle = 0; cycle < 5; ++cycle) {
      for (int tick = 0; tick < 77; ++tick) REQUIRE(tick_both());
      rig.port->plugged = false;
      // While nothing is asked the emulated hand stands still, and so does its clock here.
      CHECK_FALSE(rig.board->ReadCounts(rig.port->now_ns, rig.counts));
      CHECK(rig.port->given_up == UsbTrouble::kUnplugged);
      CHECK(std::string(rig.board->Trouble()) == "SPIDAR: unplugged");
      CHECK_FALSE(rig.board->WriteTensions({1, 1, 1, 1}));
      for (int tick = 0; tick < 30; ++tick) rig.firmware.FirmwareTick();
      CHECK(rig.firmware.MotorsAtZero());
      if (forgets) rig.firmware.ForgetCounters();
      rig.port->plugged = true;
      if (file == std::string("spidar4_simple.ini")) {
        rig.port->Send(UsbPurpose::kCommand, simple::EncodePhase(0xFF));
      }
      REQUIRE(tick_both());
      // The motors were off for one tick: 0.1 N on 0.93 kg for 1 ms moves no count.
      for (std::size_t string = 0; string < kTensionStrings; ++string) {
        CHECK(std::abs(rig.counts[string] - undisturbed.counts[string]) <= 1);
      }
    }
    CHECK(rig.port->times_given_up == 5);
    CHECK(rig.firmware.longest_uncommanded_pull() < test::kWatchdogTicks);
  }
}

TEST_CASE("a stalled endpoint: minimum tension is tried first, then the board is given up") {
  Rig rig(Load("spidar4_simple.ini"));
  REQUIRE(rig.Tick({5, 5, 5, 5}));
  rig.port->broken = UsbTrouble::kStalled;
  CHECK_FALSE(rig.board->ReadCounts(rig.port->now_ns, rig.counts));
  CHECK(rig.port->given_up == UsbTrouble::kStalled);
}

TEST_CASE("the enable input is a bit of the parallel port") {
  for (const auto& [file, bit] :
       {std::pair("spidar4_simple.ini", 2), std::pair("spidar4_sh4.ini", 9)}) {
    Rig rig(Load(file, {"usb.enable_bit=" + std::to_string(bit)}));
    rig.Tick({1, 1, 1, 1});
    CHECK_FALSE(rig.board->Enabled());
    rig.firmware.inputs = static_cast<std::uint16_t>(1 << bit);
    rig.Tick({1, 1, 1, 1});
    CHECK(rig.board->Enabled());
    rig.firmware.inputs = static_cast<std::uint16_t>(~(1 << bit) & ~0xF0);
    rig.Tick({1, 1, 1, 1});
    CHECK_FALSE(rig.board->Enabled());
  }
  Rig without(Load("spidar4_simple.ini"));
  without.Tick({1, 1, 1, 1});
  CHECK(without.board->Enabled());
}

}  // namespace
}  // namespace rikiseki::haptic

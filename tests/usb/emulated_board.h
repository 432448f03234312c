// SPDX-License-Identifier: MIT
// The electronics and firmware of a Cyverse board that is not there, byte by byte, with the strings and
// the hand of haptic_server's simulated board behind it. It reads and writes packets by the published
// tables on its own: nothing of the driver's packet code is used.
//
// Assumptions, for nothing is published about them: the firmware drops all motors after 20 ticks
// without a command; a board without power forgets its counters.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "haptic_server/device/simulated_board.h"
#include "haptic_server/settings.h"
#include "tests/usb/emulated_firmware.h"

namespace rikiseki::test {

inline constexpr int kWatchdogTicks = 20;

/// What a test may break.
struct BoardFaults {
  std::optional<std::size_t> reply_bytes;  // replies of this length
  bool wrong_echo = false;                 // of an Sh4
  bool foreign_firmware = false;           // answers to nothing it should, and nonsense to the rest
};

class EmulatedBoard final : public EmulatedFirmware {
 public:
  /// When the hand goes through its script.
  enum class Begins { kByItself, kOnRequest };

  /// Board, strings and hand of the settings; `switch_id` is where its rotary switch stands.
  EmulatedBoard(const haptic::Settings& settings, int switch_id, Begins begins = Begins::kByItself);
  EmulatedBoard(const EmulatedBoard&) = delete;
  EmulatedBoard& operator=(const EmulatedBoard&) = delete;

  /// The hand, which waited at home, goes through its script once, and waits again.
  void Begin() { is_requested_ = true; }

  /// The hand stays in the middle for so many ticks of `tick_ns`, is then carried to its home in as
  /// many, and only then begins its script.
  void HoldInTheMiddle(int ticks, std::int64_t tick_ns);

  /// Moves the hand on to `now_ns` if the packet asks for the counters.
  std::optional<std::vector<std::uint8_t>> Handle(std::span<const std::uint8_t> packet,
                                                  std::int64_t now_ns) override;
  void FirmwareTick() override;

  /// As after a loss of power.
  void ForgetCounters();

  /// D/A settings of all channels.
  const std::array<std::uint16_t, 8>& digits() const { return digits_; }
  bool MotorsAtZero() const;

  /// The most ticks that any channel was above zero after the last valid command before it.
  int longest_uncommanded_pull() const { return longest_uncommanded_pull_; }

  std::uint64_t readings() const { return readings_; }
  std::uint64_t commands() const { return commands_; }
  std::uint64_t nonsense() const { return nonsense_; }  // packets that mean nothing

  /// What Simple was told by A2 1A and A2 19, in their order: {command, mask}.
  const std::vector<std::array<std::uint8_t, 2>>& set_up() const { return set_up_; }

  BoardFaults faults;
  std::uint16_t inputs = 0;  // of the parallel port, beside the switch

 private:
  std::optional<std::vector<std::uint8_t>> HandleSimple(std::span<const std::uint8_t> packet,
                                                        std::int64_t now_ns);
  std::optional<std::vector<std::uint8_t>> HandleSh4(std::span<const std::uint8_t> packet,
                                                     std::int64_t now_ns);
  void Command(std::span<const std::uint8_t> words);
  void Advance(std::int64_t now_ns);
  Vec3 HandTarget(double t_s);

  haptic::Settings settings_;
  int switch_id_;
  haptic::MotorProgram program_;
  double begun_s_ = 0;
  bool is_requested_ = false;
  haptic::SimulatedBoard board_;
  std::int64_t held_until_ns_ = 0;
  std::int64_t carried_until_ns_ = 0;
  std::array<std::uint16_t, 8> digits_{};
  int uncommanded_ticks_ = 0;
  int longest_uncommanded_pull_ = 0;
  std::array<std::int64_t, 8> counters_{};  // as the wires turn them, longer strings as wired
  std::array<std::int64_t, 8> cleared_at_{};
  std::uint8_t phase_ = 0;
  std::uint64_t readings_ = 0;
  std::uint64_t commands_ = 0;
  std::uint64_t nonsense_ = 0;
  std::vector<std::array<std::uint8_t, 2>> set_up_;
};

}  // namespace rikiseki::test

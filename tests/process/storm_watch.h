// SPDX-License-Identifier: MIT
// The storm's own witness: reads every message of every epoch of both sides from their segments,
// while their owners come and go, and computes from the haptic ticks alone what was delivered.
//
// A dead owner's segment stays mapped and is read to its end: its content is frozen and whole.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "protocol/attach.h"
#include "protocol/messages.h"

namespace rikiseki::test {

protocol::ImpulseUnits operator+(const protocol::ImpulseUnits& a, const protocol::ImpulseUnits& b);
protocol::ImpulseUnits operator-(const protocol::ImpulseUnits& a, const protocol::ImpulseUnits& b);

/// What the witness keeps of a haptic tick. Its place in HapticHistory::ticks is its number.
struct TickRecord {
  std::uint64_t start_ns = 0;
  std::uint64_t previous_duration_ns = 0;
  std::uint64_t world_epoch = 0;
  std::uint64_t world_frame = 0;
  protocol::Vector force{};  // N, on the user
  protocol::ForceReason reason{};
  protocol::ImpulseUnits delivered{};  // growth of all body channels since the epoch began
  protocol::ImpulseUnits ground{};
};

/// What the witness keeps of a haptic health message.
struct BooksRecord {
  std::uint64_t ticks = 0;
  protocol::Books books;
};

/// One haptic epoch.
struct HapticHistory {
  std::uint64_t epoch = 0;
  std::uint64_t period_ns = 0;
  double force_cap = 0;  // N
  std::vector<TickRecord> ticks;
  std::vector<BooksRecord> books;  // samples; the last of the epoch among them
  std::uint64_t lost = 0;          // messages that the witness missed, must be 0
};

/// What the witness keeps of a world.health message.
struct LifeRecord {
  std::uint64_t frame = 0;
  std::uint64_t lapped = 0;
  protocol::ImpulseUnits applied{};
  std::array<protocol::ImpulseUnits, protocol::kDiscardReasons> discarded{};
};

/// The block after a frame.
struct BlockRecord {
  std::uint64_t frame = 0;
  std::uint32_t generation = 0;
  double mass = 0;
  protocol::Vector position{};
  protocol::Vector velocity{};
};

/// One world epoch. The planes of the frames are not kept.
struct WorldHistory {
  std::uint64_t epoch = 0;
  std::vector<protocol::WorldFrame> frames;
  std::vector<LifeRecord> lives;
  std::vector<BlockRecord> blocks;
  std::uint64_t lost = 0;
};

class StormWatch {
 public:
  explicit StormWatch(std::string instance);
  ~StormWatch();

  /// Makes sure that the segment that now bears the name is being read, if it is ready. To be
  /// called while its owner lives (it may be stopped), before it is killed.
  /// Whether the present one is being read.
  bool Secure(protocol::Role role);

  /// Of the newest tick, N; 0 once its owner is dead.
  double Force() const { return force_; }

  /// Reads what is left everywhere and ends; then the histories may be looked at, oldest epoch
  /// first.
  void Finish();
  const std::deque<HapticHistory>& haptics() const { return haptics_; }
  const std::deque<WorldHistory>& worlds() const { return worlds_; }

 private:
  struct HapticReader;
  struct WorldReader;

  void Run();
  void Look(protocol::Role role);
  void ReadAll();

  const std::string instance_;
  std::mutex mutex_;
  std::deque<HapticHistory> haptics_;
  std::deque<WorldHistory> worlds_;
  std::vector<std::unique_ptr<HapticReader>> haptic_readers_;  // of owners that may still write
  std::vector<std::unique_ptr<WorldReader>> world_readers_;
  protocol::ObjectId seen_haptic_;
  protocol::ObjectId seen_world_;
  std::atomic<double> force_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace rikiseki::test

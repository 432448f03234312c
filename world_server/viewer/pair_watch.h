// SPDX-License-Identifier: MIT
// Looks at both segments, read-only, and keeps what a picture of the pair needs: the haptic ticks of
// the last seconds, the last frames with the bodies as they were in them, the scene, and both sides'
// health. Either side may be missing, come and go.
//
// Nothing is read but by Poll: a viewer at which nobody looks costs the pair nothing. One thread.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "protocol/attach.h"
#include "protocol/messages.h"
#include "protocol/stream.h"

namespace rikiseki::viewer {

/// What is kept of one haptic tick.
struct SeenTick {
  std::uint64_t start_ns = 0;
  std::uint64_t period_ns = 0;
  std::uint64_t duration_ns = 0;  // of the tick before: start_ns - its start_ns
  std::uint64_t frame = 0;        // displayed; 0 = none
  std::uint64_t tick = 0;
  double feature_age_s = 0;  // of that frame, since it was published; NaN if it was not seen
  std::uint32_t pointer_count = 0;
  std::array<protocol::Pointer, protocol::kMaxPointers> pointers{};
};

inline constexpr std::size_t kFramesKept = 8;

/// A world frame with its bodies.
struct SeenFrame {
  std::uint64_t sequence = 0;  // counts frames kept, from 1, over all worlds
  std::uint64_t stamp_ns = 0;
  /// Of what moment its poses are: the end of the acknowledged tick, or else its publication. Grows
  /// from frame to frame of a world.
  std::uint64_t state_ns = 0;
  protocol::WorldFrame message;
  std::vector<protocol::Body> bodies;
};

/// One side, as an observer finds it.
template <typename Health>
struct SeenSide {
  bool attached = false;
  std::string why;  // it is not, in one line
  std::uint64_t epoch = 0;
  std::uint64_t heartbeat_ns = 0;
  std::optional<Health> health;
};

class PairWatch {
 public:
  /// Throws SegmentError (64) for a wrong instance name.
  explicit PairWatch(const std::string& instance);

  /// Attaches to what can be attached and reads all that is new. A second call within 5 ms does
  /// nothing: many may ask.
  void Poll(std::int64_t now_ns);

  const std::string& instance() const { return haptic_request_.instance; }
  const SeenSide<protocol::HapticHealth>& haptic() const { return haptic_; }
  const SeenSide<protocol::WorldHealth>& world() const { return world_; }

  /// How many ticks were ever kept; the newest has this number.
  std::uint64_t tick_count() const { return tick_count_; }
  /// Those kept of late, the newest last.
  const std::deque<SeenTick>& ticks() const { return ticks_; }
  /// The newest tick as it was read; no channels before the first.
  const protocol::HapticTick& newest_tick() const { return tick_; }
  /// The last kFramesKept, the newest last; those of a world that is gone stay until the next comes.
  const std::deque<SeenFrame>& frames() const { return frames_; }
  /// revision 0 before the first.
  const protocol::WorldScene& scene() const { return scenes_.scene(); }

 private:
  void LookForHaptic();
  void LookForWorld();
  void ReadTicks();
  void ReadFrames();
  void CompleteFrame(std::uint64_t now_ns);
  void AgeFeatures(std::uint64_t first_new);
  std::uint64_t StateTime(const protocol::WorldFrame& frame, std::uint64_t stamp_ns) const;

  protocol::AttachRequest haptic_request_;
  protocol::AttachRequest world_request_;
  std::int64_t polled_ns_ = 0;
  std::int64_t looked_ns_ = 0;

  SeenSide<protocol::HapticHealth> haptic_;
  std::unique_ptr<protocol::PeerView> haptic_view_;
  protocol::MessageReader<protocol::HapticTick> tick_reader_;
  protocol::MessageReader<protocol::HapticHealth> haptic_health_reader_;
  protocol::HapticTick tick_;
  std::deque<SeenTick> ticks_;
  std::uint64_t tick_count_ = 0;

  SeenSide<protocol::WorldHealth> world_;
  std::unique_ptr<protocol::PeerView> world_view_;
  protocol::MessageReader<protocol::WorldFrame> frame_reader_;
  protocol::MessageReader<protocol::WorldHealth> world_health_reader_;
  protocol::BodiesReader bodies_;
  protocol::SceneReader scenes_;
  SeenFrame pending_;  // until its bodies are there; stamp_ns 0: none is
  std::deque<SeenFrame> frames_;
  std::uint64_t frame_count_ = 0;
  struct Stamp {
    std::uint64_t frame = 0;
    std::uint64_t stamp_ns = 0;
  };
  std::array<Stamp, 64> stamps_{};  // of frame n at n modulo its size
};

}  // namespace rikiseki::viewer

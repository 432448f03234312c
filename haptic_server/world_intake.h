// SPDX-License-Identifier: MIT
// What comes from the world in a tick, and what is shown of it: the peer watch decides whether there is a
// world, its frames go to the ledger (acks), the local copies and the feature track (surfaces).
#pragma once

#include <cstdint>

#include "haptic_server/render/feature_track.h"
#include "haptic_server/render/ledger.h"
#include "haptic_server/render/local_bodies.h"
#include "haptic_server/safety/peer_watch.h"
#include "haptic_server/settings.h"
#include "protocol/messages.h"

namespace rikiseki::haptic {

/// What the shell knows of the world at this tick.
struct WorldInput {
  std::uint64_t epoch = 0;        // of the attached segment; 0 = none
  bool ready = false;             // its owner says so, and lives
  std::int64_t heartbeat_ns = 0;  // its owner's last sign of life
  const protocol::WorldFrame* frame =
      nullptr;  // the newest frame, if it was not handed over before
};

class WorldIntake {
 public:
  /// `replay_ticks`: of how old an acknowledgement local copies can be brought up to date.
  WorldIntake(const Settings& settings, std::uint64_t replay_ticks, std::uint64_t own_epoch);

  /// When and where the finger meets what has come.
  struct Finger {
    std::uint64_t tick = 0;
    std::int64_t start_ns = 0;
    std::int64_t elapsed_ticks = 1;  // since the tick before
    Vec3 position = Vec3::Zero();    // m, centre, in W
    Vec3 velocity = Vec3::Zero();    // m/s; zero where it is not known
    double radius = 0;               // m
    double penetration = 0;          // m, in the tick before
  };

  /// True if a frame came whose surfaces are shown from this tick on. A world that is gone takes with it
  /// everything that was shown. `force_is_zero`: the force of a lost world has faded out. // RT:
  bool Update(const WorldInput& world, const Finger& finger, bool force_is_zero,
              Ledger& ledger) noexcept;

  FeatureTrack& track() noexcept { return track_; }
  LocalBodies& copies() noexcept { return copies_; }
  const LocalBodies& copies() const noexcept { return copies_; }
  const PeerWatch& peer() const noexcept { return peer_; }
  std::uint64_t shown_epoch() const noexcept { return shown_epoch_; }  // 0 = nothing is shown
  std::uint64_t shown_frame() const noexcept { return shown_frame_; }

 private:
  bool TakeFrame(const WorldInput& world, Ledger& ledger) noexcept;

  double period_s_;
  FeatureTrack track_;
  LocalBodies copies_;
  PeerWatch peer_;
  std::uint64_t newest_epoch_ = 0;  // of the newest sound frame, and its number
  std::uint64_t newest_frame_ = 0;
  std::uint64_t shown_epoch_ = 0;  // whose surfaces are in the track
  std::uint64_t shown_frame_ = 0;
  std::uint64_t channel_epoch_ = 0;  // whose bodies the ledger's channels are about
};

}  // namespace rikiseki::haptic

// SPDX-License-Identifier: MIT
// What a browser is told: the scene once, then updates. An update is a binary WebSocket message,
//
//   u32 bytes of the head | head, JSON, padded by spaces so that what follows lies at a multiple of 8
//   f64 ticks[head.ticks.count][kTickNumbers + head.ticks.pointers * kPointerNumbers]
//   f64 bodies[head.frames[0].bodies][kBodyNumbers], then those of the next frame, ...
//
// little-endian, SI units, world axes; times are ns of CLOCK_MONOTONIC, ids that may pass 2^53 are
// strings. Ticks are those since the update before, or the last kMostTicks of them; frames likewise,
// or as many of the last as hold kMostBodies, one at least. page/src/decode.js reads it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "world_server/viewer/pair_watch.h"

namespace rikiseki::viewer {

/// start_ns, tick, frame, duration_ns, feature_age_s (NaN: not known)
inline constexpr std::size_t kTickNumbers = 5;
/// pointer, reason, radius (0: not there), position x y z, force x y z
inline constexpr std::size_t kPointerNumbers = 9;
/// body, generation, position x y z, orientation w x y z, velocity x y z
inline constexpr std::size_t kBodyNumbers = 12;
inline constexpr std::uint64_t kMostTicks = 2000;
inline constexpr std::size_t kMostBodies = 10'000;

/// A browser is sent so many updates, and then one more for each message that it sends: its word that
/// it has taken one in.
inline constexpr int kUpdatesAhead = 3;

/// How far one browser has been told.
struct Told {
  std::uint64_t tick = 0;   // PairWatch::tick_count
  std::uint64_t frame = 0;  // SeenFrame::sequence
  std::uint64_t scene_epoch = 0;
  std::uint64_t scene_revision = 0;
};

/// Has this browser another scene than the world?
bool SceneIsNews(const PairWatch& watch, const Told& told);
/// The scene as JSON text, and notes that it was told.
std::string SceneMessage(const PairWatch& watch, Told& told);

/// What is new, as above, and notes that it was told.
std::string UpdateMessage(const PairWatch& watch, std::int64_t now_ns, Told& told);

/// Lower-case hexadecimal digits of a mesh file's hash: its name for the browser.
std::string MeshName(const protocol::SceneMesh& mesh);

}  // namespace rikiseki::viewer

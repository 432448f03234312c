// SPDX-License-Identifier: MIT
// Headers that no side may accept, whichever is judged: the player offers them, and sees that it is
// left alone. And the one that differs and must be taken: of a later minor version.
#pragma once

#include <span>
#include <string>

#include "protocol/segment.h"
#include "protocol/tools/check/case.h"

namespace rikiseki::protocol::check {

struct WrongHeader {
  const char* what;
  void (*alter)(SegmentHeader&);
};
std::span<const WrongHeader> WrongHeaders();

/// Leaves alone what one change of the header makes another version.
template <typename Player>
void RefusesVersion(Player& player, void (*alter)(SegmentHeader&), const char* what) {
  player.Leave();
  player.NeverTaken(alter, SegmentState::kReady, what);
  player.Leave();
}

template <typename Player>
void RefusesMajor(Player& player) {
  RefusesVersion(
      player, [](SegmentHeader& header) { ++header.version_major; }, "version_major differs");
}

// A later minor version appends, and so its layout is another.
template <typename Player>
void TakesMinor(Player& player) {
  player.Leave();
  player.Open(
      [](SegmentHeader& header) {
        ++header.version_minor;
        header.layout_hash ^= 1;
      },
      SegmentState::kReady);
  player.Couple();
}

template <typename Player>
void RefusesHash(Player& player) {
  RefusesVersion(
      player, [](SegmentHeader& header) { header.layout_hash ^= 1; },
      "layout_hash differs under the same version");
}

template <typename Player>
void WaitsForReady(Player& player) {
  player.Leave();
  player.NeverTaken(nullptr, SegmentState::kInitialising, "state is initialising");
  player.segment().SetState(SegmentState::kReady);
  player.Couple();
}

template <typename Player>
void RefusesWrongHeaders(Player& player) {
  player.Leave();
  for (const WrongHeader& wrong : WrongHeaders()) {
    player.NeverTaken(wrong.alter, SegmentState::kReady, wrong.what);
  }
  player.Leave();
  player.Couple();
}

}  // namespace rikiseki::protocol::check

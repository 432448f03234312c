// SPDX-License-Identifier: MIT
// Who sleeps. Bodies that touch each other and have all rested for a while fall asleep together, and are
// stepped no more: they cost nothing until a push, or something awake that is about to touch one of them,
// wakes them all.
//
// Rest is judged by the way that a body made, not by its speed at one moment: what trembles within 25 um
// rests, what is moved by 0.1 mm/s does not.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "world_server/physics/bullet_bodies.h"
#include "world_server/physics/contact_pairs.h"

namespace rikiseki::world {

/// Bodies whose contacts [m apart] are nearer rest on each other, and sleep and wake together.
inline constexpr double kTouching = 2e-5;

class Sleepers {
 public:
  /// `may_sleep` false: nobody ever does.
  Sleepers(std::vector<MovingBody>& moving, bool may_sleep);

  bool Sleeps(std::size_t body) const { return island_of_[body] != kAwake; }
  /// Who is awake, by their places in `moving`, ascending.
  std::span<const std::size_t> awake();
  /// All that sleep with this sleeping body, itself included.
  std::span<const std::size_t> IslandOf(std::size_t body) const {
    return islands_[island_of_[body]];
  }

  /// Wakes the body's island, if it sleeps.
  void Wake(std::size_t body);

  /// Whether a sleeping body that is put there sleeps on: at rest, and where it is but for what a sleeper
  /// may have trembled.
  bool SleepsOn(std::size_t body, const BodyState& state) const;

  /// After `time_s` of a group that met nobody else: lets fall asleep what has rested long enough and is not
  /// `pushed` (by place in `moving`). What floats freely sleeps only if it does not move at all.
  void Watch(std::span<const std::size_t> members, std::span<ContactPair* const> pairs,
             std::span<btTypedConstraint* const> joints, std::span<const char> pushed,
             double time_s);

 private:
  static constexpr std::size_t kAwake = static_cast<std::size_t>(-1);

  struct Rest {
    Pose pose;  // since then it has stayed near here
    double time_s = 0;
    double still_s = 0;  // and has hardly moved at all
  };

  void TakeOutSleepers();
  std::size_t RootOf(std::size_t body);
  void WatchOne(std::size_t body, double time_s);
  bool HasRested(std::size_t body) const;
  void PutToSleep(const std::vector<std::size_t>& bodies);

  std::vector<MovingBody>& moving_;
  bool may_sleep_;
  std::vector<std::size_t> awake_;  // and some who fell asleep since
  bool some_fell_asleep_ = false;
  std::vector<std::size_t> island_of_;  // place in islands_, or kAwake
  std::vector<std::vector<std::size_t>> islands_;
  std::vector<std::size_t> free_islands_;
  std::vector<Rest> rests_;
  std::vector<std::size_t> parents_;  // within Watch: who rests on whom
  std::vector<char> held_;            // within Watch, of roots: by what cannot move
};

}  // namespace rikiseki::world

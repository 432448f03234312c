// SPDX-License-Identifier: MIT
// Finger, haptic loop, frames and slow world as one linear loop: what deviates from a steady push
// grows or decays by a factor per world period. One dimension, no friction, always in contact.
// Paper 3; numerics sections 3 and 4.
#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include "haptic_server/device/hand.h"
#include "tests/lab/linear_stations.h"

namespace rikiseki::lab {

/// What ships and, for study only, variants of it; the names are those of the tables.
enum class LoopMethod {
  kPosition,                 // conv: coupling `position`
  kPositionWithWorldDamper,  // conv_worldkd: study: the world damps by its own differences
  kInterpolate,              // impulse_interp: coupling `impulse` with that display rule
  kHold,                     // impulse_hold
  kExtrapolate,              // impulse_extrap
  kLocalSemiImplicitWorld,   // local_SE: naive: the world kicks once and moves by x += Tw v
  kLocalTrapezoidWorld,      // local_TR: study: x += Tw (v + v')/2
  kLocalBlock,               // local_M1: one block per period with impulse and first moment
  kLocalReplay,              // local_AUTH: coupling `local`: the world replays tick by tick
  kLocalOverwrite,           // local_M1_noreplay: study: a late frame replaces the copy as it is
  kLocalImplicit,            // local_M1_implicit: coupling `local` with the implicit body step
};
inline constexpr std::array<std::string_view, 11> kLoopMethodNames = {
    "conv",           "conv_worldkd",      "impulse_interp",   "impulse_hold",
    "impulse_extrap", "local_SE",          "local_TR",         "local_M1",
    "local_AUTH",     "local_M1_noreplay", "local_M1_implicit"};
std::optional<LoopMethod> FindLoopMethod(std::string_view name);

/// Hand and device; without a value the finger is clamped.
using LoopHand = std::optional<haptic::Impedance>;

struct MultirateLoop {
  LoopMethod method = LoopMethod::kLocalReplay;
  LoopHand hand;
  double stiffness_n_per_m = 2000;
  double damping_ns_per_m = 0;  // the literal damper
  double period_s = 1e-3;       // T
  int ticks_per_period = 50;    // n
  int latency_ticks = 0;        // L: the world's frame is shown so many ticks after its tick
};

inline constexpr int kLongestLatency = 8;  // world periods

/// The loop with the parts that do not depend on the body read off already.
class PeriodMap {
 public:
  /// Throws std::invalid_argument on a period without ticks or a latency beyond the longest.
  explicit PeriodMap(const MultirateLoop& loop);

  /// Growth per world period of what deviates from a steady push of a body of this mass; inf if it
  /// leaves the range of numbers within one period.
  double SpectralRadius(double mass_kg) const;

 private:
  struct State;
  void WorldTick(double mass_kg, State& state) const;
  void Arrive(State& state) const;
  void HapticTick(const BodyGains& body, const ImplicitGains& implicit, int ticks_shown,
                  State& state) const;
  void AlikeTicks(const BodyGains& body, const ImplicitGains& implicit, int count,
                  State& state) const;
  bool IsLocal() const { return loop_.method >= LoopMethod::kLocalSemiImplicitWorld; }

  MultirateLoop loop_;
  std::vector<DisplayWeights> display_;
  ContactGains contact_;
  haptic::ImpedanceStep hand_;
  double penalty_ = 0;
};

}  // namespace rikiseki::lab

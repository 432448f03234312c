// SPDX-License-Identifier: MIT
// The energy meter: what the rendering gives to the hand that no body gave by right (a time-domain
// passivity observer), against what the device itself dissipates; and from both, whether a contact
// is unstable. numerics 2. Everything at the device.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/geometry.h"
#include "haptic_server/settings.h"

namespace rikiseki::haptic {

/// An unstable contact injects more than this [J] beyond what the device dissipates within the
/// window, while the peaks of its penetration have grown this often in a row.
inline constexpr double kUnstableEnergy = 1e-3;
inline constexpr double kEnergyWindow = 0.2;  // s
inline constexpr int kGrowingPeaks = 3;

/// What the split adds within the window needs no peaks to be judged by where it is more than the
/// largest force does over this way [m]: a light body that a slow world hurls away never comes back.
inline constexpr double kHandsReach = 1;

/// What the meter must know at the start of a tick.
struct EnergySample {
  Vec3 position = Vec3::Zero();  // m, device axes
  Vec3 velocity = Vec3::Zero();  // m/s, as the device estimates it
  double duration_s = 0;         // true t_k - t_(k-1)
  double surface_work = 0;  // J, that the displayed surfaces did on the hand by moving meanwhile
  double split_work = 0;    // J, what the split between the processes added: SplitEnergy
  double stored = 0;        // J, in the rendered springs, at full gain
  double penetration = 0;   // m, |e|; 0 = free
  double world_period_s = 0;
};

/// E_k = E_(k-1) + f_(k-1) . (x_k - x_(k-1)) - (work of the moving surfaces): exact, for the force
/// is held. Positive = injected.
///
/// A pressed spring gives back later what it holds: a hand that presses deeper each time and lets go
/// is no instability. The *leak*, E plus what the springs hold, leaves that out. Each tick adds
/// f_(k-1) dx plus the share of the spring's energy that is displayed, for a spring alone k/2 |de|^2 >
/// 0: what the zero-order hold leaks. To it comes what the split adds, which E excuses as work of
/// the surfaces. Controller and flag go by the leak. Where it is the bodies that press deeper each
/// time, driven by their coupling and not by the hand, the flag goes by E itself.
///
/// The force cap hides growth: a peak of a force that is cut counts as grown after another such.
class EnergyMeter {
 public:
  explicit EnergyMeter(const Settings& settings);

  /// The tick before is over. // RT:
  void Measure(const EnergySample& sample) noexcept;

  /// Another force cap. // RT:
  void Tune(const SafetySettings& settings) noexcept;

  /// There is no sound sample: the tick before and the next cannot be judged. // RT:
  void Skip() noexcept { known_ = false; }

  /// What is displayed until the next Measure [N, on the user], how much of it no body asked for,
  /// and what the bodies were rendered with. // RT:
  void Displayed(const Vec3& force, const Vec3& ground, const Vec3& rendered) noexcept;

  /// The passivity controller: the damping force [N] that takes away what has leaked in the present
  /// contact, as far as a device of this mass bears damping; 0 where nothing leaked. // RT:
  Vec3 Brake() const noexcept;

  double injected() const noexcept { return injected_; }      // J, E since the start
  double dissipated() const noexcept { return dissipated_; }  // J, b integral v^2 dt
  bool unstable() const noexcept { return unstable_ticks_ > 0; }
  std::uint64_t times_flagged() const noexcept { return flagged_; }

 private:
  void WatchPeaks(const EnergySample& sample) noexcept;
  void NotePeak() noexcept;

  double damping_;            // N s/m, b
  double largest_braking_;    // N s/m
  double largest_split_ = 0;  // J, in a window
  double period_s_;

  bool known_ = false;  // a sample came before
  Vec3 position_ = Vec3::Zero();
  Vec3 velocity_ = Vec3::Zero();
  Vec3 force_ = Vec3::Zero();
  double displayed_fraction_ = 1;  // of what was rendered
  double stored_ = 0;
  double penetration_ = 0;

  double injected_ = 0;
  double dissipated_ = 0;
  double contact_leak_ = 0;  // J, of the present contact, less what was braked
  // J since the start: the leak and E itself, less dissipation, and what the split added.
  struct Excess {
    double leak = 0;
    double injection = 0;
    double split = 0;
  };
  Excess excess_;
  std::vector<Excess> history_;
  std::size_t newest_ = 0;

  double highest_ = 0;  // since the last valley
  double lowest_ = 0;   // since the last peak
  bool rising_ = true;
  double last_peak_ = 0;
  bool is_cut_ = false;       // the force at the highest, by the safety stage
  bool was_cut_ = false;      // likewise at the last peak
  int grown_ = 0;             // peaks in a row that were higher than the one before
  int grown_by_surface_ = 0;  // likewise, into which surfaces put more work than the hand
  double hand_work_ = 0;      // J, on the springs since the last peak
  double surface_work_ = 0;   // J, likewise
  std::int64_t ticks_since_peak_ = 0;

  std::int64_t unstable_ticks_ = 0;  // for so many more it is called unstable
  std::uint64_t flagged_ = 0;
};

}  // namespace rikiseki::haptic

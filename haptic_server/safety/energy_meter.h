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

/// What the meter must know at the start of a tick.
struct EnergySample {
  Vec3 position = Vec3::Zero();  // m, device axes
  Vec3 velocity = Vec3::Zero();  // m/s, as the device estimates it
  double duration_s = 0;         // true t_k - t_(k-1)
  double surface_work = 0;  // J, that the displayed surfaces did on the hand by moving meanwhile
  double stored = 0;        // J, in the rendered springs, at full gain
  double penetration = 0;   // m, |e|; 0 = free
};

/// E_k = E_(k-1) + f_(k-1) . (x_k - x_(k-1)) - (work of the moving surfaces): exact, for the force
/// is held. Positive = injected.
///
/// A pressed spring gives back later what it holds: a hand that presses deeper each time and lets go
/// is no instability. The *leak*, E plus what the springs hold, leaves that out. Each tick adds
/// f_(k-1) dx plus the share of the spring's energy that is displayed, for a spring alone k/2 |de|^2 >
/// 0: what the zero-order hold leaks. Controller and flag go by it. Where it is the bodies that press
/// deeper each time, driven by their coupling and not by the hand, the flag goes by E itself.
class EnergyMeter {
 public:
  explicit EnergyMeter(const Settings& settings);

  /// The tick before is over. // RT:
  void Measure(const EnergySample& sample) noexcept;

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
  void WatchPeaks(double penetration) noexcept;
  void NotePeak() noexcept;

  double damping_;          // N s/m, b
  double largest_braking_;  // N s/m
  double period_s_;
  std::int64_t window_ticks_;

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
  // J since the start, less dissipation: the leak, and E itself; and both one window back.
  struct Excess {
    double leak = 0;
    double injection = 0;
  };
  Excess excess_;
  std::vector<Excess> history_;
  std::size_t newest_ = 0;

  double highest_ = 0;  // since the last valley
  double lowest_ = 0;   // since the last peak
  bool rising_ = true;
  double last_peak_ = 0;
  int grown_ = 0;             // peaks in a row that were higher than the one before
  int grown_by_surface_ = 0;  // likewise, into which surfaces put more work than the hand
  double hand_work_ = 0;      // J, on the springs since the last peak
  double surface_work_ = 0;   // J, likewise
  std::int64_t ticks_since_peak_ = 0;

  std::int64_t unstable_ticks_ = 0;  // for so many more it is called unstable
  std::uint64_t flagged_ = 0;
};

}  // namespace rikiseki::haptic

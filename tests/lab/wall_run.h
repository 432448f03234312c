// SPDX-License-Identifier: MIT
// Both loops in virtual time with nothing but a static wall: solid is x > 0. What the haptic tick
// displays there is the sampled spring and damper of numerics section 2, and nothing limits it.
#pragma once

#include "haptic_server/device/device.h"
#include "haptic_server/device/hand.h"
#include "tests/lab/coupled_run.h"

namespace rikiseki::lab {

struct WallSurface {
  double period_s = 1e-3;  // of the haptic tick; to whole nanoseconds
  double stiffness_n_per_m = 2000;
  double damping_ns_per_m = 0;
  bool adhesion = true;  // the literal damper, which may pull
};

class WallRun {
 public:
  /// `device` outlives the run and must not move before CoupledRun::StartNs(HapticSettings()).
  WallRun(const WallSurface& wall, haptic::Device& device);

  static haptic::Settings HapticSettings(const WallSurface& wall);

  void Tick() { run_.Tick(); }

  /// Of the last tick, on the user along x [N].
  double force() const { return run_.haptic_tick().pointers[0].force[0]; }

  /// Sum of what was displayed [N s], on the wall along x.
  double impulse() const;

 private:
  CoupledRun run_;
};

/// A device of mass and damping with nobody behind it but a constant force along x. Until it is let
/// go it stands still. Its samples come out `delay_samples` ticks late.
class PressedDevice final : public haptic::Device {
 public:
  struct Setup {
    haptic::Impedance impedance;
    double start_m = 0;
    double press_n = 0;
    std::int64_t release_ns = 0;  // when it is let go
    int delay_samples = 0;        // at most kLongestDelay
  };
  static constexpr int kLongestDelay = 63;

  explicit PressedDevice(const Setup& setup);

  haptic::DeviceStatus Read(std::int64_t now_ns, haptic::DeviceSample& sample) noexcept override;
  Vec3 Write(const Vec3& force) noexcept override;
  void Release() noexcept override { force_ = 0; }
  std::string Name() const override { return "pressed device"; }

  /// Changes the constant force.
  void Press(double force_n) { setup_.press_n = force_n; }

  double position() const { return position_; }  // m, now
  double velocity() const { return velocity_; }  // m/s

 private:
  Setup setup_;
  std::int64_t now_ns_ = 0;
  std::int64_t step_ns_ = 0;  // what step_ is for
  haptic::ImpedanceStep step_;
  double position_ = 0;
  double velocity_ = 0;
  double force_ = 0;  // N, of the display, on the user
  std::size_t reads_ = 0;
  std::array<double, kLongestDelay + 1> positions_{};  // of the last reads, at their number modulo
};

}  // namespace rikiseki::lab

// SPDX-License-Identifier: MIT
// The linear loops of multirate against the step functions that ship, with the engine's world: a
// block that gravity presses against the finger, nudged once it is at rest.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>

#include "tests/lab/stable_masses.h"
#include "tests/lab/wall_run.h"
#include "world_server/physics/bullet_world.h"

namespace rikiseki::lab {
namespace {

constexpr double kDepth = 5e-3;  // m, of the steady contact
constexpr double kStiffness = 1000;

struct Pressed {
  LoopMethod method;
  haptic::Impedance hand;
  double damping = 1;
  int ticks = 50;
  double mass = 1;
};

MultirateLoop LinearOf(const Pressed& pressed) {
  return {.method = pressed.method,
          .hand = pressed.hand,
          .stiffness_n_per_m = kStiffness,
          .damping_ns_per_m = pressed.damping,
          .ticks_per_period = pressed.ticks};
}

class PressedRun {
 public:
  explicit PressedRun(const Pressed& pressed)
      : ticks_(pressed.ticks),
        weight_(kStiffness * kDepth),
        press_(weight_ - pressed.hand.stiffness_n_per_m * 1e-3),
        device_({.impedance = pressed.hand, .start_m = -1e-3, .press_n = press_}),
        run_(HapticSettings(pressed), device_, WorldSettings(pressed), Scene(pressed),
             std::make_unique<world::BulletWorld>(Scene(pressed), 1e-3), 0) {}

  void Period() {
    deepest_ = 0;
    shallowest_ = 1;
    farthest_ = 0;
    for (int k = 0; k < ticks_; ++k) {
      run_.Tick();
      const double depth = -run_.haptic_tick().pointers[0].force[0] / kStiffness;
      deepest_ = std::max(deepest_, depth);
      shallowest_ = std::min(shallowest_, depth);
      farthest_ = std::max(farthest_, std::abs(device_.position() - rest_));
    }
  }

  // One period of a little more force.
  void Nudge() {
    rest_ = device_.position();
    device_.Press(press_ + 0.02 * weight_);
    Period();
    device_.Press(press_);
  }

  double unrest() const { return (deepest_ - shallowest_) / kDepth; }  // in the last period
  double deviation() const { return farthest_; }                       // m, from rest, likewise

 private:
  static haptic::Settings HapticSettings(const Pressed& pressed) {
    haptic::Settings settings = WallRun::HapticSettings(
        {.stiffness_n_per_m = kStiffness, .damping_ns_per_m = pressed.damping});
    if (pressed.method == LoopMethod::kHold) settings.render.display = haptic::DisplayRule::kHold;
    if (pressed.method == LoopMethod::kExtrapolate) {
      settings.render.display = haptic::DisplayRule::kExtrapolate;
    }
    return settings;
  }

  static world::Settings WorldSettings(const Pressed& pressed) {
    world::Settings settings;
    settings.loop.rate_hz = 1e3 / pressed.ticks;
    settings.features.radius_mm = 1e9;
    settings.coupling.force_cap_n = 1e9;
    settings.coupling.coupling =
        pressed.method == LoopMethod::kPosition      ? protocol::Coupling::kPosition
        : pressed.method == LoopMethod::kLocalReplay ? protocol::Coupling::kLocal
                                                     : protocol::Coupling::kImpulse;
    return settings;
  }

  static world::Scene Scene(const Pressed& pressed) {
    world::Collider collider;
    collider.shape = world::Box{Vec3::Constant(0.5)};
    world::SceneBody block;
    block.name = "block";
    block.mass_kg = pressed.mass;
    block.inertia = Mat3::Identity();
    block.pose_WB.position = Vec3(0.5, 0, 0);
    block.colliders = {collider};
    world::Scene scene;
    scene.name = "pressed";
    scene.gravity = Vec3(-kStiffness * kDepth / pressed.mass, 0, 0);
    scene.bodies = {block};
    return scene;
  }

  int ticks_;
  double weight_;  // N
  double press_;   // N
  double deepest_ = 0, shallowest_ = 0;
  double farthest_ = 0;
  double rest_ = 0;
  PressedDevice device_;
  CoupledRun run_;
};

}  // namespace

TEST_CASE("a nudged contact dies out at the rate of the linear loop") {
  const haptic::Impedance medium{0.58, 6.7, 135};
  const haptic::Impedance stiff{1.53, 30.2, 1000};
  for (const Pressed& pressed :
       {Pressed{.method = LoopMethod::kPosition, .hand = medium, .mass = 3},
        Pressed{.method = LoopMethod::kPosition, .hand = stiff, .ticks = 20, .mass = 0.5},
        Pressed{.method = LoopMethod::kHold, .hand = stiff, .mass = 1.5},
        Pressed{.method = LoopMethod::kExtrapolate, .hand = stiff, .mass = 4},
        Pressed{.method = LoopMethod::kInterpolate, .hand = stiff, .mass = 1.5},
        Pressed{.method = LoopMethod::kLocalReplay, .hand = medium, .mass = 0.2},
        Pressed{.method = LoopMethod::kLocalReplay, .hand = stiff, .ticks = 20, .mass = 2}}) {
    const double rho = PeriodMap(LinearOf(pressed)).SpectralRadius(pressed.mass);
    CAPTURE(static_cast<int>(pressed.method), pressed.ticks, pressed.mass, rho);
    CHECK(rho < 0.999);
    PressedRun run(pressed);
    const int settling = static_cast<int>(25 / -std::log(rho)) + 200;
    for (int period = 0; period < settling; ++period) run.Period();
    CHECK(run.unrest() < 1e-6);
    run.Nudge();
    // The mean logarithm of the deviation in two windows, each some swings long, once what dies
    // faster is gone.
    constexpr int kWindow = 20;
    const int first = 5 + static_cast<int>(3 / -std::log(rho));
    const int apart = std::max(20, static_cast<int>(6 / -std::log(rho)));
    double early = 0;
    double late = 0;
    for (int period = 0; period < first + apart + kWindow; ++period) {
      run.Period();
      if (period >= first && period < first + kWindow) early += std::log(run.deviation());
      if (period >= first + apart) late += std::log(run.deviation());
    }
    CHECK((late - early) / kWindow / apart == Approx(std::log(rho)).epsilon(0.02).margin(0.01));
  }
}

TEST_CASE("a contact comes to rest above the least stable mass, and not below it") {
  const haptic::Impedance medium{0.58, 6.7, 135};
  for (const Pressed& setting : {Pressed{.method = LoopMethod::kPosition, .hand = medium},
                                 Pressed{.method = LoopMethod::kHold, .hand = medium},
                                 Pressed{.method = LoopMethod::kInterpolate, .hand = medium}}) {
    const auto intervals = StableIntervals(PeriodMap(LinearOf(setting)));
    REQUIRE_FALSE(intervals.empty());
    const double least = intervals.back().from;
    for (const double part : {0.9, 1.1}) {
      Pressed pressed = setting;
      pressed.mass = part * least;
      const double rho = PeriodMap(LinearOf(pressed)).SpectralRadius(pressed.mass);
      CAPTURE(static_cast<int>(pressed.method), least, part, rho);
      PressedRun run(pressed);
      for (int period = 0; period < 3000; ++period) run.Period();
      if (part > 1) {
        CHECK(run.unrest() < 0.01);
      } else {
        CHECK(run.unrest() > 0.1);
      }
    }
  }
}

}  // namespace rikiseki::lab

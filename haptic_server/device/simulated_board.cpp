// SPDX-License-Identifier: MIT
#include "haptic_server/device/simulated_board.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "common/rigid_body.h"
#include "haptic_server/device/wrench_tension.h"

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kLongestStepNs = 1'000'000;

constexpr int kStirringStrokes = 500;  // then again from the first

// Fingers that hold a grip of some centimetres upright: N m/rad, with half the critical damping.
constexpr double kWristStiffness = 0.5;
constexpr double kWristInertia = 5e-5;  // kg m^2, of grip and fingers
constexpr double kWristDamping = 5e-3;  // N m s/rad

Hand UprightWrist() {
  return {[](double) { return Vec3(Vec3::Zero()); },
          {.mass_kg = kWristInertia,
           .damping_ns_per_m = kWristDamping,
           .stiffness_n_per_m = kWristStiffness}};
}

}  // namespace

MotorProgram::Script ScriptOf(const HandSettings& hand) {
  const Vec3 home = hand.home_mm * 1e-3;
  const Vec3 reach = home + hand.stroke_mm * 1e-3;
  MotorProgram::Script script;
  script.home = home;
  script.seed = static_cast<std::uint64_t>(hand.seed);
  // The rest comes first: a world that starts beside us is live before the first push.
  switch (hand.script) {
    case HandScript::kPush:
      script.strokes = {{home, hand.rest_ms * 1e-3},
                        {reach, hand.reach_ms * 1e-3},
                        {reach, hand.hold_ms * 1e-3},
                        {home, hand.return_ms * 1e-3}};
      script.repeats = true;
      script.rest_jitter_s = hand.rest_jitter_ms * 1e-3;
      break;
    case HandScript::kStir:
      script.strokes = StirringStrokes(home, reach, hand.reach_ms * 1e-3, hand.hold_ms * 1e-3,
                                       script.seed, kStirringStrokes);
      script.strokes.insert(script.strokes.begin(), {home, hand.rest_ms * 1e-3});
      script.repeats = true;
      break;
    case HandScript::kRest:
      break;
  }
  return script;
}

Impedance ImpedanceOf(const Settings& settings) {
  return {.mass_kg = settings.hand.mass_kg + settings.spidar.moving_mass_kg,
          .damping_ns_per_m =
              settings.hand.damping_ns_per_m + settings.spidar.friction_damping_ns_per_m,
          .stiffness_n_per_m = settings.hand.stiffness_n_per_m,
          .friction_n = settings.spidar.friction_n};
}

Hand MakeHand(const Settings& settings) {
  return {MotorProgram(ScriptOf(settings.hand)), ImpedanceOf(settings)};
}

SimulatedBoard::SimulatedBoard(const SpidarSettings& spidar, Hand hand)
    : motors_(spidar.motors_m),
      attachments_(motors_.size(), Vec3::Zero()),
      count_length_m_(spidar.count_length_m),
      bounds_{spidar.tension_min_n, spidar.tension_max_n},
      latency_ns_(std::llround(1e3 * spidar.latency_us)),
      hand_(std::move(hand)),
      wrist_(UprightWrist()) {
  const std::size_t ends = motors_.size() == kGripStrings ? kGripStrings : 0;
  if ((motors_.size() != kTensionStrings && ends == 0) || spidar.attachments_mm.size() != ends) {
    throw std::invalid_argument("a SPIDAR has 4 motors, or 8 with an attachment each");
  }
  for (std::size_t string = 0; string < ends; ++string) {
    attachments_[string] = 1e-3 * spidar.attachments_mm[string];
  }
  home_lengths_ = Lengths(Pose());
  tension_.fill(spidar.tension_min_n);
}

Pose SimulatedBoard::grip() const noexcept {
  return {hand_.position(), Turned(Quat::Identity(), wrist_.position())};
}

PerString SimulatedBoard::Lengths(const Pose& grip) const noexcept {
  PerString lengths{};
  for (std::size_t string = 0; string < motors_.size(); ++string) {
    lengths[string] = (motors_[string] - grip * attachments_[string]).norm();
  }
  return lengths;
}

EncoderCounts SimulatedBoard::CountsAt(const Pose& grip) const noexcept {
  const PerString lengths = Lengths(grip);
  EncoderCounts counts{};
  for (std::size_t string = 0; string < motors_.size(); ++string) {
    counts[string] = std::llround((lengths[string] - home_lengths_[string]) / count_length_m_);
  }
  return counts;
}

// Moves the hand on under the tensions that act now.
void SimulatedBoard::MoveTo(std::int64_t now_ns) noexcept {
  const std::int64_t elapsed = now_ns - now_ns_;
  const std::int64_t steps = (elapsed + kLongestStepNs - 1) / kLongestStepNs;
  for (std::int64_t i = 0; i < steps; ++i) {
    const Pose pose = grip();
    Vec3 force = Vec3::Zero();
    Vec3 torque = Vec3::Zero();
    for (std::size_t string = 0; string < motors_.size(); ++string) {
      const Vec3 arm = pose.orientation * attachments_[string];
      const Vec3 pull =
          (motors_[string] - pose.position - arm).stableNormalized() * tension_[string];
      force += pull;
      torque += arm.cross(pull);
    }
    const std::int64_t step_ns = elapsed * (i + 1) / steps - elapsed * i / steps;
    hand_.Advance(step_ns, force);
    wrist_.Advance(step_ns, torque);
  }
  now_ns_ = now_ns;
}

bool SimulatedBoard::ReadCounts(std::int64_t now_ns, EncoderCounts& counts) noexcept {
  if (!started_) now_ns_ = now_ns;
  started_ = true;
  now_ns = std::max(now_ns, now_ns_);
  for (; obeyed_ != commanded_; ++obeyed_) {
    const Command& next = commands_[obeyed_ % kCommands];
    if (next.acts_ns > now_ns) break;
    MoveTo(next.acts_ns);
    tension_ = next.tension;
  }
  MoveTo(now_ns);
  counts = CountsAt(grip());
  return true;
}

bool SimulatedBoard::WriteTensions(const PerString& tension) noexcept {
  PerString clamped{};
  for (std::size_t string = 0; string < motors_.size(); ++string) {
    clamped[string] = std::clamp(tension[string], bounds_.min_n, bounds_.max_n);
  }
  if (latency_ns_ == 0) {
    tension_ = clamped;
  } else if (commanded_ - obeyed_ < kCommands) {
    commands_[commanded_++ % kCommands] = {now_ns_ + latency_ns_, clamped};
  }
  return true;
}

}  // namespace rikiseki::haptic

// SPDX-License-Identifier: MIT
#include "haptic_server/guided/identification_task.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <numbers>
#include <sstream>

#include "common/clock.h"

namespace rikiseki::haptic {
namespace {

constexpr double kSettleS = 3;  // until the weight is carried
constexpr double kGrowS = 5;    // at most, until the motion is large enough
constexpr double kRecordS = 6;
constexpr double kGrowth = 0.6;      // N/s
constexpr double kShrinkage = 0.98;  // each tick that goes too far
constexpr double kReach = 0.06;      // of the mean distance of the motors
constexpr double kSpeedShare = 0.5;  // of the speed limit
constexpr double kForceShare = 0.3;  // of the cap, for each axis
constexpr double kExplained = 0.95;  // less was not the device alone

// Hz: no sum or difference of two of them is a third, so that axes and friction are told apart.
constexpr std::array<std::array<double, 3>, 3> kTones = {
    {{3.1, 7.3, 12.7}, {3.7, 8.9, 14.3}, {4.3, 10.1, 11.7}}};

std::string PlusMinus(double value, double deviation, int digits, const char* unit) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(digits) << value << " +- " << deviation << " " << unit;
  return text.str();
}

std::string Plain(double value, int digits) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(digits) << std::max(value, 0.0);
  return text.str();
}

}  // namespace

IdentificationTask::IdentificationTask(const Settings& settings, Device& device)
    : device_(settings, device),
      fastest_m_per_s_(kSpeedShare * settings.safety.speed_limit_m_per_s),
      most_n_(kForceShare * settings.safety.force_cap_n) {
  double distance = 0;
  for (const Vec3& motor : settings.spidar.motors_m) distance += motor.norm();
  reach_m_ = kReach * distance / static_cast<double>(settings.spidar.motors_m.size());
  records_.reserve(static_cast<std::size_t>(kRecordS * settings.loop.rate_hz) + 2);
}

// RT:
Vec3 IdentificationTask::Shake() const noexcept {
  Vec3 force = Vec3::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    for (const double tone : kTones[static_cast<std::size_t>(axis)]) {
      force[axis] += amplitude_n_ / 3 * std::sin(2 * std::numbers::pi * tone * shaking_s_);
    }
  }
  return force;
}

// RT:
void IdentificationTask::MoveOn(const DeviceSample& sample, double dt_s) noexcept {
  const Phase phase = phase_.load(std::memory_order_relaxed);
  const bool is_enough = sample.position.cwiseAbs().maxCoeff() > reach_m_ ||
                         sample.velocity.stableNorm() > fastest_m_per_s_;
  in_phase_s_ += dt_s;
  const auto enter = [&](Phase next) {
    phase_.store(next, std::memory_order_relaxed);
    in_phase_s_ = 0;
  };
  switch (phase) {
    case Phase::kSettle:
      if (in_phase_s_ >= kSettleS && device_.is_full()) enter(Phase::kGrow);
      return;
    case Phase::kGrow:
      shaking_s_ += dt_s;
      amplitude_n_ = std::min(amplitude_n_ + kGrowth * dt_s, most_n_);
      if (is_enough || in_phase_s_ >= kGrowS) enter(Phase::kRecord);
      return;
    case Phase::kRecord:
      shaking_s_ += dt_s;
      if (is_enough) amplitude_n_ *= kShrinkage;
      if (in_phase_s_ >= kRecordS) enter(Phase::kDone);
      return;
    case Phase::kDone:
    case Phase::kInterrupted:
      return;
  }
}

bool IdentificationTask::Tick(const TickTime& time, const OperatorInput& wish) noexcept {
  DeviceSample sample;
  const bool is_sound = device_.Read(time, wish, sample);
  const double dt_s = Seconds(time.previous_duration_ns);
  const Phase before = phase_.load(std::memory_order_relaxed);
  if (is_sound) {
    MoveOn(sample, dt_s);
  } else if (before != Phase::kSettle) {
    phase_.store(Phase::kInterrupted, std::memory_order_relaxed);
  }
  const Phase phase = phase_.load(std::memory_order_relaxed);
  if (phase == Phase::kDone || phase == Phase::kInterrupted) {
    Release();
    return false;
  }
  const Vec3 wanted = is_sound
                          ? Vec3(centring_.Force(sample.position, sample.velocity, dt_s) + Shake())
                          : Vec3(Vec3::Zero());
  const Vec3 displayed = device_.Display(wanted);
  if (phase == Phase::kRecord && records_.size() < records_.capacity()) {
    records_.push_back({time.start_ns, sample.position, displayed});
  }
  return true;
}

std::string IdentificationTask::Prompt() const {
  switch (phase_.load(std::memory_order_relaxed)) {
    case Phase::kSettle:
      return "Let the grip hang in the middle, and let go of it.";
    case Phase::kGrow:
    case Phase::kRecord:
      return "The grip is shaken for some ten seconds. Do not touch it.";
    default:
      return "";
  }
}

Finding IdentificationTask::Result() const {
  if (phase_.load(std::memory_order_relaxed) != Phase::kDone) {
    throw NothingFound(
        "interrupted by a stop, a fault or a grip that was too fast: nothing is saved");
  }
  Identification found;
  try {
    found = IdentifyDevice(records_);
  } catch (const std::invalid_argument& error) {
    throw NothingFound(error.what());
  }
  std::ostringstream text;
  text << "moving mass  "
       << PlusMinus(1e3 * found.mass_kg.value, 1e3 * found.mass_kg.deviation, 2, "g")
       << "\ndamping      "
       << PlusMinus(found.damping_ns_per_m.value, found.damping_ns_per_m.deviation, 3, "N s/m")
       << "\ndry friction " << PlusMinus(found.friction_n.value, found.friction_n.deviation, 3, "N")
       << "\nloop latency "
       << PlusMinus(1e6 * found.latency_s.value, 1e6 * found.latency_s.deviation, 0, "us")
       << "\nThese explain " << std::fixed << std::setprecision(2) << 100 * found.explained
       << " % of the force.";
  if (!(found.explained > kExplained) || !(found.mass_kg.value > 0)) {
    throw NothingFound(text.str() + "\nThat is too little: did somebody hold the grip?");
  }
  return {
      text.str(),
      {{"spidar.moving_mass_kg", Plain(found.mass_kg.value, 5)},
       {"spidar.friction_damping_ns_per_m", Plain(found.damping_ns_per_m.value, 4)},
       {"spidar.friction_n", Plain(found.friction_n.value, 4)},
       {"spidar.latency_us", Plain(std::min(1e6 * found.latency_s.value, kLongestLatencyUs), 0)}}};
}

}  // namespace rikiseki::haptic

// SPDX-License-Identifier: MIT
#include "haptic_server/guided/calibration_task.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "common/clock.h"
#include "haptic_server/guided/calibration.h"

namespace rikiseki::haptic {
namespace {

constexpr std::int64_t kHoldNs = kNanosecondsPerSecond;
constexpr double kStill = 0.5e-3;      // m, that a string may move in a hand that holds still
constexpr double kApart = 0.03;        // of a motor's distance, between two places, of any string
constexpr double kFastest = 0.5;       // m/s, of any string: a faster grip drags slack behind it
constexpr double kUncertain = 1e-3;    // m
constexpr double kContradictions = 4;  // times what rounding explains

double Farthest(const std::array<double, kTensionStrings>& a,
                const std::array<double, kTensionStrings>& b) {
  double farthest = 0;
  for (std::size_t i = 0; i < kTensionStrings; ++i) {
    farthest = std::max(farthest, std::abs(a[i] - b[i]));
  }
  return farthest;
}

std::string Micrometres(double metres) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(metres < 1e-4 ? 1 : 0) << 1e6 * metres << " um";
  return text.str();
}

}  // namespace

CalibrationTask::CalibrationTask(const Settings& settings, MotorBoard& board)
    : spidar_(settings.spidar), board_(board) {
  places_.reserve(kPlaces);
  for (const Vec3& motor : spidar_.motors_m) apart_m_ += kApart * motor.norm() / kTensionStrings;
}

bool CalibrationTask::Tick(const TickTime& time, const OperatorInput&) noexcept {
  EncoderCounts counts{};
  const bool answers = board_.ReadCounts(time.start_ns, counts);
  Release();
  if (!answers) return true;
  if (is_led_) {
    Lead(time.start_ns, counts);
  } else {
    Hold(time.start_ns, counts);
  }
  return places_.size() < kPlaces;
}

void CalibrationTask::Hold(std::int64_t now_ns, const EncoderCounts& counts) noexcept {
  Counts now{};
  std::copy_n(counts.begin(), now.size(), now.begin());
  if (held_readings_ == 0 || Farthest(now, held_first_) * spidar_.count_length_m > kStill) {
    held_first_ = now;
    held_since_ns_ = now_ns;
    held_readings_ = 0;
    held_sum_ = {};
  }
  for (std::size_t i = 0; i < kTensionStrings; ++i) held_sum_[i] += now[i];
  ++held_readings_;
  if (now_ns - held_since_ns_ < kHoldNs) return;
  for (std::size_t i = 0; i < kTensionStrings; ++i) middle_[i] = held_sum_[i] / held_readings_;
  last_ = now;
  last_ns_ = now_ns;
  is_led_ = true;
  is_held_.store(true, std::memory_order_relaxed);
}

void CalibrationTask::Lead(std::int64_t now_ns, const EncoderCounts& counts) noexcept {
  Counts now{};
  std::copy_n(counts.begin(), now.size(), now.begin());
  const double way = Farthest(now, last_) * spidar_.count_length_m;
  const bool is_slow = way <= kFastest * Seconds(now_ns - last_ns_);
  last_ = now;
  last_ns_ = now_ns;
  PerString place{};
  double apart = 0;
  for (std::size_t i = 0; i < kTensionStrings; ++i) {
    place[i] = (now[i] - middle_[i]) * spidar_.count_length_m;
    apart = std::max(apart, std::abs(place[i] - (places_.empty() ? 0 : places_.back()[i])));
  }
  if (!is_slow || apart < apart_m_) return;
  places_.push_back(place);
  progress_.store(places_.size(), std::memory_order_relaxed);
}

void CalibrationTask::Release() noexcept {
  PerString tension;
  tension.fill(spidar_.tension_min_n);
  board_.WriteTensions(tension);
}

std::string CalibrationTask::Prompt() const {
  if (!is_held_.load(std::memory_order_relaxed)) {
    return "Hold the grip in the middle, still, for a second. Where you hold it now, it has to be "
           "whenever haptic_server starts: mark the place.";
  }
  const std::size_t tenths = 10 * progress_.load(std::memory_order_relaxed) / kPlaces;
  if (tenths > 0) return std::to_string(10 * tenths) + " % done.";
  return "Lead the grip slowly through all of the space: left and right, up and down, near and "
         "far, into the corners.";
}

Finding CalibrationTask::Result() const {
  if (places_.size() < kPlaces) {
    throw NothingFound("the grip was not led through the whole space: nothing is saved");
  }
  Calibration found;
  try {
    found = CalibrateMotors(spidar_.motors_m, places_, spidar_.count_length_m);
  } catch (const std::invalid_argument& error) {
    throw NothingFound(std::string(error.what()) +
                       ": check which string is on which channel, and which counts backwards");
  }
  const double rounding = spidar_.count_length_m / std::sqrt(12.0);
  std::ostringstream text;
  text << "The lengths of the four strings contradicted each other by "
       << Micrometres(found.contradiction_before_m) << " (root mean square of " << places_.size()
       << " places); now by " << Micrometres(found.contradiction_m)
       << ", of which rounding to counts explains " << Micrometres(rounding)
       << ". A motor is at most " << Micrometres(found.farthest_m)
       << " from where it was thought to be, known to " << Micrometres(found.uncertainty_m)
       << " in the worst direction.";
  for (std::size_t i = 0; i < found.motors_m.size(); ++i) {
    const double farthest = std::min(kFarthestMotor, spidar_.motors_m[i].norm() / 4);
    if ((found.motors_m[i] - spidar_.motors_m[i]).norm() > farthest) {
      throw NothingFound(text.str() + " Motor " + std::to_string(i + 1) +
                         " would be too far away: check which string is on which channel, which "
                         "counts backwards, and count_length_m");
    }
  }
  if (found.contradiction_m > kContradictions * rounding) {
    throw NothingFound(text.str() +
                       " That is too much: a string hung slack or slipped; lead the grip slowly");
  }
  if (found.uncertainty_m > kUncertain) {
    throw NothingFound(text.str() + " That is too little: lead the grip further out");
  }
  std::ostringstream motors;
  motors << std::fixed << std::setprecision(6);
  for (const Vec3& motor : found.motors_m) {
    motors << (motors.str().empty() ? "" : ", ") << motor.x() << " " << motor.y() << " "
           << motor.z();
  }
  return {text.str(), {{"spidar.motors_m", motors.str()}}};
}

}  // namespace rikiseki::haptic

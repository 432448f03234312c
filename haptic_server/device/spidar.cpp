#include "haptic_server/device/spidar.h"

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "common/clock.h"
#include "common/exit_code.h"
#include "haptic_server/device/hand.h"
#include "haptic_server/device/simulated_board.h"

namespace rikiseki::haptic {

Spidar::Spidar(const SpidarSettings& settings, std::unique_ptr<MotorBoard> board)
    : settings_(settings),
      board_(std::move(board)),
      kinematics_(settings.motors_m),
      home_lengths_(kinematics_.Lengths(Vec3::Zero())) {
  if (kinematics_.StringCount() != kTensionStrings) {
    throw std::invalid_argument("this SPIDAR is driven by exactly 4 strings");
  }
}

DeviceStatus Spidar::Read(std::int64_t now_ns, DeviceSample& sample) noexcept {
  EncoderCounts counts{};
  if (!board_->ReadCounts(now_ns, counts)) {
    moving_ = false;
    return DeviceStatus::kFault;
  }
  sample.enabled = board_->Enabled();
  PerString lengths{};
  for (std::size_t string = 0; string < kTensionStrings; ++string) {
    lengths[string] =
        home_lengths_[string] + static_cast<double>(counts[string]) * settings_.count_length_m;
  }
  const SpidarKinematics::Fix fix = kinematics_.Solve(lengths);
  if (!(fix.residual_m <= kSlipResidual) || !fix.position.allFinite()) {
    moving_ = false;
    return DeviceStatus::kFault;
  }
  const double dt = Seconds(now_ns - read_ns_);
  if (!moving_) {
    velocity_.setZero();
  } else if (dt > 0) {
    const double weight = -std::expm1(-2 * std::numbers::pi * settings_.velocity_cutoff_hz * dt);
    velocity_ += weight * ((fix.position - position_) / dt - velocity_);
  }
  moving_ = true;
  read_ns_ = now_ns;
  position_ = fix.position;
  sample.position = position_;
  sample.velocity = velocity_;
  sample.target = board_->hand() != nullptr ? board_->hand()->target() : position_;
  return DeviceStatus::kOk;
}

Vec3 Spidar::Write(const Vec3& force) noexcept {
  std::array<Vec3, kTensionStrings> directions;
  for (std::size_t string = 0; string < kTensionStrings; ++string) {
    directions[string] = (kinematics_.motor(string) - position_).stableNormalized();
  }
  const TensionAllocation allocation =
      AllocateTensions(directions, force, {settings_.tension_min_n, settings_.tension_max_n});
  // A board that does not take the command goes on with the last one at worst; the next Read says
  // so.
  board_->WriteTensions(allocation.tension);
  return allocation.force;
}

void Spidar::Release() noexcept {
  FourStrings tension;
  tension.fill(settings_.tension_min_n);
  board_->WriteTensions(tension);
}

std::string Spidar::Name() const {
  return board_->Name();
}

std::unique_ptr<Device> MakeDevice(const Settings& settings) {
  try {
    return std::make_unique<Spidar>(
        settings.spidar, std::make_unique<SimulatedBoard>(settings.spidar, MakeHand(settings)));
  } catch (const std::invalid_argument& error) {
    throw StartError(kExitConfig, error.what());
  }
}

}  // namespace rikiseki::haptic

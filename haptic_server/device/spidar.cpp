// SPDX-License-Identifier: MIT
#include "haptic_server/device/spidar.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "haptic_server/device/hand.h"
#include "haptic_server/device/tension.h"

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
    velocity_.Restart();
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
    velocity_.Restart();
    Blame(lengths);
    return DeviceStatus::kFault;
  }
  wrong_string_.Clear();
  if (fix.residual_m <= kSoundResidual || !located_) sound_position_ = fix.position;
  located_ = true;
  sample.velocity =
      velocity_.Update(now_ns, fix.position - position_, settings_.velocity_cutoff_hz);
  position_ = fix.position;
  sample.position = position_;
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
  PerString tension{};
  std::copy(allocation.tension.begin(), allocation.tension.end(), tension.begin());
  board_->WriteTensions(tension);
  return allocation.force;
}

void Spidar::Release() noexcept {
  PerString tension;
  tension.fill(settings_.tension_min_n);
  board_->WriteTensions(tension);
}

// Once, when the strings first disagree: the longer ago the sound position, the less it tells.
void Spidar::Blame(const PerString& lengths) noexcept {
  if (!located_ || !wrong_string_.is_clear()) return;
  wrong_string_.Blame(kinematics_.Suspect(lengths, sound_position_));
}

std::string Spidar::Complaint() const {
  const std::string of_board = board_->Complaint();
  return of_board.empty() ? wrong_string_.Complaint() : of_board;
}

std::string Spidar::Name() const {
  return board_->Name();
}

}  // namespace rikiseki::haptic

#include "haptic_server/device/spidar.h"

#include <cmath>
#include <iomanip>
#include <sstream>
#include <stdexcept>
#include <utility>

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
  wrong_string_.store({}, std::memory_order_relaxed);
  if (fix.residual_m <= kSoundResidual || !located_) sound_position_ = fix.position;
  located_ = true;
  position_ = fix.position;
  sample.position = position_;
  sample.velocity = velocity_.Update(now_ns, position_, settings_.velocity_cutoff_hz);
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

// Once, when the strings first disagree: the longer ago the sound position, the less it tells.
void Spidar::Blame(const PerString& lengths) noexcept {
  if (!located_ || wrong_string_.load(std::memory_order_relaxed).number != 0) return;
  const SuspectString suspect = kinematics_.Suspect(lengths, sound_position_);
  wrong_string_.store(
      {static_cast<std::int32_t>(suspect.string) + 1, static_cast<float>(1e3 * suspect.excess_m)},
      std::memory_order_relaxed);
}

std::string Spidar::Complaint() const {
  if (const std::string of_board = board_->Complaint(); !of_board.empty()) return of_board;
  const WrongString wrong = wrong_string_.load(std::memory_order_relaxed);
  if (wrong.number == 0) return "";
  std::ostringstream text;
  text << "string " << wrong.number << " seems " << std::fixed << std::setprecision(1)
       << std::abs(wrong.excess_mm)
       << (wrong.excess_mm > 0 ? " mm too long: it hangs slack or has slipped off"
                               : " mm too short: it has slipped, or its encoder lost counts");
  return text.str();
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

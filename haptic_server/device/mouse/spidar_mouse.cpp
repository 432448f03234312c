// SPDX-License-Identifier: MIT
#include "haptic_server/device/mouse/spidar_mouse.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace rikiseki::haptic {
namespace {

constexpr int kMostReports = 16;  // read in one tick: nobody asks for any

mouse::ForceRange RangeOf(const MouseSettings& settings) {
  return {.min_n = static_cast<float>(settings.min_force_n),
          .max_n = static_cast<float>(settings.max_force_n),
          .duty_percent_per_n = static_cast<float>(settings.duty_percent_per_n),
          .duty_percent_at_zero = static_cast<float>(settings.duty_percent_at_zero)};
}

// Rounding to singles, thrice, must not make a force larger than the one that was allowed.
constexpr float kBelow = 1 - 4 * std::numeric_limits<float>::epsilon();

// What the board can show of `force` [N].
mouse::PlaneForce Showable(const Vec3& force, const mouse::ForceRange& range) noexcept {
  const double wanted_n = std::hypot(force.x(), force.y());
  const float magnitude_n = kBelow * std::min(static_cast<float>(wanted_n), range.max_n);
  if (!(magnitude_n >= range.min_n) || !std::isfinite(wanted_n)) return {};
  return {.magnitude_n = magnitude_n,
          .direction_x = static_cast<float>(force.x() / wanted_n),
          .direction_y = static_cast<float>(force.y() / wanted_n)};
}

}  // namespace

SpidarMouse::SpidarMouse(const MouseSettings& settings, double velocity_cutoff_hz,
                         std::unique_ptr<UsbPort> port)
    : count_length_m_(settings.count_length_m),
      reach_m_(settings.reach_m[0], settings.reach_m[1], 0),
      force_directions_(settings.force_directions[0], settings.force_directions[1], 0),
      range_(RangeOf(settings)),
      velocity_cutoff_hz_(velocity_cutoff_hz),
      port_(std::move(port)),
      mouse_(settings.event) {}

DeviceStatus SpidarMouse::Read(std::int64_t now_ns, DeviceSample& sample) noexcept {
  if (!held_ && port_->Take()) {
    held_ = true;
    started_ = false;
    not_taken_ = 0;
  }
  if (held_) {
    // The board is not asked; this is how its port hears of what was sent, and of its end.
    for (int i = 0; i < kMostReports && port_->Receive(now_ns); ++i) {
    }
    if (port_->trouble() != UsbTrouble::kNone) {
      GiveUp(port_->trouble());
    } else if (not_taken_ >= kHopelessReports) {
      GiveUp(UsbTrouble::kSilent);
    }
  }
  const std::optional<MouseWay> way = mouse_.Read();
  const Vec3 before = position_;
  if (way) Follow(*way);
  if (!held_ || !way) {
    velocity_.Restart();
    return DeviceStatus::kFault;
  }
  sample.enabled = true;
  sample.position = position_;
  sample.velocity = velocity_.Update(now_ns, position_ - before, velocity_cutoff_hz_);
  sample.target = position_;
  return DeviceStatus::kOk;
}

// A mouse that pushes on at the edge does not have to come back for as long.
void SpidarMouse::Follow(const MouseWay& way) noexcept {
  if (followed_) {
    const Vec3 moved(static_cast<double>(way.x - way_.x), static_cast<double>(way.y - way_.y), 0);
    position_ = (position_ + count_length_m_ * moved).cwiseMin(reach_m_).cwiseMax(-reach_m_);
  }
  followed_ = true;
  way_ = way;
}

bool SpidarMouse::Send(UsbPurpose purpose, const mouse::Report& report) noexcept {
  const bool sent = port_->Send(purpose, report);
  not_taken_ = sent ? 0 : not_taken_ + 1;
  return sent;
}

Vec3 SpidarMouse::Write(const Vec3& force) noexcept {
  if (!held_) return Vec3::Zero();
  if (!started_) started_ = Send(UsbPurpose::kRequest, mouse::EncodeStart(range_));
  const mouse::PlaneForce shown = Showable(force.cwiseProduct(force_directions_), range_);
  if (started_ && Send(UsbPurpose::kCommand, mouse::EncodeForce(shown))) {
    displayed_ = double{shown.magnitude_n} *
                 Vec3(shown.direction_x, shown.direction_y, 0).cwiseProduct(force_directions_);
  }
  return displayed_;
}

void SpidarMouse::Release() noexcept {
  if (!held_ || !Send(UsbPurpose::kCommand, mouse::EncodeStop())) return;
  started_ = false;
  displayed_.setZero();
}

// The strings first: what can still be sent leaves before the board is let go.
void SpidarMouse::GiveUp(UsbTrouble why) noexcept {
  Release();
  port_->GiveUp(why);
  held_ = false;
  displayed_.setZero();
}

std::string SpidarMouse::Complaint() const {
  const std::string of_board = port_->Complaint();
  return of_board.empty() ? mouse_.Complaint() : of_board;
}

const char* SpidarMouse::Trouble() const noexcept {
  return held_ ? mouse_.Trouble() : InBrief(port_->absence());
}

}  // namespace rikiseki::haptic

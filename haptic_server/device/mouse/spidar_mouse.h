// SPDX-License-Identifier: MIT
// The SPIDAR-mouse as a force display in the plane: four strings pull an ordinary mouse, whose own event
// device tells where it is. The third axis is always 0, and no force is shown along it.
//
// Device axes: x to the right, y away from the hand, both on the desk; z up. The origin is where the mouse
// was when it was first read.
#pragma once

#include <memory>

#include "haptic_server/device/device.h"
#include "haptic_server/device/mouse/event_mouse.h"
#include "haptic_server/device/mouse/mouse_packets.h"
#include "haptic_server/device/mouse/mouse_settings.h"
#include "haptic_server/device/usb/usb_port.h"
#include "haptic_server/device/velocity_estimate.h"

namespace rikiseki::haptic {

/// After so many reports that the board did not take it is given up, to be opened anew.
inline constexpr int kHopelessReports = 20;

class SpidarMouse final : public Device {
 public:
  /// Settings in which FindMouseConflict finds nothing; `velocity_cutoff_hz` as SetVelocityCutoff.
  SpidarMouse(const MouseSettings& settings, double velocity_cutoff_hz,
              std::unique_ptr<UsbPort> port);

  DeviceStatus Read(std::int64_t now_ns, DeviceSample& sample) noexcept override;

  /// Shows the part of the force in the plane, cut to the largest that the board can show; below the
  /// smallest, none. The reports are singles: what is returned is what they say. While the board is busy
  /// with an older report, that one's force goes on, and is returned.
  Vec3 Write(const Vec3& force) noexcept override;

  /// Stops the board; the next Write starts it again.
  void Release() noexcept override;
  void SetVelocityCutoff(double cutoff_hz) noexcept override { velocity_cutoff_hz_ = cutoff_hz; }
  std::string Name() const override { return port_->Name(); }
  std::string Complaint() const override;
  const char* Trouble() const noexcept override;

 private:
  void GiveUp(UsbTrouble why) noexcept;
  bool Send(UsbPurpose purpose, const mouse::Report& report) noexcept;
  void Follow(const MouseWay& way) noexcept;

  const double count_length_m_;
  const Vec3 reach_m_;
  const Vec3 force_directions_;
  const mouse::ForceRange range_;
  double velocity_cutoff_hz_;
  std::unique_ptr<UsbPort> port_;
  EventMouse mouse_;

  bool held_ = false;     // there is a board
  bool started_ = false;  // it was told its range since it was taken or stopped
  int not_taken_ = 0;     // reports in a row
  Vec3 displayed_ = Vec3::Zero();
  bool followed_ = false;  // the mouse was read before
  MouseWay way_;
  Vec3 position_ = Vec3::Zero();
  VelocityEstimate velocity_;
};

}  // namespace rikiseki::haptic

// SPDX-License-Identifier: MIT
// The force display as the haptic loop sees it: one measurement in, one force out, every tick.
// Behind it stand SPIDARs (make_device.h, over simulated or real motor boards) and the laboratory's
// ideal one.
#pragma once

#include <cstdint>
#include <string>

#include "common/geometry.h"

namespace rikiseki::haptic {

enum class DeviceStatus : std::uint8_t {
  kOk,
  kFault,  // does not answer, or answers nonsense: nothing may be concluded from the sample
};

/// Where the finger is, in device coordinates (SI units).
struct DeviceSample {
  Vec3 position = Vec3::Zero();          // m, centre of the finger
  Vec3 velocity = Vec3::Zero();          // m/s, as estimated by the device's own filter
  Quat orientation = Quat::Identity();   // of the grip, where the device measures it
  Vec3 angular_velocity = Vec3::Zero();  // rad/s, likewise
  Vec3 target =
      Vec3::Zero();     // m, where a simulated hand wants to be; the position on real devices
  bool enabled = true;  // the enable input (foot switch, stop button) is closed, or there is none
};

class Device {
 public:
  virtual ~Device() = default;

  /// Measures. `now_ns` is the start of the tick. // RT: no allocation, lock, log or throw.
  virtual DeviceStatus Read(std::int64_t now_ns, DeviceSample& sample) noexcept = 0;

  /// Displays `force` [N, on the user, device axes] until the next call. Returns the force that is
  /// really displayed after the device's own limits. // RT:
  virtual Vec3 Write(const Vec3& force) noexcept = 0;

  /// The torque [N m, on the user, device axes, about the finger's centre] that Write displayed beside
  /// the force: none is ever asked for, but a device at its limits may not be able to do without. // RT:
  virtual Vec3 torque() const noexcept { return Vec3::Zero(); }

  /// Lets go: zero force, minimum tension. Called on every way out, and in every tick of an emergency
  /// stop. // RT:
  virtual void Release() noexcept = 0;

  /// Another corner [Hz] of the filter behind DeviceSample::velocity, where there is one. // RT:
  virtual void SetVelocityCutoff(double /*cutoff_hz*/) noexcept {}

  virtual std::string Name() const = 0;

  /// What is known to be wrong while Read is a fault, for the log; else empty. From any thread.
  virtual std::string Complaint() const { return ""; }

  /// The same in at most 31 characters, for haptic_status; empty: the name stands there. // RT:
  virtual const char* Trouble() const noexcept { return ""; }
};

}  // namespace rikiseki::haptic

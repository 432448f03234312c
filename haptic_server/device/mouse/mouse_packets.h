// SPDX-License-Identifier: MIT
// The reports of the SPIDAR-mouse (04D8:003F, a Microchip HID): numbers to bytes, nothing else. The facts
// are from SPIDAR-mouse-UNIX and ofxSpidarMouse as noted in public; none was tried on hardware.
//
// Every report has 64 bytes and no number of its own; of an output only the listed bytes matter, the rest
// is sent as 0. Numbers are IEEE 754 singles, little-endian. What a request for the state is answered with
// is known to be one report, and nothing more.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace rikiseki::haptic::mouse {

inline constexpr std::uint16_t kVendorId = 0x04D8;
inline constexpr std::uint16_t kProductId = 0x003F;
inline constexpr std::size_t kReportBytes = 64;
using Report = std::array<std::uint8_t, kReportBytes>;

/// How newtons become duty cycles on the board: percent = slope x force + offset, as the names of the
/// published constants let infer; and the forces that it is good for.
struct ForceRange {
  float min_n = 0.3F;
  float max_n = 1.5F;
  float duty_percent_per_n = 47.9867F;
  float duty_percent_at_zero = 13.1215F;
};

/// A force in the plane: its magnitude [N], and its direction as a unit vector.
struct PlaneForce {
  float magnitude_n = 0;
  float direction_x = 0;
  float direction_y = 0;
};

/// 82: asks for the state.
Report EncodeStateRequest() noexcept;

/// 80: starts, with the range. // RT:
Report EncodeStart(const ForceRange& range) noexcept;

/// 97: this force from now on. Two numbers before it, always 0 in public code, are sent as that. // RT:
Report EncodeForce(const PlaneForce& force) noexcept;

/// 99: stops. // RT:
Report EncodeStop() noexcept;

}  // namespace rikiseki::haptic::mouse

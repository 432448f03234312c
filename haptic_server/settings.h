// SPDX-License-Identifier: MIT
// Everything a researcher may tune on the haptic side, with its defaults. settings.cpp gives the keys.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/config.h"
#include "common/geometry.h"
#include "common/rigid_body.h"
#include "haptic_server/device/mouse/mouse_settings.h"
#include "haptic_server/device/usb/usb_settings.h"

namespace rikiseki::haptic {

enum class RealtimePolicy { kEnforce, kIgnore };  // enforce: refuse to start without it

struct LoopSettings {
  double rate_hz = 1000;
  int fifo_priority = 80;
  int cpu = -1;
  RealtimePolicy realtime = RealtimePolicy::kIgnore;
  int fault_after_misses = 20;           // deadlines in a row: force to zero
  double longest_world_period_ms = 200;  // sizes the ring: slots >= 4 (Tw + latency) / T
};

/// How the surface is shown between two frames. numerics 1, paper 3.2.
enum class DisplayRule { kInterpolate, kHold, kExtrapolate };

struct RenderSettings {
  double stiffness_n_per_m = 2000;  // of surfaces that bring none of their own
  double damping_ns_per_m = 2;
  bool adhesion = false;  // true: the literal damper of the paper, which may pull
  DisplayRule display = DisplayRule::kInterpolate;
  PositionRule position_rule = PositionRule::kSecondOrder;  // of the local copies
  double finger_radius_mm = 10;
  double friction_stiffness_n_per_m = 1000;  // of the stick spring, where surfaces have friction
};

struct SafetySettings {
  double force_cap_n = 10;
  double slew_limit_n_per_s = 5000;
  double speed_limit_m_per_s = 3;
  double light_damping_ns_per_m = 1;  // of a finger that is too fast, and while a lost world fades
  bool passivity_controller = false;
  double soft_start_ms = 200;  // the force grows over this after a world came
  double fade_ms = 80;         // ... and goes to zero over this when it is lost
  double late_periods = 2.5;   // no frame for this many world periods: hold
  double lost_periods = 5;     // ... for this many, and at least lost_floor_ms: lost
  double lost_floor_ms = 250;
};

/// How the device lies in the world: C = motion_scale R C_device + origin, f_device = force_scale
/// R^T f_world. R turns about the fixed axes of the world: roll about x first, then pitch about y,
/// then yaw about z.
struct MappingSettings {
  Vec3 origin_mm = Vec3::Zero();     // of the device, in the world
  Vec3 rotation_deg = Vec3::Zero();  // roll pitch yaw
  double motion_scale = 1;           // s_x, metres in the world per metre of the device
  double force_scale = 1;            // s_f, newtons at the device per newton in the world
};

enum class DeviceKind { kSimulated, kUsb, kReplay, kMouse };

struct DeviceSettings {
  DeviceKind kind = DeviceKind::kSimulated;
  std::string
      file;  // motor positions, counts, tension bounds: config/devices/*.ini; or a recording
};

enum class HandScript { kPush, kStir, kRest };

/// The simulated hand: a minimum-jerk motor program plus the impedance of the hand. numerics 5.
/// Mass and damping are of the hand alone; the device's own are in the device file.
struct HandSettings {
  HandScript script = HandScript::kPush;
  double mass_kg = 0.9;
  double damping_ns_per_m = 15;
  double stiffness_n_per_m = 500;
  Vec3 home_mm = Vec3(-50, 0, 0);    // where a push starts and ends
  Vec3 stroke_mm = Vec3(110, 0, 0);  // the reach of one push, the box of a stirring hand
  double reach_ms = 300;             // there
  double hold_ms = 100;
  double return_ms = 300;       // and back
  double rest_ms = 500;         // between two pushes, plus a random part
  double rest_jitter_ms = 100;  // uniform from 0 to this: meets every phase of the world
  int seed = 1;
};

/// Longer than this no device file may say that a force takes to come.
inline constexpr double kLongestLatencyUs = 10'000;

/// Motor positions and electronics of a SPIDAR of 4 strings, which meet in one point, or 8, which hold a
/// grip. notes of config/devices/*.ini.
struct SpidarSettings {
  std::vector<Vec3> motors_m;          // in device axes
  std::vector<Vec3> attachments_mm;    // of 8 strings: where they end, in grip axes; else none
  double rest_tension_n = 0;           // of 8 strings: what each has without a force; else 0
  double count_length_m = 2.92406e-5;  // string length per encoder count
  double tension_min_n = 0.5;
  double tension_max_n = 20;
  double velocity_cutoff_hz = 100;  // of the first-order velocity filter
  double moving_mass_kg = 0.03;
  double friction_damping_ns_per_m = 0.2;
  double friction_n = 0;  // Coulomb
  double latency_us = 0;  // from a measurement to the force that was computed from it
};

struct Settings {
  LoopSettings loop;
  RenderSettings render;
  SafetySettings safety;
  MappingSettings mapping;
  DeviceSettings device;
  HandSettings hand;
  SpidarSettings spidar;
  UsbSettings usb;
  MouseSettings mouse;

  std::int64_t period_ns() const;
};

/// Reads the daemon's file, the overrides and the device file it names, and checks them against each
/// other. `description`, if given, receives every key with value and origin, `values` those two
/// alone. Throws ConfigError.
Settings LoadSettings(const std::string& path, const std::vector<std::string>& set,
                      std::string* description = nullptr, ConfigValues* values = nullptr);

/// The checks that involve several keys; throws std::invalid_argument naming them. For settings that
/// come from code, not from a file.
void CheckSettings(const Settings& settings);

}  // namespace rikiseki::haptic

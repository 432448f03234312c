// SPDX-License-Identifier: MIT
#include "haptic_server/settings.h"

#include <cmath>
#include <optional>
#include <stdexcept>

#include "haptic_server/device/spidar_grip.h"
#include "haptic_server/device/spidar_kinematics.h"
#include "haptic_server/device/tension.h"

namespace rikiseki::haptic {
namespace {

constexpr double kLongestZeroingMs = 100;  // from "lost" to zero force
constexpr double kSureStep = 1.01;         // whatever is rounded on its way

// The keys of the daemon's own file.
ConfigSchema DaemonSchema(Settings& settings) {
  ConfigSchema schema;
  LoopSettings& loop = settings.loop;
  schema.Number("loop.rate_hz", &loop.rate_hz, 100, 8000, "How often the force is computed.");
  schema.Integer("loop.fifo_priority", &loop.fifo_priority, 1, 98,
                 "SCHED_FIFO priority of the loop's thread.");
  schema.Integer("loop.cpu", &loop.cpu, -1, 1023,
                 "The processor the loop is pinned to; -1 leaves it to the scheduler.");
  schema.Choice("loop.realtime", &loop.realtime,
                {{"enforce", RealtimePolicy::kEnforce}, {"ignore", RealtimePolicy::kIgnore}},
                "Whether to refuse to start without real-time scheduling and locked memory.");
  schema.Integer("loop.fault_after_misses", &loop.fault_after_misses, 1, 1000,
                 "So many missed deadlines in a row bring the force to zero.");
  schema.Number("loop.longest_world_period_ms", &loop.longest_world_period_ms, 5, 1000,
                "The slowest world to expect: sizes the ring and bounds the time-outs.");

  RenderSettings& render = settings.render;
  schema.Number("render.stiffness_n_per_m", &render.stiffness_n_per_m, 0, 1e5,
                "Stiffness of surfaces that bring none of their own.");
  schema.Number("render.damping_ns_per_m", &render.damping_ns_per_m, 0, 1000,
                "Damping of surfaces that bring no stiffness of their own.");
  schema.Flag("render.adhesion", &render.adhesion,
              "Whether the damper may pull the finger back when it leaves, as in the paper.");
  schema.Choice("render.display", &render.display,
                {{"interpolate", DisplayRule::kInterpolate},
                 {"hold", DisplayRule::kHold},
                 {"extrapolate", DisplayRule::kExtrapolate}},
                "How surfaces move between two world frames.");
  schema.Choice("render.position_rule", &render.position_rule,
                {{"second_order", PositionRule::kSecondOrder},
                 {"semi_implicit", PositionRule::kSemiImplicit}},
                "How local copies of bodies advance; semi_implicit is for written experiments.");
  schema.Number("render.finger_radius_mm", &render.finger_radius_mm, 0, 100,
                "Radius of the sphere that stands for the finger.");
  schema.Number("render.friction_stiffness_n_per_m", &render.friction_stiffness_n_per_m, 1, 1e5,
                "Stiffness that holds a sticking finger, on surfaces that have friction.");

  SafetySettings& safety = settings.safety;
  schema.Number("safety.force_cap_n", &safety.force_cap_n, 0.1, 100,
                "No displayed force exceeds this.");
  schema.Number("safety.slew_limit_n_per_s", &safety.slew_limit_n_per_s, 10, 1e6,
                "The displayed force does not change faster.");
  schema.Number("safety.speed_limit_m_per_s", &safety.speed_limit_m_per_s, 0.1, 100,
                "A faster finger feels no surface, only light damping.");
  schema.Number("safety.light_damping_ns_per_m", &safety.light_damping_ns_per_m, 0, 20,
                "Damping of a finger that is too fast, and of any while a lost world fades out.");
  schema.Choice("safety.passivity_controller", &safety.passivity_controller,
                {{"on", true}, {"off", false}},
                "Whether energy that the rendering gives away is braked at once.");
  schema.Number("safety.soft_start_ms", &safety.soft_start_ms, 0, 5000,
                "How long the force takes to come back after a world came or a fault went.");
  schema.Number("safety.fade_ms", &safety.fade_ms, 10, 100,
                "How long the force takes to go when the world is lost.");
  schema.Number("safety.late_periods", &safety.late_periods, 1.1, 100,
                "No frame for so many world periods: the world is late, surfaces are held.");
  schema.Number("safety.lost_periods", &safety.lost_periods, 1.2, 200,
                "No frame for so many world periods: the world is lost.");
  schema.Number("safety.lost_floor_ms", &safety.lost_floor_ms, 10, 2000,
                "A silence shorter than this is never a loss.");

  MappingSettings& mapping = settings.mapping;
  schema.Vector("mapping.origin_mm", &mapping.origin_mm, -1e5, 1e5,
                "Where the middle of the device lies in the world.");
  schema.Vector(
      "mapping.rotation_deg", &mapping.rotation_deg, -360, 360,
      "Device axes in the world: roll, pitch and yaw about its fixed x, y and z, in turn.");
  schema.Number("mapping.motion_scale", &mapping.motion_scale, 1e-3, 1e3,
                "Metres in the world per metre of the device.");
  schema.Number("mapping.force_scale", &mapping.force_scale, 1e-3, 1e3,
                "Newtons at the device per newton in the world.");

  schema.Choice("device.kind", &settings.device.kind,
                {{"simulated", DeviceKind::kSimulated},
                 {"usb", DeviceKind::kUsb},
                 {"mouse", DeviceKind::kMouse},
                 {"replay", DeviceKind::kReplay}},
                "Which force display to drive.");
  schema.Path("device.file", &settings.device.file,
              "The file that describes the display, or that is replayed, relative to this one.");

  HandSettings& hand = settings.hand;
  schema.Choice(
      "hand.script", &hand.script,
      {{"push", HandScript::kPush}, {"stir", HandScript::kStir}, {"rest", HandScript::kRest}},
      "What the simulated hand does.");
  schema.Number("hand.mass_kg", &hand.mass_kg, 0.001, 100, "Mass of the hand alone.");
  schema.Number("hand.damping_ns_per_m", &hand.damping_ns_per_m, 0, 1000,
                "Damping of the hand alone.");
  schema.Number("hand.stiffness_n_per_m", &hand.stiffness_n_per_m, 0, 1e5,
                "Stiffness of the hand about its intended path.");
  schema.Vector("hand.home_mm", &hand.home_mm, -1000, 1000, "Where a push starts and ends.");
  schema.Vector("hand.stroke_mm", &hand.stroke_mm, -1000, 1000,
                "The reach of one push, the box of a stirring hand.");
  schema.Number("hand.reach_ms", &hand.reach_ms, 1, 1e5, "Duration of the way there.");
  schema.Number("hand.hold_ms", &hand.hold_ms, 0, 1e5, "Duration of the stay there.");
  schema.Number("hand.return_ms", &hand.return_ms, 1, 1e5, "Duration of the way back.");
  schema.Number("hand.rest_ms", &hand.rest_ms, 0, 1e5, "Rest between two pushes.");
  schema.Number("hand.rest_jitter_ms", &hand.rest_jitter_ms, 0, 1e5,
                "Random part of the rest, so that pushes meet every phase of the world.");
  schema.Integer("hand.seed", &hand.seed, 0, 2'000'000'000, "Seed of the random part.");
  return schema;
}

// What any display's file says of its grip.
void AddGripKeys(ConfigSchema& schema, SpidarSettings& spidar) {
  schema.Number("spidar.velocity_cutoff_hz", &spidar.velocity_cutoff_hz, 1, 4000,
                "Corner of the first-order velocity filter.");
  schema.Number("spidar.moving_mass_kg", &spidar.moving_mass_kg, 0, 10,
                "Mass that moves with the grip.");
  schema.Number("spidar.friction_damping_ns_per_m", &spidar.friction_damping_ns_per_m, 0, 100,
                "Viscous friction of motors and strings.");
  schema.Number("spidar.friction_n", &spidar.friction_n, 0, 10,
                "Dry friction of motors and strings, as felt at the grip.");
  schema.Number("spidar.latency_us", &spidar.latency_us, 0, kLongestLatencyUs,
                "From a measurement to the force that was computed from it.");
}

// The keys of a device file.
ConfigSchema DeviceSchema(Settings& settings) {
  ConfigSchema schema;
  SpidarSettings& spidar = settings.spidar;
  AddGripKeys(schema, spidar);
  if (settings.device.kind == DeviceKind::kMouse) {
    AddMouseKeys(schema, settings.mouse);
    return schema;
  }
  AddUsbKeys(schema, settings.usb);
  schema.Vectors("spidar.motors_m", &spidar.motors_m, -10, 10,
                 "Where the strings leave their motors, device axes: four, or eight.");
  schema.Vectors("spidar.attachments_mm", &spidar.attachments_mm, -1000, 1000,
                 "Where eight strings end on the grip, from its centre, upright in the middle.");
  schema.Number("spidar.count_length_m", &spidar.count_length_m, 1e-7, 1e-3,
                "String length per encoder count.");
  schema.Number("spidar.tension_min_n", &spidar.tension_min_n, 0, 10,
                "Tension that keeps a string from going slack.");
  schema.Number("spidar.tension_max_n", &spidar.tension_max_n, 0.1, 100,
                "The most a motor may pull.");
  schema.Number("spidar.rest_tension_n", &spidar.rest_tension_n, 0, 100,
                "Tension of each of eight strings where no force is displayed.");
  return schema;
}

struct Conflict {
  std::string key;
  std::string why;
};

std::optional<Conflict> FindConflict(const Settings& settings) {
  const SafetySettings& safety = settings.safety;
  const double slew_ms = 1e3 * safety.force_cap_n / safety.slew_limit_n_per_s;
  if (!(safety.fade_ms + slew_ms <= kLongestZeroingMs)) {
    return Conflict{
        "safety.fade_ms",
        "with safety.force_cap_n / safety.slew_limit_n_per_s it takes longer than 100 ms "
        "from a lost world to zero force"};
  }
  if (!(safety.late_periods < safety.lost_periods)) {
    return Conflict{"safety.lost_periods", "it must exceed safety.late_periods"};
  }
  return std::nullopt;
}

std::optional<Conflict> FindPointConflict(const SpidarSettings& spidar) {
  try {
    const SpidarKinematics kinematics(spidar.motors_m);
  } catch (const std::invalid_argument& error) {
    return Conflict{"spidar.motors_m", error.what()};
  }
  const std::string why =
      "of 4 motors the strings meet in one point: leave it out, or give 8 motors";
  if (!spidar.attachments_mm.empty()) return Conflict{"spidar.attachments_mm", why};
  if (spidar.rest_tension_n != 0) return Conflict{"spidar.rest_tension_n", why};
  return std::nullopt;
}

std::optional<Conflict> FindGripConflict(const SpidarSettings& spidar) {
  if (spidar.attachments_mm.size() != kGripStrings) {
    return Conflict{"spidar.attachments_mm", "8 places are expected, one for each motor"};
  }
  const TensionBounds bounds{spidar.tension_min_n, spidar.tension_max_n};
  if (!(bounds.min_n <= spidar.rest_tension_n && spidar.rest_tension_n <= bounds.max_n)) {
    return Conflict{"spidar.rest_tension_n",
                    "it must lie between spidar.tension_min_n and spidar.tension_max_n"};
  }
  try {
    const GripStrings home = GripKinematics(spidar).StringsAt(Pose());
    if (!AllocateWrench(home, {}, bounds, spidar.rest_tension_n).feasible) {
      return Conflict{
          "spidar.attachments_mm",
          "strings that pull cannot hold the grip still in the middle: check which motor "
          "pulls at which place"};
    }
  } catch (const std::invalid_argument& error) {
    return Conflict{"spidar.attachments_mm", error.what()};
  }
  return std::nullopt;
}

std::optional<Conflict> FindConflict(const SpidarSettings& spidar) {
  if (!(spidar.tension_min_n < spidar.tension_max_n)) {
    return Conflict{"spidar.tension_max_n", "it must exceed spidar.tension_min_n"};
  }
  switch (spidar.motors_m.size()) {
    case kTensionStrings:
      return FindPointConflict(spidar);
    case kGripStrings:
      return FindGripConflict(spidar);
    default:
      return Conflict{"spidar.motors_m", "exactly 4 motors, or 8, are expected"};
  }
}

// What a SPIDAR-mouse wants of the loop.
std::optional<Conflict> FindMouseLoopConflict(const Settings& settings) {
  if (settings.period_ns() > kLongestReportPeriodNs) {
    return Conflict{"loop.rate_hz",
                    "a SPIDAR-mouse wants its force at least every 4 ms: 250 or more is expected"};
  }
  // The slew limit counts from what is shown: a step below the smallest force would never lead there.
  const double step_n =
      settings.safety.slew_limit_n_per_s * 1e-9 * static_cast<double>(settings.period_ns());
  if (!(step_n > kSureStep * settings.mouse.min_force_n)) {
    return Conflict{"safety.slew_limit_n_per_s",
                    "in one period of loop.rate_hz the force must be able to reach "
                    "mouse.min_force_n, below which a SPIDAR-mouse shows none"};
  }
  return std::nullopt;
}

void RequirePositive(const std::string& key, double value) {
  if (!(value > 0) || !std::isfinite(value)) {
    throw std::invalid_argument(key + " must be positive and finite");
  }
}

void RequireNotNegative(const std::string& key, double value) {
  if (!(value >= 0) || !std::isfinite(value)) {
    throw std::invalid_argument(key + " must not be negative, and be finite");
  }
}

void RequireFinite(const std::string& key, const Vec3& value) {
  if (!value.allFinite()) throw std::invalid_argument(key + " must be finite");
}

}  // namespace

std::int64_t Settings::period_ns() const {
  return static_cast<std::int64_t>(std::llround(1e9 / loop.rate_hz));
}

Settings LoadSettings(const std::string& path, const std::vector<std::string>& set,
                      std::string* description, ConfigValues* values) {
  const auto is_of_device = [](const std::string& assignment) {
    return assignment.starts_with("spidar.") || assignment.starts_with("usb.") ||
           assignment.starts_with("mouse.");
  };
  Settings settings;
  ConfigSchema daemon = DaemonSchema(settings);
  daemon.Load(path);
  for (const std::string& assignment : set) {
    if (!is_of_device(assignment)) daemon.Set(assignment);
  }
  if (settings.device.file.empty()) daemon.Refuse("device.file", "the display needs a description");

  const bool described = settings.device.kind != DeviceKind::kReplay;
  ConfigSchema device = DeviceSchema(settings);
  if (described) device.Load(settings.device.file);
  for (const std::string& assignment : set) {
    if (is_of_device(assignment)) device.Set(assignment);
  }

  if (const auto conflict = FindConflict(settings)) daemon.Refuse(conflict->key, conflict->why);
  const bool has_strings = described && settings.device.kind != DeviceKind::kMouse;
  if (const auto conflict = FindConflict(settings.spidar); has_strings && conflict) {
    device.Refuse(conflict->key, conflict->why);
  }
  if (settings.device.kind == DeviceKind::kUsb) {
    const auto conflict = FindUsbConflict(settings.usb, settings.spidar.motors_m.size(),
                                          settings.spidar.tension_max_n,
                                          1e-3 * static_cast<double>(settings.period_ns()));
    if (conflict) device.Refuse(conflict->key, conflict->why);
  }
  if (settings.device.kind == DeviceKind::kMouse) {
    if (const auto conflict = FindMouseConflict(settings.mouse)) {
      device.Refuse(conflict->key, conflict->why);
    }
    if (const auto conflict = FindMouseLoopConflict(settings)) {
      daemon.Refuse(conflict->key, conflict->why);
    }
  }
  if (description != nullptr) *description = daemon.Describe() + device.Describe();
  if (values != nullptr) {
    *values = daemon.Values();
    values->merge(device.Values());
  }
  return settings;
}

void CheckSettings(const Settings& settings) {
  RequirePositive("loop.rate_hz", settings.loop.rate_hz);
  RequirePositive("loop.fault_after_misses", settings.loop.fault_after_misses);
  RequirePositive("loop.longest_world_period_ms", settings.loop.longest_world_period_ms);
  RequireNotNegative("render.stiffness_n_per_m", settings.render.stiffness_n_per_m);
  RequireNotNegative("render.damping_ns_per_m", settings.render.damping_ns_per_m);
  RequireNotNegative("render.finger_radius_mm", settings.render.finger_radius_mm);
  RequirePositive("render.friction_stiffness_n_per_m", settings.render.friction_stiffness_n_per_m);
  RequirePositive("safety.force_cap_n", settings.safety.force_cap_n);
  RequirePositive("safety.slew_limit_n_per_s", settings.safety.slew_limit_n_per_s);
  RequirePositive("safety.speed_limit_m_per_s", settings.safety.speed_limit_m_per_s);
  RequireNotNegative("safety.light_damping_ns_per_m", settings.safety.light_damping_ns_per_m);
  RequireNotNegative("safety.soft_start_ms", settings.safety.soft_start_ms);
  RequirePositive("safety.fade_ms", settings.safety.fade_ms);
  RequirePositive("safety.late_periods", settings.safety.late_periods);
  RequirePositive("safety.lost_periods", settings.safety.lost_periods);
  RequireNotNegative("safety.lost_floor_ms", settings.safety.lost_floor_ms);
  RequirePositive("mapping.motion_scale", settings.mapping.motion_scale);
  RequirePositive("mapping.force_scale", settings.mapping.force_scale);
  RequireFinite("mapping.origin_mm", settings.mapping.origin_mm);
  RequireFinite("mapping.rotation_deg", settings.mapping.rotation_deg);
  if (settings.period_ns() <= 0) throw std::invalid_argument("loop.rate_hz is too high");
  if (const auto conflict = FindConflict(settings)) {
    throw std::invalid_argument(conflict->key + ": " + conflict->why);
  }
}

}  // namespace rikiseki::haptic

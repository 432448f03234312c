// SPDX-License-Identifier: MIT
#include "protocol/tools/status_text.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <sstream>

#include "protocol/impulse_units.h"

namespace rikiseki::protocol {
namespace {

using Json = nlohmann::ordered_json;
using Out = std::ostringstream;

constexpr std::size_t kMostBodies = 20;
constexpr std::size_t kMostBodiesBrief = 3;
constexpr int kBarWidth = 40;

std::string Text(const Json& text) {
  return text.get<std::string>();
}

// Without the sign of what is rounded to zero.
std::string Number(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  const std::string number = text;
  const bool is_zero = number.find_first_of("123456789in") == std::string::npos;  // inf, nan
  return is_zero && number.front() == '-' ? number.substr(1) : number;
}

std::string Vector3(const Json& vector, double scale, int digits) {
  std::string text = "(";
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0) text += ", ";
    text += Number(vector[i].get<double>() * scale, digits);
  }
  return text + ")";
}

std::string Counted(std::uint64_t count, const char* one, const char* many) {
  return std::to_string(count) + " " + (count == 1 ? one : many);
}

std::string Rate(const Json& rate) {
  const std::string nominal = Number(rate["nominal_hz"], 1) + " Hz";
  if (rate["measured_hz"].is_null()) return nominal + " nominal";
  return Number(rate["measured_hz"], 1) + " Hz of " + nominal;
}

std::string Durations(const Json& us) {
  return "p50 " + Number(us["p50"], 0) + "  p99 " + Number(us["p99"], 0) + "  p99.9 " +
         Number(us["p99_9"], 0) + "  max " + Number(us["max"], 0) + " us";
}

// How late the loop woke up, by powers of ten.
void WriteHistogram(const Json& us, Out& out) {
  struct Row {
    const char* label;
    double below_us;
    std::uint64_t count = 0;
  };
  std::array<Row, 5> rows{{{"< 10 us", 10},
                           {"< 100 us", 100},
                           {"< 1 ms", 1e3},
                           {"< 10 ms", 1e4},
                           {"more", std::numeric_limits<double>::infinity()}}};
  const double total = us["count"].get<double>();
  if (total == 0) return;
  for (const Json& bucket : us["buckets"]) {
    for (Row& row : rows) {
      if (bucket[0].get<double>() >= row.below_us) continue;
      row.count += bucket[1].get<std::uint64_t>();
      break;
    }
  }
  for (const Row& row : rows) {
    const double share = static_cast<double>(row.count) / total;
    char start[64];
    std::snprintf(start, sizeof start, "             %-8s %9.4f %%", row.label, 100 * share);
    const auto bar = static_cast<std::size_t>(std::ceil(kBarWidth * share));
    out << start << (bar > 0 ? "  " : "") << std::string(bar, '#') << "\n";
  }
}

void WriteCommon(const char* who, const Json& side, Out& out) {
  out << who << "  " << Text(side["state"]) << ", " << Rate(side["rate"]) << ", last sign of life "
      << Number(side["heartbeat_age_ms"], 1) << " ms ago; epoch " << side["epoch"] << ", pid "
      << side["pid"] << ", build " << Text(side["build"]) << "\n";
}

void WriteLoop(const Json& side, StatusDetail detail, Out& out) {
  const Json& scheduling = side["scheduling"];
  out << "  loop       " << Text(scheduling["policy"]) << ", memory "
      << (scheduling["memory_locked"].get<bool>() ? "locked" : "not locked") << ", "
      << Counted(side["missed"], "deadline", "deadlines") << " missed\n"
      << "  lateness   " << Durations(side["lateness_us"]) << "\n";
  if (detail == StatusDetail::kFull) WriteHistogram(side["lateness_us"], out);
  out << "  work       " << Durations(side["duration_us"]) << "\n";
}

// Local bodies; a jump beyond a millimetre says that the copies do not know something.
void WriteCopies(const Json& reconciliation, Out& out) {
  if (reconciliation["frames"] == 0) return;
  out << "  copies     corrected by " << Counted(reconciliation["frames"], "frame", "frames")
      << "; newest jump " << Number(reconciliation["newest_jump_mm"].get<double>(), 4)
      << " mm, largest " << Number(reconciliation["largest_jump_mm"].get<double>(), 4) << " mm\n";
}

void WriteEnergy(const Json& energy, Out& out) {
  const double injected_mj = energy["injected_j"].get<double>() * 1e3;
  out << "  energy     the rendering has " << (injected_mj > 0 ? "given " : "absorbed ")
      << Number(std::abs(injected_mj), 3) << " mJ, the device dissipated "
      << Number(energy["dissipated_j"].get<double>() * 1e3, 3) << " mJ"
      << (energy["controller_acts"].get<bool>() ? "; the passivity controller brakes" : "")
      << "\n  contact    "
      << (energy["unstable"].get<bool>()
              ? "UNSTABLE: it gives more energy than the device can dissipate"
              : "no sign of instability")
      << ", flagged " << Counted(energy["times_flagged"], "time", "times") << " since the start\n";
}

void WriteHaptic(const Json& haptic, StatusDetail detail, Out& out) {
  if (!haptic["attached"].get<bool>()) {
    out << "HAPTIC  not there: " << Text(haptic["why"]) << "\n";
    return;
  }
  WriteCommon("HAPTIC", haptic, out);
  if (haptic.contains("reason")) out << "  force      " << Text(haptic["sentence"]) << "\n";
  if (haptic.contains("newest")) {
    const Json& newest = haptic["newest"];
    for (const Json& pointer : newest["pointers"]) {
      out << "  pointer " << pointer["pointer"] << "  at " << Vector3(pointer["position_m"], 1e3, 2)
          << " mm, moving " << Vector3(pointer["velocity_m_per_s"], 1e3, 1) << " mm/s, force "
          << Vector3(pointer["force_n"], 1, 3) << " N\n";
    }
    out << "  channels   " << newest["channels"].size() << " in use; displays frame "
        << newest["world_frame"] << " of world epoch " << newest["world_epoch"] << "\n";
  }
  if (!haptic.contains("reason")) return;
  out << "  target     " << Vector3(haptic["target_m"], 1e3, 2) << " mm, device "
      << Text(haptic["device"]) << "\n"
      << "  limits     slew " << Number(haptic["slew_limit_n_per_s"], 0)
      << " N/s, zero force after " << Number(haptic["zero_force_after_ms"], 0)
      << " ms of a silent world\n"
      << "  world      " << Text(haptic["peer"]["state"]) << ", epoch " << haptic["peer"]["epoch"]
      << ", newest frame " << Number(haptic["peer"]["feature_age_ms"], 1) << " ms old\n";
  WriteEnergy(haptic["energy"], out);
  WriteCopies(haptic["reconciliation"], out);
  WriteLoop(haptic, detail, out);
  out << "  faults     " << haptic["page_faults"]["minor"] << " minor, "
      << haptic["page_faults"]["major"] << " major; largest force "
      << Number(haptic["largest_force_n"], 3) << " N, largest step "
      << Number(haptic["largest_force_step_n"], 4) << " N\n";
}

void WriteBooks(const Json& books, StatusDetail detail, Out& out) {
  if (books.is_null()) return;
  const double unit = books["unit_ns"];
  out << "BOOKS   " << (books["balanced"].get<bool>() ? "balanced" : "NOT BALANCED");
  if (detail == StatusDetail::kBrief) {
    out << ", displayed " << Vector3(books["displayed"], unit, 6) << " N s\n";
    return;
  }
  out << " (N s)\n";
  for (const char* name :
       {"displayed", "covered", "applied", "discarded", "peer_lost", "pending", "ground"}) {
    out << "  " << name << std::string(11 - std::string(name).size(), ' ')
        << Vector3(books[name], unit, 12) << "\n";
  }
}

void WriteBodies(const Json& bodies, std::size_t most, Out& out) {
  std::size_t shown = 0;
  for (const Json& body : bodies) {
    if (++shown > most) {
      out << "  ... and " << Counted(bodies.size() - most, "more body", "more bodies") << "\n";
      break;
    }
    const double mass = body["mass_kg"];
    out << "  body " << body["body"] << "." << body["generation"];
    if (!body["name"].is_null()) out << " " << Text(body["name"]);
    out << "   at " << Vector3(body["position_m"], 1e3, 2) << " mm, moving "
        << Vector3(body["velocity_m_per_s"], 1e3, 1) << " mm/s, "
        << (mass > 0 ? Number(mass, 4) + " kg" : "fixed") << "\n";
  }
}

void WriteWorld(const Json& world, StatusDetail detail, Out& out) {
  if (!world["attached"].get<bool>()) {
    out << "WORLD   not there: " << Text(world["why"]) << "\n";
    return;
  }
  WriteCommon("WORLD ", world, out);
  if (world.contains("scene")) {
    out << "  scene      " << Text(world["scene"]) << ", coupling " << Text(world["coupling"])
        << ", " << Counted(world["moving_bodies"], "body", "bodies") << " can move\n"
        << "  haptic     " << Text(world["peer"]["state"]) << ", epoch " << world["peer"]["epoch"]
        << ", " << Counted(world["lapped"], "tick", "ticks") << " lapped\n";
    for (const auto& [reason, units] : world["discarded"].items()) {
      if (units == Json::array({0, 0, 0})) continue;
      out << "  discarded  " << Vector3(units, kImpulseUnit, 12) << " N s: " << reason << "\n";
    }
    WriteLoop(world, detail, out);
  }
  if (world.contains("newest")) {
    const Json& newest = world["newest"];
    out << "  frame      " << newest["frame"] << ", "
        << Counted(newest["planes"], "plane", "planes") << ", " << Number(newest["age_ms"], 1)
        << " ms old, includes tick " << newest["acked_tick"] << " of haptic epoch "
        << newest["acked_epoch"] << "\n";
  }
  WriteBodies(world["bodies"], detail == StatusDetail::kFull ? kMostBodies : kMostBodiesBrief, out);
}

}  // namespace

std::string StatusText(const Json& report, StatusDetail detail) {
  Out out;
  WriteHaptic(report["haptic"], detail, out);
  WriteBooks(report["books"], detail, out);
  WriteWorld(report["world"], detail, out);
  return out.str();
}

}  // namespace rikiseki::protocol

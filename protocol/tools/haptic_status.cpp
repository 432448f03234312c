// haptic_status: what both daemons are doing, and above all why the force is what it is. An
// observer: it maps both segments read-only and disturbs nobody.
#include <unistd.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <limits>
#include <thread>

#include "common/command_line.h"
#include "common/daemon.h"
#include "common/exit_code.h"
#include "protocol/tools/observer.h"

namespace rikiseki::protocol {
namespace {

namespace po = boost::program_options;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMostBodiesShown = 20;
constexpr double kRateSampleSeconds = 0.2;  // between the two readings of --once

struct Options {
  std::string instance = "0";
  bool once = false;
  bool json = false;
  double interval_s = 1;
};

Options Parse(int argc, char** argv) {
  Options options;
  CommandLine line{
      .program = "haptic_status",
      .visible = po::options_description(
          "haptic_status: what both daemons are doing, and why the force is what it is")};
  line.visible.add_options()("instance", po::value(&options.instance)->value_name("NAME"),
                             "which pair of daemons (default 0)")(
      "once", po::bool_switch(&options.once), "one report, then end")(
      "json", po::bool_switch(&options.json), "one JSON object per report and line")(
      "interval", po::value(&options.interval_s)->value_name("SECONDS"),
      "between two reports (default 1)");
  ParseCommandLine(argc, argv, line);
  if (!(options.interval_s >= 0.01 && options.interval_s <= 3600)) {
    throw StartError(kExitUsage, "--interval must be from 0.01 to 3600 seconds");
  }
  return options;
}

std::string Number(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

std::string Vector3(const Json& vector, double scale, int digits) {
  std::string text = "(";
  for (std::size_t i = 0; i < 3; ++i) {
    if (i > 0) text += ", ";
    text += Number(vector[i].get<double>() * scale, digits);
  }
  return text + ")";
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
void PrintHistogram(const Json& us) {
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
    std::printf("             %-8s %9.4f %%  %-40.*s\n", row.label, 100 * share,
                static_cast<int>(std::ceil(40 * share)),
                "########################################");
  }
  std::fflush(stdout);
}

void PrintCommon(const char* who, const Json& side) {
  std::cout << who << "  " << side["state"].get<std::string>() << ", epoch " << side["epoch"]
            << ", pid " << side["pid"] << ", last sign of life "
            << Number(side["heartbeat_age_ms"], 1) << " ms ago, " << Rate(side["rate"]) << "\n";
}

void PrintLoop(const Json& side) {
  const Json& scheduling = side["scheduling"];
  std::cout << "  loop       " << scheduling["policy"].get<std::string>() << ", memory "
            << (scheduling["memory_locked"].get<bool>() ? "locked" : "not locked") << ", "
            << side["missed"] << " deadlines missed\n"
            << "  lateness   " << Durations(side["lateness_us"]) << "\n"
            << std::flush;
  PrintHistogram(side["lateness_us"]);
  std::cout << "  work       " << Durations(side["duration_us"]) << "\n";
}

// Local bodies; a jump beyond a millimetre says that the copies do not know something.
void PrintCopies(const Json& reconciliation) {
  if (reconciliation["frames"] == 0) return;
  std::cout << "  copies     corrected by " << reconciliation["frames"] << " frames; newest jump "
            << Number(reconciliation["newest_jump_mm"].get<double>(), 4) << " mm, largest "
            << Number(reconciliation["largest_jump_mm"].get<double>(), 4) << " mm\n";
}

void PrintEnergy(const Json& energy) {
  const double injected_mj = energy["injected_j"].get<double>() * 1e3;
  std::cout << "  energy     the rendering has " << (injected_mj > 0 ? "given " : "absorbed ")
            << Number(std::abs(injected_mj), 3) << " mJ, the device dissipated "
            << Number(energy["dissipated_j"].get<double>() * 1e3, 3) << " mJ"
            << (energy["controller_acts"].get<bool>() ? "; the passivity controller brakes" : "")
            << "\n  contact    "
            << (energy["unstable"].get<bool>()
                    ? "UNSTABLE: it gives more energy than the device can dissipate"
                    : "no sign of instability")
            << ", flagged " << energy["times_flagged"] << " times since the start\n";
}

void PrintHaptic(const Json& haptic) {
  if (!haptic["attached"].get<bool>()) {
    std::cout << "HAPTIC  not there: " << haptic["why"].get<std::string>() << "\n";
    return;
  }
  PrintCommon("HAPTIC", haptic);
  if (haptic.contains("reason")) {
    std::cout << "  force      " << haptic["sentence"].get<std::string>() << "\n";
  }
  if (haptic.contains("newest")) {
    for (const Json& pointer : haptic["newest"]["pointers"]) {
      std::cout << "  pointer " << pointer["pointer"] << "  at "
                << Vector3(pointer["position_m"], 1e3, 2) << " mm, moving "
                << Vector3(pointer["velocity_m_per_s"], 1e3, 1) << " mm/s, force "
                << Vector3(pointer["force_n"], 1, 3) << " N\n";
    }
    const Json& newest = haptic["newest"];
    std::cout << "  channels   " << newest["channels"].size() << " in use; displays frame "
              << newest["world_frame"] << " of world epoch " << newest["world_epoch"] << "\n";
  }
  if (!haptic.contains("reason")) return;
  std::cout << "  target     " << Vector3(haptic["target_m"], 1e3, 2) << " mm, device "
            << haptic["device"].get<std::string>() << "\n"
            << "  world      " << haptic["peer"]["state"].get<std::string>() << ", epoch "
            << haptic["peer"]["epoch"] << ", newest frame "
            << Number(haptic["peer"]["feature_age_ms"], 1) << " ms old\n";
  PrintEnergy(haptic["energy"]);
  PrintCopies(haptic["reconciliation"]);
  PrintLoop(haptic);
  std::cout << "  faults     " << haptic["page_faults"]["minor"] << " minor, "
            << haptic["page_faults"]["major"] << " major; largest force "
            << Number(haptic["largest_force_n"], 3) << " N, largest step "
            << Number(haptic["largest_force_step_n"], 4) << " N\n";
}

void PrintBooks(const Json& books) {
  if (books.is_null()) return;
  std::cout << "BOOKS   " << (books["balanced"].get<bool>() ? "balanced" : "NOT BALANCED")
            << " (N s)\n";
  const double unit = books["unit_ns"];
  for (const char* name :
       {"displayed", "covered", "applied", "discarded", "peer_lost", "pending", "ground"}) {
    std::cout << "  " << name << std::string(11 - std::string(name).size(), ' ')
              << Vector3(books[name], unit, 12) << "\n";
  }
}

void PrintWorld(const Json& world) {
  if (!world["attached"].get<bool>()) {
    std::cout << "WORLD   not there: " << world["why"].get<std::string>() << "\n";
    return;
  }
  PrintCommon("WORLD ", world);
  if (world.contains("scene")) {
    std::cout << "  scene      " << world["scene"].get<std::string>() << ", coupling "
              << world["coupling"].get<std::string>() << ", " << world["moving_bodies"]
              << " bodies can move\n"
              << "  haptic     " << world["peer"]["state"].get<std::string>() << ", epoch "
              << world["peer"]["epoch"] << ", " << world["lapped"] << " ticks lapped\n";
    for (const auto& [reason, units] : world["discarded"].items()) {
      if (units == Json::array({0, 0, 0})) continue;
      std::cout << "  discarded  " << Vector3(units, kImpulseUnit, 12) << " N s: " << reason
                << "\n";
    }
    PrintLoop(world);
  }
  if (world.contains("newest")) {
    const Json& newest = world["newest"];
    std::cout << "  frame      " << newest["frame"] << ", " << newest["planes"] << " planes, "
              << Number(newest["age_ms"], 1) << " ms old, includes tick " << newest["acked_tick"]
              << " of haptic epoch " << newest["acked_epoch"] << "\n";
  }
  std::size_t shown = 0;
  for (const Json& body : world["bodies"]) {
    if (++shown > kMostBodiesShown) {
      std::cout << "  ... and " << world["bodies"].size() - kMostBodiesShown << " more bodies\n";
      break;
    }
    const double mass = body["mass_kg"];
    std::cout << "  body " << body["body"] << "." << body["generation"];
    if (!body["name"].is_null()) std::cout << " " << body["name"].get<std::string>();
    std::cout << "   at " << Vector3(body["position_m"], 1e3, 2) << " mm, moving "
              << Vector3(body["velocity_m_per_s"], 1e3, 1) << " mm/s, "
              << (mass > 0 ? Number(mass, 4) + " kg" : "fixed") << "\n";
  }
}

void Print(const Json& report, const Options& options) {
  if (options.json) {
    std::cout << report.dump() << "\n" << std::flush;
    return;
  }
  if (isatty(STDOUT_FILENO) != 0 && !options.once)
    std::cout << "\x1b[H\x1b[J";  // over the last report
  PrintHaptic(report["haptic"]);
  PrintWorld(report["world"]);
  PrintBooks(report["books"]);
  std::cout << std::endl;
}

void Sleep(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

int Run(const Options& options) {
  try {
    Observer observer(options.instance);
    Json report = observer.Read();
    if (!observer.found()) {
      std::fprintf(stderr, "haptic_status: neither daemon runs as instance '%s': %s\n",
                   options.instance.c_str(), observer.absence().c_str());
      return kExitFault;
    }
    if (options.once) {
      Sleep(kRateSampleSeconds);
      report = observer.Read();
      Print(report, options);
      return kExitOk;
    }
    for (;; report = observer.Read()) {
      Print(report, options);
      if (!std::cout) return kExitOk;  // the reader of a pipe went away
      Sleep(options.interval_s);
    }
  } catch (const SegmentError& error) {
    throw StartError(error.exit_code(), error.what());
  }
}

}  // namespace
}  // namespace rikiseki::protocol

int main(int argc, char** argv) {
  return rikiseki::RunProgram("haptic_status", [&] {
    return rikiseki::protocol::Run(rikiseki::protocol::Parse(argc, argv));
  });
}

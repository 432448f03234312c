// SPDX-License-Identifier: MIT
// haptic_status: what both daemons are doing, and above all why the force is what it is. An
// observer: it maps both segments read-only and disturbs nobody.
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <iostream>
#include <thread>
#include <utility>
#include <vector>

#include "common/command_line.h"
#include "common/daemon.h"
#include "common/exit_code.h"
#include "protocol/tools/observer.h"
#include "protocol/tools/screen.h"
#include "protocol/tools/status_text.h"

namespace rikiseki::protocol {
namespace {

namespace po = boost::program_options;
using Json = nlohmann::ordered_json;

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

// A live view on a terminal: over the last picture, with all that has room.
void Draw(const Json& report) {
  const ScreenSize size = SizeOfTerminal(STDOUT_FILENO);
  std::vector<std::string> lines = Wrapped(StatusText(report, StatusDetail::kFull), size.columns);
  if (lines.size() >= static_cast<std::size_t>(size.rows)) {
    lines = Wrapped(StatusText(report, StatusDetail::kBrief), size.columns);
  }
  std::cout << Drawn(std::move(lines), size) << std::flush;
}

void Print(const Json& report, const Options& options) {
  if (options.json) {
    std::cout << report.dump() << "\n" << std::flush;
  } else if (isatty(STDOUT_FILENO) != 0 && !options.once) {
    Draw(report);
  } else {
    std::cout << StatusText(report, StatusDetail::kFull) << std::endl;
  }
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

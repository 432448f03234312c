// SPDX-License-Identifier: MIT
// What the two daemons' mains share: command line, signals, one-line errors with their exit status.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace rikiseki {

struct DaemonOptions {
  std::string config;            // required
  std::vector<std::string> set;  // section.key=value
  std::string instance = "0";    // which pair: names the segments
  bool check = false;
  std::vector<std::string> extra;  // values of the daemon's own options, in the order declared
};

/// One option that only this daemon has, e.g. {"device", "simulated|usb|replay"}. Without a name for its
/// value it is a switch, whose value is "on" if it was given.
struct ExtraOption {
  std::string name;
  std::string value_name;
  std::string doc;
  std::string implicit = {};  // what the option alone, without a value, means; empty: it needs one
};

/// Parses the command line. Prints --help and --version itself and exits 0. Throws StartError (64).
DaemonOptions ParseDaemonOptions(int argc, char** argv, const std::string& program,
                                 const std::string& purpose, const std::vector<ExtraOption>& extra);

/// Runs `body` and turns what it throws into one line on stderr and the exit status that tells it.
int RunProgram(const std::string& program, const std::function<int()>& body);

/// Sends SIGINT, SIGTERM and SIGHUP to WaitForSignal instead of to handlers. Call before any thread.
void BlockSignals();

/// Waits at most `milliseconds` for one of them; 0 if none came.
int WaitForSignal(int milliseconds);

}  // namespace rikiseki

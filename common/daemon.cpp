// SPDX-License-Identifier: MIT
#include "common/daemon.h"

#include <signal.h>

#include <cctype>
#include <cstdio>

#include "common/command_line.h"
#include "common/exit_code.h"

namespace rikiseki {
namespace po = boost::program_options;
namespace {

sigset_t WatchedSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, signal);
  return signals;
}

}  // namespace

DaemonOptions ParseDaemonOptions(int argc, char** argv, const std::string& program,
                                 const std::string& purpose,
                                 const std::vector<ExtraOption>& extra) {
  DaemonOptions options;
  options.extra.resize(extra.size());
  CommandLine line{.program = program,
                   .visible = po::options_description(program + ": " + purpose)};
  line.visible.add_options()("config", po::value(&options.config)->value_name("FILE"),
                             "settings; every key is explained there")(
      "set", po::value(&options.set)->value_name("section.key=value")->composing(),
      "overrides one setting; may be repeated")("instance",
                                                po::value(&options.instance)->value_name("NAME"),
                                                "which pair of daemons (default 0)")(
      "check", po::bool_switch(&options.check),
      "validates the settings, prints them and what would run");
  for (std::size_t i = 0; i < extra.size(); ++i) {
    if (extra[i].value_name.empty()) {
      const auto set = [&options, i](bool is_on) { options.extra[i] = is_on ? "on" : ""; };
      line.visible.add_options()(extra[i].name.c_str(), po::bool_switch()->notifier(set),
                                 extra[i].doc.c_str());
      continue;
    }
    auto* const value = po::value(&options.extra[i])->value_name(extra[i].value_name);
    if (!extra[i].implicit.empty()) value->implicit_value(extra[i].implicit);
    line.visible.add_options()(extra[i].name.c_str(), value, extra[i].doc.c_str());
  }
  ParseCommandLine(argc, argv, line);
  if (options.config.empty()) throw StartError(kExitUsage, "--config FILE is required; try --help");
  for (const char c : options.instance) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '_' && c != '-') {
      throw StartError(kExitUsage,
                       "--instance " + options.instance + ": letters, digits, _ and - only");
    }
  }
  if (options.instance.empty() || options.instance.size() > 64) {
    throw StartError(kExitUsage, "--instance: 1 to 64 characters");
  }
  return options;
}

int RunProgram(const std::string& program, const std::function<int()>& body) {
  try {
    return body();
  } catch (const StartError& error) {
    std::fprintf(stderr, "%s: %s\n", program.c_str(), error.what());
    return error.exit_code();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", program.c_str(), error.what());
    return kExitFault;
  }
}

void BlockSignals() {
  const sigset_t signals = WatchedSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

int WaitForSignal(int milliseconds) {
  const sigset_t signals = WatchedSignals();
  const timespec timeout{.tv_sec = milliseconds / 1000,
                         .tv_nsec = (milliseconds % 1000) * 1'000'000L};
  const int signal = sigtimedwait(&signals, nullptr, &timeout);
  return signal > 0 ? signal : 0;
}

}  // namespace rikiseki

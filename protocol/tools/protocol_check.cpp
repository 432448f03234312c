// SPDX-License-Identifier: MIT
// protocol_check: the conformance kit. It takes the place of one side and judges whatever implements the
// other against SPEC.md, or looks at a live segment.
#include <algorithm>
#include <cstdio>
#include <iostream>

#include "common/command_line.h"
#include "common/daemon.h"
#include "common/exit_code.h"
#include "protocol/owner.h"
#include "protocol/tools/check/suite.h"
#include "protocol/version.h"

namespace rikiseki::protocol::check {
namespace {

namespace po = boost::program_options;

struct Options {
  std::string as;
  std::string inspect;
  std::vector<std::string> cases;
  std::string junit;
  double wait_s = 10;
  bool strict = false;
  bool list = false;
  PlayOptions play;
};

void ParseTarget(const std::string& text, PlayOptions& play) {
  char rest = 0;
  if (std::sscanf(text.c_str(), "%lf,%lf,%lf%c", &play.target[0], &play.target[1], &play.target[2],
                  &rest) != 3) {
    throw StartError(kExitUsage, "--target must be x,y,z in metres");
  }
  play.has_target = true;
}

Options Parse(int argc, char** argv) {
  Options options;
  std::string target;
  std::vector<std::string> words;
  CommandLine line{
      .program = "protocol_check",
      .visible = po::options_description(
          "protocol_check --as world | --as haptic | inspect NAME\n"
          "plays one side and judges whatever implements the other, or looks at the live segments "
          "of an instance")};
  line.visible.add_options()("as", po::value(&options.as)->value_name("SIDE"),
                             "play the world, or the haptic side")(
      "instance", po::value(&options.play.instance)->value_name("NAME"), "which pair (default 0)")(
      "case", po::value(&options.cases)->value_name("ID"),
      "only this case, or those under it; may be given often")(
      "strict", po::bool_switch(&options.strict), "a SHOULD that is not met fails too")(
      "junit", po::value(&options.junit)->value_name("FILE"), "writes the results as JUnit XML")(
      "target", po::value(&target)->value_name("X,Y,Z"),
      "where the box is, m (default: at the origin as haptic, brought to the finger as world)")(
      "wait", po::value(&options.wait_s)->value_name("SECONDS"),
      "for the other side to come (default 10)")("list", po::bool_switch(&options.list),
                                                 "prints the cases and their sentences");
  line.hidden.add_options()("words", po::value(&words), "");
  line.positional.add("words", -1);
  line.version_also =
      ", protocol " + std::to_string(kVersionMajor) + "." + std::to_string(kVersionMinor);
  ParseCommandLine(argc, argv, line);
  if (!words.empty()) {
    if (words.size() != 2 || words[0] != "inspect" || !options.as.empty()) {
      throw StartError(kExitUsage, "'" + words[0] + "' is not known; try --help");
    }
    options.inspect = words[1];
  }
  if (!target.empty()) ParseTarget(target, options.play);
  const bool has_side = options.as == "world" || options.as == "haptic";
  if (!has_side && !(options.as.empty() && (options.list || !options.inspect.empty()))) {
    throw StartError(kExitUsage, "say --as world, --as haptic or inspect NAME; try --help");
  }
  if (!(options.wait_s >= 0 && options.wait_s <= 3600)) {
    throw StartError(kExitUsage, "--wait must be from 0 to 3600 seconds");
  }
  return options;
}

void List(const std::string& as) {
  for (const std::string& id : CaseIds()) {
    // The kit as world judges the haptic side.
    const bool judges_haptic = id.starts_with("haptic/");
    if ((as == "world" && !judges_haptic) || (as == "haptic" && judges_haptic)) continue;
    std::cout << id << "\n    [" << NumberOf(id) << "] " << SentenceOf(NumberOf(id)) << "\n";
  }
}

int Run(const Options& options) {
  if (options.list) {
    List(options.as);
    return kExitOk;
  }
  for (const std::string& wanted : options.cases) {
    const auto ids = CaseIds();
    if (std::none_of(ids.begin(), ids.end(),
                     [&](const std::string& id) { return Selected(id, std::span(&wanted, 1)); })) {
      throw StartError(kExitUsage, "there is no case '" + wanted + "'; see --list");
    }
  }
  Reporter reporter(std::cout, options.strict);
  try {
    if (options.as == "world") {
      JudgeHaptic(options.play, options.cases, options.wait_s, reporter);
    } else if (options.as == "haptic") {
      JudgeWorld(options.play, options.cases, options.wait_s, reporter);
    } else {
      InspectBoth(options.inspect, options.cases, reporter);
    }
  } catch (const SegmentError& error) {
    reporter.Summary();
    throw StartError(error.exit_code(), error.what());
  }
  reporter.Summary();
  if (!options.junit.empty()) {
    const std::string judged = options.as == "world"    ? "haptic side"
                               : options.as == "haptic" ? "world side"
                                                        : "segments of " + options.inspect;
    reporter.WriteJunit(options.junit, "protocol_check: " + judged);
  }
  return reporter.ExitStatus();
}

}  // namespace
}  // namespace rikiseki::protocol::check

int main(int argc, char** argv) {
  return rikiseki::RunProgram("protocol_check", [&] {
    return rikiseki::protocol::check::Run(rikiseki::protocol::check::Parse(argc, argv));
  });
}

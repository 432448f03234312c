// SPDX-License-Identifier: MIT
// What the command lines of all our programs have in common: --help, --version, and how wrong words end.
#pragma once

#include <boost/program_options.hpp>
#include <functional>
#include <string>

namespace rikiseki {

struct CommandLine {
  std::string program;
  boost::program_options::options_description visible;  // what --help prints
  boost::program_options::options_description hidden = {};
  /// Where words without a -- go; by default they are refused, not skipped.
  boost::program_options::positional_options_description positional = {};
  std::string version_also = {};               // behind what --version prints
  std::function<void()> print_help = nullptr;  // instead of `visible`
};

/// Adds --version and --help to the visible options and fills the values that the options point to.
/// Answers those two itself and exits 0. Throws StartError (64).
boost::program_options::variables_map ParseCommandLine(int argc, char** argv, CommandLine& line);

}  // namespace rikiseki

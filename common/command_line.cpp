// SPDX-License-Identifier: MIT
#include "common/command_line.h"

#include <cstdlib>
#include <iostream>

#include "common/exit_code.h"
#include "common/version.h"

namespace rikiseki {
namespace po = boost::program_options;

po::variables_map ParseCommandLine(int argc, char** argv, CommandLine& line) {
  line.visible.add_options()("version", "prints the version")("help", "prints this");
  po::options_description all;
  all.add(line.visible).add(line.hidden);
  po::variables_map values;
  try {
    po::store(po::command_line_parser(argc, argv).options(all).positional(line.positional).run(),
              values);
    po::notify(values);
  } catch (const po::error& error) {
    throw StartError(kExitUsage, std::string(error.what()) + "; try --help");
  }
  if (values.count("help") != 0) {
    if (line.print_help) {
      line.print_help();
    } else {
      std::cout << line.visible;
    }
    std::exit(kExitOk);
  }
  if (values.count("version") != 0) {
    std::cout << line.program << " " << kVersion << " (" << kBuild << ")" << line.version_also
              << "\n";
    std::exit(kExitOk);
  }
  return values;
}

}  // namespace rikiseki

// SPDX-License-Identifier: MIT
// world_viewer: serves a live picture of a running pair to browsers. An observer: it maps both
// segments read-only and disturbs nobody.
#include <sys/resource.h>

#include <boost/asio/signal_set.hpp>
#include <cstdio>

#include "common/command_line.h"
#include "common/daemon.h"
#include "common/exit_code.h"
#include "world_server/viewer/server.h"

namespace rikiseki::viewer {
namespace {

namespace po = boost::program_options;

constexpr int kNiceness = 5;  // where processors are short, the pair comes first

struct Options {
  std::string instance = "0";
  std::string address = "127.0.0.1";
  std::uint16_t port = 8037;
};

Options Parse(int argc, char** argv) {
  Options options;
  CommandLine line{.program = "world_viewer",
                   .visible = po::options_description(
                       "world_viewer: shows a running pair in the browser, read-only")};
  line.visible.add_options()("instance", po::value(&options.instance)->value_name("NAME"),
                             "which pair of daemons (default 0)")(
      "port", po::value(&options.port)->value_name("N"), "0 takes a free one (default 8037)")(
      "address", po::value(&options.address)->value_name("IP"),
      "where to listen (default 127.0.0.1: this machine only; whoever can reach it can look on)");
  ParseCommandLine(argc, argv, line);
  return options;
}

int Run(const Options& options) {
  setpriority(PRIO_PROCESS, 0, kNiceness);
  try {
    PairWatch watch(options.instance);
    Server server(watch, options.address, options.port);
    boost::asio::signal_set stop(server.context(), SIGINT, SIGTERM);
    stop.async_wait([&server](const boost::system::error_code& error, int) {
      if (!error) server.context().stop();
    });
    const bool bracketed = options.address.find(':') != std::string::npos;
    std::printf("http://%s%s%s:%d/\n", bracketed ? "[" : "", options.address.c_str(),
                bracketed ? "]" : "", server.port());
    std::fflush(stdout);
    server.Run();
    return kExitOk;
  } catch (const protocol::SegmentError& error) {
    throw StartError(error.exit_code(), error.what());
  }
}

}  // namespace
}  // namespace rikiseki::viewer

int main(int argc, char** argv) {
  return rikiseki::RunProgram(
      "world_viewer", [&] { return rikiseki::viewer::Run(rikiseki::viewer::Parse(argc, argv)); });
}

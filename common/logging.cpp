// SPDX-License-Identifier: MIT
#include "common/logging.h"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>

namespace rikiseki {
namespace {

// systemd.exec(5): the variable names the device and inode of the journal's end of stderr.
bool StderrIsJournal() {
  const char* stream = std::getenv("JOURNAL_STREAM");
  struct stat status {};
  if (stream == nullptr || fstat(STDERR_FILENO, &status) != 0) return false;
  return stream == std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino);
}

}  // namespace

void StartLogging(const std::string& program) {
  if (StderrIsJournal()) {
    // The journal keeps time, program and level by itself.
    auto sink = std::make_shared<spdlog::sinks::systemd_sink_mt>(program);
    spdlog::set_default_logger(std::make_shared<spdlog::logger>(program, std::move(sink)));
    return;
  }
  spdlog::set_default_logger(spdlog::stderr_logger_mt(program));
  spdlog::set_pattern("%Y-%m-%d %H:%M:%S.%e %n %l: %v");
  spdlog::flush_on(spdlog::level::info);
}

}  // namespace rikiseki

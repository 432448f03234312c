// SPDX-License-Identifier: MIT
#include "common/daemon.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <functional>
#include <iostream>
#include <new>

#include "common/exit_code.h"
#include "common/version.h"

namespace rikiseki {
namespace {

DaemonOptions Parse(std::vector<std::string> words) {
  words.insert(words.begin(), "a_server");
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  return ParseDaemonOptions(
      static_cast<int>(words.size()), argv.data(), "a_server", "serves",
      {{"device", "simulated|usb", "which device"}, {"scene", "FILE", "what"}});
}

std::string UsageError(const std::vector<std::string>& words) {
  try {
    Parse(words);
  } catch (const StartError& error) {
    CHECK(error.exit_code() == 64);
    return error.what();
  }
  FAIL("nothing was refused");
  return "";
}

struct Ended {
  int exit_code = -1;
  std::string output;  // of the given stream
};

// Runs `body` in a child and gathers what it writes to `stream` (1 or 2).
Ended InChild(int stream, const std::function<int()>& body) {
  std::array<int, 2> ends{};
  REQUIRE(pipe(ends.data()) == 0);
  std::cout.flush();  // what Catch has said is not the child's
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    dup2(ends[1], stream);
    close(ends[0]);
    close(ends[1]);
    std::exit(body());
  }
  close(ends[1]);
  Ended ended;
  std::array<char, 4096> buffer{};
  for (ssize_t got = 0; (got = read(ends[0], buffer.data(), buffer.size())) > 0;) {
    ended.output.append(buffer.data(), static_cast<std::size_t>(got));
  }
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (WIFEXITED(status)) ended.exit_code = WEXITSTATUS(status);
  return ended;
}

}  // namespace

TEST_CASE("the command line of a daemon") {
  const DaemonOptions options =
      Parse({"--config", "a.ini", "--set", "a.b=1", "--device", "usb", "--set=c.d=2", "--check"});
  CHECK(options.config == "a.ini");
  CHECK(options.set == std::vector<std::string>{"a.b=1", "c.d=2"});
  CHECK(options.instance == "0");
  CHECK(options.check);
  CHECK(options.extra == std::vector<std::string>{"usb", ""});

  const DaemonOptions plain = Parse({"--config=a.ini", "--instance", "left-hand_2"});
  CHECK(plain.set.empty());
  CHECK_FALSE(plain.check);
  CHECK(plain.instance == "left-hand_2");
}

TEST_CASE("a wrong command line is refused with exit status 64") {
  CHECK(UsageError({}).find("--config") != std::string::npos);
  CHECK(UsageError({"--config", "a.ini", "--devise", "usb"}).find("devise") != std::string::npos);
  CHECK(UsageError({"--config"}).find("--help") != std::string::npos);
  CHECK(UsageError({"--config", "a.ini", "stray"}).find("--help") != std::string::npos);
  for (const std::string name : {"a/b", "a.b", "a b", "\xC3\xA9", "..", ""}) {
    CAPTURE(name);
    CHECK(UsageError({"--config", "a.ini", "--instance=" + name}).find("instance") !=
          std::string::npos);
  }
  CHECK(Parse({"--config", "a.ini", "--instance", std::string(64, 'a')}).instance.size() == 64);
  CHECK(UsageError({"--config", "a.ini", "--instance", std::string(65, 'a')}).find("64") !=
        std::string::npos);
}

TEST_CASE("help and version need nothing else and exit 0") {
  const Ended help = InChild(STDOUT_FILENO, [] { return Parse({"--help"}), 99; });
  CHECK(help.exit_code == 0);
  for (const std::string word : {"--config", "--set", "--instance", "--check", "--version",
                                 "--device", "which device", "serves"}) {
    CAPTURE(word);
    CHECK(help.output.find(word) != std::string::npos);
  }
  const Ended version = InChild(STDOUT_FILENO, [] { return Parse({"--version"}), 99; });
  CHECK(version.exit_code == 0);
  CHECK(version.exit_code == 0);
  CHECK_THAT(version.output, Catch::StartsWith(std::string("a_server ") + kVersion + " ("));
}

TEST_CASE("a program ends with the exit status of its reason and one line that says it") {
  const auto run = [](const std::function<int()>& body) {
    return InChild(STDERR_FILENO, [&] { return RunProgram("prog", body); });
  };
  const Ended config = run([]() -> int { throw StartError(kExitConfig, "a.ini:3: wrong"); });
  CHECK(config.exit_code == 78);
  CHECK(config.output == "prog: a.ini:3: wrong\n");
  const Ended busy = run([]() -> int { throw StartError(kExitTemporary, "held"); });
  CHECK(busy.exit_code == 75);
  const Ended fault = run([]() -> int { throw std::bad_alloc(); });
  CHECK(fault.exit_code == 1);
  CHECK(fault.output.starts_with("prog: "));
  const Ended fine = run([] { return 7; });
  CHECK(fine.exit_code == 7);
  CHECK(fine.output.empty());
}

TEST_CASE("blocked signals are waited for, one at a time") {
  const Ended ended = InChild(STDOUT_FILENO, [] {
    BlockSignals();
    if (WaitForSignal(1) != 0) return 1;
    raise(SIGHUP);
    if (WaitForSignal(1000) != SIGHUP) return 2;
    raise(SIGTERM);
    if (WaitForSignal(1000) != SIGTERM) return 3;
    raise(SIGINT);
    if (WaitForSignal(1000) != SIGINT) return 4;
    return WaitForSignal(0) == 0 ? 42 : 5;
  });
  CHECK(ended.exit_code == 42);
}

}  // namespace rikiseki

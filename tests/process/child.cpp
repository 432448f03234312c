// SPDX-License-Identifier: MIT
#include "tests/process/child.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>
#include <thread>

namespace rikiseki::test {

Child::Child(const std::vector<std::string>& arguments) {
  std::string path = (std::filesystem::temp_directory_path() / "rikiseki-test-XXXXXX").string();
  const int file = mkstemp(path.data());
  if (file < 0) throw std::system_error(errno, std::generic_category(), "mkstemp");
  stderr_path_ = path;

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, file, STDERR_FILENO);
  posix_spawn_file_actions_addclose(&actions, file);
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  const int error = posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(file);
  if (error != 0) throw std::system_error(error, std::generic_category(), arguments[0]);
}

Child::~Child() {
  if (!ended_) {
    Signal(SIGKILL);
    Wait();
  }
  std::filesystem::remove(stderr_path_);
}

void Child::Signal(int signal) const {
  if (!ended_) kill(pid_, signal);
}

void Child::Freeze() const {
  if (ended_) return;
  Signal(SIGSTOP);
  siginfo_t info{};
  waitid(P_PID, static_cast<id_t>(pid_), &info, WSTOPPED | WEXITED | WNOWAIT);
}

bool Child::IsRunning() {
  if (ended_) return false;
  if (waitpid(pid_, &status_, WNOHANG) != pid_) return true;
  ended_ = true;
  return false;
}

int Child::Wait(double seconds) {
  const auto limit = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (IsRunning()) {
    if (std::chrono::steady_clock::now() > limit) {
      Signal(SIGKILL);
      waitpid(pid_, &status_, 0);
      ended_ = true;
      break;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_);
}

std::string Child::Stderr() const {
  std::ifstream file(stderr_path_);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

Usage UsageOf(pid_t process) {
  Usage usage;
  const std::string folder = "/proc/" + std::to_string(process);
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder + "/fd")) {
    ++usage.descriptors;
  }
  std::ifstream maps(folder + "/maps");
  for (std::string line; std::getline(maps, line);) {
    ++usage.mappings;
    if (line.find("/dev/shm/rikiseki.") != std::string::npos) ++usage.segments;
  }
  std::ifstream status(folder + "/status");
  for (std::string word; status >> word;) {
    if (word == "VmRSS:") status >> usage.resident_kib;
    if (word == "Threads:") status >> usage.threads;
  }
  return usage;
}

std::string Program(const std::string& name) {
  return std::string(RIKISEKI_BIN_DIR) + "/" + name;
}

std::string SourceFile(const std::string& path) {
  return std::string(RIKISEKI_SOURCE_DIR) + "/" + path;
}

Instance::Instance() {
  static std::atomic<int> next{0};
  name_ = "test-" + std::to_string(getpid()) + "-" + std::to_string(next++);
}

Instance::~Instance() {
  for (const char* role : {".haptic", ".world"}) shm_unlink(("/rikiseki." + name_ + role).c_str());
}

}  // namespace rikiseki::test

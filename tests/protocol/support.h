// SPDX-License-Identifier: MIT
// What the protocol tests share: random sound messages, private segment names, children to kill.
#pragma once

#include <sys/types.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <string>

#include "protocol/messages.h"
#include "protocol/owner.h"

namespace rikiseki::protocol::test {

/// An instance name that is different in every test case and every process, so that suites run in
/// parallel.
std::string FreshInstance();

/// A folder for lock files that goes away with the object.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// A haptic segment whose ticks have 16 slots.
OwnerOptions HapticOptions(const std::string& instance, const std::string& runtime_directory);

/// Runs `body` in a forked child, which ends when it returns. The child has no Catch2.
pid_t Fork(const std::function<void()>& body);
/// Waits for the end of a child; its wait status.
int Reap(pid_t child);

/// Polls every millisecond until `condition` or `seconds` passed; whether it came true.
bool Eventually(const std::function<bool()>& condition, double seconds = 10);

/// Sound random messages. Entries beyond the counts are default, as Decode leaves them.
class Generator {
 public:
  explicit Generator(std::uint64_t seed) : engine_(seed) {}

  std::uint64_t Integer(std::uint64_t limit) {
    return std::uniform_int_distribution<std::uint64_t>(0, limit)(engine_);
  }
  std::uint32_t Small(std::uint32_t limit) { return static_cast<std::uint32_t>(Integer(limit)); }
  double Real() { return std::uniform_real_distribution<double>(-10, 10)(engine_); }
  double Positive() { return std::abs(Real()); }
  Vector Triple() { return {Real(), Real(), Real()}; }
  ImpulseUnits Units() {
    const auto one = [this] { return static_cast<std::int64_t>(engine_()); };
    return {one(), one(), one()};
  }
  Vector Direction();
  Quaternion Orientation();

  HapticTick Tick();
  HapticHealth Haptic();
  WorldFrame Frame();
  WorldHealth World();
  Body OneBody();
  LocalBody OneLocalBody(std::uint32_t body);
  WorldScene Scene();

 private:
  std::mt19937_64 engine_;
};

/// A tick whose every part follows from its number, so that a torn one shows.
HapticTick Numbered(std::uint64_t number);
bool IsNumbered(const HapticTick& tick);

}  // namespace rikiseki::protocol::test

// SPDX-License-Identifier: MIT
// Freezes what this build writes: `protocol_fixtures layout` prints protocol/layout.golden.txt,
// `protocol_fixtures segments FOLDER` writes haptic-MAJOR.MINOR.bin and world-MAJOR.MINOR.bin,
// whole segments as a reader finds them. Run by hand once per version; the files of older versions
// stay.
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "protocol/layout.h"
#include "protocol/owner.h"
#include "protocol/stream.h"
#include "protocol/version.h"
#include "tests/protocol/fixtures.h"
#include "tests/protocol/support.h"

namespace rikiseki::protocol::test {
namespace {

/// The bytes of a living segment, with what differs from run to run replaced by constants.
std::vector<char> Frozen(const SegmentOwner& owner) {
  const int descriptor = shm_open(owner.name().c_str(), O_RDONLY, 0);
  std::vector<char> bytes(static_cast<std::size_t>(lseek(descriptor, 0, SEEK_END)));
  if (pread(descriptor, bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw std::runtime_error("cannot read back " + owner.name());
  }
  close(descriptor);
  SegmentHeader header;
  std::memcpy(&header, bytes.data(), sizeof header);
  header.epoch = 1'000'000'007;
  header.writer_pid = 4711;
  header.heartbeat_ns = 1'000'000'011;
  std::memcpy(bytes.data(), &header, sizeof header);
  return bytes;
}

void Save(const std::string& folder, const std::string& role, const std::vector<char>& bytes) {
  const std::string path = folder + "/" + role + "-" + std::to_string(kVersionMajor) + "." +
                           std::to_string(kVersionMinor) + ".bin";
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  std::printf("%s: %zu bytes\n", path.c_str(), bytes.size());
}

OwnerOptions Options(Role role, const TemporaryFolder& folder, std::vector<StreamSpec> streams) {
  return {.instance = FreshInstance(),
          .role = role,
          .streams = std::move(streams),
          .build = "fixture",
          .runtime_directory = folder.path()};
}

constexpr std::uint64_t kStampNs = 1'000'000'009;

void WriteSegments(const std::string& folder) {
  const TemporaryFolder locks;
  SegmentOwner haptic(Options(Role::kHaptic, locks, HapticStreams(1'000'000, 4, 100'000'000)));
  haptic.Writer<HapticTick>().Publish(FixtureTick(), kStampNs);
  haptic.Writer<HapticHealth>().Publish(FixtureHapticHealth(), kStampNs);
  Save(folder, "haptic", Frozen(haptic));

  // Just as much room as is used: the files are kept for ever.
  SegmentOwner world(
      Options(Role::kWorld, locks,
              {{StreamType::kWorldFrame, kWorldFrameBytes, kMinSlots, 50'000'000},
               {StreamType::kWorldHealth, kWorldHealthBytes, kMinSlots, 100'000'000},
               {StreamType::kWorldBodies, WorldBodiesBytes(2), kMinSlots, 50'000'000},
               {StreamType::kWorldScene, WorldSceneBytes(3, 3, 1), kMinSlots, 0}}));
  world.Writer<WorldFrame>().Publish(FixtureFrame(), kStampNs);
  world.Writer<WorldHealth>().Publish(FixtureWorldHealth(), kStampNs);
  BodiesWriter(world.Stream(StreamType::kWorldBodies)).Publish(FixtureBodies(), kStampNs);
  SceneWriter(world.Stream(StreamType::kWorldScene)).Publish(FixtureScene(), kStampNs);
  Save(folder, "world", Frozen(world));
}

}  // namespace
}  // namespace rikiseki::protocol::test

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  if (what == "layout" && argc == 2) {
    const auto print = [](char character) { std::putchar(character); };
    rikiseki::protocol::WriteLayout(print);
    return 0;
  }
  if (what == "segments" && argc == 3) {
    rikiseki::protocol::test::WriteSegments(argv[2]);
    return 0;
  }
  std::fputs("usage: protocol_fixtures layout | segments FOLDER\n", stderr);
  return 64;
}

// SPDX-License-Identifier: MIT
// fuzz_seeds FOLDER: writes FOLDER/decode and FOLDER/segment, one sound input of every kind, as the
// targets expect them. Run by hand when the layout changes; fuzzing adds the rest of the corpus.
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include "protocol/owner.h"
#include "protocol/stream.h"
#include "tests/protocol/fixtures.h"
#include "tests/protocol/support.h"

namespace rikiseki::protocol::test {
namespace {

template <typename Message>
void SeedDecode(const std::string& folder, const std::string& name, std::uint32_t kind,
                const Message& message) {
  std::vector<std::uint64_t> words(2000);
  const Encoded encoded = Encode(message, words);
  const std::uint32_t head[4] = {kind, encoded.blocks, encoded.used_bytes, 0};
  std::ofstream file(folder + "/decode/" + name, std::ios::binary);
  file.write(reinterpret_cast<const char*>(head), sizeof head);
  file.write(reinterpret_cast<const char*>(words.data()), encoded.used_bytes);
}

void SeedSegment(const std::string& folder, const std::string& name, const SegmentOwner& owner) {
  const int descriptor = shm_open(owner.name().c_str(), O_RDONLY, 0);
  std::vector<char> bytes(static_cast<std::size_t>(lseek(descriptor, 0, SEEK_END)));
  if (pread(descriptor, bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw std::runtime_error("cannot read back " + owner.name());
  }
  close(descriptor);
  std::ofstream file(folder + "/segment/" + name, std::ios::binary);
  file.put(1);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

void SeedSegments(const std::string& folder) {
  const TemporaryFolder locks;
  const auto options = [&](Role role, std::vector<StreamSpec> streams) {
    return OwnerOptions{.instance = FreshInstance(),
                        .role = role,
                        .streams = std::move(streams),
                        .build = "seed",
                        .runtime_directory = locks.path()};
  };
  HapticTick tick;  // small, so that a change hits something
  tick.period_ns = 1'000'000;
  tick.pointer_count = 1;
  SegmentOwner haptic(options(Role::kHaptic, {{StreamType::kHapticTick, 352, 4, 1'000'000}}));
  auto ticks = haptic.Writer<HapticTick>();
  for (tick.tick = 0; tick.tick < 6; ++tick.tick) ticks.Publish(tick, 1000 + tick.tick);
  SeedSegment(folder, "haptic", haptic);

  WorldFrame frame;
  frame.frame = 1;
  frame.period_ns = 50'000'000;
  frame.plane_count = 1;
  frame.planes[0].normal = {0, 0, 1};
  frame.planes[0].recovery_s = 1;
  frame.planes[0].inverse_mass = 0;
  WorldScene scene;
  scene.revision = 1;
  SegmentOwner world(options(Role::kWorld, {{StreamType::kWorldFrame, 352, 4, 50'000'000},
                                            {StreamType::kWorldBodies, WorldBodiesBytes(1), 4, 0},
                                            {StreamType::kWorldScene, 224, 4, 0}}));
  world.Writer<WorldFrame>().Publish(frame, 1000);
  SceneWriter(world.Stream(StreamType::kWorldScene)).Publish(scene, 1000);
  BodiesWriter(world.Stream(StreamType::kWorldBodies)).Publish(std::vector<Body>(1), 1000);
  SeedSegment(folder, "world", world);
}

void WriteSeeds(const std::string& folder) {
  std::filesystem::create_directories(folder + "/decode");
  std::filesystem::create_directories(folder + "/segment");
  SeedDecode(folder, "tick", 0, FixtureTick());
  SeedDecode(folder, "frame", 1, FixtureFrame());
  SeedDecode(folder, "haptic_health", 2, FixtureHapticHealth());
  SeedDecode(folder, "world_health", 3, FixtureWorldHealth());
  SeedDecode(folder, "bodies", 4, std::span<const Body>(FixtureBodies()));
  SeedDecode(folder, "scene", 5, FixtureScene());
  SeedSegments(folder);
}

}  // namespace
}  // namespace rikiseki::protocol::test

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: fuzz_seeds FOLDER\n", stderr);
    return 64;
  }
  rikiseki::protocol::test::WriteSeeds(argv[1]);
  return 0;
}

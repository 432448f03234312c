// SPDX-License-Identifier: MIT
// The frozen segments of every version, tests/data/protocol: those of major 1 attach and
// decode, those from before are refused with the field that differs. SPEC.md 8.2.
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <fstream>
#include <iterator>

#include "protocol/attach.h"
#include "protocol/stream.h"
#include "tests/protocol/fixtures.h"
#include "tests/protocol/support.h"

namespace rikiseki::protocol {
namespace {

/// A file of tests/data/protocol as a shared-memory object whose owner lives.
class Thawed {
 public:
  Thawed(const std::string& file, Role role) : instance_(test::FreshInstance()) {
    name_ = SegmentName(instance_, role);
    std::ifstream stream(RIKISEKI_SOURCE_DIR "/tests/data/protocol/" + file, std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(stream)),
                            std::istreambuf_iterator<char>());
    REQUIRE(bytes.size() >= kHeaderBytes);
    descriptor_ = shm_open(name_.c_str(), O_RDWR | O_CREAT | O_EXCL, 0640);
    REQUIRE(descriptor_ >= 0);
    REQUIRE(write(descriptor_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()));
    struct flock lock {};
    lock.l_type = F_WRLCK;
    lock.l_whence = SEEK_SET;
    lock.l_len = 1;
    REQUIRE(fcntl(descriptor_, F_OFD_SETLK, &lock) == 0);
  }
  ~Thawed() {
    close(descriptor_);
    shm_unlink(name_.c_str());
  }
  Thawed(const Thawed&) = delete;
  Thawed& operator=(const Thawed&) = delete;

  const std::string& instance() const { return instance_; }

 private:
  std::string instance_;
  std::string name_;
  int descriptor_ = -1;
};

AttachResult AttachTo(const Thawed& segment, Role role) {
  AttachRequest request;
  request.instance = segment.instance();
  request.role = role;
  return Attach(request);
}

template <typename Message>
void CheckHolds(const PeerView& view, const Message& expected) {
  Message got;
  auto reader = view.Reader<Message>();
  REQUIRE(reader.ReadLatest(got) == ReadStatus::kFresh);
  CHECK(std::memcmp(&got, &expected, sizeof got) == 0);
  CHECK(reader.received().stamp_ns == 1'000'000'009);
}

TEST_CASE("a frozen haptic segment of this version attaches and decodes") {
  const Thawed segment("haptic-1.0.bin", Role::kHaptic);
  const AttachResult result = AttachTo(segment, Role::kHaptic);
  INFO(result.text);
  REQUIRE(result.status == AttachStatus::kAttached);
  CHECK(result.view->epoch() == 1'000'000'007);
  CheckHolds(*result.view, test::FixtureTick());
  CheckHolds(*result.view, test::FixtureHapticHealth());
}

TEST_CASE("a frozen world segment of this version attaches and decodes") {
  const Thawed segment("world-1.0.bin", Role::kWorld);
  const AttachResult result = AttachTo(segment, Role::kWorld);
  INFO(result.text);
  REQUIRE(result.status == AttachStatus::kAttached);
  CheckHolds(*result.view, test::FixtureFrame());
  CheckHolds(*result.view, test::FixtureWorldHealth());
  BodiesReader bodies(result.view->Stream(StreamType::kWorldBodies));
  REQUIRE(bodies.ReadLatest() == ReadStatus::kFresh);
  const std::vector<Body> expected = test::FixtureBodies();
  REQUIRE(bodies.bodies().size() == expected.size());
  CHECK(std::memcmp(bodies.bodies().data(), expected.data(), 2 * sizeof(Body)) == 0);
  SceneReader scenes(result.view->Stream(StreamType::kWorldScene));
  REQUIRE(scenes.ReadLatest() == ReadStatus::kFresh);
  const auto packed = [](const WorldScene& scene) {
    std::vector<std::uint64_t> words(WorldSceneBytes(3, 3, 1) / 8);
    REQUIRE(Encode(scene, words).used_bytes == words.size() * 8);
    return words;
  };
  CHECK(packed(scenes.scene()) == packed(test::FixtureScene()));
}

TEST_CASE("segments from before 1.0 are refused") {
  for (const char* minor : {"1", "2", "3", "4"}) {
    for (const Role role : {Role::kHaptic, Role::kWorld}) {
      const Thawed segment(std::string(RoleName(role)) + "-0." + minor + ".bin", role);
      const AttachResult result = AttachTo(segment, role);
      CHECK(result.status == AttachStatus::kIncompatible);
      CHECK_THAT(result.text, Catch::Contains("version_major is 0, this program knows 1"));
    }
  }
}

}  // namespace
}  // namespace rikiseki::protocol

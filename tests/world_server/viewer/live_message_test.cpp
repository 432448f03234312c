// SPDX-License-Identifier: MIT
#include "world_server/viewer/live_message.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "common/clock.h"
#include "tests/protocol/support.h"
#include "world_server/viewer/pair_watch.h"

namespace rikiseki::viewer {
namespace {

using nlohmann::json;
using namespace protocol;  // NOLINT(google-build-using-namespace)

std::uint64_t Now() {
  return static_cast<std::uint64_t>(MonotonicNow());
}

/// A pair whose messages are set by the test, and a watch on it, with a clock of its own.
struct Watched {
  test::TemporaryFolder folder;
  std::string instance = test::FreshInstance();
  std::optional<SegmentOwner> haptic;
  std::optional<SegmentOwner> world;
  std::optional<PairWatch> watch;
  std::int64_t now_ns = MonotonicNow();

  void StartHaptic() { haptic.emplace(test::HapticOptions(instance, folder.path())); }
  void StartWorld() {
    OwnerOptions options = test::HapticOptions(instance, folder.path());
    options.role = Role::kWorld;
    options.streams = WorldStreams(50'000'000, 10, 100'000'000, 10);
    world.emplace(options);
  }
  void Poll() {
    if (!watch) watch.emplace(instance);
    now_ns += 200'000'000;  // time to look at the owners, too
    watch->Poll(now_ns);
  }
};

/// An update as page/src/decode.js takes it apart.
struct Update {
  json head;
  std::vector<double> numbers;
  std::size_t stride = 0;
};

Update Decoded(const std::string& message) {
  Update update;
  std::uint32_t head_bytes = 0;
  std::memcpy(&head_bytes, message.data(), sizeof head_bytes);
  REQUIRE((sizeof head_bytes + head_bytes) % 8 == 0);
  update.head = json::parse(message.substr(sizeof head_bytes, head_bytes));
  const std::string rest = message.substr(sizeof head_bytes + head_bytes);
  update.numbers.resize(rest.size() / sizeof(double));
  if (!rest.empty()) std::memcpy(update.numbers.data(), rest.data(), rest.size());
  update.stride =
      kTickNumbers + update.head["ticks"]["pointers"].get<std::size_t>() * kPointerNumbers;
  std::size_t bodies = 0;
  for (const json& frame : update.head["frames"]) bodies += frame["bodies"].get<std::size_t>();
  CHECK(update.numbers.size() ==
        update.head["ticks"]["count"].get<std::size_t>() * update.stride + bodies * kBodyNumbers);
  return update;
}

TEST_CASE("an update holds the ticks since the one before, each once, and a frame once") {
  Watched pair;
  pair.StartHaptic();
  pair.StartWorld();
  auto ticks = pair.haptic->Writer<HapticTick>();
  auto frames = pair.world->Writer<WorldFrame>();
  BodiesWriter bodies(pair.world->Stream(StreamType::kWorldBodies));
  test::Generator random(1);

  WorldFrame frame = random.Frame();
  frame.frame = 7;
  frame.acked_epoch = pair.haptic->epoch();
  frame.baseline_tick = 0;
  frame.acked_tick = 1;
  frame.period_ns = 50'000'000;
  const std::vector<Body> placed{random.OneBody(), random.OneBody()};
  const std::uint64_t frame_stamp = Now();
  REQUIRE(frames.Publish(frame, frame_stamp));
  REQUIRE(bodies.Publish(placed, frame_stamp));
  const auto publish = [&](std::uint64_t number) {
    HapticTick tick = random.Tick();
    tick.tick = number;
    tick.period_ns = 1'000'000;
    tick.start_ns = frame_stamp - 3'000'000 + number * 1'000'000;
    tick.world_frame = 7;
    tick.pointer_count = 2;
    for (std::uint32_t i = 0; i < 2; ++i) tick.pointers[i].pointer = i;
    tick.channel_count = 1;
    tick.channels[0].opened_tick = 0;
    REQUIRE(ticks.Publish(tick, Now()));
    return tick;
  };
  for (std::uint64_t k = 1; k <= 4; ++k) publish(k);
  const HapticTick newest = publish(5);

  pair.Poll();
  Told told;
  const Update first = Decoded(UpdateMessage(*pair.watch, pair.now_ns, told));
  REQUIRE(first.head["ticks"]["count"] == 5);
  REQUIRE(first.head["ticks"]["pointers"] == 2);
  const double* row = first.numbers.data() + 4 * first.stride;
  CHECK(row[0] == static_cast<double>(newest.start_ns));
  CHECK(row[1] == 5);
  CHECK(row[2] == 7);
  CHECK(row[3] == static_cast<double>(newest.previous_duration_ns));
  CHECK(row[4] == Seconds(newest.start_ns - frame_stamp));  // the feature's age
  CHECK(std::isnan(first.numbers[4]));                      // before the frame was published
  const double* pointer = row + kTickNumbers + kPointerNumbers;
  CHECK(pointer[0] == newest.pointers[1].pointer);
  CHECK(pointer[2] == newest.pointers[1].radius);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    CHECK(pointer[3 + axis] == newest.pointers[1].position[axis]);
    CHECK(pointer[6 + axis] == newest.pointers[1].force[axis]);
  }
  REQUIRE(first.head["frames"].size() == 1);
  const json& told_frame = first.head["frames"][0];
  REQUIRE(told_frame["bodies"] == 2);
  const double* body = first.numbers.data() + 5 * first.stride + kBodyNumbers;
  CHECK(body[0] == placed[1].body);
  CHECK(body[1] == placed[1].generation);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    CHECK(body[2 + axis] == placed[1].position[axis]);
    CHECK(body[9 + axis] == placed[1].velocity[axis]);
  }
  // The frame's poses are of the end of the tick that it acknowledges.
  CHECK(told_frame["state_ns"] == frame_stamp - 1'000'000);
  CHECK(told_frame["number"] == 7);
  CHECK(told_frame["planes"].size() == frame.plane_count);
  CHECK(told_frame["copies"].size() == frame.local_body_count);
  CHECK(first.head["contacts"].size() == newest.channel_count);

  publish(6);
  pair.Poll();
  const Update second = Decoded(UpdateMessage(*pair.watch, pair.now_ns, told));
  CHECK(second.head["ticks"]["count"] == 1);
  CHECK(second.numbers[1] == 6);
  CHECK(second.head["frames"].empty());
  // Another browser is told on its own.
  Told other;
  CHECK(Decoded(UpdateMessage(*pair.watch, pair.now_ns, other)).head["ticks"]["count"] == 6);
}

TEST_CASE("frames come in order, each once, after a pause the last, as many as are kept") {
  Watched pair;
  pair.StartWorld();
  auto frames = pair.world->Writer<WorldFrame>();
  BodiesWriter bodies(pair.world->Stream(StreamType::kWorldBodies));
  test::Generator random(4);
  WorldFrame frame = random.Frame();
  std::vector<Body> placed{random.OneBody()};
  const auto publish = [&](std::uint64_t number) {
    frame.frame = number;
    placed[0].position = {static_cast<double>(number), 0, 0};
    const std::uint64_t stamp_ns = Now();
    REQUIRE(frames.Publish(frame, stamp_ns));
    REQUIRE(bodies.Publish(placed, stamp_ns));
    pair.Poll();
  };
  Told told;
  const auto numbers = [&] {
    const Update update = Decoded(UpdateMessage(*pair.watch, pair.now_ns, told));
    std::vector<std::uint64_t> found;
    for (std::size_t i = 0; i < update.head["frames"].size(); ++i) {
      found.push_back(update.head["frames"][i]["number"]);
      CHECK(update.numbers[i * kBodyNumbers + 2] == static_cast<double>(found.back()));
    }
    return found;
  };
  publish(1);
  CHECK(numbers() == std::vector<std::uint64_t>{1});
  publish(2);
  publish(3);
  CHECK(numbers() == std::vector<std::uint64_t>{2, 3});
  CHECK(numbers().empty());
  for (std::uint64_t number = 4; number < 24; ++number) publish(number);
  CHECK(numbers() == std::vector<std::uint64_t>{16, 17, 18, 19, 20, 21, 22, 23});
  CHECK(pair.watch->frames().size() == kFramesKept);
}

TEST_CASE("a browser that was away is told the newest ticks, not all of them") {
  Watched pair;
  pair.StartHaptic();
  auto ticks = pair.haptic->Writer<HapticTick>();
  test::Generator random(2);
  HapticTick tick = random.Tick();
  tick.channel_count = 0;
  Told told;
  std::uint64_t number = 0;
  for (int round = 0; round < 400; ++round) {
    for (int i = 0; i < 12; ++i) {  // the segment has 16 slots
      tick.tick = ++number;
      tick.start_ns = Now();
      ticks.Publish(tick, Now());
    }
    pair.Poll();
  }
  CHECK(pair.watch->tick_count() == number);
  CHECK(pair.watch->ticks().size() <= 4096);
  const Update update = Decoded(UpdateMessage(*pair.watch, pair.now_ns, told));
  REQUIRE(update.head["ticks"]["count"] == kMostTicks);
  CHECK(update.numbers[(kMostTicks - 1) * update.stride + 1] == static_cast<double>(number));
  CHECK(update.numbers[1] == static_cast<double>(number - kMostTicks + 1));
}

TEST_CASE("either side may be missing, come and go, the scene is told when it is another") {
  Watched pair;
  pair.Poll();
  Told told;
  json head = Decoded(UpdateMessage(*pair.watch, pair.now_ns, told)).head;
  CHECK(head["haptic"]["attached"] == false);
  CHECK_FALSE(head["haptic"]["why"].get<std::string>().empty());
  CHECK(head["world"]["attached"] == false);
  CHECK_FALSE(SceneIsNews(*pair.watch, told));

  pair.StartWorld();
  test::Generator random(3);
  WorldScene scene;
  scene.revision = 4;
  std::memcpy(scene.name.data(), "push", 4);
  scene.bodies.push_back({.body = 3, .generation = 2, .fixed = 0, .collider_count = 1, .name = {}});
  scene.colliders.push_back({.shape = ShapeType::kMesh, .dimensions = {1, 1, 1}});
  scene.meshes.push_back({});
  std::memcpy(scene.meshes[0].path.data(), "/a/b.STL", 8);
  SceneWriter scenes(pair.world->Stream(StreamType::kWorldScene));
  REQUIRE(scenes.Publish(scene, Now()));
  pair.StartHaptic();
  auto healths = pair.haptic->Writer<HapticHealth>();
  HapticHealth health = random.Haptic();
  health.reason = ForceReason::kEmergencyStop;
  REQUIRE(healths.Publish(health, Now()));
  pair.Poll();
  head = Decoded(UpdateMessage(*pair.watch, pair.now_ns, told)).head;
  CHECK(head["world"]["attached"] == true);
  CHECK(head["haptic"]["reason"] == "emergency_stop");
  REQUIRE(SceneIsNews(*pair.watch, told));
  const json told_scene = json::parse(SceneMessage(*pair.watch, told));
  CHECK(told_scene["name"] == "push");
  CHECK(told_scene["revision"] == 4);
  CHECK(told_scene["bodies"][0]["body"] == 3);
  CHECK(told_scene["bodies"][0]["shapes"][0]["mesh"]["format"] == ".STL");
  CHECK(told_scene["bodies"][0]["shapes"][0]["mesh"]["name"] == std::string(64, '0'));
  CHECK_FALSE(SceneIsNews(*pair.watch, told));

  // Another world is another scene, whatever its revision.
  pair.world.reset();
  pair.Poll();
  CHECK_FALSE(pair.watch->world().attached);
  pair.StartWorld();
  SceneWriter again(pair.world->Stream(StreamType::kWorldScene));
  REQUIRE(again.Publish(scene, Now()));
  pair.Poll();
  CHECK(SceneIsNews(*pair.watch, told));
}

}  // namespace
}  // namespace rikiseki::viewer

// SPDX-License-Identifier: MIT
// rikiseki.h and scripts/peer.py against the C++ library: the same layout, the same bytes, the same verdict on
// nonsense, and segments that either side makes and the other reads.
#include "tests/protocol/rikiseki_h_test.h"

#include <array>
#include <bit>
#include <catch2/catch.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "protocol/attach.h"
#include "protocol/codec.h"
#include "protocol/owner.h"
#include "protocol/rikiseki.h"  // must also compile as C++
#include "protocol/stream.h"
#include "tests/protocol/support.h"

namespace rikiseki::protocol {
namespace {

using test::FreshInstance;
using test::Generator;
using test::HapticOptions;
using test::TemporaryFolder;

std::string ReadFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
}

/// A payload as it lies in a slot: what a reader has copied, and what the slot says about it.
struct Payload {
  std::uint32_t type = 0;
  std::vector<std::uint64_t> words;
  Encoded shape;
};

template <typename Message>
Payload Pack(const Message& message) {
  Payload payload{static_cast<std::uint32_t>(StreamOf<Message>::kType),
                  std::vector<std::uint64_t>(StreamOf<Message>::kBytes / 8),
                  {}};
  payload.shape = Encode(message, std::span<std::uint64_t>(payload.words));
  payload.words.resize(payload.shape.used_bytes / 8);
  return payload;
}

Payload Pack(const WorldScene& scene) {
  Payload payload{
      static_cast<std::uint32_t>(StreamType::kWorldScene),
      std::vector<std::uint64_t>(WorldSceneBytes(static_cast<std::uint32_t>(scene.bodies.size()),
                                                 static_cast<std::uint32_t>(scene.colliders.size()),
                                                 static_cast<std::uint32_t>(scene.meshes.size())) /
                                 8),
      {}};
  payload.shape = Encode(scene, std::span<std::uint64_t>(payload.words));
  return payload;
}

Payload Pack(const std::vector<Body>& bodies) {
  Payload payload{
      static_cast<std::uint32_t>(StreamType::kWorldBodies),
      std::vector<std::uint64_t>(WorldBodiesBytes(static_cast<std::uint32_t>(bodies.size())) / 8),
      {}};
  payload.shape = Encode(std::span<const Body>(bodies), std::span<std::uint64_t>(payload.words));
  return payload;
}

/// What the C++ library makes of it.
bool IsSound(const Payload& payload) {
  const std::span<const std::uint64_t> words(payload.words);
  switch (static_cast<StreamType>(payload.type)) {
    case StreamType::kHapticTick: {
      HapticTick message;
      return Decode(words, payload.shape, message) == DecodeStatus::kOk;
    }
    case StreamType::kHapticHealth: {
      HapticHealth message;
      return Decode(words, payload.shape, message) == DecodeStatus::kOk;
    }
    case StreamType::kWorldFrame: {
      WorldFrame message;
      return Decode(words, payload.shape, message) == DecodeStatus::kOk;
    }
    case StreamType::kWorldHealth: {
      WorldHealth message;
      return Decode(words, payload.shape, message) == DecodeStatus::kOk;
    }
    case StreamType::kWorldBodies: {
      std::vector<Body> bodies(kMaxBodies);
      std::uint32_t count = 0;
      return Decode(words, payload.shape, std::span<Body>(bodies), count) == DecodeStatus::kOk;
    }
    case StreamType::kWorldScene: {
      WorldScene message;
      return Decode(words, payload.shape, message) == DecodeStatus::kOk;
    }
  }
  return false;
}

Payload RandomSound(Generator& generator) {
  switch (generator.Integer(7)) {
    case 0:
      return Pack(generator.Haptic());
    case 1:
      return Pack(generator.World());
    case 2: {
      std::vector<Body> bodies(generator.Integer(20));
      for (Body& body : bodies) body = generator.OneBody();
      return Pack(bodies);
    }
    case 3:
      return Pack(generator.Scene());
    case 4:
    case 5:
      return Pack(generator.Frame());
    default:
      return Pack(generator.Tick());
  }
}

/// Breaks something, or adds what a later version might.
void Mutate(Generator& generator, Payload& payload) {
  static constexpr std::array<double, 5> kNumbers{std::numeric_limits<double>::quiet_NaN(),
                                                  std::numeric_limits<double>::infinity(), -1.0,
                                                  0.0, 1e300};
  const std::size_t at = payload.words.empty() ? 0 : generator.Integer(payload.words.size() - 1);
  const auto half =
      reinterpret_cast<std::uint32_t*>(payload.words.data()) + 2 * at + generator.Integer(1);
  switch (generator.Integer(7)) {
    case 0:
      payload.words[at] =
          std::bit_cast<std::uint64_t>(kNumbers[generator.Integer(kNumbers.size() - 1)]);
      break;
    case 1:
      payload.words[at] ^= 1ULL << generator.Integer(63);
      break;
    case 2:
      *half = generator.Small(40);
      break;
    case 3:
      *half = 0xFFFFFFFF - generator.Small(3);
      break;
    case 4:
      payload.shape.blocks ^= 1u << generator.Integer(6);
      break;
    case 5:
      payload.shape.used_bytes += 8;
      break;
    case 6:  // a later version's block
      payload.shape.blocks |= 1u << 30;
      payload.words.resize(payload.words.size() + generator.Integer(4), 42);
      payload.shape.used_bytes = static_cast<std::uint32_t>(8 * payload.words.size());
      break;
    default:
      payload.words.resize(at);
      payload.shape.used_bytes = static_cast<std::uint32_t>(8 * at);
      break;
  }
}

std::vector<Payload> Payloads(std::size_t count, std::vector<bool>& is_mutated) {
  Generator generator(20260);
  std::vector<Payload> payloads;
  for (std::size_t i = 0; i < count; ++i) {
    payloads.push_back(RandomSound(generator));
    is_mutated.push_back(i % 2 == 1);
    if (is_mutated.back()) Mutate(generator, payloads.back());
  }
  return payloads;
}

TEST_CASE("rikiseki.h has the golden layout, version and hash") {
  std::string text(64 * 1024, '\0');
  text.resize(rk_test_layout(text.data(), text.size()));
  CHECK(text == ReadFile(RIKISEKI_SOURCE_DIR "/protocol/layout.golden.txt"));
  CHECK(RK_VERSION_MAJOR == kVersionMajor);
  CHECK(RK_VERSION_MINOR == kVersionMinor);
  CHECK(RK_LAYOUT_HASH == kLayoutHash);
  CHECK(RK_MAGIC == kMagic);
  CHECK(RK_TICK_BYTES == kHapticTickBytes);
  CHECK(RK_FRAME_BYTES == kWorldFrameBytes);
  CHECK(sizeof(rk_segment_header) == sizeof(SegmentHeader));
}

TEST_CASE("the C codec and the C++ codec agree on random and on broken messages") {
  std::vector<bool> is_mutated;
  std::vector<Payload> payloads = Payloads(20000, is_mutated);
  std::size_t rejected = 0;
  std::size_t judged = 0;
  for (std::size_t i = 0; i < payloads.size(); ++i) {
    const Payload& payload = payloads[i];
    if (payload.type != RK_HAPTIC_TICK && payload.type != RK_WORLD_FRAME) continue;
    std::array<std::uint64_t, kWorldFrameBytes / 8> again{};
    Encoded shape;
    const bool sound = rk_test_recode(payload.type, payload.words.data(), 8 * payload.words.size(),
                                      payload.shape.used_bytes, payload.shape.blocks, again.data(),
                                      &shape.used_bytes, &shape.blocks) != 0;
    CAPTURE(i, payload.type, payload.shape.used_bytes, payload.shape.blocks);
    REQUIRE(sound == IsSound(payload));
    ++judged;
    rejected += !sound;
    if (is_mutated[i]) continue;
    REQUIRE(shape.used_bytes == payload.shape.used_bytes);
    REQUIRE(shape.blocks == payload.shape.blocks);
    REQUIRE(std::equal(payload.words.begin(), payload.words.end(), again.begin()));
  }
  CHECK(rejected > judged / 10);  // the mutations bite ...
  CHECK(rejected < judged / 2);   // ... and some of them must be accepted
}

TEST_CASE("peer.py and the C++ codec agree on random and on broken messages, and on headers") {
  std::vector<bool> is_mutated;
  std::vector<Payload> payloads = Payloads(4000, is_mutated);
  std::vector<bool> expected;
  for (const Payload& payload : payloads) expected.push_back(IsSound(payload));

  // Headers travel as type 0, with the object's size and the role in place of used_bytes and blocks.
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  SegmentOwner owner(HapticOptions(instance, folder.path()));
  AttachRequest request;
  request.instance = instance;
  const AttachResult attached = Attach(request);
  REQUIRE(attached.status == AttachStatus::kAttached);
  const SegmentHeader sound = attached.view->header();
  Generator generator(7);
  std::size_t headers_refused = 0;
  for (int i = 0; i < 2000; ++i) {
    Payload header{0, std::vector<std::uint64_t>(kHeaderBytes / 8), {}};
    std::memcpy(header.words.data(), &sound, sizeof sound);
    header.shape = {static_cast<std::uint32_t>(sound.segment_bytes), 1};
    if (i % 8 != 0) {  // in the constant fields or in the two entries of the directory
      const std::size_t word =
          generator.Integer(1) == 0 ? generator.Integer(6) : 128 + generator.Integer(12);
      header.words[word] ^= 1ULL << generator.Integer(i % 2 == 0 ? 63 : 15);
    }
    SegmentHeader copy;
    std::memcpy(&copy, header.words.data(), sizeof copy);
    expected.push_back(CheckHeader(copy, header.shape.used_bytes, Role::kHaptic).empty());
    headers_refused += !expected.back();
    payloads.push_back(std::move(header));
    is_mutated.push_back(true);
  }
  CHECK(headers_refused > 500);
  CHECK(headers_refused < 1750);

  const std::string question = folder.path() + "/messages";
  const std::string answer = folder.path() + "/answers";
  {
    std::ofstream file(question, std::ios::binary);
    for (const Payload& payload : payloads) {
      const std::array<std::uint32_t, 4> head{payload.type, payload.shape.used_bytes,
                                              payload.shape.blocks,
                                              static_cast<std::uint32_t>(8 * payload.words.size())};
      file.write(reinterpret_cast<const char*>(head.data()), sizeof head);
      file.write(reinterpret_cast<const char*>(payload.words.data()),
                 static_cast<std::streamsize>(8 * payload.words.size()));
    }
  }
  const std::string command = std::string("/usr/bin/python3 ") + RIKISEKI_SOURCE_DIR +
                              "/scripts/peer.py codec " + question + " " + answer;
  REQUIRE(std::system(command.c_str()) == 0);
  const std::string answers = ReadFile(answer);
  std::filesystem::remove(question);
  std::filesystem::remove(answer);
  std::size_t at = 0;
  for (std::size_t i = 0; i < payloads.size(); ++i) {
    std::array<std::uint32_t, 4> head{};
    REQUIRE(answers.size() >= at + sizeof head);
    std::memcpy(head.data(), answers.data() + at, sizeof head);
    at += sizeof head;
    const Payload& payload = payloads[i];
    CAPTURE(i, payload.type, payload.shape.used_bytes, payload.shape.blocks);
    REQUIRE((head[0] == 1) == expected[i]);
    if (!is_mutated[i]) {
      REQUIRE(head[1] == payload.shape.used_bytes);
      REQUIRE(head[2] == payload.shape.blocks);
      REQUIRE(std::memcmp(answers.data() + at, payload.words.data(), head[3]) == 0);
    }
    at += head[3];
  }
  CHECK(at == answers.size());
}

TEST_CASE("peer.py has the golden layout") {
  const TemporaryFolder folder;
  const std::string command = std::string("/usr/bin/python3 ") + RIKISEKI_SOURCE_DIR +
                              "/scripts/peer.py layout > " + folder.path() + "/layout";
  REQUIRE(std::system(command.c_str()) == 0);
  const std::string records = ReadFile(folder.path() + "/layout");
  std::filesystem::remove(folder.path() + "/layout");
  const std::string golden = ReadFile(RIKISEKI_SOURCE_DIR "/protocol/layout.golden.txt");
  REQUIRE(!records.empty());
  CHECK(golden.substr(golden.find("haptic.tick.tick")) == records);
}

TEST_CASE("a C++ segment is read from C") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  SegmentOwner owner(HapticOptions(instance, folder.path()));
  MessageWriter<HapticTick> writer(owner.Stream(StreamType::kHapticTick));
  rk_test_view* view = nullptr;
  char why[256];
  REQUIRE(rk_test_attach(instance.c_str(), RK_HAPTIC, &view, why) == RK_ATTACHED);
  CHECK(rk_test_epoch(view) == owner.epoch());
  CHECK(rk_test_state(view) == RK_READY);
  CHECK(rk_test_alive(view));
  CHECK_FALSE(rk_test_replaced(view));
  owner.Heartbeat(3, 12345);
  CHECK(rk_test_heartbeat(view) == 12345);

  std::array<std::uint64_t, kHapticTickBytes / 8> words{};
  std::uint64_t number = 0;
  std::uint64_t stamp_ns = 0;
  Encoded shape;
  const auto read = [&](bool next) {
    return rk_test_read(view, next, words.data(), sizeof words, &number, &stamp_ns,
                        &shape.used_bytes, &shape.blocks);
  };
  CHECK(read(false) == RK_EMPTY);
  Generator generator(1);
  for (std::uint64_t n = 1; n <= 40; ++n) {
    const HapticTick sent = generator.Tick();
    writer.Publish(sent, 1000 + n);
    REQUIRE(read(n % 2 == 0) == RK_FRESH);
    CHECK(number == n);
    CHECK(stamp_ns == 1000 + n);
    HapticTick got;
    REQUIRE(Decode(words, shape, got) == DecodeStatus::kOk);
    CHECK(std::memcmp(&got, &sent, sizeof got) == 0);
    CHECK(read(false) == RK_SAME);
    CHECK(read(true) == RK_EMPTY);
  }
  for (std::uint64_t n = 41; n <= 60; ++n) writer.Publish(test::Numbered(n), 0);
  REQUIRE(read(true) == RK_FRESH);  // lapped: 20 behind in a ring of 16
  CHECK(number == 60 - 8 + 1);
  CHECK(rk_test_lost(view) == 60 - 8 - 40);
  owner.SetFault(7);
  CHECK(rk_test_state(view) == RK_FAULTED);
  owner.Close();
  CHECK(rk_test_state(view) == RK_CLOSED);
  rk_test_view* gone = nullptr;
  CHECK(rk_test_attach(instance.c_str(), RK_HAPTIC, &gone, why) == RK_ABSENT);
  CHECK(rk_test_attach("no/name", RK_HAPTIC, &gone, why) == RK_FORBIDDEN);
  rk_test_detach(view);
}

TEST_CASE("a C segment is read from C++, and its life is that of SPEC.md 5") {
  const TemporaryFolder folder;
  REQUIRE(setenv("RUNTIME_DIRECTORY", folder.path().c_str(), 1) == 0);
  const std::string instance = FreshInstance();
  const std::string path = "/dev/shm/rikiseki." + instance + ".haptic";
  rk_test_segment* own = nullptr;
  char why[256];
  REQUIRE(rk_test_create(instance.c_str(), &own, why) == 0);
  namespace fs = std::filesystem;
  CHECK(fs::status(path).permissions() == static_cast<fs::perms>(0640));
  AttachRequest request;
  request.instance = instance;
  request.required = {{StreamType::kHapticTick, 1, 16'000'000}, {StreamType::kHapticHealth}};
  AttachResult result = Attach(request);
  INFO(result.text);
  REQUIRE(result.status == AttachStatus::kAttached);
  const PeerView& view = *result.view;
  auto reader = view.Reader<HapticTick>();
  HapticTick got;
  Generator generator(2);
  for (int i = 0; i < 40; ++i) {
    const HapticTick sent = generator.Tick();
    const Payload payload = Pack(sent);
    REQUIRE(rk_test_publish(own, payload.words.data(), payload.shape.used_bytes,
                            payload.shape.blocks, 99));
    REQUIRE((i % 2 == 0 ? reader.ReadLatest(got) : reader.ReadNext(got)) == ReadStatus::kFresh);
    CHECK(std::memcmp(&got, &sent, sizeof got) == 0);
  }
  CHECK(view.HeartbeatNs() == 99);
  CHECK_FALSE(rk_test_publish(own, nullptr, kHapticTickBytes + 8, 0, 99));  // does not fit

  const auto cpp_exit = [&](const std::string& runtime_directory) {
    try {
      SegmentOwner second(HapticOptions(instance, runtime_directory));
    } catch (const SegmentError& error) {
      return error.exit_code();
    }
    return 0;
  };
  rk_test_segment* second = nullptr;
  const TemporaryFolder other;
  CHECK(cpp_exit(folder.path()) == 75);  // the role lock
  CHECK(cpp_exit(other.path()) == 75);   // the owner lock
  CHECK(rk_test_create(instance.c_str(), &second, why) == 75);
  REQUIRE(setenv("RUNTIME_DIRECTORY", other.path().c_str(), 1) == 0);
  CHECK(rk_test_create(instance.c_str(), &second, why) == 75);
  CHECK(view.Ready());

  // Killed; C takes over from C, then C++ from C, then C from C++.
  rk_test_die(own);
  CHECK_FALSE(view.OwnerAlive());
  REQUIRE(rk_test_create(instance.c_str(), &second, why) == 0);
  CHECK(view.State() == SegmentState::kSuperseded);
  CHECK_FALSE(view.IsCurrent());
  AttachResult newer = Attach(request);
  REQUIRE(newer.status == AttachStatus::kAttached);
  CHECK(newer.view->epoch() > view.epoch());
  rk_test_die(second);
  {
    SegmentOwner third(HapticOptions(instance, other.path()));
    CHECK(third.epoch() > newer.view->epoch());
    CHECK(rk_test_own_state(second) == RK_SUPERSEDED);
    rk_test_segment* fourth = nullptr;
    CHECK(rk_test_create(instance.c_str(), &fourth, why) == 75);
    third.Close();
  }
  rk_test_segment* last = nullptr;
  REQUIRE(rk_test_create(instance.c_str(), &last, why) == 0);
  rk_test_close(last);
  CHECK_FALSE(fs::exists(path));
  rk_test_close(second);
  rk_test_close(own);
  unsetenv("RUNTIME_DIRECTORY");
  for (const TemporaryFolder* used : {&folder, &other}) {
    fs::remove(used->path() + "/rikiseki." + instance + ".haptic.lock");
  }
}

TEST_CASE("a C frame says of no plane that its body cannot move, unless told to") {
  rk_frame frame;
  rk_frame_init(&frame);
  frame.head.frame = 1;
  frame.head.period_ns = 1;
  frame.head.coupling = RK_BY_IMPULSE;
  frame.head.plane_count = 2;
  frame.plane[0].normal[2] = frame.plane[1].normal[2] = 1;
  std::array<std::uint64_t, RK_FRAME_BYTES / 8> words{};
  rk_received shape{};
  REQUIRE(rk_encode_frame(&frame, words.data(), &shape));
  CHECK(shape.blocks == 0);
  WorldFrame got;
  REQUIRE(Decode(words, {shape.used_bytes, shape.blocks}, got) == DecodeStatus::kOk);
  CHECK(got.planes[1].inverse_mass == kMobilityNotSaid);
  frame.mobility[1].inverse_mass = 0;
  REQUIRE(rk_encode_frame(&frame, words.data(), &shape));
  CHECK(shape.blocks == RK_FRAME_MOBILITY);
  REQUIRE(Decode(words, {shape.used_bytes, shape.blocks}, got) == DecodeStatus::kOk);
  CHECK(got.planes[0].inverse_mass == kMobilityNotSaid);
  CHECK(got.planes[1].inverse_mass == 0);
}

// SPEC.md 9.2-9: 4 (elapsed / period + slot_count) messages may have come, no more.
TEST_CASE("rk_jumped tells a counter that jumps from one that was only not looked at") {
  constexpr std::uint64_t kMs = 1'000'000;
  rk_reader reader{};
  reader.slot_count = 16;
  reader.period_ns = kMs;
  reader.cursor = 1'000'000;
  std::uint64_t now_ns = 5 * kMs;
  CHECK_FALSE(rk_jumped(&reader, now_ns));  // the first look knows of nothing before
  now_ns += 10 * kMs;
  reader.cursor += 4 * (10 + 16);
  CHECK_FALSE(rk_jumped(&reader, now_ns));
  now_ns += 10 * kMs;
  reader.cursor += 4 * (10 + 16) + 4;
  CHECK(rk_jumped(&reader, now_ns));
  CHECK_FALSE(rk_jumped(&reader, now_ns));  // it is counted from there
  now_ns += 10'000 * kMs;                   // stopped for ten seconds
  reader.cursor += 40'000;
  CHECK_FALSE(rk_jumped(&reader, now_ns));
  reader.period_ns = 0;  // aperiodic: nothing is too fast
  reader.cursor += 1'000'000'000;
  CHECK_FALSE(rk_jumped(&reader, now_ns));
}

TEST_CASE("C and C++ refuse the same headers") {
  const TemporaryFolder folder;
  const std::string instance = FreshInstance();
  SegmentOwner owner(HapticOptions(instance, folder.path()));
  const std::string path = "/dev/shm/rikiseki." + instance + ".haptic";
  const int file = open(path.c_str(), O_RDWR | O_CLOEXEC);
  REQUIRE(file >= 0);
  Generator generator(3);
  std::size_t refused = 0;
  constexpr int kCases = 3000;
  for (int i = 0; i < kCases; ++i) {
    // One of: the constant words of the header, its state, its directory of two entries.
    const std::uint64_t place = generator.Integer(2);
    const std::size_t word = place == 0   ? generator.Integer(6)
                             : place == 1 ? 16
                                          : 128 + generator.Integer(12);
    const auto offset = static_cast<off_t>(8 * word);
    std::uint64_t before = 0;
    REQUIRE(pread(file, &before, sizeof before, offset) == sizeof before);
    std::uint64_t broken = before ^ 1ULL << generator.Integer(i % 2 == 0 ? 63 : 15);
    if (place == 1) broken = generator.Integer(6);
    REQUIRE(pwrite(file, &broken, sizeof broken, offset) == sizeof broken);
    AttachRequest request;
    request.instance = instance;
    request.required = {{StreamType::kHapticTick}};
    const AttachResult ours = Attach(request);
    rk_test_view* view = nullptr;
    char why[256];
    const int theirs = rk_test_attach(instance.c_str(), RK_HAPTIC, &view, why);
    CAPTURE(word, before, broken, ours.text, why);
    REQUIRE(theirs == static_cast<int>(ours.status));
    refused += theirs != RK_ATTACHED;
    if (view != nullptr) rk_test_detach(view);
    REQUIRE(pwrite(file, &before, sizeof before, offset) == sizeof before);
  }
  close(file);
  CHECK(refused > kCases / 3);
  CHECK(refused < kCases);
}

}  // namespace
}  // namespace rikiseki::protocol

// SPDX-License-Identifier: MIT
// Bytes -> Decode of each message. What is accepted must be encodable again, and mean the same.
//
// Input: u32 which message (modulo their number), u32 blocks, u32 used_bytes, u32 bytes of the
// private copy (0 = all that follow), then the payload.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "protocol/codec.h"

namespace {

using namespace rikiseki::protocol;  // NOLINT(google-build-using-namespace)

void Require(bool condition) {
  if (!condition) std::abort();
}

/// Accepted once, a message is accepted for ever: its own encoding decodes to the same encoding.
template <typename Message>
void CheckStable(const Message& message, std::size_t room_bytes) {
  static thread_local std::vector<std::uint64_t> first;
  static thread_local std::vector<std::uint64_t> second;
  first.assign(room_bytes / 8, 0);
  second.assign(room_bytes / 8, 0);
  const Encoded encoded = Encode(message, first);
  Require(encoded.used_bytes != 0);
  static thread_local Message again;
  Require(Decode(first, encoded, again) == DecodeStatus::kOk);
  const Encoded encoded_again = Encode(again, second);
  Require(encoded_again.used_bytes == encoded.used_bytes);
  Require(encoded_again.blocks == encoded.blocks);
  Require(first == second);
}

template <typename Message>
void TryDecode(std::span<const std::uint64_t> words, Encoded encoded) {
  static thread_local Message message;
  if (Decode(words, encoded, message) != DecodeStatus::kOk) return;
  CheckStable(message, StreamOf<Message>::kBytes);
}

void TryScene(std::span<const std::uint64_t> words, Encoded encoded) {
  WorldScene scene;
  if (Decode(words, encoded, scene) != DecodeStatus::kOk) return;
  CheckStable(scene, WorldSceneBytes(static_cast<std::uint32_t>(scene.bodies.size()),
                                     static_cast<std::uint32_t>(scene.colliders.size()),
                                     static_cast<std::uint32_t>(scene.meshes.size())));
}

void TryBodies(std::span<const std::uint64_t> words, Encoded encoded) {
  static std::vector<Body> bodies(300);
  std::uint32_t count = 0;
  if (Decode(words, encoded, bodies, count) != DecodeStatus::kOk) return;
  Require(count <= bodies.size());
  std::vector<std::uint64_t> again(WorldBodiesBytes(count) / 8);
  Require(Encode(std::span(bodies).first(count), again).used_bytes == again.size() * 8);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::uint32_t head[4];
  if (size < sizeof head) return 0;
  std::memcpy(head, data, sizeof head);
  // Exactly as long as the copy: reading beyond it is reading beyond an allocation.
  std::size_t count = (size - sizeof head) / 8;
  if (head[3] != 0) count = std::min<std::size_t>(count, head[3] / 8);
  std::vector<std::uint64_t> words(count);
  if (count != 0) std::memcpy(words.data(), data + sizeof head, count * 8);
  const Encoded encoded{head[2], head[1]};
  switch (head[0] % 6) {
    case 0:
      TryDecode<HapticTick>(words, encoded);
      break;
    case 1:
      TryDecode<WorldFrame>(words, encoded);
      break;
    case 2:
      TryDecode<HapticHealth>(words, encoded);
      break;
    case 3:
      TryDecode<WorldHealth>(words, encoded);
      break;
    case 4:
      TryBodies(words, encoded);
      break;
    default:
      TryScene(words, encoded);
      break;
  }
  return 0;
}

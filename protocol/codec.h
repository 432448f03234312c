// SPDX-License-Identifier: MIT
// Packs the messages of messages.h into the bytes of SPEC.md section 6 and back. Only the pointers,
// channels and planes in use travel, and an optional block only when one of its values differs from
// its default: a scene pays for what it needs.
//
// Decode trusts nobody: it works on a private copy, checks counts, lengths, enumerators, that every
// double is finite and every direction is one, and leaves `message` untouched unless it returns
// kOk. Neither direction allocates or throws, but for the scene's Decode.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/messages.h"
#include "protocol/validate.h"

namespace rikiseki::protocol {

/// What Encode wrote; used_bytes = 0: the message has impossible counts or `words` is too short.
struct Encoded {
  std::uint32_t used_bytes = 0;  // a multiple of 8
  std::uint32_t blocks = 0;
};

// Optional blocks: bits of SlotHeader.blocks. They follow in the order of their bits.
inline constexpr std::uint32_t kTickRotations = 1;    // orientation, angular velocity, torque
inline constexpr std::uint32_t kTickGround = 2;       // the ground channel
inline constexpr std::uint32_t kFrameSurfaces = 1;    // stiffness and damping of each plane
inline constexpr std::uint32_t kFrameVelocities = 2;  // of each plane
inline constexpr std::uint32_t kFrameFriction = 4;    // of each plane
inline constexpr std::uint32_t kFrameRecovery = 8;    // of each plane
inline constexpr std::uint32_t kFrameLocalBodies = 16;
inline constexpr std::uint32_t kFrameMobility = 32;  // of each plane
inline constexpr std::uint32_t kFrameRounding = 64;  // of each plane
inline constexpr std::uint32_t kHealthReconciliation = 1;
inline constexpr std::uint32_t kHealthEnergy = 2;
inline constexpr std::uint32_t kSceneMeshes = 1;

// Room for the largest message of each stream [bytes].
inline constexpr std::uint32_t kHapticTickBytes =
    80 + kMaxPointers * (88 + 80) + kMaxChannels * 144 + 48;
inline constexpr std::uint32_t kHapticHealthBytes = 328 + 2 * 8 * kHistogramBuckets + 24 + 32;
inline constexpr std::uint32_t kWorldFrameBytes =
    104 + kMaxPlanes * (64 + 16 + 24 + 16 + 8 + 8 + 8) + 16 +
    kMaxLocalBodies * (224 + kMaxContactPlanes * 136);
inline constexpr std::uint32_t kWorldHealthBytes = 288 + 2 * 8 * kHistogramBuckets;
constexpr std::uint32_t WorldBodiesBytes(std::uint32_t bodies) {
  return 8 + 120 * bodies;
}
constexpr std::uint32_t WorldSceneBytes(std::uint32_t bodies, std::uint32_t colliders,
                                        std::uint32_t meshes) {
  return 120 + 80 * bodies + 120 * colliders + 256 * meshes;
}

Encoded Encode(const HapticTick& message, std::span<std::uint64_t> words) noexcept;    // RT:
Encoded Encode(const HapticHealth& message, std::span<std::uint64_t> words) noexcept;  // RT:
Encoded Encode(const WorldFrame& message, std::span<std::uint64_t> words) noexcept;
Encoded Encode(const WorldHealth& message, std::span<std::uint64_t> words) noexcept;
Encoded Encode(std::span<const Body> bodies, std::span<std::uint64_t> words) noexcept;
/// Also nothing if the colliders and meshes are not as many as the bodies and colliders say.
Encoded Encode(const WorldScene& message, std::span<std::uint64_t> words) noexcept;

DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded,
                    HapticTick& message) noexcept;
DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded,
                    HapticHealth& message) noexcept;
DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded,
                    WorldFrame& message) noexcept;  // RT:
DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded,
                    WorldHealth& message) noexcept;
/// Fills the front of `bodies` and `count`; kCount if they are more than fit. On failure `bodies`
/// may be partly overwritten, and `count` is untouched.
DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded, std::span<Body> bodies,
                    std::uint32_t& count) noexcept;
/// The one that allocates, for observers: no more than the length bears out.
DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded, WorldScene& message);

/// Which stream carries a message, and how much room it needs.
template <typename Message>
struct StreamOf;
template <>
struct StreamOf<HapticTick> {
  static constexpr StreamType kType = StreamType::kHapticTick;
  static constexpr std::uint32_t kBytes = kHapticTickBytes;
};
template <>
struct StreamOf<HapticHealth> {
  static constexpr StreamType kType = StreamType::kHapticHealth;
  static constexpr std::uint32_t kBytes = kHapticHealthBytes;
};
template <>
struct StreamOf<WorldFrame> {
  static constexpr StreamType kType = StreamType::kWorldFrame;
  static constexpr std::uint32_t kBytes = kWorldFrameBytes;
};
template <>
struct StreamOf<WorldHealth> {
  static constexpr StreamType kType = StreamType::kWorldHealth;
  static constexpr std::uint32_t kBytes = kWorldHealthBytes;
};

}  // namespace rikiseki::protocol

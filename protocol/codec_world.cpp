// SPDX-License-Identifier: MIT
// Packs and unpacks what the world says every tick: frames and health. SPEC.md section 6.
#include "protocol/codec_archive.h"
#include "protocol/validate.h"

namespace rikiseki::protocol {
namespace {

// Encode for the loops is [[gnu::flatten]]: only inlined into it does the archive's offset stay in
// a register, for the bytes written may alias it.

constexpr std::uint32_t kFrameHead =
    Measure<WorldFrame>([](auto& a, auto& m) { WorldFrameHead(a, m); });
constexpr std::uint32_t kPlane = Measure<Plane>([](auto& a, auto& m) { PlaneFields(a, m); });
constexpr std::uint32_t kSurface =
    Measure<Plane>([](auto& a, auto& m) { PlaneSurfaceFields(a, m); });
constexpr std::uint32_t kVelocity =
    Measure<Plane>([](auto& a, auto& m) { PlaneVelocityFields(a, m); });
constexpr std::uint32_t kFriction =
    Measure<Plane>([](auto& a, auto& m) { PlaneFrictionFields(a, m); });
constexpr std::uint32_t kRecovery =
    Measure<Plane>([](auto& a, auto& m) { PlaneRecoveryFields(a, m); });
constexpr std::uint32_t kMobility =
    Measure<Plane>([](auto& a, auto& m) { PlaneMobilityFields(a, m); });
constexpr std::uint32_t kRounding =
    Measure<Plane>([](auto& a, auto& m) { PlaneRoundingFields(a, m); });
constexpr std::uint32_t kLocalHead =
    Measure<WorldFrame>([](auto& a, auto& m) { LocalHeadFields(a, m); });
constexpr std::uint32_t kLocalBody =
    Measure<LocalBody>([](auto& a, auto& m) { LocalBodyFields(a, m); });
constexpr std::uint32_t kContactPlane =
    Measure<ContactPlane>([](auto& a, auto& m) { ContactPlaneFields(a, m); });

static_assert(kWorldFrameBytes ==
              kFrameHead +
                  kMaxPlanes * (kPlane + kSurface + kVelocity + kFriction + kRecovery + kMobility +
                                kRounding) +
                  kLocalHead + kMaxLocalBodies * (kLocalBody + kMaxContactPlanes * kContactPlane));
static_assert(kWorldHealthBytes ==
              Measure<WorldHealth>([](auto& a, auto& m) { WorldHealthFields(a, m); }));
static_assert(kFrameHead % 8 == 0 && kPlane % 8 == 0 && kSurface % 8 == 0 && kVelocity % 8 == 0 &&
              kFriction % 8 == 0 && kRecovery % 8 == 0 && kMobility % 8 == 0 &&
              kRounding % 8 == 0 && kLocalHead % 8 == 0 && kLocalBody % 8 == 0 &&
              kContactPlane % 8 == 0);

// Encode copies contact planes in one piece, since the largest frame has 64 of them.
static_assert(sizeof(ContactPlane) == kContactPlane && offsetof(ContactPlane, point) == 8 &&
              offsetof(ContactPlane, normal) == 32 && offsetof(ContactPlane, gap) == 56 &&
              offsetof(ContactPlane, friction) == 64 &&
              offsetof(ContactPlane, other_velocity) == 72 &&
              offsetof(ContactPlane, other_inverse_mass) == 96 &&
              offsetof(ContactPlane, impulse) == 104 && offsetof(ContactPlane, radius) == 128);

/// Without what follows the local head: its counts stand there and beyond.
std::uint32_t FrameBytes(std::uint32_t planes, std::uint32_t blocks) {
  return kFrameHead + planes * kPlane + ((blocks & kFrameSurfaces) != 0 ? planes * kSurface : 0) +
         ((blocks & kFrameVelocities) != 0 ? planes * kVelocity : 0) +
         ((blocks & kFrameFriction) != 0 ? planes * kFriction : 0) +
         ((blocks & kFrameRecovery) != 0 ? planes * kRecovery : 0) +
         ((blocks & kFrameMobility) != 0 ? planes * kMobility : 0) +
         ((blocks & kFrameRounding) != 0 ? planes * kRounding : 0) +
         ((blocks & kFrameLocalBodies) != 0 ? kLocalHead : 0);
}
constexpr std::uint32_t kFrameBlocks = kFrameSurfaces | kFrameVelocities | kFrameFriction |
                                       kFrameRecovery | kFrameLocalBodies | kFrameMobility |
                                       kFrameRounding;

/// The blocks with one record for each plane, in the order of their bits.
template <typename Archive, typename Planes>
void WalkPlaneBlocks(Archive& archive, Planes planes, std::uint32_t blocks) {
  if ((blocks & kFrameSurfaces) != 0) {
    for (auto& p : planes) PlaneSurfaceFields(archive, p);
  }
  if ((blocks & kFrameVelocities) != 0) {
    for (auto& p : planes) PlaneVelocityFields(archive, p);
  }
  if ((blocks & kFrameFriction) != 0) {
    for (auto& p : planes) PlaneFrictionFields(archive, p);
  }
  if ((blocks & kFrameRecovery) != 0) {
    for (auto& p : planes) PlaneRecoveryFields(archive, p);
  }
}

/// The block behind the planes' blocks; `bytes` grows by what follows its head.
DecodeStatus DecodeLocalBodies(Decoder& decoder, std::span<const std::uint64_t> words,
                               Encoded encoded, WorldFrame& m, std::uint32_t& bytes) {
  LocalHeadFields(decoder, m);
  if (m.local_body_count > kMaxLocalBodies) return DecodeStatus::kCount;
  const auto bodies = std::span(m.local_bodies).first(m.local_body_count);
  bytes += m.local_body_count * kLocalBody;
  if (!Reaches(words, encoded, bytes)) return DecodeStatus::kLength;
  for (LocalBody& b : bodies) {
    LocalBodyFields(decoder, b);
    if (b.contact_count > kMaxContactPlanes) return DecodeStatus::kCount;
    bytes += b.contact_count * kContactPlane;
  }
  if (!Reaches(words, encoded, bytes)) return DecodeStatus::kLength;
  for (LocalBody& b : bodies) {
    for (ContactPlane& c : std::span(b.contacts).first(b.contact_count)) {
      ContactPlaneFields(decoder, c);
    }
  }
  return DecodeStatus::kOk;
}

}  // namespace

[[gnu::flatten]] Encoded Encode(const WorldFrame& m, std::span<std::uint64_t> words) noexcept {
  if (m.plane_count > kMaxPlanes) return {};
  const auto planes = std::span(m.planes).first(m.plane_count);
  if (m.local_body_count > kMaxLocalBodies) return {};
  const auto local_bodies = std::span(m.local_bodies).first(m.local_body_count);
  std::uint32_t blocks = local_bodies.empty() ? 0 : kFrameLocalBodies;
  for (const Plane& p : planes) {
    if (p.stiffness != 0 || p.damping != 0) blocks |= kFrameSurfaces;
    if (p.velocity != Vector{}) blocks |= kFrameVelocities;
    if (p.static_friction != 0 || p.dynamic_friction != 0) blocks |= kFrameFriction;
    if (p.recovery_s != 0) blocks |= kFrameRecovery;
    if (p.inverse_mass != kMobilityNotSaid) blocks |= kFrameMobility;
    if (p.radius != 0) blocks |= kFrameRounding;
  }
  std::uint32_t bytes = FrameBytes(m.plane_count, blocks);
  for (const LocalBody& b : local_bodies) {
    if (b.contact_count > kMaxContactPlanes) return {};
    bytes += kLocalBody + b.contact_count * kContactPlane;
  }
  if (bytes > words.size_bytes()) return {};
  Encoder encoder(words);
  WorldFrameHead(encoder, m);
  for (const Plane& p : planes) PlaneFields(encoder, p);
  WalkPlaneBlocks(encoder, planes, blocks);
  if ((blocks & kFrameLocalBodies) != 0) {
    LocalHeadFields(encoder, m);
    for (const LocalBody& b : local_bodies) LocalBodyFields(encoder, b);
    for (const LocalBody& b : local_bodies) {
      encoder.Whole(std::span<const ContactPlane>(b.contacts).first(b.contact_count));
    }
  }
  if ((blocks & kFrameMobility) != 0) {
    for (const Plane& p : planes) PlaneMobilityFields(encoder, p);
  }
  if ((blocks & kFrameRounding) != 0) {
    for (const Plane& p : planes) PlaneRoundingFields(encoder, p);
  }
  return {bytes, blocks};
}

DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded,
                    WorldFrame& message) noexcept {
  if (encoded.used_bytes < kFrameHead || words.size_bytes() < kFrameHead) {
    return DecodeStatus::kLength;
  }
  WorldFrame m;
  Decoder decoder(words);
  WorldFrameHead(decoder, m);
  if (m.plane_count > kMaxPlanes) return DecodeStatus::kCount;
  std::uint32_t bytes = FrameBytes(m.plane_count, encoded.blocks);
  if (!Reaches(words, encoded, bytes)) return DecodeStatus::kLength;
  const auto planes = std::span(m.planes).first(m.plane_count);
  for (Plane& p : planes) PlaneFields(decoder, p);
  WalkPlaneBlocks(decoder, planes, encoded.blocks);
  if ((encoded.blocks & kFrameLocalBodies) != 0) {
    const auto status = DecodeLocalBodies(decoder, words, encoded, m, bytes);
    if (status != DecodeStatus::kOk) return status;
  }
  if ((encoded.blocks & kFrameMobility) != 0) {
    for (Plane& p : planes) PlaneMobilityFields(decoder, p);
  }
  if ((encoded.blocks & kFrameRounding) != 0) {
    for (Plane& p : planes) PlaneRoundingFields(decoder, p);
  }
  if (!LengthAgrees(words, encoded, bytes, kFrameBlocks)) return DecodeStatus::kLength;
  const DecodeStatus status = Validate(m);
  if (status == DecodeStatus::kOk) message = m;
  return status;
}

Encoded Encode(const WorldHealth& m, std::span<std::uint64_t> words) noexcept {
  if (kWorldHealthBytes > words.size_bytes()) return {};
  Encoder encoder(words);
  WorldHealthFields(encoder, m);
  return {kWorldHealthBytes, 0};
}

DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded,
                    WorldHealth& message) noexcept {
  if (!LengthAgrees(words, encoded, kWorldHealthBytes, 0)) return DecodeStatus::kLength;
  WorldHealth m;
  Decoder decoder(words);
  WorldHealthFields(decoder, m);
  const DecodeStatus status = Validate(m);
  if (status == DecodeStatus::kOk) message = m;
  return status;
}

}  // namespace rikiseki::protocol

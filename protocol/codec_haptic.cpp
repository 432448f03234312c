// SPDX-License-Identifier: MIT
// Packs and unpacks what the haptic side says: ticks and health. SPEC.md section 6.
#include <algorithm>

#include "protocol/codec_archive.h"
#include "protocol/validate.h"

namespace rikiseki::protocol {
namespace {

// Encode for the loops is [[gnu::flatten]]: only inlined into it does the archive's offset stay in
// a register, for the bytes written may alias it.

constexpr std::uint32_t kTickHead =
    Measure<HapticTick>([](auto& a, auto& m) { HapticTickHead(a, m); });
constexpr std::uint32_t kPointer = Measure<Pointer>([](auto& a, auto& m) { PointerFields(a, m); });
constexpr std::uint32_t kRotation =
    Measure<Pointer>([](auto& a, auto& m) { PointerRotationFields(a, m); });
constexpr std::uint32_t kChannel = Measure<Channel>([](auto& a, auto& m) { ChannelFields(a, m); });
constexpr std::uint32_t kGround =
    Measure<GroundChannel>([](auto& a, auto& m) { GroundFields(a, m); });
constexpr std::uint32_t kHapticHealth =
    Measure<HapticHealth>([](auto& a, auto& m) { HapticHealthFields(a, m); });
constexpr std::uint32_t kReconciliation =
    Measure<Reconciliation>([](auto& a, auto& m) { ReconciliationFields(a, m); });
constexpr std::uint32_t kEnergy = Measure<Energy>([](auto& a, auto& m) { EnergyFields(a, m); });

static_assert(kHapticTickBytes == kTickHead + kMaxPointers * (kPointer + kRotation) +
                                      kMaxChannels * kChannel + kGround);
static_assert(kHapticHealthBytes == kHapticHealth + kReconciliation + kEnergy);
static_assert(kTickHead % 8 == 0 && kPointer % 8 == 0 && kRotation % 8 == 0 && kChannel % 8 == 0 &&
              kGround % 8 == 0 && kHapticHealth % 8 == 0 && kReconciliation % 8 == 0 &&
              kEnergy % 8 == 0);

std::uint32_t TickBytes(std::uint32_t pointers, std::uint32_t channels, std::uint32_t blocks) {
  return kTickHead + pointers * kPointer + channels * kChannel +
         ((blocks & kTickRotations) != 0 ? pointers * kRotation : 0) +
         ((blocks & kTickGround) != 0 ? kGround : 0);
}

std::uint32_t HealthBytes(std::uint32_t blocks) {
  return kHapticHealth + ((blocks & kHealthReconciliation) != 0 ? kReconciliation : 0) +
         ((blocks & kHealthEnergy) != 0 ? kEnergy : 0);
}

}  // namespace

[[gnu::flatten]] Encoded Encode(const HapticTick& m, std::span<std::uint64_t> words) noexcept {
  if (m.pointer_count > kMaxPointers || m.channel_count > kMaxChannels) return {};
  const auto pointers = std::span(m.pointers).first(m.pointer_count);
  const auto channels = std::span(m.channels).first(m.channel_count);
  const auto turned = [](const Pointer& p) {
    const Pointer still;
    return p.orientation != still.orientation || p.angular_velocity != still.angular_velocity ||
           p.torque != still.torque;
  };
  const GroundChannel nothing;
  std::uint32_t blocks = 0;
  if (std::any_of(pointers.begin(), pointers.end(), turned)) blocks |= kTickRotations;
  if (m.ground.impulse != nothing.impulse || m.ground.angular_impulse != nothing.angular_impulse) {
    blocks |= kTickGround;
  }
  const std::uint32_t bytes = TickBytes(m.pointer_count, m.channel_count, blocks);
  if (bytes > words.size_bytes()) return {};
  Encoder encoder(words);
  HapticTickHead(encoder, m);
  for (const Pointer& p : pointers) PointerFields(encoder, p);
  for (const Channel& c : channels) ChannelFields(encoder, c);
  if ((blocks & kTickRotations) != 0) {
    for (const Pointer& p : pointers) PointerRotationFields(encoder, p);
  }
  if ((blocks & kTickGround) != 0) GroundFields(encoder, m.ground);
  return {bytes, blocks};
}

DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded,
                    HapticTick& message) noexcept {
  if (encoded.used_bytes < kTickHead || words.size_bytes() < kTickHead)
    return DecodeStatus::kLength;
  HapticTick m;
  Decoder decoder(words);
  HapticTickHead(decoder, m);
  if (m.pointer_count > kMaxPointers || m.channel_count > kMaxChannels) return DecodeStatus::kCount;
  const std::uint32_t bytes = TickBytes(m.pointer_count, m.channel_count, encoded.blocks);
  if (!LengthAgrees(words, encoded, bytes, kTickRotations | kTickGround)) {
    return DecodeStatus::kLength;
  }
  const auto pointers = std::span(m.pointers).first(m.pointer_count);
  const auto channels = std::span(m.channels).first(m.channel_count);
  for (Pointer& p : pointers) PointerFields(decoder, p);
  for (Channel& c : channels) ChannelFields(decoder, c);
  if ((encoded.blocks & kTickRotations) != 0) {
    for (Pointer& p : pointers) PointerRotationFields(decoder, p);
  }
  if ((encoded.blocks & kTickGround) != 0) GroundFields(decoder, m.ground);
  const DecodeStatus status = Validate(m);
  if (status == DecodeStatus::kOk) message = m;
  return status;
}

Encoded Encode(const HapticHealth& m, std::span<std::uint64_t> words) noexcept {
  const Energy& e = m.energy;
  std::uint32_t blocks = m.reconciliation.frames != 0 ? kHealthReconciliation : 0;
  if (e.injected != 0 || e.dissipated != 0 || e.flagged != 0 || e.unstable != 0 ||
      e.controller != 0) {
    blocks |= kHealthEnergy;
  }
  const std::uint32_t bytes = HealthBytes(blocks);
  if (bytes > words.size_bytes()) return {};
  Encoder encoder(words);
  HapticHealthFields(encoder, m);
  if ((blocks & kHealthReconciliation) != 0) ReconciliationFields(encoder, m.reconciliation);
  if ((blocks & kHealthEnergy) != 0) EnergyFields(encoder, m.energy);
  return {bytes, blocks};
}

DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded,
                    HapticHealth& message) noexcept {
  if (!LengthAgrees(words, encoded, HealthBytes(encoded.blocks),
                    kHealthReconciliation | kHealthEnergy)) {
    return DecodeStatus::kLength;
  }
  HapticHealth m;
  Decoder decoder(words);
  HapticHealthFields(decoder, m);
  if ((encoded.blocks & kHealthReconciliation) != 0) {
    ReconciliationFields(decoder, m.reconciliation);
  }
  if ((encoded.blocks & kHealthEnergy) != 0) EnergyFields(decoder, m.energy);
  const DecodeStatus status = Validate(m);
  if (status == DecodeStatus::kOk) message = m;
  return status;
}

}  // namespace rikiseki::protocol

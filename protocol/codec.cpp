#include "protocol/codec.h"

#include <algorithm>
#include <cstring>

#include "protocol/fields.h"
#include "protocol/validate.h"

namespace rikiseki::protocol {
namespace {

// Little-endian bytes are this machine's own (asserted in segment.h), so a field is copied as it
// is.

class Encoder {
 public:
  explicit Encoder(std::span<std::uint64_t> words) : bytes_(std::as_writable_bytes(words)) {}

  template <typename T>
  void operator()(const char*, const T& value) {
    std::memcpy(bytes_.data() + offset_, &value, sizeof(T));
    offset_ += sizeof(T);
  }

 private:
  std::span<std::byte> bytes_;
  std::size_t offset_ = 0;
};

class Decoder {
 public:
  explicit Decoder(std::span<const std::uint64_t> words) : bytes_(std::as_bytes(words)) {}

  template <typename T>
  void operator()(const char*, T& value) {
    std::memcpy(&value, bytes_.data() + offset_, sizeof(T));
    offset_ += sizeof(T);
  }

 private:
  std::span<const std::byte> bytes_;
  std::size_t offset_ = 0;
};

/// Sums up how many bytes a record takes.
class Ruler {
 public:
  template <typename T>
  constexpr void operator()(const char*, const T&) {
    bytes_ += static_cast<std::uint32_t>(sizeof(T));
  }
  constexpr std::uint32_t bytes() const { return bytes_; }

 private:
  std::uint32_t bytes_ = 0;
};

template <typename Record, typename Fields>
constexpr std::uint32_t Measure(Fields fields) {
  const Record record{};
  Ruler ruler;
  fields(ruler, record);
  return ruler.bytes();
}

constexpr std::uint32_t kTickHead =
    Measure<HapticTick>([](auto& a, auto& m) { HapticTickHead(a, m); });
constexpr std::uint32_t kPointer = Measure<Pointer>([](auto& a, auto& m) { PointerFields(a, m); });
constexpr std::uint32_t kRotation =
    Measure<Pointer>([](auto& a, auto& m) { PointerRotationFields(a, m); });
constexpr std::uint32_t kChannel = Measure<Channel>([](auto& a, auto& m) { ChannelFields(a, m); });
constexpr std::uint32_t kGround =
    Measure<GroundChannel>([](auto& a, auto& m) { GroundFields(a, m); });
constexpr std::uint32_t kFrameHead =
    Measure<WorldFrame>([](auto& a, auto& m) { WorldFrameHead(a, m); });
constexpr std::uint32_t kPlane = Measure<Plane>([](auto& a, auto& m) { PlaneFields(a, m); });
constexpr std::uint32_t kSurface =
    Measure<Plane>([](auto& a, auto& m) { PlaneSurfaceFields(a, m); });
constexpr std::uint32_t kBodiesHead =
    Measure<WorldBodiesHeadRecord>([](auto& a, auto& m) { WorldBodiesHead(a, m); });
constexpr std::uint32_t kBody = Measure<Body>([](auto& a, auto& m) { BodyFields(a, m); });

static_assert(kHapticTickBytes == kTickHead + kMaxPointers * (kPointer + kRotation) +
                                      kMaxChannels * kChannel + kGround);
static_assert(kWorldFrameBytes == kFrameHead + kMaxPlanes * (kPlane + kSurface));
static_assert(kHapticHealthBytes ==
              Measure<HapticHealth>([](auto& a, auto& m) { HapticHealthFields(a, m); }));
static_assert(kWorldHealthBytes ==
              Measure<WorldHealth>([](auto& a, auto& m) { WorldHealthFields(a, m); }));
static_assert(WorldBodiesBytes(3) == kBodiesHead + 3 * kBody);
static_assert(kTickHead % 8 == 0 && kPointer % 8 == 0 && kRotation % 8 == 0 && kChannel % 8 == 0 &&
              kGround % 8 == 0 && kFrameHead % 8 == 0 && kPlane % 8 == 0 && kSurface % 8 == 0 &&
              kBodiesHead % 8 == 0 && kBody % 8 == 0);

std::uint32_t TickBytes(std::uint32_t pointers, std::uint32_t channels, std::uint32_t blocks) {
  return kTickHead + pointers * kPointer + channels * kChannel +
         ((blocks & kTickRotations) != 0 ? pointers * kRotation : 0) +
         ((blocks & kTickGround) != 0 ? kGround : 0);
}

std::uint32_t FrameBytes(std::uint32_t planes, std::uint32_t blocks) {
  return kFrameHead + planes * kPlane + ((blocks & kFrameSurfaces) != 0 ? planes * kSurface : 0);
}

/// The lengths agree: exactly, or, if blocks of a later version follow, at least.
bool LengthAgrees(std::span<const std::uint64_t> words, Encoded encoded, std::uint32_t known_bytes,
                  std::uint32_t known_blocks) {
  if (known_bytes > words.size_bytes()) return false;
  const bool more_follows = (encoded.blocks & ~known_blocks) != 0;
  return more_follows ? encoded.used_bytes >= known_bytes : encoded.used_bytes == known_bytes;
}

}  // namespace

Encoded Encode(const HapticTick& m, std::span<std::uint64_t> words) noexcept {
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

Encoded Encode(const WorldFrame& m, std::span<std::uint64_t> words) noexcept {
  if (m.plane_count > kMaxPlanes) return {};
  const auto planes = std::span(m.planes).first(m.plane_count);
  const bool surfaces = std::any_of(planes.begin(), planes.end(), [](const Plane& p) {
    return p.stiffness != 0 || p.damping != 0;
  });
  const std::uint32_t blocks = surfaces ? kFrameSurfaces : 0;
  const std::uint32_t bytes = FrameBytes(m.plane_count, blocks);
  if (bytes > words.size_bytes()) return {};
  Encoder encoder(words);
  WorldFrameHead(encoder, m);
  for (const Plane& p : planes) PlaneFields(encoder, p);
  if (surfaces) {
    for (const Plane& p : planes) PlaneSurfaceFields(encoder, p);
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
  const std::uint32_t bytes = FrameBytes(m.plane_count, encoded.blocks);
  if (!LengthAgrees(words, encoded, bytes, kFrameSurfaces)) return DecodeStatus::kLength;
  const auto planes = std::span(m.planes).first(m.plane_count);
  for (Plane& p : planes) PlaneFields(decoder, p);
  if ((encoded.blocks & kFrameSurfaces) != 0) {
    for (Plane& p : planes) PlaneSurfaceFields(decoder, p);
  }
  const DecodeStatus status = Validate(m);
  if (status == DecodeStatus::kOk) message = m;
  return status;
}

Encoded Encode(const HapticHealth& m, std::span<std::uint64_t> words) noexcept {
  if (kHapticHealthBytes > words.size_bytes()) return {};
  Encoder encoder(words);
  HapticHealthFields(encoder, m);
  return {kHapticHealthBytes, 0};
}

DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded,
                    HapticHealth& message) noexcept {
  if (!LengthAgrees(words, encoded, kHapticHealthBytes, 0)) return DecodeStatus::kLength;
  HapticHealth m;
  Decoder decoder(words);
  HapticHealthFields(decoder, m);
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

Encoded Encode(std::span<const Body> bodies, std::span<std::uint64_t> words) noexcept {
  if (bodies.size() > kMaxBodies) return {};
  const auto count = static_cast<std::uint32_t>(bodies.size());
  if (WorldBodiesBytes(count) > words.size_bytes()) return {};
  Encoder encoder(words);
  const WorldBodiesHeadRecord head{count, 0};
  WorldBodiesHead(encoder, head);
  for (const Body& b : bodies) BodyFields(encoder, b);
  return {WorldBodiesBytes(count), 0};
}

DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded, std::span<Body> bodies,
                    std::uint32_t& count) noexcept {
  if (encoded.used_bytes < kBodiesHead || words.size_bytes() < kBodiesHead) {
    return DecodeStatus::kLength;
  }
  WorldBodiesHeadRecord head;
  Decoder decoder(words);
  WorldBodiesHead(decoder, head);
  if (head.body_count > kMaxBodies || head.body_count > bodies.size()) return DecodeStatus::kCount;
  if (!LengthAgrees(words, encoded, WorldBodiesBytes(head.body_count), 0)) {
    return DecodeStatus::kLength;
  }
  for (Body& b : bodies.first(head.body_count)) {
    BodyFields(decoder, b);
    if (const auto status = Validate(b); status != DecodeStatus::kOk) return status;
  }
  count = head.body_count;
  return DecodeStatus::kOk;
}

}  // namespace rikiseki::protocol

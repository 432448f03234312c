#include "protocol/codec.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "protocol/fields.h"
#include "protocol/validate.h"

namespace rikiseki::protocol {
namespace {

// Little-endian bytes are this machine's own (asserted in segment.h), so a field is copied as it
// is.

// Encode for the loops is [[gnu::flatten]]: only inlined into it does the archive's offset stay in
// a register, for the bytes written may alias it.

class Encoder {
 public:
  explicit Encoder(std::span<std::uint64_t> words) : bytes_(std::as_writable_bytes(words)) {}

  template <typename T>
  void operator()(const char*, const T& value) {
    std::memcpy(bytes_.data() + offset_, &value, sizeof(T));
    offset_ += sizeof(T);
  }

  /// Records that lie in memory as on the wire.
  template <typename Record>
  void Whole(std::span<const Record> records) {
    std::memcpy(bytes_.data() + offset_, records.data(), records.size_bytes());
    offset_ += records.size_bytes();
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
constexpr std::uint32_t kHapticHealth =
    Measure<HapticHealth>([](auto& a, auto& m) { HapticHealthFields(a, m); });
constexpr std::uint32_t kReconciliation =
    Measure<Reconciliation>([](auto& a, auto& m) { ReconciliationFields(a, m); });
constexpr std::uint32_t kEnergy = Measure<Energy>([](auto& a, auto& m) { EnergyFields(a, m); });
constexpr std::uint32_t kSceneHead =
    Measure<WorldSceneHeadRecord>([](auto& a, auto& m) { WorldSceneHead(a, m); });
constexpr std::uint32_t kSceneBody =
    Measure<SceneBody>([](auto& a, auto& m) { SceneBodyFields(a, m); });
constexpr std::uint32_t kSceneCollider =
    Measure<SceneCollider>([](auto& a, auto& m) { SceneColliderFields(a, m); });
constexpr std::uint32_t kSceneMesh =
    Measure<SceneMesh>([](auto& a, auto& m) { SceneMeshFields(a, m); });
constexpr std::uint32_t kBodiesHead =
    Measure<WorldBodiesHeadRecord>([](auto& a, auto& m) { WorldBodiesHead(a, m); });
constexpr std::uint32_t kBody = Measure<Body>([](auto& a, auto& m) { BodyFields(a, m); });

static_assert(kHapticTickBytes == kTickHead + kMaxPointers * (kPointer + kRotation) +
                                      kMaxChannels * kChannel + kGround);
static_assert(kWorldFrameBytes ==
              kFrameHead +
                  kMaxPlanes * (kPlane + kSurface + kVelocity + kFriction + kRecovery + kMobility +
                                kRounding) +
                  kLocalHead + kMaxLocalBodies * (kLocalBody + kMaxContactPlanes * kContactPlane));
static_assert(kHapticHealthBytes == kHapticHealth + kReconciliation + kEnergy);
static_assert(WorldSceneBytes(3, 5, 7) ==
              kSceneHead + 3 * kSceneBody + 5 * kSceneCollider + 7 * kSceneMesh);
static_assert(kWorldHealthBytes ==
              Measure<WorldHealth>([](auto& a, auto& m) { WorldHealthFields(a, m); }));
static_assert(WorldBodiesBytes(3) == kBodiesHead + 3 * kBody);
static_assert(kTickHead % 8 == 0 && kPointer % 8 == 0 && kRotation % 8 == 0 && kChannel % 8 == 0 &&
              kGround % 8 == 0 && kFrameHead % 8 == 0 && kPlane % 8 == 0 && kSurface % 8 == 0 &&
              kBodiesHead % 8 == 0 && kBody % 8 == 0 && kVelocity % 8 == 0 && kFriction % 8 == 0 &&
              kRecovery % 8 == 0 && kMobility % 8 == 0 && kRounding % 8 == 0 &&
              kLocalHead % 8 == 0 && kLocalBody % 8 == 0 && kContactPlane % 8 == 0 &&
              kHapticHealth % 8 == 0 && kReconciliation % 8 == 0 && kEnergy % 8 == 0 &&
              kSceneHead % 8 == 0 && kSceneBody % 8 == 0 && kSceneCollider % 8 == 0 &&
              kSceneMesh % 8 == 0);

// Encode copies contact planes in one piece, since the largest frame has 64 of them.
static_assert(sizeof(ContactPlane) == kContactPlane && offsetof(ContactPlane, point) == 8 &&
              offsetof(ContactPlane, normal) == 32 && offsetof(ContactPlane, gap) == 56 &&
              offsetof(ContactPlane, friction) == 64 &&
              offsetof(ContactPlane, other_velocity) == 72 &&
              offsetof(ContactPlane, other_inverse_mass) == 96 &&
              offsetof(ContactPlane, impulse) == 104 && offsetof(ContactPlane, radius) == 128);

std::uint32_t TickBytes(std::uint32_t pointers, std::uint32_t channels, std::uint32_t blocks) {
  return kTickHead + pointers * kPointer + channels * kChannel +
         ((blocks & kTickRotations) != 0 ? pointers * kRotation : 0) +
         ((blocks & kTickGround) != 0 ? kGround : 0);
}

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

std::uint32_t HealthBytes(std::uint32_t blocks) {
  return kHapticHealth + ((blocks & kHealthReconciliation) != 0 ? kReconciliation : 0) +
         ((blocks & kHealthEnergy) != 0 ? kEnergy : 0);
}

/// Both the copy and the message, as it says of itself, reach this far.
bool Reaches(std::span<const std::uint64_t> words, Encoded encoded, std::uint64_t bytes) {
  return bytes <= words.size_bytes() && bytes <= encoded.used_bytes;
}

/// The lengths agree: exactly, or, if blocks of a later version follow, at least.
bool LengthAgrees(std::span<const std::uint64_t> words, Encoded encoded, std::uint32_t known_bytes,
                  std::uint32_t known_blocks) {
  if (known_bytes > words.size_bytes()) return false;
  const bool more_follows = (encoded.blocks & ~known_blocks) != 0;
  return more_follows ? encoded.used_bytes >= known_bytes : encoded.used_bytes == known_bytes;
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

namespace {

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

namespace {

std::size_t MeshCount(std::span<const SceneCollider> colliders) {
  return static_cast<std::size_t>(
      std::count_if(colliders.begin(), colliders.end(),
                    [](const SceneCollider& c) { return c.shape == ShapeType::kMesh; }));
}

std::uint64_t ColliderCount(std::span<const SceneBody> bodies) {
  std::uint64_t count = 0;
  for (const SceneBody& body : bodies) count += body.collider_count;
  return count;
}

}  // namespace

Encoded Encode(const WorldScene& m, std::span<std::uint64_t> words) noexcept {
  if (m.bodies.size() > kMaxBodies || m.colliders.size() > kMaxColliders ||
      ColliderCount(m.bodies) != m.colliders.size() || MeshCount(m.colliders) != m.meshes.size()) {
    return {};
  }
  const WorldSceneHeadRecord head{
      m.revision,
      m.needs,
      m.left_out,
      m.gravity,
      m.name,
      static_cast<std::uint32_t>(m.bodies.size()),
      static_cast<std::uint32_t>(m.colliders.size()),
  };
  const std::uint32_t bytes = WorldSceneBytes(head.body_count, head.collider_count,
                                              static_cast<std::uint32_t>(m.meshes.size()));
  if (bytes > words.size_bytes()) return {};
  Encoder encoder(words);
  WorldSceneHead(encoder, head);
  for (const SceneBody& b : m.bodies) SceneBodyFields(encoder, b);
  for (const SceneCollider& c : m.colliders) SceneColliderFields(encoder, c);
  for (const SceneMesh& mesh : m.meshes) SceneMeshFields(encoder, mesh);
  return {bytes, m.meshes.empty() ? 0 : kSceneMeshes};
}

DecodeStatus Decode(std::span<const std::uint64_t> words, Encoded encoded, WorldScene& message) {
  if (!Reaches(words, encoded, kSceneHead)) return DecodeStatus::kLength;
  WorldSceneHeadRecord head;
  Decoder decoder(words);
  WorldSceneHead(decoder, head);
  if (head.body_count > kMaxBodies || head.collider_count > kMaxColliders) {
    return DecodeStatus::kCount;
  }
  std::uint32_t bytes = WorldSceneBytes(head.body_count, head.collider_count, 0);
  if (!Reaches(words, encoded, bytes)) return DecodeStatus::kLength;
  WorldScene m;
  m.revision = head.revision;
  m.needs = head.needs;
  m.left_out = head.left_out;
  m.gravity = head.gravity;
  m.name = head.name;
  m.bodies.resize(head.body_count);
  for (SceneBody& b : m.bodies) SceneBodyFields(decoder, b);
  if (ColliderCount(m.bodies) != head.collider_count) return DecodeStatus::kCount;
  m.colliders.resize(head.collider_count);
  for (SceneCollider& c : m.colliders) SceneColliderFields(decoder, c);
  const std::size_t meshes = MeshCount(m.colliders);
  if ((encoded.blocks & kSceneMeshes) != 0)
    bytes += static_cast<std::uint32_t>(meshes) * kSceneMesh;
  if (!LengthAgrees(words, encoded, bytes, kSceneMeshes)) return DecodeStatus::kLength;
  m.meshes.resize(meshes);
  if ((encoded.blocks & kSceneMeshes) != 0) {
    for (SceneMesh& mesh : m.meshes) SceneMeshFields(decoder, mesh);
  }
  const DecodeStatus status = Validate(m);
  if (status == DecodeStatus::kOk) message = std::move(m);
  return status;
}

}  // namespace rikiseki::protocol

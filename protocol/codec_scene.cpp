// SPDX-License-Identifier: MIT
// Packs and unpacks what observers want to know of the world: its scene and its bodies. SPEC.md section 6.
#include <algorithm>
#include <utility>

#include "protocol/codec_archive.h"
#include "protocol/validate.h"

namespace rikiseki::protocol {
namespace {

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

static_assert(WorldSceneBytes(3, 5, 7) ==
              kSceneHead + 3 * kSceneBody + 5 * kSceneCollider + 7 * kSceneMesh);
static_assert(WorldBodiesBytes(3) == kBodiesHead + 3 * kBody);
static_assert(kSceneHead % 8 == 0 && kSceneBody % 8 == 0 && kSceneCollider % 8 == 0 &&
              kSceneMesh % 8 == 0 && kBodiesHead % 8 == 0 && kBody % 8 == 0);

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

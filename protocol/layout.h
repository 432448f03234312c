// SPDX-License-Identifier: MIT
// The layout as text, one line a field: "record.field:type:offset:bytes". Its hash stands in every
// segment header, so that a changed layout under an unchanged version is refused. SPEC.md 8.3.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "protocol/codec.h"
#include "protocol/fields.h"
#include "protocol/segment.h"

namespace rikiseki::protocol {

/// A sink of the layout text that keeps only its FNV-1a-64.
class LayoutHasher {
 public:
  constexpr void operator()(char character) {
    hash_ = (hash_ ^ static_cast<unsigned char>(character)) * 0x100000001B3ULL;
  }
  constexpr std::uint64_t hash() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xCBF29CE484222325ULL;
};

/// Writes one line per field into `sink`, counting offsets by itself: an archive for fields.h.
template <typename Sink>
class LayoutWriter {
 public:
  constexpr LayoutWriter(Sink& sink, std::string_view record) : sink_(&sink), record_(record) {}

  template <typename T>
  constexpr void operator()(std::string_view name, const T&) {
    Line<T>(name, offset_);
  }

  /// A field whose offset the compiler knows.
  template <typename T>
  constexpr void Line(std::string_view name, std::size_t offset) {
    Text(record_);
    Text(".");
    Text(name);
    Text(":");
    Type<T>();
    Text(":");
    Number(offset);
    Text(":");
    Number(sizeof(T));
    Text("\n");
    offset_ = offset + sizeof(T);
  }

  constexpr std::size_t offset() const { return offset_; }

 private:
  constexpr void Text(std::string_view text) {
    for (const char character : text) (*sink_)(character);
  }
  constexpr void Number(std::size_t number) {
    if (number >= 10) Number(number / 10);
    (*sink_)(static_cast<char>('0' + number % 10));
  }
  template <typename T>
  constexpr void Type() {
    if constexpr (std::is_array_v<T>) {
      Repeated<std::remove_extent_t<T>>(std::extent_v<T>);
    } else if constexpr (requires(T t) { std::tuple_size<T>::value; }) {
      Repeated<typename T::value_type>(std::tuple_size_v<T>);
    } else if constexpr (std::is_enum_v<T>) {
      Type<std::underlying_type_t<T>>();
    } else if constexpr (std::is_same_v<T, char>) {
      Text("char");
    } else if constexpr (std::floating_point<T>) {
      Text("f64");
    } else {
      static_assert(std::integral<T>);
      Text(std::is_signed_v<T> ? "i" : "u");
      Number(8 * sizeof(T));
    }
  }
  template <typename Element>
  constexpr void Repeated(std::size_t count) {
    Type<Element>();
    Text("[");
    Number(count);
    Text("]");
  }

  Sink* sink_;
  std::string_view record_;
  std::size_t offset_ = 0;
};

/// Writes the whole layout. Appending a line raises the minor version, changing one the major.
template <typename Sink>
constexpr void WriteLayout(Sink& sink) {
#define RIKISEKI_FIELD(Struct, field) \
  writer.template Line<decltype(Struct::field)>(#field, offsetof(Struct, field))
  {
    LayoutWriter<Sink> writer(sink, "segment_header");
    RIKISEKI_FIELD(SegmentHeader, magic);
    RIKISEKI_FIELD(SegmentHeader, byte_order);
    RIKISEKI_FIELD(SegmentHeader, version_major);
    RIKISEKI_FIELD(SegmentHeader, version_minor);
    RIKISEKI_FIELD(SegmentHeader, layout_hash);
    RIKISEKI_FIELD(SegmentHeader, header_bytes);
    RIKISEKI_FIELD(SegmentHeader, stream_count);
    RIKISEKI_FIELD(SegmentHeader, segment_bytes);
    RIKISEKI_FIELD(SegmentHeader, epoch);
    RIKISEKI_FIELD(SegmentHeader, role);
    RIKISEKI_FIELD(SegmentHeader, writer_pid);
    RIKISEKI_FIELD(SegmentHeader, build);
    RIKISEKI_FIELD(SegmentHeader, state);
    RIKISEKI_FIELD(SegmentHeader, heartbeat_ns);
    RIKISEKI_FIELD(SegmentHeader, tick);
    RIKISEKI_FIELD(SegmentHeader, fault_code);
    RIKISEKI_FIELD(SegmentHeader, overruns);
    RIKISEKI_FIELD(SegmentHeader, lapped);
    RIKISEKI_FIELD(SegmentHeader, read_retries);
    RIKISEKI_FIELD(SegmentHeader, rejected);
    RIKISEKI_FIELD(SegmentHeader, gaps);
  }
  {
    LayoutWriter<Sink> writer(sink, "stream_entry");
    RIKISEKI_FIELD(StreamEntry, type_id);
    RIKISEKI_FIELD(StreamEntry, type_version);
    RIKISEKI_FIELD(StreamEntry, flags);
    RIKISEKI_FIELD(StreamEntry, cursor_offset);
    RIKISEKI_FIELD(StreamEntry, ring_offset);
    RIKISEKI_FIELD(StreamEntry, slot_stride);
    RIKISEKI_FIELD(StreamEntry, slot_count);
    RIKISEKI_FIELD(StreamEntry, payload_bytes);
    RIKISEKI_FIELD(StreamEntry, period_ns);
  }
  {
    LayoutWriter<Sink> writer(sink, "slot_header");
    RIKISEKI_FIELD(SlotHeader, sequence);
    RIKISEKI_FIELD(SlotHeader, stamp_ns);
    RIKISEKI_FIELD(SlotHeader, used_bytes);
    RIKISEKI_FIELD(SlotHeader, blocks);
  }
#undef RIKISEKI_FIELD
  const auto record = [&sink](std::string_view name, auto&& fields, const auto& value) {
    LayoutWriter<Sink> writer(sink, name);
    fields(writer, value);
  };
  const auto tick = [](auto& a, const HapticTick& m) { HapticTickHead(a, m); };
  const auto pointer = [](auto& a, const Pointer& p) { PointerFields(a, p); };
  const auto rotation = [](auto& a, const Pointer& p) { PointerRotationFields(a, p); };
  const auto channel = [](auto& a, const Channel& c) { ChannelFields(a, c); };
  const auto ground = [](auto& a, const GroundChannel& g) { GroundFields(a, g); };
  const auto frame = [](auto& a, const WorldFrame& m) { WorldFrameHead(a, m); };
  const auto plane = [](auto& a, const Plane& p) { PlaneFields(a, p); };
  const auto surface = [](auto& a, const Plane& p) { PlaneSurfaceFields(a, p); };
  const auto velocity = [](auto& a, const Plane& p) { PlaneVelocityFields(a, p); };
  const auto friction = [](auto& a, const Plane& p) { PlaneFrictionFields(a, p); };
  const auto recovery = [](auto& a, const Plane& p) { PlaneRecoveryFields(a, p); };
  const auto mobility = [](auto& a, const Plane& p) { PlaneMobilityFields(a, p); };
  const auto rounding = [](auto& a, const Plane& p) { PlaneRoundingFields(a, p); };
  const auto local_head = [](auto& a, const WorldFrame& m) { LocalHeadFields(a, m); };
  const auto local_body = [](auto& a, const LocalBody& b) { LocalBodyFields(a, b); };
  const auto contact = [](auto& a, const ContactPlane& c) { ContactPlaneFields(a, c); };
  const auto reconciliation = [](auto& a, const Reconciliation& r) { ReconciliationFields(a, r); };
  const auto energy = [](auto& a, const Energy& e) { EnergyFields(a, e); };
  const auto scene = [](auto& a, const WorldSceneHeadRecord& h) { WorldSceneHead(a, h); };
  const auto scene_body = [](auto& a, const SceneBody& b) { SceneBodyFields(a, b); };
  const auto collider = [](auto& a, const SceneCollider& c) { SceneColliderFields(a, c); };
  const auto mesh = [](auto& a, const SceneMesh& m) { SceneMeshFields(a, m); };
  const auto haptic_health = [](auto& a, const HapticHealth& m) { HapticHealthFields(a, m); };
  const auto world_health = [](auto& a, const WorldHealth& m) { WorldHealthFields(a, m); };
  const auto bodies = [](auto& a, const WorldBodiesHeadRecord& h) { WorldBodiesHead(a, h); };
  const auto body = [](auto& a, const Body& b) { BodyFields(a, b); };
  record("haptic.tick", tick, HapticTick{});
  record("haptic.tick/pointer", pointer, Pointer{});
  record("haptic.tick/channel", channel, Channel{});
  record("haptic.tick/pointer_rotation", rotation, Pointer{});
  record("haptic.tick/ground", ground, GroundChannel{});
  record("haptic.health", haptic_health, HapticHealth{});
  record("haptic.health/reconciliation", reconciliation, Reconciliation{});
  record("haptic.health/energy", energy, Energy{});
  record("world.frame", frame, WorldFrame{});
  record("world.frame/plane", plane, Plane{});
  record("world.frame/plane_surface", surface, Plane{});
  record("world.frame/plane_velocity", velocity, Plane{});
  record("world.frame/plane_friction", friction, Plane{});
  record("world.frame/plane_recovery", recovery, Plane{});
  record("world.frame/local", local_head, WorldFrame{});
  record("world.frame/local_body", local_body, LocalBody{});
  record("world.frame/contact_plane", contact, ContactPlane{});
  record("world.frame/plane_mobility", mobility, Plane{});
  record("world.frame/plane_rounding", rounding, Plane{});
  record("world.health", world_health, WorldHealth{});
  record("world.bodies", bodies, WorldBodiesHeadRecord{});
  record("world.bodies/body", body, Body{});
  record("world.scene", scene, WorldSceneHeadRecord{});
  record("world.scene/body", scene_body, SceneBody{});
  record("world.scene/collider", collider, SceneCollider{});
  record("world.scene/mesh", mesh, SceneMesh{});
}

constexpr std::uint64_t LayoutHash() {
  LayoutHasher hasher;
  WriteLayout(hasher);
  return hasher.hash();
}

}  // namespace rikiseki::protocol

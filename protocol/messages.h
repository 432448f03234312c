// SPDX-License-Identifier: MIT
// What the streams say: the messages as their reader and writer hold them in memory. codec.h packs
// them into slots; SPEC.md section 6 gives the bytes. SI units, right-handed world axes W,
// CLOCK_MONOTONIC ns.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

namespace rikiseki::protocol {

inline constexpr std::uint32_t kMaxPointers = 4;
inline constexpr std::uint32_t kMaxChannels = 16;
inline constexpr std::uint32_t kMaxPlanes = 32;
inline constexpr std::uint32_t kMaxLocalBodies = 4;
inline constexpr std::uint32_t kMaxContactPlanes = 16;  // of one local body
inline constexpr std::uint32_t kMaxBodies = 10000;
inline constexpr std::uint32_t kMaxColliders = 20000;
inline constexpr std::uint32_t kHistogramBuckets = 256;

/// Impulses travel as int64 multiples of this: N s (linear) and N m s (angular). SPEC.md 7.1.
inline constexpr double kImpulseUnit = 1e-12;

using Vector = std::array<double, 3>;
using Quaternion = std::array<double, 4>;  // w x y z, unit
using ImpulseUnits = std::array<std::int64_t, 3>;

enum class StreamType : std::uint32_t {
  kHapticTick = 1,
  kHapticHealth = 2,
  kWorldFrame = 16,
  kWorldHealth = 17,
  kWorldBodies = 18,
  kWorldScene = 19,
};

/// How often a stream's payload has grown since its first version. SPEC.md 3.2, 8.1.
constexpr std::uint16_t TypeVersion(StreamType type) {
  if (type == StreamType::kWorldFrame) return 4;
  return type == StreamType::kHapticHealth ? 3 : 1;
}

/// Why the displayed force is what it is. The numbers are wire format: append only.
enum class ForceReason : std::uint32_t {
  kNoContact = 0,       // nothing is touched
  kContact = 1,         // the force as rendered
  kCapped = 2,          // the force cap was reached
  kSlewLimited = 3,     // the force may not change faster
  kTensionLimited = 4,  // the strings cannot show the wanted force here
  kSoftStart = 5,       // growing again after the world came (back)
  kWorldLate = 6,       // no fresh frame: the surfaces are held
  kWorldLost = 7,       // the world fell silent: ramping to zero
  kWorldAbsent = 8,     // no world is attached: zero
  kOverSpeed = 9,       // the finger is faster than the limit
  kNotFinite = 10,      // a sample or a result was not a finite number: zero
  kNoChannel = 11,      // no free impulse channel for a contact: not displayed
  kDeviceFault = 12,    // the device does not answer: zero
  kLoopFault = 13,      // too many deadlines missed in a row: zero until re-armed
  kStopped = 14,        // the daemon is stopping: released
  kEmergencyStop = 15,  // stopped by an operator or the device's enable input: zero until enabled
  kPassivity = 16,      // as rendered, and the passivity controller brakes
  kClutched = 17,       // the finger is disengaged from the world: zero
};

/// How impulses act on the world, chosen by the world. design decision 3.
enum class Coupling : std::uint32_t { kPosition = 1, kImpulse = 2, kLocal = 3 };

// ---------------------------------------------------------------------------------------------------
// haptic.tick

/// One finger, as the device measured it at the start of the tick.
struct Pointer {
  std::uint32_t pointer = 0;  // 0..3
  ForceReason reason = ForceReason::kNoContact;
  double radius = 0;  // m, of the finger sphere
  Vector position{};  // m, centre of the sphere, in W
  Quaternion orientation{1, 0, 0, 0};
  Vector velocity{};          // m/s
  Vector angular_velocity{};  // rad/s
  Vector force{};             // N, displayed on the *user*, after every limit
  Vector torque{};            // N m
};

enum class ChannelState : std::uint32_t { kOpen = 1, kClosed = 2 };

/// The cumulative impulse of one pointer on one body since the channel opened. SPEC.md section 7.
struct Channel {
  std::uint32_t body = 0;
  std::uint32_t generation = 0;
  std::uint32_t pointer = 0;
  ChannelState state = ChannelState::kOpen;
  std::uint64_t opened_tick = 0;
  ImpulseUnits impulse{};          // J, on the *body*, in W
  ImpulseUnits angular_impulse{};  // L, about the world origin
  Vector first_moment{};           // S = sum J dt, N s^2
  Vector angular_first_moment{};   // N m s^2
  Vector contact_point{};          // m, of the latest contact
};

/// Displayed force that belongs to no body. numerics: channel `ground`.
struct GroundChannel {
  ImpulseUnits impulse{};
  ImpulseUnits angular_impulse{};
};

/// One tick of the haptic loop. Full state, never an event: a reader that missed any number loses
/// nothing.
struct HapticTick {
  std::uint64_t tick = 0;                  // k, from 0, counts performed ticks of this epoch
  std::uint64_t start_ns = 0;              // t_k, when the finger was measured
  std::uint64_t period_ns = 0;             // nominal; totals run to t_k + period_ns
  std::uint64_t previous_duration_ns = 0;  // the true t_k - t_(k-1), which corrects the tick before
  std::uint64_t world_epoch = 0;           // whose frame was displayed; 0 = none
  std::uint64_t world_frame = 0;           // its number n
  double stiffness = 0;                    // N/m, where a surface brings none of its own
  double damping = 0;                      // N s/m
  double force_cap = 0;                    // N, no displayed force exceeds it
  std::uint32_t pointer_count = 0;
  std::uint32_t channel_count = 0;
  std::array<Pointer, kMaxPointers> pointers{};
  std::array<Channel, kMaxChannels> channels{};  // those in use; their place means nothing
  GroundChannel ground{};
};

// ---------------------------------------------------------------------------------------------------
// world.frame

/// A world that does not say whether a body can move.
inline constexpr double kMobilityNotSaid = -1;

/// A contact plane of one pointer: the tangent plane at a body's nearest point, normal towards the
/// finger.
struct Plane {
  std::uint32_t pointer = 0;
  std::uint32_t body = 0;
  std::uint32_t generation = 0;
  std::uint32_t feature = 0;    // identity within the body: interpolation pairs equal ones
  Vector point{};               // m, on the surface, in W
  Vector normal{};              // unit, out of the body
  double stiffness = 0;         // N/m of this surface; 0 = the haptic side's own
  double damping = 0;           // N s/m; used only where stiffness > 0
  Vector velocity{};            // m/s, of the body's material at `point`, which friction needs
  double static_friction = 0;   // of the finger on this surface, Coulomb
  double dynamic_friction = 0;  // likewise; 0 = none
  double recovery_s = 0;  // how long its force takes to come and go; 0 = the haptic side's own
  double inverse_mass = kMobilityNotSaid;  // 1/kg, how the body yields there along the normal; 0 =
                                           // it cannot move
  double radius =
      0;  // m: the surface there is a ball of this radius, whose centre is point - radius
          // * normal; 0 = nothing is said, it is flat
};

/// Where a local body touches, or may touch before the next frame, something else than the finger.
struct ContactPlane {
  std::uint32_t other_body = 0;  // whose surface it is
  std::uint32_t other_generation = 0;
  Vector point{};           // m, of the local body, in its frame B
  Vector normal{};          // unit, in W, out of the other body
  double gap = 0;           // m, along the normal at the pose of this frame, beyond the depth at
                            // which the world lets bodies rest; < 0 = penetration
  double friction = 0;      // Coulomb, of the pair
  Vector other_velocity{};  // m/s, of the other body at the point
  double other_inverse_mass = 0;  // 1/kg, how the other body yields there; 0 = it does not
  Vector impulse{};  // N s, in W, on the local body in the last substep: warms the solver up
  double radius =
      0;  // m: `point` is the centre of a rounding, contact is at point - radius * normal
};

/// A body that the haptic side moves by itself between two frames. design decision 3, `local`.
struct LocalBody {
  std::uint32_t body = 0;
  std::uint32_t generation = 0;
  std::uint32_t contact_count = 0;
  std::uint32_t reserved = 0;
  double mass = 1;  // kg
  std::array<double, 6> inertia{1, 0, 0,
                                1, 0, 1};  // kg m^2, xx xy xz yy yz zz, about the centre, in B
  Vector position{};                       // m, centre of mass, in W
  Quaternion orientation{1, 0, 0, 0};
  Vector velocity{};              // m/s
  Vector angular_velocity{};      // rad/s
  Vector acceleration{};          // m/s^2, by what does not answer the push: gravity, drag
  Vector angular_acceleration{};  // rad/s^2, likewise
  std::array<ContactPlane, kMaxContactPlanes> contacts{};
};

/// One world frame: "includes everything up to tick `acked_tick` of haptic epoch `acked_epoch`".
struct WorldFrame {
  std::uint64_t frame = 0;          // n, from 1
  std::uint64_t world_time_ns = 0;  // simulated time
  std::uint64_t period_ns = 0;      // nominal, to the next frame
  std::uint64_t acked_epoch = 0;    // 0 = no haptic side seen
  std::uint64_t acked_tick = 0;
  std::uint64_t baseline_tick = 0;  // first tick seen of that epoch: counted from there
  ImpulseUnits applied{};           // of the linear channel totals since the baseline
  ImpulseUnits discarded{};         // declared not applied, likewise
  Coupling coupling = Coupling::kImpulse;
  std::uint32_t plane_count = 0;
  std::array<Plane, kMaxPlanes> planes{};
  std::uint32_t local_body_count = 0;
  std::uint32_t local_reserved = 0;
  std::uint64_t local_substep_ns = 0;  // of the world's solver: what the impulses are about
  std::array<LocalBody, kMaxLocalBodies> local_bodies{};
};

// ---------------------------------------------------------------------------------------------------
// observer streams

/// Log-linear counts of a duration; common/histogram.h gives the edges, SPEC.md 6.3 the formula.
using Histogram = std::array<std::uint64_t, kHistogramBuckets>;

/// How the scheduler runs a loop: what was obtained, not what was asked.
struct Scheduling {
  std::uint32_t policy = 0;    // SCHED_* of sched.h
  std::uint32_t priority = 0;  // of a real-time policy, else 0
  std::uint32_t memory_locked = 0;
  std::uint32_t cpu = std::numeric_limits<std::uint32_t>::max();  // pinned to; max = not pinned
};

enum class PeerState : std::uint32_t {
  kAbsent = 0,
  kWaiting = 1,  // attached, not yet three fresh messages
  kLive = 2,
  kLate = 3,
  kLost = 4,
  kIncompatible = 5,
};

/// The haptic side's books: linear impulse, body channels only, since this process started.
/// Invariant: displayed = covered + peer_lost + pending, and covered = applied + discarded.
struct Books {
  ImpulseUnits displayed{};
  ImpulseUnits ground{};
  ImpulseUnits covered{};    // by the acks of published world frames
  ImpulseUnits applied{};    // of it, what the worlds say they applied
  ImpulseUnits discarded{};  // of it, what the worlds say they discarded
  ImpulseUnits peer_lost{};  // displayed to a world that died before it acked
};

/// How well local bodies agree with the world's frames.
struct Reconciliation {
  std::uint64_t frames = 0;  // that moved a local body
  double newest_jump = 0;    // m, by the newest of them
  double largest_jump = 0;   // m, since the start
};

/// What the energy meter of the haptic side finds, at the device. numerics 2.
struct Energy {
  double injected = 0;  // J, given to the hand beyond the work of bodies that moved; < 0: absorbed
  double dissipated = 0;         // J, by the device's own friction
  std::uint64_t flagged = 0;     // how often a contact was found unstable
  std::uint32_t unstable = 0;    // 1: the present contact is
  std::uint32_t controller = 0;  // 1: the passivity controller brakes now
};

struct HapticHealth {
  std::uint64_t ticks = 0;
  std::uint64_t period_ns = 0;
  std::uint64_t missed = 0;  // deadlines
  std::uint64_t worst_missed_in_a_row = 0;
  std::uint64_t reason_ticks = 0;  // since the reason last changed
  ForceReason reason = ForceReason::kWorldAbsent;
  PeerState peer_state = PeerState::kAbsent;
  std::uint64_t peer_epoch = 0;
  std::uint64_t feature_age_ns = 0;  // of the newest frame
  std::uint64_t zero_force_after_ns =
      0;                          // stated bound: from the last frame of a dead world to zero
  double largest_force = 0;       // N, since the start
  double largest_force_step = 0;  // N, between two ticks
  double slew_limit = 0;          // N/s
  Vector target{};                // m, where the simulated hand wants to be; else the finger
  Scheduling scheduling{};
  Books books{};
  std::uint64_t minor_faults = 0;  // of the loop's thread, since it runs
  std::uint64_t major_faults = 0;
  std::array<char, 32> device{};  // name, NUL padded
  Histogram lateness{};           // of the wake-up against the schedule, ns
  Histogram duration{};           // of the tick's work, ns
  Reconciliation reconciliation{};
  Energy energy{};
};

/// Why a world did not apply an impulse.
enum class DiscardReason : std::uint32_t {
  kGap = 0,           // beyond the cap after a stall, or beyond the finger's work
  kCoupling = 1,      // `position` does not use impulses
  kForeignWorld = 2,  // displayed against another world's frame
  kUnknownBody = 3,   // no such body, an old generation, or one that cannot move
};
inline constexpr std::uint32_t kDiscardReasons = 4;

struct WorldHealth {
  std::uint64_t frames = 0;
  std::uint64_t period_ns = 0;
  std::uint64_t missed = 0;
  std::uint64_t lapped = 0;  // haptic ticks that were overwritten before they were read
  PeerState peer_state = PeerState::kAbsent;
  Coupling coupling = Coupling::kImpulse;
  std::uint64_t peer_epoch = 0;
  ImpulseUnits applied{};  // over the life of this world
  std::array<ImpulseUnits, kDiscardReasons> discarded{};
  Vector penalty_impulse{};  // N s given to bodies by `position`, which knows no channel
  std::uint64_t moving_bodies = 0;
  std::uint64_t resets = 0;  // reloads of the scene
  Scheduling scheduling{};
  std::array<char, 64> scene{};  // name, NUL padded
  Histogram lateness{};
  Histogram duration{};
};

struct Body {
  std::uint32_t body = 0;
  std::uint32_t generation = 0;
  double mass = 0;    // kg; 0 = fixed
  Vector position{};  // m, centre of mass, in W
  Quaternion orientation{1, 0, 0, 0};
  Vector velocity{};
  Vector angular_velocity{};
};

/// What a scene needs; a part that it does not need is left out of solver, messages and tick.
/// design decision 11. Bits of WorldScene::needs and left_out.
enum SceneNeed : std::uint64_t {
  kNeedMovingBodies = 1,
  kNeedBodyContacts = 2,  // among moving bodies
  kNeedFriction = 4,
  kNeedRotation = 8,
  kNeedDrag = 16,
  kNeedFastBodies = 32,
  kNeedDeformation = 64,
  kNeedLocalBodies = 128,
};
inline constexpr std::uint64_t kAllSceneNeeds = 255;

enum class ShapeType : std::uint32_t {
  kBox = 1,        // half extents x y z
  kSphere = 2,     // radius
  kHalfSpace = 3,  // unit normal out of the solid, which ends at the origin of the shape
  kCylinder = 4,   // radius, half length along z
  kCapsule = 5,    // radius, half length along z without the caps
  kEllipsoid = 6,  // radii x y z
  kMesh = 7,       // scale x y z
};

struct SceneCollider {
  ShapeType shape = ShapeType::kBox;
  std::uint32_t reserved = 0;
  Vector dimensions{};  // m, by shape; 0 where the shape has fewer
  Vector position{};    // m, in the body's frame B
  Quaternion orientation{1, 0, 0, 0};
  std::array<double, 4> colour{0.7, 0.7, 0.7, 1};  // red green blue alpha, 0..1
};

struct SceneBody {
  std::uint32_t body = 0;
  std::uint32_t generation = 0;
  std::uint32_t fixed = 0;  // 1: cannot move
  std::uint32_t collider_count = 0;
  std::array<char, 64> name{};  // NUL padded
};

/// Where the triangles of a mesh collider are.
struct SceneMesh {
  std::array<std::uint8_t, 32> sha256{};  // of the file's bytes
  std::array<char, 224> path{};           // NUL padded
};

/// What does not change while a scene runs: for observers that draw it.
struct WorldScene {
  std::uint64_t revision = 0;  // from 1, grows with every load
  std::uint64_t needs = 0;     // bits of SceneNeed; in neither = not worked out
  std::uint64_t left_out = 0;
  Vector gravity{};             // m/s^2
  std::array<char, 64> name{};  // NUL padded
  std::vector<SceneBody> bodies;
  std::vector<SceneCollider> colliders;  // of the first body, then of the second, ...
  std::vector<SceneMesh> meshes;         // of each collider of shape kMesh, in their order
};

static_assert(sizeof(Pointer) == 168 && sizeof(Channel) == 144 && sizeof(Plane) == 144);
static_assert(sizeof(ContactPlane) == 136 && sizeof(LocalBody) == 224 + 16 * 136);
static_assert(sizeof(Body) == 120 && sizeof(SceneCollider) == 120 && sizeof(SceneBody) == 80 &&
              sizeof(SceneMesh) == 256);
static_assert(std::is_trivially_copyable_v<HapticTick> && std::is_trivially_copyable_v<WorldFrame>);
static_assert(std::is_trivially_copyable_v<HapticHealth> &&
              std::is_trivially_copyable_v<WorldHealth>);

}  // namespace rikiseki::protocol

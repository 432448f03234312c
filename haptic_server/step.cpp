#include "haptic_server/step.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "common/clock.h"
#include "haptic_server/device/mapping.h"
#include "haptic_server/render/contact_solve.h"
#include "haptic_server/render/feature_track.h"
#include "haptic_server/render/ledger.h"
#include "haptic_server/render/local_bodies.h"
#include "haptic_server/render/surface_force.h"
#include "haptic_server/render/surface_motion.h"
#include "haptic_server/safety/emergency_stop.h"
#include "haptic_server/safety/energy_meter.h"
#include "haptic_server/safety/peer_watch.h"
#include "haptic_server/safety/safety_stage.h"
#include "haptic_server/safety/split_energy.h"

namespace rikiseki::haptic {
namespace {

using protocol::ForceReason;
using protocol::PeerState;

constexpr std::uint32_t kPointer = 0;
constexpr std::int64_t kShortestFrameNs = 1'000;
constexpr std::uint64_t kLongestFrameNs = 10'000'000'000;

// The acks of frames lie a few world periods back; a world that stalls for seconds resumes with new
// ticks.
std::uint64_t HistoryTicks(const Settings& settings) {
  const double world_period_s = settings.loop.longest_world_period_ms * 1e-3;
  return static_cast<std::uint64_t>(8 * world_period_s * settings.loop.rate_hz) + 4096;
}

// A frame that is four world periods old is of a world that is all but lost.
std::uint64_t ReplayTicks(const Settings& settings) {
  const double world_period_s = settings.loop.longest_world_period_ms * 1e-3;
  return static_cast<std::uint64_t>(4 * world_period_s * settings.loop.rate_hz) + 64;
}

bool IsSound(const DeviceSample& sample) {
  return sample.position.allFinite() && sample.velocity.allFinite() &&
         sample.position.cwiseAbs().maxCoeff() <= kLargestCoordinate;
}

Vec3 Sum(std::span<const BodyShare> shares) {
  Vec3 sum = Vec3::Zero();
  for (const BodyShare& share : shares) sum += share.force;
  return sum;
}

// How much of `whole` is left in `part`, 0..1.
double Fraction(const Vec3& part, const Vec3& whole) {
  const double square = whole.squaredNorm();
  return square > 0 && std::isfinite(square) ? std::clamp(part.dot(whole) / square, 0.0, 1.0) : 0;
}

// Denormal numbers mean nothing in metres and cost a slow path in the processor.
void FlushDenormals(Vec3& v) {
  for (double& x : v) {
    if (std::abs(x) < std::numeric_limits<double>::min()) x = 0;
  }
}

}  // namespace

struct HapticStep::State {
  State(const Settings& checked, Device& used_device, std::uint64_t own_epoch)
      : settings(checked),
        period_ns(checked.period_ns()),
        radius(checked.render.finger_radius_mm * 1e-3),
        device(used_device),
        mapping(checked.mapping),
        track(checked.render.display, period_ns),
        copies(period_ns, ReplayTicks(checked), own_epoch, checked.render.position_rule),
        surface_force(checked.render, Seconds(period_ns)),
        ledger(period_ns, HistoryTicks(checked), own_epoch),
        peer(checked),
        safety(checked),
        energy(checked),
        split({.stiffness_n_per_m = checked.render.stiffness_n_per_m, .finger_radius_m = radius},
              ReplayTicks(checked), own_epoch) {
    health.period_ns = static_cast<std::uint64_t>(period_ns);
    health.slew_limit = checked.safety.slew_limit_n_per_s * mapping.force_in_world();
    const std::string name = device.Name();
    std::copy_n(name.begin(), std::min(name.size(), health.device.size() - 1),
                health.device.begin());
  }

  bool TakeSample(DeviceSample measured, bool clutched) noexcept;
  bool TakeFrame(const WorldInput& world) noexcept;
  bool WatchWorld(const TickTime& time, const WorldInput& world, bool finger_known) noexcept;
  std::span<const BodyShare> Render(std::int64_t elapsed_ticks, bool& no_channel) noexcept;
  void Release() noexcept;
  void Publish(const TickTime& time, const Vec3& displayed, ForceReason reason,
               protocol::HapticTick& message) noexcept;

  const Settings settings;
  const std::int64_t period_ns;
  const double radius;  // m
  Device& device;
  Mapping mapping;

  FeatureTrack track;
  LocalBodies copies;
  SurfaceForce surface_force;
  SurfaceMotion surface_motion;
  Ledger ledger;
  PeerWatch peer;
  EmergencyStop emergency_stop;
  SafetyStage safety;
  EnergyMeter energy;
  SplitEnergy split;

  std::uint64_t tick = 0;
  std::int64_t start_ns = 0;
  DeviceSample sample;                   // the last sound one, in W
  double penetration = 0;                // m, |e| of the tick before
  SurfaceMotion::WorkDone surface_work;  // since then
  double stored = 0;                     // J, in the rendered springs
  std::uint64_t newest_epoch = 0;        // of the newest sound frame, and its number
  std::uint64_t newest_frame = 0;
  std::uint64_t shown_epoch = 0;  // whose surfaces are in the track; 0 = none
  std::uint64_t shown_frame = 0;
  std::uint64_t channel_epoch = 0;  // whose bodies the channels are about
  std::uint64_t missed_in_a_row = 0;
  std::int64_t bounded_period_ns = 0;  // of the world that health.zero_force_after_ns is about
  Vec3 displayed = Vec3::Zero();       // N, in W
  std::array<HalfSpace, kMaxContactPlanes> planes;
  std::array<BodyShare, kMaxShares> shares;
  protocol::HapticHealth health;
};

// Puts a measurement into the world. False, and nothing is taken, if it does not lie there. // RT:
bool HapticStep::State::TakeSample(DeviceSample measured, bool clutched) noexcept {
  const Vec3 position = measured.position;
  measured.position = mapping.Follow(position, clutched);
  measured.velocity = clutched ? Vec3(Vec3::Zero()) : mapping.VelocityInWorld(measured.velocity);
  if (!IsSound(measured)) return false;
  FlushDenormals(measured.position);
  FlushDenormals(measured.velocity);
  measured.target = mapping.PointInWorld(measured.target);
  if (!measured.target.allFinite()) measured.target = measured.position;
  sample = measured;
  return true;
}

// Whether a new frame came that may be used, and books its ack if so. // RT:
bool HapticStep::State::TakeFrame(const WorldInput& world) noexcept {
  if (world.frame == nullptr || world.epoch == 0) return false;
  const protocol::WorldFrame& frame = *world.frame;
  const bool is_new = world.epoch != newest_epoch || frame.frame > newest_frame;
  const bool is_sound = frame.plane_count <= protocol::kMaxPlanes &&
                        frame.period_ns >= kShortestFrameNs && frame.period_ns <= kLongestFrameNs;
  if (!is_new || !is_sound) return false;
  newest_epoch = world.epoch;
  newest_frame = frame.frame;
  ledger.Receive(world.epoch, frame);
  return true;
}

// Peer watch and feature track. True if a frame came that is displayed from now on. // RT:
bool HapticStep::State::WatchWorld(const TickTime& time, const WorldInput& world,
                                   bool finger_known) noexcept {
  const std::int64_t elapsed_ticks = 1 + std::max<std::int64_t>(time.missed, 0);
  const bool fresh = TakeFrame(world);
  const PeerSign sign{
      .epoch = world.epoch,
      .ready = world.ready,
      .heartbeat_ns = world.heartbeat_ns,
      .fresh_frame = fresh,
      .frame_period_ns = fresh ? static_cast<std::int64_t>(world.frame->period_ns) : 0};
  const PeerState state = peer.Update(time.start_ns, sign, safety.is_zero());

  if (tick > 0) track.Advance(elapsed_ticks);
  if (state == PeerState::kAbsent && shown_epoch != 0) {
    track.Clear();
    copies.Clear();
    Release();
    shown_epoch = shown_frame = 0;
  }
  if (!fresh || !peer.Accepts(world.epoch)) return false;
  if (channel_epoch != world.epoch) {
    ledger.BeginWorld(world.epoch);
    channel_epoch = world.epoch;
  }
  // A surface as deep as the present contact, or as the finger gets in a tick or two, is no
  // surprise.
  const double speed = finger_known ? sample.velocity.stableNorm() : 0;
  const double approach = speed * Seconds(period_ns) * static_cast<double>(1 + elapsed_ticks);
  const FingerState finger{sample.position, radius, penetration + approach + 1e-6};
  copies.Receive(*world.frame, tick);
  track.Receive(*world.frame, std::span(&finger, 1), copies);
  shown_epoch = world.epoch;
  shown_frame = world.frame->frame;
  return true;
}

// No contact in this tick. // RT:
void HapticStep::State::Release() noexcept {
  surface_force.Reset();
  surface_motion.Reset();
  penetration = 0;
  surface_work = {};
  stored = 0;
}

// Contact solve and surface force at the last sound sample. Movable bodies without a channel are
// left out.
// RT:
std::span<const BodyShare> HapticStep::State::Render(std::int64_t elapsed_ticks,
                                                     bool& no_channel) noexcept {
  track.MoveFinger(kPointer, sample.position);
  const std::span<const Surface> surfaces = track.Surfaces(copies);
  for (std::size_t i = 0; i < surfaces.size(); ++i) planes[i] = surfaces[i].plane;
  const ContactSolution contact =
      SolveContact(sample.position, radius, std::span(planes).first(surfaces.size()));
  penetration = contact.displacement.norm();
  surface_work = surface_motion.Work(surfaces, displayed,
                                     Seconds(period_ns) * static_cast<double>(elapsed_ticks));
  surface_motion.Remember(surfaces, contact);
  std::size_t count = 0;
  for (const BodyShare& share : surface_force.Update(surfaces, contact, radius, elapsed_ticks)) {
    if (share.fixed || ledger.Open(share.body, share.generation, kPointer, tick)) {
      shares[count++] = share;
    } else {
      no_channel = true;
    }
  }
  const Vec3 as_sprung = Sum(std::span(shares).first(count));
  copies.SolveStiff(std::span(shares).first(count));
  // What was solved together with its copy holds as much less: f^2/2k.
  const double left = Fraction(Sum(std::span(shares).first(count)), as_sprung);
  stored = left * left * surface_force.stored();
  return std::span(shares).first(count);
}

// RT:
void HapticStep::State::Publish(const TickTime& time, const Vec3& force, ForceReason reason,
                                protocol::HapticTick& message) noexcept {
  message.tick = tick;
  message.start_ns = static_cast<std::uint64_t>(time.start_ns);
  message.period_ns = static_cast<std::uint64_t>(period_ns);
  message.previous_duration_ns =
      static_cast<std::uint64_t>(std::max<std::int64_t>(time.previous_duration_ns, 0));
  message.world_epoch = shown_epoch;
  message.world_frame = shown_frame;
  message.stiffness = settings.render.stiffness_n_per_m;
  message.damping = settings.render.damping_ns_per_m;
  message.force_cap = settings.safety.force_cap_n * mapping.force_in_world();
  message.pointer_count = 1;
  protocol::Pointer& pointer = message.pointers[0];
  pointer = {};
  pointer.pointer = kPointer;
  pointer.reason = reason;
  pointer.radius = radius;
  pointer.position = ToArray(sample.position);
  pointer.velocity = ToArray(sample.velocity);
  pointer.force = ToArray(force);
  ledger.Write(message);

  health.ticks = tick + 1;
  missed_in_a_row = time.missed > 0 ? missed_in_a_row + static_cast<std::uint64_t>(time.missed) : 0;
  health.missed += static_cast<std::uint64_t>(std::max<std::int64_t>(time.missed, 0));
  health.worst_missed_in_a_row = std::max(health.worst_missed_in_a_row, missed_in_a_row);
  health.reason_ticks = reason == health.reason ? health.reason_ticks + 1 : 0;
  health.reason = reason;
  health.peer_state = peer.state();
  health.peer_epoch = peer.epoch();
  const bool has_frame = shown_epoch != 0;
  health.feature_age_ns =
      has_frame
          ? static_cast<std::uint64_t>(std::max<std::int64_t>(peer.frame_age_ns(time.start_ns), 0))
          : 0;
  if (peer.world_period_ns() != bounded_period_ns) {
    bounded_period_ns = peer.world_period_ns();
    health.zero_force_after_ns =
        static_cast<std::uint64_t>(ZeroForceAfter(settings, bounded_period_ns));
  }
  health.largest_force = std::max(health.largest_force, force.norm());
  health.largest_force_step = std::max(health.largest_force_step, (force - displayed).norm());
  health.target = ToArray(sample.target);
  health.books = ledger.books();
  health.energy = {.injected = energy.injected(),
                   .dissipated = energy.dissipated(),
                   .flagged = energy.times_flagged(),
                   .unstable = energy.unstable() ? 1U : 0U,
                   .controller = reason == ForceReason::kPassivity ? 1U : 0U};
  health.reconciliation = copies.reconciliation();

  displayed = force;
  start_ns = time.start_ns;
  ++tick;
}

HapticStep::HapticStep(const Settings& settings, Device& device, std::uint64_t own_epoch) {
  CheckSettings(settings);
  state_ = std::make_unique<State>(settings, device, own_epoch);
}

HapticStep::~HapticStep() = default;

void HapticStep::Tick(const TickTime& time, const WorldInput& world, protocol::HapticTick& message,
                      const OperatorInput& wish) noexcept {
  State& state = *state_;
  SafetyInput input;
  DeviceSample measured;
  input.device_ok = state.device.Read(time.start_ns, measured) == DeviceStatus::kOk;
  input.sample_finite =
      input.device_ok && IsSound(measured) && state.TakeSample(measured, wish.clutch);
  if (input.sample_finite) input.speed = measured.velocity.stableNorm();

  const bool is_displayed = state.WatchWorld(time, world, input.sample_finite);

  const PeerState peer = state.peer.state();
  input.stopped = state.emergency_stop.Update(wish.stop, wish.enable, measured.enabled);
  input.clutched = wish.clutch;
  std::span<const BodyShare> shares;
  Vec3 wanted = Vec3::Zero();
  if (input.sample_finite && !input.stopped && !input.clutched &&
      (peer == PeerState::kLive || peer == PeerState::kLate || peer == PeerState::kLost)) {
    shares = state.Render(1 + std::max<std::int64_t>(time.missed, 0), input.no_channel);
    wanted = Sum(shares);
  } else {
    state.Release();
  }
  state.split.Moved(state.surface_work.split);
  const double split_work =
      is_displayed ? state.split.Receive(world.epoch, *world.frame, state.copies, state.tick) : 0;
  const double energy_scale = state.mapping.energy_on_device();
  if (input.sample_finite) {
    state.energy.Measure({.position = measured.position,
                          .velocity = measured.velocity,
                          .duration_s = Seconds(time.previous_duration_ns),
                          .surface_work = energy_scale * state.surface_work.all,
                          .split_work = energy_scale * split_work,
                          .stored = energy_scale * state.stored,
                          .penetration = state.penetration,
                          .world_period_s = Seconds(state.peer.world_period_ns())});
    input.velocity = measured.velocity;
    if (state.settings.safety.passivity_controller) input.brake = state.energy.Brake();
  } else {
    state.energy.Skip();
  }

  input.wanted = state.mapping.ForceOnDevice(wanted);
  input.peer = peer;
  input.previous_duration_ns = time.previous_duration_ns;
  input.missed = time.missed;
  const Vec3 command = state.safety.Limit(input);
  Vec3 on_device = Vec3::Zero();
  if (input.stopped) {
    state.device.Release();
  } else {
    on_device = state.device.Write(command);
  }
  if (!on_device.allFinite()) on_device.setZero();
  state.safety.Displayed(on_device);
  state.energy.Displayed(on_device, state.safety.ground(), input.wanted);
  const Vec3 displayed = state.mapping.ForceInWorld(on_device);

  state.ledger.Book({.previous_duration_ns = time.previous_duration_ns,
                     .pointer = kPointer,
                     .displayed = displayed,
                     .for_ground = state.mapping.ForceInWorld(state.safety.ground()),
                     .wanted = shares,
                     .finger = state.sample.position});
  state.split.Book(state.tick, state.sample.position, state.ledger.Booked());
  state.copies.Step(state.tick, state.ledger.Booked(),
                    state.tick == 0
                        ? Seconds(state.period_ns)
                        : Seconds(std::max<std::int64_t>(time.previous_duration_ns, 0)));
  state.ledger.CloseIdle(kPointer, state.tick, [&](std::uint32_t body, std::uint32_t generation) {
    return state.track.Has(body, generation, kPointer);
  });
  state.Publish(time, displayed, state.safety.reason(), message);
}

void HapticStep::Stop(std::int64_t now_ns, protocol::HapticTick& message) noexcept {
  State& state = *state_;
  state.device.Release();
  const TickTime time{.start_ns = now_ns,
                      .previous_duration_ns = state.tick == 0 ? 0 : now_ns - state.start_ns,
                      .missed = 0};
  state.safety.Displayed(Vec3::Zero());
  state.ledger.Book({.previous_duration_ns = time.previous_duration_ns,
                     .pointer = kPointer,
                     .displayed = Vec3::Zero(),
                     .for_ground = Vec3::Zero(),
                     .wanted = {},
                     .finger = state.sample.position});
  state.Publish(time, Vec3::Zero(), ForceReason::kStopped, message);
}

const protocol::HapticHealth& HapticStep::health() const noexcept {
  return state_->health;
}

}  // namespace rikiseki::haptic

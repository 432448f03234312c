// SPDX-License-Identifier: MIT
#include "haptic_server/step.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>

#include "common/clock.h"
#include "haptic_server/device/mapping.h"
#include "haptic_server/render/contact_render.h"
#include "haptic_server/render/ledger.h"
#include "haptic_server/safety/emergency_stop.h"
#include "haptic_server/safety/energy_meter.h"
#include "haptic_server/safety/safety_stage.h"
#include "haptic_server/safety/split_energy.h"

namespace rikiseki::haptic {
namespace {

using protocol::ForceReason;
using protocol::PeerState;

constexpr std::uint32_t kPointer = 0;

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

std::int64_t ElapsedTicks(const TickTime& time) {
  return 1 + std::max<std::int64_t>(time.missed, 0);
}

bool IsSound(const DeviceSample& sample) {
  return sample.position.allFinite() && sample.velocity.allFinite() &&
         sample.orientation.coeffs().allFinite() && sample.angular_velocity.allFinite() &&
         sample.position.cwiseAbs().maxCoeff() <= kLargestCoordinate;
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
        device(used_device),
        mapping(checked.mapping),
        intake(checked, ReplayTicks(checked), own_epoch),
        contact(checked.render, kPointer, Seconds(period_ns)),
        ledger(period_ns, HistoryTicks(checked), own_epoch),
        safety(checked),
        energy(checked),
        tuning(TuningOf(checked), Seconds(period_ns)),
        split({.stiffness_n_per_m = checked.render.stiffness_n_per_m,
               .finger_radius_m = contact.radius()},
              ReplayTicks(checked), own_epoch) {
    health.period_ns = static_cast<std::uint64_t>(period_ns);
    health.slew_limit = checked.safety.slew_limit_n_per_s * mapping.force_in_world();
    const std::string name = device.Name();
    std::copy_n(name.begin(), std::min(name.size(), device_name.size() - 1), device_name.begin());
    health.device = device_name;
  }

  void NameDevice() noexcept;

  bool TakeSample(DeviceSample measured, bool clutched) noexcept;
  std::span<const BodyShare> Render(const TickTime& time, SafetyInput& input) noexcept;
  void MeasureEnergy(const TickTime& time, const DeviceSample& measured, double split_work,
                     SafetyInput& input) noexcept;
  void Publish(const TickTime& time, const Vec3& displayed, ForceReason reason,
               protocol::HapticTick& message) noexcept;

  void Tune() noexcept;

  Settings settings;
  const std::int64_t period_ns;
  Device& device;
  Mapping mapping;

  WorldIntake intake;
  ContactRender contact;
  Ledger ledger;
  EmergencyStop emergency_stop;
  SafetyStage safety;
  EnergyMeter energy;
  TuningRamp tuning;
  SplitEnergy split;

  std::uint64_t tick = 0;
  std::int64_t start_ns = 0;
  DeviceSample sample;  // the last sound one, in W
  std::uint64_t missed_in_a_row = 0;
  std::int64_t bounded_period_ns = 0;  // of the world that health.zero_force_after_ns is about
  Vec3 displayed = Vec3::Zero();       // N, in W
  std::array<char, 32> device_name{};
  const char* trouble = "";  // of the device, as health.device says it
  protocol::HapticHealth health;
};

// Puts into health.device what is wrong with the device, or else its name. // RT:
void HapticStep::State::NameDevice() noexcept {
  const char* now = device.Trouble();
  if (now == trouble) return;
  trouble = now;
  health.device = device_name;
  if (*now == '\0') return;
  health.device.fill('\0');
  std::strncpy(health.device.data(), now, health.device.size() - 1);
}

// The next step on the way to other settings. What the springs gain by growing stiffer is no leak of the
// rendering, and the energy meter is not to take it for one. // RT:
void HapticStep::State::Tune() noexcept {
  Adopt(tuning.Advance(), settings);
  contact.Tune(settings.render);
  safety.Tune(settings.safety);
  energy.Tune(settings.safety);
  split.Tune(settings.render.stiffness_n_per_m);
  device.SetVelocityCutoff(settings.spidar.velocity_cutoff_hz);
  energy.Skip();
  health.slew_limit = settings.safety.slew_limit_n_per_s * mapping.force_in_world();
  bounded_period_ns = -1;
}

// Puts a measurement into the world. False, and nothing is taken, if it does not lie there. // RT:
bool HapticStep::State::TakeSample(DeviceSample measured, bool clutched) noexcept {
  const Vec3 position = measured.position;
  measured.position = mapping.Follow(position, clutched);
  measured.velocity = clutched ? Vec3(Vec3::Zero()) : mapping.VelocityInWorld(measured.velocity);
  if (!IsSound(measured)) return false;
  FlushDenormals(measured.position);
  FlushDenormals(measured.velocity);
  measured.orientation = mapping.OrientationInWorld(measured.orientation);
  measured.angular_velocity = mapping.DirectionInWorld(measured.angular_velocity);
  measured.target = mapping.PointInWorld(measured.target);
  if (!measured.target.allFinite()) measured.target = measured.position;
  sample = measured;
  return true;
}

// What each body is to get of the force, where there is a world to touch. // RT:
std::span<const BodyShare> HapticStep::State::Render(const TickTime& time,
                                                     SafetyInput& input) noexcept {
  const bool has_world = input.peer == PeerState::kLive || input.peer == PeerState::kLate ||
                         input.peer == PeerState::kLost;
  if (!has_world || !input.sample_finite || input.stopped || input.clutched) {
    contact.Reset();
    return {};
  }
  return contact.Update({.tick = tick,
                         .position = sample.position,
                         .displayed = displayed,
                         .elapsed_ticks = ElapsedTicks(time)},
                        intake.track(), intake.copies(), ledger, input.no_channel);
}

// `split_work`: J, in W, what the split between the processes added. // RT:
void HapticStep::State::MeasureEnergy(const TickTime& time, const DeviceSample& measured,
                                      double split_work, SafetyInput& input) noexcept {
  if (!input.sample_finite) {
    energy.Skip();
    return;
  }
  const double energy_scale = mapping.energy_on_device();
  energy.Measure({.position = measured.position,
                  .velocity = measured.velocity,
                  .duration_s = Seconds(time.previous_duration_ns),
                  .surface_work = energy_scale * contact.surface_work().all,
                  .split_work = energy_scale * split_work,
                  .stored = energy_scale * contact.stored(),
                  .penetration = contact.penetration(),
                  .world_period_s = Seconds(intake.peer().world_period_ns())});
  input.velocity = measured.velocity;
  if (settings.safety.passivity_controller) input.brake = energy.Brake();
}

// RT:
void HapticStep::State::Publish(const TickTime& time, const Vec3& force, ForceReason reason,
                                protocol::HapticTick& message) noexcept {
  message.tick = tick;
  message.start_ns = static_cast<std::uint64_t>(time.start_ns);
  message.period_ns = static_cast<std::uint64_t>(period_ns);
  message.previous_duration_ns =
      static_cast<std::uint64_t>(std::max<std::int64_t>(time.previous_duration_ns, 0));
  message.world_epoch = intake.shown_epoch();
  message.world_frame = intake.shown_frame();
  message.stiffness = settings.render.stiffness_n_per_m;
  message.damping = settings.render.damping_ns_per_m;
  message.force_cap = settings.safety.force_cap_n * mapping.force_in_world();
  message.pointer_count = 1;
  protocol::Pointer& pointer = message.pointers[0];
  pointer = {};
  pointer.pointer = kPointer;
  pointer.reason = reason;
  pointer.radius = contact.radius();
  pointer.position = ToArray(sample.position);
  pointer.velocity = ToArray(sample.velocity);
  pointer.force = ToArray(force);
  pointer.orientation = ToArray(sample.orientation);
  pointer.angular_velocity = ToArray(sample.angular_velocity);
  const Vec3 torque = mapping.TorqueInWorld(device.torque());
  if (torque.allFinite()) pointer.torque = ToArray(torque);
  ledger.Write(message);

  health.ticks = tick + 1;
  missed_in_a_row = time.missed > 0 ? missed_in_a_row + static_cast<std::uint64_t>(time.missed) : 0;
  health.missed += static_cast<std::uint64_t>(std::max<std::int64_t>(time.missed, 0));
  health.worst_missed_in_a_row = std::max(health.worst_missed_in_a_row, missed_in_a_row);
  health.reason_ticks = reason == health.reason ? health.reason_ticks + 1 : 0;
  health.reason = reason;
  const PeerWatch& peer = intake.peer();
  health.peer_state = peer.state();
  health.peer_epoch = peer.epoch();
  const bool has_frame = intake.shown_epoch() != 0;
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
  health.reconciliation = intake.copies().reconciliation();

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
  if (state.tuning.moves()) state.Tune();
  SafetyInput input;
  DeviceSample measured;
  input.device_ok = state.device.Read(time.start_ns, measured) == DeviceStatus::kOk;
  state.NameDevice();
  input.sample_finite =
      input.device_ok && IsSound(measured) && state.TakeSample(measured, wish.clutch);
  if (input.sample_finite) input.speed = measured.velocity.stableNorm();

  const Vec3 velocity = input.sample_finite ? state.sample.velocity : Vec3(Vec3::Zero());
  const bool is_displayed = state.intake.Update(world,
                                                {.tick = state.tick,
                                                 .start_ns = time.start_ns,
                                                 .elapsed_ticks = ElapsedTicks(time),
                                                 .position = state.sample.position,
                                                 .velocity = velocity,
                                                 .radius = state.contact.radius(),
                                                 .penetration = state.contact.penetration()},
                                                state.safety.is_zero(), state.ledger);

  input.peer = state.intake.peer().state();
  input.stopped = state.emergency_stop.Update(wish.stop, wish.enable, measured.enabled);
  input.clutched = wish.clutch;
  const std::span<const BodyShare> shares = state.Render(time, input);
  const LocalBodies& copies = state.intake.copies();
  state.split.Moved(state.contact.surface_work().split);
  const double split_work =
      is_displayed ? state.split.Receive(world.epoch, *world.frame, copies, state.tick) : 0;
  state.MeasureEnergy(time, measured, split_work, input);

  input.wanted = state.mapping.ForceOnDevice(Sum(shares));
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

  state.ledger.Book(
      {.previous_duration_ns = time.previous_duration_ns,
       .pointer = kPointer,
       .displayed = displayed,
       .for_ground = state.mapping.ForceInWorld(state.safety.ground()),
       .wanted = shares,
       .finger = state.sample.position,
       .largest_share = state.settings.safety.force_cap_n * state.mapping.force_in_world()});
  state.split.Book(state.tick, state.sample.position, state.ledger.Booked());
  state.intake.copies().Step(state.tick, state.ledger.Booked(),
                             state.tick == 0
                                 ? Seconds(state.period_ns)
                                 : Seconds(std::max<std::int64_t>(time.previous_duration_ns, 0)));
  state.ledger.CloseIdle(kPointer, state.tick, [&](std::uint32_t body, std::uint32_t generation) {
    return state.intake.track().Has(body, generation, kPointer);
  });
  state.Publish(time, displayed, state.safety.reason(), message);
}

void HapticStep::Tune(const Tuning& target) noexcept {
  state_->tuning.Start(target);
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

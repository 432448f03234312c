// SPDX-License-Identifier: MIT
#include "protocol/tools/observer.h"

#include <cmath>
#include <utility>

#include "common/clock.h"
#include "common/histogram.h"
#include "common/realtime.h"
#include "protocol/words.h"

namespace rikiseki::protocol {
namespace {

using Json = nlohmann::ordered_json;

// Sums and differences of impulse units are modulo 2^64, as SPEC.md 7.1 defines them.
ImpulseUnits Difference(const ImpulseUnits& a, const ImpulseUnits& b) {
  ImpulseUnits difference{};
  for (std::size_t i = 0; i < 3; ++i) {
    difference[i] = static_cast<std::int64_t>(static_cast<std::uint64_t>(a[i]) -
                                              static_cast<std::uint64_t>(b[i]));
  }
  return difference;
}

double Milliseconds(std::uint64_t duration_ns) {
  return static_cast<double>(duration_ns) * 1e-6;
}

std::uint64_t Age(std::uint64_t now_ns, std::uint64_t then_ns) {
  return now_ns > then_ns ? now_ns - then_ns : 0;
}

Json Durations(const Histogram& histogram) {
  const auto microseconds = [&histogram](double fraction) {
    return static_cast<double>(HistogramQuantile(histogram, fraction)) * 1e-3;
  };
  Json buckets = Json::array();  // [from us, count], those that are not empty
  for (std::size_t i = 0; i < histogram.size(); ++i) {
    if (histogram[i] == 0) continue;
    buckets.push_back({static_cast<double>(HistogramLowerEdge(i)) * 1e-3, histogram[i]});
  }
  return {{"count", HistogramTotal(histogram)}, {"buckets", std::move(buckets)},
          {"p50", microseconds(0.5)},           {"p99", microseconds(0.99)},
          {"p99_9", microseconds(0.999)},       {"max", microseconds(1)}};
}

Json Scheduled(const Scheduling& scheduling) {
  Json report{{"policy", PolicyName(static_cast<int>(scheduling.policy),
                                    static_cast<int>(scheduling.priority))},
              {"priority", scheduling.priority},
              {"memory_locked", scheduling.memory_locked != 0}};
  report["cpu"] = scheduling.cpu == std::numeric_limits<std::uint32_t>::max()
                      ? Json(nullptr)
                      : Json(scheduling.cpu);
  return report;
}

Json Reported(const Pointer& pointer) {
  return {{"pointer", pointer.pointer},
          {"reason", Key(pointer.reason)},
          {"sentence", Sentence(pointer.reason)},
          {"radius_m", pointer.radius},
          {"position_m", pointer.position},
          {"velocity_m_per_s", pointer.velocity},
          {"force_n", pointer.force},
          {"torque_nm", pointer.torque}};
}

Json Reported(const Channel& channel) {
  return {{"body", channel.body},
          {"generation", channel.generation},
          {"pointer", channel.pointer},
          {"open", channel.state == ChannelState::kOpen},
          {"opened_tick", channel.opened_tick},
          {"impulse", channel.impulse},
          {"angular_impulse", channel.angular_impulse}};
}

/// The scene's name of a body; null if the scene does not know it.
Json NameOf(const WorldScene& scene, const Body& body) {
  for (const SceneBody& known : scene.bodies) {
    if (known.body == body.body && known.generation == body.generation) {
      return Printable(known.name.data(), known.name.size());
    }
  }
  return nullptr;
}

Json Reported(const WorldScene& scene, const Body& body) {
  return {{"body", body.body},
          {"generation", body.generation},
          {"name", NameOf(scene, body)},
          {"mass_kg", body.mass},
          {"position_m", body.position},
          {"orientation_wxyz", body.orientation},
          {"velocity_m_per_s", body.velocity},
          {"angular_velocity_rad_per_s", body.angular_velocity}};
}

Json Reported(const Books& books) {
  const ImpulseUnits pending =
      Difference(Difference(books.displayed, books.covered), books.peer_lost);
  // What the haptic side counts as covered must be what the worlds say they did with it.
  const bool balanced =
      Difference(Difference(books.covered, books.applied), books.discarded) == ImpulseUnits{};
  return {{"unit_ns", kImpulseUnit},      {"displayed", books.displayed},
          {"ground", books.ground},       {"covered", books.covered},
          {"applied", books.applied},     {"discarded", books.discarded},
          {"peer_lost", books.peer_lost}, {"pending", pending},
          {"balanced", balanced}};
}

}  // namespace

Observer::Observer(const std::string& instance) {
  haptic_.request.instance = instance;
  haptic_.request.role = Role::kHaptic;
  world_.request.instance = instance;
  world_.request.role = Role::kWorld;
  SegmentName(instance, Role::kHaptic);  // refuses a wrong name now
}

std::string Observer::absence() const {
  std::string text = haptic_.why;
  if (!text.empty() && !world_.why.empty()) text += "; ";
  return text + world_.why;
}

void Observer::Refresh(Side& side) {
  if (side.view != nullptr && side.view->OwnerAlive() && side.view->IsCurrent()) return;
  AttachResult result = Attach(side.request);
  side.why = result.status == AttachStatus::kAttached ? "" : result.text;
  side.view = std::move(result.view);
  side.last_ns = 0;
  if (&side == &world_) {
    bodies_ = side.view == nullptr ? BodiesReader()
                                   : BodiesReader(side.view->Stream(StreamType::kWorldBodies));
    scene_ = side.view == nullptr ? SceneReader()
                                  : SceneReader(side.view->Stream(StreamType::kWorldScene));
  }
}

Json Observer::Common(Side& side, std::uint64_t now_ns) {
  if (side.view == nullptr) return {{"attached", false}, {"why", side.why}};
  const PeerView& view = *side.view;
  const std::uint64_t tick = view.Tick();
  const StreamType paced =
      side.request.role == Role::kHaptic ? StreamType::kHapticTick : StreamType::kWorldFrame;
  const std::uint64_t period_ns = view.PeriodNs(paced);
  Json rate{{"nominal_hz", period_ns == 0 ? 0 : 1e9 / static_cast<double>(period_ns)},
            {"measured_hz", nullptr}};
  if (side.last_ns != 0 && now_ns > side.last_ns) {
    rate["measured_hz"] = static_cast<double>(tick - side.last_tick) * 1e9 /
                          static_cast<double>(now_ns - side.last_ns);
  }
  side.last_tick = tick;
  side.last_ns = now_ns;
  const HealthCounters counters = view.Counters();
  return {{"attached", true},
          {"epoch", view.epoch()},
          {"pid", view.header().writer_pid},
          {"build", Printable(view.header().build, sizeof view.header().build)},
          {"state", Key(view.State())},
          {"fault_code", view.FaultCode()},
          {"tick", tick},
          {"heartbeat_age_ms", Milliseconds(Age(now_ns, view.HeartbeatNs()))},
          {"rate", rate},
          {"counters",
           {{"overruns", counters.overruns},
            {"lapped", counters.lapped},
            {"read_retries", counters.read_retries},
            {"rejected", counters.rejected},
            {"gaps", counters.gaps}}}};
}

Json Observer::Haptic(std::uint64_t now_ns, Json& books) {
  Json report = Common(haptic_, now_ns);
  if (haptic_.view == nullptr) return report;
  HapticHealth health;
  if (haptic_.view->Reader<HapticHealth>().ReadLatest(health) == ReadStatus::kFresh) {
    books = Reported(health.books);
    report["reason"] = Key(health.reason);
    report["sentence"] = Sentence(health.reason);
    report["reason_ticks"] = health.reason_ticks;
    report["peer"] = {{"state", Key(health.peer_state)},
                      {"epoch", health.peer_epoch},
                      {"feature_age_ms", Milliseconds(health.feature_age_ns)}};
    report["device"] = Printable(health.device.data(), health.device.size());
    report["target_m"] = health.target;
    report["largest_force_n"] = health.largest_force;
    report["largest_force_step_n"] = health.largest_force_step;
    report["slew_limit_n_per_s"] = health.slew_limit;
    report["zero_force_after_ms"] = Milliseconds(health.zero_force_after_ns);
    report["ticks"] = health.ticks;
    report["missed"] = health.missed;
    report["worst_missed_in_a_row"] = health.worst_missed_in_a_row;
    report["lateness_us"] = Durations(health.lateness);
    report["duration_us"] = Durations(health.duration);
    report["scheduling"] = Scheduled(health.scheduling);
    report["reconciliation"] = {{"frames", health.reconciliation.frames},
                                {"newest_jump_mm", health.reconciliation.newest_jump * 1e3},
                                {"largest_jump_mm", health.reconciliation.largest_jump * 1e3}};
    report["energy"] = {{"injected_j", health.energy.injected},
                        {"dissipated_j", health.energy.dissipated},
                        {"unstable", health.energy.unstable != 0},
                        {"times_flagged", health.energy.flagged},
                        {"controller_acts", health.energy.controller != 0}};
    report["page_faults"] = {{"minor", health.minor_faults}, {"major", health.major_faults}};
  }
  HapticTick tick;
  auto ticks = haptic_.view->Reader<HapticTick>();
  if (ticks.ReadLatest(tick) == ReadStatus::kFresh) {
    Json newest{{"tick", tick.tick},
                {"age_ms", Milliseconds(Age(now_ns, ticks.received().stamp_ns))},
                {"bytes", ticks.received().used_bytes},
                {"world_epoch", tick.world_epoch},
                {"world_frame", tick.world_frame},
                {"stiffness_n_per_m", tick.stiffness},
                {"damping_ns_per_m", tick.damping},
                {"force_cap_n", tick.force_cap},
                {"pointers", Json::array()},
                {"channels", Json::array()},
                {"ground", tick.ground.impulse}};
    for (std::uint32_t i = 0; i < tick.pointer_count; ++i) {
      newest["pointers"].push_back(Reported(tick.pointers[i]));
    }
    for (std::uint32_t i = 0; i < tick.channel_count; ++i) {
      newest["channels"].push_back(Reported(tick.channels[i]));
    }
    report["newest"] = newest;
  }
  return report;
}

Json Observer::World(std::uint64_t now_ns) {
  Json report = Common(world_, now_ns);
  if (world_.view == nullptr) return report;
  WorldHealth health;
  if (world_.view->Reader<WorldHealth>().ReadLatest(health) == ReadStatus::kFresh) {
    report["scene"] = Printable(health.scene.data(), health.scene.size());
    report["coupling"] = Key(health.coupling);
    report["peer"] = {{"state", Key(health.peer_state)}, {"epoch", health.peer_epoch}};
    report["frames"] = health.frames;
    report["missed"] = health.missed;
    report["lapped"] = health.lapped;
    report["applied"] = health.applied;
    Json& discarded = report["discarded"];
    for (std::uint32_t i = 0; i < kDiscardReasons; ++i) {
      discarded[Key(static_cast<DiscardReason>(i))] = health.discarded[i];
    }
    report["penalty_impulse_ns"] = health.penalty_impulse;
    report["moving_bodies"] = health.moving_bodies;
    report["resets"] = health.resets;
    report["lateness_us"] = Durations(health.lateness);
    report["duration_us"] = Durations(health.duration);
    report["scheduling"] = Scheduled(health.scheduling);
  }
  WorldFrame frame;
  auto frames = world_.view->Reader<WorldFrame>();
  if (frames.ReadLatest(frame) == ReadStatus::kFresh) {
    report["newest"] = {{"frame", frame.frame},
                        {"age_ms", Milliseconds(Age(now_ns, frames.received().stamp_ns))},
                        {"bytes", frames.received().used_bytes},
                        {"world_time_s", static_cast<double>(frame.world_time_ns) * 1e-9},
                        {"acked_epoch", frame.acked_epoch},
                        {"acked_tick", frame.acked_tick},
                        {"baseline_tick", frame.baseline_tick},
                        {"applied", frame.applied},
                        {"discarded", frame.discarded},
                        {"planes", frame.plane_count}};
  }
  bodies_.ReadLatest();
  scene_.ReadLatest();
  Json& bodies = report["bodies"] = Json::array();
  for (const Body& body : bodies_.bodies()) bodies.push_back(Reported(scene_.scene(), body));
  return report;
}

Json Observer::Read() {
  Refresh(haptic_);
  Refresh(world_);
  const auto now_ns = static_cast<std::uint64_t>(MonotonicNow());
  Json report{{"time_ns", now_ns}, {"instance", haptic_.request.instance}};
  Json books = nullptr;
  report["haptic"] = Haptic(now_ns, books);
  report["world"] = World(now_ns);
  report["books"] = books;
  return report;
}

}  // namespace rikiseki::protocol

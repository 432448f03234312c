// SPDX-License-Identifier: MIT
#include "tests/process/storm_judge.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

namespace rikiseki::test {
namespace {

using protocol::DiscardReason;
using protocol::ForceReason;
using protocol::ImpulseUnits;

constexpr std::size_t kMostLines = 5;
constexpr double kGravity = 9.81;
// The strings' tensions add up to zero but for rounding: 4 * 20 N * 2^-53 and some.
constexpr double kZeroForce = 1e-12;  // N
constexpr double kRounding = 1e-9;    // N, of a norm near a limit

double Norm(const protocol::Vector& v) {
  return std::hypot(v[0], v[1], v[2]);
}

double NewtonSeconds(const ImpulseUnits& units) {
  return protocol::kImpulseUnit * std::hypot(static_cast<double>(units[0]),
                                             static_cast<double>(units[1]),
                                             static_cast<double>(units[2]));
}

std::string Text(const ImpulseUnits& units) {
  char text[80];
  std::snprintf(text, sizeof text, "(%ld %ld %ld)", units[0], units[1], units[2]);
  return text;
}

template <typename... Arguments>
void Say(Violations& violations, const char* format, Arguments... arguments) {
  if (violations.size() >= kMostLines) return;
  char line[400];
  std::snprintf(line, sizeof line, format, arguments...);
  violations.emplace_back(line);
}

const HapticHistory* Find(const StormWatch& watch, std::uint64_t epoch) {
  for (const HapticHistory& haptic : watch.haptics()) {
    if (haptic.epoch == epoch) return &haptic;
  }
  return nullptr;
}

// q_k.
ImpulseUnits Growth(const HapticHistory& haptic, std::uint64_t tick) {
  const ImpulseUnits& now = haptic.ticks[tick].delivered;
  return tick == 0 ? now : now - haptic.ticks[tick - 1].delivered;
}

// The sum of q_k over (baseline, acked] where tick k names this world.
ImpulseUnits Own(const HapticHistory& haptic, const protocol::WorldFrame& frame,
                 std::uint64_t world_epoch) {
  ImpulseUnits own{};
  for (std::uint64_t tick = frame.baseline_tick + 1; tick <= frame.acked_tick; ++tick) {
    if (haptic.ticks[tick].world_epoch == world_epoch) own = own + Growth(haptic, tick);
  }
  return own;
}

// The last frame of every haptic epoch that a world acknowledged, in the order of time.
std::vector<const protocol::WorldFrame*> LastFrames(const WorldHistory& world) {
  std::vector<const protocol::WorldFrame*> last;
  for (const protocol::WorldFrame& frame : world.frames) {
    if (frame.acked_epoch == 0) continue;
    if (last.empty() || last.back()->acked_epoch != frame.acked_epoch) last.push_back(nullptr);
    last.back() = &frame;
  }
  return last;
}

bool Covers(const HapticHistory* haptic, const protocol::WorldFrame& frame) {
  return haptic != nullptr && frame.acked_tick < haptic->ticks.size() &&
         frame.baseline_tick <= frame.acked_tick;
}

// (1).
void JudgeFrames(const WorldHistory& world, const StormWatch& watch, Violations& violations) {
  for (const protocol::WorldFrame& frame : world.frames) {
    if (frame.acked_epoch == 0) continue;
    const HapticHistory* const haptic = Find(watch, frame.acked_epoch);
    if (!Covers(haptic, frame)) {
      Say(violations,
          "world %lu frame %lu acknowledges tick %lu of epoch %lu, which was not published",
          world.epoch, frame.frame, frame.acked_tick, frame.acked_epoch);
      continue;
    }
    const ImpulseUnits covered =
        haptic->ticks[frame.acked_tick].delivered - haptic->ticks[frame.baseline_tick].delivered;
    if (frame.applied + frame.discarded != covered) {
      Say(violations,
          "world %lu frame %lu: applied %s + discarded %s is not delivered %s of (%lu, %lu]",
          world.epoch, frame.frame, Text(frame.applied).c_str(), Text(frame.discarded).c_str(),
          Text(covered).c_str(), frame.baseline_tick, frame.acked_tick);
    }
  }
}

// (2), by the newest life record, against the frame that it came with.
void JudgeLife(const WorldHistory& world, const StormWatch& watch, Violations& violations) {
  if (world.lives.empty()) return;
  const LifeRecord& life = world.lives.back();
  ImpulseUnits applied{};
  ImpulseUnits discarded{};
  ImpulseUnits own{};
  const auto add = [&](const protocol::WorldFrame& frame) {
    const HapticHistory* const haptic = Find(watch, frame.acked_epoch);
    if (!Covers(haptic, frame)) return;
    applied = applied + frame.applied;
    discarded = discarded + frame.discarded;
    own = own + Own(*haptic, frame, world.epoch);
  };
  const protocol::WorldFrame* newest = nullptr;
  for (const protocol::WorldFrame& frame : world.frames) {
    if (frame.frame > life.frame) break;
    if (newest != nullptr && newest->acked_epoch != frame.acked_epoch) add(*newest);
    newest = &frame;
  }
  if (newest != nullptr) add(*newest);

  const auto of = [&life](DiscardReason reason) {
    return life.discarded[static_cast<std::size_t>(reason)];
  };
  if (life.applied != applied) {
    Say(violations, "world %lu: health says %s applied, its frames %s", world.epoch,
        Text(life.applied).c_str(), Text(applied).c_str());
  }
  const ImpulseUnits kept_back = of(DiscardReason::kGap) + of(DiscardReason::kUnknownBody);
  if (of(DiscardReason::kCoupling) != ImpulseUnits{} ||
      kept_back + of(DiscardReason::kForeignWorld) != discarded) {
    Say(violations, "world %lu: health and frames disagree on what was discarded", world.epoch);
  }
  if (life.lapped == 0 && life.applied + kept_back != own) {
    Say(violations, "world %lu: applied %s + own discards %s is not what was displayed to it, %s",
        world.epoch, Text(life.applied).c_str(), Text(kept_back).c_str(), Text(own).c_str());
  }
}

// (4).
void JudgeDrained(const WorldHistory& world, const StormWatch& watch, Violations& violations) {
  const auto last = LastFrames(world);
  for (std::size_t i = 0; i + 1 < last.size(); ++i) {
    const HapticHistory* const haptic = Find(watch, last[i]->acked_epoch);
    if (haptic != nullptr && last[i]->acked_tick + 1 != haptic->ticks.size()) {
      Say(violations, "world %lu left epoch %lu at tick %lu, its last is %zu", world.epoch,
          haptic->epoch, last[i]->acked_tick, haptic->ticks.size() - 1);
    }
  }
}

}  // namespace

Violations JudgeForce(const HapticHistory& haptic, const StormLimits& limits) {
  Violations violations;
  const double period_s = static_cast<double>(haptic.period_ns) * 1e-9;
  const double step = limits.slew_n_per_s * period_s;
  // From the cap to zero at the slew limit, and the tick that notices.
  const auto ticks_to_zero = static_cast<std::uint64_t>(std::ceil(haptic.force_cap / step)) + 2;
  protocol::Vector before{};
  std::uint64_t shown_epoch = 0;
  std::uint64_t shown_frame = 0;
  std::uint64_t shown_ns = 0;
  std::uint64_t ticks_silent = 0;
  for (std::size_t k = 0; k < haptic.ticks.size(); ++k) {
    const TickRecord& tick = haptic.ticks[k];
    const double force = Norm(tick.force);
    if (!std::isfinite(force)) Say(violations, "tick %zu: the force is not finite", k);
    if (force > haptic.force_cap + kRounding) {
      Say(violations, "tick %zu: %.9g N is above the cap of %g N", k, force, haptic.force_cap);
    }
    const double change =
        std::hypot(tick.force[0] - before[0], tick.force[1] - before[1], tick.force[2] - before[2]);
    // A daemon that is told to stop lets go at once, as a dead one does.
    if (change > step + kRounding && tick.reason != ForceReason::kStopped) {
      Say(violations, "tick %zu: the force stepped by %.9g N, %g N are allowed", k, change, step);
    }
    // Its own stop: at the first tick after it the force goes down, whatever is touched.
    const std::uint64_t missed = tick.previous_duration_ns / haptic.period_ns;
    if (missed > limits.fault_after_misses + 2) {  // the grid may hold two of them less
      if (tick.reason != ForceReason::kLoopFault && tick.reason != ForceReason::kStopped) {
        Say(violations, "tick %zu: %lu deadlines missed, and the reason is %u", k, missed,
            static_cast<unsigned>(tick.reason));
      }
      if (force > std::max(Norm(before) - step, 0.0) + kRounding) {
        Say(violations,
            "tick %zu: %lu deadlines missed, and the force is still %.9g N after %.9g N", k, missed,
            force, Norm(before));
      }
    }
    // A silent world.
    if (tick.world_epoch != shown_epoch || tick.world_frame != shown_frame) {
      shown_epoch = tick.world_epoch;
      shown_frame = tick.world_frame;
      shown_ns = tick.start_ns;
      ticks_silent = 0;
    }
    const std::uint64_t faded_ns = shown_ns + limits.lost_after_ns + limits.fade_ns;
    if (tick.start_ns > faded_ns + haptic.period_ns) ++ticks_silent;
    if (ticks_silent > ticks_to_zero && force > kZeroForce) {
      Say(violations, "tick %zu: %.3g N, %.1f ms after the last frame of the world", k, force,
          static_cast<double>(tick.start_ns - shown_ns) * 1e-6);
    }
    before = tick.force;
  }
  return violations;
}

Violations JudgeImpulseOfForce(const HapticHistory& haptic) {
  Violations violations;
  if (haptic.ticks.empty()) return violations;
  const auto period_ns = static_cast<long double>(haptic.period_ns);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    long double units = 0;      // 1 N ns = 1000 units
    long double magnitude = 0;  // of everything that was rounded on the way
    long double before = 0;
    for (const TickRecord& tick : haptic.ticks) {
      const long double force = tick.force[axis];
      const long double late_ns =
          &tick == &haptic.ticks.front()
              ? 0
              : static_cast<long double>(tick.previous_duration_ns) - period_ns;
      units -= 1000 * (force * period_ns + before * late_ns);
      magnitude += 1000 * (std::abs(force) * period_ns + std::abs(before * late_ns));
      before = force;
    }
    const TickRecord& end = haptic.ticks.back();
    const auto booked = static_cast<long double>(end.delivered[axis] + end.ground[axis]);
    // Half a unit is carried over; each product and sum of doubles rounds once.
    const long double tolerance = 1 + 8 * 0x1p-53L * magnitude;
    if (std::abs(units - booked) > tolerance) {
      Say(violations, "axis %zu: the force came to %.3Lf units, booked are %.0Lf", axis, units,
          booked);
    }
  }
  return violations;
}

Violations JudgeBooks(const StormWatch& watch, Sums& sums) {
  Violations violations;
  std::map<std::uint64_t, std::vector<bool>> taken;  // by haptic epoch, per tick
  for (const HapticHistory& haptic : watch.haptics()) {
    taken[haptic.epoch].resize(haptic.ticks.size());
    if (!haptic.ticks.empty()) sums.delivered = sums.delivered + haptic.ticks.back().delivered;
    for (std::uint64_t tick = 0; tick < haptic.ticks.size(); ++tick) {
      if (haptic.ticks[tick].world_epoch == 0 && Growth(haptic, tick) != ImpulseUnits{}) {
        Say(violations, "epoch %lu tick %lu pushes a body of no world", haptic.epoch, tick);
      }
    }
  }
  for (const WorldHistory& world : watch.worlds()) {
    JudgeFrames(world, watch, violations);
    JudgeLife(world, watch, violations);
    JudgeDrained(world, watch, violations);
    for (const protocol::WorldFrame* const frame : LastFrames(world)) {
      const HapticHistory* const haptic = Find(watch, frame->acked_epoch);
      if (!Covers(haptic, *frame)) continue;
      const ImpulseUnits covered = haptic->ticks[frame->acked_tick].delivered -
                                   haptic->ticks[frame->baseline_tick].delivered;
      const ImpulseUnits foreign = covered - Own(*haptic, *frame, world.epoch);
      sums.applied = sums.applied + frame->applied;
      sums.discarded = sums.discarded + (frame->discarded - foreign);
      for (std::uint64_t tick = frame->baseline_tick + 1; tick <= frame->acked_tick; ++tick) {
        if (haptic->ticks[tick].world_epoch == world.epoch) taken[haptic->epoch][tick] = true;
      }
    }
  }
  for (const HapticHistory& haptic : watch.haptics()) {
    for (std::uint64_t tick = 0; tick < haptic.ticks.size(); ++tick) {
      if (!taken[haptic.epoch][tick]) sums.lost = sums.lost + Growth(haptic, tick);
    }
  }
  if (sums.delivered != sums.applied + sums.discarded + sums.lost) {
    Say(violations, "in sum: delivered %s, applied %s + discarded %s + lost %s",
        Text(sums.delivered).c_str(), Text(sums.applied).c_str(), Text(sums.discarded).c_str(),
        Text(sums.lost).c_str());
  }
  return violations;
}

Violations JudgeHapticBooks(const HapticHistory& haptic, const StormWatch& watch) {
  Violations violations;
  // What the haptic side may have taken in last: a frame of some world, after the last of all
  // before it.
  struct Newest {
    std::uint64_t acked_tick;
    ImpulseUnits applied;
  };
  std::vector<Newest> possible{};
  ImpulseUnits of_earlier_worlds{};
  for (const WorldHistory& world : watch.worlds()) {
    ImpulseUnits last{};
    for (const protocol::WorldFrame& frame : world.frames) {
      if (frame.acked_epoch != haptic.epoch || !Covers(&haptic, frame)) continue;
      possible.push_back({frame.acked_tick, of_earlier_worlds + frame.applied});
      last = frame.applied;
    }
    of_earlier_worlds = of_earlier_worlds + last;
  }
  for (const BooksRecord& record : haptic.books) {
    if (record.ticks == 0 || record.ticks > haptic.ticks.size()) continue;
    const TickRecord& tick = haptic.ticks[record.ticks - 1];
    const protocol::Books& books = record.books;
    if (books.displayed != tick.delivered || books.ground != tick.ground) {
      Say(violations, "tick %lu: displayed %s and ground %s, its channels say %s and %s",
          record.ticks - 1, Text(books.displayed).c_str(), Text(books.ground).c_str(),
          Text(tick.delivered).c_str(), Text(tick.ground).c_str());
    }
    if (books.covered != books.applied + books.discarded) {
      Say(violations, "tick %lu: covered %s is not applied %s + discarded %s", record.ticks - 1,
          Text(books.covered).c_str(), Text(books.applied).c_str(), Text(books.discarded).c_str());
    }
    const ImpulseUnits settled = books.covered + books.peer_lost;
    const bool none = settled == ImpulseUnits{} && books.applied == ImpulseUnits{};
    const bool explained =
        none || std::any_of(possible.begin(), possible.end(), [&](const Newest& newest) {
          return settled == haptic.ticks[newest.acked_tick].delivered &&
                 books.applied == newest.applied;
        });
    if (!explained) {
      Say(violations, "tick %lu: settled %s, of it applied %s: no published frame says so",
          record.ticks - 1, Text(settled).c_str(), Text(books.applied).c_str());
    }
  }
  return violations;
}

Violations JudgeBlock(const WorldHistory& world, const StormLimits& limits) {
  Violations violations;
  // The impulse that each frame says it applied; index = frame number.
  std::vector<double> applied(world.frames.size() + 1);
  for (std::size_t i = 0; i < world.frames.size(); ++i) {
    const bool continues = i > 0 && world.frames[i].acked_epoch == world.frames[i - 1].acked_epoch;
    applied[i + 1] = NewtonSeconds(continues ? world.frames[i].applied - world.frames[i - 1].applied
                                             : world.frames[i].applied);
  }
  double since_placed = 0;
  for (std::size_t i = 0; i < world.blocks.size(); ++i) {
    const BlockRecord& now = world.blocks[i];
    if (now.frame > world.frames.size()) break;
    if (i == 0 || world.blocks[i - 1].generation != now.generation) {  // placed anew, at rest
      since_placed = applied[now.frame];
    } else {
      const BlockRecord& before = world.blocks[i - 1];
      double pushed = 0;
      for (std::uint64_t frame = before.frame + 1; frame <= now.frame; ++frame) {
        pushed += applied[frame];
      }
      since_placed += pushed;
      const double elapsed_s = static_cast<double>(world.frames[now.frame - 1].world_time_ns -
                                                   world.frames[before.frame - 1].world_time_ns) *
                               1e-9;
      const double change = now.mass * std::hypot(now.velocity[0] - before.velocity[0],
                                                  now.velocity[1] - before.velocity[1],
                                                  now.velocity[2] - before.velocity[2]);
      const double allowed =
          pushed + limits.friction * now.mass * kGravity * elapsed_s + limits.settling_ns;
      if (change > allowed) {
        Say(violations,
            "frame %lu: the block's momentum changed by %.4f N s, explained are %.4f (applied "
            "%.4f, "
            "elapsed %.3f s), v %.3f %.3f %.3f -> %.3f %.3f %.3f, z %.5f",
            now.frame, change, allowed, pushed, elapsed_s, before.velocity[0], before.velocity[1],
            before.velocity[2], now.velocity[0], now.velocity[1], now.velocity[2], now.position[2]);
      }
      const double growth = now.mass * (Norm(now.velocity) - Norm(before.velocity));
      if (growth > pushed + limits.settling_ns) {  // friction never speeds it up
        Say(violations, "frame %lu: the block gained %.4f N s, applied were %.4f", now.frame,
            growth, pushed);
      }
    }
    const double momentum = now.mass * Norm(now.velocity);
    if (momentum > since_placed + limits.settling_ns) {
      Say(violations, "frame %lu: the block has %.4f N s, applied were %.4f", now.frame, momentum,
          since_placed);
    }
  }
  return violations;
}

}  // namespace rikiseki::test

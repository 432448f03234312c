// SPDX-License-Identifier: MIT
#include "world_server/coupling/replay.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

namespace rikiseki::world {
namespace {

constexpr double kSameTime = 1e-9;       // relative
constexpr double kShortestBlock = 1e-4;  // s: bounds what absurd tick numbers cost

// The share of block i of n of a force that is linear in time, with the given impulse and integral
// of (end - t) f dt: block by block total/n + slope (i - (n-1)/2). The kick at the start of each
// block, not its middle, leaves total * block_s / 2 of the moment: half a tick, no more.
Vec3 ProfileShare(const Vec3& total, const Vec3& moment, double block_s, int i, int n,
                  double largest) {
  const Vec3 mean = total / n;
  if (n == 1) return mean;
  const double half = 0.5 * (n - 1);
  const double squared = static_cast<double>(n) * n;
  Vec3 slope = (mean * (block_s * squared / 2) - moment) * (12 / (block_s * squared * n));
  if (!slope.allFinite()) return mean;
  const double size = slope.stableNorm() * half;
  const double bound = largest / n;
  if (size > bound) slope *= bound / size;
  return mean + slope * (i - half);
}

// The stretches of a period, put together tick by tick.
class Schedule {
 public:
  Schedule(double largest_impulse_ns, PushBudgets* budgets)
      : largest_impulse_ns_(largest_impulse_ns), budgets_(budgets) {}

  void Wait(double time_s) { waiting_s_ += time_s; }

  void Add(std::span<const ReplayImpulse> impulses, const ReplayTick& tick, double length_s) {
    if (impulses.empty()) return Wait(length_s);
    const int blocks = static_cast<int>(
        std::min(static_cast<double>(tick.ticks), 1 + std::ceil(length_s / kShortestBlock)));
    for (int i = 0; i < blocks; ++i) {
      for (const ReplayImpulse& push : impulses) {
        Vec3 impulse = push.impulse;
        Vec3 angular_impulse = push.angular_impulse;
        if (blocks > 1) {
          const double block_s = tick.length_s / blocks;
          impulse = ProfileShare(push.impulse, push.first_moment, block_s, i, blocks,
                                 largest_impulse_ns_);
          angular_impulse = ProfileShare(push.angular_impulse, push.angular_first_moment, block_s,
                                         i, blocks, largest_impulse_ns_);
        }
        pushes_.push_back({.body = push.body,
                           .impulse = impulse,
                           .angular_impulse = angular_impulse,
                           .point = push.point,
                           .budget = BudgetOf(push.body)});
      }
      Close(length_s / blocks, impulses.size());
    }
  }

  void Play(DynamicsWorld& world) {
    LetPass();
    const std::span<const PlacedImpulse> all(pushes_);
    std::size_t begin = 0;
    for (std::size_t i = 0; i < stretches_.size(); ++i) {
      stretches_[i].pushes = all.subspan(begin, counts_[i]);
      begin += counts_[i];
    }
    world.Play(stretches_);
  }

 private:
  PushBudget* BudgetOf(std::size_t body) {
    if (budgets_ == nullptr) return nullptr;
    const auto budget = budgets_->find(body);
    return budget != budgets_->end() ? &budget->second : nullptr;
  }

  void Close(double length_s, std::size_t pushes) {
    LetPass();
    stretches_.push_back({.length_s = length_s});
    counts_.push_back(pushes);
  }

  // What was waited for passes in one stretch, before the next push.
  void LetPass() {
    if (!(waiting_s_ > 0)) return;
    stretches_.push_back({.length_s = waiting_s_});
    counts_.push_back(0);
    waiting_s_ = 0;
  }

  double largest_impulse_ns_;
  PushBudgets* budgets_;
  double waiting_s_ = 0;
  std::vector<PlacedImpulse> pushes_;
  std::vector<std::size_t> counts_;  // of pushes, by stretch
  std::vector<Stretch> stretches_;
};

}  // namespace

void ReplayPush(const Replay& replay, double period_s, double largest_impulse_ns,
                DynamicsWorld& world, PushBudgets* budgets) {
  double covered_s = 0;
  for (const ReplayTick& tick : replay.ticks) covered_s += tick.length_s;
  double scale = 1;
  Schedule schedule(largest_impulse_ns, budgets);
  const double missing_s = period_s - covered_s;
  if (missing_s > kSameTime * period_s) {
    schedule.Wait(missing_s);
  } else if (-missing_s > kSameTime * period_s) {
    scale = covered_s > 0 ? period_s / covered_s : 1;
  }
  std::size_t begin = 0;
  for (const ReplayTick& tick : replay.ticks) {
    const std::span<const ReplayImpulse> all(replay.impulses);
    schedule.Add(all.subspan(begin, tick.end - begin), tick, scale * tick.length_s);
    begin = tick.end;
  }
  schedule.Play(world);
}

}  // namespace rikiseki::world

#include "world_server/coupling/replay.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "world_server/coupling/kick.h"

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

class Player {
 public:
  Player(DynamicsWorld& world, double largest_impulse_ns)
      : world_(world), largest_impulse_ns_(largest_impulse_ns) {}

  void Wait(double time_s) { waiting_s_ += time_s; }

  void Play(std::span<const ReplayImpulse> impulses, const ReplayTick& tick, double length_s) {
    if (impulses.empty()) return Wait(length_s);
    const int blocks = static_cast<int>(
        std::min(static_cast<double>(tick.ticks), 1 + std::ceil(length_s / kShortestBlock)));
    for (int i = 0; i < blocks; ++i) {
      Catch();
      kicks_.clear();
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
        kicks_.push_back(
            KickAtCentre(push.body, impulse, angular_impulse, world_.State(push.body)));
      }
      world_.ApplyAndStep(kicks_, length_s / blocks);
    }
  }

  /// Lets pass what was waited for, in one go.
  void Catch() {
    if (waiting_s_ > 0) world_.ApplyAndStep({}, waiting_s_);
    waiting_s_ = 0;
  }

 private:
  DynamicsWorld& world_;
  double largest_impulse_ns_;
  double waiting_s_ = 0;
  std::vector<Kick> kicks_;
};

}  // namespace

void ReplayPush(const Replay& replay, double period_s, double largest_impulse_ns,
                DynamicsWorld& world) {
  double covered_s = 0;
  for (const ReplayTick& tick : replay.ticks) covered_s += tick.length_s;
  double scale = 1;
  Player player(world, largest_impulse_ns);
  const double missing_s = period_s - covered_s;
  if (missing_s > kSameTime * period_s) {
    player.Wait(missing_s);
  } else if (-missing_s > kSameTime * period_s) {
    scale = covered_s > 0 ? period_s / covered_s : 1;
  }
  std::size_t begin = 0;
  for (const ReplayTick& tick : replay.ticks) {
    const std::span<const ReplayImpulse> all(replay.impulses);
    player.Play(all.subspan(begin, tick.end - begin), tick, scale * tick.length_s);
    begin = tick.end;
  }
  player.Catch();
}

}  // namespace rikiseki::world

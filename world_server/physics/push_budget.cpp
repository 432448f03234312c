// SPDX-License-Identifier: MIT
#include "world_server/physics/push_budget.h"

#include <algorithm>
#include <cmath>

namespace rikiseki::world {
namespace {

// What a push at this speed gives per unit of its share [J].
double Power(const Kick& kick, const BodyState& state) {
  return kick.impulse.dot(state.velocity) + kick.angular_impulse.dot(state.angular_velocity);
}

}  // namespace

void PushBudget::Grant(const Means& means, const BodyState& state) {
  Settle(state);
  if (left_j_ < 0) left_j_ *= means.debt_kept;
  left_j_ = std::min(left_j_, means.spring_j) + means.work_j;
  overdraft_j_ = means.overdraft_j;
  if (!std::isfinite(left_j_)) left_j_ = 0;
  refused_.setZero();
}

// The force was held from kick to kick: its work is half of what its power was at both ends. Of a free body
// that is what was charged, of one that is held nothing, of one that is driven back less.
void PushBudget::Settle(const BodyState& state) {
  const double grown = Power(newest_, state) - Power(newest_, before_);
  if (std::isfinite(grown)) left_j_ += charged_j_ - std::clamp(grown / 2, -charged_j_, charged_j_);
  charged_j_ = 0;
}

// A share s of the kick gives a free body s power + s^2 own.
void PushBudget::Limit(const BodyInertia& inertia, const BodyState& state, Kick& kick) {
  Settle(state);
  const double power = Power(kick, state);
  const double own =
      0.5 * (kick.impulse.squaredNorm() / inertia.mass_kg +
             kick.angular_impulse.dot(inertia.InverseInertia(state.pose.orientation) *
                                      kick.angular_impulse));
  double share = 0;
  if (std::isfinite(power) && std::isfinite(own)) {
    share = 1;
    const double budget = left_j_ + (overdraft_j_ > 0 ? overdraft_j_ + own : 0);
    if (power + own > budget) {
      const double discriminant = power * power + 4 * own * budget;
      const double top = -power + (discriminant > 0 ? std::sqrt(discriminant) : 0);
      share = own > 0 ? std::clamp(top / (2 * own), 0.0, 1.0) : 0;
    }
    charged_j_ = share * share * own;
    left_j_ -= share * power + charged_j_;
  }
  refused_ += (1 - share) * kick.impulse;
  kick.impulse *= share;
  kick.angular_impulse *= share;
  newest_ = kick;
  before_ = state;
}

}  // namespace rikiseki::world

// SPDX-License-Identifier: MIT
#include "world_server/physics/sliding_block.h"

#include <cmath>
#include <stdexcept>

#include "common/body_step.h"

namespace rikiseki::world {

SlidingBlock::SlidingBlock(const Scene& scene, double friction, SlideRule rule,
                           double longest_substep_s)
    : friction_(friction),
      deceleration_(friction * std::abs(scene.gravity.z())),
      rule_(rule),
      longest_substep_s_(longest_substep_s) {
  std::size_t moving = 0;
  for (const SceneBody& body : scene.bodies) {
    states_.push_back({.pose = body.pose_WB});
    if (body.fixed) {
      floor_ = states_.size() - 1;
      continue;
    }
    ++moving;
    block_ = states_.size() - 1;
    mass_kg_ = body.mass_kg;
  }
  if (moving != 1 || !(mass_kg_ > 0)) {
    throw std::invalid_argument("a sliding block needs exactly one moving body with a mass");
  }
}

BodyState SlidingBlock::State(std::size_t body) const {
  BodyState state = states_[body];
  if (body == block_) {
    state.pose.position.x() += displacement_;
    state.velocity.x() = velocity_;
  }
  return state;
}

void SlidingBlock::SetState(std::size_t body, const BodyState& state) {
  if (body != block_) return;
  displacement_ = state.pose.position.x() - states_[block_].pose.position.x();
  velocity_ = state.velocity.x();
}

void SlidingBlock::ApplyAndStep(std::span<const Kick> kicks, double period_s) {
  for (const Kick& kick : kicks) {
    if (kick.body == block_) velocity_ += kick.impulse.x() / mass_kg_;
  }
  const int count = SubstepCount(period_s, longest_substep_s_);
  for (int done = 0; done < count; ++done) Substep(period_s / count);
}

void SlidingBlock::Substep(double step_s) {
  const double v = velocity_;
  const double loss = deceleration_ * step_s;
  const bool stops = std::abs(v) <= loss;
  velocity_ = stops ? 0 : v - std::copysign(loss, v);
  switch (rule_) {
    case SlideRule::kExact:
      if (!stops) {
        displacement_ += step_s * v - std::copysign(loss, v) * step_s / 2;
      } else if (v != 0) {
        displacement_ += v * std::abs(v) / (2 * deceleration_);
      }
      break;
    case SlideRule::kSemiImplicit:
      displacement_ += step_s * velocity_;
      break;
  }
}

bool SlidingBlock::FindContacts(std::size_t body, double /*reach_m*/,
                                std::vector<ContactSite>& sites) const {
  if (body != block_) return false;
  ContactSite& site = sites.emplace_back();
  site.other = floor_;
  site.friction = friction_;
  return true;
}

}  // namespace rikiseki::world

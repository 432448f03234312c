// SPDX-License-Identifier: MIT
#include "haptic_server/tuning.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace rikiseki::haptic {
namespace {

struct LiveKey {
  const char* key;
  double Tuning::*value;
};

constexpr std::array kLiveKeys{
    LiveKey{"render.stiffness_n_per_m", &Tuning::stiffness_n_per_m},
    LiveKey{"render.damping_ns_per_m", &Tuning::damping_ns_per_m},
    LiveKey{"render.friction_stiffness_n_per_m", &Tuning::friction_stiffness_n_per_m},
    LiveKey{"safety.force_cap_n", &Tuning::force_cap_n},
    LiveKey{"safety.slew_limit_n_per_s", &Tuning::slew_limit_n_per_s},
    LiveKey{"safety.speed_limit_m_per_s", &Tuning::speed_limit_m_per_s},
    LiveKey{"safety.light_damping_ns_per_m", &Tuning::light_damping_ns_per_m},
    LiveKey{"safety.soft_start_ms", &Tuning::soft_start_ms},
    LiveKey{"safety.fade_ms", &Tuning::fade_ms},
    LiveKey{"spidar.velocity_cutoff_hz", &Tuning::velocity_cutoff_hz},
};
static_assert(sizeof(Tuning) == kLiveKeys.size() * sizeof(double));

}  // namespace

Tuning TuningOf(const Settings& settings) {
  return {.stiffness_n_per_m = settings.render.stiffness_n_per_m,
          .damping_ns_per_m = settings.render.damping_ns_per_m,
          .friction_stiffness_n_per_m = settings.render.friction_stiffness_n_per_m,
          .force_cap_n = settings.safety.force_cap_n,
          .slew_limit_n_per_s = settings.safety.slew_limit_n_per_s,
          .speed_limit_m_per_s = settings.safety.speed_limit_m_per_s,
          .light_damping_ns_per_m = settings.safety.light_damping_ns_per_m,
          .soft_start_ms = settings.safety.soft_start_ms,
          .fade_ms = settings.safety.fade_ms,
          .velocity_cutoff_hz = settings.spidar.velocity_cutoff_hz};
}

void Adopt(const Tuning& tuning, Settings& settings) noexcept {
  settings.render.stiffness_n_per_m = tuning.stiffness_n_per_m;
  settings.render.damping_ns_per_m = tuning.damping_ns_per_m;
  settings.render.friction_stiffness_n_per_m = tuning.friction_stiffness_n_per_m;
  settings.safety.force_cap_n = tuning.force_cap_n;
  settings.safety.slew_limit_n_per_s = tuning.slew_limit_n_per_s;
  settings.safety.speed_limit_m_per_s = tuning.speed_limit_m_per_s;
  settings.safety.light_damping_ns_per_m = tuning.light_damping_ns_per_m;
  settings.safety.soft_start_ms = tuning.soft_start_ms;
  settings.safety.fade_ms = tuning.fade_ms;
  settings.spidar.velocity_cutoff_hz = tuning.velocity_cutoff_hz;
}

Tuning Between(const Tuning& from, const Tuning& to, double fraction) noexcept {
  Tuning between;
  for (const LiveKey& live : kLiveKeys) {
    between.*live.value = std::lerp(from.*live.value, to.*live.value, fraction);
  }
  return between;
}

std::vector<std::string> LiveKeys() {
  std::vector<std::string> keys;
  for (const LiveKey& live : kLiveKeys) keys.emplace_back(live.key);
  return keys;
}

bool TuningSlot::Offer(const Tuning& tuning) noexcept {
  // SYNC: full_. What the loop has read is over before it is written again.
  if (full_.load(std::memory_order_acquire)) return false;
  tuning_ = tuning;
  full_.store(true, std::memory_order_release);
  return true;
}

bool TuningSlot::Take(Tuning& tuning) noexcept {
  // SYNC: full_. The values are there for whoever sees it full.
  if (!full_.load(std::memory_order_acquire)) return false;
  tuning = tuning_;
  full_.store(false, std::memory_order_release);
  return true;
}

const Tuning& TuningRamp::Advance() noexcept {
  fraction_ = std::min(1.0, fraction_ + step_);
  now_ = Between(from_, to_, fraction_);
  return now_;
}

}  // namespace rikiseki::haptic

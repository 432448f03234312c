// SPDX-License-Identifier: MIT
// Everything a researcher may tune on the world side, with its defaults. settings.cpp gives the keys.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/config.h"
#include "protocol/messages.h"

namespace rikiseki::world {

struct LoopSettings {
  double rate_hz = 20;
};

struct SceneSettings {
  std::string file;   // an SDFormat world
  bool watch = true;  // its files, and change the running scene as they change
};

struct PhysicsSettings {
  double substep_ms = 1;
};

/// How `local` brings the push into the world.
enum class ReplayRule {
  kTicks,  // tick by tick, as it was displayed
  kLump,   // one kick per world tick: the naive way, unstable; for study only
};

struct CouplingSettings {
  protocol::Coupling coupling = protocol::Coupling::kLocal;
  double force_cap_n = 20;  // bounds what is applied after a gap: at most force_cap * gap
  ReplayRule replay = ReplayRule::kTicks;
  double gap_ms = 0;  // 0 = max(100 ms, 3 periods)
};

struct FeatureSettings {
  double radius_mm = 20;  // r_0: planes of bodies within r_0 + 2 Tw v_rel of the finger are sent
  double finger_friction = 0;  // Coulomb, of the finger; combined as sqrt(mu_finger mu_surface)
};

struct Settings {
  LoopSettings loop;
  SceneSettings scene;
  PhysicsSettings physics;
  CouplingSettings coupling;
  FeatureSettings features;

  std::int64_t period_ns() const;
  double gap_s() const;
};

/// Reads the daemon's file and the overrides and checks them. Throws ConfigError.
Settings LoadSettings(const std::string& path, const std::vector<std::string>& set,
                      std::string* description = nullptr, ConfigValues* values = nullptr);

/// The keys of what the running world takes: WorldStep::Tune, WorldLoop::Tune, and another scene.
std::vector<std::string> LiveKeys();

}  // namespace rikiseki::world

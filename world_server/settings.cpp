// SPDX-License-Identifier: MIT
#include "world_server/settings.h"

#include <algorithm>
#include <cmath>

namespace rikiseki::world {
namespace {

void Bind(ConfigSchema& schema, Settings& settings) {
  schema.Number("loop.rate_hz", &settings.loop.rate_hz, 1, 1000,
                "world ticks per second: 10 to 60 is what the project is for");
  schema.Path("scene.file", &settings.scene.file, "the SDFormat world to run");
  schema.Flag("scene.watch", &settings.scene.watch,
              "whether the running scene follows its files as they are edited");
  schema.Number(
      "physics.substep_ms", &settings.physics.substep_ms, 0.05, 10,
      "longest step of bodies that a push reaches; the others choose theirs by themselves");
  schema.Choice<protocol::Coupling>(
      "coupling.coupling", &settings.coupling.coupling,
      {{"position", protocol::Coupling::kPosition},
       {"impulse", protocol::Coupling::kImpulse},
       {"local", protocol::Coupling::kLocal}},
      "how the finger moves bodies: by the penetration sampled at the world tick, by the "
      "integrated force, or by the force tick by tick, with copies of the bodies on the haptic "
      "side");
  schema.Choice<ReplayRule>("coupling.replay", &settings.coupling.replay,
                            {{"ticks", ReplayRule::kTicks}, {"lump", ReplayRule::kLump}},
                            "how `local` brings the force into the world; lump is for study only");
  schema.Number("coupling.force_cap_n", &settings.coupling.force_cap_n, 0.01, 1e6,
                "one world tick applies at most this force times the gap, the rest is discarded");
  schema.Number("coupling.gap_ms", &settings.coupling.gap_ms, 0, 60000,
                "longest silence whose impulse is applied; 0 means max(100 ms, 3 periods)");
  schema.Number("features.radius_mm", &settings.features.radius_mm, 0, 10000,
                "bodies nearer to the finger than this, plus the way of two periods, send planes");
  schema.Number("features.finger_friction", &settings.features.finger_friction, 0, 10,
                "dynamic friction of the finger, combined with a surface's mu as sqrt(mu1 mu2)");
}

}  // namespace

std::int64_t Settings::period_ns() const {
  return std::llround(1e9 / loop.rate_hz);
}

double Settings::gap_s() const {
  return coupling.gap_ms > 0 ? coupling.gap_ms * 1e-3 : std::max(0.1, 3 / loop.rate_hz);
}

Settings LoadSettings(const std::string& path, const std::vector<std::string>& set,
                      std::string* description, ConfigValues* values) {
  Settings settings;
  ConfigSchema schema;
  Bind(schema, settings);
  schema.Load(path);
  for (const std::string& assignment : set) schema.Set(assignment);
  if (settings.scene.file.empty()) {
    schema.Refuse("scene.file", "the path of an SDFormat world is expected");
  }
  if (description != nullptr) *description = schema.Describe();
  if (values != nullptr) *values = schema.Values();
  return settings;
}

std::vector<std::string> LiveKeys() {
  return {"scene.file", "coupling.force_cap_n", "coupling.gap_ms", "features.radius_mm"};
}

}  // namespace rikiseki::world

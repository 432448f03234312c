// SPDX-License-Identifier: MIT
#include "haptic_server/open_replay.h"

#include <stdexcept>
#include <utility>
#include <vector>

#include "common/exit_code.h"
#include "haptic_server/device/mapping.h"
#include "haptic_server/device/replay.h"
#include "protocol/tools/recording.h"

namespace rikiseki::haptic {

std::unique_ptr<Device> OpenReplay(const Settings& settings) {
  const Mapping mapping(settings.mapping);
  std::vector<ReplaySample> samples;
  try {
    protocol::RecordingReader reader(settings.device.file);
    protocol::Record record;
    protocol::HapticTick tick;
    while (reader.Next(record)) {
      if (!record.Is(tick) || tick.pointer_count == 0) continue;
      const auto time_ns = static_cast<std::int64_t>(tick.start_ns);
      if (!samples.empty() && time_ns < samples.back().time_ns) continue;
      samples.push_back({.time_ns = time_ns,
                         .position = mapping.PointOnDevice(ToVec3(tick.pointers[0].position)),
                         .velocity = mapping.VelocityOnDevice(ToVec3(tick.pointers[0].velocity))});
    }
    return std::make_unique<Replay>(std::move(samples));
  } catch (const protocol::RecordingError& error) {
    throw StartError(kExitConfig, std::string("device.file: ") + error.what());
  } catch (const std::invalid_argument& error) {
    throw StartError(kExitConfig, "device.file: " + settings.device.file + ": " + error.what());
  }
}

}  // namespace rikiseki::haptic

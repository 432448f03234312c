// SPDX-License-Identifier: MIT
#include "haptic_server/guided/guided_run.h"

#include <atomic>
#include <csignal>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>

#include "common/clock.h"
#include "common/config_edit.h"
#include "common/daemon.h"
#include "common/exit_code.h"
#include "common/realtime.h"
#include "haptic_server/device/simulated_board.h"
#include "haptic_server/device/spidar.h"
#include "haptic_server/device/tension.h"
#include "haptic_server/device/usb/usb_device.h"
#include "haptic_server/guided/calibration_task.h"
#include "haptic_server/guided/identification_task.h"
#include "haptic_server/guided/simulated_hands.h"
#include "haptic_server/guided/stiffness_ramp.h"
#include "haptic_server/keyboard.h"

namespace rikiseki::haptic {
namespace {

constexpr int kPollMs = 100;

// The simulated hand does what the prompts ask for.
std::unique_ptr<MotorBoard> OpenBoardFor(Procedure procedure, const Settings& settings) {
  if (settings.device.kind == DeviceKind::kReplay || settings.device.kind == DeviceKind::kMouse) {
    throw StartError(kExitUsage,
                     "a recording has no device, a SPIDAR-mouse no strings that are counted: set "
                     "device.kind to usb or simulated");
  }
  if (settings.spidar.motors_m.size() != kTensionStrings) {
    throw StartError(kExitConfig, settings.device.file +
                                      ": --calibrate, --identify and --z-width know how to guide "
                                      "devices of 4 strings only, and this one has " +
                                      std::to_string(settings.spidar.motors_m.size()));
  }
  if (settings.device.kind == DeviceKind::kUsb) return OpenUsbBoard(settings);
  try {
    return std::make_unique<SimulatedBoard>(settings.spidar, procedure == Procedure::kCalibrate
                                                                 ? LeadingHand(settings)
                                                                 : AbsentHand(settings));
  } catch (const std::invalid_argument& error) {
    throw StartError(kExitConfig, settings.device.file + ": " + error.what());
  }
}

// RT:
void Loop(GuidedTask& task, std::int64_t period_ns, OperatorPanel& panel,
          const std::atomic<bool>& stop) noexcept {
  PeriodicSchedule schedule(MonotonicNow(), period_ns);
  TickTime time;
  bool goes_on = true;
  while (goes_on && !stop.load(std::memory_order_relaxed)) {
    SleepUntil(schedule.deadline_ns());
    const std::int64_t now_ns = MonotonicNow();
    time.missed += schedule.WakeUp(now_ns);
    time.previous_duration_ns = time.start_ns == 0 ? 0 : now_ns - time.start_ns;
    time.start_ns = now_ns;
    const OperatorInput wish = panel.Take();
    goes_on = !wish.stop && task.Tick(time, wish);
    time.missed = schedule.Advance(MonotonicNow());
  }
  task.Release();
}

// Shows prompts until the loop has ended; false if it was told to by a signal.
bool Guide(const GuidedTask& task, const Spidar* device, const MotorBoard& board,
           const std::atomic<bool>& ended) {
  std::string shown;
  std::string complaint;
  while (!ended) {
    if (const std::string prompt = task.Prompt(); prompt != shown) {
      shown = prompt;
      if (!shown.empty()) std::printf("%s\n", shown.c_str());
      std::fflush(stdout);
    }
    const std::string now = device != nullptr ? device->Complaint() : board.Complaint();
    if (now != complaint) {
      complaint = now;
      if (!complaint.empty()) std::fprintf(stderr, "device: %s\n", complaint.c_str());
    }
    const int signal = WaitForSignal(kPollMs);
    if (signal == SIGINT || signal == SIGTERM) return false;
  }
  return true;
}

}  // namespace

int RunGuided(Procedure procedure, const Settings& settings, OperatorPanel& panel) {
  std::unique_ptr<MotorBoard> owned = OpenBoardFor(procedure, settings);
  MotorBoard& board = *owned;
  std::unique_ptr<Spidar> device;
  std::unique_ptr<GuidedTask> task;
  if (procedure == Procedure::kCalibrate) {
    task = std::make_unique<CalibrationTask>(settings, board);
  } else {
    device = std::make_unique<Spidar>(settings.spidar, std::move(owned));
    if (procedure == Procedure::kIdentify) {
      task = std::make_unique<IdentificationTask>(settings, *device);
    } else {
      task = std::make_unique<StiffnessRamp>(settings, *device);
    }
  }
  const std::string memory_refusal = LockMemory();
  std::printf("%s. Space or enter stops at once, as does Ctrl-C.\n", board.Name().c_str());
  std::atomic<bool> stop{false};
  std::atomic<bool> ended{false};
  bool was_left_alone = false;
  {
    const Keyboard keyboard(panel);
    RealtimeThread thread({.fifo_priority = settings.loop.fifo_priority, .cpu = settings.loop.cpu},
                          [&] {
                            Loop(*task, settings.period_ns(), panel, stop);
                            ended = true;
                          });
    for (const std::string& refusal : {thread.obtained().refusal, memory_refusal}) {
      if (refusal.empty()) continue;
      if (settings.loop.realtime == RealtimePolicy::kEnforce) {
        stop = true;
        throw StartError(kExitConfig, "loop.realtime = enforce, but " + refusal);
      }
      std::fprintf(stderr, "not real-time: %s\n", refusal.c_str());
    }
    was_left_alone = Guide(*task, device.get(), board, ended);
    stop = true;
  }
  if (!was_left_alone) return kExitOk;
  Finding finding;
  try {
    finding = task->Result();
  } catch (const NothingFound& why) {
    std::fprintf(stderr, "%s\n", why.what());
    return kExitFault;
  }
  std::printf("%s\n", finding.text.c_str());
  if (finding.values.empty()) return kExitOk;
  SetValuesInFile(settings.device.file, finding.values);
  std::printf("Saved in %s:\n", settings.device.file.c_str());
  for (const auto& [key, value] : finding.values) {
    std::printf("  %s = %s\n", key.c_str(), value.c_str());
  }
  return kExitOk;
}

}  // namespace rikiseki::haptic

// SPDX-License-Identifier: MIT
// haptic_server: owns the force display and closes its force loop at 1 kHz.
#include <sched.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <optional>

#include "common/clock.h"
#include "common/daemon.h"
#include "common/logging.h"
#include "common/realtime.h"
#include "common/service_notice.h"
#include "common/version.h"
#include "haptic_server/device/usb/usb_device.h"
#include "haptic_server/guided/guided_run.h"
#include "haptic_server/keyboard.h"
#include "haptic_server/loop.h"
#include "haptic_server/open_replay.h"
#include "haptic_server/reload.h"
#include "haptic_server/safety/stability.h"
#include "haptic_server/selftest.h"
#include "protocol/words.h"

namespace {

using namespace rikiseki;          // NOLINT(google-build-using-namespace)
using namespace rikiseki::haptic;  // NOLINT(google-build-using-namespace)

constexpr int kSupervisorPollMs = 100;
constexpr std::uint64_t kHealthPeriodNs = 10'000'000;

constexpr char kPurpose[] =
    "the device daemon of Rikiseki\n\n"
    "SIGUSR1 is the emergency stop: minimum tension within one tick, until SIGUSR2 enables again.\n"
    "On a terminal: space or enter = emergency stop, e = enable again, c = clutch on and off.";

OperatorPanel panel;

// The signals of the emergency stop. The handlers do nothing but count.
void CatchOperatorSignals() {
  struct sigaction action {};
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  action.sa_handler = [](int) { panel.Stop(); };
  sigaction(SIGUSR1, &action, nullptr);
  action.sa_handler = [](int) { panel.Enable(); };
  sigaction(SIGUSR2, &action, nullptr);
}

// A world that publishes late by as much as its period must not be lapped (SPEC.md 6.1).
std::uint32_t TickSlots(const Settings& settings) {
  const auto longest_ns = static_cast<std::uint64_t>(settings.loop.longest_world_period_ms * 1e6);
  return protocol::HapticTickSlots(longest_ns, longest_ns,
                                   static_cast<std::uint64_t>(settings.period_ns()));
}

// Says what the machine gave, and refuses to run with less where the settings insist.
protocol::Scheduling JudgeRealtime(const Settings& settings, const RealtimeObtained& obtained,
                                   const std::string& memory_refusal) {
  spdlog::info("loop thread: {}{}", PolicyName(obtained.policy, obtained.priority),
               memory_refusal.empty() ? ", memory locked" : "");
  for (const std::string& refusal : {obtained.refusal, memory_refusal}) {
    if (refusal.empty()) continue;
    if (settings.loop.realtime == RealtimePolicy::kEnforce) {
      throw StartError(kExitConfig, "loop.realtime = enforce, but " + refusal);
    }
    spdlog::warn("not real-time: {}", refusal);
  }
  return {.policy = static_cast<std::uint32_t>(obtained.policy),
          .priority = static_cast<std::uint32_t>(obtained.priority),
          .memory_locked = memory_refusal.empty() ? 1U : 0U,
          .cpu = static_cast<std::uint32_t>(obtained.cpu)};
}

// Contact, its limits and its absence: what happens all the time and is not worth a line.
bool IsRendering(protocol::ForceReason reason) {
  return reason <= protocol::ForceReason::kSoftStart || reason == protocol::ForceReason::kPassivity;
}

std::optional<Procedure> ProcedureOf(const DaemonOptions& options) {
  std::optional<Procedure> chosen;
  constexpr std::array kProcedures = {Procedure::kCalibrate, Procedure::kIdentify,
                                      Procedure::kZWidth};
  for (std::size_t i = 0; i < kProcedures.size(); ++i) {
    if (options.extra[2 + i].empty()) continue;
    if (chosen) {
      throw StartError(kExitUsage, "of --calibrate, --identify and --z-width, one at a time");
    }
    chosen = kProcedures[i];
  }
  return chosen;
}

// For `systemctl status`.
std::string InOneLine(const Settings& settings, const Device& device, const HapticLoop& loop) {
  const protocol::Scheduling& scheduling = loop.scheduling();
  const protocol::ForceReason reason = loop.reason();
  return fmt::format(
      "{:g} Hz on {}, {}, memory {}. {}", settings.loop.rate_hz, device.Name(),
      PolicyName(static_cast<int>(scheduling.policy), static_cast<int>(scheduling.priority)),
      scheduling.memory_locked != 0 ? "locked" : "not locked",
      IsRendering(reason) ? "The world is felt." : protocol::Sentence(reason));
}

// Logs what changed and tells the service manager, for the tick may not; ends on SIGINT or SIGTERM.
void Supervise(const Settings& settings, const Device& device, HapticLoop& loop,
               protocol::PeerLink& link, Reload& reload, ServiceNotice& notice) {
  protocol::ForceReason logged = protocol::ForceReason::kNoContact;
  HapticLoop::WorldMode mode;
  bool unstable = false;
  std::string complaint;
  while (true) {
    const int signal = WaitForSignal(kSupervisorPollMs);
    notice.Progress(loop.progress(), MonotonicNow());
    notice.Status(InOneLine(settings, device, loop), MonotonicNow());
    if (signal == SIGINT || signal == SIGTERM) return;
    if (signal == SIGHUP) {
      notice.Reloading();
      reload.Again(loop);
      notice.Ready();
    }
    for (const std::string& line : link.PollNews()) spdlog::info("world: {}", line);
    if (loop.world_mode().period_ns != 0 && loop.world_mode() != mode) {
      mode = loop.world_mode();
      const std::string advice =
          CouplingAdvice(settings.render, mode.coupling, Seconds(mode.period_ns));
      if (!advice.empty()) spdlog::info("stability: {}", advice);
    }
    if (loop.unstable() != unstable) {
      unstable = !unstable;
      if (unstable) spdlog::warn("the contact is unstable: lower the stiffness or raise damping");
    }
    // Of a device that answers again, nothing is known to be wrong.
    if (const std::string now = device.Complaint(); now != complaint) {
      complaint = now;
      if (!complaint.empty()) spdlog::warn("device: {}", complaint);
    }
    const protocol::ForceReason reason = loop.reason();
    if (IsRendering(reason) && IsRendering(logged)) continue;
    if (reason != logged) spdlog::info("force: {}", protocol::Sentence(reason));
    logged = reason;
  }
}

// Of --selftest; 0: not asked for.
double SelftestSeconds(const std::string& text) {
  if (text.empty()) return 0;
  double seconds = 0;
  const char* const end = text.data() + text.size();
  if (std::from_chars(text.data(), end, seconds).ptr != end || !(seconds >= 1 && seconds <= 1e5)) {
    throw StartError(kExitUsage, "--selftest " + text + ": 1 to 100000 seconds");
  }
  return seconds;
}

int Run(int argc, char** argv) {
  CatchOperatorSignals();
  DaemonOptions options = ParseDaemonOptions(
      argc, argv, "haptic_server", kPurpose,
      {{"device", "simulated|usb|mouse|replay", "wins over device.kind"},
       {"selftest", "SECONDS", "says whether this PC holds the loop (default 10 s), and ends",
        "10"},
       {"calibrate", "", "finds out where the motors are, and saves it"},
       {"identify", "",
        "finds out mass, damping, friction and latency of the device, and saves them"},
       {"z-width", "", "finds out how stiff a wall the device bears"}});
  std::vector<std::string> overrides = options.set;
  const std::optional<Procedure> procedure = ProcedureOf(options);
  if (!options.extra[0].empty()) overrides.push_back("device.kind=" + options.extra[0]);
  const double selftest_s = SelftestSeconds(options.extra[1]);
  if (selftest_s > 0) {  // of the PC, beside whatever runs, and with no device
    overrides.insert(overrides.end(), {"device.kind=simulated", "loop.realtime=ignore"});
    options.instance = "selftest-" + std::to_string(getpid());
  }
  std::string description;
  ConfigValues values;
  const Settings settings = LoadSettings(options.config, overrides, &description, &values);
  StartLogging("haptic_server");
  for (const std::string& warning : DeviceWarnings(settings)) {
    spdlog::warn("stability: {}", warning);
  }
  if (options.check) {
    std::fputs(description.c_str(), stdout);
    const std::string board = DescribeBoard(settings);
    if (!board.empty()) std::printf("# device: %s\n", board.c_str());
    const std::string stability = LargestStiffnessInWords(settings);
    if (!stability.empty()) std::printf("# stability: %s\n", stability.c_str());
    return kExitOk;
  }
  BlockSignals();
  if (procedure) return RunGuided(*procedure, settings, panel);
  const std::unique_ptr<Device> device =
      settings.device.kind == DeviceKind::kReplay ? OpenReplay(settings) : OpenDevice(settings);
  const auto period_ns = static_cast<std::uint64_t>(settings.period_ns());
  protocol::SegmentOwner owner(
      {.instance = options.instance,
       .role = protocol::Role::kHaptic,
       .streams = protocol::HapticStreams(period_ns, TickSlots(settings), kHealthPeriodNs),
       .build = kBuild,
       .runtime_directory = ""});
  for (const std::string& note : owner.notes()) spdlog::info("{}", note);
  protocol::PeerLink link({.peer = {.instance = options.instance,
                                    .role = protocol::Role::kWorld,
                                    .required = {{.type = protocol::StreamType::kWorldFrame}},
                                    .owners = {}}});
  HapticStep step(settings, *device, owner.epoch());
  HapticLoop loop(settings, step, owner, link, panel);

  const std::string memory_refusal = LockMemory();
  std::atomic<bool> go{false};
  std::atomic<bool> stop{false};
  RealtimeThread thread({.fifo_priority = settings.loop.fifo_priority, .cpu = settings.loop.cpu},
                        [&] {
                          while (!go && !stop) SleepUntil(MonotonicNow() + 1'000'000);
                          if (!stop) loop.Run(stop);
                        });
  try {
    loop.SetScheduling(JudgeRealtime(settings, thread.obtained(), memory_refusal));
    go = true;
    spdlog::info("{} at {} Hz on {}, build {}", owner.name(), settings.loop.rate_hz, device->Name(),
                 kBuild);
    if (selftest_s > 0) {
      WaitForSignal(static_cast<int>(1e3 * selftest_s));
    } else {
      const Keyboard keyboard(panel);
      if (keyboard.is_there()) {
        spdlog::info("keys: space or enter = emergency stop, e = enable again, c = clutch");
      }
      ServiceNotice notice;
      notice.Ready();
      Reload reload(options.config, overrides, values);
      Supervise(settings, *device, loop, link, reload, notice);
      notice.Stopping();
    }
  } catch (...) {
    stop = true;
    throw;
  }
  stop = true;
  thread.Join();
  if (selftest_s > 0) {
    std::fputs(
        SelftestReport(loop.health(), selftest_s, {thread.obtained().refusal, memory_refusal})
            .c_str(),
        stdout);
    return Judge(loop.health(), selftest_s) == Hold::kNot ? kExitFault : kExitOk;
  }
  spdlog::info("stopped, the device is released");
  return kExitOk;
}

}  // namespace

int main(int argc, char** argv) {
  return RunProgram("haptic_server", [&] {
    try {
      return Run(argc, argv);
    } catch (const protocol::SegmentError& error) {
      throw StartError(error.exit_code(), error.what());
    }
  });
}

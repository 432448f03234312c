// SPDX-License-Identifier: MIT
// usb_emulator: a Cyverse board with strings and a hand behind it, or a SPIDAR-mouse, for the whole,
// unmodified daemon:
//
//   umockdev-wrapper usb_emulator --config haptic_server.ini --control SOCKET
//       [--set device.file=... ] [--switch N] [--tick-us US] [--on-request] [--middle-ticks N]
//   UMOCKDEV_DIR=<what `root` answers> umockdev-wrapper haptic_server --device usb ...
//
// It listens on a socket for one command a line, and answers each with one line (Commands below). The
// hand and the strings move on by one tick with each reading of the encoders, not by the clock; only
// the watchdog of the firmware goes on by the clock when the host has been silent for 0.1 s.
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <boost/program_options.hpp>
#include <cstring>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <sstream>
#include <thread>

#include "common/clock.h"
#include "common/command_line.h"
#include "common/daemon.h"
#include "tests/usb/emulated_board.h"
#include "tests/usb/emulated_mouse.h"
#include "tests/usb/usbfs.h"

namespace {

using namespace rikiseki;        // NOLINT(google-build-using-namespace)
using namespace rikiseki::test;  // NOLINT(google-build-using-namespace)

constexpr std::int64_t kSilenceNs = 100'000'000;

struct Options {
  std::string config;
  std::vector<std::string> set;
  std::string control;
  int switch_id = 5;
  int tick_us = 1000;
  bool on_request = false;
  int middle_ticks = 100;
};

// A board on the bus: firmware, hand and the clock of the hand. Guarded by `mutex`.
class BoardOnBus {
 public:
  BoardOnBus(UMockdevTestbed* testbed, std::mutex& mutex, const haptic::Settings& settings,
             const Options& options, int number)
      : tick_ns_(options.tick_us * 1'000LL),
        // An Sh4 is read with every packet, twice a tick: half a tick each.
        step_ns_(settings.usb.board == haptic::UsbBoardModel::kSh4 ? tick_ns_ / 2 : tick_ns_),
        board_(settings, options.switch_id,
               options.on_request ? EmulatedBoard::Begins::kOnRequest
                                  : EmulatedBoard::Begins::kByItself),
        bus_(testbed, mutex,
             {.vendor = 0x0CEC,
              .product = static_cast<std::uint16_t>(
                  settings.usb.board == haptic::UsbBoardModel::kSh4 ? 0x0205 : 0x0203),
              .number = number},
             [this](const std::vector<std::uint8_t>& packet) { return Answer(packet); }) {
    board_.HoldInTheMiddle(options.middle_ticks, tick_ns_);
  }

  EmulatedBoard& board() { return board_; }
  UsbFs& bus() { return bus_; }

  // To be called often: what goes by the clock.
  void Pass() {
    bus_.Pump();
    const std::int64_t now_ns = MonotonicNow();
    if (now_ns - heard_ns_ < kSilenceNs) {
      firmware_ns_ = now_ns;
      return;
    }
    for (; firmware_ns_ + tick_ns_ <= now_ns; firmware_ns_ += tick_ns_) board_.FirmwareTick();
  }

 private:
  std::optional<std::vector<std::uint8_t>> Answer(const std::vector<std::uint8_t>& packet) {
    heard_ns_ = MonotonicNow();
    auto reply = board_.Handle(packet, hand_ns_ + step_ns_);
    if (reply) {
      hand_ns_ += step_ns_;
      board_.FirmwareTick();
    }
    return reply;
  }

  std::int64_t tick_ns_;
  std::int64_t step_ns_;
  std::int64_t hand_ns_ = 0;
  std::int64_t heard_ns_ = 0;
  std::int64_t firmware_ns_ = 0;
  EmulatedBoard board_;
  UsbFs bus_;
};

class Emulator {
 public:
  Emulator(UMockdevTestbed* testbed, const haptic::Settings& settings, const Options& options)
      : testbed_(testbed),
        first_(testbed, mutex_, settings, options, 2),
        second_(testbed, mutex_, settings, options, 3),
        blank_(testbed, mutex_, {.vendor = 0x04B4, .product = 0x8613, .number = 4},
               [](const auto&) { return std::nullopt; }),
        mouse_bus_(testbed, mutex_,
                   {.vendor = 0x04D8, .product = 0x003F, .number = 5, .is_hid = true},
                   [this](const auto& packet) { return mouse_.Handle(packet, 0); }),
        clock_([this] {
          while (!stop_) {
            SleepUntil(MonotonicNow() + 1'000'000);
            const std::lock_guard lock(mutex_);
            first_.Pass();
            second_.Pass();
          }
        }) {}

  ~Emulator() {
    stop_ = true;
    clock_.join();
  }
  Emulator(const Emulator&) = delete;
  Emulator& operator=(const Emulator&) = delete;

  std::string Command(const std::string& line) {
    std::istringstream words(line);
    std::string verb;
    std::string what;
    words >> verb >> what;
    EmulatedBoard& board = first_.board();
    UsbFs& bus = first_.bus();
    const std::map<std::string, std::function<void()>> outside = {
        {"plug", [&] { bus.Plug({.busy = what == "busy"}, what != "forbidden"); }},
        {"unplug", [&] { bus.Unplug(); }},
        {"permit", [&] { bus.GivePermission(); }},
        {"plug_second", [&] { second_.bus().Plug(); }},
        {"unplug_second", [&] { second_.bus().Unplug(); }},
        {"plug_blank", [&] { blank_.Plug(); }},
        {"unplug_blank", [&] { blank_.Unplug(); }},
        {"plug_mouse", [&] { mouse_bus_.Plug({}, what != "forbidden"); }},
        {"unplug_mouse", [&] { mouse_bus_.Unplug(); }}};
    const std::map<std::string, std::function<void()>> locked = {
        {"begin", [&] { board.Begin(); }},
        {"forget", [&] { board.ForgetCounters(); }},  // the power was away as well
        {"stall_in", [&] { bus.faults.stall_in = true; }},
        {"stall_out", [&] { bus.faults.stall_out = true; }},
        {"nak", [&] { bus.faults.nak = what == "on"; }},
        {"busy", [&] { bus.faults.busy = what == "on"; }},
        {"late_us", [&] { bus.delay_ns = std::stol(what) * 1'000; }},
        {"mute", [&] { bus.delay_ns = what == "on" ? -1 : 0; }},
        {"reply_bytes",
         [&] {
           board.faults.reply_bytes.reset();
           if (what != "right") board.faults.reply_bytes = std::stoul(what);
         }},
        {"wrong_echo", [&] { board.faults.wrong_echo = what == "on"; }},
        {"foreign", [&] { board.faults.foreign_firmware = what == "on"; }}};
    if (verb == "root") {
      gchar* root = umockdev_testbed_get_root_dir(testbed_);
      std::string text = root;
      g_free(root);
      return text;
    }
    if (verb == "status") return Status();
    if (verb == "mouse_status") return MouseStatus();
    if (const auto found = outside.find(verb); found != outside.end()) {
      found->second();
    } else if (const auto inside = locked.find(verb); inside != locked.end()) {
      const std::lock_guard lock(mutex_);
      inside->second();
      bus.Apply();
    } else {
      return "what?";
    }
    return "done";
  }

 private:
  // readings, commands, nonsense, motors at zero, longest pull without a command [ticks]
  std::string Status() {
    const std::lock_guard lock(mutex_);
    std::ostringstream text;
    text << first_.board().readings() << " " << first_.board().commands() << " "
         << first_.board().nonsense() << " " << first_.board().MotorsAtZero() << " "
         << first_.board().longest_uncommanded_pull();
    return text.str();
  }

  // started, force x and y [N], forces, stops, nonsense
  std::string MouseStatus() {
    const std::lock_guard lock(mutex_);
    std::ostringstream text;
    text << mouse_.is_started() << " " << mouse_.force()[0] << " " << mouse_.force()[1] << " "
         << mouse_.forces() << " " << mouse_.stops() << " " << mouse_.nonsense();
    return text.str();
  }

  UMockdevTestbed* testbed_;
  std::mutex mutex_;
  BoardOnBus first_;
  BoardOnBus second_;
  UsbFs blank_;
  EmulatedMouse mouse_;
  UsbFs mouse_bus_;
  std::atomic<bool> stop_{false};
  std::thread clock_;
};

// Serves one client after the other, until one says quit.
void Serve(const std::string& path, Emulator& emulator) {
  const int listener = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  if (bind(listener, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
      listen(listener, 1) != 0) {
    throw std::runtime_error("cannot listen at " + path);
  }
  while (true) {
    const int client = accept4(listener, nullptr, nullptr, SOCK_CLOEXEC);
    if (client < 0) return;
    std::string line;
    char c = 0;
    while (read(client, &c, 1) == 1) {
      if (c != '\n') {
        line += c;
        continue;
      }
      if (line == "quit") {
        close(client);
        close(listener);
        return;
      }
      const std::string answer = emulator.Command(line) + "\n";
      line.clear();
      if (write(client, answer.data(), answer.size()) < 0) break;
    }
    close(client);
  }
}

int Run(int argc, char** argv) {
  namespace po = boost::program_options;
  Options options;
  CommandLine line{.program = "usb_emulator",
                   .visible = po::options_description("usb_emulator: a SPIDAR on an emulated USB")};
  line.visible.add_options()("config", po::value(&options.config)->required(), "of haptic_server")(
      "set", po::value(&options.set)->composing(), "likewise")(
      "control", po::value(&options.control)->required(), "socket for commands")(
      "switch", po::value(&options.switch_id), "where the rotary switch stands")(
      "tick-us", po::value(&options.tick_us), "that the hand moves on by a tick")(
      "on-request", po::bool_switch(&options.on_request), "the hand waits for `begin`")(
      "middle-ticks", po::value(&options.middle_ticks), "for which the hand stays there first");
  ParseCommandLine(argc, argv, line);
  options.set.emplace_back("device.kind=usb");
  const haptic::Settings settings = haptic::LoadSettings(options.config, options.set);

  // Daemons of other users find sockets and files of the bus; only its device node asks who they are.
  umask(0);
  // Nothing of this outlives the test that started it.
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  // A device answers promptly, however busy the machine is: where it may, before all but the daemon's loop. The
  // threads that umockdev starts inherit it.
  prctl(PR_SET_TIMERSLACK, 1);
  const sched_param prompt{.sched_priority = 70};
  sched_setscheduler(0, SCHED_FIFO, &prompt);
  UMockdevTestbed* testbed = umockdev_testbed_new();
  if (umockdev_in_mock_environment() == 0) {
    throw StartError(kExitUsage, "run it under umockdev-wrapper");
  }
  gchar* hub = umockdev_testbed_add_device(
      testbed, "usb", "usb1", nullptr, "busnum", "1", "devnum", "1", "speed", "480",
      "bConfigurationValue", "1", nullptr, "DEVTYPE", "usb_device", "DEVNAME",
      "/dev/bus/usb/001/001", "BUSNUM", "001", "DEVNUM", "001", nullptr);
  std::array<unsigned char, 43> hub_descriptors = {
      18, 1, 0, 2,    9, 0, 1, 64, 0x6B, 0x1D, 2, 0, 0, 6, 0, 0, 0,    1, 9, 2, 25, 0,
      1,  1, 0, 0xE0, 0, 9, 4, 0,  0,    1,    9, 0, 0, 0, 7, 5, 0x81, 3, 4, 0, 12};
  umockdev_testbed_set_attribute_binary(testbed, hub, "descriptors", hub_descriptors.data(),
                                        static_cast<int>(hub_descriptors.size()));
  {
    Emulator emulator(testbed, settings, options);
    gchar* root = umockdev_testbed_get_root_dir(testbed);
    chmod(root, 0777);
    g_free(root);
    Serve(options.control, emulator);
  }
  g_free(hub);
  g_object_unref(testbed);
  return kExitOk;
}

}  // namespace

int main(int argc, char** argv) {
  return RunProgram("usb_emulator", [&] { return Run(argc, argv); });
}

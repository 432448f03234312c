// SPDX-License-Identifier: MIT
// Plugging in and out: the device in sysfs, its node, its descriptors.
#include <fcntl.h>
#include <linux/usbdevice_fs.h>
#include <pty.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <thread>
#include <utility>

#include "common/clock.h"
#include "tests/usb/usbfs.h"

namespace rikiseki::test {
namespace {

constexpr char kHub[] = "usb1";
constexpr std::int64_t kQuietNs = 300'000'000;
constexpr int kPatienceMs = 10'000;

std::uint8_t Low(std::uint16_t word) {
  return static_cast<std::uint8_t>(word);
}
std::uint8_t High(std::uint16_t word) {
  return static_cast<std::uint8_t>(word >> 8);
}

// Device and one configuration of one interface. A HID's has its pipes at once: interrupt, EP1 out and in, 64
// bytes, as Microchip's have. Else they are in setting 1: bulk, EP2 out and EP6 in, 512 bytes; setting 0 has
// none, as EZ-USB firmware likes it.
std::vector<std::uint8_t> Descriptors(const UsbFs::Identity& identity) {
  const std::uint16_t vendor = identity.vendor;
  const std::uint16_t product = identity.product;
  std::vector<std::uint8_t> device = {
      18, 1, 0, 2, 0, 0, 0, 64, Low(vendor), High(vendor), Low(product), High(product),
      1,  0, 0, 0, 0, 1};
  const std::vector<std::uint8_t> of_hid = {9, 2,    41,   0, 1,  1, 0,  0xC0, 50,  // configuration
                                            9, 4,    0,    0, 2,  3, 0,  0,    0,   // interface 0
                                            9, 0x21, 17,   1, 0,  1, 34, 29,   0,   // HID
                                            7, 5,    1,    3, 64, 0, 1,             // EP1 out
                                            7, 5,    0x81, 3, 64, 0, 1};            // EP1 in
  const std::vector<std::uint8_t> of_board = {
      9, 2, 41,   0, 1, 1,    0, 0xC0, 50,  // configuration
      9, 4, 0,    0, 0, 0xFF, 0, 0,    0,   // interface 0, setting 0
      9, 4, 0,    1, 2, 0xFF, 0, 0,    0,   // setting 1
      7, 5, 0x02, 2, 0, 2,    0,            // EP2 out
      7, 5, 0x86, 2, 0, 2,    0};           // EP6 in
  if (!identity.is_hid) device[4] = 0xFF;
  const std::vector<std::uint8_t>& rest = identity.is_hid ? of_hid : of_board;
  device.insert(device.end(), rest.begin(), rest.end());
  return device;
}

std::string Three(int number) {
  std::array<char, 8> text{};
  std::snprintf(text.data(), text.size(), "%03d", number);
  return text.data();
}

std::string Hex(std::uint16_t word) {
  std::array<char, 8> text{};
  std::snprintf(text.data(), text.size(), "%04x", word);
  return text.data();
}

}  // namespace

UsbFs::UsbFs(UMockdevTestbed* testbed, std::mutex& mutex, const Identity& identity,
             Function function)
    : testbed_(testbed),
      mutex_(mutex),
      identity_(identity),
      function_(std::move(function)),
      name_("1-" + std::to_string(identity.number - 1)),
      node_("/dev/bus/usb/001/" + Three(identity.number)),
      descriptors_(Descriptors(identity)) {
  handler_ = umockdev_ioctl_base_new();
  g_signal_connect(handler_, "handle-ioctl", G_CALLBACK(OnIoctl), this);
  g_signal_connect(handler_, "client-vanished", G_CALLBACK(OnVanished), this);
}

UsbFs::~UsbFs() {
  if (plugged_) Unplug();
  g_object_unref(handler_);
}

std::string UsbFs::Path(const std::string& relative) const {
  gchar* root = umockdev_testbed_get_root_dir(testbed_);
  std::string path = root + relative;
  g_free(root);
  return path;
}

// A terminal stands for the node: its output can be stopped and started, which poll shows as usbfs
// shows that nothing or something can be reaped; and its end looks like an unplugged device.
void UsbFs::MakeNode(bool with_permission) {
  std::array<char, 64> name{};
  if (openpty(&master_, &slave_, name.data(), nullptr, nullptr) != 0) {
    throw std::runtime_error("openpty failed");
  }
  terminal_ = name.data();
  termios settings{};
  tcgetattr(slave_, &settings);
  cfmakeraw(&settings);
  tcsetattr(slave_, TCSANOW, &settings);
  fcntl(master_, F_SETFD, FD_CLOEXEC);
  fcntl(slave_, F_SETFD, FD_CLOEXEC);
  chmod(terminal_.c_str(), with_permission ? 0666 : 0600);
  const std::filesystem::path link = Path(node_);
  std::filesystem::create_directories(link.parent_path());
  std::filesystem::remove(link);
  std::filesystem::create_symlink(terminal_, link);
  shown_busy_ = false;
}

void UsbFs::GivePermission() {
  chmod(terminal_.c_str(), 0666);
}

// Node, descriptors and ioctl handler come before add_device: that one announces the device.
void UsbFs::Plug(const BusFaults& already, bool with_permission) {
  const std::filesystem::path folder = Path(std::string("/sys/devices/") + kHub + "/" + name_);
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "descriptors", std::ios::binary)
      .write(reinterpret_cast<const char*>(descriptors_.data()),
             static_cast<std::streamsize>(descriptors_.size()));
  {
    const std::lock_guard lock(mutex_);
    for (auto* queue : {&in_, &out_, &done_}) {
      for (const Urb& urb : *queue) Forget(urb);
      queue->clear();
    }
    replies_.clear();
    faults = already;
    delay_ns = 0;
    plugged_ = true;
    MakeNode(with_permission);
    ShowReadiness();
  }
  GError* error = nullptr;
  if (umockdev_testbed_attach_ioctl(testbed_, node_.c_str(), handler_, &error) == 0) {
    throw std::runtime_error(std::string("attach_ioctl: ") + error->message);
  }
  const std::string number = std::to_string(identity_.number);
  const std::string product = Hex(identity_.vendor) + "/" + Hex(identity_.product) + "/1";
  const std::string hub = std::string("/sys/devices/") + kHub;
  sysfs_ = umockdev_testbed_add_device(
      testbed_, "usb", name_.c_str(), hub.c_str(), "busnum", "1", "devnum", number.c_str(), "speed",
      "480", "bConfigurationValue", "1", "idVendor", Hex(identity_.vendor).c_str(), "idProduct",
      Hex(identity_.product).c_str(), nullptr, "DEVTYPE", "usb_device", "DEVNAME", node_.c_str(),
      "BUSNUM", "001", "DEVNUM", Three(identity_.number).c_str(), "MAJOR", "189", "MINOR",
      std::to_string(identity_.number - 1).c_str(), "PRODUCT", product.c_str(), nullptr);
}

void UsbFs::Unplug() {
  {
    const std::lock_guard lock(mutex_);
    plugged_ = false;
    for (auto* queue : {&in_, &out_}) {
      while (!queue->empty()) {
        const Urb urb = queue->front();
        queue->pop_front();
        Finish(urb, -ESHUTDOWN, 0);
      }
    }
    ShowReadiness();
  }
  // The host reaps what failed first, then sees the node end.
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  umockdev_testbed_uevent(testbed_, sysfs_, "remove");
  umockdev_testbed_remove_device(testbed_, sysfs_);
  std::filesystem::remove(Path(node_));
  g_free(sysfs_);
  sysfs_ = nullptr;
  {
    const std::lock_guard lock(mutex_);
    close(std::exchange(master_, -1));
    close(std::exchange(slave_, -1));
  }
  // umockdev ends a host whose call it cuts short: who has the node open, learns of its end first.
  for (int i = 0; i < kPatienceMs && !IsQuiet(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  umockdev_testbed_detach_ioctl(testbed_, node_.c_str(), nullptr);
}

bool UsbFs::IsQuiet() {
  const std::lock_guard lock(mutex_);
  return MonotonicNow() - called_ns_ > kQuietNs;
}

}  // namespace rikiseki::test

// SPDX-License-Identifier: MIT
// One USB device at the level of usbfs, on umockdev: the ioctls that libusb makes, the device node,
// its descriptors in sysfs, plugging in and out. What the bus carries is the business of who makes it.
#pragma once

#include <umockdev.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace rikiseki::test {

/// What the bus may do wrong.
struct BusFaults {
  bool stall_in = false;   // until the host clears the halt
  bool stall_out = false;  // likewise
  bool nak = false;        // nothing moves
  bool busy = false;       // the interface is claimed by another program
};

class UsbFs {
 public:
  /// What a packet to the OUT endpoint is answered with from the IN endpoint. Called with the lock of `mutex` held.
  using Function = std::function<std::optional<std::vector<std::uint8_t>>(
      const std::vector<std::uint8_t>& packet)>;

  struct Identity {
    std::uint16_t vendor = 0;
    std::uint16_t product = 0;
    int number = 2;       // on the bus, from 2
    bool is_hid = false;  // interrupt endpoints EP1, 64 bytes, instead of bulk EP2 and EP6
  };

  /// `testbed` outlives it. `mutex` guards everything that ioctls touch.
  UsbFs(UMockdevTestbed* testbed, std::mutex& mutex, const Identity& identity, Function function);
  ~UsbFs();
  UsbFs(const UsbFs&) = delete;
  UsbFs& operator=(const UsbFs&) = delete;

  /// Appears on the bus, well but for `already`; without permission its node is root's alone.
  void Plug(const BusFaults& already = {}, bool with_permission = true);
  void Unplug();
  bool plugged() const { return plugged_; }

  /// Grants what Plug withheld.
  void GivePermission();

  /// To be called after a change of `faults`, with the lock held.
  void Apply();

  BusFaults faults;

  /// Replies are handed over only this much later; < 0: they get lost. With the lock held.
  std::int64_t delay_ns = 0;

  /// Hands over what has become due.
  void Pump();

 private:
  struct Urb {
    const UMockdevIoctlClient* client = nullptr;
    UMockdevIoctlData* data = nullptr;
    UMockdevIoctlData* buffer = nullptr;
    std::uint64_t address = 0;  // of the host's struct: its name when it is discarded
  };
  struct Reply {
    std::int64_t due_ns = 0;
    std::vector<std::uint8_t> bytes;
  };

  static gboolean OnIoctl(UMockdevIoctlBase* base, UMockdevIoctlClient* client, gpointer self);
  static void OnVanished(UMockdevIoctlBase* base, UMockdevIoctlClient* client, gpointer self);
  static void Forget(const Urb& urb);
  void Ioctl(UMockdevIoctlClient* client);
  void Submit(UMockdevIoctlClient* client, UMockdevIoctlData* argument);
  void Reap(UMockdevIoctlClient* client, UMockdevIoctlData* argument);
  bool Discard(std::uint64_t address);
  void Control(const Urb& urb);
  void Out(const Urb& urb);
  void Finish(const Urb& urb, int status, std::size_t length);
  void ShowReadiness();
  std::string Path(const std::string& relative) const;
  void MakeNode(bool with_permission);
  bool IsQuiet();

  UMockdevTestbed* testbed_;
  std::mutex& mutex_;
  Identity identity_;
  Function function_;
  std::string name_;  // "1-1"
  std::string node_;  // "/dev/bus/usb/001/002"
  std::vector<std::uint8_t> descriptors_;
  UMockdevIoctlBase* handler_ = nullptr;
  gchar* sysfs_ = nullptr;
  int master_ = -1;
  int slave_ = -1;
  std::string terminal_;
  bool shown_busy_ = false;
  bool plugged_ = false;
  std::int64_t called_ns_ = 0;  // the last ioctl
  std::deque<Urb> in_;          // that wait for a reply
  std::deque<Urb> out_;         // that wait for the bus to move
  std::deque<Urb> done_;        // to be reaped
  std::deque<Reply> replies_;
};

}  // namespace rikiseki::test

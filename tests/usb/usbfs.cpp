#include "tests/usb/usbfs.h"

#include <fcntl.h>
#include <linux/usbdevice_fs.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "common/clock.h"

namespace rikiseki::test {
namespace {

constexpr char kHub[] = "usb1";

std::uint8_t Low(std::uint16_t word) {
  return static_cast<std::uint8_t>(word);
}
std::uint8_t High(std::uint16_t word) {
  return static_cast<std::uint8_t>(word >> 8);
}

// Device, one configuration, one interface whose setting 1 has the pipes: bulk, EP2 out and EP6 in,
// 512 bytes. Setting 0 has none, as EZ-USB firmware likes it.
std::vector<std::uint8_t> Descriptors(std::uint16_t vendor, std::uint16_t product) {
  return {
      18, 1, 0,    2, 0xFF, 0,    0, 64,   Low(vendor), High(vendor), Low(product), High(product),
      1,  0, 0,    0, 0,    1,                  // device
      9,  2, 41,   0, 1,    1,    0, 0xC0, 50,  // configuration
      9,  4, 0,    0, 0,    0xFF, 0, 0,    0,   // interface 0, setting 0
      9,  4, 0,    1, 2,    0xFF, 0, 0,    0,   // setting 1
      7,  5, 0x02, 2, 0,    2,    0,            // EP2 out
      7,  5, 0x86, 2, 0,    2,    0};           // EP6 in
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
      descriptors_(Descriptors(identity.vendor, identity.product)) {
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
  umockdev_testbed_detach_ioctl(testbed_, node_.c_str(), nullptr);
  close(master_);
  close(slave_);
  umockdev_testbed_remove_device(testbed_, sysfs_);
  std::filesystem::remove(Path(node_));
  g_free(sysfs_);
  sysfs_ = nullptr;
}

void UsbFs::ShowReadiness() {
  const bool busy = done_.empty() && plugged_;
  if (busy == shown_busy_) return;
  tcflow(slave_, busy ? TCOOFF : TCOON);
  shown_busy_ = busy;
}

void UsbFs::Finish(const Urb& urb, int status, std::size_t length) {
  auto* raw = reinterpret_cast<usbdevfs_urb*>(urb.data->data);
  raw->status = status;
  raw->actual_length = static_cast<int>(length);
  done_.push_back(urb);
}

void UsbFs::Apply() {
  while (faults.stall_in && !in_.empty()) {
    const Urb urb = in_.front();
    in_.pop_front();
    Finish(urb, -EPIPE, 0);
  }
  while (!faults.nak && !out_.empty()) {
    const Urb urb = out_.front();
    out_.pop_front();
    Out(urb);
  }
  Pump();
}

void UsbFs::Pump() {
  while (!faults.nak && !in_.empty() && !replies_.empty() &&
         replies_.front().due_ns <= MonotonicNow()) {
    const Urb urb = in_.front();
    in_.pop_front();
    const std::vector<std::uint8_t> bytes = std::move(replies_.front().bytes);
    replies_.pop_front();
    const auto room =
        static_cast<std::size_t>(reinterpret_cast<usbdevfs_urb*>(urb.data->data)->buffer_length);
    const std::size_t length = std::min(bytes.size(), room);
    if (length > 0) std::memcpy(urb.buffer->data, bytes.data(), length);
    Finish(urb, bytes.size() > room ? -EOVERFLOW : 0, length);
  }
  ShowReadiness();
}

void UsbFs::Out(const Urb& urb) {
  const auto length =
      static_cast<std::size_t>(reinterpret_cast<usbdevfs_urb*>(urb.data->data)->buffer_length);
  std::vector<std::uint8_t> packet(length);
  if (length > 0) std::memcpy(packet.data(), urb.buffer->data, length);
  if (auto reply = function_(packet); reply && delay_ns >= 0) {
    replies_.push_back({MonotonicNow() + delay_ns, std::move(*reply)});
  }
  Finish(urb, 0, length);
}

// No request of the host's needs data from here.
void UsbFs::Control(const Urb& urb) {
  Finish(urb, -EPIPE, 0);
}

gboolean UsbFs::OnIoctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
  auto* usb = static_cast<UsbFs*>(self);
  const std::lock_guard lock(usb->mutex_);
  usb->Ioctl(client);
  return TRUE;
}

void UsbFs::Forget(const Urb& urb) {
  if (urb.buffer != nullptr) g_object_unref(urb.buffer);
  g_object_unref(urb.data);
}

// As the kernel does where a file is closed: by the end of a process that was killed, too.
void UsbFs::OnVanished(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
  auto* usb = static_cast<UsbFs*>(self);
  const std::lock_guard lock(usb->mutex_);
  for (auto* queue : {&usb->in_, &usb->out_, &usb->done_}) {
    const auto end = std::stable_partition(queue->begin(), queue->end(),
                                           [&](const Urb& urb) { return urb.client != client; });
    std::for_each(end, queue->end(), Forget);
    queue->erase(end, queue->end());
  }
  usb->ShowReadiness();
}

void UsbFs::Ioctl(UMockdevIoctlClient* client) {
  const auto request = umockdev_ioctl_client_get_request(client);
  UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
  const auto complete = [&](long result, int error) {
    umockdev_ioctl_client_complete(client, result, error);
  };
  const bool is_reap = request == USBDEVFS_REAPURB || request == USBDEVFS_REAPURBNDELAY;
  if (!plugged_ && !is_reap) return complete(-1, ENODEV);
  switch (request) {
    case USBDEVFS_GET_CAPABILITIES: {
      UMockdevIoctlData* data =
          umockdev_ioctl_data_resolve(argument, 0, sizeof(std::uint32_t), nullptr);
      if (data == nullptr) return complete(-1, EFAULT);
      const std::uint32_t capabilities =
          USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_NO_PACKET_SIZE_LIM |
          USBDEVFS_CAP_BULK_SCATTER_GATHER | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
      std::memcpy(data->data, &capabilities, sizeof capabilities);
      complete(0, 0);
      g_object_unref(data);
      return;
    }
    case USBDEVFS_CLAIMINTERFACE:
      return faults.busy ? complete(-1, EBUSY) : complete(0, 0);
    case USBDEVFS_RELEASEINTERFACE:
    case USBDEVFS_SETINTERFACE:
      return complete(0, 0);
    case USBDEVFS_CLEAR_HALT: {
      UMockdevIoctlData* data = umockdev_ioctl_data_resolve(argument, 0, sizeof(unsigned), nullptr);
      unsigned endpoint = 0;
      std::memcpy(&endpoint, data->data, sizeof endpoint);
      ((endpoint & 0x80) != 0 ? faults.stall_in : faults.stall_out) = false;
      g_object_unref(data);
      return complete(0, 0);
    }
    case USBDEVFS_GETDRIVER:
      return complete(-1, ENODATA);
    case USBDEVFS_SUBMITURB:
      return Submit(client, argument);
    case USBDEVFS_REAPURB:
    case USBDEVFS_REAPURBNDELAY:
      return Reap(client, argument);
    case USBDEVFS_DISCARDURB: {
      const std::uint64_t address = reinterpret_cast<std::uintptr_t>(
          *reinterpret_cast<void**>(argument->data));  // the argument is the pointer itself
      return Discard(address) ? complete(0, 0) : complete(-1, EINVAL);
    }
    default:
      std::fprintf(stderr, "usb_emulator: ioctl %#lx is not known\n",
                   static_cast<unsigned long>(request));
      return complete(-1, ENOTTY);
  }
}

void UsbFs::Submit(UMockdevIoctlClient* client, UMockdevIoctlData* argument) {
  UMockdevIoctlData* data = umockdev_ioctl_data_resolve(argument, 0, sizeof(usbdevfs_urb), nullptr);
  const auto* raw = reinterpret_cast<const usbdevfs_urb*>(data->data);
  UMockdevIoctlData* buffer =
      raw->buffer_length > 0
          ? umockdev_ioctl_data_resolve(data, offsetof(usbdevfs_urb, buffer),
                                        static_cast<gsize>(raw->buffer_length), nullptr)
          : nullptr;
  if (raw->buffer_length > 0 && buffer == nullptr) {
    g_object_unref(data);
    return umockdev_ioctl_client_complete(client, -1, EFAULT);
  }
  const Urb urb{client, data, buffer, data->client_addr};
  if (raw->type == USBDEVFS_URB_TYPE_CONTROL) {
    Control(urb);
  } else if ((raw->endpoint & 0x80) != 0) {
    in_.push_back(urb);
  } else if (faults.stall_out) {
    Finish(urb, -EPIPE, 0);
  } else {
    out_.push_back(urb);
  }
  Apply();
  umockdev_ioctl_client_complete(client, 0, 0);
}

void UsbFs::Reap(UMockdevIoctlClient* client, UMockdevIoctlData* argument) {
  if (done_.empty()) {
    ShowReadiness();
    umockdev_ioctl_client_complete(client, -1, plugged_ ? EAGAIN : ENODEV);
    return;
  }
  UMockdevIoctlData* slot = umockdev_ioctl_data_resolve(argument, 0, sizeof(void*), nullptr);
  if (slot == nullptr) return umockdev_ioctl_client_complete(client, -1, EFAULT);
  const Urb urb = done_.front();
  done_.pop_front();
  umockdev_ioctl_data_set_ptr(slot, 0, urb.data);
  ShowReadiness();
  g_object_unref(slot);
  umockdev_ioctl_client_complete(client, 0, 0);
  Forget(urb);
}

bool UsbFs::Discard(std::uint64_t address) {
  for (auto* queue : {&in_, &out_}) {
    const auto urb = std::find_if(queue->begin(), queue->end(),
                                  [&](const Urb& u) { return u.address == address; });
    if (urb == queue->end()) continue;
    Finish(*urb, -ENOENT, 0);
    queue->erase(urb);
    ShowReadiness();
    return true;
  }
  return false;
}

}  // namespace rikiseki::test

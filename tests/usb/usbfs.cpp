// SPDX-License-Identifier: MIT
// The ioctls of usbfs; usbfs_plug.cpp has the rest.
#include "tests/usb/usbfs.h"

#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>
#include <termios.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>

#include "common/clock.h"

namespace rikiseki::test {

void UsbFs::ShowReadiness() {
  if (slave_ < 0) return;
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
  usb->called_ns_ = MonotonicNow();
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
    case USBDEVFS_DISCONNECT_CLAIM:
      return faults.busy ? complete(-1, EBUSY) : complete(0, 0);
    case USBDEVFS_RELEASEINTERFACE:
    case USBDEVFS_SETINTERFACE:
    case USBDEVFS_IOCTL:  // the kernel's driver may come back
      return complete(0, 0);
    case USBDEVFS_CLEAR_HALT: {
      UMockdevIoctlData* data = umockdev_ioctl_data_resolve(argument, 0, sizeof(unsigned), nullptr);
      if (data == nullptr) return complete(-1, EFAULT);
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
  // A host that is killed in the middle of a call takes its memory along.
  if (data == nullptr) return umockdev_ioctl_client_complete(client, -1, EFAULT);
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

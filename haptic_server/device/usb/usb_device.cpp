// SPDX-License-Identifier: MIT
#include "haptic_server/device/usb/usb_device.h"

#include "haptic_server/device/make_device.h"
#include "haptic_server/device/mouse/event_mouse.h"
#include "haptic_server/device/mouse/spidar_mouse.h"
#include "haptic_server/device/usb/libusb_port.h"
#include "haptic_server/device/usb/usb_board.h"
#include "haptic_server/device/usb/usb_error.h"
#include "haptic_server/device/usb/usb_finder.h"

namespace rikiseki::haptic {
namespace {

std::string DescribeMouse(const MouseSettings& settings) {
  const std::string complaint = EventMouse(settings.event).Complaint();
  return complaint.empty() ? "the mouse at " + settings.event + " tells where it is" : complaint;
}

}  // namespace

std::unique_ptr<Device> OpenDevice(const Settings& settings) {
  if (settings.device.kind == DeviceKind::kMouse) {
    return std::make_unique<SpidarMouse>(settings.mouse, settings.spidar.velocity_cutoff_hz,
                                         std::make_unique<LibusbPort>(BoardOf(settings.mouse), 0));
  }
  if (settings.device.kind != DeviceKind::kUsb) return MakeDevice(settings);
  return MakeSpidar(settings.spidar, OpenUsbBoard(settings));
}

std::unique_ptr<MotorBoard> OpenUsbBoard(const Settings& settings) {
  const double rest_n = settings.spidar.tension_min_n;
  return std::make_unique<UsbBoard>(settings.usb, rest_n,
                                    std::make_unique<LibusbPort>(settings.usb, rest_n));
}

std::string DescribeBoard(const Settings& settings) {
  const bool is_mouse = settings.device.kind == DeviceKind::kMouse;
  if (settings.device.kind != DeviceKind::kUsb && !is_mouse) return "";
  const UsbSettings usb = is_mouse ? BoardOf(settings.mouse) : settings.usb;
  try {
    const OpenBoard board = FindBoard(usb);
    std::string text = "board " + BoardName(usb.board) + " at " + board.place;
    if (board.switch_id != kAnySwitch) text += ", switch at " + std::to_string(board.switch_id);
    if (!board.serial.empty()) text += ", serial number " + board.serial;
    if (is_mouse) text += "; " + DescribeMouse(settings.mouse);
    return text;
  } catch (const UsbError& error) {
    return error.what();
  }
}

}  // namespace rikiseki::haptic

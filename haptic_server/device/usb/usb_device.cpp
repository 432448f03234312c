#include "haptic_server/device/usb/usb_device.h"

#include "haptic_server/device/make_device.h"
#include "haptic_server/device/usb/libusb_port.h"
#include "haptic_server/device/usb/usb_board.h"
#include "haptic_server/device/usb/usb_error.h"
#include "haptic_server/device/usb/usb_finder.h"

namespace rikiseki::haptic {

std::unique_ptr<Device> OpenDevice(const Settings& settings) {
  if (settings.device.kind != DeviceKind::kUsb) return MakeDevice(settings);
  return MakeSpidar(settings.spidar, OpenUsbBoard(settings));
}

std::unique_ptr<MotorBoard> OpenUsbBoard(const Settings& settings) {
  const double rest_n = settings.spidar.tension_min_n;
  return std::make_unique<UsbBoard>(settings.usb, rest_n,
                                    std::make_unique<LibusbPort>(settings.usb, rest_n));
}

std::string DescribeBoard(const Settings& settings) {
  if (settings.device.kind != DeviceKind::kUsb) return "";
  try {
    const OpenBoard board = FindBoard(settings.usb);
    return "board " + BoardName(settings.usb.board) + " at " + board.place + ", switch at " +
           std::to_string(board.switch_id) +
           (board.serial.empty() ? "" : ", serial number " + board.serial);
  } catch (const UsbError& error) {
    return error.what();
  }
}

}  // namespace rikiseki::haptic

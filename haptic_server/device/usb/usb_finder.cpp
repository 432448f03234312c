// SPDX-License-Identifier: MIT
#include "haptic_server/device/usb/usb_finder.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "common/clock.h"
#include "haptic_server/device/mouse/mouse_packets.h"
#include "haptic_server/device/usb/sh4_packets.h"
#include "haptic_server/device/usb/simple_packets.h"
#include "haptic_server/device/usb/string_channels.h"
#include "haptic_server/device/usb/usb_error.h"

namespace rikiseki::haptic {
namespace {

constexpr std::uint16_t kCyverseVendorId = 0x0CEC;
// An EZ-USB FX2 whose EEPROM is blank, or not read: no public material can program a board.
constexpr std::uint16_t kBlankVendorId = 0x04B4;
constexpr std::uint16_t kBlankProductId = 0x8613;

constexpr unsigned kAnswerWithinMs = 100;
constexpr unsigned kDrainWithinMs = 2;
constexpr int kMostStaleReplies = 16;
constexpr int kSlackCommands = 20;
constexpr std::int64_t kSlackPauseNs = 5'000'000;  // 20 of them: 0.1 s, well within any watchdog

struct DeviceList {
  explicit DeviceList(libusb_context* context) : count(libusb_get_device_list(context, &devices)) {}
  ~DeviceList() {
    if (devices != nullptr) libusb_free_device_list(devices, 1);
  }
  DeviceList(const DeviceList&) = delete;
  DeviceList& operator=(const DeviceList&) = delete;

  libusb_device** devices = nullptr;
  ssize_t count;
};

LibusbContext NewContext() {
  libusb_context* context = nullptr;
  if (const int error = libusb_init(&context); error != 0) {
    throw UsbError(UsbTrouble::kTransferFailed,
                   std::string("libusb does not start: ") + libusb_error_name(error));
  }
  return LibusbContext(context);
}

bool IsOf(UsbBoardModel model, const libusb_device_descriptor& description) {
  if (model == UsbBoardModel::kMouse) {
    return description.idVendor == mouse::kVendorId && description.idProduct == mouse::kProductId;
  }
  return description.idVendor == kCyverseVendorId &&
         description.idProduct ==
             (model == UsbBoardModel::kSimple ? simple::kProductId : sh4::kProductId);
}

std::string PlaceOf(libusb_device* device) {
  return "bus " + std::to_string(libusb_get_bus_number(device)) + " device " +
         std::to_string(libusb_get_device_address(device));
}

std::string SerialOf(libusb_device_handle* handle, const libusb_device_descriptor& description) {
  if (description.iSerialNumber == 0) return "";
  std::array<unsigned char, 256> text{};
  const int length = libusb_get_string_descriptor_ascii(handle, description.iSerialNumber,
                                                        text.data(), static_cast<int>(text.size()));
  return length <= 0 ? "" : std::string(text.begin(), text.begin() + length);
}

// Of the Cyverse boards the endpoints are known, of the SPIDAR-mouse that it is a HID: it has one
// interrupt endpoint each way then.
std::optional<UsbPipes> PipesOf(UsbBoardModel model, const libusb_interface_descriptor& setting) {
  const bool is_mouse = model == UsbBoardModel::kMouse;
  if (is_mouse && setting.bInterfaceClass != LIBUSB_CLASS_HID) return std::nullopt;
  const auto end = setting.endpoint + setting.bNumEndpoints;
  const auto address = [&](std::uint8_t direction, std::uint8_t known) {
    const auto endpoint = std::find_if(setting.endpoint, end, [&](const auto& candidate) {
      const int type = candidate.bmAttributes & LIBUSB_TRANSFER_TYPE_MASK;
      return is_mouse ? type == LIBUSB_TRANSFER_TYPE_INTERRUPT &&
                            (candidate.bEndpointAddress & LIBUSB_ENDPOINT_DIR_MASK) == direction
                      : type == LIBUSB_TRANSFER_TYPE_BULK && candidate.bEndpointAddress == known;
    });
    return endpoint == end ? std::uint8_t{0} : endpoint->bEndpointAddress;
  };
  UsbPipes pipes;
  pipes.out_endpoint = address(LIBUSB_ENDPOINT_OUT, pipes.out_endpoint);
  pipes.in_endpoint = address(LIBUSB_ENDPOINT_IN, pipes.in_endpoint);
  if (pipes.out_endpoint == 0 || pipes.in_endpoint == 0) return std::nullopt;
  if (is_mouse) {
    pipes.type = LIBUSB_TRANSFER_TYPE_INTERRUPT;
    pipes.answer_bytes = mouse::kReportBytes;
  }
  return pipes;
}

// Numbers of interface and setting stand nowhere; the two endpoints tell them.
void ClaimPipes(UsbBoardModel model, OpenBoard& board) {
  libusb_config_descriptor* raw = nullptr;
  libusb_get_active_config_descriptor(libusb_get_device(board.handle.get()), &raw);
  const std::unique_ptr<libusb_config_descriptor, decltype(&libusb_free_config_descriptor)> config(
      raw, libusb_free_config_descriptor);
  for (int i = 0; config != nullptr && i < config->bNumInterfaces; ++i) {
    const libusb_interface& interface = config->interface[i];
    for (int k = 0; k < interface.num_altsetting; ++k) {
      const libusb_interface_descriptor& setting = interface.altsetting[k];
      const std::optional<UsbPipes> pipes = PipesOf(model, setting);
      if (!pipes) continue;
      board.pipes = *pipes;
      board.interface_number = setting.bInterfaceNumber;
      // The kernel's own driver, which a HID has, makes way until the interface is released.
      libusb_set_auto_detach_kernel_driver(board.handle.get(), model == UsbBoardModel::kMouse);
      const int error = libusb_claim_interface(board.handle.get(), board.interface_number);
      if (error == LIBUSB_ERROR_BUSY) {
        throw UsbError(UsbTrouble::kBusy, "another program uses the board at " + board.place +
                                              ": stop it (is a haptic_server running?)");
      }
      if (error != 0) {
        throw UsbError(UsbTrouble::kTransferFailed,
                       "the interface of the board at " + board.place +
                           " cannot be claimed: " + libusb_error_name(error));
      }
      if (setting.bAlternateSetting != 0) {
        libusb_set_interface_alt_setting(board.handle.get(), board.interface_number,
                                         setting.bAlternateSetting);
      }
      return;
    }
  }
  throw UsbError(UsbTrouble::kNoPipes,
                 "the board at " + board.place +
                     (model == UsbBoardModel::kMouse
                          ? " has no HID interface with interrupt endpoints out and in"
                          : " has no interface with bulk endpoints 0x02 out and 0x86 in") +
                     ": its firmware is not one that this driver knows");
}

void RequireAnswer(const OpenBoard& board, const std::vector<std::uint8_t>& reply) {
  if (reply.empty()) {
    throw UsbError(UsbTrouble::kSilent, "the board at " + board.place +
                                            " does not answer: switch its power off and on, or "
                                            "check its firmware");
  }
}

UsbError WrongFirmware(const OpenBoard& board, const std::string& what) {
  return {UsbTrouble::kWrongFirmware, "the board at " + board.place + " " + what +
                                          ": it carries other firmware than this driver knows"};
}

int IdentifySimple(OpenBoard& board) {
  board.Write(simple::EncodeLatch(), kAnswerWithinMs);
  const std::vector<std::uint8_t> bytes = board.Read(kAnswerWithinMs);
  RequireAnswer(board, bytes);
  const auto reply = simple::DecodeReply(bytes);
  if (!reply) {
    throw WrongFirmware(board, "answers " + std::to_string(bytes.size()) + " bytes, not 32");
  }
  return SwitchId(reply->parallel_port);
}

// Digits that differ from each other and pull with 7 mN each, twice: whether a board echoes what it has
// just got or what it had before is not known.
int IdentifySh4(OpenBoard& board) {
  constexpr DaDigits kPattern = {1, 2, 3, 4, 5, 6, 7, 8};
  const auto exchange = [&](const DaDigits& digits) {
    board.Write(sh4::EncodeUpdate(digits), kAnswerWithinMs);
    std::vector<std::uint8_t> answer = board.Read(kAnswerWithinMs);
    RequireAnswer(board, answer);
    return answer;
  };
  exchange(kPattern);
  const std::vector<std::uint8_t> bytes = exchange(kPattern);
  exchange({});
  const auto reply = sh4::DecodeReply(bytes);
  if (!reply) {
    throw WrongFirmware(board, "answers " + std::to_string(bytes.size()) + " bytes, not 512");
  }
  if (reply->echo != kPattern) throw WrongFirmware(board, "does not echo its D/A settings");
  return SwitchId(reply->parallel_port);
}

// What the answer says is not known; that there is one, is.
void IdentifyMouse(OpenBoard& board) {
  board.Write(mouse::EncodeStateRequest(), kAnswerWithinMs);
  RequireAnswer(board, board.Read(kAnswerWithinMs));
}

// What an earlier owner asked for and did not fetch would shift all answers by one.
void Drain(OpenBoard& board) {
  libusb_clear_halt(board.handle.get(), board.pipes.out_endpoint);
  libusb_clear_halt(board.handle.get(), board.pipes.in_endpoint);
  for (int i = 0; i < kMostStaleReplies; ++i) {
    if (board.Read(kDrainWithinMs).empty()) return;
  }
}

// Opens in a context of its own, which later only the tick's thread uses, the device that another
// context has as `found`. None if it is gone.
std::optional<OpenBoard> Open(const UsbSettings& usb, libusb_device* found,
                              const libusb_device_descriptor& description) {
  OpenBoard board;
  board.context = NewContext();
  board.place = PlaceOf(found);
  int error = 0;
  {
    // No device may outlive its context, so this list must not see the end of the board's.
    const DeviceList list(board.context.get());
    const auto end = list.devices + std::max<ssize_t>(list.count, 0);
    const auto same = std::find_if(list.devices, end, [&](libusb_device* device) {
      return libusb_get_bus_number(device) == libusb_get_bus_number(found) &&
             libusb_get_device_address(device) == libusb_get_device_address(found);
    });
    if (same == end) return std::nullopt;
    libusb_device_handle* handle = nullptr;
    error = libusb_open(*same, &handle);
    board.handle.reset(handle);
  }
  if (error == LIBUSB_ERROR_ACCESS) {
    throw UsbError(UsbTrouble::kPermission,
                   "permission denied for the board " + BoardName(usb.board) + " at " +
                       board.place +
                       ": put config/udev/70-rikiseki.rules into /etc/udev/rules.d, be a member of "
                       "the group haptics, and plug the board in again");
  }
  if (error != 0) {
    throw UsbError(
        error == LIBUSB_ERROR_NO_DEVICE ? UsbTrouble::kUnplugged : UsbTrouble::kTransferFailed,
        "the board at " + board.place + " cannot be opened: " + libusb_error_name(error));
  }
  board.serial = SerialOf(board.handle.get(), description);
  return board;
}

void Identify(const UsbSettings& usb, OpenBoard& board) {
  Drain(board);
  const auto zero_by = [&](const auto& packet) {
    board.zero_packet.assign(packet.begin(), packet.end());
  };
  if (usb.board == UsbBoardModel::kMouse) {
    IdentifyMouse(board);
    zero_by(mouse::EncodeStop());
  } else if (usb.board == UsbBoardModel::kSimple) {
    board.switch_id = IdentifySimple(board);
    zero_by(simple::EncodeDigits({}));
  } else {
    board.switch_id = IdentifySh4(board);
    zero_by(sh4::EncodeUpdate({}));
  }
}

std::string Wanted(const UsbSettings& usb) {
  std::string text;
  if (usb.switch_id != kAnySwitch) text += " with its switch at " + std::to_string(usb.switch_id);
  if (usb.serial != kAnySerial) text += " with serial number " + usb.serial;
  return text;
}

}  // namespace

OpenBoard FindBoard(const UsbSettings& usb) {
  const LibusbContext search = NewContext();
  const DeviceList list(search.get());
  std::vector<OpenBoard> fitting;
  std::string others;
  bool is_blank_there = false;
  for (ssize_t i = 0; i < list.count; ++i) {
    libusb_device_descriptor description{};
    if (libusb_get_device_descriptor(list.devices[i], &description) != 0) continue;
    is_blank_there = is_blank_there || (usb.board != UsbBoardModel::kMouse &&
                                        description.idVendor == kBlankVendorId &&
                                        description.idProduct == kBlankProductId);
    if (!IsOf(usb.board, description)) continue;
    std::optional<OpenBoard> opened = Open(usb, list.devices[i], description);
    if (!opened) continue;
    OpenBoard& board = *opened;
    if (usb.serial != kAnySerial && usb.serial != board.serial) {
      others += " (" + board.place + " has serial number " +
                (board.serial.empty() ? "none" : board.serial) + ")";
      continue;
    }
    ClaimPipes(usb.board, board);
    Identify(usb, board);
    if (usb.switch_id != kAnySwitch && usb.switch_id != board.switch_id) {
      others += " (" + board.place + " has its switch at " + std::to_string(board.switch_id) + ")";
      continue;
    }
    fitting.push_back(std::move(board));
  }
  const std::string name = "board " + BoardName(usb.board) + Wanted(usb);
  if (fitting.size() == 1) return std::move(fitting[0]);
  if (fitting.size() > 1) {
    throw UsbError(
        UsbTrouble::kTwoBoards,
        "more than one " + name + ": at " + fitting[0].place + " and " + fitting[1].place +
            "; say which by " +
            (usb.board == UsbBoardModel::kMouse ? "mouse.serial" : "usb.switch_id or usb.serial"));
  }
  if (!others.empty()) {
    throw UsbError(UsbTrouble::kWrongSwitch, "no " + name + " is there" + others);
  }
  if (is_blank_there) {
    throw UsbError(UsbTrouble::kNoFirmware,
                   "an EZ-USB chip without firmware (04B4:8613) is plugged in: the EEPROM of the "
                   "board is blank or cannot be read, and only its maker can program it");
  }
  throw UsbError(UsbTrouble::kUnplugged, "no " + name + " is plugged in");
}

void SetUpBoard(OpenBoard& board, const UsbSettings& usb, double rest_tension_n, bool first) {
  if (usb.board == UsbBoardModel::kMouse) return;  // has no counters, and shows nothing until told
  PerString rest;
  rest.fill(rest_tension_n);
  const DaDigits digits = StringChannels(usb).Digits(rest);
  const auto pull = [&] {
    if (usb.board == UsbBoardModel::kSimple) {
      board.Write(simple::EncodeDigits(digits), kAnswerWithinMs);
    } else {
      board.Write(sh4::EncodeUpdate(digits), kAnswerWithinMs);
      RequireAnswer(board, board.Read(kAnswerWithinMs));
    }
  };
  if (usb.board == UsbBoardModel::kSimple) {
    board.Write(simple::EncodePhase(static_cast<std::uint8_t>(usb.phase_mask)), kAnswerWithinMs);
  }
  pull();
  if (!first) return;
  for (int i = 1; i < kSlackCommands; ++i) {
    SleepUntil(MonotonicNow() + kSlackPauseNs);
    pull();
  }
  if (usb.board == UsbBoardModel::kSimple) {
    board.Write(simple::EncodeClear(0xFF), kAnswerWithinMs);
  }
}

}  // namespace rikiseki::haptic

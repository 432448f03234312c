// SPDX-License-Identifier: MIT
#include "protocol/words.h"

#include <cstring>

namespace rikiseki::protocol {

std::string Sentence(ForceReason reason) {
  switch (reason) {
    case ForceReason::kNoContact:
      return "Nothing is touched, so the force is zero.";
    case ForceReason::kContact:
      return "The finger touches something and feels the force as it was rendered.";
    case ForceReason::kCapped:
      return "The rendered force is larger than the force cap, so the cap is shown instead.";
    case ForceReason::kSlewLimited:
      return "The rendered force changes faster than the slew limit allows, so it follows behind.";
    case ForceReason::kTensionLimited:
      return "The strings cannot show the rendered force at this place, so the nearest one is "
             "shown.";
    case ForceReason::kSoftStart:
      return "A world has just come (back), so the force is still growing to its full size.";
    case ForceReason::kWorldLate:
      return "The world is late with its next frame, so its last surfaces are held in place.";
    case ForceReason::kWorldLost:
      return "The world fell silent or died, so the force is fading to zero.";
    case ForceReason::kWorldAbsent:
      return "No world is attached, so the force is zero.";
    case ForceReason::kOverSpeed:
      return "The finger is faster than the speed limit, so it feels no force.";
    case ForceReason::kNotFinite:
      return "A measurement or a result was not a finite number, so the force is zero.";
    case ForceReason::kNoChannel:
      return "All impulse channels are in use, so a new contact is not displayed.";
    case ForceReason::kDeviceFault:
      return "The device does not answer, so the force is zero.";
    case ForceReason::kLoopFault:
      return "The loop missed too many deadlines in a row, so the force is zero until it is "
             "re-armed.";
    case ForceReason::kStopped:
      return "The haptic server is stopping and has let go of the device.";
    case ForceReason::kEmergencyStop:
      return "The emergency stop was pressed or the device's enable input is open, so the strings "
             "are at minimum tension until somebody enables them.";
    case ForceReason::kPassivity:
      return "The finger feels the force as it was rendered, and the passivity controller brakes "
             "what the rendering gave away.";
    case ForceReason::kClutched:
      return "The clutch is engaged: the finger's point in the world stands still and feels no "
             "force.";
  }
  return "The reason is unknown to this program.";
}

std::string Key(ForceReason reason) {
  switch (reason) {
    case ForceReason::kNoContact:
      return "no_contact";
    case ForceReason::kContact:
      return "contact";
    case ForceReason::kCapped:
      return "capped";
    case ForceReason::kSlewLimited:
      return "slew_limited";
    case ForceReason::kTensionLimited:
      return "tension_limited";
    case ForceReason::kSoftStart:
      return "soft_start";
    case ForceReason::kWorldLate:
      return "world_late";
    case ForceReason::kWorldLost:
      return "world_lost";
    case ForceReason::kWorldAbsent:
      return "world_absent";
    case ForceReason::kOverSpeed:
      return "over_speed";
    case ForceReason::kNotFinite:
      return "not_finite";
    case ForceReason::kNoChannel:
      return "no_channel";
    case ForceReason::kDeviceFault:
      return "device_fault";
    case ForceReason::kLoopFault:
      return "loop_fault";
    case ForceReason::kStopped:
      return "stopped";
    case ForceReason::kEmergencyStop:
      return "emergency_stop";
    case ForceReason::kPassivity:
      return "passivity";
    case ForceReason::kClutched:
      return "clutched";
  }
  return "unknown";
}

std::string Key(PeerState state) {
  switch (state) {
    case PeerState::kAbsent:
      return "absent";
    case PeerState::kWaiting:
      return "waiting";
    case PeerState::kLive:
      return "live";
    case PeerState::kLate:
      return "late";
    case PeerState::kLost:
      return "lost";
    case PeerState::kIncompatible:
      return "incompatible";
  }
  return "unknown";
}

std::string Key(SegmentState state) {
  switch (state) {
    case SegmentState::kInitialising:
      return "initialising";
    case SegmentState::kReady:
      return "ready";
    case SegmentState::kClosed:
      return "closed";
    case SegmentState::kFaulted:
      return "faulted";
    case SegmentState::kSuperseded:
      return "superseded";
  }
  return "unknown";
}

std::string Key(Coupling coupling) {
  switch (coupling) {
    case Coupling::kPosition:
      return "position";
    case Coupling::kImpulse:
      return "impulse";
    case Coupling::kLocal:
      return "local";
  }
  return "unknown";
}

std::string Key(DiscardReason reason) {
  switch (reason) {
    case DiscardReason::kGap:
      return "gap";
    case DiscardReason::kCoupling:
      return "coupling";
    case DiscardReason::kForeignWorld:
      return "foreign_world";
    case DiscardReason::kUnknownBody:
      return "unknown_body";
  }
  return "unknown";
}

std::string Printable(const char* text, std::size_t room) {
  std::string printable(text, strnlen(text, room));
  for (char& c : printable) {
    if (c < ' ' || c > '~') c = '?';
  }
  return printable;
}

}  // namespace rikiseki::protocol

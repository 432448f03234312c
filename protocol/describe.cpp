#include "protocol/describe.h"

namespace rikiseki::protocol {

const char* Describe(ForceReason reason) noexcept {
  switch (reason) {
    case ForceReason::kNoContact: return "no surface is touched";
    case ForceReason::kContact: return "in contact, the force as rendered";
    case ForceReason::kCapped: return "limited: the force cap is reached";
    case ForceReason::kSlewLimited: return "limited: the force may not change faster";
    case ForceReason::kTensionLimited: return "limited: the strings cannot show more here";
    case ForceReason::kSoftStart: return "growing again after the world came or a fault went";
    case ForceReason::kWorldLate: return "the world is late: its surfaces are held";
    case ForceReason::kWorldLost: return "the world fell silent: fading to zero";
    case ForceReason::kWorldAbsent: return "zero: no world is attached";
    case ForceReason::kOverSpeed: return "zero: the finger is faster than the speed limit";
    case ForceReason::kNotFinite: return "zero: a sample or a result was not a finite number";
    case ForceReason::kNoChannel: return "a contact is not shown: no impulse channel is free";
    case ForceReason::kDeviceFault: return "zero: the device does not answer or its strings disagree";
    case ForceReason::kLoopFault: return "zero: too many deadlines were missed in a row";
    case ForceReason::kStopped: return "zero: haptic_server has stopped";
  }
  return "unknown";
}

const char* Describe(PeerState state) noexcept {
  switch (state) {
    case PeerState::kAbsent: return "absent";
    case PeerState::kWaiting: return "waiting";
    case PeerState::kLive: return "live";
    case PeerState::kLate: return "late";
    case PeerState::kLost: return "lost";
    case PeerState::kIncompatible: return "incompatible";
  }
  return "unknown";
}

const char* Describe(Coupling coupling) noexcept {
  switch (coupling) {
    case Coupling::kPosition: return "position";
    case Coupling::kImpulse: return "impulse";
    case Coupling::kLocal: return "local";
  }
  return "unknown";
}

const char* Describe(DiscardReason reason) noexcept {
  switch (reason) {
    case DiscardReason::kGap: return "gap";
    case DiscardReason::kCoupling: return "coupling";
    case DiscardReason::kForeignWorld: return "foreign_world";
    case DiscardReason::kUnknownBody: return "unknown_body";
  }
  return "unknown";
}

}  // namespace rikiseki::protocol

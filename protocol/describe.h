// The wire's enumerators in words, for logs and status views: one sentence why the force is what it is.
#pragma once

#include "protocol/messages.h"

namespace rikiseki::protocol {

/// "no surface is touched", "the world fell silent: the force is fading to zero", ...
const char* Describe(ForceReason reason) noexcept;

/// "live", "late", ...
const char* Describe(PeerState state) noexcept;

/// "position", "impulse" or "local".
const char* Describe(Coupling coupling) noexcept;

/// The key under which haptic_status lists it: "gap", ...
const char* Describe(DiscardReason reason) noexcept;

}  // namespace rikiseki::protocol

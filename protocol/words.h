// SPDX-License-Identifier: MIT
// The protocol's numbers in words, for people and for keys of reports.
#pragma once

#include <string>

#include "protocol/messages.h"
#include "protocol/segment.h"

namespace rikiseki::protocol {

/// One sentence that tells why the displayed force is what it is.
std::string Sentence(ForceReason reason);

// Short keys: "world_lost", "live", "ready", "local", ...
std::string Key(ForceReason reason);
std::string Key(PeerState state);
std::string Key(SegmentState state);
std::string Key(Coupling coupling);
std::string Key(DiscardReason reason);

/// A NUL-padded name from another process: what is not printable ASCII becomes '?'.
std::string Printable(const char* text, std::size_t room);

}  // namespace rikiseki::protocol

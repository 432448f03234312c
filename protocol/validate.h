// SPDX-License-Identifier: MIT
// What a decoded message must be before anybody acts on it. SPEC.md 6 gives each rule, section 9
// what a reader does about a breach. Counts were checked before; directions are renormalised in
// place.
#pragma once

#include <cstdint>

#include "protocol/messages.h"

namespace rikiseki::protocol {

enum class DecodeStatus : std::uint32_t {
  kOk,
  kLength,      // used_bytes does not agree with the counts and blocks
  kCount,       // more pointers, channels, planes, bodies, ... than there may be
  kEnumerator,  // a number that names nothing
  kIdentity,    // a pointer or local body that does not exist or stands twice
  kNotFinite,
  kRange,       // a value that cannot be: negative radius, zero period, ...
  kQuaternion,  // norm outside 0.99 .. 1.01
  kNormal,      // norm not above 1e-12
  kStamp,       // published in the future, or before the message before
};

/// "a value is not finite", ...
const char* Describe(DecodeStatus status) noexcept;

DecodeStatus Validate(HapticTick& message) noexcept;  // RT:
DecodeStatus Validate(HapticHealth& message) noexcept;
DecodeStatus Validate(WorldFrame& message) noexcept;  // RT:
DecodeStatus Validate(WorldHealth& message) noexcept;
DecodeStatus Validate(Body& message) noexcept;
DecodeStatus Validate(WorldScene& message) noexcept;

}  // namespace rikiseki::protocol

// SPDX-License-Identifier: MIT
// The version of the protocol and the fingerprint of its layout. Whoever edits the layout finds the
// build broken (layout.cpp) until this file is touched: decide then which number grows, by SPEC.md
// section 8.
#pragma once

#include <cstdint>

namespace rikiseki::protocol {

inline constexpr std::uint16_t kVersionMajor = 1;
inline constexpr std::uint16_t kVersionMinor = 0;

/// FNV-1a-64 of layout.golden.txt, which layout.h writes. SPEC.md 8.3.
inline constexpr std::uint64_t kLayoutHash = 0xACAE8D32F68C7538ULL;

}  // namespace rikiseki::protocol

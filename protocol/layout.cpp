// SPDX-License-Identifier: MIT
#include "protocol/layout.h"

#include "protocol/version.h"

namespace rikiseki::protocol {

static_assert(
    LayoutHash() == kLayoutHash,
    "The layout changed. Raise the version by SPEC.md section 8, write it into CHANGELOG.md, "
    "and put the new hash into version.h and the new text into layout.golden.txt.");

}  // namespace rikiseki::protocol

// SPDX-License-Identifier: MIT
// The messages inside the frozen segments of tests/data/protocol: every field has a value of its
// own. They are never edited: what was released stays readable. A later version adds functions.
#pragma once

#include <vector>

#include "protocol/messages.h"

namespace rikiseki::protocol::test {

HapticTick FixtureTick();
HapticHealth FixtureHapticHealth();
WorldFrame FixtureFrame();
WorldHealth FixtureWorldHealth();
std::vector<Body> FixtureBodies();
WorldScene FixtureScene();

}  // namespace rikiseki::protocol::test

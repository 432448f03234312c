// SPDX-License-Identifier: MIT
// Goes through a parsed SDFormat file and says what of it this world does not do, so that nothing
// that a file asks for is ignored in silence.
#pragma once

#include <sdf/Element.hh>
#include <string>
#include <vector>

namespace rikiseki::world {

/// Appends one line for each explicit element below `world` that is not used. Throws ConfigError
/// for one that would change the motion of bodies.
void SurveyWorld(const sdf::ElementPtr& world, std::vector<std::string>& warnings);

}  // namespace rikiseki::world

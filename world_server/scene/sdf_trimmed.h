// SPDX-License-Identifier: MIT
// Large files in a third of the time: for every element of a file libsdformat copies all that the
// format knows to stand in one like it, a camera's lens in each link. What the file has nowhere is left
// out of that.
#pragma once

#include <sdf/sdf.hh>
#include <string>

namespace rikiseki::world {

/// Loads a file as root.Load does, if libsdformat has nothing to say about it. False, and nothing is
/// loaded, if it has, or if the file needs what was left out: then root.Load says what.
bool LoadTrimmed(const std::string& path, const sdf::ParserConfig& config, sdf::Root& root);

}  // namespace rikiseki::world

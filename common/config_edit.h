// SPDX-License-Identifier: MIT
// Changes values in an INI file that people write: what is not changed stays as it is to the byte,
// comments above all.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace rikiseki {

/// `text` with the values of some keys replaced: {"section.key", "value"}. A key that is not there yet
/// is added at the end of its section, and the section at the end of the text.
std::string WithValues(std::string text,
                       const std::vector<std::pair<std::string, std::string>>& values);

/// The same in a file, which is replaced in one piece and keeps its permissions. A link is followed.
/// Throws ConfigError.
void SetValuesInFile(const std::string& path,
                     const std::vector<std::pair<std::string, std::string>>& values);

}  // namespace rikiseki

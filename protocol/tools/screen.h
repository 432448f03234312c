// SPDX-License-Identifier: MIT
// Text on a terminal that is drawn again and again in place: lines that are too long go on below, indented,
// and what is too tall is cut and says so. Nothing on the terminal is switched that would have to be switched
// back: who ends the program at any moment keeps a sane terminal, with the last picture above the prompt.
#pragma once

#include <string>
#include <vector>

namespace rikiseki::protocol {

struct ScreenSize {
  int columns = 80;
  int rows = 24;
};

/// Of the terminal behind this descriptor; 80 x 24 where it does not tell.
ScreenSize SizeOfTerminal(int descriptor);

/// The lines of `text` (UTF-8), none wider than `columns`; broken at blanks where that is possible.
std::vector<std::string> Wrapped(const std::string& text, int columns);

/// What draws these lines over the picture before, with the cursor below them. Of more than fit, the last line
/// says how many are missing.
std::string Drawn(std::vector<std::string> lines, ScreenSize size);

}  // namespace rikiseki::protocol

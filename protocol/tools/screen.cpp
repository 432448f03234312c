// SPDX-License-Identifier: MIT
#include "protocol/tools/screen.h"

#include <sys/ioctl.h>

#include <algorithm>
#include <sstream>

namespace rikiseki::protocol {
namespace {

constexpr std::size_t kIndent = 13;  // where the values of a report stand
constexpr std::size_t kNarrowIndent = 2;

// Bytes of the character that begins here.
std::size_t CharacterBytes(const std::string& text, std::size_t at) {
  std::size_t end = at + 1;
  while (end < text.size() && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) ++end;
  return end - at;
}

// What is not ASCII counts as wide, as Japanese is: rather broken too early than too late.
std::size_t CharacterWidth(char first) {
  return static_cast<unsigned char>(first) < 0x80U ? 1 : 2;
}

// How many bytes of `line` fit into `columns`, at least one character.
std::size_t FittingBytes(const std::string& line, std::size_t columns) {
  std::size_t width = 0;
  std::size_t at = 0;
  while (at < line.size()) {
    width += CharacterWidth(line[at]);
    if (width > columns && at > 0) return at;
    at += CharacterBytes(line, at);
  }
  return at;
}

}  // namespace

ScreenSize SizeOfTerminal(int descriptor) {
  winsize size{};
  if (ioctl(descriptor, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0) return {};
  return {.columns = size.ws_col, .rows = size.ws_row};
}

std::vector<std::string> Wrapped(const std::string& text, int columns) {
  const auto width = static_cast<std::size_t>(std::max(columns, 8));
  const std::string indent(width > 3 * kIndent ? kIndent : kNarrowIndent, ' ');
  std::vector<std::string> lines;
  std::istringstream source(text);
  for (std::string line; std::getline(source, line);) {
    std::size_t fits = FittingBytes(line, width);
    while (fits < line.size()) {
      // A blank within what fits, and behind what the line begins with.
      const std::size_t blank = line.rfind(' ', fits);
      const std::size_t first = line.find_first_not_of(' ');
      const bool has_blank = blank != std::string::npos && blank > first;
      lines.push_back(line.substr(0, has_blank ? blank : fits));
      line = indent + line.substr(has_blank ? blank + 1 : fits);
      fits = FittingBytes(line, width);
    }
    lines.push_back(line);
  }
  return lines;
}

std::string Drawn(std::vector<std::string> lines, ScreenSize size) {
  // The cursor's row below; a picture as tall as the terminal would scroll.
  const auto room = static_cast<std::size_t>(std::max(size.rows - 1, 1));
  if (lines.size() > room) {
    const std::size_t missing = lines.size() - room + 1;
    lines.resize(room);
    lines.back() =
        Wrapped("... " + std::to_string(missing) + " more lines; --once prints all", size.columns)
            .front();
  }
  std::string drawn = "\x1b[H";
  for (const std::string& line : lines) drawn += line + "\x1b[K\n";
  return drawn + "\x1b[J";
}

}  // namespace rikiseki::protocol

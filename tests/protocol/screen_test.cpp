// SPDX-License-Identifier: MIT
#include "protocol/tools/screen.h"

#include <catch2/catch.hpp>

namespace rikiseki::protocol {
namespace {

using Lines = std::vector<std::string>;

TEST_CASE("lines that fit stay, longer ones go on below where the values stand") {
  CHECK(Wrapped("  force      held\n\nlast", 80) == Lines{"  force      held", "", "last"});
  const Lines lines = Wrapped("  force      one sentence that is too long\n", 42);
  CHECK(lines == Lines{"  force      one sentence that is too long"});
  CHECK(Wrapped("  force      one sentence that is too long\n", 41) ==
        Lines{"  force      one sentence that is too", "             long"});
  CHECK(Wrapped("one two three", 8) == Lines{"one two", "  three"});
}

TEST_CASE("a word without blanks is broken, characters of more than one byte never are") {
  CHECK(Wrapped("0123456789abcdef", 10) == Lines{"0123456789", "  abcdef"});
  // Nine characters of two columns each.
  const std::string name = "\u529b\u7a4d\u529b\u7a4d\u529b\u7a4d\u529b\u7a4d\u529b";
  CHECK(Wrapped(name, 11) == Lines{name.substr(0, 15), "  " + name.substr(15)});
  // However narrow, it comes to an end, and nothing is lost.
  std::string all;
  for (const std::string& line : Wrapped(name, 0)) all += line.substr(line.find_first_not_of(' '));
  CHECK(all == name);
}

TEST_CASE("a picture leaves a row for the cursor, and says what is missing") {
  CHECK(Drawn({"a", "b"}, {.columns = 80, .rows = 3}) == "\x1b[Ha\x1b[K\nb\x1b[K\n\x1b[J");
  CHECK(Drawn({"a", "b", "c"}, {.columns = 80, .rows = 3}) ==
        "\x1b[Ha\x1b[K\n... 2 more lines; --once prints all\x1b[K\n\x1b[J");
  CHECK(Drawn({"a", "b", "c"}, {.columns = 12, .rows = 3}) ==
        "\x1b[Ha\x1b[K\n... 2 more\x1b[K\n\x1b[J");
  CHECK(Drawn({}, {.columns = 0, .rows = 0}) == "\x1b[H\x1b[J");
}

}  // namespace
}  // namespace rikiseki::protocol

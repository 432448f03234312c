// SPDX-License-Identifier: MIT
#include "protocol/layout.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <iomanip>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "protocol/version.h"

namespace rikiseki::protocol {
namespace {

struct Collector {
  std::string text;
  void operator()(char character) { text.push_back(character); }
};

std::string Layout() {
  Collector collector;
  WriteLayout(collector);
  return collector.text;
}

std::string ReadFile(const std::string& path) {
  std::ifstream file(RIKISEKI_SOURCE_DIR "/" + path);
  return std::string((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
}

TEST_CASE("the layout is the golden one") {
  const std::string golden = ReadFile("protocol/layout.golden.txt");
  REQUIRE(!golden.empty());
  CHECK(Layout() == golden);
}

TEST_CASE("the hash is FNV-1a-64 of the golden text") {
  LayoutHasher empty;
  CHECK(empty.hash() == 0xCBF29CE484222325ULL);
  LayoutHasher known;  // a published test vector of FNV-1a-64
  for (const char c : std::string("foobar")) known(c);
  CHECK(known.hash() == 0x85944171F73967E8ULL);
  LayoutHasher ours;
  for (const char c : Layout()) ours(c);
  CHECK(ours.hash() == kLayoutHash);
}

std::vector<std::string> Split(const std::string& line, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(line);
  for (std::string part; std::getline(stream, part, separator);) {
    const auto begin = part.find_first_not_of(' ');
    const auto end = part.find_last_not_of(' ');
    parts.push_back(begin == std::string::npos ? "" : part.substr(begin, end - begin + 1));
  }
  return parts;
}

TEST_CASE("the tables of SPEC.md are the layout") {
  // The layout's lines of messages, by record ("world.frame/plane"), without the sizes.
  std::map<std::string, std::string> expected;
  std::istringstream layout(Layout());
  for (std::string line; std::getline(layout, line);) {
    if (line.rfind("haptic.", 0) != 0 && line.rfind("world.", 0) != 0) continue;
    const std::vector<std::string> parts = Split(line, ':');
    const auto dot = parts[0].find('.', parts[0].find('.') + 1);
    expected[parts[0].substr(0, dot)] +=
        parts[0].substr(dot + 1) + ":" + parts[1] + ":" + parts[2] + "\n";
  }
  CHECK(expected.size() == 26);

  std::map<std::string, std::string> rows;
  std::istringstream spec(ReadFile("protocol/SPEC.md"));
  std::string record;
  for (std::string line; std::getline(spec, line);) {
    if (line.rfind("Record `", 0) == 0) {
      record = Split(line, '`')[1];
    } else if (line.rfind("#", 0) == 0) {
      record.clear();  // the tables of other sections have no such headline
    } else if (!record.empty() && line.rfind("| ", 0) == 0) {
      const std::vector<std::string> cells = Split(line, '|');
      if (cells[1] != "offset") {
        rows[record] += cells[3] + ":" + cells[2] + ":" + cells[1] + "\n";
      }
    }
  }
  CHECK(rows == expected);
}

/// "7.2-3" of a line "- [7.2-3] ...", else empty.
std::string SentenceNumber(const std::string& line) {
  if (line.rfind("- [", 0) != 0) return "";
  return line.substr(3, line.find(']') - 3);
}

TEST_CASE("every demand of SPEC.md has a number in its section, given once and in order") {
  std::istringstream spec(ReadFile("protocol/SPEC.md"));
  std::string section;
  std::string sentence;  // the number of the list item that a line belongs to
  int last = 0;
  int sentences = 0;
  for (std::string line; std::getline(spec, line);) {
    INFO(line);
    if (line.rfind("#", 0) == 0) {
      const auto begin = line.find(' ') + 1;
      section = line.substr(begin, line.find(' ', begin) - begin);
      if (section.back() == '.') section.pop_back();
      last = 0;
    }
    if (const std::string number = SentenceNumber(line); !number.empty()) {
      const auto dash = number.find('-');
      CHECK(number.substr(0, dash) == section);
      CHECK(std::stoi(number.substr(dash + 1)) == ++last);
      sentence = number;
      ++sentences;
    } else if (line.rfind("  ", 0) != 0) {
      sentence.clear();
    }
    const bool demands =
        line.find("MUST") != std::string::npos || line.find("SHOULD") != std::string::npos;
    if (demands && line.find("RFC 2119") == std::string::npos) CHECK(!sentence.empty());
  }
  CHECK(sentences > 100);
}

TEST_CASE("SPEC.md and CHANGELOG.md name the hash") {
  std::ostringstream hash;
  hash << std::hex << std::setfill('0') << std::setw(16) << kLayoutHash;
  CHECK_THAT(ReadFile("protocol/SPEC.md"), Catch::Contains(hash.str()));
  CHECK_THAT(ReadFile("protocol/CHANGELOG.md"), Catch::Contains(hash.str()));
}

TEST_CASE("every line of the layout continues where the one before ended") {
  const std::string text = Layout();
  std::size_t end = 0;
  std::size_t begin = 0;
  while (begin < text.size()) {
    const std::string line = text.substr(begin, text.find('\n', begin) - begin);
    begin += line.size() + 1;
    const auto bytes_at = line.rfind(':');
    const auto offset_at = line.rfind(':', bytes_at - 1);
    const std::size_t offset = std::stoul(line.substr(offset_at + 1));
    const std::size_t bytes = std::stoul(line.substr(bytes_at + 1));
    // Fields are named "record.field"; a record's own name may hold dots ("haptic.tick").
    const std::string name = line.substr(0, line.find(':'));
    INFO(line);
    if (offset == 0) {
      end = 0;
    } else if (name.rfind("segment_header", 0) == 0 || name.rfind("stream_entry", 0) == 0) {
      REQUIRE(offset >= end);  // reserved words lie between
    } else {
      REQUIRE(offset == end);
    }
    CHECK(offset % std::min<std::size_t>(bytes, 8) == 0);
    end = offset + bytes;
  }
}

}  // namespace
}  // namespace rikiseki::protocol

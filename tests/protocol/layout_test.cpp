#include "protocol/layout.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <iomanip>
#include <iterator>
#include <map>
#include <regex>
#include <sstream>
#include <string>

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

TEST_CASE("the tables of SPEC.md are the layout") {
  std::istringstream spec(ReadFile("protocol/SPEC.md"));
  std::string record;
  std::map<std::string, std::string> rows;  // by record: the page has its own order
  for (std::string line; std::getline(spec, line);) {
    std::smatch match;
    if (std::regex_match(line, match, std::regex("Record `([^`]+)`, ([0-9]+) bytes:"))) {
      record = match[1];
    } else if (line.rfind("#", 0) == 0) {
      record.clear();  // the tables of sections 3 and 4 have no such headline
    } else if (!record.empty() &&
               std::regex_match(line, match,
                                std::regex("\\| ([0-9]+) \\| (\\S+) \\| (\\S+) \\|.*"))) {
      rows[record] += match[3].str() + ":" + match[2].str() + ":" + match[1].str() + "\n";
    }
  }
  // The layout's lines of messages, without the sizes, which follow from the types.
  std::map<std::string, std::string> expected;
  std::istringstream layout(Layout());
  for (std::string line; std::getline(layout, line);) {
    std::smatch match;
    if (std::regex_match(line, match,
                         std::regex("((haptic|world)\\.[a-z]+(/[a-z_]+)?)\\.(.*):[0-9]+"))) {
      expected[match[1]] += match[4].str() + "\n";
    }
  }
  CHECK(expected.size() == 12);
  CHECK(rows == expected);
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

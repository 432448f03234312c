#include "protocol/layout.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
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

TEST_CASE("the layout is the golden one") {
  std::ifstream file(RIKISEKI_SOURCE_DIR "/protocol/layout.golden.txt");
  const std::string golden((std::istreambuf_iterator<char>(file)),
                           std::istreambuf_iterator<char>());
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

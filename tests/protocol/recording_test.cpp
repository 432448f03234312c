// SPDX-License-Identifier: MIT
#include "protocol/tools/recording.h"

#include <sys/resource.h>

#include <array>
#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <fstream>

#include "tests/common/temporary_folder.h"

namespace rikiseki::protocol {
namespace {

using Catch::Matchers::Contains;

// A tick whose number can be told again from what was read.
void Add(RecordingWriter& writer, std::uint64_t number) {
  HapticTick tick;
  tick.tick = number;
  tick.period_ns = 1'000'000;
  tick.pointer_count = 1;
  tick.pointers[0].position = {0.001 * static_cast<double>(number), 0, 0};
  std::array<std::uint64_t, kHapticTickBytes / 8> words{};
  const Encoded encoded = Encode(tick, words);
  REQUIRE(encoded.used_bytes > 0);
  writer.Add({.type = StreamType::kHapticTick,
              .epoch = 77,
              .received = {.number = number + 1,
                           .stamp_ns = 1000 * number,
                           .used_bytes = encoded.used_bytes,
                           .blocks = encoded.blocks},
              .words = std::span(words).first(encoded.used_bytes / 8)});
}

// How many ticks a file holds; they must be 0, 1, 2, ...
std::uint64_t CountTicks(RecordingReader& reader) {
  Record record;
  HapticTick tick;
  WorldFrame frame;
  std::uint64_t count = 0;
  while (reader.Next(record)) {
    REQUIRE(record.Is(tick));
    CHECK_FALSE(record.Is(frame));
    CHECK(record.epoch == 77);
    CHECK(record.received.number == count + 1);
    CHECK(record.received.stamp_ns == 1000 * count);
    CHECK(tick.tick == count);
    CHECK(tick.pointers[0].position[0] == 0.001 * static_cast<double>(count));
    ++count;
  }
  return count;
}

TEST_CASE("what was recorded is read again, message by message") {
  const TemporaryFolder folder;
  const std::string path = folder.File("run.rk");
  {
    RecordingWriter writer(path);
    for (std::uint64_t i = 0; i < 100; ++i) {
      Add(writer, i);
      if (i % 7 == 0) writer.Flush(i % 2 == 0);
    }
    writer.Flush(true);
    CHECK(writer.bytes() == std::filesystem::file_size(path));
  }
  RecordingReader reader(path);
  CHECK(CountTicks(reader) == 100);
  CHECK_FALSE(reader.torn());
  CHECK_THROWS_WITH(RecordingWriter(path), Contains(path) && Contains("exists"));
}

TEST_CASE("of a file that was torn anywhere, all whole messages are read") {
  const TemporaryFolder folder;
  const std::string path = folder.File("run.rk");
  std::vector<std::uint64_t> ends;  // bytes, of the header and of each message
  {
    RecordingWriter writer(path);
    ends.push_back(writer.bytes());
    for (std::uint64_t i = 0; i < 5; ++i) {
      Add(writer, i);
      writer.Flush(false);
      ends.push_back(writer.bytes());
    }
  }
  for (std::uint64_t bytes = ends.back(); bytes >= ends.front(); --bytes) {
    std::filesystem::resize_file(path, bytes);
    RecordingReader reader(path);
    std::uint64_t whole = 0;
    bool at_end = false;
    for (std::size_t i = 0; i < ends.size(); ++i) {
      if (ends[i] <= bytes) whole = i;
      at_end = at_end || ends[i] == bytes;
    }
    CAPTURE(bytes);
    CHECK(CountTicks(reader) == whole);
    CHECK(reader.torn() == !at_end);
  }
}

TEST_CASE("no room: what was written before stays whole, and it is said") {
  const TemporaryFolder folder;
  const std::string path = folder.File("run.rk");
  RecordingWriter writer(path);
  for (std::uint64_t i = 0; i < 50; ++i) Add(writer, i);
  writer.Flush(false);
  const std::uint64_t before = writer.bytes();
  const std::uint64_t message = (before - 32) / 50;
  // The kernel refuses to let the file grow beyond this: two more messages and a half.
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit old{};
  getrlimit(RLIMIT_FSIZE, &old);
  const rlimit full{.rlim_cur = before + 5 * message / 2, .rlim_max = old.rlim_max};
  REQUIRE(setrlimit(RLIMIT_FSIZE, &full) == 0);
  for (std::uint64_t i = 50; i < 60; ++i) Add(writer, i);
  std::string said;
  try {
    writer.Flush(true);
  } catch (const RecordingError& error) {
    said = error.what();
  }
  setrlimit(RLIMIT_FSIZE, &old);
  CHECK_THAT(said, Contains(path) && Contains("it holds what was recorded before"));
  RecordingReader reader(path);
  CHECK(CountTicks(reader) == 52);
  CHECK_FALSE(reader.torn());
}

TEST_CASE("what is no recording, or of another protocol, is refused") {
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(RecordingReader(folder.File("none")), Contains("No such file"));
  CHECK_THROWS_WITH(RecordingReader(folder.Write("empty", "")), Contains("no recording"));
  CHECK_THROWS_WITH(RecordingReader(folder.Write("text", std::string(200, 'x'))),
                    Contains("no recording"));
  const std::string path = folder.File("run.rk");
  { RecordingWriter writer(path); }
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(16);
  const std::uint64_t other = 99;
  file.write(reinterpret_cast<const char*>(&other), sizeof other);
  file.close();
  CHECK_THROWS_WITH(RecordingReader(path), Contains("recorded with protocol 0.99"));
}

}  // namespace
}  // namespace rikiseki::protocol

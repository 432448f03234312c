// SPDX-License-Identifier: MIT
// Every byte of both boards' packets, from the published descriptions and not from our encoders; the
// way of a counter over its wrap.
#include <catch2/catch.hpp>
#include <limits>
#include <random>
#include <vector>

#include "haptic_server/device/usb/sh4_packets.h"
#include "haptic_server/device/usb/simple_packets.h"

namespace rikiseki::haptic {
namespace {

const DaDigits kDigits = {0x0102, 0x0304, 0x0506, 0x0708, 0x090A, 0x0B0C, 0x0D0E, 0xFF10};

template <typename Packet>
void CheckBytes(const Packet& packet, const std::vector<std::uint8_t>& begin) {
  for (std::size_t i = 0; i < packet.size(); ++i) {
    CAPTURE(i);
    CHECK(packet[i] == (i < begin.size() ? begin[i] : 0));
  }
}

TEST_CASE("Simple: commands byte by byte") {
  CHECK(simple::EncodeLatch().size() == 32);
  CheckBytes(simple::EncodeLatch(), {0x51});
  CheckBytes(simple::EncodePhase(0xFF), {0xA2, 0x1A, 0xFF});
  CheckBytes(simple::EncodeClear(0x0F), {0xA2, 0x19, 0x0F});
  CheckBytes(simple::EncodeDigits(kDigits),
             {0x52, 0x02, 0x01, 0x04, 0x03, 0x06, 0x05, 0x08, 0x07, 0x0A, 0x09, 0x0C, 0x0B, 0x0E,
              0x0D, 0xFF, 0x0F});  // the last one is cut to 4095
}

TEST_CASE("Simple: a reply of 24-bit counts and the parallel port") {
  std::vector<std::uint8_t> bytes(32, 0xEE);
  const std::vector<std::uint8_t> begin = {0x01, 0x02, 0x03, 0xFF, 0xFF, 0xFF, 0x00, 0x00, 0x80,
                                           0xFF, 0xFF, 0x7F, 0x00, 0x00, 0x00, 0x56, 0x34, 0x12,
                                           0x00, 0x01, 0xFF, 0x80, 0x00, 0x00, 0xA5};
  std::copy(begin.begin(), begin.end(), bytes.begin());
  const auto reply = simple::DecodeReply(bytes);
  REQUIRE(reply);
  CHECK(reply->counts == RawCounts{0x030201, -1, -0x800000, 0x7FFFFF, 0, 0x123456, -0xFF00, 0x80});
  CHECK(reply->parallel_port == 0xA5);
  CHECK(SwitchId(reply->parallel_port) == 10);
}

TEST_CASE("Simple: only 32 bytes, or those padded to a packet, are a reply") {
  for (std::size_t size = 0; size <= 600; ++size) {
    const std::vector<std::uint8_t> bytes(size);
    CHECK(simple::DecodeReply(bytes).has_value() == (size == 32 || size == 512));
  }
}

TEST_CASE("Sh4: an update byte by byte") {
  CHECK(sh4::EncodeUpdate(kDigits).size() == 512);
  CheckBytes(sh4::EncodeUpdate(kDigits), {0x01, 0x0E, 0x02, 0x01, 0x04, 0x03, 0x06, 0x05, 0x08,
                                          0x07, 0x0A, 0x09, 0x0C, 0x0B, 0x0E, 0x0D, 0xFF, 0x0F});
}

TEST_CASE("Sh4: a reply of echo, counts, voltages, parallel port and info") {
  std::vector<std::uint8_t> bytes(512, 0xEE);
  for (std::size_t i = 0; i < 54; ++i) bytes[i] = static_cast<std::uint8_t>(i);
  const auto reply = sh4::DecodeReply(bytes);
  REQUIRE(reply);
  CHECK(reply->echo[0] == 0x0100);
  CHECK(reply->echo[7] == 0x0F0E);
  CHECK(reply->counts[0] == 0x1110);
  CHECK(reply->counts[7] == 0x1F1E);
  CHECK(reply->ad[0] == 0x2120);
  CHECK(reply->ad[7] == 0x2F2E);
  CHECK(reply->parallel_port == 0x3130);
  CHECK(SwitchId(reply->parallel_port) == 3);
  CHECK(reply->info == 0x35343332);
  bytes[17] = 0xFF;  // unsigned until it is extended
  CHECK(sh4::DecodeReply(bytes)->counts[0] == 0xFF10);
}

TEST_CASE("Sh4: only 512 bytes are a reply") {
  for (std::size_t size = 0; size <= 600; ++size) {
    CHECK(sh4::DecodeReply(std::vector<std::uint8_t>(size)).has_value() == (size == 512));
  }
}

TEST_CASE("a counter is extended over its wrap, in both directions, from any place") {
  for (const int bits : {sh4::kCountBits, simple::kCountBits}) {
    const std::int64_t range = std::int64_t{1} << bits;
    std::mt19937_64 random(1);
    std::uniform_int_distribution<std::int64_t> any_step(-range / 2, range / 2 - 1);
    std::int64_t truth = 0;
    std::int64_t extended = 0;
    for (int i = 0; i < 10'000; ++i) {
      truth += any_step(random);
      // As the Sh4 gives it, unsigned, and as the Simple does, signed.
      const auto low = static_cast<std::int32_t>(truth & (range - 1));
      const auto raw =
          static_cast<std::int32_t>(low >= range / 2 && i % 2 == 0 ? low - range : low);
      extended = ExtendCount(extended, raw, bits);
      REQUIRE(extended == truth);
    }
  }
  CHECK(ExtendCount(65'535, 0, 16) == 65'536);
  CHECK(ExtendCount(0, 65'535, 16) == -1);
  CHECK(ExtendCount(-32'768, 0x7FFF, 16) == -32'769);
  constexpr std::int64_t kFar = std::int64_t{1} << 40;
  CHECK(ExtendCount(kFar, 5, 24) == kFar + 5);
}

}  // namespace
}  // namespace rikiseki::haptic

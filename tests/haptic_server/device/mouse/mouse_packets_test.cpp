// SPDX-License-Identifier: MIT
// Every byte of the reports, from the published descriptions and not from our encoders.
#include "haptic_server/device/mouse/mouse_packets.h"

#include <catch2/catch.hpp>
#include <vector>

namespace rikiseki::haptic::mouse {
namespace {

void CheckBytes(const Report& report, const std::vector<std::uint8_t>& begin) {
  CHECK(report.size() == 64);
  for (std::size_t i = 0; i < report.size(); ++i) {
    CAPTURE(i);
    CHECK(report[i] == (i < begin.size() ? begin[i] : 0));
  }
}

TEST_CASE("SPIDAR-mouse: reports byte by byte") {
  CheckBytes(EncodeStateRequest(), {82});
  CheckBytes(EncodeStop(), {99});
  // 0.3, 1.5, 47.9867 and 13.1215 as singles.
  CheckBytes(EncodeStart({}), {80, 0x9A, 0x99, 0x99, 0x3E, 0x00, 0x00, 0xC0, 0x3F, 0x61, 0xF2, 0x3F,
                               0x42, 0xAA, 0xF1, 0x51, 0x41});
  CheckBytes(EncodeForce({.magnitude_n = 0.75F, .direction_x = 0.6F, .direction_y = -0.8F}),
             {97,   0,    0,    0,    0,    0,    0,    0,    0,    0x00, 0x00,
              0x40, 0x3F, 0x9A, 0x99, 0x19, 0x3F, 0xCD, 0xCC, 0x4C, 0xBF});
  CheckBytes(EncodeForce({}), {97});
}

}  // namespace
}  // namespace rikiseki::haptic::mouse

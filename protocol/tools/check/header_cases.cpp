// SPDX-License-Identifier: MIT
#include "protocol/tools/check/header_cases.h"

namespace rikiseki::protocol::check {
namespace {

constexpr WrongHeader kWrongHeaders[] = {
    {"magic is wrong", [](SegmentHeader& h) { h.magic ^= 1; }},
    {"byte_order is wrong", [](SegmentHeader& h) { h.byte_order = 0x04030201; }},
    {"header_bytes is wrong", [](SegmentHeader& h) { h.header_bytes = 8192; }},
    {"role is the other side's", [](SegmentHeader& h) { h.role = 3 - h.role; }},
    {"epoch is 0", [](SegmentHeader& h) { h.epoch = 0; }},
    {"there are 17 streams", [](SegmentHeader& h) { h.stream_count = 17; }},
    {"segment_bytes is more than there is", [](SegmentHeader& h) { h.segment_bytes <<= 8; }},
    {"the ring ends outside", [](SegmentHeader& h) { h.stream[0].slot_count = 65536; }},
    {"slot_count is no power of two", [](SegmentHeader& h) { h.stream[0].slot_count = 7; }},
    {"slot_stride is 0", [](SegmentHeader& h) { h.stream[0].slot_stride = 0; }},
    {"the counter lies in the ring",
     [](SegmentHeader& h) { h.stream[0].cursor_offset = h.stream[0].ring_offset; }},
    {"the counter is not aligned", [](SegmentHeader& h) { h.stream[0].cursor_offset += 8; }},
    {"the ring lies at the end of the address space",
     [](SegmentHeader& h) { h.stream[0].ring_offset = ~std::uint64_t{127}; }},
    {"the stream that it needs is not there", [](SegmentHeader& h) { h.stream[0].type_id = 999; }},
};

}  // namespace

std::span<const WrongHeader> WrongHeaders() {
  return kWrongHeaders;
}

}  // namespace rikiseki::protocol::check

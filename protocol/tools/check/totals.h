// SPDX-License-Identifier: MIT
// Sums of impulse units as SPEC.md section 7 defines them: modulo 2^64, per channel.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <tuple>

#include "protocol/impulse_units.h"
#include "protocol/messages.h"

namespace rikiseki::protocol::check {

/// An impulse [N s] in whole units.
std::int64_t Units(double newton_seconds);
/// Largest magnitude of an axis, in units.
double Largest(const ImpulseUnits& units);
std::string Text(const ImpulseUnits& units);

double Norm(const Vector& v);
double Dot(const Vector& a, const Vector& b);
Vector Cross(const Vector& a, const Vector& b);
Vector Scaled(const Vector& v, double factor);
Vector Sum(const Vector& a, const Vector& b);
Vector Difference(const Vector& a, const Vector& b);

/// Who a channel is: the same body, generation and pointer, opened by the same tick.
using ChannelKey = std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::uint64_t>;
ChannelKey KeyOf(const Channel& channel);

/// The totals of one message by channel.
using Totals = std::map<ChannelKey, Channel>;
Totals TotalsOf(const HapticTick& tick);
/// Growth of all channels from one message to a later one of the same epoch; a channel that was not
/// there counts from zero.
ImpulseUnits Growth(const Totals& before, const Totals& after);

}  // namespace rikiseki::protocol::check

// SPDX-License-Identifier: MIT
#include "world_server/coupling/ledger_reader.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <random>

namespace rikiseki::world {
namespace {

using protocol::Channel;
using protocol::Coupling;
using protocol::DiscardReason;
using protocol::HapticTick;
using protocol::ImpulseUnits;

constexpr std::uint64_t kOwn = 77;
constexpr double kNoCap = 1e6;

ImpulseUnits Sum(const ImpulseUnits& a, const ImpulseUnits& b) {
  ImpulseUnits sum;
  for (std::size_t i = 0; i < 3; ++i) {
    sum[i] = static_cast<std::int64_t>(static_cast<std::uint64_t>(a[i]) +
                                       static_cast<std::uint64_t>(b[i]));
  }
  return sum;
}
ImpulseUnits Negative(const ImpulseUnits& a) {
  return {-a[0], -a[1], -a[2]};
}

ImpulseUnits Discarded(const LedgerBooks& books, DiscardReason reason) {
  return books.discarded[static_cast<std::size_t>(reason)];
}

// Two bodies that move (0, 1), one that does not (2).
LedgerReader MakeReader(Coupling coupling = Coupling::kImpulse, double largest = kNoCap,
                        std::uint64_t own_epoch = kOwn) {
  LedgerReader reader(own_epoch, coupling, largest);
  reader.SetBodies({{1, true, 0}, {1, true, 1}, {1, false, 2}});
  reader.BeginEpoch(5);
  return reader;
}

// Modulo 2^64, as everything here.
std::int64_t Twice(std::int64_t x) {
  return static_cast<std::int64_t>(2 * static_cast<std::uint64_t>(x));
}

HapticTick Message(std::uint64_t tick, const std::vector<Channel>& channels,
                   std::uint64_t world_epoch = kOwn) {
  HapticTick message;
  message.tick = tick;
  message.world_epoch = world_epoch;
  message.channel_count = static_cast<std::uint32_t>(channels.size());
  std::copy(channels.begin(), channels.end(), message.channels.begin());
  return message;
}

Channel On(std::uint32_t body, std::int64_t x, std::uint64_t opened_tick = 1,
           std::uint32_t generation = 1) {
  Channel channel;
  channel.body = body;
  channel.generation = generation;
  channel.opened_tick = opened_tick;
  channel.impulse = {x, 0, 0};
  channel.angular_impulse = {0, Twice(x), 0};
  return channel;
}

// The haptic side's ledger, as SPEC.md section 7 has it: a channel that is closed stays until its
// closing tick is acked. Knows what was displayed up to every tick.
class Writer {
 public:
  explicit Writer(unsigned seed) : random_(seed) {
    for (std::int64_t& axis : start_) axis = any_(random_);
  }

  HapticTick Next(std::uint64_t acked_tick) {
    for (auto channel = channels_.begin(); channel != channels_.end();) {
      const bool gone = channel->closed != 0 && acked_tick >= channel->closed;
      channel = gone ? channels_.erase(channel) : channel + 1;
    }
    if (Chance(0.05) && channels_.size() < protocol::kMaxChannels) {
      Open open;
      open.channel =
          On(static_cast<std::uint32_t>(small_(random_) % 3), 0, tick_, Chance(0.1) ? 9U : 1U);
      open.channel.pointer = next_pointer_++ % 4;
      // Several openings in one tick would need different keys; one per tick is enough here.
      channels_.push_back(open);
    }
    ImpulseUnits displayed = shown_.empty() ? start_ : shown_.rbegin()->second;
    for (Open& open : channels_) {
      if (open.closed != 0) continue;
      ImpulseUnits q;
      for (std::int64_t& axis : q) axis = small_(random_) - 500'000'000;
      open.channel.impulse = Sum(open.channel.impulse, q);
      open.channel.angular_impulse = Sum(open.channel.angular_impulse, q);
      displayed = Sum(displayed, q);
      if (Chance(0.03)) open.closed = tick_;
    }
    shown_[tick_] = displayed;
    std::vector<Channel> published;
    for (const Open& open : channels_) published.push_back(open.channel);
    return Message(tick_++, published);
  }

  ImpulseUnits Between(std::uint64_t baseline, std::uint64_t tick) const {
    return Sum(shown_.at(tick), Negative(shown_.at(baseline)));
  }
  bool Chance(double probability) { return probability_(random_) < probability; }

 private:
  struct Open {
    Channel channel;
    std::uint64_t closed = 0;
  };
  std::mt19937_64 random_;
  std::uniform_int_distribution<std::int64_t> any_{-1'000'000'000'000, 1'000'000'000'000};
  std::uniform_int_distribution<std::int64_t> small_{0, 1'000'000'000};
  std::uniform_real_distribution<double> probability_{0, 1};
  std::vector<Open> channels_;
  std::uint64_t tick_ = 1;
  std::uint32_t next_pointer_ = 0;
  ImpulseUnits start_{};
  std::map<std::uint64_t, ImpulseUnits> shown_;
};

}  // namespace

TEST_CASE("the first message of an epoch is a baseline: nothing of it is owed") {
  LedgerReader reader = MakeReader();
  CHECK(reader.acked_epoch() == 0);
  CHECK(reader.Consume(Message(40, {On(0, 1000)})));
  CHECK(reader.Take().empty());
  CHECK(reader.acked_epoch() == 5);
  CHECK(reader.acked_tick() == 40);
  CHECK(reader.baseline_tick() == 40);
  CHECK(reader.Consume(Message(41, {On(0, 1700), On(1, 50, 41)})));
  const auto owed = reader.Take();
  REQUIRE(owed.size() == 2);
  CHECK(owed[0].push.impulse.x() == Approx(700e-12));
  CHECK(owed[0].push.angular_impulse.y() == Approx(1400e-12));
  CHECK(owed[1].push.body == 1);
  CHECK(owed[1].push.impulse.x() == Approx(50e-12));
  CHECK(reader.epoch_books().applied == ImpulseUnits{750, 0, 0});
}

TEST_CASE("a message that is not newer changes nothing") {
  LedgerReader reader = MakeReader();
  reader.Consume(Message(10, {On(0, 0)}));
  reader.Consume(Message(12, {On(0, 100)}));
  CHECK_FALSE(reader.Consume(Message(12, {On(0, 500)})));
  CHECK_FALSE(reader.Consume(Message(11, {On(0, 50)})));
  CHECK(reader.acked_tick() == 12);
  CHECK(reader.Consume(Message(13, {On(0, 101)})));
  reader.Take();
  CHECK(reader.epoch_books().applied == ImpulseUnits{101, 0, 0});
}

TEST_CASE("a key said twice in one message counts once") {
  LedgerReader reader = MakeReader();
  reader.Consume(Message(10, {}));
  reader.Consume(Message(11, {On(0, 100, 11), On(0, 900, 11)}));
  reader.Take();
  CHECK(reader.epoch_books().applied == ImpulseUnits{100, 0, 0});
}

TEST_CASE("a channel whose past is unknown counts from where it is first seen") {
  LedgerReader reader = MakeReader();
  reader.Consume(Message(10, {On(0, 100)}));
  reader.Consume(Message(11, {}));
  reader.Consume(Message(12, {On(0, 5000)}));  // opened before, vanished, came back
  reader.Consume(Message(13, {On(0, 5007)}));
  reader.Take();
  CHECK(reader.epoch_books().applied == ImpulseUnits{7, 0, 0});
}

TEST_CASE("a reopened channel of the same body and pointer starts from zero") {
  LedgerReader reader = MakeReader();
  reader.Consume(Message(10, {On(0, 100, 1)}));
  reader.Consume(Message(11, {On(0, 130, 1), On(0, 4, 11)}));
  reader.Consume(Message(12, {On(0, 9, 11)}));
  reader.Take();
  CHECK(reader.epoch_books().applied == ImpulseUnits{39, 0, 0});
}

TEST_CASE("differences are modulo 2^64") {
  constexpr std::int64_t kMax = std::numeric_limits<std::int64_t>::max();
  constexpr std::int64_t kMin = std::numeric_limits<std::int64_t>::min();
  LedgerReader reader = MakeReader();
  reader.Consume(Message(1, {On(0, kMax - 5)}));
  reader.Consume(Message(2, {On(0, kMin + 4)}));
  reader.Take();
  CHECK(reader.epoch_books().applied == ImpulseUnits{10, 0, 0});
}

TEST_CASE("applied + discarded is what was displayed, exactly, under loss") {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    for (const double cap : {kNoCap, 0.004}) {
      Writer writer(seed);
      LedgerReader reader = MakeReader(Coupling::kImpulse, cap);
      ImpulseUnits life{};
      for (std::uint64_t epoch = 1; epoch <= 3; ++epoch) {
        reader.BeginEpoch(epoch);
        std::uint64_t acked = 0;
        for (int i = 0; i < 600; ++i) {
          const HapticTick message = writer.Next(acked);
          if (writer.Chance(0.4)) continue;  // lapped
          REQUIRE(reader.Consume(message));
          if (!writer.Chance(0.05)) continue;
          for (const OwedPush& owed : reader.Take()) {
            REQUIRE(owed.push.body < 2);
            REQUIRE(owed.push.impulse.norm() <= cap);
          }
          acked = reader.acked_tick();
          const LedgerBooks& books = reader.epoch_books();
          REQUIRE(acked == message.tick);
          REQUIRE(Sum(books.applied, books.TotalDiscarded()) ==
                  writer.Between(reader.baseline_tick(), acked));
        }
        // Nothing may be pending across the epochs for the sums to be comparable.
        reader.Take();
        life = Sum(life, Sum(reader.epoch_books().applied, reader.epoch_books().TotalDiscarded()));
        REQUIRE(Sum(reader.life_books().applied, reader.life_books().TotalDiscarded()) == life);
      }
      if (cap == kNoCap) {
        CHECK(Discarded(reader.life_books(), DiscardReason::kGap) == ImpulseUnits{});
      } else {
        CHECK(Discarded(reader.life_books(), DiscardReason::kGap) != ImpulseUnits{});
      }
      CHECK(Discarded(reader.life_books(), DiscardReason::kUnknownBody) != ImpulseUnits{});
    }
  }
}

TEST_CASE("losing messages loses no impulse") {
  // The same channel read at every tick, and at every hundredth, comes to the same.
  const auto total = [](std::uint64_t stride) {
    LedgerReader reader = MakeReader();
    for (std::uint64_t tick = 0; tick <= 1000; tick += stride) {
      reader.Consume(Message(tick, {On(0, static_cast<std::int64_t>(tick * tick))}));
    }
    return reader.Take()[0].push.impulse.x();
  };
  CHECK(total(1) == total(100));
  CHECK(total(1) == Approx(1e6 * 1e-12).epsilon(1e-15));
}

TEST_CASE("what was displayed against another world is discarded") {
  LedgerReader reader = MakeReader();
  reader.Consume(Message(1, {On(0, 0)}, 66));
  reader.Consume(Message(2, {On(0, 100)}, 66));
  reader.Consume(Message(3, {On(0, 130)}, 0));
  reader.Consume(Message(4, {On(0, 7, 4)}));
  reader.Take();
  CHECK(Discarded(reader.epoch_books(), DiscardReason::kForeignWorld) == ImpulseUnits{130, 0, 0});
  CHECK(reader.epoch_books().applied == ImpulseUnits{7, 0, 0});

  LedgerReader laboratory = MakeReader(Coupling::kImpulse, kNoCap, /*own_epoch=*/0);
  laboratory.Consume(Message(1, {On(0, 0)}, 66));
  laboratory.Consume(Message(2, {On(0, 100)}, 66));
  laboratory.Take();
  CHECK(laboratory.epoch_books().applied == ImpulseUnits{100, 0, 0});
}

TEST_CASE("no such body, an old generation, and one that cannot move") {
  LedgerReader reader = MakeReader();
  reader.Consume(Message(1, {}));
  reader.Consume(Message(2, {On(900, 1, 2), On(0, 10, 2, 3), On(2, 100, 2), On(1, 1000, 2)}));
  const auto owed = reader.Take();
  REQUIRE(owed.size() == 1);
  CHECK(owed[0].push.body == 1);
  CHECK(Discarded(reader.epoch_books(), DiscardReason::kUnknownBody) == ImpulseUnits{111, 0, 0});
}

TEST_CASE("position coupling discards every impulse") {
  LedgerReader reader = MakeReader(Coupling::kPosition);
  reader.Consume(Message(1, {}));
  reader.Consume(Message(2, {On(0, 3, 2), On(2, 4, 2)}));
  CHECK(reader.Take().empty());
  CHECK(Discarded(reader.epoch_books(), DiscardReason::kCoupling) == ImpulseUnits{7, 0, 0});
  CHECK(reader.epoch_books().applied == ImpulseUnits{});
}

TEST_CASE(
    "after a gap no more than the cap is applied, whole messages, and nothing is carried over") {
  constexpr std::int64_t kOne = 1'000'000'000'000;  // 1 N s
  LedgerReader reader = MakeReader(Coupling::kImpulse, 3.5);
  reader.Consume(Message(1, {On(0, 0)}));
  for (std::uint64_t tick = 2; tick <= 11; ++tick) {
    reader.Consume(Message(tick, {On(0, static_cast<std::int64_t>(tick - 1) * kOne / 1)}));
  }
  auto owed = reader.Take();
  REQUIRE(owed.size() == 1);
  CHECK(owed[0].push.impulse.x() == Approx(3));
  CHECK(reader.epoch_books().applied == ImpulseUnits{3 * kOne, 0, 0});
  CHECK(Discarded(reader.epoch_books(), DiscardReason::kGap) == ImpulseUnits{7 * kOne, 0, 0});
  // The next world tick starts afresh.
  reader.Consume(Message(12, {On(0, 11 * kOne)}));
  CHECK(reader.Take()[0].push.impulse.x() == Approx(1));
  // A push there and back is as much pushing as one there.
  for (std::uint64_t tick = 13; tick <= 22; ++tick) {
    reader.Consume(Message(tick, {On(0, (tick % 2 == 0 ? 11 : 12) * kOne)}));
  }
  reader.Take();
  CHECK(Discarded(reader.epoch_books(), DiscardReason::kGap) != ImpulseUnits{7 * kOne, 0, 0});
}

TEST_CASE("what is pending survives a new haptic epoch, and belongs to the old one's books") {
  LedgerReader reader = MakeReader();
  reader.Consume(Message(1, {On(0, 0)}));
  reader.Consume(Message(2, {On(0, 100)}));
  reader.BeginEpoch(6);
  CHECK(reader.acked_epoch() == 0);
  reader.Consume(Message(1, {On(0, 5)}));
  reader.Consume(Message(2, {On(0, 8)}));
  CHECK(reader.Take()[0].push.impulse.x() == Approx(103e-12));
  CHECK(reader.epoch_books().applied == ImpulseUnits{3, 0, 0});
  CHECK(reader.life_books().applied == ImpulseUnits{103, 0, 0});
}

TEST_CASE("what is pending for a scene that goes is declared not applied") {
  LedgerReader reader = MakeReader();
  reader.Consume(Message(1, {On(0, 0)}));
  reader.Consume(Message(2, {On(0, 100)}));
  reader.SetBodies({{2, true}});
  CHECK(reader.Take().empty());
  reader.Consume(Message(3, {On(0, 120)}));  // still the old generation
  reader.Take();
  CHECK(Discarded(reader.epoch_books(), DiscardReason::kUnknownBody) == ImpulseUnits{120, 0, 0});
  CHECK(reader.epoch_books().applied == ImpulseUnits{});
}

TEST_CASE("what is pending for a body that stays the same is applied where it now stands") {
  for (const Coupling coupling : {Coupling::kImpulse, Coupling::kLocal}) {
    LedgerReader reader = MakeReader(coupling);
    reader.Consume(Message(1, {On(0, 0), On(1, 0)}));
    reader.Consume(Message(2, {On(0, 70), On(1, 100)}));
    reader.BeginEpoch(6);
    reader.Consume(Message(1, {On(0, 0), On(1, 0)}));
    reader.Consume(Message(2, {On(0, 7), On(1, 10)}));
    reader.SetBodies({{2, true, 0}, {1, true, 5}});  // 0 is another thing now, 2 is gone
    const auto owed = reader.Take();
    REQUIRE(owed.size() == 1);
    CHECK(owed[0].push.body == 5);
    CHECK(owed[0].push.impulse.x() == Approx(110e-12));
    CHECK(reader.epoch_books().applied == ImpulseUnits{10, 0, 0});
    CHECK(reader.life_books().applied == ImpulseUnits{110, 0, 0});
    CHECK(Discarded(reader.epoch_books(), DiscardReason::kUnknownBody) == ImpulseUnits{7, 0, 0});
    CHECK(Discarded(reader.life_books(), DiscardReason::kUnknownBody) == ImpulseUnits{77, 0, 0});
    if (coupling != Coupling::kLocal) continue;
    REQUIRE(reader.replay().ticks.size() == 4);
    REQUIRE(reader.replay().impulses.size() == 2);
    CHECK(reader.replay().ticks[1].end == 1);
    CHECK(reader.replay().ticks[3].end == 2);
    CHECK(reader.replay().impulses[0].body == 5);
    CHECK(reader.replay().impulses[1].impulse.x() == Approx(10e-12));
  }
}

TEST_CASE("a push and its opposite of two haptic epochs are each in their own books") {
  LedgerReader reader = MakeReader();
  reader.Consume(Message(1, {On(0, 0)}));
  reader.Consume(Message(2, {On(0, 100)}));
  reader.BeginEpoch(6);
  reader.Consume(Message(1, {On(0, 0)}));
  reader.Consume(Message(2, {On(0, -100)}));
  CHECK(reader.Take().empty());
  CHECK(reader.epoch_books().applied == ImpulseUnits{-100, 0, 0});
  CHECK(reader.life_books().applied == ImpulseUnits{});
}

TEST_CASE("random bytes do no harm") {
  std::mt19937_64 random(3);
  LedgerReader reader = MakeReader(Coupling::kImpulse, 2.0, /*own_epoch=*/0);
  for (int round = 0; round < 3000; ++round) {
    HapticTick message;
    std::vector<std::uint64_t> noise(sizeof message / 8);
    for (std::uint64_t& word : noise) word = random();
    std::memcpy(static_cast<void*>(&message), noise.data(), noise.size() * 8);
    message.tick = static_cast<std::uint64_t>(round);
    for (Channel& channel : message.channels) {
      channel.body %= 4;
      channel.generation = 1;
      if (round % 2 == 0) channel.impulse = {round, 0, 0};  // hardly any J, any L
    }
    reader.Consume(message);
    if (round % 5 != 0) continue;
    for (const OwedPush& owed : reader.Take()) {
      REQUIRE(owed.push.impulse.norm() <= 2.0);
      REQUIRE(owed.push.angular_impulse.norm() <= 20.0);
    }
  }
}

TEST_CASE("message by message is the same in all as what is handed out at once") {
  std::mt19937_64 random(8);
  const auto below = [&](std::int64_t n) {
    return static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(n));
  };
  LedgerReader reader = MakeReader(Coupling::kLocal);
  std::array<std::int64_t, 3> totals{};
  std::uint64_t tick = 1;
  std::uint64_t start_ns = 1'000'000'000;
  const auto send = [&](std::uint64_t ticks) {
    HapticTick message;
    for (std::uint64_t i = 0; i < ticks; ++i) {  // all but the last are overwritten unread
      for (std::size_t body = 0; body < 3; ++body) {
        if (below(3) > 0) totals[body] += below(2'000'000'000) - 1'000'000'000;
      }
      const auto length = static_cast<std::uint64_t>(500'000 + below(1'000'000));
      start_ns += length;
      message = Message(tick++, {On(0, totals[0]), On(1, totals[1]), On(2, totals[2])});
      message.start_ns = start_ns;
      message.previous_duration_ns = length;
    }
    REQUIRE(reader.Consume(message));
  };
  send(1);
  reader.Take();
  std::uint64_t taken_ns = start_ns;
  std::uint64_t taken_tick = tick;
  for (int frame = 0; frame < 100; ++frame) {
    for (std::int64_t i = below(40); i > 0; --i) send(below(10) == 0 ? 7 : 1);
    std::array<Vec3, 3> impulse;
    std::array<Vec3, 3> angular;
    impulse.fill(Vec3::Zero());
    angular.fill(Vec3::Zero());
    for (const OwedPush& owed : reader.Take()) {
      impulse[owed.push.body] = owed.push.impulse;
      angular[owed.push.body] = owed.push.angular_impulse;
    }
    double covered = 0;
    std::uint64_t ticks = 0;
    std::size_t end = 0;
    for (const ReplayTick& part : reader.replay().ticks) {
      covered += part.length_s;
      ticks += part.ticks;
      REQUIRE(part.end >= end);
      end = part.end;
    }
    REQUIRE(end == reader.replay().impulses.size());
    REQUIRE(covered == Approx(static_cast<double>(start_ns - taken_ns) * 1e-9).margin(1e-12));
    REQUIRE(ticks == tick - taken_tick);
    taken_ns = start_ns;
    taken_tick = tick;
    for (const ReplayImpulse& push : reader.replay().impulses) {
      REQUIRE(push.body < 2);  // body 2 cannot move
      impulse[push.body] -= push.impulse;
      angular[push.body] -= push.angular_impulse;
    }
    for (std::size_t body = 0; body < 2; ++body) {
      REQUIRE(impulse[body].norm() < 1e-12);
      REQUIRE(angular[body].norm() < 1e-12);
    }
  }
}

TEST_CASE("the first moment of a lost block is counted from what was known before it") {
  LedgerReader reader = MakeReader(Coupling::kLocal);
  Channel channel = On(0, 4'000'000'000'000);  // 4 N s
  channel.first_moment = {1.5, 0, 0};
  reader.Consume(Message(1, {channel}));
  reader.Take();
  channel.impulse[0] += 1'000'000'000'000;
  // 10 ms on the 4 N s that were there, and 3 mN s^2 of the new one.
  channel.first_moment[0] += 0.01 * 4 + 0.003;
  HapticTick message = Message(11, {channel});
  message.start_ns = 10'000'000;
  message.previous_duration_ns = 1'000'000;
  reader.Consume(message);
  reader.Take();
  REQUIRE(reader.replay().ticks.size() == 1);
  CHECK(reader.replay().ticks[0].ticks == 10);
  CHECK(reader.replay().ticks[0].length_s == Approx(0.01));
  REQUIRE(reader.replay().impulses.size() == 1);
  CHECK(reader.replay().impulses[0].impulse.x() == Approx(1));
  CHECK(reader.replay().impulses[0].first_moment.x() == Approx(0.003));
}

// A finger at x [m] that renders with `stiffness`; messages are 1 ms apart.
HapticTick Touching(std::uint64_t tick, double x, double stiffness,
                    const std::vector<Channel>& channels) {
  HapticTick message = Message(tick, channels);
  message.start_ns = tick * 1'000'000;
  message.period_ns = message.previous_duration_ns = 1'000'000;
  message.stiffness = stiffness;
  message.pointer_count = 1;
  message.pointers[0].position = {x, 0, 0};
  return message;
}

TEST_CASE("with what a body is owed comes what it cost the finger, and what its spring held") {
  LedgerReader reader = MakeReader(Coupling::kLocal);
  constexpr std::int64_t kMilli = 1'000'000'000;  // 1 mN s: in a tick of 1 ms, 1 N
  reader.Consume(Touching(1, 0, 2000, {}));
  reader.Consume(Touching(2, 0.001, 2000, {On(0, 2 * kMilli, 2)}));
  reader.Consume(Touching(3, 0.004, 2000, {On(0, 6 * kMilli, 2)}));
  auto owed = reader.Take();
  REQUIRE(owed.size() == 1);
  CHECK(owed[0].work_j == Approx(2 * 0.003));  // nothing was held before tick 2
  CHECK(owed[0].spring_j == 0);                // nor before this world tick

  // The force of the last message before is this world tick's; of lost ones the mean is known.
  reader.Consume(Touching(4, 0.003, 2000, {On(0, 6 * kMilli, 2)}));
  reader.Consume(Touching(8, 0.007, 2000, {On(0, 18 * kMilli, 2)}));
  owed = reader.Take();
  REQUIRE(owed.size() == 1);
  CHECK(owed[0].work_j == Approx(4 * -0.001 + 3 * 0.004));
  CHECK(owed[0].spring_j == Approx(4.0 * 4 / (2 * 2000)));

  // Of two fingers on one body both springs count, and neither of a finger that has let go.
  Channel second = On(0, 2 * kMilli, 9);
  second.pointer = 1;
  reader.Consume(Touching(9, 0.007, 2000, {On(0, 20 * kMilli, 2), second}));
  reader.Take();
  reader.Consume(Touching(10, 0.007, 2000, {On(0, 21 * kMilli, 2)}));
  owed = reader.Take();
  REQUIRE(owed.size() == 1);
  CHECK(owed[0].spring_j == Approx((2.0 * 2 + 2 * 2) / (2 * 2000)));
  reader.Consume(Touching(11, 0.007, 2000, {}));
  reader.Take();
  reader.Consume(Touching(12, 0.007, 2000, {On(0, 1 * kMilli, 12)}));
  owed = reader.Take();
  REQUIRE(owed.size() == 1);
  CHECK(owed[0].spring_j == 0);
}

TEST_CASE("what is given back counts as discarded, to the unit") {
  LedgerReader reader = MakeReader(Coupling::kLocal);
  reader.Consume(Message(1, {On(0, 0)}));
  reader.Consume(Message(2, {On(0, 1000)}));
  reader.Take();
  CHECK(reader.epoch_books().applied == ImpulseUnits{1000, 0, 0});
  reader.GiveBack(Vec3(300.4e-12, 0, 0));
  reader.GiveBack(Vec3(std::numeric_limits<double>::quiet_NaN(), 1e300, 0));
  for (const LedgerBooks& books : {reader.epoch_books(), reader.life_books()}) {
    CHECK(books.applied == ImpulseUnits{700, 0, 0});
    CHECK(Discarded(books, DiscardReason::kGap) == ImpulseUnits{300, 0, 0});
  }
}

TEST_CASE("only `local` keeps messages apart, and what goes with a scene is not replayed") {
  for (const Coupling coupling : {Coupling::kPosition, Coupling::kImpulse}) {
    LedgerReader reader = MakeReader(coupling);
    reader.Consume(Message(1, {On(0, 0)}));
    reader.Consume(Message(2, {On(0, 100)}));
    reader.Take();
    CHECK(reader.replay().ticks.empty());
    CHECK(reader.replay().impulses.empty());
  }
  LedgerReader reader = MakeReader(Coupling::kLocal);
  reader.Consume(Message(1, {On(0, 0)}));
  reader.Consume(Message(2, {On(0, 100)}));
  reader.SetBodies({{2, true}});
  reader.Take();
  CHECK(reader.replay().ticks.size() == 2);  // the time passes
  CHECK(reader.replay().ticks[1].end == 0);
  CHECK(reader.replay().impulses.empty());
  reader.Take();
  CHECK(reader.replay().ticks.empty());
}

}  // namespace rikiseki::world

// SPDX-License-Identifier: MIT
#include "haptic_server/render/ledger.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

namespace rikiseki::haptic {
namespace {

using protocol::ImpulseUnits;
using protocol::Minus;
using protocol::Plus;

constexpr std::int64_t kPeriodNs = 1'000'000;

void RequireBalanced(const protocol::Books& books) {
  REQUIRE(books.covered == Plus(books.applied, books.discarded));
}

ImpulseUnits SumOfChannels(const protocol::HapticTick& message) {
  ImpulseUnits sum{};
  for (std::uint32_t i = 0; i < message.channel_count; ++i) {
    sum = Plus(sum, message.channels[i].impulse);
  }
  return sum;
}

// Books one tick in which `force` [N, on the user] was wanted from body 1 and `displayed` shown.
void BookOne(Ledger& ledger, std::uint64_t tick, const Vec3& wanted, const Vec3& displayed,
             std::int64_t previous_ns = kPeriodNs, const Vec3& point = Vec3(0.1, 0, 0)) {
  const BodyShare share{1, 0, wanted, point};
  std::span<const BodyShare> shares;
  if (!wanted.isZero(0)) {
    REQUIRE(ledger.Open(1, 0, 0, tick));
    shares = std::span(&share, 1);
  }
  ledger.Book({.previous_duration_ns = previous_ns,
               .displayed = displayed,
               .wanted = shares,
               .finger = Vec3(0.1, 0.01, 0)});
}

protocol::WorldFrame Ack(std::uint64_t epoch, std::uint64_t tick, std::uint64_t baseline,
                         const ImpulseUnits& applied, const ImpulseUnits& discarded = {}) {
  protocol::WorldFrame frame;
  frame.acked_epoch = epoch;
  frame.acked_tick = tick;
  frame.baseline_tick = baseline;
  frame.applied = applied;
  frame.discarded = discarded;
  return frame;
}

TEST_CASE("half a sine of 5 mm and 60 ms at 2 kN/m is 0.381972 N s") {
  Ledger ledger(kPeriodNs, 4096, 0);
  for (std::uint64_t k = 0; k <= 61; ++k) {
    const double depth =
        k <= 60 ? 0.005 * std::sin(M_PI * static_cast<double>(k) * 1e-3 / 0.06) : 0;
    const Vec3 force(-2000 * std::max(depth, 0.0), 0, 0);
    BookOne(ledger, k, force, force);
  }
  protocol::HapticTick message;
  ledger.Write(message);
  REQUIRE(message.channel_count == 1);
  const double impulse = 1e-12 * static_cast<double>(message.channels[0].impulse[0]);
  REQUIRE(std::abs(impulse - 0.381972) < 1e-4);
  REQUIRE(impulse == Approx(2000 * 0.005 * 1e-3 / std::tan(M_PI / 120)).epsilon(1e-12));
}

TEST_CASE("with half a period of jitter the totals are the true integral, in force and in moment") {
  std::mt19937_64 random(21);
  std::uniform_int_distribution<std::int64_t> jitter(-500'000, 500'000);
  std::normal_distribution<double> gauss(0, 3);
  Ledger ledger(kPeriodNs, 4096, 0);
  Vec3 impulse = Vec3::Zero();
  Vec3 angular = Vec3::Zero();
  Vec3 force = Vec3::Zero();
  Vec3 point = Vec3::Zero();
  std::int64_t previous_ns = 0;
  protocol::HapticTick message;
  for (std::uint64_t k = 0; k < 3000; ++k) {
    const double dt = 1e-9 * static_cast<double>(previous_ns);
    impulse -= force * dt;  // what the tick before displayed, for as long as it did
    angular -= point.cross(force) * dt;
    force = k + 1 < 3000 ? Vec3(gauss(random), gauss(random), gauss(random)) : Vec3(Vec3::Zero());
    point = 0.1 * Vec3(gauss(random), gauss(random), gauss(random));
    BookOne(ledger, k, force.isZero(0) ? Vec3(1, 0, 0) : force, force, previous_ns, point);
    previous_ns = kPeriodNs + jitter(random);
  }
  ledger.Write(message);
  const protocol::Channel& channel = message.channels[0];
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    // The remainder is carried: one unit, plus the rounding of the sum here.
    REQUIRE(std::abs(static_cast<double>(channel.impulse[i]) * 1e-12 - impulse[axis]) < 3e-12);
    REQUIRE(std::abs(static_cast<double>(channel.angular_impulse[i]) * 1e-12 - angular[axis]) <
            3e-12);
  }
}

TEST_CASE("the first moment is the sum of the published J times the true durations") {
  std::mt19937_64 random(22);
  std::uniform_int_distribution<std::int64_t> jitter(-500'000, 500'000);
  Ledger ledger(kPeriodNs, 4096, 0);
  double expected = 0;   // sum of J_i dt_i up to the tick before
  double published = 0;  // J of the tick before
  std::int64_t previous_ns = kPeriodNs;
  protocol::HapticTick message;
  for (std::uint64_t k = 0; k < 500; ++k) {
    expected += published * 1e-9 * static_cast<double>(previous_ns);
    BookOne(ledger, k, Vec3(-2, 0, 0), Vec3(-2, 0, 0), previous_ns);
    ledger.Write(message);
    published = 1e-12 * static_cast<double>(message.channels[0].impulse[0]);
    REQUIRE(message.channels[0].first_moment[0] ==
            Approx(expected + published * 1e-3).epsilon(1e-12));
    previous_ns = kPeriodNs + jitter(random);
  }
}

TEST_CASE("every unit of the displayed force goes somewhere") {
  std::mt19937_64 random(23);
  std::normal_distribution<double> gauss(0, 5);
  std::uniform_int_distribution<std::int64_t> jitter(-500'000, 500'000);
  Ledger ledger(kPeriodNs, 4096, 0);
  ImpulseQuantizer total;  // the same displayed force, counted by itself
  ImpulseUnits displayed_units{};
  Vec3 before = Vec3::Zero();
  std::int64_t previous_ns = kPeriodNs;
  protocol::HapticTick message;
  for (std::uint64_t k = 0; k < 5000; ++k) {
    std::array<BodyShare, 3> shares;
    for (std::uint32_t body = 0; body < 3; ++body) {
      shares[body] = {body, 0, Vec3(gauss(random), gauss(random), gauss(random)), Vec3::Zero()};
      REQUIRE(ledger.Open(body, 0, 0, k));
    }
    const Vec3 displayed(gauss(random), gauss(random), gauss(random));
    ledger.Book({.previous_duration_ns = previous_ns,
                 .displayed = displayed,
                 .wanted = std::span(shares).first(k % 4),
                 .finger = Vec3(0.1, 0, 0)});
    const double correction = 1e-9 * static_cast<double>(previous_ns) - 1e-3;
    displayed_units =
        Plus(displayed_units, total.Add(-displayed * 1e-3 + before * (k == 0 ? 0 : correction)));
    before = -displayed;
    previous_ns = kPeriodNs + jitter(random);
    ledger.Write(message);
    REQUIRE(Plus(SumOfChannels(message), message.ground.impulse) == displayed_units);
    REQUIRE(ledger.books().displayed == SumOfChannels(message));
    REQUIRE(ledger.books().ground == message.ground.impulse);
  }
}

TEST_CASE("bodies get their share of what was displayed, the ground the rest") {
  Ledger ledger(kPeriodNs, 4096, 0);
  const std::array<BodyShare, 2> shares = {BodyShare{1, 0, Vec3(4, 0, 0), Vec3::Zero()},
                                           BodyShare{2, 0, Vec3(0, 2, 0), Vec3::Zero()}};
  for (const BodyShare& share : shares) REQUIRE(ledger.Open(share.body, 0, 0, 0));
  // Half of it, and something across.
  ledger.Book({.previous_duration_ns = 0,
               .displayed = Vec3(2, 1, 0.5),
               .wanted = shares,
               .finger = Vec3::Zero()});
  protocol::HapticTick message;
  ledger.Write(message);
  REQUIRE(message.channels[0].impulse == ImpulseUnits{-2'000'000'000, 0, 0});
  REQUIRE(message.channels[1].impulse == ImpulseUnits{0, -1'000'000'000, 0});
  REQUIRE(message.ground.impulse == ImpulseUnits{0, 0, -500'000'000});
}

TEST_CASE("a force against what is wanted, or more than it, is not the bodies' doing") {
  Ledger ledger(kPeriodNs, 4096, 0);
  BookOne(ledger, 0, Vec3(4, 0, 0), Vec3(-1, 0, 0), 0);
  protocol::HapticTick message;
  ledger.Write(message);
  REQUIRE(message.channels[0].impulse[0] == 0);
  REQUIRE(message.ground.impulse[0] == 1'000'000'000);
  BookOne(ledger, 1, Vec3(4, 0, 0), Vec3(6, 0, 0));
  ledger.Write(message);
  REQUIRE(message.channels[0].impulse[0] == -4'000'000'000);
}

TEST_CASE("acks cover what was displayed up to their tick, and totals may come in any portions") {
  Ledger ledger(kPeriodNs, 4096, 77);
  std::vector<ImpulseUnits> displayed;
  for (std::uint64_t k = 0; k < 100; ++k) {
    const Vec3 force(-0.1 * static_cast<double>(k), 0, 0);
    BookOne(ledger, k, force, force);
    displayed.push_back(ledger.books().displayed);
  }
  ledger.Receive(5, Ack(77, 10, 10, {}));
  REQUIRE(ledger.books().peer_lost == displayed[10]);  // before that world looked
  REQUIRE(ledger.books().covered == ImpulseUnits{});
  ledger.Receive(5, Ack(0, 30, 10, {}));    // it has not seen us yet
  ledger.Receive(5, Ack(76, 30, 10, {}));   // or speaks of our predecessor
  ledger.Receive(5, Ack(77, 100, 10, {}));  // or of the future
  REQUIRE(ledger.books().covered == ImpulseUnits{});
  const ImpulseUnits first = Minus(displayed[40], displayed[10]);
  ledger.Receive(5, Ack(77, 40, 10, first));
  REQUIRE(ledger.books().covered == first);
  REQUIRE(ledger.books().applied == first);
  ledger.Receive(5, Ack(77, 20, 10, {}));  // the past
  const ImpulseUnits second = Minus(displayed[90], displayed[40]);
  ledger.Receive(5, Ack(77, 90, 10, first, second));
  REQUIRE(ledger.books().covered == Plus(first, second));
  REQUIRE(ledger.books().discarded == second);
  RequireBalanced(ledger.books());
}

TEST_CASE("what a dead world left is lost, and nothing of it comes to the next one") {
  Ledger ledger(kPeriodNs, 4096, 1);
  std::vector<ImpulseUnits> displayed;
  for (std::uint64_t k = 0; k < 100; ++k) {
    BookOne(ledger, k, Vec3(-1, 0.5, 0), Vec3(-1, 0.5, 0));
    displayed.push_back(ledger.books().displayed);
  }
  ledger.Receive(5, Ack(1, 0, 0, {}));
  ledger.Receive(5, Ack(1, 30, 0, Minus(displayed[30], displayed[0])));
  SECTION("its first frame is seen") {
    ledger.Receive(6, Ack(1, 70, 70, {}));
    ledger.Receive(6, Ack(1, 80, 70, Minus(displayed[80], displayed[70])));
  }
  SECTION("its first frames were missed") {
    ledger.Receive(6, Ack(1, 80, 70, Minus(displayed[80], displayed[70])));
  }
  const protocol::Books& books = ledger.books();
  REQUIRE(books.peer_lost == Plus(displayed[0], Minus(displayed[70], displayed[30])));
  REQUIRE(books.covered ==
          Plus(Minus(displayed[30], displayed[0]), Minus(displayed[80], displayed[70])));
  RequireBalanced(books);
}

TEST_CASE("a baseline out of sight is no reason to lose the balance") {
  Ledger ledger(kPeriodNs, 64, 0);
  for (std::uint64_t k = 0; k < 1000; ++k) BookOne(ledger, k, Vec3(-1, 0, 0), Vec3(-1, 0, 0));
  ledger.Receive(5, Ack(3, 100, 0, {1000, 0, 0}));  // forgotten: ignored
  REQUIRE(ledger.books().covered == ImpulseUnits{});
  ledger.Receive(5, Ack(3, 990, 0, {990'000'000, 0, 0}));
  REQUIRE(ledger.books().applied == ImpulseUnits{});
  ledger.Receive(5, Ack(3, 995, 0, {995'000'000, 0, 0}));
  REQUIRE(ledger.books().covered != ledger.books().applied);  // it lied: the books show it
  REQUIRE(ledger.books().covered == ImpulseUnits{5'000'000'000, 0, 0});
}

TEST_CASE("a channel is reused only after the world has seen it closed") {
  Ledger ledger(kPeriodNs, 4096, 0);
  const auto nobody_near = [](std::uint32_t, std::uint32_t) { return false; };
  const auto all_near = [](std::uint32_t, std::uint32_t) { return true; };
  for (std::uint32_t body = 0; body < protocol::kMaxChannels; ++body) {
    REQUIRE(ledger.Open(body, 0, 0, 0));
  }
  REQUIRE_FALSE(ledger.Open(99, 0, 0, 0));
  const BodyShare share{7, 0, Vec3(-1, 0, 0), Vec3::Zero()};
  const auto book = [&](bool touching) {
    ledger.Book({.previous_duration_ns = kPeriodNs,
                 .displayed = touching ? share.force : Vec3(Vec3::Zero()),
                 .wanted = touching ? std::span(&share, 1) : std::span<const BodyShare>(),
                 .finger = Vec3::Zero()});
  };
  book(true);
  ledger.CloseIdle(0, 0, all_near);
  ledger.CloseIdle(1, 0, nobody_near);  // another pointer's
  protocol::HapticTick message;
  ledger.Write(message);
  for (std::uint32_t i = 0; i < message.channel_count; ++i) {
    REQUIRE(message.channels[i].state == protocol::ChannelState::kOpen);
  }
  ledger.CloseIdle(0, 0, nobody_near);
  ledger.Write(message);
  for (std::uint32_t i = 0; i < message.channel_count; ++i) {  // the touched one stays open
    REQUIRE((message.channels[i].state == protocol::ChannelState::kOpen) ==
            (message.channels[i].body == 7));
  }
  book(false);
  ledger.CloseIdle(0, 1, nobody_near);
  ledger.Receive(5, Ack(3, 0, 0, {}));  // has seen tick 0: all but body 7 are free
  ledger.Write(message);
  REQUIRE(message.channel_count == 1);
  REQUIRE(message.channels[0].body == 7);
  const ImpulseUnits total = message.channels[0].impulse;
  REQUIRE(total[0] == 1'000'000'000);
  REQUIRE(ledger.Open(7, 0, 0, 2));  // touched again before it was freed: the totals go on
  ledger.Write(message);
  REQUIRE(message.channels[0].impulse == total);
  REQUIRE(message.channels[0].opened_tick == 0);
  REQUIRE(ledger.Open(99, 0, 0, 2));
  SECTION("a world that has not looked yet starts with all of them") {
    ledger.BeginWorld(6);
    ledger.Write(message);
    REQUIRE(message.channel_count == 0);
  }
  SECTION("a world that reads already must see them closed first") {
    book(false);
    ledger.Receive(6, Ack(3, 2, 2, {}));
    ledger.BeginWorld(6);
    ledger.CloseIdle(0, 3, nobody_near);
    book(false);
    ledger.Write(message);
    REQUIRE(message.channel_count == 2);
    ledger.Receive(6, Ack(3, 3, 2, {}));
    ledger.Write(message);
    REQUIRE(message.channel_count == 0);
  }
}

TEST_CASE("damaged forces and hostile acks overflow nothing") {
  ImpulseQuantizer quantizer;
  REQUIRE(quantizer.Add(Vec3(std::nan(""), 0, 0))[0] == 0);
  REQUIRE(quantizer.Add(Vec3(1e300, -1e300, 0))[0] == 4'000'000'000'000'000'000);
  REQUIRE(quantizer.Add(Vec3(0, 0, 0))[0] == 0);  // the remainder stays below a unit
  Ledger ledger(kPeriodNs, 64, 0);
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  for (std::uint64_t k = 0; k < 100; ++k) {
    BookOne(ledger, k, Vec3(1e12, 0, 0), Vec3(1e12, 0, 0));
    ledger.Receive(5, Ack(3, k, 0, {kMost, -kMost, kMost}, {-kMost, kMost, 1}));
    ledger.Receive(5, Ack(3, k, 0, {-kMost, kMost, kMost}, {kMost, kMost, 1}));
    ledger.Receive(~std::uint64_t{0}, Ack(3, ~std::uint64_t{0}, ~std::uint64_t{0}, {kMost, 0, 0}));
  }
}

TEST_CASE("the share of a fixed body goes to the ground, with its moment at its own point") {
  Ledger ledger(kPeriodNs, 4096, 0);
  REQUIRE(ledger.Open(1, 0, 0, 0));
  REQUIRE(ledger.Open(2, 0, 0, 0));  // a channel from before body 2 was said to be fixed
  const Vec3 push(0, 0, 3);
  const Vec3 wall(-1, 2, 0);
  const std::array<BodyShare, 2> shares = {
      BodyShare{.body = 1, .force = push, .point = Vec3(0.1, 0, 0)},
      BodyShare{.body = 2, .force = wall, .point = Vec3(0, 0.2, 0.3), .fixed = true}};
  ledger.Book({.displayed = push + wall, .wanted = shares, .finger = Vec3(5, 5, 5)});
  protocol::HapticTick message;
  ledger.Write(message);
  REQUIRE(message.channel_count == 2);
  CHECK(message.channels[0].impulse == ImpulseUnits{0, 0, -3'000'000'000});
  CHECK(message.channels[0].angular_impulse == ImpulseUnits{0, 300'000'000, 0});
  CHECK(message.channels[1].impulse == ImpulseUnits{});
  CHECK(message.channels[1].angular_impulse == ImpulseUnits{});
  CHECK(message.ground.impulse == ImpulseUnits{1'000'000'000, -2'000'000'000, 0});
  const Vec3 moment = -1e-3 * Vec3(0, 0.2, 0.3).cross(wall);
  CHECK(message.ground.angular_impulse[0] == std::llround(moment.x() * 1e12));
  CHECK(message.ground.angular_impulse[1] == std::llround(moment.y() * 1e12));
  CHECK(message.ground.angular_impulse[2] == std::llround(moment.z() * 1e12));
  REQUIRE(ledger.Booked().size() == 1);
  CHECK(ledger.Booked()[0].body == 1);
}

TEST_CASE("what belongs to nobody goes to the ground with its moment at the finger") {
  Ledger ledger(kPeriodNs, 4096, 0);
  const BodyShare share{.body = 2, .force = {2, 0, 0}, .point = {0, 0.2, 0}, .fixed = true};
  // Half of it was displayed, and 1 N across that nobody wanted.
  ledger.Book({.displayed = {1, 0, 1}, .wanted = std::span(&share, 1), .finger = Vec3(0.1, 0, 0)});
  protocol::HapticTick message;
  ledger.Write(message);
  CHECK(message.ground.impulse == ImpulseUnits{-1'000'000'000, 0, -1'000'000'000});
  CHECK(message.ground.angular_impulse == ImpulseUnits{0, 100'000'000, 200'000'000});
}

TEST_CASE("what was booked in a tick is what the channels grew by") {
  Ledger ledger(kPeriodNs, 4096, 0);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> any(-1, 1);
  protocol::HapticTick before;
  protocol::HapticTick now;
  for (std::uint32_t body = 1; body <= 3; ++body) REQUIRE(ledger.Open(body, 7, 0, 0));
  ledger.Write(before);
  std::int64_t previous_ns = 0;
  for (int k = 0; k < 300; ++k) {
    std::vector<BodyShare> shares;
    Vec3 wanted = Vec3::Zero();
    for (std::uint32_t body = 1; body <= 3; ++body) {
      if (any(random) < 0) continue;
      shares.push_back({.body = body,
                        .generation = 7,
                        .force = {any(random), any(random), any(random)},
                        .point = {any(random), any(random), any(random)}});
      wanted += shares.back().force;
    }
    ledger.Book({.previous_duration_ns = previous_ns, .displayed = 0.8 * wanted, .wanted = shares});
    previous_ns = kPeriodNs + static_cast<std::int64_t>(4e5 * any(random));
    ledger.Write(now);
    std::size_t grown = 0;
    for (std::uint32_t i = 0; i < 3; ++i) {
      const ImpulseUnits growth = Minus(now.channels[i].impulse, before.channels[i].impulse);
      const ImpulseUnits angular =
          Minus(now.channels[i].angular_impulse, before.channels[i].angular_impulse);
      if (growth == ImpulseUnits{}) continue;
      REQUIRE(grown < ledger.Booked().size());
      const BodyImpulse& booked = ledger.Booked()[grown++];
      REQUIRE(booked.body == now.channels[i].body);
      REQUIRE(booked.generation == 7);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto at = static_cast<Eigen::Index>(axis);
        REQUIRE(std::llround(booked.impulse[at] * 1e12) == growth[axis]);
        REQUIRE(std::llround(booked.angular_impulse[at] * 1e12) == angular[axis]);
      }
    }
    REQUIRE(grown == ledger.Booked().size());
    before = now;
  }
}

// Two surfaces that all but face each other: the finger is where the wedge opens, and each pushes with what would
// be 168 kN if the sum, which is what is displayed, were not cut to 10 N.
TEST_CASE("between surfaces that face each other no body gets more than the largest share") {
  Ledger ledger(kPeriodNs, 4096, 0);
  REQUIRE(ledger.Open(1, 0, 0, 0));
  REQUIRE(ledger.Open(2, 0, 0, 0));
  const std::array<BodyShare, 2> shares = {BodyShare{1, 0, Vec3(-2947, 23, -168098), Vec3::Zero()},
                                           BodyShare{2, 0, Vec3(0.3, -0.6, 168099), Vec3::Zero()}};
  const Vec3 wanted = shares[0].force + shares[1].force;
  const Vec3 displayed = 10 * wanted.normalized();
  ledger.Book({.previous_duration_ns = kPeriodNs,
               .displayed = displayed,
               .wanted = shares,
               .finger = Vec3::Zero(),
               .largest_share = 10});
  REQUIRE(ledger.Booked().size() == 2);
  Vec3 on_bodies = Vec3::Zero();
  for (const BodyImpulse& push : ledger.Booked()) {
    CHECK(push.impulse.norm() == Approx(10e-3).epsilon(1e-9));
    on_bodies += push.impulse;
  }
  protocol::HapticTick message;
  ledger.Write(message);
  const Vec3 ground = ToVec3(protocol::InSi(message.ground.impulse));
  CHECK((on_bodies + ground + displayed * 1e-3).norm() < 1e-11);
}

}  // namespace
}  // namespace rikiseki::haptic

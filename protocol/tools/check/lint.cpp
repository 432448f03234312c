// SPDX-License-Identifier: MIT
#include "protocol/tools/check/lint.h"

#include <sys/stat.h>
#include <time.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <system_error>
#include <thread>
#include <utility>

#include "common/clock.h"

namespace rikiseki::protocol::check {
namespace {

std::uint64_t Load(const std::uint64_t& word, std::memory_order order) {
  return std::atomic_ref<std::uint64_t>(const_cast<std::uint64_t&>(word)).load(order);
}

bool AllZero(const void* begin, std::size_t bytes) {
  const auto* const byte = static_cast<const unsigned char*>(begin);
  return std::all_of(byte, byte + bytes, [](unsigned char b) { return b == 0; });
}

const StreamEntry& EntryOf(const RawView& view, StreamType type) {
  const SegmentHeader& header = view.header();
  for (std::uint32_t i = 0; i < std::min(header.stream_count, kMaxStreams); ++i) {
    if (header.stream[i].type_id == static_cast<std::uint32_t>(type)) return header.stream[i];
  }
  Fail("there is no stream of type " + std::to_string(static_cast<std::uint32_t>(type)));
}

constexpr std::int64_t kOldEpochNs = 60'000'000'000;

/// When the object of a name was made, ns of CLOCK_MONOTONIC; false if it is gone.
std::pair<std::int64_t, bool> MadeNs(const std::string& name) {
  struct stat status {};
  if (stat(("/dev/shm" + name).c_str(), &status) != 0) return {0, false};
  timespec real{};
  clock_gettime(CLOCK_REALTIME, &real);
  const auto ns = [](const timespec& time) {
    return static_cast<std::int64_t>(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
  };
  return {ns(status.st_mtim) - ns(real) + MonotonicNow(), true};
}

template <typename Done>
void WaitFor(double seconds, Done&& done) {
  const std::int64_t limit = MonotonicNow() + static_cast<std::int64_t>(seconds * 1e9);
  while (MonotonicNow() < limit && !done()) {
  }
}

}  // namespace

RawView::RawView(const std::string& instance, Role role) {
  name_ = SegmentName(instance, role);
  object_ = SharedObject::Open(name_, false);
  bytes_ = object_->Info().bytes;
  if (bytes_ < kHeaderBytes) throw Outcome{Verdict::kFailed, name_ + " is shorter than a header"};
  header_ = static_cast<SegmentHeader*>(object_->Map(bytes_));
}

Ring RawView::RingOf(const StreamEntry& entry) const {
  auto* const base = reinterpret_cast<unsigned char*>(header_);
  return {reinterpret_cast<std::uint64_t*>(base + entry.cursor_offset),
          reinterpret_cast<std::uint64_t*>(base + entry.ring_offset), entry.slot_stride,
          entry.slot_count, entry.payload_bytes};
}

void CheckReserved(const RawView& view) {
  const SegmentHeader& header = view.header();
  Require(header.reserved0 == 0 && AllZero(header.reserved1, sizeof header.reserved1) &&
              AllZero(header.reserved2, sizeof header.reserved2) &&
              AllZero(header.reserved3, sizeof header.reserved3) &&
              AllZero(header.reserved4, sizeof header.reserved4),
          "reserved bytes of the header are not 0");
  for (std::uint32_t i = 0; i < kMaxStreams; ++i) {
    const StreamEntry& entry = header.stream[i];
    Require(entry.flags == 0 && entry.reserved0 == 0 &&
                AllZero(entry.reserved1, sizeof entry.reserved1),
            "flags or reserved bytes of directory entry " + std::to_string(i) + " are not 0");
    Require(i < header.stream_count || AllZero(&entry, sizeof entry),
            "directory entry " + std::to_string(i) + " is not in use and not 0");
  }
  Require(header.build[sizeof header.build - 1] == 0, "build is not NUL padded");
}

void CheckEpoch(const RawView& view) {
  const auto now = static_cast<std::uint64_t>(MonotonicNow());
  Require(view.header().epoch != 0, "epoch is 0");
  Require(view.header().epoch <= now, "epoch " + std::to_string(view.header().epoch) +
                                          " lies in the future: it is a time of "
                                          "CLOCK_MONOTONIC, now " +
                                          std::to_string(now));
  // The kernel knows when the object was made, by the other clock. Suspension and clock steps forward
  // only make it look older.
  const auto [made_ns, known] = MadeNs(view.name());
  if (!known) return;
  const std::int64_t older = made_ns - static_cast<std::int64_t>(view.header().epoch);
  Require(older < kOldEpochNs, "epoch is " + Num(static_cast<double>(older) * 1e-9) +
                                   " s older than the object: an epoch of an earlier life?");
}

void CheckPermissions(const std::string& instance, Role role) {
  struct stat status {};
  const std::string path = "/dev/shm" + SegmentName(instance, role);
  if (stat(path.c_str(), &status) != 0) Inform("the name is gone");
  const auto mode = static_cast<unsigned>(status.st_mode & 07777);
  char text[8];
  std::snprintf(text, sizeof text, "%04o", mode);
  Require((mode & 0007) == 0, std::string("others have access: mode ") + text);
  if (mode != 0640) NotStrict(std::string("mode is ") + text + ", not 0640");
}

void CheckHeartbeat(const RawView& view, StreamType main, double seconds) {
  const StreamEntry& entry = EntryOf(view, main);
  const Ring ring = view.RingOf(entry);
  const SegmentHeader& header = view.header();
  const std::uint64_t tick = Load(header.tick, std::memory_order_acquire);
  const std::uint64_t beat = Load(header.heartbeat_ns, std::memory_order_acquire);
  const std::uint64_t published = Load(*ring.published, std::memory_order_acquire);
  std::uint64_t previous_beat = beat;
  bool backwards = false;
  std::uint64_t beats = 0;
  const std::int64_t limit = MonotonicNow() + static_cast<std::int64_t>(seconds * 1e9);
  while (MonotonicNow() < limit) {
    const std::uint64_t now_beat = Load(header.heartbeat_ns, std::memory_order_acquire);
    if (now_beat < previous_beat) backwards = true;
    if (now_beat != previous_beat) ++beats;
    previous_beat = now_beat;
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
  const std::uint64_t messages = Load(*ring.published, std::memory_order_acquire) - published;
  const std::uint64_t ticks = Load(header.tick, std::memory_order_acquire) - tick;
  const auto now = static_cast<std::uint64_t>(MonotonicNow());
  Require(messages > 0, "nothing was published in " + Num(seconds) + " s");
  Require(!backwards, "heartbeat_ns runs backwards");
  Require(beats > 0 && beats + 2 >= messages / 4,
          "heartbeat_ns was stored " + std::to_string(beats) + " times while " +
              std::to_string(messages) + " messages were published");
  Require(previous_beat <= now + 1'000'000, "heartbeat_ns lies in the future");
  Require(ticks + 3 >= messages && messages + 3 >= ticks,
          "the header's tick grew by " + std::to_string(ticks) + " while " +
              std::to_string(messages) + " messages were published");
}

void CheckPublication(const RawView& view, StreamType main, double seconds) {
  const Ring ring = view.RingOf(EntryOf(view, main));
  std::uint64_t newest = 0;
  std::uint64_t looks = 0;
  std::uint64_t odd = 0;
  bool backwards = false;
  std::uint64_t wrong = 0;
  WaitFor(seconds, [&] {
    // SYNC: published. Whoever reads n must find message n whole, or a later one in its place.
    const std::uint64_t number = Load(*ring.published, std::memory_order_acquire);
    if (number < newest) backwards = true;
    if (number != 0) {
      const std::uint64_t sequence =
          Load(ring.Slot(number)[kSequenceWord], std::memory_order_acquire);
      if (sequence < 2 * number) ++odd;
      if (sequence > 2 * number && ((sequence + 1) / 2 - number) % ring.slot_count != 0) ++wrong;
    }
    newest = std::max(newest, number);
    ++looks;
    return backwards;
  });
  Require(looks > 0 && newest > 0, "nothing was published");
  Require(!backwards, "published runs backwards");
  Require(odd == 0, "published named a message that was not whole yet, in " + std::to_string(odd) +
                        " of " + std::to_string(looks) + " looks");
  Require(wrong == 0, "a slot holds a number that does not belong there");
}

namespace {

/// What a frame says of what can move, in a line; fails where it contradicts itself.
std::string TellMobility(const WorldFrame& frame) {
  std::uint32_t fixed = 0;
  std::uint32_t not_said = 0;
  double least = 0;
  double most = 0;
  for (std::uint32_t i = 0; i < frame.plane_count; ++i) {
    const Plane& plane = frame.planes[i];
    const double yields = plane.inverse_mass;
    fixed += yields == 0;
    not_said += yields == kMobilityNotSaid;
    if (yields > 0) least = least == 0 ? yields : std::min(least, yields);
    most = std::max(most, yields);
    for (std::uint32_t j = 0; j < frame.local_body_count; ++j) {
      Require(
          yields != 0 || plane.body != frame.local_bodies[j].body,
          "body " + std::to_string(plane.body) + " is local, and its plane says that it is fixed");
    }
  }
  std::string text = "frame " + std::to_string(frame.frame) + ": " +
                     std::to_string(frame.plane_count) + " planes, " + std::to_string(fixed) +
                     " of bodies that cannot move, " + std::to_string(not_said) +
                     " that do not say";
  if (most > 0) text += ", the others yield by " + Num(least) + " to " + Num(most) + " 1/kg";
  return text;
}

std::string TellLocalBodies(const WorldFrame& frame) {
  std::string text = "frame " + std::to_string(frame.frame) + ": " +
                     std::to_string(frame.local_body_count) + " local bodies";
  if (frame.local_body_count > 0) {
    text += ", substep " + Ms(static_cast<std::int64_t>(frame.local_substep_ns));
  }
  for (std::uint32_t i = 0; i < frame.local_body_count; ++i) {
    const LocalBody& body = frame.local_bodies[i];
    text += "; body " + std::to_string(body.body) + " (generation " +
            std::to_string(body.generation) + ") " + Num(body.mass) + " kg, " +
            std::to_string(body.contact_count) + " contact planes";
    for (std::uint32_t c = 0; c < body.contact_count; ++c) {
      const ContactPlane& contact = body.contacts[c];
      text += (c == 0 ? " (body " : ", body ") + std::to_string(contact.other_body) + " gap " +
              Num(contact.gap) + " m";
      if (contact.radius > 0) text += " radius " + Num(contact.radius) + " m";
    }
    if (body.contact_count > 0) text += ")";
  }
  return text;
}

}  // namespace

std::vector<Result> Inspect(const std::string& instance, Role role) {
  const std::string who = RoleName(role);
  const StreamType main = role == Role::kHaptic ? StreamType::kHapticTick : StreamType::kWorldFrame;
  std::vector<Result> results;
  std::string told;  // what a check says of a sound segment
  const auto add = [&](const std::string& id, const std::function<void()>& check) {
    told.clear();
    const std::int64_t start = MonotonicNow();
    Result result{who + "/" + id, {}, 0};
    try {
      check();
      result.outcome.text = told;
    } catch (const Outcome& outcome) {
      result.outcome = outcome;
    } catch (const std::exception& error) {
      result.outcome = {Verdict::kFailed, error.what()};
    }
    result.seconds = static_cast<double>(MonotonicNow() - start) * 1e-9;
    results.push_back(result);
  };

  AttachResult attached;
  add("9.1-1/header", [&] {
    attached = Attach({.instance = instance, .role = role, .required = {}, .owners = {}});
    Require(attached.status == AttachStatus::kAttached, attached.text);
  });
  if (attached.status != AttachStatus::kAttached) return results;
  const RawView raw(instance, role);
  add("3.1-8/reserved", [&] { CheckReserved(raw); });
  add("5.2-10/epoch", [&] { CheckEpoch(raw); });
  add("5.1-1/mode", [&] { CheckPermissions(instance, role); });
  add("3.1-4/heartbeat", [&] { CheckHeartbeat(raw, main, 0.5); });
  add("4.1-2/published", [&] { CheckPublication(raw, main, 0.3); });
  add("9.2-3/messages", [&] {
    PeerView& view = *attached.view;
    std::uint64_t seen = 0;
    const auto read = [&](auto reader, auto message) {
      for (int i = 0; i < 50; ++i) {
        const ReadStatus status = reader.ReadNext(message);
        if (status == ReadStatus::kFresh) ++seen;
        Require(status != ReadStatus::kRejected, std::string("message ") +
                                                     std::to_string(reader.received().number) +
                                                     ": " + Describe(reader.refusal()));
        if (status != ReadStatus::kFresh) break;
      }
    };
    if (role == Role::kHaptic) {
      read(view.Reader<HapticTick>(), HapticTick{});
      read(view.Reader<HapticHealth>(), HapticHealth{});
    } else {
      read(view.Reader<WorldFrame>(), WorldFrame{});
      read(view.Reader<WorldHealth>(), WorldHealth{});
      BodiesReader bodies(view.Stream(StreamType::kWorldBodies));
      Require(bodies.ReadLatest() != ReadStatus::kRejected, "world.bodies is not sound");
    }
    Require(seen > 0, "no message");
    told = std::to_string(seen) + " messages read";
  });
  if (role != Role::kWorld) return results;
  WorldFrame newest;
  attached.view->Reader<WorldFrame>().ReadLatest(newest);
  add("6.2-13/mobility", [&] { told = TellMobility(newest); });
  add("7.7-6/local-bodies", [&] { told = TellLocalBodies(newest); });
  return results;
}

}  // namespace rikiseki::protocol::check

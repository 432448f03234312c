// SPDX-License-Identifier: MIT
// Would the ring's tests notice a broken ring? Every interleaving of one copy with a burst of
// stores, and every crash point, over the shipped algorithm and over mutants of it.
#include <pthread.h>
#include <sched.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <thread>
#include <vector>

#include "protocol/ring.h"
#include "protocol/stream.h"

namespace rikiseki::protocol {
namespace {

constexpr std::uint32_t kSlots = 4;
constexpr std::size_t kWords = 5;
constexpr std::uint32_t kStride = 128;
static_assert(sizeof(SlotHeader) + kWords * 8 <= kStride);

enum class Mutant {
  kNone,
  kNoWritingMark,       // 2n - 1 is not stored
  kPublishBeforeWrite,  // the counter grows before the slot is written
  kNoSecondLook,        // the reader trusts what it copied
  kNoFirstLook,         // the reader does not ask whether the message is whole before it copies
};

struct Step {
  std::uint64_t* word;
  std::uint64_t value;
};

/// A ring whose writer can be stopped after any store.
class Stoppable {
 public:
  explicit Stoppable(Mutant mutant) : mutant_(mutant), words_(kSlots * kStride / 8) {}

  Ring ring() {
    return {&published_, words_.data(), kStride, kSlots, kStride - sizeof(SlotHeader)};
  }

  /// Word i of message n; any other mixture is torn.
  static std::uint64_t Word(std::uint64_t number, std::size_t i) { return number << 8 | i; }

  void Store() {
    if (next_ == steps_.size()) Prepare();
    *steps_[next_].word = steps_[next_].value;
    ++next_;
  }
  void StoreWholeMessage() {
    do {
      Store();
    } while (next_ != steps_.size());
  }
  std::uint64_t published() const { return published_; }

 private:
  void Prepare() {
    steps_.clear();
    next_ = 0;
    ++number_;
    std::array<std::uint64_t, kWords> payload;
    for (std::size_t i = 0; i < kWords; ++i) payload[i] = Word(number_, i);
    PublishStores(ring(), number_, payload, static_cast<std::uint32_t>(number_), number_,
                  [this](std::uint64_t& word, std::uint64_t value, std::memory_order) {
                    steps_.push_back({&word, value});
                  });
    if (mutant_ == Mutant::kNoWritingMark) steps_.erase(steps_.begin());
    if (mutant_ == Mutant::kPublishBeforeWrite) {
      steps_.insert(steps_.begin(), steps_.back());
      steps_.pop_back();
    }
  }

  Mutant mutant_;
  std::uint64_t published_ = 0;
  std::vector<std::uint64_t> words_;
  std::uint64_t number_ = 0;
  std::vector<Step> steps_;
  std::size_t next_ = 0;
};

struct Findings {
  int torn = 0;        // accepted, but not one message
  int unreadable = 0;  // the writer stopped, and its newest published message cannot be read
  int read = 0;
};

bool Whole(std::uint64_t number, const std::array<std::uint64_t, kWords>& payload,
           const Received& received) {
  for (std::size_t i = 0; i < kWords; ++i) {
    if (payload[i] != Stoppable::Word(number, i)) return false;
  }
  return received.number == number && received.stamp_ns == number && received.blocks == number &&
         received.used_bytes == kWords * 8;
}

/// One copy of the newest message, before whose load `at` the writer performs `burst` stores.
void Interleave(Mutant mutant, std::uint64_t messages, int at, int burst, Findings& findings) {
  Stoppable ring(mutant);
  for (std::uint64_t n = 0; n < messages; ++n) ring.StoreWholeMessage();
  const std::uint64_t number = ring.published();
  int loads = 0;
  const int last = 3 + static_cast<int>(kWords);
  const auto load = [&](std::uint64_t& word, std::memory_order) {
    if (loads == at) {
      for (int i = 0; i < burst; ++i) ring.Store();
    }
    const bool first_look = loads == 0 && mutant == Mutant::kNoFirstLook;
    const bool second_look = loads == last && mutant == Mutant::kNoSecondLook;
    ++loads;
    return first_look || second_look ? 2 * number : word;
  };
  std::array<std::uint64_t, kWords> payload{};
  Received received;
  if (!CopyLoads(ring.ring(), number, payload, received, load)) return;
  ++findings.read;
  if (!Whole(number, payload, received)) ++findings.torn;
}

Findings Explore(Mutant mutant) {
  constexpr int kStores = 5 + static_cast<int>(kWords);
  constexpr int kLoads = 4 + static_cast<int>(kWords);
  Findings findings;
  for (std::uint64_t messages = 1; messages <= 2 * kSlots; ++messages) {
    for (int at = 0; at < kLoads; ++at) {
      // Up to once around the ring and beyond.
      for (int burst = 0; burst <= (static_cast<int>(kSlots) + 1) * kStores; ++burst) {
        Interleave(mutant, messages, at, burst, findings);
      }
    }
  }
  Stoppable crashing(mutant);
  for (int stores = 1; stores <= 3 * static_cast<int>(kSlots) * kStores; ++stores) {
    crashing.Store();
    if (crashing.published() == 0) continue;
    StreamReader reader(crashing.ring());
    std::array<std::uint64_t, kWords> payload{};
    Received received;
    const ReadStatus status = reader.ReadLatest(payload, received);
    if (status != ReadStatus::kFresh || received.number != crashing.published()) {
      ++findings.unreadable;
    } else if (!Whole(received.number, payload, received)) {
      ++findings.torn;
    }
  }
  return findings;
}

TEST_CASE("no interleaving and no crash point hurts the shipped ring") {
  const Findings findings = Explore(Mutant::kNone);
  CHECK(findings.torn == 0);
  CHECK(findings.unreadable == 0);
  CHECK(findings.read > 1000);
}

TEST_CASE("the suite fails for each mutant of the ring") {
  CHECK(Explore(Mutant::kNoWritingMark).torn > 0);
  CHECK(Explore(Mutant::kNoSecondLook).torn > 0);
  CHECK(Explore(Mutant::kPublishBeforeWrite).unreadable > 0);
  // No mutant: the first look only saves copies in vain, the second one finds everything.
  CHECK(Explore(Mutant::kNoFirstLook).torn == 0);
}

bool MakeFifo(int priority) {
  sched_param parameters{};
  parameters.sched_priority = priority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0;
}

bool PinToOneCpu() {
  cpu_set_t allowed;
  cpu_set_t one;
  CPU_ZERO(&one);
  if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) return false;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (!CPU_ISSET(cpu, &allowed)) continue;
    CPU_SET(cpu, &one);
    return pthread_setaffinity_np(pthread_self(), sizeof one, &one) == 0;
  }
  return false;
}

TEST_CASE("a FIFO reader on the writer's processor needs at most three copies") {
  constexpr std::size_t kManyWords = 400;
  constexpr std::uint32_t kLongStride = 3328;
  std::uint64_t published = 0;
  std::vector<std::uint64_t> memory(kSlots * kLongStride / 8);
  const Ring ring{&published, memory.data(), kLongStride, kSlots, kManyWords * 8};
  std::atomic<bool> stop{false};
  std::thread writing([&] {
    PinToOneCpu();
    StreamWriter writer(ring);
    std::array<std::uint64_t, kManyWords> payload{};
    while (!stop.load(std::memory_order_relaxed)) {
      payload.fill(writer.published() + 1);
      writer.Publish(payload, 0, 0);
    }
  });
  bool allowed = false;
  std::uint64_t fresh = 0;
  std::uint64_t torn = 0;
  std::uint64_t contended = 0;
  std::uint64_t most_copies = 0;
  std::uint64_t repeated = 0;
  std::thread reading([&] {
    allowed = PinToOneCpu() && MakeFifo(10);
    StreamReader reader(ring);
    std::array<std::uint64_t, kManyWords> payload{};
    for (int tick = 0; allowed && tick < 1000; ++tick) {
      // Asleep, so that the writer runs; awake again, it was stopped wherever it was.
      std::this_thread::sleep_for(std::chrono::microseconds(300 + tick % 7));
      Received received;
      const std::uint64_t before = reader.retries();
      const ReadStatus status = reader.ReadLatest(payload, received);
      const std::uint64_t copies = reader.retries() - before + 1;
      most_copies = std::max(most_copies, copies);
      repeated += copies > 1 ? 1 : 0;
      if (status == ReadStatus::kContended) ++contended;
      if (status != ReadStatus::kFresh) continue;
      ++fresh;
      for (const std::uint64_t word : payload) torn += word != received.number ? 1 : 0;
    }
  });
  reading.join();
  stop = true;
  writing.join();
  if (!allowed) {
    WARN("left out: no right to SCHED_FIFO here");
    return;
  }
  INFO("fresh " << fresh << ", with more than one copy " << repeated);
  CHECK(torn == 0);
  CHECK(contended == 0);
  CHECK(most_copies <= 3);
  // Another thread of the machine may hold the writer's processor for long; some must have come
  // through.
  CHECK(fresh > 10);
}

/// One message stream in plain memory.
struct Stream {
  std::uint64_t published = 0;
  std::vector<std::uint64_t> memory = std::vector<std::uint64_t>(kSlots * 16384 / 8);
  Ring ring{&published, memory.data(), 16384, kSlots, kWorldFrameBytes};
};

WorldFrame Frame(std::uint64_t number) {
  WorldFrame frame;
  frame.frame = number;
  frame.period_ns = 1'000'000;
  return frame;
}

TEST_CASE("a stamp from the future or from before is rejected") {
  Stream stream;
  MessageWriter<WorldFrame> writer{StreamWriter(stream.ring)};
  MessageReader<WorldFrame> reader{StreamReader(stream.ring), 1'000'000};
  WorldFrame got;
  const auto read = [&](std::uint64_t stamp_ns, std::uint64_t now_ns) {
    writer.Publish(Frame(writer.published() + 1), stamp_ns);
    return reader.ReadLatest(got, now_ns);
  };
  CHECK(read(1'000'000'000, 1'000'000'000) == ReadStatus::kFresh);
  CHECK(read(1'001'900'000, 1'001'000'000) == ReadStatus::kFresh);  // within the slack
  CHECK(read(1'003'000'001, 1'002'000'000) == ReadStatus::kRejected);
  CHECK(reader.refusal() == DecodeStatus::kStamp);
  CHECK(got.frame == 2);
  CHECK(read(1'001'900'000, 1'003'000'000) == ReadStatus::kFresh);  // as old as the last is no sin
  CHECK(read(1'001'899'999, 1'004'000'000) == ReadStatus::kRejected);
  CHECK(read(~0ull, 1'005'000'000) == ReadStatus::kRejected);
  CHECK(read(~0ull, kNoClock) == ReadStatus::kFresh);  // nothing to hold it against
  CHECK_FALSE(reader.hopeless());
}

TEST_CASE("a counter that jumps ahead is a broken protocol") {
  const auto after_jump = [](std::uint64_t messages, std::uint64_t elapsed_ns) {
    Stream stream;
    MessageWriter<WorldFrame> writer{StreamWriter(stream.ring)};
    MessageReader<WorldFrame> reader{StreamReader(stream.ring), 1'000'000};
    WorldFrame got;
    writer.Publish(Frame(1), 1);
    REQUIRE(reader.ReadLatest(got, 1'000'000'000) == ReadStatus::kFresh);
    for (std::uint64_t i = 0; i < messages; ++i) writer.Publish(Frame(i + 2), 1);
    const ReadStatus status = reader.ReadLatest(got, 1'000'000'000 + elapsed_ns);
    CHECK(reader.hopeless() == (status == ReadStatus::kBackwards));
    CHECK((got.frame == 1) == (status == ReadStatus::kBackwards));
    return status;
  };
  CHECK(after_jump(1, 1'000'000) == ReadStatus::kFresh);
  CHECK(after_jump(19, 0) == ReadStatus::kFresh);  // a burst of a ring or so
  CHECK(after_jump(20, 0) == ReadStatus::kBackwards);
  CHECK(after_jump(400, 100'000'000) == ReadStatus::kFresh);  // four times too fast is borne
  CHECK(after_jump(440, 100'000'000) == ReadStatus::kBackwards);
  CHECK(after_jump(1000, 10'000'000'000) == ReadStatus::kFresh);  // the reader was asleep
}

}  // namespace
}  // namespace rikiseki::protocol

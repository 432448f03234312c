// SPDX-License-Identifier: MIT
// What it costs to publish and to read the latest message: this protocol, a bare one-slot seqlock
// (which a reader of higher priority could hang on: SPEC.md 4.5), and Boost's message_queue.
// Interleaved runs, median and spread:
//
//   protocol_bench --benchmark_enable_random_interleaving=true --benchmark_repetitions=7
//     --benchmark_report_aggregates_only=true
//
// "typical": one finger, two open channels; a frame of three planes. "full": everything there may
// be.
#include <benchmark/benchmark.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <boost/interprocess/ipc/message_queue.hpp>
#include <chrono>
#include <cstring>
#include <vector>

#include "protocol/stream.h"

namespace rikiseki::protocol {
namespace {

HapticTick Tick(bool full) {
  HapticTick m;
  m.period_ns = 1'000'000;
  m.pointer_count = full ? kMaxPointers : 1;
  m.channel_count = full ? kMaxChannels : 2;
  for (std::uint32_t i = 0; i < m.pointer_count; ++i) {
    m.pointers[i].pointer = i;
    if (full) m.pointers[i].torque = {1, 2, 3};
  }
  m.ground.impulse = {1, 2, 3};
  return m;
}

WorldFrame Frame(bool full) {
  WorldFrame m;
  m.frame = 1;
  m.period_ns = 50'000'000;
  m.plane_count = full ? kMaxPlanes : 3;
  for (std::uint32_t i = 0; i < m.plane_count; ++i) {
    m.planes[i].normal = {0, 0, 1};
    if (full) m.planes[i].stiffness = m.planes[i].static_friction = m.planes[i].recovery_s = 1;
    if (full) m.planes[i].velocity = {1, 2, 3};
  }
  m.local_body_count = full ? kMaxLocalBodies : 0;
  m.local_substep_ns = 1'000'000;
  for (std::uint32_t i = 0; i < m.local_body_count; ++i) {
    m.local_bodies[i].body = i;
    m.local_bodies[i].contact_count = kMaxContactPlanes;
    for (auto& contact : m.local_bodies[i].contacts) contact.normal = {0, 0, 1};
  }
  return m;
}

/// A ring in plain memory.
class Memory {
 public:
  explicit Memory(std::uint32_t payload_bytes)
      : payload_bytes_(payload_bytes),
        stride_((payload_bytes + 32 + 127) / 128 * 128),
        slots_(8 * stride_ / 8) {}
  Ring ring() { return {&published_, slots_.data(), stride_, 8, payload_bytes_}; }

 private:
  alignas(128) std::uint64_t published_ = 0;
  std::uint32_t payload_bytes_;
  std::uint32_t stride_;
  std::vector<std::uint64_t> slots_;
};

template <typename Message>
std::vector<std::uint64_t> Packed(const Message& message) {
  std::vector<std::uint64_t> words(StreamOf<Message>::kBytes / 8);
  words.resize(Encode(message, words).used_bytes / 8);
  return words;
}

/// The least that lets a reader notice a half-written value: one sequence, one slot.
class Seqlock {
 public:
  explicit Seqlock(std::size_t words) : words_(words) {}

  void Write(std::span<const std::uint64_t> payload) {
    Store(sequence_, ++count_ * 2 - 1, std::memory_order_relaxed);
    for (std::size_t i = 0; i < payload.size(); ++i) {
      Store(words_[i], payload[i], std::memory_order_release);
    }
    Store(sequence_, count_ * 2, std::memory_order_release);
  }
  bool Read(std::span<std::uint64_t> payload) {
    const std::uint64_t before = Load(sequence_, std::memory_order_acquire);
    if (before % 2 != 0) return false;
    for (std::size_t i = 0; i < payload.size(); ++i) {
      payload[i] = Load(words_[i], std::memory_order_acquire);
    }
    return Load(sequence_, std::memory_order_relaxed) == before;
  }

 private:
  static void Store(std::uint64_t& word, std::uint64_t value, std::memory_order order) {
    std::atomic_ref<std::uint64_t>(word).store(value, order);
  }
  static std::uint64_t Load(std::uint64_t& word, std::memory_order order) {
    return std::atomic_ref<std::uint64_t>(word).load(order);
  }
  alignas(128) std::uint64_t sequence_ = 0;
  std::uint64_t count_ = 0;
  std::vector<std::uint64_t> words_;
};

/// Times each call by itself and adds its median and 99th percentile [ns], the clock's own cost
/// taken off.
template <typename Call>
void TimeEach(benchmark::State& state, std::size_t bytes, Call&& call) {
  using Clock = std::chrono::steady_clock;
  std::vector<std::int64_t> costs;
  std::vector<std::int64_t> idle;
  costs.reserve(1 << 20);
  for (auto _ : state) {
    const auto begin = Clock::now();
    call();
    const auto end = Clock::now();
    if (costs.size() < costs.capacity()) costs.push_back((end - begin).count());
    state.SetIterationTime(std::chrono::duration<double>(end - begin).count());
  }
  for (int i = 0; i < 1000; ++i) {
    const auto begin = Clock::now();
    idle.push_back((Clock::now() - begin).count());
  }
  const auto quantile = [](std::vector<std::int64_t>& values, double fraction) {
    const auto at = values.begin() +
                    static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return static_cast<double>(*at);
  };
  const double clock = quantile(idle, 0.5);
  state.counters["p50_ns"] = std::max(0.0, quantile(costs, 0.5) - clock);
  state.counters["p99_ns"] = std::max(0.0, quantile(costs, 0.99) - clock);
  state.counters["bytes"] = static_cast<double>(bytes);
}

template <typename Message>
void PublishMessage(benchmark::State& state, const Message& message) {
  Memory memory(StreamOf<Message>::kBytes);
  MessageWriter<Message> writer{StreamWriter(memory.ring())};
  TimeEach(state, Packed(message).size() * 8, [&] { writer.Publish(message, 1); });
}

template <typename Message>
void PublishSeqlock(benchmark::State& state, const Message& message) {
  const auto packed = Packed(message);
  Seqlock lock(packed.size());
  TimeEach(state, packed.size() * 8, [&] { lock.Write(packed); });
}

namespace ipc = boost::interprocess;

/// A queue of eight places that goes away with the object.
class Queue {
 public:
  explicit Queue(std::size_t bytes)
      : name_("rikiseki-bench-" + std::to_string(getpid())),
        queue_((ipc::message_queue::remove(name_.c_str()), ipc::create_only), name_.c_str(), 8,
               bytes) {}
  ~Queue() { ipc::message_queue::remove(name_.c_str()); }
  void Send(std::span<const std::uint64_t> words) {
    queue_.send(words.data(), words.size_bytes(), 0);
  }
  void Receive(std::span<std::uint64_t> words) {
    std::size_t received = 0;
    unsigned priority = 0;
    queue_.receive(words.data(), words.size_bytes(), received, priority);
  }

 private:
  std::string name_;
  ipc::message_queue queue_;
};

template <typename Message>
void PublishQueue(benchmark::State& state, const Message& message) {
  auto packed = Packed(message);
  Queue queue(packed.size() * 8);
  std::size_t waiting = 0;
  TimeEach(state, packed.size() * 8, [&] {
    // A queue that nobody empties blocks; the price of emptying it is part of it.
    if (waiting == 8) {
      queue.Receive(packed);
      --waiting;
    }
    queue.Send(packed);
    ++waiting;
  });
}

/// The ring alone: a reader that has not seen the newest message yet.
template <typename Message>
void ReadRing(benchmark::State& state, const Message& message) {
  const auto packed = Packed(message);
  Memory memory(StreamOf<Message>::kBytes);
  StreamWriter(memory.ring()).Publish(packed, 0, 1);
  std::vector<std::uint64_t> words(StreamOf<Message>::kBytes / 8);
  for (auto _ : state) {
    StreamReader reader(memory.ring());
    Received received;
    benchmark::DoNotOptimize(reader.ReadLatest(words, received));
    benchmark::DoNotOptimize(words.data());
    benchmark::ClobberMemory();
  }
  state.counters["bytes"] = static_cast<double>(packed.size() * 8);
}

template <typename Message>
void ReadSeqlock(benchmark::State& state, const Message& message) {
  const auto packed = Packed(message);
  Seqlock lock(packed.size());
  lock.Write(packed);
  std::vector<std::uint64_t> words(packed.size());
  for (auto _ : state) {
    benchmark::DoNotOptimize(lock.Read(words));
    benchmark::DoNotOptimize(words.data());
    benchmark::ClobberMemory();
  }
  state.counters["bytes"] = static_cast<double>(packed.size() * 8);
}

template <typename Message>
void ReadQueue(benchmark::State& state, const Message& message) {
  auto packed = Packed(message);
  Queue queue(packed.size() * 8);
  for (auto _ : state) {
    state.PauseTiming();
    queue.Send(packed);
    state.ResumeTiming();
    queue.Receive(packed);
  }
  state.counters["bytes"] = static_cast<double>(packed.size() * 8);
}

/// Read, checked and unpacked: what a loop really pays for a fresh message.
template <typename Message>
void ReadDecoded(benchmark::State& state, const Message& message) {
  Memory memory(StreamOf<Message>::kBytes);
  const auto packed = Packed(message);
  std::vector<std::uint64_t> words(StreamOf<Message>::kBytes / 8);
  const Encoded encoded = Encode(message, words);
  StreamWriter(memory.ring()).Publish(packed, encoded.blocks, 1);
  static Message got;
  for (auto _ : state) {
    StreamReader reader(memory.ring());
    Received received;
    reader.ReadLatest(words, received);
    benchmark::DoNotOptimize(Decode(words, {received.used_bytes, received.blocks}, got));
    benchmark::ClobberMemory();
  }
  state.counters["bytes"] = static_cast<double>(packed.size() * 8);
}

template <typename Message>
void Register(const std::string& what, const Message& message) {
  const auto add = [&](const char* name, auto* function, bool each) {
    auto* registered = benchmark::RegisterBenchmark(
        (std::string(name) + "/" + what).c_str(),
        [function, message](benchmark::State& state) { function(state, message); });
    if (each) registered->UseManualTime();
  };
  add("publish/rikiseki", PublishMessage<Message>, true);
  add("publish/seqlock", PublishSeqlock<Message>, true);
  add("publish/message_queue", PublishQueue<Message>, true);
  add("read/rikiseki", ReadRing<Message>, false);
  add("read/seqlock", ReadSeqlock<Message>, false);
  add("read/message_queue", ReadQueue<Message>, false);
  add("read/rikiseki_decoded", ReadDecoded<Message>, false);
}

}  // namespace
}  // namespace rikiseki::protocol

int main(int argc, char** argv) {
  using namespace rikiseki::protocol;  // NOLINT(google-build-using-namespace)
  Register("tick_typical", Tick(false));
  Register("tick_full", Tick(true));
  Register("frame_typical", Frame(false));
  Register("frame_full", Frame(true));
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 64;
  benchmark::RunSpecifiedBenchmarks();
}

// SPDX-License-Identifier: MIT
// An ordinary mouse, as the kernel's event device gives it: how far it went. A thread of its own opens and
// closes the device; the tick's thread reads an open one, and hands it back when it is of no use any more.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "common/realtime.h"

namespace rikiseki::haptic {

/// In counts since the beginning: x to the right, y away from the hand.
struct MouseWay {
  std::int64_t x = 0;
  std::int64_t y = 0;
};

class EventMouse {
 public:
  /// `path`: an event device, or a pipe with a name into which another program writes such events. Looks
  /// once before it returns, then goes on looking by itself; that there is no mouse is a state.
  explicit EventMouse(std::string path);
  ~EventMouse();
  EventMouse(const EventMouse&) = delete;
  EventMouse& operator=(const EventMouse&) = delete;

  /// Everything that it went since the last call, at most some hundred events: a call takes its time. None
  /// if there is no mouse (any more). // RT: reads, and does not wait
  std::optional<MouseWay> Read() noexcept;

  /// Why there is none, in at most 31 characters, and in a sentence with the cure; empty while there is
  /// one. From any thread. // RT: the first
  const char* Trouble() const noexcept { return trouble_.load(std::memory_order_relaxed); }
  std::string Complaint() const;

 private:
  static constexpr int kNone = -1;

  void Supervise();
  void Look();
  void Say(const char* trouble, const std::string& complaint);

  const std::string path_;
  MouseWay way_;
  int held_ = kNone;      // the tick's file descriptor
  bool is_away_ = false;  // the supervisor's: one is offered or held

  // SYNC: release by the supervisor, acquire by the tick: an open one.
  std::atomic<int> offered_{kNone};
  // SYNC: release by the tick, acquire by the supervisor: one to be closed.
  std::atomic<int> returned_{kNone};
  std::atomic<const char*> trouble_{""};

  mutable std::mutex mutex_;
  std::string complaint_;

  std::atomic<bool> stop_{false};
  std::optional<RealtimeThread> thread_;  // of the ordinary scheduler, with a small stack
};

}  // namespace rikiseki::haptic

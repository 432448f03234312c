// SPDX-License-Identifier: MIT
// Keeps a loop attached to its peer, whichever of the two starts first, dies or is replaced. An
// ordinary thread looks, opens, checks, maps and unmaps; the loop only exchanges pointers with it.
//
// Loop side, every tick:
//
//   if (link.HasNext()) {
//     ... drain link.current() for the last time: the old epoch's messages are still there ...
//     PeerView* view = link.TakeNext();     // the old view is now the attacher's: do not touch it
//     reader = view->Reader<WorldFrame>();
//   }
//   PeerView* view = link.current();        // null until the first peer
//   const bool alive = view && view->Ready();
//
// Thread safety: the functions marked RT belong to one thread, the loop's; PollNews() to any.
//
// Invariants
//   1. Every view is owned by the attacher; it destroys only those that the loop gave back.
//   2. At most two views exist: the one the loop holds and one on offer. A third waits until the
//      first was given back, so the place for retired views is empty whenever there is an offer.
//   3. What is on offer was wholly built before (release/acquire on `offered_`).
#pragma once

#include <pthread.h>

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "protocol/attach.h"

namespace rikiseki::protocol {

struct PeerLinkOptions {
  AttachRequest peer;
  int poll_ms = 100;
};

class PeerLink {
 public:
  /// Starts the attacher. Throws SegmentError (64) for a wrong instance name, std::system_error if
  /// no thread can be had.
  explicit PeerLink(const PeerLinkOptions& options);
  /// Stops the attacher and unmaps everything: the loop must have ended.
  ~PeerLink();
  PeerLink(const PeerLink&) = delete;
  PeerLink& operator=(const PeerLink&) = delete;

  /// What the loop holds; null before the first TakeNext. A dead peer's view stays until then: its
  /// last messages can still be read. // RT:
  PeerView* current() const noexcept { return current_; }
  /// A newer peer waits to be taken. Whatever current() is read for after this said so is its last word: its
  /// owner died or closed before. // RT:
  bool HasNext() const noexcept {
    // SYNC: offered. The attacher saw the end of the predecessor before it offered the successor.
    return offered_.load(std::memory_order_acquire) != nullptr;
  }
  /// Gives back the view held and takes the one on offer; without an offer, changes nothing.
  /// Returns current(). // RT:
  PeerView* TakeNext() noexcept;
  /// The held peer talks nonsense: it counts as gone and incompatible until its object changes. //
  /// RT:
  void Refuse() noexcept;
  /// There is a peer, but not one that this library can read. // RT:
  bool incompatible() const noexcept { return incompatible_.load(std::memory_order_relaxed); }

  /// Lines for the log since the last call: attached, gone, incompatible and why.
  std::vector<std::string> PollNews();

 private:
  void Run() noexcept;
  void Step();
  void TakeBack();
  void WatchNewest();
  void LookForPeer();
  void Report(const std::string& line);

  const PeerLinkOptions options_;
  const std::string name_;
  PeerView* current_ = nullptr;  // of the loop
  std::atomic<PeerView*> offered_{nullptr};
  std::atomic<PeerView*> retired_{nullptr};
  std::atomic<PeerView*> refused_{nullptr};
  std::atomic<bool> incompatible_{false};

  // Of the attacher.
  std::vector<std::unique_ptr<PeerView>> views_;  // the newest last
  ObjectId unreadable_;                           // not tried again
  std::string last_report_;                       // not repeated

  std::mutex mutex_;  // never taken by the loop
  std::condition_variable wake_;
  bool stopping_ = false;
  std::vector<std::string> news_;
  pthread_t thread_{};
};

}  // namespace rikiseki::protocol

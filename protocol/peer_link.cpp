// SPDX-License-Identifier: MIT
#include "protocol/peer_link.h"

#include <limits.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <system_error>
#include <utility>

namespace rikiseki::protocol {
namespace {

// mlockall() locks whole stacks; the default of 8 MiB would waste that much.
constexpr std::size_t kStackBytes = 256 * 1024;
constexpr std::size_t kMostNews = 64;

}  // namespace

PeerLink::PeerLink(const PeerLinkOptions& options)
    : options_(options), name_(SegmentName(options.peer.instance, options.peer.role)) {
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, std::max<std::size_t>(kStackBytes, PTHREAD_STACK_MIN));
  // The daemon's signals are for its main thread.
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  const int error = pthread_create(
      &thread_, &attributes,
      [](void* link) -> void* {
        static_cast<PeerLink*>(link)->Run();
        return nullptr;
      },
      this);
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  pthread_attr_destroy(&attributes);
  if (error != 0) throw std::system_error(error, std::generic_category(), "attacher thread");
}

PeerLink::~PeerLink() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  pthread_join(thread_, nullptr);
}

PeerView* PeerLink::TakeNext() noexcept {
  // SYNC: offered. The view was wholly built before it was offered.
  PeerView* const next = offered_.exchange(nullptr, std::memory_order_acquire);
  if (next == nullptr) return current_;
  // SYNC: retired. The loop's last access to the old view comes before the attacher unmaps it.
  retired_.store(current_, std::memory_order_release);
  current_ = next;
  return current_;
}

void PeerLink::Refuse() noexcept {
  if (current_ == nullptr) return;
  current_->MarkGone();
  refused_.store(current_, std::memory_order_release);
}

std::vector<std::string> PeerLink::PollNews() {
  const std::lock_guard lock(mutex_);
  return std::exchange(news_, {});
}

void PeerLink::Report(const std::string& line) {
  if (line == last_report_) return;
  last_report_ = line;
  const std::lock_guard lock(mutex_);
  if (news_.size() < kMostNews) news_.push_back(line);
}

void PeerLink::Run() noexcept {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    lock.unlock();
    try {
      TakeBack();
      WatchNewest();
      LookForPeer();
    } catch (const std::exception& error) {
      Report(name_.substr(1) + ": cannot attach: " + error.what());
    }
    lock.lock();
    wake_.wait_for(lock, std::chrono::milliseconds(options_.poll_ms), [this] { return stopping_; });
  }
}

void PeerLink::TakeBack() {
  // First what was given back, then what was refused: a view refused before it was given back is
  // then seen here while it still exists. SYNC: retired.
  PeerView* const retired = retired_.exchange(nullptr, std::memory_order_acquire);
  if (PeerView* const refused = refused_.exchange(nullptr, std::memory_order_acquire)) {
    unreadable_ = refused->object();
    incompatible_.store(true, std::memory_order_relaxed);
    Report(name_.substr(1) + ": refused, its messages break the protocol (epoch " +
           std::to_string(refused->epoch()) + ")");
  }
  if (retired != nullptr) {
    std::erase_if(views_, [retired](const auto& view) { return view.get() == retired; });
  }
}

void PeerLink::WatchNewest() {
  if (views_.empty() || views_.back()->gone()) return;
  PeerView& view = *views_.back();
  const std::string who = name_.substr(1) + " (epoch " + std::to_string(view.epoch()) + ")";
  const SegmentState state = view.State();
  if (state == SegmentState::kClosed) {
    Report(who + ": closed by its owner");
  } else if (state == SegmentState::kSuperseded) {
    Report(who + ": superseded by a new one");
  } else if (!view.OwnerAlive()) {
    Report(who + ": its owner died");
  } else if (const ObjectId named = StatObject(name_).id; named == ObjectId{}) {
    // Removed behind its owner's back (systemd's RemoveIPC does that): the pair works on, but who
    // restarts will not find it.
    Report(who + ": its owner lives, but somebody removed the name");
    return;
  } else if (named != view.object()) {
    Report(who + ": another segment took its name");
  } else {
    return;
  }
  view.MarkGone();
}

void PeerLink::LookForPeer() {
  const bool attached = !views_.empty() && !views_.back()->gone();
  const bool waiting = offered_.load(std::memory_order_relaxed) != nullptr;
  if (attached || waiting || views_.size() > 1) return;
  const ObjectId named = StatObject(name_).id;
  if (named != ObjectId{} && named == unreadable_) return;
  AttachResult result = Attach(options_.peer);
  const bool incompatible = result.status == AttachStatus::kIncompatible;
  incompatible_.store(incompatible, std::memory_order_relaxed);
  unreadable_ = incompatible ? result.object : ObjectId{};
  if (incompatible || result.status == AttachStatus::kForbidden) Report(result.text);
  if (result.status != AttachStatus::kAttached) return;
  Report(result.text);
  if (!result.view->note().empty()) Report(name_.substr(1) + ": " + result.view->note());
  views_.push_back(std::move(result.view));
  // SYNC: offered.
  offered_.store(views_.back().get(), std::memory_order_release);
}

}  // namespace rikiseki::protocol

// SPDX-License-Identifier: MIT
// The writing end of a segment: makes it anew, owns it while the process lives, and closes it.
// Nobody else writes to it or removes it. SPEC.md section 5.
//
// A start takes the role lock (a file in the process's own runtime directory), puts the object of a
// dead predecessor out of the way, makes a fresh one, fills it, and only then says `ready`. An
// existing object is never truncated or reused: a reader may have it mapped.
#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "protocol/ring.h"
#include "protocol/segment.h"
#include "protocol/stream.h"

namespace rikiseki::protocol {

/// A reason not to own a segment. what() is one plain line; exit_code() is of sysexits.h: 64 wrong
/// name, 75 somebody else holds the role or memory is short, 78 the name belongs to another user.
class SegmentError : public std::runtime_error {
 public:
  SegmentError(int exit_code, const std::string& what)
      : std::runtime_error(what), exit_code_(exit_code) {}
  int exit_code() const noexcept { return exit_code_; }

 private:
  int exit_code_;
};

/// "/rikiseki.<instance>.haptic" or ".world". Throws SegmentError (64) unless `instance` is 1 to 64
/// of A-Z a-z 0-9 _ -.
std::string SegmentName(const std::string& instance, Role role);

/// "haptic" or "world".
const char* RoleName(Role role) noexcept;

/// One stream to make.
struct StreamSpec {
  StreamType type;
  std::uint32_t payload_bytes;  // a multiple of 8
  std::uint32_t slot_count;     // a power of two, >= kMinSlots
  std::uint64_t period_ns;      // nominal; 0 = aperiodic
};

/// Slots of haptic.tick: a world that sleeps for its longest period plus latency must not be
/// lapped, with a factor 4 in hand. SPEC.md 6.1.
std::uint32_t HapticTickSlots(std::uint64_t longest_world_period_ns, std::uint64_t latency_ns,
                              std::uint64_t period_ns);

/// The streams of a haptic segment.
std::vector<StreamSpec> HapticStreams(std::uint64_t period_ns, std::uint32_t tick_slots,
                                      std::uint64_t health_period_ns);

/// The streams of a world segment with room for `bodies` bodies (clamped to kMaxBodies) and for
/// `colliders` of them, at least one each (clamped to kMaxColliders), 64 of them meshes.
std::vector<StreamSpec> WorldStreams(std::uint64_t period_ns, std::uint32_t bodies,
                                     std::uint64_t health_period_ns, std::uint32_t colliders = 0);

struct OwnerOptions {
  std::string instance = "0";
  Role role = Role::kHaptic;
  std::vector<StreamSpec> streams;
  std::string build;              // git describe; for people
  std::string runtime_directory;  // of the lock file; empty: see RuntimeDirectory()
};

/// The first entry of $RUNTIME_DIRECTORY; else $XDG_RUNTIME_DIR/haptics; else /tmp/rikiseki-<uid>.
std::string RuntimeDirectory();

/// What the owner met as a reader of its peer. Monotonic.
struct HealthCounters {
  std::uint64_t overruns = 0;
  std::uint64_t lapped = 0;
  std::uint64_t read_retries = 0;
  std::uint64_t rejected = 0;
  std::uint64_t gaps = 0;
};

class SegmentOwner {
 public:
  /// Throws SegmentError. Not for the real-time thread.
  explicit SegmentOwner(const OwnerOptions& options);
  ~SegmentOwner();  // Close()
  SegmentOwner(const SegmentOwner&) = delete;
  SegmentOwner& operator=(const SegmentOwner&) = delete;

  const std::string& name() const noexcept { return name_; }
  /// Grows strictly over the restarts within one boot; never 0.
  std::uint64_t epoch() const noexcept { return epoch_; }
  /// What start-up found worth a line in the log: the predecessor's remains, memory not locked.
  const std::vector<std::string>& notes() const noexcept { return notes_; }

  /// The writing end of a stream; call once per stream. Throws std::out_of_range for one not in
  /// OwnerOptions::streams.
  StreamWriter Stream(StreamType type) const;
  template <typename Message>
  MessageWriter<Message> Writer() const {
    return MessageWriter<Message>(Stream(StreamOf<Message>::kType));
  }

  /// Sign of life, every tick. // RT:
  void Heartbeat(std::uint64_t tick, std::uint64_t now_ns) noexcept;
  /// state = faulted with a code for people. The heartbeat goes on. // RT:
  void SetFault(std::uint64_t code) noexcept;
  /// state = ready again. // RT:
  void ClearFault() noexcept;
  /// // RT:
  void SetCounters(const HealthCounters& counters) noexcept;

  /// state = closed, and the name is free. Idempotent. After it the writers must not be used.
  void Close() noexcept;

 private:
  struct Resources;
  std::string name_;
  std::uint64_t epoch_ = 0;
  std::vector<std::string> notes_;
  std::unique_ptr<Resources> resources_;
  SegmentHeader* header_ = nullptr;
};

}  // namespace rikiseki::protocol

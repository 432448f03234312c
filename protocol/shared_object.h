// SPDX-License-Identifier: MIT
// A named shared-memory object: open or create it, map it, lock it. The only place that knows
// Boost.Interprocess and the system calls beside it.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace rikiseki::protocol {

/// Identity of a shared-memory object; {0, 0} = none.
struct ObjectId {
  dev_t device = 0;
  ino_t inode = 0;
  bool operator==(const ObjectId&) const = default;
};

/// What the kernel says of an object.
struct ObjectInfo {
  ObjectId id;
  bool regular = false;
  uid_t owner = 0;
  std::uint64_t bytes = 0;
};

/// Of the object that presently bears the name ("/rikiseki.0.world"); id {0, 0} if there is none.
ObjectInfo StatObject(const std::string& name) noexcept;

/// Takes the name away; the object lives on in those who mapped it.
void RemoveObject(const std::string& name) noexcept;

class SharedObject {
 public:
  /// A fresh object, mode 0640, with its memory allocated. Throws std::system_error: EEXIST,
  /// ENOSPC, ...
  static std::unique_ptr<SharedObject> Create(const std::string& name, std::uint64_t bytes);
  /// An existing one. Throws std::system_error: ENOENT, EACCES, ... Check StatObject() first that
  /// it is a regular file: opening a pipe would block.
  static std::unique_ptr<SharedObject> Open(const std::string& name, bool writable);
  ~SharedObject();
  SharedObject(const SharedObject&) = delete;
  SharedObject& operator=(const SharedObject&) = delete;

  ObjectInfo Info() const noexcept;

  /// Maps the first `bytes` of the object and touches every page, so that no later access waits for
  /// one. Throws std::system_error.
  void* Map(std::uint64_t bytes);
  /// Locks the mapped pages into memory. Empty, or why it was refused.
  std::string LockPages() noexcept;

  /// Takes the write lock on byte 0 that tells readers that the owner lives. The kernel frees it
  /// with the process. False if somebody else holds it.
  bool TakeOwnerLock() noexcept;
  /// Does anybody hold that lock through another descriptor? Only who may write can.
  bool OwnerLocked() const noexcept;

 private:
  struct Boost;
  explicit SharedObject(std::unique_ptr<Boost> boost, bool writable);
  int descriptor() const noexcept;

  std::unique_ptr<Boost> boost_;
  bool writable_;
};

}  // namespace rikiseki::protocol

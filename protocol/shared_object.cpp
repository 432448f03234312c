// SPDX-License-Identifier: MIT
#include "protocol/shared_object.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <boost/interprocess/mapped_region.hpp>
#include <boost/interprocess/shared_memory_object.hpp>
#include <cerrno>
#include <cstring>
#include <system_error>

namespace rikiseki::protocol {
namespace {

namespace bi = boost::interprocess;

constexpr std::uint64_t kPageBytes = 4096;

ObjectInfo ToInfo(const struct stat& status) noexcept {
  return {{status.st_dev, status.st_ino},
          S_ISREG(status.st_mode),
          status.st_uid,
          static_cast<std::uint64_t>(status.st_size)};
}

[[noreturn]] void Throw(int error, const std::string& what) {
  throw std::system_error(error, std::generic_category(), what);
}

/// Runs a Boost call; its exceptions become system errors.
template <typename Call>
auto Translated(const std::string& what, Call call) {
  try {
    return call();
  } catch (const bi::interprocess_exception& error) {
    Throw(error.get_native_error(), what);
  }
}

struct flock OwnerByte(short type) noexcept {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  lock.l_start = 0;
  lock.l_len = 1;
  return lock;
}

}  // namespace

struct SharedObject::Boost {
  bi::shared_memory_object object;
  bi::mapped_region region;
};

ObjectInfo StatObject(const std::string& name) noexcept {
  struct stat status {};
  const std::string path = "/dev/shm" + name;
  if (lstat(path.c_str(), &status) != 0) return {};
  return ToInfo(status);
}

void RemoveObject(const std::string& name) noexcept {
  bi::shared_memory_object::remove(name.c_str());
}

SharedObject::SharedObject(std::unique_ptr<Boost> boost, bool writable)
    : boost_(std::move(boost)), writable_(writable) {}
SharedObject::~SharedObject() = default;

int SharedObject::descriptor() const noexcept {
  return boost_->object.get_mapping_handle().handle;
}

std::unique_ptr<SharedObject> SharedObject::Create(const std::string& name, std::uint64_t bytes) {
  auto boost = std::make_unique<Boost>();
  Translated("create " + name, [&] {
    bi::permissions permissions;
    permissions.set_permissions(0640);  // Boost would set 0644, past the umask
    boost->object =
        bi::shared_memory_object(bi::create_only, name.c_str(), bi::read_write, permissions);
  });
  // Not Boost's truncate: it leaves holes, and the first touch of a hole in a full /dev/shm is
  // SIGBUS.
  const int error =
      posix_fallocate(boost->object.get_mapping_handle().handle, 0, static_cast<off_t>(bytes));
  if (error != 0) {
    RemoveObject(name);
    Throw(error, "allocate " + name);
  }
  return std::unique_ptr<SharedObject>(new SharedObject(std::move(boost), true));
}

std::unique_ptr<SharedObject> SharedObject::Open(const std::string& name, bool writable) {
  auto boost = std::make_unique<Boost>();
  Translated("open " + name, [&] {
    boost->object = bi::shared_memory_object(bi::open_only, name.c_str(),
                                             writable ? bi::read_write : bi::read_only);
  });
  return std::unique_ptr<SharedObject>(new SharedObject(std::move(boost), writable));
}

ObjectInfo SharedObject::Info() const noexcept {
  struct stat status {};
  if (fstat(descriptor(), &status) != 0) return {};
  return ToInfo(status);
}

void* SharedObject::Map(std::uint64_t bytes) {
  Translated("map shared memory", [&] {
    boost_->region =
        bi::mapped_region(boost_->object, writable_ ? bi::read_write : bi::read_only, 0, bytes);
  });
  auto* const data = static_cast<volatile unsigned char*>(boost_->region.get_address());
  for (std::uint64_t i = 0; i < bytes; i += kPageBytes) {
    const unsigned char byte = data[i];
    if (writable_) data[i] = byte;
  }
  return boost_->region.get_address();
}

std::string SharedObject::LockPages() noexcept {
  if (mlock(boost_->region.get_address(), boost_->region.get_size()) == 0) return {};
  return std::strerror(errno);
}

bool SharedObject::TakeOwnerLock() noexcept {
  struct flock lock = OwnerByte(F_WRLCK);
  return fcntl(descriptor(), F_OFD_SETLK, &lock) == 0;
}

bool SharedObject::OwnerLocked() const noexcept {
  // Asked as a reader: only a write lock stands in its way, so other observers' locks do not count.
  struct flock lock = OwnerByte(F_RDLCK);
  return fcntl(descriptor(), F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

}  // namespace rikiseki::protocol

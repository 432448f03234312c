// SPDX-License-Identifier: MIT
#include "tests/haptic_server/guard.h"

#include <dlfcn.h>
#include <pthread.h>

#include <cstdlib>
#include <new>

namespace {

thread_local constinit long allocations = 0;
thread_local constinit long locks = 0;

}  // namespace

namespace rikiseki::test {

// Functions, because the compiler knows malloc and believes that it touches no variable.
long Allocations() {
  return allocations;
}
long Locks() {
  return locks;
}

}  // namespace rikiseki::test

extern "C" void* __libc_malloc(std::size_t size);  // NOLINT: glibc's own name

extern "C" void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}

extern "C" int pthread_mutex_lock(pthread_mutex_t* mutex) {
  ++locks;
  using Lock = int (*)(pthread_mutex_t*);
  static const auto real = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
  return real(mutex);
}

void* operator new(std::size_t size) {
  if (void* memory = malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}

// Counts what a real-time tick must not do: this program's operator new, malloc and pthread_mutex_lock
// are stood in for by guard.cpp.
#pragma once

namespace rikiseki::test {

extern thread_local long allocations;  // of this thread, since it began
extern thread_local long locks;

}  // namespace rikiseki::test

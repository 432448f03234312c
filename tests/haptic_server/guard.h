// SPDX-License-Identifier: MIT
// Counts what a real-time tick must not do: this program's operator new, malloc and pthread_mutex_lock
// are stood in for by guard.cpp.
#pragma once

namespace rikiseki::test {

/// Of this thread, since it began.
long Allocations();
long Locks();

}  // namespace rikiseki::test

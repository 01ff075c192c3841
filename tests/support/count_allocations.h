#pragma once

#include <atomic>
#include <cstdlib>
#include <new>

// Counts what is allocated by new. For one source file of a program only: it replaces the program's new.
namespace {
std::atomic<int> allocations{0};
}

// The address sanitizer has its own new, and wants each block back by the one that gave it.
#ifndef __SANITIZE_ADDRESS__
// Not inlined: GCC would see new return what malloc gave and warn of a delete that does not match.
[[gnu::noinline]] void* operator new(size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, size_t) noexcept { std::free(memory); }
#endif

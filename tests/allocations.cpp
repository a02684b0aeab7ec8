// Counts what operator new is asked for, in all of the program, and fails where it is told to.

#include "allocations.hpp"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {
std::atomic<std::size_t> count{0}, pieces{0}, before_failure{kNever};
}

std::size_t allocations() { return count; }
std::size_t memory_in_use() { return pieces; }
void fail_allocation(std::size_t n) { before_failure = n; }

void* operator new(std::size_t size) {
  ++count;
  if (before_failure != kNever && before_failure-- == 0) throw std::bad_alloc();
  void* memory = std::malloc(size);
  if (memory == nullptr) throw std::bad_alloc();
  ++pieces;
  return memory;
}
void operator delete(void* memory) noexcept {
  if (memory != nullptr) --pieces;
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept { operator delete(memory); }

// Counts what operator new is asked for, in all of the program, and fails where it is told to.

#include "allocations.hpp"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {
std::atomic<std::size_t> count{0}, pieces{0}, before_failure{kNever};
std::atomic<bool> fails_for_good{false}, has_failed{false};

[[maybe_unused]] bool is_refused() {
  if (has_failed) return fails_for_good;
  if (before_failure == kNever) return false;
  if (before_failure-- != 0) return false;
  has_failed = true;
  return true;
}

void start(std::size_t n, bool for_good) {
  fails_for_good = for_good;
  has_failed = false;
  before_failure = n;
}
}  // namespace

std::size_t allocations() { return count; }
std::size_t memory_in_use() { return pieces; }
void fail_allocation(std::size_t n) { start(n, false); }
void fail_allocations_from(std::size_t n) { start(n, true); }
bool has_failed_allocation() { return has_failed; }

#ifndef ISM_NO_OWN_NEW
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  ++count;
  void* memory = is_refused() ? nullptr : std::malloc(size);
  if (memory != nullptr) ++pieces;
  return memory;
}
void* operator new(std::size_t size) {
  void* memory = operator new(size, std::nothrow);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
void operator delete(void* memory) noexcept {
  if (memory != nullptr) --pieces;
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept { operator delete(memory); }
#endif

// How often a test program has asked for memory, how much of it is left, and how to be refused.

#pragma once

#include <cstddef>

constexpr std::size_t kNever = static_cast<std::size_t>(-1);

// ThreadSanitizer has an operator new of its own, and room for no other.
#ifdef __has_feature
#if __has_feature(thread_sanitizer)
#define ISM_NO_OWN_NEW
#endif
#endif
#ifdef ISM_NO_OWN_NEW
constexpr bool kCountsAllocations = false;  // all below stays 0, and nothing fails
#else
constexpr bool kCountsAllocations = true;
#endif

std::size_t allocations();
std::size_t memory_in_use();  // in pieces

/// The n-th allocation from now on, counted from 0, fails once.
void fail_allocation(std::size_t n);
/// It and all behind it fail, until fail_allocation(kNever).
void fail_allocations_from(std::size_t n);
/// Has one failed since either of these was called?
bool has_failed_allocation();

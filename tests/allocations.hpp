// How often a test program has asked for memory.

#pragma once

#include <cstddef>

std::size_t allocations();

// The loop of Algorithm 1, what it may be held by, and what it costs on the largest surfaces, one
// program: what compiles the implementation takes longest to compile.

#define ISM_IMPLEMENTATION
#include "ism.hpp"

#include "part_boundary.hpp"
#include "part_constraints.hpp"
#include "part_optimizer.hpp"
#include "part_sizes.hpp"

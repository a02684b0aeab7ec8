// The loop of Algorithm 1 and what it may be held by, one program: what compiles the implementation
// takes longest to compile.

#define ISM_IMPLEMENTATION
#include "ism.hpp"

#include "part_boundary.hpp"
#include "part_constraints.hpp"
#include "part_optimizer.hpp"

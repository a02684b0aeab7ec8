// The parts of the header one by one, in one file so that the implementation is compiled once.

#define ISM_IMPLEMENTATION
#include "ism.hpp"

#include "part_energies.hpp"
#include "part_ldlt.hpp"
#include "part_mesh.hpp"
#include "part_overlay.hpp"
#include "part_predicates.hpp"
#include "part_prepare.hpp"

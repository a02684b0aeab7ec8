#define ISM_IMPLEMENTATION
#include "ism.hpp"

// As windows.h has them.
#define min(a, b) (((a) < (b)) ? (a) : (b))
#define max(a, b) (((a) > (b)) ? (a) : (b))
#define near
#define far
#define small char

#define ISM_IMPLEMENTATION
#include "ism.hpp"

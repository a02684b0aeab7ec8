// Embeddings, landmarks, maps and what maps are used for, one program: what compiles the
// implementation takes longest to compile.

#define ISM_IMPLEMENTATION
#include "ism.hpp"

#include "part_applications.hpp"
#include "part_closed.hpp"
#include "part_coarse.hpp"
#include "part_embedding.hpp"
#include "part_ids.hpp"
#include "part_landmarks.hpp"
#include "part_map.hpp"
#include "part_openings.hpp"
#include "part_starts.hpp"
#include "part_verify.hpp"

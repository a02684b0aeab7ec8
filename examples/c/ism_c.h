// ism_c.h - ism.hpp for C, and for languages that call C; map_hands.c shows how
//
// ARRAYS   The caller owns all arguments; a call reads them and keeps only `progress` and `user`.
//          Handles own the arrays of results. "#V×3" is an array in row-major order. Ids are
//          32-bit, those of the given meshes, from 0. Arrays without elements may be NULL.
// UNITS    Positions are in the unit of their mesh, times in seconds; fractions and coverage are 0
//          to 1; distortion is 2 for an isometry.
// ERRORS   Functions return a status. From ISM_BAD_ARGUMENT on, the call wrote nothing except NULL
//          to a new handle, and ism_last_error() has a sentence. No exception leaves the library.
// THREADS  A run serves one call at a time; others return ISM_BUSY, except ism_run_cancel(). A map
//          serves any number. Free a handle when no thread uses it any more.

#ifndef ISM_C_H
#define ISM_C_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// How a run ended, with the numbers and meanings of ism::Status in ism.hpp, or a call.
typedef int32_t ism_status;
// Up to ISM_UNFINISHED (more to do) there is a map. ISM_NO_MAP_YET: stopped before the first one.
enum { ISM_DONE, ISM_CONVERGED, ISM_ITERATION_LIMIT, ISM_TIME_LIMIT, ISM_CANCELLED };
enum { ISM_STALLED = 5, ISM_UNFINISHED, ISM_NO_MAP_YET, ISM_MEMORY_LIMIT, ISM_INVALID_MESH };
enum { ISM_INVALID_LANDMARKS = 10, ISM_INVALID_OPTIONS, ISM_INVALID_POSITIONS, ISM_INVALID_PINS };
enum { ISM_NO_OVERLAP = 14, ISM_NUMERICAL_FAILURE };
// The call failed, by an exception, if ISM_FAILED. After it or ISM_OUT_OF_MEMORY, free the run.
enum { ISM_BAD_ARGUMENT = 100, ISM_BUSY, ISM_OUT_OF_MEMORY, ISM_FAILED };

enum { ISM_A, ISM_B };                                            // sides
enum { ISM_VERTEX, ISM_FACE, ISM_CORNER };                        // corner k of face f is 3 f + k
enum { ISM_FLOAT, ISM_DOUBLE };                                   // types of positions
enum { ISM_FREE, ISM_FIXED, ISM_SLIDE };                          // boundaries
enum { ISM_SYMMETRIC_DIRICHLET, ISM_ARAP, ISM_SARAP, ISM_ASAP };  // measures

/// A mesh. Triangles are counter-clockwise seen from outside. Strides are bytes from row to row.
typedef struct ism_mesh {
  const void* positions;     // #V×3, float or double
  const int32_t* triangles;  // #F×3, ids in [0, #V)
  int32_t n_vertices, n_triangles, position_stride, triangle_stride;
  int32_t position_type;  // ISM_FLOAT or ISM_DOUBLE
} ism_mesh;

/// Points that should correspond. Barycentric coordinates of a triangle a (b) are at least 0 with
/// sum 1; zeros: a (b) is a vertex. Weight: ≥ 0, usually 8; with 0 it only guides the start.
typedef struct ism_landmark {
  int32_t a, b;
  double weight, barycentric_a[3], barycentric_b[3];
} ism_landmark;

/// Called several times a second in the thread of ism_run_advance(), with the finished fraction and
/// a few words, valid during the call. Return 1, or 0 to cancel. It must not jump out, nor use the
/// run, except by ism_run_cancel().
typedef int32_t (*ism_progress)(void* user, double fraction, const char* what);

/// Options; names, ranges and meaning are those of ism::Options in ism.hpp.
typedef struct ism_options {
  uint32_t size;  // sizeof(ism_options), set by the caller: later versions may have more members
  int32_t measure, boundary, max_iterations, history_length, coarsest, threads, outer_a, outer_b;
  int32_t keep_scale, exact_landmarks, weld, candidates, as_published;  // 0 or 1
  double coverage_weight, tolerance, refine, omega_start, max_seconds;
  const int32_t *pins_a, *pins_b;  // vertices
  int32_t n_pins_a, n_pins_b;
  ism_progress progress;  // may be NULL
  void* user;             // passed to it
} ism_options;

/// A sentence for the user, and the elements that it names.
typedef struct ism_id {
  int32_t side, element, id;
} ism_id;
typedef struct ism_message {
  const char* sentence;
  const ism_id* ids;
  int32_t n_ids;
} ism_message;

/// The state of a run. Distortion and coverage are 0 before there is a map.
typedef struct ism_result {
  ism_message message;
  const ism_message* warnings;
  int32_t n_warnings, n_iterations;  // these on the given meshes
  double fraction, distortion, coverage_a, coverage_b, seconds;
  ism_status status;
} ism_result;

/// The common refinement of A and B: polygons of 3 to 6 corners, with one connectivity and two
/// geometries; on each the map is affine. Distortion is the symmetric Dirichlet energy per area, at
/// least 2, and σ the singular values, of surfaces scaled as in the run.
typedef struct ism_meta {
  int32_t n_vertices, n_polygons, n_corners;
  const double *on_a, *on_b, *plane;  // vertices, #×3 on either surface, #×2 in a common plane
  const int32_t *face_a, *face_b;     // per polygon, the triangles that it lies in
  const int32_t* offsets;             // polygon p has corners offsets[p] to offsets[p + 1] - 1
  const int32_t* corners;             // vertices, counter-clockwise
  const double *corner_a, *corner_b;  // #×3, barycentric coordinates of corners in face_a, face_b
  const double* distortion;  // polygons, #×5: areas on A and B, σ_min, σ_max, distortion
  double mean, median, p95, largest;            // of the distortion, weighted by area
  double sigma_min, sigma_max, area_a, area_b;  // extremes; covered areas
} ism_meta;

/// A sparse matrix by rows (CSR). Value i is the sum of weights[k] times value sources[k], k from
/// offsets[i] to offsets[i + 1] - 1. Weights are ≥ 0 with sum 1; rows not covered have none.
typedef struct ism_transfer {
  int32_t n_rows, n_sources;
  const int32_t *offsets, *sources;
  const double* weights;
} ism_transfer;

typedef struct ism_run ism_run;
typedef struct ism_map ism_map;

/// Returns the name of a status; static.
const char* ism_status_name(ism_status status);
/// Returns the reason of the last call of this thread that failed or made no map; valid until the
/// next one.
const char* ism_last_error(void);
/// Sets all options except `size`, which the caller must set before.
ism_status ism_default_options(ism_options* options);

/// Creates a run; free it by ism_run_free(). Options may be NULL. If the method refuses meshes,
/// landmarks or options, there is a run, and ism_run_result() has the reason.
ism_status ism_run_create(const ism_mesh* a, const ism_mesh* b, const ism_landmark* landmarks,
                          int32_t n_landmarks, const ism_options* options, ism_run** run);
/// Takes `steps` steps, or, if this is 0, steps until `seconds` have passed (≥ 0, or INFINITY), at
/// least one. A step takes milliseconds to tenths of a second for 10,000 vertices. Returns
/// ISM_UNFINISHED if there is more to do, else the final status.
ism_status ism_run_advance(ism_run* run, int32_t steps, double seconds);
/// Describes the run as if it ended here; pointers are valid until its next call. On decimated
/// surfaces, it costs as much as some steps.
ism_status ism_run_result(ism_run* run, ism_result* result);
/// 1: a call in progress ends within milliseconds to tenths of a second, and later ones at once.
/// 0: the run can continue.
ism_status ism_run_cancel(ism_run* run, int32_t is_cancelled);
/// Frees a run; NULL does nothing. ISM_BUSY: a call uses the run, which is not freed.
ism_status ism_run_free(ism_run* run);

/// Creates the current map of a run, independent of it; free it by ism_map_free(). Returns the
/// status of the run; after ISM_UNFINISHED there is no map, and *map is NULL.
ism_status ism_map_create(ism_run* run, ism_map** map);
void ism_map_free(ism_map* map);  // NULL does nothing
/// Maps n points of the side `from` to the other one: vertices `ids`, if `barycentric` is NULL,
/// else points in triangles `ids` (-1: none), n×3, ≥ 0 with sum 1. Each result may be NULL: the
/// triangle of an image or -1, if it is not covered; its barycentric coordinates, n×3, or zeros;
/// its position in space, n×3, or NaN.
ism_status ism_map_images(const ism_map* map, int32_t from, int32_t n, const int32_t* ids,
                          const double* barycentric, int32_t* image_ids, double* image_barycentric,
                          double* image_positions);
/// These two compute at the first call. Their pointers are valid until ism_map_free().
ism_status ism_map_meta(ism_map* map, ism_meta* meta);
/// From elements of the side `from` to elements `target` of the other one, as above.
ism_status ism_map_transfer(ism_map* map, int32_t from, int32_t element, int32_t target,
                            ism_transfer* transfer);

#ifdef __cplusplus
}
#endif

#endif  // ISM_C_H

/* Calls all of ism_c.h with what is wrong, from one thread and from several. Prints a line for each
 * failed check, and ends with exit code 1 if there is one.  attack [memory] */

#define _POSIX_C_SOURCE 200809L

#include "ism_c.h"

#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifndef _WIN32
#include <sys/resource.h>
#endif

static int failures = 0;

#define CHECK(is_met) \
  ((is_met) ? (void)0 : (++failures, (void)printf("line %d: %s\n", __LINE__, #is_met)))

/* The call returns the status, and the sentence contains the words. */
#define REFUSED(status, words, call)                                            \
  do {                                                                          \
    CHECK((call) == (status));                                                  \
    if (!strstr(ism_last_error(), words))                                       \
      ++failures, printf("line %d: it said: %s\n", __LINE__, ism_last_error()); \
  } while (0)
#define BAD(words, call) REFUSED(ISM_BAD_ARGUMENT, words, call)

enum { kSide = 13, kVertices = kSide * kSide, kTriangles = 2 * (kSide - 1) * (kSide - 1) };

static float sheet_positions[kVertices][5]; /* x, y, z and two numbers that are not for us */
static double hill_positions[kVertices][3];
static int32_t grid_triangles[kTriangles][3];
static ism_mesh sheet, hill;

static ism_mesh view(const void* positions, int32_t stride, int32_t type) {
  ism_mesh m;
  m.positions = positions;
  m.triangles = grid_triangles[0];
  m.n_vertices = kVertices;
  m.n_triangles = kTriangles;
  m.position_stride = stride;
  m.triangle_stride = sizeof grid_triangles[0];
  m.position_type = type;
  return m;
}

static void make_meshes(void) {
  int32_t t = 0;
  for (int i = 0; i < kVertices; ++i) {
    const double x = (double)(i % kSide) / (kSide - 1), y = (double)(i / kSide) / (kSide - 1);
    const double z = 0.5 * exp(-9 * ((x - 0.6) * (x - 0.6) + (y - 0.4) * (y - 0.4)));
    sheet_positions[i][0] = (float)x;
    sheet_positions[i][1] = (float)y;
    sheet_positions[i][2] = 0;
    sheet_positions[i][3] = sheet_positions[i][4] = NAN;
    hill_positions[i][0] = x;
    hill_positions[i][1] = y;
    hill_positions[i][2] = z;
  }
  for (int32_t y = 0; y + 1 < kSide; ++y)
    for (int32_t x = 0; x + 1 < kSide; ++x) {
      const int32_t v = y * kSide + x;
      const int32_t corners[6] = {v, v + 1, v + kSide + 1, v, v + kSide + 1, v + kSide};
      memcpy(grid_triangles[t], corners, sizeof corners);
      t += 2;
    }
  sheet = view(sheet_positions, sizeof sheet_positions[0], ISM_FLOAT);
  hill = view(hill_positions, sizeof hill_positions[0], ISM_DOUBLE);
}

static ism_options defaults(void) {
  ism_options options;
  options.size = sizeof options;
  CHECK(ism_default_options(&options) == ISM_DONE);
  return options;
}

static ism_run* new_run(const ism_options* options) {
  ism_run* run = NULL;
  CHECK(ism_run_create(&sheet, &hill, NULL, 0, options, &run) == ISM_DONE && run);
  return run;
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* ---- Arguments ---- */

/* Refused before there is a run. */
static void refuse_mesh(const char* words, ism_mesh mesh) {
  ism_run* run = (ism_run*)&mesh;
  BAD(words, ism_run_create(&mesh, &hill, NULL, 0, NULL, &run));
  CHECK(!run);
  BAD(words, ism_run_create(&hill, &mesh, NULL, 0, NULL, &run));
}

static void attack_meshes(void) {
  ism_run* run;
  ism_mesh m = sheet;
  BAD("mesh: NULL", ism_run_create(NULL, &hill, NULL, 0, NULL, &run));
  BAD("mesh: NULL", ism_run_create(&sheet, NULL, NULL, 0, NULL, &run));
  BAD("run: NULL", ism_run_create(&sheet, &hill, NULL, 0, NULL, NULL));
  m.positions = NULL, refuse_mesh("positions", m), m = sheet;
  m.triangles = NULL, refuse_mesh("triangles", m), m = sheet;
  m.n_vertices = -1, refuse_mesh("positions", m), m = sheet;
  m.n_triangles = INT32_MIN, refuse_mesh("triangles", m), m = sheet;
  m.position_stride = 11, refuse_mesh("stride", m), m = sheet;
  m.position_stride = -24, refuse_mesh("stride", m), m = sheet;
  m.triangle_stride = 0, refuse_mesh("stride", m), m = sheet;
  m.position_type = 2, refuse_mesh("position_type", m), m = hill;
  m.position_stride = 23, refuse_mesh("stride", m);
}

/* Refused by the method: there is a run, and it has the reason and the id. */
static void refuse_run(ism_status status, int32_t id, const ism_mesh* a, const ism_landmark* l,
                       const ism_options* options) {
  ism_run* run = NULL;
  ism_map* map = (ism_map*)&run;
  ism_result result;
  CHECK(ism_run_create(a, &hill, l, l ? 1 : 0, options, &run) == ISM_DONE);
  CHECK(ism_run_advance(run, 0, INFINITY) == status);
  CHECK(ism_run_result(run, &result) == ISM_DONE && result.status == status);
  CHECK(strlen(result.message.sentence) > 10);
  CHECK(id < 0 || (result.message.n_ids > 0 && result.message.ids[0].id == id));
  CHECK(ism_map_create(run, &map) == status && !map);
  CHECK(!strcmp(ism_last_error(), result.message.sentence));
  CHECK(ism_run_free(run) == ISM_DONE);
}

static void attack_contents(void) {
  ism_mesh m = sheet;
  const int32_t bad_ids[] = {-1, kVertices, INT32_MAX, INT32_MIN};
  const float bad_numbers[] = {NAN, INFINITY, -INFINITY};
  for (int i = 0; i < 4; ++i) {
    grid_triangles[7][1] = bad_ids[i];
    refuse_run(ISM_INVALID_MESH, 7, &sheet, NULL, NULL);
  }
  grid_triangles[7][1] = grid_triangles[6][2];
  for (int i = 0; i < 3; ++i) {
    sheet_positions[5][2] = bad_numbers[i];
    refuse_run(ISM_INVALID_MESH, 5, &sheet, NULL, NULL);
  }
  make_meshes();
  m.n_vertices = 0, refuse_run(ISM_INVALID_MESH, -1, &m, NULL, NULL), m = sheet;
  m.n_triangles = 0, refuse_run(ISM_INVALID_MESH, -1, &m, NULL, NULL), m = sheet;
  m.n_vertices = INT32_MAX, refuse_run(ISM_INVALID_MESH, -1, &m, NULL, NULL);
}

static void attack_landmarks(void) {
  const ism_landmark good = {3, 3, 8, {0, 0, 0}, {0, 0, 0}};
  ism_landmark l = good;
  ism_run* run = NULL;
  BAD("landmarks", ism_run_create(&sheet, &hill, NULL, 1, NULL, &run));
  BAD("landmarks", ism_run_create(&sheet, &hill, &l, -1, NULL, &run));
  l.a = -1, refuse_run(ISM_INVALID_LANDMARKS, -1, &sheet, &l, NULL), l = good;
  l.b = kVertices, refuse_run(ISM_INVALID_LANDMARKS, -1, &sheet, &l, NULL), l = good;
  l.weight = NAN, refuse_run(ISM_INVALID_LANDMARKS, l.a, &sheet, &l, NULL);
  l.weight = -1, refuse_run(ISM_INVALID_LANDMARKS, l.a, &sheet, &l, NULL), l = good;
  l.barycentric_a[1] = NAN, refuse_run(ISM_INVALID_LANDMARKS, -1, &sheet, &l, NULL), l = good;
  l.barycentric_b[0] = 2, refuse_run(ISM_INVALID_LANDMARKS, -1, &sheet, &l, NULL), l = good;
  l.barycentric_b[0] = 1, l.b = kTriangles;
  refuse_run(ISM_INVALID_LANDMARKS, -1, &sheet, &l, NULL);
}

static void refuse_options(const char* words, ism_options options) {
  ism_run* run = NULL;
  BAD(words, ism_run_create(&sheet, &hill, NULL, 0, &options, &run));
  CHECK(!run);
}

static void attack_options(void) {
  ism_options o = defaults();
  const int32_t pin = kVertices;
  const uint32_t sizes[] = {0, 4, sizeof o - 8, sizeof o + 8, UINT32_MAX};
  for (int i = 0; i < 5; ++i) {
    o.size = sizes[i], o.user = &o;
    BAD("size", ism_default_options(&o));
    CHECK(o.size == sizes[i] && o.user == &o);
    refuse_options("size", o);
  }
  BAD("options: NULL", ism_default_options(NULL));
  o = defaults(), o.measure = 4, refuse_options("measure is 4, not 0 to 3", o);
  o = defaults(), o.boundary = -1, refuse_options("boundary is -1", o);
  o = defaults(), o.n_pins_a = 1, refuse_options("pins_a", o);
  o = defaults(), o.n_pins_b = -1, refuse_options("pins_b", o);
  o = defaults(), o.n_pins_a = 1, o.pins_a = &pin;
  refuse_run(ISM_INVALID_PINS, pin, &sheet, NULL, &o);
  o = defaults(), o.tolerance = NAN, refuse_run(ISM_INVALID_OPTIONS, -1, &sheet, NULL, &o);
  o = defaults(), o.max_seconds = -1, refuse_run(ISM_INVALID_OPTIONS, -1, &sheet, NULL, &o);
  o = defaults(), o.threads = -1, refuse_run(ISM_INVALID_OPTIONS, -1, &sheet, NULL, &o);
  o = defaults(), o.max_iterations = -1, refuse_run(ISM_INVALID_OPTIONS, -1, &sheet, NULL, &o);
  o = defaults(), o.outer_a = 1 << 30;
  refuse_run(ISM_INVALID_OPTIONS, -1, &sheet, NULL, &o);
}

static void attack_calls(void) {
  ism_run* run = new_run(NULL);
  ism_map* map = (ism_map*)&run;
  ism_result result;
  BAD("run: NULL", ism_run_advance(NULL, 1, 0));
  BAD("run: NULL", ism_run_result(NULL, &result));
  BAD("run: NULL", ism_run_cancel(NULL, 1));
  BAD("run: NULL", ism_map_create(NULL, &map));
  CHECK(!map && ism_run_free(NULL) == ISM_DONE);
  ism_map_free(NULL);
  BAD("steps", ism_run_advance(run, -1, 0));
  BAD("steps", ism_run_advance(run, 0, NAN));
  BAD("steps", ism_run_advance(run, 0, -1));
  BAD("result: NULL", ism_run_result(run, NULL));
  BAD("map: NULL", ism_map_create(run, NULL));
  REFUSED(ISM_NO_MAP_YET, "embedding has not come", ism_map_create(run, &map));
  CHECK(!map);
  CHECK(ism_run_advance(run, 1, 0) == ISM_UNFINISHED);
  CHECK(ism_run_free(run) == ISM_DONE);
  CHECK(!strcmp(ism_status_name(ISM_CONVERGED), "converged"));
  CHECK(ism_status_name(-1) && ism_status_name(16) && ism_status_name(INT32_MAX));
}

static void attack_map(ism_map* map) {
  int32_t ids[2] = {kTriangles / 2, 0}, faces[2] = {77, 77};
  double p[6] = {0.2, 0.3, 0.5, 0.5, 0.5, 0}, q[6], x[6];
  ism_meta meta;
  ism_transfer t;
  BAD("map: NULL", ism_map_images(NULL, ISM_A, 1, ids, NULL, faces, q, x));
  BAD("from is 2", ism_map_images(map, 2, 1, ids, NULL, faces, q, x));
  BAD("points", ism_map_images(map, ISM_A, -1, ids, NULL, faces, q, x));
  BAD("points", ism_map_images(map, ISM_A, 1, NULL, NULL, faces, q, x));
  ids[1] = kVertices;
  BAD("a vertex is 169, not 0 to 168", ism_map_images(map, ISM_A, 2, ids, NULL, faces, q, x));
  ids[1] = -1;
  BAD("a vertex is -1", ism_map_images(map, ISM_B, 2, ids, NULL, faces, q, x));
  CHECK(ism_map_images(map, ISM_B, 2, ids, p, faces, q, x) == ISM_DONE && faces[1] == -1);
  CHECK(q[3] == 0 && isnan(x[3]) && faces[0] >= 0 && isfinite(x[0]));
  ids[1] = -2, faces[0] = 77;
  BAD("a triangle is -2", ism_map_images(map, ISM_B, 2, ids, p, faces, q, x));
  ids[1] = kTriangles;
  BAD("a triangle is 288", ism_map_images(map, ISM_B, 2, ids, p, faces, q, x));
  ids[1] = 1, p[4] = NAN;
  BAD("barycentric", ism_map_images(map, ISM_A, 2, ids, p, faces, q, x));
  p[4] = 1;
  BAD("barycentric", ism_map_images(map, ISM_A, 2, ids, p, faces, q, x));
  CHECK(faces[0] == 77);
  CHECK(ism_map_images(map, ISM_A, 2, ids, NULL, NULL, NULL, NULL) == ISM_DONE);
  CHECK(ism_map_images(map, ISM_A, 0, NULL, NULL, NULL, NULL, NULL) == ISM_DONE);
  BAD("NULL", ism_map_meta(map, NULL));
  BAD("NULL", ism_map_meta(NULL, &meta));
  BAD("NULL", ism_map_transfer(map, ISM_A, ISM_VERTEX, ISM_VERTEX, NULL));
  BAD("NULL", ism_map_transfer(NULL, ISM_A, ISM_VERTEX, ISM_VERTEX, &t));
  BAD("from is -1", ism_map_transfer(map, -1, ISM_VERTEX, ISM_VERTEX, &t));
  BAD("an element is 3", ism_map_transfer(map, ISM_A, 3, ISM_VERTEX, &t));
  BAD("an element is -1", ism_map_transfer(map, ISM_A, ISM_FACE, -1, &t));
}

/* ---- Results ---- */

static void check_map(ism_map* map) {
  ism_meta m;
  ism_transfer t;
  double area = 0;
  CHECK(ism_map_meta(map, &m) == ISM_DONE && m.n_polygons >= kTriangles);
  for (int32_t p = 0; p < m.n_polygons; ++p) {
    area += m.distortion[5 * p];
    CHECK(m.offsets[p + 1] - m.offsets[p] >= 3 && m.offsets[p + 1] - m.offsets[p] <= 6);
    CHECK(m.face_a[p] >= 0 && m.face_a[p] < kTriangles && m.distortion[5 * p + 4] >= 2 - 1e-9);
  }
  CHECK(m.offsets[m.n_polygons] == m.n_corners && fabs(area - m.area_a) < 1e-9);
  CHECK(m.mean >= 2 && m.median <= m.p95 && m.p95 <= m.largest);
  CHECK(ism_map_transfer(map, ISM_B, ISM_FACE, ISM_CORNER, &t) == ISM_DONE);
  CHECK(t.n_rows == 3 * kTriangles && t.n_sources == kTriangles);
  for (int32_t i = 0; i < t.n_rows; ++i) {
    double sum = 0;
    for (int32_t k = t.offsets[i]; k < t.offsets[i + 1]; ++k) sum += t.weights[k];
    CHECK(t.offsets[i] == t.offsets[i + 1] || fabs(sum - 1) < 1e-9);
  }
}

/* The same numbers as floats among others and as doubles in a row make the same map. */
static void map_strided(void) {
  static double dense[kVertices][3];
  ism_result results[2];
  for (int i = 0; i < kVertices; ++i)
    for (int k = 0; k < 3; ++k) dense[i][k] = sheet_positions[i][k];
  const ism_mesh meshes[2] = {sheet, view(dense, sizeof dense[0], ISM_DOUBLE)};
  for (int i = 0; i < 2; ++i) {
    ism_run* run = NULL;
    ism_map* map = NULL;
    CHECK(ism_run_create(&meshes[i], &hill, NULL, 0, NULL, &run) == ISM_DONE);
    CHECK(ism_run_advance(run, 0, INFINITY) == ISM_CONVERGED);
    CHECK(ism_run_result(run, &results[i]) == ISM_DONE && results[i].fraction == 1);
    CHECK(ism_map_create(run, &map) == ISM_CONVERGED);
    CHECK(ism_run_free(run) == ISM_DONE); /* the map does not need it */
    if (!map) continue;
    check_map(map);
    attack_map(map);
    ism_map_free(map);
  }
  CHECK(results[0].distortion == results[1].distortion && results[0].distortion > 2);
}

static void limits(void) {
  ism_options o = defaults();
  ism_run* run;
  o.max_iterations = 1;
  run = new_run(&o);
  CHECK(ism_run_advance(run, INT32_MAX, 0) == ISM_ITERATION_LIMIT);
  CHECK(ism_run_free(run) == ISM_DONE);
  o.max_seconds = 1e-6;
  run = new_run(&o);
  CHECK(ism_run_advance(run, 0, INFINITY) == ISM_NO_MAP_YET);
  CHECK(ism_run_free(run) == ISM_DONE);
}

/* ---- Callbacks and threads ---- */

static ism_run* called = NULL;

static int32_t call_back(void* user, double fraction, const char* what) {
  ism_result result;
  ism_map* map;
  CHECK(fraction >= 0 && fraction <= 1 && what);
  REFUSED(ISM_BUSY, "another call", ism_run_advance(called, 1, 0));
  REFUSED(ISM_BUSY, "another call", ism_run_result(called, &result));
  REFUSED(ISM_BUSY, "another call", ism_map_create(called, &map));
  REFUSED(ISM_BUSY, "another call", ism_run_free(called));
  return --*(int*)user > 0;
}

static void use_in_callback(void) {
  int left = 3;
  ism_options o = defaults();
  o.progress = call_back, o.user = &left;
  called = new_run(&o);
  const ism_status status = ism_run_advance(called, 0, INFINITY);
  CHECK(status == ISM_CANCELLED || status == ISM_NO_MAP_YET);
  CHECK(left == 0);
  CHECK(ism_run_free(called) == ISM_DONE);
}

typedef struct {
  ism_run* run;
  int n_busy, n_served;
} user;

static void* advance_often(void* data) {
  user* u = data;
  for (int i = 0; i < 400; ++i) {
    const ism_status status = ism_run_advance(u->run, 1, 0);
    if (status == ISM_BUSY)
      ++u->n_busy;
    else
      ++u->n_served;
  }
  return NULL;
}

static void* advance_to_end(void* data) {
  *(ism_status*)((void**)data)[1] = ism_run_advance(((void**)data)[0], 0, INFINITY);
  return NULL;
}

static void share_run(void) {
  pthread_t threads[2];
  user users[2] = {{NULL, 0, 0}, {NULL, 0, 0}};
  users[0].run = users[1].run = new_run(NULL);
  for (int i = 0; i < 2; ++i) pthread_create(&threads[i], NULL, advance_often, &users[i]);
  for (int i = 0; i < 2; ++i) pthread_join(threads[i], NULL);
  CHECK(users[0].n_busy + users[1].n_busy > 0);
  CHECK(users[0].n_served + users[1].n_served > 0);
  CHECK(ism_run_free(users[0].run) == ISM_DONE);
}

/* Cancelled while another thread advances; then it goes on to the map of an undisturbed run. */
static void cancel_run(void) {
  ism_options o = defaults();
  ism_result result;
  ism_status status = -1;
  pthread_t thread;
  o.tolerance = 0, o.max_iterations = 100000; /* too long to end by itself */
  ism_run* run = new_run(&o);
  void* data[2] = {run, &status};
  const struct timespec pause = {0, 200 * 1000 * 1000};
  pthread_create(&thread, NULL, advance_to_end, data);
  nanosleep(&pause, NULL);
  REFUSED(ISM_BUSY, "another call", ism_run_result(run, &result));
  const double start = now();
  CHECK(ism_run_cancel(run, 1) == ISM_DONE);
  pthread_join(thread, NULL);
  printf("cancelled after %.1f ms\n", 1e3 * (now() - start));
  CHECK(status == ISM_CANCELLED || status == ISM_NO_MAP_YET);
  CHECK(ism_run_advance(run, 100, 0) == status); /* it stays cancelled */
  CHECK(ism_run_result(run, &result) == ISM_DONE && result.status == status);
  CHECK(ism_run_cancel(run, 0) == ISM_DONE);
  CHECK(ism_run_advance(run, 1, 0) == ISM_UNFINISHED);
  CHECK(ism_run_free(run) == ISM_DONE);
}

static void* use_map(void* map) {
  check_map(map);
  attack_map(map);
  return NULL;
}

static void share_map(void) {
  pthread_t threads[4];
  ism_options o = defaults();
  ism_map* map = NULL;
  o.max_iterations = 1;
  ism_run* run = new_run(&o);
  ism_run_advance(run, 0, INFINITY);
  CHECK(ism_map_create(run, &map) == ISM_ITERATION_LIMIT);
  for (int i = 0; i < 4; ++i) pthread_create(&threads[i], NULL, use_map, map);
  for (int i = 0; i < 4; ++i) pthread_join(threads[i], NULL);
  ism_map_free(map);
  CHECK(ism_run_free(run) == ISM_DONE);
}

/* ---- Memory ---- */

#ifndef _WIN32
/* Little more memory than there is now: each call has a status, and all is freed. */
static int lack_memory(void) {
  int n_short = 0;
  ism_options o = defaults();
  o.threads = 1;
  ism_status status = ISM_OUT_OF_MEMORY;
  for (rlim_t room = 0; room < 100 && status == ISM_OUT_OF_MEMORY; ++room) {
    struct rlimit limit;
    ism_run* run = NULL;
    ism_map* map = NULL;
    FILE* file = fopen("/proc/self/statm", "r");
    unsigned long pages = 0;
    if (!file || fscanf(file, "%lu", &pages) != 1) return puts("memory: not tried"), 0;
    fclose(file);
    getrlimit(RLIMIT_AS, &limit);
    limit.rlim_cur = (pages + 64 * room) * 4096;
    setrlimit(RLIMIT_AS, &limit);
    status = ism_run_create(&sheet, &hill, NULL, 0, &o, &run);
    if (status == ISM_DONE) status = ism_run_advance(run, 0, INFINITY);
    if (status == ISM_CONVERGED) status = ism_map_create(run, &map);
    limit.rlim_cur = limit.rlim_max;
    setrlimit(RLIMIT_AS, &limit);
    CHECK(status == ISM_OUT_OF_MEMORY || status == ISM_CONVERGED);
    if (status == ISM_OUT_OF_MEMORY) {
      ++n_short;
      CHECK(!strcmp(ism_last_error(), "out of memory"));
      if (run) REFUSED(ISM_FAILED, "free the run", ism_run_advance(run, 1, 0));
    }
    ism_map_free(map);
    CHECK(ism_run_free(run) == ISM_DONE);
  }
  printf("memory was short %d times\n", n_short);
  return n_short;
}
#endif

int main(int argc, char** argv) {
  make_meshes();
#ifndef _WIN32
  if (argc > 1 && !strcmp(argv[1], "memory")) {
    lack_memory();
    return failures > 0;
  }
#endif
  (void)argc, (void)argv;
  attack_meshes();
  attack_contents();
  attack_landmarks();
  attack_options();
  attack_calls();
  map_strided();
  limits();
  use_in_callback();
  share_run();
  cancel_run();
  share_map();
  printf("%d failures\n", failures);
  return failures > 0;
}

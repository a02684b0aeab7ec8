/* Maps one mesh onto another:  map_hands A.obj B.obj landmarks.txt */

#include "ism_c.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct {
  double* positions;
  int32_t* triangles;
  int32_t n_vertices, n_triangles;
} mesh;

/* Makes room for one more row of three in an array that has doubled each time it was full. */
static void* grown(void* rows, int32_t n, size_t row) {
  if (n & (n - 1)) return rows;
  rows = realloc(rows, (n ? 2 * (size_t)n : 1) * row);
  if (!rows) abort();
  return rows;
}

/* Reads vertices and triangles of an OBJ file; of a corner 1/2/3, the vertex. */
static int read_obj(const char* path, mesh* m) {
  char line[256];
  FILE* file = fopen(path, "r");
  if (!file) return fprintf(stderr, "%s: cannot be read\n", path), 0;
  while (fgets(line, sizeof line, file)) {
    double x[3];
    int f[3];
    if (sscanf(line, "v %lf %lf %lf", &x[0], &x[1], &x[2]) == 3) {
      m->positions = grown(m->positions, m->n_vertices, sizeof x);
      for (int k = 0; k < 3; ++k) m->positions[3 * m->n_vertices + k] = x[k];
      ++m->n_vertices;
    } else if (sscanf(line, "f %d%*[/0-9] %d%*[/0-9] %d", &f[0], &f[1], &f[2]) == 3 ||
               sscanf(line, "f %d %d %d", &f[0], &f[1], &f[2]) == 3) {
      m->triangles = grown(m->triangles, m->n_triangles, sizeof f);
      for (int k = 0; k < 3; ++k) m->triangles[3 * m->n_triangles + k] = f[k] - 1;
      ++m->n_triangles;
    }
  }
  fclose(file);
  return 1;
}

/* Reads lines of a vertex of A and a vertex of B; others, e.g. comments, are skipped. */
static ism_landmark* read_landmarks(const char* path, int32_t* n) {
  char line[256];
  ism_landmark* landmarks = NULL;
  FILE* file = fopen(path, "r");
  *n = 0;
  if (!file) return NULL;
  while (fgets(line, sizeof line, file)) {
    ism_landmark l = {0, 0, 8, {0, 0, 0}, {0, 0, 0}};
    if (sscanf(line, "%d %d", &l.a, &l.b) != 2) continue;
    landmarks = grown(landmarks, *n, sizeof l);
    landmarks[(*n)++] = l;
  }
  fclose(file);
  return landmarks;
}

static ism_mesh view(const mesh* m) {
  ism_mesh v;
  v.positions = m->positions;
  v.triangles = m->triangles;
  v.n_vertices = m->n_vertices;
  v.n_triangles = m->n_triangles;
  v.position_stride = sizeof(double[3]);
  v.triangle_stride = sizeof(int32_t[3]);
  v.position_type = ISM_DOUBLE;
  return v;
}

static int32_t show(void* user, double fraction, const char* what) {
  (void)user;
  fprintf(stderr, "\r%3.0f%%  %-40s", 100 * fraction, what);
  return 1;
}

/* Prints where a vertex of A goes; returns 0 if that is nowhere. */
static int print_image(const ism_map* map, int32_t vertex) {
  int32_t triangle;
  double p[3];
  if (ism_map_images(map, ISM_A, 1, &vertex, NULL, &triangle, NULL, p) != ISM_DONE) return 0;
  if (triangle < 0) return 0;
  printf("vertex %d of A goes to %g %g %g in triangle %d of B\n", vertex, p[0], p[1], p[2],
         triangle);
  return 1;
}

static void print_map(ism_run* run, ism_map* map, const mesh* a, const ism_landmark* landmarks,
                      int32_t n_landmarks) {
  ism_result result;
  ism_meta meta;
  ism_transfer transfer;
  int32_t v = 0;
  ism_run_result(run, &result);
  for (int32_t i = 0; i < result.n_warnings; ++i)
    printf("warning: %s\n", result.warnings[i].sentence);
  printf("distortion: %g (2 is an isometry)\n", result.distortion);
  printf("coverage:   %g of A, %g of B\n", result.coverage_a, result.coverage_b);
  while (v < a->n_vertices && !print_image(map, v)) ++v;
  for (int32_t i = 0; i < n_landmarks; ++i) print_image(map, landmarks[i].a);
  if (ism_map_meta(map, &meta) == ISM_DONE)
    printf("meta mesh: %d polygons, distortion %g in the median, %g at most\n", meta.n_polygons,
           meta.median, meta.largest);
  if (ism_map_transfer(map, ISM_A, ISM_VERTEX, ISM_VERTEX, &transfer) == ISM_DONE)
    printf("transfer: %d rows, %d weights\n", transfer.n_rows, transfer.offsets[transfer.n_rows]);
}

int main(int argc, char** argv) {
  mesh a = {NULL, NULL, 0, 0}, b = {NULL, NULL, 0, 0};
  if (argc != 4) return fprintf(stderr, "usage: map_hands A.obj B.obj landmarks.txt\n"), 1;
  if (!read_obj(argv[1], &a) || !read_obj(argv[2], &b)) return 1;
  int32_t n_landmarks;
  ism_landmark* landmarks = read_landmarks(argv[3], &n_landmarks);

  ism_options options;
  options.size = sizeof options;
  ism_run* run = NULL;
  ism_map* map = NULL;
  const ism_mesh view_a = view(&a), view_b = view(&b);
  if (ism_default_options(&options) == ISM_DONE) options.progress = show;
  if (ism_run_create(&view_a, &view_b, landmarks, n_landmarks, &options, &run) == ISM_DONE) {
    ism_run_advance(run, 0, INFINITY);
    fputc('\n', stderr);
    ism_map_create(run, &map);
  }
  if (map)
    print_map(run, map, &a, landmarks, n_landmarks);
  else
    fprintf(stderr, "%s\n", ism_last_error());
  const int code = map ? 0 : 1;
  ism_map_free(map);
  ism_run_free(run);
  free(landmarks);
  free(a.positions), free(a.triangles), free(b.positions), free(b.triangles);
  return code;
}

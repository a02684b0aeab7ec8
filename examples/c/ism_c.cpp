// The C interface, see ism_c.h: checks arguments, converts them, and lets no exception out.

#include "ism_c.h"
#include "ism.hpp"

#include <cstdio>
#include <map>
#include <mutex>
#include <new>

static_assert(int{ISM_NUMERICAL_FAILURE} == int(ism::Status::kNumericalFailure) &&
                  sizeof(ism::ElementId) == sizeof(ism_id) &&
                  sizeof(ism::PolygonDistortion) == 5 * sizeof(double),
              "C reads these as they are");

struct ism_run {
  std::atomic<bool> stop{false}, is_busy{false};
  bool has_failed = false;  // an exception ended a call, and the solver can only be destroyed
  std::unique_ptr<ism::Solver> solver;
  std::vector<ism_message> warnings;  // of the last ism_run_result()
};

struct ism_map {
  ism::SurfaceMap map;
  std::mutex mutex;  // of the rest, which the first call for it computes
  ism::MetaMesh meta;
  std::vector<ism::PolygonDistortion> polygons;
  std::map<std::array<int, 3>, ism::Transfer> transfers;
};

namespace {

// ---- Errors and arguments ----

constexpr ism_status kDone = ISM_DONE;
constexpr const char* kBusy = "another call uses this run";

/// Ends a call; guarded() turns it into a status.
struct Refusal {
  ism_status status;
  std::string sentence;
};

/// Of a fixed size: to report a lack of memory takes none.
thread_local char last_error[512] = "";

ism_status fail(ism_status status, const char* sentence) {
  std::snprintf(last_error, sizeof last_error, "%s", sentence);
  return status;
}

template <class Call>
ism_status guarded(const Call& call) {
  try {
    return call();
  } catch (const Refusal& refusal) {
    return fail(refusal.status, refusal.sentence.c_str());
  } catch (const std::bad_alloc&) {
    return fail(ISM_OUT_OF_MEMORY, "out of memory");
  } catch (...) {
    return fail(ISM_FAILED, "an exception, of a callback or of the system");
  }
}

void need(bool is_met, const std::string& sentence) {
  if (!is_met) throw Refusal{ISM_BAD_ARGUMENT, sentence};
}

void need_array(const void* data, int n, const char* name) {
  need(n >= 0 && (n == 0 || data != nullptr), name + std::string(": NULL, or a negative number"));
}

void need_in_range(int id, std::ptrdiff_t n, const char* name) {
  if (id < 0 || id >= n)
    need(false, name + (" is " + std::to_string(id)) + ", not 0 to " + std::to_string(n - 1));
}

/// A call that uses a run, which an exception ends.
template <class Call>
ism_status guarded(ism_run* run, const Call& call) {
  if (run == nullptr) return fail(ISM_BAD_ARGUMENT, "run: NULL");
  if (run->is_busy.exchange(true)) return fail(ISM_BUSY, kBusy);
  const ism_status status =
      run->has_failed ? fail(ISM_FAILED, "an earlier call failed, free the run") : guarded(call);
  run->has_failed = status == ISM_OUT_OF_MEMORY || status == ISM_FAILED;
  run->is_busy = false;
  return status;
}

// ---- Conversions ----

ism::MeshView view_of(const ism_mesh* m) {
  need(m != nullptr, "mesh: NULL");
  need_array(m->positions, m->n_vertices, "positions");
  need_array(m->triangles, m->n_triangles, "triangles");
  need_in_range(m->position_type, 2, "position_type");
  const bool is_float = m->position_type == ISM_FLOAT;
  const int least = is_float ? 12 : 24;
  need(m->position_stride >= least && m->triangle_stride >= 12, "a stride is less than a row");
  ism::MeshView view;
  view.triangles = {m->triangles, m->n_triangles, m->triangle_stride};
  if (is_float)
    view.positions = {static_cast<const float*>(m->positions), m->n_vertices, m->position_stride};
  else
    view.positions = {static_cast<const double*>(m->positions), m->n_vertices, m->position_stride};
  return view;
}

ism::LandmarkPoint end_of(int id, const double (&barycentric)[3]) {
  const Eigen::Vector3d p(barycentric);
  return p.isZero(0) ? ism::LandmarkPoint(id) : ism::LandmarkPoint(ism::SurfacePoint{id, p});
}

std::vector<ism::Landmark> landmarks_of(const ism_landmark* items, int n) {
  need_array(items, n, "landmarks");
  std::vector<ism::Landmark> landmarks;
  for (const ism_landmark* l = items; l != items + n; ++l)
    landmarks.push_back(
        {end_of(l->a, l->barycentric_a), end_of(l->b, l->barycentric_b), l->weight});
  return landmarks;
}

void need_size(const ism_options* o) {
  need(o != nullptr && o->size == sizeof *o,
       "options: NULL, or its size is not sizeof(ism_options) of this version");
}

/// Copies what both kinds of options have, either way.
template <class From, class To>
void copy_numbers(const From& from, To& to) {
  to.max_iterations = from.max_iterations, to.history_length = from.history_length;
  to.coarsest = from.coarsest, to.threads = from.threads;
  to.outer_a = from.outer_a, to.outer_b = from.outer_b;
  to.keep_scale = from.keep_scale != 0, to.exact_landmarks = from.exact_landmarks != 0;
  to.weld = from.weld != 0, to.candidates = from.candidates != 0;
  to.as_published = from.as_published != 0, to.max_seconds = from.max_seconds;
  to.coverage_weight = from.coverage_weight, to.tolerance = from.tolerance;
  to.refine = from.refine, to.omega_start = from.omega_start;
}

ism::Options options_of(const ism_options* o) {
  ism::Options options;
  if (o == nullptr) return options;
  need_size(o);
  copy_numbers(*o, options);
  need_in_range(o->measure, 4, "measure");
  need_in_range(o->boundary, 3, "boundary");
  constexpr ism::DistortionMeasure (*measures[])() = {ism::symmetric_dirichlet, ism::arap,
                                                      ism::sarap, ism::asap};
  options.measure = measures[o->measure]();
  options.boundary = static_cast<ism::Boundary>(o->boundary);
  need_array(o->pins_a, o->n_pins_a, "pins_a");
  need_array(o->pins_b, o->n_pins_b, "pins_b");
  options.pins_a.assign(o->pins_a, o->pins_a + o->n_pins_a);
  options.pins_b.assign(o->pins_b, o->pins_b + o->n_pins_b);
  if (o->progress != nullptr)
    options.progress = [tell = o->progress, user = o->user](const ism::Progress& p) {
      return tell(user, p.fraction, p.what.c_str()) != 0;
    };
  return options;
}

template <class Told>  // ism::Outcome or ism::Warning
ism_message message_of(const Told& told) {
  return {told.message.c_str(), reinterpret_cast<const ism_id*>(told.ids.data()),
          int(told.ids.size())};
}

/// A point to map: a vertex, if there are no barycentric coordinates.
ism::SurfacePoint image(const ism::SurfaceMap& map, bool is_forward, int id, const double* p) {
  if (p == nullptr) return is_forward ? map.forward_vertex(id) : map.backward_vertex(id);
  const ism::SurfacePoint point{id, Eigen::Vector3d(p)};
  return is_forward ? map.forward(point) : map.backward(point);
}

void need_point(const ism::TriangleMesh& mesh, int id, const double* p) {
  if (p == nullptr) return need_in_range(id, mesh.vertices.rows(), "a vertex");
  if (id != -1) need_in_range(id, mesh.triangles.rows(), "a triangle");
  const bool is_inside = p[0] >= 0 && p[1] >= 0 && p[2] >= 0;
  if (id != -1 && (!is_inside || !(std::abs(p[0] + p[1] + p[2] - 1) < 1e-6)))
    need(false, "barycentric coordinates are not at least 0 with sum 1");
}

/// Computes the meta mesh, if it is missing, for a caller that has locked the mutex.
const ism::MetaMesh& meta_of(ism_map& map) {
  if (map.meta.n_polygons() == 0) map.meta = map.map.meta_mesh();
  return map.meta;
}

}  // namespace

const char* ism_status_name(ism_status status) {
  if (status < 0 || status > ISM_NUMERICAL_FAILURE) return "failed call";
  return ism::to_string(static_cast<ism::Status>(status));
}

const char* ism_last_error(void) { return last_error; }

ism_status ism_default_options(ism_options* options) {
  return guarded([&] {
    need_size(options);
    *options = {};
    options->size = sizeof *options;
    copy_numbers(ism::Options(), *options);
    return kDone;
  });
}

ism_status ism_run_create(const ism_mesh* a, const ism_mesh* b, const ism_landmark* landmarks,
                          int n_landmarks, const ism_options* options, ism_run** run) {
  return guarded([&] {
    need(run != nullptr, "run: NULL");
    *run = nullptr;
    auto made = std::make_unique<ism_run>();
    ism::Options o = options_of(options);
    o.stop = &made->stop;
    made->solver = std::make_unique<ism::Solver>(view_of(a), view_of(b),
                                                 landmarks_of(landmarks, n_landmarks), o);
    *run = made.release();
    return kDone;
  });
}

ism_status ism_run_advance(ism_run* run, int steps, double seconds) {
  return guarded(run, [&] {
    need(steps >= 0 && seconds >= 0, "steps or seconds are negative or not a number");
    bool has_more = steps > 0 || run->solver->advance(seconds);
    for (; has_more && steps > 0; --steps) has_more = run->solver->step();
    return has_more ? ISM_UNFINISHED : ism_status(run->solver->result().status);
  });
}

ism_status ism_run_result(ism_run* run, ism_result* result) {
  return guarded(run, [&] {
    need(result != nullptr, "result: NULL");
    const ism::Result& r = run->solver->result();
    const ism::IterationLog& state = r.final_state();
    run->warnings.clear();
    for (const ism::Warning& w : r.warnings) run->warnings.push_back(message_of(w));
    result->message = message_of(r);
    result->warnings = run->warnings.data(), result->n_warnings = int(r.warnings.size());
    result->status = int(r.status), result->n_iterations = int(r.log.size());
    result->fraction = run->solver->fraction(), result->distortion = state.mean_distortion;
    result->coverage_a = state.coverage_a, result->coverage_b = state.coverage_b;
    result->seconds = r.start.seconds + r.seconds;
    return kDone;
  });
}

ism_status ism_run_cancel(ism_run* run, int is_cancelled) {
  if (run == nullptr) return fail(ISM_BAD_ARGUMENT, "run: NULL");
  run->stop = is_cancelled != 0;
  return kDone;
}

ism_status ism_run_free(ism_run* run) {
  if (run != nullptr && run->is_busy.exchange(true)) return fail(ISM_BUSY, kBusy);
  delete run;
  return kDone;
}

ism_status ism_map_create(ism_run* run, ism_map** map) {
  if (map != nullptr) *map = nullptr;
  return guarded(run, [&] {
    need(map != nullptr, "map: NULL");
    const ism::Result& result = run->solver->result();
    auto made = std::make_unique<ism_map>();
    made->map = ism::SurfaceMap(result);
    if (made->map.status() != ism::Status::kDone)
      return fail(int(made->map.status()), made->map.message().c_str());
    *map = made.release();
    return ism_status(result.status);
  });
}

void ism_map_free(ism_map* map) { delete map; }

ism_status ism_map_images(const ism_map* map, int from, int n, const int* ids,
                          const double* barycentric, int* image_ids, double* image_barycentric,
                          double* image_positions) {
  return guarded([&] {
    need(map != nullptr, "map: NULL");
    need_in_range(from, 2, "from");
    need_array(ids, n, "points");
    const bool is_forward = from == ISM_A;
    const ism::TriangleMesh& mesh = map->map.mesh(is_forward ? ism::Side::kA : ism::Side::kB);
    const auto place = [&](std::ptrdiff_t i) {
      return barycentric ? barycentric + 3 * i : nullptr;
    };
    for (std::ptrdiff_t i = 0; i < n; ++i) need_point(mesh, ids[i], place(i));
    for (std::ptrdiff_t i = 0; i < n; ++i) {
      const ism::SurfacePoint p = image(map->map, is_forward, ids[i], place(i));
      if (image_ids) image_ids[i] = p.face;
      if (image_barycentric) Eigen::Vector3d::Map(image_barycentric + 3 * i) = p.barycentric;
      if (image_positions)
        Eigen::Vector3d::Map(image_positions + 3 * i) =
            is_forward ? map->map.position_on_b(p) : map->map.position_on_a(p);
    }
    return kDone;
  });
}

ism_status ism_map_meta(ism_map* map, ism_meta* meta) {
  return guarded([&] {
    need(map != nullptr && meta != nullptr, "map or meta: NULL");
    const std::lock_guard<std::mutex> lock(map->mutex);
    const ism::MetaMesh& m = meta_of(*map);
    if (map->polygons.empty()) map->polygons = map->map.distortion();
    const ism::DistortionSummary s = ism::summarize(map->polygons);
    meta->n_vertices = int(m.on_a.rows()), meta->n_polygons = m.n_polygons();
    meta->n_corners = int(m.corners.size()), meta->plane = m.plane.data();
    meta->on_a = m.on_a.data(), meta->on_b = m.on_b.data(), meta->offsets = m.offsets.data();
    meta->face_a = m.face_a.data(), meta->face_b = m.face_b.data(), meta->mean = s.mean;
    meta->corners = m.corners.data(), meta->distortion = &map->polygons.data()->area_a;
    meta->corner_a = m.corner_a.data(), meta->corner_b = m.corner_b.data();
    meta->median = s.median, meta->p95 = s.p95, meta->largest = s.largest;
    meta->sigma_min = s.sigma_min, meta->sigma_max = s.sigma_max;
    meta->area_a = s.area_a, meta->area_b = s.area_b;
    return kDone;
  });
}

ism_status ism_map_transfer(ism_map* map, int from, int element, int target,
                            ism_transfer* transfer) {
  return guarded([&] {
    need(map != nullptr && transfer != nullptr, "map or transfer: NULL");
    need_in_range(from, 2, "from");
    for (const int kind : {element, target}) need_in_range(kind, 3, "an element");
    const std::lock_guard<std::mutex> lock(map->mutex);
    ism::Transfer& t = map->transfers[{from, element, target}];
    if (t.n_sources == 0)
      t = ism::transfer(meta_of(*map), ism::Side(from), ism::Element(element),
                        ism::Element(target));
    *transfer = {t.rows(), t.n_sources, t.offsets.data(), t.sources.data(), t.weights.data()};
    return kDone;
  });
}

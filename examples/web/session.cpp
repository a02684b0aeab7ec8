// session.cpp: ism::Solver for the page and for the module, compiled to WebAssembly by build.sh. A
// worker owns a Session and talks to either; see worker.js. The page's meshes come and go as files
// of emscripten's file system in memory, so reading and writing them is that of all examples; those
// of the module are arrays, which engine.mjs and ism.mjs have checked.

#include "../ism_verify.hpp"
#include "../map_picture.hpp"
#include "../mesh_io.hpp"
#include "ism.hpp"

#include <emscripten/bind.h>
#include <emscripten/val.h>

#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace {

using emscripten::val;
using ism::Side;

// ---- to JavaScript ----

/// A copy as a typed array, as memory may move with the next allocation.
template <class T>
val array_of(const T* data, std::size_t n) {
  return val(emscripten::typed_memory_view(n, data)).call<val>("slice");
}
template <class T>
val array_of(const std::vector<T>& values) {
  return array_of(values.data(), values.size());
}

template <class Matrix>
val floats_of(const Matrix& m) {
  return array_of(std::vector<float>(m.data(), m.data() + m.size()));
}

template <class Matrix>
val doubles_of(const Matrix& m) {
  return array_of(m.data(), static_cast<std::size_t>(m.size()));
}

template <class T>
val list_of(const std::vector<T>& items, val (*convert)(const T&)) {
  val list = val::array();
  for (const T& item : items) list.call<void>("push", convert(item));
  return list;
}

val id_of(const ism::ElementId& e) {
  constexpr const char* elements[] = {"vertex", "face", "corner"};
  val v = val::object();
  v.set("side", e.side == Side::kA ? "a" : "b");
  v.set("element", elements[static_cast<int>(e.element)]);
  v.set("id", e.id);
  return v;
}

template <class Told>  // ism::Outcome or ism::Warning
val told(const Told& what) {
  val v = val::object();
  v.set("message", what.message);
  v.set("ids", list_of(what.ids, id_of));
  return v;
}

val outcome_of(const ism::Outcome& outcome) {
  val v = told(outcome);
  v.set("status", ism::to_string(outcome.status));
  v.set("usable", ism::is_usable(outcome.status));
  v.set("warnings", list_of(outcome.warnings, told<ism::Warning>));
  return v;
}

val refusal(const std::string& message) {
  ism::Outcome outcome;
  outcome.message = message;
  val v = outcome_of(outcome);
  v.set("status", "invalid input");
  v.set("usable", false);
  v.set("ok", false);
  return v;
}

val summary_of(const ism::DistortionSummary& s) {
  val v = val::object();
  v.set("mean", s.mean), v.set("median", s.median), v.set("p95", s.p95);
  v.set("largest", s.largest), v.set("sigmaMin", s.sigma_min), v.set("sigmaMax", s.sigma_max);
  v.set("areaA", s.area_a), v.set("areaB", s.area_b);
  return v;
}

val log_of(const ism::IterationLog& it) {
  val v = val::object();
  const std::initializer_list<std::pair<const char*, double>> numbers = {
      {"energy", it.energy},
      {"energyF", it.energy_f},
      {"energyG", it.energy_g},
      {"distortion", it.mean_distortion},
      {"coverageA", it.coverage_a},
      {"coverageB", it.coverage_b},
      {"omega", it.omega},
      {"step", it.step},
      {"maxStep", it.max_step},
      {"secondsDerivatives", it.seconds_derivatives},
      {"secondsAssembly", it.seconds_assembly},
      {"secondsSolve", it.seconds_solve},
      {"secondsSearch", it.seconds_search}};
  for (const auto& [name, x] : numbers) v.set(name, x);
  v.set("polygons", it.polygons);
  v.set("historyReset", it.history_reset);
  v.set("quasiNewton", it.quasi_newton);
  return v;
}

// ---- from JavaScript ----

ism::DistortionMeasure measure_named(const std::string& name) {
  if (name == "arap") return ism::arap();
  if (name == "sarap") return ism::sarap();
  if (name == "asap") return ism::asap();
  return ism::symmetric_dirichlet();
}

/// Sets what is given.
template <class T>
void set(T& x, const val& given) {
  if (!given.isUndefined()) x = given.as<T>();
}

void set(std::vector<int>& ids, const val& given) {
  if (!given.isUndefined()) ids = emscripten::convertJSArrayToNumberVector<int>(given);
}

/// Options by their names in ism::Options, in camel case.
ism::Options options_of(const val& v) {
  ism::Options o;
  std::string measure, boundary;
  set(measure, v["measure"]), set(boundary, v["boundary"]);
  o.measure = measure_named(measure);
  if (boundary == "fixed") o.boundary = ism::Boundary::kFixed;
  if (boundary == "slide") o.boundary = ism::Boundary::kSlide;
  set(o.max_iterations, v["maxIterations"]), set(o.tolerance, v["tolerance"]);
  set(o.max_seconds, v["maxSeconds"]), set(o.coverage_weight, v["coverageWeight"]);
  set(o.keep_scale, v["keepScale"]), set(o.exact_landmarks, v["exactLandmarks"]);
  set(o.weld, v["weld"]), set(o.candidates, v["candidates"]);
  set(o.coarsest, v["coarsest"]), set(o.refine, v["refine"]);
  set(o.history_length, v["historyLength"]), set(o.omega_start, v["omegaStart"]);
  set(o.outer_a, v["outerA"]), set(o.outer_b, v["outerB"]);
  set(o.pins_a, v["pinsA"]), set(o.pins_b, v["pinsB"]);
  set(o.as_published, v["asPublished"]);
  return o;
}

/// A row of nine numbers per landmark: a, b, its weight, barycentric coordinates in a and in b,
/// zeros if it is a vertex.
std::vector<ism::Landmark> landmarks_of(const val& rows) {
  constexpr std::size_t kColumns = 9;
  const std::vector<double> x = emscripten::convertJSArrayToNumberVector<double>(rows);
  const auto end_of = [](double id, const double* barycentric) {
    const Eigen::Vector3d p(barycentric);
    const int i = static_cast<int>(id);
    return p.isZero(0) ? ism::LandmarkPoint(i) : ism::LandmarkPoint(ism::SurfacePoint{i, p});
  };
  std::vector<ism::Landmark> landmarks;
  for (std::size_t i = 0; i < x.size(); i += kColumns)
    landmarks.push_back({end_of(x[i], &x[i + 3]), end_of(x[i + 1], &x[i + 6]), x[i + 2]});
  return landmarks;
}

// ---- what is drawn ----

/// One corner of a triangle of the meta mesh; the layout of view.js.
struct Corner {
  float on_a[3], on_b[3], plane[2];
  float weights_a[2], weights_b[2];  // the first two barycentric coordinates in the triangles
  std::int8_t normal_a[4], normal_b[4];
  float density;
};
static_assert(sizeof(Corner) == 60, "view.js counts bytes");

/// The overlay of a map as triangles without common vertices, since densities belong to polygons.
class OverlayPicture {
 public:
  explicit OverlayPicture(const ism::SurfaceMap& map)
      : meta_(map.meta_mesh(ism::Ids::kEmbedded)),
        normals_a_(render::smooth_normals(meta_.a->vertices, meta_.a->triangles)),
        normals_b_(render::smooth_normals(meta_.b->vertices, meta_.b->triangles)) {
    const std::vector<ism::PolygonDistortion> distortion = map.distortion();
    for (int p = 0; p < meta_.n_polygons(); ++p) {
      const std::size_t i = static_cast<std::size_t>(p);
      for (int k = meta_.offsets[i] + 1; k + 1 < meta_.offsets[i + 1]; ++k)
        for (int corner : {meta_.offsets[i], k, k + 1}) add(p, corner, distortion[i].density);
    }
  }

  val bytes() const {
    return array_of(reinterpret_cast<const std::uint8_t*>(corners_.data()),
                    corners_.size() * sizeof(Corner));
  }

 private:
  void add(int polygon, int corner, double density) {
    const std::size_t p = static_cast<std::size_t>(polygon);
    const int v = meta_.corners[static_cast<std::size_t>(corner)];
    Corner c;
    for (int k = 0; k < 3; ++k) {
      c.on_a[k] = static_cast<float>(meta_.on_a(v, k));
      c.on_b[k] = static_cast<float>(meta_.on_b(v, k));
    }
    for (int k = 0; k < 2; ++k) {
      c.plane[k] = static_cast<float>(meta_.plane(v, k));
      c.weights_a[k] = static_cast<float>(meta_.corner_a(corner, k));
      c.weights_b[k] = static_cast<float>(meta_.corner_b(corner, k));
    }
    set_normal(*meta_.a, normals_a_, meta_.face_a[p], meta_.corner_a.row(corner), c.normal_a);
    set_normal(*meta_.b, normals_b_, meta_.face_b[p], meta_.corner_b.row(corner), c.normal_b);
    c.density = static_cast<float>(density);
    corners_.push_back(c);
  }

  static void set_normal(const ism::TriangleMesh& mesh, const ism::Points3& normals, int face,
                         const Eigen::RowVector3d& weights, std::int8_t* packed) {
    Eigen::RowVector3d n = Eigen::RowVector3d::Zero();
    for (int k = 0; k < 3; ++k) n += weights(k) * normals.row(mesh.triangles(face, k));
    for (int k = 0; k < 3; ++k) packed[k] = static_cast<std::int8_t>(127 * n.normalized()(k));
    packed[3] = 0;
  }

  const ism::MetaMesh meta_;
  const ism::Points3 normals_a_, normals_b_;
  std::vector<Corner> corners_;
};

// ---- the session ----

class Session {
 public:
  /// Reads and prepares a mesh; {ok, message} and what a page shows of it. Drops what was computed.
  val open(int side, const std::string& path) {
    const mesh_io::ReadResult file = mesh_io::read_mesh(path);
    if (!file.ok) return refusal(file.error);
    ism::Prepared prepared = ism::prepare(file.mesh);
    if (!prepared.problems.empty()) return refusal(prepared.problems.front().message);
    solver_.reset();
    mesh_[side] = prepared.mesh;
    val v = mesh_of(*prepared.mesh);
    v.set("ok", true);
    std::vector<std::string> done = file.notes;
    for (const ism::Problem& r : prepared.repairs) done.push_back(r.message);
    v.set("repairs", list_of<std::string>(done, [](const std::string& s) { return val(s); }));
    return v;
  }

  /// Takes a mesh as it is, #V×3 doubles and #F×3 ids; what it needs, the library mends itself.
  void take(int side, val positions, val triangles) {
    const auto x = emscripten::convertJSArrayToNumberVector<double>(positions);
    const auto f = emscripten::convertJSArrayToNumberVector<int>(triangles);
    auto mesh = std::make_shared<ism::TriangleMesh>();
    mesh->vertices = Eigen::Map<const ism::Points3>(x.data(), Eigen::Index(x.size() / 3), 3);
    mesh->triangles = Eigen::Map<const ism::Triangles>(f.data(), Eigen::Index(f.size() / 3), 3);
    solver_.reset();
    mesh_[side] = mesh;
  }

  /// Begins anew.
  val start(val landmarks, val options) {
    last_.reset();
    stop_ = false;
    if (!mesh_[0] || !mesh_[1]) return refusal("open two meshes first");
    constexpr Eigen::Index kMost = 120000;  // for the 2 GB that a page has
    if (mesh_[0]->triangles.rows() + mesh_[1]->triangles.rows() > kMost)
      return refusal("there is memory for 120,000 triangles in all: take coarser meshes");
    solver_ = std::make_unique<ism::Solver>(*mesh_[0], *mesh_[1], landmarks_of(landmarks),
                                            with_progress(options));
    return state(solver_->result().status == ism::Status::kNoMapYet);
  }

  /// Goes on with other landmarks and options.
  val change(val landmarks, val options) {
    if (!solver_) return refusal("there is no run");
    return outcome_of(solver_->change(landmarks_of(landmarks), with_progress(options)));
  }

  val step() {
    is_new_ = false;
    return state(solver_->step());
  }

  /// Steps for some seconds, at least once. Tells less than step(), as the state of a run costs
  /// some steps while decimated surfaces are mapped.
  val advance(double seconds) {
    val v = val::object();
    v.set("more", solver_->advance(seconds));
    v.set("fraction", solver_->fraction());
    v.set("what", what_);
    return v;
  }

  /// Ends the run where it is, for map().
  void cancel() {
    stop_ = true;
    solver_->step();
  }

  /// Ends the run: the outcome, with the figures of the map if there is one. The rest of it is
  /// asked for by images(), transfer() and meta().
  val map() {
    const ism::Result& result = solver_->result();
    val v = outcome_of(result);
    if (!ism::is_usable(result.status)) return v;
    map_ = ism::SurfaceMap(result);
    if (map_.status() != ism::Status::kDone) {
      v.set("usable", false);
      v.set("status", ism::to_string(map_.status()));
      v.set("message", map_.message());
      return v;
    }
    meta_ = map_.meta_mesh();
    distortion_ = map_.distortion();
    const ism::IterationLog& last = result.final_state();
    v.set("coverageA", last.coverage_a), v.set("coverageB", last.coverage_b);
    v.set("iterations", static_cast<int>(result.log.size()));
    v.set("seconds", result.start.seconds + result.seconds);
    v.set("distortion", summary_of(ism::summarize(distortion_)));
    solver_.reset();  // its memory serves what follows
    return v;
  }

  /// Images of vertices `ids` of a side, or, with barycentric coordinates, of points in triangles.
  val images(int from, val ids, val barycentric) const {
    const auto points = emscripten::convertJSArrayToNumberVector<int>(ids);
    std::vector<double> places;
    const bool are_vertices = barycentric.isUndefined();
    if (!are_vertices) places = emscripten::convertJSArrayToNumberVector<double>(barycentric);
    const std::size_t n = points.size();
    std::vector<int> faces(n);
    std::vector<double> weights(3 * n), positions(3 * n);
    for (std::size_t i = 0; i < n; ++i) {
      const ism::SurfacePoint p =
          are_vertices ? image(from, points[i])
                       : image(from, ism::SurfacePoint{points[i], place(&places[3 * i])});
      faces[i] = p.face;
      place(&weights[3 * i]) = p.barycentric;
      place(&positions[3 * i]) = from == 0 ? map_.position_on_b(p) : map_.position_on_a(p);
    }
    val v = val::object();
    v.set("faces", array_of(faces)), v.set("barycentric", array_of(weights));
    v.set("positions", array_of(positions));
    return v;
  }

  /// The matrix that carries values of elements of a side to elements of the other one, by rows.
  val transfer(int from, int source, int target) const {
    const ism::Transfer t =
        ism::transfer(meta_, Side(from), ism::Element(source), ism::Element(target));
    val v = val::object();
    v.set("columns", t.n_sources);
    v.set("offsets", array_of(t.offsets)), v.set("sources", array_of(t.sources));
    v.set("weights", array_of(t.weights));
    return v;
  }

  /// The common refinement of both meshes, with the distortion of its polygons.
  val meta() const {
    val v = val::object();
    v.set("onA", doubles_of(meta_.on_a)), v.set("onB", doubles_of(meta_.on_b));
    v.set("plane", doubles_of(meta_.plane));
    v.set("faceA", array_of(meta_.face_a)), v.set("faceB", array_of(meta_.face_b));
    v.set("offsets", array_of(meta_.offsets)), v.set("corners", array_of(meta_.corners));
    v.set("cornerA", doubles_of(meta_.corner_a)), v.set("cornerB", doubles_of(meta_.corner_b));
    static_assert(sizeof(ism::PolygonDistortion) == 5 * sizeof(double), "JavaScript reads rows");
    v.set("distortion", array_of(&distortion_.data()->area_a, 5 * distortion_.size()));
    return v;
  }

  /// The overlay and both embeddings, in triangles; undefined while there is no map.
  val picture() {
    if (!solver_) return val::undefined();
    const ism::SurfaceMap map(solver_->result());
    if (map.status() != ism::Status::kDone) return val::undefined();
    val v = val::object();
    v.set("overlay", OverlayPicture(map).bytes());
    v.set("f", plane_of(map, Side::kA));
    v.set("g", plane_of(map, Side::kB));
    return v;
  }

  /// Proves that the map is injective, by other means than those it was made with.
  val verify() { return outcome_of(ism::verify_map(ism::SurfaceMap(solver_->result()))); }

  /// Writes the map to files: {ok, message}.
  val save() {
    if (!solver_) return refusal("there is no map");
    const ism::SurfaceMap map(solver_->result());
    if (map.status() != ism::Status::kDone) return refusal(map.message());
    std::vector<mesh_io::TextFile> files;
    for (Side side : {Side::kA, Side::kB}) {
      const bool is_a = side == Side::kA;
      const ism::TriangleMesh moved = ism::remesh(map, side);
      files.push_back({is_a ? "/A_on_B.obj" : "/B_on_A.obj",
                       mesh_io::obj_text(is_a ? "A on B" : "B on A", moved.vertices,
                                         moved.triangles)});
      files.push_back(
          {is_a ? "/distortion_on_A.ply" : "/distortion_on_B.ply", heat_text(map, side)});
    }
    const std::string error = mesh_io::write_files(files);
    if (!error.empty()) return refusal(error);
    val v = val::object();
    v.set("ok", true);
    v.set("message", "");
    return v;
  }

 private:
  ism::Options with_progress(const val& settings) {
    ism::Options options = options_of(settings);
    options.stop = &stop_;
    options.progress = [this](const ism::Progress& p) {
      what_ = p.what;
      if (p.iteration) last_ = *p.iteration, is_new_ = true;
      return true;
    };
    return options;
  }

  using Place = Eigen::Map<Eigen::Vector3d>;
  static Place place(double* numbers) { return Place(numbers); }

  ism::SurfacePoint image(int from, int vertex) const {
    return from == 0 ? map_.forward_vertex(vertex) : map_.backward_vertex(vertex);
  }
  ism::SurfacePoint image(int from, const ism::SurfacePoint& p) const {
    return from == 0 ? map_.forward(p) : map_.backward(p);
  }

  /// Where the run is; `log` is that of the last iteration, after a change of one before it.
  val state(bool has_more) const {
    const ism::Result& result = solver_->result();
    val v = outcome_of(result);
    v.set("more", has_more);
    v.set("isNew", is_new_);  // the last step was an iteration
    v.set("what", what_);
    v.set("fraction", solver_->fraction());
    v.set("iterations", static_cast<int>(result.log.size()));
    if (!result.log.empty() || !last_)
      v.set("log", log_of(result.final_state()));
    else
      v.set("log", log_of(*last_));
    return v;
  }

  static val mesh_of(const ism::TriangleMesh& mesh) {
    val v = val::object();
    v.set("vertices", floats_of(mesh.vertices));
    v.set("triangles",
          array_of(mesh.triangles.data(), static_cast<std::size_t>(mesh.triangles.size())));
    v.set("normals", floats_of(render::smooth_normals(mesh.vertices, mesh.triangles)));
    v.set("isClosed", picture::boundary_vertices(mesh).empty());
    // Rows: right, up, towards the viewer.
    v.set("axes", floats_of(Eigen::Matrix3d(picture::front_axes(mesh).transpose())));
    return v;
  }

  static val plane_of(const ism::SurfaceMap& map, Side side) {
    const ism::TriangleMesh& mesh = map.mesh(side, ism::Ids::kEmbedded);
    val v = val::object();
    v.set("positions", floats_of(map.planar_positions(side)));
    v.set("triangles",
          array_of(mesh.triangles.data(), static_cast<std::size_t>(mesh.triangles.size())));
    return v;
  }

  static std::string heat_text(const ism::SurfaceMap& map, Side side) {
    const ism::MetaMesh meta = map.meta_mesh();
    const std::vector<ism::PolygonDistortion> distortion = map.distortion();
    const auto n = static_cast<Eigen::Index>(meta.corners.size());
    Eigen::MatrixXd colors(n, 3);
    Eigen::VectorXd densities(n);
    for (std::size_t p = 0; p < distortion.size(); ++p)
      for (int i = meta.offsets[p]; i < meta.offsets[p + 1]; ++i) {
        densities(i) = distortion[p].density;
        colors.row(i) = picture::heat_of(densities(i)).cast<double>();
      }
    return mesh_io::ply_text("distortion, from 2", side == Side::kA ? meta.on_a : meta.on_b,
                             mesh_io::polygons_of(meta), colors, densities);
  }

  ism::SharedMesh mesh_[2];
  std::unique_ptr<ism::Solver> solver_;
  std::optional<ism::IterationLog> last_;
  bool is_new_ = false;
  std::string what_;
  std::atomic<bool> stop_{false};
  ism::SurfaceMap map_;  // of map(), as are these
  ism::MetaMesh meta_;
  std::vector<ism::PolygonDistortion> distortion_;
};

/// The colours of densities 2 to 8, their logarithms equally apart, n times red, green, blue.
val heat_colors(int n) {
  std::vector<std::uint8_t> colors;
  for (int i = 0; i < n; ++i)
    for (float c : picture::heat_of(2 * std::pow(4.0, i / (n - 1.0))))
      colors.push_back(static_cast<std::uint8_t>(std::lround(255 * c)));
  return array_of(colors);
}

}  // namespace

EMSCRIPTEN_BINDINGS(ism) {
  emscripten::class_<Session>("Session")
      .constructor<>()
      .function("open", &Session::open)
      .function("take", &Session::take)
      .function("start", &Session::start)
      .function("change", &Session::change)
      .function("step", &Session::step)
      .function("advance", &Session::advance)
      .function("cancel", &Session::cancel)
      .function("map", &Session::map)
      .function("images", &Session::images)
      .function("transfer", &Session::transfer)
      .function("meta", &Session::meta)
      .function("picture", &Session::picture)
      .function("verify", &Session::verify)
      .function("save", &Session::save);
  emscripten::function("heatColors", &heat_colors);
}

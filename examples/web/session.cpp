// session.cpp: ism::Solver for a page in a browser, compiled to WebAssembly by build.sh. A worker
// owns a Session and talks to the page; see worker.js. Meshes come and go as files of emscripten's
// file system in memory, so reading and writing them is that of all examples.

#include "../map_picture.hpp"
#include "../mesh_io.hpp"
#include "ism.hpp"

#include <emscripten/bind.h>
#include <emscripten/val.h>

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

template <class T>
val list_of(const std::vector<T>& items, val (*convert)(const T&)) {
  val list = val::array();
  for (const T& item : items) list.call<void>("push", convert(item));
  return list;
}

val outcome_of(const ism::Outcome& outcome) {
  val v = val::object();
  v.set("status", ism::to_string(outcome.status));
  v.set("usable", ism::is_usable(outcome.status));
  std::string message = outcome.message;
  for (const ism::Warning& w : outcome.warnings)
    message += (message.empty() ? "warning: " : "; warning: ") + w.message;
  v.set("message", message);
  return v;
}

val refusal(const std::string& message) {
  val v = val::object();
  v.set("ok", false);
  v.set("message", message);
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

/// What the sliders say: {measure, coverage, omega, memory, variant, exact}.
ism::Options options_of(const val& v) {
  ism::Options options;
  options.measure = measure_named(v["measure"].as<std::string>());
  options.coverage_weight = v["coverage"].as<double>();
  options.exact_landmarks = v["exact"].as<bool>();
  options.omega_start = v["omega"].as<double>();
  options.history_length = v["memory"].as<int>();
  const std::string variant = v["variant"].as<std::string>();
  if (variant != "full") {  // SPN (§5.3), and without its memory PN (§5.1)
    options.omega_start = options.coarsest = 0;
    if (variant == "pn") options.history_length = 1;
  }
  return options;
}

/// [[vertex of A, vertex of B], ...]
std::vector<ism::Landmark> landmarks_of(const val& list) {
  std::vector<ism::Landmark> landmarks;
  for (int i = 0, n = list["length"].as<int>(); i < n; ++i)
    landmarks.push_back({list[i][0].as<int>(), list[i][1].as<int>()});
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

  /// Begins anew.
  val start(val landmarks, val options) {
    last_.reset();
    if (!mesh_[0] || !mesh_[1]) return refusal("open two meshes first");
    constexpr Eigen::Index kMost = 120000;  // for the 2 GB that a page has
    if (mesh_[0]->triangles.rows() + mesh_[1]->triangles.rows() > kMost)
      return refusal("a page has memory for 120,000 triangles in all: take coarser meshes");
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
  val verify() { return outcome_of(ism::verify(ism::SurfaceMap(solver_->result()))); }

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
    options.progress = [this](const ism::Progress& p) {
      what_ = p.what;
      if (p.iteration) last_ = *p.iteration, is_new_ = true;
      return true;
    };
    return options;
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
      .function("start", &Session::start)
      .function("change", &Session::change)
      .function("step", &Session::step)
      .function("picture", &Session::picture)
      .function("verify", &Session::verify)
      .function("save", &Session::save);
  emscripten::function("heatColors", &heat_colors);
}

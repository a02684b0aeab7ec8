// ism.hpp - distortion-minimizing injective maps between surfaces
//
// Computes a map Φ between two triangle meshes A and B, closed or with boundaries. Φ is continuous,
// injective, symmetric in A and B, and of low distortion. This header implements
//
//   Patrick Schmidt, Janis Born, Marcel Campen, Leif Kobbelt:
//   Distortion-Minimizing Injective Maps Between Surfaces.
//   ACM Transactions on Graphics 38(6), 2019.
//
// Both meshes are embedded in one plane, by f and by g; then Φ = g⁻¹ ∘ f. The unknowns are the
// planar positions of all vertices. The objective is the symmetric Dirichlet energy of Φ, or
// another measure, summed exactly over the polygons of the overlay of f(A) and g(B). "§" and "Eq."
// in the comments below mean sections and equations of that paper.
//
// QUICK START
//
//   #include "ism.hpp"  // C++17; needs Eigen 3 and nothing else
//
//   In exactly one source file, before the include:  #define ISM_IMPLEMENTATION
//   With CMake, link ism::ism instead; it contains the implementation.
//
//   ism::TriangleMesh a, b;                                  // fill vertices and triangles
//   std::vector<ism::Landmark> landmarks = {{17, 4}, {32, 90}};  // optional
//   ism::Result result = ism::compute_map(a, b, landmarks);
//   if (ism::is_usable(result.status)) {
//     ism::SurfaceMap map(result);
//     ism::SurfacePoint image = map.forward_vertex(0);       // of vertex 0 of A, on B
//   }
//
// INPUT      Each mesh is a manifold, consistently oriented surface: one component without handles.
//            validate() lists defects, prepare() repairs most of them. If both meshes are closed,
//            so is the map; if only one is, it is cut open. One boundary loop is the outline
//            (Options::outer_a); all others are openings, e.g. eyes and mouths, and points over an
//            opening are not covered. Meshes are read in place: float or double, interleaved or not
//            (MeshView).
// STEPS      ism::Solver runs compute_map() in steps, which can be stopped and resumed, also with
//            other landmarks and options.
// PROMISE    If both meshes are surfaces of genus 0, as given or after prepare(), and options,
//            landmarks and pins are within their documented ranges (else a status names the
//            violation, and nothing is computed), every returned map is continuous and injective,
//            at every exit and from every coarse level. All triangles of f and g are positive,
//            angles around interior vertices sum to 2π, boundaries are simple; so f and g are
//            injective, and Φ is a homeomorphism of the covered parts, and of the whole surfaces if
//            both are closed. Exact predicates decide this on the returned coordinates;
//            examples/ism_verify.hpp proves it by other code.
// NO PROMISE of a global minimum: the minimum is a local one; of semantic correspondence: landmarks
//            pull softly, unless Options::exact_landmarks is set; of full coverage: Φ maps
//            the parts of A and B that overlap in the plane (IterationLog::coverage_a), unless both
//            are closed or Options::boundary aligns the boundaries; of exact images: SurfaceMap
//            rounds the points that it returns, though the map itself is exact.
// THREADS    Functions are thread-safe. Results have the same bits for any number of threads,
//            because blocks of work do not depend on it. Options::parallel_for plugs in a job
//            system. A task takes at most 64 KB of stack in optimised builds. If the system refuses
//            to start threads, fewer do the work (with exceptions enabled).
// ERRORS     No exceptions, no RTTI, no output, no global state: results have a status, a sentence
//            and the ids of offending elements. Exceptions of allocations and callbacks, in any
//            thread, reach the caller without leaks; the call then has no result.
//
// MACROS     ISM_IMPLEMENTATION   adds the implementation, parts [3] to [21], in one file
//            ISM_NO_THREADS       builds that file without <thread>
//            ISM_VERSION_MAJOR, ISM_VERSION_MINOR, ISM_VERSION_PATCH
//
// CONTENTS   I, the paper
//            [1] version and configuration   [2] public API    [3] notation
//            [4] small types and helpers     [5] exact predicates
//            [6] half-edge mesh              [7] overlay       [8] energies
//            [9] objective and its quadratic model             [10] constraints
//            [11] step bound and line search                   [12] the loop (Algorithm 1)
//            [13] sparse LDLT                                  [14] initial embedding
//            [15] map evaluation and meta mesh
//            II, what surfaces and programs need besides
//            [16] checked and prepared meshes                  [17] alignments in space
//            [18] applications               [19] closed surfaces
//            [20] threads and progress       [21] entry points
//
// HISTORY, LICENSE (MIT)  at the end of the file.

#ifndef ISM_HPP
#define ISM_HPP

// ==== [1] VERSION AND CONFIGURATION ==============================================================

#define ISM_VERSION_MAJOR 1
#define ISM_VERSION_MINOR 0
#define ISM_VERSION_PATCH 0

// Files of one program with different versions or container layouts do not link.
#if defined(_GLIBCXX_DEBUG) || (defined(_ITERATOR_DEBUG_LEVEL) && _ITERATOR_DEBUG_LEVEL > 0)
#define ISM_ABI v1_0_checked
#else
#define ISM_ABI v1_0
#endif

// arithmetic_is_sound() detects flags without a macro at run time, e.g. clang's -fassociative-math.
#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(_M_FP_FAST) || \
    (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ != 0)
#error "ism.hpp decides orientations exactly; it cannot be compiled with -ffast-math and the like"
#endif
#include <cfloat>
#if FLT_EVAL_METHOD != 0
#error "ism.hpp decides orientations exactly; doubles must be evaluated as doubles (-mfpmath=sse)"
#endif

#include <Eigen/Core>

#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

// ==== [2] PUBLIC API =============================================================================

static_assert(sizeof(Eigen::Index) == sizeof(std::ptrdiff_t),
              "files of one program must agree on Eigen's index type: leave it at ptrdiff_t");

namespace ism {
inline namespace ISM_ABI {

namespace detail {
class Run;
struct MapData;

/// Reads the number at `place`, which a stride may leave unaligned.
template <class T>
double number_at(const void* place) {
  T value;
  std::memcpy(&value, place, sizeof value);
  return static_cast<double>(value);
}

/// Converts x to T; integers are rounded to the nearest and clamped to the range of T.
template <class T>
T rounded(double x) {
  using Limits = std::numeric_limits<T>;
  if constexpr (!Limits::is_integer)
    return static_cast<T>(x);
  else if (!(x > static_cast<double>((Limits::lowest)())))
    return (Limits::lowest)();
  else
    return x < static_cast<double>((Limits::max)()) ? static_cast<T>(std::round(x))
                                                    : (Limits::max)();
}

/// A view of #×3 numbers in the caller's memory: ids of any integer type, or positions, float or
/// double. A call reads them and keeps no reference.
template <bool are_ids>
struct ArrayView {
  const void* data = nullptr;
  std::ptrdiff_t rows = 0;
  std::ptrdiff_t row_stride = 0, column_stride = 0;  // bytes between rows, between columns
  double (*read)(const void* place) = nullptr;       // reads a number of their type

  ArrayView() = default;
  /// Numbers of a row are contiguous; the next row begins `stride` bytes further.
  template <class T>
  ArrayView(const T* first, std::ptrdiff_t n, std::ptrdiff_t stride = 3 * sizeof(T))
      : data(first), rows(n), row_stride(stride), column_stride(sizeof(T)), read(number_at<T>) {
    static_assert(are_ids ? std::is_integral<T>::value : std::is_floating_point<T>::value,
                  "positions are float or double, ids are integers");
  }
  /// Views an Eigen matrix in any storage order. A matrix without three columns has no rows.
  template <class Matrix>
  ArrayView(const Eigen::DenseBase<Matrix>& matrix)
      : ArrayView(matrix.derived().data(), matrix.cols() == 3 ? matrix.rows() : 0) {
    static_assert((int{Matrix::Flags} & int{Eigen::DirectAccessBit}) != 0,
                  "a view needs a matrix in memory, not an expression");
    row_stride = matrix.derived().rowStride() * column_stride;
    column_stride *= matrix.derived().colStride();
  }
};
}  // namespace detail

/// #×D, a point or a triangle per row; data() is a plain array in row-major order. Memory comes
/// from malloc for any instruction set, so files of one program may be compiled for different ones.
template <class Scalar, int D>
using Rows = Eigen::Matrix<Scalar, Eigen::Dynamic, D, int{Eigen::RowMajor} | int{Eigen::DontAlign}>;
using Points2 = Rows<double, 2>;              // planar points
using Points3 = Rows<double, 3>;              // points in space
using Triangles = Rows<int, 3>;               // 0-based vertex ids
using Values = Rows<double, Eigen::Dynamic>;  // attributes, a row per element

/// A triangle mesh as plain arrays. Triangles are counter-clockwise seen from outside.
struct TriangleMesh {
  Points3 vertices;     // #V×3, any unit
  Triangles triangles;  // #F×3, ids in [0, #V)
};

/// A mesh in the caller's memory: positions and triangles of 0-based vertex ids, each an Eigen
/// matrix with three columns or {pointer, number of rows, bytes between rows}. A TriangleMesh and
/// pairs of matrices convert implicitly. A result that needs the mesh shares one copy of it.
///
///   struct Vertex { float position[3], normal[3], uv[2]; };  // and std::uint16_t indices
///   ism::MeshView a({vertices[0].position, n, sizeof(Vertex)}, {indices.data(), triangles});
struct MeshView {
  detail::ArrayView<false> positions;
  detail::ArrayView<true> triangles;
  MeshView() = default;
  MeshView(const detail::ArrayView<false>& x, const detail::ArrayView<true>& f)
      : positions(x), triangles(f) {}
  MeshView(const TriangleMesh& mesh) : positions(mesh.vertices), triangles(mesh.triangles) {}
};

/// A copy of a mesh, shared by all results made from it.
using SharedMesh = std::shared_ptr<const TriangleMesh>;

/// One of the two surfaces of a map.
enum class Side { kA, kB };

/// The kind of an id or of a row of attributes. Corner k of face f is 3 f + k. Texture coordinates
/// with seams belong to corners.
enum class Element { kVertex, kFace, kCorner };

/// The mesh that ids refer to: the caller's, or the embedded one (Embedding::a, Embedding::b). With
/// kWhole, also the embedded one, meta_mesh() includes triangles that close openings.
enum class Ids { kGiven, kEmbedded, kWhole };

/// A vertex or a triangle of one of the two given meshes.
struct ElementId {
  Side side;
  Element element;
  int id;
};
inline bool operator==(const ElementId& a, const ElementId& b) {
  return a.side == b.side && a.element == b.element && a.id == b.id;
}

/// How a call ended. Every result carries a status, a sentence and the ids it refers to.
enum class Status {
  kDone,              // the requested embedding, map or attributes were computed
  kConverged,         // the stopping rule of Options::tolerance was met
  kIterationLimit,    // Options::max_iterations reached; the result is the last injective iterate
  kTimeLimit,         // Options::max_seconds reached; the result is the last injective iterate
  kCancelled,         // the caller cancelled; the result is the last injective iterate
  kStalled,           // no step lowers the energy, or a later stage failed (see the message); the
                      // result is still valid
  kUnfinished,        // a Solver has more to do; the result is the last injective iterate
  kNoMapYet,          // stopped, or a Solver paused, before the first map; no positions
  kMemoryLimit,       // the overlay has more than 16 million polygons
  kInvalidMesh,       // an input mesh is not a clean surface, see validate()
  kInvalidLandmarks,  // a landmark is out of range, used twice, or cannot be met exactly
  kInvalidOptions,    // an option is outside its documented range
  kInvalidPositions,  // given planar positions are not an injective embedding
  kInvalidPins,       // a pinned or fixed vertex is out of range, listed twice, contradicts another
                      // constraint, is uncovered, or in a chain
  kNoOverlap,         // f(A) and g(B) do not overlap at the start
  kNumericalFailure   // an embedding failed (please report the mesh); E or its derivatives are not
                      // finite at the start; or the arithmetic is not IEEE 754
};

/// True if the result has what was requested, e.g. an injective map: statuses before kNoMapYet.
inline bool is_usable(Status s) { return s <= Status::kUnfinished; }

/// Returns the name of a status in words ("converged", "iteration limit", ...).
const char* to_string(Status s);

/// A finding that did not stop a call, but may make the result useless.
struct Warning {
  std::string message;         // a sentence for the user
  std::vector<ElementId> ids;  // the elements it names
};

/// The part common to all results.
struct Outcome {
  Status status = Status::kDone;
  std::string message;         // a sentence for the user
  std::vector<ElementId> ids;  // the elements it names
  std::vector<Warning> warnings;
};

/// One defect of a mesh, found or repaired: a sentence with the ids, and the ids as data.
struct Problem {
  enum class Kind {
    kEmpty,
    kIndexOutOfRange,
    kNonFiniteCoordinate,
    kDegenerateTriangle,
    kRepeatedTriangle,
    kNonManifoldEdge,
    kInconsistentOrientation,
    kNonManifoldVertex,
    kUnreferencedVertex,
    kSeveralComponents,
    kNotOrientable,
    kHandles,
    kUnwelded  // repairs only: coincident vertices, or the ends of a short edge
  };
  Kind kind;
  std::string message;   // "edge 3-7 has 3 triangles: 0, 5, 9", or "turned 5 triangles over"
  Element element;       // the kind of the ids
  std::vector<int> ids;  // vertices or faces
};

/// Lists the defects of a mesh, at most 20 of each kind; empty means valid. Checks that depend on a
/// failed one are skipped. Meshes have at most 2^24 vertices and triangles, so that ids of all
/// derived elements fit in an int. Cost O(#F log #F). Thread-safe.
std::vector<Problem> validate(const MeshView& mesh);

/// A point of a surface: a triangle and barycentric coordinates with sum 1; or none, if uncovered.
struct SurfacePoint {
  int face = -1;
  Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();
  bool exists() const { return face >= 0; }
};

/// One end of a landmark: a vertex or a point in a triangle; both convert implicitly.
struct LandmarkPoint {
  int vertex = -1;     // -1: the end is `point`
  SurfacePoint point;  // barycentric coordinates below 1e-9 count as 0
  LandmarkPoint(int v = -1) : vertex(v) {}
  LandmarkPoint(const SurfacePoint& p) : point(p) {}
};

/// A repaired mesh, and the origin of its elements.
struct Prepared {
  SharedMesh given = std::make_shared<TriangleMesh>();  // a copy of the given mesh
  SharedMesh mesh = given;                              // the same copy, if nothing was repaired
  std::vector<Problem> repairs;                         // what was repaired
  std::vector<Problem> problems;  // what remains, in given ids; empty: `mesh` is valid
  /// Per vertex and per corner of `mesh`, its given id, the first one if several were joined; -1:
  /// it closes an opening, see compute_map().
  std::vector<int> given_vertex, given_corner;
  /// Per triangle of `mesh`, the given triangle that contains it, or -1.
  std::vector<int> given_triangle;
  /// Per given vertex and triangle, its id in `mesh`; a cut triangle has the id of its first part;
  /// -1: dropped. A vertex of dropped repeated triangles has the id of the vertex at its place.
  std::vector<int> new_vertex, new_triangle;
};

/// Repairs a mesh into a clean surface. Drops repeated triangles, unreferenced vertices and
/// degenerate triangles, without gaps: short edges shrink to a point, triangles behind long ones
/// are split. Welds coincident boundary edges (triangle soup, seams of texture coordinates), unless
/// `weld` is false. Cuts where more than two triangles share an edge or fans share a vertex. Flips
/// triangles to one orientation, with positive volume if closed, else that of most of the area.
/// Keeps the component with most landmarks, the largest of these. A valid mesh keeps all its ids;
/// a boundary loop that touches only itself, e.g. closed lips, stays open. Surfaces with handles or
/// without orientation stay invalid. Cost O(#F log #F). Thread-safe.
Prepared prepare(const MeshView& mesh, const std::vector<LandmarkPoint>& landmarks = {},
                 bool weld = true);

/// A wanted correspondence: a on A should map near b on B, e.g. {17, 4} or
/// {17, ism::SurfacePoint{8, {0.2, 0.3, 0.5}}}. An end on an element that prepare() dropped moves
/// to the nearest point of the surface, within 1% of its size; if there is none, the landmark is
/// skipped with a warning, or, if exact, refused.
struct Landmark {
  LandmarkPoint a, b;
  /// If the image of a lies d roots of the area from b, weight · d² / (1 + 44 d²) is added to E per
  /// area, to the end; a wrong landmark hardly pulls. Weights share at most 50. 0: it only guides
  /// the start.
  double weight = 8;
};

/// Two lines of vertices to map onto each other, e.g. lips, eyelids or a midline. Images may slide
/// along the line. A closed line ends with its first vertex.
struct Curve {
  std::vector<int> a, b;  // in order; straight between them
  double weight = 100;    // that of Landmark, shared by the vertices of A
};

/// Boundary conditions. Held ones (§7) need surfaces that are neither closed nor have openings.
enum class Boundary {
  kFree,  // boundaries move freely; A and B correspond where they overlap in the plane
  /// Both boundaries lie along the sides of one square and stay there, so A and B cover each other.
  /// Landmarks on the boundaries (points on their edges become vertices) and arc length between
  /// them define the correspondence; without such landmarks, arc length does, from the points where
  /// the boundaries are closest in a free embedding.
  kFixed,
  kSlide  // as kFixed, but all vertices except for the four corners may slide along their side
};

/// One iteration of the optimiser. Energies are those after the step; areas and energies are in
/// units of the scaled meshes, see Options::keep_scale.
struct IterationLog {
  int iteration = 0;
  /// E = E_Φ - κ (area A' + area B') + ω_R (E_f + E_g), plus the pull of landmarks and curves.
  double energy = 0;
  double map_energy = 0;              // E_Φ, Eq. 4
  double energy_f = 0, energy_g = 0;  // E_f, E_g, symmetric Dirichlet energies of the embeddings
  double mean_distortion = 0;  // E_Φ / (area A' + area B'); 2 for an isometry (default measure)
  double coverage_a = 0, coverage_b = 0;  // area A' / area A, area B' / area B, in [0, 1]
  double omega = 0;                       // ω_L of the accepted step (§5.4)
  double step = 0;                        // s of the accepted step
  double max_step = 0;                    // s_max, at which the first triangle degenerates
  int polygons = 0;                       // of the meta mesh
  double pin_residual = 0;     // largest distance of a pinned vertex from its pin, on the surface
  bool history_reset = false;  // the blended direction did not descend (Algorithm 1, line 14)
  bool quasi_newton = false;   // the step used an earlier factorisation
  double seconds_derivatives = 0, seconds_assembly = 0, seconds_solve = 0, seconds_search = 0;
};

/// The argument of the progress callback.
struct Progress {
  bool is_embedding = true;                 // false: the optimisation runs
  double fraction = 0;                      // of the call, an estimate in [0, 1], never decreasing
  std::string what;                         // a few words, for a progress line
  const IterationLog* iteration = nullptr;  // after each one on the given meshes, else null
};

/// Runs task(0) ... task(n - 1), in any order and on any threads, and returns when all are done.
/// Calls do not overlap, and tasks do not call it.
using ParallelFor = std::function<void(int n, const std::function<void(int)>& task)>;

/// A distortion D(S, d) with S = σ_max² + σ_min² and d = σ_max σ_min, of the singular values of
/// J_Φ: its value and derivatives.
struct StretchDensity {
  double value, S, d, SS, Sd, dd;
};

/// E_Φ (§3.2): D integrated over the covered part A' times `on_a`, plus D over B' times `on_b`. D
/// is called for S ≥ 2 d > 0, is at least 0 and thread-safe, and need not prevent flips.
///
///   ism::DistortionMeasure area = {[](double, double d) {  // (d - 1)², over A'
///     return ism::StretchDensity{(d - 1) * (d - 1), 0, 2 * (d - 1), 0, 0, 2};
///   }, 1, 0};
class DistortionMeasure {
 public:
  using Density = std::function<StretchDensity(double S, double d)>;
  DistortionMeasure(Density density, double on_a, double on_b);

  StretchDensity density(double S, double d) const { return density_(S, d); }
  double on_a() const { return on_a_; }
  double on_b() const { return on_b_; }
  /// True for symmetric_dirichlet(), which has a shorter formula.
  bool is_symmetric_dirichlet() const { return is_symmetric_dirichlet_; }
  bool is_complete() const { return static_cast<bool>(density_); }
  /// Returns E_Φ of an isometry, per area of both surfaces.
  double isometry() const { return 0.5 * (on_a_ + on_b_) * density(2, 1).value; }

 private:
  friend DistortionMeasure symmetric_dirichlet();
  Density density_;
  double on_a_, on_b_;
  bool is_symmetric_dirichlet_ = false;
};

/// ‖J_Φ‖² over B' plus ‖J_Φ⁻¹‖² over A' (Eq. 3). E(Φ) = E(Φ⁻¹); an isometry has 2 per area.
DistortionMeasure symmetric_dirichlet();
/// (1 - σ_min)² + (1 - σ_max)² over A' [Liu et al. 2008]. Not symmetric; an isometry has 0.
DistortionMeasure arap();
/// (1 - 1/σ_min)² + (1 - σ_max)², half over A' and half over B' [Poranne and Lipman 2016].
/// E(Φ) = E(Φ⁻¹); an isometry has 0, up to 1e-12: the kink at σ_min = σ_max is smoothed.
DistortionMeasure sarap();
/// (σ_max - σ_min)² over A'. Not symmetric; a conformal map has 0.
DistortionMeasure asap();

/// Options of the embedding and the optimisation. Lengths are relative to the meshes.
struct Options {
  DistortionMeasure measure = symmetric_dirichlet();
  std::vector<Curve> curves;  // pull to the end, on the given meshes and on coarse levels
  /// Reward for covered area beyond the cost of an isometry: E gains -κ (area A' + area B'), where
  /// κ = max(0, coverage_weight + measure.isometry()). A large weight trades low distortion for
  /// coverage. κ = 0 is the paper's objective, whose global minimum is the empty overlap.
  double coverage_weight = 0.2;
  int max_iterations = 1000;  // ≥ 0, on the given meshes; 0 skips coarse levels, too
  /// Stops when the mean decrease of E over 20 iterations (10 after coarse levels) is below this
  /// fraction of E + κ (area A + area B) per iteration. An iteration without a step counts as one
  /// without decrease, a quasi-Newton step as a fifth of an iteration.
  double tolerance = 3e-4;  // ≥ 0
  /// false: scales both meshes to area 1, or, if a boundary is free and five or more landmarks
  /// agree on another ratio of sizes, to this ratio. true: the meshes share one unit and are not
  /// scaled; areas of 1e-50 to 1e50 work.
  bool keep_scale = false;
  int threads = 0;  // ≥ 0, capped at 4 per processor; 0: one per available processor; results do
                    // not depend on it
  ParallelFor parallel_for;  // replaces std::thread by the caller's job system
  /// Called from the calling thread after each step of the embedding and each iteration, and
  /// several times a second in between. Return false to cancel.
  std::function<bool(const Progress&)> progress;
  /// Cancels the call when set to true, from any thread. Polled between small pieces of work.
  const std::atomic<bool>* stop = nullptr;
  /// > 0: time limit of a call, or of all steps of a Solver together; change() restarts it.
  double max_seconds = std::numeric_limits<double>::infinity();
  /// Vertices of A (of B) that keep their images on the other surface from the start (§4.5). An
  /// image must not lie in a triangle with a pinned vertex. Vertices of A in exact landmarks count
  /// as pinned. A vertex without an image is refused.
  std::vector<int> pins_a, pins_b;
  /// Vertices of A (of B) that keep their planar positions from the start. Refused on closed pairs.
  std::vector<int> fixed_a, fixed_b;
  /// false: landmarks guide the start and pull, see Landmark::weight. true: their images coincide
  /// in the plane throughout, and points become added vertices. Landmarks on the boundaries then
  /// have the same order on A and B; both ends of a landmark lie on held boundaries or none.
  bool exact_landmarks = false;
  /// With given positions, kFixed holds boundaries of any shape; kSlide lets vertices slide that
  /// lie, with both neighbours, on a line parallel to an axis.
  Boundary boundary = Boundary::kFree;
  /// A vertex on the boundary loop of A, of B, that becomes the outline of f(A), of g(B); -1: the
  /// longest loop. The others are openings: free, disjoint, and nothing is mapped into them. Given
  /// positions have outlines of their own.
  int outer_a = -1, outer_b = -1;
  /// Known planar positions, #V_A×2 and #V_B×2, in any unit, e.g. those of a result. They replace
  /// the initial embedding. Landmarks are first pulled together, as by Solver::change().
  Points2 initial_f, initial_g;
  bool weld = true;  // repairs defects with welding; false: without, see prepare()

  /// ≥ 0: Algorithm 1 first runs on decimated surfaces, from about this many vertices per surface
  /// up; each level has about a quarter of the vertices of the next one. 0 is the paper's method.
  /// Exact landmarks, held boundaries, given positions and change() skip them, not the candidates.
  int coarsest = 400;
  /// > 0: refines a surface if half of it lies in triangles with edges longer than this many edges
  /// of the finer surface. Halves such edges, the longest first, at triangles larger than the mean
  /// one of the finer surface divided by refine (by 1, if refine is less), up to twice its number
  /// of triangles. The parts of a given triangle become Delaunay. The shape and the ids of given
  /// vertices stay, see Embedding::added_a. 0: off, as for given positions and as_published.
  double refine = 8;
  /// ≥ 1: number of Hessians in the memory of §5.3; fewer save computer memory. With
  /// omega_start = 0, 1 is PN, projected Newton (§5.1), and more is SPN (§5.3).
  int history_length = 6;
  /// ≥ 0: initial ω_L of §5.4. 0 disables the preconditioner and quasi-Newton steps. Smaller values
  /// suit a start that is good already.
  double omega_start = 1e4;
  /// true: maps surfaces of at most `coarsest` vertices (0: 400) from several starts: the landmarks
  /// alone, with alignments in space, and, for other poses, with ends of limbs whose distances
  /// along the surfaces agree; then brings ends of limbs together. Continues from the map of least
  /// distortion for its coverage, see Result::candidates. Costs a few seconds. false: the landmarks
  /// alone, e.g. if there are many; also for as_published and given positions.
  bool candidates = true;
  /// The paper's constants in place of the library's, for comparison; see paper().
  bool as_published = false;

  /// The published method: as_published, κ = 0 for every measure of the library, ω_L from 1e9 on,
  /// at most 550 iterations, no coarse levels. as_published means: ω_R = 1e-8, α = 1.25, a memory
  /// that decays by 0.5, all steps of the line search, no quasi-Newton steps, no gaps kept, no
  /// minimum coverage. Two bounds beyond the paper remain, on the step length and on the loss of
  /// coverage per step: without them the overlap vanishes in the first iterations.
  static Options paper();
};

/// A vertex added to a mesh: on an edge (the third corner is -1) or in a triangle, as the mean of
/// its corners with positive weights of sum 1. A copy across a cut has one corner, its original.
struct AddedVertex {
  Eigen::Vector3i corners = {-1, -1, -1};
  Eigen::Vector3d weights = {0, 0, 0};
  AddedVertex() = default;
  AddedVertex(int u, int v) : corners(u, v, -1), weights(0.5, 0.5, 0) {}  // in the middle
};

/// Two planar embeddings; Φ = g⁻¹ ∘ f (§4.1).
struct Embedding : Outcome {
  /// The prepared meshes.
  std::shared_ptr<const Prepared> prepared_a = std::make_shared<Prepared>(),
                                  prepared_b = prepared_a;
  /// The embedded meshes: the prepared ones, closed ones cut, followed by the added vertices.
  SharedMesh a = std::make_shared<TriangleMesh>(), b = a;
  /// The added vertices in order: halved edges, copies, then exact landmarks given as points, in
  /// their order, if given at the start. Earlier ones may be corners of later ones.
  std::vector<AddedVertex> added_a, added_b;
  /// The given vertex where a closed surface was cut open for one with a boundary, else -1.
  int opening_a = -1, opening_b = -1;
  /// The factors applied to the given coordinates, see Options::keep_scale.
  double scale_a = 1, scale_b = 1;
  Points2 f, g;  // planar positions of the vertices of `a`, of `b`, about as large as the meshes
  /// Largest planar distance between the two images of a landmark, in domain radii.
  double landmark_distance = 0;
  double seconds = 0;
};

/// A start that was tried on decimated surfaces, see Options::candidates.
struct StartCandidate {
  std::string name;  // "landmarks", "alignment 1, 24 pairs", or "tips 1", ends of limbs
  /// The mean, divided by coverage (relative to the largest possible one: areas may differ), and up
  /// to twice as much if the map misses the landmarks.
  double distortion = std::numeric_limits<double>::infinity();
  int iterations = 0;  // that the start was given
  /// Root of the mean squared distance on B, in roots of the area, between images by its map and by
  /// the best map. If it is large and distortions are similar, this start may be the right one.
  double difference = 0;
};

/// A connected part of A with high distortion: each triangle exceeds an isometry by more than twice
/// as much as the mean does. A landmark at vertex_a helps most.
struct WorstPlace {
  int vertex_a = -1;      // the vertex with the highest distortion around it
  SurfacePoint on_b;      // its image; exists() is false if it is not covered
  double area = 0;        // of the part, relative to the covered area, on A and B together
  double distortion = 0;  // the mean over the part (symmetric_dirichlet())
};

/// The result of compute_map(). Positions exist and are valid if is_usable(status).
struct Result : Outcome {
  Result() { status = Status::kNoMapYet; }
  Points2 f, g;     // final planar positions of the vertices of *start.a and *start.b
  Embedding start;  // the start of the optimisation
  std::vector<StartCandidate> candidates;  // the starts that were tried, the best one first
  IterationLog initial;                    // the energies of the start (iteration 0, no step)
  std::vector<IterationLog> coarse;  // the last iteration on each coarse level, coarsest first
  IterationLog log_begin;            // the state before log[0]
  std::vector<IterationLog> log;     // one entry per iteration on the given meshes
  std::vector<WorstPlace> worst;     // of a complete run, at most 5, see worst_places()
  double seconds = 0;                // of the optimisation; start.seconds has those of the start
  /// The last state: log.back(), or log_begin if the log is empty.
  const IterationLog& final_state() const { return log.empty() ? log_begin : log.back(); }
};

/// The start of compute_map(): embeds both meshes injectively in one plane, with up to 50 landmarks
/// close to each other (§6); more only guide. Maps of decimated surfaces decide how the planes lie
/// on each other (Options::candidates). If an outline blocks itself or a surface is folded sharply,
/// the boundary unfolds from a circle, which may strain the result. kNumericalFailure names the
/// vertex for which rounding leaves no room. Ignores Options::initial_f and initial_g. Other
/// statuses: kDone, kNoMapYet, kInvalidMesh, -Landmarks, -Options, -Pins. Thread-safe.
Embedding initial_embedding(const MeshView& a, const MeshView& b,
                            const std::vector<Landmark>& landmarks = {},
                            const Options& options = {});

/// Maps A onto B: a start from coarse levels (or Options::initial_f / initial_g), then Algorithm 1.
/// Every iterate is injective, decided exactly. Any status. Thread-safe.
///
/// Outcome::warnings reports sizes taken from landmarks, openings that are closed, landmarks
/// that were skipped or fit the mirror image only, and complete runs whose mean distortion (of
/// symmetric_dirichlet()) is above 6 or 1.5 times that of the start.
///
/// Two closed surfaces are mapped through a pillow: the plane, divided by the half-turns about four
/// points, the cones. Four vertices of each surface lie there. The result embeds both surfaces, cut
/// along a path through them; the half-turns, and the translations that they make, take both sides
/// of a cut to each other, and f(A) to where g(B) lies. Edges are halved if there are less than 64
/// vertices. A surface counts as closed if all its openings are shorter than 0.55 roots of its
/// area, e.g. the ends of a tube of ten diameters, and the other surface counts as closed, too: a
/// fan closes each opening, in the embedded mesh only, and is optimised like the rest. outer_a,
/// outer_b, held boundaries, given positions and fixed vertices keep openings open. If only one
/// surface is closed, it is cut open at one place.
Result compute_map(const MeshView& a, const MeshView& b,
                   const std::vector<Landmark>& landmarks = {}, const Options& options = {});

/// compute_map() in steps, for programs with other work to do. One thread at a time may use a
/// Solver. After an exception it can only be destroyed or assigned to.
///
///   ism::Solver solver(a, b, landmarks, options);
///   while (solver.advance(0.008)) draw(solver.result());  // once per frame
class Solver {
 public:
  Solver();  // with two empty meshes
  Solver(const MeshView& a, const MeshView& b, const std::vector<Landmark>& landmarks = {},
         const Options& options = {});
  ~Solver();
  Solver(Solver&& other) noexcept;
  Solver& operator=(Solver&& other) noexcept;

  /// Runs one step of the embedding (some tenths of a second at most for 10,000 vertices, a few
  /// seconds for 100,000) or one iteration. True while there is more to do. After a cancelled step
  /// the next call resumes, with the same bits as without the pause; a stopped iteration starts
  /// anew. After Options::max_seconds all steps return false, until change().
  bool step();
  /// Runs steps for some seconds, at least one step.
  bool advance(double seconds);

  /// Returns the result of compute_map() as if it ended here; on a coarse level, until the run is
  /// stopped, the iterate of the first call there. Valid until the next call of another function.
  const Result& result() const;
  double fraction() const;  // of the whole run, an estimate; only change() lowers it

  /// Continues from the current map and its ω_L with other landmarks and options; `boundary`,
  /// `keep_scale` and given positions keep their values. New landmarks are pulled together first;
  /// exact ones are then joined, with added vertices if needed. Pins hold their current images. If
  /// an argument is refused, nothing changes, and the outcome gives the reason.
  Outcome change(const std::vector<Landmark>& landmarks, const Options& options);

 private:
  std::unique_ptr<detail::Run> run_;
};

/// A curve on a surface: the segment from point i to i + 1 lies in the triangle of point i.
using Polyline = std::vector<SurfacePoint>;

/// The common refinement of A and B (§3.1): polygons of 3 to 6 corners with one connectivity and
/// two geometries. Neighbouring polygons share vertices, which are identified combinatorially.
struct MetaMesh {
  /// The refined meshes, as given or as embedded; ids refer to them.
  SharedMesh a = std::make_shared<TriangleMesh>(), b = a;
  /// Per vertex of `a` and of `b`, the representative of all copies of the same vertex of the
  /// surface, e.g. welded ones. -1: dropped. Empty: each vertex represents itself.
  std::vector<int> same_a, same_b;
  Points3 on_a, on_b;               // #M×3, the vertices on either surface
  Points2 plane;                    // #M×2, the vertices in the common plane
  std::vector<int> face_a, face_b;  // per polygon, its triangles of A and of B
  /// The corners of polygon p are offsets[p] to offsets[p + 1] - 1, counter-clockwise.
  std::vector<int> offsets = {0};
  std::vector<int> corners;  // #C, vertex ids
  /// #C×3, barycentric coordinates of the corners in face_a and in face_b.
  Points3 corner_a, corner_b;

  int n_polygons() const { return static_cast<int>(face_a.size()); }
};

/// The distortion of one polygon of the meta mesh, on which the map is affine.
struct PolygonDistortion {
  double area_a = 0, area_b = 0;        // of the polygon on either surface
  double sigma_min = 1, sigma_max = 1;  // singular values of the Jacobian of Φ
  double density = 2;                   // symmetric Dirichlet energy per area on A and B; ≥ 2
};

/// Totals of PolygonDistortion, weighted by area_a + area_b.
struct DistortionSummary {
  double mean = 0;                      // E_Φ / (area A' + area B'), 2 is an isometry
  double median = 0, p95 = 0;           // quantiles of the density, by area
  double largest = 0;                   // of the density
  double sigma_min = 0, sigma_max = 0;  // the extremes
  double area_a = 0, area_b = 0;        // covered
};

/// Φ = g⁻¹ ∘ f as a function, in both directions, in the caller's ids. Elements that prepare()
/// dropped are not covered; welded copies have one image. Copies share their data. All queries are
/// const and thread-safe. A point query costs O(polygons in its triangle).
///
///   ism::SurfaceMap map(result);
///   ism::SurfacePoint image = map.forward_vertex(7);
///   if (image.exists()) use(map.position_on_b(image));
class SurfaceMap {
 public:
  SurfaceMap();  // maps nothing; its status is kNoMapYet
  /// Overlays two embeddings of surfaces with boundaries, not scaled, in linear time.
  SurfaceMap(const MeshView& a, const MeshView& b, const Points2& f, const Points2& g);
  /// The map of compute_map(). If there is none, the status is that of the result.
  explicit SurfaceMap(const Result& result);
  explicit SurfaceMap(const Embedding& start);  // the map of an initial embedding

  /// Returns kDone if the map is usable; else kInvalidMesh, kInvalidPositions, kNumericalFailure,
  /// kNoOverlap or, for more than 16 million polygons, kMemoryLimit; then no point is covered.
  Status status() const;
  const std::string& message() const;
  const TriangleMesh& mesh(Side side, Ids ids = Ids::kGiven) const;
  Points2 planar_positions(Side side) const;  // f or g, of mesh(side, Ids::kEmbedded)
  /// True for maps of two closed surfaces: every point has an image, in both directions, but for
  /// those that lie in an opening that was closed.
  bool is_closed() const;
  /// The period of the motions x → ±x + period (i, j) of closed maps, see compute_map(); else 0.
  double period() const;

  /// Barycentric coordinates must be ≥ 0 with sum 1. Ids out of range are not covered.
  SurfacePoint forward(const SurfacePoint& on_a) const;   // Φ
  SurfacePoint backward(const SurfacePoint& on_b) const;  // Φ⁻¹
  SurfacePoint forward_vertex(int a) const;
  SurfacePoint backward_vertex(int b) const;
  std::vector<SurfacePoint> forward_vertices() const;   // one per vertex of A
  std::vector<SurfacePoint> backward_vertices() const;  // one per vertex of B
  /// Returns the image on B of a path along edges of A, given by its vertices: in order, a polyline
  /// for each covered stretch, with a point on every crossed edge of B. The path is interrupted
  /// between vertices without a common edge.
  std::vector<Polyline> forward_path(const std::vector<int>& vertices) const;
  std::vector<Polyline> backward_path(const std::vector<int>& vertices) const;  // from B to A
  /// Returns the position in space, in the unit of the mesh; NaN if there is no such face.
  Eigen::Vector3d position_on_a(const SurfacePoint& p) const;
  Eigen::Vector3d position_on_b(const SurfacePoint& p) const;
  MetaMesh meta_mesh(Ids ids = Ids::kGiven) const;
  /// Returns the distortion of every polygon of meta_mesh(). Surfaces are scaled as by
  /// compute_map(), or to area 1 for maps made otherwise; keep_scale: not scaled.
  std::vector<PolygonDistortion> distortion(bool keep_scale = false) const;

 private:
  friend TriangleMesh remesh(const SurfaceMap& map, Side side);
  std::shared_ptr<const detail::MapData> data_;
};

/// Returns the mesh of one side with positions on the other surface. Vertices without an image are
/// in no triangle and lie on the first image. Linear cost, thread-safe.
TriangleMesh remesh(const SurfaceMap& map, Side side);

/// A linear map of attributes between elements, as a sparse matrix by rows: value i is the sum of
/// weights[k] times the given value sources[k] for k from offsets[i] to offsets[i + 1] - 1. Weights
/// of a row are at least 0 and sum to 1, up to rounding; uncovered elements have none.
struct Transfer {
  int n_sources = 0;  // number of source elements
  std::vector<int> offsets = {0};
  std::vector<int> sources;
  std::vector<double> weights;

  int rows() const { return static_cast<int>(offsets.size()) - 1; }
  bool covers(int i) const { return offsets.data()[i] < offsets.data()[i + 1]; }

  /// Maps rows of sources to rows of elements, zeros if uncovered; to none if their number differs.
  Values apply(const Values& values) const;

  /// Does the same for arrays: the `columns` numbers of an element are contiguous, the next element
  /// begins `stride` bytes further. Integers are rounded and clamped to T. Uncovered elements keep
  /// their values. False, with nothing read or written, if numbers of elements differ.
  template <class T>
  bool apply(const T* values, std::ptrdiff_t n_values, std::ptrdiff_t stride, int columns,
             T* result, std::ptrdiff_t n_results, std::ptrdiff_t result_stride) const {
    if (n_values != n_sources || n_results != rows()) return false;
    const char* const from = reinterpret_cast<const char*>(values);
    char* const to = reinterpret_cast<char*>(result);
    for (int i = 0; i < rows(); ++i)
      for (int c = 0; c < columns && covers(i); ++c) {
        double sum = 0;
        for (int k = offsets.data()[i]; k < offsets.data()[i + 1]; ++k)
          sum += weights.data()[k] * detail::number_at<T>(from + sources.data()[k] * stride +
                                                          c * std::ptrdiff_t{sizeof(T)});
        const T value = detail::rounded<T>(sum);
        std::memcpy(to + i * result_stride + c * std::ptrdiff_t{sizeof(T)}, &value, sizeof(T));
      }
    return true;
  }
};

/// Returns the transfer from elements of one mesh to all corners of the meta mesh: rows as in
/// MetaMesh::corners. It loses neither detail nor seams. Cost O(n log n); all are thread-safe.
Transfer to_meta(const MetaMesh& meta, Side side, Element element);

/// Returns the transfer from corners of the meta mesh to vertices or corners of one mesh (the mean,
/// if corners at a vertex differ), or to its faces (the mean over the covered part). Welded copies
/// get the same row. Inverts to_meta() of the same side. Cost O(n log n), as of all below.
Transfer from_meta(const MetaMesh& meta, Side side, Element element);

/// Returns the transfer from elements of the mesh on side `from` to elements of the other mesh:
/// to_meta(), then from_meta(). A coarser mesh loses detail, and corners of a face may lie on both
/// sides of a seam of texture coordinates; to_meta() alone avoids both.
Transfer transfer(const MetaMesh& meta, Side from, Element element, Element target);

/// Interpolates vertices linearly from A at t = 0 (meta.on_a) to B at t = 1 (meta.on_b).
Points3 linear_morph(const MetaMesh& meta, double t);

/// Summarises the distortions of SurfaceMap::distortion(). Sorts: O(n log n).
DistortionSummary summarize(const std::vector<PolygonDistortion>& polygons);

/// Returns at most `most` parts of A, those that raise the mean distortion most. Cost O(n log n).
std::vector<WorstPlace> worst_places(const SurfaceMap& map, int most = 5);

}  // namespace ISM_ABI
}  // namespace ism

#endif  // ISM_HPP

// ==== end of the public part; the file that defines ISM_IMPLEMENTATION gets the rest =============

#if defined(ISM_IMPLEMENTATION) && !defined(ISM_HPP_IMPLEMENTED)
#define ISM_HPP_IMPLEMENTED

// Keeps the variables of the next short loop in registers; g++ -O2 leaves them in memory otherwise.
#if defined(__GNUC__) && !defined(__clang__)
#define ISM_UNROLL _Pragma("GCC unroll 8")
#else
#define ISM_UNROLL
#endif

#include <algorithm>
#include <cfenv>
#include <chrono>
#include <exception>
#include <initializer_list>
#include <iterator>
#include <queue>
#include <tuple>
#include <utility>

#ifndef ISM_NO_THREADS
#include <condition_variable>
#include <mutex>
#include <thread>
#ifdef __linux__
#include <sched.h>
#endif
#endif

// Products and sums are not fused, so all compilers and processors compute the same bits, unless
// flags of an x86-64 build ask for fused instructions (-march=x86-64-v3). The compiler may fuse
// within Eigen's functions: here, none of them multiplies and adds.
#ifndef __FMA__
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__) && defined(__FP_FAST_FMA)
#define ISM_FUSING_IS_OFF
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif
#endif

// ==== [3] NOTATION ===============================================================================
//
//   A, B          the meshes; a, b in names. f, g their embeddings
//   A ⊔ B         their disjoint union (JointSurface): ids of B follow those of A
//   x             all unknowns (Eq. 5), f and then g, a row per vertex of A ⊔ B
//   tA, tB        triangles of A and B; ta, tb their ids in A ⊔ B
//   h             a half-edge; u, v, w vertices; e an edge of a pair of triangles, 0 to 5
//   ρ             a polygon f(tA) ∩ g(tB) of the meta mesh; a its planar area
//   R             rest shape of a triangle in its own plane (columns b - a, c - a); J = [..] R⁻¹
//   F, G          the Jacobians J_f, J_g of a pair tA, tB
//   K             ‖adj(G) F‖², a factor of both Dirichlet terms of ρ
//   S, d          σ_max² + σ_min² = K / det² G and σ_max σ_min = det F / det G, of J_Φ = G⁻¹ F
//   w             the density of E_Φ in the plane: of the symmetric Dirichlet energy (Eq. 4)
//                 w = K (1 / det³ F + 1 / det³ G)
//   κ             reward for covered area; subtracts κ (1 / det F + 1 / det G) from w
//   E_ρ           a w, the summand of a polygon
//   E             Σ E_ρ + ω_R (E_f + E_g), that is E_Φ - κ (area A' + area B') + ω_R (E_f + E_g)
//   H, H_+        Hessian of E, projected Hessian
//   d, s, s_max   direction, step, step at which the first triangle degenerates
//   ω_L, L, M     preconditioner weight, Laplacian, mass matrix (§5.4); Q = Lᵀ M L
//   perp(d)       d turned by -90 degrees; cross(a, b) = a_x b_y - a_y b_x

// ==== [4] SMALL TYPES AND HELPERS ================================================================
//
// Purpose:    vectors and matrices of the plane and of space, arrays indexed by int, parallel tasks
// Note:       plain structs, because Eigen's expressions take much longer to compile

namespace ism {
inline namespace ISM_ABI {
namespace detail {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kPi = 3.14159265358979323846;

/// Unlike std::pow, it uses products only, which round alike on all systems.
inline double power(double x, int n) {
  double result = 1;
  for (int i = 0; i < n; ++i) result *= x;
  return result;
}

struct Vec2 {
  double x = 0, y = 0;
};
inline Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
inline Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
inline Vec2 operator-(Vec2 a) { return {-a.x, -a.y}; }
inline Vec2 operator*(double s, Vec2 a) { return {s * a.x, s * a.y}; }
inline Vec2& operator+=(Vec2& a, Vec2 b) { return a = a + b; }
inline Vec2& operator-=(Vec2& a, Vec2 b) { return a = a - b; }
inline bool operator==(Vec2 a, Vec2 b) { return a.x == b.x && a.y == b.y; }
inline bool operator!=(Vec2 a, Vec2 b) { return !(a == b); }
inline double dot(Vec2 a, Vec2 b) { return a.x * b.x + a.y * b.y; }
inline double squared_norm(Vec2 a) { return dot(a, a); }
inline double norm(Vec2 a) { return std::sqrt(dot(a, a)); }
inline Vec2 lower(Vec2 a, Vec2 b) { return {(std::min)(a.x, b.x), (std::min)(a.y, b.y)}; }
inline Vec2 upper(Vec2 a, Vec2 b) { return {(std::max)(a.x, b.x), (std::max)(a.y, b.y)}; }

/// Returns twice the signed area of the triangle (0, a, b).
inline double cross(Vec2 a, Vec2 b) { return a.x * b.y - a.y * b.x; }

/// Rotates d by -90 degrees: the outward normal of a counter-clockwise edge of direction d.
inline Vec2 perp(Vec2 d) { return {d.y, -d.x}; }

struct Vec3 {
  double x = 0, y = 0, z = 0;
  double& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
  double operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
};
inline Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator*(double s, const Vec3& a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vec3& operator+=(Vec3& a, const Vec3& b) { return a = a + b; }
inline double dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline double squared_norm(const Vec3& a) { return dot(a, a); }
inline double norm(const Vec3& a) { return std::sqrt(dot(a, a)); }
inline Vec3 normalized(const Vec3& a) { return 1 / norm(a) * a; }
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline bool is_finite(const Vec3& a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}
inline Vec3 unit3(int k) { return {k == 0 ? 1.0 : 0.0, k == 1 ? 1.0 : 0.0, k == 2 ? 1.0 : 0.0}; }

/// A 2×2 matrix, by columns.
struct Mat2 {
  double entry[4] = {0, 0, 0, 0};
  double& operator()(int r, int c) { return entry[2 * c + r]; }
  double operator()(int r, int c) const { return entry[2 * c + r]; }
};
inline Mat2 columns(Vec2 a, Vec2 b) { return {{a.x, a.y, b.x, b.y}}; }
inline Mat2 diagonal(double s) { return {{s, 0, 0, s}}; }
inline Mat2 operator+(const Mat2& a, const Mat2& b) {
  return {{a.entry[0] + b.entry[0], a.entry[1] + b.entry[1], a.entry[2] + b.entry[2],
           a.entry[3] + b.entry[3]}};
}
inline Mat2 operator*(double s, const Mat2& a) {
  return {{s * a.entry[0], s * a.entry[1], s * a.entry[2], s * a.entry[3]}};
}
inline Mat2& operator+=(Mat2& a, const Mat2& b) { return a = a + b; }
inline Vec2 operator*(const Mat2& a, Vec2 v) {
  return {a.entry[0] * v.x + a.entry[2] * v.y, a.entry[1] * v.x + a.entry[3] * v.y};
}
inline Mat2 operator*(const Mat2& a, const Mat2& b) {
  return columns(a * Vec2{b.entry[0], b.entry[1]}, a * Vec2{b.entry[2], b.entry[3]});
}
inline Mat2 transposed(const Mat2& a) { return {{a.entry[0], a.entry[2], a.entry[1], a.entry[3]}}; }
inline double determinant(const Mat2& a) {
  return a.entry[0] * a.entry[3] - a.entry[2] * a.entry[1];
}
inline Mat2 adjugate(const Mat2& a) { return {{a.entry[3], -a.entry[1], -a.entry[2], a.entry[0]}}; }
inline Mat2 inverse(const Mat2& a) { return 1 / determinant(a) * adjugate(a); }
inline double squared_norm(const Mat2& a) {
  return a.entry[0] * a.entry[0] + a.entry[1] * a.entry[1] + a.entry[2] * a.entry[2] +
         a.entry[3] * a.entry[3];
}
inline bool is_finite(const Mat2& a) {
  return std::all_of(a.entry, a.entry + 4, [](double x) { return std::isfinite(x); });
}

inline int rows_of(const Points2& x) { return static_cast<int>(x.rows()); }
inline Vec2 row2(const Points2& x, int i) {
  const double* p = x.data() + 2 * static_cast<std::ptrdiff_t>(i);
  return {p[0], p[1]};
}
inline Vec3 row3(const Points3& x, int i) {
  const double* p = x.data() + 3 * static_cast<std::ptrdiff_t>(i);
  return {p[0], p[1], p[2]};
}
inline void set_row(Points2& x, int i, Vec2 p) {
  double* row = x.data() + 2 * static_cast<std::ptrdiff_t>(i);
  row[0] = p.x, row[1] = p.y;
}
inline void set_row(Points3& x, int i, const Vec3& p) {
  double* row = x.data() + 3 * static_cast<std::ptrdiff_t>(i);
  row[0] = p.x, row[1] = p.y, row[2] = p.z;
}

/// A vector indexed by int, the type of every id in this file (and in Eigen and mesh files).
template <class T>
class Array : public std::vector<T> {
  using Base = std::vector<T>;
  static std::size_t count(int n) { return static_cast<std::size_t>(n); }

 public:
  Array() = default;
  explicit Array(int n, const T& value = T()) : Base(count(n), value) {}
  Array(const Base& items) : Base(items) {}

  int size() const { return static_cast<int>(Base::size()); }
  T& operator[](int i) { return begin()[i]; }
  const T& operator[](int i) const { return begin()[i]; }
  T* begin() { return Base::data(); }
  T* end() { return Base::data() + Base::size(); }
  const T* begin() const { return Base::data(); }
  const T* end() const { return Base::data() + Base::size(); }

  void push_back(T value) {
    if (Base::capacity() == 0) reserve(8);
    Base::push_back(std::move(value));
  }
  void assign(int n, const T& value) { Base::assign(count(n), value); }
  void resize(int n, const T& value = T()) { Base::resize(count(n), value); }
  void reserve(int n) { Base::reserve(count(n)); }
  void append(const T* items, int n) { Base::insert(Base::end(), items, items + n); }
};

/// Returns 0 to n - 1.
inline Array<int> numbers_below(int n) {
  Array<int> numbers(n);
  for (int i = 0; i < n; ++i) numbers[i] = i;
  return numbers;
}

/// Returns the numbers from 0 to n - 1 for which is(i) is true.
template <class Is>
Array<int> numbers_where(int n, const Is& is) {
  Array<int> numbers;
  for (int i = 0; i < n; ++i)
    if (is(i)) numbers.push_back(i);
  return numbers;
}

template <class T>
void sort_unique(Array<T>& items) {
  std::sort(items.begin(), items.end());
  items.resize(static_cast<int>(std::unique(items.begin(), items.end()) - items.begin()));
}

/// Items by group: group g has item[start[g]] to item[start[g + 1] - 1].
template <class T>
struct Groups {
  Array<int> start;
  Array<T> item;
  int size(int g) const { return start[g + 1] - start[g]; }
  template <class Visit>
  void for_each_in(int g, const Visit& visit) const {
    for (int i = start[g]; i < start[g + 1]; ++i) visit(item[i]);
  }
};

/// Sorts items into n groups: for_each(add) calls add(group, item) for all of them, twice.
template <class T, class ForEach>
Groups<T> grouped(int n, const ForEach& for_each) {
  Groups<T> groups;
  groups.start.assign(n + 1, 0);
  for_each([&](int g, const T&) { ++groups.start[g + 1]; });
  for (int g = 0; g < n; ++g) groups.start[g + 1] += groups.start[g];
  Array<int> fill = groups.start;
  groups.item.resize(fill[n]);
  for_each([&](int g, const T& item) { groups.item[fill[g]++] = item; });
  return groups;
}

/// A part of a sentence, written as {"triangle ", f, " has no area"}.
struct Word {
  std::string text;
  Word(const char* t) : text(t) {}
  Word(const std::string& t) : text(t) {}
  Word(int n) : text(std::to_string(n)) {}
};
using Words = std::initializer_list<Word>;

inline std::string sentence(Words words) {
  std::string result;
  for (const Word& word : words) result += word.text;
  return result;
}

inline std::string join(const std::vector<int>& ids) {
  std::string result;
  for (int id : ids) result += (result.empty() ? "" : ", ") + std::to_string(id);
  return result;
}

inline ElementId vertex_id(Side side, int v) { return {side, Element::kVertex, v}; }
inline const char* letter(Side side) { return side == Side::kA ? "A" : "B"; }
inline Side other(Side side) { return side == Side::kA ? Side::kB : Side::kA; }

/// Fills an outcome; returns false for `return fail(...)`.
inline bool fail(Outcome& outcome, Status status, Words message,
                 const std::vector<ElementId>& ids = {}) {
  outcome.status = status;
  outcome.message = sentence(message);
  outcome.ids = ids;
  return false;
}

class Timer {
 public:
  double seconds() const {  // since construction or the last lap
    return std::chrono::duration<double>(Clock::now() - start_).count();
  }
  double lap() {
    const double passed = seconds();
    start_ = Clock::now();
    return passed;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

/// A lock for a few instructions without allocations. Not std::mutex: <mutex> may be missing where
/// a job system has threads.
class SpinLock {
 public:
  explicit SpinLock(std::atomic_flag& flag) : flag_(flag) {
    while (flag_.test_and_set(std::memory_order_acquire)) {
    }
  }
  SpinLock(const SpinLock&) = delete;
  ~SpinLock() { flag_.clear(std::memory_order_release); }

 private:
  std::atomic_flag& flag_;
};

/// Services of one call: threads, progress reports and cancellation.
///
/// Tasks do not depend on the number of threads and write to memory of their own, so results have
/// the same bits for any number of threads. An exception of a task ends a run once all tasks in
/// progress are done. Stopping skips no task: long tasks poll is_stopped(), which then stays true,
/// and may return early; the caller discards their results.
class Executor {
 public:
  using Task = std::function<void(int)>;

  explicit Executor(const Options& options);

  /// Runs task(0) ... task(n - 1), in any order and in parallel.
  void run(int n, const Task& task) const;

  /// Runs task(begin, end) over [0, n) in blocks of a fixed size.
  void run_blocks(int n, int block, const std::function<void(int, int)>& task) const {
    run((n + block - 1) / block, [&](int k) { task(k * block, (std::min)(n, (k + 1) * block)); });
  }

  /// True once the caller cancels or time is up. Callable from any thread.
  bool is_stopped() const {
    if (stop_status_ != Status::kUnfinished) return true;
    if (stop_ != nullptr && stop_->load(std::memory_order_relaxed))
      stop_status_ = Status::kCancelled;
    else if (seconds() > max_seconds_)
      stop_status_ = Status::kTimeLimit;
    return stop_status_ != Status::kUnfinished;
  }

  /// Returns kCancelled or kTimeLimit once stopped, kUnfinished before.
  Status stop_status() const { return stop_status_; }

  /// Stops and restarts the clock; the thread that continues the work calls resume().
  void pause() { seconds_before_ = seconds(); }
  void resume() {
    clock_.lap();
    stop_status_ = Status::kUnfinished;
    is_side_by_side_ = false;  // it stays set if a job system throws
#ifndef ISM_NO_THREADS
    caller_ = std::this_thread::get_id();
#endif
  }

  double fraction() const { return progress_.fraction; }
  void finish() { progress_.fraction = 1; }

  void set_embedding_share(double share) { embedding_share_ = share; }

  /// Reports progress; for the calling thread only.
  void tell(bool is_embedding, double fraction, Words what, const IterationLog* iteration) const;

 private:
  bool run_side_by_side(int n, const Task& task) const;
  double seconds() const { return seconds_before_ + clock_.seconds(); }

  void tell_again() const;
  void tick() const;

#ifndef ISM_NO_THREADS
  bool is_caller() const { return std::this_thread::get_id() == caller_; }
  std::thread::id caller_ = std::this_thread::get_id();
#else
  bool is_caller() const { return !hook_; }
#endif
  ParallelFor hook_;                                  // none for a single thread
  mutable std::atomic<bool> is_side_by_side_{false};  // tasks are running
  std::function<bool(const Progress&)> tell_;
  const std::atomic<bool>* stop_;
  double max_seconds_, seconds_before_ = 0;
  double embedding_share_ = 0.1;  // of the time of the call
  Timer clock_;
  mutable Timer since_told_;
  mutable Progress progress_;
  mutable std::atomic<Status> stop_status_{Status::kUnfinished};
};

// ==== [5] EXACT PREDICATES (paper §6, Shewchuk 1996; Edelsbrunner and Mücke 1990) ================
//
// Purpose:    the exact sign of the area of a planar triangle; and a nonzero one, with ties broken
//             by a symbolic perturbation.
// Invariants: orient2d is exact for coordinates that are 0 or in [2^-400, 2^400] by magnitude
//             (flush_tiny() enforces the lower bound); oriented() is the sign under one fixed
//             infinitesimal displacement of all vertices, so any set of its answers is consistent.
// Fails:      never. The caller must exclude non-finite coordinates.

inline constexpr double kTiniest = 0x1p-400;  // 2^-400: products of differences of such numbers,
                                              // and the tails of the products, do not underflow
inline constexpr double kLargest = 0x1p400;   // 2^400

inline double flush_tiny(double x) { return std::abs(x) < kTiniest ? 0.0 : x; }
inline Vec2 flush_tiny(Vec2 p) { return {flush_tiny(p.x), flush_tiny(p.y)}; }

/// A sum of non-overlapping doubles, smallest first (Shewchuk's expansion).
struct Expansion {
  double term[12];
  int size = 0;

  /// Adds b exactly (grow-expansion with two-sum).
  void add(double b) {
    int kept = 0;
    for (int i = 0; i < size; ++i) {
      const double a = term[i];
      const double sum = a + b;
      const double virtual_b = sum - a;
      const double tail = (a - (sum - virtual_b)) + (b - virtual_b);
      if (tail != 0) term[kept++] = tail;
      b = sum;
    }
    if (b != 0) term[kept++] = b;
    size = kept;
  }

  /// Adds a·b exactly (two-product [Dekker 1971]; std::fma is inexact in some libraries, e.g.
  /// MinGW's). volatile prevents fusing the rounded product into the additions; products of halves
  /// and their differences are exact, fused or not.
  void add_product(double a, double b) {
    const volatile double product = a * b;
    const double a_high = high_half(a), a_low = a - a_high;
    const double b_high = high_half(b), b_low = b - b_high;
    add(a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low));
    add(product);
  }

  /// Returns x rounded to 26 bits; the rest has 26 bits and a sign [Veltkamp 1968].
  static double high_half(double x) {
    const volatile double scaled = (0x1p27 + 1) * x;
    const volatile double difference = scaled - x;
    return scaled - difference;
  }

  /// Returns the sum, rounded; the sign is exact.
  double value() const {
    double sum = 0;
    for (int i = 0; i < size; ++i) sum += term[i];
    return sum;
  }
};

inline double orient2d_exact(Vec2 a, Vec2 b, Vec2 c) {
  Expansion sum;
  const Vec2 p[4] = {a, b, c, a};
  for (int i = 0; i < 3; ++i) {
    sum.add_product(p[i].x, p[i + 1].y);
    sum.add_product(-p[i].y, p[i + 1].x);
  }
  return sum.value();
}

inline constexpr double kErrorBound = 3.3306690738754716e-16;  // (3 + 16 ε) ε, Shewchuk's stage A

/// Returns twice the area of a triangle; the sign is exact: positive if a, b, c turn left, 0 if
/// they are collinear. `certain`: least ratio of area and products that needs no exact arithmetic.
inline double orient2d(Vec2 a, Vec2 b, Vec2 c, double certain = kErrorBound) {
  const double left = (a.x - c.x) * (b.y - c.y);
  const double right = (a.y - c.y) * (b.x - c.x);
  const double det = left - right;
  if (std::abs(det) > certain * (std::abs(left) + std::abs(right))) return det;
  return orient2d_exact(a, b, c);
}

/// Does the same to twelve digits: cancellation leaves 13 of 16.
inline double accurate_area(Vec2 a, Vec2 b, Vec2 c) { return orient2d(a, b, c, 1e-3); }

/// A point and its rank in the perturbation; smaller ids are displaced more. A point that a
/// half-turn has moved is displaced the other way, a fixed one is not: sign -1, 0.
struct LabelledPoint {
  Vec2 p;
  int id;
  int sign = 1;
};

/// Returns the sign of the collinear triple a, b, c (ids ascending) after the displacement
/// p_i += sign_i (ε^(4^i), ε^(2·4^i)): the first non-vanishing coefficient of the determinant in ε.
inline bool perturbed_sign(const LabelledPoint& a, const LabelledPoint& b, const LabelledPoint& c) {
  if (a.sign != 0 && b.p.y != c.p.y) return (b.p.y > c.p.y) == (a.sign > 0);
  if (a.sign != 0 && b.p.x != c.p.x) return (c.p.x > b.p.x) == (a.sign > 0);
  if (b.sign != 0 && c.p.y != a.p.y) return (c.p.y > a.p.y) == (b.sign > 0);
  if (a.sign * b.sign != 0) return a.sign * b.sign < 0;
  if (b.sign != 0 && a.p.x != c.p.x) return (a.p.x > c.p.x) == (b.sign > 0);
  if (a.p.y != b.p.y) return (a.p.y > b.p.y) == (c.sign > 0);
  if (a.p.x != b.p.x) return (b.p.x > a.p.x) == (c.sign > 0);
  return false;
}

/// True if a, b, c turn left under the symbolic perturbation. Ids must differ.
inline bool oriented(const LabelledPoint& a, const LabelledPoint& b, const LabelledPoint& c) {
  const double det = orient2d(a.p, b.p, c.p);
  if (det != 0) return det > 0;
  const LabelledPoint* q[3] = {&a, &b, &c};
  bool even = true;
  const auto order = [&](int i, int j) {
    if (q[i]->id > q[j]->id) {
      std::swap(q[i], q[j]);
      even = !even;
    }
  };
  order(0, 1), order(1, 2), order(0, 1);
  return perturbed_sign(*q[0], *q[1], *q[2]) == even;
}

/// False if flags or processor settings break exact arithmetic: additions are reordered (by
/// -fassociative-math; clang sets no macro) or do not round to nearest, or comparisons ignore NaN.
/// Reads its numbers from memory, so no compiler evaluates them.
inline bool arithmetic_is_sound() {
  const volatile double one = 1, tiny = 0x1p-60, half_ulp = 0x1p-53, infinity = kInfinity;
  const volatile double quiet_nan = std::numeric_limits<double>::quiet_NaN();
  const double a = one, b = tiny, inf = infinity, nan = quiet_nan, same_nan = quiet_nan;
  const double sum = a + b, virtual_b = sum - a, tail = (a - (sum - virtual_b)) + (b - virtual_b);
  const bool rounds_to_nearest = sum == a && a - b == a && -a - b == -a && tail == b;
  Expansion product;  // (1 + 2^-52)² = (1 + 2^-51) + 2^-104
  product.add_product(a + 2 * half_ulp, a + 2 * half_ulp);
  const Vec2 p = {0.5 * a, 0.5 * a + half_ulp}, q = {12 * a, 12 * a}, r = {24 * a, 24 * a};
  return rounds_to_nearest && product.term[0] == 0x1p-104 && orient2d(p, q, r) > 0 &&
         orient2d(q, p, r) < 0 && orient2d(q, r, {0.5 * a, 0.5 * a}) == 0 && !std::isfinite(inf) &&
         !std::isfinite(nan) && nan != same_nan;  // nothing here traps
}

// ==== [6] HALF-EDGE MESH =========================================================================
//
// Purpose:    connectivity of a triangulated surface, and the isometric rest frame of each triangle
//             (the orthonormal coordinate systems of §3.2).
// Invariants: half-edge h = 3 f + k runs from corner k of face f to corner k + 1; out[v] is an
//             outgoing half-edge of v, the boundary one if v lies on the boundary, so a
//             counter-clockwise turn from it visits every face of v.
// Fails:      never, for meshes without problems in part [16].

inline int next(int h) { return h % 3 == 2 ? h - 2 : h + 1; }
inline int prev(int h) { return h % 3 == 0 ? h + 2 : h - 1; }

/// A motion x → sign x + shift of the plane: a translation or a half-turn.
struct Motion {
  double sign = 1;
  Vec2 shift;
};
inline Vec2 operator*(const Motion& g, Vec2 x) { return g.sign * x + g.shift; }
inline Motion operator*(const Motion& g, const Motion& h) {
  return {g.sign * h.sign, g.sign * h.shift + g.shift};
}
inline Motion inverse(const Motion& g) { return {g.sign, -g.sign * g.shift}; }
inline bool operator==(const Motion& g, const Motion& h) {
  return g.sign == h.sign && g.shift == h.shift;
}
inline Motion half_turn(Vec2 center) { return {-1, 2 * center}; }

/// The side of a pillow's square for surfaces of area 1, so the pillow has about that area, too.
inline constexpr double kPillowSide = 0x1.6ap-1;

/// Where the corners of a closed surface's triangles lie in the plane, which is divided by the
/// half-turns about four cones into copies of a pillow (part [14]). Empty for other surfaces.
struct Pillow {
  Array<Motion> place;        // per half-edge: its tail v lies at place x_v
  Array<int> cones;           // vertices, fixed; the angles around them sum to π
  double side = kPillowSide;  // of the square, kPillowSide times a power of two
  bool is_empty() const { return place.empty(); }
  bool is_cone(int v) const { return std::find(cones.begin(), cones.end(), v) != cones.end(); }
};

struct HalfEdgeMesh {
  int n_vertices = 0;
  int n_faces = 0;
  Array<int> tail;       // #F·3, the start vertex of a half-edge
  Array<int> twin;       // #F·3, the opposite half-edge, or -1 on the boundary
  Array<int> out;        // #V, an outgoing half-edge
  Array<int> boundary;   // boundary half-edges, loop by loop, their faces on the left
  Array<int> loop;       // starts of loops in `boundary`, and its end
  Array<int> component;  // per component (A and B in A ⊔ B), its first loop; then the end
  Pillow pillow;

  int loops() const { return loop.size() - 1; }

  int tip(int h) const { return tail[next(h)]; }
  int corner(int f, int k) const { return tail[3 * f + k]; }
  bool on_boundary(int v) const { return twin[out[v]] < 0; }
  /// Returns the next outgoing half-edge counter-clockwise, or -1 past the boundary.
  int turn(int h) const { return twin[prev(h)]; }

  /// Calls visit(h) for the outgoing half-edges of v, counter-clockwise; h / 3 are all its faces.
  template <class Visit>
  void for_each_outgoing(int v, Visit visit) const {
    for (int h = out[v]; h >= 0;) {
      visit(h);
      h = turn(h);
      if (h == out[v]) return;
    }
  }
};

/// Returns the place of a half-edge's tail in the plane of its triangle.
inline Vec2 place_of(const HalfEdgeMesh& m, const Points2& x, int h) {
  const Vec2 p = row2(x, m.tail[h]);
  return m.pillow.is_empty() ? p : m.pillow.place[h] * p;
}
inline Vec2 corner_place(const HalfEdgeMesh& m, const Points2& x, int f, int k) {
  return place_of(m, x, 3 * f + k);
}
/// Returns -1 if a half-turn puts a half-edge's tail in its place, else 1.
inline double sign_of(const HalfEdgeMesh& m, int h) {
  return m.pillow.is_empty() ? 1 : m.pillow.place[h].sign;
}

/// Returns the motion that takes the places in the twin's triangle into those of h.
inline Motion motion_across(const HalfEdgeMesh& m, int h) {
  if (m.pillow.is_empty()) return {};
  const Array<Motion>& place = m.pillow.place;
  const int t = m.twin[h];
  return m.pillow.is_cone(m.tail[h]) ? place[next(h)] * inverse(place[t])
                                     : place[h] * inverse(place[next(t)]);
}

/// Returns a position as the predicates require it: tiny coordinates become zero; on a pillow, all
/// become multiples of 2^-50 sides, like the shifts of motions, so motions are exact.
inline Vec2 on_grid(Vec2 p, double side) {
  const double shift = 6 * (side / kPillowSide);  // half an ulp of [4, 8) is 2^-51
  return {(p.x + shift) - shift, (p.y + shift) - shift};
}
inline Vec2 usable(const HalfEdgeMesh& m, Vec2 p) {
  return m.pillow.is_empty() ? flush_tiny(p) : on_grid(p, m.pillow.side);
}

/// Returns the motion among those of a pillow that takes q nearest to p.
inline Motion nearest_motion(const HalfEdgeMesh& m, Vec2 p, Vec2 q) {
  const double period = 2 * m.pillow.side;
  Motion nearest;
  double least = kInfinity;
  for (double sign : {1.0, -1.0}) {
    if (m.pillow.is_empty()) break;
    const Vec2 way = p - sign * q;
    const Vec2 shift = {period * std::round(way.x / period), period * std::round(way.y / period)};
    if (norm(way - shift) >= least) continue;
    least = norm(way - shift);
    nearest = {sign, shift};
  }
  return nearest;
}

/// Largest valence for which algorithms of quadratic cost in the valence are used.
inline constexpr int kHub = 128;

/// An edge as a sortable record (smaller vertex, larger vertex, half-edge).
struct EdgeUse {
  int lo, hi, half_edge;
  EdgeUse(int u, int v, int h) : lo((std::min)(u, v)), hi((std::max)(u, v)), half_edge(h) {}
  bool operator<(const EdgeUse& o) const {
    return lo != o.lo ? lo < o.lo : hi != o.hi ? hi < o.hi : half_edge < o.half_edge;
  }
  bool same_edge(const EdgeUse& o) const { return lo == o.lo && hi == o.hi; }
};

/// Returns the edges of triangles; vertex(h) is the start of half-edge h.
template <class Vertex>
Array<EdgeUse> sorted_edges(int n_half_edges, const Vertex& vertex) {
  Array<EdgeUse> uses;
  uses.reserve(n_half_edges);
  for (int h = 0; h < n_half_edges; ++h) uses.push_back({vertex(h), vertex(next(h)), h});
  std::sort(uses.begin(), uses.end());
  return uses;
}

inline Array<EdgeUse> sorted_edges(const Triangles& F) {
  return sorted_edges(static_cast<int>(F.size()), [&](int h) { return F.data()[h]; });
}

/// Calls visit(begin, end) for every run of equal edges in a sorted list.
template <class Visit>
void for_each_edge(const Array<EdgeUse>& uses, Visit visit) {
  for (int begin = 0, end = 0; begin < uses.size(); begin = end) {
    while (end < uses.size() && uses[end].same_edge(uses[begin])) ++end;
    visit(begin, end);
  }
}

/// Disjoint sets of the numbers below n; the smallest number represents its set.
class DisjointSets {
 public:
  explicit DisjointSets(int n = 0) : parent_(numbers_below(n)) {}
  int find(int i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  /// Merges two sets; false if they were one set already.
  bool unite(int i, int j) {
    i = find(i), j = find(j);
    parent_[(std::max)(i, j)] = (std::min)(i, j);
    return i != j;
  }

 private:
  Array<int> parent_;
};

inline int count_components(const HalfEdgeMesh& m) {
  DisjointSets faces(m.n_faces);
  int n = m.n_faces;
  for (int h = 0; h < m.tail.size(); ++h)
    if (m.twin[h] >= 0) n -= faces.unite(h / 3, m.twin[h] / 3);
  return n;
}

/// Lists the boundary loops of a mesh of one component.
inline void trace_boundary(HalfEdgeMesh& m) {
  Array<char> seen(m.tail.size(), 0);
  m.boundary.clear();
  m.loop.assign(1, 0);
  for (int start = 0; start < m.tail.size(); ++start) {
    if (m.twin[start] >= 0 || seen[start]) continue;
    for (int h = start; m.twin[h] < 0 && !seen[h]; h = m.out[m.tip(h)]) {
      seen[h] = 1;
      m.boundary.push_back(h);
    }
    m.loop.push_back(m.boundary.size());
  }
  m.component.assign(1, 0);
  m.component.push_back(m.loops());
}

/// Finds an outgoing half-edge of every vertex, the boundary one if it exists.
inline void find_outgoing(HalfEdgeMesh& m) {
  m.out.assign(m.n_vertices, -1);
  for (int h = m.tail.size() - 1; h >= 0; --h)
    if (m.out[m.tail[h]] < 0 || m.twin[h] < 0) m.out[m.tail[h]] = h;
}

inline HalfEdgeMesh build_half_edges(int n_vertices, const Triangles& F) {
  HalfEdgeMesh m;
  const Array<EdgeUse> uses = sorted_edges(F);
  m.n_vertices = n_vertices;
  m.n_faces = static_cast<int>(F.rows());
  m.tail.resize(3 * m.n_faces);
  for (int h = 0; h < 3 * m.n_faces; ++h) m.tail[h] = F(h / 3, h % 3);
  m.twin.assign(3 * m.n_faces, -1);
  for_each_edge(uses, [&](int begin, int end) {
    if (end - begin != 2) return;
    m.twin[uses[begin].half_edge] = uses[begin + 1].half_edge;
    m.twin[uses[begin + 1].half_edge] = uses[begin].half_edge;
  });
  find_outgoing(m);
  trace_boundary(m);
  return m;
}

/// Returns how many edges each vertex is away from the nearest one in `queue`; -1: unreachable.
inline Array<int> distances_in_edges(const HalfEdgeMesh& m, Array<int> queue) {
  Array<int> distance(m.n_vertices, -1);
  for (int v : queue) distance[v] = 0;
  for (int i = 0; i < queue.size(); ++i) {
    const int u = queue[i];
    m.for_each_outgoing(u, [&](int h) {
      for (int v : {m.tip(h), m.tail[prev(h)]})
        if (distance[v] < 0) distance[v] = distance[u] + 1, queue.push_back(v);
    });
  }
  return distance;
}

/// A half-edge mesh with the intrinsic geometry of the energies.
struct Surface {
  HalfEdgeMesh mesh;
  Points3 vertices;                // scaled to total area 1 unless asked otherwise
  double scale = 1;                // factor applied to the given positions
  std::vector<AddedVertex> added;  // the last vertices, which were not given
  Array<int> given;                // the caller's ids of the others
  double total_area = 0;
  Array<double> area;        // #F
  Array<Mat2> rest_inverse;  // #F, R⁻¹ of Eq. 2: J = [b'-a' c'-a'] R⁻¹

  Vec3 corner(int f, int k) const { return row3(vertices, mesh.corner(f, k)); }
  double edge_length(int h) const {
    return norm(row3(vertices, mesh.tip(h)) - row3(vertices, mesh.tail[h]));
  }
  /// Returns the caller's id of a vertex; for an added one, the id of an adjacent vertex.
  int given_id(int v) const {
    const int n = mesh.n_vertices - static_cast<int>(added.size());
    while (v >= n) v = added.data()[v - n].corners[0];
    return v < given.size() ? given[v] : v;
  }
};

/// Returns isometric planar coordinates of a triangle: columns b - a and c - a, b on the x-axis.
inline Mat2 rest_frame(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 u = b - a, v = c - a;
  const double length = norm(u);
  return {{length, 0, dot(u, v) / length, norm(cross(u, v)) / length}};
}

/// Does the same from the lengths |b - a|, |c - b|, |a - c|, with Kahan's formula for the area,
/// which keeps thin triangles positive.
inline Mat2 rest_frame(double ab, double bc, double ca) {
  double l[3] = {ab, bc, ca};
  std::sort(l, l + 3);
  const double area = 0.25 * std::sqrt((l[2] + (l[1] + l[0])) * (l[0] - (l[2] - l[1])) *
                                       (l[0] + (l[2] - l[1])) * (l[2] + (l[1] - l[0])));
  return {{ab, 0, (ab * ab + (ca - bc) * (ca + bc)) / (2 * ab), 2 * area / ab}};
}

/// Sets areas and frames; frame(f) is R of triangle f.
template <class Frame>
void set_rest_frames(const Frame& frame, Surface& s) {
  s.area.resize(s.mesh.n_faces);
  s.rest_inverse.resize(s.mesh.n_faces);
  s.total_area = 0;
  for (int f = 0; f < s.mesh.n_faces; ++f) {
    const Mat2 R = frame(f);
    s.area[f] = 0.5 * determinant(R);
    s.rest_inverse[f] = inverse(R);
    s.total_area += s.area[f];
  }
}

inline void compute_rest_frames(Surface& s) {
  set_rest_frames([&](int f) { return rest_frame(s.corner(f, 0), s.corner(f, 1), s.corner(f, 2)); },
                  s);
}

/// Returns the power of two that scales the largest coordinate to [1, 2): exact, and squares
/// neither over- nor underflow in any unit.
inline double unit_scale(double largest) {
  return largest > 0 ? std::ldexp(1.0, std::clamp(-std::ilogb(largest), -1000, 1000)) : 1;
}
inline double unit_scale(const Points3& vertices) {
  return unit_scale(vertices.size() > 0 ? vertices.cwiseAbs().maxCoeff() : 0);
}

/// Scales a surface to area 1. First translates it to the origin along each axis on which it is far
/// away: scaling alone would round its shape away there, and the translation is exact if the least
/// coordinate is at least half of the largest one [Sterbenz 1974].
inline void normalize(Surface& s) {
  const auto scale = [&](double factor) {
    for (int i = 0; i < s.vertices.size(); ++i) s.vertices.data()[i] *= factor;
    s.scale *= factor;
  };
  scale(unit_scale(s.vertices));
  for (int c = 0; c < 3; ++c) {
    const double low = s.vertices.col(c).minCoeff(), high = s.vertices.col(c).maxCoeff();
    const double nearest = low > 0 ? low : (std::min)(high, 0.0);  // of [low, high] to 0
    if (high - low > std::abs(nearest)) continue;
    for (int v = 0; v < s.mesh.n_vertices; ++v) s.vertices(v, c) -= nearest;
  }
  double area = 0;
  for (int f = 0; f < s.mesh.n_faces; ++f)
    area += 0.5 * norm(cross(s.corner(f, 1) - s.corner(f, 0), s.corner(f, 2) - s.corner(f, 0)));
  scale(1 / std::sqrt(area));
}

inline Surface build_surface(HalfEdgeMesh mesh, const Points3& vertices, bool keep_scale) {
  Surface s;
  s.mesh = std::move(mesh);
  s.vertices = vertices;
  if (!keep_scale) normalize(s);
  compute_rest_frames(s);
  return s;
}

inline Surface build_surface(const TriangleMesh& mesh, bool keep_scale) {
  return build_surface(build_half_edges(static_cast<int>(mesh.vertices.rows()), mesh.triangles),
                       mesh.vertices, keep_scale);
}

// ---- pairs of surfaces and their disjoint union ----

struct SurfacePair {
  Surface a, b;
};

/// The disjoint union A ⊔ B: vertices, triangles and half-edges of B follow those of A.
struct JointSurface : Surface {
  int n_a = 0;         // vertices of A
  int faces_a = 0;     // triangles of A
  int boundary_a = 0;  // boundary half-edges of A
  double area_a = 0, area_b = 0;
  double scale_a = 1, scale_b = 1;
  Array<int> own_id;  // per vertex, Surface::given_id() of A or B
};

template <class Points>
Points stacked(const Points& a, const Points& b) {
  Points all(a.rows() + b.rows(), a.cols());
  std::copy(a.data(), a.data() + a.size(), all.data());
  std::copy(b.data(), b.data() + b.size(), all.data() + a.size());
  return all;
}

inline Points2 rows_between(const Points2& x, int begin, int end) {
  Points2 rows(end - begin, 2);
  std::copy(x.data() + 2 * std::ptrdiff_t{begin}, x.data() + 2 * std::ptrdiff_t{end}, rows.data());
  return rows;
}

inline JointSurface join(const SurfacePair& pair) {
  const Surface &a = pair.a, &b = pair.b;
  JointSurface s;
  static_cast<Surface&>(s) = a;
  s.n_a = a.mesh.n_vertices;
  s.faces_a = a.mesh.n_faces;
  s.boundary_a = a.mesh.boundary.size();
  s.area_a = a.total_area, s.area_b = b.total_area;
  s.scale_a = a.scale, s.scale_b = b.scale;
  for (const Surface* side : {&a, &b})
    for (int v = 0; v < side->mesh.n_vertices; ++v) s.own_id.push_back(side->given_id(v));
  s.total_area += b.total_area;
  HalfEdgeMesh& m = s.mesh;
  const int first = 3 * s.faces_a;  // the first half-edge of B
  m.n_vertices += b.mesh.n_vertices;
  m.n_faces += b.mesh.n_faces;
  for (int v : b.mesh.tail) m.tail.push_back(s.n_a + v);
  for (int h : b.mesh.twin) m.twin.push_back(h < 0 ? h : first + h);
  for (int h : b.mesh.out) m.out.push_back(first + h);
  for (int h : b.mesh.boundary) m.boundary.push_back(first + h);
  for (int i = 1; i <= b.mesh.loops(); ++i) m.loop.push_back(s.boundary_a + b.mesh.loop[i]);
  m.component.push_back(m.loops());
  const Pillow& pillow_b = b.mesh.pillow;
  m.pillow.place.append(pillow_b.place.data(), pillow_b.place.size());
  for (int v : pillow_b.cones) m.pillow.cones.push_back(s.n_a + v);
  s.vertices = stacked(a.vertices, b.vertices);
  s.area.append(b.area.data(), b.area.size());
  s.rest_inverse.append(b.rest_inverse.data(), b.rest_inverse.size());
  return s;
}

// ==== [7] OVERLAY (paper §3.1, §4.4, §5.2) =======================================================
//
// Purpose:    computes the meta mesh of two planar embeddings as polygons ρ = f(t_A) ∩ g(t_B), and
//             decides exactly whether an embedding is injective.
// Invariants: every decision is the sign of orient2d of three input vertices, mixed triples under
//             the symbolic perturbation. So neighbouring polygons agree on their common corners,
//             and every polygon has 3 to 6 corners.
// Fails:      on injective embeddings only above kMostPolygons polygons. Cost: linear in the
//             polygons, unless a triangle of A meets B in many separate pieces; O((a + b +
//             crossings) log(a b)) for boundaries of a and b edges, unless boxes of many disjoint
//             edges meet; O(#F log a b) where loops are left without polygons.

/// The limit of an overlay. Meshes of five million triangles reach it. So can small ones: around
/// two vertices of m and n edges that lie over each other, there are m n / 4 polygons.
inline constexpr int kMostPolygons = 1 << 24;

/// A triangle of A and a triangle of B.
struct TrianglePair {
  int ta = 0, tb = 0;  // ids in A ⊔ B
  Motion motion = {};  // takes the places in t_B to those in t_A
};

/// One polygon of the meta mesh. Its boundary is a counter-clockwise cycle of pieces, each on an
/// edge of t_A (0, 1, 2) or t_B (3, 4, 5), three bits per piece. Piece i starts at corner i: the
/// first vertex of its edge if piece i-1 lies on the same triangle, else the crossing of both
/// edges. So the code alone holds the combinatorics.
struct OverlayPolygon : TrianglePair {
  int count = 0;
  std::uint32_t code = 0;

  int piece(int i) const { return static_cast<int>((code >> (3 * i)) & 7u); }
  bool has(int edge) const {
    for (int i = 0; i < count; ++i)
      if (piece(i) == edge) return true;
    return false;
  }
  void push(int edge) { code |= static_cast<std::uint32_t>(edge) << (3 * count++); }
};

/// Returns the motion of a half-edge's tail to the plane of a polygon's triangle of A.
inline Motion motion_in(const HalfEdgeMesh& m, const OverlayPolygon& p, int h) {
  if (m.pillow.is_empty()) return {};
  return h / 3 == p.tb ? p.motion * m.pillow.place[h] : m.pillow.place[h];
}

inline bool boxes_meet(Vec2 lo, Vec2 hi, Vec2 other_lo, Vec2 other_hi) {
  return lo.x <= other_hi.x && lo.y <= other_hi.y && other_lo.x <= hi.x && other_lo.y <= hi.y;
}

/// A bounding volume hierarchy: axis-parallel boxes of items, and of runs of 2^k consecutive items,
/// as a binary tree. Absent items have empty boxes.
class BoxTree {
 public:
  /// Clears the tree for n items, all absent; reuses its memory.
  void reset(int n) {
    for (leaves_ = 1; leaves_ < n;) leaves_ *= 2;
    lo_.assign(2 * leaves_, {kInfinity, kInfinity});
    hi_.assign(2 * leaves_, {-kInfinity, -kInfinity});
  }

  /// Sets the box of an item. Once all are set, join() computes the boxes of runs.
  void set(int i, Vec2 lo, Vec2 hi) {
    lo_[leaves_ + i] = lo;
    hi_[leaves_ + i] = hi;
  }
  void join() {
    for (int i = leaves_ - 1; i >= 1; --i) join_children(i);
  }

  /// Changes the box of an item and of the runs that contain it.
  void change(int i, Vec2 lo, Vec2 hi) {
    set(i, lo, hi);
    for (int k = (leaves_ + i) / 2; k >= 1; k /= 2) join_children(k);
  }
  void remove(int i) { change(i, {kInfinity, kInfinity}, {-kInfinity, -kInfinity}); }

  /// Returns true if is_it(i) holds for an item; skips boxes for which may_be_in(lo, hi) is false.
  template <class MayBeIn, class IsIt>
  bool find(const MayBeIn& may_be_in, const IsIt& is_it, int node = 1) const {
    if (!(lo_[node].x <= hi_[node].x) || !may_be_in(lo_[node], hi_[node])) return false;
    if (node >= leaves_) return is_it(node - leaves_);
    return find(may_be_in, is_it, 2 * node) || find(may_be_in, is_it, 2 * node + 1);
  }

  /// Calls visit(i, j) for all items i of this tree and j of the other one whose boxes meet.
  template <class Visit>
  void for_each_pair(const BoxTree& other, const Visit& visit, int i = 1, int j = 1) const {
    if (!boxes_meet(lo_[i], hi_[i], other.lo_[j], other.hi_[j])) return;
    const bool leaf_i = i >= leaves_, leaf_j = j >= other.leaves_;
    if (leaf_i && leaf_j) return visit(i - leaves_, j - other.leaves_);
    if (leaf_j || (!leaf_i && i <= j)) {
      for_each_pair(other, visit, 2 * i, j);
      for_each_pair(other, visit, 2 * i + 1, j);
    } else {
      for_each_pair(other, visit, i, 2 * j);
      for_each_pair(other, visit, i, 2 * j + 1);
    }
  }

 private:
  void join_children(int i) {
    lo_[i] = lower(lo_[2 * i], lo_[2 * i + 1]);
    hi_[i] = upper(hi_[2 * i], hi_[2 * i + 1]);
  }

  int leaves_ = 1;
  Array<Vec2> lo_, hi_;
};

/// Builds the tree of the segments begin to end - 1 of m.boundary.
inline void build_tree(const HalfEdgeMesh& m, const Points2& x, int begin, int end, BoxTree& tree) {
  tree.reset(end - begin);
  for (int i = begin; i < end; ++i) {
    const int h = m.boundary[i];
    const Vec2 p = row2(x, m.tail[h]), q = row2(x, m.tip(h));
    tree.set(i - begin, lower(p, q), upper(p, q));
  }
  tree.join();
}

// ---- injectivity of one embedding (§4.4) ----

/// Returns true if the closed segments pq and rs have a common point; exact.
inline bool segments_touch(Vec2 p, Vec2 q, Vec2 r, Vec2 s) {
  const double r_side = orient2d(p, q, r), s_side = orient2d(p, q, s);
  const double p_side = orient2d(r, s, p), q_side = orient2d(r, s, q);
  if (r_side == 0 && s_side == 0 && p_side == 0 && q_side == 0)  // collinear
    return boxes_meet(lower(p, q), upper(p, q), lower(r, s), upper(r, s));
  const auto straddles = [](double u, double v) { return !(u > 0 && v > 0) && !(u < 0 && v < 0); };
  return straddles(r_side, s_side) && straddles(p_side, q_side);
}

/// Returns true if consecutive segments pq and qr fold back, so that they share more than q.
inline bool turns_back(Vec2 p, Vec2 q, Vec2 r) {
  return orient2d(p, q, r) == 0 && dot(p - q, r - q) > 0;
}

inline bool all_triangles_positive(const HalfEdgeMesh& m, const Points2& x) {
  for (int f = 0; f < m.n_faces; ++f)
    if (!(orient2d(corner_place(m, x, f, 0), corner_place(m, x, f, 1), corner_place(m, x, f, 2)) >
          0))
      return false;
  return true;
}

/// Returns true if the angles around every interior vertex add up to 2π, given positive triangles.
/// A fan of positive triangles turns by less than π per step, so it turns once exactly if it passes
/// once from the lower into the upper half-plane; comparisons decide that exactly.
inline bool angle_sums_are_full(const HalfEdgeMesh& m, const Points2& x) {
  if (!m.pillow.is_empty()) return true;  // see is_injective()
  for (int v = 0; v < m.n_vertices; ++v) {
    if (m.on_boundary(v)) continue;
    const Vec2 p = row2(x, v);
    const auto upper_half = [&](int h) {
      const Vec2 q = row2(x, m.tip(h));
      return q.y > p.y || (q.y == p.y && q.x > p.x);
    };
    int turns = 0;
    m.for_each_outgoing(v, [&](int h) { turns += !upper_half(h) && upper_half(m.turn(h)); });
    if (turns != 1) return false;
  }
  return true;
}

/// Returns true if loops first_loop to last_loop - 1 intersect neither themselves nor each other.
inline bool loops_are_simple(const HalfEdgeMesh& m, const Points2& x, int first_loop,
                             int last_loop) {
  const int begin = m.loop[first_loop];
  bool simple = true;
  BoxTree tree;
  build_tree(m, x, begin, m.loop[last_loop], tree);
  tree.for_each_pair(tree, [&](int i, int j) {
    if (i >= j || !simple) return;
    const int h = m.boundary[begin + i], k = m.boundary[begin + j];
    const Vec2 p = row2(x, m.tail[h]), q = row2(x, m.tip(h));
    const Vec2 r = row2(x, m.tail[k]), t = row2(x, m.tip(k));
    if (m.tip(h) == m.tail[k])
      simple = !turns_back(p, q, t);
    else if (m.tip(k) == m.tail[h])
      simple = !turns_back(r, p, q);
    else
      simple = !segments_touch(p, q, r, t);
  });
  return simple;
}

/// Returns true if a simple loop runs counter-clockwise: convex at its leftmost, lowest vertex.
inline bool runs_counter_clockwise(const HalfEdgeMesh& m, const Points2& x, int loop) {
  const int begin = m.loop[loop], n = m.loop[loop + 1] - begin;
  const auto p = [&](int i) { return row2(x, m.tail[m.boundary[begin + i % n]]); };
  int least = 0;
  for (int i = 1; i < n; ++i)
    if (p(i).x < p(least).x || (p(i).x == p(least).x && p(i).y < p(least).y)) least = i;
  return orient2d(p(least + n - 1), p(least), p(least + 1)) > 0;
}

/// Returns true if the loops of every component are simple and disjoint, and of several loops at
/// most one, the outline, runs counter-clockwise.
inline bool boundaries_are_simple(const HalfEdgeMesh& m, const Points2& x) {
  for (int c = 0; c + 1 < m.component.size(); ++c) {
    const int first = m.component[c], last = m.component[c + 1];
    if (!loops_are_simple(m, x, first, last)) return false;
    int outer = 0;
    for (int i = first; i < last && last - first > 1; ++i) outer += runs_counter_clockwise(m, x, i);
    if (outer > 1) return false;
  }
  return true;
}

inline bool coordinates_are_usable(const Points2& x) {
  for (int i = 0; i < x.size(); ++i) {
    const double magnitude = std::abs(x.data()[i]);
    if (magnitude != 0 && !(magnitude >= kTiniest && magnitude <= kLargest)) return false;
  }
  return true;
}

/// Returns true if an embedding is injective, the guarantee of the library (§4.4): triangles
/// positive, angle sums 2π, boundaries simple. A positively oriented piecewise affine map of a disk
/// with a simple boundary is injective [Lipman 2014]. With openings, the winding numbers of all
/// loops around a point add up to its number of preimages: one inside the outline and outside the
/// openings, which wind the other way, else none. On A ⊔ B, f and g are injective separately.
///
/// On a pillow, positive triangles are enough. The angles around a vertex sum to a multiple of 2π,
/// at a cone to one of π; with V vertices, the angles of all 2 V - 4 triangles sum to (2 V - 4) π,
/// the least such sum. So each is 2π or π, and the pillow is covered once, as at the start.
inline bool is_injective(const HalfEdgeMesh& m, const Points2& x) {
  return coordinates_are_usable(x) && all_triangles_positive(m, x) && angle_sums_are_full(m, x) &&
         boundaries_are_simple(m, x);
}

// ---- intersection of two triangles ----

/// A triangle with labelled corners; labels are vertex ids in A ⊔ B.
struct LabelledTriangle {
  LabelledPoint corner[3];
  const LabelledPoint& operator[](int k) const { return corner[k]; }
};

inline LabelledTriangle labelled(const HalfEdgeMesh& m, const Points2& x, int f,
                                 const Motion& motion = {}) {
  LabelledTriangle t;
  for (int k = 0; k < 3; ++k) {
    const int h = 3 * f + k, v = m.tail[h];
    t.corner[k] = {row2(x, v), v};
    if (m.pillow.is_empty()) continue;
    const Motion g = motion * m.pillow.place[h];
    t.corner[k] = {g * row2(x, v), v, m.pillow.is_cone(v) ? 0 : g.sign > 0 ? 1 : -1};
  }
  return t;
}

/// Which corners of one triangle lie left of which edges of the other: bit 3 i + k is set if corner
/// i lies left of edge k.
struct Sides {
  std::uint32_t bits = 0;

  bool left(int i, int k) const { return ((bits >> (3 * i + k)) & 1u) != 0; }
  void set(int i, int k, bool left) {
    const std::uint32_t bit = 1u << (3 * i + k);
    bits = left ? bits | bit : bits & ~bit;
  }
  /// Returns the bits of one corner.
  std::uint32_t of(int i) const { return (bits >> (3 * i)) & 7u; }
  /// Puts the bits of the next corner in place of each one's.
  Sides of_next() const { return {(bits >> 3) | ((bits & 7u) << 6)}; }
  /// Exchanges corners and edges.
  Sides transposed() const {
    return {(bits & 0421u) | ((bits & 042u) << 2) | ((bits & 4u) << 4) | ((bits & 0210u) >> 2) |
            ((bits & 0100u) >> 4)};
  }
};

/// Evaluates oriented() for all corners of a and edges of b, and for those of b and a. The 18 areas
/// share nine differences and one bound of their rounding errors; below it, each decides alone.
inline void compare_sides(const LabelledTriangle& a, const LabelledTriangle& b, Sides& a_side,
                          Sides& b_side) {
  Vec2 d[3][3], most;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) {
      d[i][k] = b[k].p - a[i].p;
      most = upper(most, {std::abs(d[i][k].x), std::abs(d[i][k].y)});
    }
  const double bound = kErrorBound * (2 * (most.x * most.y));
  std::uint32_t a_bits = 0, b_bits = 0;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) {
      const int j = i == 2 ? 0 : i + 1, l = k == 2 ? 0 : k + 1;
      const double of_a = cross(d[i][k], d[i][l]), of_b = cross(d[i][k], d[j][k]);
      const bool a_left = std::abs(of_a) > bound ? of_a > 0 : oriented(b[k], b[l], a[i]);
      const bool b_left = std::abs(of_b) > bound ? of_b > 0 : oriented(a[i], a[j], b[k]);
      a_bits |= std::uint32_t{a_left} << (3 * i + k);
      b_bits |= std::uint32_t{b_left} << (3 * k + i);
    }
  a_side.bits = a_bits;
  b_side.bits = b_bits;
}

/// Decides for corners i of a and j of b on one cone by their sectors: each ray on the border of
/// the common part starts inside the other triangle. False if there is no common part.
inline bool meet_at_cone(int i, int j, Sides& a_side, Sides& b_side) {
  const int i_next = (i + 1) % 3, i_prev = (i + 2) % 3, j_next = (j + 1) % 3, j_prev = (j + 2) % 3;
  // Rays of a: edge i to i_next on the right, edge i_prev to it on the left; the same for b.
  const bool a_right_in = a_side.left(i_next, j) && a_side.left(i_next, j_prev);
  const bool a_left_in = a_side.left(i_prev, j) && a_side.left(i_prev, j_prev);
  const bool b_right_in = !a_side.left(i_next, j) && a_side.left(i_prev, j);
  b_side.set(j_next, i, !a_side.left(i_next, j));
  b_side.set(j_prev, i, a_side.left(i_next, j_prev));
  b_side.set(j_next, i_prev, a_side.left(i_prev, j));
  b_side.set(j_prev, i_prev, !a_side.left(i_prev, j_prev));
  a_side.set(i, j, a_right_in);
  b_side.set(j, i, !a_right_in);
  a_side.set(i, j_prev, a_left_in);
  b_side.set(j, i_prev, !a_left_in);
  return a_right_in || b_right_in;
}

/// Intersects two triangles; count is 0 if they do not overlap. Two edges cross if the ends of each
/// lie on different sides of the other; there, the polygon goes on along the edge that enters.
inline OverlayPolygon intersect(const LabelledTriangle& a, const LabelledTriangle& b) {
  constexpr std::uint32_t kInside = 7;
  Sides a_side, b_side;
  compare_sides(a, b, a_side, b_side);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3 && a[i].sign == 0; ++j)
      if (b[j].sign == 0 && a[i].p == b[j].p && !meet_at_cone(i, j, a_side, b_side)) return {};
  const Sides a_next = a_side.of_next(), b_next = b_side.of_next();
  const Sides b_parts = Sides{b_side.bits ^ b_next.bits}.transposed();
  const Sides crossed = {(a_side.bits ^ a_next.bits) & b_parts.bits};
  const Sides a_enters = {crossed.bits & a_next.bits}, a_leaves = {crossed.bits & ~a_next.bits};
  const Sides b_leaves = {crossed.transposed().bits & ~b_next.bits};
  const auto has_part_of_a = [&](int i) {  // at cones, an edge may seem to enter or to leave only
    return (a_side.of(i) == kInside || a_enters.of(i) != 0) &&
           (a_next.of(i) == kInside || a_leaves.of(i) != 0);
  };
  OverlayPolygon polygon;
  int e = 0;
  while (e < 3 && !has_part_of_a(e)) ++e;
  if (e == 3 && b_side.of(0) != kInside) return polygon;
  const int first = e;
  do {
    polygon.push(e);
    const int base = e < 3 ? 0 : 3, edge = e - base;
    const std::uint32_t through = base == 0 ? a_leaves.of(edge) : b_leaves.of(edge);
    e = through == 0 ? base + (edge == 2 ? 0 : edge + 1) : 3 - base + static_cast<int>(through / 2);
  } while (e != first && polygon.count < 6);
  return polygon;
}

// ---- the overlay of two embeddings ----

/// The polygons of an overlay, and memory that the next overlay reuses.
struct Overlay {
  Array<OverlayPolygon> polygons;
  bool is_too_large = false;  // some polygons are missing
  Array<char> is_covered;     // per triangle of A: by its polygons, so no others are missing
  Array<int> newest;          // per triangle of A: its last polygon, or -1
  Array<int> older;           // per polygon: the previous one in the same triangle of A, or -1
  Array<int> mark;       // per triangle of B: the last triangle of A that it was tested against,
  Array<Motion> marked;  // and where, on a pillow
  Array<TrianglePair> again;  // and in what other places
  Array<TrianglePair> seeds;  // known to overlap
  Array<char> is_crossed;     // per boundary loop: it crosses a loop of the other mesh
  BoxTree boundary_a, boundary_b;
};

class OverlayBuilder {
 public:
  OverlayBuilder(const JointSurface& s, const Points2& x, Overlay& overlay)
      : s_(s), m_(s.mesh), x_(x), overlay_(overlay) {}

  void build() {
    overlay_.is_too_large = false;
    overlay_.polygons.clear();
    overlay_.older.clear();
    overlay_.seeds.clear();
    overlay_.is_covered.assign(s_.faces_a, 0);
    overlay_.newest.assign(s_.faces_a, -1);
    overlay_.mark.assign(m_.n_faces, -1);
    overlay_.marked.resize(m_.pillow.is_empty() ? 0 : m_.n_faces);
    if (!m_.pillow.is_empty()) {
      seed_cone();
      return flood_seeds();
    }
    seed_boundary_crossings();
    flood_seeds();
    seed_other_loops();
  }

 private:
  void flood_seeds() {
    while (!overlay_.seeds.empty()) {
      const TrianglePair seed = overlay_.seeds.back();
      overlay_.seeds.pop_back();
      flood(seed);
      overlay_.is_too_large = overlay_.polygons.size() > kMostPolygons;
      if (overlay_.is_too_large) overlay_.seeds.clear();
    }
  }

  /// Finds the polygons of the seed's triangle ta that are connected to it within ta. Polygons
  /// across the edges of ta become seeds, edge by edge, so that they are taken together.
  void flood(const TrianglePair& seed) {
    const int ta = seed.ta, begin = overlay_.polygons.size();
    if (overlay_.is_covered[ta]) return;
    if (ta != marked_) mark_known(ta);
    if (is_marked(seed)) return;
    const LabelledTriangle a = labelled(m_, x_, ta);
    add(seed, a);
    bool is_covered = overlay_.polygons.size() > begin;
    for (int i = begin; i < overlay_.polygons.size(); ++i) {
      const OverlayPolygon p = overlay_.polygons[i];
      for (int k = 0; k < p.count; ++k) {
        if (p.piece(k) < 3) continue;
        const int h = 3 * p.tb + p.piece(k) - 3, twin = m_.twin[h];
        is_covered = is_covered && twin >= 0;
        if (twin >= 0) add({ta, twin / 3, p.motion * motion_across(m_, h)}, a);
      }
    }
    overlay_.is_covered[ta] = is_covered;
    for (int e = 0; e < 3; ++e) {
      const int twin = m_.twin[3 * ta + e];
      if (twin < 0 || overlay_.is_covered[twin / 3]) continue;
      for (int i = begin; i < overlay_.polygons.size(); ++i) {
        const OverlayPolygon& p = overlay_.polygons[i];
        if (!p.has(e)) continue;
        overlay_.seeds.push_back({twin / 3, p.tb, motion_across(m_, twin) * p.motion});
      }
    }
  }

  void mark_known(int ta) {
    marked_ = ta;
    overlay_.again.clear();
    for (int i = overlay_.newest[ta]; i >= 0; i = overlay_.older[i]) mark(overlay_.polygons[i]);
  }

  void mark(const TrianglePair& p) {
    const bool is_first = overlay_.mark[p.tb] != p.ta;
    overlay_.mark[p.tb] = p.ta;
    if (m_.pillow.is_empty()) return;
    if (is_first)
      overlay_.marked[p.tb] = p.motion;
    else
      overlay_.again.push_back(p);
  }

  bool is_marked(const TrianglePair& p) const {
    if (overlay_.mark[p.tb] != p.ta) return false;
    if (m_.pillow.is_empty() || overlay_.marked[p.tb] == p.motion) return true;
    for (const TrianglePair& other : overlay_.again)
      if (other.tb == p.tb && other.motion == p.motion) return true;
    return false;
  }

  /// Seeds a pillow where triangles of both surfaces meet at the first cone.
  void seed_cone() {
    const Array<int>& cones = m_.pillow.cones;
    const int u = cones[0], v = cones[cones.size() / 2];
    m_.for_each_outgoing(u, [&](int h) {
      m_.for_each_outgoing(v, [&](int g) {
        const Vec2 cone = place_of(m_, x_, h);
        const Motion motion = nearest_motion(m_, cone, place_of(m_, x_, g));
        overlay_.seeds.push_back({h / 3, g / 3, motion});
        overlay_.seeds.push_back({h / 3, g / 3, half_turn(cone) * motion});
      });
    });
  }

  void add(const TrianglePair& pair, const LabelledTriangle& a) {
    if (is_marked(pair)) return;
    mark(pair);
    OverlayPolygon p = intersect(a, labelled(m_, x_, pair.tb, pair.motion));
    if (p.count == 0) return;
    static_cast<TrianglePair&>(p) = pair;
    overlay_.older.push_back(overlay_.newest[p.ta]);
    overlay_.newest[p.ta] = overlay_.polygons.size();
    overlay_.polygons.push_back(p);
  }

  /// Seeds the components of the overlap that parts of loops bound: each has a crossing of a
  /// boundary edge of A with one of B, and the triangles at these edges overlap there.
  void seed_boundary_crossings() {
    overlay_.is_crossed.assign(m_.loops(), 0);
    build_tree(m_, x_, 0, s_.boundary_a, overlay_.boundary_a);
    build_tree(m_, x_, s_.boundary_a, m_.boundary.size(), overlay_.boundary_b);
    overlay_.boundary_a.for_each_pair(overlay_.boundary_b, [&](int i, int j) {
      const int ha = m_.boundary[i], hb = m_.boundary[s_.boundary_a + j];
      const LabelledPoint p = label(m_.tail[ha]), q = label(m_.tip(ha));
      const LabelledPoint r = label(m_.tail[hb]), s = label(m_.tip(hb));
      if (oriented(p, q, r) == oriented(p, q, s) || oriented(r, s, p) == oriented(r, s, q)) return;
      overlay_.seeds.push_back({ha / 3, hb / 3});
      overlay_.is_crossed[loop_at(i)] = overlay_.is_crossed[loop_at(s_.boundary_a + j)] = 1;
    });
  }

  int loop_at(int boundary_index) const {
    return static_cast<int>(std::upper_bound(m_.loop.begin(), m_.loop.end(), boundary_index) -
                            m_.loop.begin()) -
           1;
  }

  /// Seeds the other components. Whole loops bound them, each inside or outside the other
  /// embedding; one pass over its triangles finds the one that contains the start of a loop.
  void seed_other_loops() {
    const int loops_a = loop_at(s_.boundary_a);
    seed_loops(0, loops_a, s_.faces_a, m_.n_faces);
    seed_loops(loops_a, m_.loops(), 0, s_.faces_a);
    flood_seeds();
  }

  void seed_loops(int first_loop, int last_loop, int first_face, int last_face) {
    Array<int> starts;  // half-edges
    for (int i = first_loop; i < last_loop; ++i)
      if (!overlay_.is_crossed[i]) starts.push_back(m_.boundary[m_.loop[i]]);
    if (starts.empty()) return;
    BoxTree tree;
    tree.reset(starts.size());
    for (int i = 0; i < starts.size(); ++i)
      tree.set(i, row2(x_, m_.tail[starts[i]]), row2(x_, m_.tail[starts[i]]));
    tree.join();
    for (int t = first_face; t < last_face; ++t) {
      const LabelledTriangle f = labelled(m_, x_, t);
      const Vec2 lo = lower(lower(f[0].p, f[1].p), f[2].p);
      const Vec2 hi = upper(upper(f[0].p, f[1].p), f[2].p);
      const auto meets = [&](Vec2 low, Vec2 high) { return boxes_meet(lo, hi, low, high); };
      tree.find(meets, [&](int i) {
        const LabelledPoint p = label(m_.tail[starts[i]]);
        const int other = starts[i] / 3;
        if (oriented(f[0], f[1], p) && oriented(f[1], f[2], p) && oriented(f[2], f[0], p))
          overlay_.seeds.push_back(first_loop == 0 ? TrianglePair{other, t}
                                                   : TrianglePair{t, other});
        return false;
      });
    }
  }

  LabelledPoint label(int v) const { return {row2(x_, v), v}; }

  const JointSurface& s_;
  const HalfEdgeMesh& m_;
  const Points2& x_;
  Overlay& overlay_;
  int marked_ = -1;  // the triangle of A whose polygons are marked
};

/// Computes the meta mesh polygons of f(A) and g(B), both injective (Algorithm 1, lines 3 and 19).
inline void compute_overlay(const JointSurface& s, const Points2& x, Overlay& overlay) {
  OverlayBuilder(s, x, overlay).build();
}

/// Returns the polygons in each face of A and of B.
inline Groups<int> group_polygons(const Array<OverlayPolygon>& polygons, int n_faces) {
  return grouped<int>(n_faces, [&](const auto& add) {
    for (int i = 0; i < polygons.size(); ++i)
      for (int f : {polygons[i].ta, polygons[i].tb}) add(f, i);
  });
}

// ==== [8] ENERGIES (paper §3.2, §4.1, §4.2, §4.4, §5.1) ==========================================
//
// Purpose:    computes value, gradient and Hessian of the distortion of a polygon and of a
//             parametrised triangle in closed form, and projects Hessians to s.p.d. ones.
// Method:     E_ρ = a w(F, G), where w depends on K, det F and det G only. So three numbers carry
//             all differences between measures; the chain rule leads from them to the entries of F
//             and G and on to the six points. With Real = double the formulas differentiate one
//             polygon, with Real = Lanes several at once.
// Invariants: the input is six planar points, two rest frames and a corner code. Values are finite
//             if both triangles are positive, also for polygons without area.
// Fails:      never; triangles that are not positive, or too thin for a positive rounded
//             determinant, have energy +infinity.

// ---- geometry of a polygon ----

/// The corners of two triangles: a0 a1 a2 b0 b1 b2.
struct SixPoints {
  Vec2 p[6];
  Vec2& operator[](int i) { return p[i]; }
  Vec2 operator[](int i) const { return p[i]; }
};

/// A boundary piece: edge `e` (0-5 as in OverlayPolygon), 0 ≤ s ≤ t ≤ 1 up to rounding.
struct Piece {
  int e = 0;
  double s = 0;
  double t = 1;
};

struct PolygonShape {
  Piece piece[6];
  int count = 0;
  Vec2 origin;  // a corner; areas are computed relative to it
  const Piece& operator[](int i) const { return piece[i]; }
  Piece& operator[](int i) { return piece[i]; }
};

inline int edge_start(int e) { return e; }
inline int edge_end(int e) { return e == 2 ? 0 : e == 5 ? 3 : e + 1; }
inline bool same_triangle(int e, int other) { return (e < 3) == (other < 3); }

inline double clamp01(double x) { return (std::min)((std::max)(x, 0.0), 1.0); }

/// The crossing u + t d = c + μ w of two edges (Eq. 6).
struct Crossing {
  double t, mu;
};

/// Computes a crossing. For edges parallel up to rounding, returns the midpoint of their common
/// part, which does not influence the area.
inline Crossing crossing(Vec2 u, Vec2 d, Vec2 c, Vec2 w) {
  const double D = cross(d, w), dd = squared_norm(d), ww = squared_norm(w);
  const double sine = std::abs(D) / std::sqrt(dd * ww);
  if (sine > 1e-3) return {clamp01(cross(c - u, w) / D), clamp01(cross(c - u, d) / D)};
  double t = cross(c - u, w) / D;
  if (!(sine > 1e-14)) {
    const double c_at = dot(c - u, d) / dd, e_at = dot(c + w - u, d) / dd;
    const double lo = (std::max)((std::min)(c_at, e_at), 0.0);
    const double hi = (std::min)((std::max)(c_at, e_at), 1.0);
    t = 0.5 * (lo + hi);
  }
  t = clamp01(t);
  return {t, clamp01(dot(u + t * d - c, w) / ww)};
}

inline PolygonShape polygon_shape(const OverlayPolygon& p, const SixPoints& x) {
  PolygonShape shape;
  shape.count = p.count;
  for (int i = 0; i < p.count; ++i) shape[i].e = p.piece(i);
  for (int i = 0, before = p.count - 1; i < p.count; before = i++) {
    const int e = shape[before].e, after = shape[i].e;
    if (same_triangle(e, after)) continue;  // the corner is a vertex: t = 1, s = 0
    const Vec2 u = x[edge_start(e)], c = x[edge_start(after)];
    const Crossing at = crossing(u, x[edge_end(e)] - u, c, x[edge_end(after)] - c);
    shape[before].t = at.t;
    shape[i].s = at.mu;
  }
  const Piece& first = shape[0];
  shape.origin = (1 - first.s) * x[edge_start(first.e)] + first.s * x[edge_end(first.e)];
  return shape;
}

/// Returns a = ½ Σ (t - s) (u × v) over the pieces, on edges u → v.
inline double polygon_area(const PolygonShape& shape, const SixPoints& x) {
  double twice = 0;
  for (int i = 0; i < shape.count; ++i) {
    const Piece& q = shape[i];
    const Vec2 u = x[edge_start(q.e)] - shape.origin, v = x[edge_end(q.e)] - shape.origin;
    twice += (q.t - q.s) * cross(u, v);
  }
  return 0.5 * twice;
}

/// Returns true if rounding dominates the area: it adds nothing to E, and noise to derivatives.
inline bool is_negligible(double area, const SixPoints& x) {
  constexpr double kNoise = 1e-12;
  const double a = cross(x[1] - x[0], x[2] - x[0]), b = cross(x[4] - x[3], x[5] - x[3]);
  return !(area > kNoise * (std::min)(a, b));
}

/// Returns J = [p1 - p0, p2 - p0] R⁻¹ (Eq. 2).
inline Mat2 jacobian(Vec2 p0, Vec2 p1, Vec2 p2, const Mat2& rest_inverse) {
  return columns(p1 - p0, p2 - p0) * rest_inverse;
}

// ---- the density w of a measure ----

template <class Real>
Real square(const Real& x) {
  return x * x;
}
template <class Real>
Real cross(const Real& ax, const Real& ay, const Real& bx, const Real& by) {
  return ax * by - ay * bx;
}
inline double larger(double x, double y) { return (std::max)(x, y); }
inline double is_positive(double x) { return x > 0 ? 1 : 0; }

/// The density w and its derivatives in K, det F and det G.
template <class Real>
struct InvariantDensity {
  Real value, K, F, G;
  Real KK, KF, FF, KG, FG, GG;
};

/// Returns w = K (1 / det³ F + 1 / det³ G), the density of the symmetric Dirichlet energy (Eq. 4).
template <class Real>
InvariantDensity<Real> dirichlet_density(const Real& K, const Real& det_f, const Real& det_g) {
  const Real i = 1 / det_f, j = 1 / det_g, i3 = i * i * i, j3 = j * j * j;
  const Real i4 = -3 * i3 * i, j4 = -3 * j3 * j;
  InvariantDensity<Real> w;
  w.value = K * (i3 + j3);
  w.K = i3 + j3, w.F = K * i4, w.G = K * j4;
  w.KK = w.FG = 0.0;
  w.KF = i4, w.FF = -4 * K * i4 * i;
  w.KG = j4, w.GG = -4 * K * j4 * j;
  return w;
}

/// D(S, d) and its derivatives.
template <class Real>
struct Stretch {
  Real value, S, d, SS, Sd, dd;
};

/// Returns w = D(S, d) (on_a / det F + on_b / det G), with S = K / det² G and d = det F / det G.
template <class Real>
InvariantDensity<Real> stretch_density(const Stretch<Real>& D, double on_a, double on_b,
                                       const Real& K, const Real& det_f, const Real& det_g) {
  const Real i = 1 / det_f, j = 1 / det_g, j2 = j * j;
  const Real S_K = j2, S_G = -2 * K * j * j2, d_F = j, d_G = -det_f * j2;
  const Real D_K = D.S * S_K, D_F = D.d * d_F, D_G = D.S * S_G + D.d * d_G;
  const Real D_KG = (D.SS * S_G + D.Sd * d_G) * S_K - 2 * D.S * j * j2;
  const Real D_FG = (D.Sd * S_G + D.dd * d_G) * d_F - D.d * j2;
  const Real D_GG = D.SS * S_G * S_G + 2 * D.Sd * S_G * d_G + D.dd * d_G * d_G +
                    6 * D.S * K * j2 * j2 + 2 * D.d * det_f * j * j2;
  const Real areas = on_a * i + on_b * j, areas_F = -on_a * i * i, areas_G = -on_b * j2;
  InvariantDensity<Real> w;
  w.value = D.value * areas;
  w.K = D_K * areas;
  w.F = D_F * areas + D.value * areas_F;
  w.G = D_G * areas + D.value * areas_G;
  w.KK = D.SS * S_K * S_K * areas;
  w.KF = D.Sd * S_K * d_F * areas + D_K * areas_F;
  w.FF = D.dd * d_F * d_F * areas + 2 * D_F * areas_F - 2 * D.value * areas_F * i;
  w.KG = D_KG * areas + D_K * areas_G;
  w.FG = D_FG * areas + D_F * areas_G + D_G * areas_F;
  w.GG = D_GG * areas + 2 * D_G * areas_G - 2 * D.value * areas_G * j;
  return w;
}

/// Subtracts κ (1 / det F + 1 / det G), the density of the covered areas, from w.
template <class Real>
void add_coverage(double kappa, const Real& det_f, const Real& det_g, InvariantDensity<Real>& w) {
  const Real i = 1 / det_f, j = 1 / det_g, i2 = kappa * i * i, j2 = kappa * j * j;
  w.value = w.value - kappa * (i + j);
  w.F = w.F + i2;
  w.G = w.G + j2;
  w.FF = w.FF - 2 * i2 * i;
  w.GG = w.GG - 2 * j2 * j;
}

/// Returns w at Jacobians F and G, without coverage; +∞ unless both determinants are positive.
inline double density_value(const DistortionMeasure& measure, const Mat2& F, const Mat2& G) {
  const double det_f = determinant(F), det_g = determinant(G);
  if (!(det_f > 0) || !(det_g > 0)) return kInfinity;
  const double K = squared_norm(adjugate(G) * F);
  if (measure.is_symmetric_dirichlet())
    return K * (1 / (det_f * det_f * det_f) + 1 / (det_g * det_g * det_g));
  const double d = det_f / det_g;
  const double S = (std::max)(K / (det_g * det_g), 2 * d);  // rounding can make it smaller
  return measure.density(S, d).value * (measure.on_a() / det_f + measure.on_b() / det_g);
}

/// S (1 + 1 / d³); its integral over B' is Eq. 3.
inline StretchDensity dirichlet_stretch(double S, double d) {
  const double i = 1 / d, i3 = i * i * i;
  return {S * (1 + i3), 1 + i3, -3 * S * i3 * i, 0, -3 * i3 * i, 12 * S * i3 * i * i};
}

/// (1 - σ_min)² + (1 - σ_max)² = S + 2 - 2 p with p = σ_max + σ_min = √(S + 2 d).
inline StretchDensity arap_stretch(double S, double d) {
  const double p = std::sqrt(S + 2 * d), p3 = p * p * p;
  return {S + 2 - 2 * p, 1 - 1 / p, -2 / p, 0.5 / p3, 1 / p3, 2 / p3};
}

/// (σ_max - σ_min)² = S - 2 d.
inline StretchDensity asap_stretch(double S, double d) { return {S - 2 * d, 1, -2, 0, 0, 0}; }

/// (1 - 1/σ_min)² + (1 - σ_max)², σ = (p ± q) / 2, q = √(S - 2 d + δ S); δ smooths q's kink at 0.
inline StretchDensity sarap_stretch(double S, double d) {
  constexpr double kDelta = 1e-12;
  const double p = std::sqrt(S + 2 * d), q = std::sqrt((std::max)(S - 2 * d, 0.0) + kDelta * S);
  const double s = 0.5 * (p + q), t = (4 * d - kDelta * S) / (2 * (p + q));  // σ_max, σ_min
  if (!(t > 0)) return {kInfinity, 0, 0, 0, 0, 0};
  const double p3 = p * p * p, q3 = q * q * q, e = 1 + kDelta;
  const double p_S = 0.5 / p, p_d = 1 / p, q_S = 0.5 * e / q, q_d = -1 / q;
  const double p_SS = -0.25 / p3, p_Sd = -0.5 / p3, p_dd = -1 / p3;
  const double q_SS = -0.25 * e * e / q3, q_Sd = 0.5 * e / q3, q_dd = -1 / q3;
  const double h_s = 2 * (s - 1), h_t = 2 * (1 - 1 / t) / (t * t);
  const double h_tt = (6 / t - 4) / (t * t * t);  // h_ss = 2
  // With u = (h_s + h_t) / 2 and v = (h_s - h_t) / 2 the gradient is u ∇p + v ∇q.
  const double u = 0.5 * (h_s + h_t), v = 0.5 * (h_s - h_t);
  const auto second = [&](double p_x, double q_x, double p_y, double q_y, double p_xy,
                          double q_xy) {
    return 0.25 * (2 * (p_x + q_x) * (p_y + q_y) + h_tt * (p_x - q_x) * (p_y - q_y)) + u * p_xy +
           v * q_xy;
  };
  return {(1 - 1 / t) * (1 - 1 / t) + (1 - s) * (1 - s),
          u * p_S + v * q_S,
          u * p_d + v * q_d,
          second(p_S, q_S, p_S, q_S, p_SS, q_SS),
          second(p_S, q_S, p_d, q_d, p_Sd, q_Sd),
          second(p_d, q_d, p_d, q_d, p_dd, q_dd)};
}

}  // namespace detail

DistortionMeasure::DistortionMeasure(Density density, double on_a, double on_b)
    : density_(std::move(density)), on_a_(on_a), on_b_(on_b) {}

DistortionMeasure symmetric_dirichlet() {
  DistortionMeasure measure(detail::dirichlet_stretch, 0, 1);
  measure.is_symmetric_dirichlet_ = true;
  return measure;
}
DistortionMeasure arap() { return {detail::arap_stretch, 1, 0}; }
DistortionMeasure sarap() { return {detail::sarap_stretch, 0.5, 0.5}; }
DistortionMeasure asap() { return {detail::asap_stretch, 1, 0}; }

namespace detail {

// ---- one parametrised triangle: E_f and E_g (§4.4) ----

/// Returns the symmetric Dirichlet energy A (‖J‖² + ‖J‖²/det² J) of one triangle.
inline double triangle_energy(const Mat2& J, double area) {
  const double f = determinant(J);
  return f > 0 ? area * squared_norm(J) * (1 + 1 / (f * f)) : kInfinity;
}

/// ‖J‖² + ‖J‖²/det² J, its derivatives in the entries of J by columns (Hessian: lower triangle).
template <class Real>
struct TriangleDensity {
  Real value, gradient[4], hessian[4][4];
};

template <class Real>
TriangleDensity<Real> triangle_density(const Real (&J)[4]) {
  const Real S = J[0] * J[0] + J[1] * J[1] + J[2] * J[2] + J[3] * J[3];
  const Real i = 1 / (J[0] * J[3] - J[2] * J[1]), i2 = i * i;
  const Real e_S = 1 + i2, e_f = -2 * S * i2 * i, e_ff = 6 * S * i2 * i2, e_Sf = -2 * i2 * i;
  const Real df[4] = {J[3], -J[2], -J[1], J[0]};
  TriangleDensity<Real> w;
  w.value = S * e_S;
  for (int k = 0; k < 4; ++k) {
    w.gradient[k] = 2 * e_S * J[k] + e_f * df[k];
    for (int l = 0; l <= k; ++l)
      w.hessian[k][l] = e_ff * df[k] * df[l] + 2 * e_Sf * (J[k] * df[l] + df[k] * J[l]);
    w.hessian[k][k] = w.hessian[k][k] + 2 * e_S;
  }
  w.hessian[3][0] = w.hessian[3][0] + e_f;
  w.hessian[2][1] = w.hessian[2][1] - e_f;
  return w;
}

/// The weights of a triangle's points in the columns of its Jacobian: J_c = Σ_i weight[i][c] p_i.
template <class Real>
struct CornerWeights {
  Real weight[3][2];
  CornerWeights() = default;
  explicit CornerWeights(const Real* rest_inverse) {
    for (int c = 0; c < 2; ++c) {
      weight[1][c] = rest_inverse[2 * c];
      weight[2][c] = rest_inverse[2 * c + 1];
      weight[0][c] = -weight[1][c] - weight[2][c];
    }
  }
};

/// Returns the gradient in point i of a triangle.
inline Vec2 point_gradient(const TriangleDensity<double>& w, const CornerWeights<double>& B,
                           int i) {
  return {B.weight[i][0] * w.gradient[0] + B.weight[i][1] * w.gradient[2],
          B.weight[i][0] * w.gradient[1] + B.weight[i][1] * w.gradient[3]};
}
/// A symmetric matrix; only its lower triangle is used.
template <int N, class Real>
struct Symmetric {
  Real entry[static_cast<std::size_t>(N)][static_cast<std::size_t>(N)];
  Real& operator()(int i, int j) { return entry[i][j]; }
  const Real& operator()(int i, int j) const { return entry[i][j]; }
  const Real& symmetric(int i, int j) const { return i >= j ? entry[i][j] : entry[j][i]; }
  /// Returns the 2×2 block (i, j) of one lane.
  Mat2 block(int i, int j, int lane) const {
    return {{symmetric(2 * i, 2 * j)[lane], symmetric(2 * i + 1, 2 * j)[lane],
             symmetric(2 * i, 2 * j + 1)[lane], symmetric(2 * i + 1, 2 * j + 1)[lane]}};
  }
};

/// A triangle: coordinates of its points, R⁻¹ and area; differentiate() sets the rest.
template <class Real>
struct TriangleElement {
  Real x[6], rest_inverse[4], area;
  Real gradient[6];
  Symmetric<6, Real> hessian;
};

/// Computes the Jacobian of the triangle whose coordinates start at x.
template <class Real>
void jacobian(const CornerWeights<Real>& B, const Real* x, Real* J) {
  for (int k = 0; k < 4; ++k) {
    const int c = k / 2, r = k % 2;
    J[k] = B.weight[1][c] * (x[r + 2] - x[r]) + B.weight[2][c] * (x[r + 4] - x[r]);
  }
}

template <class Real>
void differentiate(TriangleElement<Real>& element) {
  const CornerWeights<Real> B(element.rest_inverse);
  Real J[4];
  jacobian(B, element.x, J);
  const TriangleDensity<Real> w = triangle_density(J);
  const auto second = [&](int k, int l) { return k >= l ? w.hessian[k][l] : w.hessian[l][k]; };
  for (int i = 0; i < 6; ++i) {
    const int r = i % 2;
    const Real b0 = element.area * B.weight[i / 2][0], b1 = element.area * B.weight[i / 2][1];
    element.gradient[i] = b0 * w.gradient[r] + b1 * w.gradient[2 + r];
    Real half[4];  // row i of the Hessian, columns in J
    for (int k = 0; k < 4; ++k) half[k] = b0 * second(r, k) + b1 * second(2 + r, k);
    for (int j = 0; j <= i; ++j)
      element.hessian(i, j) =
          B.weight[j / 2][0] * half[j % 2] + B.weight[j / 2][1] * half[2 + j % 2];
  }
}

// ---- derivatives of E_ρ ----

inline Stretch<double> stretches(const DistortionMeasure& measure, double S, double d) {
  const StretchDensity D = measure.density(S, d);
  return {D.value, D.S, D.d, D.SS, D.Sd, D.dd};
}

template <class Real>
InvariantDensity<Real> invariant_density(const DistortionMeasure& measure, double kappa,
                                         const Real& K, const Real& det_f, const Real& det_g) {
  const Real d = det_f / det_g, S = larger(K / (det_g * det_g), 2 * d);
  InvariantDensity<Real> w = measure.is_symmetric_dirichlet()
                                 ? dirichlet_density(K, det_f, det_g)
                                 : stretch_density(stretches(measure, S, d), measure.on_a(),
                                                   measure.on_b(), K, det_f, det_g);
  add_coverage(kappa, det_f, det_g, w);
  return w;
}

/// Returns entry r of perp(v), v one of the columns F_1, F_2, G_1, G_2.
template <class Real>
Real perp_of(const Real* J, int column, int r) {
  return r == 0 ? J[2 * column + 1] : -J[2 * column];
}

/// Adds scale · ∇²K. K = Σ X_cd² with X_cd = cross(F_c, G_d) for the columns of F and G; ∂X_cd/∂F_c
/// = perp(G_d), ∂X_cd/∂G_d = -perp(F_c).
template <class Real>
void add_norm_hessian(const Real* J, const Real (&X)[2][2], const Real& scale,
                      Symmetric<8, Real>& H) {
  const auto perp = [&](int column, int r) { return perp_of(J, column, r); };
  for (int r = 0; r < 2; ++r)  // between F and F, G and G
    for (int q = 0; q <= r; ++q)
      for (int m = 0; m < 2; ++m) {
        const int other = 2 - 2 * m;
        const Real P =
            2 * scale * (perp(other, r) * perp(other, q) + perp(other + 1, r) * perp(other + 1, q));
        H(4 * m + r, 4 * m + q) += P;
        H(4 * m + 2 + r, 4 * m + 2 + q) += P;
      }
  for (int c = 0; c < 2; ++c)  // between G and F
    for (int d = 0; d < 2; ++d)
      for (int r = 0; r < 2; ++r)
        for (int q = 0; q < 2; ++q) {
          Real sum = -perp(c, r) * perp(2 + d, q);
          if (r != q) sum += r == 0 ? -X[c][d] : X[c][d];
          H(4 + 2 * d + r, 2 * c + q) += 2 * scale * sum;
        }
}

/// The density w minus coverage at J = f11 f21 f12 f22 g11 g21 g12 g22, and its derivatives' parts.
template <class Real>
struct DensityParts {
  Real X[2][2];
  InvariantDensity<Real> w;
  Real dK[8], ddet[8];  // ∇K; ∇ det F (entries 0 to 3) and ∇ det G (4 to 7)
  /// Returns entry i of Σ w_m ∇m over m = K, det F, det G.
  Real gradient(int i) const { return w.K * dK[i] + (i < 4 ? w.F : w.G) * ddet[i]; }
};

template <class Real>
DensityParts<Real> density_parts(const DistortionMeasure& measure, double kappa, const Real* J) {
  DensityParts<Real> p;
  Real K = 0.0;
  for (int c = 0; c < 2; ++c)
    for (int d = 0; d < 2; ++d) {
      p.X[c][d] = cross(J[2 * c], J[2 * c + 1], J[4 + 2 * d], J[5 + 2 * d]);
      K += square(p.X[c][d]);
    }
  p.w = invariant_density(measure, kappa, K, cross(J[0], J[1], J[2], J[3]),
                          cross(J[4], J[5], J[6], J[7]));
  for (int c = 0; c < 2; ++c)
    for (int r = 0; r < 2; ++r) {
      p.dK[2 * c + r] = 2 * (p.X[c][0] * perp_of(J, 2, r) + p.X[c][1] * perp_of(J, 3, r));
      p.dK[4 + 2 * c + r] = -2 * (p.X[0][c] * perp_of(J, 0, r) + p.X[1][c] * perp_of(J, 1, r));
    }
  for (int m = 0; m < 8; m += 4) {
    p.ddet[m] = J[m + 3], p.ddet[m + 1] = -J[m + 2];
    p.ddet[m + 2] = -J[m + 1], p.ddet[m + 3] = J[m];
  }
  return p;
}

/// Computes Σ w_m ∇²m + Σ w_mn ∇m ∇nᵀ over m, n = K, det F, det G.
template <class Real>
void density_hessian(const Real* J, const DensityParts<Real>& p, Symmetric<8, Real>& H) {
  const InvariantDensity<Real>& w = p.w;
  for (int i = 0; i < 8; ++i) {
    const Real on_dK = w.KK * p.dK[i] + (i < 4 ? w.KF : w.KG) * p.ddet[i];
    const Real on_det_f = w.KF * p.dK[i] + (i < 4 ? w.FF : w.FG) * p.ddet[i];
    const Real on_det_g = w.KG * p.dK[i] + w.GG * p.ddet[i];
    for (int j = 0; j <= i; ++j)
      H(i, j) = on_dK * p.dK[j] + (j < 4 ? on_det_f : on_det_g) * p.ddet[j];
  }
  add_norm_hessian(J, p.X, w.K, H);
  H(3, 0) += w.F, H(2, 1) -= w.F;  // ∇² det F
  H(7, 4) += w.G, H(6, 5) -= w.G;  // ∇² det G
}

/// A polygon: the input of differentiate(), then its output.
template <class Real>
struct PolygonElement {
  Real x[12];  // a0 a1 a2 b0 b1 b2, two coordinates each
  Real rest_inverse[8];
  Real s[6], t[6];  // of the pieces; both 0 on edges without a piece
  struct Corner {
    Real is_there, on_a, on_b;  // 1 or 0; the parameters on both edges
  };
  Corner corner[3][3];  // where an edge of t_A meets one of t_B
  Real area;
  Real is_negligible;  // 1 or 0; if 1, the derivatives are meaningless

  Real value, gradient[12];
  Symmetric<12, Real> hessian;  // not set by differentiate_once()
};

/// Computes ∂a/∂u = Σ α perp(d) and ∂a/∂v = Σ β perp(d) over pieces of edges d = v - u; β = (t² -
/// s²)/2, α = (t - s) - β. Pieces move with their edges, their ends only along the boundary.
template <class Real>
void area_gradient(const PolygonElement<Real>& element, Real* gradient) {
  for (int i = 0; i < 12; ++i) gradient[i] = 0.0;
  for (int e = 0; e < 6; ++e) {
    const int u = 2 * edge_start(e), v = 2 * edge_end(e);
    const Real beta = 0.5 * (square(element.t[e]) - square(element.s[e]));
    const Real alpha = (element.t[e] - element.s[e]) - beta;
    const Real nx = element.x[v + 1] - element.x[u + 1], ny = element.x[u] - element.x[v];
    gradient[u] += alpha * nx, gradient[u + 1] += alpha * ny;
    gradient[v] += beta * nx, gradient[v + 1] += beta * ny;
  }
}

/// An edge of a triangle: the offsets of its end points in the coordinates, and its normal.
template <class Real>
struct EdgeOfElement {
  int end[2];
  Real normal[2];  // perp of its direction
  EdgeOfElement(const Real* x, int e) : end{2 * edge_start(e), 2 * edge_end(e)} {
    normal[0] = x[end[1] + 1] - x[end[0] + 1];
    normal[1] = x[end[0]] - x[end[1]];
  }
};

/// Adds the part of weight · ∇²a from the corner of edges i of t_A and j of t_B. With edges d and
/// w, m_d = perp(d), m_w = perp(w), and Z_d, Z_w the motions of the crossing as a point of either
/// edge, it is
///   -(1 / |d × w|) [(m_d·Z_d)(m_w·Z_d) - 2 (m_d·Z_d)(m_w·Z_w) + (m_w·Z_w)(m_d·Z_w)].
/// A lower bound on |d × w| relative to the edges keeps near-parallel edges finite.
template <class Real>
void add_corner_hessian(const PolygonElement<Real>& element, int i, int j, const Real& weight,
                        Symmetric<12, Real>& H) {
  using std::abs, std::sqrt;
  constexpr double kMostParallel = 1e-8;
  const typename PolygonElement<Real>::Corner& corner = element.corner[i][j];
  const EdgeOfElement<Real> a(element.x, i), b(element.x, 3 + j);
  const Real *m_d = a.normal, *m_w = b.normal;
  const Real D = abs(cross(m_d[0], m_d[1], m_w[0], m_w[1]));
  const Real least =
      kMostParallel * sqrt((square(m_d[0]) + square(m_d[1])) * (square(m_w[0]) + square(m_w[1])));
  const Real scale = weight * corner.is_there * is_positive(D) / larger(D, least);
  const Real part_a[2] = {1 - corner.on_a, corner.on_a}, part_b[2] = {1 - corner.on_b, corner.on_b};
  const Real own[3] = {m_d[0] * m_w[0], 0.5 * (m_d[0] * m_w[1] + m_d[1] * m_w[0]), m_d[1] * m_w[1]};
  const auto add_own = [&](const int(&end)[2], const Real(&part)[2]) {
    for (int k = 0; k < 2; ++k)
      for (int l = 0; l < 2; ++l) {
        if (end[l] > end[k]) continue;
        const Real factor = scale * part[k] * part[l];
        for (int r = 0; r < 2; ++r)
          for (int q = 0; q < (k == l ? r + 1 : 2); ++q)
            H(end[k] + r, end[l] + q) -= factor * own[r + q];
      }
  };
  add_own(a.end, part_a);
  add_own(b.end, part_b);
  for (int k = 0; k < 2; ++k)
    for (int l = 0; l < 2; ++l) {
      const Real factor = scale * part_b[k] * part_a[l];
      for (int r = 0; r < 2; ++r) {
        const Real row = factor * m_w[r];
        for (int q = 0; q < 2; ++q) H(b.end[k] + r, a.end[l] + q) += row * m_d[q];
      }
    }
}

/// Sets H = weight · ∇²a, from δ²a = Σ (t - s)(δu × δv) over the pieces plus the corners.
template <class Real>
void set_area_hessian(const PolygonElement<Real>& element, const Real& weight,
                      Symmetric<12, Real>& H) {
  for (int i = 0; i < 12; ++i)
    for (int j = 0; j <= i; ++j) H(i, j) = 0.0;
  for (int e = 0; e < 6; ++e) {
    const int u = 2 * edge_start(e), v = 2 * edge_end(e), lo = (std::min)(u, v);
    const Real half = 0.5 * weight * (element.t[e] - element.s[e]);
    const Real signed_half = u < v ? half : -half;
    H((std::max)(u, v) + 1, lo) += signed_half;
    H((std::max)(u, v), lo + 1) -= signed_half;
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) add_corner_hessian(element, i, j, weight, H);
}

/// Intermediate results of the first derivatives of E_ρ that the second ones reuse.
template <class Real>
struct PolygonParts {
  CornerWeights<Real> B[2];
  Real J[8], da[12], dw[12];
  DensityParts<Real> density;
};

/// Computes E_ρ = a w(F, G) and its gradient a ∇w + w ∇a.
template <class Real>
PolygonParts<Real> differentiate_once(const DistortionMeasure& measure, double kappa,
                                      PolygonElement<Real>& element) {
  PolygonParts<Real> p;
  for (int m = 0; m < 2; ++m) {
    p.B[m] = CornerWeights<Real>(element.rest_inverse + 4 * m);
    jacobian(p.B[m], element.x + 6 * m, p.J + 4 * m);
  }
  p.density = density_parts(measure, kappa, p.J);
  const Real& w = p.density.w.value;
  area_gradient(element, p.da);
  element.value = element.area * w;
  for (int i = 0; i < 12; ++i) {
    const int first = 4 * (i / 6) + i % 2;
    const Real(&b)[2] = p.B[i / 6].weight[i % 6 / 2];
    p.dw[i] = b[0] * p.density.gradient(first) + b[1] * p.density.gradient(first + 2);
    element.gradient[i] = element.area * p.dw[i] + w * p.da[i];
  }
  return p;
}

/// Computes E_ρ, its gradient, and its Hessian a ∇²w + ∇w ∇aᵀ + ∇a ∇wᵀ + w ∇²a.
template <class Real>
void differentiate(const DistortionMeasure& measure, double kappa, PolygonElement<Real>& element) {
  const PolygonParts<Real> p = differentiate_once(measure, kappa, element);
  Symmetric<8, Real> second;
  density_hessian(p.J, p.density, second);
  Real half[12][8];  // a ∇²w with rows in x, columns in J
  for (int i = 0; i < 12; ++i) {
    const int m = i / 6, first = 4 * m + i % 2;
    const Real(&b)[2] = p.B[m].weight[i % 6 / 2];
    const Real b0 = element.area * b[0], b1 = element.area * b[1];
    for (int k = 0; k < 4 + 4 * m; ++k)
      half[i][k] = b0 * second.symmetric(first, k) + b1 * second.symmetric(first + 2, k);
  }
  set_area_hessian(element, p.density.w.value, element.hessian);
  for (int i = 0; i < 12; ++i)
    for (int j = 0; j <= i; ++j) {
      const int n = j / 6, first = 4 * n + j % 2;
      const Real(&b)[2] = p.B[n].weight[j % 6 / 2];
      element.hessian(i, j) +=
          b[0] * half[i][first] + b[1] * half[i][first + 2] + p.dw[i] * p.da[j] + p.da[i] * p.dw[j];
    }
}

// ---- lanes: many polygons side by side ----

using Eigen::internal::pabs, Eigen::internal::padd, Eigen::internal::pdiv, Eigen::internal::ploadu,
    Eigen::internal::pmadd, Eigen::internal::pmax, Eigen::internal::pmin, Eigen::internal::pmul,
    Eigen::internal::pnegate, Eigen::internal::pset1, Eigen::internal::psqrt,
    Eigen::internal::pstoreu, Eigen::internal::psub;

/// Numbers of different polygons, processed at once by the widest vectors that the compiler may
/// use. Lanes do not mix, so results depend neither on their number nor on the content of other
/// lanes. The second of two vectors hides the latency of the first; more do not fit the registers.
struct Lanes {
  using Vector = Eigen::internal::packet_traits<double>::type;  // double without SIMD
  static constexpr int kHalf = Eigen::internal::packet_traits<double>::size, kSize = 2 * kHalf;

  Vector a, b;
  Lanes() = default;
  Lanes(const Vector& first, const Vector& second) : a(first), b(second) {}
  Lanes(double x) : a(pset1<Vector>(x)), b(a) {}
  static Lanes load(const double* from) {
    return {ploadu<Vector>(from), ploadu<Vector>(from + kHalf)};
  }
  void store(double* to) const {
    pstoreu(to, a);
    pstoreu(to + kHalf, b);
  }

  struct Lane {  // a number within a vector, accessed by memcpy (aliasing)
    void* at;
    operator double() const { return number_at<double>(at); }
    double operator=(double x) const { return std::memcpy(at, &x, sizeof x), x; }
  };
  Lane operator[](int lane) {
    return {reinterpret_cast<char*>(this) + lane * std::ptrdiff_t{sizeof(double)}};
  }
  double operator[](int lane) const { return const_cast<Lanes&>(*this)[lane]; }
};
inline constexpr int kLanes = Lanes::kSize;

inline Lanes operator+(const Lanes& x, const Lanes& y) { return {padd(x.a, y.a), padd(x.b, y.b)}; }
inline Lanes operator-(const Lanes& x, const Lanes& y) { return {psub(x.a, y.a), psub(x.b, y.b)}; }
inline Lanes operator*(const Lanes& x, const Lanes& y) { return {pmul(x.a, y.a), pmul(x.b, y.b)}; }
inline Lanes operator/(const Lanes& x, const Lanes& y) { return {pdiv(x.a, y.a), pdiv(x.b, y.b)}; }
inline Lanes operator-(const Lanes& x) { return {pnegate(x.a), pnegate(x.b)}; }

/// Returns x + y z; fused in builds with FMA enabled.
inline Lanes sum_with_product(const Lanes& x, const Lanes& y, const Lanes& z) {
#ifdef __FMA__
  return {pmadd(y.a, z.a, x.a), pmadd(y.b, z.b, x.b)};
#else
  return x + y * z;
#endif
}
inline Lanes& operator+=(Lanes& x, const Lanes& y) { return x = x + y; }
inline Lanes& operator-=(Lanes& x, const Lanes& y) { return x = x - y; }
inline Lanes& operator*=(Lanes& x, const Lanes& y) { return x = x * y; }
inline Lanes sqrt(const Lanes& x) { return {psqrt(x.a), psqrt(x.b)}; }
inline Lanes abs(const Lanes& x) { return {pabs(x.a), pabs(x.b)}; }
inline Lanes larger(const Lanes& x, const Lanes& y) { return {pmax(x.a, y.a), pmax(x.b, y.b)}; }
inline Lanes smaller(const Lanes& x, const Lanes& y) { return {pmin(x.a, y.a), pmin(x.b, y.b)}; }
inline Lanes clamp01(const Lanes& x) { return smaller(larger(x, 0.0), 1.0); }

/// Returns 1 where x > 0, else 0, without branches; the factors raise positive doubles above 1.
inline Lanes is_positive(const Lanes& x) { return clamp01(x * 1e300 * 1e300); }
inline Lanes select(const Lanes& which, const Lanes& one, const Lanes& zero) {
  return which * one + (1 - which) * zero;
}
inline bool any_positive(const Lanes& x) {
  bool any = false;
  for (int lane = 0; lane < kLanes; ++lane) any |= x[lane] > 0;
  return any;
}

template <int N>
using LaneMatrix = Symmetric<N, Lanes>;
using TriangleBatch = TriangleElement<Lanes>;
using PolygonBatch = PolygonElement<Lanes>;

/// Evaluates a user-defined measure lane by lane.
inline Stretch<Lanes> stretches(const DistortionMeasure& measure, const Lanes& S, const Lanes& d) {
  Stretch<Lanes> D;
  for (int lane = 0; lane < kLanes; ++lane) {
    const StretchDensity one = measure.density(S[lane], d[lane]);
    D.value[lane] = one.value;
    D.S[lane] = one.S, D.d[lane] = one.d;
    D.SS[lane] = one.SS, D.Sd[lane] = one.Sd, D.dd[lane] = one.dd;
  }
  return D;
}

inline void load(const OverlayPolygon& p, const SixPoints& x, const Mat2& rest_inverse_a,
                 const Mat2& rest_inverse_b, int lane, PolygonBatch& batch) {
  const PolygonShape shape = polygon_shape(p, x);
  const double area = polygon_area(shape, x);
  batch.area[lane] = area;
  batch.is_negligible[lane] = is_negligible(area, x);
  for (int i = 0; i < 6; ++i) {
    batch.x[2 * i][lane] = x[i].x;
    batch.x[2 * i + 1][lane] = x[i].y;
  }
  for (int i = 0; i < 4; ++i) {
    batch.rest_inverse[i][lane] = rest_inverse_a.entry[i];
    batch.rest_inverse[4 + i][lane] = rest_inverse_b.entry[i];
  }
  for (int e = 0; e < 6; ++e) batch.s[e][lane] = batch.t[e][lane] = 0;
  for (auto& row : batch.corner)
    for (PolygonBatch::Corner& c : row) c.is_there[lane] = c.on_a[lane] = c.on_b[lane] = 0;
  for (int i = 0, before = shape.count - 1; i < shape.count; before = i++) {
    const Piece &from = shape[before], &to = shape[i];
    batch.s[to.e][lane] = to.s;
    batch.t[to.e][lane] = to.t;
    if (same_triangle(from.e, to.e)) continue;
    const bool from_a = from.e < 3;
    PolygonBatch::Corner& c =
        from_a ? batch.corner[from.e][to.e - 3] : batch.corner[to.e][from.e - 3];
    c.is_there[lane] = 1;
    (from_a ? c.on_a : c.on_b)[lane] = from.t;
    (from_a ? c.on_b : c.on_a)[lane] = to.s;
  }
}

// ---- projection to s.p.d. matrices (§5.1) ----

/// Eigenvalues and eigenvectors of small symmetric matrices by Householder tridiagonalisation and
/// implicit QL [Bowdler, Martin, Reinsch, Wilkinson 1968]. Converged lanes wait for the others.
template <int N>
struct LaneEigen {
  Lanes value[static_cast<std::size_t>(N)];
  Lanes vector[static_cast<std::size_t>(N)]
              [static_cast<std::size_t>(N)];  // row i belongs to value[i]

  void decompose(LaneMatrix<N>& a) {  // a is destroyed
    tridiagonalize(a);
    for (int l = 0; l + 1 < N; ++l) isolate(l);
  }

 private:
  Lanes below[static_cast<std::size_t>(N)];  // subdiagonal of the tridiagonal matrix

  /// Computes a = Q T Qᵀ by reflections I - β v vᵀ; a keeps v in its columns, `vector` is Qᵀ.
  void tridiagonalize(LaneMatrix<N>& a) {
    Lanes beta[static_cast<std::size_t>(N)];
    for (int k = 0; k + 1 < N; ++k) {
      value[k] = a(k, k);
      Lanes tail = 0.0;
      for (int i = k + 2; i < N; ++i) tail += square(a(i, k));
      const Lanes head = a(k + 1, k), norm = sqrt(square(head) + tail);
      const Lanes some = is_positive(tail - 1e-290);  // below, squares have lost digits
      const Lanes signed_norm = select(is_positive(head), norm, -norm);
      below[k] = select(some, -signed_norm, head);
      a(k + 1, k) = some * (head + signed_norm);
      beta[k] = some / (signed_norm * (head + signed_norm) + (1 - some));  // 2 / vᵀv
      reflect(a, k, beta[k]);
    }
    value[N - 1] = a(N - 1, N - 1);
    below[N - 1] = 0.0;
    accumulate(a, beta);
  }

  /// Computes a ← (I - β v vᵀ) a (I - β v vᵀ) on the rows and columns after k.
  static void reflect(LaneMatrix<N>& a, int k, const Lanes& beta) {
    Lanes w[static_cast<std::size_t>(N)];
    for (int i = k + 1; i < N; ++i) w[i] = 0.0;
    for (int j = k + 1; j < N; ++j) {
      Lanes sum = a(j, j) * a(j, k);
      for (int i = j + 1; i < N; ++i) {
        sum += a(i, j) * a(i, k);
        w[i] += a(i, j) * a(j, k);
      }
      w[j] += sum;
    }
    Lanes vw = 0.0;
    for (int i = k + 1; i < N; ++i) {
      w[i] *= beta;
      vw += a(i, k) * w[i];
    }
    for (int i = k + 1; i < N; ++i) w[i] -= 0.5 * beta * vw * a(i, k);
    for (int j = k + 1; j < N; ++j)
      for (int i = j; i < N; ++i) a(i, j) -= a(i, k) * w[j] + w[i] * a(j, k);
  }

  /// Computes vector = Qᵀ, the product of the reflections.
  void accumulate(const LaneMatrix<N>& v, const Lanes* beta) {
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) vector[i][j] = i == j ? 1.0 : 0.0;
    for (int k = N - 2; k >= 0; --k)
      for (int i = k + 1; i < N; ++i) {
        Lanes sum = 0.0;
        for (int j = k + 1; j < N; ++j) sum += vector[i][j] * v(j, k);
        sum *= beta[k];
        for (int j = k + 1; j < N; ++j) vector[i][j] -= sum * v(j, k);
      }
  }

  /// Returns 1 in the lanes whose sweep, which starts at m, has passed row i.
  static Lanes is_above(const Lanes& m, int i) { return clamp01(m - static_cast<double>(i)); }

  /// Returns the index of the first negligible subdiagonal entry from l on.
  Lanes split(int l) const {
    constexpr double kNegligible = std::numeric_limits<double>::epsilon();
    Lanes m = static_cast<double>(N - 1);
    for (int i = N - 2; i >= l; --i) {
      const Lanes excess = abs(below[i]) - kNegligible * (abs(value[i]) + abs(value[i + 1]));
      m = select(is_positive(excess), m, static_cast<double>(i));
    }
    return m;
  }

  /// Runs QL sweeps with Wilkinson's shift until value[l] is decoupled.
  void isolate(int l) {
    constexpr int kMostSweeps = 50;
    for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
      const Lanes m = split(l);
      int last = l;  // ignores NaN
      for (int k = 0; k < kLanes; ++k)
        if (m[k] > last) last = static_cast<int>(m[k]);
      if (last == l) return;
      const Lanes on = is_above(m, l), off = 1 - on;
      const Lanes half = 0.5 * (value[l + 1] - value[l]) / (below[l] + off);
      const Lanes root = abs(half) + sqrt(square(half) + 1);
      Lanes end = value[l + 1];  // value[m]
      for (int i = l + 2; i <= last; ++i) end = select(is_above(m, i - 1), value[i], end);
      Sweep state;
      state.g = end - value[l] + (2 * is_positive(half) - 1) * below[l] / root;
      for (int i = last - 1; i >= l; --i) rotate(i, m, state);
      value[l] -= on * state.p;
      below[l] = select(on, state.g, below[l]);
      for (int i = l + 1; i <= last; ++i) below[i] *= 1 - is_above(m, i - 1) + is_above(m, i);
    }
  }

  struct Sweep {
    Lanes g, s = 1.0, c = 1.0, p = 0.0;
  };

  /// Applies one rotation of a sweep in the lanes that have started.
  void rotate(int i, const Lanes& m, Sweep& state) {
    constexpr double kTiny = 1e-150;  // avoids 0/0: then c = 1 and s = 0
    const Lanes on = is_above(m, i), off = 1 - on;
    const Lanes f = state.s * below[i], b = state.c * below[i], g = state.g + kTiny;
    const Lanes r2 = square(f) + square(g), r = sqrt(r2);
    const Lanes inverse = r * (1 / r2);  // in parallel with the root
    const Lanes s = f * inverse, c = g * inverse;
    const Lanes h = value[i + 1] - state.p;
    const Lanes t = (value[i] - h) * s + 2 * c * b, p = s * t;
    below[i + 1] = on * r + off * below[i + 1];
    value[i + 1] = on * (h + p) + off * value[i + 1];
    state.g = on * (c * t - b) + off * state.g;
    state.p = on * p;
    const Lanes sine = on * s, cosine = on * c + off;
    state.s = sine + off;
    state.c = cosine;
    for (int k = 0; k < N; ++k) {
      const Lanes x = vector[i][k], y = vector[i + 1][k];
      vector[i + 1][k] = sine * x + cosine * y;
      vector[i][k] = cosine * x - sine * y;
    }
  }
};

/// Raises the eigenvalues of the Hessian of a translation-invariant function of P planar points to
/// at least ε [Teran et al. 2005]; ε = -∞ changes none. With γ = 1 / (1 + √P), the vectors e_i - γ
/// e_0 - const, i ≥ 1, are an orthonormal basis of the complement of the translations, in which H
/// is H_ij - γ (H_i0 + H_0j) + γ² H_00.
template <int P>
void project_spd(LaneMatrix<2 * P>& H, double epsilon) {
  constexpr int N = 2 * (P - 1);
  const double root = std::sqrt(static_cast<double>(P)), gamma = 1 / (1 + root);
  LaneMatrix<N> reduced;
  for (int i = 0; i < N; ++i)
    for (int j = 0; j <= i; ++j) {
      const int r = i % 2, q = j % 2;
      reduced(i, j) =
          H(i + 2, j + 2) - gamma * (H(i + 2, q) + H(j + 2, r)) + gamma * gamma * H.symmetric(r, q);
    }
  LaneEigen<N> eigen;
  eigen.decompose(reduced);
  Lanes v[static_cast<std::size_t>(2 * P)];
  for (int k = 0; k < N; ++k) {
    const Lanes lift = larger(epsilon - eigen.value[k], 0.0);
    if (!any_positive(lift)) continue;
    for (int r = 0; r < 2; ++r) {
      Lanes sum = 0.0;
      for (int i = r; i < N; i += 2) sum += eigen.vector[k][i];
      v[r] = -sum / root;
      for (int i = r; i < N; i += 2) v[i + 2] = eigen.vector[k][i] - gamma / root * sum;
    }
    for (int i = 0; i < 2 * P; ++i) {
      const Lanes lifted = lift * v[i];
      for (int j = 0; j <= i; ++j) H(i, j) += lifted * v[j];
    }
  }
  for (int i = 0; i < 2 * P; ++i)
    for (int j = i % 2; j <= i; j += 2) H(i, j) += (std::max)(epsilon, 0.0) / P;  // translations
}

// ==== [9] OBJECTIVE AND ITS QUADRATIC MODEL (paper §4.1-4.4, §5.1, §5.3, §5.4) ===================
//
// Purpose:    computes E(x) of Eq. 4 and §5 at one iterate, its gradient and projected Hessian,
//             their blend with earlier ones, and the squared Laplacian.
// Invariants: each row of a block matrix is built from the faces around its vertex. So rows are
//             independent, and sums run in the order of polygons and faces, never of threads.
// Fails:      never on injective embeddings.

/// Constants of the optimisation, tuned on real pairs.
struct Tuning {
  /// ω_R of §5. With the paper's 1e-8, triangles outside the overlap may degenerate to slivers, and
  /// E_Φ hits a barrier where the overlap would have to grow into them.
  double barrier_weight = 3e-4;
  double spd_epsilon = 1e-3;   // ε of §5.1, the least eigenvalue of a polygon's Hessian
  double history_decay = 0.8;  // of §5.3: weight of a Hessian relative to the next newer one
  int quasi_newton_steps = 6;  // the most per iteration, once ω_L is small, as long as they pay
  double omega_factor = 3;     // α of §5.4, by which an iteration may change ω_L
  double omega_least = 1e-4;   // the least ω_L that an iteration chooses
  /// The longest displacement of a vertex per step, in radii of the domain, and the largest loss of
  /// covered area per step, as a fraction of the area of either mesh.
  double max_displacement = 0.2;
  double max_coverage_loss = 0.05;
  /// The share of the area covered at the start that stays covered. Else many steps, each within
  /// max_coverage_loss, could give up the overlap of a badly fitting pair.
  double least_coverage = 0.5;
  /// The line search tries every search_stride-th step 0.8^ℓ, then the neighbours of the best.
  int search_stride = 3;
  /// The iterations over which Options::tolerance is averaged, half as many after coarse levels: a
  /// bridge over pauses before E falls again. No run stops while ω_L decreases above 1e-3.
  int window = 20;
};

/// The options of a run and the constants that follow from them.
struct RunOptions : Options {
  Tuning tuning;
  int first_cones = 0;  // the choice of cones that is tried first
  explicit RunOptions(const Options& options = {}) : Options(options) {
    if (as_published) {
      tuning.barrier_weight = 1e-8;
      tuning.history_decay = 0.5;
      tuning.omega_factor = 1.25;
      tuning.omega_least = tuning.least_coverage = 0;
      tuning.search_stride = 1;
      tuning.window = 10;
    }
    tuning.omega_least = (std::min)(tuning.omega_least, omega_start);
    if (as_published || omega_start == 0) tuning.quasi_newton_steps = 0;
  }
  bool has_positions() const { return initial_f.size() > 0 || initial_g.size() > 0; }
};

/// The weights of the objective that Options determine.
struct Weights {
  double kappa;    // κ
  double barrier;  // ω_R
  double epsilon;  // ε
  const DistortionMeasure* measure;
};

/// Returns κ of Options::coverage_weight.
inline double coverage_reward(const Options& options) {
  return (std::max)(0.0, options.coverage_weight + options.measure.isometry());
}

inline Weights weights_of(const RunOptions& options) {
  return {coverage_reward(options), options.tuning.barrier_weight, options.tuning.spd_epsilon,
          &options.measure};
}

// ---- linear systems; part [13] solves them ----

/// The upper triangle of a symmetric matrix of 2×2 blocks; columns ascend within a row.
struct BlockMatrix {
  Array<int> start;   // #rows + 1
  Array<int> column;  // per block
  Array<Mat2> value;
  int rows() const { return start.size() - 1; }
  int blocks() const { return column.size(); }

  /// Calls visit(row, column, b) for every block b.
  template <class Visit>
  void for_each_block(const Visit& visit) const {
    for (int r = 0; r < rows(); ++r)
      for (int b = start[r]; b < start[r + 1]; ++b) visit(r, column[b], b);
  }
};

/// A matrix H + ω Q; H and Q have the same pattern.
struct ShiftedMatrix {
  const BlockMatrix* H;
  const BlockMatrix* Q;  // may be null
  double omega;
  Mat2 block(int b) const {
    if (!Q) return H->value[b];
    return H->value[b] + omega * Q->value[b];
  }
};

inline double dot(const Array<Vec2>& a, const Array<Vec2>& b) {
  double sum = 0;
  for (int i = 0; i < a.size(); ++i) sum += dot(a[i], b[i]);
  return sum;
}

inline Array<Vec2> negated(const Array<Vec2>& a) {
  Array<Vec2> result(a.size());
  for (int i = 0; i < a.size(); ++i) result[i] = -a[i];
  return result;
}

struct LdltData;

/// A factor L D Lᵀ.
struct LdltFactor {
  bool ok = false;   // no zero or non-finite pivot
  int negative = 0;  // number of negative pivots; without any, the matrix is positive definite
  std::shared_ptr<LdltData> data;
};

/// Factorises a matrix whose rows belong to vertices at the given positions.
inline void ldlt_factorize(const ShiftedMatrix& matrix, const Points2& positions,
                           const Executor& executor, LdltFactor& factor);

/// Solves A x = b with the factor of A.
inline Array<Vec2> ldlt_solve(const LdltFactor& factor, const Array<Vec2>& b);

// ---- value ----

/// An iterate and all values computed at it.
struct Iterate {
  Points2 x;
  Overlay overlay;
  Array<Mat2> jacobian;           // per triangle
  double map_energy = 0;          // E_Φ
  double area_a = 0, area_b = 0;  // area A', area B'
  double energy_f = 0, energy_g = 0;
  double energy = kInfinity;  // E
  double pull = 0;            // hook: of a Pull
};

inline Mat2 triangle_jacobian(const Surface& s, const Points2& x, int f) {
  return jacobian(corner_place(s.mesh, x, f, 0), corner_place(s.mesh, x, f, 1),
                  corner_place(s.mesh, x, f, 2), s.rest_inverse[f]);
}

/// Returns E_f or E_g over triangles begin to end - 1; optionally sets their Jacobians.
inline double embedding_energy(const Surface& s, const Points2& x, int begin, int end,
                               Array<Mat2>* jacobians = nullptr) {
  double energy = 0;
  for (int f = begin; f < end; ++f) {
    const Mat2 J = triangle_jacobian(s, x, f);
    energy += triangle_energy(J, s.area[f]);
    if (jacobians != nullptr) (*jacobians)[f] = J;
  }
  return energy;
}

inline SixPoints six_points(const HalfEdgeMesh& m, const Points2& x, const OverlayPolygon& p) {
  SixPoints points;
  for (int k = 0; k < 3; ++k) {
    points[k] = corner_place(m, x, p.ta, k);
    points[3 + k] = corner_place(m, x, p.tb, k);
    if (!m.pillow.is_empty()) points[3 + k] = p.motion * points[3 + k];
  }
  return points;
}

/// Adds E_Φ and the covered areas over x.overlay; returns false once E_Φ exceeds `most`.
inline bool add_map_energy(const JointSurface& s, const DistortionMeasure& measure, double most,
                           Iterate& x) {
  for (const OverlayPolygon& p : x.overlay.polygons) {
    const SixPoints points = six_points(s.mesh, x.x, p);
    const double area = polygon_area(polygon_shape(p, points), points);
    if (is_negligible(area, points)) continue;
    const Mat2 &F = x.jacobian[p.ta], &G = x.jacobian[p.tb];
    x.map_energy += area * density_value(measure, F, G);
    x.area_a += area / determinant(F);
    x.area_b += area / determinant(G);
    if (x.map_energy > most) return false;
  }
  return true;
}

/// Computes the overlay and E at x.x (§5). Gives up with E = ∞ if the overlay is too large, or once
/// E would exceed `limit` even if the rest was covered without distortion.
inline void evaluate(const JointSurface& s, const Weights& weights, Iterate& x,
                     double limit = kInfinity) {
  x.energy = kInfinity;
  x.map_energy = x.area_a = x.area_b = 0;
  x.jacobian.resize(s.mesh.n_faces);
  x.energy_f = embedding_energy(s, x.x, 0, s.faces_a, &x.jacobian);
  x.energy_g = embedding_energy(s, x.x, s.faces_a, s.mesh.n_faces, &x.jacobian);
  const double embeddings = weights.barrier * (x.energy_f + x.energy_g);
  const double most = limit - embeddings + weights.kappa * s.total_area;
  if (most < 0) return;
  compute_overlay(s, x.x, x.overlay);
  if (x.overlay.is_too_large || !add_map_energy(s, *weights.measure, most, x)) return;
  x.energy = x.map_energy - weights.kappa * (x.area_a + x.area_b) + embeddings;
}

// ---- block matrices, row by row ----

/// A block (row, column), row <= column, of a matrix or to be added to it.
struct Block {
  int row, column;
  Mat2 value;
};

/// Sums blocks to the rows of a matrix, one row after the other.
struct RowWriter {
  int row = 0, first = 0;  // the current row, and its first block
  Array<Block> blocks;
  Array<int> place;  // per column: its block, if at least `first`

  void add(int column, const Mat2& value) {
    int& at = place[column];
    if (at < first) {
      at = blocks.size();
      blocks.push_back({row, column, {}});
    }
    blocks[at].value += value;
  }
};

/// Builds a matrix: fill(r, row) adds the summands of row r.
inline BlockMatrix build_rows(int rows, const Executor& executor,
                              const std::function<void(int, RowWriter&)>& fill) {
  constexpr int kLeast = 64, kMostTasks = 64;  // rows per task; each has an array as long as a row
  const int height = (std::max)(kLeast, (rows + kMostTasks - 1) / kMostTasks);
  Array<RowWriter> part((rows + height - 1) / height);
  BlockMatrix matrix;
  matrix.start.assign(rows + 1, 0);
  executor.run_blocks(rows, height, [&](int begin, int end) {
    RowWriter& writer = part[begin / height];
    writer.place.assign(rows, -1);
    for (int r = begin; r < end; ++r) {
      writer.row = r;
      writer.first = writer.blocks.size();
      fill(r, writer);
      std::sort(writer.blocks.begin() + writer.first, writer.blocks.end(),
                [](const Block& b, const Block& c) { return b.column < c.column; });
      matrix.start[r + 1] = writer.blocks.size() - writer.first;
    }
  });
  for (int r = 0; r < rows; ++r) matrix.start[r + 1] += matrix.start[r];
  matrix.column.reserve(matrix.start[rows]);
  matrix.value.reserve(matrix.start[rows]);
  for (RowWriter& writer : part) {
    for (const Block& block : writer.blocks) {
      matrix.column.push_back(block.column);
      matrix.value.push_back(block.value);
    }
    writer = RowWriter();
  }
  return matrix;
}

inline BlockMatrix sum_of_blocks(int rows, const Array<Block>& blocks, const Executor& executor) {
  const Groups<int> by_row = grouped<int>(rows, [&](const auto& add) {
    for (int i = 0; i < blocks.size(); ++i) add(blocks[i].row, i);
  });
  return build_rows(rows, executor, [&](int r, RowWriter& row) {
    by_row.for_each_in(r, [&](int i) { row.add(blocks[i].column, blocks[i].value); });
  });
}

struct Term {
  const BlockMatrix* matrix;
  double weight;
};

/// Returns Σ weight · matrix, on the union of the patterns.
inline BlockMatrix weighted_sum(const std::vector<Term>& terms, const Executor& executor) {
  return build_rows(terms[0].matrix->rows(), executor, [&](int r, RowWriter& row) {
    for (const Term& term : terms) {
      const BlockMatrix& A = *term.matrix;
      for (int b = A.start[r]; b < A.start[r + 1]; ++b)
        row.add(A.column[b], term.weight * A.value[b]);
    }
  });
}

// ---- gradient and projected Hessian ----

/// Gradient and projected Hessian at one iterate: an entry of the memory of §5.3.
struct QuadraticModel {
  Points2 x;             // the iterate
  Array<Vec2> gradient;  // per vertex
  BlockMatrix H;         // empty if only the gradient was computed
  bool has_hessian() const { return !H.start.empty(); }
};

/// Derivatives of the energy of a triangle and its polygons with respect to its vertices.
struct FaceTerm {
  Mat2 hessian[3][3];
  Vec2 gradient[3];
};

/// Mixed second derivatives of the polygons in a triangle of A, in its vertices and one of B.
struct Coupling {
  int vertex;
  Mat2 hessian[3];
};

/// Computes weighted derivatives of the symmetric Dirichlet energies of triangles begin to end - 1,
/// with Hessians projected first (§4.4, §5.1).
inline void embedding_terms(const Surface& s, const Points2& x, int begin, int end, double epsilon,
                            double weight, Array<FaceTerm>& terms) {
  TriangleBatch batch;
  for (; begin < end; begin += kLanes) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const int f = (std::min)(begin + lane, end - 1);
      for (int k = 0; k < 3; ++k) {
        const Vec2 p = corner_place(s.mesh, x, f, k);
        batch.x[2 * k][lane] = p.x;
        batch.x[2 * k + 1][lane] = p.y;
      }
      for (int k = 0; k < 4; ++k) batch.rest_inverse[k][lane] = s.rest_inverse[f].entry[k];
      batch.area[lane] = s.area[f];
    }
    differentiate(batch);
    project_spd<3>(batch.hessian, epsilon);
    for (int lane = 0; lane < kLanes && begin + lane < end; ++lane)
      for (int i = 0; i < 3; ++i) {
        FaceTerm& term = terms[begin + lane];
        term.gradient[i] =
            weight * Vec2{batch.gradient[2 * i][lane], batch.gradient[2 * i + 1][lane]};
        for (int j = 0; j < 3; ++j) term.hessian[i][j] = weight * batch.hessian.block(i, j, lane);
      }
  }
}

inline Array<Vec2> sum_gradients(const HalfEdgeMesh& m, const Array<FaceTerm>& terms) {
  Array<Vec2> gradient(m.n_vertices);
  for (int h = 0; h < m.tail.size(); ++h)
    gradient[m.tail[h]] += sign_of(m, h) * terms[h / 3].gradient[h % 3];
  return gradient;
}

/// Sums the terms of triangles by vertex; add_others(h, row) adds couplings of h's tail.
inline QuadraticModel sum_terms(const HalfEdgeMesh& m, const Array<FaceTerm>& terms,
                                const Executor& executor,
                                const std::function<void(int, RowWriter&)>& add_others) {
  QuadraticModel model;
  model.gradient = sum_gradients(m, terms);
  model.H = build_rows(m.n_vertices, executor, [&](int u, RowWriter& row) {
    m.for_each_outgoing(u, [&](int h) {
      const int first = h - h % 3;
      for (int e = first; e < first + 3; ++e)
        if (u <= m.tail[e])
          row.add(m.tail[e], sign_of(m, h) * sign_of(m, e) * terms[h / 3].hessian[h % 3][e % 3]);
      add_others(h, row);
    });
  });
  return model;
}

/// Computes the QuadraticModel of one iterate, element by element.
class ModelBuilder {
 public:
  ModelBuilder(const JointSurface& s, const Weights& weights, const Executor& executor)
      : s_(s), weights_(weights), executor_(executor) {}

  /// Differentiates all polygons and triangles (Algorithm 1, lines 4 to 7): Hessians are projected
  /// one by one; gradients alone cost a fraction.
  void differentiate_elements(const Iterate& x, bool with_hessians = true) {
    with_hessians_ = with_hessians;
    by_face_ = group_polygons(x.overlay.polygons, s_.mesh.n_faces);
    polygon_in_b_.resize(x.overlay.polygons.size());
    coupling_.resize(s_.faces_a);
    face_.resize(s_.mesh.n_faces);
    run_by_work(0, s_.faces_a, [&](int begin, int end) {
      differentiate_embedding(x, begin, end);
      for (int f = begin; f < end; ++f) coupling_[f].clear();
      differentiate_polygons(x, by_face_.start[begin], by_face_.start[end]);
    });
    run_by_work(s_.faces_a, s_.mesh.n_faces, [&](int begin, int end) {
      differentiate_embedding(x, begin, end);
      for (int f = begin; f < end; ++f)
        by_face_.for_each_in(f, [&](int i) { add(polygon_in_b_[i], face_[f]); });
    });
  }

  /// Sums the terms of the last differentiate_elements() (line 8).
  QuadraticModel assemble() const {
    if (!with_hessians_) return {{}, sum_gradients(s_.mesh, face_), {}};
    return sum_terms(s_.mesh, face_, executor_, [&](int h, RowWriter& row) {
      if (h >= 3 * s_.faces_a) return;
      for (const Coupling& c : coupling_[h / 3])
        row.add(c.vertex, sign_of(s_.mesh, h) * c.hessian[h % 3]);
    });
  }

 private:
  /// Runs task(begin, end) over blocks of about equal work: a coarse face contains many polygons.
  void run_by_work(int begin, int end, const std::function<void(int, int)>& task) const {
    constexpr int kBlock = 256;  // elements per task
    const auto elements_before = [&](int f) { return by_face_.start[f] + f; };
    Array<int> first(1, begin);
    for (int f = begin + 1; f < end; ++f)
      if (elements_before(f) - elements_before(first.back()) >= kBlock) first.push_back(f);
    first.push_back(end);
    executor_.run(first.size() - 1, [&](int i) {
      if (!executor_.is_stopped()) task(first[i], first[i + 1]);
    });
  }

  void add(const FaceTerm& term, FaceTerm& sum) const {
    for (int i = 0; i < 3; ++i) {
      sum.gradient[i] += term.gradient[i];
      for (int j = 0; j < 3 && with_hessians_; ++j) sum.hessian[i][j] += term.hessian[i][j];
    }
  }

  /// Differentiates polygons begin to end - 1 of the order by face; the last one fills spare lanes.
  void differentiate_polygons(const Iterate& x, int begin, int end) {
    const auto batch = std::make_unique<PolygonBatch>();
    for (; begin < end; begin += kLanes) {
      for (int lane = 0; lane < kLanes; ++lane) {
        const int id = by_face_.item[(std::min)(begin + lane, end - 1)];
        const OverlayPolygon& p = x.overlay.polygons[id];
        load(p, six_points(s_.mesh, x.x, p), s_.rest_inverse[p.ta], s_.rest_inverse[p.tb], lane,
             *batch);
      }
      if (with_hessians_) {
        differentiate(*weights_.measure, weights_.kappa, *batch);
        project_spd<6>(batch->hessian, weights_.epsilon);
      } else {
        differentiate_once(*weights_.measure, weights_.kappa, *batch);
      }
      for (int lane = 0; lane < kLanes && begin + lane < end; ++lane)
        store(x, by_face_.item[begin + lane], lane, *batch);
    }
  }

  static Vec2 force(const PolygonBatch& batch, int corner, int lane) {
    return {batch.gradient[2 * corner][lane], batch.gradient[2 * corner + 1][lane]};
  }

  void differentiate_embedding(const Iterate& x, int begin, int end) {
    if (with_hessians_)
      return embedding_terms(s_, x.x, begin, end, weights_.epsilon, weights_.barrier, face_);
    for (int f = begin; f < end; ++f) {
      const CornerWeights<double> B(s_.rest_inverse[f].entry);
      const TriangleDensity<double> w = triangle_density(x.jacobian[f].entry);
      for (int i = 0; i < 3; ++i)
        face_[f].gradient[i] = weights_.barrier * s_.area[f] * point_gradient(w, B, i);
    }
  }

  void store(const Iterate& x, int id, int lane, const PolygonBatch& batch) {
    const OverlayPolygon& p = x.overlay.polygons[id];
    FaceTerm &a = face_[p.ta], &b = polygon_in_b_[id];
    std::fill_n(b.gradient, 3, Vec2());
    if (with_hessians_) b = FaceTerm();
    if (batch.is_negligible[lane] != 0) return;
    for (int j = 0; j < 3; ++j) {
      a.gradient[j] += force(batch, j, lane);
      b.gradient[j] = p.motion.sign * force(batch, 3 + j, lane);
      if (!with_hessians_) continue;
      const double sign = p.motion.sign * sign_of(s_.mesh, 3 * p.tb + j);
      Coupling& coupling = coupling_with(s_.mesh.corner(p.tb, j), coupling_[p.ta]);
      for (int i = 0; i < 3; ++i) {
        a.hessian[i][j] += batch.hessian.block(i, j, lane);
        b.hessian[i][j] = batch.hessian.block(3 + i, 3 + j, lane);
        coupling.hessian[i] += sign * batch.hessian.block(i, 3 + j, lane);
      }
    }
  }

  /// Returns the coupling with a vertex if it is one of the last 16, else a new one.
  static Coupling& coupling_with(int vertex, Array<Coupling>& couplings) {
    constexpr int kLast = 16;
    const int n = couplings.size();
    for (int i = n - 1; i >= 0 && i >= n - kLast; --i)
      if (couplings[i].vertex == vertex) return couplings[i];
    couplings.push_back({vertex, {}});
    return couplings.back();
  }

  const JointSurface& s_;
  const Weights& weights_;
  const Executor& executor_;
  Groups<int> by_face_;
  Array<FaceTerm> polygon_in_b_;     // per polygon, its part between vertices of B
  Array<Array<Coupling>> coupling_;  // per triangle of A
  Array<FaceTerm> face_;
  bool with_hessians_ = true;
};

// ---- squared Laplacian (§5.4; Algorithm 1, line 1) ----

/// Returns the cotangent of the angle at p between q and r, clamped to ±100: angles below 0.6
/// degrees reflect the triangulation, not the surface.
inline double cotangent(const Vec3& p, const Vec3& q, const Vec3& r) {
  const Vec3 u = q - p, v = r - p;
  const double sine = norm(cross(u, v));
  return std::clamp(dot(u, v) / (std::max)(sine, 1e-300), -100.0, 100.0);
}

/// Returns the Voronoi areas of the vertices, safe for obtuse triangles [Meyer et al. 2003].
inline Array<double> vertex_areas(const Surface& s) {
  Array<double> mass(s.mesh.n_vertices, 0);
  for (int f = 0; f < s.mesh.n_faces; ++f) {
    const Vec3 p[3] = {s.corner(f, 0), s.corner(f, 1), s.corner(f, 2)};
    double cot[3];
    for (int k = 0; k < 3; ++k) cot[k] = cotangent(p[k], p[(k + 1) % 3], p[(k + 2) % 3]);
    const bool obtuse = cot[0] < 0 || cot[1] < 0 || cot[2] < 0;
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      const double voronoi =
          (cot[i] * squared_norm(p[k] - p[j]) + cot[j] * squared_norm(p[k] - p[i])) / 8;
      mass[s.mesh.corner(f, k)] += !obtuse ? voronoi : s.area[f] * (cot[k] < 0 ? 0.5 : 0.25);
    }
  }
  return mass;
}

/// Returns all rows of the cotangent Laplacian C, not divided by areas; their sums are zero.
inline BlockMatrix cotangent_laplacian(const Surface& s, const Executor& executor) {
  return build_rows(s.mesh.n_vertices, executor, [&](int u, RowWriter& row) {
    s.mesh.for_each_outgoing(u, [&](int h) {
      for (int e : {next(h), prev(h)}) {
        const int opposite = e == next(h) ? prev(h) : next(h), v = s.mesh.tail[e];
        const double weight = 0.5 * cotangent(row3(s.vertices, s.mesh.tail[opposite]),
                                              row3(s.vertices, u), row3(s.vertices, v));
        row.add(u, diagonal(weight));
        row.add(v, diagonal(-weight * sign_of(s.mesh, h) * sign_of(s.mesh, e)));
      }
    });
  });
}

/// Returns Lᵀ M L = C M⁻¹ C, equal for both coordinates, scaled by the mean area so that ω_L has no
/// unit. A row of C couples all its vertices, so rows of hubs are left out: the rows of its
/// neighbours smooth a hub, like a boundary vertex.
inline BlockMatrix squared_laplacian(const JointSurface& s, const Executor& executor) {
  const Array<double> mass = vertex_areas(s);
  const BlockMatrix C = cotangent_laplacian(s, executor);
  return build_rows(C.rows(), executor, [&](int u, RowWriter& row) {
    row.add(u, {});
    for (int k = C.start[u]; k < C.start[u + 1]; ++k) {
      const int w = C.column[k], begin = C.start[w], end = C.start[w + 1];
      const Mat2 scaled = 0.5 * s.total_area / mass[w] * C.value[k];
      for (int b = begin; b < end && end - begin <= kHub + 1; ++b)
        if (u <= C.column[b]) row.add(C.column[b], scaled * C.value[b]);
    }
  });
}

// ---- the blended system (§5.3) ----

/// The blended Hessian H_+, the preconditioner Q on the same pattern, and the gradient.
struct LinearSystem {
  BlockMatrix H, Q;  // Q is empty without a preconditioner
  Array<Vec2> gradient;

  bool has_Q() const { return !Q.start.empty(); }
  ShiftedMatrix shifted(double omega) const { return {&H, has_Q() ? &Q : nullptr, omega}; }
};

/// Returns the mean of the gradients in the memory, newest first, with weights decay^k (§5.3).
inline Array<Vec2> blended_gradient(const Array<QuadraticModel>& history, double decay) {
  Array<Vec2> gradient(history[0].gradient.size());
  double sum = 0;
  for (int k = 0; k < history.size(); ++k) {
    const double weight = power(decay, k);
    sum += weight;
    for (int r = 0; r < gradient.size(); ++r) gradient[r] += weight * history[k].gradient[r];
  }
  for (Vec2& g : gradient) g = 1 / sum * g;
  return gradient;
}

/// Blends the Hessians in the memory, newest first, with normalised weights decay^k; adds `others`
/// and, unless empty, the preconditioner (Algorithm 1, line 9).
inline LinearSystem blend(const Array<QuadraticModel>& history, double decay,
                          const BlockMatrix& others, const BlockMatrix& laplacian,
                          const Executor& executor) {
  LinearSystem system;
  system.gradient = blended_gradient(history, decay);
  Array<Term> terms;
  double total = 0;
  for (const QuadraticModel& model : history) {
    if (!model.has_hessian()) continue;
    terms.push_back({&model.H, power(decay, terms.size())});
    total += terms.back().weight;
  }
  for (Term& term : terms) term.weight /= total;
  if (!others.start.empty()) terms.push_back({&others, 1});
  if (!laplacian.start.empty()) terms.push_back({&laplacian, 0});
  system.H = weighted_sum(terms, executor);
  if (!laplacian.start.empty())
    system.Q = weighted_sum({{&laplacian, 1}, {&system.H, 0}}, executor);
  return system;
}

// ==== [10] CONSTRAINTS (paper §4.5, §4.6) ========================================================
//
// Purpose:    reduces the linear system by constraints of vertices: a follower is a fixed
//             combination of vertices of the other mesh (pins and exact landmarks, §4.5); a fixed
//             coordinate does not move (held boundaries, fixed vertices, rigid motions, §4.6).
// Invariants: with P the linear map from the unknowns to all coordinates, the system becomes
//             exactly Pᵀ H P, Pᵀ Q P, Pᵀ g. Eliminated coordinates keep a unit row, so rows keep
//             their numbers.
// Fails:      never; entry points reject contradictory constraints.

// ---- followers ----

/// Returns the barycentric coordinates of p in a triangle of positive area, even a sliver.
inline Vec3 barycentric(Vec2 p, Vec2 a, Vec2 b, Vec2 c) {
  const double area = accurate_area(a, b, c);
  return {accurate_area(b, c, p) / area, accurate_area(c, a, p) / area,
          accurate_area(a, b, p) / area};
}

/// A vertex held on the other surface: x_row = Σ_k weight_k motion_k x_master_k. No master is a
/// follower.
struct Follower {
  int row;
  int master[3];
  Vec3 weight;
  std::array<Motion, 3> motion = {};  // on a pillow

  /// Calls visit(v, w) with w the derivative of x_row in x_v.
  template <class Visit>
  void for_each_master(const Visit& visit) const {
    for (int k = 0; k < 3; ++k)
      if (weight[k] != 0) visit(master[k], weight[k] * motion.data()[k].sign);
  }
  Vec2 master_place(const Points2& x, int k) const { return motion.data()[k] * row2(x, master[k]); }
};

/// Returns a follower at a point of a triangle, whose plane `motion` takes to that of the row.
inline Follower follower_in(const HalfEdgeMesh& m, int row, int face, const Vec3& weight,
                            const Motion& motion = {}) {
  Follower follower = {row, {m.corner(face, 0), m.corner(face, 1), m.corner(face, 2)}, weight, {}};
  for (int k = 0; k < 3 && !m.pillow.is_empty(); ++k)
    follower.motion.data()[k] = motion * m.pillow.place[3 * face + k];
  return follower;
}

/// Computes P d: interpolates the directions of followers from their masters.
inline void expand_direction(const Array<Follower>& followers, Array<Vec2>& d) {
  for (const Follower& follower : followers) {
    Vec2 sum;
    follower.for_each_master([&](int v, double w) { sum += w * d[v]; });
    d[follower.row] = sum;
  }
}

/// Interpolates the positions of followers from their masters.
inline void place_followers(const HalfEdgeMesh& m, const Array<Follower>& followers, Points2& x) {
  for (const Follower& follower : followers) {
    Vec2 sum;
    for (int k = 0; k < 3; ++k)
      if (follower.weight[k] != 0) sum += follower.weight[k] * follower.master_place(x, k);
    set_row(x, follower.row, usable(m, sum));
  }
}

/// Returns the largest distance, on the surfaces, between a follower and its prescribed point.
inline double pin_residual(const Surface& s, const Array<Follower>& followers, const Points2& x) {
  double largest = 0;
  for (const Follower& follower : followers) {
    const Vec3 off = barycentric(row2(x, follower.row), follower.master_place(x, 0),
                                 follower.master_place(x, 1), follower.master_place(x, 2)) -
                     follower.weight;
    Vec3 distance;
    for (int k = 0; k < 3; ++k) distance += off[k] * row3(s.vertices, follower.master[k]);
    largest = (std::max)(largest, norm(distance));
  }
  return largest;
}

// ---- fixed coordinates ----

/// Coordinates that do not move, two per row.
struct FixedCoordinates {
  Array<char> flag;
  explicit FixedCoordinates(int rows = 0) : flag(2 * rows, 0) {}
  char& operator()(int row, int c) { return flag[2 * row + c]; }
  bool operator()(int row, int c) const { return flag[2 * row + c] != 0; }
  void fix(int row) { flag[2 * row] = flag[2 * row + 1] = 1; }
  bool any() const { return std::find(flag.begin(), flag.end(), 1) != flag.end(); }
};

/// Fixes the coordinates of held boundaries. With Boundary::kSlide, a vertex on an axis-parallel
/// line with both neighbours may move along it.
inline void fix_boundaries(const HalfEdgeMesh& m, const Points2& x, Boundary boundary,
                           FixedCoordinates& is_fixed) {
  if (boundary == Boundary::kFree) return;
  for (int loop = 0; loop < m.loops(); ++loop) {
    int before = m.boundary[m.loop[loop + 1] - 1];
    for (int i = m.loop[loop]; i < m.loop[loop + 1]; before = m.boundary[i++]) {
      const int h = m.boundary[i], v = m.tail[h];
      const Vec2 p = row2(x, m.tail[before]), q = row2(x, v), r = row2(x, m.tip(h));
      const bool slides = boundary == Boundary::kSlide;
      is_fixed(v, 0) = !(slides && p.y == q.y && q.y == r.y);
      is_fixed(v, 1) = !(slides && p.x == q.x && q.x == r.x);
    }
  }
}

// ---- the system of the unknowns ----

/// Returns Pᵀ A P, with `unit` on the diagonal of eliminated coordinates.
inline BlockMatrix reduced(const Array<Follower>& followers, const FixedCoordinates& is_fixed,
                           BlockMatrix A, double unit, const Executor& executor) {
  Array<const Follower*> follower_of(A.rows(), nullptr);
  for (const Follower& follower : followers) follower_of[follower.row] = &follower;
  const auto for_each_source = [&](int row, const auto& visit) {
    follower_of[row] != nullptr ? follower_of[row]->for_each_master(visit) : visit(row, 1.0);
  };
  Array<Block> moved;
  const auto move = [&](int r, int c, int b) {
    if (follower_of[r] == nullptr && follower_of[c] == nullptr) return;
    const Mat2 value = A.value[b];
    A.value[b] = diagonal(r == c ? unit : 0);
    for_each_source(r, [&](int i, double wi) {
      for_each_source(c, [&](int j, double wj) {
        if (i <= j) moved.push_back({i, j, wi * wj * value});
        if (j <= i && r != c) moved.push_back({j, i, wi * wj * transposed(value)});
      });
    });
  };
  const auto fix = [&](int r, int c, int b) {
    Mat2& block = A.value[b];
    for (int k = 0; k < 2; ++k) {
      if (is_fixed(r, k)) block(k, 0) = block(k, 1) = 0;
      if (is_fixed(c, k)) block(0, k) = block(1, k) = 0;
      if (is_fixed(r, k) && r == c) block(k, k) = unit;
    }
  };
  if (!followers.empty()) {
    A.for_each_block(move);
    const BlockMatrix added = sum_of_blocks(A.rows(), moved, executor);
    A = weighted_sum({{&A, 1}, {&added, 1}}, executor);
  }
  A.for_each_block(fix);
  return A;
}

/// Computes Pᵀ g.
inline void reduce(const Array<Follower>& followers, const FixedCoordinates& is_fixed,
                   Array<Vec2>& gradient) {
  for (const Follower& follower : followers) {
    const Vec2 force = gradient[follower.row];
    gradient[follower.row] = {};
    follower.for_each_master([&](int v, double w) { gradient[v] += w * force; });
  }
  for (int r = 0; r < gradient.size(); ++r) {
    if (is_fixed(r, 0)) gradient[r].x = 0;
    if (is_fixed(r, 1)) gradient[r].y = 0;
  }
}

/// Reduces a system to the unknowns; expand_direction() then sets followers in its solution.
inline void reduce(const Array<Follower>& followers, const FixedCoordinates& is_fixed,
                   const Executor& executor, LinearSystem& system) {
  system.H = reduced(followers, is_fixed, std::move(system.H), 1, executor);
  if (system.has_Q()) system.Q = reduced(followers, is_fixed, std::move(system.Q), 0, executor);
  reduce(followers, is_fixed, system.gradient);
}

// ---- rigid motions (§4.6) ----

struct RigidMotion {
  Mat2 rotation = diagonal(1);
  Vec2 translation;
};

/// Returns the rotation of the x axis into a direction; the identity for the null vector.
inline Mat2 rotation_to(Vec2 direction) {
  const double length = norm(direction);
  const Vec2 d = length > 0 ? 1 / length * direction : Vec2{1, 0};
  return {{d.x, d.y, -d.y, d.x}};
}

/// Returns the motion that turns the x axis into a direction and maps `from` to `to`.
inline RigidMotion rigid_motion(Vec2 direction, Vec2 from, Vec2 to) {
  const Mat2 R = rotation_to(direction);
  return {R, to - R * from};
}

inline Points2 transformed(const Points2& x, const RigidMotion& motion) {
  Points2 y(x.rows(), 2);
  for (int i = 0; i < x.rows(); ++i)
    set_row(y, i, flush_tiny(motion.rotation * row2(x, i) + motion.translation));
  return y;
}

/// Vertices of B that fix rigid motions: the most central one at the origin, a boundary vertex far
/// from it on the x-axis. The choice depends on the surface, not on positions.
struct Anchors {
  int center = 0;
  int rim = 0;
};

inline Anchors choose_anchors(const JointSurface& s, const Array<Follower>& followers) {
  Array<int> boundary;
  for (int h : s.mesh.boundary) boundary.push_back(s.mesh.tail[h]);
  Array<int> distance = distances_in_edges(s.mesh, boundary);
  for (const Follower& follower : followers) distance[follower.row] = -1;
  Anchors anchors = {s.n_a, s.n_a};
  for (int v = s.n_a; v < s.mesh.n_vertices; ++v)
    if (distance[v] > distance[anchors.center]) anchors.center = v;
  double farthest = -1;
  for (int h : s.mesh.boundary) {
    const int v = s.mesh.tail[h];
    const double d = norm(row3(s.vertices, v) - row3(s.vertices, anchors.center));
    if (v < s.n_a || v == anchors.center || distance[v] < 0 || d <= farthest) continue;
    farthest = d;
    anchors.rim = v;
  }
  return anchors;
}

/// Moves both planes to put the anchors in place, unless rounding would invert thin triangles.
inline void move_to_anchors(const HalfEdgeMesh& m, const Anchors& anchors, Points2& x) {
  const Vec2 origin = row2(x, anchors.center), axis = row2(x, anchors.rim) - origin;
  if (origin == Vec2() && axis.y == 0 && axis.x > 0) return;  // else by rounding
  Points2 y = transformed(x, rigid_motion({axis.x, -axis.y}, origin, Vec2()));
  set_row(y, anchors.center, Vec2());
  y(anchors.rim, 1) = 0;
  if (is_injective(m, y)) x.swap(y);
}

// ==== [11] STEP BOUND AND LINE SEARCH (paper §5.2) ===============================================
//
// Purpose:    computes the largest feasible step of a direction and the best step below it.
// Invariants: an accepted trial is injective, decided exactly on the rounded positions.
// Fails:      without an acceptable trial: no descent, or colliding boundaries.

// ---- step bound [Smith and Schaefer 2015] ----

/// Returns the smallest s > 0 at which the triangle p + s d loses its area: the first root of
/// cross(u, v) + s (cross(u, dv) + cross(du, v)) + s² cross(du, dv). The rounded area of a positive
/// sliver may be 0 or less; its rounding error then replaces it.
inline double triangle_max_step(Vec2 u, Vec2 v, Vec2 du, Vec2 dv) {
  const double rounding = DBL_EPSILON * (std::abs(u.x * v.y) + std::abs(u.y * v.x));
  const double c = (std::max)({cross(u, v), rounding, DBL_MIN});
  const double b = cross(u, dv) + cross(du, v), a = cross(du, dv);
  const double discriminant = b * b - 4 * a * c;
  if (!(discriminant >= 0)) return kInfinity;
  const double root = std::sqrt(discriminant);
  if (b < 0) return 2 * c / (root - b);
  return a < 0 ? -(b + root) / (2 * a) : kInfinity;
}

/// Returns s_max over all triangles of a mesh.
inline double max_step(const HalfEdgeMesh& m, const Points2& x, const Array<Vec2>& d) {
  double s = kInfinity;
  for (int f = 0; f < m.n_faces; ++f) {
    const int h = 3 * f, i = next(h), j = prev(h);
    const Vec2 p = place_of(m, x, h), move = sign_of(m, h) * d[m.tail[h]];
    s = (std::min)(s, triangle_max_step(place_of(m, x, i) - p, place_of(m, x, j) - p,
                                        sign_of(m, i) * d[m.tail[i]] - move,
                                        sign_of(m, j) * d[m.tail[j]] - move));
  }
  return s;
}

/// Returns x + s d, with followers in their places.
inline Points2 moved(const HalfEdgeMesh& m, const Array<Follower>& followers, const Points2& x,
                     const Array<Vec2>& d, double s) {
  Points2 y(x.rows(), 2);
  for (int i = 0; i < x.rows(); ++i) set_row(y, i, usable(m, row2(x, i) + s * d[i]));
  place_followers(m, followers, y);
  return y;
}

// ---- gaps of a boundary (§4.4) ----
//
// The paper suggests a scaffold [Jiang, Schaefer and Panozzo 2017] to keep a boundary simple. Here,
// only narrow gaps between parts of it resist: their energy is infinite where they close, and least
// at x, so a step that lowers the sum of both energies lowers E. Every iteration finds them anew.

/// A gap between a boundary vertex v and a point of a boundary edge, (1 - t) u + t w.
struct Gap {
  int v, u, w;
  double t;
  Vec2 normal;  // across the gap, divided by its width at x
  double weight;

  /// The width relative to that at x, or its change by moves of the vertices.
  template <class Place>
  double width(const Place& place) const {
    return dot(normal, place(v) - (1 - t) * place(u) - t * place(w));
  }
};

/// Finds the gaps that are narrow for the edges beside them; `weight`: of all together.
inline Array<Gap> find_gaps(const HalfEdgeMesh& m, const Points2& x, double weight) {
  constexpr double kReach = 0.5;    // widest gap, in boundary edges
  constexpr double kNarrow = 1e-6;  // below, gaps would be too stiff for the linear solver
  constexpr double kLeast = 1e-60;  // share of the weight; below, only the exact test decides
  Array<Gap> gaps;
  for (int c = 0; c + 1 < m.component.size(); ++c) {
    const int begin = m.loop[m.component[c]], end = m.loop[m.component[c + 1]];
    BoxTree tree;
    build_tree(m, x, begin, end, tree);
    for (int i = begin; i < end; ++i) {
      const int v = m.tail[m.boundary[i]];
      const Vec2 p = row2(x, v);
      const double reach = kReach * norm(row2(x, m.tip(m.boundary[i])) - p);
      const Vec2 lo = p - Vec2{reach, reach}, hi = p + Vec2{reach, reach};
      const auto is_near = [&](Vec2 low, Vec2 high) { return boxes_meet(lo, hi, low, high); };
      tree.find(is_near, [&](int k) {
        const int u = m.tail[m.boundary[begin + k]], w = m.tip(m.boundary[begin + k]);
        const Vec2 a = row2(x, u), b = row2(x, w), along = b - a;
        if (v == u || v == w || !(orient2d(a, b, p) < 0)) return false;
        const double t = clamp01(dot(p - a, along) / squared_norm(along));
        const Vec2 across = p - a - t * along;
        const double width = norm(across), openness = width / (kNarrow * reach);
        const double share = (std::min)(1.0, openness * openness);
        if (width < reach && share > kLeast)
          gaps.push_back(
              {v, u, w, t, 1 / (width * width) * across, weight * share / m.boundary.size()});
        return false;
      });
    }
  }
  return gaps;
}

/// Returns the energy of gaps of relative widths r, Σ weight (r + 1/r - 2).
inline double gap_energy(const Array<Gap>& gaps, const Points2& x) {
  double energy = 0;
  for (const Gap& gap : gaps) {
    const double r = gap.width([&](int v) { return row2(x, v); });
    energy += r > 0 ? gap.weight * (r - 1) * (r - 1) / r : kInfinity;
  }
  return energy;
}

/// Returns the largest step that closes no gap.
inline double max_step(const Array<Gap>& gaps, const Array<Vec2>& d) {
  double s = kInfinity;
  for (const Gap& gap : gaps)
    if (const double change = gap.width([&](int v) { return d[v]; }); change < 0)
      s = (std::min)(s, -1 / change);
  return s;
}

/// Adds the Hessian at x, where the gradient is zero.
inline void add_gaps(const Array<Gap>& gaps, Array<Block>& blocks) {
  for (const Gap& gap : gaps) {
    const int vertex[3] = {gap.v, gap.u, gap.w};
    const double c[3] = {1, gap.t - 1, -gap.t};
    const Mat2 H = 2 * gap.weight * columns(gap.normal.x * gap.normal, gap.normal.y * gap.normal);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        if (vertex[i] <= vertex[j]) blocks.push_back({vertex[i], vertex[j], c[i] * c[j] * H});
  }
}

// ---- hook: springs between vertices (parts [14] and [21]) ----

/// A penalty uᵀ K u - 2 forceᵀ u on the vector u = p - motion q between two vertices.
struct Spring {
  int p, q;
  Mat2 stiffness;  // K
  Vec2 force = {};
  Motion motion = {};  // of q, on a pillow
  Vec2 vector(const Points2& x) const { return row2(x, p) - motion * row2(x, q); }
};

inline double with_springs(double energy, const Array<Spring>& springs, const Points2& x) {
  for (const Spring& s : springs) {
    const Vec2 u = s.vector(x);
    energy += dot(s.stiffness * u - 2 * s.force, u);
  }
  return energy;
}

inline void add_spring_gradient(const Array<Spring>& springs, const Points2& x,
                                Array<Vec2>& gradient) {
  for (const Spring& s : springs) {
    const Vec2 slope = 2 * (s.stiffness * s.vector(x) - s.force);
    gradient[s.p] += slope;
    gradient[s.q] += -s.motion.sign * slope;
  }
}

inline void add_springs(const Array<Spring>& springs, Array<Block>& blocks) {
  for (const Spring& s : springs) {
    const Mat2 stiffness = 2 * s.stiffness;
    blocks.push_back({s.p, s.p, stiffness});
    blocks.push_back({s.q, s.q, stiffness});
    blocks.push_back({(std::min)(s.p, s.q), (std::max)(s.p, s.q), -s.motion.sign * stiffness});
  }
}

/// Hook: an energy that depends on the map. Returns it, at least 0, for an iterate, and adds
/// springs that have its gradient there.
using Pull = std::function<double(const Iterate& x, Array<Spring>& springs)>;

// ---- line search ----

/// A descent direction for one ω_L.
struct Direction {
  double omega = 0;
  Array<Vec2> d;
  double slope = kInfinity;  // gᵀd; negative unless x is stationary, infinite without a solution
  double max_step = 0;       // s_max
  double first_step = 0;     // where backtracking starts
};

/// A trial step along one of several directions.
struct TrialStep {
  int direction = 0;
  double length = 0;
};

/// The result of a trial step.
struct Trial {
  TrialStep step;
  double omega = 0, max_step = 0;  // of the direction
  bool accepted = false;
  bool collides = false;  // rejected because a boundary intersects itself
  double resistance = 0;  // energy of gaps
  double pull = 0;        // increase of the springs' and the hook's energy
  Iterate x;
  double value() const { return x.energy + resistance + pull; }
};

/// Conditions on a trial besides injectivity.
struct StepRules {
  double max_area_loss_a, max_area_loss_b;  // of covered area, per step
  double least_area_a, least_area_b;        // of covered area; less than this must not shrink
};

/// Returns the largest E of an acceptable trial: Armijo's rule (Algorithm 1, line 21).
inline double largest_energy(const Iterate& from, const Direction& d, const Trial& t) {
  constexpr double kArmijo = 1e-4;
  return from.energy + kArmijo * t.step.length * d.slope - t.resistance - t.pull;
}

inline bool is_acceptable(const StepRules& rules, const Iterate& from, const Direction& d,
                          const Trial& t) {
  const Iterate& to = t.x;
  const auto keeps_area = [](double before, double after, double most_loss, double least) {
    return before - after <= most_loss && (after > least || after >= before);
  };
  return std::isfinite(to.energy) && to.energy <= largest_energy(from, d, t) &&
         t.value() < from.energy &&  // rejects steps without effect
         keeps_area(from.area_a, to.area_a, rules.max_area_loss_a, rules.least_area_a) &&
         keeps_area(from.area_b, to.area_b, rules.max_area_loss_b, rules.least_area_b);
}

inline constexpr double kShrink = 0.8;  // line 22

/// Returns true if all triangles are positive but a boundary intersects itself.
inline bool collides(const HalfEdgeMesh& m, const Points2& x) {
  return all_triangles_positive(m, x) && !boundaries_are_simple(m, x);
}

/// The data shared by all trials.
struct SearchProblem {
  const JointSurface& s;
  const Weights& weights;
  const StepRules& rules;
  const Array<Follower>& followers;
  const Array<Gap>& gaps;
  const Array<Spring>& springs;  // without those of `pull`
  const Pull& pull;
  const Iterate& from;
  const Executor& executor;
  int stride;  // Tuning::search_stride
};

/// Takes a trial step along d and decides whether it is acceptable (lines 18 to 21). Stops early
/// once it cannot be accepted or cannot have a value below `best`.
inline void evaluate_trial(const SearchProblem& problem, const Direction& d, double best,
                           Trial& t) {
  const HalfEdgeMesh& m = problem.s.mesh;
  t.omega = d.omega;
  t.max_step = d.max_step;
  t.x.x = moved(m, problem.followers, problem.from.x, d.d, t.step.length);
  t.accepted = is_injective(m, t.x.x);
  t.collides = !t.accepted && collides(m, t.x.x);
  if (!t.accepted) return;
  t.resistance = gap_energy(problem.gaps, t.x.x);
  t.pull = with_springs(0, problem.springs, t.x.x) -
           with_springs(0, problem.springs, problem.from.x) - problem.from.pull;
  const double limit = (std::min)(largest_energy(problem.from, d, t), best - t.resistance - t.pull);
  evaluate(problem.s, problem.weights, t.x, limit);
  t.x.pull = 0;
  if (problem.pull && t.x.energy <= limit) {
    Array<Spring> springs;
    t.x.pull = problem.pull(t.x, springs);
    t.pull += t.x.pull;
  }
  t.accepted = is_acceptable(problem.rules, problem.from, d, t);
}

/// The line search (lines 17 to 23): keeps the best trial, reuses the memory of the others.
class LineSearch {
 public:
  bool found = false;     // an acceptable trial
  bool collided = false;  // a trial failed because a boundary intersects itself
  Trial best;             // valid if found

  /// Tries all directions in blocks of eight steps 0.8^ℓ (§5.2); with a stride of three, every
  /// third of nine, then the neighbours of the best one.
  void run(const SearchProblem& problem, const Array<Direction>& directions) {
    constexpr int kMost = 80;  // bound on ℓ; later steps are below 2e-8 of the first
    const int stride = problem.stride, block = (7 / stride + 1) * stride;
    clear();
    for (int first = 0; first < kMost && !found && !problem.executor.is_stopped(); first += block) {
      Array<TrialStep> steps;
      for (int k = 0; k < directions.size(); ++k) {
        const double longest = directions[k].first_step;
        for (int l = first + stride / 2; l < first + block; l += stride)
          steps.push_back({k, longest * power(kShrink, l)});
        if (first == 0 && longest > 1) steps.push_back({k, 1});
      }
      add(problem, directions, steps);
      if (!found || stride == 1) continue;
      const TrialStep middle = best.step;
      const double longest = directions[middle.direction].first_step;
      steps.clear();
      steps.push_back({middle.direction, (std::min)(middle.length / kShrink, longest)});
      steps.push_back({middle.direction, middle.length * kShrink});
      add(problem, directions, steps);
    }
  }

  void clear() {
    found = collided = false;
    tried_ = 0;
  }

  /// Tries steps in parallel. Among trials of equal value, the first one is the best.
  void add(const SearchProblem& problem, const Array<Direction>& directions,
           const Array<TrialStep>& steps) {
    const double least = found ? best.value() : kInfinity;
    spare_.reserve(spare_.size() + steps.size());  // no allocation while locked
    problem.executor.run(steps.size(), [&](int i) {
      if (problem.executor.is_stopped()) return;
      Trial t = take();
      t.step = steps[i];
      evaluate_trial(problem, directions[t.step.direction], least, t);
      give(t, tried_ + i);
    });
    tried_ += steps.size();
  }

 private:
  Trial take() {
    Trial t;
    const SpinLock lock(is_locked_);
    if (!spare_.empty()) {
      std::swap(t, spare_.back());
      spare_.pop_back();
    }
    return t;
  }

  void give(Trial& t, int number) {
    const SpinLock lock(is_locked_);
    collided = collided || t.collides;
    if (t.accepted && (!found || t.value() < best.value() ||
                       (t.value() == best.value() && number < number_of_best_))) {
      found = true;
      number_of_best_ = number;
      std::swap(t, best);
    }
    spare_.push_back(std::move(t));
  }

  std::atomic_flag is_locked_ = ATOMIC_FLAG_INIT;
  int tried_ = 0, number_of_best_ = 0;
  Array<Trial> spare_;
};

// ==== [12] THE LOOP (paper §5, Algorithm 1) ======================================================
//
// Purpose:    minimises E from an injective start: Optimizer::iterate() is Algorithm 1, with its
//             line numbers. Functions for its lines follow in order, then everything beyond the
//             paper under one heading.
// Invariants: every iterate is injective, decided exactly; E never grows.
// Fails:      stalls if no step along any direction is acceptable; the status says so.

inline void describe(const JointSurface& s, const Array<Follower>& followers, const Iterate& x,
                     IterationLog& log) {
  log.energy = x.energy;
  log.map_energy = x.map_energy;
  log.energy_f = x.energy_f;
  log.energy_g = x.energy_g;
  const double area = x.area_a + x.area_b;
  log.mean_distortion = area > 0 ? x.map_energy / area : 0;
  log.coverage_a = x.area_a / s.area_a;
  log.coverage_b = x.area_b / s.area_b;
  log.polygons = x.overlay.polygons.size();
  log.pin_residual = pin_residual(s, followers, x.x);
}

/// Returns half the diagonal of the bounding box of both embeddings.
inline double domain_radius(const Points2& x) {
  Vec2 lo = {kInfinity, kInfinity}, hi = -lo;
  for (int i = 0; i < x.rows(); ++i) lo = lower(lo, row2(x, i)), hi = upper(hi, row2(x, i));
  return 0.5 * norm(hi - lo);
}

inline double longest_move(const Array<Vec2>& d) {
  double longest = 0;
  for (Vec2 move : d) longest = (std::max)(longest, squared_norm(move));
  return std::sqrt(longest);
}

/// A step and the change of the gradient along it.
struct Secant {
  Array<Vec2> step, change;
};

/// Returns -B g, where B is the inverse of a factorised Hessian, updated by secants of positive
/// curvature, newest first: the two-loop recursion [Nocedal 1980].
inline Array<Vec2> quasi_newton_direction(const LdltFactor& factor, const Array<Secant>& secants,
                                          Array<Vec2> gradient) {
  Array<double> along(secants.size());
  for (int k = 0; k < secants.size(); ++k) {
    const Secant& s = secants[k];
    along[k] = dot(s.step, gradient) / dot(s.step, s.change);
    for (int i = 0; i < gradient.size(); ++i) gradient[i] -= along[k] * s.change[i];
  }
  Array<Vec2> d = ldlt_solve(factor, negated(gradient));
  for (int k = secants.size() - 1; k >= 0; --k) {
    const Secant& s = secants[k];
    const double excess = along[k] + dot(s.change, d) / dot(s.step, s.change);
    for (int i = 0; i < d.size(); ++i) d[i] -= excess * s.step[i];
  }
  return d;
}

class Optimizer {
 public:
  Optimizer(const JointSurface& s, const RunOptions& options, const Array<Follower>& followers,
            const Executor& executor)
      : s_(s),
        options_(options),
        followers_(followers),
        weights_(weights_of(options)),
        executor_(executor),
        models_(s, weights_, executor_),
        omega_(options.omega_start),
        problem_{s,        weights_,
                 rules_,   followers,
                 gaps_,    held_springs_,
                 pull_,    x_,
                 executor, options.tuning.search_stride} {
    if (omega_ > 0) laplacian_ = squared_laplacian(s, executor_);  // line 1
  }

  /// Starts at an injective x.
  void start(const Points2& x, Result& result) {
    x_.x = x;
    fix_unknowns(x_.x);
    place_followers(s_.mesh, followers_, x_.x);
    radius_ = domain_radius(x_.x);
    evaluate(s_, weights_, x_);  // line 3; later, lines 19 and 20
    rules_ = {options_.tuning.max_coverage_loss * s_.area_a,
              options_.tuning.max_coverage_loss * s_.area_b,
              options_.tuning.least_coverage * x_.area_a,
              options_.tuning.least_coverage * x_.area_b};
    describe(s_, followers_, x_, result.initial);
    if (pull_) x_.pull = pull_(x_, springs_);
    result.initial.energy += x_.pull;
    result.initial.omega = omega_;
    result.log_begin = result.initial;
    result.status = Status::kUnfinished;
    if (!(x_.area_a > 0 && x_.area_b > 0)) result.status = Status::kNoOverlap;
    if (!std::isfinite(x_.energy)) result.status = Status::kNumericalFailure;
    if (x_.overlay.is_too_large) result.status = Status::kMemoryLimit;
    if (!followers_.empty() && !is_injective(s_.mesh, x_.x)) result.status = Status::kInvalidPins;
  }

  /// Runs iteration i of line 2; returns true if another one follows. If the caller stops it, x
  /// stays, and the next call repeats the iteration.
  bool iterate(Result& result) {
    if (!may_iterate(result)) return false;
    renew_springs();                        // beyond the paper
    bool found = take_quasi_newton_step();  // beyond the paper
    while (!found && !executor_.is_stopped()) {
      if (!has_hessian_here() && !differentiate(true)) break;  // lines 4 to 8
      const LinearSystem system = blended_system();            // line 9
      Array<Direction> directions = solve(system);             // lines 10 to 12
      if (executor_.is_stopped()) break;
      if (climbs(directions) && reset_history()) continue;            // lines 13 and 14
      set_largest_steps(directions);                                  // lines 15 and 16
      is_stationary_ = !holds_back() && promise_nothing(directions);  // beyond the paper
      if (is_stationary_) break;
      search(directions);  // lines 17 to 23
      found = trials_.found;
      if (found || !recover()) break;  // beyond the paper
    }
    if (executor_.is_stopped()) return false;
    if (found) accept(result);  // lines 24 and 25
    if (!found)
      result.status = status_without_step(result);
    else if (has_settled(result, window(result)))
      result.status = Status::kConverged;
    return result.status == Status::kUnfinished;
  }

  const Points2& positions() const { return x_.x; }
  double omega() const { return omega_; }

  // -- hooks for Half II --

  /// Returns the step rules; least_area_a and _b are shares of the area covered at the start.
  const StepRules& rules() const { return rules_; }
  /// Keeps the least covered areas of an earlier start that covered more.
  void keep_covered(const StepRules& before) {
    rules_.least_area_a = before.least_area_a;
    rules_.least_area_b = before.least_area_b;
  }

  /// Lowers ω_L to at most `omega`, but not below Tuning::omega_least.
  void lower_omega(double omega) {
    omega_ = (std::min)(omega_, (std::max)(omega, options_.tuning.omega_least));
  }

  /// Replaces the springs in the objective.
  void set_springs(Array<Spring> springs) {
    held_springs_ = std::move(springs);
    quick_ = QuickSteps();
    renew_springs();
  }

  /// Adds an energy to E; before start().
  void set_pull(Pull pull) { pull_ = std::move(pull); }

  /// Estimates the finished fraction of a run: E falls the slower the closer the end is, which
  /// comes after a window of iterations at the earliest.
  double fraction(const Result& result) const {
    constexpr double kAtFirst = 0.1;  // relative fall of E in an early iteration
    constexpr double kMost = 0.99;    // of an unfinished run
    const double n = static_cast<double>(result.log.size());
    const int most = window(result);
    const Stretch last = last_stretch(result, most);
    const double fall = last.entries > 0 ? fall_over(result, last) / last.iterations : 0;
    const double settled =
        fall > 0 ? std::log(fall / kAtFirst) / std::log(options_.tolerance / kAtFirst) : 1;
    const double by_fall = clamp01(settled) * (std::min)(1.0, last.iterations / most);
    return (std::min)(kMost, (std::max)(by_fall, n / (std::max)(1, options_.max_iterations)));
  }

 private:
  static constexpr double kHardlyActs = 1e-3;  // ω_L below which the preconditioner hardly acts

  /// Removes constrained coordinates from the unknowns, or else rigid motions, moving x (§4.6).
  void fix_unknowns(Points2& x) {
    is_fixed_ = FixedCoordinates(s_.mesh.n_vertices);
    fix_boundaries(s_.mesh, x, options_.boundary, is_fixed_);
    for (int v : s_.mesh.pillow.cones) is_fixed_.fix(v);
    for (int v : options_.fixed_a) is_fixed_.fix(v);
    for (int v : options_.fixed_b) is_fixed_.fix(s_.n_a + v);
    for (const Follower& follower : followers_)  // a fixed landmark of A fixes its partner on B
      for (int k = 0; k < 3; ++k)
        for (int c = 0; c < 2; ++c)
          if (follower.weight[k] == 1 && is_fixed_(follower.row, c))
            is_fixed_(follower.master[k], c) = 1;
    if (is_fixed_.any()) return;
    const Anchors anchors = choose_anchors(s_, followers_);
    move_to_anchors(s_.mesh, anchors, x);
    is_fixed_.fix(anchors.center);
    is_fixed_(anchors.rim, 1) = 1;
  }

  // ---- the lines of Algorithm 1 ----

  bool has_hessian_here() const { return is_remembered_ && history_[0].has_hessian(); }

  /// Runs lines 4 to 8, or computes the gradient alone; returns false if the caller stops.
  bool differentiate(bool with_hessian) {
    log_ = IterationLog();
    Timer timer;
    models_.differentiate_elements(x_, with_hessian);  // lines 4 to 7
    log_.seconds_derivatives = timer.lap();
    if (executor_.is_stopped()) return false;
    QuadraticModel model = models_.assemble();  // line 8
    log_.seconds_assembly = timer.lap();
    if (executor_.is_stopped()) return false;
    model.x = x_.x;
    remember(std::move(model));
    return true;
  }

  /// Adds derivatives to the memory (§5.3), in place of a gradient alone at x; drops old ones.
  void remember(QuadraticModel model) {
    constexpr int kGradientsPerHessian = 4;
    const int most_hessians = options_.history_length;
    if (!is_remembered_) {
      history_.push_back({});
      std::rotate(history_.begin(), history_.end() - 1, history_.end());
    }
    history_[0] = std::move(model);
    is_remembered_ = true;
    if (!history_[0].has_hessian()) return;
    int hessians = 0, keep = 0;
    while (keep < history_.size() && keep < kGradientsPerHessian * std::int64_t{most_hessians} &&
           (hessians += history_[keep].has_hessian()) <= most_hessians)
      ++keep;
    history_.resize(keep);
  }

  /// Returns the system of the memory (line 9), reduced to the unknowns.
  LinearSystem blended_system() {
    Timer timer;
    LinearSystem system =
        blend(history_, options_.tuning.history_decay, others_, laplacian_, executor_);
    add_spring_gradient(springs_, x_.x, system.gradient);
    reduce(followers_, is_fixed_, executor_, system);
    log_.seconds_assembly += timer.lap();
    return system;
  }

  /// Returns the values of ω to try: α ω, ω/α and ω (line 11); beyond the paper, ω alone.
  Array<double> omegas_to_try(const LinearSystem& system) const {
    Array<double> omegas;
    if (system.has_Q() && options_.as_published)
      for (double factor : {options_.tuning.omega_factor, 1 / options_.tuning.omega_factor})
        omegas.push_back(omega_ * factor);
    omegas.push_back(omega_);
    return omegas;
  }

  /// Solves (H + ω Lᵀ M L) d = -g for each ω (lines 10 to 12).
  Array<Direction> solve(const LinearSystem& system) {
    Timer timer;
    Array<Direction> directions;
    for (double omega : omegas_to_try(system)) {
      ldlt_factorize(system.shifted(omega), x_.x, executor_, factor_);
      directions.push_back(factor_.ok
                               ? direction(ldlt_solve(factor_, negated(system.gradient)), omega)
                               : Direction());
    }
    log_.seconds_solve += timer.lap();
    return directions;
  }

  /// Extends d to all vertices; the slope uses the newest gradient (line 13), so E never grows.
  Direction direction(Array<Vec2> d, double omega) const {
    expand_direction(followers_, d);
    Array<Vec2> gradient = history_[0].gradient;
    add_spring_gradient(springs_, x_.x, gradient);
    const double slope = dot(gradient, d);
    return {omega, std::move(d), slope};
  }

  /// Returns true if a direction does not descend (line 13).
  static bool climbs(const Array<Direction>& directions) {
    for (const Direction& d : directions)
      if (!(d.slope < 0)) return true;
    return false;
  }

  /// Discards older derivatives (line 14); returns false if there are none.
  bool reset_history() {
    if (history_.size() == 1) return false;
    history_.resize(1);
    return log_.history_reset = true;
  }

  /// Runs lines 15 and 16, drops directions that climb and, beyond the paper, bounds displacements.
  void set_largest_steps(Array<Direction>& directions) {
    Timer timer;
    Array<Direction> descending;
    for (Direction& d : directions)
      if (d.slope <= 0) descending.push_back(std::move(d));
    directions = std::move(descending);
    executor_.run(directions.size(), [&](int k) { set_largest_step(directions[k]); });
    log_.seconds_search += timer.lap();
  }

  void set_largest_step(Direction& d) const {
    d.max_step = (std::min)(max_step(s_.mesh, x_.x, d.d), max_step(gaps_, d.d));
    d.first_step = (std::min)(0.99 * d.max_step,
                              options_.tuning.max_displacement * radius_ / longest_move(d.d));
    if (!options_.as_published && last_step_ < 0.5 && omega_ <= kHardlyActs)
      d.first_step = (std::min)(d.first_step, 1 / kShrink);
  }

  void search(const Array<Direction>& directions) {
    Timer timer;
    trials_.run(problem_, directions);
    keeps_gaps_ = keeps_gaps_ || (trials_.collided && !options_.as_published);  // beyond the paper
    log_.seconds_search += timer.lap();
  }

  void accept(Result& result) {
    if (result.log.size() == result.log.capacity()) result.log.reserve(2 * result.log.size() + 1);
    const Trial& best = trials_.best;
    plan_quasi_newton_steps(best);
    std::swap(x_, trials_.best.x);
    omega_ = options_.as_published ? best.omega : next_omega(best);
    is_remembered_ = false;
    describe(s_, followers_, x_, log_);
    log_.energy += x_.pull;
    log_.iteration = static_cast<int>(result.log.size()) + 1;
    log_.omega = best.omega;
    log_.step = best.step.length;
    log_.max_step = best.max_step;
    result.log.push_back(log_);
  }

  // ---- beyond the paper ----

  bool may_iterate(Result& result) {
    if (result.status != Status::kUnfinished) return false;
    if (static_cast<int>(result.log.size()) >= options_.max_iterations)
      return result.status = Status::kIterationLimit, false;
    last_step_ = last_full_step(result);
    return true;
  }

  /// Returns true if ω_L shortens steps and can still decrease.
  bool holds_back() const {
    return omega_ > (std::max)(double{kHardlyActs}, options_.tuning.omega_least);
  }

  /// Returns true if no direction promises a decrease beyond the rounding of E's parts.
  bool promise_nothing(const Array<Direction>& directions) const {
    constexpr double kRounding = 1e-14;
    const double little = kRounding * (x_.map_energy + weights_.kappa * (x_.area_a + x_.area_b));
    for (const Direction& d : directions)
      if (!(-d.slope <= little)) return false;
    return !directions.empty();
  }

  /// Returns the next ω_L. It shrinks after a step of d or more, and grows after a short one.
  /// Trying three values costs two more solutions and finds no better maps.
  double next_omega(const Trial& best) const {
    constexpr double kLong = 1, kShort = 0.25;
    const double factor = options_.tuning.omega_factor;
    if (log_.quasi_newton || omega_ == 0) return omega_;
    if (best.step.length < kShort) return omega_ * factor;
    return best.step.length < kLong ? omega_
                                    : (std::max)(omega_ / factor, options_.tuning.omega_least);
  }

  // -- where no step is found --

  /// Changes one thing: keeps gaps open, clears the memory, or lowers ω_L at once, as an
  /// oversmoothed direction may ascend. Returns false if nothing is left to change.
  bool recover() {
    constexpr double kDrop = 16;
    if (executor_.is_stopped()) return false;
    if (keeps_gaps_ && !has_gaps_) return renew_springs(), true;
    if (reset_history()) return true;
    if (!holds_back()) return false;
    omega_ = (std::max)(omega_ / kDrop, options_.tuning.omega_least);
    return true;
  }

  void renew_springs() {
    constexpr double kGaps = 30;  // weight of all gaps, relative to E_f and E_g
    springs_.clear();
    if (pull_) pull_(x_, springs_);
    for (const Spring& spring : held_springs_) springs_.push_back(spring);
    has_gaps_ = keeps_gaps_;
    if (keeps_gaps_) gaps_ = find_gaps(s_.mesh, x_.x, kGaps * weights_.barrier * s_.total_area);
    Array<Block> blocks;
    add_gaps(gaps_, blocks);
    add_springs(springs_, blocks);
    others_ = sum_of_blocks(s_.mesh.n_vertices, blocks, executor_);
  }

  // -- quasi-Newton steps: once ω_L is small, with the last factor --

  /// The plan for the next quasi-Newton steps.
  struct QuickSteps {
    int left = 0;
    double least_gain = 0;  // decrease of E, by a step after which another one follows
    double step = 1;        // length of the first trial
  };

  /// Plans quasi-Newton steps once a long step shows that the quadratic model holds. While ω_L
  /// decreases, or short steps raise it, they would only delay that. Each must pay for the next.
  void plan_quasi_newton_steps(const Trial& best) {
    constexpr double kLargestOmega = 0.01, kLeastStep = 0.1;
    constexpr double kShare = 0.1;  // time of such a step, relative to an iteration
    const double gain = x_.energy - best.x.energy;
    if (log_.quasi_newton) {
      quick_.left = gain >= quick_.least_gain ? quick_.left - 1 : 0;
    } else {
      const bool pays = best.omega <= kLargestOmega && best.step.length >= kLeastStep &&
                        factor_.ok && factor_.negative == 0;
      quick_.left = pays ? options_.tuning.quasi_newton_steps : 0;
      quick_.least_gain = kShare * gain;
    }
    quick_.step = (std::min)(1.0, 2 * best.step.length);
  }

  /// Takes a step with the last factor, the mean gradient and the secants of the memory. Returns
  /// false if none is found; then no more follow.
  bool take_quasi_newton_step() {
    if (quick_.left <= 0 || (!is_remembered_ && !differentiate(false))) return false;
    Timer timer;
    Array<Vec2> d = quasi_newton_direction(
        factor_, secants(),
        of_unknowns(blended_gradient(history_, options_.tuning.history_decay), x_.x));
    Array<Direction> directions(1, direction(std::move(d), omega_));
    set_largest_step(directions[0]);
    log_.seconds_solve += timer.lap();
    const bool found = directions[0].slope < 0 && search_back(directions);
    if (executor_.is_stopped()) return false;
    if (!found) quick_.left = 0;
    return log_.quasi_newton = found;
  }

  /// Tries steps in pairs, each half as long as the one before.
  bool search_back(const Array<Direction>& directions) {
    constexpr double kShortest = 1e-3;
    Timer timer;
    trials_.clear();
    double step = (std::min)(quick_.step, directions[0].first_step);
    for (; step > kShortest && !trials_.found && !executor_.is_stopped(); step /= 4) {
      Array<TrialStep> steps(1, TrialStep{0, step});
      steps.push_back({0, step / 2});
      trials_.add(problem_, directions, steps);
    }
    log_.seconds_search += timer.lap();
    return trials_.found;
  }

  /// Returns a gradient at y plus the springs' gradient, in the unknowns.
  Array<Vec2> of_unknowns(Array<Vec2> gradient, const Points2& y) const {
    add_spring_gradient(springs_, y, gradient);
    reduce(followers_, is_fixed_, gradient);
    return gradient;
  }

  Array<Vec2> gradient_at(int k) const { return of_unknowns(history_[k].gradient, history_[k].x); }

  /// Returns the newest secants in the memory along which E has positive curvature.
  Array<Secant> secants() const {
    constexpr int kMost = 8;
    constexpr double kLeastCosine = 1e-10;
    Array<Secant> secants;
    for (int k = 0; k + 1 < history_.size() && secants.size() < kMost; ++k) {
      const Array<Vec2> before = gradient_at(k + 1);
      Secant s = {Array<Vec2>(before.size()), gradient_at(k)};
      for (int i = 0; i < before.size(); ++i) {
        s.step[i] = row2(history_[k].x, i) - row2(history_[k + 1].x, i);
        s.change[i] -= before[i];
      }
      for (const Follower& follower : followers_) s.step[follower.row] = {};
      if (dot(s.step, s.change) >
          kLeastCosine * std::sqrt(dot(s.step, s.step) * dot(s.change, s.change)))
        secants.push_back(std::move(s));
    }
    return secants;
  }

  // -- the end --

  /// The last log entries and their number in iterations; a quasi-Newton step counts as a fifth.
  struct Stretch {
    int entries = 0;
    double iterations = 0;
  };

  static Stretch last_stretch(const Result& result, int iterations) {
    constexpr int kStepsPerIteration = 5;
    const int n = static_cast<int>(result.log.size());
    int entries = 0, steps = 0;
    while (entries < n && steps / kStepsPerIteration < iterations)
      steps += entry_before(result, entries++).quasi_newton ? 1 : kStepsPerIteration;
    return {entries, static_cast<double>(steps) / kStepsPerIteration};
  }

  /// Returns the fall of E as a fraction of E + κ (area A + area B).
  double fall_over(const Result& result, const Stretch& last) const {
    const IterationLog &now = result.final_state(), &before = entry_before(result, last.entries);
    return (before.energy - now.energy) / (now.energy + weights_.kappa * s_.total_area);
  }

  /// Returns the length of the last step that was no quasi-Newton step; 1 before any.
  static double last_full_step(const Result& result) {
    for (std::size_t i = result.log.size(); i > 0; --i)
      if (!result.log[i - 1].quasi_newton) return result.log[i - 1].step;
    return 1;
  }

  /// Returns the log entry of the given number of entries ago.
  static const IterationLog& entry_before(const Result& result, int entries) {
    const int n = static_cast<int>(result.log.size());
    return n == entries ? result.log_begin : result.log[static_cast<std::size_t>(n - 1 - entries)];
  }

  /// Returns the window of the stopping rule; after coarse levels, a run starts near its end.
  int window(const Result& result) const {
    const int window = options_.tuning.window;
    return result.coarse.empty() ? window : (std::max)(1, window / 2);
  }

  /// Applies the stopping rule of Options::tolerance: returns true if E fell over the last
  /// iterations by less than required over a whole window.
  bool has_settled(const Result& result, int iterations) const {
    const Stretch last = last_stretch(result, iterations);
    if (last.iterations < iterations) return false;
    const double omega = result.final_state().omega;
    if (omega < entry_before(result, last.entries).omega && omega > kHardlyActs) return false;
    return fall_over(result, last) < window(result) * options_.tolerance;
  }

  /// Returns true if both surfaces are covered without distortion: the best map of most measures.
  bool is_isometry() const {
    const double area = x_.area_a + x_.area_b, tolerance = options_.tolerance;
    return x_.map_energy <= (options_.measure.isometry() + tolerance) * area &&
           area >= (1 - tolerance) * s_.total_area;
  }

  /// Without a step, a run has converged if E hardly fell before either, else it has stalled.
  Status status_without_step(const Result& result) const {
    if (is_stationary_ || is_isometry()) return Status::kConverged;
    const bool is_first = result.log.empty() && result.coarse.empty();
    if (!factor_.ok && is_first) return Status::kNumericalFailure;
    const int before = (std::max)(1, window(result) - 1);
    return has_settled(result, before) ? Status::kConverged : Status::kStalled;
  }

  const JointSurface& s_;
  const RunOptions& options_;
  const Array<Follower>& followers_;
  Weights weights_;
  StepRules rules_{};
  const Executor& executor_;
  ModelBuilder models_;
  BlockMatrix laplacian_;  // squared; empty without a preconditioner
  double omega_;
  double radius_ = 1;
  bool is_stationary_ = false;
  double last_step_ = 1;  // of the last step that was no quasi-Newton step
  FixedCoordinates is_fixed_;
  Iterate x_;
  IterationLog log_;               // of the current iteration
  bool is_remembered_ = false;     // the memory has derivatives at x
  Array<QuadraticModel> history_;  // newest first
  LdltFactor factor_;
  QuickSteps quick_;
  const SearchProblem problem_;
  LineSearch trials_;
  bool keeps_gaps_ = false;  // a trial made a boundary intersect itself
  bool has_gaps_ = false;
  Array<Gap> gaps_;
  Array<Spring> held_springs_;
  Pull pull_;
  Array<Spring> springs_;  // of both
  BlockMatrix others_;     // the Hessian of gaps and springs
};

// ==== [13] SPARSE LDLT (George 1973; Duff and Reid 1983) =========================================
//
// Purpose:    factorises H + ω Lᵀ M L, symmetric with one 2×2 block per pair of vertices, by nested
//             dissection of the vertex positions and the multifrontal method.
// Invariants: block (r, c), r ≤ c, of the pattern couples vertices r and c; each row starts with
//             its diagonal block. The bits do not depend on the number of threads.
// Fails:      at a zero or non-finite pivot; counts negative ones (matrix not positive definite).

/// Returns the unit vector at an angle in [-2π, 2π]: series of tan(angle / 128), doubled 6 times.
inline Vec2 on_circle(double angle) {
  const double h = angle / 128, h2 = h * h;
  const double t =
      h * (1 + h2 * (1.0 / 3 + h2 * (2.0 / 15 + h2 * (17.0 / 315 + h2 * 62.0 / 2835))));
  Vec2 p = 1 / (1 + t * t) * Vec2{1 - t * t, 2 * t};
  for (int i = 0; i < 6; ++i) p = {p.x * p.x - p.y * p.y, 2 * p.x * p.y};
  return p;
}

/// A front of the elimination tree: the vertices eliminated together, and the later vertices that
/// their elimination updates. Vertices are numbered in the elimination order.
struct Front {
  int begin = 0, end = 0;  // own vertices
  Array<int> rows;         // later vertices, ascending
  Array<int> parent_row;   // per row: its place in the parent's front, own vertices first
  int depth = 0;
  Array<int> children;
  struct OwnBlock {
    int block;        // its index in the pattern
    int row, column;  // local position in the front's lower triangle
    bool transposed;
  };
  Array<OwnBlock> blocks;
  int own() const { return end - begin; }
  int size() const { return own() + rows.size(); }
};

/// The elimination order and the fronts; they depend on the pattern and the positions only.
struct LdltSymbolic {
  Array<int> order;     // order[i] is the i-th vertex eliminated
  Array<int> place;     // its inverse
  Array<Front> fronts;  // children before parents
  /// Per stage, groups of fronts that can be eliminated in parallel: first whole subtrees below a
  /// fixed depth, children before parents, then the fronts above it, level by level.
  Array<Array<Array<int>>> stages;
};

/// A line or circle with a fraction of the points below or inside it.
struct PlanarCut {
  bool is_circle = false;
  Vec2 vector;  // center of the circle, or normal of the line
  double fraction = 0.5;
  double key(Vec2 p) const { return is_circle ? squared_norm(p - vector) : dot(vector, p); }
};

/// Finds the line or circle that splits coupled points into two parts with the fewest couplings
/// between them [Miller, Teng, Thurston and Vavasis 1997]. A circle around a limb, which an
/// embedding crowds into a spot, beats all lines. Some couplings and single precision suffice.
class CutFinder {
 public:
  static constexpr int kCouplings = 8;

  explicit CutFinder(int n) : n_(n), x_(n, kCouplings + 1), y_(n, kCouplings + 1) {}

  /// Sets the k-th point that point i is coupled to; the 0-th is itself.
  void set(int i, int k, Vec2 p) {
    x_(i, k) = static_cast<float>(p.x);
    y_(i, k) = static_cast<float>(p.y);
  }

  PlanarCut best() {
    constexpr int kSmall = 1000;  // points; below, better cuts hardly save arithmetic
    const int lines = n_ < kSmall ? 2 : 8, circles = n_ < kSmall ? 2 : 16;
    PlanarCut best;
    double least = kInfinity;
    for (int i = 0; i < lines + circles; ++i) {
      PlanarCut cut;
      cut.is_circle = i >= lines;
      if (cut.is_circle) {
        const int center = static_cast<int>(std::int64_t{n_} * (i - lines) / circles);
        cut.vector = {x_(center, 0), y_(center, 0)};
      } else {
        cut.vector = on_circle(kPi * i / lines);
      }
      measure(cut);
      for (double fraction : {0.4, 0.5, 0.6}) {
        const double c = cost(sample_[static_cast<int>(fraction * sample_.size())], fraction);
        if (c >= least) continue;
        least = c;
        cut.fraction = fraction;
        best = cut;
      }
    }
    return best;
  }

 private:
  using Points = Eigen::Array<float, Eigen::Dynamic, kCouplings + 1>;

  /// Computes the key of each point, and the least and largest key of it and its neighbours.
  void measure(const PlanarCut& cut) {
    constexpr int kSamples = 64;
    const float vx = static_cast<float>(cut.vector.x), vy = static_cast<float>(cut.vector.y);
    lo_.setConstant(n_, std::numeric_limits<float>::infinity());
    hi_.setConstant(n_, -std::numeric_limits<float>::infinity());
    for (int k = kCouplings; k >= 0; --k) {  // the points themselves come last
      if (cut.is_circle) {
        key_ = (x_.col(k) - vx).square();
        other_ = (y_.col(k) - vy).square();
      } else {
        key_ = vx * x_.col(k);
        other_ = vy * y_.col(k);
      }
      key_ += other_;
      lo_ = lo_.min(key_);
      hi_ = hi_.max(key_);
    }
    sample_.clear();
    for (int i = 0; i < n_; i += 1 + n_ / kSamples) sample_.push_back(key_[i]);
    std::sort(sample_.begin(), sample_.end());
  }

  /// Returns the size of the separator, the smaller number of points coupled to the other side,
  /// times a penalty for unequal sides.
  double cost(float level, double fraction) const {
    int below = 0, above = 0;
    for (int i = 0; i < n_; ++i) {  // without branches, so that compilers vectorise it
      below += int{key_[i] < level} & int{hi_[i] >= level};
      above += int{key_[i] >= level} & int{lo_[i] < level};
    }
    return (std::min)(below, above) * (1 + std::abs(fraction - 0.5));
  }

  int n_;
  Points x_, y_;
  Eigen::ArrayXf key_, other_, lo_, hi_;
  Array<float> sample_;  // of the keys, ascending
};

/// Builds an LdltSymbolic by nested dissection. A cut divides a set of vertices; on the side with
/// fewer of them, vertices coupled to the other side form the separator, which is thinned and
/// eliminated last. Both sides are divided again; sets of one level, in parallel.
class NestedDissection {
 public:
  NestedDissection(const BlockMatrix& pattern, const Points2& positions, const Executor& executor)
      : pattern_(pattern), positions_(positions), executor_(executor) {}

  LdltSymbolic build() {
    const int n = pattern_.rows();
    build_adjacency();
    result_.order = numbers_below(n);
    dissect();
    result_.place.resize(n);
    for (int i = 0; i < n; ++i) result_.place[result_.order[i]] = i;
    add_front(0);
    schedule();
    for (const Array<Array<int>>& stage : result_.stages)
      executor_.run(stage.size(), [&](int group) { fill_fronts(stage[group]); });
    return std::move(result_);
  }

 private:
  static constexpr int kLargestLeaf = 12;       // smaller leaves cost more in bookkeeping
  static constexpr double kLargestPart = 0.65;  // share of a set on one side

  enum Part : std::uint8_t { kLeft, kRight, kSeparator, kOutside };

  struct Neighbour {
    int vertex;
    int block;
    bool transposed;  // the block is stored as (neighbour, vertex)
  };

  /// The vertices order[begin, end). Once divided: the left side, the right side, the separator.
  struct Set {
    int begin, end, depth;
    int left_end = 0, right_end = 0;
    int child = -1;  // index of the left side in sets_; the right side follows
    int size() const { return end - begin; }
  };

  void build_adjacency() {
    neighbours_ = grouped<Neighbour>(pattern_.rows(), [&](const auto& add) {
      pattern_.for_each_block([&](int r, int c, int b) {
        add(r, {c, b, false});
        if (c != r) add(c, {r, b, true});
      });
    });
  }

  template <class Visit>
  void for_each_neighbour(int v, const Visit& visit) const {
    neighbours_.for_each_in(v, [&](const Neighbour& u) { visit(u.vertex); });
  }

  void dissect() {
    part_.assign(pattern_.rows(), kOutside);
    for (Array<int>& count : coupled_) count.assign(pattern_.rows(), 0);
    moved_.assign(pattern_.rows(), 0);
    sets_.push_back({0, pattern_.rows(), 0});
    const bool has_hubs = set_hubs_apart();
    for (int first = has_hubs, last = sets_.size(); first < last;
         first = last, last = sets_.size()) {
      executor_.run(last - first, [&](int i) { split(sets_[first + i]); });
      for (int i = first; i < last; ++i) {
        const Set set = sets_[i];
        if (set.size() <= kLargestLeaf) continue;
        sets_[i].child = sets_.size();
        sets_.push_back({set.begin, set.left_end, set.depth + 1});
        sets_.push_back({set.left_end, set.right_end, set.depth + 1});
      }
    }
  }

  /// Separates hubs, with more neighbours than a planar separator has vertices; no separator
  /// contains them, and they are eliminated last. Returns false if there are none.
  bool set_hubs_apart() {
    constexpr int kLeast = 1000;
    const int n = pattern_.rows();
    const double most = (std::max)(double{kLeast}, 4 * std::sqrt(n));
    const auto is_hub = [&](int v) { return neighbours_.size(v) > most; };
    const int* const rest = std::stable_partition(result_.order.begin(), result_.order.end(),
                                                  [&](int v) { return !is_hub(v); });
    const int end = static_cast<int>(rest - result_.order.begin());
    if (end == n) return false;
    sets_[0].left_end = sets_[0].right_end = end;
    sets_[0].child = 1;
    sets_.push_back({0, end, 1});
    sets_.push_back({end, end, 1});
    return true;
  }

  int& vertex(int i) { return result_.order[i]; }

  void split(Set& set) {
    if (set.size() <= kLargestLeaf) return;
    divide(set);
    separate(set);
    thin_separator(set);
    Array<int> members[3];
    for (int i = set.begin; i < set.end; ++i) members[part_[vertex(i)]].push_back(vertex(i));
    int i = set.begin;
    for (const Array<int>& part : members)
      for (int v : part) {
        part_[v] = kOutside;
        vertex(i++) = v;
      }
    set.left_end = set.begin + members[kLeft].size();
    set.right_end = set.left_end + members[kRight].size();
  }

  /// Assigns every vertex of a set to one of two sides.
  void divide(const Set& set) {
    const int n = set.size();
    const Vec2 origin = row2(positions_, vertex(set.begin));
    double extent = 0;
    for (int i = set.begin; i < set.end; ++i) {
      part_[vertex(i)] = kLeft;  // provisional: marks members of the set
      const Vec2 p = row2(positions_, vertex(i)) - origin;
      extent = (std::max)({extent, std::abs(p.x), std::abs(p.y)});
    }
    const double unit = extent > 0 ? 1 / extent : 1;
    const auto point = [&](int v) { return unit * (row2(positions_, v) - origin); };
    CutFinder cuts(n);
    for (int i = 0; i < n; ++i) {
      const int v = vertex(set.begin + i);
      for (int k = 0; k <= CutFinder::kCouplings; ++k) {
        const int u = k == 0 ? v : spread_neighbour(v, k - 1);
        cuts.set(i, k, point(part_[u] == kLeft ? u : v));
      }
    }
    const PlanarCut cut = cuts.best();
    Array<std::pair<double, int>> key(n);
    for (int i = 0; i < n; ++i)
      key[i] = {cut.key(point(vertex(set.begin + i))), vertex(set.begin + i)};
    const int left = (std::max)(1, static_cast<int>(cut.fraction * n));
    std::nth_element(key.begin(), key.begin() + left, key.end());
    for (int i = left; i < n; ++i) part_[key[i].second] = kRight;
  }

  /// Returns one of kCouplings neighbours, spread evenly over the list of v.
  int spread_neighbour(int v, int k) const {
    const int skipped = (2 * k + 1) * neighbours_.size(v) / (2 * CutFinder::kCouplings);
    return neighbours_.item[neighbours_.start[v] + skipped].vertex;
  }

  /// Chooses as separator the vertices of one side that are coupled to the other one.
  void separate(const Set& set) {
    Array<int> rim[2];
    for (int i = set.begin; i < set.end; ++i) {
      const Part own = part_[vertex(i)];
      bool is_coupled = false;
      for_each_neighbour(vertex(i), [&](int u) { is_coupled |= part_[u] == other_side(own); });
      if (is_coupled) rim[own].push_back(vertex(i));
    }
    for (int v : rim[0].size() <= rim[1].size() ? rim[0] : rim[1]) part_[v] = kSeparator;
  }

  // -- thinning of a separator [Fiduccia and Mattheyses 1982] --

  /// Moves a separator vertex to one side; its neighbours on the other side enter the separator.
  struct Move {
    int gain;  // decrease of the separator's size
    int vertex;
    Part to;
    int pulled = 0;  // vertices that had entered the separator before
    bool operator<(const Move& o) const {
      return gain != o.gain ? gain < o.gain : vertex != o.vertex ? vertex < o.vertex : to < o.to;
    }
  };
  using Moves = std::priority_queue<Move>;  // the best one first

  /// Makes the best moves one after the other, even if they do not pay at once, and undoes those
  /// after the smallest separator. No vertex moves twice.
  void thin_separator(const Set& set) {
    constexpr int kPatience = 30;  // moves without success
    const int largest = static_cast<int>(kLargestPart * set.size());
    int size[3] = {0, 0, 0};
    Moves moves;
    for (int i = set.begin; i < set.end; ++i) {
      moved_[vertex(i)] = 0;
      ++size[part_[vertex(i)]];
    }
    for (int i = set.begin; i < set.end; ++i)
      if (part_[vertex(i)] == kSeparator) enter_separator(vertex(i), moves);
    Array<Move> made;
    Array<int> pulled;
    int best = 0, least = size[kSeparator];
    while (!moves.empty() && made.size() - best < kPatience) {
      Move move = moves.top();
      moves.pop();
      const Part from = other_side(move.to);
      if (part_[move.vertex] != kSeparator || moved_[move.vertex]) continue;
      if (move.gain != 1 - coupled_[from][move.vertex] || size[move.to] >= largest) continue;
      moved_[move.vertex] = 1;
      move.pulled = pulled.size();
      made.push_back(move);
      leave_separator(move.vertex, move.to, pulled, moves);
      size[kSeparator] -= move.gain;
      size[move.to] += 1;
      size[from] -= 1 - move.gain;
      if (size[kSeparator] >= least) continue;
      least = size[kSeparator];
      best = made.size();
    }
    for (; made.size() > best; made.pop_back()) {
      for (; pulled.size() > made.back().pulled; pulled.pop_back())
        part_[pulled.back()] = other_side(made.back().to);
      part_[made.back().vertex] = kSeparator;
    }
  }

  static Part other_side(Part side) { return side == kLeft ? kRight : kLeft; }

  void propose_move(int v, Part to, Moves& moves) const {
    constexpr int kLeastGain = -1;
    const int gain = 1 - coupled_[other_side(to)][v];
    if (moved_[v] || gain < kLeastGain) return;
    moves.push({gain, v, to});
  }

  void enter_separator(int v, Moves& moves) {
    coupled_[kLeft][v] = coupled_[kRight][v] = 0;
    for_each_neighbour(v, [&](int u) {
      if (part_[u] <= kRight) ++coupled_[part_[u]][v];
    });
    propose_move(v, kLeft, moves);
    propose_move(v, kRight, moves);
  }

  void leave_separator(int v, Part to, Array<int>& pulled, Moves& moves) {
    const Part from = other_side(to);
    const int begin = pulled.size();
    part_[v] = to;
    for_each_neighbour(v, [&](int u) {
      if (part_[u] == kSeparator) ++coupled_[to][u], propose_move(u, from, moves);
      if (part_[u] == from) part_[u] = kSeparator, pulled.push_back(u);
    });
    for (int i = begin; i < pulled.size(); ++i)
      for_each_neighbour(pulled[i], [&](int u) {
        if (part_[u] == kSeparator) --coupled_[from][u], propose_move(u, to, moves);
      });
    for (int i = begin; i < pulled.size(); ++i) enter_separator(pulled[i], moves);
  }

  // -- fronts --

  /// Appends the fronts of a set, those of its sides first; returns the topmost.
  int add_front(int id_set) {
    const Set& set = sets_[id_set];
    const bool is_leaf = set.child < 0;
    Front front;
    front.begin = is_leaf ? set.begin : set.right_end;
    front.end = set.end;
    front.depth = set.depth;
    if (!is_leaf)
      for (int side : {0, 1}) front.children.push_back(add_front(set.child + side));
    result_.fronts.push_back(std::move(front));
    return result_.fronts.size() - 1;
  }

  /// Groups fronts into stages; the fronts of a subtree are consecutive, the topmost last.
  void schedule() {
    constexpr int kSubtreeDepth = 5;
    result_.stages.resize(kSubtreeDepth + 1);
    Array<int> group;
    for (int id = 0; id < result_.fronts.size(); ++id) {
      const int depth = result_.fronts[id].depth;
      group.push_back(id);
      if (depth > kSubtreeDepth) continue;
      result_.stages[kSubtreeDepth - depth].push_back(group);
      group.clear();
    }
  }

  /// Finds the rows and the entries of a group of fronts.
  void fill_fronts(const Array<int>& ids) {
    Array<int> local(pattern_.rows(), -1);  // per vertex of the front: its place in it, else -1
    for (int id : ids) {
      Front& front = result_.fronts[id];
      find_rows(front, local);
      place_entries(front, local);
      for (int i = front.begin; i < front.end; ++i) local[i] = -1;
      for (int i : front.rows) local[i] = -1;
    }
  }

  void find_rows(Front& front, Array<int>& local) const {
    const auto add = [&](int i) {
      if (i < front.end || local[i] >= 0) return;
      local[i] = 0;
      front.rows.push_back(i);
    };
    for (int i = front.begin; i < front.end; ++i)
      for_each_neighbour(result_.order[i], [&](int u) { add(result_.place[u]); });
    for (int child : front.children)
      for (int i : result_.fronts[child].rows) add(i);
    std::sort(front.rows.begin(), front.rows.end());
    for (int i = front.begin; i < front.end; ++i) local[i] = i - front.begin;
    for (int r = 0; r < front.rows.size(); ++r) local[front.rows[r]] = front.own() + r;
  }

  void place_entries(Front& front, const Array<int>& local) {
    for (int i = front.begin; i < front.end; ++i) {
      neighbours_.for_each_in(result_.order[i], [&](const Neighbour& u) {
        const int j = result_.place[u.vertex];
        if (j < i) return;
        // The front stores block (j, i); the pattern stores (i, j) unless transposed.
        front.blocks.push_back({u.block, local[j], local[i], !u.transposed});
      });
    }
    for (int child : front.children) {
      Front& c = result_.fronts[child];
      c.parent_row.resize(c.rows.size());
      for (int r = 0; r < c.rows.size(); ++r) c.parent_row[r] = local[c.rows[r]];
    }
  }

  const BlockMatrix& pattern_;
  const Points2& positions_;
  const Executor& executor_;
  LdltSymbolic result_;
  Groups<Neighbour> neighbours_;  // per vertex
  Array<Set> sets_;               // level by level
  Array<Part> part_;
  Array<int> coupled_[2];  // per separator vertex: number of neighbours on either side
  Array<char> moved_;
};

// ---- dense kernels ----

/// A block of a column-major matrix.
struct DenseBlock {
  double* data;
  Eigen::Index rows, cols, stride;

  double* col(Eigen::Index j) const { return data + j * stride; }
  double& operator()(Eigen::Index i, Eigen::Index j) const { return data[j * stride + i]; }
  DenseBlock block(Eigen::Index i, Eigen::Index j, Eigen::Index n, Eigen::Index m) const {
    return {data + j * stride + i, n, m, stride};
  }
};

inline DenseBlock all_of(Eigen::MatrixXd& A) { return {A.data(), A.rows(), A.cols(), A.rows()}; }

/// Computes y -= a x.
inline void subtract_scaled(double a, const double* x, double* y, Eigen::Index n) {
  Eigen::Index i = 0;
  for (; i + kLanes <= n; i += kLanes) (Lanes::load(y + i) - a * Lanes::load(x + i)).store(y + i);
  for (; i < n; ++i) y[i] -= a * x[i];
}

/// Sums in eight partial sums, so that the bits do not depend on the compiler.
inline double inner_product(const double* x, const double* y, Eigen::Index n) {
  double sum[8] = {};
  Eigen::Index i = 0;
  for (; i + 8 <= n; i += 8) {
    ISM_UNROLL
    for (int k = 0; k < 8; ++k) sum[k] += x[i + k] * y[i + k];
  }
  for (int k = 0; i < n; ++i, ++k) sum[k] += x[i] * y[i];
  return ((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7]));
}

// A product is subtracted from C in register tiles as high as Lanes, from factors packed in the
// order of reading [Goto and van de Geijn 2008]. The sums do not depend on the size of tiles.

inline constexpr int kTileColumns = 6;

/// Packs the rows of L, or of L D with D's diagonal, into tiles of a height; zeros fill the last.
inline void pack(const DenseBlock& L, const DenseBlock* D, int height, double* packed) {
  for (Eigen::Index first = 0; first < L.rows; first += height) {
    const Eigen::Index n = (std::min)(Eigen::Index{height}, L.rows - first);
    for (Eigen::Index k = 0; k < L.cols; ++k, packed += height) {
      const double* from = L.col(k) + first;
      const double factor = D ? (*D)(k, k) : 1;
      for (Eigen::Index i = 0; i < height; ++i) packed[i] = i < n ? factor * from[i] : 0;
    }
  }
}

inline void subtract_tile(const double* a, const double* b, Eigen::Index depth, double* c,
                          Eigen::Index stride) {
  Lanes sum[kTileColumns];
  ISM_UNROLL
  for (int j = 0; j < kTileColumns; ++j) sum[j] = 0.0;
  for (Eigen::Index k = 0; k < depth; ++k, a += kLanes, b += kTileColumns) {
    const Lanes rows = Lanes::load(a);
    ISM_UNROLL
    for (int j = 0; j < kTileColumns; ++j) sum[j] = sum_with_product(sum[j], rows, b[j]);
  }
  ISM_UNROLL
  for (int j = 0; j < kTileColumns; ++j)
    (Lanes::load(c + j * stride) - sum[j]).store(c + j * stride);
}

/// Subtracts packed factors from C, whose first row is row `first`; skips tiles above the diagonal.
inline void subtract_packed(const double* a, const double* b, Eigen::Index depth,
                            Eigen::Index first, const DenseBlock& C) {
  for (Eigen::Index j = 0; j < C.cols; j += kTileColumns)
    for (Eigen::Index i = (std::max)(j - first, Eigen::Index{0}) / kLanes * kLanes; i < C.rows;
         i += kLanes) {
      const Eigen::Index height = (std::min)(Eigen::Index{kLanes}, C.rows - i);
      const Eigen::Index width = (std::min)(Eigen::Index{kTileColumns}, C.cols - j);
      if (height == kLanes && width == kTileColumns) {
        subtract_tile(a + i * depth, b + j * depth, depth, &C(i, j), C.stride);
        continue;
      }
      double rest[kLanes * kTileColumns] = {};
      subtract_tile(a + i * depth, b + j * depth, depth, rest, kLanes);
      for (Eigen::Index q = 0; q < width; ++q)
        for (Eigen::Index r = 0; r < height; ++r) C(i + r, j + q) += rest[q * kLanes + r];
    }
}

/// Computes C -= L D Mᵀ, M the first rows of L, on and below C's diagonal; the rest is undefined.
inline void subtract_product(const DenseBlock& L, const DenseBlock& D, const DenseBlock& C) {
  constexpr Eigen::Index kRows = 192, kDepth = 192;  // the part of L that fits the L2 cache
  const Eigen::Index depth = (std::min)(kDepth, L.cols), height = (std::min)(kRows, L.rows);
  Eigen::VectorXd a((height + kLanes) * depth), b((C.cols + kTileColumns) * depth);
  for (Eigen::Index k = 0; k < L.cols; k += depth) {
    const Eigen::Index n = (std::min)(depth, L.cols - k);
    const DenseBlock D_k = D.block(k, k, n, n);
    pack(L.block(0, k, C.cols, n), &D_k, kTileColumns, b.data());
    for (Eigen::Index i = 0; i < L.rows; i += kRows) {
      const Eigen::Index m = (std::min)(kRows, L.rows - i);
      pack(L.block(i, k, m, n), nullptr, kLanes, a.data());
      subtract_packed(a.data(), b.data(), n, i, C.block(i, 0, m, C.cols));
    }
  }
}

/// Factorises the top square of A as LDLT without pivoting and updates the rows below, by columns.
inline bool factor_narrow(const DenseBlock& A, int& negative) {
  const Eigen::Index k = A.cols, n = A.rows;
  for (Eigen::Index j = 0; j < k; ++j) {
    const double pivot = A(j, j);
    if (pivot == 0 || !std::isfinite(pivot)) return false;
    if (pivot < 0) ++negative;
    for (Eigen::Index c = j + 1; c < k; ++c)
      subtract_scaled(A(c, j) / pivot, A.col(j) + c, A.col(c) + c, n - c);
    for (Eigen::Index i = j + 1; i < n; ++i) A(i, j) /= pivot;
  }
  return true;
}

/// Factorises a panel of any width: the left half, the update of the right half, the right half.
inline bool factor_panel(const DenseBlock& A, int& negative) {
  constexpr Eigen::Index kNarrow = 16;
  const Eigen::Index n = A.rows, left = A.cols / 2, right = A.cols - left;
  if (A.cols <= kNarrow) return factor_narrow(A, negative);
  if (!factor_panel(A.block(0, 0, n, left), negative)) return false;
  subtract_product(A.block(left, 0, n - left, left), A, A.block(left, left, n - left, right));
  return factor_panel(A.block(left, left, n - left, right), negative);
}

// ---- factorisation ----

/// The data of a factor, per front.
struct LdltData {
  LdltSymbolic symbolic;
  Array<Eigen::MatrixXd> panel;   // 2 size × 2 own: L, with D on the diagonal of its top block
  Array<Eigen::MatrixXd> update;  // 2 rows × 2 rows, lower triangle; until its parent adds it
  Array<int> negative_pivots;     // their number; -1 after a zero or non-finite pivot
};

/// Adds a child's update matrix to the parent's panel (own columns) and update matrix (others).
inline void extend_add(const Front& child, const DenseBlock& from, int own, const DenseBlock& panel,
                       const DenseBlock& update) {
  const Array<int>& place = child.parent_row;
  for (int c = 0; c < place.size(); ++c) {
    const bool into_own = place[c] < own;
    const DenseBlock& target = into_own ? panel : update;
    const int shift = into_own ? 0 : own;
    for (int half = 0; half < 2; ++half) {
      const double* source = from.col(2 * c + half);
      double* sum = target.col(2 * (place[c] - shift) + half);
      for (int i = half; i < 2; ++i) sum[2 * (place[c] - shift) + i] += source[2 * c + i];
      for (int r = c + 1; r < place.size(); ++r) {
        double* at = sum + 2 * (place[r] - shift);
        at[0] += source[2 * r];
        at[1] += source[2 * r + 1];
      }
    }
  }
}

/// Assembles and eliminates a front whose children are done.
inline void eliminate_front(int id, const ShiftedMatrix& matrix, LdltData& factor) {
  const Front& front = factor.symbolic.fronts[id];
  factor.panel[id].setZero(2 * front.size(), 2 * front.own());
  factor.update[id].setZero(2 * front.rows.size(), 2 * front.rows.size());
  const DenseBlock panel = all_of(factor.panel[id]), update = all_of(factor.update[id]);
  for (const Front::OwnBlock& e : front.blocks) {
    const Mat2 block = e.transposed ? transposed(matrix.block(e.block)) : matrix.block(e.block);
    for (int c = 0; c < 2; ++c)
      for (int r = 0; r < 2; ++r) panel(2 * e.row + r, 2 * e.column + c) += block(r, c);
  }
  for (int child : front.children) {
    const Front& c = factor.symbolic.fronts[child];
    extend_add(c, all_of(factor.update[child]), front.own(), panel, update);
    factor.update[child].resize(0, 0);
  }
  if (!factor_panel(panel, factor.negative_pivots[id])) factor.negative_pivots[id] = -1;
  subtract_product(panel.block(panel.cols, 0, update.rows, panel.cols), panel, update);
}

/// Factorises a matrix of the analysed pattern.
inline void ldlt_refactorize(const ShiftedMatrix& matrix, const Executor& executor,
                             LdltFactor& factor) {
  LdltData& data = *factor.data;
  const LdltSymbolic& symbolic = data.symbolic;
  const int n = symbolic.fronts.size();
  data.panel.assign(n, {});
  data.update.assign(n, {});
  data.negative_pivots.assign(n, 0);
  for (const Array<Array<int>>& stage : symbolic.stages)
    executor.run(stage.size(), [&](int group) {
      for (int id : stage[group])
        if (!executor.is_stopped()) eliminate_front(id, matrix, data);
    });
  factor.ok = !executor.is_stopped();
  factor.negative = 0;
  for (int negative : data.negative_pivots) {
    factor.ok = factor.ok && negative >= 0;
    factor.negative += negative;
  }
}

inline void ldlt_factorize(const ShiftedMatrix& matrix, const Points2& positions,
                           const Executor& executor, LdltFactor& factor) {
  if (!factor.data) factor.data = std::make_shared<LdltData>();
  factor.data->symbolic = NestedDissection(*matrix.H, positions, executor).build();
  ldlt_refactorize(matrix, executor, factor);
}

// ---- solution ----

/// Solves L y = b by fronts, then D Lᵀ x = y in reverse; gathers a front's entries in one array.
inline Array<Vec2> ldlt_solve(const LdltFactor& factor, const Array<Vec2>& b) {
  const LdltData& data = *factor.data;
  const LdltSymbolic& symbolic = data.symbolic;
  const int n = symbolic.order.size(), n_fronts = symbolic.fronts.size();
  Array<Vec2> y(n), x(n), local;
  for (int i = 0; i < n; ++i) y[i] = b[symbolic.order[i]];
  for (int id = 0; id < n_fronts; ++id) {
    const Front& front = symbolic.fronts[id];
    if (front.own() == 0) continue;
    const Eigen::MatrixXd& P = data.panel[id];
    local.assign(front.size(), {});
    std::copy(y.data() + front.begin, y.data() + front.end, local.data());
    double* z = &local.data()->x;
    for (Eigen::Index j = 0; j < P.cols(); ++j)
      subtract_scaled(z[j], &P(j, j) + 1, z + j + 1, P.rows() - j - 1);
    std::copy(local.data(), local.data() + front.own(), y.data() + front.begin);
    for (int r = 0; r < front.rows.size(); ++r) y[front.rows[r]] += local[front.own() + r];
  }
  for (int id = n_fronts - 1; id >= 0; --id) {
    const Front& front = symbolic.fronts[id];
    if (front.own() == 0) continue;
    const Eigen::MatrixXd& P = data.panel[id];
    local.resize(front.size());
    std::copy(y.data() + front.begin, y.data() + front.end, local.data());
    for (int r = 0; r < front.rows.size(); ++r) local[front.own() + r] = y[front.rows[r]];
    double* z = &local.data()->x;
    for (Eigen::Index j = P.cols() - 1; j >= 0; --j)
      z[j] = z[j] / P(j, j) - inner_product(&P(j, j) + 1, z + j + 1, P.rows() - j - 1);
    std::copy(local.data(), local.data() + front.own(), y.data() + front.begin);
  }
  for (int i = 0; i < n; ++i) x[symbolic.order[i]] = y[i];
  return x;
}

// ==== [14] INITIAL EMBEDDING (paper §6, Initialization) ==========================================
//
// Purpose:    injective planar embeddings of A and B of low symmetric Dirichlet energy, with
//             landmarks near each other. It stands behind the loop, which maps its coarse levels.
// Method:     Tutte's embedding of a whole limb shrinks exponentially, below what doubles resolve;
//             so the mesh is decimated, the coarse mesh is embedded by Tutte's theorem, and its
//             vertices return in the reverse order, relaxed on the way [Hormann and Greiner 2000;
//             Tutte 1963]. Both planes meet at some hundred vertices, or come from there with a map
//             (part [21], candidates), and from there on Algorithm 1 maps every level. Exact
//             landmarks are joined before it runs. Held boundaries lie along a square from the
//             start. A free boundary that leaves no room for a vertex, or its surface strained,
//             goes back to a circle. On both, all triangles are alike at first, which leaves room
//             for Tutte's embedding of all vertices, or, if limbs shrink too much there, for
//             vertices inside to return; then triangles turn step by step to their own shapes, and
//             the planes meet at the full meshes.
// Invariants: after every vertex that returns and every step the embedding is injective, exactly.
// Fails:      if rounding leaves no room for a vertex; the status names it.

// ---- helpers ----

/// Returns x^t, t in [0, 1]: the product of the roots x^(1/2), x^(1/4), ... at binary digits of t.
inline double root_power(double x, double t) {
  if (t == 1) return x;
  double result = 1;
  for (double root = x; t > 0; t -= t >= 1) {
    root = std::sqrt(root);
    t *= 2;
    if (t >= 1) result *= root;
  }
  return result;
}

/// Returns the indices of keys, sorted by key, then by index.
inline Array<int> sorted_by(const Array<double>& key) {
  Array<int> order = numbers_below(key.size());
  std::sort(order.begin(), order.end(),
            [&](int i, int j) { return key[i] != key[j] ? key[i] < key[j] : i < j; });
  return order;
}

inline Triangles triangles_from(const Array<int>& corners) {
  Triangles triangles(corners.size() / 3, 3);
  std::copy(corners.begin(), corners.end(), triangles.data());
  return triangles;
}

/// Returns the half-edge from u to v, or, if only that exists, from v to u; -1 if there is no edge.
inline int find_edge(const HalfEdgeMesh& m, int u, int v) {
  int found = -1;
  if (u < 0 || u >= m.n_vertices) return found;
  m.for_each_outgoing(u, [&](int h) {
    if (m.tip(h) == v) found = h;
    if (m.tail[prev(h)] == v && m.twin[prev(h)] < 0) found = prev(h);
  });
  return found;
}

// ---- vertices that are added, and cuts ----

/// Cuts the triangle of h in two along the line from a vertex on its edge u → v to the corner
/// opposite; h then ends at that vertex. Returns the half-edge from there to v.
/// `motion`: the place of the vertex, on a pillow.
inline int split_face(HalfEdgeMesh& m, int h, int middle, const Motion& motion = {}) {
  const int a = next(h), rest = 3 * m.n_faces++;
  if (!m.pillow.is_empty()) {
    for (const Motion& place : {motion, m.pillow.place[a], m.pillow.place[prev(h)]})
      m.pillow.place.push_back(place);
    m.pillow.place[a] = motion;
  }
  const int v = m.tail[a], w = m.tip(a), outer = m.twin[a];
  for (int tail : {middle, v, w}) m.tail.push_back(tail);
  for (int twin : {-1, outer, a}) m.twin.push_back(twin);
  if (outer >= 0) m.twin[outer] = rest + 1;
  if (m.out[v] == a) m.out[v] = rest + 1;
  m.tail[a] = middle;
  m.twin[a] = rest + 2;
  return rest;
}

/// Cuts the edge of h in two; the new vertex is the last one.
inline void split_edge(HalfEdgeMesh& m, int h) {
  const int t = m.twin[h], middle = m.n_vertices++;
  const Motion on_other_side = t < 0 ? Motion() : motion_across(m, t);
  const int to_tip = split_face(m, h, middle);
  m.out.push_back(to_tip);
  if (t < 0) return;
  const int to_tail = split_face(m, t, middle, on_other_side);
  m.twin[h] = to_tail, m.twin[to_tail] = h;
  m.twin[t] = to_tip, m.twin[to_tip] = t;
}

/// Joins a new vertex, the last one, to the corners of the triangle of h.
inline void split_triangle(HalfEdgeMesh& m, int h) {
  const int u = m.tail[h], v = m.tip(h), outer = m.twin[h], middle = m.n_vertices++;
  Array<Motion> places;  // of the third triangle
  if (!m.pillow.is_empty())
    for (const Motion& place : {m.pillow.place[h], m.pillow.place[next(h)], Motion()})
      places.push_back(place);
  const int rest = split_face(m, h, middle), third = 3 * m.n_faces++;
  for (int tail : {u, v, middle}) m.tail.push_back(tail);
  for (int twin : {outer, rest, h}) m.twin.push_back(twin);
  m.pillow.place.append(places.data(), places.size());
  m.twin[rest] = third + 1, m.twin[h] = third + 2;
  if (outer >= 0) m.twin[outer] = third;
  if (outer < 0) m.out[u] = third;
  m.out.push_back(rest);
}

/// Replaces the edge a → b of h between the triangles abc and bad by the one between c and d. Then
/// a → d is the first half-edge of h's triangle, d → b that of the other one.
inline void flip(HalfEdgeMesh& m, int h) {
  const int t = m.twin[h], first = 3 * (h / 3), second = 3 * (t / 3);
  const int a = m.tail[h], b = m.tail[t], c = m.tail[prev(h)], d = m.tail[prev(t)];
  const int bc = m.twin[next(h)], ca = m.twin[prev(h)];
  const int ad = m.twin[next(t)], db = m.twin[prev(t)];
  const auto set = [&](int half_edge, int tail, int twin) {
    m.tail[half_edge] = tail;
    m.twin[half_edge] = twin;
    if (twin >= 0) m.twin[twin] = half_edge;
  };
  const auto keep_out = [&](int v, int before, int now) {
    if (m.out[v] == before) m.out[v] = now;
  };
  keep_out(a, h, first), keep_out(a, next(t), first);
  keep_out(b, t, second + 1), keep_out(b, next(h), second + 1);
  keep_out(c, prev(h), first + 2), keep_out(d, prev(t), second);
  set(first, a, ad), set(first + 1, d, second + 2), set(first + 2, c, ca);
  set(second, d, db), set(second + 1, b, bc), set(second + 2, c, first + 1);
}

/// A place on a mesh: at a vertex (other corners: -1), on an edge or in a triangle.
using Place = AddedVertex;

/// The vertex of a place, or -1 if it is on an edge or in a triangle.
inline int vertex_at(const Place& p) { return p.corners[1] < 0 ? p.corners[0] : -1; }
inline bool is_on_edge(const Place& p) { return p.corners[1] >= 0 && p.corners[2] < 0; }

inline AddedVertex copy_of(int v) {
  AddedVertex copy;
  copy.corners[0] = v;
  copy.weights[0] = 1;
  return copy;
}

/// A half-edge of the edge or triangle in which a vertex is to be added; -1 if there is none.
inline int find_place(const HalfEdgeMesh& m, const AddedVertex& p) {
  const Eigen::Vector3d& t = p.weights;
  const bool is_mean = t[0] > 0 && t[1] > 0 && (is_on_edge(p) ? t[2] == 0 : t[2] > 0) &&
                       std::abs(t[0] + t[1] + t[2] - 1) < 1e-9;
  const int h = is_mean ? find_edge(m, p.corners[0], p.corners[1]) : -1;
  if (h < 0 || is_on_edge(p) || m.tail[prev(h)] == p.corners[2]) return h;
  return m.twin[h] >= 0 && m.tail[prev(m.twin[h])] == p.corners[2] ? m.twin[h] : -1;
}

inline Vec2 mean(const Place& p, const Points2& x) {
  Vec2 sum;
  for (int k = 0; k < 3 && p.corners[k] >= 0; ++k) sum += p.weights[k] * row2(x, p.corners[k]);
  return sum;
}
inline Vec3 mean(const Place& p, const Points3& x) {
  Vec3 sum;
  for (int k = 0; k < 3 && p.corners[k] >= 0; ++k) sum += p.weights[k] * row3(x, p.corners[k]);
  return sum;
}

/// Vertices with those added behind them.
inline Points3 with_added(const Points3& vertices, const std::vector<AddedVertex>& added) {
  int v = static_cast<int>(vertices.rows());
  Points3 all(v + static_cast<int>(added.size()), 3);
  std::copy(vertices.data(), vertices.data() + vertices.size(), all.data());
  for (const AddedVertex& p : added) set_row(all, v++, mean(p, all));
  return all;
}

/// A place in the plane of a triangle, and the motions of its corners to this plane.
struct Spot {
  Vec2 at;
  std::array<Motion, 3> motion;
};

/// False if the place is not in the triangle.
inline bool find_spot(const HalfEdgeMesh& m, const Points2& x, const Place& p, int face,
                      Spot& spot) {
  spot = Spot();
  for (int k = 0; k < 3 && p.corners[k] >= 0; ++k) {
    int h = 3 * face;
    while (h < 3 * face + 3 && m.tail[h] != p.corners[k]) ++h;
    if (h == 3 * face + 3) return false;
    if (!m.pillow.is_empty()) spot.motion.data()[k] = m.pillow.place[h];
    spot.at += (vertex_at(p) >= 0 ? 1 : p.weights[k]) * place_of(m, x, h);
  }
  return true;
}

/// Takes vertices that were added to the mesh into the surface.
inline void append(const std::vector<AddedVertex>& added, Surface& s) {
  trace_boundary(s.mesh);
  s.vertices = with_added(s.vertices, added);
  s.added.insert(s.added.end(), added.begin(), added.end());
  compute_rest_frames(s);
}

/// Adds vertices one by one, to positions in the plane, too, if there are any; the shape stays. If
/// an edge or a triangle does not exist, returns false; the surface is then unusable.
inline bool add_vertices(const std::vector<AddedVertex>& added, Surface& s, Points2* x = nullptr) {
  const bool is_in_plane = x != nullptr && x->size() > 0;
  if (is_in_plane) x->conservativeResize(x->rows() + static_cast<int>(added.size()), 2);
  for (const AddedVertex& p : added) {
    const int h = find_place(s.mesh, p);
    if (h < 0) return false;
    Spot spot;
    if (is_in_plane && find_spot(s.mesh, *x, p, h / 3, spot))
      set_row(*x, s.mesh.n_vertices, usable(s.mesh, spot.at));
    is_on_edge(p) ? split_edge(s.mesh, h) : split_triangle(s.mesh, h);
  }
  append(added, s);
  return true;
}

/// Halves edges longer than `longest` at triangles larger than `largest`, the longest first [Rivara
/// 1984]. Flips make the parts of a triangle Delaunay [Lawson 1977]: halves of needles would be
/// needles.
class EdgeHalver {
 public:
  EdgeHalver(double longest, double largest, const Surface& s)
      : m(s.mesh), longest_(longest), largest_(largest), face_(numbers_below(m.n_faces)) {
    for (int v = 0; v < m.n_vertices; ++v) x_.push_back(row3(s.vertices, v));
    for (int h = 0; h < m.tail.size(); ++h)
      if (m.twin[h] < h) push(m.tail[h], m.tip(h));
  }

  HalfEdgeMesh m;
  std::vector<AddedVertex> added;

  /// Adds at most `most` vertices.
  void run(int most) {
    while (!heap_.empty() && static_cast<int>(added.size()) < most) {
      std::pop_heap(heap_.begin(), heap_.end());
      const Edge edge = heap_.back();
      heap_.pop_back();
      const int h = find_edge(m, edge.tail, edge.tip);
      if (h >= 0 && is_to_halve(h)) halve(h);
    }
  }

 private:
  static constexpr double kDigits = 1e6;  // so that rounding does not decide between equal lengths

  struct Edge {
    double length;
    int tail, tip;
    bool operator<(const Edge& o) const { return length < o.length; }
  };

  void push(int u, int v) {
    const double length = std::round(kDigits * norm(x_[v] - x_[u]) / longest_);
    if (!(length > kDigits)) return;
    heap_.push_back({length, u, v});
    std::push_heap(heap_.begin(), heap_.end());
  }

  bool is_to_halve(int h) const {
    bool is_large = false;
    for (int side : {h, m.twin[h]}) {
      if (side < 0) continue;
      const Vec3 u = x_[m.tail[h]], v = x_[m.tip(h)], w = x_[m.tail[prev(side)]];
      const Vec3 at = 0.5 * (u + v);
      const double whole = area(u, v, w);
      // Rounding may leave a half of a sliver no area.
      if (!((std::min)(area(u, at, w), area(at, v, w)) > 0.25 * whole)) return false;
      is_large = is_large || whole > (1 + 1 / kDigits) * largest_;
    }
    return is_large;
  }

  static double area(const Vec3& p, const Vec3& q, const Vec3& r) {
    return 0.5 * norm(cross(q - p, r - p));
  }

  void halve(int h) {
    const int u = m.tail[h], v = m.tip(h), t = m.twin[h], middle = m.n_vertices;
    added.push_back({u, v});
    x_.push_back(0.5 * (x_[u] + x_[v]));
    split_edge(m, h);
    face_.push_back(face_[h / 3]);
    if (t >= 0) face_.push_back(face_[t / 3]);
    make_delaunay(middle);
    m.for_each_outgoing(middle, [&](int e) {
      push(middle, m.tip(e));
      if (m.twin[prev(e)] < 0) push(middle, m.tail[prev(e)]);
    });
  }

  /// Flips edges opposite a new vertex; each flip adds an edge to it.
  void make_delaunay(int v) {
    Array<int> opposite;
    m.for_each_outgoing(v, [&](int h) { opposite.push_back(next(h)); });
    while (!opposite.empty()) {
      const int h = opposite.back(), t = m.twin[h];
      opposite.pop_back();
      if (t < 0 || face_[h / 3] != face_[t / 3] || !flip_improves(h)) continue;
      flip(m, h);
      opposite.push_back(3 * (h / 3));
      opposite.push_back(3 * (t / 3));
    }
  }

  /// Returns true if the angles opposite an edge add up to more than π.
  bool flip_improves(int h) const {
    constexpr double kClear = 1e-9;
    const Vec3 a = x_[m.tail[h]], b = x_[m.tip(h)];
    double cotangent[2];
    for (int i = 0; i < 2; ++i) {
      const Vec3 c = x_[m.tail[prev(i == 0 ? h : m.twin[h])]];
      cotangent[i] = dot(a - c, b - c) / norm(cross(a - c, b - c));
    }
    return cotangent[0] + cotangent[1] <
           -kClear * (std::abs(cotangent[0]) + std::abs(cotangent[1]));
  }

  double longest_, largest_;
  Array<Vec3> x_;
  Array<int> face_;  // per triangle, that of the surface
  Array<Edge> heap_;
};

/// Halves edges of a surface, adding at most `most` vertices.
inline void halve_edges(double longest, double largest, int most, Surface& s) {
  EdgeHalver halver(longest, largest, s);
  halver.run(most);
  s.mesh = std::move(halver.m);
  append(halver.added, s);
}

/// Cuts a surface along inner edges. At the tail of each half-edge given, the fan on its left keeps
/// the vertex; the other fans get copies, counter-clockwise.
inline void cut_along(const Array<int>& edges, Surface& s) {
  HalfEdgeMesh& m = s.mesh;
  Array<char> is_cut(m.tail.size(), 0), is_split(m.n_vertices, 0);
  for (int h : edges) is_cut[h] = is_cut[m.twin[h]] = 1;
  std::vector<AddedVertex> copies;
  for (int h : edges) {
    const int v = m.tail[h];
    if (v >= is_split.size() || is_split[v]++) continue;  // another edge at the same vertex
    for (int e = m.turn(h), id = v; e != h; e = m.turn(e)) {
      if (is_cut[e]) {
        copies.push_back(copy_of(v));
        id = m.n_vertices++;
      }
      m.tail[e] = id;
    }
  }
  for (int h = 0; h < m.twin.size(); ++h)
    if (is_cut[h]) m.twin[h] = -1;
  find_outgoing(m);
  append(copies, s);
}

// ---- landmarks on the surfaces ----

inline bool on_boundary(const HalfEdgeMesh& m, const Place& p) {
  if (vertex_at(p) >= 0) return m.on_boundary(vertex_at(p));
  return is_on_edge(p) && m.twin[find_edge(m, p.corners[0], p.corners[1])] < 0;
}

/// Removes corners that are -1 or have hardly any weight; false if none is left.
inline bool tidy(Place& p) {
  int n = 0;
  for (int k = 0; k < 3; ++k) {
    if (p.corners[k] < 0 || !(p.weights[k] > 1e-9)) continue;
    p.corners[n] = p.corners[k];
    p.weights[n++] = p.weights[k];
  }
  for (int k = n; k < 3; ++k) p.corners[k] = -1, p.weights[k] = 0;
  const double sum = p.weights[0] + p.weights[1] + p.weights[2];
  for (double& weight : p.weights) weight /= sum;
  return n > 0;
}

/// Updates a place after a vertex was added: the vertex replaces the corner that loses its weight
/// first, so the corners are those of the piece in which the place lies.
inline void follow(const AddedVertex& added, int id, Place& p) {
  int at[3], last = -1;
  double least = kInfinity;
  if (vertex_at(added) >= 0) return;  // a copy
  const int n = is_on_edge(added) ? 2 : 3;
  for (int k = 0; k < n; ++k) {
    for (at[k] = 0; at[k] < 3 && p.corners[at[k]] != added.corners[k];) ++at[k];
    if (at[k] == 3) return;  // in another triangle
    const double most = p.weights[at[k]] / added.weights[k];
    if (most < least) least = most, last = at[k];
  }
  for (int k = 0; k < n; ++k) p.weights[at[k]] -= least * added.weights[k];
  p.corners[last] = id;
  p.weights[last] = least;
  tidy(p);
}

/// A place of a mesh of n vertices, after vertices were added to it.
inline Place located(Place p, int n, const std::vector<AddedVertex>& added) {
  for (const AddedVertex& vertex : added) follow(vertex, n++, p);
  return p;
}

/// The vertex at a place of such a mesh; adds one if there is none.
inline int add_place(const Place& p, int n, std::vector<AddedVertex>& added) {
  const Place here = located(p, n, added);
  if (vertex_at(here) >= 0) return vertex_at(here);
  added.push_back(here);
  return n + static_cast<int>(added.size()) - 1;
}

struct PlacedLandmark {
  Place a, b;
  Landmark given;
  double weight = 1;  // less for pairs that were found, not given
};

/// Landmarks of the given meshes on the surfaces, to which vertices may have been added.
inline Array<PlacedLandmark> located(Array<PlacedLandmark> landmarks, const SurfacePair& pair) {
  const auto move = [](const Surface& s, Place& p) {
    p = located(p, s.mesh.n_vertices - static_cast<int>(s.added.size()), s.added);
  };
  for (PlacedLandmark& l : landmarks) move(pair.a, l.a), move(pair.b, l.b);
  return landmarks;
}

/// A landmark with both ends at vertices.
struct VertexPair {
  int a = -1, b = -1;
  Landmark given = {};
};

inline Array<VertexPair> vertex_pairs(const Array<PlacedLandmark>& landmarks) {
  Array<VertexPair> pairs;
  for (const PlacedLandmark& l : landmarks)
    if (vertex_at(l.a) >= 0 && vertex_at(l.b) >= 0)
      pairs.push_back({vertex_at(l.a), vertex_at(l.b), l.given});
  return pairs;
}

/// One end of a landmark in the ids given.
inline bool is_point(const LandmarkPoint& p) { return p.vertex == -1 && p.point.face != -1; }
inline int id_of(const LandmarkPoint& p) { return is_point(p) ? p.point.face : p.vertex; }
inline std::string name_of(const LandmarkPoint& p) {
  return is_point(p) ? sentence({"(triangle ", p.point.face, ")"}) : sentence({p.vertex});
}

/// "landmark 3 (triangle 5): "
inline std::string name_of(const Landmark& l) {
  return sentence({"landmark ", name_of(l.a), " ", name_of(l.b), ": "});
}

/// Holds the vertex of A of a landmark at that of B, a corner of a triangle around it.
inline Follower landmark_follower(const JointSurface& s, const Points2& x, const VertexPair& l) {
  const int v = s.n_a + l.b, h = s.mesh.out[v];
  Follower follower = follower_in(s.mesh, l.a, h / 3, unit3(h % 3));
  follower.motion[static_cast<std::size_t>(h % 3)] =
      nearest_motion(s.mesh, row2(x, l.a), row2(x, v));
  return follower;
}

/// uᵀ K u - 2 forceᵀ u on u = p - q for two places, as springs between their corners: where
/// Σ c_k = 0 and u = Σ c_k x_k, uᵀ K u = -Σ_{k<l} c_k c_l (x_k - x_l)ᵀ K (x_k - x_l), and
/// u = -Σ_l c_l (x_0 - x_l).
/// `motion`: takes the corners to one plane.
inline void add_springs(const Place& p, const Place& q, const Mat2& stiffness, Vec2 force,
                        const std::array<Motion, 6>& motion, Array<Spring>& springs) {
  const auto corner = [&](int k) { return k < 3 ? p.corners[k] : q.corners[k - 3]; };
  const auto c = [&](int k) { return k < 3 ? p.weights[k] : -q.weights[k - 3]; };
  for (int k = 0; k < 6; ++k)
    for (int l = k + 1; l < 6; ++l) {
      if (corner(k) < 0 || corner(l) < 0) continue;
      const Motion& g = motion.data()[k];
      springs.push_back({corner(k), corner(l), -c(k) * c(l) * stiffness,
                         (k == 0 ? -g.sign * c(l) : 0) * force, inverse(g) * motion.data()[l]});
    }
}

/// The spot in some triangle at a place.
inline Spot spot_of(const HalfEdgeMesh& m, const Points2& x, const Place& p) {
  Spot spot;
  bool is_found = false;
  m.for_each_outgoing(p.corners[0],
                      [&](int h) { is_found = is_found || find_spot(m, x, p, h / 3, spot); });
  if (!is_found) spot = {mean(p, x), {}};  // what decimation left of a place
  return spot;
}

/// Springs between two places of A ⊔ B, the shorter way on a pillow.
inline void add_springs(const HalfEdgeMesh& m, const Points2& x, const Place& p, const Place& q,
                        const Mat2& stiffness, Array<Spring>& springs) {
  const Spot from = spot_of(m, x, p), to = spot_of(m, x, q);
  const Motion motion = nearest_motion(m, from.at, to.at);
  std::array<Motion, 6> all;
  for (std::size_t k = 0; k < 3; ++k) all[k] = from.motion[k], all[3 + k] = motion * to.motion[k];
  add_springs(p, q, stiffness, {}, all, springs);
}

/// Finds the place of the other mesh on which a place lies, and the motions of the corners of both
/// to one plane; false if the map does not cover it.
inline bool find_image(const HalfEdgeMesh& m, const Points2& x,
                       const Array<OverlayPolygon>& polygons, const Groups<int>& by_face,
                       const Place& p, Place& image, std::array<Motion, 6>& motion) {
  constexpr double kRounding = 1e-9;
  double most = -kRounding;
  m.for_each_outgoing(p.corners[0], [&](int h) {
    Spot spot;
    if (!find_spot(m, x, p, h / 3, spot)) return;
    by_face.for_each_in(h / 3, [&](int i) {
      const OverlayPolygon& polygon = polygons[i];
      const bool is_on_b = polygon.tb == h / 3;
      const Motion to_a = is_on_b ? polygon.motion : Motion();  // to the plane of t_A
      const int first = 3 * (is_on_b ? polygon.ta : polygon.tb), own = is_on_b ? 0 : 3;
      const SixPoints points = six_points(m, x, polygon);
      const Vec3 w = barycentric(to_a * spot.at, points[own], points[own + 1], points[own + 2]);
      const double least = (std::min)({w.x, w.y, w.z});
      if (least <= most) return;
      most = least;
      for (int k = 0; k < 3; ++k) {
        image.corners[k] = m.tail[first + k], image.weights[k] = w[k];
        motion.data()[k] = to_a * spot.motion.data()[k];
        motion.data()[3 + k] = motion_in(m, polygon, first + k);
      }
    });
  });
  return most > -kRounding;
}

// ---- alignment ----

/// The planar area of the triangles around a place, relative to their area on the surface.
inline double planar_scale(const Surface& s, const Points2& x, const Place& p) {
  double flat = 0, area = 0;
  for (int v : p.corners)
    if (v >= 0)
      s.mesh.for_each_outgoing(v, [&](int h) {
        const int f = h / 3;
        const Vec2 corner = corner_place(s.mesh, x, f, 0);
        flat += 0.5 * cross(corner_place(s.mesh, x, f, 1) - corner,
                            corner_place(s.mesh, x, f, 2) - corner);
        area += s.area[f];
      });
  return flat / area;
}

/// A place of B in A ⊔ B.
inline Place in_joint(const JointSurface& s, Place p) {
  for (int k = 0; k < 3; ++k)
    if (p.corners[k] >= 0) p.corners[k] += s.n_a;
  return p;
}

/// The energy of landmarks that pull: Σ w S ρ(|r|²/S), where ρ(t) = t / (1 + t/c²) [Geman and
/// McClure 1985], S is the mean area of the surfaces, and r leads from the image of A's end to B's
/// end in space, for any planes. A landmark that contradicts the map loses its pull; one that is
/// not covered counts as that. In its triangle of B the image is Σ φ_k X_k. It moves by J u if the
/// end of A moves by u relative to the plane of the triangle: springs w ρ'(t) (uᵀ Jᵀ J u - 2 rᵀ J
/// u) have its gradient.
class LandmarkPull {
 public:
  LandmarkPull(const JointSurface& s, const Array<PlacedLandmark>& landmarks,
               const std::vector<Curve>& curves)
      : s_(&s), unit_(0.5 * s.total_area) {
    constexpr double kMost = 50;       // landmarks of full weight; more share it
    constexpr int kMostSprings = 300;  // of many landmarks, so many spread over the list pull
    const int step = 1 + landmarks.size() / (kMostSprings + 1);
    double total = 0;
    for (int i = 0; i < landmarks.size(); i += step) {
      const PlacedLandmark& l = landmarks[i];
      if (l.weight < 1 || !(l.given.weight > 0)) continue;
      total += l.given.weight;
      ends_.push_back({l.a, targets_.size(), l.given.weight});
      targets_.push_back(Array<Vec3>(1, mean(in_joint(s, l.b), s.vertices)));
    }
    for (End& end : ends_) end.weight *= (std::min)(1.0, kMost / total);
    for (const Curve& curve : curves) {
      Array<Vec3> line;
      for (int v : curve.b) line.push_back(row3(s.vertices, s.n_a + v));
      const double weight = curve.weight / static_cast<double>(curve.a.size());
      for (int v : curve.a)
        if (!line.empty()) ends_.push_back({copy_of(v), targets_.size(), weight});
      targets_.push_back(line);
    }
  }

  bool is_empty() const { return ends_.empty(); }

  double operator()(const Iterate& x, Array<Spring>& springs) const {
    const Groups<int> by_face = group_polygons(x.overlay.polygons, s_->mesh.n_faces);
    double energy = 0;
    for (const End& end : ends_) energy += pull(end, x, by_face, springs);
    return energy;
  }

 private:
  struct End {
    Place a;
    int target;  // a point or a line
    double weight;
  };

  double pull(const End& end, const Iterate& x, const Groups<int>& by_face,
              Array<Spring>& springs) const {
    constexpr double kDoubt = 0.15;  // c, in roots of the area
    Place on_b;
    std::array<Motion, 6> motion;
    if (!find_image(s_->mesh, x.x, x.overlay.polygons, by_face, end.a, on_b, motion))
      return unit_ * end.weight * kDoubt * kDoubt;
    const auto on = [&](int k) { return row3(s_->vertices, on_b.corners[k]); };
    const auto flat = [&](int k) { return motion.data()[3 + k] * row2(x.x, on_b.corners[k]); };
    const Vec3 image = mean(on_b, s_->vertices);
    const Vec3 r = nearest_on(targets_[end.target], image) - image;
    const double t = squared_norm(r) / unit_, share = 1 / (1 + t / (kDoubt * kDoubt));
    const double weight = end.weight * share * share;
    const Vec3 e1 = on(1) - on(0), e2 = on(2) - on(0);  // J = (e1 e2) P
    const Mat2 P = inverse(columns(flat(1) - flat(0), flat(2) - flat(0)));
    const Mat2 metric = {{dot(e1, e1), dot(e1, e2), dot(e1, e2), dot(e2, e2)}};
    add_springs(end.a, on_b, weight * (transposed(P) * metric * P),
                weight * (transposed(P) * Vec2{dot(e1, r), dot(e2, r)}), motion, springs);
    return unit_ * end.weight * t * share;
  }

  static Vec3 nearest_on(const Array<Vec3>& line, const Vec3& p) {
    Vec3 nearest = line[0];
    for (int i = 1; i < line.size(); ++i) {
      const Vec3 along = line[i] - line[i - 1];
      const double t = dot(p - line[i - 1], along) / squared_norm(along);
      const Vec3 q = line[i - 1] + (t > 0 ? (std::min)(t, 1.0) : 0) * along;
      if (squared_norm(q - p) < squared_norm(nearest - p)) nearest = q;
    }
    return nearest;
  }

  const JointSurface* s_;
  double unit_;
  Array<End> ends_;
  Array<Array<Vec3>> targets_;
};

inline Vec2 centroid(const Points2& x) {
  Vec2 sum;
  for (int i = 0; i < x.rows(); ++i) sum += row2(x, i);
  return 1 / static_cast<double>(x.rows()) * sum;
}

/// Returns Σ conj(p) q of points as complex numbers, from their centroids: its argument is the
/// angle between the two sets.
inline Vec2 correlation(const Points2& from, const Points2& to) {
  const Vec2 c0 = centroid(from), c1 = centroid(to);
  double along = 0, across = 0;
  for (int i = 0; i < from.rows(); ++i) {
    const Vec2 p = row2(from, i) - c0, q = row2(to, i) - c1;
    along += dot(p, q);
    across += cross(p, q);
  }
  return {along, across};
}

/// Returns the relative residual of the best similarity between two sets of points in the second
/// moment: 0 if it fits, at most 1.
inline double misfit(const Points2& from, const Points2& to) {
  return 1 - squared_norm(correlation(from, to)) /
                 (norm(correlation(from, from)) * norm(correlation(to, to)));
}

/// The loop of every boundary vertex; -1 for others.
inline Array<int> boundary_loops(const HalfEdgeMesh& m) {
  Array<int> loop(m.n_vertices, -1);
  for (int i = 0; i < m.loops(); ++i)
    for (int k = m.loop[i]; k < m.loop[i + 1]; ++k) loop[m.tail[m.boundary[k]]] = i;
  return loop;
}

inline double loop_length(const Surface& s, int loop) {
  double length = 0;
  for (int k = s.mesh.loop[loop]; k < s.mesh.loop[loop + 1]; ++k)
    length += s.edge_length(s.mesh.boundary[k]);
  return length;
}

/// The loop around a surface: the one through a vertex, or, if that is -1, the longest.
inline int outer_loop(const Surface& s, int vertex) {
  if (vertex >= 0) return boundary_loops(s.mesh)[vertex];
  int outer = 0;
  double longest = -1;
  for (int i = 0; i < s.mesh.loops(); ++i)
    if (const double length = loop_length(s, i); length > longest) longest = length, outer = i;
  return outer;
}

// ---- outlines ----

/// The boundary of a mesh along a square or a circle around the origin, counter-clockwise: u from k
/// to k + 1 is side k of the square, or quarter k of the circle.
struct Outline {
  double half_side = 0;
  bool is_round = false;
  int corner[4];    // of a square: the vertices at u = 0, 1, 2 and 3
  Array<double> u;  // per vertex, -1 off the boundary

  Vec2 point(int v) const {
    if (is_round) return half_side * on_circle(0.5 * kPi * u[v]);
    const int side = static_cast<int>(u[v]);
    Vec2 p = {half_side * (2 * (u[v] - side) - 1), -half_side};
    for (int k = 0; k < side % 4; ++k) p = -perp(p);  // a quarter turn
    return p;
  }

  /// True for two boundary vertices on one side; corners are on two. An inner edge between them
  /// would lie in the side.
  bool share_side(int v, int w) const {
    if (is_round || !(u[v] >= 0 && u[w] >= 0)) return false;
    const int i = static_cast<int>(u[v]), j = static_cast<int>(u[w]);
    return i == j || (u[v] == i && (i + 3) % 4 == j) || (u[w] == j && (j + 3) % 4 == i);
  }
};

/// The vertices of a loop evenly along a circle as large as the surface.
inline Outline circle_for(const Surface& s, int loop) {
  Outline circle;
  circle.is_round = true;
  circle.half_side = std::sqrt(s.total_area / kPi);
  circle.u.assign(s.mesh.n_vertices, -1);
  const int begin = s.mesh.loop[loop], edges = s.mesh.loop[loop + 1] - begin;
  for (int i = 0; i < edges; ++i)
    circle.u[s.mesh.tail[s.mesh.boundary[begin + i]]] = 4.0 * i / edges;
  return circle;
}

// ---- decimation ----
//
// Purpose:    removes vertices by half-edge collapses, and restores them.
// Source:     error quadrics [Garland and Heckbert 1997], the link condition [Dey et al. 1999].
// Invariants: the mesh is a disk after every collapse; undo() restores it exactly.
// Fails:      never; it stops where no collapse is left.

/// Vertex u was moved onto its neighbour v. To undo it, the changed faces get u back, and the dead
/// ones revive.
struct Collapse {
  int u = -1, v = -1;
  Array<int> dead, changed;
};

/// A triangle mesh under decimation: faces keep their ids, dead faces keep their corners.
struct DynamicMesh {
  Array<std::array<int, 3>> face;
  Array<char> alive;                        // per face
  Array<Array<int>> faces_of;               // per vertex, living faces
  Array<int> boundary;                      // its vertices, loop by loop, also those that are gone
  Array<int> boundary_next, boundary_prev;  // per vertex, -1 off the boundary
  Array<int> boundary_place;                // per vertex, where it is in `boundary`

  explicit DynamicMesh(const HalfEdgeMesh& m)
      : face(m.n_faces),
        alive(m.n_faces, 1),
        faces_of(m.n_vertices),
        boundary_next(m.n_vertices, -1),
        boundary_prev(m.n_vertices, -1),
        boundary_place(m.n_vertices, -1) {
    for (int f = 0; f < m.n_faces; ++f) {
      face[f] = {m.corner(f, 0), m.corner(f, 1), m.corner(f, 2)};
      for (int v : face[f]) faces_of[v].push_back(f);
    }
    for (int h : m.boundary) {
      boundary_place[m.tail[h]] = boundary.size();
      boundary.push_back(m.tail[h]);
      link(m.tail[h], m.tip(h));
    }
  }

  bool on_boundary(int v) const { return boundary_next[v] >= 0; }
  bool is_present(int v) const { return !faces_of[v].empty(); }
  bool follow_each_other(int v, int w) const {
    return boundary_next[v] == w || boundary_prev[v] == w;
  }
  bool has(int f, int v) const { return face[f][0] == v || face[f][1] == v || face[f][2] == v; }

  /// The neighbours of u, each once, ascending.
  Array<int> neighbours(int u) const {
    Array<int> ring;
    for (int f : faces_of[u])
      for (int v : face[f])
        if (v != u) ring.push_back(v);
    sort_unique(ring);
    return ring;
  }

  /// The link condition: collapsing u onto v leaves a disk.
  bool may_collapse(int u, int v, const Array<int>& ring_u) const {
    const bool along = follow_each_other(u, v);
    if (on_boundary(u) && !along) return false;
    if (on_boundary(u) && boundary_next[boundary_next[boundary_next[u]]] == u) return false;
    const Array<int> ring_v = neighbours(v);
    const auto is_common = [&](int w) {
      return std::binary_search(ring_v.begin(), ring_v.end(), w);
    };
    return std::count_if(ring_u.begin(), ring_u.end(), is_common) == (along ? 1 : 2);
  }

  Collapse collapse(int u, int v) {
    Collapse c;
    c.u = u, c.v = v;
    for (int f : faces_of[u]) (has(f, v) ? c.dead : c.changed).push_back(f);
    for (int f : c.dead) {
      alive[f] = 0;
      for (int w : face[f]) leave(f, w);
    }
    for (int f : c.changed) give(f, u, v);
    if (on_boundary(u)) link(boundary_prev[u], boundary_next[u]);
    return c;
  }

  void undo(const Collapse& c) {
    for (int f : c.changed) give(f, c.v, c.u);
    for (int f : c.dead) {
      alive[f] = 1;
      for (int v : face[f]) faces_of[v].push_back(f);
    }
    if (!on_boundary(c.u)) return;
    link(boundary_prev[c.u], c.u);
    link(c.u, boundary_next[c.u]);
  }

 private:
  void leave(int f, int v) {
    Array<int>& faces = faces_of[v];
    int* const at = std::find(faces.begin(), faces.end(), f);
    std::copy(at + 1, faces.end(), at);
    faces.pop_back();
  }

  /// Puts `to` in the place of a corner of f.
  void give(int f, int from, int to) {
    std::replace(face[f].begin(), face[f].end(), from, to);
    leave(f, from);
    faces_of[to].push_back(f);
  }

  void link(int u, int v) { boundary_next[u] = v, boundary_prev[v] = u; }
};

/// The squared distances of a point from weighted planes, summed.
struct Quadric {
  double entry[4][4] = {};

  void add_plane(const Vec3& normal, const Vec3& p, double weight) {
    const double plane[4] = {normal.x, normal.y, normal.z, -dot(normal, p)};
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) entry[i][j] += weight * plane[i] * plane[j];
  }
  void add(const Quadric& other) {
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) entry[i][j] += other.entry[i][j];
  }
  double at(const Vec3& p) const {
    const double x[4] = {p.x, p.y, p.z, 1};
    double sum = 0;
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) sum += x[i] * entry[i][j] * x[j];
    return sum;
  }
};

/// Chooses the collapses, cheapest first: the cost is the error quadric plus a little of the edge
/// length; protected vertices go as late as the shape of triangles allows. Vertices on an outline
/// stay, and no inner edge comes to lie in a side of a square.
class Decimation {
 public:
  static constexpr char kCone = 2;  // among `is_protected`: never collapsed

  /// `outline`: holds its vertices, which are never collapsed; null if the boundary is free.
  Decimation(const Surface& s, const Array<char>& is_protected, const Outline* outline,
             const Executor& executor, DynamicMesh& mesh)
      : s_(s),
        protected_(is_protected),
        outline_(outline),
        executor_(executor),
        mesh_(mesh),
        version_(s.mesh.n_vertices, 0) {
    compute_quadrics();
  }

  /// Collapses until at most `target` vertices are left, or the caller stops. At first, the shape
  /// of triangles counts, then not.
  Array<Collapse> run(int target) {
    Array<Collapse> collapses;
    int active = s_.mesh.n_vertices;
    for (bool keep_shape : {true, false}) {
      keep_shape_ = keep_shape;
      heap_ = {};
      for (int v = 0; v < s_.mesh.n_vertices; ++v) push(v);
      while (active > target && !heap_.empty() && !executor_.is_stopped()) {
        const Candidate c = heap_.top();
        heap_.pop();
        if (c.version != version_[c.u]) continue;
        const Array<int> ring = mesh_.neighbours(c.u);
        if (!may_collapse(c.u, c.v, ring)) {  // the ring of v has changed since, or the boundary
          push(c.u);
          continue;
        }
        quadric_[c.v].add(quadric_[c.u]);
        collapses.push_back(mesh_.collapse(c.u, c.v));
        ++version_[c.u];
        --active;
        for (int w : ring) push(w);
      }
    }
    return collapses;
  }

 private:
  struct Candidate {
    double cost;
    int u, v, version;
    bool operator<(const Candidate& o) const {  // a heap gives the largest first
      return cost != o.cost ? cost > o.cost : u > o.u;
    }
  };

  Vec3 point(int v) const { return row3(s_.vertices, v); }

  void compute_quadrics() {
    const HalfEdgeMesh& m = s_.mesh;
    quadric_.resize(m.n_vertices);
    for (int h = 0; h < m.tail.size(); ++h) {
      const Vec3 p = point(m.tail[h]), q = point(m.tip(h)), r = point(m.tail[prev(h)]);
      const Vec3 normal = normalized(cross(q - p, r - p));
      quadric_[m.tail[h]].add_plane(normal, p, s_.area[h / 3]);
      if (m.twin[h] >= 0) continue;
      const Vec3 side = normalized(cross(normal, q - p));
      for (int v : {m.tail[h], m.tip(h)}) quadric_[v].add_plane(side, p, squared_norm(q - p));
    }
  }

  void push(int u) {
    ++version_[u];
    Candidate best{kInfinity, u, -1, version_[u]};
    if (is_hub(u) || protected_[u] == kCone || is_on_outline(u)) return;
    const Array<int> ring = mesh_.neighbours(u);
    for (int v : ring) {
      const double cost = cost_of(u, v);
      if (cost < best.cost && may_collapse(u, v, ring) && shape_allows(u, v)) {
        best.cost = cost;
        best.v = v;
      }
    }
    if (best.v >= 0) heap_.push(best);
  }

  /// A vertex of very many triangles waits until its neighbours have gone, which bounds the cost of
  /// a collapse. They can go: on average, vertices with only such neighbours give each of these
  /// fewer than twelve triangles.
  bool is_hub(int v) const { return mesh_.faces_of[v].size() > kHub; }

  /// No edge joins two cones, or no path would pass between them.
  bool may_collapse(int u, int v, const Array<int>& ring) const {
    for (int w : ring) {
      if (w == v) continue;
      if (protected_[v] == kCone && protected_[w] == kCone) return false;
      if (outline_ != nullptr && outline_->share_side(v, w) && !mesh_.follow_each_other(v, w))
        return false;
    }
    return !is_hub(u) && !is_hub(v) && mesh_.may_collapse(u, v, ring);
  }

  bool is_on_outline(int v) const { return outline_ != nullptr && outline_->u[v] >= 0; }

  double cost_of(int u, int v) const {
    constexpr double kLength = 1e-3;    // share of the length, keeps flat regions even
    constexpr double kProtected = 1e6;  // times the squared area of the surface
    const double length2 = squared_norm(point(u) - point(v));
    const double cost = quadric_[u].at(point(v)) + kLength * length2 * length2;
    return cost + (protected_[u] ? kProtected * s_.total_area * s_.total_area : 0);
  }

  bool shape_allows(int u, int v) const {
    constexpr double kTurn = 0.2;      // least cosine between old and new normal
    constexpr double kQuality = 0.15;  // least 4√3 area / Σ length² unless it was worse before
    constexpr double kThinnest = 1e-10;  // and always
    for (int f : mesh_.faces_of[u]) {
      if (mesh_.has(f, v)) continue;
      std::array<int, 3> after = mesh_.face[f];
      const Vec3 n0 = normal(after);
      const double q0 = quality(after);
      std::replace(after.begin(), after.end(), u, v);
      const Vec3 n1 = normal(after);
      const double q1 = quality(after);
      if (q1 < kThinnest) return false;
      if (!keep_shape_) continue;
      if (dot(n0, n1) < kTurn * norm(n0) * norm(n1) || q1 < (std::min)(kQuality, q0)) return false;
    }
    return true;
  }

  Vec3 normal(const std::array<int, 3>& t) const {
    return cross(point(t[1]) - point(t[0]), point(t[2]) - point(t[0]));
  }

  double quality(const std::array<int, 3>& t) const {
    const double sum = squared_norm(point(t[1]) - point(t[0])) +
                       squared_norm(point(t[2]) - point(t[1])) +
                       squared_norm(point(t[0]) - point(t[2]));
    return 2 * std::sqrt(3.0) * norm(normal(t)) / sum;
  }

  const Surface& s_;
  const Array<char>& protected_;
  const Outline* const outline_;
  const Executor& executor_;
  DynamicMesh& mesh_;
  Array<Quadric> quadric_;
  Array<int> version_;
  std::priority_queue<Candidate> heap_;
  bool keep_shape_ = true;
};

// ---- planar Newton ----
//
// Purpose:    minimises the symmetric Dirichlet energies of one or two embeddings, and springs
//             between them: Algorithm 1 without the map, its memory and its preconditioner.
// Source:     projected Newton with backtracking (§5.1, §5.2). Unlike in part [12], trials run one
//             after the other, longest first, until one is good enough.
// Invariants: every accepted step is injective, exactly, and lowers the energy.
// Fails:      ends where it finds no step.

/// A surface, or A ⊔ B, with an embedding to relax.
struct FlatProblem {
  Surface surface;
  Boundary boundary = Boundary::kFree;
  Array<Spring> springs = {};
  Array<Follower> followers = {};
};

class FlatNewton {
 public:
  /// Starts from an injective x.
  FlatNewton(FlatProblem problem, Points2 x, const Executor& executor)
      : problem_(std::move(problem)),
        m_(problem_.surface.mesh),
        executor_(executor),
        is_fixed_(m_.n_vertices),
        x_(std::move(x)),
        energy_(value(x_)) {
    fix_boundaries(m_, x_, problem_.boundary, is_fixed_);
    for (int v : m_.pillow.cones) is_fixed_.fix(v);
  }

  const Points2& positions() const { return x_; }

  /// Takes a step; returns true if another one follows. There are at most `most`, until one lowers
  /// the energy by less than a fraction `tolerance`; more as long as each lowers it by much, as
  /// next to a degenerate triangle. If the caller stops it, the next call repeats it.
  bool minimize(int most, double tolerance) {
    constexpr int kEnd = 200;
    constexpr double kMuch = 0.25;
    const double before = energy_;
    const bool gained = step();
    if (!gained && executor_.is_stopped()) return true;
    ++steps_;
    if (!gained || steps_ >= kEnd) return false;
    return before - energy_ >= (steps_ < most ? tolerance : kMuch) * energy_;
  }

  double value(const Points2& x) const {
    return with_springs(embedding_energy(problem_.surface, x, 0, m_.n_faces), problem_.springs, x);
  }

 private:
  /// Takes a projected Newton step with backtracking; false if the energy does not fall. Once a
  /// trial makes the boundary intersect itself, its gaps stay open.
  bool step() {
    constexpr double kWeight = 0.01;  // of all gaps, per area of the surface
    const LinearSystem system = assemble();
    while (true) {
      bool collided = false;
      if (keeps_gaps_) gaps_ = find_gaps(m_, x_, kWeight * problem_.surface.total_area);
      if (descend(system, collided)) return true;
      if (keeps_gaps_ || !collided || executor_.is_stopped()) return false;
      keeps_gaps_ = true;
    }
  }

  bool descend(LinearSystem system, bool& collided) {
    constexpr int kMostTrials = 30;
    const Array<Vec2> gradient = system.gradient;
    add_springs_and_gaps(system);
    reduce(problem_.followers, is_fixed_, executor_, system);
    ldlt_factorize(system.shifted(0), x_, executor_, factor_);
    if (!factor_.ok) return false;
    Array<Vec2> d = ldlt_solve(factor_, negated(system.gradient));
    expand_direction(problem_.followers, d);
    const double slope = dot(gradient, d);
    if (!(slope < 0 && std::isfinite(slope))) return false;
    // 1, or a shorter step before the first triangle degenerates
    double s = (std::min)({1.0, 0.9 * max_step(m_, x_, d), 0.9 * max_step(gaps_, d)});
    for (int i = 0; i < kMostTrials && !executor_.is_stopped(); ++i, s *= 0.6) {
      Points2 y = moved(m_, problem_.followers, x_, d, s);
      if (is_accepted(y, s * slope)) return x_.swap(y), true;
      collided = collided || collides(m_, y);
      if (collided && !keeps_gaps_) return false;
    }
    return false;
  }

  bool is_accepted(const Points2& y, double promised) {
    if (!is_injective(m_, y)) return false;
    const double energy = value(y);
    if (!(energy + gap_energy(gaps_, y) <= energy_ + 1e-4 * promised)) return false;
    energy_ = energy;
    return true;
  }

  /// Gradient and Hessian, without the Hessians of springs and gaps.
  LinearSystem assemble() {
    constexpr double kEpsilon = 1e-6;  // holds rigid motions, which the energy leaves free
    terms_.resize(m_.n_faces);
    executor_.run_blocks(m_.n_faces, 256, [&](int begin, int end) {
      embedding_terms(problem_.surface, x_, begin, end, kEpsilon, 1, terms_);
    });
    QuadraticModel model = sum_terms(m_, terms_, executor_, [](int, RowWriter&) {});
    add_spring_gradient(problem_.springs, x_, model.gradient);
    return {std::move(model.H), {}, std::move(model.gradient)};
  }

  void add_springs_and_gaps(LinearSystem& system) const {
    Array<Block> blocks;
    add_springs(problem_.springs, blocks);
    add_gaps(gaps_, blocks);
    if (blocks.empty()) return;
    const BlockMatrix others = sum_of_blocks(m_.n_vertices, blocks, executor_);
    system.H = weighted_sum({{&system.H, 1}, {&others, 1}}, executor_);
  }

  const FlatProblem problem_;
  const HalfEdgeMesh& m_;
  const Executor& executor_;
  FixedCoordinates is_fixed_;
  Points2 x_;
  double energy_;
  int steps_ = 0;
  Array<FaceTerm> terms_;
  LdltFactor factor_;
  bool keeps_gaps_ = false;
  Array<Gap> gaps_;
};

// ---- one surface across all resolutions ----
//
// Purpose:    embeds the coarsest mesh and brings the vertices back, one by one.
// Source:     Tutte 1963; Hormann and Greiner 2000.
// Invariants: after every vertex that returns, all triangles are positive and the boundary simple.
// Fails:      where rounding leaves a vertex no room; grow() returns its id.

/// The vertices and faces present at one resolution, renumbered.
struct Level {
  Surface surface;
  Array<int> vertex;  // its vertices in the full mesh
  Array<int> place;   // and back, -1 for vertices that are absent
};

/// The same mesh with every edge length raised to a power t in [0, 1], scaled to a total area. From
/// t = 0, where all triangles have one shape, to t = 1 the triangle inequality holds: c ≤ a + b
/// implies c^t ≤ (a + b)^t ≤ a^t + b^t.
inline Surface softened(const Surface& s, double t, double total_area) {
  Surface soft = s;
  const auto length = [&](int h) { return root_power(s.edge_length(h), t); };
  set_rest_frames(
      [&](int f) { return rest_frame(length(3 * f), length(3 * f + 1), length(3 * f + 2)); }, soft);
  const double scale = total_area / soft.total_area;
  for (double& area : soft.area) area *= scale;
  for (Mat2& R_inverse : soft.rest_inverse) R_inverse = 1 / std::sqrt(scale) * R_inverse;
  soft.total_area = total_area;
  return soft;
}

/// Barycentric coordinates, of any sign, of the point closest to p in the plane of a triangle.
inline Vec3 weights_in_plane(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 normal = cross(b - a, c - a);
  return 1 / squared_norm(normal) *
         Vec3{dot(normal, cross(b - p, c - p)), dot(normal, cross(c - p, a - p)),
              dot(normal, cross(a - p, b - p))};
}

/// The square root of a symmetric positive definite matrix, by Cayley and Hamilton:
/// (S + √det S I) / √(tr S + 2 √det S).
inline Mat2 square_root(const Mat2& S) {
  const double root = std::sqrt(determinant(S));
  return 1 / std::sqrt(S(0, 0) + S(1, 1) + 2 * root) * (S + diagonal(root));
}

/// A surface with rest shapes S^(1/2) Q R, where S is the mean of J Jᵀ of x around the corners of a
/// triangle, and Q the nearest rotation. Its triangles are to be mapped as those around them are in
/// x. Where the energy is least, x is smooth, also under strain.
inline Surface smoothed_rest(Surface s, const Points2& x) {
  constexpr double kLeastArea = 0.1;  // of a triangle in x, else it keeps its shape there
  const HalfEdgeMesh& m = s.mesh;
  Array<Mat2> J(m.n_faces), sum(m.n_vertices);
  Array<double> area(m.n_vertices, 0);
  for (int f = 0; f < m.n_faces; ++f) {
    J[f] = triangle_jacobian(s, x, f);
    for (int k = 0; k < 3; ++k) {
      sum[m.corner(f, k)] += s.area[f] * (J[f] * transposed(J[f]));
      area[m.corner(f, k)] += s.area[f];
    }
  }
  for (int f = 0; f < m.n_faces; ++f) {
    Mat2 S;
    for (int k = 0; k < 3; ++k) S += 1 / (3 * area[m.corner(f, k)]) * sum[m.corner(f, k)];
    const Mat2 root = square_root(S), turn = inverse(root) * J[f];
    const Mat2 mean = root * rotation_to({turn(0, 0) + turn(1, 1), turn(1, 0) - turn(0, 1)});
    const bool is_usual = determinant(mean) > kLeastArea * determinant(J[f]);
    s.rest_inverse[f] = s.rest_inverse[f] * inverse(is_usual && is_finite(mean) ? mean : J[f]);
  }
  return s;
}

/// Clips a convex polygon by the half-plane left of p → q.
inline Array<Vec2> clip(const Array<Vec2>& polygon, Vec2 p, Vec2 q) {
  Array<Vec2> result;
  for (int i = 0; i < polygon.size(); ++i) {
    const Vec2 a = polygon[i], b = polygon[(i + 1) % polygon.size()];
    const double side_a = cross(q - p, a - p), side_b = cross(q - p, b - p);
    if (side_a >= 0) result.push_back(a);
    if ((side_a > 0 && side_b < 0) || (side_a < 0 && side_b > 0))
      result.push_back(a + side_a / (side_a - side_b) * (b - a));
  }
  return result;
}

/// A symmetric matrix with its eigenvalues raised to at least ε.
inline Mat2 raised(const Mat2& H, double epsilon) {
  const double mean = 0.5 * (H(0, 0) + H(1, 1));
  const double radius = norm(Vec2{0.5 * (H(0, 0) - H(1, 1)), H(0, 1)});
  if (mean - radius >= epsilon) return H;
  const double largest = (std::max)(mean + radius, epsilon);
  Mat2 axis;  // 1 and -1 along the eigenvectors
  if (radius > 0) axis = 1 / radius * (H + diagonal(-mean));
  return diagonal(0.5 * (largest + epsilon)) + 0.5 * (largest - epsilon) * axis;
}

// ---- pillows ----
//
// Purpose:    lays a closed surface into the plane without a boundary. The half-turns about the
//             corners of a square, the cones, and the translations that they make divide the plane
//             into copies of two such squares; sewn along their sides, they are a pillow.
// Method:     The surface is cut along a path through four vertices, the cones. One side of the
//             path stays, the other one is moved. So every corner of a triangle has a place, and
//             one of these motions takes the triangle across an edge to it. Tutte's embedding then
//             has one linear system [Aigerman and Lipman 2015]. Angles and lengths, and so all
//             energies, are the same in all copies.
// Invariants: positions and shifts are multiples of 2^-50 below 8, so motions do not round. All
//             triangles positive is enough for injectivity, see is_injective().
// Fails:      where there is no room for the path.

/// Returns the lengths of the shortest paths along edges from a vertex [Dijkstra 1959]. If given:
/// paths use free vertices only; `to` receives the last half-edge of each path.
inline Array<double> edge_distances(const Surface& s, int from,
                                    const Array<char>* is_free = nullptr,
                                    Array<int>* to = nullptr) {
  Array<double> distance(s.mesh.n_vertices, kInfinity);
  std::priority_queue<std::pair<double, int>> heap;  // minus the distance, vertex
  const auto reach = [&](int v, double d, int h) {
    if (d >= distance[v] || (is_free != nullptr && h >= 0 && !(*is_free)[v])) return;
    distance[v] = d;
    if (to != nullptr) (*to)[v] = h;
    heap.push({-d, v});
  };
  reach(from, 0, -1);
  while (!heap.empty()) {
    const auto [minus, at] = heap.top();
    heap.pop();
    const double so_far = distance[at];
    if (-minus > so_far) continue;
    s.mesh.for_each_outgoing(at, [&](int h) {
      reach(s.mesh.tip(h), so_far + s.edge_length(h), h);
      reach(s.mesh.tail[prev(h)], so_far + s.edge_length(prev(h)), s.mesh.twin[prev(h)]);
    });
  }
  return distance;
}

/// Returns the half-edges of the shortest path from u to v on a closed surface through free
/// vertices; empty if there is none.
inline Array<int> shortest_path(const Surface& s, int u, int v, Array<char> is_free) {
  Array<int> to(s.mesh.n_vertices, -1), path;
  is_free[v] = 1;
  edge_distances(s, u, &is_free, &to);
  for (int w = v; to[w] >= 0; w = s.mesh.tail[to[w]]) path.push_back(to[w]);
  std::reverse(path.begin(), path.end());
  return path;
}

inline std::array<Vec2, 4> pillow_corners(double side) {
  return {Vec2{0, 0}, Vec2{side, 0}, Vec2{side, side}, Vec2{0, side}};
}

/// Cuts a closed surface along a path through four vertices and lays it on a pillow: the left side
/// of the path stays, the right side is moved by g_1, g_2, g_3 between the cones; g_1 is the
/// half-turn about the first one, and g_(i+1) = g_i h_i with that about the next one, so that going
/// around a cone is a half-turn. False without such a path.
inline bool make_pillow(const std::array<int, 4>& cones, double side, Surface& s) {
  HalfEdgeMesh& m = s.mesh;
  const std::array<Vec2, 4> corner = pillow_corners(side);
  Array<char> is_free(m.n_vertices, 1);
  for (int v : cones) is_free[v] = 0;
  m.pillow = {Array<Motion>(m.tail.size()), std::vector<int>(cones.begin(), cones.end()), side};
  Motion g = half_turn(corner[0]);
  int before = -1;  // the half-edge to the tail of the next one
  for (std::size_t i = 0; i < 3; ++i) {
    const Array<int> path = shortest_path(s, cones[i], cones[i + 1], is_free);
    if (path.size() < 2) return m.pillow = Pillow(), false;
    for (int h : path) {
      for (int e = before < 0 ? h : m.twin[before]; e != h; e = m.turn(e)) m.pillow.place[e] = g;
      if (m.tail[h] == cones[i] && i > 0) g = g * half_turn(corner[i]);
      before = h;
      is_free[m.tail[h]] = 0;
    }
  }
  return true;
}

/// Puts every vertex that is not fixed at the mean of its neighbours [Tutte 1963], moved to its
/// plane on a pillow [Aigerman and Lipman 2015]. In an opening, one more vertex is joined to all
/// vertices around it; these are the last rows of x. False if rounding flips a triangle.
inline bool tutte(const HalfEdgeMesh& m, const Array<char>& is_fixed, const Executor& executor,
                  Points2& x) {
  const int n = rows_of(x);
  Array<Vec2> right(n);
  Array<Block> blocks;
  for (int u = 0; u < n; ++u)
    if (is_fixed[u]) right[u] = row2(x, u), blocks.push_back({u, u, diagonal(1)});
  const auto pull = [&](int u, int v, const Motion& g) {
    if (is_fixed[u]) return;
    blocks.push_back({u, u, diagonal(1)});
    right[u] += is_fixed[v] ? g * row2(x, v) : g.shift;
    if (!is_fixed[v] && u < v) blocks.push_back({u, v, diagonal(-g.sign)});
  };
  const auto join = [&](int u, int v, const Motion& g) { pull(u, v, g), pull(v, u, inverse(g)); };
  for (int h = 0; h < m.tail.size(); ++h) {
    if (m.twin[h] > h) continue;
    const Array<Motion>& place = m.pillow.place;
    join(m.tail[h], m.tip(h), place.empty() ? Motion() : inverse(place[h]) * place[next(h)]);
  }
  for (int i = 0; i < m.loops(); ++i)
    for (int k = m.loop[i]; k < m.loop[i + 1] && !is_fixed[m.n_vertices + i]; ++k)
      join(m.tail[m.boundary[k]], m.n_vertices + i, {});
  const BlockMatrix H = sum_of_blocks(n, blocks, executor);
  LdltFactor factor;
  ldlt_factorize({&H, nullptr, 0}, x, executor, factor);
  if (!factor.ok) return false;
  const Array<Vec2> solution = ldlt_solve(factor, right);
  for (int v = 0; v < n; ++v)
    if (!is_fixed[v]) set_row(x, v, usable(m, solution[v]));
  x.conservativeResize(m.n_vertices, 2);
  return is_injective(m, x);
}

inline bool orbifold_tutte(const HalfEdgeMesh& m, const Executor& executor, Points2& x) {
  const std::array<Vec2, 4> corner = pillow_corners(m.pillow.side);
  x = Points2::Zero(m.n_vertices, 2);
  Array<char> is_fixed(m.n_vertices, 0);
  for (int i = 0; i < 4; ++i) {
    set_row(x, m.pillow.cones[i], corner.data()[i]);
    is_fixed[m.pillow.cones[i]] = 1;
  }
  return tutte(m, is_fixed, executor, x);
}

class Hierarchy {
 public:
  // The number of vertices of the coarsest mesh; and of one that is a fan around two vertices, in
  // which Tutte's embedding shrinks by a factor per triangle.
  static constexpr int kBase = 50, kSmallBase = 10;
  static constexpr int kPillowBase = 200;  // leaves room for the paths between cones

  /// `base`: the number of vertices of the coarsest mesh. `outline`: the places of its boundary, or
  /// null. `outer`: a vertex of the loop around the surface, or -1.
  Hierarchy(const Surface& s, Side side, const Array<char>& is_protected, int base,
            const Outline* outline, int outer, const Executor& executor)
      : s_(s),
        side_(side),
        outer_(outer),
        border_(outline),
        executor_(executor),
        mesh_(s.mesh),
        x_(Points2::Zero(s.mesh.n_vertices, 2)) {
    collapses_ = Decimation(s, is_protected, outline, executor, mesh_).run(base);
    goal_ = active();
  }

  const Surface& surface() const { return s_; }
  Side side() const { return side_; }
  const char* name() const { return letter(side_); }
  int active() const { return s_.mesh.n_vertices - collapses_.size(); }
  bool has(int v) const { return mesh_.is_present(v); }
  bool is_full() const { return collapses_.empty(); }

  /// Embeds the coarsest mesh by Tutte's theorem: the boundary on the square or on a circle.
  bool embed_base() {
    const Level level = current();
    const HalfEdgeMesh& m = level.surface.mesh;
    const int outer = outer_loop_of(level), rows = m.n_vertices + m.loops();
    const double radius = std::sqrt(s_.total_area / kPi);
    Points2 x = Points2::Zero(rows, 2);
    Array<char> is_fixed(rows, 0);
    const int begin = m.loop[outer], edges = m.loop[outer + 1] - begin;
    for (int i = 0; i < edges; ++i) {
      const int u = m.tail[m.boundary[begin + i]];
      set_row(x, u,
              border_ != nullptr ? border_->point(level.vertex[u])
                                 : radius * on_circle(2 * kPi * i / edges));
      is_fixed[u] = 1;
    }
    is_fixed[m.n_vertices + outer] = 1;  // outside
    if (!tutte(m, is_fixed, executor_, x)) return false;
    set(level, x);
    return true;
  }

  /// Distortion of the current embedding; of an isometry: 2.
  double strain() const {
    const Level level = current();
    return embedding_energy(level.surface, positions(level), 0, level.surface.mesh.n_faces) /
           level.surface.total_area;
  }

  /// The loop of a level that becomes its outline.
  int outer_loop_of(const Level& level) const {
    const HalfEdgeMesh& m = level.surface.mesh;
    if (m.loops() <= 1) return 0;
    const Array<int> loop = boundary_loops(s_.mesh);
    const int outer = outer_loop(s_, outer_);
    int i = 0;
    while (loop[level.vertex[m.tail[m.boundary[m.loop[i]]]]] != outer) ++i;
    return i;
  }

  Level current() const {
    Level level;
    level.place.assign(s_.mesh.n_vertices, -1);
    for (int v = 0; v < s_.mesh.n_vertices; ++v) {
      if (!has(v)) continue;
      level.place[v] = level.vertex.size();
      level.vertex.push_back(v);
    }
    Points3 vertices(level.vertex.size(), 3);
    for (int i = 0; i < level.vertex.size(); ++i)
      set_row(vertices, i, row3(s_.vertices, level.vertex[i]));
    Array<int> corners;
    for (int f = 0; f < mesh_.face.size(); ++f)
      if (mesh_.alive[f])
        for (int v : mesh_.face[f]) corners.push_back(level.place[v]);
    level.surface = build_surface(build_half_edges(level.vertex.size(), triangles_from(corners)),
                                  vertices, true);
    if (are_alike()) level.surface = softened(level.surface, 0, s_.total_area);
    Pillow& pillow = level.surface.mesh.pillow;
    for (int h = 0; h < pillow_.place.size(); ++h)
      if (mesh_.alive[h / 3]) pillow.place.push_back(pillow_.place[h]);
    for (int v : pillow_.cones) pillow.cones.push_back(level.place[v]);
    pillow.side = pillow_.side;
    return level;
  }

  /// Puts the current surface on a pillow; false if there is no room for paths between the cones.
  bool embed_on_pillow(const std::array<int, 4>& cones, double side) {
    Level level = current();
    HalfEdgeMesh& m = level.surface.mesh;
    std::array<int, 4> here;
    for (std::size_t i = 0; i < 4; ++i) here[i] = level.place[cones[i]];
    Points2 x;
    if (!make_pillow(here, side, level.surface) || !orbifold_tutte(m, executor_, x)) return false;
    set_pillow(level, m.pillow);
    set(level, x);
    return true;
  }

  void set_pillow(const Level& level, const Pillow& pillow) {
    pillow_ = {Array<Motion>(3 * mesh_.face.size()), {}, pillow.side};
    for (int v : pillow.cones) pillow_.cones.push_back(level.vertex[v]);
    for (int h = 0, i = 0; h < pillow_.place.size(); ++h)
      if (mesh_.alive[h / 3]) pillow_.place[h] = pillow.place[i++];
  }

  /// The pillow of the full mesh.
  const Pillow& pillow() const { return pillow_; }

  Points2 positions(const Level& level) const {
    Points2 x(level.vertex.size(), 2);
    for (int i = 0; i < level.vertex.size(); ++i) set_row(x, i, row2(x_, level.vertex[i]));
    return x;
  }
  void set(const Level& level, const Points2& x) {
    for (int i = 0; i < level.vertex.size(); ++i) set_row(x_, level.vertex[i], row2(x, i));
    is_outline_known_ = false;
    is_stuck_ = false;
    active_at_set_ = active();
  }
  const Points2& positions() const { return x_; }
  /// Moves the plane, unless rounding would cost the injectivity of so thin an embedding.
  void move(const RigidMotion& motion) {
    const Level level = current();
    if (!is_injective(level.surface.mesh, transformed(positions(level), motion))) return;
    x_ = transformed(x_, motion);
    is_outline_known_ = false;
  }

  /// Frees the boundary, and gives triangles the shapes of the surface.
  void let_go() { border_ = nullptr; }

  /// Sets the number of vertices to grow to.
  void set_goal(int vertices) { goal_ = vertices; }
  /// True at the goal, or if a vertex has no room until all have moved; set() lets it try again.
  bool has_grown() const { return is_full() || active() >= goal_ || is_stuck_; }

  /// Brings vertices back until has_grown(), or the caller stops. Returns the id of a vertex
  /// without room although all have moved since one returned, or -1.
  int grow() {
    while (!has_grown() && !executor_.is_stopped()) {
      if (grow_by_one()) continue;
      if (active() == active_at_set_) return collapses_.back().u;
      is_stuck_ = true;
    }
    return -1;
  }

  /// Brings one vertex back; false if there is no room for it.
  bool grow_by_one() {
    const Collapse c = std::move(collapses_.back());
    collapses_.pop_back();
    if (!is_outline_known_) build_outline();
    local_metric_ = local_metric(c.changed.empty() ? mesh_.faces_of[c.v] : c.changed);
    mesh_.undo(c);
    place_corners(c);
    const bool has_room = place(c);
    if (mesh_.on_boundary(c.u)) update_outline(c.u);
    if (has_room) return true;
    collapses_.push_back(mesh_.collapse(c.u, c.v));
    is_outline_known_ = false;
    return false;
  }

 private:
  void build_outline() {
    outline_.reset(mesh_.boundary.size());
    for (int v : mesh_.boundary) update_edge(v);
    is_outline_known_ = true;
  }

  /// Updates the edges of the boundary at u.
  void update_outline(int u) {
    for (int v : {mesh_.boundary_prev[u], u}) update_edge(v);
  }

  /// Updates the edge of the boundary that begins at v, or removes it.
  void update_edge(int v) {
    const int i = mesh_.boundary_place[v];
    if (!mesh_.is_present(v)) return outline_.remove(i);
    const Vec2 p = row2(x_, v), q = row2(x_, mesh_.boundary_next[v]);
    outline_.change(i, lower(p, q), upper(p, q));
  }

  /// True if the segment between two vertices can be a boundary edge: it meets no other boundary
  /// edge, except its neighbours in their common vertices.
  bool edge_fits(int from, int to) const {
    const Vec2 p = row2(x_, from), q = row2(x_, to), least = lower(p, q), most = upper(p, q);
    const auto is_in_the_way = [&](int i) {
      const int w = mesh_.boundary[i], z = mesh_.boundary_next[w];
      if (w == from) return false;
      const Vec2 s = row2(x_, w), t = row2(x_, z);
      if (w == to && z == from) return true;
      return w == to     ? turns_back(p, s, t)
             : z == from ? turns_back(s, t, q)
                         : segments_touch(p, q, s, t);
    };
    return !outline_.find([&](Vec2 lo, Vec2 hi) { return boxes_meet(least, most, lo, hi); },
                          is_in_the_way);
  }

  /// An edge p → q opposite a vertex u, and its ends as seen from u in the plane.
  struct Opposite {
    int p, q;
    Vec2 at_p, at_q;
  };
  Opposite opposite(int f, int u) const {
    const std::array<int, 3>& t = mesh_.face[f];
    const int k = corner_at(f, u), i = (k + 1) % 3, j = (k + 2) % 3;
    const int p = t.data()[i], q = t.data()[j];
    if (pillow_.is_empty()) return {p, q, row2(x_, p), row2(x_, q)};
    const Motion from_face = inverse(pillow_.place[3 * f + k]);
    return {p, q, from_face * (pillow_.place[3 * f + i] * row2(x_, p)),
            from_face * (pillow_.place[3 * f + j] * row2(x_, q))};
  }
  int corner_at(int f, int v) const {
    const std::array<int, 3>& t = mesh_.face[f];
    return t[0] == v ? 0 : t[1] == v ? 1 : 2;
  }

  /// Places the corners of the triangles that u comes back to. u takes the place of v; a cone has
  /// two places in each triangle, which are found from triangle to triangle.
  void place_corners(const Collapse& c) {
    if (pillow_.is_empty()) return;
    Array<int> known(1, c.changed[0]), left;
    for (int f : c.changed)
      if (f != c.changed[0]) (pillow_.is_cone(c.v) ? left : known).push_back(f);
    while (!left.empty()) {
      int i = 0;
      while (!continue_plane(c.u, known, left[i])) ++i;  // the triangles around u are a fan
      known.push_back(left[i]);
      std::swap(left[i], left.back());
      left.pop_back();
    }
    for (int f : c.dead)
      for (int g : known)
        for (int w : mesh_.face[g]) {
          if (w == c.u || !mesh_.has(f, w)) continue;
          place_at(f, c.u) = place_at(f, c.v) = place_at(g, c.u);
          place_at(f, w) = place_at(g, w);
        }
  }

  bool continue_plane(int u, const Array<int>& known, int f) {
    for (int g : known)
      for (int w : mesh_.face[g]) {
        if (w == u || !mesh_.has(f, w)) continue;
        place_at(f, u) = place_at(f, w) * inverse(place_at(g, w)) * place_at(g, u);
        return true;
      }
    return false;
  }

  Motion& place_at(int f, int v) { return pillow_.place[3 * f + corner_at(f, v)]; }

  bool are_alike() const { return border_ != nullptr; }
  Mat2 rest(int a, int b, int c) const {
    if (are_alike()) return rest_frame(1.0, 1.0, 1.0);
    return rest_frame(row3(s_.vertices, a), row3(s_.vertices, b), row3(s_.vertices, c));
  }

  /// Returns S^(-1/2) for the mean S of J Jᵀ over some faces: in this metric their images look
  /// nearly isometric, so a vertex that returns between them fits in, also under strain.
  Mat2 local_metric(const Array<int>& faces) const {
    Mat2 S;
    double total = 0;
    for (int f : faces) {
      const std::array<int, 3>& t = mesh_.face[f];
      const Mat2 R = rest(t[0], t[1], t[2]);
      const Opposite edge = opposite(f, t[0]);
      const Mat2 J = jacobian(row2(x_, t[0]), edge.at_p, edge.at_q, inverse(R));
      const double area = 0.5 * determinant(R);
      S += area * (J * transposed(J));
      total += area;
    }
    const Mat2 metric = inverse(square_root(1 / total * S));
    return is_finite(metric) ? metric : diagonal(1);
  }

  /// Puts u where the map of its triangles takes it, else into the kernel of its ring. The
  /// neighbour v it was merged with sees the whole ring, so points between v and the centre of the
  /// kernel are in the kernel, too. If other parts of the boundary are in the way of a boundary
  /// vertex, u goes inside of the edge it splits, or, with only one triangle, close to the middle
  /// of that edge.
  bool place(const Collapse& c) {
    const Vec2 corner = row2(x_, c.v);
    if (!c.changed.empty()) {
      put(c.u, place_by_map(c));
      if (fits(c.u)) return relax(c.u), true;
    }
    if (place_on_ray(c.u, corner, kernel_center(c.u))) return true;
    if (!mesh_.on_boundary(c.u)) return false;
    if (!c.changed.empty()) return place_on_ray(c.u, corner, fan_center(c));
    const Vec2 p = row2(x_, mesh_.boundary_prev[c.u]), q = row2(x_, mesh_.boundary_next[c.u]);
    const Vec2 middle = 0.5 * (p + q);
    return place_on_ray(c.u, middle, middle + 0.5 * perp(q - p));
  }

  /// Places a vertex; on a pillow, positions are multiples of 2^-50.
  void put(int u, Vec2 p) { set_row(x_, u, pillow_.is_empty() ? p : usable(p)); }
  Vec2 usable(Vec2 p) const {
    return pillow_.is_empty() ? flush_tiny(p) : on_grid(p, pillow_.side);
  }

  Vec2 place_by_map(const Collapse& c) const {
    Vec2 sum;
    const auto point = [this](int v) { return row3(s_.vertices, v); };
    for (int f : c.changed) {
      const Opposite edge = opposite(f, c.u);
      const Vec3 w = weights_in_plane(point(c.u), point(c.v), point(edge.p), point(edge.q));
      sum += w.x * row2(x_, c.v) + w.y * edge.at_p + w.z * edge.at_q;
    }
    return 1.0 / c.changed.size() * sum;
  }

  /// Puts u at the first of from + t (to - from) that fits, t = 1, 1/2, 1/4, ...
  bool place_on_ray(int u, Vec2 from, Vec2 to) {
    constexpr int kMostHalvings = 44;  // after these, there is no room
    double t = 1;
    for (int i = 0; i < kMostHalvings; ++i, t *= 0.5) {
      put(u, from + t * (to - from));
      if (fits(u)) return relax(u), true;
    }
    return false;
  }

  /// The centre of the largest triangle that v had in the place of u.
  Vec2 fan_center(const Collapse& c) const {
    const Vec2 corner = row2(x_, c.v);
    double largest = -kInfinity;
    Vec2 center = corner;
    for (int f : c.changed) {
      const Opposite edge = opposite(f, c.u);
      const Vec2 p = edge.at_p, q = edge.at_q;
      const double area = cross(p - corner, q - corner);
      if (area <= largest) continue;
      largest = area;
      center = 1.0 / 3 * (corner + p + q);
    }
    return center;
  }

  Vec2 kernel_center(int u) const {
    Vec2 lo = {kInfinity, kInfinity}, hi = -lo;
    for (int f : mesh_.faces_of[u]) {
      const Opposite edge = opposite(f, u);
      for (Vec2 w : {edge.at_p, edge.at_q}) {
        lo = lower(lo, w);
        hi = upper(hi, w);
      }
    }
    const double extent = (std::max)(hi.x - lo.x, hi.y - lo.y);
    const double margin = mesh_.on_boundary(u) ? 0.5 * extent : 0;
    lo -= {margin, margin}, hi += {margin, margin};
    Array<Vec2> kernel;
    for (const Vec2 corner : {lo, Vec2{hi.x, lo.y}, hi, Vec2{lo.x, hi.y}}) kernel.push_back(corner);
    for (int f : mesh_.faces_of[u]) {
      const Opposite edge = opposite(f, u);
      const Array<Vec2> rest = clip(kernel, edge.at_p, edge.at_q);
      if (rest.size() >= 3) kernel = rest;  // else rounding: keep the kernel
    }
    Vec2 center;
    for (Vec2 p : kernel) center += 1.0 / kernel.size() * p;
    return center;
  }

  /// True if all triangles of u are positive and the boundary stays simple.
  bool fits(int u) {
    const Vec2 p = row2(x_, u);
    if (p != usable(p)) return false;
    for (int f : mesh_.faces_of[u]) {
      const Opposite edge = opposite(f, u);
      if (!(orient2d(p, edge.at_p, edge.at_q) > 0)) return false;
    }
    if (!mesh_.on_boundary(u)) return true;
    update_outline(u);
    return edge_fits(mesh_.boundary_prev[u], u) && edge_fits(u, mesh_.boundary_next[u]);
  }

  /// The symmetric Dirichlet energy of the triangles of u, in the metric around it.
  struct RingEnergy {
    double value = 0;
    Vec2 gradient;
    Mat2 hessian;
  };

  RingEnergy ring_energy(int u) const {
    RingEnergy sum;
    for (int f : mesh_.faces_of[u]) {
      const Opposite edge = opposite(f, u);
      const Vec2 p = local_metric_ * row2(x_, u);
      const Vec2 q = local_metric_ * edge.at_p, r = local_metric_ * edge.at_q;
      const Mat2 R = rest(u, edge.p, edge.q), R_inverse = inverse(R);
      TriangleElement<double> t = {
          {p.x, p.y, q.x, q.y, r.x, r.y}, {}, 0.5 * determinant(R), {}, {}};
      std::copy(R_inverse.entry, R_inverse.entry + 4, t.rest_inverse);
      differentiate(t);
      const Mat2 H = {{t.hessian(0, 0), t.hessian(1, 0), t.hessian(1, 0), t.hessian(1, 1)}};
      sum.value += triangle_energy(jacobian(p, q, r, R_inverse), t.area);
      sum.gradient += local_metric_ * Vec2{t.gradient[0], t.gradient[1]};
      sum.hessian += local_metric_ * H * local_metric_;
    }
    return sum;
  }

  /// A few Newton steps of u alone.
  void relax(int u) {
    constexpr int kSteps = 6, kMostTrials = 12;
    RingEnergy energy = ring_energy(u);
    for (int i = 0; i < kSteps; ++i) {
      const double least = 1e-6 * std::sqrt(squared_norm(energy.hessian));
      const Vec2 d = -(inverse(raised(energy.hessian, least)) * energy.gradient);
      const Vec2 from = row2(x_, u);
      if (!std::isfinite(d.x) || !std::isfinite(d.y)) return;
      bool gained = false;
      double s = 1;
      for (int k = 0; k < kMostTrials && !gained; ++k, s *= 0.5) {
        put(u, from + s * d);
        if (!fits(u)) continue;
        const RingEnergy there = ring_energy(u);
        gained = there.value < energy.value;
        if (gained) energy = there;
      }
      if (!gained) return set_row(x_, u, from);
    }
  }

  const Surface& s_;
  const Side side_;
  const int outer_;
  const Outline* border_;  // where the boundary is held, or null
  const Executor& executor_;
  DynamicMesh mesh_;
  Points2 x_;
  BoxTree outline_;  // of x_: the edges of the boundary, by the place of their first vertex
  bool is_outline_known_ = false;
  Array<Collapse> collapses_;
  Pillow pillow_;  // dead faces have places, too
  int goal_ = 0, active_at_set_ = 0;
  bool is_stuck_ = false;
  Mat2 local_metric_ = diagonal(1);  // around the next vertex
};

// ---- both boundaries on one square ----
//
// Purpose:    places the boundary vertices of A and B if boundaries are held (§7).
// Invariants: corresponding places get the same place on the square; four pairs of vertices are its
//             corners; no inner edge lies in a side.
// Fails:      never; vertices are added in the middle of edges where a mesh has none for a corner.

struct OutlinePair {
  Outline a, b;
};

/// x modulo 1, in [0, 1).
inline double fraction(double x) {
  const double r = x - std::floor(x);
  return r < 1 ? r : 0;
}

/// Returns the arc length of every boundary vertex along its loop, from a first one on if there is
/// one, in units of the whole; -1 for others.
inline Array<double> boundary_arcs(const Surface& s, int first) {
  const HalfEdgeMesh& m = s.mesh;
  Array<double> arc(m.n_vertices, -1);
  for (int i = 0; i < m.loops(); ++i) {
    const bool has_passed = arc[first] >= 0;
    double sum = 0;
    for (int k = m.loop[i]; k < m.loop[i + 1]; ++k) {
      arc[m.tail[m.boundary[k]]] = sum;
      sum += s.edge_length(m.boundary[k]);
    }
    const double offset = has_passed || arc[first] < 0 ? 0 : arc[first];
    for (int k = m.loop[i]; k < m.loop[i + 1]; ++k) {
      double& a = arc[m.tail[m.boundary[k]]];
      a = fraction((a - offset) / sum);
    }
  }
  return arc;
}

inline int first_on_boundary(const HalfEdgeMesh& m) { return m.tail[m.boundary[0]]; }

/// The landmarks with both vertices on the boundaries, sorted along that of A.
inline Array<VertexPair> boundary_landmarks(const SurfacePair& pair,
                                            const Array<PlacedLandmark>& landmarks) {
  const Array<double> arc = boundary_arcs(pair.a, first_on_boundary(pair.a.mesh));
  Array<VertexPair> found;
  for (const VertexPair& l : vertex_pairs(landmarks))
    if (pair.a.mesh.on_boundary(l.a) && pair.b.mesh.on_boundary(l.b)) found.push_back(l);
  std::stable_sort(found.begin(), found.end(),
                   [&](const VertexPair& l, const VertexPair& r) { return arc[l.a] < arc[r.a]; });
  return found;
}

inline ElementId element_id(Side side, const LandmarkPoint& p) {
  return {side, is_point(p) ? Element::kFace : Element::kVertex, id_of(p)};
}
inline std::vector<ElementId> ids_of(const Landmark& l) {
  return {element_id(Side::kA, l.a), element_id(Side::kB, l.b)};
}

/// " 3-5 7-9", and their vertices or triangles.
inline std::string names_of(const Array<VertexPair>& landmarks, std::vector<ElementId>& ids) {
  std::string names;
  for (const VertexPair& l : landmarks) {
    names += sentence({" ", name_of(l.given.a), "-", name_of(l.given.b)});
    for (const ElementId& id : ids_of(l.given)) ids.push_back(id);
  }
  return names;
}

/// True if some landmarks, sorted along a loop of A, follow each other in this order on one of B.
inline bool check_order(const Array<VertexPair>& sorted, const Array<double>& arc_a,
                        const Array<double>& arc_b, Outcome& outcome) {
  constexpr double kLeastGap = 1e-12;  // of the length; in between, there is room for vertices
  std::vector<ElementId> ids;
  double around = 0;
  for (int i = 0; i < sorted.size(); ++i) {
    const VertexPair &l = sorted[i], &next = sorted[(i + 1) % sorted.size()];
    const double gap_a = fraction(arc_a[next.a] - arc_a[l.a]);
    const double gap_b = fraction(arc_b[next.b] - arc_b[l.b]);
    around += gap_b;
    if (sorted.size() == 1 || (std::min)(gap_a, gap_b) > kLeastGap) continue;
    Array<VertexPair> both(1, l);
    both.push_back(next);
    const std::string names = names_of(both, ids);
    return fail(outcome, Status::kInvalidLandmarks,
                {"landmarks on the boundaries are too close to each other:", names}, ids);
  }
  if (around < 1.5) return true;
  const std::string names = names_of(sorted, ids);
  return fail(outcome, Status::kInvalidLandmarks,
              {"the landmarks on the boundaries are in different order on A and B:", names,
               "; is one mesh mirrored?"},
              ids);
}

/// True if the landmarks on the boundaries follow each other in the same order on A and on B,
/// wherever they are on one loop of either.
inline bool check_order(const SurfacePair& pair, const Array<PlacedLandmark>& landmarks,
                        Outcome& outcome) {
  if (pair.a.mesh.boundary.empty() || pair.b.mesh.boundary.empty()) return true;
  Array<VertexPair> left = boundary_landmarks(pair, landmarks);
  const Array<double> arc_a = boundary_arcs(pair.a, first_on_boundary(pair.a.mesh));
  const Array<double> arc_b = boundary_arcs(pair.b, first_on_boundary(pair.b.mesh));
  const Array<int> loop_a = boundary_loops(pair.a.mesh), loop_b = boundary_loops(pair.b.mesh);
  while (!left.empty()) {
    Array<VertexPair> here, elsewhere;
    for (const VertexPair& l : left) {
      const bool is_here = loop_a[l.a] == loop_a[left[0].a] && loop_b[l.b] == loop_b[left[0].b];
      (is_here ? here : elsewhere).push_back(l);
    }
    if (!check_order(here, arc_a, arc_b, outcome)) return false;
    left.swap(elsewhere);
  }
  return true;
}

/// A place on the boundary of A and one on that of B that correspond, in arc length.
struct Match {
  double a, b;
  bool operator<(const Match& o) const { return a < o.a; }
};

/// The arc on B that corresponds to one on A: in proportion between the matches around it, which
/// are sorted.
inline double matching_arc(const Array<Match>& matches, double a) {
  const Match* const above = std::upper_bound(matches.begin(), matches.end(), Match{a, 0});
  const Match& from = above > matches.begin() ? above[-1] : matches.back();
  const Match& to = above < matches.end() ? *above : matches[0];
  const double gap_a = fraction(to.a - from.a), gap_b = fraction(to.b - from.b);
  const double t = fraction(a - from.a) / (gap_a > 0 ? gap_a : 1);
  return fraction(from.b + t * (gap_b > 0 ? gap_b : 1));
}

/// Lays both boundaries along one square: finds corresponding points, chooses four pairs of
/// vertices as corners, and adds missing vertices.
class OutlineBuilder {
 public:
  OutlineBuilder(SurfacePair& pair, const Array<PlacedLandmark>& landmarks)
      : pair_(pair),
        landmarks_(boundary_landmarks(pair, landmarks)),
        first_a_(first_on_boundary(pair.a.mesh)),
        first_b_(first_on_boundary(pair.b.mesh)) {
    measure();
  }

  /// True if landmarks define the correspondence of the boundaries.
  bool has_landmarks() const { return !landmarks_.empty(); }

  /// Without landmarks: the correspondence by arc length that brings the boundaries of two
  /// embeddings closest to each other.
  void match_closest(const Points2& f, const Points2& g) {
    const Points2 on_a = sample(pair_.a.mesh, arc_a_, first_a_, f, 0);
    double shift = 0, least = kInfinity;
    const auto consider = [&](double candidate) {
      const Points2 on_b = sample(pair_.b.mesh, arc_b_, first_b_, g, candidate);
      double sum = 0;
      for (int i = 0; i < kSamples; ++i) sum += squared_norm(row2(on_a, i) - row2(on_b, i));
      if (sum < least) least = sum, shift = candidate;
    };
    for (int k = 0; k < kSamples; ++k) consider(k / double{kSamples});
    for (double step = 0.5 / kSamples; step > 1e-6; step *= 0.5)
      for (const double candidate : {shift - step, shift + step}) consider(candidate);
    matches_.assign(1, {0, fraction(shift)});
  }

  OutlinePair build() {
    OutlinePair outlines;
    outlines.a.half_side = outlines.b.half_side =
        0.5 * std::sqrt(0.5 * (pair_.a.total_area + pair_.b.total_area));
    for (int k = 0; k < 4; ++k) {
      VertexPair corner;
      while (!find_corner(k, corner)) measure();
      outlines.a.corner[k] = corner.a;
      outlines.b.corner[k] = corner.b;
    }
    place(outlines.a, outlines.b);
    split_chords(outlines.a, pair_.a);
    split_chords(outlines.b, pair_.b);
    return outlines;
  }

 private:
  void measure() {
    arc_a_ = boundary_arcs(pair_.a, first_a_);
    arc_b_ = boundary_arcs(pair_.b, first_b_);
    if (!has_landmarks()) return;
    matches_.clear();
    for (const VertexPair& l : landmarks_) matches_.push_back({arc_a_[l.a], arc_b_[l.b]});
  }

  static constexpr int kSamples = 256;

  /// Points at equal distances along a boundary, in the plane, from a place on.
  static Points2 sample(const HalfEdgeMesh& m, const Array<double>& arc, int first,
                        const Points2& x, double from) {
    Points2 points(kSamples, 2);
    int h = m.out[first];
    const auto end = [&] { return arc[m.tip(h)] > 0 ? arc[m.tip(h)] : 1.0; };
    for (int i = 0; i < kSamples; ++i) {
      const double at = fraction(from + i / double{kSamples});
      if (at < arc[m.tail[h]]) h = m.out[first];
      while (end() <= at) h = m.out[m.tip(h)];
      const double t = (at - arc[m.tail[h]]) / (end() - arc[m.tail[h]]);
      set_row(points, i, (1 - t) * row2(x, m.tail[h]) + t * row2(x, m.tip(h)));
    }
    return points;
  }

  /// A boundary vertex and its arc, relative to that of a corner.
  struct Candidate {
    double offset;
    int vertex;
  };

  /// Arcs of the boundary vertices of A in terms of B.
  Array<double> arcs_of_a() const {
    Array<double> arcs = arc_a_;
    for (int h : pair_.a.mesh.boundary) {
      double& arc = arcs[pair_.a.mesh.tail[h]];
      arc = matching_arc(matches_, arc);
    }
    return arcs;
  }

  /// The boundary vertices in the quarter of the boundary around a place.
  static Array<Candidate> around(const HalfEdgeMesh& m, double center, const Array<double>& arc) {
    Array<Candidate> candidates;
    for (int h : m.boundary) {
      const double offset = fraction(arc[m.tail[h]] - center + 0.5) - 0.5;
      if (std::abs(offset) < 0.125) candidates.push_back({offset, m.tail[h]});
    }
    return candidates;
  }

  /// The middle of the edge of a boundary on which a place lies.
  static AddedVertex edge_at(const HalfEdgeMesh& m, double center, const Array<double>& arc) {
    int best = m.boundary[0];
    for (int h : m.boundary)
      if (fraction(center - arc[m.tail[h]]) < fraction(center - arc[m.tail[best]])) best = h;
    return {m.tail[best], m.tip(best)};
  }

  /// Finds the pair of vertices for corner k: a landmark if there is one in its quarter, else two
  /// that match best. False if a mesh had no vertex there and got one.
  bool find_corner(int k, VertexPair& corner) {
    const double center = matches_[0].b + k / 4.0;
    const Array<double> arcs_a = arcs_of_a();
    const Array<Candidate> a = around(pair_.a.mesh, center, arcs_a);
    const Array<Candidate> b = around(pair_.b.mesh, center, arc_b_);
    if (a.empty()) add_vertices({edge_at(pair_.a.mesh, center, arcs_a)}, pair_.a);
    if (b.empty()) add_vertices({edge_at(pair_.b.mesh, center, arc_b_)}, pair_.b);
    if (a.empty() || b.empty()) return false;
    constexpr double kCentred = 0.01;  // weight of the distance from the ideal place
    double least = kInfinity;
    const auto consider = [&](double cost, int v, int w) {
      if (cost < least) least = cost, corner = {v, w};
    };
    for (const Candidate& c : a)
      for (const VertexPair& l : landmarks_)
        if (l.a == c.vertex) consider(std::abs(c.offset), l.a, l.b);
    if (least < kInfinity) return true;
    for (const Candidate& c : a)
      for (const Candidate& d : b)
        consider(std::abs(c.offset - d.offset) + kCentred * std::abs(d.offset), c.vertex, d.vertex);
    return true;
  }

  /// Places all boundary vertices: those of B by arc length between the corners, those of A where
  /// their matches are.
  void place(Outline& a, Outline& b) {
    if (!has_landmarks()) matches_.clear();
    for (int k = 0; k < 4; ++k) matches_.push_back({arc_a_[a.corner[k]], arc_b_[b.corner[k]]});
    std::sort(matches_.begin(), matches_.end());
    const auto u_of = [&](double arc) {
      int k = 0;
      for (int i = 1; i < 4; ++i)
        if (fraction(arc - arc_b_[b.corner[i]]) < fraction(arc - arc_b_[b.corner[k]])) k = i;
      const double from = arc_b_[b.corner[k]], to = arc_b_[b.corner[(k + 1) % 4]];
      return k + fraction(arc - from) / fraction(to - from);
    };
    const auto place_all = [&](const HalfEdgeMesh& m, const Array<double>& arcs, Outline& outline) {
      outline.u.assign(m.n_vertices, -1);
      for (int h : m.boundary) outline.u[m.tail[h]] = u_of(arcs[m.tail[h]]);
    };
    place_all(pair_.a.mesh, arcs_of_a(), a);
    place_all(pair_.b.mesh, arc_b_, b);
  }

  /// Halves all inner edges between boundary vertices of one side, which would lie in the outline.
  static void split_chords(Outline& outline, Surface& s) {
    std::vector<AddedVertex> chords;
    for (int h = 0; h < s.mesh.tail.size(); ++h) {
      if (s.mesh.twin[h] < h) continue;
      const int v = s.mesh.tail[h], w = s.mesh.tip(h);
      if (outline.share_side(v, w)) chords.push_back({v, w});
    }
    add_vertices(chords, s);
    outline.u.resize(s.mesh.n_vertices, -1);
  }

  SurfacePair& pair_;
  Array<VertexPair> landmarks_;  // with both vertices on the boundaries
  Array<Match> matches_;         // sorted along A
  Array<double> arc_a_, arc_b_;
  const int first_a_, first_b_;  // where arcs begin
};

// ---- both surfaces ----
//
// Purpose:    embeds a pair and brings the planes together, in steps that take some tenths of a
//             second at most for 10,000 vertices.
// Method:     each surface alone up to a coarse level, where the planes meet; then both, tied by
//             the landmarks, up to the full meshes. The level at which the planes meet decides the
//             isotopy class of the map around the landmarks; limbs that have unfolded freely decide
//             it better than limbs that are pulled while they unfold. On pillows they share a plane
//             from the start.
// Invariants: a step that the caller stops changes no visible result; the next call repeats or
//             continues it, so results do not depend on pauses.
// Fails:      with a status and a sentence.

inline constexpr double kStiffest = 1000.0;  // total weight of the landmark penalties
inline constexpr int kMostSteps = 30;        // Newton steps per level
inline constexpr int kMostSmoothing = 10;    // and once it is mapped
inline constexpr double kTolerance = 1e-3;   // relative decrease per step that ends a level
inline constexpr double kNextOmega = 1e-3;   // ω_L at the map of a coarser level

/// Returns the centre of a triangle, one of those most edges away from the boundary.
inline Vec2 inner_point(const HalfEdgeMesh& m, const Points2& x) {
  Array<int> boundary;
  for (int h : m.boundary) boundary.push_back(m.tail[h]);
  const Array<int> away = distances_in_edges(m, boundary);
  int most = -1;
  Vec2 center;
  for (int f = 0; f < m.n_faces; ++f) {
    const int u = m.corner(f, 0), v = m.corner(f, 1), w = m.corner(f, 2);
    if (away[u] + away[v] + away[w] <= most) continue;
    most = away[u] + away[v] + away[w];
    center = 1.0 / 3 * (row2(x, u) + row2(x, v) + row2(x, w));
  }
  return center;
}

/// The corner of the largest weight.
inline int nearest_corner(const Place& p) {
  const double* const w = p.weights.data();
  return p.corners[static_cast<int>(std::max_element(w, w + 3) - w)];
}

/// Returns a place after decimation: the mean of its remaining corners, with rows from `first` on.
/// False if there are none.
inline bool move_to_level(const Level& level, int first, Place& p) {
  bool is_whole = true;
  for (int k = 0; k < 3; ++k) {
    const bool is_there = p.corners[k] >= 0 && level.place[p.corners[k]] >= 0;
    is_whole = is_whole && (is_there || p.corners[k] < 0);
    p.corners[k] = is_there ? first + level.place[p.corners[k]] : -1;
    if (!is_there) p.weights[k] = 0;
  }
  const int heaviest = nearest_corner(p);
  if (!is_whole && !level.surface.mesh.pillow.is_empty() && heaviest >= 0)
    p = copy_of(heaviest);  // on a pillow, only the corners of a triangle have a mean
  return tidy(p);
}

/// Returns the new ids of the vertices that have one.
inline std::vector<int> kept(const std::vector<int>& vertices, const std::vector<int>& new_id) {
  std::vector<int> ids;
  for (int v : vertices)
    if (new_id.data()[v] >= 0) ids.push_back(new_id.data()[v]);
  return ids;
}

/// Mean distortion divided by coverage; infinite without an overlap.
inline double badness(const JointSurface& s, const Points2& positions) {
  Iterate x;
  x.x = positions;
  const DistortionMeasure measure = symmetric_dirichlet();
  evaluate(s, Weights{0, 1, 1, &measure}, x);
  const double coverage = x.area_a / s.area_a + x.area_b / s.area_b;
  const double value = x.map_energy / (x.area_a + x.area_b) / coverage;
  return value < kInfinity ? value : kInfinity;  // NaN, too
}

/// Decimation keeps no more landmarks than these; many may be noisy, or wrong.
inline constexpr int kMostLeading = 50;

inline bool is_closed(const Surface& s) { return s.mesh.boundary.empty(); }
inline bool are_closed(const SurfacePair& pair) { return is_closed(pair.a) && is_closed(pair.b); }

/// The side of the pillow of two surfaces, about as large as they are.
inline double side_of_pillow(const SurfacePair& pair) {
  const int exponent =
      std::ilogb(std::sqrt(2 * pair.a.total_area)) + std::ilogb(std::sqrt(2 * pair.b.total_area));
  return std::ldexp(kPillowSide, exponent / 2);
}

/// Returns at most `most` items, each the farthest one from those before it. `nearest`: per item,
/// its distance from the initial items; distance(i, j) is that between items.
template <class Distance>
Array<int> farthest_items(int most, Array<double> nearest, const Distance& distance) {
  Array<int> items;
  while (items.size() < most && !nearest.empty()) {
    const int i =
        static_cast<int>(std::max_element(nearest.begin(), nearest.end()) - nearest.begin());
    if (!(nearest[i] > 0)) break;
    items.push_back(i);
    for (int j = 0; j < nearest.size(); ++j) nearest[j] = (std::min)(nearest[j], distance(i, j));
  }
  return items;
}

/// Four pairs of vertices, the cones of two pillows; empty for surfaces with boundaries.
using Cones = Array<VertexPair>;

/// Returns the distances of pairs along edges, in roots of the area: the smaller one of both
/// surfaces minus the difference between them; 0 where an edge joins two pairs.
inline Array<Array<double>> distances_between(const SurfacePair& pair,
                                              const Array<VertexPair>& pairs) {
  const double unit_a = 1 / std::sqrt(pair.a.total_area), unit_b = 1 / std::sqrt(pair.b.total_area);
  Array<Array<double>> distances;
  for (const VertexPair& p : pairs) {
    const Array<double> from_a = edge_distances(pair.a, p.a), from_b = edge_distances(pair.b, p.b);
    Array<double> apart;
    for (const VertexPair& q : pairs) {
      const bool is_edge =
          find_edge(pair.a.mesh, p.a, q.a) >= 0 || find_edge(pair.b.mesh, p.b, q.b) >= 0;
      const double on_a = unit_a * from_a[q.a], on_b = unit_b * from_b[q.b];
      const double least = (std::min)(on_a, on_b) - std::abs(on_a - on_b);
      apart.push_back(is_edge ? 0 : (std::max)(least, 0.0));
    }
    distances.push_back(apart);
  }
  return distances;
}

/// Chooses four pairs that are far apart, in the order of the shortest path through them; each
/// `attempt` gives others. Empty if there are none.
inline Cones choose_cones(const Array<VertexPair>& pairs, const Array<Array<double>>& distances,
                          int attempt) {
  if (pairs.empty()) return {};
  Array<double> nearest(pairs.size(), (std::numeric_limits<double>::max)());
  nearest[attempt % pairs.size()] = kInfinity;  // it comes first
  const auto between = [&](int i, int j) { return distances[i][j]; };
  const Array<int> cones = farthest_items(4, nearest, between);
  if (cones.size() < 4) return {};
  std::array<std::size_t, 4> order = {0, 1, 2, 3}, best = order;
  double least = kInfinity;
  do {
    double length = 0;
    for (std::size_t i = 0; i < 3; ++i)
      length += between(cones.data()[order[i]], cones.data()[order[i + 1]]);
    if (length < least) least = length, best = order;
  } while (std::next_permutation(order.begin(), order.end()));
  Cones ordered;
  for (std::size_t i : best) ordered.push_back(pairs[cones.data()[i]]);
  return ordered;
}

/// The ends of a long surface, and beside each a vertex across from it, in the order of the path.
/// Along the surface, the sum of distances below falls from the end, and across the end it grows.
inline std::array<int, 4> find_ends(const Surface& s, double& length) {
  const auto farthest = [](const Array<double>& distance) {
    return static_cast<int>(std::max_element(distance.begin(), distance.end()) - distance.begin());
  };
  std::array<int, 4> ends = {};
  ends[2] = farthest(edge_distances(s, 0));
  for (std::size_t i = 1; i <= 2; ++i) {
    Array<double> distance = edge_distances(s, ends[3 - i]);
    ends[i] = farthest(distance);
    length = distance[ends[i]];
    for (int v = 0; v < distance.size(); ++v)
      distance[v] += v == ends[i] || find_edge(s.mesh, v, ends[i]) >= 0
                         ? -length
                         : 0.5 * norm(row3(s.vertices, v) - row3(s.vertices, ends[i]));
    ends[i == 1 ? 0 : 3] = farthest(distance);
  }
  return ends;
}

/// The length of a tube of ten diameters in roots of its area, that of √(length / perimeter).
inline constexpr double kLongTube = 1.8;

/// Chooses two pairs at either end of surfaces that are both long: on other pillows, the parts
/// beyond the cones shrink as exp(-length / radius). The given pairs decide which ends correspond;
/// the optimisation turns the surfaces about the axis.
inline Cones cones_at_ends(const SurfacePair& pair, const Array<VertexPair>& pairs) {
  double length_a = 0, length_b = 0;
  const std::array<int, 4> a = find_ends(pair.a, length_a), b = find_ends(pair.b, length_b);
  if (length_a < kLongTube * std::sqrt(pair.a.total_area) ||
      length_b < kLongTube * std::sqrt(pair.b.total_area))
    return {};
  double agreement = 0;
  const auto lean = [](const Surface& s, const std::array<int, 4>& ends, int v) {
    const Vec3 x = row3(s.vertices, v);
    return norm(x - row3(s.vertices, ends[1])) - norm(x - row3(s.vertices, ends[2]));
  };
  for (const VertexPair& p : pairs) agreement += lean(pair.a, a, p.a) * lean(pair.b, b, p.b);
  Cones cones;
  for (std::size_t i = 0; i < 4; ++i)
    cones.push_back({a.data()[i], b.data()[agreement < 0 ? 3 - i : i], {}});
  return cones;
}

/// Returns pairs of a vertex of A and the nearest one of B, both surfaces centred, spread over A.
inline Array<VertexPair> farthest_pairs(const SurfacePair& pair) {
  constexpr int kMost = 16;
  const auto centred = [](const Surface& s) {
    const int n = s.mesh.n_vertices;
    Vec3 sum;
    Array<Vec3> x;
    for (int v = 0; v < n; ++v) sum += row3(s.vertices, v);
    for (int v = 0; v < n; ++v)
      x.push_back(1 / std::sqrt(s.total_area) * (row3(s.vertices, v) - 1.0 / n * sum));
    return x;
  };
  const Array<Vec3> a = centred(pair.a), b = centred(pair.b);
  Array<VertexPair> pairs;
  const auto distance = [&](int v, int w) { return norm(a[v] - a[w]); };
  for (int v : farthest_items(kMost, Array<double>(a.size(), kInfinity), distance)) {
    VertexPair nearest = {v, 0, {}};
    for (int w = 0; w < b.size(); ++w)
      if (squared_norm(b[w] - a[v]) < squared_norm(b[nearest.b] - a[v])) nearest.b = w;
    pairs.push_back(nearest);
  }
  return pairs;
}

/// A map of both surfaces decimated, from which Algorithm 1 may go on.
struct MappedLevel {
  std::unique_ptr<Hierarchy> a, b;
  Points2 f, g;
  IterationLog log;  // the last iteration
  std::vector<Warning> warnings;
};

class PairEmbedder {
 public:
  /// `outlines`: null if boundaries are free. `mapped`: the coarsest level, or null.
  PairEmbedder(const SurfacePair& pair, const Array<PlacedLandmark>& landmarks,
               const RunOptions& options, const Executor& executor, const OutlinePair* outlines,
               const Cones& cones = {}, MappedLevel* mapped = nullptr)
      : pair_(pair),
        landmarks_(landmarks),
        options_(options),
        level_options_(options),
        executor_(executor),
        outlines_(outlines),
        is_held_(outlines != nullptr && !outlines->a.is_round),
        cones_(cones),
        coarsest_(mapped == nullptr ? options.coarsest
                                    : (std::max)(mapped->a->active(), mapped->b->active())),
        depth_((std::max)(mapped != nullptr ? 1 : 0,
                          outlines == nullptr && has_levels(options) ? depth_of(pair) : 0)),
        level_(depth_) {
    level_options_.max_iterations = 500;
    level_options_.fixed_a = level_options_.fixed_b = {};
    if (mapped != nullptr)
      plan_from(*mapped);
    else
      plan();
  }

  /// Exact landmarks are joined in planes of little strain, and held boundaries are laid out.
  static bool has_levels(const RunOptions& options) {
    return options.boundary == Boundary::kFree && !options.exact_landmarks &&
           options.max_iterations > 0 && options.coarsest > 0;
  }

  /// The last iteration on each level that was mapped, the coarsest first.
  const std::vector<IterationLog>& levels() const { return levels_; }
  const Hierarchy& hierarchy(Side side) const { return side == Side::kA ? *a_ : *b_; }

  /// The map so far, on the given meshes; false if there is none yet, or no room for a vertex.
  bool coarse_map(SurfacePair& pair, Embedding& result) const {
    if (levels_.empty() || levels_.front().iteration == 0) return false;
    Hierarchy a = *a_, b = *b_;
    if (optimizer_) give_back(optimizer_->positions(), a, b);
    for (Hierarchy* h : {&a, &b})
      while (!h->is_full())
        if (!h->grow_by_one()) return false;
    result.f = a.positions();
    result.g = b.positions();
    pair.a.mesh.pillow = a.pillow();
    pair.b.mesh.pillow = b.pillow();
    return true;
  }

  /// The next step; false after the last one. The result then has positions, or says why not.
  bool step(Embedding& result) {
    result_ = &result;
    if (next_ < steps_.size() && !steps_[next_]()) ++next_;
    if (result.status != Status::kDone) return next_ = steps_.size(), false;
    if (next_ < steps_.size()) return true;
    result.f = a_->positions();
    result.g = b_->positions();
    return false;
  }

 private:
  const Outline* outline(Side side) const {
    return outlines_ == nullptr ? nullptr : side == Side::kA ? &outlines_->a : &outlines_->b;
  }

  static constexpr int kTrial = 800;    // vertices at which rotations are tried
  static constexpr int kCoarse = 3200;  // and at which landmarks begin to pull
  static constexpr int kStages = 4;     // of unfolding, after the first one

  /// A step returns true if it is to be called again.
  using Step = std::function<bool()>;
  void add(Step step) { steps_.push_back(std::move(step)); }

  void plan() {
    add([this] { return decimate(pair_.a, Side::kA, a_); });
    add([this] { return decimate(pair_.b, Side::kB, b_); });
    if (outlines_ != nullptr)
      plan_to_meet_last();
    else
      plan_to_meet_early();
  }

  void plan_from(MappedLevel& mapped) {
    levels_.push_back(mapped.log);
    a_ = std::move(mapped.a), b_ = std::move(mapped.b);
    level_a_ = a_->current(), level_b_ = b_->current();
    a_->set(level_a_, mapped.f);
    b_->set(level_b_, mapped.g);
    begin_next_level();
    add([this] { return grow_by_levels(); });
  }

  void plan_to_meet_early() {
    if (depth_ > 0)
      add_embed_alone(vertices_of(pair_.a, depth_), vertices_of(pair_.b, depth_));
    else
      add_embed_alone(kTrial, kTrial);
    if (landmarks_.size() < 2 && cones_.empty()) add([this] { return align_by_trial(); });
    if (depth_ == 0) add_embed_alone(kCoarse, kCoarse);
    add_bring_together();
    add([this] { return grow_by_levels(); });
  }

  // ---- Algorithm 1 on coarse levels ----
  //
  // Vertices that return between mapped levels go where the map around them takes them: all move
  // together until the map is smooth, held by springs between points that lie on each other.

  /// Returns the number of coarse levels: the next finer one has 2 to 8 times as many vertices.
  int depth_of(const SurfacePair& pair) const {
    const double most = (std::max)(pair.a.mesh.n_vertices, pair.b.mesh.n_vertices);
    int depth = 0;
    for (double ratio = most / coarsest_; ratio >= 2; ratio /= 4) ++depth;
    return depth;
  }

  /// Returns the number of vertices of a level; level 0 is the finest, depth_ the coarsest.
  int vertices_of(const Surface& s, int level) const {
    const int n = s.mesh.n_vertices;
    if (level == 0 || n <= coarsest_) return n;
    const double ratio = n / static_cast<double>(coarsest_);
    return static_cast<int>(coarsest_ * root_power(ratio, 1 - level / static_cast<double>(depth_)));
  }

  /// Maps the level, if levels are mapped, then brings back the vertices of the next finer one.
  bool grow_by_levels() {
    if (optimizer_) return optimize_level();
    if (!a_->has_grown() || !b_->has_grown()) {
      is_relaxed_ = false;
      return grow(a_->has_grown() ? *b_ : *a_);
    }
    if (!is_relaxed_) {
      tell({"embedding both: ", a_->active(), " + ", b_->active(), " vertices"});
      is_relaxed_ = !(levels_.empty() ? relax_both(kStiffest) : smooth_both());
      return true;
    }
    if (a_->is_full() && b_->is_full()) return false;
    if (depth_ > 0) return begin_level(), true;
    a_->set_goal(2 * a_->active());
    b_->set_goal(2 * b_->active());
    return true;
  }

  /// Errors of the coarsest level stay; unfinished work of other levels is faster on the next one.
  void begin_level() {
    const bool is_coarsest = level_ == depth_;
    level_options_.tolerance = (std::max)(options_.tolerance, is_coarsest ? 1e-3 : 4e-3);
    level_options_.tuning.window = is_coarsest ? 20 : 10;
    const Points2 x = take_levels();
    joint_ = join({level_a_.surface, level_b_.surface});
    optimizer_ = std::make_unique<Optimizer>(joint_, level_options_, no_followers_, executor_);
    log_ = Result();
    std::vector<Curve> curves = options_.curves;
    for (Curve& c : curves) c.a = kept(c.a, level_a_.place), c.b = kept(c.b, level_b_.place);
    const LandmarkPull pull(joint_, landmarks_here(0), curves);
    if (!pull.is_empty()) optimizer_->set_pull(pull);
    optimizer_->start(x, log_);
    if (rules_.least_area_a > 0)
      optimizer_->keep_covered(rules_);
    else
      rules_ = optimizer_->rules();
    if (!levels_.empty()) optimizer_->lower_omega(kNextOmega);
    if (log_.status == Status::kUnfinished) levels_.push_back(log_.log_begin);
  }

  bool optimize_level() {
    const bool has_more = log_.status == Status::kUnfinished && optimizer_->iterate(log_);
    if (!levels_.empty()) levels_.back() = log_.final_state();
    tell({"optimising a coarse map, ", joint_.mesh.n_vertices, " vertices"});
    if (has_more || executor_.is_stopped()) return true;
    give_back(optimizer_->positions(), *a_, *b_);
    optimizer_.reset();
    begin_next_level();
    return true;
  }

  void begin_next_level() {
    tied_a_ = level_a_.vertex, tied_b_ = level_b_.vertex;
    --level_;
    a_->set_goal(vertices_of(pair_.a, level_));
    b_->set_goal(vertices_of(pair_.b, level_));
    is_relaxed_ = false;
  }

  /// Takes both surfaces at the current level; returns their positions.
  Points2 take_levels() {
    level_a_ = a_->current(), level_b_ = b_->current();
    return stacked(a_->positions(level_a_), b_->positions(level_b_));
  }

  void give_back(const Points2& x, Hierarchy& a, Hierarchy& b) const {
    const int n_a = level_a_.vertex.size();
    a.set(level_a_, rows_between(x, 0, n_a));
    b.set(level_b_, rows_between(x, n_a, rows_of(x)));
  }

  bool smooth_both() {
    return relax([this](FlatProblem& problem, const Points2& x) {
      const int n_a = level_a_.vertex.size();
      problem.springs = springs_to_map(join({level_a_.surface, level_b_.surface}), x);
      problem.surface = join({smoothed_rest(level_a_.surface, rows_between(x, 0, n_a)),
                              smoothed_rest(level_b_.surface, rows_between(x, n_a, rows_of(x)))});
    });
  }

  /// Springs between each vertex of the coarser level and its place on the other surface. A move by
  /// the length of an edge costs about as much as a strain of 1 of its triangles.
  Array<Spring> springs_to_map(const JointSurface& s, const Points2& x) const {
    constexpr double kStiffness = 3;
    Overlay overlay;
    compute_overlay(s, x, overlay);
    const Groups<int> by_face = group_polygons(overlay.polygons, s.mesh.n_faces);
    Array<Spring> springs;
    const auto tie = [&](int v) {
      Place on;
      std::array<Motion, 6> motion;
      if (find_image(s.mesh, x, overlay.polygons, by_face, copy_of(v), on, motion))
        add_springs(copy_of(v), on, diagonal(kStiffness), {}, motion, springs);
    };
    for (int v : tied_a_) tie(level_a_.place[v]);
    for (int v : tied_b_) tie(s.n_a + level_b_.place[v]);
    return springs;
  }

  void plan_to_meet_last() {
    add_embed_alone(pair_.a.mesh.n_vertices, pair_.b.mesh.n_vertices);
    for (int i = 0; i <= kStages; ++i) {
      add([this, i] { return unfold(*a_, i); });
      add([this, i] { return unfold(*b_, i); });
    }
    if (!is_held_ && landmarks_.size() < 2) add([this] { return align_by_trial(); });
    add_bring_together();
  }

  void add_embed_alone(int most_a, int most_b) {
    add([this, most_a] { return embed_alone(*a_, most_a); });
    add([this, most_b] { return embed_alone(*b_, most_b); });
  }

  /// Moves the plane of A rigidly, then lets the landmarks pull, harder and harder.
  void add_bring_together() {
    if (landmarks_.empty()) return add([this] { return relax_both(0); });
    if (landmarks_.size() >= 2 && !is_held_ && cones_.empty())
      add([this] { return align_by_landmarks(); });
    for (double weight = 1; weight <= kStiffest; weight *= 10)
      add([this, weight] { return relax_both(weight); });
  }

  bool fail(Words message, const std::vector<ElementId>& ids = {}) const {
    return detail::fail(*result_, Status::kNumericalFailure, message, ids);
  }

  bool decimate(const Surface& s, Side side, std::unique_ptr<Hierarchy>& h) const {
    tell({"decimating ", letter(side)});
    const bool are_many = landmarks_.size() > kMostLeading;
    Array<char> keep(s.mesh.n_vertices, 0);
    for (const PlacedLandmark& l : landmarks_)
      for (int v : (side == Side::kA ? l.a : l.b).corners)
        if (v >= 0 && (l.weight < 1 || options_.exact_landmarks || !are_many)) keep[v] = 1;
    std::array<int, 4> cones;
    for (int i = 0; i < cones_.size(); ++i) {
      const int v = cones.data()[i] = side == Side::kA ? cones_[i].a : cones_[i].b;
      keep[v] = Decimation::kCone;
    }
    const int n = s.mesh.n_vertices;
    std::vector<int> bases = {Hierarchy::kBase, Hierarchy::kSmallBase};
    if (!cones_.empty()) bases = {Hierarchy::kPillowBase, bases[0], bases[1], n};
    // On an outline, all vertices at once, unless limbs shrink too much.
    constexpr double kMostStrain = 1e6;
    if (outlines_ != nullptr) bases = {n, bases[0], bases[1], n};
    for (std::size_t i = 0; i < bases.size(); ++i) {
      const int outer = side == Side::kA ? options_.outer_a : options_.outer_b;
      h = std::make_unique<Hierarchy>(s, side, keep, bases[i], outline(side), outer, executor_);
      if (executor_.is_stopped()) return true;
      const bool is_embedded =
          cones_.empty() ? h->embed_base() : h->embed_on_pillow(cones, side_of_pillow(pair_));
      if (executor_.is_stopped()) return true;
      const bool is_first = outlines_ != nullptr && i == 0;
      if (is_embedded && (!is_first || h->strain() < kMostStrain)) return false;
    }
    return fail({"Tutte's embedding of the decimated mesh ", h->name(), " failed"});
  }

  /// The share of present vertices measures the progress of the embedding.
  void tell(Words what) const {
    const int n = pair_.a.mesh.n_vertices + pair_.b.mesh.n_vertices;
    const int active = (a_ ? a_->active() : 0) + (b_ ? b_->active() : 0);
    executor_.tell(true, a_ && b_ ? active / static_cast<double>(n) : 0, what, nullptr);
  }

  bool grow(Hierarchy& h) const {
    const int stuck = h.grow();
    if (stuck < 0) return true;
    const int given = h.surface().given_id(stuck);
    return fail({"mesh ", h.name(), ": there is no room for vertex ", given, " in the plane"},
                {vertex_id(h.side(), given)});
  }

  /// Embeds one surface alone up to a number of vertices: grows, or takes a step.
  bool embed_alone(Hierarchy& h, int target) {
    tell({"embedding ", h.name(), ": ", h.active(), " vertices"});
    if (!h.has_grown()) return grow(h);
    if (!newton_) {
      level_a_ = h.current();
      Points2 x = h.positions(level_a_);
      const Boundary boundary = outlines_ != nullptr ? Boundary::kFixed : Boundary::kFree;
      newton_ = std::make_unique<FlatNewton>(FlatProblem{level_a_.surface, boundary}, x, executor_);
    }
    if (newton_->minimize(kMostSteps, kTolerance)) return true;
    h.set(level_a_, newton_->positions());
    newton_.reset();
    if (h.is_full() || h.active() >= target) return false;
    h.set_goal((std::min)(2 * h.active(), target));
    return true;
  }

  /// Turns triangles from one shape to those of the surface; a boundary leaves its circle.
  bool unfold(Hierarchy& h, int stage) {
    tell({"unfolding ", h.name(), ": stage ", stage + 1, " of ", kStages + 1});
    h.let_go();
    const Surface& s = h.surface();
    if (!newton_)
      newton_ = std::make_unique<FlatNewton>(
          FlatProblem{stage < kStages ? softened(s, stage / double{kStages}, s.total_area) : s,
                      is_held_ ? Boundary::kFixed : Boundary::kFree},
          h.positions(), executor_);
    if (newton_->minimize(200, 1e-4)) return true;
    h.set(h.current(), newton_->positions());
    newton_.reset();
    return false;
  }

  /// The landmarks on the levels, the rows of B from `first_b` on; decimation may take some if
  /// there are many.
  Array<PlacedLandmark> landmarks_here(int first_b) const {
    Array<PlacedLandmark> present;
    for (PlacedLandmark l : landmarks_)
      if (move_to_level(level_a_, 0, l.a) && move_to_level(level_b_, first_b, l.b))
        present.push_back(l);
    return present;
  }

  void warn_if_mirrored(const Points2& from, const Points2& to) const {
    constexpr double kGood = 0.25, kWorse = 2.5, kClearly = 0.02;  // see misfit()
    Points2 mirrored = from;
    for (int i = 0; i < rows_of(mirrored); ++i) mirrored(i, 1) = -mirrored(i, 1);
    const double rest = misfit(mirrored, to);
    const double own = misfit(from, to);
    if (!(rows_of(from) >= 4 && rest < kGood && own > kWorse * rest + kClearly)) return;
    result_->warnings.push_back(
        {"the landmarks fit the mirror image of A better than A: were left and right exchanged on "
         "one mesh, or is one inside out?",
         {}});
  }

  bool align_by_landmarks() {
    const Points2 x = take_levels();
    const Array<PlacedLandmark> landmarks = landmarks_here(level_a_.vertex.size());
    if (landmarks.empty()) return false;
    Points2 from(landmarks.size(), 2), to(landmarks.size(), 2);
    for (int i = 0; i < landmarks.size(); ++i) {
      set_row(from, i, mean(landmarks[i].a, x));
      set_row(to, i, mean(landmarks[i].b, x));
    }
    int given = 0;
    while (given < landmarks.size() && landmarks[given].weight == 1) ++given;
    warn_if_mirrored(rows_between(from, 0, given), rows_between(to, 0, given));
    a_->move(rigid_motion(correlation(from, to), centroid(from), centroid(to)));
    return false;
  }

  /// Turns the plane of A about the landmark, or about its centre, to the least distortion of the
  /// map for its coverage.
  bool align_by_trial() {
    constexpr int kRotations = 24;
    const Points2 x = take_levels();
    const JointSurface s = join({level_a_.surface, level_b_.surface});
    const Points2 f = rows_between(x, 0, s.n_a), g = rows_between(x, s.n_a, rows_of(x));
    const Array<PlacedLandmark> landmarks = landmarks_here(s.n_a);
    const Vec2 from = landmarks.empty() ? centroid(f) : mean(landmarks[0].a, x);
    const Vec2 to = landmarks.empty() ? centroid(g) : mean(landmarks[0].b, x);
    RigidMotion best = rigid_motion({1, 0}, from, to);
    double least = kInfinity;
    for (int i = 0; i < kRotations && !executor_.is_stopped(); ++i) {
      const RigidMotion motion = rigid_motion(on_circle(2 * kPi * i / kRotations), from, to);
      const double value = badness(s, stacked(transformed(f, motion), g));
      if (value < least) least = value, best = motion;
    }
    if (!executor_.is_stopped()) a_->move(best);
    return executor_.is_stopped();
  }

  /// Minimises E_f + E_g + weight · mean squared landmark distance on the current levels: takes a
  /// step.
  bool relax_both(double weight) {
    return relax([this, weight](FlatProblem& problem, const Points2& x) {
      problem.surface = join({level_a_.surface, level_b_.surface});
      const Array<PlacedLandmark> landmarks = landmarks_here(level_a_.vertex.size());
      constexpr double kMostScale = 100;  // distances count as on the surface, within limits
      double total = 0;
      int given = 0;
      for (const PlacedLandmark& l : landmarks) total += l.weight, given += l.weight == 1;
      // At last, found pairs no longer pull, except a single landmark, about which planes turn.
      const bool are_released = depth_ == 0 && weight == kStiffest && given != 1;
      for (const PlacedLandmark& l : landmarks)
        if (l.weight == 1 || !are_released) {
          const double scale = std::sqrt(planar_scale(problem.surface, x, l.a) *
                                         planar_scale(problem.surface, x, l.b));
          add_springs(problem.surface.mesh, x, l.a, l.b,
                      diagonal(weight * l.weight / total * std::clamp(1 / scale, 1.0, kMostScale)),
                      problem.springs);
        }
    });
  }

  /// Takes a step on the current levels; state(problem, x) states the problem first.
  template <class State>
  bool relax(const State& state) {
    if (!newton_) {
      const Points2 x = take_levels();
      FlatProblem problem = {};
      problem.boundary = is_held_ ? options_.boundary : Boundary::kFree;
      state(problem, x);
      newton_ = std::make_unique<FlatNewton>(std::move(problem), x, executor_);
    }
    const bool is_last = depth_ == 0 && landmarks_.size() > 0 && landmarks_.back().weight < 1;
    const double tolerance = is_last ? 1e-2 * kTolerance : kTolerance;
    if (newton_->minimize(levels_.empty() ? kMostSteps : kMostSmoothing, tolerance)) return true;
    give_back(newton_->positions(), *a_, *b_);
    newton_.reset();
    return false;
  }

  const SurfacePair& pair_;
  const Array<PlacedLandmark> landmarks_;
  const RunOptions& options_;
  RunOptions level_options_;  // of Algorithm 1 on the levels
  const Executor& executor_;
  const OutlinePair* const outlines_;
  const bool is_held_;
  const Cones cones_;
  Embedding* result_ = nullptr;
  Array<Step> steps_;
  int next_ = 0;
  std::unique_ptr<Hierarchy> a_, b_;
  Level level_a_, level_b_;             // the levels to relax; of one surface alone, the first
  std::unique_ptr<FlatNewton> newton_;  // relaxes them
  bool is_relaxed_ = true;              // the level of grow_by_levels()
  const int coarsest_;                  // vertices of the coarsest level
  const int depth_;                     // how many coarse levels there are
  int level_;                           // the one the hierarchies are at, depth_ is the coarsest
  JointSurface joint_;                  // the level being mapped
  const Array<Follower> no_followers_ = {};
  std::unique_ptr<Optimizer> optimizer_;  // maps it
  Result log_;
  StepRules rules_{};           // of the coarsest level
  Array<int> tied_a_, tied_b_;  // its vertices
  std::vector<IterationLog> levels_;
};

// ---- exact landmarks ----
//
// Purpose:    makes the images of landmarks coincide in the plane.
// Method:     springs pull the landmarks harder and harder. A landmark of A jumps onto that of B as
//             soon as this flips no triangle; then both move as one. If some stay apart, it starts
//             anew with more vertices around those, then around all: in a finer mesh, a point costs
//             less energy to move, and edges can bend around other landmarks.
// Fails:      with the landmarks that are still apart after some refinements.

/// Hook: per triangle, why it is too thin to be mapped, or null (part [16]).
inline Array<const char*> triangle_defects(const Points3& vertices, const Triangles& triangles);

/// Adds vertices at exact landmarks, and at landmarks on held boundaries, to positions, too, if
/// there are any. False if a triangle becomes too thin, or their order is wrong.
inline bool add_landmark_vertices(const Array<PlacedLandmark>& landmarks, const RunOptions& options,
                                  SurfacePair& pair, Embedding& start) {
  std::vector<AddedVertex> a, b;
  for (const PlacedLandmark& l : landmarks) {
    const bool is_on_both = on_boundary(pair.a.mesh, l.a) && on_boundary(pair.b.mesh, l.b);
    if (!options.exact_landmarks && !is_on_both) continue;
    add_place(l.a, pair.a.mesh.n_vertices, a);
    add_place(l.b, pair.b.mesh.n_vertices, b);
  }
  if (!add_vertices(a, pair.a, &start.f) || !add_vertices(b, pair.b, &start.g))
    return fail(start, Status::kInvalidLandmarks,
                {"landmarks are too close to each other to become vertices"});
  for (Side side : {Side::kA, Side::kB}) {
    const Surface& s = side == Side::kA ? pair.a : pair.b;
    if (s.added.empty()) continue;
    const Array<const char*> defects = triangle_defects(s.vertices, triangles_from(s.mesh.tail));
    for (int f = 0; f < defects.size(); ++f)
      if (defects[f] != nullptr)
        return fail(start, Status::kInvalidLandmarks,
                    {"landmarks on ", letter(side),
                     " are too close to edges: once they are vertices, triangle ", f, defects[f]},
                    {{side, Element::kFace, f}});
  }
  return check_order(pair, located(landmarks, pair), start);
}

/// True if an injective embedding stays injective after a vertex was moved: the triangles around it
/// are positive, which is enough for an inner vertex, as the outline of its star has not changed;
/// for a boundary vertex, the boundary is simple, too.
inline bool is_injective_at(const HalfEdgeMesh& m, const Points2& x, int v) {
  bool is_positive = true;
  m.for_each_outgoing(v, [&](int h) {
    is_positive = is_positive &&
                  orient2d(place_of(m, x, h), place_of(m, x, next(h)), place_of(m, x, prev(h))) > 0;
  });
  return is_positive && !m.pillow.is_cone(v) && (!m.on_boundary(v) || boundaries_are_simple(m, x));
}

/// Lets landmarks of A jump that can.
inline void join_landmarks(const JointSurface& s, Points2& x, Array<VertexPair>& apart,
                           Array<VertexPair>& joined) {
  Array<VertexPair> left;
  for (const VertexPair& l : apart) {
    const Vec2 before = row2(x, l.a), on_b = row2(x, s.n_a + l.b);
    const Vec2 there = nearest_motion(s.mesh, before, on_b) * on_b;
    set_row(x, l.a, there);
    if (before == there || is_injective_at(s.mesh, x, l.a)) {
      joined.push_back(l);
    } else {
      set_row(x, l.a, before);
      left.push_back(l);
    }
  }
  apart = left;
}

class LandmarkJoiner {
 public:
  LandmarkJoiner(SurfacePair& pair, const Array<VertexPair>& landmarks, const RunOptions& options,
                 const Executor& executor)
      : pair_(pair), options_(options), executor_(executor), landmarks_(landmarks) {}

  /// The next step; false after the last one.
  bool step(Embedding& result) {
    constexpr int kMostRefinements = 6;
    if (!newton_ && weight_ == 0) begin(result);
    if (pull()) return true;
    weight_ = 0;
    if (!apart_.empty() && refinements_ < kMostRefinements)
      return refine(refinements_++ == 0 ? apart_ : landmarks_, result), true;
    result.f = rows_between(x_, 0, s_.n_a);
    result.g = rows_between(x_, s_.n_a, s_.mesh.n_vertices);
    if (apart_.empty()) return false;
    std::vector<ElementId> ids;
    const std::string names = names_of(apart_, ids);
    return fail(result, Status::kInvalidLandmarks, {"these landmarks could not be joined:", names},
                ids);
  }

 private:
  static constexpr double kSoftest = 10 * kStiffest, kHardest = 1e12;

  /// Begins a round: all are apart, and pulled harder and harder.
  void begin(const Embedding& result) {
    apart_ = landmarks_;
    joined_.clear();
    s_ = join(pair_);
    x_ = stacked(result.f, result.g);
    weight_ = kSoftest;
  }

  /// A Newton step; false at the end of the round.
  bool pull() {
    if (!newton_) {
      const bool is_last = weight_ > kHardest || apart_.empty();
      join_landmarks(s_, x_, apart_, joined_);
      if (is_last) return false;
      executor_.tell(true, 1, {"landmarks still apart: ", apart_.size()}, nullptr);
      FlatProblem problem = {s_, options_.boundary};
      for (const VertexPair& l : apart_)
        add_springs(s_.mesh, x_, copy_of(l.a), copy_of(s_.n_a + l.b),
                    diagonal(weight_ / landmarks_.size()), problem.springs);
      for (const VertexPair& l : joined_) problem.followers.push_back(landmark_follower(s_, x_, l));
      newton_ = std::make_unique<FlatNewton>(std::move(problem), x_, executor_);
    }
    if (newton_->minimize(kMostSteps, kTolerance)) return true;
    x_ = newton_->positions();
    newton_.reset();
    weight_ *= 10;
    return true;
  }

  void refine(const Array<VertexPair>& landmarks, Embedding& result) {
    Array<int> at_a, at_b;
    for (const VertexPair& l : landmarks) at_a.push_back(l.a), at_b.push_back(l.b);
    halve_edges_at(at_a, pair_.a, result.f);
    halve_edges_at(at_b, pair_.b, result.g);
  }

  /// Halves the inner edges of the triangles around some vertices, in the plane, too.
  static void halve_edges_at(const Array<int>& vertices, Surface& s, Points2& x) {
    Array<std::array<int, 2>> edges;
    for (int v : vertices)
      s.mesh.for_each_outgoing(v, [&](int spoke) {
        for (int h : {spoke, next(spoke), prev(spoke)})
          if (s.mesh.twin[h] >= 0)
            edges.push_back({(std::min)(s.mesh.tail[h], s.mesh.tip(h)),
                             (std::max)(s.mesh.tail[h], s.mesh.tip(h))});
      });
    sort_unique(edges);
    std::vector<AddedVertex> added;
    for (const std::array<int, 2>& edge : edges) added.emplace_back(edge[0], edge[1]);
    add_vertices(added, s, &x);
  }

  SurfacePair& pair_;
  const RunOptions& options_;
  const Executor& executor_;
  const Array<VertexPair> landmarks_;
  Array<VertexPair> apart_, joined_;
  JointSurface s_;
  Points2 x_;
  double weight_ = 0;  // of the pull; 0 before a round
  int refinements_ = 0;
  std::unique_ptr<FlatNewton> newton_;
};

// ---- which of them a call needs ----

/// E_f + E_g per area, infinite for a failure.
inline double strain(const SurfacePair& pair, const Embedding& e) {
  if (e.status != Status::kDone) return kInfinity;
  const double energy = embedding_energy(pair.a, e.f, 0, pair.a.mesh.n_faces) +
                        embedding_energy(pair.b, e.g, 0, pair.b.mesh.n_faces);
  return energy < kInfinity ? energy / (pair.a.total_area + pair.b.total_area) : kInfinity;
}

/// Computes the start for the options, in steps. Without landmarks on held boundaries, a free
/// embedding defines their correspondence. Closed surfaces go onto a pillow; if that fails, onto
/// one with other cones. May add vertices to the meshes of the pair.
class Embedder {
 public:
  /// `landmarks`: their places on the surfaces of the given pair. `guides`: more pairs, which are
  /// never exact. `mapped`: a coarse map of the pair, or null.
  Embedder(SurfacePair& pair, const Array<PlacedLandmark>& landmarks,
           const Array<PlacedLandmark>& guides, std::unique_ptr<MappedLevel> mapped,
           const RunOptions& options, const Executor& executor)
      : pair_(pair),
        landmarks_(landmarks),
        guides_(guides),
        mapped_(std::move(mapped)),
        options_(options),
        executor_(executor) {}

  /// The next step; false after the last one: the result then has positions, or says why not.
  bool step() {
    if (stage_ == Stage::kEnd) return false;
    Timer timer;
    if (!run_stage()) stage_ = next_stage();
    if (result_.status != Status::kDone && stage_ != Stage::kOnCircle) {
      stage_ = Stage::kEnd;
      result_.f.resize(0, 2);
      result_.g.resize(0, 2);
    }
    result_.seconds += timer.lap();
    return stage_ != Stage::kEnd;
  }

  Embedding& result() { return result_; }
  /// The map of the coarse levels so far, see PairEmbedder.
  const PairEmbedder* levels_now() const {
    const bool has_levels = embedder_ && !embedder_->levels().empty();
    return has_levels && stage_ == Stage::kFree ? embedder_.get() : nullptr;
  }
  /// The last iteration on each coarse level that was mapped.
  const std::vector<IterationLog>& levels() const { return levels_; }

 private:
  enum class Stage { kBegin, kFree, kOnCircle, kInSquare, kJoining, kEnd };

  bool is_held() const { return options_.boundary != Boundary::kFree; }
  bool is_on_pillow() const { return are_closed(pair_); }

  bool run_stage() {
    if (stage_ == Stage::kBegin) return false;
    if (stage_ == Stage::kJoining) return joiner_->step(result_);
    return embedder_->step(stage_ == Stage::kOnCircle ? other_ : result_);
  }

  Stage next_stage() {
    constexpr double kStrained = 100;  // of isometries: 4
    switch (stage_) {
      case Stage::kBegin:
        if (!PairEmbedder::has_levels(options_)) mapped_.reset();
        if ((is_held() || options_.exact_landmarks) &&
            !add_landmark_vertices(landmarks_, options_, pair_, result_))
          return Stage::kEnd;
        if (is_on_pillow() && !mapped_ && !find_cones()) return Stage::kEnd;
        if (is_held()) outline_builder_ = std::make_unique<OutlineBuilder>(pair_, landmarks());
        if (is_held() && outline_builder_->has_landmarks()) return begin_square();
        return begin(Stage::kFree, nullptr);
      case Stage::kFree:
        if (is_poor() && (mapped_ || next_cones_ < cones_.size())) {
          static_cast<Outcome&>(result_) = Outcome();
          if (mapped_ && is_on_pillow() && !find_cones()) return Stage::kEnd;
          mapped_.reset();
          return begin(Stage::kFree, nullptr);
        }
        if (result_.status == Status::kDone) {
          pair_.a.mesh.pillow = embedder_->hierarchy(Side::kA).pillow();
          pair_.b.mesh.pillow = embedder_->hierarchy(Side::kB).pillow();
          levels_ = embedder_->levels();
          if (mapped_) result_.warnings = mapped_->warnings;
        }
        if (is_on_pillow()) return after_embedding();
        if (!levels_.empty() || strain(pair_, result_) < kStrained) return after_free();
        outlines_.a = circle_for(pair_.a, outer_loop(pair_.a, options_.outer_a));
        outlines_.b = circle_for(pair_.b, outer_loop(pair_.b, options_.outer_b));
        return begin(Stage::kOnCircle, &outlines_);
      case Stage::kOnCircle:
        if (strain(pair_, other_) < strain(pair_, result_)) {
          other_.seconds = result_.seconds;
          result_ = std::move(other_);
          levels_.clear();
        }
        return after_free();
      case Stage::kInSquare:
        return after_embedding();
      default:
        return Stage::kEnd;
    }
  }

  /// True if the given map, or these cones, lead to no useful start.
  bool is_poor() const {
    constexpr double kMostStrained = 1e4;
    if (result_.status != Status::kDone) return true;
    return mapped_ && !is_on_pillow() && !(strain(pair_, result_) < kMostStrained);
  }

  Array<PlacedLandmark> landmarks() const { return located(landmarks_, pair_); }

  /// Finds cones at pairs that correspond; there are several choices, as a path may be in the way.
  bool find_cones() {
    constexpr int kMost = 8;
    const Array<VertexPair> pairs = cone_pairs();
    if (!options_.exact_landmarks) {
      const Cones at_ends = cones_at_ends(pair_, pairs);
      if (!at_ends.empty()) cones_.push_back(at_ends);
    }
    add_cones(pairs, options_.first_cones, kMost);
    if (cones_.empty()) add_cones(farthest_pairs(pair_), 0, kMost);
    return !cones_.empty() || fail(result_, Status::kNumericalFailure,
                                   {"no four vertices of A and B correspond that are apart"});
  }

  void add_cones(const Array<VertexPair>& pairs, int first, int most) {
    const Array<Array<double>> distances = distances_between(pair_, pairs);
    for (int i = first; i < first + most; ++i) {
      const Cones next = choose_cones(pairs, distances, i);
      if (!next.empty()) cones_.push_back(next);
    }
  }

  /// Landmarks and pairs that were found; exact landmarks alone if there are enough, found pairs
  /// alone if there are so many landmarks that they were computed, and may be noisy.
  Array<VertexPair> cone_pairs() const {
    constexpr int kByHand = 24, kMost = 48;
    Array<PlacedLandmark> given, found;
    for (const PlacedLandmark& l : landmarks())
      (l.given.weight > 0 || options_.exact_landmarks ? given : found).push_back(l);
    for (const PlacedLandmark& guide : located(guides_, pair_)) found.push_back(guide);
    if (!options_.exact_landmarks && given.size() > kByHand && found.size() >= 4) given.clear();
    Array<VertexPair> pairs;
    const auto add = [&](const PlacedLandmark& l) {
      const VertexPair next = {nearest_corner(l.a), nearest_corner(l.b), l.given};
      for (const VertexPair& p : pairs)
        if (p.a == next.a || p.b == next.b) return;
      pairs.push_back(next);
    };
    for (int i = 0; i < given.size(); i += 1 + given.size() / (kMost + 1)) add(given[i]);
    if (options_.exact_landmarks && pairs.size() >= 4) return pairs;
    for (const PlacedLandmark& l : found) add(l);
    return pairs;
  }

  Stage begin(Stage stage, const OutlinePair* outlines) {
    Array<PlacedLandmark> all = landmarks();
    const bool are_many = all.size() > kMostLeading;
    const bool on_outline = outline_builder_ && outline_builder_->has_landmarks() && !are_many;
    const bool guides_lead =
        !guides_.empty() && !mapped_ && !options_.exact_landmarks && !on_outline;
    if (guides_lead) all.clear();  // they contain those that agree
    for (const PlacedLandmark& guide : located(guides_, pair_))
      if (guide.weight < 1 || guides_lead) all.push_back(guide);
    Cones cones;
    if (is_on_pillow() && !mapped_) cones = cones_[next_cones_++];
    embedder_ = std::make_unique<PairEmbedder>(pair_, all, options_, executor_, outlines, cones,
                                               mapped_.get());
    return stage;
  }

  Stage begin_square() {
    outlines_ = outline_builder_->build();
    return begin(Stage::kInSquare, &outlines_);
  }

  Stage after_free() {
    if (!is_held() || result_.status != Status::kDone) return after_embedding();
    outline_builder_->match_closest(result_.f, result_.g);
    return begin_square();
  }

  Stage after_embedding() {
    embedder_.reset();
    if (result_.status != Status::kDone) return Stage::kEnd;
    if (!is_held() && !is_on_pillow()) make_overlap();
    if (!options_.exact_landmarks) return Stage::kEnd;
    joiner_ =
        std::make_unique<LandmarkJoiner>(pair_, vertex_pairs(landmarks()), options_, executor_);
    return Stage::kJoining;
  }

  /// If the surfaces still lie apart, e.g. one in an opening of the other, brings inner points
  /// together.
  void make_overlap() {
    Points2& f = result_.f;
    if (badness(join(pair_), stacked(f, result_.g)) < kInfinity) return;
    f = transformed(f, rigid_motion({1, 0}, inner_point(pair_.a.mesh, f),
                                    inner_point(pair_.b.mesh, result_.g)));
  }

  SurfacePair& pair_;
  const Array<PlacedLandmark> landmarks_, guides_;
  Array<Cones> cones_;  // of closed surfaces, in the order in which they are tried
  int next_cones_ = 0;
  std::unique_ptr<MappedLevel> mapped_;
  const RunOptions& options_;
  const Executor& executor_;
  Stage stage_ = Stage::kBegin;
  std::unique_ptr<OutlineBuilder> outline_builder_;
  OutlinePair outlines_;
  std::unique_ptr<PairEmbedder> embedder_;
  std::unique_ptr<LandmarkJoiner> joiner_;
  Embedding result_, other_;  // the other one on circles
  std::vector<IterationLog> levels_;
};

// ==== [15] MAP EVALUATION AND META MESH (paper §3.1, §4.1) =======================================
//
// Purpose:    evaluates Φ and Φ⁻¹ at points and along edges, lifts the meta mesh to both surfaces,
//             and measures the distortion of Φ.
// Invariants: a corner of the meta mesh is a vertex of A, a vertex of B, or a crossing of an edge
//             of A with an edge of B; this key identifies it, never coordinates.
// Fails:      points outside the overlap have no image.

inline Vec3 vec3(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
inline SurfacePoint surface_point(int face, const Vec3& weights) {
  return {face, Eigen::Vector3d(weights.x, weights.y, weights.z)};
}

inline Vec3 barycentric(const HalfEdgeMesh& m, const Points2& x, int f, Vec2 p) {
  return barycentric(p, corner_place(m, x, f, 0), corner_place(m, x, f, 1),
                     corner_place(m, x, f, 2));
}

/// Returns how far below 0 rounding may put barycentric coordinates of a point in the triangle.
inline double slack_of(const HalfEdgeMesh& m, const Points2& x, int f, Vec2 p) {
  constexpr double kLeastSlack = 1e-12, kRounding = 8 * DBL_EPSILON;
  const Vec2 a = corner_place(m, x, f, 0), b = corner_place(m, x, f, 1),
             c = corner_place(m, x, f, 2);
  const double edge =
      std::sqrt((std::max)({squared_norm(b - a), squared_norm(c - b), squared_norm(a - c)}));
  const double height = accurate_area(a, b, c) / edge, rounding = kRounding * (norm(p) + edge);
  return (std::max)(kLeastSlack, rounding / height);
}

/// Returns the point of face f at p, which may lie outside by rounding: a negative coordinate is
/// set to 0 and added to that of the nearer corner, which moves the point least.
inline SurfacePoint closest_in_face(const HalfEdgeMesh& m, const Points2& x, int f, Vec2 p) {
  Vec3 b = barycentric(m, x, f, p);
  const auto squared_length = [&](int k, int l) {
    return squared_norm(corner_place(m, x, f, k) - corner_place(m, x, f, l));
  };
  for (int k = 0; k < 3; ++k) {
    if (!(b[k] < 0)) continue;
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    b[squared_length(k, i) < squared_length(k, j) ? i : j] += b[k];
    b[k] = 0;
  }
  for (int k = 0; k < 3; ++k) b[k] = (std::max)(b[k], 0.0);
  const double sum = b.x + b.y + b.z;
  const bool is_sound = sum > 0 && sum < kInfinity;
  return surface_point(f, is_sound ? 1 / sum * b : Vec3{1.0 / 3, 1.0 / 3, 1.0 / 3});
}

/// The face with the largest depth of a point: its least barycentric coordinate.
struct DeepestFace {
  double depth = -kInfinity;
  int face = -1;
  Vec2 place;     // of the point, in the plane of the face
  Motion motion;  // takes that plane to the one of the point
};

/// Identifies a corner of a polygon: {kAtVertex, vertex, 0}, {kCrossing, edge, edge}, where the
/// smaller half-edge stands for an edge, or {kAtCone, number, 0}.
using CornerKey = std::array<int, 3>;
enum CornerKind { kAtVertex, kCrossing, kAtCone };

/// Returns the number 0 to 3 of the cone at a place, or -1: the cones of a pillow lie on a grid.
inline int cone_number(Vec2 p, double side) {
  const double i = std::round(p.x / side), j = std::round(p.y / side);
  if (p != side * Vec2{i, j}) return -1;
  return std::abs(static_cast<int>(i) % 2) + 2 * std::abs(static_cast<int>(j) % 2);
}

/// Sews an embedding of a closed surface that is cut open; `original`: per vertex, itself or the
/// vertex that it copies. False if it is no such embedding: copies are not the last vertices or are
/// moved by no motion of a pillow, positions are not on its grid, or there are not four cones.
inline bool sew(const Triangles& cut, const Points2& x, const Array<int>& original,
                HalfEdgeMesh& m) {
  const int all = rows_of(x);
  int n = 0;
  while (n < all && original[n] == n) ++n;
  for (int v = n; v < all; ++v)
    if (original[v] >= n) return false;
  if (n == all) return false;
  Triangles sewn = cut;
  for (int i = 0; i < sewn.size(); ++i) sewn.data()[i] = original[cut.data()[i]];
  m = build_half_edges(n, sewn);
  if (!m.boundary.empty()) return false;
  double area = 0;  // 2 side²
  for (int f = 0; f < m.n_faces; ++f) {
    const Vec2 p = row2(x, cut(f, 0));
    area += 0.5 * cross(row2(x, cut(f, 1)) - p, row2(x, cut(f, 2)) - p);
  }
  Pillow& pillow = m.pillow;
  pillow.side = std::ldexp(kPillowSide, std::ilogb(1.4 * std::sqrt(0.5 * area) / kPillowSide));
  pillow.place.resize(m.tail.size());
  pillow.cones.assign(4, -1);
  Array<Motion> motion(all);
  for (int v = 0; v < all; ++v) {
    const Vec2 p = row2(x, original[v]), q = row2(x, v);
    if (v >= n) motion[v] = nearest_motion(m, q, p);
    if (motion[v] * p != q || on_grid(q, pillow.side) != q) return false;
    const int cone = cone_number(q, pillow.side);
    if (v < n && cone >= 0) pillow.cones[cone] = v;
  }
  for (int i = 0; i < cut.size(); ++i) pillow.place[i] = motion[cut.data()[i]];
  return !pillow.is_cone(-1);
}

/// Cuts a surface on a pillow open, so that every vertex has one place. Others stay as they are.
inline Surface cut_pillow(Surface s) {
  if (s.mesh.pillow.is_empty()) return s;
  const Array<int> edges = numbers_where(
      s.mesh.tail.size(), [&](int h) { return !(motion_across(s.mesh, h) == Motion()); });
  s.mesh.pillow = Pillow();
  cut_along(edges, s);
  return s;
}

/// Returns the positions of a surface in the vertices of a mesh of the same triangles, cut open.
inline Points2 cut_positions(const HalfEdgeMesh& on_pillow, const TriangleMesh& cut,
                             const Points2& x) {
  Points2 places(cut.vertices.rows(), 2);
  for (int h = 0; h < cut.triangles.size(); ++h)
    set_row(places, cut.triangles.data()[h], place_of(on_pillow, x, h));
  return places;
}

/// Two embedded meshes and their overlay. Ids are those of A ⊔ B, so one function evaluates Φ and
/// Φ⁻¹: it maps faces of either mesh to faces of the other.
struct EmbeddedPair {
  JointSurface s;
  Points2 x;
  Overlay overlay;
  int n_given = 0;  // polygons; those in openings that were closed come after them
  Groups<int> by_face;
  double extent = 0;  // largest absolute coordinate in the plane

  EmbeddedPair() = default;
  EmbeddedPair(JointSurface surface, Points2 positions)
      : s(std::move(surface)), x(std::move(positions)), extent(x.cwiseAbs().maxCoeff()) {
    compute_overlay(s, x, overlay);
    keep_given([](const OverlayPolygon&) { return true; });
  }

  template <class IsGiven>
  void keep_given(const IsGiven& is_given) {
    Array<OverlayPolygon>& all = overlay.polygons;
    n_given =
        static_cast<int>(std::stable_partition(all.begin(), all.end(), is_given) - all.begin());
    by_face = group_polygons(all, s.mesh.n_faces);
  }

  /// True on pillows: the map has no boundary.
  bool is_closed() const { return !s.mesh.pillow.is_empty(); }
  bool maps_all() const { return is_closed() && n_given == overlay.polygons.size(); }

  /// For every given polygon in a face: visit(face of the other mesh, motion of its plane to this).
  template <class Visit>
  void for_each_target(int face, const Visit& visit) const {
    by_face.for_each_in(face, [&](int i) {
      if (i >= n_given) return;
      const OverlayPolygon& p = overlay.polygons[i];
      face == p.ta ? visit(p.tb, p.motion) : visit(p.ta, inverse(p.motion));
    });
  }

  Vec2 planar_position(const SurfacePoint& p) const {
    Vec2 sum;
    for (int k = 0; k < 3; ++k) sum += p.barycentric[k] * corner_place(s.mesh, x, p.face, k);
    return sum;
  }

  /// Considers the faces over `face` for a point at p. Rounding may put a point on an edge outside
  /// both its faces; where every point has an image, any depth is accepted. `to_point` takes the
  /// plane of `face` to that of the point.
  void consider_face(int face, Vec2 p, DeepestFace& best, const Motion& to_point = {}) const {
    for_each_target(face, [&](int t, const Motion& motion) {
      const Vec2 q = inverse(motion) * p;
      const Vec3 b = barycentric(s.mesh, x, t, q);
      const double depth = (std::min)({b.x, b.y, b.z});
      if (depth > best.depth && (maps_all() || depth > -slack_of(s.mesh, x, t, q)))
        best = {depth, t, q, to_point * motion};
    });
  }

  SurfacePoint image(const DeepestFace& best) const {
    return best.face < 0 ? SurfacePoint() : closest_in_face(s.mesh, x, best.face, best.place);
  }

  DeepestFace face_over(int v) const {
    DeepestFace best;
    s.mesh.for_each_outgoing(v, [&](int h) {
      consider_face(h / 3, place_of(s.mesh, x, h), best,
                    is_closed() ? inverse(s.mesh.pillow.place[h]) : Motion());
    });
    return best;
  }
};

// ---- a mesh and a finer one ----

/// Places the triangles of a finer mesh in those of a mesh.
struct Pieces {
  Array<int> face;             // per triangle, the one of the mesh that contains it, or -1,
  Array<Vec3> corner_weights;  // and per corner, its barycentric coordinates there
  Groups<int> by_triangle;     // per triangle of the mesh, its pieces

  SurfacePoint to_mesh(const SurfacePoint& p) const {
    Vec3 weights;
    for (int k = 0; k < 3; ++k) weights += p.barycentric[k] * corner_weights[3 * p.face + k];
    return surface_point(face[p.face], weights);
  }

  /// Returns a point of the finer mesh, or none if there is no such triangle or no piece of it.
  SurfacePoint from_mesh(const SurfacePoint& p) const {
    constexpr double kRounding = 1e-12, kBeside = 1e-6;
    if (p.face < 0 || p.face + 1 >= by_triangle.start.size()) return {};
    const Vec3 at = vec3(p.barycentric);
    const auto planar = [](const Vec3& weights) { return Vec2{weights.y, weights.z}; };
    const auto is_unit = [](const Vec3& w) { return (std::max)({w.x, w.y, w.z}) == 1; };
    SurfacePoint best;
    double least = -kBeside;  // deeper outside, it is in a dropped part
    for (int i = by_triangle.start[p.face]; i < by_triangle.start[p.face + 1]; ++i) {
      const int piece = by_triangle.item[i];
      const Vec3* const corner = &corner_weights[3 * piece];
      Vec3 weights = {dot(corner[0], at), dot(corner[1], at), dot(corner[2], at)};
      if (std::all_of(corner, corner + 3, is_unit)) return surface_point(piece, weights);
      weights = barycentric(planar(at), planar(corner[0]), planar(corner[1]), planar(corner[2]));
      const double depth = (std::min)({weights.x, weights.y, weights.z});
      if (!(depth > least)) continue;
      least = depth;
      for (int k = 0; k < 3; ++k) weights[k] = weights[k] < kRounding ? 0 : weights[k];
      best = surface_point(piece, 1 / (weights.x + weights.y + weights.z) * weights);
    }
    return best;
  }

  /// Lists the pieces of each of n triangles.
  void index(int n) {
    by_triangle = grouped<int>(n, [&](const auto& add) {
      for (int i = 0; i < face.size(); ++i)
        if (face[i] >= 0) add(face[i], i);
    });
  }
};

/// Adds a weight of a vertex to a mean; returns false if it had three vertices already.
inline bool add_weight(int v, double weight, AddedVertex& mean) {
  for (int k = 0; k < 3; ++k) {
    if (mean.corners[k] >= 0 && mean.corners[k] != v) continue;
    mean.corners[k] = v;
    mean.weights[k] += weight;
    return true;
  }
  return false;
}

/// Returns each of n vertices, and of those added to them, as a mean of the first n; less if a
/// corner does not exist, or more than three are needed.
inline Array<AddedVertex> means_of_vertices(int n, const std::vector<AddedVertex>& added) {
  Array<AddedVertex> means;
  for (int v = 0; v < n; ++v) means.push_back(copy_of(v));
  for (const AddedVertex& p : added) {
    AddedVertex mean;
    for (int k = 0; k < 3 && p.corners[k] != -1; ++k) {
      if (p.corners[k] < 0 || p.corners[k] >= means.size()) return means;
      const AddedVertex corner = means[p.corners[k]];
      for (int i = 0; i < 3 && corner.corners[i] >= 0; ++i)
        if (!add_weight(corner.corners[i], p.weights[k] * corner.weights[i], mean)) return means;
    }
    means.push_back(mean);
  }
  return means;
}

/// Returns the barycentric coordinates of a place in a triangle.
inline Vec3 weights_in(const HalfEdgeMesh& m, int f, const Place& p) {
  Vec3 weights;
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < 3; ++i)
      if (m.corner(f, k) == p.corners[i]) weights[k] = p.weights[i];
  return weights;
}

/// Returns the triangle that contains a piece, or -1, and the piece's corners in its coordinates.
inline int find_piece(const HalfEdgeMesh& m, const std::array<AddedVertex, 3>& corner,
                      std::array<Vec3, 3>& weights) {
  AddedVertex all;
  for (const AddedVertex& p : corner)
    for (int k = 0; k < 3 && p.corners[k] >= 0; ++k)
      if (!add_weight(p.corners[k], 0, all)) return -1;
  all.weights.setConstant(1.0 / 3);
  const int h = all.corners[2] < 0 ? -1 : find_place(m, all);
  for (std::size_t i = 0; i < 3 && h >= 0; ++i) weights[i] = weights_in(m, h / 3, corner[i]);
  return h < 0 || !(dot(weights[0], cross(weights[1], weights[2])) > 0) ? -1 : h / 3;
}

/// Places the triangles of a mesh with added vertices; false if they are not of such a mesh.
inline bool find_pieces(const HalfEdgeMesh& m, const std::vector<AddedVertex>& added,
                        const Triangles& fine, Pieces& pieces) {
  constexpr double kRounding = 1e-6;
  const Array<AddedVertex> means = means_of_vertices(m.n_vertices, added);
  if (means.size() != m.n_vertices + static_cast<int>(added.size())) return false;
  Array<double> share(m.n_faces, 0);
  pieces = Pieces();
  for (int f = 0; f < fine.rows(); ++f) {
    std::array<AddedVertex, 3> corner;
    std::array<Vec3, 3> weights;
    for (int k = 0; k < 3; ++k) {
      if (fine(f, k) < 0 || fine(f, k) >= means.size()) return false;
      corner[static_cast<std::size_t>(k)] = means[fine(f, k)];
    }
    const int face = find_piece(m, corner, weights);
    if (face < 0) return false;
    share[face] += dot(weights[0], cross(weights[1], weights[2]));
    pieces.face.push_back(face);
    for (const Vec3& w : weights) pieces.corner_weights.push_back(w);
  }
  pieces.index(m.n_faces);
  return std::all_of(share.begin(), share.end(),
                     [](double whole) { return std::abs(whole - 1) < kRounding; });
}

// ---- given and embedded meshes ----

/// Returns barycentric coordinates of the point closest to p on the sides of a triangle.
inline Vec3 closest_on_sides(const Vec3& p, const std::array<Vec3, 3>& corner) {
  Vec3 weights;
  double least = kInfinity;
  for (int k = 0; k < 3; ++k) {
    const Vec3 u = corner[static_cast<std::size_t>(k)];
    const Vec3 edge = corner[static_cast<std::size_t>((k + 1) % 3)] - u;
    const double t = clamp01(dot(p - u, edge) / squared_norm(edge));
    const double distance = squared_norm(p - u - t * edge);
    if (!(distance < least)) continue;
    least = distance;
    weights = (1 - t) * unit3(k) + t * unit3((k + 1) % 3);
  }
  return weights;
}

/// Returns barycentric coordinates of the point closest to p in a triangle or on its sides.
inline Vec3 closest_weights(const Vec3& p, const std::array<Vec3, 3>& corner) {
  const Vec3 weights = weights_in_plane(p, corner[0], corner[1], corner[2]);
  return (std::min)({weights.x, weights.y, weights.z}) >= 0 ? weights : closest_on_sides(p, corner);
}

/// Returns the corners of a triangle, in a unit in which squares neither over- nor underflow.
inline std::array<Vec3, 3> corners_of(const TriangleMesh& mesh, int f, double unit) {
  const auto corner = [&](int k) { return unit * row3(mesh.vertices, mesh.triangles(f, k)); };
  return {corner(0), corner(1), corner(2)};
}

using SharedPrepared = std::shared_ptr<const Prepared>;

/// Returns a mesh as prepare() does if it needs no repair.
inline Prepared as_given(const SharedMesh& mesh) {
  const auto identity = [](Eigen::Index n) { return numbers_below(static_cast<int>(n)); };
  Prepared result;
  result.given = result.mesh = mesh;
  result.given_vertex = result.new_vertex = identity(mesh->vertices.rows());
  result.given_corner = identity(mesh->triangles.size());
  result.given_triangle = result.new_triangle = identity(mesh->triangles.rows());
  return result;
}

/// Returns the place of a prepared corner in its given triangle: at a corner, or on the side that
/// was split for a degenerate neighbour.
inline Vec3 weights_in_given(const Prepared& p, double unit, int corner) {
  const int given = p.given_corner.data()[corner], f = p.given_triangle.data()[corner / 3];
  if (f < 0) return unit3(corner % 3);
  if (given / 3 == f) return unit3(given % 3);
  const Vec3 at = unit * row3(p.given->vertices, p.given->triangles.data()[given]);
  return closest_on_sides(at, corners_of(*p.given, f, unit));
}

/// Places the triangles of a prepared mesh in the given one.
inline Pieces pieces_of(const Prepared& p) {
  Pieces pieces;
  const double unit = unit_scale(p.mesh->vertices);
  pieces.face = p.given_triangle;
  for (int i = 0; i < 3 * pieces.face.size(); ++i)
    pieces.corner_weights.push_back(weights_in_given(p, unit, i));
  pieces.index(static_cast<int>(p.given->triangles.rows()));
  return pieces;
}

/// Places the triangles of an embedded mesh in the given one: a prepared mesh with added vertices.
struct Origin : Pieces {
  SharedPrepared prepared;
  Array<int> original;   // per embedded vertex, itself or, across a cut, the one it is a copy of
  Array<int> next_copy;  // per embedded vertex, another one of the same given one, or -1
  Array<EdgeUse> edges;  // of the given triangles

  explicit Origin(SharedPrepared p = std::make_shared<const Prepared>())
      : Pieces(pieces_of(*p)), prepared(std::move(p)), edges(sorted_edges(given().triangles)) {}
  const TriangleMesh& given() const { return *prepared->given; }

  /// Returns the half-edges along the given edge from u to v in order, if any; ~h: from v to u.
  Array<int> along(int u, int v) const {
    const EdgeUse edge(u, v, -1);
    const EdgeUse* use = std::lower_bound(edges.begin(), edges.end(), edge);
    const auto is_dropped = [&](int f) { return by_triangle.size(f) == 0; };
    while (use != edges.end() && use->same_edge(edge) && is_dropped(use->half_edge / 3)) ++use;
    if (use == edges.end() || !use->same_edge(edge)) return {};
    const int f = use->half_edge / 3, k = use->half_edge % 3, opposite = (k + 2) % 3;
    const int to = given().triangles(f, k) == u ? (k + 1) % 3 : k;
    Array<std::pair<double, int>> found;  // its start, and the half-edge
    by_triangle.for_each_in(f, [&](int i) {
      for (int h = 3 * i; h < 3 * i + 3; ++h) {
        const Vec3 &tail = corner_weights[h], &tip = corner_weights[next(h)];
        if (tail[opposite] != 0 || tip[opposite] != 0) continue;
        found.push_back({(std::min)(tail[to], tip[to]), tail[to] < tip[to] ? h : ~h});
      }
    });
    std::sort(found.begin(), found.end());
    Array<int> along;
    for (const auto& [start, h] : found) along.push_back(h);
    return along;
  }
};

/// Continues to an embedded mesh, with these vertices added; false if it is another mesh.
inline bool refine(const std::vector<AddedVertex>& added, const TriangleMesh& embedded, Origin& o) {
  const TriangleMesh& mesh = *o.prepared->mesh;
  const int n = static_cast<int>(mesh.vertices.rows());
  Pieces pieces;
  if (embedded.vertices.rows() != n + static_cast<int>(added.size()) ||
      !find_pieces(build_half_edges(n, mesh.triangles), added, embedded.triangles, pieces))
    return false;
  for (int h = 0; h < pieces.corner_weights.size(); ++h) {
    Vec3& weights = pieces.corner_weights[h];
    weights = vec3(o.to_mesh(surface_point(pieces.face[h / 3], weights)).barycentric);
  }
  for (int& f : pieces.face) f = o.face[f];
  pieces.index(static_cast<int>(o.given().triangles.rows()));
  static_cast<Pieces&>(o) = std::move(pieces);
  return true;
}

/// Returns the origin of a prepared mesh with vertices added; any other mesh counts as given.
inline Origin origin_of(const SharedPrepared& prepared, const std::vector<AddedVertex>& added,
                        const SharedMesh& embedded) {
  Origin o(prepared);
  if ((!added.empty() || embedded != prepared->mesh) && !refine(added, *embedded, o))
    o = Origin(std::make_shared<const Prepared>(as_given(embedded)));
  const Prepared& p = *o.prepared;
  const int n = static_cast<int>(embedded->vertices.rows()),
            n_prepared = static_cast<int>(p.given_vertex.size());
  o.original = numbers_below(n);
  int id = n - static_cast<int>(added.size());
  for (const AddedVertex& vertex : added) {
    if (id >= 0 && vertex_at(vertex) >= 0) o.original[id] = vertex_at(vertex);
    ++id;
  }
  o.next_copy.assign(n, -1);
  for (int v = n - 1; v >= 0; --v) {  // prepare() makes copies, too
    const int given = v < n_prepared ? p.given_vertex.data()[v] : -1;
    const int first = given >= 0 ? p.new_vertex.data()[given] : o.original[v];
    if (first == v) continue;
    o.next_copy[v] = o.next_copy[first];
    o.next_copy[first] = v;
  }
  return o;
}

// ---- data of a SurfaceMap ----

inline Vec3 position_in_space(const TriangleMesh& m, const SurfacePoint& p) {
  Vec3 sum;
  for (int k = 0; k < 3; ++k) sum += p.barycentric[k] * row3(m.vertices, m.triangles(p.face, k));
  return sum;
}

struct MapData : Outcome {                                 // kDone if the pair is valid
  SharedMesh a = std::make_shared<TriangleMesh>(), b = a;  // embedded meshes
  Origin origin_a, origin_b;
  Points2 f, g;       // of the embedded meshes
  EmbeddedPair pair;  // of closed surfaces, sewn where the embedded meshes are cut

  bool ok() const { return status == Status::kDone; }
  int first_face(Side side) const { return side == Side::kA ? 0 : pair.s.faces_a; }
  const Origin& origin(Side side) const { return side == Side::kA ? origin_a : origin_b; }

  /// Returns a point in ids of A ⊔ B as a point of its given mesh.
  SurfacePoint own(SurfacePoint p) const {
    if (!p.exists()) return p;
    const Side side = p.face < pair.s.faces_a ? Side::kA : Side::kB;
    p.face -= first_face(side);
    return origin(side).to_mesh(p);
  }

  SurfacePoint map(const SurfacePoint& point, Side from) const {
    SurfacePoint p = ok() ? origin(from).from_mesh(point) : SurfacePoint();
    if (!p.exists()) return p;
    p.face += first_face(from);
    DeepestFace best;
    pair.consider_face(p.face, pair.planar_position(p), best);
    return own(pair.image(best));
  }

  SurfacePoint map_vertex(int given, Side from) const {
    const Origin& o = origin(from);
    const bool exists = ok() && given >= 0 && given < o.given().vertices.rows();
    int v = exists ? o.prepared->new_vertex.data()[given] : -1;
    if (v >= 0 && pair.is_closed()) v = o.original[v];
    SurfacePoint image;
    while (v >= 0 && !image.exists()) {
      image = pair.image(pair.face_over(from == Side::kA ? v : pair.s.n_a + v));
      v = pair.is_closed() ? -1 : o.next_copy[v];
    }
    return own(image);
  }

  std::vector<SurfacePoint> map_vertices(Side from) const {
    std::vector<SurfacePoint> images;
    for (int v = 0; v < origin(from).given().vertices.rows(); ++v)
      images.push_back(map_vertex(v, from));
    return images;
  }

  Eigen::Vector3d position_of_given(const SurfacePoint& p, Side side) const {
    const TriangleMesh& m = origin(side).given();
    if (!ok() || p.face < 0 || p.face >= m.triangles.rows())
      return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
    const Vec3 x = position_in_space(m, p);
    return {x.x, x.y, x.z};
  }
};

// ---- paths ----

/// The part of a planar segment in one triangle, from parameter s to t.
struct SegmentPart {
  double s = 0, t = 1;
  int face = -1;
  Motion motion;  // takes the plane of the segment to that of the face
  bool operator<(const SegmentPart& o) const {
    return s != o.s ? s < o.s : t != o.t ? t > o.t : face < o.face;
  }
};

/// Maps a path along edges. The triangles over both faces beside an edge clip its segment in the
/// plane; each part continues where the one before ends. Triangles are enlarged a little, so that
/// neither rounding nor a path along an edge leaves gaps.
class PathMapper {
 public:
  explicit PathMapper(const MapData& data) : data_(data), pair_(data.pair), m_(data.pair.s.mesh) {}

  std::vector<Polyline> map(const std::vector<int>& vertices, Side from) {
    for (std::size_t i = 0; i + 1 < vertices.size() && data_.ok(); ++i) {
      const Array<int> edge = data_.origin(from).along(vertices[i], vertices[i + 1]);
      if (edge.empty()) is_open_ = false;
      for (int directed : edge) {
        const int h = 3 * data_.first_face(from) + (std::max)(directed, ~directed);
        Vec2 p = place_of(m_, pair_.x, h), q = place_of(m_, pair_.x, next(h));
        if (directed < 0) std::swap(p, q);
        add_segment(p, q, parts_along(h, p, q));
      }
    }
    return std::move(polylines_);
  }

 private:
  static constexpr double kTouch = 1e-12;  // ignores gaps below this part of a segment

  /// Returns the parts of the edge pq of half-edge h in the triangles of the other mesh.
  Array<SegmentPart> parts_along(int h, Vec2 p, Vec2 q) const {
    Array<SegmentPart> parts;
    for (int side : {h, m_.twin[h]}) {
      if (side < 0) continue;
      const Motion there = side != h ? motion_across(m_, side) : Motion();
      pair_.for_each_target(side / 3, [&](int target, const Motion& motion) {
        SegmentPart part;
        part.face = target;
        part.motion = inverse(motion) * there;
        if (clip(part.motion * p, part.motion * q, part)) parts.push_back(part);
      });
    }
    std::sort(parts.begin(), parts.end());
    return parts;
  }

  /// Narrows a part of pq to its triangle; returns false if nothing is left.
  bool clip(Vec2 p, Vec2 q, SegmentPart& part) const {
    constexpr double kRounding = 1e-14;  // relative to the extent of the plane
    for (int h = 3 * part.face; h < 3 * part.face + 3; ++h) {
      const Vec2 u = place_of(m_, pair_.x, h), edge = place_of(m_, pair_.x, next(h)) - u;
      const double slack = kRounding * pair_.extent * norm(edge);
      const double at_p = cross(edge, p - u) + slack, at_q = cross(edge, q - u) + slack;
      if (at_p < 0 && at_q < 0) return false;
      const double crossing = at_p / (at_p - at_q);
      if (at_p < 0) part.s = (std::max)(part.s, crossing);
      if (at_q < 0) part.t = (std::min)(part.t, crossing);
    }
    return part.s <= part.t;
  }

  void add_segment(Vec2 p, Vec2 q, const Array<SegmentPart>& parts) {
    double at = 0;
    for (const SegmentPart& part : parts) {
      if (part.t <= at + kTouch) continue;
      if (part.s > at + kTouch) is_open_ = false;
      if (is_open_)
        polylines_.back().pop_back();  // its last point is the first of this part
      else
        polylines_.emplace_back();
      const Vec2 begin = part.motion * p, way = part.motion * q - begin;
      for (double t : {(std::max)(at, part.s), part.t})
        polylines_.back().push_back(
            data_.own(closest_in_face(m_, pair_.x, part.face, begin + t * way)));
      is_open_ = true;
      at = part.t;
    }
    if (at < 1 - kTouch) is_open_ = false;
  }

  const MapData& data_;
  const EmbeddedPair& pair_;
  const HalfEdgeMesh& m_;
  std::vector<Polyline> polylines_;
  bool is_open_ = false;  // true if the next part extends the last polyline
};

// ---- meta mesh ----

class MetaMeshBuilder {
 public:
  explicit MetaMeshBuilder(const MapData& data)
      : data_(data), pair_(data.pair), m_(data.pair.s.mesh) {}

  MetaMesh build(Ids ids) {
    MetaMesh mesh;
    const bool are_given = ids == Ids::kGiven;
    const int n = ids == Ids::kWhole ? pair_.overlay.polygons.size() : pair_.n_given;
    for (int i = 0; i < n; ++i) {
      const OverlayPolygon& p = pair_.overlay.polygons[i];
      add_corners(p);
      mesh.face_a.push_back(p.ta);
      mesh.face_b.push_back(p.tb - pair_.s.faces_a);
      mesh.offsets.push_back(corners_.size());
    }
    set_vertices(mesh);
    mesh.a = data_.a, mesh.b = data_.b;
    mesh.corner_a.resize(corners_.size(), 3);
    mesh.corner_b.resize(corners_.size(), 3);
    const Origin &a = data_.origin_a, &b = data_.origin_b;
    for (int i = 0; i < corners_.size(); ++i) {
      const Corner& c = corners_[i];
      mesh.corner_a.row(i) = (are_given ? a.to_mesh(c.on_a) : c.on_a).barycentric;
      mesh.corner_b.row(i) = (are_given ? b.to_mesh(c.on_b) : c.on_b).barycentric;
    }
    if (!are_given) return mesh;
    mesh.a = a.prepared->given, mesh.b = b.prepared->given;
    mesh.same_a = same_vertices(*a.prepared), mesh.same_b = same_vertices(*b.prepared);
    for (int& f : mesh.face_a) f = a.face[f];
    for (int& f : mesh.face_b) f = b.face[f];
    return mesh;
  }

 private:
  struct Corner {
    CornerKey key;
    SurfacePoint on_a, on_b;  // in ids of the embedded meshes
  };

  /// Returns, per given vertex, the first one of those that were welded to it, or -1.
  static std::vector<int> same_vertices(const Prepared& p) {
    std::vector<int> same;
    for (int v : p.new_vertex) same.push_back(v < 0 ? -1 : p.given_vertex.data()[v]);
    return same;
  }

  /// Makes one vertex of all corners with the same key, at the first of them.
  void set_vertices(MetaMesh& mesh) const {
    Array<std::pair<CornerKey, int>> order;
    Array<int> first;
    for (int i = 0; i < corners_.size(); ++i) order.push_back({corners_[i].key, i});
    std::sort(order.begin(), order.end());
    mesh.corners.resize(static_cast<std::size_t>(order.size()));
    for (const auto& [key, i] : order) {
      if (first.empty() || corners_[first.back()].key != key) first.push_back(i);
      mesh.corners.data()[i] = first.size() - 1;
    }
    mesh.on_a.resize(first.size(), 3);
    mesh.on_b.resize(first.size(), 3);
    mesh.plane.resize(first.size(), 2);
    for (int v = 0; v < first.size(); ++v) {
      const Corner& c = corners_[first[v]];
      set_row(mesh.on_a, v, position_in_space(*data_.a, c.on_a));
      set_row(mesh.on_b, v, position_in_space(*data_.b, c.on_b));
      set_row(mesh.plane, v, pair_.planar_position(c.on_a));
    }
  }

  void add_corners(const OverlayPolygon& p) {
    for (int i = 0, last = p.count - 1; i < p.count; last = i++) {
      const CornerKey key = key_of(p, i);
      if (key == key_of(p, last)) continue;  // at a cone
      const int e = p.piece(last), after = p.piece(i);
      Corner c = same_triangle(e, after)
                     ? vertex(p, after)
                     : crossing(p, (std::min)(e, after), (std::max)(e, after) - 3);
      for (int k = 0; k < 3 && key[0] == kAtCone; ++k) {
        if (cone_at(3 * p.ta + k) == key[1]) c.on_a = surface_point(p.ta, unit3(k));
        if (cone_at(3 * p.tb + k) == key[1]) c.on_b = surface_point(p.tb, unit3(k));
      }
      c.key = key;
      c.on_b.face -= pair_.s.faces_a;
      corners_.push_back(c);
    }
  }

  /// Returns the key of corner i of a polygon. At a cone, where a vertex of A and one of B
  /// coincide, a corner may be either or a crossing of edges.
  CornerKey key_of(const OverlayPolygon& p, int i) const {
    const int e = p.piece(i), before = p.piece(i > 0 ? i - 1 : p.count - 1);
    const auto half_edge = [&](int k) { return k < 3 ? 3 * p.ta + k : 3 * p.tb + k - 3; };
    const auto place = [&](int h) { return motion_in(m_, p, h) * row2(pair_.x, m_.tail[h]); };
    const int h = half_edge((std::min)(before, e)), t = half_edge((std::max)(before, e));
    if (same_triangle(before, e)) {
      const int v = m_.tail[half_edge(e)], cone = cone_at(half_edge(e));
      return cone < 0 ? CornerKey{kAtVertex, v, 0} : CornerKey{kAtCone, cone, 0};
    }
    for (int u : {h, next(h)})
      for (int v : {t, next(t)})
        if (cone_at(u) >= 0 && cone_at(u) == cone_at(v) && place(u) == place(v))
          return {kAtCone, cone_at(u), 0};
    return {kCrossing, first_half_edge(h), first_half_edge(t)};
  }

  int cone_at(int h) const {
    const int v = m_.tail[h];
    return m_.pillow.is_cone(v) ? cone_number(row2(pair_.x, v), m_.pillow.side) : -1;
  }

  int first_half_edge(int h) const { return m_.twin[h] < 0 ? h : (std::min)(h, m_.twin[h]); }

  Corner vertex(const OverlayPolygon& p, int e) const {
    const bool of_a = e < 3;
    const int own = of_a ? p.ta : p.tb, other = of_a ? p.tb : p.ta, k = e % 3;
    const SurfacePoint here = surface_point(own, unit3(k));
    const Vec2 at = corner_place(m_, pair_.x, own, k);
    const SurfacePoint there =
        closest_in_face(m_, pair_.x, other, (of_a ? inverse(p.motion) : p.motion) * at);
    return {{}, of_a ? here : there, of_a ? there : here};
  }

  /// Returns the crossing of two edges, from the same half-edges in all polygons around it: nearly
  /// parallel edges hardly determine its position, but all polygons must agree on it.
  Corner crossing(const OverlayPolygon& p, int edge_a, int edge_b) const {
    const int on_a = 3 * p.ta + edge_a, on_b = 3 * p.tb + edge_b;
    const int h = first_half_edge(on_a), g = first_half_edge(on_b);
    Motion motion = p.motion;  // takes the plane of g to that of h
    if (h != on_a) motion = motion_across(m_, h) * motion;
    if (g != on_b) motion = motion * motion_across(m_, on_b);
    const auto place = [&](int e) { return place_of(m_, pair_.x, e); };
    const Vec2 u = place(h), c = motion * place(g);
    const Crossing at = detail::crossing(u, place(next(h)) - u, c, motion * place(next(g)) - c);
    const auto on_edge = [](int face, int k, double t) {
      return surface_point(face, (1 - t) * unit3(k) + t * unit3((k + 1) % 3));
    };
    return {{},
            on_edge(p.ta, edge_a, on_a == h ? at.t : 1 - at.t),
            on_edge(p.tb, edge_b, on_b == g ? at.mu : 1 - at.mu)};
  }

  const MapData& data_;
  const EmbeddedPair& pair_;
  const HalfEdgeMesh& m_;
  Array<Corner> corners_;
};

// ---- distortion ----

/// Returns the largest singular value of J [Blinn 1996].
inline double largest_stretch(const Mat2& J) {
  return 0.5 * (norm(Vec2{J(0, 0) + J(1, 1), J(1, 0) - J(0, 1)}) +
                norm(Vec2{J(0, 0) - J(1, 1), J(1, 0) + J(0, 1)}));
}

/// Returns the distortion of Φ in one polygon, J = J_g⁻¹ J_f. Determinants come from areas that are
/// positive even for slivers, where those of rounded Jacobians may have any sign. They give σ_min:
/// the difference of two nearly equal numbers would not have a correct digit.
inline PolygonDistortion polygon_distortion(const EmbeddedPair& pair, const OverlayPolygon& p,
                                            bool keep_scale) {
  const JointSurface& s = pair.s;
  const double scale_a = keep_scale ? s.scale_a : 1, scale_b = keep_scale ? s.scale_b : 1;
  const SixPoints x = six_points(s.mesh, pair.x, p);
  const auto determinant = [&](int f, int k, double scale) {
    return scale * scale * accurate_area(x[k], x[k + 1], x[k + 2]) / (2 * s.area[f]);
  };
  const Mat2 f = scale_a * triangle_jacobian(s, pair.x, p.ta);
  const Mat2 g = scale_b * triangle_jacobian(s, pair.x, p.tb);
  const double det_f = determinant(p.ta, 0, scale_a), det_g = determinant(p.tb, 3, scale_b);
  const double area = (std::max)(0.0, polygon_area(polygon_shape(p, x), x));
  const double stretch = det_f / det_g;  // of areas
  PolygonDistortion d;
  d.sigma_max = (std::max)(largest_stretch(1 / det_g * (adjugate(g) * f)), std::sqrt(stretch));
  d.sigma_min = stretch / d.sigma_max;
  d.area_a = area / det_f;
  d.area_b = area / det_g;
  const double min2 = d.sigma_min * d.sigma_min, max2 = d.sigma_max * d.sigma_max;
  d.density = ((min2 + max2) * stretch + (1 / min2 + 1 / max2)) / (stretch + 1);
  return d;
}

}  // namespace detail

Status SurfaceMap::status() const { return data_->status; }
const std::string& SurfaceMap::message() const { return data_->message; }
const TriangleMesh& SurfaceMap::mesh(Side side, Ids ids) const {
  if (ids == Ids::kGiven) return data_->origin(side).given();
  return side == Side::kA ? *data_->a : *data_->b;
}
Points2 SurfaceMap::planar_positions(Side side) const {
  return side == Side::kA ? data_->f : data_->g;
}
bool SurfaceMap::is_closed() const { return data_->pair.is_closed(); }
double SurfaceMap::period() const { return is_closed() ? 2 * data_->pair.s.mesh.pillow.side : 0; }
SurfacePoint SurfaceMap::forward(const SurfacePoint& p) const { return data_->map(p, Side::kA); }
SurfacePoint SurfaceMap::backward(const SurfacePoint& p) const { return data_->map(p, Side::kB); }
SurfacePoint SurfaceMap::forward_vertex(int a) const { return data_->map_vertex(a, Side::kA); }
SurfacePoint SurfaceMap::backward_vertex(int b) const { return data_->map_vertex(b, Side::kB); }
std::vector<SurfacePoint> SurfaceMap::forward_vertices() const {
  return data_->map_vertices(Side::kA);
}
std::vector<SurfacePoint> SurfaceMap::backward_vertices() const {
  return data_->map_vertices(Side::kB);
}
std::vector<Polyline> SurfaceMap::forward_path(const std::vector<int>& vertices) const {
  return detail::PathMapper(*data_).map(vertices, Side::kA);
}
std::vector<Polyline> SurfaceMap::backward_path(const std::vector<int>& vertices) const {
  return detail::PathMapper(*data_).map(vertices, Side::kB);
}
Eigen::Vector3d SurfaceMap::position_on_a(const SurfacePoint& p) const {
  return data_->position_of_given(p, Side::kA);
}
Eigen::Vector3d SurfaceMap::position_on_b(const SurfacePoint& p) const {
  return data_->position_of_given(p, Side::kB);
}
MetaMesh SurfaceMap::meta_mesh(Ids ids) const { return detail::MetaMeshBuilder(*data_).build(ids); }
std::vector<PolygonDistortion> SurfaceMap::distortion(bool keep_scale) const {
  const detail::EmbeddedPair& pair = data_->pair;
  std::vector<PolygonDistortion> result;
  for (int i = 0; i < pair.n_given; ++i)
    result.push_back(detail::polygon_distortion(pair, pair.overlay.polygons[i], keep_scale));
  return result;
}

std::vector<WorstPlace> worst_places(const SurfaceMap& map, int most) {
  using detail::Array;
  const std::vector<PolygonDistortion> polygons = map.distortion();
  const MetaMesh meta = map.meta_mesh();
  const DistortionSummary all = summarize(polygons);
  const Triangles& triangles = meta.a->triangles;
  const int n_vertices = static_cast<int>(meta.a->vertices.rows());
  Array<double> energy(static_cast<int>(triangles.rows()), 0), area = energy;
  for (int p = 0; p < meta.n_polygons(); ++p) {
    const PolygonDistortion& d = polygons.data()[p];
    energy[meta.face_a.data()[p]] += d.density * (d.area_a + d.area_b);
    area[meta.face_a.data()[p]] += d.area_a + d.area_b;
  }
  const auto is_bad = [&](int f) { return energy[f] - 2 * area[f] > 2 * (all.mean - 2) * area[f]; };
  detail::DisjointSets parts(n_vertices);  // bad triangles that share vertices
  for (int f = 0; f < area.size(); ++f)
    for (int k = 1; k < 3 && is_bad(f); ++k) parts.unite(triangles(f, 0), triangles(f, k));
  Array<double> gain(n_vertices, 0), at_vertex = gain, energy_of = gain, area_of = gain;
  for (int f = 0; f < area.size(); ++f) {
    if (!is_bad(f)) continue;
    const int of = parts.find(triangles(f, 0));
    const double excess = energy[f] - all.mean * area[f];
    gain[of] -= excess, energy_of[of] += energy[f], area_of[of] += area[f];
    for (int k = 0; k < 3; ++k) at_vertex[triangles(f, k)] += excess;
  }
  std::vector<WorstPlace> worst;
  for (int of : detail::sorted_by(gain)) {
    if (static_cast<int>(worst.size()) >= most || !(gain[of] < 0)) break;
    int v = of;
    for (int w = 0; w < n_vertices; ++w)
      if (parts.find(w) == of && at_vertex[w] > at_vertex[v]) v = w;
    worst.push_back({v, map.forward_vertex(v), area_of[of] / (all.area_a + all.area_b),
                     energy_of[of] / area_of[of]});
  }
  return worst;
}

DistortionSummary summarize(const std::vector<PolygonDistortion>& polygons) {
  DistortionSummary s;
  detail::Array<double> density, area;
  double energy = 0;
  for (const PolygonDistortion& p : polygons) {
    if (!(p.area_a + p.area_b > 0)) continue;
    s.sigma_min = density.empty() ? p.sigma_min : (std::min)(s.sigma_min, p.sigma_min);
    s.sigma_max = (std::max)(s.sigma_max, p.sigma_max);
    s.area_a += p.area_a;
    s.area_b += p.area_b;
    energy += (p.area_a + p.area_b) * p.density;
    density.push_back(p.density);
    area.push_back(p.area_a + p.area_b);
  }
  if (density.empty()) return s;
  const detail::Array<int> order = detail::sorted_by(density);
  const double total = s.area_a + s.area_b;
  const auto quantile = [&](double share) {
    double below = 0;
    for (int i : order)
      if ((below += area[i]) >= share * total) return density[i];
    return density[order.back()];
  };
  s.mean = energy / total;
  s.median = quantile(0.5);
  s.p95 = quantile(0.95);
  s.largest = density[order.back()];
  return s;
}

// ==== HALF I, THE PAPER, ENDS HERE: THE PARTS BELOW MAKE IT A TOOL ===============================

namespace detail {

// ==== [16] CHECKED AND PREPARED MESHES ===========================================================
//
// Purpose:    find_problems() reports why a mesh cannot be mapped; Preparer repairs it.
// Invariants: sound parts stay unchanged, and so do ids where nothing is repaired.
// Fails:      returns problems, each with a sentence and ids.

/// Masks the caller's floating-point traps during its lifetime: unused SIMD lanes may divide by
/// zero, and some formulas over- or underflow by intent.
class NoTraps {
 public:
  NoTraps() { std::feholdexcept(&environment_); }
  NoTraps(const NoTraps&) = delete;
  NoTraps& operator=(const NoTraps&) = delete;
  ~NoTraps() { std::fesetenv(&environment_); }

 private:
  std::fenv_t environment_;
};

/// Fails if arithmetic is not IEEE's: then the predicates are not exact, and nothing is guaranteed.
inline bool check_arithmetic(Outcome& outcome) {
  return arithmetic_is_sound() ||
         fail(outcome, Status::kNumericalFailure,
              {"the arithmetic of this program is not IEEE's: compile the implementation without "
               "-ffast-math and its parts, and call it with rounding to nearest"});
}

// ---- validation ----

using Kind = Problem::Kind;

/// Collects at most kMostOfAKind problems of each kind, in given ids of `prepared`, if not null.
class ProblemList {
 public:
  static constexpr int kMostOfAKind = 20;
  explicit ProblemList(const Prepared* prepared = nullptr) : prepared_(prepared) {}
  int vertex(int v) const { return prepared_ ? prepared_->given_vertex.data()[v] : v; }
  int triangle(int f) const { return prepared_ ? prepared_->given_triangle.data()[f] : f; }
  void add(Kind kind, Words message, Element element = Element::kVertex,
           const std::vector<int>& ids = {}) {
    if (++count_[static_cast<int>(kind)] <= kMostOfAKind)
      problems.push_back({kind, sentence(message), element, ids});
  }
  /// Adds "vertex 3 is ...", "triangle 5 has ..."
  void add_vertex(Kind kind, int v, Words what) {
    add(kind, {"vertex ", vertex(v), sentence(what)}, Element::kVertex, {vertex(v)});
  }
  void add_triangle(Kind kind, int f, Words what) {
    add(kind, {"triangle ", triangle(f), sentence(what)}, Element::kFace, {triangle(f)});
  }
  std::vector<Problem> problems;

 private:
  const Prepared* prepared_;
  int count_[16] = {};
};

inline void check_numbers(const TriangleMesh& mesh, ProblemList& list) {
  const int n = static_cast<int>(mesh.vertices.rows());
  for (int v = 0; v < n; ++v)
    if (!is_finite(row3(mesh.vertices, v)))
      list.add_vertex(Kind::kNonFiniteCoordinate, v, {" has a coordinate that is not finite"});
  for (int h = 0; h < mesh.triangles.size(); ++h)
    if (const int v = mesh.triangles.data()[h]; v < 0 || v >= n)
      list.add_triangle(Kind::kIndexOutOfRange, h / 3,
                        {" refers to vertex ", v, ", but there are ", n, " vertices"});
}

/// Returns the defect of each triangle, or null. A triangle is degenerate if a vertex repeats, if
/// its height is below 1e-12 of its longest edge, or if its extent is below 1e-30 of the largest
/// one: fourth powers of the ratio must not underflow.
inline Array<const char*> triangle_defects(const Points3& vertices, const Triangles& F) {
  constexpr double kThinnest = 1e-12, kSmallest = 1e-30;
  const int n = static_cast<int>(F.rows());
  const auto edge = [&](int h) {
    return row3(vertices, F.data()[next(h)]) - row3(vertices, F.data()[h]);
  };
  Array<double> extent(n, 0);
  double largest = 0;
  for (int h = 0; h < 3 * n; ++h)
    for (int c = 0; c < 3; ++c) {
      extent[h / 3] = (std::max)(extent[h / 3], std::abs(edge(h)[c]));
      largest = (std::max)(largest, extent[h / 3]);
    }
  Array<const char*> defects(n, nullptr);
  for (int f = 0; f < n; ++f) {
    const double unit = unit_scale(extent[f]);  // so that squares neither over- nor underflow
    const Vec3 u = unit * edge(3 * f), v = unit * edge(3 * f + 1), w = unit * edge(3 * f + 2);
    const double longest2 = (std::max)({squared_norm(u), squared_norm(v), squared_norm(w)});
    const char*& defect = defects[f];
    if (extent[f] < kSmallest * largest) defect = " is smaller than 1e-30 of the largest triangle";
    if (!(norm(cross(u, v)) > kThinnest * longest2)) defect = " has no area";
    if (F(f, 0) == F(f, 1) || F(f, 1) == F(f, 2) || F(f, 2) == F(f, 0))
      defect = " uses a vertex twice";
  }
  return defects;
}

using Three = std::array<int, 3>;

inline Three ascending(int a, int b, int c) {
  Three three = {a, b, c};
  std::sort(three.begin(), three.end());
  return three;
}

inline void check_triangles(const TriangleMesh& mesh, ProblemList& list) {
  const Triangles& F = mesh.triangles;
  const Array<const char*> defects = triangle_defects(mesh.vertices, F);
  Array<std::pair<Three, int>> corners;
  for (int f = 0; f < F.rows(); ++f) {
    if (defects[f] != nullptr) list.add_triangle(Kind::kDegenerateTriangle, f, {defects[f]});
    corners.push_back({ascending(F(f, 0), F(f, 1), F(f, 2)), f});
  }
  std::sort(corners.begin(), corners.end());
  for (int i = 1; i < corners.size(); ++i) {
    if (corners[i].first != corners[i - 1].first) continue;
    const int f = list.triangle(corners[i - 1].second), g = list.triangle(corners[i].second);
    list.add(Kind::kRepeatedTriangle, {"triangles ", f, " and ", g, " have the same vertices"},
             Element::kFace, {f, g});
  }
}

inline void check_edges(const TriangleMesh& mesh, const Array<EdgeUse>& uses, ProblemList& list) {
  const int* const tail = mesh.triangles.data();
  for_each_edge(uses, [&](int begin, int end) {
    const EdgeUse &first = uses[begin], &last = uses[end - 1];
    const int n = end - begin;
    const bool runs_along = tail[first.half_edge] == tail[last.half_edge];
    if (n == 1 || (n == 2 && !runs_along) || first.lo == first.hi) return;
    std::vector<int> faces;
    for (int i = begin; i < end; ++i) faces.push_back(list.triangle(uses[i].half_edge / 3));
    const std::string edge = sentence({"edge ", list.vertex(first.lo), "-", list.vertex(first.hi)});
    if (n > 2)
      list.add(Kind::kNonManifoldEdge, {edge, " has ", n, " triangles: ", join(faces)},
               Element::kFace, faces);
    else
      list.add(Kind::kInconsistentOrientation,
               {"triangles ", join(faces), " run through ", edge, " in the same direction"},
               Element::kFace, faces);
  });
}

/// Finds unused vertices and, if triangles and edges are sound, those with more than one fan.
inline void check_fans(const HalfEdgeMesh& m, ProblemList& list) {
  const bool edges_are_sound = list.problems.empty();
  Array<int> incident(m.n_vertices, 0);
  for (int v : m.tail) ++incident[v];
  for (int v = 0; v < m.n_vertices; ++v) {
    int fan = 0;
    if (incident[v] == 0)
      list.add_vertex(Kind::kUnreferencedVertex, v, {" is used by no triangle"});
    else if (edges_are_sound)
      m.for_each_outgoing(v, [&](int) { ++fan; });
    if (edges_are_sound && fan != incident[v])
      list.add_vertex(Kind::kNonManifoldVertex, v,
                      {" joins ", incident[v], " triangles that form more than one fan"});
  }
}

inline void check_topology(const HalfEdgeMesh& m, ProblemList& list) {
  const int components = count_components(m);
  if (components > 1)
    list.add(Kind::kSeveralComponents, {"the mesh has ", components, " components, 1 is needed"});
  const int n_edges = (m.tail.size() + m.boundary.size()) / 2;
  const int chi = m.n_vertices - n_edges + m.n_faces;
  const int genus = (2 - m.loops() - chi) / 2;
  if (components != 1 || genus == 0) return;
  list.add(Kind::kHandles,
           {"the mesh has genus ", genus, ", and surfaces with handles cannot be mapped; cut it"});
}

/// Copies a buffer to a matrix; numbers beyond an int are clamped. No rows if there are no data or
/// more than kMost rows: internal lists have up to some 50 items per triangle of both meshes.
template <class T, bool are_ids>
Rows<T, 3> copied(const ArrayView<are_ids>& view) {
  constexpr std::ptrdiff_t kMost = 1 << 24;
  const bool is_there =
      view.data != nullptr && view.read != nullptr && view.rows > 0 && view.rows <= kMost;
  Rows<T, 3> copy(is_there ? view.rows : 0, 3);
  for (std::ptrdiff_t i = 0; i < copy.rows(); ++i)
    for (int c = 0; c < 3; ++c)
      copy.data()[3 * i + c] = rounded<T>(view.read(static_cast<const char*>(view.data) +
                                                    i * view.row_stride + c * view.column_stride));
  return copy;
}

inline SharedMesh shared(const MeshView& mesh) {
  return std::make_shared<const TriangleMesh>(
      TriangleMesh{copied<double>(mesh.positions), copied<int>(mesh.triangles)});
}

/// Finds the problems of a mesh, in given ids if it was prepared; if none, m is its connectivity.
inline std::vector<Problem> find_problems(const TriangleMesh& mesh, HalfEdgeMesh& m,
                                          const Prepared* prepared = nullptr) {
  const NoTraps no_traps;
  ProblemList list(prepared);
  if (mesh.vertices.rows() == 0 || mesh.triangles.rows() == 0) {
    list.add(Kind::kEmpty, {"the mesh has no vertices or no triangles, or more than 2^24 of "
                            "them, or not three numbers for each"});
    return list.problems;
  }
  check_numbers(mesh, list);
  if (!list.problems.empty()) return list.problems;  // the next checks read the vertices
  check_triangles(mesh, list);
  check_edges(mesh, sorted_edges(mesh.triangles), list);
  m = build_half_edges(static_cast<int>(mesh.vertices.rows()), mesh.triangles);
  check_fans(m, list);
  if (!list.problems.empty()) return list.problems;  // the next check walks the mesh
  check_topology(m, list);
  return list.problems;
}

// ---- preparation ----
//
// Method:     Boundary edges of different parts at equal coordinates are sewn: their vertices get
//             one place. Triangles are glued along edges: first where exactly two meet; where more
//             meet, pairs of one component, then pairs that bend least. Corners glued around a
//             place become one vertex, so edges that are not glued are cut.
// Invariants: triangles keep their order; a component has one orientation, unless it is one-sided;
//             a boundary that meets only itself, as closed lips do, is not sewn.

/// Returns "1 vertex", "2 vertices".
inline std::string counted(int n, const char* one, const char* many = nullptr) {
  return many == nullptr ? sentence({n, " ", one, n == 1 ? "" : "s"})
                         : sentence({n, " ", n == 1 ? one : many});
}

/// Returns true if a closed surface encloses a negative volume: the sum of signed tetrahedra
/// between a point and its triangles. A volume close to zero does not count.
inline bool is_inside_out(const TriangleMesh& mesh, const HalfEdgeMesh& m) {
  constexpr double kLeast = 1e-10;  // relative to area^(3/2)
  if (!m.boundary.empty()) return false;
  const double unit = unit_scale(mesh.vertices);
  const Vec3 origin = row3(mesh.vertices, m.tail[0]);
  const auto point = [&](int h) { return unit * (row3(mesh.vertices, m.tail[h]) - origin); };
  double volume = 0, area = 0;
  for (int h = 0; h < m.tail.size(); h += 3) {
    const Vec3 normal = cross(point(h + 1) - point(h), point(h + 2) - point(h));
    volume += dot(point(h), normal) / 6;
    area += norm(normal) / 2;
  }
  return volume < -kLeast * area * std::sqrt(area);
}

class Preparer {
 public:
  /// `welds`: vertices with equal coordinates may become one.
  Preparer(const TriangleMesh& given, const std::vector<LandmarkPoint>& landmarks, bool welds,
           Prepared& result)
      : given_(given),
        F_(given.triangles),
        n_vertices_(static_cast<int>(given.vertices.rows())),
        n_given_(static_cast<int>(F_.rows())),
        welds_(welds),
        result_(result),
        is_used_(n_vertices_, 0),
        has_landmark_(n_vertices_ + n_given_, 0),
        kept_copy_(numbers_below(n_vertices_)),
        places_(n_vertices_) {
    double largest = 0;
    for (int i = 0; i < F_.size(); ++i) {
      const Vec3 p = row3(given.vertices, F_.data()[i]);
      is_used_[F_.data()[i]] = 1;
      largest = (std::max)({largest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    }
    unit_ = unit_scale(largest);
    for (const LandmarkPoint& l : landmarks) {
      const int first = l.vertex >= 0 ? 0 : n_vertices_, n = l.vertex >= 0 ? n_vertices_ : n_given_;
      const int at = l.vertex >= 0 ? l.vertex : l.point.face;
      if (at >= 0 && at < n) has_landmark_[first + at] = 1;
    }
  }

  void run() {
    find_spots();
    find_parts();
    take_triangles();
    glue_all();
    choose_component();
    if (kept_ < 0) return add_problem(Kind::kEmpty, "no triangle is left");
    if (sides_.find(kept_) == sides_.find(kept_ + n_triangles()))
      return add_problem(Kind::kNotOrientable,
                         "the surface has one side only, as a Möbius strip has");
    build();
    HalfEdgeMesh m;
    result_.problems = find_problems(*result_.mesh, m, &result_);
    const bool is_turned = result_.problems.empty() && is_inside_out(*result_.mesh, m);
    if (is_turned) turns_ = !turns_, build();
    note_all(is_turned);
    for (int v = 0; v < n_vertices_; ++v)  // dropped ones, with repeated triangles
      if (result_.new_vertex.data()[v] < 0)
        result_.new_vertex.data()[v] = result_.new_vertex.data()[kept_copy_[v]];
  }

 private:
  void add_problem(Kind kind, const char* message) {
    result_.problems.assign(1, {kind, message, Element::kFace, {}});
  }

  int vertex(int h) const { return F_.data()[corner_[h]]; }
  int place(int h) const { return place_[vertex(h)]; }
  int spot(int h) const { return spot_[vertex(h)]; }
  int part(int h) const { return part_[vertex(h)]; }
  Vec3 point(int h) const { return unit_ * row3(given_.vertices, place(h)); }
  double length(int h) const { return norm(point(next(h)) - point(h)); }
  int n_triangles() const { return source_.size(); }

  /// Returns the normal of a triangle; its length is twice the area.
  Vec3 normal(int f) const {
    const int h = 3 * f;
    return cross(point(h + 1) - point(h), point(h + 2) - point(h));
  }
  double double_area(int f) const { return norm(normal(f)); }

  /// Finds the spot of each vertex: the first vertex with the same coordinates.
  void find_spots() {
    Array<std::pair<std::array<double, 3>, int>> order;
    for (int v = 0; v < n_vertices_; ++v) {
      const Vec3 p = row3(given_.vertices, v);
      if (welds_ && is_used_[v]) order.push_back({{p.x, p.y, p.z}, v});
    }
    std::sort(order.begin(), order.end());
    spot_ = numbers_below(n_vertices_);
    for (int i = 1; i < order.size(); ++i)
      if (order[i].first == order[i - 1].first) spot_[order[i].second] = spot_[order[i - 1].second];
  }

  /// Finds the parts of the given mesh, connected by common vertices, and ranks them by landmarks,
  /// then triangles: of parts that lie on each other, the first one stays.
  void find_parts() {
    DisjointSets sets(n_vertices_);
    for (int i = 0; i < F_.size(); ++i) sets.unite(F_.data()[i], F_.data()[i - i % 3]);
    Array<Three> order;  // negative counts of landmarks and triangles, vertex
    for (int v = 0; v < n_vertices_; ++v) order.push_back({0, 0, v});
    for (int f = 0; f < n_given_; ++f) --order[sets.find(F_(f, 0))][1];
    for (int i = 0; i < has_landmark_.size(); ++i)
      order[sets.find(i < n_vertices_ ? i : F_(i - n_vertices_, 0))][0] -= has_landmark_[i];
    std::sort(order.begin(), order.end());
    Array<int> rank(n_vertices_);
    for (int i = 0; i < n_vertices_; ++i) rank[order[i][2]] = i;
    part_.resize(n_vertices_);
    for (int v = 0; v < n_vertices_; ++v) part_[v] = rank[sets.find(v)];
  }

  /// Takes all triangles except repeated and degenerate ones; sews the parts.
  void take_triangles() {
    source_ = numbers_below(n_given_);
    corner_ = numbers_below(3 * n_given_);
    place_ = numbers_below(n_vertices_);
    drop_repeated(spot_);
    sew();
    drop_collapsed();
    mend_flat();
    drop_repeated(place_);
    sort_unique(repeated_);
  }

  template <class IsDropped>
  void drop(const IsDropped& is_dropped) {
    int n = 0;
    for (int f = 0; f < n_triangles(); ++f) {
      if (is_dropped(f)) continue;
      for (int k = 0; k < 3; ++k) corner_[3 * n + k] = corner_[3 * f + k];
      source_[n++] = source_[f];
    }
    source_.resize(n);
    corner_.resize(3 * n);
  }

  void drop_collapsed() {
    drop([&](int f) {
      const int p = place(3 * f), q = place(3 * f + 1), r = place(3 * f + 2);
      return p == q || q == r || r == p;
    });
  }

  /// Keeps one of several triangles with the same corners in `at`, that of the first part. If they
  /// are of one part and have no common vertex, as at closed lips, all stay.
  void drop_repeated(const Array<int>& at) {
    const auto corners = [&](const Array<int>& a, int f) {
      return ascending(a[vertex(3 * f)], a[vertex(3 * f + 1)], a[vertex(3 * f + 2)]);
    };
    Array<std::tuple<Three, int, Three, int>> order;  // `at`, part, places, triangle
    for (int f = 0; f < n_triangles(); ++f)
      order.push_back({corners(at, f), part(3 * f), corners(place_, f), f});
    std::sort(order.begin(), order.end());
    Array<char> is_dropped(n_triangles(), 0);
    for (int i = 1, first = 0; i < order.size(); ++i) {
      const auto& [spots, from, places, f] = order[i];
      if (spots != std::get<0>(order[first])) first = i;
      if (i == first) continue;
      if (from == std::get<1>(order[first]) && places != std::get<2>(order[i - 1])) continue;
      is_dropped[f] = 1;
      repeated_.push_back(source_[f]);
      const int kept = std::get<3>(order[first]);
      for (int h = 3 * f; h < 3 * f + 3; ++h)
        for (int t = 3 * kept; t < 3 * kept + 3; ++t)
          if (at[vertex(h)] == at[vertex(t)]) kept_copy_[vertex(h)] = vertex(t);
    }
    drop([&](int f) { return is_dropped[f] != 0; });
  }

  /// Unites places of vertices where edges of different parts have the same spots. A boundary loop
  /// with such an edge is a seam; edges of seams with the same spots are sewn, too, even within one
  /// part. A loop that meets no other part is not sewn.
  void sew() {
    DisjointSets loops(n_vertices_);
    Array<char> is_border(corner_.size(), 0), is_seam(n_vertices_, 0);
    Array<EdgeUse> edges;
    const Array<EdgeUse> uses = edge_uses();
    for_each_edge(uses, [&](int begin, int end) {
      const int h = uses[begin].half_edge, t = next(h);
      if (spot(h) == spot(t) || spot(t) == spot(prev(h)) || spot(prev(h)) == spot(h)) return;
      is_border[h] = end - begin == 1;
      if (is_border[h]) loops.unite(vertex(h), vertex(t));
      edges.push_back(edge_use(h, spot_));
    });
    std::sort(edges.begin(), edges.end());
    const auto is_shared = [&](int begin, int end) {
      for (int i = begin; i < end; ++i)
        if (part(edges[i].half_edge) != part(edges[begin].half_edge)) return true;
      return false;
    };
    for_each_edge(edges, [&](int begin, int end) {
      if (!is_shared(begin, end)) return;
      for (int i = begin; i < end; ++i)
        if (const int h = edges[i].half_edge; is_border[h]) is_seam[loops.find(vertex(h))] = 1;
    });
    for_each_edge(edges, [&](int begin, int end) {
      const bool is_common = is_shared(begin, end);
      int first = -1;
      for (int i = begin; i < end; ++i) {
        const int h = edges[i].half_edge;
        if (is_border[h] ? !is_seam[loops.find(vertex(h))] : !is_common) continue;
        if (first < 0) first = h;
        const bool runs_along = spot(h) == spot(first);
        places_.unite(vertex(h), vertex(runs_along ? first : next(first)));
        places_.unite(vertex(next(h)), vertex(runs_along ? next(first) : first));
      }
    });
    update_places();
  }

  void update_places() {
    for (int v = 0; v < n_vertices_; ++v) place_[v] = places_.find(v);
  }

  // ---- degenerate triangles ----

  /// Removes degenerate triangles without leaving gaps, in rounds: repairs may create new ones.
  void mend_flat() {
    constexpr int kRounds = 50;
    for (int round = 0; round < kRounds; ++round) {
      const Array<int> flat = flat_triangles();
      bool has_changed = false;
      for (int f : flat) has_changed |= unite_short_edge(f);
      if (has_changed) {
        update_places();
        drop_collapsed();
        continue;
      }
      if (flat.empty()) return;
      const Array<EdgeUse> uses = edge_uses();
      for (int f : flat) has_changed |= give_to_neighbour(f, uses);
      if (!has_changed) break;
    }
    const Array<int> flat = flat_triangles();
    drop([&](int f) { return std::binary_search(flat.begin(), flat.end(), f); });
  }

  Array<int> flat_triangles() const {
    Triangles at_places(n_triangles(), 3);
    for (int h = 0; h < corner_.size(); ++h) at_places.data()[h] = place(h);
    const Array<const char*> defects = triangle_defects(given_.vertices, at_places);
    return numbers_where(n_triangles(), [&](int f) { return defects[f] != nullptr; });
  }

  /// Unites the ends of the shortest edge of a triangle if it is short relative to the longest one,
  /// or if the triangle has a height, and so is tiny relative to the mesh. Returns true if it did.
  bool unite_short_edge(int f) {
    constexpr double kShort = 1e-11;  // of the longest edge, so that there is room for halves
    int shortest = 3 * f;
    double longest = 0;
    for (int h = 3 * f; h < 3 * f + 3; ++h) {
      if (length(h) < length(shortest)) shortest = h;
      longest = (std::max)(longest, length(h));
    }
    const bool has_height = double_area(f) > kShort * longest * longest;
    if (length(shortest) > kShort * longest && !has_height) return false;
    places_.unite(vertex(shortest), vertex(next(shortest)));
    return true;
  }

  /// Splits the triangle behind the longest edge of a flat one, at the corner that lies on that
  /// edge. Returns false unless exactly one is there: otherwise the flat one leaves no gap.
  bool give_to_neighbour(int cap, const Array<EdgeUse>& uses) {
    int longest = 3 * cap;
    for (int h = 3 * cap; h < 3 * cap + 3; ++h)
      if (length(h) > length(longest)) longest = h;
    const EdgeUse edge = edge_use(longest, place_);
    const EdgeUse* use = std::lower_bound(uses.begin(), uses.end(), EdgeUse(edge.lo, edge.hi, -1));
    int behind = -1, count = 0;
    for (; use != uses.end() && use->same_edge(edge); ++use) {
      const int h = use->half_edge;
      if (h / 3 == cap || !edge_use(h, place_).same_edge(edge)) continue;  // it has been cut since
      behind = h;
      ++count;
    }
    if (count != 1) return false;
    const int to = next(behind), left = prev(behind), middle = corner_[prev(longest)];
    corner_[3 * cap] = middle;
    corner_[3 * cap + 1] = corner_[to];
    corner_[3 * cap + 2] = corner_[left];
    corner_[to] = middle;
    source_[cap] = source_[behind / 3];
    return true;
  }

  EdgeUse edge_use(int h, const Array<int>& at) const {
    return {at[vertex(h)], at[vertex(next(h))], h};
  }

  Array<EdgeUse> edge_uses() const {
    return sorted_edges(corner_.size(), [&](int h) { return place(h); });
  }

  // ---- gluing ----

  void glue_all() {
    twin_.assign(corner_.size(), -1);
    corners_ = DisjointSets(corner_.size());
    sides_ = DisjointSets(2 * n_triangles());
    const Array<EdgeUse> uses = edge_uses();
    for_each_edge(uses, [&](int begin, int end) {
      Array<int> here;  // the half-edges between the same two places
      for (int i = begin; i < end; ++i) here.push_back(uses[i].half_edge);
      if (here.size() == 2) glue(here[0], here[1]);
      if (here.size() > 2) crowded_.push_back(here);
    });
    for (const Array<int>& here : crowded_) glue_crowded(here);
  }

  /// Glues two triangles along an edge: their corners there become common vertices, and those of
  /// their sides that traverse the edge in opposite directions become one side of a component.
  void glue(int h, int t) {
    const int n = n_triangles(), f = h / 3, g = t / 3;
    const bool runs_along = place(h) == place(t);
    twin_[h] = t, twin_[t] = h;
    corners_.unite(h, runs_along ? t : next(t));
    corners_.unite(next(h), runs_along ? next(t) : t);
    sides_.unite(f, runs_along ? g + n : g);
    sides_.unite(f + n, runs_along ? g : g + n);
  }

  /// Returns the first triangle of a component, which also defines its orientation.
  int component(int f) { return (std::min)(sides_.find(f), sides_.find(f + n_triangles())); }
  bool is_turned(int f) { return sides_.find(f) > sides_.find(f + n_triangles()); }

  bool is_same_edge(int h, int t) const {
    return EdgeUse(vertex(h), vertex(next(h)), h).same_edge({vertex(t), vertex(next(t)), t});
  }

  /// Glues triangles at an edge with more than two in pairs: pairs within a component first, then
  /// pairs with the same given vertices, then pairs that bend least.
  void glue_crowded(const Array<int>& here) {
    if (here.size() > kHub) return;  // repeated comparison of all pairs would take too long
    for (int left = here.size(); left >= 2; left -= 2) {
      int best_h = -1, best_t = -1;
      double least = kInfinity;
      for (int i = 0; i < here.size(); ++i)
        for (int k = i + 1; k < here.size(); ++k)
          if (const double cost = cost_to_glue(here[i], here[k]); cost < least)
            least = cost, best_h = here[i], best_t = here[k];
      if (best_h < 0) return;
      glue(best_h, best_t);
    }
  }

  /// Returns infinity if one is glued already, or if gluing would make a component one-sided.
  double cost_to_glue(int h, int t) {
    constexpr double kOtherComponent = 10, kOtherVertices = 5;  // a bend is in [-1, 1]
    if (twin_[h] >= 0 || twin_[t] >= 0) return kInfinity;
    const int f = h / 3, g = t / 3;
    const bool is_other = component(f) != component(g), runs_along = place(h) == place(t);
    const int side_of_g = runs_along ? g + n_triangles() : g;
    if (!is_other && sides_.find(f) != sides_.find(side_of_g)) return kInfinity;
    const double bend = dot(normalized(normal(f)), normalized(normal(g)));
    return (is_other ? kOtherComponent : 0) + (is_same_edge(h, t) ? 0 : kOtherVertices) +
           (runs_along ? bend : -bend);
  }

  // ---- the kept component ----

  /// Chooses the component with most landmarks, then the largest, and the orientation that most of
  /// its area has.
  void choose_component() {
    Array<std::array<int, 2>> found;  // component, landmark
    for (int h = 0; h < corner_.size(); ++h)
      for (int at : {vertex(h), n_vertices_ + source_[h / 3]})
        if (has_landmark_[at]) found.push_back({component(h / 3), at});
    sort_unique(found);
    Array<std::array<double, 2>> score(n_triangles());  // landmarks and area
    for (const std::array<int, 2>& landmark : found) ++score[landmark[0]][0];
    for (int f = 0; f < n_triangles(); ++f) score[component(f)][1] += double_area(f);
    if (score.empty()) return;
    kept_ = static_cast<int>(std::max_element(score.begin(), score.end()) - score.begin());
    members_ = numbers_where(n_triangles(), [&](int f) { return component(f) == kept_; });
    double turned = 0;
    for (int f : members_) turned += is_turned(f) ? double_area(f) : -double_area(f);
    turns_ = turned > 0;
  }

  void build() {
    Array<std::array<int, 2>> order;  // given vertex, set of corners
    for (int f : members_)
      for (int h = 3 * f; h < 3 * f + 3; ++h) order.push_back({vertex(h), corners_.find(h)});
    std::sort(order.begin(), order.end());
    Array<int> id(corner_.size(), -1), given_vertex;  // per set, its vertex; its first given one
    for (const auto& [v, corners] : order) {
      if (id[corners] >= 0) continue;
      id[corners] = given_vertex.size();
      given_vertex.push_back(v);
    }
    TriangleMesh mesh = {Points3(given_vertex.size(), 3), Triangles(members_.size(), 3)};
    for (int v = 0; v < given_vertex.size(); ++v)
      set_row(mesh.vertices, v, row3(given_.vertices, given_vertex[v]));
    result_.given_vertex = given_vertex;
    result_.given_corner.clear(), result_.given_triangle.clear();
    result_.new_vertex = Array<int>(n_vertices_, -1);
    result_.new_triangle = Array<int>(n_given_, -1);
    over_.clear(), cut_.clear();
    for (int i = 0; i < members_.size(); ++i) {
      const int f = members_[i];
      const bool turns = is_turned(f) != turns_;
      if (turns) over_.push_back(source_[f]);
      result_.given_triangle.push_back(source_[f]);
      int& new_triangle = result_.new_triangle.data()[source_[f]];
      if (new_triangle < 0) new_triangle = i;
      for (int k : {0, 1, 2}) {
        const int h = 3 * f + (turns ? (3 - k) % 3 : k), v = id[corners_.find(h)];
        mesh.triangles(i, k) = v;
        result_.given_corner.push_back(corner_[h]);
        int& new_vertex = result_.new_vertex.data()[vertex(h)];
        if (new_vertex >= 0 && new_vertex != v) cut_.push_back(vertex(h));
        if (new_vertex < 0 || v < new_vertex) new_vertex = v;
      }
    }
    result_.mesh = std::make_shared<const TriangleMesh>(std::move(mesh));
    sort_unique(over_);
    sort_unique(cut_);
  }

  // ---- reports ----

  /// Reports all repairs; `is_turned`: the surface was inside out.
  void note_all(bool is_turned) {
    note_dropped();
    note_welded();
    note_cut_edges();
    note(Kind::kNonManifoldVertex,
         {"cut the surface apart at ", counted(cut_.size(), "vertex", "vertices")}, cut_);
    note(Kind::kInconsistentOrientation,
         {"turned ", counted(over_.size(), "triangle"), " over",
          is_turned ? ": most of the surface was inside out" : ""},
         over_);
    note_components();
    const Array<int> unused = numbers_where(n_vertices_, [&](int v) { return !is_used_[v]; });
    note(Kind::kUnreferencedVertex,
         {"dropped ", counted(unused.size(), "vertex", "vertices"), " that no triangle uses"},
         unused);
  }

  void note(Kind kind, Words message, const Array<int>& ids) {
    const bool are_vertices = kind == Kind::kNonManifoldVertex || kind == Kind::kUnwelded ||
                              kind == Kind::kUnreferencedVertex;
    const Element element = are_vertices ? Element::kVertex : Element::kFace;
    if (!ids.empty()) result_.repairs.push_back({kind, sentence(message), element, ids});
  }

  void note_dropped() {
    Array<char> is_known(n_given_, 0);
    for (int f : source_) is_known[f] = 1;
    for (int f : repeated_) is_known[f] = 1;
    const Array<int> degenerate = numbers_where(n_given_, [&](int f) { return !is_known[f]; });
    note(Kind::kDegenerateTriangle, {"dropped ", counted(degenerate.size(), "degenerate triangle")},
         degenerate);
    note(Kind::kRepeatedTriangle, {"dropped ", counted(repeated_.size(), "repeated triangle")},
         repeated_);
  }

  void note_welded() {
    const auto kept = [&](int v) { return result_.new_vertex.data()[v]; };
    const Array<int> all = numbers_where(n_vertices_, [&](int v) { return kept(v) >= 0; });
    const Array<int> welded = numbers_where(n_vertices_, [&](int v) {
      return kept(v) >= 0 && result_.given_vertex.data()[kept(v)] != v;
    });
    note(Kind::kUnwelded, {"welded ", all.size(), " vertices to ", all.size() - welded.size()},
         welded);
  }

  void note_cut_edges() {
    int n = 0;
    Array<int> triangles;
    for (const Array<int>& here : crowded_) {
      if (!is_cut(here)) continue;
      ++n;
      for (int h : here) triangles.push_back(source_[h / 3]);
    }
    sort_unique(triangles);
    note(Kind::kNonManifoldEdge, {"cut ", counted(n, "edge"), " of more than two triangles"},
         triangles);
  }

  /// Returns true if a kept triangle at an edge was cut from another one.
  bool is_cut(const Array<int>& here) {
    for (int h : here) {
      if (component(h / 3) != kept_) continue;
      if (twin_[h] < 0) return true;
      for (int t : here)
        if (t != h && t != twin_[h] && is_same_edge(h, t)) return true;
    }
    return false;
  }

  void note_components() {
    Array<int> dropped, elsewhere;
    for (int f = 0; f < n_triangles(); ++f) {
      if (component(f) == kept_) continue;
      dropped.push_back(component(f));
      elsewhere.push_back(source_[f]);
    }
    sort_unique(dropped);
    sort_unique(elsewhere);
    note(Kind::kSeveralComponents,
         {"dropped ", counted(dropped.size(), "component"), ", ",
          counted(elsewhere.size(), "triangle")},
         elsewhere);
  }

  const TriangleMesh& given_;
  const Triangles& F_;
  const int n_vertices_, n_given_;  // vertices and triangles given
  const bool welds_;
  Prepared& result_;
  double unit_ = 1;                   // scale of lengths
  Array<char> is_used_;               // per given vertex, true if a triangle uses it
  Array<char> has_landmark_;          // given vertices, then given triangles
  Array<int> spot_;                   // per given vertex, the first one at its coordinates
  Array<int> part_;                   // per given vertex, the rank of its part; 0 is kept first
  Array<int> kept_copy_;              // per given vertex, its copy in the triangle kept instead
  DisjointSets places_;               // sets of given vertices at one place,
  Array<int> place_;                  // and per vertex, the first one of its set
  Array<int> source_;                 // per remaining triangle, the given one that contains it
  Array<int> corner_;                 // per corner of these, the given one
  Array<int> twin_;                   // per half-edge of these, the one it is glued to, or -1
  DisjointSets corners_;              // sets of corners that are one vertex
  DisjointSets sides_;                // sides of components: sets of triangles' fronts and backs
  int kept_ = -1;                     // the kept component,
  Array<int> members_;                // its triangles,
  bool turns_ = false;                // and its orientation, true for that of the backs
  Array<Array<int>> crowded_;         // edges with more than two half-edges
  Array<int> repeated_, over_, cut_;  // given triangles dropped or turned, vertices cut
};

/// Returns true if all ids are in range and all vertices in use are finite.
inline bool is_readable(const TriangleMesh& mesh, const std::vector<Problem>& problems) {
  for (const Problem& p : problems)
    if (p.kind <= Kind::kIndexOutOfRange) return false;
  for (int i = 0; i < mesh.triangles.size(); ++i)
    if (!is_finite(row3(mesh.vertices, mesh.triangles.data()[i]))) return false;
  return true;
}

/// Prepares without welding if only welding leaves problems: it may undo cuts along handles.
inline Prepared prepared(const SharedMesh& given, const std::vector<LandmarkPoint>& landmarks,
                         bool welds) {
  const NoTraps no_traps;
  HalfEdgeMesh m;
  Prepared before = as_given(given);
  const std::vector<Problem>& problems = before.problems = find_problems(*given, m);
  const bool is_clean =
      problems.empty() ? !is_inside_out(*given, m) : problems[0].kind == Kind::kHandles;
  if (is_clean || !is_readable(*given, problems)) return before;
  Prepared welded = before;
  if (welds) Preparer(*given, landmarks, true, welded).run();
  if (welds && welded.problems.empty()) return welded;
  Prepared not_welded = before;
  Preparer(*given, landmarks, false, not_welded).run();
  const bool is_whole = not_welded.mesh->triangles.rows() >= welded.mesh->triangles.rows();
  return !welds || (not_welded.problems.empty() && is_whole) ? not_welded : welded;
}

// ---- small openings ----

/// Closes the openings of a surface, each by a fan around a vertex that comes after all others.
/// Returns null if one is longer than the end of a tube of ten diameters (laid out flat, rings
/// around it shrink as exp(-length / radius)), or if a fan would not be a surface.
inline SharedPrepared with_openings_closed(const SharedPrepared& open) {
  const Surface s = build_surface(*open->mesh, false);
  const HalfEdgeMesh& m = s.mesh;
  if (is_closed(s)) return open;
  if (!(kLongTube * loop_length(s, outer_loop(s, -1)) < std::sqrt(s.total_area))) return nullptr;
  Prepared p = *open;
  TriangleMesh mesh = *p.mesh;
  mesh.vertices.conservativeResize(m.n_vertices + m.loops(), 3);
  mesh.triangles.conservativeResize(m.n_faces + m.boundary.size(), 3);
  for (int i = 0; i < m.loops(); ++i) {
    Vec3 sum;
    for (int k = m.loop[i]; k < m.loop[i + 1]; ++k) {
      const int h = m.boundary[k];
      sum += row3(mesh.vertices, m.tail[h]);
      mesh.triangles.row(m.n_faces + k) << m.tip(h), m.tail[h], m.n_vertices + i;
    }
    set_row(mesh.vertices, m.n_vertices + i, 1.0 / (m.loop[i + 1] - m.loop[i]) * sum);
  }
  p.mesh = std::make_shared<const TriangleMesh>(std::move(mesh));
  p.given_vertex.resize(static_cast<std::size_t>(p.mesh->vertices.rows()), -1);
  p.given_corner.resize(static_cast<std::size_t>(p.mesh->triangles.size()), -1);
  p.given_triangle.resize(static_cast<std::size_t>(p.mesh->triangles.rows()), -1);
  HalfEdgeMesh closed;
  const bool is_surface = find_problems(*p.mesh, closed).empty();
  return is_surface ? std::make_shared<const Prepared>(std::move(p)) : nullptr;
}

// ==== [17] ALIGNMENTS IN SPACE ===================================================================
//
// Purpose:    finds corresponding points of two surfaces of about one shape and pose, at any
//             position in space.
// Method:     iterative closest points in position and normal [Besl and McKay 1992], from the 60
//             rotations of the icosahedron between their principal axes; every rotation is within
//             45 degrees of one. The best ones continue with more points, at last by affine maps.
// Fails:      never; where shapes or poses differ, the pairs are wrong, and so is a map by them.

/// A point of a surface with its normal.
struct SurfaceSample {
  Vec3 point, normal;
  SurfacePoint on;
};

/// Takes n samples evenly by area: along the triangles in order, in each by an additive recurrence.
inline Array<SurfaceSample> sampled(const Surface& s, int n) {
  Array<SurfaceSample> samples;
  const HalfEdgeMesh& m = s.mesh;
  double passed = 0;
  for (int f = 0; f < m.n_faces; ++f) {
    const Vec3 a = s.corner(f, 0), b = s.corner(f, 1), c = s.corner(f, 2);
    passed += s.area[f];
    while (samples.size() < n && (samples.size() + 0.5) * s.total_area <= n * passed) {
      constexpr double kStep[2] = {0.7548776662466927, 0.5698402909980532};
      const double i = samples.size() + 1, u = i * kStep[0], v = i * kStep[1];
      double s1 = u - std::floor(u), s2 = v - std::floor(v);
      if (s1 + s2 > 1) s1 = 1 - s1, s2 = 1 - s2;
      const Vec3 weights = {1 - s1 - s2, s1, s2};
      samples.push_back({weights.x * a + weights.y * b + weights.z * c,
                         normalized(cross(b - a, c - a)), surface_point(f, weights)});
    }
  }
  return samples;
}

/// p → L p + shift, L by columns.
struct AffineMap {
  Vec3 column[3] = {unit3(0), unit3(1), unit3(2)};
  Vec3 shift = {};

  Vec3 linear(const Vec3& p) const { return p.x * column[0] + p.y * column[1] + p.z * column[2]; }
  SurfaceSample operator()(SurfaceSample s) const {
    s.point = linear(s.point) + shift;
    s.normal = normalized(cofactors().linear(s.normal));
    return s;
  }
  /// det(L) L⁻ᵀ, which maps normals.
  AffineMap cofactors() const {
    return {
        {cross(column[1], column[2]), cross(column[2], column[0]), cross(column[0], column[1])}};
  }
  double determinant() const { return dot(column[0], cross(column[1], column[2])); }
};

inline AffineMap transposed(const AffineMap& m) {
  AffineMap t;
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r) t.column[c][r] = m.column[r][c];
  return t;
}

inline AffineMap product(const AffineMap& a, const AffineMap& b) {
  AffineMap c;
  for (int i = 0; i < 3; ++i) c.column[i] = a.linear(b.column[i]);
  return c;
}

/// Returns unit eigenvectors of a symmetric matrix, a rotation, by descending eigenvalues.
inline AffineMap eigenvectors(const AffineMap& m) {
  LaneMatrix<3> a;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c <= r; ++c) a(r, c) = m.column[c][r];
  LaneEigen<3> eigen;
  eigen.decompose(a);
  Array<double> value;
  for (const Lanes& lanes : eigen.value) value.push_back(-lanes[0]);
  const Array<int> order = sorted_by(value);
  AffineMap axes;
  for (int i = 0; i < 2; ++i)
    for (int k = 0; k < 3; ++k) axes.column[i][k] = eigen.vector[order[i]][k][0];
  axes.column[2] = cross(axes.column[0], axes.column[1]);
  return axes;
}

/// Returns the rotation R with the largest trace of Rᵀ m [Kabsch 1976]: it takes the eigenvectors
/// of mᵀ m to their images by m, made unit vectors, the last one by orientation.
inline AffineMap nearest_rotation(const AffineMap& m) {
  const AffineMap from = eigenvectors(product(transposed(m), m));
  const Vec3 u = normalized(m.linear(from.column[0]));
  const Vec3 w = normalized(cross(u, m.linear(from.column[1])));
  return product({{u, cross(w, u), w}, {}}, transposed(from));
}

/// Returns the 60 rotations of the icosahedron, the identity first: all products of the cyclic
/// exchange of axes and a fifth of a turn.
inline Array<AffineMap> icosahedral_rotations() {
  constexpr double kHalf = 0.5, kLong = 0.80901699437494742, kShort = kLong - kHalf;  // φ/2, 1/(2φ)
  const AffineMap cycle = {{unit3(1), unit3(2), unit3(0)}};
  const AffineMap fifth = {
      {{kHalf, kLong, kShort}, {-kLong, kShort, kHalf}, {kShort, -kHalf, kLong}}};
  Array<AffineMap> rotations(1, AffineMap());
  for (int i = 0; i < rotations.size(); ++i)
    for (const AffineMap& generator : {cycle, fifth}) {
      const AffineMap next = product(generator, rotations[i]);
      const auto is_next = [&](const AffineMap& m) {
        return norm(m.column[0] - next.column[0]) + norm(m.column[1] - next.column[1]) < kHalf;
      };
      if (std::none_of(rotations.begin(), rotations.end(), is_next)) rotations.push_back(next);
    }
  return rotations;
}

inline Vec3 mean(const Array<SurfaceSample>& samples) {
  Vec3 sum;
  for (const SurfaceSample& s : samples) sum += 1.0 / samples.size() * s.point;
  return sum;
}

/// Returns the axes of the second moments of samples, the longest first, as columns of a rotation.
/// Their signs do not matter: half-turns about them are among the rotations of the icosahedron.
inline AffineMap principal_axes(const Array<SurfaceSample>& samples) {
  const Vec3 center = mean(samples);
  AffineMap moments = {{{}, {}, {}}, {}};
  for (const SurfaceSample& s : samples)
    for (int c = 0; c < 3; ++c) moments.column[c] += (s.point - center)[c] * (s.point - center);
  return eigenvectors(moments);
}

/// Squared distance in position and normal, at total area 1.
inline double distance2(const SurfaceSample& p, const SurfaceSample& q) {
  constexpr double kNormal = 0.1;  // a right angle counts as almost half of the size
  return squared_norm(p.point - q.point) + kNormal * squared_norm(p.normal - q.normal);
}

inline int closest(const SurfaceSample& p, const Array<SurfaceSample>& among, int n) {
  int best = 0;
  double least = kInfinity;
  for (int i = 0; i < n; ++i) {
    if (squared_norm(p.point - among[i].point) >= least) continue;
    const double d = distance2(p, among[i]);
    if (d < least) least = d, best = i;
  }
  return best;
}

/// Samples of two surfaces, followed by those at the ends of landmarks.
struct SamplePair {
  Array<SurfaceSample> a, b;
  int n = 0;  // of samples, on either
};

/// An affine map of samples of A close to samples of B.
class Alignment {
 public:
  Alignment(const SamplePair& pair, const AffineMap& map) : pair_(&pair), map_(map) { move(); }

  /// Fits a similarity to the landmarks.
  explicit Alignment(const SamplePair& pair) : pair_(&pair) { improve(false); }

  /// Improves the map by a round of closest points; nothing changes once they stay the same.
  void improve(bool is_affine) {
    if (is_settled_ && is_affine == was_affine_) return;
    const Array<int> to_b = to_b_, to_a = to_a_;
    fit(is_affine);
    move();
    is_settled_ = to_b == to_b_ && to_a == to_a_;
    was_affine_ = is_affine;
  }

  const AffineMap& map() const { return map_; }
  double residual() const { return residual_; }

  /// True if another map takes A to nearly the same place.
  bool is_like(const Alignment& other) const {
    constexpr double kNear = 0.05;
    double sum = 0;
    for (const SurfaceSample& s : pair_->a) sum += norm(map_(s).point - other.map_(s).point);
    return sum < kNear * pair_->a.size();
  }

  /// Returns the pairs that are closest in both directions and have similar normals.
  Array<std::array<int, 2>> mutual_pairs() const {
    constexpr double kBack = 0.05, kAgree = 0.5;
    Array<std::array<int, 2>> pairs;
    for (int i = 0; i < pair_->n; ++i) {
      const int j = to_b_[i], back = to_a_[j];
      const SurfaceSample &p = moved_[i], &q = pair_->b[j];
      if (norm(pair_->a[back].point - pair_->a[i].point) < kBack &&
          dot(p.normal, q.normal) > kAgree)
        pairs.push_back({{i, j}});
    }
    return pairs;
  }

 private:
  /// Moves A, and pairs its samples with the closest ones.
  void move() {
    const Array<SurfaceSample>& b = pair_->b;
    double sum_a = 0, sum_b = 0;
    moved_.clear(), to_b_.clear(), to_a_.clear();
    for (const SurfaceSample& s : pair_->a) moved_.push_back(map_(s));
    for (int i = 0; i < pair_->n; ++i) {
      to_b_.push_back(closest(moved_[i], b, pair_->n));
      to_a_.push_back(closest(b[i], moved_, pair_->n));
      sum_a += distance2(moved_[i], b[to_b_.back()]);
      sum_b += distance2(b[i], moved_[to_a_.back()]);
    }
    residual_ = 0.5 * (sum_a / pair_->n + sum_b / pair_->n);
  }

  /// Calls visit(sample of A, where it should go, weight).
  template <class Visit>
  void for_each_pair(const Visit& visit) const {
    constexpr double kLandmark = 10;  // as much as so many samples
    for (int i = 0; i < to_b_.size(); ++i) visit(i, pair_->b[to_b_[i]].point, 1);
    for (int j = 0; j < to_a_.size(); ++j) visit(to_a_[j], pair_->b[j].point, 1);
    for (int i = pair_->n; i < pair_->a.size(); ++i) visit(i, pair_->b[i].point, kLandmark);
  }

  /// Fits the similarity, or an affine map held close to it, with least squared distances.
  void fit(bool is_affine) {
    constexpr double kRigid = 0.1;
    Vec3 p0, q0;
    double total = 0;
    for_each_pair([&](int i, const Vec3& q, double weight) {
      p0 += weight * pair_->a[i].point, q0 += weight * q;
      total += weight;
    });
    p0 = 1 / total * p0, q0 = 1 / total * q0;
    AffineMap M = {{{}, {}, {}}, {}}, P = M;  // Σ q pᵀ and Σ p pᵀ about the means
    for_each_pair([&](int i, const Vec3& q, double weight) {
      const Vec3 p = weight / total * (pair_->a[i].point - p0);
      for (int c = 0; c < 3; ++c) {
        M.column[c] += p[c] * (q - q0);
        P.column[c] += p[c] * (pair_->a[i].point - p0);
      }
    });
    AffineMap L = nearest_rotation(M);
    const double spread = P.column[0].x + P.column[1].y + P.column[2].z;
    double scale = 0;
    for (int c = 0; c < 3; ++c) scale += dot(L.column[c], M.column[c]) / spread;
    if (!(scale > 0.2 && scale < 5)) return;
    if (!(M.determinant() > -1e-6 * power(spread, 3))) return;  // a mirror image
    for (Vec3& column : L.column) column = scale * column;
    if (is_affine) {
      for (int c = 0; c < 3; ++c) {
        M.column[c] += kRigid * spread * L.column[c];
        P.column[c] += kRigid * spread * unit3(c);
      }
      const AffineMap inverse = transposed(P.cofactors());
      for (int c = 0; c < 3; ++c) L.column[c] = 1 / P.determinant() * M.linear(inverse.column[c]);
      if (!(L.determinant() > 0.1 * scale * scale * scale)) return;
    }
    map_ = L;
    map_.shift = q0 - L.linear(p0);
  }

  const SamplePair* pair_;
  AffineMap map_;
  Array<SurfaceSample> moved_;  // of A
  Array<int> to_b_, to_a_;
  double residual_ = kInfinity;
  bool is_settled_ = false, was_affine_ = false;
};

inline SamplePair sampled(const SurfacePair& pair, const Array<VertexPair>& landmarks, int n) {
  SamplePair samples = {sampled(pair.a, n), sampled(pair.b, n), n};
  for (const VertexPair& l : landmarks) {
    samples.a.push_back({row3(pair.a.vertices, l.a), unit3(0), {}});
    samples.b.push_back({row3(pair.b.vertices, l.b), unit3(0), {}});
  }
  return samples;
}

/// Keeps the alignments with the least residuals, one of several that are alike.
inline Array<Alignment> best_of(const Array<Alignment>& all, int most) {
  Array<double> residual;
  for (const Alignment& alignment : all) residual.push_back(alignment.residual());
  constexpr double kWorse = 2.5;  // than the best one
  Array<Alignment> best;
  for (int i : sorted_by(residual)) {
    bool is_new = best.size() < most && (best.empty() || residual[i] < kWorse * best[0].residual());
    for (const Alignment& other : best) is_new = is_new && !all[i].is_like(other);
    if (is_new) best.push_back(all[i]);
  }
  return best;
}

/// Aligns A with B in space, in different ways, the closest first; the last one is by landmarks,
/// which alone define how a part lies in a whole.
inline Array<Alignment> find_alignments(const SamplePair& few, const SamplePair& many, int most,
                                        const Executor& executor) {
  constexpr int kFirst = 8, kNext = 15, kLast = 25, kKept = 6, kEnough = 3;
  const auto improved = [&](Array<Alignment> all, int similar, int affine) {
    executor.run(all.size(), [&](int i) {
      for (int k = 0; k < similar + affine && !executor.is_stopped(); ++k)
        all[i].improve(k >= similar);
    });
    return all;
  };
  Array<Alignment> first, next;
  const AffineMap from_a = transposed(principal_axes(many.a)), to_b = principal_axes(many.b);
  for (const AffineMap& rotation : icosahedral_rotations()) {
    AffineMap map = product(to_b, product(rotation, from_a));
    map.shift = mean(many.b) - map.linear(mean(many.a));
    first.push_back(Alignment(few, map));
  }
  first = best_of(improved(first, kFirst, 0), kKept);
  for (const Alignment& alignment : first) next.push_back(Alignment(many, alignment.map()));
  Array<Alignment> best = best_of(improved(next, kNext, kLast), most);
  if (many.a.size() - many.n < kEnough) return best;
  best.push_back(Alignment(many));
  for (int i = 0; i + 1 < best.size(); ++i)
    if (best.back().is_like(best[i])) return best.pop_back(), best;
  return best;
}

// ==== [18] APPLICATIONS (paper §1, §6.3) =========================================================
//
// Purpose:    transfers attributes between the surfaces; gives one mesh the geometry of the other.
// Invariants: attributes pass through corners of the meta mesh, whose places in both meshes are
//             known exactly; a mesh gets back the attributes that it gives to the meta mesh.
// Fails:      returns no rows if attributes do not fit the mesh.

/// One of the two meshes of a meta mesh, and the places of polygons and corners in it.
struct MetaSide {
  const TriangleMesh& mesh;
  const std::vector<int>& same;  // per vertex
  const std::vector<int>& face;  // per polygon
  const Points3& corner;         // per corner of the polygons
};

inline MetaSide meta_side(const MetaMesh& meta, Side side) {
  if (side == Side::kA) return {*meta.a, meta.same_a, meta.face_a, meta.corner_a};
  return {*meta.b, meta.same_b, meta.face_b, meta.corner_b};
}

inline int element_count(const TriangleMesh& mesh, Element element) {
  if (element == Element::kVertex) return static_cast<int>(mesh.vertices.rows());
  return (element == Element::kFace ? 1 : 3) * static_cast<int>(mesh.triangles.rows());
}

/// The row at corner k of face f.
inline int element_row(const TriangleMesh& mesh, Element element, int f, int k) {
  if (element == Element::kVertex) return mesh.triangles(f, k);
  return element == Element::kFace ? f : 3 * f + k;
}

struct Triplet {
  int row, source;
  double weight;
  bool operator<(const Triplet& o) const { return row != o.row ? row < o.row : source < o.source; }
};

/// Builds a matrix from triplets; those of one row and source are summed in their order.
inline Transfer transfer_of(int rows, int n_sources, Array<Triplet> triplets) {
  std::stable_sort(triplets.begin(), triplets.end());
  Transfer result;
  result.n_sources = n_sources;
  for (int i = 0, row = 0; row < rows; ++row) {
    for (; i < triplets.size() && triplets[i].row == row; ++i)
      if (i > 0 && !(triplets[i - 1] < triplets[i])) {
        result.weights.back() += triplets[i].weight;
      } else {
        result.sources.push_back(triplets[i].source);
        result.weights.push_back(triplets[i].weight);
      }
    result.offsets.push_back(static_cast<int>(result.sources.size()));
  }
  return result;
}

/// Returns the product of two matrices, which applies `first`, then `second`.
inline Transfer product(const Transfer& second, const Transfer& first) {
  Array<Triplet> triplets;
  for (int row = 0; row < second.rows(); ++row)
    for (int i = second.offsets.data()[row]; i < second.offsets.data()[row + 1]; ++i) {
      const int* begin = first.offsets.data() + second.sources.data()[i];
      for (int k = begin[0]; k < begin[1]; ++k)
        triplets.push_back(
            {row, first.sources.data()[k], second.weights.data()[i] * first.weights.data()[k]});
    }
  return transfer_of(second.rows(), first.n_sources, std::move(triplets));
}

}  // namespace detail

Values Transfer::apply(const Values& values) const {
  const int columns = static_cast<int>(values.cols());
  const std::ptrdiff_t stride = columns * std::ptrdiff_t{sizeof(double)};
  Values result = Values::Zero(rows(), columns);
  if (!apply(values.data(), values.rows(), stride, columns, result.data(), rows(), stride))
    result.resize(0, columns);
  return result;
}

Transfer to_meta(const MetaMesh& meta, Side side, Element element) {
  const detail::MetaSide s = detail::meta_side(meta, side);
  detail::Array<detail::Triplet> triplets;
  for (int p = 0; p < meta.n_polygons(); ++p)
    for (int c = meta.offsets.data()[p]; c < meta.offsets.data()[p + 1]; ++c) {
      const int f = s.face.data()[p];
      if (element == Element::kFace) triplets.push_back({c, f, 1});
      for (int k = 0; k < 3 && element != Element::kFace; ++k)
        if (s.corner(c, k) != 0)
          triplets.push_back({c, detail::element_row(s.mesh, element, f, k), s.corner(c, k)});
    }
  return detail::transfer_of(static_cast<int>(s.corner.rows()),
                             detail::element_count(s.mesh, element), std::move(triplets));
}

Transfer from_meta(const MetaMesh& meta, Side side, Element element) {
  const detail::MetaSide s = detail::meta_side(meta, side);
  const int rows = detail::element_count(s.mesh, element);
  const bool has_copies = element == Element::kVertex && !s.same.empty();
  detail::Array<detail::Triplet> triplets;
  const auto point = [&](int c) { return detail::Vec2{s.corner(c, 1), s.corner(c, 2)}; };
  const auto add_integral = [&](int f, int first, int c) {  // over one triangle of a polygon
    const double area = detail::cross(point(c) - point(first), point(c + 1) - point(first));
    for (int corner : {first, c, c + 1})
      if (area > 0) triplets.push_back({f, corner, area / 3});
  };
  const auto add_vertex = [&](int f, int c) {
    for (int k = 0; k < 3; ++k) {
      if (s.corner(c, k) != 1) continue;
      const int row = detail::element_row(s.mesh, element, f, k);
      triplets.push_back({has_copies ? s.same.data()[row] : row, c, 1});
    }
  };
  for (int p = 0; p < meta.n_polygons(); ++p) {
    const int f = s.face.data()[p], first = meta.offsets.data()[p];
    const int last = meta.offsets.data()[p + 1];
    for (int c = first; c < last && element != Element::kFace; ++c) add_vertex(f, c);
    for (int c = first + 1; c + 1 < last && element == Element::kFace; ++c)
      add_integral(f, first, c);
  }
  detail::Array<double> total(rows, 0);
  for (const detail::Triplet& triplet : triplets) total[triplet.row] += triplet.weight;
  for (detail::Triplet& triplet : triplets) triplet.weight /= total[triplet.row];
  Transfer result =
      detail::transfer_of(rows, static_cast<int>(s.corner.rows()), std::move(triplets));
  if (!has_copies) return result;
  detail::Array<detail::Triplet> same;  // a copy gets the row of its vertex
  for (int v = 0; v < rows; ++v)
    if (s.same.data()[v] >= 0) same.push_back({v, s.same.data()[v], 1});
  return detail::product(detail::transfer_of(rows, rows, std::move(same)), result);
}

Transfer transfer(const MetaMesh& meta, Side from, Element element, Element target) {
  return detail::product(from_meta(meta, detail::other(from), target),
                         to_meta(meta, from, element));
}

TriangleMesh remesh(const SurfaceMap& map, Side side) {
  const detail::MapData& data = *map.data_;
  const Prepared& prepared = *data.origin(side).prepared;
  const std::vector<SurfacePoint> images = data.map_vertices(side);
  const int n = static_cast<int>(images.size());
  const auto exists = [&](int v) { return images.data()[v].exists(); };
  int first = 0;
  while (first < n && !exists(first)) ++first;
  TriangleMesh result;
  result.vertices = Points3::Zero(n, 3);
  for (int v = 0; v < n && first < n; ++v)
    result.vertices.row(v) =
        data.position_of_given(images.data()[exists(v) ? v : first], detail::other(side));
  detail::Array<int> corners;
  for (int f = 0; f < prepared.mesh->triangles.rows(); ++f) {
    if (prepared.given_triangle.data()[f] < 0) continue;
    int corner[3];
    for (int k = 0; k < 3; ++k)
      corner[k] = prepared.given->triangles.data()[prepared.given_corner.data()[3 * f + k]];
    if (std::all_of(corner, corner + 3, exists)) corners.append(corner, 3);
  }
  result.triangles = detail::triangles_from(corners);
  return result;
}

Points3 linear_morph(const MetaMesh& meta, double t) {
  Points3 x(meta.on_a.rows(), 3);
  for (Eigen::Index i = 0; i < x.size(); ++i)
    x.data()[i] = (1 - t) * meta.on_a.data()[i] + t * meta.on_b.data()[i];
  return x;
}

// ==== [19] CLOSED SURFACES =======================================================================
//
// Purpose:    decides where to cut a closed surface open that is mapped to one with a boundary, and
//             finds tips and distances for several parts.
// Method:     A closed surface is cut along a small cross of edges; nothing is removed. Pairs of
//             closed surfaces are not cut: see pillows, part [14].
// Fails:      never.

namespace detail {

// ---- where to open ----

/// Vertices farther from all others than their neighbours are: the ends of limbs, ears and tails;
/// with the distances from each to all vertices, in roots of the area.
struct Tips {
  Array<int> vertex;
  Array<Array<double>> distance;
};

inline Tips find_tips(const Surface& s) {
  constexpr double kAround = 0.12;
  constexpr int kMost = 16;
  const int n = s.mesh.n_vertices;
  const Array<double> mass = vertex_areas(s);
  Array<Array<double>> distance;
  Array<double> nearness(n, 0);  // minus the mean distance from all points
  for (int v = 0; v < n; ++v) {
    distance.push_back(edge_distances(s, v));
    for (double& d : distance[v]) d /= std::sqrt(s.total_area);
    for (int w = 0; w < n; ++w) nearness[v] -= mass[w] / s.total_area * distance[v][w];
  }
  Tips tips;
  Array<char> is_behind(n, 0);  // something farther is around
  for (int v : sorted_by(nearness)) {
    if (!is_behind[v] && tips.vertex.size() < kMost) {
      tips.vertex.push_back(v);
      tips.distance.push_back(distance[v]);
    }
    for (int w = 0; w < n; ++w)
      if (distance[v][w] < kAround) is_behind[w] = 1;
    s.mesh.for_each_outgoing(
        v, [&](int h) { is_behind[s.mesh.tip(h)] = is_behind[s.mesh.tail[prev(h)]] = 1; });
  }
  return tips;
}

/// Returns the tips at ends of limbs: inner ones with less area around them than on a plane.
inline Tips ends_of_limbs(const Surface& s, const Tips& tips) {
  constexpr double kAround = 0.3, kMost = 0.6 * kPi * kAround * kAround;
  const Array<double> mass = vertex_areas(s);
  Tips ends;
  for (int i = 0; i < tips.vertex.size(); ++i) {
    double area = 0;
    for (int v = 0; v < mass.size(); ++v)
      if (tips.distance[i][v] < kAround) area += mass[v];
    if (area > kMost * s.total_area || s.mesh.on_boundary(tips.vertex[i])) continue;
    ends.vertex.push_back(tips.vertex[i]);
    ends.distance.push_back(tips.distance[i]);
  }
  return ends;
}

/// Returns the best `most` matchings of tips of A with tips of B: distances of matched tips to each
/// other and to the landmarks agree. If limbs are alike, several matchings agree equally well.
inline Array<Array<VertexPair>> match_by_distances(const Tips& a, const Tips& b,
                                                   const Array<VertexPair>& landmarks, int most) {
  constexpr int kTips = 6, kMore = 2;  // tips of A, and of B beyond as many
  constexpr int kKept = 500;           // partial matchings
  struct Matching {
    double misfit = 0;
    Array<VertexPair> pairs;
  };
  Array<Matching> found(1, Matching{0, landmarks});
  const int n = (std::min)({int{kTips}, a.vertex.size(), b.vertex.size()});
  for (int i = 0; i < n; ++i) {
    Array<Matching> longer;
    for (const Matching& m : found)
      for (int j = 0; j < (std::min)(n + kMore, b.vertex.size()); ++j) {
        Matching next = m;
        for (const VertexPair& p : m.pairs) {
          const double on_a = a.distance[i][p.a], on_b = b.distance[j][p.b];
          const bool are_apart = on_a > 0 && on_b > 0;  // else a vertex would be used twice
          next.misfit += are_apart ? power((on_a - on_b) / (on_a + on_b), 2) : kInfinity;
        }
        next.pairs.push_back({a.vertex[i], b.vertex[j], {}});
        if (next.misfit < kInfinity) longer.push_back(next);
      }
    if (longer.empty()) continue;  // a landmark
    std::stable_sort(longer.begin(), longer.end(),
                     [](const Matching& x, const Matching& y) { return x.misfit < y.misfit; });
    longer.resize((std::min)(longer.size(), int{kKept}));
    found = std::move(longer);
  }
  Array<Array<VertexPair>> matchings;
  for (int i = 0; i < (std::min)(most, found.size()); ++i) {
    const auto first = found[i].pairs.begin() + landmarks.size(), last = found[i].pairs.end();
    if (first != last) matchings.push_back(std::vector<VertexPair>(first, last));
  }
  return matchings;
}

/// Returns at most `most` pairs, spread over A, of the half whose distances to each other agree
/// best on both surfaces. Up to half of the given pairs may be wrong.
inline Array<VertexPair> consistent(const SurfacePair& surfaces, const Array<VertexPair>& pairs,
                                    int most) {
  constexpr int kRounds = 4, kShare = 4;  // a quarter of the others bears a pair out
  Array<Array<double>> on_a, on_b;
  for (const VertexPair& pair : pairs) {
    on_a.push_back(edge_distances(surfaces.a, pair.a));
    on_b.push_back(edge_distances(surfaces.b, pair.b));
  }
  Array<int> kept = numbers_below(pairs.size());
  for (int round = 0; round < kRounds; ++round) {
    Array<double> miss;
    for (int i = 0; i < pairs.size(); ++i) {
      Array<double> difference;
      for (int j : kept) difference.push_back(std::abs(on_a[i][pairs[j].a] - on_b[i][pairs[j].b]));
      std::sort(difference.begin(), difference.end());
      miss.push_back(difference[difference.size() / kShare]);
    }
    kept = sorted_by(miss);
    kept.resize((pairs.size() + 1) / 2);
  }
  Array<VertexPair> spread;
  Array<double> nearest(pairs.size(), -kInfinity);
  for (int i : kept) nearest[i] = kInfinity;
  const auto distance = [&](int i, int j) { return on_a[i][pairs[j].a]; };
  for (int i : farthest_items(most, nearest, distance)) spread.push_back(pairs[i]);
  return spread;
}

/// Where A and B are opened: a vertex of the closed surface, -1 for the one with a boundary.
struct OpeningPair {
  int a = -1, b = -1;
};

inline constexpr double kArm = 0.03;  // the length of a cross, in roots of the area

/// Returns the vertex at which to open a closed surface. No point is far from it, so the surface
/// unfolds with little strain. If this surface is larger, the vertex is in the middle of the part
/// that the other one leaves free: as far from the landmarks as the boundary of the other one, plus
/// the radius of a disk of that area.
inline int find_opening(const Surface& s, const Array<Place>& landmarks, const Surface& other,
                        const Array<Place>& on_other) {
  constexpr int kMost = 64, kLeast = 8, kVisits = 2000000, kMostLandmarks = 16;
  constexpr double kWeight = 10;                            // of the distances to landmarks
  constexpr double kNearLandmark = 1e6, kAtLandmark = 1e9;  // costs of opening there
  const double unit = 1 / std::sqrt(s.total_area);
  const double radius = std::sqrt((std::max)(0.0, s.total_area - other.total_area) / kPi);
  const int n = s.mesh.n_vertices;
  const int n_samples = (std::min)(n, std::clamp(kVisits / n, int{kLeast}, int{kMost}));
  Array<double> cost(n, 0), to_samples(n, kInfinity), to_landmarks(n, kInfinity);
  for (int i = 0, farthest = 0; i < n_samples; ++i) {
    const Array<double> d = edge_distances(s, farthest);
    for (int v = 0; v < n; ++v) {
      cost[v] += unit * d[v] / n_samples;
      to_samples[v] = (std::min)(to_samples[v], d[v]);
      if (to_samples[v] > to_samples[farthest]) farthest = v;
    }
  }
  for (double& c : cost) c *= c;
  const int n_landmarks = (std::min)(landmarks.size(), int{kMostLandmarks});
  for (int i = 0; i < n_landmarks; ++i) {
    const Array<double> d = edge_distances(s, landmarks[i].corners[0]);
    const Array<double> e = edge_distances(other, on_other[i].corners[0]);
    double to_boundary = kInfinity;
    for (int h : other.mesh.boundary) to_boundary = (std::min)(to_boundary, e[other.mesh.tail[h]]);
    for (int v = 0; v < n; ++v) {
      const double difference = unit * (d[v] - to_boundary - radius);
      cost[v] += kWeight / n_landmarks * difference * difference;
      to_landmarks[v] = (std::min)(to_landmarks[v], unit * d[v]);
    }
  }
  for (const Place& l : landmarks) to_landmarks[l.corners[0]] = 0;
  for (int v = 0; v < n; ++v)
    if (!(to_landmarks[v] > 3 * kArm)) cost[v] += to_landmarks[v] > 0 ? kNearLandmark : kAtLandmark;
  return static_cast<int>(std::min_element(cost.begin(), cost.end()) - cost.begin());
}

/// Returns four paths of edges from a vertex of a closed surface, or fewer if it has fewer edges:
/// straight on at every vertex, until they are as long as an arm or meet.
inline Array<int> cross_at(const Surface& s, int center) {
  const HalfEdgeMesh& m = s.mesh;
  const double length = kArm * std::sqrt(s.total_area);
  const auto outgoing_from = [&](int h) {
    Array<int> spokes;
    for (int e = h; spokes.empty() || e != h; e = m.turn(e)) spokes.push_back(e);
    return spokes;
  };
  const Array<int> spokes = outgoing_from(m.out[center]);
  const int arms = (std::min)(4, spokes.size());
  Array<char> is_taken(m.n_vertices, 0);
  is_taken[center] = 1;
  Array<int> edges;
  for (int i = 0; i < arms; ++i) {
    edges.push_back(spokes[i * spokes.size() / arms]);
    is_taken[m.tip(edges.back())] = 1;
  }
  for (int i = 0; i < arms; ++i) {
    int h = edges[i];
    for (double way = s.edge_length(h); way < length; way += s.edge_length(h)) {
      const Array<int> around = outgoing_from(m.twin[h]);
      h = around[around.size() / 2];
      if (is_taken[m.tip(h)]) break;
      is_taken[m.tip(h)] = 1;
      edges.push_back(h);
    }
  }
  return edges;
}

/// Returns the surface to optimise: closed ones are cut open.
inline Surface opened(Surface s, int vertex) {
  if (vertex >= 0) cut_along(cross_at(s, vertex), s);
  return s;
}

/// Returns the same place on a surface that was cut open: half-edges stay, and some have copies of
/// vertices as tails. A place on a cut edge goes to one side of the cut.
inline Place opened(Place p, const HalfEdgeMesh& whole, const HalfEdgeMesh& open) {
  const int h = vertex_at(p) >= 0 ? -1 : find_place(whole, p);
  const Place before = p;
  for (int k = 0; k < 3 && h >= 0; ++k)
    for (int e : {h, next(h), prev(h)})
      if (whole.tail[e] == before.corners[k]) p.corners[k] = open.tail[e];
  return p;
}

// ==== [20] THREADS AND PROGRESS ==================================================================
//
// Purpose:    the services of part [4]: parallel tasks, on threads of the library or by the
//             caller's job system, and reports.
// Fails:      with the exception of a task, once all tasks in progress are done.

#ifndef ISM_NO_THREADS
/// Threads that sleep until tasks arrive. run() does not wait for a helper that wakes too late,
/// which finds no task and sleeps on.
class Crew {
 public:
  /// Starts as many helpers as the system permits.
  explicit Crew(int helpers) {
#ifdef __cpp_exceptions
    try {
#endif
      helpers_.reserve(helpers);
      for (int i = 0; i < helpers; ++i) helpers_.emplace_back([this] { help(); });
#ifdef __cpp_exceptions
    } catch (...) {
    }
#endif
  }
  Crew(const Crew&) = delete;
  Crew& operator=(const Crew&) = delete;
  ~Crew() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      is_over_ = true;
    }
    wake_.notify_all();
    for (std::thread& helper : helpers_) helper.join();
  }

  /// Runs task(0) ... task(n - 1) on the calling thread and on helpers; one run at a time.
  void run(int n, const std::function<void(int)>& task) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      task_ = &task;
      n_ = n;
      next_ = 0;
    }
    for (int t = 1; t < n && t <= helpers_.size(); ++t) wake_.notify_one();
    work(task, n);
    std::unique_lock<std::mutex> lock(mutex_);
    task_ = nullptr;  // helpers that wake later find no task
    left_.wait(lock, [&] { return working_ == 0; });
  }

 private:
  void work(const std::function<void(int)>& task, int n) {
    for (int i = next_++; i < n; i = next_++) task(i);
  }

  void help() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (true) {
      wake_.wait(lock, [&] { return is_over_ || (task_ != nullptr && next_ < n_); });
      if (is_over_) return;
      const std::function<void(int)>& task = *task_;
      const int n = n_;
      ++working_;
      lock.unlock();
      work(task, n);
      lock.lock();
      if (--working_ == 0) left_.notify_one();
    }
  }

  std::mutex mutex_;
  std::condition_variable wake_, left_;
  Array<std::thread> helpers_;
  const std::function<void(int)>* task_ = nullptr;  // of the current run
  int n_ = 0;
  std::atomic<int> next_{0};
  int working_ = 0;  // helpers in work()
  bool is_over_ = false;
};

/// Returns the number of threads of a call without a job system, including the caller's. Processors
/// count if this thread may use them; in a container, within its quota.
inline int thread_count(const Options& options) {
  int n = static_cast<int>(std::thread::hardware_concurrency());
#ifdef __linux__
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof allowed, &allowed) == 0) n = CPU_COUNT(&allowed);
  if (std::FILE* const file = std::fopen("/sys/fs/cgroup/cpu.max", "r")) {
    double quota = 0, period = 0;  // µs; the former may be "max"
    if (std::fscanf(file, "%lf %lf", &quota, &period) == 2 && quota > 0 && period > 0)
      n = static_cast<int>((std::min)(std::ceil(quota / period), 1.0 * n));
    std::fclose(file);
  }
#endif
  n = (std::max)(1, n);
  return options.threads <= 0 ? n : (std::min)(options.threads, 4 * n);
}
#endif

inline Executor::Executor(const Options& options)
    : hook_(options.parallel_for),
      tell_(options.progress),
      stop_(options.stop),
      max_seconds_(options.max_seconds) {
#ifndef ISM_NO_THREADS
  const int threads = thread_count(options);
  if (threads < 2 || hook_) return;
  hook_ = [crew = std::make_shared<Crew>(threads - 1)](int n, const Task& task) {
    crew->run(n, task);
  };
#endif
}

inline void Executor::run(int n, const Task& task) const {
  const auto task_and_tick = [&](int i) {
    {
      const NoTraps no_traps;
      task(i);
    }
    tick();
  };
#ifdef __cpp_exceptions
  std::atomic<bool> has_failed{false};
  std::exception_ptr error;  // the first one
  const auto guarded = [&](int i) {
    if (has_failed.load(std::memory_order_relaxed)) return;
    try {
      task_and_tick(i);
    } catch (...) {
      if (!has_failed.exchange(true)) error = std::current_exception();
    }
  };
#else
  const auto& guarded = task_and_tick;
#endif
  if (n > 0 && !run_side_by_side(n, guarded))
    for (int i = 0; i < n; ++i) guarded(i);
#ifdef __cpp_exceptions
  if (error) std::rethrow_exception(error);
#endif
}

inline void Executor::tell(bool is_embedding, double fraction, Words what,
                           const IterationLog* iteration) const {
  const double before = is_embedding ? 0 : embedding_share_;
  const double share = is_embedding ? embedding_share_ : 1 - embedding_share_;
  progress_.fraction = (std::max)(
      {progress_.fraction, before + share * fraction, (std::min)(seconds() / max_seconds_, 1.0)});
  if (!tell_) return;
  progress_.is_embedding = is_embedding;
  progress_.what = sentence(what);
  progress_.iteration = iteration;
  tell_again();
  progress_.iteration = nullptr;
}

/// Runs tasks by parallel_for or the crew; false for one task, and within such a run.
inline bool Executor::run_side_by_side(int n, const Task& task) const {
  if (!hook_ || n < 2 || is_side_by_side_.exchange(true)) return false;
  hook_(n, task);  // if it throws, so does the call
  is_side_by_side_ = false;
  return true;
}

inline void Executor::tell_again() const {
  since_told_.lap();
  if (!is_stopped() && !tell_(progress_)) stop_status_ = Status::kCancelled;
}

/// Repeats the report after a task of the calling thread, if the last one is 0.1 s old.
inline void Executor::tick() const {
  constexpr double kOften = 0.1;
  if (!tell_ || !is_caller() || since_told_.seconds() < kOften || progress_.what.empty()) return;
  tell_again();
}

// ==== [21] ENTRY POINTS ==========================================================================
//
// Purpose:    checks the input, runs the parts above in order, and words the outcome.
// Invariants: nothing is computed on input that fails a check.
// Fails:      with the status, message and ids of the first failed check.

/// Fails with the first problem of a mesh, if any.
inline bool check_problems(const std::vector<Problem>& problems, Side side, Outcome& outcome) {
  if (problems.empty()) return true;
  const int count = static_cast<int>(problems.size());
  const std::string which = count > 1 ? sentence({" (problem 1 of ", count, ")"}) : "";
  std::vector<ElementId> ids;
  for (int id : problems[0].ids) ids.push_back({side, problems[0].element, id});
  return fail(outcome, Status::kInvalidMesh,
              {"mesh ", letter(side), ": ", problems[0].message, which}, ids);
}

/// Places the ends of landmarks on one mesh, in order; no two exact ones may share a place.
class LandmarkPlacer {
 public:
  LandmarkPlacer(const Prepared& prepared, Side side, bool are_exact)
      : prepared_(prepared), side_(side), are_exact_(are_exact) {}

  /// Places the end of a landmark; guiding ones whose end was dropped get no place and a warning.
  bool locate(const Landmark& l, Place& place, Outcome& outcome) {
    constexpr double kRounding = 1e-6;
    const LandmarkPoint& p = side_ == Side::kA ? l.a : l.b;
    const bool is_vertex = !is_point(p);
    const int id = id_of(p), n = static_cast<int>(is_vertex ? prepared_.new_vertex.size()
                                                            : prepared_.new_triangle.size());
    const auto refuse = [&](Words why) {
      return fail(outcome, Status::kInvalidLandmarks, {name_of(l), sentence(why)},
                  {element_id(side_, p)});
    };
    if (id < 0 || id >= n)
      return refuse({"mesh ", letter(side_), " has no ", is_vertex ? "vertex " : "triangle ", id,
                     ", it has ", n, is_vertex ? " vertices" : " triangles", ", counted from 0"});
    const Eigen::Vector3d& weights = p.point.barycentric;
    const bool have_sum = std::abs(weights[0] + weights[1] + weights[2] - 1) <= kRounding;
    if (!is_vertex && (!have_sum || weights.minCoeff() < -kRounding))
      return refuse(
          {"barycentric coordinates on ", letter(side_), " must be at least 0 with sum 1"});
    const std::string end =
        sentence({is_vertex ? "vertex " : "the point in triangle ", id, " of ", letter(side_)});
    const std::string lost = end + " was dropped when the mesh was prepared";
    const bool is_found = find(p, place);
    if (are_exact_ && !is_found) return refuse({lost});
    if (are_exact_ && !claim(place)) return refuse({end, " is in another landmark"});
    if (!is_found)
      outcome.warnings.push_back({name_of(l) + lost + ": it is left out", {element_id(side_, p)}});
    return true;
  }

 private:
  /// Locates an end, on a dropped element at the nearest point of the surface; false if too far.
  bool find(const LandmarkPoint& p, Place& place) {
    SurfacePoint point;
    if (is_point(p)) {
      if (pieces_.face.empty()) pieces_ = pieces_of(prepared_);
      point = pieces_.from_mesh(p.point);
    } else if (prepared_.new_vertex.data()[p.vertex] >= 0) {
      return place = copy_of(prepared_.new_vertex.data()[p.vertex]), true;
    }
    if (point.face < 0 && !find_nearest(p, point)) return false;
    place.corners = prepared_.mesh->triangles.row(point.face);
    place.weights = point.barycentric;
    return tidy(place);
  }

  /// False if another landmark has the place.
  bool claim(const Place& place) {
    const int n_vertices = static_cast<int>(prepared_.given_vertex.size());
    const int v = add_place(place, n_vertices, added_);
    while (v >= used_.size()) used_.push_back(0);
    return !used_[v]++;
  }

  bool find_nearest(const LandmarkPoint& p, SurfacePoint& nearest) const {
    constexpr double kNear = 0.01;  // of the diagonal of the box around the mesh
    const TriangleMesh &given = *prepared_.given, &mesh = *prepared_.mesh;
    const double unit = unit_scale(mesh.vertices);
    const Vec3 at =
        unit * (is_point(p) ? position_in_space(given, p.point) : row3(given.vertices, p.vertex));
    const double diagonal =
        unit * (mesh.vertices.colwise().maxCoeff() - mesh.vertices.colwise().minCoeff()).norm();
    double least = kNear * diagonal;
    for (int f = 0; f < mesh.triangles.rows(); ++f) {
      const std::array<Vec3, 3> corners = corners_of(mesh, f, unit);
      const Vec3 w = closest_weights(at, corners);
      const double distance = norm(w.x * corners[0] + w.y * corners[1] + w.z * corners[2] - at);
      if (!(distance <= least)) continue;
      least = distance;
      nearest = surface_point(f, w);
    }
    return nearest.face >= 0;
  }

  const Prepared& prepared_;
  const Side side_;
  const bool are_exact_;
  Pieces pieces_;                   // set for the first point in a triangle
  std::vector<AddedVertex> added_;  // as if all landmarks became vertices
  Array<char> used_;
};

inline int nearest_vertex(const Surface& s, const Vec3& p) {
  int nearest = 0;
  for (int v = 0; v < s.mesh.n_vertices; ++v)
    if (squared_norm(row3(s.vertices, v) - p) < squared_norm(row3(s.vertices, nearest) - p))
      nearest = v;
  return nearest;
}

/// Returns the point nearest to p in the triangles around the nearest vertex of a surface.
inline Place nearest_place(const Surface& s, const Vec3& p) {
  const int nearest = nearest_vertex(s, p);
  Place best = copy_of(nearest);
  double least = kInfinity;
  s.mesh.for_each_outgoing(nearest, [&](int h) {
    const int f = h / 3;
    const std::array<Vec3, 3> corners = {{s.corner(f, 0), s.corner(f, 1), s.corner(f, 2)}};
    const Vec3 w = closest_weights(p, corners);
    const double distance = norm(w.x * corners[0] + w.y * corners[1] + w.z * corners[2] - p);
    if (distance >= least) return;
    least = distance;
    for (int k = 0; k < 3; ++k) best.corners[k] = s.mesh.corner(f, k), best.weights[k] = w[k];
  });
  tidy(best);
  return best;
}

inline bool is_at_least_0(double x) { return x >= 0 && std::isfinite(x); }

/// Places landmarks; skips guiding ones with a warning if an end was dropped with part of its mesh.
inline bool place_landmarks(const Prepared& a, const Prepared& b,
                            const std::vector<Landmark>& landmarks, bool are_exact,
                            Array<PlacedLandmark>& placed, Outcome& outcome) {
  LandmarkPlacer on_a(a, Side::kA, are_exact), on_b(b, Side::kB, are_exact);
  for (const Landmark& l : landmarks) {
    PlacedLandmark here = {{}, {}, l, 1};
    if (!on_a.locate(l, here.a, outcome) || !on_b.locate(l, here.b, outcome)) return false;
    if (!is_at_least_0(l.weight))
      return fail(outcome, Status::kInvalidLandmarks, {name_of(l), "its weight must be at least 0"},
                  {element_id(Side::kA, l.a)});
    if (here.a.corners[0] >= 0 && here.b.corners[0] >= 0) placed.push_back(here);
  }
  return true;
}

/// Returns the median ratio of landmark distances, on A to on B, over all pairs of landmarks; 1
/// unless its deviation from 1 far exceeds the spread of the ratios.
inline double relative_size(const SurfacePair& pair, const Array<PlacedLandmark>& landmarks) {
  constexpr int kFewest = 5, kMost = 100;  // landmarks; of fewer, wrong ones may agree by chance
  constexpr double kLeast = 1.25;
  const int n = (std::min)(landmarks.size(), int{kMost});
  Array<double> ratio;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < i; ++j) {
      const double on_a =
          norm(mean(landmarks[i].a, pair.a.vertices) - mean(landmarks[j].a, pair.a.vertices));
      const double on_b =
          norm(mean(landmarks[i].b, pair.b.vertices) - mean(landmarks[j].b, pair.b.vertices));
      if (on_a > 0 && on_b > 0) ratio.push_back(on_a / on_b);
    }
  if (n < kFewest || ratio.size() < 3) return 1;
  std::sort(ratio.begin(), ratio.end());
  const double median = ratio[ratio.size() / 2];
  const double spread = ratio[3 * ratio.size() / 4] / ratio[ratio.size() / 4];
  const double size = (std::max)(median, 1 / median);
  return size > kLeast && size > spread * spread * spread * spread ? median : 1;
}

/// Formats a number of magnitude 0.01 or more with two decimals.
inline std::string decimal(double x) {
  const long long hundredths = std::llround(100 * std::clamp(x, -1e15, 1e15));
  const std::string digits = std::to_string(100 + std::abs(hundredths % 100));
  return (hundredths < 0 ? "-" : "") + std::to_string(std::abs(hundredths / 100)) + "." +
         digits.substr(1);
}

inline void rescale(double factor, Surface& s) {
  s.vertices *= factor;
  s.scale *= factor;
  compute_rest_frames(s);
}

/// Scales the surfaces to the sizes that landmarks imply, if useful; see Options::keep_scale.
inline void fit_sizes(const Array<PlacedLandmark>& landmarks, const RunOptions& options,
                      SurfacePair& pair, Outcome& outcome) {
  constexpr double kFar = 100;
  const double size = relative_size(pair, landmarks);
  const double areas = pair.a.total_area / pair.b.total_area;
  const double ratio = pair.a.scale / pair.b.scale / size;  // of lengths on B to those on A
  const std::string units =
      sentence({"1 unit of ", ratio >= 1 ? "A" : "B", " is ", decimal((std::max)(ratio, 1 / ratio)),
                " units of ", ratio >= 1 ? "B" : "A"});
  std::string warning;
  if (!options.keep_scale && size != 1 && !are_closed(pair) &&
      options.boundary == Boundary::kFree) {
    rescale((std::max)(1.0, 1 / size), pair.a);  // the smaller one keeps area 1
    rescale((std::max)(1.0, size), pair.b);
    warning = "the meshes were not scaled to one area but by their landmarks: " + units;
  } else if (options.keep_scale && size != 1) {
    warning = "keep_scale is set, but the landmarks say that " + units;
  } else if (options.keep_scale && (areas > kFar || areas < 1 / kFar)) {
    warning =
        sentence({"the meshes were not scaled, and the area of ", areas > 1 ? "A" : "B", " is ",
                  decimal((std::max)(areas, 1 / areas)), " times that of the other one"});
  }
  if (!warning.empty()) outcome.warnings.push_back({warning, {}});
}

/// Halves edges of one surface, see EdgeHalver. Landmarks stay where they are.
inline void refine(double longest, double largest, int most, Side side, SurfacePair& pair,
                   Array<PlacedLandmark>& landmarks) {
  Surface& s = side == Side::kA ? pair.a : pair.b;
  const HalfEdgeMesh before = s.mesh;
  const std::size_t n_before = s.added.size();
  halve_edges(longest, largest, most, s);
  const std::vector<AddedVertex> added(s.added.data() + n_before, s.added.data() + s.added.size());
  Pieces pieces;
  if (added.empty() || !find_pieces(before, added, triangles_from(s.mesh.tail), pieces)) return;
  for (PlacedLandmark& l : landmarks) {
    Place& p = side == Side::kA ? l.a : l.b;
    if (vertex_at(p) >= 0) continue;
    const int f = find_place(before, p) / 3;
    const SurfacePoint at = pieces.from_mesh(surface_point(f, weights_in(before, f, p)));
    for (int k = 0; k < 3; ++k) p.corners[k] = s.mesh.corner(at.face, k);
    p.weights = at.barycentric;
    tidy(p);
  }
}

/// Returns true if half of a surface or more lies in triangles with an edge longer than `length`.
inline bool is_coarse(double length, const Surface& s) {
  double sum = 0;
  for (int h = 0; h < s.mesh.tail.size(); h += 3)
    if ((std::max)({s.edge_length(h), s.edge_length(h + 1), s.edge_length(h + 2)}) > length)
      sum += s.area[h / 3];
  return sum >= 0.5 * s.total_area;
}

/// Halves long edges of a surface that is too coarse for the other one, see Options::refine.
inline void refine(const RunOptions& options, SurfacePair& pair, Array<PlacedLandmark>& landmarks) {
  constexpr int kLeast = 64;  // vertices of closed surfaces: paths pass between four cones
  constexpr int kMost = 2;    // times as many triangles as the finer surface has
  const int finest = (std::max)(pair.a.mesh.n_faces, pair.b.mesh.n_faces);
  const auto mean_area = [](const Surface& s) { return s.total_area / s.mesh.n_faces; };
  const double mean = (std::min)(mean_area(pair.a), mean_area(pair.b));  // of the finer surface
  const double edge = std::sqrt(4 / std::sqrt(3.0) * mean);
  const bool is_off = options.refine == 0 || options.as_published || options.has_positions();
  for (Side side : {Side::kA, Side::kB}) {
    const Surface& s = side == Side::kA ? pair.a : pair.b;
    if (are_closed(pair)) refine(1e-9 * edge, 0, kLeast - s.mesh.n_vertices, side, pair, landmarks);
    if (is_off || !is_coarse(options.refine * edge, s)) continue;
    refine(options.refine * edge, mean / (std::max)(1.0, options.refine),
           (kMost * finest - s.mesh.n_faces) / 2, side, pair, landmarks);
  }
}

/// Checks that Options::outer_a (outer_b) is on a boundary, and that only disks hold theirs.
inline bool check_loops(const HalfEdgeMesh& m, const Prepared& prepared, Side side,
                        RunOptions& options, Outcome& outcome) {
  int& outer = side == Side::kA ? options.outer_a : options.outer_b;
  const int given = outer, n = static_cast<int>(prepared.new_vertex.size());
  outer = given >= 0 && given < n ? prepared.new_vertex.data()[given] : -1;
  if (given != -1 && (outer < 0 || !m.on_boundary(outer)))
    return fail(outcome, Status::kInvalidOptions,
                {"outer_", side == Side::kA ? "a" : "b", ": vertex ", given,
                 " is on no boundary of ", letter(side)},
                {vertex_id(side, given)});
  if (options.boundary == Boundary::kFree || m.loops() == 1) return true;
  return fail(outcome, Status::kInvalidOptions,
              {"boundaries cannot be held on closed surfaces or those with openings, and ",
               letter(side), m.loops() == 0 ? " is closed" : " has openings"});
}

inline bool check_options(const Options& o, Outcome& outcome) {
  if (!check_arithmetic(outcome)) return false;
  const struct {
    bool is_met;
    const char* text;
  } rules[] = {{o.measure.is_complete(), "measure must have a density"},
               {std::isfinite(o.coverage_weight), "coverage_weight must be finite"},
               {o.history_length >= 1, "history_length must be at least 1"},
               {is_at_least_0(o.omega_start), "omega_start must be at least 0"},
               {o.coarsest >= 0, "coarsest must be at least 0"},
               {is_at_least_0(o.refine), "refine must be at least 0"},
               {std::all_of(o.curves.begin(), o.curves.end(),
                            [](const Curve& c) { return is_at_least_0(c.weight); }),
                "weights of curves must be at least 0"},
               {o.max_iterations >= 0, "max_iterations must be at least 0"},
               {o.max_seconds > 0, "max_seconds must be positive"},
               {o.tolerance >= 0, "tolerance must be at least 0"},
               {o.threads >= 0, "threads must be at least 0"}};
  for (const auto& rule : rules)
    if (!rule.is_met)
      return fail(outcome, Status::kInvalidOptions, {"option out of range: ", rule.text});
  return true;
}

/// Binds pinned or fixed vertices, which must exist and be free; given ids become prepared ones.
/// `bonds`: per vertex, its constraint in words, or null.
inline bool claim(const Prepared& prepared, Side side, const char* how, std::vector<int>& vertices,
                  Array<const char*>& bonds, Outcome& outcome) {
  const int n = static_cast<int>(prepared.new_vertex.size());
  for (int& v : vertices) {
    const auto refuse = [&, given = v](Words why) {
      return fail(
          outcome, Status::kInvalidPins,
          {"vertex ", given, " of ", letter(side), " is to be ", how, ", but ", sentence(why)},
          {vertex_id(side, given)});
    };
    if (v < 0 || v >= n) return refuse({"ids are 0 to ", n - 1});
    v = prepared.new_vertex.data()[v];
    if (v < 0) return refuse({"it was dropped when the mesh was prepared"});
    if (bonds[v] != nullptr) return refuse({"it is ", bonds[v], " already"});
    bonds[v] = how;
  }
  return true;
}

/// Checks that vertices have at most one constraint (fixed ones may lie on a held boundary), and
/// that exact landmarks lie on both held boundaries or on none.
inline bool check_constraints(const HalfEdgeMesh& a, const Prepared& prepared_a,
                              const HalfEdgeMesh& b, const Prepared& prepared_b,
                              const Array<PlacedLandmark>& landmarks, RunOptions& options,
                              Outcome& outcome) {
  const bool is_held = options.boundary != Boundary::kFree;
  Array<const char*> bonds_a(a.n_vertices, nullptr), bonds_b(b.n_vertices, nullptr);
  for (const PlacedLandmark& l : landmarks) {
    if (!options.exact_landmarks) break;
    if (vertex_at(l.a) >= 0) bonds_a[vertex_at(l.a)] = "in an exact landmark";
    if (is_held && on_boundary(a, l.a) != on_boundary(b, l.b))
      return fail(
          outcome, Status::kInvalidLandmarks,
          {name_of(l.given), "one end is on a boundary, which is held, and the other one is not"},
          ids_of(l.given));
  }
  if (!claim(prepared_a, Side::kA, "fixed", options.fixed_a, bonds_a, outcome) ||
      !claim(prepared_b, Side::kB, "fixed", options.fixed_b, bonds_b, outcome))
    return false;
  const char* const on_boundary = "on a boundary that is held";
  if (is_held) {
    for (int h : a.boundary) bonds_a[a.tail[h]] = on_boundary;
    for (int h : b.boundary) bonds_b[b.tail[h]] = on_boundary;
  }
  return claim(prepared_a, Side::kA, "pinned", options.pins_a, bonds_a, outcome) &&
         claim(prepared_b, Side::kB, "pinned", options.pins_b, bonds_b, outcome);
}

inline SharedPrepared input_of(const MeshView& mesh, Side side,
                               const std::vector<Landmark>& landmarks, const Options& options) {
  std::vector<LandmarkPoint> ends;
  for (const Landmark& l : landmarks) ends.push_back(side == Side::kA ? l.a : l.b);
  return std::make_shared<const Prepared>(prepared(shared(mesh), ends, options.weld));
}

inline Surface surface_of(const Prepared& prepared, bool keep_scale) {
  Surface s = build_surface(*prepared.mesh, keep_scale);
  for (int v : prepared.given_vertex) s.given.push_back(v);
  return s;
}

/// Closes surfaces with small openings, unless an option concerns boundaries.
inline void close_openings(const RunOptions& o, SharedPrepared& a, SharedPrepared& b) {
  const bool has_wish = o.boundary != Boundary::kFree || o.outer_a != -1 || o.outer_b != -1 ||
                        !o.fixed_a.empty() || !o.fixed_b.empty() || o.has_positions() ||
                        o.as_published;
  if (has_wish || !a->problems.empty() || !b->problems.empty()) return;
  const SharedPrepared p = with_openings_closed(a), q = with_openings_closed(b);
  if (p && q) a = p, b = q;
}

/// Converts positions of the given vertices, if any, to those of the prepared mesh.
inline bool take_rows(const Prepared& prepared, const char* name, Points2& x, Outcome& outcome) {
  if (x.size() == 0) return true;
  const int n = static_cast<int>(prepared.new_vertex.size());
  if (rows_of(x) != n)
    return fail(outcome, Status::kInvalidPositions,
                {name, " has ", rows_of(x), " rows, the mesh has ", n, " vertices"});
  Points2 rows(static_cast<Eigen::Index>(prepared.given_vertex.size()), 2);
  for (int v = 0; v < rows.rows(); ++v) set_row(rows, v, row2(x, prepared.given_vertex.data()[v]));
  x.swap(rows);
  return true;
}

/// Finds the vertices of curves in the prepared meshes, without dropped ones.
inline bool take_curves(const Prepared& a, const Prepared& b, std::vector<Curve>& curves,
                        Outcome& outcome) {
  for (Curve& curve : curves)
    for (Side side : {Side::kA, Side::kB}) {
      const std::vector<int>& ids = side == Side::kA ? a.new_vertex : b.new_vertex;
      std::vector<int>& line = side == Side::kA ? curve.a : curve.b;
      for (int v : line)
        if (v < 0 || v >= static_cast<int>(ids.size()))
          return fail(outcome, Status::kInvalidLandmarks,
                      {"curve ", static_cast<int>(&curve - curves.data()), ": mesh ", letter(side),
                       " has no vertex ", v},
                      {vertex_id(side, v)});
      line = kept(line, ids);
    }
  return true;
}

/// Checks all arguments of a call, and builds the surfaces. Ids in options become prepared ones.
inline bool build_pair(const Prepared& a, const Prepared& b, const std::vector<Landmark>& landmarks,
                       RunOptions& options, SurfacePair& pair, Array<PlacedLandmark>& placed,
                       Outcome& outcome) {
  if (!check_options(options, outcome) || !check_problems(a.problems, Side::kA, outcome) ||
      !check_problems(b.problems, Side::kB, outcome))
    return false;
  pair = {surface_of(a, options.keep_scale), surface_of(b, options.keep_scale)};
  const HalfEdgeMesh &m = pair.a.mesh, &n = pair.b.mesh;
  if (m.loops() == 0 && n.loops() == 0 && !(options.fixed_a.empty() && options.fixed_b.empty()))
    return fail(outcome, Status::kInvalidPins,
                {"of two closed surfaces, no vertex can be fixed in the plane: pin it"});
  return take_rows(a, "initial_f", options.initial_f, outcome) &&
         take_rows(b, "initial_g", options.initial_g, outcome) &&
         check_loops(m, a, Side::kA, options, outcome) &&
         check_loops(n, b, Side::kB, options, outcome) &&
         place_landmarks(a, b, landmarks, options.exact_landmarks, placed, outcome) &&
         take_curves(a, b, options.curves, outcome) &&
         check_constraints(m, a, n, b, placed, options, outcome);
}

/// Returns the way between the two images of a landmark in the plane.
inline Vec2 gap_at(const JointSurface& s, const Points2& x, const PlacedLandmark& l) {
  const Vec2 p = spot_of(s.mesh, x, l.a).at, q = spot_of(s.mesh, x, in_joint(s, l.b)).at;
  return p - nearest_motion(s.mesh, p, q) * q;
}

inline SharedMesh with_added_vertices(const SharedMesh& given, const Surface& s) {
  if (s.added.empty()) return given;
  return std::make_shared<const TriangleMesh>(
      TriangleMesh{with_added(given->vertices, s.added), triangles_from(s.mesh.tail)});
}

inline bool check_positions(const HalfEdgeMesh& m, const Points2& x, const char* name,
                            Outcome& outcome) {
  if (!check_arithmetic(outcome)) return false;
  if (x.rows() != m.n_vertices)
    return fail(outcome, Status::kInvalidPositions,
                {name, " has ", rows_of(x), " rows, the mesh has ", m.n_vertices, " vertices"});
  return is_injective(m, x) ||
         fail(outcome, Status::kInvalidPositions, {name, " is not an injective embedding"});
}

/// Returns the power of two that makes two given planes about as large as their surfaces: Φ does
/// not depend on it (§4.6), but E_f, E_g and ε do. A power of two can be undone without rounding.
inline double plane_scale(const JointSurface& s, const Points2& x) {
  double area[2] = {0, 0};
  for (int h : s.mesh.boundary)
    area[h < 3 * s.faces_a] += 0.5 * cross(row2(x, s.mesh.tail[h]), row2(x, s.mesh.tip(h)));
  const double ratio = s.total_area / (std::abs(area[0]) + std::abs(area[1]));
  return std::isfinite(ratio) && ratio > 0 ? std::ldexp(1.0, std::ilogb(std::sqrt(2 * ratio))) : 1;
}

/// The id, side and name ("5 of A") of a vertex of A ⊔ B in its own mesh.
inline Side side_of(const JointSurface& s, int v) { return v < s.n_a ? Side::kA : Side::kB; }
inline std::string name_of(const JointSurface& s, int v) {
  return sentence({s.own_id[v], " of ", letter(side_of(s, v))});
}
inline ElementId element_id(const JointSurface& s, int v) {
  return vertex_id(side_of(s, v), s.own_id[v]);
}

/// Name and default message of a status; kWords has the order of the enum.
struct StatusWords {
  const char *name, *sentence;
};

inline StatusWords words_of(Status s) {
  static constexpr StatusWords kWords[] = {
      {"done", ""},
      {"converged", "the energy hardly falls any more"},
      {"iteration limit", "stopped at the iteration limit"},
      {"time limit", "stopped at the time limit; this is the last injective iterate"},
      {"cancelled", "cancelled; this is the last injective iterate"},
      {"stalled", "no injective step lowers the energy"},
      {"unfinished", "there is more to do; this is the last injective iterate"},
      {"no map yet", "the initial embedding has not come to its end"},
      {"memory limit",
       "the overlay has more than 16 million polygons: where vertices of thousands of edges of A "
       "and B lie over each other, all their edges cross; subdivide such a vertex's triangles"},
      {"invalid mesh", ""},
      {"invalid landmarks", ""},
      {"invalid options", ""},
      {"invalid positions", ""},
      {"invalid pins",
       "a triangle at a pinned vertex is so thin at the start that rounding turns it over"},
      {"no overlap", "the two embeddings do not overlap at the start"},
      {"numerical failure",
       "the energy or its derivatives are not finite: a triangle is too thin for them, or the "
       "measure fails"}};
  return kWords[static_cast<int>(s)];
}

/// Pins vertices where the start maps them.
inline bool add_pins(const EmbeddedPair& pair, const std::vector<int>& pins, int first,
                     Array<Follower>& followers, Outcome& outcome) {
  for (int v : pins) {
    const int row = first + v;
    if (pair.s.mesh.pillow.is_cone(row)) continue;  // stays where it is
    const DeepestFace face = pair.face_over(row);
    const SurfacePoint image = pair.image(face);
    if (!image.exists())
      return fail(outcome, Status::kInvalidPins,
                  {"pin: vertex ", name_of(pair.s, row), " is not mapped to ",
                   letter(other(side_of(pair.s, row))), " by the start"},
                  {element_id(pair.s, row)});
    followers.push_back(
        follower_in(pair.s.mesh, row, image.face, vec3(image.barycentric), face.motion));
  }
  return true;
}

/// Checks that no pin lies in a triangle of a pinned vertex: chains of followers are not resolved.
inline bool check_chains(const JointSurface& s, const Array<Follower>& followers,
                         Outcome& outcome) {
  Array<char> follows(s.mesh.n_vertices, 0);
  for (const Follower& follower : followers) follows[follower.row] = 1;
  int row = -1, master = -1;
  for (const Follower& follower : followers)
    follower.for_each_master([&](int v, double) {
      if (follows[v] && row < 0) row = follower.row, master = v;
    });
  return row < 0 || fail(outcome, Status::kInvalidPins,
                         {"pin: vertex ", name_of(s, row), " lies in a triangle of vertex ",
                          name_of(s, master), ", which is pinned too"},
                         {element_id(s, row), element_id(s, master)});
}

/// Collects the followers of Options::pins_a, pins_b and exact landmarks.
inline bool find_followers(const JointSurface& s, const Points2& x,
                           const Array<PlacedLandmark>& landmarks, const RunOptions& options,
                           Array<Follower>& followers, Outcome& outcome) {
  if (options.exact_landmarks)
    for (const VertexPair& l : vertex_pairs(landmarks))
      followers.push_back(landmark_follower(s, x, l));
  if (options.pins_a.empty() && options.pins_b.empty()) return true;
  const EmbeddedPair pair(s, x);
  if (pair.overlay.is_too_large)
    return fail(outcome, Status::kMemoryLimit, {words_of(Status::kMemoryLimit).sentence});
  return add_pins(pair, options.pins_a, 0, followers, outcome) &&
         add_pins(pair, options.pins_b, s.n_a, followers, outcome) &&
         check_chains(s, followers, outcome);
}

// ---- compute_map() in steps ----

/// The purpose of a run: the initial embedding, a coarse map to choose from, or the map.
enum class Goal { kStart, kCandidate, kMap };

class StartFinder;

class Run {
  static constexpr double kMostDistortion = 6;  // as if all were stretched 2.4 times
  static constexpr double kMostRise = 1.5;      // relative to the start

 public:
  Run(const MeshView& a, const MeshView& b, const std::vector<Landmark>& landmarks,
      const Options& options, Goal goal)
      : Run(input_of(a, Side::kA, landmarks, options), input_of(b, Side::kB, landmarks, options),
            landmarks, options, goal) {}

  /// `sized`: surfaces that give the scales; null: landmarks may determine them.
  Run(SharedPrepared a, SharedPrepared b, const std::vector<Landmark>& landmarks,
      const Options& options, Goal goal, const SurfacePair* sized = nullptr)
      : a_(std::move(a)),
        b_(std::move(b)),
        given_options_(options),
        options_(options),
        goal_(goal),
        executor_(options_) {
    const NoTraps no_traps;
    if (goal == Goal::kStart) {
      executor_.set_embedding_share(1);
      options_.initial_f = options_.initial_g = Points2();
    }
    if (goal != Goal::kCandidate && sized == nullptr) close_openings(options_, a_, b_);
    return_input();
    for (Side side : {Side::kA, Side::kB})
      if (const Prepared& p = side == Side::kA ? *a_ : *b_;
          !p.given_triangle.empty() && p.given_triangle.back() < 0)
        result_.warnings.push_back(
            {sentence({"the openings of ", letter(side),
                       " are small, and it is mapped as if they were closed; outer_",
                       side == Side::kA ? "a" : "b", " keeps them open"}),
             {}});
    if (build_pair(*a_, *b_, landmarks, options_, pair_, placed_, result_)) {
      if (sized == nullptr) {
        fit_sizes(placed_, options_, pair_, result_);
      } else {
        rescale(sized->a.scale / pair_.a.scale, pair_.a);
        rescale(sized->b.scale / pair_.b.scale, pair_.b);
      }
      refine(options_, pair_, placed_);
      result_.status = Status::kNoMapYet;
      result_.message = words_of(Status::kNoMapYet).sentence;
      is_embedding_ = true;
      if (goal == Goal::kStart) options_.coarsest = 0;  // landmarks stay together
      whole_ = pair_;
      opened_ = placed_;
    } else {
      static_cast<Outcome&>(result_.start) = result_;
    }
  }

  /// Bringing a coarse map to the given meshes costs about as much as some iterations, so this
  /// happens once per level, and when the caller has stopped.
  Result& result() {
    if (const PairEmbedder* const levels = embedder_ ? embedder_->levels_now() : nullptr)
      show_coarse_map(*levels);
    return result_;
  }
  bool is_embedding() const { return is_embedding_; }
  /// The choice of cones that is tried first.
  void begin_with_cones(int choice) { options_.first_cones = choice; }
  /// The surfaces that are optimised, on a pillow if both are closed, and the positions.
  const SurfacePair& surfaces() const { return pair_; }
  Points2 positions() const { return optimizer_ ? own_positions() : start_; }
  double fraction() const { return executor_.fraction(); }

  /// Returns a run on the same surfaces that continues from the current map with other landmarks
  /// and options; null, with the reason in the outcome, if they are refused.
  std::unique_ptr<Run> changed(const std::vector<Landmark>& landmarks, Options options,
                               Outcome& outcome) const {
    options.boundary = given_options_.boundary;
    options.keep_scale = given_options_.keep_scale;
    options.refine = given_options_.refine;
    options.initial_f = given_options_.initial_f;
    options.initial_g = given_options_.initial_g;
    auto run = std::make_unique<Run>(a_, b_, landmarks, options, goal_, &whole_);
    if (run->is_embedding() && is_usable(result_.status)) run->go_on_from(*this);
    if (run->is_embedding() || is_usable(run->result_.status)) return run;
    fail(outcome, run->result_.status, {run->result_.message}, run->result_.ids);
    return nullptr;
  }

  /// Runs a step of the embedding or an iteration; true while there is more to do. The result is
  /// then complete, as if the call ended here.
  bool step() {
    const NoTraps no_traps;
    if (!is_embedding() && !is_usable(result_.status)) return false;
    executor_.resume();
    if (result_.status == Status::kCancelled || result_.status == Status::kTimeLimit)
      result_.status = Status::kUnfinished;
    Timer timer;
    const std::size_t iterations_before = result_.log.size();
    if (is_embedding())
      embed();
    else if (pull_)
      bring_together();
    else if (optimizer_)
      optimizer_->iterate(result_);
    if (result_.status == Status::kNumericalFailure && is_changed_) {
      result_.message = words_of(result_.status).sentence;
      stall(result_);
    }
    if (result_.log.size() > iterations_before)
      executor_.tell(false, optimizer_->fraction(result_), {"optimising the map"},
                     &result_.log.back());
    const bool is_stopped = executor_.is_stopped();
    if (is_embedding()) wait();
    if (optimizer_) hand_over();
    if (optimizer_) result_.seconds += timer.lap();
    executor_.pause();
    const bool has_more = is_embedding() || result_.status == Status::kUnfinished;
    if (!has_more && !is_stopped) {
      executor_.finish();
      judge(result_);
    }
    return has_more && !is_stopped;
  }

 private:
  // ---- changes, and landmarks apart in given positions ----
  //
  // Algorithm 1 continues with springs of growing stiffness between the landmarks, which costs
  // little of the optimised quality. Exact ones are joined as soon as all can be; else
  // LandmarkJoiner takes over, and most of that quality is lost.

  /// Starts from the map of another run on the same surfaces.
  void go_on_from(const Run& before) {
    const NoTraps no_traps;
    opening_ = before.opening_;
    open();
    pair_ = before.joiner_ ? before.pair_before_ : before.pair_;
    Embedding& start = result_.start;
    const Points2 x = before.positions();
    omega_before_ = kNextOmega;
    if (before.optimizer_) {
      scale_ = before.scale_;
      omega_before_ = before.optimizer_->omega();
    }
    start.f = rows_between(x, 0, pair_.a.mesh.n_vertices);
    start.g = rows_between(x, pair_.a.mesh.n_vertices, rows_of(x));
    start.seconds = before.result_.start.seconds;
    result_.seconds = before.result_.seconds;
    is_changed_ = true;
    pulled_ = before.landmarks_to_pull(placed_, options_.exact_landmarks);
    begin_at_positions();
    if (optimizer_) hand_over();
  }

  /// Returns positions of all vertices, in the unit of given positions.
  Points2 own_positions() const { return 1 / scale_ * optimizer_->positions(); }

  /// Returns the landmarks to pull: all exact ones; guiding ones that are new or being pulled.
  Array<int> landmarks_to_pull(const Array<PlacedLandmark>& landmarks, bool are_exact) const {
    const auto is_same = [](const LandmarkPoint& p, const LandmarkPoint& q) {
      return p.vertex == q.vertex && p.point.face == q.point.face &&
             p.point.barycentric == q.point.barycentric;
    };
    const auto is_at_rest = [&](const Landmark& l) {
      for (int i = 0; i < placed_.size(); ++i)
        if (is_same(placed_[i].given.a, l.a) && is_same(placed_[i].given.b, l.b))
          return !pull_ || !is_pulled(i);
      return false;
    };
    return numbers_where(landmarks.size(),
                         [&](int i) { return are_exact || !is_at_rest(landmarks[i].given); });
  }

  bool is_pulled(int landmark) const {
    return std::binary_search(pulled_.begin(), pulled_.end(), landmark);
  }

  /// Begins at the positions of the start. Exact landmarks in triangles become vertices first.
  void begin_at_positions() {
    Embedding& start = result_.start;
    if ((!options_.exact_landmarks ||
         add_landmark_vertices(located(opened_, pair_), options_, pair_, start)) &&
        !(is_injective(pair_.a.mesh, start.f) && is_injective(pair_.b.mesh, start.g)))
      fail(start, Status::kInvalidLandmarks,
           {"landmarks are too close to edges, for the positions there are"});
    accept_start();
  }

  struct Pull {
    Array<PlacedLandmark> apart;
    double weight = 1;
    int iteration = 0;  // of this weight
  };

  /// Runs an iteration with springs between landmarks that are apart; false: it is to be repeated.
  bool pull() {
    if (pull_->iteration == 0) {
      Array<Spring> springs;
      for (const PlacedLandmark& l : pull_->apart)
        add_springs(s_.mesh, optimizer_->positions(), l.a, in_joint(s_, l.b),
                    diagonal(pull_->weight / pull_->apart.size()), springs);
      optimizer_->set_springs(std::move(springs));
    }
    Result result;
    result.status = Status::kUnfinished;
    optimizer_->iterate(result);  // with its own log: E may rise, and no stopping rule applies
    if (result.status == Status::kUnfinished && result.log.empty()) return false;
    executor_.tell(false, 0, {"bringing landmarks together: ", pull_->apart.size()}, nullptr);
    if (!result.log.empty() && ++pull_->iteration < (options_.exact_landmarks ? 4 : 2)) return true;
    pull_->iteration = 0;
    pull_->weight *= 10;
    return true;
  }

  /// Runs a step that pulls landmarks together.
  void bring_together() {
    if (joiner_) {
      if (!joiner_->step(joining_)) end_change();
      return;
    }
    if (!pull()) return;
    constexpr double kHardest = 1e10;
    const bool is_last = pull_->weight > (options_.exact_landmarks ? kHardest : kStiffest);
    Points2 x = optimizer_->positions();
    const Array<VertexPair> landmarks = vertex_pairs(located(opened_, pair_));
    Array<VertexPair> apart, joined;
    if (options_.exact_landmarks) apart = landmarks;
    join_landmarks(s_, x, apart, joined);
    if (!is_last && (!options_.exact_landmarks || !apart.empty())) return;
    joining_ = Embedding();
    joining_.f = rows_between(x, 0, s_.n_a);
    joining_.g = rows_between(x, s_.n_a, s_.mesh.n_vertices);
    if (apart.empty()) return end_change();
    pair_before_ = pair_;
    joiner_ = std::make_unique<LandmarkJoiner>(pair_, landmarks, options_, executor_);
  }

  /// Ends a change: continues from joined landmarks, or stalls if they could not be joined.
  void end_change() {
    pull_.reset();
    joiner_.reset();
    pulled_.clear();
    if (joining_.status != Status::kDone) {
      has_reason_ = true;
      if (!is_changed_)
        return void(fail(result_, joining_.status, {joining_.message}, joining_.ids));
      pair_ = std::move(pair_before_);
      return stall(joining_);
    }
    omega_before_ = optimizer_->omega();
    Embedding& start = result_.start;
    start.f = 1 / scale_ * joining_.f;
    start.g = 1 / scale_ * joining_.g;
    accept_start();
    if (!is_usable(result_.status)) {
      const Outcome why = result_;
      followers_.clear();  // releases all constraints
      optimizer_ = std::make_unique<Optimizer>(s_, options_, followers_, executor_);
      optimizer_->start(scale_ * start_, result_);
      optimizer_->lower_omega(omega_before_);
      return stall(why);
    }
  }

  /// Ends with the current map, from which the request cannot be met.
  void stall(const Outcome& why) {
    result_.message = why.message;
    result_.ids = why.ids;
    result_.status = Status::kStalled;
    has_reason_ = true;
  }

  // ---- the embedding, and the start of the loop ----

  void embed() {
    if (options_.has_positions()) return take_positions();
    if (!embedder_) return finds_start() ? find_start() : begin_embedding({}, nullptr);
    if (embedder_->step()) return;
    Embedding& start = result_.start;
    if (executor_.is_stopped() && embedder_->result().status == Status::kDone) return;
    result_.coarse = embedder_->levels();
    embedder_->result().seconds += start.seconds;  // of the candidates
    start = std::move(embedder_->result());
    embedder_.reset();
    result_.warnings.insert(result_.warnings.end(), start.warnings.begin(), start.warnings.end());
    start.warnings = result_.warnings;
    if (!result_.coarse.empty()) omega_before_ = kNextOmega;
    accept_start();
  }

  void take_positions() {
    Embedding& start = result_.start;
    start.f = options_.initial_f;
    start.g = options_.initial_g;
    start.warnings = result_.warnings;
    pulled_ = numbers_below(placed_.size());
    const bool are_valid = check_positions(pair_.a.mesh, start.f, "initial_f", start) &&
                           check_positions(pair_.b.mesh, start.g, "initial_g", start);
    are_valid ? begin_at_positions() : accept_start();
  }

  /// The paper's start uses the landmarks alone.
  bool finds_start() const {
    const bool has_cones = !are_closed(whole_) || placed_.size() >= 4 || goal_ == Goal::kCandidate;
    return (options_.candidates && !options_.as_published) || !has_cones;
  }

  void find_start();

  /// `guides`: pairs found on whole_. `mapped`: a coarse map, or null.
  void begin_embedding(const Array<PlacedLandmark>& guides, std::unique_ptr<MappedLevel> mapped) {
    constexpr int kFewest = 300;
    find_opening();
    open();
    const int most = (std::max)(pair_.a.mesh.n_vertices, pair_.b.mesh.n_vertices);
    // Small surfaces have one coarse level, too.
    options_.coarsest = (std::min)(options_.coarsest, (std::max)(int{kFewest}, most / 2));
    embedder_ = std::make_unique<Embedder>(pair_, opened_, opened(guides), std::move(mapped),
                                           options_, executor_);
  }

  void find_opening() {
    const bool is_found = opening_.a >= 0 || opening_.b >= 0;
    if (is_found || is_closed(whole_.a) == is_closed(whole_.b)) return;
    executor_.tell(true, 0, {"looking where to open the closed surface"}, nullptr);
    Array<Place> a, b;
    for (const PlacedLandmark& l : placed_) a.push_back(l.a), b.push_back(l.b);
    if (is_closed(whole_.a))
      opening_.a = detail::find_opening(whole_.a, a, whole_.b, b);
    else
      opening_.b = detail::find_opening(whole_.b, b, whole_.a, a);
  }

  void open() {
    pair_ = {detail::opened(whole_.a, opening_.a), detail::opened(whole_.b, opening_.b)};
    opened_ = opened(placed_);
  }

  Array<PlacedLandmark> opened(Array<PlacedLandmark> landmarks) const {
    for (PlacedLandmark& l : landmarks) {
      l.a = detail::opened(l.a, whole_.a.mesh, pair_.a.mesh);
      l.b = detail::opened(l.b, whole_.b.mesh, pair_.b.mesh);
    }
    return landmarks;
  }

  void accept_start() {
    Embedding& start = result_.start;
    is_embedding_ = false;
    return_input();
    return_start();
    result_.f = result_.g = Points2();
    if (start.status != Status::kDone)
      return void(fail(result_, start.status, {start.message}, start.ids));
    s_ = join(pair_);
    double largest = 0;
    for (const PlacedLandmark& l : located(opened_, pair_))
      largest = (std::max)(largest, norm(gap_at(s_, start_, l)));
    start.landmark_distance = largest / domain_radius(start_);
    result_.status = Status::kDone;
    if (goal_ != Goal::kStart) begin_loop();
  }

  /// Takes the positions of the start, which then has those of the embedded meshes.
  void return_start() {
    Embedding& start = result_.start;
    start_ = stacked(start.f, start.g);
    const Surface a = cut_pillow(pair_.a), b = cut_pillow(pair_.b);
    start.a = with_added_vertices(a_->mesh, a);
    start.b = with_added_vertices(b_->mesh, b);
    start.added_a = a.added;
    start.added_b = b.added;
    if (start.status == Status::kDone) return_positions(start_, start.f, start.g);
  }

  /// Begins Algorithm 1, at first with springs between landmarks to be pulled together.
  void begin_loop() {
    Array<PlacedLandmark> apart, together;
    const Array<PlacedLandmark> landmarks = located(opened_, pair_);
    for (int i = 0; i < landmarks.size(); ++i) {
      const bool is_apart = is_pulled(i) && gap_at(s_, start_, landmarks[i]) != Vec2();
      (is_apart ? apart : together).push_back(landmarks[i]);
    }
    begin(together);
    if (!apart.empty() && optimizer_ && result_.status == Status::kUnfinished)
      pull_ = std::make_unique<Pull>(Pull{apart});
  }

  /// Sets positions to those of a coarse map, unless they are of its level already.
  void show_coarse_map(const PairEmbedder& levels) {
    const int level = static_cast<int>(levels.levels().size());
    if (level == level_shown_ && !executor_.is_stopped()) return;
    Embedding& start = result_.start;
    if (!levels.coarse_map(pair_, start)) return;
    level_shown_ = level;
    static_cast<Outcome&>(start) = Outcome();
    return_start();
    result_.f = start.f, result_.g = start.g;
    result_.coarse = levels.levels();
    const JointSurface s = join(pair_);
    Optimizer(s, options_, {}, executor_).start(start_, result_);
    result_.status = executor_.stop_status();
    result_.message = words_of(result_.status).sentence;
  }

  /// Words the outcome while no map exists.
  void wait() {
    if (is_usable(result_.status)) {
      result_.status = executor_.stop_status();
      result_.message = words_of(result_.status).sentence;
      return;
    }
    result_.message = executor_.stop_status() == Status::kCancelled
                          ? "cancelled before there was a map"
                      : executor_.stop_status() == Status::kTimeLimit
                          ? "stopped at the time limit, before there was a map"
                          : words_of(Status::kNoMapYet).sentence;
    fail(result_.start, Status::kNoMapYet, {result_.message});
  }

  /// Begins Algorithm 1 at the start. `together`: the landmarks that may be exact.
  void begin(const Array<PlacedLandmark>& together) {
    optimizer_.reset();
    followers_.clear();
    result_.log.clear();
    Points2 x = start_;
    if (scale_ == 0) scale_ = options_.has_positions() ? plane_scale(s_, x) : 1;
    x *= scale_;
    result_.status = Status::kUnfinished;
    if (!find_followers(s_, x, together, options_, followers_, result_)) return;
    optimizer_ = std::make_unique<Optimizer>(s_, options_, followers_, executor_);
    if (!options_.as_published) {
      Array<PlacedLandmark> pulling;
      if (!options_.exact_landmarks) pulling = located(opened_, pair_);
      const LandmarkPull pull(s_, pulling, options_.curves);
      if (!pull.is_empty()) optimizer_->set_pull(pull);
    }
    optimizer_->start(x, result_);
    optimizer_->lower_omega(omega_before_);
    if (!is_usable(result_.status)) result_.message = words_of(result_.status).sentence;
  }

  /// Sets status, message and positions as if the call ended here.
  void hand_over() {
    if (result_.status == Status::kUnfinished) result_.status = executor_.stop_status();
    if (!has_reason_) result_.message = words_of(result_.status).sentence;
    if (is_usable(result_.status)) return return_positions(own_positions(), result_.f, result_.g);
    result_.f = result_.g = Points2();
  }

  /// Splits positions of pair_ into those of the embedded meshes, which are cut open.
  void return_positions(const Points2& x, Points2& f, Points2& g) const {
    const int n_a = pair_.a.mesh.n_vertices;
    f = cut_positions(pair_.a.mesh, *result_.start.a, rows_between(x, 0, n_a));
    g = cut_positions(pair_.b.mesh, *result_.start.b, rows_between(x, n_a, rows_of(x)));
  }

  /// Names the worst places, and warns of a map that is too distorted to be useful.
  void judge(Result& r) {
    const double mean = r.final_state().mean_distortion, before = r.initial.mean_distortion;
    const bool has_risen = !is_changed_ && mean > kMostRise * before;
    if (is_judged_ || !is_usable(r.status) || !options_.measure.is_symmetric_dirichlet()) return;
    is_judged_ = true;
    const SurfaceMap map(r);
    if (map.status() != Status::kDone) return;
    r.worst = worst_places(map);
    if (!placed_.empty()) warn_of_landmarks(map, r);
    if (!(mean > kMostDistortion || has_risen)) return;
    Warning warning;
    warning.message = "the map is hardly of use: its mean distortion is " + decimal(mean) +
                      ", where 2 is an isometry and the start had " + decimal(before) +
                      ", and 95% of the area is below " + decimal(summarize(map.distortion()).p95);
    if (!r.worst.empty()) {
      const WorstPlace& worst = r.worst.front();
      warning.ids = {vertex_id(Side::kA, worst.vertex_a)};
      warning.message +=
          sentence({"; it is worst around vertex ", worst.vertex_a, " of A, where ",
                    decimal(100 * worst.area), "% of the area have ", decimal(worst.distortion)});
    }
    warning.message +=
        "; do the surfaces, their sizes and landmarks correspond, and are there enough triangles "
        "(Options::refine)?";
    r.warnings.push_back(std::move(warning));
  }

  /// Names the landmarks that the others and the map contradict, the farthest ones.
  void warn_of_landmarks(const SurfaceMap& map, Result& r) const {
    constexpr double kFar = 0.1;  // of the diagonal of the box of B
    constexpr int kMostNamed = 8;
    const Points3& b = b_->given->vertices;
    const double diagonal = (b.colwise().maxCoeff() - b.colwise().minCoeff()).norm();
    Array<double> distance(placed_.size(), 0);
    int n_far = 0;
    for (int i = 0; i < placed_.size(); ++i) {
      const Landmark& l = placed_[i].given;
      const SurfacePoint image =
          l.a.vertex >= 0 ? map.forward_vertex(l.a.vertex) : map.forward(l.a.point);
      if (!image.exists()) continue;
      const Eigen::Vector3d to =
          l.b.vertex >= 0 ? b.row(l.b.vertex).transpose() : map.position_on_b(l.b.point);
      distance[i] = -(map.position_on_b(image) - to).norm() / diagonal;
      n_far += distance[i] < -kFar;
    }
    if (n_far == 0) return;
    const Array<int> order = sorted_by(distance);
    Array<VertexPair> named;
    for (int i = 0; i < (std::min)(n_far, int{kMostNamed}); ++i)
      named.push_back({-1, -1, placed_[order[i]].given});
    Warning warning;
    const std::string names = names_of(named, warning.ids);
    warning.message = sentence(
        {n_far, " of ", placed_.size(), " landmarks may be wrong: the map takes ", "them up to ",
         decimal(-distance[order[0]]), " of the diagonal of B from where they should be:", names});
    r.warnings.push_back(std::move(warning));
  }

  /// Sets the fields of the result that describe the given meshes.
  void return_input() {
    Embedding& start = result_.start;
    start.prepared_a = a_;
    start.prepared_b = b_;
    start.opening_a = opening_.a < 0 ? -1 : whole_.a.given_id(opening_.a);
    start.opening_b = opening_.b < 0 ? -1 : whole_.b.given_id(opening_.b);
    start.scale_a = whole_.a.scale;
    start.scale_b = whole_.b.scale;
    start.a = a_->mesh;
    start.b = b_->mesh;
  }

  SharedPrepared a_, b_;
  const Options given_options_;
  RunOptions options_;  // with ids of the prepared meshes
  const Goal goal_;
  Executor executor_;
  SurfacePair whole_;             // the prepared surfaces
  SurfacePair pair_;              // the surfaces being optimised, on a pillow if both are closed
  Array<PlacedLandmark> placed_;  // the landmarks on whole_,
  Array<PlacedLandmark> opened_;  // and after opening
  std::shared_ptr<StartFinder> finder_;
  OpeningPair opening_;  // of pair_
  Result result_;
  std::unique_ptr<Embedder> embedder_;
  JointSurface s_;
  Points2 start_;     // of pair_
  double scale_ = 0;  // of the planes, relative to given positions; 0 until known
  Array<Follower> followers_;
  std::unique_ptr<Optimizer> optimizer_;
  bool is_changed_ = false;          // continues from the map of another run,
  double omega_before_ = kInfinity;  // with this ω_L
  Array<int> pulled_;                // to be pulled together if apart
  std::unique_ptr<Pull> pull_;
  std::unique_ptr<LandmarkJoiner> joiner_;
  Embedding joining_;
  SurfacePair pair_before_;
  bool is_embedding_ = false;
  int level_shown_ = 0;      // of the coarse map in the result
  bool has_reason_ = false;  // the message says more than the status
  bool is_judged_ = false;   // judge() was called for the final map
};

// ---- candidates ----
//
// Purpose:    finds the right start if the given landmarks do not define it.
// Method:     Surfaces of a few hundred vertices are mapped from several starts: the landmarks
//             alone, with pairs of points from alignments in space, and with ends of limbs that
//             have the same distances along the surfaces, for other poses. Algorithm 1 takes a few
//             iterations from each. If the first two lead to one map that is not poor, or one has
//             little distortion, the others are not tried; else the best starts of different maps
//             continue. The map with the least distortion for its coverage wins. If it takes the
//             tip of a limb near to another tip, new starts bring both together, and win if they
//             are better. The levels continue from the map itself; if a closed surface is cut open
//             before it is decimated, from points spread over the map. A start of two closed
//             surfaces has its own cones.
// Invariants: results do not depend on pauses.
// Fails:      finds nothing if no start can be mapped.

/// Tips of A and B that may correspond, and the distance by which a map misses this.
struct TipPair {
  int a = -1, b = -1;
  double miss = kInfinity;
};

/// Returns the largest number of triangles around a vertex.
inline int largest_fan(const HalfEdgeMesh& m) {
  Array<int> triangles(m.n_vertices, 0);
  for (int v : m.tail) ++triangles[v];
  return *std::max_element(triangles.begin(), triangles.end());
}

class StartFinder {
 public:
  StartFinder(const SurfacePair& whole, const Array<PlacedLandmark>& landmarks,
              const Options& options, const Executor& executor)
      : whole_(whole),
        landmarks_(landmarks),
        landmark_weight_(options.exact_landmarks ? 100 : 1),
        coarsest_(options.coarsest > 0 ? options.coarsest : Options().coarsest),
        executor_(executor) {
    options_.measure = options.measure;
    options_.coverage_weight = options.coverage_weight;
    options_.history_length = options.history_length;
    options_.omega_start = options.omega_start;
    options_.as_published = options.as_published;
    options_.parallel_for = [&executor](int n, const Executor::Task& task) {
      executor.run(n, task);  // on one thread where candidates run side by side
    };
    options_.max_iterations = 200;
    options_.tolerance = 1e-3;
    options_.keep_scale = true;
    options_.candidates = options_.weld = false;
    options_.coarsest = 0;
    options_.refine = 0;
  }

  /// Does a piece of the work; true while there is more. If the caller stops it, the next call
  /// repeats it.
  bool step() {
    constexpr int kIterations[] = {12, 30, 60, 60, 60, 200}, kLast = 5;
    constexpr double kGood = 2.4;  // no limb is missed where the distortion is this low
    constexpr double kPoor = 4;    // two starts that lead to one map may both miss one
    if (!a_) return decimate(whole_.a, Side::kA, level_->a, a_), true;
    if (!b_) return decimate(whole_.b, Side::kB, level_->b, b_), true;
    if (candidates_.empty()) return find_candidates(), true;
    executor_.tell(true, 0, {"trying ", running_, " starts"}, nullptr);
    const int first = next_, n = (std::min)(int{kAtOnce}, running_ - first);
    const bool are_first = round_ == 0 && running_ == kFirst && candidates_.size() > kFirst;
    const int most = kIterations[are_first ? 1 : round_];
    executor_.run(n, [&](int i) { improve(candidates_[first + i], most); });
    next_ = first + n < running_ ? first + n : 0;
    if (next_ > 0) return true;
    for (int i = 0; i < running_; ++i)
      if (candidates_[i].has_more) return true;
    const double least = (std::min)(candidates_[0].value, candidates_[running_ - 1].value);
    if (are_first && !(least < kGood) && (least > kPoor || is_different(candidates_[1], 1)))
      return running_ = candidates_.size(), true;
    if (round_ == kLast) return take_best(), false;
    drop_worst();
    const bool is_good = candidates_[0].value < kGood;
    if (++round_ < kWithTips && !is_good) return true;
    if (round_ == kLast || is_good || !add_tips()) round_ = kLast, running_ = 1;
    return true;
  }

  const Array<PlacedLandmark>& guides() const { return guides_; }
  std::vector<StartCandidate> candidates() const {
    std::vector<StartCandidate> result;
    for (const Candidate& c : candidates_) {
      const int iterations = static_cast<int>(c.run->result().log.size());
      if (c.has_more) continue;  // not tried
      result.push_back({c.name, c.value, iterations, difference(candidates_[0], c)});
    }
    return result;
  }

  OpeningPair opening() const { return opening_; }
  /// The map itself; null if surfaces were opened for it, which happens before decimation.
  std::unique_ptr<MappedLevel> take_level() { return std::move(level_); }

 private:
  struct Candidate {  // pairs on the decimated surfaces, and the map they lead to
    std::string name;
    std::unique_ptr<Run> run;
    SurfaceMap map = {};
    double value = kInfinity;
    bool has_more = true;
    bool has_tried_tips = false;
  };

  void decimate(const Surface& s, Side side, std::unique_ptr<Hierarchy>& h,
                std::unique_ptr<Level>& level) const {
    executor_.tell(true, 0, {"decimating ", letter(side)}, nullptr);
    Array<char> keep(s.mesh.n_vertices, 0);
    for (const PlacedLandmark& l : landmarks_)
      for (int v : (side == Side::kA ? l.a : l.b).corners)
        if (v >= 0 && landmarks_.size() <= kMostLeading) keep[v] = 1;
    // Fans over each other make a number of polygons quadratic in their triangles.
    constexpr int kFewest = 100, kRatio = 2, kLargestFan = 64;
    int n = (std::max)((std::min)(s.mesh.n_vertices / kRatio, coarsest_), int{kFewest});
    do {
      h = std::make_unique<Hierarchy>(s, side, keep, n, nullptr, -1, executor_);
      if (!executor_.is_stopped()) level = std::make_unique<Level>(h->current());
      n /= kRatio;
    } while (level && largest_fan(level->surface.mesh) > kLargestFan && n >= kFewest);
  }

  void find_candidates() {
    constexpr int kAlignments = 3, kPairs = 24, kMatchings = 6;
    coarse_a_ = {a_->surface.vertices, triangles_from(a_->surface.mesh.tail)};
    coarse_b_ = {b_->surface.vertices, triangles_from(b_->surface.mesh.tail)};
    tips_a_ = find_tips(a_->surface);
    tips_b_ = find_tips(b_->surface);
    constexpr int kFew = 120, kMany = 480;
    const SurfacePair pair = {a_->surface, b_->surface};
    find_leading_landmarks(pair);
    samples_ = sampled(pair, leading_, kMany);
    const Array<Alignment> alignments =
        find_alignments(sampled(pair, leading_, kFew), samples_, kAlignments, executor_);
    if (executor_.is_stopped()) return;
    if (leading_.size() > 1 || alignments.empty()) candidates_.push_back(begun(kLandmarks, {}));
    for (int i = 0; i < alignments.size(); ++i) add_candidate(alignments, i, kPairs);
    int cones = 2;  // other ones, too
    for (int n : {12, 16, 32, 48})
      if (!alignments.empty()) {
        add_candidate(alignments, 0, n);
        candidates_.back().run->begin_with_cones(++cones);
      }
    constexpr int kEnough = 8;  // landmarks tell limbs apart
    if (leading_.size() < kEnough) {
      int which = 0;
      const Tips ends_a = ends_of_limbs(pair.a, tips_a_), ends_b = ends_of_limbs(pair.b, tips_b_);
      for (const auto& pairs : match_by_distances(ends_a, ends_b, leading_, kMatchings)) {
        Array<Landmark> guides;
        for (const VertexPair& p : pairs) guides.push_back({p.a, p.b, 0});
        candidates_.push_back(begun(sentence({kEnds, ++which}), guides));
      }
    }
    running_ = (std::min)(candidates_.size(), int{kFirst});
  }

  /// Returns the given landmarks at remaining vertices; of many, those that agree.
  void find_leading_landmarks(const SurfacePair& pair) {
    const bool are_many = landmarks_.size() > kMostLeading;
    Array<VertexPair> found;
    Array<char> is_used_a(a_->vertex.size(), 0), is_used_b(b_->vertex.size(), 0);
    for (PlacedLandmark l : landmarks_) {
      if (are_many) {
        l.a = copy_of(nearest_vertex(pair.a, mean(l.a, whole_.a.vertices)));
        l.b = copy_of(nearest_vertex(pair.b, mean(l.b, whole_.b.vertices)));
      } else if (!move_to_level(*a_, 0, l.a) || !move_to_level(*b_, 0, l.b)) {
        continue;
      }
      const int v = l.a.corners[0], w = l.b.corners[0];
      if (is_used_a[v]++ || (is_used_b[w]++ && !are_many)) continue;
      found.push_back({v, w, l.given});
    }
    leading_ = are_many ? consistent(pair, found, kMostLeading) : found;
  }

  /// `which`: the alignment that gives at most `most` pairs.
  void add_candidate(const Array<Alignment>& alignments, int which, int most) {
    const Array<std::array<int, 2>> pairs = alignments[which].mutual_pairs();
    const auto point = [&](int i) { return samples_.a[pairs[i][0]].point; };
    const auto distance = [&](int i, int j) { return norm(point(j) - point(i)); };
    Array<double> nearest(pairs.size(), kInfinity);
    for (int i = 0; i < pairs.size(); ++i)
      for (const VertexPair& l : leading_)
        nearest[i] = (std::min)(nearest[i], norm(point(i) - row3(a_->surface.vertices, l.a)));
    Array<Landmark> guides;
    for (int i : farthest_items(most, nearest, distance))
      guides.push_back({samples_.a[pairs[i][0]].on, samples_.b[pairs[i][1]].on, 0});
    const std::string name = sentence({"alignment ", which + 1, ", ", most, " pairs"});
    candidates_.push_back(begun(name, guides));
  }

  Candidate begun(const std::string& name, const Array<Landmark>& guides) const {
    std::vector<Landmark> all;
    for (const VertexPair& l : leading_) all.push_back({l.a, l.b, landmark_weight_});
    all.insert(all.end(), guides.begin(), guides.end());
    return {name, std::make_unique<Run>(coarse_a_, coarse_b_, all, options_, Goal::kCandidate)};
  }

  /// Takes a step, up to a number of iterations.
  void improve(Candidate& candidate, int iterations) const {
    constexpr int kMany = 8000;  // polygons; fans of needles over each other have the square
    const Result& result = candidate.run->result();
    const int polygons = (std::max)(result.final_state().polygons, int{kMany});
    const int most = (std::max)(1, static_cast<int>(std::int64_t{iterations} * kMany / polygons));
    const int done = static_cast<int>(result.log.size());
    candidate.has_more = done < most && candidate.run->step();
    if (candidate.has_more || !is_usable(result.status)) return;
    candidate.map = SurfaceMap(result);
    if (candidate.map.status() != Status::kDone) return;
    constexpr double kMissed = 1;  // how much all landmarks weigh
    const IterationLog& last = result.final_state();
    const double area_a = a_->surface.total_area, area_b = b_->surface.total_area;
    const double most_coverage = 1 + (std::min)(area_a, area_b) / (std::max)(area_a, area_b);
    candidate.value = last.mean_distortion * most_coverage / (last.coverage_a + last.coverage_b);
    candidate.value *= 1 + kMissed * missed_landmarks(candidate);
  }

  /// Returns the share of given landmarks that a map misses; an uncovered one counts half.
  double missed_landmarks(const Candidate& candidate) const {
    constexpr double kFar = 0.5;  // in roots of the area
    if (leading_.empty()) return 0;
    double sum = 0;
    for (const VertexPair& l : leading_) {
      const SurfacePoint image = candidate.map.forward_vertex(l.a);
      if (!image.exists()) {
        sum += 0.5;
        continue;
      }
      const Vec3 at = vec3(candidate.map.position_on_b(image));
      const double distance = norm(at - row3(b_->surface.vertices, l.b)) / kFar;
      sum += (std::min)(1.0, distance * distance / b_->surface.total_area);
    }
    return sum / leading_.size();
  }

  /// Keeps the best starts of different maps. Those from ends of limbs have places of their own:
  /// they begin lower than others and may end higher. The start of the landmarks alone stays until
  /// tips were tried, since it may then lead to another map.
  void drop_worst() {
    const auto first = candidates_.begin(), last = first + running_;
    std::stable_sort(first, last,
                     [](const Candidate& u, const Candidate& v) { return u.value < v.value; });
    const bool is_first = round_ == 0;
    int n = 0, room_for_ends = is_first ? 2 : 1, room = is_first ? 5 : 3;
    for (int i = 0; i < running_; ++i) {
      const Candidate& c = candidates_[i];
      const bool stays = c.name == kLandmarks && round_ < kWithTips;
      int& left = c.name.compare(0, kEnds.size(), kEnds) == 0 ? room_for_ends : room;
      if (!stays && (left == 0 || !is_different(c, n))) continue;
      if (left > 0) --left;
      std::swap(candidates_[n++], candidates_[i]);
    }
    running_ = n;
  }

  /// True if the map of a candidate differs from those of the first n.
  bool is_different(const Candidate& candidate, int n) const {
    constexpr double kSame = 0.05;  // root of the mean squared distance of images
    for (int i = 0; i < n; ++i)
      if (difference(candidates_[i], candidate) < kSame) return false;
    return true;
  }

  /// Returns the root of the mean squared distance between images of vertices of A that both maps
  /// cover, in roots of the area; infinite if there are none.
  double difference(const Candidate& one, const Candidate& other) const {
    if (!(one.value < kInfinity && other.value < kInfinity)) return kInfinity;
    double sum = 0;
    int both = 0;
    for (int v = 0; v < a_->vertex.size(); ++v) {
      const SurfacePoint p = one.map.forward_vertex(v), q = other.map.forward_vertex(v);
      if (!p.exists() || !q.exists()) continue;
      sum += (one.map.position_on_b(p) - other.map.position_on_b(q)).squaredNorm();
      ++both;
    }
    return both > 0 ? std::sqrt(sum / both / b_->surface.total_area) : kInfinity;
  }

  /// Adds starts that take tips of A to the tips of B nearest to their images so far; false if
  /// there are none to try.
  bool add_tips() {
    Array<Candidate> next;
    for (int i = 0; i < running_; ++i) {
      Candidate& candidate = candidates_[i];
      if (candidate.has_tried_tips || !(candidate.value < kInfinity)) continue;
      candidate.has_tried_tips = true;
      const Array<TipPair> tips = match_tips(candidate.map);
      if (tips.empty()) continue;
      Array<Landmark> guides;
      for (const TipPair& tip : tips) guides.push_back({tip.a, tip.b, 0});
      for (const Landmark& l : spread_over(candidate, tips)) guides.push_back(l);
      const std::string name = sentence({candidate.name, ", ", tips.size(), " tips"});
      next.push_back(begun(name, guides));
    }
    const bool has_more = !next.empty();
    next.push_back(std::move(candidates_[0]));
    running_ = next.size();
    for (int i = 1; i < candidates_.size(); ++i) next.push_back(std::move(candidates_[i]));
    candidates_.swap(next);
    return has_more;
  }

  /// Returns pairs of tips of A and B, each nearest to the image of the other one.
  Array<TipPair> match_tips(const SurfaceMap& map) const {
    const auto distance = [](const Surface& s, const Array<double>& to, const SurfacePoint& p) {
      double d = 0;
      for (int k = 0; k < 3; ++k) d += p.barycentric[k] * to[s.mesh.corner(p.face, k)];
      return d;
    };
    Array<TipPair> of_a(tips_a_.vertex.size(), TipPair()), of_b(tips_b_.vertex.size(), TipPair());
    for (int i = 0; i < of_a.size(); ++i) {
      const SurfacePoint p = map.forward_vertex(tips_a_.vertex[i]);
      for (int j = 0; j < of_b.size(); ++j) {
        const SurfacePoint q = map.backward_vertex(tips_b_.vertex[j]);
        if (!p.exists() || !q.exists()) continue;
        const double miss = (std::max)(distance(b_->surface, tips_b_.distance[j], p),
                                       distance(a_->surface, tips_a_.distance[i], q));
        if (miss < of_a[i].miss) of_a[i] = {i, j, miss};
        if (miss < of_b[j].miss) of_b[j] = {i, j, miss};
      }
    }
    constexpr double kReach = 0.6, kClear = 0.1;  // and of landmarks, which suffice
    Array<TipPair> pairs;
    for (const TipPair& p : of_a) {
      bool is_free = p.miss < kReach && of_b[p.b].a == p.a;
      for (const VertexPair& l : leading_)
        is_free =
            is_free && tips_a_.distance[p.a][l.a] > kClear && tips_b_.distance[p.b][l.b] > kClear;
      if (is_free) pairs.push_back({tips_a_.vertex[p.a], tips_b_.vertex[p.b], p.miss});
    }
    return pairs;
  }

  /// Returns pairs of a map spread over A, except around tips that it misses.
  Array<Landmark> spread_over(const Candidate& candidate, const Array<TipPair>& tips) const {
    constexpr double kClear = 0.15;  // of an opening
    const Array<SurfacePoint> images = candidate.map.forward_vertices();
    const Surface& a = a_->surface;
    const auto distance = [&](int v, int w) {
      return norm(row3(a.vertices, w) - row3(a.vertices, v));
    };
    Array<double> nearest(a.mesh.n_vertices, kInfinity);
    const auto spread = [&](int from, double offset) {
      for (int v = 0; v < a.mesh.n_vertices; ++v)
        nearest[v] = (std::min)(nearest[v], distance(from, v) - offset);
    };
    for (int v = 0; v < a.mesh.n_vertices; ++v)
      if (!images[v].exists()) nearest[v] = -kInfinity;
    const int opening = candidate.run->result().start.opening_a;
    if (opening >= 0) spread(opening, kClear);
    for (const TipPair& tip : tips) {
      spread(tip.a, tip.miss);
      const Vec3 end = row3(b_->surface.vertices, tip.b);
      for (int v = 0; v < a.mesh.n_vertices; ++v)
        if (norm(vec3(candidate.map.position_on_b(images[v])) - end) < tip.miss)
          nearest[v] = -kInfinity;  // uncovered ones are nowhere
    }
    for (const VertexPair& l : leading_) spread(l.a, 0);
    Array<Landmark> pairs;
    for (int v : farthest_items(kGuides, nearest, distance)) pairs.push_back({v, images[v], 0});
    return pairs;
  }

  void take_best() {
    constexpr double kWeight = 0.1;  // of a guide; that of a landmark is 1
    if (candidates_.empty() || !(candidates_[0].value < kInfinity)) return level_.reset();
    const Result& best = candidates_[0].run->result();
    const SurfacePair& pair = candidates_[0].run->surfaces();
    const Points2 x = candidates_[0].run->positions();
    const int n_a = pair.a.mesh.n_vertices;
    const bool is_same = n_a == a_->vertex.size() && rows_of(x) - n_a == b_->vertex.size();
    if (!is_same || best.start.opening_a >= 0 || best.start.opening_b >= 0) level_.reset();
    if (level_) {
      level_->f = rows_between(x, 0, n_a), level_->g = rows_between(x, n_a, rows_of(x));
      if (!pair.a.mesh.pillow.is_empty()) {
        level_->a->set_pillow(*a_, pair.a.mesh.pillow);
        level_->b->set_pillow(*b_, pair.b.mesh.pillow);
      }
      level_->log = best.final_state();
      for (const Candidate& c : candidates_)
        if (c.name == kLandmarks) level_->warnings = c.run->result().start.warnings;
    }
    if (best.start.opening_a >= 0) opening_.a = a_->vertex[best.start.opening_a];
    if (best.start.opening_b >= 0) opening_.b = b_->vertex[best.start.opening_b];
    for (const PlacedLandmark& l : landmarks_)
      if (landmarks_.size() <= kMostLeading && agrees(l)) guides_.push_back(l);
    for (const Landmark& l : spread_over(candidates_[0], {})) {
      const Vec3 on_b = vec3(candidates_[0].map.position_on_b(l.b.point));
      guides_.push_back(
          {copy_of(a_->vertex[l.a.vertex]), nearest_place(whole_.b, on_b), {}, kWeight});
    }
  }

  /// Returns false if the best map takes a landmark far from where it should be.
  bool agrees(PlacedLandmark l) const {
    constexpr double kFar = 0.2;  // in roots of the area
    if (!move_to_level(*a_, 0, l.a)) return true;
    const SurfaceMap& map = candidates_[0].map;
    Vec3 at;
    for (int k = 0; k < 3 && l.a.corners[k] >= 0; ++k) {
      const SurfacePoint image = map.forward_vertex(l.a.corners[k]);
      if (!image.exists()) return true;
      at += l.a.weights[k] * vec3(map.position_on_b(image));
    }
    return norm(at - mean(l.b, whole_.b.vertices)) < kFar * std::sqrt(whole_.b.total_area);
  }

  const SurfacePair& whole_;
  const Array<PlacedLandmark>& landmarks_;
  Options options_;  // of all candidates
  const double landmark_weight_;
  const int coarsest_;
  const Executor& executor_;
  std::unique_ptr<MappedLevel> level_ = std::make_unique<MappedLevel>();
  std::unique_ptr<Level> a_, b_;
  TriangleMesh coarse_a_, coarse_b_;
  Array<VertexPair> leading_;  // landmarks
  Tips tips_a_, tips_b_;
  SamplePair samples_;
  const std::string kLandmarks = "landmarks";        // the candidate of the landmarks alone
  const std::string kEnds = "tips ";                 // begins those from ends of limbs
  static constexpr int kGuides = 24, kWithTips = 3;  // the first round that tries tips
  static constexpr int kFirst = 2;                   // of two that lead to one map, it is taken
  static constexpr int kAtOnce = 4;  // candidates; a step is short on one thread, too
  Array<Candidate> candidates_;
  int running_ = 0;  // the first ones
  int next_ = 0;     // to take a step
  int round_ = 0;
  Array<PlacedLandmark> guides_;
  OpeningPair opening_;
};

inline void Run::find_start() {
  if (!finder_) finder_ = std::make_shared<StartFinder>(whole_, placed_, given_options_, executor_);
  Timer timer;
  const bool has_more = finder_->step();
  result_.start.seconds += timer.lap();
  if (has_more) return;
  result_.candidates = finder_->candidates();
  opening_ = finder_->opening();
  begin_embedding(finder_->guides(), finder_->take_level());
  finder_.reset();
}

// ---- data of a SurfaceMap ----

/// Returns the map of the meshes of an embedding by positions f and g, if the outcome has any;
/// scales of 0: to area 1.
inline std::shared_ptr<const MapData> map_data(const Outcome& outcome, const Embedding& e,
                                               const Points2& f, const Points2& g) {
  const NoTraps no_traps;
  auto data = std::make_shared<MapData>();
  if (!is_usable(outcome.status))
    return fail(*data, outcome.status, {outcome.message}, outcome.ids), data;
  data->origin_a = origin_of(e.prepared_a, e.added_a, e.a);
  data->origin_b = origin_of(e.prepared_b, e.added_b, e.b);
  HalfEdgeMesh m, n;
  if (!check_problems(find_problems(*e.a, m), Side::kA, *data)) return data;
  data->a = e.a;
  if (!check_problems(find_problems(*e.b, n), Side::kB, *data)) return data;
  data->b = e.b;
  if (!check_positions(m, f, "f", *data) || !check_positions(n, g, "g", *data)) return data;
  data->f = f, data->g = g;
  HalfEdgeMesh sewn_a, sewn_b;
  if (sew(data->a->triangles, f, data->origin_a.original, sewn_a) &&
      sew(data->b->triangles, g, data->origin_b.original, sewn_b)) {
    m = std::move(sewn_a), n = std::move(sewn_b);
  }
  const Points3 vertices_a = data->a->vertices.topRows(m.n_vertices);
  const Points3 vertices_b = data->b->vertices.topRows(n.n_vertices);
  SurfacePair pair = {build_surface(std::move(m), vertices_a, false),
                      build_surface(std::move(n), vertices_b, false)};
  if (e.scale_a > 0) rescale(e.scale_a / pair.a.scale, pair.a);
  if (e.scale_b > 0) rescale(e.scale_b / pair.b.scale, pair.b);
  data->pair = EmbeddedPair(join(pair), stacked(rows_between(f, 0, pair.a.mesh.n_vertices),
                                                rows_between(g, 0, pair.b.mesh.n_vertices)));
  data->pair.keep_given([&](const OverlayPolygon& p) {
    return data->origin_a.face[p.ta] >= 0 && data->origin_b.face[p.tb - data->pair.s.faces_a] >= 0;
  });
  const Overlay& overlay = data->pair.overlay;
  const Status status = overlay.is_too_large       ? Status::kMemoryLimit
                        : overlay.polygons.empty() ? Status::kNoOverlap
                                                   : Status::kDone;
  if (status != Status::kDone) fail(*data, status, {words_of(status).sentence});
  return data;
}

}  // namespace detail

std::vector<Problem> validate(const MeshView& mesh) {
  detail::HalfEdgeMesh m;
  return detail::find_problems(*detail::shared(mesh), m);
}

Prepared prepare(const MeshView& mesh, const std::vector<LandmarkPoint>& landmarks, bool weld) {
  return detail::prepared(detail::shared(mesh), landmarks, weld);
}

const char* to_string(Status s) { return detail::words_of(s).name; }

Options Options::paper() {
  Options options;
  options.as_published = true;
  options.coverage_weight = -2;  // no reward
  options.omega_start = 1e9;
  options.max_iterations = 550;
  options.coarsest = 0;
  return options;
}

Embedding initial_embedding(const MeshView& a, const MeshView& b,
                            const std::vector<Landmark>& landmarks, const Options& options) {
  detail::Run run(a, b, landmarks, options, detail::Goal::kStart);
  while (run.step()) {
  }
  return std::move(run.result().start);
}

Result compute_map(const MeshView& a, const MeshView& b, const std::vector<Landmark>& landmarks,
                   const Options& options) {
  detail::Run run(a, b, landmarks, options, detail::Goal::kMap);
  while (run.step()) {
  }
  return std::move(run.result());
}

Solver::Solver() : Solver(MeshView(), MeshView()) {}
Solver::Solver(const MeshView& a, const MeshView& b, const std::vector<Landmark>& landmarks,
               const Options& options)
    : run_(std::make_unique<detail::Run>(a, b, landmarks, options, detail::Goal::kMap)) {}
Solver::~Solver() = default;
Solver::Solver(Solver&& other) noexcept = default;
Solver& Solver::operator=(Solver&& other) noexcept = default;

bool Solver::step() { return run_->step(); }

bool Solver::advance(double seconds) {
  const detail::Timer timer;
  bool has_more = run_->step();
  while (has_more && timer.seconds() < seconds) has_more = run_->step();
  return has_more;
}

const Result& Solver::result() const { return run_->result(); }
double Solver::fraction() const { return run_->fraction(); }
Outcome Solver::change(const std::vector<Landmark>& landmarks, const Options& options) {
  Outcome outcome;
  std::unique_ptr<detail::Run> run = run_->changed(landmarks, options, outcome);
  if (run) run_ = std::move(run);
  return outcome;
}

SurfaceMap::SurfaceMap() : SurfaceMap(Result()) {}

SurfaceMap::SurfaceMap(const Result& result)
    : data_(detail::map_data(result, result.start, result.f, result.g)) {}

SurfaceMap::SurfaceMap(const Embedding& start)
    : data_(detail::map_data(start, start, start.f, start.g)) {}

SurfaceMap::SurfaceMap(const MeshView& a, const MeshView& b, const Points2& f, const Points2& g) {
  Embedding e;
  e.a = detail::shared(a), e.b = detail::shared(b);
  e.scale_a = e.scale_b = 0;
  data_ = detail::map_data(e, e, f, g);
}

}  // namespace ISM_ABI
}  // namespace ism

#ifdef ISM_FUSING_IS_OFF
#undef ISM_FUSING_IS_OFF
#pragma GCC pop_options
#elif defined(__clang__)
#pragma STDC FP_CONTRACT DEFAULT
#endif

#endif  // ISM_IMPLEMENTATION

// ==== HISTORY ====================================================================================
//
// 1.0.0  Algorithm 1 with its constraints, held and sliding boundaries and measures; beyond the
//        paper: coverage, coarse to fine, quasi-Newton steps, gaps that stay open, exact landmarks;
//        closed surfaces and surfaces with openings; prepare(), Solver, Transfer; a verifier.
//
// ==== LICENSE ====================================================================================
//
// MIT License
//
// Copyright (c) 2026 the authors of ism.hpp
//
// Permission is hereby granted, free of charge, to any person obtaining a copy
// of this software and associated documentation files (the "Software"), to deal
// in the Software without restriction, including without limitation the rights
// to use, copy, modify, merge, publish, distribute, sublicense, and/or sell
// copies of the Software, and to permit persons to whom the Software is
// furnished to do so, subject to the following conditions:
//
// The above copyright notice and this permission notice shall be included in all
// copies or substantial portions of the Software.
//
// THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR
// IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY,
// FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE
// AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
// LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
// OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE
// SOFTWARE.

// ism.hpp - distortion-minimizing injective maps between surfaces
//
// Given two triangle meshes A and B of disk topology, computes a map Φ from A to B that is
// continuous, injective, symmetric in A and B, and of low distortion. It implements
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
//   ism::TriangleMesh a, b;                                  // fill vertices and triangles
//   std::vector<ism::Landmark> landmarks = {{17, 4}, {32, 90}};  // optional
//   ism::Result result = ism::compute_map(a, b, landmarks);
//   if (ism::is_usable(result.status)) {
//     ism::SurfaceMap map(a, b, result.f, result.g);
//     ism::MappedPoint image = map.forward_vertex(0);        // of vertex 0 of A, on B
//   }
//
// INPUT      Each mesh is a manifold, consistently oriented disk: one component, one boundary
//            loop, no handles. validate() names what is wrong. Cut a hole into a closed mesh.
// PROMISE    Every iterate, so also the result of a cancelled run, is injective: all triangles of
//            f and g are positive, angles around interior vertices add up to 2π, boundaries are
//            simple. Exact predicates decide this on the very coordinates that are returned.
// NOT KEPT   The result is a local minimum; where A and B overlap in the plane is where they are
//            mapped, the rest is not covered (IterationLog::coverage_a), unless Options::boundary
//            lays one on the other. Landmarks guide the start only, unless
//            Options::exact_landmarks is set.
// THREADS    Functions are thread-safe. Work is cut into blocks that do not depend on the number of
//            threads, so results are the same bits for any number. Options::parallel_for plugs in
//            a job system of your own. With -fopenmp, define EIGEN_DONT_PARALLELIZE: else Eigen
//            splits large products, and rounds them, by its number of threads.
// ERRORS     No exceptions, no RTTI, nothing is printed, no global state: a status, a sentence and
//            the ids of offending elements.
//
// MACROS     ISM_NO_THREADS   builds without <thread>
//            ISM_VERSION_MAJOR, ISM_VERSION_MINOR, ISM_VERSION_PATCH
//
// CONTENTS   [1] version and configuration   [2] public API        [3] notation
//            [4] small helpers               [5] exact predicates  [6] half-edge mesh
//            [7] overlay                     [8] energies          [9] sparse LDLT
//            [10] objective, quadratic model and constraints       [11] scaffold
//            [12] line search                [13] the loop (Algorithm 1)
//            [14] initial embedding          [15] map evaluation and meta mesh
//            [16] applications: attributes, morphing           [17] entry points
//
// LICENSE    MIT, see the end of the file.

#ifndef ISM_HPP
#define ISM_HPP

// ==== [1] VERSION AND CONFIGURATION ==============================================================

#define ISM_VERSION_MAJOR 0
#define ISM_VERSION_MINOR 1
#define ISM_VERSION_PATCH 0

#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(_M_FP_FAST)
#error "ism.hpp decides orientations exactly; it cannot be compiled with -ffast-math and the like"
#endif
#include <cfloat>
#if FLT_EVAL_METHOD != 0
#error "ism.hpp decides orientations exactly; doubles must be evaluated as doubles (-mfpmath=sse)"
#endif

#include <Eigen/Core>
#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <queue>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#ifndef ISM_NO_THREADS
#include <thread>
#endif

// ==== [2] PUBLIC API =============================================================================

namespace ism {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Points2 = Eigen::Matrix<double, Eigen::Dynamic, 2>;  // one planar point per row
using Points3 = Eigen::Matrix<double, Eigen::Dynamic, 3>;  // one point in space per row
using Triangles = Eigen::Matrix<int, Eigen::Dynamic, 3>;   // three 0-based vertex ids per row

/// A triangle mesh as plain arrays. Triangles are counter-clockwise seen from outside.
struct TriangleMesh {
  Points3 vertices;     // #V×3, any unit
  Triangles triangles;  // #F×3, ids in [0, #V)
};

/// How a call ended. Every result carries one of these, a sentence and the ids it speaks of; which
/// mesh they belong to, and whether they are vertices or triangles, the sentence says.
enum class Status {
  kConverged,         // the stopping rule of Options::tolerance was met
  kIterationLimit,    // Options::max_iterations reached; the result is the last injective iterate
  kStalled,           // no step along any direction lowers the energy; the result is still valid
  kCancelled,         // the progress callback said stop; the result is the last injective iterate
  kAborted,           // the progress callback said stop before there was a map; no positions
  kInvalidMesh,       // an input mesh is not a clean triangulated disk, see validate()
  kInvalidLandmarks,  // a landmark is out of range, used twice, or cannot be met exactly
  kInvalidOptions,    // an option is outside its documented range
  kInvalidPositions,  // given planar positions are not an injective embedding
  kInvalidPins,       // a pinned or fixed vertex is out of range, listed twice, contradicts another
                      // constraint, is uncovered, or in a chain
  kInvalidAttributes,  // attributes have another number of rows than the mesh has elements
  kNoOverlap,          // f(A) and g(B) do not overlap at the start
  kNumericalFailure    // an embedding failed, please report the mesh; or E, its derivatives or a
                       // factorisation are not finite
};

/// True for the statuses under which the positions are a valid injective map.
inline bool is_usable(Status s) {
  return s == Status::kConverged || s == Status::kIterationLimit || s == Status::kStalled ||
         s == Status::kCancelled;
}

/// The name of a status in words ("converged", "iteration limit", ...).
inline const char* to_string(Status s);

/// One defect of a mesh: what is wrong, in a sentence with the ids, and the ids once more as data.
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
    kClosed,
    kSeveralBoundaries,
    kWrongEulerCharacteristic
  };
  Kind kind;
  std::string message;   // for example "edge 3-7 has 3 triangles: 0, 5, 9"
  std::vector<int> ids;  // vertices, or triangles, as the message says
};

/// Lists everything that keeps a mesh from being a clean triangulated disk; empty means valid.
/// Checks: indices, finite coordinates, degenerate and repeated triangles, edge and vertex
/// manifoldness, orientation, unreferenced vertices, one component, one boundary loop, χ = 1.
/// Cost O(#F log #F). Reports at most 20 problems of each kind. Thread-safe.
inline std::vector<Problem> validate(const TriangleMesh& mesh);

/// A correspondence wanted at the start: vertex a of A should map near vertex b of B.
struct Landmark {
  int a;
  int b;
};

/// What the boundaries may do. Held ones are suggested in §7.
enum class Boundary {
  /// They move freely. What A and B have in common is where they overlap in the plane.
  kFree,
  /// They are laid along the sides of one square and stay there, so A and B cover each other. Four
  /// pairs of vertices become its corners. What corresponds is given by landmarks on the boundaries
  /// and by arc length between them; without such landmarks, by arc length from where the
  /// boundaries lie closest to each other in a free embedding.
  kFixed,
  /// The same at the start, but all vertices except for the corners may slide along their side.
  kSlide
};

/// The variants of the optimiser that the paper compares (§6.1, Fig. 9).
enum class Variant {
  kProjectedNewton,          // PN: per-polygon projected Newton (§5.1, §5.2)
  kSmoothedProjectedNewton,  // SPN: PN with a history of gradients and Hessians (§5.3)
  kFull                      // SPN with the squared Laplacian preconditioner (§5.4)
};

/// What the optimiser did in one iteration. Energies are those after the step; areas and energies
/// are in units of the scaled meshes (each mesh has area 1 unless Options::keep_scale).
struct IterationLog {
  int iteration = 0;
  double energy = 0;           // E = E_Φ - κ (area A' + area B') + ω_R (E_f + E_g)
  double map_energy = 0;       // E_Φ, Eq. 4
  double energy_f = 0;         // E_f, symmetric Dirichlet energy of the embedding of A
  double energy_g = 0;         // E_g, the same of B
  double mean_distortion = 0;  // E_Φ / (area A' + area B'); of an isometry 2, unless measured else
  double coverage_a = 0;       // area A' / area A, in [0, 1]
  double coverage_b = 0;       // area B' / area B
  double omega = 0;            // ω_L of the step taken (§5.4)
  double step = 0;             // s of the step taken
  double max_step = 0;         // s_max at which a triangle would degenerate
  int polygons = 0;            // of the meta mesh
  double pin_residual = 0;     // largest distance of a pinned vertex from its pin, on the surface
  bool history_reset = false;  // the blended direction did not descend (Algorithm 1, line 14)
  double seconds_derivatives = 0, seconds_assembly = 0, seconds_solve = 0, seconds_search = 0;
};

/// What the progress callback receives: a phase, and during optimisation the iteration's log.
struct Progress {
  enum class Phase { kEmbedding, kOptimization };
  Phase phase = Phase::kEmbedding;
  std::string what;                         // a few words, for a progress line
  const IterationLog* iteration = nullptr;  // set in kOptimization
};

/// Runs task(0) ... task(n - 1), in any order and on any threads, and returns when all are done.
using ParallelFor = std::function<void(int n, const std::function<void(int)>& task)>;

/// A distortion density with its derivatives with respect to the entries of the two Jacobians, in
/// the order f11 f21 f12 f22 g11 g21 g12 g22.
struct Density {
  double value = 0;
  Eigen::Matrix<double, 8, 1> gradient = Eigen::Matrix<double, 8, 1>::Zero();
  Eigen::Matrix<double, 8, 8> hessian = Eigen::Matrix<double, 8, 8>::Zero();
};

namespace detail {
struct BuiltInMeasure;
struct InvariantDerivatives;
using InvariantDensity = InvariantDerivatives (*)(double N, double f, double g);
}  // namespace detail

/// What E_Φ measures (§3.2): the integral, over the overlap in the plane, of a function of J_f and
/// J_g, the Jacobians of the embeddings from the surfaces to the plane. J_Φ = J_g⁻¹ J_f, and an
/// area of 1 in the plane is 1 / det J_f on A, 1 / det J_g on B. A measure of your own depends on
/// J_Φ and these areas only, is at least 0 and +∞ unless both determinants are positive, and is
/// thread-safe. It need not prevent flips; E_f and E_g do.
class DistortionMeasure {
 public:
  using Value = std::function<double(const Eigen::Matrix2d& J_f, const Eigen::Matrix2d& J_g)>;
  using Derivatives =
      std::function<Density(const Eigen::Matrix2d& J_f, const Eigen::Matrix2d& J_g)>;
  DistortionMeasure(Value value, Derivatives derivatives)
      : value_(std::move(value)), derivatives_(std::move(derivatives)) {}

  double value(const Eigen::Matrix2d& J_f, const Eigen::Matrix2d& J_g) const {
    return value_(J_f, J_g);
  }
  Density derivatives(const Eigen::Matrix2d& J_f, const Eigen::Matrix2d& J_g) const {
    return derivatives_(J_f, J_g);
  }
  bool is_complete() const { return value_ && derivatives_; }

 private:
  friend struct detail::BuiltInMeasure;
  Value value_;
  Derivatives derivatives_;
  detail::InvariantDensity in_invariants_ = nullptr;  // of the measures below
};

/// ‖J_Φ‖² over B' plus ‖J_Φ⁻¹‖² over A' (Eq. 3). E(Φ) = E(Φ⁻¹); an isometry has 2 per area.
inline DistortionMeasure symmetric_dirichlet();
/// (1 - σ_min)² + (1 - σ_max)² over A' [Liu et al. 2008]. Not symmetric; an isometry has 0.
inline DistortionMeasure arap();
/// (1 - 1/σ_min)² + (1 - σ_max)², half over A' and half over B' [Poranne and Lipman 2016].
/// E(Φ) = E(Φ⁻¹); an isometry has 0, up to 1e-12: where σ_min = σ_max the kink is rounded off.
inline DistortionMeasure sarap();
/// (σ_max - σ_min)² over A'. Not symmetric; a conformal map has 0.
inline DistortionMeasure asap();

/// Options of the embedding and the optimisation. All lengths are relative to the meshes.
struct Options {
  DistortionMeasure measure = symmetric_dirichlet();
  /// κ ≥ 0: reward for covered area, E gains -κ (area A' + area B'). 0 is the paper's objective,
  /// whose global minimum is the empty overlap. With 2 an isometry neither gains nor loses by
  /// shrinking; a little more lets it grow; much more trades low distortion for coverage. Measures
  /// that are 0 for an isometry need 2 less.
  double coverage_weight = 2.2;
  /// ω_R > 0 of §5. With the paper's 1e-8, triangles outside the overlap may degenerate to slivers,
  /// and E_Φ meets a wall where the overlap would have to grow into them.
  double barrier_weight = 3e-4;
  double spd_epsilon = 1e-3;  // ε > 0 of §5.1, lower bound of the eigenvalues of a polygon
  Variant variant = Variant::kFull;
  /// The memory of §5.3. The paper's is 6 and 0.5; a longer one carries the iteration over more of
  /// the kinks that E has where vertices cross edges of the other mesh, and ends lower.
  int history_length = 12;     // ≥ 1
  double history_decay = 0.8;  // in (0, 1]
  /// ω_L of §5.4: its first value (> 0), the factor α > 1 by which an iteration may change it, and
  /// the value in [0, omega_start] below which it hardly acts and is not lowered further.
  double omega_start = 1e4;
  double omega_factor = 2.0;  // the paper's 1.25 takes three times as many iterations to let go
  double omega_least = 1e-4;
  double max_displacement = 0.2;    // > 0, of a vertex in a step, in radii of the domain
  double max_coverage_loss = 0.05;  // > 0, in a step, as a fraction of the area of either mesh
  /// In [0, 1): the share of the area covered at the start that stays covered. Many steps, each
  /// within max_coverage_loss, could otherwise give up the overlap of a pair that fits badly.
  double least_coverage = 0.5;
  /// 1 to 8: the line search tries the steps 0.8^ℓ of every so many ℓ, then those next to the best.
  int search_stride = 3;
  /// ≥ 0: after a step below it, the newest derivatives alone are tried too. The memory from the
  /// other side of a kink may hold an iteration up, in steps that look like convergence.
  double short_step = 0.05;
  /// In (0, 1): relative error of the directions for ω_L / α and α ω_L, which conjugate gradients
  /// find with the factor for ω_L.
  double solve_tolerance = 1e-3;
  int max_iterations = 400;  // ≥ 0
  /// Stop when, averaged over the last `window` iterations, E fell by less than this fraction
  /// of E + κ (area A + area B) per iteration; one that finds no step counts as one without a fall.
  /// The window bridges the pauses before E falls again; while ω_L comes down and is above 1e-3,
  /// nothing stops.
  double tolerance = 1e-4;  // ≥ 0
  int window = 20;          // ≥ 1
  bool keep_scale = false;  // true: the meshes are not scaled to area 1; 1e-50 to 1e50 works
  int threads = 0;  // ≥ 0; 0: as many as there are processors, of which 4 times as many are
                    // the most that are used; results do not depend on it
  ParallelFor parallel_for;  // replaces std::thread by the caller's job system
  /// Called after each level of the embedding and each iteration, from the calling thread; return
  /// false to cancel.
  std::function<bool(const Progress&)> progress;
  /// Vertices of A (of B) that stay on the other surface where the start puts them (§4.5). None of
  /// them may be put into a triangle that has a pinned vertex. Vertices of A in exact landmarks
  /// count as pinned.
  std::vector<int> pins_a, pins_b;
  /// Vertices of A (of B) whose planar positions stay what they are at the start.
  std::vector<int> fixed_a, fixed_b;
  /// Landmarks guide the start only (false), or their images coincide in the plane, from the start
  /// to the end. Those on the boundaries must then have the same order on A and B.
  bool exact_landmarks = false;
  /// With given positions, kFixed holds the boundaries where they are, whatever their shape; kSlide
  /// lets those vertices slide that lie, with both neighbours, on one parallel to an axis.
  Boundary boundary = Boundary::kFree;
  /// Keeps the boundaries of f(A) and of g(B) from themselves by a scaffold (§4.4), from the first
  /// step on that would make one meet itself. Without, a run stalls there.
  bool scaffold = true;
  /// Known planar positions, #V_A×2 and #V_B×2, in any unit; when set, no initial embedding is
  /// computed, and the result is in the same unit.
  Points2 initial_f, initial_g;

  /// The paper's constants: κ = 0, ω_R = 1e-8, history of 6 with 0.5, ω_L from 1e9, α = 1.25, all
  /// steps of the line search, at most 550 iterations. The bounds on a step stay: without them the
  /// empty overlap is reached in the first iterations.
  static Options paper() {
    Options options;
    options.coverage_weight = 0;
    options.barrier_weight = 1e-8;
    options.history_length = 6;
    options.history_decay = 0.5;
    options.omega_start = 1e9;
    options.omega_factor = 1.25;
    options.omega_least = 0;
    options.max_iterations = 550;
    options.least_coverage = 0;
    options.search_stride = 1;
    options.short_step = 0;
    options.solve_tolerance = 1e-12;
    options.window = 10;
    options.scaffold = false;
    return options;
  }
};

/// The ends of the edge in whose middle a vertex was added to a mesh.
using Midpoint = std::array<int, 2>;

/// Two planar embeddings; Φ = g⁻¹ ∘ f (§4.1).
struct Embedding {
  Status status = Status::kConverged;
  std::string message;
  std::vector<int> ids;  // ids the message speaks of
  /// The meshes that were embedded: those given, and where a constraint needs it, with vertices
  /// added behind the given ones. The surfaces are the same.
  TriangleMesh a, b;
  std::vector<Midpoint> added_a, added_b;  // the added vertices in order; earlier ones may be ends
  Points2 f;  // planar positions of the vertices of `a`, about as large as the meshes
  Points2 g;  // of the vertices of `b`
  /// Largest distance in the plane between the two images of a landmark, in domain radii.
  double landmark_distance = 0;
  double seconds = 0;
};

/// The outcome of compute_map(). Positions are valid, and to be used, if is_usable(status).
struct Result {
  Status status = Status::kConverged;
  std::string message;            // a sentence for the user
  std::vector<int> ids;           // ids the message speaks of
  Points2 f, g;                   // final planar positions of the vertices of start.a, start.b
  Embedding start;                // what the optimisation started from
  IterationLog initial;           // the energies of the start (iteration 0, no step)
  std::vector<IterationLog> log;  // one entry per iteration
  double seconds = 0;             // of the optimisation; those of the start are in start.seconds
  /// The last state, for a summary: log.back(), or the start when there was no iteration.
  const IterationLog& final_state() const { return log.empty() ? initial : log.back(); }
};

/// Embeds both meshes injectively in one plane, with landmarks close to each other (§6).
/// kNumericalFailure names the vertex for which rounding leaves no room. With fewer than two
/// landmarks, rotations of one plane against the other are tried by some iterations of the
/// optimisation. Where an outline is in its own way or a surface is folded sharply, the boundary
/// unfolds from a circle, which may strain the result. Statuses: kConverged, kInvalidMesh,
/// kInvalidLandmarks, kInvalidOptions, kAborted, kNumericalFailure. Thread-safe.
inline Embedding initial_embedding(const TriangleMesh& a, const TriangleMesh& b,
                                   const std::vector<Landmark>& landmarks = {},
                                   const Options& options = {});

/// Maps A onto B: initial embedding (or Options::initial_f / initial_g), then Algorithm 1.
/// Every iterate is injective, decided exactly. Any status. Thread-safe.
inline Result compute_map(const TriangleMesh& a, const TriangleMesh& b,
                          const std::vector<Landmark>& landmarks = {}, const Options& options = {});

/// A point of a surface: a triangle and barycentric coordinates that add up to 1.
struct SurfacePoint {
  int face = -1;
  Vec3 barycentric = Vec3::Zero();
};

/// An image under the map: no image when the point lies outside the overlap.
struct MappedPoint {
  bool covered = false;
  SurfacePoint point;
};

/// A curve on a surface: the segment from point i to i + 1 lies in the triangle of point i.
using Polyline = std::vector<SurfacePoint>;

/// One of the two surfaces of a map.
enum class Side { kA, kB };

/// The common refinement of A and B (§3.1): polygons of 3 to 6 corners with one connectivity and
/// two geometries. Vertices are identified by what they are, so neighbouring polygons share them.
struct MetaMesh {
  TriangleMesh a, b;                       // what it refines
  Points3 on_a, on_b;                      // #M×3, the vertices on either surface
  Points2 plane;                           // #M×2, the vertices in the common plane
  std::vector<std::vector<int>> polygons;  // counter-clockwise
  std::vector<int> face_a, face_b;         // per polygon, the triangles it lies in
  /// #C×3, where the corners of the polygons, one polygon after the other, lie in face_a and in
  /// face_b: barycentric coordinates.
  Points3 corner_a, corner_b;
};

/// How the map distorts one polygon of the meta mesh, where it is affine.
struct PolygonDistortion {
  double area_a = 0, area_b = 0;        // of the polygon on either surface
  double sigma_min = 1, sigma_max = 1;  // singular values of the Jacobian of Φ
  double density = 2;                   // symmetric Dirichlet energy per area on A and B; ≥ 2
};

/// Totals of PolygonDistortion, weighted by area_a + area_b.
struct DistortionSummary {
  double mean = 0;                      // E_Φ / (area A' + area B'), 2 is an isometry
  double median = 0, p95 = 0;           // densities that half, 95% of the area stay below
  double largest = 0;                   // density
  double sigma_min = 0, sigma_max = 0;  // the extremes
  double area_a = 0, area_b = 0;        // covered
};

/// A mesh with the geometry of the other surface. Ids of vertices are kept; those without an image
/// are in no triangle and lie on the first image.
struct Remesh {
  TriangleMesh mesh;
  std::vector<char> covered;  // per vertex
};

namespace detail {
struct MapData;
}

/// Φ = g⁻¹ ∘ f as a function, in both directions. Cheap to copy; copies share their data.
///
///   ism::SurfaceMap map(a, b, result.f, result.g);
///   ism::MappedPoint image = map.forward_vertex(7);
///   if (image.covered) use(map.position_on_b(image.point));
///
/// All queries are const and thread-safe. A point query costs O(polygons in its triangle).
class SurfaceMap {
 public:
  /// Overlays the two embeddings. The coordinates of the meshes are used as given, not scaled.
  /// Cost: linear in the number of meta mesh polygons.
  SurfaceMap(const TriangleMesh& a, const TriangleMesh& b, const Points2& f, const Points2& g);

  /// kConverged if the map can be used, else kInvalidMesh, kInvalidPositions or kNoOverlap; all
  /// points are then uncovered.
  Status status() const;
  const std::string& message() const;

  /// Barycentric coordinates must be ≥ 0 with sum 1. What has an id out of range is not covered.
  MappedPoint forward(const SurfacePoint& on_a) const;   // Φ
  MappedPoint backward(const SurfacePoint& on_b) const;  // Φ⁻¹
  MappedPoint forward_vertex(int a) const;
  MappedPoint backward_vertex(int b) const;
  std::vector<MappedPoint> forward_vertices() const;   // one per vertex of a valid mesh A
  std::vector<MappedPoint> backward_vertices() const;  // one per vertex of a valid mesh B
  /// The image on B of a path along edges of A, given by its vertices: a polyline for every stretch
  /// of it that is covered, in order, with a point on every edge of B it crosses. Where two
  /// vertices have no edge, the path is interrupted. Of a polygon mesh that was cut into triangles
  /// (§6.3), ask for the edges of its polygons; see edge_paths().
  std::vector<Polyline> forward_path(const std::vector<int>& vertices) const;
  std::vector<Polyline> backward_path(const std::vector<int>& vertices) const;  // of B on A
  /// The same of a curve, given by points of A. Points without a common triangle are joined by a
  /// straight line of the plane. A point whose face is out of range interrupts the curve.
  std::vector<Polyline> forward_curve(const Polyline& points) const;
  std::vector<Polyline> backward_curve(const Polyline& points) const;  // of B on A
  /// Where a point lies in space, in the units of the mesh given. status() must be kConverged and
  /// p.face one of its triangles.
  Vec3 position_on_a(const SurfacePoint& p) const;
  Vec3 position_on_b(const SurfacePoint& p) const;
  MetaMesh meta_mesh() const;
  /// Of every polygon of meta_mesh(). Both surfaces are scaled to area 1 first, as they are for
  /// compute_map(), unless keep_scale.
  std::vector<PolygonDistortion> distortion(bool keep_scale = false) const;

 private:
  friend class Morph;
  friend Remesh remesh(const SurfaceMap& map, Side side);
  std::shared_ptr<const detail::MapData> data_;
};

/// The vertices along edges of a mesh to whose edges vertices were added (Embedding::added_a): the
/// ends of every edge and what lies between them, for SurfaceMap::forward_path(). Cost
/// O(n log n).
inline std::vector<std::vector<int>> edge_paths(const std::vector<std::array<int, 2>>& edges,
                                                const TriangleMesh& mesh,
                                                const std::vector<Midpoint>& added);

/// The mesh on one side on the other surface: compatible remeshing. Linear cost, thread-safe.
inline Remesh remesh(const SurfaceMap& map, Side side);

/// What the rows of attributes belong to. Corner k of face f is row 3 f + k. Texture coordinates
/// with seams belong to corners.
enum class Element { kVertex, kFace, kCorner };

/// Attributes of a mesh, or of the corners of a meta mesh.
struct Attributes {
  Status status = Status::kConverged;  // or kInvalidAttributes: the number of rows does not fit
  std::string message;
  Eigen::MatrixXd values;     // a row per element, as many columns as were given
  std::vector<char> covered;  // per row; a row that is not covered is 0
};

/// Attributes of the mesh on one side, at all corners of the meta mesh: rows as those of
/// MetaMesh::corner_a. Nothing is lost, neither detail nor seams. Linear cost, thread-safe.
inline Attributes to_meta(const MetaMesh& meta, Side side, Element element,
                          const Eigen::MatrixXd& values);

/// Attributes of the corners of the meta mesh at vertices or corners of the mesh on one side (the
/// mean, where corners at a vertex differ), or their mean over the covered part of each face. What
/// to_meta() made of the same side comes back as it was. Linear cost, thread-safe.
inline Attributes from_meta(const MetaMesh& meta, Side side, Element element,
                            const Eigen::MatrixXd& corners);

/// Attributes of the mesh on side `from` at elements of the other mesh: both of the above. It
/// samples: on a coarser mesh, detail is lost; corners of a face across a seam of texture
/// coordinates lie on either side of it, so keep to_meta()'s for these. Linear cost, thread-safe.
inline Attributes transfer(const MetaMesh& meta, Side from, Element element,
                           const Eigen::MatrixXd& values, Element target);

/// Attributes of a mesh at the elements of the same mesh with vertices added in the middle of edges
/// (Embedding::a and added_a, or b and added_b). Cost O(n log n), thread-safe.
inline Attributes refine(const TriangleMesh& mesh, const TriangleMesh& refined,
                         const std::vector<Midpoint>& added, Element element,
                         const Eigen::MatrixXd& values);

/// The vertices between A and B at t, linearly: the rows of meta.on_a at 0, of meta.on_b at 1.
inline Points3 linear_morph(const MetaMesh& meta, double t);

namespace detail {
struct MorphData;
}

/// As-rigid-as-possible shapes between A and B, at 0 and 1 the two surfaces up to rounding. Every
/// polygon wants to turn by its share of the rotation of Φ there, and to stretch linearly; edges of
/// the meta mesh then fit in least squares [Alexa, Cohen-Or and Levin 2000]. Exchanging A and B
/// gives the same shapes. For surfaces of about the same size.
///
///   ism::Morph morph(map);
///   ism::Points3 halfway = morph.at(0.5);  // vertices of map.meta_mesh()
///
/// Thread-safe. Cheap to copy; copies share their data.
class Morph {
 public:
  /// Factorises a matrix of the size of the meta mesh; of the options, the threads count.
  explicit Morph(const SurfaceMap& map, const Options& options = {});
  /// kConverged, kNumericalFailure, or what the map has.
  Status status() const;
  /// #M×3, for any t; no rows if status() is not kConverged. A solve with the factor.
  Points3 at(double t) const;

 private:
  std::shared_ptr<const detail::MorphData> data_;
};

/// Totals of what SurfaceMap::distortion() found. Sorts: O(n log n).
inline DistortionSummary summarize(const std::vector<PolygonDistortion>& polygons);

}  // namespace ism

// ==== [3] NOTATION ===============================================================================
//
//   A, B          the meshes; a, b in names. f, g their embeddings, rows of Points2
//   x             all unknowns (Eq. 5): vertex i of A is row i, vertex i of B row #V_A + i
//   tA, tB        triangles of A and B; ta, tb their ids
//   ρ             a polygon f(tA) ∩ g(tB) of the meta mesh; a its planar area
//   R             rest shape of a triangle in its own plane (columns b - a, c - a); J = [..] R⁻¹
//   F, G          the Jacobians J_f, J_g of a pair tA, tB; in formulas f, g are their determinants
//   N             ‖adj(G) F‖², which both Dirichlet terms of ρ share
//   E_ρ           a N (f⁻³ + g⁻³) - κ a (1/f + 1/g), one summand of E_Φ (Eq. 4) and of -κ area
//   E             E_Φ - κ (area A' + area B') + ω_R (E_f + E_g)
//   g, H, H_+     gradient, Hessian, projected Hessian of E
//   d, s, s_max   direction, step, step at which the first triangle degenerates
//   ω_L, L, M     preconditioner weight, Laplacian, mass matrix (§5.4)
//   perp(d)       d turned by -90 degrees; cross(a, b) = a_x b_y - a_y b_x
//

// ==== [4] SMALL HELPERS ==========================================================================

namespace ism {
namespace detail {

/// std::vector indexed by int, the type of every id in this file (and in Eigen and mesh files).
template <class T>
class Array {
 public:
  using value_type = T;
  Array() = default;
  explicit Array(int n, const T& value = T()) : items_(static_cast<std::size_t>(n), value) {}
  int size() const { return static_cast<int>(items_.size()); }
  bool empty() const { return items_.empty(); }
  T& operator[](int i) { return items_[static_cast<std::size_t>(i)]; }
  const T& operator[](int i) const { return items_[static_cast<std::size_t>(i)]; }
  void assign(int n, const T& value) { items_.assign(static_cast<std::size_t>(n), value); }
  void resize(int n) { items_.resize(static_cast<std::size_t>(n)); }
  void reserve(int n) { items_.reserve(static_cast<std::size_t>(n)); }
  void clear() { items_.clear(); }
  void push_back(T value) { items_.push_back(std::move(value)); }
  void pop_back() { items_.pop_back(); }
  void insert_front(T value) { items_.insert(items_.begin(), std::move(value)); }
  T& back() { return items_.back(); }
  const T& back() const { return items_.back(); }
  T* data() { return items_.data(); }
  const T* data() const { return items_.data(); }
  auto begin() { return items_.begin(); }
  auto end() { return items_.end(); }
  auto begin() const { return items_.begin(); }
  auto end() const { return items_.end(); }

 private:
  std::vector<T> items_;
};

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kPi = 3.14159265358979323846;

/// Fills status, message and ids of an Embedding or a Result; returns false for `return fail(...)`.
template <class Output>
bool fail(Output& output, Status status, std::string message, std::vector<int> ids = {}) {
  output.status = status;
  output.message = std::move(message);
  output.ids = std::move(ids);
  return false;
}

/// 2D cross product: twice the signed area of the triangle (0, a, b).
inline double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

/// d turned by -90 degrees: the outward normal of a counter-clockwise edge of direction d.
inline Vec2 perp(const Vec2& d) { return Vec2(d.y(), -d.x()); }

inline Vec2 row2(const Points2& p, int i) { return p.row(i).transpose(); }
inline Vec3 row3(const Points3& p, int i) { return p.row(i).transpose(); }

inline double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

class Timer {
 public:
  double lap() {  // seconds since construction or the last lap
    const double s = seconds_since(start_);
    start_ = std::chrono::steady_clock::now();
    return s;
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Runs independent tasks. Tasks are cut by the callers without regard to the number of threads
/// and write to places of their own, so results are the same bits for any number of threads.
class Executor {
 public:
  explicit Executor(const Options& options)
      : threads_(options.threads), hook_(options.parallel_for) {
#ifndef ISM_NO_THREADS
    constexpr int kMostPerProcessor = 4;
    const int processors = (std::max)(1, static_cast<int>(std::thread::hardware_concurrency()));
    threads_ = threads_ <= 0 ? processors : (std::min)(threads_, kMostPerProcessor * processors);
#endif
    threads_ = (std::max)(threads_, 1);
  }

  void run(int n, const std::function<void(int)>& task) const {
    if (n <= 0) return;
    if (hook_) return hook_(n, task);
#ifndef ISM_NO_THREADS
    if (threads_ > 1 && n > 1) return run_threads(n, task);
#endif
    for (int i = 0; i < n; ++i) task(i);
  }

  /// task(begin, end) over [0, n) in blocks of a fixed size.
  void run_blocks(int n, int block, const std::function<void(int, int)>& task) const {
    run((n + block - 1) / block, [&](int k) { task(k * block, (std::min)(n, (k + 1) * block)); });
  }

 private:
#ifndef ISM_NO_THREADS
  void run_threads(int n, const std::function<void(int)>& task) const {
    std::atomic<int> next{0};
    const auto work = [&] {
      for (int i = next++; i < n; i = next++) task(i);
    };
    std::vector<std::thread> helpers;
    for (int t = 1; t < (std::min)(threads_, n); ++t) helpers.emplace_back(work);
    work();
    for (std::thread& helper : helpers) helper.join();
  }
#endif

  int threads_;
  ParallelFor hook_;
};

}  // namespace detail
}  // namespace ism

// ==== [5] EXACT PREDICATES (paper §6, Shewchuk 1996; Edelsbrunner and Mücke 1990) ================
//
// Purpose:    the sign of the area of a planar triangle, never wrong; and the same with ties
//             broken by a symbolic perturbation, never zero.
// Invariants: orient2d is exact for coordinates that are 0 or in [2^-400, 2^400] by magnitude
//             (flush_tiny() sees to the lower end); oriented() is the sign under one fixed
//             infinitesimal displacement of all vertices, so any set of its answers is consistent.
// Fails:      never. Non-finite coordinates must be excluded by the caller.

namespace ism {
namespace detail {

constexpr double kTiniest = 0x1p-400;  // 2^-400: products of two differences of
                                       // such numbers and their tails do not underflow
constexpr double kLargest = 0x1p400;   // 2^400

inline double flush_tiny(double x) { return std::abs(x) < kTiniest ? 0.0 : x; }

/// A sum of doubles of which no two overlap, smallest first (Shewchuk's expansion).
struct Expansion {
  std::array<double, 12> term{};
  int size = 0;

  /// Adds b exactly (grow-expansion with two-sum).
  void add(double b) {
    int kept = 0;
    for (int i = 0; i < size; ++i) {
      const double a = term[static_cast<std::size_t>(i)];
      const double sum = a + b;
      const double virtual_b = sum - a;
      const double tail = (a - (sum - virtual_b)) + (b - virtual_b);
      if (tail != 0) term[static_cast<std::size_t>(kept++)] = tail;
      b = sum;
    }
    if (b != 0) term[static_cast<std::size_t>(kept++)] = b;
    size = kept;
  }

  /// Adds a·b exactly. volatile keeps the compiler from fusing the rounded product into the
  /// additions, which would break the error-free transformation.
  void add_product(double a, double b) {
    const volatile double product = a * b;
    const double tail = std::fma(a, b, -product);
    add(tail);
    add(product);
  }

  double sign() const { return size == 0 ? 0.0 : term[static_cast<std::size_t>(size - 1)]; }
};

inline double orient2d_exact(const Vec2& a, const Vec2& b, const Vec2& c) {
  Expansion sum;
  sum.add_product(a.x(), b.y());
  sum.add_product(-a.y(), b.x());
  sum.add_product(b.x(), c.y());
  sum.add_product(-b.y(), c.x());
  sum.add_product(c.x(), a.y());
  sum.add_product(-c.y(), a.x());
  return sum.sign();
}

constexpr double kErrorBound = 3.3306690738754716e-16;  // (3 + 16 ε) ε, Shewchuk's stage A

/// Positive if a, b, c turn left, negative if they turn right, 0 if they are collinear: exact.
inline double orient2d(const Vec2& a, const Vec2& b, const Vec2& c) {
  const double left = (a.x() - c.x()) * (b.y() - c.y());
  const double right = (a.y() - c.y()) * (b.x() - c.x());
  const double det = left - right;
  if (std::abs(det) > kErrorBound * (std::abs(left) + std::abs(right))) return det;
  return orient2d_exact(a, b, c);
}

/// A point with its place in the order of perturbation; smaller ids are displaced more.
struct LabelledPoint {
  Vec2 p;
  int id;
};

/// Sign of the collinear triple a, b, c (ids ascending) after the displacement
/// p_i += (ε^(4^i), ε^(2·4^i)): the first non-vanishing coefficient of the determinant in ε.
inline bool perturbed_sign(const Vec2& a, const Vec2& b, const Vec2& c) {
  if (b.y() != c.y()) return b.y() > c.y();
  if (b.x() != c.x()) return c.x() > b.x();
  if (c.y() != a.y()) return c.y() > a.y();
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
  return perturbed_sign(q[0]->p, q[1]->p, q[2]->p) == even;
}

}  // namespace detail
}  // namespace ism

// ==== [6] HALF-EDGE MESH =========================================================================
//
// Purpose:    connectivity of a triangulated disk, its validation, and the isometric rest frame of
//             every triangle (the orthonormal coordinate systems of §3.2).
// Invariants: half-edge h = 3 f + k runs from corner k of face f to corner k + 1; out[v] is an
//             outgoing half-edge of v, the boundary one if v lies on the boundary, so turning
//             counter-clockwise from it visits every face of v.
// Fails:      validate() says why a mesh is no disk; build_surface() wants a validated one.

namespace ism {
namespace detail {

inline int next(int h) { return h % 3 == 2 ? h - 2 : h + 1; }
inline int prev(int h) { return h % 3 == 0 ? h + 2 : h - 1; }

struct HalfEdgeMesh {
  int n_vertices = 0;
  int n_faces = 0;
  Array<int> tail;      // #F·3, the vertex a half-edge starts at
  Array<int> twin;      // #F·3, the opposite half-edge, or -1 on the boundary
  Array<int> out;       // #V
  Array<int> boundary;  // boundary half-edges in order, counter-clockwise around the disk

  int tip(int h) const { return tail[next(h)]; }
  int corner(int f, int k) const { return tail[3 * f + k]; }
  bool on_boundary(int v) const { return twin[out[v]] < 0; }
  /// The next outgoing half-edge of the same vertex counter-clockwise, or -1 past the boundary.
  int turn(int h) const { return twin[prev(h)]; }

  /// Calls visit(h) for the outgoing half-edges of v, counter-clockwise; h / 3 is each of its
  /// faces.
  template <class Visit>
  void for_each_outgoing(int v, Visit visit) const {
    for (int h = out[v]; h >= 0;) {
      visit(h);
      h = turn(h);
      if (h == out[v]) return;
    }
  }
};

/// The edges of a mesh as sorted (smaller vertex, larger vertex, half-edge) records.
struct EdgeUse {
  int lo, hi, half_edge;
  bool operator<(const EdgeUse& o) const {
    return lo != o.lo ? lo < o.lo : hi != o.hi ? hi < o.hi : half_edge < o.half_edge;
  }
  bool same_edge(const EdgeUse& o) const { return lo == o.lo && hi == o.hi; }
};

inline Array<EdgeUse> sorted_edges(const Triangles& F) {
  Array<EdgeUse> uses;
  uses.reserve(static_cast<int>(F.rows()) * 3);
  for (int f = 0; f < F.rows(); ++f)
    for (int k = 0; k < 3; ++k) {
      const int u = F(f, k), v = F(f, (k + 1) % 3);
      uses.push_back({(std::min)(u, v), (std::max)(u, v), 3 * f + k});
    }
  std::sort(uses.begin(), uses.end());
  return uses;
}

/// Calls visit(begin, end) for every run of equal edges in a sorted list.
template <class Visit>
void for_each_edge(const Array<EdgeUse>& uses, Visit visit) {
  for (int begin = 0, end = 0; begin < uses.size(); begin = end) {
    while (end < uses.size() && uses[end].same_edge(uses[begin])) ++end;
    visit(begin, end);
  }
}

/// Lists the boundary, counter-clockwise; empty for a closed mesh.
inline void trace_boundary(HalfEdgeMesh& m) {
  m.boundary.clear();
  int first = 0;
  while (first < 3 * m.n_faces && m.twin[first] >= 0) ++first;
  if (first == 3 * m.n_faces) return;
  for (int h = first, n = 0; n < 3 * m.n_faces; ++n) {
    m.boundary.push_back(h);
    h = m.out[m.tip(h)];
    if (h == first) break;
  }
}

inline HalfEdgeMesh build_half_edges(int n_vertices, const Triangles& F) {
  HalfEdgeMesh m;
  m.n_vertices = n_vertices;
  m.n_faces = static_cast<int>(F.rows());
  m.tail.resize(3 * m.n_faces);
  for (int h = 0; h < 3 * m.n_faces; ++h) m.tail[h] = F(h / 3, h % 3);
  m.twin.assign(3 * m.n_faces, -1);
  const Array<EdgeUse> uses = sorted_edges(F);
  for_each_edge(uses, [&](int begin, int end) {
    if (end - begin != 2) return;
    m.twin[uses[begin].half_edge] = uses[begin + 1].half_edge;
    m.twin[uses[begin + 1].half_edge] = uses[begin].half_edge;
  });
  m.out.assign(n_vertices, -1);
  for (int h = 3 * m.n_faces - 1; h >= 0; --h)
    if (m.out[m.tail[h]] < 0 || m.twin[h] < 0) m.out[m.tail[h]] = h;
  trace_boundary(m);
  return m;
}

/// The half-edge from u to v, or -1.
inline int find_half_edge(const HalfEdgeMesh& m, int u, int v) {
  int found = -1;
  if (u >= 0 && u < m.n_vertices)
    m.for_each_outgoing(u, [&](int h) {
      if (m.tip(h) == v) found = h;
    });
  return found;
}

/// Cuts the triangle of h in two along the line from the middle of its edge u → v to the corner
/// opposite; h then ends in the middle. Returns the half-edge from there to v.
inline int split_face(HalfEdgeMesh& m, int h, int middle) {
  const int a = next(h), rest = 3 * m.n_faces++;
  const int v = m.tail[a], w = m.tip(a), outer = m.twin[a];
  for (int tail : {middle, v, w}) m.tail.push_back(tail);
  for (int twin : {-1, outer, a}) m.twin.push_back(twin);
  if (outer >= 0) m.twin[outer] = rest + 1;
  if (m.out[v] == a) m.out[v] = rest + 1;
  m.tail[a] = middle;
  m.twin[a] = rest + 2;
  return rest;
}

/// Halves the edge of h; the new vertex is the last one. The list of the boundary is then stale.
inline void split_edge(HalfEdgeMesh& m, int h) {
  const int t = m.twin[h], middle = m.n_vertices++;
  const int to_tip = split_face(m, h, middle);
  m.out.push_back(to_tip);
  if (t < 0) return;
  const int to_tail = split_face(m, t, middle);
  m.twin[h] = to_tail, m.twin[to_tail] = h;
  m.twin[t] = to_tip, m.twin[to_tip] = t;
}

/// A half-edge mesh with the intrinsic geometry the energies need.
struct Surface {
  HalfEdgeMesh mesh;
  Points3 vertices;             // scaled to total area 1 unless asked otherwise
  std::vector<Midpoint> added;  // the last of them, which were not given
  double total_area = 0;
  Array<double> area;                   // #F
  Array<Eigen::Matrix2d> rest_inverse;  // #F, R⁻¹ of Eq. 2: J = [b'-a' c'-a'] R⁻¹
};

/// Isometric planar coordinates of a triangle: columns b - a and c - a, b on the x-axis.
inline Eigen::Matrix2d rest_frame(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 u = b - a, v = c - a;
  const double length = u.norm();
  Eigen::Matrix2d R;
  R << length, u.dot(v) / length, 0, u.cross(v).norm() / length;
  return R;
}

/// The same from the lengths |b - a|, |c - b|, |a - c|; the area is Kahan's, which keeps thin
/// triangles positive.
inline Eigen::Matrix2d rest_frame(const std::array<double, 3>& length) {
  std::array<double, 3> l = length;
  std::sort(l.begin(), l.end());
  const double area = 0.25 * std::sqrt((l[2] + (l[1] + l[0])) * (l[0] - (l[2] - l[1])) *
                                       (l[0] + (l[2] - l[1])) * (l[2] + (l[1] - l[0])));
  const double ab = length[0], bc = length[1], ca = length[2];
  Eigen::Matrix2d R;
  R << ab, (ab * ab + (ca - bc) * (ca + bc)) / (2 * ab), 0, 2 * area / ab;
  return R;
}

inline void compute_rest_frames(Surface& s) {
  const int n = s.mesh.n_faces;
  s.area.resize(n);
  s.rest_inverse.resize(n);
  s.total_area = 0;
  for (int f = 0; f < n; ++f) {
    const Eigen::Matrix2d R =
        rest_frame(s.vertices.row(s.mesh.corner(f, 0)), s.vertices.row(s.mesh.corner(f, 1)),
                   s.vertices.row(s.mesh.corner(f, 2)));
    s.area[f] = 0.5 * R.determinant();
    s.rest_inverse[f] = R.inverse();
    s.total_area += s.area[f];
  }
}

inline double surface_area(const Points3& vertices, const Triangles& triangles) {
  double area = 0;
  for (int f = 0; f < triangles.rows(); ++f) {
    const Vec3 a = vertices.row(triangles(f, 0));
    const Vec3 b = vertices.row(triangles(f, 1));
    const Vec3 c = vertices.row(triangles(f, 2));
    area += 0.5 * (b - a).cross(c - a).norm();
  }
  return area;
}

inline Surface build_surface(const TriangleMesh& mesh, bool keep_scale) {
  Surface s;
  s.mesh = build_half_edges(static_cast<int>(mesh.vertices.rows()), mesh.triangles);
  s.vertices = mesh.vertices;
  if (!keep_scale) {
    // First by a power of two, which is exact: in any unit, squares then neither over- nor
    // underflow.
    const int exponent = std::ilogb(mesh.vertices.cwiseAbs().maxCoeff());
    s.vertices *= std::ldexp(1.0, std::clamp(-exponent, -1000, 1000));
    s.vertices *= 1 / std::sqrt(surface_area(s.vertices, mesh.triangles));
  }
  compute_rest_frames(s);
  return s;
}

/// Halves edges, one after the other; the surface stays the same.
inline void split_edges(const std::vector<Midpoint>& edges, Surface& s) {
  for (const Midpoint& edge : edges) {
    const int h = find_half_edge(s.mesh, edge[0], edge[1]);
    split_edge(s.mesh, h >= 0 ? h : find_half_edge(s.mesh, edge[1], edge[0]));
  }
  trace_boundary(s.mesh);
  int v = static_cast<int>(s.vertices.rows());
  s.vertices.conservativeResize(s.mesh.n_vertices, 3);
  for (const Midpoint& edge : edges)
    s.vertices.row(v++) = 0.5 * s.vertices.row(edge[0]) + 0.5 * s.vertices.row(edge[1]);
  s.added.insert(s.added.end(), edges.begin(), edges.end());
  compute_rest_frames(s);
}

/// The mesh that a surface was built from, with the vertices added since.
inline TriangleMesh with_added_vertices(const TriangleMesh& given, const Surface& s) {
  TriangleMesh mesh;
  mesh.vertices.resize(s.mesh.n_vertices, 3);
  int v = static_cast<int>(given.vertices.rows());
  mesh.vertices.topRows(v) = given.vertices;
  for (const Midpoint& edge : s.added)
    mesh.vertices.row(v++) = 0.5 * mesh.vertices.row(edge[0]) + 0.5 * mesh.vertices.row(edge[1]);
  mesh.triangles.resize(s.mesh.n_faces, 3);
  for (int f = 0; f < s.mesh.n_faces; ++f)
    for (int k = 0; k < 3; ++k) mesh.triangles(f, k) = s.mesh.corner(f, k);
  return mesh;
}

// ---- validation ----

/// Collects problems, at most kMostOfAKind of each kind.
class ProblemList {
 public:
  static constexpr int kMostOfAKind = 20;
  void add(Problem::Kind kind, std::string message, std::vector<int> ids) {
    if (++count_[static_cast<std::size_t>(kind)] <= kMostOfAKind)
      problems.push_back({kind, std::move(message), std::move(ids)});
  }
  std::vector<Problem> problems;

 private:
  std::array<int, 16> count_{};
};

inline std::string join(const std::vector<int>& ids) {
  std::string text;
  for (int id : ids) text += (text.empty() ? "" : ", ") + std::to_string(id);
  return text;
}

inline void check_vertices(const TriangleMesh& mesh, ProblemList& list) {
  for (int v = 0; v < mesh.vertices.rows(); ++v)
    if (!mesh.vertices.row(v).allFinite())
      list.add(Problem::Kind::kNonFiniteCoordinate,
               "vertex " + std::to_string(v) + " has a coordinate that is not finite", {v});
}

inline void check_indices(const TriangleMesh& mesh, ProblemList& list) {
  const int n = static_cast<int>(mesh.vertices.rows());
  for (int f = 0; f < mesh.triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k) {
      const int v = mesh.triangles(f, k);
      if (v < 0 || v >= n)
        list.add(Problem::Kind::kIndexOutOfRange,
                 "triangle " + std::to_string(f) + " refers to vertex " + std::to_string(v) +
                     ", but there are " + std::to_string(n) + " vertices",
                 {f});
    }
}

/// The edge vectors of a triangle, one per row.
inline Eigen::Matrix3d edge_vectors(const TriangleMesh& mesh, int f) {
  const Vec3 a = mesh.vertices.row(mesh.triangles(f, 0)),
             b = mesh.vertices.row(mesh.triangles(f, 1));
  const Vec3 c = mesh.vertices.row(mesh.triangles(f, 2));
  Eigen::Matrix3d edges;
  edges << (b - a).transpose(), (c - b).transpose(), (a - c).transpose();
  return edges;
}

/// A triangle is degenerate if a vertex repeats, if its height is below 1e-12 of its longest edge,
/// or if it is smaller than 1e-30 of the largest one: fourth powers of the ratio have to exist.
inline void check_triangles(const TriangleMesh& mesh, ProblemList& list) {
  constexpr double kThinnest = 1e-12, kSmallest = 1e-30;
  const auto add = [&](int f, const char* what) {
    list.add(Problem::Kind::kDegenerateTriangle, "triangle " + std::to_string(f) + what, {f});
  };
  double largest = 0;
  for (int f = 0; f < mesh.triangles.rows(); ++f)
    largest = (std::max)(largest, edge_vectors(mesh, f).cwiseAbs().maxCoeff());
  for (int f = 0; f < mesh.triangles.rows(); ++f) {
    const int i = mesh.triangles(f, 0), j = mesh.triangles(f, 1), k = mesh.triangles(f, 2);
    Eigen::Matrix3d edges = edge_vectors(mesh, f);
    const double extent = edges.cwiseAbs().maxCoeff();  // taken out, so that squares exist
    if (extent > 0) edges /= extent;
    const double longest2 = edges.rowwise().squaredNorm().maxCoeff();
    const double twice_area = edges.row(0).cross(edges.row(1)).norm();
    if (i == j || j == k || k == i)
      add(f, " uses a vertex twice");
    else if (!(twice_area > kThinnest * longest2))
      add(f, " has no area");
    else if (extent < kSmallest * largest)
      add(f, " is smaller than 1e-30 of the largest triangle");
  }
}

inline void check_repeated(const TriangleMesh& mesh, ProblemList& list) {
  std::vector<std::array<int, 4>> keys;
  for (int f = 0; f < mesh.triangles.rows(); ++f) {
    std::array<int, 3> v = {mesh.triangles(f, 0), mesh.triangles(f, 1), mesh.triangles(f, 2)};
    std::sort(v.begin(), v.end());
    keys.push_back({v[0], v[1], v[2], f});
  }
  std::sort(keys.begin(), keys.end());
  for (std::size_t i = 1; i < keys.size(); ++i)
    if (std::equal(keys[i].begin(), keys[i].begin() + 3, keys[i - 1].begin()))
      list.add(Problem::Kind::kRepeatedTriangle,
               "triangles " + std::to_string(keys[i - 1][3]) + " and " +
                   std::to_string(keys[i][3]) + " have the same vertices",
               {keys[i - 1][3], keys[i][3]});
}

inline void check_edges(const TriangleMesh& mesh, const Array<EdgeUse>& uses, ProblemList& list) {
  for_each_edge(uses, [&](int begin, int end) {
    if (uses[begin].lo == uses[begin].hi) return;  // of a triangle that uses a vertex twice
    std::vector<int> faces;
    for (int i = begin; i < end; ++i) faces.push_back(uses[i].half_edge / 3);
    const std::string edge =
        "edge " + std::to_string(uses[begin].lo) + "-" + std::to_string(uses[begin].hi);
    if (faces.size() > 2)
      list.add(Problem::Kind::kNonManifoldEdge,
               edge + " has " + std::to_string(faces.size()) + " triangles: " + join(faces), faces);
    if (faces.size() != 2) return;
    const int h0 = uses[begin].half_edge, h1 = uses[begin + 1].half_edge;
    if (mesh.triangles(h0 / 3, h0 % 3) == mesh.triangles(h1 / 3, h1 % 3))
      list.add(Problem::Kind::kInconsistentOrientation,
               "triangles " + join(faces) + " run through " + edge + " in the same direction",
               faces);
  });
}

/// Vertices no triangle uses, and vertices whose triangles form more than one fan. The latter can
/// be told only if triangles and edges are in order.
inline void check_fans(const HalfEdgeMesh& m, ProblemList& list) {
  const bool edges_are_sound = list.problems.empty();
  Array<int> incident(m.n_vertices, 0);
  for (int h = 0; h < m.tail.size(); ++h) ++incident[m.tail[h]];
  for (int v = 0; v < m.n_vertices; ++v) {
    if (incident[v] == 0) {
      list.add(Problem::Kind::kUnreferencedVertex,
               "vertex " + std::to_string(v) + " is used by no triangle", {v});
      continue;
    }
    if (!edges_are_sound) continue;
    int fan = 0;
    for (int h = m.out[v]; h >= 0 && fan < incident[v]; h = m.turn(h)) {
      ++fan;
      if (m.turn(h) == m.out[v]) break;
    }
    if (fan != incident[v])
      list.add(Problem::Kind::kNonManifoldVertex,
               "vertex " + std::to_string(v) + " joins " + std::to_string(incident[v]) +
                   " triangles that form more than one fan",
               {v});
  }
}

inline int count_components(const HalfEdgeMesh& m) {
  Array<char> seen(m.n_faces, 0);
  int components = 0;
  for (int seed = 0; seed < m.n_faces; ++seed) {
    if (seen[seed]) continue;
    ++components;
    seen[seed] = 1;
    std::vector<int> stack = {seed};
    while (!stack.empty()) {
      const int f = stack.back();
      stack.pop_back();
      for (int k = 0; k < 3; ++k) {
        const int t = m.twin[3 * f + k];
        if (t < 0 || seen[t / 3]) continue;
        seen[t / 3] = 1;
        stack.push_back(t / 3);
      }
    }
  }
  return components;
}

/// The boundary loops, each as one of its vertices.
inline std::vector<int> boundary_loops(const HalfEdgeMesh& m) {
  Array<char> seen(m.tail.size(), 0);
  std::vector<int> loops;
  for (int start = 0; start < m.tail.size(); ++start) {
    if (m.twin[start] >= 0 || seen[start]) continue;
    loops.push_back(m.tail[start]);
    for (int h = start; !seen[h]; h = m.out[m.tip(h)]) seen[h] = 1;
  }
  return loops;
}

inline void check_topology(const HalfEdgeMesh& m, int n_edges, ProblemList& list) {
  const int components = count_components(m);
  if (components > 1)
    list.add(Problem::Kind::kSeveralComponents,
             "the mesh has " + std::to_string(components) + " components, 1 is needed", {});
  const std::vector<int> loops = boundary_loops(m);
  if (loops.empty())
    list.add(Problem::Kind::kClosed, "the mesh is closed; cut a hole so that it is a disk", {});
  if (loops.size() > 1)
    list.add(Problem::Kind::kSeveralBoundaries,
             "the mesh has " + std::to_string(loops.size()) +
                 " boundary loops, 1 is needed; they pass through vertices " + join(loops),
             loops);
  const int chi = m.n_vertices - n_edges + m.n_faces;
  if (chi != 1 && components == 1 && loops.size() == 1)
    list.add(Problem::Kind::kWrongEulerCharacteristic,
             "the Euler characteristic is " + std::to_string(chi) +
                 ", a disk has 1; the mesh has handles",
             {});
}

}  // namespace detail

inline std::vector<Problem> validate(const TriangleMesh& mesh) {
  detail::ProblemList list;
  if (mesh.vertices.rows() == 0 || mesh.triangles.rows() == 0) {
    list.add(Problem::Kind::kEmpty, "the mesh has no vertices or no triangles", {});
    return list.problems;
  }
  detail::check_vertices(mesh, list);
  detail::check_indices(mesh, list);
  if (!list.problems.empty()) return list.problems;  // the next checks read the vertices
  detail::check_triangles(mesh, list);
  detail::check_repeated(mesh, list);
  const detail::Array<detail::EdgeUse> uses = detail::sorted_edges(mesh.triangles);
  detail::check_edges(mesh, uses, list);
  const detail::HalfEdgeMesh m =
      detail::build_half_edges(static_cast<int>(mesh.vertices.rows()), mesh.triangles);
  detail::check_fans(m, list);
  if (!list.problems.empty()) return list.problems;  // the next checks walk the mesh
  int n_edges = 0;
  detail::for_each_edge(uses, [&](int, int) { ++n_edges; });
  detail::check_topology(m, n_edges, list);
  return list.problems;
}

}  // namespace ism

// ==== [7] OVERLAY (paper §3.1, §4.4, §5.2) =======================================================
//
// Purpose:    the meta mesh of two planar embeddings as polygons ρ = f(t_A) ∩ g(t_B), and the exact
//             decision whether an embedding is injective.
// Invariants: every decision is the sign of orient2d of three input vertices, mixed triples under
//             the symbolic perturbation; so neighbouring polygons agree on their common corners and
//             no polygon has fewer than 3 or more than 6 corners.
// Fails:      never on injective embeddings; cost is linear in the number of polygons, unless a
//             triangle of A meets B in many separate pieces, plus O((a + b + crossings) log(a b))
//             for boundaries of a and b edges.

namespace ism {
namespace detail {

/// One polygon of the meta mesh. Its boundary is a cycle of pieces, each on an edge of t_A
/// (0, 1, 2) or of t_B (3, 4, 5), three bits per piece, counter-clockwise. Corner i is where
/// piece i starts: the first vertex of its edge if piece i-1 lies on the same triangle, else the
/// crossing of the two edges. So the code alone holds the combinatorics.
struct OverlayPolygon {
  int ta = 0;
  int tb = 0;
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

/// Axis-parallel boxes of runs of 2^k consecutive segments of a closed polyline, as a binary tree.
class BoundaryTree {
 public:
  /// Memory of an earlier tree is used again.
  void build(const HalfEdgeMesh& m, const Points2& x) {
    const int n = m.boundary.size();
    for (leaves_ = 1; leaves_ < n;) leaves_ *= 2;
    lo_.assign(2 * leaves_, Vec2::Constant(std::numeric_limits<double>::infinity()));
    hi_.assign(2 * leaves_, Vec2::Constant(-std::numeric_limits<double>::infinity()));
    for (int i = 0; i < n; ++i) {
      const Vec2 p = row2(x, m.tail[m.boundary[i]]), q = row2(x, m.tip(m.boundary[i]));
      lo_[leaves_ + i] = p.cwiseMin(q);
      hi_[leaves_ + i] = p.cwiseMax(q);
    }
    for (int i = leaves_ - 1; i >= 1; --i) {
      lo_[i] = lo_[2 * i].cwiseMin(lo_[2 * i + 1]);
      hi_[i] = hi_[2 * i].cwiseMax(hi_[2 * i + 1]);
    }
  }

  /// Calls visit(i, j) for all segments i of this and j of the other tree whose boxes meet.
  template <class Visit>
  void for_each_pair(const BoundaryTree& other, Visit visit) const {
    descend(1, other, 1, visit);
  }

 private:
  template <class Visit>
  void descend(int i, const BoundaryTree& other, int j, Visit& visit) const {
    if ((lo_[i].array() > other.hi_[j].array()).any()) return;
    if ((other.lo_[j].array() > hi_[i].array()).any()) return;
    const bool leaf_i = i >= leaves_, leaf_j = j >= other.leaves_;
    if (leaf_i && leaf_j) return visit(i - leaves_, j - other.leaves_);
    if (leaf_j || (!leaf_i && i <= j)) {
      descend(2 * i, other, j, visit);
      descend(2 * i + 1, other, j, visit);
    } else {
      descend(i, other, 2 * j, visit);
      descend(i, other, 2 * j + 1, visit);
    }
  }

  int leaves_ = 1;
  Array<Vec2> lo_, hi_;
};

// ---- injectivity of one embedding (§4.4) ----

/// True if closed segments pq and rs have a point in common, exactly.
inline bool segments_touch(const Vec2& p, const Vec2& q, const Vec2& r, const Vec2& s) {
  const double r_side = orient2d(p, q, r), s_side = orient2d(p, q, s);
  const double p_side = orient2d(r, s, p), q_side = orient2d(r, s, q);
  if (r_side == 0 && s_side == 0 && p_side == 0 && q_side == 0)  // collinear: do the boxes touch?
    return (p.cwiseMin(q).array() <= r.cwiseMax(s).array()).all() &&
           (r.cwiseMin(s).array() <= p.cwiseMax(q).array()).all();
  const auto straddles = [](double u, double v) { return !(u > 0 && v > 0) && !(u < 0 && v < 0); };
  return straddles(r_side, s_side) && straddles(p_side, q_side);
}

/// True if consecutive segments pq and qr fold back onto each other, so that they share more than
/// q.
inline bool turns_back(const Vec2& p, const Vec2& q, const Vec2& r) {
  return orient2d(p, q, r) == 0 && (p - q).dot(r - q) > 0;
}

inline bool all_triangles_positive(const HalfEdgeMesh& m, const Points2& x) {
  for (int f = 0; f < m.n_faces; ++f)
    if (!(orient2d(row2(x, m.corner(f, 0)), row2(x, m.corner(f, 1)), row2(x, m.corner(f, 2))) > 0))
      return false;
  return true;
}

/// True if the angles around every interior vertex add up to 2π, given positive triangles. A fan
/// of positive triangles turns by less than π per step, so it turns once around exactly if it
/// passes once from the lower into the upper half-plane; comparisons decide that exactly.
inline bool angle_sums_are_full(const HalfEdgeMesh& m, const Points2& x) {
  for (int v = 0; v < m.n_vertices; ++v) {
    if (m.on_boundary(v)) continue;
    const auto upper = [&](int h) {
      const int w = m.tip(h);
      return x(w, 1) > x(v, 1) || (x(w, 1) == x(v, 1) && x(w, 0) > x(v, 0));
    };
    int turns = 0;
    int h = m.out[v];
    do {
      const int g = m.turn(h);
      if (!upper(h) && upper(g)) ++turns;
      h = g;
    } while (h != m.out[v]);
    if (turns != 1) return false;
  }
  return true;
}

inline bool boundary_is_simple(const HalfEdgeMesh& m, const Points2& x) {
  const int n = m.boundary.size();
  const auto p = [&](int i) { return row2(x, m.tail[m.boundary[i % n]]); };
  bool simple = true;
  BoundaryTree tree;
  tree.build(m, x);
  tree.for_each_pair(tree, [&](int i, int j) {
    if (i >= j || !simple) return;
    if (j == i + 1)
      simple = !turns_back(p(i), p(j), p(j + 1));
    else if (i == 0 && j == n - 1)
      simple = !turns_back(p(j), p(0), p(1));
    else
      simple = !segments_touch(p(i), p(i + 1), p(j), p(j + 1));
  });
  return simple;
}

inline bool coordinates_are_usable(const Points2& x) {
  for (int i = 0; i < x.rows(); ++i)
    for (int c = 0; c < 2; ++c) {
      const double magnitude = std::abs(x(i, c));
      if (!(magnitude <= kLargest) || (magnitude != 0 && magnitude < kTiniest)) return false;
    }
  return true;
}

/// The promise of the library (§4.4): every triangle positive, angle sums 2π, boundary simple.
/// A positively oriented piecewise affine map of a disk with a simple boundary is injective
/// [Lipman 2014].
inline bool is_injective(const HalfEdgeMesh& m, const Points2& x) {
  return coordinates_are_usable(x) && all_triangles_positive(m, x) && angle_sums_are_full(m, x) &&
         boundary_is_simple(m, x);
}

// ---- intersection of two triangles ----

/// A triangle with the labels of its corners: A's vertices come first in the perturbation.
using LabelledTriangle = std::array<LabelledPoint, 3>;

inline LabelledTriangle labelled(const HalfEdgeMesh& m, const Points2& x, int f, int first_id) {
  const int i = m.corner(f, 0), j = m.corner(f, 1), k = m.corner(f, 2);
  return {{{row2(x, i), first_id + i}, {row2(x, j), first_id + j}, {row2(x, k), first_id + k}}};
}

/// side[i][k]: does corner i of the one triangle lie left of edge k of the other?
using Sides = std::array<std::array<bool, 3>, 3>;

/// What oriented() says of each; differences are shared among the three edges.
inline Sides sides(const LabelledTriangle& corners, const LabelledTriangle& edges) {
  Sides side{};
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec2 d[3] = {edges[0].p - corners[i].p, edges[1].p - corners[i].p,
                       edges[2].p - corners[i].p};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t l = k == 2 ? 0 : k + 1;
      const double left = d[k].x() * d[l].y(), right = d[k].y() * d[l].x(), det = left - right;
      const bool is_certain = std::abs(det) > kErrorBound * (std::abs(left) + std::abs(right));
      side[i][k] = is_certain ? det > 0 : oriented(edges[k], edges[l], corners[i]);
    }
  }
  return side;
}

inline bool inside(const std::array<bool, 3>& left) { return left[0] && left[1] && left[2]; }

/// The part of one edge of a triangle inside the other triangle: whether there is one, and the
/// edge of the other triangle through which it leaves, or -1 if it ends at its vertex.
struct EdgePiece {
  bool exists = false;
  int leaves_through = -1;
};

/// Edge i of the triangle whose corners have sides `own` (with respect to the other triangle's
/// edges); `other` are the sides of the other triangle's corners with respect to this one's edges.
inline EdgePiece edge_piece(std::size_t i, const Sides& own, const Sides& other) {
  const std::size_t j = (i + 1) % 3;
  EdgePiece piece;
  bool starts = inside(own[i]);
  bool ends = inside(own[j]);
  for (std::size_t k = 0; k < 3; ++k) {
    const bool crossed = own[i][k] != own[j][k] && other[k][i] != other[(k + 1) % 3][i];
    if (!crossed) continue;
    if (own[j][k])
      starts = true;
    else
      ends = true, piece.leaves_through = static_cast<int>(k);
  }
  piece.exists = starts && ends;
  return piece;
}

/// The intersection of two triangles; count 0 if they do not overlap.
inline OverlayPolygon intersect(const LabelledTriangle& a, const LabelledTriangle& b) {
  const Sides a_side = sides(a, b), b_side = sides(b, a);
  std::array<EdgePiece, 6> piece;
  for (std::size_t i = 0; i < 3; ++i) {
    piece[i] = edge_piece(i, a_side, b_side);
    piece[i + 3] = edge_piece(i, b_side, a_side);
  }
  OverlayPolygon polygon;
  int first = 0;
  while (first < 6 && !piece[static_cast<std::size_t>(first)].exists) ++first;
  if (first == 6) return polygon;
  int e = first;
  do {
    polygon.push(e);
    const int through = piece[static_cast<std::size_t>(e)].leaves_through;
    const int base = e < 3 ? 0 : 3;
    e = through < 0 ? base + (e - base + 1) % 3 : (3 - base) + through;
  } while (e != first && polygon.count < 6);
  return polygon;
}

// ---- the overlay of two embeddings ----

/// The polygons of an overlay, and the memory to compute the next one without allocating.
struct Overlay {
  Array<OverlayPolygon> polygons;
  Array<int> newest;  // per triangle of A: the polygon found last, or -1
  Array<int> older;   // per polygon: the one found before in the same triangle of A, or -1
  Array<int> mark;    // per triangle of B: the triangle of A that is known to meet it
  Array<std::pair<int, int>> seeds;  // triangles of A and B that meet
  BoundaryTree boundary_a, boundary_b;
};

class OverlayBuilder {
 public:
  OverlayBuilder(const HalfEdgeMesh& a, const Points2& f, const HalfEdgeMesh& b, const Points2& g,
                 Overlay& overlay)
      : a_(a), b_(b), f_(f), g_(g), overlay_(overlay) {}

  void build() {
    overlay_.polygons.clear();
    overlay_.older.clear();
    overlay_.seeds.clear();
    overlay_.newest.assign(a_.n_faces, -1);
    overlay_.mark.assign(b_.n_faces, -1);
    seed_boundary_crossings();
    if (overlay_.seeds.empty()) seed_containment();
    while (!overlay_.seeds.empty()) {
      const auto seed = overlay_.seeds.back();
      overlay_.seeds.pop_back();
      flood(seed.first, seed.second);
    }
  }

 private:
  /// Finds the polygons of one triangle of A that are connected to the one in tb within it; those
  /// across its edges become seeds, edge by edge, so that they come back together.
  void flood(int ta, int tb) {
    if (ta != marked_) mark_known(ta);
    if (overlay_.mark[tb] == ta) return;
    const LabelledTriangle a = labelled(a_, f_, ta, 0);
    const int begin = overlay_.polygons.size();
    add(ta, tb, a);
    for (int i = begin; i < overlay_.polygons.size(); ++i) {
      const OverlayPolygon p = overlay_.polygons[i];
      for (int k = 0; k < p.count; ++k) {
        const int e = p.piece(k), twin = e < 3 ? -1 : b_.twin[3 * p.tb + e - 3];
        if (twin >= 0) add(ta, twin / 3, a);
      }
    }
    for (int e = 0; e < 3; ++e) {
      const int twin = a_.twin[3 * ta + e];
      if (twin < 0) continue;
      for (int i = begin; i < overlay_.polygons.size(); ++i)
        if (overlay_.polygons[i].has(e))
          overlay_.seeds.push_back({twin / 3, overlay_.polygons[i].tb});
    }
  }

  void mark_known(int ta) {
    marked_ = ta;
    for (int i = overlay_.newest[ta]; i >= 0; i = overlay_.older[i])
      overlay_.mark[overlay_.polygons[i].tb] = ta;
  }

  void add(int ta, int tb, const LabelledTriangle& a) {
    if (overlay_.mark[tb] == ta) return;
    overlay_.mark[tb] = ta;
    OverlayPolygon p = intersect(a, labelled(b_, g_, tb, a_.n_vertices));
    if (p.count == 0) return;
    p.ta = ta;
    p.tb = tb;
    overlay_.older.push_back(overlay_.newest[ta]);
    overlay_.newest[ta] = overlay_.polygons.size();
    overlay_.polygons.push_back(p);
  }

  /// Every component of the overlap whose boundary belongs to both embeddings has a crossing of
  /// a boundary edge of A with one of B; the triangles at these edges overlap there.
  void seed_boundary_crossings() {
    overlay_.boundary_a.build(a_, f_);
    overlay_.boundary_b.build(b_, g_);
    overlay_.boundary_a.for_each_pair(overlay_.boundary_b, [&](int i, int j) {
      const int ha = a_.boundary[i], hb = b_.boundary[j];
      const LabelledPoint p = label_a(a_.tail[ha]), q = label_a(a_.tip(ha));
      const LabelledPoint r = label_b(b_.tail[hb]), s = label_b(b_.tip(hb));
      if (oriented(p, q, r) == oriented(p, q, s) || oriented(r, s, p) == oriented(r, s, q)) return;
      overlay_.seeds.push_back({ha / 3, hb / 3});
    });
  }

  /// Without crossings one embedding lies inside the other, or they are apart.
  void seed_containment() {
    const int ha = a_.boundary[0], hb = b_.boundary[0];
    for (int tb = 0; tb < b_.n_faces && overlay_.seeds.empty(); ++tb)
      if (contains(labelled(b_, g_, tb, a_.n_vertices), label_a(a_.tail[ha])))
        overlay_.seeds.push_back({ha / 3, tb});
    for (int ta = 0; ta < a_.n_faces && overlay_.seeds.empty(); ++ta)
      if (contains(labelled(a_, f_, ta, 0), label_b(b_.tail[hb])))
        overlay_.seeds.push_back({ta, hb / 3});
  }

  static bool contains(const LabelledTriangle& t, const LabelledPoint& p) {
    return oriented(t[0], t[1], p) && oriented(t[1], t[2], p) && oriented(t[2], t[0], p);
  }

  LabelledPoint label_a(int v) const { return {row2(f_, v), v}; }
  LabelledPoint label_b(int v) const { return {row2(g_, v), a_.n_vertices + v}; }

  const HalfEdgeMesh& a_;
  const HalfEdgeMesh& b_;
  const Points2& f_;
  const Points2& g_;
  Overlay& overlay_;
  int marked_ = -1;  // the triangle of A whose polygons are marked
};

/// Computes the meta mesh polygons of f(A) and g(B), both injective (Algorithm 1, line 3).
inline void compute_overlay(const HalfEdgeMesh& a, const Points2& f, const HalfEdgeMesh& b,
                            const Points2& g, Overlay& overlay) {
  OverlayBuilder(a, f, b, g, overlay).build();
}

}  // namespace detail
}  // namespace ism

// ==== [8] ENERGIES (paper §4.1, §4.2, §4.4, §5.1) ================================================
//
// Purpose:    value, gradient and Hessian of the distortion of one meta mesh polygon and of one
//             parametrised triangle in closed form, and the projection of Hessians to s.p.d. ones.
// Invariants: six planar points, two rest frames and a corner code are the whole input; values are
//             finite whenever both triangles are positive, also for polygons without area.
// Fails:      never; triangles that are not positive, or too thin for rounded determinants to be,
//             have energy +infinity.

namespace ism {
namespace detail {

using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat6 = Eigen::Matrix<double, 6, 6>;
using SixPoints = Eigen::Matrix<double, 2, 6>;  // columns: a0 a1 a2 b0 b1 b2

// ---- geometry of a polygon ----

/// One piece of a polygon's boundary: edge `e` (0-5 as in OverlayPolygon), from its parameter s to
/// t, 0 ≤ s ≤ t ≤ 1 up to rounding.
struct Piece {
  int e = 0;
  double s = 0;
  double t = 1;
};

struct PolygonShape {
  std::array<Piece, 6> piece;
  int count = 0;
  Vec2 origin = Vec2::Zero();  // a corner; areas are computed relative to it
  const Piece& operator[](int i) const { return piece[static_cast<std::size_t>(i)]; }
  Piece& operator[](int i) { return piece[static_cast<std::size_t>(i)]; }
};

inline int edge_start(int e) { return e; }
inline int edge_end(int e) { return e < 3 ? (e + 1) % 3 : 3 + (e - 2) % 3; }
inline bool same_triangle(int e, int other) { return (e < 3) == (other < 3); }

inline double clamp01(double x) { return (std::min)((std::max)(x, 0.0), 1.0); }

/// Parameters (t, μ) of the crossing u + t d = c + μ w of Eq. 6. For edges that are parallel to
/// rounding, the middle of the common part stands for the crossing, which then has no influence on
/// the area.
inline std::pair<double, double> crossing(const Vec2& u, const Vec2& d, const Vec2& c,
                                          const Vec2& w) {
  const double D = cross(d, w), dd = d.squaredNorm(), ww = w.squaredNorm();
  const double sine = std::abs(D) / std::sqrt(dd * ww);
  const auto on_w = [&](double t) { return clamp01((u + t * d - c).dot(w) / ww); };
  if (sine > 1e-3) return {clamp01(cross(c - u, w) / D), clamp01(cross(c - u, d) / D)};
  if (sine > 1e-14) {
    const double t = clamp01(cross(c - u, w) / D);
    return {t, on_w(t)};
  }
  const double c_at = (c - u).dot(d) / dd, e_at = (c + w - u).dot(d) / dd;
  const double lo = (std::max)((std::min)(c_at, e_at), 0.0);
  const double hi = (std::min)((std::max)(c_at, e_at), 1.0);
  const double t = clamp01(0.5 * (lo + hi));
  return {t, on_w(t)};
}

inline PolygonShape polygon_shape(const OverlayPolygon& p, const SixPoints& x) {
  PolygonShape shape;
  shape.count = p.count;
  int before = p.count - 1;
  for (int i = 0; i < p.count; ++i) shape[i].e = p.piece(i);
  for (int i = 0; i < p.count; before = i++) {
    const int e = shape[before].e, g = shape[i].e;
    if (same_triangle(e, g)) continue;  // the corner is a vertex: t = 1, s = 0
    const Vec2 u = x.col(edge_start(e)), c = x.col(edge_start(g));
    std::tie(shape[before].t, shape[i].s) =
        crossing(u, x.col(edge_end(e)) - u, c, x.col(edge_end(g)) - c);
  }
  const Piece& first = shape[0];
  shape.origin = (1 - first.s) * x.col(edge_start(first.e)) + first.s * x.col(edge_end(first.e));
  return shape;
}

/// a = ½ Σ (t - s) (u × v) over the pieces, on edges u → v.
inline double polygon_area(const PolygonShape& shape, const SixPoints& x) {
  double twice = 0;
  for (int i = 0; i < shape.count; ++i) {
    const Piece& q = shape[i];
    const Vec2 u = x.col(edge_start(q.e)) - shape.origin, v = x.col(edge_end(q.e)) - shape.origin;
    twice += (q.t - q.s) * cross(u, v);
  }
  return 0.5 * twice;
}

/// A polygon whose area drowns in rounding errors of its triangles' coordinates. It weighs nothing
/// in E, and its derivatives would be those of the noise.
inline bool is_negligible(double area, const SixPoints& x) {
  constexpr double kNoise = 1e-12;
  const double a = cross(x.col(1) - x.col(0), x.col(2) - x.col(0));
  const double b = cross(x.col(4) - x.col(3), x.col(5) - x.col(3));
  return !(area > kNoise * (std::min)(a, b));
}

// ---- distortion density w(F, G) ----

/// J = [p1 - p0, p2 - p0] R⁻¹ (Eq. 2).
inline Eigen::Matrix2d jacobian(const Vec2& p0, const Vec2& p1, const Vec2& p2,
                                const Eigen::Matrix2d& rest_inverse) {
  Eigen::Matrix2d edges;
  edges << p1 - p0, p2 - p0;
  return edges * rest_inverse;
}

inline Eigen::Matrix2d adjugate(const Eigen::Matrix2d& m) {
  Eigen::Matrix2d adj;
  adj << m(1, 1), -m(0, 1), -m(1, 0), m(0, 0);
  return adj;
}

/// The gradient of det m with respect to (m11, m21, m12, m22).
inline Eigen::Vector4d det_gradient(const Eigen::Matrix2d& m) {
  return Eigen::Vector4d(m(1, 1), -m(0, 1), -m(1, 0), m(0, 0));
}

// A density depends on J_f = F and J_g = G through three numbers, N = ‖adj(G) F‖², f = det F and
// g = det G. Of J_Φ = G⁻¹ F, S = N / g² = σ_max² + σ_min² and d = f / g = σ_max σ_min.

/// A function of (N, f, g).
struct InvariantDerivatives {
  double value = 0;
  Vec3 gradient = Vec3::Zero();
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
};

/// N (f⁻³ + g⁻³): the density of the symmetric Dirichlet energy (Eq. 4).
inline InvariantDerivatives dirichlet_density(double N, double f, double g) {
  const double i = 1 / f, j = 1 / g, i3 = i * i * i, j3 = j * j * j;
  InvariantDerivatives w;
  w.value = N * (i3 + j3);
  w.gradient << i3 + j3, -3 * N * i3 * i, -3 * N * j3 * j;
  w.hessian << 0, -3 * i3 * i, -3 * j3 * j,  //
      -3 * i3 * i, 12 * N * i3 * i * i, 0,   //
      -3 * j3 * j, 0, 12 * N * j3 * j * j;
  return w;
}

/// A function D of (S, d), integrated over `on_a` of A' and `on_b` of B'.
struct StretchDerivatives {
  double value, S, d, SS, Sd, dd;
};

/// D (on_a / f + on_b / g) as a function of (N, f, g).
inline InvariantDerivatives stretch_density(const StretchDerivatives& D, double on_a, double on_b,
                                            double N, double f, double g) {
  const double i = 1 / f, j = 1 / g, j2 = j * j;
  const Vec3 dS(j2, 0, -2 * N * j * j2), dd(0, j, -f * j2);
  Eigen::Matrix3d hS = Eigen::Matrix3d::Zero(), hd = hS, ha = hS;
  hS(0, 2) = hS(2, 0) = -2 * j * j2, hS(2, 2) = 6 * N * j2 * j2;
  hd(1, 2) = hd(2, 1) = -j2, hd(2, 2) = 2 * f * j * j2;
  const double a = on_a * i + on_b * j;
  const Vec3 da(0, -on_a * i * i, -on_b * j2);
  ha(1, 1) = 2 * on_a * i * i * i, ha(2, 2) = 2 * on_b * j * j2;
  const Vec3 dD = D.S * dS + D.d * dd;
  const Eigen::Matrix3d hD = D.SS * dS * dS.transpose() + D.dd * dd * dd.transpose() +
                             D.Sd * (dS * dd.transpose() + dd * dS.transpose()) + D.S * hS +
                             D.d * hd;
  InvariantDerivatives w;
  w.value = D.value * a;
  w.gradient = a * dD + D.value * da;
  w.hessian = a * hD + dD * da.transpose() + da * dD.transpose() + D.value * ha;
  return w;
}

/// (1 - σ_min)² + (1 - σ_max)² = S + 2 - 2 p with p = σ_max + σ_min = √(S + 2 d).
inline StretchDerivatives arap_stretch(double S, double d) {
  const double p = std::sqrt(S + 2 * d), p3 = p * p * p;
  return {S + 2 - 2 * p, 1 - 1 / p, -2 / p, 0.5 / p3, 1 / p3, 2 / p3};
}

/// (σ_max - σ_min)² = S - 2 d.
inline StretchDerivatives asap_stretch(double S, double d) { return {S - 2 * d, 1, -2, 0, 0, 0}; }

/// (1 - 1/σ_min)² + (1 - σ_max)² with σ = (p ± q) / 2, q = √(S - 2 d + δ S). Without δ, q has a
/// kink where it is 0.
inline StretchDerivatives sarap_stretch(double S, double d) {
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

/// A density of (N, f, g) at Jacobians F and G; +∞ unless both determinants are positive.
inline double density_value(InvariantDensity density, const Eigen::Matrix2d& F,
                            const Eigen::Matrix2d& G) {
  const double f = F.determinant(), g = G.determinant();
  if (!(f > 0) || !(g > 0)) return kInfinity;
  return density((adjugate(G) * F).squaredNorm(), f, g).value;
}

/// The weights of a triangle's points in the columns of its Jacobian: J_c = Σ_i B(i, c) p_i.
inline Eigen::Matrix<double, 3, 2> corner_weights(const Eigen::Matrix2d& rest_inverse) {
  Eigen::Matrix<double, 3, 2> B;
  B.bottomRows<2>() = rest_inverse;
  B.row(0) = -rest_inverse.colwise().sum();
  return B;
}

// ---- one parametrised triangle: E_f and E_g (§4.4) ----

/// Symmetric Dirichlet energy A (‖J‖² + ‖J‖²/det² J) of one triangle.
inline double triangle_energy(const Eigen::Matrix2d& J, double area) {
  const double f = J.determinant();
  return f > 0 ? area * J.squaredNorm() * (1 + 1 / (f * f)) : kInfinity;
}

struct TriangleDerivatives {
  double value = 0;
  Vec6 gradient = Vec6::Zero();
  Mat6 hessian = Mat6::Zero();
};

/// The same with derivatives with respect to its three planar points (p0, p1, p2).
inline TriangleDerivatives triangle_derivatives(const Eigen::Matrix2d& J,
                                                const Eigen::Matrix2d& rest_inverse, double area) {
  const double S = J.squaredNorm(), i = 1 / J.determinant(), i2 = i * i;
  const Eigen::Vector4d dS = 2 * Eigen::Map<const Eigen::Vector4d>(J.data());
  const Eigen::Vector4d df = det_gradient(J);
  const double e_f = -2 * S * i2 * i, e_ff = 6 * S * i2 * i2, e_Sf = -2 * i2 * i;
  const Eigen::Vector4d g = (1 + i2) * dS + e_f * df;
  Eigen::Matrix4d H =
      e_ff * df * df.transpose() + e_Sf * (dS * df.transpose() + df * dS.transpose());
  H.diagonal().array() += 2 * (1 + i2);
  H(0, 3) += e_f, H(3, 0) += e_f;
  H(1, 2) -= e_f, H(2, 1) -= e_f;
  const Eigen::Matrix<double, 3, 2> B = corner_weights(rest_inverse);
  Eigen::Matrix<double, 4, 6> C = Eigen::Matrix<double, 4, 6>::Zero();
  for (int k = 0; k < 3; ++k)
    for (int c = 0; c < 2; ++c) C(2 * c, 2 * k) = C(2 * c + 1, 2 * k + 1) = B(k, c);
  TriangleDerivatives result;
  result.value = area * S * (1 + i2);
  result.gradient = area * C.transpose() * g;
  result.hessian = area * C.transpose() * H * C;
  return result;
}

// ---- lanes: many polygons side by side ----
//
// Polygons are differentiated in batches, one per lane, and Hessians of polygons and triangles are
// projected in batches: every operation below acts on all lanes, which the compiler turns into the
// vector instructions it may use. Lanes do not mix, so results do not depend on what else is in a
// batch.

constexpr int kLanes = 16;
using Lanes = Eigen::Array<double, kLanes, 1>;

template <int N>
struct LaneVector {
  Lanes entry[static_cast<std::size_t>(N)];
  Lanes& operator[](int i) { return entry[i]; }
  const Lanes& operator[](int i) const { return entry[i]; }
};

/// A symmetric matrix in every lane, of which the lower triangles count.
template <int N>
struct LaneMatrix {
  Lanes entry[static_cast<std::size_t>(N)][static_cast<std::size_t>(N)];
  Lanes& operator()(int i, int j) { return entry[i][j]; }
  const Lanes& operator()(int i, int j) const { return entry[i][j]; }
  const Lanes& symmetric(int i, int j) const { return i >= j ? entry[i][j] : entry[j][i]; }
};

/// 1 where x is above 0, else 0: selects without branches. The factors make 1 of any positive
/// double.
inline Lanes is_positive(const Lanes& x) { return (x * 1e300 * 1e300).max(0.0).min(1.0); }

inline Lanes select(const Lanes& which, const Lanes& one, const Lanes& zero) {
  return which * one + (1 - which) * zero;
}

inline Lanes cross(const Lanes& ax, const Lanes& ay, const Lanes& bx, const Lanes& by) {
  return ax * by - ay * bx;
}

// ---- projection to s.p.d. matrices (§5.1) ----

/// Eigenvalues and eigenvectors of small symmetric matrices by Householder tridiagonalisation and
/// implicit QL iteration [Bowdler, Martin, Reinsch, Wilkinson 1968]. Lanes that are done wait for
/// the others.
template <int N>
struct LaneEigen {
  LaneVector<N> value;
  Lanes vector[static_cast<std::size_t>(N)]
              [static_cast<std::size_t>(N)];  // row i belongs to value[i]

  explicit LaneEigen(LaneMatrix<N> a) {
    tridiagonalize(a);
    for (int l = 0; l + 1 < N; ++l) settle(l);
  }

 private:
  LaneVector<N> below;  // subdiagonal of the tridiagonal matrix

  /// a = Q T Qᵀ by reflections I - β v vᵀ, v kept in the columns of a; `vector` becomes Qᵀ.
  void tridiagonalize(LaneMatrix<N>& a) {
    LaneVector<N> beta;
    for (int k = 0; k + 1 < N; ++k) {
      value[k] = a(k, k);
      Lanes tail = Lanes::Zero();
      for (int i = k + 2; i < N; ++i) tail += a(i, k).square();
      const Lanes head = a(k + 1, k), norm = (head.square() + tail).sqrt();
      const Lanes some = is_positive(tail), signed_norm = select(is_positive(head), norm, -norm);
      below[k] = select(some, -signed_norm, head);
      a(k + 1, k) = some * (head + signed_norm);
      beta[k] = some / (signed_norm * (head + signed_norm) + (1 - some));  // 2 / vᵀv
      reflect(a, k, beta[k]);
    }
    value[N - 1] = a(N - 1, N - 1);
    below[N - 1].setZero();
    accumulate(a, beta);
  }

  /// a ← (I - β v vᵀ) a (I - β v vᵀ) on the rows and columns behind k.
  static void reflect(LaneMatrix<N>& a, int k, const Lanes& beta) {
    LaneVector<N> w;
    for (int i = k + 1; i < N; ++i) w[i].setZero();
    for (int j = k + 1; j < N; ++j) {
      Lanes sum = a(j, j) * a(j, k);
      for (int i = j + 1; i < N; ++i) {
        sum += a(i, j) * a(i, k);
        w[i] += a(i, j) * a(j, k);
      }
      w[j] += sum;
    }
    Lanes vw = Lanes::Zero();
    for (int i = k + 1; i < N; ++i) {
      w[i] *= beta;
      vw += a(i, k) * w[i];
    }
    for (int i = k + 1; i < N; ++i) w[i] -= 0.5 * beta * vw * a(i, k);
    for (int j = k + 1; j < N; ++j)
      for (int i = j; i < N; ++i) a(i, j) -= a(i, k) * w[j] + w[i] * a(j, k);
  }

  /// vector = Qᵀ, the product of the reflections.
  void accumulate(const LaneMatrix<N>& v, const LaneVector<N>& beta) {
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) vector[i][j].setConstant(i == j ? 1 : 0);
    for (int k = N - 2; k >= 0; --k)
      for (int i = k + 1; i < N; ++i) {
        Lanes sum = Lanes::Zero();
        for (int j = k + 1; j < N; ++j) sum += vector[i][j] * v(j, k);
        sum *= beta[k];
        for (int j = k + 1; j < N; ++j) vector[i][j] -= sum * v(j, k);
      }
  }

  /// 1 in the lanes whose sweep, which starts at m, has passed place i.
  static Lanes is_above(const Lanes& m, int i) { return (m - i).max(0.0).min(1.0); }

  /// The first negligible subdiagonal entry from l on.
  Lanes split(int l) const {
    constexpr double kNegligible = std::numeric_limits<double>::epsilon();
    Lanes m = Lanes::Constant(N - 1);
    for (int i = N - 2; i >= l; --i) {
      const Lanes excess = below[i].abs() - kNegligible * (value[i].abs() + value[i + 1].abs());
      m = select(is_positive(excess), m, Lanes::Constant(i));
    }
    return m;
  }

  /// QL sweeps with Wilkinson's shift until value[l] stands alone.
  void settle(int l) {
    constexpr int kMostSweeps = 50;
    for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
      const Lanes m = split(l);
      int last = l;  // NaN does not count
      for (int k = 0; k < kLanes; ++k)
        if (m[k] > last) last = static_cast<int>(m[k]);
      if (last == l) return;
      const Lanes on = is_above(m, l), off = 1 - on;
      const Lanes half = 0.5 * (value[l + 1] - value[l]) / (below[l] + off);
      const Lanes root = half.abs() + (half.square() + 1).sqrt();
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
    Lanes g, s = Lanes::Ones(), c = Lanes::Ones(), p = Lanes::Zero();
  };

  /// One rotation of a sweep, in the lanes that have started.
  void rotate(int i, const Lanes& m, Sweep& state) {
    constexpr double kTiny = 1e-150;  // keeps 0/0 away: then c = 1 and s = 0
    const Lanes on = is_above(m, i), off = 1 - on;
    const Lanes f = state.s * below[i], b = state.c * below[i], g = state.g + kTiny;
    const Lanes r2 = f.square() + g.square(), r = r2.sqrt();
    const Lanes inverse = r * (1 / r2);  // beside the root, not after it
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

/// Raises the eigenvalues of the Hessian of a function of P planar points, which does not change
/// when all of them are moved, to at least ε [Teran et al. 2005]; with ε = -∞ to none. With γ = 1 /
/// (1 + √P), the vectors e_i - γ e_0 - const, i ≥ 1, are orthonormal and span all but the
/// translations; there, H is H_ij - γ (H_i0 + H_0j) + γ² H_00.
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
  const LaneEigen<N> eigen(reduced);
  LaneVector<2 * P> v, lifted;
  for (int k = 0; k < N; ++k) {
    const Lanes lift = (epsilon - eigen.value[k]).max(0.0);
    if (!(lift > 0).any()) continue;
    for (int r = 0; r < 2; ++r) {
      Lanes sum = Lanes::Zero();
      for (int i = r; i < N; i += 2) sum += eigen.vector[k][i];
      v[r] = -sum / root;
      for (int i = r; i < N; i += 2) v[i + 2] = eigen.vector[k][i] - gamma / root * sum;
    }
    for (int i = 0; i < 2 * P; ++i) {
      lifted[i] = lift * v[i];
      for (int j = 0; j <= i; ++j) H(i, j) += lifted[i] * v[j];
    }
  }
  for (int i = 0; i < 2 * P; ++i)
    for (int j = i % 2; j <= i; j += 2) H(i, j) += (std::max)(epsilon, 0.0) / P;  // translations
}

// ---- the density w(F, G) ----

/// w with its derivatives in the entries f11 f21 f12 f22 g11 g21 g12 g22, one pair in every lane.
struct LaneDensity {
  Lanes value;
  LaneVector<8> gradient;
  LaneMatrix<8> hessian;
};

/// Value, gradient and Hessian in (N, f, g), the latter two as N, f, g and NN, fN, ff, gN, gf, gg.
struct LaneInvariants {
  Lanes value, d[3], dd[6];
};

inline LaneInvariants evaluate_invariants(InvariantDensity density, const Lanes& N, const Lanes& f,
                                          const Lanes& g) {
  LaneInvariants v;
  for (int l = 0; l < kLanes; ++l) {
    const InvariantDerivatives w = density(N[l], f[l], g[l]);
    v.value[l] = w.value;
    for (int i = 0, k = 0; i < 3; ++i) {
      v.d[i][l] = w.gradient[i];
      for (int j = 0; j <= i; ++j) v.dd[k++][l] = w.hessian(i, j);
    }
  }
  return v;
}

/// Entry r of perp(v), v one of the columns F_1, F_2, G_1, G_2.
inline Lanes perp_of(const LaneVector<8>& J, int column, int r) {
  return r == 0 ? J[2 * column + 1] : Lanes(-J[2 * column]);
}

/// Adds scale · ∇² det for the four entries from `first` on.
inline void add_det_hessian(const Lanes& scale, int first, LaneMatrix<8>& H) {
  H(first + 3, first) += scale;
  H(first + 2, first + 1) -= scale;
}

/// X_cd = cross(F_c, G_d) of the columns of F and G.
using ColumnProducts = std::array<std::array<Lanes, 2>, 2>;

/// Adds scale · ∇²N. N is the sum of X_cd², ∂X_cd/∂F_c = perp(G_d) and ∂X_cd/∂G_d = -perp(F_c).
inline void add_norm_hessian(const LaneVector<8>& J, const ColumnProducts& X, const Lanes& scale,
                             LaneMatrix<8>& H) {
  const auto perp = [&](int column, int r) { return perp_of(J, column, r); };
  for (int r = 0; r < 2; ++r)  // between F and F, G and G
    for (int q = 0; q <= r; ++q)
      for (int m = 0; m < 2; ++m) {
        const int other = 2 - 2 * m;
        const Lanes P =
            2 * scale * (perp(other, r) * perp(other, q) + perp(other + 1, r) * perp(other + 1, q));
        H(4 * m + r, 4 * m + q) += P;
        H(4 * m + 2 + r, 4 * m + 2 + q) += P;
      }
  for (int c = 0; c < 2; ++c)  // between G and F
    for (int d = 0; d < 2; ++d)
      for (int r = 0; r < 2; ++r)
        for (int q = 0; q < 2; ++q) {
          const Lanes& x = X[static_cast<std::size_t>(c)][static_cast<std::size_t>(d)];
          Lanes sum = -perp(c, r) * perp(2 + d, q);
          if (r != q) sum += r == 0 ? -x : x;
          H(4 + 2 * d + r, 2 * c + q) += 2 * scale * sum;
        }
}

/// w has the gradient Σ w_m ∇m over m = N, f, g, and the Hessian Σ w_m ∇²m + Σ w_mn ∇m ∇nᵀ.
inline void differentiate_invariants(InvariantDensity density, const LaneVector<8>& J,
                                     LaneDensity& w) {
  ColumnProducts X;
  Lanes N = Lanes::Zero();
  for (std::size_t c = 0; c < 2; ++c)
    for (std::size_t d = 0; d < 2; ++d) {
      const int F = 2 * static_cast<int>(c), G = 4 + 2 * static_cast<int>(d);
      X[c][d] = cross(J[F], J[F + 1], J[G], J[G + 1]);
      N += X[c][d].square();
    }
  const LaneInvariants v =
      evaluate_invariants(density, N, cross(J[0], J[1], J[2], J[3]), cross(J[4], J[5], J[6], J[7]));
  LaneVector<8> dN, dfg;  // ∇N, and ∇f or ∇g, whichever is not zero
  for (std::size_t c = 0; c < 2; ++c)
    for (int r = 0; r < 2; ++r) {
      const int k = 2 * static_cast<int>(c) + r;
      dN[k] = 2 * (X[c][0] * perp_of(J, 2, r) + X[c][1] * perp_of(J, 3, r));
      dN[4 + k] = -2 * (X[0][c] * perp_of(J, 0, r) + X[1][c] * perp_of(J, 1, r));
    }
  for (int m = 0; m < 8; m += 4) {
    dfg[m] = J[m + 3], dfg[m + 1] = -J[m + 2];
    dfg[m + 2] = -J[m + 1], dfg[m + 3] = J[m];
  }
  w.value = v.value;
  for (int i = 0; i < 8; ++i) {
    w.gradient[i] = v.d[0] * dN[i] + (i < 4 ? v.d[1] : v.d[2]) * dfg[i];
    const Lanes on_dN = v.dd[0] * dN[i] + (i < 4 ? v.dd[1] : v.dd[3]) * dfg[i];
    const Lanes on_df = v.dd[1] * dN[i] + (i < 4 ? v.dd[2] : v.dd[4]) * dfg[i];
    const Lanes on_dg = v.dd[3] * dN[i] + v.dd[5] * dfg[i];
    for (int j = 0; j <= i; ++j) w.hessian(i, j) = on_dN * dN[j] + (j < 4 ? on_df : on_dg) * dfg[j];
  }
  add_norm_hessian(J, X, v.d[0], w.hessian);
  add_det_hessian(v.d[1], 0, w.hessian);
  add_det_hessian(v.d[2], 4, w.hessian);
}

/// Adds -κ (1/f + 1/g), the density of the covered areas.
inline void add_coverage(const LaneVector<8>& J, double kappa, LaneDensity& w) {
  for (int m = 0; m < 8; m += 4) {
    const Lanes i = 1 / cross(J[m], J[m + 1], J[m + 2], J[m + 3]), slope = kappa * i.square();
    const Lanes d[4] = {J[m + 3], -J[m + 2], -J[m + 1], J[m]};  // ∇ det
    w.value -= kappa * i;
    for (int k = 0; k < 4; ++k) {
      w.gradient[m + k] += slope * d[k];
      const Lanes scaled = 2 * slope * i * d[k];
      for (int j = 0; j <= k; ++j) w.hessian(m + k, m + j) -= scaled * d[j];
    }
    add_det_hessian(slope, m, w.hessian);
  }
}

inline Eigen::Matrix2d jacobian_in(const LaneVector<8>& J, int first, int lane) {
  Eigen::Matrix2d m;
  m << J[first][lane], J[first + 2][lane], J[first + 1][lane], J[first + 3][lane];
  return m;
}

inline Density density_derivatives(InvariantDensity density, const Eigen::Matrix2d& F,
                                   const Eigen::Matrix2d& G) {
  LaneVector<8> J;
  for (int k = 0; k < 4; ++k) {
    J[k].setConstant(F.data()[k]);
    J[4 + k].setConstant(G.data()[k]);
  }
  LaneDensity w;
  differentiate_invariants(density, J, w);
  Density result;
  result.value = w.value[0];
  for (int i = 0; i < 8; ++i) {
    result.gradient[i] = w.gradient[i][0];
    for (int j = 0; j < 8; ++j) result.hessian(i, j) = w.hessian.symmetric(i, j)[0];
  }
  return result;
}

/// Measures that are a function of three invariants, which is faster.
struct BuiltInMeasure {
  static DistortionMeasure of(InvariantDensity density) {
    DistortionMeasure measure(
        [=](const Eigen::Matrix2d& F, const Eigen::Matrix2d& G) {
          return density_value(density, F, G);
        },
        [=](const Eigen::Matrix2d& F, const Eigen::Matrix2d& G) {
          return density_derivatives(density, F, G);
        });
    measure.in_invariants_ = density;
    return measure;
  }

  /// Null for a measure of the user's own.
  static InvariantDensity density(const DistortionMeasure& m) { return m.in_invariants_; }
};

}  // namespace detail

inline DistortionMeasure symmetric_dirichlet() {
  return detail::BuiltInMeasure::of(detail::dirichlet_density);
}
inline DistortionMeasure arap() {
  return detail::BuiltInMeasure::of([](double N, double f, double g) {
    return detail::stretch_density(detail::arap_stretch(N / (g * g), f / g), 1, 0, N, f, g);
  });
}
inline DistortionMeasure sarap() {
  return detail::BuiltInMeasure::of([](double N, double f, double g) {
    return detail::stretch_density(detail::sarap_stretch(N / (g * g), f / g), 0.5, 0.5, N, f, g);
  });
}
inline DistortionMeasure asap() {
  return detail::BuiltInMeasure::of([](double N, double f, double g) {
    return detail::stretch_density(detail::asap_stretch(N / (g * g), f / g), 1, 0, N, f, g);
  });
}

namespace detail {

// ---- a batch of polygons ----

/// The density of a measure, lane by lane where it is one of the user's.
inline void differentiate_measure(const DistortionMeasure& measure, const LaneVector<8>& J,
                                  LaneDensity& w) {
  if (const InvariantDensity density = BuiltInMeasure::density(measure))
    return differentiate_invariants(density, J, w);
  for (int l = 0; l < kLanes; ++l) {
    const Density density = measure.derivatives(jacobian_in(J, 0, l), jacobian_in(J, 4, l));
    w.value[l] = density.value;
    for (int i = 0; i < 8; ++i) {
      w.gradient[i][l] = density.gradient[i];
      for (int j = 0; j <= i; ++j) w.hessian(i, j)[l] = density.hessian(i, j);
    }
  }
}

/// One polygon per lane: what differentiate() needs, and what it finds.
struct PolygonBatch {
  LaneVector<12> x;  // a0 a1 a2 b0 b1 b2, two coordinates each
  LaneVector<8> rest_inverse;
  LaneVector<6> s, t;  // of the pieces; both 0 on edges without one
  struct Corner {
    Lanes is_there, on_a, on_b;  // 1 or 0; the parameters on both edges
  };
  Corner corner[3][3];  // where an edge of t_A meets one of t_B
  Lanes area;
  std::array<bool, kLanes> is_negligible;  // then the rest of the lane means nothing

  Lanes value;
  LaneVector<12> gradient;
  LaneMatrix<12> hessian;
};

inline void load(const OverlayPolygon& p, const SixPoints& x, const Eigen::Matrix2d& rest_inverse_a,
                 const Eigen::Matrix2d& rest_inverse_b, int lane, PolygonBatch& batch) {
  const PolygonShape shape = polygon_shape(p, x);
  batch.area[lane] = polygon_area(shape, x);
  batch.is_negligible[static_cast<std::size_t>(lane)] = is_negligible(batch.area[lane], x);
  for (int i = 0; i < 12; ++i) batch.x[i][lane] = x.data()[i];
  for (int i = 0; i < 4; ++i) {
    batch.rest_inverse[i][lane] = rest_inverse_a.data()[i];
    batch.rest_inverse[4 + i][lane] = rest_inverse_b.data()[i];
  }
  for (int e = 0; e < 6; ++e) batch.s[e][lane] = batch.t[e][lane] = 0;
  for (auto& row : batch.corner)
    for (PolygonBatch::Corner& c : row) c.is_there[lane] = c.on_a[lane] = c.on_b[lane] = 0;
  int before = shape.count - 1;
  for (int i = 0; i < shape.count; before = i++) {
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

/// ∂a/∂u = Σ α perp(d), ∂a/∂v = Σ β perp(d) over the pieces on edges d = v - u, β = (t² - s²)/2,
/// α = (t - s) - β: a boundary piece moves outward by the interpolated motion of its edge, its ends
/// move along the boundary.
inline LaneVector<12> area_gradient(const PolygonBatch& batch) {
  LaneVector<12> gradient;
  for (int i = 0; i < 12; ++i) gradient[i].setZero();
  for (int e = 0; e < 6; ++e) {
    const int u = 2 * edge_start(e), v = 2 * edge_end(e);
    const Lanes beta = 0.5 * (batch.t[e].square() - batch.s[e].square());
    const Lanes alpha = (batch.t[e] - batch.s[e]) - beta;
    const Lanes nx = batch.x[v + 1] - batch.x[u + 1], ny = batch.x[u] - batch.x[v];
    gradient[u] += alpha * nx, gradient[u + 1] += alpha * ny;
    gradient[v] += beta * nx, gradient[v + 1] += beta * ny;
  }
  return gradient;
}

/// Adds the part of weight · ∇²a that comes from the corner of edges i of t_A and j of t_B. With
/// d, w the edges, m_d = perp(d), m_w = perp(w), and Z_d, Z_w the motions of the crossing point as
/// a point of either edge, δ²a has the part
///   -(1 / |d × w|) [(m_d·Z_d)(m_w·Z_d) - 2 (m_d·Z_d)(m_w·Z_w) + (m_w·Z_w)(m_d·Z_w)].
/// |d × w| is kept from vanishing relative to the edges, so that near-parallel edges stay finite.
inline void add_corner_hessian(const PolygonBatch& batch, int i, int j, const Lanes& weight,
                               LaneMatrix<12>& H) {
  constexpr double kMostParallel = 1e-8;
  const PolygonBatch::Corner& corner = batch.corner[i][j];
  const int end_a[2] = {2 * edge_start(i), 2 * edge_end(i)};
  const int end_b[2] = {2 * edge_start(3 + j), 2 * edge_end(3 + j)};
  const auto normal = [&](const int(&ends)[2], int r) -> Lanes {
    const Lanes along = batch.x[ends[1] + 1 - r] - batch.x[ends[0] + 1 - r];
    return r == 0 ? along : Lanes(-along);
  };
  const Lanes m_d[2] = {normal(end_a, 0), normal(end_a, 1)};
  const Lanes m_w[2] = {normal(end_b, 0), normal(end_b, 1)};
  const Lanes D = cross(m_d[0], m_d[1], m_w[0], m_w[1]).abs();
  const Lanes least =
      kMostParallel *
      ((m_d[0].square() + m_d[1].square()) * (m_w[0].square() + m_w[1].square())).sqrt();
  const Lanes scale = weight * corner.is_there * is_positive(D) / D.max(least);
  const Lanes part_a[2] = {1 - corner.on_a, corner.on_a},
              part_b[2] = {1 - corner.on_b, corner.on_b};
  const Lanes own[3] = {m_d[0] * m_w[0], 0.5 * (m_d[0] * m_w[1] + m_d[1] * m_w[0]),
                        m_d[1] * m_w[1]};
  const auto add_own = [&](const int(&ends)[2], const Lanes(&part)[2]) {
    for (int k = 0; k < 2; ++k)
      for (int l = 0; l < 2; ++l) {
        if (ends[l] > ends[k]) continue;
        const Lanes factor = scale * part[k] * part[l];
        for (int r = 0; r < 2; ++r)
          for (int q = 0; q < (k == l ? r + 1 : 2); ++q)
            H(ends[k] + r, ends[l] + q) -= factor * own[r + q];
      }
  };
  add_own(end_a, part_a);
  add_own(end_b, part_b);
  for (int k = 0; k < 2; ++k)
    for (int l = 0; l < 2; ++l) {
      const Lanes factor = scale * part_b[k] * part_a[l];
      for (int r = 0; r < 2; ++r) {
        const Lanes row = factor * m_w[r];
        for (int q = 0; q < 2; ++q) H(end_b[k] + r, end_a[l] + q) += row * m_d[q];
      }
    }
}

/// H = weight · ∇²a, from δ²a = Σ (t - s)(δu × δv) over the pieces plus the corners.
inline void set_area_hessian(const PolygonBatch& batch, const Lanes& weight, LaneMatrix<12>& H) {
  for (int i = 0; i < 12; ++i)
    for (int j = 0; j <= i; ++j) H(i, j).setZero();
  for (int e = 0; e < 6; ++e) {
    const int u = 2 * edge_start(e), v = 2 * edge_end(e), lo = (std::min)(u, v);
    const Lanes half = 0.5 * weight * (batch.t[e] - batch.s[e]);
    const Lanes signed_half = u < v ? half : Lanes(-half);
    H((std::max)(u, v) + 1, lo) += signed_half;
    H((std::max)(u, v), lo + 1) -= signed_half;
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) add_corner_hessian(batch, i, j, weight, H);
}

/// corner_weights() in every lane.
struct LaneCornerWeights {
  Lanes weight[3][2];
  explicit LaneCornerWeights(const Lanes* rest_inverse) {
    for (int c = 0; c < 2; ++c) {
      weight[1][c] = rest_inverse[2 * c];
      weight[2][c] = rest_inverse[2 * c + 1];
      weight[0][c] = -weight[1][c] - weight[2][c];
    }
  }
};

/// E_ρ = a w(F, G) with all derivatives: a ∇²w + ∇w ∇aᵀ + ∇a ∇wᵀ + w ∇²a.
inline void differentiate(const DistortionMeasure& measure, double kappa, PolygonBatch& batch) {
  const LaneCornerWeights B[2] = {LaneCornerWeights(&batch.rest_inverse[0]),
                                  LaneCornerWeights(&batch.rest_inverse[4])};
  LaneVector<8> J;
  for (int k = 0; k < 8; ++k) {
    const int m = k / 4, c = k % 4 / 2, first = 6 * m + k % 2;
    J[k] = B[m].weight[1][c] * (batch.x[first + 2] - batch.x[first]) +
           B[m].weight[2][c] * (batch.x[first + 4] - batch.x[first]);
  }
  LaneDensity w;
  differentiate_measure(measure, J, w);
  add_coverage(J, kappa, w);
  const LaneVector<12> da = area_gradient(batch);
  LaneVector<12> dw;
  Lanes half[12][8];  // the Hessian of w with its rows in x, its columns in J, times a
  for (int i = 0; i < 12; ++i) {
    const int m = i / 6, first = 4 * m + i % 2;
    const Lanes(&b)[2] = B[m].weight[i % 6 / 2];
    dw[i] = b[0] * w.gradient[first] + b[1] * w.gradient[first + 2];
    const Lanes b0 = batch.area * b[0], b1 = batch.area * b[1];
    for (int k = 0; k < 4 + 4 * m; ++k)
      half[i][k] = b0 * w.hessian.symmetric(first, k) + b1 * w.hessian.symmetric(first + 2, k);
  }
  batch.value = batch.area * w.value;
  set_area_hessian(batch, w.value, batch.hessian);
  for (int i = 0; i < 12; ++i) {
    batch.gradient[i] = batch.area * dw[i] + w.value * da[i];
    for (int j = 0; j <= i; ++j) {
      const int n = j / 6, first = 4 * n + j % 2;
      const Lanes(&b)[2] = B[n].weight[j % 6 / 2];
      batch.hessian(i, j) +=
          b[0] * half[i][first] + b[1] * half[i][first + 2] + dw[i] * da[j] + da[i] * dw[j];
    }
  }
}

}  // namespace detail
}  // namespace ism

// ==== [9] SPARSE LDLT (George 1973; Duff and Reid 1983) ==========================================
//
// Purpose:    factorises H + ω Lᵀ M L, symmetric with one 2×2 block per pair of vertices, by
//             nested dissection of the vertices' positions and the multifrontal method.
// Invariants: block (r, c), r ≤ c, of the pattern couples vertices r and c; diagonal blocks are
//             present and come first in their row. The same bits for any number of threads.
// Fails:      a zero or non-finite pivot ends the factorisation; negative pivots are counted, and
//             mean that the matrix is not positive definite.

namespace ism {
namespace detail {

/// Upper triangle of a symmetric matrix of 2×2 blocks; columns ascend within a row.
struct BlockPattern {
  Array<int> start;  // #rows + 1
  Array<int> column;
  int rows() const { return start.size() - 1; }
  int blocks() const { return column.size(); }
};

/// One 2×2 block per entry of a pattern.
using BlockValues = Array<Eigen::Matrix2d>;

/// A front of the elimination tree: the vertices eliminated together, and the later vertices their
/// elimination touches. Vertices are meant by their place in the elimination order.
struct Front {
  int begin = 0, end = 0;  // own vertices
  Array<int> rows;         // later vertices, ascending
  Array<int> parent_row;   // for every row, its place in the parent's front, own vertices first
  std::int64_t panel = 0;  // where its part of LdltFactor::panels starts
  int parent = -1;
  int depth = 0;
  Array<int> children;
  struct OwnBlock {
    int block;        // of the pattern
    int row, column;  // local place of the block in the front's lower triangle
    bool transposed;
  };
  Array<OwnBlock> blocks;
  int own() const { return end - begin; }
  int size() const { return own() + rows.size(); }
};

/// The elimination order and the fronts; depends on the pattern and the positions only.
struct LdltSymbolic {
  Array<int> order;     // order[i] is the vertex eliminated as the i-th
  Array<int> place;     // its inverse
  Array<Front> fronts;  // children before parents
  std::int64_t panels_size = 0;
  /// Groups of fronts, children before parents. Those of a stage can be eliminated side by side:
  /// first whole subtrees below a fixed depth, then the fronts above it, level by level.
  Array<Array<Array<int>>> stages;
};

/// A line or circle with a fraction of some points below it, or inside.
struct PlanarCut {
  bool is_circle = false;
  Vec2 vector = Vec2::Zero();  // center of the circle, or normal of the line
  double fraction = 0.5;
  double key(const Vec2& p) const { return is_circle ? (p - vector).squaredNorm() : vector.dot(p); }
};

/// Finds the line or circle that cuts a set of coupled points in two parts with the fewest
/// couplings between them [Miller, Teng, Thurston and Vavasis 1997]. A circle around a limb, which
/// an embedding crowds into a spot, beats all lines. Some couplings of every point stand for all,
/// and single precision is enough to count them.
class CutFinder {
 public:
  static constexpr int kCouplings = 8;

  explicit CutFinder(int n) : n_(n), x_(n, kCouplings + 1), y_(n, kCouplings + 1) {}

  /// The k-th point that point i is coupled to; the 0-th is itself.
  void set(int i, int k, const Vec2& p) {
    x_(i, k) = static_cast<float>(p.x());
    y_(i, k) = static_cast<float>(p.y());
  }

  PlanarCut best() {
    constexpr int kSmall = 1000;  // points; of the fill, sets of this size make little
    const int lines = n_ < kSmall ? 2 : 8, circles = n_ < kSmall ? 2 : 16;
    PlanarCut best;
    double least = kInfinity;
    for (int i = 0; i < lines + circles; ++i) {
      PlanarCut cut;
      cut.is_circle = i >= lines;
      if (cut.is_circle) {
        const int center = static_cast<int>(std::int64_t{n_} * (i - lines) / circles);
        cut.vector = Vec2(x_(center, 0), y_(center, 0));
      } else {
        cut.vector = Vec2(std::cos(kPi * i / lines), std::sin(kPi * i / lines));
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

  /// The keys of the points, and the least and largest key of each and what it is coupled to.
  void measure(const PlanarCut& cut) {
    constexpr int kSamples = 64;
    const Eigen::Vector2f v = cut.vector.cast<float>();
    lo_.setConstant(n_, std::numeric_limits<float>::infinity());
    hi_ = -lo_;
    for (int k = kCouplings; k >= 0; --k) {  // the points themselves come last
      if (cut.is_circle)
        key_ = (x_.col(k) - v.x()).square() + (y_.col(k) - v.y()).square();
      else
        key_ = v.x() * x_.col(k) + v.y() * y_.col(k);
      lo_ = lo_.min(key_);
      hi_ = hi_.max(key_);
    }
    sample_.clear();
    for (int i = 0; i < n_; i += 1 + n_ / kSamples) sample_.push_back(key_[i]);
    std::sort(sample_.begin(), sample_.end());
  }

  /// Points of the side with fewer of them that are coupled to the other side; more if one side is
  /// larger.
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
  Eigen::ArrayXf key_, lo_, hi_;
  Array<float> sample_;  // of the keys, ascending
};

/// Builds an LdltSymbolic by nested dissection: a cut divides a set of vertices; of the side that
/// has fewer of them, the vertices coupled to the other side separate the rest; the separator is
/// thinned, its vertices are eliminated last, and both sides are divided again. Sets of one level
/// are not coupled, so they are divided side by side.
class NestedDissection {
 public:
  NestedDissection(const BlockPattern& pattern, const Points2& positions, const Executor& executor)
      : pattern_(pattern), positions_(positions), executor_(executor) {}

  LdltSymbolic build() {
    const int n = pattern_.rows();
    build_adjacency();
    result_.order.resize(n);
    std::iota(result_.order.begin(), result_.order.end(), 0);
    dissect();
    result_.place.resize(n);
    for (int i = 0; i < n; ++i) result_.place[result_.order[i]] = i;
    add_front(0);
    schedule();
    for (const Array<Array<int>>& stage : result_.stages)
      executor_.run(stage.size(), [&](int group) { fill_fronts(stage[group]); });
    for (Front& front : result_.fronts) {
      front.panel = result_.panels_size;
      result_.panels_size += 4 * std::int64_t{front.size()} * front.own();
    }
    return std::move(result_);
  }

 private:
  static constexpr int kLargestLeaf = 12;       // smaller leaves cost more in bookkeeping
  static constexpr double kLargestPart = 0.65;  // of a set that one side may have

  enum Part : std::uint8_t { kLeft, kRight, kSeparator, kOutside };

  struct Neighbour {
    int vertex;
    int block;
    bool transposed;  // the block is stored as (neighbour, vertex)
  };

  /// The vertices order[begin, end). Once divided, those of the left side come first, then those of
  /// the right side, then the separator.
  struct Set {
    int begin, end, depth;
    int left_end = 0, right_end = 0;
    int child = -1;  // its left side in sets_; the right side is the next
    int size() const { return end - begin; }
  };

  void build_adjacency() {
    const int n = pattern_.rows();
    start_.assign(n + 1, 0);
    const auto for_each_block = [&](const auto& visit) {
      for (int r = 0; r < n; ++r)
        for (int b = pattern_.start[r]; b < pattern_.start[r + 1]; ++b)
          visit(r, pattern_.column[b], b);
    };
    for_each_block([&](int r, int c, int) {
      ++start_[r + 1];
      if (c != r) ++start_[c + 1];
    });
    for (int i = 0; i < n; ++i) start_[i + 1] += start_[i];
    Array<int> fill(n, 0);
    neighbour_.resize(start_[n]);
    for_each_block([&](int r, int c, int b) {
      neighbour_[start_[r] + fill[r]++] = {c, b, false};
      if (c != r) neighbour_[start_[c] + fill[c]++] = {r, b, true};
    });
  }

  template <class Visit>
  void for_each_neighbour(int v, const Visit& visit) const {
    for (int k = start_[v]; k < start_[v + 1]; ++k) visit(neighbour_[k].vertex);
  }

  void dissect() {
    part_.assign(pattern_.rows(), kOutside);
    for (Array<int>& count : coupled_) count.assign(pattern_.rows(), 0);
    moved_.assign(pattern_.rows(), 0);
    sets_.push_back({0, pattern_.rows(), 0});
    for (int first = 0, last = 1; first < last; first = last, last = sets_.size()) {
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

  void split(Set& set) {
    if (set.size() <= kLargestLeaf) return;
    divide(set);
    separate(set);
    thin(set);
    const auto move_to_front = [&](int from, Part part) {
      int* last =
          std::stable_partition(at(from), at(set.end), [&](int v) { return part_[v] == part; });
      return static_cast<int>(last - at(0));
    };
    set.left_end = move_to_front(set.begin, kLeft);
    set.right_end = move_to_front(set.left_end, kRight);
    for (int i = set.begin; i < set.end; ++i) part_[*at(i)] = kOutside;
  }

  int* at(int i) { return result_.order.data() + i; }

  /// Puts every vertex of a set on one of two sides.
  void divide(const Set& set) {
    const int n = set.size();
    const Vec2 origin = row2(positions_, *at(set.begin));
    double extent = 0;
    for (int i = set.begin; i < set.end; ++i) {
      part_[*at(i)] = kLeft;  // for now: it is in the set
      extent = (std::max)(extent, (row2(positions_, *at(i)) - origin).cwiseAbs().maxCoeff());
    }
    const double unit = extent > 0 ? 1 / extent : 1;
    const auto point = [&](int v) { return Vec2(unit * (row2(positions_, v) - origin)); };
    CutFinder cuts(n);
    for (int i = 0; i < n; ++i) {
      const int v = *at(set.begin + i);
      for (int k = 0; k <= CutFinder::kCouplings; ++k) {
        const int u = k == 0 ? v : spread_neighbour(v, k - 1);
        cuts.set(i, k, point(part_[u] == kLeft ? u : v));
      }
    }
    const PlanarCut cut = cuts.best();
    Array<std::pair<double, int>> key(n);
    for (int i = 0; i < n; ++i) key[i] = {cut.key(point(*at(set.begin + i))), *at(set.begin + i)};
    const int left = (std::max)(1, static_cast<int>(cut.fraction * n));
    std::nth_element(key.begin(), key.begin() + left, key.end());
    for (int i = left; i < n; ++i) part_[key[i].second] = kRight;
  }

  /// One of kCouplings neighbours evenly spread over the list of v.
  int spread_neighbour(int v, int k) const {
    const int degree = start_[v + 1] - start_[v];
    return neighbour_[start_[v] + (2 * k + 1) * degree / (2 * CutFinder::kCouplings)].vertex;
  }

  bool is_coupled_to(int v, Part part) const {
    for (int k = start_[v]; k < start_[v + 1]; ++k)
      if (part_[neighbour_[k].vertex] == part) return true;
    return false;
  }

  /// Makes the vertices of one side that are coupled to the other one the separator.
  void separate(const Set& set) {
    std::array<Array<int>, 2> rim;
    for (int i = set.begin; i < set.end; ++i) {
      const Part own = part_[*at(i)];
      if (is_coupled_to(*at(i), other_side(own))) rim[own].push_back(*at(i));
    }
    for (int v : rim[0].size() <= rim[1].size() ? rim[0] : rim[1]) part_[v] = kSeparator;
  }

  // -- thinning of a separator [Fiduccia and Mattheyses 1982] --

  /// A vertex of the separator goes to one side; those of the other side it is coupled to come in.
  struct Move {
    int gain;  // by which the separator shrinks
    int vertex;
    Part to;
    bool operator<(const Move& o) const {
      return std::tie(gain, vertex, to) < std::tie(o.gain, o.vertex, o.to);
    }
  };
  using Moves = std::priority_queue<Move>;

  /// Makes the best moves one after the other, also such that do not pay at once, and takes back
  /// those after the smallest separator. No vertex moves twice.
  void thin(const Set& set) {
    constexpr int kPatience = 30;  // moves without success
    const int largest = static_cast<int>(kLargestPart * set.size());
    std::array<int, 3> size{};
    Moves moves;
    for (int i = set.begin; i < set.end; ++i) {
      moved_[*at(i)] = 0;
      ++size[part_[*at(i)]];
    }
    for (int i = set.begin; i < set.end; ++i)
      if (part_[*at(i)] == kSeparator) enter_separator(*at(i), moves);
    Array<Move> made;
    Array<int> pulled, pulled_end;
    int best = 0, least = size[kSeparator];
    while (!moves.empty() && made.size() - best < kPatience) {
      const Move move = moves.top();
      moves.pop();
      const Part from = other_side(move.to);
      if (part_[move.vertex] != kSeparator || moved_[move.vertex]) continue;
      if (move.gain != 1 - coupled_[from][move.vertex] || size[move.to] >= largest) continue;
      moved_[move.vertex] = 1;
      made.push_back(move);
      leave_separator(move.vertex, move.to, pulled, moves);
      pulled_end.push_back(pulled.size());
      size[kSeparator] -= move.gain;
      size[move.to] += 1;
      size[from] -= 1 - move.gain;
      if (size[kSeparator] >= least) continue;
      least = size[kSeparator];
      best = made.size();
    }
    for (; made.size() > best; made.pop_back()) {
      pulled_end.pop_back();
      for (; pulled.size() > (pulled_end.empty() ? 0 : pulled_end.back()); pulled.pop_back())
        part_[pulled.back()] = other_side(made.back().to);
      part_[made.back().vertex] = kSeparator;
    }
  }

  static Part other_side(Part side) { return side == kLeft ? kRight : kLeft; }

  void offer(int v, Part to, Moves& moves) const {
    constexpr int kLeastGain = -1;
    const int gain = 1 - coupled_[other_side(to)][v];
    if (!moved_[v] && gain >= kLeastGain) moves.push({gain, v, to});
  }

  void enter_separator(int v, Moves& moves) {
    coupled_[kLeft][v] = coupled_[kRight][v] = 0;
    for_each_neighbour(v, [&](int u) {
      if (part_[u] <= kRight) ++coupled_[part_[u]][v];
    });
    offer(v, kLeft, moves);
    offer(v, kRight, moves);
  }

  void leave_separator(int v, Part to, Array<int>& pulled, Moves& moves) {
    const Part from = other_side(to);
    const int begin = pulled.size();
    part_[v] = to;
    for_each_neighbour(v, [&](int u) {
      if (part_[u] == kSeparator) ++coupled_[to][u], offer(u, from, moves);
      if (part_[u] == from) part_[u] = kSeparator, pulled.push_back(u);
    });
    for (int i = begin; i < pulled.size(); ++i)
      for_each_neighbour(pulled[i], [&](int u) {
        if (part_[u] == kSeparator) --coupled_[from][u], offer(u, to, moves);
      });
    for (int i = begin; i < pulled.size(); ++i) enter_separator(pulled[i], moves);
  }

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
    const int id = result_.fronts.size();
    for (int child : front.children) result_.fronts[child].parent = id;
    result_.fronts.push_back(std::move(front));
    return id;
  }

  void schedule() {
    constexpr int kSubtreeDepth = 5;
    const Array<Front>& fronts = result_.fronts;
    result_.stages.resize(kSubtreeDepth + 1);
    Array<int> place(fronts.size(), -1);               // of the group in its stage
    for (int id = fronts.size() - 1; id >= 0; --id) {  // parents before children
      const Front& front = fronts[id];
      Array<Array<int>>& stage =
          result_.stages[kSubtreeDepth - (std::min)(front.depth, kSubtreeDepth)];
      if (front.depth > kSubtreeDepth) {
        place[id] = place[front.parent];
      } else {
        place[id] = stage.size();
        stage.push_back({});
      }
      stage[place[id]].push_back(id);
    }
    for (Array<Array<int>>& stage : result_.stages)
      for (Array<int>& ids : stage) std::reverse(ids.begin(), ids.end());
  }

  /// Finds the rows and the entries of a group of fronts.
  void fill_fronts(const Array<int>& ids) {
    Array<int> local(pattern_.rows(), -1);  // of a vertex of the front, its place in it
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
    for (int i = front.begin; i < front.end; ++i) {
      const int v = result_.order[i];
      for (int e = start_[v]; e < start_[v + 1]; ++e) add(result_.place[neighbour_[e].vertex]);
    }
    for (int child : front.children)
      for (int i : result_.fronts[child].rows) add(i);
    std::sort(front.rows.begin(), front.rows.end());
    for (int i = front.begin; i < front.end; ++i) local[i] = i - front.begin;
    for (int r = 0; r < front.rows.size(); ++r) local[front.rows[r]] = front.own() + r;
  }

  void place_entries(Front& front, const Array<int>& local) {
    for (int i = front.begin; i < front.end; ++i) {
      const int v = result_.order[i];
      for (int e = start_[v]; e < start_[v + 1]; ++e) {
        const int j = result_.place[neighbour_[e].vertex];
        if (j < i) continue;
        // The front holds block (j, i); the pattern has it as (v, neighbour) unless transposed.
        front.blocks.push_back(
            {neighbour_[e].block, local[j], local[i], !neighbour_[e].transposed});
      }
    }
    for (int child : front.children) {
      Front& c = result_.fronts[child];
      c.parent_row.resize(c.rows.size());
      for (int r = 0; r < c.rows.size(); ++r) c.parent_row[r] = local[c.rows[r]];
    }
  }

  const BlockPattern& pattern_;
  const Points2& positions_;
  const Executor& executor_;
  LdltSymbolic result_;
  Array<int> start_;
  Array<Neighbour> neighbour_;
  Array<Set> sets_;  // level by level
  Array<Part> part_;
  std::array<Array<int>, 2> coupled_;  // of a vertex of the separator, how many on either side
  Array<char> moved_;
};

/// Memory that comes and goes. Which piece a task gets depends on the others, what it computes does
/// not. The lock is held for a few instructions, and works where there is no <mutex>.
class MemoryPool {
 public:
  /// For n numbers or more: the smallest piece that is enough, or in place of the largest one.
  Eigen::VectorXd take(Eigen::Index n) {
    Eigen::VectorXd memory;
    lock();
    if (!pieces_.empty()) {
      int best = 0;
      for (int i = 1; i < pieces_.size(); ++i)
        if (is_better(pieces_[i].size(), pieces_[best].size(), n)) best = i;
      std::swap(pieces_[best], pieces_.back());
      memory = std::move(pieces_.back());
      pieces_.pop_back();
    }
    unlock();
    if (memory.size() < n) memory.resize(n);
    return memory;
  }

  void give(Eigen::VectorXd memory) {
    if (memory.size() == 0) return;
    lock();
    pieces_.push_back(std::move(memory));
    unlock();
  }

 private:
  static bool is_better(Eigen::Index size, Eigen::Index than, Eigen::Index n) {
    if (size >= n && than >= n) return size < than;
    return size > than;
  }

  void lock() {
    while (locked_.test_and_set(std::memory_order_acquire)) {
    }
  }
  void unlock() { locked_.clear(std::memory_order_release); }

  std::atomic_flag locked_ = ATOMIC_FLAG_INIT;
  Array<Eigen::VectorXd> pieces_;
};

/// The numeric factor. A panel holds, of one front, L with D on the diagonal of its top block. Its
/// memory serves again for the next factorisation.
struct LdltFactor {
  Eigen::VectorXd panels;         // one behind the other
  Array<Eigen::VectorXd> update;  // per front, until the parent has taken it
  MemoryPool spare;               // for update matrices
  Array<int> negative_pivots;     // per front
  Array<char> broken;             // per front
  bool ok = false;                // no zero or non-finite pivot
  int negative = 0;               // number of negative pivots
};

/// The panel of a front, 2 size × 2 own.
template <class Values>
auto panel_of(const Front& front, Values& panels) {
  using Matrix =
      std::conditional_t<std::is_const<Values>::value, const Eigen::MatrixXd, Eigen::MatrixXd>;
  return Eigen::Map<Matrix>(panels.data() + front.panel, 2 * front.size(), 2 * front.own());
}

using DenseRef = Eigen::Ref<Eigen::MatrixXd>;

/// Dense LDLT without pivoting of the top square of A, applied to the rows below, column by column.
inline bool factor_narrow(DenseRef A, int& negative) {
  const auto k = A.cols(), below = A.rows() - k;
  auto D = A.topRows(k);
  for (Eigen::Index j = 0; j < k; ++j) {
    const double pivot = D(j, j);
    if (pivot == 0 || !std::isfinite(pivot)) return false;
    if (pivot < 0) ++negative;
    const auto rest = k - j - 1;
    auto l = D.col(j).tail(rest);
    for (Eigen::Index c = 0; c < rest; ++c)
      D.col(j + 1 + c).tail(rest - c) -= (l(c) / pivot) * l.tail(rest - c);
    l /= pivot;
  }
  if (below == 0) return true;
  auto X = A.bottomRows(below);
  D.triangularView<Eigen::UnitLower>().transpose().solveInPlace<Eigen::OnTheRight>(X);
  for (Eigen::Index j = 0; j < k; ++j) X.col(j) /= D(j, j);
  return true;
}

/// The same of any width: the left half, what it takes from the right half, the right half.
inline bool factor_panel(DenseRef A, int& negative) {
  constexpr int kNarrow = 32;
  const auto k = A.cols(), n = A.rows(), left = k / 2, right = k - left;
  if (k <= kNarrow) return factor_narrow(A, negative);
  if (!factor_panel(A.leftCols(left), negative)) return false;
  const auto L = A.block(left, 0, right, left);
  const Eigen::MatrixXd W = A.topLeftCorner(left, left).diagonal().asDiagonal() * L.transpose();
  A.block(left, left, right, right).triangularView<Eigen::Lower>() -= L * W;
  A.block(k, left, n - k, right).noalias() -= A.block(k, 0, n - k, left) * W;
  return factor_panel(A.bottomRightCorner(n - left, right), negative);
}

/// update = -L₂ D L₂ᵀ, lower triangle. Chunks of columns of L₂ keep what Eigen packs of them small.
inline void set_schur(const Eigen::Ref<const Eigen::MatrixXd>& panel, DenseRef update) {
  constexpr Eigen::Index kChunk = 96;
  const auto n = update.rows();
  update.setZero();
  for (Eigen::Index j = 0; n > 0 && j < panel.cols(); j += kChunk) {
    const auto width = (std::min)(kChunk, panel.cols() - j);
    const auto L2 = panel.block(panel.cols(), j, n, width);
    const Eigen::MatrixXd W =
        panel.block(j, j, width, width).diagonal().asDiagonal() * L2.transpose();
    update.triangularView<Eigen::Lower>() -= L2 * W;
  }
}

/// The update matrix of a front, 2 rows × 2 rows, of which the lower triangle counts.
inline Eigen::Map<Eigen::MatrixXd> update_of(const Front& front, Eigen::VectorXd& memory) {
  return Eigen::Map<Eigen::MatrixXd>(memory.data(), 2 * front.rows.size(), 2 * front.rows.size());
}

/// Adds those columns of a child's update matrix that are, or are not, the parent's own.
template <class Target>
void extend_add(const Front& child, const Eigen::Ref<const Eigen::MatrixXd>& from, int own,
                bool into_own, Target& target) {
  const int n = child.rows.size(), shift = into_own ? 0 : own;
  for (int c = 0; c < n; ++c) {
    if ((child.parent_row[c] < own) != into_own) continue;
    for (int half = 0; half < 2; ++half) {
      const auto source = from.col(2 * c + half);
      auto sum = target.col(2 * (child.parent_row[c] - shift) + half);
      for (int i = half; i < 2; ++i)
        sum[2 * (child.parent_row[c] - shift) + i] += source[2 * c + i];
      for (int r = c + 1; r < n; ++r)
        sum.template segment<2>(2 * (child.parent_row[r] - shift)) +=
            source.template segment<2>(2 * r);
    }
  }
}

/// One matrix of a family H + ω Q on a common pattern.
struct ShiftedMatrix {
  const BlockValues* H = nullptr;
  const BlockValues* Q = nullptr;  // may be null
  double omega = 0;
  Eigen::Matrix2d block(int b) const {
    if (!Q) return (*H)[b];
    return (*H)[b] + omega * (*Q)[b];
  }
};

/// Assembles and eliminates one front whose children are done.
inline void eliminate_front(const LdltSymbolic& symbolic, int id, const ShiftedMatrix& matrix,
                            LdltFactor& factor) {
  const Front& front = symbolic.fronts[id];
  auto panel = panel_of(front, factor.panels);
  panel.setZero();
  for (const Front::OwnBlock& e : front.blocks) {
    const Eigen::Matrix2d block = matrix.block(e.block);
    auto target = panel.block<2, 2>(2 * e.row, 2 * e.column);
    if (e.transposed)
      target += block.transpose();
    else
      target += block;
  }
  const auto add_children = [&](bool into_own, auto& target) {
    for (int id_child : front.children) {
      const Front& child = symbolic.fronts[id_child];
      extend_add(child, update_of(child, factor.update[id_child]), front.own(), into_own, target);
    }
  };
  add_children(true, panel);
  factor.broken[id] = !factor_panel(panel, factor.negative_pivots[id]);
  const auto n = 2 * Eigen::Index{front.rows.size()};
  if (n > 0) factor.update[id] = factor.spare.take(n * n);
  auto update = update_of(front, factor.update[id]);
  set_schur(panel, update);
  add_children(false, update);
  for (int child : front.children) factor.spare.give(std::move(factor.update[child]));
}

inline void ldlt_factorize(const LdltSymbolic& symbolic, const ShiftedMatrix& matrix,
                           const Executor& executor, LdltFactor& factor) {
  const int n = symbolic.fronts.size();
  if (factor.panels.size() < symbolic.panels_size) factor.panels.resize(symbolic.panels_size);
  factor.update.assign(n, Eigen::VectorXd());
  factor.negative_pivots.assign(n, 0);
  factor.broken.assign(n, 0);
  for (const Array<Array<int>>& stage : symbolic.stages)
    executor.run(stage.size(), [&](int group) {
      for (int id : stage[group]) eliminate_front(symbolic, id, matrix, factor);
    });
  factor.ok = std::find(factor.broken.begin(), factor.broken.end(), 1) == factor.broken.end();
  factor.negative =
      std::accumulate(factor.negative_pivots.begin(), factor.negative_pivots.end(), 0);
}

/// Solves with a factor; b holds two entries per vertex.
inline Eigen::VectorXd ldlt_solve(const LdltSymbolic& symbolic, const LdltFactor& factor,
                                  const Eigen::VectorXd& b) {
  const int n = symbolic.order.size(), n_fronts = symbolic.fronts.size();
  Eigen::VectorXd y(2 * n), rest, x(2 * n);
  for (int i = 0; i < n; ++i) y.segment<2>(2 * i) = b.segment<2>(2 * symbolic.order[i]);
  for (int id = 0; id < n_fronts; ++id) {  // L y = b, then D
    const Front& front = symbolic.fronts[id];
    if (front.own() == 0) continue;
    const auto P = panel_of(front, factor.panels);
    auto own = y.segment(2 * front.begin, 2 * front.own());
    P.topRows(P.cols()).triangularView<Eigen::UnitLower>().solveInPlace(own);
    rest.noalias() = P.bottomRows(2 * front.rows.size()) * own;
    for (int r = 0; r < front.rows.size(); ++r)
      y.segment<2>(2 * front.rows[r]) -= rest.segment<2>(2 * r);
  }
  for (int id = n_fronts - 1; id >= 0; --id) {  // D Lᵀ x = y
    const Front& front = symbolic.fronts[id];
    if (front.own() == 0) continue;
    const auto P = panel_of(front, factor.panels);
    auto own = y.segment(2 * front.begin, 2 * front.own());
    own.array() /= P.topRows(P.cols()).diagonal().array();
    rest.resize(2 * front.rows.size());
    for (int r = 0; r < front.rows.size(); ++r)
      rest.segment<2>(2 * r) = y.segment<2>(2 * front.rows[r]);
    own.noalias() -= P.bottomRows(2 * front.rows.size()).transpose() * rest;
    P.topRows(P.cols()).triangularView<Eigen::UnitLower>().transpose().solveInPlace(own);
  }
  for (int i = 0; i < n; ++i) x.segment<2>(2 * symbolic.order[i]) = y.segment<2>(2 * i);
  return x;
}

/// y += A x, of which the upper triangle is stored.
inline void add_product(const BlockPattern& pattern, const ShiftedMatrix& A,
                        const Eigen::VectorXd& x, Eigen::VectorXd& y) {
  for (int r = 0; r < pattern.rows(); ++r)
    for (int b = pattern.start[r]; b < pattern.start[r + 1]; ++b) {
      const int c = pattern.column[b];
      const Eigen::Matrix2d block = A.block(b);
      y.segment<2>(2 * r) += block * x.segment<2>(2 * c);
      if (r != c) y.segment<2>(2 * c) += block.transpose() * x.segment<2>(2 * r);
    }
}

/// Solves A x = b by conjugate gradients with the factor of a matrix close to A as preconditioner,
/// both positive definite [Hestenes and Stiefel 1952]. Where the eigenvalues of the one in terms of
/// the other lie in [1, α], the error falls by (√α - 1) / (√α + 1) in every step. Ends when √(rᵀz)
/// has fallen to a tolerance of its first value, z the preconditioned r, or after 50 steps.
inline Eigen::VectorXd solve_with_neighbour(const LdltSymbolic& symbolic, const LdltFactor& factor,
                                            const BlockPattern& pattern, const ShiftedMatrix& A,
                                            const Eigen::VectorXd& b, double tolerance) {
  constexpr int kMostSteps = 50;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(b.size()), r = b, p, Ap;
  double before = 0, first = 0;
  for (int k = 0; k < kMostSteps; ++k) {
    const Eigen::VectorXd z = ldlt_solve(symbolic, factor, r);
    const double now = r.dot(z);
    if (k == 0) first = now;
    if (!(now > tolerance * tolerance * first)) break;
    p = k == 0 ? z : Eigen::VectorXd(z + (now / before) * p);
    Ap.setZero(b.size());
    add_product(pattern, A, p, Ap);
    const double curvature = p.dot(Ap);
    if (!(curvature > 0)) break;
    x += (now / curvature) * p;
    r -= (now / curvature) * Ap;
    before = now;
  }
  return x;
}

}  // namespace detail
}  // namespace ism

// ==== [10] OBJECTIVE AND ITS QUADRATIC MODEL (paper §4.1-4.4, §5.1, §5.3, §5.4) ==================
//
// Purpose:    E(x) of Eq. 4 and §5 at one iterate; its gradient and projected Hessian, assembled
//             without triplets; their blend with earlier ones; the squared Laplacian.
// Invariants: vertex i of A is row i, vertex i of B is row #V_A + i. Couplings within a mesh have a
//             fixed pattern, couplings between the meshes follow the polygons. Sums run in the
//             order of polygons and faces, never of threads.
// Fails:      never on injective embeddings.

namespace ism {
namespace detail {

/// The two meshes of a problem.
struct SurfacePair {
  Surface a, b;
  int n_a() const { return a.mesh.n_vertices; }
  int n_b() const { return b.mesh.n_vertices; }
  int rows() const { return n_a() + n_b(); }
  double total_area() const { return a.total_area + b.total_area; }
};

/// The parts of the objective that Options weigh.
struct Weights {
  double kappa;    // κ
  double barrier;  // ω_R
  double epsilon;  // ε
  const DistortionMeasure* measure;
};

// ---- value ----

/// One iterate with everything that is known about it.
struct Iterate {
  Points2 f, g;
  Overlay overlay;
  Array<Eigen::Matrix2d> jacobian_f, jacobian_g;  // per triangle
  double map_energy = 0;                          // E_Φ
  double area_a = 0, area_b = 0;                  // area A', area B'
  double energy_f = 0, energy_g = 0;
  double energy = kInfinity;  // E
};

inline Eigen::Matrix2d triangle_jacobian(const Surface& s, const Points2& x, int f) {
  return jacobian(row2(x, s.mesh.corner(f, 0)), row2(x, s.mesh.corner(f, 1)),
                  row2(x, s.mesh.corner(f, 2)), s.rest_inverse[f]);
}

/// Jacobians of all triangles and the sum of their symmetric Dirichlet energies.
inline double embedding_energy(const Surface& s, const Points2& x, Array<Eigen::Matrix2d>& J) {
  J.resize(s.mesh.n_faces);
  double energy = 0;
  for (int f = 0; f < s.mesh.n_faces; ++f) {
    J[f] = triangle_jacobian(s, x, f);
    energy += triangle_energy(J[f], s.area[f]);
  }
  return energy;
}

/// Columns a0 a1 a2 b0 b1 b2 of a polygon's two triangles.
inline SixPoints six_points(const HalfEdgeMesh& a, const Points2& f, const HalfEdgeMesh& b,
                            const Points2& g, const OverlayPolygon& p) {
  SixPoints points;
  for (int k = 0; k < 3; ++k) {
    points.col(k) = row2(f, a.corner(p.ta, k));
    points.col(3 + k) = row2(g, b.corner(p.tb, k));
  }
  return points;
}

inline SixPoints six_points(const SurfacePair& pair, const Iterate& x, const OverlayPolygon& p) {
  return six_points(pair.a.mesh, x.f, pair.b.mesh, x.g, p);
}

/// E_Φ and the covered areas over the polygons of x.overlay; false, and a part of them only, if E_Φ
/// exceeds `most`.
inline bool add_map_energy(const SurfacePair& pair, const DistortionMeasure& measure, double most,
                           Iterate& x) {
  for (const OverlayPolygon& p : x.overlay.polygons) {
    const SixPoints points = six_points(pair, x, p);
    const double area = polygon_area(polygon_shape(p, points), points);
    if (is_negligible(area, points)) continue;
    const Eigen::Matrix2d &F = x.jacobian_f[p.ta], &G = x.jacobian_g[p.tb];
    x.map_energy += area * measure.value(F, G);
    x.area_a += area / F.determinant();
    x.area_b += area / G.determinant();
    if (x.map_energy > most) return false;
  }
  return true;
}

/// E at the positions x.f, x.g (§5); the overlay is computed anew. Gives up, with an infinite E, as
/// soon as it is sure to exceed `limit`: no more than all area can be covered.
inline void evaluate(const SurfacePair& pair, const Weights& weights, Iterate& x,
                     double limit = kInfinity) {
  x.energy = kInfinity;
  x.map_energy = x.area_a = x.area_b = 0;
  x.energy_f = embedding_energy(pair.a, x.f, x.jacobian_f);
  x.energy_g = embedding_energy(pair.b, x.g, x.jacobian_g);
  const double embeddings = weights.barrier * (x.energy_f + x.energy_g);
  const double most = limit - embeddings + weights.kappa * pair.total_area();
  if (most < 0) return;
  compute_overlay(pair.a.mesh, x.f, pair.b.mesh, x.g, x.overlay);
  if (!add_map_energy(pair, *weights.measure, most, x)) return;
  x.energy = x.map_energy - weights.kappa * (x.area_a + x.area_b) + embeddings;
}

// ---- patterns ----

/// Rows of A per task where every task has an array as long as B: a bounded number of tasks.
inline int rows_per_task(int rows, int least) {
  constexpr int kMostTasks = 256;
  return (std::max)(least, (rows + kMostTasks - 1) / kMostTasks);
}

/// The vertices within one or two edges of u in one mesh, u included, ids ≥ u, ascending.
inline void ring_columns(const HalfEdgeMesh& m, int u, int rings, Array<int>& mark,
                         Array<int>& columns) {
  columns.clear();
  const auto add = [&](int v) {
    if (mark[v] == u) return;
    mark[v] = u;
    columns.push_back(v);
  };
  add(u);
  for (int ring = 0, begin = 0; ring < rings; ++ring) {
    const int end = columns.size();
    for (; begin < end; ++begin) {
      m.for_each_outgoing(columns[begin], [&](int h) {
        add(m.tip(h));
        add(m.tail[prev(h)]);
      });
    }
  }
  columns.resize(static_cast<int>(
      std::remove_if(columns.begin(), columns.end(), [u](int v) { return v < u; }) -
      columns.begin()));
  std::sort(columns.begin(), columns.end());
}

/// Upper pattern of the couplings within each surface up to a number of edges apart.
inline BlockPattern within_pattern(const std::vector<const Surface*>& surfaces, int rings) {
  BlockPattern pattern;
  pattern.start.push_back(0);
  Array<int> columns;
  for (const Surface* s : surfaces) {
    const int first = pattern.rows();
    Array<int> mark(s->mesh.n_vertices, -1);
    for (int u = 0; u < s->mesh.n_vertices; ++u) {
      ring_columns(s->mesh, u, rings, mark, columns);
      for (int v : columns) pattern.column.push_back(first + v);
      pattern.start.push_back(pattern.blocks());
    }
  }
  return pattern;
}

/// The block (r, c), r ≤ c, of a pattern; it must be present.
inline int find_block(const BlockPattern& pattern, int r, int c) {
  const int* begin = pattern.column.data() + pattern.start[r];
  const int* end = pattern.column.data() + pattern.start[r + 1];
  return static_cast<int>(std::lower_bound(begin, end, c) - pattern.column.data());
}

// ---- gradient and projected Hessian ----

/// Blocks that couple vertices of A (rows) with vertices of B (columns, ids of B ascending).
struct CouplingBlocks {
  Array<int> start, column;
  BlockValues value;
};

/// Gradient and projected Hessian at one iterate, the memory of §5.3.
struct QuadraticModel {
  Eigen::VectorXd gradient;  // 2 entries per vertex
  BlockValues within;        // on within_pattern(pair, 1)
  CouplingBlocks between;
};

/// What a polygon contributes besides its A-A part.
struct PolygonTerm {
  Mat6 ab = Mat6::Zero(), bb = Mat6::Zero();
  Vec6 gradient_b = Vec6::Zero();
};

/// What a triangle contributes to a system: its own energy and that of its polygons.
struct FaceTerm {
  Mat6 hessian = Mat6::Zero();
  Vec6 gradient = Vec6::Zero();
};

/// Adds the term of face f to a system in which the vertices of its mesh start at row `first`.
inline void scatter(const HalfEdgeMesh& m, int f, int first, const FaceTerm& term,
                    const BlockPattern& pattern, BlockValues& hessian, Eigen::VectorXd& gradient) {
  for (int i = 0; i < 3; ++i) {
    const int u = first + m.corner(f, i);
    gradient.segment<2>(2 * u) += term.gradient.segment<2>(2 * i);
    for (int j = 0; j < 3; ++j) {
      const int v = first + m.corner(f, j);
      if (u <= v) hessian[find_block(pattern, u, v)] += term.hessian.block<2, 2>(2 * i, 2 * j);
    }
  }
}

/// The symmetric Dirichlet energies of triangles begin to end - 1 of an embedding, projected (§4.4,
/// §5.1). J(f) is the Jacobian of one of them.
template <class JacobianOf>
void embedding_terms(const Surface& s, int begin, int end, double epsilon, const JacobianOf& J,
                     Array<FaceTerm>& terms) {
  LaneMatrix<6> H;
  for (; begin < end; begin += kLanes) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const int f = (std::min)(begin + lane, end - 1);
      const TriangleDerivatives d = triangle_derivatives(J(f), s.rest_inverse[f], s.area[f]);
      terms[f].gradient = d.gradient;
      for (int i = 0; i < 6; ++i)
        for (int k = 0; k <= i; ++k) H(i, k)[lane] = d.hessian(i, k);
    }
    project_spd<3>(H, epsilon);
    for (int lane = 0; lane < kLanes && begin + lane < end; ++lane)
      for (int i = 0; i < 6; ++i)
        for (int k = 0; k < 6; ++k) terms[begin + lane].hessian(i, k) = H.symmetric(i, k)[lane];
  }
}

/// Polygons grouped by a face: those of face f are item[start[f]] .. item[start[f + 1] - 1].
struct FaceGroups {
  Array<int> start, item;
};

template <class FaceOf>
FaceGroups group_polygons(const Array<OverlayPolygon>& polygons, int n_faces, FaceOf face_of) {
  FaceGroups groups;
  groups.start.assign(n_faces + 1, 0);
  groups.item.resize(polygons.size());
  for (const OverlayPolygon& p : polygons) ++groups.start[face_of(p) + 1];
  for (int f = 0; f < n_faces; ++f) groups.start[f + 1] += groups.start[f];
  Array<int> fill = groups.start;
  for (int i = 0; i < polygons.size(); ++i) groups.item[fill[face_of(polygons[i])]++] = i;
  return groups;
}

/// Computes the QuadraticModel of one iterate (Algorithm 1, lines 4 to 8), element by element.
class ModelBuilder {
 public:
  ModelBuilder(const SurfacePair& pair, const Weights& weights, const BlockPattern& within,
               const Executor& executor)
      : pair_(pair), weights_(weights), within_(within), executor_(executor) {}

  /// Derivatives of all polygons and triangles, projected one by one (§5.1).
  void differentiate(const Iterate& x) {
    const Array<OverlayPolygon>& polygons = x.overlay.polygons;
    by_a_ = group_polygons(polygons, pair_.a.mesh.n_faces,
                           [](const OverlayPolygon& p) { return p.ta; });
    by_b_ = group_polygons(polygons, pair_.b.mesh.n_faces,
                           [](const OverlayPolygon& p) { return p.tb; });
    term_.resize(polygons.size());
    face_a_.resize(pair_.a.mesh.n_faces);
    face_b_.resize(pair_.b.mesh.n_faces);
    executor_.run_blocks(face_a_.size(), kBlock, [&](int begin, int end) {
      differentiate_barrier(pair_.a, x.jacobian_f, begin, end, face_a_);
      differentiate_polygons(x, by_a_.start[begin], by_a_.start[end]);
    });
    executor_.run_blocks(face_b_.size(), kBlock, [&](int begin, int end) {
      differentiate_barrier(pair_.b, x.jacobian_g, begin, end, face_b_);
      for (int f = begin; f < end; ++f) gather_face_b(f);
    });
  }

  /// Sums the element terms of the last differentiate().
  QuadraticModel assemble(const Iterate& x) const {
    QuadraticModel model;
    model.gradient.setZero(2 * pair_.rows());
    model.within.assign(within_.blocks(), Eigen::Matrix2d::Zero());
    for (int f = 0; f < face_a_.size(); ++f)
      scatter(pair_.a.mesh, f, 0, face_a_[f], within_, model.within, model.gradient);
    for (int f = 0; f < face_b_.size(); ++f)
      scatter(pair_.b.mesh, f, pair_.n_a(), face_b_[f], within_, model.within, model.gradient);
    model.between = gather_couplings(x);
    return model;
  }

 private:
  static constexpr int kBlock = 64;  // faces or rows per task

  /// ω_R E_f or ω_R E_g of some faces.
  void differentiate_barrier(const Surface& s, const Array<Eigen::Matrix2d>& J, int begin, int end,
                             Array<FaceTerm>& faces) const {
    embedding_terms(
        s, begin, end, weights_.epsilon, [&](int f) -> const Eigen::Matrix2d& { return J[f]; },
        faces);
    for (int f = begin; f < end; ++f) {
      faces[f].hessian *= weights_.barrier;
      faces[f].gradient *= weights_.barrier;
    }
  }

  /// Polygons begin to end - 1 of those grouped by the faces of A, projected one by one.
  void differentiate_polygons(const Iterate& x, int begin, int end) {
    const auto batch = std::make_unique<PolygonBatch>();
    for (; begin < end; begin += kLanes) {
      for (int lane = 0; lane < kLanes; ++lane) {
        const OverlayPolygon& p = x.overlay.polygons[by_a_.item[(std::min)(begin + lane, end - 1)]];
        load(p, six_points(pair_, x, p), pair_.a.rest_inverse[p.ta], pair_.b.rest_inverse[p.tb],
             lane, *batch);
      }
      detail::differentiate(*weights_.measure, weights_.kappa, *batch);
      project_spd<6>(batch->hessian, weights_.epsilon);
      for (int lane = 0; lane < kLanes && begin + lane < end; ++lane)
        store(x, by_a_.item[begin + lane], lane, *batch);
    }
  }

  void store(const Iterate& x, int id, int lane, const PolygonBatch& batch) {
    PolygonTerm& term = term_[id];
    term = PolygonTerm();
    if (batch.is_negligible[static_cast<std::size_t>(lane)]) return;
    FaceTerm& face = face_a_[x.overlay.polygons[id].ta];
    for (int i = 0; i < 6; ++i) {
      face.gradient[i] += batch.gradient[i][lane];
      term.gradient_b[i] = batch.gradient[6 + i][lane];
      for (int j = 0; j < 6; ++j) {
        face.hessian(i, j) += batch.hessian.symmetric(i, j)[lane];
        term.ab(i, j) = batch.hessian(6 + j, i)[lane];
        term.bb(i, j) = batch.hessian.symmetric(6 + i, 6 + j)[lane];
      }
    }
  }

  void gather_face_b(int f) {
    FaceTerm& face = face_b_[f];
    for (int i = by_b_.start[f]; i < by_b_.start[f + 1]; ++i) {
      const PolygonTerm& term = term_[by_b_.item[i]];
      face.hessian += term.bb;
      face.gradient += term.gradient_b;
    }
  }

  /// Row by row, so that rows are independent: the polygons around a vertex of A.
  CouplingBlocks gather_couplings(const Iterate& x) const {
    const int n = pair_.n_a(), block = rows_per_task(n, kBlock);
    Array<CouplingBlocks> part((n + block - 1) / block);
    executor_.run_blocks(n, block, [&](int begin, int end) {
      Array<int> place(pair_.n_b(), -1);
      for (int u = begin; u < end; ++u) gather_row(x, u, place, part[begin / block]);
    });
    return concatenate(part);
  }

  void gather_row(const Iterate& x, int u, Array<int>& place, CouplingBlocks& rows) const {
    const HalfEdgeMesh &a = pair_.a.mesh, &b = pair_.b.mesh;
    const int begin = rows.column.size();
    const auto for_each_corner = [&](const auto& visit) {
      a.for_each_outgoing(u, [&](int h) {
        for (int i = by_a_.start[h / 3]; i < by_a_.start[h / 3 + 1]; ++i) {
          const int id = by_a_.item[i];
          for (int k = 0; k < 3; ++k) visit(h % 3, id, k, b.corner(x.overlay.polygons[id].tb, k));
        }
      });
    };
    for_each_corner([&](int, int, int, int v) {
      if (place[v] >= begin) return;
      place[v] = rows.column.size();
      rows.column.push_back(v);
    });
    std::sort(rows.column.begin() + begin, rows.column.end());
    for (int i = begin; i < rows.column.size(); ++i) place[rows.column[i]] = i;
    rows.value.resize(rows.column.size());
    for (int i = begin; i < rows.column.size(); ++i) rows.value[i].setZero();
    for_each_corner([&](int corner, int id, int k, int v) {
      rows.value[place[v]] += term_[id].ab.block<2, 2>(2 * corner, 2 * k);
    });
    rows.start.push_back(rows.column.size());  // end of the row; shifted by concatenate()
  }

  static CouplingBlocks concatenate(const Array<CouplingBlocks>& parts) {
    CouplingBlocks all;
    all.start.push_back(0);
    for (const CouplingBlocks& part : parts) {
      const int shift = all.column.size();
      for (int end : part.start) all.start.push_back(shift + end);
      for (int v : part.column) all.column.push_back(v);
      for (const Eigen::Matrix2d& block : part.value) all.value.push_back(block);
    }
    return all;
  }

  const SurfacePair& pair_;
  const Weights& weights_;
  const BlockPattern& within_;
  const Executor& executor_;
  FaceGroups by_a_, by_b_;
  Array<PolygonTerm> term_;
  Array<FaceTerm> face_a_, face_b_;
};

// ---- squared Laplacian (§5.4) ----

/// Cotangent of the angle at p between q and r, kept within ±100: angles below 0.6 degrees say
/// more about the triangulation than about the surface.
inline double cotangent(const Vec3& p, const Vec3& q, const Vec3& r) {
  const Vec3 u = q - p, v = r - p;
  const double sine = u.cross(v).norm();
  return (std::max)(-100.0, (std::min)(100.0, u.dot(v) / (std::max)(sine, 1e-300)));
}

/// Voronoi areas of the vertices, safe for obtuse triangles [Meyer et al. 2003].
inline Array<double> vertex_areas(const Surface& s) {
  Array<double> mass(s.mesh.n_vertices, 0);
  for (int f = 0; f < s.mesh.n_faces; ++f) {
    std::array<Vec3, 3> p;
    std::array<double, 3> cot;
    for (int k = 0; k < 3; ++k)
      p[static_cast<std::size_t>(k)] = s.vertices.row(s.mesh.corner(f, k));
    for (std::size_t k = 0; k < 3; ++k) cot[k] = cotangent(p[k], p[(k + 1) % 3], p[(k + 2) % 3]);
    const bool obtuse = cot[0] < 0 || cot[1] < 0 || cot[2] < 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t i = (k + 1) % 3, j = (k + 2) % 3;
      const double voronoi =
          (cot[i] * (p[k] - p[j]).squaredNorm() + cot[j] * (p[k] - p[i]).squaredNorm()) / 8;
      mass[s.mesh.corner(f, static_cast<int>(k))] +=
          !obtuse ? voronoi : s.area[f] * (cot[k] < 0 ? 0.5 : 0.25);
    }
  }
  return mass;
}

/// One row of a sparse matrix: (column, value), ascending.
using SparseRow = std::vector<std::pair<int, double>>;

/// The cotangent Laplacian without the division by areas; rows sum to zero.
inline Array<SparseRow> cotangent_matrix(const Surface& s) {
  Array<SparseRow> rows(s.mesh.n_vertices);
  const auto add = [&](int u, int v, double value) {
    for (auto& entry : rows[u])
      if (entry.first == v) return void(entry.second += value);
    rows[u].push_back({v, value});
  };
  for (int h = 0; h < s.mesh.tail.size(); ++h) {
    const int u = s.mesh.tail[h], v = s.mesh.tip(h), w = s.mesh.tail[prev(h)];
    const double half = 0.5 * cotangent(s.vertices.row(w), s.vertices.row(u), s.vertices.row(v));
    add(u, v, -half), add(v, u, -half);
    add(u, u, half), add(v, v, half);
  }
  for (SparseRow& row : rows) std::sort(row.begin(), row.end());
  return rows;
}

/// Lᵀ M L = C M⁻¹ C on within_pattern(pair, 2), C the cotangent matrix; one number per block, both
/// coordinates are treated alike. Scaled by the mean area, so that ω_L has no unit.
inline Array<double> squared_laplacian(const SurfacePair& pair, const BlockPattern& pattern) {
  Array<double> Q(pattern.blocks(), 0);
  for (const Surface* s : {&pair.a, &pair.b}) {
    const int first = s == &pair.a ? 0 : pair.n_a();
    const Array<SparseRow> C = cotangent_matrix(*s);
    const Array<double> mass = vertex_areas(*s);
    const double scale = 0.5 * pair.total_area();
    for (int k = 0; k < s->mesh.n_vertices; ++k)
      for (const auto& u : C[k])
        for (const auto& v : C[k])
          if (u.first <= v.first)
            Q[find_block(pattern, first + u.first, first + v.first)] +=
                scale * u.second * v.second / mass[k];
  }
  return Q;
}

// ---- the blended system (§5.3) ----

/// H_+ and ω-independent part of the preconditioner on one pattern, and the right-hand side.
struct LinearSystem {
  BlockPattern pattern;
  BlockValues H, Q;
  Eigen::VectorXd gradient;
};

/// Blends the models of the last iterations, newest first, with weights decay^k (normalised), and
/// adds the preconditioner's pattern.
class SystemBuilder {
 public:
  SystemBuilder(const SurfacePair& pair, bool precondition, const Executor& executor)
      : one_ring_(within_pattern({&pair.a, &pair.b}, 1)),
        within_(precondition ? within_pattern({&pair.a, &pair.b}, 2) : one_ring_),
        n_a_(pair.n_a()),
        n_b_(pair.n_b()),
        executor_(executor) {
    for (int r = 0; r < one_ring_.rows(); ++r)
      for (int b = one_ring_.start[r]; b < one_ring_.start[r + 1]; ++b)
        place_.push_back(find_block(within_, r, one_ring_.column[b]) - within_.start[r]);
    if (precondition) laplacian_ = squared_laplacian(pair, within_);
  }

  const BlockPattern& one_ring() const { return one_ring_; }

  LinearSystem blend(const Array<QuadraticModel>& history, double decay) const {
    Array<double> weight(history.size());
    double sum = 0;
    for (int k = 0; k < history.size(); ++k) sum += weight[k] = std::pow(decay, k);
    for (double& w : weight) w /= sum;
    LinearSystem system;
    system.gradient.setZero(2 * (n_a_ + n_b_));
    for (int k = 0; k < history.size(); ++k) system.gradient += weight[k] * history[k].gradient;
    system.pattern = union_pattern(history);
    system.H.resize(system.pattern.blocks());
    system.Q.resize(laplacian_.empty() ? 0 : system.pattern.blocks());
    executor_.run_blocks(n_a_ + n_b_, kBlock, [&](int begin, int end) {
      for (int r = begin; r < end; ++r) fill_row(history, weight, r, system);
    });
    return system;
  }

 private:
  static constexpr int kBlock = 256;  // rows per task

  /// Row r: the fixed couplings within a mesh, then, for vertices of A, the union over the
  /// history of its couplings with B.
  BlockPattern union_pattern(const Array<QuadraticModel>& history) const {
    const int block = rows_per_task(n_a_, kBlock);
    Array<Array<int>> columns((n_a_ + block - 1) / block), counts(columns.size());
    executor_.run_blocks(n_a_, block, [&](int begin, int end) {
      Array<int> mark(n_b_, -1);
      for (int r = begin; r < end; ++r)
        union_row(history, r, mark, columns[begin / block], counts[begin / block]);
    });
    BlockPattern pattern;
    pattern.start.push_back(0);
    for (int r = 0; r < n_a_ + n_b_; ++r) {
      for (int b = within_.start[r]; b < within_.start[r + 1]; ++b)
        pattern.column.push_back(within_.column[b]);
      if (r < n_a_) {
        const Array<int>& ends = counts[r / block];
        const int begin = r % block == 0 ? 0 : ends[r % block - 1];
        for (int i = begin; i < ends[r % block]; ++i)
          pattern.column.push_back(n_a_ + columns[r / block][i]);
      }
      pattern.start.push_back(pattern.blocks());
    }
    return pattern;
  }

  static void union_row(const Array<QuadraticModel>& history, int r, Array<int>& mark,
                        Array<int>& columns, Array<int>& ends) {
    const int begin = columns.size();
    for (const QuadraticModel& model : history)
      for (int b = model.between.start[r]; b < model.between.start[r + 1]; ++b) {
        const int v = model.between.column[b];
        if (mark[v] == r) continue;
        mark[v] = r;
        columns.push_back(v);
      }
    std::sort(columns.begin() + begin, columns.end());
    ends.push_back(columns.size());
  }

  void fill_row(const Array<QuadraticModel>& history, const Array<double>& weight, int r,
                LinearSystem& system) const {
    const int begin = system.pattern.start[r], end = system.pattern.start[r + 1];
    for (int b = begin; b < end; ++b) system.H[b].setZero();
    for (int k = 0; k < history.size(); ++k) {
      for (int b = one_ring_.start[r]; b < one_ring_.start[r + 1]; ++b)
        system.H[begin + place_[b]] += weight[k] * history[k].within[b];
      if (r >= n_a_) continue;
      const CouplingBlocks& between = history[k].between;
      int at = begin + within_.start[r + 1] - within_.start[r];
      for (int b = between.start[r]; b < between.start[r + 1]; ++b) {
        while (system.pattern.column[at] != n_a_ + between.column[b]) ++at;
        system.H[at] += weight[k] * between.value[b];
      }
    }
    if (laplacian_.empty()) return;
    for (int b = begin; b < end; ++b) system.Q[b].setZero();
    for (int b = within_.start[r]; b < within_.start[r + 1]; ++b)
      system.Q[begin + b - within_.start[r]].diagonal().setConstant(laplacian_[b]);
  }

  BlockPattern one_ring_;
  BlockPattern within_;  // one or two rings
  Array<int> place_;     // of a one-ring block within its row of within_
  Array<double> laplacian_;
  int n_a_, n_b_;
  const Executor& executor_;
};

// ---- blocks that come in later ----

/// A block of the upper triangle, row <= column, that is to be added to a system.
struct ExtraBlock {
  int row, column;
  Eigen::Matrix2d H, Q;
};

/// Appends a block to the row that is being written, or adds it to the last one if that is there.
inline void append_block(int column, const Eigen::Matrix2d& H, const Eigen::Matrix2d* Q,
                         LinearSystem& system) {
  BlockPattern& pattern = system.pattern;
  if (pattern.start.back() < pattern.blocks() && pattern.column.back() == column) {
    system.H.back() += H;
    if (Q != nullptr) system.Q.back() += *Q;
    return;
  }
  pattern.column.push_back(column);
  system.H.push_back(H);
  if (Q != nullptr) system.Q.push_back(*Q);
}

/// Adds blocks to those of a system that keep(row, column).
template <class Keep>
void merge_blocks(const Array<ExtraBlock>& extra, const Keep& keep, LinearSystem& system) {
  Array<int> order(extra.size());
  for (int i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](int i, int j) {
    return std::tie(extra[i].row, extra[i].column, i) < std::tie(extra[j].row, extra[j].column, j);
  });
  LinearSystem result;
  result.gradient = system.gradient;
  result.pattern.start.push_back(0);
  const bool has_Q = !system.Q.empty();
  int next = 0;
  for (int r = 0; r < system.pattern.rows(); ++r) {
    const auto append_extra = [&](int end) {
      for (; next < order.size() && extra[order[next]].row == r; ++next) {
        const ExtraBlock& block = extra[order[next]];
        if (block.column >= end) return;
        append_block(block.column, block.H, has_Q ? &block.Q : nullptr, result);
      }
    };
    for (int b = system.pattern.start[r]; b < system.pattern.start[r + 1]; ++b) {
      const int c = system.pattern.column[b];
      if (!keep(r, c)) continue;
      append_extra(c);
      append_block(c, system.H[b], has_Q ? &system.Q[b] : nullptr, result);
    }
    append_extra(system.pattern.rows());
    result.pattern.start.push_back(result.pattern.blocks());
  }
  system = std::move(result);
}

// ---- constraints (§4.5, §4.6) ----

/// Barycentric coordinates of p in a planar triangle of positive area.
inline Vec3 barycentric(const Vec2& p, const Vec2& a, const Vec2& b, const Vec2& c) {
  const double area = cross(b - a, c - a);
  const double u = cross(b - p, c - p) / area, v = cross(c - p, a - p) / area;
  return Vec3(u, v, 1 - u - v);
}

/// A vertex held at a point of the other surface: x_row = Σ_k weight_k x_master_k (§4.5). Masters
/// do not follow others themselves.
struct Follower {
  int row;
  std::array<int, 3> master;
  Vec3 weight;
};

/// The linear map P from the unknowns that are left to all rows: where a row gets its position
/// from.
class Substitution {
 public:
  Substitution(const Array<Follower>& followers, int rows)
      : followers_(followers), follower_of_(rows, -1) {
    for (int i = 0; i < followers.size(); ++i) follower_of_[followers[i].row] = i;
  }
  bool is_follower(int row) const { return follower_of_[row] >= 0; }

  /// visit(row, weight) for every unknown that the position of `row` depends on.
  template <class Visit>
  void for_each_source(int row, const Visit& visit) const {
    if (!is_follower(row)) return visit(row, 1.0);
    const Follower& follower = followers_[follower_of_[row]];
    for (int k = 0; k < 3; ++k)
      if (follower.weight[k] != 0)
        visit(follower.master[static_cast<std::size_t>(k)], follower.weight[k]);
  }

 private:
  const Array<Follower>& followers_;
  Array<int> follower_of_;
};

/// The blocks of Pᵀ H P and Pᵀ Q P that do not lie where they lay in H and Q.
inline Array<ExtraBlock> substituted_blocks(const Substitution& P, const LinearSystem& system) {
  Array<ExtraBlock> moved;
  const auto add = [&](int i, int j, const Eigen::Matrix2d& H, const Eigen::Matrix2d& Q) {
    if (i <= j) moved.push_back({i, j, H, Q});
  };
  for (int r = 0; r < system.pattern.rows(); ++r)
    for (int b = system.pattern.start[r]; b < system.pattern.start[r + 1]; ++b) {
      const int c = system.pattern.column[b];
      if (!P.is_follower(r) && !P.is_follower(c)) continue;
      const Eigen::Matrix2d& H = system.H[b];
      const Eigen::Matrix2d Q = system.Q.empty() ? Eigen::Matrix2d::Zero() : system.Q[b];
      P.for_each_source(r, [&](int i, double wi) {
        P.for_each_source(c, [&](int j, double wj) {
          add(i, j, wi * wj * H, wi * wj * Q);
          if (r != c) add(j, i, wi * wj * H.transpose(), wi * wj * Q.transpose());
        });
      });
      if (r == c) add(r, r, Eigen::Matrix2d::Identity(), Eigen::Matrix2d::Zero());
    }
  return moved;
}

/// Replaces x by P x in a system: Pᵀ H P, Pᵀ Q P, Pᵀ g, exactly. Followers become unit rows.
inline void substitute(const Array<Follower>& followers, LinearSystem& system) {
  if (followers.empty()) return;
  const Substitution P(followers, system.pattern.rows());
  merge_blocks(
      substituted_blocks(P, system),
      [&](int r, int c) { return !P.is_follower(r) && !P.is_follower(c); }, system);
  for (const Follower& follower : followers) {
    const Vec2 force = system.gradient.segment<2>(2 * follower.row);
    system.gradient.segment<2>(2 * follower.row).setZero();
    P.for_each_source(follower.row, [&](int master, double weight) {
      system.gradient.segment<2>(2 * master) += weight * force;
    });
  }
}

/// Removes unknowns from a system (§4.6): unit rows and columns, so their step is 0. Coordinate c
/// of row r is removed if is_fixed[2 r + c].
inline void eliminate(const Array<char>& is_fixed, LinearSystem& system) {
  for (int r = 0; r < system.pattern.rows(); ++r)
    for (int b = system.pattern.start[r]; b < system.pattern.start[r + 1]; ++b)
      for (int c = 0; c < 2; ++c) {
        const int column = system.pattern.column[b];
        for (BlockValues* values : {&system.H, &system.Q}) {
          if (values->empty()) continue;
          if (is_fixed[2 * r + c]) (*values)[b].row(c).setZero();
          if (is_fixed[2 * column + c]) (*values)[b].col(c).setZero();
        }
        if (r == column && is_fixed[2 * r + c]) system.H[b](c, c) = 1;
      }
  for (int i = 0; i < is_fixed.size(); ++i)
    if (is_fixed[i]) system.gradient(i) = 0;
}

/// Fixes what a held boundary must not move. A vertex in a row with its neighbours, parallel to an
/// axis, may slide along it.
inline void hold_boundary(const HalfEdgeMesh& m, const Points2& x, Boundary boundary, int first,
                          Array<char>& is_fixed) {
  if (boundary == Boundary::kFree) return;
  const int n = m.boundary.size();
  for (int i = 0; i < n; ++i) {
    const int u = m.tail[m.boundary[(i + n - 1) % n]], v = m.tail[m.boundary[i]];
    const int w = m.tip(m.boundary[i]);
    for (int c = 0; c < 2; ++c) {
      const bool in_a_row = x(u, 1 - c) == x(v, 1 - c) && x(v, 1 - c) == x(w, 1 - c);
      is_fixed[2 * (first + v) + c] = boundary == Boundary::kFixed || !in_a_row;
    }
  }
}

/// P d, the direction of all rows from that of the unknowns.
inline Eigen::VectorXd expanded(const Array<Follower>& followers, Eigen::VectorXd d) {
  const Substitution P(followers, static_cast<int>(d.size()) / 2);
  for (const Follower& follower : followers) {
    Vec2 sum = Vec2::Zero();
    P.for_each_source(follower.row,
                      [&](int master, double weight) { sum += weight * d.segment<2>(2 * master); });
    d.segment<2>(2 * follower.row) = sum;
  }
  return d;
}

/// Puts the followers where their masters say.
inline void place_followers(const Array<Follower>& followers, Points2& f, Points2& g) {
  const int n_a = static_cast<int>(f.rows());
  const auto position = [&](int row) { return row < n_a ? row2(f, row) : row2(g, row - n_a); };
  for (const Follower& follower : followers) {
    Vec2 p = Vec2::Zero();
    for (int k = 0; k < 3; ++k)
      p += follower.weight[k] * position(follower.master[static_cast<std::size_t>(k)]);
    p = Vec2(flush_tiny(p.x()), flush_tiny(p.y()));
    if (follower.row < n_a)
      f.row(follower.row) = p.transpose();
    else
      g.row(follower.row - n_a) = p.transpose();
  }
}

// ---- rigid motions ----

using RigidMotion = Eigen::Matrix<double, 2, 3>;  // rotation | translation

/// The rotation by an angle that takes one point to another.
inline RigidMotion rigid_motion(double angle, const Vec2& from, const Vec2& to) {
  RigidMotion motion;
  motion.leftCols<2>() << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  motion.col(2) = to - motion.leftCols<2>() * from;
  return motion;
}

inline Points2 transformed(const Points2& x, const RigidMotion& motion) {
  const Points2 y = (x * motion.leftCols<2>().transpose()).rowwise() + motion.col(2).transpose();
  return y.unaryExpr([](double c) { return flush_tiny(c); });
}

/// The motion that brings the rows of `from` closest to those of `to`.
inline RigidMotion rigid_fit(const Points2& from, const Points2& to) {
  const Vec2 c0 = from.colwise().mean().transpose(), c1 = to.colwise().mean().transpose();
  double along = 0, across = 0;
  for (int i = 0; i < from.rows(); ++i) {
    const Vec2 p = row2(from, i) - c0, q = row2(to, i) - c1;
    along += p.dot(q);
    across += cross(p, q);
  }
  return rigid_motion(std::atan2(across, along), c0, c1);
}

// ---- step bound (§5.2; Smith and Schaefer 2015) ----

/// Smallest s > 0 at which the triangle p + s d loses its area: first root of
/// cross(u, v) + s (cross(u, dv) + cross(du, v)) + s² cross(du, dv).
inline double triangle_max_step(const Vec2& u, const Vec2& v, const Vec2& du, const Vec2& dv) {
  const double c = cross(u, v), b = cross(u, dv) + cross(du, v), a = cross(du, dv);
  const double discriminant = b * b - 4 * a * c;
  if (!(discriminant >= 0)) return kInfinity;
  const double root = std::sqrt(discriminant);
  if (b < 0) return 2 * c / (root - b);
  return a < 0 ? -(b + root) / (2 * a) : kInfinity;
}

/// s_max over all triangles of a mesh.
inline double max_step(const HalfEdgeMesh& m, const Points2& x, const Points2& d) {
  double s = kInfinity;
  for (int f = 0; f < m.n_faces; ++f) {
    const int i = m.corner(f, 0), j = m.corner(f, 1), k = m.corner(f, 2);
    s = (std::min)(s, triangle_max_step(row2(x, j) - row2(x, i), row2(x, k) - row2(x, i),
                                        row2(d, j) - row2(d, i), row2(d, k) - row2(d, i)));
  }
  return s;
}

/// x + s d with tiny coordinates made zero, as the predicates want them.
inline Points2 moved(const Points2& x, const Points2& d, double s) {
  return (x + s * d).unaryExpr([](double c) { return flush_tiny(c); });
}

}  // namespace detail
}  // namespace ism

// ==== [11] SCAFFOLD (paper §4.4; Jiang, Schaefer and Panozzo 2017) ===============================
//
// Purpose:    keeps the boundary of an embedding from meeting itself: the space between it and a
//             box around it is triangulated, and its triangles resist deformation, from the shape
//             they have now, a little. Their energy is least where they are, so a step that lowers
//             the sum of both energies lowers E; built anew in every iteration, it yields where the
//             boundary wants to go, but never to a collision.
// Method:     ears are clipped off the space, cut open by a bridge to the box; flips make the
//             result Delaunay, all but the edges of boundary and box.
// Invariants: the triangles are positive, exactly. While they are, the boundary is simple.
// Fails:      where rounding leaves a triangle no area, it is left out, and the exact test of the
//             boundary alone guards that place.

namespace ism {
namespace detail {

/// The space around an embedding in triangles. Vertex n + k, for n vertices of the mesh, is corner
/// k of the box.
struct Scaffold {
  int n_vertices = 0;
  std::array<Vec2, 4> box;
  Array<std::array<int, 3>> triangle;
  Array<Eigen::Matrix2d> rest_inverse;  // of the triangles as they were built
  Array<double> weight;                 // of the triangles, in place of their areas

  Vec2 point(const Points2& x, int v) const {
    return v < n_vertices ? row2(x, v) : box[static_cast<std::size_t>(v - n_vertices)];
  }
  Vec2 displacement(const Points2& d, int v) const {
    return v < n_vertices ? row2(d, v) : Vec2::Zero();
  }
};

/// A box around an embedding with room on all sides, counter-clockwise from its lower left corner.
inline std::array<Vec2, 4> roomy_box(const Points2& x) {
  const Vec2 lo = x.colwise().minCoeff().transpose(), hi = x.colwise().maxCoeff().transpose();
  const double room = 0.5 * (hi - lo).maxCoeff();
  const Vec2 p = lo - Vec2::Constant(room), q = hi + Vec2::Constant(room);
  return {p, Vec2(q.x(), p.y()), q, Vec2(p.x(), q.y())};
}

/// The space between boundary and box as one polygon, counter-clockwise: a bridge leads from the
/// second corner of the box to the rightmost vertex of the boundary, which sees it, and back.
inline Array<int> space_around(const HalfEdgeMesh& m, const Points2& x) {
  int start = 0;
  const int n = m.boundary.size();
  for (int i = 1; i < n; ++i)
    if (x(m.tail[m.boundary[i]], 0) > x(m.tail[m.boundary[start]], 0)) start = i;
  Array<int> polygon;
  polygon.push_back(m.n_vertices);
  polygon.push_back(m.n_vertices + 1);
  for (int i = 0; i <= n; ++i) polygon.push_back(m.tail[m.boundary[(start + n - i) % n]]);
  for (int k = 1; k < 4; ++k) polygon.push_back(m.n_vertices + k);
  return polygon;
}

/// Clips the ears of a polygon one after the other. O(n²) on usual outlines, O(n³) at worst.
class EarClipper {
 public:
  EarClipper(const Scaffold& scaffold, const Points2& x, const Array<int>& polygon)
      : polygon_(polygon), next_(polygon.size()), prev_(polygon.size()) {
    const int n = polygon.size();
    for (int i = 0; i < n; ++i) {
      point_.push_back(scaffold.point(x, polygon[i]));
      next_[i] = (i + 1) % n;
      prev_[i] = (i + n - 1) % n;
    }
  }

  /// The triangles; fewer than n - 2 if the polygon is not simple.
  Triangles run() {
    Triangles triangles(polygon_.size() - 2, 3);
    int row = 0, left = polygon_.size();
    for (int i = 0, misses = 0; left >= 3 && misses < left; i = next_[i]) {
      if (!is_ear(i)) {
        ++misses;
        continue;
      }
      misses = 0;
      triangles.row(row++) << polygon_[prev_[i]], polygon_[i], polygon_[next_[i]];
      next_[prev_[i]] = next_[i];
      prev_[next_[i]] = prev_[i];
      --left;
    }
    return triangles.topRows(row);
  }

 private:
  /// True if the triangle at i is positive and empty of all other vertices that are left.
  bool is_ear(int i) const {
    const int a = prev_[i], c = next_[i];
    const Vec2 &p = point_[a], &q = point_[i], &r = point_[c];
    if (!(orient2d(p, q, r) > 0)) return false;
    const Vec2 lo = p.cwiseMin(q).cwiseMin(r), hi = p.cwiseMax(q).cwiseMax(r);
    for (int k = next_[c]; k != a; k = next_[k]) {
      const Vec2& s = point_[k];
      if ((s.array() < lo.array()).any() || (s.array() > hi.array()).any()) continue;
      const int v = polygon_[k];  // the ends of the bridge are there twice
      if (v == polygon_[a] || v == polygon_[i] || v == polygon_[c]) continue;
      if (orient2d(p, q, s) >= 0 && orient2d(q, r, s) >= 0 && orient2d(r, p, s) >= 0) return false;
    }
    return true;
  }

  const Array<int>& polygon_;
  Array<Vec2> point_;
  Array<int> next_, prev_;
};

/// Replaces the edge a → b between the triangles abc and bad by the one between c and d.
inline void flip(HalfEdgeMesh& m, int h) {
  const int t = m.twin[h], f = 3 * (h / 3), g = 3 * (t / 3);
  const int a = m.tail[h], b = m.tail[t], c = m.tail[prev(h)], d = m.tail[prev(t)];
  const int bc = m.twin[next(h)], ca = m.twin[prev(h)];
  const int ad = m.twin[next(t)], db = m.twin[prev(t)];
  const auto set = [&](int half_edge, int tail, int twin) {
    m.tail[half_edge] = tail;
    m.twin[half_edge] = twin;
    if (twin >= 0) m.twin[twin] = half_edge;
  };
  set(f, a, ad), set(f + 1, d, g + 2), set(f + 2, c, ca);
  set(g, d, db), set(g + 1, b, bc), set(g + 2, c, f + 1);
}

/// True if an inner edge may be flipped and should be: the angles opposite add up to more than π.
inline bool flip_improves(const Scaffold& s, const Points2& x, const HalfEdgeMesh& m, int h) {
  constexpr double kClear = 1e-9;  // by which it should, so that rounding does not flip for ever
  const int t = m.twin[h];
  const Vec2 a = s.point(x, m.tail[h]), b = s.point(x, m.tail[t]);
  const Vec2 c = s.point(x, m.tail[prev(h)]), d = s.point(x, m.tail[prev(t)]);
  if (!(orient2d(a, d, c) > 0) || !(orient2d(d, b, c) > 0)) return false;
  // Exact signs: on a boundary that is straight up to rounding, areas round to 0.
  const double cot_c = (a - c).dot(b - c) / orient2d(a, b, c);
  const double cot_d = (b - d).dot(a - d) / orient2d(b, a, d);
  return cot_c + cot_d < -kClear * (std::abs(cot_c) + std::abs(cot_d));
}

/// Flips inner edges until all are locally Delaunay.
inline void make_delaunay(const Scaffold& s, const Points2& x, HalfEdgeMesh& m) {
  constexpr int kMostFlips = 1000;  // per edge
  Array<int> stack;
  for (int h = 0; h < m.tail.size(); ++h)
    if (m.twin[h] > h) stack.push_back(h);
  for (std::int64_t left = kMostFlips * std::int64_t{m.n_faces}; !stack.empty() && left > 0;) {
    const int h = stack.back();
    stack.pop_back();
    if (m.twin[h] < 0 || !flip_improves(s, x, m, h)) continue;
    const int f = 3 * (h / 3), g = 3 * (m.twin[h] / 3);
    flip(m, h);
    --left;
    for (int outer : {f, f + 2, g, g + 1}) stack.push_back(outer);
  }
}

/// Twice the area of a triangle, with edges p and q, over the length of its longest edge.
inline double height(const Vec2& p, const Vec2& q) {
  return cross(p, q) /
         std::sqrt((std::max)({p.squaredNorm(), q.squaredNorm(), (q - p).squaredNorm()}));
}

/// Triangulates the space around an embedding; `weight` is that of all its triangles together.
/// Those in gaps that are next to closed get less, or they would be too stiff for the linear
/// solver.
inline Scaffold build_scaffold(const HalfEdgeMesh& m, const Points2& x, double weight) {
  constexpr double kNarrow = 1e-10;  // of the size of the box
  Scaffold s;
  s.n_vertices = m.n_vertices;
  s.box = roomy_box(x);
  HalfEdgeMesh space =
      build_half_edges(m.n_vertices + 4, EarClipper(s, x, space_around(m, x)).run());
  make_delaunay(s, x, space);
  const double narrow = kNarrow * (s.box[2] - s.box[0]).norm();
  for (int f = 0; f < space.n_faces; ++f) {
    s.triangle.push_back({space.corner(f, 0), space.corner(f, 1), space.corner(f, 2)});
    const Vec2 a = s.point(x, space.corner(f, 0)), b = s.point(x, space.corner(f, 1));
    const Vec2 c = s.point(x, space.corner(f, 2));
    Eigen::Matrix2d R;
    R << b - a, c - a;
    const Eigen::Matrix2d inverse = R.inverse();
    if (!(R.determinant() > 0) || !inverse.allFinite()) {  // no area but for exact arithmetic
      s.triangle.pop_back();
      continue;
    }
    s.rest_inverse.push_back(inverse);
    const double openness = (std::min)(1.0, height(b - a, c - a) / narrow);
    s.weight.push_back(weight / space.n_faces * openness * openness);
  }
  return s;
}

/// The energy above the least, which it has where the scaffold was built; infinite where a triangle
/// is not positive.
inline double scaffold_energy(const Scaffold& s, const Points2& x) {
  double energy = 0;
  for (int t = 0; t < s.triangle.size(); ++t) {
    const auto& v = s.triangle[t];
    const Eigen::Matrix2d J =
        jacobian(s.point(x, v[0]), s.point(x, v[1]), s.point(x, v[2]), s.rest_inverse[t]);
    energy += triangle_energy(J, s.weight[t]) - 4 * s.weight[t];
  }
  return energy;
}

/// The s at which the first triangle of the scaffold degenerates.
inline double max_step(const Scaffold& s, const Points2& x, const Points2& d) {
  double least = kInfinity;
  for (const auto& v : s.triangle) {
    const Vec2 p = s.point(x, v[0]), dp = s.displacement(d, v[0]);
    least = (std::min)(
        least, triangle_max_step(s.point(x, v[1]) - p, s.point(x, v[2]) - p,
                                 s.displacement(d, v[1]) - dp, s.displacement(d, v[2]) - dp));
  }
  return least;
}

/// Adds the Hessian of the scaffold where it was built; its gradient is zero there. `first` is the
/// row of the embedding's first vertex.
inline void add_scaffold(const Scaffold& s, int first, Array<ExtraBlock>& blocks) {
  for (int t = 0; t < s.triangle.size(); ++t) {
    const auto& v = s.triangle[t];
    const Mat6 H =
        triangle_derivatives(Eigen::Matrix2d::Identity(), s.rest_inverse[t], s.weight[t]).hessian;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int r = v[static_cast<std::size_t>(i)], c = v[static_cast<std::size_t>(j)];
        if (r <= c && c < s.n_vertices)
          blocks.push_back(
              {first + r, first + c, H.block<2, 2>(2 * i, 2 * j), Eigen::Matrix2d::Zero()});
      }
  }
}

}  // namespace detail
}  // namespace ism

// ==== [12] LINE SEARCH (paper §5.2; Smith and Schaefer 2015) =====================================
//
// Purpose:    the largest feasible step of a direction, the candidates of the line search, and the
//             decision which of them are injective and improve E enough.
// Invariants: an accepted candidate is injective, decided exactly on the rounded positions.
// Fails:      with no acceptable candidate, if the direction is not one of descent, or if the
//             boundaries are in each other's way.

namespace ism {
namespace detail {

/// A direction of descent for one ω_L.
struct Direction {
  double omega = 0;
  Points2 f, g;
  double slope = kInfinity;  // gᵀd; below 0 unless x is stationary, infinite without a solution
  double max_step = 0;       // s_max
  double first_step = 0;     // where backtracking starts
};

/// One trial of the line search.
struct Trial {
  int direction = 0;
  double step = 0;
  double omega = 0, max_step = 0;  // of the direction
  bool accepted = false;
  bool collides = false;  // rejected because a boundary meets itself
  double resistance = 0;  // of the scaffolds
  Iterate x;
  double value() const { return x.energy + resistance; }
};

/// What a trial must satisfy besides injectivity.
struct StepRules {
  double max_area_loss_a, max_area_loss_b;  // of the covered area, in one step
  double least_area_a, least_area_b;        // that stays covered
};

/// The largest E of an acceptable trial (§5.2).
inline double largest_energy(const Iterate& from, const Direction& d, const Trial& t) {
  constexpr double kArmijo = 1e-4;
  return from.energy + kArmijo * t.step * d.slope - (std::max)(t.resistance, 0.0);
}

inline bool is_acceptable(const StepRules& rules, const Iterate& from, const Direction& d,
                          const Trial& t) {
  const Iterate& to = t.x;
  return std::isfinite(to.energy) && to.energy <= largest_energy(from, d, t) &&
         from.area_a - to.area_a <= rules.max_area_loss_a &&
         from.area_b - to.area_b <= rules.max_area_loss_b && to.area_a > rules.least_area_a &&
         to.area_b > rules.least_area_b;
}

constexpr double kShrink = 0.8;  // §5.2

/// A block of the line search covers eight ℓ of 0.8^ℓ, or some more for a stride that does not
/// divide eight; of every `stride` of them, the one in the middle is tried.
inline int trials_per_block(int stride) {
  constexpr int kBlock = 8;  // §5.2
  return (kBlock - 1) / stride + 1;
}

/// Adds the steps of a block, and s = 1 to those of the first one.
inline void add_block(int direction, const Direction& d, int block, int stride,
                      std::vector<std::pair<int, double>>& steps) {
  const int trials = trials_per_block(stride);
  for (int i = block * trials; i < (block + 1) * trials; ++i)
    steps.push_back({direction, d.first_step * std::pow(kShrink, i * stride + stride / 2)});
  if (block == 0 && d.first_step > 1) steps.push_back({direction, 1.0});
}

/// True if triangles are positive, but a boundary meets itself.
inline bool collides(const SurfacePair& pair, const Iterate& x) {
  return all_triangles_positive(pair.a.mesh, x.f) && all_triangles_positive(pair.b.mesh, x.g) &&
         !(boundary_is_simple(pair.a.mesh, x.f) && boundary_is_simple(pair.b.mesh, x.g));
}

/// What the trials of one line search have in common.
struct SearchProblem {
  const SurfacePair& pair;
  const Weights& weights;
  const StepRules& rules;
  const Array<Follower>& followers;
  const Array<Scaffold>& scaffolds;  // of f(A) and g(B), or none
  const Iterate& from;
  const Array<Direction>& directions;
  int stride;  // Options::search_stride
};

/// Takes the step of a trial and decides whether it is acceptable. A trial gives up as soon as it
/// cannot be, or cannot have a value below `best`.
inline void evaluate_trial(const SearchProblem& problem, double best, Trial& t) {
  const SurfacePair& pair = problem.pair;
  const Direction& d = problem.directions[t.direction];
  t.omega = d.omega;
  t.max_step = d.max_step;
  t.x.f = moved(problem.from.f, d.f, t.step);
  t.x.g = moved(problem.from.g, d.g, t.step);
  place_followers(problem.followers, t.x.f, t.x.g);
  t.accepted = is_injective(pair.a.mesh, t.x.f) && is_injective(pair.b.mesh, t.x.g);
  t.collides = !t.accepted && collides(pair, t.x);
  if (!t.accepted) return;
  t.resistance = 0;
  if (!problem.scaffolds.empty())
    t.resistance =
        scaffold_energy(problem.scaffolds[0], t.x.f) + scaffold_energy(problem.scaffolds[1], t.x.g);
  const double limit = (std::min)(largest_energy(problem.from, d, t), best - t.resistance);
  evaluate(pair, problem.weights, t.x, limit);
  t.accepted = is_acceptable(problem.rules, problem.from, d, t);
}

/// What a line search has found.
struct SearchResult {
  int best = -1;          // of the trials; -1 if none is acceptable
  bool collided = false;  // a trial failed because a boundary meets itself
};

/// Tries steps side by side, in trials from `first` on.
inline void try_steps(const SearchProblem& problem, const Executor& executor, int first,
                      const std::vector<std::pair<int, double>>& steps, Array<Trial>& trials,
                      SearchResult& result) {
  const int n = static_cast<int>(steps.size());
  if (trials.size() < first + n) trials.resize(first + n);
  const double best = result.best < 0 ? kInfinity : trials[result.best].value();
  executor.run(n, [&](int i) {
    Trial& trial = trials[first + i];
    std::tie(trial.direction, trial.step) = steps[static_cast<std::size_t>(i)];
    evaluate_trial(problem, best, trial);
  });
  for (int i = first; i < first + n; ++i) {
    const Trial& t = trials[i];
    result.collided = result.collided || t.collides;
    if (t.accepted && (result.best < 0 || t.value() < trials[result.best].value())) result.best = i;
  }
}

/// Tries all directions, block by block, and where not all steps are tried, the neighbours of the
/// best acceptable one (Algorithm 1, lines 17 to 24).
inline SearchResult line_search(const SearchProblem& problem, const Executor& executor,
                                Array<Trial>& trials) {
  constexpr int kMost = 80;  // ℓ; later steps are below 2e-8 of the first
  const int covered = trials_per_block(problem.stride) * problem.stride;
  SearchResult result;
  for (int block = 0; block * covered < kMost && result.best < 0; ++block) {
    std::vector<std::pair<int, double>> steps;
    for (int k = 0; k < problem.directions.size(); ++k)
      add_block(k, problem.directions[k], block, problem.stride, steps);
    try_steps(problem, executor, 0, steps, trials, result);
    if (result.best < 0 || problem.stride == 1) continue;
    const int k = trials[result.best].direction;
    const double step = trials[result.best].step;
    const double longer = (std::min)(step / kShrink, problem.directions[k].first_step);
    try_steps(problem, executor, static_cast<int>(steps.size()), {{k, longer}, {k, step * kShrink}},
              trials, result);
  }
  return result;
}

}  // namespace detail
}  // namespace ism

// ==== [13] THE LOOP (paper §5, Algorithm 1) ======================================================
//
// Purpose:    minimises E from an injective start. Beyond the paper: the terms of Options that its
//             preset switches off; bounds on the displacement and on the loss of covered area in a
//             step; s = 1 is tried where it is within these bounds; Armijo's slope is that of the
//             newest gradient, so that E never grows; history weights add up to 1, so that ω_L
//             means the same in the first iterations; where only a short step is found, the newest
//             derivatives alone are tried too. For speed, one matrix is factorised, and conjugate
//             gradients use its factor for the other ω_L; and of the steps of the line search some
//             are tried, then the neighbours of the best.
// Invariants: every iterate is injective, decided exactly; E never grows.
// Fails:      stalls where no candidate of any direction is acceptable; says so in the status.

namespace ism {
namespace detail {

/// Numbers of edges from the boundary, breadth first.
inline Array<int> boundary_distances(const HalfEdgeMesh& m) {
  Array<int> distance(m.n_vertices, -1);
  std::vector<int> queue;
  for (int h : m.boundary) {
    distance[m.tail[h]] = 0;
    queue.push_back(m.tail[h]);
  }
  for (std::size_t i = 0; i < queue.size(); ++i) {
    const int u = queue[i];
    m.for_each_outgoing(u, [&](int h) {
      for (int v : {m.tip(h), m.tail[prev(h)]}) {
        if (distance[v] >= 0) continue;
        distance[v] = distance[u] + 1;
        queue.push_back(v);
      }
    });
  }
  return distance;
}

/// Where g(B) is held to remove rigid motions (§4.6): the most central vertex goes to the origin,
/// a boundary vertex far from it to the x-axis. Both depend on the surface, not on the positions.
struct Anchors {
  int center = 0;
  int rim = 0;
};

inline Anchors choose_anchors(const SurfacePair& pair, const Array<Follower>& followers) {
  const Surface& b = pair.b;
  Array<int> distance = boundary_distances(b.mesh);
  for (const Follower& follower : followers)
    if (follower.row >= pair.n_a()) distance[follower.row - pair.n_a()] = -1;
  Anchors anchors;
  for (int v = 0; v < b.mesh.n_vertices; ++v)
    if (distance[v] > distance[anchors.center]) anchors.center = v;
  double farthest = -1;
  for (int h : b.mesh.boundary) {
    const int v = b.mesh.tail[h];
    const double d = (b.vertices.row(v) - b.vertices.row(anchors.center)).norm();
    if (v == anchors.center || distance[v] < 0 || d <= farthest) continue;
    farthest = d;
    anchors.rim = v;
  }
  return anchors;
}

/// Moves both planes rigidly so that the anchors are where they belong; false, and unchanged
/// positions, if rounding would cost the injectivity of so thin an embedding.
inline bool move_to_anchors(const SurfacePair& pair, const Anchors& anchors, Points2& f,
                            Points2& g) {
  const Vec2 origin = row2(g, anchors.center), axis = row2(g, anchors.rim) - origin;
  const RigidMotion motion = rigid_motion(-std::atan2(axis.y(), axis.x()), origin, Vec2::Zero());
  const Points2 new_f = transformed(f, motion);
  Points2 new_g = transformed(g, motion);
  new_g.row(anchors.center).setZero();
  new_g(anchors.rim, 1) = 0;
  if (!is_injective(pair.a.mesh, new_f) || !is_injective(pair.b.mesh, new_g)) return false;
  f = new_f;
  g = new_g;
  return true;
}

/// The largest distance, on the surfaces, of a pinned vertex from where it is pinned.
inline double pin_residual(const SurfacePair& pair, const Array<Follower>& followers,
                           const Points2& f, const Points2& g) {
  const int n = pair.n_a();
  double largest = 0;
  for (const Follower& follower : followers) {
    const bool on_b = follower.row < n;
    const Vec2 p = on_b ? row2(f, follower.row) : row2(g, follower.row - n);
    std::array<Vec2, 3> corner;
    for (std::size_t k = 0; k < 3; ++k)
      corner[k] = on_b ? row2(g, follower.master[k] - n) : row2(f, follower.master[k]);
    const Vec3 off = barycentric(p, corner[0], corner[1], corner[2]) - follower.weight;
    const Points3& vertices = on_b ? pair.b.vertices : pair.a.vertices;
    Vec3 distance = Vec3::Zero();
    for (int k = 0; k < 3; ++k)
      distance +=
          off[k] *
          vertices.row(follower.master[static_cast<std::size_t>(k)] - (on_b ? n : 0)).transpose();
    largest = (std::max)(largest, distance.norm());
  }
  return largest;
}

inline void describe(const SurfacePair& pair, const Array<Follower>& followers, const Iterate& x,
                     IterationLog& log) {
  log.energy = x.energy;
  log.map_energy = x.map_energy;
  log.energy_f = x.energy_f;
  log.energy_g = x.energy_g;
  log.mean_distortion = x.map_energy / (x.area_a + x.area_b);
  log.coverage_a = x.area_a / pair.a.total_area;
  log.coverage_b = x.area_b / pair.b.total_area;
  log.polygons = x.overlay.polygons.size();
  log.pin_residual = pin_residual(pair, followers, x.f, x.g);
}

/// Half the diagonal of the box around both embeddings.
inline double domain_radius(const Points2& f, const Points2& g) {
  const Vec2 lo = f.colwise().minCoeff().cwiseMin(g.colwise().minCoeff()).transpose();
  const Vec2 hi = f.colwise().maxCoeff().cwiseMax(g.colwise().maxCoeff()).transpose();
  return 0.5 * (hi - lo).norm();
}

class Optimizer {
 public:
  Optimizer(const SurfacePair& pair, const Options& options, const Array<Follower>& followers)
      : pair_(pair),
        options_(options),
        followers_(followers),
        weights_{options.coverage_weight, options.barrier_weight, options.spd_epsilon,
                 &options.measure},
        executor_(options),
        systems_(pair, options.variant == Variant::kFull, executor_),
        models_(pair, weights_, systems_.one_ring(), executor_),
        history_length_(options.variant == Variant::kProjectedNewton ? 1 : options.history_length),
        omega_(options.variant == Variant::kFull ? options.omega_start : 0) {}

  /// Algorithm 1. `result.f`, `result.g` hold the injective start.
  void run(Result& result) {
    start(result);
    while (result.status == Status::kIterationLimit &&
           static_cast<int>(result.log.size()) < options_.max_iterations) {
      if (!iterate(result))
        result.status = stationary_  ? Status::kConverged
                        : factor_.ok ? without_step(result)
                                     : Status::kNumericalFailure;
      else if (!report(result))
        result.status = Status::kCancelled;
      else if (has_settled(result, options_.window))
        result.status = Status::kConverged;
    }
    result.f = x_.f;
    result.g = x_.g;
  }

 private:
  void start(Result& result) {
    fix(result);
    place_followers(followers_, result.f, result.g);
    const bool is_valid = followers_.empty() || (is_injective(pair_.a.mesh, result.f) &&
                                                 is_injective(pair_.b.mesh, result.g));
    x_.f = result.f;
    x_.g = result.g;
    radius_ = domain_radius(x_.f, x_.g);
    evaluate(pair_, weights_, x_);
    rules_ = {options_.max_coverage_loss * pair_.a.total_area,
              options_.max_coverage_loss * pair_.b.total_area, options_.least_coverage * x_.area_a,
              options_.least_coverage * x_.area_b};
    describe(pair_, followers_, x_, result.initial);
    result.initial.omega = omega_;
    result.status = Status::kIterationLimit;
    if (!(x_.area_a > 0 && x_.area_b > 0)) result.status = Status::kNoOverlap;
    if (!std::isfinite(x_.energy)) result.status = Status::kNumericalFailure;
    if (!is_valid) result.status = Status::kInvalidPins;
  }

  /// Removes what the constraints hold from the unknowns, or else rigid motions (§4.6).
  void fix(Result& result) {
    const int n = pair_.n_a();
    is_fixed_.assign(2 * pair_.rows(), 0);
    hold_boundary(pair_.a.mesh, result.f, options_.boundary, 0, is_fixed_);
    hold_boundary(pair_.b.mesh, result.g, options_.boundary, n, is_fixed_);
    for (int c = 0; c < 2; ++c) {
      for (int v : options_.fixed_a) is_fixed_[2 * v + c] = 1;
      for (int v : options_.fixed_b) is_fixed_[2 * (n + v) + c] = 1;
    }
    for (const Follower& follower : followers_)  // what holds a landmark of A holds that of B
      for (int k = 0; k < 3; ++k)
        for (int c = 0; c < 2; ++c)
          if (follower.weight[k] == 1 && is_fixed_[2 * follower.row + c])
            is_fixed_[2 * follower.master[static_cast<std::size_t>(k)] + c] = 1;
    if (std::find(is_fixed_.begin(), is_fixed_.end(), 1) != is_fixed_.end()) return;
    const Anchors anchors = choose_anchors(pair_, followers_);
    move_to_anchors(pair_, anchors, result.f, result.g);
    is_fixed_[2 * (n + anchors.center)] = 1;
    is_fixed_[2 * (n + anchors.center) + 1] = 1;
    is_fixed_[2 * (n + anchors.rim) + 1] = 1;
  }

  /// One iteration; false if no step was found or none is left to find.
  bool iterate(Result& result) {
    IterationLog log;
    Timer timer;
    models_.differentiate(x_);  // lines 4 to 7
    log.seconds_derivatives = timer.lap();
    remember(models_.assemble(x_));  // lines 8 and 9
    if (is_scaffolded_) build_scaffolds();
    log.seconds_assembly += timer.lap();
    while (true) {
      const Array<Direction> directions = find_directions(log);  // lines 10 to 16
      constexpr double kRounding = 1e-14;
      stationary_ = promise_little(directions, kRounding);
      if (stationary_ || directions.empty()) return false;
      const SearchResult found = search(directions, log);  // lines 17 to 24
      const bool is_new = options_.scaffold && found.collided && !is_scaffolded_;
      if (is_new) is_scaffolded_ = true;
      if (found.best >= 0) {
        std::swap(chosen_, trials_[found.best]);
        if (chosen_.step < options_.short_step && history_.size() > 1) try_newest(log);
        accept(log, result);
        return true;
      }
      if (is_new)
        build_scaffolds();
      else if (history_.size() > 1)
        reset_history(log);
      else if (!release()) {
        stationary_ = promise_little(directions, options_.tolerance);
        return false;
      }
    }
  }

  SearchResult search(const Array<Direction>& directions, IterationLog& log) {
    Timer timer;
    const SearchProblem problem = {pair_,      weights_, rules_,     followers_,
                                   scaffolds_, x_,       directions, options_.search_stride};
    const SearchResult found = line_search(problem, executor_, trials_);
    log.seconds_search += timer.lap();
    return found;
  }

  /// Searches along the directions of the newest derivatives alone (Options::short_step). The
  /// memory is kept, as it is what overcomes the next kinks.
  void try_newest(IterationLog& log) {
    Array<QuadraticModel> memory = std::move(history_);
    history_ = Array<QuadraticModel>(1, memory[0]);
    const Array<Direction> directions = find_directions(log);
    const SearchResult found = search(directions, log);
    if (found.best >= 0 && trials_[found.best].value() < chosen_.value())
      std::swap(chosen_, trials_[found.best]);
    history_ = std::move(memory);
  }

  /// The space around both embeddings, with the weight of E_f and E_g.
  void build_scaffolds() {
    scaffolds_.clear();
    scaffolds_.push_back(build_scaffold(pair_.a.mesh, x_.f, weights_.barrier * pair_.a.total_area));
    scaffolds_.push_back(build_scaffold(pair_.b.mesh, x_.g, weights_.barrier * pair_.b.total_area));
  }

  /// True if all directions promise to lower E by less than a fraction of its parts.
  bool promise_little(const Array<Direction>& directions, double fraction) const {
    const double scale = x_.map_energy + weights_.kappa * (x_.area_a + x_.area_b);
    return !directions.empty() &&
           std::all_of(directions.begin(), directions.end(),
                       [&](const Direction& d) { return -d.slope <= fraction * scale; });
  }

  void remember(QuadraticModel model) {
    if (history_.size() == history_length_) history_.pop_back();
    history_.insert_front(std::move(model));
  }

  void reset_history(IterationLog& log) {
    history_.resize(1);
    log.history_reset = true;
  }

  /// Lowers ω_L at once where no step is found: at a kink of E, as when both planes are the same, a
  /// direction that is smoothed too much may climb. False if it hardly acts any more.
  bool release() {
    constexpr double kRelease = 16;
    if (omega_ <= kReleased || omega_ <= options_.omega_least) return false;
    omega_ = (std::max)(omega_ / kRelease, options_.omega_least);
    return true;
  }

  /// Solves for the directions of all ω_L; if one of them does not descend, once more with the
  /// newest derivatives alone.
  Array<Direction> find_directions(IterationLog& log) {
    while (true) {
      Timer timer;
      LinearSystem system = systems_.blend(history_, options_.history_decay);
      add_scaffolds(system);
      substitute(followers_, system);
      eliminate(is_fixed_, system);
      log.seconds_assembly += timer.lap();
      const Array<Direction> directions = solve(system);
      log.seconds_solve += timer.lap();
      const bool descend = std::all_of(directions.begin(), directions.end(),
                                       [](const Direction& d) { return d.slope < 0; });
      if (descend || history_.size() == 1) return descend ? directions : descending(directions);
      reset_history(log);
    }
  }

  void add_scaffolds(LinearSystem& system) const {
    if (scaffolds_.empty()) return;
    Array<ExtraBlock> blocks;
    add_scaffold(scaffolds_[0], 0, blocks);
    add_scaffold(scaffolds_[1], pair_.n_a(), blocks);
    merge_blocks(
        blocks, [](int, int) { return true; }, system);
  }

  static Array<Direction> descending(const Array<Direction>& directions) {
    Array<Direction> result;
    for (const Direction& d : directions)
      if (d.slope <= 0) result.push_back(d);
    return result;
  }

  /// (H + ω Lᵀ M L) d = -g for ω/α, ω and α ω (§5.4).
  Array<Direction> solve(const LinearSystem& system) {
    Array<double> omegas(1, omega_);
    if (options_.variant == Variant::kFull) {
      const double smaller = omega_ / options_.omega_factor;
      if (smaller >= options_.omega_least) omegas.push_back(smaller);
      omegas.push_back(omega_ * options_.omega_factor);
    }
    const auto matrix = [&](double omega) {
      return ShiftedMatrix{&system.H, system.Q.empty() ? nullptr : &system.Q, omega};
    };
    Points2 positions(pair_.rows(), 2);
    positions << x_.f, x_.g;
    const LdltSymbolic symbolic = NestedDissection(system.pattern, positions, executor_).build();
    ldlt_factorize(symbolic, matrix(omega_), executor_, factor_);
    if (factor_.negative > 0) omegas.resize(1);  // rounding; conjugate gradients need definite ones
    Array<Direction> directions(omegas.size());
    executor_.run(omegas.size(), [&](int k) {
      directions[k].omega = omegas[k];
      if (!factor_.ok) return;
      const Eigen::VectorXd d =
          k == 0 ? ldlt_solve(symbolic, factor_, -system.gradient)
                 : solve_with_neighbour(symbolic, factor_, system.pattern, matrix(omegas[k]),
                                        -system.gradient, options_.solve_tolerance);
      set_direction(expanded(followers_, d), directions[k]);
    });
    return directions;
  }

  void set_direction(const Eigen::VectorXd& d, Direction& direction) const {
    const Eigen::Map<const Eigen::Matrix<double, 2, Eigen::Dynamic>> columns(d.data(), 2,
                                                                             d.size() / 2);
    direction.f = columns.leftCols(pair_.n_a()).transpose();
    direction.g = columns.rightCols(pair_.n_b()).transpose();
    direction.slope = history_[0].gradient.dot(d);
    direction.max_step = (std::min)(max_step(pair_.a.mesh, x_.f, direction.f),
                                    max_step(pair_.b.mesh, x_.g, direction.g));
    if (!scaffolds_.empty())
      direction.max_step =
          (std::min)({direction.max_step, max_step(scaffolds_[0], x_.f, direction.f),
                      max_step(scaffolds_[1], x_.g, direction.g)});
    const double longest = std::sqrt(columns.colwise().squaredNorm().maxCoeff());
    direction.first_step =
        (std::min)(0.99 * direction.max_step, options_.max_displacement * radius_ / longest);
  }

  void accept(IterationLog& log, Result& result) {
    std::swap(x_, chosen_.x);
    omega_ = chosen_.omega;
    describe(pair_, followers_, x_, log);
    log.iteration = static_cast<int>(result.log.size()) + 1;
    log.omega = chosen_.omega;
    log.step = chosen_.step;
    log.max_step = chosen_.max_step;
    result.log.push_back(log);
  }

  bool report(const Result& result) const {
    if (!options_.progress) return true;
    Progress progress;
    progress.phase = Progress::Phase::kOptimization;
    progress.what = "optimising the map";
    progress.iteration = &result.log.back();
    return options_.progress(progress);
  }

  /// Options::tolerance: so little did E fall over the last iterations that with them the mean over
  /// the window is below the bound. One that finds no step is the last of its window.
  bool has_settled(const Result& result, int iterations) const {
    const int n = static_cast<int>(result.log.size());
    if (n < iterations) return false;
    const IterationLog& now = result.final_state();
    const IterationLog& before =
        n == iterations ? result.initial : result.log[static_cast<std::size_t>(n - 1 - iterations)];
    if (now.omega < before.omega && now.omega > kReleased) return false;
    const double scale = now.energy + weights_.kappa * pair_.total_area();
    return before.energy - now.energy < options_.window * options_.tolerance * scale;
  }

  /// How a run ends that finds no step: where E hardly fell before either, it has arrived.
  Status without_step(const Result& result) const {
    const int before = (std::max)(1, options_.window - 1);
    return has_settled(result, before) ? Status::kConverged : Status::kStalled;
  }

  static constexpr double kReleased = 1e-3;  // ω_L below which the preconditioner hardly acts

  const SurfacePair& pair_;
  const Options& options_;
  const Array<Follower>& followers_;
  Weights weights_;
  StepRules rules_{};
  Executor executor_;
  SystemBuilder systems_;
  ModelBuilder models_;
  int history_length_;
  double omega_;
  double radius_ = 1;
  bool stationary_ = false;
  Array<char> is_fixed_;  // two per row
  Iterate x_;
  Array<QuadraticModel> history_;  // newest first
  LdltFactor factor_;
  Array<Trial> trials_;
  Trial chosen_;
  Array<Scaffold> scaffolds_;  // around f(A) and g(B), once a trial has met a boundary
  bool is_scaffolded_ = false;
};

}  // namespace detail
}  // namespace ism

// ==== [14] INITIAL EMBEDDING (paper §6, Initialization) ==========================================
//
// Purpose:    injective planar embeddings of A and B of low symmetric Dirichlet energy, with
//             landmarks near each other. Tutte's embedding of a whole limb shrinks exponentially,
//             below what doubles resolve; so the mesh is decimated, the coarse mesh is embedded by
//             Tutte's theorem, and its vertices return in the reverse order, relaxed on the way
//             [Hormann and Greiner 2000; Tutte 1963]. Where a long outline gets in its own way or a
//             fold has no good coarse shape, once more without regard to shape: the boundary on a
//             circle and all edges alike until every vertex is back, then step by step to their
//             own lengths.
// Invariants: after every vertex that returns and every step the embedding is injective, exactly.
// Fails:      if rounding leaves no room for a vertex even then; the status names it.

namespace ism {
namespace detail {

// ---- decimation by half-edge collapses ----

/// Vertex u was moved onto its neighbour v. Undone by giving the changed faces back to u and
/// reviving the dead ones.
struct Collapse {
  int u = -1, v = -1;
  Array<int> dead, changed;
};

/// A triangle mesh under decimation: faces keep their ids, dead faces keep their corners.
struct DynamicMesh {
  Array<std::array<int, 3>> face;
  Array<char> alive;                        // per face
  Array<Array<int>> faces_of;               // per vertex, living faces
  Array<int> boundary_next, boundary_prev;  // per vertex, -1 off the boundary
  int boundary_length = 0;

  explicit DynamicMesh(const HalfEdgeMesh& m)
      : face(m.n_faces),
        alive(m.n_faces, 1),
        faces_of(m.n_vertices),
        boundary_next(m.n_vertices, -1),
        boundary_prev(m.n_vertices, -1),
        boundary_length(m.boundary.size()) {
    for (int f = 0; f < m.n_faces; ++f) {
      face[f] = {m.corner(f, 0), m.corner(f, 1), m.corner(f, 2)};
      for (int v : face[f]) faces_of[v].push_back(f);
    }
    for (int h : m.boundary) {
      boundary_next[m.tail[h]] = m.tip(h);
      boundary_prev[m.tip(h)] = m.tail[h];
    }
  }

  bool on_boundary(int v) const { return boundary_next[v] >= 0; }
  bool has(int f, int v) const { return face[f][0] == v || face[f][1] == v || face[f][2] == v; }

  /// The neighbours of u, each once, ascending.
  Array<int> neighbours(int u) const {
    Array<int> ring;
    for (int f : faces_of[u])
      for (int v : face[f])
        if (v != u) ring.push_back(v);
    std::sort(ring.begin(), ring.end());
    ring.resize(static_cast<int>(std::unique(ring.begin(), ring.end()) - ring.begin()));
    return ring;
  }

  /// The link condition: collapsing u onto v leaves a disk.
  bool may_collapse(int u, int v, const Array<int>& ring_u) const {
    const bool along = boundary_next[u] == v || boundary_prev[u] == v;
    if (on_boundary(u) && (!along || boundary_length <= 3)) return false;
    const Array<int> ring_v = neighbours(v);
    Array<int> common;
    std::set_intersection(ring_u.begin(), ring_u.end(), ring_v.begin(), ring_v.end(),
                          std::back_inserter(common));
    return common.size() == (along ? 1 : 2);
  }

  Collapse collapse(int u, int v) {
    Collapse c;
    c.u = u, c.v = v;
    for (int f : faces_of[u]) (has(f, v) ? c.dead : c.changed).push_back(f);
    for (int f : c.dead) {
      alive[f] = 0;
      for (int w : face[f])
        if (w != u) erase(faces_of[w], f);
    }
    for (int f : c.changed) {
      std::replace(face[f].begin(), face[f].end(), u, v);
      faces_of[v].push_back(f);
    }
    faces_of[u].clear();
    if (on_boundary(u)) link(boundary_prev[u], boundary_next[u]), --boundary_length;
    return c;
  }

  void undo(const Collapse& c) {
    for (int f : c.changed) {
      erase(faces_of[c.v], f);
      std::replace(face[f].begin(), face[f].end(), c.v, c.u);
      faces_of[c.u].push_back(f);
    }
    for (int f : c.dead) {
      alive[f] = 1;
      for (int w : face[f]) faces_of[w].push_back(f);
    }
    if (!on_boundary(c.u)) return;
    link(boundary_prev[c.u], c.u);
    link(c.u, boundary_next[c.u]);
    ++boundary_length;
  }

 private:
  void link(int u, int v) { boundary_next[u] = v, boundary_prev[v] = u; }
  static void erase(Array<int>& faces, int f) {
    faces.resize(static_cast<int>(std::remove(faces.begin(), faces.end(), f) - faces.begin()));
  }
};

/// The lengths that the levels of an embedding are relaxed to.
enum class Metric {
  kSurface,  // of the surface, the boundary is free
  kUniform   // all edges alike, the boundary is held on a circle: connectivity alone counts
};

/// Chooses the collapses, cheapest first. In the metric of the surface the cost is the error
/// quadric of Garland and Heckbert 1997 plus a little of the edge length, and protected vertices go
/// as late as the shape of triangles allows. In the uniform metric it is the number of vertices
/// that are then merged into one, times its valence, so that every level is as even as the full
/// mesh.
class Decimation {
 public:
  Decimation(const Surface& s, const Array<char>& is_protected, Metric metric, DynamicMesh& mesh)
      : s_(s),
        protected_(is_protected),
        metric_(metric),
        mesh_(mesh),
        version_(s.mesh.n_vertices, 0),
        merged_(s.mesh.n_vertices, 1) {
    compute_quadrics();
  }

  /// Collapses until at most `target` vertices are left, first with, then without regard to the
  /// shape of triangles.
  Array<Collapse> run(int target) {
    Array<Collapse> collapses;
    int active = s_.mesh.n_vertices;
    for (bool keep_shape : {true, false}) {
      keep_shape_ = keep_shape;
      queue_ = {};
      for (int v = 0; v < s_.mesh.n_vertices; ++v) push(v);
      while (active > target && !queue_.empty()) {
        const Candidate c = queue_.top();
        queue_.pop();
        if (c.version != version_[c.u]) continue;
        const Array<int> ring = mesh_.neighbours(c.u);
        if (!mesh_.may_collapse(c.u, c.v, ring)) {  // the ring of v has changed since
          push(c.u);
          continue;
        }
        quadric_[c.v] += quadric_[c.u];
        merged_[c.v] += merged_[c.u];
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
    bool operator<(const Candidate& o) const {  // a priority queue gives the largest first
      return cost != o.cost ? cost > o.cost : u > o.u;
    }
  };
  using Quadric = Eigen::Matrix4d;

  Vec3 point(int v) const { return s_.vertices.row(v); }

  void add_plane(int v, const Vec3& normal, const Vec3& p, double weight) {
    Eigen::Vector4d plane;
    plane << normal, -normal.dot(p);
    quadric_[v] += weight * plane * plane.transpose();
  }

  void compute_quadrics() {
    const HalfEdgeMesh& m = s_.mesh;
    quadric_.assign(m.n_vertices, Quadric::Zero());
    for (int h = 0; h < m.tail.size(); ++h) {
      const Vec3 p = point(m.tail[h]), q = point(m.tip(h)), r = point(m.tail[prev(h)]);
      const Vec3 normal = (q - p).cross(r - p).normalized();
      add_plane(m.tail[h], normal, p, s_.area[h / 3]);
      if (m.twin[h] >= 0) continue;
      const Vec3 side = normal.cross(q - p).normalized();
      for (int v : {m.tail[h], m.tip(h)}) add_plane(v, side, p, (q - p).squaredNorm());
    }
  }

  void push(int u) {
    ++version_[u];
    Candidate best{kInfinity, u, -1, version_[u]};
    const Array<int> ring = mesh_.neighbours(u);
    for (int v : ring) {
      const bool is_uniform = metric_ == Metric::kUniform;
      const double cost = is_uniform ? merging_cost(u, v) : collapse_cost(u, v);
      if (cost < best.cost && mesh_.may_collapse(u, v, ring) &&
          (is_uniform || shape_allows(u, v))) {
        best.cost = cost;
        best.v = v;
      }
    }
    if (best.v >= 0) queue_.push(best);
  }

  double merging_cost(int u, int v) const {
    constexpr int kRegular = 6;
    const int dead = mesh_.on_boundary(u) ? 1 : 2;
    const int valence = mesh_.faces_of[u].size() + mesh_.faces_of[v].size() - 2 * dead;
    return static_cast<double>(merged_[u] + merged_[v]) * (std::max)(valence, kRegular);
  }

  double collapse_cost(int u, int v) const {
    constexpr double kLength = 1e-3;    // share of the length, keeps flat regions even
    constexpr double kProtected = 1e6;  // times the squared area of the surface
    const Eigen::Vector4d target = point(v).homogeneous();
    const double length2 = (point(u) - point(v)).squaredNorm();
    const double cost = target.dot(quadric_[u] * target) + kLength * length2 * length2;
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
      if (n0.dot(n1) < kTurn * n0.norm() * n1.norm() || q1 < (std::min)(kQuality, q0)) return false;
    }
    return true;
  }

  Vec3 normal(const std::array<int, 3>& t) const {
    return (point(t[1]) - point(t[0])).cross(point(t[2]) - point(t[0]));
  }

  double quality(const std::array<int, 3>& t) const {
    const double sum = (point(t[1]) - point(t[0])).squaredNorm() +
                       (point(t[2]) - point(t[1])).squaredNorm() +
                       (point(t[0]) - point(t[2])).squaredNorm();
    return 2 * std::sqrt(3.0) * normal(t).norm() / sum;
  }

  const Surface& s_;
  const Array<char>& protected_;
  const Metric metric_;
  DynamicMesh& mesh_;
  Array<Quadric> quadric_;
  Array<int> version_;
  Array<int> merged_;  // per vertex, those it stands for
  std::priority_queue<Candidate> queue_;
  bool keep_shape_ = true;
};

// ---- symmetric Dirichlet energy of one or two embeddings, minimised by projected Newton ----

/// A penalty weight · |p - q|² between vertex a of the first and b of the second surface.
struct Spring {
  int a, b;
  double weight;
};

/// Embeddings of one or two surfaces that are relaxed together.
struct FlatProblem {
  std::vector<const Surface*> surfaces;
  std::vector<Spring> springs;
  Boundary boundary = Boundary::kFree;
  Array<Follower> followers = {};  // vertices of the first surface that follow the second
};

class FlatNewton {
 public:
  FlatNewton(const FlatProblem& problem, const Executor& executor)
      : problem_(problem), executor_(executor) {
    system_.pattern = within_pattern(problem.surfaces, 1);
  }

  /// At most `most` steps, until one lowers the energy by less than `tolerance` of it.
  void minimize(int most, double tolerance, std::vector<Points2>& x) {
    fix_boundaries(x);
    double energy = value(x);
    for (int i = 0; i < most; ++i) {
      const double before = energy;
      if (!step(x, energy) || before - energy < tolerance * energy) return;
    }
  }

  /// Moves the boundary of a single surface to where `target` has it, and the interior by the
  /// Newton step that goes with it; false, and nothing moved, if a triangle would lose most of its
  /// area. Boundary::kFixed only.
  bool drag(const Points2& target, std::vector<Points2>& x) {
    const HalfEdgeMesh& m = problem_.surfaces[0]->mesh;
    fix_boundaries(x);
    assemble(x);
    LinearSystem system = system_;
    Eigen::VectorXd prescribed = Eigen::VectorXd::Zero(system.gradient.size());
    for (int h : m.boundary)
      prescribed.segment<2>(2 * m.tail[h]) = row2(target, m.tail[h]) - row2(x[0], m.tail[h]);
    add_product(system.pattern, {&system.H, nullptr, 0}, prescribed, system.gradient);
    eliminate(is_fixed_, system);
    const Eigen::VectorXd d = solve(system, x) + prescribed;
    if (!d.allFinite()) return false;
    const std::vector<Points2> direction = per_surface(d, x);
    if (first_step(x, direction) < 1) return false;
    std::vector<Points2> y = {moved(x[0], direction[0], 1)};
    for (int h : m.boundary) y[0].row(m.tail[h]) = target.row(m.tail[h]);
    if (!is_injective(m, y[0]) || !(value(y) < kInfinity)) return false;
    x = y;
    return true;
  }

  double value(const std::vector<Points2>& x) const {
    double energy = 0;
    Array<Eigen::Matrix2d> J;
    for (std::size_t k = 0; k < x.size(); ++k)
      energy += embedding_energy(*problem_.surfaces[k], x[k], J);
    if (x.size() < 2) return energy;
    for (const Spring& s : problem_.springs)
      energy += s.weight * (row2(x[0], s.a) - row2(x[1], s.b)).squaredNorm();
    return energy;
  }

 private:
  enum class Outcome { kAccepted, kRejected, kCollision };

  int first_row(std::size_t k) const { return k == 0 ? 0 : problem_.surfaces[0]->mesh.n_vertices; }

  void fix_boundaries(const std::vector<Points2>& x) {
    is_fixed_.assign(2 * system_.pattern.rows(), 0);
    for (std::size_t k = 0; k < x.size(); ++k)
      hold_boundary(problem_.surfaces[k]->mesh, x[k], problem_.boundary, first_row(k), is_fixed_);
  }

  /// One projected Newton step with backtracking; false if nothing was gained. Once a trial has met
  /// the boundary, scaffolds keep it away.
  bool step(std::vector<Points2>& x, double& energy) {
    assemble(x);
    if (is_scaffolded_) build_scaffolds(x);
    bool collided = false;
    if (descend(x, energy, collided)) return true;
    if (is_scaffolded_ || !collided) return false;
    build_scaffolds(x);
    is_scaffolded_ = true;
    return descend(x, energy, collided);
  }

  void build_scaffolds(const std::vector<Points2>& x) {
    constexpr double kWeight = 1e-2;  // of all triangles of a scaffold, per area of its surface
    scaffolds_.clear();
    for (std::size_t k = 0; k < x.size(); ++k) {
      const Surface& s = *problem_.surfaces[k];
      scaffolds_.push_back(build_scaffold(s.mesh, x[k], kWeight * s.total_area));
    }
  }

  bool descend(std::vector<Points2>& x, double& energy, bool& collided) {
    constexpr int kMostTrials = 30;
    LinearSystem system = system_;
    merge_blocks(
        extra_blocks(), [](int, int) { return true; }, system);
    substitute(problem_.followers, system);
    eliminate(is_fixed_, system);
    Eigen::VectorXd d = solve(system, x);
    if (!d.allFinite()) return false;
    d = expanded(problem_.followers, d);
    const double slope = system_.gradient.dot(d);
    if (!(slope < 0)) return false;
    const std::vector<Points2> direction = per_surface(d, x);
    double s = first_step(x, direction);
    for (int i = 0; i < kMostTrials; ++i, s *= 0.6) {
      const Outcome outcome = try_step(direction, s, slope, x, energy);
      if (outcome == Outcome::kAccepted) return true;
      collided = collided || outcome == Outcome::kCollision;
      if (collided && !is_scaffolded_) return false;
    }
    return false;
  }

  /// The solution of a system, not finite if there is none.
  Eigen::VectorXd solve(const LinearSystem& system, const std::vector<Points2>& x) {
    Points2 positions(system.pattern.rows(), 2);
    for (std::size_t k = 0; k < x.size(); ++k)
      positions.middleRows(first_row(k), x[k].rows()) = x[k];
    const LdltSymbolic symbolic = NestedDissection(system.pattern, positions, executor_).build();
    ldlt_factorize(symbolic, {&system.H, nullptr, 0}, executor_, factor_);
    if (!factor_.ok) return Eigen::VectorXd::Constant(system.gradient.size(), kInfinity);
    return ldlt_solve(symbolic, factor_, -system.gradient);
  }

  std::vector<Points2> per_surface(const Eigen::VectorXd& d, const std::vector<Points2>& x) const {
    const Eigen::Map<const Eigen::Matrix<double, 2, Eigen::Dynamic>> columns(d.data(), 2,
                                                                             d.size() / 2);
    std::vector<Points2> parts;
    for (std::size_t k = 0; k < x.size(); ++k)
      parts.push_back(columns.middleCols(first_row(k), x[k].rows()).transpose());
    return parts;
  }

  /// A step of 1, or what the first triangle to degenerate leaves of it.
  double first_step(const std::vector<Points2>& x, const std::vector<Points2>& direction) const {
    double s = 1;
    for (std::size_t k = 0; k < x.size(); ++k) {
      s = (std::min)(s, 0.9 * max_step(problem_.surfaces[k]->mesh, x[k], direction[k]));
      if (is_scaffolded_)
        s = (std::min)(s, 0.9 * max_step(scaffolds_[static_cast<int>(k)], x[k], direction[k]));
    }
    return s;
  }

  Outcome try_step(const std::vector<Points2>& direction, double s, double slope,
                   std::vector<Points2>& x, double& energy) const {
    std::vector<Points2> y(x.size());
    for (std::size_t k = 0; k < x.size(); ++k) y[k] = moved(x[k], direction[k], s);
    if (!problem_.followers.empty()) place_followers(problem_.followers, y[0], y[1]);
    for (std::size_t k = 0; k < x.size(); ++k) {
      const HalfEdgeMesh& m = problem_.surfaces[k]->mesh;
      if (is_injective(m, y[k])) continue;
      return boundary_is_simple(m, y[k]) ? Outcome::kRejected : Outcome::kCollision;
    }
    const double e = value(y);
    double resistance = 0;
    for (std::size_t k = 0; is_scaffolded_ && k < x.size(); ++k)
      resistance += scaffold_energy(scaffolds_[static_cast<int>(k)], y[k]);
    if (!(e + resistance <= energy + 1e-4 * s * slope)) return Outcome::kRejected;
    x = y;
    energy = e;
    return Outcome::kAccepted;
  }

  void assemble(const std::vector<Points2>& x) {
    system_.gradient.setZero(2 * system_.pattern.rows());
    system_.H.assign(system_.pattern.blocks(), Eigen::Matrix2d::Zero());
    for (std::size_t k = 0; k < x.size(); ++k) assemble_surface(k, x[k]);
    for (const Spring& s : problem_.springs) {
      const Vec2 force = 2 * s.weight * (row2(x[0], s.a) - row2(x[1], s.b));
      system_.gradient.segment<2>(2 * s.a) += force;
      system_.gradient.segment<2>(2 * (first_row(1) + s.b)) -= force;
    }
  }

  /// The Hessians of springs and scaffolds.
  Array<ExtraBlock> extra_blocks() const {
    Array<ExtraBlock> blocks;
    for (const Spring& s : problem_.springs) {
      const int i = s.a, j = first_row(1) + s.b;
      const Eigen::Matrix2d stiffness = 2 * s.weight * Eigen::Matrix2d::Identity();
      blocks.push_back({i, i, stiffness, Eigen::Matrix2d::Zero()});
      blocks.push_back({j, j, stiffness, Eigen::Matrix2d::Zero()});
      blocks.push_back({i, j, -stiffness, Eigen::Matrix2d::Zero()});
    }
    for (int k = 0; is_scaffolded_ && k < scaffolds_.size(); ++k)
      add_scaffold(scaffolds_[k], first_row(static_cast<std::size_t>(k)), blocks);
    return blocks;
  }

  void assemble_surface(std::size_t k, const Points2& x) {
    constexpr double kEpsilon = 1e-6;  // holds rigid motions, which the energy leaves free
    const Surface& s = *problem_.surfaces[k];
    terms_.resize(s.mesh.n_faces);
    executor_.run_blocks(s.mesh.n_faces, 256, [&](int begin, int end) {
      embedding_terms(
          s, begin, end, kEpsilon, [&](int f) { return triangle_jacobian(s, x, f); }, terms_);
    });
    for (int f = 0; f < s.mesh.n_faces; ++f)
      scatter(s.mesh, f, first_row(k), terms_[f], system_.pattern, system_.H, system_.gradient);
  }

  const FlatProblem& problem_;
  const Executor& executor_;
  LinearSystem system_;
  Array<char> is_fixed_;  // two per row
  Array<FaceTerm> terms_;
  LdltFactor factor_;
  Array<Scaffold> scaffolds_;  // of each surface, where x was when they were built
  bool is_scaffolded_ = false;
};

// ---- one surface across all resolutions ----

/// The vertices and faces present at one resolution, renumbered.
struct Level {
  Surface surface;
  Array<int> vertex;  // its vertices in the full mesh
  Array<int> place;   // and back, -1 for vertices that are absent
};

/// The same mesh with every edge length raised to a power t in [0, 1], in all of a given area. From
/// t = 0, where all triangles are alike, to t = 1 the lengths of a triangle stay those of one:
/// c ≤ a + b implies c^t ≤ (a + b)^t ≤ a^t + b^t.
inline Surface softened(const Surface& s, double t, double total_area) {
  Surface soft = s;
  soft.total_area = 0;
  for (int f = 0; f < s.mesh.n_faces; ++f) {
    std::array<double, 3> length;
    for (int k = 0; k < 3; ++k) {
      const int u = s.mesh.corner(f, k), v = s.mesh.corner(f, (k + 1) % 3);
      const double l = (s.vertices.row(v) - s.vertices.row(u)).norm();
      length[static_cast<std::size_t>(k)] = std::pow(l, t);
    }
    const Eigen::Matrix2d R = rest_frame(length);
    soft.area[f] = 0.5 * R.determinant();
    soft.rest_inverse[f] = R.inverse();
    soft.total_area += soft.area[f];
  }
  const double scale = total_area / soft.total_area;
  for (int f = 0; f < s.mesh.n_faces; ++f) {
    soft.area[f] *= scale;
    soft.rest_inverse[f] /= std::sqrt(scale);
  }
  soft.total_area = total_area;
  return soft;
}

/// Clips a convex polygon by the half-plane left of p → q.
inline std::vector<Vec2> clip(const std::vector<Vec2>& polygon, const Vec2& p, const Vec2& q) {
  std::vector<Vec2> result;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec2 a = polygon[i], b = polygon[(i + 1) % polygon.size()];
    const double side_a = cross(q - p, a - p), side_b = cross(q - p, b - p);
    if (side_a >= 0) result.push_back(a);
    if ((side_a > 0 && side_b < 0) || (side_a < 0 && side_b > 0))
      result.push_back(a + side_a / (side_a - side_b) * (b - a));
  }
  return result;
}

/// Places on a circle for the boundary vertices of a mesh, at even distances.
inline Array<double> even_angles(const HalfEdgeMesh& m) {
  Array<double> angle(m.n_vertices, 0);
  for (int i = 0; i < m.boundary.size(); ++i)
    angle[m.tail[m.boundary[i]]] = 2 * kPi * i / m.boundary.size();
  return angle;
}

class Hierarchy {
 public:
  static constexpr int kBase = 50;  // vertices of the coarsest mesh

  /// `angle`: where boundary vertices go on the circle, in the uniform metric.
  Hierarchy(const Surface& s, const Array<char>& is_protected, Metric metric,
            const Array<double>& angle)
      : s_(s),
        metric_(metric),
        angle_(angle),
        mesh_(s.mesh),
        x_(Points2::Zero(s.mesh.n_vertices, 2)) {
    collapses_ = Decimation(s, is_protected, metric, mesh_).run(kBase);
  }

  int active() const { return s_.mesh.n_vertices - collapses_.size(); }
  bool has(int v) const { return !mesh_.faces_of[v].empty(); }
  bool is_full() const { return collapses_.empty(); }

  /// Embeds the coarsest mesh by Tutte's theorem: boundary on a circle, every other vertex the
  /// mean of its neighbours.
  bool embed_base() {
    const Level level = current();
    const HalfEdgeMesh& m = level.surface.mesh;
    Eigen::MatrixXd L = Eigen::MatrixXd::Zero(m.n_vertices, m.n_vertices);
    Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(m.n_vertices, 2);
    for (int h = 0; h < m.tail.size(); ++h) {
      const int u = m.tail[h], v = m.tip(h);
      if (m.on_boundary(u)) continue;
      L(u, u) += 1;
      L(u, v) -= 1;
    }
    const double radius = std::sqrt(s_.total_area / kPi);
    for (int i = 0; i < m.boundary.size(); ++i) {
      const int u = m.tail[m.boundary[i]];
      const double angle =
          metric_ == Metric::kUniform ? angle_[level.vertex[u]] : 2 * kPi * i / m.boundary.size();
      L(u, u) = 1;
      rhs.row(u) << radius * std::cos(angle), radius * std::sin(angle);
    }
    const Points2 x = L.partialPivLu().solve(rhs);
    if (!is_injective(m, x)) return false;
    set(level, x);
    return true;
  }

  Level current() const {
    Level level;
    level.place.assign(s_.mesh.n_vertices, -1);
    for (int v = 0; v < s_.mesh.n_vertices; ++v) {
      if (!has(v)) continue;
      level.place[v] = level.vertex.size();
      level.vertex.push_back(v);
    }
    int n_faces = 0;
    for (char alive : mesh_.alive) n_faces += alive;
    TriangleMesh compact;
    compact.vertices.resize(level.vertex.size(), 3);
    compact.triangles.resize(n_faces, 3);
    for (int i = 0; i < level.vertex.size(); ++i)
      compact.vertices.row(i) = s_.vertices.row(level.vertex[i]);
    for (int f = 0, row = 0; f < mesh_.face.size(); ++f)
      if (mesh_.alive[f]) {
        for (int k = 0; k < 3; ++k)
          compact.triangles(row, k) = level.place[mesh_.face[f][static_cast<std::size_t>(k)]];
        ++row;
      }
    level.surface = build_surface(compact, true);
    return level;
  }

  Points2 positions(const Level& level) const {
    Points2 x(level.vertex.size(), 2);
    for (int i = 0; i < level.vertex.size(); ++i) x.row(i) = x_.row(level.vertex[i]);
    return x;
  }
  void set(const Level& level, const Points2& x) {
    for (int i = 0; i < level.vertex.size(); ++i) x_.row(level.vertex[i]) = x.row(i);
  }
  const Points2& positions() const { return x_; }
  double total_area() const { return s_.total_area; }
  /// Moves the plane, unless rounding would cost the injectivity of so thin an embedding.
  void move(const RigidMotion& motion) {
    const Level level = current();
    if (!is_injective(level.surface.mesh, transformed(positions(level), motion))) return;
    x_ = transformed(x_, motion);
  }

  /// The mean position of the present vertices.
  Vec2 center() const { return positions(current()).colwise().mean().transpose(); }

  /// Brings vertices back until `target` are present; the id of one without room, or -1.
  int refine(int target) {
    while (!is_full() && active() < target) {
      const Collapse c = collapses_.back();
      collapses_.pop_back();
      local_metric_ = local_metric(c.changed);
      mesh_.undo(c);
      if (!place(c)) return c.u;
    }
    return -1;
  }

 private:
  /// The opposite edge p → q of vertex u in a face.
  std::pair<int, int> opposite(int f, int u) const {
    const auto& t = mesh_.face[f];
    const std::size_t k = t[0] == u ? 0 : t[1] == u ? 1 : 2;
    return {t[(k + 1) % 3], t[(k + 2) % 3]};
  }

  Eigen::Matrix2d rest(int a, int b, int c) const {
    if (metric_ == Metric::kUniform) return rest_frame({1.0, 1.0, 1.0});
    return rest_frame(s_.vertices.row(a), s_.vertices.row(b), s_.vertices.row(c));
  }

  /// S^(-1/2) for the mean S of J Jᵀ over some faces, the metric in which their images look nearly
  /// isometric: what returns between them is to fit in, however strained the embedding is there.
  Eigen::Matrix2d local_metric(const Array<int>& faces) const {
    if (faces.empty()) return Eigen::Matrix2d::Identity();
    Eigen::Matrix2d S = Eigen::Matrix2d::Zero();
    double total = 0;
    for (int f : faces) {
      const auto& t = mesh_.face[f];
      const Eigen::Matrix2d R = rest(t[0], t[1], t[2]);
      const Eigen::Matrix2d J =
          jacobian(row2(x_, t[0]), row2(x_, t[1]), row2(x_, t[2]), R.inverse());
      S += 0.5 * R.determinant() * J * J.transpose();
      total += 0.5 * R.determinant();
    }
    S /= total;
    // S^(1/2) = (S + √det S I) / √(tr S + 2 √det S), by Cayley and Hamilton.
    const double root = std::sqrt(S.determinant());
    const Eigen::Matrix2d metric =
        (S + root * Eigen::Matrix2d::Identity()).inverse() * std::sqrt(S.trace() + 2 * root);
    return metric.allFinite() ? metric : Eigen::Matrix2d::Identity();
  }

  /// Puts u into the kernel of its ring. The neighbour v it was merged with sees the whole ring,
  /// so points between v and the centre of the kernel are in the kernel too. On the boundary other
  /// parts of it may be in the way; then u goes inside of the edge it splits, or, if it has but one
  /// triangle, close to the middle of that edge.
  bool place(const Collapse& c) {
    if (metric_ == Metric::kUniform && mesh_.on_boundary(c.u)) return place_on_circle(c);
    const Vec2 corner = row2(x_, c.v);
    if (place_on_ray(c.u, corner, kernel_center(c.u))) return true;
    if (!mesh_.on_boundary(c.u)) return false;
    if (!c.changed.empty()) return place_on_ray(c.u, corner, fan_center(c));
    const Vec2 p = row2(x_, mesh_.boundary_prev[c.u]), q = row2(x_, mesh_.boundary_next[c.u]);
    const Vec2 middle = 0.5 * (p + q);
    return place_on_ray(c.u, middle, middle + 0.5 * perp(q - p));
  }

  /// The angle from u on to v, on the full boundary.
  double angle_between(int u, int v) const {
    const double angle = angle_[v] - angle_[u];
    return angle > 0 ? angle : angle + 2 * kPi;
  }

  /// Puts u on the arc that its boundary edge cut off, at its angle, or as close to v as its
  /// triangles demand.
  bool place_on_circle(const Collapse& c) {
    const int before = mesh_.boundary_prev[c.u], after = mesh_.boundary_next[c.u];
    const double to_u = angle_between(before, c.u), from_u = angle_between(c.u, after);
    const Vec2 p = row2(x_, before), q = row2(x_, after);
    double arc = std::atan2(cross(p, q), p.dot(q));
    if (arc < 0) arc += 2 * kPi;
    const double ideal = arc * to_u / (to_u + from_u);
    double t = 1;
    for (int i = 0; i < kMostHalvings; ++i, t *= 0.5) {
      const double angle = c.v == before ? t * ideal : arc - t * (arc - ideal);
      x_.row(c.u) = (Eigen::Rotation2Dd(angle) * p).transpose();
      if (fits(c.u)) return true;
    }
    return false;
  }

  bool place_on_ray(int u, const Vec2& from, const Vec2& to) {
    double t = 1;
    for (int i = 0; i < kMostHalvings; ++i, t *= 0.5) {
      x_.row(u) = (from + t * (to - from)).transpose();
      if (!fits(u)) continue;
      relax(u);
      return true;
    }
    return false;
  }

  /// The centre of the largest triangle that v had in the place of u.
  Vec2 fan_center(const Collapse& c) const {
    const Vec2 corner = row2(x_, c.v);
    double largest = -kInfinity;
    Vec2 center = corner;
    for (int f : c.changed) {
      const auto edge = opposite(f, c.u);
      const Vec2 p = row2(x_, edge.first), q = row2(x_, edge.second);
      const double area = cross(p - corner, q - corner);
      if (area <= largest) continue;
      largest = area;
      center = (corner + p + q) / 3;
    }
    return center;
  }

  Vec2 kernel_center(int u) const {
    Vec2 lo = Vec2::Constant(kInfinity), hi = -lo;
    for (int f : mesh_.faces_of[u]) {
      const auto edge = opposite(f, u);
      for (int w : {edge.first, edge.second}) {
        lo = lo.cwiseMin(row2(x_, w));
        hi = hi.cwiseMax(row2(x_, w));
      }
    }
    const Vec2 margin = Vec2::Constant(mesh_.on_boundary(u) ? 0.5 * (hi - lo).maxCoeff() : 0);
    lo -= margin, hi += margin;
    std::vector<Vec2> kernel = {lo, Vec2(hi.x(), lo.y()), hi, Vec2(lo.x(), hi.y())};
    for (int f : mesh_.faces_of[u]) {
      const auto edge = opposite(f, u);
      const std::vector<Vec2> rest = clip(kernel, row2(x_, edge.first), row2(x_, edge.second));
      if (rest.size() >= 3) kernel = rest;  // else rounding: keep what there is
    }
    Vec2 center = Vec2::Zero();
    for (const Vec2& p : kernel) center += p / static_cast<double>(kernel.size());
    return center;
  }

  /// True if all triangles of u are positive and the boundary stays simple.
  bool fits(int u) const {
    for (int c = 0; c < 2; ++c)
      if (x_(u, c) != flush_tiny(x_(u, c))) return false;
    for (int f : mesh_.faces_of[u]) {
      const auto edge = opposite(f, u);
      if (!(orient2d(row2(x_, u), row2(x_, edge.first), row2(x_, edge.second)) > 0)) return false;
    }
    return !mesh_.on_boundary(u) || boundary_fits(u);
  }

  bool boundary_fits(int u) const {
    const int before = mesh_.boundary_prev[u], after = mesh_.boundary_next[u];
    const Vec2 p = row2(x_, before), q = row2(x_, u), r = row2(x_, after);
    if (turns_back(p, q, r)) return false;
    for (int w = after; w != before; w = mesh_.boundary_next[w]) {
      const int z = mesh_.boundary_next[w];
      const Vec2 s = row2(x_, w), t = row2(x_, z);
      if (w == after ? turns_back(q, s, t) : segments_touch(q, r, s, t)) return false;
      if (z == before ? turns_back(s, t, q) : segments_touch(p, q, s, t)) return false;
    }
    return true;
  }

  /// The symmetric Dirichlet energy of the triangles of u, in the metric around it.
  double ring_energy(int u, Vec2& gradient, Eigen::Matrix2d& hessian) const {
    double energy = 0;
    gradient.setZero();
    hessian.setZero();
    for (int f : mesh_.faces_of[u]) {
      const auto edge = opposite(f, u);
      const Eigen::Matrix2d R = rest(u, edge.first, edge.second), inverse = R.inverse();
      const Eigen::Matrix2d J =
          jacobian(row2(x_, u), row2(x_, edge.first), row2(x_, edge.second), inverse);
      const TriangleDerivatives d =
          triangle_derivatives(local_metric_ * J, inverse, 0.5 * R.determinant());
      energy += d.value;
      gradient += local_metric_ * d.gradient.head<2>();
      hessian += local_metric_ * d.hessian.topLeftCorner<2, 2>() * local_metric_;
    }
    return energy;
  }

  /// A symmetric matrix with its eigenvalues raised to at least ε.
  static Eigen::Matrix2d at_least(const Eigen::Matrix2d& H, double epsilon) {
    const double mean = 0.5 * H.trace(), radius = std::hypot(0.5 * (H(0, 0) - H(1, 1)), H(0, 1));
    if (mean - radius >= epsilon) return H;
    const double largest = (std::max)(mean + radius, epsilon);
    Eigen::Matrix2d axis = Eigen::Matrix2d::Zero();  // 1 and -1 along the eigenvectors
    if (radius > 0) axis = (H - mean * Eigen::Matrix2d::Identity()) / radius;
    return 0.5 * (largest + epsilon) * Eigen::Matrix2d::Identity() +
           0.5 * (largest - epsilon) * axis;
  }

  /// A few Newton steps of u alone.
  void relax(int u) {
    constexpr int kSteps = 6, kMostTrials = 12;
    Vec2 gradient, unused;
    Eigen::Matrix2d hessian, unused_hessian;
    double energy = ring_energy(u, gradient, hessian);
    for (int i = 0; i < kSteps; ++i) {
      hessian = at_least(hessian, 1e-6 * hessian.norm());
      const Vec2 d = -hessian.inverse() * gradient, from = row2(x_, u);
      if (!d.allFinite()) return;
      bool gained = false;
      double s = 1;
      for (int k = 0; k < kMostTrials && !gained; ++k, s *= 0.5) {
        x_.row(u) = (from + s * d).transpose();
        gained = fits(u) && ring_energy(u, unused, unused_hessian) < energy;
      }
      if (!gained) return void(x_.row(u) = from.transpose());
      energy = ring_energy(u, gradient, hessian);
    }
  }

  static constexpr int kMostHalvings = 44;  // what is left after them is no room

  const Surface& s_;
  const Metric metric_;
  const Array<double> angle_;  // per vertex of the full mesh
  DynamicMesh mesh_;
  Points2 x_;
  Array<Collapse> collapses_;
  Eigen::Matrix2d local_metric_ = Eigen::Matrix2d::Identity();  // around the next vertex
};

// ---- both boundaries on one square ----

/// The boundary of a mesh along the outline of a square around the origin: u from k to k + 1 is
/// side k, all counter-clockwise.
struct Outline {
  double half_side = 0;
  std::array<int, 4> corner;  // the vertices at u = 0, 1, 2 and 3
  Array<double> u;            // per vertex, -1 off the boundary

  /// A part of the way from places at even distances between the corners (0) to u (1).
  Array<double> places(const HalfEdgeMesh& m, double part) const {
    if (part == 1) return u;
    Array<double> result(u.size(), -1);
    const int n = m.boundary.size();
    const auto vertex = [&](int i) { return m.tail[m.boundary[i % n]]; };
    int i = 0;
    while (vertex(i) != corner[0]) ++i;
    for (int k = 0; k < 4; ++k) {
      int edges = 1;
      while (vertex(i + edges) != corner[static_cast<std::size_t>((k + 1) % 4)]) ++edges;
      for (int j = 0; j < edges; ++j) {
        const int v = vertex(i + j);
        const double even = k + j / static_cast<double>(edges);
        result[v] = even + part * (u[v] - even);
      }
      i += edges;
    }
    return result;
  }

  Vec2 point(double u_at) const {
    const int side = static_cast<int>(u_at);
    const double along = half_side * (2 * (u_at - side) - 1);
    switch (side % 4) {
      case 0:
        return Vec2(along, -half_side);
      case 1:
        return Vec2(half_side, along);
      case 2:
        return Vec2(-along, half_side);
      default:
        return Vec2(-half_side, -along);
    }
  }
};

/// x modulo 1, in [0, 1).
inline double fraction(double x) {
  const double r = x - std::floor(x);
  return r < 1 ? r : 0;
}

/// The arc length of every boundary vertex from a first one on, in units of the whole; -1 for
/// others.
inline Array<double> boundary_arcs(const Surface& s, int first) {
  Array<double> arc(s.mesh.n_vertices, -1);
  double sum = 0;
  for (int h : s.mesh.boundary) {
    arc[s.mesh.tail[h]] = sum;
    sum += (s.vertices.row(s.mesh.tip(h)) - s.vertices.row(s.mesh.tail[h])).norm();
  }
  const double offset = arc[first];
  for (int h : s.mesh.boundary) {
    double& a = arc[s.mesh.tail[h]];
    a = fraction((a - offset) / sum);
  }
  return arc;
}

/// The landmarks with both vertices on the boundaries, sorted along that of A.
inline std::vector<Landmark> boundary_landmarks(const SurfacePair& pair,
                                                const std::vector<Landmark>& landmarks) {
  std::vector<Landmark> result;
  for (const Landmark& l : landmarks)
    if (pair.a.mesh.on_boundary(l.a) && pair.b.mesh.on_boundary(l.b)) result.push_back(l);
  const Array<double> arc = boundary_arcs(pair.a, pair.a.mesh.tail[pair.a.mesh.boundary[0]]);
  std::sort(result.begin(), result.end(),
            [&](const Landmark& l, const Landmark& k) { return arc[l.a] < arc[k.a]; });
  return result;
}

/// True if the landmarks on the boundaries follow each other in the same order on A and on B.
inline bool check_order(const SurfacePair& pair, const std::vector<Landmark>& landmarks,
                        Embedding& result) {
  const std::vector<Landmark> sorted = boundary_landmarks(pair, landmarks);
  const Array<double> arc = boundary_arcs(pair.b, pair.b.mesh.tail[pair.b.mesh.boundary[0]]);
  double around = 0;
  for (std::size_t i = 0; i < sorted.size(); ++i)
    around += fraction(arc[sorted[(i + 1) % sorted.size()].b] - arc[sorted[i].b]);
  if (around < 1.5) return true;
  std::string message = "the landmarks on the boundaries are in different order on A and B:";
  std::vector<int> ids;
  for (const Landmark& l : sorted) {
    message += " " + std::to_string(l.a) + "-" + std::to_string(l.b);
    ids.push_back(l.a);
  }
  return fail(result, Status::kInvalidLandmarks, message + "; is one mesh mirrored?", ids);
}

/// A place on the boundary of A and one on that of B that correspond, in arc length.
struct Match {
  double a, b;
};

/// The arc on B that corresponds to one on A: in proportion between the matches around it, which
/// are sorted.
inline double matching_arc(const std::vector<Match>& matches, double a) {
  std::size_t i = matches.size() - 1;
  while (i > 0 && matches[i].a > a) --i;
  if (matches[i].a > a) i = matches.size() - 1;
  const Match &from = matches[i], &to = matches[(i + 1) % matches.size()];
  const double gap_a = fraction(to.a - from.a), gap_b = fraction(to.b - from.b);
  const double t = fraction(a - from.a) / (gap_a > 0 ? gap_a : 1);
  return fraction(from.b + t * (gap_b > 0 ? gap_b : 1));
}

/// Lays both boundaries along one square: finds what corresponds, chooses four pairs of vertices as
/// corners, and adds vertices where the meshes need them for it.
class OutlineBuilder {
 public:
  OutlineBuilder(SurfacePair& pair, const std::vector<Landmark>& landmarks)
      : pair_(pair),
        landmarks_(boundary_landmarks(pair, landmarks)),
        first_a_(pair.a.mesh.tail[pair.a.mesh.boundary[0]]),
        first_b_(pair.b.mesh.tail[pair.b.mesh.boundary[0]]) {
    measure();
  }

  /// True if landmarks tell how the boundaries correspond.
  bool has_landmarks() const { return !landmarks_.empty(); }

  /// Without landmarks: the correspondence by arc length that brings the boundaries of two
  /// embeddings closest to each other.
  void match_closest(const Points2& f, const Points2& g) {
    const Points2 on_a = sample(pair_.a.mesh, arc_a_, first_a_, f, 0);
    const auto distance = [&](double shift) {
      return (on_a - sample(pair_.b.mesh, arc_b_, first_b_, g, shift)).squaredNorm();
    };
    const Points2 on_b = sample(pair_.b.mesh, arc_b_, first_b_, g, 0);
    double shift = 0, least = kInfinity;
    for (int k = 0; k < kSamples; ++k) {
      double sum = 0;
      for (int i = 0; i < kSamples; ++i)
        sum += (on_a.row(i) - on_b.row((i + k) % kSamples)).squaredNorm();
      if (sum >= least) continue;
      least = sum;
      shift = k / double{kSamples};
    }
    for (double step = 0.5 / kSamples; step > 1e-6; step *= 0.5)
      for (const double candidate : {shift - step, shift + step}) {
        const double sum = distance(candidate);
        if (sum >= least) continue;
        least = sum;
        shift = candidate;
      }
    matches_ = {{0, fraction(shift)}};
  }

  /// The outlines of A and B.
  std::array<Outline, 2> build() {
    std::array<Outline, 2> outlines;
    Outline &a = outlines[0], &b = outlines[1];
    a.half_side = b.half_side = 0.5 * std::sqrt(0.5 * pair_.total_area());
    for (std::size_t k = 0; k < 4; ++k) {
      Landmark corner = {};
      while (!find_corner(static_cast<int>(k), corner)) measure();
      a.corner[k] = corner.a;
      b.corner[k] = corner.b;
    }
    place(a, b);
    split_chords(a.u, pair_.a);
    split_chords(b.u, pair_.b);
    return outlines;
  }

 private:
  /// A boundary vertex and its arc, relative to that of a corner.
  struct Candidate {
    double offset;
    int vertex;
    bool operator<(const Candidate& o) const { return offset < o.offset; }
  };

  void measure() {
    arc_a_ = boundary_arcs(pair_.a, first_a_);
    arc_b_ = boundary_arcs(pair_.b, first_b_);
    if (!has_landmarks()) return;
    matches_.clear();
    for (const Landmark& l : landmarks_) matches_.push_back({arc_a_[l.a], arc_b_[l.b]});
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
      points.row(i) = (1 - t) * x.row(m.tail[h]) + t * x.row(m.tip(h));
    }
    return points;
  }

  /// The boundary vertices in the quarter of the boundary around a place.
  template <class ArcOf>
  static std::vector<Candidate> around(const HalfEdgeMesh& m, double center, const ArcOf& arc_of) {
    std::vector<Candidate> candidates;
    for (int h : m.boundary) {
      const double offset = fraction(arc_of(m.tail[h]) - center + 0.5) - 0.5;
      if (std::abs(offset) < 0.125) candidates.push_back({offset, m.tail[h]});
    }
    std::sort(candidates.begin(), candidates.end());
    return candidates;
  }

  /// The edge of a boundary on which a place lies.
  template <class ArcOf>
  static Midpoint edge_at(const HalfEdgeMesh& m, double center, const ArcOf& arc_of) {
    int best = m.boundary[0];
    for (int h : m.boundary)
      if (fraction(center - arc_of(m.tail[h])) < fraction(center - arc_of(m.tail[best]))) best = h;
    return {m.tail[best], m.tip(best)};
  }

  /// Finds the pair of vertices for corner k: a landmark if there is one in its quarter, else two
  /// that match best. False if a mesh had no vertex there and got one.
  bool find_corner(int k, Landmark& corner) {
    const double center = matches_[0].b + k / 4.0;
    const auto on_a = [&](int v) { return matching_arc(matches_, arc_a_[v]); };
    const auto on_b = [&](int v) { return arc_b_[v]; };
    const std::vector<Candidate> a = around(pair_.a.mesh, center, on_a);
    const std::vector<Candidate> b = around(pair_.b.mesh, center, on_b);
    if (a.empty()) split_edges({edge_at(pair_.a.mesh, center, on_a)}, pair_.a);
    if (b.empty()) split_edges({edge_at(pair_.b.mesh, center, on_b)}, pair_.b);
    if (a.empty() || b.empty()) return false;
    if (!nearest_landmark(a, corner)) best_pair(a, b, corner);
    return true;
  }

  bool nearest_landmark(const std::vector<Candidate>& a, Landmark& corner) const {
    double least = kInfinity;
    for (const Candidate& c : a)
      for (const Landmark& l : landmarks_) {
        if (l.a != c.vertex || std::abs(c.offset) >= least) continue;
        least = std::abs(c.offset);
        corner = l;
      }
    return least < kInfinity;
  }

  static void best_pair(const std::vector<Candidate>& a, const std::vector<Candidate>& b,
                        Landmark& corner) {
    constexpr double kCentred = 0.01;  // weight of the distance from the ideal place
    double least = kInfinity;
    for (const Candidate& c : b) {
      auto next = std::lower_bound(a.begin(), a.end(), c);
      for (auto it = next == a.begin() ? next : next - 1; it != a.end() && it <= next; ++it) {
        const double cost = std::abs(it->offset - c.offset) + kCentred * std::abs(c.offset);
        if (cost >= least) continue;
        least = cost;
        corner = {it->vertex, c.vertex};
      }
    }
  }

  /// Places all boundary vertices: those of B by arc length between the corners, those of A where
  /// their matches are.
  void place(Outline& a, Outline& b) {
    if (!has_landmarks()) matches_.clear();
    for (std::size_t k = 0; k < 4; ++k)
      if (!is_landmark(a.corner[k])) matches_.push_back({arc_a_[a.corner[k]], arc_b_[b.corner[k]]});
    std::sort(matches_.begin(), matches_.end(),
              [](const Match& m, const Match& n) { return m.a < n.a; });
    const auto u_of = [&](double arc) {
      std::size_t k = 0;
      for (std::size_t i = 1; i < 4; ++i)
        if (fraction(arc - arc_b_[b.corner[i]]) < fraction(arc - arc_b_[b.corner[k]])) k = i;
      const double from = arc_b_[b.corner[k]], to = arc_b_[b.corner[(k + 1) % 4]];
      return static_cast<double>(k) + fraction(arc - from) / fraction(to - from);
    };
    a.u.assign(pair_.n_a(), -1);
    b.u.assign(pair_.n_b(), -1);
    for (int h : pair_.a.mesh.boundary) {
      const int v = pair_.a.mesh.tail[h];
      a.u[v] = u_of(matching_arc(matches_, arc_a_[v]));
    }
    for (int h : pair_.b.mesh.boundary) {
      const int v = pair_.b.mesh.tail[h];
      b.u[v] = u_of(arc_b_[v]);
    }
  }

  bool is_landmark(int a) const {
    return std::any_of(landmarks_.begin(), landmarks_.end(),
                       [&](const Landmark& l) { return l.a == a; });
  }

  /// True if two places are on one side; corners are on two.
  static bool share_side(double u, double v) {
    const int i = static_cast<int>(u), j = static_cast<int>(v);
    return i == j || (u == i && (i + 3) % 4 == j) || (v == j && (j + 3) % 4 == i);
  }

  /// Halves all inner edges between boundary vertices of one side, which would lie in the outline.
  static void split_chords(Array<double>& u, Surface& s) {
    std::vector<Midpoint> chords;
    for (int h = 0; h < s.mesh.tail.size(); ++h) {
      if (s.mesh.twin[h] < h) continue;
      const int v = s.mesh.tail[h], w = s.mesh.tip(h);
      if (u[v] >= 0 && u[w] >= 0 && share_side(u[v], u[w])) chords.push_back({v, w});
    }
    split_edges(chords, s);
    while (u.size() < s.mesh.n_vertices) u.push_back(-1);
  }

  SurfacePair& pair_;
  std::vector<Landmark> landmarks_;  // with both vertices on the boundaries
  std::vector<Match> matches_;       // sorted along A
  Array<double> arc_a_, arc_b_;
  const int first_a_, first_b_;  // where arcs begin
};

// ---- both surfaces ----

constexpr double kStiffest = 1000.0;  // total weight of the landmark penalties
constexpr int kMostSteps = 30;        // Newton steps per level
constexpr double kTolerance = 1e-3;   // relative decrease per step that ends a level

/// Reports progress; false if the callback cancels.
inline bool tell(const Options& options, const std::string& what, Embedding& result) {
  if (!options.progress) return true;
  Progress progress;
  progress.phase = Progress::Phase::kEmbedding;
  progress.what = what;
  return options.progress(progress) ||
         fail(result, Status::kAborted, "cancelled during the initial embedding");
}

/// The vertex of A on that of B, written as a point of a triangle around it.
inline Follower landmark_follower(const SurfacePair& pair, const Landmark& l) {
  Follower follower = {l.a, {}, Vec3::Zero()};
  bool found = false;
  pair.b.mesh.for_each_outgoing(l.b, [&](int h) {
    if (found) return;
    found = true;
    follower.weight = Vec3::Unit(h % 3);
    for (int k = 0; k < 3; ++k)
      follower.master[static_cast<std::size_t>(k)] = pair.n_a() + pair.b.mesh.corner(h / 3, k);
  });
  return follower;
}

/// The centre of that triangle which lies farthest from the boundary.
inline Vec2 deepest_point(const HalfEdgeMesh& m, const Points2& x) {
  Vec2 deepest = Vec2::Zero();
  double largest = -1;
  for (int f = 0; f < m.n_faces; ++f) {
    const Vec2 p =
        (row2(x, m.corner(f, 0)) + row2(x, m.corner(f, 1)) + row2(x, m.corner(f, 2))) / 3;
    double depth = kInfinity;
    for (int h : m.boundary) {
      const Vec2 u = row2(x, m.tail[h]), edge = row2(x, m.tip(h)) - u;
      const double t = std::clamp((p - u).dot(edge) / edge.squaredNorm(), 0.0, 1.0);
      depth = (std::min)(depth, (p - u - t * edge).norm());
    }
    if (depth <= largest) continue;
    largest = depth;
    deepest = p;
  }
  return deepest;
}

/// The embedding of a pair. In the metric of the surfaces: each alone up to a coarse level, where
/// the planes are brought together; then both, tied by the landmarks, up to the full meshes. Where
/// the planes meet decides the isotopy class of the map around the landmarks, and limbs that have
/// unfolded freely before decide it better than limbs that are pulled while they unfold. In the
/// uniform metric nothing has unfolded before all vertices are there, so all of this comes last.
/// With outlines, which are in the uniform metric, boundaries are dragged there from the circle,
/// and that is where the planes meet.
class PairEmbedder {
 public:
  PairEmbedder(const SurfacePair& pair, const std::vector<Landmark>& landmarks,
               const Options& options, Metric metric, const std::array<Outline, 2>* outlines)
      : pair_(pair),
        landmarks_(landmarks),
        options_(options),
        metric_(metric),
        outlines_(outlines),
        executor_(options) {}

  void run(Embedding& result) {
    Array<char> keep_a(pair_.n_a(), 0), keep_b(pair_.n_b(), 0);
    for (const Landmark& l : landmarks_) keep_a[l.a] = keep_b[l.b] = 1;
    Hierarchy a(pair_.a, keep_a, metric_, boundary_angles(pair_.a.mesh, outline(0)));
    Hierarchy b(pair_.b, keep_b, metric_, boundary_angles(pair_.b.mesh, outline(1)));
    const bool is_uniform = metric_ == Metric::kUniform;
    if (!tell(options_, is_uniform ? "once more, by connectivity alone" : "decimated the meshes",
              result))
      return;
    if (!embed_base(a, "A", result) || !embed_base(b, "B", result)) return;
    if (!(is_uniform ? meet_last(a, b, result) : meet_early(a, b, result))) return;
    if (outlines_ == nullptr) make_overlap(a, b);
    result.f = a.positions();
    result.g = b.positions();
  }

 private:
  static constexpr int kTrial = 800;           // vertices at which rotations are tried
  static constexpr int kTrialIterations = 20;  // of Algorithm 1 for each
  static constexpr int kCoarse = 3200;         // and at which landmarks begin to pull
  static constexpr int kUnfoldingSteps = 500;  // per stage: winding outlines take many
  static constexpr double kUnfoldingTolerance = 1e-4;

  bool meet_early(Hierarchy& a, Hierarchy& b, Embedding& result) const {
    if (!embed_alone(a, "A", kTrial, result) || !embed_alone(b, "B", kTrial, result)) return false;
    if (landmarks_.size() < 2 && !align_by_trial(a, b, kTrialIterations, result)) return false;
    if (!embed_alone(a, "A", kCoarse, result) || !embed_alone(b, "B", kCoarse, result))
      return false;
    bring_together(a, b);
    while (!a.is_full() || !b.is_full()) {
      if (!tell(options_,
                "embedding both: " + std::to_string(a.active()) + " + " +
                    std::to_string(b.active()) + " vertices",
                result))
        return false;
      if (!grow(a, "A", result) || !grow(b, "B", result)) return false;
      relax(a, b, kStiffest);
    }
    return true;
  }

  bool meet_last(Hierarchy& a, Hierarchy& b, Embedding& result) const {
    if (!embed_alone(a, "A", pair_.n_a(), result) || !embed_alone(b, "B", pair_.n_b(), result))
      return false;
    if (!unfold(a, pair_.a, outline(0), "A", result) ||
        !unfold(b, pair_.b, outline(1), "B", result))
      return false;
    if (outlines_ == nullptr && landmarks_.size() < 2 && !align_by_trial(a, b, 0, result))
      return false;
    bring_together(a, b);
    return true;
  }

  /// What the boundaries may do once they have left the circle.
  Boundary boundary() const { return outlines_ == nullptr ? Boundary::kFree : options_.boundary; }

  const Outline* outline(std::size_t mesh) const {
    return outlines_ == nullptr ? nullptr : &(*outlines_)[mesh];
  }

  /// Where boundary vertices go on the circle: evenly, between corners if there are any.
  static Array<double> boundary_angles(const HalfEdgeMesh& m, const Outline* outline) {
    Array<double> angle = even_angles(m);
    if (outline == nullptr) return angle;
    const Array<double> even = outline->places(m, 0);
    for (int h : m.boundary) {
      const Vec2 p = outline->point(even[m.tail[h]]);
      angle[m.tail[h]] = std::atan2(p.y(), p.x());
    }
    return angle;
  }

  /// Where a boundary vertex is at t, from 0 to 1, on its way from p to q.
  using Way = Vec2 (*)(const Vec2& p, const Vec2& q, double t, const Outline& outline);

  /// Drags the boundary of a surface to the places u on an outline.
  bool drag(const Surface& s, const Outline& outline, const Array<double>& u, Way way,
            const std::string& name, std::vector<Points2>& x, Embedding& result) const {
    constexpr int kMostDrags = 500, kRelaxations = 3;
    const FlatProblem problem = {{&s}, {}, Boundary::kFixed};
    FlatNewton newton(problem, executor_);
    const Points2 from = x[0];
    Points2 target = from;
    double t = 0, step = 0.25;
    for (int i = 0; i < kMostDrags && t < 1; ++i) {
      const double next = (std::min)(1.0, t + step);
      for (int h : s.mesh.boundary) {
        const int v = s.mesh.tail[h];
        target.row(v) = way(row2(from, v), outline.point(u[v]), next, outline).transpose();
      }
      newton.minimize(kRelaxations, 0, x);
      const bool is_there = newton.drag(target, x);
      if (is_there) t = next;
      step *= is_there ? 1.5 : 0.5;
      const int percent = static_cast<int>(100 * t);
      if (!tell(options_,
                "boundary of " + name + " along a square: " + std::to_string(percent) + "%",
                result))
        return false;
    }
    return t == 1 || fail(result, Status::kNumericalFailure,
                          "the boundary of mesh " + name + " cannot be laid along a square");
  }

  /// Along a side.
  static Vec2 straight(const Vec2& p, const Vec2& q, double t, const Outline&) {
    return t < 1 ? Vec2(p + t * (q - p)) : q;
  }

  /// From a circle to the square, on the superellipse |x|^n + |y|^n = r^n with n from 2 to ∞, which
  /// is convex.
  static Vec2 superelliptic(const Vec2& p, const Vec2& q, double t, const Outline& outline) {
    if (t == 1) return q;
    const double turn = std::atan2(cross(p, q), p.dot(q)), n = 2 / (1 - t);
    const Vec2 direction = Eigen::Rotation2Dd(t * turn) * p.normalized();
    const double larger = direction.cwiseAbs().maxCoeff();
    const double ratio = direction.cwiseAbs().minCoeff() / larger;
    const double norm = larger * std::pow(1 + std::pow(ratio, n), 1 / n);
    return ((1 - t) * p.norm() + t * outline.half_side) / norm * direction;
  }

  bool grow(Hierarchy& h, const std::string& name, Embedding& result) const {
    const int stuck = h.refine(2 * h.active());
    return stuck < 0 || fail(result, Status::kNumericalFailure,
                             "mesh " + name + ": there is no room for vertex " +
                                 std::to_string(stuck) + " in the plane",
                             {stuck});
  }

  bool embed_base(Hierarchy& h, const std::string& name, Embedding& result) const {
    return h.embed_base() || fail(result, Status::kNumericalFailure,
                                  "Tutte's embedding of the decimated mesh " + name + " failed");
  }

  /// Embeds one surface, without the other, up to a number of vertices.
  bool embed_alone(Hierarchy& h, const std::string& name, int target, Embedding& result) const {
    const bool is_uniform = metric_ == Metric::kUniform;
    while (true) {
      Level level = h.current();
      if (is_uniform) level.surface = softened(level.surface, 0, h.total_area());
      std::vector<Points2> x = {h.positions(level)};
      const FlatProblem problem = {
          {&level.surface}, {}, is_uniform ? Boundary::kFixed : Boundary::kFree};
      FlatNewton(problem, executor_).minimize(kMostSteps, kTolerance, x);
      h.set(level, x[0]);
      if (!tell(options_, "embedding " + name + ": " + std::to_string(h.active()) + " vertices",
                result))
        return false;
      if (h.is_full() || h.active() >= target) return true;
      if (!grow(h, name, result)) return false;
    }
  }

  /// Returns from the uniform metric to that of the surface. The boundary is let go, or, with an
  /// outline, laid along the square first.
  bool unfold(Hierarchy& h, const Surface& s, const Outline* outline, const std::string& name,
              Embedding& result) const {
    constexpr int kStages = 4;
    std::vector<Points2> x = {h.positions()};
    for (int i = 0; i <= kStages; ++i) {
      const double part = i / double{kStages};
      const Surface soft = i < kStages ? softened(s, part, s.total_area) : s;
      const bool is_dragged = outline != nullptr && (i == 0 || boundary() == Boundary::kFixed);
      if (is_dragged && !drag(soft, *outline, outline->places(s.mesh, part),
                              i == 0 ? superelliptic : straight, name, x, result))
        return false;
      const FlatProblem problem = {{&soft}, {}, boundary()};
      FlatNewton(problem, executor_).minimize(kUnfoldingSteps, kUnfoldingTolerance, x);
      if (!tell(options_,
                "unfolding " + name + ": stage " + std::to_string(i + 1) + " of " +
                    std::to_string(kStages + 1),
                result))
        return false;
    }
    h.set(h.current(), x[0]);
    return true;
  }

  /// Moves the plane of A rigidly, then lets the landmarks pull, harder and harder.
  void bring_together(Hierarchy& a, Hierarchy& b) const {
    if (landmarks_.empty()) return relax(a, b, 0);
    if (landmarks_.size() >= 2 && outlines_ == nullptr) align_by_landmarks(a, b);
    for (double weight = 1; weight <= kStiffest; weight *= 10) relax(a, b, weight);
  }

  /// The landmarks whose vertices are both present; decimation may take some if there are many.
  std::vector<Landmark> present_landmarks(const Hierarchy& a, const Hierarchy& b) const {
    std::vector<Landmark> present;
    for (const Landmark& l : landmarks_)
      if (a.has(l.a) && b.has(l.b)) present.push_back(l);
    return present;
  }

  void align_by_landmarks(Hierarchy& a, const Hierarchy& b) const {
    const std::vector<Landmark> landmarks = present_landmarks(a, b);
    if (landmarks.empty()) return;
    Points2 from(landmarks.size(), 2), to(landmarks.size(), 2);
    int row = 0;
    for (const Landmark& l : landmarks) {
      from.row(row) = a.positions().row(l.a);
      to.row(row++) = b.positions().row(l.b);
    }
    a.move(rigid_fit(from, to));
  }

  /// Tries rotations of A about the landmark, or about its centre and its deepest point: the most
  /// promising ones are optimised for a while, and the one with the least distortion for its
  /// coverage wins.
  bool align_by_trial(Hierarchy& a, const Hierarchy& b, int iterations, Embedding& result) const {
    constexpr int kOptimized = 4;
    const Level level_a = a.current(), level_b = b.current();
    const SurfacePair coarse = {level_a.surface, level_b.surface};
    const Points2 x = a.positions(level_a), y = b.positions(level_b);
    std::vector<RigidMotion> motions;
    if (landmarks_.empty()) {
      add_rotations(a.center(), b.center(), motions);
      add_rotations(deepest_point(coarse.a.mesh, x), deepest_point(coarse.b.mesh, y), motions);
    } else {
      add_rotations(row2(a.positions(), landmarks_[0].a), row2(b.positions(), landmarks_[0].b),
                    motions);
    }
    std::vector<std::pair<double, int>> order;
    for (int i = 0; i < static_cast<int>(motions.size()); ++i)
      order.push_back(
          {badness(coarse, transformed(x, motions[static_cast<std::size_t>(i)]), y), i});
    std::sort(order.begin(), order.end());
    order.resize(kOptimized);
    int tried = 0;
    for (auto& candidate : order) {
      const RigidMotion& motion = motions[static_cast<std::size_t>(candidate.second)];
      Points2 f = transformed(x, motion), g = y;
      optimize(coarse, iterations, f, g);
      candidate.first = badness(coarse, f, g);
      ++tried;
      if (!tell(options_,
                "tried rotation " + std::to_string(tried) + " of " + std::to_string(order.size()),
                result))
        return false;
    }
    const int best = std::min_element(order.begin(), order.end())->second;
    a.move(motions[static_cast<std::size_t>(best)]);
    return true;
  }

  static void add_rotations(const Vec2& from, const Vec2& to, std::vector<RigidMotion>& motions) {
    constexpr int kRotations = 24;
    for (int i = 0; i < kRotations; ++i)
      motions.push_back(rigid_motion(2 * kPi * i / kRotations, from, to));
  }

  /// Where the two planes lie apart in spite of all, the deepest points of both come together.
  void make_overlap(Hierarchy& a, const Hierarchy& b) const {
    const Points2 &f = a.positions(), &g = b.positions();
    if (badness(pair_, f, g) < kInfinity) return;
    a.move(rigid_motion(0, deepest_point(pair_.a.mesh, f), deepest_point(pair_.b.mesh, g)));
  }

  /// Some iterations of Algorithm 1.
  void optimize(const SurfacePair& pair, int iterations, Points2& f, Points2& g) const {
    Options options = options_;
    options.max_iterations = iterations;
    options.progress = nullptr;
    options.boundary = Boundary::kFree;
    options.fixed_a.clear();
    options.fixed_b.clear();
    Result result;
    result.f = f;
    result.g = g;
    Optimizer(pair, options, {}).run(result);
    if (!is_usable(result.status)) return;
    f = result.f;
    g = result.g;
  }

  /// Mean distortion divided by coverage; infinite without an overlap.
  double badness(const SurfacePair& pair, const Points2& f, const Points2& g) const {
    Iterate x;
    x.f = f;
    x.g = g;
    const DistortionMeasure measure = symmetric_dirichlet();
    evaluate(pair, Weights{0, 1, 1, &measure}, x);
    const double coverage = x.area_a / pair.a.total_area + x.area_b / pair.b.total_area;
    const double value = x.map_energy / (x.area_a + x.area_b) / coverage;
    return value < kInfinity ? value : kInfinity;  // NaN, too
  }

  /// Minimises E_f + E_g + weight · mean squared landmark distance on the current levels.
  void relax(Hierarchy& a, Hierarchy& b, double weight) const {
    const Level level_a = a.current(), level_b = b.current();
    FlatProblem problem = {{&level_a.surface, &level_b.surface}, {}, boundary()};
    if (weight > 0) {
      const std::vector<Landmark> landmarks = present_landmarks(a, b);
      for (const Landmark& l : landmarks)
        problem.springs.push_back({level_a.place[l.a], level_b.place[l.b],
                                   weight / static_cast<double>(landmarks.size())});
    }
    std::vector<Points2> x = {a.positions(level_a), b.positions(level_b)};
    FlatNewton(problem, executor_).minimize(kMostSteps, kTolerance, x);
    a.set(level_a, x[0]);
    b.set(level_b, x[1]);
  }

  const SurfacePair& pair_;
  const std::vector<Landmark>& landmarks_;
  const Options& options_;
  const Metric metric_;
  const std::array<Outline, 2>* outlines_;  // of A and B, or null
  Executor executor_;
};

// ---- exact landmarks ----

/// Pulls the landmarks harder and harder; where one of A can jump onto that of B without turning a
/// triangle over, it does, and both move as one from then on. Where that does not bring all of them
/// together, it starts anew with more vertices around those left over, then around all: a point
/// costs the less energy to move the finer the mesh around it is, and edges can bend around other
/// landmarks.
class LandmarkJoiner {
 public:
  LandmarkJoiner(SurfacePair& pair, const std::vector<Landmark>& landmarks, const Options& options)
      : pair_(pair), landmarks_(landmarks), options_(options), executor_(options) {}

  bool run(Embedding& result) {
    constexpr int kMostRefinements = 6;
    for (int i = 0; i <= kMostRefinements; ++i) {
      const Points2 f = result.f, g = result.g;
      apart_ = landmarks_;
      joined_.clear();
      if (!pull(result)) return false;
      if (apart_.empty()) return true;
      if (i == kMostRefinements) break;
      result.f = f;
      result.g = g;
      refine(i == 0 ? apart_ : landmarks_, result);
    }
    std::string message = "these landmarks could not be joined:";
    std::vector<int> ids;
    for (const Landmark& l : apart_) {
      message += " " + std::to_string(l.a) + "-" + std::to_string(l.b);
      ids.push_back(l.a);
    }
    return fail(result, Status::kInvalidLandmarks, message, ids);
  }

 private:
  bool pull(Embedding& result) {
    constexpr double kHardest = 1e12;
    FlatProblem problem = {{&pair_.a, &pair_.b}, {}, options_.boundary};
    for (double weight = 10 * kStiffest; weight <= kHardest && !apart_.empty(); weight *= 10) {
      join(result);
      if (!tell(options_, "landmarks still apart: " + std::to_string(apart_.size()), result))
        return false;
      problem.springs.clear();
      for (const Landmark& l : apart_)
        problem.springs.push_back({l.a, l.b, weight / static_cast<double>(landmarks_.size())});
      problem.followers = followers();
      std::vector<Points2> x = {result.f, result.g};
      FlatNewton(problem, executor_).minimize(kMostSteps, kTolerance, x);
      result.f = x[0];
      result.g = x[1];
    }
    join(result);
    return true;
  }

  void join(Embedding& result) {
    std::vector<Landmark> left;
    for (const Landmark& l : apart_) {
      const Vec2 before = row2(result.f, l.a);
      result.f.row(l.a) = result.g.row(l.b);
      if (is_injective(pair_.a.mesh, result.f)) {
        joined_.push_back(l);
      } else {
        result.f.row(l.a) = before.transpose();
        left.push_back(l);
      }
    }
    apart_ = left;
  }

  Array<Follower> followers() const {
    Array<Follower> followers;
    for (const Landmark& l : joined_) followers.push_back(landmark_follower(pair_, l));
    return followers;
  }

  void refine(const std::vector<Landmark>& landmarks, Embedding& result) {
    std::vector<int> at_a, at_b;
    for (const Landmark& l : landmarks) at_a.push_back(l.a), at_b.push_back(l.b);
    halve_edges_at(at_a, pair_.a, result.f);
    halve_edges_at(at_b, pair_.b, result.g);
  }

  /// Halves the inner edges of the triangles around some vertices, in the plane, too.
  static void halve_edges_at(const std::vector<int>& vertices, Surface& s, Points2& x) {
    std::vector<Midpoint> edges;
    for (int v : vertices)
      s.mesh.for_each_outgoing(v, [&](int spoke) {
        for (int h : {spoke, next(spoke), prev(spoke)})
          if (s.mesh.twin[h] >= 0)
            edges.push_back({(std::min)(s.mesh.tail[h], s.mesh.tip(h)),
                             (std::max)(s.mesh.tail[h], s.mesh.tip(h))});
      });
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    const int n = s.mesh.n_vertices;
    split_edges(edges, s);
    x.conservativeResize(s.mesh.n_vertices, 2);
    for (std::size_t i = 0; i < edges.size(); ++i)
      x.row(n + static_cast<int>(i)) = 0.5 * (x.row(edges[i][0]) + x.row(edges[i][1]));
  }

  SurfacePair& pair_;
  const std::vector<Landmark>& landmarks_;
  const Options& options_;
  Executor executor_;
  std::vector<Landmark> apart_, joined_;
};

}  // namespace detail
}  // namespace ism

// ==== [15] MAP EVALUATION AND META MESH (paper §3.1, §4.1) =======================================
//
// Purpose:    Φ and Φ⁻¹ at points of the surfaces; the meta mesh lifted to both.
// Invariants: a corner of the meta mesh is a vertex of A, a vertex of B, or a crossing of an edge
//             of A with one of B; that key, never coordinates, identifies it.
// Fails:      points outside the overlap are not covered.

namespace ism {
namespace detail {

struct MapData {
  Status status = Status::kConverged;
  std::string message;
  std::vector<int> ids;
  Points3 vertices_a, vertices_b;
  HalfEdgeMesh a, b;
  Points2 f, g;
  Overlay overlay;
  FaceGroups by_a, by_b;
};

inline Vec3 barycentric(const HalfEdgeMesh& m, const Points2& x, int f, const Vec2& p) {
  return barycentric(p, row2(x, m.corner(f, 0)), row2(x, m.corner(f, 1)), row2(x, m.corner(f, 2)));
}

/// How far inside the best face so far a point is: its least barycentric coordinate.
struct BestFace {
  double least = -1e-12;  // rounding may put a point on an edge outside both its faces
  SurfacePoint point;
  void offer(int face, const Vec3& coordinates) {
    if (!(coordinates.minCoeff() > least)) return;
    least = coordinates.minCoeff();
    point = {face, coordinates};
  }
  MappedPoint mapped() const {
    MappedPoint result;
    if (point.face < 0) return result;
    result.covered = true;
    result.point.face = point.face;
    result.point.barycentric = point.barycentric.cwiseMax(0.0);
    result.point.barycentric /= result.point.barycentric.sum();
    return result;
  }
};

/// One direction of the map: from mesh `from` embedded by x onto mesh `to` embedded by y.
struct MapSide {
  const HalfEdgeMesh& from;
  const Points2& x;
  const HalfEdgeMesh& to;
  const Points2& y;
  const FaceGroups& groups;  // polygons by face of `from`
  const Array<OverlayPolygon>& polygons;
  bool forward;

  void offer_face(int face, const Vec2& p, BestFace& best) const {
    for (int i = groups.start[face]; i < groups.start[face + 1]; ++i) {
      const OverlayPolygon& polygon = polygons[groups.item[i]];
      const int target = forward ? polygon.tb : polygon.ta;
      best.offer(target, barycentric(to, y, target, p));
    }
  }

  MappedPoint map(const SurfacePoint& s) const {
    BestFace best;
    if (s.face < 0 || s.face >= groups.start.size() - 1) return MappedPoint();
    Vec2 p = Vec2::Zero();
    for (int k = 0; k < 3; ++k) p += s.barycentric[k] * row2(x, from.corner(s.face, k));
    offer_face(s.face, p, best);
    return best.mapped();
  }

  MappedPoint map_vertex(int v) const {
    BestFace best;
    if (groups.start.empty() || v < 0 || v >= from.n_vertices) return MappedPoint();
    from.for_each_outgoing(v, [&](int h) { offer_face(h / 3, row2(x, v), best); });
    return best.mapped();
  }

  std::vector<MappedPoint> map_vertices() const {
    std::vector<MappedPoint> points;
    for (int v = 0; v < from.n_vertices; ++v) points.push_back(map_vertex(v));
    return points;
  }
};

// ---- curves ----

/// A stretch of a segment of the plane that lies in one triangle: from parameter s to t.
struct Stretch {
  static constexpr int kAlong = -2;
  double s, t;
  int face;
  int enter, leave;  // half-edges of that face, -1 where the stretch does not end at one, kAlong
                     // where it runs along the boundary
};

/// Stretches, each of which begins where the one before it ends.
using Chain = std::vector<Stretch>;

/// Cuts segments of the plane at the edges of an embedded mesh, exactly. The vertices of the mesh
/// have the labels first_label, first_label + 1, ... of the symbolic perturbation; the ends of a
/// segment have others.
class SegmentCutter {
 public:
  SegmentCutter(const HalfEdgeMesh& m, const Points2& x, int first_label)
      : m_(m), x_(x), first_label_(first_label) {}

  /// The chains of segment pq in order, where pq passes through a triangle of `seeds` or next to
  /// one.
  std::vector<Chain> cut(const LabelledPoint& p, const LabelledPoint& q,
                         const std::vector<int>& seeds) const {
    const std::vector<Stretch> along = along_boundary(p.p, q.p, seeds);
    std::vector<Stretch> stretches = along;
    for (const Stretch& s : across(p, q, seeds)) {
      const double middle = 0.5 * (s.s + s.t);
      if (std::none_of(along.begin(), along.end(),
                       [&](const Stretch& a) { return a.s <= middle && middle <= a.t; }))
        stretches.push_back(s);
    }
    std::sort(stretches.begin(), stretches.end(),
              [](const Stretch& a, const Stretch& b) { return a.s < b.s; });
    return chains(stretches);
  }

 private:
  /// The stretches along the boundary. Under the perturbation, the segment is infinitely close to
  /// it, on either side.
  std::vector<Stretch> along_boundary(const Vec2& p, const Vec2& q,
                                      const std::vector<int>& faces) const {
    std::vector<Stretch> stretches;
    const auto parameter = [&](const Vec2& r) {
      return clamp01((r - p).dot(q - p) / (q - p).squaredNorm());
    };
    for (int f : faces)
      for (int h : {3 * f, 3 * f + 1, 3 * f + 2}) {
        const Vec2 u = row2(x_, m_.tail[h]), v = row2(x_, m_.tip(h));
        if (m_.twin[h] >= 0 || orient2d(p, q, u) != 0 || orient2d(p, q, v) != 0) continue;
        const auto [s, t] = std::minmax({parameter(u), parameter(v)});
        if (s < t) stretches.push_back({s, t, f, Stretch::kAlong, Stretch::kAlong});
      }
    return stretches;
  }

  /// The stretches in triangles, those of the seeds and their neighbours first, then those the
  /// segment goes to and comes from.
  std::vector<Stretch> across(const LabelledPoint& p, const LabelledPoint& q,
                              const std::vector<int>& seeds) const {
    std::vector<Stretch> stretches;
    std::set<int> known;
    std::vector<int> queue;
    const auto offer = [&](int f) {
      if (known.insert(f).second) queue.push_back(f);
    };
    const auto offer_beyond = [&](int h) {
      if (h >= 0 && m_.twin[h] >= 0) offer(m_.twin[h] / 3);
    };
    for (int f : seeds) {
      offer(f);
      for (int h : {3 * f, 3 * f + 1, 3 * f + 2}) offer_beyond(h);
    }
    for (std::size_t i = 0; i < queue.size(); ++i) {
      Stretch s{0, 1, queue[i], -1, -1};
      if (!clip(p, q, s)) continue;
      stretches.push_back(s);
      offer_beyond(s.enter);
      offer_beyond(s.leave);
    }
    return stretches;
  }

  /// The part of pq in triangle s.face; false if there is none.
  bool clip(const LabelledPoint& p, const LabelledPoint& q, Stretch& s) const {
    const LabelledTriangle corner = labelled(m_, x_, s.face, first_label_);
    std::array<bool, 3> p_left, q_left, left;  // of edge k; corner k of pq
    for (std::size_t k = 0; k < 3; ++k) {
      const LabelledPoint &u = corner[k], &v = corner[(k + 1) % 3];
      p_left[k] = oriented(u, v, p);
      q_left[k] = oriented(u, v, q);
      left[k] = oriented(p, q, u);
    }
    bool starts = inside(p_left), ends = inside(q_left);
    for (std::size_t k = 0; k < 3; ++k) {
      if (p_left[k] == q_left[k] || left[k] == left[(k + 1) % 3]) continue;
      const Vec2 u = corner[k].p, v = corner[(k + 1) % 3].p;
      const double at = crossing(p.p, q.p - p.p, u, v - u).first;
      const int h = 3 * s.face + static_cast<int>(k);
      if (q_left[k])
        starts = true, s.enter = h, s.s = at;
      else
        ends = true, s.leave = h, s.t = at;
    }
    return starts && ends;
  }

  /// Within the mesh, a stretch enters the triangle beyond the half-edge by which the one before it
  /// leaves: parameters are rounded and could tell neither gaps nor the order of short ones. Along
  /// the boundary, they are those of its vertices.
  bool follows(const Stretch& a, const Stretch& b) const {
    if (a.leave == Stretch::kAlong) return b.enter == Stretch::kAlong && a.t == b.s;
    return a.leave >= 0 && b.enter >= 0 && m_.twin[a.leave] == b.enter;
  }

  std::vector<Chain> chains(const std::vector<Stretch>& stretches) const {
    std::vector<Chain> result;
    for (const Stretch& first : stretches) {
      if (std::any_of(stretches.begin(), stretches.end(),
                      [&](const Stretch& s) { return follows(s, first); }))
        continue;
      result.push_back({first});
      while (result.back().size() < stretches.size()) {
        const auto next = std::find_if(stretches.begin(), stretches.end(), [&](const Stretch& s) {
          return follows(result.back().back(), s);
        });
        if (next == stretches.end()) break;
        result.back().push_back(*next);
      }
    }
    return result;
  }

  const HalfEdgeMesh& m_;
  const Points2& x_;
  int first_label_;
};

/// The faces a point lies in: one, or those around its edge or vertex.
inline std::vector<int> faces_around(const HalfEdgeMesh& m, const SurfacePoint& s) {
  std::vector<int> faces;
  for (int k = 0; k < 3; ++k)
    if (s.barycentric[k] == 1) {
      m.for_each_outgoing(m.corner(s.face, k), [&](int h) { faces.push_back(h / 3); });
      return faces;
    }
  faces.push_back(s.face);
  for (int k = 0; k < 3; ++k) {  // corner k does not count: the point is on the edge behind it
    const int twin = m.twin[next(3 * s.face + k)];
    if (s.barycentric[k] == 0 && twin >= 0) faces.push_back(twin / 3);
  }
  return faces;
}

/// Where a point of a surface lies in the plane. What lies on an edge parallel to an axis lies on
/// it after rounding, too.
inline Vec2 planar_position(const HalfEdgeMesh& m, const Points2& x, const SurfacePoint& s) {
  Vec2 p = Vec2::Zero(), lo = Vec2::Constant(kInfinity), hi = -lo;
  for (int k = 0; k < 3; ++k) {
    if (s.barycentric[k] == 0) continue;
    const Vec2 corner = row2(x, m.corner(s.face, k));
    p += s.barycentric[k] * corner;
    lo = lo.cwiseMin(corner);
    hi = hi.cwiseMax(corner);
  }
  p = p.cwiseMax(lo).cwiseMin(hi);
  return Vec2(flush_tiny(p.x()), flush_tiny(p.y()));
}

/// Maps paths along the edges of the first mesh of a side, and curves on it.
class CurveMapper {
 public:
  explicit CurveMapper(const MapSide& side)
      : side_(side),
        first_label_(side.forward ? 0 : side.to.n_vertices),
        free_label_(side.from.n_vertices + side.to.n_vertices),
        from_(side.from, side.x, first_label_),
        to_(side.to, side.y, side.forward ? side.from.n_vertices : 0) {}

  std::vector<Polyline> map_path(const std::vector<int>& vertices) {
    if (side_.groups.start.empty()) return {};
    for (std::size_t i = 0; i + 1 < vertices.size(); ++i) {
      const int u = vertices[i], v = vertices[i + 1];
      const int h = (std::max)(find_half_edge(side_.from, u, v), find_half_edge(side_.from, v, u));
      if (h >= 0)
        add({{row2(side_.x, u), first_label_ + u}, {row2(side_.x, v), first_label_ + v}, {h / 3}});
      else
        interrupt();
    }
    return finish();
  }

  std::vector<Polyline> map_curve(const Polyline& points) {
    if (side_.groups.start.empty()) return {};
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      const int odd = static_cast<int>(i % 2);  // a point has one label in both its segments
      add_between(points[i], free_label_ + odd, points[i + 1], free_label_ + 1 - odd);
    }
    return finish();
  }

 private:
  static constexpr double kTouch = 1e-12;  // a gap of this part of a segment is none

  /// A straight piece of a curve in the plane, and the faces of the first mesh it passes through.
  struct Segment {
    LabelledPoint p, q;
    std::vector<int> faces;
  };

  bool is_valid(const SurfacePoint& s) const {
    return s.face >= 0 && s.face < side_.from.n_faces && s.barycentric.allFinite();
  }

  void add_between(const SurfacePoint& s, int s_label, const SurfacePoint& t, int t_label) {
    if (!is_valid(s) || !is_valid(t)) return interrupt();
    const LabelledPoint p = {planar_position(side_.from, side_.x, s), s_label};
    const LabelledPoint q = {planar_position(side_.from, side_.x, t), t_label};
    if (p.p == q.p) return;
    std::vector<int> faces = faces_around(side_.from, s), ends = faces_around(side_.from, t);
    std::vector<int> common;
    std::sort(faces.begin(), faces.end());
    std::sort(ends.begin(), ends.end());
    std::set_intersection(faces.begin(), faces.end(), ends.begin(), ends.end(),
                          std::back_inserter(common));
    if (!common.empty()) return add({p, q, common});
    faces.insert(faces.end(), ends.begin(), ends.end());
    add_across(p, q, faces);
  }

  /// A segment over the edges of the first mesh; the parts of it outside are left out.
  void add_across(const LabelledPoint& p, const LabelledPoint& q, const std::vector<int>& ends) {
    double end = 0;
    for (const Chain& chain : from_.cut(p, q, ends)) {
      Segment segment = {p, q, {}};
      for (const Stretch& s : chain) segment.faces.push_back(s.face);
      if (chain.front().s > end + kTouch) interrupt();
      end = chain.back().t;
      if (chain.front().s > 0) segment.p = {p.p + chain.front().s * (q.p - p.p), free_label_ + 2};
      if (chain.back().t < 1) segment.q = {p.p + chain.back().t * (q.p - p.p), free_label_ + 3};
      if (segment.p.p != segment.q.p) add(segment);
    }
    if (end < 1 - kTouch) interrupt();
  }

  void interrupt() { is_open_ = false; }

  void add(const Segment& segment) {
    std::vector<int> seeds;
    for (int f : segment.faces)
      for (int i = side_.groups.start[f]; i < side_.groups.start[f + 1]; ++i) {
        const OverlayPolygon& polygon = side_.polygons[side_.groups.item[i]];
        seeds.push_back(side_.forward ? polygon.tb : polygon.ta);
      }
    std::sort(seeds.begin(), seeds.end());
    seeds.erase(std::unique(seeds.begin(), seeds.end()), seeds.end());
    double end = 0;
    for (const Chain& chain : to_.cut(segment.p, segment.q, seeds)) {
      if (chain.front().s > end + kTouch) interrupt();
      end = chain.back().t;
      add_chain(segment, chain);
    }
    if (end < 1 - kTouch) interrupt();
  }

  void add_chain(const Segment& segment, const Chain& chain) {
    const auto point = [&](int face, double t) -> SurfacePoint {
      const Vec2 p = segment.p.p + t * (segment.q.p - segment.p.p);
      const Vec3 b = barycentric(side_.to, side_.y, face, p).cwiseMax(0.0);
      return {face, b.sum() > 0 ? Vec3(b / b.sum()) : Vec3::Constant(1.0 / 3)};
    };
    if (is_open_)
      polylines_.back().pop_back();  // its last point is the first of this chain
    else
      polylines_.emplace_back();
    for (const Stretch& s : chain) polylines_.back().push_back(point(s.face, s.s));
    polylines_.back().push_back(point(chain.back().face, chain.back().t));
    is_open_ = true;
  }

  std::vector<Polyline> finish() {
    interrupt();
    return std::move(polylines_);
  }

  MapSide side_;
  int first_label_;  // of the vertices of the first mesh
  int free_label_;   // the first of four that no vertex has
  SegmentCutter from_, to_;
  std::vector<Polyline> polylines_;
  bool is_open_ = false;  // the last polyline goes on
};

/// Overlays d.f and d.g and groups the polygons by the faces of either mesh.
inline void index_overlay(MapData& d) {
  compute_overlay(d.a, d.f, d.b, d.g, d.overlay);
  const Array<OverlayPolygon>& polygons = d.overlay.polygons;
  d.by_a = group_polygons(polygons, d.a.n_faces, [](const OverlayPolygon& p) { return p.ta; });
  d.by_b = group_polygons(polygons, d.b.n_faces, [](const OverlayPolygon& p) { return p.tb; });
}

inline MapSide forward_side(const MapData& d) {
  return {d.a, d.f, d.b, d.g, d.by_a, d.overlay.polygons, true};
}
inline MapSide backward_side(const MapData& d) {
  return {d.b, d.g, d.a, d.f, d.by_b, d.overlay.polygons, false};
}

inline Vec3 surface_position(const Points3& vertices, const HalfEdgeMesh& m,
                             const SurfacePoint& s) {
  Vec3 p = Vec3::Zero();
  for (int k = 0; k < 3; ++k) p += s.barycentric[k] * vertices.row(m.corner(s.face, k)).transpose();
  return p;
}

inline Triangles triangles_of(const HalfEdgeMesh& m) {
  Triangles triangles(m.n_faces, 3);
  for (int f = 0; f < m.n_faces; ++f)
    for (int k = 0; k < 3; ++k) triangles(f, k) = m.corner(f, k);
  return triangles;
}

/// Lifts the polygons of a map to both surfaces.
class MetaMeshBuilder {
 public:
  explicit MetaMeshBuilder(const MapData& data) : data_(data) {}

  MetaMesh build() {
    collect_corners();
    MetaMesh mesh;
    const int n = static_cast<int>(
        std::unique(order_.begin(), order_.end(),
                    [&](int i, int j) { return corners_[i].key == corners_[j].key; }) -
        order_.begin());
    mesh.a = {data_.vertices_a, triangles_of(data_.a)};
    mesh.b = {data_.vertices_b, triangles_of(data_.b)};
    mesh.on_a.resize(n, 3);
    mesh.on_b.resize(n, 3);
    mesh.plane.resize(n, 2);
    for (int i = 0; i < n; ++i) {
      const Corner& c = corners_[order_[i]];
      mesh.on_a.row(i) = surface_position(data_.vertices_a, data_.a, c.on_a).transpose();
      mesh.on_b.row(i) = surface_position(data_.vertices_b, data_.b, c.on_b).transpose();
      mesh.plane.row(i) = planar_position(data_.a, data_.f, c.on_a).transpose();
    }
    mesh.corner_a.resize(corners_.size(), 3);
    mesh.corner_b.resize(corners_.size(), 3);
    for (int i = 0; i < corners_.size(); ++i) {
      mesh.corner_a.row(i) = corners_[i].on_a.barycentric.transpose();
      mesh.corner_b.row(i) = corners_[i].on_b.barycentric.transpose();
    }
    int next = 0;
    for (const OverlayPolygon& p : data_.overlay.polygons) {
      mesh.face_a.push_back(p.ta);
      mesh.face_b.push_back(p.tb);
      mesh.polygons.emplace_back();
      for (int i = 0; i < p.count; ++i) mesh.polygons.back().push_back(id_[next++]);
    }
    return mesh;
  }

 private:
  /// Vertices of A: (a, -1), of B: (-1, b); crossings: (edge of A, edge of B) behind them, an edge
  /// being named by the smaller of its half-edges.
  using Key = std::tuple<int, int, int>;
  struct Corner {
    Key key;
    SurfacePoint on_a, on_b;
  };

  void collect_corners() {
    for (const OverlayPolygon& p : data_.overlay.polygons) add_polygon(p);
    order_.resize(corners_.size());
    std::iota(order_.begin(), order_.end(), 0);
    std::sort(order_.begin(), order_.end(), [&](int i, int j) {
      return corners_[i].key != corners_[j].key ? corners_[i].key < corners_[j].key : i < j;
    });
    id_.resize(corners_.size());
    for (int i = 0, id = -1; i < order_.size(); ++i) {
      if (i == 0 || corners_[order_[i]].key != corners_[order_[i - 1]].key) ++id;
      id_[order_[i]] = id;
    }
  }

  static int edge_id(const HalfEdgeMesh& m, int h) {
    return m.twin[h] < 0 ? h : (std::min)(h, m.twin[h]);
  }

  static SurfacePoint at_corner(int face, int k) { return {face, Vec3::Unit(k)}; }
  static SurfacePoint on_edge(int face, int k, double t) {
    return {face, (1 - t) * Vec3::Unit(k) + t * Vec3::Unit((k + 1) % 3)};
  }

  void add_polygon(const OverlayPolygon& p) {
    const SixPoints x = six_points(data_.a, data_.f, data_.b, data_.g, p);
    const PolygonShape shape = polygon_shape(p, x);
    for (int i = 0; i < p.count; ++i) {
      const Piece &before = shape[(i + p.count - 1) % p.count], &piece = shape[i];
      corners_.push_back(same_triangle(before.e, piece.e) ? vertex_corner(p, piece.e, x)
                                                          : crossing_corner(p, before, piece));
    }
  }

  Corner vertex_corner(const OverlayPolygon& p, int e, const SixPoints& x) const {
    const Vec2 point = x.col(e);
    if (e < 3)
      return {Key(0, data_.a.corner(p.ta, e), 0),
              at_corner(p.ta, e),
              {p.tb, barycentric(point, x.col(3), x.col(4), x.col(5))}};
    return {Key(1, data_.b.corner(p.tb, e - 3), 0),
            {p.ta, barycentric(point, x.col(0), x.col(1), x.col(2))},
            at_corner(p.tb, e - 3)};
  }

  Corner crossing_corner(const OverlayPolygon& p, const Piece& before, const Piece& piece) const {
    const bool a_first = before.e < 3;
    const int edge_a = a_first ? before.e : piece.e, edge_b = (a_first ? piece.e : before.e) - 3;
    const double t = a_first ? before.t : piece.s, mu = a_first ? piece.s : before.t;
    return {Key(2, edge_id(data_.a, 3 * p.ta + edge_a), edge_id(data_.b, 3 * p.tb + edge_b)),
            on_edge(p.ta, edge_a, t), on_edge(p.tb, edge_b, mu)};
  }

  const MapData& data_;
  Array<Corner> corners_;
  Array<int> order_;  // corners sorted by key
  Array<int> id_;     // of every corner
};

// ---- distortion ----

/// The largest singular value of J [Blinn 1996].
inline double largest_stretch(const Eigen::Matrix2d& J) {
  return 0.5 * (std::hypot(J(0, 0) + J(1, 1), J(1, 0) - J(0, 1)) +
                std::hypot(J(0, 0) - J(1, 1), J(1, 0) + J(0, 1)));
}

/// Φ of one polygon, J = J_g⁻¹ J_f. The smaller singular value comes from the determinant, as the
/// difference of two nearly equal numbers would not have a correct digit.
inline PolygonDistortion polygon_distortion(const Eigen::Matrix2d& F, const Eigen::Matrix2d& G,
                                            double planar_area) {
  const double det_f = F.determinant(), det_g = G.determinant();
  PolygonDistortion d;
  d.sigma_max = largest_stretch(G.inverse() * F);
  d.sigma_min = det_f / det_g / d.sigma_max;
  d.area_a = planar_area / det_f;
  d.area_b = planar_area / det_g;
  const double s = d.sigma_min * d.sigma_min, t = d.sigma_max * d.sigma_max;
  const double stretch = d.sigma_min * d.sigma_max;  // of areas
  d.density = ((s + t) * stretch + (1 / s + 1 / t)) / (stretch + 1);
  return d;
}

inline std::vector<PolygonDistortion> polygon_distortions(const MapData& d, bool keep_scale) {
  std::vector<PolygonDistortion> result;
  if (d.overlay.polygons.empty()) return result;
  const Surface a = build_surface({d.vertices_a, triangles_of(d.a)}, keep_scale);
  const Surface b = build_surface({d.vertices_b, triangles_of(d.b)}, keep_scale);
  for (const OverlayPolygon& p : d.overlay.polygons) {
    const SixPoints x = six_points(d.a, d.f, d.b, d.g, p);
    const double area = (std::max)(0.0, polygon_area(polygon_shape(p, x), x));
    result.push_back(
        polygon_distortion(triangle_jacobian(a, d.f, p.ta), triangle_jacobian(b, d.g, p.tb), area));
  }
  return result;
}

}  // namespace detail

inline Status SurfaceMap::status() const { return data_->status; }
inline const std::string& SurfaceMap::message() const { return data_->message; }
inline MappedPoint SurfaceMap::forward(const SurfacePoint& on_a) const {
  return detail::forward_side(*data_).map(on_a);
}
inline MappedPoint SurfaceMap::backward(const SurfacePoint& on_b) const {
  return detail::backward_side(*data_).map(on_b);
}
inline MappedPoint SurfaceMap::forward_vertex(int a) const {
  return detail::forward_side(*data_).map_vertex(a);
}
inline MappedPoint SurfaceMap::backward_vertex(int b) const {
  return detail::backward_side(*data_).map_vertex(b);
}
inline std::vector<MappedPoint> SurfaceMap::forward_vertices() const {
  return detail::forward_side(*data_).map_vertices();
}
inline std::vector<MappedPoint> SurfaceMap::backward_vertices() const {
  return detail::backward_side(*data_).map_vertices();
}
inline std::vector<Polyline> SurfaceMap::forward_path(const std::vector<int>& vertices) const {
  return detail::CurveMapper(detail::forward_side(*data_)).map_path(vertices);
}
inline std::vector<Polyline> SurfaceMap::backward_path(const std::vector<int>& vertices) const {
  return detail::CurveMapper(detail::backward_side(*data_)).map_path(vertices);
}
inline std::vector<Polyline> SurfaceMap::forward_curve(const Polyline& points) const {
  return detail::CurveMapper(detail::forward_side(*data_)).map_curve(points);
}
inline std::vector<Polyline> SurfaceMap::backward_curve(const Polyline& points) const {
  return detail::CurveMapper(detail::backward_side(*data_)).map_curve(points);
}
inline Vec3 SurfaceMap::position_on_a(const SurfacePoint& p) const {
  return detail::surface_position(data_->vertices_a, data_->a, p);
}
inline Vec3 SurfaceMap::position_on_b(const SurfacePoint& p) const {
  return detail::surface_position(data_->vertices_b, data_->b, p);
}
inline MetaMesh SurfaceMap::meta_mesh() const { return detail::MetaMeshBuilder(*data_).build(); }
inline std::vector<PolygonDistortion> SurfaceMap::distortion(bool keep_scale) const {
  return detail::polygon_distortions(*data_, keep_scale);
}

}  // namespace ism

// ==== [16] APPLICATIONS (paper §1, §6.3) =========================================================
//
// Purpose:    attributes carried between the surfaces, shapes between them, totals of distortion.
// Invariants: attributes pass through the corners of the meta mesh, where both meshes are known
//             exactly; what one mesh gives to the meta mesh it gets back.
// Fails:      with a status where attributes do not fit a mesh.

namespace ism {
namespace detail {

// ---- attributes ----

/// What a meta mesh says of one of its two meshes.
struct MetaSide {
  const TriangleMesh& mesh;
  const std::vector<int>& face;  // per polygon
  const Points3& corner;         // per corner of the polygons
};

inline MetaSide meta_side(const MetaMesh& meta, Side side) {
  if (side == Side::kA) return {meta.a, meta.face_a, meta.corner_a};
  return {meta.b, meta.face_b, meta.corner_b};
}

inline Eigen::Index element_count(const TriangleMesh& mesh, Element element) {
  if (element == Element::kVertex) return mesh.vertices.rows();
  return (element == Element::kFace ? 1 : 3) * mesh.triangles.rows();
}

/// The row of the attribute at corner k of face f.
inline Eigen::Index element_row(const TriangleMesh& mesh, Element element, int f, int k) {
  if (element == Element::kVertex) return mesh.triangles(f, k);
  return element == Element::kFace ? f : 3 * Eigen::Index{f} + k;
}

inline Attributes invalid_attributes(std::string message) {
  Attributes result;
  result.status = Status::kInvalidAttributes;
  result.message = std::move(message);
  return result;
}

inline Attributes misfit(Eigen::Index given, Eigen::Index wanted, const char* per) {
  return invalid_attributes("the attributes have " + std::to_string(given) + " rows, but " +
                            std::to_string(wanted) + " are needed, one per " + per);
}

inline const char* element_name(Element element) {
  if (element == Element::kVertex) return "vertex";
  return element == Element::kFace ? "face" : "corner of a face";
}

/// Sums of attributes and of their weights.
struct WeightedRows {
  Eigen::MatrixXd sum;
  Eigen::VectorXd weight;
  WeightedRows(Eigen::Index rows, Eigen::Index columns)
      : sum(Eigen::MatrixXd::Zero(rows, columns)), weight(Eigen::VectorXd::Zero(rows)) {}

  Attributes means() const {
    Attributes result;
    result.values = sum;
    for (Eigen::Index i = 0; i < weight.size(); ++i) {
      result.covered.push_back(weight[i] > 0);
      if (weight[i] > 0) result.values.row(i) /= weight[i];
    }
    return result;
  }
};

/// Adds what the corners first to last - 1 of a polygon say of the vertices of its face.
inline void add_vertices(const MetaSide& side, Element element, int f, Eigen::Index first,
                         Eigen::Index last, const Eigen::MatrixXd& corners, WeightedRows& rows) {
  for (Eigen::Index c = first; c < last; ++c)
    for (int k = 0; k < 3; ++k) {
      if (side.corner(c, k) != 1) continue;
      const Eigen::Index row = element_row(side.mesh, element, f, k);
      rows.sum.row(row) += corners.row(c);
      rows.weight[row] += 1;
    }
}

/// Adds the integral over a polygon, in barycentric coordinates of its face, triangle by triangle.
inline void add_integral(const MetaSide& side, int f, Eigen::Index first, Eigen::Index last,
                         const Eigen::MatrixXd& corners, WeightedRows& rows) {
  const auto point = [&](Eigen::Index c) { return Vec2(side.corner(c, 1), side.corner(c, 2)); };
  for (Eigen::Index c = first + 1; c + 1 < last; ++c) {
    const double area =
        (std::max)(0.0, cross(point(c) - point(first), point(c + 1) - point(first)));
    rows.sum.row(f) += area / 3 * (corners.row(first) + corners.row(c) + corners.row(c + 1));
    rows.weight[f] += area;
  }
}

// ---- morphing ----

/// The rotation by the length of a vector about its direction.
inline Eigen::Matrix3d rotation(const Vec3& v) {
  const double angle = v.norm();
  if (angle == 0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, v / angle).toRotationMatrix();
}

/// The rotation closest to a matrix, by Newton's iteration [Higham 1986]; the identity if it has no
/// positive determinant.
inline Eigen::Matrix3d closest_rotation(const Eigen::Matrix3d& M) {
  constexpr int kMostIterations = 100;
  Eigen::Matrix3d R = M;
  if (!(R.determinant() > 0)) return Eigen::Matrix3d::Identity();
  for (int i = 0; i < kMostIterations; ++i) {
    const Eigen::Matrix3d better = 0.5 * (R + R.inverse().transpose());
    const bool is_done = (better - R).squaredNorm() < 1e-30;
    R = better;
    if (is_done) break;
  }
  return R;
}

/// The vector of a rotation that is closest to another vector: turning by an angle more or less of
/// 2π is the same.
inline Vec3 rotation_vector(const Eigen::Matrix3d& R, const Vec3& near) {
  const Eigen::Quaterniond q(R);
  const double sine = q.vec().norm(), angle = 2 * std::atan2(sine, std::abs(q.w()));
  Vec3 axis = near.norm() > 0 ? Vec3(near / near.norm()) : Vec3::UnitX();  // where R turns nothing
  if (sine > 1e-9) axis = (q.w() < 0 ? -1 / sine : 1 / sine) * q.vec();
  const double whole = std::round((near.dot(axis) - angle) / (2 * kPi));
  return (angle + 2 * kPi * whole) * axis;
}

/// An orthonormal frame of a triangle in space, the axes of its rest_frame() and the normal.
inline Eigen::Matrix3d space_frame(const Surface& s, int f) {
  const Vec3 a = s.vertices.row(s.mesh.corner(f, 0)), b = s.vertices.row(s.mesh.corner(f, 1));
  const Vec3 c = s.vertices.row(s.mesh.corner(f, 2));
  Eigen::Matrix3d frame;
  frame.col(0) = (b - a).normalized();
  frame.col(2) = (b - a).cross(c - a).normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

/// An edge of a polygon: corners i, j of the meta mesh.
struct MorphEdge {
  int i, j, polygon;
  double weight;
};

struct MorphData {
  Status status = Status::kConverged;
  Array<Vec3> a, b;  // the vertices, centred; those on B turned back by the whole turn
  Vec3 center_a = Vec3::Zero(), center_b = Vec3::Zero();
  Array<double> mass;              // of the vertices, sum 1
  Vec3 whole_turn = Vec3::Zero();  // of B with respect to A
  Array<Vec3> turn;                // of every polygon, on top of it
  Array<MorphEdge> edges;
  Array<int> anchors;  // one vertex of every part of the overlap, interpolated linearly
  LdltSymbolic symbolic;
  LdltFactor factor;  // of the weighted graph Laplacian
};

class MorphBuilder {
 public:
  MorphBuilder(const MapData& map, const MetaMesh& meta, const Options& options)
      : map_(map), meta_(meta), executor_(options), data_(std::make_shared<MorphData>()) {}

  std::shared_ptr<const MorphData> build() {
    const std::vector<PolygonDistortion> polygons = polygon_distortions(map_, true);
    collect_edges(polygons);
    find_rotations(polygons);
    align();
    find_turns();
    factorize();
    return data_;
  }

 private:
  /// Edges with weight area / length², as in ∫ ‖∇x‖², kept within bounds where polygons are thin.
  void collect_edges(const std::vector<PolygonDistortion>& polygons) {
    constexpr double kLeast = 1e-4;
    data_->mass.assign(static_cast<int>(meta_.plane.rows()), 0);
    double total = 0;
    for (std::size_t p = 0; p < polygons.size(); ++p) {
      const double area = 0.5 * (polygons[p].area_a + polygons[p].area_b);
      const std::vector<int>& corner = meta_.polygons[p];
      total += area;
      for (std::size_t k = 0; k < corner.size(); ++k) {
        const int i = corner[k], j = corner[(k + 1) % corner.size()];
        const double square = 0.5 * ((row3(meta_.on_a, i) - row3(meta_.on_a, j)).squaredNorm() +
                                     (row3(meta_.on_b, i) - row3(meta_.on_b, j)).squaredNorm());
        const double weight = square > area ? area / square : 1;
        data_->edges.push_back({i, j, static_cast<int>(p), (std::max)(weight, kLeast)});
        data_->mass[i] += area / static_cast<double>(corner.size());
      }
    }
    for (double& m : data_->mass) m /= total;
  }

  /// How Φ turns every polygon, and all of them on average. Polygons without area do not count:
  /// their two triangles need not lie on each other elsewhere.
  void find_rotations(const std::vector<PolygonDistortion>& polygons) {
    const Surface a = build_surface(meta_.a, true), b = build_surface(meta_.b, true);
    Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
    for (int i = 0; i < map_.overlay.polygons.size(); ++i) {
      const OverlayPolygon& p = map_.overlay.polygons[i];
      const SixPoints x = six_points(map_.a, map_.f, map_.b, map_.g, p);
      is_flat_.push_back(is_negligible(polygon_area(polygon_shape(p, x), x), x));
      rotation_.push_back(polygon_rotation(a, b, p));
      const PolygonDistortion& d = polygons[static_cast<std::size_t>(i)];
      if (!is_flat_[i]) mean += (d.area_a + d.area_b) * rotation_[i];
    }
    whole_ = closest_rotation(mean);
    data_->whole_turn = rotation_vector(whole_, Vec3::Zero());
  }

  Eigen::Matrix3d polygon_rotation(const Surface& a, const Surface& b,
                                   const OverlayPolygon& p) const {
    const Eigen::Matrix2d J =
        triangle_jacobian(b, map_.g, p.tb).inverse() * triangle_jacobian(a, map_.f, p.ta);
    const double angle = std::atan2(J(1, 0) - J(0, 1), J(0, 0) + J(1, 1));
    return space_frame(b, p.tb) * rotation(angle * Vec3::UnitZ()) *
           space_frame(a, p.ta).transpose();
  }

  void align() {
    const int n = static_cast<int>(meta_.plane.rows());
    for (int i = 0; i < n; ++i) {
      data_->center_a += data_->mass[i] * row3(meta_.on_a, i);
      data_->center_b += data_->mass[i] * row3(meta_.on_b, i);
    }
    for (int i = 0; i < n; ++i) {
      data_->a.push_back(row3(meta_.on_a, i) - data_->center_a);
      data_->b.push_back(whole_.transpose() * (row3(meta_.on_b, i) - data_->center_b));
    }
  }

  /// From the polygon that turns least over its neighbours to all, so that turns differ little
  /// where Φ does. Turns by a full one have no direction; beyond them, neighbours may differ.
  void find_turns() {
    const Array<std::vector<int>> neighbours = polygon_neighbours();
    Array<std::pair<double, int>> starts;
    for (int p = 0; p < neighbours.size(); ++p)
      starts.push_back({is_flat_[p] ? kInfinity : turn(p, Vec3::Zero()).norm(), p});
    std::sort(starts.begin(), starts.end());
    data_->turn.resize(neighbours.size());
    Array<char> is_known(neighbours.size(), 0);
    for (const auto& [angle, start] : starts) {  // more than one if the overlap has more parts
      if (is_known[start]) continue;
      is_known[start] = 1;
      data_->turn[start] = turn(start, Vec3::Zero());
      data_->anchors.push_back(meta_.polygons[static_cast<std::size_t>(start)][0]);
      std::vector<int> queue = {start};
      for (std::size_t i = 0; i < queue.size(); ++i)
        for (int p : neighbours[queue[i]]) {
          if (is_known[p]) continue;
          is_known[p] = 1;
          data_->turn[p] = turn(p, data_->turn[queue[i]]);
          queue.push_back(p);
        }
    }
  }

  /// The turn of polygon p on top of the whole one, near that of its neighbour.
  Vec3 turn(int p, const Vec3& near) const {
    return is_flat_[p] ? near : rotation_vector(whole_.transpose() * rotation_[p], near);
  }

  /// Polygons with a common edge.
  Array<std::vector<int>> polygon_neighbours() const {
    Array<std::array<int, 3>> sides;  // smaller corner, larger corner, polygon
    for (const MorphEdge& e : data_->edges)
      sides.push_back({(std::min)(e.i, e.j), (std::max)(e.i, e.j), e.polygon});
    std::sort(sides.begin(), sides.end());
    Array<std::vector<int>> neighbours(static_cast<int>(meta_.polygons.size()));
    for (int i = 0; i + 1 < sides.size(); ++i) {
      if (sides[i][0] != sides[i + 1][0] || sides[i][1] != sides[i + 1][1]) continue;
      neighbours[sides[i][2]].push_back(sides[i + 1][2]);
      neighbours[sides[i + 1][2]].push_back(sides[i][2]);
    }
    return neighbours;
  }

  /// Σ w (x_i - x_j)² + Σ x_anchor² as a matrix.
  void factorize() {
    Array<std::tuple<int, int, double>> entries;
    for (int i : data_->anchors) entries.push_back({i, i, 1.0});
    for (const MorphEdge& e : data_->edges) {
      entries.push_back({e.i, e.i, e.weight});
      entries.push_back({e.j, e.j, e.weight});
      entries.push_back({(std::min)(e.i, e.j), (std::max)(e.i, e.j), -e.weight});
    }
    std::sort(entries.begin(), entries.end());
    BlockPattern pattern;
    BlockValues values;
    for (const auto& [row, column, value] : entries) {
      while (pattern.start.size() <= row) pattern.start.push_back(pattern.blocks());
      if (pattern.start.back() == pattern.blocks() || pattern.column.back() != column) {
        pattern.column.push_back(column);
        values.push_back(Eigen::Matrix2d::Zero());
      }
      values.back().diagonal().array() += value;
    }
    pattern.start.push_back(pattern.blocks());
    data_->symbolic = NestedDissection(pattern, meta_.plane, executor_).build();
    ldlt_factorize(data_->symbolic, {&values, nullptr, 0}, executor_, data_->factor);
    if (!data_->factor.ok) data_->status = Status::kNumericalFailure;
  }

  const MapData& map_;
  const MetaMesh& meta_;
  Executor executor_;
  Array<Eigen::Matrix3d> rotation_;  // of every polygon
  Array<char> is_flat_;              // has no area
  Eigen::Matrix3d whole_ = Eigen::Matrix3d::Identity();
  std::shared_ptr<MorphData> data_;
};

/// The right-hand side of the least squares problem for the shape at t.
inline Array<Vec3> wanted_edges(const MorphData& d, double t) {
  Array<Vec3> sum(d.a.size(), Vec3::Zero());
  int polygon = -1;
  Eigen::Matrix3d part, back;
  for (const MorphEdge& e : d.edges) {
    if (e.polygon != polygon) {
      polygon = e.polygon;
      part = rotation(t * d.turn[polygon]);
      back = rotation((t - 1) * d.turn[polygon]);
    }
    const Vec3 on_a = d.a[e.i] - d.a[e.j], on_b = d.b[e.i] - d.b[e.j];
    const Vec3 edge = e.weight * ((1 - t) * (part * on_a) + t * (back * on_b));
    sum[e.i] += edge;
    sum[e.j] -= edge;
  }
  for (int i : d.anchors) sum[i] += (1 - t) * d.a[i] + t * d.b[i];
  return sum;
}

inline Points3 solve_morph(const MorphData& d, double t) {
  const Array<Vec3> wanted = wanted_edges(d, t);
  const int n = wanted.size();
  Points3 x(n, 3);
  Eigen::VectorXd right(2 * n);
  for (int c = 0; c < 3; c += 2) {  // x and y, then z: the solver has 2×2 blocks
    const int other = c == 0 ? 1 : 2;
    for (int i = 0; i < n; ++i) right.segment<2>(2 * i) << wanted[i][c], wanted[i][other];
    const Eigen::VectorXd solution = ldlt_solve(d.symbolic, d.factor, right);
    for (int i = 0; i < n; ++i) {
      x(i, c) = solution[2 * i];
      x(i, other) = solution[2 * i + 1];
    }
  }
  Vec3 center = Vec3::Zero();
  for (int i = 0; i < n; ++i) center += d.mass[i] * row3(x, i);
  const Eigen::Matrix3d R = rotation(t * d.whole_turn);
  const Vec3 new_center = (1 - t) * d.center_a + t * d.center_b;
  for (int i = 0; i < n; ++i) {
    const Vec3 p = R * (row3(x, i) - center) + new_center;
    x.row(i) = p.transpose();
  }
  return x;
}

}  // namespace detail

inline std::vector<std::vector<int>> edge_paths(const std::vector<std::array<int, 2>>& edges,
                                                const TriangleMesh& mesh,
                                                const std::vector<Midpoint>& added) {
  const auto sorted = [](const Midpoint& e) {
    return Midpoint{(std::min)(e[0], e[1]), (std::max)(e[0], e[1])};
  };
  std::map<Midpoint, int> middle_of;
  int middle = static_cast<int>(mesh.vertices.rows()) - static_cast<int>(added.size());
  for (const Midpoint& edge : added) {
    if (middle > (std::max)(edge[0], edge[1])) middle_of[sorted(edge)] = middle;
    ++middle;
  }
  std::vector<std::vector<int>> paths;
  for (const std::array<int, 2>& edge : edges) {
    std::vector<int> path = {edge[0], edge[1]};
    for (std::size_t i = 0; i + 1 < path.size();) {
      const auto halved = middle_of.find(sorted({path[i], path[i + 1]}));
      if (halved == middle_of.end())
        ++i;
      else
        path.insert(path.begin() + static_cast<std::ptrdiff_t>(i) + 1, halved->second);
    }
    paths.push_back(std::move(path));
  }
  return paths;
}

inline Remesh remesh(const SurfaceMap& map, Side side) {
  Remesh result;
  const bool of_a = side == Side::kA;
  const std::vector<MappedPoint> images = of_a ? map.forward_vertices() : map.backward_vertices();
  const auto position = [&](const MappedPoint& image) {
    return of_a ? map.position_on_b(image.point) : map.position_on_a(image.point);
  };
  const auto first = std::find_if(images.begin(), images.end(),
                                  [](const MappedPoint& image) { return image.covered; });
  result.mesh.vertices = Points3::Zero(static_cast<Eigen::Index>(images.size()), 3);
  for (std::size_t v = 0; v < images.size(); ++v) {
    result.covered.push_back(images[v].covered);
    if (first != images.end())
      result.mesh.vertices.row(static_cast<Eigen::Index>(v)) =
          position(images[v].covered ? images[v] : *first).transpose();
  }
  const Triangles all = detail::triangles_of(of_a ? map.data_->a : map.data_->b);
  result.mesh.triangles.resize(all.rows(), 3);
  Eigen::Index n = 0;
  for (Eigen::Index f = 0; f < all.rows(); ++f) {
    const auto covered = [&](int k) { return result.covered[static_cast<std::size_t>(all(f, k))]; };
    if (covered(0) && covered(1) && covered(2)) result.mesh.triangles.row(n++) = all.row(f);
  }
  result.mesh.triangles.conservativeResize(n, 3);
  return result;
}

inline Attributes to_meta(const MetaMesh& meta, Side side, Element element,
                          const Eigen::MatrixXd& values) {
  const detail::MetaSide s = detail::meta_side(meta, side);
  const Eigen::Index rows = detail::element_count(s.mesh, element);
  if (values.rows() != rows)
    return detail::misfit(values.rows(), rows, detail::element_name(element));
  Attributes result;
  result.values.resize(s.corner.rows(), values.cols());
  result.covered.assign(static_cast<std::size_t>(s.corner.rows()), 1);
  Eigen::Index c = 0;
  for (std::size_t p = 0; p < meta.polygons.size(); ++p)
    for (std::size_t k = 0; k < meta.polygons[p].size(); ++k, ++c) {
      const auto row = [&](int i) {
        return values.row(detail::element_row(s.mesh, element, s.face[p], i));
      };
      result.values.row(c) = row(0);
      if (element != Element::kFace)
        result.values.row(c) =
            s.corner(c, 0) * row(0) + s.corner(c, 1) * row(1) + s.corner(c, 2) * row(2);
    }
  return result;
}

namespace detail {

/// A vertex of a refined mesh as a mean of vertices of the mesh it refines.
using Ancestors = std::map<int, double>;

inline std::vector<Ancestors> ancestors_of(Eigen::Index n_given,
                                           const std::vector<Midpoint>& added) {
  std::vector<Ancestors> result;
  for (int v = 0; v < n_given; ++v) result.push_back({{v, 1.0}});
  for (const Midpoint& edge : added) {
    Ancestors middle;
    for (int end : edge)
      if (end >= 0 && end < static_cast<int>(result.size()))
        for (const auto& [v, weight] : result[static_cast<std::size_t>(end)])
          middle[v] += 0.5 * weight;
    result.push_back(std::move(middle));
  }
  return result;
}

/// The triangle of a mesh in which one of its refinement lies, or -1.
inline int parent_face(const std::map<std::array<int, 3>, int>& face_of,
                       const std::vector<Ancestors>& ancestors, const Triangles& triangles,
                       Eigen::Index f) {
  std::set<int> corners;
  for (int k = 0; k < 3; ++k)
    for (const auto& [v, weight] : ancestors[static_cast<std::size_t>(triangles(f, k))])
      corners.insert(v);
  std::array<int, 3> key{};
  if (corners.size() != 3) return -1;
  std::copy(corners.begin(), corners.end(), key.begin());
  const auto found = face_of.find(key);
  return found == face_of.end() ? -1 : found->second;
}

inline std::map<std::array<int, 3>, int> faces_by_corners(const Triangles& triangles) {
  std::map<std::array<int, 3>, int> face_of;
  for (int f = 0; f < triangles.rows(); ++f) {
    std::array<int, 3> key = {triangles(f, 0), triangles(f, 1), triangles(f, 2)};
    std::sort(key.begin(), key.end());
    face_of[key] = f;
  }
  return face_of;
}

/// Where a vertex is among the corners of a triangle.
inline int corner_of(const Triangles& triangles, int f, int v) {
  return triangles(f, 0) == v ? 0 : triangles(f, 1) == v ? 1 : 2;
}

}  // namespace detail

inline Attributes refine(const TriangleMesh& mesh, const TriangleMesh& refined,
                         const std::vector<Midpoint>& added, Element element,
                         const Eigen::MatrixXd& values) {
  const Eigen::Index rows = detail::element_count(mesh, element);
  if (values.rows() != rows)
    return detail::misfit(values.rows(), rows, detail::element_name(element));
  const std::vector<detail::Ancestors> ancestors =
      detail::ancestors_of(mesh.vertices.rows(), added);
  const int n_refined = static_cast<int>(ancestors.size());
  if (n_refined != refined.vertices.rows())
    return detail::invalid_attributes(
        "the refined mesh has " + std::to_string(refined.vertices.rows()) +
        " vertices, but the mesh and what was added have " + std::to_string(n_refined));
  if ((refined.triangles.array() < 0 || refined.triangles.array() >= n_refined).any())
    return detail::invalid_attributes("a triangle of the refined mesh has no such vertex");
  const std::map<std::array<int, 3>, int> face_of = detail::faces_by_corners(mesh.triangles);
  Attributes result;
  result.values.setZero(detail::element_count(refined, element), values.cols());
  result.covered.assign(static_cast<std::size_t>(result.values.rows()), 1);
  for (Eigen::Index f = 0; f < refined.triangles.rows(); ++f) {
    const int parent = detail::parent_face(face_of, ancestors, refined.triangles, f);
    if (parent < 0)
      return detail::invalid_attributes("triangle " + std::to_string(f) +
                                        " of the refined mesh lies in none of the mesh");
    for (int k = 0; k < 3; ++k) {
      auto row = result.values.row(detail::element_row(refined, element, static_cast<int>(f), k));
      row.setZero();
      for (const auto& [v, weight] : ancestors[static_cast<std::size_t>(refined.triangles(f, k))])
        row += weight * values.row(detail::element_row(
                            mesh, element, parent, detail::corner_of(mesh.triangles, parent, v)));
    }
  }
  return result;
}

inline Attributes from_meta(const MetaMesh& meta, Side side, Element element,
                            const Eigen::MatrixXd& corners) {
  const detail::MetaSide s = detail::meta_side(meta, side);
  if (corners.rows() != s.corner.rows())
    return detail::misfit(corners.rows(), s.corner.rows(), "corner of the meta mesh");
  detail::WeightedRows rows(detail::element_count(s.mesh, element), corners.cols());
  Eigen::Index first = 0;
  for (std::size_t p = 0; p < meta.polygons.size(); ++p) {
    const Eigen::Index last = first + static_cast<Eigen::Index>(meta.polygons[p].size());
    if (element == Element::kFace)
      detail::add_integral(s, s.face[p], first, last, corners, rows);
    else
      detail::add_vertices(s, element, s.face[p], first, last, corners, rows);
    first = last;
  }
  return rows.means();
}

inline Attributes transfer(const MetaMesh& meta, Side from, Element element,
                           const Eigen::MatrixXd& values, Element target) {
  const Attributes corners = to_meta(meta, from, element, values);
  if (corners.status != Status::kConverged) return corners;
  return from_meta(meta, from == Side::kA ? Side::kB : Side::kA, target, corners.values);
}

inline Points3 linear_morph(const MetaMesh& meta, double t) {
  return (1 - t) * meta.on_a + t * meta.on_b;
}

inline Morph::Morph(const SurfaceMap& map, const Options& options) {
  auto failed = std::make_shared<detail::MorphData>();
  failed->status = map.status();
  data_ = failed;
  if (map.status() == Status::kConverged)
    data_ = detail::MorphBuilder(*map.data_, map.meta_mesh(), options).build();
}
inline Status Morph::status() const { return data_->status; }
inline Points3 Morph::at(double t) const {
  if (data_->status != Status::kConverged) return Points3(0, 3);
  return detail::solve_morph(*data_, t);
}

inline DistortionSummary summarize(const std::vector<PolygonDistortion>& polygons) {
  DistortionSummary s;
  detail::Array<std::pair<double, double>> densities;  // and areas
  double energy = 0;
  for (const PolygonDistortion& p : polygons) {
    const double area = p.area_a + p.area_b;
    if (!(area > 0)) continue;
    s.sigma_min = densities.empty() ? p.sigma_min : (std::min)(s.sigma_min, p.sigma_min);
    s.sigma_max = (std::max)(s.sigma_max, p.sigma_max);
    s.area_a += p.area_a;
    s.area_b += p.area_b;
    energy += area * p.density;
    densities.push_back({p.density, area});
  }
  if (densities.empty()) return s;
  std::sort(densities.begin(), densities.end());
  const double total = s.area_a + s.area_b;
  const auto quantile = [&](double share) {
    double below = 0;
    for (const auto& [density, area] : densities)
      if ((below += area) >= share * total) return density;
    return densities.back().first;
  };
  s.mean = energy / total;
  s.median = quantile(0.5);
  s.p95 = quantile(0.95);
  s.largest = densities.back().first;
  return s;
}

}  // namespace ism

// ==== [17] ENTRY POINTS ==========================================================================
//
// Purpose:    checks the input, runs the parts above in order, and words the outcome.
// Invariants: nothing is computed on input that fails a check.
// Fails:      with the status, message and ids of the first check that does.

namespace ism {
namespace detail {

template <class Output>
bool check_mesh(const TriangleMesh& mesh, const char* name, Output& output) {
  const std::vector<Problem> problems = validate(mesh);
  if (problems.empty()) return true;
  std::string message = std::string("mesh ") + name + ": " + problems[0].message;
  if (problems.size() > 1) message += " (problem 1 of " + std::to_string(problems.size()) + ")";
  return fail(output, Status::kInvalidMesh, message, problems[0].ids);
}

template <class Output>
bool check_landmarks(const TriangleMesh& a, const TriangleMesh& b,
                     const std::vector<Landmark>& landmarks, Output& output) {
  Array<char> used_a(static_cast<int>(a.vertices.rows()), 0);
  Array<char> used_b(static_cast<int>(b.vertices.rows()), 0);
  for (const Landmark& l : landmarks) {
    const std::string name = "landmark " + std::to_string(l.a) + " " + std::to_string(l.b) + ": ";
    if (l.a < 0 || l.a >= used_a.size())
      return fail(output, Status::kInvalidLandmarks,
                  name + "mesh A has no vertex " + std::to_string(l.a) + ", it has " +
                      std::to_string(used_a.size()) + " vertices, counted from 0",
                  {l.a});
    if (l.b < 0 || l.b >= used_b.size())
      return fail(output, Status::kInvalidLandmarks,
                  name + "mesh B has no vertex " + std::to_string(l.b) + ", it has " +
                      std::to_string(used_b.size()) + " vertices, counted from 0",
                  {l.b});
    if (used_a[l.a]++)
      return fail(output, Status::kInvalidLandmarks,
                  name + "vertex " + std::to_string(l.a) + " of A is in another landmark", {l.a});
    if (used_b[l.b]++)
      return fail(output, Status::kInvalidLandmarks,
                  name + "vertex " + std::to_string(l.b) + " of B is in another landmark", {l.b});
  }
  return true;
}

template <class Output>
bool check_options(const Options& o, Output& output) {
  const auto require = [&](bool good, const char* rule) {
    return good ||
           fail(output, Status::kInvalidOptions, std::string("option out of range: ") + rule);
  };
  return require(o.measure.is_complete(), "measure must have a value and derivatives") &&
         require(o.coverage_weight >= 0 && std::isfinite(o.coverage_weight),
                 "coverage_weight must be at least 0") &&
         require(o.barrier_weight > 0 && std::isfinite(o.barrier_weight),
                 "barrier_weight must be positive") &&
         require(o.spd_epsilon > 0 && std::isfinite(o.spd_epsilon),
                 "spd_epsilon must be positive") &&
         require(o.history_length >= 1, "history_length must be at least 1") &&
         require(o.history_decay > 0 && o.history_decay <= 1, "history_decay must be in (0, 1]") &&
         require(o.omega_start > 0 && std::isfinite(o.omega_start),
                 "omega_start must be positive") &&
         require(o.omega_factor > 1 && std::isfinite(o.omega_factor),
                 "omega_factor must be above 1") &&
         require(o.omega_least >= 0 && o.omega_least <= o.omega_start,
                 "omega_least must be in [0, omega_start]") &&
         require(o.max_displacement > 0, "max_displacement must be positive") &&
         require(o.max_coverage_loss > 0, "max_coverage_loss must be positive") &&
         require(o.least_coverage >= 0 && o.least_coverage < 1,
                 "least_coverage must be in [0, 1)") &&
         require(o.search_stride >= 1 && o.search_stride <= 8, "search_stride must be in [1, 8]") &&
         require(o.short_step >= 0, "short_step must be at least 0") &&
         require(o.solve_tolerance > 0 && o.solve_tolerance < 1,
                 "solve_tolerance must be in (0, 1)") &&
         require(o.max_iterations >= 0, "max_iterations must be at least 0") &&
         require(o.tolerance >= 0, "tolerance must be at least 0") &&
         require(o.window >= 1, "window must be at least 1") &&
         require(o.threads >= 0, "threads must be at least 0");
}

/// Marks the vertices of a list of pinned or fixed ones, each of which must exist and be free.
template <class Output>
bool hold(const std::vector<int>& vertices, const std::string& mesh, const char* how,
          Array<const char*>& held, Output& output) {
  for (int v : vertices) {
    const std::string name = "vertex " + std::to_string(v) + " of " + mesh;
    if (v < 0 || v >= held.size())
      return fail(
          output, Status::kInvalidPins,
          name + " is to be " + how + ", but ids are 0 to " + std::to_string(held.size() - 1), {v});
    if (held[v] != nullptr)
      return fail(output, Status::kInvalidPins,
                  name + " is to be " + how + ", but it is " + held[v] + " already", {v});
    held[v] = how;
  }
  return true;
}

/// With held boundaries, an exact landmark lies on both of them or on none.
template <class Output>
bool check_boundary_landmarks(const TriangleMesh& a, const TriangleMesh& b,
                              const std::vector<Landmark>& landmarks, Output& output) {
  const HalfEdgeMesh m = build_half_edges(static_cast<int>(a.vertices.rows()), a.triangles);
  const HalfEdgeMesh n = build_half_edges(static_cast<int>(b.vertices.rows()), b.triangles);
  for (const Landmark& l : landmarks)
    if (m.on_boundary(l.a) != n.on_boundary(l.b))
      return fail(output, Status::kInvalidLandmarks,
                  "landmark " + std::to_string(l.a) + " " + std::to_string(l.b) +
                      ": one vertex is on a boundary, which is held, and the other one is not",
                  {l.a, l.b});
  return true;
}

/// Every vertex obeys one constraint at most; but fixed ones may lie on a held boundary.
template <class Output>
bool check_constraints(const TriangleMesh& a, const TriangleMesh& b,
                       const std::vector<Landmark>& landmarks, const Options& options,
                       Output& output) {
  const bool is_held = options.boundary != Boundary::kFree;
  if (is_held && options.exact_landmarks && !check_boundary_landmarks(a, b, landmarks, output))
    return false;
  Array<const char*> held_a(static_cast<int>(a.vertices.rows()), nullptr);
  Array<const char*> held_b(static_cast<int>(b.vertices.rows()), nullptr);
  for (const Landmark& l : landmarks)
    if (options.exact_landmarks) held_a[l.a] = "in an exact landmark";
  if (!hold(options.fixed_a, "A", "fixed", held_a, output) ||
      !hold(options.fixed_b, "B", "fixed", held_b, output))
    return false;
  const auto hold_boundary_of = [](const TriangleMesh& mesh, Array<const char*>& held) {
    const HalfEdgeMesh m = build_half_edges(held.size(), mesh.triangles);
    for (int h : m.boundary) held[m.tail[h]] = "on a boundary that is held";
  };
  if (is_held) hold_boundary_of(a, held_a), hold_boundary_of(b, held_b);
  return hold(options.pins_a, "A", "pinned", held_a, output) &&
         hold(options.pins_b, "B", "pinned", held_b, output);
}

template <class Output>
bool check_input(const TriangleMesh& a, const TriangleMesh& b,
                 const std::vector<Landmark>& landmarks, const Options& options, Output& output) {
  return check_options(options, output) && check_mesh(a, "A", output) &&
         check_mesh(b, "B", output) && check_landmarks(a, b, landmarks, output) &&
         check_constraints(a, b, landmarks, options, output);
}

inline double largest_landmark_distance(const Embedding& e,
                                        const std::vector<Landmark>& landmarks) {
  double largest = 0;
  for (const Landmark& l : landmarks)
    largest = (std::max)(largest, (row2(e.f, l.a) - row2(e.g, l.b)).norm());
  return largest / domain_radius(e.f, e.g);
}

/// E_f + E_g, infinite for a failure.
inline double strain(const SurfacePair& pair, const Embedding& e) {
  if (e.status != Status::kConverged) return kInfinity;
  Array<Eigen::Matrix2d> J;
  const double energy = embedding_energy(pair.a, e.f, J) + embedding_energy(pair.b, e.g, J);
  return energy < kInfinity ? energy : kInfinity;  // NaN, too
}

/// Embeds with free boundaries in the metric of the surfaces; where that fails or strains them,
/// once more in the uniform metric, and the better one counts.
inline bool embed_freely(const SurfacePair& pair, const std::vector<Landmark>& landmarks,
                         const Options& options, Embedding& embedding) {
  constexpr double kStrained = 100;  // of isometries: 4
  PairEmbedder(pair, landmarks, options, Metric::kSurface, nullptr).run(embedding);
  const double energy = strain(pair, embedding) / pair.total_area();
  if (embedding.status != Status::kAborted && !(energy < kStrained)) {
    Embedding other;
    PairEmbedder(pair, landmarks, options, Metric::kUniform, nullptr).run(other);
    if (other.status == Status::kAborted || strain(pair, other) < strain(pair, embedding))
      embedding = other;
  }
  return embedding.status == Status::kConverged;
}

/// Embeds both meshes in one square.
inline bool embed_in_square(SurfacePair& pair, const std::vector<Landmark>& landmarks,
                            const Options& options, Embedding& embedding) {
  OutlineBuilder builder(pair, landmarks);
  if (!builder.has_landmarks()) {
    if (!embed_freely(pair, landmarks, options, embedding)) return false;
    builder.match_closest(embedding.f, embedding.g);
  }
  const std::array<Outline, 2> outlines = builder.build();
  PairEmbedder(pair, landmarks, options, Metric::kUniform, &outlines).run(embedding);
  return embedding.status == Status::kConverged;
}

/// The start, as the options want it. May add vertices to the meshes of the pair.
inline void embed(SurfacePair& pair, const std::vector<Landmark>& landmarks, const Options& options,
                  Embedding& embedding) {
  Timer timer;
  const bool is_held = options.boundary != Boundary::kFree;
  bool ok = !(is_held || options.exact_landmarks) || check_order(pair, landmarks, embedding);
  ok = ok && (is_held ? embed_in_square(pair, landmarks, options, embedding)
                      : embed_freely(pair, landmarks, options, embedding));
  if (ok && options.exact_landmarks) LandmarkJoiner(pair, landmarks, options).run(embedding);
  if (embedding.status != Status::kConverged) {
    embedding.f.resize(0, 2);
    embedding.g.resize(0, 2);
  }
  embedding.seconds = timer.lap();
}

/// Hands over the meshes that were embedded.
inline void return_meshes(const TriangleMesh& a, const TriangleMesh& b, const SurfacePair& pair,
                          Embedding& embedding) {
  embedding.a = with_added_vertices(a, pair.a);
  embedding.b = with_added_vertices(b, pair.b);
  embedding.added_a = pair.a.added;
  embedding.added_b = pair.b.added;
}

/// True if x holds an injective embedding of m.
template <class Output>
bool check_positions(const HalfEdgeMesh& m, const Points2& x, const std::string& name,
                     Output& output) {
  if (x.rows() != m.n_vertices)
    return fail(output, Status::kInvalidPositions,
                name + " has " + std::to_string(x.rows()) + " rows, the mesh has " +
                    std::to_string(m.n_vertices) + " vertices");
  return is_injective(m, x) ||
         fail(output, Status::kInvalidPositions, name + " is not an injective embedding");
}

/// Takes the start from Options, after checking it.
inline void given_positions(const SurfacePair& pair, const Options& options, Embedding& start) {
  start.f = options.initial_f;
  start.g = options.initial_g;
  if (!check_positions(pair.a.mesh, start.f, "initial_f", start)) return;
  check_positions(pair.b.mesh, start.g, "initial_g", start);
}

/// The power of two that makes two given planes about as large as their surfaces: Φ does not depend
/// on it (§4.6), but E_f and E_g do, and ε. Being a power of two, it can be undone without
/// rounding.
inline double plane_scale(const SurfacePair& pair, const Points2& f, const Points2& g) {
  const auto area = [](const HalfEdgeMesh& m, const Points2& x) {
    double twice = 0;
    for (int h : m.boundary) twice += cross(row2(x, m.tail[h]), row2(x, m.tip(h)));
    return 0.5 * std::abs(twice);
  };
  const double ratio = pair.total_area() / (area(pair.a.mesh, f) + area(pair.b.mesh, g));
  const double exponent = std::round(0.5 * std::log2(ratio));
  return std::isfinite(exponent) ? std::exp2(exponent) : 1;
}

/// Where the pins of one mesh are put: the images of its vertices under one side of the map.
struct PinnedSide {
  const std::vector<int>& vertices;
  const char *mesh, *other;
  MapSide map;
  int first_row, first_master;
};

inline bool add_pins(const PinnedSide& side, Array<Follower>& followers, Result& result) {
  for (int v : side.vertices) {
    const MappedPoint image = side.map.map_vertex(v);
    if (!image.covered)
      return fail(result, Status::kInvalidPins,
                  "pin: vertex " + std::to_string(v) + " of " + side.mesh + " is not mapped to " +
                      side.other + " by the start",
                  {v});
    Follower follower = {side.first_row + v, {}, image.point.barycentric};
    for (int k = 0; k < 3; ++k)
      follower.master[static_cast<std::size_t>(k)] =
          side.first_master + side.map.to.corner(image.point.face, k);
    followers.push_back(follower);
  }
  return true;
}

/// A pin must not lie in a triangle with a pinned vertex: followers of followers are not resolved.
inline bool check_chains(const Array<Follower>& followers, int n_a, Result& result) {
  const auto id = [&](int row) { return row < n_a ? row : row - n_a; };
  const auto name = [&](int row) {
    return "vertex " + std::to_string(id(row)) + (row < n_a ? " of A" : " of B");
  };
  std::vector<int> pinned;
  for (const Follower& follower : followers) pinned.push_back(follower.row);
  std::sort(pinned.begin(), pinned.end());
  for (const Follower& follower : followers)
    for (std::size_t k = 0; k < 3; ++k) {
      const int master = follower.master[k];
      if (follower.weight[static_cast<int>(k)] != 0 &&
          std::binary_search(pinned.begin(), pinned.end(), master))
        return fail(result, Status::kInvalidPins,
                    "pin: " + name(follower.row) + " lies in a triangle of " + name(master) +
                        ", which is pinned too",
                    {id(follower.row), id(master)});
    }
  return true;
}

/// The followers that Options::pins_a and pins_b ask for.
inline bool find_followers(const SurfacePair& pair, const std::vector<Landmark>& landmarks,
                           const Options& options, Array<Follower>& followers, Result& result) {
  for (const Landmark& l : landmarks) {
    if (!options.exact_landmarks) break;
    if (result.f.row(l.a) != result.g.row(l.b))
      return fail(result, Status::kInvalidPositions,
                  "landmark " + std::to_string(l.a) + " " + std::to_string(l.b) +
                      ": exact_landmarks needs given positions in which its images coincide",
                  {l.a, l.b});
    followers.push_back(landmark_follower(pair, l));
  }
  if (options.pins_a.empty() && options.pins_b.empty()) return true;
  MapData map;
  map.a = pair.a.mesh;
  map.b = pair.b.mesh;
  map.f = result.f;
  map.g = result.g;
  index_overlay(map);
  const int n = pair.n_a();
  return add_pins({options.pins_a, "A", "B", forward_side(map), 0, n}, followers, result) &&
         add_pins({options.pins_b, "B", "A", backward_side(map), n, 0}, followers, result) &&
         check_chains(followers, n, result);
}

inline const char* explain(Status s) {
  switch (s) {
    case Status::kConverged:
      return "the energy hardly falls any more";
    case Status::kIterationLimit:
      return "stopped at the iteration limit";
    case Status::kStalled:
      return "no injective step lowers the energy";
    case Status::kCancelled:
      return "cancelled; this is the last injective iterate";
    case Status::kNoOverlap:
      return "the two embeddings do not overlap at the start";
    case Status::kInvalidPins:
      return "a triangle at a pinned vertex is so thin at the start that rounding turns it over";
    case Status::kNumericalFailure:
      return "the energy or its derivatives are not finite: a triangle is too thin for them, or "
             "the "
             "measure fails";
    default:
      return "";
  }
}

}  // namespace detail

inline const char* to_string(Status s) {
  switch (s) {
    case Status::kConverged:
      return "converged";
    case Status::kIterationLimit:
      return "iteration limit";
    case Status::kStalled:
      return "stalled";
    case Status::kCancelled:
      return "cancelled";
    case Status::kAborted:
      return "aborted";
    case Status::kInvalidMesh:
      return "invalid mesh";
    case Status::kInvalidLandmarks:
      return "invalid landmarks";
    case Status::kInvalidOptions:
      return "invalid options";
    case Status::kInvalidPositions:
      return "invalid positions";
    case Status::kInvalidPins:
      return "invalid pins";
    case Status::kInvalidAttributes:
      return "invalid attributes";
    case Status::kNoOverlap:
      return "no overlap";
    case Status::kNumericalFailure:
      return "numerical failure";
  }
  return "unknown";
}

inline Embedding initial_embedding(const TriangleMesh& a, const TriangleMesh& b,
                                   const std::vector<Landmark>& landmarks, const Options& options) {
  Embedding embedding;
  if (!detail::check_input(a, b, landmarks, options, embedding)) return embedding;
  detail::SurfacePair pair = {detail::build_surface(a, options.keep_scale),
                              detail::build_surface(b, options.keep_scale)};
  detail::embed(pair, landmarks, options, embedding);
  detail::return_meshes(a, b, pair, embedding);
  if (embedding.status == Status::kConverged)
    embedding.landmark_distance = detail::largest_landmark_distance(embedding, landmarks);
  return embedding;
}

inline Result compute_map(const TriangleMesh& a, const TriangleMesh& b,
                          const std::vector<Landmark>& landmarks, const Options& options) {
  Result result;
  if (!detail::check_input(a, b, landmarks, options, result)) {
    result.start.status = result.status;
    return result;
  }
  detail::SurfacePair pair = {detail::build_surface(a, options.keep_scale),
                              detail::build_surface(b, options.keep_scale)};
  const bool is_given = options.initial_f.size() > 0 || options.initial_g.size() > 0;
  if (is_given)
    detail::given_positions(pair, options, result.start);
  else
    detail::embed(pair, landmarks, options, result.start);
  detail::return_meshes(a, b, pair, result.start);
  if (result.start.status != Status::kConverged) {
    detail::fail(result, result.start.status, result.start.message, result.start.ids);
    return result;
  }
  result.start.landmark_distance = detail::largest_landmark_distance(result.start, landmarks);
  const double scale = is_given ? detail::plane_scale(pair, result.start.f, result.start.g) : 1;
  result.f = scale * result.start.f;
  result.g = scale * result.start.g;
  detail::Timer timer;
  detail::Array<detail::Follower> followers;
  if (!detail::find_followers(pair, landmarks, options, followers, result)) return result;
  detail::Optimizer(pair, options, followers).run(result);
  result.f /= scale;
  result.g /= scale;
  result.message = detail::explain(result.status);
  result.seconds = timer.lap();
  return result;
}

inline SurfaceMap::SurfaceMap(const TriangleMesh& a, const TriangleMesh& b, const Points2& f,
                              const Points2& g) {
  auto data = std::make_shared<detail::MapData>();
  data_ = data;
  if (!detail::check_mesh(a, "A", *data) || !detail::check_mesh(b, "B", *data)) return;
  data->vertices_a = a.vertices;
  data->vertices_b = b.vertices;
  data->a = detail::build_half_edges(static_cast<int>(a.vertices.rows()), a.triangles);
  data->b = detail::build_half_edges(static_cast<int>(b.vertices.rows()), b.triangles);
  data->f = f;
  data->g = g;
  if (!detail::check_positions(data->a, f, "f", *data)) return;
  if (!detail::check_positions(data->b, g, "g", *data)) return;
  detail::index_overlay(*data);
  if (data->overlay.polygons.empty())
    detail::fail(*data, Status::kNoOverlap, detail::explain(Status::kNoOverlap));
}

}  // namespace ism

// ==== [17] LICENSE ===============================================================================
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

#endif  // ISM_HPP

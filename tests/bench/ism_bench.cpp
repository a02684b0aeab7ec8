// ism_bench: how long the parts of ism.hpp take, beside other libraries on the same data.
//
//   ism_bench [A B [LANDMARKS]] [--threads N] [--repeats N] [--no-run] [--json FILE]
//   ism_bench [A B [LANDMARKS]] [--threads N] --scaling [--largest TRIANGLES]
//
// Without meshes it takes ../shared/meshes/pig_camel, seen from the project, and where that is
// absent a generated pair. All parts are measured in one process, on the state that the iteration
// starts from and on the one after 20 iterations; seconds are medians. Rivals run on the same
// input with as many threads, and their results are compared. --scaling instead makes whole runs of
// a pair that is refined again and again, and fits exponents.

#define ISM_IMPLEMENTATION
#include "ism.hpp"

#include "problem.hpp"
#include "rivals.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

namespace {

using namespace ism::detail;
using bench::fail;
using bench::Problem;

struct Arguments {
  std::vector<std::string> files;
  int threads = 0;
  int repeats = 5;
  bool run = true;
  bool scaling = false;
  double largest = 300000;  // triangles of both meshes
  std::string json;
};

Arguments parse(int argc, char** argv) {
  Arguments args;
  for (int i = 1; i < argc; ++i) {
    const std::string flag = argv[i];
    const auto value = [&] {
      if (++i == argc) fail(flag + " needs a value");
      return std::string(argv[i]);
    };
    if (flag == "--threads")
      args.threads = std::atoi(value().c_str());
    else if (flag == "--repeats")
      args.repeats = std::max(1, std::atoi(value().c_str()));
    else if (flag == "--no-run")
      args.run = false;
    else if (flag == "--scaling")
      args.scaling = true;
    else if (flag == "--largest")
      args.largest = std::atof(value().c_str());
    else if (flag == "--json")
      args.json = value();
    else if (flag.rfind("--", 0) == 0)
      fail("unknown option '" + flag + "'");
    else
      args.files.push_back(flag);
  }
  if (args.threads <= 0) args.threads = static_cast<int>(std::thread::hardware_concurrency());
  return args;
}

// ---- input ----

/// A square of n × n with two hills.
ism::TriangleMesh hills(int n, double left, double right) {
  ism::TriangleMesh mesh;
  mesh.vertices.resize((n + 1) * (n + 1), 3);
  mesh.triangles.resize(2 * n * n, 3);
  for (int j = 0, v = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i, ++v) {
      const double x = static_cast<double>(i) / n, y = static_cast<double>(j) / n;
      const auto hill = [&](double cx) {
        return std::exp(-40 * ((x - cx) * (x - cx) + (y - 0.5) * (y - 0.5)));
      };
      mesh.vertices.row(v) << x, y, left * hill(0.3) + right * hill(0.7);
    }
  for (int j = 0, f = 0; j < n; ++j)
    for (int i = 0; i < n; ++i, f += 2) {
      const int v = j * (n + 1) + i;
      mesh.triangles.row(f) << v, v + 1, v + n + 2;
      mesh.triangles.row(f + 1) << v, v + n + 2, v + n + 1;
    }
  return mesh;
}

Problem generated(int n) {
  const int m = n * 9 / 10;
  return {"generated hills",
          hills(n, 0.6, 0.3),
          hills(m, 0.3, 0.6),
          {{0, 0}, {n, m}, {(n + 1) * (n + 1) - 1, (m + 1) * (m + 1) - 1}}};
}

Problem problem_of(const Arguments& args, const char* shared_name, int generated_size) {
  if (!args.files.empty()) return bench::read_problem(args.files);
  const std::filesystem::path folder =
      std::filesystem::path(ISM_SOURCE_DIR).parent_path() / "shared" / "meshes" / shared_name;
  if (!std::filesystem::exists(folder / "A.obj")) return generated(generated_size);
  Problem problem = bench::read_problem({(folder / "A.obj").string(), (folder / "B.obj").string(),
                                         (folder / "landmarks.txt").string()});
  problem.name = shared_name;
  return problem;
}

// ---- measuring ----

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[values.size() / 2];
}

double median_seconds(int repeats, const std::function<void()>& work) {
  std::vector<double> seconds;
  for (int i = 0; i < repeats; ++i) {
    Timer timer;
    work();
    seconds.push_back(timer.lap());
  }
  return median(seconds);
}

/// Peak memory of this process in MiB; 0 where the system does not tell.
double peak_memory() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.rfind("VmHWM:", 0) == 0) return std::atof(line.c_str() + 6) / 1024;
  return 0;
}

/// The table, in Markdown on stdout, and in JSON.
class Report {
 public:
  void title(const std::string& text) {
    std::printf("\n%s\n\n| part | threads | time | rival | ratio | remark |\n", text.c_str());
    std::printf("|---|---:|---:|---:|---:|---|\n");
    section_ = text;
  }
  /// A time in units of 1 / scale seconds; a rival of 0 is none.
  void add(const std::string& part, int threads, double seconds, double scale, const char* unit,
           double rival = 0, const std::string& remark = "") {
    const std::string ratio = rival > 0 ? format("%.1f", rival / seconds) : "";
    const std::string other = rival > 0 ? format("%.4g ", rival * scale) + unit : "";
    std::printf("| %s | %d | %.4g %s | %s | %s | %s |\n", part.c_str(), threads, seconds * scale,
                unit, other.c_str(), ratio.c_str(), remark.c_str());
    std::fflush(stdout);
    json_ += (json_.empty() ? "" : ",\n") + std::string("  {\"section\": \"") + section_ +
             "\", \"part\": \"" + part + format("\", \"threads\": %.0f", threads) +
             format(", \"seconds\": %.9g", seconds) + format(", \"rival_seconds\": %.9g", rival) +
             ", \"remark\": \"" + remark + "\"}";
  }
  bool write(const std::string& path) const {
    std::ofstream out(path);
    out << "[\n" << json_ << "\n]\n";
    return static_cast<bool>(out.flush());
  }
  static std::string format(const char* pattern, double x) {
    char text[64];
    std::snprintf(text, sizeof text, pattern, x);
    return text;
  }

 private:
  std::string section_, json_;
};

/// One state of the iteration, and how its parts are computed.
struct State {
  State(const Problem& problem, const ism::Points2& f, const ism::Points2& g)
      : surface(join({build_surface(problem.a, false), build_surface(problem.b, false)})) {
    x.x = stacked(f, g);
    evaluate(surface, weights, x);
  }
  JointSurface surface;
  RunOptions options;
  Weights weights = weights_of(options);
  Iterate x;
};

Executor executor(int threads) {
  ism::Options options;
  options.threads = threads;
  return Executor(options);
}

// ---- the parts ----

void bench_overlay(State& s, int repeats, Report& report) {
  const double overlay =
      median_seconds(repeats, [&] { compute_overlay(s.surface, s.x.x, s.x.overlay); });
  const double all = median_seconds(repeats, [&] { evaluate(s.surface, s.weights, s.x); });
  const int n = s.x.overlay.polygons.size();
  report.add("overlay", 1, overlay, 1e3, "ms", 0, std::to_string(n) + " polygons");
  report.add("energy, per polygon", 1, (all - overlay) / n, 1e6, "us", 0, "E_f and E_g included");
  const double injective = median_seconds(repeats, [&] {
    if (!is_injective(s.surface.mesh, s.x.x)) fail("the state is not injective");
  });
  report.add("exact test of injectivity", 1, injective, 1e3, "ms");
}

void load_batch(const State& s, int first, PolygonBatch& batch) {
  for (int lane = 0; lane < kLanes; ++lane) {
    const OverlayPolygon& p = s.x.overlay.polygons[first + lane];
    load(p, six_points(s.surface.mesh, s.x.x, p), s.surface.rest_inverse[p.ta],
         s.surface.rest_inverse[p.tb], lane, batch);
  }
}

#ifdef ISM_BENCH_ADOLC
/// A polygon as ADOL-C wants it, and our Hessian of it.
struct Sample {
  OverlayPolygon polygon;
  std::array<double, 12> x;
  std::array<double, 8> rest_inverse;
  Eigen::Matrix<double, 12, 12> hessian;
};

/// Some polygons, those of one combinatorial type behind each other.
std::vector<Sample> samples(const State& s, int wanted) {
  const int n = s.x.overlay.polygons.size() / kLanes;
  const auto batch = std::make_unique<PolygonBatch>();
  std::vector<Sample> result;
  for (int k = 0; k < n; k += std::max(1, n * kLanes / wanted)) {
    load_batch(s, k * kLanes, *batch);
    differentiate(*s.weights.measure, s.weights.kappa, *batch);
    for (int lane = 0; lane < kLanes; ++lane) {
      if (batch->is_negligible[lane]) continue;
      Sample sample;
      sample.polygon = s.x.overlay.polygons[k * kLanes + lane];
      for (int i = 0; i < 12; ++i) sample.x[static_cast<std::size_t>(i)] = batch->x[i][lane];
      for (int i = 0; i < 8; ++i)
        sample.rest_inverse[static_cast<std::size_t>(i)] = batch->rest_inverse[i][lane];
      for (int i = 0; i < 12; ++i)
        for (int j = 0; j < 12; ++j) sample.hessian(i, j) = batch->hessian.symmetric(i, j)[lane];
      result.push_back(sample);
    }
  }
  std::sort(result.begin(), result.end(),
            [](const Sample& p, const Sample& q) { return p.polygon.code < q.polygon.code; });
  return result;
}

/// Seconds per polygon of the fastest driver, tapes that are shared not counted; in the remark, how
/// much the Hessians differ in the middle and at most.
double time_adolc(const State& s, std::string& remark) {
  const std::vector<Sample> polygons = samples(s, 100 * kLanes);
  double best = 0;
  for (rivals::Driver driver : {rivals::Driver::kHessian, rivals::Driver::kHessian2,
                                rivals::Driver::kTapePerShape, rivals::Driver::kTapePerShape2}) {
    rivals::AdolC adolc(driver, s.weights.kappa);
    double seconds = 0;
    std::vector<double> difference;
    for (const Sample& p : polygons) {
      adolc.prepare(p.polygon, p.x.data(), p.rest_inverse.data());
      Timer timer;
      adolc.differentiate(p.polygon, p.x.data(), p.rest_inverse.data());
      seconds += timer.lap();
      double off = 0;
      for (int i = 0; i < 12; ++i)
        for (int j = 0; j < 12; ++j)
          off = std::max(off, std::abs(p.hessian(i, j) - adolc.hessian(i, j)));
      difference.push_back(off / p.hessian.norm());
    }
    seconds /= static_cast<double>(polygons.size());
    if (best > 0 && seconds >= best) continue;
    best = seconds;
    remark =
        std::string("ADOL-C, ") + rivals::name(driver) +
        Report::format("; Hessians differ by %.1e in the median", median(difference)) +
        Report::format(", %.1e at most", *std::max_element(difference.begin(), difference.end()));
  }
  return best;
}
#endif

void bench_derivatives(State& s, int repeats, Report& report) {
  const int n = s.x.overlay.polygons.size() / kLanes * kLanes;
  const auto batch = std::make_unique<PolygonBatch>();
  const double seconds = median_seconds(repeats, [&] {
    for (int first = 0; first < n; first += kLanes) {
      load_batch(s, first, *batch);
      differentiate(*s.weights.measure, s.weights.kappa, *batch);
    }
  });
  double rival = 0;
  std::string remark;
#ifdef ISM_BENCH_ADOLC
  rival = time_adolc(s, remark);
#endif
  report.add("E + g + H, per polygon", 1, seconds / n, 1e6, "us", rival, remark);
}

void bench_projection(State& s, int repeats, Report& report) {
  using Mat12 = Eigen::Matrix<double, 12, 12>;
  const int n = s.x.overlay.polygons.size() / kLanes * kLanes;
  const auto batch = std::make_unique<PolygonBatch>();
  std::vector<double> own, eigen;
  double difference = 0;
  for (int r = 0; r < repeats; ++r) {
    double seconds = 0, seconds_eigen = 0;
    int count = 0;
    for (int first = 0; first < n; first += 8 * kLanes) {
      load_batch(s, first, *batch);
      differentiate(*s.weights.measure, s.weights.kappa, *batch);
      std::array<Mat12, kLanes> H;
      for (int lane = 0; lane < kLanes; ++lane)
        for (int i = 0; i < 12; ++i)
          for (int j = 0; j < 12; ++j)
            H[static_cast<std::size_t>(lane)](i, j) = batch->hessian.symmetric(i, j)[lane];
      Timer timer;
      project_spd<6>(batch->hessian, s.weights.epsilon);
      seconds += timer.lap();
      for (Mat12& M : H) {
        const Eigen::SelfAdjointEigenSolver<Mat12> solver(M);
        M = solver.eigenvectors() * solver.eigenvalues().cwiseMax(s.weights.epsilon).asDiagonal() *
            solver.eigenvectors().transpose();
      }
      seconds_eigen += timer.lap();
      for (int lane = 0; lane < kLanes; ++lane, ++count) {
        const Mat12& M = H[static_cast<std::size_t>(lane)];
        for (int i = 0; i < 12; ++i)
          for (int j = 0; j <= i; ++j)
            difference =
                std::max(difference, std::abs(M(i, j) - batch->hessian(i, j)[lane]) / M.norm());
      }
    }
    own.push_back(seconds / count);
    eigen.push_back(seconds_eigen / count);
  }
  report.add("projection, per polygon", 1, median(own), 1e6, "us", median(eigen),
             "SelfAdjointEigenSolver; results differ by " + Report::format("%.1e", difference));
}

/// The system of one iteration: of this state alone, at a given ω_L.
LinearSystem bench_assembly(State& s, int threads, int repeats, Report& report) {
  const Executor run = executor(threads);
  const BlockMatrix laplacian = squared_laplacian(s.surface, run);
  ModelBuilder models(s.surface, s.weights, run);
  const double derivatives = median_seconds(repeats, [&] { models.differentiate_elements(s.x); });
  report.add("all derivatives, projected", threads, derivatives, 1e3, "ms");
  Array<QuadraticModel> history(1);
  const double assembly = median_seconds(repeats, [&] { history[0] = models.assemble(); });
  LinearSystem system;
  const double blending = median_seconds(repeats, [&] {
    system = blend(history, ism::detail::Tuning().history_decay, {}, laplacian, run);
  });
  report.add("assembly and blend", threads, assembly + blending, 1e3, "ms");
  return system;
}

void bench_ldlt(const State& s, const LinearSystem& system, double omega, int threads, int repeats,
                Report& report) {
  const ShiftedMatrix matrix = system.shifted(omega);
  const Executor run = executor(threads);
  LdltFactor factor;
  factor.data = std::make_shared<ism::detail::LdltData>();
  const double analysis = median_seconds(
      repeats, [&] { factor.data->symbolic = NestedDissection(system.H, s.x.x, run).build(); });
  const double factorisation =
      median_seconds(repeats, [&] { ldlt_refactorize(matrix, run, factor); });
  const double own = analysis + factorisation;
  rivals::Sparse A = rivals::lower_triangle(matrix);
  const Array<Vec2> b = negated(system.gradient);
  const Eigen::VectorXd flat_b = rivals::flattened(b);
  const auto residual = [&](const Eigen::VectorXd& x) {
    return Report::format("residual %.1e",
                          (A.selfadjointView<Eigen::Lower>() * x - flat_b).norm() / flat_b.norm());
  };
  Array<Vec2> x;
  const double solve = median_seconds(repeats, [&] { x = ldlt_solve(factor, b); });
  report.add("LDLT: analysis", threads, analysis, 1e3, "ms");
  report.add("LDLT: factorisation", threads, factorisation, 1e3, "ms", 0,
             std::to_string(factor.negative) + " negative pivots");
  report.add("LDLT: solve", threads, solve, 1e3, "ms", 0, residual(rivals::flattened(x)));
  Eigen::SimplicialLDLT<rivals::Sparse> simplicial;
  const double eigen = median_seconds((std::min)(repeats, 3), [&] { simplicial.compute(A); });
  const auto negative = (simplicial.vectorD().array() < 0).count();
  report.add("LDLT: analysis and factorisation", threads, own, 1e3, "ms", eigen,
             "Eigen::SimplicialLDLT, 1 thread; " + std::to_string(negative) + " negative pivots, " +
                 residual(simplicial.solve(flat_b)));
#ifdef ISM_BENCH_CHOLMOD
  rivals::set_blas_threads(threads);
  for (int ordering : {CHOLMOD_AMD, CHOLMOD_METIS}) {
    rivals::Cholmod cholmod(ordering);
    const double seconds = median_seconds(repeats, [&] { cholmod.factorize(A); });
    report.add("LDLT: analysis and factorisation", threads, own, 1e3, "ms", seconds,
               std::string("CHOLMOD supernodal, ") +
                   (ordering == CHOLMOD_AMD ? "AMD, " : "METIS, ") +
                   residual(cholmod.solve(flat_b)));
  }
#endif
}

void bench_run(const Problem& problem, int threads, Report& report) {
  ism::Options options;
  options.threads = threads;
  Timer timer;
  const ism::Result result = ism::compute_map(problem.a, problem.b, problem.landmarks, options);
  const double seconds = timer.lap();
  if (!ism::is_usable(result.status)) fail(result.message);
  std::vector<double> derivatives, assembly, solve, search, iteration;
  for (const ism::IterationLog& it : result.log) {
    derivatives.push_back(it.seconds_derivatives);
    assembly.push_back(it.seconds_assembly);
    solve.push_back(it.seconds_solve);
    search.push_back(it.seconds_search);
    iteration.push_back(derivatives.back() + assembly.back() + solve.back() + search.back());
  }
  report.title("A whole run");
  report.add("initial embedding", threads, result.start.seconds, 1, "s");
  report.add("derivatives of an iteration", threads, median(derivatives), 1e3, "ms");
  report.add("assembly", threads, median(assembly), 1e3, "ms");
  report.add("solve", threads, median(solve), 1e3, "ms");
  report.add("line search", threads, median(search), 1e3, "ms");
  report.add("an iteration", threads, median(iteration), 1e3, "ms", 0, "median over the run");
  report.add("the run", threads, seconds, 1, "s", 169 * 38,
             "the paper's 169 iterations of 38 s; here " + std::to_string(result.log.size()) +
                 Report::format(", distortion %.4f", result.final_state().mean_distortion) + ", " +
                 ism::to_string(result.status));
  std::printf("\nPeak memory of the run: %.0f MiB.\n", peak_memory());
}

void bench_state(State s, const char* title, double omega, const Arguments& args, Report& report) {
  report.title(title);
  bench_overlay(s, args.repeats, report);
  bench_derivatives(s, args.repeats, report);
  bench_projection(s, args.repeats, report);
  std::vector<int> threads(1, 1);
  if (args.threads > 1) threads.push_back(args.threads);
  for (int n : threads) {
    const LinearSystem system = bench_assembly(s, n, args.repeats, report);
    bench_ldlt(s, system, omega, n, args.repeats, report);
  }
}

// ---- growth with the number of triangles ----

Eigen::RowVector3d normal(const ism::TriangleMesh& mesh, int face) {
  const auto corner = [&](int k) -> Eigen::RowVector3d {
    return mesh.vertices.row(mesh.triangles(face, k));
  };
  return (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
}

/// Every triangle in four. New vertices lie above or below the middles of edges, by up to a tenth
/// of their lengths at random.
ism::TriangleMesh refined(const ism::TriangleMesh& mesh, std::mt19937& random) {
  constexpr double kHeight = 0.1;
  const int n = static_cast<int>(mesh.vertices.rows());
  const Array<EdgeUse> uses = sorted_edges(mesh.triangles);
  Array<int> middle(3 * static_cast<int>(mesh.triangles.rows()));
  std::vector<Eigen::RowVector3d> added;
  for_each_edge(uses, [&](int begin, int end) {
    for (int k = begin; k < end; ++k)
      middle[uses[k].half_edge] = n + static_cast<int>(added.size());
    const Eigen::RowVector3d lo = mesh.vertices.row(uses[begin].lo);
    const Eigen::RowVector3d hi = mesh.vertices.row(uses[begin].hi);
    const double height =
        kHeight * (2 * static_cast<double>(random()) / std::mt19937::max() - 1) * (hi - lo).norm();
    added.push_back(0.5 * (lo + hi) + height * normal(mesh, uses[begin].half_edge / 3));
  });
  ism::TriangleMesh fine;
  fine.vertices.resize(n + static_cast<int>(added.size()), 3);
  fine.vertices.topRows(n) = mesh.vertices;
  for (std::size_t i = 0; i < added.size(); ++i)
    fine.vertices.row(n + static_cast<int>(i)) = added[i];
  fine.triangles.resize(4 * mesh.triangles.rows(), 3);
  for (int f = 0; f < mesh.triangles.rows(); ++f) {
    const int m0 = middle[3 * f], m1 = middle[3 * f + 1], m2 = middle[3 * f + 2];
    fine.triangles.row(4 * f) << mesh.triangles(f, 0), m0, m2;
    fine.triangles.row(4 * f + 1) << mesh.triangles(f, 1), m1, m0;
    fine.triangles.row(4 * f + 2) << mesh.triangles(f, 2), m2, m1;
    fine.triangles.row(4 * f + 3) << m0, m1, m2;
  }
  return fine;
}

/// The slope of log y over log x by least squares.
double exponent(const std::vector<double>& x, const std::vector<double>& y) {
  double mx = 0, my = 0, xx = 0, xy = 0;
  const double n = static_cast<double>(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) mx += std::log(x[i]) / n, my += std::log(y[i]) / n;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double dx = std::log(x[i]) - mx;
    xx += dx * dx;
    xy += dx * (std::log(y[i]) - my);
  }
  return xy / xx;
}

void bench_scaling(const Arguments& args) {
  Problem problem = problem_of(args, "pig_camel_coarse", 32);
  std::printf("%s, refined; %d threads\n\n", problem.name.c_str(), args.threads);
  std::printf(
      "| triangles | on coarse levels | iterations | distortion | polygons | embedding s |"
      " coarse s | a full iteration s | run s | peak memory MiB |\n");
  std::printf("|---:|---|---:|---:|---:|---:|---:|---:|---:|---:|\n");
  std::vector<double> triangles, embedding, run;
  std::mt19937 random(1);
  for (;;) {
    const double n = static_cast<double>(problem.a.triangles.rows() + problem.b.triangles.rows());
    if (n > args.largest) break;
    ism::Options options;
    options.threads = args.threads;
    const auto start = bench::Clock::now();
    const ism::Result result = ism::compute_map(problem.a, problem.b, problem.landmarks, options);
    if (result.status != ism::Status::kConverged) fail(result.message);
    triangles.push_back(n);
    run.push_back(bench::seconds_since(start));
    embedding.push_back(result.start.seconds);
    std::string levels;
    for (const ism::IterationLog& last : result.coarse)
      levels += (levels.empty() ? "" : " + ") + std::to_string(last.iteration);
    double coarse = result.seconds;
    std::vector<double> full;
    for (const ism::IterationLog& log : result.log) {
      const double seconds =
          log.seconds_derivatives + log.seconds_assembly + log.seconds_solve + log.seconds_search;
      coarse -= seconds;
      if (!log.quasi_newton) full.push_back(seconds);
    }
    std::printf("| %.0f | %s | %d (%d) | %.4f | %d | %.1f | %.1f | %.3f | %.1f | %.0f |\n", n,
                levels.c_str(), static_cast<int>(result.log.size()), static_cast<int>(full.size()),
                result.final_state().mean_distortion, result.final_state().polygons,
                embedding.back(), coarse, median(full), run.back(), peak_memory());
    std::fflush(stdout);
    problem.a = refined(problem.a, random);
    problem.b = refined(problem.b, random);
  }
  std::printf("\nThe embedding grows as n^%.2f, the whole run as n^%.2f.\n",
              exponent(triangles, embedding), exponent(triangles, run));
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments args = parse(argc, argv);
  if (args.scaling) {
    bench_scaling(args);
    return 0;
  }
  const Problem problem = problem_of(args, "pig_camel", 100);
  std::printf("%s: %d + %d triangles\n", problem.name.c_str(),
              static_cast<int>(problem.a.triangles.rows()),
              static_cast<int>(problem.b.triangles.rows()));
  Report report;
  if (args.run) bench_run(problem, args.threads, report);
  ism::Options options;
  options.threads = args.threads;
  options.max_iterations = 20;
  const ism::Result result = ism::compute_map(problem.a, problem.b, problem.landmarks, options);
  if (!ism::is_usable(result.status)) fail(result.message);
  bench_state(State(problem, result.start.f, result.start.g), "The start", options.omega_start,
              args, report);
  bench_state(State(problem, result.f, result.g), "After 20 iterations", result.final_state().omega,
              args, report);
  if (!args.json.empty() && !report.write(args.json)) fail("cannot write " + args.json);
  return 0;
}

// How long a Solver takes to stop, and how long it is silent: it is told to stop at random moments,
// goes on, and so on, until it is done or time is up. With --embeddings, it begins anew as soon as
// there is a map; with --changes, the first landmark moves to a neighbour after every third
// iteration.
//
//   ism_latency A B [landmarks] [--threads N] [--seconds S] [--embeddings] [--changes] [--slide]
//               [--exact]

#include "problem.hpp"

#include <algorithm>
#include <atomic>
#include <map>
#include <random>
#include <string>
#include <thread>
#include <vector>

namespace {

using bench::Clock;
using bench::seconds_since;

int neighbour(const ism::TriangleMesh& mesh, int v) {
  for (Eigen::Index i = 0; i < mesh.triangles.size(); ++i)
    if (mesh.triangles.data()[i] == v) return mesh.triangles.data()[i % 3 == 2 ? i - 2 : i + 1];
  return v;
}

struct Samples {
  std::vector<double> seconds;

  void print(const char* what, const std::string& phase) {
    std::sort(seconds.begin(), seconds.end());
    std::printf("| %s | %s | %zu | %.1f | %.1f |\n", what, phase.c_str(), seconds.size(),
                1e3 * seconds[seconds.size() / 2], 1e3 * seconds.back());
  }
};

/// "embedding A: 400 vertices" without what differs from level to level.
std::string phase_of(const std::string& what) {
  return what.substr(0, what.find_first_of(":0123456789"));
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> files;
  ism::Options options;
  double limit = 300;
  bool only_embeddings = false, has_changes = false;
  for (int i = 1; i < argc; ++i) {
    const std::string flag = argv[i];
    if (flag == "--threads" && i + 1 < argc)
      options.threads = std::atoi(argv[++i]);
    else if (flag == "--seconds" && i + 1 < argc)
      limit = std::atof(argv[++i]);
    else if (flag == "--embeddings")
      only_embeddings = true;
    else if (flag == "--changes")
      has_changes = true;
    else if (flag == "--slide")
      options.boundary = ism::Boundary::kSlide;
    else if (flag == "--exact")
      options.exact_landmarks = true;
    else
      files.push_back(flag);
  }
  auto [name, a, b, landmarks] = bench::read_problem(files);

  std::atomic<bool> stop{false}, is_over{false};
  std::string phase = "start";
  std::map<std::string, Samples> latencies, gaps;
  Clock::time_point told = Clock::now(), pressed = told;
  options.stop = &stop;
  options.progress = [&](const ism::Progress& progress) {
    gaps[phase].seconds.push_back(seconds_since(told));
    told = Clock::now();
    phase = phase_of(progress.what);
    return true;
  };
  std::thread presser([&] {
    std::mt19937 random(1);
    while (!is_over) {
      std::this_thread::sleep_for(
          std::chrono::milliseconds(random() % (only_embeddings ? 300 : 1500)));
      if (stop) continue;
      pressed = Clock::now();
      stop = true;
    }
  });
  const Clock::time_point start = Clock::now();
  ism::Solver solver(a, b, landmarks, options);
  for (bool has_more = true; has_more && seconds_since(start) < limit;) {
    told = Clock::now();
    has_more = solver.step();
    if (stop) {
      latencies[phase].seconds.push_back(seconds_since(pressed));
      stop = false;
      const ism::Status status = solver.result().status;
      has_more = status == ism::Status::kNoMapYet || status == ism::Status::kCancelled;
    }
    if (only_embeddings && ism::is_usable(solver.result().status))
      solver = ism::Solver(a, b, landmarks, options);
    if (has_changes && solver.result().log.size() >= 3) {
      landmarks.at(0).b = neighbour(b, landmarks.at(0).b.vertex);
      const ism::Outcome outcome = solver.change(landmarks, options);
      if (outcome.status != ism::Status::kDone) bench::fail(outcome.message);
    }
  }
  is_over = true;
  presser.join();

  std::printf("%s after %zu iterations, %.0f s\n\n", ism::to_string(solver.result().status),
              solver.result().log.size(), seconds_since(start));
  std::printf("| what | phase | samples | median ms | worst ms |\n|---|---|---:|---:|---:|\n");
  for (auto& [where, samples] : latencies) samples.print("from \"stop\" to the return", where);
  for (auto& [where, samples] : gaps) samples.print("between two reports", where);
  if (solver.result().f.size() == 0) return 0;
  const ism::Result& r = solver.result();
  Clock::time_point begin = Clock::now();
  const ism::SurfaceMap map(r);
  std::printf("| SurfaceMap | | 1 | | %.1f |\n", 1e3 * seconds_since(begin));
  begin = Clock::now();
  const ism::MetaMesh meta = map.meta_mesh();
  std::printf("| meta mesh, %zu polygons | | 1 | | %.1f |\n", meta.face_a.size(),
              1e3 * seconds_since(begin));
  begin = Clock::now();
  const std::size_t n = map.distortion().size();
  std::printf("| distortion of %zu polygons | | 1 | | %.1f |\n", n, 1e3 * seconds_since(begin));
  return 0;
}

// What Solver::change() saves: a map is optimised, one landmark of B is moved along some edges, and
// the rest is solved with change() and from the start.
//
//   ism_resolve A B landmarks [--exact] [--edges N] [--moves N]

#include "problem.hpp"

#include <string>
#include <vector>

namespace {

/// A vertex that many edges away, on a path that does not turn back.
int walk(const ism::TriangleMesh& mesh, int v, int edges) {
  int before = -1;
  for (; edges > 0; --edges) {
    int next = -1;
    double farthest = -1;
    for (int f = 0; f < mesh.triangles.rows(); ++f)
      for (int k = 0; k < 3; ++k) {
        if (mesh.triangles(f, k) != v) continue;
        const int w = mesh.triangles(f, (k + 1) % 3);
        const double d = (mesh.vertices.row(w) - mesh.vertices.row(before < 0 ? v : before)).norm();
        if (d > farthest) farthest = d, next = w;
      }
    before = v;
    v = next;
  }
  return v;
}

struct Run {
  double seconds = 0;
  int steps = 0;
};

Run finish(ism::Solver& solver) {
  const bench::Clock::time_point start = bench::Clock::now();
  Run run;
  do ++run.steps;
  while (solver.step());
  run.seconds = bench::seconds_since(start);
  return run;
}

void print(const char* what, const Run& run, const ism::Result& r) {
  std::printf("| %s | %.1f | %zu | %.4f | %s |\n", what, run.seconds, r.log.size(),
              r.final_state().mean_distortion, ism::to_string(r.status));
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> files;
  ism::Options options;
  int edges = 3, moves = 2;
  for (int i = 1; i < argc; ++i) {
    const std::string arg = argv[i];
    if (arg == "--exact")
      options.exact_landmarks = true;
    else if (arg == "--edges" && i + 1 < argc)
      edges = std::atoi(argv[++i]);
    else if (arg == "--moves" && i + 1 < argc)
      moves = std::atoi(argv[++i]);
    else
      files.push_back(arg);
  }
  auto [name, a, b, landmarks] = bench::read_problem(files);
  if (landmarks.empty()) bench::fail("give two meshes, and landmarks");
  std::printf("| landmarks | s | iterations | distortion | status |\n|---|---:|---:|---:|---|\n");
  ism::Solver solver(a, b, landmarks, options);
  print("as given", finish(solver), solver.result());
  for (int move = 0; move < moves && move < static_cast<int>(landmarks.size()); ++move) {
    int& moved = landmarks[static_cast<std::size_t>(move)].b.vertex;
    moved = walk(b, moved, edges);
    const ism::Outcome outcome = solver.change(landmarks, options);
    if (outcome.status != ism::Status::kDone) bench::fail(outcome.message);
    print("one moved, change()", finish(solver), solver.result());
    ism::Solver anew(a, b, landmarks, options);
    print("the same from the start", finish(anew), anew.result());
  }
  return 0;
}

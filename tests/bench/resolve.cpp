// What Solver::change() saves: a map is optimised, one landmark of B is moved along some edges, and
// the rest is solved with change() and from the start.
//
//   ism_resolve A B landmarks [--exact] [--edges N] [--moves N]

#include "ism.hpp"
#include "mesh_io.hpp"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;

[[noreturn]] void fail(const std::string& message) {
  std::fprintf(stderr, "ism_resolve: %s\n", message.c_str());
  std::exit(2);
}

ism::TriangleMesh read(const std::string& path) {
  mesh_io::ReadResult result = mesh_io::read_mesh(path);
  if (!result.ok) fail(result.error);
  return result.mesh;
}

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
  const Clock::time_point start = Clock::now();
  Run run;
  do ++run.steps;
  while (solver.step());
  run.seconds = std::chrono::duration<double>(Clock::now() - start).count();
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
  if (files.size() != 3) fail("usage: ism_resolve A B landmarks [--exact] [--edges N] [--moves N]");
  const ism::TriangleMesh a = read(files[0]), b = read(files[1]);
  const mesh_io::PairsResult pairs = mesh_io::read_pairs(files[2]);
  if (!pairs.ok) fail(pairs.error);
  std::vector<ism::Landmark> landmarks;
  for (const mesh_io::IdPair& pair : pairs.pairs)
    landmarks.push_back({static_cast<int>(pair.a), static_cast<int>(pair.b)});
  std::printf("| landmarks | s | iterations | distortion | status |\n|---|---:|---:|---:|---|\n");
  ism::Solver solver(a, b, landmarks, options);
  print("as given", finish(solver), solver.result());
  for (int move = 0; move < moves && move < static_cast<int>(landmarks.size()); ++move) {
    int& moved = landmarks[static_cast<std::size_t>(move)].b.vertex;
    moved = walk(b, moved, edges);
    const ism::Outcome outcome = solver.change(landmarks, options);
    if (outcome.status != ism::Status::kDone) fail(outcome.message);
    print("one moved, change()", finish(solver), solver.result());
    ism::Solver anew(a, b, landmarks, options);
    print("the same from the start", finish(anew), anew.result());
  }
  return 0;
}

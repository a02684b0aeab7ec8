// How time and memory grow with vertices of many edges and with long boundaries.
//
//   ism_sizes [NAME [N [ITERATIONS]]]
//
// Maps pairs of size N, 2 N and 4 N and prints a table of seconds, peak memory and the exponents of
// their growth. NAME is one of those in tests/large.hpp; all without one.

#include "../large.hpp"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

namespace {

/// Forgets the peak of this process' memory, where the system can.
void forget_peak() { std::ofstream("/proc/self/clear_refs") << "5"; }

/// Peak memory in MiB since then; 0 where the system does not tell.
double peak_memory() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.rfind("VmHWM:", 0) == 0) return std::atof(line.c_str() + 6) / 1024;
  return 0;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

struct Case {
  const char* name;
  large::Pair (*make)(int n);
  int n;
};

const Case kCases[] = {{"fan_and_grid", large::fan_and_grid, 5000},
                       {"bipyramid_and_sphere", large::bipyramid_and_sphere, 500},
                       {"cap_and_grid", large::cap_and_grid, 1000},
                       {"rings", large::rings, 12500},
                       {"combs", large::combs, 2500}};

double exponent(double first, double last) { return std::log(last / first) / std::log(4.0); }

void measure(const Case& c, int n, int iterations) {
  double first_seconds = 0, first_memory = 0;
  for (int k = 1; k <= 4; k *= 2) {
    const large::Pair pair = c.make(k * n);
    ism::Options options;
    options.max_iterations = iterations;
    forget_peak();
    const auto start = std::chrono::steady_clock::now();
    const ism::Result result = ism::compute_map(pair.a, pair.b, {}, options);
    const double seconds = seconds_since(start), memory = peak_memory();
    if (k == 1) first_seconds = seconds, first_memory = memory;
    std::printf("| %s | %d | %d / %d | %s | %d | %.4f | %d | %.2f | %.2f | %.0f |", c.name, k * n,
                static_cast<int>(pair.a.triangles.rows()),
                static_cast<int>(pair.b.triangles.rows()), ism::to_string(result.status),
                static_cast<int>(result.log.size()), result.final_state().mean_distortion,
                result.final_state().polygons, result.start.seconds, seconds, memory);
    if (k == 4)
      std::printf(" %.2f | %.2f |\n", exponent(first_seconds, seconds),
                  exponent(first_memory, memory));
    else
      std::printf(" | |\n");
    if (!result.message.empty()) std::fprintf(stderr, "%s\n", result.message.c_str());
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = argc > 1 ? argv[1] : "";
  const int n = argc > 2 ? std::atoi(argv[2]) : 0, iterations = argc > 3 ? std::atoi(argv[3]) : 10;
  std::printf(
      "| pair | n | triangles A / B | status | iterations | distortion | polygons | embedding s "
      "| ");
  std::printf("total s | peak MB | growth of s | of MB |\n");
  std::printf("|---|---:|---:|---|---:|---:|---:|---:|---:|---:|---:|---:|\n");
  for (const Case& c : kCases)
    if (name.empty() || name == c.name) measure(c, n > 0 ? n : c.n, iterations);
}

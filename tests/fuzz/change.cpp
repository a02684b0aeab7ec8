// Fuzz target: a Solver is stopped, changed while it runs, and begun anew at the positions it had.

#include "random_input.hpp"

namespace {

using fuzz::Bytes;
using fuzz::Input;
using fuzz::require;
using ism::Solver;

void steps(Solver& solver, int n) {
  while (n-- > 0 && solver.step()) {
  }
  fuzz::require_result(solver.result());
}

/// Another wish is refused with a reason and nothing is changed, or the run goes on with it.
void require_changes(Bytes& bytes, Input& in, Solver& solver) {
  const ism::Result before = solver.result();
  const std::vector<ism::Landmark> landmarks = fuzz::read_landmarks(bytes, in);
  const ism::Options options = fuzz::read_options(bytes, in);
  const ism::Outcome outcome = solver.change(landmarks, options);
  if (!ism::is_usable(outcome.status)) {
    require(!outcome.message.empty(), "a refusal says why");
    require(fuzz::same(before, solver.result()), "a change that is refused changes nothing");
  }
  fuzz::require_result(solver.result());
  steps(solver, bytes.below(4));
}

/// Positions of a result are a start on the meshes that were embedded, with other landmarks, too.
void require_resumes(Bytes& bytes, Input& in, const ism::Result& result) {
  if (!ism::is_usable(result.status) || ism::SurfaceMap(result).status() != ism::Status::kDone)
    return;
  ism::Options options = in.options;
  options.initial_f = result.f;
  options.initial_g = result.g;
  options.pins_a = options.pins_b = options.fixed_a = options.fixed_b = {};
  Solver other(*result.start.a, *result.start.b, fuzz::read_landmarks(bytes, in), options);
  steps(other, bytes.between(1, 4));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  Input in = fuzz::read_input(bytes);
  in.options.max_seconds = std::numeric_limits<double>::infinity();  // the same each time
  Solver solver(in.a, in.b, in.landmarks, in.options);
  steps(solver, bytes.below(12));
  if (bytes.flag())
    require_changes(bytes, in, solver);
  else
    require_resumes(bytes, in, solver.result());
  return 0;
}

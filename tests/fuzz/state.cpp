// Fuzz target: a Solver is stopped, saved, restored from what was saved and from what was spoilt,
// and changed while it runs.

#include "random_input.hpp"

#include <initializer_list>

namespace {

using fuzz::Bytes;
using fuzz::Input;
using fuzz::require;
using ism::Solver;
using ism::SolverState;

void steps(Solver& solver, int n) {
  while (n-- > 0 && solver.step()) {
  }
  fuzz::require_result(solver.result());
}

int next_to(int value, int step) {
  return static_cast<int>(static_cast<unsigned>(value) + static_cast<unsigned>(step));
}
double next_to(double value, int step) { return value + step; }

/// Changes, inserts or erases one entry.
template <class T>
void spoil(Bytes& bytes, std::vector<T>& list, T value) {
  const std::ptrdiff_t i = bytes.below(static_cast<int>(list.size()) + 1);
  const auto at = list.begin() + i;
  const int kind = bytes.below(4);
  if (kind == 0) {
    list.insert(at, value);
  } else if (at != list.end()) {
    if (kind == 1) list.erase(at);
    if (kind == 2) *at = value;
    if (kind == 3) *at = next_to(*at, bytes.between(-1, 1));
  }
}

int read_entry(Bytes& bytes) {
  static const int kOdd[] = {0,
                             1,
                             2,
                             3,
                             -1,
                             1 << 20,
                             (std::numeric_limits<int>::max)(),
                             (std::numeric_limits<int>::min)()};
  const int kind = bytes.byte();
  return kind < 64 ? kind : kind < 70 ? bytes.raw<std::int32_t>() : kOdd[kind % 8];
}

SolverState spoilt(Bytes& bytes, SolverState state) {
  for (int i = bytes.below(6); i > 0; --i)
    if (bytes.flag())
      spoil(bytes, state.integers, read_entry(bytes));
    else
      spoil(bytes, state.numbers, bytes.number());
  return state;
}

bool same(const SolverState& a, const SolverState& b) {
  return a.integers == b.integers && a.numbers.size() == b.numbers.size() &&
         std::memcmp(a.numbers.data(), b.numbers.data(), a.numbers.size() * sizeof(double)) == 0;
}

/// What was saved goes on to the same bits.
void require_resumes(const Input& in, Solver& solver, int n) {
  Solver other(in.a, in.b, in.landmarks, in.options);
  if (!other.restore(solver.state())) {
    require(!ism::is_usable(solver.result().status), "what was saved can be restored");
    return;
  }
  steps(solver, n), steps(other, n);
  if (ism::is_usable(solver.result().status) && ism::is_usable(other.result().status))
    require(fuzz::same(solver.result(), other.result()), "a restored run goes on alike");
}

/// What was spoilt is refused and nothing is changed, or it is a valid state.
void require_refuses(Bytes& bytes, const Input& in, const SolverState& state) {
  Solver solver(in.a, in.b, in.landmarks, in.options);
  steps(solver, bytes.below(4));
  const SolverState before = solver.state();
  if (!solver.restore(spoilt(bytes, state)))
    require(same(solver.state(), before), "a state that is refused changes nothing");
  fuzz::require_result(solver.result());
  steps(solver, bytes.below(3));
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

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  const int kind = bytes.below(4);
  Input in = fuzz::read_input(bytes);
  in.options.max_seconds = std::numeric_limits<double>::infinity();  // the same each time
  Solver solver(in.a, in.b, in.landmarks, in.options);
  steps(solver, bytes.below(12));
  if (kind == 0) require_resumes(in, solver, bytes.between(1, 4));
  if (kind == 1 || kind == 2) require_refuses(bytes, in, solver.state());
  if (kind == 3) require_changes(bytes, in, solver);
  return 0;
}

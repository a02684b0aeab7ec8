// Fuzz target: small meshes, valid or not, are mapped with any landmarks and options.

#include "random_input.hpp"

namespace {

using fuzz::Bytes;
using fuzz::Input;
using fuzz::require;

/// Cancels after some calls, if at all, and checks what it is told.
void watch(ism::Options& options, int calls) {
  options.progress = [calls, last = 0.0](const ism::Progress& p) mutable {
    require(p.fraction >= last && p.fraction <= 1, "progress never falls");
    last = p.fraction;
    return calls == 0 || --calls > 0;
  };
}

void require_embedding(const ism::Embedding& e) {
  require(!e.message.empty() || ism::is_usable(e.status), "a failure says why");
  if (!ism::is_usable(e.status)) return;
  fuzz::require_injective(e.a->triangles, e.f);
  fuzz::require_injective(e.b->triangles, e.g);
}

void require_mapped(const ism::Result& result, Bytes& bytes) {
  fuzz::require_result(result);
  const ism::SurfaceMap map(result);
  if (!ism::is_usable(result.status)) {
    require(map.status() == result.status, "no map has the status of the result");
    fuzz::ask(map, bytes);
    return;
  }
  require(map.status() == ism::Status::kDone, "a usable result is a map: " + map.message());
  fuzz::require_map(map, result.f, result.g, bytes);
  if (map.is_closed()) return;  // its parts are surfaces of their own
  const ism::SurfaceMap other(*result.start.a, *result.start.b, result.f, result.g);
  require(other.status() == ism::Status::kDone, "positions are a map: " + other.message());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  Input in = fuzz::read_input(bytes);
  const int kind = bytes.below(8);
  if (kind > 3) watch(in.options, kind > 5 ? bytes.below(64) : 0);

  if (kind == 3) {
    require_embedding(ism::initial_embedding(in.a, in.b, in.landmarks, in.options));
    return 0;
  }
  require_mapped(ism::compute_map(in.a, in.b, in.landmarks, in.options), bytes);
  return 0;
}

// Programs that have floating-point exceptions trap, as engines do while they are developed, run
// the library as others do.

#include "ism.hpp"
#include "runs.hpp"
#include "shapes.hpp"

#include <doctest/doctest.h>

#include <cfenv>
#include <utility>
#include <vector>

#ifdef __GLIBC__

namespace {

/// While it lives, invalid operations, divisions by zero and overflows end the program.
class Traps {
 public:
  Traps() { feenableexcept(kAll); }
  Traps(const Traps&) = delete;
  Traps& operator=(const Traps&) = delete;
  ~Traps() { fedisableexcept(kAll); }

 private:
  static constexpr int kAll = FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW;
};

/// A run, and everything that may be asked of its map.
void check_run(const ism::TriangleMesh& a, const ism::TriangleMesh& b,
               const std::vector<ism::Landmark>& landmarks, ism::Options options) {
  options.max_iterations = 15;
  const Traps traps;
  const ism::Result result = ism::compute_map(a, b, landmarks, options);
  const ism::SurfaceMap map(result);
  const ism::Status verified = ism::verify(map).status;
  const std::vector<ism::MappedPoint> images = map.forward_vertices();
  const ism::MetaMesh meta = map.meta_mesh();
  CAPTURE(result.message);
  CHECK(ism::is_usable(result.status));
  CHECK(verified == ism::Status::kDone);
  CHECK(static_cast<ptrdiff_t>(images.size()) >= a.vertices.rows());
  CHECK(meta.face_a.size() > 0);
  CHECK(fegetexcept() == (FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW));  // still
}

}  // namespace

TEST_CASE("maps of all kinds are found where floating-point exceptions trap") {
  const std::pair<shapes::Disk, shapes::Disk> pair = runs::square_pair(5);
  const auto check = [&](auto set) {
    ism::Options options;
    set(options);
    check_run(pair.first.mesh, pair.second.mesh, {{30, 40}}, options);
  };
  check([](ism::Options&) {});
  check([](ism::Options& o) { o.threads = 3; });
  check([](ism::Options& o) { o.boundary = ism::Boundary::kFixed; });
  check([](ism::Options& o) { o.boundary = ism::Boundary::kSlide; });
  check([](ism::Options& o) { o.exact_landmarks = true; });
  check([](ism::Options& o) { o.measure = ism::arap(); });
  check([](ism::Options& o) { o.measure = ism::sarap(); });
  check([](ism::Options& o) { o.measure = ism::asap(); });
  check([](ism::Options& o) { o = ism::Options::paper(); });
}

TEST_CASE("closed surfaces are mapped where floating-point exceptions trap") {
  check_run(shapes::sphere(2), shapes::sphere(2), {}, {});
}

#endif

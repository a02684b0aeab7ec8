// Programs that have floating-point exceptions trap, as engines do while they are developed, run
// the library as others do.

#include "hostile.hpp"
#include "ism.hpp"
#include "ism_verify.hpp"
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

/// A run, and everything that may be asked of its map. Returns how it ended.
ism::Status run(const ism::TriangleMesh& a, const ism::TriangleMesh& b,
                const std::vector<ism::Landmark>& landmarks, ism::Options options) {
  options.max_iterations = 15;
  const Traps traps;
  const ism::Result result = ism::compute_map(a, b, landmarks, options);
  CAPTURE(result.message);
  CHECK(fegetexcept() == (FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW));  // still
  if (!ism::is_usable(result.status)) return result.status;
  const ism::SurfaceMap map(result);
  const ism::Status verified = ism::verify_map(map).status;
  const std::vector<ism::SurfacePoint> images = map.forward_vertices();
  const ism::MetaMesh meta = map.meta_mesh();
  const ism::TriangleMesh moved = ism::remesh(map, ism::Side::kA);
  const std::vector<ism::PolygonDistortion> distortion = map.distortion();
  CHECK(verified == ism::Status::kDone);
  CHECK(images.size() > 0);
  CHECK(meta.face_a.size() > 0);
  CHECK(distortion.size() > 0);
  CHECK(moved.vertices.rows() > 0);
  CHECK(fegetexcept() == (FE_INVALID | FE_DIVBYZERO | FE_OVERFLOW));
  return result.status;
}

void check_run(const ism::TriangleMesh& a, const ism::TriangleMesh& b,
               const std::vector<ism::Landmark>& landmarks, const ism::Options& options) {
  CHECK(ism::is_usable(run(a, b, landmarks, options)));
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
  check([](ism::Options& o) { o.tolerance = 0; });
}

TEST_CASE("what is refused is refused where floating-point exceptions trap") {
  const std::pair<shapes::Disk, shapes::Disk> pair = runs::square_pair(5);
  ism::Options options = shapes::from_planes(pair.first, pair.second);
  options.initial_g.array() += 1e3;  // beside the other one
  CHECK(run(pair.first.mesh, pair.second.mesh, {}, options) == ism::Status::kNoOverlap);
  for (std::uint64_t seed = 0; seed < hostile::kDefects; ++seed) {
    const hostile::Broken broken = hostile::broken(seed);
    CAPTURE(broken.name);
    const Traps traps;
    ism::validate(broken.mesh);
    ism::prepare(broken.mesh);
  }
}

TEST_CASE("surfaces at the edge of what a mesh can be are mapped where exceptions trap") {
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    const hostile::Case c = hostile::valid_case(seed);
    CAPTURE(c.name);
    if (!c.a.shape.is_large && !c.b.shape.is_large) run(c.a.mesh, c.b.mesh, c.landmarks, c.options);
  }
}

TEST_CASE("closed surfaces are mapped where floating-point exceptions trap") {
  check_run(shapes::sphere(2), shapes::sphere(2), {}, {});
}

#endif

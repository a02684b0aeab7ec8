// Reading and writing of mesh files (examples/mesh_io.hpp).

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <clocale>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "ism.hpp"
#include "landmarks.hpp"
#include "mesh_io.hpp"

namespace {

namespace fs = std::filesystem;

/// A folder of this test case, removed at its end.
class Folder {
 public:
  Folder() {
    static int count = 0;
    const auto tick = std::chrono::steady_clock::now().time_since_epoch().count();
    path_ = fs::temp_directory_path() /
            ("ism_mesh_io_" + std::to_string(tick) + '_' + std::to_string(count++));
    fs::create_directories(path_);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ec;
    fs::remove_all(path_, ec);
  }
  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  fs::path path_;
};

mesh_io::ReadResult read_text(const std::string& name, const std::string& text) {
  const Folder folder;
  std::ofstream(folder.file(name), std::ios::binary) << text;
  mesh_io::ReadResult result = mesh_io::read_mesh(folder.file(name));
  const std::size_t slash = result.error.find(name);
  if (slash != std::string::npos) result.error = result.error.substr(slash);
  return result;
}

std::vector<std::vector<int>> rows(const ism::Triangles& t) {
  std::vector<std::vector<int>> list;
  for (Eigen::Index i = 0; i < t.rows(); ++i) list.push_back({t(i, 0), t(i, 1), t(i, 2)});
  return list;
}

/// Signed areas of the triangles of a mesh in the plane z = 0; their smallest and their sum.
struct Areas {
  double least, sum;
};
Areas planar_areas(const ism::TriangleMesh& m) {
  Areas result{1e300, 0};
  for (Eigen::Index i = 0; i < m.triangles.rows(); ++i) {
    const Eigen::Vector3d a = m.vertices.row(m.triangles(i, 0)),
                          b = m.vertices.row(m.triangles(i, 1)),
                          c = m.vertices.row(m.triangles(i, 2));
    const double area = (b - a).cross(c - a).z() / 2;
    result.least = (std::min)(result.least, area);
    result.sum += area;
  }
  return result;
}

/// One polygon in the plane as an OBJ file.
mesh_io::ReadResult read_polygon(const std::vector<std::array<double, 2>>& corners) {
  std::string text, face = "f";
  for (std::size_t i = 0; i < corners.size(); ++i) {
    text += "v " + std::to_string(corners[i][0]) + ' ' + std::to_string(corners[i][1]) + " 0\n";
    face += ' ' + std::to_string(i + 1);
  }
  return read_text("p.obj", text + face + '\n');
}

const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

template <class T>
void put(std::string& text, T value, bool big_endian) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof value);  // the tests run on little-endian machines
  if (big_endian) std::reverse(bytes, bytes + sizeof bytes);
  text.append(bytes, sizeof bytes);
}

/// A square of two triangles with properties before, between and behind the needed ones.
std::string binary_ply(bool big_endian) {
  std::string text = std::string("ply\nformat ") +
                     (big_endian ? "binary_big_endian" : "binary_little_endian") +
                     " 1.0\ncomment a square\nelement camera 1\nproperty short k\n"
                     "element vertex 4\nproperty uchar red\nproperty float x\nproperty double y\n"
                     "property list uchar int16 more\nproperty float32 z\n"
                     "element face 2\nproperty float quality\n"
                     "property list uint8 uint32 vertex_index\nproperty uchar flag\nend_header\n";
  put<std::int16_t>(text, -7, big_endian);
  for (int v = 0; v < 4; ++v) {
    put<std::uint8_t>(text, 200, big_endian);
    put<float>(text, v == 1 || v == 2 ? 1.0f : 0.0f, big_endian);
    put<double>(text, v >= 2 ? 1.5 : 0.0, big_endian);
    put<std::uint8_t>(text, static_cast<std::uint8_t>(v), big_endian);
    for (int k = 0; k < v; ++k) put<std::int16_t>(text, 5, big_endian);
    put<float>(text, -0.25f, big_endian);
  }
  for (std::uint32_t f = 0; f < 2; ++f) {
    put<float>(text, 0.5f, big_endian);
    put<std::uint8_t>(text, 3, big_endian);
    for (const std::uint32_t v : {0u, f + 1, f + 2}) put<std::uint32_t>(text, v, big_endian);
    put<std::uint8_t>(text, 1, big_endian);
  }
  return text;
}

/// A square of two triangles.
std::string binary_stl(const std::string& header, std::uint32_t count) {
  std::string text = header;
  text.resize(80, ' ');
  put<std::uint32_t>(text, count, false);
  for (const std::array<float, 9>& t :
       {std::array<float, 9>{0, 0, 0, 1, 0, 0, 1, 1, 0}, {0, 0, 0, 1, 1, 0, -0.0f, 1, 0}}) {
    for (int k = 0; k < 3; ++k) put<float>(text, 0, false);
    for (const float x : t) put<float>(text, x, false);
    put<std::uint16_t>(text, 7, false);
  }
  return text;
}

}  // namespace

TEST_CASE("OBJ: all forms of a face, negative indices, comments, CRLF and continued lines") {
  const mesh_io::ReadResult r = read_text(
      "m.obj",
      "\xEF\xBB\xBF# made by hand\r\nmtllib x.mtl\r\no thing\r\nv 0 0 0 1 0.5 0.5 0.5\r\n"
      "v +1 0 -0.0\r\nv 1. 1 0 # corner\r\nv .0 1e0 0\r\nvt 0 0\r\nvn 0 0 1\r\ns off\r\n"
      "f 1/1/1 2/1/1 3/1/1\r\nf 1//1 \\\r\n 3//1 4//1\r\nv 2 0 0\nf -1 3 2/1\nf 2/1 1/ 5");
  REQUIRE_MESSAGE(r.ok, r.error);
  CHECK(r.mesh.vertices.rows() == 5);
  CHECK(r.mesh.vertices.row(2) == Eigen::RowVector3d(1, 1, 0));
  CHECK(rows(r.mesh.triangles) ==
        std::vector<std::vector<int>>{{0, 1, 2}, {0, 2, 3}, {4, 2, 1}, {1, 0, 4}});
  CHECK(r.planar.rows() == 0);
}

TEST_CASE("OBJ: faces may come before their vertices") {
  const mesh_io::ReadResult r = read_text("m.obj", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n");
  REQUIRE(r.ok);
  CHECK(r.mesh.triangles.rows() == 1);
}

TEST_CASE("OBJ: one vt per vertex is read, whatever its order; seams are not") {
  mesh_io::ReadResult r = read_text(
      "m.obj", kSquare + "vt 9 9\nvt 3 0.5\nvt 1\nvt 7 7\nvt 7 7\nf 1/3 2/1 3/2\nf 1/3 3/2 4/4\n");
  REQUIRE(r.ok);
  ism::Points2 expected(4, 2);
  expected << 1, 0, 9, 9, 3, 0.5, 7, 7;
  CHECK(r.planar == expected);
  // Equal values at different places in the file are no seam.
  r = read_text("m.obj", kSquare + "vt 0 1\nvt 2 2\nvt 0 1\nf 1/1 2/2 3/2\nf 1/3 3/2 4/2\n");
  CHECK(r.planar.rows() == 4);
  r = read_text("m.obj", kSquare + "vt 0 1\nvt 2 2\nf 1/1 2/2 3/2\nf 1/2 3/2 4/2\n");
  CHECK(r.ok);
  CHECK(r.planar.rows() == 0);
  r = read_text("m.obj", kSquare + "vt 0 1\nf 1/1 2/1 3/1\n");  // vertex 4 has none
  CHECK(r.ok);
  CHECK(r.planar.rows() == 0);
  r = read_text("m.obj", kSquare + "vt 0 1\nf 1/1 2/5 3/1\nf 1/1 3/1 4/1\n");  // no fifth vt
  CHECK(r.ok);
  CHECK(r.planar.rows() == 0);
}

TEST_CASE("OBJ: every corner has its own vt, also of cut polygons") {
  const std::string vt = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
  mesh_io::ReadResult r = read_text("m.obj", kSquare + vt + "f 1/2 2/3 3/4 4/1\n");
  REQUIRE(r.ok);
  REQUIRE(r.corner_uv.rows() == 6);
  for (Eigen::Index c = 0; c < 6; ++c) {  // vertex v has vt v + 1
    const int id = (r.mesh.triangles(c / 3, c % 3) + 1) % 4;
    CHECK(r.corner_uv(c, 0) == (id == 1 || id == 2));
    CHECK(r.corner_uv(c, 1) == (id == 2 || id == 3));
  }
  r = read_text("m.obj", kSquare + vt + "f 1/1 2/2 3/3\nf 1/4 3/4 4/4\n");  // a seam
  REQUIRE(r.corner_uv.rows() == 6);
  CHECK(r.corner_uv.row(0) == Eigen::RowVector2d(0, 0));
  CHECK(r.corner_uv.row(3) == Eigen::RowVector2d(0, 1));
  CHECK(read_text("m.obj", kSquare + vt + "f 1 2 3\nf 1 3 4\n").corner_uv.rows() == 0);
  for (const char* faces : {"f 1/1 2/2 3/3\nf 1 3 4\n", "f 1/1 2/2 3/3\nf 1/9 3/9 4/9\n"}) {
    r = read_text("m.obj", kSquare + vt + faces);  // the second face has none
    CHECK(r.ok);
    REQUIRE(r.corner_uv.rows() == 6);
    CHECK(r.corner_uv.topRows(3).allFinite());
    CHECK(r.corner_uv.bottomRows(3).array().isNaN().all());
  }
}

TEST_CASE("OFF: header variants, comments, colours and missing headers") {
  const std::string body =
      "# c\n 4 2 0\n0 0 0 255 0 0\n\n1 0 0\n1 1 0 # d\n0 1 0\n"
      "3 0 1 2 0.5 0.5 0.5\n3 0 2 3\n";
  for (const char* header : {"OFF\n", "COFF\n", "NOFF \n", "STCNOFF\r\n", "", "OFF\t"}) {
    CAPTURE(header);
    const mesh_io::ReadResult r = read_text("m.OFF", header + body);
    REQUIRE_MESSAGE(r.ok, r.error);
    CHECK(r.mesh.vertices.rows() == 4);
    CHECK(rows(r.mesh.triangles) == std::vector<std::vector<int>>{{0, 1, 2}, {0, 2, 3}});
  }
  CHECK(read_text("m.off", "4OFF\n1 0 0\n").error ==
        "m.off, line 1: only OFF files of points in space can be read, not 4OFF");
  CHECK(read_text("m.off", "OFF BINARY\n").error ==
        "m.off, line 1: binary OFF files cannot be read");
}

TEST_CASE("PLY: ascii, any layout") {
  const mesh_io::ReadResult r = read_text(
      "m.ply",
      "ply\r\nformat ascii 1.0\r\ncomment c \\\r\nelement vertex 4\r\nproperty float nx\r\n"
      "property float z\r\nproperty float x\r\nproperty float y\r\nelement face 1\r\n"
      "property list uchar int vertex_indices\r\nproperty list uchar float texcoord\r\n"
      "element edge 1\r\nproperty int a\r\nend_header\r\n9 0.5 0 0\r\n9 0.5 1 0\r\n"
      "9 0.5 1 1\r\n9 0.5 0 1\r\n4 0 1 2 3 2 0.1 0.2\r\n5\r\n");
  REQUIRE_MESSAGE(r.ok, r.error);
  CHECK(r.mesh.vertices.row(2) == Eigen::RowVector3d(1, 1, 0.5));
  CHECK(r.mesh.triangles.rows() == 2);
}

TEST_CASE("PLY: binary, both byte orders, all properties skipped that are not needed") {
  for (const bool big_endian : {false, true}) {
    const mesh_io::ReadResult r = read_text("m.ply", binary_ply(big_endian));
    REQUIRE_MESSAGE(r.ok, r.error);
    CHECK(r.mesh.vertices.row(2) == Eigen::RowVector3d(1, 1.5, -0.25));
    CHECK(rows(r.mesh.triangles) == std::vector<std::vector<int>>{{0, 1, 2}, {0, 2, 3}});
  }
}

TEST_CASE("polygons: a quad is cut along its shorter diagonal") {
  mesh_io::ReadResult r = read_polygon({{0, 0}, {3, 0}, {4, 1}, {1, 1}});
  REQUIRE(r.ok);
  CHECK(r.mesh.triangles.rows() == 2);
  for (const std::vector<int>& t : rows(r.mesh.triangles)) {
    CHECK(std::count(t.begin(), t.end(), 1) == 1);
    CHECK(std::count(t.begin(), t.end(), 3) == 1);
  }
  r = read_polygon({{1, 0}, {4, 0}, {3, 1}, {0, 1}});
  for (const std::vector<int>& t : rows(r.mesh.triangles))
    CHECK(std::count(t.begin(), t.end(), 0) == 1);
}

TEST_CASE("polygons: concave ones and straight corners give positive triangles that add up") {
  struct Case {
    const char* name;
    std::vector<std::array<double, 2>> corners;
    double area;
  };
  const std::vector<Case> cases = {
      {"dart", {{0, 0}, {2, -1}, {0, 3}, {-2, -1}}, 6},
      {"dart whose shorter diagonal is outside", {{0, 0}, {1, 5}, {0, 1}, {-1, 5}}, 1},
      {"quad with a straight corner", {{0, 0}, {1, 0}, {2, 0}, {0, 2}}, 2},
      {"square with all edges halved",
       {{0, 0}, {1, 0}, {2, 0}, {2, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}},
       4},
      {"L", {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}}, 3},
      {"comb",
       {{0, 0},
        {5, 0},
        {5, 3},
        {4, 3},
        {4, 1},
        {3, 1},
        {3, 3},
        {2, 3},
        {2, 1},
        {1, 1},
        {1, 3},
        {0, 3}},
       11},
  };
  for (const Case& c : cases) {
    CAPTURE(c.name);
    const mesh_io::ReadResult r = read_polygon(c.corners);
    REQUIRE_MESSAGE(r.ok, r.error);
    CHECK(r.mesh.triangles.rows() == static_cast<Eigen::Index>(c.corners.size()) - 2);
    CHECK(planar_areas(r.mesh).least > 0.01);
    CHECK(planar_areas(r.mesh).sum == doctest::Approx(c.area));
  }
}

TEST_CASE("polygons: random stars of many corners, also tilted in space") {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0.2, 1.0);
  for (const int n : {5, 8, 31, 60, 900}) {
    std::vector<std::array<double, 2>> corners;
    double area = 0;
    for (int i = 0; i < n; ++i) {
      const double angle = 6.283185307179586 * i / n, radius = 100 * uniform(random);
      corners.push_back({radius * std::cos(angle), radius * std::sin(angle)});
    }
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const std::array<double, 2>&p = corners[i], &q = corners[(i + 1) % corners.size()];
      area += (p[0] * q[1] - p[1] * q[0]) / 2;
    }
    const mesh_io::ReadResult r = read_polygon(corners);
    REQUIRE_MESSAGE(r.ok, r.error);
    CHECK(r.mesh.triangles.rows() == n - 2);
    CHECK(planar_areas(r.mesh).least > 0);
    CHECK(planar_areas(r.mesh).sum == doctest::Approx(area));
  }
  const mesh_io::ReadResult dart =
      read_text("m.obj", "v 5 0 0\nv 7 -1 -1.5\nv 5 3 4.5\nv 3 -1 -1.5\nf 1 2 3 4\n");  // z = 1.5 y
  REQUIRE(dart.ok);
  CHECK(planar_areas(dart.mesh).least > 1);
}

TEST_CASE("polygons: a hole behind a bridge becomes an opening, in either direction") {
  const std::string points =
      "v 0 0 0\nv 4 0 0\nv 4 3 0\nv 0 3 0\nv 1 1 0\nv 1 2 0\nv 3 2 0\nv 3 1 0\n";
  for (const char* face : {"f 1 2 3 4 1 5 6 7 8 5\n", "f 5 1 2 3 4 1 5 6 7 8\n"}) {
    const mesh_io::ReadResult r = read_text("p.obj", points + face);
    REQUIRE_MESSAGE(r.ok, r.error);
    CHECK(r.notes.empty());
    CHECK(r.mesh.triangles.rows() == 8);
    CHECK(planar_areas(r.mesh).least > 0.1);
    CHECK(planar_areas(r.mesh).sum == doctest::Approx(10));
    CHECK(ism::validate(r.mesh).empty());
  }
  // The bridges of two holes meet in one corner, and the vertices of a bridge may be two each.
  std::string text =
      "v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nv 2 5 0\nv 2 6 0\nv 3 6 0\nv 5 2 0\n"
      "v 5 3 0\nv 6 2 0\n";
  mesh_io::ReadResult r = read_text("p.obj", text + "f 1 2 3 4 1 5 6 7 5 1 8 9 10 8\n");
  REQUIRE(r.ok);
  CHECK(r.notes.empty());
  CHECK(planar_areas(r.mesh).least > 0.1);
  CHECK(planar_areas(r.mesh).sum == doctest::Approx(80));
  CHECK(ism::validate(r.mesh).empty());
  r = read_text("p.obj", points + "v 0 0 0\nv 1 1 0\nf 1 2 3 4 9 10 6 7 8 5\n");
  REQUIRE(r.ok);
  CHECK(r.notes.empty());
  CHECK(planar_areas(r.mesh).sum == doctest::Approx(10));
}

TEST_CASE("repeated corners are taken out, and faces without area dropped") {
  using Notes = std::vector<std::string>;
  mesh_io::ReadResult r = read_text("p.obj", kSquare + "f 1 2 2 3\nf 3 4 1 1\n");
  REQUIRE(r.ok);
  CHECK(rows(r.mesh.triangles) == std::vector<std::vector<int>>{{0, 1, 2}, {2, 3, 0}});
  CHECK(r.notes == Notes{"took repeated corners out of 2 faces (lines 5, 6)"});
  CHECK(r.edges.size() == 5);
  // Two vertices of one place: the face has three corners, whichever ids.
  r = read_text("p.obj", kSquare + "v 1 0 0\nvt 0 0\nvt 7 0\nvt 8 0\nf 1/1 2/2 5/1 3/3\n");
  REQUIRE(r.ok);
  CHECK(rows(r.mesh.triangles) == std::vector<std::vector<int>>{{0, 1, 2}});
  CHECK(r.corner_uv.col(0) == Eigen::Vector3d(0, 7, 8));
  CHECK(r.notes == Notes{"took repeated corners out of 1 face (line 9)"});
  // A way to a corner and back bounds nothing.
  r = read_text("p.obj", kSquare + "v 9 9 0\nf 1 2 3 5 3 4\nf 1 2 1 2\nf 2 3 2 3 2 2\nf 1 1 1 1\n");
  REQUIRE(r.ok);
  CHECK(rows(r.mesh.triangles).size() == 2);
  CHECK(planar_areas(r.mesh).sum == doctest::Approx(1));
  CHECK(r.notes == Notes{"dropped 3 faces without area (lines 7, 8, 9)",
                         "took repeated corners out of 1 face (line 6)"});
  // Triangles stay as they are: prepare() drops degenerate ones.
  r = read_text("p.obj", kSquare + "f 1 2 3\nf 1 3 3\n");
  CHECK(r.mesh.triangles.rows() == 2);
  CHECK(r.notes.empty());
}

TEST_CASE("faces of one or two corners are dropped, and the first of them named") {
  const mesh_io::ReadResult r =
      read_text("p.obj", kSquare + "f 1\nf 1 2 3\nf 2 3\nf 1 3 4\nf 3/1 4\nf\nf 1 2\n");
  REQUIRE(r.ok);
  CHECK(r.mesh.triangles.rows() == 2);
  CHECK(r.edges.size() == 5);
  CHECK(r.notes == std::vector<std::string>{
                       "dropped 5 faces of fewer than three corners (lines 5, 7, 9, ...)"});
  CHECK(read_text("p.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0 1\n4 0 1 2 3\n").notes ==
        std::vector<std::string>{"dropped 1 face of fewer than three corners (line 7)"});
}

TEST_CASE("vertices that are not finite keep their ids, faces with one are dropped") {
  using Notes = std::vector<std::string>;
  for (const char* x : {"nan", "-NaN", "inf", "-Infinity", "nan(ind)", "-1.#IND", "1.#QNAN0"}) {
    CAPTURE(x);
    const std::string bad = std::string("v 0 ") + x + " 0\n";
    mesh_io::ReadResult r = read_text("p.obj", bad + kSquare + "f 2 3 4\nf 2 4 5\n");
    REQUIRE_MESSAGE(r.ok, r.error);
    CHECK(rows(r.mesh.triangles) == std::vector<std::vector<int>>{{1, 2, 3}, {1, 3, 4}});
    CHECK(r.mesh.vertices.row(0) == r.mesh.vertices.row(1));
    CHECK(r.notes == Notes{"ignored 1 vertex with a coordinate that is not finite (line 1)"});
    r = read_text("p.obj", bad + kSquare + "f 2 3 4\nf 2 4 5 1\n");
    REQUIRE(r.ok);
    CHECK(r.mesh.triangles.rows() == 1);
    CHECK(r.notes == Notes{"ignored 1 vertex with a coordinate that is not finite (line 1)",
                           "dropped 1 face with a corner that is not finite (line 7)"});
  }
  CHECK(read_text("p.obj", "v nan 0 0\nv 0 0 0\nv 0 1 0\nf 1 2 3\n").error ==
        "p.obj: no face is left: dropped 1 face with a corner that is not finite (line 4)");
}

TEST_CASE("a quad whose sides cross is put in order") {
  using Notes = std::vector<std::string>;
  for (const char* face : {"f 1 3 2 4\n", "f 1 2 4 3\n", "f 4 3 1 2\n"}) {
    const mesh_io::ReadResult r = read_text("p.obj", kSquare + face);
    REQUIRE(r.ok);
    CHECK(std::abs(planar_areas(r.mesh).sum) == doctest::Approx(1));
    CHECK(r.notes == Notes{"reordered the corners of 1 face with crossing sides (line 5)"});
    CHECK(ism::validate(r.mesh).empty());
  }
  // Its corners keep their vt.
  mesh_io::ReadResult r =
      read_text("p.obj", kSquare + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 4/4 3/3\n");
  REQUIRE(r.corner_uv.rows() == 6);
  for (int c = 0; c < 6; ++c)
    CHECK(r.corner_uv.row(c) == r.mesh.vertices.row(r.mesh.triangles(c / 3, c % 3)).head(2));
  // Neighbours tell which way.
  r = read_text("p.obj",
                "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\n"
                "f 4 5 2 1\nf 2 3 5 6\n");
  REQUIRE(r.ok);
  CHECK(planar_areas(r.mesh).sum == doctest::Approx(-2));
  CHECK(ism::validate(r.mesh).empty());
  // A quad in space that crosses itself only as it is seen from its mean normal stays what it is.
  const std::string fold = "v 0 0 0\nv 1 0 0\nv 0.9 0.2 1\nv 0.1 -0.1 1\n";
  r = read_text("p.obj",
                fold + "v 0 -1 0\nv 1 1 1\nf 1 2 3 4\nf 2 1 5\nf 4 3 6\nf 3 2 6\nf 1 4 5\n");
  REQUIRE(r.ok);
  CHECK(ism::validate(r.mesh).empty());
}

TEST_CASE("other polygons that cross themselves, or have no area, are cut all the same") {
  using Notes = std::vector<std::string>;
  const Notes cut = {"cut 1 face with crossing sides or without area as well as possible (line 6)"};
  mesh_io::ReadResult r = read_polygon({{0, 0}, {2, 2}, {2, 0}, {0, 2}, {-3, 1}});
  REQUIRE(r.ok);
  CHECK(r.mesh.triangles.rows() == 3);
  CHECK(r.notes == cut);
  r = read_polygon({{0, 0}, {1, 0}, {2, 0}, {3, 0}, {4, 0}});
  REQUIRE(r.ok);  // left to prepare(), as triangles without area are
  CHECK(r.mesh.triangles.rows() == 3);
  CHECK(r.notes == cut);
}

TEST_CASE("a vertex between two faces that share two edges is not cut off by both") {
  const std::string points = "v 0 0 0\nv 2 -1 0\nv 0.6 0.6 0\nv 0.3 0.3 0.4\nv -1 2 0\n";
  const std::string note = "cut 1 face along another diagonal, so that no vertex is lost (line ";
  mesh_io::ReadResult r = read_text("p.obj", points + "f 1 2 3 4\nf 1 4 3 5\n");
  REQUIRE(r.ok);
  CHECK(ism::validate(r.mesh).empty());
  CHECK(r.notes == std::vector<std::string>{note + "7)"});
  for (const char* faces : {"f 1 4 3\nf 1 2 3 4\n", "f 1 2 3 4\nf 1 4 3\n"}) {
    r = read_text("p.obj", points + faces);
    REQUIRE(r.ok);
    for (const std::vector<int>& t : rows(r.mesh.triangles))
      CHECK((t == std::vector<int>{0, 3, 2} || std::count(t.begin(), t.end(), 1) == 1));
    CHECK(r.notes.size() == 1);
  }
  // Copies of a face are cut alike, so that they can be dropped.
  r = read_text("p.obj", points + "f 1 2 3 5\nf 5 3 2 1\nf 1 2 3 5\n");
  CHECK(r.notes.empty());
  const ism::Prepared p = ism::prepare(r.mesh);
  CHECK(p.mesh->triangles.rows() == 2);
}

TEST_CASE("polygons of many corners are cut, up to a limit") {
  std::vector<std::array<double, 2>> corners;
  for (int i = 0; i < 10000; ++i) {
    const double angle = 6.283185307179586 * i / 10000, radius = i % 2 ? 80 : 100;
    corners.push_back({radius * std::cos(angle), radius * std::sin(angle)});
  }
  const mesh_io::ReadResult r = read_polygon(corners);
  REQUIRE(r.ok);
  CHECK(r.mesh.triangles.rows() == 9998);
  CHECK(planar_areas(r.mesh).least > 0);
  std::string many = kSquare + "f";
  for (int i = 0; i < 10001; ++i) many += " 1";
  CHECK(read_text("p.obj", many).error ==
        "p.obj, line 5: the face has 10001 corners, at most 10000 can be read");
}

TEST_CASE("OFF: the number of vertices may follow the header word without a blank") {
  for (const char* header : {"OFF4 1 0\n", "COFF4 1 0\n", "OFF 4 1 0\n"}) {
    const mesh_io::ReadResult r =
        read_text("m.off", header + std::string("0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"));
    REQUIRE_MESSAGE(r.ok, r.error);
    CHECK(r.mesh.triangles.rows() == 2);
  }
}

TEST_CASE("PLY: strips of triangles, turned in turn; -1 begins a new one") {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
      "property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n";
  mesh_io::ReadResult r = read_text("m.ply", head + "6 0 1 2 3 4 5\n");
  REQUIRE_MESSAGE(r.ok, r.error);
  const std::vector<std::vector<int>> list = {{0, 1, 2}, {2, 1, 3}, {2, 3, 4}, {4, 3, 5}};
  CHECK(rows(r.mesh.triangles) == list);
  CHECK(planar_areas(r.mesh).least > 0.4);
  r = read_text("m.ply", head + "11 0 1 2 3 -1 -1 2 3 4 5 -1\n");
  CHECK(rows(r.mesh.triangles) == list);
  r = read_text("m.ply", head + "9 0 1 2 3 3 2 2 3 4\n");  // joined by triangles without area
  CHECK(rows(r.mesh.triangles) == std::vector<std::vector<int>>{{0, 1, 2}, {2, 1, 3}, {2, 3, 4}});
  r = read_text("m.ply", head + "8 0 1 -1 2 -1 1 2 3\n");
  CHECK(r.notes ==
        std::vector<std::string>{"dropped 2 faces of fewer than three corners (faces 0, 1)"});
  CHECK(read_text("m.ply", head + "3 0 1 -2\n").error ==
        "m.ply, face 0: corner 3 of the face refers to a vertex that does not exist (there are 6)");
  CHECK(read_text("m.ply", head + "2 0 1\n").error ==
        "m.ply: no face is left: dropped 1 face of fewer than three corners (face 0)");
}

TEST_CASE("PLY: rows with more values than the header names, and rows anywhere") {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
  mesh_io::ReadResult r = read_text("m.ply", head + "0 0 0 9\n1 0 0\n0 1 0\n3 0 1 2 9 1 1\n");
  REQUIRE_MESSAGE(r.ok, r.error);
  CHECK(r.mesh.vertices.row(1) == Eigen::RowVector3d(1, 0, 0));
  CHECK(r.notes ==
        std::vector<std::string>{"ignored more values than the header names of 1 vertex (vertex 0)",
                                 "ignored more values than the header names of 1 face (face 0)"});
  r = read_text("m.ply", head + "0 0 0 1 0 0 0\n1 0 3 0 1 2");
  REQUIRE_MESSAGE(r.ok, r.error);
  CHECK(r.mesh.vertices.row(2) == Eigen::RowVector3d(0, 1, 0));
  CHECK(r.notes.empty());
}

TEST_CASE("OBJ: a backslash joins lines also without a blank before or with some behind it") {
  const mesh_io::ReadResult r =
      read_text("m.obj", "v 0\\\r\n 0 0\t\r\nv 1 0 \\ \t\n0\nv 0\t1\t0 \nf 1 2\\\n3\n");
  REQUIRE_MESSAGE(r.ok, r.error);
  CHECK(r.mesh.vertices.row(1) == Eigen::RowVector3d(1, 0, 0));
  CHECK(rows(r.mesh.triangles) == std::vector<std::vector<int>>{{0, 1, 2}});
}

TEST_CASE("all text formats: byte order mark, tabs, trailing blanks and CRLF") {
  const std::string mark = "\xEF\xBB\xBF";
  const std::pair<const char*, std::string> files[] = {
      {"m.obj", "v\t0 0 0 \r\nv 1 0 0\t\r\nv 0 1 0\r\nf\t1 2 3 \r\n"},
      {"m.off", "OFF \r\n3\t1 0\r\n0 0 0 \r\n1 0 0\t\r\n0 1 0\r\n3 0 1 2 \r\n"},
      {"m.ply",
       "ply\r\nformat ascii 1.0 \r\nelement\tvertex 3\r\nproperty float x\r\nproperty float y\r\n"
       "property float z\r\nelement face 1\r\nproperty list uchar int vertex_indices \r\n"
       "end_header \r\n0 0 0\t\r\n1 0 0 \r\n0 1 0\r\n3 0\t1 2 \r\n"},
      {"m.stl",
       "solid \r\nfacet normal 0 0 1 \r\n\touter loop\r\n\t\tvertex 0 0 0 \r\nvertex 1 0 0\r\n"
       "vertex\t0 1 0\r\nendloop\r\nendfacet\r\nendsolid \r\n"}};
  for (const auto& file : files) {
    CAPTURE(file.first);
    const mesh_io::ReadResult r = read_text(file.first, mark + file.second);
    REQUIRE_MESSAGE(r.ok, r.error);
    CHECK(r.mesh.vertices.row(1) == Eigen::RowVector3d(1, 0, 0));
    CHECK(r.mesh.triangles.row(0) == Eigen::RowVector3i(0, 1, 2));
    CHECK(r.notes.empty());
  }
}

TEST_CASE("STL: corners at one place are one vertex, numbered as they first appear") {
  const std::string ascii =
      "solid one # two\n facet normal nan nan nan\n  outer loop\n   vertex 0 0 0\n"
      "   vertex 1 0 0\n   vertex 1 1 0\n  endloop\n endfacet\nendsolid one\n"
      "SOLID two\nFACET NORMAL 0 0 1 OUTER LOOP VERTEX -0 0 0 VERTEX 1 1 0\n"
      "VERTEX 0 1e0 -0.0 ENDLOOP ENDFACET\nENDSOLID\n";
  const std::vector<std::vector<int>> list = {{0, 1, 2}, {0, 2, 3}};
  mesh_io::ReadResult r = read_text("m.stl", ascii);
  REQUIRE_MESSAGE(r.ok, r.error);
  CHECK(r.mesh.vertices.rows() == 4);
  CHECK(r.mesh.vertices.row(3) == Eigen::RowVector3d(0, 1, 0));
  CHECK(rows(r.mesh.triangles) == list);
  CHECK(r.edges.size() == 5);
  for (const char* header : {"solid made by a program", "", "binary"}) {
    r = read_text("m.STL", binary_stl(header, 2));
    REQUIRE_MESSAGE(r.ok, r.error);
    CHECK(r.mesh.vertices.rows() == 4);
    CHECK(rows(r.mesh.triangles) == list);
    CHECK(r.notes.empty());
    r = read_text("m.stl", binary_stl(header, 2) + "more");
    CHECK(rows(r.mesh.triangles) == list);
  }
  const float nan = std::nanf("");
  std::string bad = binary_stl("", 2);
  std::memcpy(&bad[84 + 12], &nan, sizeof nan);
  CHECK(read_text("m.stl", bad).notes ==
        std::vector<std::string>{"dropped 1 face with a corner that is not finite (triangle 0)"});
  bad = ascii + "solid\nfacet outer loop\nvertex 0 0 0\nendloop";
  bad.replace(bad.find("vertex 1 1 0"), 12, "vertex 1 nan 0");
  CHECK(read_text("m.stl", bad).notes ==
        std::vector<std::string>{"dropped 1 face of fewer than three corners (line 15)",
                                 "dropped 1 face with a corner that is not finite (line 3)"});
}

TEST_CASE("every fault is one sentence with the file and the place") {
  struct Case {
    const char *name, *text, *error;
  };
  const Case cases[] = {
      {"a.obj", "", "a.obj: there are no vertices"},
      {"a.obj", "v 0 0 0\n", "a.obj: there are no faces"},
      {"a.obj", "v 0 0\n", "a.obj, line 1: a vertex needs three numbers"},
      {"a.obj", "v 0 x 0\n", "a.obj, line 1: a vertex needs three numbers"},
      {"a.obj", "v 0 1,5 0\n", "a.obj, line 1: numbers need a decimal point, not a comma"},
      {"a.obj", "v 0, 1, 0\n", "a.obj, line 1: a vertex needs three numbers"},
      {"a.obj", "vt 0,5 1\n", "a.obj, line 1: numbers need a decimal point, not a comma"},
      {"a.obj", "v 0 1e999 0\n", "a.obj, line 1: a vertex needs three numbers"},
      {"a.obj", "v 0 0 0\nf 1 1\n",
       "a.obj: no face is left: dropped 1 face of fewer than three corners (line 2)"},
      {"a.obj", "v 0 0 0\nf 1 2\n",
       "a.obj, line 2: corner 2 of the face refers to a vertex that does not exist (there are 1)"},
      {"a.obj", "v 0 0 0\nf 1 0 1\n", "a.obj, line 2: corner 2 of the face is no valid index"},
      {"a.obj", "v 0 0 0\nf 1 1.5 1\n", "a.obj, line 2: corner 2 of the face is no valid index"},
      {"a.obj", "v 0 0 0\nf -2 1 1\n", "a.obj, line 2: corner 1 of the face is no valid index"},
      {"a.obj", "v 0 0 0\nf 1 1 99999999999999999999\n",
       "a.obj, line 2: corner 3 of the face is no valid index"},
      {"a.obj", "v 0 0 0\nf 1 1/1/1/1 1\n",
       "a.obj, line 2: corner 2 of the face is no valid index"},
      {"a.obj", "v 0 0 0\nf 1 1 4294967297\n",
       "a.obj, line 2: corner 3 of the face refers to a vertex that does not exist (there are 1)"},
      {"a.obj", "vt x\n", "a.obj, line 1: a vt needs numbers"},
      {"a.off", "", "a.off: the file is empty"},
      {"a.off", "OFF\n3 x 0\n", "a.off, line 2: the numbers of vertices and faces are missing"},
      {"a.off", "OFF\n-3 1 0\n", "a.off, line 2: the numbers of vertices and faces are missing"},
      {"a.off", "OFF\n4000000000000 1 0\n0 0 0\n",
       "a.off: the file ends after 1 of 4000000000000 vertices"},
      {"a.off", "OFF\n1 2 0\n0 0 0\n3 0 0 0\n", "a.off: the file ends after 1 of 2 faces"},
      {"a.off", "OFF\n1 1 0\n0 0 0\n3 0 0\n",
       "a.off, line 4: corner 3 of the face is no valid index"},
      {"a.off", "OFF\n1 1 0\n0 0 0\n3 0 0 -1\n",
       "a.off, line 4: corner 3 of the face refers to a vertex that does not exist (there are 1)"},
      {"a.off", "OFF\n1 1 0\n0 0 0\n4000000000 0 0 0\n",
       "a.off, line 4: a face needs a number of corners"},
      {"a.ply", "", "a.ply: the file does not begin with 'ply'"},
      {"a.ply", "ply\nformat ascii 1.0\n", "a.ply: the header does not end"},
      {"a.ply", "ply\nformat klingon 1.0\nend_header\n", "a.ply: the header names no known format"},
      {"a.ply", "ply\nproperty int x\n", "a.ply, line 2: a property must follow an element"},
      {"a.ply", "ply\nelement vertex\n", "a.ply, line 2: an element needs a name and a count"},
      {"a.ply", "ply\nelement vertex 1\nproperty quad x\n", "a.ply, line 3: unknown type 'quad'"},
      {"a.ply", "ply\nelement vertex 1\nproperty list float int x\n",
       "a.ply, line 3: a list needs an integer type for its length"},
      {"a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nend_header\n1\n",
       "a.ply: the vertices do not have one x, y and z each"},
      {"a.ply", "ply\nformat ascii 1.0\nelement face 1\nproperty int x\nend_header\n1\n",
       "a.ply: the faces have no list vertex_indices"},
      {"a.ply",
       "ply\nformat ascii 1.0\nelement face 1\nproperty list int int vertex_index\n"
       "end_header\n3 0 1 1.5\n",
       "a.ply, face 0: the data are cut short or not a number"},
      {"a.ply",
       "ply\nformat ascii 1.0\nelement face 1\nproperty list int int vertex_index\n"
       "end_header\n-3 0 1 2\n",
       "a.ply, face 0: the data are cut short or not a number"},
      {"a.ply",
       "ply\nformat ascii 1.0\nelement face 1\nproperty list int int vertex_index\n"
       "end_header\n2 0 1\n",
       "a.ply: there are no vertices"},
      {"a.ply",
       "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
       "property float z\nend_header\n0,5 0 0\n",
       "a.ply, vertex 0: numbers need a decimal point, not a comma"},
      {"a.ply",
       "ply\nformat binary_little_endian 1.0\nelement vertex 9000000000000000000\n"
       "property float x\nproperty float y\nproperty float z\nend_header\n",
       "a.ply: the header announces 9000000000000000000 elements 'vertex', more than the file can "
       "hold"},
      {"a.ply", "ply\nformat ascii 1.0\nelement nothing 9000000000000000000\nend_header\n",
       "a.ply: there are no vertices"},
      {"a.stl", "", "a.stl: the file is no STL file"},
      {"a.stl", "solid", "a.stl: there are no vertices"},
      {"a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0,5 0\n",
       "a.stl, line 4: numbers need a decimal point, not a comma"},
      {"a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n",
       "a.stl, line 3: the file ends inside of a facet"},
      {"a.stl", "solid a\nvertex 0 0 0\n", "a.stl, line 2: 'vertex' is not expected here"},
      {"a.glb", "glTF", "a.glb: only OBJ, OFF, PLY and STL files can be read"},
      {"a", "v 0 0 0", "a: only OBJ, OFF, PLY and STL files can be read"},
  };
  for (const Case& c : cases) {
    CAPTURE(c.text);
    const mesh_io::ReadResult r = read_text(c.name, c.text);
    CHECK(!r.ok);
    CHECK(r.error == c.error);
  }
  CHECK(read_text("a.stl", binary_stl("solid", 3)).error ==
        "a.stl: the file ends after 2 of 3 triangles");
  CHECK(read_text("a.stl", binary_stl("solid", 4000000000u)).error ==
        "a.stl: the file ends after 2 of 4000000000 triangles");
  CHECK(read_text("a.stl", binary_stl("", 0).substr(0, 84)).error ==
        "a.stl: there are no vertices");
  CHECK(mesh_io::read_mesh("no/such/file.obj").error == "no/such/file.obj: there is no such file");
  const Folder folder;
  fs::create_directory(folder.file("d.obj"));
  CHECK(mesh_io::read_mesh(folder.file("d.obj")).error ==
        folder.file("d.obj") + ": this is not a file");
}

TEST_CASE("truncated and damaged files end with a sentence or a mesh, never otherwise") {
  const std::string obj = kSquare + "vt 0 0\nvt 1 0\nf 1/1/1 2/2 3//4 \\\n4\nf -1 -2 -3\n";
  const std::string off = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 2 3 255 0 0\n";
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  const std::string stl =
      "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
      "endloop\nendfacet\nendsolid a\n";
  const std::vector<std::pair<std::string, std::string>> files = {{"m.obj", obj},
                                                                  {"m.off", off},
                                                                  {"m.ply", ply},
                                                                  {"m.ply", binary_ply(false)},
                                                                  {"m.stl", binary_stl("", 2)},
                                                                  {"m.stl", stl}};
  std::mt19937 random(7);
  for (const auto& file : files) {
    const std::string& whole = file.second;
    for (std::size_t n = 0; n < whole.size(); ++n) {
      const mesh_io::ReadResult r = read_text(file.first, whole.substr(0, n));
      CHECK(r.ok == r.error.empty());
    }
    for (int round = 0; round < 500; ++round) {
      std::string damaged = whole;
      for (unsigned k = 0; k <= random() % 4; ++k)
        damaged[random() % damaged.size()] =
            random() % 2 ? static_cast<char>(random() % 256) : "-/#9e.\n 0"[random() % 9];
      const mesh_io::ReadResult r = read_text(file.first, damaged);
      CHECK(r.ok == r.error.empty());
      for (Eigen::Index i = 0; i < r.mesh.triangles.rows() && r.ok; ++i) {
        CHECK(r.mesh.triangles.row(i).minCoeff() >= 0);
        CHECK(r.mesh.triangles.row(i).maxCoeff() < r.mesh.vertices.rows());
      }
    }
  }
}

TEST_CASE("writing and reading back gives the same bits") {
  std::mt19937_64 random(3);
  ism::TriangleMesh mesh;
  mesh.vertices.resize(300, 3);
  mesh.triangles.resize(100, 3);
  ism::Points2 planar(300, 2);
  const auto any_double = [&] {
    while (true) {
      const std::uint64_t bits = random();
      double x = 0;
      std::memcpy(&x, &bits, sizeof x);
      if (std::isfinite(x)) return x;
    }
  };
  for (Eigen::Index i = 0; i < 300; ++i) {
    for (int k = 0; k < 3; ++k) mesh.vertices(i, k) = any_double();
    for (int k = 0; k < 2; ++k) planar(i, k) = any_double();
    mesh.triangles(i / 3, i % 3) = static_cast<int>((7 * i) % 300);
  }
  mesh.vertices.row(0) << 5e-324, -0.0, 1.7976931348623157e308;
  const Folder folder;
  const std::string file = folder.file("m.obj");
  const std::string text = mesh_io::obj_text("x", mesh.vertices, mesh.triangles, planar);
  REQUIRE(mesh_io::write_files({{file, text}}) == "");
  const mesh_io::ReadResult r = mesh_io::read_mesh(file);
  REQUIRE_MESSAGE(r.ok, r.error);
  CHECK(std::memcmp(r.mesh.vertices.data(), mesh.vertices.data(), 900 * sizeof(double)) == 0);
  REQUIRE(r.planar.rows() == 300);
  CHECK(std::memcmp(r.planar.data(), planar.data(), 600 * sizeof(double)) == 0);
  CHECK(r.mesh.triangles == mesh.triangles);
  CHECK(!fs::exists(file + ".tmp"));
}

TEST_CASE("texture coordinates are written per corner, faces without them too") {
  ism::Points3 points(4, 3);
  points << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0;
  Eigen::MatrixXd uv(6, 2);
  uv << 0, 0, 0.5, 0, 1, 1, 0, 0, 1, 1, std::nan(""), 1;
  const std::vector<std::vector<int>> polygons = {{0, 1, 2}, {0, 2, 3}};
  CHECK(mesh_io::obj_text("c", points, polygons, uv, "m.mtl") ==
        "# c\nmtllib m.mtl\nusemtl surface\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
        "vt 0 0\nvt 0.5 0\nvt 1 1\nf 1/1 2/2 3/3\nf 1 3 4\n");
  CHECK(mesh_io::mtl_text("i.png") == "newmtl surface\nKd 1 1 1\nmap_Kd i.png\n");
}

TEST_CASE("a PLY file with colours can be read back") {
  ism::Points3 points(5, 3);
  points << 0, 0, 0, 1, 0, 0, 1, 1, 0.5, 0, 1, 0, -1, 0.5, 0.25;
  const std::vector<std::vector<int>> polygons = {{0, 1, 2, 3}, {0, 3, 4}};
  Eigen::MatrixXd colors = Eigen::MatrixXd::Constant(7, 3, 0.5);
  colors.row(1) << 0, 1, 7;
  const std::string text =
      mesh_io::ply_text("c", points, polygons, colors, Eigen::VectorXd::LinSpaced(7, 2, 8));
  const mesh_io::ReadResult r = read_text("m.ply", text);
  REQUIRE_MESSAGE(r.ok, r.error);
  REQUIRE(r.mesh.vertices.rows() == 7);  // no vertex is shared
  CHECK(r.mesh.triangles.rows() == 3);
  CHECK(r.mesh.vertices.row(2) == points.row(2));
  CHECK(r.mesh.vertices.row(6) == points.row(4));
  const std::size_t second = text.find("end_header\n") + 11 + 19 + 12;  // colour of corner 1
  CHECK(text.substr(second, 3) == std::string("\0\xFF\xFF", 3));
}

TEST_CASE("polygons are written with their corners; a failed write leaves nothing") {
  ism::Points3 points(2, 3);
  points << 0, 1, 2, 3, 4, 0.5;
  const std::vector<std::vector<int>> polygons = {{0, 1, 0}, {1, 0, 1, 0}};
  CHECK(mesh_io::obj_text("c", points, polygons) ==
        "# c\nv 0 1 2\nv 3 4 0.5\nf 1 2 1\nf 2 1 2 1\n");
  const Folder folder;
  CHECK(mesh_io::write_files({{folder.file("a.obj"), ""}, {"no/such/folder/x.obj", ""}}) ==
        "no/such/folder/x.obj: the file cannot be created");
  CHECK(fs::is_empty(folder.file("")));
  fs::create_directories(folder.file("x.obj/y"));  // a folder in the way
  CHECK(mesh_io::write_files({{folder.file("x.obj"), ""}, {folder.file("b.obj"), ""}}) ==
        folder.file("x.obj") + ": the file cannot be written");
  CHECK(!fs::exists(folder.file("x.obj.tmp")));
  CHECK(!fs::exists(folder.file("b.obj.tmp")));
}

TEST_CASE("the locale's decimal comma changes nothing") {
  const char* old = nullptr;
  for (const char* name : {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8"})
    if (!old) old = std::setlocale(LC_ALL, name);
  if (!old) MESSAGE("no locale with a decimal comma is installed");
  ism::Points3 points(1, 3);
  points << 0.5, 1.25, -1e30;
  CHECK(mesh_io::obj_text("c", points, std::vector<std::vector<int>>()) ==
        "# c\nv 0.5 1.25 -1e+30\n");
  CHECK(read_text("m.obj", "v 0.5 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").mesh.vertices(0, 0) == 0.5);
  std::setlocale(LC_ALL, "C");
}

namespace {

mesh_io::PairsResult read_pairs_text(const std::string& text) {
  const Folder folder;
  std::ofstream(folder.file("l.txt"), std::ios::binary) << text;
  mesh_io::PairsResult result = mesh_io::read_pairs(folder.file("l.txt"));
  if (!result.ok) result.error = result.error.substr(result.error.find("l.txt"));
  return result;
}

}  // namespace

TEST_CASE("pairs of ids, with comments; all else is an error with its line") {
  const mesh_io::PairsResult r = read_pairs_text("# thumb\n1 2\r\n\n  33\t-4 # tip\n");
  REQUIRE(r.ok);
  REQUIRE(r.pairs.size() == 2);
  CHECK(r.pairs[1].a.id == 33);
  CHECK(r.pairs[1].b.id == -4);
  CHECK(r.pairs[1].line == 4);
  CHECK(read_pairs_text("").ok);
  for (const char* bad : {"1\n", "1 2 3\n", "1 2 3 4 5\n", "0,5 0,25 0,125 17\n"}) {
    const std::string error = read_pairs_text(std::string("1 2\n") + bad).error;
    CHECK(
        error.find("l.txt, line 2: two vertex ids are expected, or points x y z in place of them: "
                   "2, 4 or 6 numbers (1.5, not 1,5), not ") == 0);
  }
  const std::pair<const char*, const char*> kBad[] = {
      {"1 x", "'x' is no vertex id"},
      {"1.5 2", "'1.5' is no vertex id"},
      {"1 99999999999999999999", "'99999999999999999999' is no vertex id"},
      {"1 2#", ""},
      {"1 0 nan 0", "'nan' is no coordinate"},
      {"0.5 0 1 2.5", "'2.5' is no vertex id"},
      {"1 2 3 4 5 6x", "'6x' is no coordinate"},
      {"a b\nc d", "'c' is no vertex id"},  // a second line of words is no header
  };
  for (const auto& [text, sentence] : kBad) {
    const std::string error = read_pairs_text(text).error;
    CHECK(error.substr((std::min)(error.size(), std::string("l.txt, line 1: ").size())) ==
          sentence);
  }
}

TEST_CASE("curves among pairs") {
  const mesh_io::PairsResult r =
      read_pairs_text("1 2\ncurve 3 4, 5 | 6 7 # lips\n8 9\ncurve 1|2\n");
  CHECK(r.error == "l.txt, line 4: '1|2' is no vertex id");
  const mesh_io::PairsResult s = read_pairs_text("1 2\ncurve 3 4, 5 | 6 7 # lips\n8 9\n");
  REQUIRE(s.ok);
  CHECK(s.pairs.size() == 2);
  REQUIRE(s.curves.size() == 1);
  CHECK(s.curves[0].a == std::vector<long long>{3, 4, 5});
  CHECK(s.curves[0].b == std::vector<long long>{6, 7});
  CHECK(s.curves[0].line == 2);
  for (const char* bad : {"curve\n", "curve |\n", "curve 1 2\n", "curve | 1 2\n", "curve 1 |\n"})
    CHECK(read_pairs_text(bad).error ==
          "l.txt, line 1: a curve has vertex ids of A, then '|', then vertex ids of B");
  CHECK(read_pairs_text("curve 1 | 2 | 3\n").error == "l.txt, line 1: '|' is no vertex id");
}

TEST_CASE("pairs as spreadsheets and scripts write them: separators, headers, floats, points") {
  for (const char* same :
       {"1 2\n33 4\n", "1,2\n33,4", "1;2\r\n33;4\r\n", "1\t2\n33\t4\n", "1, 2,\n33 , 4\n,\n",
        "1.0 2.0\n33.0 4.0\n", "source,target\n1,2\n33,4\n",
        "\xEF\xBB\xBF\"A\";\"B\"\r\n1;2\r\n33;4", "# of a script\n\nA B\n1 2\n3.3e1 4\n"}) {
    INFO(same);
    const mesh_io::PairsResult r = read_pairs_text(same);
    REQUIRE(r.ok);
    REQUIRE(r.pairs.size() == 2);
    CHECK(r.pairs[0].a.id == 1);
    CHECK(r.pairs[0].b.id == 2);
    CHECK(r.pairs[1].a.id == 33);
    CHECK(r.pairs[1].b.id == 4);
  }
  const mesh_io::PairsResult r = read_pairs_text(
      "0.5 -1 2e3 4 5 6\n17 0.5 0.25 0\n0.5,0.25,0,17\n0.0 0.25 1 17\n17.0 0.25 1 0.5\n");
  REQUIRE(r.ok);
  REQUIRE(r.pairs.size() == 5);
  CHECK(r.pairs[0].a.is_point);
  CHECK(r.pairs[0].b.is_point);
  CHECK(r.pairs[0].a.point == Eigen::Vector3d(0.5, -1, 2000));
  CHECK(r.pairs[0].b.point == Eigen::Vector3d(4, 5, 6));
  for (const std::size_t i : {1u, 4u}) {  // id x y z
    CHECK(!r.pairs[i].a.is_point);
    CHECK(r.pairs[i].a.id == 17);
    CHECK(r.pairs[i].b.is_point);
  }
  for (const std::size_t i : {2u, 3u}) {  // x y z id
    CHECK(r.pairs[i].a.is_point);
    CHECK(r.pairs[i].b.id == 17);
  }
  CHECK(r.pairs[1].b.point == Eigen::Vector3d(0.5, 0.25, 0));
  CHECK(r.pairs[3].a.point == Eigen::Vector3d(0, 0.25, 1));
}

TEST_CASE("a point in space is the nearest vertex, or the nearest point of a triangle") {
  const ism::TriangleMesh square =
      read_text("s.obj", kSquare + "v 9 9 9\nf 1 2 2\nf 1 2 3\nf 1 3 4\n").mesh;
  const auto nearest = [&](double x, double y, double z) {
    return landmarks::nearest(square, {x, y, z});
  };
  CHECK(nearest(1, 1, 0).point.vertex == 2);
  CHECK(nearest(0.9995, 1.0004, 0.0003).point.vertex == 2);  // rounded
  CHECK(nearest(3, 5, 0).point.vertex == 2);
  CHECK(nearest(3, 5, 0).distance == doctest::Approx(std::sqrt(20.0)));
  const auto check = [&](double x, double y, double z, const Eigen::Vector3d& wanted) {
    const landmarks::Nearest found = nearest(x, y, z);
    REQUIRE(found.point.vertex == -1);
    CHECK(found.point.point.barycentric.minCoeff() >= 0);
    CHECK(found.point.point.barycentric.sum() == doctest::Approx(1));
    CHECK((landmarks::position(square, found.point) - wanted).norm() < 1e-15);
    CHECK(found.distance == doctest::Approx((Eigen::Vector3d(x, y, z) - wanted).norm()));
  };
  check(0.75, 0.25, 0.5, {0.75, 0.25, 0});
  check(0.25, 0.5, -2, {0.25, 0.5, 0});
  check(0.25, -1, 1, {0.25, 0, 0});
  check(1.5, 0.75, 0, {1, 0.75, 0});
  CHECK(landmarks::nearest_vertex(square, nearest(0.75, 0.25, 0).point) == 1);
  CHECK(landmarks::name(nearest(0.75, 0.25, 0).point) == "a point in triangle 1");
  CHECK(landmarks::nearest({}, {0, 0, 0}).point.vertex == -1);
}

TEST_CASE("landmarks of a file, on their meshes") {
  const ism::TriangleMesh m = read_text("s.obj", kSquare + "f 1 2 3\nf 1 3 4\n").mesh;
  const Folder folder;
  std::vector<ism::Landmark> list;
  const auto read = [&](const std::string& text) {
    std::ofstream(folder.file("l.txt"), std::ios::binary) << text;
    list.clear();
    const std::string error = landmarks::read(folder.file("l.txt"), m, m, list);
    return error.empty() ? "" : error.substr(error.find("l.txt") + 5);
  };
  CHECK(read("0 1\n1 1 0 0.75 0.25 0.001\n0.25 0.5 0 3\n") == "");
  REQUIRE(list.size() == 3);
  CHECK(list[0].b.vertex == 1);
  CHECK(list[1].a.vertex == 2);
  CHECK(list[1].b.point.face == 0);
  CHECK(list[2].a.point.face == 1);
  CHECK(list[2].b.vertex == 3);
  CHECK(read("0 4\n") == ", line 1: B has no vertex 4, its ids are 0 to 3");
  CHECK(read("0 1\n0.0 0 0 2\n").empty());  // more than one at a vertex
  CHECK(read("0 1\ncurve 0 1 | 2 3\n") == ", line 2: a curve is not expected here");
  CHECK(read("0 0.5 0.5 -0.2\n") ==
        ", line 1: the point is 14.1% of the size of B away from B, 1% is the most: give it in the "
        "coordinates of the file of B, or as the id of a vertex");
}

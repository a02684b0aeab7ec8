// Fuzz target: the readers of examples/mesh_io.hpp. The first letter of an input chooses what it is
// the file of: O(BJ), F (OFF), P(LY), S(TL), L(andmarks) or N(umber).

#include "fuzz.hpp"

#include "mesh_io.hpp"

#include <chrono>
#include <filesystem>
#include <fstream>

namespace {

using fuzz::require;

/// A file of this process, which goes with it.
class File {
 public:
  explicit File(const std::string& extension) {
    const auto now = std::chrono::steady_clock::now().time_since_epoch().count();
    const std::string name = "ism_fuzz_" + std::to_string(now) + extension;
    path_ = (std::filesystem::temp_directory_path() / name).string();
  }
  ~File() {
    std::error_code ec;
    std::filesystem::remove(path_, ec);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  const std::string& write(const std::string& text) const {
    std::ofstream(path_, std::ios::binary) << text;
    return path_;
  }

 private:
  std::string path_;
};

void require_line(const std::string& text) {
  for (const char c : text)
    require(static_cast<unsigned char>(c) >= 32 && c != 127, "what is told is one line");
}

void require_error(const std::string& path, bool ok, const std::string& error) {
  require(ok == error.empty(), "an error says what is wrong");
  require(ok || error.compare(0, path.size(), path) == 0, "an error names the file");
  require_line(error);
}

void require_ids(const mesh_io::ReadResult& r) {
  const Eigen::Index n = r.mesh.vertices.rows(), m = r.mesh.triangles.rows();
  require(n > 0 && m > 0, "a mesh that was read is not empty");
  require(r.mesh.vertices.allFinite(), "coordinates are finite");
  for (int i = 0; i < r.mesh.triangles.size(); ++i)
    fuzz::require_range(r.mesh.triangles.data()[i], n, "an id");
  for (std::size_t i = 0; i < r.edges.size(); ++i) {
    fuzz::require_range(r.edges[i][0], n, "an end of an edge");
    fuzz::require_range(r.edges[i][1], n, "an end of an edge");
    require(r.edges[i][0] <= r.edges[i][1], "edges are ascending");
    require(i == 0 || r.edges[i - 1] < r.edges[i], "there is each edge once");
  }
  require(r.planar.rows() == 0 || r.planar.rows() == n, "a vt of each vertex, or none");
  require(r.corner_uv.rows() == 0 || r.corner_uv.rows() == 3 * m, "a vt of each corner, or none");
}

/// What is written is read with the same bits.
void require_round_trip(const mesh_io::ReadResult& r) {
  static const File file(".obj");
  const ism::Points2 planar = r.planar.allFinite() ? r.planar : ism::Points2();
  const std::string text = mesh_io::obj_text("", r.mesh.vertices, r.mesh.triangles, planar);
  const mesh_io::ReadResult s = mesh_io::read_mesh(file.write(text));
  require(s.ok, "what was written can be read: " + s.error);
  require(s.notes.empty(), "what was written needs no mending");
  require(s.mesh.vertices == r.mesh.vertices && s.mesh.triangles == r.mesh.triangles,
          "what was written is read as it was");
}

void mesh(const std::string& extension, const std::string& text) {
  static const File obj(".obj"), off(".OFF"), ply(".ply"), stl(".stl");
  const File& file = extension == "obj"   ? obj
                     : extension == "off" ? off
                     : extension == "ply" ? ply
                                          : stl;
  const std::string& path = file.write(text);
  const mesh_io::ReadResult r = mesh_io::read_mesh(path);
  require_error(path, r.ok, r.error);
  for (const std::string& note : r.notes) require_line(note);
  if (!r.ok) return;
  require_ids(r);
  require_round_trip(r);
}

void landmarks(const std::string& text) {
  static const File file(".txt");
  const std::string& path = file.write(text);
  const mesh_io::PairsResult r = mesh_io::read_pairs(path);
  require_error(path, r.ok, r.error);
  for (std::size_t i = 1; i < r.pairs.size(); ++i)
    require(r.pairs[i - 1].line <= r.pairs[i].line, "lines ascend");
  const std::vector<ism::Landmark> list = mesh_io::landmarks_of(r);
  require(list.size() == r.pairs.size(), "a landmark for each pair");
  for (const ism::Landmark& l : list)
    require(l.a.vertex >= -1 && l.b.vertex >= -1, "an id that is none is -1");
}

void numbers(const std::string& text) {
  double x = 0;
  long long i = 0;
  const bool is_number = mesh_io::parse_number(text, x);
  if (mesh_io::parse_integer(text, i))
    require(is_number && std::abs(x - static_cast<double>(i)) <= 1e-15 * std::abs(x),
            "an integer is a number: " + text);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(data + 1, data + size);
  switch (data[0]) {
    case 'O':
      mesh("obj", text);
      break;
    case 'F':
      mesh("off", text);
      break;
    case 'P':
      mesh("ply", text);
      break;
    case 'S':
      mesh("stl", text);
      break;
    case 'L':
      landmarks(text);
      break;
    case 'N':
      numbers(text);
      break;
    default:
      break;
  }
  return 0;
}

// ism_map: maps one triangulated surface onto another and writes everything about the map to files.
//
//   ism_map A.obj B.obj -o OUT --landmarks landmarks.txt
//
// `ism_map --help` lists the options and the files. Exit code 0: the map was written (also after
// Ctrl-C or an iteration limit), 1: the computation failed, 2: bad input; 1 and 2 write nothing.

#include "any_mesh.hpp"
#include "ism.hpp"
#include "landmarks.hpp"
#include "map_glb.hpp"
#include "map_picture.hpp"
#include "mesh_io.hpp"
#include "morph.hpp"
#include "program.hpp"
#include "render.hpp"
#include "system.hpp"
#include "uv_islands.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <new>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace {

using program::check_surface;
using program::Clock;
using program::exit_code;
using program::for_each_option;
using program::format;
using program::kBadInput;
using program::kComputationFailed;
using program::print_preparation;
using program::read_number;
using program::read_setting;
using program::seconds_since;

const char* const kHelp = R"(usage: ism_map A B -o OUT [options]

Maps mesh A injectively onto mesh B with low distortion. A and B are OBJ, OFF, PLY, STL or glTF
files (with tinygltf), or FBX, COLLADA and others (with assimp). The surfaces have no handles; they
are closed or have boundaries. The longest boundary loop is the outline, the others are openings.

The program triangulates polygons and repairs defects: it welds coincident vertices, flips
triangles, and keeps the part with the landmarks. It prints every repair. In STL files and those
read by assimp, coincident corners become one vertex; vertices are numbered by first appearance.
Vertices of glTF are numbered through all primitives, in the order of the nodes. They lie in the
scene, those with a skin in its bind pose.

  -o OUT             folder for the results, created if missing
  --landmarks FILE   lines `<vertex id in A> <vertex id in B>`, ids from 0; # starts a comment. In
                     place of an id, x y z is the nearest point of the surface, at most 1% of its
                     size away. Of four numbers the first is the id if it is a whole number, else
                     the last. Blanks, tabs, commas and semicolons separate numbers; the first line
                     may be a header. `curve <ids in A> | <ids in B>` maps a line of vertices onto
                     another one
  --exact-landmarks  landmarks coincide exactly, from the start to the end
  --boundary B       free (default): boundaries move, A and B overlap in part; fixed: boundaries lie
                     along one square, matched by arc length; slide: they slide along the square
  --pin-landmarks    landmarks of A keep their images on B from the start; a point in a triangle is
                     replaced by the nearest corner
  --pins FILE        more landmarks; those of A keep their images on B from the start
  --initial DIR      start from the vt of DIR/A.obj and DIR/B.obj (as written by ism_map)
  --start-only       stop after the initial embedding
  --kappa K          reward for covered area beyond the cost of an isometry (default 0.2); this
                     cost is 2 for sd, 0 for other measures; -2 is no reward, as in the paper
  --preset paper     the constants of the paper (kappa -2, omega from 1e9, at most 550 iterations)
  --measure M        sd (symmetric Dirichlet, default), arap, sarap or asap; an isometry has 2 for
                     sd, 0 for the others
  --variant V        pn, spn or full: the optimisers the paper compares (default full)
  --iterations N     at most N iterations (default 1000)
  --tolerance T      stop below this relative decrease per iteration (default 3e-4)
  --threads N        0: as many as there are processors (default); the result does not depend on it
  --keep-scale       do not scale the meshes; for meshes in the same unit. Else both get area 1, or
                     another relative size if landmarks agree on one
  --refine T         halve edges longer than T edges of the finer mesh, if half of a mesh lies in
                     triangles with such edges (default 8; 0: never)
  --no-weld          keep coincident vertices apart
  --set NAME=VALUE   set any option of report.json that is a number; 0 and 1 are false and true; can
                     be repeated
  --picture          draw both surfaces, once with a texture (of --texture, or coloured squares) and
                     once with the distortion
  --heat             write the distortion as colours and as values (quality) of PLY files
  --texture IMAGE    carry the texture of A, a PNG, JPEG or binary PPM image, to B. It lies at the
                     vt of A, not on faces without vt; if A has no vt, at its planar positions
  --transfer-uv      carry texture coordinates (vt) from each mesh that has them to the other one
  --glb NAME.glb     write A, a morph from A to B as an animation, and B, side by side, to one
                     binary glTF file for any viewer, with a texture (of --texture, or coloured
                     squares); with --heat, A and B with the distortion below
  --morph N          2 to 100 shapes from A to B, as rigid as possible, as meshes and as pictures
  --quiet            print errors only
  --help             print this

Files in OUT:
  A.obj B.obj            the triangulated input as it was mapped; vt is the planar position. Input
                         vertices keep their ids; vertices added for constraints, and copies along
                         cuts of closed surfaces, come last
  A_on_B.obj B_on_A.obj  the vertices mapped to the other surface, ids as in the input; vertices
                         without an image are in no face
  A_edges_on_B.obj       the edges of A's polygons, not of their triangulation, as polylines on B
  meta_A.obj meta_B.obj  the common refinement on either surface, with the same faces
  report.json            status, options, energies and seconds of every iteration
and by option
  picture.png            --picture
  heat_A.ply heat_B.ply  --heat: the common refinement; white is an isometry, dark red 8 and more;
                         quality is the symmetric Dirichlet energy per area, 2 for an isometry
  A_textured.obj B_textured.obj textured.mtl texture.png
                         --texture: A, and the common refinement on B, with the texture of A
  B_uv.obj A_uv.obj      --transfer-uv: B with the vt of A, A with the vt of B. A face across a seam
                         gets the vt of the side that has most of the face, continued. A face that
                         lies mostly on uncovered parts or on faces without vt gets none
  morph_000.obj morph_000.png ...
                         --morph: the common refinement; morph_000 lies on A, the last one on B
  NAME.glb               --glb: the common refinement, grey where it is not covered; A and B upright
                         and with area 1, or, with --keep-scale, A with area 1 and B in proportion
)";

// ==== [1] ARGUMENTS ==============================================================================

/// The optimisers that the paper compares (§6.1, Fig. 9).
enum class Variant { kProjectedNewton, kSmoothedProjectedNewton, kFull };

struct Arguments {
  std::string a, b, out, landmarks, pins, initial, texture, glb;
  std::string preset = "default", measure = "sd";
  Variant variant = Variant::kFull;
  ism::Options options;
  bool pin_landmarks = false, start_only = false, quiet = false, help = false;
  bool picture = false, heat = false, transfer_uv = false;
  int morph = 0;  // frames
};

constexpr const char* kVariants[] = {"pn", "spn", "full"};         // in the order of Variant
constexpr const char* kBoundaries[] = {"free", "fixed", "slide"};  // and of ism::Boundary

/// Reads one of the names of the values of an enumeration, 0, 1 and 2.
template <class Enum>
std::string read_choice(const std::string& flag, const std::string& text,
                        const char* const (&names)[3], Enum& value) {
  for (int i = 0; i < 3; ++i) {
    if (text != names[i]) continue;
    value = static_cast<Enum>(i);
    return {};
  }
  return flag + " must be " + names[0] + ", " + names[1] + " or " + names[2] + ", not '" + text +
         "'";
}

std::string read_measure(const std::string& text, Arguments& args) {
  const std::pair<const char*, ism::DistortionMeasure> known[] = {
      {"sd", ism::symmetric_dirichlet()},
      {"arap", ism::arap()},
      {"sarap", ism::sarap()},
      {"asap", ism::asap()}};
  for (const auto& [name, measure] : known) {
    if (text != name) continue;
    args.measure = text;
    args.options.measure = measure;
    return {};
  }
  return "--measure must be sd, arap, sarap or asap, not '" + text + "'";
}

/// The preset comes first, wherever it stands, so that the other options refine it.
std::string read_preset(const std::vector<std::string>& words, Arguments& args) {
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    if (words[i] != "--preset") continue;
    if (words[i + 1] != "paper") return "the only preset is paper, not '" + words[i + 1] + "'";
    args.preset = "paper";
    args.options = ism::Options::paper();
  }
  return {};
}

bool read_switch(const std::string& flag, Arguments& args) {
  if (flag == "--start-only") return args.start_only = true;
  if (flag == "--pin-landmarks") return args.pin_landmarks = true;
  if (flag == "--exact-landmarks") return args.options.exact_landmarks = true;
  if (flag == "--keep-scale") return args.options.keep_scale = true;
  if (flag == "--no-weld") return args.options.weld = false, true;
  if (flag == "--picture") return args.picture = true;
  if (flag == "--heat") return args.heat = true;
  if (flag == "--transfer-uv") return args.transfer_uv = true;
  if (flag == "--quiet") return args.quiet = true;
  if (flag == "--help" || flag == "-h") return args.help = true;
  return false;
}

std::string read_frames(const std::string& text, int& frames) {
  constexpr int kMost = 100;  // all are kept until they are written
  const std::string error = read_number("--morph", text, frames);
  if (!error.empty() || (frames >= 2 && frames <= kMost)) return error;
  return "--morph needs 2 to " + std::to_string(kMost) + " shapes, not " + text;
}

std::string read_glb(const std::string& text, std::string& name) {
  const std::filesystem::path path = text;
  name = text;
  if (path.extension() == ".glb" && !path.has_parent_path()) return {};
  return "--glb needs a name that ends in .glb, of a file in OUT, not '" + text + "'";
}

std::string read_value(const std::string& flag, const std::string& text, Arguments& args) {
  if (flag == "--kappa") return read_number(flag, text, args.options.coverage_weight);
  if (flag == "--measure") return read_measure(text, args);
  if (flag == "--tolerance") return read_number(flag, text, args.options.tolerance);
  if (flag == "--iterations") return read_number(flag, text, args.options.max_iterations);
  if (flag == "--refine") return read_number(flag, text, args.options.refine);
  if (flag == "--threads") return read_number(flag, text, args.options.threads);
  if (flag == "--set") return read_setting(text, args.options);
  if (flag == "--boundary") return read_choice(flag, text, kBoundaries, args.options.boundary);
  if (flag == "--variant") return read_choice(flag, text, kVariants, args.variant);
  if (flag == "--morph") return read_frames(text, args.morph);
  if (flag == "--glb") return read_glb(text, args.glb);
  if (flag == "--preset") return {};  // see read_preset()
  (flag == "-o"            ? args.out
   : flag == "--landmarks" ? args.landmarks
   : flag == "--pins"      ? args.pins
   : flag == "--texture"   ? args.texture
                           : args.initial) = text;
  return text.empty() ? flag + " needs a name" : "";
}

std::string read_arguments(const std::vector<std::string>& words, Arguments& args) {
  std::string error = read_preset(words, args);
  if (!error.empty()) return error;
  error = program::read_words(
      words,
      {"-o", "--landmarks", "--pins", "--initial", "--kappa", "--preset", "--measure", "--variant",
       "--boundary", "--iterations", "--tolerance", "--refine", "--threads", "--set", "--texture",
       "--glb", "--morph"},
      [&](const std::string& flag) { return read_switch(flag, args); },
      [&](const std::string& flag, const std::string& text) {
        return read_value(flag, text, args);
      },
      args.a, args.b);
  if (args.help || !error.empty()) return error;
  if (args.b.empty()) return "two meshes are needed: ism_map A.obj B.obj -o OUT";
  if (args.out.empty()) return "a folder for the results is needed: -o OUT";
  if (args.start_only) args.options.max_iterations = 0;
  return {};
}

// ==== [2] INPUT ==================================================================================

struct Input {
  ism::TriangleMesh a, b;
  std::vector<std::array<int, 2>> edges_a;    // of the polygons of A
  ism::Points2 uv_a, uv_b;                    // per corner of the triangles, or no rows
  std::vector<std::string> notes_a, notes_b;  // of the readers
  std::vector<ism::Landmark> landmarks;
  render::Image texture;
};

/// Every function of this part returns an error sentence, or an empty string.
std::string read_initial(const std::string& path, const ism::TriangleMesh& mesh,
                         ism::Points2& positions) {
  mesh_io::ReadResult file = mesh_io::read_mesh(path);
  if (!file.ok) return file.error;
  if (file.planar.rows() == 0)
    return path + ": not every vertex has one vt of its own, as at the seams of closed surfaces";
  if (file.planar.rows() != mesh.vertices.rows())
    return path + ": " + std::to_string(file.planar.rows()) + " vertices, but the mesh has " +
           std::to_string(mesh.vertices.rows());
  positions = std::move(file.planar);
  return {};
}

std::string read_meshes(const Arguments& args, Input& input) {
  mesh_io::ReadResult a = any_mesh::read(args.a);
  if (!a.ok) return a.error;
  mesh_io::ReadResult b = any_mesh::read(args.b);
  if (!b.ok) return b.error;
  if (args.transfer_uv && a.corner_uv.rows() == 0 && b.corner_uv.rows() == 0)
    return "--transfer-uv: neither A nor B has texture coordinates (vt)";
  input = {std::move(a.mesh),
           std::move(b.mesh),
           std::move(a.edges),
           std::move(a.corner_uv),
           std::move(b.corner_uv),
           std::move(a.notes),
           std::move(b.notes),
           {},
           {}};
  return {};
}

/// Are A and B surfaces, once they are prepared?
std::string check_surfaces(const Arguments& args, const Input& input) {
  std::vector<ism::LandmarkPoint> ends_a, ends_b;
  for (const ism::Landmark& l : input.landmarks) ends_a.push_back(l.a), ends_b.push_back(l.b);
  const std::string error = check_surface(args.a, input.a, ends_a, args.options);
  if (!error.empty()) return error;
  return check_surface(args.b, input.b, ends_b, args.options);
}

std::string read_texture(const std::string& path, render::Image& texture) {
  std::string bytes;
  const std::string error = mesh_io::read_bytes(path, bytes);
  if (!error.empty()) return error;
  render::ImageResult file = render::read_image(bytes);
  texture = std::move(file.image);
  return file.error.empty() ? "" : path + ": " + file.error;
}

std::string frame_name(int i) { return format("morph_%03d", i); }

/// The files a run with these arguments writes.
std::vector<std::string> output_names(const Arguments& args) {
  std::vector<std::string> names = {
      "A.obj",      "B.obj",      "A_on_B.obj", "B_on_A.obj", "A_edges_on_B.obj",
      "meta_A.obj", "meta_B.obj", "report.json"};
  const auto add = [&](bool is_wanted, const std::vector<std::string>& more) {
    if (is_wanted) names.insert(names.end(), more.begin(), more.end());
  };
  add(args.picture, {"picture.png"});
  add(args.heat, {"heat_A.ply", "heat_B.ply"});
  add(!args.texture.empty(), {"A_textured.obj", "B_textured.obj", "textured.mtl", "texture.png"});
  add(args.transfer_uv, {"B_uv.obj", "A_uv.obj"});
  add(!args.glb.empty(), {args.glb});
  for (int i = 0; i < args.morph; ++i) add(true, {frame_name(i) + ".obj", frame_name(i) + ".png"});
  return names;
}

/// Finds out whether the results could be written, without making anything yet.
std::string check_output(const Arguments& args) {
  namespace fs = std::filesystem;
  std::error_code ec;
  for (const std::string& name : output_names(args)) {
    const fs::path target = fs::path(args.out) / name;
    if (fs::is_directory(target, ec)) return "-o " + args.out + ": its " + name + " is a folder";
    for (const std::string& input : {args.a, args.b, args.texture})
      if (fs::equivalent(target, input, ec))
        return "-o " + args.out + " would overwrite the input " + input;
  }
  fs::path folder = fs::absolute(args.out, ec);
  while (!folder.empty() && !fs::exists(folder, ec) && folder != folder.parent_path())
    folder = folder.parent_path();
  if (!fs::is_directory(folder, ec))
    return "-o " + args.out + ": " + folder.string() + " is not a folder";
  if (!system_calls::may_write(folder))
    return "-o " + args.out + ": no permission to write to " + folder.string();
  return {};
}

/// The vertices of A in the landmarks from some number on; near points in triangles, once each.
std::vector<int> pinned_vertices(const Input& input, std::size_t from) {
  std::vector<int> pins;
  for (std::size_t i = from; i < input.landmarks.size(); ++i)
    pins.push_back(landmarks::nearest_vertex(input.a, input.landmarks[i].a));
  std::sort(pins.begin(), pins.end());
  pins.erase(std::unique(pins.begin(), pins.end()), pins.end());
  return pins;
}

std::string read_input(Arguments& args, Input& input) {
  std::string error = read_meshes(args, input);
  if (error.empty() && !args.texture.empty()) error = read_texture(args.texture, input.texture);
  if (error.empty() && !args.landmarks.empty())
    error =
        landmarks::read(args.landmarks, input.a, input.b, input.landmarks, &args.options.curves);
  const std::size_t pinned_from = args.pin_landmarks ? 0 : input.landmarks.size();
  if (error.empty() && !args.pins.empty())
    error = landmarks::read(args.pins, input.a, input.b, input.landmarks);
  if (!args.options.exact_landmarks)  // which are pinned already
    args.options.pins_a = pinned_vertices(input, pinned_from);
  if (error.empty() && !args.initial.empty())
    error = read_initial(args.initial + "/A.obj", input.a, args.options.initial_f);
  if (error.empty() && !args.initial.empty())
    error = read_initial(args.initial + "/B.obj", input.b, args.options.initial_g);
  if (error.empty()) error = check_surfaces(args, input);
  if (error.empty()) error = check_output(args);
  return error;
}

// ==== [3] IDS ====================================================================================

/// Ids of an embedded mesh as they are written: of the input, with what is new behind. Copies of
/// vertices, where closed surfaces were cut, are one; what closes openings is left out.
struct WrittenIds {
  int size = 0;              // of all vertices
  std::vector<int> id;       // per vertex of the embedded mesh; -1: left out
  ism::Triangles triangles;  // those written, by vertices of the embedded mesh
};

WrittenIds written_ids(const ism::Prepared& prepared, const ism::TriangleMesh& mesh,
                       const std::vector<ism::AddedVertex>& added) {
  WrittenIds ids;
  ids.size = static_cast<int>(prepared.new_vertex.size());
  for (std::size_t v = 0; v < prepared.given_vertex.size(); ++v) {
    const int given = prepared.given_vertex[v];
    const bool is_first =
        given >= 0 && prepared.new_vertex[static_cast<std::size_t>(given)] == static_cast<int>(v);
    ids.id.push_back(given < 0 ? -1 : is_first ? given : ids.size++);
  }
  const auto is_written = [&](const auto& corners) {
    for (int k = 0; k < 3; ++k)
      if (corners[k] >= 0 && ids.id[static_cast<std::size_t>(corners[k])] < 0) return false;
    return true;
  };
  for (const ism::AddedVertex& p : added)
    ids.id.push_back(p.corners[1] < 0        ? ids.id[static_cast<std::size_t>(p.corners[0])]
                     : is_written(p.corners) ? ids.size++
                                             : -1);
  ids.triangles = mesh.triangles;
  Eigen::Index n = 0;
  for (Eigen::Index f = 0; f < mesh.triangles.rows(); ++f)
    if (is_written(mesh.triangles.row(f))) ids.triangles.row(n++) = mesh.triangles.row(f);
  ids.triangles.conservativeResize(n, 3);
  return ids;
}

bool has_copies(const std::vector<ism::AddedVertex>& added) {
  for (const ism::AddedVertex& p : added)
    if (p.corners[1] < 0) return true;
  return false;
}

/// Rows of the vertices of an embedded mesh as rows by written ids; those without one keep theirs.
template <class Rows>
Rows by_written_ids(const WrittenIds& ids, const Rows& rows, Rows result) {
  for (std::size_t v = 0; v < ids.id.size(); ++v)
    if (ids.id[v] >= 0) result.row(ids.id[v]) = rows.row(static_cast<Eigen::Index>(v));
  return result;
}

ism::Triangles written_triangles(const WrittenIds& ids) {
  ism::Triangles triangles = ids.triangles;
  for (Eigen::Index i = 0; i < triangles.size(); ++i)
    triangles.data()[i] = ids.id[static_cast<std::size_t>(triangles.data()[i])];
  return triangles;
}

// ==== [4] REPORT =================================================================================

/// How far landmarks end from where they belong, in diagonals of the bounding box of B.
struct LandmarkError {
  double largest = 0;
  int uncovered = 0;  // without an image
};

LandmarkError landmark_error(const Input& input, const ism::SurfaceMap& map) {
  const ism::Points3& b = input.b.vertices;
  const double diagonal = (b.colwise().maxCoeff() - b.colwise().minCoeff()).norm();
  LandmarkError result;
  for (const ism::Landmark& l : input.landmarks) {
    const ism::SurfacePoint image =
        l.a.vertex >= 0 ? map.forward_vertex(l.a.vertex) : map.forward(l.a.point);
    result.uncovered += !image.exists();
    if (!image.exists()) continue;
    const Eigen::Vector3d target = landmarks::position(input.b, l.b);
    const double distance = (map.position_on_b(image) - target).norm() / diagonal;
    result.largest = std::max(result.largest, distance);
  }
  return result;
}

/// What is said of a map besides what its result says.
struct Findings {
  LandmarkError landmarks;
  bool is_closed = false;
  bool has_openings = false;  // that were closed
  int n_polygons = 0;         // of the meta mesh
  ism::DistortionSummary distortion;
};

struct Seconds {
  double reading = 0, embedding = 0, optimization = 0, output = 0;
  double derivatives = 0, assembly = 0, solve = 0, search = 0;

  void add(const ism::Result& result) {
    embedding = result.start.seconds;
    optimization = result.seconds;
    for (const ism::IterationLog& it : result.log) {
      derivatives += it.seconds_derivatives;
      assembly += it.seconds_assembly;
      solve += it.seconds_solve;
      search += it.seconds_search;
    }
  }
  double total() const { return reading + embedding + optimization + output; }
};

using Json = nlohmann::ordered_json;  // writes what is not finite as null

Json json_state(const ism::IterationLog& it) {
  return {{"energy", it.energy},
          {"mean_distortion", it.mean_distortion},
          {"coverage_a", it.coverage_a},
          {"coverage_b", it.coverage_b},
          {"polygons", it.polygons}};
}

Json json_iteration(const ism::IterationLog& it) {
  Json json = {{"iteration", it.iteration}};
  json.update(json_state(it));
  json.update({{"map_energy", it.map_energy},
               {"energy_f", it.energy_f},
               {"energy_g", it.energy_g},
               {"omega", it.omega},
               {"step", it.step},
               {"max_step", it.max_step},
               {"pin_residual", it.pin_residual},
               {"history_reset", it.history_reset},
               {"quasi_newton", it.quasi_newton},
               {"seconds_derivatives", it.seconds_derivatives},
               {"seconds_assembly", it.seconds_assembly},
               {"seconds_solve", it.seconds_solve},
               {"seconds_search", it.seconds_search}});
  return json;
}

Json json_candidate(const ism::StartCandidate& c) {
  return {{"name", c.name},
          {"distortion", c.distortion},
          {"iterations", c.iterations},
          {"difference", c.difference}};
}

Json json_place(const ism::WorstPlace& p) {
  return {{"vertex_a", p.vertex_a},
          {"face_b", p.on_b.face},
          {"area", p.area},
          {"distortion", p.distortion}};
}

Json json_mesh(const std::string& path, const std::vector<std::string>& notes,
               const ism::TriangleMesh& mesh, const ism::Prepared& prepared,
               const std::vector<ism::AddedVertex>& added, int opening) {
  const WrittenIds ids = written_ids(prepared, mesh, added);
  const auto written = [&](int v) { return ids.id[static_cast<std::size_t>(v)]; };
  Json new_vertices = Json::array(), repairs = notes;
  std::size_t next = ids.id.size() - added.size();
  for (const ism::AddedVertex& p : added) {
    const int id = ids.id[next++];
    if (p.corners[1] < 0 || id < 0) continue;  // a copy is written as one with its original
    Json corners = Json::array(), weights = Json::array();
    for (int k = 0; k < 3 && p.corners[k] >= 0; ++k) {
      corners.push_back(written(p.corners[k]));
      weights.push_back(p.weights[k]);
    }
    new_vertices.push_back({{"corners", corners}, {"weights", weights}});
  }
  for (const ism::Problem& repair : prepared.repairs) repairs.push_back(repair.message);
  return {{"file", path},        {"vertices", ids.size}, {"triangles", ids.triangles.rows()},
          {"prepared", repairs}, {"opened_at", opening}, {"added", new_vertices}};
}

Json json_options(const Arguments& args) {
  Json json = {{"preset", args.preset},
               {"landmarks", args.landmarks},
               {"pins", args.pins},
               {"pin_landmarks", args.pin_landmarks},
               {"initial", args.initial},
               {"measure", args.measure},
               {"boundary", kBoundaries[static_cast<int>(args.options.boundary)]},
               {"variant", kVariants[static_cast<int>(args.variant)]}};
  ism::Options options = args.options;
  for_each_option(options, [&](const char* name, const auto& value) { json[name] = value; });
  return json;
}

template <class Item>
Json json_list(const std::vector<Item>& items, Json (*json_of)(const Item&)) {
  Json json = Json::array();
  for (const Item& item : items) json.push_back(json_of(item));
  return json;
}

Json json_seconds(const Seconds& s) {
  return {
      {"reading", s.reading},         {"embedding", s.embedding}, {"optimization", s.optimization},
      {"derivatives", s.derivatives}, {"assembly", s.assembly},   {"solve", s.solve},
      {"search", s.search},           {"output", s.output},       {"total", s.total()}};
}

std::string json_report(const Arguments& args, const Input& input, const ism::Result& result,
                        const Findings& found, const Seconds& s) {
  const ism::Embedding& e = result.start;
  Json start = {{"landmark_distance", e.landmark_distance}};
  Json final = {{"iterations", result.log.size()}, {"landmark_distance", found.landmarks.largest}};
  start.update(json_state(result.initial));
  final.update(json_state(result.final_state()));
  const ism::DistortionSummary& d = found.distortion;
  final["symmetric_dirichlet"] = {
      {"mean", d.mean}, {"median", d.median}, {"p95", d.p95}, {"largest", d.largest}};
  Json warnings = Json::array();
  for (const ism::Warning& w : result.warnings) warnings.push_back(w.message);
  Json iterations = json_list(result.log, json_iteration);
  iterations.insert(iterations.begin(), json_iteration(result.initial));
  const Json report = {
      {"status", ism::to_string(result.status)},
      {"message", result.message},
      {"warnings", warnings},
      {"a", json_mesh(args.a, input.notes_a, *e.a, *e.prepared_a, e.added_a, e.opening_a)},
      {"b", json_mesh(args.b, input.notes_b, *e.b, *e.prepared_b, e.added_b, e.opening_b)},
      {"landmarks", input.landmarks.size()},
      {"is_closed", found.is_closed},
      {"options", json_options(args)},
      {"start", start},
      {"candidates", json_list(result.candidates, json_candidate)},
      {"coarse", json_list(result.coarse, json_iteration)},
      {"worst_places", json_list(result.worst, json_place)},
      {"final", final},
      {"seconds", json_seconds(s)},
      {"iterations", iterations}};
  // Names of files may be anything; JSON is UTF-8.
  return report.dump(1, ' ', false, Json::error_handler_t::replace) + '\n';
}

// ==== [5] RESULTS ================================================================================

/// The edges of A's polygons as polylines on B.
std::string edges_text(const Input& input, const picture::Scene& scene) {
  const ism::SurfaceMap& map = scene.map;
  std::set<std::array<int, 2>> drawn;  // copies of an edge at a cut are one
  std::vector<Eigen::Vector3d> points;
  std::vector<std::vector<int>> lines;
  for (const std::array<int, 2>& edge : input.edges_a) {
    const std::vector<int>& same = scene.given.same_a;
    std::array<int, 2> key = edge;
    for (int& v : key) v = same.empty() ? v : same[static_cast<std::size_t>(v)];
    std::sort(key.begin(), key.end());
    if (!drawn.insert(key).second) continue;
    for (const ism::Polyline& polyline : map.forward_path({edge[0], edge[1]})) {
      lines.emplace_back();
      for (const ism::SurfacePoint& p : polyline) {
        lines.back().push_back(static_cast<int>(points.size()));
        points.push_back(map.position_on_b(p));
      }
    }
  }
  ism::Points3 vertices(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t i = 0; i < points.size(); ++i)
    vertices.row(static_cast<Eigen::Index>(i)) = points[i].transpose();
  return mesh_io::obj_text("edges of the polygons of A on B", vertices, lines, 'l');
}

/// Vertices by written ids, with those of the input that were dropped.
ism::Points3 written_vertices(const ism::TriangleMesh& given, const ism::TriangleMesh& mesh,
                              const WrittenIds& ids) {
  ism::Points3 vertices = ism::Points3::Zero(ids.size, 3);
  vertices.topRows(given.vertices.rows()) = given.vertices;
  return by_written_ids(ids, mesh.vertices, std::move(vertices));
}

/// An embedded mesh by written ids, with texture coordinates per corner.
std::string corners_text(const char* comment, const ism::TriangleMesh& given,
                         const ism::TriangleMesh& mesh, const WrittenIds& ids,
                         const Eigen::MatrixXd& uv, const char* material) {
  return mesh_io::obj_text(comment, written_vertices(given, mesh, ids),
                           mesh_io::polygons_of(written_triangles(ids)), uv, material);
}

/// An embedded mesh with its places in the plane; at copies of vertices, corners have their
/// own.
std::string planar_text(const char* comment, const ism::TriangleMesh& given,
                        const ism::TriangleMesh& mesh, const ism::Points2& plane,
                        const std::vector<ism::AddedVertex>& added, const WrittenIds& ids) {
  if (!has_copies(added))
    return mesh_io::obj_text(
        comment, written_vertices(given, mesh, ids), written_triangles(ids),
        by_written_ids(ids, plane, ism::Points2(ism::Points2::Zero(ids.size, 2))));
  Eigen::MatrixXd corners(ids.triangles.size(), 2);
  for (Eigen::Index c = 0; c < corners.rows(); ++c)
    corners.row(c) = plane.row(ids.triangles.data()[c]);
  return corners_text(comment, given, mesh, ids, corners, "");
}

/// The mesh on one side on the other one.
std::string remesh_text(const char* comment, const ism::SurfaceMap& map, ism::Side side) {
  const ism::TriangleMesh mesh = ism::remesh(map, side);
  return mesh_io::obj_text(comment, mesh.vertices, mesh.triangles);
}

std::vector<mesh_io::TextFile> result_files(const Input& input, const ism::Result& result,
                                            const picture::Scene& scene) {
  const ism::SurfaceMap& map = scene.map;
  const ism::MetaMesh& meta = scene.meta;
  const ism::Embedding& start = result.start;
  const WrittenIds ids_a = written_ids(*start.prepared_a, *start.a, start.added_a);
  const WrittenIds ids_b = written_ids(*start.prepared_b, *start.b, start.added_b);
  const char* const on_other =
      "mesh on the other surface; vertices without an image are in no face";
  return {
      {"A.obj", planar_text("mesh A; vt: place in the plane", input.a, *start.a, result.f,
                            start.added_a, ids_a)},
      {"B.obj", planar_text("mesh B; vt: place in the plane", input.b, *start.b, result.g,
                            start.added_b, ids_b)},
      {"A_on_B.obj", remesh_text(on_other, map, ism::Side::kA)},
      {"B_on_A.obj", remesh_text(on_other, map, ism::Side::kB)},
      {"A_edges_on_B.obj", edges_text(input, scene)},
      {"meta_A.obj",
       mesh_io::obj_text("common refinement, on A", meta.on_a, mesh_io::polygons_of(meta))},
      {"meta_B.obj",
       mesh_io::obj_text("common refinement, on B", meta.on_b, mesh_io::polygons_of(meta))},
  };
}

// ---- pictures, colours, textures, frames ----

std::string heat_ply(const picture::Scene& scene, ism::Side side) {
  const ism::MetaMesh& meta = scene.meta;
  const std::vector<ism::PolygonDistortion>& polygons = scene.distortion;
  Eigen::MatrixXd colors(meta.corner_a.rows(), 3);
  Eigen::VectorXd densities(meta.corner_a.rows());
  for (std::size_t p = 0; p < polygons.size(); ++p)
    for (int corner = meta.offsets[p]; corner < meta.offsets[p + 1]; ++corner) {
      densities[corner] = polygons[p].density;
      colors.row(corner) =
          picture::heat_of(polygons[p].density).cast<double>().matrix().transpose();
    }
  return mesh_io::ply_text("distortion", side == ism::Side::kA ? meta.on_a : meta.on_b,
                           mesh_io::polygons_of(meta), colors, densities);
}

/// Places in the plane of A as texture coordinates, in a unit square.
Eigen::MatrixXd in_unit_square(const ism::Points2& f, const ism::Points2& places) {
  const Eigen::RowVector2d lo = f.colwise().minCoeff();
  const double size = (f.colwise().maxCoeff() - lo).maxCoeff();
  return (places.rowwise() - lo) / size;
}

/// The texture coordinates of A at the corners of the common refinement; where A has none, its
/// places in the plane.
Eigen::MatrixXd texture_coordinates(const Input& input, const ism::Result& result,
                                    const picture::Scene& scene) {
  if (input.uv_a.rows() > 0)
    return ism::to_meta(scene.given, ism::Side::kA, ism::Element::kCorner).apply(input.uv_a);
  const ism::MetaMesh& meta = scene.meta;
  ism::Points2 places(meta.corner_a.rows(), 2);
  for (Eigen::Index c = 0; c < places.rows(); ++c)
    places.row(c) = meta.plane.row(meta.corners[static_cast<std::size_t>(c)]);
  return in_unit_square(result.f, places);
}

/// A with its texture coordinates, or, as it was embedded, with its places in the plane.
std::string textured_text(const Input& input, const ism::Result& result) {
  const char* const comment = "mesh A with its texture";
  if (input.uv_a.rows() > 0)
    return mesh_io::obj_text(comment, input.a.vertices, mesh_io::polygons_of(input.a.triangles),
                             input.uv_a, "textured.mtl");
  const ism::Embedding& start = result.start;
  const WrittenIds ids = written_ids(*start.prepared_a, *start.a, start.added_a);
  ism::Points2 places(ids.triangles.size(), 2);
  for (Eigen::Index c = 0; c < places.rows(); ++c)
    places.row(c) = result.f.row(ids.triangles.data()[c]);
  return corners_text(comment, input.a, *start.a, ids, in_unit_square(result.f, places),
                      "textured.mtl");
}

/// A with a texture, B to which the map carries it, and both with the distortion of the map.
std::string picture_png(const std::vector<ism::Landmark>& landmarks, const picture::Scene& scene,
                        const picture::Texture& texture) {
  constexpr double kWidth = 232, kHeight = 430, kTop = 50;
  render::Canvas canvas(1000, 560);
  double left = 10;
  for (const bool is_heat : {false, true}) {
    for (const ism::Side side : {ism::Side::kA, ism::Side::kB}) {
      const render::Rect panel = {left, kTop, kWidth, kHeight};
      if (is_heat)
        picture::draw_heat(scene, side, panel, canvas);
      else
        picture::draw_texture(scene, side, texture, panel, canvas);
      picture::draw_landmarks(scene, side, panel, landmarks, canvas);
      left += kWidth + 10;
    }
    left += 20;
  }
  const ism::DistortionSummary d = ism::summarize(scene.distortion);
  canvas.text({20, 32}, 12, "A, and its texture on B");
  canvas.text({520, 32}, 12, "distortion of the map");
  canvas.text(
      {20, 535}, 9,
      format("symmetric Dirichlet %.3f on average, below %.2f on 95%% of the area", d.mean, d.p95));
  picture::draw_heat_legend({640, 515, 300, 14}, canvas);
  return render::png_text(canvas.image());
}

void add_textured(const Input& input, const ism::Result& result, const picture::Scene& scene,
                  std::vector<mesh_io::TextFile>& files) {
  files.push_back({"A_textured.obj", textured_text(input, result)});
  files.push_back({"B_textured.obj",
                   mesh_io::obj_text("common refinement on B with the texture of A",
                                     scene.meta.on_b, mesh_io::polygons_of(scene.meta),
                                     texture_coordinates(input, result, scene), "textured.mtl")});
  files.push_back({"textured.mtl", mesh_io::mtl_text("texture.png")});
  files.push_back({"texture.png", render::png_text(input.texture)});
}

/// The mesh on the other side with texture coordinates from this one.
std::string uv_text(const ism::MetaMesh& meta, ism::Side from, const ism::Points2& uv) {
  const bool from_a = from == ism::Side::kA;
  const ism::TriangleMesh& mesh = from_a ? *meta.b : *meta.a;
  return mesh_io::obj_text(from_a ? "mesh B with the vt of A" : "mesh A with the vt of B",
                           mesh.vertices, mesh_io::polygons_of(mesh.triangles),
                           uv_islands::carry(meta, from, uv), "");
}

void add_uv(const Input& input, const ism::MetaMesh& meta, std::vector<mesh_io::TextFile>& files) {
  if (input.uv_a.rows() > 0)
    files.push_back({"B_uv.obj", uv_text(meta, ism::Side::kA, input.uv_a)});
  if (input.uv_b.rows() > 0)
    files.push_back({"A_uv.obj", uv_text(meta, ism::Side::kB, input.uv_b)});
}

/// Meshes and pictures of the shapes between A and B, all seen alike. Returns what is wrong.
std::string add_morph(const Arguments& args, const ism::Result& result, const picture::Scene& scene,
                      std::vector<mesh_io::TextFile>& files) {
  const morphing::Morph morph(scene.map, result.f, result.g);
  if (!morph.ok()) return "the shapes of --morph could not be computed";
  const Eigen::Index n = scene.meta.on_a.rows();
  ism::Points3 all(n * args.morph, 3);
  for (int i = 0; i < args.morph; ++i) all.middleRows(i * n, n) = morph.at(i / (args.morph - 1.0));
  const render::View view = render::look_along(all, scene.axes.a, {10, 10, 620, 620});
  for (int i = 0; i < args.morph; ++i) {
    render::Shape shape;
    shape.vertices = all.middleRows(i * n, n);
    shape.triangles = scene.fans.triangles;
    render::Canvas canvas(640, 640);
    canvas.draw(view, shape);
    files.push_back({frame_name(i) + ".obj", mesh_io::obj_text("between A and B", shape.vertices,
                                                               mesh_io::polygons_of(scene.meta))});
    files.push_back({frame_name(i) + ".png", render::png_text(canvas.image())});
  }
  return {};
}

/// The texture of A that pictures show.
picture::Texture shown_texture(const Arguments& args, const Input& input, const ism::Result& result,
                               const picture::Scene& scene) {
  if (args.texture.empty()) return picture::front_texture(scene);
  return {input.texture, texture_coordinates(input, result, scene)};
}

/// What the options ask for beyond the files of every run. Returns what is wrong.
std::string add_wanted_files(const Arguments& args, const Input& input, const ism::Result& result,
                             const picture::Scene& scene, std::vector<mesh_io::TextFile>& files) {
  picture::Texture texture;
  if (args.picture || !args.glb.empty()) texture = shown_texture(args, input, result, scene);
  if (args.picture) files.push_back({"picture.png", picture_png(input.landmarks, scene, texture)});
  if (args.heat) files.push_back({"heat_A.ply", heat_ply(scene, ism::Side::kA)});
  if (args.heat) files.push_back({"heat_B.ply", heat_ply(scene, ism::Side::kB)});
  if (!args.texture.empty()) add_textured(input, result, scene, files);
  if (args.transfer_uv) add_uv(input, scene.given, files);
  if (!args.glb.empty())
    files.push_back({args.glb, picture::glb_text(scene, texture, result.f, result.g,
                                                 args.options.keep_scale, args.heat)});
  if (!args.glb.empty() && files.back().text.empty())
    return "--glb: there is no morph, or the file would have more than 4 GB";
  return args.morph > 0 ? add_morph(args, result, scene, files) : "";
}

std::string write_files(const std::string& folder, std::vector<mesh_io::TextFile> files) {
  std::error_code ec;
  const bool is_new = std::filesystem::create_directories(folder, ec);
  if (ec) return "-o " + folder + ": the folder cannot be made";
  for (mesh_io::TextFile& file : files) file.path.insert(0, folder + '/');
#ifdef SIGXFSZ
  std::signal(SIGXFSZ, SIG_IGN);  // a limit of the file size is an error like a full disk
#endif
  const std::string error = mesh_io::write_files(files);
  if (!error.empty() && is_new) std::filesystem::remove(folder, ec);
  return error;
}

void print_landmarks(const Input& input, const ism::Result& result, const LandmarkError& error) {
  std::printf("landmarks    %zu, at most %.3g apart in the plane at the start (1: its radius),\n",
              input.landmarks.size(), result.start.landmark_distance);
  std::printf("             %.3g on B at the end (1: the diagonal of its box), %d not covered\n",
              error.largest, error.uncovered);
}

/// Without copies.
int count_added(const std::vector<ism::AddedVertex>& added) {
  int n = 0;
  for (const ism::AddedVertex& p : added) n += p.corners[1] >= 0;
  return n;
}

/// The start that won, and another one that is hardly worse but leads to a different map.
void print_start(const std::vector<ism::StartCandidate>& tried) {
  if (tried.empty()) return;
  const ism::StartCandidate& best = tried[0];
  std::printf("start        %s: the best of %zu\n", best.name.c_str(), tried.size());
  for (const ism::StartCandidate& c : tried)
    if (c.distortion < 1.05 * best.distortion && c.difference > 0.1)
      return void(
          std::printf("             %s has %.3f instead of %.3f on coarse surfaces and maps to "
                      "other places: landmarks tell which one is meant\n",
                      c.name.c_str(), c.distortion, best.distortion));
}

std::string place_on_b(const ism::SurfacePoint& p) {
  return p.exists() ? "in triangle " + std::to_string(p.face) + " of B" : "not covered";
}

void print_summary(const Arguments& args, const Input& input, const ism::Result& result,
                   const Findings& found, const Seconds& s) {
  const ism::IterationLog &first = result.initial, &last = result.final_state();
  const auto size = [](const ism::TriangleMesh& m) {
    return std::to_string(m.vertices.rows()) + " vertices, " + std::to_string(m.triangles.rows()) +
           " triangles";
  };
  std::printf("A            %s: %s\n", args.a.c_str(), size(input.a).c_str());
  print_preparation(input.notes_a, *result.start.prepared_a, result.start.opening_a);
  std::printf("B            %s: %s\n", args.b.c_str(), size(input.b).c_str());
  print_preparation(input.notes_b, *result.start.prepared_b, result.start.opening_b);
  const int added_a = count_added(result.start.added_a),
            added_b = count_added(result.start.added_b);
  if (added_a + added_b > 0)
    std::printf("added        %d vertices to A, %d to B, behind those given\n", added_a, added_b);
  std::printf("status       %s after %zu iterations%s%s\n", ism::to_string(result.status),
              result.log.size(), result.message.empty() ? "" : ": ", result.message.c_str());
  print_start(result.candidates);
  for (const ism::IterationLog& coarse : result.coarse)
    std::printf("before that  %d iterations on coarse surfaces\n", coarse.iteration);
  const bool is_default = args.measure == "sd";
  std::printf("distortion   %.4f on average, %d is an isometry (%.4f at the start)\n",
              is_default ? found.distortion.mean : last.mean_distortion, is_default ? 2 : 0,
              first.mean_distortion);
  for (std::size_t i = 0; i < std::min<std::size_t>(3, result.worst.size()); ++i)
    std::printf("  worst      %.3f on %.2f%% of the area, around vertex %d of A, %s\n",
                result.worst[i].distortion, 100 * result.worst[i].area, result.worst[i].vertex_a,
                place_on_b(result.worst[i].on_b).c_str());
  std::printf("coverage     %.2f%% of A, %.2f%% of B (%.2f%%, %.2f%% at the start)\n",
              100 * last.coverage_a, 100 * last.coverage_b, 100 * first.coverage_a,
              100 * first.coverage_b);
  if (found.is_closed)
    std::printf("closed       every point of A and B has an image%s\n",
                found.has_openings ? ", but for some at the openings" : "");
  if (!input.landmarks.empty()) print_landmarks(input, result, found.landmarks);
  std::printf("meta mesh    %d polygons\n", found.n_polygons);
  std::printf("seconds      %.1f: embedding %.1f, optimization %.1f (derivatives %.1f, ", s.total(),
              s.embedding, s.optimization, s.derivatives);
  std::printf("assembly %.1f, solve %.1f, search %.1f), files %.1f\n", s.assembly, s.solve,
              s.search, s.reading + s.output);
  std::printf("results in   %s: A.obj B.obj (vt: the plane), A_on_B.obj B_on_A.obj, ",
              args.out.c_str());
  std::printf("A_edges_on_B.obj, meta_A.obj meta_B.obj, report.json");
  if (args.picture) std::printf(", picture.png");
  if (args.heat) std::printf(", heat_A.ply heat_B.ply");
  if (!args.texture.empty())
    std::printf(", A_textured.obj B_textured.obj textured.mtl texture.png");
  if (input.uv_a.rows() > 0 && args.transfer_uv) std::printf(", B_uv.obj");
  if (input.uv_b.rows() > 0 && args.transfer_uv) std::printf(", A_uv.obj");
  if (args.morph > 0)
    std::printf(", %s.obj to %s.obj and .png", frame_name(0).c_str(),
                frame_name(args.morph - 1).c_str());
  if (!args.glb.empty()) std::printf(", %s", args.glb.c_str());
  std::printf("\n");
}

// ==== [6] MAIN ===================================================================================

int fail(int code, const std::string& error) {
  std::fprintf(stderr, "ism_map: %s\n", error.c_str());
  return code;
}

ism::Result compute(const Arguments& args, const Input& input) {
  ism::Options options = args.options;
  if (args.variant != Variant::kFull) options.omega_start = options.coarsest = 0;
  if (args.variant == Variant::kProjectedNewton) options.history_length = 1;
  return program::compute(input.a, input.b, input.landmarks, options, args.quiet);
}

int run(Arguments& args) {
  Clock::time_point start = Clock::now();
  Seconds seconds;
  Input input;
  std::string error = read_input(args, input);
  if (!error.empty()) return fail(kBadInput, error);
  seconds.reading = seconds_since(start);

  const ism::Result result = compute(args, input);
  if (!ism::is_usable(result.status))
    return fail(exit_code(result.status, !args.initial.empty()), result.message);
  for (const ism::Warning& w : result.warnings)
    std::fprintf(stderr, "ism_map: warning: %s\n", w.message.c_str());
  seconds.add(result);

  start = Clock::now();
  const ism::SurfaceMap map(result);
  if (!ism::is_usable(map.status())) return fail(kComputationFailed, map.message());
  const auto has_openings = [](const ism::Prepared& p) { return p.given_triangle.back() < 0; };
  const ism::Embedding& embedded = result.start;
  const picture::Scene scene = picture::scene_of(map, args.options.keep_scale);
  const Findings found = {landmark_error(input, map), map.is_closed(),
                          has_openings(*embedded.prepared_a) || has_openings(*embedded.prepared_b),
                          scene.meta.n_polygons(), ism::summarize(map.distortion())};
  std::vector<mesh_io::TextFile> files = result_files(input, result, scene);
  error = add_wanted_files(args, input, result, scene, files);
  if (!error.empty()) return fail(kComputationFailed, error);
  seconds.output = seconds_since(start);
  files.push_back({"report.json", json_report(args, input, result, found, seconds)});
  error = write_files(args.out, std::move(files));
  if (!error.empty()) return fail(kComputationFailed, error);
  seconds.output = seconds_since(start);
  if (!args.quiet) print_summary(args, input, result, found, seconds);
  return 0;
}

int flushed(int code) {
  return code == 0 && !program::is_printed()
             ? fail(kComputationFailed, "the output cannot be written")
             : code;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments args;
  const std::string error = read_arguments(std::vector<std::string>(argv + 1, argv + argc), args);
  if (!error.empty()) return fail(kBadInput, error);
  if (args.help) {
    std::fputs(kHelp, stdout);
    return flushed(0);
  }
  try {
    return flushed(run(args));
  } catch (const std::bad_alloc&) {
    return fail(kComputationFailed, "there is not enough memory for these meshes");
  }
}

// ism_transfer: carries the skin, the morph targets, the texture coordinates and the colours of one
// glTF character to the mesh of another one.
//
//   ism_transfer source.glb target.glb -o out.glb --landmarks landmarks.txt
//
// `ism_transfer --help` lists the options; characters.md says how it works. Exit code 0: the file
// was written (also after Ctrl-C or an iteration limit), 1: the computation failed, 2: bad input;
// 1 and 2 write nothing.

#include "character.hpp"
#include "character_out.hpp"
#include "gltf_io.hpp"
#include "ism.hpp"
#include "landmarks.hpp"
#include "mesh_io.hpp"
#include "program.hpp"
#include "retarget.hpp"
#include "uv_islands.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <new>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace {

using character::Carried;
using character::Character;
using program::kBadInput;
using program::kComputationFailed;

const char* const kHelp = R"(usage: ism_transfer SOURCE TARGET -o OUT.glb [options]

Maps the surface of one character onto another one's, and carries data of the source to the target:
the skin with its skeleton, moved into the target's body; morph targets, turned and scaled with the
map; texture coordinates, textures and vertex colours. SOURCE and TARGET are glTF files (.glb,
.gltf). The target keeps its vertices, materials and parts. The program maps the largest connected
surface of each, which must have no handles. Other parts of the target, such as eyes, take skin and
morphs from its nearest point.

  -o OUT.glb         the target with the carried data
  --landmarks FILE   lines `<vertex id in SOURCE> <vertex id in TARGET>`, ids from 0, through all
                     primitives in the order of the nodes; or points x y z; as for ism_map
  --only LIST        some of skin,morphs,uv,colors (default: all that exist; a skin must exist)
  --influences N     at most 4 (default) or 8 joints per vertex
  --iterations N     at most N iterations (default 1000)
  --threads N        0: as many as there are processors (default); the result does not depend on it
  --set NAME=VALUE   any option of the library that is a number, as for ism_map
  --quiet            print errors only
  --help             print this
)";

// ==== [1] ARGUMENTS ==============================================================================

struct Arguments {
  std::string source, target, out, landmarks;
  bool skin = true, morphs = true, uv = true, colors = true;
  bool is_chosen = false;  // by --only
  int influences = 4;
  bool quiet = false, help = false;
  ism::Options options;
};

/// Every function of this part returns an error sentence, or an empty string.
std::string read_only(const std::string& text, Arguments& args) {
  args.skin = args.morphs = args.uv = args.colors = false;
  args.is_chosen = true;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = (std::min)(text.find(',', begin), text.size());
    const std::string word = text.substr(begin, end - begin);
    bool* const chosen = word == "skin"     ? &args.skin
                         : word == "morphs" ? &args.morphs
                         : word == "uv"     ? &args.uv
                         : word == "colors" ? &args.colors
                                            : nullptr;
    if (!chosen) return "--only takes some of skin,morphs,uv,colors, not '" + word + "'";
    *chosen = true;
    begin = end + 1;
  }
  return {};
}

std::string read_value(const std::string& flag, const std::string& text, Arguments& args) {
  if (flag == "--only") return read_only(text, args);
  if (flag == "--set") return program::read_setting(text, args.options);
  if (flag == "--threads") return program::read_number(flag, text, args.options.threads);
  if (flag == "--iterations") return program::read_number(flag, text, args.options.max_iterations);
  if (flag == "--influences") {
    if (text != "4" && text != "8") return "--influences must be 4 or 8, not '" + text + "'";
    args.influences = text == "4" ? 4 : 8;
    return {};
  }
  (flag == "-o" ? args.out : args.landmarks) = text;
  return text.empty() ? flag + " needs a name" : "";
}

bool read_switch(const std::string& flag, Arguments& args) {
  if (flag == "--quiet") return args.quiet = true;
  if (flag == "--help" || flag == "-h") return args.help = true;
  return false;
}

std::string read_arguments(const std::vector<std::string>& words, Arguments& args) {
  const std::string error = program::read_words(
      words, {"-o", "--landmarks", "--only", "--influences", "--iterations", "--threads", "--set"},
      [&](const std::string& flag) { return read_switch(flag, args); },
      [&](const std::string& flag, const std::string& text) {
        return read_value(flag, text, args);
      },
      args.source, args.target);
  if (args.help || !error.empty()) return error;
  if (args.target.empty())
    return "two files are needed: ism_transfer source.glb target.glb -o out.glb";
  if (args.out.empty()) return "a file for the result is needed: -o out.glb";
  if (std::filesystem::path(args.out).extension() != ".glb")
    return "-o needs a name that ends in .glb, not '" + args.out + "'";
  return {};
}

// ==== [2] INPUT ==================================================================================

/// What is mapped.
struct Input {
  ism::TriangleMesh a, b;
  std::vector<ism::Landmark> landmarks;
};

/// What was asked for has to be there; without --only, a skin does. Returns what is wrong.
std::string check_source(const Arguments& args, const Character& source) {
  const auto missing = [&](bool is_wanted, bool is_there, const char* what) -> std::string {
    if (!is_wanted || is_there) return {};
    return args.source + ": the source has no " + what + ": nothing carried";
  };
  std::string error = missing(args.skin, source.weights.rows() > 0, "skin");
  if (!error.empty() && !args.is_chosen) error += " (--only carries the rest)";
  if (error.empty() && args.is_chosen) {
    error = missing(args.morphs, !source.morphs.empty(), "morph targets");
    if (error.empty()) error = missing(args.uv, source.uv.rows() > 0, "texture coordinates");
    if (error.empty()) error = missing(args.colors, source.colors.rows() > 0, "vertex colours");
  }
  return error;
}

/// Finds out whether the file could be written, without making anything yet.
std::string check_output(const Arguments& args) {
  namespace fs = std::filesystem;
  std::error_code ec;
  if (fs::is_directory(args.out, ec)) return "-o " + args.out + ": this is a folder";
  for (const std::string& input : {args.source, args.target})
    if (fs::equivalent(args.out, input, ec))
      return "-o " + args.out + " would overwrite the input " + input;
  const fs::path folder = fs::absolute(args.out, ec).parent_path();
  if (!fs::is_directory(folder, ec)) return "-o " + args.out + ": there is no such folder";
  if (!system_calls::may_write(folder))
    return "-o " + args.out + ": no permission to write to " + folder.string();
  return {};
}

/// Copies of vertices along seams stand for the first one of them.
void join_copies(const Character& source, const Character& target, Input& input,
                 std::vector<ism::Curve>& curves) {
  const auto join = [](const Character& c, int& vertex) {
    if (vertex >= 0) vertex = gltf_io::at(c.surface.same, vertex);
  };
  for (ism::Landmark& l : input.landmarks) join(source, l.a.vertex), join(target, l.b.vertex);
  for (ism::Curve& curve : curves) {
    for (int& v : curve.a) join(source, v);
    for (int& v : curve.b) join(target, v);
  }
  input.a = gltf_io::joined(source.surface);
  input.b = gltf_io::joined(target.surface);
}

std::string read_input(Arguments& args, Character& source, Character& target, Input& input) {
  const ism::TriangleMesh &a = source.surface.mesh, &b = target.surface.mesh;
  std::vector<ism::Landmark>& list = input.landmarks;
  std::string error = character::read(args.source, source);
  if (error.empty()) error = character::read(args.target, target);
  if (error.empty()) error = check_source(args, source);
  if (error.empty() && !args.landmarks.empty())
    error = landmarks::read(args.landmarks, a, b, list, &args.options.curves);
  if (!error.empty()) return error;
  join_copies(source, target, input, args.options.curves);
  std::vector<ism::LandmarkPoint> ends_a, ends_b;
  for (const ism::Landmark& l : list) ends_a.push_back(l.a), ends_b.push_back(l.b);
  if (error.empty()) error = program::check_surface(args.source, input.a, ends_a, args.options);
  if (error.empty()) error = program::check_surface(args.target, input.b, ends_b, args.options);
  return error.empty() ? check_output(args) : error;
}

// ==== [3] WHAT IS CARRIED ========================================================================

/// Where the vertices of A go; NaN for those that have no image, as copies.
ism::Points3 images_of(const ism::SurfaceMap& map) {
  const std::vector<ism::SurfacePoint> points = map.forward_vertices();
  ism::Points3 images(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t v = 0; v < points.size(); ++v)
    images.row(static_cast<Eigen::Index>(v)) = map.position_on_b(points[v]).transpose();
  return images;
}

/// The displacements at the vertices of B, turned and scaled as their places are.
void carry_morphs(const Character& source, const retarget::Carrier& carrier, Carried& carried) {
  if (source.morphs.empty()) return;
  const std::vector<retarget::Similarity> turns = carrier.turns();
  for (const character::Morph& morph : source.morphs) {
    ism::Values moves = carrier.at_vertices(morph.moves);
    for (std::size_t v = 0; v < turns.size(); ++v) {
      const Eigen::Index row = static_cast<Eigen::Index>(v);
      const Eigen::Vector3d move = moves.row(row);
      moves.row(row) = (turns[v].scale * (turns[v].rotation * move)).transpose();
    }
    carried.morphs.push_back({morph.name, moves});
  }
}

/// Each triangle of B gets the texture coordinates of one material.
void carry_uv(const Character& source, const retarget::Carrier& carrier, Carried& carried) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<int> material_of;  // per triangle of A
  for (const int part : source.part_of)
    material_of.push_back(
        gltf_io::primitive_of(source.file.model, gltf_io::at(source.surface.parts, part)).material);
  std::vector<int> materials = material_of;
  std::sort(materials.begin(), materials.end());
  materials.erase(std::unique(materials.begin(), materials.end()), materials.end());
  const Eigen::Index n = carrier.meta().b->triangles.rows();
  carried.uv = ism::Points2::Constant(3 * n, 2, nan);
  carried.materials.assign(static_cast<std::size_t>(n), -1);
  for (const int material : materials) {
    Eigen::MatrixXd uv = source.uv;
    for (std::size_t f = 0; f < material_of.size(); ++f)
      if (material_of[f] != material)
        uv.middleRows<3>(3 * static_cast<Eigen::Index>(f)).setConstant(nan);
    const Eigen::MatrixXd carried_uv = uv_islands::carry(carrier.meta(), ism::Side::kA, uv);
    for (Eigen::Index f = 0; f < n; ++f) {
      if (!carried_uv.middleRows<3>(3 * f).allFinite()) continue;
      carried.uv.middleRows<3>(3 * f) = carried_uv.middleRows<3>(3 * f);
      carried.materials[static_cast<std::size_t>(f)] = material;
    }
  }
}

void carry_skin(const Character& source, const retarget::Carrier& carrier,
                const ism::SurfaceMap& map, Carried& carried) {
  carried.weights = carrier.at_vertices(source.weights);
  const ism::Points3 images = images_of(map);
  const ism::TriangleMesh& a = map.mesh(ism::Side::kA);
  carried.frames = retarget::place_bones(source.bones, source.weights, a, images);
  carried.scale = retarget::fit_all(a, images).scale;
}

Carried carry(const Arguments& args, const Character& source, const Character& target,
              const ism::SurfaceMap& map, const retarget::Carrier& carrier) {
  Carried carried;
  carried.influences = args.influences;
  for (const gltf_io::Part& part : target.surface.parts) {
    bool is_mapped = false;
    for (int v = part.first_vertex; v < part.first_vertex + part.vertices; ++v)
      is_mapped = is_mapped || carrier.is_mapped(v);
    carried.is_mapped.push_back(is_mapped);
  }
  if (args.skin) carry_skin(source, carrier, map, carried);
  if (args.morphs) carry_morphs(source, carrier, carried);
  if (args.uv && source.uv.rows() > 0) carry_uv(source, carrier, carried);
  if (args.colors && source.colors.rows() > 0) carried.colors = carrier.at_vertices(source.colors);
  return carried;
}

// ==== [4] SUMMARY ================================================================================

std::string part_name(const Character& c, const gltf_io::Part& part) {
  const std::string& mesh = gltf_io::at(c.file.model.meshes, part.mesh).name;
  const std::string& node = gltf_io::at(c.file.model.nodes, part.node).name;
  return "'" + (mesh.empty() ? node : mesh) + "', primitive " + std::to_string(part.primitive);
}

void print_side(const char* side, const Character& c, const ism::Prepared& prepared, int opening) {
  std::printf("%-12s %s: %d vertices, %d triangles in %zu parts\n", side, c.file.path.c_str(),
              static_cast<int>(c.surface.mesh.vertices.rows()),
              static_cast<int>(c.surface.mesh.triangles.rows()), c.surface.parts.size());
  program::print_preparation(c.surface.notes, prepared, opening);
}

/// Parts that are not in the map, as a whole or in part.
void print_parts(const Character& target, const retarget::Carrier& carrier) {
  for (const gltf_io::Part& part : target.surface.parts) {
    int others = 0;
    for (int v = part.first_vertex; v < part.first_vertex + part.vertices; ++v)
      others += !carrier.is_mapped(v);
    if (others > 0)
      std::printf(
          "nearest      %s: %d of %d vertices are not mapped and follow the nearest point "
          "that is\n",
          part_name(target, part).c_str(), others, part.vertices);
  }
}

void print_carried(const Character& source, const Carried& carried,
                   const character::Written& written) {
  if (carried.weights.rows() > 0)
    std::printf("skin         %d joints, at most %d per vertex; the body is %.3f times as large\n",
                static_cast<int>(std::count(source.is_joint.begin(), source.is_joint.end(), true)),
                carried.influences, carried.scale);
  if (!carried.morphs.empty()) std::printf("morphs       %zu\n", carried.morphs.size());
  if (carried.uv.rows() > 0)
    std::printf("uv           carried, %d vertices along seams are copied\n", written.copies);
  for (const std::string& name : written.textured)
    std::printf(
        "             '%s' shows textures of its own: the carried coordinates are a further "
        "set\n",
        name.c_str());
  if (carried.colors.rows() > 0) std::printf("colors       carried\n");
}

void print_summary(const Arguments& args, const Character& source, const Character& target,
                   const ism::Result& result, const retarget::Carrier& carrier,
                   const Carried& carried, const character::Written& written, double seconds) {
  const ism::IterationLog& last = result.final_state();
  print_side("source", source, *result.start.prepared_a, result.start.opening_a);
  print_side("target", target, *result.start.prepared_b, result.start.opening_b);
  std::printf("status       %s after %zu iterations%s%s\n", ism::to_string(result.status),
              result.log.size(), result.message.empty() ? "" : ": ", result.message.c_str());
  std::printf("distortion   %.4f on average, 2 is an isometry\n", last.mean_distortion);
  std::printf("coverage     %.2f%% of the source, %.2f%% of the target\n", 100 * last.coverage_a,
              100 * last.coverage_b);
  print_parts(target, carrier);
  print_carried(source, carried, written);
  std::printf("seconds      %.1f\n", seconds);
  std::printf("result in    %s\n", args.out.c_str());
}

// ==== [5] MAIN ===================================================================================

int fail(int code, const std::string& error) {
  std::fprintf(stderr, "ism_transfer: %s\n", error.c_str());
  return code;
}

/// Characters in files stand upright and look ahead, mostly; bodies are much alike from the front
/// and from behind.
void warn_if_turned(const ism::SurfaceMap& map) {
  constexpr double kQuarter = 0.5 * 3.14159265358979323846;
  const retarget::Similarity all = retarget::fit_all(map.mesh(ism::Side::kA), images_of(map));
  const double angle = std::abs(Eigen::AngleAxisd(all.rotation).angle());
  if (angle > kQuarter)
    std::fprintf(stderr,
                 "ism_transfer: warning: the map turns the body by %.0f degrees: if the characters "
                 "look the same way in their files, landmarks in front and behind are needed\n",
                 angle * 90 / kQuarter);
}

int run(Arguments& args) {
  const program::Clock::time_point start = program::Clock::now();
  Character source, target;
  Input input;
  std::string error = read_input(args, source, target, input);
  if (!error.empty()) return fail(kBadInput, error);
  const ism::Result result =
      program::compute(input.a, input.b, input.landmarks, args.options, args.quiet);
  if (!ism::is_usable(result.status))
    return fail(program::exit_code(result.status, false), result.message);
  for (const ism::Warning& w : result.warnings)
    std::fprintf(stderr, "ism_transfer: warning: %s\n", w.message.c_str());
  const ism::SurfaceMap map(result);
  if (!ism::is_usable(map.status())) return fail(kComputationFailed, map.message());
  const retarget::Carrier carrier(map, target.surface.same);
  warn_if_turned(map);
  const Carried carried = carry(args, source, target, map, carrier);
  const character::Written written = character::write(source, target, carried);
  if (written.bytes.empty())
    return fail(kComputationFailed,
                "the file would have more than 4 GB, or numbers that are not finite");
  error = mesh_io::write_files({{args.out, written.bytes}});
  if (!error.empty()) return fail(kComputationFailed, error);
  if (!args.quiet)
    print_summary(args, source, target, result, carrier, carried, written,
                  program::seconds_since(start));
  if (!program::is_printed()) return fail(kComputationFailed, "the output cannot be written");
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments args;
  const std::string error = read_arguments(std::vector<std::string>(argv + 1, argv + argc), args);
  if (!error.empty()) return fail(kBadInput, error);
  if (args.help) {
    std::fputs(kHelp, stdout);
    return program::is_printed() ? 0 : fail(kComputationFailed, "the output cannot be written");
  }
  try {
    return run(args);
  } catch (const std::bad_alloc&) {
    return fail(kComputationFailed, "there is not enough memory for these characters");
  }
}

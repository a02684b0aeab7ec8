// mesh_io.hpp: reads OBJ, OFF, PLY and STL files, writes OBJ and PLY files. Part of the examples
// of ism.hpp.
//
//   mesh_io::ReadResult a = mesh_io::read_mesh("A.obj");
//   if (!a.ok) std::cerr << a.error << '\n';  // "A.obj, line 12: ..."
//
// Polygons are cut into triangles, also around holes behind a bridge. What can be mended is mended
// and told in notes; other faults in a file never crash and never throw: the result says in one
// sentence what is wrong and where. Numbers do not depend on the locale.

#ifndef ISM_EXAMPLES_MESH_IO_HPP
#define ISM_EXAMPLES_MESH_IO_HPP

#include "ism.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
#include <locale>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace mesh_io {

struct ReadResult {
  bool ok = false;
  std::string error;               // one sentence: the file, the line or element, what is wrong
  std::vector<std::string> notes;  // what was dropped or cut otherwise, a sentence for each kind
  ism::TriangleMesh mesh;
  std::vector<std::array<int, 2>> edges;  // of the polygons before they were cut, each once
  ism::Points2 planar;  // #V×2, the vt of every vertex; no rows if vertices have none or several
  ism::Points2 corner_uv;  // 3#F×2, the vt of corner k of triangle f in row 3 f + k, NaN where
                           // there is none; no rows if there is none at all
};

/// Reads a mesh; the extension tells the format (.obj, .off, .ply, .stl; any case). Vertices keep
/// their ids; one that is not finite, whose faces are dropped, lies where the first finite one
/// does.
///
/// OBJ: v, vt, f (i, i/t, i//n, i/t/n, negative indices); all else is skipped.
/// OFF: with or without header word; colours, normals and texture coordinates are skipped.
/// PLY: ascii and binary, both byte orders; all elements and properties; x, y, z of `vertex` and
///      vertex_indices (or vertex_index) of `face` and of `tristrips`, where -1 ends a strip.
/// STL: ascii, also of several solids, and binary. There are no ids in the file: corners at equal
///      coordinates are one vertex, and vertices are numbered as they first appear.
inline ReadResult read_mesh(const std::string& path);

/// One end of a landmark as it stands in a file: a vertex id or a point in space.
struct PairEnd {
  bool is_point = false;
  long long id = -1;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
};

struct IdPair {
  PairEnd a, b;
  long long line;
};

/// A line of vertices of A, and one of B on which it shall lie.
struct IdCurve {
  std::vector<long long> a, b;
  long long line;
};

struct PairsResult {
  bool ok = false;
  std::string error;
  std::vector<IdPair> pairs;
  std::vector<IdCurve> curves;
};

/// Reads a file of landmarks: lines `<id in A> <id in B>`, '#' starts a comment. Ids may be written
/// as 17.0. In place of an id there may be a point, `<x> <y> <z>`: six numbers are two points; of
/// four, the first one is the id if it is written as a whole number (17, not 17.0), else the last
/// one. Numbers are separated by blanks, tabs, commas or semicolons. A first line without any
/// number is a header. `curve <ids in A> | <ids in B>` is a curve.
inline PairsResult read_pairs(const std::string& path);

/// Pairs of vertices as landmarks. An id that is no vertex of any mesh stays one, as does a point;
/// landmarks.hpp finds what vertex or triangle that is.
inline std::vector<ism::Landmark> landmarks_of(const PairsResult& file);

/// Reads a file as a whole. Returns an empty string, or one sentence that says why it failed.
inline std::string read_bytes(const std::string& path, std::string& bytes);

struct TextFile {
  std::string path, text;
};

/// Writes files under temporary names and renames them when all are written: no reader sees half a
/// file, and a full disk leaves all as it was. Returns an empty string, or one sentence that says
/// why it failed.
inline std::string write_files(const std::vector<TextFile>& files);

/// The text of an OBJ file, %.17g, so that reading it back gives the same bits. `planar`, if it
/// has rows, is #V×2 and becomes one vt per vertex. A comment must not contain a line break.
inline std::string obj_text(const std::string& comment, const ism::Points3& vertices,
                            const ism::Triangles& triangles, const ism::Points2& planar = {});
inline std::string obj_text(const std::string& comment, const ism::Points3& vertices,
                            const std::vector<std::vector<int>>& items, char kind = 'f');

/// The same with texture coordinates for the corners of the polygons, one polygon after the other
/// (rows that are not finite are left out), and the material `surface` of a file written beside it.
inline std::string obj_text(const std::string& comment, const ism::Points3& vertices,
                            const std::vector<std::vector<int>>& polygons,
                            const Eigen::MatrixXd& corner_uv, const std::string& material_file);
/// A material file with the one material `surface`, which shows an image.
inline std::string mtl_text(const std::string& image_file);

/// A binary PLY file of polygons whose corners have colours in [0, 1] and a value of their own, one
/// polygon after the other; x y z red green blue quality per vertex, no vertex is shared.
inline std::string ply_text(const std::string& comment, const ism::Points3& vertices,
                            const std::vector<std::vector<int>>& polygons,
                            const Eigen::MatrixXd& corner_colors,
                            const Eigen::VectorXd& corner_values);

/// The polygons of a triangle mesh.
inline std::vector<std::vector<int>> polygons_of(const ism::Triangles& triangles);
inline std::vector<std::vector<int>> polygons_of(const ism::MetaMesh& meta);

/// The edges of triangles, each once, the lower vertex first.
inline std::vector<std::array<int, 2>> edges_of(const ism::Triangles& triangles);

/// Reads a whole text as one number or one integer; false if it is anything else.
inline bool parse_number(std::string_view text, double& value);
inline bool parse_integer(std::string_view text, long long& value);

// ==== [1] NUMBERS AND LINES ======================================================================

namespace detail {

/// What ism::Triangles can hold three times over (half-edges), with room to spare.
constexpr long long kMaxElements = 500000000;
constexpr std::uintmax_t kMaxBytes = std::uintmax_t(1) << 34;
/// Larger polygons are no mesh faces, and cutting them takes quadratic time.
constexpr int kMaxCorners = 10000;

inline bool is_blank(char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

/// The slow way, for standard libraries without from_chars and for numbers that underflow.
inline const char* parse_by_stream(const char* p, const char* end, double& value) {
  const char* stop = p;
  while (stop < end && *stop != '\0' && std::strchr("+-.0123456789eE", *stop)) ++stop;
  std::istringstream stream(std::string(p, stop));
  stream.imbue(std::locale::classic());
  return stream >> value && stream.peek() == std::istringstream::traits_type::eof() ? stop
                                                                                    : nullptr;
}

/// What programs write for numbers that are not finite: nan, -inf, nan(ind), 1.#QNAN. Returns the
/// place behind it, or null.
inline const char* parse_not_finite(const char* p, const char* end, double& value) {
  if (p < end && (*p == '-' || *p == '+')) ++p;
  if (end - p > 3 && std::string_view(p, 3) == "1.#") p += 3;
  if (end - p < 3) return nullptr;
  char word[3];
  for (int i = 0; i < 3; ++i) word[i] = static_cast<char>(p[i] | 32);  // in lower case
  bool is_known = false;
  for (const char* name : {"nan", "inf", "ind", "qna", "sna"})
    is_known = is_known || std::string_view(word, 3) == name;
  if (!is_known) return nullptr;
  while (p < end && (std::isalnum(static_cast<unsigned char>(*p)) || *p == '(' || *p == ')')) ++p;
  value = std::numeric_limits<double>::quiet_NaN();
  return p;
}

/// Parses a number at p and returns the place behind it, or null.
inline const char* parse_at(const char* p, const char* end, double& value) {
  if (const char* behind = parse_not_finite(p, end, value)) return behind;
  if (end - p > 1 && *p == '+' && p[1] != '-') ++p;
#if defined(__cpp_lib_to_chars)
  const std::from_chars_result r = std::from_chars(p, end, value);
  if (r.ec == std::errc()) return r.ptr;
  if (r.ec != std::errc::result_out_of_range) return nullptr;
#endif
  return parse_by_stream(p, end, value);
}

inline const char* parse_at(const char* p, const char* end, long long& value) {
  if (end - p > 1 && *p == '+' && p[1] != '-') ++p;
  const std::from_chars_result r = std::from_chars(p, end, value);
  return r.ec == std::errc() ? r.ptr : nullptr;
}

/// Walks through a text file, line by line or item by item. '#' ends a line.
class Scanner {
 public:
  explicit Scanner(std::string_view text, bool backslash_joins_lines = false)
      : p_(text.data()), end_(text.data() + text.size()), joins_(backslash_joins_lines) {
    if (text.substr(0, 3) == "\xEF\xBB\xBF") p_ += 3;  // byte order mark
  }

  bool at_end() const { return p_ == end_; }
  long long line() const { return line_; }
  long long bytes_left() const { return end_ - p_; }
  const char* place() const { return p_; }

  bool line_done() {
    while (p_ < end_ && (is_blank(*p_) || joined())) ++p_;
    return p_ == end_ || *p_ == '\n' || *p_ == '#';
  }
  void next_line() {
    const void* newline =
        at_end() ? nullptr : std::memchr(p_, '\n', static_cast<size_t>(end_ - p_));
    if (newline) ++line_;
    p_ = newline ? static_cast<const char*>(newline) + 1 : end_;
  }
  /// Goes on to the next item, over line ends; false at the end of the file.
  bool find_item() {
    while (line_done() && !at_end()) next_line();
    return !at_end();
  }

  /// The next word of this line, empty if there is none.
  std::string_view word() {
    if (line_done()) return {};
    const char* start = p_;
    while (p_ < end_ && !is_blank(*p_) && *p_ != '\n') ++p_;
    return std::string_view(start, static_cast<size_t>(p_ - start));
  }
  /// The next number of this line, up to a blank.
  template <class Number>
  bool number(Number& value) {
    return prefix(value) && !in_item();
  }
  /// The next number of this line, whatever follows it.
  template <class Number>
  bool prefix(Number& value) {
    if (line_done()) return false;
    const char* stop = parse_at(p_, end_, value);
    if (stop) p_ = stop;
    return stop != nullptr;
  }
  bool next_is(char c) const { return p_ < end_ && *p_ == c; }
  bool skip(char c) {
    const bool found = next_is(c);
    if (found) ++p_;
    return found;
  }
  bool in_item() const {
    return p_ < end_ && !is_blank(*p_) && *p_ != '\n' && *p_ != '#' && !joining_newline();
  }
  /// True behind the whole part of a number with a decimal comma.
  bool at_decimal_comma() const {
    return end_ - p_ > 1 && *p_ == ',' && p_[1] >= '0' && p_[1] <= '9';
  }

 private:
  const char* joining_newline() const {  // the newline that a backslash here takes back, or null
    if (!joins_ || *p_ != '\\') return nullptr;
    const char* q = p_ + 1;
    while (q < end_ && is_blank(*q)) ++q;
    return q < end_ && *q == '\n' ? q : nullptr;
  }
  bool joined() {  // moves to that newline
    const char* newline = joining_newline();
    if (!newline) return false;
    p_ = newline;
    ++line_;
    return true;
  }

  const char* p_;
  const char* end_;
  long long line_ = 1;
  bool joins_;
};

/// Counts what is mended by kinds, and remembers where the first ones are.
class Notes {
 public:
  enum Kind {
    kVertex,
    kVertexValues,
    kFaceValues,
    kFewCorners,
    kNotFinite,
    kNoArea,
    kRepeatedCorners,
    kReordered,
    kForced,
    kOtherDiagonal,
    kKinds
  };

  void add(Kind kind, const char* place_name, long long place) {
    List& list = lists_[kind];
    list.place_name = place_name;
    if (++list.count <= kTold) list.places += (list.count > 1 ? ", " : "") + std::to_string(place);
  }

  /// "dropped 4 faces without area (lines 3, 7, 9, ...)"
  std::vector<std::string> sentences() const {
    static const char* const kWords[kKinds][3] = {
        {"ignored", "vertex", " with a coordinate that is not finite"},
        {"ignored more values than the header names of", "vertex", ""},
        {"ignored more values than the header names of", "face", ""},
        {"dropped", "face", " of fewer than three corners"},
        {"dropped", "face", " with a corner that is not finite"},
        {"dropped", "face", " without area"},
        {"took repeated corners out of", "face", ""},
        {"reordered the corners of", "face", " with crossing sides"},
        {"cut", "face", " with crossing sides or without area as well as possible"},
        {"cut", "face", " along another diagonal, so that no vertex is lost"}};
    std::vector<std::string> result;
    for (std::size_t kind = 0; kind < kKinds; ++kind) {
      const List& list = lists_[kind];
      if (list.count == 0) continue;
      std::string sentence = kWords[kind][0];
      sentence += ' ' + std::to_string(list.count) + ' ' + noun(kWords[kind][1], list.count);
      sentence += kWords[kind][2];
      sentence += " (" + noun(list.place_name, list.count) + ' ' + list.places;
      result.push_back(sentence + (list.count > kTold ? ", ...)" : ")"));
    }
    return result;
  }

 private:
  static constexpr long long kTold = 3;
  struct List {
    long long count = 0;
    const char* place_name = "";
    std::string places;
  };
  static std::string noun(const std::string& name, long long count) {
    return count == 1 ? name : name == "vertex" ? "vertices" : name + 's';
  }
  std::array<List, kKinds> lists_;
};

/// What a file holds before it becomes a triangle mesh. Faces are lists of corners one after the
/// other; ids count from 0 and are not checked yet.
struct Soup {
  std::vector<std::array<double, 3>> points;
  std::vector<std::array<double, 2>> planar;
  std::vector<long long> corner, corner_planar;  // the second is empty or as long as the first
  std::vector<std::size_t> face_end;
  std::vector<long long> face_place;  // the line, or the number in the file, of every face
  const char* place_name = "line";
  Notes notes;

  std::size_t face_begin(std::size_t face) const { return face == 0 ? 0 : face_end[face - 1]; }
  void end_face(long long place) {
    face_end.push_back(corner.size());
    face_place.push_back(place);
  }
  void note(Notes::Kind kind, std::size_t face) { notes.add(kind, place_name, face_place[face]); }
};

inline std::string at(const char* what, long long number, const std::string& message) {
  return std::string(", ") + what + " " + std::to_string(number) + ": " + message;
}
inline std::string at_line(const Scanner& s, const std::string& message) {
  return at("line", s.line(), message);
}
/// Says what is missing where a number could not be read.
inline std::string no_number(const Scanner& s, const char* message) {
  return at_line(s, s.at_decimal_comma() ? "numbers need a decimal point, not a comma" : message);
}

inline bool finite(const std::array<double, 3>& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

/// Adds a vertex, which need not be finite: perhaps no face uses it.
inline void add_point(Soup& soup, const std::array<double, 3>& p, const char* what,
                      long long place) {
  if (!finite(p)) soup.notes.add(Notes::kVertex, what, place);
  soup.points.push_back(p);
}

/// Three numbers of one line. Returns what is wrong, or an empty string.
inline std::string read_point(Scanner& s, Soup& soup) {
  std::array<double, 3> p{};
  for (double& x : p)
    if (!s.number(x)) return no_number(s, "a vertex needs three numbers");
  add_point(soup, p, "line", s.line());
  return {};
}

// ==== [2] OBJ ====================================================================================

/// One index of a face: 1 is the first, -1 the last one so far. False if it is no such index.
inline bool read_obj_index(Scanner& s, std::size_t count, long long& id) {
  if (!s.in_item() || !s.prefix(id) || id == 0) return false;
  id = id > 0 ? id - 1 : id + static_cast<long long>(count);
  return id >= 0;
}

inline std::string read_obj_face(Scanner& s, Soup& soup) {
  const long long line = s.line();
  int n = 0;
  for (; !s.line_done(); ++n) {
    long long v = -1, t = -1, normal = 0;
    bool fine = read_obj_index(s, soup.points.size(), v);
    if (fine && s.skip('/')) {
      // The vt and the normal may be missing, and a wrong vt only means that there is none.
      if (!s.next_is('/') && s.in_item() && !read_obj_index(s, soup.planar.size(), t)) t = -1;
      if (s.skip('/') && s.in_item()) fine = s.prefix(normal);
    }
    if (!fine || s.in_item())
      return at_line(s, "corner " + std::to_string(n + 1) + " of the face is no valid index");
    soup.corner.push_back(v);
    soup.corner_planar.push_back(t);
  }
  soup.end_face(line);
  return {};
}

inline std::string read_obj(std::string_view text, Soup& soup) {
  Scanner s(text, true);
  std::string error;
  for (; !s.at_end() && error.empty(); s.next_line()) {
    const std::string_view key = s.word();
    if (key == "v") {
      error = read_point(s, soup);
    } else if (key == "vt") {
      std::array<double, 2> p{};
      if (!s.number(p[0]) || (!s.line_done() && !s.number(p[1])))
        return no_number(s, "a vt needs numbers");
      soup.planar.push_back(p);
    } else if (key == "f") {
      error = read_obj_face(s, soup);
    }
  }
  return error;
}

// ==== [3] OFF ====================================================================================

/// The optional first word, such as OFF, COFF or STNOFF. The number of vertices may follow it
/// without a blank.
inline std::string read_off_header(Scanner& s) {
  if (!s.find_item()) return ": the file is empty";
  Scanner ahead = s;
  const std::string_view word = ahead.word();
  const std::size_t behind = word.find("OFF") + 3;
  if (behind < 3 || word.find_first_not_of("0123456789", behind) != std::string_view::npos)
    return {};  // no header word
  if (word.find_first_not_of("STCNOF") < behind)
    return at_line(s, "only OFF files of points in space can be read, not " + std::string(word));
  for (const char c : word.substr(0, behind)) s.skip(c);
  ahead = s;
  if (ahead.word() == "BINARY") return at_line(s, "binary OFF files cannot be read");
  return {};
}

inline std::string read_off_face(Scanner& s, Soup& soup) {
  long long n = 0;
  if (!s.number(n) || n < 0 || n > s.bytes_left())
    return at_line(s, "a face needs a number of corners");
  for (long long k = 0; k < n; ++k) {
    long long id = 0;
    if (!s.number(id))
      return at_line(s, "corner " + std::to_string(k + 1) + " of the face is no valid index");
    soup.corner.push_back(id);
  }
  soup.end_face(s.line());
  return {};
}

inline std::string read_off(std::string_view text, Soup& soup) {
  Scanner s(text);
  std::string error = read_off_header(s);
  if (!error.empty()) return error;
  long long n[2] = {0, 0};
  for (long long& count : n)
    if (!s.find_item() || !s.number(count) || count < 0)
      return at_line(s, "the numbers of vertices and faces are missing");
  const char* const names[2] = {"vertices", "faces"};
  for (int kind = 0; kind < 2; ++kind)
    for (long long i = 0; i < n[kind]; ++i) {
      s.next_line();
      if (!s.find_item())
        return ": the file ends after " + std::to_string(i) + " of " + std::to_string(n[kind]) +
               " " + names[kind];
      error = kind == 0 ? read_point(s, soup) : read_off_face(s, soup);
      if (!error.empty()) return error;
    }
  return {};
}

// ==== [4] PLY ====================================================================================

struct PlyType {
  int bytes = 0;  // 0: no type
  enum class Kind { kSigned, kUnsigned, kFloat } kind = Kind::kSigned;
};

inline PlyType ply_type(std::string_view name) {
  using Kind = PlyType::Kind;
  struct Entry {
    const char *name, *other;
    PlyType type;
  };
  static const Entry kTypes[] = {
      {"char", "int8", {1, Kind::kSigned}},    {"uchar", "uint8", {1, Kind::kUnsigned}},
      {"short", "int16", {2, Kind::kSigned}},  {"ushort", "uint16", {2, Kind::kUnsigned}},
      {"int", "int32", {4, Kind::kSigned}},    {"uint", "uint32", {4, Kind::kUnsigned}},
      {"float", "float32", {4, Kind::kFloat}}, {"double", "float64", {8, Kind::kFloat}},
  };
  for (const Entry& e : kTypes)
    if (name == e.name || name == e.other) return e.type;
  return {};
}

struct PlyProperty {
  std::string name;
  PlyType type, count;  // count is set for lists
  bool is_list() const { return count.bytes > 0; }
};

struct PlyElement {
  std::string name;
  long long count = 0;
  std::vector<PlyProperty> properties;

  /// The fewest bytes a row takes: a guard against headers that promise too much.
  long long least_bytes(bool ascii) const {
    long long sum = 0;
    for (const PlyProperty& p : properties)
      sum += ascii ? 1 : p.is_list() ? p.count.bytes : p.type.bytes;
    return sum;
  }
};

enum class PlyFormat { kNone, kAscii, kLittleEndian, kBigEndian };

struct PlyHeader {
  PlyFormat format = PlyFormat::kNone;
  std::vector<PlyElement> elements;
};

inline std::string read_ply_property(Scanner& s, PlyHeader& header) {
  if (header.elements.empty()) return at_line(s, "a property must follow an element");
  PlyProperty p;
  std::string_view type = s.word();
  if (type == "list") {
    p.count = ply_type(s.word());
    if (!p.is_list() || p.count.kind == PlyType::Kind::kFloat)
      return at_line(s, "a list needs an integer type for its length");
    type = s.word();
  }
  p.type = ply_type(type);
  if (p.type.bytes == 0) return at_line(s, "unknown type '" + std::string(type) + "'");
  p.name = s.word();
  header.elements.back().properties.push_back(p);
  return {};
}

inline std::string read_ply_header_line(Scanner& s, std::string_view key, PlyHeader& header) {
  if (key == "format") {
    const std::string_view name = s.word();
    header.format = name == "ascii"                  ? PlyFormat::kAscii
                    : name == "binary_little_endian" ? PlyFormat::kLittleEndian
                    : name == "binary_big_endian"    ? PlyFormat::kBigEndian
                                                     : PlyFormat::kNone;
  } else if (key == "element") {
    PlyElement element;
    element.name = s.word();
    if (!s.number(element.count) || element.count < 0)
      return at_line(s, "an element needs a name and a count");
    header.elements.push_back(element);
  } else if (key == "property") {
    return read_ply_property(s, header);
  }
  return {};
}

inline std::string read_ply_header(Scanner& s, PlyHeader& header) {
  if (s.word() != "ply") return ": the file does not begin with 'ply'";
  while (true) {
    s.next_line();
    if (s.at_end()) return ": the header does not end";
    const std::string_view key = s.word();
    if (key == "end_header") break;
    const std::string error = read_ply_header_line(s, key, header);
    if (!error.empty()) return error;
  }
  s.next_line();
  if (header.format == PlyFormat::kNone) return ": the header names no known format";
  return {};
}

/// The values behind the header, one after the other, in any of the three formats.
class PlyValues {
 public:
  /// In text, rows are lines, unless they are said to follow each other anywhere.
  PlyValues(Scanner s, PlyFormat format, bool rows_are_lines = false)
      : text_(s),
        p_(s.place()),
        end_(p_ + s.bytes_left()),
        format_(format),
        rows_are_lines_(rows_are_lines) {}

  bool ascii() const { return format_ == PlyFormat::kAscii; }
  long long bytes_left() const { return ascii() ? text_.bytes_left() : end_ - p_; }
  bool at_decimal_comma() const { return ascii() && text_.at_decimal_comma(); }
  bool next(const PlyType& type, double& value) {
    if (ascii()) return text_.find_item() && text_.number(value);
    if (end_ - p_ < type.bytes) return false;
    std::uint64_t bits = 0;
    for (int i = 0; i < type.bytes; ++i) {
      const int k = format_ == PlyFormat::kLittleEndian ? i : type.bytes - 1 - i;
      bits |= static_cast<std::uint64_t>(static_cast<unsigned char>(p_[k])) << (8 * i);
    }
    p_ += type.bytes;
    value = decode(bits, type);
    return true;
  }
  /// True if there was more in the row than the header says.
  bool end_row() {
    if (!ascii() || !rows_are_lines_) return false;
    const bool more = !text_.line_done();
    text_.next_line();
    return more;
  }
  /// The next value as a whole number; false also if it is none.
  bool next(const PlyType& type, long long& value) {
    double x = 0;
    if (!next(type, x) || !(std::abs(x) < 9e15) || x != std::floor(x)) return false;
    value = static_cast<long long>(x);
    return true;
  }

 private:
  static double decode(std::uint64_t bits, const PlyType& type) {
    if (type.kind == PlyType::Kind::kUnsigned) return static_cast<double>(bits);
    if (type.kind == PlyType::Kind::kSigned) {
      const double x = static_cast<double>(bits);
      const double range = std::ldexp(1.0, 8 * type.bytes);
      return x < range / 2 ? x : x - range;
    }
    if (type.bytes == 8) return from_bits<double>(bits);
    return static_cast<double>(from_bits<float>(static_cast<std::uint32_t>(bits)));
  }
  template <class Float, class Bits>
  static Float from_bits(Bits bits) {
    static_assert(sizeof(Float) == sizeof(Bits), "IEEE 754 numbers");
    Float value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }

  Scanner text_;
  const char* p_;
  const char* end_;
  PlyFormat format_;
  bool rows_are_lines_;
};

/// Reads a list; its values are kept as corners if `soup` is given.
inline bool read_ply_list(PlyValues& values, const PlyProperty& property, Soup* soup) {
  long long n = 0;
  if (!values.next(property.count, n) || n < 0 || n > values.bytes_left()) return false;
  for (long long k = 0; k < n; ++k) {
    double ignored = 0;
    long long id = 0;
    if (!(soup ? values.next(property.type, id) : values.next(property.type, ignored)))
      return false;
    if (soup) soup->corner.push_back(id);
  }
  return true;
}

inline bool read_ply_row(PlyValues& values, const PlyElement& element, const PlyProperty* indices,
                         std::array<double, 3>& point, Soup& soup) {
  for (const PlyProperty& p : element.properties) {
    double value = 0;
    if (p.is_list() ? !read_ply_list(values, p, &p == indices ? &soup : nullptr)
                    : !values.next(p.type, value))
      return false;
    if (p.name.size() == 1 && p.name[0] >= 'x' && p.name[0] <= 'z')
      point[static_cast<std::size_t>(p.name[0] - 'x')] = value;
  }
  return true;
}

/// Takes the last corners for strips, each ended by -1, and puts their triangles in their place.
/// Every other one is turned; those that only join strips are left out.
inline void end_strips(std::size_t begin, Soup& soup) {
  const auto first = soup.corner.begin() + static_cast<std::ptrdiff_t>(begin);
  std::vector<long long> ids(first, soup.corner.end());
  soup.corner.resize(begin);
  ids.push_back(-1);
  std::size_t start = 0;
  for (std::size_t k = 0; k < ids.size(); ++k) {
    if (ids[k] == -1) {
      const std::size_t n = k - start;
      for (; n < 3 && start < k; ++start) soup.corner.push_back(ids[start]);
      if (n == 1 || n == 2) soup.end_face(static_cast<long long>(soup.face_end.size()));
      start = k + 1;
    } else if (k >= start + 2) {
      const std::size_t odd = (k - start) % 2;
      const long long a = ids[k - 2 + odd], b = ids[k - 1 - odd], c = ids[k];
      if (a == b || b == c || c == a) continue;
      soup.corner.insert(soup.corner.end(), {a, b, c});
      soup.end_face(static_cast<long long>(soup.face_end.size()));
    }
  }
}

inline std::string read_ply_element(PlyValues& values, const PlyElement& element, Soup& soup) {
  const bool vertices = element.name == "vertex", strips = element.name == "tristrips",
             faces = element.name == "face" || strips;
  const PlyProperty* indices = nullptr;
  int coordinates = 0;
  for (const PlyProperty& p : element.properties) {
    if (p.is_list() && (p.name == "vertex_indices" || p.name == "vertex_index")) indices = &p;
    if (!p.is_list() && (p.name == "x" || p.name == "y" || p.name == "z")) ++coordinates;
  }
  if (vertices && coordinates != 3) return ": the vertices do not have one x, y and z each";
  if (faces && !indices) return ": the faces have no list vertex_indices";
  if (element.properties.empty()) return {};
  if (element.count > values.bytes_left() / element.least_bytes(values.ascii()) + 1)
    return ": the header announces " + std::to_string(element.count) + " elements '" +
           element.name + "', more than the file can hold";
  for (long long i = 0; i < element.count; ++i) {
    std::array<double, 3> point{};
    const std::size_t corners = soup.corner.size();
    if (!read_ply_row(values, element, faces ? indices : nullptr, point, soup))
      return at(element.name.c_str(), i,
                values.at_decimal_comma() ? "numbers need a decimal point, not a comma"
                                          : "the data are cut short or not a number");
    const bool more = values.end_row();
    if (more && vertices) soup.notes.add(Notes::kVertexValues, "vertex", i);
    if (more && faces) soup.notes.add(Notes::kFaceValues, "face", i);
    if (vertices) add_point(soup, point, "vertex", i);
    if (strips) end_strips(corners, soup);
    if (faces && !strips) soup.end_face(static_cast<long long>(soup.face_end.size()));
  }
  return {};
}

inline std::string read_ply(std::string_view text, Soup& soup) {
  Scanner s(text);
  PlyHeader header;
  std::string error = read_ply_header(s, header);
  if (!error.empty()) return error;
  for (const bool rows_are_lines : {true, false}) {
    PlyValues values(s, header.format, rows_are_lines);
    soup = Soup();
    soup.place_name = "face";
    error.clear();
    for (std::size_t i = 0; i < header.elements.size() && error.empty(); ++i)
      error = read_ply_element(values, header.elements[i], soup);
    if (error.empty()) break;
  }
  return error;
}

// ==== [5] STL ====================================================================================

/// Makes corners at equal coordinates one vertex; until here every corner has its own.
inline void join_corners(Soup& soup) {
  using Key = std::pair<std::array<std::uint64_t, 3>, std::size_t>;  // bits, which NaN have too
  std::vector<Key> keys(soup.points.size());
  for (std::size_t i = 0; i < keys.size(); ++i) {
    for (double& x : soup.points[i]) x += 0.0;  // -0 is 0
    std::memcpy(keys[i].first.data(), soup.points[i].data(), sizeof keys[i].first);
    keys[i].second = i;
  }
  std::sort(keys.begin(), keys.end());
  std::vector<std::size_t> first(keys.size());
  for (std::size_t k = 0; k < keys.size(); ++k)
    first[keys[k].second] =
        k > 0 && keys[k].first == keys[k - 1].first ? first[keys[k - 1].second] : keys[k].second;
  std::vector<long long> id(keys.size());
  std::size_t n = 0;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    id[i] = first[i] == i ? static_cast<long long>(n) : id[first[i]];
    if (first[i] == i) soup.points[n++] = soup.points[i];
  }
  soup.points.resize(n);
  soup.corner = std::move(id);
}

inline void add_corner(Soup& soup) {
  soup.corner.push_back(static_cast<long long>(soup.corner.size()));
}

inline std::string lower_word(Scanner& s) {
  std::string word(s.word());
  for (char& c : word)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return word;
}

inline std::string read_stl_text(std::string_view text, Soup& soup) {
  Scanner s(text);
  long long loop = 0;  // the line of the loop that is read, or 0
  while (s.find_item()) {
    const std::string word = lower_word(s);
    if (word == "solid" || word == "endsolid") {
      s.next_line();  // over its name
    } else if (word == "normal") {
      for (int k = 0; k < 3; ++k) s.word();
    } else if (word == "outer") {
      loop = s.line();
    } else if (word == "vertex" && loop > 0) {
      const std::string error = read_point(s, soup);
      if (!error.empty()) return error;
      add_corner(soup);
    } else if (word == "endloop" && loop > 0) {
      soup.end_face(loop);
      loop = 0;
    } else if (word != "facet" && word != "loop" && word != "endfacet") {
      return at_line(s, "'" + word.substr(0, 20) + "' is not expected here");
    }
  }
  return loop > 0 ? at("line", loop, "the file ends inside of a facet") : "";
}

inline std::string read_stl_bytes(PlyValues values, double count, Soup& soup) {
  const PlyType number = ply_type("float"), attribute = ply_type("ushort");
  soup.place_name = "triangle";
  for (long long i = 0; static_cast<double>(i) < count; ++i) {
    std::array<double, 3> p{};
    bool fine = true;
    for (int row = 0; row < 4; ++row) {  // the normal and three corners
      for (double& x : p) fine = values.next(number, x) && fine;
      if (row == 0) continue;
      soup.points.push_back(p);
      add_corner(soup);
    }
    double ignored = 0;
    if (!fine || !values.next(attribute, ignored))
      return ": the file ends after " + std::to_string(i) + " of " +
             std::to_string(static_cast<long long>(count)) + " triangles";
    soup.end_face(i);
  }
  return {};
}

/// Headers of binary files may begin with `solid`, too; their size tells them, or a byte 0.
inline std::string read_stl(std::string_view text, Soup& soup) {
  Scanner s(text);
  PlyValues values(s, PlyFormat::kLittleEndian);
  double count = 0;  // behind 80 bytes
  bool is_binary = true;
  for (int k = 0; k < 21; ++k) is_binary = is_binary && values.next(ply_type("uint"), count);
  const bool fits = is_binary && static_cast<double>(text.size()) == 84 + 50 * count;
  const bool has_zero = text.substr(0, 1000).find('\0') != std::string_view::npos;
  s.find_item();
  const bool is_text = !fits && !has_zero && lower_word(s) == "solid";
  if (!is_text && !is_binary) return ": the file is no STL file";
  const std::string error =
      is_text ? read_stl_text(text, soup) : read_stl_bytes(values, count, soup);
  soup.notes = Notes();  // a vertex that is not finite is told with its face
  if (error.empty()) join_corners(soup);
  return error;
}

// ==== [6] POLYGONS TO TRIANGLES ==================================================================

inline bool same_place(const Soup& soup, std::size_t k, std::size_t l) {
  const auto point = [&](std::size_t i) { return static_cast<std::size_t>(soup.corner[i]); };
  return point(k) == point(l) || soup.points[point(k)] == soup.points[point(l)];
}

/// Takes out corners at the place of the one before, and ways that lead to a corner and back.
inline void drop_repeated(const Soup& soup, std::vector<std::size_t>& kept) {
  const auto erase = [&](std::size_t k) {
    kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(k % kept.size()));
  };
  for (std::size_t since = 0, k = 0; since < kept.size() && kept.size() > 2;) {
    const std::size_t n = kept.size();
    const auto at = [&](std::size_t i) { return kept[i % n]; };
    ++since;
    if (same_place(soup, at(k), at(k + 1))) {
      erase(k + 1), since = 0;
    } else if (same_place(soup, at(k), at(k + 2))) {
      const std::size_t last = (k + 2) % n, tip = (k + 1) % n;
      erase((std::max)(last, tip)), erase((std::min)(last, tip)), since = 0;
    } else {
      k = (k + 1) % n;
      continue;
    }
    k = (k + kept.size() - 1) % kept.size();  // the corner before may be repeated now
  }
}

/// Which corners of a face stay; none if it is dropped. Triangles stay as they are: degenerate ones
/// are left to ism::prepare().
inline void find_kept(Soup& soup, std::size_t face, std::vector<std::size_t>& kept) {
  kept.clear();
  for (std::size_t k = soup.face_begin(face); k < soup.face_end[face]; ++k) kept.push_back(k);
  bool is_finite = true;
  for (const std::size_t k : kept)
    is_finite = is_finite && finite(soup.points[static_cast<std::size_t>(soup.corner[k])]);
  const std::size_t n = kept.size();
  if (n > 3 && is_finite) drop_repeated(soup, kept);
  if (n >= 3 && kept.size() >= 3 && is_finite) {
    if (kept.size() < n) soup.note(Notes::kRepeatedCorners, face);
    return;
  }
  soup.note(n < 3 ? Notes::kFewCorners : is_finite ? Notes::kNoArea : Notes::kNotFinite, face);
  kept.clear();
}

/// Checks the ids, and drops faces and corners that are of no use. Returns what is wrong, or an
/// empty string.
inline std::string mend_faces(Soup& soup) {
  const long long n = static_cast<long long>(soup.points.size());
  for (std::size_t face = 0; face < soup.face_end.size(); ++face) {
    const std::size_t begin = soup.face_begin(face), size = soup.face_end[face] - begin;
    if (size > static_cast<std::size_t>(kMaxCorners))
      return at(soup.place_name, soup.face_place[face],
                "the face has " + std::to_string(size) + " corners, at most " +
                    std::to_string(kMaxCorners) + " can be read");
    for (std::size_t k = 0; k < size; ++k)
      if (soup.corner[begin + k] < 0 || soup.corner[begin + k] >= n)
        return at(soup.place_name, soup.face_place[face],
                  "corner " + std::to_string(k + 1) +
                      " of the face refers to a vertex that does not exist (there are " +
                      std::to_string(n) + ")");
  }
  Soup mended;
  std::vector<std::size_t> kept;
  for (std::size_t face = 0; face < soup.face_end.size(); ++face) {
    find_kept(soup, face, kept);
    for (const std::size_t k : kept) {
      mended.corner.push_back(soup.corner[k]);
      if (!soup.corner_planar.empty()) mended.corner_planar.push_back(soup.corner_planar[k]);
    }
    if (!kept.empty()) mended.end_face(soup.face_place[face]);
  }
  soup.corner.swap(mended.corner);
  soup.corner_planar.swap(mended.corner_planar);
  soup.face_end.swap(mended.face_end);
  soup.face_place.swap(mended.face_place);
  return {};
}

inline double turn(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
}

/// A polygon in space, laid into the plane of its mean normal, about 1 in size; all zero if it has
/// no area.
inline std::vector<Eigen::Vector2d> flatten(const Soup& soup, const std::vector<int>& ids) {
  std::vector<Eigen::Vector2d> flat(ids.size(), Eigen::Vector2d::Zero());
  const auto point = [&](std::size_t i) {
    const std::array<double, 3>& p = soup.points[static_cast<std::size_t>(ids[i])];
    return Eigen::Vector3d(p[0], p[1], p[2]);
  };
  double size = 0;
  for (std::size_t i = 1; i < ids.size(); ++i)
    size = (std::max)(size, (point(i) - point(0)).cwiseAbs().maxCoeff());
  if (!(size > 0) || !std::isfinite(size)) return flat;
  std::vector<Eigen::Vector3d> p(ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) p[i] = (point(i) - point(0)) / size;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  // twice the vector area
  for (std::size_t i = 0; i < p.size(); ++i) normal += p[i].cross(p[(i + 1) % p.size()]);
  if (!(normal.norm() > 1e-12)) return flat;
  const Eigen::Vector3d x = normal.normalized().unitOrthogonal(), y = normal.normalized().cross(x);
  for (std::size_t i = 0; i < p.size(); ++i) flat[i] = {x.dot(p[i]), y.dot(p[i])};
  return flat;
}

using Side = std::array<int, 2>;

inline Side ascending(int u, int v) { return {(std::min)(u, v), (std::max)(u, v)}; }

/// Three corners of a polygon.
using CornerTriple = std::array<std::size_t, 3>;

/// Cuts a polygon into triangles by its ears: corners whose triangle turns left and holds no
/// other corner, not even on its border. Convexity is not needed, corners may lie on a straight
/// line, and no triangle is flipped or degenerate. Of a quad this takes the shorter diagonal that
/// lies inside. The polygon may touch itself, as where it goes along a bridge to a hole and back.
class EarCutter {
 public:
  /// Diagonals that are taken are avoided.
  EarCutter(const Soup& soup, std::vector<int> ids, const std::set<Side>& taken)
      : ids_(std::move(ids)), flat_(flatten(soup, ids_)), taken_(taken) {}

  /// Fails for polygons that cross themselves, and if what is taken would be needed.
  bool cut(std::vector<CornerTriple>& triangles) {
    // Rounding puts corners meant to be on a line beside it, so thin ears are avoided if possible.
    for (const double tolerance : {1e-10, 0.0}) {
      tolerance_ = tolerance;
      if (cut_ears(triangles, Rule::kEars)) return true;
    }
    return false;
  }
  /// Where no ear is left, takes corners that turn left, in the end any.
  void force(std::vector<CornerTriple>& triangles) { cut_ears(triangles, Rule::kAny); }
  /// True if some ear was left as its diagonal was taken.
  bool has_avoided() const { return has_avoided_; }

 private:
  enum class Rule { kEars, kLeftTurns, kAny };
  static constexpr std::size_t kSmall = 32;  // up to here the shortest diagonal is worth its cost

  bool cut_ears(std::vector<CornerTriple>& triangles, Rule last) {
    std::vector<std::size_t> rest(flat_.size());
    for (std::size_t i = 0; i < rest.size(); ++i) rest[i] = i;
    std::size_t from = 0;
    triangles.clear();
    rule_ = Rule::kEars;
    while (rest.size() >= 3) {
      const std::size_t k = find_ear(rest, from);
      if (k == rest.size() && rule_ == last) return false;
      if (k == rest.size()) {
        rule_ = rule_ == Rule::kEars ? Rule::kLeftTurns : Rule::kAny;
        continue;
      }
      triangles.push_back(corners(rest, k));
      rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(k));
      from = k + 1;
    }
    return true;
  }

  static CornerTriple corners(const std::vector<std::size_t>& rest, std::size_t k) {
    const std::size_t n = rest.size();
    return {rest[(k + n - 1) % n], rest[k], rest[(k + 1) % n]};
  }

  /// The ear of the shortest diagonal; in a large polygon, the first ear from a given corner on.
  std::size_t find_ear(const std::vector<std::size_t>& rest, std::size_t from) {
    const std::size_t n = rest.size();
    std::size_t best = n;
    double shortest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t k = (from + i) % n;
      const CornerTriple t = corners(rest, k);
      const double length = (flat_[t[0]] - flat_[t[2]]).squaredNorm();
      if (!(length < shortest) || !is_ear(rest, t) || is_avoided(rest, t)) continue;
      shortest = length;
      best = k;
      if (n > kSmall) break;
    }
    return best;
  }

  bool is_avoided(const std::vector<std::size_t>& rest, const CornerTriple& t) {
    if (taken_.empty() || rest.size() == 3 || rule_ == Rule::kAny) return false;
    const bool avoided = taken_.count(ascending(ids_[t[0]], ids_[t[2]])) > 0;
    has_avoided_ = has_avoided_ || avoided;
    return avoided;
  }

  bool is_ear(const std::vector<std::size_t>& rest, const CornerTriple& t) const {
    if (rule_ == Rule::kAny) return true;
    const Eigen::Vector2d &a = flat_[t[0]], &b = flat_[t[1]], &c = flat_[t[2]];
    if (!(turn(a, b, c) > tolerance_)) return false;
    if (rule_ == Rule::kLeftTurns) return true;
    for (std::size_t k = 0; k < rest.size(); ++k) {
      const Eigen::Vector2d& p = flat_[rest[k]];
      if (!(turn(a, b, p) >= -tolerance_ && turn(b, c, p) >= -tolerance_ &&
            turn(c, a, p) >= -tolerance_))
        continue;
      if (rest[k] == t[0] || rest[k] == t[1] || rest[k] == t[2] || p == a || p == c) continue;
      // Where the polygon touches the tip, it must not come from inside.
      const CornerTriple there = corners(rest, k);
      if (p != b || is_between(t, flat_[there[0]]) || is_between(t, flat_[there[2]])) return false;
    }
    return true;
  }

  /// True if p lies in the angle at the tip.
  bool is_between(const CornerTriple& t, const Eigen::Vector2d& p) const {
    return turn(flat_[t[0]], flat_[t[1]], p) > 0 && turn(flat_[t[1]], flat_[t[2]], p) > 0;
  }

  std::vector<int> ids_;
  std::vector<Eigen::Vector2d> flat_;
  const std::set<Side>& taken_;
  double tolerance_ = 0;
  Rule rule_ = Rule::kEars;
  bool has_avoided_ = false;
};

/// Cuts the faces of a soup that has been mended.
class Triangulator {
 public:
  explicit Triangulator(Soup& soup) : soup_(soup) {}

  /// Triangles of places in Soup::corner.
  std::vector<CornerTriple> run() {
    std::vector<CornerTriple> list;
    bool has_polygons = false;
    for (std::size_t face = 0; face < soup_.face_end.size(); ++face)
      has_polygons = has_polygons || size(face) > 3;
    if (has_polygons) find_lone_vertices();
    std::vector<CornerTriple> cut;
    for (std::size_t face = 0; face < soup_.face_end.size(); ++face) {
      cut = {{0, 1, 2}};
      if (size(face) > 3) cut_face(face, cut);
      const std::size_t begin = soup_.face_begin(face);
      for (const CornerTriple& t : cut) {
        list.push_back({begin + t[0], begin + t[1], begin + t[2]});
        for (std::size_t k = 0; k < 3 && has_polygons; ++k) take(face, t[k], t[(k + 1) % 3]);
      }
    }
    return list;
  }

 private:
  std::size_t size(std::size_t face) const { return soup_.face_end[face] - soup_.face_begin(face); }
  int id(std::size_t face, std::size_t k) const {
    return static_cast<int>(soup_.corner[soup_.face_begin(face) + k % size(face)]);
  }
  std::vector<int> ids(std::size_t face) const {
    std::vector<int> list;
    for (std::size_t k = 0; k < size(face); ++k) list.push_back(id(face, k));
    return list;
  }

  /// Finds vertices of just two faces, between the same two neighbours. They are lost if both faces
  /// are cut between these: then two triangles coincide. Copies of a face are to coincide.
  void find_lone_vertices() {
    struct Use {
      int count = 0;
      std::size_t face = 0;
      Side sides{};
    };
    std::vector<Use> uses(soup_.points.size());
    for (std::size_t face = 0; face < soup_.face_end.size(); ++face)
      for (std::size_t k = 0; k < size(face); ++k) {
        Use& use = uses[static_cast<std::size_t>(id(face, k))];
        const Side sides = ascending(id(face, k + size(face) - 1), id(face, k + 1));
        if (use.count == 0) use.face = face, use.sides = sides;
        use.count += use.count == 1 && (sides != use.sides || are_copies(face, use.face)) ? 2 : 1;
      }
    is_lone_.resize(uses.size());
    for (std::size_t v = 0; v < uses.size(); ++v) is_lone_[v] = uses[v].count == 2;
    for (std::size_t face = 0; face < soup_.face_end.size(); ++face)
      for (std::size_t k = 0; k < size(face); ++k) take(face, k, (k + 1) % size(face));
  }

  bool are_copies(std::size_t f, std::size_t g) const {
    std::vector<int> a = ids(f), b = ids(g);
    std::sort(a.begin(), a.end());
    std::sort(b.begin(), b.end());
    return a == b;
  }

  /// Remembers a side of a triangle if all corners to one side of it are lone vertices.
  void take(std::size_t face, std::size_t i, std::size_t j) {
    if (passes_lone(face, i, j) || passes_lone(face, j, i))
      taken_.insert(ascending(id(face, i), id(face, j)));
  }
  bool passes_lone(std::size_t face, std::size_t i, std::size_t j) const {
    const std::size_t n = size(face), count = (j + n - i) % n;
    for (std::size_t k = 1; k < count; ++k)
      if (!is_lone_[static_cast<std::size_t>(id(face, i + k))]) return false;
    return count > 1;
  }

  void cut_face(std::size_t face, std::vector<CornerTriple>& cut) {
    EarCutter cutter(soup_, ids(face), taken_);
    if (cutter.cut(cut)) {
      if (cutter.has_avoided()) soup_.note(Notes::kOtherDiagonal, face);
      return;
    }
    static const std::set<Side> kNone;
    if (!taken_.empty() && EarCutter(soup_, ids(face), kNone).cut(cut)) return;
    if (size(face) == 4 && reorder(face, cut)) return soup_.note(Notes::kReordered, face);
    cutter.force(cut);
    soup_.note(Notes::kForced, face);
  }

  /// Puts the corners of a quad into an order in which its sides do not cross, if in that it meets
  /// other faces along no fewer sides.
  bool reorder(std::size_t face, std::vector<CornerTriple>& cut) {
    const std::vector<int> given = ids(face);
    std::array<std::size_t, 4> best{};
    int most = neighbours(face, given) - 1;
    for (const std::array<std::size_t, 4>& order :
         {std::array<std::size_t, 4>{0, 1, 3, 2}, {2, 3, 1, 0}, {0, 2, 1, 3}, {3, 1, 2, 0}}) {
      std::vector<int> list;
      for (const std::size_t k : order) list.push_back(given[k]);
      std::vector<CornerTriple> triangles;
      const int n = neighbours(face, list);
      if (n <= most || !EarCutter(soup_, list, taken_).cut(triangles)) continue;
      most = n, best = order, cut = triangles;
    }
    if (best == std::array<std::size_t, 4>{}) return false;
    for (std::vector<long long>* corners : {&soup_.corner, &soup_.corner_planar}) {
      if (corners->empty()) continue;
      long long* p = corners->data() + soup_.face_begin(face);
      const std::array<long long, 4> old = {p[0], p[1], p[2], p[3]};
      for (std::size_t k = 0; k < 4; ++k) p[k] = old[best[k]];
    }
    return true;
  }

  /// In how many sides a polygon in place of a face would meet other faces, which go along them the
  /// other way.
  int neighbours(std::size_t face, const std::vector<int>& polygon) {
    if (sides_.empty()) {
      for (std::size_t f = 0; f < soup_.face_end.size(); ++f)
        for (std::size_t k = 0; k < size(f); ++k) sides_.push_back({id(f, k), id(f, k + 1)});
      std::sort(sides_.begin(), sides_.end());
    }
    int count = 0;
    for (std::size_t k = 0; k < polygon.size(); ++k) {
      const Side back = {polygon[(k + 1) % polygon.size()], polygon[k]};
      const auto range = std::equal_range(sides_.begin(), sides_.end(), back);
      std::ptrdiff_t others = range.second - range.first;
      for (std::size_t l = 0; l < size(face); ++l)
        others -= back == Side{id(face, l), id(face, l + 1)};
      count += others > 0;
    }
    return count;
  }

  Soup& soup_;
  std::vector<char> is_lone_;
  std::set<Side> taken_;     // sides of triangles that cut off lone vertices
  std::vector<Side> sides_;  // of all faces as they were given, sorted; empty until needed
};

/// The sides of all polygons, each once, ascending; ids have been checked.
inline std::vector<std::array<int, 2>> soup_edges(const Soup& soup) {
  std::vector<std::array<int, 2>> edges;
  std::size_t begin = 0;
  for (const std::size_t end : soup.face_end) {
    for (std::size_t k = begin; k < end; ++k) {
      edges.push_back(ascending(static_cast<int>(soup.corner[k]),
                                static_cast<int>(soup.corner[k + 1 < end ? k + 1 : begin])));
    }
    begin = end;
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

/// The vt of every corner of the triangles, NaN where there is none; no rows if all have none.
inline ism::Points2 soup_corner_uv(const Soup& soup, const std::vector<CornerTriple>& triangles) {
  bool has_some = false;
  ism::Points2 uv = ism::Points2::Constant(3 * static_cast<Eigen::Index>(triangles.size()), 2,
                                           std::numeric_limits<double>::quiet_NaN());
  for (std::size_t i = 0; i < 3 * triangles.size() && !soup.corner_planar.empty(); ++i) {
    const long long id = soup.corner_planar[triangles[i / 3][i % 3]];
    if (id < 0 || id >= static_cast<long long>(soup.planar.size())) continue;
    const std::array<double, 2>& p = soup.planar[static_cast<std::size_t>(id)];
    if (!std::isfinite(p[0]) || !std::isfinite(p[1])) continue;
    uv.row(static_cast<Eigen::Index>(i)) << p[0], p[1];
    has_some = true;
  }
  return has_some ? uv : ism::Points2();
}

/// The vt of every vertex; no rows unless each vertex has exactly one.
inline ism::Points2 soup_planar(const Soup& soup) {
  std::vector<long long> of_vertex(soup.points.size(), -1);
  for (std::size_t k = 0; k < soup.corner_planar.size(); ++k) {
    const long long t = soup.corner_planar[k];
    if (t < 0 || t >= static_cast<long long>(soup.planar.size())) return {};
    long long& known = of_vertex[static_cast<std::size_t>(soup.corner[k])];
    if (known >= 0 &&
        soup.planar[static_cast<std::size_t>(known)] != soup.planar[static_cast<std::size_t>(t)])
      return {};
    known = t;
  }
  ism::Points2 planar(static_cast<Eigen::Index>(of_vertex.size()), 2);
  for (std::size_t v = 0; v < of_vertex.size(); ++v) {
    if (of_vertex[v] < 0) return {};
    const std::array<double, 2>& p = soup.planar[static_cast<std::size_t>(of_vertex[v])];
    planar.row(static_cast<Eigen::Index>(v)) << p[0], p[1];
  }
  return planar;
}

inline std::string soup_to_mesh(Soup& soup, ReadResult& result) {
  if (soup.points.empty()) return ": there are no vertices";
  if (soup.face_end.empty()) return ": there are no faces";
  if (soup.points.size() > kMaxElements || soup.corner.size() > kMaxElements)
    return ": the mesh is too large";
  const std::string error = mend_faces(soup);
  if (!error.empty()) return error;
  const std::vector<CornerTriple> triangles = Triangulator(soup).run();
  result.notes = soup.notes.sentences();
  if (triangles.empty()) return ": no face is left: " + result.notes.back();
  const std::array<double, 3> some = *std::find_if(soup.points.begin(), soup.points.end(), finite);
  result.mesh.vertices.resize(static_cast<Eigen::Index>(soup.points.size()), 3);
  for (std::size_t i = 0; i < soup.points.size(); ++i) {
    const std::array<double, 3>& p = finite(soup.points[i]) ? soup.points[i] : some;
    result.mesh.vertices.row(static_cast<Eigen::Index>(i)) << p[0], p[1], p[2];
  }
  result.mesh.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      result.mesh.triangles(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) =
          static_cast<int>(soup.corner[triangles[i][k]]);
  result.corner_uv = soup_corner_uv(soup, triangles);
  result.edges = soup_edges(soup);
  result.planar = soup_planar(soup);
  return {};
}

// ==== [7] FILES ==================================================================================

inline std::string lower_extension(const std::string& path) {
  std::string e = std::filesystem::path(path).extension().string();
  for (char& c : e)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return e;
}

/// Reads a file as a whole. Returns what is wrong, or an empty string.
inline std::string load(const std::string& path, std::string& text) {
  std::error_code ec;
  if (!std::filesystem::exists(path, ec)) return ": there is no such file";
  if (!std::filesystem::is_regular_file(path, ec)) return ": this is not a file";
  const std::uintmax_t size = std::filesystem::file_size(path, ec);
  if (!ec && size > kMaxBytes) return ": the file is too large";
  std::FILE* file = ec ? nullptr : std::fopen(path.c_str(), "rb");
  if (!file) return ": the file cannot be opened";
  text.resize(static_cast<std::size_t>(size));
  text.resize(std::fread(&text[0], 1, text.size(), file));
  const bool failed = std::ferror(file) != 0;
  std::fclose(file);
  return failed ? ": the file cannot be read" : "";
}

inline void append_number(std::string& text, double x) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, " %.17g", x);
  for (char* c = buffer; *c; ++c)
    if (*c == ',') *c = '.';  // the locale's decimal comma
  text += buffer;
}

template <class Points>
void append_points(std::string& text, const char* key, const Points& points) {
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    text += key;
    for (Eigen::Index k = 0; k < points.cols(); ++k) append_number(text, points(i, k));
    text += '\n';
  }
}

inline void append_corner(std::string& text, int id, bool planar) {
  const std::string name = std::to_string(id + 1);
  text += ' ' + name;
  if (planar) text += '/' + name;
}

}  // namespace detail

inline bool parse_number(std::string_view text, double& value) {
  return detail::parse_at(text.data(), text.data() + text.size(), value) ==
         text.data() + text.size();
}

inline bool parse_integer(std::string_view text, long long& value) {
  return detail::parse_at(text.data(), text.data() + text.size(), value) ==
         text.data() + text.size();
}

inline ReadResult read_mesh(const std::string& path) {
  ReadResult result;
  std::string text;
  const std::string extension = detail::lower_extension(path);
  const auto read = extension == ".obj"   ? detail::read_obj
                    : extension == ".off" ? detail::read_off
                    : extension == ".ply" ? detail::read_ply
                    : extension == ".stl" ? detail::read_stl
                                          : nullptr;
  detail::Soup soup;
  std::string error = detail::load(path, text);
  if (error.empty() && !read) error = ": only OBJ, OFF, PLY and STL files can be read";
  if (error.empty()) error = read(text, soup);
  if (error.empty()) error = detail::soup_to_mesh(soup, result);
  result.ok = error.empty();
  for (char& c : error)
    if (static_cast<unsigned char>(c) < 32 || c == 127) c = '?';  // quoted from a broken file
  if (!result.ok) result.error = path + error;
  return result;
}

inline std::string read_bytes(const std::string& path, std::string& bytes) {
  const std::string error = detail::load(path, bytes);
  return error.empty() ? "" : path + error;
}

namespace detail {

/// The words of a line, up to a '#'.
inline std::vector<std::string_view> fields_of(std::string_view line) {
  constexpr const char* kSeparators = " \t\r\v\f\n,;";
  line = line.substr(0, line.find('#'));
  std::vector<std::string_view> fields;
  for (;;) {
    line.remove_prefix((std::min)(line.find_first_not_of(kSeparators), line.size()));
    if (line.empty()) return fields;
    fields.push_back(line.substr(0, line.find_first_of(kSeparators)));
    line.remove_prefix(fields.back().size());
  }
}

/// A whole number, also one that is written as 17.0.
inline bool parse_id(std::string_view text, long long& id) {
  constexpr double kLargest = 9e15;  // beyond, not every whole number is a double
  double x = 0;
  if (parse_integer(text, id)) return true;
  if (!parse_number(text, x) || x != std::floor(x) || !(std::abs(x) < kLargest)) return false;
  id = static_cast<long long>(x);
  return true;
}

/// Reads one end of a landmark from one or three fields. Returns what is wrong.
inline std::string read_end(const std::string_view* field, PairEnd& end) {
  if (!end.is_point && !parse_id(*field, end.id))
    return "'" + std::string(*field) + "' is no vertex id";
  for (int k = 0; k < 3 && end.is_point; ++k)
    if (!parse_number(field[k], end.point[k]) || !std::isfinite(end.point[k]))
      return "'" + std::string(field[k]) + "' is no coordinate";
  return {};
}

inline std::string read_pair(const std::vector<std::string_view>& fields, IdPair& pair) {
  const std::size_t n = fields.size();
  if (n != 2 && n != 4 && n != 6)
    return "two vertex ids are expected, or points x y z in place of them: 2, 4 or 6 numbers (1.5, "
           "not 1,5), not " +
           std::to_string(n);
  long long id = 0;
  const bool id_first =
      parse_integer(fields[0], id) || (parse_id(fields[0], id) && !parse_id(fields[n - 1], id));
  pair.a.is_point = n == 6 || (n == 4 && !id_first);
  pair.b.is_point = n == 6 || (n == 4 && id_first);
  const std::string error = read_end(&fields[0], pair.a);
  return error.empty() ? read_end(&fields[pair.a.is_point ? 3 : 1], pair.b) : error;
}

inline std::string read_curve(const std::vector<std::string_view>& fields, IdCurve& curve) {
  std::vector<long long>* ids = &curve.a;
  for (std::size_t i = 1; i < fields.size(); ++i) {
    if (fields[i] == "|" && ids == &curve.a)
      ids = &curve.b;
    else if (ids->push_back(0); !parse_id(fields[i], ids->back()))
      return "'" + std::string(fields[i]) + "' is no vertex id";
  }
  if (!curve.a.empty() && !curve.b.empty()) return {};
  return "a curve has vertex ids of A, then '|', then vertex ids of B";
}

inline bool has_number(const std::vector<std::string_view>& fields) {
  double x = 0;
  return std::any_of(fields.begin(), fields.end(),
                     [&](std::string_view field) { return parse_number(field, x); });
}

/// What is quoted from a broken file has to stay one line.
inline std::string printable(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 32 || c == 127) c = '?';
  return text;
}

}  // namespace detail

inline PairsResult read_pairs(const std::string& path) {
  PairsResult result;
  std::string text, error = detail::load(path, text);
  detail::Scanner s(text);
  for (bool is_first = true; error.empty() && s.find_item();) {
    IdPair pair = {{}, {}, s.line()};
    const char* const begin = s.place();
    s.next_line();
    const std::vector<std::string_view> fields =
        detail::fields_of({begin, static_cast<std::size_t>(s.place() - begin)});
    if (fields.empty()) continue;
    const bool is_curve = fields[0] == "curve";
    const bool is_header = is_first && !is_curve && !detail::has_number(fields);
    is_first = false;
    if (is_header) continue;
    if (is_curve) {
      result.curves.push_back({{}, {}, pair.line});
      error = detail::read_curve(fields, result.curves.back());
    } else {
      result.pairs.push_back(pair);
      error = detail::read_pair(fields, result.pairs.back());
    }
    if (!error.empty()) error = detail::at("line", pair.line, error);
  }
  result.ok = error.empty();
  if (!result.ok) result.error = path + detail::printable(error);
  return result;
}

namespace detail {

inline std::string temporary(const std::string& path) { return path + ".tmp"; }

inline std::string write_temporary(const TextFile& f) {
  std::FILE* file = std::fopen(temporary(f.path).c_str(), "wb");
  if (!file) return f.path + ": the file cannot be created";
  const bool written = std::fwrite(f.text.data(), 1, f.text.size(), file) == f.text.size();
  return std::fclose(file) == 0 && written ? "" : f.path + ": the file cannot be written";
}

}  // namespace detail

inline std::string write_files(const std::vector<TextFile>& files) {
  std::string error;
  std::error_code ec;
  for (const TextFile& f : files)
    if (error.empty()) error = detail::write_temporary(f);
  for (const TextFile& f : files) {
    if (!error.empty()) break;
    std::filesystem::rename(detail::temporary(f.path), f.path, ec);
    if (ec) error = f.path + ": the file cannot be written";
  }
  if (!error.empty())
    for (const TextFile& f : files) std::filesystem::remove(detail::temporary(f.path), ec);
  return error;
}

inline std::string obj_text(const std::string& comment, const ism::Points3& vertices,
                            const ism::Triangles& triangles, const ism::Points2& planar) {
  std::string text = "# " + comment + '\n';
  detail::append_points(text, "v", vertices);
  detail::append_points(text, "vt", planar);
  for (Eigen::Index i = 0; i < triangles.rows(); ++i) {
    text += 'f';
    for (int k = 0; k < 3; ++k) detail::append_corner(text, triangles(i, k), planar.rows() > 0);
    text += '\n';
  }
  return text;
}

inline std::string obj_text(const std::string& comment, const ism::Points3& vertices,
                            const std::vector<std::vector<int>>& items, char kind) {
  std::string text = "# " + comment + '\n';
  detail::append_points(text, "v", vertices);
  for (const std::vector<int>& item : items) {
    text += kind;
    for (const int id : item) detail::append_corner(text, id, false);
    text += '\n';
  }
  return text;
}

inline std::string obj_text(const std::string& comment, const ism::Points3& vertices,
                            const std::vector<std::vector<int>>& polygons,
                            const Eigen::MatrixXd& corner_uv, const std::string& material_file) {
  std::string text = "# " + comment + '\n';
  if (!material_file.empty()) text += "mtllib " + material_file + "\nusemtl surface\n";
  detail::append_points(text, "v", vertices);
  std::string faces;
  Eigen::Index row = 0;
  int vt = 0;
  for (const std::vector<int>& polygon : polygons) {
    const Eigen::Index n = static_cast<Eigen::Index>(polygon.size());
    const bool has_uv = corner_uv.middleRows(row, n).allFinite();
    if (has_uv) detail::append_points(text, "vt", corner_uv.middleRows(row, n));
    faces += 'f';
    for (const int id : polygon) {
      detail::append_corner(faces, id, false);
      if (has_uv) faces += '/' + std::to_string(++vt);
    }
    faces += '\n';
    row += n;
  }
  return text + faces;
}

inline std::string mtl_text(const std::string& image_file) {
  return "newmtl surface\nKd 1 1 1\nmap_Kd " + image_file + '\n';
}

namespace detail {

/// The lowest bytes of a number, the lowest first.
inline void append_bytes(std::string& text, std::uint32_t x, int count) {
  for (int i = 0; i < count; ++i) text += static_cast<char>(x >> 8 * i & 255u);
}

inline void append_float(std::string& text, double x) {
  const float rounded = static_cast<float>(x);
  std::uint32_t bits = 0;
  std::memcpy(&bits, &rounded, sizeof bits);
  append_bytes(text, bits, 4);
}

}  // namespace detail

inline std::string ply_text(const std::string& comment, const ism::Points3& vertices,
                            const std::vector<std::vector<int>>& polygons,
                            const Eigen::MatrixXd& corner_colors,
                            const Eigen::VectorXd& corner_values) {
  std::string text = "ply\nformat binary_little_endian 1.0\ncomment " + comment +
                     "\nelement vertex " + std::to_string(corner_values.size());
  for (const char* name :
       {"float x", "float y", "float z", "uchar red", "uchar green", "uchar blue", "float quality"})
    text += "\nproperty " + std::string(name);
  text += "\nelement face " + std::to_string(polygons.size()) +
          "\nproperty list uchar int vertex_indices\nend_header\n";
  Eigen::Index row = 0;
  for (const std::vector<int>& polygon : polygons)
    for (const int id : polygon) {
      for (int k = 0; k < 3; ++k) detail::append_float(text, vertices(id, k));
      for (int k = 0; k < 3; ++k) {
        const double level = (std::min)((std::max)(corner_colors(row, k), 0.0), 1.0);
        detail::append_bytes(text, static_cast<std::uint32_t>(std::lround(255 * level)), 1);
      }
      detail::append_float(text, corner_values[row++]);
    }
  std::uint32_t corner = 0;
  for (const std::vector<int>& polygon : polygons) {
    detail::append_bytes(text, static_cast<std::uint32_t>(polygon.size()), 1);
    for (std::size_t k = 0; k < polygon.size(); ++k) detail::append_bytes(text, corner++, 4);
  }
  return text;
}

inline std::vector<ism::Landmark> landmarks_of(const PairsResult& file) {
  const auto vertex = [](long long id) {
    return id >= 0 && id <= (std::numeric_limits<int>::max)() ? static_cast<int>(id) : -1;
  };
  std::vector<ism::Landmark> landmarks;
  for (const IdPair& pair : file.pairs) landmarks.push_back({vertex(pair.a.id), vertex(pair.b.id)});
  return landmarks;
}

inline std::vector<std::vector<int>> polygons_of(const ism::Triangles& triangles) {
  std::vector<std::vector<int>> polygons;
  for (Eigen::Index f = 0; f < triangles.rows(); ++f)
    polygons.push_back({triangles(f, 0), triangles(f, 1), triangles(f, 2)});
  return polygons;
}

inline std::vector<std::array<int, 2>> edges_of(const ism::Triangles& triangles) {
  std::vector<std::array<int, 2>> edges;
  for (Eigen::Index f = 0; f < triangles.rows(); ++f)
    for (int k = 0; k < 3; ++k)
      edges.push_back(detail::ascending(triangles(f, k), triangles(f, (k + 1) % 3)));
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

inline std::vector<std::vector<int>> polygons_of(const ism::MetaMesh& meta) {
  std::vector<std::vector<int>> polygons;
  for (std::size_t p = 0; p + 1 < meta.offsets.size(); ++p)
    polygons.emplace_back(meta.corners.begin() + meta.offsets[p],
                          meta.corners.begin() + meta.offsets[p + 1]);
  return polygons;
}

}  // namespace mesh_io

#endif  // ISM_EXAMPLES_MESH_IO_HPP

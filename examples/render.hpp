// render.hpp: a small software renderer for the pictures of the examples of ism.hpp.
//
//   render::Canvas canvas(800, 600);
//   const render::View view = render::look_at(shape.vertices, 30, 20, {0, 0, 800, 600});
//   canvas.draw(view, shape);
//   canvas.text({20, 580}, 14, "a shape");
//   mesh_io::write_files({{"shape.png", render::png_text(canvas.image())}});
//
// Triangles with a depth buffer, smooth shading, colours per corner or a texture, lines, stroke
// text, legends; anti-aliased by supersampling. Parallel projection. Coordinates on the canvas are
// pixels from the top left. Nothing depends on a window system.
//
// One file of a program defines RENDER_IMPLEMENTATION before it includes this. If that file defines
// RENDER_ZLIB too, PNG files are compressed by zlib; without, they are stored.

#ifndef ISM_EXAMPLES_RENDER_HPP
#define ISM_EXAMPLES_RENDER_HPP

#include "ism.hpp"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace render {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Color = Eigen::Array3f;  // red, green, blue in [0, 1]

struct Image {
  int width = 0, height = 0;
  std::vector<Color> pixels;  // row by row from the top
  Image() = default;
  Image(int w, int h, const Color& color)
      : width(w),
        height(h),
        pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), color) {}
  Color& at(int x, int y) { return pixels[index(x, y)]; }
  const Color& at(int x, int y) const { return pixels[index(x, y)]; }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(x);
  }
};

/// A part of a canvas, in pixels from its top left.
struct Rect {
  double x, y, width, height;
};

/// A parallel projection: the rows of `axes` point right, up and towards the viewer.
struct View {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  Vec3 center = Vec3::Zero();  // goes to `middle`
  Vec2 middle = Vec2::Zero();  // in pixels
  double scale = 1;            // pixels per unit
  /// Pixel x, pixel y, depth: larger is nearer.
  Vec3 project(const Vec3& p) const {
    const Vec3 q = scale * (axes * (p - center));
    return {middle.x() + q.x(), middle.y() - q.y(), q.z()};
  }
};

/// Looks at points from an azimuth around the y-axis (0: from +z, 90: from +x) and an elevation, in
/// degrees, so that they fill a part of the canvas.
View look_at(const ism::Points3& points, double azimuth, double elevation, const Rect& panel);
/// The same with given axes: the rows point right, up and towards the viewer.
View look_along(const ism::Points3& points, const Eigen::Matrix3d& axes, const Rect& panel);

/// A triangle mesh to be drawn. Colours: those of corners, else the texture, else one for all.
struct Shape {
  ism::Points3 vertices;
  ism::Triangles triangles;
  Eigen::MatrixXd corner_colors;  // 3#F×3, row 3 f + k is corner k of face f; or no rows
  Eigen::MatrixXd corner_uv;      // 3#F×2, v upwards; or no rows
  const Image* texture = nullptr;
  Color color = {0.82f, 0.83f, 0.86f};
  bool is_shaded = true;           // by a light from the viewer's upper left
  Eigen::MatrixXd corner_normals;  // 3#F×3, any length; or no rows: means over the triangles around
};

inline Shape shape_of(const ism::TriangleMesh& mesh) {
  Shape shape;
  shape.vertices = mesh.vertices;
  shape.triangles = mesh.triangles;
  return shape;
}

/// From white over orange to a dark red, t in [0, 1]: of distortion, white is none.
Color heat(double t);

/// Squares of two greys with a hue that changes over the texture, so that places can be told.
Image checker_texture(int squares, int size);

/// Normals of the vertices, of any length: weighted by the areas of their triangles.
ism::Points3 smooth_normals(const ism::Points3& vertices, const ism::Triangles& triangles);

class Canvas {
 public:
  Canvas(int width, int height, const Color& background = {1, 1, 1});

  /// `lift` brings it that many pixels nearer: of two coinciding surfaces, the one that is seen.
  void draw(const View& view, const Shape& shape, double lift = 0);
  /// Lines on or near a surface; they are drawn over what is less than `lift` pixels in front.
  void draw_line(const View& view, const std::vector<Vec3>& points, double width,
                 const Color& color, double lift = 2);
  void draw_ball(const View& view, const Vec3& point, double radius, const Color& color,
                 double lift = 2);

  /// On top of everything, in pixels.
  void line(const std::vector<Vec2>& points, double width, const Color& color);
  void fill(const Rect& rect, const Color& color);
  /// Text with its base line at y; `size` is the height of capitals. Glyphs are ASCII.
  void text(const Vec2& at, double size, const std::string& words,
            const Color& color = {0.1f, 0.1f, 0.1f});
  /// A bar of colours from `low` to `high` with their values and a title.
  void legend(const Rect& rect, Color (*map)(double), const std::string& low,
              const std::string& high, const std::string& title);

  static constexpr int kSamples = 3;  // per pixel and direction
  /// The picture; with more samples per pixel and direction it is that much smaller.
  Image image(int samples = kSamples) const;

 private:
  template <class Paint>
  void triangle(const std::array<Vec3, 3>& corner, const Paint& paint);
  void segment(const Vec3& p, const Vec3& q, double width, const Color& color);
  void disk(const Vec3& center, double radius, const Color& color);
  void set(int x, int y, float depth, const Color& color);

  Image samples_;
  std::vector<float> depth_;
};

inline double text_width(double size, const std::string& words) {
  return size * static_cast<double>(words.size());
}

/// The bytes of a PNG file.
std::string png_text(const Image& image);

struct ImageResult {
  std::string error;  // empty if there is an image
  Image image;
};
/// Reads the bytes of a PNG file (grey, colours or a palette, 8 or 16 bits, not interlaced; opacity
/// is ignored; needs zlib) or of a binary PPM file (P6, 8 bits).
ImageResult read_image(const std::string& bytes);

/// Polygons as triangles, fanned out, and for every triangle the polygon it comes from.
struct Fans {
  ism::Triangles triangles;
  std::vector<int> polygon;
  Eigen::MatrixXi corner;  // #F×3, rows of what is given per corner of the polygons
  /// What is given per corner of the polygons, per corner of the triangles, as Shape wants it.
  Eigen::MatrixXd at_corners(const Eigen::MatrixXd& values) const {
    Eigen::MatrixXd result(corner.size(), values.cols());
    for (Eigen::Index c = 0; c < result.rows(); ++c)
      result.row(c) = values.row(corner(c / 3, c % 3));
    return result;
  }
};
Fans fan_out(const std::vector<int>& offsets, const std::vector<int>& corners);

}  // namespace render

#endif  // ISM_EXAMPLES_RENDER_HPP

#if defined(RENDER_IMPLEMENTATION) && !defined(ISM_EXAMPLES_RENDER_IMPLEMENTED)
#define ISM_EXAMPLES_RENDER_IMPLEMENTED

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>

#ifdef RENDER_ZLIB
#include <zlib.h>
#endif

namespace render {

// ==== [1] VIEWS AND COLOURS ======================================================================

View look_along(const ism::Points3& points, const Eigen::Matrix3d& axes, const Rect& panel) {
  constexpr double kMargin = 0.96;
  View view;
  view.axes = axes;
  Vec3 lo = Vec3::Constant(std::numeric_limits<double>::infinity()), hi = -lo;
  for (Eigen::Index i = 0; i < points.rows(); ++i) {
    const Vec3 q = axes * points.row(i).transpose();
    lo = lo.cwiseMin(q);
    hi = hi.cwiseMax(q);
  }
  const Vec3 size = (hi - lo).cwiseMax(1e-12 * (hi - lo).maxCoeff());
  view.center = axes.transpose() * (0.5 * (lo + hi));
  view.scale = kMargin * std::min(panel.width / size.x(), panel.height / size.y());
  view.middle = {panel.x + 0.5 * panel.width, panel.y + 0.5 * panel.height};
  return view;
}

View look_at(const ism::Points3& points, double azimuth, double elevation, const Rect& panel) {
  constexpr double kDegree = 3.14159265358979323846 / 180;
  const Eigen::AngleAxisd tilt(elevation * kDegree, Vec3::UnitX());
  const Eigen::AngleAxisd turn(-azimuth * kDegree, Vec3::UnitY());
  return look_along(points, (tilt * turn).toRotationMatrix(), panel);
}

/// Between colours at equal distances.
template <std::size_t N>
Color interpolate(const std::array<Color, N>& colors, double t) {
  const double at = std::min(std::max(t, 0.0), 1.0) * (N - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(at), N - 2);
  const float u = static_cast<float>(at - static_cast<double>(i));
  return (1 - u) * colors[i] + u * colors[i + 1];
}

Color heat(double t) {
  return interpolate<6>(
      {Color(1, 1, 1), Color(1, 0.93f, 0.70f), Color(1, 0.75f, 0.35f), Color(0.93f, 0.42f, 0.15f),
       Color(0.72f, 0.12f, 0.10f), Color(0.33f, 0.02f, 0.08f)},
      t);
}

Image checker_texture(int squares, int size) {
  Image image(size, size, {1, 1, 1});
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) {
      const int i = x * squares / size, j = y * squares / size;
      const float u = static_cast<float>(x) / static_cast<float>(size);
      const float v = static_cast<float>(y) / static_cast<float>(size);
      const Color hue(0.35f + 0.6f * u, 0.75f - 0.45f * u * v, 0.9f - 0.65f * v);
      image.at(x, y) = (i + j) % 2 == 0 ? Color(0.35f * hue + 0.65f) : hue;
    }
  return image;
}

/// A texture at u, v, repeated beyond [0, 1], between its four nearest pixels.
inline Color sample(const Image& texture, double u, double v) {
  const double x = (u - std::floor(u)) * texture.width - 0.5;
  const double y = (1 - (v - std::floor(v))) * texture.height - 0.5;
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  const float s = static_cast<float>(x - i), t = static_cast<float>(y - j);
  const auto pixel = [&](int a, int b) {
    return texture.at((a + texture.width) % texture.width, (b + texture.height) % texture.height);
  };
  return (1 - t) * ((1 - s) * pixel(i, j) + s * pixel(i + 1, j)) +
         t * ((1 - s) * pixel(i, j + 1) + s * pixel(i + 1, j + 1));
}

Fans fan_out(const std::vector<int>& offsets, const std::vector<int>& corners) {
  const Eigen::Index polygons = static_cast<Eigen::Index>(offsets.size()) - 1;
  const Eigen::Index n = static_cast<Eigen::Index>(corners.size()) - 2 * polygons;
  Fans fans;
  fans.triangles.resize(n, 3);
  fans.corner.resize(n, 3);
  Eigen::Index f = 0;
  for (int p = 0; p < polygons; ++p) {
    const int first = offsets[static_cast<std::size_t>(p)];
    for (int c = first + 1; c + 1 < offsets[static_cast<std::size_t>(p) + 1]; ++c, ++f) {
      fans.corner.row(f) << first, c, c + 1;
      for (int k = 0; k < 3; ++k)
        fans.triangles(f, k) = corners[static_cast<std::size_t>(fans.corner(f, k))];
      fans.polygon.push_back(p);
    }
  }
  return fans;
}

// ==== [2] CANVAS =================================================================================

Canvas::Canvas(int width, int height, const Color& background)
    : samples_(kSamples * width, kSamples * height, background),
      depth_(samples_.pixels.size(), -std::numeric_limits<float>::infinity()) {}

void Canvas::set(int x, int y, float depth, const Color& color) {
  if (x < 0 || y < 0 || x >= samples_.width || y >= samples_.height) return;
  float& old = depth_[static_cast<std::size_t>(y) * static_cast<std::size_t>(samples_.width) +
                      static_cast<std::size_t>(x)];
  if (depth < old) return;
  old = depth;
  samples_.at(x, y) = color;
}

/// paint(weights) is the colour at barycentric coordinates. Corners are given in pixels.
template <class Paint>
void Canvas::triangle(const std::array<Vec3, 3>& corner, const Paint& paint) {
  std::array<Vec2, 3> p;
  Vec2 lo(1e9, 1e9), hi(-1e9, -1e9);
  for (std::size_t k = 0; k < 3; ++k) {
    p[k] = kSamples * corner[k].head<2>() - Vec2(0.5, 0.5);
    lo = lo.cwiseMin(p[k]);
    hi = hi.cwiseMax(p[k]);
  }
  const auto cross = [](const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); };
  const double area = cross(p[1] - p[0], p[2] - p[0]);
  if (area == 0 || !std::isfinite(area)) return;
  const int x0 = std::max(0, static_cast<int>(std::ceil(lo.x())));
  const int y0 = std::max(0, static_cast<int>(std::ceil(lo.y())));
  const int x1 = std::min(samples_.width - 1, static_cast<int>(std::floor(hi.x())));
  const int y1 = std::min(samples_.height - 1, static_cast<int>(std::floor(hi.y())));
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x) {
      const Vec2 q(x, y);
      const double u = cross(p[1] - q, p[2] - q) / area, v = cross(p[2] - q, p[0] - q) / area;
      const Vec3 weights(u, v, 1 - u - v);
      if (weights.minCoeff() < -1e-9) continue;  // rounding must not leave gaps at common edges
      const double depth = u * corner[0].z() + v * corner[1].z() + (1 - u - v) * corner[2].z();
      set(x, y, static_cast<float>(depth), paint(weights));
    }
}

ism::Points3 smooth_normals(const ism::Points3& vertices, const ism::Triangles& triangles) {
  ism::Points3 normals = ism::Points3::Zero(vertices.rows(), 3);
  for (Eigen::Index f = 0; f < triangles.rows(); ++f) {
    const Vec3 a = vertices.row(triangles(f, 0)), b = vertices.row(triangles(f, 1));
    const Vec3 c = vertices.row(triangles(f, 2));
    const Vec3 normal = (b - a).cross(c - a);
    for (int k = 0; k < 3; ++k) normals.row(triangles(f, k)) += normal.transpose();
  }
  return normals;
}

void Canvas::draw(const View& view, const Shape& shape, double lift) {
  const ism::Points3 normals = smooth_normals(shape.vertices, shape.triangles);
  const Vec3 light = Vec3(-0.35, 0.45, 0.85).normalized();
  for (Eigen::Index f = 0; f < shape.triangles.rows(); ++f) {
    std::array<Vec3, 3> corner, normal;
    std::array<Color, 3> color;
    std::array<Vec2, 3> uv;
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Index c = 3 * f + static_cast<Eigen::Index>(k);
      const int v = shape.triangles(f, static_cast<Eigen::Index>(k));
      corner[k] = view.project(shape.vertices.row(v).transpose()) + Vec3(0, 0, lift);
      normal[k] = view.axes * (shape.corner_normals.rows() > 0
                                   ? Vec3(shape.corner_normals.row(c).transpose())
                                   : Vec3(normals.row(v).transpose()));
      color[k] = shape.color;
      if (shape.corner_colors.rows() > 0)
        color[k] = shape.corner_colors.row(c).transpose().array().cast<float>();
      if (shape.texture != nullptr) uv[k] = shape.corner_uv.row(c).transpose();
    }
    triangle(corner, [&](const Vec3& w) -> Color {
      const float a = static_cast<float>(w[0]), b = static_cast<float>(w[1]);
      Color result = a * color[0] + b * color[1] + (1 - a - b) * color[2];
      if (shape.texture != nullptr) {
        const Vec2 at = w[0] * uv[0] + w[1] * uv[1] + w[2] * uv[2];
        result = sample(*shape.texture, at.x(), at.y());
      }
      if (!shape.is_shaded) return result;
      const Vec3 n = (w[0] * normal[0] + w[1] * normal[1] + w[2] * normal[2]).normalized();
      const bool is_back = n.z() < 0;
      const double diffuse = std::max(0.0, (is_back ? Vec3(-n) : n).dot(light));
      const float shade = static_cast<float>((is_back ? 0.6 : 1.0) * (0.42 + 0.62 * diffuse));
      return (shade * result).min(1.0f);
    });
  }
}

/// A thick segment with round ends, in pixels.
void Canvas::segment(const Vec3& p, const Vec3& q, double width, const Color& color) {
  const Vec2 along = (q - p).head<2>();
  disk(p, 0.5 * width, color);
  disk(q, 0.5 * width, color);
  if (along.norm() == 0) return;
  const Vec2 side = 0.5 * width * Vec2(-along.y(), along.x()).normalized();
  const Vec3 s(side.x(), side.y(), 0);
  const auto paint = [&](const Vec3&) { return color; };
  triangle({p - s, q - s, q + s}, paint);
  triangle({p - s, q + s, p + s}, paint);
}

void Canvas::disk(const Vec3& center, double radius, const Color& color) {
  const double r = kSamples * radius;
  const Vec2 c = kSamples * center.head<2>() - Vec2(0.5, 0.5);
  for (int y = static_cast<int>(std::floor(c.y() - r)); y <= c.y() + r; ++y)
    for (int x = static_cast<int>(std::floor(c.x() - r)); x <= c.x() + r; ++x)
      if ((Vec2(x, y) - c).squaredNorm() <= r * r) set(x, y, static_cast<float>(center.z()), color);
}

void Canvas::draw_line(const View& view, const std::vector<Vec3>& points, double width,
                       const Color& color, double lift) {
  const Vec3 up(0, 0, lift);
  for (std::size_t i = 0; i + 1 < points.size(); ++i)
    segment(view.project(points[i]) + up, view.project(points[i + 1]) + up, width, color);
}

void Canvas::draw_ball(const View& view, const Vec3& point, double radius, const Color& color,
                       double lift) {
  const Vec3 center = view.project(point) + Vec3(0, 0, lift);
  disk(center, radius, 0.35f * color);
  disk(center, 0.78 * radius, color);
}

constexpr double kOnTop = 1e30;  // depth of what is drawn over everything

void Canvas::line(const std::vector<Vec2>& points, double width, const Color& color) {
  for (std::size_t i = 0; i + 1 < points.size(); ++i)
    segment({points[i].x(), points[i].y(), kOnTop}, {points[i + 1].x(), points[i + 1].y(), kOnTop},
            width, color);
}

void Canvas::fill(const Rect& r, const Color& color) {
  const std::array<Vec3, 4> corner = {{{r.x, r.y, kOnTop},
                                       {r.x + r.width, r.y, kOnTop},
                                       {r.x + r.width, r.y + r.height, kOnTop},
                                       {r.x, r.y + r.height, kOnTop}}};
  const auto paint = [&](const Vec3&) { return color; };
  triangle({corner[0], corner[1], corner[2]}, paint);
  triangle({corner[0], corner[2], corner[3]}, paint);
}

void Canvas::legend(const Rect& r, Color (*map)(double), const std::string& low,
                    const std::string& high, const std::string& title) {
  constexpr int kSteps = 64;
  constexpr double kText = 9;
  for (int i = 0; i < kSteps; ++i)
    fill({r.x + r.width * i / kSteps, r.y, r.width / kSteps + 0.5, r.height},
         map((i + 0.5) / kSteps));
  const Color frame(0.4f, 0.4f, 0.4f);
  line({{r.x, r.y},
        {r.x + r.width, r.y},
        {r.x + r.width, r.y + r.height},
        {r.x, r.y + r.height},
        {r.x, r.y}},
       1, frame);
  const double below = r.y + r.height + 1.8 * kText;
  text({r.x, below}, kText, low);
  text({r.x + r.width - text_width(kText, high), below}, kText, high);
  text({r.x + 0.5 * (r.width - text_width(kText, title)), r.y - 0.7 * kText}, kText, title);
}

/// The mean of the samples of every pixel.
Image Canvas::image(int samples) const {
  Image image(samples_.width / samples, samples_.height / samples, {0, 0, 0});
  const float share = 1.0f / static_cast<float>(samples * samples);
  for (int y = 0; y < image.height * samples; ++y)
    for (int x = 0; x < image.width * samples; ++x)
      image.at(x / samples, y / samples) += share * samples_.at(x, y);
  return image;
}

// ==== [3] TEXT ===================================================================================

/// Strokes of a glyph: pairs of a column 0 to 4 and a row a to i, a space lifts the pen. Row c is
/// the base line, row i the height of capitals.
inline const char* glyph(char c) {
  static const char* const kGlyphs[] = {
      "", "2i2e 2c2d", "1i1g 3i3g", "1c1i 3c3i 0e4e 0g4g", "4h1h0g1f3f4e3d0d 2c2i",
      "0c4i 0i1i1h0h0i 3d4d4c3c3d", "4c0g0h1i2h2g0e0d1c2c4e", "2i2g", "3i2h2b3a", "1i2h2b1a",
      "0e4e 1c3g 3c1g", "0e4e 2c2g", "2d1b", "1e3e", "2c2d", "0b4i",
      // digits
      "1c0d0h1i3i4h4d3c1c", "1h2i2c 1c3c", "0h1i3i4h4g0c4c", "0h1i3i4h4g3f4e4d3c1c0d 2f3f",
      "3c3i0e4e", "4i0i0f3f4e4d3c0c", "3i1i0g0d1c3c4d4e3f0f", "0i4i1c",
      "1f0g0h1i3i4h4g3f1f0e0d1c3c4d4e3f", "1c3c4e4h3i1i0h0g1f4f",
      // : to @
      "2c2d 2f2g", "2d1b 2f2g", "4g0e4c", "0d4d 0f4f", "0g4e0c", "0h1i3i4h4g2f2e 2c2d",
      "3e3g1g1e4e4h3i1i0h0d1c4c",
      // capitals
      "0c2i4c 1e3e", "0c0i3i4h4g3f0f 3f4e4d3c0c", "4h3i1i0h0d1c3c4d", "0c0i2i4g4e2c0c",
      "4i0i0c4c 0f3f", "4i0i0c 0f3f", "4h3i1i0h0d1c3c4d4f2f", "0c0i 4c4i 0f4f", "1c3c 2c2i 1i3i",
      "4i4d3c1c0d", "0c0i 4i0f4c", "0i0c4c", "0c0i2f4i4c", "0c0i4c4i", "1c0d0h1i3i4h4d3c1c",
      "0c0i3i4h4g3f0f", "1c0d0h1i3i4h4d3c1c 2e4c", "0c0i3i4h4g3f0f 2f4c",
      "4h3i1i0h0g1f3f4e4d3c1c0d", "0i4i 2i2c", "0i0d1c3c4d4i", "0i2c4i", "0i1c2g3c4i", "0c4i 0i4c",
      "0i2f4i 2f2c", "0i4i0c4c",
      // [ to `
      "3i2i2a3a", "0i4b", "1i2i2a1a", "1g2i3g", "0b4b", "1i2h",
      // small letters
      "1g3g4f4c 4e1e0d1c3c4d", "0i0c3c4d4f3g0g", "4g1g0f0d1c4c", "4i4c1c0d0f1g4g",
      "0e4e4f3g1g0f0d1c4c", "1c1h2i3i 0g3g", "4g1g0f0d1c4c 4g4b3a0a", "0i0c 0f1g3g4f4c",
      "2c2f 2h2h", "2f2b1a0a 2h2h", "0c0i 3g0e4c", "2i2d3c", "0c0g 0f1g2f2c 2f3g4f4c",
      "0c0g 0f1g3g4f4c", "1c0d0f1g3g4f4d3c1c", "0a0g3g4f4d3c0c", "4a4g1g0f0d1c4c", "0c0g 0f1g3g",
      "4g1g0f1e3e4d3c0c", "1i1d2c3c 0g3g", "0g0d1c3c4d 4g4c", "0g2c4g", "0g1c2f3c4g", "0c4g 0g4c",
      "0g2c 4g2c1a0a", "0g4g0c4c",
      // { to ~
      "3i2h2f1e2d2b3a", "2a2i", "1i2h2f3e2d2b1a", "0e1f3d4e"};
  const int id = c - ' ';
  return id >= 0 && id < static_cast<int>(std::size(kGlyphs)) ? kGlyphs[id] : kGlyphs['?' - ' '];
}

void Canvas::text(const Vec2& at, double size, const std::string& words, const Color& color) {
  const double unit = size / 6;  // six rows from the base line to the height of capitals
  double left = at.x();
  for (char c : words) {
    std::vector<Vec2> stroke;
    for (const char* p = glyph(c); *p != '\0'; ++p) {
      if (*p == ' ') {
        line(stroke, 0.16 * size, color);
        stroke.clear();
        continue;
      }
      const int column = *p - '0', row = *++p - 'c';
      stroke.push_back({left + unit * column, at.y() - unit * row});
    }
    line(stroke, 0.16 * size, color);
    left += size;
  }
}

// ==== [4] PNG ====================================================================================

inline void append_big_endian(std::uint32_t x, std::string& bytes) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(x >> shift & 255u);
}

inline std::uint32_t crc32_of(const std::string& bytes) {
  std::uint32_t crc = ~0u;
  for (char c : bytes) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1u ? 0xEDB88320u : 0u);
  }
  return ~crc;
}

inline void append_chunk(const std::string& type_and_data, std::string& png) {
  append_big_endian(static_cast<std::uint32_t>(type_and_data.size() - 4), png);
  png += type_and_data;
  append_big_endian(crc32_of(type_and_data), png);
}

/// A zlib stream [RFC 1950]; without zlib, of stored blocks [RFC 1951, 3.2.4].
inline std::string deflated(const std::string& bytes) {
#ifdef RENDER_ZLIB
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string result(size, '\0');
  compress2(reinterpret_cast<Bytef*>(&result[0]), &size,
            reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uLong>(bytes.size()), 9);
  result.resize(size);
  return result;
#else
  constexpr std::size_t kLargest = 65535;
  std::string result = "\x78\x01";
  for (std::size_t begin = 0; begin < bytes.size(); begin += kLargest) {
    const std::size_t n = std::min(kLargest, bytes.size() - begin);
    result += begin + n == bytes.size() ? '\1' : '\0';
    for (std::size_t x : {n, n ^ kLargest}) {
      result += static_cast<char>(x & 255u);
      result += static_cast<char>(x >> 8);
    }
    result.append(bytes, begin, n);
  }
  std::uint32_t low = 1, high = 0;  // Adler-32
  for (char c : bytes) {
    low = (low + static_cast<unsigned char>(c)) % 65521;
    high = (high + low) % 65521;
  }
  append_big_endian(high << 16 | low, result);
  return result;
#endif
}

std::string png_text(const Image& image) {
  std::string rows;
  for (int y = 0; y < image.height; ++y) {
    std::array<int, 3> before{};
    rows += '\1';  // every byte as the difference to the pixel on the left
    for (int x = 0; x < image.width; ++x)
      for (std::size_t c = 0; c < 3; ++c) {
        const float value = image.at(x, y)[static_cast<Eigen::Index>(c)];
        const int byte = static_cast<int>(std::lround(255 * std::min(std::max(value, 0.f), 1.f)));
        rows += static_cast<char>((byte - before[c]) & 255);
        before[c] = byte;
      }
  }
  std::string header = "IHDR";
  append_big_endian(static_cast<std::uint32_t>(image.width), header);
  append_big_endian(static_cast<std::uint32_t>(image.height), header);
  header.append("\x08\x02\x00\x00\x00", 5);  // 8 bits, RGB
  std::string png = "\x89PNG\r\n\x1A\n";
  append_chunk(header, png);
  append_chunk("IDAT" + deflated(rows), png);
  append_chunk("IEND", png);
  return png;
}

// ==== [5] READING IMAGES =========================================================================

constexpr std::uint32_t kMostPixels = 1u << 25;

inline bool is_size(std::uint32_t width, std::uint32_t height) {
  return width > 0 && height > 0 && width <= kMostPixels / height;
}

inline ImageResult unreadable(const std::string& error) { return {error, {}}; }

inline std::uint32_t byte_at(const std::string& bytes, std::size_t i) {
  return static_cast<unsigned char>(bytes[i]);
}

inline std::uint32_t big_endian_at(const std::string& bytes, std::size_t i) {
  return byte_at(bytes, i) << 24 | byte_at(bytes, i + 1) << 16 | byte_at(bytes, i + 2) << 8 |
         byte_at(bytes, i + 3);
}

inline Color color_at(const std::string& bytes, std::size_t red, std::size_t green,
                      std::size_t blue) {
  const auto level = [&](std::size_t i) { return static_cast<float>(byte_at(bytes, i)) / 255; };
  return {level(red), level(green), level(blue)};
}

#ifdef RENDER_ZLIB
/// What a zlib stream unpacks to, if that is `size` bytes; else an empty string.
inline std::string inflated(const std::string& bytes, std::size_t size) {
  std::string result(size, '\0');
  uLongf n = static_cast<uLongf>(size);
  const int status =
      uncompress(reinterpret_cast<Bytef*>(&result[0]), &n,
                 reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uLong>(bytes.size()));
  return status == Z_OK && n == size ? result : "";
}

/// What the parts of a PNG file say.
struct PngParts {
  std::uint32_t width = 0, height = 0, depth = 0, type = 0, interlace = 0;
  std::string palette, data;
  std::size_t channels() const { return type == 2 ? 3 : type == 4 ? 2 : type == 6 ? 4 : 1; }
};

inline PngParts png_parts(const std::string& bytes) {
  PngParts parts;
  for (std::size_t at = 8; bytes.size() - at >= 12;) {
    const std::size_t n = big_endian_at(bytes, at);
    if (n > bytes.size() - at - 12) break;
    const std::string type = bytes.substr(at + 4, 4), data = bytes.substr(at + 8, n);
    if (type == "IHDR" && n == 13) {
      parts.width = big_endian_at(data, 0);
      parts.height = big_endian_at(data, 4);
      parts.depth = byte_at(data, 8);
      parts.type = byte_at(data, 9);
      parts.interlace = byte_at(data, 12);
    }
    if (type == "PLTE") parts.palette = data;
    if (type == "IDAT") parts.data += data;
    at += n + 12;
  }
  return parts;
}

/// Undoes the filters of the rows [PNG specification, 9], each of which starts with its kind.
inline bool unfilter(std::string& rows, std::size_t stride, std::size_t step) {
  for (std::size_t first = 0; first < rows.size(); first += stride + 1) {
    const std::uint32_t kind = byte_at(rows, first);
    if (kind > 4) return false;
    for (std::size_t i = 1; i <= stride; ++i) {
      const int left = i > step ? static_cast<int>(byte_at(rows, first + i - step)) : 0;
      const int up = first > 0 ? static_cast<int>(byte_at(rows, first + i - stride - 1)) : 0;
      const int corner = first > 0 && i > step
                             ? static_cast<int>(byte_at(rows, first + i - stride - 1 - step))
                             : 0;
      const int to_left = std::abs(up - corner), to_up = std::abs(left - corner);
      const int to_corner = std::abs(left + up - 2 * corner);
      const int paeth = to_left <= to_up && to_left <= to_corner ? left
                        : to_up <= to_corner                     ? up
                                                                 : corner;
      const int predicted[] = {0, left, up, (left + up) / 2, paeth};
      rows[first + i] =
          static_cast<char>((static_cast<int>(byte_at(rows, first + i)) + predicted[kind]) & 255);
    }
  }
  return true;
}

inline ImageResult read_png(const std::string& bytes) {
  const PngParts png = png_parts(bytes);
  if (!is_size(png.width, png.height))
    return unreadable("the PNG file has no size, or is too large");
  const bool is_known = png.type == 0 || png.type == 2 || png.type == 4 || png.type == 6 ||
                        (png.type == 3 && png.depth == 8);
  if (!is_known || (png.depth != 8 && png.depth != 16) || png.interlace != 0)
    return unreadable("only PNG files of 8 or 16 bits that are not interlaced can be read");
  const std::size_t sample = png.depth / 8, step = sample * png.channels();
  const std::size_t stride = step * png.width;
  std::string rows = inflated(png.data, (stride + 1) * png.height);
  if (rows.empty() || !unfilter(rows, stride, step)) return unreadable("the PNG file is damaged");
  Image image(static_cast<int>(png.width), static_cast<int>(png.height), {0, 0, 0});
  for (std::size_t y = 0, pixel = 0; y < png.height; ++y)
    for (std::size_t x = 0; x < png.width; ++x, ++pixel) {
      const std::size_t at = y * (stride + 1) + 1 + x * step;
      const bool is_grey = png.channels() < 3;
      if (png.type == 3) {
        const std::size_t entry = 3 * byte_at(rows, at);
        if (entry + 3 > png.palette.size()) return unreadable("the PNG file is damaged");
        image.pixels[pixel] = color_at(png.palette, entry, entry + 1, entry + 2);
      } else {
        image.pixels[pixel] =
            color_at(rows, at, is_grey ? at : at + sample, is_grey ? at : at + 2 * sample);
      }
    }
  return {"", image};
}
#else
inline ImageResult read_png(const std::string&) {
  return unreadable("this program was built without zlib and cannot read PNG files");
}
#endif

/// The next number of the header of a PPM file, or 0; '#' starts a comment.
inline std::uint32_t ppm_number(const std::string& bytes, std::size_t& at) {
  constexpr std::uint32_t kMost = 1u << 24;
  bool in_comment = false;
  for (; at < bytes.size(); ++at) {
    const bool is_space = bytes[at] == ' ' || (bytes[at] >= '\t' && bytes[at] <= '\r');
    if (!in_comment && !is_space && bytes[at] != '#') break;
    in_comment = in_comment ? bytes[at] != '\n' : bytes[at] == '#';
  }
  std::uint32_t x = 0;
  for (; at < bytes.size() && bytes[at] >= '0' && bytes[at] <= '9' && x < kMost; ++at)
    x = 10 * x + byte_at(bytes, at) - '0';
  return x;
}

inline ImageResult read_ppm(const std::string& bytes) {
  std::size_t at = 2;
  const std::uint32_t width = ppm_number(bytes, at), height = ppm_number(bytes, at);
  const std::uint32_t most = ppm_number(bytes, at);
  ++at;  // one white space
  if (!is_size(width, height)) return unreadable("the PPM file has no size, or is too large");
  if (most != 255) return unreadable("only PPM files of 8 bits can be read");
  if (bytes.size() < at || bytes.size() - at < 3 * std::size_t{width} * height)
    return unreadable("the PPM file ends early");
  Image image(static_cast<int>(width), static_cast<int>(height), {0, 0, 0});
  for (std::size_t i = 0; i < image.pixels.size(); ++i, at += 3)
    image.pixels[i] = color_at(bytes, at, at + 1, at + 2);
  return {"", image};
}

ImageResult read_image(const std::string& bytes) {
  if (bytes.compare(0, 8, "\x89PNG\r\n\x1A\n") == 0) return read_png(bytes);
  if (bytes.compare(0, 2, "P6") == 0) return read_ppm(bytes);
  return unreadable("only PNG and binary PPM images can be read");
}

}  // namespace render

#endif  // RENDER_IMPLEMENTATION

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
// One file of a program defines RENDER_IMPLEMENTATION before it includes this; it needs stb_image.h
// and stb_image_write.h. If that file defines RENDER_ZLIB too, zlib compresses the PNG files,
// better than stb does.

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
  Eigen::MatrixXd corner_uv;      // 3#F×2, v upwards, NaN: there is no texture; or no rows
  const Image* texture = nullptr;
  Color color = {0.82f, 0.83f, 0.86f};
  bool is_shaded = true;           // by a light from the viewer's upper left
  Eigen::MatrixXd corner_normals;  // 3#F×3, any length; or no rows: means over the triangles around
};

/// Normals of the vertices, weighted by the areas of their triangles, not of length 1.
ism::Points3 smooth_normals(const ism::Points3& vertices, const ism::Triangles& triangles);

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
/// Reads the bytes of a PNG, JPEG or binary PPM file (P6, 8 bits); opacity is ignored.
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
#include <iterator>
#include <limits>
#include <memory>
#include <new>

#ifdef RENDER_ZLIB
#include <zlib.h>

#include <cstdlib>

namespace render {

/// Compresses for stb_image_write, which frees the result.
inline unsigned char* deflated(unsigned char* bytes, int size, int* size_deflated, int) {
  uLongf n = compressBound(static_cast<uLong>(size));
  auto* result = static_cast<unsigned char*>(std::malloc(n));
  if (result == nullptr) return nullptr;
  compress2(result, &n, bytes, static_cast<uLong>(size), Z_BEST_COMPRESSION);
  *size_deflated = static_cast<int>(n);
  return result;
}

}  // namespace render

#define STBIW_ZLIB_COMPRESS render::deflated
#endif

#define STBI_ONLY_PNG
#define STBI_ONLY_JPEG
#define STBI_NO_STDIO
#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#include <stb_image.h>
#define STBI_WRITE_NO_STDIO
#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#include <stb_image_write.h>

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
        if (at.allFinite()) result = sample(*shape.texture, at.x(), at.y());
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

// ==== [4] IMAGE FILES ============================================================================

std::string png_text(const Image& image) {
  std::vector<unsigned char> bytes;
  for (const Color& pixel : image.pixels)
    for (int i = 0; i < pixel.size(); ++i)
      bytes.push_back(
          static_cast<unsigned char>(std::lround(255 * std::min(std::max(pixel[i], 0.f), 1.f))));
  std::string png;
  const auto append = [](void* text, void* data, int size) {
    static_cast<std::string*>(text)->append(static_cast<const char*>(data),
                                            static_cast<std::size_t>(size));
  };
  if (stbi_write_png_to_func(append, &png, image.width, image.height, 3, bytes.data(), 0) == 0)
    throw std::bad_alloc();  // nothing else can go wrong
  return png;
}

/// Bytes that are read by stb_image, which takes what follows their end for zeros.
struct Source {
  const std::string& bytes;
  std::size_t at = 0;
  bool ends_early = false;

  static int read(void* source, char* target, int size) {
    Source& s = *static_cast<Source*>(source);
    const std::size_t n = s.bytes.copy(target, static_cast<std::size_t>(size), s.at);
    s.at += n;
    s.ends_early = s.ends_early || n == 0;
    return static_cast<int>(n);
  }
  static void skip(void* source, int size) {
    Source& s = *static_cast<Source*>(source);
    s.at = std::min(s.at + static_cast<std::size_t>(size), s.bytes.size());
  }
  static int is_at_end(void* source) {
    return static_cast<Source*>(source)->at == static_cast<Source*>(source)->bytes.size();
  }
};

inline bool is_size(int width, int height) {
  constexpr int kMostPixels = 1 << 25;
  return width > 0 && height > 0 && width <= kMostPixels / height;
}

inline ImageResult image_of(int width, int height, const unsigned char* levels) {
  Image image(width, height, {0, 0, 0});
  for (Color& pixel : image.pixels)
    for (int i = 0; i < pixel.size(); ++i) pixel[i] = static_cast<float>(*levels++) / 255;
  return {"", image};
}

/// The next number of the header of a PPM file, or 0; '#' starts a comment.
inline int ppm_number(const std::string& bytes, std::size_t& at) {
  constexpr int kMost = 1 << 24;
  bool in_comment = false;
  for (; at < bytes.size(); ++at) {
    const bool is_space = bytes[at] == ' ' || (bytes[at] >= '\t' && bytes[at] <= '\r');
    if (!in_comment && !is_space && bytes[at] != '#') break;
    in_comment = in_comment ? bytes[at] != '\n' : bytes[at] == '#';
  }
  int x = 0;
  for (; at < bytes.size() && bytes[at] >= '0' && bytes[at] <= '9' && x < kMost; ++at)
    x = 10 * x + bytes[at] - '0';
  return x;
}

/// stb_image, up to version 2.27, lets numbers overflow and takes files that end early.
inline ImageResult read_ppm(const std::string& bytes) {
  std::size_t at = 2;
  const int width = ppm_number(bytes, at), height = ppm_number(bytes, at);
  const int most = ppm_number(bytes, at);
  ++at;  // one white space
  if (!is_size(width, height)) return {"the image has no size, or is too large", {}};
  if (most != 255) return {"only PPM files of 8 bits can be read", {}};
  const std::size_t n = 3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (bytes.size() < at || bytes.size() - at < n) return {"the image is damaged", {}};
  return image_of(width, height, reinterpret_cast<const unsigned char*>(bytes.data()) + at);
}

ImageResult read_image(const std::string& bytes) {
  if (bytes.compare(0, 2, "P6") == 0) return read_ppm(bytes);
  const stbi_io_callbacks calls = {Source::read, Source::skip, Source::is_at_end};
  int width = 0, height = 0, channels = 0;
  Source header = {bytes};
  if (stbi_info_from_callbacks(&calls, &header, &width, &height, &channels) == 0)
    return {"only PNG, JPEG and binary PPM images can be read", {}};
  if (!is_size(width, height)) return {"the image has no size, or is too large", {}};
  Source source = {bytes};
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_callbacks(&calls, &source, &width, &height, &channels, 3), stbi_image_free);
  if (pixels == nullptr || source.ends_early) return {"the image is damaged", {}};
  return image_of(width, height, pixels.get());
}

}  // namespace render

#endif  // RENDER_IMPLEMENTATION

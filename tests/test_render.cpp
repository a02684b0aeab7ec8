// The renderer of the examples: what is near covers what is far, images are written and read.

#define RENDER_IMPLEMENTATION
#include "render.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <string>
#include <vector>

namespace {

using render::Canvas;
using render::Color;
using render::Image;
using render::Shape;
using render::Vec2;
using render::Vec3;

/// One triangle over the lower left half of the square [-1, 1]² at height z.
Shape half_square(double z, const Color& color) {
  Shape shape;
  shape.vertices.resize(3, 3);
  shape.vertices << -1, -1, z, 1, -1, z, -1, 1, z;
  shape.triangles.resize(1, 3);
  shape.triangles << 0, 1, 2;
  shape.color = color;
  shape.is_shaded = false;
  return shape;
}

render::View top_view() {
  render::View view;
  view.middle = {10, 10};
  view.scale = 8;
  return view;
}

bool is_color(const Color& c, const Color& wanted) { return (c - wanted).abs().maxCoeff() < 1e-5f; }

/// A picture without two pixels alike.
Image many_colors(int width, int height) {
  Image image(width, height, Color(0, 0, 0));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image.at(x, y) = Color(static_cast<float>(x) / static_cast<float>(width),
                             static_cast<float>(y) / static_cast<float>(height), 0.5f);
  return image;
}

/// A JPEG file of 8×8 pixels of the grey 200 [ITU T.81]. One code of one bit in either table.
std::string grey_jpeg() {
  const std::string one_code = std::string("\1", 1) + std::string(15, '\0');
  return "\xFF\xD8" + std::string("\xFF\xDB\0\x43\0", 5) + std::string(64, '\1') +
         std::string("\xFF\xC0\0\x0B\x08\0\x08\0\x08\1\1\x11\0", 13) +
         std::string("\xFF\xC4\0\x14\0", 5) + one_code + "\x0A" +  // ten more bits tell the mean
         std::string("\xFF\xC4\0\x14\x10", 5) + one_code + std::string("\0", 1) +  // no others
         std::string("\xFF\xDA\0\x08\1\1\0\0\x3F\0", 10) +
         "\x48\x0F"  // 0, 1001000000 for 8 (200 - 128), 0, 1111
         "\xFF\xD9";
}

void check_refused(const std::string& bytes) {
  const render::ImageResult refused = render::read_image(bytes);
  CHECK(!refused.error.empty());
  CHECK(refused.image.pixels.empty());
}

}  // namespace

TEST_CASE("what is near covers what is far, in any order") {
  const Color red(1, 0, 0), blue(0, 0, 1), white(1, 1, 1);
  for (bool red_first : {true, false}) {
    Canvas canvas(20, 20);
    const Shape near = half_square(0.5, red), far = half_square(-0.5, blue);
    canvas.draw(top_view(), red_first ? near : far);
    canvas.draw(top_view(), red_first ? far : near);
    const Image image = canvas.image();
    CHECK(is_color(image.at(6, 14), red));    // lower left
    CHECK(is_color(image.at(15, 5), white));  // upper right
    CHECK(is_color(image.at(0, 0), white));
  }
}

TEST_CASE("more samples per pixel make a smaller picture of the same") {
  Canvas canvas(50, 30, {1, 1, 1});
  canvas.fill({0, 0, 25, 30}, {0, 0, 0});
  const Image image = canvas.image(5);
  REQUIRE(image.width == 30);
  REQUIRE(image.height == 18);
  CHECK(is_color(image.at(14, 9), Color(0, 0, 0)));
  CHECK(is_color(image.at(15, 9), Color(1, 1, 1)));
}

TEST_CASE("corner colours and textures are interpolated") {
  Shape shape = half_square(0, Color(0, 0, 0));
  shape.corner_colors = Eigen::MatrixXd::Identity(3, 3);
  Canvas canvas(20, 20);
  canvas.draw(top_view(), shape);
  const Color c = canvas.image().at(6, 13);  // near the middle of the triangle
  CHECK(c.sum() == doctest::Approx(1).epsilon(1e-4));
  CHECK(c.minCoeff() > 0.15f);
  Image texture(2, 2, Color(0, 0, 0));
  texture.at(0, 0) = Color(1, 0, 0);  // the top left
  CHECK(is_color(render::sample(texture, 0.25, 0.75), Color(1, 0, 0)));
  CHECK(is_color(render::sample(texture, 0.5, 0.75), Color(0.5f, 0, 0)));
  CHECK(is_color(render::sample(texture, 1.25, -0.25), Color(1, 0, 0)));  // repeated
}

TEST_CASE("a view fits the points into its panel") {
  ism::Points3 points(4, 3);
  points << 0, 0, 0, 3, 1, 2, -5, 2, 7, 4, 4, -4;
  for (double azimuth : {0.0, 40.0, 200.0}) {
    const render::View view = render::look_at(points, azimuth, 25, {100, 50, 300, 200});
    for (Eigen::Index i = 0; i < points.rows(); ++i) {
      const Vec3 p = view.project(points.row(i).transpose());
      CHECK(p.x() > 100);
      CHECK(p.x() < 400);
      CHECK(p.y() > 50);
      CHECK(p.y() < 250);
    }
  }
  const render::View front = render::look_at(points, 0, 0, {0, 0, 10, 10});
  CHECK(front.project({0, 1, 0}).y() < front.project({0, 0, 0}).y());  // y is up
  CHECK(front.project({0, 0, 1}).z() > front.project({0, 0, 0}).z());  // z comes to the viewer
}

TEST_CASE("lines and text are drawn, and clipped at the border") {
  Canvas canvas(60, 20);
  canvas.line({{-10, 10}, {70, 10}}, 3, {0, 0, 0});
  CHECK(canvas.image().at(30, 10).maxCoeff() < 0.01f);
  CHECK(canvas.image().at(30, 15).minCoeff() == 1);
  for (char c = ' '; c <= '~'; ++c) {
    Canvas letter(20, 20);
    letter.text({4, 15}, 10, std::string(1, c));
    float ink = 0;
    for (const Color& pixel : letter.image().pixels) ink += 1 - pixel[0];
    CAPTURE(c);
    CHECK((ink > 1) == (c != ' '));
  }
  Canvas other(20, 20);
  other.text({4, 15}, 10, "\xC3\xA9");  // no glyph: a question mark
  other.text({500, 500}, 10, "outside");
}

TEST_CASE("a PNG file holds the pixels of the image") {
  Image image = many_colors(300, 120);
  image.at(299, 119) = Color(2, -1, 0.5f);  // kept within [0, 1]
  const render::ImageResult file = render::read_image(render::png_text(image));
  REQUIRE(file.error.empty());
  REQUIRE(file.image.width == 300);
  REQUIRE(file.image.height == 120);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const Color wanted = (255 * image.pixels[i].max(0.f).min(1.f)).round() / 255;
    if ((file.image.pixels[i] - wanted).abs().maxCoeff() > 1e-6f) FAIL("pixel ", i);
  }
}

TEST_CASE("PNG files are small") {
  Canvas canvas(400, 300);
  canvas.text({20, 150}, 20, "mostly white");
  CHECK(render::png_text(canvas.image()).size() < 12000);  // of 360,000 bytes
}

TEST_CASE("JPEG images are read") {
  const render::ImageResult file = render::read_image(grey_jpeg());
  REQUIRE(file.error.empty());
  REQUIRE(file.image.width == 8);
  REQUIRE(file.image.height == 8);
  for (const Color& pixel : file.image.pixels) CHECK((255 * pixel - 200).abs().maxCoeff() < 1e-3f);
}

TEST_CASE("an image that ends early is refused, wherever it ends") {
  const std::string ppm = "P6\n2 2\n255\nabcdefghijkl";
  for (const std::string& whole : {render::png_text(many_colors(9, 7)), grey_jpeg(), ppm}) {
    CHECK(render::read_image(whole).error.empty());
    for (std::size_t n = 0; n < whole.size(); ++n) check_refused(whole.substr(0, n));
  }
}

TEST_CASE("polygons are fanned out into triangles that know where they come from") {
  const render::Fans fans = render::fan_out({0, 4, 7}, {5, 6, 7, 8, 1, 2, 3});
  ism::Triangles triangles(3, 3);
  triangles << 5, 6, 7, 5, 7, 8, 1, 2, 3;
  CHECK(fans.triangles == triangles);
  CHECK(fans.polygon == std::vector<int>{0, 0, 1});
  Eigen::MatrixXi corner(3, 3);
  corner << 0, 1, 2, 0, 2, 3, 4, 5, 6;
  CHECK(fans.corner == corner);
}

TEST_CASE("PPM images are read, and what is none is refused") {
  const std::string header = "P6 # comment 1 2\n2 1\n255\n";
  const render::ImageResult file = render::read_image(header + std::string("\xFF\0\0\0\0\xFF", 6));
  REQUIRE(file.error.empty());
  REQUIRE(file.image.width == 2);
  REQUIRE(file.image.height == 1);
  CHECK(is_color(file.image.at(0, 0), Color(1, 0, 0)));
  CHECK(is_color(file.image.at(1, 0), Color(0, 0, 1)));
  for (const std::string& bad :
       {std::string("P6\n0 1\n255\n"), std::string("P6 -1 -1 255 123"),
        std::string("P6\n99999999999 99999999\n255\n"), std::string("P6\n9999 9999\n255\n123"),
        std::string("P6\n1 1\n65535\n123456"), std::string("JFIF"), std::string(1000, 'P')})
    check_refused(bad);
}

TEST_CASE("what is given per corner of polygons reaches the corners of their triangles") {
  const render::Fans fans = render::fan_out({0, 4, 7}, {5, 6, 7, 8, 1, 2, 3});
  Eigen::MatrixXd values(7, 1), wanted(9, 1);
  values << 0, 1, 2, 3, 4, 5, 6;
  wanted << 0, 1, 2, 0, 2, 3, 4, 5, 6;
  CHECK(fans.at_corners(values) == wanted);
}

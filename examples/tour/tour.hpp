// tour.hpp: common parts of the ten steps of tour.md: the surfaces, the colours, checked sentences,
// and pictures.

#ifndef ISM_EXAMPLES_TOUR_HPP
#define ISM_EXAMPLES_TOUR_HPP

#include "ism.hpp"
#include "map_picture.hpp"
#include "render.hpp"

#include <string>
#include <vector>

namespace tour {

using picture::format;

// ---- Sentences ----

/// Prints the sentences of a step and whether they hold, and writes its picture.
class Report {
 public:
  Report(int step, std::string folder) : step_(step), folder_(std::move(folder)) {}

  /// A sentence of tour.md, with the numbers of this run, and whether it is true.
  void check(bool holds, const std::string& sentence);
  /// A number of tour.md: within a share of its value there, as builds round differently.
  void check_number(const char* name, double value, double said, double tolerance = 0.05);
  /// Writes step_NN.png.
  void save(const render::Canvas& canvas);
  bool holds() const { return holds_; }

 private:
  int step_;
  std::string folder_;
  bool holds_ = true;
};

// ---- Surfaces ----

struct Pair {
  ism::TriangleMesh a, b;
  std::vector<ism::Landmark> landmarks;
};

/// A pair of data/.
Pair read_pair(const std::string& name);

/// A square sheet A of 2 n² triangles with a hill on the left, and a round sheet B, tessellated in
/// rings, with the same hill on the right; each of area 1.
Pair sheets(int n);

/// Planar positions of a sheet: its heights are dropped.
ism::Points2 seen_from_above(const ism::TriangleMesh& sheet);

// ---- Colours: A and its edges are blue, B and its edges orange ----

const render::Color kBlue(0.10f, 0.36f, 0.72f), kPaleBlue(0.74f, 0.84f, 0.96f);
const render::Color kOrange(0.86f, 0.42f, 0.02f), kPaleOrange(1.00f, 0.86f, 0.70f);
const render::Color kInk(0.12f, 0.12f, 0.12f), kGrey(0.6f, 0.6f, 0.62f), kRed(0.80f, 0.10f, 0.12f);
const render::Color kGreen(0.13f, 0.52f, 0.26f);

// ---- Drawing ----

/// Points of the plane in space, at z = 0.
ism::Points3 in_space(const ism::Points2& points);
ism::Points3 stacked(const ism::Points3& x, const ism::Points3& y);
/// Looks down at a sheet, tilted backwards.
Eigen::Matrix3d from_the_front();

void draw_surface(const render::View& view, const ism::TriangleMesh& mesh,
                  const render::Color& color, render::Canvas& canvas);
/// All edges of triangles whose vertices lie at given points.
void draw_edges(const render::View& view, const ism::Points3& points,
                const ism::Triangles& triangles, double width, const render::Color& color,
                render::Canvas& canvas);
/// The edges of the mesh on one side, carried to the other surface.
void draw_carried_edges(const render::View& view, const ism::SurfaceMap& map, ism::Side from,
                        double width, const render::Color& color, render::Canvas& canvas);
/// From p to q, in pixels.
void draw_arrow(const Eigen::Vector2d& p, const Eigen::Vector2d& q, double width,
                const render::Color& color, render::Canvas& canvas);
/// A dot of some pixels on top of everything.
void draw_dot(const Eigen::Vector2d& p, double radius, const render::Color& color,
              render::Canvas& canvas);

/// A plot in a rectangle: draws its axes, then what is added.
class Plot {
 public:
  Plot(const render::Rect& rect, const Eigen::Vector2d& lo, const Eigen::Vector2d& hi,
       render::Canvas& canvas);
  /// In pixels.
  Eigen::Vector2d at(double x, double y) const;
  void curve(const std::vector<Eigen::Vector2d>& points, const render::Color& color,
             double width = 2);
  void dot(double x, double y, const render::Color& color, double radius = 4);

 private:
  render::Rect rect_;
  Eigen::Vector2d lo_, hi_;
  render::Canvas& canvas_;
};

}  // namespace tour

// The steps.
void step_01(tour::Report& report);
void step_02(tour::Report& report);
void step_03(tour::Report& report);
void step_04(tour::Report& report);
void step_05(tour::Report& report);
void step_06(tour::Report& report);
void step_07(tour::Report& report);
void step_08(tour::Report& report);
void step_09(tour::Report& report);
void step_10(tour::Report& report);

#endif  // ISM_EXAMPLES_TOUR_HPP

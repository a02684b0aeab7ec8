// Fig. 8 of the paper: a single quad is mapped to a finely tessellated surface, two of its corners
// are pinched, and four distortion measures compensate for it in their own ways.
//
// Prints, for the map that each measure finds, the value of all four, and how much of the quad is
// covered. In every column the least value has to stand on the diagonal.

#include "figure.hpp"

#include <Eigen/Geometry>

namespace {

struct Measure {
  const char* name;
  ism::DistortionMeasure measure;
};

/// The quad, its corners pinned; the two at the top are pinched.
ism::Options pinched(const ism::Points2& plane) {
  ism::Options options;
  options.coverage_weight = -2;  // no reward
  options.keep_scale = true;
  options.max_iterations = 500;
  options.tolerance = 1e-5;
  options.pins_a = {0, 1, 2, 3};
  options.initial_f.resize(4, 2);
  options.initial_f << -0.613, -0.604, 0.607, -0.611, -0.217, 0.603, 0.221, 0.609;
  options.initial_g = plane;
  return options;
}

/// The energy of a map under another measure.
double energy(const ism::DistortionMeasure& measure, const figure::Pair& pair, ism::Options options,
              const ism::Result& r) {
  options.measure = measure;
  options.initial_f = r.f;
  options.initial_g = r.g;
  options.max_iterations = 0;
  return figure::optimize(pair, options).initial.map_energy;
}

}  // namespace

int fig08_measures(int argc, char** argv) {
  const figure::Arguments args = figure::read_arguments(argc, argv, {});
  const Measure measures[] = {{"SD", ism::symmetric_dirichlet()},
                              {"ARAP", ism::arap()},
                              {"SARAP", ism::sarap()},
                              {"ASAP", ism::asap()}};
  figure::Pair pair = {"quad", picture::square_grid(1), figure::hill(30), {}, {}};
  pair.a.vertices *= 0.6;
  const std::vector<std::array<int, 2>> sides = {{0, 1}, {1, 3}, {3, 2}, {2, 0}};
  const Eigen::Matrix3d tilted =
      Eigen::AngleAxisd(-0.7, Eigen::Vector3d::UnitX()).toRotationMatrix();
  render::Canvas canvas(1240, 310);
  Eigen::Matrix4d values;  // row: the measure that is optimised, column: the one that is evaluated
  std::string table =
      "optimised     iterations        SD      ARAP     SARAP      ASAP  coverage\n";
  for (int i = 0; i < 4; ++i) {
    ism::Options options = pinched(pair.b.vertices.leftCols<2>());
    options.measure = measures[i].measure;
    const ism::Result r = figure::optimize(pair, options);
    for (int k = 0; k < 4; ++k) values(i, k) = energy(measures[k].measure, pair, options, r);
    table += figure::format("%-12s  %10zu  %8.4f  %8.4f  %8.4f  %8.4f  %8.4f\n", measures[i].name,
                            r.log.size(), values(i, 0), values(i, 1), values(i, 2), values(i, 3),
                            r.final_state().coverage_a);
    const picture::Scene scene =
        picture::scene_of(figure::map_of(r), {Eigen::Matrix3d::Identity(), tilted});
    const render::Rect panel = {10.0 + 310 * i, 40, 290, 230};
    picture::draw_texture(scene, ism::Side::kB, panel, canvas);
    figure::draw_lines(scene.view(ism::Side::kB, panel),
                       figure::carried(scene, ism::Side::kA, sides), 2.5, figure::kBlue, canvas);
    canvas.text({panel.x + 10, 30}, 13, measures[i].name);
    canvas.text({panel.x + 10, 295}, 9, figure::format("energy %.4f", values(i, i)));
  }
  std::fputs(table.c_str(), stdout);
  std::vector<figure::Claim> claims;
  for (int k = 0; k < 4; ++k)
    claims.push_back(
        {std::string("of all four maps, that of ") + measures[k].name + " has the least of it",
         values(k, k) <= values.col(k).minCoeff()});
  return figure::finish(args, canvas, claims);
}

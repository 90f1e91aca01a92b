// Tetrahedra of a material in the steps that are chosen for them, against finite elements.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>

#include "support/finite_element_scenes.h"
#include "support/measured.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {
namespace {

const char* const kData = TISSUE_SIM_TEST_DATA;

Scene of_tetrahedra(Scene scene, int steps) {
  scene.method = Method::kPbd;
  scene.pbd.model = PbdModel::kTetrahedra;
  scene.pbd.steps = steps;
  return scene;
}

/// Of a flat punch's force, 3 mm deep in a cylinder 24 mm high.
double punch_error(double cell_size) {
  Tool punch;
  punch.type = ToolType::kPunch;
  punch.radius = 0.006;
  punch.edge_radius = 0.001;
  punch.length = 0.05;
  punch.friction = 0;
  Simulation simulation(of_tetrahedra(indented_cylinder(cell_size, 0, punch), 0));
  return indentation_force(simulation, 0.003) / reference(kData, "punch", "force_3mm") - 1;
}

/// Of a ball's force, 6 mm deep.
double force_error(double cell_size, int steps, std::string* note = nullptr) {
  Tool ball;
  ball.type = ToolType::kBall;
  ball.radius = 0.01;
  ball.friction = 0;
  Simulation simulation(of_tetrahedra(indented_cylinder(cell_size, 0, ball), steps));
  if (note != nullptr) {
    for (const std::string& n : simulation.tissue().notes()) *note += n;
  }
  return indentation_force(simulation, 0.006) / reference(kData, "ball", "force_6mm") - 1;
}

TEST(PbdSteps, AreAsManyAsABallsForceNeeds) {
  for (const double cell_size : {0.004, 0.0025}) {
    EXPECT_TRUE(is_within("a ball's force, steps by themselves, 4, 2.5 mm",
                          force_error(cell_size, 0), 0.05))
        << cell_size;
  }
}

/// Its rim lies at no vertex: triangles feel it.
TEST(PbdSteps, AreAsManyAsAPunchsForceNeeds) {
  for (const double cell_size : {0.003, 0.0025}) {
    EXPECT_TRUE(
        is_within("a flat punch's force, 3 mm deep, 3, 2.5 mm", punch_error(cell_size), 0.05))
        << cell_size;
  }
}

TEST(PbdSteps, TooFewAreToldWithWhatTheyLose) {
  std::string note;
  const double error = force_error(0.004, 8, &note);
  int steps = 0, less = 0;
  ASSERT_EQ(
      std::sscanf(note.c_str(),
                  "pbd: %d steps a frame are few for tetrahedra so fine and stiff: they press "
                  "back by some %d %% too little",
                  &steps, &less),
      2)
      << note;
  EXPECT_EQ(steps, 8);
  EXPECT_NEAR(less, -100 * error, 8);
  EXPECT_GT(less, 20);
}

/// A bar that is pulled by a hundredth and let go swings as often however many steps a frame has:
/// what a short step moves is not rounded off.
TEST(PbdSteps, ManyLoseNoSmallMotion) {
  const auto frequency = [](int steps) {
    Scene scene = of_tetrahedra(clamped_block(0.008, 0.008), steps);
    scene.frame_rate = 120;
    Simulation simulation(scene);
    const auto top = [&] {
      std::vector<std::uint8_t> cloud;
      const int count = simulation.tissue().read_points({}, cloud);
      double x = 0;
      for (int i = 0; i < count; ++i) {
        Point p;
        std::memcpy(&p, &cloud[i * sizeof(Point)], sizeof p);
        if (p.z > 0.03) x += p.x;
      }
      return x;
    };
    return frequency_of(simulation, 0.003 * Vec3::UnitX(), 2, top);
  };
  const double few = frequency(20);
  EXPECT_GT(few, 5);
  EXPECT_TRUE(is_within("frequency, 300 steps over 20", frequency(300) / few - 1, 0.05));
}

}  // namespace
}  // namespace tissue_sim

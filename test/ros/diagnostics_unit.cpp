#include <gtest/gtest.h>

#include "ros/diagnostics.h"

namespace tissue_sim {
namespace {

TEST(Diagnostics, SaysHowCoarseASceneMustBeToBeFastEnough) {
  Scene scene;
  scene.cell_size = 0.003;
  scene.bodies.resize(1);
  EXPECT_EQ(coarser(scene, 16), "cell_size: 0.006 would do, for 0.003");
  scene.method = Method::kMls;
  EXPECT_EQ(coarser(scene, 16), "cell_size: 0.006 would do, for 0.003");
  scene.mls.spacing = 0.002;
  EXPECT_EQ(coarser(scene, 16), "mls.spacing: 0.004 would do, for 0.002");
  scene.bodies[0].shape = Shape::kMesh;
  scene.bodies[0].mesh = "liver.stl";
  EXPECT_EQ(coarser(scene, 16), "mls.spacing: 0.004 would do, for 0.002");
  scene.bodies[0].mesh = "liver.vtk";  // its vertices are the nodes
  EXPECT_EQ(coarser(scene, 16), "a mesh of 1/8 of the vertices would do");
}

}  // namespace
}  // namespace tissue_sim

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "geometry/mesh.h"
#include "ros/parameters.h"
#include "ros/xmlrpc_yaml.h"

namespace tissue_sim {
namespace {

TEST(XmlRpcYaml, KeepsEveryDigitAndEveryType) {
  XmlRpc::XmlRpcValue body, pose, position, bodies, scene;
  position[0] = 0.1, position[1] = 1.0 / 3, position[2] = 1;
  pose["position"] = position;
  body["shape"] = std::string("ball");
  body["name"] = std::string("1e3 \"quoted\"\n");
  body["radius"] = 0.020000000000000004;
  body["pose"] = pose;
  bodies[0] = body;
  scene["bodies"] = bodies;
  scene["cell_size"] = 0.005;
  XmlRpc::XmlRpcValue ground;
  ground["enabled"] = XmlRpc::XmlRpcValue(false);  // before ROS 1.15, = made it an int
  scene["ground"] = ground;
  scene["seed"] = 7;
  const Scene s = scene_from_yaml(yaml_from(scene));
  EXPECT_EQ(s.bodies.at(0).radius, 0.020000000000000004);
  EXPECT_EQ(s.bodies[0].pose.position, Vec3(0.1, 1.0 / 3, 1));
  EXPECT_EQ(s.bodies[0].name, "1e3 \"quoted\"\n");
  EXPECT_FALSE(s.ground.enabled);
  EXPECT_EQ(s.seed, 7u);
}

TEST(PutMesh, RestsOnTheGroundWhereTheFirstBodyWas) {
  const std::string path = testing::TempDir() + "/tissue_sim_wedge.obj";
  std::ofstream(path) << "v 10 10 10\nv 70 10 10\nv 10 40 10\nv 10 10 50\n"
                         "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  Scene scene = scene_from_yaml(
      "{cell_size: 0.003, ground: {z: 0.2}, bodies: [{name: a, shape: box, material: fat, pose: "
      "{position: [0.5, -0.1, 0.3]}}, {name: b, shape: box, pose: {position: [0, 0, 1]}}]}");
  put_mesh(scene, path, 0.001);
  EXPECT_EQ(scene.bodies[0].shape, Shape::kMesh);
  EXPECT_EQ(scene.bodies[0].material, "fat");
  EXPECT_EQ(scene.bodies[1].shape, Shape::kBox);
  Box box;
  for (const Vec3& x : load_solid(scene.bodies[0], nullptr).vertices) {
    box.min = box.min.cwiseMin(x);
    box.max = box.max.cwiseMax(x);
  }
  EXPECT_NEAR(box.min.z(), 0.2, 1e-9);
  EXPECT_NEAR(box.max.z(), 0.24, 1e-9);
  EXPECT_NEAR(0.5 * (box.min.x() + box.max.x()), 0.5, 1e-9);
  EXPECT_NEAR(0.5 * (box.min.y() + box.max.y()), -0.1, 1e-9);
}

TEST(PutMesh, IsHeldWhereTheFirstBodyWas) {
  const std::string path = testing::TempDir() + "/tissue_sim_tall_wedge.obj";
  std::ofstream(path)
      << "v 0 0 0\nv 60 0 0\nv 0 30 0\nv 0 0 90\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  Scene scene = scene_from_yaml(
      "{cell_size: 0.003, materials: [{name: lump, young_modulus: 9000}], bodies: [{shape: "
      "ellipsoid, radii: [0.03, 0.02, 0.01], pose: {position: [1, 0, 0.01]}, anchors: [{box: {min: "
      "[0.96, -1, 0], max: [0.985, 1, 0.02]}}, {below: 0.002}], inclusions: [{material: lump, "
      "region: {ball: {center: [1, 0.01, 0.005], radius: 0.004}}}]}]}");
  put_mesh(scene, path, 0.001);  // 60 x 30 x 90 mm for 60 x 40 x 20, from (0.97, -0.015, 0) on
  const Body& body = scene.bodies[0];
  EXPECT_NEAR(body.anchors[0].min.x(), 0.96, 1e-9);
  EXPECT_NEAR(body.anchors[0].max.x(), 0.985, 1e-9);
  EXPECT_NEAR(body.anchors[0].max.z(), 0.09, 1e-9);
  EXPECT_NEAR(body.anchors[1].z, 0.009, 1e-9);
  const Region& lump = body.inclusions[0].region;
  EXPECT_NEAR((lump.center - Vec3(1, 0.0075, 0.0225)).norm(), 0, 1e-9);
  EXPECT_NEAR(lump.radius, 0.004 * std::cbrt(0.75 * 4.5), 1e-9);
}

TEST(PutMesh, NeedsNoMeshOfTheFirstBody) {
  const std::string path = testing::TempDir() + "/tissue_sim_own_wedge.obj";
  std::ofstream(path)
      << "v 0 0 0\nv 60 0 0\nv 0 30 0\nv 0 0 90\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  Scene scene = scene_from_yaml("{bodies: [{shape: mesh, mesh: /not/there.stl}]}");
  put_mesh(scene, path, 0.001);
  EXPECT_EQ(scene.bodies[0].mesh, path);
}

TEST(RecordRequest, TrueIsANameByDate) {
  EXPECT_FALSE(record_request("").wanted);
  EXPECT_FALSE(record_request("false").wanted);
  EXPECT_TRUE(record_request("true").wanted);
  EXPECT_EQ(record_request("true").name, "");
  EXPECT_EQ(record_request("run1").name, "run1");
}

}  // namespace
}  // namespace tissue_sim

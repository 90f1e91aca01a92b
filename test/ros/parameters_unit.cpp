#include <gtest/gtest.h>

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

TEST(RecordRequest, TrueIsANameByDate) {
  EXPECT_FALSE(record_request("").wanted);
  EXPECT_FALSE(record_request("false").wanted);
  EXPECT_TRUE(record_request("true").wanted);
  EXPECT_EQ(record_request("true").name, "");
  EXPECT_EQ(record_request("run1").name, "run1");
}

}  // namespace
}  // namespace tissue_sim

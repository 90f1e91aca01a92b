// Tools push tissue alike on a CPU and on a GPU.
#include "support/finite_element_scenes.h"
#include "support/measured.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

class DevicesAgree : public EachMethod {
 protected:
  void SetUp() override {
    if (GetParam().device == Device::kCpu) GTEST_SKIP() << "what a GPU is compared with";
    EachMethod::SetUp();
  }
};
FOR_EACH_METHOD(DevicesAgree);

Tool tool_of(ToolType type, double radius, double edge_radius) {
  Tool t;
  t.name = name_of(type, kToolTypeNames);
  t.type = type;
  t.radius = radius;
  t.edge_radius = edge_radius;
  t.length = 0.05;
  t.size = Vec3(0.02, 0.02, 0.004);
  t.friction = 0;
  return t;
}

// Forces at rest of a ball, a punch, a plate and of a tip that is thinner than a cell, pressed into
// a block that nothing has cut.
TEST_P(DevicesAgree, OnForcesAtRest) {
  for (const Tool& tool :
       {tool_of(ToolType::kBall, 0.01, 0.001), tool_of(ToolType::kPunch, 0.006, 0.001),
        tool_of(ToolType::kPlate, 0.01, 0.001), tool_of(ToolType::kBall, 0.001, 0.001)}) {
    Scene scene = on_this(indented_cylinder(0.003, 0.003, tool));
    Simulation on_gpu(scene);
    scene.device = Device::kCpu;
    Simulation on_cpu(scene);
    const double force = indentation_force(on_cpu, 0.002);
    EXPECT_GT(force, 1e-3) << tool.name;
    EXPECT_TRUE(is_within("ball, punch, plate, thin tip: force, GPU over CPU",
                          indentation_force(on_gpu, 0.002) / force - 1, 1e-4))
        << tool.name << " of " << tool.radius << " m";
  }
}

}  // namespace
}  // namespace tissue_sim

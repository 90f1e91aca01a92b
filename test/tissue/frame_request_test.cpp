// A frame is asked for as a whole: tools that are placed, and requests that make no sense.
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

class AFrameRequest : public EachMethod {
 protected:
  Scene block() const {
    Scene scene;
    scene.cell_size = 0.003;
    scene.gravity = Vec3::Zero();
    scene.damping = 20;
    scene.bodies.resize(1);
    scene.bodies[0].size = Vec3(0.036, 0.036, 0.024);
    scene.bodies[0].pose.position = Vec3(0, 0, 0.012);
    scene.bodies[0].material = "fat";
    scene.tools.resize(1);
    scene.tools[0].radius = 0.006;
    return on_this(scene);
  }
};

const Pose kWithin = {Vec3(0.0002, 0.0003, 0.018),
                      Quat(Eigen::AngleAxisd(M_PI, Vec3::UnitX()))};  // 6 mm deep

TEST_P(AFrameRequest, WhatIsPlacedWithinTissueComesInAlongItsShaft) {
  Simulation simulation(block());
  FrameRequest request;
  request.tools = {ToolRequest{kWithin, 0, true, {}}};
  FrameReport report = simulation.advance_frame(request);
  ASSERT_EQ(report.notes.size(), 1u);
  EXPECT_NE(report.notes[0].find("comes in along its shaft"), std::string::npos);
  const double begin = report.input.tools[0].end.position.z();
  EXPECT_GT(begin, 0.022);
  EXPECT_EQ(report.input.tools[0].begin.position.z(), begin) << "it did not move there";
  EXPECT_EQ(report.result.points_inside, 0);
  simulation.advance_frame();  // it goes on without being asked again
  const std::vector<std::uint8_t> half_way = simulation.save();
  for (int frame = 0; frame < 8; ++frame) report = simulation.advance_frame();
  EXPECT_EQ(report.input.tools[0].end.position.z(), kWithin.position.z());
  EXPECT_TRUE(report.notes.empty());
  EXPECT_GT(report.result.loads[0].mean.force.z(), 0);

  Simulation again(block());
  again.restore({half_way.data(), half_way.size()});
  for (int frame = 0; frame < 8; ++frame) again.advance_frame();
  EXPECT_EQ(again.tissue().checksum(), simulation.tissue().checksum());
}

// Standing there at once it would throw off all that is in it: mls took 136 219 substeps for the
// first frame of a punch of 11.5 mm in skin.
TEST_P(AFrameRequest, WhatFirstStandsDeepWithinTissueComesInLikewise) {
  Simulation simulation(block());
  Pose deep = kWithin;
  deep.position.z() = 0.01;
  simulation.set_tool(0, deep);
  FrameReport report = simulation.advance_frame();
  ASSERT_EQ(report.notes.size(), 1u);
  EXPECT_NE(report.notes[0].find("comes in along its shaft"), std::string::npos);
  EXPECT_GT(report.input.tools[0].end.position.z(), 0.022);
  for (int frame = 0; frame < 12; ++frame) report = simulation.advance_frame();
  EXPECT_EQ(report.input.tools[0].end.position.z(), deep.position.z());
}

TEST_P(AFrameRequest, LeavesTheJawsWhereTheyWereAskedForLast) {
  Scene scene = block();
  scene.tools[0].type = ToolType::kGrasper;
  Simulation simulation(scene);
  FrameRequest request;
  request.tools = {ToolRequest{{Vec3(0, 0, 0.1), kWithin.orientation}, 0.5, false, {}}};
  simulation.advance_frame(request);
  request.tools[0]->jaw.reset();
  EXPECT_FLOAT_EQ(simulation.advance_frame(request).input.tools[0].jaw_end, 0.5f);
  EXPECT_FLOAT_EQ(simulation.advance_frame().input.tools[0].jaw_end, 0.5f);
}

TEST_P(AFrameRequest, IsDoneAsAWholeOrNotAtAll) {
  Simulation simulation(block());
  const std::uint64_t before = simulation.tissue().checksum();
  FrameRequest request;
  request.tools = {ToolRequest{kWithin, 0, true, {}}};
  request.damping = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(simulation.advance_frame(request), std::invalid_argument);
  EXPECT_EQ(simulation.frame(), 0);
  EXPECT_EQ(simulation.tissue().checksum(), before);
  EXPECT_FALSE(simulation.advance_frame().input.tools[0].present);
  request.damping.reset();
  request.tools.resize(2);
  EXPECT_THROW(simulation.advance_frame(request), std::invalid_argument) << "one tool too many";
}

FOR_EACH_METHOD(AFrameRequest);

}  // namespace
}  // namespace tissue_sim

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "ros/conversions.h"

namespace tissue_sim {
namespace {

TEST(Checksum, KeepsAllItsBitsAsText) {
  EXPECT_EQ(to_hex(0x0123456789abcdefu), "0123456789abcdef");
  EXPECT_EQ(to_hex(0), "0000000000000000");
  const std::uint64_t large = (std::uint64_t{1} << 53) + 1;  // that a double rounds
  EXPECT_EQ(std::strtoull(to_hex(large).c_str(), nullptr, 16), large);
}

TEST(Device, HasNoCommaThatWouldShiftColumns) {
  EXPECT_EQ(without_commas("cpu (AVX-512, 2 threads)"), "cpu (AVX-512; 2 threads)");
}

TEST(Inputs, GoToAMessageAndBackWithTheGrip) {
  Scene scene;
  scene.tools.resize(1);
  AppliedInput input;
  input.tools.resize(1);
  input.tools[0].present = true;
  input.grip_pressures = {4321.25};
  input.tools[0].jaw_end = 0.5f;
  const AppliedInput back = from_message(to_message(input, scene));
  ASSERT_EQ(back.grip_pressures.size(), 1u);
  EXPECT_EQ(back.grip_pressures[0], 4321.25);
  EXPECT_EQ(back.tools[0].jaw_end, 0.5f);
}

TEST(Grip, IsForceAreaAndPressure) {
  ToolLoad load;
  load.grip = 0.3;
  load.grip_area = 1e-4;
  load.jaw_moment = 0.002;
  ToolMotion motion;
  motion.jaw_end = 0.2f;
  const JawGrip m = to_message(load, motion, 2000);
  EXPECT_NEAR(m.pressure, 3000, 1e-9);
  EXPECT_EQ(m.pressure_limit, 2000);
  EXPECT_EQ(m.force, 0.3);
  EXPECT_EQ(m.moment, 0.002);
  load.grip_area = 0;
  EXPECT_EQ(to_message(load, motion, 2000).pressure, 0);
}

}  // namespace
}  // namespace tissue_sim

#include <gtest/gtest.h>

#include "ros/remappings.h"

namespace tissue_sim {
namespace {

TEST(Remappings, ThatReachNoToolAreSaidOnce) {
  const std::set<std::string> tools = {"scalpel", "probe"};
  const auto said = useless_remappings("/simulator", tools,
                                       {{"/simulator/nosuch/measured_cp", "/nosuch/measured_cp"},
                                        {"/simulator/nosuch/jaw/measured_js", "/x"},
                                        {"/simulator/probe/measured_cp", "/PSM1/measured_cp"},
                                        {"/simulator/unused/measured_cp", "/unused/measured_cp"},
                                        {"/simulator/state", "/state"},
                                        {"/other/nosuch2/measured_cp", "/y"}});
  ASSERT_EQ(said.size(), 1u);
  EXPECT_NE(said[0].find("'nosuch'"), std::string::npos) << said[0];
  EXPECT_NE(said[0].find("probe, scalpel"), std::string::npos) << said[0];
}

}  // namespace
}  // namespace tissue_sim

// An arm's operating states and kinematic services: where crtk_msgs was found.
#ifdef TISSUE_SIM_HAS_CRTK_MSGS
#include <crtk_msgs/OperatingState.h>
#include <crtk_msgs/QueryForwardKinematics.h>
#include <crtk_msgs/QueryInverseKinematics.h>
#include <crtk_msgs/StringStamped.h>

#include "arm_client.h"

namespace tissue_sim {
namespace {

class CrtkState : public CrtkArm {
 protected:
  CrtkState() : state(kArm + "operating_state"), warning(kArm + "warning") {}
  void command(const std::string& word) {
    crtk_msgs::StringStamped m;
    m.string = word;
    send("state_command", m);
  }
  bool becomes(const std::string& name) {
    return wait_until([&] { return state.last() && state.last()->state == name; }, 3);
  }
  Topic<crtk_msgs::OperatingState> state;
  Topic<crtk_msgs::StringStamped> warning;
};

TEST_F(CrtkState, IsBusyOnEachTick) {
  for (const double yaw : {0.2, 0.2}) {  // the second has no way to go
    const std::size_t before = state.count();
    const ros::Time asked = ros::Time::now();
    send_joints("move_jp", {yaw, 0, 0.12, 0, 0, 0});
    const auto seen = [&](bool busy) {
      const auto all = state.all();
      for (std::size_t i = before; i < all.size(); ++i) {
        if (all[i]->is_busy == busy && all[i]->header.stamp > asked) return true;
      }
      return false;
    };
    EXPECT_TRUE(wait_until([&] { return seen(true); }, 5));
    EXPECT_TRUE(wait_until([&] { return seen(true) && !state.last()->is_busy; }, 5));
    const auto all = state.all();
    const int busy =
        static_cast<int>(std::count_if(all.begin() + static_cast<long>(before), all.end(),
                                       [](const auto& m) { return m->is_busy; }));
    EXPECT_GE(busy, 3);
    // It had arrived before it said that it is idle.
    const ros::Time idle = state.last()->header.stamp;
    ASSERT_TRUE(wait_until([&] { return measured_js.last()->header.stamp >= idle; }, 5));
    const auto joints = measured_js.all();
    const auto began = std::find_if(all.begin() + static_cast<long>(before), all.end(),
                                    [](const auto& m) { return m->is_busy; });
    const auto first = std::find_if(began, all.end(), [](const auto& m) { return !m->is_busy; });
    ASSERT_TRUE(first != all.end());
    const auto before_idle = std::find_if(joints.rbegin(), joints.rend(), [&](const auto& m) {
      return m->header.stamp < (*first)->header.stamp;
    });
    ASSERT_TRUE(before_idle != joints.rend());
    EXPECT_NEAR((*before_idle)->position[0], yaw, 1e-9);
  }
  expect_rising(state);
}

TEST_F(CrtkState, CommandsChangeIt) {
  command("disable");
  EXPECT_TRUE(becomes("DISABLED"));
  EXPECT_TRUE(wait_until([&] { return setpoint_js.last()->header.stamp.isZero(); }));
  EXPECT_TRUE(valid(measured_js));
  const std::size_t refused = warning.count();
  send_joints("move_jp", {0.5, 0, 0.12, 0, 0, 0});
  EXPECT_TRUE(wait_until([&] { return warning.count() > refused; }));
  EXPECT_EQ(warning.last()->string, "move_jp refused: the arm is DISABLED, must be ENABLED");
  EXPECT_TRUE(arrives({0, 0, 0.12, 0, 0, 0}, 0.5));
  command("enable");
  EXPECT_TRUE(becomes("ENABLED"));
  command("unhome");
  EXPECT_TRUE(wait_until([&] { return !state.last()->is_homed; }));
  EXPECT_TRUE(wait_until([&] { return measured_js.last()->header.stamp.isZero(); }));
  command("home");
  EXPECT_TRUE(wait_until([&] { return state.last()->is_homed && valid(setpoint_js); }));
}

TEST_F(CrtkState, KinematicsAreServices) {
  crtk_msgs::QueryForwardKinematics forward;
  forward.request.jp = {0.2, -0.1, 0.14, 0.4, 0.3, -0.2};
  ASSERT_TRUE(ros::service::call(kArm + "forward_kinematics", forward));
  EXPECT_TRUE(forward.response.result);
  crtk_msgs::QueryInverseKinematics inverse;
  inverse.request.cp = forward.response.cp;
  ASSERT_TRUE(ros::service::call(kArm + "inverse_kinematics", inverse));
  EXPECT_LT(distance(inverse.response.jp, forward.request.jp), 1e-9);
  ASSERT_TRUE(ros::service::call(kArm + "local/forward_kinematics", forward));
  EXPECT_NEAR(forward.response.cp.position.z, inverse.request.cp.position.z - 0.17, 1e-12);
  forward.request.jp[2] = 1;
  ASSERT_TRUE(ros::service::call(kArm + "forward_kinematics", forward));
  EXPECT_FALSE(forward.response.result);
  EXPECT_EQ(forward.response.message, "outer_insertion is 1, it goes from 0 to 0.24");
}

}  // namespace
}  // namespace tissue_sim

#endif

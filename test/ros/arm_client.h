// A client of an arm, as those of CRTK and dVRK: the fixture of its tests.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <sensor_msgs/JointState.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "simulator_client.h"

namespace tissue_sim {

using geometry_msgs::PoseStamped;
using geometry_msgs::WrenchStamped;
using sensor_msgs::JointState;
using Values = std::vector<double>;

inline const std::string kArm = "/PSM1/";

class CrtkArm : public testing::Test {
 protected:
  CrtkArm()
      : measured_js(kArm + "measured_js"),
        setpoint_js(kArm + "setpoint_js"),
        measured_cp(kArm + "measured_cp"),
        setpoint_cp(kArm + "setpoint_cp") {}

  void SetUp() override {
    pause(false);
    ASSERT_TRUE(wait_until([&] { return valid(measured_js) && valid(setpoint_cp); }));
    move_jp({0, 0, 0.12, 0, 0, 0});
  }

  template <class M>
  static bool valid(const Topic<M>& topic) {
    const auto m = topic.last();
    return m && !m->header.stamp.isZero();
  }

  // Publishes once there is a listener.
  template <class M>
  void send(const std::string& name, const M& message, int queue = 100) {
    auto& publisher = publishers_[name];
    if (!publisher) {
      publisher = node_.advertise<M>(kArm + name, queue);
      ASSERT_TRUE(wait_until([&] { return publisher.getNumSubscribers() > 0; })) << name;
    }
    publisher.publish(message);
  }
  void send_joints(const std::string& name, const Values& q, const Values& v = {}) {
    JointState m;
    m.position = q;
    m.velocity = v;
    send(name, m);
  }
  void send_pose(const std::string& name, const Pose& pose, const std::string& frame = "") {
    PoseStamped m;  // clients leave stamp and frame empty
    m.header.frame_id = frame;
    m.pose = to_pose(pose);
    send(name, m);
  }

  static double distance(const Values& a, const Values& b) {
    double d = a.size() == b.size() ? 0 : 1e9;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
      d = std::max(d, std::fabs(a[i] - b[i]));
    }
    return d;
  }
  // measured_cp has come as far, too: its topic is another one, and tip() reads it next.
  bool arrives(const Values& q, double seconds = 20) {
    return wait_until(
        [&] {
          const auto joints = measured_js.last();
          return distance(joints->position, q) < 1e-9 && measured_cp.last() &&
                 measured_cp.last()->header.stamp >= joints->header.stamp;
        },
        seconds);
  }
  void move_jp(const Values& q) {
    send_joints("move_jp", q);
    ASSERT_TRUE(arrives(q));
  }
  Pose tip() { return from_message(measured_cp.last()->pose); }

  template <class M>
  static void expect_rising(const Topic<M>& topic) {
    ros::Time last;
    for (const auto& m : topic.all()) {
      if (m->header.stamp.isZero()) continue;
      ASSERT_GT(m->header.stamp, last);
      last = m->header.stamp;
    }
  }

  ros::NodeHandle node_;
  std::map<std::string, ros::Publisher> publishers_;
  Topic<JointState> measured_js, setpoint_js;
  Topic<PoseStamped> measured_cp, setpoint_cp;
};

}  // namespace tissue_sim

// What the node's tests have in common: waiting, services, poses.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tissue_sim/Cut.h>
#include <tissue_sim/Step.h>

#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "ros/conversions.h"
#include "ros/messages.h"

namespace tissue_sim {

/// Until `done` or for `seconds`; callbacks come in other threads.
inline bool wait_until(const std::function<bool()>& done, double seconds = 15) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(seconds);
  while (!done()) {
    if (ros::WallTime::now() > end || !ros::ok()) return false;
    ros::WallDuration(0.005).sleep();
  }
  return true;
}

/// Keeps all that comes on a topic.
template <class M>
class Topic {
 public:
  explicit Topic(const std::string& name, int queue = 10000)
      : subscriber_(node_.subscribe(name, queue, &Topic::on_message, this,
                                    ros::TransportHints().tcpNoDelay())) {}

  std::vector<boost::shared_ptr<const M>> all() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }
  std::size_t count() const { return all().size(); }
  bool connected() const { return subscriber_.getNumPublishers() > 0; }
  /// The next one to come; null if none does.
  boost::shared_ptr<const M> next(double seconds = 15) const {
    const std::size_t before = count();
    if (!wait_until([&] { return count() > before; }, seconds)) return nullptr;
    return all()[before];
  }
  /// The newest; waits for the first. Null if none comes.
  boost::shared_ptr<const M> last(double seconds = 15) const {
    if (!wait_until([&] { return count() > 0; }, seconds)) return nullptr;
    return all().back();
  }

 private:
  void on_message(const boost::shared_ptr<const M>& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    messages_.push_back(message);
  }

  ros::NodeHandle node_;
  mutable std::mutex mutex_;
  std::vector<boost::shared_ptr<const M>> messages_;
  ros::Subscriber subscriber_;
};

template <class Service>
typename Service::Response call(const std::string& name, const typename Service::Request& request) {
  Service service;
  service.request = request;
  EXPECT_TRUE(ros::service::waitForService("/simulator/" + name, ros::Duration(20))) << name;
  // By a link that stays: of one that the server closes after its answer roscpp now and then sees
  // the end before the answer, where many call at once (ros_comm #1976).
  ros::ServiceClient client = ros::NodeHandle().serviceClient<Service>("/simulator/" + name, true);
  EXPECT_TRUE(client.call(service)) << name;
  return service.response;
}

inline std_srvs::Trigger::Response trigger(const std::string& name) {
  return call<std_srvs::Trigger>(name, {});
}

inline std_srvs::SetBool::Response pause(bool paused) {
  std_srvs::SetBool::Request request;
  request.data = paused;
  return call<std_srvs::SetBool>("pause", request);
}

inline Step::Response step(int frames) {
  Step::Request request;
  request.frames = frames;
  return call<Step>("step", request);
}

/// A blade that points down, its edge ahead in +y.
inline Pose blade_pose(double x, double y, double z) {
  Eigen::Matrix3d axes;
  axes.col(0) = Vec3(0, 1, 0);
  axes.col(1) = Vec3(1, 0, 0);
  axes.col(2) = Vec3(0, 0, -1);
  return {Vec3(x, y, z), Quat(axes)};
}

/// The plane x = const through the whole slab, as a service call.
inline Cut::Request plane_cut(double x) {
  Cut::Request request;
  request.edge = {to_point(Vec3(0, 0, 0)), to_point(Vec3(0, 0, -0.04))};
  request.path = {to_pose(blade_pose(x, -0.03, -0.01)), to_pose(blade_pose(x, 0.03, -0.01))};
  return request;
}

/// Sends poses as an arm does, stamped now.
class Arm {
 public:
  explicit Arm(const std::string& tool) {
    publisher_ =
        node_.advertise<geometry_msgs::PoseStamped>("/simulator/" + tool + "/measured_cp", 100);
    EXPECT_TRUE(wait_until([&] { return publisher_.getNumSubscribers() > 0; })) << tool;
  }
  void send(const Pose& pose, const std::string& frame = "",
            const ros::Time& stamp = ros::Time::now()) {
    geometry_msgs::PoseStamped m;
    m.header.stamp = stamp;
    m.header.frame_id = frame;
    m.pose = to_pose(pose);
    publisher_.publish(m);
  }
  /// Moves in a straight line at 100 Hz.
  void sweep(const Pose& from, const Pose& to, double seconds) {
    const int n = static_cast<int>(seconds * 100);
    for (int i = 0; i <= n; ++i) {
      const double f = static_cast<double>(i) / n;
      send({from.position + f * (to.position - from.position), from.orientation});
      ros::WallDuration(0.01).sleep();
    }
  }

 private:
  ros::NodeHandle node_;
  ros::Publisher publisher_;
};

}  // namespace tissue_sim

/// main() of each of the test nodes.
#define TISSUE_SIM_TEST_NODE(name)        \
  int main(int argc, char** argv) {       \
    testing::InitGoogleTest(&argc, argv); \
    ros::init(argc, argv, name);          \
    ros::NodeHandle node;                 \
    ros::AsyncSpinner spinner(2);         \
    spinner.start();                      \
    return RUN_ALL_TESTS();               \
  }

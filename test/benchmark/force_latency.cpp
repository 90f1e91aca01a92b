// How long a pose takes to be felt, and how smooth the force is: against a running simulator.
//
//   rosrun tissue_sim force_latency _tool:=probe _x:=0 _y:=0 _surface:=0.03 _depth:=0.004
//
// A probe rests on tissue and goes 0.1 mm up or down at random moments. From the moment when its
// pose is published to the one when the first wrench of a frame that used it has come: median, 99th
// percentile, most. Before that, the largest step between two wrenches while it rests.
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "ros/conversions.h"
#include "ros/messages.h"
#include "ros/pace.h"

namespace tissue_sim {
namespace {

class ForceLatency {
 public:
  ForceLatency() {
    ros::NodeHandle own("~");
    own.getParam("simulator", simulator_);
    own.getParam("tool", tool_);
    own.getParam("x", x_);
    own.getParam("y", y_);
    own.getParam("surface", surface_);
    own.getParam("depth", depth_);
    own.getParam("trials", trials_);
    const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
    const std::string of_tool = simulator_ + "/" + tool_;
    poses_ = node_.advertise<geometry_msgs::PoseStamped>(of_tool + "/measured_cp", 10);
    inputs_ = node_.subscribe(simulator_ + "/inputs", 1000, &ForceLatency::on_input, this, hints);
    wrenches_ = node_.subscribe(of_tool + "/spatial/measured_cf", 1000, &ForceLatency::on_wrench,
                                this, hints);
    while (ros::ok() && (poses_.getNumSubscribers() == 0 || wrenches_.getNumPublishers() == 0)) {
      ros::WallDuration(0.02).sleep();
    }
  }

  void run() {
    const double rest = surface_ - depth_;
    for (int i = 0; i <= 200 && ros::ok(); ++i) {  // comes down in two seconds
      send(surface_ + 0.01 - (0.01 + depth_) * i / 200);
      ros::WallDuration(0.01).sleep();
    }
    ros::WallDuration(2).sleep();
    smoothness();
    std::mt19937 random(1);
    std::uniform_real_distribution<double> wait(0.05, 0.15);
    std::vector<double> all;
    for (int i = 0; i < trials_ && ros::ok(); ++i) {
      ros::WallDuration(wait(random)).sleep();
      const double z = rest + (i % 2 == 0 ? 1e-4 : 0) + 1e-9 * i;
      const WallTime sent = WallClock::now();
      send(z);
      const WallTime end = sent + std::chrono::seconds(2);
      WallTime felt{};
      while (WallClock::now() < end && felt == WallTime()) {
        ros::WallDuration(0.0005).sleep();
        felt = felt_at(z);
      }
      if (felt != WallTime()) all.push_back(1e3 * (seconds(felt) - seconds(sent)));
    }
    std::sort(all.begin(), all.end());
    if (all.empty()) {
      std::printf("no wrench came\n");
      return;
    }
    std::printf(
        "from a pose to its wrench: median %.2f ms, 99th percentile %.2f ms, most %.2f ms "
        "(%zu poses)\n",
        all[all.size() / 2], all[std::min(all.size() - 1, all.size() * 99 / 100)], all.back(),
        all.size());
  }

 private:
  void send(double z) {
    geometry_msgs::PoseStamped m;
    m.header.stamp = ros::Time::now();
    m.pose = to_pose({Vec3(x_, y_, z), Quat(0, 1, 0, 0)});
    poses_.publish(m);
  }
  void smoothness() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      forces_.clear();
    }
    ros::WallDuration(3).sleep();
    const std::lock_guard<std::mutex> lock(mutex_);
    double mean = 0, step = 0;
    for (const double f : forces_) mean += f / static_cast<double>(forces_.size());
    for (std::size_t i = 1; i < forces_.size(); ++i) {
      step = std::max(step, std::fabs(forces_[i] - forces_[i - 1]));
    }
    std::printf("at rest: %.4f N, largest step %.3f %%, %.0f wrenches a second\n", mean,
                100 * step / mean, static_cast<double>(forces_.size()) / 3);
  }
  // Frames that used it and their wrenches have one stamp.
  WallTime felt_at(double z) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto used = used_.find(z);
    if (used == used_.end()) return {};
    const auto came = came_.find(used->second);
    return came == came_.end() ? WallTime() : came->second;
  }
  void on_input(const FrameInputMessage::ConstPtr& m) {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const InstrumentMotion& tool : m->tools) {
      if (tool.name == tool_ && tool.present) {
        used_.emplace(tool.end.position.z, m->header.stamp);
      }
    }
  }
  void on_wrench(const geometry_msgs::WrenchStamped::ConstPtr& m) {
    const WallTime now = WallClock::now();
    const std::lock_guard<std::mutex> lock(mutex_);
    came_.emplace(m->header.stamp, now);
    if (came_.size() > 4000) came_.erase(came_.begin());
    const geometry_msgs::Vector3& f = m->wrench.force;
    forces_.push_back(Vec3(f.x, f.y, f.z).norm());
  }

  ros::NodeHandle node_;
  std::string simulator_ = "/simulator", tool_ = "probe";
  double x_ = 0, y_ = 0, surface_ = 0.03, depth_ = 0.004;  // [m]
  int trials_ = 300;
  std::mutex mutex_;
  std::map<double, ros::Time> used_;    // by z
  std::map<ros::Time, WallTime> came_;  // by the wrench's stamp
  std::vector<double> forces_;          // [N]
  ros::Publisher poses_;
  ros::Subscriber inputs_, wrenches_;
};

}  // namespace
}  // namespace tissue_sim

int main(int argc, char** argv) {
  ros::init(argc, argv, "force_latency");
  tissue_sim::ForceLatency latency;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  latency.run();
  return 0;
}

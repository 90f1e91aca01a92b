// play_instrument: plays a file of timed poses and jaw angles as an instrument's CRTK topics.
//
// Publishes measured_cp (geometry_msgs/PoseStamped) and jaw/measured_js (sensor_msgs/JointState):
// run it in the instrument's namespace. Parameters: file, rate, loop, frame_id, time, wait.
#include <geometry_msgs/PoseStamped.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>

#include <cmath>
#include <exception>
#include <stdexcept>
#include <string>

#include "ros/conversions.h"
#include "ros/messages.h"
#include "ros/programs.h"
#include "ros/trajectory.h"

namespace tissue_sim {
namespace {

class Player {
 public:
  explicit Player(const ros::NodeHandle& own) {
    std::string file, time = "wall";
    own.getParam("file", file);
    own.getParam("frame_id", frame_);
    own.getParam("rate", rate_);
    own.getParam("loop", loop_);
    own.getParam("time", time);
    own.getParam("wait", wait_);
    if (file.empty()) throw std::invalid_argument("~file is not set: give a file of timed poses");
    if (!(rate_ >= 0.1 && rate_ <= 10000)) {
      throw std::invalid_argument("~rate is " + std::to_string(rate_) +
                                  ": must be a number from 0.1 to 10000 [Hz]");
    }
    if (time != "wall" && time != "simulation") {
      throw std::invalid_argument("~time is " + time + ": must be wall or simulation");
    }
    follows_simulation_ = time == "simulation";
    trajectory_ = load_trajectory(file);
    poses_ = node_.advertise<geometry_msgs::PoseStamped>("measured_cp", 10);
    jaws_ = node_.advertise<sensor_msgs::JointState>("jaw/measured_js", 10);
    name_ = node_.resolveName("measured_cp");
    ROS_INFO("%s: %zu poses over %.1f s from %s", name_.c_str(), trajectory_.size(), length(),
             file.c_str());
  }

  /// Until the trajectory ends or the node is told to.
  void play() {
    const ros::WallTime asked = ros::WallTime::now();
    while (ros::ok() && poses_.getNumSubscribers() == 0) {
      if ((ros::WallTime::now() - asked).toSec() > wait_) {
        ROS_WARN("%s: nobody listened for %.0f s, playing all the same", name_.c_str(), wait_);
        break;
      }
      ros::WallDuration(0.02).sleep();
    }
    if (follows_simulation_) {
      state_ =
          node_.subscribe("state", 10, &Player::on_state, this, ros::TransportHints().tcpNoDelay());
      ros::spin();
      return;
    }
    const ros::SteadyTime start = ros::SteadyTime::now();
    ros::SteadyTime due = start;
    while (ros::ok() && publish((due - start).toSec())) {
      due += ros::WallDuration(1 / rate_);
      const ros::WallDuration left = due - ros::SteadyTime::now();
      if (left.toSec() > 0) left.sleep();
      ros::spinOnce();
    }
  }

 private:
  double length() const { return trajectory_.back().time - trajectory_.front().time; }

  // Where the tool is to be when the next frame ends.
  void on_state(const SimulationState::ConstPtr& state) {
    if (!started_ || state->time < begin_) begin_ = state->time;
    started_ = true;
    if (!publish(state->time + 1 / state->frame_rate - begin_)) ros::shutdown();
  }

  // False when the trajectory has ended: its last pose is then the last that was published.
  bool publish(double time) {
    const bool ended = !loop_ && time >= length();
    if (loop_ && length() > 0) time = std::fmod(time, length());
    const TimedSample sample = sample_at(trajectory_, trajectory_.front().time + time);
    geometry_msgs::PoseStamped pose;
    pose.header.stamp = ros::Time::now();
    pose.header.frame_id = frame_;
    pose.pose = to_pose(sample.pose);
    sensor_msgs::JointState jaw;
    jaw.header = pose.header;
    jaw.name = {"jaw"};
    jaw.position = {sample.jaw};
    jaws_.publish(jaw);
    poses_.publish(pose);
    if (ended) {
      ROS_INFO("%s: done", name_.c_str());
      ros::WallDuration(0.2).sleep();  // what is queued still leaves
      return false;
    }
    ROS_INFO_THROTTLE(1, "%s: %.1f of %.1f s", name_.c_str(), time, length());
    return true;
  }

  ros::NodeHandle node_;
  std::vector<TimedSample> trajectory_;
  std::string name_, frame_;
  double rate_ = 100, wait_ = 30;  // [Hz], [s]
  bool loop_ = false, follows_simulation_ = false, started_ = false;
  double begin_ = 0;  // simulated time of the first pose
  ros::Publisher poses_, jaws_;
  ros::Subscriber state_;
};

}  // namespace

int play_instrument(int argc, char** argv) {
  ros::init(argc, argv, "play_instrument");
  ros::NodeHandle own("~");
  try {
    Player(own).play();
  } catch (const std::exception& e) {
    ROS_FATAL("cannot play: %s", e.what());
    return 1;
  }
  return 0;
}

}  // namespace tissue_sim

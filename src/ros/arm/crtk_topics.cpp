#include "ros/arm/crtk_topics.h"

#ifdef TISSUE_SIM_HAS_CRTK_MSGS
#include <crtk_msgs/OperatingState.h>
#include <crtk_msgs/QueryForwardKinematics.h>
#include <crtk_msgs/QueryInverseKinematics.h>
#include <crtk_msgs/StringStamped.h>

#include "ros/conversions.h"

namespace tissue_sim {

struct CrtkTopics::Topics {
  using Forward = crtk_msgs::QueryForwardKinematics;
  using Inverse = crtk_msgs::QueryInverseKinematics;

  Topics(ros::NodeHandle& node, const Answers& to_give) : answers(to_give) {
    operating_state = node.advertise<crtk_msgs::OperatingState>("operating_state", 100, true);
    info = node.advertise<crtk_msgs::StringStamped>("info", 100, true);
    warning = node.advertise<crtk_msgs::StringStamped>("warning", 100, true);
    state_command = node.subscribe("state_command", 32, &Topics::on_command, this);
    services = {node.advertiseService("forward_kinematics", &Topics::on_forward, this),
                node.advertiseService("local/forward_kinematics", &Topics::on_local, this),
                node.advertiseService("inverse_kinematics", &Topics::on_inverse, this)};
  }

  void on_command(const crtk_msgs::StringStamped& message) {
    answers.state_command(message.string);
  }
  bool forward(Forward::Request& request, Forward::Response& response, bool local) {
    Pose tip;
    response.message = answers.forward(request.jp, local, tip);
    response.result = response.message.empty();
    response.cp = to_pose(tip);
    return true;
  }
  bool on_forward(Forward::Request& request, Forward::Response& response) {
    return forward(request, response, false);
  }
  bool on_local(Forward::Request& request, Forward::Response& response) {
    return forward(request, response, true);
  }
  bool on_inverse(Inverse::Request& request, Inverse::Response& response) {
    response.message = answers.inverse(from_message(request.cp), request.jp, response.jp);
    response.result = response.message.empty();
    return true;
  }

  Answers answers;
  ros::Publisher operating_state, info, warning;
  ros::Subscriber state_command;
  std::vector<ros::ServiceServer> services;
};

namespace {

void publish(const ros::Publisher& publisher, const ros::Time& stamp, const std::string& text) {
  crtk_msgs::StringStamped m;
  m.header.stamp = stamp;
  m.string = text;
  publisher.publish(m);
}

}  // namespace

bool CrtkTopics::available() { return true; }

void CrtkTopics::operating_state(const ros::Time& stamp, const OperatingState& arm, bool busy) {
  crtk_msgs::OperatingState m;
  m.header.stamp = stamp;
  m.state = arm.state;
  m.is_homed = arm.homed;
  m.is_busy = busy;
  topics_->operating_state.publish(m);
}

void CrtkTopics::info(const ros::Time& stamp, const std::string& text) {
  publish(topics_->info, stamp, text);
}

void CrtkTopics::warning(const ros::Time& stamp, const std::string& text) {
  publish(topics_->warning, stamp, text);
}

#else

namespace tissue_sim {

struct CrtkTopics::Topics {
  Topics(ros::NodeHandle&, const Answers&) {}
};

bool CrtkTopics::available() { return false; }

void CrtkTopics::operating_state(const ros::Time&, const OperatingState&, bool) {}
void CrtkTopics::info(const ros::Time&, const std::string&) {}
void CrtkTopics::warning(const ros::Time&, const std::string&) {}

#endif

CrtkTopics::CrtkTopics(ros::NodeHandle& node, const Answers& answers)
    : topics_(std::make_unique<Topics>(node, answers)) {}
CrtkTopics::~CrtkTopics() = default;

}  // namespace tissue_sim

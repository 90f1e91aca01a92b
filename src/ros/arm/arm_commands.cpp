// What clients ask of the arm.
#include <tf2/exceptions.h>

#include "ros/arm/arm_node.h"
#include "ros/conversions.h"
#include "ros/guarded.h"
#include "ros/pose_track.h"
#include "tools/pose_fault.h"

namespace tissue_sim {
namespace {

constexpr double kFastest = 10, kFastestTurn = 100;  // of servo_cv [m/s, rad/s]
constexpr double kTwistAge = 0.2;                    // for which a velocity goes on [s]
constexpr double kRefused = 0.05;  // between refusals of moves, states and ratios that are said [s]

JointVector vector_of(const std::vector<double>& values) {
  return Eigen::Map<const JointVector>(values.data(), static_cast<Eigen::Index>(values.size()));
}

}  // namespace

template <class M, class Callback>
void ArmNode::listen(const std::string& name, int queue, Callback callback) {
  in_.push_back(node_.subscribe<M>(name, queue,
                                   boost::function<void(const boost::shared_ptr<const M>&)>(
                                       [callback, what = "a message on " + node_.resolveName(name)](
                                           const boost::shared_ptr<const M>& message) {
                                         guard(what, [&] { callback(*message); });
                                       }),
                                   ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay()));
}

void ArmNode::subscribe() {
  using sensor_msgs::JointState;
  using PoseStamped = geometry_msgs::PoseStamped;
  const auto joints = [this](const std::string& name, Kind kind, JointGroup& group, bool relative) {
    // The newest setpoint supersedes those that wait; steps and moves are all taken, in their
    // order.
    const int queue = kind == Kind::kServo && !relative ? 1 : 100;
    listen<JointState>(name, queue, [this, name, kind, &group, relative](const JointState& m) {
      on_joints(name, kind, group, m, relative);
    });
  };
  const auto poses = [this](const std::string& name, Kind kind, bool relative) {
    const int queue = kind == Kind::kServo && !relative ? 1 : 100;
    listen<PoseStamped>(name, queue, [this, name, kind, relative](const PoseStamped& m) {
      on_pose(name, kind, m, relative);
    });
  };
  joints("servo_jp", Kind::kServo, arm_, false);
  joints("servo_jr", Kind::kServo, arm_, true);
  joints("move_jp", Kind::kMove, arm_, false);
  joints("move_jr", Kind::kMove, arm_, true);
  joints("jaw/servo_jp", Kind::kServo, jaw_, false);
  joints("jaw/servo_jr", Kind::kServo, jaw_, true);
  joints("jaw/move_jp", Kind::kMove, jaw_, false);
  joints("jaw/move_jr", Kind::kMove, jaw_, true);
  poses("servo_cp", Kind::kServo, false);
  poses("servo_cr", Kind::kServo, true);
  poses("move_cp", Kind::kMove, false);
  poses("move_cr", Kind::kMove, true);
  listen<geometry_msgs::TwistStamped>(
      "servo_cv", 1, [this](const geometry_msgs::TwistStamped& m) { on_twist(m); });

  const char* forces = "this arm has no motors that forces could be asked of: send positions";
  for (const std::string name : {"servo_jf", "jaw/servo_jf"}) {
    listen<JointState>(name, 1, [this, name, forces](const JointState&) {
      refuse(name, forces, Kind::kForce, arm_);
    });
  }
  for (const std::string name : {"servo_cf", "body/servo_cf", "spatial/servo_cf"}) {
    listen<geometry_msgs::WrenchStamped>(name, 1,
                                         [this, name, forces](const geometry_msgs::WrenchStamped&) {
                                           refuse(name, forces, Kind::kForce, arm_);
                                         });
  }
  for (const std::string name : {"hold", "free"}) {
    listen<std_msgs::Empty>(name, 10, [this, name](const std_msgs::Empty&) { stop(name); });
  }
  listen<std_msgs::Float64>("trajectory_j/set_ratio", 10,
                            [this](const std_msgs::Float64& m) { on_ratio(m.data); });
  listen<std_msgs::Bool>("use_gravity_compensation", 10, [this](const std_msgs::Bool&) {
    say("use_gravity_compensation: nothing pulls at this arm, it makes no difference");
  });
  listen<std_msgs::Bool>("body/set_cf_orientation_absolute", 10,
                         [this](const std_msgs::Bool& m) { absolute_ = m.data; });
  listen<std_msgs::Bool>("emulate_tool_present", 10, [this](const std_msgs::Bool& m) {
    tool_present_ = m.data;
    say(m.data ? "the tool is there" : "no tool: it has no pose and moves by its joints alone");
  });
  const std::string tool = parameters_.simulator + "/" + parameters_.tool;
  for (const bool body : {true, false}) {
    listen<geometry_msgs::WrenchStamped>(
        tool + (body ? "/body/measured_cf" : "/spatial/measured_cf"), 10,
        [this, body](const geometry_msgs::WrenchStamped& m) { on_wrench(m, body); });
  }
  listen<JawGrip>(tool + "/grip", 10, [this](const JawGrip& m) {
    grip_angle_ = m.jaw;
    grip_moment_ = m.moment;
    grip_came_ = WallClock::now();
    grip_known_ = true;
  });
}

void ArmNode::refuse(const std::string& name, const std::string& why, Kind kind,
                     JointGroup& group) {
  // Moves are rare, setpoints may come a thousand times a second, and no force is ever taken.
  const double rest = kind == Kind::kForce ? 1e9 : kind == Kind::kMove ? kRefused : 1;
  if (may_say(name, rest)) {
    ROS_WARN("%s refused: %s", name.c_str(), why.c_str());
    crtk_.warning(ros::Time::now(), name + " refused: " + why);
  }
  if (kind == Kind::kMove) group.stay();
}

void ArmNode::ask(const std::string& name, Kind kind, JointGroup& group, const JointVector& goal,
                  const JointVector& velocity) {
  std::string why = not_ready(state_);
  twist_came_ = {};
  if (why.empty()) why = kind == Kind::kServo ? group.servo(goal, velocity) : group.move(goal);
  if (!why.empty()) return refuse(name, why, kind, group);
  if (kind == Kind::kMove) publish_state(busy());
}

void ArmNode::on_joints(const std::string& name, Kind kind, JointGroup& group,
                        const sensor_msgs::JointState& message, bool relative) {
  JointVector goal = vector_of(message.position);
  if (relative && goal.size() == group.goal().size()) {
    goal += kind == Kind::kServo ? group.setpoint() : group.goal();
  }
  ask(name, kind, group, goal, vector_of(message.velocity));
}

std::string ArmNode::world_pose(const geometry_msgs::PoseStamped& message, Pose& pose) const {
  pose = from_message(message.pose);
  const std::string wrong = problem_of(pose, kRounding);
  if (!wrong.empty()) return "the pose " + wrong;
  pose.orientation.normalize();
  const std::string& frame = message.header.frame_id;
  if (frame.empty() || frame == parameters_.world_frame) return "";
  if (frame == parameters_.base_frame) {
    pose = parameters_.base * pose;
    return "";
  }
  try {
    pose = from_message(
               frames_.lookupTransform(parameters_.world_frame, frame, ros::Time(0)).transform) *
           pose;
  } catch (const tf2::TransformException& e) {
    return "tf knows no way from the frame " + frame + " to " + parameters_.world_frame;
  }
  return "";
}

void ArmNode::on_pose(const std::string& name, Kind kind, const geometry_msgs::PoseStamped& message,
                      bool relative) {
  Pose goal;
  std::string why = tool_present_ ? world_pose(message, goal) : "there is no tool";
  const JointVector& from = kind == Kind::kServo ? arm_.setpoint() : arm_.goal();
  if (why.empty() && relative) {
    const std::string& frame = message.header.frame_id;
    if (frame.empty() || frame == parameters_.world_frame) {
      const Pose tip = tip_in_world(from);
      goal = {tip.position + goal.position, goal.orientation * tip.orientation};
    } else {
      why = "a step is given in the axes of " + parameters_.world_frame + ", not of " + frame;
    }
  }
  if (!why.empty()) return refuse(name, why, kind, arm_);
  std::vector<double> joints;
  why = inverse(goal, {from.data(), from.data() + from.size()}, joints);
  if (!why.empty()) return refuse(name, why, kind, arm_);
  ask(name, kind, arm_, vector_of(joints));
}

void ArmNode::on_twist(const geometry_msgs::TwistStamped& message) {
  const auto vector = [](const geometry_msgs::Vector3& v) { return Vec3(v.x, v.y, v.z); };
  const Wrench twist{vector(message.twist.linear), vector(message.twist.angular)};
  const std::string& frame = message.header.frame_id;
  std::string why = not_ready(state_);
  if (why.empty() && !tool_present_) why = "there is no tool";
  if (!(twist.force.norm() <= kFastest && twist.torque.norm() <= kFastestTurn)) {
    why = "its velocities must be finite, and at most 10 m/s and 100 rad/s";
  }
  if (frame == parameters_.base_frame) {
    const Quat& base = parameters_.base.orientation;
    twist_ = {base * twist.force, base * twist.torque};
  } else if (frame.empty() || frame == parameters_.world_frame) {
    twist_ = twist;
  } else {
    why = "a velocity is given in the axes of " + parameters_.world_frame + " or " +
          parameters_.base_frame + ", not of " + frame;
  }
  twist_came_ = why.empty() ? ros::Time::now() : ros::Time();
  if (!why.empty()) refuse("servo_cv", why, Kind::kServo, arm_);
}

// Where servo_cv has the setpoint a tick later. A velocity goes on for a while and then no more:
// who sent it may be gone.
void ArmNode::step_by_twist(const ros::Time& now, double seconds) {
  if (twist_came_.isZero() || now - twist_came_ > ros::Duration(kTwistAge)) return;
  const ros::Time came = twist_came_;
  const Pose tip = tip_in_world(arm_.setpoint());
  const Vec3 turn = twist_.torque * seconds;
  const Quat turned(Eigen::AngleAxisd(
      turn.norm(), turn.norm() > 0 ? Vec3(turn.normalized()) : Vec3::UnitZ().eval()));
  const JointVector& from = arm_.setpoint();
  std::vector<double> joints;
  const std::string why = inverse({tip.position + twist_.force * seconds, turned * tip.orientation},
                                  {from.data(), from.data() + from.size()}, joints);
  if (!why.empty()) return refuse("servo_cv", why, Kind::kServo, arm_);
  const JointVector goal = vector_of(joints);
  ask("servo_cv", Kind::kServo, arm_, goal, (goal - from) / seconds);
  twist_came_ = came;
}

std::string ArmNode::forward(const std::vector<double>& joints, bool local, Pose& tip) const {
  if (joints.size() != kArmJoints) {
    return std::to_string(joints.size()) + " joints came, must be 6";
  }
  const std::string why = outside_limits(arm_.limits().data(), vector_of(joints));
  if (!why.empty()) return why;
  tip = forward_kinematics(parameters_.geometry, vector_of(joints));
  if (!local) tip = parameters_.base * tip;
  return "";
}

// `tip` in the world.
std::string ArmNode::inverse(const Pose& tip, const std::vector<double>& seed,
                             std::vector<double>& joints) const {
  if (!seed.empty() && seed.size() != kArmJoints) {
    return std::to_string(seed.size()) + " joints came, must be 6";
  }
  const std::string wrong = problem_of(tip, kRounding);
  if (!wrong.empty()) return "the pose " + wrong;
  const Quat back = parameters_.base.orientation.inverse();
  const Pose local{back * (tip.position - parameters_.base.position),
                   (back * tip.orientation).normalized()};
  const InverseKinematics solved =
      inverse_kinematics(parameters_.geometry, arm_limits(), local,
                         seed.empty() ? Joints(arm_.setpoint()) : Joints(vector_of(seed)));
  if (!solved.found) return solved.why;
  joints.assign(solved.joints.data(), solved.joints.data() + kArmJoints);
  return "";
}

void ArmNode::on_state_command(const std::string& word) {
  const std::string why = command(state_, word);
  if (!why.empty()) {
    if (may_say("state_command", kRefused)) {
      ROS_WARN("state_command %s refused: %s", word.c_str(), why.c_str());
      crtk_.warning(ros::Time::now(), "state_command " + word + " refused: " + why);
    }
  } else if (!state_.ready()) {
    twist_came_ = {};
    arm_.hold();
    jaw_.hold();
  }
  publish_state(busy());
}

void ArmNode::on_ratio(double ratio) {
  if (!(ratio > 0 && ratio <= 1)) {
    if (!may_say("trajectory_j/set_ratio", kRefused)) return;
    ROS_WARN("trajectory_j/set_ratio refused: %g, must be above 0 and at most 1", ratio);
    crtk_.warning(ros::Time::now(), "trajectory_j/set_ratio refused: must be above 0, at most 1");
    return;
  }
  ratio_ = ratio;
  std_msgs::Float64 m;
  m.data = ratio;
  out_["trajectory_j/ratio"].publish(m);
}

void ArmNode::stop(const std::string& name) {
  twist_came_ = {};
  arm_.hold();
  jaw_.hold();
  if (name == "free") say("free: nothing pulls at this arm, it stays where it is");
  publish_state(busy());
}

}  // namespace tissue_sim

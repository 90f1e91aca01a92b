// Topics and services of an arm whose types are crtk_msgs': where that package was not found when
// this one was built, none of them is there.
#pragma once

#include <ros/node_handle.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "arm/operating_state.h"
#include "tissue_sim/types.h"

namespace tissue_sim {

class CrtkTopics {
 public:
  /// What the arm answers; each returns "" or why not.
  struct Answers {
    std::function<void(const std::string& word)> state_command;
    /// `local`: in the base's frame, else in the world's.
    std::function<std::string(const std::vector<double>& joints, bool local, Pose& tip)> forward;
    std::function<std::string(const Pose& tip, const std::vector<double>& seed,
                              std::vector<double>& joints)>
        inverse;
  };

  CrtkTopics(ros::NodeHandle& node, const Answers& answers);
  ~CrtkTopics();

  /// Whether they are there.
  static bool available();

  void operating_state(const ros::Time& stamp, const OperatingState& arm, bool busy);
  /// On the topics info and warning.
  void info(const ros::Time& stamp, const std::string& text);
  void warning(const ros::Time& stamp, const std::string& text);

 private:
  struct Topics;
  std::unique_ptr<Topics> topics_;
};

}  // namespace tissue_sim

#include "arm/operating_state.h"

namespace tissue_sim {
namespace {

std::string wrong_state(const OperatingState& arm, const std::string& needed) {
  return "the arm is " + arm.state + ", must be " + needed;
}

}  // namespace

std::string command(OperatingState& arm, const std::string& word) {
  if (word == "enable") {
    if (arm.state == "FAULT") return wrong_state(arm, "DISABLED: send clear_fault");
    arm.state = "ENABLED";
  } else if (word == "disable") {
    arm.state = "DISABLED";
  } else if (word == "pause") {
    if (arm.state != "ENABLED" && arm.state != "PAUSED") return wrong_state(arm, "ENABLED");
    arm.state = "PAUSED";
  } else if (word == "resume") {
    if (arm.state != "ENABLED" && arm.state != "PAUSED") return wrong_state(arm, "PAUSED");
    arm.state = "ENABLED";
  } else if (word == "home") {
    if (arm.state != "ENABLED") return wrong_state(arm, "ENABLED");
    arm.homed = true;
  } else if (word == "unhome") {
    arm.homed = false;
  } else if (word == "fault") {
    arm.state = "FAULT";
  } else if (word == "clear_fault") {
    if (arm.state == "FAULT") arm.state = "DISABLED";
  } else {
    return "known are enable, disable, pause, resume, home, unhome, fault and clear_fault";
  }
  return "";
}

std::string not_ready(const OperatingState& arm) {
  if (arm.state != "ENABLED") return wrong_state(arm, "ENABLED");
  return arm.homed ? "" : "the arm is not homed: send home";
}

}  // namespace tissue_sim

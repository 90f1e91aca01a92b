#include "ros/diagnostics.h"

#include <XmlRpcValue.h>
#include <ros/master.h>
#include <ros/this_node.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <string>

#include "ros/guarded.h"
#include "ros/warn_seldom.h"
#include "scene/method_options.h"

namespace tissue_sim {

using diagnostic_msgs::DiagnosticStatus;

namespace {

/// By topic, the type of what is published; empty where no master answers.
std::map<std::string, std::string> published_types() {
  XmlRpc::XmlRpcValue request, response, topics;
  request[0] = ros::this_node::getName();
  request[1] = "";
  std::map<std::string, std::string> types;
  if (!ros::master::execute("getPublishedTopics", request, response, topics, false)) return types;
  for (int i = 0; i < topics.size(); ++i) {
    types[static_cast<std::string>(topics[i][0])] = static_cast<std::string>(topics[i][1]);
  }
  return types;
}

}  // namespace

std::string coarser(const Scene& scene, double slower) {
  // As many points as 1 / spacing^3, as many substeps as 1 / spacing.
  const double wider = std::pow(slower, 0.25);
  const MethodOptions& method = options_of(scene.method);
  char text[80];
  for (const Body& body : scene.bodies) {
    if (body.shape != Shape::kMesh || !method.moves_mesh(body)) continue;
    std::snprintf(text, sizeof text, "a mesh of 1/%.2g of the vertices would do",
                  std::pow(wider, 3));
    return text;
  }
  const Spacing spacing = method.spacing(scene);
  std::snprintf(text, sizeof text, "%s: %.2g would do, for %.2g", spacing.field,
                wider * spacing.value, spacing.value);
  return text;
}

Diagnostics::Diagnostics(ros::NodeHandle& node, const SimulationThread& simulation,
                         const Recorder& recorder)
    : node_(node),
      simulation_(simulation),
      recorder_(recorder),
      updater_(node, node, node.getNamespace()) {
  updater_.setHardwareID("none");
  updater_.add("simulation", this, &Diagnostics::simulation);
  updater_.add("tools", this, &Diagnostics::tools);
  updater_.add("recording", this, &Diagnostics::recording);
  timer_ = node.createWallTimer(ros::WallDuration(1), [this](const ros::WallTimerEvent&) {
    guard("diagnostics", [this] { updater_.force_update(); });
  });
}

void Diagnostics::simulation(Status& status) {
  const RunStatus s = simulation_.status();
  slow_reports_ = s.coarser.empty() ? 0 : slow_reports_ + 1;
  if (s.run.blew_up) {
    status.summary(DiagnosticStatus::ERROR, s.problem);
  } else if (s.run.paused) {
    status.summary(DiagnosticStatus::OK, "paused");
  } else if (s.behind > 0.1) {
    status.summaryf(DiagnosticStatus::WARN,
                    "%.1f s behind /clock: play it slower, or use larger cells", s.behind);
  } else if (!s.coarser.empty()) {
    const std::string slow =
        (s.aimed_factor == 1 ? "slower than real time: " : "slower than time_factor: ") + s.coarser;
    status.summary(DiagnosticStatus::WARN, slow);
    if (slow_reports_ >= 5) WARN_SELDOM(60, "%s", slow.c_str());  // not of a start, or a moment
  } else if (!s.inside.empty()) {
    status.summary(DiagnosticStatus::WARN, s.inside);
  } else {
    status.summary(DiagnosticStatus::OK, "running");
  }
  status.add("real-time factor", s.run.real_time_factor);
  status.add("behind /clock [s]", s.behind);
  status.add("frame", s.frame);
  status.add("simulated time [s]", s.time);
  status.add("frame rate [Hz]", s.frame_rate);
  status.add("substeps per frame", s.substeps);
  status.add("substep [s]", s.substep);
  status.add("time to compute a frame [s]", s.compute_time);
  status.add("particles", s.particles);
  status.add("fragments", s.fragments);
  status.add("device", s.device);
  status.add("messages that could not be used", thrown_in_callbacks().load());
}

void Diagnostics::tools(Status& status) {
  std::uint64_t refused = 0;
  std::string warnings;
  std::optional<std::map<std::string, std::string>> published;
  const std::shared_ptr<ToolInputs> tools = simulation_.tools();
  for (const auto& tool : *tools) {
    ToolStatus s = tool->status();
    // roscpp refuses another type without a word to the one who subscribed.
    if (!s.came && !s.follows_tf && s.publishers == 0) {
      if (!published) published = published_types();
      const auto there = published->find(s.source);
      const std::string type =
          node_.param<std::string>("tools/" + s.tool + "/pose_type", "PoseStamped");
      if (there != published->end() && there->second != "geometry_msgs/" + type) {
        s.wrong_type = there->second;
        WARN_SELDOM(60, "%s", warning(s).c_str());
      }
    }
    const PoseCounts& counts = s.counts;
    const std::string said = warning(s);
    if (!said.empty()) warnings += (warnings.empty() ? "" : "; ") + said;
    refused += counts.all_refused() + counts.jaws_refused;
    status.add(s.tool + ": poses used", counts.accepted);
    status.add(s.tool + ": placed anew", counts.placed);
    for (std::size_t i = 0; i < kRefusalCount; ++i) {
      status.add(s.tool + ": poses refused, " + kRefusals[i], counts.refused[i]);
    }
    status.add(s.tool + ": jaw angles refused", counts.jaws_refused);
    status.add(s.tool + (s.follows_tf ? ": tf frame" : ": topic"), s.source);
    if (!s.follows_tf) status.add(s.tool + ": publishers", s.publishers);
    if (s.came) status.add(s.tool + ": last pose came before [s]", s.silent);
  }
  // Another scene counts anew.
  const std::uint64_t since = refused >= refused_before_ ? refused - refused_before_ : refused;
  refused_before_ = refused;
  if (since > 0) {
    warnings = std::to_string(since) + " poses or jaw angles refused since the last report" +
               (warnings.empty() ? "" : "; ") + warnings;
  }
  if (!warnings.empty()) {
    status.summary(DiagnosticStatus::WARN, warnings);
  } else {
    status.summary(DiagnosticStatus::OK, tools->empty() ? "no tools" : "all poses used");
  }
}

void Diagnostics::recording(Status& status) {
  const RecorderStatus s = recorder_.status();
  std::uint64_t dropped = 0;
  for (const auto& topic : s.dropped) dropped += topic.second;
  if (!s.error.empty()) {
    status.summary(DiagnosticStatus::ERROR, s.error);
  } else if (s.recording && dropped > 0) {
    status.summary(DiagnosticStatus::WARN,
                   "recording, but the disk is too slow: messages are lost");
  } else {
    status.summary(DiagnosticStatus::OK, s.recording ? "recording" : "not recording");
  }
  status.add("bag", s.path);
  status.add("messages written", s.messages);
  status.add("messages lost", dropped);
  for (const auto& topic : s.dropped) status.add("lost of " + topic.first, topic.second);
  status.add("waiting for the disk [MiB]", static_cast<double>(s.queued) / (1024 * 1024));
}

}  // namespace tissue_sim

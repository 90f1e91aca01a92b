#include "ros/replay.h"

#include <rosbag/view.h>
#include <std_msgs/String.h>

#include <cstdio>
#include <set>
#include <stdexcept>

#include "ros/conversions.h"

namespace tissue_sim {
namespace {

template <class M>
boost::shared_ptr<M> read(const rosbag::MessageInstance& m) {
  const boost::shared_ptr<M> message = m.instantiate<M>();
  if (!message) {
    throw std::runtime_error(m.getTopic() + " is a " + m.getDataType() + " with MD5 sum " +
                             m.getMD5Sum() + ", this version's has " +
                             ros::message_traits::MD5Sum<M>::value() +
                             ": run the bag with the version that recorded it");
  }
  return message;
}

std::string joined(const std::set<std::string>& names) {
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  return all;
}

}  // namespace

RecordedTopics recorded_topics(const rosbag::Bag& bag, const std::string& node) {
  rosbag::View view(bag);
  std::set<std::string> names, nodes;
  const std::string suffix = "/inputs";
  for (const rosbag::ConnectionInfo* c : view.getConnections()) {
    names.insert(c->topic);
    if (c->datatype != ros::message_traits::datatype<FrameInputMessage>()) continue;
    const std::size_t end = c->topic.rfind('/');
    if (c->topic.compare(end, std::string::npos, suffix) == 0) {
      nodes.insert(c->topic.substr(0, end));
    }
  }
  if (nodes.empty()) {
    throw std::runtime_error(
        "the bag holds no inputs (tissue_sim/FrameInput), so it was not "
        "recorded by this node's start_recording: it holds " +
        joined(names));
  }
  if (node.empty() && nodes.size() > 1) {
    throw std::runtime_error("the bag holds the inputs of several nodes: say which (node), of " +
                             joined(nodes));
  }
  RecordedTopics topics;
  topics.node = node.empty() ? *nodes.begin() : node;
  if (topics.node.front() != '/') topics.node = "/" + topics.node;
  if (nodes.count(topics.node) == 0) {
    throw std::runtime_error("the bag holds no inputs of " + topics.node + ", but of " +
                             joined(nodes));
  }
  topics.scene = topics.node + "/scene";
  topics.inputs = topics.node + suffix;
  topics.state = topics.node + "/state";
  topics.saved_state = topics.node + "/saved_state";
  if (names.count(topics.scene) == 0) {
    throw std::runtime_error("the bag holds no " + topics.scene +
                             ": without its scene it cannot be run again");
  }
  topics.all.assign(names.begin(), names.end());
  return topics;
}

Replay::Replay(ReplayObserver observer, std::function<void(Scene&)> change)
    : observer_(std::move(observer)), change_(std::move(change)) {}

ReplayReport Replay::run(rosbag::Bag& bag, const RecordedTopics& topics) {
  rosbag::View view(bag, rosbag::TopicQuery(std::vector<std::string>{
                             topics.scene, topics.inputs, topics.state, topics.saved_state}));
  for (const rosbag::MessageInstance& m : view) {
    if (m.getTopic() == topics.scene) {
      scene_text_ = read<std_msgs::String>(m)->data;
    } else if (m.getTopic() == topics.inputs) {
      if (observer_.goes_on && !observer_.goes_on()) break;
      on_input(*read<FrameInputMessage>(m));
    } else if (m.getTopic() == topics.saved_state) {
      on_saved_state(*read<SavedState>(m));
    } else {
      on_state(*read<SimulationState>(m));
    }
  }
  if (report_.frames == 0) {
    throw std::runtime_error(
        report_.left_out > 0
            ? "the bag was begun in the middle of a run and holds no beginning of one: reset after "
              "start_recording, or start the node with record:=true"
            : "the bag holds no frame");
  }
  return report_;
}

void Replay::begin_run(const ros::Time& stamp) {
  if (scene_text_.empty()) {
    throw std::runtime_error(
        "the bag's inputs begin before its scene: it was not recorded by this "
        "node's start_recording");
  }
  Scene scene = scene_from_yaml(scene_text_);
  if (change_) change_(scene);
  simulation_.reset();  // its memory, before the next one's
  simulation_ = std::make_unique<Simulation>(scene);
  ++report_.runs;
  run_ = {};
  pieces_ = {};
  if (observer_.begin) observer_.begin(scene, stamp);
}

void Replay::on_saved_state(const SavedState& saved) {
  begin_run(saved.header.stamp);
  try {
    simulation_->restore({saved.state.data(), saved.state.size()});
  } catch (const std::exception& e) {  // of another device: its frames are left out
    std::fprintf(stderr, "from frame %lld: %s\n", static_cast<long long>(saved.frame), e.what());
    simulation_.reset();
    --report_.runs;
    return;
  }
  if (observer_.restored) observer_.restored(*simulation_, saved.state, saved.header.stamp);
}

void Replay::on_input(const FrameInputMessage& input) {
  if (input.frame == 0) begin_run(input.header.stamp);
  if (!simulation_ || simulation_->frame() != input.frame) {
    if (simulation_) {
      differs(input.frame, "it follows frame " + std::to_string(simulation_->frame() - 1) +
                               ", and those between are missing");
      simulation_.reset();
    }
    ++report_.left_out;
    return;
  }
  const Scene& scene = simulation_->scene();
  for (std::size_t i = 0; i < input.tools.size() && i < scene.tools.size(); ++i) {
    if (input.tools[i].name != scene.tools[i].name) {
      throw std::runtime_error("frame " + std::to_string(input.frame) + " moves tool '" +
                               input.tools[i].name + "', where the scene has '" +
                               scene.tools[i].name + "'");
    }
  }
  frame_ = simulation_->repeat_frame(from_message(input));
  ++report_.frames;
  run_.blew_up = frame_.result.blew_up;
  const std::string text = difference(input, to_message(frame_.input, scene));
  if (!text.empty()) differs(input.frame, text);
  if (observer_.frame) observer_.frame(*simulation_, frame_, run_, input.header.stamp);
}

void Replay::on_state(const SimulationState& recorded) {
  if (!simulation_ || recorded.frame != simulation_->frame()) return;
  report_.recorded_on = recorded.device;
  pieces_.follow(simulation_->tissue());
  const SimulationState state = state_message(*simulation_, frame_, run_, pieces_, true);
  report_.run_on = state.device;
  ++report_.compared;
  report_.checksums += !recorded.checksum.empty();
  const std::string text = difference(recorded, state);
  if (!text.empty()) differs(frame_.input.frame, text);
}

void Replay::differs(std::int64_t frame, const std::string& text) {
  const std::string name =
      "frame " + std::to_string(frame) +
      (report_.runs > 1 ? " of run " + std::to_string(report_.runs) : std::string());
  if (report_.first.empty()) {
    report_.first = name + ": " + text;
  } else if (report_.first.compare(0, name.size() + 1, name + ":") == 0) {
    report_.first += "; " + text;
  }
  const std::int64_t unique = (static_cast<std::int64_t>(report_.runs) << 40) + frame;
  report_.differing += unique != last_differing_;
  last_differing_ = unique;
}

}  // namespace tissue_sim

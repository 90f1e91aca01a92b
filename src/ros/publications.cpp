#include "ros/publications.h"

#include "ros/conversions.h"

namespace tissue_sim {

Publications::Publications(ros::NodeHandle& node, const Scene& scene, const Parameters& parameters,
                           Recorder& recorder, const Frames* frames)
    : scene_(scene),
      parameters_(parameters),
      scene_output_(node, "scene", 1, recorder, true),
      state_(node, "state", 100, recorder),
      inputs_(node, "inputs", 1000, recorder),
      saved_state_(node, "saved_state", 1, recorder),
      fragments_(node, "fragments", 10, recorder),
      points_(node, "tissue/points", 2, recorder),
      loose_points_(node, "fragments/points", 2, recorder),
      surface_(node, "surface", 2, recorder),
      marker_output_(node, "markers", 2, recorder),
      tf_(node, "/tf", 100, recorder),
      state_due_(parameters.state_rate, scene.frame_rate),
      fragments_due_(parameters.fragment_rate, scene.frame_rate),
      clouds_due_(parameters.cloud_rate, scene.frame_rate),
      markers_due_(parameters.marker_rate, scene.frame_rate) {
  auto text = boost::make_shared<std_msgs::String>();
  text->data = scene_to_yaml(scene);
  scene_text_ = text;
  for (const Tool& tool : scene.tools) {
    tools_.push_back({{node, tool.name + "/body/measured_cf", 100, recorder},
                      {node, tool.name + "/spatial/measured_cf", 100, recorder},
                      {}});
    if (has_jaws(tool.type)) {
      tools_.back().grip.emplace(node, tool.name + "/grip", 100, recorder);
    }
  }
  std::size_t number = 0;
  for (const Body& body : scene.bodies) {
    for (const Anchor& anchor : body.anchors) {
      if (!anchor.name.empty()) {
        anchors_.push_back(
            {number, {node, "anchors/" + anchor.name + "/spatial/measured_cf", 100, recorder}});
      }
      ++number;
    }
  }
  if (has_fluid(scene)) fluid_.emplace(node, recorder);
  if (!scene.cameras.empty()) {
    cameras_ = std::make_unique<Cameras>(node, scene, parameters, frames, recorder);
  }
}

std::set<std::string> Publications::topics() const {
  std::set<std::string> names = {
      scene_output_.topic(),  saved_state_.topic(), state_.topic(),        inputs_.topic(),
      fragments_.topic(),     points_.topic(),      loose_points_.topic(), surface_.topic(),
      marker_output_.topic(), tf_.topic()};
  for (const ToolOutputs& tool : tools_) {
    names.insert({tool.body.topic(), tool.spatial.topic()});
    if (tool.grip) names.insert(tool.grip->topic());
  }
  for (const AnchorOutput& anchor : anchors_) names.insert(anchor.spatial.topic());
  if (fluid_) names.merge(fluid_->topics());
  if (cameras_) names.merge(cameras_->topics());
  return names;
}

std_msgs::Header Publications::header(const ros::Time& stamp) const {
  std_msgs::Header h;
  h.stamp = stamp;
  h.frame_id = parameters_.world_frame;
  return h;
}

void Publications::announce(const ros::Time& stamp) {
  pieces_ = {};
  scene_output_.publish(scene_text_, stamp, true);
}

void Publications::record_scene(const ros::Time& stamp) {
  scene_output_.record(scene_text_, stamp);
}

void Publications::record_state(const Simulation& simulation,
                                const std::vector<std::uint8_t>& state, const ros::Time& stamp) {
  auto m = boost::make_shared<SavedState>();
  m->header = header(stamp);
  m->frame = simulation.frame();
  m->state = state;
  saved_state_.record(m, stamp);
}

void Publications::publish(Simulation& simulation, const FrameReport& report, const RunState& run,
                           const FrameTime& time, bool all) {
  const ros::Time& stamp = time.stamp;
  const double now = time.elapsed;
  if (inputs_.wanted()) {
    auto m = boost::make_shared<FrameInputMessage>(to_message(report.input, scene_));
    m->header = header(stamp);
    inputs_.publish(m, stamp, true);
  }
  if (!run.blew_up) publish_loads(report, stamp, true);  // first: hands wait for them
  const bool came_apart = pieces_.follow(simulation.tissue());
  const bool state_due = state_due_.due(now) || all || run.blew_up;
  if (state_due) publish_tf(report, stamp, true);
  if (state_due && state_.wanted()) {
    state_.publish(state(simulation, report, run, stamp), stamp);
  }
  if (run.blew_up) return;  // what follows may hold NaN
  if (cameras_) cameras_->publish(simulation, stamp, now, all);
  const bool fragments_due = fragments_due_.due(now) || all || came_apart;
  if (fragments_due && fragments_.wanted()) {
    fragments_.publish(fragment_message(simulation, stamp), stamp);
  }
  if (fluid_ && fragments_due) fluid_->send_amounts(simulation, header(stamp), true);
  const bool clouds_due = clouds_due_.due(now) || all;
  if (fluid_ && clouds_due) fluid_->send_points(simulation, header(stamp), true);
  if (clouds_due && points_.wanted()) points_.publish(cloud(simulation, false, stamp), stamp);
  if (clouds_due && loose_points_.wanted()) {
    loose_points_.publish(cloud(simulation, true, stamp), stamp);
  }
  if (clouds_due && surface_.wanted()) {
    const bool was_any = !surface_triangles_.fragment.empty();
    const auto message = surface_message(simulation, stamp);
    if (was_any || !surface_triangles_.fragment.empty()) surface_.publish(message, stamp);
  }
  const bool markers_due = markers_due_.due(now) || all;
  if (markers_due && marker_output_.wanted()) {
    marker_output_.publish(marker_message(simulation, report, stamp), stamp);
  }
}

void Publications::hold(const FrameReport& report, const RunState& run, const ros::Time& stamp) {
  publish_tf(report, stamp, false);
  if (!run.blew_up) publish_loads(report, stamp, false);
}

void Publications::show(Simulation& simulation, const FrameReport& report, const RunState& run,
                        const ros::Time& stamp) {
  pieces_.follow(simulation.tissue());
  if (state_.listened()) state_.show(state(simulation, report, run, stamp));
  if (run.blew_up) return;
  if (fragments_.listened()) fragments_.show(fragment_message(simulation, stamp));
  if (fluid_) {
    fluid_->send_amounts(simulation, header(stamp), false);
    fluid_->send_points(simulation, header(stamp), false);
  }
  if (points_.listened()) points_.show(cloud(simulation, false, stamp));
  if (loose_points_.listened()) loose_points_.show(cloud(simulation, true, stamp));
  if (surface_.listened()) surface_.show(surface_message(simulation, stamp));
  if (marker_output_.listened()) marker_output_.show(marker_message(simulation, report, stamp));
}

boost::shared_ptr<const SimulationState> Publications::state(Simulation& simulation,
                                                             const FrameReport& report,
                                                             const RunState& run,
                                                             const ros::Time& stamp) const {
  auto m = boost::make_shared<SimulationState>(
      state_message(simulation, report, run, pieces_, parameters_.checksum));
  m->header = header(stamp);
  return m;
}

boost::shared_ptr<const FragmentArray> Publications::fragment_message(
    Simulation& simulation, const ros::Time& stamp) const {
  auto m = boost::make_shared<FragmentArray>();
  m->header = header(stamp);
  m->frame = simulation.frame();
  m->time = simulation.time();
  for (const Fragment& f : simulation.tissue().fragments()) {
    m->fragments.push_back(to_message(f, scene_));
  }
  return m;
}

boost::shared_ptr<const sensor_msgs::PointCloud2> Publications::cloud(Simulation& simulation,
                                                                      bool loose_only,
                                                                      const ros::Time& stamp) {
  boost::shared_ptr<sensor_msgs::PointCloud2>& m = clouds_[next_cloud_++ % clouds_.size()];
  if (m.use_count() != 1) m = boost::make_shared<sensor_msgs::PointCloud2>();
  m->header = header(stamp);
  PointSelection selection;
  selection.stride = parameters_.cloud_stride;
  selection.surface_only = parameters_.cloud_surface_only;
  selection.loose_only = loose_only;
  selection.fields = parameters_.cloud_fields & simulation.tissue().point_fields();
  describe_points(simulation.tissue().read_points(selection, m->data), selection.fields, *m);
  return m;
}

boost::shared_ptr<const visualization_msgs::MarkerArray> Publications::marker_message(
    Simulation& simulation, const FrameReport& report, const ros::Time& stamp) {
  return boost::make_shared<visualization_msgs::MarkerArray>(markers_.make(
      {scene_, report.input.tools, report.result.loads, simulation.tissue().fragments(),
       parameters_.world_frame, stamp, parameters_.force_scale}));
}

boost::shared_ptr<const visualization_msgs::Marker> Publications::surface_message(
    Simulation& simulation, const ros::Time& stamp) {
  simulation.tissue().read_surface(surface_triangles_);
  auto m = boost::make_shared<visualization_msgs::Marker>(
      to_marker(surface_triangles_, simulation.tissue().fragments()));
  m->header = header(stamp);
  return m;
}

void Publications::publish_loads(const FrameReport& report, const ros::Time& stamp,
                                 bool into_bag) const {
  for (const AnchorOutput& anchor : anchors_) {
    if (anchor.number >= report.result.anchor_loads.size()) break;  // a device that knows none
    anchor.spatial.send(into_bag, stamp, [&] {
      auto m = boost::make_shared<geometry_msgs::WrenchStamped>();
      m->header = header(stamp);
      m->wrench = to_wrench(report.result.anchor_loads[anchor.number]);
      return m;
    });
  }
  for (std::size_t i = 0; i < tools_.size() && i < report.result.loads.size(); ++i) {
    const ToolMotion& motion = report.input.tools[i];
    if (!motion.present) continue;
    const ToolLoad& load = report.result.loads[i];
    const auto wrench = [&](const std::string& frame, const Wrench& value) {
      auto m = boost::make_shared<geometry_msgs::WrenchStamped>();
      m->header.stamp = stamp;
      m->header.frame_id = frame;
      m->wrench = to_wrench(value);
      return m;
    };
    const std::string& name = scene_.tools[i].name;
    tools_[i].spatial.send(into_bag, stamp,
                           [&] { return wrench(parameters_.world_frame, load.mean); });
    tools_[i].body.send(into_bag, stamp,
                        [&] { return wrench(name, in_axes(load.mean, motion.end.orientation)); });
    if (!tools_[i].grip) continue;
    tools_[i].grip->send(into_bag, stamp, [&] {
      auto m =
          boost::make_shared<JawGrip>(to_message(load, motion, report.input.grip_pressures[i]));
      m->header.stamp = stamp;
      m->header.frame_id = name;
      return m;
    });
  }
}

void Publications::publish_tf(const FrameReport& report, const ros::Time& stamp, bool into_bag) {
  if (!parameters_.publish_tf || stamp == tf_stamp_) return;  // tf2 warns of repeated stamps
  auto m = boost::make_shared<tf2_msgs::TFMessage>();
  for (std::size_t i = 0; i < report.input.tools.size(); ++i) {
    const std::string& name = scene_.tools[i].name;
    const auto source = parameters_.tools.find(name);
    const bool follows_itself =
        source != parameters_.tools.end() && source->second.tf_frame == name;
    if (!report.input.tools[i].present || follows_itself) continue;
    geometry_msgs::TransformStamped t;
    t.header = header(stamp);
    t.child_frame_id = name;
    t.transform = to_transform(report.input.tools[i].end);
    m->transforms.push_back(t);
  }
  if (cameras_) cameras_->add_transforms(header(stamp), *m);
  if (m->transforms.empty()) return;
  tf_stamp_ = stamp;
  tf_.send(into_bag, stamp, [&] { return m; });
}

}  // namespace tissue_sim

#include "ros/parameters.h"

#include <ros/console.h>
#include <ros/param.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <set>
#include <sstream>
#include <stdexcept>

#include "geometry/chord.h"
#include "geometry/mesh.h"
#include "ros/conversions.h"
#include "ros/xmlrpc_yaml.h"
#include "scene/scene_text.h"

namespace tissue_sim {
namespace {

using XmlRpc::XmlRpcValue;

const std::set<std::string> kKnown = {
    "scene", "scene_file", "method", "mesh", "mesh_scale", "world_frame", "time", "pose_delay",
    "time_factor", "publish_clock", "lockstep_tools", "paused", "cloud_rate", "cloud_stride",
    "cloud_surface_only", "cloud_fields", "fragment_rate", "state_rate", "wrench_rate",
    "marker_rate", "checksum", "force_scale", "publish_tf", "max_tool_speed", "max_tool_turn_rate",
    "tf_tolerance", "recording_folder", "record", "recording_queue", "recording_reserve",
    "recording_limit", "load_folders", "longest_work", "max_points", "tools",
    // of diagnostic_updater
    "diagnostic_period", "diagnostic_updater_use_fqn"};

[[noreturn]] void refuse(const std::string& name, XmlRpcValue& value, const std::string& allowed) {
  throw std::invalid_argument("~" + name + " is " + yaml_from(value) + ": " + allowed);
}

std::string format(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", x);
  return text;
}

void read(const ros::NodeHandle& node, const std::string& name, double& value, double min,
          double max) {
  XmlRpcValue v;
  if (!node.getParam(name, v)) return;
  const std::string allowed = "must be a number from " + format(min) + " to " + format(max);
  if (v.getType() == XmlRpcValue::TypeInt) {
    value = static_cast<int&>(v);
  } else if (v.getType() == XmlRpcValue::TypeDouble) {
    value = static_cast<double&>(v);
  } else {
    refuse(name, v, allowed);
  }
  if (!(value >= min && value <= max)) refuse(name, v, allowed);
}

void read(const ros::NodeHandle& node, const std::string& name, int& value, int min, int max) {
  XmlRpcValue v;
  if (!node.getParam(name, v)) return;
  if (v.getType() == XmlRpcValue::TypeInt) value = static_cast<int&>(v);
  if (v.getType() != XmlRpcValue::TypeInt || value < min || value > max) {
    refuse(name, v, "must be a whole number from " + format(min) + " to " + format(max));
  }
}

void read(const ros::NodeHandle& node, const std::string& name, bool& value) {
  XmlRpcValue v;
  if (!node.getParam(name, v)) return;
  if (v.getType() != XmlRpcValue::TypeBoolean) refuse(name, v, "must be true or false");
  value = static_cast<bool&>(v);
}

void read(const ros::NodeHandle& node, const std::string& name, std::string& value,
          const char* allowed) {
  XmlRpcValue v;
  if (!node.getParam(name, v)) return;
  if (v.getType() != XmlRpcValue::TypeString) refuse(name, v, allowed);
  value = static_cast<std::string&>(v);
}

// "~" is the shell's business, but launch files know no shell.
std::string absolute(const std::string& folder) {
  const char* home = std::getenv("HOME");
  std::string path = folder;
  if (home && (path == "~" || path.compare(0, 2, "~/") == 0)) path = home + path.substr(1);
  return std::filesystem::absolute(path).lexically_normal().string();
}

std::string default_recording_folder() {
  const char* ros_home = std::getenv("ROS_HOME");
  return ros_home && *ros_home ? std::string(ros_home) + "/tissue_sim" : "~/.ros/tissue_sim";
}

ToolParameters read_tool(XmlRpcValue& group, const std::string& path) {
  ToolParameters tool;
  if (group.getType() != XmlRpcValue::TypeStruct) {
    refuse(path, group, "must be a map of pose_type, tf_frame and interpolate");
  }
  for (auto& member : group) {
    const std::string name = path + "/" + member.first;
    const bool text = member.second.getType() == XmlRpcValue::TypeString;
    if (member.first == "pose_type") {
      tool.pose_type = text ? static_cast<std::string&>(member.second) : "";
      if (tool.pose_type != "PoseStamped" && tool.pose_type != "TransformStamped") {
        refuse(name, member.second, "must be PoseStamped or TransformStamped");
      }
    } else if (member.first == "tf_frame") {
      if (!text) refuse(name, member.second, "must be the name of a tf frame");
      tool.tf_frame = static_cast<std::string&>(member.second);
    } else if (member.first == "interpolate") {
      tool.interpolate = text ? static_cast<std::string&>(member.second) : "";
      if (tool.interpolate != "none" && tool.interpolate != "linear") {
        refuse(name, member.second, "must be none or linear");
      }
    } else {
      ROS_WARN("~%s is no parameter of this node: known are pose_type, tf_frame and interpolate",
               name.c_str());
    }
  }
  return tool;
}

void warn_of_unknown(const ros::NodeHandle& node) {
  std::vector<std::string> names;
  if (!ros::param::getParamNames(names)) return;
  const std::string prefix = node.getNamespace() + "/";
  std::set<std::string> unknown;
  for (const std::string& name : names) {
    if (name.compare(0, prefix.size(), prefix) != 0) continue;
    const std::string own =
        name.substr(prefix.size(), name.find('/', prefix.size()) - prefix.size());
    if (kKnown.count(own) == 0) unknown.insert(own);
  }
  std::string known;
  for (const std::string& name : kKnown) known += (known.empty() ? "" : ", ") + name;
  for (const std::string& name : unknown) {
    ROS_WARN("~%s is no parameter of this node: known are %s", name.c_str(), known.c_str());
  }
}

/// Of a body, in world axes.
Box box_of(const Body& body) {
  if (body.shape != Shape::kMesh) return bounding_box(body);
  Box box;
  for (const Vec3& x : load_solid(body, nullptr).vertices) {
    box.min = box.min.cwiseMin(x);
    box.max = box.max.cwiseMax(x);
  }
  return box;
}

/// The region that is to the box `to` as `region` is to `from`.
Region fitted(Region region, const Box& from, const Box& to) {
  const Vec3 share = (to.max - to.min).cwiseQuotient(from.max - from.min);
  const auto place = [&](const Vec3& x) {
    return Vec3(to.min + (x - from.min).cwiseProduct(share));
  };
  region.min = place(region.min);
  region.max = place(region.max);
  region.center = place(region.center);
  region.radius *= std::cbrt(share.prod());
  region.z = place(Vec3(0, 0, region.z)).z();
  return region;
}

void read_cloud_fields(const ros::NodeHandle& node, Parameters& p) {
  XmlRpcValue fields;
  if (!node.getParam("cloud_fields", fields)) return;
  std::string known;
  for (const CloudField& f : kCloudFields)
    known += (known.empty() ? "" : ", ") + std::string(f.name);
  const std::string allowed = "must be a list of " + known;
  if (fields.getType() != XmlRpcValue::TypeArray) refuse("cloud_fields", fields, allowed);
  for (int i = 0; i < fields.size(); ++i) {
    const bool text = fields[i].getType() == XmlRpcValue::TypeString;
    const std::string name = text ? static_cast<std::string&>(fields[i]) : "";
    unsigned flag = 0;
    for (const CloudField& f : kCloudFields) flag |= name == f.name ? f.flag : 0u;
    if (flag == 0) refuse("cloud_fields", fields, allowed);
    p.cloud_fields |= flag;
  }
}

void read_time(const ros::NodeHandle& node, Parameters& p) {
  const char* const allowed = "must be wall, ros or lockstep";
  std::string time = "wall";
  read(node, "time", time, allowed);
  XmlRpcValue given(time);
  if (time == "ros") {
    p.time = TimeMode::kRos;
  } else if (time == "lockstep") {
    p.time = TimeMode::kLockstep;
    p.time_factor = 0;
  } else if (time != "wall") {
    refuse("time", given, allowed);
  }
  read(node, "pose_delay", p.pose_delay, 0, 10);
  read(node, "time_factor", p.time_factor, 0, 1000);
  read(node, "publish_clock", p.publish_clock);
  if (p.time == TimeMode::kRos && p.publish_clock) {
    refuse("time", given, "must be wall or lockstep where the node is the clock (publish_clock)");
  }
  XmlRpcValue tools;
  if (!node.getParam("lockstep_tools", tools)) return;
  const char* const names = "must be a list of tools' names";
  if (tools.getType() != XmlRpcValue::TypeArray) refuse("lockstep_tools", tools, names);
  for (int i = 0; i < tools.size(); ++i) {
    if (tools[i].getType() != XmlRpcValue::TypeString) refuse("lockstep_tools", tools, names);
    p.lockstep_tools.push_back(static_cast<std::string&>(tools[i]));
  }
}

}  // namespace

WorkLimits Parameters::limits() const {
  WorkLimits limits = work;
  limits.deadline = std::chrono::steady_clock::now() +
                    std::chrono::milliseconds(static_cast<std::int64_t>(1e3 * longest_work));
  return limits;
}

RecordRequest record_request(const std::string& value) {
  if (value.empty() || value == "false") return {};
  return {true, value == "true" ? "" : value};
}

Parameters read_parameters(const ros::NodeHandle& node, const std::atomic<bool>* stop) {
  warn_of_unknown(node);
  Parameters p;
  p.work.stop = stop;
  read_time(node, p);
  read(node, "world_frame", p.world_frame, "must be the name of a tf frame");
  if (!p.world_frame.empty() && p.world_frame.front() == '/') p.world_frame.erase(0, 1);
  if (p.world_frame.empty()) {
    XmlRpcValue v("");
    refuse("world_frame", v, "must be the name of a tf frame");
  }
  read(node, "paused", p.paused);
  read(node, "cloud_rate", p.cloud_rate, 0.01, 2000);
  read(node, "cloud_stride", p.cloud_stride, 1, 1000000);
  read(node, "cloud_surface_only", p.cloud_surface_only);
  read_cloud_fields(node, p);
  read(node, "fragment_rate", p.fragment_rate, 0.01, 2000);
  read(node, "state_rate", p.state_rate, 0, 2000);
  read(node, "wrench_rate", p.wrench_rate, 0, 2000);
  read(node, "marker_rate", p.marker_rate, 0.01, 2000);
  read(node, "checksum", p.checksum);
  read(node, "force_scale", p.force_scale, 1e-6, 100);
  read(node, "publish_tf", p.publish_tf);
  read(node, "max_tool_speed", p.max_tool_speed, 0.001, 1000);
  read(node, "max_tool_turn_rate", p.max_tool_turn_rate, 0.01, 10000);
  read(node, "tf_tolerance", p.tf_tolerance, 0, 60);
  read(node, "recording_folder", p.recording_folder, "must be a path");
  if (p.recording_folder.empty()) p.recording_folder = default_recording_folder();
  p.recording_folder = absolute(p.recording_folder);
  XmlRpcValue record;
  if (node.getParam("record", record) && record.getType() == XmlRpcValue::TypeBoolean) {
    p.record = static_cast<bool&>(record) ? "true" : "";
  } else {
    read(node, "record", p.record, "must be true, false or a path inside recording_folder");
  }
  // For this run alone: parameters outlive the node, and one started by itself must not record
  // because the last launch did.
  node.deleteParam("record");
  read(node, "recording_queue", p.recording_queue, 1, 1e6);
  read(node, "recording_reserve", p.recording_reserve, 1, 1e9);
  read(node, "recording_limit", p.recording_limit, 0, 1e9);
  read(node, "longest_work", p.longest_work, 0.1, 1e6);
  int max_points = 20000000;
  read(node, "max_points", max_points, 1, 200000000);
  p.work.max_points = max_points;
  std::string folders;
  read(node, "load_folders", folders, "must be paths of folders, parted by ':'");
  std::istringstream list(folders);
  for (std::string folder; std::getline(list, folder, ':');) {
    if (!folder.empty()) p.load_folders.push_back(absolute(folder));
  }
  XmlRpcValue tools;
  if (node.getParam("tools", tools)) {
    if (tools.getType() != XmlRpcValue::TypeStruct) {
      refuse("tools", tools,
             "must be a map from a tool's name to pose_type, tf_frame and interpolate");
    }
    for (auto& tool : tools) p.tools[tool.first] = read_tool(tool.second, "tools/" + tool.first);
  }
  return p;
}

namespace {

/// One word or path that ends as scene files do.
bool looks_like_a_path(const std::string& text) {
  const auto dot = text.rfind('.');
  return dot != std::string::npos && text.find('\n') == std::string::npos &&
         (text.substr(dot) == ".yaml" || text.substr(dot) == ".yml");
}

}  // namespace

Scene read_scene_parameters(const ros::NodeHandle& node) {
  std::string file, mesh, method;
  double scale = 1;
  XmlRpcValue tree;
  read(node, "scene_file", file, "must be the path of a scene file");
  const bool has_tree =
      node.getParam("scene", tree) &&
      !(tree.getType() == XmlRpcValue::TypeString && static_cast<std::string&>(tree).empty());
  if (!file.empty() && has_tree) {
    throw std::invalid_argument("~scene_file and ~scene are both set: give one scene");
  }
  if (file.empty() && !has_tree) {
    throw std::invalid_argument(
        "there is no scene: set ~scene_file to the path of one, or ~scene to its YAML text or its "
        "tree of parameters");
  }
  const bool text = has_tree && tree.getType() == XmlRpcValue::TypeString;
  if (text && looks_like_a_path(static_cast<std::string&>(tree))) {
    refuse("scene", tree, "must be YAML text or a tree of parameters; for a path set ~scene_file");
  }
  Scene scene = !file.empty()
                    ? load_scene(resolve_path(file, "scene"))
                    : scene_from_yaml(text ? static_cast<std::string&>(tree) : yaml_from(tree));
  const std::string methods =
      "must be " + spellings(kMethodNames) + ", or empty for the scene's own";
  read(node, "method", method, methods.c_str());
  if (!method.empty() && !value_of(method, kMethodNames, scene.method)) {
    XmlRpcValue asked(method);
    refuse("method", asked, methods);
  }
  read(node, "mesh", mesh, "must be the path of a mesh file");
  read(node, "mesh_scale", scale, 1e-9, 1e9);
  if (!mesh.empty()) put_mesh(scene, mesh, scale);
  return scene;
}

void put_mesh(Scene& scene, const std::string& mesh, double scale) {
  Body& body = scene.bodies.front();
  const bool has_regions = !body.anchors.empty() || !body.inclusions.empty();
  const Box before = has_regions ? box_of(body) : Box();  // else its own mesh need not be there
  body.shape = Shape::kMesh;
  body.mesh = mesh;
  body.scale = scale;
  const Vec3 place = body.pose.position;
  body.pose.position = Vec3::Zero();
  Box box = box_of(body);
  body.pose.position = place - 0.5 * (box.min + box.max);
  if (scene.ground.enabled) body.pose.position.z() = scene.ground.z - box.min.z();
  box.min += body.pose.position;
  box.max += body.pose.position;
  for (Anchor& anchor : body.anchors) {
    static_cast<Region&>(anchor) = fitted(anchor, before, box);
  }
  for (Inclusion& inclusion : body.inclusions) {
    inclusion.region = fitted(inclusion.region, before, box);
  }
  validate(scene);
}

}  // namespace tissue_sim

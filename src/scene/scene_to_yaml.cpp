// Scene -> YAML, defaults included; of a body or tool only the fields that belong to its kind.
#include <yaml-cpp/yaml.h>

#include <cctype>

#include "scene/method_options.h"
#include "scene/scene_text.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {
namespace {

using YAML::BeginMap;
using YAML::BeginSeq;
using YAML::EndMap;
using YAML::EndSeq;
using YAML::Flow;
using YAML::Key;
using YAML::Value;

void write(YAML::Emitter& out, const char* name, double value) {
  out << Key << name << Value << text(value);
}

// Quoted unless it is plainly a word, so that no reader takes "null", "1e3" or "a: b" for its own.
void write(YAML::Emitter& out, const char* name, const std::string& value) {
  bool word = !value.empty() && std::isalpha(static_cast<unsigned char>(value.front()));
  for (char c : value) {
    word = word && (std::isalnum(static_cast<unsigned char>(c)) || c == '_');
  }
  for (const char* reserved : {"null", "Null", "NULL", "true", "True", "TRUE", "false", "False",
                               "FALSE", "yes", "no", "on", "off", "y", "n"}) {
    word = word && value != reserved;
  }
  out << Key << name << Value;
  if (!word) out << YAML::DoubleQuoted;
  out << value;
}

void write(YAML::Emitter& out, const char* name, const Vec3& v) {
  out << Key << name << Value << Flow << BeginSeq;
  out << text(v.x()) << text(v.y()) << text(v.z()) << EndSeq;
}

void write(YAML::Emitter& out, const char* name, const Quat& q) {
  out << Key << name << Value << Flow << BeginSeq;
  out << text(q.x()) << text(q.y()) << text(q.z()) << text(q.w()) << EndSeq;
}

void write(YAML::Emitter& out, const Region& region, const std::string& name_of_anchor = "") {
  out << Flow << BeginMap;
  if (!name_of_anchor.empty()) write(out, "name", name_of_anchor);
  switch (region.kind) {
    case Region::Kind::kBelow:
      write(out, "below", region.z);
      break;
    case Region::Kind::kBox:
      out << Key << "box" << Value << Flow << BeginMap;
      write(out, "min", region.min);
      write(out, "max", region.max);
      out << EndMap;
      break;
    case Region::Kind::kBall:
      out << Key << "ball" << Value << Flow << BeginMap;
      write(out, "center", region.center);
      write(out, "radius", region.radius);
      out << EndMap;
      break;
  }
  out << EndMap;
}

void write(YAML::Emitter& out, const Material& m) {
  out << BeginMap;
  write(out, "name", m.name);
  write(out, "law", std::string(name_of(m.law, kLawNames)));
  write(out, "young_modulus", m.young_modulus);
  write(out, "poisson_ratio", m.poisson_ratio);
  write(out, "density", m.density);
  write(out, "viscosity", m.viscosity);
  write(out, "tear_stretch", m.tear_stretch);
  write(out, "tear_length", m.tear_length);
  write(out, "tear_scatter", m.tear_scatter);
  write(out, "toughness", m.toughness);
  write(out, "friction", m.friction);
  if (m.bleeding.flux > 0) {
    out << Key << "bleeding" << Value << BeginMap;
    write(out, "flux", m.bleeding.flux);
    write(out, "pressure", m.bleeding.pressure);
    write(out, "clots_after", m.bleeding.clots_after);
    write(out, "fluid", m.bleeding.fluid);
    out << EndMap;
  }
  out << EndMap;
}

void write(YAML::Emitter& out, const Inclusion& inclusion) {
  out << BeginMap;
  write(out, "material", inclusion.material);
  out << Key << "region" << Value;
  write(out, inclusion.region);
  out << EndMap;
}

void write(YAML::Emitter& out, const Fluid& fluid) {
  out << BeginMap;
  write(out, "name", fluid.name);
  write(out, "density", fluid.density);
  write(out, "viscosity", fluid.viscosity);
  write(out, "bulk_modulus", fluid.bulk_modulus);
  write(out, "color", fluid.color);
  out << EndMap;
}

void write(YAML::Emitter& out, const Pool& pool) {
  out << BeginMap;
  write(out, "fluid", pool.fluid);
  out << Key << "region" << Value;
  write(out, pool.region);
  out << EndMap;
}

void write(YAML::Emitter& out, const Body& body) {
  out << BeginMap;
  write(out, "name", body.name);
  write(out, "shape", std::string(name_of(body.shape, kShapeNames)));
  for (const std::string& field : fields_of(body.shape)) {
    if (field == "size") write(out, "size", body.size);
    if (field == "radius") write(out, "radius", body.radius);
    if (field == "radii") write(out, "radii", body.radii);
    if (field == "height") write(out, "height", body.height);
    if (field == "mesh") write(out, "mesh", body.mesh);
    if (field == "scale") write(out, "scale", body.scale);
  }
  out << Key << "pose" << Value << BeginMap;
  write(out, "position", body.pose.position);
  write(out, "orientation", body.pose.orientation);
  out << EndMap;
  write(out, "material", body.material);
  out << Key << "inclusions" << Value << BeginSeq;
  for (const Inclusion& inclusion : body.inclusions) write(out, inclusion);
  out << EndSeq;
  out << Key << "anchors" << Value << BeginSeq;
  for (const Anchor& anchor : body.anchors) write(out, anchor, anchor.name);
  out << EndSeq;
  if (body.wall > 0) {
    out << Key << "hollow" << Value << BeginMap;
    write(out, "wall", body.wall);
    out << EndMap;
  }
  if (!body.filled.fluid.empty()) {
    out << Key << "filled" << Value << BeginMap;
    write(out, "fluid", body.filled.fluid);
    write(out, "pressure", body.filled.pressure);
    out << EndMap;
  }
  out << EndMap;
}

void write(YAML::Emitter& out, const Tool& tool) {
  out << BeginMap;
  write(out, "name", tool.name);
  write(out, "type", std::string(name_of(tool.type, kToolTypeNames)));
  for (const std::string& field : fields_of(tool.type)) {
    if (field == "radius") write(out, "radius", tool.radius);
    if (field == "length") write(out, "length", tool.length);
    if (field == "edge_radius") {
      const bool blade = is_bladed(tool.type);
      write(out, "edge_radius", blade ? tool.blade_edge_radius : tool.edge_radius);
    }
    if (field == "size") write(out, "size", tool.size);
    if (field == "blade_length") write(out, "blade_length", tool.blade_length);
    if (field == "blade_width") write(out, "blade_width", tool.blade_width);
    if (field == "blade_thickness") write(out, "blade_thickness", tool.blade_thickness);
    if (field == "jaw_length") write(out, "jaw_length", tool.jaw_length);
    if (field == "jaw_width") write(out, "jaw_width", tool.jaw_width);
    if (field == "grip_pressure") write(out, "grip_pressure", tool.grip_pressure);
    if (field == "cohesion") write(out, "cohesion", tool.cohesion);
    if (field == "flow") write(out, "flow", tool.flow);
    if (field == "fluid") write(out, "fluid", tool.fluid);
  }
  write(out, "friction", tool.friction);
  if (!tool.mesh.empty()) {
    write(out, "mesh", tool.mesh);
    write(out, "scale", tool.scale);
  }
  out << EndMap;
}

void write(YAML::Emitter& out, const Camera& camera) {
  out << BeginMap;
  write(out, "name", camera.name);
  out << Key << "width" << Value << camera.width;
  out << Key << "height" << Value << camera.height;
  write(out, "hfov", camera.hfov);
  write(out, "rate", camera.rate);
  write(out, "baseline", camera.baseline);
  out << Key << "pose" << Value << BeginMap;
  write(out, "position", camera.pose.position);
  write(out, "orientation", camera.pose.orientation);
  out << EndMap;
  write(out, "tf_frame", camera.tf_frame);
  write(out, "near", camera.near);
  write(out, "far", camera.far);
  out << Key << "light" << Value << camera.light;
  write(out, "colours", std::string(name_of(camera.colours, kCameraColourNames)));
  write(out, "stress_end", camera.stress_end);
  out << Key << "distortion" << Value << Flow << BeginSeq;
  for (const double d : camera.distortion) out << text(d);
  out << EndSeq;
  write(out, "depth", std::string(name_of(camera.depth, kDepthUnitNames)));
  out << Key << "flow" << Value << camera.flow << EndMap;
}

template <class Item>
void write_list(YAML::Emitter& out, const char* name, const std::vector<Item>& items) {
  out << Key << name << Value << BeginSeq;
  for (const Item& item : items) write(out, item);
  out << EndSeq;
}

void write(YAML::Emitter& out, const Option& option) {
  if (option.number != nullptr) return write(out, option.name, *option.number);
  if (option.count == nullptr) return write(out, option.name, option.words[option.word]);
  out << Key << option.name << Value << *option.count;
}

}  // namespace

std::string scene_to_yaml(const Scene& scene) {
  validate(scene);  // what could not be read back is not written
  YAML::Emitter out;
  out << BeginMap;
  write(out, "name", scene.name);
  write(out, "method", std::string(name_of(scene.method, kMethodNames)));
  write(out, "device", std::string(name_of(scene.device, kDeviceNames)));
  out << Key << "threads" << Value << scene.threads;
  write(out, "cell_size", scene.cell_size);
  write(out, "frame_rate", scene.frame_rate);
  write(out, "cfl", scene.cfl);
  write(out, "damping", scene.damping);
  write(out, "gravity", scene.gravity);
  out << Key << "seed" << Value << std::to_string(scene.seed);
  write(out, "fragment_network", scene.fragment_network);
  OptionSets options = scene;
  for (const MethodOptions* of : method_options()) {
    const std::vector<Option> all = of->list(options);
    if (of->method != scene.method || all.empty()) continue;
    out << Key << of->name() << Value << BeginMap;
    for (const Option& option : all) write(out, option);
    out << EndMap;
  }
  out << Key << "ground" << Value << BeginMap;
  out << Key << "enabled" << Value << scene.ground.enabled;
  write(out, "z", scene.ground.z);
  write(out, "friction", scene.ground.friction);
  out << EndMap;
  write_list(out, "materials", scene.materials);
  write_list(out, "bodies", scene.bodies);
  write_list(out, "tools", scene.tools);
  if (!scene.cameras.empty()) write_list(out, "cameras", scene.cameras);
  if (!scene.fluids.empty()) write_list(out, "fluids", scene.fluids);
  if (!scene.pools.empty()) write_list(out, "pools", scene.pools);
  if (scene.fluid_spacing > 0) write(out, "fluid_spacing", scene.fluid_spacing);
  out << EndMap;
  return std::string(out.c_str()) + "\n";
}

}  // namespace tissue_sim

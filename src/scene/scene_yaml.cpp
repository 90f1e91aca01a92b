// YAML -> Scene. Types and names of fields are checked here, ranges in validate().
#include <algorithm>
#include <filesystem>
#include <iterator>
#include <stdexcept>

#include "material/tear_limit.h"
#include "scene/load_yaml.h"
#include "scene/method_options.h"
#include "scene/read_file.h"
#include "scene/scene_text.h"
#include "scene/yaml_fields.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {
namespace {

using Words = std::vector<std::string>;

// Refuses fields that exist, but for another shape or type than this one.
template <class Enum, std::size_t N>
void refuse_foreign(const YamlFields& fields, Enum value, const Spelling<Enum> (&names)[N]) {
  const Words own = fields_of(value);
  const std::string owner = name_of(value, names);
  const bool vowel = std::string("aeiou").find(owner.front()) != std::string::npos;
  for (const Spelling<Enum>& other : names) {
    for (const std::string& field : fields_of(other.value)) {
      if (!fields.has(field) || std::find(own.begin(), own.end(), field) != own.end()) continue;
      fields.refuse(field,
                    (vowel ? "an " : "a ") + owner + " has no " + field + ", only " + join(own));
    }
  }
}

Pose read_pose(const YAML::Node& node, const std::string& path) {
  const YamlFields fields(node, path, {"position", "orientation"});
  Pose pose;
  fields.read("position", pose.position);
  fields.read("orientation", pose.orientation);
  return pose;
}

Region read_region(const YAML::Node& node, const std::string& path) {
  const YamlFields fields(node, path, {"below", "box", "ball"});
  if (node.size() != 1) {
    throw std::invalid_argument(path + " is a map of " + std::to_string(node.size()) +
                                " fields: must be one of {below: z}, {box: {min: [x, y, z], max: "
                                "[x, y, z]}}, {ball: {center: [x, y, z], radius: r}}");
  }
  Region region;
  if (fields.has("below")) {
    region.kind = Region::Kind::kBelow;
    fields.read("below", region.z);
  }
  fields.read_map("box", [&](const YAML::Node& box, const std::string& box_path) {
    const YamlFields corners(box, box_path, {"min", "max"});
    region.kind = Region::Kind::kBox;
    corners.require("min", "a box needs its lowest corner, [x, y, z]");
    corners.require("max", "a box needs its highest corner, [x, y, z]");
    corners.read("min", region.min);
    corners.read("max", region.max);
  });
  fields.read_map("ball", [&](const YAML::Node& ball, const std::string& ball_path) {
    const YamlFields ball_fields(ball, ball_path, {"center", "radius"});
    region.kind = Region::Kind::kBall;
    ball_fields.require("center", "a ball needs its center, [x, y, z]");
    ball_fields.require("radius", "a ball needs its radius");
    ball_fields.read("center", region.center);
    ball_fields.read("radius", region.radius);
  });
  return region;
}

Anchor read_anchor(const YAML::Node& node, const std::string& path) {
  if (!node.IsMap() || !node["name"]) return read_region(node, path);
  YAML::Node region(YAML::NodeType::Map);
  for (const auto& field : node) {
    if (field.first.as<std::string>() != "name") region[field.first] = field.second;
  }
  Anchor anchor = read_region(region, path);
  YAML::Node named(YAML::NodeType::Map);
  named["name"] = node["name"];
  YamlFields(named, path, {"name"}).read("name", anchor.name);
  return anchor;
}

/// The limit of tearing that toughness gives in cells of the scene.
void read_measured_tear(const YamlFields& fields, const Scene& scene, Material& m) {
  if (!fields.says("tear", "measured")) {
    fields.refuse("tear", "must be measured, from toughness, or left out: give tear_stretch");
  }
  for (const char* given : {"tear_stretch", "tear_length"}) {
    if (fields.has(given)) fields.refuse("tear", std::string("leaves no room for ") + given);
  }
  const MethodOptions& method = options_of(scene.method);
  if (method.tear_height == 0) {
    fields.refuse("tear", std::string("materials have no toughness with method ") + method.name());
  }
  const double cell = method.spacing(scene).lattice, height = method.tear_height * cell;
  const bool valid = height > 0 && m.young_modulus > 0 && m.poisson_ratio >= 0 &&
                     m.poisson_ratio < 0.5 && m.toughness >= 0;
  if (!valid) return;  // validate() says what is not
  if (m.toughness == 0) fields.refuse("tear", "needs a toughness above 0, J/m^2");
  m.tear_stretch = tear_stretch_of(m, height);
  m.tear_length = method.tear_length * cell;
  if (m.tear_stretch >= kLeastTearStretch && m.tear_stretch < kLargestTearStretch) return;
  const bool weak = m.tear_stretch < kLeastTearStretch;
  fields.refuse("tear", "toughness " + text(m.toughness) + " J/m^2 over young_modulus " +
                            text(m.young_modulus) + " Pa is too " + (weak ? "little" : "much") +
                            " for cells of this size, the limit would be " +
                            (weak ? "below " : "above ") +
                            text(weak ? kLeastTearStretch : kLargestTearStretch));
}

/// Of a scene whose method and cells are known.
Material read_material(const YAML::Node& node, const std::string& path, const Scene& scene) {
  const YamlFields fields(
      node, path,
      {"name", "law", "young_modulus", "poisson_ratio", "density", "viscosity", "tear",
       "tear_stretch", "tear_length", "tear_scatter", "toughness", "friction", "bleeding"});
  fields.require("name", "bodies refer to a material by its name");
  Material m;
  fields.read("name", m.name);
  fields.read("law", m.law, kLawNames);
  fields.read("young_modulus", m.young_modulus);
  fields.read("poisson_ratio", m.poisson_ratio);
  fields.read("density", m.density);
  fields.read("viscosity", m.viscosity);
  fields.read("tear_stretch", m.tear_stretch);
  fields.read("tear_length", m.tear_length);
  fields.read("tear_scatter", m.tear_scatter);
  if (fields.says("toughness", "measured")) {
    m.toughness = measured_toughness(m.name);
    if (m.toughness == 0) {
      fields.refuse("toughness", "was not measured of '" + m.name +
                                     "', only of liver, vessel, fat, muscle and skin: give J/m^2");
    }
  } else {
    fields.read("toughness", m.toughness);
  }
  if (fields.has("tear")) read_measured_tear(fields, scene, m);
  fields.read("friction", m.friction);
  fields.read_map("bleeding", [&](const YAML::Node& bleeding, const std::string& bleeding_path) {
    const YamlFields of(bleeding, bleeding_path, {"flux", "pressure", "clots_after", "fluid"});
    of.require("flux", "must say how much comes out of opened tissue");
    of.read("flux", m.bleeding.flux);
    of.read("pressure", m.bleeding.pressure);
    of.read("clots_after", m.bleeding.clots_after);
    of.read("fluid", m.bleeding.fluid);
  });
  return m;
}

Inclusion read_inclusion(const YAML::Node& node, const std::string& path) {
  const YamlFields fields(node, path, {"material", "region"});
  fields.require("material", "an inclusion is of a material of its own");
  fields.require("region", "an inclusion needs the region that it fills");
  Inclusion inclusion;
  fields.read("material", inclusion.material);
  fields.read_map("region", [&](const YAML::Node& region, const std::string& region_path) {
    inclusion.region = read_region(region, region_path);
  });
  return inclusion;
}

Fluid read_fluid(const YAML::Node& node, const std::string& path) {
  const YamlFields fields(node, path, {"name", "density", "viscosity", "bulk_modulus", "color"});
  fields.require("name", "bodies and pools refer to a fluid by its name");
  Fluid fluid;
  fields.read("name", fluid.name);
  fields.read("density", fluid.density);
  fields.read("viscosity", fluid.viscosity);
  fields.read("bulk_modulus", fluid.bulk_modulus);
  fields.read("color", fluid.color);
  return fluid;
}

Pool read_pool(const YAML::Node& node, const std::string& path) {
  const YamlFields fields(node, path, {"fluid", "region"});
  fields.require("region", "a pool needs the region that it fills");
  Pool pool;
  fields.read("fluid", pool.fluid);
  fields.read_map("region", [&](const YAML::Node& region, const std::string& region_path) {
    pool.region = read_region(region, region_path);
  });
  return pool;
}

Body read_body(const YAML::Node& node, const std::string& path) {
  const YamlFields fields(node, path,
                          {"name", "shape", "size", "radius", "radii", "height", "mesh", "scale",
                           "pose", "material", "inclusions", "anchors", "hollow", "filled"});
  Body body;
  fields.read("name", body.name);
  fields.read("shape", body.shape, kShapeNames);
  refuse_foreign(fields, body.shape, kShapeNames);
  fields.read("size", body.size);
  fields.read("radius", body.radius);
  fields.read("radii", body.radii);
  fields.read("height", body.height);
  fields.read("mesh", body.mesh);
  fields.read("scale", body.scale);
  fields.read_map("pose", [&](const YAML::Node& pose, const std::string& pose_path) {
    body.pose = read_pose(pose, pose_path);
  });
  fields.read("material", body.material);
  fields.read_list("inclusions", [&](const YAML::Node& item, const std::string& item_path) {
    body.inclusions.push_back(read_inclusion(item, item_path));
  });
  fields.read_list("anchors", [&](const YAML::Node& item, const std::string& item_path) {
    body.anchors.push_back(read_anchor(item, item_path));
  });
  fields.read_map("hollow", [&](const YAML::Node& hollow, const std::string& hollow_path) {
    const YamlFields hollow_fields(hollow, hollow_path, {"wall"});
    hollow_fields.require("wall", "a hollow needs the thickness of its wall");
    hollow_fields.read("wall", body.wall);
    if (!(body.wall > 0)) hollow_fields.refuse("wall", "must lie above 0 m");
  });
  fields.read_map("filled", [&](const YAML::Node& filled, const std::string& filled_path) {
    const YamlFields filled_fields(filled, filled_path, {"fluid", "pressure"});
    filled_fields.require("fluid", "must name what fills the hollow");
    filled_fields.read("fluid", body.filled.fluid);
    filled_fields.read("pressure", body.filled.pressure);
  });
  return body;
}

Tool read_tool(const YAML::Node& node, const std::string& path) {
  const YamlFields fields(
      node, path,
      {"name", "type", "radius", "length", "edge_radius", "size", "blade_length", "blade_width",
       "blade_thickness", "jaw_length", "jaw_width", "grip_pressure", "cohesion", "flow", "fluid",
       "friction", "mesh", "scale"});
  Tool tool;
  fields.read("name", tool.name);
  fields.read("type", tool.type, kToolTypeNames);
  refuse_foreign(fields, tool.type, kToolTypeNames);
  fields.read("radius", tool.radius);
  fields.read("length", tool.length);
  fields.read("edge_radius", is_bladed(tool.type) ? tool.blade_edge_radius : tool.edge_radius);
  fields.read("size", tool.size);
  fields.read("blade_length", tool.blade_length);
  fields.read("blade_width", tool.blade_width);
  fields.read("blade_thickness", tool.blade_thickness);
  fields.read("jaw_length", tool.jaw_length);
  fields.read("jaw_width", tool.jaw_width);
  fields.read("grip_pressure", tool.grip_pressure);
  fields.read("cohesion", tool.cohesion);
  fields.read("flow", tool.flow);
  fields.read("fluid", tool.fluid);
  fields.read("friction", tool.friction);
  fields.read("mesh", tool.mesh);
  fields.read("scale", tool.scale);
  return tool;
}

Camera read_camera(const YAML::Node& node, const std::string& path) {
  const YamlFields fields(
      node, path,
      {"name", "width", "height", "hfov", "rate", "baseline", "pose", "tf_frame", "near", "far",
       "light", "colours", "stress_end", "distortion", "depth", "flow"});
  Camera camera;
  fields.read("name", camera.name);
  fields.read("width", camera.width);
  fields.read("height", camera.height);
  fields.read("hfov", camera.hfov);
  fields.read("rate", camera.rate);
  fields.read("baseline", camera.baseline);
  fields.read_map("pose", [&](const YAML::Node& pose, const std::string& pose_path) {
    camera.pose = read_pose(pose, pose_path);
  });
  fields.read("tf_frame", camera.tf_frame);
  fields.read("near", camera.near);
  fields.read("far", camera.far);
  fields.read("light", camera.light);
  fields.read("colours", camera.colours, kCameraColourNames);
  fields.read("stress_end", camera.stress_end);
  fields.read("distortion", camera.distortion, 5);
  fields.read("depth", camera.depth, kDepthUnitNames);
  fields.read("flow", camera.flow);
  return camera;
}

void read_options(const YAML::Node& node, const std::string& path, std::vector<Option> options) {
  Words names;
  for (const Option& option : options) names.emplace_back(option.name);
  const YamlFields fields(node, path, names);
  for (Option& option : options) {
    if (option.number != nullptr) {
      fields.read(option.name, *option.number);
    } else if (option.count != nullptr) {
      fields.read(option.name, *option.count);
    } else if (fields.has(option.name)) {
      fields.read(option.name, option.word, option.words);
      option.choose(option.word);
    }
  }
}

Scene read_scene(const YAML::Node& node) {
  Words known = {"name",         "method",  "device",  "threads", "cell_size",        "frame_rate",
                 "cfl",          "damping", "gravity", "seed",    "fragment_network", "ground",
                 "materials",    "bodies",  "tools",   "cameras", "fluids",           "pools",
                 "fluid_spacing"};
  const auto& methods = method_options();
  std::transform(methods.begin(), methods.end(), std::inserter(known, known.begin() + 11),
                 [](const MethodOptions* of) { return of->name(); });
  const YamlFields fields(node, "", known);
  Scene scene;
  fields.read("name", scene.name);
  fields.read("method", scene.method, kMethodNames);
  fields.read("device", scene.device, kDeviceNames);
  fields.read("threads", scene.threads);
  fields.read("cell_size", scene.cell_size);
  fields.read("frame_rate", scene.frame_rate);
  fields.read("cfl", scene.cfl);
  fields.read("damping", scene.damping);
  fields.read("gravity", scene.gravity);
  fields.read("seed", scene.seed);
  fields.read("fragment_network", scene.fragment_network);
  for (const MethodOptions* of : methods) {
    fields.read_map(of->name(), [&](const YAML::Node& options, const std::string& path) {
      read_options(options, path, of->list(scene));
    });
  }
  fields.read_map("ground", [&](const YAML::Node& ground, const std::string& path) {
    const YamlFields ground_fields(ground, path, {"enabled", "z", "friction"});
    ground_fields.read("enabled", scene.ground.enabled);
    ground_fields.read("z", scene.ground.z);
    ground_fields.read("friction", scene.ground.friction);
  });
  fields.read_list("materials", [&](const YAML::Node& item, const std::string& path) {
    scene.materials.push_back(read_material(item, path, scene));
  });
  fields.read_list("bodies", [&](const YAML::Node& item, const std::string& path) {
    scene.bodies.push_back(read_body(item, path));
  });
  fields.read_list("tools", [&](const YAML::Node& item, const std::string& path) {
    scene.tools.push_back(read_tool(item, path));
  });
  fields.read_list("cameras", [&](const YAML::Node& item, const std::string& path) {
    scene.cameras.push_back(read_camera(item, path));
  });
  fields.read_list("fluids", [&](const YAML::Node& item, const std::string& path) {
    scene.fluids.push_back(read_fluid(item, path));
  });
  fields.read_list("pools", [&](const YAML::Node& item, const std::string& path) {
    scene.pools.push_back(read_pool(item, path));
  });
  fields.read("fluid_spacing", scene.fluid_spacing);
  return scene;
}

}  // namespace

Scene scene_from_yaml(const std::string& text) {
  if (text.size() > kLargestScene) {
    throw std::invalid_argument("the scene is a text of " + std::to_string(text.size()) +
                                " characters: that is too large");
  }
  YAML::Node node;
  Scene scene;
  try {
    node = load_yaml(text);
    scene = read_scene(node);
  } catch (const YAML::Exception& e) {
    throw std::invalid_argument("the scene is no valid YAML: " + yaml_problem(e));
  }
  validate(scene);
  return scene;
}

Scene load_scene(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (fs::is_directory(path, error)) {
    throw std::invalid_argument(path + ": is a folder, name a scene file in it");
  }
  std::string text;
  if (fs::exists(path, error)) {
    try {
      text = read_file(path, kLargestScene);
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument(path + ": " + e.what());
    }
    if (text.empty()) throw std::invalid_argument(path + ": is empty, give a scene");
  } else {
    if (fs::path(path)
            .is_relative()) {  // launched nodes run in ~/.ros, whatever the caller's folder
      throw std::invalid_argument(path + ": no such file in " + fs::current_path(error).string() +
                                  ", the folder that this program runs in, give the full path");
    }
    throw std::invalid_argument(path + ": no such file, give the path of a scene");
  }
  Scene scene;
  try {
    scene = scene_from_yaml(text);
  } catch (const FieldError& e) {  // what is no scene may be any file that this program can read
    throw std::invalid_argument(path + ": " + e.unquoted());
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument(path + ": " + e.what());
  }
  // A node's working directory means nothing to who wrote the scene; the scene's own folder does.
  const auto make_absolute = [&path](std::string& file) {
    if (file.find("://") != std::string::npos || !fs::path(file).is_relative()) return;
    file = (fs::absolute(path).parent_path() / file).lexically_normal().string();
  };
  for (Body& body : scene.bodies) {
    if (body.shape == Shape::kMesh) make_absolute(body.mesh);
  }
  if (scene.fragment_network != "off") make_absolute(scene.fragment_network);
  return scene;
}

}  // namespace tissue_sim

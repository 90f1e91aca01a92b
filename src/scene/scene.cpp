// Range checks of a scene: every number that YAML, a service or a program can put in it.
#include "tissue_sim/scene.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "material/tear_limit.h"
#include "scene/method_options.h"
#include "scene/scene_text.h"

namespace tissue_sim {
namespace {

constexpr std::size_t kLongestName = 200, kLongestPath = 4096;
constexpr std::size_t kMostBodies = 1000;  // each may meet each: memory grows with the square
constexpr std::size_t kMostTools = 100, kMostMaterials = 1000, kMostAnchors = 1000;
constexpr std::size_t kMostCameras = 16, kMostFluids = 100, kMostPools = 1000;

[[noreturn]] void refuse(const std::string& field, const std::string& value,
                         const std::string& allowed) {
  throw std::invalid_argument(field + " is " + value + ": " + allowed);
}

std::string quoted(const std::string& s) {
  return "\"" + (s.size() > kLongestName ? s.substr(0, kLongestName) + "..." : s) + "\"";
}

std::string range_text(double low, double high, const char* unit) {
  std::string range = "between " + text(low) + " and " + text(high);
  if (*unit) range += std::string(" ") + unit;
  return range;
}

// Written so that NaN fails.
void check_range(const std::string& field, double value, double low, double high,
                 const char* unit = "") {
  if (value >= low && value <= high) return;
  refuse(field, text(value), "must lie " + range_text(low, high, unit));
}

void check_each(const std::string& field, const Vec3& v, double low, double high, const char* what,
                const char* unit) {
  if ((v.array() >= low).all() && (v.array() <= high).all()) return;
  refuse(field, text(v), std::string("each ") + what + " must lie " + range_text(low, high, unit));
}

void check_position(const std::string& field, const Vec3& v) {
  check_each(field, v, -100, 100, "coordinate", "m");
}

void check_friction(const std::string& field, double value) { check_range(field, value, 0, 2); }

/// Whether a text is UTF-8 (RFC 3629): YAML is, and other bytes would be written as other ones.
bool is_utf8(const std::string& s) {
  for (std::size_t i = 0; i < s.size();) {
    const auto at = [&](std::size_t k) {
      return static_cast<unsigned>(k < s.size() ? static_cast<unsigned char>(s[k]) : 0);
    };
    const unsigned first = at(i);
    const std::size_t more = first < 0x80                     ? 0
                             : first >= 0xc2 && first < 0xe0  ? 1
                             : first >= 0xe0 && first < 0xf0  ? 2
                             : first >= 0xf0 && first <= 0xf4 ? 3
                                                              : 4;
    if (more == 4) return false;
    for (std::size_t k = 1; k <= more; ++k) {
      if ((at(i + k) & 0xc0) != 0x80) return false;
    }
    const unsigned second = at(i + 1);
    if (first == 0xe0 && second < 0xa0) return false;
    if (first == 0xed && second > 0x9f) return false;
    if (first == 0xf0 && second < 0x90) return false;
    if (first == 0xf4 && second > 0x8f) return false;
    i += more + 1;
  }
  return true;
}

void check_utf8(const std::string& field, const std::string& text) {
  if (!is_utf8(text)) refuse(field, "no UTF-8", "must be, or it could not be written as YAML");
}

void check_length(const std::string& field, const std::string& name) {
  if (name.empty()) refuse(field, quoted(name), "must not be empty");
  check_utf8(field, name);
  if (name.size() <= kLongestName) return;
  refuse(field, "a text of " + std::to_string(name.size()) + " characters",
         "must not be longer than " + std::to_string(kLongestName));
}

void check_count(const std::string& field, std::size_t count, std::size_t most) {
  if (count <= most) return;
  refuse(field, "a list of " + std::to_string(count), "at most " + std::to_string(most));
}

void check_name(const std::string& field, const std::string& name, std::set<std::string>& taken) {
  check_length(field, name);
  if (!taken.insert(name).second) refuse(field, quoted(name), "must be unique in the scene");
}

template <class Enum, std::size_t N>
void check_enum(const std::string& field, Enum value, const Spelling<Enum> (&names)[N]) {
  if (!name_of(value, names))
    refuse(field, std::to_string(static_cast<int>(value)), "no such value");
}

void check_pose(const std::string& path, const Pose& pose) {
  check_position(path + ".position", pose.position);
  const Quat& q = pose.orientation;
  if (std::abs(q.norm() - 1) <= 1e-3) return;  // false for NaN
  refuse(path + ".orientation",
         "[" + text(q.x()) + ", " + text(q.y()) + ", " + text(q.z()) + ", " + text(q.w()) + "]",
         "must be a unit quaternion [x, y, z, w], its norm within 0.001 of 1");
}

void check_region(const std::string& path, const Region& region) {
  switch (region.kind) {
    case Region::Kind::kBelow:
      return check_range(path + ".below", region.z, -100, 100, "m");
    case Region::Kind::kBox:
      check_position(path + ".box.min", region.min);
      check_position(path + ".box.max", region.max);
      if ((region.min.array() >= region.max.array()).any()) {
        refuse(path + ".box.max", text(region.max),
               "each coordinate must be above that of min, " + text(region.min));
      }
      return;
    case Region::Kind::kBall:
      check_position(path + ".ball.center", region.center);
      return check_range(path + ".ball.radius", region.radius, 1e-4, 100, "m");
  }
  refuse(path, "of kind " + std::to_string(static_cast<int>(region.kind)), "no such kind");
}

void check_material(const std::string& path, const Material& m, std::set<std::string>& names) {
  check_name(path + ".name", m.name, names);
  check_enum(path + ".law", m.law, kLawNames);
  if (!(m.young_modulus > 0 && m.young_modulus <= 1e8)) {
    refuse(path + ".young_modulus", text(m.young_modulus), "must lie above 0 and up to 1e+08 Pa");
  }
  check_range(path + ".poisson_ratio", m.poisson_ratio, 0, 0.49);
  check_range(path + ".density", m.density, 100, 20000, "kg/m^3");
  check_range(path + ".viscosity", m.viscosity, 0, 1000, "Pa s");
  if (m.tear_stretch != 0 &&
      !(m.tear_stretch >= kLeastTearStretch && m.tear_stretch <= kLargestTearStretch)) {
    refuse(path + ".tear_stretch", text(m.tear_stretch),
           "must be 0 (never tears) or lie between 1.001 and 100");
  }
  check_range(path + ".tear_length", m.tear_length, 0, 1, "m");
  check_range(path + ".tear_scatter", m.tear_scatter, 0, 0.9);
  check_range(path + ".toughness", m.toughness, 0, 1e5, "J/m^2");
  check_range(path + ".bleeding.flux", m.bleeding.flux, 0, 1, "m/s");
  check_range(path + ".bleeding.pressure", m.bleeding.pressure, 0, 1e5, "Pa");
  check_range(path + ".bleeding.clots_after", m.bleeding.clots_after, 0, 1e5, "s");
  check_friction(path + ".friction", m.friction);
}

void check_mesh(const std::string& path, const std::string& mesh, double scale) {
  check_utf8(path + ".mesh", mesh);
  if (mesh.size() > kLongestPath) {
    refuse(path + ".mesh", "a text of " + std::to_string(mesh.size()) + " characters",
           "no path is so long");
  }
  check_range(path + ".scale", scale, 1e-6, 1e3, "m per unit of the file");
}

// Only the fields that belong to the shape: nobody reads the others.
void check_shape(const std::string& path, const Body& body) {
  constexpr double kSmallest = 1e-4, kLargest = 10;
  switch (body.shape) {
    case Shape::kBox:
      return check_each(path + ".size", body.size, kSmallest, kLargest, "edge", "m");
    case Shape::kBall:
      return check_range(path + ".radius", body.radius, kSmallest, kLargest, "m");
    case Shape::kEllipsoid:
      return check_each(path + ".radii", body.radii, kSmallest, kLargest, "semi-axis", "m");
    case Shape::kCylinder:
      check_range(path + ".radius", body.radius, kSmallest, kLargest, "m");
      return check_range(path + ".height", body.height, kSmallest, kLargest, "m");
    case Shape::kMesh:
      if (body.mesh.empty()) {
        refuse(path + ".mesh", quoted(body.mesh),
               "must be the path of a mesh file (plain, file:// or package://)");
      }
      return check_mesh(path, body.mesh, body.scale);
  }
}

// Becomes part of topic and parameter names.
void check_ros_name(const std::string& field, const std::string& name) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  bool valid = !name.empty() && is_letter(name.front());
  for (char c : name) valid = valid && (is_letter(c) || (c >= '0' && c <= '9') || c == '_');
  if (valid) return;
  refuse(field, quoted(name), "must be a ROS name: a letter, then letters, digits and '_'");
}

void check_tool(const std::string& path, const Tool& tool, std::set<std::string>& names) {
  check_name(path + ".name", tool.name, names);
  check_ros_name(path + ".name", tool.name);
  check_enum(path + ".type", tool.type, kToolTypeNames);
  switch (tool.type) {
    case ToolType::kScalpel:
      check_range(path + ".blade_length", tool.blade_length, 1e-3, 0.2, "m");
      check_range(path + ".blade_width", tool.blade_width, 2e-4, 0.1, "m");
      check_range(path + ".blade_thickness", tool.blade_thickness, 1e-5, 0.01, "m");
      check_range(path + ".edge_radius", tool.blade_edge_radius, 0, tool.blade_thickness / 2, "m");
      break;
    case ToolType::kProbe:
      check_range(path + ".radius", tool.radius, 1e-4, 0.1, "m");
      check_range(path + ".length", tool.length, 1e-3, 1, "m");
      break;
    case ToolType::kGrasper:
      check_range(path + ".jaw_length", tool.jaw_length, 1e-3, 0.2, "m");
      check_range(path + ".jaw_width", tool.jaw_width, 2e-4, 0.1, "m");
      check_range(path + ".grip_pressure", tool.grip_pressure, 1, 1e7, "Pa");
      check_range(path + ".cohesion", tool.cohesion, 0, 1e7, "Pa");
      break;
    case ToolType::kScissors:
      check_range(path + ".jaw_length", tool.jaw_length, 1e-3, 0.2, "m");
      check_range(path + ".blade_width", tool.blade_width, 2e-4, tool.jaw_length, "m");
      check_range(path + ".blade_thickness", tool.blade_thickness, 1e-5, 0.01, "m");
      check_range(path + ".edge_radius", tool.blade_edge_radius, 0, tool.blade_thickness / 2, "m");
      break;
    case ToolType::kBall:
      check_range(path + ".radius", tool.radius, 1e-4, 0.1, "m");
      break;
    case ToolType::kPunch:
      check_range(path + ".radius", tool.radius, 1e-4, 0.1, "m");
      check_range(path + ".length", tool.length, 1e-3, 1, "m");
      check_range(path + ".edge_radius", tool.edge_radius, 1e-5,
                  std::min(tool.radius, tool.length / 2), "m");
      break;
    case ToolType::kPlate:
      check_each(path + ".size", tool.size, 1e-4, 1, "edge", "m");
      check_range(path + ".edge_radius", tool.edge_radius, 1e-5, tool.size.minCoeff() / 2, "m");
      break;
    case ToolType::kSuction:
    case ToolType::kIrrigation:
      check_range(path + ".radius", tool.radius, 1e-4, 0.1, "m");
      check_range(path + ".length", tool.length, 1e-3, 1, "m");
      check_range(path + ".flow", tool.flow, 1e-9, 1e-2, "m^3/s");
      break;
  }
  check_friction(path + ".friction", tool.friction);
  check_mesh(path, tool.mesh, tool.scale);
}

void check_camera(const std::string& path, const Camera& camera, std::set<std::string>& names) {
  check_name(path + ".name", camera.name, names);
  check_ros_name(path + ".name", camera.name);
  check_range(path + ".width", camera.width, 16, 4096, "pixels");
  check_range(path + ".height", camera.height, 16, 4096, "pixels");
  check_range(path + ".hfov", camera.hfov, 5, 150, "degrees");
  check_range(path + ".rate", camera.rate, 0.1, 1000, "Hz");
  check_range(path + ".baseline", camera.baseline, 0, 1, "m");
  check_pose(path + ".pose", camera.pose);
  check_utf8(path + ".tf_frame", camera.tf_frame);
  if (camera.tf_frame.size() > kLongestName) {
    refuse(path + ".tf_frame", quoted(camera.tf_frame), "must not be longer than 200 characters");
  }
  check_range(path + ".near", camera.near, 1e-4, 100, "m");
  check_range(path + ".far", camera.far, 1e-4, 100, "m");
  if (!(camera.near < camera.far)) {
    refuse(path + ".far", text(camera.far), "must be above near, " + text(camera.near));
  }
  check_enum(path + ".colours", camera.colours, kCameraColourNames);
  check_enum(path + ".depth", camera.depth, kDepthUnitNames);
  check_range(path + ".stress_end", camera.stress_end, 1, 1e9, "Pa");
  if (!camera.distortion.empty() && camera.distortion.size() != 5) {
    refuse(path + ".distortion", "a list of " + std::to_string(camera.distortion.size()),
           "must be k1, k2, p1, p2, k3, or none");
  }
  for (const double d : camera.distortion) check_range(path + ".distortion", d, -10, 10);
}

void check_option(const std::string& field, const Option& option) {
  const double value = option.number != nullptr  ? *option.number
                       : option.count != nullptr ? *option.count
                                                 : 0;
  if (!option.words.empty()) {
    if (option.word < 0) refuse(field, "no value of this option", "must be one that it has");
  } else if (value != 0 || !*option.zero) {
    const std::string zero = *option.zero ? std::string(", or 0 for ") + option.zero : "";
    check_range(field, value, option.low, option.high, (option.unit + zero).c_str());
  }
}

void check_options(const Scene& scene) {
  OptionSets options = scene;
  std::string with_network;
  for (const MethodOptions* of : method_options()) {
    for (const Option& option : of->list(options)) {
      check_option(std::string(of->name()) + "." + option.name, option);
    }
    if (of->takes_network)
      with_network += (with_network.empty() ? "" : " or ") + std::string(of->name());
  }
  check_utf8("fragment_network", scene.fragment_network);
  const bool none = scene.fragment_network == "off";
  if (scene.fragment_network.size() > kLongestPath || scene.fragment_network.empty() ||
      (!none && !options_of(scene.method).takes_network)) {
    refuse("fragment_network", quoted(scene.fragment_network.substr(0, kLongestName)),
           "must be off or, with method " + with_network + ", the file of a network");
  }
}

std::string at(const char* list, std::size_t i) {
  return std::string(list) + "[" + std::to_string(i) + "]";
}

// The material of that name, or nullptr.
const Material* lookup(const Scene& scene, const std::string& name) {
  for (const Material& m : scene.materials) {
    if (m.name == name) return &m;
  }
  for (const Material& m : material_presets()) {
    if (m.name == name) return &m;
  }
  return nullptr;
}

std::string known_materials(const Scene& scene) {
  std::set<std::string> names;
  for (const Material& m : scene.materials) names.insert(m.name);
  for (const Material& m : material_presets()) names.insert(m.name);
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

void check_material_name(const std::string& field, const Scene& scene, const std::string& name) {
  if (lookup(scene, name)) return;
  refuse(field, quoted(name),
         "must be one of " + known_materials(scene) + ", or be defined in materials");
}

const Fluid* lookup_fluid(const Scene& scene, const std::string& name) {
  for (const auto* fluids : {&scene.fluids, &fluid_presets()}) {
    for (const Fluid& f : *fluids) {
      if (f.name == name) return &f;
    }
  }
  return nullptr;
}

void check_fluid_name(const std::string& field, const Scene& scene, const std::string& name) {
  if (lookup_fluid(scene, name)) return;
  std::string known;
  for (const auto* fluids : {&scene.fluids, &fluid_presets()}) {
    for (const Fluid& f : *fluids) known += (known.empty() ? "" : ", ") + f.name;
  }
  refuse(field, quoted(name), "must be one of " + known + ", or be defined in fluids");
}

/// Edges of the box around a body's own shape, without its pose [m].
Vec3 extent(const Body& body) {
  switch (body.shape) {
    case Shape::kBox:
      return body.size;
    case Shape::kBall:
      return Vec3::Constant(2 * body.radius);
    case Shape::kEllipsoid:
      return 2 * body.radii;
    case Shape::kCylinder:
      return {2 * body.radius, 2 * body.radius, body.height};
    case Shape::kMesh:
      break;
  }
  return Vec3::Constant(1e3);
}

void check_hollow(const std::string& path, const Scene& scene, const Body& body) {
  const bool filled = !body.filled.fluid.empty();
  if (body.wall == 0) {
    if (filled) refuse(path + ".filled", "there", "only a body with hollow: {wall: ..} is filled");
    return;
  }
  const double thinnest = 2 * scene.cell_size;
  if (!(body.wall >= thinnest * (1 - 1e-9))) {
    refuse(path + ".hollow.wall", text(body.wall),
           "must be two cells or more, " + text(thinnest) + " m: a thinner wall leaks");
  }
  if (!(2 * body.wall + 2 * scene.cell_size <= extent(body).minCoeff())) {
    refuse(path + ".hollow.wall", text(body.wall), "leaves no hollow of two cells in the body");
  }
  if (scene.method == Method::kPbd && scene.pbd.model == PbdModel::kSurface) {
    refuse(
        path + ".hollow", "there",
        "pbd's surface model is a skin without a wall, so nothing could press on it from within: "
        "choose pbd: {model: tetrahedra}, or another method");
  }
  if (!filled) return;
  check_fluid_name(path + ".filled.fluid", scene, body.filled.fluid);
  check_range(path + ".filled.pressure", body.filled.pressure, 0, 1e5, "Pa");
}

void check_fluids(const Scene& scene) {
  if (scene.method == Method::kMls && has_fluid(scene)) {
    refuse("method", "mls",
           "blows up beside fluid after some frames, which is not mended yet: choose mpm, or pbd "
           "with model: tetrahedra");
  }
  std::set<std::string> names;
  for (std::size_t i = 0; i < scene.fluids.size(); ++i) {
    const std::string path = at("fluids", i);
    const Fluid& f = scene.fluids[i];
    check_name(path + ".name", f.name, names);
    check_range(path + ".density", f.density, 100, 20000, "kg/m^3");
    check_range(path + ".viscosity", f.viscosity, 0, 100, "Pa s");
    if (f.bulk_modulus != 0) check_range(path + ".bulk_modulus", f.bulk_modulus, 100, 1e8, "Pa");
    check_each(path + ".color", f.color, 0, 1, "part", "");
  }
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    check_fluid_name(at("materials", i) + ".bleeding.fluid", scene,
                     scene.materials[i].bleeding.fluid);
  }
  for (std::size_t i = 0; i < scene.tools.size(); ++i) {
    if (scene.tools[i].type != ToolType::kIrrigation) continue;
    check_fluid_name(at("tools", i) + ".fluid", scene, scene.tools[i].fluid);
  }
  for (std::size_t i = 0; i < scene.pools.size(); ++i) {
    const std::string path = at("pools", i);
    check_fluid_name(path + ".fluid", scene, scene.pools[i].fluid);
    check_region(path + ".region", scene.pools[i].region);
    if (scene.pools[i].region.kind == Region::Kind::kBelow) {
      refuse(path + ".region", "below", "has no end: must be a box or a ball");
    }
  }
  if (scene.fluid_spacing != 0) {
    check_range("fluid_spacing", scene.fluid_spacing, 1e-5, scene.cell_size, "m");
  }
}

}  // namespace

Vec3 Anchor::origin() const {
  switch (kind) {
    case Kind::kBox:
      return (min + max) / 2;
    case Kind::kBall:
      return center;
    case Kind::kBelow:
      break;
  }
  return {0, 0, z};
}

bool Region::contains(const Vec3& x) const {
  switch (kind) {
    case Kind::kBox:
      return (x.array() >= min.array()).all() && (x.array() <= max.array()).all();
    case Kind::kBall:
      return (x - center).squaredNorm() <= radius * radius;
    case Kind::kBelow:
      return x.z() < z;
  }
  return false;
}

void validate(const Scene& scene) {
  // First: of a file without bodies, which is no scene, nothing else is said.
  if (scene.bodies.empty()) refuse("bodies", "empty", "a scene needs at least one body");
  check_length("name", scene.name);
  check_count("materials", scene.materials.size(), kMostMaterials);
  check_count("bodies", scene.bodies.size(), kMostBodies);
  check_count("tools", scene.tools.size(), kMostTools);
  check_count("cameras", scene.cameras.size(), kMostCameras);
  check_count("fluids", scene.fluids.size(), kMostFluids);
  check_count("pools", scene.pools.size(), kMostPools);
  check_enum("method", scene.method, kMethodNames);
  check_enum("device", scene.device, kDeviceNames);
  if (scene.threads < 0 || scene.threads > 1024) {
    refuse("threads", std::to_string(scene.threads), "must lie between 0 (all) and 1024");
  }
  check_range("cell_size", scene.cell_size, 1e-5, 1, "m");
  check_range("frame_rate", scene.frame_rate, 1, 2000, "Hz");
  check_range("cfl", scene.cfl, 0.05, 0.9);
  check_range("damping", scene.damping, 0, 1000);
  check_each("gravity", scene.gravity, -1000, 1000, "component", "m/s^2");
  check_options(scene);
  check_range("ground.z", scene.ground.z, -100, 100, "m");
  check_friction("ground.friction", scene.ground.friction);

  std::set<std::string> material_names, body_names, tool_names, anchor_names;
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    check_material(at("materials", i), scene.materials[i], material_names);
    if (scene.method == Method::kPbd && scene.materials[i].toughness > 0) {
      refuse(at("materials", i) + ".toughness", text(scene.materials[i].toughness),
             "must be 0 with method pbd, whose tissue blades cut without a force");
    }
  }
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const Body& body = scene.bodies[i];
    const std::string path = at("bodies", i);
    check_name(path + ".name", body.name, body_names);
    check_enum(path + ".shape", body.shape, kShapeNames);
    check_shape(path, body);
    check_pose(path + ".pose", body.pose);
    check_material_name(path + ".material", scene, body.material);
    check_hollow(path, scene, body);
    check_count(path + ".anchors", body.anchors.size(), kMostAnchors);
    if (body.inclusions.size() > 255) {
      refuse(path + ".inclusions", "a list of " + std::to_string(body.inclusions.size()),
             "a body has at most 255");
    }
    for (std::size_t k = 0; k < body.inclusions.size(); ++k) {
      const std::string inclusion = path + "." + at("inclusions", k);
      check_material_name(inclusion + ".material", scene, body.inclusions[k].material);
      check_region(inclusion + ".region", body.inclusions[k].region);
    }
    for (std::size_t k = 0; k < body.anchors.size(); ++k) {
      const std::string anchor = path + "." + at("anchors", k), &name = body.anchors[k].name;
      check_region(anchor, body.anchors[k]);
      if (name.empty()) continue;
      check_ros_name(anchor + ".name", name);
      check_name(anchor + ".name", name, anchor_names);
    }
  }
  check_fluids(scene);
  for (std::size_t i = 0; i < scene.tools.size(); ++i) {
    check_tool(at("tools", i), scene.tools[i], tool_names);
  }
  for (std::size_t i = 0; i < scene.cameras.size(); ++i) {
    check_camera(at("cameras", i), scene.cameras[i], tool_names);  // topics of both begin so
  }
}

bool has_fluid(const Scene& scene) {
  const auto bleeds = [&scene](const std::string& material) {
    const Material* of = lookup(scene, material);
    return of != nullptr && of->bleeding.flux > 0;
  };
  for (const Body& body : scene.bodies) {
    if (!body.filled.fluid.empty() || bleeds(body.material)) return true;
    for (const Inclusion& part : body.inclusions) {
      if (bleeds(part.material)) return true;
    }
  }
  return !scene.pools.empty() ||
         std::any_of(scene.tools.begin(), scene.tools.end(),
                     [](const Tool& t) { return t.type == ToolType::kIrrigation; });
}

const Material& find_material(const Scene& scene, const std::string& name) {
  if (const Material* m = lookup(scene, name)) return *m;
  refuse("material", quoted(name), "must be one of " + known_materials(scene));
}

const Fluid& find_fluid(const Scene& scene, const std::string& name) {
  check_fluid_name("fluid", scene, name);
  return *lookup_fluid(scene, name);
}

}  // namespace tissue_sim

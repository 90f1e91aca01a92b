#include "scene/scene_text.h"

#include <cmath>
#include <locale>
#include <sstream>

namespace tissue_sim {

std::string text(double value) {
  if (std::isnan(value)) return ".nan";
  if (std::isinf(value)) return value > 0 ? ".inf" : "-.inf";
  std::string digits;
  for (int precision = 15; precision <= 17; ++precision) {
    std::ostringstream out;
    out.imbue(std::locale::classic());  // a node's locale may want a decimal comma
    out.precision(precision);
    out << value;
    digits = out.str();
    std::istringstream in(digits);
    in.imbue(std::locale::classic());
    double back = 0;
    if (in >> back && back == value) break;
  }
  return digits;
}

std::string text(const Vec3& v) {
  return "[" + text(v.x()) + ", " + text(v.y()) + ", " + text(v.z()) + "]";
}

std::vector<std::string> fields_of(Shape shape) {
  switch (shape) {
    case Shape::kBox:
      return {"size"};
    case Shape::kBall:
      return {"radius"};
    case Shape::kEllipsoid:
      return {"radii"};
    case Shape::kCylinder:
      return {"radius", "height"};
    case Shape::kMesh:
      return {"mesh", "scale"};
  }
  return {};
}

std::vector<std::string> fields_of(ToolType type) {
  switch (type) {
    case ToolType::kScalpel:
      return {"blade_length", "blade_width", "blade_thickness", "edge_radius"};
    case ToolType::kProbe:
      return {"radius", "length"};
    case ToolType::kGrasper:
      return {"jaw_length", "jaw_width", "grip_pressure", "cohesion"};
    case ToolType::kBall:
      return {"radius"};
    case ToolType::kPunch:
      return {"radius", "length", "edge_radius"};
    case ToolType::kPlate:
      return {"size", "edge_radius"};
    case ToolType::kSuction:
      return {"radius", "length", "flow"};
    case ToolType::kIrrigation:
      return {"radius", "length", "flow", "fluid"};
    case ToolType::kScissors:
      return {"jaw_length", "blade_width", "blade_thickness", "edge_radius"};
  }
  return {};
}

}  // namespace tissue_sim

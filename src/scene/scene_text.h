// How scene values are spelled, in YAML and in error messages.
#pragma once

#include <string>
#include <vector>

#include "tissue_sim/scene.h"

namespace tissue_sim {

/// The shortest of 15 to 17 digits that reads back as exactly this double; ".nan", ".inf", "-.inf".
std::string text(double value);
/// "[x, y, z]"
std::string text(const Vec3& v);

/// One spelling of an enum's value.
template <class Enum>
struct Spelling {
  Enum value;
  const char* name;
};

inline constexpr Spelling<Method> kMethodNames[] = {
    {Method::kMpm, "mpm"}, {Method::kMls, "mls"}, {Method::kPbd, "pbd"}};
inline constexpr Spelling<Device> kDeviceNames[] = {
    {Device::kAuto, "auto"}, {Device::kCpu, "cpu"}, {Device::kCuda, "cuda"}};
inline constexpr Spelling<Law> kLawNames[] = {{Law::kFixedCorotated, "fixed_corotated"},
                                              {Law::kNeoHookean, "neo_hookean"}};
inline constexpr Spelling<Shape> kShapeNames[] = {{Shape::kBox, "box"},
                                                  {Shape::kBall, "ball"},
                                                  {Shape::kEllipsoid, "ellipsoid"},
                                                  {Shape::kCylinder, "cylinder"},
                                                  {Shape::kMesh, "mesh"}};
inline constexpr Spelling<CameraColours> kCameraColourNames[] = {
    {CameraColours::kTissue, "tissue"},
    {CameraColours::kFragments, "fragments"},
    {CameraColours::kStress, "stress"}};
inline constexpr Spelling<DepthUnit> kDepthUnitNames[] = {{DepthUnit::kMetres, "metres"},
                                                          {DepthUnit::kMillimetres, "millimetres"}};
inline constexpr Spelling<ToolType> kToolTypeNames[] = {
    {ToolType::kScalpel, "scalpel"},  {ToolType::kProbe, "probe"},
    {ToolType::kGrasper, "grasper"},  {ToolType::kBall, "ball"},
    {ToolType::kPunch, "punch"},      {ToolType::kPlate, "plate"},
    {ToolType::kSuction, "suction"},  {ToolType::kIrrigation, "irrigation"},
    {ToolType::kScissors, "scissors"}};

/// The name of an enum's value; nullptr for a value that the enum does not have.
template <class Enum, std::size_t N>
const char* name_of(Enum value, const Spelling<Enum> (&names)[N]) {
  for (const Spelling<Enum>& s : names) {
    if (s.value == value) return s.name;
  }
  return nullptr;
}

/// Finds the value of that name; false where there is none.
template <class Enum, std::size_t N>
bool value_of(const std::string& name, const Spelling<Enum> (&names)[N], Enum& value) {
  for (const Spelling<Enum>& s : names) {
    if (name != s.name) continue;
    value = s.value;
    return true;
  }
  return false;
}

/// "a, b or c"
template <class Enum, std::size_t N>
std::string spellings(const Spelling<Enum> (&names)[N]) {
  std::string list;
  for (std::size_t i = 0; i < N; ++i) {
    list += (i == 0 ? "" : i + 1 == N ? " or " : ", ") + std::string(names[i].name);
  }
  return list;
}

/// The fields that belong to a shape or a tool type only, in the order in which they are written.
std::vector<std::string> fields_of(Shape shape);
std::vector<std::string> fields_of(ToolType type);

}  // namespace tissue_sim

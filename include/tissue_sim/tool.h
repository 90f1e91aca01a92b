// Instruments: what they are and how they move. A tool's frame has its origin at the tip and z
// pointing out of the tip along the shaft (the dVRK convention), so the shaft lies at z < 0. The
// jaws of a grasper open in its x-z plane, about a hinge at z = -jaw_length; closed, they meet at x
// = 0. So do the blades of scissors, whose edges are past that by a quarter of a blade's width when
// they are closed: they cross at x = 0, closed ones beyond their tips, and what is between them
// farther out is whole.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "tissue_sim/types.h"

namespace tissue_sim {

enum class ToolType {
  kScalpel,  ///< cuts where its edge sweeps; its flats push
  kProbe,    ///< a capsule that pushes
  kGrasper,  ///< two jaws that hold what is between them
  kBall,     ///< a ball that pushes; the tip is its lowest place
  kPunch,    ///< a cylinder along z whose flat end, with a rounded rim, pushes
  kPlate,    ///< a rectangular plate across z with rounded edges; the tip is the middle of its face
  kSuction,  ///< a tube along z that takes fluid in at its mouth, which is its tip
  kIrrigation,  ///< a tube along z out of whose mouth fluid comes
  kScissors,    ///< two blades that cut what is between them while they close; else they push
};

/// Whether its jaws, or its blades, open by an angle.
constexpr bool has_jaws(ToolType type) {
  return type == ToolType::kGrasper || type == ToolType::kScissors;
}

/// Whether it has edges that cut.
constexpr bool is_bladed(ToolType type) {
  return type == ToolType::kScalpel || type == ToolType::kScissors;
}

/// An instrument: its shape, and how it acts on tissue. Fields that its type does not name are not
/// read.
struct Tool {
  std::string name = "probe";  ///< a ROS name: letters, digits, '_'; unique in the scene
  ToolType type = ToolType::kProbe;
  double radius = 0.003;        ///< probe: of the capsule; ball; punch: of the cylinder; suction,
                                ///< irrigation: of the tube, whose mouth is as wide [m]
  double length = 0.10;         ///< probe, punch, tubes: of the shaft that touches tissue [m]
  double edge_radius = 0.0005;  ///< punch, plate: of the rounded edge, at most half of what is
                                ///< rounded [m]
  Vec3 size = Vec3(0.05, 0.05, 0.004);  ///< plate: along x, y and z, its face at z = 0 [m]
  double blade_length = 0.025;          ///< scalpel: edge from the tip to the heel, along -z [m]
  double blade_width = 0.006;       ///< scalpel: from the edge to the spine, along -x; scissors: of
                                    ///< each blade, at most jaw_length [m]
  double blade_thickness = 0.0004;  ///< scalpel, scissors: along y [m]
  double blade_edge_radius = 0;     ///< scalpel, scissors: `edge_radius` in a scene; how dull the
                                    ///< edge is, at most half of its thickness [m]
  double jaw_length = 0.015;        ///< grasper, scissors: from the hinge to the tip, along z [m]
  double jaw_width = 0.004;         ///< grasper: of a jaw, half round with a flat face, along y [m]
  double grip_pressure = 3000;      ///< grasper: its jaws close until they press with it [Pa]
  double cohesion = 10000;          ///< grasper: what its teeth hold beside friction [Pa]
  double flow = 1e-5;               ///< suction: at most; irrigation [m^3/s], 1e-9 to 1e-2
  std::string fluid = "saline";     ///< irrigation: a name in Scene::fluids or a preset
  double friction = 0.3;            ///< Coulomb friction against tissue [-], 0 to 2
  /// What cameras see in place of its shapes, of a grasper in place of its handle: a plain path,
  /// file:// or package:// (STL, OBJ, PLY, OFF), in the tool's frame. Empty: the shapes.
  std::string mesh;
  double scale = 1;  ///< of that: 0.001 for a mesh in millimetres
};

/// Where a tool shall be at the end of a frame.
struct ToolRequest {
  Pose pose;  ///< world frame
  /// Between the jaws, from this frame on if given, 0 before [rad]; below 0 squeezes with more: see
  /// tools/grip.h.
  std::optional<double> jaw;
  /// It does not move there from where it was: it is placed, and comes into tissue along its shaft
  /// from where it is free. So does a first pose that is deeper than two cells; others stand there.
  bool placed = false;
  /// What a grasper's jaws press with at most from this frame on, if given [Pa], 1 to 1e7; 0 for
  /// the scene's Tool::grip_pressure.
  std::optional<double> grip_pressure;
};

/// Motion of one tool over one frame: position and jaw linear, orientation slerp between the two.
struct ToolMotion {
  bool present = false;  ///< false until the first pose came: the tool is not in the scene
  Pose begin, end;
  float jaw_begin = 0, jaw_end = 0;  ///< angle between the jaws, 0 closed, 0 to pi [rad]
};

/// What the tissue did to a tool during one frame, at the tool's tip, in world axes.
struct ToolLoad {
  Wrench mean;            ///< mean over the substeps of the frame
  double peak_force = 0;  ///< largest force of a substep [N]
  double grip = 0;        ///< what each jaw presses with, mean over the frame [N] ...
  double grip_area = 0;   ///< ... and on which area of tissue [m^2]
  double jaw_moment = 0;  ///< about the hinge, with which tissue opens each jaw, mean [N m]: times
                          ///< the angle that they close by it is their work
  int points_inside = 0;  ///< of tissue, in the tool by more than contact gives way (0.3 cells,
                          ///< or half of the tool's thinnest), in the last substep ...
  double inside_depth = 0;  ///< ... and how deep the deepest of them lies [m]
};

}  // namespace tissue_sim

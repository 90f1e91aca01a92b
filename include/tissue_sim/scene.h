// Everything that a run needs, as plain data: SI units, defaults. YAML <-> Scene round-trips.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tissue_sim/camera.h"
#include "tissue_sim/fluid.h"
#include "tissue_sim/material.h"
#include "tissue_sim/tool.h"
#include "tissue_sim/types.h"

namespace tissue_sim {

enum class Method {
  kMpm,  ///< material point method
  kMls,  ///< meshless, moving least squares
  kPbd,  ///< position-based dynamics
};
enum class Device { kAuto, kCpu, kCuda };

enum class Shape { kBox, kBall, kEllipsoid, kCylinder, kMesh };

/// A region of the world as it is at time zero.
struct Region {
  enum class Kind { kBox, kBall, kBelow } kind = Kind::kBelow;
  Vec3 min = Vec3::Zero(), max = Vec3::Zero();  ///< kBox [m]
  Vec3 center = Vec3::Zero();                   ///< kBall [m]
  double radius = 0;                            ///< kBall [m]
  double z = 0;                                 ///< kBelow: everything with a smaller z [m]

  bool contains(const Vec3& x) const;
};

/// What holds a body: tissue in the region is held fast, and the body is held at the region's face,
/// exactly there, wherever it lies in a cell. Where the face is the body's own, it is glued there.
/// The anchor moves where Simulation::set_anchor() says, and says what it carries.
struct Anchor : Region {
  std::string name;  ///< a ROS name, unique in the scene, or empty: then nothing can address it

  Anchor() = default;
  Anchor(const Region& region) : Region(region) {}  // NOLINT: an anchor without a name
  /// What its pose is about: the middle of a box or ball, (0, 0, z) below a plane [m].
  Vec3 origin() const;
};

/// A part of a body that is of a material of its own: a tumour, a vessel, a layer of skin.
struct Inclusion {
  std::string material = "liver";  ///< a name in Scene::materials or a preset
  Region region;
};

/// What fills a hollow.
struct Fill {
  std::string fluid;    ///< a name in Scene::fluids or a preset; empty: nothing does
  double pressure = 0;  ///< that it is filled to, over what surrounds it, 0 to 1e5 [Pa]
};

/// A region that is full of fluid at time zero, where there is no tissue.
struct Pool {
  std::string fluid = "water";  ///< a name in Scene::fluids or a preset
  Region region;                ///< a box or a ball
};

/// A piece of tissue as it is at time zero: a shape in its place, of which material, and what holds
/// it.
struct Body {
  std::string name = "tissue";
  Shape shape = Shape::kBox;
  Vec3 size = Vec3(0.08, 0.05, 0.03);    ///< box: edge lengths [m]
  double radius = 0.02;                  ///< ball, cylinder [m]
  Vec3 radii = Vec3(0.03, 0.02, 0.015);  ///< ellipsoid: semi-axes [m]
  double height = 0.04;                  ///< cylinder, along z [m]
  std::string mesh;                ///< mesh: plain path, file:// or package:// (STL, OBJ, PLY)
  double scale = 1.0;              ///< mesh: metres per unit of the file (0.001 for mm)
  Pose pose;                       ///< of the shape's centre; of a mesh's own origin
  std::string material = "liver";  ///< a name in Scene::materials or a preset
  /// A point of the body is of the material of the last of these that holds it, else of `material`;
  /// at most 255, and each must be the last one for a point at least.
  std::vector<Inclusion> inclusions;
  std::vector<Anchor> anchors;  ///< what holds it
  double wall = 0;  ///< if not 0 it is hollow, with a wall so thick: two cells or more [m]
  Fill filled;      ///< of a hollow
};

/// A horizontal plane that carries what falls on it.
struct Ground {
  bool enabled = true;
  double z = 0;           ///< [m]
  double friction = 0.3;  ///< Coulomb [-], 0 to 2
};

/// How the meshless method (`method: mls`) places its nodes.
enum class MlsPlacement {
  kRegular,  ///< on a lattice
  kGraded,   ///< dense at the surface, sparse inside
};

/// How meshless tissue touches tissue; docs/mls.md says what each costs.
enum class MlsContact {
  kNodes,  ///< nodes push one another along the line between them, without friction
  kFaces,  ///< faces touch along their common normal, with friction
};

/// How many nodes the meshless method has, and how they act on one another.
struct MlsOptions {
  double spacing = 0;   ///< between nodes, of graded ones at the surface [m]; 0 for half a cell
  int neighbours = 18;  ///< that a node has within a regular lattice, 14 to 60: sets the supports
  MlsPlacement placement = MlsPlacement::kRegular;
  double grading = 2;          ///< kGraded: spacing deep inside over that at the surface, 1 to 4
  double stabilisation = 0.3;  ///< stiffness of what is not linear in a support, times E, 0 to 1
  MlsContact contact = MlsContact::kNodes;
};

enum class PbdModel {
  kSurface,     ///< triangles, with internal shape-preserving constraints
  kTetrahedra,  ///< tetrahedra
};
enum class PbdElasticity {
  kMaterial,  ///< deviatoric and hydrostatic constraints with the material's E and nu
  kStrain,    ///< stretch and shear strain constraints, with distance and bending: no material
};

/// What it is made of and how it is solved.
struct PbdOptions {
  PbdModel model = PbdModel::kSurface;
  PbdElasticity elasticity = PbdElasticity::kMaterial;  ///< of tetrahedra
  /// Of a frame, 1 to 1000; 0: as many as tetrahedra of a material need, and else 20.
  int steps = 0;
  int iterations = 1;  ///< of a step, 1 to 100
  /// Stiffness of the surface model's constraints as a multiple of what Young's modulus gives each
  /// (src/pbd/surface_model.cpp), 0 to 1e6; 0 leaves the constraint out. `edge` and `bending` are
  /// the kStrain model's, too.
  double edge = 1, bending = 1, internal = 1;
  /// kStrain: share of an error of strain that a projection takes away, 0 to 1.
  double stretch = 1, shear = 1;
};

/// What belongs to one method each: the others do not read it.
struct OptionSets {
  MlsOptions mls;
  PbdOptions pbd;
};

/// What a simulation is built from; fields of a scene file have the same names.
struct Scene : OptionSets {
  std::string name = "tissue";
  Method method = Method::kMpm;
  Device device = Device::kAuto;
  int threads = 0;           ///< CPU threads, 0 for all
  double cell_size = 0.003;  ///< grid spacing [m]; two points a cell along each axis. pbd: edge of
                             ///< the triangles and tetrahedra that the package makes itself
  double frame_rate = 60.0;  ///< frames a second of simulated time [Hz], 1 to 2000
  double cfl = 0.5;      ///< substep * wave speed / cell size, 0.05 to 0.9, of tissue that may be
                         ///< cut or torn at once: up to 0.55 any cut is stable. Substeps are longer
                         ///< where the tissue was measured to bear it; below 0.5 in proportion
  double damping = 0.0;  ///< drag by what surrounds the tissue: speeds decay as
                         ///< exp(-damping t) [1/s], 0 to 1000
  Vec3 gravity = Vec3(0, 0, -9.81);  ///< [m/s^2]
  std::uint64_t seed = 0;
  /// Method mpm: file of a fragment network (scripts/train_fragments) that says each frame which
  /// cells of tissue that tears will part: cracks begin there sooner; `off` for none.
  std::string fragment_network = "off";
  Ground ground;
  std::vector<Material> materials;
  std::vector<Body> bodies;
  std::vector<Tool> tools;
  std::vector<Camera> cameras;  ///< they change nothing but what is seen
  std::vector<Fluid> fluids;
  std::vector<Pool> pools;
  double fluid_spacing = 0;  ///< between particles of fluid [m], at most cell_size; 0 for that
};

/// Whether any is there at time zero, or may come from a tube or a wound. Of a valid scene.
bool has_fluid(const Scene& scene);

/// Throws std::invalid_argument: "<field> is <value>: <what is allowed>".
void validate(const Scene& scene);

/// The material of that name, from the scene or the presets; throws std::invalid_argument.
const Material& find_material(const Scene& scene, const std::string& name);

/// The fluid of that name, likewise.
const Fluid& find_fluid(const Scene& scene, const std::string& name);

/// Reads a scene from YAML text; fields left out keep their defaults. Throws std::invalid_argument
/// naming the field (with its path, as in `bodies[0].size`), its value and what is allowed; unknown
/// fields are refused. Validates.
Scene scene_from_yaml(const std::string& text);
/// Reads a scene file; throws std::invalid_argument with the path in front. A relative mesh path in
/// it is relative to the file's folder, and comes back absolute.
Scene load_scene(const std::string& path);
/// The whole scene as YAML, defaults included; scene_from_yaml(scene_to_yaml(s)) equals s in all
/// fields that belong to each shape and tool type. Throws what validate() throws.
std::string scene_to_yaml(const Scene& scene);

}  // namespace tissue_sim

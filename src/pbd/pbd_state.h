// All that a step of position-based dynamics reads and writes.
#pragma once

#include <array>
#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "compute/array.h"
#include "compute/for_each.h"
#include "geometry/mesh.h"
#include "pbd/constraint_set.h"
#include "pbd/motion.h"
#include "pbd/project.h"
#include "pbd/surface_edges.h"
#include "pbd/tip_contact.h"
#include "pbd/touch.h"
#include "tissue_sim/cut.h"
#include "tissue_sim/scene.h"
#include "tissue_sim/tissue.h"
#include "tools/collider.h"

namespace tissue_sim {
namespace pbd {

/// Vertices behind the last one that lanes without a constraint mean: a tetrahedron for each lane.
constexpr int kPadding = 4 * kLanes;

/// Four floats a vertex. New vertices come last: an index means the same vertex for ever.
struct Vertices {
  Array<float> x;          ///< where they are [m], and 1 / mass [1/kg], 0 where held
  Array<float> moved;      ///< what they moved in a step, and what x has no room for after it [m]
  Array<float> predicted;  ///< `moved` without constraints [m]
  Array<float> v;          ///< [m/s]
  std::vector<Vec3> reference;       ///< [m]
  std::vector<double> mass, volume;  ///< [kg], [m^3]
  std::vector<std::int16_t> body;
  std::vector<std::uint8_t> anchored;
  std::vector<std::uint8_t> surface;                 ///< whether a triangle has it
  std::vector<std::int32_t> cut_links, whole_links;  ///< constraints lost, and had

  int size() const { return static_cast<int>(reference.size()); }
  Vec3 position(int i) const {
    return Vec3(x[4 * i], x[4 * i + 1], x[4 * i + 2]) +
           Vec3(moved[4 * i], moved[4 * i + 1], moved[4 * i + 2]);
  }
  Vec3 velocity(int i) const { return Vec3(v[4 * i], v[4 * i + 1], v[4 * i + 2]); }
};

using Tetrahedron = std::array<std::int32_t, 4>;

/// A vertex pair that an internal shape-preserving constraint joins.
struct InternalPair {
  std::int32_t a, b;  ///< a < b
  double area;        ///< of the column of tissue that it stands for [m^2]
  bool is_late;       ///< found after a cut: joins vertices of one skin only
};

/// A face that two tetrahedra share, and which of their corners lie opposite to it.
struct InnerFace {
  std::int32_t tetrahedron[2];
  std::int8_t opposite[2];
  bool is_cut;
};

/// What an instrument's blade swept in a piece that it left whole: with what it sweeps next the
/// piece is cut along all of it.
struct LeftWhole {
  BladePath path;
  std::int32_t vertex;  ///< one of the piece
};

struct State {
  Scene scene;
  Cpu cpu;
  InstructionSet instructions = instruction_set();
  const Projections* project = &projections(instructions);

  Vertices vertices;
  std::vector<Triangle> triangles;  ///< of the surface, counter-clockwise from outside
  std::vector<std::uint8_t> cut;    ///< of each: whether a cut made it
  std::vector<Tetrahedron> tetrahedra;
  std::vector<std::int16_t> body_of_tetrahedron;

  std::vector<InternalPair> internal;  ///< by a, then b
  std::vector<double> half_depth;      ///< of each vertex: to the middle of the body [m]

  SurfaceEdges surface_edges;     ///< what links and bends are made from
  ConstraintSet<Distance> links;  ///< edges, then internal links
  int edge_count = 0;             ///< of links: those that are edges
  ConstraintSet<Bending> bends;
  ConstraintSet<Strain> strains;          ///< one for each tetrahedron, ...
  ConstraintSet<Elastic> elastics;        ///< ... or these
  ConstraintSet<Touch> touches;           ///< between pieces, of this frame (find_touches.h)
  ConstraintSet<Damper> dampers;          ///< at edges, for `damped_for` (viscosity.h)
  double damped_for = 0;                  ///< [s]; 0 where dampers are to be made
  std::vector<double> volume_of_body;     ///< [m^3]
  std::vector<std::uint8_t> closed_body;  ///< whether the surface that it was made of is closed

  // What cuts remember. Of each vertex: which stroke it lies on (-1: none), where the blade passed
  // there and its normal, in reference space, and the vertex that it is a copy of.
  std::vector<std::int32_t> stroke, copy_of;
  std::vector<Vec3> blade_normal, blade_point;
  std::set<std::array<std::int32_t, 2>> cut_edges;  ///< of the surface, lower vertex first
  /// Of the line that each tool's blade cuts, and of one that a whole path does: the vertices where
  /// it ends now, and those where it began.
  std::vector<std::set<std::int32_t>> fronts, starts;
  std::vector<std::vector<LeftWhole>> left_whole;  ///< by each tool's blade, in the last frame
  /// What blades swept, in reference space: edges (a, b) at the beginning and at the end of a part.
  std::vector<std::array<Vec3, 4>> wounds;
  std::vector<std::int32_t> bare;  ///< vertices that a cut took the internal constraints of
  std::vector<InnerFace> faces;    ///< between tetrahedra
  /// Of each tetrahedron, the shares of its corners in the place that its links lead from: its
  /// centre when it was made. It stays with the tissue when vertices move onto a blade's surface,
  /// so that what a blade parts does not hang on where vertices are.
  std::vector<std::array<double, 4>> centres;
  std::vector<double> relieved_in;  ///< of each body: when waves of its last tear crossed it [s]
  double mean_edge = 0;             ///< of the surface when it was made [m]

  double longest_step = 0;  ///< (tet_steps.cpp) [s]

  std::vector<Collider> colliders;  ///< of this step
  std::vector<AtTip> at_tips;       ///< in this part of a frame

  /// Vertices of a chunk of each level, by which constraints are packed (ConstraintSet): what the
  /// first cache of a processor holds, and its second. Empty on a GPU.
  std::vector<std::int32_t> levels = {4096, 32768};

  // Made anew by pack(): what hangs together, by number.
  std::vector<std::int32_t> component;
  int components = 0;
  std::vector<std::int32_t> group;   ///< of each, the lowest of those that it touches in this frame
  std::vector<std::int32_t> held;    ///< vertices that an anchor holds, ...
  std::vector<std::int32_t> holder;  ///< ... and which of its body's
  std::vector<std::uint8_t> pushed;  ///< of each vertex: whether a collider pushed it in this frame

  explicit State(const Scene& s)
      : scene(s),
        cpu(s.threads),
        fronts(s.tools.size() + 1),
        starts(s.tools.size() + 1),
        left_whole(s.tools.size()) {}
};

/// Adds a vertex at rest; mass and volume come later. Returns its index.
int add_vertex(State& s, Vec3 reference, int body);
/// After vertices or constraints came or went: padding, 1 / mass, colours.
void pack(State& s);

StepNumbers step_numbers(const Scene& scene, float h);
/// How often a step projects all constraints: PbdOptions::iterations, and an even number on a
/// surface that was cut. Every other sweep goes backward. One sweep, or two in the same order, are
/// no symmetric operation, and what follows from velocities that such positions give may grow:
/// slivers and thin pieces shook at metres a second. Forward and backward it cannot (linear theory:
/// with eigenvalues p between 0 and 1 a step multiplies its modes by sqrt(p)).
int sweeps_of_step(const State& s);
/// Advances by one step of `h` seconds; adds what acted on each of the colliders, mean force over
/// the step, to `loads`, which parallels them. Contacts come once, after the last sweep: friction's
/// share is of the whole push.
void step(State& s, float h, std::vector<ColliderLoad>& loads);
/// Projects each constraint once, one colour after the other, or in the opposite order: changes
/// Vertices::moved. `keep`:
/// multipliers grow over the sweeps of a step; else they count as zero.
void project_constraints(State& s, float h, bool keep, bool backward = false);
/// Velocities by each of the dampers once.
void project_dampers(State& s);
/// Vertices of a chunk of each level that constraints are packed by: State::levels, but for few.
std::vector<std::int32_t> levels_of(const State& s);
/// Pushes vertices out of the colliders, with friction; adds what that takes (contact.cpp).
void project_contacts(State& s, float h, std::vector<ColliderLoad>& loads);

/// Of those of the colliders that are tips and go from `begin` to `end`.
std::vector<TipSweep> sweeps_of_tips(const std::vector<Collider>& begin,
                                     const std::vector<Collider>& end);
/// Makes State::at_tips for so many seconds.
void find_at_tips(State& s, const std::vector<TipSweep>& tips, double duration);

/// Makes State::held and State::holder (anchors.cpp).
void find_held(State& s);
/// Gives what anchors hold the velocity that takes it where they are after `duration` [s]; whether
/// any moves, or did.
bool follow_anchors(State& s, Span<const AnchorMotion> anchors, double duration);
/// What tissue does to each anchor, about its origin where it is: what a step of `h` seconds would
/// push what they hold by, were it not held, and its weight.
std::vector<Wrench> anchor_loads(const State& s, Span<const AnchorMotion> anchors, float h);

/// Elastic energy of all constraints that have a compliance [J].
double elastic_energy(State& s);

}  // namespace pbd
}  // namespace tissue_sim

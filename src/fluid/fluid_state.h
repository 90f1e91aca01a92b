// Particles of fluid, what they meet, and how they move: weakly compressible, densities by sums
// over neighbours and walls, so that no volume drifts. docs/fluid.md says why, and how well.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "compute/array.h"
#include "compute/for_each.h"
#include "compute/simd.h"
#include "fluid/particle_steps.h"
#include "tissue_sim/fluid.h"
#include "tissue_sim/types.h"

namespace tissue_sim {

/// Of the spacing, what the kernel reaches.
inline constexpr float kFluidReach = 2.6f;

/// Particles by their number; those beside one another in space are near in it: sort_particles().
struct FluidParticles {
  Array<float> x[3], v[3];         ///< [m], [m/s]
  Array<float> volume;             ///< without pressure [m^3]
  Array<float> pressure;           ///< of the last substep [Pa]
  Array<float> dense;              ///< density then, over that without pressure; 0 before
  std::vector<std::uint8_t> kind;  ///< Scene::fluids
  std::vector<std::uint32_t> id;   ///< for ever
  std::vector<std::int16_t> fill;  ///< which of a scene's fills it came from; -1: of a pool, bled

  int size() const { return static_cast<int>(kind.size()); }
  Vec3 position(int i) const { return {x[0][i], x[1][i], x[2][i]}; }
};

/// Triangles of tissue's surface over an interval: their corners move linearly, nine numbers each.
struct FluidWalls {
  std::vector<float> begin, end;  ///< [m]
  std::vector<float> impulse;  ///< as Tissue::push_surface() takes it, since it was cleared [N s]
  int size() const { return static_cast<int>(end.size() / 9); }
};

/// Numbers beside one another in sums over neighbours and walls.
inline constexpr int kFluidLanes = 16;

/// Who may act on whom, until anything moved too far. Each frame begins without any: so they, and
/// with them the order of sums, are by the state that the frame began with.
struct FluidLists {
  /// Particles of each, itself among them, and, to make kFluidLanes of them, the one behind the
  /// last, which has no volume.
  std::vector<std::int32_t> begin, other;
  /// Triangles of each: up to wall_near those that it may touch before it is listed again, first up
  /// to wall_soon those within kSoon spacings.
  std::vector<std::int32_t> wall_begin, wall_soon, wall_near, wall;
  Array<float> x[3];              ///< particles when they were listed
  std::vector<float> corners;     ///< and triangles
  std::vector<std::int32_t> met;  ///< triangles that are in `wall`
  bool made = false;
};

struct FluidState {
  std::vector<FluidLaw> laws;
  FluidKernel kernel{0};
  float spacing = 0;  ///< [m]
  FluidParticles particles;
  FluidParticles sorted;  ///< room to sort them in
  std::uint32_t next_id = 0;
  FluidLists lists;
  std::vector<std::uint8_t> is_bit;  ///< of each triangle: no wall, of a piece as small as a drop
  Cpu* cpu = nullptr;
  InstructionSet instructions = instruction_set();

  // Of a substep.
  std::vector<WallTriangle> before, now;  ///< walls as an interval begins, and as it ends
  float walls_moved[2] = {};              ///< at most, from where they were listed to there [m]
  Array<float> facing;  ///< of each triangle: its normal, and how far it came along it [m]
  /// Walls of a particle from lists.wall_begin on: triangles that its kernel reaches, and its
  /// integral over each [1/m]; how many there are.
  Array<std::int32_t> seen;
  Array<float> share;
  std::vector<std::int32_t> seen_count;
  /// Where a particle was when they were summed, what share they had, and how far they had come.
  struct Seen {
    float x[3], share, moved;
    std::int32_t is_new;
  };
  std::vector<Seen> seen_at;
  std::vector<FluidClear> clear;
  std::vector<float> wall_impulse;  ///< on triangles, by chunks of particles [N s]
  std::vector<float> viscosity;     ///< of each law, with what keeps jitter down [Pa s]
  Array<float> place;               ///< of each particle, and of none: x, y, z, volume
  Array<float> motion;         ///< likewise its speed, and what its pressure weighs in a pair [Pa]
  Array<float> strength;       ///< and at a wall [N m]
  Array<float> tool_strength;  ///< and at a tool, over what other tools leave [N m]
  Array<float> wall_push;      ///< of each particle: normals of its walls by `share` [1/m], and how
                               ///< far they came
  std::vector<std::uint64_t> near;  ///< which colliders it may meet, as bits
  Array<float> v_next[3];
  std::vector<FluidTouch> touches;
};

/// What moves fluid through an interval.
struct FluidDrive {
  double duration = 0;          ///< [s]
  Vec3 gravity = Vec3::Zero();  ///< [m/s^2]
  double damping = 0;           ///< [1/s]
  /// Tools and ground at a share of the interval.
  std::function<std::vector<Collider>(double)> colliders;
};

/// Of the fastest particle [m/s].
float fastest_of(const FluidParticles& particles);

/// The longest substep that is stable at the fastest particle's speed [s].
double stable_fluid_step(const FluidState& state, float fastest);

/// One of `count` substeps of an interval.
FluidSubstep fluid_substep(const FluidDrive& drive, int count,
                           const std::vector<Collider>& colliders);

/// Advances the fluid; `walls` receive impulses, `loads` what acts on the colliders as the mean
/// over the interval. Returns the number of substeps.
int advance_fluid(FluidState& state, const FluidDrive& drive, FluidWalls& walls,
                  std::vector<ColliderLoad>& loads);

/// Lists anew who may act on whom, with room for `skin` [m], by walls there, which FluidState::now
/// has then.
void list_neighbours(FluidState& state, const std::vector<float>& corners, float skin);

/// Puts particles that are beside one another in space near one another in number, and forgets who
/// may act on whom. Before each frame.
void sort_particles(FluidState& state);

/// Adds a particle. Returns its index.
int add_particle(FluidState& state, const Vec3& x, const Vec3& v, double volume, int kind,
                 int fill);
/// Takes those out for which `gone` says so.
void remove_particles(FluidState& state, const std::vector<std::uint8_t>& gone);

/// Puts particles that lie shallowly behind a triangle before it: after a cut made it.
void push_out_of_walls(FluidState& state, const std::vector<float>& corners);

}  // namespace tissue_sim

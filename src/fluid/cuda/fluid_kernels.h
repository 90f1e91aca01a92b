// Kernels of fluid: what fluid/particle_steps.h says, a team of threads a particle where it sums.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compute/device_array.h"
#include "fluid/particle_steps.h"

namespace tissue_sim {

/// In which loads on colliders are summed up, so that the order does not count [N, N m].
inline constexpr double kFluidLoadUnit = 1.0 / (1ll << 38);
inline constexpr int kFluidLoadSums = 6;

/// The largest since cleared, of numbers that are not negative, as bits; and how many particles
/// walls may be in the way of.
struct FluidMost {
  unsigned speed2;           ///< of a particle [m^2/s^2]
  unsigned moved2;           ///< of a particle, since it was listed [m^2]
  unsigned walls_moved2[2];  ///< of corners, as an interval begins and ends, since listed [m^2]
  int yielded, moved;        ///< of them, as walls came, and as they move themselves
};

/// Places of particles in a grid of cells.
struct FluidGrid {
  float low[3], edge;
  int size[3];
  std::int32_t* begin;         ///< of each cell in `sorted`, and of none
  const std::int32_t* sorted;  ///< particles
  float4* place;               ///< as sorted

  TISSUE_SIM_HOST_DEVICE int cells() const { return size[0] * size[1] * size[2]; }
};

/// The arrays of a substep on the GPU. Walls of a particle are entries of lists.wall from
/// wall_begin on; those of a triangle are entries of `pair`, from pair_begin on.
struct FluidOnGpu : FluidView {
  const std::int32_t *begin, *other;  ///< particles of each
  float4* place;                      ///< and volume
  const float* viscosity;             ///< of laws, with what keeps jitter down [Pa s]
  std::int32_t* met;                  ///< those that walls may be in the way of
  int entries;                        ///< of walls
  const std::int32_t* wall_of;        ///< the particle of each
  float* share;                       ///< kernel's integral over its triangle [1/m]
  float4* seen;                       ///< that along its normal, and what it takes of the kernel
  int triangles;
  const std::int32_t* pair_begin;
  const std::int32_t* pair_particle;
  const std::int32_t* pair_entry;
  float* impulse;  ///< on each corner of a triangle, three numbers a triangle [N s]
  unsigned long long*
      touched;  ///< on a triangle by touches since the interval began [kImpulseUnit]
  FluidMost* most;
};

/// Which walls are listed: with room for `skin` [m].
struct FluidWallReach {
  float reach, near, soon;  ///< [m]
  const std::uint8_t* is_bit;
};

/// A box around all particles: low, then high.
void launch_fluid_bounds(const FluidView& view, float* box, cudaStream_t stream);
/// Of each particle the cell, and its own number.
void launch_fluid_cells(const FluidView& view, const FluidGrid& grid, std::uint32_t* cell,
                        std::int32_t* number, cudaStream_t stream);
/// Sorts `count` pairs by the lower `bits` of their keys. With memory null it says how much it
/// wants.
void launch_fluid_sort(const std::uint32_t* key, std::uint32_t* sorted_key,
                       const std::int32_t* value, std::int32_t* sorted_value, int count, int bits,
                       void* memory, std::size_t& bytes, cudaStream_t stream);
/// Sums of what comes before, `count` of them. Likewise.
void launch_fluid_scan(const std::int32_t* of, std::int32_t* before, int count, void* memory,
                       std::size_t& bytes, cudaStream_t stream);
/// Where cells begin, and places as sorted.
void launch_fluid_grid(const FluidView& view, const FluidGrid& grid,
                       const std::uint32_t* sorted_cell, cudaStream_t stream);
/// Counts neighbours within `reach` into `counts`; with `other`, lists them from `begin` on.
void launch_fluid_neighbours(const FluidView& view, const FluidGrid& grid, float reach,
                             std::int32_t* counts, const std::int32_t* begin, std::int32_t* other,
                             cudaStream_t stream);
/// Puts all triangles where `corners` have them, or those that have pairs.
void launch_fluid_triangles(const float* corners, int triangles, const std::int32_t* pair_begin,
                            WallTriangle* to, cudaStream_t stream);
/// Counts particles near each triangle; with `key`, lists them from `begin` on: four times the
/// particle, and how near.
void launch_fluid_pairs(const FluidView& view, const FluidGrid& grid, const FluidWallReach& reach,
                        int triangles, std::int32_t* counts, const std::int32_t* begin,
                        std::uint32_t* key, std::int32_t* number, std::int32_t* triangle,
                        std::int32_t* particle, cudaStream_t stream);
/// Entries of particles from pairs as sorted.
void launch_fluid_entries(int particles, int pairs, const std::uint32_t* sorted_key,
                          const std::int32_t* sorted_pair, const std::int32_t* triangle,
                          std::int32_t* wall_begin, std::int32_t* wall_soon,
                          std::int32_t* wall_near, std::int32_t* wall, std::int32_t* wall_of,
                          std::int32_t* pair_entry, cudaStream_t stream);
/// FluidMost::walls_moved2[end], of corners that are not of bits.
void launch_fluid_walls_moved(const float* corners, const float* listed, int triangles,
                              const std::uint8_t* is_bit, unsigned* most, cudaStream_t stream);
/// fluid::yield_to_walls(). FluidMost is clear, then and before each substep that is not the first.
void launch_fluid_yield(const FluidOnGpu& fluid, float time, cudaStream_t stream);
/// `is_last`: of the interval.
void launch_fluid_substep(const FluidOnGpu& fluid, const FluidSubstep& step, bool is_last,
                          unsigned long long* loads, cudaStream_t stream);
void launch_fluid_leave(const FluidOnGpu& fluid, cudaStream_t stream);

}  // namespace tissue_sim

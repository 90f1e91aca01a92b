// Sums over a particle's neighbours, and over the walls near it, sixteen at a time: the same bits
// with any instructions.
#pragma once

#include "fluid/fluid_state.h"

#if defined(__x86_64__)
// Without TISSUE_SIM_TARGET_*, with which the compiler fuses products and sums: fluid has the same
// bits with any instructions.
#define TISSUE_SIM_UNFUSED_AVX2 __attribute__((target("avx2")))
#if defined(__clang__)
#define TISSUE_SIM_UNFUSED_AVX512 __attribute__((target("avx512f,avx512dq,avx512vl,avx512bw")))
#else
#define TISSUE_SIM_UNFUSED_AVX512 \
  __attribute__((target("avx512f,avx512dq,avx512vl,avx512bw"), optimize("fp-contract=off")))
#endif
#endif

namespace tissue_sim {

/// Of volumes by the kernel, the particle's own among them [1].
float neighbour_volume(const FluidState& state, int i);

/// Adds what pressure and viscosity of its neighbours do to a particle [N].
void add_pair_forces(const FluidState& state, int i, float* force);

/// Share of a particle's kernel that the triangles of its list enclose, as they are in state.now:
/// summed where it or they moved far since it last was, else by its slope from there. Of each
/// triangle the kernel's integral over it goes to state.share, the sum of their normals by that to
/// state.wall_push [1/m].
float wall_share(FluidState& state, int i);

}  // namespace tissue_sim

// Where friction holds points on tools and the ground, as a list of the few that touch: for
// checkpoints.
#pragma once

#include <cuda_runtime_api.h>
#include <vector_types.h>

#include <cstddef>
#include <cstdint>

namespace tissue_sim {

/// An entry of CudaTables::with and ::hold.
struct HeldPoint {
  std::int32_t entry;
  std::uint8_t with;
  float hold[4];
};

/// Lists the entries of `with` that are not 0, in any order; `count`, one number, becomes how many
/// there are, of which the list has room for `most`.
void launch_list_held(const std::uint8_t* with, const float4* hold, int entries, HeldPoint* held,
                      int most, int* count, cudaStream_t stream);
/// Makes these `count` entries of `with`, all others 0 before, what they were.
void launch_hold_again(const HeldPoint* held, int count, std::uint8_t* with, float4* hold,
                       cudaStream_t stream);

}  // namespace tissue_sim

// Rows of the meshless method.
#pragma once

namespace tissue_sim {

/// Registers `mls/cpu/N` and what belongs to them with Google Benchmark.
void add_mls_rows();

/// Those on the GPU: `mls/cuda/N`.
void add_mls_cuda_rows();

}  // namespace tissue_sim

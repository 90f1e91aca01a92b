// Rows of position-based dynamics.
#pragma once

namespace tissue_sim {

/// Registers `pbd/cpu/...` with Google Benchmark: an item is one constraint projected.
void add_pbd_rows();
/// And `pbd/cuda/...`.
void add_pbd_cuda_rows();

}  // namespace tissue_sim

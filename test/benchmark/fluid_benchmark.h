// Rows of fluid.
#pragma once

namespace tissue_sim {

/// Registers `fluid/...` with Google Benchmark: an item is a frame.
void add_fluid_rows();
void add_fluid_cuda_rows();

}  // namespace tissue_sim

// Rows of fluid.
#pragma once

namespace tissue_sim {

/// Registers `fluid/...` with Google Benchmark: an item is a frame.
void add_fluid_rows();

}  // namespace tissue_sim

// A block of liver under instruments on the GPU, as a user runs it: how fast beside real time.
#pragma once

namespace tissue_sim {

/// Registers the rows mpm/cuda/liver/.
void add_liver_benchmarks();

}  // namespace tissue_sim

// Rows of the meshless method.
#pragma once

namespace tissue_sim {

/// Registers `mls/cpu/N` and what belongs to them with Google Benchmark.
void add_mls_rows();

}  // namespace tissue_sim

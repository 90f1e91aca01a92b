// Organs under instruments as a user runs them, by the public API: how long a frame takes, and how
// fast that is beside real time. The same rows on a CPU and on a GPU.
#pragma once

#include <string>

#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// Registers the rows mpm/<cpu or cuda>/ellipsoid/ and liver/; `label` says how a tissue is run.
void add_organ_benchmarks(Device device, std::string (*label)(const Tissue&));

}  // namespace tissue_sim

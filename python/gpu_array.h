// Arrays in a GPU's memory, for libraries that read them there.
#pragma once

#include <pybind11/pybind11.h>

#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// The class of a field of points in GPU memory, which PyTorch, JAX and CuPy read by DLPack.
void bind_gpu_array(pybind11::module& module);
/// Its arrays by name, each with every byte of `points` kept. `selection` is what was read.
pybind11::dict gpu_arrays(const GpuPoints& points, const PointSelection& selection);

}  // namespace tissue_sim

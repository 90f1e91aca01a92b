// Tissue by the material point method on a GPU, with what tests look at of it.
#pragma once

#include <string>
#include <vector>

#include "compute/cuda_check.h"
#include "mpm/cuda/cuda_device.h"
#include "mpm/cuda/on_device.h"
#include "mpm/mpm_tissue.h"

namespace tissue_sim {

inline CudaTissue& on_gpu(const MpmTissue& tissue) {
  return dynamic_cast<CudaMpmDevice&>(tissue.device()).tissue();
}

class CudaMpmTissue final : public MpmTissue {
 public:
  explicit CudaMpmTissue(const Scene& scene) : MpmTissue(scene, {}, make_cuda_mpm_device) {}
  void pull() { tissue_sim::pull(on_gpu(*this)); }  ///< nodes and contacts from the GPU
  void push() { tissue_sim::push(on_gpu(*this)); }  ///< everything but contacts to the GPU
  /// Lists of facets that may touch are made anew before the next substep.
  void search_anew() { tissue_sim::search_anew(on_gpu(*this)); }
  std::vector<std::vector<std::int32_t>> near_facets() const {
    return tissue_sim::near_facets(on_gpu(*this));
  }
  std::size_t device_bytes() const { return tissue_sim::device_bytes(on_gpu(*this)); }
  std::string plan() const { return tissue_sim::plan(on_gpu(*this)); }
};

}  // namespace tissue_sim

// Tissue by the material point method on a GPU, with what tests look at of it.
#pragma once

#include <string>
#include <vector>

#include "compute/cuda_check.h"
#include "mpm/cuda/on_device.h"
#include "mpm/mpm_tissue.h"

namespace tissue_sim {

inline CudaTissue& on_gpu(const MpmTissue& tissue) {
  return dynamic_cast<CudaTissue&>(tissue.device());
}

/// Nodes and contacts from the GPU.
inline void pull(CudaTissue& d) {
  pull_nodes(d);
  pull_contacts(d);
}

/// Shape of the blocks, threads.
inline std::string plan(const CudaTissue& d) {
  const BlockShape& b = d.shape.blocks;
  return std::to_string(b.x) + " x " + std::to_string(b.y) + " x " + std::to_string(b.z) +
         " cells, " + std::to_string(d.plan.threads) + " a block, " +
         std::to_string(d.blocks.size()) + " blocks in " + std::to_string(d.bundles.size()) +
         " bundles, " + std::to_string(d.plan.resident) + " at once" +
         (d.plan.cached ? ", cached" : "");
}

/// Of each facet, those that it may touch, as of the last search.
inline std::vector<std::vector<std::int32_t>> near_facets(const CudaTissue& d) {
  const FacesOnDevice& f = d.faces;
  const std::size_t count = f.facets.size();
  std::vector<std::int32_t> first(count), size(count), near(f.host_figures[0].near);
  f.first_near.download(first.data(), count, d.stream);
  f.near_count.download(size.data(), count, d.stream);
  f.near.download(near.data(), near.size(), d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "send contacts");
  std::vector<std::vector<std::int32_t>> lists(count);
  for (std::size_t i = 0; i < count; ++i) {
    lists[i].assign(near.begin() + first[i], near.begin() + first[i] + size[i]);
  }
  return lists;
}

class CudaMpmTissue final : public MpmTissue {
 public:
  explicit CudaMpmTissue(const Scene& scene) : MpmTissue(scene, {}, make_cuda_mpm_device) {}
  void pull() { tissue_sim::pull(on_gpu(*this)); }
  void push() { tissue_sim::push(on_gpu(*this)); }  ///< everything but contacts to the GPU
  /// Lists of facets that may touch are made anew before the next substep.
  void search_anew() { tissue_sim::search_anew(on_gpu(*this)); }
  std::vector<std::vector<std::int32_t>> near_facets() const {
    return tissue_sim::near_facets(on_gpu(*this));
  }
  std::size_t device_bytes() const { return device_bytes_held; }
  std::string plan() const { return tissue_sim::plan(on_gpu(*this)); }
};

}  // namespace tissue_sim

#include <stdexcept>

#include "mpm/mpm_tissue.h"
#include "tissue_sim/tissue.h"
#if defined(TISSUE_SIM_CUDA)
#include "compute/cuda_check.h"
#include "mpm/cuda/cuda_mpm_tissue.h"
#endif

namespace tissue_sim {

std::unique_ptr<Tissue> make_tissue(const Scene& scene) {
  std::vector<std::string> notes;
#if defined(TISSUE_SIM_CUDA)
  if (scene.device == Device::kCuda) return std::make_unique<CudaMpmTissue>(scene);
  if (scene.device == Device::kAuto) {
    try {
      return std::make_unique<CudaMpmTissue>(scene);
    } catch (const std::runtime_error& e) {
      notes.push_back(std::string("runs on the CPU: ") + e.what());
    }
  }
#else
  if (scene.device == Device::kCuda) {
    throw std::runtime_error(
        "device is cuda: this build has no GPU backend, for it was built without nvcc; set device "
        "to auto or cpu");
  }
#endif
  return std::make_unique<MpmTissue>(scene, notes);
}

}  // namespace tissue_sim

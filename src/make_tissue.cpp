#include <stdexcept>

#include "mpm/mpm_tissue.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

std::unique_ptr<Tissue> make_tissue(const Scene& scene) {
  if (scene.device == Device::kCuda) {
    throw std::runtime_error(
        "device is cuda: this build has no GPU backend yet; set device to auto or cpu");
  }
  return std::make_unique<MpmTissue>(scene);
}

}  // namespace tissue_sim

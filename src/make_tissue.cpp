#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "fluid/tissue_with_fluid.h"
#include "geometry/overlap.h"
#include "mls/tissue.h"
#include "mpm/mpm_tissue.h"
#include "pbd/pbd_tissue.h"
#include "scene/scene_text.h"
#include "tissue_sim/tissue.h"
#if defined(TISSUE_SIM_CUDA)
#include "mls/cuda/cuda_mls_tissue.h"
#include "pbd/cuda/cuda_pbd_tissue.h"
#endif

namespace tissue_sim {
namespace {

using Notes = std::vector<std::string>;

/// Makes a tissue; its first notes are those given. Throws std::runtime_error where the device is
/// not there.
using Make = std::unique_ptr<Tissue> (*)(const Scene&, Notes);

template <class T>
std::unique_ptr<Tissue> make(const Scene& scene, Notes notes) {
  return std::make_unique<T>(scene, std::move(notes));
}

#if defined(TISSUE_SIM_CUDA)
std::unique_ptr<Tissue> make_mpm_on_gpu(const Scene& scene, Notes notes) {
  return std::make_unique<MpmTissue>(scene, std::move(notes), make_cuda_mpm_device);
}
#endif

/// A method's tissue on each device; null where there is none in this build.
struct Makers {
  Method method;
  Make on_cpu, on_gpu;
};

constexpr Makers kMakers[] = {
#if defined(TISSUE_SIM_CUDA)
    {Method::kMpm, make<MpmTissue>, make_mpm_on_gpu},
    {Method::kMls, make<MlsTissue>, make<CudaMlsTissue>},
    {Method::kPbd, make<PbdTissue>, make<CudaPbdTissue>},
#else
    {Method::kMpm, make<MpmTissue>, nullptr},
    {Method::kMls, make<MlsTissue>, nullptr},
    {Method::kPbd, make<PbdTissue>, nullptr},
#endif
};

std::unique_ptr<Tissue> make_on_cpu(const Makers& of, const Scene& scene, Notes notes) {
  if (!has_fluid(scene)) return of.on_cpu(scene, std::move(notes));
  return std::make_unique<TissueWithFluid>(scene, std::move(notes), of.on_cpu);
}

std::unique_ptr<Tissue> make_on_gpu(const Makers& of, const Scene& scene, Notes notes) {
#if defined(TISSUE_SIM_CUDA)
  if (has_fluid(scene)) {
    return std::make_unique<TissueWithFluid>(scene, std::move(notes), of.on_gpu,
                                             make_fluid_on_gpu());
  }
#endif
  return of.on_gpu(scene, std::move(notes));
}

/// Soft tissue has kPa: less than a tenth of one was hardly meant in Pa.
void note_units(const Scene& scene, Notes& notes) {
  constexpr double kSoftest = 100;  // [Pa]; brain has some 500
  const auto check = [&](const std::string& name) {
    const double modulus = find_material(scene, name).young_modulus;
    if (modulus >= kSoftest) return;
    const std::string note = "material '" + name + "' has a young_modulus of " + text(modulus) +
                             " Pa, softer than any organ: if kPa were meant, it is " +
                             text(1e3 * modulus);
    if (std::find(notes.begin(), notes.end(), note) == notes.end()) notes.push_back(note);
  };
  for (const Body& body : scene.bodies) {
    check(body.material);
    for (const Inclusion& part : body.inclusions) check(part.material);
  }
}

}  // namespace

std::unique_ptr<Tissue> make_tissue(const Scene& scene) {
  const Makers* of = std::find_if(std::begin(kMakers), std::end(kMakers),
                                  [&](const Makers& m) { return m.method == scene.method; });
  if (of == std::end(kMakers)) throw std::invalid_argument("method is not in this build");
  Notes notes = overlap_notes(scene);
  note_units(scene, notes);
  if (scene.device == Device::kCpu) return make_on_cpu(*of, scene, notes);
  if (of->on_gpu == nullptr) {
    if (scene.device == Device::kAuto) return make_on_cpu(*of, scene, notes);
    throw std::runtime_error(
        "device is cuda: this build has no GPU backend for the scene's method; set device to auto "
        "or cpu, or build where nvcc is found");
  }
  try {
    return make_on_gpu(*of, scene, notes);
  } catch (const std::runtime_error& e) {
    if (scene.device == Device::kCuda) throw;
    notes.push_back(std::string("runs on the CPU: ") + e.what());
  }
  return make_on_cpu(*of, scene, notes);
}

}  // namespace tissue_sim

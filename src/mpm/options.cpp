#include "mpm/options.h"

namespace tissue_sim {
namespace {

std::vector<Option> list_mpm(OptionSets&) { return {}; }

Spacing mpm_spacing(const Scene& scene) { return {scene.cell_size, "cell_size", scene.cell_size}; }

}  // namespace

const MethodOptions kMpmOptions = {
    Method::kMpm, list_mpm, mpm_spacing, true, 4.5, 0.5, [](const Body&) { return false; }};

}  // namespace tissue_sim

#include "mpm/options.h"

namespace tissue_sim {
namespace {

constexpr Spelling<MpmBoundary> kMpmBoundaries[] = {{MpmBoundary::kSurface, "surface"},
                                                    {MpmBoundary::kLattice, "lattice"}};

std::vector<Option> list_mpm(OptionSets& options) {
  return {choice("boundary",
                 "where tools, the ground, anchors and the ends of cuts act: at the body's true "
                 "surface, or at points and nodes, up to half a cell off",
                 options.mpm.boundary, kMpmBoundaries)};
}

Spacing mpm_spacing(const Scene& scene) { return {scene.cell_size, "cell_size", scene.cell_size}; }

}  // namespace

const MethodOptions kMpmOptions = {Method::kMpm, list_mpm, mpm_spacing, true, true};

}  // namespace tissue_sim

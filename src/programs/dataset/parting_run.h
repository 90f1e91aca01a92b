// What is learnt of bonds: whether the truth, with finer cells, parts where a coarse run is
// strained.
#pragma once

#include "programs/dataset/dataset_run.h"

namespace tissue_sim {

/// Samples of one scene, in order of time: cells of the coarse run (FragmentCandidates) across
/// which bonds hold along the axis nearest to their largest stretch. A sample is torn where most of
/// the material's lines along that axis through the cell and half of either neighbour are.
struct PartingSamples {
  std::vector<float> x;  ///< [n, parting::kEnd]
  /// [n, 1 + truths]: torn `horizon` later (0 or 1) in the coarse run itself, and in each truth;
  /// kUnknown where the truth was crushed before.
  std::vector<std::uint8_t> torn;
  int frames = 0;   ///< of the coarse run
  int crushed = 0;  ///< truths that were
};
inline constexpr std::uint8_t kUnknown = 255;

/// How many times finer truth number `truth` of a scene is: within 5 % of `level`, so that its
/// lattice lies otherwise against the tissue.
double jittered(const DatasetScene& scene, int level, int truth);

PartingSamples run_parting_scene(const DatasetScene& scene, const DatasetOptions& options,
                                 int truths);

}  // namespace tissue_sim

// Runs of a scene that tears, and what is learnt from them.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "mpm/mpm_tissue.h"
#include "programs/dataset/dataset_scene.h"

namespace tissue_sim {

/// What is asked for.
struct DatasetOptions {
  int frames = 40;      ///< of each run
  int horizon = 8;      ///< frames ahead that labels are for
  int per_frame = 100;  ///< samples of a frame at most
  int level = 3;        ///< how many times finer truths are
  int truths = 1;       ///< how many: see jittered()
};

/// Samples of one scene, in order of time: cells of the coarse run (FragmentCandidates) across
/// which bonds hold along the axis nearest to their largest stretch. A sample is torn where most of
/// the material's lines along that axis through the cell and half of either neighbour are.
struct DatasetSamples {
  std::vector<float> x;  ///< [n, kPartingFeatureCount]: fragments/features.h
  /// [n, 1 + truths]: torn `horizon` later (0 or 1) in the coarse run itself, and in each truth;
  /// kUnknown where the truth was crushed before.
  std::vector<std::uint8_t> torn;
  int frames = 0;   ///< of the coarse run
  int crushed = 0;  ///< truths that were
};
inline constexpr std::uint8_t kUnknown = 255;

/// A tissue of the scene, `level` times finer, that was set going.
std::unique_ptr<MpmTissue> begin_run(const DatasetScene& scene, double level);

/// One frame on, with the scene's cuts in the first; false where it blew up or was crushed.
bool advance_frame(MpmTissue& tissue, const DatasetScene& scene, int frame,
                   FrameResult* result = nullptr);

/// A fragment is a loose piece of at least half a coarse cell and at most 0.4 of all bodies: of two
/// halves it would be chance which is one.
/// Returns which pieces are, by id.
std::vector<std::uint8_t> fragments_of(const MpmTissue& tissue, double coarse_cell);

/// How many times finer truth number `truth` of a scene is: within 5 % of `level`, so that its
/// lattice lies otherwise against the tissue.
double jittered(const DatasetScene& scene, int level, int truth);

/// Runs the scene and its truths. What the coarse run shows is labelled by what they come to.
DatasetSamples run_dataset_scene(const DatasetScene& scene, const DatasetOptions& options);

}  // namespace tissue_sim

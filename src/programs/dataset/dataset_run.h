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
  int level = 3;        ///< how many times finer the truth is
};

/// Samples of one scene, in order of time: groups of points (FragmentCandidates).
struct DatasetSamples {
  std::vector<float> x;  ///< [n, 101]: fragments/features.h
  std::vector<std::uint8_t>
      q;                  ///< [n]: most of it is part of a fragment `horizon` later, in the truth
  std::vector<float> df;  ///< [n, 9]: F then, in the truth, less that of the cell now
  std::vector<std::uint8_t> plain;  ///< [n]: part of a fragment then, in the coarse run itself
  std::vector<float> about;         ///< [n, 3]: frame, tear_stretch, cell size [m]
  double coarse_loose = 0, true_loose = 0;  ///< share of the volume that came loose
  int coarse_points = 0, true_points = 0;
  int frames = 0;        ///< of the truth
  bool blew_up = false;  ///< one of the runs, which ended there
};

/// A tissue of the scene, `level` times finer, that was set going.
std::unique_ptr<MpmTissue> begin_run(const DatasetScene& scene, double level);

/// One frame on, with the scene's cuts in the first; false where it blew up or was crushed.
bool advance_frame(MpmTissue& tissue, const DatasetScene& scene, int frame,
                   FrameResult* result = nullptr);

/// A fragment is a loose piece of at least half a coarse cell and at most 0.4 of all bodies: of two
/// halves it would be chance which is one.
/// Returns which pieces are, by id.
std::vector<std::uint8_t> fragments_of(const MpmTissue& tissue, double coarse_cell);

/// The points of a finer run within each of a coarse one's, by reference place.
std::vector<std::vector<std::int32_t>> children(const MpmState& coarse, const MpmState& fine);

/// Runs the scene twice. What the coarse run shows is labelled by what the truth comes to.
DatasetSamples run_dataset_scene(const DatasetScene& scene, const DatasetOptions& options);

}  // namespace tissue_sim

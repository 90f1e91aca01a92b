// How a run of a scene that tears comes out: for the convergence of the truth, and for what the
// fragment network is worth beside other ways to the same time.
#pragma once

#include <string>
#include <vector>

#include "programs/dataset/dataset_run.h"

namespace tissue_sim {

/// What a run is done by.
struct RunKind {
  std::string name;     ///< plain, stretch, logistic, network, finer, truth, truth2, truth3
  double level = 1;     ///< how many times finer its cells are
  std::string network;  ///< file of the fragment network, empty for none
  PartingClassifier classifier;  ///< in the place of the network's, if any
};

/// What the ways that are compared with the truth are made of.
struct ComparedRuns {
  std::string network;    ///< its file
  std::string baselines;  ///< what scripts/train_fragments --baselines wrote
  int level = 3;          ///< of the truth
};

/// The plain coarse run; with a threshold on the largest principal stretch as the classifier,
/// logistic regression, and the network; cells half as large; three truths whose lattices lie
/// otherwise against the tissue. Throws
/// std::invalid_argument for a file that is not what it must be.
std::vector<RunKind> compared_runs(const ComparedRuns& of);

struct Outcome {
  int points = 0;
  int expected = 0;           ///< points to part, summed over frames
  std::vector<double> sizes;  ///< of the fragments at the end, as shares of all, largest first
  double first_time = -1;     ///< when the first came off [s]
  double peak_speed = 0;      ///< of a fragment's centre, ever [m/s]
  double peak_spin = 0;       ///< of a fragment, ever [1/s]
  double momentum_drift = 0;  ///< largest change, over the mass times the speed at first [-]
  double angular_drift = 0;   ///< the same, times the body's extent [-]
  double energy_rise = 0;     ///< most energy over that at first, less 1 [-]
  double seconds = 0;         ///< of the processor
  bool blew_up = false;       ///< or was crushed; it ended there
  std::vector<float> cloud;   ///< [points, 4] at the end: place [m], and which fragment, 0 none
};

/// Drifts are 0 where ground or anchors take momentum up.
Outcome run_outcome(const DatasetScene& scene, const RunKind& kind, int frames);

/// The columns of a table of outcomes, and a line of it.
extern const char* const kOutcomeColumns;
std::string outcome_line(const DatasetScene& scene, const RunKind& kind, const Outcome& outcome);

}  // namespace tissue_sim

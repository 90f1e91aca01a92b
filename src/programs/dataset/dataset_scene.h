// Scenes that tear, drawn by seed: what the fragment network learns from.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tissue_sim/cut.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

/// A body that gets going at once and is torn by its own motion: no tool has to be in the way of
/// what flies. Cells are those of the coarse run; the truth has finer ones and the same all else.
struct DatasetScene {
  int index = 0;
  std::string kind;                           ///< one of dataset_kinds()
  Scene scene;                                ///< of the coarse run
  std::function<Vec3(const Vec3&)> velocity;  ///< at first, by reference place [m/s]
  std::vector<BladePath> cuts;                ///< at first
  double speed = 0;                           ///< over what the limit's strain bears [-]
  std::uint64_t seed = 0;                     ///< of the draw among its samples
};

/// The names of all kinds.
const std::vector<std::string>& dataset_kinds();

/// Scene `index` of a seed: always the same, whatever else is run. `kinds` are gone through in
/// turn.
DatasetScene make_dataset_scene(std::uint64_t seed, int index,
                                const std::vector<std::string>& kinds);

/// The scene with cells `level` times finer.
Scene finer(const DatasetScene& scene, double level);

}  // namespace tissue_sim

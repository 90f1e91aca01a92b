// RayScene: which triangle rays meet first, by Embree.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "compute/for_each.h"
#include "tissue_sim/types.h"

namespace tissue_sim {

class RayScene {
 public:
  static constexpr int kPacket = 4;  ///< rays that are followed side by side

  struct Met {
    std::int32_t triangle = -1;  ///< -1 for none
    float t = 0;                 ///< where, in lengths of the ray's direction
    float u = 0, v = 0;          ///< weights of the triangle's second and third corner
  };

  /// Whether this build has Embree.
  static bool is_built();

  /// Throws std::runtime_error without Embree, or where this processor is too old for it.
  RayScene();
  ~RayScene();
  /// Nine coordinates a triangle [m]; copied.
  void set(const std::vector<float>& corners, Cpu& cpu);
  /// About all triangles, of which there is one at least.
  Box box() const;
  /// kPacket rays from `from`, each along its direction, from t = near to far. Thread-safe.
  void meet(const Vec3& from, const Vec3* along, double near, double far, Met* met) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tissue_sim

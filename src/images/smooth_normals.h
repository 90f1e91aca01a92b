// Normals of a surface's corners: smooth where it is smooth, sharp at the edge of a cut.
#pragma once

#include <cstdint>
#include <vector>

#include "tissue_sim/tissue.h"

namespace tissue_sim {

class SmoothNormals {
 public:
  /// Three numbers a corner, of length 1, in world axes; valid until the next call. Which corners
  /// meet is found anew only where the surface is of other triangles than the last one.
  const std::vector<float>& of(const SurfaceTriangles& surface);

 private:
  void group(const SurfaceTriangles& surface);

  std::vector<float> rest_;             // of the last surface
  std::vector<std::int32_t> fragment_;  // the same
  std::vector<std::uint8_t> cut_;
  std::vector<std::int32_t> corners_;  // by group
  std::vector<std::int32_t> begin_;    // of each group in `corners_`
  std::vector<float> faces_, normals_;
};

}  // namespace tissue_sim

// What a surface's corners have of the triangles that meet there: normals, smooth where it is
// smooth and sharp at the edge of a cut, and means.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/for_each.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

class SmoothNormals {
 public:
  /// Three numbers a corner, of length 1, in world axes; valid until the next call. Which corners
  /// meet is found anew only where the surface is of other triangles than the last one.
  const std::vector<float>& of(const SurfaceTriangles& surface, Cpu& cpu);
  /// Of each corner the mean of what the triangles that meet there have, of the last surface.
  std::vector<float> means(const std::vector<float>& of_triangle) const;

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

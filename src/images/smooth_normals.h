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
  /// Replaces `normals`: three numbers a corner, of length 1, in world axes. Which corners meet is
  /// found anew only where the surface is of other triangles than the last one.
  void put(const SurfaceTriangles& surface, Cpu& cpu, std::vector<float>& normals);
  /// Of each corner the mean of what the triangles that meet there have, of the last surface.
  std::vector<float> means(const std::vector<float>& of_triangle) const;

 private:
  void group(const SurfaceTriangles& surface);

  std::uint64_t made_ = 0;             // of the last surface
  std::vector<std::int32_t> corners_;  // by group
  std::vector<std::int32_t> begin_;    // of each group in `corners_`
  std::vector<float> faces_;           // four numbers each: normal, twice the area long, and length
};

}  // namespace tissue_sim

// Nearest neighbours among points that do not change.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {

struct Neighbour {
  double distance2;  ///< squared [m^2]
  std::int32_t index;
};

/// A k-d tree (nanoflann). Where distances are equal the lower index comes first, so answers do not
/// depend on how the tree was built. May be asked by several threads.
class NearestPoints {
 public:
  /// The points must outlive it.
  explicit NearestPoints(const std::vector<Vec3>& points);
  ~NearestPoints();
  /// The `count` nearest (all, where there are fewer), nearest first.
  void nearest(const Vec3& place, int count, std::vector<Neighbour>& found) const;
  /// All at most `radius` away, by index.
  void within(const Vec3& place, double radius, std::vector<Neighbour>& found) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace tissue_sim

// Which places of a body gaps of its mesh part.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "geometry/lattice.h"

namespace tissue_sim {

class NearGaps {
 public:
  NearGaps() = default;  ///< of a body without gaps
  explicit NearGaps(const Lattice& lattice);
  bool empty() const { return parted_.empty(); }
  /// Whether sites lead from that of one place to that of the other, side by side, within the box
  /// of the two, without a gap between any. Where no gap lies in that box they do.
  bool joined(const Vec3& a, const Vec3& b) const;

 private:
  bool is_there(int x, int y, int z) const;
  bool is_parted(int x, int y, int z, int axis) const;  ///< from the next along the axis
  bool site_of(const Vec3& x, int (&site)[3]) const;

  Vec3 origin_ = Vec3::Zero();
  double edge_ = 1;
  std::vector<std::int64_t> sites_;                        // by number
  std::unordered_map<std::int64_t, std::uint8_t> parted_;  // a bit an axis
  int low_[3] = {}, high_[3] = {};                         // of sites beside gaps
};

}  // namespace tissue_sim

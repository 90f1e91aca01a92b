// Places on the surface taken apart for a thin tool: where tissue is drawn threefold, its places
// are further apart than the tip of one that is as thick as a cell, and it would come through
// between.
#pragma once

#include <cmath>

#include "contact/surface_spring.h"
#include "mpm/lattice/bonds.h"
#include "mpm/surface/facet_in_world.h"
#include "tools/collider.h"

namespace tissue_sim {

/// Into how many parts along either of its sides a place is taken apart for a collider: as many as
/// on a GPU.
inline int parts_along(const Collider& collider, float cell_size) {
  return collider.radius > 0 && collider.radius < kThinTip * cell_size ? 2 : 1;
}

/// Axis of the bond that a place stands for.
inline int axis_of(const SurfacePlace& place) {
  const int bond = place.key % 8;
  return bond < kForwardBond ? 2 - bond : bond - kForwardBond;
}

/// The same for one place: where it is so oblique that it stands for little, it stays whole.
inline int parts_along(const SurfacePlace& place, int along) {
  constexpr float kOblique = 0.5f;  // of a plane, one axis at least is less so
  return std::fabs(place.normal[axis_of(place)]) < kOblique ? 1 : along;
}

/// One of `along` times `along` parts of a place, in its plane.
inline SurfacePlace part_of(SurfacePlace place, int along, int part) {
  constexpr float kSide = 0.5f;  // of a point's cube [cells]
  const int axis = axis_of(place), at[2] = {part % along, part / along};
  for (int i = 0; i < 2; ++i) {
    const int a = (axis + 1 + i) % 3;
    const auto n = static_cast<float>(along);
    const float off = kSide * ((static_cast<float>(at[i]) + 0.5f) / n - 0.5f);
    place.place[a] += off;
    place.place[axis] -= off * place.normal[a] / place.normal[axis];
  }
  place.area /= static_cast<float>(along * along);
  return place;
}

/// How many parts some places have.
inline int count_parts(const SurfacePlace* first, int places, int along) {
  if (along == 1) return places;
  int count = 0;
  for (int i = 0; i < places; ++i) {
    const int of_place = parts_along(first[i], along);
    count += of_place * of_place;
  }
  return count;
}

/// Goes through some places, or their parts.
class PlaceParts {
 public:
  PlaceParts(const SurfacePlace* first, int places, int along)
      : next_(first), end_(first + places), along_(along) {}

  bool next() {
    if (++part_ >= count_) {
      if (next_ == end_) return false;
      whole_ = next_++;
      const int along = along_ == 1 ? 1 : parts_along(*whole_, along_);
      count_ = along * along;
      part_ = 0;
    }
    return true;
  }
  const SurfacePlace& place() {
    if (count_ > 1) of_whole_ = part_of(*whole_, along_, part_);
    return count_ > 1 ? of_whole_ : *whole_;
  }
  int part() const { return part_; }
  int count() const { return count_; }  ///< that the place has

 private:
  const SurfacePlace *whole_ = nullptr, *next_, *end_;
  int along_, count_ = 0, part_ = 0;
  SurfacePlace of_whole_{};
};

}  // namespace tissue_sim

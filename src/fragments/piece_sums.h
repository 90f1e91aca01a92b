// Where pieces are and how they move, summed over their points.
#pragma once

#include <vector>

#include "fragments/pieces.h"

namespace tissue_sim {

/// What points of one piece add up to.
struct PieceSums {
  int id = -1;
  double volume = 0;
  Vec3 x = Vec3::Zero(), v = Vec3::Zero();  ///< times volume
  Box box;

  void add(double point_volume, const Vec3& place, const Vec3& velocity) {
    volume += point_volume;
    x += point_volume * place;
    v += point_volume * velocity;
    box.min = box.min.cwiseMin(place);
    box.max = box.max.cwiseMax(place);
  }
  void add(const PieceSums& part) {
    volume += part.volume;
    x += part.x;
    v += part.v;
    box.min = box.min.cwiseMin(part.box.min);
    box.max = box.max.cwiseMax(part.box.max);
  }
};

/// Sums of several pieces, few of which are met at a time.
class SumsByPiece {
 public:
  /// The entry of a piece, most often the same as for the point before.
  PieceSums& of(int id) {
    for (auto s = all_.rbegin(); s != all_.rend(); ++s) {
      if (s->id == id) return *s;
    }
    all_.emplace_back();
    all_.back().id = id;
    return all_.back();
  }
  const std::vector<PieceSums>& all() const { return all_; }

 private:
  std::vector<PieceSums> all_;
};

/// Fills centroid, velocity and box of all pieces from sums over their points, a share each, which
/// are added in order.
inline void set_motion(const std::vector<SumsByPiece>& shares, Pieces& pieces) {
  std::vector<PieceSums> total(pieces.next_id);
  for (const SumsByPiece& share : shares) {
    for (const PieceSums& s : share.all()) total[s.id].add(s);
  }
  for (Fragment& f : pieces.all) {
    const PieceSums& t = total[f.id];
    f.centroid = t.x / t.volume;
    f.velocity = t.v / t.volume;
    f.box = t.box;
  }
}

}  // namespace tissue_sim

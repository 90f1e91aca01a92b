#include "mpm/cuda/outer_points.h"

#include <algorithm>

#include "mpm/contact/surface_places.h"

namespace tissue_sim {
namespace {

constexpr int kSweeps = 3;         // over the surfaces at a point
constexpr double kFarthest = 0.5;  // from a point to its place along an axis [cells]

}  // namespace

std::vector<float4> outer_points(const LatticeTissue& tissue) {
  const std::vector<OuterPlace> all = find_outer_places(tissue);
  const Array<std::uint8_t>& bonds = tissue.points.bonds;
  std::vector<float4> places(tissue.points.size(), float4{0, 0, 0, 0});
  for (auto first = all.begin(); first != all.end();) {
    const auto last = std::find_if(first, all.end(),
                                   [&](const OuterPlace& o) { return o.point != first->point; });
    const Points::Site& s = tissue.points.site[first->point];
    const Vec3 from(s.x & 1 ? 0.25 : -0.25, s.y & 1 ? 0.25 : -0.25, s.z & 1 ? 0.25 : -0.25);
    Vec3 x = from;
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      for (auto o = first; o != last; ++o) {
        const Vec3 place(o->place[0], o->place[1], o->place[2]);
        const Vec3 normal(o->normal[0], o->normal[1], o->normal[2]);
        x += normal.dot(place - x) * normal;
      }
    }
    x = x.cwiseMax(from - Vec3::Constant(kFarthest)).cwiseMin(from + Vec3::Constant(kFarthest));
    places[first->point] = {static_cast<float>(x[0]), static_cast<float>(x[1]),
                            static_cast<float>(x[2]),
                            static_cast<float>(__builtin_popcount(bonds[first->point]))};
    first = last;
  }
  return places;
}

}  // namespace tissue_sim

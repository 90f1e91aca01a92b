#include "mpm/surface/surface_places.h"

#include <algorithm>
#include <cmath>

#include "geometry/nearest_surface.h"
#include "mpm/lattice/bonds.h"
#include "mpm/surface/block.h"

namespace tissue_sim {
namespace {

constexpr float kSameWay = 0.9f;   // cosine of two places' normals that may be one
constexpr double kFarthest = 1.0;  // from the side of its cube to a place [point distances]

Vec3 direction_of(int bond) {
  const BondOffset o = bond_offset(bond);
  return {double(o.x), double(o.y), double(o.z)};
}

}  // namespace

std::vector<OuterPlace> find_outer_places(const LatticeTissue& tissue) {
  std::vector<OuterPlace> places;
  for (const LatticeBody& b : tissue.bodies) {
    const double edge = b.cell_size / 2;
    const NearestSurface surface(b.body, 2 * edge);
    for (int p = b.first_point; p < b.first_point + b.point_count; ++p) {
      const bool beside_gap = !tissue.points.beside_gap.empty() && tissue.points.beside_gap[p] != 0;
      if (tissue.points.bonds[p] == kAllBonds && !beside_gap) continue;
      const unsigned bonds = whole_bonds(b, tissue.points, p);
      if (bonds == kAllBonds) continue;
      const Points::Site& s = tissue.points.site[p];
      const Vec3 middle = b.node_position(s.x / 2, s.y / 2, s.z / 2);
      for (int k = 0; k < kBondCount; ++k) {
        if ((bonds >> k & 1) != 0) continue;
        const Vec3 out = direction_of(k), side = b.site_position(s.x, s.y, s.z) + edge / 2 * out;
        SurfacePoint found;
        const bool any = surface.find(side, out, found);
        if (!any || (found.place - side).norm() > kFarthest * edge) found = {side, out};
        const Vec3 place = (found.place - middle) / b.cell_size;
        OuterPlace o{p, static_cast<std::uint8_t>(k), {}, {}};
        for (int a = 0; a < 3; ++a) {
          o.place[a] = static_cast<float>(place[a]);
          o.normal[a] = static_cast<float>(found.normal[a]);
        }
        places.push_back(o);
      }
    }
  }
  return places;
}

namespace {

/// Where a blade went through bond `k` of a point, or tissue tore midway.
OuterPlace broken_place(const LatticeBody& b, const Points& points, std::int32_t p, int k) {
  const Points::Site& s = points.site[p];
  const BondOffset o = bond_offset(k);
  const int axis = k < kForwardBond ? 2 - k : k - kForwardBond;
  const bool forward = k >= kForwardBond;
  const std::int32_t lower = forward ? p : b.point(s.x + o.x, s.y + o.y, s.z + o.z);
  const Crossing* crossing = points.crossings.find(lower, axis);
  const float at = crossing == nullptr ? 0.5f : crossing->place;  // torn: between the two
  const int odd[3] = {s.x & 1, s.y & 1, s.z & 1};
  OuterPlace place{p, static_cast<std::uint8_t>(k), {}, {}};
  for (int a = 0; a < 3; ++a) place.place[a] = odd[a] != 0 ? 0.25f : -0.25f;
  place.place[axis] += 0.5f * (forward ? at : at - 1);
  if (crossing == nullptr) {
    place.normal[axis] = forward ? 1 : -1;
    return place;
  }
  const bool turned = (crossing->normal[axis] > 0) != forward;
  for (int a = 0; a < 3; ++a) {
    place.normal[a] = turned ? -crossing->normal[a] : crossing->normal[a];
  }
  return place;
}

}  // namespace

int places_of_point(const LatticeBody& b, const Points& points,
                    const std::vector<OuterPlace>& whole_ones, std::int32_t p,
                    OuterPlace (&places)[kBondCount]) {
  const std::uint8_t bonds = points.bonds[p], whole = whole_bonds(b, points, p);
  auto outer =
      std::lower_bound(whole_ones.begin(), whole_ones.end(), p,
                       [](const OuterPlace& o, std::int32_t point) { return o.point < point; });
  int count = 0;
  for (int k = 0; k < kBondCount; ++k) {
    if ((bonds >> k & 1) != 0) continue;
    if ((whole >> k & 1) != 0) {
      places[count++] = broken_place(b, points, p, k);
      continue;
    }
    while (outer != whole_ones.end() && outer->point == p && outer->bond < k) ++outer;
    if (outer != whole_ones.end() && outer->point == p && outer->bond == k) {
      places[count++] = *outer;
    }
  }
  return count;
}

std::vector<SurfacePlace> surface_places_of(const LatticeBody& b, const Points& points,
                                            const Block& block) {
  std::vector<SurfacePlace> places;
  const auto edge = static_cast<float>(b.cell_size / 2);
  for (int z = 0; z < block.nz; ++z) {
    for (int j = 0; j < block.stride; ++j) {
      const std::int32_t cell = z * 8 * block.stride + j, node = z * block.plane + block.cell[j];
      for (int sub = 0; sub < 8; ++sub) {
        const std::int32_t p = block.point[cell + sub * block.stride];
        if (p < 0 || points.bonds[p] == kAllBonds) continue;
        OuterPlace of_point[kBondCount];
        const int count = places_of_point(b, points, points.outer, p, of_point);
        for (int i = 0; i < count; ++i) {
          const OuterPlace& o = of_point[i];
          SurfacePlace place{cell,
                             node,
                             p,
                             static_cast<std::uint8_t>(1 << sub),
                             static_cast<std::uint8_t>(8 * (sub + 1) + o.bond),
                             {},
                             {},
                             place_area(o.normal, o.bond, edge)};
          std::copy_n(o.place, 3, place.place);
          std::copy_n(o.normal, 3, place.normal);
          if (place.area > 0) places.push_back(place);
        }
      }
    }
  }
  return places;
}

std::vector<SurfacePlace> merged_places(const std::vector<SurfacePlace>& places,
                                        const Points& points) {
  std::vector<SurfacePlace> merged;
  // Tissue goes on all around: at rims and on debris each place counts.
  const auto is_amid = [&](const SurfacePlace& p) {
    return (points.bonds[p.point] | 1 << p.key % 8) == kAllBonds;
  };
  std::size_t of_cell = 0;  // the first
  for (const SurfacePlace& p : places) {
    if (!(points.free_volume_of(p.point) > 0)) continue;  // what an anchor holds rests on nothing
    if (of_cell < merged.size() && merged[of_cell].cell != p.cell) of_cell = merged.size();
    const auto same = std::find_if(merged.begin() + static_cast<std::ptrdiff_t>(of_cell),
                                   merged.end(), [&](const SurfacePlace& m) {
                                     float along = 0;
                                     for (int a = 0; a < 3; ++a) along += m.normal[a] * p.normal[a];
                                     return m.key % 8 == p.key % 8 && is_amid(m) && is_amid(p) &&
                                            along > kSameWay;
                                   });
    if (same == merged.end()) {
      merged.push_back(p);
      continue;
    }
    const float area = same->area + p.area, share = p.area / area;
    float length = 0;
    for (int a = 0; a < 3; ++a) {
      same->place[a] += share * (p.place[a] - same->place[a]);
      same->normal[a] += share * (p.normal[a] - same->normal[a]);
      length += same->normal[a] * same->normal[a];
    }
    for (float& n : same->normal) n /= std::sqrt(length);
    same->area = area;
    same->points = static_cast<std::uint8_t>(same->points | p.points);
  }
  return merged;
}

}  // namespace tissue_sim

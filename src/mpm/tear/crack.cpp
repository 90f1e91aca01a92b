#include <algorithm>
#include <cmath>
#include <cstring>

#include "mpm/tear/tear.h"

namespace tissue_sim {
namespace {

/// Bonds of an axis whose direction has less than this along n lie along a crack, not across.
constexpr double kSlantedMost = 0.5;

/// From this excess on a bond between two points that lost bonds to each other's side breaks though
/// another one broke on its line: a crack that turns may leave a bridge behind.
constexpr float kThread = 1.3f;

Vec3 direction(int k) {
  const BondOffset o = bond_offset(k);
  return Vec3(o.x, o.y, o.z);
}

/// The crack that a point is at.
struct CrackNearby {
  bool any = false;           ///< within kReach
  bool beside = false;        ///< so near that it may go on here
  bool passed = false;        ///< it went through the point's line along n
  double offset = 0;          ///< of its plane from the point along n [points]
  Vec3 ahead = Vec3::Zero();  ///< the way it goes, in its plane; unit
};

CrackNearby crack_nearby(const LatticeTissue& tissue, const TearingPoint& t) {
  const Points::Site& s = tissue.points.site[t.point];
  const LatticeBody& body = tissue.bodies[s.body];
  CrackNearby crack;
  double weights = 0, sum = 0;
  const auto add = [&](int dx, int dy, int dz, unsigned broken) {
    for (unsigned left = broken >> kForwardBond; left != 0; left &= left - 1) {
      const Vec3 along = direction(kForwardBond + __builtin_ctz(left));
      if (std::fabs(along.dot(t.normal)) < kSlantedMost) continue;
      const Vec3 middle = Vec3(dx, dy, dz) + 0.5 * along;
      const double offset = middle.dot(t.normal);
      const double aside2 = middle.squaredNorm() - offset * offset;
      crack.any = true;
      crack.passed = crack.passed || aside2 < 0.6;
      crack.beside = crack.beside || aside2 < 2.3;  // of the next column, or askew to it
      const double weight = 1 / (0.1 + aside2 * aside2);
      weights += weight;
      sum += weight * offset;
      crack.ahead -= weight * (middle - offset * t.normal);
    }
  };
  static_assert(2 * kReach + 1 < 8, "bonds of a row are read as eight bytes");
  for (int dz = -kReach; dz <= kReach; ++dz) {
    for (int dy = -kReach; dy <= kReach; ++dy) {
      body.for_each_point_in_row(
          s.x - kReach, s.x + kReach + 1, s.y + dy, s.z + dz, [&](int x, int point, int count) {
            std::uint64_t whole, bonds;  // most rows have lost none
            std::memcpy(&whole, &tissue.whole_bonds[point], 8);
            std::memcpy(&bonds, &tissue.points.bonds[point], 8);
            std::uint64_t broken = whole & ~bonds & ~(~std::uint64_t{0} << 8 * count);
            for (int i = 0; broken != 0; broken >>= 8, ++i) {
              add(x + i - s.x, dy, dz, static_cast<unsigned>(broken & 0xff));
            }
          });
    }
  }
  if (crack.any) crack.offset = sum / weights;
  if (crack.ahead.norm() > 0) crack.ahead.normalize();
  return crack;
}

/// Side of the crack, 1 or -1, that a point is on by the bonds that it lost across n; 0 if it lost
/// none.
int side_by_own(const LatticeTissue& tissue, std::int32_t p, const Vec3& n) {
  double to_crack = 0;
  for (unsigned left = broken_bonds(tissue, p); left != 0; left &= left - 1) {
    const double across = direction(__builtin_ctz(left)).dot(n);
    if (std::fabs(across) >= kSlantedMost) to_crack += across;
  }
  return to_crack > 0 ? -1 : to_crack < 0 ? 1 : 0;
}

/// The same, else by the bonds that broke on its line along the axis nearest to n.
int side_by_bonds(const LatticeTissue& tissue, const LatticeBody& body, std::int32_t p,
                  const Vec3& n) {
  const int own = side_by_own(tissue, p, n);
  if (own != 0) return own;
  int axis = 0;
  n.cwiseAbs().maxCoeff(&axis);
  const int up = n[axis] > 0 ? kForwardBond + axis : opposite_bond(kForwardBond + axis);
  for (int i = 1; i < kReach; ++i) {
    for (const int k : {up, opposite_bond(up)}) {
      const std::int32_t q = neighbour(body, tissue.points.site[p], k, i);
      if (q >= 0 && (broken_bonds(tissue, q) >> k & 1) != 0) return k == up ? -1 : 1;
    }
  }
  return 0;
}

}  // namespace

unsigned broken_bonds(const LatticeTissue& tissue, std::int32_t p) {
  return tissue.whole_bonds[p] & ~unsigned{tissue.points.bonds[p]};
}

std::int32_t neighbour(const LatticeBody& body, const Points::Site& s, int k, int steps) {
  const BondOffset o = bond_offset(k);
  return body.point(s.x + steps * o.x, s.y + steps * o.y, s.z + steps * o.z);
}

const TearingPoint* entry(const std::vector<TearingPoint>& tearing, std::int32_t point) {
  const auto at =
      std::lower_bound(tearing.begin(), tearing.end(), point,
                       [](const TearingPoint& t, std::int32_t number) { return t.point < number; });
  return at != tearing.end() && at->point == point ? &*at : nullptr;
}

bool broken_on_line(const LatticeTissue& tissue, const LatticeBody& body, std::int32_t p, int k) {
  for (int i = -kReach; i <= kReach; ++i) {
    const std::int32_t q = neighbour(body, tissue.points.site[p], k, i);
    if (q >= 0 && (broken_bonds(tissue, q) >> k & 1) != 0) return true;
  }
  return false;
}

/// Whether the tissue is past its limit tear_length ahead of the tip, or where it ends before:
/// ahead of the point or behind it, among what the crack has passed.
static bool finds_enough(const LatticeTissue& tissue, const TearingPoint& t,
                         const CrackNearby& crack, const std::vector<TearingPoint>& tearing) {
  const Points::Site& s = tissue.points.site[t.point];
  const LatticeBody& body = tissue.bodies[s.body];
  const double tear_length = body.material_of(tissue.points, t.point).tear_length;
  const auto past = [&](std::int32_t point) {
    const TearingPoint* of = entry(tearing, point);
    return of != nullptr && of->past;
  };
  const auto point_at = [&](long i, double aside) {
    const Vec3 x = Vec3(s.x, s.y, s.z) + (crack.offset + aside) * t.normal + i * crack.ahead;
    return body.point(static_cast<int>(std::lround(x[0])), static_cast<int>(std::lround(x[1])),
                      static_cast<int>(std::lround(x[2])));
  };
  const long steps = std::lround(2 * (tear_length / body.cell_size - kTipBehind));  // points
  if (tear_length > 0 && steps < 0) {
    return past(point_at(steps, -0.5)) || past(point_at(steps, 0.5));
  }
  std::int32_t last = t.point;
  for (long i = 1; i <= steps; ++i) {
    const std::int32_t q = point_at(i, 0);
    if (q < 0) break;
    last = q;
  }
  return past(last);
}

bool go_on(const LatticeTissue& tissue, const TearingPoint& t,
           const std::vector<TearingPoint>& tearing, std::vector<Bond>& bonds) {
  const CrackNearby crack = crack_nearby(tissue, t);
  if (!crack.beside) return crack.any;
  if (!(crack.passed ? t.past : finds_enough(tissue, t, crack, tearing))) return crack.any;
  const Points::Site& s = tissue.points.site[t.point];
  const LatticeBody& body = tissue.bodies[s.body];
  const int known = side_by_bonds(tissue, body, t.point, t.normal);
  // A tip bears the more, the finer the lattice is against tear_length.
  const double bridge_excess =
      kThread *
      std::max(1.0, body.material_of(tissue.points, t.point).tear_length / (1.5 * body.cell_size));
  const int side = known != 0 ? known : crack.offset > 0 ? -1 : 1;
  for (unsigned left = tissue.points.bonds[t.point]; left != 0; left &= left - 1) {
    const int k = __builtin_ctz(left);
    const std::int32_t q = neighbour(body, s, k);
    const int other_known = side_by_bonds(tissue, body, q, t.normal);
    const double across = direction(k).dot(t.normal);
    const int other = other_known != 0 ? other_known : across < crack.offset ? -1 : 1;
    if (side == other) continue;
    const bool bridge = t.excess > bridge_excess && side_by_own(tissue, t.point, t.normal) != 0 &&
                        side_by_own(tissue, q, t.normal) != 0;
    bonds.push_back({t.point, k, bridge});
  }
  return true;
}

}  // namespace tissue_sim

#include "geometry/near_gaps.h"

#include <algorithm>
#include <cmath>

namespace tissue_sim {
namespace {

std::int64_t number(std::int64_t x, std::int64_t y, std::int64_t z) {
  return ((z + 1) << 42) + ((y + 1) << 21) + (x + 1);
}

}  // namespace

NearGaps::NearGaps(const Lattice& lattice) : origin_(lattice.origin), edge_(lattice.cell_size / 2) {
  if (lattice.gaps.empty()) return;
  sites_.reserve(lattice.sites.size());
  for (const Lattice::Site& s : lattice.sites) sites_.push_back(number(s.x, s.y, s.z));
  std::fill_n(low_, 3, 1 << 30);
  for (const Lattice::Gap& g : lattice.gaps) {
    const Lattice::Site& s = lattice.sites[g.site];
    parted_[number(s.x, s.y, s.z)] |= static_cast<std::uint8_t>(1 << g.axis);
    const int at[3] = {s.x, s.y, s.z};
    for (int a = 0; a < 3; ++a) {
      low_[a] = std::min(low_[a], at[a]);
      high_[a] = std::max(high_[a], at[a] + 1);
    }
  }
}

bool NearGaps::is_there(int x, int y, int z) const {
  return std::binary_search(sites_.begin(), sites_.end(), number(x, y, z));
}

bool NearGaps::is_parted(int x, int y, int z, int axis) const {
  const auto at = parted_.find(number(x, y, z));
  return at != parted_.end() && (at->second >> axis & 1) != 0;
}

bool NearGaps::site_of(const Vec3& x, int (&site)[3]) const {
  int own[3];
  for (int a = 0; a < 3; ++a) {
    own[a] = static_cast<int>(std::floor((x[a] - origin_[a]) / edge_));
  }
  double least = 1e300;  // a place beside the sites is of the nearest
  for (int i = 0; i < 27; ++i) {
    const int at[3] = {own[0] + i % 3 - 1, own[1] + i / 3 % 3 - 1, own[2] + i / 9 - 1};
    if (!is_there(at[0], at[1], at[2])) continue;
    const Vec3 middle = origin_ + edge_ * Vec3(at[0] + 0.5, at[1] + 0.5, at[2] + 0.5);
    const double distance = (x - middle).cwiseAbs().maxCoeff();
    if (distance >= least) continue;
    least = distance;
    std::copy_n(at, 3, site);
  }
  return least < 1e300;
}

bool NearGaps::joined(const Vec3& a, const Vec3& b) const {
  if (parted_.empty()) return true;
  int from[3], to[3], low[3], n[3];
  for (int k = 0; k < 3; ++k) {  // most pairs lie far from all gaps
    const double least = std::min(a[k], b[k]) - origin_[k],
                 most = std::max(a[k], b[k]) - origin_[k];
    if (most < edge_ * (low_[k] - 1) || least > edge_ * (high_[k] + 2)) return true;
  }
  if (!site_of(a, from) || !site_of(b, to)) return true;
  for (int k = 0; k < 3; ++k) {
    low[k] = std::min(from[k], to[k]);
    n[k] = std::max(from[k], to[k]) - low[k] + 1;
  }
  bool any = false;
  const auto for_each = [&](const auto& f) {
    for (int z = 0; z < n[2]; ++z) {
      for (int y = 0; y < n[1]; ++y) {
        for (int x = 0; x < n[0]; ++x) f(low[0] + x, low[1] + y, low[2] + z);
      }
    }
  };
  for_each([&](int x, int y, int z) { any = any || parted_.count(number(x, y, z)) != 0; });
  if (!any) return true;
  std::vector<std::uint8_t> seen(static_cast<std::size_t>(n[0]) * n[1] * n[2], 0);
  const auto index = [&](const int(&s)[3]) {
    return (static_cast<std::size_t>(s[2] - low[2]) * n[1] + (s[1] - low[1])) * n[0] +
           (s[0] - low[0]);
  };
  struct Site {
    int at[3];
  };
  std::vector<Site> next = {{{from[0], from[1], from[2]}}};
  seen[index(from)] = 1;
  while (!next.empty()) {
    const Site s = next.back();
    next.pop_back();
    for (int axis = 0; axis < 3; ++axis) {
      for (const int way : {-1, 1}) {
        Site t = s;
        t.at[axis] += way;
        if (t.at[axis] < low[axis] || t.at[axis] >= low[axis] + n[axis]) continue;
        const Site& first = way > 0 ? s : t;
        if (is_parted(first.at[0], first.at[1], first.at[2], axis)) continue;
        if (!is_there(t.at[0], t.at[1], t.at[2]) || seen[index(t.at)] != 0) continue;
        seen[index(t.at)] = 1;
        next.push_back(t);
      }
    }
  }
  return seen[index(to)] != 0;
}

}  // namespace tissue_sim

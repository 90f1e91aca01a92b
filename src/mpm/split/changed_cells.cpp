#include "mpm/split/changed_cells.h"

#include <algorithm>

namespace tissue_sim {
namespace {

/// to[i]: whether any from[i + k step] is set, with k from -reach to reach.
void spread(const std::vector<std::uint8_t>& from, int reach, std::size_t step,
            std::vector<std::uint8_t>& to) {
  const std::size_t edge = reach * step;
  to = from;
  for (std::size_t by = step; by <= edge; by += step) {
    const std::uint8_t* in = from.data();
    std::uint8_t* out = to.data();
    const std::size_t count = from.size() - by;
    for (std::size_t i = 0; i < count; ++i) out[i + by] |= in[i];
    for (std::size_t i = 0; i < count; ++i) out[i] |= in[i + by];
  }
}

}  // namespace

CellsAround::CellsAround(const LatticeBody& body, int reach, const Points& points,
                         const std::vector<std::int32_t>& some)
    : body_(body) {
  const auto is_here = [&body](std::int32_t p) {
    return p >= body.first_point && p < body.first_point + body.point_count;
  };
  int low[3] = {1 << 30, 1 << 30, 1 << 30}, high[3] = {-1, -1, -1};
  for (const std::int32_t p : some) {
    if (!is_here(p)) continue;
    const Points::Site& s = points.site[p];
    const int cell[3] = {s.x / 2, s.y / 2, s.z / 2};
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], cell[a]);
      high[a] = std::max(high[a], cell[a]);
    }
  }
  if (high[0] < 0) return;
  for (int a = 0; a < 3; ++a) {
    low_[a] = low[a] - reach;
    n_[a] = high[a] - low[a] + 1 + 2 * reach;
  }
  const std::size_t row = n_[0], plane = row * n_[1];
  near_.assign(plane * n_[2], 0);
  for (const std::int32_t p : some) {
    if (!is_here(p)) continue;
    const Points::Site& s = points.site[p];
    near_[(s.z / 2 - low_[2]) * plane + (s.y / 2 - low_[1]) * row + s.x / 2 - low_[0]] = 1;
  }
  std::vector<std::uint8_t> spread_x, spread_y;
  spread(near_, reach, 1, spread_x);
  spread(spread_x, reach, row, spread_y);
  spread(spread_y, reach, plane, near_);
}

}  // namespace tissue_sim

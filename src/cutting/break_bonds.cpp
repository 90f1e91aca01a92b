#include <algorithm>

#include "cutting/bonds.h"
#include "cutting/cut_tissue.h"

namespace tissue_sim {

void break_bonds(MpmState& state, const std::vector<BrokenBond>& broken,
                 std::vector<std::int32_t>& changed, CutReport& report) {
  Points& points = state.points;
  const std::size_t first = changed.size();
  state.cpu->both(
      [&] {
        std::vector<std::uint64_t> lost(points.size() / 64 + 1, 0);  // a bit of each point
        for (const BrokenBond& b : broken) {
          break_bond(kForwardBond + b.axis, points.bonds[b.point], points.bonds[b.other]);
          for (const std::int32_t p : {b.point, b.other}) {
            lost[p / 64] |= std::uint64_t{1} << (p % 64);
          }
        }
        for (std::size_t i = 0; i < lost.size(); ++i) {
          for (std::uint64_t m = lost[i]; m != 0; m &= m - 1) {
            changed.push_back(static_cast<std::int32_t>(64 * i + __builtin_ctzll(m)));
          }
        }
      },
      [&] {
        const auto is_crossed = [](const BrokenBond& b) { return b.crossing.place >= 0; };
        if (std::none_of(broken.begin(), broken.end(), is_crossed)) return;
        points.crossings.reserve(points.size());
        for (const BrokenBond& b : broken) {
          if (is_crossed(b)) points.crossings.add(b.point, b.axis, b.crossing);
        }
      });
  report.bonds_broken += static_cast<int>(broken.size());
  report.points_separated += static_cast<int>(changed.size() - first);
}

}  // namespace tissue_sim

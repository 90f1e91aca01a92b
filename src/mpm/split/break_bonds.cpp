#include <algorithm>

#include "mpm/lattice/bonds.h"
#include "mpm/split/cut_tissue.h"

namespace tissue_sim {

void break_bonds(LatticeTissue& state, const std::vector<std::vector<BrokenBond>>& broken,
                 std::vector<std::int32_t>& changed, CutReport& report) {
  // A blade that is held in its cut breaks nothing, frame after frame.
  if (std::all_of(broken.begin(), broken.end(), [](const auto& some) { return some.empty(); })) {
    return;
  }
  Points& points = state.points;
  const auto for_each_bond = [&broken](const auto& f) {
    for (const std::vector<BrokenBond>& some : broken) std::for_each(some.begin(), some.end(), f);
  };
  const std::size_t first = changed.size();
  state.cpu->both(
      [&] {
        std::vector<std::uint64_t> lost(points.size() / 64 + 1, 0);  // a bit of each point
        for_each_bond([&](const BrokenBond& b) {
          break_bond(kForwardBond + b.axis, points.bonds[b.point], points.bonds[b.other]);
          for (const std::int32_t p : {b.point, b.other}) {
            lost[p / 64] |= std::uint64_t{1} << (p % 64);
          }
          ++report.bonds_broken;
        });
        for (std::size_t i = 0; i < lost.size(); ++i) {
          for (std::uint64_t m = lost[i]; m != 0; m &= m - 1) {
            changed.push_back(static_cast<std::int32_t>(64 * i + __builtin_ctzll(m)));
          }
        }
      },
      [&] {
        points.crossings.reserve(points.size());
        for_each_bond([&](const BrokenBond& b) {
          if (b.crossing.place >= 0) points.crossings.add(b.point, b.axis, b.crossing);
        });
      });
  report.points_separated += static_cast<int>(changed.size() - first);
}

std::vector<std::int32_t> break_gaps(LatticeTissue& state) {
  std::vector<std::int32_t> changed;
  CutReport report;
  break_bonds(state, {state.points.gaps}, changed, report);
  if (!changed.empty()) state.whole_bonds = state.points.bonds;
  return changed;
}

}  // namespace tissue_sim

#include "cutting/threads.h"

#include <algorithm>

#include "cutting/bonds.h"
#include "mpm/state_figures.h"

namespace tissue_sim {
namespace {

constexpr float kLeastStiffening = 5;  // of a block that is looked at

bool has(std::uint8_t bonds, int k) { return (bonds >> k & 1) != 0; }

/// Whether bond `k` of a point is in no square of four bonds.
bool is_thread(const LatticeBody& body, const Points& points, std::int32_t point, int k) {
  const auto next = [&](std::int32_t p, int bond) {
    const Points::Site& s = points.site[p];
    const BondOffset o = bond_offset(bond);
    return body.point(s.x + o.x, s.y + o.y, s.z + o.z);
  };
  const std::int32_t other = next(point, k);
  for (int side = 0; side < kBondCount; ++side) {
    if (side == k || side == opposite_bond(k)) continue;
    if (!has(points.bonds[point], side) || !has(points.bonds[other], side)) continue;
    if (has(points.bonds[next(point, side)], k)) return false;
  }
  return true;
}

bool has_threads(const MpmState& state, const Block& block) {
  const LatticeBody& body = state.bodies[block.body];
  return std::any_of(block.point.begin(), block.point.end(), [&](std::int32_t p) {
    for (int k = 0; p >= 0 && k < kBondCount; ++k) {
      if (has(state.points.bonds[p], k) && is_thread(body, state.points, p, k)) return true;
    }
    return false;
  });
}

}  // namespace

bool may_have_stretched_threads(const MpmState& state, const Block& block) {
  if (block.split_nodes.empty()) return false;
  double least = 1e30;
  const LatticeBody& body = state.bodies[block.body];
  for (std::size_t i = 0; i < body.materials.size(); ++i) {
    if (block.material != Block::kMixed && block.material != static_cast<int>(i)) continue;
    least = std::min(least, wave_modulus(body.materials[i], kLeastStiffening));
  }
  return block.modulus.last >= least && has_threads(state, block);
}

void tear_threads(MpmState& state, std::vector<std::int32_t>& changed, CutReport& report) {
  std::vector<StretchedPoint> stretched;
  for (const Block* block : state.blocks.all) {
    if (!may_have_stretched_threads(state, *block)) continue;
    state.kernels->stretched(*block, block_field(state, *block), kThreadStretch,
                             state.scratch.local(), stretched);
  }
  const std::size_t first = changed.size();
  Points& points = state.points;
  for (const StretchedPoint& p : stretched) {
    const Points::Site& s = points.site[p.point];
    const LatticeBody& body = state.bodies[s.body];
    for (int k = 0; k < kBondCount; ++k) {
      if (!has(points.bonds[p.point], k) || !is_thread(body, points, p.point, k)) continue;
      const BondOffset o = bond_offset(k);
      const std::int32_t other = body.point(s.x + o.x, s.y + o.y, s.z + o.z);
      points.bonds[p.point] &= static_cast<std::uint8_t>(~(1u << k));
      points.bonds[other] &= static_cast<std::uint8_t>(~(1u << opposite_bond(k)));
      changed.push_back(p.point);
      changed.push_back(other);
      ++report.bonds_broken;
    }
  }
  const auto begin = changed.begin() + static_cast<std::ptrdiff_t>(first);
  std::sort(begin, changed.end());
  changed.erase(std::unique(begin, changed.end()), changed.end());
  report.points_separated += static_cast<int>(changed.size() - first);
}

}  // namespace tissue_sim

#include "cutting/threads.h"

#include <algorithm>

#include "cutting/bonds.h"
#include "cutting/crack.h"
#include "mpm/deformation.h"

namespace tissue_sim {
namespace {

bool has(std::uint8_t bonds, int k) { return (bonds >> k & 1) != 0; }

/// Whether bond `k` of a point is there and in no square of four bonds.
bool is_thread(const LatticeBody& body, const Points& points, std::int32_t point, int k) {
  if (!has(points.bonds[point], k)) return false;
  const std::int32_t other = neighbour(body, points.site[point], k);
  for (int side = 0; side < kBondCount; ++side) {
    if (side == k || side == opposite_bond(k)) continue;
    if (!has(points.bonds[point], side) || !has(points.bonds[other], side)) continue;
    if (has(points.bonds[neighbour(body, points.site[point], side)], k)) return false;
  }
  return true;
}

bool ends_thread(const LatticeBody& body, const Points& points, std::int32_t point) {
  for (int k = 0; k < kBondCount; ++k) {
    if (is_thread(body, points, point, k)) return true;
  }
  return false;
}

}  // namespace

void list_threads(MpmState& state, const std::vector<std::int32_t>& changed) {
  std::vector<std::int32_t>& threads = state.threads;
  const auto add = [&](std::int32_t point) {
    const LatticeBody& body = state.bodies[state.points.site[point].body];
    if (ends_thread(body, state.points, point)) threads.push_back(point);
  };
  for (const std::int32_t p : changed) {
    add(p);
    // A square may have lost its far side.
    const LatticeBody& body = state.bodies[state.points.site[p].body];
    for (int k = 0; k < kBondCount; ++k) {
      if (has(state.points.bonds[p], k)) add(neighbour(body, state.points.site[p], k));
    }
  }
  std::sort(threads.begin(), threads.end());
  threads.erase(std::unique(threads.begin(), threads.end()), threads.end());
}

void tear_threads(MpmState& state, std::vector<std::int32_t>& changed, CutReport& report) {
  const std::size_t first = changed.size();
  Points& points = state.points;
  std::vector<std::int32_t> left;
  for (const std::int32_t p : state.threads) {
    const LatticeBody& body = state.bodies[points.site[p].body];
    if (!ends_thread(body, points, p)) continue;
    const Deformation d(body, points.site[p], *state.fields, state.nodes);
    if (d.stretch < kThreadStretch || d.stiffening < kThreadStiffening) {
      left.push_back(p);
      continue;
    }
    for (int k = 0; k < kBondCount; ++k) {
      if (!is_thread(body, points, p, k)) continue;
      const std::int32_t other = neighbour(body, points.site[p], k);
      break_bond(k, points.bonds[p], points.bonds[other]);
      changed.push_back(p);
      changed.push_back(other);
      ++report.bonds_broken;
    }
  }
  state.threads = std::move(left);
  const auto begin = changed.begin() + static_cast<std::ptrdiff_t>(first);
  std::sort(begin, changed.end());
  changed.erase(std::unique(begin, changed.end()), changed.end());
  report.points_separated += static_cast<int>(changed.size() - first);
}

}  // namespace tissue_sim

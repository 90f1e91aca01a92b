#include "mpm/fragment_features.h"

#include <Eigen/Dense>
#include <algorithm>

#include "math/bspline.h"
#include "mpm/lattice/bonds.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {
namespace {

/// Mean gradient over the eight places of a cell, of the field that one of its points sees: along
/// each axis the mean of both weights and slopes.
void cell_gradient(const MpmState& state, const LatticeBody& body, const Points::Site& point,
                   float* F) {
  constexpr float kWeight[3] = {kAverageSide, kAverageCenter, kAverageSide};
  constexpr float kSlope[3] = {-0.5f, 0, 0.5f};
  const auto per_cell = static_cast<float>(1 / body.cell_size);
  for (int i = 0; i < 9; ++i) F[i] = i % 4 == 0 ? 1.0f : 0.0f;
  for (int k = 0; k < 27; ++k) {
    const int d[3] = {k % 3, k / 3 % 3, k / 9}, node = state.fields->node(body, point, k);
    for (int b = 0; b < 3; ++b) {
      const float slope =
          per_cell * kSlope[d[b]] * kWeight[d[(b + 1) % 3]] * kWeight[d[(b + 2) % 3]];
      for (int a = 0; a < 3; ++a) F[3 * a + b] += slope * state.nodes.u[a][node];
    }
  }
}

/// The points of the cell that a site is in, -1 where there is none.
void points_of_cell(const LatticeBody& body, int x, int y, int z, std::int32_t (&points)[8]) {
  for (int i = 0; i < 8; ++i) {
    points[i] = body.point((x & ~1) + (i & 1), (y & ~1) + (i >> 1 & 1), (z & ~1) + (i >> 2));
  }
}

/// Volume of the points that there are, as a share of a full cell's.
float share_of_cell(const MpmState& state, const LatticeBody& body,
                    const std::int32_t (&points)[8]) {
  double volume = 0;
  for (const std::int32_t p : points) volume += p < 0 ? 0 : state.points.volume[p];
  return static_cast<float>(volume / (body.cell_size * body.cell_size * body.cell_size));
}

}  // namespace

void fragment_features(const MpmState& state, std::int32_t point, float* x) {
  const Points::Site& s = state.points.site[point];
  const LatticeBody& body = state.bodies[s.body];
  std::int32_t own[8];
  points_of_cell(body, s.x, s.y, s.z, own);
  cell_gradient(state, body, s, x);
  x[9] = share_of_cell(state, body, own);
  for (int neighbour = 1; neighbour < kFeatureCells; ++neighbour) {
    float* of_cell = x + neighbour * kFeaturesOfCell;
    for (int i = 0; i < kFeaturesOfCell; ++i) of_cell[i] = i < 9 && i % 4 == 0 ? 1.0f : 0.0f;
    const int axis = (neighbour - 1) / 2, forward = (neighbour - 1) % 2;
    const int bond = forward != 0 ? kForwardBond + axis : opposite_bond(kForwardBond + axis);
    const BondOffset o = bond_offset(bond);
    std::int32_t other[8];
    points_of_cell(body, s.x + 2 * o.x, s.y + 2 * o.y, s.z + 2 * o.z, other);
    // Bonds lead from the side of the own cell that faces the other one.
    int bonds = 0, whole = 0;
    for (int i = 0; i < 8; ++i) {
      if ((i >> axis & 1) != forward || own[i] < 0 || other[i ^ 1 << axis] < 0) continue;
      ++bonds;
      whole += state.points.bonds[own[i]] >> bond & 1;
    }
    if (whole == 0) continue;
    const int place = (s.x & 1) + 2 * (s.y & 1) + 4 * (s.z & 1);
    std::int32_t seen = other[place];
    for (int i = 0; i < 8 && seen < 0; ++i) seen = other[i];
    cell_gradient(state, body, state.points.site[seen], of_cell);
    of_cell[9] = share_of_cell(state, body, other) * static_cast<float>(whole) / bonds;
  }
}

std::vector<std::int32_t> fragment_candidates(MpmState& state, const Pieces& pieces, double share) {
  std::vector<std::uint8_t> loose(pieces.next_id, 0);
  for (const Fragment& f : pieces.all) loose[f.id] = f.loose;
  const int count = static_cast<int>(state.blocks.all.size());
  std::vector<std::vector<std::int32_t>> of_block(count);
  state.cpu->for_each(count, [&](int i) {
    const Block& block = *state.blocks.all[i];
    const LatticeBody& body = state.bodies[block.body];
    const float limit = block.material == Block::kMixed
                            ? least_tear_limit(body)
                            : least_tear_limit(body.materials[block.material]);
    if (limit == 0) return;
    const auto near = static_cast<float>(1 + share * (limit - 1));
    std::vector<StretchedPoint> stretched;
    state.kernels->stretched(block, block_field(state, block), near, state.work.scratch.local(),
                             stretched);
    for (const StretchedPoint& p : stretched) of_block[i].push_back(p.point);
    for (const std::int32_t p : block.point) {
      if (p < 0) continue;
      if (state.points.bonds[p] != state.whole_bonds[p]) of_block[i].push_back(p);
    }
  });
  std::vector<std::int32_t> candidates;
  for (const auto& part : of_block) {
    for (const std::int32_t p : part) {
      if (state.points.anchored[p] != 0 || loose[pieces.of_point[p]] != 0) continue;
      candidates.push_back(p);
    }
  }
  std::sort(candidates.begin(), candidates.end());
  candidates.erase(std::unique(candidates.begin(), candidates.end()), candidates.end());
  return candidates;
}

}  // namespace tissue_sim

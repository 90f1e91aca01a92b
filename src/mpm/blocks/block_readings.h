// What is read off a block: energy, stiffness and stress. For kernel_set.h alone.
#pragma once

#include <algorithm>
#include <cmath>

#include "mpm/blocks/block_forces.h"
#include "mpm/blocks/update_node.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {
namespace kernels {

template <int W>
TISSUE_SIM_INLINE Vec<W> larger(Vec<W> a, Vec<W> b) {
  const Mask<W> is_b = bits<W>(a - b) >> 31;
  return keep<W>(~is_b, a) + keep<W>(is_b, b);
}

/// What state() has read so far: `energy` lane by lane [J], `least` of the materials' stiffenings,
/// a sum that is not finite where a point's stiffening is not, and the largest ||F||^2.
struct Readings {
  BlockState block;
  double energy[kLanes] = {};
  float least = 1, stiffenings[kLanes] = {}, squares[kLanes] = {};
};

/// What 1 and more of a point counts for. Behind the face of an anchor tissue strains as its nodes
/// do, without its neighbours' stress; it is as light as it is soft, and as long as it holds on to
/// them its nodes have their mass.
TISSUE_SIM_INLINE float lessened(const BlockField& f, std::int32_t point, float value) {
  const bool holds = f.lightness != nullptr && f.bonds[point] == f.whole_bonds[point];
  return holds ? 1 + f.lightness[point] * (value - 1) : value;
}

/// Widens `stiffening` to a point's, whose squared columns of cof F, J and ||F||^2 are given.
TISSUE_SIM_INLINE void stiffen(const Block& b, const BlockField& f, std::int32_t point,
                               float column, float J, float f2, Readings& read) {
  BlockState& r = read.block;
  float stiffening = column + std::fabs(J - 1) * std::sqrt(f2 / 3);
  if (!std::isfinite(stiffening)) r.finite = false;
  // Not lessened: where light points are drawn out they swing, and energy is to be watched.
  r.worst_stiffening = std::max(r.worst_stiffening, stiffening);
  if (f.soft != nullptr && f.soft[point] != 0) stiffening *= kSoftness;
  stiffening = lessened(f, point, stiffening);
  const int material = f.material == nullptr ? 0 : f.material[point];
  r.stiffening[material] = std::max(r.stiffening[material], stiffening);
  read.least = b.material != Block::kMixed
                   ? r.stiffening[b.material]
                   : *std::min_element(r.stiffening.begin(), r.stiffening.end() - 1);
}

/// -1 where the lane holds a point.
template <int W>
TISSUE_SIM_INLINE Mask<W> are_points(const std::int32_t* point) {
  Mask<W> mask;
  std::memcpy(&mask, point, sizeof(mask));
  return ~(mask >> 31);
}

/// Widens the squares to those of points ||F||^2.
template <int W>
TISSUE_SIM_INLINE void read_squares(const BlockField& f, const std::int32_t* point,
                                    const Mask<W>& is_point, const Vec<W>& f2, Readings& read) {
  const Vec<W> before = load<W>(read.squares);
  if (f.lightness == nullptr) {
    return store<W>(read.squares, larger<W>(before, keep<W>(is_point, f2)));
  }
  if (!any_negative<W>(bits<W>(before - f2) & is_point)) return;
  for (int i = 0; i < W; ++i) {
    if (is_point[i] == 0 || f2[i] <= before[i]) continue;
    read.squares[i] = std::max(before[i], lessened(f, point[i], f2[i]));
  }
}

/// Widens the stiffenings to those of the point of each of W cells, from `lane` on.
template <int W>
TISSUE_SIM_INLINE void read_stiffening(const Block& b, const BlockField& f, std::size_t lane,
                                       const Vec<W> (&F)[9], Readings& read) {
  const std::int32_t* point = b.point.data() + lane;
  // Neither what an anchor holds is one, nor what it keeps of a point.
  const float kept = f.lightness == nullptr ? 0 : kept_volume(f.cell_size);
  const Mask<W> is_point =
      are_points<W>(point) & bits<W>(kept - load<W>(b.volume.data() + lane)) >> 31;
  Vec<W> cof[9];
  cofactor(F, cof);
  const Vec<W> J = F[0] * cof[0] + F[1] * cof[1] + F[2] * cof[2];
  const Vec<W> cx = cof[0] * cof[0] + cof[3] * cof[3] + cof[6] * cof[6];
  const Vec<W> cy = cof[1] * cof[1] + cof[4] * cof[4] + cof[7] * cof[7];
  const Vec<W> cz = cof[2] * cof[2] + cof[5] * cof[5] + cof[8] * cof[8];
  const Vec<W> f2 = norm2(F);
  // Few lanes are looked at one by one, for sqrt(x) <= (1 + x) / 2.
  const Vec<W> at_most =
      larger<W>(cx, larger<W>(cy, cz)) + larger<W>(J - 1.0f, 1.0f - J) * (0.5f + (1.0f / 6) * f2);
  store<W>(read.stiffenings, load<W>(read.stiffenings) + keep<W>(is_point, at_most));
  read_squares<W>(f, point, is_point, f2, read);
  if (!any_negative<W>(bits<W>(read.least - at_most) & is_point)) return;
  for (int i = 0; i < W; ++i) {
    if (is_point[i] == 0 || at_most[i] <= read.least) continue;
    stiffen(b, f, point[i], std::max(cx[i], std::max(cy[i], cz[i])), J[i], f2[i], read);
  }
}

/// Reads N of the points of W cells, from `lane` on, which is of the first. G: their displacement
/// gradients, to which I is added.
template <int N, int W, class Materials>
TISSUE_SIM_INLINE void read_states(const Block& b, const BlockField& f, std::size_t lane,
                                   Vec<W> (*G)[9], Readings& read, float* von_mises) {
  const auto k = Materials::template stiffness<N, W>(b, f, lane);
  Vec<W> energy[N], P[N][9];
  for (int s = 0; s < N; ++s) add_identity<W>(G[s]);
  Materials::template energies<N, W>(G, k, energy);
  if (von_mises) Materials::template stresses<N, W>(G, k, P);
  for (int s = 0; s < N; ++s, lane += b.stride) {
    energy[s] = keep<W>(are_points<W>(b.point.data() + lane), energy[s]);
    for (int i = 0; i < W; ++i) read.energy[i] += energy[s][i];
    if (von_mises) {
      const Vec<W> V = load<W>(b.volume.data() + lane);
      const Vec<W> squared = von_mises_squared(G[s], P[s]) / (V * V);
      for (int i = 0; i < W; ++i) von_mises[lane + i] = std::sqrt(squared[i]);
    }
    read_stiffening<W>(b, f, lane, G[s], read);
  }
}

/// Calls f(width, lane, G) for the points of all cells, width of them side by side: `lane` of the
/// first point of the first, G[8] the displacement gradients. Leaves the nodes in the scratch.
template <int W, class F>
TISSUE_SIM_INLINE void for_each_gradient(const Block& b, const BlockField& f, BlockScratch& scratch,
                                         const F& visit) {
  const Layout l(b);
  reserve(scratch.in, 3 * l.in_plane);
  gather_nodes<W>(b, f.nodes->u, 1.0f / f.cell_size, l, scratch.nodes);
  for (int z = 0; z < 2; ++z) load_plane<W>(b, l, scratch.nodes.data(), z, scratch.in.data());
  for (int z = 0; z < b.nz; ++z) {
    load_plane<W>(b, l, scratch.nodes.data(), z + 2, scratch.in.data());
    for_each_filled<W>(b.filled[z], [&](auto width, int j, bool) TISSUE_SIM_INLINE_LAMBDA {
      Vec<width> G[8][9];
      gradients<width>(l, scratch.in.data(), z, j, G);
      visit(width, static_cast<std::size_t>(z) * 8 * l.stride + j, G);
    });
  }
}

template <int W, class Materials>
TISSUE_SIM_INLINE BlockState state(const Block& b, const BlockField& f, BlockScratch& scratch,
                                   float* von_mises) {
  Readings read;
  read.block.stiffening.assign(f.material_count + 1, 1.0f);
  for_each_gradient<W>(
      b, f, scratch, [&](auto width, std::size_t lane, auto* G) TISSUE_SIM_INLINE_LAMBDA {
        for (int s = 0; s < 8; s += 4) {
          read_states<4, width, Materials>(b, f, lane + s * b.stride, G + s, read, von_mises);
        }
      });
  BlockState& result = read.block;
  result.elastic_energy = stabilise_cells<W>(b, f, Layout(b), scratch.nodes.data(), nullptr);
  for (const double e : read.energy) result.elastic_energy += e;
  result.finite = result.finite && std::isfinite(result.elastic_energy);
  result.stiffening.back() = *std::max_element(read.squares, read.squares + kLanes);
  return result;
}

/// The same without energies and stress.
template <int W>
TISSUE_SIM_INLINE BlockState stiffness(const Block& b, const BlockField& f, BlockScratch& scratch) {
  Readings read;
  read.block.stiffening.assign(f.material_count + 1, 1.0f);
  for_each_gradient<W>(b, f, scratch,
                       [&](auto width, std::size_t lane, auto* G) TISSUE_SIM_INLINE_LAMBDA {
                         for (int s = 0; s < 8; ++s) {
                           add_identity<width>(G[s]);
                           read_stiffening<width>(b, f, lane + s * b.stride, G[s], read);
                         }
                       });
  for (const float s : read.stiffenings) read.block.finite = read.block.finite && std::isfinite(s);
  read.block.stiffening.back() = *std::max_element(read.squares, read.squares + kLanes);
  return read.block;
}

template <int W>
TISSUE_SIM_INLINE BlockState state_any(const Block& b, const BlockField& f, BlockScratch& s,
                                       float* von_mises) {
  return with_materials(b, f, [&](auto materials) TISSUE_SIM_INLINE_LAMBDA {
    return state<W, decltype(materials)>(b, f, s, von_mises);
  });
}

/// The largest eigenvalue of C reaches s^2 where s^2 I - C is not positive definite: by its leading
/// minors (Sylvester), 20 operations a point and no eigenvalue.
template <int W>
TISSUE_SIM_INLINE void stretched(const Block& b, const BlockField& f, float stretch,
                                 BlockScratch& scratch, std::vector<StretchedPoint>& found) {
  const float s2 = stretch * stretch;
  for_each_gradient<W>(
      b, f, scratch, [&](auto width, std::size_t lane, auto* G) TISSUE_SIM_INLINE_LAMBDA {
        using V = Vec<width>;
        for (int s = 0; s < 8; ++s, lane += b.stride) {
          V C[6];
          add_identity<width>(G[s]);
          right_cauchy_green(G[s], C);
          const V x = s2 - C[0], y = s2 - C[1], w = s2 - C[2];
          const V minor = x * y - C[3] * C[3];
          const V det = w * minor - x * C[5] * C[5] - y * C[4] * C[4] - 2.0f * C[3] * C[4] * C[5];
          const Mask<width> beyond = bits<width>(x) | bits<width>(minor) | bits<width>(det);
          if (!any_negative<width>(beyond)) continue;
          const std::int32_t* point = b.point.data() + lane;
          for (int i = 0; i < width; ++i) {
            if (beyond[i] >= 0 || point[i] < 0) continue;
            found.push_back({point[i], {C[0][i], C[1][i], C[2][i], C[3][i], C[4][i], C[5][i]}});
          }
        }
      });
}

}  // namespace kernels
}  // namespace tissue_sim

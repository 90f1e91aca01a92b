// The internal forces of a block. For kernel_set.h alone.
#pragma once

#include <algorithm>
#include <array>

#include "mpm/blocks/lane_materials.h"
#include "mpm/blocks/stabilise_cell.h"

namespace tissue_sim {
namespace kernels {

/// Adds the force that stabilises the block's partial cells to `force` where there is one. Returns
/// the energy. `nodes` are displacements over cell size.
template <int W>
TISSUE_SIM_INLINE double stabilise_cells(const Block& b, const BlockField& f, const Layout& l,
                                         const float* nodes, float* force) {
  constexpr int width = W == 16 ? 16 : 4, together = W == 16 ? 3 : 1;  // components side by side
  const float scale = force != nullptr ? -1.0f / f.cell_size : 1.0f;
  double twice_energy = 0;
  for (const Block::PartialCell& cell : b.partial) {
    for (int c = 0; c < 3; c += together) {
      float* to = force != nullptr ? force + c * b.node_count() + cell.node : nullptr;
      twice_energy += stabilise<width>(kStabilisation * cell.mu * scale,
                                       nodes + c * l.node_component + cell.node, l.node_component,
                                       l.pitch, l.plane, to, b.node_count());
    }
  }
  return 0.5 * twice_energy;
}

/// Kelvin-Voigt stress of W cells at their middle, times an eighth of the volume of their points:
/// added to the stress at all eight points it is the force of the mean gradient.
template <int W, class Materials>
TISSUE_SIM_INLINE void viscous_stress(const Block& b, const BlockField& f, const Layout& l,
                                      const float* in, const float* in_rate, int z, int j,
                                      Vec<W>* P) {
  Vec<W> F[9], rate[9];
  for (int c = 0; c < 3; ++c) {
    const float *q[3], *r[3];
    for (int i = 0; i < 3; ++i) {
      const int slot = (z + i) % 3;
      q[i] = in + slot * l.in_plane + c * kStressXyCount * l.quantity + j;
      r[i] = in_rate + (3 * slot + c) * kMeanXyCount * l.quantity + j;
    }
    const auto of = [&l](const float* const(&plane)[3], int k) TISSUE_SIM_INLINE_LAMBDA {
      return std::array<const float*, 3>{plane[0] + k * l.quantity, plane[1] + k * l.quantity,
                                         plane[2] + k * l.quantity};
    };
    mean_gradient<W>(of(q, kAA), of(q, kAd), of(q, kdA), c, F);
    mean_gradient<W>(of(r, kMeanAA), of(r, kMeanAd), of(r, kMeandA), c, rate);
  }
  add_identity<W>(F);
  const Vec<W> viscosity = Materials::template viscosity<W>(b, f, z, j);
  for (int i = 0; i < 9; ++i) P[i] = 0.0f * viscosity;
  add_viscous_stress(F, rate, 0.125f * viscosity, P);
}

/// Which of W cells hold points.
template <int W>
TISSUE_SIM_INLINE Mask<W> filled_lanes(const float* volume, int stride) {
  Vec<W> filled = load<W>(volume);
  for (int s = 1; s < 8; ++s) filled += load<W>(volume + s * stride);
  return -bits<W>(filled) >> 31;
}

/// Stress of the cells in W lanes, `whole` if all of them hold points, from the incoming x-y
/// quantities to the outgoing ones.
template <int W, class Materials>
TISSUE_SIM_INLINE void stress_lanes(const Block& b, const BlockField& f, const Layout& l,
                                    const float* in, const float* in_rate, int z, int j, bool whole,
                                    bool viscous, float* out) {
  Vec<W> G[8][9];
  const std::size_t lane = static_cast<std::size_t>(z) * 8 * l.stride + j;
  // Eight streams, each too short for the processor to foresee: on their way while gradients are
  // worked out.
  for (int s = 0; s < 8; ++s) __builtin_prefetch(b.volume.data() + lane + s * l.stride);
  if (whole) {
    gradients<W>(l, in, z, j, G);
  } else {
    // Between two pieces, lanes without a point see nodes of both, and of how far apart these are a
    // law may make what is no number: times a volume of 0 it stays none.
    gradients<W, true>(l, in, z, j, G, filled_lanes<W>(b.volume.data() + lane, l.stride));
  }
  constexpr int kTogether = 4;  // points whose stretch is worked out side by side
  for (int first = 0; first < 8; first += kTogether) {
    Vec<W>(*F)[9] = G + first;
    for (int s = 0; s < kTogether; ++s) add_identity<W>(F[s]);
    const auto k = Materials::template stiffness<kTogether, W>(b, f, lane + first * l.stride);
    if (any_positive<W>(k.mu[0] + k.mu[1] + k.mu[2] + k.mu[3])) {
      Materials::template stresses<kTogether, W>(F, k, F);
    } else {
      std::fill_n(&F[0][0], kTogether * 9, Vec<W>{});
    }
  }
  if (viscous) {
    Vec<W> damping[9];
    viscous_stress<W, Materials>(b, f, l, in, in_rate, z, j, damping);
    for (int s = 0; s < 8; ++s) {
      for (int i = 0; i < 9; ++i) G[s][i] += damping[i];
    }
  }
  for (int c = 0; c < 3; ++c) {
    float* q = out + kLanes + c * kStressXyCount * l.quantity + j;
    add_divergence<W>(G, c, l.quantity, q + (z % 3) * l.out_plane, q + ((z + 1) % 3) * l.out_plane,
                      q + ((z + 2) % 3) * l.out_plane);
  }
}

template <int W, class Materials>
TISSUE_SIM_INLINE void forces(const Block& b, const BlockField& f, BlockScratch& scratch,
                              float* force) {
  // Asked as it runs: compiled for each answer, these kernels would take a compiler twice as long.
  const bool viscous = b.material == Block::kMixed ? !b.mixture.viscosity.empty() : f.viscosity > 0;
  const Layout l(b);
  const float inv_h = 1.0f / f.cell_size;
  reserve(scratch.in, 3 * l.in_plane);
  reserve(scratch.out, 3 * l.out_plane + kLanes);
  reserve(scratch.row, 3 * l.sum_component);
  if (f.has_nodes) {
    float* const nodes = scratch.nodes.data();
    for (int i = 0; i < 3 * l.node_component; i += W) {
      store<W>(nodes + i, inv_h * load<W>(nodes + i));
    }
  } else {
    gather_nodes<W>(b, f.nodes->u, inv_h, l, scratch.nodes);
  }
  if (viscous) {
    reserve(scratch.in_rate, 9 * kMeanXyCount * l.quantity);
    gather_nodes<W>(b, f.nodes->v, inv_h, l, scratch.velocities);
  }
  float* out = scratch.out.data();
  std::fill_n(out, 2 * l.out_plane, 0.0f);
  for (int z = 0; z < 2; ++z) {
    load_plane<W>(b, l, scratch.nodes.data(), z, scratch.in.data());
    if (viscous) load_mean_plane<W>(b, l, scratch.velocities.data(), z, scratch.in_rate.data());
  }
  const int lanes = b.runs.back().lane + b.runs.back().count;
  for (int z = 0; z < b.nz + 2; ++z) {
    if (z < b.nz) {
      const std::vector<Block::Span>& filled = b.filled[z];
      // The uppermost plane is written, not added to, in the lanes that are gone through.
      if (!covers_all<W>(filled, lanes)) {
        std::fill_n(out + kLanes + (z + 2) % 3 * l.out_plane, l.in_plane, 0.0f);
      }
      load_plane<W>(b, l, scratch.nodes.data(), z + 2, scratch.in.data());
      if (viscous) {
        load_mean_plane<W>(b, l, scratch.velocities.data(), z + 2, scratch.in_rate.data());
      }
      for_each_filled<W>(filled, [&](auto width, int j, bool whole) TISSUE_SIM_INLINE_LAMBDA {
        stress_lanes<width, Materials>(b, f, l, scratch.in.data(), scratch.in_rate.data(), z, j,
                                       whole, viscous, out);
      });
    }
    store_plane<W>(b, l, out, z, -inv_h, scratch.row.data(), force);
  }
  stabilise_cells<W>(b, f, l, scratch.nodes.data(), force);
}

template <int W>
TISSUE_SIM_INLINE void forces_any(const Block& b, const BlockField& f, BlockScratch& s,
                                  float* out) {
  with_materials(b, f, [&](auto materials) TISSUE_SIM_INLINE_LAMBDA {
    forces<W, decltype(materials)>(b, f, s, out);
  });
}

}  // namespace kernels
}  // namespace tissue_sim

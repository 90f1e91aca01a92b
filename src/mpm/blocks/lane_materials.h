// What the points in the lanes of a block are of: one material for all of them, or several. For
// kernel_set.h alone.
#pragma once

#include "material/laws.h"
#include "mpm/blocks/block_planes.h"

namespace tissue_sim {
namespace kernels {

/// Lame parameters of the points in W lanes, at N of the cells' sub-positions, times their volumes
/// [J].
template <int N, int W>
struct Stiffness {
  Vec<W> mu[N], lambda[N];
  Mask<W> neo_hookean[N] = {};  ///< where there are both laws
};

/// A block of one material.
template <class LawOf>
struct OneMaterial {
  /// From `lane` on, which is of the first sub-position.
  template <int N, int W>
  TISSUE_SIM_INLINE static Stiffness<N, W> stiffness(const Block& b, const BlockField& f,
                                                     std::size_t lane) {
    Stiffness<N, W> k;
    for (int s = 0; s < N; ++s) {
      const Vec<W> V = load<W>(b.volume.data() + lane + s * b.stride);
      k.mu[s] = f.mu * V;
      k.lambda[s] = f.lambda * V;
    }
    return k;
  }
  template <int N, int W>
  TISSUE_SIM_INLINE static void stresses(const Vec<W> (*F)[9], const Stiffness<N, W>& k,
                                         Vec<W> (*P)[9]) {
    LawOf::template stresses<N>(F, k.mu, k.lambda, P);
  }
  template <int N, int W>
  TISSUE_SIM_INLINE static void energies(const Vec<W> (*F)[9], const Stiffness<N, W>& k,
                                         Vec<W>* energy) {
    LawOf::template energies<N>(F, k.mu, k.lambda, energy);
  }
  /// What W cells in z-plane z damp: their viscosity times the volume V of their points, less where
  /// V does not fill the cell, times V / h^3 [J s].
  template <int W>
  TISSUE_SIM_INLINE static Vec<W> viscosity(const Block& b, const BlockField& f, int z, int j) {
    const float* volume = b.volume.data() + static_cast<std::size_t>(z) * 8 * b.stride + j;
    Vec<W> V = load<W>(volume);
    for (int s = 1; s < 8; ++s) V += load<W>(volume + s * b.stride);
    return (f.viscosity / (f.cell_size * f.cell_size * f.cell_size)) * V * V;
  }
};

/// A block of several materials of one law.
template <class LawOf>
struct SeveralMaterials : OneMaterial<LawOf> {
  template <int N, int W>
  TISSUE_SIM_INLINE static Stiffness<N, W> stiffness(const Block& b, const BlockField&,
                                                     std::size_t lane) {
    Stiffness<N, W> k;
    for (int s = 0; s < N; ++s) {
      k.mu[s] = load<W>(b.mixture.mu.data() + lane + s * b.stride);
      k.lambda[s] = load<W>(b.mixture.lambda.data() + lane + s * b.stride);
    }
    return k;
  }
  template <int W>
  TISSUE_SIM_INLINE static Vec<W> viscosity(const Block& b, const BlockField&, int z, int j) {
    return load<W>(b.mixture.viscosity.data() + static_cast<std::size_t>(z) * b.stride + j);
  }
};

/// A block of materials of both laws: both are worked out for all points.
struct BothLaws : SeveralMaterials<FixedCorotated> {
  template <int N, int W>
  TISSUE_SIM_INLINE static Stiffness<N, W> stiffness(const Block& b, const BlockField& f,
                                                     std::size_t lane) {
    Stiffness<N, W> k = SeveralMaterials<FixedCorotated>::stiffness<N, W>(b, f, lane);
    for (int s = 0; s < N; ++s) {
      std::memcpy(&k.neo_hookean[s], b.mixture.neo_hookean.data() + lane + s * b.stride,
                  sizeof(k.neo_hookean[s]));
    }
    return k;
  }
  template <int N, int W>
  TISSUE_SIM_INLINE static void stresses(const Vec<W> (*F)[9], const Stiffness<N, W>& k,
                                         Vec<W> (*P)[9]) {
    Vec<W> other[N][9];
    NeoHookean::stresses<N>(F, k.mu, k.lambda, other);
    FixedCorotated::stresses<N>(F, k.mu, k.lambda, P);
    for (int s = 0; s < N; ++s) {
      for (int i = 0; i < 9; ++i) P[s][i] = k.neo_hookean[s] ? other[s][i] : P[s][i];
    }
  }
  template <int N, int W>
  TISSUE_SIM_INLINE static void energies(const Vec<W> (*F)[9], const Stiffness<N, W>& k,
                                         Vec<W>* energy) {
    Vec<W> other[N];
    NeoHookean::energies<N>(F, k.mu, k.lambda, other);
    FixedCorotated::energies<N>(F, k.mu, k.lambda, energy);
    for (int s = 0; s < N; ++s) energy[s] = k.neo_hookean[s] ? other[s] : energy[s];
  }
};

/// Calls f(materials) with the kind that the block is of, a value of one of the types above.
template <class F>
TISSUE_SIM_INLINE auto with_materials(const Block& b, const BlockField& field, const F& f) {
  const bool neo_hookean = field.law == Law::kNeoHookean;
  if (b.material != Block::kMixed) {
    return neo_hookean ? f(OneMaterial<NeoHookean>()) : f(OneMaterial<FixedCorotated>());
  }
  if (!b.mixture.neo_hookean.empty()) return f(BothLaws());
  return neo_hookean ? f(SeveralMaterials<NeoHookean>()) : f(SeveralMaterials<FixedCorotated>());
}

}  // namespace kernels
}  // namespace tissue_sim

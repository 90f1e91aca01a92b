// What the points in the lanes of a block are of: one material for all of them, or several. For
// block_kernels.cpp alone.
#pragma once

#include "material/laws.h"
#include "mpm/block_planes.h"

namespace tissue_sim {
namespace kernels {

/// Lame parameters of the points in W lanes, times their volumes [J].
template <int W>
struct Stiffness {
  Vec<W> mu, lambda;
  Mask<W> neo_hookean = Mask<W>();  ///< where there are both laws
};

/// A block of one material.
template <class LawOf>
struct OneMaterial {
  template <int W>
  TISSUE_SIM_INLINE static Stiffness<W> stiffness(const Block& b, const BlockField& f,
                                                  std::size_t lane) {
    const Vec<W> V = load<W>(b.volume.data() + lane);
    return {f.mu * V, f.lambda * V};
  }
  template <int W>
  TISSUE_SIM_INLINE static void stress(const Vec<W>* F, const Stiffness<W>& k, Vec<W>* P) {
    LawOf::stress(F, k.mu, k.lambda, P);
  }
  template <int W>
  TISSUE_SIM_INLINE static Vec<W> energy(const Vec<W>* F, const Stiffness<W>& k) {
    return LawOf::energy(F, k.mu, k.lambda);
  }
  /// Viscosity of W cells in z-plane z times the volume of their points [J s].
  template <int W>
  TISSUE_SIM_INLINE static Vec<W> viscosity(const Block& b, const BlockField& f, int z, int j) {
    const float* volume = b.volume.data() + static_cast<std::size_t>(z) * 8 * b.stride + j;
    Vec<W> V = load<W>(volume);
    for (int s = 1; s < 8; ++s) V += load<W>(volume + s * b.stride);
    return f.viscosity * V;
  }
};

/// A block of several materials of one law.
template <class LawOf>
struct SeveralMaterials : OneMaterial<LawOf> {
  template <int W>
  TISSUE_SIM_INLINE static Stiffness<W> stiffness(const Block& b, const BlockField&,
                                                  std::size_t lane) {
    return {load<W>(b.mixture.mu.data() + lane), load<W>(b.mixture.lambda.data() + lane)};
  }
  template <int W>
  TISSUE_SIM_INLINE static Vec<W> viscosity(const Block& b, const BlockField&, int z, int j) {
    return load<W>(b.mixture.viscosity.data() + static_cast<std::size_t>(z) * b.stride + j);
  }
};

/// A block of materials of both laws: both are worked out for all points.
struct BothLaws : SeveralMaterials<FixedCorotated> {
  template <int W>
  TISSUE_SIM_INLINE static Stiffness<W> stiffness(const Block& b, const BlockField& f,
                                                  std::size_t lane) {
    Stiffness<W> k = SeveralMaterials<FixedCorotated>::stiffness<W>(b, f, lane);
    std::memcpy(&k.neo_hookean, b.mixture.neo_hookean.data() + lane, sizeof(k.neo_hookean));
    return k;
  }
  template <int W>
  TISSUE_SIM_INLINE static void stress(const Vec<W>* F, const Stiffness<W>& k, Vec<W>* P) {
    Vec<W> other[9];
    FixedCorotated::stress(F, k.mu, k.lambda, P);
    NeoHookean::stress(F, k.mu, k.lambda, other);
    for (int i = 0; i < 9; ++i) P[i] = k.neo_hookean ? other[i] : P[i];
  }
  template <int W>
  TISSUE_SIM_INLINE static Vec<W> energy(const Vec<W>* F, const Stiffness<W>& k) {
    return k.neo_hookean ? NeoHookean::energy(F, k.mu, k.lambda)
                         : FixedCorotated::energy(F, k.mu, k.lambda);
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

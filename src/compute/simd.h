// Short vectors of floats by the compiler's vector extension: `Vec<16>` is one AVX-512 register,
// two of AVX2 or four of SSE2. Arithmetic is written with ordinary operators; scalars mix in.
#pragma once

#include <cstdint>
#include <cstring>

#include "compute/host_device.h"

namespace tissue_sim {

/// The types for each width by themselves, for GCC 9 forgets `aligned` where the size of a vector
/// hangs on a template's parameter, and took any address for an aligned one. Vectors may alias
/// their elements without being told.
template <int W>
struct VecOf;
template <int W>
struct MaskOf;
#define TISSUE_SIM_VECTOR(of, element, W)                                      \
  template <>                                                                  \
  struct of<W> {                                                               \
    typedef element type __attribute__((vector_size(W * 4)));                  \
    typedef element unaligned __attribute__((vector_size(W * 4), aligned(4))); \
  };
TISSUE_SIM_VECTOR(VecOf, float, 4)
TISSUE_SIM_VECTOR(VecOf, float, 8)
TISSUE_SIM_VECTOR(VecOf, float, 16)
TISSUE_SIM_VECTOR(MaskOf, std::int32_t, 4)
TISSUE_SIM_VECTOR(MaskOf, std::int32_t, 8)
TISSUE_SIM_VECTOR(MaskOf, std::int32_t, 16)
#undef TISSUE_SIM_VECTOR

template <int W>
using Vec = typename VecOf<W>::type;
/// One integer for each lane: all bits set or none.
template <int W>
using Mask = typename MaskOf<W>::type;

/// Lanes begin .. end - 1. From a table, for GCC 12 compares wide vectors of integers one by one.
template <int W>
TISSUE_SIM_INLINE Mask<W> lanes_between(int begin, int end) {
  struct Steps {
    std::int32_t from[4 * W], to[4 * W];
    constexpr Steps() : from(), to() {
      for (int i = 0; i < 4 * W; ++i) {
        from[i] = i < 2 * W ? 0 : -1;
        to[i] = i < 2 * W ? -1 : 0;
      }
    }
  };
  static constexpr Steps steps;
  using Unaligned = typename MaskOf<W>::unaligned;
  begin = begin < -W ? -W : begin;
  end = end > W ? W : end;
  return *reinterpret_cast<const Unaligned*>(steps.from + 2 * W - begin) &
         *reinterpret_cast<const Unaligned*>(steps.to + 2 * W - end);
}
/// v where the mask is set, else 0.
template <int W>
TISSUE_SIM_INLINE Vec<W> keep(Mask<W> mask, Vec<W> v) {
  return reinterpret_cast<Vec<W>>(reinterpret_cast<Mask<W>>(v) & mask);
}

/// The bits of W floats: the highest of each is its sign.
template <int W>
TISSUE_SIM_INLINE Mask<W> bits(Vec<W> v) {
  return reinterpret_cast<Mask<W>>(v);
}
/// v where the mask is set, else w.
template <int W>
TISSUE_SIM_INLINE Vec<W> either(Mask<W> mask, Vec<W> v, Vec<W> w) {
  return reinterpret_cast<Vec<W>>((bits<W>(v) & mask) | (bits<W>(w) & ~mask));
}
/// Whether the highest bit of any lane is set. With it instead of comparisons, which GCC 12 takes
/// apart lane by lane where vectors have 64 bytes.
template <int W>
TISSUE_SIM_INLINE bool any_negative(Mask<W> m) {
  std::uint64_t words[W / 2], all = 0;
  std::memcpy(words, &m, sizeof(words));
  for (const std::uint64_t w : words) all |= w;
  return (all & 0x8000000080000000) != 0;
}

/// Whether any lane is above 0, where none is below.
template <int W>
TISSUE_SIM_INLINE bool any_positive(Vec<W> v) {
  return any_negative<W>(-bits<W>(v));
}

/// W floats from any address.
template <int W>
TISSUE_SIM_INLINE Vec<W> load(const float* p) {
  return *reinterpret_cast<const typename VecOf<W>::unaligned*>(p);
}
template <int W>
TISSUE_SIM_INLINE void store(float* p, Vec<W> v) {
  *reinterpret_cast<typename VecOf<W>::unaligned*>(p) = v;
}

#if !defined(__CUDACC__)
/// Lane i is lane from[i] of v (0 .. W - 1). Clang has no such builtin for a variable.
template <int W>
TISSUE_SIM_INLINE Vec<W> permute(Vec<W> v, Mask<W> from) {
#if defined(__clang__)
  Vec<W> r;
  for (int i = 0; i < W; ++i) r[i] = v[from[i]];
  return r;
#else
  return __builtin_shuffle(v, from);
#endif
}
/// Lane i is lane from[i] of v and then w (0 .. 2 W - 1).
template <int W>
TISSUE_SIM_INLINE Vec<W> permute(Vec<W> v, Vec<W> w, Mask<W> from) {
#if defined(__clang__)
  Vec<W> r;
  for (int i = 0; i < W; ++i) r[i] = from[i] < W ? v[from[i]] : w[from[i] - W];
  return r;
#else
  return __builtin_shuffle(v, w, from);
#endif
}
#endif

/// Instruction sets that the CPU kernels are compiled for.
enum class InstructionSet { kSse2, kAvx2, kAvx512 };

/// The best that this processor has, unless the environment variable TISSUE_SIM_INSTRUCTION_SET
/// (sse2, avx2, avx512) asks for a lesser one. Throws std::runtime_error for one that is not there.
InstructionSet instruction_set();
const char* name(InstructionSet set);

#if defined(__x86_64__)
#define TISSUE_SIM_TARGET_AVX2 __attribute__((target("avx2,fma")))
#define TISSUE_SIM_TARGET_AVX512 \
  __attribute__((target("avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")))
#endif

}  // namespace tissue_sim

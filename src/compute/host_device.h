// Marks functions that run on the host and on the device alike.
#pragma once

#if defined(__CUDACC__)
#define TISSUE_SIM_HOST_DEVICE __host__ __device__
#define TISSUE_SIM_INLINE __host__ __device__ __forceinline__
#define TISSUE_SIM_INLINE_LAMBDA
// For what kernels seldom need: inlined, it would take room among the instructions that they do.
#define TISSUE_SIM_APART __host__ __device__ __noinline__ inline
#else
#define TISSUE_SIM_HOST_DEVICE
// Always inlined on the CPU: the code is then compiled for the instruction set of the kernel that
// it is inlined into, which is how one header serves SSE2, AVX2 and AVX-512 in one binary.
#define TISSUE_SIM_INLINE inline __attribute__((always_inline))
// The same for a lambda, after its parameters. One that takes or returns vectors must have it:
// where it is not inlined, as in a debug build, it is compiled for SSE2 and finds them elsewhere
// than its caller put them.
#define TISSUE_SIM_INLINE_LAMBDA __attribute__((always_inline))
#define TISSUE_SIM_APART inline
#endif

// A struct's fields for compute/archive.h, in its definition.
#define TISSUE_SIM_FIELDS(...)        \
  template <class Archive>            \
  void each_field(Archive& archive) { \
    archive(__VA_ARGS__);             \
  }

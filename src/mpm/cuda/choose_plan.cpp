#include "mpm/cuda/choose_plan.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

namespace tissue_sim {
namespace {

int parts_of(int n, int size) { return (n + size - 1) / size; }

/// Cycles of a substep. The figures are fitted to measurements on an H200: see
/// docs/benchmarks_cuda.md.
double cycles(const std::vector<LatticeBody>& bodies, const CudaShape& s, int processors,
              std::size_t shared_bytes) {
  const BlockShape& b = s.blocks;
  const double slots = (b.x + 2.0) * (b.y + 2) * (b.z + 2);
  const double shared = 16 * (2 * slots + 9 * s.threads) + 2048;
  if (shared > static_cast<double>(shared_bytes)) return 1e30;
  double blocks = 0;
  for (const LatticeBody& body : bodies) {
    blocks += static_cast<double>(parts_of(body.nx, b.x)) * parts_of(body.ny, b.y) *
              parts_of(body.nz, b.z);
  }
  const int by_registers = 512 / s.threads;
  const int by_shared = static_cast<int>(shared_bytes / (shared + 1024));
  const int each = std::max(1, std::min(by_registers, by_shared));
  const double waves = std::ceil(blocks / (each * processors));
  const double together = std::min<double>(each, std::ceil(blocks / processors));
  const double warps = together * s.threads / 32 / 4;  // on each scheduler
  // A warp alone issues every third cycle or so; many together nearly every cycle.
  const double per_instruction = std::max(2.8, 1.35 * warps);
  const double halves = 2.0 / s.parts * b.z;
  const double work = per_instruction * (1350 * halves + 250 * (b.z + 2.0));
  const double nodes = 900 + slots / s.threads * 60 * std::max(1.0, together * 0.5);
  return waves * (work + nodes) + 2200;
}

}  // namespace

CudaShape choose_shape(const std::vector<LatticeBody>& bodies, int processors,
                       std::size_t shared_bytes) {
  CudaShape best;
  if (const char* text = std::getenv("TISSUE_SIM_CUDA_SHAPE")) {
    if (std::sscanf(text, "%d %d %d %d %d", &best.blocks.x, &best.blocks.y, &best.blocks.z,
                    &best.parts, &best.threads) != 5 ||
        best.blocks.x < 1 || best.blocks.y < 1 || best.blocks.z < 1 ||
        (best.parts != 1 && best.parts != 2) ||
        best.threads > kMaxCudaThreads || best.parts * best.blocks.x * best.blocks.y > best.threads || best.threads % 32 != 0) {
      throw std::runtime_error(std::string("TISSUE_SIM_CUDA_SHAPE is '") + text +
                               "': it must be 'x y z parts threads' with parts 1 or 2 and "
                               "parts * x * y at most threads");
    }
    return best;
  }
  double least = 1e300;
  for (const int parts : {2}) {
    for (const int threads : {32, 64, 96, 128}) {
      for (int x = 1; x <= 32; ++x) {
        const int y = std::min(32, threads / parts / x);
        if (y < 1) continue;
        for (const int z : {1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 16, 20}) {
          CudaShape s;
          s.blocks = {x, y, z};
          s.parts = parts;
          s.threads = threads;
          const double c = cycles(bodies, s, processors, shared_bytes);
          if (c < least) {
            least = c;
            best = s;
          }
        }
      }
    }
  }
  return best;
}

}  // namespace tissue_sim

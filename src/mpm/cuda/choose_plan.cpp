#include "mpm/cuda/choose_plan.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "cutting/tear.h"
#include "mpm/cuda/stacks.h"

namespace tissue_sim {
namespace {

int parts_of(int n, int size) { return (n + size - 1) / size; }

/// How many blocks can share a node along an axis.
int sharers(int n, int size) { return n <= size ? 1 : size == 1 ? 3 : 2; }

/// Cycles of a substep that marches, 1e30 where it does not go. The figures here and below are
/// fitted to measurements on an H200: see docs/benchmarks_cuda.md.
double cycles_of_march(const LatticeBody& body, const CudaShape& s, const CudaLimits& limits) {
  const BlockShape& b = s.blocks;
  const double plane_slots = (b.x + 2.0) * (b.y + 2), bytes = kMarchBytes * plane_slots;
  // Room for one thread block only: several would be slower, and this is no model of them.
  const auto room = static_cast<double>(limits.shared_bytes);
  if (bytes + kMarchBytesBeside > room || 2 * bytes < room) return 1e30;
  const int columns = parts_of(body.nx, b.x) * parts_of(body.ny, b.y),
            high = parts_of(body.nz, b.z), height = stack_height(columns, high, limits.processors);
  const int rounds = parts_of(columns * parts_of(high, height), limits.processors);
  const double warps = std::ceil(b.x * b.y / 32.0) / 4;  // on each scheduler
  const double cell = 1950 * std::max(1.8, 1.3 * warps),
               plane = 200 + 450 * warps + 5 * plane_slots;
  const double layers = height * b.z, of_block = 10;  // of equals, the tallest blocks
  return rounds * (5000 + of_block * height + cell * layers + plane * (layers + 2)) + 3000;
}

/// Cycles of a substep as a small or as a large tissue (substeps.cu), 1e30 where that does not go.
double cycles(const std::vector<LatticeBody>& bodies, const CudaShape& s,
              const CudaLimits& limits) {
  const BlockShape& b = s.blocks;
  const bool pairs = s.small && s.pairs();
  const double plane_slots = (b.x + 2.0) * (b.y + 2), slots = plane_slots * (b.z + 2);
  const double shared = (s.small ? 56 : 32) * slots + 144 * plane_slots + 4300;
  if (shared > static_cast<double>(limits.shared_bytes)) return 1e30;
  double blocks = 0;
  int parts = 1;
  for (const LatticeBody& body : bodies) {
    blocks += static_cast<double>(parts_of(body.nx, b.x)) * parts_of(body.ny, b.y) *
              parts_of(body.nz, b.z);
    parts = std::max(parts, sharers(body.nx, b.x) * sharers(body.ny, b.y) * sharers(body.nz, b.z));
  }
  const int by_registers = 256 / s.threads;
  const int by_shared = static_cast<int>(limits.shared_bytes / shared);
  const int each = std::max(1, std::min(by_registers, by_shared));
  const double waves = std::ceil(blocks / (each * limits.processors));
  if (s.small && waves > 1) return 1e30;
  // Cuts add blocks, and with one thread a column there is no room to bundle them.
  if (s.small && !pairs && 1.2 * blocks > each * limits.processors) return 1e30;
  const double together = std::min<double>(each, std::ceil(blocks / limits.processors));
  // Warps that compute, on each scheduler.
  const double warps = together * (pairs ? b.x * b.y / 16.0 : std::ceil(b.x * b.y / 32.0)) / 4;
  const double cell = (pairs ? 1400 : 1950) * std::max(1.8, 1.3 * warps);
  const double plane = 400 + 250 * warps;
  const double nodes =
      std::ceil(slots / s.threads) * (s.small ? 250 + 120 * parts : 300 + 60 * together);
  const double wave = nodes + cell * b.z + plane * (b.z + 2);
  // One thread a column makes contact and cuts dearer.
  return s.small ? wave + (pairs ? 3500 : 5500) : 1.5 * waves * wave + 5000;
}

/// Columns of the block that hold points.
int columns_of(const Block& b) {
  return static_cast<int>(std::count(b.filled_columns.begin(), b.filled_columns.end(), 1));
}

/// Whether each column of cells must have two threads.
bool wants_pairs(const std::vector<LatticeBody>& bodies) {
  bool viscous = false, neo_hookean = false, fixed_corotated = false;
  for (const LatticeBody& body : bodies) {
    for (const Material& m : body.materials) {
      viscous = viscous || m.viscosity > 0;
      (m.law == Law::kNeoHookean ? neo_hookean : fixed_corotated) = true;
    }
  }
  return viscous || (neo_hookean && fixed_corotated);
}

CudaShape shape_from(const char* text, bool pairs, bool may_march) {
  CudaShape s;
  BlockShape& b = s.blocks;
  int way = 0;
  if (std::sscanf(text, "%d %d %d %d %d", &b.x, &b.y, &b.z, &s.threads, &way) != 5 || b.x < 1 ||
      b.y < 1 || b.z < 1 || b.z > kMaxLayers || s.threads > kMaxCudaThreads ||
      s.threads % 32 != 0 || b.x * b.y > s.threads || (pairs && !s.pairs())) {
    throw std::runtime_error(
        std::string("TISSUE_SIM_CUDA_SHAPE is '") + text +
        "': it must be 'x y z threads way', threads a multiple of 32 up to "
        "256 and at least x y (2 x y where there is viscosity or more than one "
        "law), z at most 16, way 0 for large, 1 for small, 2 to march");
  }
  s.small = way == 1;
  s.marches = way == 2 && may_march;
  return s;
}

}  // namespace

bool can_march(const std::vector<LatticeBody>& bodies) {
  if (bodies.size() != 1 || bodies[0].materials.size() != 1) return false;
  const LatticeBody& b = bodies[0];
  const Material& m = b.materials[0];
  return m.viscosity == 0 && least_tear_limit(m) == 0 && b.point_count == 8 * b.nx * b.ny * b.nz;
}

CudaShape choose_shape(const std::vector<LatticeBody>& bodies, const CudaLimits& limits,
                       bool may_march) {
  const bool pairs = wants_pairs(bodies);
  if (const char* text = std::getenv("TISSUE_SIM_CUDA_SHAPE")) {
    return shape_from(text, pairs, may_march);
  }
  CudaShape best;
  best.blocks = {4, 4, 4};
  double least = 1e30;
  enum Way { kSmall, kLarge, kMarch };
  for (const Way way : {kSmall, kLarge, kMarch}) {
    if (way == kMarch && !may_march) continue;
    for (const int threads : {64, 96, 128, 192, 256}) {
      for (int x = threads; x > 0; --x) {  // of equals, the longest along x
        for (int y = 1; y <= threads / x; ++y) {
          for (int z = 1; z <= kMaxLayers; ++z) {
            CudaShape s;
            s.blocks = {x, y, z};
            s.threads = threads;
            s.small = way == kSmall;
            s.marches = way == kMarch;
            if (pairs && !s.pairs()) continue;
            const double c =
                s.marches ? cycles_of_march(bodies[0], s, limits) : cycles(bodies, s, limits);
            if (c < least) {
              least = c;
              best = s;
            }
          }
        }
      }
    }
  }
  return best;
}

std::vector<std::vector<int>> single_blocks(const std::vector<Block*>& blocks, std::size_t at_once,
                                            Cpu& cpu) {
  std::vector<std::vector<int>> bundles(blocks.size());
  for (std::size_t i = 0; i < blocks.size(); ++i) bundles[i] = {static_cast<int>(i)};
  if (blocks.size() <= at_once) return bundles;
  std::vector<int> columns(blocks.size());
  cpu.for_each(static_cast<int>(blocks.size()),
               [&](int i) { columns[i] = columns_of(*blocks[i]); });
  std::stable_sort(bundles.begin(), bundles.end(),
                   [&](const auto& a, const auto& b) { return columns[a[0]] > columns[b[0]]; });
  std::reverse(bundles.begin(), bundles.begin() + static_cast<std::ptrdiff_t>(at_once));
  return bundles;
}

std::vector<std::vector<int>> bundle_blocks(const std::vector<Block*>& blocks, std::size_t wanted,
                                            const BundleLimits& limits, Cpu& cpu) {
  struct Filled {
    int body, material;
    BundleLimits has;
    std::vector<int> blocks;
  };
  std::vector<Filled> single(blocks.size());
  cpu.for_each(static_cast<int>(blocks.size()), [&](int i) {
    const Block& b = *blocks[i];
    single[i] = {b.body,
                 b.material,
                 {columns_of(b), (b.nx + 2) * (b.ny + 2), (b.nx + 2) * (b.ny + 2) * (b.nz + 2)},
                 {i}};
  });
  std::stable_sort(single.begin(), single.end(),
                   [](const Filled& a, const Filled& b) { return a.has.columns > b.has.columns; });
  std::vector<Filled> bundles;
  for (Filled& one : single) {
    Filled* room = nullptr;
    if (bundles.size() >= wanted) {
      for (Filled& f : bundles) {
        const bool fits = f.body == one.body && f.material == one.material &&
                          f.has.columns + one.has.columns <= limits.columns &&
                          f.has.plane_slots + one.has.plane_slots <= limits.plane_slots &&
                          f.has.slots + one.has.slots <= limits.slots;
        if (fits && (room == nullptr || f.has.columns < room->has.columns)) room = &f;
      }
    }
    if (room == nullptr) {
      bundles.push_back(std::move(one));
      continue;
    }
    room->has.columns += one.has.columns;
    room->has.plane_slots += one.has.plane_slots;
    room->has.slots += one.has.slots;
    room->blocks.push_back(one.blocks.front());
  }
  std::vector<std::vector<int>> result;
  for (Filled& f : bundles) result.push_back(std::move(f.blocks));
  return result;
}

}  // namespace tissue_sim

#include "mpm/cuda/choose_plan.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <stdexcept>
#include <string>

namespace tissue_sim {
namespace {

// Shared memory of a slot, without and with what the tables say of it.
constexpr int kSlot = 32, kCachedSlot = 56;

/// How many blocks can share a node along an axis.
int sharers(int n, int size) { return n <= size ? 1 : size == 1 ? 3 : 2; }

/// Rounds of `at_once` thread blocks for the blocks of bodies of which some do not fill their
/// boxes: blocks at a surface have few columns and share thread blocks. `blocks`, `columns`: how
/// many.
double rounds_of(const std::vector<BlockCounts>& counts, const CudaShape& s, double blocks,
                 double columns, std::size_t at_once, std::size_t shared_bytes) {
  const BlockShape& b = s.blocks;
  const auto rounds = [at_once](double count) {
    return std::ceil(count / static_cast<double>(at_once));
  };
  constexpr double kFew = 4;  // with more, one of them is no matter
  const bool may_share = rounds(blocks) <= kFew && rounds(columns / s.columns()) < rounds(blocks) &&
                         4 * b.x * b.y >= 3 * s.columns();  // thread blocks take no more of smaller
  if (!may_share) return rounds(blocks);
  std::vector<BlockToBundle> list;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    counts[i].list(b.x, b.y, b.z, static_cast<int>(i), list);
  }
  const int plane_slots = most_plane_slots((b.x + 2) * (b.y + 2)),
            slots = (static_cast<int>(shared_bytes) - 144 * plane_slots - 4300) /
                    (s.small ? kCachedSlot : kSlot);
  const auto bundles =
      bundle_in_rounds(list, at_once, list.size(), {s.columns(), plane_slots, slots});
  return rounds(bundles.empty() ? blocks : static_cast<double>(bundles.size()));
}

/// Cycles of a substep as a small or as a large tissue (substeps.cu), 1e30 where that does not go.
/// The figures are fitted to measurements on an H200: see docs/benchmarks_cuda.md. Where it takes
/// `least` or more, it may take more than what is returned. `counts`: of the bodies; `whole`: see
/// choose_shape().
double cycles(const std::vector<LatticeBody>& bodies, const std::vector<BlockCounts>& counts,
              const CudaShape& s, const CudaLimits& limits, bool whole, double least) {
  const BlockShape& b = s.blocks;
  const bool pairs = s.small && s.pairs();
  const double plane_slots = (b.x + 2.0) * (b.y + 2), slots = plane_slots * (b.z + 2);
  const double shared = (s.small ? kCachedSlot : kSlot) * slots + 144 * plane_slots + 4300;
  if (shared > static_cast<double>(limits.shared_bytes)) return 1e30;
  double blocks = 0, columns = 0;
  bool fill_boxes = true;
  int parts = 1;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const LatticeBody& body = bodies[i];
    const BlockCount count = counts[i].count(b.x, b.y, b.z);
    blocks += count.blocks;
    columns += count.columns;
    fill_boxes = fill_boxes && counts[i].fills_box();
    parts = std::max(parts, sharers(body.nx, b.x) * sharers(body.ny, b.y) * sharers(body.nz, b.z));
  }
  const int by_registers = 256 / s.threads;
  const int by_shared = static_cast<int>(limits.shared_bytes / shared);
  const int each = std::max(1, std::min(by_registers, by_shared));
  const auto at_once = static_cast<std::size_t>(each) * limits.processors;
  double waves = std::ceil(blocks / static_cast<double>(at_once));
  // Cuts add blocks: no second round for a few of them. Large tissue has room to bundle more of
  // them; bodies that do not fill their boxes bundle theirs anyway.
  const double with_cuts = (s.small ? 1.1 : 1.05) * blocks;
  if (!whole && fill_boxes && waves == 1 && with_cuts > static_cast<double>(at_once)) waves = 2;
  bool share = false;  // blocks share thread blocks
  if (!fill_boxes) {
    if (each > 1 || b.y > b.x) return 1e30;  // no better where it was measured
    // With as few rounds as the columns alone would fill, until it is known how many it takes.
    const double fewest = std::ceil(columns / s.columns() / static_cast<double>(at_once));
    share = fewest < waves;
    waves = std::min(waves, fewest);
  }
  if (s.small && waves > 1) return 1e30;
  // Cuts add blocks, and with one thread a column there is no room to bundle them.
  if (s.small && !pairs && 1.2 * blocks > static_cast<double>(at_once)) return 1e30;
  const double together = std::min<double>(each, std::ceil(blocks / limits.processors));
  // Warps that compute, on each scheduler.
  const double of_block = share   ? s.threads / 32.0
                          : pairs ? b.x * b.y / 16.0
                                  : std::ceil(b.x * b.y / 32.0);
  const double warps = together * of_block / 4;
  const double cell = (pairs ? 1400 : 1950) * std::max(1.8, 1.3 * warps);
  const double plane = 400 + 250 * warps;
  const double nodes =
      std::ceil(slots / s.threads) * (s.small ? 250 + 120 * parts : 300 + 60 * together);
  const double wave = nodes + cell * b.z + plane * (b.z + 2);
  // One thread a column makes contact and cuts dearer.
  const auto in_all = [&] {
    return s.small ? wave + (pairs ? 3500 : 5500) : 1.5 * waves * wave + 5000;
  };
  if (fill_boxes) return in_all();
  // Rims have cells that are not full and nodes of others; in a single layer most cells are of one.
  const double rim =
      1 + (b.z == 1 ? 0 : 0.15 * (plane_slots / (b.x * b.y) - 1)) + (parts > 8 ? 0.2 : 0);
  const auto with_surface = [&] { return rim * (in_all() + (s.small ? 0 : 10000 * waves)); };
  if (!share || with_surface() >= least) return with_surface();
  waves = rounds_of(counts, s, blocks, columns, at_once, limits.shared_bytes);
  return s.small && waves > 1 ? 1e30 : with_surface();
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

CudaShape shape_from(const char* text, bool pairs) {
  CudaShape s;
  BlockShape& b = s.blocks;
  int way = 0;
  if (std::sscanf(text, "%d %d %d %d %d", &b.x, &b.y, &b.z, &s.threads, &way) != 5 || way < 0 ||
      way > 1 || b.x < 1 || b.y < 1 || b.z < 1 || b.z > kMaxLayers || s.threads > kMaxCudaThreads ||
      s.threads % 32 != 0 || b.x * b.y > s.threads || (pairs && !s.pairs())) {
    throw std::runtime_error(
        std::string("TISSUE_SIM_CUDA_SHAPE is '") + text +
        "': it must be 'x y z threads way', threads a multiple of 32 up to "
        "256 and at least x y (2 x y where there is viscosity or more than one "
        "law), z at most 16, way 0 for large, 1 for small");
  }
  s.small = way == 1;
  return s;
}

}  // namespace

CudaShape choose_shape(const std::vector<LatticeBody>& bodies, const CudaLimits& limits,
                       bool whole) {
  const bool pairs = wants_pairs(bodies);
  if (const char* text = std::getenv("TISSUE_SIM_CUDA_SHAPE")) {
    return shape_from(text, pairs);
  }
  std::vector<BlockCounts> counts;
  counts.reserve(bodies.size());
  for (const LatticeBody& body : bodies) counts.emplace_back(body, kMaxCudaThreads, kMaxLayers);
  CudaShape best;
  best.blocks = {4, 4, 4};
  double least = 1e30;
  for (const bool small : {true, false}) {
    for (const int threads : {64, 96, 128, 192, 256}) {
      for (int x = threads; x > 0; --x) {  // of equals, the longest along x
        for (int y = 1; y <= threads / x; ++y) {
          for (int z = 1; z <= kMaxLayers; ++z) {
            CudaShape s;
            s.blocks = {x, y, z};
            s.threads = threads;
            s.small = small;
            if (pairs && !s.pairs()) continue;
            const double c = cycles(bodies, counts, s, limits, whole, least);
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

std::vector<BlockToBundle> blocks_to_bundle(const std::vector<Block*>& blocks) {
  std::map<std::pair<int, int>, int> kinds;  // of body and material
  std::vector<BlockToBundle> result;
  for (const Block* b : blocks) {
    const int kind = kinds.try_emplace({b->body, b->material}, kinds.size()).first->second;
    const int plane_slots = (b->nx + 2) * (b->ny + 2);
    result.push_back({kind, {columns_of(*b), plane_slots, plane_slots * (b->nz + 2)}});
  }
  return result;
}

}  // namespace tissue_sim

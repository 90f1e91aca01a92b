#include <algorithm>
#include <cub/device/device_scan.cuh>
#include <stdexcept>

#include "compute/for_each_cuda.h"
#include "math/cuda_union_find.h"
#include "paper/cuda_hash_grid.h"

namespace tissue_sim {
namespace {

constexpr std::int32_t kNone = 0x7f7f7f7f;  // above any point; made of equal bytes
enum { kGroups, kOutside, kFoundCount };

/// The cells of points, rounded as on the CPU.
struct Cells {
  PointPlaces places;
  CellBox box;
  float per_cell;

  /// Of a point, along each axis; false if it is outside of the box.
  __device__ bool of(int p, int (&c)[3]) const {
    bool inside = true;
    for (int a = 0; a < 3; ++a) {
      c[a] = 0;
      if (places.x[a] == nullptr) continue;
      const float x = __fmul_rn(__fsub_rn(places.x[a][p], box.lowest[a]), per_cell);
      inside = inside && x > -1 && x < static_cast<float>(box.n[a]);
      c[a] = static_cast<int>(x);
    }
    return inside;
  }
};

/// Each cell of the box has memory of its own.
struct DenseGrid {
  std::int32_t* lowest;
  int row, plane;

  __device__ std::int32_t place_for(const int (&c)[3]) const {
    return c[0] + row * c[1] + plane * c[2];
  }
  /// Of the cell one before along an axis, whose coordinates are `c`.
  __device__ std::int32_t place_before(const int (&)[3], std::int32_t own, int axis) const {
    return own - (axis == 0 ? 1 : axis == 1 ? row : plane);
  }
};

/// Cells that hold points have memory, at a place that their key is hashed to.
struct HashedGrid {
  std::int32_t* lowest;
  std::int64_t* key;  ///< -1 for none
  int mask;           ///< places less 1, which are a power of 2
  std::int64_t row, plane;

  __device__ std::int64_t key_of(const int (&c)[3]) const {
    return c[0] + row * c[1] + plane * c[2];
  }
  __device__ int first_place(std::int64_t k) const {
    return static_cast<int>(static_cast<std::uint64_t>(k) * 0x9e3779b97f4a7c15u >> 32) & mask;
  }
  __device__ std::int32_t place_for(const int (&c)[3]) const {
    const std::int64_t k = key_of(c);
    for (int i = first_place(k);; i = (i + 1) & mask) {
      const auto was =
          static_cast<std::int64_t>(atomicCAS(reinterpret_cast<unsigned long long*>(key + i), ~0ull,
                                              static_cast<unsigned long long>(k)));
      if (was == -1 || was == k) return i;
    }
  }
  __device__ std::int32_t place_before(const int (&c)[3], std::int32_t, int axis) const {
    const std::int64_t k = key_of(c) - (axis == 0 ? 1 : axis == 1 ? row : plane);
    for (int i = first_place(k);; i = (i + 1) & mask) {
      if (key[i] == k) return i;
      if (key[i] == -1) return -1;
    }
  }
};

/// Finds the cell of each point, and the lowest point of each cell.
template <class Grid>
struct Mark {
  Cells cells;
  Grid grid;
  std::int32_t *cell, *parent, *count, *found;
  __device__ void operator()(int p) const {
    int c[3];
    parent[p] = p;
    count[p] = 0;
    if (!cells.of(p, c)) {
      cell[p] = -1;
      found[kOutside] = 1;
      return;
    }
    const std::int32_t own = grid.place_for(c);
    cell[p] = own;
    // Points are often in order: then most find a lower one there already.
    if (grid.lowest[own] > p) atomicMin(grid.lowest + own, p);
  }
};

/// Joins each cell's lowest point with those of the cells before it. The higher root hangs on the
/// lower one, so each root is the lowest point of its group, whatever the order.
template <class Grid>
struct Join {
  Cells cells;
  Grid grid;
  const std::int32_t* cell;
  std::int32_t* parent;

  __device__ void operator()(int p) const {
    const std::int32_t own = cell[p];
    if (own < 0 || grid.lowest[own] != p) return;
    int c[3];
    cells.of(p, c);
    for (int a = 0; a < 3; ++a) {
      if (c[a] == 0) continue;
      const std::int32_t before = grid.place_before(c, own, a);
      if (before < 0) continue;
      const std::int32_t other = grid.lowest[before];
      if (other != kNone) join(parent, p, other);
    }
  }
};

/// Whether a point is its group's lowest, for the number of those before it. Hangs each point on
/// its root; others' paths only ever become shorter.
struct Flatten {
  const std::int32_t *cell, *lowest;
  std::int32_t *parent, *number, *label;
  __device__ void operator()(int p) const {
    if (cell[p] < 0) {
      label[p] = p;
      number[p] = 1;
      return;
    }
    const volatile std::int32_t* above = parent;
    std::int32_t r = lowest[cell[p]];
    while (above[r] != r) r = above[r];
    label[p] = r;
    number[p] = r == p ? 1 : 0;
  }
};

/// From lowest points to numbers; counts the points of each group, a warp's together where they are
/// of one.
struct Number {
  const std::int32_t* number;  ///< of groups up to a point
  std::int32_t *label, *count, *found;
  int points;
  __device__ void operator()(int p) const {
    const std::int32_t group = number[label[p]] - 1;
    label[p] = group;
    const unsigned together = __match_any_sync(__activemask(), group);
    if (__ffs(static_cast<int>(together)) - 1 == static_cast<int>(threadIdx.x % 32)) {
      atomicAdd(count + group, __popc(together));
    }
    if (p == points - 1) found[kGroups] = number[p];
  }
};

/// Whether each cell of the box gets memory of its own: as on the CPU, whose rows are longer.
bool is_dense(const PointPlaces& places, const CellBox& box) {
  const double cells = static_cast<double>(box.n[0]) * box.n[1] * box.n[2];
  return cells <= std::min(2e9, std::max(4e6, 32.0 * places.count));
}

}  // namespace

void CudaHashGrid::find_groups(const PointPlaces& places, const CellBox& box, cudaStream_t stream) {
  const int n = places.count;
  const Gpu gpu(stream);
  cell_.resize(n);
  parent_.resize(n);
  number_.resize(n);
  of_point_.resize(n);
  count_.resize(n);
  found_.resize(kFoundCount);
  found_.clear(stream);
  if (n == 0) return;
  const Cells cells{places, box, 1 / box.cell_size};
  const auto search = [&](const auto& grid) {
    using Grid = std::decay_t<decltype(grid)>;
    check_cuda(cudaMemsetAsync(lowest_.data(), 0x7f, lowest_.size() * sizeof(std::int32_t), stream),
               "clear memory");
    gpu.for_each(
        n, Mark<Grid>{cells, grid, cell_.data(), parent_.data(), count_.data(), found_.data()});
    gpu.for_each(n, Join<Grid>{cells, grid, cell_.data(), parent_.data()});
  };
  if (is_dense(places, box)) {
    lowest_.resize(static_cast<std::size_t>(box.n[0]) * box.n[1] * box.n[2]);
    search(DenseGrid{lowest_.data(), box.n[0], box.n[0] * box.n[1]});
  } else {
    std::size_t room = 64;
    while (room < 2 * static_cast<std::size_t>(n)) room *= 2;
    lowest_.resize(room);
    key_.resize(room);
    check_cuda(cudaMemsetAsync(key_.data(), 0xff, room * sizeof(std::int64_t), stream),
               "clear memory");
    const auto row = static_cast<std::int64_t>(box.n[0]);
    search(
        HashedGrid{lowest_.data(), key_.data(), static_cast<int>(room - 1), row, row * box.n[1]});
  }
  gpu.for_each(
      n, Flatten{cell_.data(), lowest_.data(), parent_.data(), number_.data(), of_point_.data()});
  std::size_t room = 0;
  check_cuda(
      cub::DeviceScan::InclusiveSum(nullptr, room, number_.data(), number_.data(), n, stream),
      "number groups");
  scan_.resize(std::max(room, scan_.size()));
  check_cuda(
      cub::DeviceScan::InclusiveSum(scan_.data(), room, number_.data(), number_.data(), n, stream),
      "number groups");
  gpu.for_each(n, Number{number_.data(), of_point_.data(), count_.data(), found_.data(), n});
}

std::int32_t CudaHashGrid::wait(cudaStream_t stream) {
  on_host_.resize(kFoundCount);
  found_.download(on_host_.data(), kFoundCount, stream);
  check_cuda(cudaStreamSynchronize(stream), "find fragments");
  if (on_host_[kOutside] != 0) {
    throw std::invalid_argument("a point lies outside of the grid: make it larger");
  }
  return on_host_[kGroups];
}

}  // namespace tissue_sim

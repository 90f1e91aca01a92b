#include <algorithm>

#include "compute/for_each_cuda.h"
#include "math/cuda_union_find.h"
#include "mpm/cuda/label_pieces.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {
namespace {

__device__ __forceinline__ bool holds(const std::uint8_t* bonds, std::int32_t p, int bond) {
  return (bonds[p] >> bond & 1) != 0;
}

/// Each point hangs on the one before it along x that it holds on to.
struct Hang {
  const std::uint8_t* bonds;
  std::int32_t* parent;
  __device__ void operator()(int p) const {
    parent[p] = holds(bonds, p, opposite_bond(kForwardBond)) ? p - 1 : p;
  }
};

/// Joins the trees of points that hold on to each other along y and z: the root with the higher
/// number hangs on the lower one, so that in the end each root is the lowest of its points.
struct Join {
  SiteRows sites;
  const std::uint8_t* bonds;
  std::int32_t* parent;

  __device__ void operator()(int i) const {
    const std::int32_t p = sites.point_at[i];
    if (p < 0) return;
    if (holds(bonds, p, kForwardBond + 1)) join(parent, p, sites.point_at[i + sites.row]);
    if (holds(bonds, p, kForwardBond + 2)) join(parent, p, sites.point_at[i + sites.plane]);
  }
};

/// Each point gets its root. Without making other paths shorter: a late write would undo it.
struct Flatten {
  volatile std::int32_t* parent;
  __device__ void operator()(int p) const {
    std::int32_t lowest = p;
    while (parent[lowest] != lowest) lowest = parent[lowest];
    parent[p] = lowest;
  }
};

/// Lists where runs of points begin and end that have another label than before.
struct ListRuns {
  const std::int32_t *before, *now;
  int points, room;
  PartedRun* begins;
  std::int32_t* ends;
  int* counts;

  __device__ bool follow(int p, int q) const {  // one run
    return now[p] == now[q] && before[p] == before[q];
  }
  __device__ void operator()(int p) const {
    if (now[p] == before[p]) return;
    if (p == 0 || !follow(p - 1, p)) {
      const int i = atomicAdd(counts, 1);
      if (i < room) begins[i] = {p, 0, now[p]};
    }
    if (p + 1 == points || !follow(p, p + 1)) {
      const int i = atomicAdd(counts + 1, 1);
      if (i < room) ends[i] = p + 1;
    }
  }
};

}  // namespace

std::vector<PartedRun> PieceLabels::update(const std::vector<SiteRows>& bodies,
                                           const std::uint8_t* bonds, cudaStream_t stream) {
  const int points = static_cast<int>(lowest_.size());
  next_.resize(points);
  counts_.resize(2);
  host_counts_.resize(2);
  begins_.resize(std::max<std::size_t>(begins_.size(), 4096));
  const Gpu gpu(stream);
  gpu.for_each(points, Hang{bonds, next_.data()});
  for (const SiteRows& sites : bodies) {
    gpu.for_each(sites.count, Join{sites, bonds, next_.data()});
  }
  gpu.for_each(points, Flatten{next_.data()});
  const auto list = [&] {
    const int room = static_cast<int>(begins_.size());
    ends_.resize(room);
    counts_.clear(stream);
    gpu.for_each(points, ListRuns{lowest_.data(), next_.data(), points, room, begins_.data(),
                                  ends_.data(), counts_.data()});
    counts_.download(host_counts_.data(), 2, stream);
    check_cuda(cudaStreamSynchronize(stream), "label pieces");
    return host_counts_[0] <= room;
  };
  if (!list()) {
    begins_.resize(host_counts_[0]);
    list();
  }
  std::vector<PartedRun> runs(host_counts_[0]);
  std::vector<std::int32_t> ends(runs.size());
  begins_.download(runs.data(), runs.size(), stream);
  ends_.download(ends.data(), ends.size(), stream);
  check_cuda(cudaStreamSynchronize(stream), "send data");
  std::sort(runs.begin(), runs.end(),
            [](const PartedRun& a, const PartedRun& b) { return a.begin < b.begin; });
  std::sort(ends.begin(), ends.end());
  for (std::size_t i = 0; i < runs.size(); ++i) runs[i].end = ends[i];
  lowest_.swap(next_);
  return runs;
}

}  // namespace tissue_sim

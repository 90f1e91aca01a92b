// Nodes of tissue that lives on a GPU on their way to the host and back.
#include <algorithm>

#include "mpm/cuda/on_device.h"

namespace tissue_sim {
namespace {

constexpr int kGrain = 1024;  // nodes that a thread takes at once

}  // namespace

void CudaMpmTissue::pull() {
  pull_nodes();
  pull_contacts();
}

void CudaMpmTissue::pull_nodes() {
  pull_field(device_->present().u, state_->nodes.u);
  pull_field(device_->present().v, state_->nodes.v);
  pull_front();
}

void CudaMpmTissue::pull_field(const float4* from, Array<float>* to) {
  OnDevice& d = *device_;
  const std::size_t n = state_->nodes.size();
  d.host_nodes.resize(2 * n);
  check_cuda(cudaMemcpyAsync(d.host_nodes.data(), from, n * sizeof(float4), cudaMemcpyDeviceToHost,
                             d.stream),
             "send data");
  check_cuda(cudaStreamSynchronize(d.stream), "finish a frame");
  unpack_field(d.host_nodes.data(), n, *state_->cpu, to);
}

void CudaMpmTissue::push_nodes() {
  OnDevice& d = *device_;
  const std::size_t n = state_->nodes.size();
  d.host_nodes.resize(2 * n);
  pack_nodes(state_->nodes, *state_->cpu, d.host_nodes.data(), d.host_nodes.data() + n);
  d.u[d.current].upload(d.host_nodes.data(), n, d.stream);
  d.v[d.current].upload(d.host_nodes.data() + n, n, d.stream);
  // What no block moves, the other state has, too.
  d.u[1 - d.current].copy(d.u[d.current], d.stream);
  d.v[1 - d.current].copy(d.v[d.current], d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
  push_front();
}

std::vector<std::int32_t> CudaMpmTissue::nodes_around(
    const std::vector<std::int32_t>& points) const {
  // A bit of debris (mpm/tear/debris.h) reaches at most four cells from a point that lost a bond,
  // what it gives its spin to two more, and their nodes one.
  constexpr int kReach = 8;
  struct Range {
    int min[3] = {1 << 30, 1 << 30, 1 << 30}, max[3] = {-1, -1, -1};
  };
  std::vector<Range> ranges(state_->bodies.size());
  for (const std::int32_t p : points) {
    const Points::Site& s = state_->points.site[p];
    const int cell[3] = {s.x / 2, s.y / 2, s.z / 2};
    Range& range = ranges[s.body];
    for (int a = 0; a < 3; ++a) {
      range.min[a] = std::min(range.min[a], cell[a]);
      range.max[a] = std::max(range.max[a], cell[a]);
    }
  }
  std::vector<std::int32_t> nodes;
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const LatticeBody& b = state_->bodies[i];
    const int size[3] = {b.nx, b.ny, b.nz};
    int first[3], last[3];
    for (int a = 0; a < 3; ++a) {
      first[a] = std::max(ranges[i].min[a] - kReach, -1);
      last[a] = std::min(ranges[i].max[a] + kReach, size[a]);
    }
    if (ranges[i].max[0] < 0) continue;
    for (int z = first[2]; z <= last[2]; ++z) {
      for (int y = first[1]; y <= last[1]; ++y) {
        for (int x = first[0]; x <= last[0]; ++x) nodes.push_back(b.node(x, y, z));
      }
    }
  }
  for (int n = state_->blocks.first_split_node; n < static_cast<int>(state_->nodes.size()); ++n) {
    nodes.push_back(n);
  }
  return nodes;
}

const float4* CudaMpmTissue::gather(const CudaNodes& from, const std::vector<std::int32_t>& nodes) {
  OnDevice& d = *device_;
  const std::size_t count = nodes.size();
  d.some_nodes.upload(nodes, d.stream);
  d.packed.resize(2 * count);
  launch_gather(from, d.some_nodes.data(), static_cast<int>(count), d.packed.data(), d.stream);
  d.host_nodes.resize(2 * count);
  d.packed.download(d.host_nodes.data(), 2 * count, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "send data");
  return d.host_nodes.data();
}

void CudaMpmTissue::pull_some(const std::vector<std::int32_t>& nodes) {
  const std::size_t count = nodes.size();
  const float4* packed = gather(device_->present(), nodes);
  Nodes& n = state_->nodes;
  state_->cpu->for_each(
      static_cast<int>(count),
      [&](int i) {
        const float4 &u = packed[i], &v = packed[count + i];
        const std::int32_t k = nodes[i];
        n.u[0][k] = u.x, n.u[1][k] = u.y, n.u[2][k] = u.z;
        n.v[0][k] = v.x, n.v[1][k] = v.y, n.v[2][k] = v.z;
      },
      kGrain);
}

void CudaMpmTissue::push_some(const std::vector<std::int32_t>& nodes) {
  OnDevice& d = *device_;
  const std::size_t count = nodes.size();
  // Parted nodes stay behind the others; where there are more of these, push_front() brings them.
  const std::size_t entries = std::max(d.entries(), state_->nodes.size());
  for (int i = 0; i < 2; ++i) {
    d.u[i].extend(entries, d.stream);
    d.v[i].extend(entries, d.stream);
  }
  d.host_nodes.resize(2 * count);
  const Nodes& n = state_->nodes;
  state_->cpu->for_each(
      static_cast<int>(count),
      [&](int i) {
        const std::int32_t k = nodes[i];
        d.host_nodes[i] = {n.u[0][k], n.u[1][k], n.u[2][k], n.mass[k]};
        d.host_nodes[count + i] = {n.v[0][k], n.v[1][k], n.v[2][k], n.inv_mass[k]};
      },
      kGrain);
  d.some_nodes.upload(nodes, d.stream);
  d.packed.upload(d.host_nodes.data(), 2 * count, d.stream);
  launch_scatter(d.packed.data(), d.some_nodes.data(), static_cast<int>(count), d.present(),
                 d.nodes(1 - d.current), d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
}

}  // namespace tissue_sim

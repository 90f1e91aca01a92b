// Nodes of tissue that lives on a GPU on their way to the host and back.
#include <algorithm>
#include <array>

#include "mpm/cuda/cuda_device.h"
#include "mpm/cuda/on_device.h"
#include "mpm/point_fields.h"

namespace tissue_sim {
namespace {

constexpr int kGrain = 1024;  // nodes that a thread takes at once

void pull_field(CudaTissue& d, const float4* from, Array<float>* to) {
  const std::size_t n = d.state.nodes.size();
  d.host_nodes.resize(2 * n);
  check_cuda(cudaMemcpyAsync(d.host_nodes.data(), from, n * sizeof(float4), cudaMemcpyDeviceToHost,
                             d.stream),
             "send data");
  check_cuda(cudaStreamSynchronize(d.stream), "finish a frame");
  unpack_field(d.host_nodes.data(), n, *d.state.cpu, to);
}

}  // namespace

void pull(CudaTissue& d) {
  pull_nodes(d);
  pull_contacts(d);
}

void pull_nodes(CudaTissue& d) {
  pull_field(d, d.present().u, d.state.nodes.u);
  pull_field(d, d.present().v, d.state.nodes.v);
  pull_front(d);
}

void push_nodes(CudaTissue& d) {
  const std::size_t n = d.state.nodes.size();
  d.host_nodes.resize(2 * n);
  pack_nodes(d.state.nodes, *d.state.cpu, d.host_nodes.data(), d.host_nodes.data() + n);
  d.u[d.current].upload(d.host_nodes.data(), n, d.stream);
  d.v[d.current].upload(d.host_nodes.data() + n, n, d.stream);
  // What no block moves, the other state has, too.
  d.u[1 - d.current].copy(d.u[d.current], d.stream);
  d.v[1 - d.current].copy(d.v[d.current], d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
  push_front(d);
}

std::vector<std::int32_t> nodes_around(const CudaTissue& d,
                                       const std::vector<std::int32_t>& points) {
  // A bit of debris (mpm/tear/debris.h) reaches at most four cells from a point that lost a bond,
  // what it gives its spin to two more, and their nodes one.
  constexpr int kReach = 8;
  struct Range {
    int min[3] = {1 << 30, 1 << 30, 1 << 30}, max[3] = {-1, -1, -1};
  };
  std::vector<Range> ranges(d.state.bodies.size());
  for (const std::int32_t p : points) {
    const Points::Site& s = d.state.points.site[p];
    const int cell[3] = {s.x / 2, s.y / 2, s.z / 2};
    Range& range = ranges[s.body];
    for (int a = 0; a < 3; ++a) {
      range.min[a] = std::min(range.min[a], cell[a]);
      range.max[a] = std::max(range.max[a], cell[a]);
    }
  }
  std::vector<std::int32_t> nodes;
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const LatticeBody& b = d.state.bodies[i];
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
  for (int n = d.state.blocks.first_split_node; n < static_cast<int>(d.state.nodes.size()); ++n) {
    nodes.push_back(n);
  }
  return nodes;
}

const float4* gather(CudaTissue& d, const CudaNodes& from, const std::vector<std::int32_t>& nodes) {
  const std::size_t count = nodes.size();
  d.some_nodes.upload(nodes, d.stream);
  d.packed.resize(2 * count);
  launch_gather(from, d.some_nodes.data(), static_cast<int>(count), d.packed.data(), d.stream);
  d.host_nodes.resize(2 * count);
  d.packed.download(d.host_nodes.data(), 2 * count, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "send data");
  return d.host_nodes.data();
}

void pull_some(CudaTissue& d, const std::vector<std::int32_t>& nodes) {
  const std::size_t count = nodes.size();
  const float4* packed = gather(d, d.present(), nodes);
  Nodes& n = d.state.nodes;
  d.state.cpu->for_each(
      static_cast<int>(count),
      [&](int i) {
        const float4 &u = packed[i], &v = packed[count + i];
        const std::int32_t k = nodes[i];
        n.u[0][k] = u.x, n.u[1][k] = u.y, n.u[2][k] = u.z;
        n.v[0][k] = v.x, n.v[1][k] = v.y, n.v[2][k] = v.z;
      },
      kGrain);
}

void push_some(CudaTissue& d, const std::vector<std::int32_t>& nodes) {
  const std::size_t count = nodes.size();
  // Parted nodes stay behind the others; where there are more of these, push_front() brings them.
  const std::size_t entries = std::max(d.entries(), d.state.nodes.size());
  for (int i = 0; i < 2; ++i) {
    d.u[i].extend(entries, d.stream);
    d.v[i].extend(entries, d.stream);
  }
  d.host_nodes.resize(2 * count);
  const Nodes& n = d.state.nodes;
  d.state.cpu->for_each(
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

void CudaMpmDevice::bring_nodes(const std::vector<std::int32_t>& points) {
  tissue_->brought = nodes_around(*tissue_, points);
  pull_some(*tissue_, tissue_->brought);
}

void CudaMpmDevice::send_nodes() { push_some(*tissue_, tissue_->brought); }

void CudaMpmDevice::bring_all_nodes() { pull_nodes(*tissue_); }

void CudaMpmDevice::place_boundary() {
  CudaTissue& d = *tissue_;
  const BoundaryMesh& mesh = d.state.boundary;
  const std::size_t count = mesh.vertices.size();
  if (d.boundary_made != mesh.made) d.boundary.upload(mesh.vertices, d.stream);
  d.boundary_made = mesh.made;
  d.boundary_places.resize(3 * count);
  d.host_boundary.resize(3 * count);
  launch_boundary_places(d.present(), d.boundary.data(), static_cast<int>(count),
                         d.boundary_places.data(), d.stream);
  d.boundary_places.download(d.host_boundary.data(), 3 * count, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "send data");
  const float* now = d.host_boundary.data();
  tissue_sim::place_boundary(d.state, [now](int i) {
    return std::array<float, 3>{now[3 * i], now[3 * i + 1], now[3 * i + 2]};
  });
}

}  // namespace tissue_sim

// The front of a cut of tissue that lives on a GPU: where it goes the host works out, from the
// nodes at its rim; what its cells push, the GPU (front_cells.cu).
#include <algorithm>

#include "mpm/cuda/on_device.h"
#include "mpm/split/front.h"

namespace tissue_sim {
namespace {

/// The nodes that points at the rim of a cut see, or that these points and those beside them do.
std::vector<std::int32_t> nodes_of_rim(const MpmState& s, const std::vector<std::int32_t>& broken) {
  std::vector<std::uint8_t> wanted(s.nodes.size(), 0);
  const auto add = [&](std::int32_t point, int beside) {
    const Points::Site& site = s.points.site[point];
    const LatticeBody& body = s.bodies[site.body];
    const int first[3] = {(site.x - beside) / 2 - 1, (site.y - beside) / 2 - 1,
                          (site.z - beside) / 2 - 1};
    // The bond's other end may be a point further on.
    const int last[3] = {(site.x + beside + 1) / 2 + 1, (site.y + beside + 1) / 2 + 1,
                         (site.z + beside + 1) / 2 + 1};
    for (int z = std::max(first[2], -1); z <= std::min(last[2], body.nz); ++z) {
      for (int y = std::max(first[1], -1); y <= std::min(last[1], body.ny); ++y) {
        for (int x = std::max(first[0], -1); x <= std::min(last[0], body.nx); ++x) {
          wanted[body.node(x, y, z)] = 1;
        }
      }
    }
  };
  for (const auto& [bond, passed] : s.front.rim) add(static_cast<std::int32_t>(bond / 3), 0);
  for (const std::int32_t p : broken) add(p, 1);
  std::fill(wanted.begin() + s.blocks.first_split_node, wanted.end(), std::uint8_t{1});
  std::vector<std::int32_t> nodes;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (wanted[i] != 0) nodes.push_back(static_cast<std::int32_t>(i));
  }
  return nodes;
}

}  // namespace

void CudaMpmTissue::follow_rim(const BladePath& path, const float4* u_before,
                               const std::vector<std::int32_t>& broken,
                               std::vector<std::int32_t>& touched) {
  MpmState& s = *state_;
  if (broken.empty() && s.front.rim.empty()) return;
  OnDevice& d = *device_;
  const std::vector<std::int32_t> nodes = nodes_of_rim(s, broken);
  pull_some(nodes);
  if (u_before == nullptr) {
    pass_rim(s, path, s.nodes.u, s.nodes.u, broken, touched);
    return;
  }
  // pull_some() left the list there.
  const std::size_t count = nodes.size();
  launch_gather({const_cast<float4*>(u_before), d.present().v}, d.some_nodes.data(),
                static_cast<int>(count), d.packed.data(), d.stream);
  d.packed.download(d.host_nodes.data(), count, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "send data");
  Array<float> before[3];
  for (Array<float>& u : before) u.resize(s.nodes.size());
  for (std::size_t i = 0; i < count; ++i) {
    const float4& u = d.host_nodes[i];
    before[0][nodes[i]] = u.x, before[1][nodes[i]] = u.y, before[2][nodes[i]] = u.z;
  }
  pass_rim(s, path, before, s.nodes.u, broken, touched);
}

void CudaMpmTissue::bring_front() {
  FrontOnDevice& f = device_->front;
  const std::size_t count = f.d.size();
  f.host_d.resize(count);
  f.host_rate.resize(count);
  f.d.download(f.host_d.data(), count, device_->stream);
  f.rate.download(f.host_rate.data(), count, device_->stream);
}

void CudaMpmTissue::take_front() {
  const FrontOnDevice& f = device_->front;
  Front& front = state_->front;
  for (std::size_t i = 0; i < f.d.size(); ++i) {
    const float4 &d = f.host_d[i], &rate = f.host_rate[i];
    front.d[0][i] = d.x, front.d[1][i] = d.y, front.d[2][i] = d.z;
    front.rate[0][i] = rate.x, front.rate[1][i] = rate.y, front.rate[2][i] = rate.z;
  }
}

void CudaMpmTissue::pull_front() {
  if (device_->front.d.size() == 0) return;
  bring_front();
  check_cuda(cudaStreamSynchronize(device_->stream), "send data");
  take_front();
}

void CudaMpmTissue::push_front() {
  FrontOnDevice& f = device_->front;
  const Front& front = state_->front;
  const cudaStream_t stream = device_->stream;
  if (f.empty() && front.cells.empty()) return;
  const std::size_t count = front.nodes.size();
  std::vector<float4> d(count), rate(count);
  for (std::size_t i = 0; i < count; ++i) {
    d[i] = {front.d[0][i], front.d[1][i], front.d[2][i], front.nodes[i].mass};
    rate[i] = {front.rate[0][i], front.rate[1][i], front.rate[2][i], 0};
  }
  f.d.upload(d, stream);
  f.rate.upload(rate, stream);
  f.d_before.copy(f.d, stream);
  f.rate_before.copy(f.rate, stream);
  f.cells.upload(front.cells, stream);
  f.parts.upload(front.parts, stream);
  f.node_sums.upload(front.node_sums, stream);
  f.part_sums.upload(front.part_sums, stream);
  f.node_places.upload(front.node_places, stream);
  f.part_places.upload(front.part_places, stream);
  f.force.resize(kFrontForce / 4 * front.cells.size());
  f.pull.resize(front.parts.size());
  f.energy.resize(front.cells.size());
  check_cuda(cudaStreamSynchronize(stream), "receive data");
}

void CudaMpmTissue::measure_front() {
  OnDevice& d = *device_;
  if (d.front.empty()) return;
  launch_front_energy(d.front, d.present(), d.stream);
  d.front.host_energy.resize(d.front.energy.size());
  d.front.energy.download(d.front.host_energy.data(), d.front.energy.size(), d.stream);
  bring_front();
}

}  // namespace tissue_sim

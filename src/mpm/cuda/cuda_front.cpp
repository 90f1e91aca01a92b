// The front of a cut of tissue that lives on a GPU: the host says which nodes are parted and which
// cells see them, as on the CPU; how far they are apart lives with the nodes.
#include <algorithm>

#include "mpm/cuda/on_device.h"
#include "mpm/split/front.h"

namespace tissue_sim {
namespace {

/// CudaFront::tasks: first passes first, for these have most to do.
std::vector<int4> list_tasks(const Front& front) {
  constexpr int kEach = 4;  // stresses of a pass
  std::vector<int4> tasks;
  bool more = true;
  for (int pass = 0; more; ++pass) {
    more = false;
    for (std::size_t i = 0; i < front.cells.size(); ++i) {
      const FrontPart* parts = front.parts.data() + front.cells[i].first;
      const auto beside = std::count_if(parts, parts + front.cells[i].count,
                                        [](const FrontPart& p) { return p.step > 0; });
      if (pass > beside / kEach) continue;
      const FrontCell& cell = front.cells[i];
      tasks.push_back({static_cast<int>(i), pass, cell.first, cell.count});
      more = more || pass < beside / kEach;
    }
  }
  for (std::size_t i = 0; i < front.cells.size(); ++i) {
    const FrontCell& cell = front.cells[i];
    if (cell.stabilised > 0) {
      tasks.push_back({static_cast<int>(i), kStabilises, cell.first, cell.count});
    }
  }
  return tasks;
}

}  // namespace

void pull_front(CudaTissue& d) {
  const auto first = static_cast<std::size_t>(d.front.first_node),
             count = static_cast<std::size_t>(d.front.node_count);
  if (count == 0) return;
  d.host_nodes.resize(2 * count);
  const auto bring = [&](const float4* from, float4* to) {
    check_cuda(
        cudaMemcpyAsync(to, from + first, count * sizeof(float4), cudaMemcpyDeviceToHost, d.stream),
        "send data");
  };
  bring(d.present().u, d.host_nodes.data());
  bring(d.present().v, d.host_nodes.data() + count);
  check_cuda(cudaStreamSynchronize(d.stream), "send data");
  Front& front = d.state.front;
  for (std::size_t i = 0; i < count; ++i) {
    const float4 &u = d.host_nodes[i], &v = d.host_nodes[count + i];
    front.d[0][i] = u.x, front.d[1][i] = u.y, front.d[2][i] = u.z;
    front.rate[0][i] = v.x, front.rate[1][i] = v.y, front.rate[2][i] = v.z;
  }
}

void push_front(CudaTissue& d) {
  FrontOnDevice& to = d.front;
  const Front& front = d.state.front;
  const std::size_t first = d.state.nodes.size(), count = front.nodes.size();
  to.first_node = static_cast<int>(first);
  to.node_count = static_cast<int>(count);
  to.marked = false;
  d.host_nodes.resize(2 * count);
  for (std::size_t i = 0; i < count; ++i) {
    const float mass = front.nodes[i].mass;
    d.host_nodes[i] = {front.d[0][i], front.d[1][i], front.d[2][i], mass};
    d.host_nodes[count + i] = {front.rate[0][i], front.rate[1][i], front.rate[2][i], 1 / mass};
  }
  for (int i = 0; i < 2; ++i) {
    const auto send = [&](DeviceArray<float4>& field, const float4* from) {
      field.extend(first + count, d.stream);
      if (count == 0) return;
      check_cuda(cudaMemcpyAsync(field.data() + first, from, count * sizeof(float4),
                                 cudaMemcpyHostToDevice, d.stream),
                 "receive data");
    };
    send(d.u[i], d.host_nodes.data());
    send(d.v[i], d.host_nodes.data() + count);
  }
  to.cells.upload(front.cells, d.stream);
  to.parts.upload(front.parts, d.stream);
  to.tasks.upload(list_tasks(front), d.stream);
  to.energy.resize(front.cells.size() + count);
  to.host_energy.resize(to.energy.size());
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
}

NodePushes clear_pushes(CudaTissue& d) {
  d.pushed.resize(3 * kPushStride * d.entries());
  d.pushed.clear(d.stream);
  if (has_front(d) && !d.front.marked) {
    launch_mark_front(d.front.view(), d.marks.data(), d.marks.size(), d.stream);
    launch_mark_slots(d.tables(), d.marks.data(), d.pushed_parts.data(), d.pushed_parts.size(),
                      d.stream);
    d.front.marked = true;
  }
  NodePushes pushes{d.pushed.data(), d.pushed.size() / 3};
  if (d.outer.size() > 0) {
    d.inertia.resize(3 * kInertiaStride * d.entries());
    d.inertia.clear(d.stream);
    pushes.inertia = d.inertia.data();
    pushes.inertia_stride = d.inertia.size() / 3;
  }
  return pushes;
}

void pass_rim(CudaTissue& d, const BladePath& path, bool moves,
              const std::vector<std::int32_t>& broken, std::vector<std::int32_t>& touched) {
  std::vector<std::int32_t> points = broken;
  for (const auto& [bond, passed] : d.state.front.rim) {
    points.push_back(static_cast<std::int32_t>(bond / 3));
  }
  if (points.empty()) return;
  const std::vector<std::int32_t> nodes = nodes_around(d, points);
  const Array<float>*end = d.state.nodes.u, *begin = end;
  if (moves) {
    float4* u_before = d.u_before.data();
    Array<float>* before = d.state.work.u_before;
    for (int a = 0; a < 3; ++a) before[a].resize(d.state.nodes.size());
    const float4* u = gather(d, {u_before, u_before}, nodes);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      before[0][nodes[i]] = u[i].x, before[1][nodes[i]] = u[i].y, before[2][nodes[i]] = u[i].z;
    }
    begin = before;
  }
  pull_some(d, nodes);
  tissue_sim::pass_rim(d.state, path, begin, end, broken, nullptr, touched);
}

}  // namespace tissue_sim

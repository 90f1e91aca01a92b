// Nodes of tissue that lives on a GPU on their way to the host and back.
#include <algorithm>
#include <array>

#include "mpm/cuda/on_device.h"
#include "mpm/split/front.h"
#include "mpm/state_figures.h"

namespace tissue_sim {
namespace {

constexpr int kGrain = 1024;  // nodes that a thread takes at once

float4 packed(const Array<float>* of, std::size_t i, float fourth) {
  return {of[0][i], of[1][i], of[2][i], fourth};
}
void unpack(const float4& from, Array<float>* to, std::size_t i) {
  to[0][i] = from.x, to[1][i] = from.y, to[2][i] = from.z;
}

void pull_field(CudaTissue& d, const float4* from, Array<float>* to) {
  const std::size_t n = d.state.nodes.size();
  d.host_nodes.resize(2 * n);
  check_cuda(cudaMemcpyAsync(d.host_nodes.data(), from, n * sizeof(float4), cudaMemcpyDeviceToHost,
                             d.stream),
             "send data");
  check_cuda(cudaStreamSynchronize(d.stream), "finish a frame");
  d.state.cpu->for_each(
      static_cast<int>(n), [&](int i) { unpack(d.host_nodes[i], to, i); }, 4 * kGrain);
}

}  // namespace

void pull_nodes(CudaTissue& d) {
  pull_field(d, d.present().u, d.state.nodes.u);
  pull_field(d, d.present().v, d.state.nodes.v);
  pull_front(d);
}

void push_nodes(CudaTissue& d) {
  const Nodes& nodes = d.state.nodes;
  const std::size_t n = nodes.size();
  d.host_nodes.resize(2 * n);
  d.state.cpu->for_each(
      static_cast<int>(n),
      [&](int i) {
        d.host_nodes[i] = packed(nodes.u, i, nodes.mass[i]);
        d.host_nodes[n + i] = packed(nodes.v, i, nodes.inv_mass[i]);
      },
      4 * kGrain);
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
  for (int n = lattice_node_count(d.state.bodies); n < static_cast<int>(d.state.nodes.size());
       ++n) {
    nodes.push_back(n);
  }
  return nodes;
}

void pull_some(CudaTissue& d, const std::vector<std::int32_t>& nodes) {
  const std::size_t count = nodes.size();
  const float4* const from = d.some.bring(d.present(), nodes, d.stream);
  Nodes& n = d.state.nodes;
  d.state.cpu->for_each(
      static_cast<int>(count),
      [&](int i) {
        unpack(from[i], n.u, nodes[i]);
        unpack(from[count + i], n.v, nodes[i]);
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
  float4* const to = d.some.room(count, d.stream);
  const Nodes& n = d.state.nodes;
  d.state.cpu->for_each(
      static_cast<int>(count),
      [&](int i) {
        const std::int32_t k = nodes[i];
        to[i] = packed(n.u, k, n.mass[k]);
        to[count + i] = packed(n.v, k, n.inv_mass[k]);
      },
      kGrain);
  d.some.send(nodes, d.present(), d.nodes(1 - d.current), d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
}

void CudaTissue::bring_nodes(const std::vector<std::int32_t>& points) {
  brought = nodes_around(*this, points);
  pull_some(*this, brought);
}

void CudaTissue::send_nodes() { push_some(*this, brought); }

void CudaTissue::bring_all_nodes() { pull_nodes(*this); }

void CudaTissue::bring_motion(const std::vector<std::int32_t>& nodes) { pull_some(*this, nodes); }

void CudaTissue::bring_motion_around(const std::vector<EdgePlace>& places) {
  std::vector<std::int32_t> points;
  for (const EdgePlace& p : places) {
    const std::int32_t point = state.bodies[p.body].point(p.site[0], p.site[1], p.site[2]);
    if (point >= 0) points.push_back(point);
  }
  pull_some(*this, nodes_around(*this, points));
}

void CudaTissue::send_velocities(const std::vector<std::int32_t>& nodes) {
  float4* const v = some.room(nodes.size(), stream) + nodes.size();
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    v[i] = packed(state.nodes.v, nodes[i], v[i].w);
  }
  some.send(nodes, present(), this->nodes(1 - current), stream);
}

// The front of a cut of tissue that lives on a GPU: the host says which nodes are parted and which
// cells see them, as on the CPU; how far they are apart lives with the nodes.

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
    unpack(d.host_nodes[i], front.d, i);
    unpack(d.host_nodes[count + i], front.rate, i);
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
    d.host_nodes[i] = packed(front.d, i, mass);
    d.host_nodes[count + i] = packed(front.rate, i, 1 / mass);
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
    const float4* u = d.some.bring({u_before, u_before}, nodes, d.stream);
    for (std::size_t i = 0; i < nodes.size(); ++i) unpack(u[i], before, nodes[i]);
    begin = before;
  }
  pull_some(d, nodes);
  tissue_sim::pass_rim(d.state, path, begin, end, broken, nullptr, touched);
}

}  // namespace tissue_sim

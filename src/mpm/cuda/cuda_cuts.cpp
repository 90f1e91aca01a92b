// Cuts of tissue that lives on a GPU: the blade's sweep runs there. What follows from the bonds
// that it breaks, the fields of nodes around and the blocks there, the host works out; what it
// needs of the nodes comes down, what changed goes up.
#include <algorithm>
#include <tuple>

#include "cutting/blade_sweep.h"
#include "mpm/cuda/on_device.h"
#include "mpm/cut_tissue.h"

namespace tissue_sim {
namespace {

Vector3 vector(const Vec3& v) { return {v[0], v[1], v[2]}; }

std::vector<CudaSweptEdge> edges_of(const BladePath& path) {
  std::vector<CudaSweptEdge> edges;
  for (const SweepPart& part : sweep_parts(path)) {
    for (const SweptEdge& e : part.edges) {
      CudaSweptEdge edge;
      edge.edge.a0 = vector(e.a0);
      edge.edge.b0 = vector(e.b0);
      edge.edge.a1 = vector(e.a1);
      edge.edge.b1 = vector(e.b1);
      for (int i = 0; i < 3; ++i) {
        edge.edge.slabs[i] = {vector(e.slabs[i].axis), e.slabs[i].low, e.slabs[i].high};
      }
      edge.begin = part.begin;
      edge.end = part.end;
      edges.push_back(edge);
    }
  }
  return edges;
}

std::vector<BrokenBond> bonds_swept(CudaTissue& d, const BladePath& path, bool moves) {
  SweepOnDevice& on = d.blade;
  const std::vector<CudaSweptEdge> edges = edges_of(path);
  if (edges.empty()) return {};
  on.edges.upload(edges, d.stream);
  CudaSweep s;
  s.edges = on.edges.data();
  s.edge_count = static_cast<int>(edges.size());
  s.reach = kSweepReach * d.state.scene.cell_size;
  s.cells = on.cells.data();
  s.lattices = d.faces.lattices.data();
  s.point_at = d.faces.point_at.data();
  s.end = on.places[1];
  s.begin = moves ? on.places[0] : s.end;
  s.u = d.present().u;
  on.count.resize(1);
  on.host_count.resize(1);
  on.broken.resize(std::max<std::size_t>(on.broken.size(), 16384));
  const auto look = [&] {
    s.broken = on.broken.data();
    s.broken_count = on.count.data();
    s.room = static_cast<int>(on.broken.size());
    launch_sweep(d.tables(), s, d.stream);
    on.count.download(on.host_count.data(), 1, d.stream);
    check_cuda(cudaStreamSynchronize(d.stream), "sweep a blade through the tissue");
  };
  look();
  if (on.host_count[0] > s.room) {
    on.broken.resize(on.host_count[0]);
    look();
  }
  std::vector<BrokenBond> broken(on.host_count[0]);
  on.broken.download(broken.data(), broken.size(), d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "send data");
  std::sort(broken.begin(), broken.end(), [](const BrokenBond& a, const BrokenBond& b) {
    return std::tie(a.point, a.axis) < std::tie(b.point, b.axis);
  });
  return broken;
}

void read_places(CudaTissue& d, float4* u_before) {
  SweepOnDevice& on = d.blade;
  upload_lattices(d);
  upload_sites(d);
  std::vector<CudaBlockCell> cells;
  for (const int index : d.host_tables.of_host) {
    const Block& b = *d.state.blocks.all[index];
    cells.push_back({b.x, b.y, b.z, b.body});
  }
  on.cells.upload(cells, d.stream);
  // Where clouds are written when they are read.
  static_assert(sizeof(Point) >= 6 * sizeof(float), "room for two places of each point");
  const auto count = static_cast<std::size_t>(d.state.points.size());
  d.cloud.resize(count);
  on.places[1] = reinterpret_cast<float*>(d.cloud.data());
  on.places[0] = on.places[1] + 3 * count;
  launch_places(d.tables(), d.present().u, d.plan.max_slots, on.places[1], d.stream);
  if (u_before == nullptr) return;
  launch_places(d.tables(), u_before, d.plan.max_slots, on.places[0], d.stream);
}

/// Whether these paths come near tissue that moves from where blades were looked at last.
bool meets(const CudaTissue& d, const std::vector<BladePath>& paths) {
  const double reach = 2 * kSweepReach * d.state.scene.cell_size;
  const std::vector<BlockMotion>& before = d.run.frame->before;
  for (const BladePath& path : paths) {
    for (const SweepPart& part : sweep_parts(path)) {
      for (std::size_t i = 0; i < before.size(); ++i) {
        const Box &a = before[i].box, &b = d.state.motion[i].box;
        if ((a.min.cwiseMin(b.min).array() <= part.box.max.array() + reach).all() &&
            (part.box.min.array() <= a.max.cwiseMax(b.max).array() + reach).all()) {
          return true;
        }
      }
    }
  }
  return false;
}

}  // namespace

void push_points(CudaTissue& d, const std::vector<std::int32_t>& changed) {
  const Points& points = d.state.points;
  if (!points.soft.empty() && d.soft.size() == 0) d.soft.upload(points.soft, d.stream);
  std::vector<CudaPointChange> changes;
  const auto change = [&](std::int32_t p) {
    changes.push_back({p, points.bonds[p], static_cast<std::uint8_t>(points.is_soft(p) ? 1 : 0),
                       static_cast<std::uint8_t>(points.bonds[p] == d.state.whole_bonds[p] ? 1 : 0),
                       d.outer_points ? d.outer_points->of(d.state, p) : CudaOuterPlace()});
  };
  for (const std::int32_t p : changed) {
    change(p);
    if (!d.outer_points) continue;
    for (const std::int32_t other : across_sheet(d.state, p)) change(other);
  }
  d.blade.changes.upload(changes, d.stream);
  const auto any = [](const auto& of) { return of.size() > 0 ? of.data() : nullptr; };
  launch_change_points(d.blade.changes.data(), static_cast<int>(changes.size()),
                       {d.bonds.data(), any(d.soft), any(d.anchors.lightness), any(d.outer),
                        any(d.planes), any(d.area), any(d.with), d.held_by * d.place_parts},
                       d.stream);
}

void CudaTissue::before_parting(const std::vector<std::int32_t>& points) {
  CudaTissue& d = *this;
  pull_front(d);
  if (points.empty()) return;
  make_room_for_cuts(d);
  bring_nodes(points);
  pull_contacts(d);
  pull_impulses(d);
  d.nodes_before = static_cast<int>(d.state.nodes.size());
}

void CudaTissue::parted(const std::vector<std::int32_t>& points, const Apart& apart) {
  CudaTissue& d = *this;
  if (points.empty()) return push_front(d);
  for (int n = d.nodes_before; n < static_cast<int>(d.state.nodes.size()); ++n) {
    d.brought.push_back(n);
  }
  send_nodes();
  push_front(d);
  push_points(d, points);
  push_points(d, apart.softened);
  if (!apart.new_blocks && !d.host_tables.number.empty()) return;
  push_tables(d);
  push_anchors(d);
}

std::vector<int> CudaTissue::label_pieces() {
  CudaTissue& d = *this;
  upload_sites(d);
  if (d.labels.empty()) {
    std::vector<std::int32_t> lowest(d.pieces.of_point.size());
    d.state.cpu->for_each(
        static_cast<int>(lowest.size()),
        [&](int p) { lowest[p] = d.pieces.lowest[d.pieces.of_point[p]]; }, 4096);
    d.labels.upload(lowest, d.stream);
  }
  std::vector<SiteRows> sites;
  const std::int32_t* point_at = d.faces.point_at.data();
  for (const LatticeBody& b : d.state.bodies) {
    sites.push_back({point_at, 8 * b.nx * b.ny * b.nz, 2 * b.nx, 4 * b.nx * b.ny});
    point_at += sites.back().count;
  }
  const std::vector<PartedRun> parted = d.labels.update(sites, d.bonds.data(), d.stream);
  const std::vector<int> fresh = part_pieces(d.state.points.volume.data(), parted, d.pieces);
  if (!fresh.empty()) d.points_changed = d.faces.pieces_changed = true;
  return fresh;
}

void CudaTissue::sweep(const std::vector<BladePath>& paths, bool moves,
                       std::vector<std::int32_t>& changed, std::vector<std::int32_t>& touched,
                       CutReport& report) {
  CudaTissue& d = *this;
  if (moves && !meets(d, paths)) return;
  read_places(d, moves ? d.u_before.data() : nullptr);
  for (const BladePath& path : paths) {
    std::vector<std::int32_t> by_this;
    break_bonds(d.state, {bonds_swept(d, path, moves)}, by_this, report);
    push_points(d, by_this);  // for the next
    pass_rim(d, path, moves, by_this, touched);
    changed.insert(changed.end(), by_this.begin(), by_this.end());
  }
}

}  // namespace tissue_sim

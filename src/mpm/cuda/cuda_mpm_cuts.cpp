// Cuts of tissue that lives on a GPU: the blade's sweep runs there. What follows from the bonds
// that it breaks, the fields of nodes around and the blocks there, the host works out; what it
// needs of the nodes comes down, what changed goes up.
#include <algorithm>
#include <tuple>

#include "cutting/blade_sweep.h"
#include "mpm/cuda/on_device.h"
#include "mpm/lattice_pieces.h"
#include "mpm/split/cut_tissue.h"

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

}  // namespace

std::vector<BrokenBond> CudaMpmTissue::sweep(const BladePath& path, bool moves) {
  OnDevice& d = *device_;
  SweepOnDevice& on = d.sweep;
  const std::vector<CudaSweptEdge> edges = edges_of(path);
  if (edges.empty()) return {};
  on.edges.upload(edges, d.stream);
  CudaSweep s;
  s.edges = on.edges.data();
  s.edge_count = static_cast<int>(edges.size());
  s.reach = kSweepReach * state_->scene.cell_size;
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

void CudaMpmTissue::read_places(float4* u_before) {
  OnDevice& d = *device_;
  SweepOnDevice& on = d.sweep;
  upload_lattices();
  upload_sites();
  std::vector<CudaBlockCell> cells;
  for (const int index : d.host_tables.of_host) {
    const Block& b = *state_->blocks.all[index];
    cells.push_back({b.x, b.y, b.z, b.body});
  }
  on.cells.upload(cells, d.stream);
  // Where clouds are written when they are read.
  static_assert(sizeof(Point) >= 6 * sizeof(float), "room for two places of each point");
  const auto count = static_cast<std::size_t>(state_->points.size());
  d.cloud.resize(count);
  on.places[1] = reinterpret_cast<float*>(d.cloud.data());
  on.places[0] = on.places[1] + 3 * count;
  launch_places(d.tables(), d.present().u, d.plan.max_slots, on.places[1], d.stream);
  if (u_before == nullptr) return;
  launch_places(d.tables(), u_before, d.plan.max_slots, on.places[0], d.stream);
}

void CudaMpmTissue::push_points(const std::vector<std::int32_t>& changed) {
  OnDevice& d = *device_;
  const Points& points = state_->points;
  if (!points.soft.empty() && d.soft.size() == 0) d.soft.upload(points.soft, d.stream);
  std::vector<CudaPointChange> changes;
  for (const std::int32_t p : changed) {
    changes.push_back(
        {p, points.bonds[p], static_cast<std::uint8_t>(points.is_soft(p) ? 1 : 0),
         static_cast<std::uint8_t>(points.bonds[p] == state_->whole_bonds[p] ? 1 : 0)});
  }
  d.sweep.changes.upload(changes, d.stream);
  launch_change_points(d.sweep.changes.data(), static_cast<int>(changes.size()), d.bonds.data(),
                       d.soft.size() > 0 ? d.soft.data() : nullptr,
                       d.anchors.lightness.size() > 0 ? d.anchors.lightness.data() : nullptr,
                       d.stream);
}

bool CudaMpmTissue::take_apart(const std::vector<std::int32_t>& changed,
                               const std::vector<std::int32_t>& touched) {
  OnDevice& d = *device_;
  pull_front();
  if (!touched.empty()) follow_front(*state_, touched, state_->anchors.at_row);
  if (changed.empty()) {
    list_front_cells(*state_);
    push_front();
    return false;
  }
  make_room_for_cuts();
  std::vector<std::int32_t> nodes = nodes_around(changed);
  pull_some(nodes);
  pull_contacts();
  pull_impulses();
  const auto known = static_cast<std::int32_t>(state_->nodes.size());
  bool may_part = false;
  const Apart apart = tissue_sim::take_apart(*state_, changed,
                                             [&] { may_part = may_have_parted(*state_, changed); });
  for (auto n = known; n < static_cast<std::int32_t>(state_->nodes.size()); ++n) nodes.push_back(n);
  push_some(nodes);
  push_front();
  push_points(changed);
  push_points(apart.softened);
  if (apart.new_blocks || d.host_tables.number.empty()) {
    push_tables();
    push_anchors();
  }
  return may_part;
}

std::vector<int> CudaMpmTissue::label_pieces() {
  OnDevice& d = *device_;
  upload_sites();
  if (d.labels.empty()) {
    std::vector<std::int32_t> lowest(pieces_.of_point.size());
    state_->cpu->for_each(
        static_cast<int>(lowest.size()),
        [&](int p) { lowest[p] = pieces_.lowest[pieces_.of_point[p]]; }, 4096);
    d.labels.upload(lowest, d.stream);
  }
  std::vector<SiteRows> sites;
  const std::int32_t* point_at = d.faces.point_at.data();
  for (const LatticeBody& b : state_->bodies) {
    sites.push_back({point_at, 8 * b.nx * b.ny * b.nz, 2 * b.nx, 4 * b.nx * b.ny});
    point_at += sites.back().count;
  }
  const std::vector<PartedRun> parted = d.labels.update(sites, d.bonds.data(), d.stream);
  const std::vector<int> fresh = part_pieces(state_->points.volume.data(), parted, pieces_);
  if (!fresh.empty()) d.points_changed = d.faces.pieces_changed = true;
  return fresh;
}

void CudaMpmTissue::cut(const std::vector<BladePath>& paths, float4* u_before, CutReport& report) {
  std::vector<std::int32_t> changed, touched;
  read_places(u_before);
  for (const BladePath& path : paths) {
    std::vector<std::int32_t> by_this;
    tissue_sim::break_bonds(*state_, {sweep(path, u_before != nullptr)}, by_this, report);
    push_points(by_this);  // for the next
    if (state_->front.follows) pass_rim(path, u_before != nullptr, by_this, touched);
    changed.insert(changed.end(), by_this.begin(), by_this.end());
  }
  if (changed.empty() && touched.empty()) return;
  if (take_apart(changed, touched)) report.new_fragments = label_pieces();
  launch_measure();
  finish_measure();
}

void CudaMpmTissue::cut_by_blades() {
  const double reach = 2 * kSweepReach * state_->scene.cell_size;
  bool meets = false;
  for (const BladePath& path : blades_) {
    for (const SweepPart& part : sweep_parts(path)) {
      for (std::size_t i = 0; i < motion_before_.size() && !meets; ++i) {
        const Box &a = motion_before_[i].box, &b = state_->motion[i].box;
        meets = (a.min.cwiseMin(b.min).array() <= part.box.max.array() + reach).all() &&
                (part.box.min.array() <= a.max.cwiseMax(b.max).array() + reach).all();
      }
    }
  }
  if (meets) cut(blades_, device_->u_before.data(), result_.blade_report);
}

}  // namespace tissue_sim

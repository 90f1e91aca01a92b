// Contact of tissue with tissue where the tissue lives on a GPU: facets go up when there are new
// ones, the search and the looks run there, and the host waits once in a search for its figures.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "contact/face_places.h"
#include "mpm/cuda/on_device.h"

namespace tissue_sim {
namespace {

CudaFacet facet_on_device(const MpmState& s, const Block& block, const Facet& facet,
                          int first_slot) {
  CudaFacet f = {};
  f.facet = facet;
  f.pitch = block.nx + 2;
  f.plane = f.pitch * (block.ny + 2);
  const int z = facet.cell / block.plane, y = facet.cell % block.plane / block.pitch,
            x = facet.cell % block.plane % block.pitch;
  f.slot = first_slot + z * f.plane + y * f.pitch + x;
  f.body = block.body;
  const int cell[3] = {block.x + x, block.y + y, block.z + z};
  const Points::Site& site = s.points.site[facet.point];
  const std::int16_t at[3] = {site.x, site.y, site.z};
  for (int a = 0; a < 3; ++a) {
    f.cell[a] = static_cast<std::int16_t>(cell[a]);
    f.site[a] = at[a];
  }
  const Material& m = s.bodies[block.body].material_of(s.points, facet.point);
  f.friction = static_cast<float>(m.friction);
  f.modulus = lame_lambda(m) + 2 * lame_mu(m);
  return f;
}

}  // namespace

void CudaMpmTissue::run_substeps(int begin, int end) {
  while (begin < end) {
    // Substeps of a launch have one length and one kick: one after a change is a launch of its own.
    const float dt = part_.at(begin);
    int count = part_.is_even_from(begin) && kick_of(state_->dt, dt) == dt ? end - begin : 1;
    FaceContacts& faces = state_->faces;
    if (is_due(faces.until_search, dt)) search_faces(dt);
    const double last = std::ceil(faces.until_search / dt - 0.5);
    count = std::max(1, static_cast<int>(std::min<double>(count, last)));
    faces.until_search -= count * static_cast<double>(dt);
    launch(begin, begin + count, dt);
    begin += count;
  }
}

void CudaMpmTissue::upload_lattices() {
  FacesOnDevice& f = device_->faces;
  if (f.lattices.size() > 0) return;
  std::vector<CudaLattice> lattices;
  std::size_t sites = 0;
  for (const LatticeBody& b : state_->bodies) {
    const Vec3 origin = b.node_position(0, 0, 0);
    lattices.push_back({{origin[0], origin[1], origin[2]}, b.cell_size, 2 * b.nx, 2 * b.ny, sites});
    sites += std::size_t{8} * b.nx * b.ny * b.nz;
  }
  f.lattices.upload(lattices, device_->stream);
  check_cuda(cudaStreamSynchronize(device_->stream), "receive data");
}

void CudaMpmTissue::upload_sites() {
  FacesOnDevice& f = device_->faces;
  if (f.point_at.size() > 0) return;
  std::vector<std::int32_t> point_at;
  for (const LatticeBody& b : state_->bodies) {
    const std::size_t first = point_at.size();
    point_at.resize(first + std::size_t{8} * b.nx * b.ny * b.nz, -1);
    for (int p = b.first_point; p < b.first_point + b.point_count; ++p) {
      const Points::Site& s = state_->points.site[p];
      point_at[first + (std::size_t(s.z) * 2 * b.ny + s.y) * 2 * b.nx + s.x] = p;
    }
  }
  f.point_at.upload(point_at, device_->stream);
  check_cuda(cudaStreamSynchronize(device_->stream), "receive data");
}

void CudaMpmTissue::upload_facets() {
  OnDevice& d = *device_;
  FacesOnDevice& f = d.faces;
  const FaceContacts& faces = state_->faces;
  const bool renumbered = f.version != faces.version;
  if (!renumbered && !f.pieces_changed) return;
  const std::size_t count = faces.block_of.size();
  std::vector<int> size(pieces_.next_id, 0);
  for (const Fragment& piece : pieces_.all) size[piece.id] = piece.point_count;
  f.host_facets.resize(count);
  state_->cpu->for_each(
      static_cast<int>(count),
      [&](int i) {
        const Facet& facet = facet_of(*state_, i);
        CudaFacet& to = f.host_facets[i];
        to = facet_on_device(*state_, block_of(*state_, i), facet,
                             d.host_tables.first_slot[faces.block_of[i]]);
        const std::int32_t piece = pieces_.of_point[facet.point];
        to.piece = {piece, size[piece]};
      },
      256);
  f.facets.upload(f.host_facets, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
  f.pieces_changed = false;
  if (!renumbered) return;
  f.version = faces.version;
  f.lists_hold = false;
  f.motion.resize(count);
  f.listed.resize(count);
  f.listed.clear(d.stream);
  for (auto* of_facet : {&f.first_near, &f.near_count, &f.contacts, &f.involved, &f.rank}) {
    of_facet->resize(count);
  }
  f.is_involved.resize(count);
  f.takes_part.resize(count);
  f.sorted.resize(count);
  if (f.figures.size() == 0) {
    f.figures.resize(1);
    f.figures.clear(d.stream);
  }
  f.host_figures.resize(1);
  f.sums.resize(search_sums(static_cast<int>(count)));
  std::size_t buckets = 1024;
  while (buckets < 2 * count) buckets *= 2;
  f.bucket_begin.resize(buckets);
  f.bucket_count.resize(buckets);
  if (f.springs.size() > 0) begin_contacts();
}

void CudaMpmTissue::begin_contacts() {
  OnDevice& d = *device_;
  FacesOnDevice& f = d.faces;
  upload_sites();
  f.near.resize(std::max(f.near.size(), 8 * f.facets.size()));
  f.springs.resize(f.facets.size());
  f.springs.clear(d.stream);  // padding included: they are copied 16 bytes at a time
  launch_fresh_contacts(looks(), d.stream);
}

CudaLooks CudaMpmTissue::looks() const {
  const OnDevice& d = *device_;
  const FacesOnDevice& f = d.faces;
  CudaLooks s;
  s.facet_count = static_cast<int>(f.facets.size());
  s.cell_size = state_->scene.cell_size;
  s.per_cell = static_cast<float>(1 / s.cell_size);
  s.facets = f.facets.data();
  s.lattices = f.lattices.data();
  s.point_at = f.point_at.data();
  s.bonds = d.bonds.data();
  s.slot_node = d.of_blocks.slot_node.data();
  s.motion = f.motion.data();
  s.listed = f.listed.data();
  s.springs = f.springs.data();
  s.first_near = f.first_near.data();
  s.near_count = f.near_count.data();
  s.near = f.near.data();
  s.near_capacity = f.near.size();
  s.is_involved = f.is_involved.data();
  s.takes_part = f.takes_part.data();
  s.contacts = f.contacts.data();
  s.involved = f.involved.data();
  s.nodes = f.nodes.data();
  s.marks = d.marks.data();
  s.node_count = d.marks.size();
  s.slot_parts = d.slot_parts.data();
  s.pushed_parts = d.pushed_parts.data();
  s.slot_count = d.slot_parts.size();
  s.figures = f.figures.data();
  return s;
}

void CudaMpmTissue::search_faces(float dt) {
  OnDevice& d = *device_;
  FacesOnDevice& f = d.faces;
  FaceContacts& faces = state_->faces;
  upload_lattices();
  upload_facets();
  faces.until_search = kHorizon;
  f.contacts_count = 0;
  f.may_meet = false;
  if (f.facets.size() == 0) return;
  const CudaSearchRoom room{f.sums.data(),         static_cast<std::int32_t>(f.bucket_count.size()),
                            f.bucket_begin.data(), f.bucket_count.data(),
                            f.rank.data(),         f.sorted.data()};
  const CudaFaceFigures& figures = f.host_figures[0];
  const auto read = [&] {
    f.figures.download(f.host_figures.data(), 1, d.stream);
    check_cuda(cudaStreamSynchronize(d.stream), "search contacts");
  };
  launch_search(looks(), d.present(), room, !f.lists_hold, d.stream);
  read();
  float fastest;
  std::memcpy(&fastest, &figures.fastest, sizeof(fastest));
  f.lists_hold = fastest < kOutOfControl;
  if (!f.lists_hold) return;  // as the end of the frame will say
  faces.until_search = figures.horizon;
  while (figures.listed_anew != 0 && static_cast<std::size_t>(figures.near) > f.near.size()) {
    if (f.springs.size() == 0) begin_contacts();
    f.near.resize(std::max(f.near.size(), static_cast<std::size_t>(figures.near) * 3 / 2));
    launch_lists(looks(), room, d.stream);
    read();
  }
  float meeting;
  std::memcpy(&meeting, &figures.meeting, sizeof(meeting));
  // While none can meet they cost nothing, but fewer substeps than so many are not worth a search.
  constexpr double kFewSubsteps = 16;
  f.may_meet = meeting * kFewSubsteps * dt > 1;
  if (!f.may_meet) faces.until_search = std::min(faces.until_search, 1.0 / (meeting + 1e-9));
  f.contacts_count = figures.contacts;
  f.involved_count = figures.involved;
  if (f.nodes.size() < static_cast<std::size_t>(figures.contacts)) {
    f.nodes.resize(static_cast<std::size_t>(figures.contacts) * 3 / 2);
  }
  f.searched = true;
  if (!faces.kept.empty()) {
    f.kept.upload(faces.kept, d.stream);
    launch_take_up(looks(), d.present(), f.kept.data(), static_cast<int>(faces.kept.size()),
                   figures.contacts, dt, d.stream);
    check_cuda(cudaStreamSynchronize(d.stream), "receive data");
    faces.kept.clear();
  }
}

const CudaFaces* CudaMpmTissue::faces_of_launch() {
  OnDevice& d = *device_;
  FacesOnDevice& f = d.faces;
  if (!f.may_meet || f.version != state_->faces.version) return nullptr;
  const std::vector<CudaBundle>& bundles = d.host_tables.bundles;
  const auto ranks = std::count_if(
      bundles.begin(), bundles.begin() + std::min<std::ptrdiff_t>(d.touch_resident, bundles.size()),
      [](const CudaBundle& b) { return b.rank >= 0; });
  const CudaFaces faces = {std::exchange(f.searched, false) ? 1 : 0, f.contacts_count,
                           f.involved_count, static_cast<int>(ranks), looks()};
  f.of_launch.upload(&faces, 1, d.stream);
  return f.of_launch.data();
}

void CudaMpmTissue::pull_contacts() {
  OnDevice& d = *device_;
  FacesOnDevice& f = d.faces;
  FaceContacts& faces = state_->faces;
  faces.all.clear();
  faces.active.clear();
  if (f.version != faces.version || f.contacts_count == 0 || f.searched) return;
  const int count = f.contacts_count;
  f.gathered.resize(count);
  f.gathered.clear(d.stream);  // the same
  launch_gather_contacts(looks(), count, f.gathered.data(), d.stream);
  std::vector<FaceSpring> springs(count);
  f.gathered.download(springs.data(), count, d.stream);
  f.figures.download(f.host_figures.data(), 1, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "send contacts");
  std::sort(springs.begin(), springs.end(),
            [](const FaceSpring& a, const FaceSpring& b) { return a.facet < b.facet; });
  for (const FaceSpring& spring : springs) {
    if (spring.other < 0) continue;
    FaceContact c;
    static_cast<FaceSpring&>(c) = spring;
    const Facet &own = facet_of(*state_, c.facet), &other = facet_of(*state_, c.other);
    c.nodes = CellNodes(block_of(*state_, c.facet), own.cell);
    c.weights = AxisWeights(own.center);
    c.other_nodes = CellNodes(block_of(*state_, c.other), other.cell);
    c.other_weights = AxisWeights(c.hold);
    c.looked_at = state_->time - f.host_figures[0].since_look;
    if (is_active(spring)) {
      faces.active.push_back(static_cast<std::int32_t>(faces.all.size()));
    }
    faces.all.push_back(c);
  }
  faces.until_look = f.host_figures[0].until_look;
}

void CudaMpmTissue::search_anew() {
  device_->faces.lists_hold = false;
  state_->faces.until_search = 0;
}

std::vector<std::vector<std::int32_t>> CudaMpmTissue::near_facets() const {
  const OnDevice& d = *device_;
  const FacesOnDevice& f = d.faces;
  const std::size_t count = f.facets.size();
  std::vector<std::int32_t> first(count), size(count), near(f.host_figures[0].near);
  f.first_near.download(first.data(), count, d.stream);
  f.near_count.download(size.data(), count, d.stream);
  f.near.download(near.data(), near.size(), d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "send contacts");
  std::vector<std::vector<std::int32_t>> lists(count);
  for (std::size_t i = 0; i < count; ++i) {
    lists[i].assign(near.begin() + first[i], near.begin() + first[i] + size[i]);
  }
  return lists;
}

}  // namespace tissue_sim

// Contact of tissue with tissue where the tissue lives on a GPU: facets go up when there are new
// ones, the search and the looks run there. The host needs the figures of a search: those of one
// that the end of a frame foresees come with the frame's, for one within a frame it waits.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "mpm/contact/face_places.h"
#include "mpm/cuda/on_device.h"

namespace tissue_sim {

void CudaMpmTissue::run_substeps(int begin, int end) {
  while (begin < end) {
    // Substeps of a launch have one length and one kick: one after a change is a launch of its own.
    const float dt = part_.substeps.at(begin);
    int count =
        part_.substeps.is_even_from(begin) && kick_of(state_->dt, dt) == dt ? end - begin : 1;
    FaceContacts& faces = state_->faces;
    if (is_due(faces.until_search, dt)) {
      begin_search();
      check_cuda(cudaStreamSynchronize(device_->stream), "search contacts");
      finish_search(dt);
    }
    const double last = std::ceil(faces.until_search / dt - 0.5);
    count = std::max(1, static_cast<int>(std::min<double>(count, last)));
    faces.until_search -= count * static_cast<double>(dt);
    launch(begin, begin + count, dt);
    begin += count;
  }
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
  s.at_surface = state_->scene.mpm.boundary == MpmBoundary::kSurface;
  return s;
}

void CudaMpmTissue::begin_search() {
  OnDevice& d = *device_;
  FacesOnDevice& f = d.faces;
  upload_lattices();
  upload_facets();
  if (f.facets.size() == 0) return;
  launch_search(looks(), d.present(), f.search_room(), !f.lists_hold, d.stream);
  f.figures.download(f.host_figures.data(), 1, d.stream);
  f.search_begun = true;
}

void CudaMpmTissue::search_ahead() {
  const FacesOnDevice& f = device_->faces;
  const FaceContacts& faces = state_->faces;
  const bool same_facets = f.version == faces.version && !f.pieces_changed;
  if (same_facets && blades_.empty() && is_due(faces.until_search, state_->dt)) begin_search();
}

void CudaMpmTissue::finish_search(float dt) {
  OnDevice& d = *device_;
  FacesOnDevice& f = d.faces;
  FaceContacts& faces = state_->faces;
  const CudaFaceFigures& figures = f.host_figures[0];
  faces.until_search = kHorizon;
  f.contacts_count = 0;
  f.may_meet = false;
  if (!std::exchange(f.search_begun, false)) return;
  float fastest;
  std::memcpy(&fastest, &figures.fastest, sizeof(fastest));
  f.lists_hold = fastest < kOutOfControl;
  if (!f.lists_hold) return;  // as the end of the frame will say
  faces.until_search = figures.horizon;
  faces.fastest = fastest_block(*state_);
  while (figures.listed_anew != 0 && static_cast<std::size_t>(figures.near) > f.near.size()) {
    if (f.springs.size() == 0) begin_contacts();
    f.near.resize(std::max(f.near.size(), static_cast<std::size_t>(figures.near) * 3 / 2));
    launch_lists(looks(), f.search_room(), d.stream);
    f.figures.download(f.host_figures.data(), 1, d.stream);
    check_cuda(cudaStreamSynchronize(d.stream), "search contacts");
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
  const std::ptrdiff_t resident =
      has_front() || meets_thin_tools() ? d.front_resident : d.touch_resident;
  const auto ranks = std::count_if(
      bundles.begin(), bundles.begin() + std::min<std::ptrdiff_t>(resident, bundles.size()),
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
  if (f.version != faces.version || f.contacts_count == 0) return;
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

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

namespace {

/// Enqueues a search of faces, whose figures come to the host.
void begin_search(CudaTissue& d) {
  FacesOnDevice& f = d.faces;
  upload_lattices(d);
  upload_facets(d);
  if (f.facets.size() == 0) return;
  launch_search(looks_of(d), d.present(), f.search_room(), !f.lists_hold, d.stream);
  f.figures.download(f.host_figures.data(), 1, d.stream);
  f.search_begun = true;
}

}  // namespace

void run_substeps(CudaTissue& d, int begin, int end) {
  while (begin < end) {
    // Substeps of a launch have one length and one kick: one after a change is a launch of its own.
    const float dt = d.part.substeps.at(begin);
    int count =
        d.part.substeps.is_even_from(begin) && kick_of(d.state.dt, dt) == dt ? end - begin : 1;
    FaceContacts& faces = d.state.faces;
    if (is_due(faces.until_search, dt)) {
      begin_search(d);
      check_cuda(cudaStreamSynchronize(d.stream), "search contacts");
      finish_search(d, dt);
    }
    const double last = std::ceil(faces.until_search / dt - 0.5);
    count = std::max(1, static_cast<int>(std::min<double>(count, last)));
    faces.until_search -= count * static_cast<double>(dt);
    launch(d, begin, begin + count, dt);
    begin += count;
  }
}

void begin_contacts(CudaTissue& d) {
  FacesOnDevice& f = d.faces;
  upload_sites(d);
  f.near.resize(std::max(f.near.size(), 8 * f.facets.size()));
  f.springs.resize(f.facets.size());
  f.springs.clear(d.stream);  // padding included: they are copied 16 bytes at a time
  launch_fresh_contacts(looks_of(d), d.stream);
}

CudaLooks looks_of(const CudaTissue& d) {
  const FacesOnDevice& f = d.faces;
  CudaLooks s;
  s.facet_count = static_cast<int>(f.facets.size());
  s.cell_size = d.state.scene.cell_size;
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

void search_ahead(CudaTissue& d) {
  const FacesOnDevice& f = d.faces;
  const FaceContacts& faces = d.state.faces;
  const bool same_facets = f.version == faces.version && !f.pieces_changed;
  if (same_facets && !d.run.frame->blades && is_due(faces.until_search, d.state.dt))
    begin_search(d);
}

void finish_search(CudaTissue& d, float dt) {
  FacesOnDevice& f = d.faces;
  FaceContacts& faces = d.state.faces;
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
  faces.fastest = fastest_block(d.state);
  while (figures.listed_anew != 0 && static_cast<std::size_t>(figures.near) > f.near.size()) {
    if (f.springs.size() == 0) begin_contacts(d);
    f.near.resize(std::max(f.near.size(), static_cast<std::size_t>(figures.near) * 3 / 2));
    launch_lists(looks_of(d), f.search_room(), d.stream);
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
    launch_take_up(looks_of(d), d.present(), f.kept.data(), static_cast<int>(faces.kept.size()),
                   figures.contacts, dt, d.stream);
    check_cuda(cudaStreamSynchronize(d.stream), "receive data");
    faces.kept.clear();
  }
}

const CudaFaces* faces_of_launch(CudaTissue& d) {
  FacesOnDevice& f = d.faces;
  if (!f.may_meet || f.version != d.state.faces.version) return nullptr;
  const std::vector<CudaBundle>& bundles = d.host_tables.bundles;
  const std::ptrdiff_t resident = d.plans[way_of(d, true)].resident;
  const auto ranks = std::count_if(
      bundles.begin(), bundles.begin() + std::min<std::ptrdiff_t>(resident, bundles.size()),
      [](const CudaBundle& b) { return b.rank >= 0; });
  const CudaFaces faces = {std::exchange(f.searched, false) ? 1 : 0, f.contacts_count,
                           f.involved_count, static_cast<int>(ranks), looks_of(d)};
  f.of_launch.upload(&faces, 1, d.stream);
  return f.of_launch.data();
}

void pull_contacts(CudaTissue& d) {
  FacesOnDevice& f = d.faces;
  FaceContacts& faces = d.state.faces;
  faces.all.clear();
  faces.active.clear();
  if (f.version != faces.version || f.contacts_count == 0) return;
  const int count = f.contacts_count;
  f.gathered.resize(count);
  f.gathered.clear(d.stream);  // the same
  launch_gather_contacts(looks_of(d), count, f.gathered.data(), d.stream);
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
    find_nodes(d.state, c);
    c.looked_at = d.state.time - f.host_figures[0].since_look;
    if (is_active(spring)) {
      faces.active.push_back(static_cast<std::int32_t>(faces.all.size()));
    }
    faces.all.push_back(c);
  }
  faces.until_look = f.host_figures[0].until_look;
}

void search_anew(CudaTissue& d) {
  d.faces.lists_hold = false;
  d.state.faces.until_search = 0;
}

}  // namespace tissue_sim

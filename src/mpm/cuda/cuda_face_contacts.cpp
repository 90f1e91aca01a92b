// Contact of tissue with tissue where the tissue lives on a GPU: the host searches and looks, the
// substeps between two looks run as one kernel that works the contacts out.
#include <algorithm>

#include "contact/face_places.h"
#include "mpm/cuda/face_nodes.h"
#include "mpm/cuda/on_device.h"

namespace tissue_sim {
namespace {

/// Calls f(k, node) for the 27 nodes of a cell, x fastest.
template <class F>
void for_each_node(const CellNodes& cell, const F& f) {
  for (int k = 0; k < 27; ++k) {
    f(k, cell.lowest[k / 9 * cell.plane + k / 3 % 3 * cell.pitch + k % 3]);
  }
}

CudaContactNodes nodes_of(const MpmState& s, const FaceContact& c) {
  CudaContactNodes nodes;
  const float* w = c.weights.of;
  for_each_node(c.nodes, [&](int k, std::int32_t n) {
    nodes.own[k] = n;
    nodes.weight[k] = w[k % 3] * w[3 + k / 3 % 3] * w[6 + k / 9];
  });
  for_each_node(c.other_nodes, [&](int k, std::int32_t n) {
    nodes.other[k] = n;
    nodes.other_inv_mass[k] = s.nodes.inv_mass[n];
  });
  return nodes;
}

/// The nodes that looks need until the next search.
std::vector<std::int32_t> nodes_to_look_at(const MpmState& s) {
  const FaceContacts& faces = s.faces;
  std::vector<std::int32_t> nodes;
  if (faces.all.empty()) return nodes;
  std::vector<std::uint8_t> taken(s.nodes.size(), 0);
  const auto take = [&](const CellNodes& cell) {
    for_each_node(cell, [&](int, std::int32_t n) {
      if (taken[n] == 0) nodes.push_back(n);
      taken[n] = 1;
    });
  };
  for (const std::int32_t f : faces.involved) take(CellNodes(block_of(s, f), facet_of(s, f).cell));
  for (const FaceContact& c : faces.all) {
    if (c.other >= 0) take(c.other_nodes);
  }
  return nodes;
}

}  // namespace

bool CudaMpmTissue::faces_may_meet() const {
  return pieces_.all.size() > 1 ||
         static_cast<int>(state_->nodes.size()) > state_->blocks.first_split_node;
}

void CudaMpmTissue::run_substeps(int begin, int end, float dt) {
  while (begin < end) {
    int count = end - begin;
    if (faces_may_meet()) count = find_faces(count, dt);
    launch(begin, begin + count, dt);
    fetch_faces();
    begin += count;
  }
}

int CudaMpmTissue::find_faces(int substeps, float dt) {
  OnDevice& d = *device_;
  FaceContacts& faces = state_->faces;
  take_faces();
  const bool search = faces.until_search <= 0;
  d.looked = search || faces.until_look <= 0;
  if (search) pull();
  substeps = find_face_contacts(*state_, pieces_, dt, substeps);
  if (search) {
    d.host_face_nodes = nodes_to_look_at(*state_);
    d.face_nodes.upload(d.host_face_nodes, d.stream);
  }
  const std::size_t count = faces.active.size(), node_count = d.u[0].size();
  if (count == 0) return substeps;
  d.host_springs.resize(count);
  d.host_contact_nodes.resize(count);
  state_->cpu->for_each(
      static_cast<int>(count),
      [&](int i) {
        const FaceContact& c = faces.all[faces.active[i]];
        d.host_springs[i] = c;
        d.host_contact_nodes[i] = nodes_of(*state_, c);
      },
      64);
  d.springs.upload(d.host_springs, d.stream);
  d.contact_nodes.upload(d.host_contact_nodes, d.stream);
  d.contact_marks.resize(node_count);
  launch_mark(d.contact_nodes.data(), static_cast<int>(count), d.contact_marks.data(), node_count,
              d.stream);
  d.contact_force.resize(3 * 3 * node_count);
  d.contact_force.clear(d.stream);
  return substeps;
}

void CudaMpmTissue::fetch_faces() {
  OnDevice& d = *device_;
  const FaceContacts& faces = state_->faces;
  if (!faces_may_meet()) return;
  d.springs_in_flight = faces.active.size();
  d.springs.download(d.host_springs.data(), d.springs_in_flight, d.stream);
  const bool look = !faces.all.empty() && faces.until_look <= 0 && faces.until_search > 0;
  d.nodes_in_flight = look ? d.host_face_nodes.size() : 0;
  if (!look) return;
  const std::size_t count = d.nodes_in_flight;
  d.gathered.resize(2 * count);
  d.host_gathered.resize(2 * count);
  launch_gather(d.face_nodes.data(), static_cast<int>(count), d.present(), d.gathered.data(),
                d.stream);
  d.gathered.download(d.host_gathered.data(), 2 * count, d.stream);
}

void CudaMpmTissue::take_faces() {
  OnDevice& d = *device_;
  if (d.springs_in_flight + d.nodes_in_flight == 0) return;
  check_cuda(cudaStreamSynchronize(d.stream), "send contacts");
  FaceContacts& faces = state_->faces;
  for (std::size_t i = 0; i < d.springs_in_flight; ++i) {
    FaceContact& c = faces.all[faces.active[i]];
    static_cast<FaceSpring&>(c) = d.host_springs[i];
    c.other_weights = AxisWeights(c.hold);
  }
  Nodes& n = state_->nodes;
  const float4 *u = d.host_gathered.data(), *v = u + d.nodes_in_flight;
  for (std::size_t i = 0; i < d.nodes_in_flight; ++i) {
    const std::int32_t node = d.host_face_nodes[i];
    n.u[0][node] = u[i].x, n.u[1][node] = u[i].y, n.u[2][node] = u[i].z;
    n.v[0][node] = v[i].x, n.v[1][node] = v[i].y, n.v[2][node] = v[i].z;
  }
  d.springs_in_flight = d.nodes_in_flight = 0;
}

}  // namespace tissue_sim

// Facets of tissue that lives on a GPU, and what tells which point is where, on their way up.
#include "mpm/contact/face_places.h"
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

void upload_lattices(CudaTissue& d) {
  FacesOnDevice& f = d.faces;
  if (f.lattices.size() > 0) return;
  std::vector<CudaLattice> lattices;
  std::size_t sites = 0;
  for (const LatticeBody& b : d.state.bodies) {
    const Vec3 origin = b.node_position(0, 0, 0);
    lattices.push_back({{origin[0], origin[1], origin[2]}, b.cell_size, 2 * b.nx, 2 * b.ny, sites});
    sites += std::size_t{8} * b.nx * b.ny * b.nz;
  }
  f.lattices.upload(lattices, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
}

void upload_sites(CudaTissue& d) {
  FacesOnDevice& f = d.faces;
  if (f.point_at.size() > 0) return;
  std::vector<std::int32_t> point_at;
  for (const LatticeBody& b : d.state.bodies) {
    const std::size_t first = point_at.size();
    point_at.resize(first + std::size_t{8} * b.nx * b.ny * b.nz, -1);
    for (int p = b.first_point; p < b.first_point + b.point_count; ++p) {
      const Points::Site& s = d.state.points.site[p];
      point_at[first + (std::size_t(s.z) * 2 * b.ny + s.y) * 2 * b.nx + s.x] = p;
    }
  }
  f.point_at.upload(point_at, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
}

void send_facets(CudaTissue& d) {
  FacesOnDevice& f = d.faces;
  const FaceContacts& faces = d.state.faces;
  const std::size_t count = faces.block_of.size();
  std::vector<int> size(d.pieces.next_id, 0);
  for (const Fragment& piece : d.pieces.all) size[piece.id] = piece.point_count;
  f.host_facets.resize(count);
  d.state.cpu->for_each(
      static_cast<int>(count),
      [&](int i) {
        const Facet& facet = facet_of(d.state, i);
        CudaFacet& to = f.host_facets[i];
        to = facet_on_device(d.state, block_of(d.state, i), facet,
                             d.host_tables.first_slot[faces.block_of[i]]);
        const std::int32_t piece = d.pieces.of_point[facet.point];
        to.piece = {piece, size[piece]};
      },
      256);
  f.facets.upload(f.host_facets, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive data");
}

void make_room_for_facets(CudaTissue& d) {
  FacesOnDevice& f = d.faces;
  const std::size_t count = f.facets.size();
  f.motion.resize(count);
  f.listed.resize(count);
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
}

void upload_facets(CudaTissue& d) {
  FacesOnDevice& f = d.faces;
  const bool renumbered = f.version != d.state.faces.version;
  if (!renumbered && !f.pieces_changed) return;
  send_facets(d);
  f.pieces_changed = false;
  if (!renumbered) return;
  f.version = d.state.faces.version;
  f.lists_hold = false;
  make_room_for_facets(d);
  f.listed.clear(d.stream);
  if (f.springs.size() > 0) begin_contacts(d);
}

}  // namespace tissue_sim

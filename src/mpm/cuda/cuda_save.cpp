// The state of tissue that lives on a GPU as bytes. Between two frames nothing is under way: what
// the end of a frame began, it has waited for. Saving changes nothing; restoring puts everything
// where it was, lists and divisions too that a new tissue would make otherwise.
#include <algorithm>
#include <utility>

#include "mpm/cuda/on_device.h"
#include "mpm/mpm_fields.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace {

template <class T>
std::vector<T> bring(const DeviceArray<T>& from, std::size_t count, cudaStream_t stream) {
  std::vector<T> to(count);
  from.download(to.data(), count, stream);
  check_cuda(cudaStreamSynchronize(stream), "send a state");
  return to;
}

/// The first `count`, of as many or more.
template <class T>
void send(const std::vector<T>& from, const DeviceArray<T>& to, std::size_t count,
          cudaStream_t stream) {
  if (count == 0) return;
  check_cuda(
      cudaMemcpyAsync(to.data(), from.data(), count * sizeof(T), cudaMemcpyHostToDevice, stream),
      "receive data");
  check_cuda(cudaStreamSynchronize(stream), "receive a state");
}

std::vector<HeldPoint> bring_held(const DeviceArray<std::uint8_t>& with,
                                  const DeviceArray<float4>& hold, cudaStream_t stream) {
  const std::vector<std::uint8_t> held_with = bring(with, with.size(), stream);
  const std::vector<float4> held_at = bring(hold, hold.size(), stream);
  std::vector<HeldPoint> held;
  for (std::size_t i = 0; i < held_with.size(); ++i) {
    if (held_with[i] == 0) continue;
    const float4& at = held_at[i];
    held.push_back({static_cast<std::int32_t>(i), held_with[i], {at.x, at.y, at.z, at.w}});
  }
  return held;
}

template <class Archive>
void device_fields(Archive& archive, CudaTissue& d, StateOnHost& of_device) {
  FaceContacts& faces = d.state.faces;
  archive.part("facets", faces.version);
  archive.part("kept contacts", faces.kept, faces.until_search, faces.fastest);
  archive.part("shape", d.shape, d.cut_shape);
  each_part(archive, of_device);
}

}  // namespace

void bring_faces(const CudaTissue& d, FacesOnHost& to) {
  const FacesOnDevice& f = d.faces;
  static_cast<FacesState&>(to) = f;
  to.is_current = f.version == d.state.faces.version;
  to.has_sites = f.point_at.size() > 0;
  to.has_figures = f.figures.size() > 0;
  to.spring_room = f.springs.size();
  to.near_room = f.near.size();
  if (to.has_figures) to.figures = bring(f.figures, 1, d.stream)[0];
  const std::size_t count = f.facets.size();
  if (!to.is_current || count == 0) return;
  to.motion = bring(f.motion, count, d.stream);
  to.listed = bring(f.listed, count, d.stream);
  if (f.springs.size() > 0) to.springs = bring(f.springs, count, d.stream);
  if (f.contacts_count == 0) return;
  // In the order of facets: on the GPU they are in any.
  const auto contacts = bring(f.contacts, f.contacts_count, d.stream);
  to.contacts = contacts;
  std::sort(to.contacts.begin(), to.contacts.end());
  to.involved = bring(f.involved, f.involved_count, d.stream);
  std::sort(to.involved.begin(), to.involved.end());
  const auto first = bring(f.first_near, count, d.stream);
  to.near_count = bring(f.near_count, count, d.stream);
  const auto near = bring(f.near, std::min<std::size_t>(to.figures.near, f.near.size()), d.stream);
  for (std::size_t i = 0; i < count; ++i) {
    to.near.insert(to.near.end(), near.begin() + first[i],
                   near.begin() + first[i] + to.near_count[i]);
  }
  if (f.searched) return;  // their nodes are found by the next look, which is due at once
  const auto nodes = bring(f.nodes, contacts.size(), d.stream);
  std::vector<std::size_t> at(count, 0);
  for (std::size_t i = 0; i < contacts.size(); ++i) at[contacts[i]] = i;
  for (const std::int32_t facet : to.contacts) to.nodes.push_back(nodes[at[facet]]);
}

void send_faces(CudaTissue& d, const FacesOnHost& from) {
  FacesOnDevice& f = d.faces;
  if (from.has_sites) upload_sites(d);
  static_cast<FacesState&>(f) = from;
  f.springs.resize(from.spring_room);
  f.springs.clear(d.stream);  // padding included: they are copied 16 bytes at a time
  f.near.resize(from.near_room);
  const std::size_t count = d.state.faces.block_of.size();
  if (from.is_current && count > 0) {
    upload_lattices(d);
    send_facets(d);
    make_room_for_facets(d);
    send(from.motion, f.motion, count, d.stream);
    send(from.listed, f.listed, count, d.stream);
    if (from.spring_room > 0) send(from.springs, f.springs, count, d.stream);
    f.near_count.clear(d.stream);
    f.first_near.clear(d.stream);
    if (from.contacts_count > 0) {
      std::vector<std::int32_t> first(count, 0);
      for (std::size_t i = 1; i < count; ++i) first[i] = first[i - 1] + from.near_count[i - 1];
      send(from.contacts, f.contacts, from.contacts.size(), d.stream);
      send(from.involved, f.involved, from.involved.size(), d.stream);
      send(from.near_count, f.near_count, count, d.stream);
      send(first, f.first_near, count, d.stream);
      send(from.near, f.near, from.near.size(), d.stream);
      f.nodes.resize(from.contacts.size());  // the next look fills them, if none has yet
      if (!from.searched) send(from.nodes, f.nodes, from.nodes.size(), d.stream);
    }
  }
  if (!from.has_figures) return;
  f.figures.resize(1);
  f.host_figures.resize(1);
  f.host_figures[0] = from.figures;
  f.figures.upload(f.host_figures, d.stream);
  check_cuda(cudaStreamSynchronize(d.stream), "receive a state");
}

/// That blocks are some that kernels of the shape can work on.
void check_blocks_of(const CudaTissue& d) {
  for (const Block* b : d.state.blocks.all) {
    check_state(b->material >= 0 && b->nx * b->ny <= d.shape.columns() && b->nz <= kMaxLayers,
                "blocks");
  }
}

void CudaTissue::save(ArchiveWriter& archive) {
  CudaTissue& d = *this;
  StateOnHost of_device;
  of_device.held = bring_held(d.with, d.hold, d.stream);
  of_device.marks = bring(d.marks, d.marks.size(), d.stream);
  bring_faces(d, of_device.faces);
  device_fields(archive, d, of_device);
}

void CudaTissue::restore(ArchiveReader& archive) {
  to_restore = std::make_unique<StateOnHost>();
  const CudaShape whole = shape, cut = cut_shape;  // of the same scene on the same GPU
  device_fields(archive, *this, *to_restore);
  check_state((shape == whole || shape == cut) && cut_shape == cut && shape.blocks.uniform &&
                  !shape.blocks.has_rows,
              "shape");
}

void CudaTissue::restored() {
  CudaTissue& d = *this;
  complete_tissue(d.state);
  check_blocks_of(d);
  const std::unique_ptr<StateOnHost> from = std::move(to_restore);
  FaceContacts& faces = d.state.faces;
  number_facets(faces, d.state.blocks);
  faces.motion.assign(faces.block_of.size(), {});
  faces.listed.clear();
  faces.all.clear();
  faces.forget_active();
  push(d);
  check_state_on_host(
      *from, {faces.version, static_cast<std::int64_t>(faces.block_of.size()),
              static_cast<std::int64_t>(d.marks.size()), static_cast<std::int64_t>(d.with.size()),
              collider_count(d.state.scene)});
  std::vector<std::uint8_t> with(d.with.size(), 0);
  std::vector<float4> hold(d.hold.size(), float4{0, 0, 0, 0});
  for (const HeldPoint& p : from->held) {
    with[p.entry] = p.with;
    hold[p.entry] = {p.hold[0], p.hold[1], p.hold[2], p.hold[3]};
  }
  send(with, d.with, with.size(), d.stream);
  send(hold, d.hold, hold.size(), d.stream);
  send(from->marks, d.marks, d.marks.size(), d.stream);
  send_faces(d, from->faces);
  launch_mark_slots(d.tables(), d.marks.data(), d.pushed_parts.data(), d.pushed_parts.size(),
                    d.stream);
  d.points_changed = true;
  launch_measure(d);  // that of each block is known there, too
  check_cuda(cudaStreamSynchronize(d.stream), "receive a state");
}

}  // namespace tissue_sim

#include "mls/cuda/cuda_mls_tissue.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "frame/leapfrog.h"
#include "mls/cuda/on_device.h"
#include "mls/cutting_edges.h"
#include "mls/faces.h"
#include "mls/node_contact.h"

namespace tissue_sim {
namespace {

/// Four floats a node.
void upload(const Array<float>& from, int count, DeviceArray<float4>& to, cudaStream_t stream) {
  to.upload(reinterpret_cast<const float4*>(from.data()), count, stream);
}

}  // namespace

CudaMlsTissue::CudaMlsTissue(const Scene& scene, std::vector<std::string> notes)
    : MlsTissue(scene, std::move(notes)), device_(std::make_unique<OnDevice>()) {
  OnDevice& d = *device_;
  d.gpu = open_gpu(d.stream);
  d.collider_count = collider_count(scene);
  if (d.collider_count > kMlsMostColliders) {
    throw std::runtime_error("the scene's tools have " + std::to_string(d.collider_count - 1) +
                             " parts that touch tissue: on the GPU at most " +
                             std::to_string(kMlsMostColliders - 1) + "; set device to cpu");
  }
  state_->edges.distant = this;
  upload_nodes();
  push();
  upload_pairs();
  measure();
}

CudaMlsTissue::~CudaMlsTissue() {
  if (device_->stream != nullptr) cudaStreamSynchronize(device_->stream);
}

void CudaMlsTissue::upload_nodes() {
  OnDevice& d = *device_;
  const MlsState& s = *state_;
  const int n = d.count = s.count();
  const auto count = static_cast<std::size_t>(n);
  d.mass.upload(s.mass.data(), n, d.stream);
  d.inv_mass.upload(s.inv_mass.data(), n, d.stream);
  d.edge.upload(s.edge.data(), n, d.stream);
  d.neo_hookean.upload(s.neo_hookean.data(), n, d.stream);
  d.viscous = s.viscous;
  std::vector<ContactSpring> springs(count);
  for (int i = 0; i < n; ++i) springs[i] = node_spring(s, i);
  d.contact.upload(springs, d.stream);
  const int slices = (n + kMlsSlice - 1) / kMlsSlice;
  d.host_offset.assign(slices + 1, 0);
  for (int slice = 0; slice < slices; ++slice) {
    std::int32_t widest = 0;
    for (int i = slice * kMlsSlice; i < std::min(n, (slice + 1) * kMlsSlice); ++i) {
      widest = std::max(widest, s.pairs.begin[i + 1] - s.pairs.begin[i]);
    }
    d.host_offset[slice + 1] = d.host_offset[slice] + widest * kMlsSlice;
  }
  d.offset.upload(d.host_offset, d.stream);
  std::vector<std::int32_t> other(d.host_offset.back());
  for (int slice = 0; slice < slices; ++slice) {
    for (std::int32_t at = d.host_offset[slice]; at < d.host_offset[slice + 1]; ++at) {
      const int i = slice * kMlsSlice + (at - d.host_offset[slice]) % kMlsSlice;
      const int k = (at - d.host_offset[slice]) / kMlsSlice;
      const bool is = i < n && k < s.pairs.begin[i + 1] - s.pairs.begin[i];
      other[at] = is ? s.pairs.other[s.pairs.begin[i] + k] : std::min(i, n - 1);
    }
  }
  d.other.upload(other, d.stream);
  d.stress.resize(3 * count);
  d.force.resize(count);
  for (int which = 0; which < 2; ++which) {
    d.u[which].resize(count);
    d.v[which].resize(count);
  }
  d.touching.resize(count);
  d.touching.clear(d.stream);
  d.hold.resize(count * d.collider_count);
  d.of_node.resize(count);
  d.measures.resize((count + kMlsThreads - 1) / kMlsThreads);
  if (!s.held_impulse.empty()) {
    d.anchor.upload(s.nodes.anchor, d.stream);
    d.held_impulse.resize(count);
    d.held_impulse.clear(d.stream);
  }
  d.wait("receive data");
}

void CudaMlsTissue::upload_pairs() {
  OnDevice& d = *device_;
  const MlsState& s = *state_;
  const int n = s.count();
  std::vector<float> weight(d.host_offset.back(), 0.0f), spring;
  std::vector<std::uint8_t> whole(weight.size(), 0);
  d.has_springs = !s.spring.empty();
  if (d.has_springs) spring.assign(weight.size(), 0.0f);
  for (int i = 0; i < n; ++i) {
    std::int32_t at = d.host_offset[i / kMlsSlice] + i % kMlsSlice;
    for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e, at += kMlsSlice) {
      weight[at] = s.pairs.weight[e];
      whole[at] = s.pairs.crossed[e] == 0;
      if (d.has_springs) spring[at] = s.spring[e] + s.spring[s.pairs.twin[e]];
    }
  }
  d.weight.upload(weight, d.stream);
  d.whole.upload(whole, d.stream);
  d.spring.upload(spring, d.stream);
  std::vector<float> moments(6 * static_cast<std::size_t>(n));
  for (int k = 0; k < 6; ++k) {
    std::copy_n(s.inverse_moment[k].begin(), n, moments.begin() + static_cast<std::size_t>(k) * n);
  }
  d.inverse_moment.upload(moments, d.stream);
  d.volume_mu.upload(s.volume_mu.data(), n, d.stream);
  d.volume_lambda.upload(s.volume_lambda.data(), n, d.stream);
  d.volume_eta.upload(s.volume_eta.data(), n, d.stream);
  d.kappa.upload(s.kappa.data(), n, d.stream);
  d.outer.upload(s.outer.data(), n, d.stream);
  upload(s.place, n, d.place, d.stream);  // cuts move where tissue ends
  std::vector<CudaMlsFace> faces(touches_by_faces(s) ? n : 0);
  for (std::size_t i = 0; i < faces.size(); ++i) {
    std::copy_n(&s.face[4 * i], 4, faces[i].face);
    faces[i].spring = node_spring(s, i);
    faces[i].edge = s.edge[i];
    faces[i].root_friction = s.root_friction[i];
  }
  if (!faces.empty()) d.faces.upload(faces, d.stream);
  d.wait("receive data");
}

void CudaMlsTissue::pairs_changed(const std::vector<std::int32_t>& nodes) {
  OnDevice& d = *device_;
  const MlsState& s = *state_;
  if (d.has_springs != !s.spring.empty()) {
    upload_pairs();
    return;
  }
  std::vector<CudaMlsNodeChange> changes;
  std::vector<CudaMlsEntryChange> entries;
  const auto add = [&](std::int32_t i, std::int32_t e) {
    const std::int32_t at =
        d.host_offset[i / kMlsSlice] + (e - s.pairs.begin[i]) * kMlsSlice + i % kMlsSlice;
    entries.push_back({at, s.pairs.weight[e],
                       d.has_springs ? s.spring[e] + s.spring[s.pairs.twin[e]] : 0.0f,
                       static_cast<std::uint8_t>(s.pairs.crossed[e] == 0)});
  };
  for (const std::int32_t i : nodes) {
    CudaMlsNodeChange c;
    c.node = i;
    for (int k = 0; k < 6; ++k) c.inverse_moment[k] = s.inverse_moment[k][i];
    c.volume_mu = s.volume_mu[i];
    c.volume_lambda = s.volume_lambda[i];
    c.volume_eta = s.volume_eta[i];
    c.kappa = s.kappa[i];
    c.outside = s.place[4 * i + 3];
    std::copy_n(&s.face[4 * i], 4, c.face);
    c.outer = s.outer[i];
    changes.push_back(c);
    for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
      add(i, e);
      // Springs of a node are its neighbours', too.
      if (d.has_springs) add(s.pairs.other[e], s.pairs.twin[e]);
    }
  }
  d.node_changes.upload(changes, d.stream);
  d.entry_changes.upload(entries, d.stream);
  launch_mls_changes(d.field(), d.faces.data(), d.node_changes.data(),
                     static_cast<int>(changes.size()), d.entry_changes.data(),
                     static_cast<int>(entries.size()), d.stream);
  d.wait("receive data");
}

void CudaMlsTissue::pull_held() {
  OnDevice& d = *device_;
  d.held_impulse.download(reinterpret_cast<float4*>(state_->held_impulse.data()),
                          d.held_impulse.size(), d.stream);
  d.wait("send data");
}

void CudaMlsTissue::push() {
  OnDevice& d = *device_;
  d.current = 0;
  upload(state_->u, d.count, d.u[0], d.stream);
  upload(state_->v, d.count, d.v[0], d.stream);
  push_contact();
  d.wait("receive data");
  d.host_is_current = true;
}

void CudaMlsTissue::pull() {
  OnDevice& d = *device_;
  if (d.host_is_current) return;
  d.u[d.current].download(reinterpret_cast<float4*>(state_->u.data()), d.count, d.stream);
  d.v[d.current].download(reinterpret_cast<float4*>(state_->v.data()), d.count, d.stream);
  d.wait("send data");
  d.host_is_current = true;
}

void CudaMlsTissue::push_velocities() {
  OnDevice& d = *device_;
  upload(state_->v, d.count, d.v[d.current], d.stream);
  d.wait("receive data");
}

void CudaMlsTissue::bring_motion(const std::vector<std::int32_t>& nodes) {
  OnDevice& d = *device_;
  const float4* const from = d.some.bring(d.present(), nodes, d.stream);
  const std::size_t count = nodes.size();
  for (std::size_t i = 0; i < count; ++i) {
    std::memcpy(&state_->u[4 * nodes[i]], from + i, sizeof(float4));
    std::memcpy(&state_->v[4 * nodes[i]], from + count + i, sizeof(float4));
  }
}

void CudaMlsTissue::send_velocities(const std::vector<std::int32_t>& nodes) {
  OnDevice& d = *device_;
  float4* const v = d.some.room(nodes.size(), d.stream) + nodes.size();
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    std::memcpy(v + i, &state_->v[4 * nodes[i]], sizeof(float4));
  }
  d.some.send(nodes, d.present(), d.motion(1 - d.current), d.stream);
}

void CudaMlsTissue::pull_contact() {
  OnDevice& d = *device_;
  MlsState& s = *state_;
  std::vector<std::uint32_t> touching(d.count);
  std::vector<float4> hold(d.hold.size());
  d.touching.download(touching.data(), touching.size(), d.stream);
  d.hold.download(hold.data(), hold.size(), d.stream);
  d.wait("send data");
  for (MlsGroupContact& group : s.contact) group.touching.clear();
  for (std::int32_t i = 0; i < d.count; ++i) {
    for (int c = 0; c < d.collider_count; ++c) {
      if ((touching[i] >> c & 1) == 0) continue;
      const float4& h = hold[static_cast<std::size_t>(c) * d.count + i];
      s.contact[i / kMlsGroup].touching.push_back({i, c, {h.x, h.y, h.z}});
    }
  }
}

void CudaMlsTissue::push_contact() {
  OnDevice& d = *device_;
  std::vector<std::uint32_t> touching(d.count, 0);
  std::vector<float4> hold(d.hold.size());
  for (const MlsGroupContact& group : state_->contact) {
    for (const MlsTouch& t : group.touching) {
      touching[t.node] |= 1u << t.collider;
      hold[static_cast<std::size_t>(t.collider) * d.count + t.node] = {t.hold[0], t.hold[1],
                                                                       t.hold[2], 0};
    }
  }
  d.touching.upload(touching, d.stream);
  d.hold.upload(hold, d.stream);
  d.wait("receive data");
}

void CudaMlsTissue::search_contacts(float dt, double fastest) {
  if (state_->node_contacts.until_look > 0) {
    --state_->node_contacts.until_look;
    return;
  }
  pull();
  pull_slips();
  if (update_node_contacts(*state_, pieces_.of_point, dt, fastest)) push_node_contacts();
}

void CudaMlsTissue::pull_slips() {
  OnDevice& d = *device_;
  if (d.touching_count == 0) return;
  d.contact_slip.download(state_->node_contacts.slip.data(), d.contact_slip.size(), d.stream);
  d.wait("send data");
}

void CudaMlsTissue::push_node_contacts() {
  OnDevice& d = *device_;
  const MlsNodeContacts& contacts = state_->node_contacts;
  d.may_touch = !touches_by_faces(*state_) && !contacts.other.empty();
  if (d.may_touch) {
    d.contact_begin.upload(contacts.begin, d.stream);
    d.contact_other.upload(contacts.other, d.stream);
    d.contact_rest.upload(contacts.rest, d.stream);
    d.wait("receive data");
  }
  d.touching_count = static_cast<int>(contacts.node.size());
  if (d.touching_count == 0) return;
  d.contact_node.upload(contacts.node, d.stream);
  d.contact_at.upload(contacts.at, d.stream);
  d.contact_knows.upload(contacts.knows, d.stream);
  d.contact_begin.upload(contacts.begin, d.stream);
  d.contact_other.upload(contacts.other, d.stream);
  d.contact_slip.upload(contacts.slip, d.stream);
  d.contact_face.resize(d.touching_count);
  d.contact_force.resize(d.touching_count);
  d.wait("receive data");
}

void CudaMlsTissue::upload_colliders(const FramePart& part) {
  OnDevice& d = *device_;
  const int substeps = part.substeps.count, count = d.collider_count;
  d.host_colliders.resize(static_cast<std::size_t>(substeps) * count);
  for (int i = 0; i < substeps; ++i) {
    frame_->colliders.at(part.substeps.share(i + 1, part.from, part.to),
                         d.host_colliders.data() + static_cast<std::size_t>(i) * count);
  }
  d.colliders.upload(d.host_colliders, d.stream);
  d.host_anchors.clear();
  for (int i = 0; i < substeps && !frame_->input.anchors.empty(); ++i) {
    for (const MlsAnchorPose& pose : mls_anchors_at(
             state_->scene, frame_->input, part.substeps.share(i + 1, part.from, part.to))) {
      d.host_anchors.push_back(pose);
    }
  }
  d.anchors.upload(d.host_anchors, d.stream);
  d.loads.resize(d.host_colliders.size() * kMlsLoadSums);
  d.loads.clear(d.stream);
}

int CudaMlsTissue::run_part(const FramePart& part) {
  OnDevice& d = *device_;
  MlsState& s = *state_;
  const CudaMlsField field = d.field();
  if (part.from == 0) d.held_impulse.clear(d.stream);
  upload_colliders(part);
  const float before = s.dt;
  const std::unique_ptr<EdgePushes> edges = edge_pushes(s);
  std::vector<std::vector<ColliderLoad>> edge_loads;
  const std::vector<Box>& reach = frame_->colliders.reach();
  // Tissue gets faster within a part: what it may come to is listed widely, for it costs little.
  const double time = part.substeps.until(part.substeps.count);
  const double margin =
      2 * mls_spacing(s.scene) + 4 * (d.speed + s.scene.gravity.norm() * time) * time;
  std::uint32_t near = 0;
  for (std::size_t c = 0; c < reach.size(); ++c) {
    const bool meets = (d.box.min.array() - margin <= reach[c].max.array()).all() &&
                       (reach[c].min.array() <= d.box.max.array() + margin).all();
    if (meets) near |= 1u << c;
  }
  for (int i = 0; i < part.substeps.count; ++i) {
    const float dt = part.substeps.at(i);
    const std::size_t first = static_cast<std::size_t>(i) * d.collider_count;
    if (may_touch_) {
      double fastest = 0;
      for (int c = 0; c < d.collider_count; ++c) {
        if ((near >> c & 1) == 0) continue;
        fastest = std::max(fastest, speed(d.host_colliders[first + c]));
      }
      search_contacts(dt, fastest);
    }
    if (edges) {
      frame_->colliders.at(part.substeps.share(i + 1, part.from, part.to), s.colliders);
      std::vector<ColliderLoad>& loads = edge_loads.emplace_back(s.colliders.size());
      result_.cutting_work += edges->push(dt, kick_of(s.dt, dt), loads);
    }
    CudaMlsStep step;
    step.dt = dt;
    step.kick = kick_of(s.dt, dt);
    step.keep = static_cast<float>(std::exp(-s.scene.damping * step.kick));
    for (int a = 0; a < 3; ++a) step.gravity[a] = static_cast<float>(s.scene.gravity[a]);
    const CudaMlsColliders colliders{
        d.colliders.data() + first, d.collider_count, near,
        d.touching.data(),          d.hold.data(),    d.loads.data() + kMlsLoadSums * first};
    const CudaMlsNodeContacts contacts = d.contacts(s.dt);
    CudaMlsHold hold;
    if (d.held_impulse.size() > 0) {
      const std::size_t anchors = d.host_anchors.size() / part.substeps.count;
      hold.anchor = d.anchor.data();
      hold.impulse = d.held_impulse.data();
      if (anchors > 0) hold.anchors = d.anchors.data() + i * anchors;
    }
    launch_mls_stresses(field, d.present(), contacts, d.stream);
    if (contacts.count > 0) launch_mls_touches(field, d.present(), contacts, d.stream);
    launch_mls_moves(field, d.present(), d.motion(1 - d.current), step, colliders, contacts, hold,
                     d.stream);
    d.current = 1 - d.current;
    d.host_is_current = false;
    s.dt = dt;
    s.time += dt;
  }
  if (edges) edges->end();
  sum_loads(part, before, edge_loads);
  return part.substeps.count;
}

void CudaMlsTissue::sum_loads(const FramePart& part, float before,
                              const std::vector<std::vector<ColliderLoad>>& of_edges) {
  OnDevice& d = *device_;
  d.host_loads.resize(d.loads.size());
  d.loads.download(d.host_loads.data(), d.host_loads.size(), d.stream);
  d.wait("advance");
  std::vector<ColliderLoad> on(d.collider_count);
  const unsigned long long* sum = d.host_loads.data();
  for (int i = 0; i < part.substeps.count; ++i) {
    for (ColliderLoad& load : on) {
      for (int a = 0; a < 3; ++a) {
        load.force[a] = kMlsLoadUnit * static_cast<double>(static_cast<long long>(sum[a]));
        load.torque[a] = kMlsLoadUnit * static_cast<double>(static_cast<long long>(sum[3 + a]));
      }
      load.points = static_cast<double>(sum[6]);
      load.inside = static_cast<double>(sum[7]);
      load.deepest = kInsideUnit * static_cast<double>(sum[8]);
      sum += kMlsLoadSums;
    }
    for (std::size_t c = 0; !of_edges.empty() && c < on.size(); ++c) on[c].add(of_edges[i][c]);
    const float acted = kick_of(i == 0 ? before : part.substeps.at(i - 1), part.substeps.at(i));
    frame_->colliders.add_loads(part.substeps.share(i + 1, part.from, part.to),
                                d.host_colliders.data() + static_cast<std::size_t>(i) * on.size(),
                                on.data(), acted / frame_->duration, result_.loads);
  }
}

void CudaMlsTissue::save_checkpoint() {
  OnDevice& d = *device_;
  OnDevice::Checkpoint& saved = d.checkpoint;
  saved.u.copy(d.u[d.current], d.stream);
  saved.v.copy(d.v[d.current], d.stream);
  saved.hold.copy(d.hold, d.stream);
  saved.held_impulse.copy(d.held_impulse, d.stream);
  saved.touching.copy(d.touching, d.stream);
  saved.node_contacts = state_->node_contacts;
  saved.edges = state_->edges.holds;
  saved.slip.copy(d.contact_slip, d.stream);
  saved.dt = state_->dt;
  saved.time = state_->time;
  saved.result = result_;
}

void CudaMlsTissue::reject_part(Verdict) {
  OnDevice& d = *device_;
  const OnDevice::Checkpoint& saved = d.checkpoint;
  d.u[d.current].copy(saved.u, d.stream);
  d.v[d.current].copy(saved.v, d.stream);
  d.hold.copy(saved.hold, d.stream);
  d.held_impulse.copy(saved.held_impulse, d.stream);
  d.touching.copy(saved.touching, d.stream);
  d.host_is_current = false;
  state_->node_contacts = saved.node_contacts;
  state_->edges.holds = saved.edges;
  push_node_contacts();
  if (d.touching_count > 0) d.contact_slip.copy(saved.slip, d.stream);
  state_->dt = saved.dt;
  state_->time = saved.time;
  result_ = saved.result;
}

MlsTissue::Figures CudaMlsTissue::measure() {
  OnDevice& d = *device_;
  launch_mls_measure(d.field(), d.present(), d.measures.data(), d.of_node.data(), nullptr,
                     d.stream);
  d.host_measures.resize(d.measures.size());
  d.measures.download(d.host_measures.data(), d.host_measures.size(), d.stream);
  d.of_node.download(stiffening_.data(), d.count, d.stream);
  d.wait("finish a part of a frame");
  Figures sum;
  d.box = Box();
  for (const CudaMlsMeasure& m : d.host_measures) {
    sum.elastic += m.elastic;
    sum.kinetic += m.kinetic;
    sum.stretch2 = std::max(sum.stretch2, m.stretch2);
    if (!(m.speed <= sum.speed)) sum.speed = m.speed;
    sum.finite = sum.finite && m.finite != 0;
    d.box.min = d.box.min.cwiseMin(Vec3(m.min[0], m.min[1], m.min[2]));
    d.box.max = d.box.max.cwiseMax(Vec3(m.max[0], m.max[1], m.max[2]));
  }
  d.speed = sum.speed;
  return sum;
}

void CudaMlsTissue::measure_stress(std::vector<float>& of_node) {
  OnDevice& d = *device_;
  of_node.resize(d.count);
  launch_mls_measure(d.field(), d.present(), d.measures.data(), nullptr, d.of_node.data(),
                     d.stream);
  d.of_node.download(of_node.data(), of_node.size(), d.stream);
  d.wait("measure stress");
}

void CudaMlsTissue::forces_at(const float* u, float* force, float rest) {
  OnDevice& d = *device_;
  CudaMlsField field = d.field();
  field.viscous = false;
  field.spring_rest = rest;
  const CudaMlsMotion at = d.motion(1 - d.current);  // not in use between two parts
  d.u[1 - d.current].upload(reinterpret_cast<const float4*>(u), d.count, d.stream);
  launch_mls_stresses(field, at, {}, d.stream);
  launch_mls_forces(field, at.u, d.force.data(), d.stream);
  d.force.download(reinterpret_cast<float4*>(force), d.count, d.stream);
  d.wait("sum forces");
}

std::vector<std::uint8_t> CudaMlsTissue::save() {
  pull();
  pull_contact();
  pull_slips();
  return MlsTissue::save();
}

void CudaMlsTissue::restore(Span<const std::uint8_t> saved) {
  MlsTissue::restore(saved);
  push();
  upload_pairs();
  push_node_contacts();
  measure();
}

std::string CudaMlsTissue::device_name() const { return "cuda (" + device_->gpu + ")"; }

GpuPoints CudaMlsTissue::read_points_on_gpu(const PointSelection& selection) {
  std::vector<std::uint8_t> cloud;  // which the host makes
  const int count = read_points(selection, cloud);
  return device_->lent.lend(cloud, count, device_->stream);
}

}  // namespace tissue_sim

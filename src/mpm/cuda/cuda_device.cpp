#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "cutting/edge_pushes.h"
#include "mpm/cuda/on_device.h"
#include "tools/frame_colliders.h"
#include "tools/tool_motion.h"

namespace tissue_sim {
namespace {

int attribute(cudaDeviceAttr which) {
  int value = 0;
  check_cuda(cudaDeviceGetAttribute(&value, which, 0), "be asked");
  return value;
}

void upload_colliders(CudaTissue& d) {
  const std::vector<Box>& reach = d.run.frame->colliders.reach();
  d.host_reach.resize(reach.size());
  for (std::size_t c = 0; c < reach.size(); ++c) {
    for (int a = 0; a < 3; ++a) {
      d.host_reach[c].min[a] = static_cast<float>(reach[c].min[a]);
      d.host_reach[c].max[a] = static_cast<float>(reach[c].max[a]);
    }
  }
  d.host_colliders.resize(reach.size() * d.loads_of);
  for (int i = 0; i < d.loads_of; ++i) {
    d.run.frame->colliders.at(d.share_of(i), d.host_colliders.data() + i * reach.size());
  }
  d.reach.upload(d.host_reach, d.stream);
  d.colliders.upload(d.host_colliders, d.stream);
  d.loads.resize(kLoadSums * d.host_colliders.size());
  d.loads.clear(d.stream);
}

void sum_loads(CudaTissue& d) {
  d.run.work = 0;
  if (d.loads_of == 0) return;
  const std::size_t count = d.run.frame->colliders.count();
  std::vector<ColliderLoad> on(count);
  for (int i = 0; i < d.loads_of; ++i) {
    const long long* sum = d.host_loads.data() + kLoadSums * i * count;
    for (ColliderLoad& load : on) {
      for (int a = 0; a < 3; ++a) {
        load.force[a] = kLoadUnit * static_cast<double>(sum[a]);
        load.torque[a] = kLoadUnit * static_cast<double>(sum[3 + a]);
      }
      load.points = static_cast<double>(sum[6]);
      load.inside = static_cast<double>(sum[7]);
      load.deepest = kInsideUnit * static_cast<double>(sum[8]);
      sum += kLoadSums;
    }
    for (std::size_t c = 0; !d.edge_loads.empty() && c < count; ++c) {
      on[c].add(d.edge_loads[i][c]);
    }
    const float acted =
        kick_of(i == 0 ? d.dt_before : d.part.substeps.at(i - 1), d.part.substeps.at(i));
    d.run.frame->colliders.add_loads(d.share_of(i), d.host_colliders.data() + i * count, on.data(),
                                     acted / d.run.frame->duration, d.result.loads);
    d.run.work +=
        d.run.frame->colliders.power(d.host_colliders.data() + i * count, on.data()) * acted;
  }
  d.loads_of = 0;
}

/// What edges do in the part's substep `i`, before it: the host's.
void push_edges(CudaTissue& d, EdgePushes& edges, int i) {
  const float dt = d.part.substeps.at(i);
  d.run.frame->colliders.at(d.share_of(i), d.state.colliders);
  std::vector<ColliderLoad> loads(d.state.colliders.size());
  d.result.cutting_work += edges.push(dt, kick_of(d.state.dt, dt), loads);
  d.edge_loads.push_back(std::move(loads));
}

}  // namespace

std::unique_ptr<MpmDevice> make_cuda_mpm_device(const Scene& scene, MpmRun& run) {
  return std::make_unique<CudaTissue>(scene, run);
}

CudaTissue::CudaTissue(const Scene& scene, MpmRun& of)
    : run(of), state(of.state), pieces(of.pieces), result(of.result) {
  CudaTissue& d = *this;
  if (const int count = collider_count(scene); count > kMaxColliders) {
    throw std::runtime_error("the scene's tools have " + std::to_string(count - 1) +
                             " parts that touch tissue (a grasper two, other tools one): on the "
                             "GPU at most " +
                             std::to_string(kMaxColliders - 1) + "; set device to cpu");
  }
  d.gpu = open_gpu(d.stream);
  d.limits = {attribute(cudaDevAttrMultiProcessorCount),
              static_cast<std::size_t>(attribute(cudaDevAttrMaxSharedMemoryPerBlockOptin))};
}

CudaTissue::~CudaTissue() {
  if (stream == nullptr) return;
  cudaStreamSynchronize(stream);
  cudaStreamDestroy(stream);
}

std::string CudaTissue::name() const { return "cuda (" + gpu + ")"; }

void CudaTissue::begin() {
  CudaTissue& d = *this;
  d.cut_shape = choose_shape(d.state.bodies, d.limits, false);
  d.state.edges = resisting_edges(d.state.scene);
  d.state.edges.distant = &d;
  // What touches other tissue keeps its blocks, which know the contacts.
  make_blocks(
      d, d.state.bodies.size() == 1 ? choose_shape(d.state.bodies, d.limits, true) : d.cut_shape,
      d.limits.processors);
  for (std::int32_t p = 0; p < d.state.points.size(); ++p) {
    if (!(d.state.points.free_volume_of(p) > 0)) d.anchors.held_points.push_back(p);
  }
  push(d);
}

void CudaTissue::begun() {
  CudaTissue& d = *this;
  if (d.held_by == 0) return;
  d.outer_points.emplace(d.state, d.state.anchors);
  push_outer_points(d);
}

void CudaTissue::begin_frame(const FrameInput& input, bool move) {
  if (state.anchors.rows.empty() && input.anchors.empty()) return;
  if (move) {
    push_anchors(*this);
  } else {
    anchors.impulse.clear(stream);  // as those of the host
  }
}

void CudaTissue::begin_rest() {
  CudaTissue& d = *this;
  look_for_edges(d.state, d.run.frame->input, d.run.frame->cut_to);
  if (!d.run.frame->blades) return;
  d.u_before.resize(d.u[0].size());
  check_cuda(cudaMemcpyAsync(d.u_before.data(), d.present().u, d.u[0].size() * sizeof(float4),
                             cudaMemcpyDeviceToDevice, d.stream),
             "copy");
}

int CudaTissue::run_part(const FramePart& part) {
  CudaTissue& d = *this;
  std::vector<TearingPoint>& tearing = d.run.frame->tearing;
  tearing.clear();
  const int substeps = d.loads_of = part.substeps.count;
  d.part = part;
  d.dt_before = d.state.dt;
  if (substeps == 0) return 0;
  upload_colliders(d);
  upload_anchor_places(d);
  find_near(d);
  const bool tears = can_tear(d.state);
  const std::unique_ptr<EdgePushes> edges = edge_pushes(d.state);
  d.edge_loads.clear();
  const int checks = tears ? tear_checks(d.state, substeps, part.substeps.longest()) : 1;
  int done = 0;
  for (int check = 0; done < substeps && tearing.empty(); ++check) {
    const int end = tear_check_at(check, checks, substeps);
    for (; edges && done < end; ++done) {
      push_edges(d, *edges, done);
      run_substeps(d, done, done + 1);
    }
    run_substeps(d, done, end);
    done = end;
    if (tears)
      tearing = tearing_of(d.state, d.state, list_stretched(d, tear_share(d.state, d.state)));
  }
  if (edges) edges->end();
  d.loads_of = done;
  leave_anchors(d, done);
  d.host_loads.resize(d.loads.size());
  d.loads.download(d.host_loads.data(), d.loads.size(), d.stream);
  if (tearing.empty()) search_ahead(d);
  return done;
}

unsigned CudaTissue::measure(unsigned) {
  launch_measure(*this);
  finish_measure(*this);
  return kMeasureMotion | kMeasureStiffness | kMeasureEnergies;
}

unsigned CudaTissue::measure_part(unsigned) {
  CudaTissue& d = *this;
  launch_measure(d);
  look_for_missed(d);
  finish_measure(d);
  has_missed = d.went.empty() && tissue_sim::missed_contact(d);
  d.went.clear();
  sum_loads(d);
  return kMeasureMotion | kMeasureStiffness | kMeasureEnergies;
}

void CudaTissue::save_motion() {
  CudaTissue& d = *this;
  CudaTissue::Checkpoint& saved = d.checkpoint;
  const FacesOnDevice& f = d.faces;
  saved.u.copy(d.u[d.current], d.stream);
  saved.v.copy(d.v[d.current], d.stream);
  launch_list_held(d.with.data(), d.hold.data(), static_cast<int>(d.with.size()), saved.held.data(),
                   static_cast<int>(saved.held.size()), saved.held_count.data(), d.stream);
  saved.held_count.download(saved.host_held_count.data(), 1, d.stream);
  saved.new_facets = f.version != d.state.faces.version || f.springs.size() == 0;
  if (!saved.new_facets) {
    saved.springs.copy(f.springs, d.stream);
    saved.figures.copy(f.figures, d.stream);
  }
  saved.kept = d.state.faces.kept;
  saved.edges = d.state.edges.holds;
  saved.impulse.copy(d.anchors.impulse, d.stream);
  saved.anchors = d.state.anchors.now;
  saved.time = d.state.time;
  saved.dt = d.state.dt;
}

bool CudaTissue::can_restore_motion() const {
  const CudaTissue::Checkpoint& saved = checkpoint;
  return static_cast<std::size_t>(saved.host_held_count[0]) <= saved.held.size();
}

void CudaTissue::restore_motion(bool missed) {
  CudaTissue& d = *this;
  if (missed) {
    d.went = d.state.motion;
    d.u_went.copy(d.u[d.current], d.stream);
  }
  const CudaTissue::Checkpoint& saved = d.checkpoint;
  FacesOnDevice& f = d.faces;
  d.u[d.current].copy(saved.u, d.stream);
  d.v[d.current].copy(saved.v, d.stream);
  d.with.clear(d.stream);
  launch_hold_again(saved.held.data(), saved.host_held_count[0], d.with.data(), d.hold.data(),
                    d.stream);
  if (saved.new_facets) {
    f.version = -1;  // they go up again
  } else {
    f.springs.copy(saved.springs, d.stream);
    f.figures.copy(saved.figures, d.stream);
  }
  d.state.faces.kept = saved.kept;
  d.state.edges.holds = saved.edges;
  d.anchors.impulse.copy(saved.impulse, d.stream);
  d.state.anchors.now = saved.anchors;
  search_anew(d);
  d.state.time = saved.time;
  d.state.dt = saved.dt;
  d.loads_of = 0;
}

void CudaTissue::end_frame() { pull_impulses(*this); }

void launch(CudaTissue& d, int begin, int end, float dt) {
  const Scene& scene = d.state.scene;
  const std::size_t collider_count = d.host_reach.size();
  CudaFrame frame;
  for (int i = 0; i < 2; ++i) {
    frame.state[i] = d.nodes(i);
    frame.force[i] = d.force[i].data();
  }
  frame.current = d.current;
  frame.substeps = end - begin;
  frame.step.dt = dt;
  frame.step.kick = kick_of(d.state.dt, dt);
  const float before = d.state.dt / dt;
  frame.grown = std::max(0.0f, 1 - before * before);
  frame.step.keep = static_cast<float>(std::exp(-scene.damping * frame.step.kick));
  for (int a = 0; a < 3; ++a) frame.step.gravity[a] = static_cast<float>(scene.gravity[a]);
  frame.colliders = d.colliders.data() + begin * collider_count;
  frame.collider_count = static_cast<int>(collider_count);
  frame.loads = d.loads.data() + kLoadSums * begin * collider_count;
  frame.near_cells = d.may_meet ? d.near_cells.data() : nullptr;
  frame.near_count = d.near_count.data();
  frame.cell_size = static_cast<float>(scene.cell_size);
  frame.arrived = d.arrived.data();
  frame.faces = faces_of_launch(d);
  frame.held_faces = d.anchors.view(begin, static_cast<int>(d.state.anchors.origin.size()));
  frame.held_faces.drift = face_drift(dt);
  frame.held_faces.swing_loss = kSwingLoss;
  frame.front = d.front.view();
  const CudaTissue::Way way = way_of(d, frame.faces != nullptr);
  if (way != CudaTissue::kAlone) frame.pushes = clear_pushes(d);
  launch_substeps(d.plans[way], way == CudaTissue::kAlone ? d.tables() : d.pushed_tables(), frame,
                  d.stream);
  d.current = (d.current + end - begin) % 2;
  d.state.time += static_cast<double>(end - begin) * dt;
  d.state.dt = dt;
}

}  // namespace tissue_sim

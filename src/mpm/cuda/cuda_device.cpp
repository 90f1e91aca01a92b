#include "mpm/cuda/cuda_device.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

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
    const float acted =
        kick_of(i == 0 ? d.dt_before : d.part.substeps.at(i - 1), d.part.substeps.at(i));
    d.run.frame->colliders.add_loads(d.share_of(i), d.host_colliders.data() + i * count, on.data(),
                                     acted / d.run.frame->duration, d.result.loads);
    d.run.work +=
        d.run.frame->colliders.power(d.host_colliders.data() + i * count, on.data()) * acted;
  }
  d.loads_of = 0;
}

}  // namespace

std::unique_ptr<MpmDevice> make_cuda_mpm_device(const Scene& scene, MpmRun& run) {
  return std::make_unique<CudaMpmDevice>(scene, run);
}

CudaMpmDevice::CudaMpmDevice(const Scene& scene, MpmRun& run)
    : tissue_(std::make_unique<CudaTissue>(run)) {
  CudaTissue& d = *tissue_;
  d.gpu = open_gpu(d.stream);
  if (const int count = collider_count(scene); count > kMaxColliders) {
    throw std::runtime_error("the scene's tools have " + std::to_string(count - 1) +
                             " parts that touch tissue (a grasper two, other tools one): on the "
                             "GPU at most " +
                             std::to_string(kMaxColliders - 1) + "; set device to cpu");
  }
  d.limits = {attribute(cudaDevAttrMultiProcessorCount),
              static_cast<std::size_t>(attribute(cudaDevAttrMaxSharedMemoryPerBlockOptin))};
}

CudaMpmDevice::~CudaMpmDevice() {
  if (tissue_->stream != nullptr) cudaStreamSynchronize(tissue_->stream);
}

std::string CudaMpmDevice::name() const { return "cuda (" + tissue_->gpu + ")"; }

void CudaMpmDevice::begin() {
  CudaTissue& d = *tissue_;
  d.cut_shape = choose_shape(d.state.bodies, d.limits, false);
  // What touches other tissue keeps its blocks, which know the contacts.
  make_blocks(
      d, d.state.bodies.size() == 1 ? choose_shape(d.state.bodies, d.limits, true) : d.cut_shape,
      d.limits.processors);
  for (std::int32_t p = 0; p < d.state.points.size(); ++p) {
    if (!(d.state.points.free_volume_of(p) > 0)) d.anchors.held_points.push_back(p);
  }
  push(d);
}

void CudaMpmDevice::begun() {
  CudaTissue& d = *tissue_;
  if (d.held_by == 0) return;
  d.outer_points.emplace(d.state, d.state.anchors);
  push_outer_points(d);
}

void CudaMpmDevice::begin_frame(const FrameInput& input, bool move) {
  if (tissue_->state.anchors.rows.empty() && input.anchors.empty()) return;
  if (move) {
    push_anchors(*tissue_);
  } else {
    push_impulses(*tissue_);
  }
}

void CudaMpmDevice::begin_rest() {
  CudaTissue& d = *tissue_;
  if (!d.run.frame->blades) return;
  d.u_before.resize(d.u[0].size());
  check_cuda(cudaMemcpyAsync(d.u_before.data(), d.present().u, d.u[0].size() * sizeof(float4),
                             cudaMemcpyDeviceToDevice, d.stream),
             "copy");
}

int CudaMpmDevice::run_part(const FramePart& part) {
  CudaTissue& d = *tissue_;
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
  const int checks = tears ? tear_checks(d.state, substeps, part.substeps.longest()) : 1;
  int done = 0;
  for (int check = 0; done < substeps && tearing.empty(); ++check) {
    const int end = tear_check_at(check, checks, substeps);
    run_substeps(d, done, end);
    done = end;
    if (tears) add_tearing(d.state, list_stretched(d, 1), tearing);
  }
  d.loads_of = done;
  leave_anchors(d, done);
  d.host_loads.resize(d.loads.size());
  d.loads.download(d.host_loads.data(), d.loads.size(), d.stream);
  if (tearing.empty()) search_ahead(d);
  return done;
}

unsigned CudaMpmDevice::measure(unsigned) {
  launch_measure(*tissue_);
  finish_measure(*tissue_);
  return kMeasureMotion | kMeasureStiffness | kMeasureEnergies;
}

unsigned CudaMpmDevice::measure_part(unsigned) {
  CudaTissue& d = *tissue_;
  launch_measure(d);
  look_for_missed(d);
  finish_measure(d);
  missed_ = d.went.empty() && tissue_sim::missed_contact(d);
  d.went.clear();
  sum_loads(d);
  return kMeasureMotion | kMeasureStiffness | kMeasureEnergies;
}

double CudaMpmDevice::measure_limit(const std::vector<std::uint8_t>&, int steps) {
  return tissue_sim::measure_limit(*tissue_, steps);
}

void CudaMpmDevice::save_motion() {
  CudaTissue& d = *tissue_;
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
  saved.impulse.copy(d.anchors.impulse, d.stream);
  saved.anchors = d.state.anchors.now;
  saved.time = d.state.time;
  saved.dt = d.state.dt;
}

bool CudaMpmDevice::can_restore_motion() const {
  const CudaTissue::Checkpoint& saved = tissue_->checkpoint;
  return static_cast<std::size_t>(saved.host_held_count[0]) <= saved.held.size();
}

void CudaMpmDevice::restore_motion(bool missed) {
  CudaTissue& d = *tissue_;
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
  d.anchors.impulse.copy(saved.impulse, d.stream);
  d.state.anchors.now = saved.anchors;
  search_anew(d);
  d.state.time = saved.time;
  d.state.dt = saved.dt;
  d.loads_of = 0;
}

void CudaMpmDevice::end_frame() { pull_impulses(*tissue_); }

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
  if (frame.faces != nullptr || d.may_meet || has_front(d)) {
    frame.pushes = clear_pushes(d);
    const CudaTables tables = d.pushed_tables();
    if (has_front(d) || meets_thin_tools(d)) {
      launch_substeps(d.front_plan, tables, frame, d.front_resident, d.stream);
    } else if (frame.faces != nullptr) {
      launch_substeps(d.touch_plan, tables, frame, d.touch_resident, d.stream);
    } else {
      launch_substeps(d.push_plan, tables, frame, d.push_resident, d.stream);
    }
  } else {
    launch_substeps(d.plan, d.tables(), frame, d.resident, d.stream);
  }
  d.current = (d.current + end - begin) % 2;
  d.state.time += static_cast<double>(end - begin) * dt;
  d.state.dt = dt;
}

std::string plan(const CudaTissue& d) {
  const BlockShape& b = d.shape.blocks;
  return std::to_string(b.x) + " x " + std::to_string(b.y) + " x " + std::to_string(b.z) +
         " cells, " + std::to_string(d.plan.threads) + " a block, " +
         std::to_string(d.blocks.size()) + " blocks in " + std::to_string(d.bundles.size()) +
         " bundles, " + std::to_string(d.resident) + " at once" + (d.plan.cached ? ", cached" : "");
}

}  // namespace tissue_sim

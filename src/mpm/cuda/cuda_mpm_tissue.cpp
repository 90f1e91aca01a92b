#include "mpm/cuda/cuda_mpm_tissue.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "frame/out_of_control.h"
#include "mpm/anchors/anchored_share.h"
#include "mpm/cuda/on_device.h"
#include "mpm/cuda/outer_points.h"
#include "mpm/lattice_pieces.h"
#include "mpm/piece_motion.h"
#include "mpm/split/cut_tissue.h"
#include "mpm/state_figures.h"
#include "tools/frame_colliders.h"
#include "tools/tool_motion.h"

namespace tissue_sim {
namespace {

std::unique_ptr<MpmState> make_state(const Scene& scene, std::vector<std::string>* notes) {
  auto state = std::make_unique<MpmState>();
  state->scene = scene;
  state->bodies = make_lattice_bodies(scene, state->points, notes, NodeRange::kBox);
  state->whole_bonds = state->points.bonds;
  const bool at_surface = scene.mpm.boundary == MpmBoundary::kSurface;
  state->front.follows = at_surface;
  if (at_surface) find_free_volumes(*state);
  state->fields = std::make_unique<NodeFields>(state->bodies, state->points, state->nodes);
  if (at_surface) find_face_links(scene, *state, state->anchors);
  find_face_rows(*state, state->anchors);
  for (const std::int32_t p : state->anchors.points) {
    if (state->points.anchored[p] == 0) state->points.anchored[p] = Points::kAtAnchor;
  }
  state->instructions = instruction_set();
  state->kernels = &block_kernels(state->instructions);
  state->cpu = std::make_unique<Cpu>(scene.threads);
  return state;
}

int attribute(cudaDeviceAttr which) {
  int value = 0;
  check_cuda(cudaDeviceGetAttribute(&value, which, 0), "be asked");
  return value;
}

}  // namespace

CudaMpmTissue::CudaMpmTissue(const Scene& scene, std::vector<std::string> notes)
    : notes_(std::move(notes)), device_(std::make_unique<OnDevice>()) {
  OnDevice& d = *device_;
  d.gpu = open_gpu(d.stream);
  if (const int count = collider_count(scene); count > kMaxColliders) {
    throw std::runtime_error("the scene's tools have " + std::to_string(count - 1) +
                             " parts that touch tissue (a grasper two, other tools one): on the "
                             "GPU at most " +
                             std::to_string(kMaxColliders - 1) + "; set device to cpu");
  }
  d.limits = {attribute(cudaDevAttrMultiProcessorCount),
              static_cast<std::size_t>(attribute(cudaDevAttrMaxSharedMemoryPerBlockOptin))};
  state_ = make_state(scene, &notes_);
  d.cut_shape = choose_shape(state_->bodies, d.limits, false);
  // What touches other tissue keeps its blocks, which know the contacts.
  make_blocks(
      state_->bodies.size() == 1 ? choose_shape(state_->bodies, d.limits, true) : d.cut_shape,
      d.limits.processors);
  for (std::int32_t p = 0; p < state_->points.size(); ++p) {
    if (!(state_->points.free_volume_of(p) > 0)) d.anchors.held_points.push_back(p);
  }
  pieces_ = whole_pieces(*state_);
  foresight_ = make_foresight(scene);
  push();
  launch_measure();
  finish_measure();
  if (!state_->points.gaps.empty()) {
    take_apart(break_gaps(*state_));
    pieces_ = whole_pieces(*state_);
    launch_measure();
    finish_measure();
  }
  if (scene.mpm.boundary == MpmBoundary::kSurface && d.held_by > 0) {
    d.outer.upload(outer_points(*state_, state_->anchors), d.stream);
    if (d.place_parts > 1) d.planes.upload(surface_planes(*state_), d.stream);
  }
  substep_.follow(*state_, modulus_);
}

CudaMpmTissue::~CudaMpmTissue() {
  if (device_->stream != nullptr) cudaStreamSynchronize(device_->stream);
}

void CudaMpmTissue::upload_colliders() {
  OnDevice& d = *device_;
  const std::vector<Box> reach = colliders_->reach();
  d.host_reach.resize(reach.size());
  for (std::size_t c = 0; c < reach.size(); ++c) {
    for (int a = 0; a < 3; ++a) {
      d.host_reach[c].min[a] = static_cast<float>(reach[c].min[a]);
      d.host_reach[c].max[a] = static_cast<float>(reach[c].max[a]);
    }
  }
  d.host_colliders.resize(reach.size() * substeps_);
  for (int i = 0; i < substeps_; ++i) {
    colliders_->at(share_of(i), d.host_colliders.data() + i * reach.size());
  }
  d.reach.upload(d.host_reach, d.stream);
  d.colliders.upload(d.host_colliders, d.stream);
  d.loads.resize(kLoadSums * d.host_colliders.size());
  d.loads.clear(d.stream);
}

void CudaMpmTissue::begin_frame(double duration, const FrameInput& input) {
  follow(input, state_->scene);
  begin_anchors(input);
  input_ = input;
  result_ = {};
  result_.loads.resize(state_->scene.tools.size());
  for (const BladePath& path : input.cuts) {
    result_.cut_reports.emplace_back();
    cut({path}, nullptr, result_.cut_reports.back());
  }
  duration_ = duration;
  colliders_.emplace(state_->scene, input, duration);
  blades_ = blade_paths(state_->scene, input, 0, 1);
  cut_to_ = 0;
  motion_before_ = state_->motion;
  keep_place_for_blades();
}

int CudaMpmTissue::run(const FramePart& part) {
  OnDevice& d = *device_;
  const int substeps = substeps_ = part.substeps.count;
  part_ = part;
  before_ = state_->dt;
  tearing_.clear();
  result_.substep = std::max<double>(result_.substep, part.substeps.longest());
  if (substeps == 0) return 0;
  upload_colliders();
  upload_anchor_places();
  find_near();
  const bool tears = can_tear(*state_);
  const int checks = tears ? tear_checks(*state_, substeps, part.substeps.longest()) : 1;
  int done = 0;
  for (int check = 0; done < substeps && tearing_.empty(); ++check) {
    const int end = tear_check_at(check, checks, substeps);
    run_substeps(done, end);
    done = end;
    if (tears) tearing_ = find_tearing();
  }
  substeps_ = done;
  leave_anchors(done);
  result_.substeps += done;
  d.host_loads.resize(d.loads.size());
  d.loads.download(d.host_loads.data(), d.loads.size(), d.stream);
  return done;
}

void CudaMpmTissue::sum_loads() {
  const OnDevice& d = *device_;
  work_ = 0;
  if (substeps_ == 0) return;
  const std::size_t count = colliders_->count();
  std::vector<ColliderLoad> on(count);
  for (int i = 0; i < substeps_; ++i) {
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
    const float acted = kick_of(i == 0 ? before_ : part_.substeps.at(i - 1), part_.substeps.at(i));
    colliders_->add_loads(share_of(i), d.host_colliders.data() + i * count, on.data(),
                          acted / duration_, result_.loads);
    work_ += colliders_->power(d.host_colliders.data() + i * count, on.data()) * acted;
  }
  substeps_ = 0;
}

void CudaMpmTissue::advance(int substeps, float dt, const FrameInput& input) {
  begin_frame(static_cast<double>(substeps) * dt, input);
  for (int done = 0; done < substeps;) {
    done += run({even_substeps(substeps - done, dt), static_cast<double>(done) / substeps, 1});
    if (done == substeps && tearing_.empty()) break;  // all may be under way
    check_cuda(cudaStreamSynchronize(device_->stream), "advance");
    sum_loads();
    tear(static_cast<double>(done) / substeps);
  }
  search_ahead();
  launch_measure();
  finish_measure();
  sum_loads();
  if (!result_.blew_up) end_frame();
}

void CudaMpmTissue::launch(int begin, int end, float dt) {
  OnDevice& d = *device_;
  measured_ = false;
  const Scene& scene = state_->scene;
  const std::size_t collider_count = d.host_reach.size();
  CudaFrame frame;
  for (int i = 0; i < 2; ++i) {
    frame.state[i] = d.nodes(i);
    frame.force[i] = d.force[i].data();
  }
  frame.current = d.current;
  frame.substeps = end - begin;
  frame.step.dt = dt;
  frame.step.kick = kick_of(state_->dt, dt);
  const float before = state_->dt / dt;
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
  frame.faces = faces_of_launch();
  frame.held_faces = d.anchors.view(begin, static_cast<int>(state_->anchors.origin.size()));
  frame.held_faces.drift = face_drift(dt);
  frame.held_faces.swing_loss = kSwingLoss;
  frame.front = d.front.view();
  if (frame.faces != nullptr || d.may_meet || has_front()) {
    frame.pushes = clear_pushes();
    const CudaTables tables = d.pushed_tables();
    if (has_front() || meets_thin_tools()) {
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
  state_->time += static_cast<double>(end - begin) * dt;
  state_->dt = dt;
}

bool CudaMpmTissue::meets_thin_tools() const {
  return device_->may_meet && device_->place_parts > 1;
}

FrameResult CudaMpmTissue::finish() {
  pieces_measured_ = false;
  substep_.follow(*state_, modulus_);
  tame();
  result_.blew_up = result_.blew_up || is_out_of_control(result_);
  if (foresight_.network != nullptr && !result_.blew_up) foresee();
  measured_ = false;
  return result_;
}

Span<const Fragment> CudaMpmTissue::fragments() {
  if (!pieces_measured_) {
    pull_nodes();
    measure_pieces(*state_, pieces_);
    pieces_measured_ = true;
  }
  return pieces_.all;
}

std::uint64_t CudaMpmTissue::checksum() {
  pull_nodes();
  return tissue_sim::checksum(*state_, pieces_);
}

Momentum CudaMpmTissue::momentum() {
  pull_nodes();
  return tissue_sim::momentum(*state_);
}

std::string CudaMpmTissue::device_name() const { return "cuda (" + device_->gpu + ")"; }

std::string CudaMpmTissue::plan() const {
  const OnDevice& d = *device_;
  const BlockShape& b = d.shape.blocks;
  return std::to_string(b.x) + " x " + std::to_string(b.y) + " x " + std::to_string(b.z) +
         " cells, " + std::to_string(d.plan.threads) + " a block, " +
         std::to_string(d.blocks.size()) + " blocks in " + std::to_string(d.bundles.size()) +
         " bundles, " + std::to_string(d.resident) + " at once" + (d.plan.cached ? ", cached" : "");
}

}  // namespace tissue_sim

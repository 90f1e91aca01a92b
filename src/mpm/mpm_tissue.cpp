#include "mpm/mpm_tissue.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "frame/out_of_control.h"
#include "mpm/cut_tissue.h"
#include "mpm/mpm_fields.h"
#include "mpm/state_figures.h"

namespace tissue_sim {

MpmTissue::MpmTissue(const Scene& scene, std::vector<std::string> notes, MakeMpmDevice make_device)
    : notes_(std::move(notes)),
      run_(std::make_unique<MpmRun>()),
      device_(make_device(scene, *run_)) {
  MpmState& s = run_->state;
  make_mpm_state(scene, device_->node_range(), s, &notes_);
  device_->begin();
  if (!s.points.gaps.empty()) {
    measured(device_->measure(kMeasureMotion));
    take_apart(break_gaps(s));
  }
  run_->pieces = whole_pieces(s);
  measured(device_->measure(kMeasureMotion | kMeasureStiffness));
  device_->begun();
  foresight_ = make_foresight(scene);
  follow();
  measured_ = followed_ = false;  // who holds the state may change it
}

float MpmTissue::stable_substep() const {
  return tissue_sim::stable_substep(run_->state, run_->stiffening);
}

float MpmTissue::substep_for(const FrameInput& input, const FrameColliders& colliders) {
  const auto measure = [this](const std::vector<std::uint8_t>& blocks, int steps) {
    return device_->measure_limit(blocks, steps);
  };
  return static_cast<float>(
      substep_.longest(run_->state, input, colliders, run_->stiffening, measure));
}

void MpmTissue::measured(unsigned what) {
  if ((what & kMeasureStiffness) == 0) return;
  measured_ = true;
  has_energies_ = (what & kMeasureEnergies) != 0;
}

void MpmTissue::follow() {
  substep_.follow(run_->state, run_->modulus);
  followed_ = true;
}

FrameResult MpmTissue::finish() {
  MpmState& s = run_->state;
  FrameResult& result = run_->result;
  const auto measure_and_follow = [this](unsigned what) {
    measured(device_->measure(what));
    follow();
  };
  if (!measured_ || !has_energies_) measured(device_->measure(kMeasureEnergies));
  if (!followed_) follow();
  result.max_speed = 0;
  for (const BlockMotion& m : s.motion) {
    if (!(m.speed <= result.max_speed)) result.max_speed = m.speed;
  }
  result.blew_up = result.blew_up || is_out_of_control(result);
  if (tame()) measure_and_follow(kMeasureEnergies);
  if (foresight_.network != nullptr && !result.blew_up) {
    look_ahead(s, run_->pieces, device_->strained(), foresight_, result);
  }
  measured_ = followed_ = pieces_measured_ = false;
  return result;
}

void MpmTissue::read_surface(SurfaceTriangles& surface) {
  MpmState& s = run_->state;
  BoundaryMesh& mesh = s.boundary;
  update_boundary(s, mesh);
  device_->place_boundary();
  if (surface.made != 0 && surface.made == mesh.shown) {
    move_faces(mesh.faces, mesh.now, *s.cpu, surface);
    return;
  }
  const auto rest = [&mesh](std::int32_t v) { return floats(mesh.vertices[v].rest); };
  put_faces(mesh.faces, mesh.now, rest, run_->pieces.of_point, *s.cpu, surface);
  mesh.shown = surface.made;
}

void MpmTissue::push_surface(Span<const float> impulses) {
  tissue_sim::push_surface(run_->state, impulses);
  pushed();
}

GpuSurface MpmTissue::surface_on_gpu(const SurfaceTriangles& read) {
  BoundaryMesh& mesh = run_->state.boundary;
  update_boundary(run_->state, mesh);
  if (read.made == 0 || read.made != mesh.shown) return {};
  return device_->place_boundary_on_gpu();
}

void MpmTissue::push_surface_on_gpu(const float* impulses) {
  find_support(run_->state, run_->state.boundary);
  device_->push_boundary_on_gpu(impulses);
  pushed();
}

void MpmTissue::pushed() {
  has_energies_ = false;
  substep_.acceptance().begin_with(NAN);
}

Span<const Fragment> MpmTissue::fragments() {
  if (!pieces_measured_) {
    device_->bring_all_nodes();
    measure_pieces(run_->state, run_->pieces);
  }
  pieces_measured_ = true;
  return run_->pieces.all;
}

std::uint64_t MpmTissue::checksum() {
  device_->bring_all_nodes();
  return tissue_sim::checksum(run_->state, run_->pieces);
}

Momentum MpmTissue::momentum() {
  device_->bring_all_nodes();
  return tissue_sim::momentum(run_->state);
}

template <class Archive>
void MpmTissue::each_field(Archive& archive) {
  tissue_fields(archive, run_->state);
  if constexpr (Archive::kReads) {
    device_->restore(archive);
  } else {
    device_->save(archive);
  }
  archive.part("pieces", run_->pieces, pieces_measured_);
  archive.part("substeps", run_->stiffening, run_->modulus, substep_);
  archive.part("measures", measured_, has_energies_, run_->work);
}

std::vector<std::uint8_t> MpmTissue::save() {
  device_->bring_all_nodes();
  ArchiveWriter out;
  each_field(out);
  return out.take();
}

namespace {

/// What a state that was read says beside MpmState.
void check_figures(const MpmRun& run, bool measured) {
  const MpmState& s = run.state;
  check_sizes("stiffening", s.bodies, run.stiffening);
  for (std::size_t i = 0; i < s.bodies.size(); ++i) {
    check_state(run.stiffening[i].size() == s.bodies[i].materials.size() + 1, "stiffening");
  }
  check_state(!measured || run.modulus.size() == s.blocks.all.size(), "stiffness");
}

}  // namespace

void MpmTissue::restore(Span<const std::uint8_t> saved) {
  ArchiveReader in(saved);
  each_field(in);
  if (in.left() > 0) throw std::runtime_error("the state has more to it than this version knows");
  followed_ = measured_;
  check_pieces(run_->pieces, state().points.site.size(), state().scene.bodies.size());
  check_figures(*run_, measured_);
  device_->restored();
}

}  // namespace tissue_sim

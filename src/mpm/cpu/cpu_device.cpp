#include "mpm/cpu/cpu_device.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "cutting/edge_pushes.h"
#include "fragments/piece_colour.h"
#include "frame/leapfrog.h"
#include "frame/select_points.h"
#include "math/lanczos.h"
#include "mpm/contact/block_contact.h"
#include "mpm/contact/touching_tissue.h"
#include "mpm/cut_tissue.h"
#include "mpm/lattice/bonds.h"
#include "mpm/linearised_motion.h"
#include "mpm/mpm_fields.h"
#include "mpm/state_figures.h"
#include "mpm/surface/surface_places.h"

namespace tissue_sim {

std::unique_ptr<MpmDevice> make_cpu_mpm_device(const Scene&, MpmRun& run) {
  return std::make_unique<CpuMpmDevice>(run);
}

std::string CpuMpmDevice::name() const {
  return std::string("cpu (") + tissue_sim::name(state_.instructions) + ", " +
         std::to_string(state_.cpu->threads()) + " threads)";
}

void CpuMpmDevice::begin() {
  MpmState& s = state_;
  s.points.outer = find_outer_places(s);
  s.blocks = make_blocks(s, {}, *s.cpu);
  s.work.force.resize(s.blocks.force_size);
  forget_near(s.contacts, s.blocks.all.size());
  list_facets(s);
  index_inertia(s);
  s.edges = resisting_edges(s.scene);
}

void CpuMpmDevice::measure_blocks(bool energies) {
  MpmState& s = state_;
  FrameResult& result = run_.result;
  const int count = static_cast<int>(s.blocks.all.size());
  std::vector<BlockState> states(count);
  s.cpu->for_each(count, [&](int i) {
    const Block& block = *s.blocks.all[i];
    const BlockField field = block_field(s, block);
    BlockScratch& scratch = s.scratch.local();
    states[i] = energies ? s.kernels->state(block, field, scratch, nullptr)
                         : s.kernels->stiffness(block, field, scratch);
  });
  run_.stiffening = even_stiffening(s, 1);
  run_.modulus.assign(count, 0.0f);
  s.worst_stiffening = 1;
  result.elastic_energy = 0;
  for (int i = 0; i < count; ++i) {
    const BlockState& b = states[i];
    result.elastic_energy += b.elastic_energy;
    s.worst_stiffening = std::max(s.worst_stiffening, b.worst_stiffening);
    result.blew_up = result.blew_up || !b.finite;
    std::vector<float>& of_body = run_.stiffening[s.blocks.all[i]->body];
    for (std::size_t m = 0; m < of_body.size(); ++m) {
      const float stiffening = b.finite ? b.stiffening[m] : std::numeric_limits<float>::infinity();
      of_body[m] = std::max(of_body[m], stiffening);
      if (m + 1 == of_body.size()) break;  // that is no material's
      result.blew_up = result.blew_up || of_body[m] > 1e6f;
      const Material& material = s.bodies[s.blocks.all[i]->body].materials[m];
      float& modulus = run_.modulus[i];
      modulus = std::max(modulus, static_cast<float>(wave_modulus(material, stiffening)));
    }
  }
  if (!energies) return;
  const Nodes& n = s.nodes;
  result.kinetic_energy = 0;
  for (std::size_t i = 0; i < n.size(); ++i) {
    const double v2 = Vec3(n.v[0][i], n.v[1][i], n.v[2][i]).squaredNorm();
    result.kinetic_energy += 0.5 * n.mass[i] * v2;
  }
  result.kinetic_energy += front_kinetic_energy(s.front);
  result.elastic_energy += front_elastic_energy(s);
}

unsigned CpuMpmDevice::measure(unsigned what) {
  if ((what & kMeasureMotion) != 0) measure_motion(state_);
  const bool energies = (what & kMeasureEnergies) != 0;
  if (energies || (what & kMeasureStiffness) != 0) measure_blocks(energies);
  return energies ? what | kMeasureStiffness : what;
}

double CpuMpmDevice::measure_limit(const std::vector<std::uint8_t>& blocks, int steps) {
  LinearisedMotion motion(state_, blocks);
  return 2 / std::sqrt(largest_eigenvalue(motion, steps));
}

void CpuMpmDevice::begin_rest() {
  const MpmFrame& frame = *run_.frame;
  find_near_colliders(state_, frame.colliders.reach(), frame.duration);
  look_for_edges(state_, frame.input, frame.cut_to);
  for (int a = 0; frame.blades && a < 3; ++a) state_.work.u_before[a] = state_.nodes.u[a];
}

void CpuMpmDevice::save_motion() {
  saved_.motion = motion_of(state_);
  saved_.faces = state_.faces;
  saved_.of_blocks = state_.motion;
}

void CpuMpmDevice::restore_motion(bool missed) {
  MpmState& s = state_;
  for (const InertialNode& n : s.contacts.inertia.nodes) s.inertial_index[n.node] = -1;
  motion_of(s) = saved_.motion;
  index_inertia(s);
  s.faces = saved_.faces;
  if (!missed) return;
  again_ = true;
  // From where blocks went, whose motion still stands, and from where they began.
  find_near_colliders(s, run_.frame->colliders.reach(), run_.frame->duration, saved_.of_blocks);
}

int CpuMpmDevice::run_part(const FramePart& part) {
  MpmState& s = state_;
  MpmFrame& frame = *run_.frame;
  const PartSubsteps& substeps = part.substeps;
  const int checks = can_tear(s) ? tear_checks(s, substeps.count, substeps.longest()) : 0;
  run_.work = 0;
  frame.tearing.clear();
  const std::unique_ptr<EdgePushes> edges = edge_pushes(s);
  int done = 0;
  for (int check = 0; done < substeps.count && frame.tearing.empty(); ++done) {
    stop_if_asked();
    const double share = substeps.share(done + 1, part.from, part.to);
    const float dt = substeps.at(done);
    frame.colliders.at(share, s.colliders);
    std::vector<ColliderLoad> loads(s.colliders.size());
    find_face_contacts(s, run_.pieces, dt);
    if (edges) run_.result.cutting_work += edges->push(dt, kick_of(s.dt, dt), loads);
    const float acted = substep(s, dt, loads, anchors_at(s.anchors, frame.input, share));
    s.time += dt;
    frame.colliders.add_loads(share, s.colliders.data(), loads.data(), acted / frame.duration,
                              run_.result.loads);
    run_.work += frame.colliders.power(s.colliders.data(), loads.data()) * acted;
    if (checks == 0 || done + 1 != tear_check_at(check, checks, substeps.count)) continue;
    ++check;
    frame.tearing = tearing_of(s, s, find_stretched(s, tear_share(s, s)));
  }
  if (edges) edges->end();
  return done;
}

bool CpuMpmDevice::missed_contact() {
  measure_motion(state_);
  return !std::exchange(again_, false) &&
         tissue_sim::missed_contact(state_, run_.frame->colliders.reach());
}

void CpuMpmDevice::settled(const std::vector<std::int32_t>& points) {
  begin_anew(state_.contacts, points);
}

void CpuMpmDevice::sweep(const std::vector<BladePath>& paths, bool moves,
                         std::vector<std::int32_t>& changed, std::vector<std::int32_t>& touched,
                         CutReport& report) {
  MpmState& s = state_;
  const Array<float>* const u_before = moves ? s.work.u_before : s.nodes.u;
  const std::vector<BlockMotion>& before = moves ? run_.frame->before : s.motion;
  for (const BladePath& path : paths) {
    sweep_bonds(s, path, u_before, s.nodes.u, before, changed, touched, report);
  }
}

std::vector<int> CpuMpmDevice::label_pieces() { return update_pieces(state_, run_.pieces); }

std::vector<StrainedPoint> CpuMpmDevice::strained() {
  return find_strained(state_, kRegionLevels[0]);
}

void CpuMpmDevice::save(ArchiveWriter& archive) { archive.part("faces", state_.faces); }

void CpuMpmDevice::restore(ArchiveReader& archive) { archive.part("faces", state_.faces); }

void CpuMpmDevice::restored() { complete_state(state_); }

int CpuMpmDevice::read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) {
  MpmState& s = state_;
  const std::vector<const Fragment*> piece = pieces_by_id(run_.pieces);
  int count = 0;
  const std::vector<std::int32_t> index = select_points(
      selection, run_.pieces, [&](std::int32_t p) { return s.points.bonds[p] != kAllBonds; },
      count);
  cloud.resize(static_cast<std::size_t>(count) * sizeof(Point));
  s.cpu->for_each(static_cast<int>(s.blocks.all.size()), [&](int i) {
    const Block& block = *s.blocks.all[i];
    const auto wanted = [&index](std::int32_t p) { return p >= 0 && index[p] >= 0; };
    if (std::none_of(block.point.begin(), block.point.end(), wanted)) return;
    const LatticeBody& body = s.bodies[block.body];
    BlockScratch& scratch = s.scratch.local();
    const std::size_t lanes = block.lane_count();
    if (scratch.values.size() < 4 * lanes) scratch.values.resize(4 * lanes);
    float* x = scratch.values.data();
    float* stress = x + 3 * lanes;
    const BlockField field = block_field(s, block);
    s.kernels->positions(block, field, s.nodes.u, scratch, x);
    s.kernels->state(block, field, scratch, stress);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const std::int32_t p = block.point[lane];
      if (!wanted(p)) continue;
      const Fragment& f = *piece[run_.pieces.of_point[p]];
      Point out;
      out.x = x[lane];
      out.y = x[lanes + lane];
      out.z = x[2 * lanes + lane];
      Vec3 held;
      if (held_place(s, p, held)) {
        out.x = static_cast<float>(held[0]);
        out.y = static_cast<float>(held[1]);
        out.z = static_cast<float>(held[2]);
      }
      out.rgb = piece_colour(f);
      out.id = static_cast<std::uint32_t>(p);
      out.fragment = f.id;
      // What an anchor holds has none.
      out.stress = s.points.free_volume_of(p) > 0 ? stress[lane] : 0;
      const int whole = __builtin_popcount(whole_bonds(body, s.points, p));
      const int left = __builtin_popcount(s.points.bonds[p]);
      out.damage = whole > 0 ? 1.0f - static_cast<float>(left) / whole : 0.0f;
      std::memcpy(cloud.data() + static_cast<std::size_t>(index[p]) * sizeof(Point), &out,
                  sizeof(Point));
    }
  });
  add_point_fields(s, selection, index, count, cloud);
  return count;
}

void CpuMpmDevice::place_boundary() { tissue_sim::place_boundary(state_); }

}  // namespace tissue_sim

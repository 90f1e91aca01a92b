#include "mls/tissue.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "fragments/find_parted.h"
#include "fragments/piece_colour.h"
#include "fragments/piece_sums.h"
#include "frame/checksum.h"
#include "frame/leapfrog.h"
#include "frame/out_of_control.h"
#include "frame/point_fields.h"
#include "frame/put_faces.h"
#include "frame/select_points.h"
#include "mls/crossing.h"
#include "mls/cut.h"
#include "mls/cutting_edges.h"
#include "mls/linearised_motion.h"
#include "mls/node_contact.h"
#include "mls/tear.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

constexpr int kLanczosSteps = 8;  // of all nodes, where some are new, too: a step costs the same

}  // namespace

MlsTissue::MlsTissue(const Scene& scene, std::vector<std::string> notes)
    : notes_(std::move(notes)), state_(make_mls_state(scene, &notes_)), substeps_(*state_) {
  const MlsNodes& nodes = state_->nodes;
  const PiecePoints points{nodes.count(), [&](std::int32_t i) { return nodes.body[i]; },
                           nodes.volume.data(), nodes.anchored.data()};
  pieces_ = one_piece_a_body(static_cast<int>(scene.bodies.size()), points);
  std::vector<std::int32_t> all(nodes.count());
  for (std::int32_t i = 0; i < nodes.count(); ++i) all[i] = i;
  CutReport ignored;
  part(all, ignored);  // a mesh may have parts that do not touch
  may_touch_ = pieces_.all.size() > 1;
  stiffening_.assign(state_->chunks() * kMlsChunk, 1.0f);
  for (const Material& m : nodes.materials) {
    if (m.tear_stretch == 0 || m.tear_length == 0) continue;
    notes_.push_back("material '" + m.name +
                     "': tear_length does nothing, a tip bears what its pairs of nodes do");
  }
}

void MlsTissue::part(const std::vector<std::int32_t>& changed, CutReport& report) {
  const MlsPairs& p = state_->pairs;
  // Where a pair keeps some weight there is a way around the cut.
  const bool may_have = std::any_of(changed.begin(), changed.end(), [&](std::int32_t i) {
    for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
      if (p.crossed[e] != 0 && p.weight[e] == 0) return true;
    }
    return p.begin[i] == p.begin[i + 1] || changed.size() == state_->nodes.place.size();
  });
  if (!may_have) return;
  UnionFind linked = join_uncrossed(*state_);
  part(find_parted(pieces_, linked), report);
}

void MlsTissue::part(const std::vector<PartedRun>& parted, CutReport& report) {
  for (const int id : part_pieces(state_->nodes.volume.data(), parted, pieces_)) {
    report.new_fragments.push_back(id);
  }
}

void MlsTissue::break_pairs(const std::vector<std::int32_t>& entries,
                            const std::vector<float>& places, CutReport& report) {
  // Of so many pairs some have surely lost all: pieces are looked for meanwhile.
  constexpr std::size_t kMany = 1000;
  MlsState& s = *state_;
  const std::vector<std::int32_t> changed = mark_crossed(s, entries, places, report);
  if (changed.empty()) return;
  std::optional<std::vector<PartedRun>> parted;
  std::vector<std::int32_t> remade;
  s.cpu->both([&] { remade = weaken(s, changed); },
              [&] {
                if (changed.size() <= kMany) return;
                UnionFind linked = join_uncrossed(s);
                parted = find_parted(pieces_, linked);
              });
  remade.insert(remade.end(), changed.begin(), changed.end());
  pairs_changed(remade);
  forget(changed);
  if (parted) {
    part(*parted, report);
  } else {
    part(changed, report);
  }
}

void MlsTissue::cut(const BladePath& path, const float* u_begin, CutReport& report) {
  pull();
  std::vector<float> places;
  const std::vector<std::int32_t> crossed =
      find_crossed(*state_, path, u_begin, state_->u.data(), &places);
  break_pairs(crossed, places, report);
}

void MlsTissue::forget(const std::vector<std::int32_t>& changed) {
  substeps_.cut(*state_, changed);
  pieces_measured_ = false;
  may_touch_ = true;
  search_node_contacts(*state_);
}

CutReport MlsTissue::cut_now(const BladePath& path) {
  CutReport report;
  cut(path, state_->u.data(), report);
  return report;
}

void MlsTissue::begin_frame(double duration, const FrameInput& input, FrameColliders colliders) {
  follow(input, state_->scene);
  MlsState& s = *state_;
  result_ = {};
  result_.loads.resize(s.scene.tools.size());
  for (const BladePath& path : input.cuts) {
    result_.cut_reports.emplace_back();
    cut(path, s.u.data(), result_.cut_reports.back());
  }
  const bool blades = may_cut(s.scene, s.edges, input);
  if (blades) pull();
  look_for_edges(s, input, 0);
  frame_.emplace(Frame{input, duration, std::move(colliders), blades ? s.u : Array<float>(), 0});
  s.until_list = 0;
  std::fill(s.held_impulse.begin(), s.held_impulse.end(), 0.0f);
}

void MlsTissue::end_frame() {
  MlsState& s = *state_;
  if (s.held_impulse.empty()) return;
  pull();
  pull_held();
  result_.anchor_loads = mls_anchor_loads(s.scene, frame_->input, s.nodes, s.u.data(),
                                          s.held_impulse.data(), frame_->duration);
}

PartSubsteps MlsTissue::choose_substeps(const FrameInput&, double time) {
  const MlsForces forces = [this](const float* u, float* force) { forces_at(u, force, 0); };
  return substeps_.part(*state_, time, [&](const std::vector<std::uint8_t>&, int) {
    pull();
    return measured_limit(*state_, forces, kLanczosSteps);
  });
}

void MlsTissue::save_checkpoint() {
  const MlsState& s = *state_;
  checkpoint_.u = s.u;
  checkpoint_.v = s.v;
  checkpoint_.held_impulse = s.held_impulse;
  checkpoint_.contact = s.contact;
  checkpoint_.node_contacts = s.node_contacts;
  checkpoint_.edges = s.edges.holds;
  checkpoint_.dt = s.dt;
  checkpoint_.time = s.time;
  checkpoint_.until_list = s.until_list;
  checkpoint_.result = result_;
}

int MlsTissue::run_part(const FramePart& part) {
  MlsState& s = *state_;
  const Frame& frame = *frame_;
  const std::unique_ptr<EdgePushes> edges = edge_pushes(s);
  for (int i = 0; i < part.substeps.count; ++i) {
    stop_if_asked();
    const double share = part.substeps.share(i + 1, part.from, part.to);
    frame.colliders.at(share, s.colliders);
    s.anchors = mls_anchors_at(s.scene, frame.input, share);
    std::vector<ColliderLoad> loads(s.colliders.size());
    if (may_touch_) {
      double fastest = 0;
      for (const Collider& c : s.colliders) fastest = std::max(fastest, speed(c));
      update_node_contacts(s, pieces_.of_point, part.substeps.at(i), fastest);
    }
    const float dt = part.substeps.at(i);
    if (edges) result_.cutting_work += edges->push(dt, kick_of(s.dt, dt), loads);
    const float acted = substep(s, dt, loads);
    frame.colliders.add_loads(share, s.colliders.data(), loads.data(), acted / frame.duration,
                              result_.loads);
  }
  if (edges) edges->end();
  return part.substeps.count;
}

Verdict MlsTissue::judge_part(const FramePart& part) {
  result_.substep = std::max<double>(result_.substep, part.substeps.longest());
  result_.substeps += part.done;
  const Figures figures = measure();
  if (!substeps_.is_borne(*state_, stiffening_, figures.stretch2, part.substeps.longest())) {
    return Verdict::kTooLong;
  }
  result_.blew_up = !figures.finite;
  return Verdict::kAccepted;
}

void MlsTissue::reject_part(Verdict) {
  MlsState& s = *state_;
  s.u = checkpoint_.u;
  s.v = checkpoint_.v;
  s.held_impulse = checkpoint_.held_impulse;
  s.contact = checkpoint_.contact;
  s.node_contacts = checkpoint_.node_contacts;
  s.edges.holds = checkpoint_.edges;
  s.dt = checkpoint_.dt;
  s.time = checkpoint_.time;
  s.until_list = checkpoint_.until_list;
  result_ = checkpoint_.result;
}

void MlsTissue::break_bonds(double share) {
  MlsState& s = *state_;
  Frame& frame = *frame_;
  if (can_tear(s)) pull();
  const std::vector<std::int32_t> tearing =
      can_tear(s) ? find_tearing(s) : std::vector<std::int32_t>();
  if (!frame.u_before.empty() && (share == 1 || !tearing.empty())) {
    const auto free = free_paths(s.scene, s.edges, frame.input, frame.cut_to, share);
    const auto held = held_paths(s, frame.input, share);
    for (const BladePath& path : free) cut(path, frame.u_before.data(), result_.blade_report);
    for (const BladePath& path : held) cut(path, s.u.data(), result_.blade_report);
    frame.u_before = s.u;
    frame.cut_to = share;
  }
  if (tearing.empty()) return;
  std::vector<int>& torn_off = result_.tear_report.new_fragments;
  const std::size_t before = torn_off.size();
  break_pairs(tearing, {}, result_.tear_report);
  if (slow_torn_bits(s, pieces_.of_point, {torn_off.begin() + before, torn_off.end()})) {
    push_velocities();
  }
  if (share < 1) look_for_edges(s, frame.input, share);
}

MlsTissue::Figures MlsTissue::measure() {
  MlsState& s = *state_;
  const MlsField field = field_of(s);
  std::vector<MlsMeasure> of(s.chunks());
  s.cpu->for_each(
      s.chunks(),
      [&](int chunk) {
        of[chunk] = s.kernels->measure(field, chunk, nullptr, &stiffening_[chunk * kMlsChunk]);
      },
      4);
  Figures sum;
  for (const MlsMeasure& m : of) {
    sum.elastic += m.elastic;
    sum.stretch2 = std::max(sum.stretch2, m.stretch2);
    sum.finite = sum.finite && m.finite;
  }
  double fastest2 = 0;
  for (int i = 0; i < s.count(); ++i) {
    const double v2 = s.velocity(i).squaredNorm();
    sum.kinetic += 0.5 * s.mass[i] * v2;
    if (!(v2 <= fastest2)) fastest2 = v2;
  }
  sum.speed = std::sqrt(fastest2);
  return sum;
}

void MlsTissue::measure_stress(std::vector<float>& of_node) {
  MlsState& s = *state_;
  const MlsField field = field_of(s);
  of_node.resize(static_cast<std::size_t>(s.chunks()) * kMlsChunk);
  state_->cpu->for_each(
      s.chunks(),
      [&](int chunk) { s.kernels->measure(field, chunk, &of_node[chunk * kMlsChunk], nullptr); },
      4);
}

void MlsTissue::forces_at(const float* u, float* force, float rest) {
  internal_forces(*state_, u, force, rest);
}

FrameResult MlsTissue::finish() {
  const Figures figures = measure();
  result_.elastic_energy = figures.elastic;
  result_.kinetic_energy = figures.kinetic;
  result_.max_speed = figures.speed;
  pieces_measured_ = false;
  result_.blew_up = result_.blew_up || !figures.finite || is_out_of_control(result_);
  return result_;
}

int MlsTissue::read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) {
  check_fields(selection, point_fields());
  const MlsState& s = *state_;
  const std::vector<const Fragment*> piece = pieces_by_id(pieces_);
  int count = 0;
  const std::vector<std::int32_t> place = select_points(
      selection, pieces_, [&](std::int32_t i) { return s.outer[i] != 0; }, count);
  cloud.resize(static_cast<std::size_t>(count) * sizeof(Point));
  pull();
  std::vector<float> mises;
  measure_stress(mises);
  state_->cpu->for_each(
      s.chunks(),
      [&](int chunk) {
        const int first = chunk * kMlsChunk, last = std::min(s.count(), first + kMlsChunk);
        for (int i = first; i < last; ++i) {
          if (place[i] < 0) continue;
          const Fragment& f = *piece[pieces_.of_point[i]];
          const Vec3 x = s.position(i);
          int crossed = 0;
          for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
            crossed += s.pairs.crossed[e] != 0 ? 1 : 0;
          }
          Point out;
          out.x = static_cast<float>(x[0]);
          out.y = static_cast<float>(x[1]);
          out.z = static_cast<float>(x[2]);
          out.rgb = piece_colour(f);
          out.id = static_cast<std::uint32_t>(i);
          out.fragment = f.id;
          out.stress = mises[i] * static_cast<float>(lame_mu(s.nodes.material_of(i)));
          const int pairs = s.pairs.begin[i + 1] - s.pairs.begin[i];
          out.damage = pairs > 0 ? static_cast<float>(crossed) / pairs : 0.0f;
          std::memcpy(cloud.data() + static_cast<std::size_t>(place[i]) * sizeof(Point), &out,
                      sizeof(Point));
        }
      },
      4);
  add_fields(selection, place, count, *state_->cpu, cloud, [&s](int i) {
    return tissue_sim::point_fields(s.nodes.place[i], s.position(i), s.velocity(i),
                                    s.nodes.volume[i]);
  });
  return count;
}

void MlsTissue::read_surface(SurfaceTriangles& surface) {
  pull();
  tissue_sim::read_surface(*state_, pieces_.of_point, surface_, surface);
}

void MlsTissue::push_surface(Span<const float> impulses) {
  MlsState& s = *state_;
  for_pushed_vertices(surface_.faces, surface_.vertices.size(), impulses,
                      [&](int i, const float* impulse) {
                        const MlsSurface::Vertex& v = surface_.vertices[i];
                        for (int k = 0; k < 8; ++k) {
                          const std::int32_t n = v.node[k];
                          for (int a = 0; a < 3 && v.weight[k] > 0; ++a) {
                            s.v[4 * n + a] += v.weight[k] * s.inv_mass[n] * impulse[a];
                          }
                        }
                      });
}

Span<const Fragment> MlsTissue::fragments() {
  if (!pieces_measured_) {
    pull();
    const MlsState& s = *state_;
    std::vector<SumsByPiece> of_group(s.groups());
    state_->cpu->for_each(
        s.groups(),
        [&](int group) {
          const int first = group * kMlsGroup, last = std::min(s.count(), first + kMlsGroup);
          for (int i = first; i < last; ++i) {
            of_group[group]
                .of(pieces_.of_point[i])
                .add(s.nodes.volume[i], s.position(i), s.velocity(i));
          }
        },
        4);
    set_motion(of_group, pieces_);
  }
  pieces_measured_ = true;
  return pieces_.all;
}

std::uint64_t MlsTissue::checksum() {
  pull();
  Checksum sum;
  sum.add(state_->u);
  sum.add(state_->v);
  sum.add(state_->pairs.crossed);
  sum.add(pieces_.of_point);
  return sum.value();
}

Momentum MlsTissue::momentum() {
  pull();
  const MlsState& s = *state_;
  Momentum sum;
  Vec3 about_origin = Vec3::Zero();
  for (int i = 0; i < s.count(); ++i) {
    const Vec3 x = s.position(i), p = s.mass[i] * s.velocity(i);
    sum.mass += s.mass[i];
    sum.centre += s.mass[i] * x;
    sum.linear += p;
    about_origin += x.cross(p);
  }
  sum.centre /= sum.mass;
  sum.angular = about_origin - sum.centre.cross(sum.linear);
  return sum;
}

std::string MlsTissue::device_name() const {
  return std::string("cpu (") + name(state_->instructions) + ", " +
         std::to_string(state_->cpu->threads()) + " threads)";
}

}  // namespace tissue_sim

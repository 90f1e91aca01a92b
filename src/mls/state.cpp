#include "mls/state.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "frame/leapfrog.h"
#include "mls/contact.h"
#include "mls/face_substep.h"
#include "mls/faces.h"
#include "mls/node_contact.h"
#include "mls/own_rate.h"

namespace tissue_sim {
namespace {

/// Weights are balanced anew after a node's rate was bounded, and rates change with them.
constexpr int kRoundsOfBounds = 3;
constexpr double kGivenLayer = 0.4;  // of the usual spacing

template <class T>
void resize_padded(Array<T>& array, int count, int per_node) {
  const int chunks = (count + kMlsChunk - 1) / kMlsChunk;
  array.assign(static_cast<std::size_t>(chunks) * kMlsChunk * per_node, T{});
}

ContactSpring layer_spring(const Material& m, float layer, float volume) {
  constexpr double kHeld = 2.0 / 3, kFree = 0.25;
  const double gives = kHeld / (lame_lambda(m) + 2 * lame_mu(m)) + kFree / m.young_modulus;
  return contact_spring(static_cast<float>(1 / (kContactStiffness * gives)),
                        static_cast<float>(m.density), layer, volume);
}

/// What a node touches anything with. It stands for the tissue outside of the node: without it that
/// would not give way when pressed, and the node's share of the body counts its energy already, so
/// that it gives way by as much as twice the node's depth. How much of that is as if sides were
/// held and how much as if they were free follows from finite elements (docs/mls.md, contact).
ContactSpring node_spring(const Material& m, float edge, float depth, float volume) {
  const float layer = depth > 0 ? std::max(0.8f * edge, std::min(2 * edge, 2 * depth)) : edge;
  return layer_spring(m, layer, volume);
}

/// Of a given node, which stands at the surface itself: nothing is outside of it. As stiff as
/// substeps bear, so that a body on the ground lies on it.
ContactSpring given_spring(const Material& m, double usual, float volume) {
  return layer_spring(m, static_cast<float>(kGivenLayer * usual), volume);
}

/// kappa of the penalty while nothing is cut.
float whole_kappa(const MlsState& s, std::int32_t i) {
  double trace = 0;  // of the moments
  for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
    const std::int32_t j = s.pairs.other[e];
    trace += s.pairs.whole[e] * (s.nodes.place[j] - s.nodes.place[i]).squaredNorm();
  }
  const double stiffness = s.nodes.material_of(i).young_modulus * s.nodes.free_volume[i];
  return trace > 0 ? static_cast<float>(3 * s.scene.mls.stabilisation * stiffness / trace) : 0.0f;
}

/// Lists all springs, at both of their nodes.
void list_springs(MlsState& s) {
  MlsSprings& springs = s.springs;
  springs.all.clear();
  for (std::int32_t i = 0; i < s.count() && !s.spring.empty(); ++i) {
    if (s.sprung[i] == 0) continue;
    for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
      const std::int32_t j = s.pairs.other[e];
      const float k = s.spring[e] + s.spring[s.pairs.twin[e]];
      if (!(k > 0)) continue;
      float r2 = 0;
      for (int a = 0; a < 3; ++a) {
        const float r = s.place[4 * j + a] - s.place[4 * i + a];
        r2 += r * r;
      }
      springs.all.push_back({i, j, k, std::sqrt(r2)});
      if (s.sprung[j] == 0) springs.all.push_back({j, i, k, std::sqrt(r2)});
    }
  }
  std::sort(springs.all.begin(), springs.all.end(), [](const MlsSpring& a, const MlsSpring& b) {
    return std::tie(a.node, a.other) < std::tie(b.node, b.other);
  });
  springs.begin.assign(s.chunks() + 1, 0);
  for (const MlsSpring& spring : springs.all) ++springs.begin[spring.node / kMlsChunk + 1];
  std::partial_sum(springs.begin.begin(), springs.begin.end(), springs.begin.begin());
}

/// Forces of springs on a chunk's nodes; `rest`: how much of their length is free of force.
void add_springs(const MlsState& s, const float* u, float rest, int chunk, float* force) {
  for (std::int32_t k = s.springs.begin[chunk]; k < s.springs.begin[chunk + 1]; ++k) {
    const MlsSpring& spring = s.springs.all[k];
    const std::int32_t i = spring.node, j = spring.other;
    float x2 = 0, x[3];
    for (int a = 0; a < 3; ++a) {
      x[a] = (s.place[4 * j + a] - s.place[4 * i + a]) + (u[4 * j + a] - u[4 * i + a]);
      x2 += x[a] * x[a];
    }
    const float length = std::sqrt(x2);
    const float scale = spring.stiffness * (length - rest * spring.rest) / std::max(length, 1e-12f);
    for (int a = 0; a < 3; ++a) force[4 * (i - chunk * kMlsChunk) + a] += scale * x[a];
  }
}

/// A held node goes where its anchor does, and notes what pulls it.
void hold_node(MlsState& s, std::int32_t i, float dt, const Vec<4>& impulse, Vec<4>& u, Vec<4>& v) {
  float* sum = &s.held_impulse[4 * i];
  store<4>(sum, load<4>(sum) + impulse);
  if (s.anchors.empty()) return;
  float target[4] = {};
  s.anchors[s.nodes.anchor[i]].displacement(&s.place[4 * i], target);
  v = (load<4>(target) - load<4>(&s.u[4 * i])) * (1 / dt);
  u = load<4>(target);
}

}  // namespace

std::unique_ptr<MlsState> make_mls_state(const Scene& scene, std::vector<std::string>* notes) {
  auto state = std::make_unique<MlsState>();
  MlsState& s = *state;
  s.scene = scene;
  s.cpu = std::make_unique<Cpu>(scene.threads);
  s.nodes = make_mls_nodes(scene, notes);
  s.pairs = make_pairs(s.nodes, scene.mls.neighbours, *s.cpu);
  if (notes != nullptr) note_far_pairs(s.nodes, s.pairs, *notes);
  hold_at_faces(scene, support_factor(scene.mls.neighbours), s.nodes, s.pairs);
  s.nodes.strained_volume = s.nodes.free_volume;
  const Array<float> kernel = s.pairs.whole;
  const bool lattice = scene.mls.placement != MlsPlacement::kGraded;
  balance(s.nodes, lattice, *s.cpu, s.pairs);
  const int n = s.count();
  for (Array<float>* a : {&s.place, &s.u, &s.v, &s.u_next, &s.v_next, &s.face})
    resize_padded(*a, n, 4);
  for (Array<float>* a :
       {&s.mass, &s.inv_mass, &s.volume_mu, &s.volume_lambda, &s.volume_eta, &s.kappa,
        &s.whole_kappa, &s.edge, &s.root_friction, &s.contact_stiffness, &s.contact_damping,
        &s.inverse_moment[0], &s.inverse_moment[1], &s.inverse_moment[2], &s.inverse_moment[3],
        &s.inverse_moment[4], &s.inverse_moment[5]}) {
    resize_padded(*a, n, 1);
  }
  resize_padded(s.stress, n, 16);
  resize_padded(s.neo_hookean, n, 1);
  resize_padded(s.sprung, n, 1);
  resize_padded(s.outer, n, 1);
  resize_padded(s.cut, n, 1);
  s.contact.resize(s.groups());
  const double factor = support_factor(scene.mls.neighbours);
  const std::vector<double> usual = usual_spacings(s.nodes);
  std::vector<std::int32_t> all(n);
  for (std::int32_t i = 0; i < n; ++i) {
    const Material& m = s.nodes.material_of(i);
    const float volume = s.nodes.volume[i];
    for (int a = 0; a < 3; ++a) s.place[4 * i + a] = static_cast<float>(s.nodes.place[i][a]);
    s.place[4 * i + 3] = s.nodes.depth[i];
    s.mass[i] = static_cast<float>(m.density) * volume;
    s.inv_mass[i] = s.nodes.anchored[i] != 0 ? 0 : 1 / s.mass[i];
    s.viscous = s.viscous || m.viscosity > 0;
    s.neo_hookean[i] = m.law == Law::kNeoHookean ? 1 : 0;
    s.edge[i] = static_cast<float>(s.pairs.support[i] / factor);
    if (s.edge[i] == 0) s.edge[i] = static_cast<float>(mls_spacing(scene));
    const ContactSpring spring = s.nodes.part[i] < 0
                                     ? node_spring(m, s.edge[i], s.nodes.depth[i], volume)
                                     : given_spring(m, usual[s.nodes.body[i]], volume);
    s.contact_stiffness[i] = spring.stiffness;
    s.contact_damping[i] = spring.damping;
    s.outer[i] = s.nodes.surface[i];
    s.root_friction[i] = static_cast<float>(std::sqrt(m.friction));
    s.whole_kappa[i] = whole_kappa(s, i);
    all[i] = i;
  }
  const auto& anchored = s.nodes.anchored;
  if (std::any_of(anchored.begin(), anchored.end(), [](std::uint8_t a) { return a != 0; })) {
    resize_padded(s.held_impulse, n, 4);
  }
  s.edges = resisting_edges(scene);
  s.instructions = instruction_set();
  s.kernels = &mls_kernels(s.instructions);
  s.lanes = make_lanes(s.pairs, s.place);
  s.connectivity = make_connectivity(s.nodes, s.pairs);
  s.spring_room.assign(s.pairs.other.size(), 0.0f);
  remake(s, all);
  for (int round = 0; round < kRoundsOfBounds && bound_own_rates(s); ++round) {
    s.pairs.whole = kernel;
    balance(s.nodes, lattice, *s.cpu, s.pairs);
    put_weights(s.pairs, s.lanes);
    for (std::int32_t i = 0; i < n; ++i) s.whole_kappa[i] = whole_kappa(s, i);
    remake(s, all);
  }
  if (touches_by_faces(s)) {
    s.cpu->for_each(
        n, [&](int i) { remake_face(s, i); }, 256);
  }
  return state;
}

MlsField field_of(MlsState& s) { return field_of(s, s.u.data(), s.v.data()); }

MlsField field_of(MlsState& s, const float* u, const float* v) {
  MlsField f;
  f.count = s.count();
  f.place = s.place.data();
  f.u = u;
  f.v = v;
  f.rows = s.lanes.row(0);
  f.stride = s.lanes.stride;
  f.slots = s.lanes.of_chunk.data();
  f.slot_first = s.lanes.first.data();
  f.slot_weight = s.lanes.weight.data();
  f.any_slots = s.lanes.any_slots;
  f.any_entries = s.lanes.any_entries;
  f.begin = s.pairs.begin.data();
  f.other = s.pairs.other.data();
  f.weight = s.pairs.weight.data();
  for (int k = 0; k < 6; ++k) f.inverse_moment[k] = s.inverse_moment[k].data();
  f.volume_mu = s.volume_mu.data();
  f.volume_lambda = s.volume_lambda.data();
  f.volume_eta = s.volume_eta.data();
  f.kappa = s.kappa.data();
  f.neo_hookean = s.neo_hookean.data();
  f.stress = s.stress.data();
  f.viscous = s.viscous && v != nullptr;
  if (s.springs.begin.empty()) list_springs(s);
  s.cpu->for_each(
      s.chunks(), [&](int chunk) { s.kernels->spread(f, chunk); }, 64);
  return f;
}

float substep(MlsState& s, float dt, std::vector<ColliderLoad>& loads) {
  MlsField field = field_of(s);
  MlsFaceSubstep touching(s, dt);
  if (touching.nodes() > 0) {
    field.touching = s.node_contacts.in_chunk.data();
    field.deformation = s.deformation.data();
  }
  list_active(s, dt);
  const bool list = is_list_due(s);
  const float kick = kick_of(s.dt, dt);
  const auto keep = static_cast<float>(std::exp(-s.scene.damping * kick));
  Vec<4> gravity{};
  for (int a = 0; a < 3; ++a) gravity[a] = static_cast<float>(s.scene.gravity[a]);
  const auto move_group = [&](int group) {
    const int first = group * kMlsGroup, last = std::min(s.count(), first + kMlsGroup);
    alignas(64) float force[4 * kMlsGroup];
    for (int i = first; i < last; i += kMlsChunk) {
      s.kernels->forces(field, i / kMlsChunk, force + 4 * (i - first));
      add_springs(s, s.u.data(), 1, i / kMlsChunk, force + 4 * (i - first));
      if (!s.node_contacts.begin.empty()) {
        add_node_contact(s, i / kMlsChunk, force + 4 * (i - first));
      }
    }
    if (list) list_near(s, group, dt);
    MlsStop stops[kMlsGroup];
    const bool stopping = add_contact(s, group, dt, kick, force, stops);
    for (int i = first; i < last; ++i) {
      const float inv_mass = s.inv_mass[i];
      Vec<4> v{};
      if (inv_mass > 0) {
        v = keep * load<4>(&s.v[4 * i]) +
            kick * (load<4>(force + 4 * (i - first)) * inv_mass + gravity);
        if (stopping && stops[i - first].collider >= 0) {
          alignas(16) float change[4] = {};
          move_stopping(s, group, i, stops[i - first], kick, force + 4 * (i - first), change);
          v = keep * load<4>(&s.v[4 * i]) + load<4>(change);
        }
      }
      Vec<4> u = load<4>(&s.u[4 * i]) + dt * v;
      if (!(inv_mass > 0)) hold_node(s, i, dt, kick * load<4>(force + 4 * (i - first)), u, v);
      store<4>(&s.v_next[4 * i], v);
      store<4>(&s.u_next[4 * i], u);
    }
  };
  const int active = static_cast<int>(s.node_contacts.active.pairs.size());
  SharedWork stresses(s.chunks(), 4), weights(touching.pair_blocks(), 8), active_pushes(active, 64),
      turns(touching.node_blocks(), 2), pushes(touching.pair_blocks(), 4),
      takes(touching.nodes(), 32), moves(s.groups(), 1);
  s.cpu->on_each_thread([&] {
    weights.help([&](int block) { touching.weigh(block); });
    active_pushes.help([&](int pair) { push_active(s, pair); });
    stresses.help([&](int chunk) { s.kernels->stresses(field, chunk); });
    active_pushes.wait();
    weights.wait();
    stresses.wait();
    if (touching.nodes() > 0) {
      turns.help([&](int block) { touching.turn(block); });
      turns.wait();
      pushes.help([&](int block) { touching.push(block); });
      pushes.wait();
      takes.help([&](int k) { touching.take(k); });
      takes.wait();
    }
    moves.help(move_group);
  });
  s.u.swap(s.u_next);
  s.v.swap(s.v_next);
  for (const MlsGroupContact& group : s.contact) {
    for (std::size_t c = 0; c < group.loads.size(); ++c) loads[c].add(group.loads[c]);
  }
  s.dt = dt;
  s.time += dt;
  return kick;
}

void internal_forces(MlsState& s, const float* u, float* force, float rest) {
  const MlsField field = field_of(s, u, nullptr);
  s.cpu->for_each(
      s.chunks(), [&](int chunk) { s.kernels->stresses(field, chunk); }, 4);
  s.cpu->for_each(
      s.chunks(),
      [&](int chunk) {
        s.kernels->forces(field, chunk, force + 4 * kMlsChunk * chunk);
        add_springs(s, u, rest, chunk, force + 4 * kMlsChunk * chunk);
      },
      4);
}

}  // namespace tissue_sim

// All that the meshless method keeps on the CPU, and the functions that work on it.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "compute/array.h"
#include "compute/for_each.h"
#include "compute/simd.h"
#include "cutting/resisting_edge.h"
#include "mls/anchors.h"
#include "mls/connectivity.h"
#include "mls/face_contact.h"
#include "mls/face_pairs.h"
#include "mls/kernels.h"
#include "mls/lanes.h"
#include "mls/nodes.h"
#include "mls/pairs.h"
#include "tissue_sim/scene.h"
#include "tools/collider.h"

namespace tissue_sim {

/// Nodes that a thread works on at a time, which share a list of colliders that are near.
inline constexpr int kMlsGroup = 64;
static_assert(kMlsGroup % kMlsChunk == 0, "groups are whole chunks");

/// A node that touches a collider.
struct MlsTouch {
  std::int32_t node;
  std::int32_t collider;
  float hold[3];  ///< place that friction holds on to, in the collider's frame [m]
};

/// Contact of a group's nodes with tools and the ground.
struct MlsGroupContact {
  std::vector<std::uint8_t> near;   ///< colliders that it may meet until they are listed anew
  std::vector<MlsTouch> touching;   ///< by node, then collider
  std::vector<ColliderLoad> loads;  ///< of the last substep, per collider; empty for none
};

/// Of nodes that may touch one another those that may do so within some substeps.
struct MlsActive {
  struct Pair {
    std::int32_t low, high;
    float rest;  ///< as in MlsNodeContacts [m]
  };
  struct Entry {
    std::int32_t node, pair;
  };
  std::vector<Pair> pairs;
  Array<float> push;                ///< of each pair: force on the high one [N], and 1 or 0: none
  std::vector<Entry> entries;       ///< each pair at both, by chunks
  std::vector<std::int32_t> begin;  ///< per chunk, and one more; empty: to be listed anew
  int left = 0;                     ///< substeps that they hold for
};

/// Nodes that may touch one another until they are looked for anew; each pair stands twice, and
/// both hold the same.
struct MlsNodeContacts {
  std::vector<std::int32_t> begin;  ///< per node, and one more; empty where nothing was looked for
  std::vector<std::int32_t> other;
  std::vector<float> rest;    ///< distance below which they push [m]; with MlsContact::kNodes
  std::vector<MlsSlip> slip;  ///< with MlsContact::kFaces, as are those below; on a CPU as of the
                              ///< last search: return_slips()
  std::vector<float>
      u_found;              ///< displacements of the nodes at the search that may touch, by number
  std::vector<float> skin;  ///< how far each may move until they are looked for anew [m]
  int until_look = 0;       ///< substeps until it is seen how far they moved

  // Of the nodes that any others may touch.
  std::vector<std::int32_t> node;
  std::vector<std::int32_t> at;  ///< of each node where it is among those, -1
  std::vector<MlsKnowsFace> knows;
  std::vector<std::uint8_t> in_chunk;  ///< whether a chunk has any
  MlsFacePairs pairs;
  MlsActive active;    ///< with MlsContact::kNodes, on a CPU
  Array<float> force;  ///< what pushes it, 4 each [N]
};

/// What pulls `node` to `other`.
struct MlsSpring {
  std::int32_t node, other;
  float stiffness;  ///< of both nodes' springs [N/m]
  float rest;       ///< [m]
};

/// All springs, each at both of its nodes, by these.
struct MlsSprings {
  std::vector<MlsSpring> all;
  std::vector<std::int32_t> begin;  ///< per chunk, and one more; empty: to be listed anew
};

struct MlsState {
  Scene scene;
  MlsNodes nodes;
  MlsPairs pairs;
  MlsConnectivity connectivity;
  MlsLanes lanes;  ///< its rows are scratch

  // Per node, padded to whole chunks. Vectors are (x, y, z, 0), but for the fourth of `place`: how
  // far outside of the node tissue ends that tools and the ground may touch [m].
  Array<float> place, u, v;                           ///< [m], [m], [m/s]
  Array<float> u_next, v_next;                        ///< where a substep writes them
  Array<float> mass, inv_mass;                        ///< [kg]; inv_mass 0 where held
  Array<float> inverse_moment[6];                     ///< of M_i: 00 11 22 01 02 12
  Array<float> volume_mu, volume_lambda, volume_eta;  ///< [N m], [N m s]
  Array<float> kappa, whole_kappa;                    ///< of the pair penalty, now and uncut
  Array<std::uint8_t> neo_hookean;                    ///< law of each node
  Array<float> stress;                                ///< see MlsField
  Array<float> deformation;                           ///< the same; empty until tissue may touch
  Array<float> face;                                  ///< mls/faces.h
  Array<float> root_friction;                         ///< of tissue on tissue
  Array<float> edge;                                  ///< distance to its neighbours [m]
  Array<float> contact_stiffness, contact_damping;    ///< node_spring() [N/m], [N s/m]
  Array<std::uint8_t> outer;                          ///< at the surface, or a cut passes beside it
  Array<std::uint8_t> cut;                            ///< a pair of it is crossed
  Array<std::uint8_t> sprung;  ///< its support spans no space: springs to its neighbours do
  Array<float> spring;         ///< per entry: at a sprung node [N/m]; empty without any
  Array<float> spring_room;    ///< zeros for it, so that a cut need not wait for memory
  MlsSprings springs;          ///< the same as passes read it
  bool viscous = false;        ///< whether any material is

  std::vector<Collider> colliders;     ///< at the present substep
  std::vector<MlsAnchorPose> anchors;  ///< at its end; empty where none ever moved
  Array<float> held_impulse;  ///< on held nodes, since the frame began [4 n]; empty without any
  std::vector<MlsGroupContact> contact;  ///< per group
  MlsNodeContacts node_contacts;
  ResistingEdges edges;  ///< of blades
  int until_list = 0;    ///< substeps until colliders near groups are listed anew
  float dt = 0;          ///< the last substep, 0 before the first [s]
  double time = 0;       ///< [s]

  InstructionSet instructions = InstructionSet::kSse2;
  const MlsKernels* kernels = nullptr;
  std::unique_ptr<Cpu> cpu;

  int count() const { return nodes.count(); }
  int groups() const { return (count() + kMlsGroup - 1) / kMlsGroup; }
  int chunks() const { return (count() + kMlsChunk - 1) / kMlsChunk; }
  Vec3 position(std::int32_t node) const {
    return Vec3(place[4 * node], place[4 * node + 1], place[4 * node + 2]) +
           Vec3(u[4 * node], u[4 * node + 1], u[4 * node + 2]);
  }
  Vec3 velocity(std::int32_t node) const {
    return Vec3(v[4 * node], v[4 * node + 1], v[4 * node + 2]);
  }
};

/// Builds the state of a valid scene at rest. Throws what make_mls_nodes() throws.
std::unique_ptr<MlsState> make_mls_state(const Scene& scene, std::vector<std::string>* notes);

/// Marks a node beside which a cut passes: tissue now ends half a spacing from it.
inline void expose(MlsState& state, std::int32_t node) {
  if (state.outer[node] == 0) state.place[4 * node + 3] = 0.5f * state.edge[node];
  state.outer[node] = state.cut[node] = 1;
}

/// Makes moments, penalty and springs of these nodes anew, after weights of their entries changed.
void remake(MlsState& state, const std::vector<std::int32_t>& nodes);

/// Stiffness of a node of which so much bears strain: strained_volume() (mls/own_rate.h).
void put_strained_volume(MlsState& state, std::int32_t node, float volume);

/// What the passes work on, at displacements `u` and velocities `v`, [4 n] each. Spreads them (see
/// MlsKernels), so no two fields are in use at a time.
MlsField field_of(MlsState& state, const float* u, const float* v);
MlsField field_of(MlsState& state);  ///< at the present ones

/// One substep: stress of all nodes, forces with contact at the colliders' present places, motion.
/// Adds what acts on the colliders to `loads`. Returns how long it acted [s].
float substep(MlsState& state, float dt, std::vector<ColliderLoad>& loads);

/// Internal forces of all nodes at displacements `u` [4 n], into `force` [4 n]: for tests and for
/// the measure of the highest frequency. Without viscosity and contact. `rest`: how much of
/// springs' lengths is free of force; 0 makes them as stiff across as they are along, and so what
/// any stretch may make of them.
void internal_forces(MlsState& state, const float* u, float* force, float rest = 1);

}  // namespace tissue_sim

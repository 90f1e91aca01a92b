// What lives on the GPU of meshless tissue, and what its kernels are launched with.
#pragma once

#include <cstdint>

#include "compute/device_array.h"
#include "compute/some_motion.h"
#include "contact/contact_spring.h"
#include "mls/anchor_pose.h"
#include "mls/face_contact.h"

namespace tissue_sim {

/// Nodes whose pairs are kept side by side: entry k of node i is at offset[i / 32] + 32 k + i % 32.
inline constexpr int kMlsSlice = 32;

/// Sums of what acts on a collider in a substep: force and moment in units of kMlsLoadUnit, as
/// integers, whose sum does not depend on the order, the number of nodes that touch it and
/// of those that lie in it (Collider::inside), and how deep the deepest does [kInsideUnit].
inline constexpr double kMlsLoadUnit = 1.0 / (1ll << 38);
inline constexpr int kMlsLoadSums = 9;
inline constexpr int kMlsMostColliders = 32;  ///< a node keeps those that it touches as bits

/// Motion of the nodes: displacement [m] and velocity [m/s], the fourth components 0.
using CudaMlsMotion = MotionOnGpu;

struct CudaMlsField {
  int count = 0;
  const float4* place;         ///< reference, and how far outside of it tissue ends [m]
  const std::int32_t* offset;  ///< per slice, and one more
  const std::int32_t* other;   ///< per entry; the node itself where there is none
  const float* weight;         ///< 0 where there is none
  const float* spring;  ///< per entry: of both ends where one is sprung [N/m]; null without any
  const std::uint8_t* whole;    ///< per entry: a pair that no cut passes
  const float* inverse_moment;  ///< [6][count]: 00 11 22 01 02 12
  const float* volume_mu;       ///< [N m], as the next two
  const float* volume_lambda;
  const float* volume_eta;
  const float* kappa;  ///< of the pair penalty
  const std::uint8_t* neo_hookean;
  const float* mass;             ///< [kg]
  const float* inv_mass;         ///< 0 where held
  const ContactSpring* contact;  ///< per node
  const float* edge;             ///< distance to its neighbours [m]
  const std::uint8_t* outer;     ///< at the surface, or a cut passes beside it
  float4* stress;                ///< [3 count]: columns of Q_i, kappa_i in the fourth place
  bool viscous = false;
  float spring_rest = 1;  ///< how much of springs' lengths is free of force, as internal_forces()
};

/// Colliders of one substep.
struct CudaMlsColliders {
  const Collider* all;
  int count = 0;
  std::uint32_t near = 0;     ///< bits: those that tissue may meet in this part of the frame
  std::uint32_t* touching;    ///< per node: bits of those that it touches
  float4* hold;               ///< [count][nodes]: place that friction holds on to
  unsigned long long* loads;  ///< [count][kMlsLoadSums]
};

/// What a node touches others with, beside MlsContactFace.
struct alignas(32) CudaMlsFace {
  float face[4];  ///< MlsState::face
  ContactSpring spring;
  float edge, root_friction;
};

/// Nodes that may touch one another, as MlsNodeContacts: with MlsContact::kNodes `begin`, `other`,
/// `rest`, with kFaces all but `rest`.
struct CudaMlsNodeContacts {
  const float* rest = nullptr;
  int count = 0;  ///< of those whose faces may touch; 0: none
  const std::int32_t* node = nullptr;
  const std::int32_t* at = nullptr;
  const MlsKnowsFace* knows = nullptr;
  const std::int32_t* begin = nullptr;  ///< per node
  const std::int32_t* other = nullptr;
  MlsSlip* slip = nullptr;
  const CudaMlsFace* of_node = nullptr;  ///< per node
  MlsContactFace* face = nullptr;        ///< its normal, weights and deformation of this substep
  float4* force = nullptr;               ///< on those that may [N]
  float dt = 0;                          ///< the last substep [s]
};

/// Held nodes: they go where anchors do and note what pulls them.
struct CudaMlsHold {
  const std::int16_t* anchor = nullptr;    ///< per node, -1 where it is free
  const MlsAnchorPose* anchors = nullptr;  ///< at the substep's end; null where none ever moved
  float4* impulse = nullptr;               ///< per node, since the frame began; null without any
};

/// A node whose pairs changed, and an entry of it.
struct CudaMlsNodeChange {
  std::int32_t node;
  float inverse_moment[6];
  float volume_mu, volume_lambda, volume_eta;
  float kappa;
  float outside;  ///< how far outside of it tissue ends [m]
  float face[4];  ///< MlsState::face
  std::uint8_t outer;
};
struct CudaMlsEntryChange {
  std::int32_t at;
  float weight, spring;
  std::uint8_t whole;
};

struct CudaMlsStep {
  float dt, kick, keep;
  float gravity[3];
};

/// What a block of threads measured.
struct CudaMlsMeasure {
  double elastic, kinetic;  ///< [J]
  float min[3], max[3];     ///< of the nodes [m]
  float speed;              ///< of the fastest [m/s]; NaN stays
  float stretch2;           ///< as in MlsMeasure
  int finite;
};
inline constexpr int kMlsThreads =
    64;  ///< of a block; a node each: few nodes, too, shall use all multiprocessors

/// And the deformation gradients of those that may touch others.
void launch_mls_stresses(const CudaMlsField& field, const CudaMlsMotion& at,
                         const CudaMlsNodeContacts& contacts, cudaStream_t stream);
/// What nodes that touch push one another, after the stresses.
void launch_mls_touches(const CudaMlsField& field, const CudaMlsMotion& at,
                        const CudaMlsNodeContacts& contacts, cudaStream_t stream);
/// The rest of a substep: forces with contact, and the motion into `to`.
void launch_mls_moves(const CudaMlsField& field, const CudaMlsMotion& at, const CudaMlsMotion& to,
                      const CudaMlsStep& step, const CudaMlsColliders& colliders,
                      const CudaMlsNodeContacts& contacts, const CudaMlsHold& hold,
                      cudaStream_t stream);
/// Writes what changed into the field's arrays.
void launch_mls_changes(const CudaMlsField& field, CudaMlsFace* faces,
                        const CudaMlsNodeChange* nodes, int node_count,
                        const CudaMlsEntryChange* entries, int entry_count, cudaStream_t stream);
/// Internal forces alone [4 count], after the stresses.
void launch_mls_forces(const CudaMlsField& field, const float4* u, float4* force,
                       cudaStream_t stream);
/// Figures of each block of threads; how much each node has stiffened (MlsMeasure) and its von
/// Mises stress [Pa], where not null.
void launch_mls_measure(const CudaMlsField& field, const CudaMlsMotion& at,
                        CudaMlsMeasure* measures, float* stiffening, float* von_mises,
                        cudaStream_t stream);

}  // namespace tissue_sim

// What lives on the GPU of position-based dynamics, and what its kernels are launched with.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/device_array.h"
#include "pbd/constraint_set.h"
#include "pbd/constraints.h"
#include "pbd/motion.h"
#include "pbd/tet_constraints.h"
#include "pbd/tip_contact.h"
#include "pbd/touch.h"
#include "tools/collider.h"

namespace tissue_sim {
namespace pbd {

/// Sums of what acts on a tool's collider in a step: force and moment in units of kPbdLoadUnit, as
/// integers, whose sum does not depend on the order, the number of vertices that touch it
/// and of those that lie in it (Collider::inside), and how deep the deepest does [kInsideUnit].
inline constexpr double kPbdLoadUnit = 1.0 / (1ll << 38);
inline constexpr int kPbdLoadSums = 9;

/// Constraints as the CPU packs them: a warp's 32 lanes are two blocks, and each load of theirs
/// two runs of 64 bytes.
template <class Kind>
struct CudaPbdSet {
  const ConstraintBlock<Kind>* blocks;
  float* multipliers;
  const std::int32_t* begin;  ///< first block of each colour, and the number of blocks
  int colours = 0;
  int tail = 0;         ///< from this colour on each is of a warp's lanes at most
  int tail_blocks = 0;  ///< how many those are
};

/// A collider of a step and the box that it fills [m].
struct CudaPbdCollider {
  Collider shape;
  float min[3], max[3];
};

/// What all steps of a frame share.
struct CudaPbdFrame {
  StepNumbers step;
  int colliders = 0;      ///< of each step
  int touch_colours = 0;  ///< of CudaPbdField::touches, which change from frame to frame
  int near_tips = 0;      ///< of CudaPbdTips::near
};

/// Triangles that come near tips in this part of a frame (State::at_tips).
struct CudaPbdTips {
  const Triangle* triangles;  ///< the whole surface; [tip][triangle] are numbered through
  int count = 0;              ///< of them; 0 where the scene has no tip
  const TipSweep* sweeps;
  std::int32_t* near;    ///< those numbers, in order
  double mean_edge = 0;  ///< [m]
};

struct CudaPbdField {
  int count = 0;      ///< vertices
  float4* x;          ///< as Vertices::x, with its padding
  float4* moved;      ///< as Vertices::moved, with its padding
  float4* predicted;  ///< [count], as v
  float4* v;
  const double* mass;    ///< [kg]
  std::uint8_t* pushed;  ///< State::pushed
  CudaPbdSet<Elastic> elastics;
  CudaPbdSet<Strain> strains;
  CudaPbdSet<Distance> links;
  CudaPbdSet<Bending> bends;
  CudaPbdSet<Touch> touches;
  CudaPbdSet<Damper> dampers;
  CudaPbdTips tips;
  bool may_touch = false;  ///< whether there are pieces that may touch one another
  int sweeps = 1;          ///< sweeps_of_step()
  const CudaPbdFrame* frame;
  CudaPbdCollider* colliders;  ///< [steps][frame->colliders]
  unsigned long long* loads;   ///< [steps][frame->colliders][kPbdLoadSums]
  int* step;                   ///< which of the frame's it is, where each step is launched
};

/// Some vertices, all of what hangs together.
struct CudaPbdChunk {
  std::int32_t begin, end;  ///< of CudaPbdFlights::order
  std::int32_t first;       ///< a vertex of the same component
};
/// Its sums; places are from where `first` is.
struct CudaPbdFlight {
  double origin[3];   ///< [m]
  double moment[3];   ///< sum of m d [kg m]
  double linear[3];   ///< of m v
  double angular[3];  ///< of m d x v
  double second[6];   ///< of m d d^T: 00 11 22 01 02 12
  int pushed;         ///< whether any vertex was
};
struct CudaPbdFlights {
  const CudaPbdChunk* chunks;
  int count = 0;
  const std::int32_t* order;  ///< vertices by chunk
};
/// RigidChange, for each component.
struct CudaPbdChange {
  double keep, centre[3], linear[3], spin[3];
  int is_free;
};

/// What all steps by one block of threads read from the host's page-locked memory and leave there:
/// a copy or a launch of its own for each would take a tenth of the frame.
struct CudaPbdExchange {
  const CudaPbdCollider* colliders;  ///< of all steps
  unsigned long long* loads;
  CudaPbdFlight* flights;  ///< [2][chunks]: before the steps, and after them
  CudaPbdFlights chunks;
};

/// What a block of threads measured.
struct CudaPbdMeasure {
  double elastic, kinetic;  ///< [J]
  double speed2;            ///< of the fastest, squared [m^2/s^2]; NaN stays
  int finite;               ///< places
};
inline constexpr int kPbdMeasures = 264;  ///< blocks of threads that measure

/// What launches need of the host's constraint sets: first block of each colour, and the number.
struct CudaPbdColours {
  const std::vector<std::int32_t>&elastics, &strains, &links, &bends;
};

/// Each constraint projected once, colour by colour: a launch for each colour, or for several small
/// ones. `keep` and `backward` as in project_constraints().
void launch_pbd_projections(const CudaPbdField& field, const CudaPbdColours& colours, bool keep,
                            bool backward, cudaStream_t stream);
/// How many launches that takes.
int pbd_projection_launches(const CudaPbdColours& colours);
/// One step by launches: the one that *field.step says, which is then the next.
void launch_pbd_step(const CudaPbdField& field, const CudaPbdColours& colours, cudaStream_t stream);
/// All steps by one block of threads, that keeps places in its shared memory.
void launch_pbd_steps(const CudaPbdField& field, const CudaPbdFrame& frame, int steps,
                      const CudaPbdExchange& exchange, cudaStream_t stream);
/// Whether that is possible.
bool fits_pbd_block(const CudaPbdField& field);
/// Makes CudaPbdTips::near for so many sweeps and seconds, and says in `count` how many; with
/// `memory` at nullptr says how much of it that needs [bytes].
void launch_pbd_near_tips(const CudaPbdField& field, int sweeps, double duration, int* count,
                          void* memory, std::size_t& bytes, cudaStream_t stream);
void launch_pbd_flights(const CudaPbdField& field, const CudaPbdFlights& flights,
                        CudaPbdFlight* result, cudaStream_t stream);
void launch_pbd_changes(const CudaPbdField& field, const std::int32_t* component,
                        const CudaPbdChange* changes, cudaStream_t stream);
/// Velocities by each of the dampers once; `begin` as CudaPbdColours has them.
void launch_pbd_dampers(const CudaPbdField& field, const std::vector<std::int32_t>& begin,
                        cudaStream_t stream);
void launch_pbd_measure(const CudaPbdField& field, CudaPbdMeasure* measures, cudaStream_t stream);

}  // namespace pbd
}  // namespace tissue_sim

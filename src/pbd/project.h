// Projects blocks of constraints, with the widest vectors that the processor has.
#pragma once

#include <type_traits>

#include "compute/simd.h"
#include "pbd/constraint_set.h"
#include "pbd/tet_constraints.h"
#include "pbd/touch.h"

namespace tissue_sim {
namespace pbd {

/// `kKeep`: lambda grows over the sweeps of a step; else this is the only one.
template <class Kind, bool kKeep, class V, int N, int M, int L>
TISSUE_SIM_INLINE void project_kind(Vertex<V> (&v)[N], const V (&number)[M], V inverse_h2,
                                    V (&lambda)[L]) {
  if constexpr (std::is_same_v<Kind, Elastic>) {
    Elastic::project<!kKeep>(v, number, inverse_h2, lambda);
  } else {
    Kind::project(v, number, inverse_h2, lambda);
  }
}

/// Projects `count` blocks of one colour. x and moved: four floats a vertex (place and inverse
/// mass, and how far it has moved from there, which is what changes). `multipliers` are those of
/// the blocks, or null: then they count as zero and are not kept, as in the only iteration of a
/// step.
template <class Kind>
using Project = void (*)(const ConstraintBlock<Kind>* blocks, int count, float inverse_h2,
                         const float* x, float* moved, float* multipliers);

struct Projections {
  Project<Distance> distance;
  Project<Bending> bending;
  Project<Strain> strain;
  Project<Elastic> elastic;
  Project<Touch> touch;
  Project<Damper> damper;
};

const Projections& projections(InstructionSet set);

}  // namespace pbd
}  // namespace tissue_sim

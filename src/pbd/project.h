// Projects blocks of constraints, with the widest vectors that the processor has.
#pragma once

#include "compute/simd.h"
#include "pbd/constraint_set.h"
#include "pbd/tet_constraints.h"
#include "pbd/touch.h"

namespace tissue_sim {
namespace pbd {

/// Projects `count` blocks of one colour. x: four floats a vertex (position and inverse mass).
/// `multipliers` are those of the blocks, or null: then they count as zero and are not kept, as in
/// the only iteration of a step.
template <class Kind>
using Project = void (*)(const ConstraintBlock<Kind>* blocks, int count, float inverse_h2, float* x,
                         float* multipliers);

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

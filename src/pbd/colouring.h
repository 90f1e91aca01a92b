// Colours: constraints of one colour share no vertex, so that they can be projected at once, in any
// order, with the same result.
#pragma once

#include <cstdint>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {
namespace pbd {

/// Gives each constraint whose colour is -1 the first one that none of its vertices has yet; the
/// others keep theirs, so that a cut repairs colours only where constraints are new. `vertices`
/// holds `per_constraint` indices below `vertex_count` for each constraint; a negative one is none.
/// Returns the number of colours.
/// `most_rounds`: of looking for fewer.
int find_colours(Span<const std::int32_t> vertices, int per_constraint, int vertex_count,
                 std::vector<std::int16_t>& colour, int most_rounds = 30);

}  // namespace pbd
}  // namespace tissue_sim

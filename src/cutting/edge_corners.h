// Corners that the path of an edge does without.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// Of the corners of lines that have as many: the first, the last and those without which another
/// one would be farther than `by` [m] off its line, in order.
std::vector<std::size_t> corners_of(std::initializer_list<const std::vector<Vec3>*> lines,
                                    double by);

}  // namespace tissue_sim

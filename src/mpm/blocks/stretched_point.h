// What is found where tissue may tear.
#pragma once

#include <cstdint>

namespace tissue_sim {

/// A point that is stretched far, and C = F^T F there: 00 11 22 01 02 12.
struct StretchedPoint {
  std::int32_t point;
  float C[6];
};

}  // namespace tissue_sim

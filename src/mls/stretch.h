// How far a node is stretched, on the CPU and on the GPU.
#pragma once

#include "compute/choose.h"

namespace tissue_sim {

/// At least its largest stretch squared, and that where the axes are those of the stretch: the
/// largest sum of a row's magnitudes in F^T F. Of T = float or Vec<W>.
template <class T>
TISSUE_SIM_INLINE T most_stretch2(const T* F) {
  T most{};
  for (int a = 0; a < 3; ++a) {
    T row{};
    for (int b = 0; b < 3; ++b) {
      const T c = F[a] * F[b] + F[3 + a] * F[3 + b] + F[6 + a] * F[6 + b];
      row += larger(c, T(-c));
    }
    most = larger(most, row);
  }
  return most;
}

}  // namespace tissue_sim

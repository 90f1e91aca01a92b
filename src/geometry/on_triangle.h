// The place on a triangle that is nearest to another place: on the CPU and on the GPU.
#pragma once

#include "compute/host_device.h"

namespace tissue_sim {

/// Summed as Eigen sums three, so that both give the same bits.
TISSUE_SIM_INLINE double dot_of(const double* a, const double* b) {
  return a[0] * b[0] + (a[1] * b[1] + a[2] * b[2]);
}

TISSUE_SIM_INLINE void cross_of(const double* a, const double* b, double* n) {
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    n[i] = a[j] * b[k] - a[k] * b[j];
  }
}

/// Nearest place of a triangle to p (Ericson, Real-Time Collision Detection, 5.1.5).
TISSUE_SIM_INLINE void on_triangle(const double* p, const double* a, const double* b,
                                   const double* c, double* place) {
  double ab[3], ac[3], bc[3], ap[3], bp[3], cp[3];
  for (int i = 0; i < 3; ++i) {
    ab[i] = b[i] - a[i], ac[i] = c[i] - a[i], bc[i] = c[i] - b[i];
    ap[i] = p[i] - a[i], bp[i] = p[i] - b[i], cp[i] = p[i] - c[i];
  }
  const double d1 = dot_of(ab, ap), d2 = dot_of(ac, ap), d3 = dot_of(ab, bp);
  const double d4 = dot_of(ac, bp), d5 = dot_of(ab, cp), d6 = dot_of(ac, cp);
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  const double* from = a;
  double along_ab = 0, along_ac = 0, along_bc = 0;
  if (d1 <= 0 && d2 <= 0) {
  } else if (d3 >= 0 && d4 <= d3) {
    from = b;
  } else if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    along_ab = d1 / (d1 - d3);
  } else if (d6 >= 0 && d5 <= d6) {
    from = c;
  } else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    along_ac = d2 / (d2 - d6);
  } else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    from = b;
    along_bc = (d4 - d3) / ((d4 - d3) + (d5 - d6));
  } else {
    const double sum = va + vb + vc;
    along_ab = vb / sum, along_ac = vc / sum;
  }
  for (int i = 0; i < 3; ++i) {
    place[i] = from[i] + along_ab * ab[i] + along_ac * ac[i] + along_bc * bc[i];
  }
}

}  // namespace tissue_sim

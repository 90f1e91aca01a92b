#include "geometry/thickness.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

namespace tissue_sim {

Thickness thickness_of(const Lattice& lattice) {
  const std::size_t nx = 2 * static_cast<std::size_t>(lattice.nx),
                    layer = nx * 2 * static_cast<std::size_t>(lattice.ny);
  std::vector<char> below(layer, 0), here(layer, 0);  // which sites of two layers along z are taken
  std::array<double, 3> runs{};
  double volume = 0;
  int z = 0;
  for (const Lattice::Site& s : lattice.sites) {
    for (; z < s.z; ++z) {
      below.swap(here);
      here.assign(layer, 0);
    }
    const std::size_t at = static_cast<std::size_t>(s.y) * nx + static_cast<std::size_t>(s.x);
    here[at] = 1;
    runs[0] += s.x == 0 || !here[at - 1];
    runs[1] += s.y == 0 || !here[at - nx];
    runs[2] += !below[at];
    volume += s.volume;
  }
  int axis = 0;
  for (int a = 1; a < 3; ++a) {
    if (runs[a] > runs[axis]) axis = a;
  }
  const double half = lattice.cell_size / 2, length = volume / (runs[axis] * half * half);
  return {"xyz"[axis], length / half, length};
}

std::string thickness_note(const Lattice& lattice) {
  const Thickness thin = thickness_of(lattice);
  if (thin.points > 1.8) return "";  // runs at the body's edge are not full
  // Two digits, rounded down, so that two points fit.
  const double unit = std::pow(10, std::floor(std::log10(thin.length)) - 1);
  char text[200];
  std::snprintf(text, sizeof text,
                "has fewer than two points across (%.2g along %c on the mean, %.2g mm thick, at "
                "cell_size %g m): it hardly resists bending; lower cell_size to %g",
                thin.points, thin.axis, thin.length * 1e3, lattice.cell_size,
                std::floor(thin.length / unit + 1e-3) * unit);
  return text;
}

}  // namespace tissue_sim

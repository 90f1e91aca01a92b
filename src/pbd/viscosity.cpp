#include "pbd/viscosity.h"

#include <algorithm>
#include <cmath>

#include "pbd/free_flight.h"

namespace tissue_sim {
namespace pbd {
namespace {

constexpr double kLeastOfCuts = 1;  // [Pa s]
constexpr double kDensity = 1000;   // [kg/m^3]
/// Edges longer than 3.5 mm damp as these do: what crumples between few vertices shook for ever.
/// Less than 1 Pa s has as much less of it.
constexpr double kLeastRate = 80;  // [1/s]
constexpr int kEdgesOfPart = 1024;

void turn(Vertices& v, int i, const Flight& f, const Vec3& spin) {
  const Vec3 add = spin.cross(v.position(i) - f.centre);
  for (int a = 0; a < 3; ++a) v.v[4 * i + a] += static_cast<float>(add[a]);
}

}  // namespace

bool make_dampers(State& s, double duration) {
  if (s.damped_for == duration) return s.dampers.size() > 0;
  s.damped_for = duration;
  std::vector<double> viscosity;
  for (const Body& body : s.scene.bodies) {
    viscosity.push_back(find_material(s.scene, body.material).viscosity);
    if (!s.wounds.empty()) viscosity.back() = std::max(viscosity.back(), kLeastOfCuts);
  }
  const int edges = s.tetrahedra.empty() ? s.edge_count : 0;
  std::vector<float> lost(edges, -1.0f);  // at each edge; negative: none to be lost
  s.cpu.for_each((edges + kEdgesOfPart - 1) / kEdgesOfPart, [&](int part) {
    for (int c = part * kEdgesOfPart; c < std::min(edges, (part + 1) * kEdgesOfPart); ++c) {
      const auto [a, b] = s.links.vertices[c];
      const double own = viscosity[s.vertices.body[a]];
      if (own == 0 || (s.vertices.anchored[a] != 0 && s.vertices.anchored[b] != 0)) continue;
      const double length = s.links.numbers[c][0];
      // Tissue between the two drags at the lighter one as if both were as heavy: tips of spikes
      // swung for seconds.
      const double m = s.vertices.mass[a], n = s.vertices.mass[b];
      const double uneven = (m + n) * (m + n) / (4 * m * n);
      const double rate =
          std::max(own / (kDensity * length * length), kLeastRate * std::min(own, 1.0));
      lost[c] = static_cast<float>(1 - std::exp(-rate * duration * uneven));
    }
  });
  s.dampers.vertices.clear();
  s.dampers.numbers.clear();
  s.dampers.colour.clear();
  for (int c = 0; c < edges; ++c) {
    if (!(lost[c] >= 0)) continue;
    s.dampers.add(s.links.vertices[c], {lost[c]});
    s.dampers.colour.back() = s.links.colour[c];
  }
  s.dampers.pack(s.vertices.size(), levels_of(s));
  return s.dampers.size() > 0;
}

void damp_neighbours(State& s, double duration) {
  if (!make_dampers(s, duration)) return;
  const std::vector<Flight> before = flights(s);
  std::vector<Vec3> spins;
  for (const Flight& f : before) spins.push_back(spin_of(f, f.angular));
  Vertices& v = s.vertices;
  for (int i = 0; i < v.size(); ++i) {
    turn(v, i, before[s.component[i]], -spins[s.component[i]]);
  }
  project_dampers(s);
  // Pushes across an edge turn what they act on: back.
  const std::vector<Flight> after = flights(s);
  for (std::size_t c = 0; c < spins.size(); ++c) {
    spins[c] +=
        spin_of(after[c], before[c].angular - before[c].inertia * spins[c] - after[c].angular);
  }
  for (int i = 0; i < v.size(); ++i) {
    turn(v, i, after[s.component[i]], spins[s.component[i]]);
  }
}

}  // namespace pbd
}  // namespace tissue_sim

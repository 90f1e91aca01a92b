// Edges of the surface and what their constraints are made of, kept from cut to cut.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "pbd/tip_contact.h"
#include "tissue_sim/types.h"

namespace tissue_sim {
namespace pbd {

struct State;

struct SurfaceEdge {
  std::int32_t a, b;         ///< a < b
  std::int32_t left, right;  ///< vertices opposite, -1 for none
  float length;              ///< [m]
  float compliance;          ///< [m/N]; negative: no link
  float angle;               ///< between its triangles [rad]
  float squares[4];          ///< of the angle's gradients at left, right, a, b [1/m^2]
  double bending;            ///< stiffness [N m/rad]; 0: no bend
};

/// Of all that an edge's constraints are, only masses change with every cut: the rest is a function
/// of the triangles around. It is kept along with what it was made of, and made anew where that
/// is no longer so: the same as made anew everywhere.
class SurfaceEdges {
 public:
  void update(State& s);
  const std::vector<SurfaceEdge>& all() const { return edges_; }  ///< by a, then b

 private:
  struct MadeOf {
    Vec3 reference;
    double half_depth;
    bool is_on_wound;
    bool operator==(const MadeOf& o) const {
      return reference == o.reference && half_depth == o.half_depth && is_on_wound == o.is_on_wound;
    }
  };
  std::vector<std::uint8_t> changed_vertices(const State& s);
  std::vector<std::uint8_t> changed_ends(const State& s);

  std::vector<SurfaceEdge> edges_, last_;  // last_: room for the next ones
  std::vector<std::int32_t> begin_;        // of each a
  std::vector<MadeOf> vertices_;
  std::vector<Triangle> triangles_;
};

}  // namespace pbd
}  // namespace tissue_sim

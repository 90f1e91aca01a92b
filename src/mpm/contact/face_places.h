// Facets by their number, and the material places that contacts hold on to.
#pragma once

#include "compute/simd.h"
#include "mpm/contact/face_contact.h"
#include "mpm/contact/touching_tissue.h"

namespace tissue_sim {

inline const Block& block_of(const TouchingTissue& s, std::int32_t facet) {
  return *s.blocks.all[s.faces.block_of[facet]];
}

inline const Facet& facet_of(const TouchingTissue& s, std::int32_t facet) {
  return block_of(s, facet).facets[facet - s.faces.first_facet[s.faces.block_of[facet]]];
}

inline const LatticeBody& body_of(const TouchingTissue& s, std::int32_t facet) {
  return s.bodies[block_of(s, facet).body];
}

/// Material of a facet: where its points are of several, that of the lowest.
inline const Material& material_of(const TouchingTissue& s, std::int32_t facet) {
  return body_of(s, facet).material_of(s.points, facet_of(s, facet).point);
}

/// Sum of w^2 / m over the nodes of a place: what a spring there moves, as one over a mass [1/kg].
inline double mobility(const Nodes& nodes, const CellNodes& cell, const AxisWeights& weights) {
  double sum = 0;
  for (int k = 0; k < 27; ++k) {
    const float w = weights.of[k % 3] * weights.of[3 + k / 3 % 3] * weights.of[6 + k / 9];
    const int node = cell.lowest[k / 9 * cell.plane + k / 3 % 3 * cell.pitch + k % 3];
    sum += static_cast<double>(w) * w * nodes.inv_mass[node];
  }
  return sum;
}

/// Whether the three nodes of each row around a cell follow one another in Nodes.
inline bool has_whole_rows(const CellNodes& cell) {
  bool whole = true;
  for (int row = 0; row < 9; ++row) {
    const std::int32_t* n = cell.lowest + row / 3 * cell.plane + row % 3 * cell.pitch;
    whole = whole && n[1] == n[0] + 1 && n[2] == n[0] + 2;
  }
  return whole;
}

/// Finds the nodes of a contact, and their weights, from its facets and the place held.
inline void find_nodes(const TouchingTissue& s, FaceContact& c) {
  c.nodes = CellNodes(block_of(s, c.facet), facet_of(s, c.facet).cell);
  c.has_whole_rows = has_whole_rows(c.nodes);
  c.weights = AxisWeights(facet_of(s, c.facet).center);
  if (c.other < 0) return;
  c.other_nodes = CellNodes(block_of(s, c.other), facet_of(s, c.other).cell);
  c.other_has_whole_rows = has_whole_rows(c.other_nodes);
  c.other_weights = AxisWeights(c.hold);
}

/// Displacement of a place in a cell: row(i, c) is component c of the nodes of row y + 3 z, three
/// and a fourth that does not count.
template <class Row>
TISSUE_SIM_INLINE void sum_rows(const AxisWeights& weights, float (&value)[3], const Row& row) {
  const float *wx = weights.of, *wy = wx + 3, *wz = wx + 6;
  Vec<4> x = {}, y = {}, z = {};
  for (int i = 0; i < 9; ++i) {
    const float w = wz[i / 3] * wy[i % 3];
    x += w * row(i, 0);
    y += w * row(i, 1);
    z += w * row(i, 2);
  }
  value[0] = wx[0] * x[0] + wx[1] * x[1] + wx[2] * x[2];
  value[1] = wx[0] * y[0] + wx[1] * y[1] + wx[2] * y[2];
  value[2] = wx[0] * z[0] + wx[1] * z[1] + wx[2] * z[2];
}

/// The same from the nodes themselves: all ways to get there have the same bits.
inline void displacement_at(const Nodes& nodes, const CellNodes& cell, bool has_whole_rows,
                            const AxisWeights& weights, float (&value)[3]) {
  const float* const u[3] = {nodes.u[0].data(), nodes.u[1].data(), nodes.u[2].data()};
  const auto first = [&cell](int i) { return cell.row(i % 3, i / 3); };
  if (has_whole_rows) {
    sum_rows(weights, value, [&](int i, int c) { return load<4>(u[c] + *first(i)); });
  } else {
    sum_rows(weights, value, [&](int i, int c) {
      const std::int32_t* n = first(i);
      return Vec<4>{u[c][n[0]], u[c][n[1]], u[c][n[2]], 0.0f};
    });
  }
}

/// The places of a contact on the CPU: see push_face().
struct ContactPlaces {
  const Nodes& nodes;
  FaceContact& contact;

  static bool any(bool so) { return so; }
  void own(float (&value)[3]) const {
    displacement_at(nodes, contact.nodes, contact.has_whole_rows, contact.weights, value);
  }
  void held(float (&value)[3]) const {
    displacement_at(nodes, contact.other_nodes, contact.other_has_whole_rows, contact.other_weights,
                    value);
  }
  void hold(const float (&place)[3]) { contact.other_weights = AxisWeights(place); }
  float own_mobility() const {
    return static_cast<float>(mobility(nodes, contact.nodes, contact.weights));
  }
  float held_mobility() const {
    return static_cast<float>(mobility(nodes, contact.other_nodes, contact.other_weights));
  }
};

/// The same of a contact within a block, whose nodes BlockKernels::gather() copied.
struct PlacesInBlock : ContactPlaces {
  const Block& block;
  const float* u;

  void own(float (&value)[3]) const { displacement(contact.nodes, contact.weights, value); }
  void held(float (&value)[3]) const {
    displacement(contact.other_nodes, contact.other_weights, value);
  }
  void displacement(const CellNodes& cell, const AxisWeights& weights, float (&value)[3]) const {
    const float* const lowest = u + (cell.lowest - block.node.data());
    const int component = block.copied_component(), pitch = block.pitch, plane = block.plane;
    sum_rows(weights, value, [=](int i, int c) {
      return load<4>(lowest + c * component + i / 3 * plane + i % 3 * pitch);
    });
  }
};

/// Facets and nodes as a look at contact `i` of FaceContacts::all reaches them on the CPU:
/// mpm/contact/narrow_phase.h.
struct ContactFaces : ContactPlaces {
  const TouchingTissue& state;
  int i;
  ContactFaces(TouchingTissue& s, int index)
      : ContactPlaces{s.nodes, s.faces.all[index]}, state(s), i(index) {}

  const Facet& facet(std::int32_t f) const { return facet_of(state, f); }
  const FacetMotion& motion(std::int32_t f) const { return state.faces.motion[f]; }
  int body(std::int32_t f) const { return block_of(state, f).body; }
  void middle(std::int32_t f, double (&place)[3]) const {
    const float zero[3] = {};
    const Vec3 x = reference_place(body_of(state, f), block_of(state, f), facet(f).cell, zero);
    for (int a = 0; a < 3; ++a) place[a] = x[a];
  }
  double modulus(std::int32_t f) const {
    const Material& m = material_of(state, f);
    return lame_lambda(m) + 2 * lame_mu(m);
  }
  float friction(std::int32_t f) const {
    return static_cast<float>(material_of(state, f).friction);
  }
  double cell_size() const { return state.scene.cell_size; }
  float per_cell() const { return static_cast<float>(1 / state.scene.cell_size); }
  std::int32_t near(int n) const { return state.faces.near[n]; }
  template <class Visit>
  void for_each_near(const Visit& visit) const {
    for (int n = state.faces.first_near[i]; n < state.faces.first_near[i + 1]; ++n) {
      visit(n, near(n), motion(near(n)).x);
    }
  }
  static NearFacet nearest(const NearFacet& best) { return best; }
  static float largest(float x) { return x; }
  void hold_in(std::int32_t f) const {
    contact.other_nodes = CellNodes(block_of(state, f), facet(f).cell);
    contact.other_has_whole_rows = has_whole_rows(contact.other_nodes);
  }
};

}  // namespace tissue_sim

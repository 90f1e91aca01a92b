// From a scene to vertices, triangles, tetrahedra and their constraints.
#pragma once

#include <memory>

#include "pbd/pbd_state.h"

namespace tissue_sim {
namespace pbd {

/// Builds all bodies of a scene. Notes say what was found and left out. Throws
/// std::invalid_argument for what cannot be built.
std::unique_ptr<State> make_state(const Scene& scene, std::vector<std::string>* notes);

/// Material of a body at a place of the reference space.
const Material& material_at(const Scene& scene, const Body& body, const Vec3& x);

/// The same for many places: a body without inclusions is of one.
class Materials {
 public:
  explicit Materials(const State& s);
  const Material& at(int body, const Vec3& x) const {
    if (of_body_[body] != nullptr) return *of_body_[body];
    return material_at(scene_, scene_.bodies[body], x);
  }

 private:
  const Scene& scene_;
  std::vector<const Material*> of_body_;
};

/// Numbers that bring neighbours in space near each other in memory (Morton's curve): entry k is
/// the index of the one that comes k-th.
std::vector<int> morton_order(const std::vector<Vec3>& places);

/// How far off a body's vertices may lie from where they are meant to [m].
double rounding_of(const State& s, int b);
/// Which of a body's anchors holds a vertex there, -1: none. Where its face is the body's own,
/// vertices lie on it but for rounding, which is `within` [m].
int holder_of(const Body& body, const Vec3& x, double within);

/// Makes distance and bending constraints anew from the triangles, tetrahedra and internal links
/// that there are; those that were there before keep their colours (surface_model.cpp).
void make_surface_constraints(State& s);
/// One constraint for each tetrahedron, likewise (tet_model.cpp).
void make_tet_constraints(State& s);
/// How many steps a frame of `duration` [s] takes.
int steps_of(const State& s, double duration);
/// Chooses the steps, or tells what those that are given leave undone (tet_steps.cpp).
void choose_steps(State& s, std::vector<std::string>* notes);
/// Volumes and masses of the surface model's vertices from the triangles (surface_model.cpp) and of
/// the tetrahedral model's from the tetrahedra. Held to the bodies' whole volumes.
void share_out_mass(State& s);
/// Joins vertices across the inside of body `b` by rays from `starts`; returns how many met
/// nothing.
int add_internal_links(State& s, int b, const std::vector<int>& starts);

/// The parts of make_state(): each adds the vertices and faces of body `b`.
void add_surface_body(State& s, int b, std::vector<std::string>* notes);
void add_tet_body(State& s, int b, std::vector<std::string>* notes);

/// Of a triangle of the surface in reference space [m^2].
double area_of(const State& s, const Triangle& t);

}  // namespace pbd
}  // namespace tissue_sim

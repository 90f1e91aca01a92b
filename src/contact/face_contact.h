// Contact of tissue with tissue: faces of cuts, pieces among themselves, folds.
//
// Each facet looks for a facet that faces it. A spring between the facet's centre and the material
// place of the other face where they touched pushes them apart (penalty, as against tools:
// contact/collider.h); where the friction cone is reached, that place slides. It is a force between
// two material places along the line between them, so it keeps linear and angular momentum and,
// while nothing slides, energy.
#pragma once

#include <cstdint>
#include <vector>

#include "contact/face_spring.h"
#include "contact/facet_motion.h"

namespace tissue_sim {

struct MpmState;
struct Pieces;

/// A facet against another.
struct FaceContact : FaceSpring {
  std::int32_t facet, other = -1;  ///< numbers over all blocks; -1: nothing near
  float depth = 0;  ///< of the facet's centre below the other face, as of the last look [cells]
  float begun = 0;  ///< depth at which the place held may stay, for there it began [cells]
  CellNodes nodes, other_nodes;
  AxisWeights weights, other_weights;  ///< at the facet's centre; at `hold`
};

/// What a contact is known by while blocks are made anew.
struct KeptContact {
  std::int32_t point;      ///< of the facet
  std::int32_t direction;  ///< of the facet
  int other_body;
  Vec3 hold;  ///< reference place [m]
  float depth, begun, stiffness, apart[3];
};

/// Where a facet was when the pairs were listed, and how far it may move while the list holds [m].
struct ListedFacet {
  float x[3], skin;
};

struct FaceContacts {
  std::vector<std::int32_t> first_facet;  ///< per block and one more
  std::vector<std::int32_t> block_of;     ///< per facet
  std::vector<FacetMotion> motion;        ///< per facet; up to date where a pair needs it
  std::vector<ListedFacet> listed;        ///< per facet; empty while there is no list
  std::vector<std::int32_t> involved;     ///< facets in any pair
  std::vector<FaceContact> all;           ///< of each facet that is to touch others near it
  std::vector<std::int32_t> first_near;   ///< CSR over `all`: those others
  std::vector<std::int32_t> near;
  std::vector<std::int32_t> active;  ///< contacts that touch, or may before the next look
  /// Per block, CSR: active contacts, as 2 * contact, plus one where the block holds the other
  /// face.
  std::vector<std::int32_t> first_of_block, of_block;
  std::vector<KeptContact> kept;                            ///< sorted by point and direction
  double until_search = 0, until_look = 0, since_look = 0;  ///< [s]
};

/// Before substeps of `dt` seconds: searches pairs, and looks at them, when it is time to. Returns
/// after how many substeps, up to `at_most`, it wants to be called again.
int find_face_contacts(MpmState& state, const Pieces& pieces, double dt, int at_most = 1);

/// Before blocks are made anew: remembers what touches.
void keep_face_contacts(MpmState& state);
/// After blocks were made: numbers their facets.
void list_facets(MpmState& state);

/// Works out the force of a contact after a substep of `dt` seconds, and lets it slide.
void push_faces(const MpmState& state, FaceContact& contact, float dt);

/// Adds the contacts of a block to its part of the force buffer.
void add_face_contacts(const MpmState& state, int block, float* force);

}  // namespace tissue_sim

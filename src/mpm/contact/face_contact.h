// Contact of tissue with tissue: faces of cuts, pieces among themselves, folds.
//
// Each facet looks for a facet that faces it. A spring between the facet's centre and the material
// place of the other face where they touched pushes them apart (penalty, as against tools:
// tools/collider.h); where the friction cone is reached, that place slides. It is a force between
// two material places along the line between them, so it keeps linear and angular momentum and,
// while nothing slides, energy.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "compute/for_each.h"
#include "mpm/contact/narrow_phase.h"
#include "mpm/surface/facet_motion.h"

namespace tissue_sim {

struct Blocks;
struct TouchingTissue;
struct Pieces;

/// A facet against another, on the CPU.
struct FaceContact : FaceSpring {
  CellNodes nodes, other_nodes;
  bool has_whole_rows = false, other_has_whole_rows = false;  ///< face_places.h, of these
  AxisWeights weights, other_weights;                         ///< at the facet's centre; at `hold`
  double looked_at = 0, look_at = 0;                          ///< when last, when next at last [s]
  template <class Archive>
  void each_field(Archive& archive) {
    FaceSpring::each_field(archive);
    archive(looked_at, look_at);
  }
};

struct FaceContacts {
  int version = 0;                        ///< how often facets were numbered
  std::vector<std::int32_t> first_facet;  ///< per block and one more
  std::vector<std::int32_t> block_of;     ///< per facet
  std::vector<FacetMotion> motion;        ///< per facet; up to date where a pair needs it
  std::vector<ListedFacet> listed;        ///< per facet; empty while there is no list
  std::vector<FaceContact> all;           ///< of each facet that is to touch others near it
  std::vector<std::int32_t> first_near;   ///< CSR over `all`: those others
  std::vector<std::int32_t> near;
  std::vector<std::int32_t> active;   ///< contacts that touch, or may before the next look
  std::vector<std::int32_t> between;  ///< those of them whose facets are of two blocks
  /// Per block, CSR: active contacts, as 2 * contact, plus one where the block holds the other
  /// face.
  std::vector<std::int32_t> first_of_block, of_block;
  /// The same: those of them that it has with itself.
  std::vector<std::int32_t> first_within, within;
  std::vector<KeptContact> kept;            ///< sorted by point and direction
  double until_search = 0, until_look = 0;  ///< at any contact [s]
  double dt = 0;                            ///< of the last substep [s]
  double fastest = 0;                       ///< of all tissue when it was last searched [m/s]

  void forget_active() {
    active.clear();
    between.clear();
  }
  TISSUE_SIM_FIELDS(version, motion, listed, all, first_near, near, active, kept, until_search,
                    until_look, dt, fastest)
};

/// Before a substep of `dt` seconds: searches pairs, and looks at them, when it is time to.
void find_face_contacts(TouchingTissue& state, const Pieces& pieces, double dt);

/// Speed of the fastest block, as of measure_motion() [m/s].
double fastest_block(const TouchingTissue& state);
/// After a part of a frame: has pairs searched and looked at anew where tissue has become so much
/// faster, as what a tool pushes does, that it may meet other tissue before that is due.
void search_if_faster(TouchingTissue& state);

/// Before blocks are made anew: remembers what touches.
void keep_face_contacts(TouchingTissue& state);
/// After blocks were made: numbers their facets, which touch nothing yet.
void list_facets(TouchingTissue& state);
/// Fills `first_facet` and `block_of`.
void number_facets(FaceContacts& faces, const Blocks& blocks);
/// Fills all that is by block, and `between`, from the active contacts.
void index_active(FaceContacts& faces);

/// Works out the force of a contact after a substep of `dt` seconds, and lets it slide.
void push_faces(const TouchingTissue& state, FaceContact& contact, float dt);

/// The same for a block's contacts with itself. `u` are the displacements of its nodes, as
/// BlockKernels::gather() copied them.
void push_faces_within(TouchingTissue& state, int block, float dt, const float* u);

/// Adds the forces of a block's contacts, which must be there, to its part of the force buffer.
void add_face_contacts(const TouchingTissue& state, int block, float* force);

/// How a facet stands, from the nodes as they are.
FacetMotion motion_of(const TouchingTissue& state, std::int32_t facet);

/// Looks at the contacts that are due, `all` of them after a search, which knows where facets are.
/// How fast each moves says when it is due again, not the fastest: debris that rattles about does
/// not make all others be looked at as often.
void look_at_due(TouchingTissue& state, double dt, bool all);

// Facet pairs: which facets may meet within a while.

using FacetPair = std::pair<std::int32_t, std::int32_t>;

/// Pairs (lower number first, sorted) of facets that face one another and whose swept boxes of half
/// size `reach` around their places overlap; none of those whose reach is 0, nor of two that are
/// debris. Facets of a block, from `first_of_block` on (one more than blocks), are looked at in
/// patches of those that follow one another within `patch` [m].
std::vector<FacetPair> facing_pairs(const std::vector<FacetMotion>& facets,
                                    const std::vector<float>& reach,
                                    const std::vector<std::uint8_t>& is_debris,
                                    const std::vector<std::int32_t>& first_of_block, float patch,
                                    Cpu& cpu);

}  // namespace tissue_sim

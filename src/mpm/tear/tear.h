// Tears: bonds break where tissue is stretched past what its material bears, by the same path as
// under blades: bonds cleared at both ends, then take_apart() and update_pieces().
//
// What breaks. The principal direction n of the largest stretch is taken in reference space, where
// the lattice is; a crack is a surface across it.
//
//   A crack goes on. A point stretched past its limit that has broken bonds beside it (cut or torn,
//   of an axis that is not along the crack) belongs to that crack: the plane across n through the
//   middles of these bonds says which of its neighbours are on the other side, and the bonds to
//   them break. Points that lost bonds across n know their side from that, which closes the steps
//   of a crack that is oblique to the lattice. The front goes on by one point at a time.
//
//   A crack begins where there is none within kReach points: at the point of each body that is
//   furthest past its limit, and, unless that is by a tenth of the limit's strain, not before waves
//   from the last break have crossed the body, for they relieve what is past its limit by a little
//   (else a strip under even tension would fall to pieces). Of the two bonds along the axis nearest
//   to n it takes the one whose far point is stretched more.
//
//   At an anchor's face, which holds points fast, a crack runs along the face, whatever the
//   principal direction is there (beside an edge of the anchor it points into it, where nothing can
//   tear), and leaves the bond between what is in the anchor and what its face holds: neither would
//   come off.
//
//   With Material::tear_length it goes on only where tissue is past its limit that far ahead of its
//   tip. Nodes part half their support, 1.5 cells, behind the last broken bond, and there the
//   tissue's own tip is: a shorter tear_length asks for a place that the crack has passed.
//
//   No dust. Along a lattice line, at most one bond breaks within kReach points: a node's support
//   is six points wide, so the opening of one crack stretches all of them, and each of them would
//   tear.
#pragma once

#include <cstdint>
#include <set>
#include <vector>

#include "compute/host_device.h"
#include "mpm/blocks/block_tissue.h"
#include "mpm/lattice/bonds.h"
#include "tissue_sim/cut.h"

namespace tissue_sim {

/// What became of the tissue.
struct TearRecords {
  std::vector<double> tore_at;  ///< per body: when a bond last tore [s]; empty while none did
  std::vector<std::int32_t> bridge_ends;  ///< points, by number
  std::set<std::int32_t> debris;          ///< the lowest point of each: mpm/tear/debris.h
  std::vector<std::int32_t> expected;     ///< points that a network expects to part, by number
  TISSUE_SIM_FIELDS(tore_at, bridge_ends, debris, expected)
};

/// Whether a body of the scene can tear.
bool can_tear(const LatticeTissue& tissue);

/// How many times a frame of `substeps` looks for tears: about every three cells that a pressure
/// wave crosses, and at its end. A crack goes on by kTearSteps points each time, as fast as that
/// wave.
int tear_checks(const LatticeTissue& tissue, int substeps, float dt);
/// After how many substeps the check number `check` (from 0) is.
inline int tear_check_at(int check, int checks, int substeps) {
  return static_cast<int>(static_cast<std::int64_t>(check + 1) * substeps / checks);
}
inline constexpr int kTearSteps = 6;

/// Stretch at which a point tears.
float tear_limit(const LatticeTissue& tissue, std::int32_t point);
/// The least limit that a point of the material may have; 0 if it never tears.
float least_tear_limit(const Material& material);
/// The same of all materials of a body that tear; 0 if none does.
float least_tear_limit(const LatticeBody& body);

/// A point past the least limit of its material, or past kAtFronts of that where a tip is looked
/// at, or kWhereExpected.
struct TearingPoint {
  std::int32_t point;
  float excess;   ///< strain over that from which on cracks begin there
  float stretch;  ///< the largest
  Vec3 normal;    ///< principal direction of the largest stretch, in reference space
  bool past;      ///< the least limit of its material
};

/// How much of its limit's strain a point at a front has at least whose tip is past the limit.
inline constexpr float kAtFronts = 0.2f;
/// While tissue is past its limit anywhere, cracks may begin at points that are expected to part
/// from this share of their limit's strain on: coarse cells know strain's peaks the less.
inline constexpr float kWhereExpected = 0.7f;
/// From what share of the limit's strain on points are listed.
float tear_share(const LatticeTissue& tissue, const TearRecords& records);

/// Points whose strain is at least `share` of what the weakest material bears that their block may
/// have, by number.
std::vector<StretchedPoint> find_stretched(BlockTissue& tissue, double share);

/// Those of them that tear, are at fronts that may, or are expected to part.
std::vector<TearingPoint> tearing_of(const LatticeTissue& tissue, const TearRecords& records,
                                     const std::vector<StretchedPoint>& stretched);

/// Breaks bonds of the points `tearing` (by number). Appends the points that lost one to `changed`,
/// by number, and counts into `report`.
void tear_bonds(BlockTissue& tissue, TearRecords& records, const std::vector<TearingPoint>& tearing,
                std::vector<std::int32_t>& changed, CutReport& report);

// A crack as the bonds show it, and where it goes on: see mpm/tear/tear.h for the rule.

inline constexpr int kReach = 3;           ///< half the support of a node [points]
inline constexpr double kTipBehind = 1.5;  ///< the same [cells]: the tip behind the last bond

/// Bonds that the point had and lost.
unsigned broken_bonds(const LatticeTissue& tissue, std::int32_t p);

/// The point that is `steps` on from a site in the direction of bond `k`, -1 where there is none.
std::int32_t neighbour(const LatticeBody& body, const Points::Site& s, int k, int steps = 1);

/// The entry of a point, null if it is not among them.
const TearingPoint* entry(const std::vector<TearingPoint>& tearing, std::int32_t point);

/// Whether a bond broke on the line of bond `k` of p, within kReach of it.
bool broken_on_line(const LatticeTissue& tissue, const LatticeBody& body, std::int32_t p, int k);

struct Bond {
  std::int32_t point;
  int bond;
  bool bridge;  ///< holds the two sides of a crack together
};

/// Appends the bonds of a point that a crack takes as it goes on. Returns whether there is a crack
/// within kReach.
bool go_on(const LatticeTissue& tissue, const TearingPoint& t,
           const std::vector<TearingPoint>& tearing, std::vector<Bond>& bonds);

// Bond bridges: what hangs on by points one after the other, thinner than the lattice tells.

/// A bridge is a bond that is in no square of four bonds. It is drawn out where it is stretched so
/// far, and has stiffened so much (mpm/tear/debris.h). One that cuts or tears left tears then,
/// whatever its material: between halves that part it would be drawn out without end, and what
/// hangs on it would whirl about, too fast for any substep. One that swings stiffens twentyfold
/// within a few substeps: it is not to get near that. One that is of the body's shape stays where
/// no material tears, and its ends settle (settle_ill_conditioned()).
inline constexpr double kThreadStretch = 1.5, kBridgeStiffening = 3.5;
bool is_drawn_out(const LatticeTissue& tissue, std::int32_t point);

/// Whether a point ends a bridge, but none that may break.
bool ends_lasting_bridge(const LatticeTissue& tissue, std::int32_t point);

/// Whether a point that has a bond in a square of four would have none without bond `k` of `point`.
bool leaves_thread(const LatticeBody& body, Points& points, std::int32_t point, int k);

/// After the points `changed` lost bonds: adds the ends of new bridges to TearRecords::bridge_ends.
void list_bridges(const LatticeTissue& tissue, TearRecords& records,
                  const std::vector<std::int32_t>& changed);

/// Tears bridges. Appends the points that lost a bond to `changed`, by number, and counts into
/// `report`.
void tear_bridges(BlockTissue& tissue, TearRecords& records, std::vector<std::int32_t>& changed,
                  CutReport& report);

}  // namespace tissue_sim

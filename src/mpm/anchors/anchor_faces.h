// Anchors act at their faces: the field of displacements is what the anchor says there, wherever
// the face lies in a cell.
//
// Tissue inside an anchor is rigid: it has neither stress nor mass (Points::free_volume), but for a
// hundredth of both in cells that a face goes through (keep_held(), volume_with_mass()), so the
// body ends at the face as it would at a surface of its own. Along each row of nodes that goes
// through a face, in the direction closest to its normal, the field of these nodes,
//   sum_i w_i u_i = what the anchor says,
// is held at the place of the face by an impulse that shares out among the row's three nodes as
// 1 / m_i does: velocities are projected in the metric of mass. On a face across an axis these
// conditions are exactly that the field is held all over it; on an oblique one they are exact for
// linear fields. Frequencies only fall, the substep stays, and the impulse is the reaction.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "compute/for_each.h"
#include "compute/host_device.h"
#include "mpm/split/lattice_tissue.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// A row has the three nodes that the cell sees in which its face is, and one more outside.
inline constexpr int kRowNodes = 4;

/// The field of a row of nodes at a face.
struct FaceRow {
  std::int32_t node[kRowNodes];  ///< in Nodes; 0 with weight 0 for none
  float weight[kRowNodes];
  float share[kRowNodes];  ///< weight / m: of an impulse to velocity [1/kg]
  std::int32_t anchor;     ///< in the order of the scene
  float place[3];          ///< on the face, in reference space [m]
  TISSUE_SIM_FIELDS(node, weight, share, anchor, place)
};

/// Where a face goes through a row of nodes: of the whole lattice.
struct FaceLink {
  std::int32_t body, anchor;  ///< the anchor in the order of the scene
  std::int32_t cell[3];       ///< in whose middle the row's second node is
  std::int32_t axis;          ///< of the row
  float at;        ///< place of the face, in cells from the middle of the cell, towards the outside
  bool outside;    ///< whether the outside is above
  float place[3];  ///< the same in reference space [m]
};

inline constexpr int kLargestGroup = 64;  ///< rows of a FaceGroup

/// Rows that have nodes in common are held together.
struct FaceGroup {
  std::int32_t first, count;  ///< of its rows
  std::int32_t inverse;       ///< of count x count [kg]: from velocities to impulses
};

/// A rigid motion from reference space: x = R X + t.
struct RigidMotion {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Vec3 translation = Vec3::Zero();

  Vec3 displacement(const float* X) const {
    const Vec3 place(X[0], X[1], X[2]);
    return rotation * place + translation - place;
  }
  TISSUE_SIM_FIELDS(rotation, translation)
};

/// What a cut changes of what anchors hold.
struct AnchorRows {
  std::vector<FaceRow> rows;
  std::vector<FaceGroup> groups;
  std::vector<float> inverse;
  struct HeldNode {
    std::int32_t node, anchor;
    float place[3];  ///< [m]
    TISSUE_SIM_FIELDS(node, anchor, place)
  };
  std::vector<HeldNode> held;  ///< nodes that only tissue inside sees; found once any moves
  bool moves = false;          ///< whether any anchor has moved ever
  TISSUE_SIM_FIELDS(rows, groups, inverse, held, moves)
};

/// What a substep changes of it.
struct AnchorFaceMotion {
  std::vector<std::array<double, 3>> impulse;  ///< on tissue, by row, since the frame began [N s]
  std::vector<RigidMotion> now;                ///< of each anchor, at the end of the last substep
  TISSUE_SIM_FIELDS(impulse, now)
};

struct AnchorFaces : AnchorRows, AnchorFaceMotion {
  /// Where a place in an anchor of a body is now [m].
  Vec3 place_of_held(const Body& body, int body_number, const Vec3& X) const;

  std::vector<Vec3> origin;  ///< of the anchors, in the order of the scene [m]
  std::vector<FaceLink> links;
  std::vector<std::int32_t>
      points;                      ///< in or beside whose cubes faces lie, when the scene is built
  std::vector<int> first_of_body;  ///< anchors, by body
  /// Per lattice node, whether rows of a link may have it: rows stay as they are where none of
  /// these is split.
  std::vector<std::uint8_t> at_link;
  /// Per node, whether a row moves it. Nodes that were split since the rows were made are missing.
  std::vector<std::uint8_t> at_row;
};

/// Normal of the anchors' face that is nearest to a place outside of them.
Vec3 face_normal(const std::vector<Anchor>& anchors, const Vec3& x);

/// Finds where the faces are, of bodies that are whole, and which points they touch
/// (AnchorFaces::points). Throws std::invalid_argument for an anchor that neither holds points nor
/// has a face at its body.
void find_face_links(const Scene& scene, const LatticeTissue& tissue, AnchorFaces& faces);
/// Makes the rows anew: at the beginning, and after nodes of some of them were split.
void find_face_rows(const LatticeTissue& tissue, AnchorFaces& faces);
/// Fills AnchorFaces::at_row from the rows: find_face_rows() does, a restored state has to.
void mark_row_nodes(std::size_t node_count, AnchorFaces& faces);
/// Whether rows may have one of these cells' nodes.
bool have_rows(const AnchorFaces& faces, const std::vector<LatticeBody>& bodies,
               const std::vector<NodeFields::Cell>& cells);
/// Finds AnchorFaces::held: before any anchor moves, and after nodes were split.
void find_held_nodes(const LatticeTissue& tissue, AnchorFaces& faces);

/// Where the anchors are at the share (0 to 1) of a frame; empty where none moves in it.
std::vector<RigidMotion> anchors_at(const AnchorFaces& faces, const FrameInput& input,
                                    double share);

/// After nodes moved through a substep of `dt`: holds group `i`. `before`, `after`: where the
/// anchors were and are, null where they stay.
void hold_group(AnchorFaces& faces, int i, float dt, const RigidMotion* before,
                const RigidMotion* after, Nodes& nodes);
/// Takes what group `i` holds out of a field [3] of the nodes.
void hold_still(const AnchorFaces& faces, int i, Array<float>* field);
/// Moves the nodes inside with their anchors.
void move_held(const AnchorFaces& faces, float dt, const RigidMotion* before,
               const RigidMotion* after, Nodes& nodes);

/// Mean loads on the anchors over a frame of `duration`, about their origins where these are now.
std::vector<Wrench> anchor_loads(const AnchorFaces& faces, double duration);

/// Has a row read what has no weight of a node of its own, which no other group writes.
void read_own(FaceRow& row);

/// Puts rows with nodes in common side by side, in groups of at most kLargestGroup, and works out
/// how they are held.
void group_rows(const Nodes& nodes, AnchorFaces& faces);

/// Share of what a face is off that a substep of `dt` mends: what rounding left, and what rows are
/// off where tissue tears, for they hold other nodes then, or with other weights. It is mended by a
/// velocity, which must not grow as substeps get shorter: at a tenth of 60 um in each of 1 us a few
/// light nodes had more energy than all tissue, and the watch on energy made substeps shorter
/// still.
inline float face_drift(float dt) {
  constexpr float kMost = 0.1f, kTime = 1e-3f;  // [s]
  return std::min(kMost, dt / kTime);
}

/// Whether a row's first node swings: points in the outer half of the face's cell alone see it,
/// with weight 1/32, so it has less than that of the mass of the node outside.
inline bool is_swing(const FaceRow& row) {
  constexpr float kLight = 1 / 32.0f;
  if (row.share[0] == 0 || row.share[2] == 0) return false;
  return row.weight[0] / row.share[0] < kLight * row.weight[2] / row.share[2];
}
/// Share of its velocity that such a node loses in a substep. Nothing but these points holds it:
/// with the energy that every motion of tissue has in the end it swings by many cells, the farther
/// the less of them lies outside the anchor, stretches them ninefold where others are twofold, and
/// they tear. At rest nothing changes; of the energy of what vibrates it takes less than a
/// thousandth a period.
inline constexpr float kSwingLoss = 0.02f;

// How much of each point's volume lies outside its body's anchors: tissue inside is rigid.

/// Share of a cube that lies outside all `anchors`, and the middle of that share, from the cube's
/// centre in units of its edge. Exact for one plane or box, else by lines through the cube.
struct OutsideShare {
  double share = 1;
  Vec3 middle = Vec3::Zero();
};
OutsideShare share_outside(const std::vector<Anchor>& anchors, const Vec3& center, double edge);

/// What of a half cell's share goes to the next point along an axis, of how far the share's middle
/// is off the point [half cells]. With 1 the first moment would stay. Points that lie behind the
/// face see a strain that is not that of the tissue before it and count for less so: the sag of a
/// clamped block changes by 1.2 % with the place of the plane in a cell, by 2.3 % with 1 (8 cells).
inline constexpr double kShift = 1.6;
/// Where the next point is in another cell, a half cell of which less than this share lies outside
/// gives it all: by what stayed of it, some hundredths of the half cell, nodes behind the face
/// would be so light that they swing wildly once a cut parts them from the tissue before it.
/// A little more than a fifth, for planes lie at round parts of a cell, and the volume there and
/// the row that holds it, which ask apart, must not disagree by rounding: a block sagged 12 % more.
inline constexpr double kSliver = 0.2002;
/// The part of a half cell's share that goes to the next along an axis, where the share's middle is
/// that far off [half cells].
inline double share_shifted(double off, bool to_next_cell) {
  return to_next_cell && off > 0.5 * (1 - kSliver) ? 1 : kShift * off;
}

/// Fills Points::free_volume: of each point the volume outside the anchors, some of it shared with
/// its neighbours; and Points::lightness. Empty where no body has anchors.
void find_free_volumes(LatticeTissue& tissue);

}  // namespace tissue_sim

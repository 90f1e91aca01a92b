// How much of each point's volume lies outside its body's anchors: tissue inside is rigid.
#pragma once

#include "mpm/split/lattice_tissue.h"

namespace tissue_sim {

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

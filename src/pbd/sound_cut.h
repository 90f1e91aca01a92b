// A cut after which every piece is closed and has no slivers, or stays whole.
#pragma once

#include "pbd/cut.h"

namespace tissue_sim {
namespace pbd {

/// What a cut by cut_soundly() leaves.
struct SoundMesh {
  /// Smallest angle of a triangle [rad]; where a piece had a smaller one before, that.
  static constexpr double kLeastAngle = 0.05;
  /// Shortest edge [mean edges]; where a piece had a shorter one before, that.
  static constexpr double kLeastEdge = 0.1;
  /// Smaller pieces, of some two tetrahedra as long as the mean edge, are not cut any more
  /// [mean edges^3].
  static constexpr double kLeastCut = 0.2;
  /// A part of a piece with more surface than this, twice that of such a tetrahedron, is one that a
  /// whole path's links come apart into [mean edges^2].
  static constexpr double kLeastParted = 5;
  /// Volumes of a body's closed pieces sum up to its own, but for this share.
  static constexpr double kVolumeError = 0.005;
  /// A closed surface's areas times normals add up to nothing: to this share of its area, for the
  /// lips of a slit lie on one another but for what their vertices do not match.
  static constexpr double kLargestHole = 1e-3;
};

/// Cuts the surface model along a whole path, closes wounds and shares out masses (cut_surface(),
/// after_cut()). What it would make unsound stays as it was: piece by piece the cut is taken back,
/// tried again a tenth of an edge aside, which is below what the mesh resolves, and left out where
/// that helps nothing. What a tool's blade left whole is tried again in the next frame, along with
/// what the blade sweeps then. Vertices do not move from `before`. Returns whether anything
/// changed.
bool cut_soundly(State& s, const BladePath& path, const std::vector<Vec3>& before, int stroke,
                 std::vector<std::int32_t>& origin, CutReport& report);

}  // namespace pbd
}  // namespace tissue_sim

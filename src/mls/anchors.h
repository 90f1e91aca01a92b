// Anchors hold tissue at their faces, not at the nodes that happen to lie in them.
#pragma once

#include <vector>

#include "mls/anchor_pose.h"
#include "mls/nodes.h"
#include "mls/pairs.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// The place of a region that is nearest to one outside.
Vec3 nearest_of(const Region& region, const Vec3& x);

/// Of all anchors at a share of the frame; empty where none ever moved.
std::vector<MlsAnchorPose> mls_anchors_at(const Scene& scene, const FrameInput& input,
                                          double share);

/// Mean forces on the anchors over a frame, about where their origins are at its end, from the
/// impulses on held nodes [4 nodes] [N s].
std::vector<Wrench> mls_anchor_loads(const Scene& scene, const FrameInput& input,
                                     const MlsNodes& nodes, const float* u, const float* impulse,
                                     double duration);

/// Moves held nodes that have free neighbours onto the face of their anchor between them, where a
/// node that moves is never nearer than a quarter of a spacing: one that would be is held and moved
/// to the face instead. Fills MlsNodes::free_volume: tissue within anchors bears no strain. After
/// make_pairs(), which takes the places as they were.
void hold_at_faces(const Scene& scene, double support_factor, MlsNodes& nodes, MlsPairs& pairs);

}  // namespace tissue_sim

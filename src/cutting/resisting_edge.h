// Edges of blades in tissue that resists them: their pieces, what these hold, and the paths on
// which they cut. cutting/edge_forces.h has the law.
#pragma once

#include <cstdint>
#include <vector>

#include "tissue_sim/cut.h"
#include "tissue_sim/scene.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// A piece of a blade's edge, in the blade's frame.
struct EdgePiece {
  int tool;            ///< in Scene::tools
  int side;            ///< of scissors: which blade, 0 or 1
  Vec3 middle;         ///< [m]
  Vec3 along, onward;  ///< unit: along the edge; in the blade's plane out of it
  double length;       ///< [m]
  double edge_radius;  ///< [m]
  double tip_radius;   ///< half of a scalpel's thickness [m]; 0: of scissors
};

/// A material place: of a body, none where that is -1, in reference space [m], and what a method
/// knows it by.
struct EdgePlace {
  std::int32_t body = -1;
  std::int32_t site[3] = {};
  double at[3] = {};

  Vec3 reference() const { return {at[0], at[1], at[2]}; }
};

/// What a piece of an edge holds on to.
struct EdgeHold {
  EdgePlace place;           ///< the end of its cut
  EdgePlace swept;           ///< that when it was swept last
  double ahead[3] = {};      ///< the way on, in reference space, unit
  double slides[3] = {};     ///< the way its place slid of late, in the world, unit
  double stiffness = 0;      ///< of its spring, once it presses [N/m]
  std::int32_t presses = 0;  ///< whether the edge is there, else it comes or went back
  std::int32_t lets_go = 0;  ///< once what is left is swept; 2: since before this part of the frame

  bool holds() const { return place.body >= 0 && lets_go == 0; }
};

/// Nodes that live on a GPU, as far as edges need them on the host: the law is there alone, which
/// costs a few thousand nodes' way there and back in each substep in which edges hold tissue.
class DistantNodes {
 public:
  virtual ~DistantNodes() = default;
  /// Brings the motion of nodes, of those within some cells of places.
  virtual void bring_motion(const std::vector<std::int32_t>& nodes) = 0;
  virtual void bring_motion_around(const std::vector<EdgePlace>& places) = 0;
  /// Sends velocities back, of nodes that were brought.
  virtual void send_velocities(const std::vector<std::int32_t>& nodes) = 0;
};

/// What the edges of a scene hold; empty where no material has toughness.
struct ResistingEdges {
  std::vector<EdgePiece> pieces;    ///< of all blades, heel to tip, of scalpels to the spine
  std::vector<EdgeHold> holds;      ///< of each
  std::vector<Tool> tools;          ///< the scene's
  DistantNodes* distant = nullptr;  ///< null where nodes are the host's

  /// What holds see, where nodes are not the host's.
  void bring_held() const;

  bool any_holds() const;
  /// Where the blade of that piece is at the share `s` of a frame.
  Pose blade_of(const EdgePiece& piece, const FrameInput& input, double s) const;
  /// Whether it may come to hold tissue in a frame from the share `begin` on.
  bool seeks(const EdgePiece& piece, const FrameInput& input, double begin) const;
  /// Whether the other blade of scissors is past it: nothing is left between them there.
  bool is_past(const EdgePiece& piece, const FrameInput& input, double s) const;
};

bool resists(const Scene& scene);
/// Pieces an eighth of a cell long, if the scene's materials resist.
ResistingEdges resisting_edges(const Scene& scene);

/// Whether blades may cut in the frame.
bool may_cut(const Scene& scene, const ResistingEdges& edges, const FrameInput& input);

/// What the edges of a frame's blades sweep where they hold nothing, from the share `begin` of
/// the frame to `end`: today's paths, where nothing resists.
std::vector<BladePath> free_paths(const Scene& scene, const ResistingEdges& edges,
                                  const FrameInput& input, double begin, double end);

}  // namespace tissue_sim

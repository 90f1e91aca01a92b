// Contact of tissue with tools and the ground, block by block.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/host_device.h"
#include "contact/push_tool.h"
#include "mpm/blocks/block_tissue.h"
#include "mpm/contact/contact_inertia.h"
#include "tools/collider.h"

namespace tissue_sim {

struct TouchingTissue;

/// A point that touches a collider.
struct Touch : ToolMemory {
  std::int32_t cell;  ///< lane of its cell's first point, in its block
  std::int32_t point;
  std::uint8_t key;  ///< SurfacePlace::key, or kPointKey plus which of the cell's eight points
  std::uint8_t collider;
  std::uint8_t part;  ///< of the place: mpm/contact/place_parts.h
  float along[3];     ///< normal of its added mass (mpm/contact/contact_inertia.h)
  float inertia = 0;  ///< of that [kg]
};

/// A cell of which a collider may touch points before such cells are listed anew.
struct NearCell {
  std::int32_t lane;  ///< of its first point, in its block
  std::int32_t node;  ///< its lowest, in the block's nodes
  std::uint8_t collider;
  std::uint8_t points;  ///< bit s: that at sub-position s, in the body or for a blade
  std::int32_t first_place, place_count;  ///< in Block::surface or merged
  float middle[3];                        ///< reference place [m]
  std::int32_t first_part;                ///< of its places' parts, in Contacts::parts
  float lightest = -1;                    ///< largest 1 / m of its nodes, negative until asked for
  std::uint8_t clear = 0;                 ///< substeps for which no place of it can be reached
  std::uint8_t points_clear = 0;          ///< the same of its `points`
};

/// What is known of a place in such a cell, or of a part of it, until cells are listed anew.
struct NearPart {
  enum Side : std::uint8_t { kUnknown, kTowards, kAway };
  float mobility = -1;     ///< mpm/contact/face_places.h, negative until it is asked for [1/kg]
  std::uint8_t clear = 0;  ///< substeps for which the collider cannot reach it
  Side side = kUnknown;    ///< whether the surface faces the collider
};

/// Contact of points with colliders, block by block.
struct Contacts {
  std::vector<std::vector<std::uint8_t>> near;      ///< colliders that it may meet this frame
  std::vector<std::vector<NearCell>> cells;         ///< by collider, then lane
  std::vector<std::vector<NearPart>> parts;         ///< of their places
  std::vector<std::vector<Touch>> touching;         ///< by collider, cell and key
  std::vector<std::vector<InertiaChange>> changes;  ///< of the substep
  ContactInertia inertia;
  int until_list = 0;  ///< substeps until `cells` are listed anew
  /// Between two frames; the rest begins anew with each.
  TISSUE_SIM_FIELDS(touching, inertia.nodes, inertia.dt)
};

inline constexpr std::uint8_t kPointKey = 128;  ///< Touch::key of a point, above those of places

/// Forgets what is near, of so many blocks; what touches stays.
void forget_near(Contacts& contacts, std::size_t blocks);

/// Finds out which colliders each block may meet in a frame of `duration` seconds, from where its
/// points are, how fast they move (BlockTissue::motion) and what each collider sweeps (`reach`);
/// lets go of contacts that are out of reach. `before`: where they were before, too.
void find_near_colliders(TouchingTissue& state, const std::vector<Box>& reach, double duration,
                         const std::vector<BlockMotion>& before = {});

/// Whether a block (BlockTissue::motion) has come to a collider that find_near_colliders() did not
/// foresee, for it went faster later.
bool missed_contact(const TouchingTissue& state, const std::vector<Box>& reach);

/// Makes the lists of points in contact anew after update_blocks(), with no collider near.
void list_contacts(TouchingTissue& state);

/// Of some points, in order, that were put elsewhere: contact begins as deep as they are now.
void begin_anew(Contacts& contacts, const std::vector<std::int32_t>& points);

/// Counts a substep. Returns whether cells near colliders must be listed anew before it.
bool is_list_due(Contacts& contacts);

/// Lists a block's cells that a collider may touch until the next list, with substeps of `dt`
/// seconds.
void list_near_cells(TouchingTissue& state, int block, float dt);

/// Adds contact forces to the block's part of the force buffer, before a substep of `dt` seconds,
/// and sums the loads of the colliders.
void add_contact(TouchingTissue& state, int block, float dt, float* force,
                 std::vector<ColliderLoad>& loads);

}  // namespace tissue_sim

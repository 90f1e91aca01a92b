// What the GPU's kernels see of anchors' faces (mpm/anchors/anchor_faces.h): plain structs with
// device pointers.
#pragma once

#include <vector_types.h>

#include <cstddef>
#include <cstdint>

namespace tissue_sim {

inline constexpr int kFaceRowNodes = 4;    ///< kRowNodes
inline constexpr int kFaceGroupRows = 64;  ///< kLargestGroup

/// Groups of rows that a thread block holds side by side for a bundle that has nodes of theirs:
/// those of its slots move as the groups say. Whoever has nodes of a group works it out anew, from
/// the forces of all of them, so that nobody has to wait for others.
struct alignas(16) CudaFaceChunk {
  int first_entry, entries;  ///< their nodes
  int first_row, rows;
  int next;      ///< the bundle's next chunk, -1 after the last
  int is_large;  ///< they come to CudaHeldFaces::room
  int unused[2];
};

/// A node of a row that shares none with others; the row's four lie side by side, one for each of
/// four lanes. All that is needed to move it is here, for nobody to wait more than once for it.
struct alignas(16) CudaHeldNode {
  std::int32_t node;     ///< -1 where the row has none
  int local;             ///< from the bundle's first slot on, and kOwnedHere; -1: not to be put
  float weight;          ///< of its velocity in the impulse [kg]
  float share;           ///< of the impulse in its velocity [1/kg]
  uint4 parts, more;     ///< the first eight slots that share the node, ...
  std::uint32_t shared;  ///< ... and CudaTables::slot_parts of one of them; kNoSlot for none
  float arm;    ///< what its column of CudaHeldFaces::pull counts for in the impulse: the place
                ///< of the face from the anchor's origin, and 1, times the row's mass [kg m, kg]
  int anchor;   ///< and kSwings
  int impulse;  ///< where the component of its number is summed up; -1: nowhere
};
inline constexpr int kOwnedHere = 1 << 30;  ///< the bundle writes the node down
inline constexpr std::uint32_t kNoSlot = ~0u;
inline constexpr int kSwings = 1 << 30;  ///< calm_swings() slows the node down

/// Numbers of each node, and of each row, of a chunk while it is worked out.
inline constexpr int kFaceEntryRoom = 8, kFaceRowRoom = 6;

/// What an impulse of a row, by its number in the chunk, gives to a node: 1 / kg.
struct CudaFaceShare {
  int row;
  float share;
};

/// A node of a chunk's rows, as CudaHeldNode.
struct alignas(16) CudaFaceEntry {
  std::int32_t node;
  int local;
  int shares;           ///< so many rows move it
  int next_share;       ///< where the others are than ...
  CudaFaceShare share;  ///< ... the first of them
  std::uint32_t shared;
  int swings;  ///< how often calm_swings() slows it down
  uint4 parts, more;
};

/// FaceRow, its nodes and its group by their numbers in the chunk.
struct alignas(16) CudaFaceRow {
  int entry[kFaceRowNodes];
  float weight[kFaceRowNodes];
  int anchor;
  float place[3];   ///< from the anchor's origin [m]
  int group, rows;  ///< the first row, and how many
  int inverse;      ///< the row's own line of FaceGroup::inverse
  int impulse;      ///< its number in AnchorFaces; -1 where another bundle sums it up
};

/// A slot of a bundle whose node moves with an anchor: AnchorFaces::held.
struct CudaCarriedNode {
  std::int32_t node;
  int local;  ///< from the bundle's first slot on
  int slot;
  int anchor;
  float place[3];  ///< [m]
};

/// RigidMotion.
struct CudaAnchorPlace {
  double rotation[9], translation[3];
};

/// What a kernel needs to hold faces; null `chunks` where there are none.
struct CudaHeldFaces {
  const CudaFaceChunk* chunks = nullptr;  ///< first the first of each bundle
  const CudaHeldNode* held = nullptr;     ///< of rows that have no nodes in common with others, ...
  const int* first_held = nullptr;        ///< ... per bundle, and the end
  const int* first_carried = nullptr;     ///< per bundle, and the end
  const CudaFaceEntry* entries = nullptr;
  const CudaFaceShare* shares = nullptr;
  const CudaFaceRow* rows = nullptr;
  const CudaCarriedNode* carried = nullptr;
  const float* inverse = nullptr;
  double* impulse = nullptr;  ///< on tissue, [rows][3] [N s]; null where nobody asks
  /// Of each anchor before the first substep and after each; null where all stay.
  const CudaAnchorPlace* places = nullptr;
  /// By substep and anchor, columns of what its motion asks of the velocity at a face, times the
  /// substep: what it moves by, and `drift` of where it was before; null where all stay.
  const float4* pull = nullptr;
  int anchors = 0;
  bool carries_always = false;  ///< rows read nodes that anchors carry
  float drift = 0;              ///< face_drift(), or 0 where only rates count
  float swing_loss = 0;         ///< kSwingLoss, or 0 there
  float* room = nullptr;
  std::size_t room_each = 0;  ///< of a bundle, a multiple of 4
};

}  // namespace tissue_sim

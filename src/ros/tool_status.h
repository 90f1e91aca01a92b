// What there is to say of the poses of one tool: whether they come, and whether they can be meant.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "ros/pose_track.h"
#include "tissue_sim/types.h"

namespace tissue_sim {

struct PoseCounts {
  std::uint64_t accepted = 0;
  std::uint64_t placed = 0;
  std::array<std::uint64_t, kRefusalCount> refused{};
  std::uint64_t jaws_refused = 0;
  std::uint64_t all_refused() const;
};

struct ToolStatus {
  std::string tool;
  std::string source;  ///< "/probe/measured_cp", or the tf frame that it follows
  bool follows_tf = false;
  std::uint32_t publishers = 0;  ///< of the topic
  std::string wrong_type;        ///< of what is published there and is not taken; "" for none
  std::string waiting;   ///< why there is no transform of the frame that it follows; "" for none
  bool latched = false;  ///< the last pose: it holds until the next
  bool came = false;     ///< a pose, of whatever quality; with tf a transform
  double silent = 0;     ///< since the last one, or since the start [s]
  std::string far;       ///< see distance_warning()
  PoseCounts counts;
};

/// How long poses may stay away without a warning [s]: an arm sends them all the time.
constexpr double kSilentWarning = 2;

/// Why this tool is not driven, or not as it is meant; "" if all is well.
std::string warning(const ToolStatus& status);

/// Whether what drove the tool has vanished: nobody publishes its poses any more, or its transform
/// stands still.
bool is_gone(const ToolStatus& status);

/// Distance of a place from a box, 0 within [m].
double distance(const Box& box, const Vec3& place);

/// "72 m from all tissue", and whether positions a factor of 10 or 1000 smaller or larger would be
/// near it (a scaled arm, millimetres); "" where the place is less than half a metre or three
/// diagonals of the tissue's box from it, or there is no tissue. `in_frame` is the place in its own
/// frame, which stands in the world as `frame` says.
std::string distance_warning(const Box& tissue, const Pose& frame, const Vec3& in_frame);

}  // namespace tissue_sim

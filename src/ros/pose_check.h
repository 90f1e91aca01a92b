// Which of the poses that come in can be meant: what a tool may do between two of them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// Why a pose is not used.
enum class Refusal { kNotFinite, kNoRotation, kOlder, kUnknownFrame, kJump };
constexpr int kRefusalCount = 5;

/// As it stands in diagnostics: "not finite", "older than the last"...
const char* name_of(Refusal refusal);

struct PoseLimits {
  double speed = 5;              ///< [m/s]
  double turn_rate = 60;         ///< [rad/s]
  double frame_time = 1.0 / 60;  ///< gaps shorter than this count as this [s]
};

/// Checks the poses of one tool, in the order in which they came.
class PoseCheck {
 public:
  explicit PoseCheck(const PoseLimits& limits) : limits_(limits) {}

  struct Verdict {
    std::optional<Refusal> refusal;  ///< none: use it
    bool placed = false;  ///< used, but the tool did not come here on a path that it could sweep
    std::string text;     ///< why it was refused or placed, with values
  };

  /// `time` [s] is the pose's own, by whatever clock. An accepted `pose` is normalised.
  ///
  /// A pose that is older than the last one or too far from it is refused. When kStay of them in a
  /// row are consistent among themselves, the arm really is there (its clock or its driver was
  /// started anew, somebody moved it while nobody looked): the tool is placed there. So it is when
  /// nothing came for kSilence and the arm is now farther than it comes in one frame.
  Verdict check(Pose& pose, double time);

  static constexpr int kStay = 10;
  static constexpr double kSilence = 0.5;  ///< [s]

 private:
  struct Timed {
    Pose pose;
    double time;
  };
  bool reachable(const Timed& from, const Timed& to) const;

  PoseLimits limits_;
  std::optional<Timed> last_;       // accepted
  std::optional<Timed> candidate_;  // last of those refused since
  int stayed_ = 0;
};

}  // namespace tissue_sim

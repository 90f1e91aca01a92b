// Which of the poses that come in can be meant: what a tool may do between two of them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// Why a pose is not used.
enum class Refusal {
  kNotFinite,
  kNoRotation,
  kOlder,
  kUnknownFrame,
  kJump,
  kFar,       ///< more than kFarthestPose from the world's origin
  kStamp,     ///< see is_far_ahead()
  kOwnFrame,  ///< in the frame that this node publishes for the tool itself
};
constexpr int kRefusalCount = 8;
constexpr double kFarthestPose = 1e6;  ///< that anything is from the world's origin [m]

/// As it stands in diagnostics: "not finite", "older than the last"...
const char* name_of(Refusal refusal);

/// Whether a quaternion can be meant as a rotation, whose digits somebody rounded by hand: its norm
/// is from 0.9 to 1.1. It is to be normalised then.
bool is_rotation(const Quat& q);
/// Whether that is more than rounding: to be said.
bool is_rounded(const Quat& q);

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
    std::string text;  ///< a sentence why it was refused or placed, with values; "" for the first
  };

  /// `stamp` [s] is the pose's own, by whatever clock; `now` [s] when it came, by one that never
  /// goes back. An accepted `pose` is normalised.
  ///
  /// A pose that is older than the last one or too far from it is refused. When kStay of them in a
  /// row, over kStayTime at least, agree among themselves, the arm really is there (its driver was
  /// started anew, somebody moved it while nobody looked): the tool is placed there. So it is at
  /// the second old pose whose stamp goes on as time does: a bag that loops, at whatever rate up to
  /// ten times, a clock that was set back. And so it is when nothing came for kSilence and the arm
  /// is now farther than it comes in one frame. Stamps may stay the same: then the time when poses
  /// came counts.
  Verdict check(Pose& pose, double stamp, double now);
  /// Where the stamps are when poses come.
  Verdict check(Pose& pose, double time) { return check(pose, time, time); }
  /// Whether a tool comes from the one to the other in a frame.
  bool reachable(const Pose& from, const Pose& to) const { return reachable(from, to, 0); }
  /// Time begins anew: the next pose is the first.
  void forget();

  static constexpr int kStay = 10;
  static constexpr double kStayTime = 0.1;  ///< [s]
  static constexpr double kSilence = 0.5;   ///< [s]

 private:
  struct Timed {
    Pose pose;
    double stamp, came;
  };
  double gap(const Timed& from, const Timed& to) const;
  bool reachable(const Pose& from, const Pose& to, double gap) const;
  bool believed(const Timed& sample, Refusal refusal, std::string& text);

  PoseLimits limits_;
  std::optional<Timed> last_;          // accepted
  std::optional<Timed> candidate_;     // last of those refused since
  Refusal refusal_ = Refusal::kOlder;  // why
  int stayed_ = 0;
  double since_ = 0;  // when the first of those came that stayed
};

}  // namespace tissue_sim

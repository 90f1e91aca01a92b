// Where a tool is by the poses that came in: which of them can be meant, and the way between them.
#pragma once

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <string>

#include "tissue_sim/types.h"

namespace tissue_sim {

/// Why a pose is not used; kFar: see fault_of(), kStamp: is_far_ahead(), kOwnFrame: in the frame
/// that this node publishes for the tool itself.
enum class Refusal {
  kNotFinite,
  kNoRotation,
  kOlder,
  kUnknownFrame,
  kJump,
  kFar,
  kStamp,
  kOwnFrame
};
/// As they stand in diagnostics.
constexpr const char* kRefusals[] = {"not finite",      "no rotation",  "older than the last",
                                     "unknown frame",   "jump",         "too far",
                                     "stamp far ahead", "its own frame"};
constexpr std::size_t kRefusalCount = std::size(kRefusals);

/// How far a quaternion's norm may be off 1: somebody rounded its digits by hand. It is to be
/// normalised then.
constexpr double kRounding = 0.1;
/// Whether that is more than rounding: to be said.
inline bool is_rounded(double norm) {
  const double off = std::fabs(norm - 1);
  return off > 0.01 && off <= kRounding;
}

/// The share `s` (0 to 1) of the way from a to b.
inline double between(double a, double b, double s) { return a + s * (b - a); }
inline Pose between(const Pose& a, const Pose& b, double s) {
  return {(1 - s) * a.position + s * b.position, a.orientation.slerp(s, b.orientation)};
}

/// Goes straight from where it is to the newest sample, in the time that passed between the last
/// two: it arrives when the next one is due, one sample later than the arm. Where samples come late
/// it stays. Times [s] by a clock that never goes back.
template <class T>
class SampleTrack {
 public:
  /// It is there at once.
  void place(const T& value, double now) {
    from_ = to_ = value;
    came_ = now;
    duration_ = 0;
    has_come_ = true;
  }
  /// The first one places it.
  void add(const T& value, double now) {
    if (!has_come()) return place(value, now);
    from_ = at(now);
    to_ = value;
    duration_ = std::min(now - came_, kLongest);
    came_ = now;
  }
  bool has_come() const { return has_come_; }
  void forget() { has_come_ = false; }
  const T& newest() const { return to_; }
  double newest_came() const { return came_; }
  T at(double now) const {
    const double passed = now - came_;
    return passed >= duration_ ? to_ : between(from_, to_, passed / duration_);
  }

 private:
  static constexpr double kLongest = 0.5;  // what is slower than this is no arm that moves [s]
  T from_{}, to_{};
  bool has_come_ = false;
  double came_ = 0, duration_ = 0;  // [s]
};

struct PoseLimits {
  double speed = 5;              ///< [m/s]
  double turn_rate = 60;         ///< [rad/s]
  double frame_time = 1.0 / 60;  ///< gaps shorter than this count as this [s]
};

/// The poses of one tool, in the order in which they came.
class PoseTrack {
 public:
  explicit PoseTrack(const PoseLimits& limits) : limits_(limits) {}

  struct Verdict {
    std::optional<Refusal> refusal;  ///< none: it is the newest now
    bool placed = false;  ///< used, but the tool did not come here on a path that it could sweep
    std::string text;  ///< a sentence why it was refused or placed, with values; "" for the first
  };

  /// `stamp` [s] is the pose's own, by whatever clock; `now` [s] when it came, by one that never
  /// goes back. Where it is used, it is normalised.
  ///
  /// A pose that is older than the last one or too far from it is refused. When kStay of them in a
  /// row, over kStayTime at least, agree among themselves, the arm really is there (its driver was
  /// started anew, somebody moved it while nobody looked): the tool is placed there. So it is at
  /// the second old pose whose stamp goes on as time does: a bag that loops, at whatever rate up to
  /// ten times, a clock that was set back. And so it is when nothing came for kSilence and the arm
  /// is now farther than it comes in one frame. Stamps may stay the same: then the time when poses
  /// came counts.
  Verdict add(Pose pose, double stamp, double now);
  /// Time begins anew: the next pose is judged as the first.
  void begin_anew();
  /// The same, and the tool counts as placed where it is.
  void rewind(double now);
  /// The same, and where it was is forgotten.
  void forget();
  /// A simulation goes on in which the tool is there: where it shall be is not known before the
  /// next pose, which places it unless one frame can bring the tool there.
  void go_on(const Pose& from);

  bool has_come() const { return track_.has_come(); }
  bool is_known() const { return track_.has_come() && !goes_on_from_; }
  Pose at(double now) const { return track_.at(now); }  ///< [s]
  const Pose& newest() const { return track_.newest(); }

  static constexpr int kStay = 10;
  static constexpr double kStayTime = 0.1;  ///< [s]
  static constexpr double kSilence = 0.5;   ///< [s]

 private:
  struct Timed {
    Pose pose;
    double stamp, came;
  };
  bool reachable(const Pose& from, const Pose& to, double gap) const;
  Verdict judge(const Pose& pose, double stamp, double now);
  bool believed(const Timed& sample, Refusal refusal, std::string& text);

  PoseLimits limits_;
  SampleTrack<Pose> track_;            // of those accepted
  double stamp_ = 0;                   // of the newest
  bool begins_ = true;                 // the next is judged as the first
  std::optional<Pose> goes_on_from_;   // until the next
  std::optional<Timed> candidate_;     // last of those refused since
  Refusal refusal_ = Refusal::kOlder;  // why
  int stayed_ = 0;
  double since_ = 0;  // when the first of those came that stayed
};

}  // namespace tissue_sim

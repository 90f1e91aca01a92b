#include "tools/grip.h"

#include <algorithm>
#include <cmath>

namespace tissue_sim {
namespace {

constexpr double kFastest = 3;     // of the angle between jaws [rad/s]
constexpr double kApproach = 0.5;  // of what is left to the pressure asked for, in a frame
constexpr double kForget = 0.8;    // of a stiffness that was felt, in a frame

}  // namespace

double squeezed(double pressure, double jaw) {
  return pressure * (1 + (kMostSqueeze - 1) * std::clamp(-jaw / kFullSqueeze, 0.0, 1.0));
}

void Grip::limit(double pressure, double duration, ToolMotion& motion) const {
  const auto angle = [](double value) {
    return static_cast<float>(std::clamp<double>(value, 0, M_PI));
  };
  motion.jaw_begin = angle(motion.jaw_begin);
  const double fastest = kFastest * duration, left = pressure - pressed_;
  // Without a stiffness nothing was felt yet; the closer to the pressure, the slower.
  double close = fastest * std::max(0.0, left / pressure);
  if (stiffness_ > 0) close = std::min(close, kApproach * left / stiffness_);
  close = std::max(close, -fastest);
  motion.jaw_end = angle(
      std::clamp<double>(motion.jaw_end, motion.jaw_begin - close, motion.jaw_begin + fastest));
}

void Grip::follow(const ToolMotion& motion, double pressed) {
  const double closed = static_cast<double>(motion.jaw_begin) - motion.jaw_end;
  stiffness_ *= kForget;
  if (std::fabs(closed) > 1e-6) stiffness_ = std::max(stiffness_, (pressed - pressed_) / closed);
  pressed_ = pressed;
  if (pressed <= 0) stiffness_ = 0;
}

}  // namespace tissue_sim

#include "ros/tool_status.h"

#include <algorithm>
#include <cstdio>
#include <numeric>

namespace tissue_sim {

std::uint64_t PoseCounts::all_refused() const {
  return std::accumulate(refused.begin(), refused.end(), std::uint64_t{0});
}

std::string warning(const ToolStatus& s) {
  char time[32];
  std::snprintf(time, sizeof time, "%.1f s", s.silent);
  const std::string publishers =
      std::to_string(s.publishers) + (s.publishers == 1 ? " publisher" : " publishers");
  if (s.follows_tf) {
    if (!s.waiting.empty()) return s.tool + ": no transform: " + s.waiting;
    if (s.came && s.silent > kSilentWarning) {
      return s.tool + ": tf frame '" + s.source + "' has been the same for " + time +
             ": its publisher is gone or stands still";
    }
  } else if (!s.came && !s.wrong_type.empty()) {
    const std::string package = "geometry_msgs/";
    const bool is_known =
        s.wrong_type == package + "TransformStamped" || s.wrong_type == package + "PoseStamped";
    return s.tool + ": what is published on " + s.source + " is " + s.wrong_type +
           ", which is not taken: " +
           (is_known
                ? "set tools/" + s.tool + "/pose_type: " + s.wrong_type.substr(package.size())
                : "a tool's poses are geometry_msgs/PoseStamped, or TransformStamped by pose_type");
  } else if (!s.came) {
    return s.tool + ": no pose ever came on " + s.source + " (" + publishers + ")" +
           (s.publishers == 0 ? ": nobody publishes there, remap it to the arm's topic" : "");
  } else if (s.silent > kSilentWarning && !(s.latched && s.publishers > 0)) {
    return s.tool + ": no pose on " + s.source + " for " + time + " (" + publishers + ")";
  }
  if (s.came && s.counts.accepted == 0 && s.counts.all_refused() > 0) {
    return s.tool + ": all poses so far were refused";
  }
  return s.far.empty() ? "" : s.tool + " is " + s.far;
}

bool is_gone(const ToolStatus& s) {
  return s.came && (s.follows_tf ? s.silent > kSilentWarning : s.publishers == 0);
}

double distance(const Box& box, const Vec3& place) {
  return (place.cwiseMax(box.min).cwiseMin(box.max) - place).norm();
}

std::string distance_warning(const Box& tissue, const Pose& frame, const Vec3& in_frame) {
  if (!(tissue.min.array() <= tissue.max.array()).all()) return "";
  const double size = (tissue.max - tissue.min).norm();
  const double far = distance(tissue, frame * in_frame);
  if (far < std::max(0.5, 3 * size)) return "";
  char text[160];
  std::snprintf(text, sizeof text, "%.3g m from all tissue", far);
  std::string warning = text;
  for (const int factor : {10, 1000, -10, -1000}) {  // the least that will do
    const Vec3 scaled = factor > 0 ? Vec3(in_frame / factor) : Vec3(in_frame * -factor);
    const double then = distance(tissue, frame * scaled);
    if (then > std::max(0.25, 1.5 * size)) continue;  // an arm near it
    std::snprintf(text, sizeof text, "; positions %s by %d would be %s%s",
                  factor > 0 ? "divided" : "multiplied", std::abs(factor),
                  then > 0 ? "near it" : "within it",
                  factor == 1000 ? ": are they in millimetres?" : ": are they scaled?");
    return warning + text;
  }
  return warning;
}

}  // namespace tissue_sim

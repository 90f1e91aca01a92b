// Times that others send: nothing here throws, however far off they are. ros::Time throws where a
// difference or a sum leaves 32 bits of seconds, so their operators are not used on such times.
#pragma once

#include <ros/time.h>

#include <algorithm>
#include <cstdint>

namespace tissue_sim {

inline std::int64_t in_nanoseconds(const ros::Time& t) {
  return static_cast<std::int64_t>(t.sec) * 1000000000 + t.nsec;
}

/// The nearest that ros::Time can hold.
inline ros::Time ros_time_of(std::int64_t nanoseconds) {
  constexpr std::int64_t kMost = 4294967295ll * 1000000000 + 999999999;
  const std::int64_t t = std::min(std::max<std::int64_t>(nanoseconds, 0), kMost);
  return ros::Time(static_cast<std::uint32_t>(t / 1000000000),
                   static_cast<std::uint32_t>(t % 1000000000));
}

/// How much later `to` is than `from` [s].
inline double seconds_between(const ros::Time& from, const ros::Time& to) {
  return static_cast<double>(in_nanoseconds(to) - in_nanoseconds(from)) * 1e-9;
}

/// Whether a stamp is more than a day ahead of both ROS' and the wall's time: no clock is.
inline bool is_far_ahead(const ros::Time& stamp) {
  constexpr double kDay = 86400;
  const ros::WallTime wall = ros::WallTime::now();
  const ros::Time now = std::max(ros::Time::now(), ros::Time(wall.sec, wall.nsec));
  return seconds_between(now, stamp) > kDay;
}

}  // namespace tissue_sim

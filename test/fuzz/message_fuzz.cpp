// Bytes of messages, as they come over a connection, into what the node makes of them: the first
// byte says of which kind.
#include <geometry_msgs/PoseStamped.h>
#include <ros/serialization.h>
#include <sensor_msgs/JointState.h>
#include <tissue_sim/Cut.h>

#include <cstdlib>
#include <new>
#include <stdexcept>
#include <vector>

#include "bytes.h"
#include "ros/conversions.h"
#include "ros/jaw_check.h"
#include "ros/pose_track.h"
#include "ros/stamps.h"

// roscpp makes room for as many elements as a message says it has before it looks for their bytes:
// what no machine has is no fault of what is fuzzed.
void* operator new(std::size_t size) {
  void* room = size < (1u << 28) ? std::malloc(size) : nullptr;
  if (room == nullptr) throw std::bad_alloc();
  return room;
}
void operator delete(void* room) noexcept { std::free(room); }
void operator delete(void* room, std::size_t) noexcept { std::free(room); }

namespace {

template <class M>
M read(std::string bytes) {
  M message;
  ros::serialization::IStream stream(reinterpret_cast<std::uint8_t*>(&bytes[0]),
                                     static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::deserialize(stream, message);
  return message;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tissue_sim;
  FuzzBytes bytes(data, size);
  static PoseTrack track{PoseLimits()};
  try {
    switch (bytes.take<std::uint8_t>() % 4) {
      case 0: {
        const auto m = read<geometry_msgs::PoseStamped>(bytes.rest());
        static double now = 0;
        const ros::Time stamp = m.header.stamp;
        if (in_nanoseconds(ros_time_of(in_nanoseconds(stamp))) < 0) std::abort();
        const auto verdict = track.add(from_message(m.pose), stamp.toSec(), now += 0.01);
        if (!verdict.refusal && !(track.newest().position.norm() < 2e6)) std::abort();
        break;
      }
      case 1: {
        const JawAngle jaw = jaw_angle(read<sensor_msgs::JointState>(bytes.rest()));
        if (jaw.problem.empty() && !(std::abs(jaw.angle) < 4)) std::abort();
        break;
      }
      case 2: {
        const AppliedInput input = from_message(read<FrameInputMessage>(bytes.rest()));
        for (const BladePath& path : input.cuts) check_path(path);
        break;
      }
      case 3: {
        const auto m = read<Cut::Request>(bytes.rest());
        BladePath path;
        for (const auto& x : m.edge) path.edge.push_back(from_message(x));
        for (const auto& p : m.path) path.poses.push_back(from_message(p));
        check_path(path);
        break;
      }
    }
  } catch (const std::invalid_argument&) {
  } catch (const ros::serialization::StreamOverrunException&) {
  } catch (const std::length_error&) {  // a count that no message can have
  } catch (const std::bad_alloc&) {
  }
  return 0;
}

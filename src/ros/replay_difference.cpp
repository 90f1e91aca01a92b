// How what was recorded of a frame differs from what comes out when it is run again.
#include <ros/serialization.h>

#include <cstdio>
#include <cstring>

#include "ros/replay.h"

namespace tissue_sim {
namespace {

std::string text(double x) {
  char line[40];
  std::snprintf(line, sizeof line, "%.9g", x);
  return line;
}
std::string text(std::int32_t x) { return std::to_string(x); }
std::string text(std::uint8_t x) { return x ? "true" : "false"; }
std::string text(const std::string& x) { return x; }

// Of values that are both NaN as well.
template <class T>
bool same(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}
bool same(const std::string& a, const std::string& b) { return a == b; }

class Differences {
 public:
  template <class T>
  void add(const char* name, const T& recorded, const T& run) {
    if (same(recorded, run)) return;
    all_ += (all_.empty() ? "" : ", ") + std::string(name) + " is " + text(run) + " (recorded " +
            text(recorded) + ")";
  }
  const std::string& all() const { return all_; }

 private:
  std::string all_;
};

template <class M>
bool same_bytes(const M& a, const M& b) {
  const ros::SerializedMessage x = ros::serialization::serializeMessage(a);
  const ros::SerializedMessage y = ros::serialization::serializeMessage(b);
  return x.num_bytes == y.num_bytes && std::memcmp(x.buf.get(), y.buf.get(), x.num_bytes) == 0;
}

}  // namespace

std::string difference(const SimulationState& recorded, const SimulationState& run) {
  Differences d;
  if (!recorded.checksum.empty()) d.add("checksum", recorded.checksum, run.checksum);
  d.add("pieces", recorded.fragments, run.fragments);
  d.add("loose pieces", recorded.loose_fragments, run.loose_fragments);
  d.add("their volume", recorded.fragment_volume, run.fragment_volume);
  d.add("points", recorded.particles, run.particles);
  d.add("substeps", recorded.substeps, run.substeps);
  d.add("longest substep", recorded.substep, run.substep);
  d.add("CFL number", recorded.cfl, run.cfl);
  d.add("elastic energy", recorded.elastic_energy, run.elastic_energy);
  d.add("kinetic energy", recorded.kinetic_energy, run.kinetic_energy);
  d.add("largest speed", recorded.max_speed, run.max_speed);
  d.add("blew up", recorded.blew_up, run.blew_up);
  return d.all();
}

std::string difference(const FrameInputMessage& recorded, const FrameInputMessage& run) {
  std::string all;
  for (std::size_t i = 0; i < recorded.tools.size() && i < run.tools.size(); ++i) {
    const InstrumentMotion &a = recorded.tools[i], &b = run.tools[i];
    if (same_bytes(a, b)) continue;
    Differences d;
    d.add("its jaw angle", static_cast<double>(a.jaw_end), static_cast<double>(b.jaw_end));
    all += (all.empty() ? "" : ", ") + ("the motion of " + b.name + " differs") +
           (d.all().empty() ? "" : ": " + d.all());
  }
  return all;
}

}  // namespace tissue_sim

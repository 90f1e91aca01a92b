#include "tools/instrument.h"

#include <algorithm>
#include <cstdio>
#include <utility>
#include <vector>

#include "tools/entry.h"
#include "tools/pose_fault.h"

namespace tissue_sim {
namespace {

constexpr double kSpeed = 0.1;     // of the way in: as hands are [m/s]
constexpr double kFarthest = 0.3;  // through any organ [m]
/// What is no deeper stands there at once if it was not placed, as tests and studies begin. From
/// farther within, tissue would be thrown off at once: mls took a million substeps for a frame.
constexpr double kShallow = 2;  // cells

std::string entry_note(const Tool& tool, double way_in) {
  if (way_in < 0) {
    return tool.name +
           " is placed within tissue and finds no way out along its shaft: its forces "
           "are those of a tool with tissue on all sides";
  }
  char text[200];
  std::snprintf(text, sizeof text,
                "%s is placed within tissue: it comes in along its shaft, %.0f mm at %g m/s",
                tool.name.c_str(), 1e3 * way_in, kSpeed);
  return text;
}

}  // namespace

void Instrument::ask(const ToolRequest& request) {
  asked_ = request.pose;
  normalise(asked_);
  is_asked_ = true;
  is_placed_ = is_placed_ || request.placed;  // until a frame places it
  jaw_ = request.jaw.value_or(jaw_);
  grip_pressure_ = request.grip_pressure.value_or(grip_pressure_);
}

void Instrument::put(const ToolMotion& motion, double grip_pressure) {
  asked_ = motion.end;
  is_asked_ = motion.present;
  is_placed_ = false;
  jaw_ = motion.jaw_end;
  way_in_ = 0;
  grip_pressure_ = grip_pressure;
}

std::string Instrument::move(const Tool& tool, double duration, double cell_size, Tissue& tissue,
                             ToolMotion& motion) {
  if (!is_asked_) return "";
  std::string note;
  motion.jaw_end = static_cast<float>(jaw_);
  const bool appears = is_placed_ || !motion.present;
  if (appears) motion.jaw_begin = motion.jaw_end;
  if (const bool is_placed = std::exchange(is_placed_, false); appears) {
    std::vector<std::uint8_t> cloud;
    const int count = tissue.read_points({}, cloud);
    way_in_ =
        way_out(tool, asked_, motion.jaw_end,
                {reinterpret_cast<const Point*>(cloud.data()), static_cast<std::size_t>(count)},
                0.5 * cell_size, kFarthest);
    if (!is_placed && way_in_ <= kShallow * cell_size) way_in_ = 0;
    if (way_in_ != 0) note = entry_note(tool, way_in_);
    way_in_ = std::max(way_in_, 0.0);
  }
  motion.end = {asked_ * Vec3(0, 0, -way_in_), asked_.orientation};
  if (appears) motion.begin = motion.end;
  motion.present = true;
  way_in_ = std::max(0.0, way_in_ - kSpeed * duration);
  return note;
}

double Instrument::limit_jaws(const Tool& tool, double duration, ToolMotion& motion) const {
  if (tool.type == ToolType::kScissors) {  // they press with what it takes
    for (float* jaw : {&motion.jaw_begin, &motion.jaw_end}) {
      *jaw = static_cast<float>(std::clamp<double>(*jaw, 0, M_PI));
    }
  }
  if (tool.type != ToolType::kGrasper) return 0;
  const double set = grip_pressure_ > 0 ? grip_pressure_ : tool.grip_pressure;
  const double pressure = squeezed(set, motion.jaw_end);
  grip_.limit(pressure, duration, motion);
  return pressure;
}

void Instrument::follow(const ToolMotion& motion, const ToolLoad& load) {
  grip_.follow(motion, load.grip_area > 0 ? load.grip / load.grip_area : 0);
}

}  // namespace tissue_sim

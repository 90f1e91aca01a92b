#include "ros/trajectory.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <locale>
#include <sstream>
#include <stdexcept>

#include "ros/pose_track.h"
#include "tools/pose_fault.h"

namespace tissue_sim {
namespace {

using Row = std::array<double, 9>;  // t, x, y, z, qx, qy, qz, qw, jaw

[[noreturn]] void refuse(const std::string& where, const std::string& why) {
  throw std::invalid_argument(where + " " + why);
}

// False for a line that is no row of numbers.
bool parse(const std::string& line, std::vector<double>& values) {
  std::istringstream fields(line);
  for (std::string field; std::getline(fields, field, ',');) {
    std::istringstream in(field);
    in.imbue(std::locale::classic());
    double value;
    std::string rest;
    if (!(in >> value) || in >> rest) return false;
    values.push_back(value);
  }
  return true;
}

void add(const Row& row, const std::string& where, std::vector<TimedSample>& trajectory) {
  TimedSample s;
  s.time = row[0];
  s.pose.position = Vec3(row[1], row[2], row[3]);
  s.pose.orientation = Quat(row[7], row[4], row[5], row[6]);
  s.jaw = row[8];
  for (const double x : row) {
    if (!std::isfinite(x)) refuse(where, "has a value that is not finite");
  }
  const std::string wrong = problem_of(s.pose, kRounding);
  if (!wrong.empty()) refuse(where, wrong);
  s.pose.orientation.normalize();
  if (!trajectory.empty() && !(s.time > trajectory.back().time)) {
    refuse(where, "is at " + std::to_string(s.time) + " s: times must increase");
  }
  trajectory.push_back(s);
}

void load_csv(std::istream& file, const std::string& path, std::vector<TimedSample>& trajectory) {
  int number = 0;
  bool names = false;
  for (std::string line; std::getline(file, line);) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    const std::size_t first = line.find_first_not_of(" \t");
    if (first == std::string::npos || line[first] == '#') continue;
    const std::string where = path + ", line " + std::to_string(number);
    std::vector<double> values;
    if (!parse(line, values)) {
      if (!trajectory.empty() || names) refuse(where, "is no row of numbers");
      names = true;
      continue;
    }
    if (values.size() != 8 && values.size() != 9) {
      refuse(where, "has " + std::to_string(values.size()) +
                        " numbers: must be t, x, y, z, qx, qy, qz, qw and, if there is one, jaw");
    }
    Row row{};
    std::copy(values.begin(), values.end(), row.begin());
    add(row, where, trajectory);
  }
}

void load_yaml(const std::string& path, std::vector<TimedSample>& trajectory) {
  const YAML::Node list = YAML::LoadFile(path);
  if (!list.IsSequence()) refuse(path, "must be a list of {t, position, orientation, jaw}");
  for (std::size_t i = 0; i < list.size(); ++i) {
    const std::string where = path + ", sample " + std::to_string(i);
    const auto position = list[i]["position"].as<std::vector<double>>();
    const auto orientation = list[i]["orientation"].as<std::vector<double>>();
    if (position.size() != 3 || orientation.size() != 4) {
      refuse(where, "needs position: [x, y, z] and orientation: [x, y, z, w]");
    }
    Row row{};
    row[0] = list[i]["t"].as<double>();
    std::copy(position.begin(), position.end(), row.begin() + 1);
    std::copy(orientation.begin(), orientation.end(), row.begin() + 4);
    row[8] = list[i]["jaw"].as<double>(0.0);
    add(row, where, trajectory);
  }
}

bool ends_with(const std::string& s, const std::string& end) {
  return s.size() >= end.size() && s.compare(s.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

std::vector<TimedSample> load_trajectory(const std::string& path) {
  std::vector<TimedSample> trajectory;
  std::ifstream file(path);
  if (!file) refuse("'" + path + "'", "cannot be read: give the path of a file of timed poses");
  if (ends_with(path, ".yaml") || ends_with(path, ".yml")) {
    try {
      load_yaml(path, trajectory);
    } catch (const YAML::Exception& e) {
      refuse(path, std::string("cannot be used: ") + e.what());
    }
  } else {
    load_csv(file, path, trajectory);
  }
  if (trajectory.empty()) refuse(path, "has no poses");
  return trajectory;
}

TimedSample sample_at(const std::vector<TimedSample>& trajectory, double time) {
  const auto after = std::upper_bound(trajectory.begin(), trajectory.end(), time,
                                      [](double t, const TimedSample& s) { return t < s.time; });
  TimedSample s = after == trajectory.begin() ? *after : *(after - 1);
  if (after != trajectory.begin() && after != trajectory.end()) {
    const double f = (time - s.time) / (after->time - s.time);
    s.pose.position += f * (after->pose.position - s.pose.position);
    s.pose.orientation = s.pose.orientation.slerp(f, after->pose.orientation);
    s.jaw += f * (after->jaw - s.jaw);
  }
  s.time = time;
  return s;
}

}  // namespace tissue_sim

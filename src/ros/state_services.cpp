// Services that keep the state of a simulation or its surface as a file, and go on from a state.
#include <ros/console.h>

#include <fstream>
#include <stdexcept>

#include "geometry/ply.h"
#include "ros/recording_path.h"
#include "ros/service_answer.h"
#include "ros/services.h"
#include "scene/read_file.h"

namespace tissue_sim {
namespace {

void write_new(const std::string& path, const std::vector<std::uint8_t>& bytes) {
  const std::string unfinished = path + ".active";
  try {
    std::ofstream file(unfinished, std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    file.close();
    if (!file) throw std::runtime_error(path + " cannot be written: is the disk full?");
    rename_new(unfinished, path);
  } catch (...) {
    std::remove(unfinished.c_str());
    throw;
  }
}

/// How many bytes a state of a simulation may have that has this many when it starts: cuts and what
/// they left add to it.
std::size_t most_bytes(std::size_t at_start) { return 4 * at_start + (std::size_t(16) << 20); }

}  // namespace

void Services::keep(const std::string& path, const std::vector<std::uint8_t>& bytes) {
  const double needed =
      static_cast<double>(bytes.size()) + parameters_.recording_reserve * 1024 * 1024;
  if (free_space(path.substr(0, path.rfind('/'))) < needed) {
    throw std::runtime_error("the disk has not enough space left (recording_reserve)");
  }
  const double limit = parameters_.recording_limit * 1024 * 1024;
  if (limit > 0 && static_cast<double>(saved_bytes_ + bytes.size()) > limit) {
    throw std::runtime_error("what was saved would have more than recording_limit: " +
                             std::to_string(saved_bytes_) + " bytes were written so far");
  }
  write_new(path, bytes);
  saved_bytes_ += bytes.size();
}

bool Services::save_state(SaveState::Request& request, SaveState::Response& response) {
  return answer(response, "save_state", [&] {
    const std::string path = recording_path(recorder_.folder(), request.path, ".state");
    const SavedFrame saved = simulation_.save();
    keep(path, saved.state);
    response.frame = saved.frame;
    return path;
  });
}

bool Services::save_surface(SaveSurface::Request& request, SaveSurface::Response& response) {
  return answer(response, "save_surface", [&] {
    const std::string path = recording_path(recorder_.folder(), request.path, ".ply");
    const ShownSurface shown = simulation_.surface();
    const std::string ply = to_ply(shown.triangles, shown.colours);
    keep(path, {ply.begin(), ply.end()});
    response.frame = shown.frame;
    response.triangles = static_cast<std::int32_t>(shown.colours.size());
    return path;
  });
}

bool Services::restore_state(RestoreState::Request& request, RestoreState::Response& response) {
  return answer(response, "restore_state", [&] {
    const std::string path = recorded_path(recorder_.folder(), request.path, ".state");
    const auto lock = begin_building();
    const LimitWork limit(parameters_.limits());
    std::unique_ptr<Simulation> restored = build_again();
    std::string file;
    try {
      file = read_file(path, most_bytes(restored->save().size()), ReadFrom::kAnywhere);
    } catch (const std::invalid_argument& e) {
      throw std::runtime_error(path + " " + e.what());
    }
    const std::vector<std::uint8_t> bytes(file.begin(), file.end());
    try {
      restored->restore({bytes.data(), bytes.size()});
    } catch (const std::exception& e) {
      throw std::runtime_error(path + ": " + e.what());
    }
    response.frame = restored->frame();
    response.time = restored->time();
    simulation_.restore(std::move(restored), bytes);
    return "frame " + std::to_string(response.frame) + " of scene '" + scene_.name + "'";
  });
}

}  // namespace tissue_sim

// Services that keep the state of a simulation as a file, and go on from one.
#include <ros/console.h>

#include <fstream>
#include <iterator>
#include <stdexcept>

#include "ros/recording_path.h"
#include "ros/service_answer.h"
#include "ros/services.h"

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

std::vector<std::uint8_t> read_all(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::vector<std::uint8_t> bytes((std::istreambuf_iterator<char>(file)),
                                  std::istreambuf_iterator<char>());
  if (file.bad() || !file.is_open()) throw std::runtime_error(path + " cannot be read");
  return bytes;
}

}  // namespace

bool Services::save_state(SaveState::Request& request, SaveState::Response& response) {
  return answer(response, "save_state", [&] {
    const std::string path = recording_path(recorder_.folder(), request.path, ".state");
    const SavedFrame saved = simulation_.save();
    const double needed =
        static_cast<double>(saved.state.size()) + parameters_.recording_reserve * 1024 * 1024;
    if (free_space(path.substr(0, path.rfind('/'))) < needed) {
      throw std::runtime_error("the disk has not enough space left (recording_reserve)");
    }
    write_new(path, saved.state);
    response.frame = saved.frame;
    return path;
  });
}

bool Services::restore_state(RestoreState::Request& request, RestoreState::Response& response) {
  return answer(response, "restore_state", [&] {
    const std::string path = recorded_path(recorder_.folder(), request.path, ".state");
    const std::vector<std::uint8_t> bytes = read_all(path);
    const auto lock = begin_building();
    const LimitWork limit(parameters_.limits());
    auto restored = std::make_unique<Simulation>(scene_);
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

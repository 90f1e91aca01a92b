#include "ros/recording_path.h"

#include <fcntl.h>
#include <stdio.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <stdexcept>

namespace tissue_sim {
namespace {

namespace fs = std::filesystem;

std::string date_and_time() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[64];
  std::strftime(text, sizeof text, "%Y-%m-%d-%H-%M-%S", &local);
  return text;
}

bool there(const fs::path& path) {
  std::error_code error;
  return fs::symlink_status(path, error).type() != fs::file_type::not_found;
}

void refuse(bool wrong, const std::string& name, const std::string& why) {
  if (wrong) throw std::runtime_error("the recording path '" + name + "' " + why);
}

bool inside(const fs::path& folder, const fs::path& path) {
  const fs::path relative = path.lexically_relative(folder);
  return !relative.empty() && *relative.begin() != "..";
}

// The bag's name is part of its path; what is longer than any file system takes fails here, with a
// reason, and not in the recorder.
void check_name(const std::string& name) {
  refuse(name.find('\0') != std::string::npos, name, "contains a null character");
  const fs::path path(name);
  refuse(path.is_absolute(), name,
         "is absolute: give one inside the recording folder (parameter recording_folder)");
  for (const fs::path& part : path) {
    refuse(part == "..", name, "contains '..', which may leave the recording folder");
  }
  refuse(path.filename().empty() || path.filename() == "." || path.filename() == ".bag" ||
             path.filename() == ".state",
         name, "names no file");
}

}  // namespace

std::string recording_path(const std::string& folder, const std::string& name,
                           const std::string& extension) {
  check_name(name.empty() ? "bag" : name);
  std::error_code error;
  fs::create_directories(folder, error);
  const fs::path root = fs::canonical(folder, error);
  if (error || !fs::is_directory(root)) {
    throw std::runtime_error("the recording folder " + folder +
                             " cannot be made: " + (error ? error.message() : "it is a file"));
  }

  fs::path bag = root / (name.empty() ? date_and_time() : name);
  if (bag.extension() != extension) bag += extension;
  if (name.empty()) {  // two in the same second
    const std::string stem = bag.stem().string();
    for (int i = 2; there(bag) || there(bag.string() + ".active"); ++i) {
      bag = root / (stem + "-" + std::to_string(i) + extension);
    }
  }
  // Links are followed before anything is made, so that no folder appears outside either.
  const fs::path parent = fs::weakly_canonical(bag.parent_path(), error);
  refuse(error || (parent != root && !inside(root, parent)), name,
         "leaves the recording folder " + root.string() + " through a link");
  fs::create_directories(parent, error);
  refuse(static_cast<bool>(error), name,
         "needs the folder " + parent.string() + ", which cannot be made: " + error.message());
  bag = parent / bag.filename();
  refuse(there(bag), name, "exists already as " + bag.string() + ": choose another");
  refuse(
      there(bag.string() + ".active"), name,
      "is being recorded, or was left unfinished, as " + bag.string() + ".active: choose another");
  return bag.string();
}

std::string recorded_path(const std::string& folder, const std::string& name,
                          const std::string& extension) {
  check_name(name);
  std::error_code error;
  const fs::path root = fs::canonical(folder, error);
  fs::path path = root / name;
  if (path.extension() != extension) path += extension;
  refuse(error || !fs::is_regular_file(path, error), name,
         "names no file in " + folder + " (parameter recording_folder)");
  path = fs::canonical(path, error);
  refuse(error || !inside(root, path), name,
         "leaves the recording folder " + root.string() + " through a link");
  return path.string();
}

double free_space(const std::string& path) {
  struct statvfs disk;
  if (statvfs(path.c_str(), &disk) != 0) {
    throw std::runtime_error("the disk of " + path +
                             " cannot be asked for its free space: " + std::strerror(errno));
  }
  return static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize);
}

void rename_new(const std::string& from, const std::string& to) {
  if (renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return;
  int error = errno;
  if (error == EINVAL || error == ENOSYS) {  // a file system that cannot exclude overwriting
    error = EEXIST;
    if (!there(to)) error = rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
  }
  if (error != 0) {
    throw std::runtime_error(from + " cannot be renamed to " + to + ": " + std::strerror(error));
  }
}

}  // namespace tissue_sim

#include "scene/read_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

namespace fs = std::filesystem;

const char kElsewhere[] =
    "lies in none of the folders that may be loaded from (parameter load_folders)";

thread_local std::vector<std::string> permitted_folders;

struct OpenFile {
  int number;
  ~OpenFile() {
    if (number >= 0) close(number);
  }
};

[[noreturn]] void refuse(const std::string& why) { throw std::invalid_argument(why); }

[[noreturn]] void refuse_as(int error) {
  if (error == ENOENT || error == ENOTDIR) refuse("does not exist: check the path");
  refuse(std::string("cannot be read (") + std::strerror(error) + "): check its permissions");
}

void check_kind(const struct stat& status) {
  if (S_ISDIR(status.st_mode)) refuse("is no file, but a folder: name a file in it");
  if (!S_ISREG(status.st_mode))
    refuse("is no file, but a pipe, socket or device: give a regular file");
}

bool inside(const fs::path& folder, const fs::path& path) {
  const fs::path relative = path.lexically_relative(folder);
  return !relative.empty() && *relative.begin() != "..";
}

bool inside_any(const std::vector<std::string>& folders, const fs::path& path) {
  return std::any_of(folders.begin(), folders.end(), [&path](const std::string& folder) {
    std::error_code error;
    const fs::path root = fs::canonical(folder, error);
    return !error && inside(root, path);
  });
}

// Of the file that was opened, whatever its name leads to by now: a link may have been exchanged
// since its name was looked at.
void check_folder_of(const OpenFile& file) {
  if (permitted_folders.empty()) return;
  std::error_code error;
  const fs::path opened = fs::read_symlink("/proc/self/fd/" + std::to_string(file.number), error);
  if (error || !inside_any(permitted_folders, opened)) refuse(kElsewhere);
}

}  // namespace

PermitFolders::PermitFolders(std::vector<std::string> folders) {
  permitted_folders = std::move(folders);
}

PermitFolders::~PermitFolders() { permitted_folders.clear(); }

void PermitFolders::check(const std::string& file) const {
  if (permitted_folders.empty()) return;
  std::error_code error;
  const fs::path path = fs::canonical(file, error);
  if (error || !inside_any(permitted_folders, path)) {
    throw std::runtime_error("'" + file.substr(0, 200) + "' " + kElsewhere);
  }
}

std::string read_file(const std::string& path, std::size_t most, ReadFrom from) {
  struct stat status;
  if (stat(path.c_str(), &status) != 0) refuse_as(errno);
  check_kind(status);  // before it is opened: to open a device may do something
  const OpenFile file{open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY)};
  if (file.number < 0) refuse_as(errno);
  if (fstat(file.number, &status) != 0) refuse_as(errno);
  check_kind(status);  // it may have become another meanwhile
  if (from == ReadFrom::kPermitted) check_folder_of(file);
  const auto too_large = [most] {
    refuse("is larger than " + std::to_string(most >> 20) + " MiB: that is too large");
  };
  if (static_cast<std::size_t>(status.st_size) > most) too_large();
  std::string bytes(static_cast<std::size_t>(status.st_size), '\0');
  std::size_t done = 0;
  for (;;) {  // files of /proc say that they are empty: read to the end, whatever the size was
    if (done == bytes.size()) bytes.resize(bytes.size() + 4096);
    const ssize_t count = read(file.number, &bytes[done], bytes.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) refuse_as(errno);
    if (count == 0) break;
    done += static_cast<std::size_t>(count);
    if (done > most) too_large();
    stop_if_asked();
  }
  bytes.resize(done);
  return bytes;
}

}  // namespace tissue_sim

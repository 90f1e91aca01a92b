#include "scene/read_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

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

}  // namespace

std::string read_file(const std::string& path, std::size_t most) {
  struct stat status;
  if (stat(path.c_str(), &status) != 0) refuse_as(errno);
  check_kind(status);  // before it is opened: to open a device may do something
  const OpenFile file{open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY)};
  if (file.number < 0) refuse_as(errno);
  if (fstat(file.number, &status) != 0) refuse_as(errno);
  check_kind(status);  // it may have become another meanwhile
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

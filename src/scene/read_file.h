// Files from outside: only what is a file, and no larger than is sensible.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace tissue_sim {

constexpr std::size_t kLargestScene = std::size_t(8) << 20;   ///< text of a scene [bytes]
constexpr std::size_t kLargestMesh = std::size_t(256) << 20;  ///< file of a mesh [bytes]

enum class ReadFrom { kPermitted, kAnywhere };

/// The bytes of a regular file of at most `most` bytes. Pipes, devices, sockets and folders are
/// neither opened for reading nor waited for. Throws std::invalid_argument with a reason that
/// starts with a verb ("is no file: ...").
std::string read_file(const std::string& path, std::size_t most,
                      ReadFrom from = ReadFrom::kPermitted);

/// While it lives, this thread reads files that lie in these folders or below alone, links
/// followed: what counts is the file that was opened, whatever its name leads to before or after.
/// Without folders each file will do. One at a time.
class PermitFolders {
 public:
  explicit PermitFolders(std::vector<std::string> folders);
  ~PermitFolders();
  PermitFolders(const PermitFolders&) = delete;
  PermitFolders& operator=(const PermitFolders&) = delete;
  /// Throws std::runtime_error for a file elsewhere, there or not, before anything is said of it.
  void check(const std::string& file) const;
};

}  // namespace tissue_sim

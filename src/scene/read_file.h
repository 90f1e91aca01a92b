// Files from outside: only what is a file, and no larger than is sensible.
#pragma once

#include <cstddef>
#include <string>

namespace tissue_sim {

constexpr std::size_t kLargestScene = std::size_t(8) << 20;   ///< text of a scene [bytes]
constexpr std::size_t kLargestMesh = std::size_t(256) << 20;  ///< file of a mesh [bytes]

/// The bytes of a regular file of at most `most` bytes. Pipes, devices, sockets and folders are
/// neither opened for reading nor waited for. Throws std::invalid_argument with a reason that
/// starts with a verb ("is no file: ...").
std::string read_file(const std::string& path, std::size_t most);

}  // namespace tissue_sim

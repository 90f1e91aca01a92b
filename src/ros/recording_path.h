// Where a recording may be written.
#pragma once

#include <string>

namespace tissue_sim {

/// The path of the bag (or other file) that `name` means: below `folder` (which is made if it is
/// missing), with `extension` at the end, free together with its ".active". An empty name is date
/// and time. Throws std::runtime_error for a name that leaves the folder (absolute, "..", through a
/// symbolic link), for a file that exists, and for a folder that cannot be made.
std::string recording_path(const std::string& folder, const std::string& name,
                           const std::string& extension = ".bag");
/// The path of a file there that exists. Throws std::runtime_error for one that does not, or is not
/// in the folder.
std::string recorded_path(const std::string& folder, const std::string& name,
                          const std::string& extension);

/// Space left on the disk that holds `path`, for this user [bytes]; throws std::runtime_error.
double free_space(const std::string& path);

/// Renames without overwriting; throws std::runtime_error.
void rename_new(const std::string& from, const std::string& to);

}  // namespace tissue_sim

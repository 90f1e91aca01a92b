// Where a recording may be written.
#pragma once

#include <string>

namespace tissue_sim {

/// The path of the bag that `name` means: below `folder` (which is made if it is missing), with
/// ".bag" at the end, free together with its ".active". An empty name is date and time. Throws
/// std::runtime_error for a name that leaves the folder (absolute, "..", through a symbolic link),
/// for a file that exists, and for a folder that cannot be made.
std::string recording_path(const std::string& folder, const std::string& name);

/// Space left on the disk that holds `path`, for this user [bytes]; throws std::runtime_error.
double free_space(const std::string& path);

/// Renames without overwriting; throws std::runtime_error.
void rename_new(const std::string& from, const std::string& to);

}  // namespace tissue_sim

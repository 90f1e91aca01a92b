#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include "geometry/mesh.h"
#include "scene/read_file.h"

namespace tissue_sim {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> folders_of(const char* variable) {
  std::vector<fs::path> folders;
  const char* value = std::getenv(variable);
  std::istringstream list(value ? value : "");
  for (std::string folder; std::getline(list, folder, ':');) {
    if (!folder.empty()) folders.emplace_back(folder);
  }
  return folders;
}

std::string shown(const char* variable) {
  const char* value = std::getenv(variable);
  return std::string(variable) + (value && *value ? " (" + std::string(value) + ")" : " (not set)");
}

// The name that a package.xml declares, "" without one.
std::string package_name(const fs::path& folder) {
  std::string xml;
  try {
    xml = read_file((folder / "package.xml").string(), kLargestScene, ReadFrom::kAnywhere);
  } catch (const std::invalid_argument&) {
    return "";
  }
  const std::size_t begin = xml.find("<name>"), end = xml.find("</name>");
  if (begin == std::string::npos || end == std::string::npos || end < begin + 6) return "";
  const std::string name = xml.substr(begin + 6, end - begin - 6);
  const std::size_t first = name.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) return "";
  return name.substr(first, name.find_last_not_of(" \t\r\n") - first + 1);
}

// Packages do not lie within packages, and nothing below a CATKIN_IGNORE counts.
bool find_below(const fs::path& folder, const std::string& package, int depth, fs::path& found) {
  std::error_code error;
  if (fs::exists(folder / "CATKIN_IGNORE", error)) return false;
  if (fs::exists(folder / "package.xml", error)) {
    if (package_name(folder) != package) return false;
    found = folder;
    return true;
  }
  if (depth == 0) return false;
  std::vector<fs::path> children;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    const std::string name = it->path().filename().string();
    if (name.front() != '.' && fs::is_directory(it->path(), ignored))
      children.push_back(it->path());
  }
  std::sort(children.begin(), children.end());  // folders come in no order
  for (const fs::path& child : children) {
    if (find_below(child, package, depth - 1, found)) return true;
  }
  return false;
}

// `what` is what is looked for: "scene package://...".
fs::path find_package(const std::string& package, const std::string& what) {
  std::error_code error;
  fs::path found;
  for (const fs::path& folder : folders_of("ROS_PACKAGE_PATH")) {
    if (package_name(folder / package) == package) return folder / package;
    if (find_below(folder, package, 6, found)) return found;
  }
  for (const fs::path& prefix : folders_of("CMAKE_PREFIX_PATH")) {
    const fs::path share = prefix / "share" / package;
    if (fs::is_directory(share, error)) return share;
  }
  throw std::invalid_argument(what + " is in package " + package + ", which was found neither in " +
                              shown("ROS_PACKAGE_PATH") + " nor in " + shown("CMAKE_PREFIX_PATH") +
                              ": source the setup.bash of its workspace");
}

// Addresses (not plain paths) may have %20 for a blank and so on.
std::string decoded(const std::string& s) {
  std::string result;
  for (std::size_t i = 0; i < s.size(); ++i) {
    const std::string digits = s[i] == '%' ? s.substr(i + 1, 2) : "";
    if (digits.size() == 2 && digits.find_first_not_of("0123456789abcdefABCDEF") == digits.npos) {
      result += static_cast<char>(std::stoi(digits, nullptr, 16));
      i += 2;
    } else {
      result += s[i];
    }
  }
  return result;
}

}  // namespace

std::string resolve_path(const std::string& address, const std::string& kind) {
  const std::string file = "file://", package = "package://", what = kind + " " + address;
  if (address.empty() || address == file) {
    throw std::invalid_argument(kind + " '" + address + "' names no file: give a path");
  }
  if (address.compare(0, file.size(), file) == 0) return decoded(address.substr(file.size()));
  if (address.compare(0, package.size(), package) == 0) {
    const std::string rest = decoded(address.substr(package.size()));
    const std::size_t slash = rest.find('/');
    if (slash == 0 || slash == std::string::npos || slash + 1 == rest.size()) {
      throw std::invalid_argument(what + " names no file: write package://<package>/<file>");
    }
    return (find_package(rest.substr(0, slash), what) / rest.substr(slash + 1)).string();
  }
  if (address.find("://") != std::string::npos) {
    throw std::invalid_argument(what +
                                " cannot be fetched: give a plain path, file:// or package://");
  }
  return address;
}

}  // namespace tissue_sim

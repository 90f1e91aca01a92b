// Where mesh files are looked for.
#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>

#include "geometry/mesh.h"
#include "support/temporary_folder.h"

namespace tissue_sim {
namespace {

std::string reason_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "nothing was thrown";
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// Sets an environment variable for the time of a test.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_(name) {
    if (const char* old = std::getenv(name)) old_ = old;
    setenv(name, value.c_str(), 1);
  }
  ~Variable() {
    if (old_.empty()) {
      unsetenv(name_);
    } else {
      setenv(name_, old_.c_str(), 1);
    }
  }

 private:
  const char* name_;
  std::string old_;
};

TEST(MeshAddress, PlainAndFile) {
  EXPECT_EQ(resolve_path("/a/b c.stl", "mesh"), "/a/b c.stl");
  EXPECT_EQ(resolve_path("b%20c.stl", "mesh"), "b%20c.stl");
  EXPECT_EQ(resolve_path("file:///a/b%20c.stl", "mesh"), "/a/b c.stl");
  EXPECT_TRUE(contains(reason_of([] { resolve_path("", "mesh"); }), "names no file"));
  EXPECT_TRUE(
      contains(reason_of([] { resolve_path("http://a/b.stl", "mesh"); }), "cannot be fetched"));
}

TEST(MeshAddress, IsCalledWhatItIsOf) {
  EXPECT_EQ(
      reason_of([] {
        resolve_path("package://nosuch/a.yaml", "scene");
      }).rfind("scene package://nosuch/a.yaml is in package nosuch, which was found neither", 0),
      0u);
  EXPECT_EQ(reason_of([] {
              resolve_path("http://a/b.yaml", "scene");
            }).rfind("scene http://a/b.yaml cannot be fetched", 0),
            0u);
  EXPECT_EQ(reason_of([] { resolve_path("", "scene"); }).rfind("scene '' names no file", 0), 0u);
}

TEST(MeshAddress, PackagesAreFoundOnTheRosPackagePath) {
  const TemporaryFolder folder;
  const std::string xml = "<package><name> organs </name></package>";
  folder.write("src/repository/organs_folder/package.xml", xml);  // the name counts, not the folder
  const std::string found = folder.path() + "/src/repository/organs_folder/meshes/a.stl";
  {
    const Variable path("ROS_PACKAGE_PATH", "/not/there:" + folder.path() + "/src");
    EXPECT_EQ(resolve_path("package://organs/meshes/a.stl", "mesh"), found);
  }
  {
    const Variable path("ROS_PACKAGE_PATH", folder.path() + "/src/repository/organs_folder");
    EXPECT_EQ(resolve_path("package://organs/meshes/a.stl", "mesh"), found);
    const std::string reason = reason_of([] { resolve_path("package://other/a.stl", "mesh"); });
    EXPECT_TRUE(contains(reason, "package other")) << reason;
    EXPECT_TRUE(contains(reason, "ROS_PACKAGE_PATH (" + folder.path())) << reason;
  }
  EXPECT_TRUE(
      contains(reason_of([] { resolve_path("package://organs", "mesh"); }), "names no file"));
}

TEST(MeshAddress, InstalledPackagesAreFoundOnTheCmakePrefixPath) {
  const TemporaryFolder folder;
  folder.write("share/organs/package.xml", "");
  const Variable ros("ROS_PACKAGE_PATH", "");
  const Variable cmake("CMAKE_PREFIX_PATH", "/not/there:" + folder.path());
  EXPECT_EQ(resolve_path("package://organs/a.stl", "mesh"), folder.path() + "/share/organs/a.stl");
}

}  // namespace
}  // namespace tissue_sim

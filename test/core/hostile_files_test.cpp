// Files that are broken, or meant to break what reads them, are refused with a reason, at once.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <fstream>
#include <thread>

#include "geometry/mesh.h"
#include "geometry/tet_mesh.h"
#include "scene/read_file.h"
#include "support/temporary_folder.h"
#include "support/test_meshes.h"
#include "support/test_scenes.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

std::string binary_ply(const TriangleMesh& mesh, bool big_endian) {
  std::string s = std::string("ply\nformat binary_") + (big_endian ? "big" : "little") +
                  "_endian 1.0\ncomment none\nelement vertex " +
                  std::to_string(mesh.vertices.size()) +
                  "\nproperty double x\nproperty float y\nproperty float z\nproperty uchar red\n"
                  "element face " +
                  std::to_string(mesh.triangles.size()) +
                  "\nproperty list uchar int vertex_indices\nend_header\n";
  const auto add = [&](auto value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    if (big_endian) std::reverse(bytes, bytes + sizeof value);
    s.append(bytes, sizeof value);
  };
  for (const Vec3& v : mesh.vertices) {
    add(v.x());
    add(static_cast<float>(v.y()));
    add(static_cast<float>(v.z()));
    add(std::uint8_t{255});
  }
  for (const auto& t : mesh.triangles) {
    add(std::uint8_t{3});
    for (const int v : t) add(std::int32_t{v});
  }
  return s;
}

std::string off_text(const TriangleMesh& mesh) {
  std::string s = "OFF\n# a box\n" + std::to_string(mesh.vertices.size()) + " " +
                  std::to_string(mesh.triangles.size()) + " 0\n\n";
  for (const Vec3& v : mesh.vertices) {
    s += std::to_string(v.x()) + " " + std::to_string(v.y()) + " " + std::to_string(v.z()) + "\n";
  }
  for (const auto& t : mesh.triangles) {
    s += "3 " + std::to_string(t[0]) + " " + std::to_string(t[1]) + " " + std::to_string(t[2]) +
         " 255 0 0\n";
  }
  return s;
}

const TriangleMesh& box() {
  static const TriangleMesh mesh = box_mesh(Vec3::Zero(), Vec3(0.1, 0.2, 0.3));
  return mesh;
}

TEST(MeshFile, PlyAndOffAreReadAsTextAndBinary) {
  const TemporaryFolder folder;
  for (const std::string& path :
       {folder.write("little.ply", binary_ply(box(), false)),
        folder.write("big.ply", binary_ply(box(), true)), folder.write("a.off", off_text(box()))}) {
    const TriangleMesh mesh = read_mesh(path);
    EXPECT_EQ(mesh.vertices.size(), 8u) << path;
    EXPECT_EQ(mesh.triangles.size(), 12u) << path;
    EXPECT_NEAR(signed_volume(mesh), 0.006, 1e-8) << path;
  }
}

TEST(MeshFile, FacesWithManyCornersAreTriangulatedAsTheyLie) {
  const TemporaryFolder folder;
  // The letter L, 3 of 4 squares: a fan from its first corner would leave it.
  const std::string path = folder.write(
      "l.obj",
      "v 0 2 0\nv 0 0 0\nv 2 0 0\nv 2 1 0 # a comment\nv 1 1 0\nv 1 2 0\nf 1/1 2/2 3 \\\n"
      "4//7 5 -1\n");
  const TriangleMesh mesh = read_mesh(path);
  ASSERT_EQ(mesh.triangles.size(), 4u);
  double area = 0;
  for (const auto& t : mesh.triangles) {
    const Vec3 normal = (mesh.vertices[t[1]] - mesh.vertices[t[0]])
                            .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    EXPECT_GT(normal.z(), 0);
    area += normal.norm() / 2;
  }
  EXPECT_NEAR(area, 3, 1e-12);
}

TEST(MeshFile, AnyPrefixIsReadOrRefused) {
  const TemporaryFolder folder;
  const std::pair<const char*, std::string> files[] = {
      {"t.ply", ply_text(box())},         {"l.ply", binary_ply(box(), false)},
      {"b.ply", binary_ply(box(), true)}, {"t.off", off_text(box())},
      {"t.obj", obj_text(box())},         {"b.stl", binary_stl(box())}};
  int refused = 0;
  for (const auto& [name, bytes] : files) {
    for (std::size_t size = 0; size < bytes.size(); size += 3) {
      const std::string path = folder.write(name, bytes.substr(0, size));
      try {
        read_mesh(path);
      } catch (const std::invalid_argument&) {
        ++refused;
      }
    }
  }
  EXPECT_GT(refused, 500);
}

TEST(MeshFile, WhatCrashedOrHungReadersIsRefusedWithAReason) {
  const TemporaryFolder folder;
  const std::string header = "ply\nformat ascii 1.0\n";
  const std::string triangle =
      "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n";
  const std::pair<std::string, const char*> cases[] = {
      {folder.write("endless.ply", header), "ends within its header"},
      {folder.write("index.ply", header + triangle + "3 0 1 99999999\n"), "vertex 99999999"},
      {folder.write("negative.ply", header + triangle + "3 0 1 -1\n"), "vertex -1"},
      {folder.write("none.ply", header + triangle + "0\n"), "no triangles"},
      {folder.write("cut.ply", header + triangle + "3 0 1"), "ends"},
      {folder.write("many.ply", header + "element vertex 1e18\nproperty float x\nproperty float y\n"
                                         "property float z\nend_header\n"),
       "ends"},
      {folder.write("corners.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n1000000000 0 1 2\n"), "ends"},
      {folder.write("index.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 99999999\n"), "vertex"},
      {folder.write("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999\n"), "vertex"},
      {folder.write("back.obj", "v 0 0 0\nf -1 -2 -9223372036854775808\n"), "vertex"},
      {folder.write("word.obj", "v 0 0 0\nf a b c\n"), "no number"},
  };
  for (const auto& c : cases) {
    const std::string reason = reason_of([&] { read_mesh(c.first); });
    EXPECT_NE(reason.find(c.second), std::string::npos) << c.first << ": " << reason;
  }
}

TEST(TetFile, CellsBeyondTheirListAreRefused) {
  const TemporaryFolder folder;
  const std::string path =
      folder.write("a.vtk",
                   "# vtk DataFile Version 5.1\nx\nASCII\nDATASET UNSTRUCTURED_GRID\n"
                   "POINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 2 4\nOFFSETS int\n"
                   "100 104\nCONNECTIVITY int\n0 1 2 3\nCELL_TYPES 1\n10\n");
  EXPECT_NE(reason_of([&] { read_tets(path); }).find("beyond its list"), std::string::npos);
}

TEST(File, OnlyRegularOnesOfLimitedSizeAreRead) {
  const TemporaryFolder folder;
  const std::string pipe = folder.path() + "/pipe.obj";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const auto begin = std::chrono::steady_clock::now();
  for (const std::string& path : {pipe, std::string("/dev/zero")}) {
    EXPECT_NE(reason_of([&] { load_scene(path); }).find("is no file"), std::string::npos) << path;
    EXPECT_NE(reason_of([&] { read_file(path, 100); }).find("is no file"), std::string::npos);
  }
  EXPECT_NE(reason_of([&] { read_mesh(pipe); }).find("is no file"), std::string::npos);
  const std::string sparse = folder.write("large.stl", "solid");
  ASSERT_EQ(truncate(sparse.c_str(), static_cast<off_t>(kLargestMesh) + 1), 0);
  EXPECT_NE(reason_of([&] { read_mesh(sparse); }).find("larger than"), std::string::npos);
  // Whatever a material file is: it is not opened.
  const std::string obj = obj_text(box());
  const TriangleMesh mesh = read_mesh(folder.write("a.obj", "mtllib pipe.obj\nusemtl a\n" + obj));
  EXPECT_EQ(mesh.triangles.size(), 12u);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  EXPECT_LT(took.count(), 5);
}

TEST(SceneFile, NothingOfAFileThatIsNoSceneIsQuoted) {
  const TemporaryFolder folder;
  for (const char* text : {"root:x:0:0:hunter2:/root:/bin/bash\n", "password: hunter2\n",
                           "- hunter2\n", "hunter2", "a: [hunter2", "? [hunter2]\n: hunter2\n",
                           "*hunter2", "&hunter2 *hunter3", "!!hunter2 {"}) {
    const std::string reason = reason_of([&] { load_scene(folder.write("file", text)); });
    EXPECT_FALSE(reason.empty()) << text;
    EXPECT_EQ(reason.find("hunter"), std::string::npos) << reason;
  }
}

TEST(SceneFile, ValuesOfKnownFieldsAreNotQuotedButTheirPlace) {
  const TemporaryFolder folder;
  const std::pair<const char*, const char*> cases[] = {
      {"name: host\nroot:*:20228:0:hunter2:7:::: 1\n", "line 2, column 1"},
      {"hunter2: a\n", "the scene has an unknown field"},
      {"method: hunter2\n", "method (line 1, column 9): must be one of"},
      {"name: a\ncell_size:  hunter2\n", "cell_size (line 2, column 13): must be a number"},
      {"ground: hunter2\n", "ground is a text (line 1, column 9)"},
      {"bodies: [{pose: {hunter2: 1}}]\n", "bodies[0].pose has an unknown field"},
      {"gravity: [1, 2, hunter2]\n", "gravity (line 1, column 10)"},
      {"name: hunter2\nseed: 1234567\nthreads: 1234567\n", "bodies is empty"},
  };
  for (const auto& c : cases) {
    const std::string reason = reason_of([&] { load_scene(folder.write("file", c.first)); });
    EXPECT_NE(reason.find(c.second), std::string::npos) << reason;
    EXPECT_EQ(reason.find("hunter2"), std::string::npos) << reason;
    EXPECT_EQ(reason.find("1234567"), std::string::npos) << reason;
  }
}

TEST(File, ALinkThatIsExchangedLeadsNowhereElse) {
  const TemporaryFolder inside, outside;
  const std::string mine = inside.write("mine", "mine"), secret = outside.write("secret", "secret");
  const std::string link = inside.path() + "/link", next = inside.path() + "/next";
  ASSERT_EQ(symlink(mine.c_str(), link.c_str()), 0);
  std::atomic<bool> done{false};
  std::thread exchanging([&] {
    for (int i = 0; !done; ++i) {
      if (symlink((i % 2 == 0 ? secret : mine).c_str(), next.c_str()) == 0) {
        std::rename(next.c_str(), link.c_str());
      }
    }
  });
  const PermitFolders folders({inside.path()});
  int read = 0, refused = 0;
  for (int i = 0; i < 4000; ++i) {
    try {
      folders.check(link);
      EXPECT_EQ(read_file(link, 100), "mine");
      ++read;
    } catch (const std::exception& e) {
      EXPECT_NE(std::string(e.what()).find("load_folders"), std::string::npos) << e.what();
      ++refused;
    }
  }
  done = true;
  exchanging.join();
  EXPECT_GT(read, 0);
  EXPECT_GT(refused, 0);
  EXPECT_EQ(read_file(secret, 100, ReadFrom::kAnywhere), "secret");
}

TEST(SceneText, WhatNobodyMeansIsRefused) {
  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n", last = "a0";
  std::string list = "bodies: [{size: &b0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]}";
  for (int i = 1; i < 12; ++i) {
    const std::string before = "b" + std::to_string(i - 1);
    list += ", {size: &b" + std::to_string(i) + " [";
    for (int k = 0; k < 10; ++k) list += (k > 0 ? ", *" : "*") + before;
    list += "]}";
  }
  const std::pair<std::string, const char*> cases[] = {
      {"bodies: [{}]\n---\nbodies: [{}]", "several documents"},
      {std::string(100000, '['), "nests more than"},
      {std::string(100000, '{'), "nests more than"},
      {"---\nbodies: [{}]\n...\nname: b\n", "several documents"},
      {"name: \xff\xff\nbodies: [{}]", "name is no UTF-8"},
      {"bodies: [{name: a\xc3\x28}]", "no UTF-8"},
      {"bodies: [{shape: mesh, mesh: \"\xed\xa0\x80\"}]", "no UTF-8"},
      {",]-]z\n\n,]--ab", ""},  // LoadAll() of yaml-cpp has no end for this
      {list + "]", "bodies[0].size is"},
      {"name: " + std::string(5000, 'a') + "\nbodies: [{}]", "name is a text of 5000"},
      {"bodies: [{name: " + std::string(5000, 'a') + "}]", "must not be longer"},
      {"bodies: [{}]\ntools: [{name: " + std::string(5000, 'a') + "}]", "must not be longer"},
  };
  for (const auto& c : cases) {
    const std::string reason = reason_of([&] { scene_from_yaml(c.first); });
    EXPECT_FALSE(reason.empty());
    EXPECT_NE(reason.find(c.second), std::string::npos) << reason;
    EXPECT_LT(reason.size(), 600u);
  }
  std::string deep;
  for (int i = 0; i < 2000; ++i) deep += "- ";
  EXPECT_NE(reason_of([&] { scene_from_yaml(deep + "a"); }).find("nests"), std::string::npos);
  std::string many = "bodies:\n";
  for (int i = 0; i < 1001; ++i) many += "- {name: b" + std::to_string(i) + "}\n";
  EXPECT_NE(reason_of([&] { scene_from_yaml(many); }).find("at most 1000"), std::string::npos);
}

}  // namespace
}  // namespace tissue_sim

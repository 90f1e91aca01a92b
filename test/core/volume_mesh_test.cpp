// Files of tetrahedra and hexahedra as other programs write them (test/data/volume_meshes: two
// cubes of 20 mm beside each other, a hexahedron and six tetrahedra), and what is broken of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "geometry/surface.h"
#include "geometry/tet_mesh.h"
#include "support/cut_paths.h"
#include "support/temporary_folder.h"
#include "support/test_scenes.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {
namespace {

namespace fs = std::filesystem;

constexpr double kVolume = 1.6e-5;

std::string bytes_of(const std::string& name) {
  std::ifstream file(std::string(TISSUE_SIM_TEST_DATA) + "/volume_meshes/" + name,
                     std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

std::vector<fs::path> files() {
  std::vector<fs::path> all;
  for (const auto& entry : fs::directory_iterator(TISSUE_SIM_TEST_DATA "/volume_meshes")) {
    if (entry.path().filename() != "vtk_lz4.vtu") all.push_back(entry.path());
  }
  std::sort(all.begin(), all.end());
  return all;
}

Body body_of(const std::string& mesh) {
  Body body;
  body.shape = Shape::kMesh;
  body.mesh = mesh;
  return body;
}

std::string joined(const std::vector<std::string>& notes) {
  std::string all;
  for (const std::string& note : notes) all += note + "\n";
  return all;
}

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// What is before the first place replaced, once.
std::string with(std::string text, const std::string& part, const std::string& other) {
  const std::size_t at = text.find(part);
  EXPECT_NE(at, std::string::npos) << part;
  if (at != std::string::npos) text.replace(at, part.size(), other);
  return text;
}

TEST(VolumeMesh, IsReadAsOtherProgramsWriteIt) {
  EXPECT_GE(files().size(), 25u);
  for (const fs::path& path : files()) {
    SCOPED_TRACE(path.string());
    std::vector<std::string> notes;
    const TetMesh mesh = load_tet_file(path.string(), &notes);
    EXPECT_EQ(mesh.vertices.size(), 12u);
    EXPECT_EQ(mesh.tetrahedra.size(), 12u);
    EXPECT_NEAR(volume(mesh), kVolume, 1e-6 * kVolume);
    const std::string said = joined(notes);
    EXPECT_TRUE(has(said, "has 6 tetrahedra, 1 ") && has(said, ", each taken as six tetrahedra"));
    EXPECT_TRUE(has(said, "; left out are 1 triangles")) << said;
    EXPECT_TRUE(has(said, "had 1 inverted tetrahedra")) << said;
    const bool drops_by_itself = path.filename().string().rfind("gmsh", 0) == 0;
    EXPECT_NE(has(said, "left out 1 vertices"), drops_by_itself) << said;
    EXPECT_EQ(notes.size(), drops_by_itself ? 2u : 3u) << said;
  }
}

TEST(VolumeMesh, GmshIsReadInEitherOrderOfBytes) {
  // Version 2 has numbers of 4 bytes, but for coordinates: of 8.
  std::string swapped = bytes_of("gmsh_2.2_binary.msh");
  const auto swap = [&](std::size_t at, std::size_t size) {
    std::reverse(swapped.begin() + static_cast<std::ptrdiff_t>(at),
                 swapped.begin() + static_cast<std::ptrdiff_t>(at + size));
  };
  swap(swapped.find('\n', swapped.find("2.2 1 8")) + 1, 4);
  std::size_t at = swapped.find("$Nodes\n12\n") + 10;
  for (int i = 0; i < 12; ++i, at += 28) {
    swap(at, 4);
    for (int a = 0; a < 3; ++a) swap(at + 4 + 8 * a, 8);
  }
  for (at = swapped.find("$Elements\n8\n") + 12; at < swapped.find("\n$EndElements"); at += 4) {
    swap(at, 4);
  }
  const TemporaryFolder folder;
  EXPECT_NEAR(volume(load_tet_file(folder.write("a.msh", swapped), nullptr)), kVolume, 1e-15);
}

TEST(VolumeMesh, HexahedraHalveFacesAsTheirNeighboursDo) {
  // Eight cubes about one corner, their corners numbered at random.
  for (unsigned seed = 1; seed < 10; ++seed) {
    std::vector<int> number(27);
    for (int i = 0; i < 27; ++i) number[i] = i;
    unsigned random = seed;
    for (int i = 26; i > 0; --i) {
      random = random * 1664525u + 1013904223u;
      std::swap(number[i], number[(random >> 8) % (i + 1)]);
    }
    std::vector<std::string> place(27);
    std::ostringstream text;
    text << "MeshVersionFormatted 2\nDimension 3\nVertices 27\n";
    for (int i = 0; i < 27; ++i) {
      std::ostringstream x;
      x << i % 3 << " " << i / 3 % 3 << " " << i / 9 << " 0\n";
      place[number[i]] = x.str();
    }
    for (const std::string& x : place) text << x;
    text << "Hexahedra 8\n";
    for (int c = 0; c < 8; ++c) {
      const int first = c % 2 + 3 * (c / 2 % 2) + 9 * (c / 4);
      for (const int k : {0, 1, 4, 3, 9, 10, 13, 12}) text << number[first + k] + 1 << " ";
      text << "0\n";
    }
    text << "End\n";
    const TemporaryFolder folder;
    std::vector<std::string> notes;
    const TetMesh mesh = load_tet_file(folder.write("a.mesh", text.str()), &notes);
    EXPECT_NEAR(volume(mesh), 8, 1e-12);
    EXPECT_EQ(boundary(mesh).size(), 48u);
    EXPECT_EQ(joined(notes), "has 8 hexahedra, each taken as six tetrahedra\n");
  }
}

TEST(VolumeMesh, FacesThatNeighboursDoNotShareAreSaid) {
  const TemporaryFolder folder;
  const auto notes_of = [&](const std::string& vertices, const std::string& tetrahedra) {
    const std::string text = "Dimension 3 Vertices " + vertices + " Tetrahedra " + tetrahedra;
    std::vector<std::string> notes;
    load_tet_file(folder.write("a.mesh", text), &notes);
    return joined(notes);
  };
  const std::string corners = "0 0 0 0  1 0 0 0  0 1 0 0  0 0 1 0  0 0 -1 0 ";
  EXPECT_EQ(notes_of("5 " + corners, "2  1 2 3 4 0  1 3 2 5 0"), "");
  EXPECT_EQ(notes_of("5 " + corners, "3  1 2 3 4 0  1 3 2 5 0  2 3 1 4 7"),
            "left out 1 tetrahedra given twice\n");
  // Both above the face that they share.
  EXPECT_TRUE(has(notes_of("5 " + corners + "", "2  1 2 3 4 0  1 2 3 5 0"), "inverted"));
  EXPECT_TRUE(has(notes_of("6 " + corners + "0.3 0.3 2 0", "2  1 2 3 4 0  1 2 3 6 0"),
                  "has 1 faces with two tetrahedra on one side: they overlap"));
  // The same face with corners of its own.
  EXPECT_TRUE(has(notes_of("8 " + corners + "0 0 0 0  1 0 0 0  0 1 0 0", "2  1 2 3 4 0  6 8 7 5 0"),
                  "has 2 faces behind which it goes on"));
  // A square of which each neighbour has other halves.
  const std::string square = "0 0 0 0  1 0 0 0  1 1 0 0  0 1 0 0  0.5 0.5 1 0  0.5 0.5 -1 0 ";
  EXPECT_EQ(notes_of("6 " + square, "4  1 2 3 5 0  1 3 4 5 0  1 3 2 6 0  1 4 3 6 0"), "");
  EXPECT_TRUE(has(notes_of("6 " + square, "4  1 2 3 5 0  1 3 4 5 0  1 4 2 6 0  2 4 3 6 0"),
                  "has 4 faces behind which it goes on"));
}

TEST(VolumeMesh, AnyPrefixIsReadOrRefusedInOneLine) {
  const TemporaryFolder folder;
  for (const fs::path& path : files()) {
    const std::string bytes = bytes_of(path.filename().string());
    for (std::size_t size = 1; size < bytes.size(); size += 29) {
      const std::string cut = folder.write("a" + path.extension().string(), bytes.substr(0, size));
      const std::string reason = reason_of([&] { load_tet_file(cut, nullptr); });
      if (reason == "nothing was thrown") continue;  // all was there before
      EXPECT_EQ(reason.rfind("mesh " + cut + " ", 0), 0u) << reason;
      EXPECT_EQ(reason.find('\n'), std::string::npos) << reason;
    }
  }
}

// As bullet3's data/single_tet.vtk and data/reduced_beam are.
TEST(VolumeMesh, AWrongSizeOfTheCellsAndANarrowHeadAreNoHindrance) {
  const TemporaryFolder folder;
  const std::string path = folder.write("a.vtk",
                                        "#vtk DataFile Version 2.0\n\nASCII\n"
                                        "DATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n0 0 0\n1 0 0\n"
                                        "0 1 0\n0 0 1\n\nCELLS 1 1\n4 0 1 2 3\n\n"
                                        "CELL_TYPES 1\n10\n");
  EXPECT_NEAR(volume(load_tet_file(path, nullptr)), 1.0 / 6, 1e-12);
}

TEST(VolumeMesh, LiesAreRefusedAtOnceWithAReason) {
  const TemporaryFolder folder;
  const std::string vtk = bytes_of("meshio_4.2_binary.vtk"), vtk5 = bytes_of("vtk_5.1_binary.vtk"),
                    msh2 = bytes_of("gmsh_2.2_binary.msh"), msh4 = bytes_of("gmsh_4.1_binary.msh"),
                    text4 = bytes_of("gmsh_4.1_ascii.msh"), raw = bytes_of("vtk_appended_raw.vtu"),
                    deflated = bytes_of("vtk_appended_raw_zlib.vtu"),
                    plain = bytes_of("vtk_ascii.vtu");
  std::string little = vtk;  // sizes of cells in the order of bytes that VTK does not have
  const std::size_t cells = little.find('\n', little.find("CELLS 8")) + 1;
  std::reverse(little.begin() + static_cast<std::ptrdiff_t>(cells),
               little.begin() + static_cast<std::ptrdiff_t>(cells + 4));
  const std::size_t tag = deflated.find("Name=\"connectivity\""),
                    offset = deflated.find("offset=\"", tag) + 8,
                    array = deflated.find('_', deflated.find("<AppendedData")) + 1 +
                            std::stoul(deflated.substr(offset));
  std::string block = deflated, huge = deflated;
  block[array + 50] = static_cast<char>(block[array + 50] ^ 0x55);
  huge.replace(array, 4, "\xff\xff\xff\x07");
  const struct {
    std::string name, bytes, reason;
  } cases[] = {
      {"a.vtk", with(vtk, "POINTS 13", "POINTS 2000000000"), "where a coordinate should be (byte "},
      {"a.vtk", with(vtk, "POINTS 13", "POINTS 1e18"), "has no valid the number of points"},
      {"a.vtk", with(vtk, "CELLS 8", "CELLS 2000000000"), "(byte "},
      {"a.vtk", little, "has a cell of 50331648 corners (byte "},
      {"a.vtk", with(vtk5, "CELLS 9", "CELLS 7"), "(byte "},
      {"a.vtk", with(vtk, "UNSTRUCTURED_GRID", "POLYDATA"), "holds polydata"},
      {"a.vtk", with(vtk, "double", "dubble"), "has numbers of an unknown type (byte "},
      {"a.vtk", "solid a", "is no legacy VTK file"},
      {"a.msh", with(msh2, "$Nodes\n12", "$Nodes\n999999999"), "(byte "},
      {"a.msh", with(msh2, "$Elements\n8", "$Elements\n7"), "(byte "},
      {"a.msh", with(msh2, "2.2 1 8", "4.0 1 8"), "neither 2 nor 4.1"},
      {"a.msh", with(msh2, std::string("2.2 1 8\n\1", 9), "2.2 1 8\n\2"), "bytes' order"},
      {"a.msh", with(msh4, "4.1 1 8", "4.1 1 4"), "(byte "},
      {"a.msh", with(text4, "\n3 2 4 ", "\n3 2 99 "), "has elements of an unknown type 99 (byte "},
      {"a.msh", "hello", "is no Gmsh file"},
      {"a.vtu", with(raw, "LittleEndian", "BigEndian"), "wrong order of its bytes (byte "},
      {"a.vtu", with(raw, "Name=\"connectivity\"", "Name=\"connection\""), "without connectivity"},
      {"a.vtu", with(plain, "NumberOfComponents=\"3\"", "NumberOfComponents=\"2\""), "not 3"},
      {"a.vtu", block, "does not inflate"},
      {"a.vtu", huge, "counts more blocks than it has bytes (byte "},
      {"a.vtu", bytes_of("vtk_lz4.vtu"), "is compressed by vtkLZ4DataCompressor"},
      {"a.vtu", with(plain, "UnstructuredGrid", "PolyData"), "is no VTK file of an"},
      {"a.node", "4 3 0 0\n1 0 0 0\n", "where a vertex's number should be (byte "},
  };
  for (const auto& c : cases) {
    const std::string path = folder.write(c.name, c.bytes);
    const std::string reason = reason_of([&] { load_tet_file(path, nullptr); });
    EXPECT_TRUE(has(reason, c.reason)) << c.reason << ": " << reason;
  }
  const std::string lone = folder.write("lone.ele", "0 4 0\n");
  EXPECT_TRUE(has(reason_of([&] { read_tets(lone); }), "needs " + folder.path() + "/lone.node"));
}

// The material point method fills what the tetrahedra's surface encloses.
TEST(VolumeMesh, IsTakenByEachMethodThatCanAndRefusedWithTheirNames) {
  Scene scene;
  scene.device = Device::kCpu;
  scene.cell_size = 0.005;
  scene.bodies = {body_of(TISSUE_SIM_TEST_DATA "/volume_meshes/gmsh_4.1_binary.msh")};
  scene.bodies[0].pose.position.z() = 0.05;
  for (const Method method : {Method::kMpm, Method::kMls, Method::kPbd}) {
    scene.method = method;
    scene.pbd.model = PbdModel::kTetrahedra;
    const auto tissue = make_tissue(scene);
    double sum = 0;
    for (const Fragment& f : tissue->fragments()) sum += f.volume;
    EXPECT_NEAR(sum, kVolume, 1e-4 * kVolume) << static_cast<int>(method);
    EXPECT_EQ(has(joined(tissue->notes()), "what their surface encloses is filled"),
              method == Method::kMpm);
  }
  scene.pbd.model = PbdModel::kSurface;
  const std::string reason = reason_of([&] { make_tissue(scene); });
  for (const char* name : {"model: tetrahedra", "mls", "mpm", "STL"}) {
    EXPECT_TRUE(has(reason, name)) << reason;
  }
  scene.bodies[0].mesh = "/nowhere/a.fbx";
  EXPECT_TRUE(has(reason_of([&] { load_solid(scene.bodies[0], nullptr); }), "does not exist"));
}

// The table of docs/pbd.md: a row for each of the files that TISSUE_SIM_MESHES names, parted by
// ';', made 0.1 m long, dropped by 10 mm and after a third of a second cut through its middle, by
// each method.
TEST(VolumeMesh, Table) {
  const char* meshes = std::getenv("TISSUE_SIM_MESHES");
  if (meshes == nullptr) GTEST_SKIP() << "TISSUE_SIM_MESHES names no mesh";
  std::istringstream all(meshes);
  for (std::string path; std::getline(all, path, ';');) {
    std::printf("| %s | ", fs::path(path).filename().c_str());
    TetMesh mesh;
    std::vector<std::string> notes;
    const std::string reason = reason_of([&] { mesh = load_tet_file(path, &notes); });
    if (mesh.tetrahedra.empty()) {
      std::printf("%s |\n", reason.c_str());
      continue;
    }
    std::printf("%zu | %.7g |", mesh.tetrahedra.size(), volume(mesh));
    Box box;
    for (const Vec3& v : mesh.vertices) {
      box.min = box.min.cwiseMin(v);
      box.max = box.max.cwiseMax(v);
    }
    Scene scene;
    scene.device = Device::kCpu;
    scene.cell_size = 0.008;
    scene.pbd.model = PbdModel::kTetrahedra;
    scene.bodies = {body_of(path)};
    Body& body = scene.bodies[0];
    body.scale = 0.1 / (box.max - box.min).maxCoeff();
    body.pose.position = -body.scale * (box.min + box.max) / 2;
    body.pose.position.z() = 0.01 - body.scale * box.min.z();
    const double whole = volume(mesh) * std::pow(body.scale, 3);
    for (const Method method : {Method::kMpm, Method::kMls, Method::kPbd}) {
      scene.method = method;
      const std::string failed = reason_of([&] {
        Simulation simulation(scene);
        double sum = 0;
        for (const Fragment& f : simulation.tissue().fragments()) sum += f.volume;
        for (int frame = 0; frame < 20; ++frame) simulation.advance_frame();
        const auto before = simulation.tissue().fragments();
        simulation.cut(plane_cut(before[0].centroid, Vec3::UnitX()));
        simulation.advance_frame();
        std::printf(" %.2g %%, %zu to %zu |", 100 * std::abs(sum / whole - 1), before.size(),
                    simulation.tissue().fragments().size());
      });
      if (failed != "nothing was thrown") std::printf(" %s |", failed.c_str());
      std::fflush(stdout);
    }
    std::printf("\n");
    for (const std::string& note : notes) std::printf("%s\n", note.c_str());
  }
}

TEST(VolumeMesh, InMillimetresFarFromTheOriginInKilopascalIsSaid) {
  Scene scene;
  scene.device = Device::kCpu;
  scene.cell_size = 0.005;
  scene.materials.resize(1);
  scene.materials[0].name = "phantom";
  scene.materials[0].young_modulus = 5;
  const TemporaryFolder folder;
  std::string text =
      "Dimension 3 Vertices 4 200 -300 1200 0 280 -300 1200 0 200 -220 1200 0 200 "
      "-300 1280 0 Tetrahedra 1 1 2 3 4 0";
  scene.bodies = {body_of(folder.write("a.mesh", text))};
  scene.bodies[0].material = "phantom";
  EXPECT_TRUE(has(reason_of([&] { make_tissue(scene); }), "did you forget scale: 0.001?"));
  scene.bodies[0].scale = 0.001;
  std::string said = joined(make_tissue(scene)->notes());
  EXPECT_TRUE(has(said, "lies 1.29 m from the world's origin, 16.1 times its size")) << said;
  EXPECT_TRUE(has(said, "position [-0.24, 0.26, -1.24]")) << said;
  EXPECT_TRUE(has(said,
                  "young_modulus of 5 Pa, softer than any organ: if kPa were meant, it is "
                  "5000"))
      << said;
  scene.bodies[0].pose.position = Vec3(-0.24, 0.26, -1.24);
  scene.materials[0].young_modulus = 5000;
  said = joined(make_tissue(scene)->notes());
  EXPECT_FALSE(has(said, "origin") || has(said, "kPa")) << said;
}

}  // namespace
}  // namespace tissue_sim

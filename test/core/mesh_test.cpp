// Mesh files: found, read, checked and repaired where that can be meant only one way.
#include "geometry/mesh.h"

#include <gtest/gtest.h>

#include <cctype>
#include <functional>

#include "support/temporary_folder.h"
#include "support/test_meshes.h"

namespace tissue_sim {
namespace {

const Vec3 kLow(0, 0, 0), kHigh(0.1, 0.2, 0.3);

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

Body mesh_body(const std::string& path) {
  Body body;
  body.name = "organ";
  body.shape = Shape::kMesh;
  body.mesh = path;
  return body;
}

// The solid that a mesh becomes, and all notes in one text.
struct Repaired {
  TriangleMesh mesh;
  std::string notes;
};
Repaired repaired(TriangleMesh mesh) {
  std::vector<std::string> notes;
  make_solid(mesh, notes);
  Repaired result{mesh, ""};
  for (const std::string& note : notes) result.notes += note + "\n";
  return result;
}

TEST(MeshFile, IsReadInAllFormatsWithVerticesMerged) {
  const TemporaryFolder folder;
  const TriangleMesh box = box_mesh(kLow, kHigh);
  for (const std::string& path :
       {folder.write("a.obj", obj_text(box)), folder.write("a.ply", ply_text(box)),
        folder.write("a.stl", stl_text(box)), folder.write("b.STL", binary_stl(box))}) {
    const TriangleMesh mesh = read_mesh(path);
    EXPECT_EQ(mesh.vertices.size(), 8u) << path;
    EXPECT_EQ(mesh.triangles.size(), 12u) << path;
    EXPECT_NEAR(signed_volume(mesh), 0.006, 1e-8) << path;
  }
}

TEST(MeshFile, IsRefusedWithItsPathAndReason) {
  const TemporaryFolder folder;
  const std::string box = stl_text(box_mesh(kLow, kHigh));
  std::string with_nan = obj_text(box_mesh(kLow, kHigh));
  with_nan.replace(with_nan.find("v 0 0 0"), 7, "v nan 0 0");
  const std::pair<std::string, const char*> cases[] = {
      {folder.path() + "/none.stl", " does not exist"},
      {folder.path(), " is no file"},
      {folder.write("empty.stl", ""), " is empty"},
      {folder.write("a.docx", box), " is of no known format"},
      {folder.write("text.ply", "this is not a mesh\n"), " is no PLY file ("},
      {folder.write("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\np 1 2 3\n"), ""},
      {folder.write("nan.obj", with_nan), " has coordinates that are not finite"},
  };
  for (const auto& c : cases) {
    const std::string reason = reason_of([&] { load_solid(mesh_body(c.first), nullptr); });
    EXPECT_EQ(reason.rfind("body 'organ': mesh " + c.first + c.second, 0), 0u) << reason;
  }
}

TEST(MeshFile, StlIsReadWithBytesAfterItsLastTriangle) {
  const TemporaryFolder folder;
  const TriangleMesh box = box_mesh(kLow, kHigh);
  std::string solid = binary_stl(box), streamed = binary_stl(box);
  solid.replace(0, 12, "solid kidney");  // as many programs begin a binary one
  streamed.replace(80, 4, 4, '\0');      // as those leave it that know the count at the end only
  std::string text = stl_text(box);
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  std::string windows = "\xEF\xBB\xBF" + stl_text(box), normals = stl_text(box);
  for (std::size_t at = 0; (at = windows.find('\n', at)) != std::string::npos; at += 2) {
    windows.replace(at, 1, "\r\n");
  }
  for (std::size_t at = 0; (at = normals.find("normal 0 0 0", at)) != std::string::npos; ++at) {
    normals.replace(at, 12, "normal -nan(ind) -nan(ind) nan");
  }
  std::string named = stl_text(box);
  named.replace(0, 10, "solid vertex of a solid");
  const std::string half = stl_text(box_mesh(kLow, kHigh / 2)), zeros(20, '\0');
  const std::pair<const char*, std::string> cases[] = {
      {"one byte", binary_stl(box) + '\0'},
      {"a triangle's worth of bytes", binary_stl(box) + std::string(50, 'x')},
      {"many bytes", binary_stl(box) + std::string(100000, '\1')},
      {"header solid", solid},
      {"header solid and bytes", solid + "signed by a program"},
      {"no count", streamed},
      {"capitals", text},
      {"capitals, zeros after them", text + zeros},
      {"Windows", windows},
      {"normals that are none", normals},
      {"a name of keywords", named},
  };
  for (const auto& c : cases) {
    const TriangleMesh mesh = read_mesh(folder.write("a.stl", c.second));
    EXPECT_EQ(mesh.vertices.size(), 8u) << c.first;
    EXPECT_EQ(mesh.triangles.size(), 12u) << c.first;
    EXPECT_NEAR(signed_volume(mesh), 0.006, 1e-8) << c.first;
  }
  EXPECT_EQ(read_mesh(folder.write("two.stl", text + half)).triangles.size(), 24u);
}

TEST(MeshFile, StlThatIsCutOffOrNoneSaysSo) {
  const TemporaryFolder folder;
  const std::string binary = binary_stl(box_mesh(kLow, kHigh));
  const std::string text = stl_text(box_mesh(kLow, kHigh));
  const std::size_t last = text.rfind("endloop");
  const std::pair<std::string, const char*> cases[] = {
      {binary.substr(0, 84 + 50 * 7 + 30), "ends after 7 of the 12 triangles"},
      {"solid" + binary.substr(5, 84 + 50 * 7), "ends after 7 of the 12 triangles"},
      {binary.substr(0, 80) + std::string(4, '\0'), "has no triangles"},
      {text.substr(0, last), "ends within facet 12"},
      {text.substr(0, last) + "vertex 0 0 0\n" + text.substr(last), "has 4 corners in facet 12"},
      {"solid\nfacet\nouter loop\nvertex 0 0\nendloop", "has a vertex in facet 1"},
      {"solid\nendsolid\n", "has no triangles"},
      {std::string(200, 'x'), "is no STL file"},
      {"ply", "is no STL file"},
  };
  for (const auto& c : cases) {
    const std::string path = folder.write("a.stl", c.first);
    const std::string reason = reason_of([&] { read_mesh(path); });
    EXPECT_EQ(reason.rfind("mesh " + path + " " + c.second, 0), 0u) << reason;
  }
}

TEST(MeshFile, HasNoVerticesThatNoTriangleUses) {
  const TemporaryFolder folder;
  const std::string path =
      folder.write("a.obj", obj_text(box_mesh(kLow, kHigh)) + "v 1e6 0 0\np 9\n");
  EXPECT_EQ(read_mesh(path).vertices.size(), 8u);
  EXPECT_NO_THROW(load_solid(mesh_body(path), nullptr)) << "of absurd size";
}

TEST(MeshFile, IsNamedByItsFullPathWhenMissing) {
  const std::string reason = reason_of([] { load_solid(mesh_body("nowhere/a.stl"), nullptr); });
  EXPECT_TRUE(contains(reason, std::filesystem::current_path().string() + "/nowhere/a.stl"))
      << reason;
}

TEST(MakeSolid, LeavesASoundMeshAlone) {
  for (const TriangleMesh& mesh : {box_mesh(kLow, kHigh), icosphere(kLow, 0.1, 2), l_shape()}) {
    const Repaired r = repaired(mesh);
    EXPECT_EQ(r.notes, "");
    EXPECT_EQ(r.mesh.triangles, mesh.triangles);
    EXPECT_GT(signed_volume(r.mesh), 0);
  }
  EXPECT_NEAR(signed_volume(l_shape()), 3, 1e-12);
}

TEST(MakeSolid, TurnsAroundWhatIsInsideOut) {
  const TriangleMesh ball = icosphere(Vec3(1, 2, 3), 0.1, 2);
  const Repaired r = repaired(inverted(ball));
  EXPECT_NEAR(signed_volume(r.mesh), signed_volume(ball), 1e-12);
  EXPECT_TRUE(contains(r.notes, "was inside out")) << r.notes;
}

TEST(MakeSolid, TurnsAroundSingleTriangles) {
  TriangleMesh mesh = icosphere(kLow, 0.1, 2);
  const double volume = signed_volume(mesh);
  for (int t : {3, 4, 77}) std::swap(mesh.triangles[t][0], mesh.triangles[t][1]);
  const Repaired r = repaired(mesh);
  EXPECT_NEAR(signed_volume(r.mesh), volume, 1e-15);
  EXPECT_TRUE(contains(r.notes, "had 3 triangles that faced the other way")) << r.notes;
}

TEST(MakeSolid, TakesAllPartsAndSaysSo) {
  const TriangleMesh a = icosphere(Vec3(0, 0, 0), 0.1, 2), b = icosphere(Vec3(1, 0, 0), 0.1, 2);
  const double volume = signed_volume(a) + signed_volume(b);
  Repaired r = repaired(both(a, b));
  EXPECT_NEAR(signed_volume(r.mesh), volume, 1e-12);
  EXPECT_EQ(r.notes, "has 2 separate parts: all are taken\n");
  r = repaired(both(a, inverted(b)));
  EXPECT_NEAR(signed_volume(r.mesh), volume, 1e-12);
  EXPECT_TRUE(contains(r.notes, "had 1 parts inside out")) << r.notes;
}

TEST(MakeSolid, KeepsVoids) {
  const TriangleMesh outer = icosphere(kLow, 0.2, 2), inner = icosphere(kLow, 0.1, 2);
  const double volume = signed_volume(outer) - signed_volume(inner);
  Repaired r = repaired(both(inverted(inner), outer));
  EXPECT_NEAR(signed_volume(r.mesh), volume, 1e-12);
  EXPECT_EQ(r.notes, "has 1 parts within others that face inwards: voids\n");
  // All of it the wrong way: what lies within turns with what is around it.
  r = repaired(both(inner, inverted(outer)));
  EXPECT_NEAR(signed_volume(r.mesh), volume, 1e-12);
  EXPECT_TRUE(contains(r.notes, "was inside out")) << r.notes;
  EXPECT_TRUE(contains(r.notes, "voids")) << r.notes;
  r = repaired(both(inner, outer));
  EXPECT_TRUE(contains(r.notes, "face outwards: they change nothing")) << r.notes;
}

TEST(MakeSolid, LeavesSliversOut) {
  const TriangleMesh ball = icosphere(kLow, 0.1, 2);
  const double volume = signed_volume(ball);
  // A triangle and its back, a needle of single precision's thickness, inside out and within, and a
  // leftover.
  TriangleMesh back;
  back.vertices = {Vec3(0.3, 0, 0), Vec3(0.4, 0, 0), Vec3(0.3, 0.1, 0)};
  back.triangles = {{0, 1, 2}, {0, 2, 1}};
  const TriangleMesh needle = inverted(box_mesh(Vec3(-0.01, -0.01, 0), Vec3(0.01, 0.01, 1e-8)));
  const TriangleMesh leftover = icosphere(Vec3(0.2, 0, 0), 5e-5, 1);
  const Repaired r = repaired(both(both(both(back, needle), ball), leftover));
  EXPECT_EQ(r.notes, "had 3 slivers without volume: left out\n");
  EXPECT_NEAR(signed_volume(r.mesh), volume, 1e-15);
  EXPECT_EQ(r.mesh.triangles.size(), ball.triangles.size());
  EXPECT_EQ(r.mesh.vertices.size(), ball.vertices.size());
  // A thin sheet and a thin vessel are tissue.
  EXPECT_EQ(repaired(both(ball, box_mesh(Vec3(0.3, 0, 0), Vec3(0.4, 0.1, 1e-4)))).notes,
            "has 2 separate parts: all are taken\n");
  EXPECT_EQ(repaired(both(ball, box_mesh(Vec3(0.3, 0, 0), Vec3(0.5, 2e-4, 2e-4)))).notes,
            "has 2 separate parts: all are taken\n");
}

TEST(MakeSolid, RefusesOpenSurfacesWithTheNumberOfOpenEdges) {
  TriangleMesh mesh = box_mesh(kLow, kHigh);
  mesh.triangles.resize(10);  // without the face at high x
  EXPECT_TRUE(contains(reason_of([&] { repaired(mesh); }), "has 4 open edges"));
  mesh = icosphere(kLow, 0.1, 1);
  mesh.triangles.erase(mesh.triangles.begin() + 5);
  EXPECT_TRUE(contains(reason_of([&] { repaired(mesh); }), "has 3 open edges"));
  mesh = box_mesh(kLow, kHigh);
  mesh.triangles.push_back({0, 1, 7});  // a wall inside: one side more at three edges
  EXPECT_TRUE(contains(reason_of([&] { repaired(mesh); }), "open edges"));
}

TEST(MakeSolid, RefusesWhatHasNoInside) {
  // Moebius strip, doubled nowhere: open. A Klein bottle is closed and has no inside.
  constexpr int n = 8;
  TriangleMesh klein;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) klein.vertices.emplace_back(i, j, (3 * i + 5 * j) % 7);
  }
  const auto at = [](int i, int j) {
    if (i == n) return ((n - j) % n);  // glued with a twist
    return i * n + j % n;
  };
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      klein.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      klein.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  const std::string reason = reason_of([&] { repaired(klein); });
  EXPECT_TRUE(contains(reason, "edges whose triangles face both ways")) << reason;
}

TEST(MakeSolid, TakesRepeatedTrianglesOnce) {
  TriangleMesh mesh = box_mesh(kLow, kHigh);
  const auto t = mesh.triangles[4];
  mesh.triangles.push_back({t[1], t[2], t[0]});
  const Repaired r = repaired(mesh);
  EXPECT_EQ(r.mesh.triangles.size(), 12u);
  EXPECT_TRUE(contains(r.notes, "had 1 triangles twice")) << r.notes;
}

TEST(MakeSolid, ClosesHairlineGaps) {
  TriangleMesh mesh;
  const TriangleMesh box = box_mesh(kLow, kHigh);
  double shift = 0;
  for (const auto& t : box.triangles) {  // each triangle with corners of its own, a little off
    const int first = static_cast<int>(mesh.vertices.size());
    for (int v : t) mesh.vertices.push_back(box.vertices[v] + Vec3::Constant(shift += 1e-9));
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  const Repaired r = repaired(mesh);
  EXPECT_EQ(r.mesh.vertices.size(), 8u);
  EXPECT_NEAR(signed_volume(r.mesh), 0.006, 1e-8);
  EXPECT_TRUE(contains(r.notes, "open edges between vertices less than")) << r.notes;
}

TEST(MakeSolid, AcceptsBoxesThatTouchAtAnEdge) {
  TriangleMesh mesh =
      both(box_mesh(Vec3(0, 0, 0), Vec3(1, 1, 1)), box_mesh(Vec3(1, 1, 0), Vec3(2, 2, 1)));
  merge_vertices(mesh, 0);
  EXPECT_EQ(mesh.vertices.size(), 14u);
  EXPECT_NEAR(signed_volume(repaired(mesh).mesh), 2, 1e-12);
}

TEST(LoadSolid, AppliesScaleAndPose) {
  const TemporaryFolder folder;
  Body body =
      mesh_body("file://" + folder.write("a.stl", stl_text(box_mesh(kLow, Vec3(100, 200, 300)))));
  body.scale = 0.001;
  body.pose.position = Vec3(1, 2, 3);
  body.pose.orientation = Quat(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ()));  // x to y, y to -x
  std::vector<std::string> notes;
  const TriangleMesh mesh = load_solid(body, &notes);
  Vec3 low = mesh.vertices[0], high = low;
  for (const Vec3& v : mesh.vertices) {
    low = low.cwiseMin(v);
    high = high.cwiseMax(v);
  }
  EXPECT_LT((low - Vec3(0.8, 2, 3)).norm(), 1e-7);
  EXPECT_LT((high - Vec3(1, 2.1, 3.3)).norm(), 1e-7);
  EXPECT_TRUE(notes.empty());
}

TEST(LoadSolid, NamesBodyAndMeshInItsNotes) {
  const TemporaryFolder folder;
  const std::string path = folder.write("a.stl", stl_text(inverted(box_mesh(kLow, kHigh))));
  std::vector<std::string> notes;
  load_solid(mesh_body(path), &notes);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0], "body 'organ': mesh " + path + " was inside out: turned around");
}

TEST(LoadSolid, RefusesAbsurdSizesAndSuggestsAScale) {
  const TemporaryFolder folder;
  Body body = mesh_body(folder.write("mm.stl", stl_text(box_mesh(kLow, Vec3(100, 50, 60)))));
  std::string reason = reason_of([&] { load_solid(body, nullptr); });
  EXPECT_TRUE(contains(reason, "is 100 m long at scale 1")) << reason;
  EXPECT_TRUE(contains(reason, "did you forget scale: 0.001?")) << reason;
  body = mesh_body(folder.write("m.stl", stl_text(box_mesh(kLow, kHigh))));
  body.scale = 0.001;
  reason = reason_of([&] { load_solid(body, nullptr); });
  EXPECT_TRUE(contains(reason, "did you forget scale: 1?")) << reason;
}

// A mesh of 6.5 m is no organ at scale 1: loaded, for it may be meant, and said.
TEST(LoadSolid, SaysWhereTheScaleMustBeWrong) {
  const TemporaryFolder folder;
  const auto notes_of = [&](double edge, double scale) {
    Body body = mesh_body(folder.write("a.stl", stl_text(box_mesh(kLow, Vec3::Constant(edge)))));
    body.scale = scale;
    std::vector<std::string> notes;
    load_solid(body, &notes);
    return notes.empty() ? "" : notes[0].substr(notes[0].rfind(".stl ") + 5);
  };
  EXPECT_EQ(notes_of(6.5, 1), "is 6.5 m long at scale 1: did you forget scale: 0.01?");
  EXPECT_EQ(notes_of(0.2, 0.01), "is 0.002 m long at scale 0.01: did you forget scale: 1?");
  EXPECT_EQ(notes_of(1.9, 1), "");
  EXPECT_EQ(notes_of(120, 0.001), "");
  EXPECT_EQ(notes_of(4, 0.001), "is 0.004 m long at scale 0.001: did you forget scale: 0.01?");
}

TEST(LoadSolid, RefusesASheetWithoutVolume) {
  const TemporaryFolder folder;
  const std::string path =
      folder.write("sheet.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 3 2\n");
  EXPECT_TRUE(contains(reason_of([&] { load_solid(mesh_body(path), nullptr); }), "no volume"));
}

}  // namespace
}  // namespace tissue_sim

// Sections of a surface (pbd/sections.h): what several blocks of threads may do side by side.
#include "pbd/sections.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <utility>

#include "pbd/pbd_tissue.h"

namespace tissue_sim {
namespace {

Scene ellipsoid(double cell) {
  Scene scene;
  scene.method = Method::kPbd;
  scene.pbd.model = PbdModel::kSurface;
  scene.cell_size = cell;
  scene.bodies.resize(1);
  scene.bodies[0].shape = Shape::kEllipsoid;
  scene.bodies[0].radii = Vec3(0.1, 0.08, 0.07);
  return scene;
}

/// Fails where two constraints of a pass share a vertex, or one has a vertex that another worker
/// has in its hands then. Counts each worker's constraints.
template <class Kind>
void look(const pbd::ConstraintSet<Kind>& set, const std::vector<std::int16_t>& pass,
          const pbd::Sections& sections, int first, int end, std::vector<int>& load) {
  ASSERT_EQ(pass.size(), set.vertices.size());
  std::set<std::pair<int, std::int32_t>> taken;
  for (int c = 0; c < set.size(); ++c) {
    EXPECT_GE(pass[c], first);
    EXPECT_LT(pass[c], end);
    const auto& owner = sections.owner[static_cast<int>(sections.phase_of(pass[c]))];
    const int worker = owner[set.vertices[c][0]];
    ASSERT_GE(worker, 0);
    ++load[worker];
    for (const std::int32_t v : set.vertices[c]) {
      EXPECT_EQ(owner[v], worker) << "constraint " << c;
      EXPECT_TRUE(taken.insert({pass[c], v}).second) << "constraint " << c;
    }
  }
}

TEST(Sections, WorkersShareNoVertexAndHaveAboutAsMuchToDo) {
  PbdTissue tissue(ellipsoid(0.0075));
  const pbd::State& s = tissue.state();
  const pbd::Sections sections = pbd::find_sections(s, 4);
  ASSERT_EQ(sections.count, 4);
  EXPECT_TRUE(std::is_sorted(sections.first, sections.first + 6));
  for (const auto& owner : sections.owner) {
    ASSERT_EQ(owner.size(), s.vertices.reference.size());
    for (const int worker : owner) ASSERT_TRUE(worker >= 0 && worker < 4);
  }
  std::vector<int> links(4, 0), bends(4, 0);
  look(s.links, sections.link_pass, sections, sections.first[0], sections.first[3], links);
  look(s.bends, sections.bend_pass, sections, sections.first[3], sections.first[5], bends);
  // Seams are one fewer: the last worker has none. Of internal links, what hangs together stays so.
  EXPECT_LT(*std::max_element(bends.begin(), bends.end()), 0.31 * s.bends.size());
  EXPECT_LT(*std::max_element(links.begin(), links.end()), 0.45 * s.links.size());
  // Shared out over both phases, bends take hardly more passes than they have colours at once.
  EXPECT_LE(sections.first[5] - sections.first[3], 1.5 * s.bends.colours);
}

TEST(Sections, ASurfaceOfAFewEdgesHasNone) {
  PbdTissue tissue(ellipsoid(0.06));
  EXPECT_EQ(pbd::find_sections(tissue.state(), 8).count, 0);
}

}  // namespace
}  // namespace tissue_sim

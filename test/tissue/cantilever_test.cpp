// Tip deflection of a cantilever under its own weight against Timoshenko's theory.
#include "support/cantilever.h"

#include <gtest/gtest.h>

#include "support/measured.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

TEST(BeamTheory, IsTheTextbooks) {
  const Beam b{2, 0.1, 0.05, 1e9, 0.25, 1000};  // w = 50 N/m, EI = 4166.7 N m^2
  EXPECT_NEAR(tip_deflection(b, 10), 0.024 + 5.9e-5, 1e-6);
}

class Cantilever : public EachMethod {
 protected:
  Bend sag(double nu, int cells, const std::string& curve = "") const {
    const Beam beam = soft_beam(8, nu);
    // Nodes without a mesh: as many over the height as another method has cells, two to a cell
    // here.
    if (GetParam().method == Method::kMls) cells /= 2;
    Scene scene = on_this(beam_scene(beam, cells, true));
    scene.mls.spacing = 0;
    return bend(scene, beam, curve);
  }
};
FOR_EACH_METHOD(Cantilever);

TEST_P(Cantilever, SagsAsTimoshenkoSays) {
  for (const double nu : {0.0, 0.3}) {
    const Bend b = sag(nu, 8);
    EXPECT_TRUE(is_within(nu == 0 ? "sag of a cantilever, 8 cells, nu 0" : "the same, nu 0.3",
                          b.error(), within().beam));
  }
}

// No point lies in such an anchor, and no tissue beyond its face.
TEST_P(Cantilever, HeldAtItsOwnFaceSagsAlike) {
  const Beam beam = soft_beam(8, 0);
  const bool is_mls = GetParam().method == Method::kMls;
  Scene scene = on_this(beam_scene(beam, is_mls ? 4 : 8, true));
  scene.mls.spacing = 0;
  Body& body = scene.bodies[0];
  body.size.x() = beam.length;
  body.pose.position.x() = beam.length / 2;
  body.anchors.resize(1);
  body.anchors[0].max.x() = 0;
  EXPECT_TRUE(
      is_within("the same, held at its own face", bend(scene, beam).error(), within().beam));
}

// The clamp keeps the section from narrowing, which the theory of beams does not know: a part of
// what is missing here.
TEST_P(Cantilever, NearlyIncompressible) {
  EXPECT_TRUE(is_within("the same, nu 0.49", sag(0.49, 8).error(), within().beam_no_locking));
}

// At nu = 0 the clamp does not squeeze the section, so the theory is exact.
TEST_P(Cantilever, ConvergesWithResolution) {
  const bool is_mpm = GetParam().method == Method::kMpm && GetParam().device == Device::kCpu;
  CurveFile file(is_mpm ? "cantilever" : "", "cells,error");
  const double coarse = std::fabs(sag(0, 4).error());
  const double fine = std::fabs(sag(0, 8, is_mpm ? "cantilever_shape" : "").error());
  file.add({4, coarse});
  file.add({8, fine});
  EXPECT_TRUE(is_at_least("error at 4 cells over that at 8, nu 0", coarse / fine,
                          within().beam_convergence));
}

}  // namespace
}  // namespace tissue_sim

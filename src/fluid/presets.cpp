// Fluids of the operating table. The sources are named from memory and not yet looked up.
// Compressibility is none of theirs: Fluid::bulk_modulus says why.
#include "tissue_sim/fluid.h"

namespace tissue_sim {

const std::vector<Fluid>& fluid_presets() {
  static const std::vector<Fluid> presets = {
      // At 37 C: 993 kg/m^3, 0.69 mPa s (IAPWS-95).
      {"water", 993, 0.00069, 0, Vec3(0.55, 0.75, 0.95)},
      // 0.9 % sodium chloride at 37 C: 1000 kg/m^3, 0.70 mPa s (Kestin et al., J. Phys. Chem. Ref.
      // Data 10:71, 1981).
      {"saline", 1000, 0.0007, 0, Vec3(0.6, 0.78, 0.95)},
      // Of human gallbladders: 1.0 to 1.04 of water's density; 1.8 mPa s of healthy ones (Luo et
      // al., World J. Gastroenterol. 13:1384, 2007).
      {"bile", 1010, 0.0018, 0, Vec3(0.55, 0.5, 0.1)},
      // At a haematocrit of 45 % and high shear, 37 C: 1060 kg/m^3, 3.5 mPa s (Fung, Biomechanics:
      // Mechanical Properties of Living Tissues, 1993). Its shear thinning is left out.
      {"blood", 1060, 0.0035, 0, Vec3(0.6, 0.05, 0.05)},
  };
  return presets;
}

}  // namespace tissue_sim

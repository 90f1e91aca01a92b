// The options of method pbd.
#pragma once

#include "scene/method_options.h"

namespace tissue_sim {

extern const MethodOptions kPbdOptions;

}  // namespace tissue_sim

// The options of method mpm.
#pragma once

#include "scene/method_options.h"

namespace tissue_sim {

extern const MethodOptions kMpmOptions;

}  // namespace tissue_sim

// The options of method mls.
#pragma once

#include "scene/method_options.h"

namespace tissue_sim {

extern const MethodOptions kMlsOptions;

}  // namespace tissue_sim

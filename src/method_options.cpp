// The table of methods' options.
#include "scene/method_options.h"

#include <algorithm>

#include "mls/options.h"
#include "mpm/options.h"
#include "pbd/options.h"

namespace tissue_sim {

const std::vector<const MethodOptions*>& method_options() {
  static const std::vector<const MethodOptions*> all = {&kMpmOptions, &kMlsOptions, &kPbdOptions};
  return all;
}

const MethodOptions& options_of(Method method) {
  const auto& all = method_options();
  return **std::find_if(all.begin(), all.end(),
                        [&](const MethodOptions* of) { return of->method == method; });
}

}  // namespace tissue_sim

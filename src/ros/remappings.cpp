#include "ros/remappings.h"

namespace tissue_sim {

std::vector<std::string> useless_remappings(const std::string& node,
                                            const std::set<std::string>& tools,
                                            const std::map<std::string, std::string>& remappings) {
  static const std::set<std::string> kTopics = {"measured_cp",      "jaw/measured_js",
                                                "body/measured_cf", "spatial/measured_cf",
                                                "grip_pressure",    "grip"};
  std::set<std::string> wrong;
  const std::string prefix = node + "/";
  for (const auto& remapping : remappings) {
    const std::string& from = remapping.first;
    if (from.compare(0, prefix.size(), prefix) != 0) continue;
    const std::size_t slash = from.find('/', prefix.size());
    if (slash == std::string::npos || kTopics.count(from.substr(slash + 1)) == 0) continue;
    const std::string tool = from.substr(prefix.size(), slash - prefix.size());
    if (tools.count(tool) == 0 && tool != "unused") wrong.insert(tool);
  }
  std::string known;
  for (const std::string& tool : tools) known += (known.empty() ? "" : ", ") + tool;
  std::vector<std::string> warnings;
  for (const std::string& tool : wrong) {
    warnings.push_back(
        "topics of '" + tool + "' are remapped (tool_1, tool_2 of simulator.launch), " +
        "but the scene has no such tool; it has " + (known.empty() ? "none" : known));
  }
  return warnings;
}

}  // namespace tissue_sim

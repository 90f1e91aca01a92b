// Remappings that reach no tool.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

namespace tissue_sim {

/// What there is to say of the `remappings` (from a resolved name to another) of topics below the
/// node `node` that would be a tool's, if the scene had a tool of that name: a misspelt name, or
/// tool_1 and tool_2 of simulator.launch for another scene. One line for each name; none for the
/// name "unused", which says that it is meant.
std::vector<std::string> useless_remappings(const std::string& node,
                                            const std::set<std::string>& tools,
                                            const std::map<std::string, std::string>& remappings);

}  // namespace tissue_sim

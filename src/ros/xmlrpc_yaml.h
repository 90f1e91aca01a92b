// Trees of ROS parameters as YAML text, so that they pass the same checks as a file.
#pragma once

#include <xmlrpcpp/XmlRpcValue.h>

#include <string>

namespace tissue_sim {

/// In YAML's flow style, numbers with all their digits, strings quoted.
std::string yaml_from(XmlRpc::XmlRpcValue& value);

}  // namespace tissue_sim

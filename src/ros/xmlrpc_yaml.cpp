#include "ros/xmlrpc_yaml.h"

#include <cstdio>
#include <stdexcept>

namespace tissue_sim {
namespace {

// Double-quoted, so that no text is taken for a number or a boolean.
std::string in_quotes(const std::string& s) {
  std::string result = "\"";
  for (const char c : s) {
    char escaped[8];
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      std::snprintf(escaped, sizeof escaped, "\\x%02x", c);
      result += escaped;
    } else {
      result += c;
    }
  }
  return result + "\"";
}

}  // namespace

std::string yaml_from(XmlRpc::XmlRpcValue& value) {
  char number[40];
  std::string list;
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeBoolean:
      return static_cast<bool&>(value) ? "true" : "false";
    case XmlRpc::XmlRpcValue::TypeInt:
      return std::to_string(static_cast<int&>(value));
    case XmlRpc::XmlRpcValue::TypeDouble:
      std::snprintf(number, sizeof number, "%.17g", static_cast<double&>(value));
      return number;
    case XmlRpc::XmlRpcValue::TypeString:
      return in_quotes(static_cast<std::string&>(value));
    case XmlRpc::XmlRpcValue::TypeArray:
      for (int i = 0; i < value.size(); ++i) list += (i ? ", " : "") + yaml_from(value[i]);
      return "[" + list + "]";
    case XmlRpc::XmlRpcValue::TypeStruct:
      for (auto& member : value) {
        list +=
            (list.empty() ? "" : ", ") + in_quotes(member.first) + ": " + yaml_from(member.second);
      }
      return "{" + list + "}";
    default:
      throw std::invalid_argument(
          "a parameter of the scene is a date or binary data: give numbers, texts, lists or maps");
  }
}

}  // namespace tissue_sim

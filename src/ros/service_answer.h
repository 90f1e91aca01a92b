// How services answer: what goes wrong becomes the answer.
#pragma once

#include <ros/console.h>

#include <exception>

namespace tissue_sim {

/// `work` returns the message of an answer that is success, or throws that of one that is none.
template <class Response, class Work>
bool answer(Response& response, const char* service, Work work) {
  try {
    response.message = work();
    response.success = true;
  } catch (const std::exception& e) {
    response.message = e.what();
    response.success = false;
  } catch (...) {
    response.message = "it cannot be done";
    response.success = false;
  }
  if (!response.success) ROS_WARN("%s refused: %s", service, response.message.c_str());
  return true;
}

}  // namespace tissue_sim

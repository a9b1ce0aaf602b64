// The caller's message callback.
#pragma once

#include <string>

#include "runtime/include/lightloom.h"

namespace lightloom {

struct Messages {
  lightloom_message_fn function = nullptr;
  void* user = nullptr;

  void send(lightloom_message_kind kind, std::string text) const {
    if (function == nullptr) return;
    for (char& c : text) {
      if (c == '\n') c = ' ';
    }
    function(user, kind, text.c_str());
  }
};

}  // namespace lightloom

// User errors: bad arguments or bad input. Every `what()` is one sentence that says what is wrong, where, and what to
// do. Only main() turns it into exit status 2.
#pragma once

#include <stdexcept>

namespace tessera {

class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace tessera

// What the pure sessions of stages ask of their wiring, besides publishing values.
//
// A session (tracking/tracker_session.h, mapping/mapper_session.h, ...) turns inputs into a list of actions. An action
// is a std::variant of the values that are to be published and of these.
#pragma once

#include <string>

namespace tessera {

// The replica of the map does not follow any more, for this reason: a snapshot is needed.
struct RejectMap {
  std::string reason;
};

// The process ends with this sentence.
struct Fail {
  std::string sentence;
  bool is_user_error = false;  // exit status 2, not 1
};

// The last value has been published.
struct Finish {};

// std::visit(Overloaded{[](const A&) {}, [](const B&) {}}, variant)
template <class... Handlers>
struct Overloaded : Handlers... {
  using Handlers::operator()...;
};
template <class... Handlers>
Overloaded(Handlers...) -> Overloaded<Handlers...>;

}  // namespace tessera

// How functions tell an expected failure, everywhere in this project.
//
//   Result<Map> ReadMap(ByteView bytes);     // a map, or the problem
//   Result<> Check(const Options& options);  // nothing to give but the verdict
//
// Bytes that do not decode, options that make no sense, a delta that does not fit: whoever calls must expect these, so
// they are returned, and [[nodiscard]] by type. A problem is one sentence without a full stop that says what is wrong
// and, where a caller higher up knows better where it came from, is prefixed by it. What the user did wrong ends in an
// InputError (core/errors.h), thrown where a process or a tool begins; a broken contract between our own functions is
// a std::logic_error. Only main turns exceptions into an exit status.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace tessera {

struct Problem {
  std::string sentence;

  bool operator==(const Problem&) const = default;
};

template <class T = void>
using Result = tl::expected<T, Problem>;

// return Failed("its scale is out of range");
inline tl::unexpected<Problem> Failed(std::string sentence) { return tl::unexpected(Problem{std::move(sentence)}); }

// The verdict on one condition.
inline Result<> Require(bool holds, const char* sentence) {
  if (holds) return {};
  return Failed(sentence);
}

// Where a problem ends: ThrowIfFailed<InputError>(options.Check(), "tracker: ") throws the sentence behind the prefix.
template <class Exception>
void ThrowIfFailed(const Result<>& result, const std::string& prefix = "") {
  if (!result) throw Exception(prefix + result.error().sentence);
}

}  // namespace tessera

// Returns the problem of `expression`, a Result, to this function's caller, if it has one.
#define TESSERA_RETURN_IF_FAILED(expression)                                                   \
  do {                                                                                         \
    if (auto&& tessera_result = (expression); !tessera_result)                                 \
      return ::tl::unexpected(std::forward<decltype(tessera_result)>(tessera_result).error()); \
  } while (false)

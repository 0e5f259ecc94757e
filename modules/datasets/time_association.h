// Which images of two cameras that aren't triggered together belong to each other.
#pragma once

#include <cstdint>
#include <vector>

namespace tessera {

// By time of `times`, the index of the one of `others` that belongs to it, or -1: the two are each other's nearest (the
// earlier of two as near) and at most max_gap apart; so none is used twice. Both are in ascending order.
std::vector<int64_t> AssociateTimes(const std::vector<int64_t>& times, const std::vector<int64_t>& others,
                                    int64_t max_gap);

}  // namespace tessera

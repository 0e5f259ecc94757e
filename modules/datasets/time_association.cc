#include "datasets/time_association.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>

namespace tessera {
namespace {

// Of a list that isn't empty.
size_t Nearest(const std::vector<int64_t>& times, int64_t time) {
  const auto after = std::lower_bound(times.begin(), times.end(), time);
  if (after == times.begin()) return 0;
  const auto before = std::prev(after);
  const bool is_before_nearer = after == times.end() || time - *before <= *after - time;
  return static_cast<size_t>((is_before_nearer ? before : after) - times.begin());
}

}  // namespace

std::vector<int64_t> AssociateTimes(const std::vector<int64_t>& times, const std::vector<int64_t>& others,
                                    int64_t max_gap) {
  std::vector<int64_t> associated(times.size(), -1);
  if (others.empty()) return associated;
  for (size_t i = 0; i < times.size(); ++i) {
    const size_t j = Nearest(others, times[i]);
    if (std::abs(others[j] - times[i]) <= max_gap && Nearest(times, others[j]) == i) {
      associated[i] = static_cast<int64_t>(j);
    }
  }
  return associated;
}

}  // namespace tessera

// The one definition of a quantile.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace tessera {

// Quantile q, 0 to 1, of n > 0 values in rising order: the value at index (n - 1) q, interpolated linearly.
template <class Number>
double Quantile(const std::vector<Number>& sorted, double q) {
  const double position = q * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<size_t>(position);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  const double fraction = position - static_cast<double>(below);
  return (1.0 - fraction) * static_cast<double>(sorted[below]) + fraction * static_cast<double>(sorted[above]);
}

// The value at index n q of n > 0 values in rising order, rounded down: one of them.
inline double OrderStatistic(std::vector<double> values, double q) {
  const auto at = values.begin() + static_cast<ptrdiff_t>(q * static_cast<double>(values.size()));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace tessera

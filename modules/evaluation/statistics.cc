#include "evaluation/statistics.h"

#include <algorithm>
#include <numeric>

namespace tessera {
namespace {

double Quantile(const std::vector<double>& sorted, double q) {
  const double position = q * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<size_t>(position);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  const double fraction = position - static_cast<double>(below);
  return (1.0 - fraction) * sorted[below] + fraction * sorted[above];
}

}  // namespace

std::optional<Statistics> Summarize(std::vector<double> values) {
  if (values.empty()) {
    return std::nullopt;
  }
  std::sort(values.begin(), values.end());
  Statistics statistics;
  statistics.count = static_cast<int64_t>(values.size());
  statistics.mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  statistics.median = Quantile(values, 0.5);
  statistics.p95 = Quantile(values, 0.95);
  statistics.p99 = Quantile(values, 0.99);
  statistics.max = values.back();
  return statistics;
}

}  // namespace tessera

#include "evaluation/statistics.h"

#include <algorithm>
#include <numeric>

#include "core/quantile.h"

namespace tessera {

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

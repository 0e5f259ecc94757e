// Summary statistics of measurements, the same everywhere.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace tessera {

// In the unit of the values.
struct Statistics {
  int64_t count = 0;
  double mean = 0.0;
  double median = 0.0;
  double p95 = 0.0;  // 95 % of the values are at most this
  double p99 = 0.0;
  double max = 0.0;
};

// Quantiles are those of core/quantile.h. nullopt if there are no values.
std::optional<Statistics> Summarize(std::vector<double> values);

}  // namespace tessera

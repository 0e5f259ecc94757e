#include "features/feature_types.h"

namespace tessera {

std::string FeatureOptions::Check() const {
  const auto check = [](const char* name, int value, int lowest, int highest) {
    if (value >= lowest && value <= highest) return std::string();
    return std::string(name) + " = " + std::to_string(value) + " is not between " + std::to_string(lowest) + " and " +
           std::to_string(highest);
  };
  for (const std::string& error :
       {check("num_features", num_features, 1, 50000), check("num_levels", num_levels, 1, kMaxLevels),
        check("min_score", min_score, 1, 254), check("max_disparity_px", max_disparity_px, 1, 1024)}) {
    if (!error.empty()) return error;
  }
  return "";
}

}  // namespace tessera

#include "features/feature_types.h"

namespace tessera {

namespace {

Result<> CheckRange(const char* name, int value, int lowest, int highest) {
  if (value >= lowest && value <= highest) return {};
  return Failed(std::string(name) + " = " + std::to_string(value) + " is not between " + std::to_string(lowest) +
                " and " + std::to_string(highest));
}

}  // namespace

Result<> FeatureOptions::Check() const {
  TESSERA_RETURN_IF_FAILED(CheckRange("num_features", num_features, 1, kMaxFeatures));
  TESSERA_RETURN_IF_FAILED(CheckRange("num_levels", num_levels, 1, kMaxLevels));
  TESSERA_RETURN_IF_FAILED(CheckRange("min_score", min_score, 1, kMaxScore));
  return CheckRange("max_disparity_px", max_disparity_px, 1, kMaxDisparityPx);
}

}  // namespace tessera

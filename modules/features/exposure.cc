#include "features/exposure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

namespace tessera {
namespace {

constexpr int kNumValues = 256;
constexpr int kRowStep = 4;         // a quarter of the rows tells the brightness
constexpr int kNumQuantiles = 19;   // 0.05, 0.10 ... 0.95
constexpr int kMinQuantiles = 5;    // that aren't clipped
constexpr int kBlack = 3;           // what is darker, ...
constexpr int kWhite = 252;         // ... or brighter, may be clipped
constexpr double kMinSpread = 4.0;  // standard deviation of an image's quantiles: less says nothing of a gain
constexpr double kMaxGain = 5.0;    // more would show noise only
// What each camera sees beyond the other's edge makes the gain another by up to 1.15 (EuRoC), and windows match up to
// here as they are.
constexpr double kMinGain = 1.2;

using Quantiles = std::array<int, kNumQuantiles>;

Quantiles QuantilesOf(const GrayImage& image) {
  std::array<int64_t, kNumValues> counts{};
  int64_t num_pixels = 0;
  for (int y = 0; y < image.height; y += kRowStep) {
    for (int x = 0; x < image.width; ++x) ++counts[image.row(y)[x]];
    num_pixels += image.width;
  }
  Quantiles quantiles{};
  int64_t num_below = 0;
  int value = 0;
  for (int i = 0; i < kNumQuantiles; ++i) {
    const int64_t wanted = num_pixels * (i + 1) / (kNumQuantiles + 1);
    while (value < kNumValues - 1 && num_below + counts[static_cast<size_t>(value)] <= wanted) {
      num_below += counts[static_cast<size_t>(value++)];
    }
    quantiles[static_cast<size_t>(i)] = value;
  }
  return quantiles;
}

struct Brightness {
  double mean = 0.0;
  double spread = 0.0;  // standard deviation
};

// Of those quantiles that are clipped in neither image; nullopt if these are few.
std::optional<Brightness> BrightnessOf(const Quantiles& quantiles, const Quantiles& other) {
  const auto is_clipped = [](int value) { return value < kBlack || value > kWhite; };
  double num = 0.0, sum = 0.0, sum_squares = 0.0;
  for (size_t i = 0; i < quantiles.size(); ++i) {
    if (is_clipped(quantiles[i]) || is_clipped(other[i])) continue;
    const double value = quantiles[i];
    num += 1.0;
    sum += value;
    sum_squares += value * value;
  }
  if (num < kMinQuantiles) return std::nullopt;
  const double mean = sum / num;
  return Brightness{mean, std::sqrt(std::max(0.0, sum_squares / num - mean * mean))};
}

}  // namespace

void MatchExposure(const GrayImage& left, GrayImage& right) {
  if (left.empty() || right.empty()) return;
  const Quantiles left_quantiles = QuantilesOf(left), right_quantiles = QuantilesOf(right);
  const std::optional<Brightness> wanted = BrightnessOf(left_quantiles, right_quantiles);
  const std::optional<Brightness> seen = BrightnessOf(right_quantiles, left_quantiles);
  if (!wanted || !seen || wanted->spread < kMinSpread || seen->spread < kMinSpread) return;
  const double gain = std::clamp(wanted->spread / seen->spread, 1.0 / kMaxGain, kMaxGain);
  if (gain > 1.0 / kMinGain && gain < kMinGain) return;
  std::array<uint8_t, kNumValues> matched{};
  for (size_t value = 0; value < matched.size(); ++value) {
    const double brightness = wanted->mean + gain * (static_cast<double>(value) - seen->mean);
    matched[value] = static_cast<uint8_t>(std::clamp(std::round(brightness), 0.0, 255.0));
  }
  for (uint8_t& pixel : right.pixels) pixel = matched[pixel];
}

}  // namespace tessera

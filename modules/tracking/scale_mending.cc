#include "tracking/scale_mending.h"

#include <algorithm>
#include <cmath>

#include "core/quantile.h"

namespace tessera {
namespace {

constexpr int kNumInARow = 5;  // such steps
constexpr size_t kAround = 5;  // steps before and after one, of whose logarithms the median is taken

// Of every step: told by the ground, or in between on a straight line from the last that is to the next one.
std::vector<double> GroundSpeeds(const std::vector<GroundStep>& steps) {
  std::vector<double> speeds(steps.size());
  std::optional<size_t> before;
  for (size_t i = 0; i < steps.size(); ++i) {
    if (!steps[i].log_ground_speed) continue;
    const double here = *steps[i].log_ground_speed, there = before ? speeds[*before] : here;
    const size_t first = before ? *before + 1 : 0;
    const double change = (here - there) / static_cast<double>(i + 1 - first);
    for (size_t k = first; k <= i; ++k) speeds[k] = there + change * static_cast<double>(k + 1 - first);
    before = i;
  }
  for (size_t k = before ? *before + 1 : 0; before && k < steps.size(); ++k) speeds[k] = speeds[*before];
  return speeds;
}

double Median(const std::vector<double>& values, size_t begin, size_t end) {
  const auto at = [&](size_t i) { return values.begin() + static_cast<std::ptrdiff_t>(i); };
  return OrderStatistic({at(begin), at(end)}, 0.5);
}

}  // namespace

size_t NumSound(const std::vector<GroundStep>& steps, double log_height) {
  int num_in_a_row = 0;
  size_t num_sound = 0;
  for (size_t i = steps.size(); i-- > 0 && num_in_a_row < kNumInARow;) {
    if (!steps[i].log_ground_speed) continue;
    const double difference = steps[i].log_map_speed - *steps[i].log_ground_speed - log_height;
    num_in_a_row = std::abs(difference) < kNearHeight ? num_in_a_row + 1 : 0;
    if (num_in_a_row == 1) num_sound = i + 1;
  }
  return num_in_a_row > 0 ? num_sound : 0;
}

std::vector<ScaleMending> MendingsOf(const std::vector<GroundStep>& steps, double log_height) {
  const size_t num_sound = NumSound(steps, log_height);
  const std::vector<double> speeds = GroundSpeeds(steps);
  std::vector<double> log_factors;
  for (size_t i = num_sound; i < steps.size(); ++i) {
    log_factors.push_back(log_height + speeds[i] - steps[i].log_map_speed);
  }
  std::vector<double> smooth;
  for (size_t i = 0; i < log_factors.size(); ++i) {
    smooth.push_back(Median(log_factors, i - std::min(i, kAround), std::min(i + kAround + 1, log_factors.size())));
  }
  std::vector<ScaleMending> mendings;
  for (size_t begin = 0, end = 0; begin < smooth.size(); begin = end) {
    const KeyframeId reference = steps[num_sound + begin].reference;
    while (end < smooth.size() && steps[num_sound + end].reference == reference) ++end;
    mendings.push_back({reference, Median(smooth, begin, end)});
  }
  return mendings;
}

}  // namespace tessera

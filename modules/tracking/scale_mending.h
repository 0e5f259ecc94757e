// Where the scale of a mono map has slipped, and by how much, as the ground shows it (tracking/ground_watch.h).
//
// While the scale is right, a camera that is carried at one height h (in units of the map) over the ground has
//
//   log h = log (speed in the map) - log (speed over the ground in heights/s)
//
// in every step. Where it isn't, the difference is what lengths in the map are to be multiplied by. The ground isn't
// seen all the time, least of all where images are so poor that the scale slips: there, the camera is taken to have
// gone on about as fast as before and after.
#pragma once

#include <optional>
#include <vector>

#include "messages/tracking_types.h"

namespace tessera {

inline constexpr double kNearHeight = 0.25;  // in the logarithm: about the same height

// From one frame to the next.
struct GroundStep {
  KeyframeId reference;                      // from which the frames were tracked
  double log_map_speed = 0.0;                // units/s
  std::optional<double> log_ground_speed{};  // heights/s; nullopt: the ground doesn't tell it
};

// So many of the steps, the first ones, are in the scale in which the camera's height is `log_height`: up to the last
// of several in a row that are near it. 0 if none are.
size_t NumSound(const std::vector<GroundStep>& steps, double log_height);

// What brings the steps behind them to that scale, by keyframe. The keyframes of the steps must be in order.
std::vector<ScaleMending> MendingsOf(const std::vector<GroundStep>& steps, double log_height);

}  // namespace tessera

// The calibration in the README of a data set, for formats without a calibration file.
#pragma once

#include <optional>
#include <string>

#include "datasets/camera_rig.h"

namespace tessera {

// The pinhole of a text such as `fx=fy=585 cx=320 cy = 240.5` (pixels): every key of a chain gets the number
// at its end, and the first mention of a key counts. nullopt unless all four are there and make sense.
std::optional<PinholeCamera> PinholeFromText(const std::string& text);

// Meters per count of depth images, from `factor N` (counts per meter; the first mention) or else the word
// millimeters. 0: the text names neither.
double DepthUnitFromText(const std::string& text);

}  // namespace tessera

// Images for the tests and benchmarks of extraction: real ones where TESSERA_DATA has them, and made ones.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/image.h"
#include "features/feature_types.h"
#include "geometry/camera_frame.h"

namespace tessera {

// Reads a file below TESSERA_DATA as gray; nullopt if it isn't there.
std::optional<GrayImage> ReadRealImage(const std::string& path);
std::optional<GrayImage> ReadKittiImage(int frame);

// Every pixel independent and uniform.
GrayImage MakeNoise(int width, int height, uint32_t seed);
GrayImage MakeFlat(int width, int height, uint8_t value);
// Overlapping rectangles and discs of all sizes and gray values, slightly smoothed and noisy: corners at every scale.
GrayImage MakeTexture(int width, int height, uint32_t seed);

// The texture as a second camera sees it whose disparity falls from `near_px` at the bottom to `far_px` at the top, row
// by row: left(x, y) = right(x - DisparityOfRow(y), y).
double DisparityOfRow(int y, int height, double far_px, double near_px);
GrayImage MakeRightView(const GrayImage& left, double far_px, double near_px);

// Depth in counts from 0 (unknown) to 9999 that changes from pixel to pixel.
DepthImage MakeDepth(int width, int height);

// A calibration with plausible numbers for images of this size.
CameraCalibration MakeCalibration(SensorType sensor, int width, int height);
// A frame of the left image, with whatever else its sensor needs made from it.
CameraFrame MakeFrame(SensorType sensor, const GrayImage& left);

// Whole-image extraction in this process.
FeatureFrame ExtractWhole(const CameraFrame& frame, const FeatureOptions& options);

}  // namespace tessera

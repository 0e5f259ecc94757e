// Conversions and range checks of what several messages have in common. Checks give one sentence, or nothing if all
// is well.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

#include "core/ids.h"
#include "core/image.h"
#include "features/feature_types.h"
#include "geometry/camera.h"
#include "geometry/rigid3.h"
#include "tessera/camera_model_t.hpp"
#include "tessera/descriptor_t.hpp"
#include "tessera/feature_options_t.hpp"
#include "tessera/image_band_t.hpp"
#include "tessera/rect_t.hpp"
#include "tessera/rigid3_t.hpp"
#include "tessera/sim3_t.hpp"

namespace tessera {

// The first sentence that is not empty.
std::string FirstProblem(std::initializer_list<std::string> problems);
// `sentence` unless `holds`.
std::string SentenceUnless(bool holds, const char* sentence);

std::string CheckFrame(int64_t frame);
std::string CheckTimes(int64_t utime_us, int64_t arrival_us);

camera_model_t ToMessage(const CameraCalibration& calibration);
std::string FromMessage(const camera_model_t& message, CameraCalibration* calibration);

rigid3_t ToMessage(const Rigid3& transform);
// Refuses what is not finite, not within 10^9 m, or whose quaternion is not of length 1.
std::string FromMessage(const rigid3_t& message, Rigid3* transform);

// Refuses a scale that is not within 10^-9 .. 10^9.
std::string CheckScale(double scale);

sim3_t ToMessage(const Sim3& transform);
std::string FromMessage(const sim3_t& message, Sim3* transform);

// A position, m (mono: units of the map). False if it is not finite or not within 10^9.
void ToMessage(const Eigen::Vector3d& vector, double* message);
bool FromMessage(const double* message, Eigen::Vector3d* vector);

feature_options_t ToMessage(const FeatureOptions& options);
std::string FromMessage(const feature_options_t& message, FeatureOptions* options);

rect_t ToMessage(const Rect& rect);
// A rectangle within an image of that size. `may_be_empty`: then all four numbers are zero.
std::string FromMessage(const rect_t& message, int width, int height, bool may_be_empty, Rect* rect);

descriptor_t ToMessage(const Descriptor& descriptor);
Descriptor FromMessage(const descriptor_t& message);

// One of the images of a value, to be sent in bands.
struct BandedImage {
  int8_t image = 0;  // image_band_t::LEFT, RIGHT or DEPTH
  int width = 0;
  int height = 0;
  int bytes_per_pixel = 1;
  const uint8_t* bytes = nullptr;
};
BandedImage Banded(int8_t image, const GrayImage& pixels);
BandedImage Banded(int8_t image, const DepthImage& pixels);

// The bands of `images`, one after the other, of at most `max_bytes` of pixels each: whole rows, or pieces of a row
// where a row does not fit. Calls emit() with each in *band. Images without pixels are passed over.
template <class Emit>
void CutBands(const std::vector<BandedImage>& images, size_t max_bytes, image_band_t* band, Emit emit);

// Copies `pixels` of the image into the band.
void FillBand(const BandedImage& image, const Rect& pixels, image_band_t* band);
// The rectangle of the band that begins at pixel (x, y).
Rect NextBand(const BandedImage& image, int x, int y, size_t max_bytes);

template <class Emit>
void CutBands(const std::vector<BandedImage>& images, size_t max_bytes, image_band_t* band, Emit emit) {
  for (const BandedImage& image : images) {
    for (int y = 0, x = 0; y < image.height && image.width > 0;) {
      const Rect pixels = NextBand(image, x, y, max_bytes);
      FillBand(image, pixels, band);
      emit();
      x = pixels.right() == image.width ? 0 : pixels.right();
      y = x == 0 ? pixels.bottom() : y;
    }
  }
}

// Appends a band to an image of the given size, of which the pixels before the band must have come already.
std::string JoinBand(const image_band_t& band, int width, int height, GrayImage* image);
std::string JoinBand(const image_band_t& band, int width, int height, DepthImage* image);

// Whether all pixels of an image of this size have come.
template <class Pixel>
bool IsComplete(const Image<Pixel>& image, int width, int height) {
  return image.pixels.size() == static_cast<size_t>(width) * static_cast<size_t>(height);
}

}  // namespace tessera

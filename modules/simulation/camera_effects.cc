#include "simulation/camera_effects.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "simulation/random.h"

namespace tessera {
namespace {

constexpr float kMinBlurPx = 0.6F;  // shorter motion can't be seen

// Cheaper than HashOf, for one number per pixel.
uint32_t PixelHash(uint32_t row_seed, uint32_t x) {
  uint32_t h = (row_seed ^ (x * 0x9e3779b1U)) * 0x85ebca6bU;
  h ^= h >> 15;
  h *= 0xc2b2ae35U;
  return h ^ (h >> 13);
}

}  // namespace

EffectsPipeline::EffectsPipeline(const CameraCalibration& camera, const CameraEffects& effects, uint32_t seed)
    : camera_(camera), effects_(effects), seed_(seed), vignette_(camera.width_px, camera.height_px) {
  const double x_mid = 0.5 * (camera.width_px - 1);
  const double y_mid = 0.5 * (camera.height_px - 1);
  const double corner_squared = std::max(1.0, x_mid * x_mid + y_mid * y_mid);
  for (int y = 0; y < camera.height_px; ++y) {
    for (int x = 0; x < camera.width_px; ++x) {
      const double squared = ((x - x_mid) * (x - x_mid) + (y - y_mid) * (y - y_mid)) / corner_squared;
      vignette_.row(y)[x] = static_cast<float>(1.0 - effects.vignetting * squared);
    }
  }
}

// So that the mean of the image is a middle gray.
EffectsPipeline::Exposure EffectsPipeline::Expose(const Rendering& rendering) const {
  constexpr double kMiddleGray = 95.0;
  if (effects_.max_exposure == 1.0) return {};
  int64_t sum = 0;
  for (const uint16_t light : rendering.radiance.pixels) sum += light;
  const double mean = static_cast<double>(sum) / (256.0 * static_cast<double>(rendering.radiance.pixels.size()));
  const double needed = kMiddleGray / std::max(1.0, mean);
  const double time = std::clamp(needed, 1.0 / effects_.max_exposure, effects_.max_exposure);
  return {time, std::clamp(needed / time, 1.0, effects_.max_exposure)};
}

// A point at (x, y) = ((u - cx) / fx, (v - cy) / fy) with inverse depth w moves, seen from a camera of velocity (t, o),
//   x' = (-t_x + x t_z) w + x y o_x - (1 + x^2) o_y + y o_z
//   y' = (-t_y + y t_z) w + (1 + y^2) o_x - x y o_y - x o_z      (Longuet-Higgins and Prazdny 1980)
void EffectsPipeline::BlurMotion(const Rendering& rendering, const CameraVelocity& velocity, double exposure_s) {
  blurred_ = rendering.radiance;
  const auto time = static_cast<float>(exposure_s);
  const Eigen::Vector3f t = velocity.linear_mps.cast<float>() * time;
  const Eigen::Vector3f o = velocity.angular_radps.cast<float>() * time;
  const auto fx = static_cast<float>(camera_.fx_px), fy = static_cast<float>(camera_.fy_px);
  for (int v = 0; v < camera_.height_px; ++v) {
    const float y = (static_cast<float>(v) - static_cast<float>(camera_.cy_px)) / fy;
    const float* inverse_depth = rendering.inverse_depth.row(v);
    const uint8_t* is_body = rendering.body.empty() ? nullptr : rendering.body.row(v);
    uint16_t* out = blurred_.row(v);
    for (int u = 0; u < camera_.width_px; ++u) {
      if (is_body != nullptr && is_body[u] != 0) continue;  // it moves with the camera
      const float x = (static_cast<float>(u) - static_cast<float>(camera_.cx_px)) / fx;
      const float w = inverse_depth[u];
      const float du = fx * ((-t.x() + x * t.z()) * w + x * y * o.x() - (1.0F + x * x) * o.y() + y * o.z());
      const float dv = fy * ((-t.y() + y * t.z()) * w + (1.0F + y * y) * o.x() - x * y * o.y() - x * o.z());
      const float length = std::max(std::abs(du), std::abs(dv));
      if (length < kMinBlurPx) continue;
      const int taps = std::clamp(static_cast<int>(length) + 2, 2, effects_.max_blur_taps);
      int sum = 0;
      for (int k = 0; k < taps; ++k) {
        const float part = static_cast<float>(k) / static_cast<float>(taps - 1) - 0.5F;
        const int at_u = std::clamp(u + static_cast<int>(std::floor(part * du + 0.5F)), 0, camera_.width_px - 1);
        const int at_v = std::clamp(v + static_cast<int>(std::floor(part * dv + 0.5F)), 0, camera_.height_px - 1);
        sum += rendering.radiance.row(at_v)[at_u];
      }
      out[u] = static_cast<uint16_t>(sum / taps);
    }
  }
}

void EffectsPipeline::Spread() {
  const int width = camera_.width_px;
  const int height = camera_.height_px;
  spread_ = blurred_;
  for (int y = 0; y < height; ++y) {
    const uint16_t* above = blurred_.row(std::max(y - 1, 0));
    const uint16_t* here = blurred_.row(y);
    const uint16_t* below = blurred_.row(std::min(y + 1, height - 1));
    uint16_t* out = spread_.row(y);
    for (int x = 0; x < width; ++x) {
      out[x] = static_cast<uint16_t>((above[x] + 6 * here[x] + below[x] + 4) / 8);
    }
  }
  for (int y = 0; y < height; ++y) {
    const uint16_t* in = spread_.row(y);
    uint16_t* out = blurred_.row(y);
    out[0] = in[0];
    out[width - 1] = in[width - 1];
    for (int x = 1; x + 1 < width; ++x) {
      out[x] = static_cast<uint16_t>((in[x - 1] + 6 * in[x] + in[x + 1] + 4) / 8);
    }
  }
}

GrayImage EffectsPipeline::Apply(const Rendering& rendering, const CameraVelocity& velocity, double time_s,
                                 uint32_t picture) {
  const Exposure exposure = Expose(rendering);
  BlurMotion(rendering, velocity, exposure.time * effects_.exposure_s);
  Spread();
  const double drift =
      0.7 * SmoothNoise(HashOf(seed_, 31), 0.15 * time_s) + 0.3 * SmoothNoise(HashOf(seed_, 32), 0.8 * time_s);
  const auto gain = static_cast<float>(exposure.time * exposure.gain * (1.0 + effects_.exposure_drift * drift) / 256.0);
  std::array<float, 256> sigma{};
  for (size_t gray = 0; gray < sigma.size(); ++gray) {
    sigma[gray] =
        static_cast<float>(std::sqrt(exposure.gain * exposure.gain * effects_.read_noise * effects_.read_noise +
                                     exposure.gain * effects_.shot_noise * static_cast<double>(gray)));
  }
  GrayImage image(camera_.width_px, camera_.height_px);
  for (int y = 0; y < image.height; ++y) {
    const uint32_t row_seed = HashOf(seed_, 33, picture, static_cast<uint32_t>(y));
    const uint16_t* light = blurred_.row(y);
    const float* vignette = vignette_.row(y);
    uint8_t* out = image.row(y);
    for (int x = 0; x < image.width; ++x) {
      const float gray = std::clamp(static_cast<float>(light[x]) * gain * vignette[x], 0.0F, 255.0F);
      const float noise = sigma[static_cast<size_t>(gray)] * NormalOf(PixelHash(row_seed, static_cast<uint32_t>(x)));
      out[x] = static_cast<uint8_t>(std::clamp(gray + noise + 0.5F, 0.0F, 255.0F));
    }
  }
  return image;
}

DepthImage EffectsPipeline::Depth(const Rendering& rendering, uint32_t picture) const {
  DepthImage depth(camera_.width_px, camera_.height_px);
  const auto counts_per_m = static_cast<float>(1.0 / camera_.depth_unit_m);
  const auto deviation = static_cast<float>(effects_.depth_noise);
  for (int y = 0; y < depth.height; ++y) {
    const uint32_t row_seed = HashOf(seed_, 34, picture, static_cast<uint32_t>(y));
    for (int x = 0; x < depth.width; ++x) {
      const float w = rendering.inverse_depth.row(y)[x];
      if (w <= 0.0F) continue;
      const float z = 1.0F / w;
      const float counts =
          (z + deviation * z * z * NormalOf(PixelHash(row_seed, static_cast<uint32_t>(x)))) * counts_per_m + 0.5F;
      if (counts >= 1.0F && counts < 65536.0F) depth.row(y)[x] = static_cast<uint16_t>(counts);
    }
  }
  return depth;
}

void StampTime(double time_s, GrayImage& image) {
  // Segments of a digit: top, upper left and right, middle, lower left and right, bottom.
  constexpr std::array<std::string_view, 10> kSegments{"1110111", "0010010", "1011101", "1011011", "0111010",
                                                       "1101011", "1101111", "1010010", "1111111", "1111011"};
  const int pen = std::max(1, image.height / 200);
  const int width = 6 * pen, height = 10 * pen;
  const auto fill = [&](int x, int y, int dx, int dy, uint8_t gray) {
    for (int v = std::max(0, y); v < std::min(image.height, y + dy); ++v) {
      for (int u = std::max(0, x); u < std::min(image.width, x + dx); ++u) image.row(v)[u] = gray;
    }
  };
  const auto seconds = static_cast<int>(time_s);
  char text[32];
  std::snprintf(text, sizeof text, "2026 11 28 12 %02d %02d 4711", seconds / 60 % 60, seconds % 60);
  int x = 4 * pen;
  const int y = 4 * pen;
  for (const char* letter = text; *letter != 0; ++letter, x += width + 2 * pen) {
    if (*letter == ' ') continue;
    const std::string_view on = kSegments[static_cast<size_t>(*letter - '0')];
    for (const int border : {pen, 0}) {
      const uint8_t gray = border > 0 ? 20 : 245;
      const auto bar = [&](size_t segment, int left, int top, int dx, int dy) {
        if (on[segment] == '1') fill(x + left - border, y + top - border, dx + 2 * border, dy + 2 * border, gray);
      };
      const int middle = (height - pen) / 2;
      bar(0, 0, 0, width - pen, pen);
      bar(1, 0, 0, pen, middle + pen);
      bar(2, width - 2 * pen, 0, pen, middle + pen);
      bar(3, 0, middle, width - pen, pen);
      bar(4, 0, middle, pen, height - middle);
      bar(5, width - 2 * pen, middle, pen, height - middle);
      bar(6, 0, height - pen, width - pen, pen);
    }
  }
}

}  // namespace tessera

#include "features/row_offsets.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "features/pyramid.h"
#include "features/stereo_matcher.h"
#include "features/tile_plan.h"

namespace tessera {
namespace {

constexpr int kCellPx = 48;
constexpr int kStridePx = 6;  // between the windows of a cell that are looked at
constexpr int kRadius = kStereoRadiusPx;
constexpr int kMaxDisparityPx = 128;
// Mean difference of pixels two apart, along x and along y, from which a window can be placed both ways.
constexpr int kMinTexture = 6;
constexpr int kMaxSteps = 10;
constexpr double kConverged_px = 0.01;
constexpr double kMaxMove_px = 1.5;  // by Gauss-Newton steps: farther, it has slid to something else

struct Pixel {
  int x = 0;
  int y = 0;
};

// The smaller of the summed differences along x and along y.
int TextureAt(const LevelImage& image, Pixel center) {
  int along_x = 0, along_y = 0;
  for (int y = center.y - kRadius; y <= center.y + kRadius; ++y) {
    for (int x = center.x - kRadius; x <= center.x + kRadius; ++x) {
      along_x += std::abs(*image.At(x + 1, y) - *image.At(x - 1, y));
      along_y += std::abs(*image.At(x, y + 1) - *image.At(x, y - 1));
    }
  }
  return std::min(along_x, along_y);
}

// The most textured window of each cell.
std::vector<Pixel> ChooseWindows(const LevelImage& image) {
  constexpr int kMargin = kRadius + 2;
  constexpr int kWindowPixels = (2 * kRadius + 1) * (2 * kRadius + 1);
  const Rect& all = image.region();
  std::vector<Pixel> chosen;
  for (int cell_y = kMargin; cell_y < all.height - kMargin; cell_y += kCellPx) {
    for (int cell_x = kMargin; cell_x < all.width - kMargin; cell_x += kCellPx) {
      int best = kMinTexture * kWindowPixels - 1;
      Pixel best_at;
      for (int y = cell_y; y < std::min(cell_y + kCellPx, all.height - kMargin); y += kStridePx) {
        for (int x = cell_x; x < std::min(cell_x + kCellPx, all.width - kMargin); x += kStridePx) {
          const int texture = TextureAt(image, {x, y});
          if (texture > best) best = texture, best_at = {x, y};
        }
      }
      if (best >= kMinTexture * kWindowPixels) chosen.push_back(best_at);
    }
  }
  return chosen;
}

double Interpolate(const LevelImage& image, double x_px, double y_px) {
  const auto x = static_cast<int>(std::floor(x_px)), y = static_cast<int>(std::floor(y_px));
  const double right = x_px - x, down = y_px - y;
  const double above = (1.0 - right) * *image.At(x, y) + right * *image.At(x + 1, y);
  const double below = (1.0 - right) * *image.At(x, y + 1) + right * *image.At(x + 1, y + 1);
  return (1.0 - down) * above + down * below;
}

// Where the window around a pixel of the left image is seen in the right one, near `start`; nullopt: not there.
//
//   minimize over d and b   sum over the window of (right(start + d + w) - left(center + w) - b)^2
//
// by steps with the gradient g(w) of the left image:  [sum g g^T, sum g; sum g^T, n] (d, b) = -[sum g r, sum r].
std::optional<Eigen::Vector2d> Place(const LevelImage& left, const LevelImage& right, Pixel center,
                                     const Eigen::Vector2d& start) {
  const auto gradient = [&](int x, int y) {
    return Eigen::Vector3d(0.5 * (*left.At(x + 1, y) - *left.At(x - 1, y)),
                           0.5 * (*left.At(x, y + 1) - *left.At(x, y - 1)), -1.0);
  };
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (int j = -kRadius; j <= kRadius; ++j) {
    for (int i = -kRadius; i <= kRadius; ++i) {
      const Eigen::Vector3d g = gradient(center.x + i, center.y + j);
      information += g * g.transpose();
    }
  }
  const Eigen::Matrix3d covariance = information.inverse();
  const Rect& all = right.region();
  Eigen::Vector2d at = start;
  double brighter = 0.0;
  for (int step = 0; step < kMaxSteps; ++step) {
    const bool is_inside =
        at.x() >= kRadius && at.y() >= kRadius && at.x() < all.width - kRadius - 1 && at.y() < all.height - kRadius - 1;
    if (!is_inside || (at - start).cwiseAbs().maxCoeff() > kMaxMove_px) return std::nullopt;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int j = -kRadius; j <= kRadius; ++j) {
      for (int i = -kRadius; i <= kRadius; ++i) {
        const double residual =
            Interpolate(right, at.x() + i, at.y() + j) - *left.At(center.x + i, center.y + j) - brighter;
        sum += residual * gradient(center.x + i, center.y + j);
      }
    }
    const Eigen::Vector3d move = -covariance * sum;
    at += move.head<2>();
    brighter += move.z();
    if (move.head<2>().norm() < kConverged_px) return at;
  }
  return std::nullopt;
}

std::optional<RowOffset> Measure(StereoMatcher& matcher, const LevelImage& left, const LevelImage& right, Pixel center,
                                 int above, int below) {
  const int last_row = right.region().height - kRadius - 1;
  std::optional<StereoMatch> best;
  int best_y = 0;
  for (int y = std::max(center.y + above, kRadius); y <= std::min(center.y + below, last_row); ++y) {
    const std::optional<StereoMatch> match = matcher.Match(left, right, center.x, center.y, y, kMaxDisparityPx);
    if (match && (!best || match->cost < best->cost)) best = match, best_y = y;
  }
  if (!best) return std::nullopt;
  const Eigen::Vector2d start(static_cast<double>(best->position) / StereoMatcher::kSubpixels, best_y);
  const std::optional<Eigen::Vector2d> place = Place(left, right, center, start);
  if (!place) return std::nullopt;
  return RowOffset{place->x(), static_cast<double>(center.y), place->y() - center.y};
}

LevelImage Whole(const GrayImage& image) {
  const Rect all{0, 0, image.width, image.height};
  LevelImage whole;
  CopyRegion(image, all, all, whole);
  return whole;
}

}  // namespace

std::vector<RowOffset> MeasureRowOffsets(const GrayImage& left, const GrayImage& right, int above, int below) {
  const LevelImage whole_left = Whole(left), whole_right = Whole(right);
  StereoMatcher matcher;
  std::vector<RowOffset> offsets;
  for (const Pixel& center : ChooseWindows(whole_left)) {
    if (const auto offset = Measure(matcher, whole_left, whole_right, center, above, below)) offsets.push_back(*offset);
  }
  return offsets;
}

}  // namespace tessera

#include "features/right_turn.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr size_t kMinOffsets = 40;  // of a pair, that it counts
constexpr size_t kMinPairs = 2;
constexpr int kNumFits = 6;
constexpr double kFirstGate_px = 8.0;  // of the fit's residuals, narrowed to three standard deviations from fit to fit
constexpr double kMinGate_px = 0.3;
constexpr double kMaxContradiction_px = 0.25;
// A pitch, a twist or a stretch of 0.02 is usual, offsets are measured to 0.2 px: (0.2 / 0.02)^2 px^2.
constexpr double kUsual = 100.0;

struct Direction {
  double x = 0.0;
  double y = 0.0;
};

Direction DirectionOf(const CameraCalibration& camera, double x_px, double y_px) {
  return {(x_px - camera.cx_px) / camera.fx_px, (y_px - camera.cy_px) / camera.fy_px};
}

// Rows per pitch, twist and stretch, px.
Eigen::Vector3d RowsPer(const CameraCalibration& camera, const RowOffset& offset) {
  const Direction at = DirectionOf(camera, offset.x_px, offset.y_px);
  return camera.fy_px * Eigen::Vector3d(1.0 + at.y * at.y, -at.x, at.y);
}

double Residual_px(const CameraCalibration& camera, const Eigen::Vector3d& turn, const RowOffset& offset) {
  return offset.offset_px - RowsPer(camera, offset).dot(turn);
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Eigen::Vector3d Fit(const std::vector<std::vector<RowOffset>>& pairs, const CameraCalibration& camera) {
  std::vector<double> all;
  for (const auto& pair : pairs) {
    for (const RowOffset& offset : pair) all.push_back(offset.offset_px);
  }
  Eigen::Vector3d turn(Median(std::move(all)) / camera.fy_px, 0.0, 0.0);
  double gate_px = kFirstGate_px;
  for (int fit = 0; fit < kNumFits; ++fit) {
    Eigen::Matrix3d information = kUsual * Eigen::Matrix3d::Identity();
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    std::vector<double> residuals;
    for (const auto& pair : pairs) {
      for (const RowOffset& offset : pair) {
        const double residual = std::abs(Residual_px(camera, turn, offset));
        if (residual > gate_px) continue;
        residuals.push_back(residual);
        const Eigen::Vector3d rows = RowsPer(camera, offset);
        information += rows * rows.transpose();
        sum += rows * offset.offset_px;
      }
    }
    if (residuals.empty()) break;
    turn = information.ldlt().solve(sum);
    // Of a normal distribution, half of the absolute values lie within 0.6745 standard deviations.
    gate_px = std::max(kMinGate_px, 3.0 / 0.6745 * Median(std::move(residuals)));
  }
  return turn;
}

bool IsContradictedBy(const std::vector<RowOffset>& pair, const CameraCalibration& camera,
                      const Eigen::Vector3d& turn) {
  std::vector<double> residuals;
  for (const RowOffset& offset : pair) residuals.push_back(Residual_px(camera, turn, offset));
  return std::abs(Median(std::move(residuals))) > kMaxContradiction_px;
}

}  // namespace

Eigen::Vector2d RightTurn::Shift_px(const CameraCalibration& camera, double x_px, double y_px) const {
  const auto [x, y] = DirectionOf(camera, x_px, y_px);
  return {camera.fx_px * (pitch * x * y + twist * y), camera.fy_px * (pitch * (1.0 + y * y) - twist * x)};
}

double RightTurn::LargestOffset_px(const CameraCalibration& camera) const {
  double largest_px = 0.0;
  for (const double x_px : {0.0, camera.width_px - 1.0}) {
    for (const double y_px : {0.0, camera.cy_px, camera.height_px - 1.0}) {
      largest_px = std::max(largest_px, std::abs(Shift_px(camera, x_px, y_px).y()));
    }
  }
  return largest_px;
}

std::optional<RightTurn> FindRightTurn(const std::vector<std::vector<RowOffset>>& pairs,
                                       const CameraCalibration& camera) {
  std::vector<std::vector<RowOffset>> telling;
  for (const auto& pair : pairs) {
    if (pair.size() >= kMinOffsets) telling.push_back(pair);
  }
  if (telling.size() < kMinPairs) return std::nullopt;
  const Eigen::Vector3d turn = Fit(telling, camera);
  for (const auto& pair : telling) {
    if (IsContradictedBy(pair, camera, turn)) return std::nullopt;
  }
  return RightTurn{turn.x(), turn.y()};
}

}  // namespace tessera

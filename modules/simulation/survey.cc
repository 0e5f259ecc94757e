#include "simulation/survey.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "simulation/random.h"

namespace tessera {
namespace {

constexpr double kStepM = 0.5;
constexpr double kHeightM = 30.0, kSpeed_mps = 6.0;
constexpr double kHalfLineM = 60.0, kLineGapM = 16.0;
constexpr int kNumLines = 5;
constexpr double kRoundM = 6.0;    // radius of its bends
constexpr double kBeyondM = 40.0;  // from the lines to the end of the fields
constexpr double kCellM = 8.0;

// The corners, each rounded by the bends of a circle.
Polyline Rounded(const Polyline& corners) {
  Polyline points{corners.front()};
  for (size_t i = 1; i + 1 < corners.size(); ++i) {
    const Eigen::Vector2d in = (corners[i] - corners[i - 1]).normalized();
    const Eigen::Vector2d out = (corners[i + 1] - corners[i]).normalized();
    for (int k = 0; k <= 8; ++k) {  // a parabola, which is close enough to a circle
      const double t = k / 8.0;
      points.push_back(corners[i] - (1.0 - t) * (1.0 - t) * kRoundM * in + t * t * kRoundM * out);
    }
  }
  points.push_back(corners.back());
  return points;
}

Polyline PlanLines() {
  const double half_width = 0.5 * (kNumLines - 1) * kLineGapM;
  Polyline corners;
  for (int line = 0; line < kNumLines; ++line) {
    const double x = line * kLineGapM - half_width, side = line % 2 == 0 ? 1.0 : -1.0;
    corners.emplace_back(x, -side * kHalfLineM);
    corners.emplace_back(x, side * kHalfLineM);
  }
  // Across all lines, and to the first one's beginning.
  corners.emplace_back(half_width + 14.0, kHalfLineM);
  corners.emplace_back(half_width + 14.0, 0.3 * kHalfLineM);
  corners.emplace_back(-half_width, 0.3 * kHalfLineM);
  corners.emplace_back(-half_width, -kHalfLineM);
  return Rounded(corners);
}

class FieldBuilder {
 public:
  FieldBuilder(uint32_t seed, World& world) : seed_(seed), builder_(world), random_(HashOf(seed, 131)) {}

  void Build() {
    const double half_x = 0.5 * (kNumLines - 1) * kLineGapM + kBeyondM, half_z = kHalfLineM + kBeyondM;
    const auto columns = static_cast<int>(half_x / kCellM) + 1, rows = static_cast<int>(half_z / kCellM) + 1;
    for (int row = -rows; row < rows; ++row) {
      for (int column = -columns; column < columns; ++column) AddCell(column, row);
    }
    const int num_bushes = static_cast<int>(half_x * half_z / 8.0);
    for (int i = 0; i < num_bushes; ++i) {
      const double x = random_.Uniform(-half_x, half_x), z = random_.Uniform(-half_z, half_z);
      PutBush({x, z});
    }
    for (int i = 0; i < 6; ++i) {
      const double x = random_.Uniform(-half_x, half_x), z = random_.Uniform(-half_z, half_z);
      PutBarn({x, z});
    }
  }

 private:
  void AddCell(int column, int row) {
    constexpr std::array kTones{88.0, 97.0, 104.0, 112.0, 124.0, 138.0};
    const auto strip = static_cast<uint32_t>(static_cast<int>(std::floor(column / 3.0)));
    const auto plot = static_cast<uint32_t>(static_cast<int>(std::floor(row / 7.0)));
    const double tone = kTones[HashOf(seed_, 132, strip, plot) % kTones.size()];
    const Eigen::Vector2d corner = kCellM * Eigen::Vector2d(column, row);
    const int32_t paint = builder_.AddPaint({Material::kField, HashOf(seed_, 133), kCellM, kCellM, 0.04, corner, tone});
    builder_.Add({{corner.x(), 0.0, corner.y()}, {kCellM, 0.0, 0.0}, {0.0, 0.0, kCellM}, paint, 1.0F});
  }

  void PutBush(const Eigen::Vector2d& middle) {
    const double size = random_.Uniform(0.3, 1.6), height = random_.Chance(0.5) ? 0.05 : random_.Uniform(0.1, 1.5);
    const int32_t leaves = builder_.AddPaint({Material::kHedge, random_.Next(), 2.0 * size, 2.0 * size, 0.04});
    const double turn = random_.Uniform(0.0, 1.0);
    builder_.Add(builder_.Lid(middle, Eigen::Vector2d(Wave(turn + 0.25), Wave(turn)).normalized(), size,
                              size * random_.Uniform(0.5, 1.0), height, leaves));
  }

  void PutBarn(const Eigen::Vector2d& middle) {
    const double half_length = random_.Uniform(4.0, 8.0), half_width = random_.Uniform(3.0, 5.0);
    const double height = random_.Uniform(3.0, 6.0);
    const uint32_t style = random_.Next();
    const int32_t side = builder_.AddPaint({Material::kFacade, style, 2.0 * half_length, height, 0.04});
    const int32_t roof = builder_.AddPaint({Material::kCarRoof, style, 2.0 * half_length, 2.0 * half_width, 0.04});
    const Eigen::Vector2d ahead(0.0, 1.0);
    builder_.Add(builder_.Box(middle, ahead, half_length, half_width, 0.0, height, side, side));
    builder_.Add(builder_.Lid(middle, ahead, half_length, half_width, height, roof));
  }

  uint32_t seed_;
  WorldBuilder builder_;
  Random random_;
};

}  // namespace

SurveyTrajectory::SurveyTrajectory(double speed, uint32_t seed)
    : points_(Resample(PlanLines(), kStepM)), speed_mps_(speed * kSpeed_mps), seed_(seed) {}

double SurveyTrajectory::duration_s() const { return static_cast<double>(points_.size() - 1) * kStepM / speed_mps_; }

Eigen::Vector2d SurveyTrajectory::PositionAt(double time_s) const {
  const double at = std::clamp(time_s * speed_mps_ / kStepM, 0.0, static_cast<double>(points_.size() - 1) - 1e-6);
  const auto i = static_cast<size_t>(at);
  return points_[i] + (at - static_cast<double>(i)) * (points_[i + 1] - points_[i]);
}

Rigid3 SurveyTrajectory::WorldFromCamera(double time_s) const {
  constexpr double kWindowS = 0.6;
  const auto noise = [&](uint32_t axis, double hertz) { return SmoothNoise(HashOf(seed_, 134, axis), hertz * time_s); };
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  for (int i = -4; i <= 4; ++i) position += PositionAt(time_s + i * kWindowS / 8.0) / 9.0;
  const Eigen::Vector2d ahead = (PositionAt(time_s + kWindowS) - PositionAt(time_s - kWindowS)).normalized();
  // Axes of the camera: right, backwards (down in the image), and down.
  Eigen::Matrix3d level;
  level.col(1) = Eigen::Vector3d(-ahead.x(), 0.0, -ahead.y());
  level.col(2) = Eigen::Vector3d::UnitY();
  level.col(0) = level.col(1).cross(level.col(2));
  const Eigen::Quaterniond sway =
      Eigen::Quaterniond(1.0, 0.05 + 0.03 * noise(1, 0.7), 0.03 * noise(2, 0.8), 0.03 * noise(3, 0.5)).normalized();
  const Eigen::Vector3d place(position.x() + 0.3 * noise(4, 0.3), -kHeightM + 0.8 * noise(5, 0.2),
                              position.y() + 0.3 * noise(6, 0.3));
  return {(Eigen::Quaterniond(level) * sway).normalized(), place};
}

World BuildFields(uint32_t seed) {
  World world;
  FieldBuilder(seed, world).Build();
  return world;
}

}  // namespace tessera

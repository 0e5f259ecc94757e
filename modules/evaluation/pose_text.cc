#include "evaluation/pose_text.h"

#include <cinttypes>
#include <cstdio>

namespace tessera {
namespace {

std::string NumberText(double number) {
  char text[64];
  std::snprintf(text, sizeof text, "%.9f", number);
  return text;
}

}  // namespace

// Integers throughout: a double holds the microseconds of today's epoch only just.
std::string SecondsText(int64_t utime_us) {
  char text[40];
  const char* sign = utime_us < 0 ? "-" : "";
  const int64_t magnitude = utime_us < 0 ? -utime_us : utime_us;
  std::snprintf(text, sizeof text, "%s%" PRId64 ".%06" PRId64, sign, magnitude / 1'000'000, magnitude % 1'000'000);
  return text;
}

std::string TumRow(int64_t utime_us, const Rigid3& world_from_camera) {
  const Eigen::Vector3d& t = world_from_camera.translation;
  const Eigen::Quaterniond& q = world_from_camera.rotation;
  std::string row = SecondsText(utime_us);
  for (const double number : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) {
    row += ' ' + NumberText(number);
  }
  return row + '\n';
}

std::string KittiRow(const Rigid3& world_from_camera) {
  const Eigen::Matrix<double, 3, 4> matrix = world_from_camera.Matrix();
  std::string text;
  for (int i = 0; i < 12; ++i) {
    char number[64];
    std::snprintf(number, sizeof number, "%s%.9e", i > 0 ? " " : "", matrix(i / 4, i % 4));
    text += number;
  }
  return text + '\n';
}

}  // namespace tessera

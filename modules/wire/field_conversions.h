// One field of a message to one member of a value, and back. Reading checks what holds for every field of that kind:
// numbers are finite and fit, enumerators exist, quaternions have length 1.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>

#include "core/ids.h"
#include "core/image.h"
#include "core/result.h"
#include "features/feature_types.h"
#include "geometry/body_state.h"
#include "geometry/camera.h"
#include "geometry/rigid3.h"
#include "tessera/camera_model_t.hpp"
#include "tessera/descriptor_t.hpp"
#include "tessera/feature_options_t.hpp"
#include "tessera/rect_t.hpp"
#include "tessera/rgb_t.hpp"
#include "tessera/rigid3_t.hpp"
#include "tessera/sim3_t.hpp"

namespace tessera {

// Numbers of all types, and bool.
template <class Value, class Field>
  requires(std::is_arithmetic_v<Value> && std::is_arithmetic_v<Field>)
void WriteField(Value value, Field& field) {
  field = static_cast<Field>(value);
}
template <class Field, class Value>
  requires(std::is_arithmetic_v<Value> && std::is_arithmetic_v<Field>)
Result<> ReadField(const Field& field, Value& value) {
  if constexpr (std::is_same_v<Value, bool>) {
    value = field != 0;
  } else if constexpr (std::is_floating_point_v<Value>) {
    if (!std::isfinite(field)) return Failed("one of its numbers is not finite");
    value = static_cast<Value>(field);
  } else {
    if (!std::in_range<Value>(field)) return Failed("one of its numbers is out of range");
    value = static_cast<Value>(field);
  }
  return {};
}

// Enumerators count from 0 up to this one.
template <class Enum>
inline constexpr Enum kLastEnumerator{};
template <>
inline constexpr SensorType kLastEnumerator<SensorType> = SensorType::kRgbd;

template <class Value, class Field>
  requires(std::is_enum_v<Value> && std::is_integral_v<Field>)
void WriteField(Value value, Field& field) {
  field = static_cast<Field>(value);
}
template <class Field, class Value>
  requires(std::is_enum_v<Value> && std::is_integral_v<Field>)
Result<> ReadField(const Field& field, Value& value) {
  if (field < 0 || field > static_cast<Field>(kLastEnumerator<Value>)) return Failed("one of its states is unknown");
  value = static_cast<Value>(field);
  return {};
}

// Ids: -1 names nothing.
template <class Tag>
void WriteField(Id<Tag> id, int64_t& field) {
  field = id.value;
}
template <class Tag>
Result<> ReadField(const int64_t& field, Id<Tag>& id) {
  if (field < -1 || field >= int64_t{1} << 53) return Failed("one of its numbers of frames or items is out of range");
  id.value = field;
  return {};
}

// Texts on the wire have no control characters: they become spaces.
void WriteField(const std::string& text, std::string& field);
Result<> ReadField(const std::string& field, std::string& text);

// A position or direction, m (mono: units of the map): each coordinate within 10^9.
void WriteField(const Eigen::Vector3d& vector, double (&field)[3]);
Result<> ReadField(const double (&field)[3], Eigen::Vector3d& vector);

// The information of a position: symmetric, finite, and no more than 10^18 or less than zero along an axis.
void WriteField(const Eigen::Matrix3d& information, double (&field)[3][3]);
Result<> ReadField(const double (&field)[3][3], Eigen::Matrix3d& information);

// The covariance of a pose: symmetric, finite, and not less than zero along an axis.
void WriteField(const Matrix6d& covariance, double (&field)[6][6]);
Result<> ReadField(const double (&field)[6][6], Matrix6d& covariance);

// Translations as positions; quaternions of length 1; scales within 10^-9 .. 10^9.
void WriteField(const Rigid3& transform, rigid3_t& field);
Result<> ReadField(const rigid3_t& field, Rigid3& transform);
void WriteField(const Sim3& transform, sim3_t& field);
Result<> ReadField(const sim3_t& field, Sim3& transform);
bool IsScale(double scale);
bool IsRadial(double radial);  // of a lens
bool IsRightShift(const RightShift& shift);

// Both are checked as their Check() does.
void WriteField(const CameraCalibration& calibration, camera_model_t& field);
Result<> ReadField(const camera_model_t& field, CameraCalibration& calibration);
void WriteField(const FeatureOptions& options, feature_options_t& field);
Result<> ReadField(const feature_options_t& field, FeatureOptions& options);

inline void WriteField(const Rgb& color, rgb_t& field) {
  field.red = color.red;
  field.green = color.green;
  field.blue = color.blue;
}
inline Result<> ReadField(const rgb_t& field, Rgb& color) {
  color = {field.red, field.green, field.blue};
  return {};
}

void WriteField(const Rect& rect, rect_t& field);
Result<> ReadField(const rect_t& field, Rect& rect);  // any numbers: see IsInside
// Whether the rectangle has pixels, all of them in an image of this size.
bool IsInside(const Rect& rect, int width, int height);

// Bytes of any content.
template <size_t kNum>
void WriteField(const std::array<uint8_t, kNum>& bytes, uint8_t (&field)[kNum]) {
  std::copy(bytes.begin(), bytes.end(), field);
}
template <size_t kNum>
Result<> ReadField(const uint8_t (&field)[kNum], std::array<uint8_t, kNum>& bytes) {
  std::copy(field, field + kNum, bytes.begin());
  return {};
}

void WriteField(const Descriptor& descriptor, descriptor_t& field);
Result<> ReadField(const descriptor_t& field, Descriptor& descriptor);

}  // namespace tessera

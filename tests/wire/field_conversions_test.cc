// Every kind of field there and back, and what no field may say.
#include "wire/field_conversions.h"

#include <gtest/gtest.h>

#include <climits>
#include <limits>

namespace tessera {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

template <class Field, class Value>
bool IsRead(const Field& field, Value* value) {
  return ReadField(field, *value).has_value();
}

TEST(FieldConversions, NumbersMustFit) {
  uint16_t score = 0;
  EXPECT_TRUE(IsRead(int32_t{65535}, &score));
  EXPECT_EQ(score, 65535);
  EXPECT_FALSE(IsRead(int32_t{65536}, &score));
  EXPECT_FALSE(IsRead(int32_t{-1}, &score));
  bool flag = false;
  EXPECT_TRUE(IsRead(int8_t{2}, &flag));
  EXPECT_TRUE(flag);
}

TEST(FieldConversions, NumbersMustBeFinite) {
  double number = 0.0;
  EXPECT_TRUE(IsRead(1.5, &number));
  EXPECT_EQ(number, 1.5);
  EXPECT_FALSE(IsRead(kNan, &number));
  EXPECT_FALSE(IsRead(std::numeric_limits<double>::infinity(), &number));
}

TEST(FieldConversions, EnumeratorsMustExist) {
  SensorType sensor = SensorType::kMono;
  EXPECT_TRUE(IsRead(int8_t{2}, &sensor));
  EXPECT_EQ(sensor, SensorType::kRgbd);
  EXPECT_FALSE(IsRead(int8_t{3}, &sensor));
  EXPECT_FALSE(IsRead(int8_t{-1}, &sensor));
}

TEST(FieldConversions, IdsNameAThingOrNothing) {
  KeyframeId id{5};
  EXPECT_TRUE(IsRead(int64_t{-1}, &id));
  EXPECT_FALSE(id.valid());
  EXPECT_FALSE(IsRead(int64_t{-2}, &id));
  EXPECT_FALSE(IsRead(INT64_MAX, &id));
}

TEST(FieldConversions, TextsHaveNoControlCharacters) {
  std::string field;
  WriteField(std::string("two\nlines\x1b"), field);
  EXPECT_EQ(field, "two lines ");
}

TEST(FieldConversions, PosesComeBackToTheLastBit) {
  const Rigid3 pose{Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {0.1, -2.0, 1e8}};
  rigid3_t field;
  WriteField(pose, field);
  Rigid3 read;
  ASSERT_TRUE(IsRead(field, &read));
  EXPECT_EQ(read.rotation.coeffs(), pose.rotation.coeffs());
  EXPECT_EQ(read.translation, pose.translation);
}

TEST(FieldConversions, PosesThatAreNoneAreRefused) {
  rigid3_t good;
  WriteField(Rigid3{}, good);
  Rigid3 read;
  rigid3_t field = good;
  field.rotation_wxyz[0] = 1.01;
  EXPECT_FALSE(IsRead(field, &read)) << "not of length 1";
  field = good;
  field.translation[2] = kNan;
  EXPECT_FALSE(IsRead(field, &read));
  field.translation[2] = 1e10;
  EXPECT_FALSE(IsRead(field, &read)) << "too far away";
  sim3_t similarity;
  WriteField(Sim3::From(Rigid3{}, 2.0), similarity);
  Sim3 scaled;
  EXPECT_TRUE(IsRead(similarity, &scaled));
  EXPECT_EQ(scaled.scale, 2.0);
  for (const double scale : {0.0, -1.0, 1e12, kNan}) {
    similarity.scale = scale;
    EXPECT_FALSE(IsRead(similarity, &scaled)) << scale;
  }
}

TEST(FieldConversions, RectanglesAreComparedWithoutOverflow) {
  EXPECT_TRUE(IsInside({0, 0, 640, 480}, 640, 480));
  EXPECT_TRUE(IsInside({639, 479, 1, 1}, 640, 480));
  for (const Rect& rect : {Rect{}, Rect{INT_MIN, 0, 1, 1}, Rect{0, INT_MIN, 1, 1}, Rect{INT_MAX, 0, INT_MAX, 1},
                           Rect{0, 0, INT_MIN, 1}, Rect{1, 0, 640, 480}}) {
    EXPECT_FALSE(IsInside(rect, 640, 480));
  }
}

}  // namespace
}  // namespace tessera

// Speeds over the ground from step to step.
#include "tracking/ground_speed_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr double kInterval_s = 0.1;

// A step that says `speed`, heights/s, within 5 %, by `margin`.
GroundSpeeds Says(double speed, double margin = 30.0) {
  GroundSpeeds likelihood{};
  for (size_t i = 0; i < likelihood.size(); ++i) {
    const double off = std::log(kMinGroundSpeed / speed) + kGroundSpeedStep * (static_cast<double>(i) + 0.5);
    likelihood[i] = margin * std::exp(-0.5 * off * off / (0.05 * 0.05));
  }
  return likelihood;
}

GroundSpeedFilter Driving(double speed, int num_steps = 30) {
  GroundSpeedFilter filter;
  for (int i = 0; i < num_steps; ++i) filter.Add(Says(speed), kInterval_s);
  return filter;
}

TEST(GroundSpeedFilter, KnowsNothingAtFirst) { EXPECT_GT(GroundSpeedFilter().sigma(), 1.0); }

TEST(GroundSpeedFilter, BelievesWhatIsSaidAgainAndAgain) {
  const GroundSpeedFilter filter = Driving(8.0);
  EXPECT_NEAR(filter.log_speed(), std::log(8.0), 0.05);
  EXPECT_LT(filter.sigma(), 0.1);
  EXPECT_TRUE(filter.is_plausible());
}

TEST(GroundSpeedFilter, AnotherAnswerNowAndThenIsNotBelieved) {
  GroundSpeedFilter filter = Driving(8.0);
  for (int i = 0; i < 30; ++i) filter.Add(Says(i % 5 == 0 ? 24.0 : 8.0), kInterval_s);
  EXPECT_NEAR(filter.log_speed(), std::log(8.0), 0.1);
}

TEST(GroundSpeedFilter, FollowsACarThatBrakes) {
  GroundSpeedFilter filter = Driving(10.0);
  for (int i = 0; i < 30; ++i) {
    const double speed = 10.0 - 0.2 * i;  // 3 m/s^2 at 1.5 m
    filter.Add(Says(speed), kInterval_s);
    EXPECT_NEAR(filter.log_speed(), std::log(speed), 0.2) << i;
    EXPECT_TRUE(filter.is_plausible()) << i;
  }
}

TEST(GroundSpeedFilter, WhatNoCarCanDoIsNotPlausible) {
  GroundSpeedFilter filter = Driving(10.0);
  for (int i = 0; i < 15; ++i) filter.Add(Says(2.0), kInterval_s);
  EXPECT_NEAR(filter.log_speed(), std::log(2.0), 0.1);
  EXPECT_FALSE(filter.is_plausible());
  for (int i = 0; i < 60; ++i) filter.Add(Says(2.0), kInterval_s);
  EXPECT_TRUE(filter.is_plausible());
}

TEST(GroundSpeedFilter, ForgetsWhileNothingIsSaid) {
  GroundSpeedFilter filter = Driving(10.0);
  const double before = filter.sigma();
  for (int i = 0; i < 50; ++i) filter.Add(std::nullopt, kInterval_s);
  EXPECT_GT(filter.sigma(), 2.0 * before);
}

TEST(GroundSpeedFilter, OneStepThatIsAllThereIsMayCountMore) {
  GroundSpeedFilter careful, bold;
  careful.Add(Says(5.0), kInterval_s);
  bold.Add(Says(5.0), kInterval_s, 8.0);
  EXPECT_LT(bold.sigma(), 0.5 * careful.sigma());
}

}  // namespace
}  // namespace tessera

// The mapper's corrections tell how far covariances can be trusted.
#include "tracking/way_corrections.h"

#include <gtest/gtest.h>

#include "map/map_editor.h"
#include "support/map_changes.h"
#include "support/matchers.h"

namespace tessera {
namespace {

constexpr double kSigma = 0.01;
const Rigid3 kStep{ExpSO3({0.0, 0.1, 0.0}), {0.0, 0.0, 1.0}};

// A chain of keyframes, each sent a step from the one before.
class Chain {
 public:
  explicit Chain(std::optional<bool> begins_as_mono) {
    if (begins_as_mono) corrections_.BeginPart(*begins_as_mono);
    replica_.Send({0}, {});
  }
  // The next keyframe is sent.
  void Send() {
    const KeyframeId reference{num_sent_++}, keyframe{num_sent_};
    replica_.Send(keyframe, {reference, kStep, {}});
    corrections_.Send(reference, keyframe, kStep, kSigma * kSigma * Matrix6d::Identity());
  }
  // The mapper answers the next keyframe: this is the way to it.
  void Answer(const Rigid3& way) {
    MapEditor editor(map_);
    if (num_answered_ == 0) editor.AddKeyframe({0}, {}, {}, PlainFeatures(0, 3));
    const KeyframeId parent{num_answered_++}, keyframe{num_answered_};
    editor.AddKeyframe(keyframe, parent, map_.FindKeyframe(parent)->WorldFromKeyframe() * Sim3::From(way),
                       PlainFeatures(num_answered_, 3));
    ASSERT_THAT(replica_.Apply(editor.Finish(keyframe)), IsSuccess());
    corrections_.Update(replica_);
  }
  std::optional<double> factor() const { return corrections_.variance_factor(); }

 private:
  WayCorrections corrections_;
  MapReplica replica_;
  Map map_;
  int64_t num_sent_ = 0, num_answered_ = 0;
};

Rigid3 Turned(double angle_rad) { return kStep * Rigid3{ExpSO3({angle_rad, 0.0, 0.0}), {0.0, 0.0, 0.0}}; }

TEST(WayCorrections, AMapThatWasLoadedIsTrusted) { EXPECT_EQ(Chain(std::nullopt).factor(), 1.0); }

TEST(WayCorrections, OfAYoungMapOfMonoNothingIsKnown) {
  Chain mono(true), with_depth(false);
  EXPECT_EQ(with_depth.factor(), 1.0);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(mono.factor(), std::nullopt) << i;
    mono.Send();
    mono.Answer(kStep);
  }
  EXPECT_EQ(mono.factor(), 1.0);
}

TEST(WayCorrections, WhatIsCorrectedByMoreThanItsCovarianceSaysMakesItWider) {
  Chain chain(false);
  for (int i = 0; i < 2; ++i) {
    chain.Send();
    chain.Answer(Turned(6.0 * kSigma));
  }
  EXPECT_NEAR(*chain.factor(), 36.0 / 6.0, 1e-6);
  for (int i = 0; i < 2; ++i) {
    chain.Send();
    EXPECT_NEAR(*chain.factor(), 36.0 / 6.0, 1e-6) << "one that is not answered yet says nothing";
  }
  for (int i = 0; i < 2; ++i) chain.Answer(kStep);
  EXPECT_NEAR(*chain.factor(), 36.0 / 6.0 / 2.0, 1e-6) << "the mean";
  for (int i = 0; i < 6; ++i) {
    chain.Send();
    chain.Answer(Turned(0.5 * kSigma));
  }
  EXPECT_EQ(*chain.factor(), 1.0) << "never narrower, and earlier ways are forgotten";
}

TEST(WayCorrections, InMonoTheLengthOfAWayIsFree) {
  const Rigid3 longer{kStep.rotation, 1.5 * kStep.translation};
  for (const bool is_mono : {true, false}) {
    Chain chain(is_mono);
    for (int i = 0; i < 3; ++i) {
      chain.Send();
      chain.Answer(longer);
    }
    if (is_mono) {
      EXPECT_EQ(*chain.factor(), 1.0);
    } else {
      EXPECT_GT(*chain.factor(), 100.0);
    }
  }
}

}  // namespace
}  // namespace tessera

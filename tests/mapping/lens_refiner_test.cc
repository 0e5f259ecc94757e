#include "mapping/lens_refiner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>

#include "support/synthetic_world.h"

namespace tessera {
namespace {

constexpr size_t kNumLandmarks = 4000;

// A map of a camera whose calibration gives focal lengths that are wrong by `error`.
class MiscalibratedMap {
 public:
  MiscalibratedMap(SensorType sensor, double error, int64_t num_keyframes = 40, float right_error_px = 0.0F)
      : world_(sensor, 0.3, kNumLandmarks), planted_(world_), given_(world_.calibration()) {
    given_ = WithLens(given_, {given_.fx_px * (1.0 + error), given_.fy_px * (1.0 + error)});
    for (int64_t k = 0; k < num_keyframes; ++k) {
      planted_.Add(2 * k, {k - 1}, 0, {}, [&](FeatureFrame& features) {
        features.calibration = given_;
        for (Keypoint& keypoint : features.keypoints) {
          if (keypoint.right_x_px >= 0.0F) keypoint.right_x_px += right_error_px;
        }
      });
    }
  }

  // What `num_looks` looks in a row leave in the map.
  Map& Look(int num_looks) {
    MapEditor editor(planted_.map());
    for (int look = 0; look < num_looks; ++look) refiner_.Refine({next_ += 100}, given_, editor);
    delta_ = editor.Finish(planted_.map().answered());
    return planted_.map();
  }

  // What another refiner says of the map, as one does that was loaded.
  double ErrorOfLoadedMap() {
    LensRefiner later;
    MapEditor editor(planted_.map());
    later.Refine({0}, given_, editor);
    return later.error();
  }

  double true_fx() const { return world_.calibration().fx_px; }
  PlantedMap& planted() { return planted_; }
  const LensRefiner& refiner() const { return refiner_; }
  const MapDelta& delta() const { return delta_; }

 private:
  SyntheticWorld world_;
  PlantedMap planted_;
  CameraCalibration given_;
  LensRefiner refiner_{kNumLandmarks};  // each keyframe turns by little
  int64_t next_ = 0;
  MapDelta delta_;
};

TEST(LensRefiner, CorrectsWhatTwoLooksAgreeOn) {
  MiscalibratedMap miscalibrated(SensorType::kMono, 0.02);
  Map replica;
  for (const MapDelta& delta : miscalibrated.planted().deltas()) ASSERT_TRUE(replica.Apply(delta));
  EXPECT_FALSE(miscalibrated.Look(1).lens().is_known());
  ASSERT_TRUE(replica.Apply(miscalibrated.delta()));
  const Map& map = miscalibrated.Look(1);
  ASSERT_TRUE(map.lens().is_known());
  EXPECT_NEAR(map.lens().fx_px, miscalibrated.true_fx(), 0.004 * miscalibrated.true_fx());
  EXPECT_NEAR(map.lens().radial, 0.0, 0.001);
  EXPECT_NEAR(miscalibrated.refiner().error(), 1.0 / 1.02 - 1.0, 0.004);
  EXPECT_EQ(miscalibrated.refiner().doubt(), 0.0);
  EXPECT_EQ(miscalibrated.ErrorOfLoadedMap(), miscalibrated.refiner().error());
  EXPECT_LT(miscalibrated.planted().WorstKeyframe(map), 0.5);
  ASSERT_TRUE(replica.Apply(miscalibrated.delta()));
  EXPECT_EQ(replica.Sha256Hex(), map.Sha256Hex());
}

TEST(LensRefiner, LeavesARightCalibrationAlone) {
  MiscalibratedMap right(SensorType::kMono, 0.0);
  const uint64_t before = right.planted().map().hash();
  EXPECT_EQ(right.Look(2).hash(), before);
  EXPECT_EQ(right.refiner().error(), 0.0);
}

TEST(LensRefiner, DoubtsWhatNoCalibrationIsWrongBy) {
  MiscalibratedMap far(SensorType::kMono, 0.06);
  EXPECT_FALSE(far.Look(2).lens().is_known());
  EXPECT_LT(far.refiner().doubt(), -0.03);
}

TEST(LensRefiner, NeedsATurnAndAMonoCamera) {
  MiscalibratedMap straight(SensorType::kMono, 0.02, 22), stereo(SensorType::kStereo, 0.02);
  EXPECT_FALSE(straight.Look(2).lens().is_known());
  EXPECT_FALSE(stereo.Look(2).lens().is_known());
}

// The second look at the same keyframes sees nothing new, but what the correction of the first has left.
TEST(LensRefiner, MovesTheColumnsOfARightCameraThatSquints) {
  MiscalibratedMap squints(SensorType::kStereo, 0.0, 40, 1.0F);
  Map replica;
  for (const MapDelta& delta : squints.planted().deltas()) ASSERT_TRUE(replica.Apply(delta));
  EXPECT_FALSE(squints.Look(1).lens().is_known());
  ASSERT_TRUE(replica.Apply(squints.delta()));
  EXPECT_TRUE(squints.Look(1).lens().is_known());
  ASSERT_TRUE(replica.Apply(squints.delta()));
  const Map& map = squints.Look(4);
  EXPECT_EQ(map.lens().fx_px, squints.true_fx());
  EXPECT_NEAR(map.lens().right_shift.center_px, -1.0, 0.15);
  EXPECT_LT(squints.planted().WorstKeyframe(map), 0.2);
  EXPECT_EQ(squints.refiner().right_shift_doubt_px(), 0.0);
  ASSERT_TRUE(replica.Apply(squints.delta()));
  EXPECT_EQ(replica.Sha256Hex(), map.Sha256Hex());
}

TEST(LensRefiner, LeavesARightPairAlone) {
  MiscalibratedMap right(SensorType::kStereo, 0.0);
  const uint64_t before = right.planted().map().hash();
  EXPECT_EQ(right.Look(4).hash(), before);
}

TEST(LensRefiner, LeavesDepthImagesAlone) {
  MiscalibratedMap rgbd(SensorType::kRgbd, 0.02);
  EXPECT_FALSE(rgbd.Look(3).lens().is_known());
}

}  // namespace
}  // namespace tessera

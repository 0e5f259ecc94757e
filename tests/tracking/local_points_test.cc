// Which points a tracked frame should see, on a map of the synthetic world.
#include "tracking/local_points.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <optional>

#include "support/matchers.h"
#include "support/synthetic_world.h"

namespace tessera {
namespace {

// A map of ten keyframes along the drive, and a frame at the last one's step that sees every second of its landmarks.
class LocalPointsTest : public testing::Test {
 protected:
  LocalPointsTest() {
    for (int64_t k = 0; k < 10; ++k) planted_.Add(3 * k, {k - 1});
    for (const MapDelta& delta : planted_.deltas()) EXPECT_THAT(replica_.Apply(delta), IsSuccess());
    frame_.emplace(planted_.FrameOf({9}));
    for (size_t i = 1; i < frame_->points.size(); i += 2) frame_->points[i] = {};
  }
  const Map& map() const { return replica_.map(); }
  bool SeesLandmark(LandmarkId id) const {
    return std::any_of(frame_->points.begin(), frame_->points.end(),
                       [&](const SeenPoint& point) { return point.valid() && point.id.landmark == id; });
  }

  SyntheticWorld world_{SensorType::kStereo};
  PlantedMap planted_{world_};
  MapReplica replica_;
  std::optional<TrackedFrame> frame_;
};

TEST_F(LocalPointsTest, TheKeyframeThatSharesMostComesFirst) {
  const std::vector<KeyframeId> keyframes = LocalKeyframes(map(), *frame_, 30);
  ASSERT_FALSE(keyframes.empty());
  EXPECT_EQ(keyframes.front(), KeyframeId{9});
  EXPECT_THAT(keyframes, testing::Contains(KeyframeId{8}));
}

TEST_F(LocalPointsTest, NoMoreKeyframesThanAllowed) {
  const std::vector<KeyframeId> keyframes = LocalKeyframes(map(), *frame_, 3);
  EXPECT_EQ(keyframes.size(), 3U) << "two that share points, and a neighbor";
  EXPECT_TRUE(LocalKeyframes(map(), TrackedFrame(frame_->view), 30).empty()) << "it sees nothing";
}

TEST_F(LocalPointsTest, ThePointsAreThoseThatTheFrameDoesNotSee) {
  const KnownPoints points = LocalPoints(replica_, *frame_, 30);
  size_t num_of_last = 0;
  for (const auto& [id, landmark] : points) {
    EXPECT_FALSE(SeesLandmark(id.landmark));
    num_of_last += map().IsSeenBy(id.landmark, {9}) ? 1 : 0;
  }
  EXPECT_EQ(num_of_last, map().FindKeyframe({9})->landmarks.size() / 2) << "every second one is left";
}

TEST_F(LocalPointsTest, PointsOfUnansweredKeyframesAreAmongThem) {
  replica_.Send({10}, {{9}, Rigid3::Identity(), {{4, {.position_in_world = {0.0, 0.0, 5.0}}}}});
  const PointId sent{{}, {10}, 4};
  const auto has_sent = [&] {
    const KnownPoints points = LocalPoints(replica_, *frame_, 30);
    return std::any_of(points.begin(), points.end(), [&](const auto& point) { return point.first == sent; });
  };
  EXPECT_TRUE(has_sent());
  frame_->points[1] = {sent, {}};
  EXPECT_FALSE(has_sent());
}

}  // namespace
}  // namespace tessera

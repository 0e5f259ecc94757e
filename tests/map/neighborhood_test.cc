#include "map/neighborhood.h"

#include <gmock/gmock.h>

#include "map/map_editor.h"
#include "support/map_changes.h"

namespace tessera {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

// Keyframe 0 shares two landmarks with keyframe 1, and three with keyframe 2; keyframe 3 sees none.
class Neighborhood : public testing::Test {
 protected:
  Neighborhood() {
    MapEditor editor(map_);
    for (int64_t k = 0; k < 4; ++k) editor.AddKeyframe({k}, {k - 1}, {}, PlainFeatures(k, 6));
    for (int i = 0; i < 5; ++i) editor.AddLandmark({});
    for (int32_t i = 0; i < 5; ++i) editor.AddObservation({i}, {{0}, i});
    for (int32_t i = 0; i < 2; ++i) editor.AddObservation({i}, {{1}, i + 3});
    for (int32_t i = 2; i < 5; ++i) editor.AddObservation({i}, {{2}, i});
  }

  Map map_;
};

TEST_F(Neighborhood, TheKeyframeComesFirstThenThoseThatShareMost) {
  EXPECT_THAT(KeyframesAround(map_, {0}, 5), ElementsAre(KeyframeId{0}, KeyframeId{2}, KeyframeId{1}));
  EXPECT_THAT(KeyframesAround(map_, {0}, 1), ElementsAre(KeyframeId{0}, KeyframeId{2}));
  EXPECT_THAT(KeyframesAround(map_, {3}, 5), ElementsAre(KeyframeId{3}));
}

TEST_F(Neighborhood, LandmarksAreListedOnceById) {
  const std::vector<KeyframeId> keyframes = {{2}, {1}};
  EXPECT_THAT(LandmarksSeenBy(map_, keyframes),
              ElementsAre(LandmarkId{0}, LandmarkId{1}, LandmarkId{2}, LandmarkId{3}, LandmarkId{4}));
  const std::vector<KeyframeId> blind = {{3}};
  EXPECT_THAT(LandmarksSeenBy(map_, blind), IsEmpty());
}

}  // namespace
}  // namespace tessera

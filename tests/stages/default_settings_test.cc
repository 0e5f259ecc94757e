// config/default.yaml says the same as the options' own defaults: with the file, without it, and in the tests of the
// algorithms, everything runs alike.
#include <gtest/gtest.h>

#include "loop_closing/loop_closer.h"
#include "mapping/mapper.h"
#include "settings/settings.h"
#include "tracking/map_tracker.h"

namespace tessera {
namespace {

Settings Defaults() { return Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml"); }

TEST(DefaultSettings, OfTheTracker) {
  const Settings settings = Defaults();
  const MapTrackerOptions options;
  EXPECT_EQ(settings.Get<int>("tracker.min_inliers"), options.min_inliers);
  EXPECT_EQ(settings.Get<int>("tracker.max_local_keyframes"), options.max_local_keyframes);
  EXPECT_EQ(settings.Get<double>("tracker.max_lost_s"), 1e-6 * static_cast<double>(options.max_lost_us));
  EXPECT_EQ(settings.Get<double>("tracker.keyframe_min_share"), options.keyframes.min_share);
  EXPECT_EQ(settings.Get<double>("tracker.keyframe_min_parallax_rad"), options.keyframes.min_parallax_rad);
  EXPECT_EQ(settings.Get<double>("tracker.keyframe_max_interval_s"),
            1e-6 * static_cast<double>(options.keyframes.max_interval_us));
}

TEST(DefaultSettings, OfTheMapper) {
  const Settings settings = Defaults();
  const MapperOptions options;
  EXPECT_EQ(settings.Get<int>("mapper.creation_neighbours"), options.creation.max_neighbors);
  EXPECT_EQ(settings.Get<double>("mapper.min_parallax_rad"), options.creation.min_parallax_rad);
  EXPECT_EQ(settings.Get<int>("mapper.max_hamming"), options.creation.max_hamming);
  EXPECT_EQ(settings.Get<int>("mapper.max_hamming"), options.fusion.max_hamming);
  EXPECT_EQ(settings.Get<int>("mapper.fusion_neighbours"), options.fusion.max_neighbors);
  EXPECT_EQ(settings.Get<int>("mapper.min_shared_landmarks"), options.window.min_shared_landmarks);
  EXPECT_EQ(settings.Get<int>("mapper.max_inner_keyframes"), options.window.max_inner_keyframes);
  EXPECT_EQ(settings.Get<int>("mapper.max_outer_keyframes"), options.window.max_outer_keyframes);
  EXPECT_EQ(settings.Get<bool>("mapper.always_ceres"), options.bundle.is_always_ceres);
  EXPECT_EQ(settings.Get<int>("mapper.bundle_iterations"), options.bundle.max_num_iterations);
  EXPECT_EQ(settings.Get<double>("mapper.redundant_share"), options.keyframe_culling.redundant_share);
}

TEST(DefaultSettings, OfLoops) {
  const Settings settings = Defaults();
  const LoopCloserOptions options;
  EXPECT_EQ(settings.Get<int>("loop_closer.min_matches"), options.verification.min_matches);
  EXPECT_EQ(settings.Get<int>("loop_closer.min_aligned"), options.verification.similarity.min_inliers);
  EXPECT_EQ(settings.Get<int>("loop_closer.min_seen"), options.verification.min_seen);
  EXPECT_EQ(settings.Get<int>("loop_closer.min_relocalized"), options.relocalization.min_seen);
  EXPECT_EQ(settings.Get<double>("loop_closer.min_coverage"), options.verification.min_coverage);
  EXPECT_EQ(settings.Get<double>("loop_closer.min_coverage"), options.relocalization.min_coverage);
  EXPECT_EQ(settings.Get<int>("mapper.loop_delay_keyframes"), CorrectionDelays{}.loop_keyframes);
  EXPECT_EQ(settings.Get<int>("mapper.adjustment_delay_keyframes"), CorrectionDelays{}.adjustment_keyframes);
  EXPECT_EQ(settings.Get<int>("mapper.adjustment_delay_growth"), CorrectionDelays{}.adjustment_growth);
  EXPECT_EQ(settings.Get<int>("global_adjuster.iterations"), GlobalBundleOptions().max_num_iterations);
}

}  // namespace
}  // namespace tessera

// config/default.yaml says the same as the options' own defaults: with the file, without it, and in the tests of the
// algorithms, everything runs alike.
#include <gtest/gtest.h>

#include "datasets/pacer.h"
#include "distribution/work_queue.h"
#include "loop_closing/loop_closer_session.h"
#include "mapping/mapper_session.h"
#include "occupancy/occupancy_grid.h"
#include "occupancy/occupancy_options.h"
#include "settings/settings.h"
#include "tracking/map_tracker.h"

namespace tessera {
namespace {

template <class Section>
Section Defaults() {
  return Settings::LoadDefaults(TESSERA_SOURCE_DIR "/config/default.yaml").Get<Section>();
}

TEST(DefaultSettings, OfTheTracker) {
  const auto settings = Defaults<TrackerSettings>();
  const MapTrackerOptions options;
  EXPECT_EQ(settings.max_lost_s, 1e-6 * static_cast<double>(options.max_lost_us));
  EXPECT_EQ(settings.localize_only, !options.makes_keyframes);
  EXPECT_EQ(settings.keyframe_min_share, options.keyframes.min_share);
  EXPECT_EQ(settings.keyframe_min_share_with_depth, options.keyframes.min_share_with_depth);
  EXPECT_EQ(settings.keyframe_min_parallax_rad, options.keyframes.min_parallax_rad);
  EXPECT_EQ(settings.keyframe_max_interval_s, 1e-6 * static_cast<double>(options.keyframes.max_interval_us));
}

TEST(DefaultSettings, OfTheOccupancyStage) {
  const auto settings = Defaults<OccupancySettings>();
  const OccupancyOptions options;
  EXPECT_EQ(settings.resolution_m, options.resolution);
  EXPECT_EQ(settings.max_range_m, options.max_range);
  EXPECT_EQ(settings.min_range_m, options.min_range);
  EXPECT_EQ(settings.prob_hit, options.prob_hit);
  EXPECT_EQ(settings.prob_miss, options.prob_miss);
  EXPECT_EQ(settings.prob_min, options.prob_min);
  EXPECT_EQ(settings.prob_max, options.prob_max);
  const HeightBand band;
  EXPECT_EQ(settings.grid_below_camera_m, band.below_camera);
  EXPECT_EQ(settings.grid_above_camera_m, band.above_camera);
}

TEST(DefaultSettings, OfTheMapper) {
  const auto settings = Defaults<MapperSettings>();
  const MapperSessionOptions options;
  EXPECT_EQ(settings.max_inner_keyframes, options.mapper.window.max_inner_keyframes);
  EXPECT_EQ(settings.max_outer_keyframes, options.mapper.window.max_outer_keyframes);
  EXPECT_EQ(settings.loop_delay_keyframes, options.delays.loop_keyframes);
  EXPECT_EQ(settings.adjustment_delay_keyframes, options.delays.adjustment_keyframes);
  EXPECT_EQ(settings.close_loops, options.closes_loops);
  EXPECT_EQ(settings.polish, options.mapper.polishes);
  EXPECT_EQ(settings.refine_focal, options.mapper.refines_focal);
}

TEST(DefaultSettings, OfTheLoopCloser) {
  const auto settings = Defaults<LoopCloserSettings>();
  const LoopCloserSessionOptions options;
  EXPECT_EQ(settings.min_seen, options.loop_closer.verification.min_seen);
  EXPECT_EQ(settings.min_coverage, options.loop_closer.verification.min_coverage);
  EXPECT_EQ(settings.min_relocalized, options.loop_closer.relocalization.min_seen);
  EXPECT_EQ(settings.min_coverage, options.loop_closer.relocalization.min_coverage);
  EXPECT_EQ(Defaults<MapperSettings>().loop_delay_keyframes, options.loop_delay_keyframes);
}

TEST(DefaultSettings, OfExtractionAndItsDistribution) {
  const WorkQueueOptions options;
  const auto dispatcher = Defaults<DispatcherSettings>();
  EXPECT_EQ(ParseTileGrid(dispatcher.tiles), options.grid);
  EXPECT_EQ(dispatcher.max_queued_frames, options.max_queued_frames);
  EXPECT_EQ(dispatcher.max_frames_in_flight, options.max_frames_in_flight);
  const auto features = Defaults<FeaturesSettings>();
  EXPECT_EQ(features.num_features, options.features.num_features);
  EXPECT_EQ(features.min_score, options.features.min_score);
  EXPECT_EQ(features.max_disparity_px, options.features.max_disparity_px);
  EXPECT_EQ(Defaults<CameraSettings>().lockstep_window, PacerOptions{}.lockstep_window);
}

}  // namespace
}  // namespace tessera

// Every setting, typed: one struct for each section of config/default.yaml, which has the defaults and says what each
// key is for. Whoever adds a setting adds a member here, a line to the section's Visit(), and a line to that file.
#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "features/feature_types.h"
#include "geometry/rigid3.h"
#include "map/map_archive.h"
#include "messages/topics.h"

namespace tessera {

// The values that a number may have, both ends included, and their unit ("": none).
struct Range {
  double lowest = 0.0;
  double highest = 0.0;
  const char* unit = "";
};

// The texts that are allowed.
struct OneOf {
  std::vector<std::string> texts;
};

// What a text must be like, in words that follow "must be".
struct Like {
  const char* words;
  bool (*matches)(const std::string& text);
};

inline constexpr double kAnyCount = 1e9;

// Empty, or [R | t]: 12 numbers row by row, separated by commas or spaces.
bool IsRigidTransform(const std::string& text);

// LCM takes channel names for regular expressions, and has room for 63 characters.
bool IsChannelPrefix(const std::string& text);

struct BusSettings {
  static constexpr const char* kSection = "bus";
  std::string main_url, camera_url, color_url, work_url, map_url, tile_url;
  int first_tile_port = 0;
  std::string channel_prefix;
  int receive_buffer_bytes = 0;
  int max_message_bytes = 0;
  int max_work_message_bytes = 0;
  int max_local_message_bytes = 0;
  std::string run_dir;
  bool camera_is_member = true;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("main_url", self.main_url);
    field("camera_url", self.camera_url);
    field("color_url", self.color_url);
    field("work_url", self.work_url);
    field("map_url", self.map_url);
    field("tile_url", self.tile_url);
    // Each extractor has a port of its own.
    field("first_tile_port", self.first_tile_port, Range{1, 65536 - kMaxExtractors});
    field("channel_prefix", self.channel_prefix, Like{"at most 32 letters, digits, _, - and /", IsChannelPrefix});
    field("receive_buffer_bytes", self.receive_buffer_bytes, Range{1 << 16, 1 << 30, "bytes"});
    // Above 65,499 bytes LCM would cut messages into fragments, whose loss nobody could repair one by one.
    field("max_message_bytes", self.max_message_bytes, Range{1000, 65000, "bytes"});
    field("max_work_message_bytes", self.max_work_message_bytes, Range{1000, 65000, "bytes"});
    field("max_local_message_bytes", self.max_local_message_bytes, Range{1000, 65000, "bytes"});
    field("run_dir", self.run_dir);
    field("camera_is_member", self.camera_is_member);
  }
};

struct StreamTimingSettings {
  static constexpr const char* kSection = "stream";
  int history_bytes = 0;
  int heartbeat_ms = 0;
  int repair_ms = 0;
  int give_up_ms = 0;
  std::string journal_dir;
  int journal_mb = 0;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("history_bytes", self.history_bytes, Range{1 << 16, 1 << 30, "bytes"});
    field("heartbeat_ms", self.heartbeat_ms, Range{1, 10'000, "ms"});
    field("repair_ms", self.repair_ms, Range{1, 10'000, "ms"});
    field("give_up_ms", self.give_up_ms, Range{1, 1'000'000, "ms"});
    field("journal_dir", self.journal_dir);
    field("journal_mb", self.journal_mb, Range{1, 100'000'000, "MB"});
  }
};

struct CameraSettings {
  static constexpr const char* kSection = "camera";
  std::string source, sensor, calibration, pace;
  int first_frame = 0;
  int last_frame = 0;
  int lockstep_window = 0;
  double depth_unit_m = 0.0;
  double min_focal_px = 0.0;
  double give_up_s = 0.0;
  bool color = false;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("source", self.source);
    field("sensor", self.sensor, OneOf{{"mono", "stereo", "rgbd"}});
    field("calibration", self.calibration);
    field("pace", self.pace);
    field("first_frame", self.first_frame, Range{0, kAnyCount});
    field("last_frame", self.last_frame, Range{-1, kAnyCount});
    field("lockstep_window", self.lockstep_window, Range{1, 1000, "frames"});
    field("depth_unit_m", self.depth_unit_m, Range{0, 1, "m"});
    field("min_focal_px", self.min_focal_px, Range{0, 10'000, "px"});
    field("give_up_s", self.give_up_s, Range{0, 1e6, "s"});
    field("color", self.color);
  }
};

struct DispatcherSettings {
  static constexpr const char* kSection = "dispatcher";
  std::string tiles;
  int max_queued_frames = 0;
  int max_frames_in_flight = 0;
  bool pack_tiles = false;
  bool newest_wins = false;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("tiles", self.tiles);
    field("pack_tiles", self.pack_tiles);
    field("max_queued_frames", self.max_queued_frames, Range{1, 100'000, "frames"});
    field("max_frames_in_flight", self.max_frames_in_flight, Range{1, 1000, "frames"});
    field("newest_wins", self.newest_wins);
  }
};

struct ExtractorSettings {
  static constexpr const char* kSection = "extractor";
  std::string robots;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("robots", self.robots);
  }
};

struct FeaturesSettings {
  static constexpr const char* kSection = "features";
  int num_features = 0;
  int min_score = 0;
  int max_disparity_px = 0;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("num_features", self.num_features, Range{1, FeatureOptions::kMaxFeatures, "keypoints"});
    field("min_score", self.min_score, Range{1, FeatureOptions::kMaxScore});
    field("max_disparity_px", self.max_disparity_px, Range{1, FeatureOptions::kMaxDisparityPx, "px"});
  }
};

struct TrackerSettings {
  static constexpr const char* kSection = "tracker";
  int map_delay_frames = 0;
  bool live = false;
  bool relocalize = false;
  bool localize_only = false;
  std::string replay_log;
  double max_lost_s = 0.0;
  double keyframe_min_share = 0.0;
  double keyframe_min_share_with_depth = 0.0;
  double keyframe_min_parallax_rad = 0.0;
  double keyframe_max_interval_s = 0.0;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("map_delay_frames", self.map_delay_frames, Range{1, 1000, "frames"});
    field("live", self.live);
    field("relocalize", self.relocalize);
    field("localize_only", self.localize_only);
    field("replay_log", self.replay_log);
    field("max_lost_s", self.max_lost_s, Range{0, 1e6, "s"});
    field("keyframe_min_share", self.keyframe_min_share, Range{0.001, 0.999});
    field("keyframe_min_share_with_depth", self.keyframe_min_share_with_depth, Range{0.001, 0.999});
    field("keyframe_min_parallax_rad", self.keyframe_min_parallax_rad, Range{1e-4, 3.1, "rad"});
    field("keyframe_max_interval_s", self.keyframe_max_interval_s, Range{0.001, 1e6, "s"});
  }
};

struct BodySettings {
  static constexpr const char* kSection = "body";
  std::string base_from_camera;

  Rigid3 BaseFromCamera() const;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("base_from_camera", self.base_from_camera,
          Like{"empty or 12 numbers, a rotation and a translation [R | t] row by row", IsRigidTransform});
  }
};

struct MapperSettings {
  static constexpr const char* kSection = "mapper";
  int max_inner_keyframes = 0;
  int max_outer_keyframes = 0;
  bool close_loops = false;
  int loop_delay_keyframes = 0;
  int adjustment_delay_keyframes = 0;
  bool polish = false;
  bool refine_focal = false;
  std::string load_map;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("max_inner_keyframes", self.max_inner_keyframes, Range{2, 1000, "keyframes"});
    field("max_outer_keyframes", self.max_outer_keyframes, Range{1, 1000, "keyframes"});
    field("close_loops", self.close_loops);
    // A loop closer that is started again finds the keyframe in the last snapshot but one.
    field("loop_delay_keyframes", self.loop_delay_keyframes, Range{1, MapArchive::kDelay - 1, "keyframes"});
    field("adjustment_delay_keyframes", self.adjustment_delay_keyframes, Range{1, 100'000, "keyframes"});
    field("polish", self.polish);
    field("refine_focal", self.refine_focal);
    field("load_map", self.load_map);
  }
};

struct LoopCloserSettings {
  static constexpr const char* kSection = "loop_closer";
  std::string vocabulary;
  int min_seen = 0;
  int min_relocalized = 0;
  double min_coverage = 0.0;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("vocabulary", self.vocabulary);
    field("min_seen", self.min_seen, Range{6, 10'000, "landmarks"});
    field("min_relocalized", self.min_relocalized, Range{6, 10'000, "landmarks"});
    field("min_coverage", self.min_coverage, Range{0, 1});
  }
};

struct EvaluatorSettings {
  static constexpr const char* kSection = "evaluator";
  std::string out_dir, save_map;
  double save_period_s = 0.0;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("out_dir", self.out_dir);
    field("save_map", self.save_map);
    field("save_period_s", self.save_period_s, Range{0, 1e6, "s"});
  }
};

struct MapWriterSettings {
  static constexpr const char* kSection = "map_writer";
  std::string path;
  bool follow = false;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("path", self.path);
    field("follow", self.follow);
  }
};

struct RecorderSettings {
  static constexpr const char* kSection = "recorder";
  std::string path;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("path", self.path);
  }
};

struct OccupancySettings {
  static constexpr const char* kSection = "occupancy";
  double resolution_m = 0.0;
  double max_range_m = 0.0;
  double min_range_m = 0.0;
  double prob_hit = 0.0;
  double prob_miss = 0.0;
  double prob_min = 0.0;
  double prob_max = 0.0;
  double grid_below_camera_m = 0.0;
  double grid_above_camera_m = 0.0;

  template <class Self, class Field>
  static void Visit(Self& self, Field&& field) {
    field("resolution_m", self.resolution_m, Range{0, 100, "m"});
    field("max_range_m", self.max_range_m, Range{0, 10'000, "m"});
    field("min_range_m", self.min_range_m, Range{0, 10'000, "m"});
    field("prob_hit", self.prob_hit, Range{0.501, 0.999});
    field("prob_miss", self.prob_miss, Range{0.001, 0.499});
    field("prob_min", self.prob_min, Range{0.001, 0.499});
    field("prob_max", self.prob_max, Range{0.501, 0.999});
    field("grid_below_camera_m", self.grid_below_camera_m, Range{0, 1000, "m"});
    field("grid_above_camera_m", self.grid_above_camera_m, Range{0, 1000, "m"});
  }
};

using AllSections = std::tuple<BusSettings, StreamTimingSettings, CameraSettings, DispatcherSettings, ExtractorSettings,
                               FeaturesSettings, TrackerSettings, BodySettings, MapperSettings, LoopCloserSettings,
                               EvaluatorSettings, MapWriterSettings, RecorderSettings, OccupancySettings>;

}  // namespace tessera

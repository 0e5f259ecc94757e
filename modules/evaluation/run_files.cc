#include "evaluation/run_files.h"

#include <cinttypes>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/errors.h"
#include "core/files.h"
#include "core/time_units.h"
#include "evaluation/map_ply.h"
#include "evaluation/pose_text.h"
#include "geometry/body_state.h"

namespace tessera {
namespace {

// Keys keep the order in which they are written here.
using Json = nlohmann::ordered_json;

std::string TumText(const std::vector<StampedPose>& poses, const Rigid3& base_from_camera) {
  std::string text = "# timestamp tx ty tz qx qy qz qw\n";
  for (const StampedPose& pose : poses) {
    text += TumRow(pose.utime_us, PoseOfBase(pose.world_from_camera, base_from_camera));
  }
  return text;
}

// Comments for trajectory.txt, which readers of TUM files pass over; none if all frames are placed in one map.
std::string PartsText(const std::vector<PartRecord>& parts) {
  if (parts.size() < 2) return "";
  std::string text =
      "# The map has " + std::to_string(parts.size()) +
      " parts that no loop has joined: the positions (mono: and the scale) of one mean little in another.\n";
  for (size_t i = 0; i < parts.size(); ++i) {
    const PartRecord& part = parts[i];
    text += "# part " + std::to_string(i + 1) + (part.is_main ? " (main): " : ": ") + std::to_string(part.num_frames) +
            " frames, " + std::to_string(part.num_keyframes) + " keyframes";
    if (part.first)
      text += ", from " + SecondsText(part.first->utime_us) + " s to " + SecondsText(part.last->utime_us) + " s";
    text += "\n";
  }
  return text;
}

std::string KittiText(const std::vector<Rigid3>& poses, const Rigid3& base_from_camera) {
  std::string text;
  for (const Rigid3& pose : poses) {
    text += KittiRow(PoseOfBase(pose, base_from_camera));
  }
  return text;
}

const char* StateText(TrackingState state) {
  switch (state) {
    case TrackingState::kInitializing:
      return "initializing";
    case TrackingState::kTracked:
      return "tracked";
    case TrackingState::kLost:
      return "lost";
  }
  return "unknown";
}

std::string MillisecondsText(const std::optional<double>& milliseconds) {
  char text[32] = "";
  if (milliseconds) {
    std::snprintf(text, sizeof text, "%.3f", *milliseconds);
  }
  return text;
}

Json ToJson(const std::optional<Statistics>& statistics) {
  if (!statistics) {
    return nullptr;
  }
  return {{"count", statistics->count}, {"mean", statistics->mean}, {"median", statistics->median},
          {"p95", statistics->p95},     {"p99", statistics->p99},   {"max", statistics->max}};
}

Json ToJson(const std::vector<PartRecord>& parts) {
  Json list = Json::array();
  for (const PartRecord& part : parts) {
    const auto frame = [](const std::optional<StampedPose>& pose) -> Json {
      if (!pose) return nullptr;
      return pose->frame.value;
    };
    const auto seconds = [](const std::optional<StampedPose>& pose) -> Json {
      if (!pose) return nullptr;
      return SecondsOf(pose->utime_us);
    };
    list.push_back({{"first_frame", frame(part.first)},
                    {"last_frame", frame(part.last)},
                    {"first_timestamp_s", seconds(part.first)},
                    {"last_timestamp_s", seconds(part.last)},
                    {"frames", part.num_frames},
                    {"keyframes", part.num_keyframes},
                    {"is_main", part.is_main}});
  }
  return list;
}

// The measurements of all frames that have them.
std::optional<Statistics> SummarizeFrames(const std::vector<FrameRecord>& frames,
                                          std::optional<double> FrameRecord::* measurement) {
  std::vector<double> values;
  for (const FrameRecord& frame : frames) {
    if (const std::optional<double>& value = frame.*measurement) {
      values.push_back(*value);
    }
  }
  return Summarize(std::move(values));
}

}  // namespace

std::string FramesCsv(const RunRecord& record) {
  std::string text =
      "frame,utime_us,state,pose_time_ms,latency_ms,map_wait_ms,features,matches,inliers,landmarks,is_keyframe,"
      "num_deltas,is_step_doubtful,scale_sigma,map_part\n";
  for (const FrameRecord& frame : record.Frames()) {
    const PoseEstimate& pose = frame.pose;
    char row[256];
    std::snprintf(row, sizeof row, "%" PRId64 ",%" PRId64 ",%s,%s,%s,%s,%d,%d,%d,%d,%d,%" PRId64 ",%d,%.3f,%s\n",
                  pose.frame.value, pose.utime_us, StateText(pose.state), MillisecondsText(frame.pose_time_ms).c_str(),
                  MillisecondsText(frame.latency_ms).c_str(), MillisecondsText(frame.map_wait_ms).c_str(),
                  pose.num_features, pose.num_matches, pose.num_inliers, pose.num_landmarks, pose.is_keyframe ? 1 : 0,
                  pose.num_deltas, pose.is_step_doubtful ? 1 : 0, pose.scale_sigma,
                  pose.map_part.valid() ? std::to_string(pose.map_part.value).c_str() : "");
    text += row;
  }
  return text;
}

std::string LoopsCsv(const RunRecord& record) {
  std::string text = "keyframe_timestamp_s,matched_timestamp_s,inliers,scale\n";
  const Map& map = record.map();
  for (const ClosedLoop& loop : map.closed_loops()) {
    const auto seconds = [&](KeyframeId id) {
      const Keyframe* keyframe = map.FindKeyframe(id);
      return keyframe == nullptr ? 0.0 : SecondsOf(keyframe->features->utime_us);
    };
    char row[128];
    std::snprintf(row, sizeof row, "%.6f,%.6f,%d,%.6f\n", seconds(loop.current), seconds(loop.matched), loop.num_points,
                  loop.scale);
    text += row;
  }
  return text;
}

std::string RunJson(const RunRecord& record, const std::vector<std::string>& not_written) {
  const FrameCounts counts = record.Counts();
  const std::vector<FrameRecord> frames = record.Frames();
  const std::vector<PartRecord> parts = record.Parts();
  Json stage_ms = Json::object(), stage_values = Json::object();
  int64_t num_repaired = 0, num_lost = 0;
  for (const auto& [name, figures] : record.stages()) {
    if (figures.step_ms.count > 0) {
      stage_ms[name] = ToJson(figures.step_ms);
    }
    if (!figures.values.empty()) stage_values[name] = figures.values;
    num_repaired += figures.num_repaired;
    num_lost += figures.num_lost;
  }
  const Json json = {{"frames", counts.frames},
                     {"frames_tracked", counts.tracked},
                     {"frames_lost", counts.lost},
                     {"frames_initializing", counts.initializing},
                     {"frames_dropped", counts.dropped},
                     {"frames_missing", counts.missing},
                     {"tracking_failures", counts.tracking_failures},
                     {"relocalizations", counts.relocalizations},
                     {"loops_closed", record.map().closed_loops().size()},
                     {"keyframes", record.map().keyframes().size()},
                     {"landmarks", record.map().landmarks().size()},
                     {"map_parts", parts.size()},
                     {"parts", ToJson(parts)},
                     {"pose_time_ms", ToJson(SummarizeFrames(frames, &FrameRecord::pose_time_ms))},
                     {"latency_ms", ToJson(SummarizeFrames(frames, &FrameRecord::latency_ms))},
                     {"map_wait_ms", ToJson(SummarizeFrames(frames, &FrameRecord::map_wait_ms))},
                     {"stage_ms", stage_ms},
                     {"stage_values", stage_values},
                     {"messages_repaired", num_repaired},
                     {"messages_lost", num_lost},
                     {"trajectory_sha256", record.TrajectorySha256()},
                     {"map_sha256", record.map().Sha256Hex()},
                     {"not_written", not_written}};
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

void MakeRunFolder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    throw InputError("the run's folder " + folder + " can't be made: " + error.message() + "; choose another one");
  }
}

std::vector<std::string> WriteRun(const RunRecord& record, const std::string& folder, const Rigid3& base_from_camera,
                                  const std::vector<RunFile>& more) {
  const auto tum = [&](const std::vector<StampedPose>& poses) { return TumText(poses, base_from_camera); };
  MakeRunFolder(folder);
  std::vector<std::string> not_written;
  const auto try_to_write = [&](const RunFile& file) {
    try {
      file.write(file.path);
    } catch (const std::exception& error) {
      not_written.emplace_back(error.what());
    }
  };
  const auto write_text = [&](const std::string& name, const std::function<std::string()>& text) {
    try_to_write({folder + "/" + name, [&](const std::string& path) { WriteFile(path, text()); }});
  };
  write_text("trajectory.txt", [&] { return PartsText(record.Parts()) + tum(record.Trajectory()); });
  write_text("trajectory_live.txt", [&] { return tum(record.LiveTrajectory()); });
  write_text("trajectory_kitti.txt", [&] { return KittiText(record.PosePerFrame(), base_from_camera); });
  write_text("keyframes.txt", [&] { return tum(record.Keyframes()); });
  write_text("loops.csv", [&] { return LoopsCsv(record); });
  write_text("frames.csv", [&] { return FramesCsv(record); });
  write_text("ground_truth.txt", [&] { return tum(record.GroundTruth()); });
  const std::string run_json = folder + "/run.json";
  WriteFile(run_json, RunJson(record, not_written));
  const size_t num_told = not_written.size();
  for (const RunFile& file : more) try_to_write(file);
  write_text("map.ply", [&] { return PlyFile(record.map(), record.colors(), base_from_camera); });
  if (not_written.size() > num_told) WriteFile(run_json, RunJson(record, not_written));
  return not_written;
}

}  // namespace tessera

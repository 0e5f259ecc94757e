// The files that a run leaves in its folder.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "evaluation/run_record.h"

namespace tessera {

// Columns: frame, utime_us, state, pose_time_ms, latency_ms, map_wait_ms, features, matches, inliers, landmarks,
// is_keyframe, num_deltas. What is unknown is empty.
std::string FramesCsv(const RunRecord& record);

// One row a closed loop: when its two keyframes were taken, landmarks that both see, by how much the later one's
// surroundings were enlarged (mono).
std::string LoopsCsv(const RunRecord& record);

// The figures of the run (INTERFACE: `summary.json` is made of them), as JSON. `not_written`: sentences about files of
// the run that are missing. Bytes of names that are not UTF-8 become replacement characters.
std::string RunJson(const RunRecord& record, const std::vector<std::string>& not_written = {});

// Makes the folder if need be. Throws InputError if it can't be made.
void MakeRunFolder(const std::string& folder);

// A file that is written besides: `write` throws if it can't.
struct RunFile {
  std::string path;
  std::function<void(const std::string& path)> write;
};

// Writes into the folder, which is made if need be, the small and precious files first: trajectory.txt,
// trajectory_live.txt, trajectory_kitti.txt, keyframes.txt, loops.csv, frames.csv, ground_truth.txt, run.json, then
// `more`, then map.ply. A file that can't be written does not keep the others from it. Returns a sentence for each such
// file; run.json holds them too, as `not_written`. Poses, true ones too, are those of the base (geometry/body_state.h),
// landmarks lie in its world; the hashes in run.json are of the camera's poses and the map, and stay the same. Throws
// InputError if run.json itself or the folder can't be written.
std::vector<std::string> WriteRun(const RunRecord& record, const std::string& folder,
                                  const Rigid3& base_from_camera = Rigid3::Identity(),
                                  const std::vector<RunFile>& more = {});

}  // namespace tessera

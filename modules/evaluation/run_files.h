// The files that a run leaves in its folder.
#pragma once

#include <string>

#include "evaluation/run_record.h"

namespace tessera {

// Columns: frame, utime_us, state, pose_time_ms, latency_ms, map_wait_ms, features, matches, inliers, landmarks,
// is_keyframe, num_deltas. What is unknown is empty.
std::string FramesCsv(const RunRecord& record);

// One row a closed loop: when its two keyframes were taken, landmarks that both see, by how much the later one's
// surroundings were enlarged (mono).
std::string LoopsCsv(const RunRecord& record);

// The figures of the run (INTERFACE: `summary.json` is made of them), as JSON.
std::string RunJson(const RunRecord& record);

// Makes the folder if need be. Throws InputError if it can't be made.
void MakeRunFolder(const std::string& folder);

// Writes trajectory.txt, trajectory_live.txt, trajectory_kitti.txt, keyframes.txt, map.ply, ground_truth.txt,
// frames.csv, loops.csv and, at the very end, run.json into the folder, which is made if need be. Poses, true ones too,
// are those of the base (geometry/body_state.h), landmarks lie in its world; the hashes in run.json are of the camera's
// poses and the map, and stay the same. Throws InputError if one can't be written.
void WriteRun(const RunRecord& record, const std::string& folder, const Rigid3& base_from_camera = Rigid3::Identity());

}  // namespace tessera

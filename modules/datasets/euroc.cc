// EuRoC MAV sequences: mav0/cam0 and cam1 (sensor.yaml, data.csv, data/), and the pose of the body (IMU) in
// mav0/state_groundtruth_estimate0/data.csv. T_BS of a sensor.yaml is body_from_sensor. The TUM visual-inertial
// benchmark has the same folders without sensor.yaml (the calibration is that of Kalibr), and the truth in mocap0.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>

#include "core/errors.h"
#include "datasets/calibration_file.h"
#include "datasets/foreign_calibration.h"
#include "datasets/image_file.h"
#include "datasets/pose_track.h"
#include "datasets/recording.h"
#include "datasets/text_file.h"
#include "datasets/time_association.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

CameraOnBody ReadSensor(const fs::path& path) {
  const CameraOnBody sensor = ReadEurocSensor(CalibrationSection::Load(path));
  ThrowIfFailed<InputError>(sensor.camera.Check(), "calibration file " + path.string() + ": ");
  return sensor;
}

constexpr int64_t kMaxPairGapNs = 20'000'000;

// Image files of a camera, in the order of their times.
struct ImageTable {
  std::vector<int64_t> times_ns;
  std::vector<std::string> paths;
};

// Throws InputError if a file does not exist. Of two of one time, the first counts.
ImageTable ReadImageTable(const fs::path& camera_folder) {
  std::map<int64_t, std::string> images;
  for (const TextRow& row : ReadRows(camera_folder / "data.csv")) {
    const int64_t time_ns = row.TimeNs(0);
    const std::string name = row.fields.size() > 1 ? row.fields[1] : row.fields[0] + ".png";
    const std::string path = FindImage(camera_folder / "data" / name);
    if (path.empty()) {
      throw InputError(row.location + " names " + (camera_folder / "data" / name).string() +
                       ", which does not exist: copy the sequence again");
    }
    images.emplace(time_ns, path);
  }
  ImageTable table;
  for (const auto& [time_ns, path] : images) {
    table.times_ns.push_back(time_ns);
    table.paths.push_back(path);
  }
  return table;
}

// Rows: time [ns], position x y z [m], rotation w x y z; velocities and biases may follow.
PoseTrack ReadBodyTrack(const fs::path& path) {
  PoseTrack world_from_body;
  for (const TextRow& row : ReadRows(path)) {
    const Eigen::Quaterniond rotation(row.Number(4), row.Number(5), row.Number(6), row.Number(7));
    if (std::abs(rotation.norm() - 1.0) > 0.1) {
      throw InputError(row.location + ": fields 5 to 8 are not a unit quaternion w x y z: repair the file");
    }
    world_from_body.Add(row.TimeNs(0),
                        {rotation.normalized(), Eigen::Vector3d(row.Number(1), row.Number(2), row.Number(3))});
  }
  return world_from_body;
}

// Images that both cameras took, all of the left one's for mono. Cameras that aren't triggered together take them some
// milliseconds apart, which the tracker corrects.
std::vector<int64_t> OpenImages(const fs::path& mav, SensorType sensor, Recording& recording) {
  const ImageTable left = ReadImageTable(mav / "cam0");
  const bool is_stereo = sensor == SensorType::kStereo;
  const ImageTable right = is_stereo ? ReadImageTable(mav / "cam1") : ImageTable{};
  const std::vector<int64_t> right_of_left = AssociateTimes(left.times_ns, right.times_ns, kMaxPairGapNs);
  std::vector<int64_t> times_ns;
  std::vector<std::string> left_paths, right_paths;
  int64_t widest_gap_ns = 0;
  for (size_t i = 0; i < left.times_ns.size(); ++i) {
    const int64_t time_ns = left.times_ns[i], j = right_of_left[i];
    if (is_stereo && j < 0) continue;
    times_ns.push_back(time_ns);
    recording.utimes_us.push_back(time_ns / 1000);
    left_paths.push_back(left.paths[i]);
    if (is_stereo) {
      right_paths.push_back(right.paths[static_cast<size_t>(j)]);
      widest_gap_ns = std::max(widest_gap_ns, std::abs(right.times_ns[static_cast<size_t>(j)] - time_ns));
    }
  }
  if (times_ns.empty()) {
    throw InputError("folder " + mav.string() +
                     ": no image of cam0 was taken within 20 ms of one of cam1: use --sensor mono");
  }
  const size_t num_single = left.paths.size() + right.paths.size() - left_paths.size() - right_paths.size();
  if (num_single > 0) {
    recording.notes.push_back(std::to_string(num_single) +
                              " images without a partner in the other camera are skipped.");
  }
  if (widest_gap_ns > 0) {
    recording.notes.push_back("The two images of a pair are up to " +
                              std::to_string((widest_gap_ns + 999'999) / 1'000'000) +
                              " ms apart: trigger the cameras together.");
  }
  recording.left = ReadImageFiles(std::move(left_paths));
  recording.right = is_stereo ? ReadImageFiles(std::move(right_paths)) : nullptr;
  return times_ns;
}

// The cameras of --camera, else those of the sequence.
CameraRig ReadRig(const fs::path& mav, const SourceOptions& options) {
  const fs::path left_path = mav / "cam0" / "sensor.yaml";
  const bool is_given = !options.calibration_path.empty();
  CameraRig rig = is_given ? LoadCalibrationFile(options.calibration_path) : CameraRig{};
  if (is_given && !fs::exists(left_path)) return rig;
  const CameraOnBody left = ReadSensor(left_path);
  rig.body_from_left = left.body_from_camera;
  if (is_given) return rig;
  rig.left = left.camera;
  if (options.sensor == SensorType::kStereo) {
    const CameraOnBody right = ReadSensor(mav / "cam1" / "sensor.yaml");
    rig.right = right.camera;
    rig.right_from_left = right.body_from_camera.Inverse() * left.body_from_camera;
  }
  return rig;
}

// world_from_left = world_from_body * body_from_left
void ReadGroundTruth(const fs::path& mav, const std::vector<int64_t>& times_ns, Recording& recording) {
  const fs::path mocap = mav / "mocap0" / "data.csv";
  const fs::path path = fs::exists(mocap) ? mocap : mav / "state_groundtruth_estimate0" / "data.csv";
  if (!fs::exists(path)) {
    recording.notes.push_back("No ground truth: " + path.string() + " does not exist.");
    return;
  }
  if (!recording.rig.body_from_left) {
    recording.notes.push_back("No ground truth: it tells where the body was, but neither " +
                              (mav / "cam0" / "sensor.yaml").string() +
                              " nor T_cam_imu of --camera says where the camera is on it.");
    return;
  }
  const Rigid3& body_from_left = *recording.rig.body_from_left;
  const PoseTrack world_from_body = ReadBodyTrack(path);
  for (size_t i = 0; i < times_ns.size(); ++i) {
    if (const auto pose = world_from_body.At(times_ns[i])) {
      recording.ground_truth.push_back(
          {FrameId{static_cast<int64_t>(i)}, recording.utimes_us[i], *pose * body_from_left});
    }
  }
}

}  // namespace

Recording LoadEuroc(const std::string& folder, const SourceOptions& options) {
  RequireFolder(folder);
  if (options.sensor == SensorType::kRgbd) {
    throw InputError("EuRoC sequence " + folder + " has no depth images: use --sensor mono or stereo");
  }
  const fs::path mav = fs::is_directory(fs::path(folder) / "mav0") ? fs::path(folder) / "mav0" : fs::path(folder);
  if (!fs::is_directory(mav / "cam0")) {
    throw InputError("folder " + folder +
                     " does not hold mav0/cam0: give the folder of a EuRoC sequence, such as .../MH_01");
  }
  const bool is_stereo = options.sensor == SensorType::kStereo;
  if (is_stereo && !fs::is_directory(mav / "cam1")) {
    throw InputError("folder " + mav.string() + " has no cam1, which stereo needs: use --sensor mono");
  }
  Recording recording;
  recording.times_path = mav / "cam0" / "data.csv";
  recording.rig = ReadRig(mav, options);
  const std::vector<int64_t> times_ns = OpenImages(mav, options.sensor, recording);
  ReadGroundTruth(mav, times_ns, recording);
  return recording;
}

}  // namespace tessera

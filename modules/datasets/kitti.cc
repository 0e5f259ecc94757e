// KITTI odometry sequences: image_0/ and image_1/ (rectified gray pair) or one video each, calib.txt,
// times.txt, and ground truth in poses.txt or ../../poses/<sequence>.txt (pose of camera 0, 3x4 row by row).
#include <algorithm>
#include <array>
#include <filesystem>
#include <map>

#include "core/errors.h"
#include "datasets/calibration_file.h"
#include "datasets/image_file.h"
#include "datasets/recording.h"
#include "datasets/text_file.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

using Projection = std::array<double, 12>;  // 3x4, row by row

// Number of the camera of a row labeled `P0:`, `P0`, `P_rect_00:` and so on; -1 for any other label.
int CameraOfLabel(std::string label) {
  if (label.ends_with(':')) label.pop_back();
  for (const std::string prefix : {"P_rect_0", "P"}) {
    if (label.size() == prefix.size() + 1 && label.starts_with(prefix) && label.back() >= '0' && label.back() <= '9') {
      return label.back() - '0';
    }
  }
  return -1;
}

// The projection matrices of calib.txt by camera. Rows without a label are cameras 0, 1, ...
std::map<int, Projection> ReadProjections(const std::string& path) {
  std::map<int, Projection> projections;
  int num_unlabeled = 0;
  for (TextRow& row : ReadRows(path)) {
    double number = 0.0;
    int camera = -1;
    if (ParseNumber(row.fields.front(), number)) {
      camera = num_unlabeled++;
    } else {
      camera = CameraOfLabel(row.fields.front());
      row.fields.erase(row.fields.begin());
    }
    if (camera < 0) {
      continue;  // Tr, R_rect, dates: of other sensors
    }
    if (row.fields.size() != 12) {
      throw InputError(row.location + ": P" + std::to_string(camera) + " has " + std::to_string(row.fields.size()) +
                       " numbers instead of the 12 of a 3x4 projection matrix: repair the file");
    }
    for (size_t i = 0; i < 12; ++i) {
      projections[camera][i] = row.Number(i);
    }
  }
  return projections;
}

// P_k = [fx 0 cx tx; 0 fy cy 0; 0 0 1 0] with tx_k = -fx * (distance of camera k to the right of camera 0).
CameraRig ReadCalibration(const std::string& path, SensorType sensor) {
  const std::map<int, Projection> projections = ReadProjections(path);
  if (!projections.contains(0)) {
    throw InputError("file " + path + " has no row `P0:` of 12 numbers: repair the file or give --camera FILE.yaml");
  }
  const Projection& left = projections.at(0);
  PinholeCamera camera;
  camera.fx_px = left[0];
  camera.cx_px = left[2];
  camera.fy_px = left[5];
  camera.cy_px = left[6];
  ThrowIfFailed<InputError>(camera.Check(), "file " + path + ", row P0: ");
  if (sensor != SensorType::kStereo) {
    return {.left = camera};
  }
  if (!projections.contains(1)) {
    throw InputError("file " + path +
                     " has no row `P1:` of 12 numbers, which stereo needs: use --sensor mono, or repair the file");
  }
  const double baseline_m = (left[3] - projections.at(1)[3]) / left[0];
  if (!(baseline_m > 0.0)) {
    throw InputError("file " + path +
                     ": the fourth number of row P1 must be smaller than that of P0 (it is -fx * baseline): "
                     "repair the file");
  }
  return RectifiedPair(camera, baseline_m);
}

bool IsNumber(const std::string& text) {
  return !text.empty() && text.size() < 18 &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

// Rows of times.txt and poses belong to image numbers, so a missing image would shift all that follow.
void RequireNoGap(const std::vector<std::string>& paths) {
  for (size_t i = 1; i < paths.size(); ++i) {
    const std::string before = fs::path(paths[i - 1]).stem(), name = fs::path(paths[i]).stem();
    if (IsNumber(before) && IsNumber(name) && std::stoll(name) != std::stoll(before) + 1) {
      throw InputError("image " + paths[i] + " follows " + fs::path(paths[i - 1]).filename().string() +
                       " directly: images between them are missing; copy the sequence again");
    }
  }
}

std::unique_ptr<ImageReader> OpenCamera(const fs::path& folder, const std::string& camera, int64_t num_times) {
  std::vector<std::string> paths = ListImages(folder / camera);
  if (!paths.empty()) {
    RequireNoGap(paths);
    return ReadImageFiles(std::move(paths));
  }
  for (const char* extension : {".mp4", ".avi", ".mkv", ".mov"}) {
    if (const fs::path video = folder / (camera + extension); fs::exists(video)) {
      return ReadVideoImages(video, num_times);
    }
  }
  return nullptr;
}

void OpenImages(const std::string& folder, SensorType sensor, Recording& recording) {
  const auto num_times = static_cast<int64_t>(recording.utimes_us.size());
  recording.left = OpenCamera(folder, "image_0", num_times);
  if (!recording.left) {
    throw InputError("folder " + folder +
                     " holds neither images in image_0/ nor image_0.mp4: give a KITTI sequence folder, such "
                     "as .../sequences/03");
  }
  const int64_t num_images = recording.left->num_images();
  if (num_times < num_images) {
    throw InputError("file " + recording.times_path + " has " + std::to_string(num_times) + " times for " +
                     std::to_string(num_images) + " images: it is too short; copy it again");
  }
  if (num_times > num_images) {
    recording.notes.push_back("There are " + std::to_string(num_times) + " times but only " +
                              std::to_string(num_images) + " images in " + folder + ": the later times are not used.");
  }
  recording.utimes_us.resize(static_cast<size_t>(num_images));
  if (sensor != SensorType::kStereo) {
    return;
  }
  recording.right = OpenCamera(folder, "image_1", num_times);
  if (!recording.right) {
    throw InputError("folder " + folder +
                     " holds neither images in image_1/ nor image_1.mp4, which stereo needs: use --sensor mono");
  }
  if (recording.right->num_images() != num_images) {
    throw InputError("folder " + folder + " has " + std::to_string(num_images) + " images in image_0 but " +
                     std::to_string(recording.right->num_images()) +
                     " in image_1: copy the sequence again, or use --sensor mono");
  }
}

void ReadPoses(const std::string& folder, Recording& recording) {
  const fs::path sequence = fs::weakly_canonical(folder);
  const fs::path inside = sequence / "poses.txt";
  const fs::path beside = sequence.parent_path().parent_path() / "poses" / (sequence.filename().string() + ".txt");
  const fs::path path = fs::exists(inside) ? inside : beside;
  if (!fs::exists(path)) {
    recording.notes.push_back("No ground truth: neither " + inside.string() + " nor " + beside.string() + " exists.");
    return;
  }
  const std::vector<TextRow> rows = ReadRows(path);
  const size_t count = std::min(rows.size(), recording.utimes_us.size());
  for (size_t i = 0; i < count; ++i) {
    Eigen::Matrix<double, 3, 4> matrix;
    for (int entry = 0; entry < 12; ++entry) {
      matrix(entry / 4, entry % 4) = rows[i].Number(static_cast<size_t>(entry));
    }
    const Eigen::Matrix3d rotation = matrix.leftCols<3>();
    if (!IsRotation(rotation)) {
      throw InputError(rows[i].location + ": the 3x4 matrix does not begin with a rotation: repair the file");
    }
    recording.ground_truth.push_back(
        {FrameId{static_cast<int64_t>(i)}, recording.utimes_us[i], Rigid3::FromMatrix(rotation, matrix.col(3))});
  }
  if (rows.size() != recording.utimes_us.size()) {
    recording.notes.push_back("Ground truth " + path.string() + " has " + std::to_string(rows.size()) + " poses for " +
                              std::to_string(recording.utimes_us.size()) + " images: the first " +
                              std::to_string(count) + " are used.");
  }
}

}  // namespace

Recording LoadKitti(const std::string& folder, const SourceOptions& options) {
  RequireFolder(folder);
  if (options.sensor == SensorType::kRgbd) {
    throw InputError("KITTI sequence " + folder + " has no depth images: use --sensor mono or stereo");
  }
  Recording recording;
  recording.rig = options.calibration_path.empty() ? ReadCalibration(fs::path(folder) / "calib.txt", options.sensor)
                                                   : LoadCalibrationFile(options.calibration_path);
  recording.times_path = fs::path(folder) / "times.txt";
  for (const TextRow& row : ReadRows(recording.times_path)) {
    recording.utimes_us.push_back(row.TimeUs(0));
  }
  OpenImages(folder, options.sensor, recording);
  ReadPoses(folder, recording);
  return recording;
}

}  // namespace tessera

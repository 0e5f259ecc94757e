// TUM RGB-D sequences: rgb.txt and depth.txt (`time file`), groundtruth.txt (`time tx ty tz qx qy qz qw`, of
// the color camera), times in seconds.
//
// The format holds no calibration. It is taken from the first of: --camera; calibration.yaml or
// camera.yaml in the folder; the folder's README where it says `fx=... fy=... cx=... cy=...` and `factor N`
// (counts per meter) or millimeters; what is published for sequences whose folder has its name of the benchmark
// (published_calibration.h); the values that the TUM tools take for any Kinect.
//
// Each depth image must be registered to the color image as the camera gave it, before undistortion.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "core/errors.h"
#include "core/files.h"
#include "datasets/calibration_file.h"
#include "datasets/image_file.h"
#include "datasets/pose_track.h"
#include "datasets/published_calibration.h"
#include "datasets/readme_calibration.h"
#include "datasets/recording.h"
#include "datasets/text_file.h"
#include "datasets/time_association.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kMaxPairGapUs = 20'000;  // as in the TUM tools: color and depth are not triggered together

struct TimedFile {
  int64_t utime_us = 0;
  std::string path;
};

std::vector<TimedFile> ReadFileTable(const fs::path& folder, const std::string& table) {
  std::vector<TimedFile> files;
  for (const TextRow& row : ReadRows(folder / table)) {
    const int64_t utime_us = row.TimeUs(0);
    if (row.fields.size() < 2) {
      throw InputError(row.location + " must hold `time file`: repair the file");
    }
    const std::string path = FindImage(folder / row.fields[1]);
    if (path.empty()) {
      throw InputError(row.location + " names " + (folder / row.fields[1]).string() +
                       ", which does not exist: copy the sequence again");
    }
    files.push_back({utime_us, path});
  }
  std::stable_sort(files.begin(), files.end(), [](const auto& a, const auto& b) { return a.utime_us < b.utime_us; });
  return files;
}

std::vector<int64_t> TimesOf(const std::vector<TimedFile>& files) {
  std::vector<int64_t> utimes_us;
  for (const TimedFile& file : files) utimes_us.push_back(file.utime_us);
  return utimes_us;
}

void OpenImages(const fs::path& folder, SensorType sensor, Recording& recording) {
  const std::vector<TimedFile> color = ReadFileTable(folder, "rgb.txt");
  std::vector<std::string> paths;
  if (sensor == SensorType::kMono) {
    for (const TimedFile& file : color) {
      recording.utimes_us.push_back(file.utime_us);
      paths.push_back(file.path);
    }
    recording.left = ReadImageFiles(std::move(paths));
    return;
  }
  const std::vector<TimedFile> depth = ReadFileTable(folder, "depth.txt");
  const std::vector<int64_t> depth_of_color = AssociateTimes(TimesOf(color), TimesOf(depth), kMaxPairGapUs);
  const auto num_alone = std::count(depth_of_color.begin(), depth_of_color.end(), -1);
  if (num_alone == std::ssize(color)) {
    throw InputError("folder " + folder.string() +
                     ": no color image has a depth image within 20 ms: check rgb.txt and depth.txt");
  }
  for (size_t i = 0; i < color.size(); ++i) {
    const int64_t j = depth_of_color[i];
    const TimedFile measured = j < 0 ? TimedFile{color[i].utime_us, ""} : depth[static_cast<size_t>(j)];
    recording.utimes_us.push_back(color[i].utime_us);
    paths.push_back(color[i].path);
    recording.depth_paths.push_back(measured.path);
    recording.depth_delays_us.push_back(measured.utime_us - color[i].utime_us);
  }
  if (num_alone > 0) {
    recording.notes.push_back(std::to_string(num_alone) +
                              " color images without a depth image within 20 ms are tracked without depth.");
  }
  recording.left = ReadImageFiles(std::move(paths));
}

std::string FindReadme(const fs::path& folder) {
  for (const char* name : {"README", "README.txt", "README.md", "readme.txt", "readme.md", "readme"}) {
    if (fs::is_regular_file(folder / name)) {
      return folder / name;
    }
  }
  return "";
}

std::string Describe(const PinholeCamera& camera) {
  std::ostringstream text;
  text << "fx=" << camera.fx_px << " fy=" << camera.fy_px << " cx=" << camera.cx_px << " cy=" << camera.cy_px << " px";
  if (!camera.distortion.empty()) {
    text << (camera.lens == LensModel::kEquidistant ? ", equidistant distortion" : ", distortion");
    for (const double coefficient : camera.distortion) text << ' ' << coefficient;
  }
  return text.str();
}

struct Evidence {
  std::string file;    // a calibration file; empty: none
  std::string readme;  // empty: none
  std::string readme_text;
  std::optional<PublishedCalibration> published;
};

Evidence FindEvidence(const fs::path& folder, const SourceOptions& options, std::vector<std::string>& notes) {
  Evidence evidence;
  evidence.file = options.calibration_path;
  for (const char* name : {"calibration.yaml", "camera.yaml"}) {
    if (evidence.file.empty() && fs::is_regular_file(folder / name)) {
      evidence.file = folder / name;
      notes.push_back("The calibration is taken from " + evidence.file + ".");
    }
  }
  evidence.readme = FindReadme(folder);
  if (!evidence.readme.empty()) evidence.readme_text = ReadFile(evidence.readme);
  evidence.published = PublishedTumCalibration(folder);
  return evidence;
}

void CalibrateCamera(const fs::path& folder, const Evidence& evidence, Recording& recording) {
  CameraRig& rig = recording.rig;
  if (!evidence.file.empty()) {
    rig = LoadCalibrationFile(evidence.file);
  } else if (const auto camera = PinholeFromText(evidence.readme_text)) {
    rig.left = *camera;
    recording.notes.push_back("The calibration is taken from " + evidence.readme + ": " + Describe(rig.left) + ".");
  } else if (evidence.published) {
    rig.left = evidence.published->rig.left;
    recording.notes.push_back("The calibration is that published for " + evidence.published->name + ": " +
                              Describe(rig.left) + ".");
  } else {
    rig.left = {.width_px = 640, .height_px = 480, .fx_px = 525.0, .fy_px = 525.0, .cx_px = 319.5, .cy_px = 239.5};
    recording.notes.push_back("Warning: " + folder.string() + " says nothing of its camera; " + Describe(rig.left) +
                              " is assumed, as for any Kinect: give --camera FILE.yaml or put calibration.yaml there.");
  }
}

void ChooseDepthUnit(const Evidence& evidence, Recording& recording) {
  std::string origin;
  double& depth_unit_m = recording.rig.depth_unit_m;
  if (depth_unit_m = DepthUnitFromText(evidence.readme_text); depth_unit_m > 0.0) {
    origin = "The depth unit is taken from " + evidence.readme;
  } else if (evidence.published) {
    depth_unit_m = evidence.published->rig.depth_unit_m;
    origin = "The depth unit is that published for " + evidence.published->name;
  } else {
    depth_unit_m = 1.0 / 5000.0;
    origin = "Warning: the depth unit of the TUM sets is assumed";
  }
  std::ostringstream note;
  note << origin << ": 1/" << 1.0 / depth_unit_m << " m per count.";
  recording.notes.push_back(note.str());
}

// The camera according to the files of the folder, or to its name; a note tells which.
void Calibrate(const fs::path& folder, const SourceOptions& options, Recording& recording) {
  const Evidence evidence = FindEvidence(folder, options, recording.notes);
  CalibrateCamera(folder, evidence, recording);
  const bool is_known = recording.rig.depth_unit_m > 0.0 || options.depth_unit_m > 0.0;
  if (options.sensor == SensorType::kRgbd && !is_known) ChooseDepthUnit(evidence, recording);
}

void ReadGroundTruth(const fs::path& path, Recording& recording) {
  if (!fs::exists(path)) {
    recording.notes.push_back("No ground truth: " + path.string() + " does not exist.");
    return;
  }
  PoseTrack track;
  for (const TextRow& row : ReadRows(path)) {
    const Eigen::Quaterniond rotation(row.Number(7), row.Number(4), row.Number(5), row.Number(6));
    if (std::abs(rotation.norm() - 1.0) > 0.1) {
      throw InputError(row.location + ": fields 5 to 8 are not a unit quaternion x y z w: repair the file");
    }
    track.Add(1000 * row.TimeUs(0),
              {rotation.normalized(), Eigen::Vector3d(row.Number(1), row.Number(2), row.Number(3))});
  }
  for (size_t i = 0; i < recording.utimes_us.size(); ++i) {
    if (const auto pose = track.At(1000 * recording.utimes_us[i])) {
      recording.ground_truth.push_back({FrameId{static_cast<int64_t>(i)}, recording.utimes_us[i], *pose});
    }
  }
}

}  // namespace

Recording LoadTum(const std::string& folder, const SourceOptions& options) {
  RequireFolder(folder);
  if (options.sensor == SensorType::kStereo) {
    throw InputError("TUM sequence " + folder + " has no second camera: use --sensor mono or rgbd");
  }
  Recording recording;
  recording.times_path = fs::path(folder) / "rgb.txt";
  Calibrate(folder, options, recording);
  OpenImages(folder, options.sensor, recording);
  ReadGroundTruth(fs::path(folder) / "groundtruth.txt", recording);
  return recording;
}

}  // namespace tessera

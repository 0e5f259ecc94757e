// The text files of KITTI, EuRoC and TUM sequences: calibrations, times, lists of images and ground truth.
//
// Input: the format and sensor, then each text file of the format as a piece. The images are there.
#include <array>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "datasets/frame_source.h"
#include "fuzz/fuzz_target.h"
#include "simulation/street_plan.h"

namespace tessera {
namespace {

struct Format {
  const char* source;  // its kind
  SensorType sensor;
  std::vector<const char*> files;
};

const std::vector<Format>& Formats() {
  static const std::vector<Format> formats{
      {"kitti", SensorType::kMono, {"calib.txt", "times.txt", "poses.txt"}},
      {"kitti", SensorType::kStereo, {"calib.txt", "times.txt", "poses.txt"}},
      {"euroc",
       SensorType::kMono,
       {"mav0/cam0/sensor.yaml", "mav0/cam0/data.csv", "mav0/state_groundtruth_estimate0/data.csv"}},
      {"euroc",
       SensorType::kStereo,
       {"mav0/cam0/sensor.yaml", "mav0/cam0/data.csv", "mav0/state_groundtruth_estimate0/data.csv",
        "mav0/cam1/sensor.yaml", "mav0/cam1/data.csv"}},
      {"tum", SensorType::kMono, {"rgb.txt", "groundtruth.txt", "README.txt"}},
      {"tum", SensorType::kRgbd, {"rgb.txt", "depth.txt", "groundtruth.txt", "README.txt"}},
  };
  return formats;
}

void WriteImages(const FuzzFolder& folder) {
  const cv::Mat gray(30, 40, CV_8U, cv::Scalar(90)), depth(30, 40, CV_16U, cv::Scalar(5000));
  for (const char* place : {"image_0", "image_1", "mav0/cam0/data", "mav0/cam1/data", "rgb", "depth"}) {
    for (int i = 0; i < 3; ++i) {
      const std::string name = std::string(place) + "/00000" + std::to_string(i) + ".png";
      folder.Write(name, "");
      cv::imwrite(folder.path(name), std::string(place) == "depth" ? depth : gray);
    }
  }
}

std::string KittiSeed(char format) {
  const std::string pose = "1 0 0 0 0 1 0 0 0 0 1 2\n";
  return std::string(1, format) + Piece("P0: 70 0 20 0 0 71 15 0 0 0 1 0\nP1: 70 0 20 -35 0 71 15 0 0 0 1 0\n") +
         Piece("0.0\n0.1\n0.2\n") + Piece(pose + pose + pose);
}

std::string EurocSeed(char format) {
  const std::string sensor =
      "camera_model: pinhole\nintrinsics: [70, 71, 20, 15]\ndistortion_model: radial-tangential\n"
      "distortion_coefficients: [-0.01, 0.001, 0, 0]\nresolution: [40, 30]\n"
      "T_BS:\n  data: [1, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n";
  const std::string images = "#time,name\n1000000000,000000.png\n1050000000,000001.png\n1100000000,000002.png\n";
  const std::string track = "1000000000,0,0,0,1,0,0,0\n1050000000,0,0,1,1,0,0,0\n1100000000,0,0,2,1,0,0,0\n";
  std::string right = sensor;
  right.replace(right.find("0.1, 0, 1"), 3, "0.3");
  return std::string(1, format) + Piece(sensor) + Piece(images) + Piece(track) + Piece(right) + Piece(images);
}

std::string TumSeed(char format, bool has_depth) {
  const std::string images = "1.0 rgb/000000.png\n1.05 rgb/000001.png\n1.1 rgb/000002.png\n";
  const std::string depths = "1.01 depth/000000.png\n1.06 depth/000001.png\n1.11 depth/000002.png\n";
  const std::string truth = "1.0 0 0 0 0 0 0 1\n1.05 0 0 1 0 0 0 1\n1.1 0 0 2 0 0 0 1\n";
  return std::string(1, format) + Piece(images) + (has_depth ? Piece(depths) : "") + Piece(truth) +
         Piece("fx=fy=60 cx=20 cy=15, factor 5000\n");
}

}  // namespace

std::vector<std::string> Seeds() {
  return {KittiSeed(0), KittiSeed(1), EurocSeed(2), EurocSeed(3), TumSeed(4, false), TumSeed(5, true)};
}

void Read(std::string_view text) {
  static const FuzzFolder folder;
  static const bool has_images = [] {
    WriteImages(folder);
    return true;
  }();
  Expect(has_images, "images can't be written");
  FuzzInput input(text);
  const Format& format = Formats()[input.TakeByte() % Formats().size()];
  for (const char* file : format.files) folder.Write(file, input.TakePiece());
  ExpectSentence([&] {
    const SourceOptions options{.source = std::string(format.source) + ":" + folder.path(""), .sensor = format.sensor};
    const auto source = OpenSource(options);
    while (source->Next()) {
    }
  });
  ExpectSentence([] { (void)PlanFromPoses(folder.path("poses.txt"), 50.0); });
}

}  // namespace tessera

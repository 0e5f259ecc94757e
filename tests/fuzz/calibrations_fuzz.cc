// Calibration files of users, and the calibrations in READMEs of data sets.
//
// Input: the text.
#include <fstream>
#include <iterator>

#include "datasets/calibration_file.h"
#include "datasets/readme_calibration.h"
#include "fuzz/fuzz_target.h"

namespace tessera {

std::vector<std::string> Seeds() {
  std::ifstream file(TESSERA_SOURCE_DIR "/config/cameras/example.yaml");
  return {{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()},
          "fx_px: 458.7\nfy_px: 457.3\ncx_px: 367.2\ncy_px: 248.4\ndistortion: [-0.28, 0.07, 0.0002, 0.00002]\n",
          "fx_px: 400\nfy_px: 400\ncx_px: 300\ncy_px: 200\nbaseline_m: 0.5\ndepth_unit_m: 0.001\n",
          "Calibration: fx=fy=585 cx=320 cy = 240.5, factor 5000, millimeters\n"};
}

void Read(std::string_view text) {
  static const FuzzFolder folder;
  folder.Write("camera.yaml", text);
  ExpectSentence([] { (void)LoadCalibrationFile(folder.path("camera.yaml")); });
  (void)PinholeFromText(std::string(text));
  (void)DepthUnitFromText(std::string(text));
}

}  // namespace tessera

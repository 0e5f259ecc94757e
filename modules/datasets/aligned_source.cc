#include "datasets/aligned_source.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <utility>

#include "core/errors.h"
#include "datasets/changed_source.h"
#include "datasets/remap_table.h"
#include "features/row_offsets.h"

namespace tessera {
namespace {

constexpr std::array<int64_t, 4> kMeasuredFrames{0, 8, 16, 24};
constexpr int kFarthestRow = 12;  // that is searched
constexpr double kMinOffset_px = 1.0 / 3.0;

// Offsets by pair; fewer pairs of a source that is short.
std::vector<std::vector<RowOffset>> MeasurePairs(FrameSource& source) {
  std::vector<std::vector<RowOffset>> pairs;
  for (const int64_t wanted : kMeasuredFrames) {
    source.SkipTo(FrameId{wanted});
    std::optional<CameraFrame> frame = source.Next();
    while (frame && frame->id.value < wanted) frame = source.Next();
    if (!frame) break;
    pairs.push_back(MeasureRowOffsets(frame->left, frame->right, -kFarthestRow, kFarthestRow));
  }
  return pairs;
}

std::optional<RightTurn> Measure(const SourceOptions& options,
                                 const std::function<std::unique_ptr<FrameSource>(const SourceOptions&)>& open) {
  SourceOptions all = options;
  all.first_frame = 0;
  all.last_frame = -1;
  all.with_color = false;
  try {
    const std::unique_ptr<FrameSource> source = open(all);
    return FindRightTurn(MeasurePairs(*source), source->calibration());
  } catch (const InputError&) {
    return std::nullopt;  // the wanted frames may be readable all the same; if not, the run itself tells
  }
}

RemapTable TableOf(const RightTurn& turn, const CameraCalibration& camera) {
  constexpr int kSteps = RemapTable::kSteps;
  const cv::Size size(camera.width_px, camera.height_px);
  cv::Mat whole(size, CV_16SC2), fraction(size, CV_16UC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const Eigen::Vector2d shift_px = turn.Shift_px(camera, x, y);
      const auto steps_x = static_cast<int>(std::lround(kSteps * (x + shift_px.x())));
      const auto steps_y = static_cast<int>(std::lround(kSteps * (y + shift_px.y())));
      // Rounded down, also where they are negative.
      whole.at<cv::Vec2s>(y, x) = {static_cast<int16_t>(steps_x >> 5), static_cast<int16_t>(steps_y >> 5)};
      fraction.at<uint16_t>(y, x) = static_cast<uint16_t>(kSteps * (steps_y & (kSteps - 1)) + (steps_x & (kSteps - 1)));
    }
  }
  static_assert(kSteps == 1 << 5);
  return {whole, fraction, camera.width_px, camera.height_px};
}

std::string NoteOf(const RightTurn& turn, const CameraCalibration& camera) {
  constexpr double kDegree = 0.0174532925;
  char note[200];
  std::snprintf(note, sizeof(note),
                "the rows of the two cameras differ by up to %.1f px: right images are turned by %.2f degrees down and "
                "%.2f about the axis; calibrate the pair anew",
                turn.LargestOffset_px(camera), turn.pitch / kDegree, turn.twist / kDegree);
  return note;
}

class AlignedSource : public ChangedSource {
 public:
  AlignedSource(std::unique_ptr<FrameSource> original, const RightTurn& turn, std::string note)
      : ChangedSource(std::move(original), std::move(note)),
        turn_(turn),
        table_(TableOf(turn, source().calibration())) {}

  RightTurn right_turn() const override { return turn_; }

 private:
  void Change(CameraFrame& frame) const override { frame.right = table_.Interpolate(frame.right); }

  const RightTurn turn_;
  const RemapTable table_;
};

}  // namespace

std::unique_ptr<FrameSource> AlignRows(std::unique_ptr<FrameSource> source, const SourceOptions& options,
                                       const std::function<std::unique_ptr<FrameSource>(const SourceOptions&)>& open) {
  if (options.sensor != SensorType::kStereo || source->is_live()) return source;
  const std::optional<RightTurn> turn = Measure(options, open);
  if (!turn || turn->LargestOffset_px(source->calibration()) < kMinOffset_px) return source;
  std::string note = NoteOf(*turn, source->calibration());
  return std::make_unique<AlignedSource>(std::move(source), *turn, std::move(note));
}

}  // namespace tessera

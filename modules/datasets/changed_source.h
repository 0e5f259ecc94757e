// A source whose frames are those of another one, changed on the way.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "datasets/frame_source.h"

namespace tessera {

class ChangedSource : public FrameSource {
 public:
  // `note`: tells the user of the change, before the notes of the other source.
  ChangedSource(std::unique_ptr<FrameSource> source, std::string note)
      : source_(std::move(source)), notes_{std::move(note)} {
    TakeNotes();
  }

  const CameraCalibration& calibration() const override { return source_->calibration(); }
  std::optional<int64_t> num_frames() const override { return source_->num_frames(); }
  const std::vector<GroundTruthPose>& ground_truth() const override { return source_->ground_truth(); }
  std::optional<CameraFrame> Next() final {
    std::optional<CameraFrame> frame = source_->Next();
    TakeNotes();
    if (frame) Change(*frame);
    return frame;
  }
  ColorReader TakeColor() override { return source_->TakeColor(); }
  bool HasNext() override { return source_->HasNext(); }
  void SkipTo(FrameId frame) override { source_->SkipTo(frame); }
  bool is_live() const override { return source_->is_live(); }
  std::vector<std::string> TakeEvents() override { return source_->TakeEvents(); }
  const std::vector<std::string>& notes() const override { return notes_; }
  std::string loss() const override { return source_->loss(); }
  RightTurn right_turn() const override { return source_->right_turn(); }

 protected:
  virtual void Change(CameraFrame& frame) const = 0;
  FrameSource& source() { return *source_; }

 private:
  // Those that came since; the first is its own.
  void TakeNotes() {
    const std::vector<std::string>& all = source_->notes();
    notes_.insert(notes_.end(), all.begin() + static_cast<ptrdiff_t>(notes_.size() - 1), all.end());
  }

  const std::unique_ptr<FrameSource> source_;
  std::vector<std::string> notes_;
};

}  // namespace tessera

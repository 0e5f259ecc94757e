#include "datasets/camera_session.h"

#include <algorithm>
#include <utility>

#include "core/errors.h"

namespace tessera {

namespace {

// A live source has its own pace.
PacerOptions PaceOf(const FrameSource& source, const CameraSessionOptions& options) {
  PacerOptions pace = options.pace;
  if (source.is_live() || !options.is_followed) pace.kind = PacerOptions::Kind::kFree;
  return pace;
}

// A file that became unreadable is told when it is read as a frame.
ColorImage ReadOrNone(const ColorReader& read) {
  try {
    return read ? read() : ColorImage();
  } catch (const InputError&) {
    return {};
  }
}

}  // namespace

CameraSession::CameraSession(std::unique_ptr<FrameSource> source, const CameraSessionOptions& options, int64_t now_us,
                             SourceOpener open_again)
    : is_followed_(options.is_followed),
      with_color_(options.with_color),
      source_(std::move(source)),
      pacer_(PaceOf(*source_, options)),
      renumbering_(options.num_on_the_way),
      open_again_(std::move(open_again)),
      last_progress_us_(now_us) {}

Result<> CameraSession::MarkTracked(FrameId frame, int64_t utime_us, int64_t now_us) {
  // Frames of an earlier life of this camera may still come back.
  if (first_sent_.valid() && frame.value > std::max(last_sent_, tracked_).value + kMaxFramesAhead) {
    return Failed("its frame " + std::to_string(frame.value) + " is far beyond " + std::to_string(last_sent_.value) +
                  ", the last one sent");
  }
  if (frame > tracked_) {
    tracked_ = frame;
    tracked_utime_us_ = utime_us;
  }
  colors_.erase(colors_.begin(), colors_.lower_bound(frame));
  pacer_.MarkTracked(frame);
  last_progress_us_ = now_us;
  return {};
}

CameraActions CameraSession::TellColor(FrameId frame, int64_t utime_us) {
  if (!with_color_) return {};
  ColorFrame color{.id = frame, .utime_us = utime_us, .image = {}};
  if (const auto found = colors_.find(frame); found != colors_.end()) {
    color.image = ReadOrNone(found->second);
    return {std::move(color)};
  }
  if (!open_again_) return {std::move(color)};
  missed_.push_back(std::move(color));
  if (missed_.size() <= kMaxColors) return {};
  CameraActions dropped{std::move(missed_.front())};
  missed_.pop_front();
  return dropped;
}

CameraActions CameraSession::TellMissedColor() {
  if (missed_.empty()) {
    again_.reset();
    return {};
  }
  ColorFrame color = std::move(missed_.front());
  missed_.pop_front();
  color.image = ReadColorAgain(color.id);
  return {std::move(color)};
}

// Empty if the source does not yield this frame any more.
ColorImage CameraSession::ReadColorAgain(FrameId frame) {
  try {
    if (!again_) again_ = open_again_(frame);
    again_->SkipTo(frame);
    std::optional<CameraFrame> read = again_->Next();
    while (read && read->id < frame) read = again_->Next();
    return read && read->id == frame ? ReadOrNone(again_->TakeColor()) : ColorImage();
  } catch (const InputError&) {
    return {};
  }
}

CameraSession::State CameraSession::Look(int64_t now_us) {
  if (has_ended_) return State::kEnded;
  if (next_ && next_->id <= tracked_) PassOverTracked();
  if (!next_ && is_exhausted_) return State::kAtEnd;
  if (!next_) return source_->HasNext() ? State::kMustRead : State::kWaits;
  return pacer_.MayGo(next_->utime_us, now_us) ? State::kReady : State::kWaits;
}

std::optional<int64_t> CameraSession::NextLookUs(int64_t now_us) const {
  if (source_->is_live()) return now_us + kLookAtLiveUs;
  return next_ ? pacer_.DueUs(next_->utime_us) : std::nullopt;
}

void CameraSession::PassOverTracked() {
  if (source_->is_live()) {
    renumbering_.MoveBehind(tracked_, tracked_utime_us_, *next_);
    return;
  }
  source_->SkipTo({tracked_.value + 1});
  next_.reset();
  pacer_.RestartClock();
}

CameraActions CameraSession::Advance(int64_t now_us) {
  switch (Look(now_us)) {
    case State::kMustRead:
      return Read();
    case State::kReady:
      return Send(now_us);
    case State::kAtEnd: {
      CameraActions actions = End();
      actions.emplace_back(Finish{});
      return actions;
    }
    case State::kWaits:
    case State::kEnded:
      break;
  }
  return {};
}

CameraActions CameraSession::Read() {
  try {
    next_ = source_->Next();
  } catch (const InputError& error) {
    has_ended_ = true;
    return {Fail{.sentence = error.what(), .is_user_error = true}};
  }
  is_exhausted_ = !next_;
  if (next_) renumbering_.Apply(*next_);
  if (next_ && with_color_) next_color_ = source_->TakeColor();
  return {};
}

CameraActions CameraSession::Send(int64_t now_us) {
  last_sent_ = next_->id;
  if (!first_sent_.valid()) first_sent_ = last_sent_;
  next_->age_us += pacer_.LatenessUs(next_->utime_us, now_us);
  pacer_.MarkSent(last_sent_);
  last_progress_us_ = now_us;
  ++num_sent_;
  CameraActions actions = TruthsUpTo(last_sent_);
  KeepColor(actions);
  actions.emplace_back(*std::exchange(next_, std::nullopt));
  return actions;
}

// Of the frame that is sent next.
void CameraSession::KeepColor(CameraActions& actions) {
  if (!with_color_) return;
  ColorReader color = std::exchange(next_color_, nullptr);
  if (is_followed_) {
    colors_[next_->id] = std::move(color);
    if (colors_.size() > kMaxColors) colors_.erase(colors_.begin());
  } else if (ColorImage image = ReadOrNone(color); !image.empty()) {
    actions.emplace_back(ColorFrame{.id = next_->id, .utime_us = next_->utime_us, .image = std::move(image)});
  }
}

CameraActions CameraSession::TruthsUpTo(FrameId frame) {
  const std::vector<GroundTruthPose>& all = source_->ground_truth();
  CameraActions truths;
  for (; num_truths_sent_ < all.size() && all[num_truths_sent_].frame <= frame; ++num_truths_sent_) {
    truths.emplace_back(all[num_truths_sent_]);
  }
  return truths;
}

CameraActions CameraSession::End() {
  if (has_ended_) return {};
  has_ended_ = true;
  last_sent_ = std::max(last_sent_, tracked_);
  CameraActions actions = TruthsUpTo(last_sent_);
  const int64_t num_frames = last_sent_.value + 1;
  actions.emplace_back(EndOfStream{.stage = StageKind::kCamera,
                                   .num_frames = num_frames,
                                   .num_values = first_sent_.valid() ? first_sent_.value : num_frames});
  return actions;
}

std::optional<std::string> CameraSession::Watch(int64_t now_us) {
  const bool was_stuck = is_stuck_;
  is_stuck_ = !has_ended_ && pacer_.num_ahead() > 0 && now_us - last_progress_us_ > kNoPoseUs;
  if (!is_stuck_ || was_stuck) return std::nullopt;
  return "no pose has come for 10 s, and in lockstep frame " + std::to_string(last_sent_.value + 1) +
         " waits for one: is the rest of the stack running?";
}

}  // namespace tessera

#include "stages/camera/live_source.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <thread>
#include <utility>

#include "core/errors.h"
#include "datasets/capture_clock.h"

namespace tessera {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr milliseconds kFirstPause{500}, kLongestPause{5000};
// A reader that is in the middle of waiting for an image is left to itself: the process ends.
constexpr milliseconds kMaxWaitForReader{500};

template <class Clock>
int64_t NowUs() {
  return std::chrono::duration_cast<std::chrono::microseconds>(Clock::now().time_since_epoch()).count();
}

}  // namespace

struct LiveSource::Shared {
  Shared(const LiveSourceOptions& of_run, const CameraCalibration& of_camera)
      : options(of_run), calibration(of_camera), clock(of_run.has_host_stamps) {}

  // Returns whether more are wanted.
  bool Take(CameraFrame frame, ColorReader color);
  void Say(const std::string& sentence) {
    const std::lock_guard lock(mutex);
    events.push_back(sentence);
  }
  // Waits for so long; returns whether to go on.
  bool Pause(milliseconds time) {
    std::unique_lock lock(mutex);
    return !changed.wait_for(lock, time, [this] { return must_stop; });
  }

  const LiveSourceOptions options;
  const CameraCalibration calibration;
  // Of the thread alone.
  CaptureClock clock;
  int64_t next_number = 0;
  int64_t wall_minus_steady_us = NowUs<std::chrono::system_clock>() - NowUs<steady_clock>();

  std::mutex mutex;
  std::condition_variable changed;
  std::optional<CameraFrame> newest;
  ColorReader newest_color;
  int64_t newest_captured_us = 0;  // steady clock
  std::vector<std::string> events;
  std::string failure;  // final
  bool must_stop = false;
  bool has_ended = false;
};

bool LiveSource::Shared::Take(CameraFrame frame, ColorReader color) {
  const int64_t captured_us = clock.CapturedUs(frame.utime_us, NowUs<steady_clock>());
  frame.id = FrameId{next_number++};
  frame.utime_us = captured_us + wall_minus_steady_us;
  const std::lock_guard lock(mutex);
  if (frame.id.value >= options.first_frame) {
    newest = std::move(frame);
    newest_color = std::move(color);
    newest_captured_us = captured_us;
  }
  changed.notify_all();
  return !must_stop && (options.last_frame < 0 || next_number < options.last_frame);
}

LiveSource::LiveSource(Open open, const LiveSourceOptions& options) : options_(options) {
  std::unique_ptr<FrameSource> source = open();
  calibration_ = source->calibration();
  notes_ = source->notes();
  shared_ = std::make_shared<Shared>(options_, calibration_);
  // Detached: a reader that hangs in a driver must not hold up the end of the process.
  std::thread([shared = shared_, open = std::move(open), source = std::move(source)]() mutable {
    Run(shared, open, std::move(source));
    const std::lock_guard lock(shared->mutex);
    shared->has_ended = true;
    shared->changed.notify_all();
  }).detach();
}

LiveSource::~LiveSource() {
  std::unique_lock lock(shared_->mutex);
  shared_->must_stop = true;
  shared_->changed.notify_all();
  shared_->changed.wait_for(lock, kMaxWaitForReader, [this] { return shared_->has_ended; });
}

// Until it is told to stop, or has all wanted frames, or the camera is another one.
void LiveSource::Run(const std::shared_ptr<Shared>& shared, const Open& open, std::unique_ptr<FrameSource> source) {
  milliseconds pause = kFirstPause;
  while (true) {
    std::string why = "it ended";
    try {
      while (source != nullptr) {
        std::optional<CameraFrame> frame = source->Next();
        if (!frame) break;
        pause = kFirstPause;
        if (!shared->Take(std::move(*frame), source->TakeColor())) return;
      }
    } catch (const std::exception& error) {
      why = error.what();
    }
    if (source != nullptr) shared->Say("the connection to the camera broke off (" + why + "); it is opened again");
    source.reset();
    if (!shared->Pause(pause)) return;
    pause = std::min(2 * pause, kLongestPause);
    try {
      source = open();
    } catch (const std::exception&) {
      continue;  // told already
    }
    if (source->calibration() != shared->calibration) {
      const std::lock_guard lock(shared->mutex);
      shared->failure = "the camera came back with images of another size: start the run again";
      return;
    }
    shared->Say("the camera is connected again");
  }
}

std::optional<int64_t> LiveSource::num_frames() const {
  return options_.last_frame < 0 ? std::nullopt : std::optional(options_.last_frame - options_.first_frame);
}

bool LiveSource::HasNext() {
  const std::lock_guard lock(shared_->mutex);
  return shared_->newest || shared_->has_ended;
}

std::optional<CameraFrame> LiveSource::Next() {
  std::unique_lock lock(shared_->mutex);
  shared_->changed.wait(lock, [this] { return shared_->newest || shared_->has_ended; });
  if (!shared_->failure.empty()) throw InputError(shared_->failure);
  std::optional<CameraFrame> frame = std::exchange(shared_->newest, std::nullopt);
  color_ = std::exchange(shared_->newest_color, nullptr);
  if (frame) frame->age_us = NowUs<steady_clock>() - shared_->newest_captured_us;
  return frame;
}

std::vector<std::string> LiveSource::TakeEvents() {
  const std::lock_guard lock(shared_->mutex);
  return std::exchange(shared_->events, {});
}

}  // namespace tessera

#include "stages/occupancy/occupancy_stage.h"

#include <chrono>

#include "core/errors.h"
#include "core/files.h"
#include "evaluation/run_files.h"

namespace tessera {
namespace {

constexpr std::chrono::seconds kPublishPeriod{1};
// After the end of the map, an image that has not come for this long won't come any more: streams give up long before.
constexpr int64_t kLastNewsTimeoutUs = 10'000'000;

OccupancySessionOptions OptionsFrom(const Settings& settings) {
  const auto occupancy = settings.Get<OccupancySettings>();
  OccupancySessionOptions options;
  options.map = {.resolution = occupancy.resolution_m,
                 .max_range = occupancy.max_range_m,
                 .min_range = occupancy.min_range_m,
                 .prob_hit = occupancy.prob_hit,
                 .prob_miss = occupancy.prob_miss,
                 .prob_min = occupancy.prob_min,
                 .prob_max = occupancy.prob_max};
  options.with_color = settings.Get<CameraSettings>().color;
  options.scratch_dir = settings.Get<StreamTimingSettings>().journal_dir;
  options.max_disparity_px = settings.Get<FeaturesSettings>().max_disparity_px;
  return options;
}

HeightBand BandFrom(const Settings& settings) {
  const auto occupancy = settings.Get<OccupancySettings>();
  return {.below_camera = occupancy.grid_below_camera_m, .above_camera = occupancy.grid_above_camera_m};
}

}  // namespace

OccupancyStage::OccupancyStage(StageContext& context)
    : context_(context),
      out_dir_(context.settings().Get<EvaluatorSettings>().out_dir),
      band_(BandFrom(context.settings())),
      session_(OptionsFrom(context.settings())),
      map_(
          context, true, [this](const MapFollower::Delta& delta) { return session_.Receive(*delta); },
          [this] { WatchTheEnd(); }),
      updates_(context.Advertise(kOccupancy)) {
  // Its images are most of what is on the buses.
  if (context.settings().Get<CameraSettings>().sensor != ToString(SensorType::kMono)) Receive(kCamera);
  if (context.settings().Get<CameraSettings>().color) Receive(kColor);
  Receive(kPose);
  Receive(kRemovedKeyframes);
  context.Subscribe(kKeyframe, [this](const KeyframeObservation& keyframe) {
    last_news_us_ = context_.now_us();
    if (const Result<> fits = session_.Receive(keyframe); !fits)
      context_.Fail("occupancy: " + fits.error().sentence, 2);
  });
  context.Subscribe(kEndOfStream, [this](const EndOfStream& end) {
    if (end.stage == StageKind::kTracker) session_.ExpectKeyframes(end.num_values);
    map_.Receive(end);
  });
  context.Subscribe(kOccupancyRequest, [this](const OccupancyRequest&) { is_whole_wanted_ = true; });
  context.WhenIdle([this] { return Advance(); });
  context.Every(kPublishPeriod, [this] {
    Publish();
    WatchTheEnd();
  });
}

template <class Value>
void OccupancyStage::Receive(const Topic<Value>& topic) {
  context_.Subscribe(topic, [this](const Value& value) {
    last_news_us_ = context_.now_us();
    session_.Receive(value);
  });
}

// One scan, so that messages do not wait for long. Returns whether there may be more to do.
bool OccupancyStage::Advance() {
  if (context_.finished()) return false;
  const int64_t began_us = context_.now_us();
  if (!session_.Advance()) return false;
  last_news_us_ = context_.now_us();
  context_.RecordStep(1e-3 * static_cast<double>(last_news_us_ - began_us));
  context_.SetQueue(session_.num_waiting());
  context_.SetValue("scans", static_cast<double>(session_.occupancy()->scans().size()));
  context_.SetValue("blocks", static_cast<double>(session_.occupancy()->num_blocks()));
  return true;
}

void OccupancyStage::Publish() {
  OccupancyMap* const occupancy = session_.occupancy();
  if (occupancy == nullptr) return;
  OccupancyUpdate update{.number = num_published_,
                         .resolution = occupancy->options().resolution,
                         .is_whole = is_whole_wanted_,
                         .num_keyframes = static_cast<int64_t>(occupancy->scans().size()),
                         .blocks = occupancy->TakeChangedBlocks(),
                         .colors = {}};
  if (is_whole_wanted_) update.blocks = occupancy->Blocks();
  if (update.blocks.empty() && !is_whole_wanted_) return;
  update.colors = occupancy->ColorsOf(update.blocks);
  is_whole_wanted_ = false;
  updates_.Publish(update);
  ++num_published_;
}

void OccupancyStage::WatchTheEnd() {
  if (!map_.is_complete() || context_.finished()) return;
  session_.EndMap();
  if (context_.now_us() - last_news_us_ > kLastNewsTimeoutUs) session_.GiveUp();
  if (session_.is_done()) Finish();
}

void OccupancyStage::Finish() {
  const int64_t num_missing = session_.num_without_scan();
  context_.SetValue("keyframes_without_scan", static_cast<double>(num_missing));
  if (num_missing > 0) {
    context_.ReportError("the images of " + std::to_string(num_missing) +
                         " keyframes did not come: the occupancy map lacks what they saw");
  }
  Publish();
  try {
    if (!out_dir_.empty()) WriteFiles();
  } catch (const InputError& error) {
    return context_.Fail(error.what(), 2);
  }
  context_.Finish();
}

void OccupancyStage::WriteFiles() const {
  const OccupancyMap* const occupancy = session_.occupancy();
  if (occupancy == nullptr) return context_.Info("there was no keyframe: no occupancy map is written");
  MakeRunFolder(out_dir_);
  OccupancyStates states(occupancy->options().resolution);
  states.Set(occupancy->Blocks());
  if (const auto grid = MakeGrid(states, session_.Path(), band_)) {
    WriteFile(out_dir_ + "/occupancy.pgm", GridImageFile(*grid));
    WriteFile(out_dir_ + "/occupancy.yaml", GridDescriptionFile(*grid, "occupancy.pgm"));
  }
  WriteFile(out_dir_ + "/occupancy.ot", occupancy->ColorTreeFile());
  WriteFile(out_dir_ + "/occupancy.bt", states.BinaryTreeFile());
  context_.Info("wrote the occupancy map of " + std::to_string(occupancy->scans().size()) + " keyframes to " +
                out_dir_);
}

}  // namespace tessera

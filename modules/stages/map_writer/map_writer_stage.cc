#include "stages/map_writer/map_writer_stage.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>

#include "core/errors.h"
#include "core/files.h"
#include "evaluation/map_ply.h"

namespace tessera {
namespace {

// An occupancy stage answers between two scans.
constexpr std::chrono::milliseconds kAskAgain{500};
constexpr int64_t kMaxAsked = 20;
// No color for so long: the run is gray, or its camera has ended. Streams tell more often what they have.
constexpr int64_t kNoColorUs = 2'000'000;
// In which a camera can have told all that it keeps; a map that was loaded may have later frames than the run.
constexpr int64_t kMaxWaitForColorsUs = 10'000'000;
constexpr std::chrono::milliseconds kLookAgain{100};
// A mapper answers who comes late with an old snapshot and the deltas behind it, one after the other: the map is that
// of now when none has come for so long, or after so long in all, where new ones never stop.
constexpr int64_t kQuietUs = 400'000;
constexpr int64_t kMaxCatchUpUs = 3'000'000;

std::string PathFrom(const Settings& settings) {
  auto path = settings.Get<MapWriterSettings>().path;
  if (path.empty()) {
    throw InputError("map_writer.path is empty: say where the map goes with --set map_writer.path=FILE.ply");
  }
  return path;
}

HeightBand BandFrom(const Settings& settings) {
  const auto occupancy = settings.Get<OccupancySettings>();
  return {.below_camera = occupancy.grid_below_camera_m, .above_camera = occupancy.grid_above_camera_m};
}

}  // namespace

MapWriterStage::MapWriterStage(StageContext& context)
    : context_(context),
      path_(PathFrom(context.settings())),
      kind_(KindOf(path_)),
      follows_(context.settings().Get<MapWriterSettings>().follow),
      band_(BandFrom(context.settings())),
      map_(
          context, true, [this](const MapFollower::Delta& delta) { return Apply(*delta); }, [this] { WriteIfDone(); }) {
  map_.FollowToEnd();
  context.Every(kLookAgain, [this] { WriteIfDone(); });
  if (kind_ == Kind::kLandmarks) {
    context.Subscribe(kColor, [this](const ColorFrame& color) { Receive(color); });
    return;
  }
  if (follows_) {
    throw InputError("map_writer.follow is for PLY files: at the end of a run, its folder holds the occupancy map");
  }
  requests_ = context.Advertise(kOccupancyRequest);
  context.Subscribe(kOccupancy, [this](const OccupancyUpdate& update) {
    if (update.is_whole) occupancy_ = update;
    WriteIfDone();
  });
  context.Every(kAskAgain, [this] { AskForOccupancy(); });
}

MapWriterStage::Kind MapWriterStage::KindOf(const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  if (ending == ".bt") return Kind::kOccupancyTree;
  if (ending == ".ot") return Kind::kColorTree;
  return ending == ".pgm" ? Kind::kOccupancyGrid : Kind::kLandmarks;
}

void MapWriterStage::AskForOccupancy() {
  if (occupancy_ || context_.finished()) return;
  if (num_asked_ == kMaxAsked) {
    return context_.Fail("no occupancy stage answers: the stack must run with --occupancy, and have a keyframe");
  }
  requests_.Publish({.num_asked = num_asked_++});
}

Result<> MapWriterStage::Apply(const MapDelta& delta) {
  TESSERA_RETURN_IF_FAILED(replica_.Apply(delta));
  context_.SetValue("deltas", static_cast<double>(replica_.next_delta()));
  colors_.Receive(delta);
  last_delta_us_ = context_.now_us();
  if (!map_since_us_) map_since_us_ = last_color_us_ = last_delta_us_;
  if (!delta.new_keyframes.empty()) newest_keyframe_ = delta.new_keyframes.back().features->frame;
  return {};
}

void MapWriterStage::Receive(const ColorFrame& color) {
  colors_.Receive(color);
  newest_color_ = std::max(newest_color_, color.id);
  last_color_us_ = context_.now_us();
  WriteIfDone();
}

bool MapWriterStage::HasCaughtUp() const {
  const int64_t now_us = context_.now_us();
  return map_.is_complete() || now_us - last_delta_us_ >= kQuietUs ||
         now_us - map_since_us_.value_or(now_us) >= kMaxCatchUpUs;
}

// As far as the camera still has them: it tells one of each keyframe, in their order.
bool MapWriterStage::HasColors() const {
  const int64_t now_us = context_.now_us();
  return newest_color_ >= newest_keyframe_ || now_us - last_color_us_ >= kNoColorUs ||
         now_us - map_since_us_.value_or(now_us) >= kMaxWaitForColorsUs;
}

// Each delta brought the owner's hash, and Apply() compared it: a replica that is not rejected has the owner's map.
void MapWriterStage::WriteIfDone() {
  const bool is_there = replica_.next_delta() > 0 && !map_.needs_snapshot();
  if (context_.finished() || !is_there || (follows_ && !map_.is_complete())) return;
  if (!HasCaughtUp()) return;
  if (kind_ == Kind::kLandmarks ? !HasColors() : !occupancy_) return;
  try {
    Write();
  } catch (const InputError& error) {
    context_.Fail(error.what(), 2);
    return;
  }
  std::fflush(stdout);
  context_.Finish();
}

void MapWriterStage::Write() const {
  if (kind_ == Kind::kLandmarks) {
    WriteLandmarks();
  } else {
    WriteOccupancy();
  }
}

void MapWriterStage::WriteLandmarks() const {
  WriteFile(path_, PlyFile(replica_, colors_, context_.settings().Get<BodySettings>().BaseFromCamera()));
  std::printf("map after delta %lld: %lld keyframes, %lld landmarks, hash %016llx as the mapper's, SHA-256 %s\n",
              static_cast<long long>(replica_.next_delta() - 1), static_cast<long long>(replica_.keyframes().size()),
              static_cast<long long>(replica_.landmarks().size()), static_cast<unsigned long long>(replica_.hash()),
              replica_.Sha256Hex().c_str());
}

void MapWriterStage::WriteOccupancy() const {
  OccupancyStates states(occupancy_->resolution);
  states.Set(occupancy_->blocks, occupancy_->colors);
  if (kind_ == Kind::kOccupancyTree) {
    WriteFile(path_, states.BinaryTreeFile());
  } else if (kind_ == Kind::kColorTree) {
    WriteFile(path_, states.ColorTreeFile());
  } else {
    std::vector<Rigid3> path;
    replica_.keyframes().ForEach(
        [&](KeyframeId, const Keyframe& keyframe) { path.push_back(keyframe.world_from_camera); });
    const auto grid = MakeGrid(states, path, band_);
    if (!grid) throw InputError("nothing is known of space yet: try again when there are more keyframes");
    const std::filesystem::path image(path_);
    WriteFile(path_, GridImageFile(*grid));
    WriteFile(std::filesystem::path(image).replace_extension(".yaml").string(),
              GridDescriptionFile(*grid, image.filename().string()));
  }
  std::printf("occupancy map of %lld keyframes: %lld voxels occupied, %lld free, of %.4g each\n",
              static_cast<long long>(occupancy_->num_keyframes),
              static_cast<long long>(states.Num(VoxelState::kOccupied)),
              static_cast<long long>(states.Num(VoxelState::kFree)), states.resolution());
}

}  // namespace tessera

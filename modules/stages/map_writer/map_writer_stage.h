// Wiring of the map writer: joins a running stack at any time, follows the map, and writes it as a cloud of points, or
// writes its occupancy map.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "map/landmark_colors.h"
#include "map/map.h"
#include "messages/occupancy_types.h"
#include "occupancy/occupancy_grid.h"
#include "runtime/map_subscription.h"
#include "runtime/stage.h"

namespace tessera {

class MapWriterStage {
 public:
  // Throws InputError if no path is given, or if it does not fit the other settings.
  explicit MapWriterStage(StageContext& context);

 private:
  // What is written, by the ending of the file's name.
  enum class Kind { kLandmarks, kOccupancyTree, kColorTree, kOccupancyGrid };
  static Kind KindOf(const std::string& path);

  void AskForOccupancy();
  Result<> Apply(const MapDelta& delta);
  void Receive(const ColorFrame& color);
  bool HasCaughtUp() const;
  bool HasColors() const;
  void WriteIfDone();
  void Write() const;
  void WriteLandmarks() const;
  void WriteOccupancy() const;

  StageContext& context_;
  const std::string path_;
  const Kind kind_;
  const bool follows_;
  const HeightBand band_;
  MapSubscription map_;
  Map replica_;
  LandmarkColors colors_{/*joins_late=*/true};
  FrameId newest_keyframe_, newest_color_;
  std::optional<int64_t> map_since_us_;
  int64_t last_delta_us_ = 0;
  int64_t last_color_us_ = 0;  // when the last color came, or the map did
  Publisher<OccupancyRequest> requests_;
  int64_t num_asked_ = 0;
  std::optional<OccupancyUpdate> occupancy_;  // the whole
};

}  // namespace tessera

// A box-shaped room, and what a depth camera sees of it from inside.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "geometry/rigid3.h"
#include "occupancy/occupancy_map.h"

namespace tessera {

inline const CameraCalibration kDepthCamera{.sensor = SensorType::kRgbd,
                                            .width_px = 80,
                                            .height_px = 60,
                                            .fx_px = 60.0,
                                            .fy_px = 60.0,
                                            .cx_px = 39.5,
                                            .cy_px = 29.5,
                                            .depth_unit_m = 0.001};

inline constexpr double kRoomHalf = 1.5;  // m: the room's walls are at -kRoomHalf and kRoomHalf of each axis

inline OccupancyOptions RoomOptions() { return {.resolution = 0.1, .max_range = 4.0}; }

// The camera at `position`, turned about the y axis.
inline Rigid3 CameraAt(const Eigen::Vector3d& position, double yaw_rad) {
  return {ExpSO3({0.0, yaw_rad, 0.0}), position};
}

// What a depth camera sees of the room.
inline CameraFrame DepthFrameOf(const Rigid3& world_from_camera) {
  CameraFrame frame;
  frame.sensor = SensorType::kRgbd;
  frame.left = GrayImage(kDepthCamera.width_px, kDepthCamera.height_px, 90);
  frame.depth = DepthImage(kDepthCamera.width_px, kDepthCamera.height_px);
  for (int y = 0; y < frame.depth.height; ++y) {
    for (int x = 0; x < frame.depth.width; ++x) {
      const Eigen::Vector3d ray = world_from_camera.rotation * kDepthCamera.Ray({x, y});
      double depth = std::numeric_limits<double>::infinity();
      for (int axis = 0; axis < 3; ++axis) {
        if (ray[axis] == 0.0) continue;
        const double wall = ray[axis] > 0.0 ? kRoomHalf : -kRoomHalf;
        depth = std::min(depth, (wall - world_from_camera.translation[axis]) / ray[axis]);
      }
      frame.depth.row(y)[x] = static_cast<uint16_t>(std::lround(depth / kDepthCamera.depth_unit_m));
    }
  }
  return frame;
}

// `color`: its left image in color; empty: that is gray.
inline OccupancyMap::SharedScan ScanOfRoom(const Rigid3& world_from_camera, const ColorImage& color = {}) {
  return std::make_shared<const Scan>(
      ScanFromImages(DepthFrameOf(world_from_camera), color, kDepthCamera, RoomOptions(), /*max_disparity_px=*/0));
}
inline ColorImage Painted(const Rgb& color) { return {kDepthCamera.width_px, kDepthCamera.height_px, color}; }

}  // namespace tessera

// Points in front of two cameras, and where these see them.
#pragma once

#include <random>
#include <vector>

#include "geometry/camera.h"
#include "geometry/reprojection.h"
#include "geometry/rigid3.h"
#include "geometry/two_view.h"

namespace tessera {

inline CameraCalibration MakeCamera() {
  CameraCalibration camera;
  camera.width_px = 1240;
  camera.height_px = 480;
  camera.fx_px = camera.fy_px = 700.0;
  camera.cx_px = 620.0;
  camera.cy_px = 240.0;
  return camera;
}

inline constexpr double kViewBaseline = 0.5;  // meters

// Where the camera shows a point, exactly.
inline PixelObservation SeePoint(const Eigen::Vector3d& point_in_camera, bool has_right) {
  const CameraCalibration camera = MakeCamera();
  PixelObservation seen{camera.Project(point_in_camera), kNoColumn, 1.3};
  if (has_right) seen.right_x_px = seen.pixel_px.x() - camera.fx_px * kViewBaseline / point_in_camera.z();
  return seen;
}

enum class Scene { kGeneral, kPlane };

// Points of the first camera's frame that both cameras see, at depths of 4 to 20; the plane is a wall aslant.
inline std::vector<Eigen::Vector3d> MakePoints(Scene scene, const Rigid3& second_from_first, size_t num) {
  const CameraCalibration camera = MakeCamera();
  const auto is_seen = [&](const Eigen::Vector3d& point) {
    if (point.z() < 0.5) return false;
    const Eigen::Vector2d pixel = camera.Project(point);
    return pixel.x() >= 0.0 && pixel.x() < camera.width_px && pixel.y() >= 0.0 && pixel.y() < camera.height_px;
  };
  std::mt19937_64 generator(11);
  std::uniform_real_distribution<double> column(0.0, camera.width_px), row(0.0, camera.height_px), depth(4.0, 20.0);
  std::vector<Eigen::Vector3d> points;
  while (points.size() < num) {
    const double x = column(generator), y = row(generator), z = depth(generator);
    const Eigen::Vector3d ray = camera.Ray({x, y});
    const Eigen::Vector3d normal = Eigen::Vector3d(0.5, 0.2, 1.0).normalized();
    const double z_of_plane = 8.0 / normal.dot(ray);
    const Eigen::Vector3d point = ray * (scene == Scene::kPlane ? z_of_plane : z);
    if (is_seen(point) && is_seen(second_from_first * point)) points.push_back(point);
  }
  return points;
}

// Their pixels with Gaussian noise; every `outlier_step`-th pair is a wrong match (0: none).
inline std::vector<PixelPair> MakePairs(const std::vector<Eigen::Vector3d>& points, const Rigid3& second_from_first,
                                        double noise_px, size_t outlier_step) {
  const CameraCalibration camera = MakeCamera();
  std::mt19937_64 generator(12);
  std::normal_distribution<double> normal(0.0, 1.0);
  std::vector<PixelPair> pairs;
  for (size_t i = 0; i < points.size(); ++i) {
    const bool is_wrong = outlier_step > 0 && i % outlier_step == 0;
    const Eigen::Vector3d& seen_in_second = points[is_wrong ? (i + 37) % points.size() : i];
    PixelPair pair{camera.Project(points[i]), camera.Project(second_from_first * seen_in_second)};
    for (Eigen::Vector2d* pixel : {&pair.first_px, &pair.second_px}) {
      const double dx = normal(generator), dy = normal(generator);
      *pixel += noise_px * Eigen::Vector2d(dx, dy);
    }
    pairs.push_back(pair);
  }
  return pairs;
}

}  // namespace tessera

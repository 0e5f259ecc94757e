// Draws a world as a pinhole camera sees it, with the depth of each pixel. One thread; float arithmetic in a fixed
// order.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "core/image.h"
#include "geometry/camera.h"
#include "geometry/rigid3.h"
#include "simulation/paint_store.h"
#include "simulation/world.h"

namespace tessera {

using RadianceImage = Image<uint16_t>;   // gray values times 256: light that reaches a pixel
using InverseDepthImage = Image<float>;  // 1 / z of the surface in the middle of the pixel, 1/m; 0: nothing there

struct Rendering {
  RadianceImage radiance;
  InverseDepthImage inverse_depth;
  GrayImage body;  // 1 where the world's `body` is in view; empty without one
};

class Renderer {
 public:
  explicit Renderer(std::shared_ptr<const World> world);
  ~Renderer();

  // The world at this time, from this position; `body_from_camera` is where this camera sits in the world's `body`.
  // Surfaces are drawn from near to far against a buffer of inverse depths;
  // paint is looked up bilinearly in the level whose texels are about as large as a pixel.
  void Render(const CameraCalibration& camera, const Rigid3& world_from_camera, double time_s, Rendering& out,
              const Rigid3& body_from_camera = Rigid3());

  // A rolling shutter: the rows are seen one after another, each band of kBandRows rows from the pose of its middle,
  // `world_from_camera(row)`. Cars stand where they are at `time_s`. The camera must not turn by more than some
  // 0.3 rad while it reads.
  static constexpr int kBandRows = 2;
  void RenderRolling(const CameraCalibration& camera, const std::function<Rigid3(double)>& world_from_camera,
                     double time_s, Rendering& out, const Rigid3& body_from_camera = Rigid3());

 private:
  struct Visible {
    double distance_m;
    size_t order;     // ties
    Surface surface;  // in the world
  };
  // What can be seen within `margin_px` around the picture, from near to far.
  void Collect(const CameraCalibration& camera, const Rigid3& world_from_camera, double time_s, double margin_px);
  void Clear(const CameraCalibration& camera, Rendering& out) const;
  // Nearer than all else.
  void DrawBody(const CameraCalibration& camera, const Rigid3& body_from_camera, Rendering& out);
  // Draws rows [first, last) of what was collected.
  void DrawRows(const CameraCalibration& camera, const Rigid3& world_from_camera, int first, int last, Rendering& out);

  std::shared_ptr<const World> world_;
  PaintStore paints_;
  std::vector<Visible> visible_;
};

}  // namespace tessera

#include "simulation/renderer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

namespace tessera {
namespace {

constexpr double kNearM = 0.1;
constexpr int kChunk = 16;  // pixels that share a level of the paint
constexpr uint16_t kHorizonGray = 205 * 256;

// A parallelogram in camera coordinates, set up for drawing. With n = across x up, the plane's point on the ray
// r = (x, y, 1) is r / w with
//   w = 1 / z = (n . r) / (n . corner),
// and its position in the parallelogram is, with the dual basis a* = (up x n) / |n|^2, b* = (n x across) / |n|^2,
//   a = (a* . r) / w - a* . corner,   b likewise:
// each numerator is affine in the pixel.
struct AffineRow {
  float at_zero, by_x;
};

struct Plane {
  Eigen::Vector3d inverse_depth;  // dot with r gives w
  Eigen::Vector3d a, b;           // numerators, in texels of the finest level
  double a_offset, b_offset;
};

class Drawer {
 public:
  // Draws rows [first_row, last_row).
  Drawer(const CameraCalibration& camera, int first_row, int last_row, Rendering& out)
      : camera_(camera), first_row_(first_row), last_row_(last_row), out_(out) {}

  // The surface is in the camera's frame.
  void Draw(const Surface& surface, const Texture& texture);

 private:
  struct Span {
    int first, last;  // pixels [first, last)
  };

  // The parallelogram cut at z = kNearM, in pixels; fewer than three points: nothing to see.
  std::vector<Eigen::Vector2d> Outline(const Surface& surface) const;
  static Plane MakePlane(const Surface& surface, const GrayImage& finest);
  // Pixels of row y whose middle lies inside the convex outline.
  Span SpanOf(const std::vector<Eigen::Vector2d>& outline, int y) const;
  AffineRow RowOf(const Eigen::Vector3d& coefficients, int y) const;
  void DrawRow(const Plane& plane, const Surface& surface, const Texture& texture, int y, const Span& span);

  const CameraCalibration& camera_;
  int first_row_, last_row_;
  Rendering& out_;
};

std::vector<Eigen::Vector2d> Drawer::Outline(const Surface& surface) const {
  const std::array<Eigen::Vector3d, 4> corners = surface.Corners();
  // A triangle leaves out the corner opposite to it. Neighbors run along a common edge in the same direction, so that
  // rounding leaves no gap.
  std::array<size_t, 4> order{0, 1, 2, 3};
  if (surface.part == SurfacePart::kLower) order = {0, 1, 3, 3};
  if (surface.part == SurfacePart::kUpper) order = {3, 2, 1, 1};
  const size_t num = surface.part == SurfacePart::kWhole ? 4 : 3;
  std::vector<Eigen::Vector2d> outline;
  for (size_t i = 0; i < num; ++i) {
    const Eigen::Vector3d& from = corners[order[i]];
    const Eigen::Vector3d& to = corners[order[(i + 1) % num]];
    if (from.z() >= kNearM) outline.push_back(camera_.Project(from));
    if ((from.z() >= kNearM) != (to.z() >= kNearM)) {
      const double part = (kNearM - from.z()) / (to.z() - from.z());
      Eigen::Vector3d cut = from + part * (to - from);
      cut.z() = kNearM;
      outline.push_back(camera_.Project(cut));
    }
  }
  return outline;
}

Plane Drawer::MakePlane(const Surface& surface, const GrayImage& finest) {
  const auto& [corner, across, up] = std::tie(surface.corner, surface.across, surface.up);
  const Eigen::Vector3d n = across.cross(up);
  const double squared = n.squaredNorm();
  // Rows of the paint run from top to bottom.
  const Eigen::Vector3d a = up.cross(n) * (finest.width / squared);
  const Eigen::Vector3d b = n.cross(across) * (-finest.height / squared);
  return {n / n.dot(corner), a, b, -a.dot(corner), finest.height - b.dot(corner)};
}

Drawer::Span Drawer::SpanOf(const std::vector<Eigen::Vector2d>& outline, int y) const {
  double low = 1e9;
  double high = -1e9;
  for (size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d& p = outline[i];
    const Eigen::Vector2d& q = outline[(i + 1) % outline.size()];
    if ((p.y() <= y) == (q.y() <= y)) continue;
    const double x = p.x() + (y - p.y()) / (q.y() - p.y()) * (q.x() - p.x());
    low = std::min(low, x);
    high = std::max(high, x);
  }
  if (low > high) return {0, 0};
  const double first = std::clamp(std::ceil(low), 0.0, static_cast<double>(camera_.width_px));
  const double last = std::clamp(std::ceil(high), 0.0, static_cast<double>(camera_.width_px));
  return {static_cast<int>(first), static_cast<int>(last)};
}

AffineRow Drawer::RowOf(const Eigen::Vector3d& c, int y) const {
  const double ray_y = (y - camera_.cy_px) / camera_.fy_px;
  const double by_x = c.x() / camera_.fx_px;
  return {static_cast<float>(c.y() * ray_y + c.z() - by_x * camera_.cx_px), static_cast<float>(by_x)};
}

// log2 of a positive number, rounded down.
int FloorLog2(float x) { return static_cast<int>(std::bit_cast<uint32_t>(x) >> 23) - 127; }

void Drawer::DrawRow(const Plane& plane, const Surface& surface, const Texture& texture, int y, const Span& span) {
  const AffineRow w_row = RowOf(plane.inverse_depth, y);
  const AffineRow a_row = RowOf(plane.a, y);
  const AffineRow b_row = RowOf(plane.b, y);
  const auto a_offset = static_cast<float>(plane.a_offset);
  const auto b_offset = static_cast<float>(plane.b_offset);
  const auto w_by_y = static_cast<float>(plane.inverse_depth.y() / camera_.fy_px);
  const auto a_by_y = static_cast<float>(plane.a.y() / camera_.fy_px);
  const auto b_by_y = static_cast<float>(plane.b.y() / camera_.fy_px);
  const auto brightness = static_cast<int>(surface.brightness * 256.0F);
  uint16_t* radiance = out_.radiance.row(y);
  float* inverse_depth = out_.inverse_depth.row(y);
  for (int begin = span.first; begin < span.last; begin += kChunk) {
    const int end = std::min(begin + kChunk, span.last);
    // Texels that one pixel covers along rows and columns, in the chunk's middle: d(a / w) = (da - (a / w) dw) / w.
    const float x_mid = 0.5F * static_cast<float>(begin + end - 1);
    const float w_mid = w_row.at_zero + x_mid * w_row.by_x;
    const float z_mid = 1.0F / std::max(w_mid, 1e-6F);
    const float a_mid = (a_row.at_zero + x_mid * a_row.by_x) * z_mid;
    const float b_mid = (b_row.at_zero + x_mid * b_row.by_x) * z_mid;
    const auto square = [](float v) { return v * v; };
    const float by_x =
        square((a_row.by_x - a_mid * w_row.by_x) * z_mid) + square((b_row.by_x - b_mid * w_row.by_x) * z_mid);
    const float by_y = square((a_by_y - a_mid * w_by_y) * z_mid) + square((b_by_y - b_mid * w_by_y) * z_mid);
    // Between the two: the larger alone would blur what is seen at a flat angle.
    const float covered = std::clamp(std::sqrt(by_x * by_y) * 0.7F + 0.3F * std::max(by_x, by_y), 1e-12F, 1e12F);
    const int level = std::clamp((FloorLog2(covered) + 1) / 2, 0, static_cast<int>(texture.levels.size()) - 1);
    const GrayImage& paint = texture.levels[static_cast<size_t>(level)];
    const GrayImage* cover = texture.cover.empty() ? nullptr : &texture.cover[static_cast<size_t>(level)];
    const float scale_a = static_cast<float>(paint.width) / static_cast<float>(texture.levels[0].width);
    const float scale_b = static_cast<float>(paint.height) / static_cast<float>(texture.levels[0].height);
    const float max_a = static_cast<float>(paint.width - 1) - 0.01F;
    const float max_b = static_cast<float>(paint.height - 1) - 0.01F;
    for (int x = begin; x < end; ++x) {
      const auto xf = static_cast<float>(x);
      const float w = w_row.at_zero + xf * w_row.by_x;
      if (w <= inverse_depth[x]) continue;
      const float z = 1.0F / w;
      const float a = std::clamp(((a_row.at_zero + xf * a_row.by_x) * z + a_offset) * scale_a - 0.5F, 0.0F, max_a);
      const float b = std::clamp(((b_row.at_zero + xf * b_row.by_x) * z + b_offset) * scale_b - 0.5F, 0.0F, max_b);
      const auto a_fixed = static_cast<int>(a * 256.0F);
      const auto b_fixed = static_cast<int>(b * 256.0F);
      const ptrdiff_t index = static_cast<ptrdiff_t>(b_fixed >> 8) * paint.width + (a_fixed >> 8);
      if (cover != nullptr && cover->pixels[static_cast<size_t>(index)] < 128) continue;
      const uint8_t* texel = paint.pixels.data() + index;
      const int right = a_fixed & 255;
      const int down = b_fixed & 255;
      const int top = texel[0] * (256 - right) + texel[1] * right;
      const int bottom = texel[paint.width] * (256 - right) + texel[paint.width + 1] * right;
      const int gray = (top * (256 - down) + bottom * down) >> 8;  // times 256
      radiance[x] = static_cast<uint16_t>(std::min((gray * brightness) >> 8, 65535));
      inverse_depth[x] = w;
    }
  }
}

void Drawer::Draw(const Surface& surface, const Texture& texture) {
  const std::vector<Eigen::Vector2d> outline = Outline(surface);
  if (outline.size() < 3) return;
  double top = 1e9;
  double bottom = -1e9;
  for (const Eigen::Vector2d& p : outline) {
    top = std::min(top, p.y());
    bottom = std::max(bottom, p.y());
  }
  const auto row_of = [&](double y) {
    return static_cast<int>(std::clamp(std::ceil(y), static_cast<double>(first_row_), static_cast<double>(last_row_)));
  };
  const int first = row_of(top), last = row_of(bottom);
  if (first >= last) return;
  const Plane plane = MakePlane(surface, texture.levels[0]);
  for (int y = first; y < last; ++y) {
    const Span span = SpanOf(outline, y);
    if (span.first < span.last) DrawRow(plane, surface, texture, y, span);
  }
}

Surface InCamera(const Rigid3& camera_from_world, Surface surface) {
  surface.corner = camera_from_world * surface.corner;
  surface.across = camera_from_world.rotation * surface.across;
  surface.up = camera_from_world.rotation * surface.up;
  return surface;
}

// Of a surface in the camera's frame.
bool IsSeenFromBehind(const Surface& surface) {
  return !surface.two_sided && surface.across.cross(surface.up).dot(surface.corner) >= 0.0;
}

// Whether part of the surface, in the camera's frame, can lie inside the picture or within `margin_px` around it.
bool IsInSight(const Surface& surface, const CameraCalibration& camera, double margin_px) {
  // Planes through the eye and the picture's borders: all four corners beyond one of them can't be seen.
  const double left = (-camera.cx_px - margin_px) / camera.fx_px;
  const double right = (camera.width_px - camera.cx_px + margin_px) / camera.fx_px;
  const double top = (-camera.cy_px - margin_px) / camera.fy_px;
  const double bottom = (camera.height_px - camera.cy_px + margin_px) / camera.fy_px;
  int beyond[5] = {};
  for (const Eigen::Vector3d& p : surface.Corners()) {
    beyond[0] += p.z() < kNearM ? 1 : 0;
    beyond[1] += p.x() < left * p.z() ? 1 : 0;
    beyond[2] += p.x() > right * p.z() ? 1 : 0;
    beyond[3] += p.y() < top * p.z() ? 1 : 0;
    beyond[4] += p.y() > bottom * p.z() ? 1 : 0;
  }
  return std::none_of(std::begin(beyond), std::end(beyond), [](int num) { return num == 4; });
}

// Its body at this time; nullopt once it has left its way.
std::optional<std::vector<Surface>> Place(const Mover& mover, double time_s) {
  const double position = mover.position_m(time_s) / kMoverStepM;
  if (position < 1.0 || position + 2.0 >= static_cast<double>(mover.way.size())) return std::nullopt;
  const auto i = static_cast<size_t>(position);
  const Eigen::Vector2d step = mover.way[i + 1] - mover.way[i];
  const Eigen::Vector2d middle = mover.way[i] + (position - static_cast<double>(i)) * step;
  // Between the directions of the segments before and after, so that it turns smoothly.
  const Eigen::Vector2d ahead = (mover.way[i + 2] - mover.way[i - 1]).normalized();
  const Eigen::Vector2d right = RightOf(ahead);
  const auto turn = [&](const Eigen::Vector3d& v) -> Eigen::Vector3d {
    const Eigen::Vector2d ground = v.x() * right + v.z() * ahead;
    return {ground.x(), v.y(), ground.y()};
  };
  std::vector<Surface> body = mover.body;
  for (Surface& surface : body) {
    surface.corner = turn(surface.corner) + Eigen::Vector3d(middle.x(), 0.0, middle.y());
    surface.across = turn(surface.across);
    surface.up = turn(surface.up);
  }
  return body;
}

}  // namespace

Renderer::Renderer(std::shared_ptr<const World> world) : world_(std::move(world)), paints_(world_) {}
Renderer::~Renderer() = default;

void Renderer::Collect(const CameraCalibration& camera, const Rigid3& world_from_camera, double time_s,
                       double margin_px) {
  visible_.clear();
  const Rigid3 camera_from_world = world_from_camera.Inverse();
  const Eigen::Vector3d eye = camera_from_world.Inverse().translation;
  const auto add = [&](const Surface& surface, double sight_m) {
    const double distance = (surface.Center() - eye).norm() - 0.5 * (surface.across + surface.up).norm();
    if (distance >= sight_m) return;
    if (IsInSight(InCamera(camera_from_world, surface), camera, margin_px)) {
      visible_.push_back({distance, visible_.size(), surface});
    }
  };
  for (const Surface& surface : world_->surfaces) add(surface, world_->sight_m);
  for (const Surface& surface : world_->far) add(surface, 1e9);
  for (const Mover& mover : world_->movers) {
    const auto body = Place(mover, time_s);
    if (!body || (body->front().Center() - eye).norm() < mover.gap_m) continue;
    for (const Surface& surface : *body) add(surface, world_->sight_m);
  }
  std::sort(visible_.begin(), visible_.end(), [](const Visible& a, const Visible& b) {
    return std::pair(a.distance_m, a.order) < std::pair(b.distance_m, b.order);
  });
}

void Renderer::Clear(const CameraCalibration& camera, Rendering& out) const {
  if (out.radiance.width != camera.width_px || out.radiance.height != camera.height_px) {
    out = {RadianceImage(camera.width_px, camera.height_px), InverseDepthImage(camera.width_px, camera.height_px),
           GrayImage()};
  }
  std::fill(out.radiance.pixels.begin(), out.radiance.pixels.end(), kHorizonGray);
  std::fill(out.inverse_depth.pixels.begin(), out.inverse_depth.pixels.end(), 0.0F);
}

void Renderer::DrawBody(const CameraCalibration& camera, const Rigid3& body_from_camera, Rendering& out) {
  if (world_->body.empty()) return;
  Drawer drawer(camera, 0, camera.height_px, out);
  const Rigid3 camera_from_body = body_from_camera.Inverse();
  for (const Surface& surface : world_->body) {
    drawer.Draw(InCamera(camera_from_body, surface), paints_.Get(surface.paint));
  }
  out.body = GrayImage(camera.width_px, camera.height_px);
  for (size_t i = 0; i < out.body.pixels.size(); ++i) out.body.pixels[i] = out.inverse_depth.pixels[i] > 0.0F ? 1 : 0;
}

void Renderer::DrawRows(const CameraCalibration& camera, const Rigid3& world_from_camera, int first, int last,
                        Rendering& out) {
  const Rigid3 camera_from_world = world_from_camera.Inverse();
  Drawer drawer(camera, first, last, out);
  for (const Visible& visible : visible_) {
    const Surface surface = InCamera(camera_from_world, visible.surface);
    if (IsSeenFromBehind(surface)) continue;
    drawer.Draw(surface, paints_.Get(surface.paint));
  }
}

void Renderer::Render(const CameraCalibration& camera, const Rigid3& world_from_camera, double time_s, Rendering& out,
                      const Rigid3& body_from_camera) {
  Clear(camera, out);
  DrawBody(camera, body_from_camera, out);
  Collect(camera, world_from_camera, time_s, 0.0);
  DrawRows(camera, world_from_camera, 0, camera.height_px, out);
}

void Renderer::RenderRolling(const CameraCalibration& camera, const std::function<Rigid3(double)>& world_from_camera,
                             double time_s, Rendering& out, const Rigid3& body_from_camera) {
  Clear(camera, out);
  DrawBody(camera, body_from_camera, out);
  Collect(camera, world_from_camera(0.5 * (camera.height_px - 1)), time_s, 0.3 * camera.fx_px);
  for (int first = 0; first < camera.height_px; first += kBandRows) {
    const int last = std::min(first + kBandRows, camera.height_px);
    DrawRows(camera, world_from_camera(0.5 * (first + last - 1)), first, last, out);
  }
}

}  // namespace tessera

// A simulated world is the same every time, and its images, depths and poses tell one story.
#include "simulation/simulation.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "core/sha256.h"

namespace tessera {
namespace {

SimulationOptions Small(const std::string& name) { return ParseSimulation(name + ",scale=0.3"); }

std::string HashOfFrame(const CameraFrame& frame) {
  Sha256 hash;
  for (const GrayImage* image : {&frame.left, &frame.right}) hash.Add(image->pixels.data(), image->pixels.size());
  hash.Add(frame.depth.pixels.data(), frame.depth.pixels.size() * sizeof(uint16_t));
  return hash.HexDigest();
}

struct Scene {
  const char* name;
  SensorType sensor;
  std::vector<int64_t> frames;  // that are looked at
};
const Scene kScenes[] = {{"street", SensorType::kStereo, {10, 130, 300}},
                         {"street-short", SensorType::kMono, {10, 130, 300}},
                         {"room", SensorType::kRgbd, {10, 130, 300}},
                         {"country", SensorType::kMono, {150}},  // takes a second to paint
                         {"walk", SensorType::kStereo, {20}},
                         {"desk", SensorType::kRgbd, {10, 150, 300}},
                         {"robot", SensorType::kMono, {10, 300}}};

TEST(Simulation, AFrameIsTheSameWhateverWasRenderedBefore) {
  for (const Scene& scene : kScenes) {
    Simulation first(Small(scene.name), scene.sensor);
    Simulation second(Small(scene.name), scene.sensor);
    const std::string expected = HashOfFrame(first.Render(FrameId{40}));
    EXPECT_EQ(HashOfFrame(first.Render(FrameId{40})), expected) << scene.name;
    for (const int64_t frame : scene.frames) second.Render(FrameId{frame});
    EXPECT_EQ(HashOfFrame(second.Render(FrameId{40})), expected) << scene.name;
    EXPECT_NE(HashOfFrame(second.Render(FrameId{41})), expected) << scene.name;
  }
}

TEST(Simulation, AnotherProcessRendersTheSame) {
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  const auto hash = [] {
    return HashOfFrame(Simulation(Small("street-short"), SensorType::kStereo).Render(FrameId{17}));
  };
  const pid_t child = fork();
  if (child == 0) {
    const std::string own = hash();
    _exit(write(pipe_ends[1], own.data(), own.size()) == static_cast<ssize_t>(own.size()) ? 0 : 1);
  }
  const std::string expected = hash();
  std::string received(expected.size(), ' ');
  ASSERT_EQ(read(pipe_ends[0], received.data(), received.size()), static_cast<ssize_t>(expected.size()));
  waitpid(child, nullptr, 0);
  EXPECT_EQ(received, expected);
}

TEST(Simulation, SeedsMakeDifferentWorlds) {
  Simulation one(Small("street,seed=1"), SensorType::kMono);
  Simulation two(Small("street,seed=2"), SensorType::kMono);
  EXPECT_NE(HashOfFrame(one.Render(FrameId{0})), HashOfFrame(two.Render(FrameId{0})));
}

// Gray value (0..255) and inverse depth between pixels.
struct Sample {
  double gray, inverse_depth, contrast;
};
Sample SampleAt(const Rendering& r, const Eigen::Vector2d& p) {
  const int x = static_cast<int>(p.x()), y = static_cast<int>(p.y());
  const double u = p.x() - x, v = p.y() - y;
  const auto gray = [&](int i, int j) { return r.radiance.row(y + j)[x + i] / 256.0; };
  const double low = std::min({gray(0, 0), gray(1, 0), gray(0, 1), gray(1, 1)});
  const double high = std::max({gray(0, 0), gray(1, 0), gray(0, 1), gray(1, 1)});
  return {(1 - v) * ((1 - u) * gray(0, 0) + u * gray(1, 0)) + v * ((1 - u) * gray(0, 1) + u * gray(1, 1)),
          static_cast<double>(
              r.inverse_depth.row(static_cast<int>(std::lround(p.y())))[static_cast<int>(std::lround(p.x()))]),
          high - low};
}

// Sends every pixel of one picture by its depth into another; where the other sees the same place, it must see the same
// gray, but for what lies between its own pixels. Each row has its own pose. Returns the share of pixels that were
// compared.
double ExpectSameGray(const Simulation& simulation, FrameId from_frame, FrameId to_frame, const Rendering& from,
                      const Rendering& to) {
  const CameraCalibration& camera = simulation.calibration();
  const Rigid3 middle_from_world = simulation.WorldFromCamera(to_frame).Inverse();
  int num_compared = 0, num_different = 0;
  double sum_squared = 0.0;
  for (int y = 0; y < camera.height_px; ++y) {
    const Rigid3 world_from_row = simulation.WorldFromCameraAtRow(from_frame, y);
    for (int x = 0; x < camera.width_px; ++x) {
      const double w = static_cast<double>(from.inverse_depth.row(y)[x]);
      if (w <= 0.0) continue;
      const Eigen::Vector3d in_world = world_from_row * (camera.Ray(Eigen::Vector2d(x, y)) / w);
      Eigen::Vector3d point = middle_from_world * in_world;
      if (point.z() < 0.2) continue;
      // The row that sees the point, found from the middle row's view.
      if (simulation.WorldFromCameraAtRow(to_frame, 0.0).translation !=
          simulation.WorldFromCamera(to_frame).translation) {
        for (int i = 0; i < 2; ++i) {
          const double row = camera.Project(point).y();
          point = simulation.WorldFromCameraAtRow(to_frame, row).Inverse() * in_world;
        }
      }
      const Eigen::Vector2d p = camera.Project(point);
      if (p.x() < 1 || p.y() < 1 || p.x() > camera.width_px - 3 || p.y() > camera.height_px - 3) continue;
      const Sample sample = SampleAt(to, p);
      if (std::abs(sample.inverse_depth * point.z() - 1.0) > 0.02) continue;  // hidden by something nearer
      const double difference = sample.gray - from.radiance.row(y)[x] / 256.0;
      ++num_compared;
      sum_squared += difference * difference;
      num_different += std::abs(difference) > 8.0 + sample.contrast ? 1 : 0;
    }
  }
  EXPECT_LT(std::sqrt(sum_squared / num_compared), 12.0);
  EXPECT_LT(num_different, num_compared / 25);
  return static_cast<double>(num_compared) / (camera.width_px * camera.height_px);
}

TEST(Simulation, DepthAndPoseExplainTheNextImage) {
  for (const Scene& scene : kScenes) {
    Simulation simulation(ParseSimulation(scene.name), scene.sensor);
    for (const int64_t number : scene.frames) {
      Rendering from, to;
      simulation.RenderPerfect(FrameId{number}, from);
      simulation.RenderPerfect(FrameId{number + 1}, to);
      const double share = ExpectSameGray(simulation, FrameId{number}, FrameId{number + 1}, from, to);
      EXPECT_GT(share, 0.5) << scene.name << " " << number;
    }
  }
}

// What carries the camera stays where it is in the picture, near, and sharp however the camera moves; above it, the
// world is as it was.
TEST(Simulation, TheCamerasOwnBodyStaysWhereItIs) {
  Simulation without(Small("robot,noise=0"), SensorType::kRgbd);
  Simulation simulation(Small("robot,noise=0,body=0.2"), SensorType::kRgbd);
  const CameraFrame early = simulation.Render(FrameId{30}), late = simulation.Render(FrameId{225});
  const CameraFrame bare = without.Render(FrameId{225});
  const int border = static_cast<int>(0.8 * late.left.height) + 1;
  int num = 0, num_same = 0, num_changed = 0;
  for (int y = 0; y < late.left.height; ++y) {
    for (int x = 0; x < late.left.width; ++x) {
      const bool is_near = late.depth.row(y)[x] < 800;  // mm
      if (y < border - late.left.height / 8) {
        EXPECT_EQ(late.left.row(y)[x], bare.left.row(y)[x]);
      } else if (y > border && is_near) {
        ++num;
        num_same += early.depth.row(y)[x] == late.depth.row(y)[x] ? 1 : 0;
        num_changed += bare.left.row(y)[x] != late.left.row(y)[x] ? 1 : 0;
      }
    }
  }
  EXPECT_GT(num, late.left.width * late.left.height / 10);
  EXPECT_EQ(num_same, num);
  EXPECT_GT(num_changed, num / 2);
}

TEST(Simulation, StereoSeesTheBodyFromBothEyes) {
  Simulation simulation(Small("street-short,body=0.2,noise=0"), SensorType::kStereo);
  const CameraFrame frame = simulation.Render(FrameId{20});
  Simulation bare(Small("street-short,noise=0"), SensorType::kStereo);
  const CameraFrame other = bare.Render(FrameId{20});
  const int row = frame.left.height - 3;
  const auto differ = [row](const GrayImage& a, const GrayImage& b) {
    return std::mismatch(a.row(row), a.row(row) + a.width, b.row(row)).first != a.row(row) + a.width;
  };
  EXPECT_TRUE(differ(frame.left, other.left));
  EXPECT_TRUE(differ(frame.right, other.right));
  EXPECT_TRUE(differ(frame.left, frame.right));
}

TEST(Simulation, TheTimeIsStampedIntoTheUpperLeftCorner) {
  Simulation bare(Small("room"), SensorType::kMono), stamped(Small("room,stamp=1"), SensorType::kMono);
  const GrayImage without = bare.Render(FrameId{5}).left, with = stamped.Render(FrameId{5}).left;
  const GrayImage later = stamped.Render(FrameId{40}).left;
  int num_white = 0, num_below = 0;
  for (int y = 0; y < with.height; ++y) {
    for (int x = 0; x < with.width; ++x) {
      num_white += with.row(y)[x] == 245 && later.row(y)[x] == 245 ? 1 : 0;
      num_below += y > with.height / 4 && with.row(y)[x] != without.row(y)[x] ? 1 : 0;
    }
  }
  EXPECT_GT(num_white, 100) << "the date";
  EXPECT_EQ(num_below, 0);
}

TEST(Simulation, NoiseIsAsOrdered) {
  Simulation quiet(ParseSimulation("room,noise=0,scale=0.5"), SensorType::kMono);
  Simulation noisy(ParseSimulation("room,noise=2,scale=0.5"), SensorType::kMono);
  const GrayImage a = quiet.Render(FrameId{5}).left;
  const GrayImage b = noisy.Render(FrameId{5}).left;
  double sum = 0.0, sum_squared = 0.0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    const double difference = static_cast<double>(b.pixels[i]) - static_cast<double>(a.pixels[i]);
    sum += difference;
    sum_squared += difference * difference;
  }
  const auto num = static_cast<double>(a.pixels.size());
  EXPECT_NEAR(sum / num, 0.0, 0.1);
  // Read noise 2.6, and shot noise of about 0.048 per gray value of some 100.
  EXPECT_NEAR(std::sqrt(sum_squared / num), std::sqrt(2.6 * 2.6 + 0.048 * 100.0), 0.6);
}

TEST(Simulation, TheDriveKeepsItsDistance) {
  Simulation simulation(Small("street"), SensorType::kMono);
  EXPECT_GE(simulation.num_frames(), 2000);
  Rendering rendering;
  for (int64_t frame = 0; frame < simulation.num_frames(); frame += 97) {
    simulation.RenderPerfect(FrameId{frame}, rendering);
    const float nearest =
        *std::max_element(rendering.inverse_depth.pixels.begin(), rendering.inverse_depth.pixels.end());
    EXPECT_LT(nearest, 1.0F / 1.2F) << frame;
    const Rigid3 step = simulation.WorldFromCamera(FrameId{frame}).Inverse() *
                        simulation.WorldFromCamera(FrameId{std::min(frame + 1, simulation.num_frames() - 1)});
    EXPECT_LT(step.translation.norm(), 0.9) << frame;
  }
}

TEST(ParseSimulation, ReadsOptions) {
  const SimulationOptions options = ParseSimulation("street-short,seed=7,length=120.5,speed=2");
  EXPECT_EQ(options.scene, SimulationOptions::Scene::kStreetShort);
  EXPECT_EQ(options.seed, 7U);
  EXPECT_EQ(options.length_m, 120.5);
  EXPECT_EQ(options.speed, 2.0);
}

TEST(ParseSimulation, RefusesNonsense) {
  for (const char* text : {"", "moon", "street,", "street,seed", "street,seed=x", "street,seed=-1", "street,speed=0",
                           "street,noise=-1", "street,scale=100", "room,color=1", "street,length=nan", "street,seed=3 ",
                           "desk,readout=-2", "desk,readout=500", "desk,depth_delay=150", "desk,right_delay=150"}) {
    EXPECT_THROW(ParseSimulation(text), InputError) << text;
  }
  EXPECT_THROW(Simulation(ParseSimulation("street,path=/nowhere"), SensorType::kMono), InputError);
}

}  // namespace
}  // namespace tessera
